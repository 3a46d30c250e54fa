//! A front end with a stopwatch: when each frame was asked for, when it was complete, and what each answer took.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::{Duration, Instant};

use frame::metrics::Estimate;
use frame::{Absorbed, Answered, FrontEnd, Igi, Layer, Picture};
use protocol::answer::{Cost, CostStage};
use protocol::question::{Ask, Asked, Question, Rect, Ticket};

/// Passes everything on and takes notes.
pub struct Watched {
    front: Igi,
    /// When each frame was begun.
    asked: BTreeMap<u32, Instant>,
    open: BTreeMap<Ticket, Arc<Question>>,
    /// For each complete frame: when, and how long after its first question.
    pub done: Vec<(Instant, Duration)>,
    /// What each answer took.
    pub answers: Vec<Took>,
}

/// What an answer took its client.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Took {
    /// Of which frame.
    pub frame: u32,
    /// Of which light set.
    pub set: u16,
    /// First pixel of its rectangle.
    pub corner: [u32; 2],
    /// Who answered.
    pub worker: u32,
    /// Making the light set, microseconds; about 0 if it was there.
    pub set_micros: u64,
    /// Everything else, microseconds.
    pub micros: u64,
}

impl Watched {
    /// Nothing asked yet.
    pub fn new(front: Igi) -> Self {
        Self { front, asked: BTreeMap::new(), open: BTreeMap::new(), done: Vec::new(), answers: Vec::new() }
    }

    fn note(&mut self, question: &Question, worker: u32, cost: &Cost) {
        let Ask::Tile(tile) = &question.ask else { return };
        let set_micros = cost.micros_of(CostStage::LightSets);
        let micros = cost.total_micros() - set_micros;
        let corner = [tile.rect.x, tile.rect.y];
        self.answers.push(Took { frame: tile.lit.frame, set: tile.lit.set, corner, worker, set_micros, micros });
    }
}

impl FrontEnd for Watched {
    fn ask(&mut self, room: usize) -> Vec<Asked> {
        let questions = self.front.ask(room);
        for Asked { ticket, question } in &questions {
            if let Ask::Tile(tile) = &question.ask {
                self.asked.entry(tile.lit.frame).or_insert_with(Instant::now);
                self.open.insert(*ticket, Arc::clone(question));
            }
        }
        questions
    }

    fn absorb(&mut self, answered: Answered<'_>) -> Absorbed {
        let first = self.front.frames();
        let Answered { ticket, worker, cost, .. } = answered;
        let absorbed = self.front.absorb(answered);
        if let Some(question) = self.open.remove(&ticket)
            && absorbed != Absorbed::Unwanted
        {
            self.note(&question, worker, cost);
        }
        let now = Instant::now();
        for frame in first..self.front.frames() {
            let asked = self.asked.remove(&frame).unwrap_or(now);
            self.done.push((now, now - asked));
        }
        absorbed
    }

    fn set_parallelism(&mut self, questions: usize) {
        self.front.set_parallelism(questions);
    }

    fn set_limit(&mut self, frames: u32) {
        self.front.set_limit(frames);
    }

    fn finish(&mut self) {
        self.front.finish();
    }

    fn is_finished(&self) -> bool {
        self.front.is_finished()
    }

    fn frame_progress(&self) -> f32 {
        self.front.frame_progress()
    }

    fn give_up(&mut self, ticket: Ticket) -> Option<Rect> {
        self.open.remove(&ticket);
        self.front.give_up(ticket)
    }

    fn show(&mut self, layer: Layer) -> Picture {
        self.front.show(layer)
    }

    fn frames(&self) -> u32 {
        self.front.frames()
    }

    fn error(&self) -> Option<Estimate> {
        // It costs the master time that has nothing to do with clients.
        None
    }
}
