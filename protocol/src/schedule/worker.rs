//! What the schedule knows of one worker.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::window::Window;
use super::{
    HELD_MAX, LEASE_FACTOR, LEASE_MAX, LEASE_MIN, LEASE_UNKNOWN, Moment, QuestionId, RACES_MAX, STRIKES_MAX,
    TRIAL_EVERY,
};
use crate::question::WorldState;

#[derive(Debug)]
pub(super) struct Worker {
    pub(super) threads: usize,
    depth: usize,
    /// It computes nothing itself: `threads` are those behind it, and may be 0.
    pub(super) relays: bool,
    /// What it computes is right.
    pub(super) trusted: bool,
    /// It has given wrong answers; how that is known.
    pub(super) exposed: Option<String>,
    /// Questions whose answers are known that it has to answer before all others, and until when that is waited for.
    pub(super) exam: Option<Exam>,
    /// Answers of it that were chosen to be checked.
    pub(super) watched: u64,
    /// Answers of it that were compared with others' and are the same.
    pub(super) confirmed: u64,
    /// Answers of it that were delivered.
    pub(super) delivered: u64,
    /// The world it has been told about last.
    pub(super) told: Option<WorldState>,
    /// It has built that world, or one that only small changes part from it.
    pub(super) ready: bool,
    /// Others are called.
    pub(super) rests: bool,
    /// It wants no more questions.
    pub(super) leaving: bool,
    /// A lease of it ran out, or others were quicker again and again; and it has not answered anything since.
    pub(super) suspect: bool,
    /// Questions that others answered first though they were asked later, since its last answer.
    races_lost: u8,
    /// A suspect is asked nothing before.
    next_trial: Moment,
    /// Failures since its last good answer.
    strikes: u8,
    /// It failed again and again: until when it is asked nothing.
    quarantine: Option<Quarantine>,
    /// A question that others died of, and beside which it may hold nothing else.
    pub(super) alone_with: Option<QuestionId>,
    /// Questions it has been asked and has not answered, oldest number first.
    pub(super) in_flight: BTreeMap<QuestionId, Held>,
    /// Usual time between a question and its answer, microseconds; waiting in line included.
    turnaround: Average,
    /// Usual thread time of an answer, microseconds.
    thread_time: Average,
    /// How far it is, and how fast its answers come.
    pub(super) window: Window,
    answered: u64,
}

/// A question that a worker holds.
#[derive(Clone, Copy, Debug)]
pub(super) struct Held {
    pub(super) sent: Moment,
    pub(super) lease: Moment,
}

#[derive(Debug)]
struct Quarantine {
    until: Moment,
    /// How long it lasts, microseconds.
    length: u64,
    reason: String,
}

/// What a newcomer has to answer first.
#[derive(Clone, Copy, Debug)]
pub(super) struct Exam {
    pub(super) left: usize,
    pub(super) until: Moment,
}

/// What takes longer than the mean by so many mean deviations is late.
const DEVIATIONS: u64 = 2;

/// A worker's first quarantine, microseconds; each that follows without a good answer between is twice as long …
const QUARANTINE_FIRST: u64 = 10_000_000;
/// … up to this.
const QUARANTINE_MAX: u64 = 640_000_000;

/// What can be said about a worker.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct WorkerStatus {
    /// What it is doing.
    pub state: WorkerState,
    /// Why, if all is not well: for people.
    pub reason: Option<String>,
    /// Questions it answers at a time.
    pub threads: usize,
    /// Questions it may hold, if there are enough: more than its threads take, where the round trip is long.
    pub places: usize,
    /// Questions it has been asked and has not answered.
    pub in_flight: usize,
    /// Questions it has answered.
    pub answered: u64,
    /// Answers of it that others gave as well when they were asked.
    pub confirmed: u64,
    /// Usual thread time of an answer, microseconds; 0 before the first.
    pub thread_micros: u64,
    /// Usual time between a question and its answer, microseconds; 0 before the first.
    pub turnaround_micros: u64,
    /// There and back, as the transport measures it, microseconds.
    pub round_trip_micros: u64,
    /// How long it may take over a question before another is asked, microseconds.
    pub lease_micros: u64,
}

/// What a worker is doing.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum WorkerState {
    /// Nobody has told it what to build.
    Idle,
    /// Fetches or builds the world.
    Preparing,
    /// Answers.
    Ready,
    /// Has let a lease run out, or others answer its questions, and answered nothing since.
    Slow,
    /// Failed several times in a row, and is asked nothing, or a single question to see whether it is well again.
    Quarantined,
    /// Answers what it has begun, and goes.
    Leaving,
}

impl Worker {
    pub(super) fn new(threads: u16, depth: u16, trusted: bool) -> Self {
        Self {
            threads: usize::from(threads.max(1)),
            depth: usize::from(depth.max(1)),
            relays: false,
            trusted,
            exposed: None,
            exam: None,
            watched: 0,
            confirmed: 0,
            delivered: 0,
            told: None,
            ready: false,
            rests: false,
            leaving: false,
            suspect: false,
            races_lost: 0,
            next_trial: Moment(0),
            strikes: 0,
            quarantine: None,
            alone_with: None,
            in_flight: BTreeMap::new(),
            turnaround: Average::default(),
            thread_time: Average::default(),
            window: Window::default(),
            answered: 0,
        }
    }

    /// It hands on what so many threads behind it compute.
    pub(super) fn relay(&mut self, threads: u16) {
        self.threads = usize::from(threads);
        self.relays = true;
    }

    /// What it has room for does not depend on the time: it is no suspect, and never failed again and again.
    pub(super) fn is_steady(&self) -> bool {
        !self.suspect && self.quarantine.is_none()
    }

    /// It may be asked, if it has room.
    pub(super) fn is_willing(&self, now: Moment) -> bool {
        self.exam.is_none() && self.may_be_examined(now)
    }

    /// The same, of a newcomer as well.
    pub(super) fn may_be_examined(&self, now: Moment) -> bool {
        let is_free = self.ready && self.threads > 0 && !self.leaving && !self.rests && self.exposed.is_none();
        is_free && self.quarantine.as_ref().is_none_or(|quarantine| quarantine.until <= now)
    }

    /// How many more questions it may hold close by. One at a time is enough to find out whether a suspect lives.
    pub(super) fn room(&self, now: Moment) -> usize {
        let places =
            match (self.is_willing(now), self.suspect || self.quarantine.is_some() || self.alone_with.is_some()) {
                (false, _) => 0,
                (true, true) => usize::from(!self.suspect || self.next_trial <= now),
                (true, false) => self.threads * self.depth,
            };
        places.saturating_sub(self.in_flight.len())
    }

    /// How many questions it may hold in all, with those that only lie on a long way.
    pub(super) fn places(&self) -> usize {
        let near = self.threads * self.depth;
        near.max((near + self.window.holds()).min(HELD_MAX))
    }

    /// How many more questions it may hold where all that are open will be answered at `end`, in [`Window`]'s time: as
    /// many as it can have answered by then.
    pub(super) fn far_room(&self, now: Moment, end: f64) -> usize {
        let is_trusted =
            self.is_willing(now) && self.is_proven() && self.quarantine.is_none() && self.alone_with.is_none();
        let places = if is_trusted { self.places().min(self.window.share(end)) } else { 0 };
        places.saturating_sub(self.in_flight.len())
    }

    /// It failed. After several failures in a row, or one on probation, it is asked nothing for a while:
    /// whether that begins now.
    pub(super) fn strike(&mut self, reason: &str, now: Moment) -> bool {
        self.strikes = self.strikes.saturating_add(1);
        // What it still says of questions it had before is no news.
        let is_serving = self.quarantine.as_ref().is_some_and(|quarantine| quarantine.until > now);
        if self.strikes < STRIKES_MAX || is_serving {
            return false;
        }
        let length = self.quarantine.as_ref().map_or(QUARANTINE_FIRST, |last| (last.length * 2).min(QUARANTINE_MAX));
        let until = Moment(now.0.saturating_add(length));
        self.quarantine = Some(Quarantine { until, length, reason: format!("it fails again and again: {reason}") });
        true
    }

    /// When it will be tried again, if it is asked nothing before.
    pub(super) fn silent_until(&self) -> Option<Moment> {
        let trial = self.suspect.then_some(self.next_trial);
        self.quarantine.as_ref().map(|quarantine| quarantine.until).max(trial)
    }

    /// It is asked.
    pub(super) fn take(&mut self, id: QuestionId, held: Held) {
        if self.suspect {
            self.next_trial = Moment(held.sent.0.saturating_add(TRIAL_EVERY));
        }
        self.in_flight.insert(id, held);
    }

    /// Another was asked a question after it, and answered it before it; whether that makes it a suspect now.
    pub(super) fn lose_race(&mut self, now: Moment) -> bool {
        self.races_lost = self.races_lost.saturating_add(1);
        if self.suspect || self.races_lost < RACES_MAX {
            return false;
        }
        self.suspect = true;
        self.next_trial = Moment(now.0.saturating_add(TRIAL_EVERY));
        true
    }

    /// It has fewer questions than threads.
    pub(super) fn is_idle(&self) -> bool {
        self.in_flight.len() < self.threads
    }

    /// What it holds longest, one question a thread: what it probably works on.
    pub(super) fn oldest(&self) -> Vec<QuestionId> {
        let mut held: Vec<_> = self.in_flight.iter().map(|(id, held)| (held.sent, *id)).collect();
        held.sort_unstable();
        held.into_iter().take(self.threads).map(|(_, id)| id).collect()
    }

    /// It has answered, and no lease of it has run out since.
    pub(super) fn is_proven(&self) -> bool {
        self.answered > 0 && !self.suspect
    }

    /// How unlikely it is to answer: 0 for who has proved itself, 1 for who never answered, 2 for who let a lease run out.
    pub(super) fn doubt(&self) -> u8 {
        if self.suspect { 2 } else { u8::from(self.answered == 0) }
    }

    /// Its usual time between a question and its answer, microseconds, if it can be trusted to keep it.
    pub(super) fn usual(&self) -> Option<u64> {
        self.is_proven().then_some(self.turnaround.mean).filter(|usual| *usual > 0)
    }

    /// How long it may take over a question, microseconds, where the slowest other that is known takes so long.
    pub(super) fn lease(&self, expired_before: u8, slowest: u64) -> u64 {
        let usual = match (self.turnaround.mean, slowest) {
            (0, 0) => LEASE_UNKNOWN,
            (0, slowest) => (slowest * LEASE_FACTOR).clamp(LEASE_MIN, LEASE_UNKNOWN),
            (usual, _) => (usual * LEASE_FACTOR).max(LEASE_MIN),
        };
        usual.saturating_mul(1 << expired_before.min(16)).min(LEASE_MAX)
    }

    /// How old another's question must be before this worker could be done with it first, microseconds, where the
    /// slowest other that is known takes so long. Half of all answers take longer than the mean: where they wait for a
    /// busy master, to ask for those again would make it busier still.
    pub(super) fn patience(&self, slowest: u64) -> u64 {
        self.own_patience().unwrap_or(slowest)
    }

    /// The same, if it is known of itself.
    pub(super) fn own_patience(&self) -> Option<u64> {
        let Average { mean, deviation } = self.turnaround;
        (mean > 0).then_some(mean + DEVIATIONS * deviation)
    }

    /// It has answered; since when and until when it held the question, if it did.
    pub(super) fn answered(&mut self, id: QuestionId, micros: u64, round_trip: u64, now: Moment) -> Option<Held> {
        self.suspect = false;
        self.races_lost = 0;
        self.strikes = 0;
        self.quarantine = None;
        self.answered += 1;
        self.thread_time.add(micros);
        self.alone_with.take_if(|alone| *alone == id);
        let held = self.in_flight.remove(&id)?;
        self.turnaround.add(now.0.saturating_sub(held.sent.0));
        self.window.answered(held.sent, round_trip, now);
        Some(held)
    }

    pub(super) fn status(&self, slowest: u64) -> WorkerStatus {
        let state = match self {
            Self { leaving: true, .. } => WorkerState::Leaving,
            Self { quarantine: Some(_), .. } | Self { exposed: Some(_), .. } => WorkerState::Quarantined,
            Self { told: None, .. } => WorkerState::Idle,
            Self { ready: false, .. } => WorkerState::Preparing,
            Self { suspect: true, .. } => WorkerState::Slow,
            _ => WorkerState::Ready,
        };
        let reason = match (&self.exposed, &self.quarantine, state) {
            (Some(reason), ..) => Some(reason.clone()),
            (None, Some(quarantine), _) => Some(quarantine.reason.clone()),
            (None, None, WorkerState::Slow) => {
                Some("others had to answer its questions; it is tried now and then".into())
            }
            _ => None,
        };
        WorkerStatus {
            state,
            reason,
            threads: self.threads,
            places: self.places(),
            in_flight: self.in_flight.len(),
            answered: self.answered,
            confirmed: self.confirmed,
            thread_micros: self.thread_time.mean,
            turnaround_micros: self.turnaround.mean,
            round_trip_micros: self.window.round_trip(),
            lease_micros: self.lease(0, slowest),
        }
    }
}

/// A mean that forgets, and how far values are from it (RFC 6298, section 2). 0 before the first.
#[derive(Clone, Copy, Debug, Default)]
struct Average {
    /// Each new value counts an eighth …
    mean: u64,
    /// … and its distance from the mean a quarter.
    deviation: u64,
}

impl Average {
    fn add(&mut self, value: u64) {
        let value = value.clamp(1, 1 << 40);
        if self.mean == 0 {
            *self = Self { mean: value, deviation: value / 2 };
        } else {
            self.deviation = (self.deviation * 3 + self.mean.abs_diff(value)) / 4;
            self.mean = (self.mean * 7 + value).div_ceil(8);
        }
    }
}
