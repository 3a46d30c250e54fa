//! What is told to those who could come: how to start a worker, where the master is, how it is.

mod announce;
pub mod invitation;
pub mod metrics;

use std::net::SocketAddr;
use std::path::Path;
use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::thread::JoinHandle;
use std::time::Duration;

use protocol::identity::Token;
use vitals::Server;

use crate::cli::HandsArgs;
use crate::cluster::Cluster;
use crate::narrator::Narrator;
use announce::Announcement;
use invitation::{Invitation, Origin};

/// Open until it is dropped.
pub struct Reception {
    _vitals: Option<Server>,
    _announcer: Option<Announcer>,
    _invitation: Option<Invitation>,
}

impl Reception {
    /// Says and does what the command line wants said and done; a token may be kept in a file.
    ///
    /// # Errors
    /// The address of `--metrics` cannot be listened at.
    pub fn open(
        hands: &HandsArgs,
        kept: Option<&Path>,
        cluster: &Cluster,
        narrator: &Narrator,
    ) -> anyhow::Result<Self> {
        let invitation = Invitation::extend(origin(hands, kept), cluster, narrator);
        let announcer = if hands.no_announce { None } else { Announcer::of(cluster)? };
        let vitals = metrics::watch(hands, cluster, narrator)?;
        Ok(Self { _vitals: vitals, _announcer: announcer, _invitation: invitation })
    }
}

/// Where the token came from; what was given counts more than what was kept.
fn origin<'a>(hands: &'a HandsArgs, kept: Option<&'a Path>) -> Origin<'a> {
    match (&hands.token_file, &hands.token, kept) {
        (Some(file), ..) => Origin::File(file),
        (None, Some(_), _) => Origin::Environment,
        (None, None, Some(kept)) => Origin::File(kept),
        (None, None, None) => Origin::Fresh,
    }
}

/// Says where the master of its tokens is, whichever are valid; until it is dropped.
pub struct Announcer {
    /// Nothing only while being dropped.
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
