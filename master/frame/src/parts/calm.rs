//! What the filter leaves noisy: pixels without partners.
//!
//! **Why.** Irradiance is smoothed over neighbours that see the same surface ([`super::discontinuity`]). Blinds and chair legs,
//! what is seen by way of glass and curved mirrors, and highlights have few such neighbours or none, and stay as they are:
//! salt and pepper.
//!
//! **How.** Non-local means over a dual buffer (Rousselle, Knaus and Zwicker, *Adaptive rendering with non-local means
//! filtering*, 2012): the film keeps two independent halves, both smoothed alike before they come here. Each half is averaged
//! over neighbours that look the same *in the other half*, by the distance of 3×3 pixels about them in units of their noise. So
//! a stray bright sample, which one half has, is found in neither's weights and shared by all around that are else alike; what
//! both halves show is kept.
//!
//! **Fade.** The filter errs by a bias b that samples do not take away, and the picture S that it is given by noise of
//! variance v that they do. So what is shown is `S + w·(F − S)` with `w = min(1, v / E[(F − S)²])`: as that expectation is about
//! v + b², this is the blend of least expected error, no worse than either; and as noise vanishes, so does the change.

use std::ops::Range;

use glam::Vec3;
use rayon::prelude::*;

use super::denoised::around;
use crate::Picture;
use crate::metrics::RELATIVE_FLOOR;

/// Neighbours are looked for so many pixels around. More: smoother, and slower by the square.
const REACH: usize = 2;
/// Pixels around two that are compared: 3×3.
const PATCH: usize = 1;
/// Pixels around that noise and bias are judged by.
const JUDGED: usize = 3;
/// Strips of so many rows are worked on at a time.
const STRIP: usize = 16;
/// By how much two pixels may differ, in units of their noise. More: smoother.
const BANDWIDTH: f32 = 0.5;

/// Relative variance that is believed of a pixel. More: what is very noisy is smoother, and edges of lamps are softer.
const NOISE_MOST: f32 = 0.25;

/// A smoothed picture, calmed. `apart` is by how much its first half exceeds its second; `shares` are those of the halves in
/// it.
pub(super) fn calmed(mut picture: Picture, apart: &Picture, shares: [f32; 2]) -> Picture {
    let (width, height) = (picture.width as usize, picture.height as usize);
    let halves = Halves::new(&picture, apart, shares);
    let filtered: Vec<Vec3> = (0..height.div_ceil(STRIP))
        .into_par_iter()
        .flat_map_iter(|strip| halves.filter(strip * STRIP..((strip + 1) * STRIP).min(height)))
        .collect();
    // By what is changed, and how much of that is the picture's own noise, relative to its brightness.
    let noise_of = shares[0] * shares[1];
    let (change, noise): (Vec<f32>, Vec<f32>) = picture
        .pixels
        .par_iter()
        .zip(&filtered)
        .zip(&apart.pixels)
        .map(|((pixel, filtered), apart)| {
            let mean = filtered.element_sum() / 3.0;
            let scale = 1.0 / (mean * mean + RELATIVE_FLOOR as f32);
            ((*filtered - *pixel).length_squared() * scale, noise_of * apart.length_squared() * scale)
        })
        .unzip();
    let (change, noise) = (around(&change, width, JUDGED), around(&noise, width, JUDGED));
    let blend = |(((pixel, filtered), change), noise): (((&mut Vec3, &Vec3), &f32), &f32)| {
        // Where they agree, either will do.
        let weight = if *change > *noise { *noise / *change } else { 1.0 };
        *pixel = pixel.lerp(*filtered, weight);
    };
    picture.pixels.par_iter_mut().zip(&filtered).zip(&change).zip(&noise).for_each(blend);
    picture
}

/// The two halves of a picture. Beyond its edges, they go on as they are there.
struct Halves {
    /// Columns of the picture, and of a padded row.
    width: usize,
    stride: usize,
    /// By half: the colours, and the mean of the channels.
    colour: [Vec<Vec3>; 2],
    grey: [Vec<f32>; 2],
    /// Variance of the grey of a half.
    variance: Vec<f32>,
    shares: [f32; 2],
}

/// Columns and rows beyond the edges.
const MARGIN: usize = REACH + PATCH;

impl Halves {
    fn new(picture: &Picture, apart: &Picture, shares: [f32; 2]) -> Self {
        let (width, height) = (picture.width as usize, picture.height as usize);
        let stride = width + 2 * MARGIN;
        let square = |colour: &Vec3| (colour.element_sum() / 3.0).powi(2);
        let own = |(pixel, apart): (&Vec3, &Vec3)| {
            (0.5 * square(apart) / (square(pixel) + f32::MIN_POSITIVE)).min(NOISE_MOST)
        };
        let own: Vec<f32> = picture.pixels.iter().zip(&apart.pixels).map(own).collect();
        let count = ((2 * PATCH + 1) * (2 * PATCH + 1)) as f32;
        // Two halves tell a single pixel's noise badly; relative to its brightness, neighbours tell it as well, and the edge of
        // a lamp does not make what is beside it seem noisy.
        let around = around(&own, width, PATCH);
        let inside = |at: usize, len: usize| at.saturating_sub(MARGIN).min(len - 1);
        let places = (0..height + 2 * MARGIN).flat_map(|y| (0..stride).map(move |x| (x, y)));
        let places: Vec<usize> = places.map(|(x, y)| inside(y, height) * width + inside(x, width)).collect();
        let [a, b] = shares;
        let colour = [b, -a].map(|part| -> Vec<Vec3> {
            places.iter().map(|from| picture.pixels[*from] + apart.pixels[*from] * part).collect()
        });
        let grey = colour.each_ref().map(|half| half.iter().map(|colour| colour.element_sum() / 3.0).collect());
        let variance = places.iter().map(|from| around[*from] / count * square(&picture.pixels[*from])).collect();
        Self { width, stride, colour, grey, variance, shares }
    }

    /// Where a pixel is.
    fn at(&self, x: usize, y: usize) -> usize {
        (y + MARGIN) * self.stride + MARGIN + x
    }

    /// Both halves of some rows, filtered and put together.
    fn filter(&self, rows: Range<usize>) -> Vec<Vec3> {
        let count = rows.len() * self.width;
        let mut mean = vec![Vec3::ZERO; count];
        for half in [0, 1] {
            let mut sums = vec![Vec3::ZERO; count];
            let mut weights = vec![0.0_f32; count];
            let reach = REACH as isize;
            for (dy, dx) in (-reach..=reach).flat_map(|dy| (-reach..=reach).map(move |dx| (dy, dx))) {
                let offset = dy * self.stride as isize + dx;
                let similar = (dx != 0 || dy != 0).then(|| self.similar(1 - half, &rows, offset));
                for (row, y) in rows.clone().enumerate() {
                    let from = self.at(0, y).wrapping_add_signed(offset);
                    let there = &self.colour[half][from..from + self.width];
                    let span = row * self.width..(row + 1) * self.width;
                    let (sums, weights) = (&mut sums[span.clone()], &mut weights[span.clone()]);
                    let similar = similar.as_ref().map(|similar| &similar[span]);
                    for (x, there) in there.iter().enumerate() {
                        let weight = similar.map_or(1.0, |similar| similar[x]);
                        sums[x] += *there * weight;
                        weights[x] += weight;
                    }
                }
            }
            let share = self.shares[half];
            mean.iter_mut()
                .zip(sums.iter().zip(&weights))
                .for_each(|(mean, (sum, weight))| *mean += *sum * (share / weight));
        }
        mean
    }

    /// How much the surroundings of the pixels of some rows look like those of others so far away, in one half: 0..=1.
    fn similar(&self, half: usize, rows: &Range<usize>, offset: isize) -> Vec<f32> {
        let grey = &self.grey[half];
        let wide = self.width + 2 * PATCH;
        // Differences, with a margin, summed along rows.
        let mut along = vec![0.0_f32; (rows.len() + 2 * PATCH) * self.width];
        let mut row = vec![0.0_f32; wide];
        for (index, along) in along.chunks_mut(self.width).enumerate() {
            let here = (rows.start + index + MARGIN - PATCH) * self.stride + MARGIN - PATCH;
            let there = here.wrapping_add_signed(offset);
            let mine = grey[here..here + wide].iter().zip(&self.variance[here..here + wide]);
            let theirs = grey[there..there + wide].iter().zip(&self.variance[there..there + wide]);
            for (far, ((mine, own), (theirs, other))) in row.iter_mut().zip(mine.zip(theirs)) {
                // The greater noise of what is far brighter, such as the edge of a lamp, is no reason to take it in.
                let (apart, noise) = (mine - theirs, own + own.min(*other));
                let floor = 1e-6 * (mine * mine + theirs * theirs) + f32::MIN_POSITIVE;
                *far = (apart * apart - noise) / (floor + BANDWIDTH * BANDWIDTH * noise);
            }
            for (x, sum) in along.iter_mut().enumerate() {
                *sum = row[x..x + 2 * PATCH + 1].iter().sum();
            }
        }
        let count = ((2 * PATCH + 1) * (2 * PATCH + 1)) as f32;
        let mut similar = vec![0.0; rows.len() * self.width];
        for (index, similar) in similar.chunks_mut(self.width).enumerate() {
            for (x, weight) in similar.iter_mut().enumerate() {
                let far: f32 = (index..index + 2 * PATCH + 1).map(|row| along[row * self.width + x]).sum();
                // Like e^(−far), and cheap.
                let near = (1.0 - far / count * 0.25).clamp(0.0, 1.0);
                *weight = near * near * near * near;
            }
        }
        similar
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIDE: u32 = 48;

    /// Any number in 0..1.
    fn random(x: u32, y: u32, salt: u32) -> f32 {
        let mut hash = (x * 7919 + y * 104_729 + salt * 15_485_863).wrapping_mul(0x9e37_79b9);
        hash = (hash ^ hash >> 15).wrapping_mul(0x85eb_ca6b);
        (hash ^ hash >> 13) as f32 / 4_294_967_296.0
    }

    /// Bars of one pixel before a ramp, and two halves of it with some noise: mostly darker, and far brighter at times.
    fn example(noise: f32) -> (Picture, Picture, Picture) {
        let truth = Picture::from_fn(SIDE, SIDE, |x, y| {
            Vec3::splat(if x % 6 == 3 && y > SIDE / 2 { 2.0 } else { 0.3 + 0.4 * x as f32 / SIDE as f32 })
        });
        let [a, b] = [1, 2].map(|half| {
            Picture::from_fn(SIDE, SIDE, |x, y| {
                let stray = if random(x, y, half) < 0.05 { 19.0 } else { -1.0 };
                truth.at(x, y) * (1.0 + noise * stray / 19.0_f32.sqrt())
            })
        });
        let picture = Picture::from_fn(SIDE, SIDE, |x, y| (a.at(x, y) + b.at(x, y)) * 0.5);
        let apart = Picture::from_fn(SIDE, SIDE, |x, y| a.at(x, y) - b.at(x, y));
        (truth, picture, apart)
    }

    fn error(picture: &Picture, truth: &Picture) -> f64 {
        let squares = picture.pixels.iter().zip(&truth.pixels).map(|(a, b)| (*a - *b).as_dvec3().length_squared());
        squares.sum::<f64>() / f64::from(3 * SIDE * SIDE)
    }

    #[test]
    fn noise_is_shared_lines_stay_and_the_limit_is_the_picture_itself() {
        for noise in [1.0, 0.3, 0.1, 0.03, 0.01] {
            let (truth, picture, apart) = example(noise);
            let (raw, shown) = (error(&picture, &truth), error(&calmed(picture, &apart, [0.5; 2]), &truth));
            assert!(shown <= raw * 1.02, "noise {noise}: {shown:e}, raw {raw:e}");
            if noise >= 0.1 {
                assert!(shown < 0.5 * raw, "noise {noise}: {shown:e}, raw {raw:e}");
            }
        }
        let (truth, picture, apart) = example(0.0);
        assert_eq!(calmed(picture, &apart, [0.5; 2]), truth);
    }

    #[test]
    fn no_light_is_lost() {
        let (truth, picture, apart) = example(0.3);
        let mean = |picture: &Picture| picture.pixels.iter().map(|pixel| pixel.x).sum::<f32>();
        let (before, after) = (mean(&picture), mean(&calmed(picture.clone(), &apart, [0.5; 2])));
        assert!((after / before - 1.0).abs() < 0.02, "{after} of {before}, {} in truth", mean(&truth));
    }
}
