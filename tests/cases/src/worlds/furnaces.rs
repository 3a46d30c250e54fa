//! Closed rooms full of light: rows 1 to 8.

use std::f64::consts::PI;

use glam::Vec3;
use scenes::{Light, Surface};

use super::build::{Build, Fronts};
use crate::case::Exact;
use crate::closed_form;

/// Cuts of a sphere's octants: 8 · 120² = 115,200 triangles, enough for a part in a thousand.
const FINE: u32 = 120;
/// Enough where the shape of the room does not matter.
const COARSE: u32 = 16;
/// Pixels to a side.
const SIDE: u32 = 8;

/// Row 1: every wall of a cube emits radiance 1 and reflects `albedo`. A cube has corners, where
/// bounded virtual lights lose energy.
pub fn furnace_cube(albedo: f32) -> Exact {
    let mut build = Build::new("furnace cube");
    let wall = build.paint(albedo, 1.0);
    build.room(1.0, [wall; 6]);
    furnace(build, "furnace cube", albedo, [Vec3::ZERO, Vec3::new(0.3, 0.2, -1.0)])
}

/// Row 1: the same in a sphere, which has no corners.
pub fn furnace_sphere(albedo: f32) -> Exact {
    let mut build = Build::new("furnace sphere");
    let wall = build.paint(albedo, 1.0);
    build.sphere(Vec3::ZERO, 1.0, COARSE, Fronts::Inwards, wall);
    furnace(build, "furnace sphere", albedo, [Vec3::new(0.3, 0.1, 0.2), Vec3::new(-1.0, 0.5, -0.2)])
}

/// Row 8: a cube again, looking closely into a corner.
pub fn furnace_corner(albedo: f32) -> Exact {
    let mut build = Build::new("furnace corner");
    let wall = build.paint(albedo, 1.0);
    build.room(1.0, [wall; 6]);
    furnace(build, "furnace corner", albedo, [Vec3::splat(0.8), Vec3::ONE])
}

/// A furnace a hundred times as long as wide, seen along its length: what is near the eye is far nearer
/// than the scene is large.
pub fn corridor(albedo: f32) -> Exact {
    let mut build = Build::new("corridor");
    let wall = build.paint(albedo, 1.0);
    build.cuboid(Vec3::new(50.0, 0.5, 0.5), [wall; 6]);
    furnace(build, "corridor", albedo, [Vec3::new(-49.0, 0.1, 0.2), Vec3::new(-40.0, -0.3, 0.0)])
}

fn furnace(build: Build, name: &str, albedo: f32, [origin, target]: [Vec3; 2]) -> Exact {
    Exact {
        name: format!("{name}, albedo {albedo}"),
        scene: build.seen(origin, target, 60.0, SIDE),
        radiance: closed_form::furnace(1.0, f64::from(albedo)),
        tolerance: if albedo >= 0.99 { 1e-2 } else { 1e-3 },
    }
}

/// Row 2: a ball of albedo 1 under a uniform sky cannot be seen.
pub fn white_ball() -> Exact {
    let mut build = Build::new("white ball");
    let white = build.paint(1.0, 0.0);
    build.sphere(Vec3::ZERO, 1.0, 32, Fronts::Outwards, white);
    build.environment(1.0);
    Exact {
        name: "white ball under a uniform sky".into(),
        scene: build.seen(Vec3::new(0.0, 0.0, 4.0), Vec3::ZERO, 40.0, SIDE),
        radiance: 1.0,
        tolerance: 1e-3,
    }
}

/// What lights the sphere of row 3.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Source {
    /// A point light of intensity π in the middle.
    Point,
    /// Walls of radiance ½.
    Walls,
}

/// Row 3: a unit sphere of albedo ½ in which all radiance is 1.
pub fn lit_sphere(source: Source) -> Exact {
    let mut build = Build::new("lit sphere");
    let wall = build.paint(0.5, if source == Source::Walls { 0.5 } else { 0.0 });
    build.sphere(Vec3::ZERO, 1.0, FINE, Fronts::Inwards, wall);
    if source == Source::Point {
        build.light(Light::Point { position: Vec3::ZERO, intensity: Vec3::splat(PI as f32) });
    }
    Exact {
        name: format!("unit sphere lit by {source:?}"),
        scene: build.seen(Vec3::new(0.2, 0.1, 0.3), Vec3::new(-1.0, 0.0, 0.0), 90.0, SIDE),
        radiance: 1.0,
        tolerance: 2e-3,
    }
}

/// Row 4: an integrating sphere. Direct light alone has radiance `albedo · flux / 4π²R²`; what a
/// bound leaves of the rest says [`closed_form::bounded_sphere`] (row 5).
pub fn integrating_sphere(radius: f32, flux: f32, albedo: f32) -> Exact {
    let mut build = Build::new("integrating sphere");
    let wall = build.paint(albedo, 0.0);
    build.sphere(Vec3::ZERO, radius, FINE, Fronts::Inwards, wall);
    let intensity = Vec3::splat((f64::from(flux) / (4.0 * PI)) as f32);
    build.light(Light::Point { position: Vec3::ZERO, intensity });
    let irradiance = closed_form::integrating_sphere(f64::from(flux), f64::from(radius), f64::from(albedo));
    Exact {
        name: format!("integrating sphere, radius {radius}, albedo {albedo}"),
        scene: build.seen(Vec3::new(0.2, 0.1, 0.3) * radius, Vec3::new(-radius, 0.0, 0.0), 90.0, SIDE),
        radiance: f64::from(albedo) / PI * irradiance,
        tolerance: 1e-3,
    }
}

/// Row 6: a glowing ball (exitance 1, albedo ½) within a shell twice as large (albedo 0.8), which it
/// partly hides from itself. Seen: the ball, then the shell.
pub fn concentric_spheres() -> [Exact; 2] {
    let radiosity = closed_form::concentric_spheres(1.0, [0.5, 0.8], [1.0, 2.0]);
    let view = [Vec3::ZERO, Vec3::new(4.0, 0.0, 0.0)];
    ["ball", "shell"].map(|name| {
        let which = usize::from(name == "shell");
        let mut build = Build::new("concentric spheres");
        let (ball, shell) = (build.paint(0.5, (1.0 / PI) as f32), build.paint(0.8, 0.0));
        build.sphere(Vec3::ZERO, 1.0, 64, Fronts::Outwards, ball);
        build.sphere(Vec3::ZERO, 2.0, 64, Fronts::Inwards, shell);
        Exact {
            name: format!("concentric spheres, {name}"),
            scene: build.seen(Vec3::new(1.5, 0.0, 0.0), view[which], 50.0, SIDE),
            radiance: radiosity[which] / PI,
            tolerance: 3e-3,
        }
    })
}

/// Row 7: a glowing floor (exitance 1, albedo ρ₁) and a ceiling (albedo ρ₂) between four perfect
/// mirrors. Seen: the floor, then the ceiling. Fails where light that went over a mirror between
/// two diffuse surfaces is not accounted for.
pub fn mirror_shaft(albedo: [f32; 2]) -> [Exact; 2] {
    let radiosity = closed_form::mirror_shaft(1.0, albedo.map(f64::from));
    [Vec3::new(0.1, -1.0, 0.2), Vec3::new(0.1, 1.0, 0.2)].map(|target| {
        let which = usize::from(target.y > 0.0);
        let mut build = Build::new("mirror shaft");
        let floor = build.paint(albedo[0], (1.0 / PI) as f32);
        let ceiling = build.paint(albedo[1], 0.0);
        let side = build.surface(Surface::Mirror { reflectance: Vec3::ONE });
        build.room(1.0, [side, side, floor, ceiling, side, side]);
        Exact {
            name: format!("plates {albedo:?} between mirrors, {}", ["floor", "ceiling"][which]),
            scene: build.seen(Vec3::new(0.1, 0.0, 0.2), target, 40.0, SIDE),
            radiance: radiosity[which] / PI,
            tolerance: 5e-3,
        }
    })
}
