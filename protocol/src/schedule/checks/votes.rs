//! What several workers have answered to the same question, and which of them are wrong.

use std::collections::{BTreeMap, BTreeSet};

use crate::question::Question;
use crate::schedule::WorkerId;

/// Somebody's answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::schedule) struct Vote {
    pub(in crate::schedule) worker: WorkerId,
    pub(in crate::schedule) digest: u64,
}

/// What is known of a question that is asked to compare.
#[derive(Debug)]
pub(in crate::schedule) struct Check {
    pub(super) votes: Vec<Vote>,
    /// The newcomer that has to answer it.
    pub(super) examinee: Option<WorkerId>,
}

/// What votes say.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum Verdict {
    Agreed,
    /// These have answered wrongly.
    Wrong(Vec<WorkerId>),
    Open,
}

impl Check {
    pub(super) fn votes_of(&self, worker: WorkerId) -> impl Iterator<Item = u64> {
        self.votes.iter().filter(move |vote| vote.worker == worker).map(|vote| vote.digest)
    }

    pub(super) fn workers(&self) -> BTreeSet<WorkerId> {
        self.votes.iter().map(|vote| vote.worker).collect()
    }

    pub(super) fn verdict(&self, is_trusted: impl Fn(WorkerId) -> bool) -> Verdict {
        let workers = self.workers();
        let contradicts_itself = |worker: &WorkerId| {
            let mut votes = self.votes_of(*worker);
            votes.next().is_some_and(|first| votes.any(|digest| digest != first))
        };
        let torn: Vec<_> = workers.iter().copied().filter(contradicts_itself).collect();
        if !torn.is_empty() {
            return Verdict::Wrong(torn);
        }
        let mut camps: BTreeMap<u64, BTreeSet<WorkerId>> = BTreeMap::new();
        for vote in &self.votes {
            camps.entry(vote.digest).or_default().insert(vote.worker);
        }
        if camps.len() <= 1 {
            return if self.votes.len() > 1 { Verdict::Agreed } else { Verdict::Open };
        }
        let trusted = self.votes.iter().find(|vote| is_trusted(vote.worker)).map(|vote| vote.digest);
        let most = camps.values().map(BTreeSet::len).max().unwrap_or(0);
        let mut greatest = camps.iter().filter(|(_, camp)| camp.len() == most && most > 1).map(|(digest, _)| *digest);
        let right = trusted.or_else(|| greatest.next().filter(|_| greatest.next().is_none()));
        let Some(right) = right else { return Verdict::Open };
        Verdict::Wrong(
            camps.iter().filter(|(digest, _)| **digest != right).flat_map(|(_, camp)| camp).copied().collect(),
        )
    }

    pub(super) fn is_disputed(&self) -> bool {
        self.votes.iter().any(|vote| vote.digest != self.votes[0].digest)
    }

    /// How it is known that a worker is wrong, for people.
    pub(super) fn evidence(&self, id: WorkerId, question: &Question) -> String {
        let wrong = self.votes_of(id).next();
        let ask = &question.ask;
        if self.votes_of(id).any(|digest| Some(digest) != wrong) {
            return format!("it computes wrongly: it has given two answers to {ask}");
        }
        let others = self.workers().into_iter().filter(|other| self.votes_of(*other).next() != wrong);
        match others.map(|other| other.0.to_string()).collect::<Vec<_>>().as_slice() {
            [one] => format!("it computes wrongly: worker {one} gives another answer to {ask}"),
            many => format!("it computes wrongly: workers {} give another answer to {ask}", many.join(", ")),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn verdict(votes: &[(u64, u64)], trusted: Option<u64>) -> Verdict {
        let votes = votes.iter().map(|(worker, digest)| Vote { worker: WorkerId(*worker), digest: *digest }).collect();
        Check { votes, examinee: None }.verdict(|worker| Some(worker.0) == trusted)
    }

    fn wrong(workers: &[u64]) -> Verdict {
        Verdict::Wrong(workers.iter().copied().map(WorkerId).collect())
    }

    #[test]
    fn who_is_alone_is_wrong_as_soon_as_two_agree() {
        assert_eq!(verdict(&[(1, 7)], None), Verdict::Open);
        assert_eq!(verdict(&[(1, 7), (2, 7)], None), Verdict::Agreed);
        assert_eq!(verdict(&[(1, 7), (2, 8)], None), Verdict::Open);
        assert_eq!(verdict(&[(1, 7), (2, 8), (3, 7)], None), wrong(&[2]));
        assert_eq!(verdict(&[(1, 7), (2, 8), (3, 9)], None), Verdict::Open);
        assert_eq!(verdict(&[(1, 7), (2, 8), (3, 9), (4, 9)], None), wrong(&[1, 2]));
        assert_eq!(verdict(&[(1, 7), (2, 7), (3, 9), (4, 9)], None), Verdict::Open);
    }

    #[test]
    fn who_contradicts_itself_is_wrong_and_repeating_it_is_no_second_witness() {
        assert_eq!(verdict(&[(1, 7), (1, 7)], None), Verdict::Agreed);
        assert_eq!(verdict(&[(1, 7), (1, 8)], None), wrong(&[1]));
        assert_eq!(verdict(&[(1, 7), (2, 8), (1, 8)], None), wrong(&[1]));
        assert_eq!(verdict(&[(1, 7), (2, 8), (1, 7)], None), Verdict::Open);
    }

    #[test]
    fn who_is_trusted_decides() {
        assert_eq!(verdict(&[(1, 7), (2, 8)], Some(2)), wrong(&[1]));
        assert_eq!(verdict(&[(1, 7), (3, 7), (2, 8)], Some(2)), wrong(&[1, 3]));
    }
}
