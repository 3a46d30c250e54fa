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
//! * *Relays.* Who hands on what others answer says how many threads are behind it, again whenever that changes, and is asked
//!   as a worker with so many. When there are none, or it is gone, its questions are asked of others, and none is blamed for it.
//! * *Edits.* What is open about the revision before is answered before the edit is made, if whoever asked wants that ([`past`]).
//! * *Checks.* Some answers are asked of a second worker and compared; who is found to compute wrongly is asked no more,
//!   and whoever draws hears of it ([`checks`]).
//!
//! It has no sockets and no clock: events and times come in, actions go out. Whoever carries out
//! the actions must hand what it sends to one worker over **in order**: changes of the world come
//! before questions about it.
//!
//! **What it leaves out**: what is in an answer, how worlds are sent, who may join.

mod assign;
mod checks;
mod crew;
mod event;
mod past;
mod speculation;
mod waiting;
mod window;
mod worker;

#[cfg(test)]
mod tests;

use std::collections::{BTreeMap, BTreeSet};

use crate::question::{Ask, Asked, Frames, Points, Question, Rays, Ticket, WorldState};
use assign::End;
pub use checks::Checking;
use checks::{Check, Checks, Vote};
use crew::Crew;
pub use event::{Action, Counters, Event, Moment, QuestionId, WorkerId};
use speculation::Speculation;
use waiting::{Group, Waiting};
use worker::Worker;
pub use worker::{WorkerState, WorkerStatus};

/// Most questions that may be open at a time.
pub const OPEN_MAX: usize = 1 << 16;
/// Most questions that a worker holds because it is far away: at 0.2 s there and back, small moving pictures are that many.
pub const HELD_MAX: usize = 1024;
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
    /// Questions about the past that nobody holds any more: to be given up.
    lost: Vec<QuestionId>,
    /// When leases run out.
    leases: BTreeSet<(Moment, WorkerId, QuestionId)>,
    /// Questions that may be asked of another as well.
    speculation: Speculation,
    /// When all that is open will be answered, as it was found out last.
    end: Option<End>,
    checks: Checks,
    next_id: u64,
    counters: Counters,
    wake_at: Option<Moment>,
}

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
    /// It was answered before, and is asked once more to compare.
    check: Option<Box<Check>>,
}

impl Open {
    fn new(question: Asked) -> Self {
        let nobody = BTreeSet::new();
        let (holders, asked, failed_at, refused_by) = (nobody.clone(), nobody.clone(), nobody.clone(), nobody);
        let (since, check) = (Moment(0), None);
        Self { question, holders, trusted: 0, asked, since, expired: 0, deaths: 0, failed_at, refused_by, check }
    }

    /// One more death, and it is given up.
    fn is_on_its_last(&self) -> bool {
        self.deaths + 1 >= DEATHS_MAX
    }
}

impl Schedule {
    /// Nobody is there yet, and so many answers will be checked.
    pub fn new(checking: Checking) -> Self {
        Self { checks: Checks::new(checking), ..Self::default() }
    }

    /// Takes an event in, gives actions out; they are to be carried out in order.
    pub fn handle(&mut self, event: Event, now: Moment) -> Vec<Action> {
        let mut actions = Vec::new();
        match event {
            Event::Joined { worker, threads, depth, trusted } => {
                self.welcome(worker, Worker::new(threads, depth, trusted), &mut actions);
            }
            Event::Ready { worker, state } => self.ready(worker, state, now),
            Event::Relays { worker, threads } => self.resize(worker, threads),
            Event::Retracted { worker, reason } => {
                self.expose(worker, reason, &mut actions);
                // It may have given it in an earlier connection.
                if let Some(Action::Expose { gave, .. }) = actions.last_mut() {
                    *gave = true;
                }
            }
            Event::Leaving { worker, started } => self.let_go(worker, &started),
            Event::Left { worker } => self.bury(worker, &mut actions),
            Event::World { state, edit } => self.turn_to(state, edit, &mut actions),
            Event::Edited { state } => self.go_on_to(state, now, &mut actions),
            Event::Asked(questions) => self.take(questions, &mut actions),
            Event::Answered { worker, id, micros, round_trip, digest } => {
                self.settle(Vote { worker, digest }, id, [micros, round_trip], now, &mut actions);
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
            Event::Cancelled(tickets) => self.cancel(&tickets, &mut actions),
            Event::CancelledAll => self.cancel_all(&mut actions),
            Event::FinishChecks => self.checks.finish(),
            Event::Woke => self.wake_at = None,
        }
        self.end_leases(now);
        self.give_up_lost(&mut actions);
        self.assign(now, &mut actions);
        self.end_checks(now, &mut actions);
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

    /// How many questions have not ended, of those that the front end asked.
    pub fn open_len(&self) -> usize {
        self.open.len() - self.checks.len()
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

    fn welcome(&mut self, id: WorkerId, mut worker: Worker, actions: &mut Vec<Action>) {
        worker.rests = self.called.as_ref().is_some_and(|called| !called.contains(&id));
        if self.has_world {
            worker.told = Some(self.state);
            actions.push(Action::Teach(id));
        }
        self.workers.insert(id, worker);
    }

    fn ready(&mut self, id: WorkerId, state: WorldState, now: Moment) {
        let current = self.state;
        let is_news = self.workers.change(id, |worker| {
            let was_ready = worker.ready;
            // What it is told after that comes before the questions: the same world will do.
            worker.ready |= worker.told == Some(current) && state.world == current.world;
            worker.ready && !was_ready
        });
        if is_news == Some(true) {
            self.examine(id, now);
        }
    }

    fn call(&mut self, called: Option<Vec<WorkerId>>) {
        self.workers.change_all(|id, worker| {
            worker.rests = called.as_ref().is_some_and(|called| !called.contains(&id));
        });
        self.called = called;
    }

    /// So many threads are behind a relay. What it holds when there is none, it has dropped.
    fn resize(&mut self, id: WorkerId, threads: u16) {
        let held = self.workers.change(id, |worker| {
            worker.relay(threads);
            if threads == 0 { worker.in_flight.keys().copied().collect() } else { Vec::new() }
        });
        held.into_iter().flatten().for_each(|question| self.take_back(id, question));
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
        // Only what it had begun can have killed it: the oldest, one a thread. Who said good-bye was not killed, and no question
        // kills who computes nothing.
        let suspects: Vec<_> = if worker.leaving || worker.relays { Vec::new() } else { worker.oldest() };
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
        self.forget_exam(id);
    }

    fn turn_to(&mut self, state: WorldState, edit: bool, actions: &mut Vec<Action>) {
        self.forget_checks();
        self.cancel_all(actions);
        let before = self.has_world.then_some(self.state);
        self.state = state;
        self.has_world = true;
        self.inform(before, edit, actions);
    }

    /// All workers hear of the current state: those who know the one before, of an edit.
    fn inform(&mut self, before: Option<WorldState>, edit: bool, actions: &mut Vec<Action>) {
        let state = self.state;
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
            } else if self.open.len() - self.checks.len() >= OPEN_MAX {
                "too many questions are open"
            } else {
                let id = QuestionId(self.next_id);
                self.next_id += 1;
                self.waiting.push_back(group_of(&asked), id);
                self.open.insert(id, Open::new(asked));
                continue;
            };
            self.counters.given_up += 1;
            actions.push(Action::GiveUp { asked, reason: reason.into() });
        }
    }

    fn settle(
        &mut self,
        vote: Vote,
        question: QuestionId,
        [micros, round_trip]: [u64; 2],
        now: Moment,
        actions: &mut Vec<Action>,
    ) {
        let id = vote.worker;
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
        if let Some(check) = open.check {
            return self.judge(question, open.question, *check, vote, actions);
        }
        self.counters.delivered += 1;
        if open.question.question.world == self.state {
            self.watch(question, &open.question, vote);
        }
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

    /// Questions with these tickets end here; what is being checked does not.
    fn cancel(&mut self, tickets: &BTreeSet<Ticket>, actions: &mut Vec<Action>) {
        let ends = |open: &Open| open.check.is_none() && tickets.contains(&open.question.ticket);
        let ids: Vec<_> = self.open.iter().filter(|(_, open)| ends(open)).map(|(id, _)| *id).collect();
        for id in ids {
            let Some(open) = self.open.remove(&id) else { continue };
            self.speculation.remove(id);
            self.suspects.remove(&id);
            for holder in open.holders {
                if self.drop_held(holder, id).is_some() {
                    actions.push(Action::Cancel { worker: holder, ids: vec![id] });
                }
            }
        }
    }

    /// What the front end asked ends here; what is being checked does not.
    fn cancel_all(&mut self, actions: &mut Vec<Action>) {
        let checks = &self.checks;
        self.workers.change_all(|worker, held| {
            let ids: Vec<_> = held.in_flight.keys().filter(|id| !checks.contains(**id)).copied().collect();
            held.in_flight.retain(|id, _| checks.contains(*id));
            held.alone_with = None;
            if !ids.is_empty() {
                actions.push(Action::Cancel { worker, ids });
            }
        });
        self.open.retain(|id, _| checks.contains(*id));
        self.leases.retain(|(.., id)| checks.contains(*id));
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
            (0, _) if open.check.is_some() => self.checks.wait(question),
            (0, _) if self.is_past(open) => self.lost.push(question),
            (0, 0) => self.waiting.push_front(group_of(&open.question), question),
            (0, _) => _ = self.suspects.insert(question),
            _ => {}
        }
        self.file(question);
    }

    /// Notes whether a question may be asked of another as well. To be called whenever its holders change, or what is
    /// thought of them.
    fn file(&mut self, question: QuestionId) {
        let state = self.state;
        let Some(open) = self.open.get_mut(&question) else { return self.speculation.remove(question) };
        let is_past = open.question.question.world != state;
        let is_trusted = |id: &&WorkerId| self.workers.get(id).is_some_and(Worker::is_proven);
        open.trusted = open.holders.iter().filter(is_trusted).count();
        // What somebody died of is not asked twice any more: one death at a time.
        if open.holders.is_empty() || open.deaths > 0 || open.trusted >= TRUSTED_MAX || open.check.is_some() || is_past
        {
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
        if open.check.is_some() {
            return self.checks.remove(question);
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
}

/// Questions that share work with each other.
fn group_of(asked: &Asked) -> Group {
    let group = |batch: u32, frame: u32, set| Group { frame: u64::from(batch) << 32 | u64::from(frame), set };
    let batch = asked.ticket.batch;
    match &asked.question.ask {
        // All its sets go the same way: who has begun one frame goes on with the next. Moving pictures that are under way have
        // the same frame, and batches of their own.
        Ask::Tile(tile) | Ask::Frames(Frames { tile, .. }) => group(batch, tile.lit.frame, tile.lit.set),
        Ask::Lights(lights) => group(batch, lights.lit.frame, lights.lit.set),
        Ask::Rays(Rays { lit, .. }) | Ask::Points(Points { lit, .. }) => group(0, lit.frame, lit.set),
        // They share nothing; earlier samples come first.
        Ask::Reference(samples) => group(batch, samples.first, 0),
    }
}
