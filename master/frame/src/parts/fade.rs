//! The filter fades: where accumulated samples know better, they are shown as they are.
//!
//! The film keeps two independent halves. The filter changes a pixel by D; the two halves give two
//! independent values of D, whose difference tells how much of it is noise. The blend
//! `raw + w·D` has the least expected error at `w = noise² / D²` (both smoothed over a neighbourhood):
//! 1 while D is all noise, towards 0 as D turns out to be blur. As the noise vanishes, so does the
//! filter, and the limit is the raw picture.

use scenes::Camera;

use super::discontinuity::{Light, Scenery, mean_reflectance};
use super::planes::Planes;
use super::{Film, Filter};
use crate::Picture;

/// The mean radiance with its irradiance smoothed. `round` is the number of frames that a half
/// needs before it can be judged.
pub fn filtered(film: &Film, camera: &Camera, filter: &Filter, round: u32) -> Picture {
    let Some(edges) = filter.edges else { return film.mean() };
    let (Some(scenery), Some(light)) = (Scenery::of(film, camera), Light::of(film)) else { return film.mean() };
    let smooth = scenery.smooth(&light, filter.window, edges);
    let change = Change::of(film, &light, &smooth);
    let judged = filter.fade && film.halves().iter().all(|half| *half >= round.max(1));
    change.apply(film, judged)
}

/// Planes: the change of irradiance by channel, its square, and the part of the square that is noise.
struct Change(Planes<5>);

impl Change {
    fn of(film: &Film, light: &Light, smooth: &Light) -> Self {
        let (width, height) = (film.tiling().width as usize, film.tiling().height as usize);
        let [a, b] = film.halves().map(|half| half as f32 / film.frames().max(1) as f32);
        Self(Planes::fill(width, height, |y, [red, green, blue, square, noise]| {
            let (before, after) = (light.row(y), smooth.row(y));
            for (channel, change) in [red, green, blue].into_iter().enumerate() {
                let [before_a, before_b] = before.map(|half| &half[channel][..width]);
                let [after_a, after_b] = after.map(|half| &half[channel][..width]);
                let (change, square, noise) = (&mut change[..width], &mut square[..width], &mut noise[..width]);
                for x in 0..width {
                    let (da, db) = (after_a[x] - before_a[x], after_b[x] - before_b[x]);
                    let mean = a * da + b * db;
                    change[x] = mean;
                    square[x] += mean * mean;
                    noise[x] += a * b * (da - db) * (da - db);
                }
            }
        }))
    }

    fn apply(&self, film: &Film, judged: bool) -> Picture {
        let (width, height) = (film.tiling().width as usize, film.tiling().height as usize);
        let mut picture = film.mean();
        let Some((_, guides)) = film.surface() else { return picture };
        let weights = judged.then(|| self.weights(width, height));
        let frames = film.frames();
        use rayon::prelude::*;
        picture.pixels.par_chunks_mut(width).enumerate().for_each(|(y, row)| {
            let [red, green, blue, ..] = self.0.row(y);
            let weights = weights.as_ref().map(|weights| weights.row(y)[0]);
            for (x, pixel) in row.iter_mut().enumerate() {
                let weight = weights.map_or(1.0, |weights| weights[x]);
                let reflectance = mean_reflectance(guides[y * width + x].reflectance, frames).as_vec3();
                *pixel += reflectance * glam::Vec3::new(red[x], green[x], blue[x]) * weight;
            }
        });
        picture
    }

    /// How much of the change each pixel takes, 0..=1.
    fn weights(&self, width: usize, height: usize) -> Planes<1> {
        let below = Planes::<2>::fill(width, height, |y, [square, noise]| {
            for there in y.saturating_sub(REACH)..(y + REACH + 1).min(height) {
                let [.., squares, noises] = self.0.row(there);
                square.iter_mut().zip(squares).for_each(|(sum, value)| *sum += value);
                noise.iter_mut().zip(noises).for_each(|(sum, value)| *sum += value);
            }
        });
        Planes::fill(width, height, |y, [weights]| {
            let [squares, noises] = below.row(y);
            for (x, weight) in weights.iter_mut().enumerate() {
                let near = x.saturating_sub(REACH)..(x + REACH + 1).min(width);
                let square: f32 = squares[near.clone()].iter().sum();
                let noise: f32 = noises[near].iter().sum();
                *weight = if square > noise { noise / square } else { 1.0 };
            }
        })
    }
}

/// Neighbourhood that noise is judged by: 7×7 pixels.
const REACH: usize = 3;
