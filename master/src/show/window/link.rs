//! The window's way to the studio: a thread that hears words and pictures, and wakes the window.

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};

use anyhow::Context;
use tokio::sync::broadcast::error::RecvError;
use tokio::sync::{mpsc, oneshot};

use crate::display::develop::Print;
use crate::display::hub::{Command, Hub, Viewer};
use crate::display::message::{ClientMessage, ServerMessage, Spot};
use crate::files::{OutputKind, write_whole};

/// The window's number among the viewers; pages count from 1.
const WINDOW: Viewer = 0;
/// Words for the window alone that may wait for it.
const EAR_MAX: usize = 64;
/// News that waits for a window that is hidden, say. More stays in the studio, where the newest picture supersedes others.
const NEWS_MAX: usize = 8;

/// Pictures of one name in one folder.
const NUMBERS: u32 = 9999;

/// What comes to the window.
pub(super) enum News {
    /// A message.
    Message(ServerMessage),
    /// A picture, the newest there is.
    Picture(Arc<Print>),
    /// What became of a picture that was to be saved.
    Saved(String),
    /// The studio has finished.
    Closed,
}

/// The window's end.
pub(super) struct Link {
    hub: Hub,
    news: Receiver<News>,
    sender: SyncSender<News>,
    wake: Arc<dyn Fn() + Send + Sync>,
}

impl Link {
    /// Joins the studio; `wake` is called whenever there is news.
    ///
    /// # Errors
    /// In words: the system has no more threads.
    pub fn join(hub: Hub, wake: impl Fn() + Send + Sync + 'static) -> Result<Self, String> {
        let no_thread = |error: std::io::Error| format!("no thread can be started: {error}");
        let (ear, own_words) = mpsc::channel(EAR_MAX);
        let (sender, news) = sync_channel(NEWS_MAX);
        let runtime = tokio::runtime::Builder::new_current_thread().build().map_err(no_thread)?;
        let carried = hub.clone();
        // What is told from now on is heard, as the welcome comes after this.
        let (words, pictures) = (hub.words(), hub.pictures());
        hub.command(Command::Joined { viewer: WINDOW, ear });
        let wake: Arc<dyn Fn() + Send + Sync> = Arc::new(wake);
        let (teller, waker) = (sender.clone(), Arc::clone(&wake));
        let carry = move || runtime.block_on(carry(&carried, own_words, words, pictures, &teller, &*waker));
        std::thread::Builder::new().name("window".into()).spawn(carry).map_err(no_thread)?;
        Ok(Self { hub, news, sender, wake })
    }

    /// Tells the studio something; what is too much at once is lost.
    pub fn send(&self, message: ClientMessage) {
        self.hub.command(Command::Said { viewer: WINDOW, said: message });
    }

    /// Saves what is shown beside the program, under a name that no file has yet, with what the light meter reads at a
    /// spot; comes back as [`News::Saved`].
    pub fn save(&self, kind: OutputKind, meter: Option<Spot>) {
        let (hub, sender, wake) = (self.hub.clone(), self.sender.clone(), Arc::clone(&self.wake));
        let work = move || {
            let words = saved(&hub, kind, meter).unwrap_or_else(|error| format!("The picture is not saved: {error:#}"));
            // The window may be closed by now.
            let _ = sender.send(News::Saved(words));
            wake();
        };
        if let Err(error) = std::thread::Builder::new().name("saving".into()).spawn(work) {
            // Nobody but this thread would make room.
            let _ = self.sender.try_send(News::Saved(format!("The picture is not saved: {error}")));
        }
    }

    /// What has come.
    pub fn news(&self) -> impl Iterator<Item = News> {
        self.news.try_iter()
    }
}

impl Drop for Link {
    fn drop(&mut self) {
        self.hub.command(Command::Left { viewer: WINDOW });
    }
}

type Words = Arc<str>;

async fn carry(
    hub: &Hub,
    mut own_words: mpsc::Receiver<Words>,
    mut words: tokio::sync::broadcast::Receiver<Words>,
    mut pictures: tokio::sync::watch::Receiver<Option<Arc<Print>>>,
    sender: &SyncSender<News>,
    wake: &(impl Fn() + ?Sized),
) {
    pictures.mark_changed();
    loop {
        let news = tokio::select! {
            said = own_words.recv() => said.map_or(Some(News::Closed), |words| understood(&words)),
            said = words.recv() => match said {
                Ok(words) => understood(&words),
                Err(RecvError::Lagged(_)) => {
                    hub.command(Command::Said { viewer: WINDOW, said: ClientMessage::Refresh });
                    None
                }
                Err(RecvError::Closed) => Some(News::Closed),
            },
            changed = pictures.changed() => match changed {
                Ok(()) => pictures.borrow_and_update().clone().map(News::Picture),
                Err(_) => Some(News::Closed),
            },
        };
        let Some(news) = news else { continue };
        let is_last = matches!(news, News::Closed);
        if sender.send(news).is_err() {
            return;
        }
        wake();
        if is_last {
            return;
        }
    }
}

/// Saves the picture; words that say where.
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

fn understood(words: &str) -> Option<News> {
    match serde_json::from_str(words) {
        Ok(message) => Some(News::Message(message)),
        Err(error) => {
            tracing::error!("the window does not understand the studio: {error}");
            None
        }
    }
}
