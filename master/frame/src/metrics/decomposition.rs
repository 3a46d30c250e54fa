//! Noise and bias apart, from independent runs of one method (algorithms.md D3).
//!
//! Let d_r be run r's error at each value (pixel and channel), weighted so that the mean of d² is relMSE.
//! All that is asked for lies in the products G_rs = mean d_r·d_s:
//!
//! ```text
//! error of a run        G_rr
//! variance + bias²      mean of G_rr
//! bias² (+ the reference's own noise)     mean of G_rs, r ≠ s: two runs' noise has nothing in common
//! variance              their difference
//! ```

use glam::DVec3;
use rayon::prelude::*;

use super::{Interval, RELATIVE_FLOOR, SizesDiffer};
use crate::Picture;

/// Products of the errors of R runs, R×R.
#[derive(Clone, Debug, PartialEq)]
pub struct Gram {
    runs: usize,
    products: Vec<f64>,
}

/// What the error of a run consists of, in the units of relMSE.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Decomposition {
    /// What differs from run to run, and falls with time.
    pub variance: Interval,
    /// What all runs have in common, beyond the reference's own noise; it may come out a little
    /// below 0 where there is none.
    pub bias2: Interval,
}

impl Gram {
    /// Compares every run's picture with the reference, weighted as in [`super::Difference::rel_mse`].
    ///
    /// # Errors
    /// [`SizesDiffer`] if a picture is of another size than the reference, or there is no pixel.
    pub fn of(pictures: &[&Picture], reference: &Picture) -> Result<Self, SizesDiffer> {
        if reference.pixels.is_empty() || pictures.iter().any(|picture| !picture.same_size(reference)) {
            return Err(SizesDiffer);
        }
        let runs = pictures.len();
        let values = 3.0 * reference.pixels.len() as f64;
        let weights: Vec<DVec3> = reference.pixels.iter().map(|r| weight(r.as_dvec3())).collect();
        let product = |a: &Picture, b: &Picture| -> f64 {
            let each = weights.iter().zip(&reference.pixels).zip(a.pixels.iter().zip(&b.pixels));
            let each = each.map(|((w, r), (a, b))| {
                let r = r.as_dvec3();
                ((a.as_dvec3() - r) * (b.as_dvec3() - r) * *w).element_sum()
            });
            each.sum::<f64>() / values
        };
        let pairs: Vec<(usize, usize)> = (0..runs).flat_map(|r| (0..=r).map(move |s| (r, s))).collect();
        let found: Vec<f64> = pairs.par_iter().map(|(r, s)| product(pictures[*r], pictures[*s])).collect();
        let mut products = vec![0.0; runs * runs];
        for ((r, s), value) in pairs.into_iter().zip(found) {
            products[r * runs + s] = value;
            products[s * runs + r] = value;
        }
        Ok(Self { runs, products })
    }

    /// Number of runs.
    pub fn runs(&self) -> usize {
        self.runs
    }

    /// relMSE of every run.
    pub fn errors(&self) -> Vec<f64> {
        (0..self.runs).map(|r| self.at(r, r)).collect()
    }

    /// Noise and bias with 95 % intervals; `None` for fewer than two runs. `reference_noise` is the expected
    /// relMSE of the reference itself, which all runs seem to have in common.
    ///
    /// Intervals are bootstrapped over runs: pairs of one run with itself stay out, and the spread is
    /// widened as Student's t demands for so few runs. All randomness comes from `seed`.
    pub fn decompose(&self, reference_noise: f64, seed: u64) -> Option<Decomposition> {
        if self.runs < 2 {
            return None;
        }
        let [variance, common] = self.parts(&vec![1; self.runs])?;
        let mut dice = Dice(seed);
        let mut samples: [Vec<f64>; 2] = [Vec::with_capacity(RESAMPLES), Vec::with_capacity(RESAMPLES)];
        for _ in 0..RESAMPLES {
            let mut often = vec![0_u32; self.runs];
            (0..self.runs).for_each(|_| often[dice.below(self.runs)] += 1);
            // Nothing but copies of one run, which is rare: no pair to learn from.
            if let Some(parts) = self.parts(&often) {
                samples.iter_mut().zip(parts).for_each(|(sample, part)| sample.push(part));
            }
        }
        let [variances, commons] = samples;
        let variance = bootstrapped(variance, variances, self.runs);
        let common = bootstrapped(common, commons, self.runs);
        Some(Decomposition {
            variance: Interval { low: variance.low.max(0.0), ..variance },
            bias2: common.less(reference_noise),
        })
    }

    /// Variance and what is common, if run r counts `often[r]` times.
    fn parts(&self, often: &[u32]) -> Option<[f64; 2]> {
        let (mut pairs, mut variance, mut common) = (0.0, 0.0, 0.0);
        for r in 0..self.runs {
            for s in 0..r {
                let count = f64::from(often[r] * often[s]);
                pairs += count;
                common += count * self.at(r, s);
                variance += count * (0.5 * (self.at(r, r) + self.at(s, s)) - self.at(r, s));
            }
        }
        (pairs > 0.0).then(|| [variance / pairs, common / pairs])
    }

    fn at(&self, r: usize, s: usize) -> f64 {
        self.products[r * self.runs + s]
    }
}

/// What a squared error counts where the reference is `r`.
fn weight(r: DVec3) -> DVec3 {
    (r * r + RELATIVE_FLOOR).recip()
}

/// The percentiles of a bootstrap around its estimate, widened for few runs.
fn bootstrapped(value: f64, mut samples: Vec<f64>, runs: usize) -> Interval {
    samples.sort_unstable_by(f64::total_cmp);
    let count = samples.len();
    // Two runs are a single pair, which cannot vary.
    if runs < 3 || count == 0 {
        return Interval { value, low: f64::NEG_INFINITY, high: f64::INFINITY };
    }
    let at = |share: f64| samples[((share * count as f64) as usize).min(count - 1)];
    let n = runs as f64;
    let widen = super::interval::t_975(runs - 1) / super::interval::Z_975 * (n / (n - 1.0)).sqrt();
    Interval {
        value,
        low: value + (at(0.025) - value).min(0.0) * widen,
        high: value + (at(0.975) - value).max(0.0) * widen,
    }
}

/// SplitMix64 (Steele et al. 2014): good enough to choose runs by.
struct Dice(u64);

impl Dice {
    fn below(&mut self, most: usize) -> usize {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((u128::from(z ^ (z >> 31)) * most as u128) >> 64) as usize
    }
}

/// Resamplings of a bootstrap.
const RESAMPLES: usize = 999;

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;

    /// Noise of mean 0 and the given deviation, uniform.
    fn noise(dice: &mut Dice, deviation: f64) -> f32 {
        ((dice.below(1 << 30) as f64 / f64::from(1 << 30) - 0.5) * 12.0_f64.sqrt() * deviation) as f32
    }

    /// A grey picture of brightness 1, off by `bias`, with noise of so many independent sources.
    fn run(dice: &mut Dice, bias: f32, deviation: f64, ways: usize) -> Picture {
        let sources: Vec<f32> = (0..ways).map(|_| noise(dice, deviation)).collect();
        Picture::from_fn(16, 16, |x, y| Vec3::splat(1.0 + bias + sources[(y * 16 + x) as usize % ways]))
    }

    fn decomposed(dice: &mut Dice, bias: f32, deviation: f64, ways: usize, reference_deviation: f64) -> Decomposition {
        let reference = Picture::from_fn(16, 16, |_, _| Vec3::splat(1.0 + noise(dice, reference_deviation)));
        let runs: Vec<Picture> = (0..8).map(|_| run(dice, bias, deviation, ways)).collect();
        let runs: Vec<&Picture> = runs.iter().collect();
        let noise = reference_deviation * reference_deviation / 1.01;
        Gram::of(&runs, &reference).unwrap().decompose(noise, 7).unwrap()
    }

    #[test]
    fn known_errors_have_known_parts() {
        // Two runs, +3 and −1 off in every value of a black reference: variance 8, what is common −3.
        let picture = |value: f32| Picture::from_fn(2, 2, |_, _| Vec3::splat(value));
        let gram = Gram::of(&[&picture(3.0), &picture(-1.0)], &picture(0.0)).unwrap();
        let found = gram.decompose(0.0, 0).unwrap();
        let close = |a: f64, b: f64| (a - b).abs() < 1e-9 * b.abs();
        assert!(close(found.variance.value, 8.0 / 0.01) && close(found.bias2.value, -3.0 / 0.01), "{found:?}");
        assert_eq!((found.bias2.low, found.bias2.high), (f64::NEG_INFINITY, f64::INFINITY), "one pair is no evidence");
        assert!(close(gram.errors()[0], 9.0 / 0.01) && close(gram.errors()[1], 1.0 / 0.01));
    }

    #[test]
    fn errors_are_those_of_the_difference() {
        let mut dice = Dice(5);
        let (a, b) = (run(&mut dice, 0.3, 0.2, 256), run(&mut dice, 0.0, 0.5, 256));
        let difference = super::super::Difference::between(&a, &b).unwrap();
        assert!((Gram::of(&[&a], &b).unwrap().errors()[0] / difference.rel_mse - 1.0).abs() < 1e-9);
    }

    #[test]
    fn noise_and_bias_are_told_apart() {
        let mut dice = Dice(1);
        for (bias, deviation) in [(0.0, 0.1), (0.05, 0.1), (0.05, 0.0), (0.02, 0.2)] {
            let found: Vec<_> = (0..160).map(|_| decomposed(&mut dice, bias, deviation, 256, 0.02)).collect();
            let mean = |value: fn(&Decomposition) -> f64| found.iter().map(value).sum::<f64>() / 160.0;
            let (variance, bias2) = (mean(|d| d.variance.value), mean(|d| d.bias2.value));
            let (true_variance, true_bias2) = (deviation * deviation / 1.01, f64::from(bias * bias) / 1.01);
            assert!((variance - true_variance).abs() < 0.03 * true_variance + 1e-6, "{variance} {true_variance}");
            // The reference's noise is in the weights too, so what it adds is not quite independent.
            assert!((bias2 - true_bias2).abs() < 1.5e-4, "{bias2} instead of {true_bias2}");
        }
    }

    #[test]
    fn intervals_hold_the_truth_about_as_often_as_they_say() {
        for (ways, bias) in [(256, 0.0), (256, 0.05), (8, 0.0), (8, 0.05)] {
            let mut dice = Dice(ways as u64);
            let found: Vec<_> = (0..150).map(|_| decomposed(&mut dice, bias, 0.1, ways, 0.0)).collect();
            let holds = |interval: Interval, truth: f64| interval.low <= truth && truth <= interval.high;
            let true_bias2 = f64::from(bias * bias) / 1.01;
            let bias2 = found.iter().filter(|d| holds(d.bias2, true_bias2)).count();
            let variance = found.iter().filter(|d| holds(d.variance, 0.01 / 1.01)).count();
            assert!(bias2 >= 132 && variance >= 132, "{ways} ways, bias {bias}: {bias2} and {variance} of 150");
        }
    }

    #[test]
    fn one_run_tells_nothing_apart() {
        let grey = Picture::from_fn(2, 2, |_, _| Vec3::ONE);
        assert_eq!(Gram::of(&[&grey], &grey).unwrap().decompose(0.0, 0), None);
        assert_eq!(Gram::of(&[&grey], &Picture::black(1, 2)), Err(SizesDiffer));
    }
}
