//! A worker of its own process: it connects to its master over QUIC, and again when the connection is lost.
//!
//! [`whereabouts`] finds the master, [`tls`] knows it by its certificate, [`session`] is one connection from hello to
//! good-bye; [`stand_in`] is one of somebody who computes nothing.

mod limits;
mod session;
pub mod stand_in;
#[cfg(test)]
mod tests;
mod tls;
pub mod visit;
mod whereabouts;

use std::net::{Ipv4Addr, Ipv6Addr, SocketAddr};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};

use protocol::identity::Token;
use protocol::token_file;
use protocol::transport::SOCKET_BUFFER;
use quinn::{Endpoint, EndpointConfig, TokioRuntime};
use tokio::sync::watch;

use crate::blob_store::BlobStore;
use crate::engine::{Begun, Engine, Hands, Output, Packing, Store};
use crate::pulse::Pulse;
use crate::renderer::Light;

/// Whom to work for, and how.
#[derive(Clone, Debug)]
pub struct Options {
    /// `HOST:PORT`; `None`: wherever on this network the master of the token is.
    pub master: Option<String>,
    /// What the master printed.
    pub token: Token,
    /// Where it came from, if that was a file: it is read again before each attempt to connect.
    pub token_file: Option<PathBuf>,
    /// Questions answered at a time.
    pub threads: usize,
    /// Where scene parts are kept.
    pub cache: Option<PathBuf>,
    /// What the master calls us.
    pub name: String,
    /// Go when the master says good-bye, instead of waiting for its next start.
    pub once: bool,
    /// Where to answer those who look after us.
    pub metrics: Option<SocketAddr>,
}

impl Options {
    /// The same with the token that is in its file now; with the old one if that cannot be read.
    fn renewed(&self) -> Self {
        let found = self.token_file.as_ref().map(|file| read_token(file));
        let token = match found {
            Some(Ok(token)) => token,
            Some(Err(reason)) => {
                tracing::warn!("{reason}");
                self.token.clone()
            }
            None => self.token.clone(),
        };
        Self { token, ..self.clone() }
    }

    /// The master, for people.
    pub fn whom(&self) -> String {
        self.master.clone().unwrap_or_else(|| "the master".into())
    }
}

/// The token in a file: the first of several.
///
/// # Errors
/// In words: it cannot be read, or is none.
pub fn read_token(file: &Path) -> Result<Token, String> {
    let wrong = |reason: String| format!("cannot use the token file {}: {reason}", file.display());
    let text = secrets::file::read(file, token_file::BYTES_MAX).map_err(wrong)?;
    let first = token_file::parse(&text).map_err(wrong)?.into_iter().next();
    first.map(|entry| entry.token).ok_or_else(|| wrong("there is no token in it".into()))
}

/// Why there is no more work.
#[derive(Debug, thiserror::Error)]
pub enum NetworkError {
    /// The master does not want us, or we do not want it; trying again does not help.
    #[error("{0}")]
    Refused(String),
    /// The connection was lost or never made; trying again may help.
    #[error("{0}")]
    Lost(String),
    /// This machine does not let us work.
    #[error("{0}")]
    Broken(String),
}

/// How urgently the worker should stop.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum StopSign {
    /// Not at all.
    #[default]
    Work,
    /// Finish what is begun, and go until others leave the machine alone.
    Yield,
    /// Finish what is begun, and go.
    Drain,
}

/// Works for a master until told to stop, or refused.
///
/// # Errors
/// [`NetworkError`], never [`NetworkError::Lost`] unless [`Options::once`].
pub async fn work(options: &Options, stop: watch::Receiver<StopSign>) -> Result<(), NetworkError> {
    let hands = Computing { blobs: Arc::new(store(options.cache.as_deref())?), threads: options.threads };
    work_with(options, &hands, stop).await
}

/// As [`work`], with somebody else's hands.
///
/// # Errors
/// As [`work`].
pub async fn work_with(
    options: &Options,
    hands: &dyn Hands,
    mut stop: watch::Receiver<StopSign>,
) -> Result<(), NetworkError> {
    let pulse = Pulse::default();
    let _server = options.metrics.map(|address| pulse.serve(address)).transpose().map_err(NetworkError::Broken)?;
    let beating = tokio::spawn(pulse.clone().keep_beating());
    let outcome = work_again_and_again(options, hands, &pulse, &mut stop).await;
    beating.abort();
    outcome
}

/// Where scene parts are kept: in a folder, or in memory.
///
/// # Errors
/// The folder cannot be made.
pub fn store(cache: Option<&Path>) -> Result<BlobStore, NetworkError> {
    let in_folder = |folder: &Path| {
        BlobStore::in_folder(folder)
            .map_err(|error| NetworkError::Broken(format!("cannot use the cache folder {}: {error}", folder.display())))
    };
    cache.map_or_else(|| Ok(BlobStore::in_memory()), in_folder)
}

/// Threads of this process.
struct Computing {
    blobs: Arc<BlobStore>,
    threads: usize,
}

impl Hands for Computing {
    fn begin(&self, out: Box<dyn FnMut(Output) + Send>) -> std::io::Result<Begun> {
        let store: Arc<dyn Store> = Arc::clone(&self.blobs) as _;
        let engine = Engine::new(Light::default(), store, self.threads, Packing::Compressed)?;
        let inbox = engine.inbox();
        let thread = std::thread::Builder::new().name("engine".into()).spawn(move || engine.run(out))?;
        // Threads finish their tile; nothing else waits for it.
        let join = Box::new(move || drop(thread.join()));
        Ok(Begun { ear: Box::new(move |input| inbox.put(input)), join })
    }
}

async fn work_again_and_again(
    options: &Options,
    hands: &dyn Hands,
    pulse: &Pulse,
    stop: &mut watch::Receiver<StopSign>,
) -> Result<(), NetworkError> {
    let (mut pause, mut unable_pause) = (FIRST_PAUSE, FIRST_PAUSE);
    // Since when a token from a file has been refused.
    let mut refused: Option<Instant> = None;
    loop {
        // Home, as long as others need the machine; then either back to work, or off.
        match stop.wait_for(|sign| *sign != StopSign::Yield).await.map(|sign| *sign) {
            Ok(StopSign::Work | StopSign::Yield) => {}
            Ok(StopSign::Drain) | Err(_) => return Ok(()),
        }
        let begun = Instant::now();
        let options = options.renewed();
        let outcome = session::work(&options, hands, pulse, stop.clone()).await;
        if begun.elapsed() > LONG {
            (pause, refused) = (FIRST_PAUSE, None);
            // A large scene may be fetched for that long, and not be built again.
            if !matches!(outcome, Ok(session::Ending::Unable(_))) {
                unable_pause = FIRST_PAUSE;
            }
        }
        match outcome {
            Ok(session::Ending::Drained) => {
                pulse.left("others need this machine");
                pause = FIRST_PAUSE;
            }
            Ok(session::Ending::Farewell(reason)) if options.once => {
                tracing::info!("the master says good-bye: {reason}");
                return Ok(());
            }
            Ok(session::Ending::Farewell(reason)) => {
                tracing::info!("the master says good-bye: {reason}; waiting for it to start again");
                pulse.left(&reason);
            }
            Ok(session::Ending::Unable(reason)) if options.once => {
                return Err(NetworkError::Broken(format!("{reason} ({REMEDY})")));
            }
            Ok(session::Ending::Unable(reason)) => {
                pause = unable_pause;
                unable_pause = (unable_pause * 2).min(LAST_UNABLE_PAUSE);
                tracing::error!("{reason} ({REMEDY}); trying again in {:.1} s", pause.as_secs_f32());
                pulse.left(&reason);
            }
            // It is there: the first attempt is at once.
            Ok(session::Ending::Forgotten) => {
                tracing::warn!("{} was started again; joining it again", options.whom());
                pulse.left("the master was started again");
                pause = Duration::ZERO;
            }
            Err(NetworkError::Lost(reason)) => {
                tracing::warn!("{reason}; trying again in {:.1} s", pause.as_secs_f32());
                pulse.left(&reason);
            }
            // It may be on its way to us.
            Err(NetworkError::Refused(reason))
                if options.token_file.is_some()
                    && refused.get_or_insert_with(Instant::now).elapsed() < NEW_TOKEN_PATIENCE =>
            {
                tracing::warn!("{reason}; waiting for another token in the token file");
                pulse.left(&reason);
            }
            Err(error) => return Err(error),
        }
        if *stop.borrow() == StopSign::Drain {
            return Ok(());
        }
        tokio::select! {
            () = tokio::time::sleep(pause) => {}
            _ = stop.wait_for(|sign| *sign == StopSign::Drain) => return Ok(()),
        }
        pause = (pause * 2).clamp(FIRST_PAUSE, LAST_PAUSE);
    }
}

/// Pauses between attempts to connect: doubled from the first to the last.
const FIRST_PAUSE: Duration = Duration::from_millis(250);
const LAST_PAUSE: Duration = Duration::from_secs(5);
/// … and between attempts at a scene that cannot be built: each costs both sides something, and may be in vain.
const LAST_UNABLE_PAUSE: Duration = Duration::from_secs(180);
/// What helps against most reasons for that.
const REMEDY: &str =
    "see that both sides have the same version, and whether `igi-worker doctor` finds fault with this machine";
/// Who has its token from a file waits so long for another one when it is refused.
const NEW_TOKEN_PATIENCE: Duration = Duration::from_secs(60);
/// After a session this long, pauses are short again.
const LONG: Duration = Duration::from_secs(20);

/// A UDP socket to reach an address from.
fn endpoint(towards: SocketAddr) -> std::io::Result<Endpoint> {
    let (domain, here): (_, SocketAddr) = match towards {
        SocketAddr::V4(_) => (socket2::Domain::IPV4, (Ipv4Addr::UNSPECIFIED, 0).into()),
        SocketAddr::V6(_) => (socket2::Domain::IPV6, (Ipv6Addr::UNSPECIFIED, 0).into()),
    };
    let socket = socket2::Socket::new(domain, socket2::Type::DGRAM, Some(socket2::Protocol::UDP))?;
    // The system may allow less: then there are only more packets to send again.
    let _ = socket.set_recv_buffer_size(SOCKET_BUFFER);
    let _ = socket.set_send_buffer_size(SOCKET_BUFFER);
    socket.bind(&here.into())?;
    Endpoint::new(EndpointConfig::default(), None, socket.into(), Arc::new(TokioRuntime))
}
