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

use std::collections::{BTreeMap, BTreeSet, VecDeque};

use super::{QuestionId, WorkerId};

/// Questions that need the same light set.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Group {
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
    groups: BTreeMap<Group, VecDeque<QuestionId>>,
    /// Who has begun which groups of recent frames.
    begun: BTreeMap<Group, BTreeSet<WorkerId>>,
    /// Who was the first to begin a set in the last frame that had it.
    home: BTreeMap<u16, WorkerId>,
}

/// A worker joins another's set only if this many tiles a worker would be left: making a set
/// costs about as much as a few tiles.
const SHARE_MIN: usize = 4;
/// Groups whose workers are remembered.
const BEGUN_MAX: usize = 4 * 256;

impl Waiting {
    pub(super) fn push_back(&mut self, group: Group, id: QuestionId) {
        self.groups.entry(group).or_default().push_back(id);
    }

    pub(super) fn push_front(&mut self, group: Group, id: QuestionId) {
        self.groups.entry(group).or_default().push_front(id);
    }

    /// Nothing waits.
    pub(super) fn is_empty(&self) -> bool {
        self.groups.is_empty()
    }

    pub(super) fn clear(&mut self) {
        self.groups.clear();
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
        while let Some(group) = self.choose(worker) {
            let queue = self.groups.get_mut(&group)?;
            let next = queue.pop_front();
            if queue.is_empty() {
                self.groups.remove(&group);
            }
            if let Some(id) = next.filter(|id| wanted(*id)) {
                return Some((id, self.begin(worker, group)));
            }
        }
        None
    }

    fn choose(&self, worker: WorkerId) -> Option<Group> {
        let first = self.groups.first_key_value()?.0.frame;
        let is_awaited = self.begun.first_key_value().is_none_or(|(group, _)| group.frame >= first);
        if is_awaited && let Some(group) = self.undivided(first, worker).or_else(|| self.shared(first)) {
            return Some(group);
        }
        self.frames()
            .find_map(|frame| self.undivided(frame, worker))
            .or_else(|| self.frames().find_map(|frame| self.shared(frame)))
            // Nothing but short tails of others' sets: better shared than idle.
            .or_else(|| {
                let tail = self.groups.iter().max_by_key(|(group, queue)| (queue.len(), std::cmp::Reverse(**group)));
                tail.map(|(group, _)| *group)
            })
    }

    /// Frames of which questions wait, oldest first.
    fn frames(&self) -> impl Iterator<Item = u32> {
        let after = |frame: u32| self.groups.range(Group { frame, set: 0 }..).next().map(|(group, _)| group.frame);
        std::iter::successors(after(0), move |frame| after(frame.checked_add(1)?))
    }

    fn groups_of(&self, frame: u32) -> impl Iterator<Item = (&Group, &VecDeque<QuestionId>)> {
        self.groups.range(Group { frame, set: 0 }..=Group { frame, set: u16::MAX })
    }

    fn holders(&self, group: &Group) -> usize {
        self.begun.get(group).map_or(0, BTreeSet::len)
    }

    /// A group of a frame that this worker has begun, or that nobody has.
    fn undivided(&self, frame: u32, worker: WorkerId) -> Option<Group> {
        let is_mine = |group: &Group| self.begun.get(group).is_some_and(|workers| workers.contains(&worker));
        if let Some((group, _)) = self.groups_of(frame).find(|(group, _)| is_mine(group)) {
            return Some(*group);
        }
        let homeliness = |group: &Group| match self.home.get(&group.set) {
            Some(home) if *home == worker => 0,
            None => 1,
            Some(_) => 2,
        };
        let fresh = self.groups_of(frame).filter(|(group, _)| self.holders(group) == 0);
        fresh.min_by_key(|(group, _)| (homeliness(group), group.set)).map(|(group, _)| *group)
    }

    /// The group of a frame that is best shared with those who have begun it, if enough of it waits.
    fn shared(&self, frame: u32) -> Option<Group> {
        let share = |(group, queue): &(&Group, &VecDeque<QuestionId>)| queue.len() / (self.holders(group) + 1);
        let worth_it = self.groups_of(frame).filter(|entry| share(entry) >= SHARE_MIN);
        worth_it.max_by_key(|entry| (share(entry), std::cmp::Reverse(*entry.0))).map(|(group, _)| *group)
    }

    fn begin(&mut self, worker: WorkerId, group: Group) -> Share {
        let of_frame = self.begun.range(Group { set: 0, ..group }..=Group { set: u16::MAX, ..group });
        let new_frame = !of_frame.into_iter().any(|(_, workers)| workers.contains(&worker));
        let workers = self.begun.entry(group).or_default();
        if workers.is_empty() {
            self.home.insert(group.set, worker);
        }
        let new_set = workers.insert(worker);
        while self.begun.len() > BEGUN_MAX {
            self.begun.pop_first();
        }
        Share { new_set, new_frame }
    }
}
