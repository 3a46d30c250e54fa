//! The window's way to the session: a thread that receives messages and pictures, and wakes the window.

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};

use anyhow::Context;
use tokio::sync::broadcast::error::RecvError;
use tokio::sync::{mpsc, oneshot};

use crate::display::encoded::EncodedFrame;
use crate::display::hub::{Command, Hub, Viewer};
use crate::display::message::{ClientMessage, ServerMessage, Spot};
use crate::files::{OutputKind, write_whole};

/// The window's number among the viewers; pages count from 1.
const WINDOW: Viewer = 0;
/// Messages for the window alone that may wait for it.
const OWN_MESSAGES_MAX: usize = 64;
/// Events that wait for a window that is hidden, say. More stays in the hub, where the newest picture supersedes others.
const EVENTS_MAX: usize = 8;

/// Pictures of one name in one folder.
const NUMBERS: u32 = 9999;

/// What comes to the window.
pub(super) enum LinkEvent {
    /// A message.
    Message(ServerMessage),
    /// A picture, the newest there is.
    Frame(Arc<EncodedFrame>),
    /// What became of a picture that was to be saved, a sentence.
    Saved(String),
    /// The session has ended.
    Closed,
}

/// The window's end.
pub(super) struct Link {
    hub: Hub,
    events: Receiver<LinkEvent>,
    sender: SyncSender<LinkEvent>,
    wake: Arc<dyn Fn() + Send + Sync>,
}

impl Link {
    /// Joins the session; `wake` is called whenever something has come.
    ///
    /// # Errors
    /// In words: the system has no more threads.
    pub fn join(hub: Hub, wake: impl Fn() + Send + Sync + 'static) -> Result<Self, String> {
        let no_thread = |error: std::io::Error| format!("no thread can be started: {error}");
        let (own_sender, own_messages) = mpsc::channel(OWN_MESSAGES_MAX);
        let (sender, events) = sync_channel(EVENTS_MAX);
        let runtime = tokio::runtime::Builder::new_current_thread().build().map_err(no_thread)?;
        let carried = hub.clone();
        // Subscribed before the welcome is sent, so that no later message is missed.
        let (messages, frames) = (hub.messages(), hub.frames());
        hub.command(Command::Joined { viewer: WINDOW, sender: own_sender });
        let wake: Arc<dyn Fn() + Send + Sync> = Arc::new(wake);
        let (to_window, waker) = (sender.clone(), Arc::clone(&wake));
        let carry = move || runtime.block_on(carry(&carried, own_messages, messages, frames, &to_window, &*waker));
        std::thread::Builder::new().name("window".into()).spawn(carry).map_err(no_thread)?;
        Ok(Self { hub, events, sender, wake })
    }

    /// Sends the session a message; what is too much at once is lost.
    pub fn send(&self, message: ClientMessage) {
        self.hub.command(Command::Message { viewer: WINDOW, message });
    }

    /// Saves what is shown beside the program, under a name that no file has yet, with what the light meter reads at a
    /// spot; comes back as [`LinkEvent::Saved`].
    pub fn save(&self, kind: OutputKind, meter: Option<Spot>) {
        let (hub, sender, wake) = (self.hub.clone(), self.sender.clone(), Arc::clone(&self.wake));
        let work = move || {
            let text = saved(&hub, kind, meter).unwrap_or_else(|error| format!("The picture is not saved: {error:#}"));
            // The window may be closed by now.
            let _ = sender.send(LinkEvent::Saved(text));
            wake();
        };
        if let Err(error) = std::thread::Builder::new().name("saving".into()).spawn(work) {
            // This is the thread that would make room: it must not wait.
            let _ = self.sender.try_send(LinkEvent::Saved(format!("The picture is not saved: {error}")));
        }
    }

    /// What has come.
    pub fn events(&self) -> impl Iterator<Item = LinkEvent> {
        self.events.try_iter()
    }
}

impl Drop for Link {
    fn drop(&mut self) {
        self.hub.command(Command::Left { viewer: WINDOW });
    }
}

type Encoded = Arc<str>;

async fn carry(
    hub: &Hub,
    mut own_messages: mpsc::Receiver<Encoded>,
    mut messages: tokio::sync::broadcast::Receiver<Encoded>,
    mut frames: tokio::sync::watch::Receiver<Option<Arc<EncodedFrame>>>,
    sender: &SyncSender<LinkEvent>,
    wake: &(impl Fn() + ?Sized),
) {
    frames.mark_changed();
    loop {
        let event = tokio::select! {
            message = own_messages.recv() => message.map_or(Some(LinkEvent::Closed), |message| decode(&message)),
            message = messages.recv() => match message {
                Ok(message) => decode(&message),
                Err(RecvError::Lagged(_)) => {
                    hub.command(Command::Message { viewer: WINDOW, message: ClientMessage::Refresh });
                    None
                }
                Err(RecvError::Closed) => Some(LinkEvent::Closed),
            },
            changed = frames.changed() => match changed {
                Ok(()) => frames.borrow_and_update().clone().map(LinkEvent::Frame),
                Err(_) => Some(LinkEvent::Closed),
            },
        };
        let Some(event) = event else { continue };
        let is_last = matches!(event, LinkEvent::Closed);
        if sender.send(event).is_err() {
            return;
        }
        wake();
        if is_last {
            return;
        }
    }
}

/// Saves the picture, and returns a sentence that says where.
fn saved(hub: &Hub, kind: OutputKind, meter: Option<Spot>) -> anyhow::Result<String> {
    let (reply, taken) = oneshot::channel();
    hub.command(Command::Picture { meter, reply });
    let taken = taken.blocking_recv().context("there is no picture yet; try again")?;
    let (bytes, name) = (taken.encode(kind)?, &taken.name);
    let ending = match kind {
        OutputKind::Png => "png",
        OutputKind::Exr => "exr",
    };
    let names = (1..=NUMBERS).map(|number| PathBuf::from(format!("{name}-{number}.{ending}")));
    let path = names.into_iter().find(|path| !path.exists()).context("all names are taken")?;
    write_whole(&path, &bytes)?;
    Ok(format!("Saved: {}", std::path::absolute(&path).unwrap_or(path).display()))
}

fn decode(message: &str) -> Option<LinkEvent> {
    match serde_json::from_str(message) {
        Ok(message) => Some(LinkEvent::Message(message)),
        Err(error) => {
            tracing::error!("the window cannot read a message: {error}");
            None
        }
    }
}
