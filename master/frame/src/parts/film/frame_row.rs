//! One row of one frame, or of the mean of several: interleaved samples put side by side.

use std::f32::consts::FRAC_1_PI;

use glam::Vec3;

use super::super::planes::Planes;
use super::{GUIDE_PLANES, Light, Sample};

/// A row of a frame, as planes: radiance (3), its part that must not be filtered (3), a guide, and irradiance (3).
pub(super) struct FrameRow {
    planes: Planes<f32, PLANES>,
    /// Any of the part that must not be filtered differs from 0.
    pub emits: bool,
}

const EMITTED: usize = 3;
const GUIDE: usize = 6;
const IRRADIANCE: usize = GUIDE + GUIDE_PLANES;
const PLANES: usize = IRRADIANCE + 3;

impl FrameRow {
    /// All black.
    pub fn new(width: usize) -> Self {
        Self { planes: Planes::new(width, 1), emits: false }
    }

    /// Takes row `y` of the picture from those samples that have a part of it; together they have all of it.
    /// Pixels that are not finite count as black; their number is returned.
    #[inline(always)]
    pub fn gather(&mut self, samples: &[Sample], y: u32, is_mean: bool) -> u64 {
        for Sample { grid, light } in samples {
            let row = y.wrapping_sub(grid.y);
            if !row.is_multiple_of(grid.step_y) || row / grid.step_y >= grid.rows {
                continue;
            }
            let columns = grid.columns as usize;
            let first = (row / grid.step_y) as usize * columns;
            let (x, step) = (grid.x as usize, grid.step_x as usize);
            let [_, _, _, e0, e1, e2, r0, r1, r2, n0, n1, n2, distances, _, i0, i1, i2] = self.planes.row_mut(0);
            // What the scene cannot have is not there at all, and stays black.
            let row = first..first + columns;
            let part =
                |values: &'_ [Vec3]| -> std::ops::Range<usize> { if values.is_empty() { 0..0 } else { row.clone() } };
            let pixels = match light {
                Light::Frame(pixels) => pixels,
                Light::Frames(means) => {
                    scatter(&means.emitted[part(&means.emitted)], x, step, [e0, e1, e2]);
                    // As if of white surfaces.
                    scatter(&means.reflected[part(&means.reflected)], x, step, [i0, i1, i2]);
                    continue;
                }
            };
            scatter(&pixels.emitted[part(&pixels.emitted)], x, step, [e0, e1, e2]);
            scatter(&pixels.reflectance[part(&pixels.reflectance)], x, step, [r0, r1, r2]);
            scatter(&pixels.normal[part(&pixels.normal)], x, step, [n0, n1, n2]);
            scatter(&pixels.irradiance[part(&pixels.irradiance)], x, step, [i0, i1, i2]);
            let values = pixels.distance.get(row).unwrap_or_default();
            for (value, distance) in values.iter().zip(distances[x..].iter_mut().step_by(step)) {
                *distance = *value;
            }
        }
        if is_mean { self.develop_mean() } else { self.develop() }
    }

    /// Radiance of all that was put side by side.
    #[inline(always)]
    fn develop(&mut self) -> u64 {
        let planes = self.planes.row_mut(0);
        let width = planes[0].len();
        let [l0, l1, l2, e0, e1, e2, r0, r1, r2, n0, n1, n2, distances, hits, i0, i1, i2] =
            planes.map(|plane| &mut plane[..width]);
        let (mut dropped, mut emits) = (0, false);
        for x in 0..width {
            l0[x] = e0[x] + r0[x] * i0[x] * FRAC_1_PI;
            l1[x] = e1[x] + r1[x] * i1[x] * FRAC_1_PI;
            l2[x] = e2[x] + r2[x] * i2[x] * FRAC_1_PI;
            hits[x] = if distances[x] > 0.0 { 1.0 } else { 0.0 };
            emits |= (e0[x] != 0.0) | (e1[x] != 0.0) | (e2[x] != 0.0);
            // One sum tells whether any of them is not finite.
            let all = l0[x] + l1[x] + l2[x] + r0[x] + r1[x] + r2[x] + n0[x] + n1[x] + n2[x] + distances[x];
            dropped += u32::from(!all.is_finite());
        }
        self.emits = emits;
        if dropped > 0 { self.blacken() } else { 0 }
    }

    /// The same of a mean, which has two parts and no guide.
    #[inline(always)]
    fn develop_mean(&mut self) -> u64 {
        let planes = self.planes.row_mut(0);
        let width = planes[0].len();
        let [l0, l1, l2, e0, e1, e2, .., i0, i1, i2] = planes.map(|plane| &mut plane[..width]);
        let (mut dropped, mut emits) = (0, false);
        for x in 0..width {
            l0[x] = e0[x] + i0[x];
            l1[x] = e1[x] + i1[x];
            l2[x] = e2[x] + i2[x];
            emits |= (e0[x] != 0.0) | (e1[x] != 0.0) | (e2[x] != 0.0);
            dropped += u32::from(!(l0[x] + l1[x] + l2[x]).is_finite());
        }
        self.emits = emits;
        if dropped > 0 { self.blacken() } else { 0 }
    }

    /// Makes pixels black that are not finite; rare.
    fn blacken(&mut self) -> u64 {
        let mut planes = self.planes.row_mut(0);
        let mut dropped = 0;
        for x in 0..planes[0].len() {
            if !planes[..IRRADIANCE].iter().map(|plane| plane[x]).sum::<f32>().is_finite() {
                planes.iter_mut().for_each(|plane| plane[x] = 0.0);
                dropped += 1;
            }
        }
        dropped
    }

    /// Radiance.
    pub fn radiance(&self) -> [&[f32]; 3] {
        let planes = self.planes.row(0);
        [planes[0], planes[1], planes[2]]
    }

    /// The part of the radiance that must not be filtered.
    pub fn emitted(&self) -> [&[f32]; 3] {
        let planes = self.planes.row(0);
        [planes[EMITTED], planes[EMITTED + 1], planes[EMITTED + 2]]
    }

    /// What tells surfaces apart.
    pub fn guide(&self) -> [&[f32]; GUIDE_PLANES] {
        let planes = self.planes.row(0);
        std::array::from_fn(|plane| planes[GUIDE + plane])
    }
}

/// Puts colours into every so many columns of three planes.
#[inline(always)]
fn scatter(values: &[Vec3], x: usize, step: usize, [red, green, blue]: [&mut [f32]; 3]) {
    let Some(last) = values.len().checked_sub(1) else { return };
    let columns = x..x + last * step + 1;
    let [red, green, blue] = [red, green, blue].map(|plane| &mut plane[columns.clone()]);
    let mut at = 0;
    for value in values {
        (red[at], green[at], blue[at]) = (value.x, value.y, value.z);
        at += step;
    }
}
