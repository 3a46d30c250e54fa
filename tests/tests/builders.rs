//! The builders build what they say.

use cases::case::Exact;
use cases::closed_form;
use cases::worlds::furnaces::{self, Source};
use cases::worlds::{emitters, glass, stress};
use glam::Vec3;
use scenes::{Needs, read};

fn exact() -> Vec<Exact> {
    let mut cases = vec![
        furnaces::furnace_cube(0.5),
        furnaces::furnace_sphere(0.9),
        furnaces::furnace_corner(0.9),
        furnaces::white_ball(),
        furnaces::lit_sphere(Source::Point),
        furnaces::lit_sphere(Source::Walls),
        furnaces::integrating_sphere(2.0, 10.0, 0.8),
        emitters::cie_cube(0.9),
        emitters::point_above_floor(Vec3::new(0.5, 1.0, 0.2)),
        emitters::rectangle_above_floor([2.0, 2.0], 1.0),
        emitters::polygon_above_floor(&emitters::tilted_pentagon()),
        emitters::disc_above_floor(1.0, 2.0),
        emitters::ball_above_floor(0.5, Vec3::new(0.5, 2.0, 0.0)),
        emitters::wall_beside_floor(1.0, 0.5, 0.1),
        glass::light_caught_in_glass(),
        glass::pane_before_an_emitter(),
        glass::emitter_in_a_pane(),
    ];
    cases.extend(furnaces::concentric_spheres());
    cases.extend(furnaces::mirror_shaft([0.8, 0.2]));
    cases.extend(emitters::cie_cube_direct());
    cases.extend(emitters::cube_faces());
    cases
}

#[test]
fn every_case_has_light_and_an_answer() {
    for case in exact() {
        case.scene.check().unwrap();
        assert!(Needs::of(&case.scene).light(), "{}: nothing shines", case.name);
        assert!(case.radiance.is_finite() && case.radiance > 0.0 && case.tolerance > 0.0, "{}", case.name);
    }
}

/// Fronts decide where a lamp shines: wound the wrong way it would light nothing.
#[test]
fn lamps_face_what_they_light() {
    let emitters = [
        emitters::rectangle_above_floor([2.0, 2.0], 1.0),
        emitters::polygon_above_floor(&emitters::tilted_pentagon()),
        emitters::disc_above_floor(1.0, 2.0),
        emitters::ball_above_floor(0.5, Vec3::new(0.5, 2.0, 0.0)),
        emitters::wall_beside_floor(1.0, 0.5, 0.1),
        emitters::endless_wall(),
    ];
    for case in &emitters {
        let mesh = &case.scene.meshes[0];
        let lit = (mesh.triangles.iter().zip(&mesh.materials))
            .filter(|(_, material)| !case.scene.materials[**material as usize].emission.is_black())
            .filter(|(triangle, _)| {
                let [a, b, c] = triangle.map(|i| mesh.positions[i as usize]);
                (b - a).cross(c - a).dot(-a) > 0.0
            })
            .count();
        assert!(lit > 0, "{}: the lamp shows its back to the floor", case.name);
    }
}

#[test]
fn direct_light_in_the_cie_cube_is_as_published() {
    let lux = [198.94, 70.34, 38.29];
    for (case, expected) in emitters::cie_cube_direct().iter().zip(lux) {
        let measured = case.radiance * std::f64::consts::PI / 0.5;
        assert!((measured / expected - 1.0).abs() < 3e-3, "{}: {measured}", case.name);
    }
    let indirect =
        |albedo: f32| emitters::cie_cube(albedo).radiance * std::f64::consts::PI / f64::from(albedo) - 10_000.0 / 96.0;
    for (albedo, expected) in [(0.1, 11.57), (0.5, 104.17), (0.9, 937.5), (0.95, 1979.17), (0.99, 10312.5)] {
        assert!((indirect(albedo) / expected - 1.0).abs() < 1e-3, "{albedo}: {}", indirect(albedo));
    }
}

#[test]
fn broken_triangles_leave_no_trace_but_a_note() {
    let folder = tempfile::tempdir().unwrap();
    let [clean, broken] = stress::obj_with_broken_triangles().map(|text| {
        let path = folder.path().join("a.obj");
        std::fs::write(&path, text).unwrap();
        read::load(&path).unwrap()
    });
    assert_eq!(clean.scene.meshes, broken.scene.meshes);
    assert_eq!(clean.scene.camera, broken.scene.camera);
    assert!(broken.notes.iter().any(|note| note.message.contains("3 triangles without area")), "{:?}", broken.notes);
}

#[test]
fn extreme_scenes_are_sound() {
    let dark = stress::dark_room();
    assert!(!Needs::of(&dark).light());
    let [square, needles] = stress::needles();
    assert_eq!((square.triangle_count(), needles.triangle_count()), (2, 4));
    let [_, with_ball] = glass::ball_in_a_box(1.0);
    for scene in [&stress::touching_corner(), &square, &needles, &with_ball, &stress::doubled(&with_ball)] {
        scene.check().unwrap();
        assert!(Needs::of(scene).light());
    }
    for s in [1e-6, 0.125, 1e6] {
        stress::scaled(&with_ball, s).check().unwrap();
    }
    assert_eq!(stress::scaled(&stress::scaled(&with_ball, 8.0), 0.125), with_ball);
    for size in stress::PICTURE_SIZES {
        stress::sized(&dark, size).check().unwrap();
    }
    assert_eq!(closed_form::bounded_sphere(1.0, 0.125), 0.5);
}
