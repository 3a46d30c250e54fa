//! Pictures against an independent renderer: Mitsuba 3's path tracer (`scenes/*/ref.exr`).
//!
//! The default test is short: right within a few frames' noise. `--ignored` runs every scene until it
//! reaches the floor that the reference's own noise sets:
//! `cargo test --release -p tests --test references -- --ignored --nocapture`.
//! Scenes that may not be shipped are taken from the folder that `IGI_SCENES` names, where it is set.

use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

use glam::DVec3;
use light::{LightSetCache, Prepared};
use protocol::question::{Ask, Lit, Quality, Question, Rect, Tile};

/// relMSE as the references' README defines it: mean of (x − r)² / (r² + 0.01).
fn rel_mse(picture: &[DVec3], reference: &[DVec3]) -> f64 {
    let each = |(x, r): (&DVec3, &DVec3)| {
        let e = (*x - *r) * (*x - *r) / (*r * *r + 0.01);
        (e.x + e.y + e.z) / 3.0
    };
    picture.iter().zip(reference).map(each).sum::<f64>() / picture.len() as f64
}

/// A picture that grows frame by frame on all threads.
struct Growing {
    prepared: Prepared,
    cache: LightSetCache,
    quality: Quality,
    sums: Vec<DVec3>,
    frames: u32,
}

impl Growing {
    fn new(scene: scenes::Scene) -> Self {
        let pixels = (scene.camera.width * scene.camera.height) as usize;
        Self {
            prepared: Prepared::new(scene),
            cache: LightSetCache::default(),
            quality: Quality::default(),
            sums: vec![DVec3::ZERO; pixels],
            frames: 0,
        }
    }

    fn grow(&mut self, frames: u32) -> Vec<DVec3> {
        let camera = self.prepared.scene.camera;
        let rect = |y| Rect { x: 0, y, width: camera.width, height: 48.min(camera.height - y) };
        for frame in self.frames..self.frames + frames {
            let tiles: Vec<Tile> = (0..self.quality.sets())
                .flat_map(|set| (0..camera.height).step_by(48).map(move |y| (set, y)))
                .map(|(set, y)| Tile { camera, rect: rect(y), lit: Lit { set, frame, seed: 1, quality: self.quality } })
                .collect();
            let next = AtomicUsize::new(0);
            let sums = Mutex::new(&mut self.sums);
            std::thread::scope(|scope| {
                for _ in 0..std::thread::available_parallelism().map_or(1, usize::from) {
                    scope.spawn(|| {
                        while let Some(tile) = tiles.get(next.fetch_add(1, Ordering::Relaxed)) {
                            let question = Question { world: Default::default(), ask: Ask::Tile(tile.clone()) };
                            let answer = light::answer(&self.prepared, &self.cache, &question, &|| 0);
                            let pixels = answer.body.pixels().expect("tiles are answered by pixels");
                            let mut sums = sums.lock().expect("no thread panicked");
                            for (i, [x, y]) in tile.grid().pixels().enumerate() {
                                sums[(y * camera.width + x) as usize] += pixels.radiance(i).as_dvec3();
                            }
                        }
                    });
                }
            });
        }
        self.frames += frames;
        self.sums.iter().map(|sum| *sum / f64::from(self.frames)).collect()
    }
}

fn shipped(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenes").join(name)
}

fn reference(path: &Path) -> Vec<DVec3> {
    let picture = runtime::files::read_picture(path).expect("references can be read");
    picture.pixels.iter().map(|p| p.as_dvec3()).collect()
}

fn ratio(picture: &[DVec3], reference: &[DVec3]) -> f64 {
    let sum = |pixels: &[DVec3]| pixels.iter().map(|p| p.x + p.y + p.z).sum::<f64>();
    sum(picture) / sum(reference)
}

#[test]
fn shipped_scenes_are_right_within_a_few_frames() {
    // (scene, frames, most relMSE, most deviation of the mean)
    for (name, frames, most, off) in [("cornell", 36, 2.5e-3, 0.01), ("cornell_spheres", 36, 1.2e-2, 0.01)] {
        let scene = scenes::read::load(&shipped(name)).expect("shipped scenes load").scene;
        let reference = reference(&shipped(name).join("ref.exr"));
        let picture = Growing::new(scene).grow(frames);
        let (error, ratio) = (rel_mse(&picture, &reference), ratio(&picture, &reference));
        println!("{name}: relMSE {error:.5} after {frames} frames, mean ratio {ratio:.4}");
        assert!(error < most, "{name}: relMSE {error}");
        assert!((ratio - 1.0).abs() < off, "{name}: mean ratio {ratio}");
    }
}

/// Scene folder, reference file, time, and the relMSE of the reference itself (its README).
fn all() -> Vec<(PathBuf, &'static str, f64, f64)> {
    let mut scenes: Vec<_> = [
        ("cornell", 1.95e-4),
        ("cornell_spheres", 1.46e-3),
        ("veach_door", 1.30e-3),
        ("livingroom", 1.65e-3),
        ("conference", 1.37e-3),
        ("daylit", 9.7e-3),
        ("product", 4.4e-3),
    ]
    .map(|(name, floor)| (shipped(name), "ref.exr", 0.0, floor))
    .into();
    if let Some(folder) = std::env::var_os("IGI_SCENES").map(PathBuf::from) {
        scenes.push((folder.join("sponza"), "ref.exr", 0.0, 1.14e-3));
        scenes.push((folder.join("sibenik"), "ref.exr", 0.0, 1.41e-3));
        for (file, time, floor) in
            [("ref_t0.exr", 0.0, 1.10e-3), ("ref_t1.exr", 1.0, 1.84e-3), ("ref_t2.exr", 2.0, 1.5e-3)]
        {
            scenes.push((folder.join("bunny_anim"), file, time, floor));
        }
    }
    scenes
}

#[test]
#[ignore = "takes many minutes: see the file's first lines"]
fn every_scene_reaches_the_floor_of_its_reference() {
    for (folder, file, time, floor) in all() {
        let scene = scenes::read::load_at(&folder, Some(time)).expect("scenes load").scene;
        let reference = reference(&folder.join(file));
        let mut growing = Growing::new(scene);
        // Our own error on top of the floor: at most half as much again.
        let enough = 1.5 * floor;
        loop {
            let picture = growing.grow(growing.frames.clamp(36, 360));
            let (error, ratio) = (rel_mse(&picture, &reference), ratio(&picture, &reference));
            println!(
                "{}/{file}: {} frames, relMSE {error:.5} (floor {floor:.5}), mean ratio {ratio:.4}",
                folder.display(),
                growing.frames
            );
            if error < enough {
                break;
            }
            assert!(growing.frames < 9000, "{} does not reach its floor", folder.display());
        }
    }
}
