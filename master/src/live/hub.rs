//! Where viewers and the studio meet: commands one way, words and pictures the other. Nobody waits
//! for anybody here, and every queue has a bound.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, PoisonError};

use frame::Picture;
use serde_json::Value;
use tokio::sync::{broadcast, mpsc, oneshot, watch};

use super::words::Said;
use crate::cluster::Waker;
use crate::show::develop::Print;

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
        said: Said,
    },
    /// A viewer has gone.
    Left {
        /// Its number.
        viewer: Viewer,
    },
    /// Somebody wants the picture as it is now.
    Picture(oneshot::Sender<Taken>),
}

/// The picture as it is now.
#[derive(Debug)]
pub struct Taken {
    /// Radiance.
    pub picture: Picture,
    /// Stops and curve that it is shown with.
    pub tone: frame::tone::Tone,
    /// What else is known, for EXR.
    pub metadata: crate::files::Metadata,
}

/// Commands that wait for the studio.
const COMMANDS_MAX: usize = 1024;
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

    /// Tells the studio something. A look supersedes an earlier one of the same viewer. False if too much waits:
    /// the command is lost.
    pub fn command(&self, command: Command) -> bool {
        let mut commands = self.commands.lock().unwrap_or_else(PoisonError::into_inner);
        if let (Some(last), Command::Said { viewer, said: Said::Look(_) }) = (commands.back_mut(), &command)
            && matches!(last, Command::Said { viewer: other, said: Said::Look(_) } if other == viewer)
        {
            *last = command;
            return true;
        }
        // Who goes is always heard, so that the controls are free again.
        if commands.len() >= COMMANDS_MAX && !matches!(command, Command::Left { .. }) {
            return false;
        }
        commands.push_back(command);
        drop(commands);
        self.waker.wake();
        true
    }

    /// The next command, for the studio.
    pub fn next_command(&self) -> Option<Command> {
        self.commands.lock().unwrap_or_else(PoisonError::into_inner).pop_front()
    }

    /// Tells all viewers.
    pub fn tell_all(&self, words: &Value) {
        // Nobody may be there.
        let _ = self.words.send(words.to_string().into());
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
