//! How far a series of pictures is.

use std::time::{Duration, Instant};

use serde_json::{Value, json};

use crate::spoken::duration;

/// Counts pictures, and tells how long the others will take: as long as those before, on average.
#[derive(Clone, Copy, Debug)]
pub struct Series {
    began: Instant,
    /// Pictures that this run makes.
    all: usize,
    /// Pictures it has made.
    done: usize,
    /// When the last of them was done.
    last: Instant,
}

impl Series {
    /// So many are to be made.
    pub fn new(all: usize, now: Instant) -> Self {
        Self { began: now, all, done: 0, last: now }
    }

    /// One more is made.
    pub fn next(&mut self, now: Instant) {
        (self.done, self.last) = (self.done + 1, now);
    }

    /// Time until all are made, if the current one has so much to go.
    pub fn left(&self, current: Option<Duration>, now: Instant) -> Option<Duration> {
        let spent = now.saturating_duration_since(self.last);
        let after_this = self.all.saturating_sub(self.done + 1) as u32;
        // Before one is done, the first tells by itself.
        let each = match self.done {
            0 => spent + current?,
            done => (self.last - self.began) / done as u32,
        };
        let current = current.unwrap_or(each.saturating_sub(spent));
        Some(current + each * after_this)
    }

    /// For people.
    pub fn line(&self, current: Option<Duration>, now: Instant) -> String {
        let left = self.left(current, now).map(|left| format!(", {} left", duration(left.as_secs_f64())));
        format!("picture {} of {}{}", self.done + 1, self.all, left.unwrap_or_default())
    }

    /// For programs.
    pub fn json(&self, current: Option<Duration>, now: Instant) -> Value {
        let left = self.left(current, now).map(|left| left.as_secs_f64());
        json!({ "pictures_done": self.done, "pictures": self.all, "seconds_left": left })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_left_is_the_mean_of_what_was_times_what_is_to_come() {
        let began = Instant::now();
        let at = |seconds| began + Duration::from_secs(seconds);
        let left = |series: &Series, current: Option<u64>, now| {
            series.left(current.map(Duration::from_secs), at(now)).map(|left| left.as_secs())
        };
        let mut series = Series::new(4, began);
        assert_eq!(left(&series, None, 1), None, "nothing is known yet");
        assert_eq!(left(&series, Some(9), 1), Some(9 + 3 * 10));
        series.next(at(10));
        series.next(at(30));
        assert_eq!(left(&series, None, 30), Some(15 + 15));
        assert_eq!(left(&series, Some(20), 50), Some(20 + 15), "the current one knows better");
        series.next(at(60));
        assert_eq!(left(&series, None, 90), Some(0), "it takes longer than the others did");
        assert_eq!(series.line(Some(Duration::from_secs(5)), at(90)), "picture 4 of 4, 5 s left");
    }
}
