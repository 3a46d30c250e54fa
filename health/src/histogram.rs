//! How often something took how long.

/// Counts of durations in fixed classes, and their sum.
#[derive(Clone, Debug, PartialEq)]
pub struct Histogram {
    /// Upper ends of the classes, seconds, rising; a last class without an end follows.
    bounds: &'static [f64],
    counts: Vec<u64>,
    sum: f64,
}

/// From a hundredth of a second to half a minute: frames, inputs, tiles.
pub const FRAMES: &[f64] = &[0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1.0, 2.5, 5.0, 10.0, 30.0];

impl Histogram {
    /// Nothing counted; `bounds` are the upper ends of the classes, seconds, rising.
    pub fn new(bounds: &'static [f64]) -> Self {
        Self { bounds, counts: vec![0; bounds.len() + 1], sum: 0.0 }
    }

    /// Counts one duration, seconds. What is no number is not counted.
    pub fn add(&mut self, seconds: f64) {
        if !seconds.is_finite() {
            return;
        }
        self.counts[self.bounds.partition_point(|bound| *bound < seconds)] += 1;
        self.sum += seconds;
    }

    /// Every upper end, and how many were at most so long; the last, infinity, has all.
    pub fn cumulative(&self) -> impl Iterator<Item = (f64, u64)> {
        let ends = self.bounds.iter().copied().chain([f64::INFINITY]);
        ends.zip(self.counts.iter().scan(0, |all, count| {
            *all += count;
            Some(*all)
        }))
    }

    /// Sum of all durations, seconds.
    pub fn sum(&self) -> f64 {
        self.sum
    }

    /// How many were counted.
    pub fn count(&self) -> u64 {
        self.counts.iter().sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_duration_is_counted_in_its_class_and_all_above() {
        let mut histogram = Histogram::new(&[0.1, 1.0]);
        for seconds in [0.05, 0.1, 0.5, 7.0, f64::NAN] {
            histogram.add(seconds);
        }
        let classes: Vec<_> = histogram.cumulative().collect();
        assert_eq!(classes, [(0.1, 2), (1.0, 3), (f64::INFINITY, 4)]);
        assert_eq!((histogram.count(), histogram.sum()), (4, 7.65));
    }
}
