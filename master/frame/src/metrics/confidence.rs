//! How sure a mean is, judged by a few independent repetitions (IGI-11; algorithms.md D2).

use super::interval::Z_975;

/// An estimated relative mean squared error with its 95 % confidence interval.
///
/// It measures noise: the expected [`super::Difference::rel_mse`] between the raw, unfiltered picture
/// and the limit of its own settings; the filter makes the shown one better. What the settings leave out for ever (a clipped bound without compensation, a
/// longest path) is not in it. What replicates miss together has to be looked for otherwise.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Estimate {
    /// The estimate.
    pub rel_mse: f64,
    /// Lower end of the interval.
    pub low: f64,
    /// Upper end of the interval.
    pub high: f64,
}

impl Estimate {
    /// Of a picture in which so many frames have found no light at all, though there may be some. Laplace's rule of succession:
    /// the next one does with a chance of 1/(frames + 2), and then all light was missing.
    pub fn of_nothing(frames: u32) -> Self {
        Self { rel_mse: 1.0 / (f64::from(frames) + 2.0), low: 0.0, high: 1.0 }
    }
}

/// How R repetitions of a picture differ from their mean: all products of their relative deviations,
/// summed over values (pixels and channels).
#[derive(Clone, Debug, PartialEq)]
pub struct Spread {
    repetitions: usize,
    /// R×R, row by row; only the lower triangle is filled.
    products: Vec<f64>,
    values: u64,
}

impl Spread {
    /// Nothing summed up yet.
    pub fn new(repetitions: usize) -> Self {
        Self { repetitions, products: vec![0.0; repetitions * repetitions], values: 0 }
    }

    /// Adds a value: each repetition's deviation from the mean of all.
    pub fn add(&mut self, deviations: &[f64]) {
        for (r, a) in deviations.iter().enumerate() {
            for (s, b) in deviations[..=r].iter().enumerate() {
                self.products[r * self.repetitions + s] += a * b;
            }
        }
        self.values += 1;
    }

    /// Both together.
    #[must_use]
    pub fn plus(mut self, other: &Self) -> Self {
        self.products.iter_mut().zip(&other.products).for_each(|(sum, product)| *sum += product);
        self.values += other.values;
        self
    }

    /// The variance of the mean, and how well it is known.
    ///
    /// Pixels share light sources, so their errors are alike: a million pixels can be as little
    /// evidence as three. The number K of independent ways in which the repetitions differ shows in
    /// their products: n = R − 1 deviations that are free behave as n vectors of K components, whose
    /// matrix of products W (of Wishart's distribution) has E tr W² / E (tr W)² = (n + K + 1) / (nK + 2).
    /// The variance then follows χ² with nK degrees of freedom. As K is itself estimated from few
    /// products, half of it is relied on: the interval then holds the truth as often as it should.
    pub fn estimate(&self) -> Option<Estimate> {
        if self.repetitions < 2 || self.values == 0 {
            return None;
        }
        let (r, n) = (self.repetitions as f64, self.repetitions as f64 - 1.0);
        let at = |row: usize, column: usize| self.products[row * self.repetitions + column];
        let trace: f64 = (0..self.repetitions).map(|i| at(i, i)).sum();
        let rel_mse = trace / self.values as f64 / (r * n);
        if trace <= 0.0 {
            return Some(Estimate { rel_mse, low: rel_mse, high: rel_mse });
        }
        let squares: f64 =
            (0..self.repetitions).map(|i| at(i, i).powi(2) + 2.0 * (0..i).map(|j| at(i, j).powi(2)).sum::<f64>()).sum();
        let ratio = squares / (trace * trace);
        // With two repetitions there is nothing to compare: then assume the worst, one way.
        let ways = if n > 1.0 { (n + 1.0 - 2.0 * ratio) / (n * ratio - 1.0).max(f64::MIN_POSITIVE) } else { 1.0 };
        let degrees = n * (0.5 * ways).clamp(1.0, self.values as f64);
        let [low, high] = [Z_975, -Z_975].map(|z| rel_mse * degrees / chi_square_quantile(degrees, z));
        Some(Estimate { rel_mse, low, high })
    }
}

/// Quantile of χ² for a normal quantile z (Wilson and Hilferty 1931); a few per cent off for few degrees.
fn chi_square_quantile(degrees: f64, z: f64) -> f64 {
    let spread = 2.0 / (9.0 * degrees);
    degrees * (1.0 - spread + z * spread.sqrt()).max(0.05).powi(3)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Numbers that look normal: the sum of twelve uniform ones.
    struct Noise(u64);

    impl Noise {
        fn uniform(&mut self) -> f64 {
            self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (self.0 >> 11) as f64 / (1u64 << 53) as f64
        }

        fn normal(&mut self) -> f64 {
            (0..12).map(|_| self.uniform()).sum::<f64>() - 6.0
        }
    }

    /// Four pictures of 400 values that differ in so many ways, with variance 1 a value.
    fn spread(noise: &mut Noise, ways: usize) -> Spread {
        let pictures: Vec<Vec<f64>> = (0..4)
            .map(|_| {
                let errors: Vec<f64> = (0..ways).map(|_| noise.normal()).collect();
                (0..400).map(|value| errors[value % ways]).collect()
            })
            .collect();
        let mut spread = Spread::new(4);
        for value in 0..400 {
            let mean = pictures.iter().map(|picture| picture[value]).sum::<f64>() / 4.0;
            let deviations: Vec<f64> = pictures.iter().map(|picture| picture[value] - mean).collect();
            spread.add(&deviations);
        }
        spread
    }

    #[test]
    fn known_spread_gives_known_estimate() {
        // Two repetitions, 1 apart: sample variance ½, variance of their mean ¼.
        let mut spread = Spread::new(2);
        spread.add(&[0.5, -0.5]);
        let estimate = spread.estimate().unwrap();
        assert_eq!(estimate.rel_mse, 0.25);
        assert!(estimate.low < 0.06 && estimate.high > 10.0, "two repetitions tell next to nothing: {estimate:?}");
    }

    #[test]
    fn one_repetition_tells_nothing() {
        let mut spread = Spread::new(1);
        spread.add(&[0.0]);
        assert_eq!(spread.estimate(), None);
        assert_eq!(Spread::new(4).estimate(), None);
    }

    #[test]
    fn equal_repetitions_have_no_error() {
        let mut spread = Spread::new(4);
        spread.add(&[0.0; 4]);
        assert_eq!(spread.estimate(), Some(Estimate { rel_mse: 0.0, low: 0.0, high: 0.0 }));
    }

    #[test]
    fn the_interval_holds_the_truth_about_as_often_as_it_says() {
        // The truth: variance 1, mean of four.
        for ways in [1, 4, 20, 400] {
            let mut noise = Noise(ways as u64);
            let estimates: Vec<Estimate> = (0..200).filter_map(|_| spread(&mut noise, ways).estimate()).collect();
            let hits = estimates.iter().filter(|e| e.low <= 0.25 && 0.25 <= e.high).count();
            let mean = estimates.iter().map(|e| e.rel_mse).sum::<f64>() / 200.0;
            assert!(hits >= 184, "{ways} ways: {hits} of 200");
            assert!((mean - 0.25).abs() < 0.05, "{ways} ways: {mean}");
        }
        let width = |ways: usize| {
            let estimate = spread(&mut Noise(1), ways).estimate().unwrap();
            estimate.high / estimate.low
        };
        assert!(width(400) < 1.6 && width(1) > 5.0, "{} {}", width(400), width(1));
    }
}
