//! What was measured at each point, and what follows for all of them, each with how sure it is.
//!
//! Estimates come from several independent replicates of the same samples, so that what all points share as an error (a
//! light set lights all of them) is no secret: every figure is computed with each replicate left out in turn (the jackknife,
//! Tukey 1958).

use crate::metrics::t_975;

/// Sums of values, replicate by replicate.
#[derive(Clone, Debug, PartialEq)]
pub struct Tally {
    points: usize,
    /// Of each replicate: how often all points were measured, and their sums.
    replicates: Vec<(u32, Vec<f64>)>,
}

/// A figure, and half of its 95 % confidence interval.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Measured {
    /// The estimate.
    pub value: f64,
    /// It is within so much of the truth with a probability of 95 %; infinite while nothing is known.
    pub within: f64,
}

/// What planners state of an area: EN 12665.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Figures {
    /// Least of all points. Of noisy values the least is a little too low: within its error.
    pub min: Measured,
    /// Mean of all points.
    pub average: Measured,
    /// Greatest of all points.
    pub max: Measured,
    /// Uniformity Uo: least over mean.
    pub uniformity: Measured,
    /// Diversity Ud: least over greatest.
    pub diversity: Measured,
}

impl Tally {
    /// Of so many points, by so many replicates: two at least.
    pub fn new(points: usize, replicates: usize) -> Self {
        Self { points, replicates: vec![(0, vec![0.0; points]); replicates.max(2)] }
    }

    /// Adds values of all points, in order, that belong to a replicate. Those of replicates in turn, so that all have as
    /// many.
    pub fn add(&mut self, replicate: usize, values: impl IntoIterator<Item = f64>) {
        let count = self.replicates.len();
        let (times, sums) = &mut self.replicates[replicate % count];
        *times += 1;
        sums.iter_mut().zip(values).for_each(|(sum, value)| *sum += value);
    }

    /// How often all points were measured.
    pub fn rounds(&self) -> u32 {
        self.replicates.iter().map(|(times, _)| times).sum()
    }

    /// Means of all points.
    pub fn means(&self) -> Vec<f64> {
        self.without(None)
    }

    /// Every point with its error.
    pub fn points(&self) -> Vec<Measured> {
        let whole = self.means();
        let parts = self.parts();
        let of = |point: usize| jackknife(whole[point], parts.iter().map(|part| part[point]));
        (0..self.points).map(of).collect()
    }

    /// What follows for all points; `None` if there is none.
    pub fn figures(&self) -> Option<Figures> {
        let (whole, parts) = (self.means(), self.parts());
        let figure = |of: &dyn Fn(&[f64]) -> f64| jackknife(of(&whole), parts.iter().map(|part| of(part)));
        let min = |values: &[f64]| values.iter().copied().fold(f64::INFINITY, f64::min);
        let max = |values: &[f64]| values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let average = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
        let share = |part: f64, of: f64| if of > 0.0 { part / of } else { 0.0 };
        (self.points > 0).then(|| Figures {
            min: figure(&min),
            average: figure(&average),
            max: figure(&max),
            uniformity: figure(&|values| share(min(values), average(values))),
            diversity: figure(&|values| share(min(values), max(values))),
        })
    }

    /// Half of the widest 95 % interval of a point, over the mean of all points: what is to become small. Infinite while
    /// nothing is known; 0 in the dark.
    pub fn error(&self) -> f64 {
        let widest = self.points().iter().map(|point| point.within).fold(0.0, f64::max);
        let average = self.means().iter().sum::<f64>() / self.points as f64;
        if widest == 0.0 { 0.0 } else { widest / average.abs() }
    }

    /// Means of all points, with each replicate left out in turn; nothing before there are two.
    fn parts(&self) -> Vec<Vec<f64>> {
        let numbers = (0..self.replicates.len()).filter(|number| self.replicates[*number].0 > 0);
        let parts: Vec<_> = numbers.map(|number| self.without(Some(number))).collect();
        if parts.len() < 2 { Vec::new() } else { parts }
    }

    fn without(&self, left_out: Option<usize>) -> Vec<f64> {
        let mut sums = vec![0.0; self.points];
        let mut count = 0;
        for (number, (times, values)) in self.replicates.iter().enumerate() {
            if Some(number) != left_out {
                count += times;
                sums.iter_mut().zip(values).for_each(|(sum, value)| *sum += value);
            }
        }
        let scale = 1.0 / f64::from(count.max(1));
        sums.iter().map(|sum| sum * scale).collect()
    }
}

/// The 95 % interval of a figure by what it is without each of n replicates: s² = (n − 1)/n · Σ (fᵢ − f̄)².
fn jackknife(value: f64, parts: impl Iterator<Item = f64> + Clone) -> Measured {
    let n = parts.clone().count();
    if n < 2 {
        return Measured { value, within: f64::INFINITY };
    }
    let mean = parts.clone().sum::<f64>() / n as f64;
    let squares: f64 = parts.map(|part| (part - mean) * (part - mean)).sum();
    let deviation = (squares * (n - 1) as f64 / n as f64).sqrt();
    Measured { value, within: t_975(n - 1) * deviation }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::metrics::Interval;

    #[test]
    fn of_a_mean_the_jackknife_says_what_students_t_does() {
        let values = [3.0, 5.0, 4.5, 7.0, 2.0];
        let mut tally = Tally::new(1, values.len());
        values.iter().enumerate().for_each(|(replicate, value)| tally.add(replicate, [*value]));
        let expected = Interval::of_mean(&values).unwrap();
        let found = tally.figures().unwrap().average;
        assert!((found.value - expected.value).abs() < 1e-12);
        assert!((found.value + found.within - expected.high).abs() < 1e-9);
        assert_eq!(tally.points()[0], found);
        assert!((tally.error() - found.within / found.value).abs() < 1e-12);
    }

    #[test]
    fn figures_are_those_of_all_points() {
        let mut tally = Tally::new(3, 4);
        for round in 0..8 {
            tally.add(round, [10.0, 20.0, 60.0]);
        }
        let Figures { min, average, max, uniformity, diversity } = tally.figures().unwrap();
        let all = [min, average, max, uniformity, diversity];
        assert_eq!(all.map(|figure| figure.value), [10.0, 30.0, 60.0, 1.0 / 3.0, 1.0 / 6.0]);
        assert!(all.iter().all(|figure| figure.within.abs() < 1e-9), "nothing varies");
        assert_eq!(tally.rounds(), 8);
    }

    /// An error that all points share is that of the mean, and none of the uniformity.
    #[test]
    fn an_error_that_points_share_does_not_average_out() {
        let mut tally = Tally::new(100, 8);
        for (round, factor) in [0.9, 1.1, 1.0, 0.95, 1.05, 1.2, 0.8, 1.0].into_iter().enumerate() {
            tally.add(round, (0..100).map(|point| factor * (1.0 + f64::from(point))));
        }
        let figures = tally.figures().unwrap();
        assert!(figures.average.within > 0.08 * figures.average.value, "{figures:?}");
        assert!(figures.uniformity.within < 1e-9, "{figures:?}");
    }

    #[test]
    fn one_replicate_is_no_evidence_and_the_dark_is_certain() {
        let mut tally = Tally::new(2, 4);
        tally.add(0, [1.0, 2.0]);
        assert_eq!(tally.error(), f64::INFINITY);
        tally.add(1, [1.0, 2.0]);
        assert_eq!(tally.error(), 0.0);
        assert_eq!(Tally::new(0, 4).figures(), None);
    }
}
