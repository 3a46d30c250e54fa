//! Emitters above floors: rows 9 to 16.
//!
//! A floor point is looked at through a very narrow lens; its albedo is that of [`FLOOR`], the rest of
//! the world is black, so that radiance is albedo / π times the irradiance of the emitter alone.

use std::f64::consts::PI;

use glam::{DVec3, Vec3};
use scenes::{Light, Scene};

use super::build::{Build, Fronts, Paint};
use crate::case::Exact;
use crate::closed_form;

/// Albedo of what is looked at.
pub const FLOOR: f32 = 0.5;
/// Pixels to a side.
const SIDE: u32 = 4;
/// Full field of view that sees about one point from one unit away, degrees.
const NARROW_DEG: f32 = 0.05;

/// Row 9: mean over the walls of the 4 m cube of CIE 171:2006, 5.8, with 10,000 lm in its middle. The
/// camera stands there too and sees exactly one wall, whose mean is that of all.
pub fn cie_cube(albedo: f32) -> Exact {
    let (scene, flux) = cie_scene(albedo, 90.0, Vec3::NEG_Z);
    let surface = 96.0;
    Exact {
        name: format!("CIE cube, albedo {albedo}"),
        scene,
        radiance: f64::from(albedo) / PI * flux / (surface * (1.0 - f64::from(albedo))),
        tolerance: 5e-3,
    }
}

/// Row 9: direct light alone at a wall's middle, at the middle of an edge and in a corner: irradiance
/// 198.94, 70.34, 38.29 lx. The scene's other light has to be left out (paths of length 0).
pub fn cie_cube_direct() -> [Exact; 3] {
    let albedo = 0.5;
    [(0.0, 0.0, "middle"), (2.0, 0.0, "edge"), (2.0, 2.0, "corner")].map(|(x, y, name)| {
        // A hair inside, so that every pixel sees the same wall.
        let target = Vec3::new(x * 0.999, y * 0.999, -2.0);
        let (scene, flux) = cie_scene(albedo, NARROW_DEG, target);
        let at = target.as_dvec3();
        let irradiance = flux / (4.0 * PI) * 2.0 / at.length().powi(3);
        Exact {
            name: format!("CIE cube, direct light, {name}"),
            scene,
            radiance: f64::from(albedo) / PI * irradiance,
            tolerance: 1e-4,
        }
    })
}

fn cie_scene(albedo: f32, fov_y_deg: f32, target: Vec3) -> (Scene, f64) {
    let flux = 10_000.0;
    let mut build = Build::new("CIE 171 5.8");
    let wall = build.paint(albedo, 0.0);
    build.room(2.0, [wall; 6]);
    build.light(Light::Point { position: Vec3::ZERO, intensity: Vec3::splat((flux / (4.0 * PI)) as f32) });
    (build.seen(Vec3::ZERO, target, fov_y_deg, 16), flux)
}

/// Row 10: a point light of intensity 1 at `to`, seen from the floor point at the origin.
pub fn point_above_floor(to: Vec3) -> Exact {
    let mut build = Build::new("point above floor");
    build.light(Light::Point { position: to, intensity: Vec3::ONE });
    let wide = to.as_dvec3();
    above_floor(build, format!("point light at {to}"), wide.y / wide.length().powi(3), 1e-4)
}

/// Row 11: an emitter of radiance 1 and `sides` (full lengths along x and z), straight above at height h.
pub fn rectangle_above_floor(sides: [f32; 2], h: f32) -> Exact {
    let mut build = Build::new("rectangle above floor");
    let emitter = build.paint(0.0, 1.0);
    let [a, b] = sides.map(|side| side / 2.0);
    build.quad(Vec3::Y * h, Vec3::X * a, Vec3::Z * b, emitter);
    let irradiance = 4.0 * PI * closed_form::corner_rectangle(f64::from(a), f64::from(b), f64::from(h));
    above_floor(build, format!("rectangle {sides:?} at height {h}"), irradiance, 1e-3)
}

/// Row 12: any flat convex emitter of radiance 1 above the floor, its front (counter-clockwise) down.
pub fn polygon_above_floor(corners: &[Vec3]) -> Exact {
    let mut build = Build::new("polygon above floor");
    let emitter = build.paint(0.0, 1.0);
    build.polygon(corners, emitter);
    let wide: Vec<DVec3> = corners.iter().map(|corner| corner.as_dvec3()).collect();
    let irradiance = closed_form::polygon(&wide, DVec3::Y);
    above_floor(build, format!("lamp of {} corners", corners.len()), irradiance, 1e-3)
}

/// A tilted pentagon for row 12.
pub fn tilted_pentagon() -> [Vec3; 5] {
    // Clockwise seen from above: the front is down.
    std::array::from_fn(|i| {
        let angle = i as f32 * std::f32::consts::TAU / 5.0;
        let (x, z) = (0.3 + 0.6 * angle.cos(), -0.2 + 0.6 * angle.sin());
        Vec3::new(x, 1.0 + 0.4 * x - 0.2 * z, z)
    })
}

/// Row 13: a disc (of 720 corners) of radiance 1 on the axis.
pub fn disc_above_floor(radius: f32, h: f32) -> Exact {
    let corners: Vec<Vec3> = (0..720)
        .map(|i| f64::from(i).to_radians() / 2.0)
        .map(|angle| Vec3::new(radius * angle.cos() as f32, h, radius * angle.sin() as f32))
        .collect();
    let irradiance = closed_form::disc(f64::from(radius), f64::from(h));
    Exact {
        name: format!("disc of radius {radius} at height {h}"),
        radiance: f64::from(FLOOR) / PI * irradiance,
        ..polygon_above_floor(&corners)
    }
}

/// Row 13: a glowing ball of radiance 1, wholly above the horizon.
pub fn ball_above_floor(radius: f32, middle: Vec3) -> Exact {
    let mut build = Build::new("ball above floor");
    let emitter = build.paint(0.0, 1.0);
    build.sphere(middle, radius, 60, Fronts::Outwards, emitter);
    let (wide, radius_wide) = (middle.as_dvec3(), f64::from(radius));
    let irradiance = closed_form::ball(radius_wide, wide.length(), wide.y / wide.length());
    above_floor(build, format!("ball of radius {radius} at {middle}"), irradiance, 1e-3)
}

/// Row 14: a glowing wall of radiance 1 that stands on the floor at distance h. With a wall of many
/// times h, row 15: what bounds lose of it says [`closed_form::KEPT_BY_BOUND`].
pub fn wall_beside_floor(height: f32, half_width: f32, h: f32) -> Exact {
    let mut build = Build::new("wall beside floor");
    let emitter = build.paint(0.0, 1.0);
    build.quad(Vec3::new(0.0, height / 2.0, -h), Vec3::X * half_width, Vec3::Y * (height / 2.0), emitter);
    let irradiance = PI * closed_form::wall(f64::from(height), f64::from(half_width), f64::from(h));
    above_floor(build, format!("wall {half_width}×2 by {height} at {h}"), irradiance, 1e-3)
}

/// Row 15: an endless wall of radiance 1 at distance 1 from the floor point; "endless" is a thousand
/// metres, of which only the first few dozen matter to any bound. Its patches grow with distance and are
/// emitters of their own, so that near ones are met as often as far ones.
pub fn endless_wall() -> Exact {
    let mut build = Build::new("endless wall");
    let edges: Vec<f32> = std::iter::once(0.0).chain((-2..=10).map(|i| 2.0_f32.powi(i))).collect();
    for y in edges.windows(2) {
        for z in edges.windows(2) {
            for side in [-1.0, 1.0] {
                let emitter = build.paint(0.0, 1.0);
                let middle = Vec3::new(side * (z[0] + z[1]) / 2.0, (y[0] + y[1]) / 2.0, -1.0);
                build.quad(middle, Vec3::X * (z[1] - z[0]) / 2.0, Vec3::Y * (y[1] - y[0]) / 2.0, emitter);
            }
        }
    }
    let irradiance = PI * closed_form::wall(1024.0, 1024.0, 1.0);
    above_floor(build, "endless wall".into(), irradiance, 1e-2)
}

/// Row 19: a point light in the corner (1, 1, 1) of a cube of edge 2, flux 8: an eighth of it, 1, gets in. Seen
/// from the middle: the face −z, which as one of three receives a third of that, then +z, which the
/// light only grazes.
pub fn light_in_a_corner() -> [Exact; 2] {
    [(Vec3::NEG_Z, 1.0 / 3.0, "far face"), (Vec3::Z, 0.0, "face it lies on")].map(|(target, flux, name)| {
        let mut build = Build::new("light in a corner");
        let wall = build.paint(FLOOR, 0.0);
        build.room(1.0, [wall; 6]);
        build.light(Light::Point { position: Vec3::ONE, intensity: Vec3::splat((2.0 / PI) as f32) });
        let scene = build.seen(Vec3::ZERO, target, 90.0, 32);
        Exact { name: name.into(), scene, radiance: f64::from(FLOOR) / PI * flux / 4.0, tolerance: 1e-3 }
    })
}

/// Row 21: a point light 0.001° above the horizon of a floor point, one metre away; on a floor of that
/// half edge.
pub fn grazing_light(half: f32) -> Exact {
    let (sin, cos) = 0.001_f64.to_radians().sin_cos();
    let mut build = Build::new("grazing light");
    let floor = build.paint(FLOOR, 0.0);
    build.quad(Vec3::ZERO, Vec3::Z * half, Vec3::X * half, floor);
    let position = Vec3::new(cos as f32, sin as f32, 0.0);
    build.light(Light::Point { position, intensity: Vec3::ONE });
    let irradiance = f64::from(position.y) / position.as_dvec3().length().powi(3);
    let scene = build.seen(Vec3::new(0.0, 0.01, 0.01), Vec3::ZERO, NARROW_DEG, SIDE);
    Exact {
        name: format!("floor of {half} m, light at 89.999°"),
        scene,
        radiance: f64::from(FLOOR) / PI * irradiance,
        tolerance: 1e-2,
    }
}

/// Row 22: an emitter above a floor point, and another, so many times as powerful in all, in a closed black
/// box: it must take no light from the first.
pub fn emitter_beside_a_hidden_sun(radiance: f32, hidden: f32) -> Exact {
    let mut build = Build::new("hidden sun");
    let (emitter, sun, black) = (build.paint(0.0, radiance), build.paint(0.0, hidden), build.paint(0.0, 0.0));
    build.quad(Vec3::Y, Vec3::X, Vec3::Z, emitter);
    let middle = Vec3::new(4.0, 1.0, 0.0);
    build.quad(middle, Vec3::X * 1e-3, Vec3::Z * 1e-3, sun);
    for (side, u, v) in [(Vec3::X, Vec3::Y, Vec3::Z), (Vec3::Y, Vec3::Z, Vec3::X), (Vec3::Z, Vec3::X, Vec3::Y)] {
        for sign in [-0.5, 0.5] {
            build.quad(middle + side * sign, u * 0.5, v * 0.5, black);
        }
    }
    let irradiance = 4.0 * PI * f64::from(radiance) * closed_form::corner_rectangle(1.0, 1.0, 1.0);
    above_floor(build, format!("radiance {radiance} beside {hidden}"), irradiance, 1e-3)
}

/// A floor patch at the origin, looked at from close by under 45°, so that the camera is not in the emitter.
pub(super) fn above_floor(mut build: Build, name: String, irradiance: f64, tolerance: f64) -> Exact {
    let floor = build.paint(FLOOR, 0.0);
    let half = 0.02;
    build.quad(Vec3::ZERO, Vec3::Z * half, Vec3::X * half, floor);
    let eye = Vec3::new(0.01, 0.01, 0.01);
    let scene = build.seen(eye, Vec3::ZERO, NARROW_DEG, SIDE);
    Exact { name, scene, radiance: f64::from(FLOOR) / PI * irradiance, tolerance }
}

/// Row 16: one face of a cube glows, one reflects, the rest is black: the opposite face, then an
/// adjacent one. The camera, in the middle, sees exactly the face that reflects.
pub fn cube_faces() -> [Exact; 2] {
    [("opposite", 4, 5), ("adjacent", 4, 0)].map(|(name, receiver, emitter_face)| {
        let mut build = Build::new("cube faces");
        let (black, emitter, grey) = (build.paint(0.0, 0.0), build.paint(0.0, 1.0), build.paint(FLOOR, 0.0));
        let mut paints: [Paint; 6] = [black; 6];
        paints[receiver] = grey;
        paints[emitter_face] = emitter;
        build.room(1.0, paints);
        let factor = closed_form::CUBE_FACES[usize::from(name == "adjacent")];
        Exact {
            name: format!("cube, {name} face"),
            scene: build.seen(Vec3::ZERO, Vec3::NEG_Z, 90.0, 16),
            radiance: f64::from(FLOOR) * factor,
            tolerance: 1e-3,
        }
    })
}
