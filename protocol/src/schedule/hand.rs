//! What the schedule knows of one worker.

use std::collections::BTreeMap;

use super::{LEASE_FACTOR, LEASE_MAX, LEASE_MIN, LEASE_UNKNOWN, Moment, QuestionId};
use crate::question::WorldState;

#[derive(Debug)]
pub(super) struct Worker {
    threads: usize,
    depth: usize,
    /// The world it has been told about last.
    pub(super) told: Option<WorldState>,
    /// It has built that world, or one that only small changes part from it.
    pub(super) ready: bool,
    /// It wants no more questions.
    pub(super) leaving: bool,
    /// A lease of it ran out, and it has not answered anything since.
    pub(super) suspect: bool,
    /// Failures since its last good answer.
    pub(super) strikes: u8,
    /// Questions it has been asked and has not answered, oldest number first.
    pub(super) in_flight: BTreeMap<QuestionId, Held>,
    /// Usual time between a question and its answer, microseconds; waiting in line included.
    turnaround: Average,
    /// Usual thread time of an answer, microseconds.
    thread_time: Average,
    answered: u64,
}

/// A question in a worker's hands.
#[derive(Clone, Copy, Debug)]
pub(super) struct Held {
    pub(super) sent: Moment,
    pub(super) lease: Moment,
}

/// What can be said about a worker.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct WorkerStatus {
    /// What it is doing.
    pub state: WorkerState,
    /// Questions it answers at a time.
    pub threads: usize,
    /// Questions it has been asked and has not answered.
    pub in_flight: usize,
    /// Questions it has answered.
    pub answered: u64,
    /// Usual thread time of an answer, microseconds; 0 before the first.
    pub thread_micros: u64,
    /// Usual time between a question and its answer, microseconds; 0 before the first.
    pub turnaround_micros: u64,
}

/// What a worker is doing.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum WorkerState {
    /// Nobody has told it what to build.
    Idle,
    /// Fetches or builds the world.
    Preparing,
    /// Answers.
    Ready,
    /// Has let a lease run out, and answered nothing since.
    Slow,
    /// Answers what it has in hand, and goes.
    Leaving,
}

impl Worker {
    pub(super) fn new(threads: u16, depth: u16) -> Self {
        Self {
            threads: usize::from(threads.max(1)),
            depth: usize::from(depth.max(1)),
            told: None,
            ready: false,
            leaving: false,
            suspect: false,
            strikes: 0,
            in_flight: BTreeMap::new(),
            turnaround: Average::default(),
            thread_time: Average::default(),
            answered: 0,
        }
    }

    /// How many more questions it may hold. One at a time is enough to find out whether a suspect lives.
    pub(super) fn room(&self) -> usize {
        let places = match (self.ready && !self.leaving, self.suspect) {
            (false, _) => 0,
            (true, true) => 1,
            (true, false) => self.threads * self.depth,
        };
        places.saturating_sub(self.in_flight.len())
    }

    /// It has fewer questions than hands.
    pub(super) fn is_idle(&self) -> bool {
        self.in_flight.len() < self.threads
    }

    /// What it holds longest, one question a thread: what it probably works on.
    pub(super) fn oldest(&self) -> Vec<QuestionId> {
        let mut held: Vec<_> = self.in_flight.iter().map(|(id, held)| (held.sent, *id)).collect();
        held.sort_unstable();
        held.into_iter().take(self.threads).map(|(_, id)| id).collect()
    }

    /// How long it may take over a question, microseconds.
    pub(super) fn lease(&self, expired_before: u8) -> u64 {
        let usual = match self.turnaround.0 {
            0 => LEASE_UNKNOWN,
            usual => (usual * LEASE_FACTOR).max(LEASE_MIN),
        };
        usual.saturating_mul(1 << expired_before.min(16)).min(LEASE_MAX)
    }

    /// How old another's question must be before this worker could be done with it first, microseconds.
    pub(super) fn patience(&self) -> u64 {
        self.turnaround.0
    }

    /// It has answered; the end of the lease, if it held the question.
    pub(super) fn answered(&mut self, id: QuestionId, micros: u64, now: Moment) -> Option<Moment> {
        self.suspect = false;
        self.strikes = 0;
        self.answered += 1;
        self.thread_time.add(micros);
        let held = self.in_flight.remove(&id)?;
        self.turnaround.add(now.0.saturating_sub(held.sent.0));
        Some(held.lease)
    }

    pub(super) fn status(&self) -> WorkerStatus {
        let state = match self {
            Self { leaving: true, .. } => WorkerState::Leaving,
            Self { told: None, .. } => WorkerState::Idle,
            Self { ready: false, .. } => WorkerState::Preparing,
            Self { suspect: true, .. } => WorkerState::Slow,
            _ => WorkerState::Ready,
        };
        WorkerStatus {
            state,
            threads: self.threads,
            in_flight: self.in_flight.len(),
            answered: self.answered,
            thread_micros: self.thread_time.0,
            turnaround_micros: self.turnaround.0,
        }
    }
}

/// A mean that forgets: each new value counts an eighth. 0 before the first.
#[derive(Clone, Copy, Debug, Default)]
struct Average(u64);

impl Average {
    fn add(&mut self, value: u64) {
        let value = value.clamp(1, 1 << 40);
        self.0 = if self.0 == 0 { value } else { (self.0 * 7 + value).div_ceil(8) };
    }
}
