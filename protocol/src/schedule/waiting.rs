//! Questions that nobody holds, sorted so that each worker meets few light sets.
//!
//! Making a light set costs a worker as much as many tiles. Who asks for work gets, in this order:
//! 1. a tile of a set it has begun in the oldest frame;
//! 2. a set of that frame that nobody has begun: preferably one it had in the frame before (it may
//!    still have it in its cache), then one that no other had;
//! 3. the same from the next frame, and so on: no set is made twice as long as there are others to begin;
//! 4. a share in another's set, where enough tiles wait;
//! 5. a share in the set with the most tiles waiting, if there is nothing else.
//!
//! The first frame after a change is what somebody waits for: its sets are shared before later frames are begun.

use std::cmp::Reverse;
use std::collections::{BTreeMap, BTreeSet, VecDeque};

use super::{QuestionId, WorkerId};

/// Questions that need the same light set.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Group {
    /// Frames are awaited in this order: earlier batches of whoever asks first, then by their numbers.
    pub(super) frame: u64,
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
    groups: BTreeMap<Group, VecDeque<QuestionId>>,
    /// Who has begun which groups of recent frames.
    begun: BTreeMap<Group, BTreeSet<WorkerId>>,
    /// Who was the first to begin a set in the last frame that had it.
    home: BTreeMap<u16, WorkerId>,
    /// Groups of which questions wait: those that nobody has begun, …
    fresh: BTreeSet<Group>,
    /// … by who has begun them, …
    mine: BTreeSet<(WorkerId, Group)>,
    /// … by how many questions wait, …
    longest: BTreeSet<(Reverse<usize>, Group)>,
    /// … and those that are worth sharing, by frame and by what each would have.
    shares: BTreeSet<(u64, Reverse<usize>, u16)>,
}

/// A worker joins another's set only if this many tiles a worker would be left: making a set
/// costs about as much as a few tiles.
const SHARE_MIN: usize = 4;
/// Groups whose workers are remembered.
const BEGUN_MAX: usize = 4 * 256;

impl Waiting {
    pub(super) fn push_back(&mut self, group: Group, id: QuestionId) {
        self.change(group, |queue| queue.push_back(id));
    }

    pub(super) fn push_front(&mut self, group: Group, id: QuestionId) {
        self.change(group, |queue| queue.push_front(id));
    }

    /// A worker has begun a group not long ago.
    pub(super) fn has_begun(&self, group: Group, worker: WorkerId) -> bool {
        self.begun.get(&group).is_some_and(|workers| workers.contains(&worker))
    }

    /// Nothing waits.
    pub(super) fn is_empty(&self) -> bool {
        self.groups.is_empty()
    }

    pub(super) fn clear(&mut self) {
        let home = std::mem::take(&mut self.home);
        *self = Self { home, ..Self::default() };
    }

    pub(super) fn forget_worker(&mut self, worker: WorkerId) {
        let groups: Vec<Group> =
            self.begun.iter().filter(|(_, workers)| workers.contains(&worker)).map(|(group, _)| *group).collect();
        for group in groups {
            self.unfile(group);
            self.mine.remove(&(worker, group));
            if let Some(workers) = self.begun.get_mut(&group) {
                workers.remove(&worker);
            }
            self.file(group);
        }
        self.home.retain(|_, home| *home != worker);
    }

    /// The best question for a worker; those that are not `wanted` any more are thrown away.
    pub(super) fn pop_for(
        &mut self,
        worker: WorkerId,
        wanted: impl Fn(QuestionId) -> bool,
    ) -> Option<(QuestionId, Share)> {
        while let Some(group) = self.choose(worker) {
            let next = self.change(group, VecDeque::pop_front);
            if let Some(id) = next.filter(|id| wanted(*id)) {
                return Some((id, self.begin(worker, group)));
            }
        }
        None
    }

    /// Changes what waits of a group.
    fn change<T>(&mut self, group: Group, change: impl FnOnce(&mut VecDeque<QuestionId>) -> T) -> T {
        self.unfile(group);
        let queue = self.groups.entry(group).or_default();
        let (was_empty, outcome) = (queue.is_empty(), change(queue));
        let is_empty = queue.is_empty();
        if is_empty {
            self.groups.remove(&group);
        }
        if was_empty != is_empty {
            for worker in self.begun.get(&group).into_iter().flatten() {
                if is_empty {
                    self.mine.remove(&(*worker, group));
                } else {
                    self.mine.insert((*worker, group));
                }
            }
        }
        self.file(group);
        outcome
    }

    /// Takes a group out of the indices, but for that of those who have begun it.
    fn unfile(&mut self, group: Group) {
        if let Some(length) = self.groups.get(&group).map(VecDeque::len) {
            self.longest.remove(&(Reverse(length), group));
            self.shares.remove(&(group.frame, Reverse(self.share_of(group, length)), group.set));
            self.fresh.remove(&group);
        }
    }

    fn file(&mut self, group: Group) {
        let Some(length) = self.groups.get(&group).map(VecDeque::len) else { return };
        self.longest.insert((Reverse(length), group));
        let share = self.share_of(group, length);
        if share >= SHARE_MIN {
            self.shares.insert((group.frame, Reverse(share), group.set));
        }
        if self.holders(&group) == 0 {
            self.fresh.insert(group);
        }
    }

    /// Questions that each would have if one more worker began it.
    fn share_of(&self, group: Group, length: usize) -> usize {
        length / (self.holders(&group) + 1)
    }

    fn choose(&self, worker: WorkerId) -> Option<Group> {
        let first = self.groups.first_key_value()?.0.frame;
        let is_awaited = self.begun.first_key_value().is_none_or(|(group, _)| group.frame >= first);
        let undivided = self.undivided(worker);
        if let Some(group) = undivided.filter(|group| group.frame == first) {
            return Some(group);
        }
        let shared_first =
            || self.shares.range((first, Reverse(usize::MAX), 0)..).next().filter(|(frame, ..)| *frame == first);
        let group = |(frame, _, set): &(u64, Reverse<usize>, u16)| Group { frame: *frame, set: *set };
        if is_awaited && let Some(shared) = shared_first() {
            return Some(group(shared));
        }
        undivided
            .or_else(|| self.shares.first().map(group))
            // Nothing but short tails of others' sets: better shared than idle.
            .or_else(|| self.longest.first().map(|(_, group)| *group))
    }

    fn holders(&self, group: &Group) -> usize {
        self.begun.get(group).map_or(0, BTreeSet::len)
    }

    /// A group of the oldest frame that has one which this worker has begun, or nobody has.
    fn undivided(&self, worker: WorkerId) -> Option<Group> {
        let from = (worker, Group { frame: 0, set: 0 });
        let mine = self.mine.range(from..).next().filter(|(whose, _)| *whose == worker).map(|(_, group)| *group);
        let frame = self.fresh.first().map(|group| group.frame);
        match (mine, frame) {
            (Some(mine), Some(frame)) if mine.frame > frame => self.unbegun(frame, worker),
            (Some(mine), _) => Some(mine),
            (None, Some(frame)) => self.unbegun(frame, worker),
            (None, None) => None,
        }
    }

    /// A group of a frame that nobody has begun, the one that a worker is most at home in.
    fn unbegun(&self, frame: u64, worker: WorkerId) -> Option<Group> {
        let homeliness = |group: &Group| match self.home.get(&group.set) {
            Some(home) if *home == worker => 0,
            None => 1,
            Some(_) => 2,
        };
        let fresh = self.fresh.range(Group { frame, set: 0 }..=Group { frame, set: u16::MAX });
        fresh.min_by_key(|group| (homeliness(group), group.set)).copied()
    }

    fn begin(&mut self, worker: WorkerId, group: Group) -> Share {
        let is_new = !self.begun.get(&group).is_some_and(|workers| workers.contains(&worker));
        if !is_new {
            return Share { new_set: false, new_frame: false };
        }
        let of_frame = self.begun.range(Group { set: 0, ..group }..=Group { set: u16::MAX, ..group });
        let new_frame = !of_frame.into_iter().any(|(_, workers)| workers.contains(&worker));
        self.unfile(group);
        let workers = self.begun.entry(group).or_default();
        if workers.is_empty() {
            self.home.insert(group.set, worker);
        }
        workers.insert(worker);
        if self.groups.contains_key(&group) {
            self.mine.insert((worker, group));
        }
        self.file(group);
        while self.begun.len() > BEGUN_MAX
            && let Some((oldest, _)) = self.begun.first_key_value()
        {
            let oldest = *oldest;
            self.unfile(oldest);
            for worker in self.begun.remove(&oldest).into_iter().flatten() {
                self.mine.remove(&(worker, oldest));
            }
            self.file(oldest);
        }
        Share { new_set: true, new_frame }
    }
}
