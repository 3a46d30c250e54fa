//! The master's manners: who is asked what, and what is done about those who do not answer.
//!
//! **Promise.** Every question that is asked ends exactly once: it is delivered, given up with a
//! reason, or cancelled by whoever asked. As long as one ready worker lives and answers, it is
//! delivered. Which worker answers, how often, and in which order, changes only time.
//!
//! **Principles.**
//! * *Affinity.* A worker that has begun a light set gets that set's tiles; a new worker begins a
//!   set that nobody has; sets are shared only when their tail is long enough to pay for making
//!   the set twice ([`waiting`]).
//! * *Depth.* Each worker holds a few questions more than it has threads, so that the way there and
//!   back costs no time; one that is far away holds as many more as lie on the way ([`window`]), but no more than it can
//!   answer before all that is open will be answered: nobody hoards what others could do sooner.
//! * *Leases.* A question that is not answered in several times the worker's usual time is given
//!   to another as well. A late answer is as good as any.
//! * *Twice at the end.* When threads are idle, the longest unanswered questions are asked again. A holder that has
//!   never answered, or has let a lease run out, does not count ([`speculation`]): however many stay silent, a worker that has
//!   proved itself may ask. Who loses such races again and again is tried with one question a second, so that
//!   somebody dead does not cost a hitch in every frame until its connection ends.
//! * *Suspects.* A question that a worker died of, or failed at, goes to another worker, if there is
//!   one; the second time to one that holds nothing else, so that no innocent question is blamed. The
//!   third time it is given up: the picture goes on without it.
//! * *Refusals.* Who says that nobody can answer a question is not blamed for it, and others are asked to confirm; if
//!   one of them answers after all, that counts as a failure of those who refused.
//! * *Quarantine.* A worker that fails several times in a row is asked nothing for a while, then one
//!   question, and nothing for twice as long if it fails again. It stays connected, so that it cannot
//!   come back as a new one.
//!
//! It has no sockets and no clock: events and times come in, actions go out. Whoever carries out
//! the actions must hand what it sends to one worker over **in order**: changes of the world come
//! before questions about it.
//!
//! **What it leaves out**: what is in an answer, how worlds are sent, who may join.

mod crew;
mod event;
mod speculation;
mod waiting;
mod window;
mod worker;

#[cfg(test)]
mod tests;

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use crate::question::{Ask, Asked, Frames, Points, Question, Rays, WorldState};
use crew::Crew;
pub use event::{Action, Counters, Event, Moment, QuestionId, WorkerId};
use speculation::{CLASSES, Speculation};
use waiting::{Group, Waiting};
use worker::Worker;
pub use worker::{WorkerState, WorkerStatus};

/// Most questions that may be open at a time.
pub const OPEN_MAX: usize = 1 << 16;
/// Most questions that a worker holds because it is far away.
pub const HELD_MAX: usize = 256;
/// Questions that a worker of another process holds for each of its threads: hides a short way there and back.
pub const HELD_PER_THREAD: u16 = 3;
/// A lease is at least this long, microseconds: short hiccups of machine and network cost nothing.
const LEASE_MIN: u64 = 1_000_000;
/// … and at most this.
const LEASE_MAX: u64 = 300_000_000;
/// The lease of a worker's first question is that of the slowest other; as long as nobody has answered anything, this,
/// and never more.
const LEASE_UNKNOWN: u64 = 30_000_000;
/// A lease, over the usual time between asking a worker and its answer.
const LEASE_FACTOR: u64 = 6;
/// No question is asked twice before this age, microseconds.
const TWICE_MIN: u64 = 20_000;
/// Holders of a question that can be trusted to answer, at most; the second comes after the usual time, the third after
/// twice that.
const TRUSTED_MAX: usize = 3;
/// Workers that may die of a question, or fail at it, before it is given up.
const DEATHS_MAX: u8 = 3;
/// Questions in a row that others were asked after a worker and answered before it: it is no more trusted to answer.
const RACES_MAX: u8 = 3;
/// Who is not trusted is tried with one question so often, microseconds.
const TRIAL_EVERY: u64 = 1_000_000;
/// Failures in a row before a worker is put into quarantine.
const STRIKES_MAX: u8 = 5;

/// The master's half of the conversation with all workers.
#[derive(Debug, Default)]
pub struct Schedule {
    state: WorldState,
    has_world: bool,
    workers: Crew,
    /// Who is asked; `None`: everybody.
    called: Option<Vec<WorkerId>>,
    open: BTreeMap<QuestionId, Open>,
    waiting: Waiting,
    /// Questions that nobody holds, and that somebody died of or failed at.
    suspects: BTreeSet<QuestionId>,
    /// When leases run out.
    leases: BTreeSet<(Moment, WorkerId, QuestionId)>,
    /// Questions that may be asked of another as well.
    speculation: Speculation,
    /// When all that is open will be answered, as it was found out last.
    end: Option<End>,
    next_id: u64,
    counters: Counters,
    wake_at: Option<Moment>,
}

/// When all that is open will be answered, and for how long that is believed.
#[derive(Clone, Copy, Debug)]
struct End {
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

/// A question that has not ended.
#[derive(Debug)]
struct Open {
    question: Asked,
    /// Who has it on their list now.
    holders: BTreeSet<WorkerId>,
    /// How many of them can be trusted to answer.
    trusted: usize,
    /// Who has been asked and has not failed since: an answer of anybody else is not taken.
    asked: BTreeSet<WorkerId>,
    /// Since when somebody who can be trusted to answer holds it, or anybody if nobody can.
    since: Moment,
    /// Leases that ran out: the next is twice as long.
    expired: u8,
    /// How often somebody died of it or failed at it.
    deaths: u8,
    /// Who failed at it, or let its lease run out.
    failed_at: BTreeSet<WorkerId>,
    /// Who says that nobody can answer it.
    refused_by: BTreeSet<WorkerId>,
}

impl Open {
    fn new(question: Asked) -> Self {
        let nobody = BTreeSet::new();
        let (holders, asked, failed_at, refused_by) = (nobody.clone(), nobody.clone(), nobody.clone(), nobody);
        Self { question, holders, trusted: 0, asked, since: Moment(0), expired: 0, deaths: 0, failed_at, refused_by }
    }

    /// One more death, and it is given up.
    fn is_on_its_last(&self) -> bool {
        self.deaths + 1 >= DEATHS_MAX
    }
}

impl Schedule {
    /// Takes an event in, gives actions out; they are to be carried out in order.
    pub fn handle(&mut self, event: Event, now: Moment) -> Vec<Action> {
        let mut actions = Vec::new();
        match event {
            Event::Joined { worker, threads, depth } => self.welcome(worker, threads, depth, &mut actions),
            Event::Ready { worker, state } => self.ready(worker, state),
            Event::Leaving { worker, started } => self.let_go(worker, &started),
            Event::Left { worker } => self.bury(worker, &mut actions),
            Event::World { state, edit } => self.turn_to(state, edit, &mut actions),
            Event::Asked(questions) => self.take(questions, &mut actions),
            Event::Answered { worker, id, micros, round_trip } => {
                self.settle(worker, id, [micros, round_trip], now, &mut actions)
            }
            Event::Failed { worker, id, reason } => {
                self.fail(worker, id, &reason, &mut actions);
                self.strike(worker, &reason, now, &mut actions);
            }
            Event::Refused { worker, id, reason } => {
                if let Some(open) = self.open.get_mut(&id).filter(|open| open.asked.contains(&worker)) {
                    open.refused_by.insert(worker);
                }
                self.fail(worker, id, &format!("refused: {reason}"), &mut actions);
            }
            Event::Missing { worker, id } => self.teach_again(worker, id, now, &mut actions),
            Event::Called(called) => self.call(called),
            Event::CancelledAll => self.forget_all(&mut actions),
            Event::Woke => self.wake_at = None,
        }
        self.end_leases(now);
        self.assign(now, &mut actions);
        self.set_alarm(now, &mut actions);
        actions
    }

    /// Whether a worker has built the world that questions are about.
    pub fn is_ready(&self, worker: WorkerId) -> bool {
        self.workers.get(&worker).is_some_and(|worker| worker.ready)
    }

    /// The world that questions are about.
    pub fn state(&self) -> WorldState {
        self.state
    }

    /// A question that has not ended.
    pub fn question(&self, id: QuestionId) -> Option<&Question> {
        self.open.get(&id).map(|open| &*open.question.question)
    }

    /// How many questions have not ended.
    pub fn open_len(&self) -> usize {
        self.open.len()
    }

    /// What was done so far.
    pub fn counters(&self) -> Counters {
        self.counters
    }

    /// How the workers are.
    pub fn workers(&self) -> impl Iterator<Item = (WorkerId, WorkerStatus)> {
        let slowest = self.workers.slowest();
        self.workers.iter().map(move |(id, worker)| (*id, worker.status(slowest)))
    }

    fn welcome(&mut self, id: WorkerId, threads: u16, depth: u16, actions: &mut Vec<Action>) {
        let mut worker = Worker::new(threads, depth);
        worker.rests = self.called.as_ref().is_some_and(|called| !called.contains(&id));
        if self.has_world {
            worker.told = Some(self.state);
            actions.push(Action::Teach(id));
        }
        self.workers.insert(id, worker);
    }

    fn ready(&mut self, id: WorkerId, state: WorldState) {
        let current = self.state;
        self.workers.change(id, |worker| {
            // What it is told after that comes before the questions: the same world will do.
            worker.ready |= worker.told == Some(current) && state.world == current.world;
        });
    }

    fn call(&mut self, called: Option<Vec<WorkerId>>) {
        self.workers.change_all(|id, worker| {
            worker.rests = called.as_ref().is_some_and(|called| !called.contains(&id));
        });
        self.called = called;
    }

    fn let_go(&mut self, id: WorkerId, started: &[QuestionId]) {
        let not_begun: Option<Vec<_>> = self.workers.change(id, |worker| {
            worker.leaving = true;
            worker.in_flight.keys().filter(|id| !started.contains(id)).copied().collect()
        });
        for question in not_begun.into_iter().flatten() {
            self.take_back(id, question);
        }
    }

    fn bury(&mut self, id: WorkerId, actions: &mut Vec<Action>) {
        let Some(worker) = self.workers.get(&id) else { return };
        let held: Vec<_> = worker.in_flight.keys().copied().collect();
        // Only what it had begun can have killed it: the oldest, one a thread. Who said good-bye was not killed.
        let suspects: Vec<_> = if worker.leaving { Vec::new() } else { worker.oldest() };
        for question in held {
            self.release(id, question);
            if suspects.contains(&question) {
                self.blame(question, "the worker was lost", actions);
            } else {
                self.lay_down(question);
            }
        }
        self.workers.remove(id);
        self.waiting.forget_worker(id);
    }

    fn turn_to(&mut self, state: WorldState, edit: bool, actions: &mut Vec<Action>) {
        self.forget_all(actions);
        let before = self.has_world.then_some(self.state);
        self.state = state;
        self.has_world = true;
        self.workers.change_all(|id, worker| {
            if edit && worker.told.is_some() && worker.told == before {
                actions.push(Action::Update(id));
            } else {
                worker.ready = false;
                actions.push(Action::Teach(id));
            }
            worker.told = Some(state);
        });
    }

    fn take(&mut self, questions: Vec<Asked>, actions: &mut Vec<Action>) {
        for asked in questions {
            self.counters.asked += 1;
            let reason = if asked.question.world != self.state || !self.has_world {
                "it is about another world than the current one"
            } else if self.open.len() >= OPEN_MAX {
                "too many questions are open"
            } else {
                let id = QuestionId(self.next_id);
                self.next_id += 1;
                self.waiting.push_back(group_of(&asked.question), id);
                self.open.insert(id, Open::new(asked));
                continue;
            };
            self.counters.given_up += 1;
            actions.push(Action::GiveUp { asked, reason: reason.into() });
        }
    }

    fn settle(
        &mut self,
        id: WorkerId,
        question: QuestionId,
        [micros, round_trip]: [u64; 2],
        now: Moment,
        actions: &mut Vec<Action>,
    ) {
        if !self.open.get(&question).is_some_and(|open| open.asked.contains(&id)) {
            self.counters.useless += 1;
            return;
        }
        let before = self.workers.change(id, |worker| {
            let was_proven = worker.is_proven();
            (was_proven, worker.answered(question, micros, round_trip, now))
        });
        let held = before.and_then(|(_, held)| held);
        if let Some(held) = held {
            self.leases.remove(&(held.lease, id, question));
        }
        let sent = held.map(|held| held.sent);
        if before.is_some_and(|(was_proven, _)| !was_proven) {
            self.file_all_of(id);
        }
        let Some(open) = self.open.remove(&question) else { return };
        self.speculation.remove(question);
        self.suspects.remove(&question);
        for holder in open.holders {
            let Some(held) = self.drop_held(holder, question) else { continue };
            actions.push(Action::Cancel { worker: holder, ids: vec![question] });
            // Who was asked first and is not done may be dead, though no lease of it ever runs out.
            if sent.is_some_and(|sent| held.sent < sent)
                && self.workers.change(holder, |worker| worker.lose_race(now)) == Some(true)
            {
                self.file_all_of(holder);
            }
        }
        for refuser in open.refused_by {
            self.strike(refuser, "it refuses what others answer", now, actions);
        }
        self.counters.delivered += 1;
        actions.push(Action::Deliver { id: question, asked: open.question, worker: id });
    }

    fn fail(&mut self, id: WorkerId, question: QuestionId, reason: &str, actions: &mut Vec<Action>) {
        self.release(id, question);
        if let Some(open) = self.open.get_mut(&question)
            && open.asked.remove(&id)
        {
            // Once for each time that it was asked, so that nobody can have a question given up alone by saying it thrice.
            open.failed_at.insert(id);
            self.blame(question, reason, actions);
        }
    }

    fn strike(&mut self, id: WorkerId, reason: &str, now: Moment, actions: &mut Vec<Action>) {
        let held = |worker: &mut Worker| {
            worker.strike(reason, now).then(|| worker.in_flight.keys().copied().collect::<Vec<_>>())
        };
        let Some(Some(ids)) = self.workers.change(id, held) else { return };
        self.counters.quarantines += 1;
        ids.iter().for_each(|question| self.take_back(id, *question));
        if !ids.is_empty() {
            actions.push(Action::Cancel { worker: id, ids });
        }
    }

    fn teach_again(&mut self, id: WorkerId, question: QuestionId, now: Moment, actions: &mut Vec<Action>) {
        // If nobody waits for it, the cancellation and this message have crossed.
        let is_news = self.open.contains_key(&question);
        self.take_back(id, question);
        // Of several questions it held, the first has told us.
        if !is_news || !self.workers.get(&id).is_some_and(|worker| worker.ready) {
            return;
        }
        let state = self.state;
        self.workers.change(id, |worker| (worker.ready, worker.told) = (false, Some(state)));
        actions.push(Action::Teach(id));
        self.strike(id, "it has lost its world", now, actions);
    }

    fn forget_all(&mut self, actions: &mut Vec<Action>) {
        self.workers.change_all(|worker, held| {
            if !held.in_flight.is_empty() {
                let ids = std::mem::take(&mut held.in_flight).into_keys().collect();
                held.alone_with = None;
                actions.push(Action::Cancel { worker, ids });
            }
        });
        self.open.clear();
        self.leases.clear();
        self.speculation.clear();
        self.suspects.clear();
        self.waiting.clear();
    }

    /// A worker will not answer a question: it waits again, unless another holds it too.
    fn take_back(&mut self, id: WorkerId, question: QuestionId) {
        if self.release(id, question) {
            self.lay_down(question);
        }
    }

    /// A worker does not hold a question any more; whether it did.
    fn release(&mut self, id: WorkerId, question: QuestionId) -> bool {
        let held = self.drop_held(id, question).is_some();
        self.open.get_mut(&question).is_some_and(|open| open.holders.remove(&id)) && held
    }

    /// Puts a question where it belongs after a holder of it is gone.
    fn lay_down(&mut self, question: QuestionId) {
        let Some(open) = self.open.get(&question) else { return };
        match (open.holders.len(), open.deaths) {
            (0, 0) => self.waiting.push_front(group_of(&open.question.question), question),
            (0, _) => _ = self.suspects.insert(question),
            _ => {}
        }
        self.file(question);
    }

    /// Notes whether a question may be asked of another as well. To be called whenever its holders change, or what is
    /// thought of them.
    fn file(&mut self, question: QuestionId) {
        let Some(open) = self.open.get_mut(&question) else { return self.speculation.remove(question) };
        let is_trusted = |id: &&WorkerId| self.workers.get(id).is_some_and(Worker::is_proven);
        open.trusted = open.holders.iter().filter(is_trusted).count();
        // What somebody died of is not asked twice any more: one death at a time.
        if open.holders.is_empty() || open.deaths > 0 || open.trusted >= TRUSTED_MAX {
            self.speculation.remove(question);
        } else {
            let class = if open.holders.len() <= 1 { 0 } else { open.trusted.saturating_sub(1) };
            self.speculation.put(question, open.since, class);
        }
    }

    /// As [`Self::file`], for all that a worker holds.
    fn file_all_of(&mut self, id: WorkerId) {
        let held = self.workers.get(&id).into_iter().flat_map(|worker| worker.in_flight.keys().copied());
        held.collect::<Vec<_>>().into_iter().for_each(|question| self.file(question));
    }

    /// Takes a question off a worker's list, if it is on it.
    fn drop_held(&mut self, id: WorkerId, question: QuestionId) -> Option<worker::Held> {
        let held = self.workers.change(id, |worker| {
            worker.alone_with.take_if(|alone| *alone == question);
            worker.in_flight.remove(&question)
        });
        let held = held.flatten()?;
        self.leases.remove(&(held.lease, id, question));
        Some(held)
    }

    /// A worker died of a question or failed at it, and does not hold it any more.
    fn blame(&mut self, question: QuestionId, reason: &str, actions: &mut Vec<Action>) {
        let Some(open) = self.open.get_mut(&question) else { return };
        open.deaths += 1;
        if open.deaths < DEATHS_MAX {
            return self.lay_down(question);
        }
        let Some(open) = self.open.remove(&question) else { return };
        self.suspects.remove(&question);
        self.speculation.remove(question);
        for holder in open.holders {
            if self.drop_held(holder, question).is_some() {
                actions.push(Action::Cancel { worker: holder, ids: vec![question] });
            }
        }
        self.counters.given_up += 1;
        let reason = format!("{DEATHS_MAX} attempts to answer it failed, the last: {reason}");
        actions.push(Action::GiveUp { asked: open.question, reason });
    }

    fn end_leases(&mut self, now: Moment) {
        while let Some((lease, id, question)) = self.leases.first().copied()
            && lease <= now
        {
            self.counters.leases_expired += 1;
            if let Some(open) = self.open.get_mut(&question) {
                open.expired = open.expired.saturating_add(1);
                open.failed_at.insert(id);
            }
            self.workers.change(id, |worker| worker.suspect = true);
            self.take_back(id, question);
            self.file_all_of(id);
        }
    }

    /// One question to each worker with a free place, in turn, until there is no place or no question.
    fn assign(&mut self, now: Moment, actions: &mut Vec<Action>) {
        self.assign_suspects(now, actions);
        // It must get through what it holds first.
        let alone = self.next_alone(now).map(|(_, alone)| alone);
        if let Some(alone) = alone {
            self.workers.set_aside(alone);
        }
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
    fn next_for(&mut self, id: WorkerId) -> Option<QuestionId> {
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

    fn send(&mut self, id: WorkerId, question: QuestionId, now: Moment, actions: &mut Vec<Action>) {
        let slowest = self.workers.slowest();
        let Some(open) = self.open.get_mut(&question) else { return };
        let taken = self.workers.change(id, |worker| {
            let lease = Moment(now.0.saturating_add(worker.lease(open.expired, slowest)));
            worker.take(question, worker::Held { sent: now, lease });
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
    fn set_alarm(&mut self, now: Moment, actions: &mut Vec<Action>) {
        let lease = self.leases.first().map(|(lease, ..)| *lease);
        let twice = self.first_twice(now);
        let released =
            self.workers.unsteady().filter_map(|(_, worker)| worker.silent_until()).filter(|until| *until > now);
        let next = twice.into_iter().chain(lease).chain(released).min().map(|at| at.max(Moment(now.0 + 1)));
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

/// Questions that share work with each other.
fn group_of(question: &Question) -> Group {
    match &question.ask {
        // All its sets go the same way: who has begun one frame goes on with the next.
        Ask::Tile(tile) | Ask::Frames(Frames { tile, .. }) => Group { frame: tile.lit.frame, set: tile.lit.set },
        Ask::Lights(lights) => Group { frame: lights.lit.frame, set: lights.lit.set },
        Ask::Rays(Rays { lit, .. }) | Ask::Points(Points { lit, .. }) => Group { frame: lit.frame, set: lit.set },
        // They share nothing; earlier samples come first.
        Ask::Reference(samples) => Group { frame: samples.first, set: 0 },
    }
}
