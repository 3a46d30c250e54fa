//! What a denoiser is given, and how much of what it makes of it is shown.
//!
//! A learned denoiser sees a noisy picture, reflectance and normals. It takes noise for noise as long as it is
//! independent from pixel to pixel, and interleaved light sets are not: their pattern looks like cloth. So it is given
//! a third of the way from the raw to the smoothed picture ([`SMOOTHED`]), which weakens the pattern before it is
//! looked for, and leaves the blotches of a smoothed picture too faint to be taken for light.
//!
//! **Fade.** What it gives is wrong by some bias b that samples do not take away; the raw picture, by noise of variance v
//! that they do. Where the film knows v, the picture shown is `raw + w·(denoised − raw)` with
//! `w = min(1, 2v / E[(denoised − raw)²])`. As the two err independently, that expectation is v + b², and this is the
//! largest weight at which the expected squared error w²b² + (1 − w)²v is at most v, that of the raw picture: the denoised
//! picture as it is while noise exceeds its bias, then ever less of it, and the limit is the raw picture. (Firmino,
//! Frisvad and Jensen, *Progressive denoising of Monte Carlo rendered images*, 2022, mix the two for the same end, by
//! learned weights.) Both are means over [`REACH`] pixels around, relative to the brightness of each, so that a lamp says
//! nothing about the wall beside it.

use glam::Vec3;
use rayon::prelude::*;

use crate::Picture;
use crate::front_end::{FrontEnd, Plane};
use crate::metrics::RELATIVE_FLOOR;

/// A picture with what a denoiser wants to know of it. All planes have the same size.
#[derive(Clone, Debug)]
pub struct Undenoised {
    /// What is to be denoised, W·m⁻²·sr⁻¹.
    pub radiance: Picture,
    /// Reflectance along the eye path, 0..=1.
    pub albedo: Picture,
    /// Mean normal, its components in −1..=1; 0 where there is none.
    pub normal: Picture,
    /// Never filtered, W·m⁻²·sr⁻¹.
    raw: Picture,
    /// Standard deviation of `raw`; `None` as long as it is unknown.
    deviation: Option<Picture>,
}

/// Share of the way from the raw to the smoothed picture. More: less pattern of light sets, more blotches.
const SMOOTHED: f32 = 1.0 / 3.0;
/// Pixels to each side that noise and bias are judged by. More: surer, and they bleed further around edges.
const REACH: usize = 5;

impl Undenoised {
    /// What a method has drawn so far. Without the method's own smoothing, if it has none; without guides, if it knows none.
    pub fn of<F: FrontEnd + ?Sized>(front: &mut F) -> Self {
        let (raw, mut radiance) = (front.show(Plane::Raw), front.show(Plane::Final));
        radiance.pixels.iter_mut().zip(&raw.pixels).for_each(|(pixel, raw)| *pixel = raw.lerp(*pixel, SMOOTHED));
        let mut albedo = front.show(Plane::Albedo);
        albedo.pixels.iter_mut().for_each(|pixel| *pixel = pixel.clamp(Vec3::ZERO, Vec3::ONE));
        let deviation = front.error().map(|_| front.show(Plane::Error));
        Self { radiance, albedo, normal: front.show(Plane::Normal), raw, deviation }
    }

    /// A picture of somebody else's, whose noise is unknown.
    pub fn foreign(raw: Picture, albedo: Picture, normal: Picture) -> Self {
        Self { radiance: raw.clone(), albedo, normal, raw, deviation: None }
    }

    /// What to show when `denoised` came back: see the module's documentation. Pixels that are no numbers stay raw.
    pub fn shown(&self, mut denoised: Picture) -> Picture {
        denoised.pixels.iter_mut().zip(&self.raw.pixels).for_each(|(pixel, raw)| {
            *pixel = if pixel.is_finite() { *pixel } else { *raw };
        });
        let Some(deviation) = &self.deviation else { return denoised };
        let (change, noise): (Vec<f32>, Vec<f32>) = (denoised.pixels.par_iter())
            .zip(&self.raw.pixels)
            .zip(&deviation.pixels)
            .map(|((denoised, raw), deviation)| {
                let mean = denoised.element_sum() / 3.0;
                let scale = 1.0 / (mean * mean + RELATIVE_FLOOR as f32);
                ((*denoised - *raw).length_squared() * scale, deviation.length_squared() * scale)
            })
            .unzip();
        let width = denoised.width as usize;
        let (change, noise) = (around(&change, width, REACH), around(&noise, width, REACH));
        let blend = |(((pixel, raw), change), noise): (((&mut Vec3, &Vec3), &f32), &f32)| {
            // Where they agree, either will do.
            let weight = if *change > 2.0 * *noise { 2.0 * *noise / *change } else { 1.0 };
            *pixel = raw.lerp(*pixel, weight);
        };
        let pixels = denoised.pixels.par_iter_mut().zip(&self.raw.pixels);
        pixels.zip(&change).zip(&noise).for_each(blend);
        denoised
    }
}

/// Sums over all pixels at most so many columns and rows away; those of the picture's edges have fewer.
pub(super) fn around(values: &[f32], width: usize, reach: usize) -> Vec<f32> {
    let width = width.max(1);
    let mut across = vec![0.0; values.len()];
    across.par_chunks_mut(width).zip(values.par_chunks(width)).for_each(|(sums, row)| {
        for (x, sum) in sums.iter_mut().enumerate() {
            *sum = row[x.saturating_sub(reach)..(x + reach + 1).min(row.len())].iter().sum();
        }
    });
    let height = values.len() / width;
    let mut sums = vec![0.0; values.len()];
    sums.par_chunks_mut(width).enumerate().for_each(|(y, sums)| {
        for y in y.saturating_sub(reach)..(y + reach + 1).min(height) {
            sums.iter_mut().zip(&across[y * width..]).for_each(|(sum, across)| *sum += across);
        }
    });
    sums
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIDE: u32 = 64;

    /// A grey ramp, its samples with noise of this deviation, and a denoised picture with this bias.
    fn example(deviation: f32, bias: f32) -> (Picture, Undenoised, Picture) {
        let truth = Picture::from_fn(SIDE, SIDE, |x, _| Vec3::splat(0.5 + x as f32 / SIDE as f32));
        // Anything that looks like chance and is not far from it: ±1 with the same probability.
        let sign =
            |x: u32, y: u32| if (x * 7919 + y * 104_729).wrapping_mul(2_654_435_769) >> 31 == 0 { 1.0 } else { -1.0 };
        let raw = Picture::from_fn(SIDE, SIDE, |x, y| truth.at(x, y) + deviation * sign(x, y));
        let denoised = Picture::from_fn(SIDE, SIDE, |x, y| truth.at(x, y) * (1.0 + bias));
        let known = Picture::from_fn(SIDE, SIDE, |_, _| Vec3::splat(deviation));
        let [albedo, normal] = [Vec3::ONE, Vec3::Z].map(|value| Picture::from_fn(SIDE, SIDE, |_, _| value));
        (truth, Undenoised { deviation: Some(known), ..Undenoised::foreign(raw, albedo, normal) }, denoised)
    }

    fn error(picture: &Picture, truth: &Picture) -> f64 {
        let squares = picture.pixels.iter().zip(&truth.pixels).map(|(a, b)| (*a - *b).as_dvec3().length_squared());
        squares.sum::<f64>() / f64::from(3 * SIDE * SIDE)
    }

    #[test]
    fn what_is_shown_is_never_worse_than_raw_and_ends_in_it() {
        let bias = 0.02;
        for deviation in [0.3, 0.1, 0.03, 0.01, 0.003, 0.001, 0.0] {
            let (truth, undenoised, denoised) = example(deviation, bias);
            let raw = error(&undenoised.raw, &truth);
            let (by_denoiser, shown) = (error(&denoised, &truth), error(&undenoised.shown(denoised), &truth));
            assert!(shown <= raw * 1.05 + 1e-12, "deviation {deviation}: shown {shown:e}, raw {raw:e}");
            assert!(shown <= by_denoiser.max(raw) * 1.05 + 1e-12, "deviation {deviation}: {shown:e}, {by_denoiser:e}");
            if deviation >= 0.1 {
                assert!(shown < 0.1 * raw, "where noise prevails, it is gone: {shown:e} of {raw:e}");
            }
        }
    }

    #[test]
    fn without_an_estimate_of_noise_the_denoised_picture_is_shown_as_it_is() {
        let (_, undenoised, denoised) = example(0.0, 0.5);
        assert_eq!(Undenoised { deviation: None, ..undenoised }.shown(denoised.clone()), denoised);
    }

    #[test]
    fn a_lamp_that_is_blurred_leaves_the_wall_beside_it_denoised() {
        let (_, mut undenoised, mut denoised) = example(0.1, 0.0);
        let lamp = (SIDE * SIDE / 2 + SIDE / 2) as usize;
        let was = undenoised.shown(denoised.clone());
        undenoised.raw.pixels[lamp] = Vec3::splat(1000.0);
        denoised.pixels[lamp] = Vec3::splat(900.0);
        let shown = undenoised.shown(denoised);
        let beside = lamp - 2;
        assert!(
            (shown.pixels[beside] - was.pixels[beside]).length() < 0.02,
            "{} {}",
            shown.pixels[beside],
            was.pixels[beside]
        );
    }

    #[test]
    fn pixels_that_are_no_numbers_stay_raw() {
        let (_, undenoised, mut denoised) = example(0.1, 0.0);
        denoised.pixels[7] = Vec3::new(f32::NAN, 1.0, 1.0);
        denoised.pixels[9] = Vec3::splat(f32::INFINITY);
        let shown = undenoised.shown(denoised);
        assert_eq!([shown.pixels[7], shown.pixels[9]], [undenoised.raw.pixels[7], undenoised.raw.pixels[9]]);
        assert!(shown.pixels.iter().all(|pixel| pixel.is_finite()));
    }
}
