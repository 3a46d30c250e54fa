//! Rows 34 to 36 and 43: pixels on the wire, pictures of any size, sums over any number of frames.

use std::collections::BTreeSet;

use frame::Igi;
use frame::parts::{Film, Light, Sample, Tiling};
use glam::{DVec3, Vec3};
use protocol::answer::{Body, Fields, Pixels};
use protocol::pack;
use protocol::question::{Ask, Grid, Lit, Quality, Question, Rect, Tile};
use scenes::Camera;

use crate::case::{Case, Finding, Method, Pace, Trial};
use crate::measure::Stage;
use crate::worlds::{furnaces, stress};

use Method::{Igi as IgiMethod, Machinery};
use Pace::{Long, Quick};

/// The cases.
pub const CASES: &[Case] = &[
    Case {
        row: 34,
        name: "wire-range",
        teaches: "irradiance from 10⁻³ to 10⁹ in one tile crosses the wire without overflow or bias",
        pace: Quick,
        methods: &[Machinery],
        run: |_| wire_range(),
    },
    Case {
        row: 34,
        name: "wire-normals",
        teaches: "normals keep their direction in 24 bits",
        pace: Quick,
        methods: &[Machinery],
        run: |_| vec![wire_normals()],
    },
    Case {
        row: 35,
        name: "odd-sizes",
        teaches: "pictures smaller than a block or a tile: every pixel in every frame, every set in turn",
        pace: Quick,
        methods: &[Machinery],
        run: |_| odd_sizes(),
    },
    Case {
        row: 35,
        name: "odd-sizes-of-light",
        teaches: "the same pictures have the right light",
        pace: Quick,
        methods: &[IgiMethod],
        run: |trial| {
            let exact = furnaces::furnace_sphere(0.5);
            let each = [(1, 1), (1, 7), (97, 2)].map(|size| {
                let scene = stress::sized(&exact.scene, size);
                let quality = trial.quality_for(0.5);
                trial.compare(format!("{}x{}", size.0, size.1), &scene, &quality, exact.radiance, 1e-3)
            });
            each.into()
        },
    },
    Case {
        row: 36,
        name: "two-to-the-28-pixels",
        teaches: "the last pixel of 16384² is addressed like the first, and its memory is counted in 64 bits",
        pace: Quick,
        methods: &[Machinery],
        run: two_to_the_28_pixels,
    },
    Case {
        row: 43,
        name: "ones-after-two-to-the-24",
        teaches: "a sum of 2²⁴ goes on to grow by ones: in single precision it does not",
        pace: Quick,
        methods: &[Machinery],
        run: |_| {
            let frames = 64;
            let mean = mean_of(std::iter::once(16_777_216.0).chain(std::iter::repeat_n(1.0, frames)));
            let all = frames as f64 + 1.0;
            vec![Finding::exact("mean of 2²⁴ and 64 ones", (16_777_216.0 + frames as f64) / all, mean, 1e-7)]
        },
    },
    Case {
        row: 43,
        name: "two-to-the-25-frames",
        teaches: "a sum of 2²⁵ ones is 2²⁵",
        pace: Long,
        methods: &[Machinery],
        run: |_| vec![Finding::exact("mean of 2²⁵ ones", 1.0, mean_of(std::iter::repeat_n(1.0, 1 << 25)), 0.0)],
    },
];

fn wire_range() -> Vec<Finding> {
    let (len, frames) = (1024, 256);
    let value = |i: usize| {
        let decade = i % 13;
        let base = 10.0_f32.powi(decade as i32 - 3) * (1.0 + (i as f32 * 0.37).fract());
        Vec3::new(base, base * 0.5, base * 0.01)
    };
    let mut pixels = Pixels::black(len);
    (0..len).for_each(|i| (pixels.irradiance[i], pixels.reflectance[i]) = (value(i), Vec3::ONE));
    let fields = Fields { emitted: false, surface: true };
    let body = Body::Pixels(pixels.clone());
    let (mut sums, mut unsound, mut worst) = (vec![DVec3::ZERO; len], 0, 0.0_f64);
    for frame in 0..frames {
        let Some(got) = there_and_back(&body, len, frame, fields) else {
            return vec![Finding::holds("unpacks", false)];
        };
        for (i, (sum, got)) in sums.iter_mut().zip(&got.irradiance).enumerate() {
            unsound += usize::from(!got.is_finite() || got.min_element() < 0.0);
            let expected = value(i);
            if expected.x > 1.0 {
                worst = worst.max(f64::from((*got - expected).abs().max_element() / expected.max_element()));
            }
            *sum += got.as_dvec3();
        }
    }
    let bias =
        |i: usize| (sums[i] / f64::from(frames) - value(i).as_dvec3()).abs().max_element() / f64::from(value(i).x);
    let worst_bias = (0..len).filter(|i| value(*i).x > 1.0).map(bias).fold(0.0, f64::max);
    let too_bright = Body::Pixels(Pixels { irradiance: vec![Vec3::splat(1e38); len], ..pixels });
    let saturated = |body: &Body| pack::is_saturated(&pack::pack(&question_of(len, 1), body, fields));
    vec![
        Finding::none("unsound channels", unsound),
        Finding { tolerance: 1.0 / 256.0, ..Finding::exact("largest error of the largest channel", 0.0, worst, 0.0) },
        // Rounding errors of 1/256 average over 256 frames to 1/4096 and a few deviations.
        Finding { tolerance: 1.0 / 1024.0, ..Finding::exact("mean error over 256 frames", 0.0, worst_bias, 0.0) },
        Finding::holds("10³⁸ is flagged", saturated(&too_bright)),
        Finding::holds("10⁹ is not", !saturated(&body)),
    ]
}

/// A question about a row of so many pixels.
fn question_of(len: usize, frame: u32) -> Question {
    let (width, height) = (len as u32, 1);
    let camera = Camera { width, height, ..Camera::default() };
    let quality = Quality { interleave: [1, 1], ..Quality::default() };
    let rect = Rect { x: 0, y: 0, width, height };
    let tile = Tile { camera, rect, lit: Lit { set: 0, frame, seed: 0, quality } };
    Question { world: Default::default(), ask: Ask::Tile(tile) }
}

/// Packed, squeezed, and undone; `None` if it does not come back.
fn there_and_back(body: &Body, len: usize, frame: u32, fields: Fields) -> Option<Pixels> {
    let question = question_of(len, frame);
    let squeezed = pack::compress(&pack::pack(&question, body, fields));
    let raw = pack::decompress(&squeezed, pack::packed_len_max(&question.ask)).ok()?;
    pack::unpack(&question, &raw, fields).ok()?.pixels()
}

fn wire_normals() -> Finding {
    let len = 4096;
    let mut pixels = Pixels::black(len);
    for i in 0..len {
        let z = 1.0 - 2.0 * (i as f32 + 0.5) / len as f32;
        let (sin, cos) = (i as f32 * 2.399_963).sin_cos();
        let r = (1.0 - z * z).sqrt();
        (pixels.normal[i], pixels.distance[i]) = (Vec3::new(r * cos, r * sin, z), 1.0);
    }
    let fields = Fields { emitted: false, surface: true };
    let got = there_and_back(&Body::Pixels(pixels.clone()), len, 1, fields).unwrap_or_default();
    let angle = |(a, b): (&Vec3, &Vec3)| f64::from(a.cross(*b).length().atan2(a.dot(*b)).to_degrees());
    let worst = pixels.normal.iter().zip(&got.normal).map(angle).fold(0.0, f64::max);
    Finding { tolerance: 0.06, ..Finding::exact("largest error, degrees", 0.0, worst, 0.0) }
}

/// Sets serve every pixel exactly once a frame, and every pixel meets every set once a round.
fn odd_sizes() -> Vec<Finding> {
    let quality = Quality::default();
    let each = stress::PICTURE_SIZES.map(|(width, height)| {
        let camera = Camera { width, height, ..Camera::default() };
        let rect = Rect { x: 0, y: 0, width, height };
        let mut met = vec![BTreeSet::new(); (width * height) as usize];
        let mut wrong = 0;
        for frame in 0..u32::from(quality.sets()) {
            let mut served = vec![0; met.len()];
            for set in 0..quality.sets() {
                for [x, y] in (Tile { camera, rect, lit: Lit { set, frame, seed: 0, quality } }).grid().pixels() {
                    let pixel = (y * width + x) as usize;
                    served[pixel] += 1;
                    met[pixel].insert(set);
                }
            }
            wrong += served.iter().filter(|times| **times != 1).count();
        }
        wrong += met.iter().filter(|sets| sets.len() != usize::from(quality.sets())).count();
        Finding::none(format!("pixels left out or doubled in {width}x{height}"), wrong)
    });
    each.into()
}

fn two_to_the_28_pixels(_: &Trial) -> Vec<Finding> {
    let side = 16_384;
    let quality = Quality::default();
    let camera = Camera { width: side, height: side, ..Camera::default() };
    let tiling = Tiling::of(side, side, &quality);
    let pixels: u64 = (0..tiling.len()).map(|i| tiling.rect(i)).map(|r| u64::from(r.width) * u64::from(r.height)).sum();
    let fields = Fields { emitted: true, surface: true };
    let memory = Igi::memory_bytes(&camera, &quality, fields);
    // The last rectangle, asked for as any other; a furnace gives its answer.
    let exact = furnaces::furnace_sphere(0.0);
    let scene = stress::sized(&exact.scene, (side, side));
    let stage = Stage::new(&scene, quality);
    let rect = Rect { x: side - 16, y: side - 16, width: 16, height: 16 };
    let mut served = 0;
    let mut sum = 0.0;
    for set in 0..quality.sets() {
        let tile = Tile { camera: scene.camera, rect, lit: Lit { set, frame: 0, seed: 0, quality } };
        let question = Question { world: Default::default(), ask: Ask::Tile(tile) };
        let answer = light::answer(&stage.prepared, &light::LightSetCache::default(), &question, &|| 0);
        let Some(pixels) = answer.body.pixels() else { continue };
        served += pixels.len();
        sum += (0..pixels.len()).map(|i| f64::from(pixels.radiance(i).x)).sum::<f64>();
    }
    vec![
        Finding::exact("pixels in all rectangles", f64::from(1 << 28), pixels as f64, 0.0),
        Finding::holds("memory is more than 2³² bytes, counted in 64 bits", memory >> 32 > 0)
            .note(format!("{:.1} GB; `render` refuses it in words where less is free", memory as f64 / 1e9)),
        Finding::exact("pixels of the last rectangle", 256.0, served as f64, 0.0),
        Finding::exact("their mean radiance", 1.0, sum / served as f64, 1e-6),
    ]
}

/// What a film shows after frames of one pixel with these radiances.
fn mean_of(frames: impl Iterator<Item = f32>) -> f64 {
    let tiling = Tiling { width: 1, height: 1, tile_width: 1, tile_height: 1 };
    let mut film = Film::new(tiling, 1, Fields { emitted: true, surface: false });
    let grid = Grid { x: 0, y: 0, step_x: 1, step_y: 1, columns: 1, rows: 1 };
    for radiance in frames {
        let pixels = Pixels { emitted: vec![Vec3::splat(radiance)], ..Pixels::default() };
        film.add(0, 0, &[Sample { grid, light: Light::Frame(pixels) }]);
    }
    f64::from(film.plane(frame::Plane::Raw).pixels[0].x)
}
