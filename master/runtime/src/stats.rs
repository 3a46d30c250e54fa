//! What a render was to do, how it ended, and what it took.

use std::time::Duration;

use frame::metrics::Estimate;
use protocol::answer::Cost;

/// When to stop; whichever comes first.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Stop {
    /// Begin no frame after this time, that of earlier processes included.
    pub after: Option<Duration>,
    /// What earlier processes spent on the same picture.
    pub spent: Duration,
    /// Make this many frames.
    pub frames: Option<u32>,
    /// The estimated relative mean squared error is below this, with 95 % confidence.
    pub error: Option<f64>,
    /// Give up after this long without any worker.
    pub without_workers: Option<Duration>,
}

/// How it ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ending {
    /// One of [`Stop`]'s conditions was met.
    Enough,
    /// Somebody pressed Ctrl-C.
    Interrupted,
    /// There has been no worker for too long.
    NoWorkers,
    /// The time was over before a single frame was complete, and nobody was left to complete one.
    Deserted,
}

/// A part of the picture that could not be drawn.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Gap {
    /// The question that workers died of or failed at.
    pub what: String,
    /// Why, for people.
    pub reason: String,
}

/// What was done.
#[derive(Clone, Debug, PartialEq)]
pub struct RenderStats {
    /// How it ended.
    pub ending: Ending,
    /// What was set aside, and keeps what it had before.
    pub gaps: Vec<Gap>,
    /// Time until the first worker was ready: waiting, sending the scene, building its trees.
    pub preparation: Duration,
    /// Time since then.
    pub elapsed: Duration,
    /// What earlier processes spent on the same picture.
    pub spent: Duration,
    /// Complete frames.
    pub frames: u32,
    /// Of these, frames that were there when it began: another process drew them.
    pub resumed: u32,
    /// What all answers cost, those not used included.
    pub cost: Cost,
    /// Answers that were used.
    pub answers: u64,
    /// Answers that came twice, late or broken.
    pub unused: u64,
    /// Packed size of all answers, bytes.
    pub answer_bytes: u64,
    /// Pixels in all answers.
    pub pixels: u64,
    /// Last error estimate.
    pub error: Option<Estimate>,
    /// How often all was drawn again, because a worker was found to compute wrongly.
    pub begun_again: u32,
}

impl Default for RenderStats {
    /// Of a picture that begins now.
    fn default() -> Self {
        Self {
            ending: Ending::Enough,
            gaps: Vec::new(),
            preparation: Duration::ZERO,
            elapsed: Duration::ZERO,
            frames: 0,
            resumed: 0,
            spent: Duration::ZERO,
            cost: Cost::default(),
            answers: 0,
            unused: 0,
            answer_bytes: 0,
            pixels: 0,
            error: None,
            begun_again: 0,
        }
    }
}

impl RenderStats {
    /// What was drawn so far is not in the picture, which begins again; what it cost stays.
    pub fn begin_again(&mut self) {
        (self.frames, self.resumed, self.spent) = (0, 0, Duration::ZERO);
        self.gaps.clear();
        self.error = None;
        self.begun_again += 1;
    }

    /// Frames that were drawn since it began.
    pub fn drawn(&self) -> u64 {
        u64::from(self.frames.saturating_sub(self.resumed))
    }

    /// Per second.
    pub fn rate(&self, count: u64) -> f64 {
        let seconds = self.elapsed.as_secs_f64();
        if seconds > 0.0 { count as f64 / seconds } else { 0.0 }
    }
}
