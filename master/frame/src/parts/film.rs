//! The film: sums of raw samples.

use std::f32::consts::FRAC_1_PI;

use glam::{DVec3, Vec3};
use protocol::answer::{Fields, Pixels};
use protocol::question::Grid;
use rayon::prelude::*;

use super::Tiling;
use crate::metrics::{Estimate, RELATIVE_FLOOR, Spread};
use crate::{Layer, Picture};

/// Sums of samples, per pixel and apart for each randomisation, in `f64`: 2²⁵ frames of 1 have the
/// mean 1. Whole frames are added in order, so the sums are the same bits whoever answered when.
///
/// Parts that the scene cannot have ([`Fields`]) take no memory.
#[derive(Clone, Debug)]
pub struct Film {
    tiling: Tiling,
    /// Radiance, one plane a randomisation.
    radiance: Vec<Vec<DVec3>>,
    /// Number of frames in each plane of `radiance`.
    frames: Vec<u32>,
    /// Filterable part of the radiance, reflectance · irradiance / π, in two independent halves;
    /// empty where nothing diffuse is lit.
    surface: [Vec<DVec3>; 2],
    /// Number of frames in each half of `surface`.
    halves: [u32; 2],
    /// What tells surfaces apart; empty where nothing diffuse is lit.
    guides: Vec<Guide>,
}

/// Sums of what the eye meets in a pixel.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Guide {
    pub reflectance: DVec3,
    pub normal: DVec3,
    pub distance: f64,
    /// Number of samples that met a surface.
    pub hits: f64,
}

/// The answer to one tile, and which pixels of the picture it holds.
#[derive(Clone, Debug)]
pub struct Sample {
    /// Where the pixels belong.
    pub grid: Grid,
    /// As many as the grid has.
    pub pixels: Pixels,
}

impl Film {
    /// Black film.
    pub fn new(tiling: Tiling, randomisations: u8, fields: Fields) -> Self {
        let pixels = tiling.width as usize * tiling.height as usize;
        let planes = usize::from(randomisations.max(1));
        let surface = if fields.surface { pixels } else { 0 };
        Self {
            tiling,
            radiance: vec![vec![DVec3::ZERO; pixels]; planes],
            frames: vec![0; planes],
            surface: [vec![DVec3::ZERO; surface], vec![DVec3::ZERO; surface]],
            halves: [0; 2],
            guides: vec![Guide::default(); surface],
        }
    }

    /// Memory that a film takes, bytes a pixel.
    pub fn bytes_per_pixel(randomisations: u8, fields: Fields) -> u64 {
        let sum = size_of::<DVec3>() as u64;
        let surface = if fields.surface { 2 * sum + size_of::<Guide>() as u64 } else { 0 };
        u64::from(randomisations.max(1)) * sum + surface
    }

    /// Adds a frame: `samples` in the order of the tiling's rectangles, all sets of a rectangle
    /// together. Samples that are not finite count as black; their number is returned.
    pub fn add(&mut self, randomisation: u8, half: usize, samples: &[Sample]) -> u64 {
        let Self { tiling, radiance, frames, surface, halves, guides } = self;
        let width = tiling.width as usize;
        let band = tiling.tile_height as usize * width;
        let plane = usize::from(randomisation);
        frames[plane] += 1;
        halves[half] += 1;

        // A band is a row of rectangles: contiguous in memory, so bands can be added in parallel.
        let radiance = radiance[plane].par_chunks_mut(band);
        let surface = bands_of(&mut surface[half], band, radiance.len());
        let guides = bands_of(guides, band, radiance.len());
        let bands = (radiance, surface, guides).into_par_iter().enumerate();
        bands
            .map(|(index, (radiance, surface, guides))| {
                let top = index as u32 * tiling.tile_height;
                let rows = top..(top + tiling.tile_height).min(tiling.height);
                let first = samples.partition_point(|s| s.grid.y < rows.start);
                let after = first + samples[first..].partition_point(|s| s.grid.y < rows.end);
                let samples = &samples[first..after];
                let mut dropped = 0;
                for (row, y) in rows.enumerate() {
                    let row = row * width..(row + 1) * width;
                    let mut sums = RowSums {
                        radiance: &mut radiance[row.clone()],
                        surface: surface.get_mut(row.clone()).unwrap_or_default(),
                        guides: guides.get_mut(row).unwrap_or_default(),
                    };
                    dropped += samples.iter().map(|sample| sums.add(sample, y)).sum::<u64>();
                }
                dropped
            })
            .sum()
    }

    /// Number of frames added.
    pub fn frames(&self) -> u32 {
        self.frames.iter().sum()
    }

    /// Number of frames in each of the two independent halves.
    pub fn halves(&self) -> [u32; 2] {
        self.halves
    }

    /// Size of the picture and how it is cut.
    pub fn tiling(&self) -> Tiling {
        self.tiling
    }

    /// Mean radiance, never filtered; black before the first frame.
    pub fn mean(&self) -> Picture {
        let scale = reciprocal(self.frames());
        self.picture(|pixel| self.radiance_sum(pixel) * scale)
    }

    /// One of the quantities that the film knows; `None` for those it does not.
    pub fn layer(&self, layer: Layer) -> Option<Picture> {
        let scale = reciprocal(self.frames());
        let guide = |value: fn(&Guide) -> DVec3| {
            self.picture(|pixel| self.guides.get(pixel).map_or(DVec3::ZERO, |guide| value(guide)))
        };
        Some(match layer {
            Layer::Raw => self.mean(),
            Layer::Samples => self.picture(|_| DVec3::splat(f64::from(self.frames()))),
            Layer::Error => self.picture(|pixel| self.variance(pixel).map_or(DVec3::ZERO, root)),
            Layer::Albedo => {
                self.picture(|pixel| self.guides.get(pixel).map_or(DVec3::ZERO, |g| g.reflectance * scale))
            }
            Layer::Normal => guide(|g| g.normal.normalize_or_zero()),
            Layer::Distance => guide(|g| DVec3::splat(if g.hits > 0.0 { g.distance / g.hits } else { 0.0 })),
            Layer::Irradiance => self.picture(|pixel| {
                let (Some(guide), [Some(a), Some(b)]) =
                    (self.guides.get(pixel), self.surface.each_ref().map(|s| s.get(pixel)))
                else {
                    return DVec3::ZERO;
                };
                divide(*a + *b, guide.reflectance) * std::f64::consts::PI
            }),
            Layer::Final | Layer::Worker | Layer::Cost => return None,
        })
    }

    /// How far the mean is from its limit, judged by the spread of the independent randomisations;
    /// `None` until each of them has `round` frames.
    pub fn estimate(&self, round: u32) -> Option<Estimate> {
        if self.frames.len() < 2 || self.frames.iter().any(|frames| *frames < round.max(1)) {
            return None;
        }
        let width = self.tiling.width as usize;
        let rows: Vec<Spread> = (0..self.tiling.height as usize)
            .into_par_iter()
            .map(|y| {
                let mut spread = Spread::new(self.frames.len());
                for pixel in y * width..(y + 1) * width {
                    let mean = self.means(pixel).sum::<DVec3>() / self.frames.len() as f64;
                    let scale = (mean * mean + RELATIVE_FLOOR).recip();
                    for (deviation, value) in spread.deviations.iter_mut().zip(self.means(pixel)) {
                        *deviation += ((value - mean) * (value - mean) * scale).element_sum();
                    }
                }
                spread.values = 3 * width as u64;
                spread
            })
            .collect();
        // Added in order, so that the estimate is the same on any number of threads.
        rows.iter().fold(Spread::new(self.frames.len()), |sum, row| sum.plus(row)).estimate()
    }

    /// Sums of both halves and the guide, for the filter; `None` where nothing diffuse is lit.
    pub(super) fn surface(&self) -> Option<([&[DVec3]; 2], &[Guide])> {
        (!self.guides.is_empty()).then(|| (self.surface.each_ref().map(Vec::as_slice), self.guides.as_slice()))
    }

    /// Sum over all randomisations, in their order.
    pub(super) fn radiance_sum(&self, pixel: usize) -> DVec3 {
        self.radiance.iter().map(|plane| plane[pixel]).sum()
    }

    /// Means by randomisation.
    fn means(&self, pixel: usize) -> impl Iterator<Item = DVec3> {
        self.radiance.iter().zip(&self.frames).map(move |(plane, frames)| plane[pixel] * reciprocal(*frames))
    }

    /// Variance of the mean of the randomisations' means; `None` while one of them is empty.
    fn variance(&self, pixel: usize) -> Option<DVec3> {
        let count = self.frames.len() as f64;
        if count < 2.0 || self.frames.contains(&0) {
            return None;
        }
        let mean = self.means(pixel).sum::<DVec3>() / count;
        let squares: DVec3 = self.means(pixel).map(|value| (value - mean) * (value - mean)).sum();
        Some(squares / (count * (count - 1.0)))
    }

    fn picture(&self, value: impl Fn(usize) -> DVec3 + Sync) -> Picture {
        let Tiling { width, height, .. } = self.tiling;
        let len = width as usize * height as usize;
        let pixels = (0..len).into_par_iter().with_min_len(4096).map(|pixel| value(pixel).as_vec3()).collect();
        Picture { width, height, pixels }
    }
}

/// One row of the film's sums.
struct RowSums<'a> {
    radiance: &'a mut [DVec3],
    surface: &'a mut [DVec3],
    guides: &'a mut [Guide],
}

impl RowSums<'_> {
    /// Adds the pixels of a sample that lie in row `y` of the picture.
    fn add(&mut self, sample: &Sample, y: u32) -> u64 {
        let Sample { grid, pixels } = sample;
        if y < grid.y || !(y - grid.y).is_multiple_of(grid.step_y) || (y - grid.y) / grid.step_y >= grid.rows {
            return 0;
        }
        let columns = grid.columns as usize;
        let first = ((y - grid.y) / grid.step_y) as usize * columns;
        let mut dropped = 0;
        for column in 0..columns {
            let x = grid.x as usize + column * grid.step_x as usize;
            let [emitted, reflectance, irradiance, normal] =
                [&pixels.emitted, &pixels.reflectance, &pixels.irradiance, &pixels.normal]
                    .map(|values| values.get(first + column).copied().unwrap_or(Vec3::ZERO));
            let distance = pixels.distance.get(first + column).copied().unwrap_or(0.0);
            let surface = reflectance * irradiance * FRAC_1_PI;
            let radiance = emitted + surface;
            // One sum tells whether any of them is not finite.
            let all = radiance.element_sum() + reflectance.element_sum() + normal.element_sum() + distance;
            if !all.is_finite() {
                dropped += 1;
                continue;
            }
            self.radiance[x] += radiance.as_dvec3();
            if let (Some(sum), Some(guide)) = (self.surface.get_mut(x), self.guides.get_mut(x)) {
                *sum += surface.as_dvec3();
                guide.reflectance += reflectance.as_dvec3();
                guide.normal += normal.as_dvec3();
                guide.distance += f64::from(distance);
                guide.hits += f64::from(u8::from(distance > 0.0));
            }
        }
        dropped
    }
}

/// Bands of a plane that may be empty: then as many empty bands.
fn bands_of<T: Send>(plane: &mut [T], band: usize, count: usize) -> Vec<&mut [T]> {
    let mut bands: Vec<&mut [T]> = plane.chunks_mut(band).collect();
    bands.resize_with(count, Default::default);
    bands
}

fn reciprocal(frames: u32) -> f64 {
    if frames == 0 { 0.0 } else { 1.0 / f64::from(frames) }
}

fn root(variance: DVec3) -> DVec3 {
    DVec3::new(variance.x.sqrt(), variance.y.sqrt(), variance.z.sqrt())
}

/// Component by component; 0 where the divisor is 0.
pub(super) fn divide(a: DVec3, b: DVec3) -> DVec3 {
    let divide = |a: f64, b: f64| if b > 0.0 { a / b } else { 0.0 };
    DVec3::new(divide(a.x, b.x), divide(a.y, b.y), divide(a.z, b.z))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_mean_of_2_to_the_25_frames_of_1_is_1() {
        let tiling = Tiling { width: 1, height: 1, tile_width: 1, tile_height: 1 };
        let mut film = Film::new(tiling, 1, Fields { emitted: true, surface: false });
        let grid = Grid { x: 0, y: 0, step_x: 1, step_y: 1, columns: 1, rows: 1 };
        let samples = [Sample { grid, pixels: Pixels { emitted: vec![Vec3::ONE], ..Pixels::default() } }];
        film.add(0, 0, &samples);
        let mut row = RowSums { radiance: &mut film.radiance[0], surface: &mut [], guides: &mut [] };
        for _ in 1..1 << 25 {
            row.add(&samples[0], 0);
        }
        film.frames[0] = 1 << 25;
        assert_eq!(film.mean().pixels[0], Vec3::ONE);
    }
}
