//! How sure a mean is, judged by a few independent repetitions (IGI-11; algorithms.md D2).

/// An estimated relative mean squared error with its 95 % confidence interval.
///
/// It measures noise: the expected [`super::Difference::rel_mse`] between the picture and the limit
/// of its own settings. What the settings leave out for ever (a clipped bound without remainder, a
/// longest path) is not in it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Estimate {
    /// The estimate.
    pub rel_mse: f64,
    /// Lower end of the interval, at least 0.
    pub low: f64,
    /// Upper end of the interval.
    pub high: f64,
}

/// Sums of squared relative deviations of each repetition from the mean of all.
#[derive(Clone, Debug, PartialEq)]
pub struct Spread {
    /// One a repetition.
    pub deviations: Vec<f64>,
    /// Number of values (pixels times channels) summed up.
    pub values: u64,
}

impl Spread {
    /// Nothing summed up yet.
    pub fn new(repetitions: usize) -> Self {
        Self { deviations: vec![0.0; repetitions], values: 0 }
    }

    /// Both together.
    #[must_use]
    pub fn plus(&self, other: &Self) -> Self {
        let deviations = self.deviations.iter().zip(&other.deviations).map(|(a, b)| a + b).collect();
        Self { deviations, values: self.values + other.values }
    }

    /// The variance of the mean of R repetitions is estimated R times, once from each repetition's
    /// deviation, `v_r = R/(R−1) · mean (x_r − x̄)² / R`; the estimate is their mean, and the
    /// interval comes from their own spread by Student's t. Few repetitions give honestly wide ones.
    pub fn estimate(&self) -> Option<Estimate> {
        let count = self.deviations.len();
        if count < 2 || self.values == 0 {
            return None;
        }
        let r = count as f64;
        let each: Vec<f64> = self.deviations.iter().map(|sum| sum / self.values as f64 / (r - 1.0)).collect();
        let mean = each.iter().sum::<f64>() / r;
        let variance = each.iter().map(|v| (v - mean) * (v - mean)).sum::<f64>() / (r - 1.0);
        let half = t_quantile(count - 1) * (variance / r).sqrt();
        Some(Estimate { rel_mse: mean, low: (mean - half).max(0.0), high: mean + half })
    }
}

/// 97.5 % quantile of Student's t.
fn t_quantile(degrees: usize) -> f64 {
    const TABLE: [f64; 15] =
        [12.706, 4.303, 3.182, 2.776, 2.571, 2.447, 2.365, 2.306, 2.262, 2.228, 2.201, 2.179, 2.160, 2.145, 2.131];
    TABLE.get(degrees.max(1) - 1).copied().unwrap_or(1.96)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn known_spread_gives_known_estimate() {
        // Two repetitions, 1 apart: sample variance ½, variance of their mean ¼.
        let estimate = Spread { deviations: vec![0.25, 0.25], values: 1 }.estimate().unwrap();
        assert_eq!(estimate, Estimate { rel_mse: 0.25, low: 0.25, high: 0.25 });
    }

    #[test]
    fn one_repetition_tells_nothing() {
        assert_eq!(Spread::new(1).estimate(), None);
        assert_eq!(Spread::new(4).estimate(), None);
    }

    #[test]
    fn unequal_deviations_widen_the_interval() {
        let estimate = Spread { deviations: vec![1.0, 2.0, 3.0, 6.0], values: 10 }.estimate().unwrap();
        assert!((estimate.rel_mse - 0.1).abs() < 1e-12);
        assert!(estimate.low < 0.1 && 0.1 < estimate.high);
    }
}
