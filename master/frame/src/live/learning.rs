//! How fast workers draw, learnt from what comes back: what [`super::pace`] goes by.
//!
//! A picture's time is that since the one before it, or since it could have begun: workers draw one after the other, and
//! on the way there and back nobody draws it.

use super::{Live, Moment, Take};

/// How old people see what they did, if the way allows it, microseconds; about ten milliseconds are added by developing and showing.
/// Less: younger and smaller pictures where workers are far away.
const AGE_AIM: u64 = 140_000;

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
            let waited = now.0.saturating_sub(self.could_begin(*asked));
            if waited > 2 * self.pace.target() {
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
            let began = self.could_begin(asked);
            self.batch_answered = now;
            self.learn(1.0, now.0.saturating_sub(began));
        }
    }

    /// When the answer to a batch could have begun to come, microseconds: when it had been there and back, and after that to the
    /// one before. One is drawn after the other, and several are on the way.
    fn could_begin(&self, asked: Moment) -> u64 {
        self.batch_answered.0.max(asked.0 + self.round_trip)
    }

    /// So much of a batch was drawn in that time.
    fn learn(&mut self, done: f32, micros: u64) {
        let drawn = self.front.work(&self.camera, self.pace.effort()) * f64::from(done);
        self.learn_drawn(drawn, micros);
    }

    /// So much work was done in that time.
    fn learn_drawn(&mut self, work: f64, micros: u64) {
        let (front, camera, waits) = (&self.front, self.camera, self.waits_for_the_way());
        self.pace.learn(|effort| front.work(&camera, effort), work, micros, waits);
    }

    /// So much shorter than the time aimed at moving pictures should take to draw, because the way takes time as well,
    /// microseconds. In the mean a picture is shown that long after the input that it shows: half a picture's time until it is
    /// begun, one until it is drawn, and the way. What that is beyond [`AGE_AIM`] is taken from the pictures' time;
    /// [`Pace::learn`] leaves them half. What is made at once waits for no way.
    pub(super) fn waits_for_the_way(&self) -> u64 {
        if self.front.stock().is_some() {
            return 0;
        }
        let age = 3 * self.pace.target() / 2 + self.round_trip;
        (2 * age.saturating_sub(AGE_AIM) / 3).min(self.round_trip / 2)
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
