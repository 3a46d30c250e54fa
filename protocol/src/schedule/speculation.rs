//! Questions that may be asked of another worker as well, by age.
//!
//! They are those that somebody holds, that nobody died of, and that few workers hold that can be trusted to answer.
//! Workers that are connected and never say a word (stopped, swapped out, their way back cut) hold as many
//! questions as any; if they counted, some of them would keep a question from everybody else for the whole of their
//! leases.

use std::collections::{BTreeMap, BTreeSet};

use super::{Moment, QuestionId};

#[derive(Debug, Default)]
pub(super) struct Speculation {
    by_age: BTreeSet<(Moment, QuestionId)>,
    since: BTreeMap<QuestionId, Moment>,
}

impl Speculation {
    pub(super) fn put(&mut self, question: QuestionId, since: Moment) {
        let before = self.since.insert(question, since);
        if before != Some(since) {
            before.map(|before| self.by_age.remove(&(before, question)));
            self.by_age.insert((since, question));
        }
    }

    pub(super) fn remove(&mut self, question: QuestionId) {
        if let Some(since) = self.since.remove(&question) {
            self.by_age.remove(&(since, question));
        }
    }

    pub(super) fn clear(&mut self) {
        self.by_age.clear();
        self.since.clear();
    }

    /// Since when each is held, oldest first.
    pub(super) fn by_age(&self) -> impl Iterator<Item = (Moment, QuestionId)> {
        self.by_age.iter().copied()
    }
}
