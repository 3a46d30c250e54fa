//! A span for each frame, for OpenTelemetry (feature `otel`): when it was asked for, when its last answer came, and an
//! event for each tile in between.
//!
//! ```text
//! questions, answers ─► Spans (which frame?) ─► finished frames ─► otlp (a thread, OTLP over HTTP with JSON)
//! ```
//! Nothing is sent, and nothing noted, unless `OTEL_EXPORTER_OTLP_ENDPOINT` (or `…_TRACES_ENDPOINT`) says where to. A
//! collector that is slow or gone costs spans, never frames.

mod otlp;

use std::time::SystemTime;

use protocol::answer::Cost;
use protocol::question::{Asked, Lit, Question, Rect, Tile, WorldState};

use crate::cluster::Event;
use otlp::Exporter;

/// Notes what is asked and answered.
pub struct Spans {
    exporter: Exporter,
    /// What all frames in flight have in common.
    of: Option<(WorldState, Tile)>,
    open: Vec<Frame>,
}

/// A frame, as it is told about.
#[derive(Clone, Debug)]
pub struct Frame {
    number: u32,
    world: WorldState,
    size: [u32; 2],
    begun: SystemTime,
    /// The last answer.
    ended: SystemTime,
    asked: usize,
    tiles: Vec<Answer>,
    /// Tiles answered, those included that there was no room for, and what they took.
    answered: usize,
    micros: u64,
    bytes: u64,
    /// Tiles given up.
    given_up: usize,
    /// Somebody did not want it any more.
    is_cancelled: bool,
}

/// A tile's answer.
#[derive(Clone, Copy, Debug)]
struct Answer {
    at: SystemTime,
    set: u16,
    corner: [u32; 2],
    worker: u32,
    micros: u64,
    bytes: u64,
}

/// Frames that are noted at a time …
const OPEN_MAX: usize = 64;
/// … and tiles of each that have an event of their own.
const EVENTS_MAX: usize = 4096;

impl Spans {
    /// Where the environment wants them sent to; `None` if it does not.
    pub fn from_environment() -> Option<Self> {
        match Exporter::from_environment().transpose() {
            Ok(exporter) => exporter.map(|exporter| Self { exporter, of: None, open: Vec::new() }),
            Err(reason) => {
                tracing::warn!("no spans: {reason}");
                None
            }
        }
    }

    /// These are asked now.
    pub fn asked(&mut self, questions: &[Asked]) {
        let now = SystemTime::now();
        for Asked { question, .. } in questions {
            let Question { world, ask } = &**question;
            let Some(tile) = ask.tile() else { continue };
            let common =
                (*world, Tile { rect: Rect::default(), lit: Lit { set: 0, frame: 0, ..tile.lit }, ..tile.clone() });
            if self.of.as_ref() != Some(&common) {
                self.close_all();
                self.of = Some(common);
            }
            if let Some(frame) = self.open.iter_mut().find(|open| open.number == tile.lit.frame) {
                frame.asked += 1;
                continue;
            }
            // Questions come frame by frame: all of those before have been asked.
            self.close(|frame| frame.is_whole());
            if self.open.len() < OPEN_MAX {
                self.open.push(Frame {
                    number: tile.lit.frame,
                    world: *world,
                    size: [tile.camera.width, tile.camera.height],
                    begun: now,
                    ended: now,
                    asked: 1,
                    tiles: Vec::new(),
                    answered: 0,
                    micros: 0,
                    bytes: 0,
                    given_up: 0,
                    is_cancelled: false,
                });
            }
        }
    }

    /// A question has ended, or something else has happened.
    pub fn received(&mut self, event: &Event) {
        match event {
            Event::Answered { asked, cost, worker, bytes, .. } => self.answered(&asked.question, *worker, cost, *bytes),
            Event::Unanswered { asked, .. } => self.unanswered(&asked.question),
            _ => {}
        }
    }

    fn answered(&mut self, question: &Question, worker: u32, cost: &Cost, bytes: u64) {
        let (Some(tile), now) = (question.ask.tile(), SystemTime::now()) else { return };
        let Some(frame) = self.open.iter_mut().find(|open| open.number == tile.lit.frame) else { return };
        let micros = cost.total_micros();
        frame.ended = now;
        frame.answered += 1;
        frame.micros += micros;
        frame.bytes += bytes;
        if frame.tiles.len() < EVENTS_MAX {
            let corner = [tile.rect.x, tile.rect.y];
            frame.tiles.push(Answer { at: now, set: tile.lit.set, corner, worker, micros, bytes });
        }
        let last = self.open.iter().map(|open| open.number).max();
        self.close(|frame| frame.is_whole() && Some(frame.number) != last);
    }

    fn unanswered(&mut self, question: &Question) {
        let Some(tile) = question.ask.tile() else { return };
        if let Some(frame) = self.open.iter_mut().find(|open| open.number == tile.lit.frame) {
            frame.given_up += 1;
            frame.ended = SystemTime::now();
        }
    }

    /// Whatever is open will not be answered any more.
    pub fn close_all(&mut self) {
        self.close(|_| true);
    }

    fn close(&mut self, is_done: impl Fn(&Frame) -> bool) {
        for mut frame in self.open.extract_if(.., |frame| is_done(frame)) {
            frame.is_cancelled = !frame.is_whole();
            if frame.is_cancelled {
                frame.ended = SystemTime::now();
            }
            self.exporter.put(frame);
        }
    }
}

impl Frame {
    /// Nothing that was asked is open.
    fn is_whole(&self) -> bool {
        self.answered + self.given_up >= self.asked
    }
}

impl Drop for Spans {
    fn drop(&mut self) {
        self.close_all();
    }
}
