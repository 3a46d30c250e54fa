//! From sums to means, row by row.

use glam::Vec3;
use rayon::prelude::*;

use super::{Film, reciprocal};

/// The planes of a row of means ([`Film::mean_row`]): the first of each quantity.
pub mod mean {
    /// Radiance of all frames.
    pub const RADIANCE: usize = 0;
    /// Reflectance; 0 where nothing diffuse is seen.
    pub const REFLECTANCE: usize = 3;
    /// Unit normal; no number where there is no surface.
    pub const NORMAL: usize = 6;
    /// Length of the eye path, one plane; 0 where there is no surface.
    pub const DISTANCE: usize = 9;
    /// Irradiance/π: of all frames in the first three planes, or of either half; 0 where the reflectance is.
    pub const IRRADIANCE: [usize; 2] = [10, 13];
    /// Number of planes.
    pub const PLANES: usize = 16;
}

impl Film {
    /// Means of a row over all frames, as planes (see [`mean`]); the irradiance of the two halves apart if asked.
    /// Only for films that have a surface.
    #[inline(always)]
    pub fn mean_row(&self, y: usize, apart: bool, planes: &mut [&mut [f32]]) {
        let (surface, irradiance) = planes[..mean::PLANES].split_at_mut(mean::IRRADIANCE[0]);
        self.mean_radiance(y, &mut surface[mean::RADIANCE..mean::REFLECTANCE]);
        self.mean_guide(y, &mut surface[mean::REFLECTANCE..]);
        let reflectance = &surface[mean::REFLECTANCE..mean::NORMAL];
        let (first, second) = irradiance.split_at_mut(3);
        if apart {
            self.mean_irradiance(y, [true, false], reflectance, first);
            self.mean_irradiance(y, [false, true], reflectance, second);
        } else {
            self.mean_irradiance(y, [true, true], reflectance, first);
        }
    }

    /// Three planes: red, green and blue of all frames.
    #[inline(always)]
    pub fn mean_radiance(&self, y: usize, planes: &mut [&mut [f32]]) {
        let scale = reciprocal(self.frames());
        for (channel, mean) in planes.iter_mut().enumerate() {
            // A half without any frame holds no sums.
            match self.halves.map(|frames| frames > 0) {
                [true, true] => {
                    let [a, b] = self.radiance.each_ref().map(|half| half.row(y)[channel]);
                    mean.iter_mut().zip(a.iter().zip(b)).for_each(|(mean, (a, b))| *mean = ((a + b) * scale) as f32);
                }
                [false, false] => mean.fill(0.0),
                [_, second] => {
                    let sums = self.radiance[usize::from(second)].row(y)[channel];
                    mean.iter_mut().zip(sums).for_each(|(mean, sum)| *mean = (sum * scale) as f32);
                }
            }
        }
    }

    /// By how much more radiance the pixels of a row have in the first half than in the second; neither may be empty.
    pub fn halves_apart(&self, y: usize, row: &mut [Vec3]) {
        let scales = self.halves.map(reciprocal);
        let [a, b] = self.radiance.each_ref().map(|half| half.row(y));
        for (x, pixel) in row.iter_mut().enumerate() {
            *pixel = Vec3::from_array([0, 1, 2].map(|c| (a[c][x] * scales[0] - b[c][x] * scales[1]) as f32));
        }
    }

    /// Seven planes: reflectance, normal, distance.
    #[inline(always)]
    fn mean_guide(&self, y: usize, planes: &mut [&mut [f32]]) {
        let [red, green, blue, sum_x, sum_y, sum_z, distances, hits] = self.guides.row(y);
        let frames = self.frames().min(self.guided);
        let per_frame = reciprocal(frames) as f32;
        let ([reflectance @ .., nx, ny, nz, distance], known) = (planes, frames > 0) else { return };
        for (mean, sums) in reflectance.iter_mut().zip([red, green, blue]) {
            mean.iter_mut().zip(sums).for_each(|(mean, sum)| *mean = if known { sum * per_frame } else { 0.0 });
        }
        let width = hits.len();
        let [nx, ny, nz, distance] = [nx, ny, nz, distance].map(|plane| &mut plane[..width]);
        for x in 0..width {
            let square = sum_x[x] * sum_x[x] + sum_y[x] * sum_y[x] + sum_z[x] * sum_z[x];
            let hits = if known { hits[x] } else { 0.0 };
            // Normals may cancel; where there is no surface, there is none.
            let per_length = if square > 0.0 { 1.0 / square.sqrt() } else { 0.0 };
            let per_length = if hits > 0.0 { per_length } else { f32::NAN };
            nx[x] = sum_x[x] * per_length;
            ny[x] = sum_y[x] * per_length;
            nz[x] = sum_z[x] * per_length;
            distance[x] = if hits > 0.0 { distances[x] / hits } else { 0.0 };
        }
    }

    /// Of every pixel, the length of the eye path; 0 where there is no surface. As in [`mean::DISTANCE`], without the rest.
    pub fn distances(&self) -> Vec<f32> {
        let (width, height) = (self.tiling.width as usize, self.tiling.height as usize);
        let mut distances = vec![0.0; width * height];
        if self.has_surface() && self.frames() > 0 {
            let rows = distances.par_chunks_mut(width.max(1)).enumerate().with_min_len(16);
            rows.for_each(|(y, row)| {
                let [.., sums, hits] = self.guides.row(y);
                for (distance, (sum, hits)) in row.iter_mut().zip(sums.iter().zip(hits)) {
                    *distance = if *hits > 0.0 { sum / hits } else { 0.0 };
                }
            });
        }
        distances
    }

    /// Three planes: irradiance/π of the frames of some halves.
    #[inline(always)]
    fn mean_irradiance(&self, y: usize, wanted: [bool; 2], reflectance: &[&mut [f32]], planes: &mut [&mut [f32]]) {
        let halves = [0, 1].into_iter().filter(|half| wanted[*half] && self.halves[*half] > 0);
        let scale = reciprocal(halves.clone().map(|half| self.halves[half]).sum());
        for (channel, (mean, reflectance)) in planes.iter_mut().zip(reflectance).enumerate() {
            let mut begun = false;
            for half in halves.clone() {
                let sums = self.radiance[half].row(y)[channel];
                match self.emits[half][y].then(|| self.emitted[half].row(y)[channel]) {
                    None => put(mean, sums.iter().map(|sum| (sum * scale) as f32), begun),
                    Some(emitted) => {
                        let surface = sums.iter().zip(emitted).map(|(sum, emitted)| ((sum - emitted) * scale) as f32);
                        put(mean, surface, begun);
                    }
                }
                begun = true;
            }
            if !begun {
                mean.fill(0.0);
            }
            for (mean, reflectance) in mean.iter_mut().zip(reflectance.iter()) {
                // Where all is emitted, rounding may leave a little less than nothing.
                *mean = if *reflectance > 0.0 { mean.max(0.0) / reflectance } else { 0.0 };
            }
        }
    }
}

#[inline(always)]
fn put(mean: &mut [f32], values: impl Iterator<Item = f32>, add: bool) {
    if add {
        mean.iter_mut().zip(values).for_each(|(mean, value)| *mean += value);
    } else {
        mean.iter_mut().zip(values).for_each(|(mean, value)| *mean = value);
    }
}
