//! one worker that is in: its messages, the parts of the scene it wants, its answers.

use std::collections::BTreeMap;
use std::sync::mpsc::Sender;
use std::sync::{Arc, Mutex, PoisonError};

use protocol::answer::Cost;
use protocol::identity::Fingerprint;
use protocol::message::{
    Answered, HEADER_LEN, Header, Hello, Kind, ToMaster, ToWorker, WireError, decode, encode, encode_blob_header,
};
use protocol::pack::decompress;
use protocol::parts::Hash;
use protocol::schedule::{HELD_PER_THREAD, QuestionId, WorkerId};
use quinn::{Connection, RecvStream, SendStream, VarInt};
use tokio::sync::mpsc::error::TrySendError;
use tokio::sync::{Semaphore, mpsc};

use super::Traffic;
use super::keys::Keys;
use super::limits::{
    ANSWER_HEAD_MAX, ANSWERS_WAITING, FAREWELL, FIRST_ROOM, MESSAGES_MAX, MESSAGES_WAITING, WANTS_MAX,
};
use crate::cluster::{Known, Ledger, Link, Note, Report};

/// A worker that has proved itself.
pub(super) struct RemoteWorker {
    pub(super) number: u64,
    pub(super) hello: Hello,
    /// Tokens, and which of them it came in with.
    pub(super) keys: Arc<Keys>,
    pub(super) token: Fingerprint,
    pub(super) connection: Connection,
    pub(super) streams: (SendStream, RecvStream),
    pub(super) dispatcher: Sender<Note>,
    pub(super) traffic: Arc<Traffic>,
}

/// Parts that a worker may want, by hash.
type Offer = Arc<Mutex<Arc<BTreeMap<Hash, Arc<[u8]>>>>>;

impl RemoteWorker {
    /// Carries everything to and fro until the connection ends.
    pub(super) async fn stay(self) {
        let Self { number, hello, keys, token, connection, streams: (send, recv), dispatcher, traffic } = self;
        let worker = WorkerId(number);
        let (messages, outgoing) = mpsc::channel(MESSAGES_MAX);
        let (wants, parts_wanted) = mpsc::channel(WANTS_MAX);
        let (offer, ledger) = (Offer::default(), Ledger::default());
        let link = Box::new(Far { messages, wants, offer: Arc::clone(&offer), ledger: ledger.clone() });
        let address = Some(connection.remote_address());
        let report = |report| drop(dispatcher.send(Note::Report(worker, report)));

        traffic.enter(number, &connection);
        let (name, threads, depth, is_trusted) = (hello.name, hello.threads, HELD_PER_THREAD, false);
        report(Report::Joined { name, threads, depth, address, is_trusted, link });
        let reason = tokio::select! {
            () = write(send, outgoing) => "told to go".to_owned(),
            reason = read_messages(recv, &report) => reason,
            reason = upload(&connection, parts_wanted, &offer) => reason,
            reason = collect(&connection, worker, &ledger, &dispatcher, &traffic) => reason,
            never = dismiss(&keys, token, &report) => never,
        };
        report(Report::Left(reason));
        connection.close(VarInt::from_u32(0), b"good-bye");
        traffic.leave(number);
    }
}

/// The dispatcher's end of the way to a worker.
struct Far {
    messages: mpsc::Sender<ToWorker>,
    wants: mpsc::Sender<Vec<Hash>>,
    offer: Offer,
    ledger: Ledger,
}

impl Link for Far {
    fn send(&mut self, message: ToWorker) -> Result<(), String> {
        self.ledger.note(&message);
        told(self.messages.try_send(message), "it does not listen any more")
    }

    fn offer(&mut self, known: &Arc<Known>) {
        self.ledger.turn_to(known);
        *self.offer.lock().unwrap_or_else(PoisonError::into_inner) = Arc::clone(&known.parts);
    }

    fn want(&mut self, parts: Vec<Hash>) -> Result<(), String> {
        told(self.wants.try_send(parts), "it wants too many scene parts")
    }
}

/// What came of telling it something. Where nobody is left to pass it on, the connection has ended, and the report that says
/// why is on its way: another reason must not overtake it.
fn told<T>(sent: Result<(), TrySendError<T>>, if_full: &str) -> Result<(), String> {
    match sent {
        Ok(()) | Err(TrySendError::Closed(_)) => Ok(()),
        Err(TrySendError::Full(_)) => Err(if_full.into()),
    }
}

/// Says what the dispatcher wants said; returns when all is said and heard, or nobody listens.
async fn write(mut send: SendStream, mut messages: mpsc::Receiver<ToWorker>) {
    // Questions overtake parts of scenes.
    let _ = send.set_priority(1);
    while let Some(message) = messages.recv().await {
        let bytes = match encode(&message) {
            Ok(bytes) => bytes,
            Err(error) => {
                tracing::error!("cannot send a message: {error}");
                return;
            }
        };
        if send.write_all(&bytes).await.is_err() {
            // `read_messages` says why.
            return std::future::pending().await;
        }
    }
    let _ = send.finish();
    let _ = tokio::time::timeout(FAREWELL, send.stopped()).await;
}

/// Passes a worker's messages on to the dispatcher; returns why there are no more.
async fn read_messages(mut recv: RecvStream, report: &impl Fn(Report)) -> String {
    let places = Arc::new(Semaphore::new(MESSAGES_WAITING));
    loop {
        let Ok(place) = Arc::clone(&places).acquire_owned().await else { return "closed".into() };
        let message = match read(&mut recv, |kind| kind == Kind::ToMaster, usize::MAX).await {
            Ok((header, body)) => decode::<ToMaster>(header.kind, &body).map_err(ReadError::Wire),
            Err(error) => Err(error),
        };
        match message {
            Ok(message) => report(Report::Received { message, _room: Some(place) }),
            Err(ReadError::Wire(error)) => return format!("it talks nonsense: {error}"),
            Err(ReadError::Stream(reason)) => return reason,
        }
    }
}

/// Sends the parts that a worker wants, one after the other, each on a stream of its own that gives
/// way to everything else.
async fn upload(connection: &Connection, mut wants: mpsc::Receiver<Vec<Hash>>, offer: &Offer) -> String {
    while let Some(hashes) = wants.recv().await {
        for hash in hashes {
            let part = offer.lock().unwrap_or_else(PoisonError::into_inner).get(&hash).cloned();
            // What is not offered belongs to a world that is no more: the worker will hear of the new one.
            let Some(part) = part else { continue };
            if let Err(reason) = send_part(connection, &hash, &part).await {
                return reason;
            }
        }
    }
    // The dispatcher has let go; `write` says the last words.
    std::future::pending().await
}

async fn send_part(connection: &Connection, hash: &Hash, part: &[u8]) -> Result<(), String> {
    let lost = |error: &dyn std::fmt::Display| format!("connection lost: {error}");
    let mut stream = connection.open_uni().await.map_err(|error| lost(&error))?;
    let _ = stream.set_priority(-1);
    stream.write_all(&encode_blob_header(hash, part.len())).await.map_err(|error| lost(&error))?;
    stream.write_all(part).await.map_err(|error| lost(&error))?;
    stream.finish().map_err(|error| lost(&error))
}

/// Has the dispatcher say good-bye when its token is revoked.
async fn dismiss(keys: &Keys, token: Fingerprint, report: &impl Fn(Report)) -> String {
    keys.revoked(token).await;
    report(Report::Left(REVOKED.into()));
    std::future::pending().await
}

/// What a worker is told whose token is valid no more.
const REVOKED: &str = "its token is valid no more: it needs the master's new one";

/// Receives answers, each on a stream of its own, in any order.
async fn collect(
    connection: &Connection,
    worker: WorkerId,
    ledger: &Ledger,
    dispatcher: &Sender<Note>,
    traffic: &Arc<Traffic>,
) -> String {
    let places = Arc::new(Semaphore::new(ANSWERS_WAITING));
    loop {
        let Ok(place) = Arc::clone(&places).acquire_owned().await else { return "closed".into() };
        let stream = match connection.accept_uni().await {
            Ok(stream) => stream,
            Err(error) => return error.to_string(),
        };
        let (connection, dispatcher, traffic) = (connection.clone(), dispatcher.clone(), Arc::clone(traffic));
        let ledger = ledger.clone();
        tokio::spawn(async move {
            match receive(stream, traffic.packed_limit(), traffic.hands_on).await {
                Ok(Received { id, cost, packed, bytes, as_it_came }) => {
                    let (content, round_trip) = (Box::new(ledger.content(id, packed)), connection.rtt());
                    let answered =
                        Report::Answered { id, cost, content, bytes, as_it_came, round_trip, _room: Some(place) };
                    let _ = dispatcher.send(Note::Report(worker, answered));
                }
                Err(ReadError::Wire(error)) => {
                    let _ = dispatcher.send(Note::Report(worker, Report::Left(format!("it sends nonsense: {error}"))));
                    connection.close(VarInt::from_u32(2), b"nonsense");
                }
                // The connection is gone, which others have noticed.
                Err(ReadError::Stream(_)) => {}
            }
        });
    }
}

/// An answer that has come; it is hostile.
struct Received {
    id: QuestionId,
    cost: Cost,
    /// Or why it could not be decompressed.
    packed: Result<Vec<u8>, String>,
    /// Length on its way.
    bytes: u64,
    /// What was decompressed, if it is to be handed on; else empty.
    as_it_came: Vec<u8>,
}

async fn receive(mut stream: RecvStream, packed_limit: usize, hands_on: bool) -> Result<Received, ReadError> {
    let limit = packed_limit + ANSWER_HEAD_MAX;
    let (header, body) = read(&mut stream, |kind| kind == Kind::Answer, limit).await?;
    let bytes = (HEADER_LEN + body.len()) as u64;
    let (id, cost, squeezed) = Answered::parts(header.kind, &body).map_err(ReadError::Wire)?;
    let packed = decompress(squeezed, packed_limit).map_err(|error| error.to_string());
    let as_it_came = if hands_on { squeezed.to_vec() } else { Vec::new() };
    Ok(Received { id, cost, packed, bytes, as_it_came })
}

/// A message that could not be read.
pub(super) enum ReadError {
    /// It makes no sense.
    Wire(WireError),
    /// It never came; why.
    Stream(String),
}

/// Reads one message of an allowed kind; its length is checked before room is made for it, and room
/// is made only as bytes come in.
pub(super) async fn read(
    recv: &mut RecvStream,
    allowed: impl Fn(Kind) -> bool,
    limit: usize,
) -> Result<(Header, Vec<u8>), ReadError> {
    let mut head = [0; HEADER_LEN];
    recv.read_exact(&mut head).await.map_err(|error| ReadError::Stream(error.to_string()))?;
    let header = Header::parse(head).map_err(ReadError::Wire)?;
    if !allowed(header.kind) {
        return Err(ReadError::Wire(WireError::Kind(header.kind as u8)));
    }
    let length = header.length as usize;
    if length > limit {
        return Err(ReadError::Wire(WireError::TooLong { length: header.length, limit }));
    }
    let mut body = Vec::with_capacity(length.min(FIRST_ROOM));
    while body.len() < length {
        let chunk = recv.read_chunk(length - body.len(), true).await;
        match chunk.map_err(|error| ReadError::Stream(error.to_string()))? {
            Some(chunk) => body.extend_from_slice(&chunk.bytes),
            None => return Err(ReadError::Stream("the stream ended early".into())),
        }
    }
    Ok((header, body))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn who_has_gone_says_why_and_who_does_not_read_is_let_go() {
        let (messages, outgoing) = mpsc::channel(1);
        let (wants, _parts_wanted) = mpsc::channel(1);
        let mut far = Far { messages, wants, offer: Offer::default(), ledger: Ledger::default() };
        let word = || ToWorker::Goodbye { reason: "a word".into() };
        assert_eq!(far.send(word()), Ok(()));
        assert!(far.send(word()).is_err(), "it does not read");
        drop(outgoing);
        assert_eq!(far.send(word()), Ok(()), "its connection has told why it ended");
    }
}
