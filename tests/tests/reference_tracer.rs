//! The reference judged: the path tracer that others are compared with, against closed forms and against
//! another program's path tracer (Mitsuba 3: `scenes/*/ref.exr`).
//!
//! Where an answer is known exactly it must agree within statistics and the case's own tolerance; where
//! only another estimate is known, no pixel may differ by more than both may be off (a z-test with Šidák's
//! correction), nor the mean. All scenes, for patient people:
//! `cargo test --release -p tests --test reference_tracer -- --ignored --nocapture`; scenes that are not shipped are
//! taken from the folder that `IGI_SCENES` names.

use std::path::{Path, PathBuf};

use cases::case::Exact;
use cases::closed_form;
use cases::worlds::{emitters, furnaces, glass, stress};
use frame::metrics::Agreement;
use glam::DVec3;
use light::{LightSetCache, Prepared};
use protocol::question::{Ask, Question, Rect, Samples};
use scenes::Scene;

/// Mean radiance of the picture and its standard error, of so many samples a pixel.
fn measure(scene: &Scene, count: u32, max_bounces: Option<u32>) -> (f64, f64) {
    let prepared = Prepared::new(scene.clone());
    let rect = Rect { x: 0, y: 0, width: scene.camera.width, height: scene.camera.height };
    let samples = Samples { camera: scene.camera, rect, first: 0, count, seed: 1, max_bounces };
    let question = Question { world: Default::default(), ask: Ask::Reference(samples) };
    let answer = light::answer(&prepared, &LightSetCache::default(), &question, &|| 0);
    assert_eq!(answer.cost.dropped, 0, "no sample is NaN or infinite");
    let moments = answer.body.moments().expect("samples are answered by sums");
    let (pixels, n) = (moments.len() as f64, f64::from(count));
    let grey = |v: DVec3| (v.x + v.y + v.z) / 3.0;
    let mean = moments.sum.iter().map(|sum| grey(*sum) / n).sum::<f64>() / pixels;
    let variance = |(sum, squares): (&DVec3, &DVec3)| grey(*squares - *sum * *sum / n) / (n - 1.0) / n;
    let variance = moments.sum.iter().zip(&moments.squares).map(variance).sum::<f64>() / pixels;
    (mean, (variance / pixels).sqrt())
}

#[track_caller]
fn agrees(case: &Exact, count: u32, max_bounces: Option<u32>, expected: f64) {
    let (measured, error) = measure(&case.scene, count, max_bounces);
    assert!(
        (measured - expected).abs() <= case.tolerance * expected.abs() + 4.5 * error,
        "{}: {measured} ± {error}, expected {expected}, off by {:.4} %",
        case.name,
        100.0 * (measured / expected - 1.0)
    );
    assert!(error <= 0.02 * expected.abs() + 1e-12, "{}: too noisy to tell: ± {error}", case.name);
}

#[track_caller]
fn exact(case: &Exact, count: u32) {
    agrees(case, count, None, case.radiance);
}

#[test]
fn furnaces_glow_by_the_geometric_series() {
    for albedo in [0.5, 0.9, 0.99] {
        exact(&furnaces::furnace_cube(albedo), 256);
        exact(&furnaces::furnace_sphere(albedo), 256);
    }
    exact(&furnaces::furnace_corner(0.7), 256);
}

#[test]
fn limited_bounces_keep_their_share_of_a_furnace() {
    let case = furnaces::furnace_sphere(0.9);
    for most in [0, 1, 4] {
        let expected = closed_form::furnace_bounces(1.0, f64::from(0.9_f32), most);
        agrees(&case, 256, Some(most as u32), expected);
    }
}

#[test]
fn spheres_and_cubes_lit_from_the_middle_are_right() {
    exact(&furnaces::white_ball(), 1024);
    exact(&furnaces::lit_sphere(furnaces::Source::Point), 256);
    exact(&furnaces::lit_sphere(furnaces::Source::Walls), 256);
    exact(&furnaces::integrating_sphere(2.0, 100.0, 0.5), 256);
    exact(&emitters::cie_cube(0.5), 256);
    for case in emitters::cie_cube_direct() {
        agrees(&case, 64, Some(1), case.radiance);
    }
}

#[test]
fn surfaces_exchange_light_as_radiosity_says() {
    furnaces::concentric_spheres().iter().for_each(|case| exact(case, 1024));
    furnaces::mirror_shaft([0.8, 0.2]).iter().for_each(|case| exact(case, 1024));
    emitters::cube_faces().iter().for_each(|case| exact(case, 1024));
}

#[test]
fn lamps_agree_with_lambert() {
    exact(&emitters::point_above_floor(glam::Vec3::new(3.0, 1.0, 2.0)), 16);
    exact(&emitters::rectangle_above_floor([2.0, 2.0], 1.0), 1024);
    exact(&emitters::polygon_above_floor(&emitters::tilted_pentagon()), 1024);
    exact(&emitters::disc_above_floor(1.0, 0.5), 1024);
    exact(&emitters::ball_above_floor(0.5, glam::Vec3::new(1.0, 1.5, 0.0)), 1024);
    exact(&emitters::wall_beside_floor(1.0, 0.5, 0.1), 1024);
    let case = emitters::rectangle_above_floor([2.0, 2.0], 1.0);
    exact(&Exact { scene: stress::split_emitters(&case.scene, 64), ..case }, 1024);
}

#[test]
fn panes_and_total_reflection_are_exact() {
    exact(&glass::light_caught_in_glass(), 1024);
    exact(&glass::pane_before_an_emitter(), 1024);
    exact(&glass::emitter_in_a_pane(), 1024);
    let [empty, with_ball] = glass::ball_in_a_box(1.0);
    let ((without, a), (with, b)) = (measure(&empty, 256, None), measure(&with_ball, 256, None));
    assert!((with - without).abs() < 1e-3 * without + 4.5 * (a * a + b * b).sqrt(), "{with} against {without}");
}

#[test]
fn samples_are_the_same_however_they_are_asked_for() {
    let scene = &glass::ball_in_a_box(1.5)[1];
    let prepared = Prepared::new(scene.clone());
    let ask = |rect, first, count| {
        let samples = Samples { camera: scene.camera, rect, first, count, seed: 3, max_bounces: None };
        let question = Question { world: Default::default(), ask: Ask::Reference(samples) };
        light::answer(&prepared, &LightSetCache::default(), &question, &|| 0).body.moments().expect("sums")
    };
    let whole = ask(Rect { x: 4, y: 2, width: 3, height: 2 }, 7, 1);
    for (i, [x, y]) in [[4, 2], [5, 2], [6, 2], [4, 3], [5, 3], [6, 3]].into_iter().enumerate() {
        assert_eq!(ask(Rect { x, y, width: 1, height: 1 }, 7, 1).sum[0], whole.sum[i]);
    }
    let (both, first, second) = (
        ask(Rect { x: 4, y: 2, width: 1, height: 1 }, 7, 2).sum[0],
        whole.sum[0],
        ask(Rect { x: 4, y: 2, width: 1, height: 1 }, 8, 1).sum[0],
    );
    assert_eq!(both, first + second);
}

/// A scene folder with another program's picture of it.
struct Other {
    folder: PathBuf,
    file: &'static str,
    time: f64,
    /// The picture's own expected relMSE, as its README states it.
    floor: f64,
}

impl Other {
    fn shipped(name: &str, floor: f64) -> Self {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenes").join(name);
        Self { folder, file: "ref.exr", time: 0.0, floor }
    }

    /// Draws the scene smaller and compares it with the other picture, averaged to that size.
    ///
    /// Nobody kept the other picture's variance by pixel. It was path-traced as ours is, so its variance
    /// is taken to be distributed as ours over the pixels, and scaled to the noise that is stated.
    fn agreement(&self, shrink: u32, count: u32) -> Agreement {
        let mut scene = scenes::read::load_at(&self.folder, Some(self.time)).expect("scenes load").scene;
        let picture = runtime::files::read_picture(&self.folder.join(self.file)).expect("references can be read");
        let other = picture.shrunk(shrink).expect("the size is a multiple");
        (scene.camera.width, scene.camera.height) = (other.width, other.height);
        let (mean, variance) = draw(scene, count);
        let noise = |(v, r): (&DVec3, &glam::Vec3)| {
            let r = r.as_dvec3();
            let e = *v / (r * r + 0.01);
            (e.x + e.y + e.z) / 3.0
        };
        let area = f64::from(shrink * shrink);
        let ours = variance.iter().zip(&other.pixels).map(noise).sum::<f64>() / variance.len() as f64;
        let scale = self.floor / area / ours;
        // Its numbers were rounded to 11 bits.
        let rounding = |r: DVec3| r * r * (2.5e-4_f64.powi(2) / 3.0 / area);
        let pairs = mean.iter().zip(&variance).zip(&other.pixels).map(|((mean, variance), r)| {
            let r = r.as_dvec3();
            ((*mean, *variance), (r, *variance * scale + rounding(r)))
        });
        let agreement = Agreement::between(pairs, 0.001);
        let Agreement { largest, limit, beyond, of_mean, rms, .. } = agreement;
        let ratio = mean.iter().map(|m| m.x + m.y + m.z).sum::<f64>()
            / other.pixels.iter().map(|r| f64::from(r.x + r.y + r.z)).sum::<f64>();
        println!(
            "{}/{}: largest |z| {largest:.2} (limit {limit:.2}, {beyond} beyond), rms z {rms:.3}, z of the mean {of_mean:.2}, \
             ratio of means {ratio:.5}",
            self.folder.file_name().unwrap_or_default().to_string_lossy(),
            self.file
        );
        agreement
    }
}

/// Mean and its variance of each pixel, drawn on all cores.
fn draw(scene: Scene, count: u32) -> (Vec<DVec3>, Vec<DVec3>) {
    let prepared = Prepared::new(scene);
    let camera = prepared.scene.camera;
    let row = |y| {
        let rect = Rect { x: 0, y, width: camera.width, height: 1 };
        let samples = Samples { camera, rect, first: 0, count, seed: 11, max_bounces: None };
        let question = Question { world: Default::default(), ask: Ask::Reference(samples) };
        let answer = light::answer(&prepared, &LightSetCache::default(), &question, &|| 0);
        assert_eq!(answer.cost.dropped, 0, "no sample is NaN or infinite");
        answer.body.moments().expect("samples are answered by sums")
    };
    let next = std::sync::atomic::AtomicU32::new(0);
    let rows = std::sync::Mutex::new(vec![None; camera.height as usize]);
    std::thread::scope(|scope| {
        for _ in 0..std::thread::available_parallelism().map_or(1, usize::from) {
            scope.spawn(|| {
                loop {
                    let y = next.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
                    if y >= camera.height {
                        break;
                    }
                    let moments = row(y);
                    rows.lock().expect("no thread panicked")[y as usize] = Some(moments);
                }
            });
        }
    });
    let n = f64::from(count);
    let rows = rows.into_inner().expect("no thread panicked");
    let pixels = rows.into_iter().flatten().flat_map(|row| row.sum.into_iter().zip(row.squares));
    pixels.map(|(sum, squares)| (sum / n, frame::methods::reference::variance_of_mean(sum, squares, n))).unzip()
}

/// By how much the means of two right pictures may differ, in standard deviations.
const MEAN_LIMIT: f64 = 4.0;

#[test]
fn the_cornell_box_agrees_with_another_program() {
    let agreement = Other::shipped("cornell", 1.95e-4).agreement(10, 1024);
    assert_eq!(agreement.beyond, 0, "{agreement:?}");
    assert!(agreement.of_mean.abs() < MEAN_LIMIT, "{agreement:?}");
}

#[test]
#[ignore = "takes many minutes: see the file's first lines"]
fn every_scene_agrees_with_another_program() {
    let mut all = vec![
        Other::shipped("cornell", 1.95e-4),
        Other::shipped("cornell_spheres", 1.46e-3),
        Other::shipped("veach_door", 1.30e-3),
        Other::shipped("livingroom", 1.65e-3),
        Other::shipped("conference", 1.37e-3),
        Other::shipped("daylit", 9.7e-3),
    ];
    if let Some(scenes) = std::env::var_os("IGI_SCENES").map(PathBuf::from) {
        let other = |name, file, time, floor| Other { folder: scenes.join(name), file, time, floor };
        all.push(other("sponza", "ref.exr", 0.0, 1.14e-3));
        all.push(other("sibenik", "ref.exr", 0.0, 1.41e-3));
        all.push(other("bunny_anim", "ref_t0.exr", 0.0, 1.10e-3));
        all.push(other("bunny_anim", "ref_t1.exr", 1.0, 1.84e-3));
        all.push(other("bunny_anim", "ref_t2.exr", 2.0, 1.35e-3));
    }
    let found: Vec<_> = all.iter().map(|other| other.agreement(5, 1024)).collect();
    assert!(found.iter().all(|agreement| agreement.beyond == 0 && agreement.of_mean.abs() < MEAN_LIMIT));
}
