//! How busy a thread of the master is: the share of its time that it does not wait for something to do.

use std::time::{Duration, Instant};

/// Shares of the last second or so, 0..=1.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Busy {
    /// Of the thread that passes questions and answers on.
    pub dispatcher: f64,
    /// Of the one that makes pictures of them.
    pub drawing: f64,
}

/// From this share on, more workers bring hardly more pictures.
const LIMIT: f64 = 0.9;

impl Busy {
    /// The master can do no more, however many workers there are.
    pub fn is_the_limit(self) -> bool {
        self.dispatcher.max(self.drawing) >= LIMIT
    }
}

/// Watches a thread that waits now and then.
#[derive(Debug)]
pub(super) struct Watch {
    since: Instant,
    waited: Duration,
}

/// Shares are taken over this time at least.
const SPAN: Duration = Duration::from_secs(1);

impl Watch {
    pub(super) fn new(now: Instant) -> Self {
        Self { since: now, waited: Duration::ZERO }
    }

    /// It has waited from then until now; its share of busy time, if it is long since that was told.
    pub(super) fn waited(&mut self, from: Instant, now: Instant) -> Option<f64> {
        self.waited += now.saturating_duration_since(from);
        let span = now.saturating_duration_since(self.since);
        if span < SPAN {
            return None;
        }
        let share = 1.0 - self.waited.as_secs_f64() / span.as_secs_f64();
        *self = Self::new(now);
        Some(share.clamp(0.0, 1.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn who_waits_a_quarter_of_the_time_is_busy_three_quarters() {
        let begun = Instant::now();
        let at = |millis| begun + Duration::from_millis(millis);
        let mut watch = Watch::new(begun);
        for turn in 0..12 {
            assert_eq!(watch.waited(at(80 * turn + 60), at(80 * turn + 80)), None);
        }
        let share = watch.waited(at(1020), at(1040)).unwrap();
        assert!((share - 0.75).abs() < 1e-9, "{share}");
        assert_eq!(watch.waited(at(1040), at(1500)), None, "it begins anew");
        assert!(Busy { dispatcher: 0.2, drawing: 0.95 }.is_the_limit());
        assert!(!Busy { dispatcher: 0.5, drawing: 0.75 }.is_the_limit());
    }
}
