//! A value and how sure it is.

/// A value with its 95 % confidence interval.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Interval {
    /// The estimate.
    pub value: f64,
    /// Lower end.
    pub low: f64,
    /// Upper end.
    pub high: f64,
}

impl Interval {
    /// Mean ± t·s/√n of independent values; of a single one nothing is known but itself, and of none
    /// not even that.
    pub fn of_mean(values: &[f64]) -> Option<Self> {
        let n = values.len() as f64;
        let mean = values.iter().sum::<f64>() / n;
        match values.len() {
            0 => None,
            1 => Some(Self { value: mean, low: f64::NEG_INFINITY, high: f64::INFINITY }),
            count => {
                let squares: f64 = values.iter().map(|value| (value - mean).powi(2)).sum();
                let half = t_975(count - 1) * (squares / (n - 1.0) / n).sqrt();
                Some(Self { value: mean, low: mean - half, high: mean + half })
            }
        }
    }

    /// All of it less a constant.
    #[must_use]
    pub fn less(self, constant: f64) -> Self {
        Self { value: self.value - constant, low: self.low - constant, high: self.high - constant }
    }
}

/// 97.5 % quantile of Student's t with so many degrees of freedom; those above 30 count as 30,
/// which errs by less than 4 % on the safe side.
pub(crate) fn t_975(degrees: usize) -> f64 {
    T_975[degrees.clamp(1, T_975.len()) - 1]
}

/// 97.5 % quantile of the normal distribution.
pub(super) const Z_975: f64 = 1.959_964;

const T_975: [f64; 30] = [
    12.706, 4.303, 3.182, 2.776, 2.571, 2.447, 2.365, 2.306, 2.262, 2.228, 2.201, 2.179, 2.160, 2.145, 2.131, 2.120,
    2.110, 2.101, 2.093, 2.086, 2.080, 2.074, 2.069, 2.064, 2.060, 2.056, 2.052, 2.048, 2.045, 2.042,
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mean_of_known_values_has_a_known_interval() {
        // Mean 2, s = 1, so the half width is t₂/√3.
        let found = Interval::of_mean(&[1.0, 2.0, 3.0]).unwrap();
        assert!((found.value - 2.0).abs() < 1e-12);
        assert!(
            (found.high - 2.0 - 4.303 / 3.0_f64.sqrt()).abs() < 1e-9 && (found.low + found.high - 4.0).abs() < 1e-9
        );
        assert_eq!(found.less(2.0).value, 0.0);
    }

    #[test]
    fn one_value_is_no_evidence() {
        assert_eq!(Interval::of_mean(&[]), None);
        assert_eq!(Interval::of_mean(&[5.0]).map(|i| (i.value, i.high)), Some((5.0, f64::INFINITY)));
    }
}
