//! Where viewers and the session meet: commands one way, messages and pictures the other. No call here waits, and every
//! queue has a bound.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, PoisonError};

use tokio::sync::{broadcast, mpsc, oneshot, watch};

use super::message::{ClientMessage, ServerMessage, Spot};
use crate::cluster::Waker;
use crate::display::encoded::EncodedFrame;
use crate::display::saved::Taken;

/// A viewer's number; never used again.
pub type Viewer = u64;

/// What the session is to do.
#[derive(Debug)]
pub enum Command {
    /// A viewer has come.
    Joined {
        /// Its number.
        viewer: Viewer,
        /// Takes the messages for this viewer alone, encoded.
        sender: mpsc::Sender<Arc<str>>,
    },
    /// A message of a viewer.
    Message {
        /// Its number.
        viewer: Viewer,
        /// What it sends.
        message: ClientMessage,
    },
    /// A viewer has gone.
    Left {
        /// Its number.
        viewer: Viewer,
    },
    /// The picture as it is now is asked for, to be saved.
    Picture {
        /// Where the light meter stands, if it does.
        meter: Option<Spot>,
        /// Takes the picture; dropped if there is none yet.
        reply: oneshot::Sender<Taken>,
    },
}

impl Command {
    /// The viewer that it is about.
    fn by(&self) -> Option<Viewer> {
        match self {
            Self::Joined { viewer, .. } | Self::Message { viewer, .. } | Self::Left { viewer } => Some(*viewer),
            Self::Picture { .. } => None,
        }
    }
}

/// Messages of one viewer that wait for the session, pictures that were asked for, and all commands: a viewer that sends
/// too much at once takes no room from the others.
pub(crate) const CLIENT_MESSAGES_MAX: usize = 128;
/// Of these, files of luminaires.
pub(crate) const LUMINAIRES_WAITING: usize = 1;
const PICTURES_WAITING: usize = 4;
const COMMANDS_MAX: usize = 8192;
/// Messages to all that wait for a viewer; one that lags further behind is sent the whole state again.
const BROADCAST_MAX: usize = 256;

/// The meeting place; clones share it.
#[derive(Clone)]
pub struct Hub {
    commands: Arc<Mutex<VecDeque<Command>>>,
    waker: Waker,
    messages: broadcast::Sender<Arc<str>>,
    frames: watch::Sender<Option<Arc<EncodedFrame>>>,
}

impl Hub {
    /// Without viewers. The waker ends the session's wait for workers.
    pub fn new(waker: Waker) -> Self {
        let (messages, _) = broadcast::channel(BROADCAST_MAX);
        let (frames, _) = watch::channel(None);
        Self { commands: Arc::default(), waker, messages, frames }
    }

    /// Queues a command for the session. A message supersedes the one that the same viewer sent before it as
    /// [`ClientMessage::supersedes`] says, and a question an earlier one of its kind. Returns false if too many of its kind
    /// wait: the command is lost.
    pub fn command(&self, command: Command) -> bool {
        let mut commands = self.commands.lock().unwrap_or_else(PoisonError::into_inner);
        let was_empty = commands.is_empty();
        if let Command::Message { viewer, message } = &command {
            let kind = std::mem::discriminant(message);
            if let Some(Command::Message { viewer: other, message: last }) = commands.back_mut()
                && other == viewer
                && message.supersedes(last)
            {
                *last = message.clone();
                return true;
            }
            if message.is_question() {
                commands.retain(|earlier| {
                    !matches!(earlier, Command::Message { viewer: other, message }
                        if other == viewer && std::mem::discriminant(message) == kind)
                });
            }
        }
        let is_file =
            |command: &Command| matches!(command, Command::Message { message: ClientMessage::Hang { .. }, .. });
        let of_same = |earlier: &&Command| earlier.by() == command.by();
        let files = commands.iter().filter(of_same).filter(|earlier| is_file(earlier)).count();
        if is_file(&command) && files >= LUMINAIRES_WAITING {
            return false;
        }
        let waiting = commands.iter().filter(of_same).count();
        let room = if command.by().is_some() { CLIENT_MESSAGES_MAX } else { PICTURES_WAITING };
        // A viewer that goes always gets through, so that the controls are free again.
        if (waiting >= room || commands.len() >= COMMANDS_MAX) && !matches!(command, Command::Left { .. }) {
            return false;
        }
        commands.push_back(command);
        drop(commands);
        // The session sleeps only when it has taken all commands.
        if was_empty {
            self.waker.wake();
        }
        true
    }

    /// The next command, for the session.
    pub fn next_command(&self) -> Option<Command> {
        self.commands.lock().unwrap_or_else(PoisonError::into_inner).pop_front()
    }

    /// Sends a message to all viewers.
    pub fn send_all(&self, message: &ServerMessage) {
        // An error means that there are none.
        let _ = self.messages.send(message.encode());
    }

    /// The messages that are sent to all viewers from now on, encoded.
    pub fn messages(&self) -> broadcast::Receiver<Arc<str>> {
        self.messages.subscribe()
    }

    /// Shows a picture to all viewers; each takes the newest when it is ready for it.
    pub fn show(&self, frame: Arc<EncodedFrame>) {
        self.frames.send_replace(Some(frame));
    }

    /// The newest picture, and the next ones.
    pub fn frames(&self) -> watch::Receiver<Option<Arc<EncodedFrame>>> {
        self.frames.subscribe()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cluster::{Cluster, ClusterOptions};

    fn hub() -> (Hub, Cluster) {
        let cluster = Cluster::start(ClusterOptions { embedded: Some(1), ..ClusterOptions::default() }).unwrap();
        (Hub::new(cluster.waker()), cluster)
    }

    fn message(viewer: Viewer, message: ClientMessage) -> Command {
        Command::Message { viewer, message }
    }

    #[test]
    fn one_viewer_fills_its_own_place_only() {
        let (hub, _cluster) = hub();
        let taken = (0..10_000).filter(|_| hub.command(message(1, ClientMessage::Undo))).count();
        assert_eq!(taken, CLIENT_MESSAGES_MAX);
        assert!(hub.command(message(2, ClientMessage::Undo)) && hub.command(Command::Left { viewer: 1 }));
        let asked =
            (0..100).filter(|_| hub.command(Command::Picture { meter: None, reply: oneshot::channel().0 })).count();
        assert_eq!(asked, PICTURES_WAITING);
    }

    #[test]
    fn of_a_viewers_questions_the_newest_of_each_kind_is_answered() {
        let (hub, _cluster) = hub();
        for x in 0..1000 {
            let spot = Spot { x: x as f32, y: 0.5 };
            assert!(hub.command(message(1, ClientMessage::Pick(spot))));
            assert!(hub.command(message(1, ClientMessage::Probe(spot))));
            assert!(hub.command(message(2, ClientMessage::Refresh)));
        }
        let left: Vec<_> = std::iter::from_fn(|| hub.next_command()).collect();
        assert_eq!(left.len(), 3);
        let is_newest = |command: &Command| {
            matches!(command, Command::Message { viewer: 1, message: ClientMessage::Pick(Spot { x: 999.0, .. }) })
        };
        assert!(is_newest(&left[0]), "{left:?}");
    }
}
