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
    /// Radiance in two independent halves.
    radiance: [Vec<DVec3>; 2],
    /// Number of frames in each half.
    halves: [u32; 2],
    /// The part of each half's radiance that must not be filtered; empty where there can be none.
    emitted: [Vec<DVec3>; 2],
    /// Rows of `emitted` that are not all black: most are, and need not be read.
    emits: [Vec<bool>; 2],
    /// Radiance once more, one plane a randomisation, for the error estimate: `f32` is exact enough
    /// for a spread. Empty if there is only one.
    repetitions: Vec<Vec<Vec3>>,
    /// Number of frames in each of the `repetitions`.
    repeated: Vec<u32>,
    /// What tells surfaces apart; empty where nothing diffuse is lit.
    guides: Vec<Guide>,
}

/// Sums of what the eye meets in a pixel, over the first [`GUIDE_FRAMES_MAX`] frames.
#[derive(Clone, Copy, Debug, Default)]
struct Guide {
    reflectance: Vec3,
    normal: Vec3,
    distance: f32,
    /// Number of samples that met a surface.
    hits: f32,
}

/// Then guides are known well enough, and sums in `f32` still exactly enough.
const GUIDE_FRAMES_MAX: u32 = 4096;

/// Means of all that the film knows of a pixel.
pub(super) struct Mean {
    pub radiance: Vec3,
    /// Irradiance/π in each half; 0 where the reflectance is.
    pub irradiance: [Vec3; 2],
    pub reflectance: Vec3,
    /// Unit length; no number where there is no surface.
    pub normal: Vec3,
    /// 0 where there is no surface.
    pub distance: f32,
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
        let if_any = |any: bool| if any { pixels } else { 0 };
        let repetitions = Self::repetitions(randomisations);
        // Without surfaces all is emitted, and nothing has to be told apart.
        let emitted = if_any(fields.emitted && fields.surface);
        let plane = |len: usize| [vec![DVec3::ZERO; len], vec![DVec3::ZERO; len]];
        Self {
            tiling,
            radiance: plane(pixels),
            halves: [0; 2],
            emitted: plane(emitted),
            emits: [vec![false; tiling.height as usize], vec![false; tiling.height as usize]],
            repetitions: vec![vec![Vec3::ZERO; pixels]; repetitions],
            repeated: vec![0; repetitions],
            guides: vec![Guide::default(); if_any(fields.surface)],
        }
    }

    /// A single randomisation cannot be compared with others.
    fn repetitions(randomisations: u8) -> usize {
        if randomisations > 1 { usize::from(randomisations) } else { 0 }
    }

    /// Memory that a film takes, bytes a pixel.
    pub fn bytes_per_pixel(randomisations: u8, fields: Fields) -> u64 {
        let sums = if fields.emitted && fields.surface { 4 } else { 2 };
        let guide = if fields.surface { size_of::<Guide>() } else { 0 };
        (sums * size_of::<DVec3>() + Self::repetitions(randomisations) * size_of::<Vec3>() + guide) as u64
    }

    /// Adds a frame to one half and one randomisation: `samples` in the order of the tiling's
    /// rectangles, all sets of a rectangle together. Samples that are not finite count as black; their
    /// number is returned.
    pub fn add(&mut self, half: usize, randomisation: u8, samples: &[Sample]) -> u64 {
        let guided = self.frames() < GUIDE_FRAMES_MAX;
        let repetition = usize::from(randomisation);
        let Self { tiling, radiance, halves, emitted, emits, repetitions, repeated, guides } = self;
        halves[half] += 1;
        if let Some(frames) = repeated.get_mut(repetition) {
            *frames += 1;
        }

        // A band is a row of rectangles: contiguous in memory, so bands can be added in parallel.
        let width = tiling.width as usize;
        let band = tiling.tile_height as usize * width;
        let radiance = radiance[half].par_chunks_mut(band);
        let count = radiance.len();
        let emits = emits[half].par_chunks_mut(tiling.tile_height as usize);
        let emitted = bands_of(&mut emitted[half], band, count);
        let repetition = bands_of(repetitions.get_mut(repetition).map_or(&mut [], Vec::as_mut_slice), band, count);
        let guides = bands_of(if guided { guides } else { &mut [] }, band, count);
        let bands = (radiance, emits, emitted, repetition, guides).into_par_iter().enumerate();
        bands
            .map(|(index, (radiance, emits, emitted, repetition, guides))| {
                let top = index as u32 * tiling.tile_height;
                let rows = top..(top + tiling.tile_height).min(tiling.height);
                let first = samples.partition_point(|s| s.grid.y < rows.start);
                let after = first + samples[first..].partition_point(|s| s.grid.y < rows.end);
                let samples = &samples[first..after];
                let mut dropped = 0;
                for (row, y) in rows.enumerate() {
                    let pixels = row * width..(row + 1) * width;
                    let mut sums = RowSums {
                        radiance: &mut radiance[pixels.clone()],
                        emits: &mut emits[row],
                        emitted: emitted.get_mut(pixels.clone()).unwrap_or_default(),
                        repetition: repetition.get_mut(pixels.clone()).unwrap_or_default(),
                        guides: guides.get_mut(pixels).unwrap_or_default(),
                    };
                    dropped += samples.iter().map(|sample| sums.add(sample, y)).sum::<u64>();
                }
                dropped
            })
            .sum()
    }

    /// Number of frames added.
    pub fn frames(&self) -> u32 {
        self.halves.iter().sum()
    }

    /// Number of frames in each of the two independent halves.
    pub fn halves(&self) -> [u32; 2] {
        self.halves
    }

    /// Size of the picture and how it is cut.
    pub fn tiling(&self) -> Tiling {
        self.tiling
    }

    /// Something diffuse can be seen and lit: the filter has something to do.
    pub fn has_surface(&self) -> bool {
        !self.guides.is_empty()
    }

    /// Mean radiance, never filtered; black before the first frame.
    pub fn picture(&self) -> Picture {
        let scale = reciprocal(self.frames());
        self.map(|pixel| (self.radiance[0][pixel] + self.radiance[1][pixel]) * scale)
    }

    /// One of the quantities that the film knows; black for those it does not.
    pub fn layer(&self, layer: Layer) -> Picture {
        let averager = self.averager();
        let mean = |value: fn(Mean) -> Vec3| {
            self.map(|pixel| if self.has_surface() { value(averager.mean(pixel)).as_dvec3() } else { DVec3::ZERO })
        };
        match layer {
            Layer::Raw => self.picture(),
            Layer::Samples => self.map(|_| DVec3::splat(f64::from(self.frames()))),
            Layer::Error => self.map(|pixel| self.variance(pixel).map_or(DVec3::ZERO, root)),
            Layer::Albedo => mean(|mean| mean.reflectance),
            Layer::Normal => mean(|mean| if mean.distance > 0.0 { mean.normal } else { Vec3::ZERO }),
            Layer::Distance => mean(|mean| Vec3::splat(mean.distance)),
            Layer::Irradiance => self.irradiance(),
            Layer::Final | Layer::Worker | Layer::Cost => Picture::black(self.tiling.width, self.tiling.height),
        }
    }

    /// Divides sums by numbers of frames; only for films that have a surface.
    pub(super) fn averager(&self) -> Averager<'_> {
        let halves = self.halves().map(reciprocal);
        Averager { film: self, all: reciprocal(self.frames()), guided: self.frames().min(GUIDE_FRAMES_MAX), halves }
    }

    fn irradiance(&self) -> Picture {
        if !self.has_surface() {
            return Picture::black(self.tiling.width, self.tiling.height);
        }
        let averager = self.averager();
        let shares = self.halves().map(|half| f64::from(half) * averager.all);
        self.map(|pixel| {
            let [a, b] = averager.mean(pixel).irradiance.map(Vec3::as_dvec3);
            (a * shares[0] + b * shares[1]) * std::f64::consts::PI
        })
    }

    /// How far the mean is from its limit, judged by the spread of the independent randomisations;
    /// `None` until each of them has `round` frames.
    pub fn estimate(&self, round: u32) -> Option<Estimate> {
        if self.repeated.len() < 2 || self.repeated.iter().any(|frames| *frames < round.max(1)) {
            return None;
        }
        let width = self.tiling.width as usize;
        let rows: Vec<Spread> = (0..self.tiling.height as usize)
            .into_par_iter()
            .map(|y| {
                let mut spread = Spread::new(self.repeated.len());
                let mut deviations = vec![DVec3::ZERO; self.repeated.len()];
                let mut channel = vec![0.0; self.repeated.len()];
                for pixel in y * width..(y + 1) * width {
                    let mean = self.means(pixel).sum::<DVec3>() / self.repeated.len() as f64;
                    let square = mean * mean + RELATIVE_FLOOR;
                    let scale = root(square).recip();
                    for (deviation, value) in deviations.iter_mut().zip(self.means(pixel)) {
                        *deviation = (value - mean) * scale;
                    }
                    for c in 0..3 {
                        channel.iter_mut().zip(&deviations).for_each(|(channel, deviation)| *channel = deviation[c]);
                        spread.add(&channel);
                    }
                }
                spread
            })
            .collect();
        // Added in order, so that the estimate is the same on any number of threads.
        rows.iter().fold(Spread::new(self.repeated.len()), Spread::plus).estimate()
    }

    /// Means by randomisation.
    fn means(&self, pixel: usize) -> impl Iterator<Item = DVec3> {
        let planes = self.repetitions.iter().zip(&self.repeated);
        planes.map(move |(plane, frames)| plane[pixel].as_dvec3() * reciprocal(*frames))
    }

    /// Variance of the mean of the randomisations' means; `None` while one of them is empty.
    fn variance(&self, pixel: usize) -> Option<DVec3> {
        let count = self.repeated.len() as f64;
        if count < 2.0 || self.repeated.contains(&0) {
            return None;
        }
        let mean = self.means(pixel).sum::<DVec3>() / count;
        let squares: DVec3 = self.means(pixel).map(|value| (value - mean) * (value - mean)).sum();
        Some(squares / (count * (count - 1.0)))
    }

    fn map(&self, value: impl Fn(usize) -> DVec3 + Sync) -> Picture {
        let Tiling { width, height, .. } = self.tiling;
        let len = width as usize * height as usize;
        let pixels = (0..len).into_par_iter().with_min_len(4096).map(|pixel| value(pixel).as_vec3()).collect();
        Picture { width, height, pixels }
    }
}

/// A film, and the reciprocals of its numbers of frames.
pub(super) struct Averager<'a> {
    film: &'a Film,
    all: f64,
    guided: u32,
    halves: [f64; 2],
}

impl Averager<'_> {
    /// Means of a pixel over all frames.
    #[inline(always)]
    pub fn mean(&self, pixel: usize) -> Mean {
        let Self { film, all, guided, halves } = self;
        let [a, b] = [film.radiance[0][pixel], film.radiance[1][pixel]];
        let guide = &film.guides[pixel];
        let reflectance = guide.reflectance / (*guided).max(1) as f32;
        let per_reflectance = Vec3::select(reflectance.cmpgt(Vec3::ZERO), reflectance.recip(), Vec3::ZERO);
        let row = pixel / film.tiling.width as usize;
        // Where all is emitted, rounding may leave a little less than nothing.
        let irradiance = |half: usize, sum: DVec3| {
            let emitted = if film.emits[half][row] { film.emitted[half][pixel] } else { DVec3::ZERO };
            ((sum - emitted) * halves[half]).as_vec3().max(Vec3::ZERO) * per_reflectance
        };
        let irradiance = [irradiance(0, a), irradiance(1, b)];
        let seen = guide.hits > 0.0;
        Mean {
            radiance: ((a + b) * *all).as_vec3(),
            irradiance,
            reflectance,
            normal: if seen { guide.normal.normalize_or_zero() } else { Vec3::NAN },
            distance: if seen { guide.distance / guide.hits } else { 0.0 },
        }
    }
}

/// One row of the film's sums; those that the scene does not need are empty.
struct RowSums<'a> {
    radiance: &'a mut [DVec3],
    emits: &'a mut bool,
    emitted: &'a mut [DVec3],
    repetition: &'a mut [Vec3],
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
        let value = |values: &[Vec3], at: usize| values.get(at).copied().unwrap_or(Vec3::ZERO);
        let mut dropped = 0;
        for (column, at) in (first..first + columns).enumerate() {
            let x = grid.x as usize + column * grid.step_x as usize;
            let emitted = value(&pixels.emitted, at);
            let reflectance = value(&pixels.reflectance, at);
            let normal = value(&pixels.normal, at);
            let distance = pixels.distance.get(at).copied().unwrap_or(0.0);
            let radiance = emitted + reflectance * value(&pixels.irradiance, at) * FRAC_1_PI;
            // One sum tells whether any of them is not finite.
            let all = radiance.element_sum() + reflectance.element_sum() + normal.element_sum() + distance;
            if !all.is_finite() {
                dropped += 1;
                continue;
            }
            self.radiance[x] += radiance.as_dvec3();
            if let Some(sum) = self.repetition.get_mut(x) {
                *sum += radiance;
            }
            // Most pixels see no lamp: their sums are not even touched.
            if let Some(sum) = self.emitted.get_mut(x).filter(|_| emitted != Vec3::ZERO) {
                *sum += emitted.as_dvec3();
                *self.emits = true;
            }
            if let Some(guide) = self.guides.get_mut(x) {
                guide.reflectance += reflectance;
                guide.normal += normal;
                guide.distance += distance;
                guide.hits += if distance > 0.0 { 1.0 } else { 0.0 };
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

fn root(value: DVec3) -> DVec3 {
    DVec3::new(value.x.sqrt(), value.y.sqrt(), value.z.sqrt())
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
        let (radiance, emits) = (&mut film.radiance[0][..], &mut false);
        let mut row = RowSums { radiance, emits, emitted: &mut [], repetition: &mut [], guides: &mut [] };
        for _ in 1..1 << 25 {
            row.add(&samples[0], 0);
        }
        film.halves[0] = 1 << 25;
        assert_eq!(film.picture().pixels[0], Vec3::ONE);
    }
}
