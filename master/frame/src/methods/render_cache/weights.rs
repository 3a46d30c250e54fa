//! The papers' way of filling gaps: weights over 3×3 pixels, whoever they belong to, and a mean of 7×7 where these have
//! nothing.

use glam::{Vec3, Vec4};
use rayon::prelude::*;

use super::points::Points;
use super::project::{NONE, PointImage};
use super::reconstruct::{Filling, PREFILTER, ROWS, around};

/// The weights of a 3×3 neighbourhood are products of these: 4, 2 and 1.
const WEIGHTS: [f32; 3] = [1.0, 2.0, 1.0];

/// Memory of the filter.
#[derive(Clone, Debug, Default)]
pub(super) struct Weights {
    /// What points show: red, green, blue, and 1; all 0 where there is none.
    colours: Vec<Vec4>,
}

impl Weights {
    /// Makes radiance of points; and where anything is known at all.
    pub fn make(
        &mut self,
        points: &Points,
        image: &PointImage,
        filling: Filling,
        (pixels, known): (&mut [Vec3], &mut [bool]),
    ) {
        let (width, part) = (image.width, image.width * ROWS);
        self.colours.resize(image.slots.len(), Vec4::ZERO);
        let coloured = |slot: &u32| if *slot == NONE { Vec4::ZERO } else { points.radiance(*slot).extend(1.0) };
        let fetched = self.colours.par_chunks_mut(part).zip(image.slots.par_chunks(part));
        fetched.for_each(|(colours, slots)| {
            colours.iter_mut().zip(slots).for_each(|(colour, slot)| *colour = coloured(slot));
        });
        let colours = &self.colours;
        let parts = pixels.par_chunks_mut(part).zip(known.par_chunks_mut(part)).enumerate();
        parts.for_each(|(number, (pixels, known))| {
            // The weights are products: first along rows, then along columns. Three rows are at hand at a time.
            let mut across = [const { Vec::new() }; 3];
            let first = number * ROWS;
            let row = |y: usize| &colours[y * width..][..width];
            (first.saturating_sub(1)..=first).for_each(|y| along(row(y), &mut across[y % 3]));
            let lines = pixels.chunks_mut(width).zip(known.chunks_mut(width));
            for (y, (pixels, known)) in (first..).zip(lines) {
                if y + 1 < image.height {
                    along(row(y + 1), &mut across[(y + 1) % 3]);
                }
                for (x, (pixel, known)) in pixels.iter_mut().zip(known).enumerate() {
                    let mut sum = Vec4::ZERO;
                    if y > 0 {
                        sum += WEIGHTS[0] * across[(y - 1) % 3][x];
                    }
                    sum += WEIGHTS[1] * across[y % 3][x];
                    if y + 1 < image.height {
                        sum += WEIGHTS[2] * across[(y + 1) % 3][x];
                    }
                    let filled = match colours[y * width + x] {
                        own if own.w > 0.0 && filling.sharp => own,
                        _ if sum.w > 0.0 => sum / sum.w,
                        _ if filling.prefilter => mean(colours, image, y * width + x),
                        _ => Vec4::ZERO,
                    };
                    (*pixel, *known) = (filled.truncate(), filled.w > 0.0);
                }
            }
        });
    }
}

/// Each pixel of a row with its neighbours to the left and to the right.
fn along(row: &[Vec4], sums: &mut Vec<Vec4>) {
    sums.clear();
    sums.extend(row.iter().map(|own| WEIGHTS[1] * *own));
    sums.iter_mut().skip(1).zip(row).for_each(|(sum, left)| *sum += WEIGHTS[2] * *left);
    sums.iter_mut().zip(&row[1..]).for_each(|(sum, right)| *sum += WEIGHTS[0] * *right);
}

/// The sequel's 7×7.
fn mean(colours: &[Vec4], image: &PointImage, pixel: usize) -> Vec4 {
    let sum: Vec4 = around(image, pixel, PREFILTER).map(|(there, _)| colours[there]).sum();
    if sum.w > 0.0 { sum / sum.w } else { Vec4::ZERO }
}
