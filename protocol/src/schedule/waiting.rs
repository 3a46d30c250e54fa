//! Questions that nobody holds, sorted so that each worker meets few light sets.
//!
//! Making a light set costs a worker as much as many tiles. Who asks for work gets, in this order:
//! 1. a tile of a set it has begun in the oldest frame;
//! 2. a set of that frame that nobody has begun: preferably one it had in the frame before (it may
//!    still have it on its shelf), then one that no other had;
//! 3. the same from the next frame, and so on: no set is made twice as long as there are others to begin;
//! 4. a share in another's set, where enough tiles wait;
//! 5. a share in the set with the most tiles waiting, if there is nothing else.
//!
//! The first frame after a change is what somebody waits for: its sets are shared before later frames are begun.

use std::collections::{BTreeMap, BTreeSet, VecDeque};

use super::{QuestionId, WorkerId};

/// Questions that need the same light set.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Lot {
    pub(super) frame: u32,
    pub(super) set: u16,
}

/// What taking a question begins.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Share {
    pub(super) new_set: bool,
    pub(super) new_frame: bool,
}

#[derive(Debug, Default)]
pub(super) struct Waiting {
    lots: BTreeMap<Lot, VecDeque<QuestionId>>,
    /// Who has begun which lots of recent frames.
    begun: BTreeMap<Lot, BTreeSet<WorkerId>>,
    /// Who was the first to begin a set in the last frame that had it.
    home: BTreeMap<u16, WorkerId>,
}

/// A worker joins another's set only if this many tiles a worker would be left: making a set
/// costs about as much as a few tiles.
const SHARE_MIN: usize = 4;
/// Lots whose workers are remembered.
const BEGUN_MAX: usize = 4 * 256;

impl Waiting {
    pub(super) fn push_back(&mut self, lot: Lot, id: QuestionId) {
        self.lots.entry(lot).or_default().push_back(id);
    }

    pub(super) fn push_front(&mut self, lot: Lot, id: QuestionId) {
        self.lots.entry(lot).or_default().push_front(id);
    }

    /// Nothing waits.
    pub(super) fn is_empty(&self) -> bool {
        self.lots.is_empty()
    }

    pub(super) fn clear(&mut self) {
        self.lots.clear();
        self.begun.clear();
    }

    pub(super) fn forget_worker(&mut self, worker: WorkerId) {
        for workers in self.begun.values_mut() {
            workers.remove(&worker);
        }
        self.home.retain(|_, home| *home != worker);
    }

    /// The best question for a worker; those that are not `wanted` any more are thrown away.
    pub(super) fn pop_for(
        &mut self,
        worker: WorkerId,
        wanted: impl Fn(QuestionId) -> bool,
    ) -> Option<(QuestionId, Share)> {
        while let Some(lot) = self.choose(worker) {
            let queue = self.lots.get_mut(&lot)?;
            let next = queue.pop_front();
            if queue.is_empty() {
                self.lots.remove(&lot);
            }
            if let Some(id) = next.filter(|id| wanted(*id)) {
                return Some((id, self.begin(worker, lot)));
            }
        }
        None
    }

    fn choose(&self, worker: WorkerId) -> Option<Lot> {
        let first = self.lots.first_key_value()?.0.frame;
        let is_awaited = self.begun.first_key_value().is_none_or(|(lot, _)| lot.frame >= first);
        if is_awaited && let Some(lot) = self.undivided(first, worker).or_else(|| self.shared(first)) {
            return Some(lot);
        }
        self.frames()
            .find_map(|frame| self.undivided(frame, worker))
            .or_else(|| self.frames().find_map(|frame| self.shared(frame)))
            // Nothing but short tails of others' sets: better shared than idle.
            .or_else(|| {
                let tail = self.lots.iter().max_by_key(|(lot, queue)| (queue.len(), std::cmp::Reverse(**lot)));
                tail.map(|(lot, _)| *lot)
            })
    }

    /// Frames of which questions wait, oldest first.
    fn frames(&self) -> impl Iterator<Item = u32> {
        let after = |frame: u32| self.lots.range(Lot { frame, set: 0 }..).next().map(|(lot, _)| lot.frame);
        std::iter::successors(after(0), move |frame| after(frame.checked_add(1)?))
    }

    fn lots_of(&self, frame: u32) -> impl Iterator<Item = (&Lot, &VecDeque<QuestionId>)> {
        self.lots.range(Lot { frame, set: 0 }..=Lot { frame, set: u16::MAX })
    }

    fn holders(&self, lot: &Lot) -> usize {
        self.begun.get(lot).map_or(0, BTreeSet::len)
    }

    /// A lot of a frame that this worker has begun, or that nobody has.
    fn undivided(&self, frame: u32, worker: WorkerId) -> Option<Lot> {
        let is_mine = |lot: &Lot| self.begun.get(lot).is_some_and(|workers| workers.contains(&worker));
        if let Some((lot, _)) = self.lots_of(frame).find(|(lot, _)| is_mine(lot)) {
            return Some(*lot);
        }
        let homeliness = |lot: &Lot| match self.home.get(&lot.set) {
            Some(home) if *home == worker => 0,
            None => 1,
            Some(_) => 2,
        };
        let fresh = self.lots_of(frame).filter(|(lot, _)| self.holders(lot) == 0);
        fresh.min_by_key(|(lot, _)| (homeliness(lot), lot.set)).map(|(lot, _)| *lot)
    }

    /// The lot of a frame that is best shared with those who have begun it, if enough of it waits.
    fn shared(&self, frame: u32) -> Option<Lot> {
        let share = |(lot, queue): &(&Lot, &VecDeque<QuestionId>)| queue.len() / (self.holders(lot) + 1);
        let worth_it = self.lots_of(frame).filter(|entry| share(entry) >= SHARE_MIN);
        worth_it.max_by_key(|entry| (share(entry), std::cmp::Reverse(*entry.0))).map(|(lot, _)| *lot)
    }

    fn begin(&mut self, worker: WorkerId, lot: Lot) -> Share {
        let of_frame = self.begun.range(Lot { set: 0, ..lot }..=Lot { set: u16::MAX, ..lot });
        let new_frame = !of_frame.into_iter().any(|(_, workers)| workers.contains(&worker));
        let workers = self.begun.entry(lot).or_default();
        if workers.is_empty() {
            self.home.insert(lot.set, worker);
        }
        let new_set = workers.insert(worker);
        while self.begun.len() > BEGUN_MAX {
            self.begun.pop_first();
        }
        Share { new_set, new_frame }
    }
}
