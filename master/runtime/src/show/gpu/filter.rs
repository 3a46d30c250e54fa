//! The discontinuity buffer as compute shaders: smoothing, then fading.
//!
//! Sums are added in the oracle's order, but processors may fuse operations: pixels differ by a few parts in a million,
//! except where a comparison (is it the same surface?) is decided by the last bit, and one neighbour more or less counts.

use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};

use bytemuck::{Pod, Zeroable};
use frame::Picture;
use frame::parts::{Edges, Guide, Smoother};

use super::{Gpu, Kept};

/// Smooths on a graphics processor; not at all from its first failure on.
pub struct GpuSmoother {
    gpu: Gpu,
    /// One picture at a time.
    bench: Mutex<Bench>,
    failed: AtomicBool,
}

/// Shaders, and what they work on.
struct Bench {
    kernels: [wgpu::ComputePipeline; 3],
    parameters: Kept,
    taps: Kept,
    means: Kept,
    changes: Kept,
    picture: Kept,
    back: Kept,
}

#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct Parameters {
    width: u32,
    height: u32,
    stride: u32,
    margin: u32,
    planes: u32,
    columns: u32,
    rows: u32,
    judged: u32,
    by_planes: u32,
    /// Smallest cosine.
    cosine: f32,
    /// Largest share of the distance.
    distance: f32,
    share_a: f32,
    share_b: f32,
    noise_at_most: f32,
}

impl GpuSmoother {
    /// Makes the shaders ready.
    pub fn new(gpu: Gpu) -> Self {
        let kernels = gpu.kernels(include_str!("filter.wgsl"), ["smooth_irradiance", "blur", "fade"]);
        let [parameters, taps, means, changes, picture, back] = [(); 6].map(|()| Kept::default());
        let bench = Mutex::new(Bench { kernels, parameters, taps, means, changes, picture, back });
        Self { gpu, bench, failed: AtomicBool::new(false) }
    }

    fn try_smooth(&self, guide: &Guide) -> Result<Picture, String> {
        let (by_planes, cosine, distance) = match guide.edges {
            Edges::Planes { cosine } => (1, cosine, 0.0),
            Edges::Thresholds { distance, cosine } => (0, cosine, distance),
        };
        let [share_a, share_b] = guide.shares;
        let parameters = Parameters {
            width: guide.width,
            height: guide.height,
            stride: guide.stride() as u32,
            margin: Guide::MARGIN as u32,
            planes: Guide::PLANES as u32,
            columns: guide.columns.len() as u32,
            rows: guide.rows_of_window.len() as u32,
            judged: u32::from(guide.judged),
            by_planes,
            cosine,
            distance,
            share_a,
            share_b,
            noise_at_most: guide.noise_at_most,
        };
        let taps: Vec<f32> = guide
            .columns
            .iter()
            .chain(&guide.rows_of_window)
            .flat_map(|(offset, weight)| [*offset as f32, *weight])
            .collect();
        let pixels = u64::from(guide.width) * u64::from(guide.height);
        let mut bench = self.bench.lock().map_err(|_| "a picture was left half done")?;
        let bench = &mut *bench;
        let parameters = self.gpu.input(&mut bench.parameters, bytemuck::bytes_of(&parameters))?;
        let taps = self.gpu.input(&mut bench.taps, bytemuck::cast_slice(&taps))?;
        let means = self.gpu.input(&mut bench.means, bytemuck::cast_slice(guide.values()))?;
        let changes = self.gpu.room(&mut bench.changes, CHANGES * 4 * pixels)?;
        let picture = self.gpu.room(&mut bench.picture, 3 * 4 * pixels)?;
        let smooth = [(0, &parameters), (1, &taps), (2, &means), (3, &changes)];
        let blur = [(0, &parameters), (1, &taps), (3, &changes)];
        let fade = [(0, &parameters), (2, &means), (3, &changes), (4, &picture)];
        let [smoothing, blurring, fading] = &bench.kernels;
        let judging = [(smoothing, &smooth[..]), (blurring, &blur[..]), (fading, &fade[..])];
        let plain = [(smoothing, &smooth[..]), (fading, &fade[..])];
        let passes = if guide.judged { &judging[..] } else { &plain[..] };
        let bytes = self.gpu.run(passes, [guide.width, guide.height], &picture, &mut bench.back)?;
        Ok(Picture { width: guide.width, height: guide.height, pixels: bytemuck::pod_collect_to_vec(&bytes) })
    }
}

/// Values that lie between the shaders, a pixel: three changes, square, noise, change of each half, blur, its noise.
const CHANGES: u64 = 9;

impl Smoother for GpuSmoother {
    fn smooth(&self, guide: &Guide) -> Option<Picture> {
        if self.failed.load(Ordering::Relaxed) || guide.values().is_empty() {
            return None;
        }
        match self.try_smooth(guide) {
            Ok(picture) => Some(picture),
            Err(reason) => {
                tracing::warn!("smoothing goes on without the graphics processor: {reason}");
                self.failed.store(true, Ordering::Relaxed);
                None
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use frame::parts::{Film, Filter, Light, Sample, Tiling, smoothed, smoothed_by};
    use glam::Vec3;
    use protocol::answer::{Fields, Pixels};
    use protocol::question::{Lit, Quality, Tile};
    use scenes::Camera;
    use scenes::camera::Lens;

    use super::super::tests::any;
    use super::*;

    const CAMERA: Camera = Camera {
        origin: Vec3::new(0.0, 1.0, 3.0),
        target: Vec3::new(0.0, 0.5, 0.0),
        up: Vec3::Y,
        fov_y_deg: 50.0,
        width: 157,
        height: 101,
        two_point: false,
        cut: false,
    };
    const LARGE: Camera = Camera { width: 640, height: 480, ..CAMERA };

    /// A number from 0 to 1 that looks as if there were no rule.
    fn noise(x: u32, y: u32, frame: u32, what: u32) -> f32 {
        let mut bits = x ^ (y << 10) ^ (frame << 20) ^ (what << 27);
        for _ in 0..3 {
            bits = (bits ^ (bits >> 16)).wrapping_mul(0x7feb_352d).wrapping_add(0x9e37_79b9);
        }
        (bits >> 8) as f32 / (1 << 24) as f32
    }

    /// What a frame sees at a pixel of a floor, a wall behind it, a lamp and a hole: emitted, reflectance, irradiance,
    /// normal, distance.
    fn seen(lens: &Lens, x: u32, y: u32, frame: u32) -> (Vec3, Vec3, Vec3, Vec3, f32) {
        let jitter = |what| noise(x, y, frame, what);
        let direction = lens.direction(x as f32 + jitter(0), y as f32 + jitter(1));
        let to_floor = if direction.y < 0.0 { -1.0 / direction.y } else { f32::INFINITY };
        let to_wall = if direction.z < 0.0 { -5.0 / direction.z } else { f32::INFINITY };
        let (distance, normal) = if to_floor < to_wall { (to_floor, Vec3::Y) } else { (to_wall, Vec3::Z) };
        if (20..30).contains(&x) && (10..30).contains(&y) {
            return (Vec3::ZERO, Vec3::ZERO, Vec3::ZERO, Vec3::ZERO, 0.0);
        }
        let emitted = if (60..70).contains(&x) && y < 12 { Vec3::new(5.0, 4.0, 3.0) } else { Vec3::ZERO };
        let texture = if (x / 7 + y / 5).is_multiple_of(2) { Vec3::new(0.8, 0.0, 0.3) } else { Vec3::splat(0.5) };
        let shadow = if x > 100 { 0.2 } else { 1.0 };
        let light = Vec3::new(1.0, 0.8, 0.6) * shadow * (0.5 + jitter(2));
        (emitted, texture, light, normal, distance)
    }

    fn film(camera: Camera, frames: u32, quality: &Quality) -> Film {
        let (tiling, lens) = (Tiling::of(camera.width, camera.height, quality), camera.lens());
        let mut film = Film::new(tiling, 1, Fields { emitted: true, surface: true });
        for frame in 0..frames {
            let tiles = (0..tiling.len()).flat_map(|rect| (0..quality.sets()).map(move |set| (rect, set)));
            let samples: Vec<Sample> = tiles
                .map(|(rect, set)| {
                    let quality = *quality;
                    let tile = Tile { camera, rect: tiling.rect(rect), lit: Lit { set, frame, seed: 0, quality } };
                    let grid = tile.grid();
                    let mut pixels = Pixels::black(0);
                    for [x, y] in grid.pixels() {
                        let (emitted, reflectance, irradiance, normal, distance) = seen(&lens, x, y, frame);
                        pixels.emitted.push(emitted);
                        pixels.reflectance.push(reflectance);
                        pixels.irradiance.push(irradiance);
                        pixels.normal.push(normal);
                        pixels.distance.push(distance);
                    }
                    Sample { grid, light: Light::Frame(pixels) }
                })
                .filter(|sample| !sample.grid.is_empty())
                .collect();
            film.add(frame as usize % 2, 0, &samples);
        }
        film
    }

    #[test]
    fn pictures_are_those_of_the_processor_but_for_last_bits() {
        let Some(gpu) = any() else { return };
        let smoother = GpuSmoother::new(gpu);
        let quality = Quality { interleave: [3, 3], ..Quality::default() };
        for (frames, filter) in [
            (1, Filter::plane([3, 3])),
            (1, Filter::paper([3, 3])),
            (1, Filter::plane([16, 5])),
            (8, Filter::plane([3, 3])),
            (8, Filter::plane([4, 4])),
            (9, Filter::paper([5, 5])),
        ] {
            let film = film(CAMERA, frames, &quality);
            let here = smoothed(&film, &CAMERA, &filter, 2);
            let there = smoothed_by(Some(&smoother), &film, &CAMERA, &filter, 2);
            assert!(!smoother.failed.load(Ordering::Relaxed), "it was done there");
            assert_ne!(here, smoothed(&film, &CAMERA, &Filter::OFF, 2), "it does something");
            let apart = |a: &Vec3, b: &Vec3| (*a - *b).abs().max_element() / (0.01 + a.abs().max_element());
            let differences: Vec<f32> = here.pixels.iter().zip(&there.pixels).map(|(a, b)| apart(a, b)).collect();
            assert!(differences.iter().all(|d| d.is_finite()));
            let large = differences.iter().filter(|d| **d > 2e-5).count() as f64 / differences.len() as f64;
            assert!(large < 0.002, "{frames} {filter:?}: {large} of the pixels differ");
        }
    }

    /// What it takes, for who asks: `cargo test --release -p runtime --features window what_it_takes -- --ignored --nocapture`.
    #[test]
    #[ignore = "a measurement, not a judgement"]
    fn what_it_takes() {
        let Some(gpu) = any() else { return };
        let (smoother, filter) = (GpuSmoother::new(gpu.clone()), Filter::plane([3, 3]));
        let quality = Quality { interleave: [3, 3], ..Quality::default() };
        let film = film(LARGE, 8, &quality);
        let mut tone_mapper = super::super::tone::GpuToneMapper::new(gpu.clone());
        let picture = smoothed(&film, &LARGE, &filter, 2);
        let tone = frame::tone::Tone::PLAIN;
        let ms = |work: &mut dyn FnMut()| {
            work();
            let began = std::time::Instant::now();
            (0..20).for_each(|_| work());
            began.elapsed().as_secs_f64() * 50.0
        };
        let here = ms(&mut || drop(smoothed(&film, &LARGE, &filter, 2)));
        let there = ms(&mut || drop(smoothed_by(Some(&smoother), &film, &LARGE, &filter, 2)));
        let (width, height) = (LARGE.width, LARGE.height);
        println!("{width}x{height}: smoothing {here:.2} ms here, {there:.2} ms on {}", gpu.name());
        let here = ms(&mut || drop(tone.develop(&picture)));
        let there = ms(&mut || drop(crate::display::encoded::ToneMapper::tone_map(&mut tone_mapper, &tone, &picture)));
        println!("{width}x{height}: tone mapping {here:.2} ms here, {there:.2} ms on {}", gpu.name());
    }
}
