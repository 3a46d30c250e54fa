//! The status that viewers are sent several times a second.

use std::sync::PoisonError;
use std::time::{Duration, Instant};

use frame::live::Frame;

use super::Session;
use crate::display::message::{ServerMessage, Status, WorkerStatus};

/// Pictures since the last status.
pub(super) struct Period {
    /// When it began.
    pub since: Instant,
    pictures: u32,
    moving: u32,
    /// When the error was estimated, and what it was: relative mean squared error.
    estimated: Instant,
    error: Option<f64>,
}

/// The estimate looks at every pixel, so not too often.
const BETWEEN_ESTIMATES: Duration = Duration::from_millis(1000);

impl Period {
    /// The first.
    pub fn new(now: Instant) -> Self {
        Self { since: now, pictures: 0, moving: 0, estimated: now, error: None }
    }

    /// One more picture is shown.
    pub fn count(&mut self, frame: &Frame) {
        self.pictures += 1;
        self.moving += u32::from(frame.moving.is_some());
    }
}

impl Session {
    /// Sends all viewers a status.
    pub(super) fn report(&mut self) {
        let now = Instant::now();
        if now - self.period.estimated >= BETWEEN_ESTIMATES {
            self.period.estimated = now;
            self.period.error = self.driver.live.error().map(|estimate| estimate.rel_mse);
        }
        let (cost, bytes) = self.driver.take_cost();
        let Period { since, pictures, moving, error, .. } = self.period;
        let seconds = (now - since).as_secs_f64().max(1e-3);
        let cluster = self.driver.cluster.status();
        self.driver.look_at_workers(&cluster);
        let latency = self.latency.lock().unwrap_or_else(PoisonError::into_inner).clone();
        let milliseconds = |share| latency.percentile(share).map(|micros| micros as f64 / 1e3);
        let latency_ms = [milliseconds(0.5), milliseconds(0.99)];
        let status = Status {
            pictures_per_second: f64::from(pictures) / seconds,
            moving: moving > 0,
            rays_per_second: cost.rays() as f64 / seconds,
            answer_bytes_per_second: bytes as f64 / seconds,
            latency_ms,
            error,
            bytes_sent: cluster.bytes_sent,
            bytes_received: cluster.bytes_received,
            workers: cluster.list.iter().map(WorkerStatus::from).collect(),
            ready: cluster.ready,
            effort: self.driver.live.effort().0,
            mix: self.mix_status(),
        };
        self.hub.send_all(&ServerMessage::Status(status.into()));
        let [half, most] = latency_ms.map(|ms| ms.map(|ms| ms / 1e3));
        let latency = half.zip(most).map(|(half, most)| [half, most]);
        self.driver.cluster.pulse().shown(pictures, latency, now);
        self.period = Period { since: now, pictures: 0, moving: 0, ..self.period };
    }
}
