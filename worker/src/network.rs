//! A worker of its own process: it connects to its master over QUIC, and again when the connection is lost.
//!
//! [`tls`] knows the master by its certificate, [`session`] is one connection from hello to good-bye.

mod session;
#[cfg(test)]
mod tests;
mod tls;

use std::net::{Ipv4Addr, Ipv6Addr, SocketAddr};
use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Duration, Instant};

use protocol::identity::Token;
use quinn::{Endpoint, EndpointConfig, TokioRuntime};
use tokio::sync::watch;

use crate::shelf::Shelf;

/// Whom to work for, and how.
#[derive(Clone, Debug)]
pub struct Options {
    /// `HOST:PORT`.
    pub master: String,
    /// What the master printed.
    pub token: Token,
    /// Questions answered at a time.
    pub threads: usize,
    /// Where scene parts are kept.
    pub cache: Option<PathBuf>,
    /// What the master calls us.
    pub name: String,
    /// Go when the master says good-bye, instead of waiting for its next start.
    pub once: bool,
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
    /// Finish what is in hand, and go.
    Drain,
}

/// Works for a master until told to stop, or refused.
///
/// # Errors
/// [`NetworkError`], never [`NetworkError::Lost`] unless [`Options::once`].
pub async fn work(options: &Options, mut stop: watch::Receiver<StopSign>) -> Result<(), NetworkError> {
    let shelf = Arc::new(match &options.cache {
        Some(folder) => Shelf::in_folder(folder).map_err(|error| {
            NetworkError::Broken(format!("cannot use the cache folder {}: {error}", folder.display()))
        })?,
        None => Shelf::in_memory(),
    });
    let mut pause = FIRST_PAUSE;
    loop {
        let begun = Instant::now();
        let outcome = session::work(options, &shelf, stop.clone()).await;
        if begun.elapsed() > LONG {
            pause = FIRST_PAUSE;
        }
        match outcome {
            Ok(session::Ending::Drained) => return Ok(()),
            Ok(session::Ending::Farewell(reason)) if options.once => {
                tracing::info!("the master says good-bye: {reason}");
                return Ok(());
            }
            Ok(session::Ending::Farewell(reason)) => {
                tracing::info!("the master says good-bye: {reason}; waiting for it to start again");
            }
            Err(NetworkError::Lost(reason)) => {
                tracing::warn!("{reason}; trying again in {:.1} s", pause.as_secs_f32());
            }
            Err(error) => return Err(error),
        }
        if *stop.borrow() != StopSign::Work {
            return Ok(());
        }
        tokio::select! {
            () = tokio::time::sleep(pause) => {}
            _ = stop.changed() => return Ok(()),
        }
        pause = (pause * 2).min(LAST_PAUSE);
    }
}

/// Pauses between attempts to connect: doubled from the first to the last.
const FIRST_PAUSE: Duration = Duration::from_millis(250);
const LAST_PAUSE: Duration = Duration::from_secs(5);
/// After a session this long, pauses are short again.
const LONG: Duration = Duration::from_secs(20);

/// Socket buffers: with the system's 208 KiB, bursts of answers lose hundreds of packets.
const SOCKET_BUFFER: usize = 4 << 20;

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
