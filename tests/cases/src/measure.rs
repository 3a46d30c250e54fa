//! Pictures straight from the light room, and how far to trust their means.
//!
//! Nothing is quantised or filtered here; that the wire and the master change nothing has cases of its
//! own. Sums are `f64`, frames in their order. A mean is taken over [`SEEDS`] independent seeds; frames
//! are added until its standard error is small enough, or a number of rays is used up that no machine
//! and no thread count changes.

use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};

use glam::DVec3;
use light::{LightSetCache, Prepared};
use protocol::answer::{Body, Cost};
use protocol::question::{Ask, Lit, Quality, Question, Rect, Samples, Tile};
use scenes::Scene;

use crate::case::{Effort, Exact, Finding, Method, SIGMAS, Trial};

/// Independent repetitions of every measurement.
pub const SEEDS: usize = 16;
/// Frames before anybody looks at the noise: less says nothing about it.
const FIRST_FRAMES: u32 = 2;

/// Sums of all pixels over some frames.
pub struct Exposure {
    /// Mean radiance of each pixel, row by row.
    pub pixels: Vec<DVec3>,
    /// What it cost.
    pub cost: Cost,
}

/// A scene before the camera.
pub struct Stage {
    /// Ready for questions.
    pub prepared: Prepared,
    cache: LightSetCache,
    quality: Quality,
    /// Path-traced instead.
    reference: bool,
}

/// A frame of the reference has so many samples a pixel.
const SAMPLES: u32 = 4;

impl Stage {
    /// Builds what there is to build.
    pub fn new(scene: &Scene, quality: Quality) -> Self {
        let prepared = Prepared::new(scene.clone());
        Self { prepared, cache: LightSetCache::default(), quality, reference: false }
    }

    /// Some frames of one seed.
    pub fn expose(&self, seed: u64, frames: std::ops::Range<u32>) -> Exposure {
        let camera = self.prepared.scene.camera;
        let mut exposure = Exposure {
            pixels: vec![DVec3::ZERO; camera.width as usize * camera.height as usize],
            cost: Cost::default(),
        };
        let count = frames.len() as f64;
        for ask in frames.flat_map(|frame| self.questions(seed, frame)) {
            self.answer(ask, &mut exposure);
        }
        exposure.pixels.iter_mut().for_each(|pixel| *pixel /= count);
        exposure
    }

    /// All questions of a frame.
    fn questions(&self, seed: u64, frame: u32) -> Vec<Ask> {
        let (camera, quality) = (self.prepared.scene.camera, self.quality);
        let rect = Rect { x: 0, y: 0, width: camera.width, height: camera.height };
        if self.reference {
            // K vertices of a light path, and the reflection towards the eye.
            let max_bounces = quality.max_length.map(|most| u32::from(most) + 1);
            let first = frame * SAMPLES;
            return vec![Ask::Reference(Samples { camera, rect, first, count: SAMPLES, seed, max_bounces })];
        }
        (0..quality.sets())
            .map(|set| Ask::Tile(Tile { camera, rect, lit: Lit { set, frame, seed, quality } }))
            .collect()
    }

    fn answer(&self, ask: Ask, exposure: &mut Exposure) {
        let width = self.prepared.scene.camera.width as usize;
        let question = Question { world: Default::default(), ask };
        let answer = light::answer(&self.prepared, &self.cache, &question, &|| 0);
        match (&answer.body, &question.ask) {
            (Body::Pixels(pixels), Ask::Tile(tile)) => {
                for (i, [x, y]) in tile.grid().pixels().enumerate() {
                    exposure.pixels[y as usize * width + x as usize] += pixels.radiance(i).as_dvec3();
                }
            }
            (Body::Moments(moments), _) => {
                for (pixel, sum) in exposure.pixels.iter_mut().zip(&moments.sum) {
                    *pixel += *sum / f64::from(SAMPLES);
                }
            }
            // An answer to another question than was asked: shows as what it is.
            _ => exposure.pixels.fill(DVec3::NAN),
        }
        exposure.cost += answer.cost;
    }
}

/// Mean radiance of each pixel over some frames of one seed.
pub fn picture(scene: &Scene, quality: &Quality, frames: u32, seed: u64) -> Vec<DVec3> {
    Stage::new(scene, *quality).expose(seed, 0..frames).pixels
}

/// What a scene's noise costs to get rid of: relative variance of a pixel times rays, from pairs of seeds.
pub fn expense(scene: &Scene, quality: &Quality) -> f64 {
    let stage = Stage::new(scene, *quality);
    let (mut squares, mut rays) = (0.0, 0);
    for pair in 0..EXPENSE_PAIRS {
        let [a, b] = [0, 1].map(|seed| stage.expose(2 * pair + seed, 0..EXPENSE_FRAMES));
        let apart = |(a, b): (&DVec3, &DVec3)| ((*a - *b).length() / (*a + *b).length().max(f64::MIN_POSITIVE)).powi(2);
        squares += a.pixels.iter().zip(&b.pixels).map(apart).sum::<f64>();
        rays += a.cost.rays() + b.cost.rays();
    }
    squares * rays as f64
}

/// Pairs of seeds, and frames of each, that tell variances apart by a tenth.
const EXPENSE_PAIRS: u64 = 24;
const EXPENSE_FRAMES: u32 = 3;

/// Mean over pixels and channels.
pub fn mean(picture: &[DVec3]) -> f64 {
    picture.iter().map(|p| p.element_sum() / 3.0).sum::<f64>() / picture.len() as f64
}

/// Number of pixels that are not finite or negative.
pub fn unsound(picture: &[DVec3]) -> usize {
    picture.iter().filter(|p| !p.is_finite() || p.min_element() < 0.0).count()
}

/// A mean with its standard error.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Estimate {
    /// Over all seeds.
    pub mean: f64,
    /// Of the mean.
    pub error: f64,
    /// Frames of each seed.
    pub frames: u32,
    /// Samples that were not finite and were dropped.
    pub dropped: u64,
}

impl Trial<'_> {
    /// The knobs of the method, changed as little as measuring allows: one replicate, so that all
    /// frames of a seed are one sequence.
    ///
    /// # Panics
    /// For [`Method::Machinery`], which has no light.
    pub fn quality(&self) -> Quality {
        match self.method {
            Method::Igi | Method::Reference => Quality { replicates: 1, ..Quality::default() },
            Method::Bounded => Quality { replicates: 1, bias_compensation: false, ..Quality::default() },
            Method::Paper => Quality::paper(),
            Method::Machinery => panic!("the machinery makes no light"),
        }
    }

    /// For rooms where all light matters alike. More light paths where they are long: one path's lights are all
    /// alike in strength. No importance, which drops nothing here and takes nine tenths of the time to find
    /// that out; emitters, panes and keyholes are measured with it.
    pub fn quality_for(&self, albedo: f32) -> Quality {
        let quality = self.quality();
        Quality { vpls: if albedo > 0.8 { 128 } else { quality.vpls }, importance: false, ..quality }
    }

    /// For what a brief run is too short to know well: then eight per cent have to do.
    pub fn roughly(&self) -> Self {
        let effort = if self.effort == Effort::Brief { Effort::Rough } else { self.effort };
        Self { effort, ..*self }
    }

    /// For what takes all the rays that it is allowed: the usual run takes no more than a brief one.
    pub fn briefly(&self) -> Self {
        let effort = if self.effort == Effort::Usual { Effort::Brief } else { self.effort };
        Self { effort, ..*self }
    }

    /// Rays after which a measurement is given up: a second or two, ten, a minute of one core.
    fn rays_most(&self) -> u64 {
        match self.effort {
            Effort::Brief => 16_000_000,
            Effort::Rough | Effort::Usual | Effort::Thorough => 80_000_000,
            Effort::Long => 500_000_000,
        }
    }

    /// What four standard errors have to be below, relative to what is expected; the longest runs know no better than
    /// what the table tolerates.
    pub fn resolution(&self, tolerance: f64) -> f64 {
        let resolution = self.effort.resolution();
        if self.effort == Effort::Long { resolution.max(tolerance) } else { resolution }
    }

    /// The method's own picture beside the exact answer.
    pub fn exact(&self, exact: &Exact) -> Finding {
        self.agrees(exact, &self.quality(), exact.radiance)
    }

    /// A picture by other knobs, beside an answer that may be wrong on purpose.
    pub fn agrees(&self, exact: &Exact, quality: &Quality, expected: f64) -> Finding {
        self.compare(exact.name.clone(), &exact.scene, quality, expected, exact.tolerance)
    }

    /// The mean of a picture beside what it should be; `tolerance` is relative.
    pub fn compare(&self, what: String, scene: &Scene, quality: &Quality, expected: f64, tolerance: f64) -> Finding {
        let resolution = self.resolution(tolerance) * expected.abs();
        let estimate = self.estimate(scene, quality, resolution);
        let mut finding =
            Finding { error: estimate.error, resolution, ..Finding::exact(what, expected, estimate.mean, tolerance) };
        if estimate.dropped > 0 {
            // A sample that had to be dropped is a bug even where its absence hides in the noise.
            finding.got = f64::NAN;
            finding.note = format!("{} samples were not finite", estimate.dropped);
        }
        finding
    }

    /// Mean of the picture, frames added until four standard errors are below `resolution` (absolute). NaN if nobody
    /// wants to know any more.
    pub fn estimate(&self, scene: &Scene, quality: &Quality, resolution: f64) -> Estimate {
        let stage = Stage { reference: self.method == Method::Reference, ..Stage::new(scene, *quality) };
        let (mut sums, mut rays, mut dropped) = ([0.0; SEEDS], 0, 0);
        let (mut frames, mut step) = (0, FIRST_FRAMES);
        loop {
            let exposures = self.each_seed(|seed| {
                let exposure = stage.expose(seed, frames..frames + step);
                (mean(&exposure.pixels) * f64::from(step), exposure.cost)
            });
            if (self.stop)() {
                return Estimate { mean: f64::NAN, error: f64::NAN, frames, dropped };
            }
            for (sum, (light, cost)) in sums.iter_mut().zip(exposures) {
                *sum += light;
                rays += cost.rays();
                dropped += cost.dropped;
            }
            frames += step;
            step = frames;
            let (mean, error) = spread(&sums.map(|sum| sum / f64::from(frames)));
            if SIGMAS * error <= resolution || rays > self.rays_most() || !mean.is_finite() {
                return Estimate { mean, error, frames, dropped };
            }
        }
    }

    /// One value a seed, on all threads, in the order of the seeds; fewer if nobody wants to know any more.
    fn each_seed<T: Send>(&self, value: impl Fn(u64) -> T + Sync) -> Vec<T> {
        let next = AtomicUsize::new(0);
        let values = Mutex::new(Vec::with_capacity(SEEDS));
        std::thread::scope(|scope| {
            for _ in 0..self.threads.clamp(1, SEEDS) {
                scope.spawn(|| {
                    loop {
                        let seed = next.fetch_add(1, Ordering::Relaxed);
                        if seed >= SEEDS || (self.stop)() {
                            return;
                        }
                        let value = value(seed as u64);
                        values.lock().unwrap_or_else(PoisonError::into_inner).push((seed, value));
                    }
                });
            }
        });
        let mut values = values.into_inner().unwrap_or_else(PoisonError::into_inner);
        values.sort_by_key(|(seed, _)| *seed);
        values.into_iter().map(|(_, value)| value).collect()
    }
}

/// Mean and its standard error.
fn spread(values: &[f64]) -> (f64, f64) {
    let count = values.len() as f64;
    let middle = values.iter().sum::<f64>() / count;
    let variance = values.iter().map(|v| (v - middle).powi(2)).sum::<f64>() / (count - 1.0);
    (middle, (variance / count).sqrt())
}
