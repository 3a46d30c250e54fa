//! Whether workers compute right: some of what one has answered is asked of another as well, and compared.
//!
//! Answers are pure functions of their questions: two of them are the same bits, or one is wrong.
//!
//! * *Newcomers.* Who becomes ready while others answer has to answer [`EXAM`] questions first that others have answered,
//!   and nothing else before, for [`EXAM_MAX`] at most. So a worker of another build does no harm.
//! * *First answers*: the first [`FIRST`] of each worker are checked.
//! * *A share* of all others, chosen by numbers that no worker can foresee.
//! * *Who is wrong*: who contradicts itself; who contradicts a trusted one; who is outvoted. As long as that is open, one more
//!   worker is asked, and if there is no other, those who disagree are asked once more: a bit that has flipped by chance
//!   does not flip again. Where nobody can decide, that is said, and what is open waits for somebody who can.
//! * *What follows*: who is exposed is asked no more as long as it is there, and whoever draws is told whether anything
//!   of it was delivered.
//!
//! **Bound.** Who gives a wrong answer in n, where a share s is checked, is exposed after n / s answers on average, and
//! after m of them by all but a chance of (1 − s / n)^m; beside others in half of that, as it is also asked to check
//! them. An answer is delivered before it is checked: checks cost work, never
//! time.
//!
//! **What it leaves out**: workers that conspire, and those that are wrong alike and the majority.

#[cfg(test)]
mod tests;
mod votes;

use std::collections::{BTreeSet, VecDeque};

use super::waiting::Group;
use super::worker::{Exam, Worker};
use super::{Action, Moment, Open, QuestionId, Schedule, WorkerId, group_of};
use crate::question::Asked;
use votes::Verdict;
pub(in crate::schedule) use votes::{Check, Vote};

/// How much is checked.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Checking {
    /// Share of answers that are checked, 0..=1; at 0 nobody is examined either.
    pub share: f64,
    /// Which these are follows from it; workers must not know it.
    pub salt: u64,
}

/// Questions that a newcomer has to answer first, if their answers are known.
pub(in crate::schedule) const EXAM: usize = 2;
/// So long is waited for it, microseconds.
const EXAM_MAX: u64 = 10_000_000;
/// A worker's answers that are checked in any case.
const FIRST: u64 = 4;
/// Most answers that are being checked at a time.
const CHECKS_MAX: usize = 256;
/// Known answers that are kept for newcomers.
const RECENT_MAX: usize = 8;
/// Most sets of workers between whom nobody can decide that are said.
const SAID_MAX: usize = 64;

/// Who is asked next.
#[derive(Debug, PartialEq, Eq)]
enum Next {
    Worker(WorkerId),
    /// Somebody who has no room now.
    Later,
    Nobody,
}

/// What is being checked.
#[derive(Debug, Default)]
pub(in crate::schedule) struct Checks {
    settings: Checking,
    /// All questions that are asked to compare.
    all: BTreeSet<QuestionId>,
    /// Those that nobody holds.
    waiting: BTreeSet<QuestionId>,
    /// The latest answers about this world.
    recent: VecDeque<(Asked, Vote)>,
    /// When exams end.
    exams: BTreeSet<(Moment, WorkerId)>,
    /// Workers between whom nobody could decide, as far as that was said.
    said: BTreeSet<BTreeSet<WorkerId>>,
    /// Somebody waits until nothing is being checked.
    is_awaited: bool,
}

impl Checks {
    pub(in crate::schedule) fn new(settings: Checking) -> Self {
        Self { settings, ..Self::default() }
    }

    pub(in crate::schedule) fn len(&self) -> usize {
        self.all.len()
    }

    pub(in crate::schedule) fn contains(&self, question: QuestionId) -> bool {
        self.all.contains(&question)
    }

    /// Nobody holds it any more.
    pub(in crate::schedule) fn wait(&mut self, question: QuestionId) {
        self.waiting.insert(question);
    }

    /// It ends without a verdict, or with one.
    pub(in crate::schedule) fn remove(&mut self, question: QuestionId) {
        self.all.remove(&question);
        self.waiting.remove(&question);
    }

    /// Somebody waits until nothing is being checked.
    pub(in crate::schedule) fn finish(&mut self) {
        self.is_awaited = true;
    }

    /// When the first exam ends.
    pub(in crate::schedule) fn exam_ends(&self) -> Option<Moment> {
        self.exams.first().map(|(until, _)| *until)
    }

    fn is_on(&self) -> bool {
        self.settings.share > 0.0
    }

    /// Whether an answer to this question is one of the share.
    fn is_chosen(&self, question: QuestionId) -> bool {
        let draw = mix(self.settings.salt ^ mix(question.0)) >> 11;
        // 53 bits are a number of 0..1.
        (draw as f64) < self.settings.share * (1_u64 << 53) as f64
    }

    fn remember(&mut self, asked: &Asked, vote: Vote) {
        // One of each worker is enough, as long as there are others.
        self.recent.retain(|(_, earlier)| earlier.worker != vote.worker);
        self.recent.truncate(RECENT_MAX - 1);
        self.recent.push_front((asked.clone(), vote));
    }
}

impl Schedule {
    /// An answer that is being delivered: it may have to be checked.
    pub(in crate::schedule) fn watch(&mut self, number: QuestionId, asked: &Asked, vote: Vote) {
        let watched = self.workers.change(vote.worker, |worker| {
            worker.delivered += 1;
            (worker.trusted, worker.watched < FIRST)
        });
        let Some((is_trusted, is_new)) = watched.filter(|_| self.checks.is_on()) else { return };
        self.checks.remember(asked, vote);
        let is_due = !is_trusted && (is_new || self.checks.is_chosen(number));
        if is_due && self.checks.len() < CHECKS_MAX {
            self.workers.change(vote.worker, |worker| worker.watched += 1);
            self.ask_to_compare(asked.clone(), Check { votes: vec![vote], examinee: None });
        }
    }

    /// A worker has become ready: if others have answered, it shows first that it gives the same answers.
    pub(in crate::schedule) fn examine(&mut self, id: WorkerId, now: Moment) {
        let Some(worker) = self.workers.get(&id) else { return };
        let is_known = worker.trusted || worker.confirmed > 0 || worker.exposed.is_some() || worker.exam.is_some();
        if is_known || !self.checks.is_on() {
            return;
        }
        let known: Vec<_> =
            self.checks.recent.iter().filter(|(_, vote)| vote.worker != id).take(EXAM).cloned().collect();
        if known.is_empty() {
            return;
        }
        let exam = Exam { left: known.len(), until: Moment(now.0.saturating_add(EXAM_MAX)) };
        self.workers.change(id, |worker| worker.exam = Some(exam));
        self.checks.exams.insert((exam.until, id));
        for (asked, vote) in known {
            self.ask_to_compare(asked, Check { votes: vec![vote], examinee: Some(id) });
        }
    }

    /// Asks a question that was answered once more.
    fn ask_to_compare(&mut self, asked: Asked, check: Check) {
        let id = QuestionId(self.next_id);
        self.next_id += 1;
        self.open.insert(id, Open { check: Some(Box::new(check)), ..Open::new(asked) });
        self.checks.all.insert(id);
        self.checks.wait(id);
    }

    /// One more answer to a question that is asked to compare, which is not open any more.
    pub(in crate::schedule) fn judge(
        &mut self,
        number: QuestionId,
        asked: Asked,
        mut check: Check,
        vote: Vote,
        actions: &mut Vec<Action>,
    ) {
        self.checks.remove(number);
        self.counters.checked += 1;
        check.votes.push(vote);
        let is_trusted = |id: WorkerId| self.workers.get(&id).is_some_and(|worker| worker.trusted);
        match check.verdict(is_trusted) {
            Verdict::Open => return self.ask_to_compare(asked, check),
            Verdict::Agreed => {
                let workers = check.workers();
                // To say the same twice is no proof.
                for id in workers.iter().filter(|_| workers.len() > 1) {
                    self.workers.change(*id, |worker| worker.confirmed += 1);
                }
            }
            Verdict::Wrong(wrong) => {
                for id in wrong {
                    let reason = check.evidence(id, &asked.question);
                    self.expose(id, reason, actions);
                }
            }
        }
        if let Some(examinee) = check.examinee {
            let left = self.workers.change(examinee, |worker| {
                worker.exam.as_mut().map(|exam| {
                    exam.left = exam.left.saturating_sub(1);
                    exam.left
                })
            });
            if left.flatten() == Some(0) {
                self.forget_exam(examinee);
            }
        }
    }

    /// A worker computes wrongly: it is asked no more, and what it has said of others does not count.
    pub(in crate::schedule) fn expose(&mut self, id: WorkerId, reason: String, actions: &mut Vec<Action>) {
        self.counters.exposed += 1;
        self.forget_exam(id);
        let here = self.workers.change(id, |worker| {
            worker.exposed = Some(reason.clone());
            (worker.delivered > 0, worker.in_flight.keys().copied().collect::<Vec<_>>())
        });
        // What somebody gave that has gone is not counted any more.
        let (gave, held) = here.unwrap_or((true, Vec::new()));
        held.iter().for_each(|question| self.take_back(id, *question));
        if !held.is_empty() {
            actions.push(Action::Cancel { worker: id, ids: held });
        }
        // What it has begun is nobody's.
        self.waiting.forget_worker(id);
        self.checks.recent.retain(|(_, vote)| vote.worker != id);
        let mut void = Vec::new();
        for (number, open) in &mut self.open {
            open.asked.remove(&id);
            if let Some(check) = &mut open.check {
                check.votes.retain(|vote| vote.worker != id);
                if check.votes.is_empty() {
                    void.push(*number);
                }
            }
        }
        void.into_iter().for_each(|number| self.drop_check(number, actions));
        actions.push(Action::Expose { worker: id, reason, gave });
    }

    /// Nothing is learnt by it any more.
    fn drop_check(&mut self, number: QuestionId, actions: &mut Vec<Action>) {
        self.checks.remove(number);
        let Some(open) = self.open.remove(&number) else { return };
        for holder in open.holders {
            if self.drop_held(holder, number).is_some() {
                actions.push(Action::Cancel { worker: holder, ids: vec![number] });
            }
        }
        if let Some(examinee) = open.check.and_then(|check| check.examinee) {
            self.forget_exam(examinee);
        }
    }

    /// A worker is examined no more: it has gone, passed, or had its time. What it has answered is still compared.
    pub(in crate::schedule) fn forget_exam(&mut self, id: WorkerId) {
        if let Some(exam) = self.workers.change(id, |worker| worker.exam.take()).flatten() {
            self.checks.exams.remove(&(exam.until, id));
        }
        self.checks.exams.retain(|(_, examinee)| *examinee != id);
        let mut unanswered = Vec::new();
        for number in &self.checks.all {
            let Some(check) = self.open.get_mut(number).and_then(|open| open.check.as_mut()) else { continue };
            if check.examinee.take_if(|examinee| *examinee == id).is_some() && check.votes_of(id).next().is_none() {
                unanswered.push(*number);
            }
        }
        for number in unanswered {
            self.checks.remove(number);
            for holder in self.open.remove(&number).into_iter().flat_map(|open| open.holders) {
                self.drop_held(holder, number);
            }
        }
    }

    /// The world is another: nobody can answer about this one any more.
    pub(in crate::schedule) fn forget_checks(&mut self) {
        self.checks.all.clear();
        self.checks.waiting.clear();
        self.checks.recent.clear();
        self.checks.exams.clear();
        self.workers.change_all(|_, worker| worker.exam = None);
    }

    /// Questions that are asked to compare, to whoever may answer them and has room, but for one that has something else
    /// to do.
    pub(in crate::schedule) fn assign_checks(&mut self, but: Option<WorkerId>, now: Moment, actions: &mut Vec<Action>) {
        self.end_exams(now);
        if self.checks.exams.is_empty() && !self.workers.has_room(now) {
            return;
        }
        for question in self.checks.waiting.iter().copied().collect::<Vec<_>>() {
            match self.next_to_compare(question, now) {
                Next::Worker(id) if Some(id) == but => {}
                Next::Worker(id) => {
                    self.checks.waiting.remove(&question);
                    self.send(id, question, now, actions);
                }
                Next::Later => {}
                Next::Nobody => self.leave_undecided(question, actions),
            }
        }
    }

    /// Exams that take too long; and all, if nobody else could answer what is asked.
    fn end_exams(&mut self, now: Moment) {
        while let Some((until, id)) = self.checks.exams.first().copied()
            && (until <= now || !self.workers.iter().any(|(_, worker)| worker.is_willing(now)))
        {
            self.checks.exams.remove(&(until, id));
            self.forget_exam(id);
        }
    }

    fn next_to_compare(&self, question: QuestionId, now: Moment) -> Next {
        let Some(open) = self.open.get(&question) else { return Next::Nobody };
        let Some(check) = &open.check else { return Next::Nobody };
        if let Some(examinee) = check.examinee.filter(|examinee| check.votes_of(*examinee).next().is_none()) {
            let worker = self.workers.get(&examinee).filter(|_| !open.failed_at.contains(&examinee));
            return match worker {
                None => Next::Nobody,
                Some(worker) if worker.may_be_examined(now) && worker.in_flight.len() < EXAM => Next::Worker(examinee),
                Some(_) => Next::Later,
            };
        }
        let group = group_of(&open.question);
        let is_fit = |(id, _): &(&WorkerId, &Worker)| !open.failed_at.contains(id);
        // Newcomers have a say where others disagree: it may be the only one who is none that is wrong.
        let has_say = check.is_disputed();
        let may = |worker: &Worker| worker.is_willing(now) || (has_say && worker.may_be_examined(now));
        let willing = || self.workers.iter().filter(|(_, worker)| may(worker)).filter(is_fit);
        let others = willing().filter(|(id, _)| check.votes_of(**id).next().is_none());
        match self.best_of(others, group, now) {
            // Nobody else: one more word of those who have said one.
            Next::Nobody => self.best_of(willing().filter(|(id, _)| check.votes_of(**id).count() == 1), group, now),
            next => next,
        }
    }

    /// Of those who may be asked, who has room, and does it most cheaply: it has the light, or little else to do.
    fn best_of<'a>(
        &self,
        candidates: impl Iterator<Item = (&'a WorkerId, &'a Worker)>,
        group: Group,
        now: Moment,
    ) -> Next {
        let mut best = None;
        let mut is_any = false;
        for (id, worker) in candidates {
            is_any = true;
            let is_new = worker.exam.is_some();
            let has_room = if is_new { worker.in_flight.len() <= EXAM } else { worker.room(now) > 0 };
            if !has_room {
                continue;
            }
            let has_light = self.waiting.has_begun(group, *id);
            let rank = (!worker.trusted, is_new, !has_light, worker.doubt(), worker.in_flight.len(), *id);
            best = best.into_iter().chain([rank]).min();
        }
        match best {
            Some((.., id)) => Next::Worker(id),
            None if is_any => Next::Later,
            None => Next::Nobody,
        }
    }

    /// Nobody can answer it who has not. Where answers differ, that is said, and whoever comes next may decide.
    fn leave_undecided(&mut self, question: QuestionId, actions: &mut Vec<Action>) {
        let Some(open) = self.open.get(&question) else { return };
        let Some(check) = &open.check else { return };
        if !check.is_disputed() {
            if check.examinee.is_none() {
                self.drop_check(question, actions);
            }
            return;
        }
        let workers = check.workers();
        if self.checks.said.len() < SAID_MAX && self.checks.said.insert(workers.clone()) {
            let ask = open.question.question.ask.to_string();
            actions.push(Action::Undecided { workers: workers.into_iter().collect(), ask });
        }
    }

    /// Says when nothing is being checked any more that could be decided now, if somebody waits for that.
    pub(in crate::schedule) fn end_checks(&mut self, now: Moment, actions: &mut Vec<Action>) {
        let checks = &self.checks;
        if !checks.is_awaited || checks.len() > checks.waiting.len() {
            return;
        }
        if checks.waiting.iter().all(|question| self.next_to_compare(*question, now) == Next::Nobody) {
            self.checks.is_awaited = false;
            actions.push(Action::ChecksFinished);
        }
    }
}

/// The finaliser of SplitMix64 (Steele et al., *Fast Splittable Pseudorandom Number Generators*, 2014).
fn mix(x: u64) -> u64 {
    let x = x.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ (x >> 31)
}
