//! Light against closed forms: the rows of the table of stiff and extreme cases that need no network.
//!
//! Where a mode should be exact it must agree within statistics and the case's own tolerance; where it
//! is biased by design, the *predicted wrong* value is asserted.

use glam::{DVec3, Vec3};
use light::{Prepared, Shelf};
use protocol::question::{Ask, Bound, Quality, Question, Rect, Tile};
use scenes::Scene;
use tests::{Case, closed_form, furnaces, glass, lamps, stress};

/// Independent repetitions of every measurement.
const SEEDS: u64 = 8;

/// Mean radiance of each pixel over some frames, straight from the light room: nothing is quantised.
fn picture(scene: &Scene, quality: &Quality, frames: u32, seed: u64) -> Vec<DVec3> {
    let prepared = Prepared::new(scene.clone());
    let shelf = Shelf::default();
    let (width, height) = (scene.camera.width, scene.camera.height);
    let mut sums = vec![DVec3::ZERO; (width * height) as usize];
    for frame in 0..frames {
        for set in 0..quality.sets() {
            let rect = Rect { x: 0, y: 0, width, height };
            let tile = Tile { camera: scene.camera, rect, set, frame, seed, quality: *quality };
            let question = Question { world: Default::default(), ask: Ask::Tile(tile.clone()) };
            let answer = light::answer(&prepared, &shelf, &question, &|| 0);
            assert_eq!(answer.cost.dropped, 0, "no sample is NaN or infinite");
            let pixels = answer.body.pixels().expect("tiles are answered by pixels");
            for (i, [x, y]) in tile.grid().pixels().enumerate() {
                sums[(y * width + x) as usize] += pixels.radiance(i).as_dvec3();
            }
        }
    }
    sums.iter().map(|sum| *sum / f64::from(frames)).collect()
}

fn mean(picture: &[DVec3]) -> f64 {
    picture.iter().map(|p| (p.x + p.y + p.z) / 3.0).sum::<f64>() / picture.len() as f64
}

/// Mean of the picture over the seeds, and its standard error.
fn measure(scene: &Scene, quality: &Quality, frames: u32) -> (f64, f64) {
    let means: Vec<f64> = (0..SEEDS).map(|seed| mean(&picture(scene, quality, frames, seed))).collect();
    let middle = means.iter().sum::<f64>() / SEEDS as f64;
    let variance = means.iter().map(|m| (m - middle).powi(2)).sum::<f64>() / (SEEDS - 1) as f64;
    (middle, (variance / SEEDS as f64).sqrt())
}

/// The measured mean must be `expected` within the case's tolerance and 4.5 standard errors, and these
/// must be small enough to mean something.
#[track_caller]
fn agrees(case: &Case, quality: &Quality, frames: u32, expected: f64) {
    let (measured, error) = measure(&case.scene, quality, frames);
    let slack = case.tolerance * expected.abs() + 4.5 * error;
    assert!(
        (measured - expected).abs() <= slack,
        "{}: {measured} ± {error}, expected {expected}, off by {:.4} %",
        case.name,
        100.0 * (measured / expected - 1.0)
    );
    assert!(error <= 0.02 * expected.abs() + 1e-12, "{}: too noisy to tell: ± {error}", case.name);
}

#[track_caller]
fn exact(case: &Case, frames: u32) {
    agrees(case, &Quality::default(), frames, case.radiance);
}

/// Small and unfiltered: every pixel with the same set, so frames are cheap.
fn quick() -> Quality {
    Quality { interleave: [1, 1], importance: false, ..Quality::default() }
}

/// More light paths where they are long: one path's lights are all alike in strength.
fn bright(albedo: f32) -> Quality {
    Quality { vpls: if albedo > 0.8 { 128 } else { 24 }, ..Quality::default() }
}

#[test]
fn furnaces_glow_by_the_geometric_series() {
    for albedo in [0.5, 0.9] {
        for case in [furnaces::furnace_cube(albedo), furnaces::furnace_sphere(albedo)] {
            agrees(&case, &bright(albedo), 36, case.radiance);
        }
    }
}

#[test]
fn a_stiff_furnace_is_still_right() {
    // Hundreds of bounces; more light paths make up for their spread.
    let case = furnaces::furnace_cube(0.99);
    agrees(&case, &Quality { vpls: 256, ..Quality::default() }, 36, case.radiance);
}

#[test]
fn a_furnace_is_uniform_into_its_corners() {
    exact(&furnaces::furnace_corner(0.7), 72);
}

#[test]
fn limited_bounces_keep_their_share_of_a_furnace() {
    // Light paths of length K and the reflection towards the eye: K + 1 reflections … the eye's own
    // included, so K counts reflections after the first.
    for most in [1_u8, 4] {
        let case = furnaces::furnace_sphere(0.9);
        let expected = closed_form::furnace_bounces(1.0, f64::from(0.9_f32), i32::from(most) + 1);
        agrees(&case, &Quality { max_length: Some(most), ..Quality::default() }, 36, expected);
    }
}

#[test]
fn a_white_ball_vanishes_before_a_uniform_sky() {
    exact(&furnaces::white_ball(), 64);
}

#[test]
fn spheres_lit_from_the_middle_or_by_their_walls_have_radiance_one() {
    exact(&furnaces::lit_sphere(furnaces::Source::Point), 18);
    exact(&furnaces::lit_sphere(furnaces::Source::Walls), 18);
}

#[test]
fn an_integrating_sphere_is_right_with_and_without_bounds() {
    let case = furnaces::integrating_sphere(2.0, 100.0, 0.5);
    exact(&case, 18);
    agrees(&case, &Quality { bound: Bound::None, remainder: false, ..quick() }, 18, case.radiance);
}

#[test]
fn without_remainder_a_bound_takes_exactly_what_it_should() {
    // Row 5: in a sphere G is 1/4R² everywhere, so a bound below that scales all indirect light.
    let case = furnaces::integrating_sphere(2.0, 100.0, 0.5);
    let diameter = f64::from(Prepared::new(case.scene.clone()).diameter);
    let distance = 8.0_f32;
    let bound = 1.0 / f64::from(distance).powi(2);
    let fraction = (f64::from(distance) / diameter) as f32;
    let kept = closed_form::bounded_sphere(2.0, bound);
    assert!(kept < 0.5, "the case must bite: {kept}");
    let direct = 0.5 / std::f64::consts::PI * closed_form::integrating_sphere(100.0, 2.0, 0.0);
    let indirect = case.radiance - direct;
    let quality = Quality { bound: Bound::Geometry { distance: fraction }, remainder: false, ..quick() };
    agrees(&case, &quality, 18, direct + kept * indirect);
    agrees(&case, &Quality { remainder: true, ..quality }, 36, case.radiance);
}

#[test]
fn concentric_spheres_exchange_light_as_radiosity_says() {
    for case in furnaces::concentric_spheres() {
        exact(&case, 72);
    }
}

#[test]
fn plates_between_mirrors_never_lose_light() {
    for case in furnaces::mirror_shaft([0.8, 0.2]) {
        exact(&case, 180);
    }
}

#[test]
fn indirect_light_of_the_cie_cube_has_the_mean_it_must_have() {
    for albedo in [0.1, 0.5, 0.9] {
        let case = lamps::cie_cube(albedo);
        agrees(&case, &bright(albedo), 18, case.radiance);
    }
}

#[test]
fn direct_light_of_the_cie_cube_is_exact() {
    for case in lamps::cie_cube_direct() {
        let quality = Quality { max_length: Some(0), vpls: 0, ..quick() };
        agrees(&case, &quality, 1, case.radiance);
    }
}

#[test]
fn point_lights_fall_off_by_cosine_and_square() {
    for to in [Vec3::Y, Vec3::new(3.0, 1.0, 2.0), Vec3::new(0.0, 1e-3, 5.0)] {
        exact(&lamps::point_above_floor(to), 1);
    }
}

#[test]
fn area_lamps_agree_with_lambert() {
    exact(&lamps::rectangle_above_floor([2.0, 2.0], 1.0), 144);
    exact(&lamps::rectangle_above_floor([0.5, 3.0], 0.7), 144);
    exact(&lamps::polygon_above_floor(&lamps::tilted_pentagon()), 144);
    exact(&lamps::disc_above_floor(1.0, 0.5), 144);
    exact(&lamps::ball_above_floor(0.5, Vec3::new(1.0, 1.5, 0.0)), 144);
}

#[test]
fn a_wall_beside_the_floor_lights_it_to_the_edge() {
    for h in [0.1, 1.0] {
        exact(&lamps::wall_beside_floor(1.0, 0.5, h), 144);
    }
}

#[test]
fn near_a_wall_a_bound_loses_what_the_formula_says() {
    // Row 15. What is lost is lost near the wall's foot, so a wall of finite size loses as much as an
    // infinite one: (1 − kept) of half of what a floor under an infinite glowing sky would reflect.
    let all = lamps::wall_beside_floor(1e4, 1e4, 1.0).radiance;
    for (h_sqrt_b, kept) in [(0.5699, 1.0), (0.3, 0.834), (0.2, 0.677)] {
        let case = lamps::wall_beside_floor(20.0, 20.0, 1.0);
        let diameter = Prepared::new(case.scene.clone()).diameter;
        // b = 1/d², and the bound on lamps lies closer by a constant.
        let distance = light::vpl::LAMPS_CLOSER / (h_sqrt_b as f32 * diameter);
        let biased = Quality { bound: Bound::Geometry { distance }, remainder: false, lights: 1024, ..quick() };
        let loose = Case { tolerance: 1e-2, ..case.clone() };
        agrees(&loose, &biased, 16, case.radiance - (1.0 - kept) * all);
        agrees(&loose, &Quality { remainder: true, ..biased }, 16, case.radiance);
    }
}

#[test]
fn faces_of_a_cube_exchange_light_by_their_form_factors() {
    for case in lamps::cube_faces() {
        exact(&case, 144);
    }
}

#[test]
fn glass_of_index_one_is_not_there() {
    let [empty, with_ball] = glass::ball_in_a_box(1.0);
    let quality = Quality::default();
    let (without, error_a) = measure(&empty, &quality, 36);
    let (with, error_b) = measure(&with_ball, &quality, 36);
    let slack = 1e-3 * without + 4.5 * (error_a * error_a + error_b * error_b).sqrt();
    assert!((with - without).abs() < slack, "{with} ± {error_b} against {without} ± {error_a}");
}

#[test]
fn panes_and_total_reflection_are_exact() {
    exact(&glass::light_caught_in_glass(), 1);
    exact(&glass::pane_before_a_lamp(), 1);
    exact(&glass::lamp_in_a_pane(), 1);
}

#[test]
fn virtual_lights_on_the_points_they_light_do_no_harm() {
    for bound in [Bound::None, Bound::Geometry { distance: 0.1 }, Bound::Clip { distance: 0.02 }] {
        let quality = Quality { bound, vpls: 200, ..quick() };
        let pixels = picture(&stress::touching_corner(), &quality, 4, 1);
        assert!(pixels.iter().all(|p| p.is_finite() && p.min_element() >= 0.0));
    }
}

#[test]
fn scaling_by_a_power_of_two_changes_no_bit_and_by_a_million_little() {
    let scene = glass::ball_in_a_box(1.5)[1].clone();
    let here = picture(&scene, &quick(), 4, 3);
    for s in [0.25, 1024.0] {
        assert!(picture(&stress::scaled(&scene, s), &quick(), 4, 3) == here, "scale {s}");
    }
    for s in [1e-6, 1e6] {
        let (a, b) =
            (mean(&picture(&stress::scaled(&scene, s), &quick(), 64, 3)), mean(&picture(&scene, &quick(), 64, 3)));
        assert!((a / b - 1.0).abs() < 0.02, "scale {s}: {a} against {b}");
    }
}

#[test]
fn broken_triangles_are_dropped_and_leave_no_trace() {
    let folder = tempfile::tempdir().expect("a folder to write to");
    let [clean, broken] = stress::obj_with_broken_triangles().map(|text| {
        let path = folder.path().join(format!("{}.obj", text.len()));
        std::fs::write(&path, text).expect("the file can be written");
        scenes::read::load(&path).expect("broken triangles are no reason to refuse").scene
    });
    let view = |mut scene: Scene| {
        (scene.camera.width, scene.camera.height) = (32, 24);
        picture(&scene, &quick(), 2, 1)
    };
    assert!(view(clean) == view(broken));
}

#[test]
fn needles_shine_like_the_square_they_make_up() {
    let [whole, needles] = stress::needles();
    let (a, b) = (mean(&picture(&whole, &quick(), 16, 1)), mean(&picture(&needles, &quick(), 16, 1)));
    assert!((a - b).abs() < 1e-3 * a, "{b} in needles, {a} whole");
}

#[test]
fn a_hundred_thousand_lamps_light_a_floor_like_one_as_large() {
    // Row 38's kind: many sources, each chosen with a probability of a few millionths.
    let case = lamps::rectangle_above_floor([2.0, 2.0], 1.0);
    let scene = stress::split_lamps(&case.scene, 256);
    assert!(light::Prepared::new(scene.clone()).emitters.len() > 100_000);
    let split = Case { scene, ..case };
    agrees(&split, &quick(), 144, split.radiance);
}

#[test]
fn doubled_surfaces_double_no_light() {
    let scene = glass::ball_in_a_box(1.5)[0].clone();
    assert!(picture(&stress::doubled(&scene), &quick(), 4, 1) == picture(&scene, &quick(), 4, 1));
}

#[test]
fn without_light_all_is_black_and_nothing_is_traced_for_it() {
    let scene = stress::dark_room();
    let pixels = picture(&scene, &Quality::default(), 2, 1);
    assert!(pixels.iter().all(|p| *p == DVec3::ZERO));
}

#[test]
fn tiny_and_odd_pictures_visit_all_their_pixels() {
    let case = furnaces::furnace_sphere(0.5);
    for size in [(1, 1), (1, 7), (5, 1), (2, 3), (97, 2)] {
        let scene = stress::sized(&case.scene, size);
        let (measured, error) = measure(&scene, &Quality::default(), 36);
        assert!((measured - case.radiance).abs() < 0.01 * case.radiance + 4.5 * error, "{size:?}: {measured}");
    }
}

#[test]
fn one_light_one_path_one_photon_are_unbiased_over_runs() {
    let case = furnaces::integrating_sphere(2.0, 100.0, 0.5);
    let quality = Quality { lights: 1, vpls: 1, photons: 1, ..quick() };
    agrees(&case, &quality, 128, case.radiance);
}
