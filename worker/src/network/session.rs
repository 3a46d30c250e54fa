//! One connection to a master, from hello to good-bye.

use std::net::SocketAddr;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, OnceLock};

use protocol::identity::{Channel, EXPORT_LABEL, Role, server_name};
use protocol::message::{
    Answered, Control, HEADER_LEN, Header, Hello, Kind, NAME_MAX, Refusal, ToMaster, ToWorker, Welcome, WireError, cut,
    decode, encode,
};
use protocol::parts::{Blob, Hash, hash};
use protocol::schedule::QuestionId;
use quinn::{Connection, ConnectionError, RecvStream, SendStream, VarInt};
use tokio::sync::{Semaphore, mpsc, watch};

use super::limits::{ANSWERS_IN_FLIGHT, FAREWELL, FIRST_WORDS, HANDSHAKE, OUTBOX};
use super::{NetworkError, Options, StopSign, endpoint, tls, whereabouts};
use crate::engine::{Begun, Hands, Input, Output, Work};
use crate::pulse::Pulse;

/// How a connection ended.
pub(super) enum Ending {
    /// We were asked to stop, and have finished.
    Drained,
    /// The master has no more work; its reason.
    Farewell(String),
    /// We cannot work on what it has; why.
    Unable(String),
    /// The master was killed and started again, and knows nothing of us.
    Forgotten,
}

/// What hears the master.
type Ear = dyn Fn(Input) + Send + Sync;

/// Both sides close a connection with this code when they have finished.
const FINISHED: VarInt = VarInt::from_u32(0);

/// Connects and works.
pub(super) async fn work(
    options: &Options,
    hands: &dyn Hands,
    pulse: &Pulse,
    mut stop: watch::Receiver<StopSign>,
) -> Result<Ending, NetworkError> {
    let (connection, send, recv) = tokio::select! {
        greeted = connect(options) => greeted?,
        _ = stop.changed() => return Ok(Ending::Drained),
    };
    tracing::info!("joined {}", connection.remote_address());
    pulse.joined(&connection);

    let broken = |error: std::io::Error| NetworkError::Broken(format!("cannot start a thread: {error}"));
    let (outbox, outputs) = mpsc::channel(OUTBOX);
    let emit = move |output| drop(outbox.blocking_send(output));
    let Begun { ear, join } = hands.begin(Box::new(emit)).map_err(broken)?;

    let asked_to_go = AtomicBool::new(false);
    let our_goodbye = OnceLock::new();
    let outcome = tokio::select! {
        ending = write(&connection, pulse, send, outputs, &our_goodbye) => ending,
        ending = read_messages(recv, pulse, &ear) => ending,
        error = fetch(&connection, &ear) => Err(error),
        never = drain(stop, &ear, &asked_to_go) => never,
    };
    // Its last words may have been overtaken by the end of the connection.
    let end = connection.close_reason();
    let master_is_done =
        matches!(&end, Some(ConnectionError::ApplicationClosed(close)) if close.error_code == FINISHED);
    ear(Input::Abandon);
    connection.close(FINISHED, b"good-bye");
    let _ = tokio::task::spawn_blocking(join).await;
    match outcome {
        Ok(reason) if asked_to_go.load(Ordering::Relaxed) => {
            tracing::info!("{reason}");
            Ok(Ending::Drained)
        }
        Err(_) if asked_to_go.load(Ordering::Relaxed) => Ok(Ending::Drained),
        // The master returns our good-bye, or hangs up, before we know that it has heard it.
        _ if let Some(reason) = our_goodbye.into_inner() => Ok(Ending::Unable(reason)),
        Ok(reason) => Ok(Ending::Farewell(reason)),
        Err(_) if master_is_done => Ok(Ending::Farewell("it has finished".into())),
        Err(_) if end == Some(ConnectionError::Reset) => Ok(Ending::Forgotten),
        Err(error) => Err(error),
    }
}

/// Connects, and proves to each other who we are; every step of it ends in bounded time.
pub(super) async fn connect(options: &Options) -> Result<(Connection, SendStream, RecvStream), NetworkError> {
    let addresses = match &options.master {
        Some(name) => whereabouts::look_up(name).await?,
        None => whereabouts::discover(options.token.fingerprint).await?,
    };
    let connection = reach(options, &addresses).await?;
    let silent = |_| NetworkError::Lost(format!("{} says nothing", options.whom()));
    tokio::time::timeout(FIRST_WORDS, greet(options, connection)).await.map_err(silent)?
}

/// Says hello to the master of the token, whose certificate has been seen, and hears its welcome.
async fn greet(
    options: &Options,
    connection: Connection,
) -> Result<(Connection, SendStream, RecvStream), NetworkError> {
    let lost = |what: String| NetworkError::Lost(what);
    let master = &*options.whom();
    let (mut send, mut recv) = connection.open_bi().await.map_err(|error| lost_connection(master, &error))?;

    let mut channel = Channel::default();
    connection
        .export_keying_material(&mut channel, EXPORT_LABEL, b"")
        .map_err(|_| NetworkError::Broken("TLS exports no keying material".into()))?;
    let hello = Hello {
        proof: options.token.prove(Role::Worker, &channel),
        threads: u16::try_from(options.threads).unwrap_or(u16::MAX),
        name: cut(&options.name, NAME_MAX),
        bits: crate::bits::of_this_build(),
    };
    let hello = encode(&hello).map_err(|error| NetworkError::Broken(error.to_string()))?;
    send.write_all(&hello).await.map_err(|error| lost(format!("{master} hangs up: {error}")))?;

    let (header, body) = read(&mut recv).await.map_err(|error| not_greeted(master, error))?;
    if header.kind == Kind::Refusal {
        let refusal: Refusal = decode(header.kind, &body).map_err(|error| refused(master, &error.to_string()))?;
        return Err(refused(master, &refusal.reason));
    }
    let welcome: Welcome = decode(header.kind, &body).map_err(|error| refused(master, &error.to_string()))?;
    if !options.token.verify(Role::Master, &channel, &welcome.proof) {
        return Err(refused(master, "it does not know the token's secret"));
    }
    Ok((connection, send, recv))
}

/// The first of the addresses at which the master answers.
pub(super) async fn reach(options: &Options, addresses: &[SocketAddr]) -> Result<Connection, NetworkError> {
    let mut outcome = Err(NetworkError::Lost(format!("{} has no address", options.whom())));
    for address in addresses {
        outcome = handshake(options, *address).await;
        match &outcome {
            Err(NetworkError::Lost(reason)) => tracing::debug!("{reason}"),
            _ => break,
        }
    }
    outcome
}

async fn handshake(options: &Options, address: SocketAddr) -> Result<Connection, NetworkError> {
    // One of two kinds of addresses may be of no use here; the other may do.
    let unreachable =
        |error: &dyn std::fmt::Display| NetworkError::Lost(format!("{address} cannot be reached: {error}"));
    let endpoint = endpoint(address).map_err(|error| unreachable(&error))?;
    let (config, stranger) = tls::client_config(options.token.fingerprint)
        .map_err(|error| NetworkError::Broken(format!("TLS cannot be set up: {error}")))?;
    let connecting = endpoint
        .connect_with(config, address, &server_name(&options.token.fingerprint))
        .map_err(|error| unreachable(&error))?;
    let silent = |_| NetworkError::Lost(format!("{address} does not answer"));
    tokio::time::timeout(HANDSHAKE, connecting).await.map_err(silent)?.map_err(|error| {
        if stranger.load(Ordering::Relaxed) {
            return match &options.master {
                Some(name) => NetworkError::Refused(format!(
                    "{name} is not the master that this token is for: take the token that it prints now"
                )),
                // Anybody can announce the master's fingerprint with an address of somebody else.
                None => NetworkError::Lost(format!("{address} is announced as the master of this token, and is not")),
            };
        }
        lost_connection(&options.whom(), &error)
    })
}

fn refused(master: &str, reason: &str) -> NetworkError {
    NetworkError::Refused(format!("refused by {master}: {reason}"))
}

fn not_greeted(master: &str, error: ReadError) -> NetworkError {
    match error {
        ReadError::Wire(error) => NetworkError::Refused(format!("cannot work for {master}: {error}")),
        ReadError::Stream(reason) => NetworkError::Lost(format!("{master} hangs up: {reason}")),
    }
}

fn lost_connection(master: &str, error: &ConnectionError) -> NetworkError {
    NetworkError::Lost(format!("no connection to {master}: {error}"))
}

/// Passes the master's messages on to the engine; returns its last reason.
async fn read_messages(mut recv: RecvStream, pulse: &Pulse, ear: &Ear) -> Result<String, NetworkError> {
    loop {
        let message = match read(&mut recv).await {
            Ok((header, body)) => decode::<ToWorker>(header.kind, &body).map_err(ReadError::Wire),
            Err(error) => Err(error),
        };
        match message {
            Ok(ToWorker::Goodbye { reason }) => return Ok(reason),
            Ok(message) => {
                pulse.received(&message);
                ear(Input::Received(message));
            }
            Err(ReadError::Wire(error)) => {
                return Err(NetworkError::Broken(format!("the master talks nonsense: {error}")));
            }
            Err(ReadError::Stream(reason)) => return Err(NetworkError::Lost(format!("connection lost: {reason}"))),
        }
    }
}

/// Receives parts of scenes, and passes them on to the engine.
async fn fetch(connection: &Connection, ear: &Ear) -> NetworkError {
    loop {
        match receive_part(connection).await {
            Ok(part) => ear(Input::Arrived(part)),
            Err(error) => return error,
        }
    }
}

/// Receives a part of a scene, on a stream of its own.
pub(super) async fn receive_part(connection: &Connection) -> Result<Blob, NetworkError> {
    let lost = |reason: String| NetworkError::Lost(format!("connection lost: {reason}"));
    let broken = |what: String| NetworkError::Broken(format!("the master {what}"));
    let mut stream = connection.accept_uni().await.map_err(|error| lost(error.to_string()))?;
    let (header, mut body) = read(&mut stream).await.map_err(|error| match error {
        ReadError::Wire(error) => broken(format!("talks nonsense: {error}")),
        ReadError::Stream(reason) => lost(reason),
    })?;
    if header.kind != Kind::Blob || body.len() < size_of::<Hash>() {
        return Err(broken("sends something else than a scene part".into()));
    }
    let bytes = body.split_off(size_of::<Hash>());
    let claimed: Hash = body.try_into().unwrap_or_default();
    if hash(&bytes) != claimed {
        return Err(broken("sends a scene part that is not what it claims".into()));
    }
    Ok(Blob { hash: claimed, bytes })
}

/// Sends what the engine says; returns its last reason, and notes it before a good-bye is sent.
async fn write(
    connection: &Connection,
    pulse: &Pulse,
    mut send: SendStream,
    mut outputs: mpsc::Receiver<Output>,
    our_goodbye: &OnceLock<String>,
) -> Result<String, NetworkError> {
    let in_flight = Arc::new(Semaphore::new(ANSWERS_IN_FLIGHT as usize));
    // Words overtake answers.
    let _ = send.set_priority(1);
    while let Some(output) = outputs.recv().await {
        pulse.sent(&output);
        match output {
            Output::Send(message) => {
                if let ToMaster::Goodbye { reason } = &message {
                    our_goodbye.get_or_init(|| reason.clone());
                    arrived(&in_flight).await;
                }
                send_message(&mut send, &message).await?;
            }
            Output::Answer(id, work) => {
                let place = Arc::clone(&in_flight).acquire_owned().await;
                let connection = connection.clone();
                tokio::spawn(async move {
                    answer(&connection, id, work).await;
                    drop(place);
                });
            }
            Output::Stop(reason) => {
                our_goodbye.get_or_init(|| reason.clone());
                arrived(&in_flight).await;
                let _ = send.finish();
                let _ = tokio::time::timeout(FAREWELL, send.stopped()).await;
                return Ok(reason);
            }
        }
    }
    Err(NetworkError::Broken("the engine stopped".into()))
}

/// Waits until the master has all answers.
async fn arrived(in_flight: &Semaphore) {
    let _ = tokio::time::timeout(FAREWELL, in_flight.acquire_many(ANSWERS_IN_FLIGHT)).await;
}

pub(super) async fn send_message<T: Control>(send: &mut SendStream, message: &T) -> Result<(), NetworkError> {
    let bytes = encode(message).map_err(|error| NetworkError::Broken(error.to_string()))?;
    send.write_all(&bytes).await.map_err(|error| NetworkError::Lost(format!("connection lost: {error}")))
}

/// Sends an answer on a stream of its own, and waits until it is there. If the connection is lost
/// meanwhile, the master will ask somebody else.
pub(super) async fn answer(connection: &Connection, id: QuestionId, work: Work) {
    let Ok(mut stream) = connection.open_uni().await else { return };
    let answered = Answered { id, cost: work.cost, squeezed: work.bytes };
    if stream.write_all(&answered.encode()).await.is_ok() && stream.finish().is_ok() {
        let _ = stream.stopped().await;
    }
}

/// Tells the engine when somebody wants us to stop.
async fn drain(
    mut stop: watch::Receiver<StopSign>,
    ear: &Ear,
    asked_to_go: &AtomicBool,
) -> Result<String, NetworkError> {
    let sign = stop.wait_for(|sign| *sign != StopSign::Work).await.map(|sign| *sign);
    if let Ok(sign) = sign {
        tracing::info!("finishing what is begun");
        asked_to_go.store(true, Ordering::Relaxed);
        let reason = if sign == StopSign::Yield { YIELDING } else { LEAVING };
        ear(Input::Drain(reason.to_owned()));
    }
    std::future::pending().await
}

/// What the master is told when we go.
const LEAVING: &str = "the worker was asked to stop";
const YIELDING: &str = "others need the machine; the worker comes back when they have done";

/// A message that could not be read.
pub(super) enum ReadError {
    Wire(WireError),
    Stream(String),
}

/// Reads one message; its length is checked before room is made for it.
pub(super) async fn read(recv: &mut RecvStream) -> Result<(Header, Vec<u8>), ReadError> {
    let mut head = [0; HEADER_LEN];
    recv.read_exact(&mut head).await.map_err(|error| ReadError::Stream(error.to_string()))?;
    let header = Header::parse(head).map_err(ReadError::Wire)?;
    let mut body = vec![0; header.length as usize];
    recv.read_exact(&mut body).await.map_err(|error| ReadError::Stream(error.to_string()))?;
    Ok((header, body))
}
