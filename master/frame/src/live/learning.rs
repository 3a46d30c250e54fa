//! How fast workers draw, learnt from what comes back: what [`super::pace`] goes by.
//!
//! A picture's time is that since the one before it, or since it could have begun: workers draw one after the other, and
//! on the way there and back nobody draws it.

use super::{Live, Moment, Take};

impl Live {
    /// Batches that are in no moving picture yet, and not answered whole.
    pub(super) fn unanswered(&self) -> usize {
        self.front.stock().map_or(0, |stock| stock.open.saturating_sub(stock.whole)) as usize
    }

    /// Notes when batches were asked; `before`: how many were unanswered before these. One that is late is a sign, too: it is
    /// learnt from before it is there.
    pub(super) fn note_asked(&mut self, before: usize, now: Moment) {
        self.batches_asked.truncate(before);
        if let Some(asked) = self.batches_asked.front() {
            let waited = now.0.saturating_sub(asked.0.max(self.batch_answered.0));
            if waited > 2 * self.pace.target() + self.round_trip {
                self.learn(self.front.frame_progress(), waited);
            }
        }
        while self.batches_asked.len() < self.unanswered() {
            self.batches_asked.push_back(now);
        }
    }

    /// So many batches that are in no picture yet have been answered whole since they were last counted.
    pub(super) fn note_answered(&mut self, batches: usize, now: Moment) {
        for _ in 0..batches {
            let Some(asked) = self.batches_asked.pop_front() else { return };
            // One is answered after the other: the time of each is that since the one before, if it waited for that.
            let began = asked.0.max(self.batch_answered.0);
            self.batch_answered = now;
            self.learn(1.0, now.0.saturating_sub(began));
        }
    }

    /// So much of a batch was drawn in that time, which began with a question.
    fn learn(&mut self, done: f32, micros: u64) {
        let drawn = self.front.work(&self.camera, self.pace.effort()) * f64::from(done);
        self.learn_drawn(drawn, micros.saturating_sub(self.round_trip));
    }

    /// So much work was done in that time.
    fn learn_drawn(&mut self, work: f64, micros: u64) {
        let (front, camera, waits) = (&self.front, self.camera, self.waits_for_the_way());
        self.pace.learn(|effort| front.work(&camera, effort), work, micros, waits);
    }

    /// So much of the time of each moving picture goes by on the way, while nobody draws, microseconds.
    pub(super) fn waits_for_the_way(&self) -> u64 {
        if self.front.flight_max() > 1 { 0 } else { self.round_trip }
    }

    /// What was done of a picture, `done` of which (0..=1) has come.
    pub(super) fn work_of(&self, take: &Take, done: f32) -> f64 {
        take.moving.map_or(0.0, |effort| self.front.work(&take.camera, effort) * f64::from(done))
    }

    /// Learns from a moving picture that has ended, `done` of which (0..=1) has come. Workers draw one picture after the other:
    /// its time is that since the one before, if it waited for that. Two that come at once say something together.
    pub(super) fn learn_of(&mut self, take: &Take, done: f32, now: Moment) {
        let arrived = take.began.0 + self.round_trip;
        if arrived > self.learnt.0 {
            self.unlearnt = 0.0;
        }
        self.unlearnt += self.work_of(take, done);
        let micros = now.0.saturating_sub(arrived.max(self.learnt.0));
        if self.behind.is_empty() || 2 * micros >= self.pace.drawing() {
            self.learn_drawn(self.unlearnt, micros);
            (self.learnt, self.unlearnt) = (now, 0.0);
        }
    }
}
