//! The filter at work, and how it fades: where accumulated samples know better, they are shown as they are.
//!
//! The film keeps two independent halves. The filter changes a pixel by D; the two halves give two
//! independent values of D, whose difference tells how much of it is noise. The blend
//! `raw + w·D` has the least expected error at `w = noise² / D²`: 1 while D is all noise, towards 0 as D turns
//! out to be blur. As the noise vanishes, so does the filter, and the limit is the raw picture.
//!
//! Both are known only from a neighbourhood, where the pixels of one light set err alike: some nine independent
//! values each, so that their ratio strays by a factor of three where there is no blur at all, and a blend that
//! trusts it leaves the sets' pattern in plain walls. So the filter stays whole until D is surely more than noise
//! ([`SURE`]), and fades twice as fast from there: `w = (SURE · noise² / D²)²`, which meets the best weight where
//! D² is ten times its noise.
//!
//! A picture is shown in strips, each from top to bottom: sums are read once, and what lies between them and the
//! picture never leaves the processor's cache.

use std::ops::Range;

use glam::Vec3;
use rayon::prelude::*;
use scenes::Camera;

use super::discontinuity::{CHANGES, GUIDED, NOISE, SQUARE, Window};
use super::film::mean;
use super::planes::{MARGIN, Rolling};
use super::{Film, Filter, Guide, Smoother};
use crate::Picture;

/// The film's mean radiance with its irradiance smoothed. `round` is the number of frames that a half of the film
/// needs before it can be judged.
pub fn smoothed(film: &Film, camera: &Camera, filter: &Filter, round: u32) -> Picture {
    let Some(edges) = filter.edges.filter(|_| film.has_surface()) else { return film.picture() };
    let window = Window::new(film, camera, filter.window, edges);
    let judged = can_be_judged(film, filter, round);

    let (width, height) = (film.tiling().width, film.tiling().height as usize);
    let mut picture = Picture::black(width, film.tiling().height);
    let rows = height.div_ceil(rayon::current_num_threads() * STRIPS_PER_THREAD).max(STRIP_ROWS_MIN);
    picture.pixels.par_chunks_mut(rows * width as usize).enumerate().for_each(|(index, pixels)| {
        let mut strip = Strip::new(&window, width as usize, height, judged);
        strip.draw(index * rows..index * rows + pixels.len() / width as usize, pixels);
    });
    picture
}

/// The same by somebody else, where there is somebody who can.
pub fn smoothed_by(
    smoother: Option<&dyn Smoother>,
    film: &Film,
    camera: &Camera,
    filter: &Filter,
    round: u32,
) -> Picture {
    let guide = || Guide::of(film, camera, filter, can_be_judged(film, filter, round));
    let elsewhere = smoother.and_then(|smoother| smoother.smooth(&guide()?));
    elsewhere.unwrap_or_else(|| smoothed(film, camera, filter, round))
}

fn can_be_judged(film: &Film, filter: &Filter, round: u32) -> bool {
    filter.fade && film.halves().iter().all(|half| *half >= round.max(1))
}

/// Strips repeat what they need of their neighbours' rows: few, but enough that no thread waits for long.
const STRIPS_PER_THREAD: usize = 4;
const STRIP_ROWS_MIN: usize = 16;

/// Neighbourhood that noise is judged by: 7×7 pixels.
const REACH: usize = 3;

/// By how much D² must exceed its noise before it is believed: the 95th percentile of F with 9 and 9 degrees of freedom.
const SURE: f32 = 3.2;

/// Some rows of the picture on their way from sums to pixels.
struct Strip<'a> {
    window: &'a Window<'a>,
    width: usize,
    height: usize,
    /// How many rows further changes must be known: as far as noise is judged by, or 0 if it is not.
    ahead: usize,
    means: Rolling<GUIDED>,
    changes: Rolling<CHANGES>,
}

impl<'a> Strip<'a> {
    fn new(window: &'a Window<'a>, width: usize, height: usize, judged: bool) -> Self {
        let (reach, ahead) = (window.reach(), if judged { REACH } else { 0 });
        // A row of changes needs the means around it; a row of pixels, the changes around it and its own means.
        let means = Rolling::new(width, reach + reach.max(ahead) + 1);
        Self { window, width, height, ahead, means, changes: Rolling::new(width, 2 * ahead + 1) }
    }

    /// Draws some rows, with the widest vectors that the machine has. They compute the same bits: no operation is
    /// fused or reordered.
    fn draw(&mut self, rows: Range<usize>, pixels: &mut [Vec3]) {
        #[cfg(target_arch = "x86_64")]
        if std::arch::is_x86_feature_detected!("avx2") {
            // SAFETY: the machine has just said that it has AVX2.
            return unsafe { self.draw_avx2(rows, pixels) };
        }
        self.draw_rows(rows, pixels);
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2")]
    fn draw_avx2(&mut self, rows: Range<usize>, pixels: &mut [Vec3]) {
        self.draw_rows(rows, pixels);
    }

    #[inline(always)]
    fn draw_rows(&mut self, rows: Range<usize>, pixels: &mut [Vec3]) {
        let (reach, ahead, judged) = (self.window.reach(), self.ahead, self.ahead > 0);
        self.means.begin(rows.start.saturating_sub(reach + ahead));
        self.changes.begin(rows.start.saturating_sub(ahead));
        let mut weights = Weights::new(self.width);
        for (y, pixels) in rows.zip(pixels.chunks_mut(self.width)) {
            while self.changes.next() < (y + ahead + 1).min(self.height) {
                let row = self.changes.next();
                while self.means.next() < (row + reach + 1).min(self.height) {
                    self.window.read(self.means.next(), judged, self.means.push());
                }
                if judged {
                    self.window.smooth::<true>(row, &self.means, self.changes.push());
                } else {
                    self.window.smooth::<false>(row, &self.means, self.changes.push());
                }
            }
            if judged {
                weights.judge(&self.changes, y.saturating_sub(ahead)..(y + ahead + 1).min(self.height));
            }
            let inside = MARGIN..MARGIN + self.width;
            let [red, green, blue] = [0, 1, 2].map(|c| &self.means.row(y).plane(mean::RADIANCE + c)[inside.clone()]);
            let [by_red, by_green, by_blue] = [0, 1, 2].map(|c| &self.changes.row(y).plane(c)[inside.clone()]);
            for (x, (pixel, weight)) in pixels.iter_mut().zip(&weights.weights).enumerate() {
                let change = Vec3::new(by_red[x], by_green[x], by_blue[x]);
                *pixel = Vec3::new(red[x], green[x], blue[x]) + change * *weight;
            }
        }
    }
}

/// How much of the change each pixel of a row takes, 0..=1.
struct Weights {
    weights: Vec<f32>,
    /// Sums over the neighbourhood.
    squares: Vec<f32>,
    noises: Vec<f32>,
    /// Sums down the columns; with as many more at both ends as the neighbourhood reaches.
    down: Vec<f32>,
}

impl Weights {
    /// All of it.
    fn new(width: usize) -> Self {
        Self {
            weights: vec![1.0; width],
            squares: vec![0.0; width],
            noises: vec![0.0; width],
            down: vec![0.0; width + 2 * REACH],
        }
    }

    /// The share of noise in the change, in the mean over the neighbourhood.
    #[inline(always)]
    fn judge(&mut self, changes: &Rolling<CHANGES>, rows: Range<usize>) {
        let width = self.weights.len();
        for (plane, across) in [(SQUARE, &mut self.squares), (NOISE, &mut self.noises)] {
            let down = &mut self.down[REACH..REACH + width];
            down.fill(0.0);
            for y in rows.clone() {
                let values = &changes.row(y).plane(plane)[MARGIN..MARGIN + width];
                down.iter_mut().zip(values).for_each(|(sum, value)| *sum += value);
            }
            across.fill(0.0);
            for shift in 0..=2 * REACH {
                across.iter_mut().zip(&self.down[shift..]).for_each(|(sum, value)| *sum += value);
            }
        }
        for ((weight, square), noise) in self.weights.iter_mut().zip(&self.squares).zip(&self.noises) {
            let noise = noise * SURE;
            *weight = if *square > noise { (noise / square) * (noise / square) } else { 1.0 };
        }
    }
}
