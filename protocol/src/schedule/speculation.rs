//! Questions that may be asked of another worker as well, by age.
//!
//! They are those that somebody holds, that nobody died of, and that few workers hold that can be trusted to answer.
//! Workers that are connected and never say a word (stopped, swapped out, their way back cut) hold as many
//! questions as any; if they counted, some of them would keep a question from everybody else for the whole of their
//! leases.

use std::collections::{BTreeMap, BTreeSet};

use super::{Moment, QuestionId};

/// Questions that wait alike have a class of their own: who has proved itself waits for its usual time, times 2^class.
pub(super) const CLASSES: usize = super::TRUSTED_MAX;

#[derive(Debug, Default)]
pub(super) struct Speculation {
    by_age: [BTreeSet<(Moment, QuestionId)>; CLASSES],
    since: BTreeMap<QuestionId, (Moment, usize)>,
}

impl Speculation {
    pub(super) fn put(&mut self, question: QuestionId, since: Moment, class: usize) {
        let class = class.min(CLASSES - 1);
        let before = self.since.insert(question, (since, class));
        if before != Some((since, class)) {
            before.map(|(before, class)| self.by_age[class].remove(&(before, question)));
            self.by_age[class].insert((since, question));
        }
    }

    pub(super) fn remove(&mut self, question: QuestionId) {
        if let Some((since, class)) = self.since.remove(&question) {
            self.by_age[class].remove(&(since, question));
        }
    }

    pub(super) fn clear(&mut self) {
        self.by_age.iter_mut().for_each(BTreeSet::clear);
        self.since.clear();
    }

    /// Since when each of a class is held, oldest first.
    pub(super) fn by_age(&self, class: usize) -> impl Iterator<Item = (Moment, QuestionId)> {
        self.by_age[class].iter().copied()
    }

    /// Since when the oldest is held.
    pub(super) fn oldest(&self) -> Option<Moment> {
        self.by_age.iter().filter_map(|questions| questions.first()).map(|(since, _)| *since).min()
    }

    /// The first moment at which somebody of this patience, microseconds, that has proved itself may ask one of them, if it
    /// holds none itself.
    pub(super) fn first_due(&self, patience: u64) -> Option<Moment> {
        let oldest = |class: usize| self.by_age[class].first().map(|(since, _)| (class, *since));
        let due = |(class, since): (usize, Moment)| Moment(since.0.saturating_add(patience << class));
        (0..CLASSES).filter_map(oldest).map(due).min()
    }
}
