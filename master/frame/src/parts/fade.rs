//! The filter at work, and how it fades: where accumulated samples know better, they are shown as they are.
//!
//! The filter changes a pixel by D, of which a part is noise taken away and a part is blur. The film keeps two
//! independent halves: they give two independent values of D, whose difference tells how much of D is noise at
//! least. It may be more: the pixels of a light set err alike, so that a neighbourhood knows some nine independent values,
//! and a lamp that the same set has met in both halves is no proof of a bright spot. Hence a second question, whether the
//! change *stays when it is averaged over the window*. The window has all sets in it, so what sets differ by is gone
//! then, and so is noise that pixels have of their own; what stays is what smoothing does to the picture itself.
//! For a slope that bends, all of D stays; of a step or a line, a tenth of its square ([`KEPT`]). So
//!
//! ```text
//! blur²  = (D̄² − its noise) / KEPT        D̄: the window's mean of D
//! noise² = the larger of what the halves tell, and D² − blur²
//! shown  = raw + w·D,   w = noise² / (noise² + blur²)
//! ```
//!
//! which is the blend of least expected error, all squares being means over a neighbourhood. As noise vanishes, so does
//! the filter, and the limit is the raw picture.
//!
//! A picture is shown in strips, each from top to bottom: sums are read once, and what lies between them and the
//! picture never leaves the processor's cache.

use std::ops::Range;

use glam::Vec3;
use rayon::prelude::*;
use scenes::Camera;

use super::calm::calmed;
use super::discontinuity::{APART, CHANGES, GUIDED, HALVES, NOISE, SQUARE, Window};
use super::film::mean;
use super::planes::{MARGIN, Rolling};
use super::{Film, Filter, Guide, Smoother};
use crate::Picture;

/// The film's mean radiance with its irradiance smoothed. `round` is the number of frames that a half of the film
/// needs before it can be judged.
pub fn smoothed(film: &Film, camera: &Camera, filter: &Filter, round: u32) -> Picture {
    drawn(film, camera, filter, round, None)
}

/// The same, and calmed ([`super::calm`]).
pub fn shown(film: &Film, camera: &Camera, filter: &Filter, round: u32) -> Picture {
    if !can_be_judged(film, filter, round) || filter.edges.is_none() || !film.has_surface() {
        return smoothed(film, camera, filter, round);
    }
    let mut apart = Picture::black(film.tiling().width, film.tiling().height);
    let picture = drawn(film, camera, filter, round, Some(&mut apart));
    let frames = film.frames() as f32;
    calmed(picture, &apart, film.halves().map(|half| half as f32 / frames))
}

/// The smoothed picture; and by how much more radiance it would have if all frames were like the first half, than if all were
/// like the second.
fn drawn(film: &Film, camera: &Camera, filter: &Filter, round: u32, apart: Option<&mut Picture>) -> Picture {
    let Some(edges) = filter.edges.filter(|_| film.has_surface()) else { return film.picture() };
    let window = Window::new(film, camera, filter.window, edges);
    let judged = can_be_judged(film, filter, round);

    let (width, height) = (film.tiling().width, film.tiling().height as usize);
    let mut picture = Picture::black(width, film.tiling().height);
    let rows = height.div_ceil(rayon::current_num_threads() * STRIPS_PER_THREAD).max(STRIP_ROWS_MIN);
    let len = rows * width as usize;
    let mut strips: Vec<_> = picture.pixels.chunks_mut(len).map(|pixels| (pixels, &mut [][..])).collect();
    if let Some(apart) = apart.filter(|_| judged) {
        strips.iter_mut().zip(apart.pixels.chunks_mut(len)).for_each(|((_, own), apart)| *own = apart);
    }
    strips.into_par_iter().enumerate().for_each(|(index, (pixels, apart))| {
        let mut strip = Strip::new(&window, width as usize, height, judged);
        strip.draw(index * rows..index * rows + pixels.len() / width as usize, pixels, apart);
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
    elsewhere.unwrap_or_else(|| shown(film, camera, filter, round))
}

fn can_be_judged(film: &Film, filter: &Filter, round: u32) -> bool {
    filter.fade && film.halves().iter().all(|half| *half >= round.max(1))
}

/// Strips repeat what they need of their neighbours' rows: few, but enough that no thread waits for long.
const STRIPS_PER_THREAD: usize = 4;
const STRIP_ROWS_MIN: usize = 16;

/// Neighbourhood that noise is judged by: 7×7 pixels.
const REACH: usize = 3;

/// The part of D² that stays in D̄² where a line is blurred by a window of 3 (a step: 1/9; by a window of 5: 1/11). Less: fine
/// detail is sharp sooner, and more of the noise is taken for it.
const KEPT: f32 = 0.07;

/// By how much D̄² must exceed its noise to be believed. More: plain walls are smoother, detail is sharp later.
const SURE: f32 = 3.0;

/// By how much the noise in D² may exceed what two halves of 1, 2, … frames tell of it: the 95th percentile of F with so
/// many degrees of freedom each.
const UNSURE: [f32; 9] = [161.0, 19.0, 9.3, 6.4, 5.1, 4.3, 3.8, 3.4, 3.2];

/// By how much the noise in D² may exceed what two halves of at least so many frames tell of it.
pub(super) fn noise_at_most(frames: u32) -> f32 {
    UNSURE[(frames.max(1) as usize - 1).min(UNSURE.len() - 1)]
}

/// Planes of [`Strip::blurs`]: D̄², and the part of it that is noise; of all channels together.
const BLURS: usize = 2;

/// Some rows of the picture on their way from sums to pixels.
struct Strip<'a> {
    window: &'a Window<'a>,
    width: usize,
    height: usize,
    /// How many rows further blur must be known: as far as noise is judged by, or 0 if it is not.
    ahead: usize,
    means: Rolling<GUIDED>,
    changes: Rolling<CHANGES>,
    blurs: Rolling<BLURS>,
    /// The window's means of a row of both halves' changes, and sums on the way to them.
    scratch: [Vec<f32>; 3],
}

impl<'a> Strip<'a> {
    fn new(window: &'a Window<'a>, width: usize, height: usize, judged: bool) -> Self {
        let (reach, ahead) = (window.reach(), if judged { REACH } else { 0 });
        // A row of pixels needs the blur around it; a row of blur, the changes around it; a row of changes, the means.
        let changes = if judged { (2 * ahead).max(reach) + reach + 1 } else { 1 };
        let means = Rolling::new(width, if judged { ahead + reach } else { reach } + reach + 1);
        Self {
            window,
            width,
            height,
            ahead,
            means,
            changes: Rolling::new(width, changes),
            blurs: Rolling::new(width, 2 * ahead + 1),
            scratch: [0; 3].map(|_| vec![0.0; MARGIN + width + MARGIN]),
        }
    }

    /// Draws some rows, with the widest vectors that the machine has. They compute the same bits: no operation is
    /// fused or reordered.
    fn draw(&mut self, rows: Range<usize>, pixels: &mut [Vec3], apart: &mut [Vec3]) {
        #[cfg(target_arch = "x86_64")]
        if std::arch::is_x86_feature_detected!("avx2") {
            // SAFETY: the machine has just said that it has AVX2.
            return unsafe { self.draw_avx2(rows, pixels, apart) };
        }
        self.draw_rows(rows, pixels, apart);
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2")]
    fn draw_avx2(&mut self, rows: Range<usize>, pixels: &mut [Vec3], apart: &mut [Vec3]) {
        self.draw_rows(rows, pixels, apart);
    }

    #[inline(always)]
    fn draw_rows(&mut self, rows: Range<usize>, pixels: &mut [Vec3], apart: &mut [Vec3]) {
        let (reach, ahead, judged) = (self.window.reach(), self.ahead, self.ahead > 0);
        let lead = if judged { ahead + reach } else { 0 };
        self.means.begin(rows.start.saturating_sub(lead + reach));
        self.changes.begin(rows.start.saturating_sub(lead));
        self.blurs.begin(rows.start.saturating_sub(ahead));
        let mut weights = Weights::new(self.width, noise_at_most(self.window.frames_in_half()));
        let mut aparts = apart.chunks_mut(self.width);
        for (y, pixels) in rows.zip(pixels.chunks_mut(self.width)) {
            if judged {
                while self.blurs.next() < (y + ahead + 1).min(self.height) {
                    let row = self.blurs.next();
                    self.change::<true>(row + reach + 1);
                    self.blur(row);
                }
                let around = y.saturating_sub(ahead)..(y + ahead + 1).min(self.height);
                weights.judge(&self.changes, &self.blurs, around);
            } else {
                self.change::<false>(y + 1);
            }
            let inside = MARGIN..MARGIN + self.width;
            let [red, green, blue] = [0, 1, 2].map(|c| &self.means.row(y).plane(mean::RADIANCE + c)[inside.clone()]);
            let [by_red, by_green, by_blue] = [0, 1, 2].map(|c| &self.changes.row(y).plane(c)[inside.clone()]);
            for (x, (pixel, weight)) in pixels.iter_mut().zip(&weights.weights).enumerate() {
                let change = Vec3::new(by_red[x], by_green[x], by_blue[x]);
                *pixel = Vec3::new(red[x], green[x], blue[x]) + change * *weight;
            }
            if let Some(apart) = aparts.next() {
                self.window.halves_apart(y, apart);
                let changes = [0, 1, 2].map(|c| &self.changes.row(y).plane(APART + c)[inside.clone()]);
                for (x, (apart, weight)) in apart.iter_mut().zip(&weights.weights).enumerate() {
                    *apart += Vec3::from_array(changes.map(|changes| changes[x])) * *weight;
                }
            }
        }
    }

    /// What smoothing changes, down to above row `end`.
    #[inline(always)]
    fn change<const APART: bool>(&mut self, end: usize) {
        let reach = self.window.reach();
        while self.changes.next() < end.min(self.height) {
            let row = self.changes.next();
            while self.means.next() < (row + reach + 1).min(self.height) {
                self.window.read(self.means.next(), APART, self.means.push());
            }
            self.window.smooth::<APART>(row, &self.means, self.changes.push());
        }
    }

    /// What is left of a row of changes in the means over the window.
    #[inline(always)]
    fn blur(&mut self, y: usize) {
        let Self { window, changes, blurs, scratch: [mean_a, mean_b, down], .. } = self;
        for (plane, mean) in HALVES.into_iter().zip([&mut *mean_a, &mut *mean_b]) {
            window.mean((y, plane), changes, down, mean);
        }
        let [a, b] = window.shares();
        let [squares, noises] = blurs.push();
        for ((square, noise), (mean_a, mean_b)) in squares.iter_mut().zip(noises).zip(mean_a.iter().zip(mean_b.iter()))
        {
            let (both, difference) = (a * mean_a + b * mean_b, mean_a - mean_b);
            // Where all channels change alike, the square of their sum is three times the sum of their squares.
            *square = both * both / 3.0;
            *noise = a * b * difference * difference / 3.0;
        }
    }
}

/// How much of the change each pixel of a row takes, 0..=1.
struct Weights {
    weights: Vec<f32>,
    /// By how much noise may exceed what the halves tell.
    most: f32,
    /// Sums over the neighbourhood: D², its noise, D̄² and its noise.
    sums: [Vec<f32>; 4],
    /// Sums down the columns; with as many more at both ends as the neighbourhood reaches.
    down: Vec<f32>,
}

impl Weights {
    /// All of it.
    fn new(width: usize, most: f32) -> Self {
        Self {
            most,
            weights: vec![1.0; width],
            sums: [0; 4].map(|_| vec![0.0; width]),
            down: vec![0.0; width + 2 * REACH],
        }
    }

    /// The share of noise in the change, in the mean over the neighbourhood.
    #[inline(always)]
    fn judge(&mut self, changes: &Rolling<CHANGES>, blurs: &Rolling<BLURS>, rows: Range<usize>) {
        let [squares, noises, blur_squares, blur_noises] = &mut self.sums;
        for (plane, sums) in [(SQUARE, &mut *squares), (NOISE, &mut *noises)] {
            around(&mut self.down, rows.clone().map(|y| changes.row(y).plane(plane)), sums);
        }
        for (plane, sums) in [&mut *blur_squares, &mut *blur_noises].into_iter().enumerate() {
            around(&mut self.down, rows.clone().map(|y| blurs.row(y).plane(plane)), sums);
        }
        let changes = squares.iter().zip(noises.iter());
        let blurs = blur_squares.iter().zip(blur_noises.iter());
        for ((weight, (square, noise)), (blur_square, blur_noise)) in self.weights.iter_mut().zip(changes).zip(blurs) {
            let blur = (blur_square - SURE * blur_noise).max(0.0) / KEPT;
            let noise = noise.max((square - blur).min(self.most * noise));
            *weight = if blur > 0.0 { noise / (noise + blur) } else { 1.0 };
        }
    }
}

/// Sums over the neighbourhood of a row, whose rows are given, into `sums`.
#[inline(always)]
fn around<'a>(down: &mut [f32], rows: impl Iterator<Item = &'a [f32]>, sums: &mut [f32]) {
    let width = sums.len();
    let inside = &mut down[REACH..REACH + width];
    inside.fill(0.0);
    for values in rows {
        inside.iter_mut().zip(&values[MARGIN..MARGIN + width]).for_each(|(sum, value)| *sum += value);
    }
    sums.fill(0.0);
    for shift in 0..=2 * REACH {
        sums.iter_mut().zip(&down[shift..]).for_each(|(sum, value)| *sum += value);
    }
}
