//! The filter fades: where accumulated samples know better, they are shown as they are.
//!
//! The film keeps two independent halves. The filter changes a pixel by D; the two halves give two
//! independent values of D, whose difference tells how much of it is noise. The blend
//! `raw + w·D` has the least expected error at `w = noise² / D²` (both smoothed over a neighbourhood):
//! 1 while D is all noise, towards 0 as D turns out to be blur. As the noise vanishes, so does the
//! filter, and the limit is the raw picture.

use glam::Vec3;
use rayon::prelude::*;
use scenes::Camera;

use super::discontinuity::{Change, Means, RADIANCE};
use super::planes::MARGIN;
use super::{Film, Filter};
use crate::Picture;

/// Smooths the irradiance of a film. It owns the working memory, so that showing frame after
/// frame asks for none.
#[derive(Clone, Debug, Default)]
pub struct Smoother {
    means: Means,
    change: Change,
}

impl Smoother {
    /// The mean radiance with its irradiance smoothed. `round` is the number of frames that a half
    /// of the film needs before it can be judged.
    pub fn show(&mut self, film: &Film, camera: &Camera, filter: &Filter, round: u32) -> Picture {
        let Some(edges) = filter.edges.filter(|_| film.has_surface()) else { return film.picture() };
        self.means.take(film, camera);
        self.change.take(film, &self.means, filter.window, edges);
        let judged = filter.fade && film.halves().iter().all(|half| *half >= round.max(1));

        let (width, height) = (film.tiling().width, film.tiling().height);
        let mut picture = Picture::black(width, height);
        picture.pixels.par_chunks_mut(width.max(1) as usize).enumerate().for_each(|(y, row)| {
            let weights = if judged { self.weights(y, row.len(), height as usize) } else { vec![1.0; row.len()] };
            let inside = MARGIN..MARGIN + row.len();
            let [red, green, blue] = [0, 1, 2].map(|c| &self.means.0.row(y)[RADIANCE + c][inside.clone()]);
            let [by_red, by_green, by_blue] = [0, 1, 2].map(|c| &self.change.0.row(y)[c][inside.clone()]);
            for (x, pixel) in row.iter_mut().enumerate() {
                let change = Vec3::new(by_red[x], by_green[x], by_blue[x]);
                *pixel = Vec3::new(red[x], green[x], blue[x]) + change * weights[x];
            }
        });
        picture
    }

    /// How much of the change each pixel of a row takes, 0..=1.
    fn weights(&self, y: usize, width: usize, height: usize) -> Vec<f32> {
        let [squares, noises] = [3, 4].map(|plane| {
            // Down, then across; the row has as many more columns at both ends as that reaches.
            let mut down = vec![0.0; width + 2 * REACH];
            for there in y.saturating_sub(REACH)..(y + REACH + 1).min(height) {
                let values = &self.change.0.row(there)[plane][MARGIN..MARGIN + width];
                down[REACH..REACH + width].iter_mut().zip(values).for_each(|(sum, value)| *sum += value);
            }
            let mut across = vec![0.0; width];
            for shift in 0..=2 * REACH {
                across.iter_mut().zip(&down[shift..]).for_each(|(sum, value)| *sum += value);
            }
            across
        });
        let weight = |(square, noise): (&f32, &f32)| if square > noise { noise / square } else { 1.0 };
        squares.iter().zip(&noises).map(weight).collect()
    }
}

/// Neighbourhood that noise is judged by: 7×7 pixels.
const REACH: usize = 3;
