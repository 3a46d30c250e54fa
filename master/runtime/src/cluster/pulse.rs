//! The heart beat of the loops that draw: when they last went round, and what they have completed.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Instant;

use health::{Histogram, histogram};

/// The heart beat of whatever loop draws; clones share it.
#[derive(Clone, Debug)]
pub struct Pulse(Arc<Mutex<Beats>>);

/// What the loop that draws has done.
#[derive(Clone, Debug)]
pub struct Beats {
    /// When it last went round.
    pub(crate) last: Instant,
    /// When it last completed a frame.
    frame: Option<Instant>,
    /// Complete frames; pictures shown, where people watch.
    pub(crate) frames: u64,
    /// From one complete frame to the next.
    pub(crate) frame_latency: Histogram,
    /// From an input to the first picture that shows it, median and 99th percentile of the latest, seconds.
    pub(crate) input_latency: Option<[f64; 2]>,
}

impl Default for Pulse {
    fn default() -> Self {
        Self(Arc::new(Mutex::new(Beats {
            last: Instant::now(),
            frame: None,
            frames: 0,
            frame_latency: Histogram::new(histogram::FRAMES),
            input_latency: None,
        })))
    }
}

impl Pulse {
    /// The loop goes round, and has completed so many frames since it last did.
    pub fn drawn(&self, frames: u32, now: Instant) {
        let mut beats = self.beats();
        beats.last = now;
        if frames == 0 {
            return;
        }
        if let Some(before) = beats.frame.replace(now) {
            let each = now.saturating_duration_since(before).as_secs_f64() / f64::from(frames);
            (0..frames).for_each(|_| beats.frame_latency.add(each));
        }
        beats.frames += u64::from(frames);
    }

    /// The loop goes round, and has shown so many pictures to people who wait for them (median and 99th percentile,
    /// seconds; `None` if nobody moved anything).
    pub fn shown(&self, pictures: u32, waited: Option<[f64; 2]>, now: Instant) {
        let mut beats = self.beats();
        beats.last = now;
        beats.frames += u64::from(pictures);
        beats.input_latency = waited;
    }

    /// What it has done so far; whoever holds this holds up the loop.
    pub(crate) fn beats(&self) -> MutexGuard<'_, Beats> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
