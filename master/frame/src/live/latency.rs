//! How long people wait: from an input to the first picture that shows it.

use std::collections::VecDeque;

/// The latest waiting times.
#[derive(Clone, Debug, Default)]
pub struct Latency {
    /// Microseconds, oldest first.
    recent: VecDeque<u64>,
}

/// Waiting times that are kept: about the last half minute of moving.
const KEPT: usize = 300;

impl Latency {
    /// One more, microseconds.
    pub fn add(&mut self, micros: u64) {
        if self.recent.len() == KEPT {
            self.recent.pop_front();
        }
        self.recent.push_back(micros);
    }

    /// The time, in microseconds, that this share of the inputs (0..=1) waited at most; `None` if there was none.
    pub fn percentile(&self, share: f64) -> Option<u64> {
        let mut sorted: Vec<_> = self.recent.iter().copied().collect();
        sorted.sort_unstable();
        let rank = (share * sorted.len() as f64).ceil() as usize;
        sorted.get(rank.saturating_sub(1)).copied()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn percentiles_are_of_what_is_kept() {
        let mut latency = Latency::default();
        assert_eq!(latency.percentile(0.5), None);
        (0..1000).for_each(|_| latency.add(1_000_000));
        (1..=KEPT as u64).rev().for_each(|micros| latency.add(micros));
        assert_eq!((latency.percentile(0.5), latency.percentile(0.99)), (Some(150), Some(297)));
        assert_eq!((latency.percentile(0.0), latency.percentile(1.0)), (Some(1), Some(300)));
    }
}
