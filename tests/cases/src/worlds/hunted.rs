//! Stiff and extreme scenes of our own hunting.

use std::f64::consts::PI;

use glam::{DVec3, Vec3};
use scenes::{Light, Mesh, Object, Scene};

use super::build::Build;
use super::emitters::{FLOOR, above_floor};
use crate::case::Exact;
use crate::closed_form;

/// Light from the next room through a hole of a thousandth of the wall between.
pub fn keyhole() -> Exact {
    let mut build = Build::new("keyhole");
    let (black, emitter) = (build.paint(0.0, 0.0), build.paint(0.0, 1.0));
    let hole = 0.001_f32.sqrt();
    build.holed_ceiling(1.0, 1.0, hole, black);
    for (side, u) in [(Vec3::X, Vec3::Z), (Vec3::NEG_X, Vec3::Z), (Vec3::Z, Vec3::X), (Vec3::NEG_Z, Vec3::X)] {
        build.quad(side + Vec3::Y, u, Vec3::Y * 2.0, black);
    }
    build.quad(Vec3::Y * 3.0, Vec3::X, Vec3::Z, emitter);
    let irradiance = 4.0 * PI * closed_form::corner_rectangle(f64::from(hole), f64::from(hole), 1.0);
    above_floor(build, "floor below a keyhole".into(), irradiance, 5e-3)
}

/// The sun through a small window in the roof onto the floor of a black room, seen where it falls; then what
/// that spot sends to a patch below the roof.
pub fn sun_through_a_window() -> [Exact; 2] {
    let (albedo, window, cos) = (f64::from(FLOOR), 0.1_f32, 0.96_f32);
    let sun = Light::Directional { direction: Vec3::new(0.28, -cos, 0.0), irradiance: Vec3::ONE, diameter_deg: 0.0 };
    // Two metres down, the beam has moved so far sideways.
    let spot = Vec3::new(2.0 * 0.28 / cos, -1.0, 0.0);
    let patch = Vec3::new(0.5, 0.9, 0.3);
    [false, true].map(|ceiling| {
        let mut build = Build::new("sun through a window");
        let (floor, black) = (build.paint(FLOOR, 0.0), build.paint(0.0, 0.0));
        build.quad(Vec3::NEG_Y, Vec3::Z, Vec3::X, floor);
        build.holed_ceiling(1.0, 1.0, window, black);
        for (side, u) in [(Vec3::X, Vec3::Z), (Vec3::NEG_X, Vec3::Z), (Vec3::Z, Vec3::X), (Vec3::NEG_Z, Vec3::X)] {
            build.quad(side, u, Vec3::Y, black);
        }
        build.light(sun.clone());
        let lit = albedo / PI * f64::from(cos);
        if !ceiling {
            let scene = build.seen(Vec3::new(0.2, 0.0, 0.3), spot, 4.0, 4);
            return Exact { name: "spot on the floor".into(), scene, radiance: lit, tolerance: 1e-3 };
        }
        build.quad(patch, Vec3::X * 0.02, Vec3::Z * 0.02, floor);
        let corner = |x: f32, z: f32| (spot + Vec3::new(x, 0.0, z) * window - patch).as_dvec3();
        let corners = [corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)];
        let radiance = albedo / PI * lit * closed_form::polygon(&corners, DVec3::NEG_Y);
        let scene = build.seen(patch - Vec3::new(0.0, 0.1, 0.05), patch, 1.0, 4);
        Exact { name: "patch above the spot".into(), scene, radiance, tolerance: 5e-3 }
    })
}

/// A closed room with one lamp; perhaps with a plain and a sky outside, which no light passes between.
pub fn room_with_outdoors(plain: bool, sky: bool) -> Scene {
    let mut build = Build::new("room with outdoors");
    let (wall, lamp) = (build.paint(0.7, 0.0), build.paint(0.0, 30.0));
    build.room(1.0, [wall; 6]);
    build.block(Vec3::new(-0.3, -0.7, -0.3), Vec3::splat(0.25), wall);
    build.quad(Vec3::Y * 0.9, Vec3::X * 0.1, Vec3::Z * 0.1, lamp);
    if plain {
        build.quad(Vec3::Y * -1.1, Vec3::Z * 100.0, Vec3::X * 100.0, wall);
    }
    if sky {
        build.environment(3.0);
    }
    build.seen(Vec3::new(0.7, 0.2, 0.9), Vec3::new(-0.2, -0.4, -0.4), 75.0, 16)
}

/// An emitter modelled in the very plane of the ceiling, before or after it in the file. It shines all the same,
/// and once.
pub fn emitter_in_the_ceiling(emitter_first: bool) -> Exact {
    let mut build = Build::new("lamp in the ceiling");
    let (emitter, ceiling) = (build.paint(0.0, 1.0), build.paint(0.0, 0.0));
    let shapes = [(0.5, emitter), (2.0, ceiling)];
    for (half, paint) in if emitter_first { shapes } else { [shapes[1], shapes[0]] } {
        build.quad(Vec3::Y, Vec3::X * half, Vec3::Z * half, paint);
    }
    let irradiance = 4.0 * PI * closed_form::corner_rectangle(0.5, 0.5, 1.0);
    let order = if emitter_first { "before" } else { "after" };
    above_floor(build, format!("lamp {order} the ceiling it lies in"), irradiance, 1e-3)
}

/// The same scene with things in it that are not there: a mesh without triangles, and an object that is hidden.
pub fn with_nothing_added(scene: &Scene) -> Scene {
    let mut scene = scene.clone();
    scene.meshes.push(Mesh::default().into());
    scene.objects.push(Object::fixed("nothing", 1));
    scene.objects.push(Object { visible: false, ..Object::fixed("hidden", 0) });
    scene
}

/// The same scene, its radiance so small and its walls so dark that single precision can hardly say so.
pub fn almost_nothing() -> Exact {
    let radiance = 1e-40_f32;
    let mut build = Build::new("almost nothing");
    let (emitter, wall) = (build.paint(1e-30, radiance), build.paint(1e-30, 0.0));
    build.quad(Vec3::Y, Vec3::X, Vec3::Z, emitter);
    build.quad(Vec3::new(0.0, 0.5, -2.0), Vec3::X, Vec3::Y * 0.5, wall);
    let irradiance = 4.0 * PI * f64::from(radiance) * closed_form::corner_rectangle(1.0, 1.0, 1.0);
    above_floor(build, "denormal radiance".into(), irradiance, 1e-2)
}
