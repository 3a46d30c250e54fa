//! The film: sums of raw samples.

mod frame_row;
mod means;
mod record;

use glam::{DVec3, Vec3};
use protocol::answer::{Fields, Means, Pixels};
use protocol::question::Grid;
use rayon::prelude::*;

use super::Tiling;
use super::planes::{Band, Planes};
use crate::Picture;
use crate::front_end::{Plane, Probe};
use crate::metrics::{Estimate, RELATIVE_FLOOR, Spread};

use frame_row::FrameRow;
pub(super) use means::mean;

/// Sums of samples, per pixel and apart for each replicate, in `f64`: 2²⁵ frames of 1 have the
/// mean 1. Whole frames are added in order, so the sums are the same bits whoever answered when.
///
/// Parts that the scene cannot have ([`Fields`]) take no memory. The first frame of a part overwrites what
/// was there, so that beginning again ([`Self::clear`]) costs nothing.
#[derive(Clone, Debug)]
pub struct Film {
    tiling: Tiling,
    /// Radiance in two independent halves.
    radiance: [Planes<f64, 3>; 2],
    /// Number of frames in each half.
    halves: [u32; 2],
    /// The part of each half's radiance that must not be filtered; empty where there can be none.
    emitted: [Planes<f64, 3>; 2],
    /// Rows of `emitted` that have been written: most have not, and are all black.
    emits: [Vec<bool>; 2],
    /// Radiance once more, apart for each replicate, for the error estimate: `f32` is exact enough
    /// for a spread. None if there is only one.
    repetitions: Vec<Planes<f32, 3>>,
    /// Number of frames in each of the `repetitions`.
    repeated: Vec<u32>,
    /// What tells surfaces apart, summed over the first [`Self::guided`] frames; empty where nothing
    /// diffuse is lit. The planes: reflectance (3), normal (3), distance, number of samples that met a surface.
    guides: Planes<f32, GUIDE_PLANES>,
    guided: u32,
}

const GUIDE_PLANES: usize = 8;

/// Then guides are known well enough, and sums in `f32` still exactly enough.
const GUIDE_FRAMES_MAX: u32 = 4096;

/// The answer to one tile, and which pixels of the picture it holds.
#[derive(Clone, Debug)]
pub struct Sample {
    /// Where the pixels belong.
    pub grid: Grid,
    /// As many pixels as the grid has.
    pub light: Light,
}

/// What an answer says of the pixels.
#[derive(Clone, Debug)]
pub enum Light {
    /// What one frame has.
    Frame(Pixels),
    /// The mean of several.
    Frames(Means),
}

impl Film {
    /// Black film.
    pub fn new(tiling: Tiling, replicates: u8, fields: Fields) -> Self {
        let (width, height) = (tiling.width as usize, tiling.height as usize);
        let if_any = |any: bool| if any { height } else { 0 };
        let repetitions = Self::repetitions(replicates);
        // Without surfaces all is emitted, and nothing has to be told apart.
        let emitted = if_any(fields.emitted && fields.surface);
        let planes = |height: usize| [Planes::new(width, height), Planes::new(width, height)];
        Self {
            tiling,
            radiance: planes(height),
            halves: [0; 2],
            emitted: planes(emitted),
            emits: [vec![false; height], vec![false; height]],
            repetitions: vec![Planes::new(width, height); repetitions],
            repeated: vec![0; repetitions],
            guides: Planes::new(width, if_any(fields.surface)),
            guided: GUIDE_FRAMES_MAX,
        }
    }

    /// What tells surfaces apart is taken from so many frames at the beginning, at most; to be said before the first.
    pub fn guide_by(&mut self, frames: u32) {
        self.guided = frames.min(GUIDE_FRAMES_MAX);
    }

    /// Whether it can be used again, once cleared, where a film of this kind is wanted.
    pub fn suits(&self, tiling: Tiling, replicates: u8, fields: Fields) -> bool {
        self.tiling == tiling
            && self.repetitions.len() == Self::repetitions(replicates)
            && self.guides.is_empty() != fields.surface
            && self.emitted[0].is_empty() != (fields.emitted && fields.surface)
    }

    /// Black again, for another picture of the same size and kind.
    pub fn clear(&mut self) {
        self.halves = [0; 2];
        self.emits.iter_mut().for_each(|rows| rows.fill(false));
        self.repeated.fill(0);
    }

    /// A single replicate cannot be compared with others.
    fn repetitions(replicates: u8) -> usize {
        if replicates > 1 { usize::from(replicates) } else { 0 }
    }

    /// Memory that a film takes, bytes a pixel.
    pub fn bytes_per_pixel(replicates: u8, fields: Fields) -> u64 {
        let sums = if fields.emitted && fields.surface { 4 } else { 2 };
        let guide = if fields.surface { GUIDE_PLANES * size_of::<f32>() } else { 0 };
        (sums * size_of::<DVec3>() + Self::repetitions(replicates) * size_of::<Vec3>() + guide) as u64
    }

    /// Adds a frame to one half and one replicate: `samples` in the order of the tiling's
    /// rectangles, all sets of a rectangle together, every pixel in one of them. Samples that are not finite
    /// count as black; their number is returned.
    pub fn add(&mut self, half: usize, replicate: u8, samples: &[Sample]) -> u64 {
        self.add_frames(half, replicate, 1, samples)
    }

    /// As [`Self::add`], so many frames by their mean, if they are more than one. They have no guide: there must have been
    /// enough frames for that.
    pub fn add_frames(&mut self, half: usize, replicate: u8, frames: u32, samples: &[Sample]) -> u64 {
        let (added, weight, is_mean) = (frames, frames as f32, frames > 1);
        let guided = self.frames() < self.guided && !is_mean;
        let repetition = usize::from(replicate);
        let first = First {
            of_half: self.halves[half] == 0,
            of_repetition: self.repeated.get(repetition) == Some(&0),
            of_all: self.frames() == 0,
        };
        let Self { tiling, radiance, halves, emitted, emits, repetitions, repeated, guides, guided: _ } = self;
        halves[half] += added;
        if let Some(frames) = repeated.get_mut(repetition) {
            *frames += added;
        }

        // A band is a row of rectangles: contiguous in memory, so bands can be added in parallel.
        let (rows, count) = (tiling.tile_height as usize, tiling.rows() as usize);
        let bands = (
            radiance[half].bands(rows, count),
            emitted[half].bands(rows, count),
            emits[half].chunks_mut(rows).collect::<Vec<_>>(),
            repetitions.get_mut(repetition).map_or_else(|| Band::none(count), |planes| planes.bands(rows, count)),
            if guided { guides.bands(rows, count) } else { Band::none(count) },
        );
        bands
            .into_par_iter()
            .enumerate()
            .map(|(index, (radiance, emitted, emits, repetition, guides))| {
                let top = index as u32 * tiling.tile_height;
                let begin = samples.partition_point(|s| s.grid.y < top);
                let count = samples[begin..].partition_point(|s| s.grid.y < top + tiling.tile_height);
                let mut sums = BandSums { radiance, emitted, emits, repetition, guides, first, weight };
                sums.take(&samples[begin..begin + count], FrameRow::new(tiling.width as usize), (top, is_mean))
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
        self.rows(|y, row| {
            let mut planes = Planes::<f32, 3>::new(row.len(), 1);
            let mut planes = planes.row_mut(0);
            self.mean_radiance(y, &mut planes);
            for (x, pixel) in row.iter_mut().enumerate() {
                *pixel = Vec3::from_array(planes.each_ref().map(|plane| plane[x]));
            }
        })
    }

    /// One of the quantities that the film knows; black for those it does not.
    pub fn plane(&self, plane: Plane) -> Picture {
        match plane {
            Plane::Raw => self.picture(),
            Plane::Samples => self.rows(|_, row| row.fill(Vec3::splat(self.frames() as f32))),
            Plane::Error => self.rows(|y, row| self.deviations(y, row)),
            Plane::Albedo => self.means(mean::REFLECTANCE, 1),
            Plane::Normal => self.means(mean::NORMAL, 1),
            Plane::Distance => self.means(mean::DISTANCE, 0),
            Plane::Irradiance | Plane::Illuminance => {
                let mut picture = self.means(mean::IRRADIANCE[0], 1);
                picture.pixels.iter_mut().for_each(|pixel| *pixel *= std::f32::consts::PI);
                picture
            }
            Plane::Final | Plane::Worker | Plane::Cost | Plane::Own(_) => {
                Picture::black(self.tiling.width, self.tiling.height)
            }
        }
    }

    /// Three planes of means, `step` apart, as a picture; 0 for what is no number.
    fn means(&self, plane: usize, step: usize) -> Picture {
        if !self.has_surface() {
            return Picture::black(self.tiling.width, self.tiling.height);
        }
        self.rows(|y, row| {
            let mut means = Planes::<f32, { mean::PLANES }>::new(row.len(), 1);
            let mut means = means.row_mut(0);
            self.mean_row(y, false, &mut means);
            for (x, pixel) in row.iter_mut().enumerate() {
                let value = |channel: usize| means[plane + channel * step][x];
                let known = |channel: usize| if value(channel).is_nan() { 0.0 } else { value(channel) };
                *pixel = Vec3::from_array([0, 1, 2].map(known));
            }
        })
    }

    /// What is known of a pixel, which must lie in the picture.
    pub fn probe(&self, x: u32, y: u32) -> Probe {
        let (x, y) = (x as usize, y as usize);
        let mut means = Planes::<f32, { mean::PLANES }>::new(self.tiling.width as usize, 1);
        let mut means = means.row_mut(0);
        if self.has_surface() {
            self.mean_row(y, false, &mut means);
        } else {
            self.mean_radiance(y, &mut means[mean::RADIANCE..mean::REFLECTANCE]);
        }
        let at = |plane: usize| if means[plane][x].is_nan() { 0.0 } else { means[plane][x] };
        let three = |plane: usize| Vec3::new(at(plane), at(plane + 1), at(plane + 2));
        Probe {
            radiance: three(mean::RADIANCE),
            irradiance: three(mean::IRRADIANCE[0]) * std::f32::consts::PI,
            reflectance: three(mean::REFLECTANCE),
            normal: three(mean::NORMAL),
            distance: at(mean::DISTANCE),
        }
    }

    /// How far the mean is from its limit, judged by the spread of the independent replicates;
    /// `None` until each of them has `round` frames.
    pub fn estimate(&self, round: u32) -> Option<Estimate> {
        if self.repeated.len() < 2 || self.repeated.iter().any(|frames| *frames < round.max(1)) {
            return None;
        }
        let rows: Vec<Spread> = (0..self.tiling.height as usize)
            .into_par_iter()
            .map(|y| {
                let mut spread = Spread::new(self.repeated.len());
                let mut deviations = vec![0.0; self.repeated.len()];
                let rows = self.repeated_rows(y);
                for (x, channel) in (0..self.tiling.width as usize).flat_map(|x| (0..3).map(move |c| (x, c))) {
                    let mean = mean_of(&mut deviations, &rows, x, channel);
                    let scale = (mean * mean + RELATIVE_FLOOR).sqrt().recip();
                    deviations.iter_mut().for_each(|deviation| *deviation = (*deviation - mean) * scale);
                    spread.add(&deviations);
                }
                spread
            })
            .collect();
        // Added in order, so that the estimate is the same on any number of threads.
        rows.iter().fold(Spread::new(self.repeated.len()), Spread::plus).estimate()
    }

    /// A row of every replicate's sums, and the reciprocal of its number of frames.
    fn repeated_rows(&self, y: usize) -> Vec<([&[f32]; 3], f64)> {
        let planes = self.repetitions.iter().zip(&self.repeated);
        planes.map(|(planes, frames)| (planes.row(y), reciprocal(*frames))).collect()
    }

    /// Standard deviation of the mean of the replicates' means; 0 while one of them is empty.
    fn deviations(&self, y: usize, row: &mut [Vec3]) {
        let count = self.repeated.len() as f64;
        if count < 2.0 || self.repeated.contains(&0) {
            return;
        }
        let rows = self.repeated_rows(y);
        let mut values = vec![0.0; rows.len()];
        for (x, pixel) in row.iter_mut().enumerate() {
            *pixel = Vec3::from_array([0, 1, 2].map(|channel| {
                let mean = mean_of(&mut values, &rows, x, channel);
                let squares: f64 = values.iter().map(|value| (value - mean) * (value - mean)).sum();
                (squares / (count * (count - 1.0))).sqrt() as f32
            }));
        }
    }

    /// A picture whose rows are filled in parallel; they are black before.
    fn rows(&self, fill: impl Fn(usize, &mut [Vec3]) + Sync) -> Picture {
        let mut picture = Picture::black(self.tiling.width, self.tiling.height);
        let rows = picture.pixels.par_chunks_mut(self.tiling.width as usize);
        rows.enumerate().with_min_len(16).for_each(|(y, row)| fill(y, row));
        picture
    }
}

/// Which sums a frame begins: these it overwrites.
#[derive(Clone, Copy)]
struct First {
    of_half: bool,
    of_repetition: bool,
    of_all: bool,
}

/// Some rows of the film's sums; those that the scene does not need are empty.
struct BandSums<'a> {
    radiance: Band<'a, f64, 3>,
    emitted: Band<'a, f64, 3>,
    emits: &'a mut [bool],
    repetition: Band<'a, f32, 3>,
    guides: Band<'a, f32, GUIDE_PLANES>,
    first: First,
    /// Frames that a row stands for.
    weight: f32,
}

impl BandSums<'_> {
    /// Adds all rows of samples, the first of which is this one of the picture, with the widest vectors that the machine has:
    /// they compute the same bits. Number of samples that are not finite.
    fn take(&mut self, samples: &[Sample], row: FrameRow, place: (u32, bool)) -> u64 {
        #[cfg(target_arch = "x86_64")]
        if std::arch::is_x86_feature_detected!("avx2") {
            // SAFETY: the machine has just said that it has AVX2.
            return unsafe { self.take_avx2(samples, row, place) };
        }
        self.take_rows(samples, row, place)
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2")]
    fn take_avx2(&mut self, samples: &[Sample], row: FrameRow, place: (u32, bool)) -> u64 {
        self.take_rows(samples, row, place)
    }

    #[inline(always)]
    fn take_rows(&mut self, samples: &[Sample], mut frame_row: FrameRow, (top, is_mean): (u32, bool)) -> u64 {
        let mut dropped = 0;
        for row in 0..self.emits.len() {
            dropped += frame_row.gather(samples, top + row as u32, is_mean);
            self.add(row, &frame_row);
        }
        dropped
    }

    /// Adds a row of a frame.
    #[inline(always)]
    fn add(&mut self, row: usize, frame: &FrameRow) {
        let weight = self.weight;
        accumulate(self.radiance.row_mut(row), frame.radiance(), weight, self.first.of_half);
        accumulate(self.repetition.row_mut(row), frame.radiance(), weight, self.first.of_repetition);
        accumulate(self.guides.row_mut(row), frame.guide(), 1.0, self.first.of_all);
        // Most rows see no lamp: their sums are not even touched.
        if frame.emits {
            let begins = !std::mem::replace(&mut self.emits[row], true);
            accumulate(self.emitted.row_mut(row), frame.emitted(), weight, begins);
        }
    }
}

/// Adds planes, so many times, to sums, or begins them.
#[inline(always)]
fn accumulate<T: Copy + From<f32> + std::ops::AddAssign + std::ops::Mul<Output = T>, const N: usize>(
    sums: [&mut [T]; N],
    values: [&[f32]; N],
    weight: f32,
    begin: bool,
) {
    let weight = T::from(weight);
    for (sums, values) in sums.into_iter().zip(values) {
        let both = sums.iter_mut().zip(values);
        if begin {
            both.for_each(|(sum, value)| *sum = T::from(*value) * weight);
        } else {
            both.for_each(|(sum, value)| *sum += T::from(*value) * weight);
        }
    }
}

/// Means of a channel of a pixel by replicate into `values`, and their mean.
#[inline]
fn mean_of(values: &mut [f64], rows: &[([&[f32]; 3], f64)], x: usize, channel: usize) -> f64 {
    for (value, (planes, per_frame)) in values.iter_mut().zip(rows) {
        *value = f64::from(planes[channel][x]) * per_frame;
    }
    values.iter().sum::<f64>() / values.len() as f64
}

fn reciprocal(frames: u32) -> f64 {
    if frames == 0 { 0.0 } else { 1.0 / f64::from(frames) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_mean_of_2_to_the_25_frames_of_1_is_1() {
        let tiling = Tiling { width: 1, height: 1, tile_width: 1, tile_height: 1 };
        let mut film = Film::new(tiling, 1, Fields { emitted: true, surface: false });
        let grid = Grid { x: 0, y: 0, step_x: 1, step_y: 1, columns: 1, rows: 1 };
        let pixels = Pixels { emitted: vec![Vec3::ONE], ..Pixels::default() };
        let samples = [Sample { grid, light: Light::Frame(pixels) }];
        film.add(0, 0, &samples);
        let mut row = FrameRow::new(1);
        row.gather(&samples, 0, false);
        for _ in 1..1 << 25 {
            accumulate(film.radiance[0].row_mut(0), row.radiance(), 1.0, false);
        }
        film.halves[0] = 1 << 25;
        assert_eq!(film.picture().pixels[0], Vec3::ONE);
    }

    #[test]
    fn a_cleared_film_is_as_good_as_new() {
        let tiling = Tiling { width: 3, height: 2, tile_width: 3, tile_height: 2 };
        let grid = Grid { x: 0, y: 0, step_x: 1, step_y: 1, columns: 3, rows: 2 };
        let frame = |value: f32, lamps: usize| {
            let mut pixels = Pixels::black(6);
            pixels.emitted[..lamps].fill(Vec3::splat(value));
            pixels.irradiance.fill(Vec3::splat(value));
            pixels.reflectance.fill(Vec3::ONE);
            pixels.normal.fill(Vec3::Z);
            pixels.distance.fill(value);
            [Sample { grid, light: Light::Frame(pixels) }]
        };
        let fields = Fields { emitted: true, surface: true };
        let (mut used, mut new) = (Film::new(tiling, 2, fields), Film::new(tiling, 2, fields));
        for number in 0..4 {
            used.add(number % 2, (number % 2) as u8, &frame(7.0, 6));
        }
        used.clear();
        for film in [&mut used, &mut new] {
            film.add(0, 0, &frame(1.0, 2));
            film.add(1, 1, &frame(2.0, 0));
        }
        for plane in [Plane::Raw, Plane::Error, Plane::Albedo, Plane::Normal, Plane::Distance, Plane::Irradiance] {
            assert_eq!(used.plane(plane), new.plane(plane), "{plane:?}");
        }
        let distances: Vec<f32> = used.plane(Plane::Distance).pixels.iter().map(|distance| distance.x).collect();
        assert_eq!(used.distances(), distances);
    }

    #[test]
    fn a_mean_of_frames_is_as_good_as_the_frames() {
        let tiling = Tiling { width: 4, height: 2, tile_width: 4, tile_height: 2 };
        let grid = Grid { x: 0, y: 0, step_x: 1, step_y: 1, columns: 4, rows: 2 };
        let value = |frame: u32, pixel: usize| Vec3::new(frame as f32, pixel as f32 * 0.5, 1.0 / (1 + frame) as f32);
        let single = |frame: u32| {
            let mut pixels = Pixels::black(8);
            for pixel in 0..8 {
                // A lamp is seen in the first row only.
                pixels.emitted[pixel] = if pixel < 4 { value(frame, pixel) } else { Vec3::ZERO };
                pixels.reflectance[pixel] = Vec3::splat(0.5);
                pixels.irradiance[pixel] = value(frame, pixel) * 3.0;
                (pixels.normal[pixel], pixels.distance[pixel]) = (Vec3::Z, 2.0);
            }
            pixels
        };
        let mean = |frames: std::ops::Range<u32>| {
            let count = frames.len() as f32;
            let mut means = Means::black(8);
            for pixels in frames.map(single) {
                for pixel in 0..8 {
                    means.emitted[pixel] += pixels.emitted[pixel] / count;
                    means.reflected[pixel] += (pixels.radiance(pixel) - pixels.emitted[pixel]) / count;
                }
            }
            [Sample { grid, light: Light::Frames(means) }]
        };
        let fields = Fields { emitted: true, surface: true };
        let [mut one_by_one, mut at_once] = [(); 2].map(|()| Film::new(tiling, 2, fields));
        at_once.guide_by(2);
        for frame in 0..18 {
            let (half, sample) = (usize::from(frame >= 10), [Sample { grid, light: Light::Frame(single(frame)) }]);
            one_by_one.add(half, half as u8, &sample);
            if frame < 2 {
                at_once.add(half, half as u8, &sample);
            }
        }
        at_once.add_frames(0, 0, 8, &mean(2..10));
        at_once.add_frames(1, 1, 8, &mean(10..18));
        assert_eq!(at_once.halves(), one_by_one.halves());
        for plane in [Plane::Raw, Plane::Error, Plane::Albedo, Plane::Normal, Plane::Distance, Plane::Irradiance] {
            let [a, b] = [&at_once, &one_by_one].map(|film| film.plane(plane).pixels);
            for (a, b) in a.iter().zip(&b) {
                assert!(
                    (*a - *b).abs().max_element() <= 2e-6 * b.abs().max_element().max(1.0),
                    "{plane:?}: {a} is not {b}"
                );
            }
        }
    }
}
