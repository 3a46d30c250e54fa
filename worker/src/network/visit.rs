//! A short visit to a master, to see how the connection is: in, some of the scene, and out again before any question.

use std::net::SocketAddr;
use std::time::{Duration, Instant};

use protocol::message::{Kind, ToMaster, ToWorker, WANT_MAX, decode};
use protocol::parts::{Hash, Manifest};
use quinn::{Connection, RecvStream, SendStream};

use super::session::{ReadError, connect, read, receive_part, send_message};
use super::{NetworkError, Options};

/// What a visit has shown.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Visit {
    /// Where the master is.
    pub master: SocketAddr,
    /// Time to find it and to be let in.
    pub greeting: Duration,
    /// There and back.
    pub round_trip: Duration,
    /// Bytes of the largest packet that arrives.
    pub mtu: u16,
    /// Bytes of scene parts, and the time they took; `None` if the master has no scene.
    pub fetched: Option<(usize, Duration)>,
}

/// Enough of a scene is fetched, bytes or time.
const BYTES_ENOUGH: usize = 64 << 20;
const TIME_ENOUGH: Duration = Duration::from_secs(3);
/// Longest wait for the master to tell a scene.
const PATIENCE: Duration = Duration::from_secs(2);

/// Goes there, and comes back.
///
/// # Errors
/// Why it did not get that far.
pub async fn visit(options: &Options) -> Result<Visit, NetworkError> {
    let begun = Instant::now();
    let (connection, mut send, mut recv) = connect(options).await?;
    let greeting = begun.elapsed();
    let world = tokio::time::timeout(PATIENCE, world(&mut recv)).await;
    let fetched = match world {
        Ok(world) => Some(fetch(&connection, &mut send, world?).await?),
        Err(_) => None,
    };
    let visit = Visit {
        master: connection.remote_address(),
        greeting,
        round_trip: connection.rtt(),
        mtu: connection.stats().path.current_mtu,
        fetched,
    };
    let reason = "it only came to look".to_owned();
    // The master may have hung up; nothing depends on it.
    let _ = send_message(&mut send, &ToMaster::Goodbye { reason }).await;
    let _ = send.finish();
    let _ = tokio::time::timeout(PATIENCE, send.stopped()).await;
    Ok(visit)
}

/// The world that the master tells of first.
async fn world(recv: &mut RecvStream) -> Result<Hash, NetworkError> {
    loop {
        let (header, body) = read(recv).await.map_err(|error| match error {
            ReadError::Wire(error) => NetworkError::Broken(format!("the master talks nonsense: {error}")),
            ReadError::Stream(reason) => NetworkError::Lost(format!("connection lost: {reason}")),
        })?;
        let message: ToWorker = decode(header.kind, &body)
            .map_err(|error| NetworkError::Broken(format!("{:?}: {error}", Kind::ToWorker)))?;
        match message {
            ToWorker::World { state, .. } => return Ok(state.world),
            ToWorker::Goodbye { reason } => {
                return Err(NetworkError::Lost(format!("the master says good-bye: {reason}")));
            }
            _ => {}
        }
    }
}

/// Some of the scene: bytes, and the time they took.
async fn fetch(connection: &Connection, send: &mut SendStream, world: Hash) -> Result<(usize, Duration), NetworkError> {
    send_message(send, &ToMaster::Want { hashes: vec![world] }).await?;
    let manifest = receive_part(connection).await?;
    let manifest = Manifest::parse(&manifest.bytes).map_err(|error| NetworkError::Broken(error.to_string()))?;
    let begun = Instant::now();
    let mut bytes = 0;
    'parts: for hashes in manifest.parts().chunks(WANT_MAX) {
        send_message(send, &ToMaster::Want { hashes: hashes.to_vec() }).await?;
        for _ in hashes {
            bytes += receive_part(connection).await?.bytes.len();
            if bytes >= BYTES_ENOUGH || begun.elapsed() >= TIME_ENOUGH {
                break 'parts;
            }
        }
    }
    Ok((bytes, begun.elapsed()))
}
