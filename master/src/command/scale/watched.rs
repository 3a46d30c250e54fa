//! A front end with a stopwatch: when each frame was asked for, when it was complete, and what each answer took.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::{Duration, Instant};

use frame::front_end::{GivenUp, Open};
use frame::{Absorbed, Answered, FrontEnd, Picture, Plane, View};
use protocol::answer::{Cost, CostStage};
use protocol::question::{Ask, Asked, Frames, Question, Ticket};
use scenes::Change;

/// Passes everything on and takes notes; estimates no error, which would cost the master time that has nothing to do
/// with clients.
pub struct Watched {
    front: Box<dyn FrontEnd>,
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
    /// Of which question of the frame.
    pub place: Place,
    /// Who answered.
    pub worker: u32,
    /// Making the light set, microseconds; about 0 if it was there.
    pub set_micros: u64,
    /// Everything else, microseconds.
    pub micros: u64,
}

impl Watched {
    /// Nothing asked yet.
    pub fn new(front: Box<dyn FrontEnd>) -> Self {
        Self { front, asked: BTreeMap::new(), open: BTreeMap::new(), done: Vec::new(), answers: Vec::new() }
    }

    fn note(&mut self, ticket: Ticket, question: &Question, worker: u32, cost: &Cost) {
        let set_micros = cost.micros_of(CostStage::LightSets);
        let micros = cost.total_micros() - set_micros;
        let place = Place::of(question);
        self.answers.push(Took { frame: ticket.batch, place, worker, set_micros, micros });
    }
}

/// What is the same of questions of different frames that take about as long.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Place {
    /// The light set, if it is lit by one.
    pub set: Option<u16>,
    /// First pixel of the rectangle; of rays and points, how many there are.
    pub corner: [u32; 2],
}

impl Place {
    /// Where a question lies.
    pub fn of(question: &Question) -> Self {
        let count = [question.ask.len() as u32, 0];
        let (set, corner) = match &question.ask {
            Ask::Tile(tile) | Ask::Frames(Frames { tile, .. }) => (Some(tile.lit.set), [tile.rect.x, tile.rect.y]),
            Ask::Reference(samples) => (None, [samples.rect.x, samples.rect.y]),
            Ask::Lights(lights) => (Some(lights.lit.set), count),
            Ask::Rays(rays) => (Some(rays.lit.set), count),
            Ask::Points(points) => (Some(points.lit.set), count),
        };
        Self { set, corner }
    }
}

impl FrontEnd for Watched {
    fn look(&mut self, view: &View, changes: &[Change]) -> Open {
        self.front.look(view, changes)
    }

    fn ask_again(&mut self) {
        self.front.ask_again();
    }

    fn begin_again(&mut self) {
        self.asked.clear();
        self.open.clear();
        self.front.begin_again();
    }

    fn ask(&mut self, room: usize) -> Vec<Asked> {
        let questions = self.front.ask(room);
        for Asked { ticket, question } in &questions {
            self.asked.entry(ticket.batch).or_insert_with(Instant::now);
            self.open.insert(*ticket, Arc::clone(question));
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
            self.note(ticket, &question, worker, cost);
        }
        let now = Instant::now();
        // Frames that were asked for together begin with the first of them.
        let mut asked = now;
        for frame in first..self.front.frames() {
            asked = self.asked.remove(&frame).unwrap_or(asked);
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

    fn give_up(&mut self, ticket: Ticket) -> GivenUp {
        self.open.remove(&ticket);
        self.front.give_up(ticket)
    }

    fn show(&mut self, plane: Plane) -> Picture {
        self.front.show(plane)
    }

    fn frames(&self) -> u32 {
        self.front.frames()
    }
}
