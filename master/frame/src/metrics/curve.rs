//! Error against time as a curve: slopes, values in between, times to reach a value (algorithms.md D5).
//! All of it on logarithmic axes, where errors of estimators are straight lines.

/// A straight line on logarithmic axes: error = scale · time^slope.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PowerLaw {
    /// −1: the squared error of independent samples; 0: more time does not help.
    pub slope: f64,
    /// The error at time 1.
    pub scale: f64,
}

impl PowerLaw {
    /// Fits the points of the last decade of time, by least squares; `None` for fewer than three. Points that
    /// are not above 0 have no logarithm and stay out.
    pub fn of_last_decade(points: &[(f64, f64)]) -> Option<Self> {
        let last = points.iter().map(|(x, _)| *x).fold(0.0, f64::max);
        // A little more than ten times, so that ten times itself is in.
        let decade = points.iter().filter(|(x, y)| *x > 0.0 && *y > 0.0 && *x >= last / 10.5);
        let logs: Vec<(f64, f64)> = decade.map(|(x, y)| (x.ln(), y.ln())).collect();
        if logs.len() < 3 {
            return None;
        }
        let n = logs.len() as f64;
        let mean_x = logs.iter().map(|(x, _)| x).sum::<f64>() / n;
        let mean_y = logs.iter().map(|(_, y)| y).sum::<f64>() / n;
        let xx: f64 = logs.iter().map(|(x, _)| (x - mean_x).powi(2)).sum();
        let xy: f64 = logs.iter().map(|(x, y)| (x - mean_x) * (y - mean_y)).sum();
        let slope = xy / xx;
        (xx > 0.0).then(|| Self { slope, scale: (mean_y - slope * mean_x).exp() })
    }

    /// The error at a time.
    pub fn at(&self, time: f64) -> f64 {
        self.scale * time.powf(self.slope)
    }
}

/// The first time at which a curve is at or below `level`, between the points as a straight line;
/// `None` if it does not get there. `points` ascend in time.
pub fn time_to(points: &[(f64, f64)], level: f64) -> Option<f64> {
    let reached = points.iter().position(|(_, y)| *y <= level)?;
    let (x, y) = points[reached];
    let Some((x0, y0)) = reached.checked_sub(1).map(|before| points[before]) else { return Some(x) };
    if y <= 0.0 || x0 <= 0.0 {
        return Some(x);
    }
    let share = (y0 / level).ln() / (y0 / y).ln();
    Some(x0 * (x / x0).powf(share))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn law(slope: f64) -> Vec<(f64, f64)> {
        (0..12).map(|k| f64::from(1 << k)).map(|x| (x, 3.0 * x.powf(slope))).collect()
    }

    #[test]
    fn power_laws_are_recognised() {
        for slope in [-1.0, -0.66, 0.0, -1.3] {
            let fit = PowerLaw::of_last_decade(&law(slope)).unwrap();
            assert!((fit.slope - slope).abs() < 1e-9 && (fit.scale / 3.0 - 1.0).abs() < 1e-9, "{fit:?}");
            assert!((fit.at(100.0) / (3.0 * 100.0_f64.powf(slope)) - 1.0).abs() < 1e-9);
        }
    }

    #[test]
    fn only_the_last_decade_counts() {
        // A floor of 0.01 under a law of −1: the slope is about 0 at the end.
        let floored: Vec<(f64, f64)> = (0..18).map(|k| f64::from(1 << k)).map(|x| (x, 1.0 / x + 0.01)).collect();
        assert!(PowerLaw::of_last_decade(&floored).unwrap().slope > -0.01);
        assert!(PowerLaw::of_last_decade(&floored[..6]).unwrap().slope < -0.8);
    }

    #[test]
    fn two_points_are_no_law() {
        assert_eq!(PowerLaw::of_last_decade(&law(-1.0)[..2]), None);
        assert_eq!(PowerLaw::of_last_decade(&[(1.0, 1.0), (2.0, -1.0), (3.0, 0.5)]), None);
    }

    #[test]
    fn the_time_to_an_error_lies_between_points() {
        let time = time_to(&law(-1.0), 3.0 / 48.0).unwrap();
        assert!((time - 48.0).abs() < 1e-9, "{time}");
        assert_eq!(time_to(&law(-1.0), 5.0), Some(1.0), "at once");
        assert_eq!(time_to(&law(-1.0), 1e-9), None, "never");
    }
}
