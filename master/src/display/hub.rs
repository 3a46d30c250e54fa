//! Where viewers and the studio meet: commands one way, words and pictures the other. Nobody waits
//! for anybody here, and every queue has a bound.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, PoisonError};

use tokio::sync::{broadcast, mpsc, oneshot, watch};

use super::message::{ClientMessage, ServerMessage, Spot};
use crate::cluster::Waker;
use crate::display::develop::Print;
use crate::display::saved::Taken;

/// A viewer's number; never used again.
pub type Viewer = u64;

/// What the studio is told.
#[derive(Debug)]
pub enum Command {
    /// A viewer has come; `ear` hears what is only for it.
    Joined {
        /// Its number.
        viewer: Viewer,
        /// What it is told.
        ear: mpsc::Sender<Arc<str>>,
    },
    /// A viewer says something.
    Said {
        /// Its number.
        viewer: Viewer,
        /// What.
        said: ClientMessage,
    },
    /// A viewer has gone.
    Left {
        /// Its number.
        viewer: Viewer,
    },
    /// Somebody wants the picture as it is now.
    Picture {
        /// Where the light meter stands, if it does.
        meter: Option<Spot>,
        /// Gets it; nothing if there is none yet.
        reply: oneshot::Sender<Taken>,
    },
}

impl Command {
    /// The viewer that it is about.
    fn by(&self) -> Option<Viewer> {
        match self {
            Self::Joined { viewer, .. } | Self::Said { viewer, .. } | Self::Left { viewer } => Some(*viewer),
            Self::Picture { .. } => None,
        }
    }
}

/// Words of one viewer that wait for the studio, pictures that were asked for by others, and all commands: whoever says
/// too much at once takes nobody else's place.
pub(crate) const SAID_WAITING: usize = 128;
const PICTURES_WAITING: usize = 4;
const COMMANDS_MAX: usize = 8192;
/// Words that wait for a viewer; one that does not listen this long is told everything again.
const WORDS_MAX: usize = 256;

/// The meeting place; clones share it.
#[derive(Clone)]
pub struct Hub {
    commands: Arc<Mutex<VecDeque<Command>>>,
    waker: Waker,
    words: broadcast::Sender<Arc<str>>,
    pictures: watch::Sender<Option<Arc<Print>>>,
}

impl Hub {
    /// Nobody there. The waker ends the studio's wait for workers.
    pub fn new(waker: Waker) -> Self {
        let (words, _) = broadcast::channel(WORDS_MAX);
        let (pictures, _) = watch::channel(None);
        Self { commands: Arc::default(), waker, words, pictures }
    }

    /// Tells the studio something. It supersedes what the same viewer said before it, as [`ClientMessage::supersedes`] says, and a
    /// question an earlier one of its kind. False if too much of its kind waits: the command is lost.
    pub fn command(&self, command: Command) -> bool {
        let mut commands = self.commands.lock().unwrap_or_else(PoisonError::into_inner);
        let was_empty = commands.is_empty();
        if let Command::Said { viewer, said } = &command {
            let kind = std::mem::discriminant(said);
            if let Some(Command::Said { viewer: other, said: last }) = commands.back_mut()
                && other == viewer
                && said.supersedes(last)
            {
                *last = said.clone();
                return true;
            }
            if said.is_question() {
                commands.retain(|earlier| {
                    !matches!(earlier, Command::Said { viewer: other, said }
                        if other == viewer && std::mem::discriminant(said) == kind)
                });
            }
        }
        let waiting = commands.iter().filter(|earlier| earlier.by() == command.by()).count();
        let room = if command.by().is_some() { SAID_WAITING } else { PICTURES_WAITING };
        // Who goes is always heard, so that the controls are free again.
        if (waiting >= room || commands.len() >= COMMANDS_MAX) && !matches!(command, Command::Left { .. }) {
            return false;
        }
        commands.push_back(command);
        drop(commands);
        // The studio sleeps only when it has heard all.
        if was_empty {
            self.waker.wake();
        }
        true
    }

    /// The next command, for the studio.
    pub fn next_command(&self) -> Option<Command> {
        self.commands.lock().unwrap_or_else(PoisonError::into_inner).pop_front()
    }

    /// Sends a message to all viewers.
    pub fn send_all(&self, message: &ServerMessage) {
        // An error means that there are none.
        let _ = self.words.send(message.encode());
    }

    /// What all viewers are told from now on.
    pub fn words(&self) -> broadcast::Receiver<Arc<str>> {
        self.words.subscribe()
    }

    /// Shows all viewers a picture; each takes the newest when it is ready for it.
    pub fn show(&self, picture: Arc<Print>) {
        self.pictures.send_replace(Some(picture));
    }

    /// The newest picture, and the next ones.
    pub fn pictures(&self) -> watch::Receiver<Option<Arc<Print>>> {
        self.pictures.subscribe()
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

    fn said(viewer: Viewer, said: ClientMessage) -> Command {
        Command::Said { viewer, said }
    }

    #[test]
    fn one_viewer_fills_its_own_place_only() {
        let (hub, _cluster) = hub();
        let heard = (0..10_000).filter(|_| hub.command(said(1, ClientMessage::Undo))).count();
        assert_eq!(heard, SAID_WAITING);
        assert!(hub.command(said(2, ClientMessage::Undo)) && hub.command(Command::Left { viewer: 1 }));
        let asked =
            (0..100).filter(|_| hub.command(Command::Picture { meter: None, reply: oneshot::channel().0 })).count();
        assert_eq!(asked, PICTURES_WAITING);
    }

    #[test]
    fn of_a_viewers_questions_the_newest_of_each_kind_is_answered() {
        let (hub, _cluster) = hub();
        let spot = |x: f32| Spot { x, y: 0.5 };
        for x in 0..1000 {
            assert!(
                hub.command(said(1, ClientMessage::Pick(spot(x as f32))))
                    && hub.command(said(1, ClientMessage::Probe(spot(x as f32))))
            );
            assert!(hub.command(said(2, ClientMessage::Refresh)));
        }
        let left: Vec<_> = std::iter::from_fn(|| hub.next_command()).collect();
        assert_eq!(left.len(), 3);
        assert!(
            matches!(left[0], Command::Said { viewer: 1, said: ClientMessage::Pick(Spot { x: 999.0, .. }) }),
            "{left:?}"
        );
    }
}
