//! A thread that denoises what people look at: the newest picture, one at a time, off everybody's way.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Condvar, Mutex, PoisonError};

use frame::Picture;
use frame::parts::Undenoised;

use super::{Denoiser, Trouble};

/// Hands pictures to the thread, each with a label by which it comes back. Dropped, it ends the thread.
pub struct DenoiseThread<L> {
    mailbox: Arc<Mailbox<L>>,
    /// Stops the picture in hand.
    stop: Arc<AtomicBool>,
}

struct Mailbox<L> {
    contents: Mutex<Contents<L>>,
    changed: Condvar,
}

struct Contents<L> {
    waiting: Option<(L, Undenoised)>,
    /// A picture is in hand, and still wanted.
    wanted: bool,
    closed: bool,
}

impl<L: Send + 'static> DenoiseThread<L> {
    /// Starts the thread; `out` is called on it with every picture that is still wanted then. It ends at the first that
    /// fails.
    ///
    /// # Errors
    /// The system has no more threads.
    pub fn start(
        mut denoiser: Denoiser,
        out: impl Fn(L, Result<Picture, String>) + Send + 'static,
    ) -> std::io::Result<Self> {
        let contents = Mutex::new(Contents { waiting: None, wanted: false, closed: false });
        let mailbox = Arc::new(Mailbox { contents, changed: Condvar::new() });
        let thread = Self { mailbox: Arc::clone(&mailbox), stop: denoiser.stop() };
        let work = move || {
            while let Some((label, undenoised)) = mailbox.next() {
                match denoiser.denoise(&undenoised) {
                    Ok(picture) if mailbox.is_wanted() => out(label, Ok(picture)),
                    Ok(_) | Err(Trouble::Stopped) => {}
                    Err(Trouble::Failed(reason)) => return out(label, Err(reason)),
                }
            }
        };
        std::thread::Builder::new().name("denoiser".into()).spawn(work)?;
        Ok(thread)
    }

    /// The next picture; one that is still waiting is dropped.
    pub fn give(&self, label: L, undenoised: Undenoised) {
        self.put(|contents| contents.waiting = Some((label, undenoised)));
    }

    /// No picture waits.
    pub fn is_free(&self) -> bool {
        self.mailbox.lock().waiting.is_none()
    }

    /// What was given so far is of no use any more.
    pub fn abandon(&self) {
        self.put(|contents| (contents.waiting, contents.wanted) = (None, false));
        self.stop.store(true, Ordering::Relaxed);
    }

    fn put(&self, put: impl FnOnce(&mut Contents<L>)) {
        put(&mut self.mailbox.lock());
        self.mailbox.changed.notify_one();
    }
}

impl<L> Mailbox<L> {
    fn lock(&self) -> std::sync::MutexGuard<'_, Contents<L>> {
        self.contents.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Waits for a picture; `None`: there will be none.
    fn next(&self) -> Option<(L, Undenoised)> {
        let is_empty = |contents: &mut Contents<L>| !contents.closed && contents.waiting.is_none();
        let mut contents = self.changed.wait_while(self.lock(), is_empty).unwrap_or_else(PoisonError::into_inner);
        contents.wanted = true;
        contents.waiting.take().filter(|_| !contents.closed)
    }

    fn is_wanted(&self) -> bool {
        let contents = self.lock();
        contents.wanted && !contents.closed
    }
}

impl<L> Drop for DenoiseThread<L> {
    fn drop(&mut self) {
        self.mailbox.lock().closed = true;
        self.mailbox.changed.notify_one();
        self.stop.store(true, Ordering::Relaxed);
    }
}
