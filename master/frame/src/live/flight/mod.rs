//! Several moving pictures under way, where workers are far away.
//!
//! Workers draw one picture after the other, and the way there and back passes meanwhile: so pictures begin as far apart as
//! they take to draw, and as many are under way as fill the time of one. More would only wait in line, and be late. Without a
//! way worth speaking of it is one, which begins when the one before has ended.
//!
//! Each has its own camera, and its own revision of the scene: workers answer what was asked before an edit, then edit.

use std::collections::BTreeSet;
use std::sync::Arc;

use protocol::question::Ticket;

use super::{Action, Live, Making, Moment, Step, Take, View};

#[cfg(test)]
mod tests;

/// A way shorter than this share of a picture's drawing is not worth another picture.
const WAY_MIN: u64 = 8;
/// No pictures are begun closer together than this, microseconds: no screen shows more.
const APART_MIN: u64 = 8_000;

impl Live {
    /// Time between the beginnings of two pictures, microseconds.
    fn apart(&self) -> u64 {
        self.pace.drawing().max(APART_MIN)
    }

    /// Moving pictures that should be under way at a time.
    fn depth(&self) -> usize {
        let apart = self.apart();
        let behind = self.round_trip.saturating_sub(apart / WAY_MIN).div_ceil(apart);
        usize::try_from(behind).unwrap_or(usize::MAX).saturating_add(1).min(self.front.flight_max())
    }

    /// When one more picture begins behind those under way, if it may.
    pub(super) fn flies_at(&self) -> Option<Moment> {
        let is_free = self.knobs.making == Making::InTime && self.under_way() < self.depth();
        let due = Moment(self.last_began.0 + self.apart());
        (is_free && self.may_begin_behind()).then_some(due)
    }

    /// A moving picture is under way that waits for answers.
    pub(super) fn is_waiting(&self) -> bool {
        self.take.as_ref().is_some_and(|take| take.moving.is_some() && !take.at_once)
    }

    /// There is news while one is under way.
    fn may_begin_behind(&self) -> bool {
        self.is_waiting() && self.news.is_some() && !self.publishing
    }

    pub(super) fn begin_behind_if_due(&mut self, now: Moment, actions: &mut Vec<Action>) {
        if self.flies_at().is_some_and(|due| due <= now) {
            self.begin_behind(now, actions);
        }
    }

    /// Begins with the newest state while earlier ones are being drawn.
    pub(super) fn begin_behind(&mut self, now: Moment, actions: &mut Vec<Action>) {
        if !self.may_begin_behind() || self.under_way() >= self.front.flight_max() {
            return;
        }
        if !self.changes.is_empty() {
            return self.publish(true, actions);
        }
        let Some((world, fields, Some(scene))) = &self.world else { return };
        let (world, fields, scene) = (*world, *fields, Arc::clone(scene));
        let view = View { world, scene, fields, camera: self.camera, seed: self.knobs.seed };
        self.front.look(&view, &std::mem::take(&mut self.published));
        let since = self.news.take();
        let take = self.begin_take(&view, Some(self.effort()), since, now);
        self.behind.push_back(take);
        actions.push(Action::Note(Step::Began));
    }

    /// When a picture can be shown that is whole already.
    pub(super) fn lands_at(&self) -> Option<Moment> {
        (self.is_waiting() && self.knobs.making == Making::InTime && self.front.whole().is_some()).then_some(Moment(0))
    }

    /// The newest moving picture that is whole is shown, if there is one; in a replay, the oldest under way, when it is whole.
    pub(super) fn end_whole(&mut self, now: Moment, actions: &mut Vec<Action>) {
        // One picture after the other.
        if !self.is_waiting() || self.taken.is_some() {
            return;
        }
        let newest = match self.knobs.making {
            Making::InTime => self.front.whole(),
            Making::Held { .. } => None,
            Making::Of { .. } => (self.front.frames() > 0).then_some(0),
        };
        let Some(newest) = newest else { return };
        for _ in 0..newest {
            self.overtake(actions);
        }
        if let Making::Of { still, .. } = self.knobs.making
            && !self.behind.is_empty()
        {
            // The next ends when the recording says so.
            self.knobs.making = Making::Held { still };
        }
        self.finish_moving(1.0, now, actions);
    }

    /// The oldest of several moving pictures is seen by nobody: a newer one is there.
    pub(super) fn overtake(&mut self, actions: &mut Vec<Action>) {
        let Some(next) = self.behind.pop_front() else { return };
        let Some(old) = self.take else { return };
        // That was drawn, too.
        self.unlearnt += self.work_of(&old, self.front.frame_progress());
        self.front.overtake();
        self.forget_before(&next, actions);
        // Who waits for what it would have shown waits still.
        self.take = Some(Take { since: old.since.or(next.since), ..next });
        actions.push(Action::Note(Step::Overtaken));
    }

    /// The oldest picture has ended: the next is being drawn already.
    pub(super) fn go_on_with(&mut self, next: Take, now: Moment, actions: &mut Vec<Action>) {
        self.forget_before(&next, actions);
        self.take = Some(next);
        self.begin_behind_if_due(now, actions);
    }

    /// Which of those behind the oldest has asked it; `None`: that one.
    pub(super) fn asked_for(&self, ticket: Ticket) -> Option<&Take> {
        self.behind.iter().rev().find(|take| !take.is_after(ticket))
    }

    /// What was asked for pictures before this one is of no use any more.
    fn forget_before(&mut self, take: &Take, actions: &mut Vec<Action>) {
        let old: BTreeSet<_> = self.open.iter().filter(|ticket| take.is_after(**ticket)).copied().collect();
        if !old.is_empty() {
            self.open.retain(|ticket| !old.contains(ticket));
            actions.push(Action::Cancel(old));
        }
    }
}

impl Take {
    /// A question was asked for one that was begun before this.
    fn is_after(&self, ticket: Ticket) -> bool {
        ticket.batch.wrapping_sub(self.first_ticket) > u32::MAX / 2
    }
}
