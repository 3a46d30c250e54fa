//! All workers, and what has to be known of all of them together, renewed one by one: who has room, who is idle and how
//! patient, how slow the slowest is. So an event costs the logarithm of their number, not their number.
//!
//! What can be said of a worker only at a given time is not filed: suspects, and those in quarantine. There are few.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::{Bound, Index};

use super::worker::Worker;
use super::{Moment, TWICE_MIN, WorkerId};

#[derive(Debug, Default)]
pub(super) struct Crew {
    workers: BTreeMap<WorkerId, Worker>,
    /// What of each is in the indices below.
    filed: BTreeMap<WorkerId, Filed>,
    /// The usual times between a question and its answer, of those who have proved themselves.
    usual: BTreeSet<(u64, WorkerId)>,
    /// Who may hold more questions.
    roomy: BTreeSet<WorkerId>,
    /// Who may hold more because of a long way.
    far: BTreeSet<WorkerId>,
    /// Who has threads without a question, and how old another's question must be before it could be done with it first.
    idle: BTreeSet<(u64, WorkerId)>,
    /// Who has, and has not proved itself.
    idle_unproven: BTreeSet<WorkerId>,
    /// Who has room at some times.
    unsteady: BTreeSet<WorkerId>,
}

/// What is filed of a worker.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Filed {
    usual: Option<u64>,
    is_roomy: bool,
    is_far: bool,
    idle: Option<u64>,
    is_idle_unproven: bool,
    is_unsteady: bool,
}

impl Filed {
    fn of(worker: &Worker) -> Self {
        let is_steady = worker.is_steady();
        // Of steady ones, no time changes what there is room for.
        let is_roomy = is_steady && worker.room(Moment(0)) > 0;
        let is_idle = is_roomy && worker.is_idle();
        let patience = worker.own_patience().filter(|_| worker.is_proven());
        Self {
            usual: worker.usual(),
            is_roomy,
            is_far: is_steady && worker.far_room(Moment(0), f64::INFINITY) > 0,
            idle: patience.filter(|_| is_idle).map(|patience| patience.max(TWICE_MIN)),
            is_idle_unproven: is_idle && patience.is_none(),
            is_unsteady: !is_steady,
        }
    }
}

impl Crew {
    pub(super) fn get(&self, id: &WorkerId) -> Option<&Worker> {
        self.workers.get(id)
    }

    pub(super) fn iter(&self) -> impl Iterator<Item = (&WorkerId, &Worker)> {
        self.workers.iter()
    }

    pub(super) fn insert(&mut self, id: WorkerId, worker: Worker) {
        self.workers.insert(id, worker);
        self.file(id);
    }

    pub(super) fn remove(&mut self, id: WorkerId) {
        self.workers.remove(&id);
        self.file(id);
    }

    /// Changes what is known of a worker, if it is there.
    pub(super) fn change<T>(&mut self, id: WorkerId, change: impl FnOnce(&mut Worker) -> T) -> Option<T> {
        let outcome = self.workers.get_mut(&id).map(change);
        self.file(id);
        outcome
    }

    /// As [`Self::change`], for all.
    pub(super) fn change_all(&mut self, mut change: impl FnMut(WorkerId, &mut Worker)) {
        self.workers.iter_mut().for_each(|(id, worker)| change(*id, worker));
        self.workers.keys().copied().collect::<Vec<_>>().into_iter().for_each(|id| self.file(id));
    }

    /// Nobody is to be found with room until it is changed again: it keeps what it has room for, for something special.
    pub(super) fn set_aside(&mut self, id: WorkerId) {
        self.put(id, Filed { usual: self.workers.get(&id).and_then(Worker::usual), ..Filed::default() });
    }

    /// Files a worker as it is now; to be called after [`Self::set_aside`].
    pub(super) fn file(&mut self, id: WorkerId) {
        self.put(id, self.workers.get(&id).map_or(Filed::default(), Filed::of));
    }

    fn put(&mut self, id: WorkerId, now: Filed) {
        let before = self.filed.get(&id).copied().unwrap_or_default();
        if before == now {
            return;
        }
        if now == Filed::default() {
            self.filed.remove(&id);
        } else {
            self.filed.insert(id, now);
        }
        for (set, before, now) in [(&mut self.usual, before.usual, now.usual), (&mut self.idle, before.idle, now.idle)]
        {
            if before != now {
                before.map(|before| set.remove(&(before, id)));
                now.map(|now| set.insert((now, id)));
            }
        }
        for (set, before, now) in [
            (&mut self.roomy, before.is_roomy, now.is_roomy),
            (&mut self.far, before.is_far, now.is_far),
            (&mut self.idle_unproven, before.is_idle_unproven, now.is_idle_unproven),
            (&mut self.unsteady, before.is_unsteady, now.is_unsteady),
        ] {
            match (before, now) {
                (true, false) => _ = set.remove(&id),
                (false, true) => _ = set.insert(id),
                _ => {}
            }
        }
    }

    pub(super) fn len(&self) -> usize {
        self.workers.len()
    }

    /// The usual time between a question and its answer of the slowest that has proved itself, microseconds; 0: nobody has.
    pub(super) fn slowest(&self) -> u64 {
        self.usual.last().map_or(0, |(usual, _)| *usual)
    }

    /// Suspects and those in quarantine.
    pub(super) fn unsteady(&self) -> impl Iterator<Item = (WorkerId, &Worker)> {
        self.unsteady.iter().map(|id| (*id, &self.workers[id]))
    }

    /// Those of them that have room now.
    pub(super) fn unsteady_with_room(&self, now: Moment) -> BTreeSet<WorkerId> {
        self.unsteady().filter(|(_, worker)| worker.room(now) > 0).map(|(id, _)| id).collect()
    }

    /// Somebody may hold more questions now.
    pub(super) fn has_room(&self, now: Moment) -> bool {
        !self.roomy.is_empty() || self.unsteady().any(|(_, worker)| worker.room(now) > 0)
    }

    /// Who comes after a worker, in a circle, of all that have room and some others.
    pub(super) fn next_with_room(&self, after: Option<WorkerId>, others: &BTreeSet<WorkerId>) -> Option<WorkerId> {
        let from = after.map_or(Bound::Unbounded, Bound::Excluded);
        let next = |from| {
            let first = |set: &BTreeSet<WorkerId>| set.range((from, Bound::Unbounded)).next().copied();
            first(&self.roomy).into_iter().chain(first(others)).min()
        };
        next(from).or_else(|| next(Bound::Unbounded))
    }

    /// Who may hold more because of a long way, as far as that is known of itself alone.
    pub(super) fn far(&self) -> impl Iterator<Item = (WorkerId, &Worker)> {
        self.far.iter().map(|id| (*id, &self.workers[id]))
    }

    /// Who has threads without a question and has proved itself, and its patience; the least patient first.
    pub(super) fn idle(&self) -> impl Iterator<Item = (u64, WorkerId)> {
        self.idle.iter().copied()
    }

    /// Who has threads without a question and has not proved itself.
    pub(super) fn idle_unproven(&self) -> impl Iterator<Item = WorkerId> {
        self.idle_unproven.iter().copied()
    }
}

impl Index<&WorkerId> for Crew {
    type Output = Worker;

    fn index(&self, id: &WorkerId) -> &Worker {
        &self.workers[id]
    }
}
