//! Pictures at rest, denoised beside the session: which are given to the denoiser, and what became of the last.

use std::sync::{Arc, Mutex, PoisonError};

use frame::live::Frame;
use frame::{Layer, Picture};

use super::Session;
use crate::denoise::{DenoiseThread, Denoiser};
use crate::display::message::{InputStamp, ServerMessage};

/// A denoiser, and what it is given.
pub(super) struct Denoising {
    thread: DenoiseThread<(Frame, Option<InputStamp>)>,
    /// Of the library.
    name: String,
    /// Revision and number of frames of the picture that was given last, if it still stands for what there is.
    given: Option<(u64, u32)>,
    /// The last still frame, which is given when people want it denoised.
    last: Option<(Frame, Option<InputStamp>)>,
    /// What it has made last.
    made: Arc<Mutex<Option<Made>>>,
}

/// A denoised picture.
#[derive(Clone)]
struct Made {
    revision: u64,
    picture: Arc<Picture>,
}

/// A picture of as many more frames is worth the time: a quarter less noise.
const GROWTH: f32 = 1.25;

impl Session {
    /// Has still pictures denoised if people want it; `on`: from the beginning.
    ///
    /// # Errors
    /// The system has no more threads.
    pub fn denoise_by(&mut self, denoiser: Denoiser, on: bool) -> std::io::Result<()> {
        let name = denoiser.name();
        let made = Arc::<Mutex<Option<Made>>>::default();
        let (board, show, hub) = (Arc::clone(&made), self.display.denoised(), self.hub.clone());
        let thread = DenoiseThread::start(denoiser, move |(frame, input): (Frame, _), denoised| match denoised {
            Ok(picture) => {
                let picture = Arc::new(picture);
                let made = Made { revision: frame.revision, picture: Arc::clone(&picture) };
                *board.lock().unwrap_or_else(PoisonError::into_inner) = Some(made);
                show(Frame { picture, ..frame }, input);
            }
            Err(reason) => {
                let reason = format!("pictures are not denoised any more: {reason}");
                tracing::error!("{reason}");
                hub.send_all(&ServerMessage::Trouble { reason });
            }
        })?;
        self.denoising = Some(Denoising { thread, name, given: None, last: None, made });
        self.settings.denoise = on;
        self.display.set(self.settings.clone());
        Ok(())
    }

    /// Whether still pictures are shown denoised; `None` without a denoiser.
    pub(super) fn denoises(&self) -> Option<bool> {
        self.denoising.as_ref().map(|_| self.settings.denoise)
    }

    /// Shows still pictures denoised from now on, or as they are.
    pub(super) fn set_denoise(&mut self, on: bool) -> Result<(), String> {
        let denoising = self.denoising.as_mut().ok_or("there is no denoiser: Open Image Denoise is not installed")?;
        denoising.forget();
        self.settings.denoise = on;
        self.apply_settings();
        if let Some((frame, input)) = self.denoising.as_mut().and_then(|denoising| denoising.last.take()) {
            self.denoise(&frame, input);
        }
        Ok(())
    }

    /// A frame is shown: it is denoised as well if that is wanted, and worth it.
    pub(super) fn denoise(&mut self, frame: &Frame, input: Option<InputStamp>) {
        let Some(denoising) = &mut self.denoising else { return };
        let is_still = frame.moving.is_none() && frame.frames > 0 && frame.known == 1.0 && frame.layer == Layer::FINAL;
        denoising.last = is_still.then(|| (frame.clone(), input));
        if denoising.given.is_some_and(|(revision, _)| revision != frame.revision) || !is_still {
            // Nobody will see what is in hand.
            denoising.forget();
        }
        let is_worth = match denoising.given {
            Some((_, frames)) => frame.frames as f32 >= GROWTH * frames as f32 || frame.finished,
            None => true,
        };
        let has_room = denoising.thread.is_free() || frame.finished;
        if !(self.settings.denoise && is_still && is_worth && has_room) {
            return;
        }
        // The scene may have been edited since, and another picture begun.
        let is_current = self.driver.live.revision() == frame.revision;
        if let Some(undenoised) = is_current.then(|| self.driver.live.undenoised()).flatten() {
            denoising.given = Some((frame.revision, frame.frames));
            denoising.thread.give((frame.clone(), input), undenoised);
        }
    }

    /// The picture that is shown denoised, and by what; `None` if none is.
    pub(super) fn denoised(&self) -> Option<(Arc<Picture>, String)> {
        let denoising = self.denoising.as_ref().filter(|_| self.settings.denoise)?;
        let live = &self.driver.live;
        let made = denoising.made.lock().unwrap_or_else(PoisonError::into_inner).clone();
        let is_shown = |revision| revision == live.revision() && denoising.last.is_some();
        made.filter(|made| is_shown(made.revision)).map(|made| (made.picture, denoising.name.clone()))
    }

    /// How pictures are made or shown has changed: what is in hand is of before.
    pub(super) fn denoise_anew(&mut self) {
        if let Some(denoising) = &mut self.denoising {
            denoising.forget();
        }
    }
}

impl Denoising {
    fn forget(&mut self) {
        if self.given.take().is_some() {
            self.thread.abandon();
        }
        *self.made.lock().unwrap_or_else(PoisonError::into_inner) = None;
    }
}
