//! What is told to those who could come: how to start a worker, where the master is, how it is.

mod announce;
pub mod invitation;
pub mod metrics;

use std::net::SocketAddr;
use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::thread::JoinHandle;
use std::time::Duration;

use health::Server;
use protocol::identity::Token;

use crate::cluster::Cluster;
use crate::console::Console;
use announce::Announcement;
use invitation::{Invitation, Origin};

/// What is told, and to whom.
#[derive(Clone, Debug)]
pub struct ReceptionOptions {
    /// Where the token of workers came from.
    pub origin: Origin,
    /// The address that workers reach us at, if we cannot find it out ourselves.
    pub advertise: Option<String>,
    /// Whether workers of the local network are told where this master is.
    pub announce: bool,
    /// Where `/metrics` is answered; `None`: nowhere.
    pub metrics: Option<SocketAddr>,
}

/// Open until it is dropped.
pub struct Reception {
    _server: Option<Server>,
    _announcer: Option<Announcer>,
    _invitation: Option<Invitation>,
}

impl Reception {
    /// Says and does what is wanted.
    ///
    /// # Errors
    /// The address of `--metrics` cannot be listened at.
    pub fn open(options: &ReceptionOptions, cluster: &Cluster, console: &Console) -> anyhow::Result<Self> {
        let invitation = Invitation::extend(&options.origin, options.advertise.as_deref(), cluster, console);
        let announcer = if options.announce { Announcer::of(cluster)? } else { None };
        let server = options.metrics.map(|address| metrics::watch(address, cluster, console)).transpose()?;
        Ok(Self { _server: server, _announcer: announcer, _invitation: invitation })
    }
}

/// Says where the master of its tokens is, whichever are valid; until it is dropped.
pub struct Announcer {
    /// `None` only while being dropped.
    open: Option<Sender<()>>,
    thread: Option<JoinHandle<()>>,
}

/// Tokens are looked at this often.
const BETWEEN_LOOKS: Duration = Duration::from_secs(1);

impl Announcer {
    /// For a cluster that listens.
    ///
    /// # Errors
    /// The system has no more threads.
    pub fn of(cluster: &Cluster) -> std::io::Result<Option<Self>> {
        let place = cluster.tokens().zip(cluster.address());
        place.map(|(tokens, address)| Self::start(tokens, address)).transpose()
    }

    fn start(tokens: impl Fn() -> Vec<Token> + Send + 'static, address: SocketAddr) -> std::io::Result<Self> {
        let (open, closed) = channel::<()>();
        let mut last = tokens();
        let mut announced = Announcement::begin(&last, address);
        let work = move || {
            // Workers that are told where we are do not need it.
            let failed = |reason: String| tracing::warn!("this master cannot be found by DNS-SD: {reason}");
            while closed.recv_timeout(BETWEEN_LOOKS) == Err(RecvTimeoutError::Timeout) {
                let valid = tokens();
                if valid != last {
                    announced = announced.and_then(|announced| announced.with(&valid));
                    last = valid;
                }
                if announced.is_err() {
                    break;
                }
            }
            announced.err().into_iter().for_each(failed);
        };
        let thread = std::thread::Builder::new().name("announcer".into()).spawn(work)?;
        Ok(Self { open: Some(open), thread: Some(thread) })
    }
}

impl Drop for Announcer {
    fn drop(&mut self) {
        self.open = None;
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}
