//! The window's way to the studio: a thread that hears words and pictures, and wakes the window.

use std::sync::Arc;
use std::sync::mpsc::{Receiver, Sender, channel};

use tokio::sync::broadcast::error::RecvError;
use tokio::sync::mpsc;

use super::told::Told;
use crate::live::hub::{Command, Hub, Viewer};
use crate::live::words::Said;
use crate::show::develop::Print;

/// The window's number among the viewers; pages count from 1.
const WINDOW: Viewer = 0;
/// Words for the window alone that may wait for it.
const EAR_MAX: usize = 64;

/// What comes to the window.
pub(super) enum News {
    /// Words.
    Told(Told),
    /// A picture, the newest there is.
    Picture(Arc<Print>),
    /// The studio has finished.
    Closed,
}

/// The window's end.
pub(super) struct Link {
    hub: Hub,
    news: Receiver<News>,
}

impl Link {
    /// Joins the studio; `wake` is called whenever there is news.
    ///
    /// # Errors
    /// In words: the system has no more threads.
    pub fn join(hub: Hub, wake: impl Fn() + Send + 'static) -> Result<Self, String> {
        let no_thread = |error: std::io::Error| format!("no thread can be started: {error}");
        let (ear, own_words) = mpsc::channel(EAR_MAX);
        let (sender, news) = channel();
        let runtime = tokio::runtime::Builder::new_current_thread().build().map_err(no_thread)?;
        let carried = hub.clone();
        // What is told from now on is heard, as the welcome comes after this.
        let (words, pictures) = (hub.words(), hub.pictures());
        hub.command(Command::Joined { viewer: WINDOW, ear });
        let carry = move || runtime.block_on(carry(&carried, own_words, words, pictures, &sender, &wake));
        std::thread::Builder::new().name("window".into()).spawn(carry).map_err(no_thread)?;
        Ok(Self { hub, news })
    }

    /// Tells the studio something; what is too much at once is lost.
    pub fn say(&self, said: Said) {
        self.hub.command(Command::Said { viewer: WINDOW, said });
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
    sender: &Sender<News>,
    wake: &impl Fn(),
) {
    pictures.mark_changed();
    loop {
        let news = tokio::select! {
            said = own_words.recv() => said.map_or(Some(News::Closed), |words| understood(&words)),
            said = words.recv() => match said {
                Ok(words) => understood(&words),
                Err(RecvError::Lagged(_)) => {
                    hub.command(Command::Said { viewer: WINDOW, said: Said::Refresh });
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

fn understood(words: &str) -> Option<News> {
    match serde_json::from_str(words) {
        Ok(told) => Some(News::Told(told)),
        Err(error) => {
            tracing::error!("the window does not understand the studio: {error}");
            None
        }
    }
}
