//! Who is asked what next: suspects first, then checks, then what waits, then what others hold; and when to look again.

use std::collections::BTreeSet;
use std::sync::Arc;

use super::speculation::CLASSES;
use super::worker::{Held, Worker};
use super::{Action, LEASE_MIN, Moment, QuestionId, Schedule, TWICE_MIN, WorkerId, window};

/// When all that is open will be answered, and for how long that is believed.
#[derive(Clone, Copy, Debug)]
pub(super) struct End {
    /// Microseconds, see [`window::end`].
    at: f64,
    /// When this was found out, of how many questions and workers.
    found: Moment,
    open: usize,
    workers: usize,
}

/// It is found out anew after this time, microseconds, or when so much of the questions has come or gone.
const END_HOLDS: u64 = 1000;
const END_SHARE: usize = 8;

impl Schedule {
    /// One question to each worker with a free place, in turn, until there is no place or no question.
    pub(super) fn assign(&mut self, now: Moment, actions: &mut Vec<Action>) {
        self.assign_suspects(now, actions);
        // It must get through what it holds first.
        let alone = self.next_alone(now).map(|(_, alone)| alone);
        if let Some(alone) = alone {
            self.workers.set_aside(alone);
        }
        self.assign_checks(alone, now, actions);
        self.assign_waiting(alone, now, actions);
        if self.waiting.is_empty() {
            self.assign_twice(alone, now, actions);
        } else {
            self.assign_far(alone, now, actions);
        }
        if let Some(alone) = alone {
            self.workers.file(alone);
        }
    }

    /// Questions that nobody holds.
    fn assign_waiting(&mut self, alone: Option<WorkerId>, now: Moment, actions: &mut Vec<Action>) {
        if self.waiting.is_empty() {
            return;
        }
        let mut others = self.workers.unsteady_with_room(now);
        others.retain(|id| Some(*id) != alone);
        let mut last = None;
        while let Some(id) = self.workers.next_with_room(last, &others) {
            let Some(question) = self.next_for(id) else { return };
            self.send(id, question, now, actions);
            if others.contains(&id) && self.workers[&id].room(now) == 0 {
                others.remove(&id);
            }
            last = Some(id);
        }
    }

    /// The longest unanswered questions of others, to who has idle threads.
    fn assign_twice(&mut self, alone: Option<WorkerId>, now: Moment, actions: &mut Vec<Action>) {
        // Nobody asks for what is younger than this, and most often there is nothing else.
        if self.speculation.oldest().is_none_or(|since| since.0.saturating_add(TWICE_MIN) > now.0) {
            return;
        }
        let mut idle = self.idle_since_long(alone, now);
        while !idle.is_empty() {
            idle.retain(|&id| {
                let Some(question) = self.next_speculative(id, now) else { return false };
                self.send(id, question, now, actions);
                self.workers[&id].room(now) > 0
            });
        }
    }

    /// Who has idle threads and has been patient enough for some question, if it does not hold it itself.
    fn idle_since_long(&self, alone: Option<WorkerId>, now: Moment) -> BTreeSet<WorkerId> {
        let is_due = |patience: u64| self.speculation.first_due(patience).is_some_and(|due| due <= now);
        let proven = self.workers.idle().take_while(|(patience, _)| is_due(*patience)).map(|(_, id)| id);
        let is_unproven_due = self.first_unproven().is_some_and(|due| due <= now);
        let unproven = self.workers.idle_unproven().filter(|_| is_unproven_due);
        let unsteady = self.workers.unsteady_with_room(now);
        proven.chain(unproven).chain(unsteady).filter(|id| Some(*id) != alone).collect()
    }

    /// Questions that nobody holds, as if places on the way to workers were some of theirs.
    fn assign_far(&mut self, alone: Option<WorkerId>, now: Moment, actions: &mut Vec<Action>) {
        let mut eager: Vec<_> = self.workers.far().map(|(id, _)| id).filter(|id| Some(*id) != alone).collect();
        if eager.is_empty() {
            return;
        }
        let end = self.end(now);
        eager.retain(|id| self.workers[id].far_room(now, end) > 0);
        while !eager.is_empty() {
            eager.retain(|&id| {
                let Some(question) = self.next_for(id) else { return false };
                self.send(id, question, now, actions);
                self.workers[&id].far_room(now, end) > 0
            });
        }
    }

    /// When all that is open will be answered. All workers have a say in it, so it is not found out at every event.
    fn end(&mut self, now: Moment) -> f64 {
        let (open, workers) = (self.open.len(), self.workers.len());
        let holds = |end: &&End| {
            end.workers == workers
                && now.0 < end.found.0.saturating_add(END_HOLDS)
                && end.open.abs_diff(open) <= end.open / END_SHARE
        };
        if let Some(end) = self.end.as_ref().filter(holds) {
            return end.at;
        }
        let trusted = self.workers.iter().filter(|(_, worker)| worker.is_willing(now) && worker.is_proven());
        let at = window::end(trusted.map(|(_, worker)| &worker.window), open);
        self.end = Some(End { at, found: now, open, workers });
        at
    }

    /// Questions that somebody died of or failed at go first, so that the picture does not wait for them at its end.
    fn assign_suspects(&mut self, now: Moment, actions: &mut Vec<Action>) {
        let suspects: Vec<_> = self.suspects.iter().copied().filter(|id| !self.open[id].is_on_its_last()).collect();
        for question in suspects {
            let free = |(_, worker): &(WorkerId, &Worker)| worker.room(now) > 0;
            let best = self.fit_for(question, now).filter(free).min_by_key(|(id, worker)| (worker.doubt(), *id));
            let Some((id, _)) = best else { continue };
            self.suspects.remove(&question);
            self.send(id, question, now, actions);
        }
        while let Some((question, alone)) = self.next_alone(now)
            && self.workers[&alone].in_flight.is_empty()
        {
            self.suspects.remove(&question);
            self.workers.change(alone, |worker| worker.alone_with = Some(question));
            self.send(alone, question, now, actions);
        }
    }

    /// The next question that must be alone with a worker, and the worker that will be free for it first.
    fn next_alone(&self, now: Moment) -> Option<(QuestionId, WorkerId)> {
        let question = self.suspects.iter().find(|id| self.open[id].is_on_its_last())?;
        let free = self.fit_for(*question, now).filter(|(_, worker)| worker.alone_with.is_none());
        let (alone, _) = free.min_by_key(|(id, worker)| (worker.doubt(), worker.in_flight.len(), *id))?;
        Some((*question, alone))
    }

    /// Workers that may be asked a suspect question: those that have not failed at it, if there are any.
    fn fit_for(&self, question: QuestionId, now: Moment) -> impl Iterator<Item = (WorkerId, &Worker)> {
        let failed_at = &self.open[&question].failed_at;
        let willing = move || self.workers.iter().filter(move |(_, worker)| worker.is_willing(now));
        let is_new = willing().any(|(id, _)| !failed_at.contains(id));
        willing().filter(move |(id, _)| !is_new || !failed_at.contains(id)).map(|(id, worker)| (*id, worker))
    }

    /// A question that nobody holds.
    pub(super) fn next_for(&mut self, id: WorkerId) -> Option<QuestionId> {
        let open = &self.open;
        let (question, share) = self.waiting.pop_for(id, |question| {
            // Not if it was answered late, or somebody failed at it late, after its lease had run out.
            open.get(&question).is_some_and(|open| open.holders.is_empty() && open.deaths == 0)
        })?;
        self.counters.sets_begun += u64::from(share.new_set);
        self.counters.shares += u64::from(share.new_frame);
        Some(question)
    }

    /// The longest unanswered question of another worker, if this one has idle threads.
    fn next_speculative(&mut self, id: WorkerId, now: Moment) -> Option<QuestionId> {
        let worker = &self.workers[&id];
        if !worker.is_idle() {
            return None;
        }
        let least = worker.patience(self.workers.slowest()).max(TWICE_MIN);
        let is_due = |question| self.speculate_from(id, question).is_some_and(|due| due <= now);
        let oldest = |class: usize| {
            let old = self.speculation.by_age(class).take_while(|(since, _)| since.0.saturating_add(least) <= now.0);
            old.into_iter().find(|(_, question)| is_due(*question))
        };
        let (_, question) = (0..CLASSES).filter_map(oldest).min()?;
        self.counters.asked_twice += 1;
        Some(question)
    }

    /// From when on a worker may be asked a question that others hold; never if it holds it itself.
    fn speculate_from(&self, id: WorkerId, question: QuestionId) -> Option<Moment> {
        let (worker, open) = (&self.workers[&id], &self.open[&question]);
        if open.holders.contains(&id) {
            return None;
        }
        let usual = worker.patience(self.workers.slowest()).max(TWICE_MIN);
        let patience = match open.holders.len() as u64 {
            0 | 1 => usual,
            _ if worker.is_proven() => usual << open.trusted.saturating_sub(1),
            // Who has not proved itself may be as silent as those that hold it: it gets a chance now and then.
            holders => usual.max((holders - 1) * LEASE_MIN),
        };
        Some(Moment(open.since.0.saturating_add(patience)))
    }

    pub(super) fn send(&mut self, id: WorkerId, question: QuestionId, now: Moment, actions: &mut Vec<Action>) {
        let slowest = self.workers.slowest();
        let Some(open) = self.open.get_mut(&question) else { return };
        let taken = self.workers.change(id, |worker| {
            let lease = Moment(now.0.saturating_add(worker.lease(open.expired, slowest)));
            worker.take(question, Held { sent: now, lease });
            (lease, worker.is_proven())
        });
        let Some((lease, is_proven)) = taken else { return };
        self.leases.insert((lease, id, question));
        if open.holders.is_empty() || is_proven {
            open.since = now;
        }
        open.holders.insert(id);
        open.asked.insert(id);
        self.counters.sent += 1;
        actions.push(Action::Send { worker: id, id: question, question: Arc::clone(&open.question.question) });
        self.file(question);
    }

    /// The next moment at which time alone changes something: a lease, or a question old enough to be asked twice.
    pub(super) fn set_alarm(&mut self, now: Moment, actions: &mut Vec<Action>) {
        let lease = self.leases.first().map(|(lease, ..)| *lease);
        let twice = self.first_twice(now);
        let released =
            self.workers.unsteady().filter_map(|(_, worker)| worker.silent_until()).filter(|until| *until > now);
        let examined = self.checks.exam_ends();
        let next =
            twice.into_iter().chain(lease).chain(released).chain(examined).min().map(|at| at.max(Moment(now.0 + 1)));
        if next != self.wake_at {
            self.wake_at = next;
            actions.extend(next.map(Action::WakeAt));
        }
    }

    /// The first moment at which somebody idle may ask a question that others hold, or an earlier one.
    fn first_twice(&self, now: Moment) -> Option<Moment> {
        self.speculation.oldest()?;
        let least_patient = self.workers.idle().next();
        let early = least_patient.and_then(|(patience, _)| self.speculation.first_due(patience));
        let has_unproven = self.workers.idle_unproven().next().is_some();
        let unproven = self.first_unproven().filter(|_| has_unproven);
        let early = early.into_iter().chain(unproven).min();
        let unsteady = self.first_twice_among(self.workers.unsteady_with_room(now).into_iter());
        if early.is_none_or(|early| early > now) {
            return early.into_iter().chain(unsteady).min();
        }
        // They hold what is due: somebody else, or something else, is next.
        let steady = self.workers.idle().map(|(_, id)| id).chain(self.workers.idle_unproven());
        self.first_twice_among(steady).into_iter().chain(unsteady).min()
    }

    /// The same, of some workers, and exactly.
    fn first_twice_among(&self, workers: impl Iterator<Item = WorkerId>) -> Option<Moment> {
        workers.filter_map(|id| self.first_twice_of(id)).min()
    }

    /// The first moment at which somebody who has not proved itself may ask a question that others hold, or an earlier one: of
    /// its own it has no patience.
    fn first_unproven(&self) -> Option<Moment> {
        let patience = self.workers.slowest().max(TWICE_MIN);
        self.speculation.oldest().map(|since| Moment(since.0.saturating_add(patience)))
    }

    /// When a worker may ask a question that others hold; never if it has no idle thread.
    fn first_twice_of(&self, id: WorkerId) -> Option<Moment> {
        let worker = &self.workers[&id];
        if !worker.is_idle() {
            return None;
        }
        let usual = worker.patience(self.workers.slowest()).max(TWICE_MIN);
        let mut first: Option<Moment> = None;
        for class in 0..CLASSES {
            for (since, question) in self.speculation.by_age(class) {
                if first.is_some_and(|first| since.0.saturating_add(usual) >= first.0) {
                    break;
                }
                first = first.into_iter().chain(self.speculate_from(id, question)).min();
            }
        }
        first
    }
}
