//! What the schedule is told, what it says, and what it counts.

use std::collections::BTreeSet;
use std::sync::Arc;

use serde::{Deserialize, Serialize};

use crate::question::{Asked, Question, Ticket, WorldState};

/// Microseconds since some fixed moment.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct Moment(pub u64);

/// A connection of a worker; a worker that comes back is another one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct WorkerId(pub u64);

/// A question's number, unique in a master's life.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct QuestionId(pub u64);

/// What can happen.
#[derive(Clone, Debug, PartialEq)]
pub enum Event {
    /// A worker has proved itself.
    Joined {
        /// Not seen before.
        worker: WorkerId,
        /// Questions it answers at a time; at least 1.
        threads: u16,
        /// Questions it should hold for each of them, however short the way is: 2 within a process, else 3.
        depth: u16,
        /// What it computes is right: nobody checks it, and it decides where others disagree.
        trusted: bool,
    },
    /// A worker has built a world.
    Ready {
        /// Who.
        worker: WorkerId,
        /// Which.
        state: WorldState,
    },
    /// A worker says that it computes nothing itself, and how much those can take who are behind it.
    Relays {
        /// Who.
        worker: WorkerId,
        /// Questions that are answered there at a time. 0: it holds nothing any more, and is asked nothing.
        threads: u16,
    },
    /// A worker says that some of what it has handed on was wrong.
    Retracted {
        /// Who.
        worker: WorkerId,
        /// For people.
        reason: String,
    },
    /// A worker asks to be asked no more.
    Leaving {
        /// Who.
        worker: WorkerId,
        /// Questions that it will still answer.
        started: Vec<QuestionId>,
    },
    /// A connection has ended, in whatever way.
    Left {
        /// Who.
        worker: WorkerId,
    },
    /// From now on, questions are about another world or revision. All that are open end here.
    World {
        /// Which.
        state: WorldState,
        /// It is an edit of the one before: who has that one needs only be told the changes.
        edit: bool,
    },
    /// From now on, questions are about the next revision: an edit of the one before. Those that are open are still answered.
    Edited {
        /// Which.
        state: WorldState,
    },
    /// The front end asks.
    Asked(Vec<Asked>),
    /// A sound answer has arrived.
    Answered {
        /// From whom.
        worker: WorkerId,
        /// To what.
        id: QuestionId,
        /// Thread time it took, microseconds.
        micros: u64,
        /// There and back as the transport measures it, microseconds, without any waiting at the worker; 0 within a
        /// process.
        round_trip: u64,
        /// Of what it says: the same for the same, see [`crate::digest`].
        digest: u64,
    },
    /// A worker cannot answer, or its answer made no sense.
    Failed {
        /// Who.
        worker: WorkerId,
        /// What.
        id: QuestionId,
        /// For people.
        reason: String,
    },
    /// A worker says that nobody can answer: the world does not have what is asked about.
    Refused {
        /// Who.
        worker: WorkerId,
        /// What.
        id: QuestionId,
        /// For people.
        reason: String,
    },
    /// A worker lacks the world of a question.
    Missing {
        /// Who.
        worker: WorkerId,
        /// What.
        id: QuestionId,
    },
    /// Only these are asked from now on, whoever else is there; `None`: all are.
    Called(Option<Vec<WorkerId>>),
    /// The front end waits for these no more.
    Cancelled(BTreeSet<Ticket>),
    /// The front end waits for nothing any more.
    CancelledAll,
    /// Whoever draws has all it wants: [`Action::ChecksFinished`] is to say when nothing is being checked any more.
    FinishChecks,
    /// The time of the last [`Action::WakeAt`] has come.
    Woke,
}

/// What is to be done about it.
#[derive(Clone, Debug, PartialEq)]
pub enum Action {
    /// Give a worker the current world, from the ground up.
    Teach(WorkerId),
    /// Tell a worker the last changes.
    Update(WorkerId),
    /// Ask a worker.
    Send {
        /// Whom.
        worker: WorkerId,
        /// The question's number.
        id: QuestionId,
        /// What.
        question: Arc<Question>,
    },
    /// Tell a worker that nobody waits for these.
    Cancel {
        /// Whom.
        worker: WorkerId,
        /// What.
        ids: Vec<QuestionId>,
    },
    /// The answer just received is the one: hand it to the front end.
    Deliver {
        /// Its number.
        id: QuestionId,
        /// What was asked.
        asked: Asked,
        /// Who answered.
        worker: WorkerId,
    },
    /// The question cannot be answered: the rest of the picture goes on without it.
    GiveUp {
        /// What was asked.
        asked: Asked,
        /// For people.
        reason: String,
    },
    /// A worker has given wrong answers: it is asked no more as long as it is there. It may have gone.
    Expose {
        /// Who.
        worker: WorkerId,
        /// How that is known, for people.
        reason: String,
        /// Answers of it were delivered: what was made of them has to be made again.
        gave: bool,
    },
    /// Workers give different answers to the same question, and nobody is there to decide. Said once of the same ones.
    Undecided {
        /// Who.
        workers: Vec<WorkerId>,
        /// To what, for people.
        ask: String,
    },
    /// In answer to [`Event::FinishChecks`].
    ChecksFinished,
    /// Come back with [`Event::Woke`] at this time; earlier requests are void.
    WakeAt(Moment),
}

/// Counters since the beginning.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counters {
    /// Questions that were asked.
    pub asked: u64,
    /// Questions whose answer was delivered.
    pub delivered: u64,
    /// Questions given up.
    pub given_up: u64,
    /// Questions sent to workers, the same one perhaps several times.
    pub sent: u64,
    /// Questions asked of a second worker because threads were idle.
    pub asked_twice: u64,
    /// Leases that ran out.
    pub leases_expired: u64,
    /// Workers put into quarantine.
    pub quarantines: u64,
    /// Answers of a second worker, or a third, that were compared with those before.
    pub checked: u64,
    /// Workers that were found to compute wrongly.
    pub exposed: u64,
    /// Answers that nobody waited for any more.
    pub useless: u64,
    /// Light sets begun: summed over workers and frames.
    pub sets_begun: u64,
    /// Frames taken part in: summed over workers. `sets_begun / shares` is the mean number of
    /// distinct sets per worker and frame (the paper: about 2).
    pub shares: u64,
}
