//! How different two pictures are, and how sure a mean is.

mod agreement;
mod checkpoints;
mod confidence;
mod curve;
mod decomposition;
mod flip;
mod interval;

pub use agreement::{Agreement, Noisy};
pub use checkpoints::{Checkpoints, Passed};
pub use confidence::{Estimate, Spread};
pub use curve::{PowerLaw, time_to};
pub use decomposition::{Decomposition, Gram};
pub use flip::{FlipMap, PIXELS_PER_DEGREE, flip, heat};
pub use interval::Interval;
pub(crate) use interval::t_975;

use crate::Picture;

/// Keeps relative errors finite where the reference is black.
pub const RELATIVE_FLOOR: f64 = 0.01;

/// The difference of a linear picture from a reference, over all pixels and channels.
///
/// Pixels that are not finite in either picture are never skipped: they are counted, and all
/// measures are infinite as soon as there is one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Difference {
    /// Mean of the picture minus mean of the reference, over the mean of the reference: does light
    /// get lost?
    pub bias: f64,
    /// √ mean (x − r)².
    pub rmse: f64,
    /// mean (x − r)² / (r² + 0.01).
    pub rel_mse: f64,
    /// mean 2 |x − r| / (|x| + |r| + 0.01), 0..2.
    pub smape: f64,
    /// 99.9 % of the values differ by no more than this.
    pub percentile_999: f64,
    /// Largest |x − r|.
    pub max: f64,
    /// Values that are infinite or no number, in both pictures together; must be 0.
    pub non_finite: u64,
}

/// Pictures of different sizes, or without any pixel, cannot be compared.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SizesDiffer;

impl Difference {
    /// Compares a picture with a reference.
    ///
    /// # Errors
    /// [`SizesDiffer`] if there are no pairs of pixels.
    pub fn between(picture: &Picture, reference: &Picture) -> Result<Self, SizesDiffer> {
        if !picture.same_size(reference) || picture.pixels.is_empty() {
            return Err(SizesDiffer);
        }
        let pairs = picture.pixels.iter().zip(&reference.pixels);
        let pairs = pairs.map(|(x, r)| (x.as_dvec3(), r.as_dvec3()));
        let mut errors = Vec::with_capacity(3 * picture.pixels.len());
        let (mut sum, mut reference_sum, mut squares, mut relative, mut symmetric) = (0.0, 0.0, 0.0, 0.0, 0.0);
        let mut non_finite = 0;
        for (x, r) in pairs {
            for (x, r) in x.to_array().into_iter().zip(r.to_array()) {
                non_finite += u64::from(!x.is_finite()) + u64::from(!r.is_finite());
                let error = (x - r).abs();
                errors.push(error);
                sum += x;
                reference_sum += r;
                squares += error * error;
                relative += error * error / (r * r + RELATIVE_FLOOR);
                symmetric += 2.0 * error / (x.abs() + r.abs() + RELATIVE_FLOOR);
            }
        }
        let count = errors.len() as f64;
        let last = errors.len() - 1;
        let rank = ((0.999 * count).ceil() as usize).saturating_sub(1).min(last);
        errors.sort_unstable_by(f64::total_cmp);
        let honest = |value: f64| if non_finite == 0 { value } else { f64::INFINITY };
        let bias = if sum == reference_sum { 0.0 } else { sum / reference_sum - 1.0 };
        Ok(Self {
            bias: honest(bias),
            rmse: honest((squares / count).sqrt()),
            rel_mse: honest(relative / count),
            smape: honest(symmetric / count),
            percentile_999: honest(errors[rank]),
            max: honest(errors[last]),
            non_finite,
        })
    }
}

/// Number of values of a picture that are infinite or no number.
pub fn non_finite(picture: &Picture) -> u64 {
    let values = picture.pixels.iter().flat_map(|pixel| pixel.to_array());
    values.filter(|value| !value.is_finite()).count() as u64
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;

    fn flat(value: f32) -> Picture {
        Picture::from_fn(10, 10, |_, _| Vec3::splat(value))
    }

    #[test]
    fn equal_pictures_differ_by_nothing() {
        let d = Difference::between(&flat(0.5), &flat(0.5)).unwrap();
        assert_eq!(
            d,
            Difference { bias: 0.0, rmse: 0.0, rel_mse: 0.0, smape: 0.0, percentile_999: 0.0, max: 0.0, non_finite: 0 }
        );
    }

    #[test]
    fn a_known_difference_has_known_measures() {
        let d = Difference::between(&flat(1.5), &flat(1.0)).unwrap();
        assert_eq!((d.bias, d.rmse, d.percentile_999, d.max), (0.5, 0.5, 0.5, 0.5));
        assert!((d.rel_mse - 0.25 / 1.01).abs() < 1e-12);
        assert!((d.smape - 2.0 * 0.5 / 2.51).abs() < 1e-12);
    }

    #[test]
    fn one_bad_pixel_of_many_shows_in_the_maximum_not_in_the_percentile() {
        let mut picture = Picture::from_fn(100, 100, |_, _| Vec3::ONE);
        let reference = picture.clone();
        picture.pixels[1234].y = 101.0;
        let d = Difference::between(&picture, &reference).unwrap();
        assert_eq!((d.max, d.percentile_999), (100.0, 0.0));
        assert!((d.rmse - (1e4f64 / 3e4).sqrt()).abs() < 1e-12);
    }

    #[test]
    fn what_is_not_finite_is_never_skipped() {
        for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            let mut picture = flat(1.0);
            picture.pixels[3].z = bad;
            let d = Difference::between(&picture, &flat(1.0)).unwrap();
            assert_eq!((d.non_finite, d.rel_mse, d.rmse, d.max), (1, f64::INFINITY, f64::INFINITY, f64::INFINITY));
            assert_eq!(non_finite(&picture), 1);
        }
    }

    #[test]
    fn sizes_must_agree() {
        assert_eq!(Difference::between(&flat(1.0), &Picture::black(10, 9)), Err(SizesDiffer));
        assert_eq!(Difference::between(&Picture::default(), &Picture::default()), Err(SizesDiffer));
    }
}
