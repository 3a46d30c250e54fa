//! Whether two noisy pictures can be of the same thing: a z-test for each value, with Šidák's correction
//! for the number of values (algorithms.md D8; as Mitsuba 3's own tests do it).

use glam::DVec3;

/// What the test found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Agreement {
    /// Number of values compared: pixels times channels.
    pub values: usize,
    /// Largest |z|, z = difference over its standard deviation.
    pub largest: f64,
    /// Where.
    pub at: usize,
    /// |z| that exactly one picture in 1/significance would exceed somewhere if the two agreed.
    pub limit: f64,
    /// How many values are beyond the limit.
    pub beyond: usize,
    /// z of the sum of all values: small differences everywhere show here.
    pub of_mean: f64,
    /// Root mean square of z: 1 if the stated variances are right and the pictures agree.
    pub rms: f64,
}

/// A picture with the variance of each value.
pub type Noisy = (DVec3, DVec3);

impl Agreement {
    /// Tests `a` against `b`, pixel by pixel; `significance` is the probability of an alarm where both agree.
    /// Variances of zero are those of values known to within rounding: 2⁻²⁰ of them is allowed for.
    pub fn between(pairs: impl IntoIterator<Item = (Noisy, Noisy)>, significance: f64) -> Self {
        let mut found = Self { values: 0, largest: 0.0, at: 0, limit: 0.0, beyond: 0, of_mean: 0.0, rms: 0.0 };
        let mut all = Vec::new();
        let (mut difference, mut variance, mut squares) = (0.0, 0.0, 0.0);
        for ((a, var_a), (b, var_b)) in pairs {
            let rounding = (a.abs() + b.abs()) * (1.0 / f64::from(1 << 20));
            let spread = var_a + var_b + rounding * rounding;
            for channel in 0..3 {
                let d = a[channel] - b[channel];
                let z = if d == 0.0 { 0.0 } else { d / spread[channel].sqrt() };
                if z.abs() > found.largest || z.is_nan() {
                    (found.largest, found.at) = (z.abs(), all.len());
                }
                difference += d;
                variance += spread[channel];
                squares += z * z;
                all.push(z);
            }
        }
        found.values = all.len();
        let n = found.values.max(1) as f64;
        // 1 − (1 − α)^(1/n), without cancellation.
        let each = -libm::expm1(libm::log1p(-significance) / n);
        found.limit = two_sided(each);
        found.beyond = all.iter().filter(|z| z.abs() > found.limit || z.is_nan()).count();
        found.of_mean = if difference == 0.0 { 0.0 } else { difference / variance.sqrt() };
        found.rms = (squares / n).sqrt();
        found
    }
}

/// |z| that a standard normal variable exceeds with a probability.
fn two_sided(probability: f64) -> f64 {
    let (mut low, mut high) = (0.0, 40.0);
    for _ in 0..100 {
        let middle = 0.5 * (low + high);
        if libm::erfc(middle / std::f64::consts::SQRT_2) > probability { low = middle } else { high = middle }
    }
    high
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_are_those_of_the_tables() {
        assert!((two_sided(0.05) - 1.959_964).abs() < 1e-5);
        assert!((two_sided(2.7e-3) - 2.999_98).abs() < 1e-4);
        assert!((two_sided(1e-9) - 6.109_41).abs() < 1e-4);
    }

    /// Normal numbers, as sums of twelve even ones.
    fn noise(seed: u64) -> impl FnMut() -> f64 {
        let mut state = seed;
        move || {
            let mut uniform = || {
                state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                (state >> 11) as f64 / (1_u64 << 53) as f64
            };
            (0..12).map(|_| uniform()).sum::<f64>() - 6.0
        }
    }

    fn pairs(shift: f64, spot: f64) -> Vec<(Noisy, Noisy)> {
        let mut normal = noise(1);
        let mut value = |deviation: f64| DVec3::new(normal(), normal(), normal()) * deviation + 1.0;
        let mut pairs: Vec<_> =
            (0..10_000).map(|_| ((value(0.1) + shift, DVec3::splat(0.01)), (value(0.2), DVec3::splat(0.04)))).collect();
        pairs[77].0.0.y += spot;
        pairs
    }

    #[test]
    fn what_agrees_passes() {
        let found = Agreement::between(pairs(0.0, 0.0), 0.01);
        assert_eq!((found.values, found.beyond), (30_000, 0));
        assert!((found.rms - 1.0).abs() < 0.02 && found.of_mean.abs() < 3.0, "{found:?}");
        assert!((5.0..5.2).contains(&found.limit), "{found:?}");
    }

    #[test]
    fn one_wrong_pixel_is_found_and_so_is_a_hundredth_everywhere() {
        let spot = Agreement::between(pairs(0.0, 2.0), 0.01);
        assert!(spot.beyond == 1 && spot.at == 3 * 77 + 1, "{spot:?}");
        let haze = Agreement::between(pairs(0.01, 0.0), 0.01);
        assert!(haze.beyond == 0 && haze.of_mean > 5.0, "{haze:?}");
    }

    #[test]
    fn numbers_that_are_none_never_pass() {
        let nan = ((DVec3::splat(f64::NAN), DVec3::ONE), (DVec3::ONE, DVec3::ONE));
        assert_eq!(Agreement::between([nan], 0.01).beyond, 3);
    }
}
