//! Light that sampling does not find: a few path-traced samples a frame, and whether they see more than the film.
//!
//! **Why.** The error estimate compares replicates with each other. Light that all of them almost never find (a table that
//! leaves out the sun, a lamp that is never chosen, a caustic that nobody aims at) is missing from each, and they agree.
//! The path tracer is another program for the same integral (see `worker/light/src/reference`): what light sampling lacks it
//! meets by chance, or chooses by tables of its own.
//!
//! **How.** From the second frame on, each asks for one sample of every pixel of one square of [`EDGE`] pixels; squares take turns
//! over the picture. Samples minus the film's mean at the same pixels are averaged over the picture and over
//! [`REGIONS`]² parts of it. Where that mean is above zero by [`SURE`] times what chance can do, light is missing, and its relative
//! square is added to the estimate. Chance is the samples' own spread, and as much as the film itself may err there by its
//! replicates.
//!
//! **Limits.** Only light that is too little shows: the path tracer itself does not find the light of points and suns in
//! curved glass, and meets caustics of small lamps rarely. N frames of a picture of P pixels find a share of missing
//! light of about 4 σ / √(N · 256), σ ≈ 1 … 3 being the relative spread of a path: a tenth after some ten frames, a hundredth
//! after some thousand. It costs a path for every P / 256 pixels a frame.

use protocol::answer::Moments;
use protocol::question::{Ask, Quality, Question, Rect, Samples};

use super::Setup;
use crate::Picture;
use crate::metrics::{Estimate, RELATIVE_FLOOR};
use crate::parts::Tiling;

/// Edge of the squares, pixels. More: surer, and a larger part of the work.
const EDGE: u32 = 16;
/// Parts of the picture along each axis that are judged by themselves. More: smaller faults are found, later.
const REGIONS: u32 = 8;
/// Fewer samples prove nothing.
const SAMPLES_MIN: f64 = 64.0;
/// Standard deviations that are believed. More: fewer false alarms (3 in 10⁵ a region at 4), and faults are found later.
const SURE: f64 = 4.0;

/// Path-traced samples so far, pixel by pixel: how many, and the sums of their values and squares, both
/// means of the channels.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct CrossCheck {
    tiling: Tiling,
    /// The first frames are asked for one by one, later ones so many at once.
    young: u32,
    at_once: u32,
    counts: Vec<u32>,
    sums: Vec<f64>,
    squares: Vec<f64>,
}

impl CrossCheck {
    /// No sample yet. So many frames are asked for one by one, later ones `at_once`, at least 1, at a time.
    pub fn new([width, height]: [u32; 2], young: u32, at_once: u32) -> Self {
        let tiling = Tiling { width, height, tile_width: EDGE.min(width), tile_height: EDGE.min(height) };
        let len = width as usize * height as usize;
        Self { tiling, young, at_once, counts: vec![0; len], sums: vec![0.0; len], squares: vec![0.0; len] }
    }

    /// Memory, bytes a pixel.
    pub const BYTES_PER_PIXEL: u64 = (size_of::<u32>() + 2 * size_of::<f64>()) as u64;

    /// What settings leave out for ever is not to be found.
    pub fn suits(quality: &Quality) -> bool {
        let Quality { bound, bias_compensation, max_length, indirect_caustics, .. } = quality;
        let is_whole = *bias_compensation || *bound == protocol::question::Bound::None;
        is_whole && max_length.is_none() && (*indirect_caustics || quality.photons > 0)
    }

    /// What is asked with a frame: a square of pixels, and how many samples of each. `None` in the first frame, which people
    /// wait for, and where frames are old in all but every so many. The number of the frame alone decides, not whether it is
    /// asked for with others.
    fn turn(&self, frame: u32) -> Option<(Rect, u32)> {
        let [young, at_once] = [self.young, self.at_once];
        let (turn, count) = match frame.checked_sub(young) {
            None => (frame.checked_sub(1)?, 1),
            Some(old) if old.is_multiple_of(at_once) => ((young + old / at_once).checked_sub(1)?, at_once),
            Some(_) => return None,
        };
        let squares = self.tiling.len() as u64;
        // Neighbours in time are far from each other: steps of about the golden section, which meet every square.
        let step = (1..=squares * 5 / 8).rev().find(|step| gcd(*step, squares) == 1).unwrap_or(1);
        Some((self.tiling.rect((u64::from(turn) * step % squares) as usize), count))
    }

    /// Number of pixels that the answer to a frame's question has; `None` if there is none.
    pub fn pixels(&self, frame: u32) -> Option<usize> {
        self.turn(frame).map(|(rect, _)| rect.len())
    }

    /// The question that goes with a frame.
    pub fn question(&self, frame: u32, setup: &Setup) -> Option<Question> {
        let Setup { world, camera, seed, .. } = *setup;
        let (rect, count) = self.turn(frame)?;
        let samples = Samples { camera, rect, first: frame, count, seed, max_bounces: None };
        Some(Question { world, ask: Ask::Reference(samples) })
    }

    /// Adds the answer; it has as many pixels as it should.
    pub fn add(&mut self, frame: u32, samples: &Moments) {
        let Some((rect, count)) = self.turn(frame) else { return };
        for ([x, y], (sum, squares)) in rect.pixels().zip(samples.sum.iter().zip(&samples.squares)) {
            let pixel = y as usize * self.tiling.width as usize + x as usize;
            self.counts[pixel] += count;
            self.sums[pixel] += sum.element_sum() / 3.0;
            // At least the square of the channels' mean.
            self.squares[pixel] += squares.element_sum() / 3.0;
        }
    }

    /// The estimate, and in it what is missing from the film, whose mean and its standard deviation by the replicates these are.
    pub fn corrected(&self, estimate: Estimate, mean: &Picture, deviation: &Picture) -> Estimate {
        let Tiling { width, height, .. } = self.tiling;
        let regions = REGIONS.min(width).min(height) as usize;
        let mut parts = vec![Part::default(); regions * regions];
        for (index, (mean, deviation)) in mean.pixels.iter().zip(&deviation.pixels).enumerate() {
            let (x, y) = (index % width as usize, index / width as usize);
            let part = &mut parts[y * regions / height as usize * regions + x * regions / width as usize];
            let (value, count) = (f64::from(mean.element_sum()) / 3.0, f64::from(self.counts[index]));
            part.pixels += 1.0;
            part.mean += value;
            part.deviation += f64::from(deviation.element_sum()) / 3.0;
            part.count += count;
            part.excess += self.sums[index] - count * value;
            part.squares += self.squares[index] - 2.0 * value * self.sums[index] + count * value * value;
        }
        let here = parts.iter().map(Part::missing).sum::<f64>() / parts.len() as f64;
        let all = parts.iter().fold(Part::default(), Part::plus).missing();
        let missing = here.max(all);
        let Estimate { rel_mse, low, high } = estimate;
        Estimate { rel_mse: rel_mse + missing, low: low + missing, high: high + missing }
    }

    /// Appends all sums, little endian.
    pub fn write(&self, out: &mut Vec<u8>) {
        self.counts.iter().for_each(|count| out.extend(count.to_le_bytes()));
        self.sums.iter().chain(&self.squares).for_each(|value| out.extend(value.to_le_bytes()));
    }

    /// Takes sums from the front of `bytes`; `None` if there are too few.
    pub fn read(&mut self, bytes: &mut &[u8]) -> Option<()> {
        for count in &mut self.counts {
            let (first, rest) = bytes.split_first_chunk()?;
            (*count, *bytes) = (u32::from_le_bytes(*first), rest);
        }
        for value in self.sums.iter_mut().chain(&mut self.squares) {
            let (first, rest) = bytes.split_first_chunk()?;
            (*value, *bytes) = (f64::from_le_bytes(*first), rest);
        }
        Some(())
    }
}

/// Sums over a part of the picture.
#[derive(Clone, Debug, Default)]
struct Part {
    pixels: f64,
    /// The film's means and their deviations.
    mean: f64,
    deviation: f64,
    /// Number of samples; what they have more than the film, and its square.
    count: f64,
    excess: f64,
    squares: f64,
}

impl Part {
    fn plus(self, other: &Self) -> Self {
        Self {
            pixels: self.pixels + other.pixels,
            mean: self.mean + other.mean,
            deviation: self.deviation + other.deviation,
            count: self.count + other.count,
            excess: self.excess + other.excess,
            squares: self.squares + other.squares,
        }
    }

    /// Relative square of the light that is surely missing; 0 if none is.
    fn missing(&self) -> f64 {
        if self.count < SAMPLES_MIN {
            return 0.0;
        }
        let excess = self.excess / self.count;
        let variance = (self.squares / self.count - excess * excess).max(0.0) / self.count;
        // Neighbouring pixels of the film err alike: their mean may err as much as they do.
        let film = self.deviation / self.pixels;
        if excess <= SURE * (variance + film * film).sqrt() {
            return 0.0;
        }
        let truth = self.mean / self.pixels + excess;
        excess * excess / (truth * truth + RELATIVE_FLOOR)
    }
}

/// Greatest common divisor (Euclid).
fn gcd(a: u64, b: u64) -> u64 {
    if b == 0 { a } else { gcd(b, a % b) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{DVec3, Vec3};

    const SIZE: [u32; 2] = [64, 48];

    /// After `frames` frames of a wall of radiance 1, of which the film lacks `missing` in the left half.
    fn estimate(frames: u32, missing: f32) -> Estimate {
        let [width, height] = SIZE;
        let mut check = CrossCheck::new(SIZE, 100, 9);
        for frame in 0..frames {
            let Some((rect, count)) = check.turn(frame) else { continue };
            let mut samples = Moments::zero(rect.len());
            let squares = samples.squares.iter_mut();
            for (index, (sum, square)) in samples.sum.iter_mut().zip(squares).enumerate() {
                for number in 0..count {
                    // Half of the paths find twice the light.
                    let address = u64::from(frame + number) * 4096 + index as u64 + 1;
                    let mixed = address.wrapping_mul(0x9e37_79b9_7f4a_7c15);
                    let mixed = (mixed ^ (mixed >> 29)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
                    let value = DVec3::splat(f64::from((mixed >> 40 & 1) as u32) * 2.0);
                    *sum += value;
                    *square += value * value;
                }
            }
            check.add(frame, &samples);
        }
        let film = |x: u32| if x < width / 2 { 1.0 - missing } else { 1.0 };
        let pixels = (0..width * height).map(|index| Vec3::splat(film(index % width))).collect();
        let mean = Picture { width, height, pixels };
        let deviation = Picture { width, height, pixels: vec![Vec3::splat(0.01); (width * height) as usize] };
        check.corrected(Estimate { rel_mse: 1e-4, low: 5e-5, high: 2e-4 }, &mean, &deviation)
    }

    #[test]
    fn light_that_is_missing_shows_in_the_estimate() {
        let Estimate { rel_mse, low, high } = estimate(800, 0.15);
        // 0.15² of half of the picture.
        assert!((0.008..0.016).contains(&rel_mse), "{rel_mse}");
        assert!(low < rel_mse && rel_mse < high);
    }

    #[test]
    fn where_nothing_is_missing_the_estimate_stays() {
        for frames in [1, 2, 5, 20, 100, 500] {
            assert_eq!(estimate(frames, 0.0).rel_mse, 1e-4, "{frames} frames");
        }
        // Too much is none of this check's business: the path tracer finds less of some light.
        assert_eq!(estimate(200, -0.5).rel_mse, 1e-4);
    }

    #[test]
    fn every_pixel_has_its_turn() {
        for [width, height] in [[1, 1], [16, 16], [17, 5], [64, 48], [101, 33], [400, 300]] {
            let mut check = CrossCheck::new([width, height], 5, 4);
            let squares = check.tiling.len() as u32;
            let turns = (0..).filter(|frame| check.turn(*frame).is_some()).take(squares as usize);
            for frame in turns.collect::<Vec<u32>>() {
                check.add(frame, &Moments::zero(check.pixels(frame).unwrap()));
            }
            assert!(check.counts.iter().all(|count| *count > 0), "{width}x{height}");
        }
    }
}
