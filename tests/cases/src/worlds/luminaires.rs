//! Luminaires: intensity by direction over the square of the distance, and all of their flux.

use std::f64::consts::PI;

use glam::{DVec3, Vec2, Vec3};
use scenes::{Light, LookUp, Pixels, Texture};

use super::build::{Build, Fronts};
use super::emitters::above_floor;
use crate::case::Exact;

/// Intensity in the planes 0, 90, 180 and 270 of [`web`], and so bilinear between them; it falls evenly with γ to 0 above.
const PLANES: [f64; 4] = [0.2, 1.0, 0.6, 0.4];

/// A web whose intensity is the product of a function of each angle, both linear between the grid's.
fn web() -> Texture {
    let rows = 7_u8;
    let texel = |row: u8, plane: f64| [((1.0 - f64::from(row) / f64::from(rows - 1)) * plane) as f32; 3];
    let pixels = Pixels::Float((0..rows).flat_map(|row| PLANES.map(|plane| texel(row, plane))).collect());
    Texture { name: "web".into(), width: 4, height: rows.into(), pixels, look_up: LookUp::CLAMP }
}

/// Relative intensity towards a unit direction, by angles about the aim.
fn relative(away: DVec3, aim: DVec3, side: DVec3) -> f64 {
    let side = (side - aim * aim.dot(side)).normalize();
    let gamma = aim.dot(away).acos();
    // From behind, where −aim is up, C runs counter-clockwise.
    let planes = (side.cross(aim).dot(away).atan2(side.dot(away)) / PI * 2.0).rem_euclid(4.0);
    let (before, along) = (planes.floor(), planes.fract());
    let plane = |number: f64| PLANES[number as usize % 4];
    (1.0 - gamma / PI) * (plane(before) * (1.0 - along) + plane(before + 1.0) * along)
}

/// A luminaire of intensity 1 at `to`, aimed somewhere and turned, seen from the floor point at the origin.
pub fn above(to: Vec3, aim: Vec3, side: Vec3) -> Exact {
    let mut build = Build::new("luminaire above floor");
    build.texture(web(), |_| Vec2::ZERO);
    let direction = aim.normalize();
    let lamp = Light::Luminaire { position: to, direction, side: side.normalize(), intensity: Vec3::ONE, solid: 0 };
    build.light(lamp);
    let wide = to.as_dvec3();
    let intensity = relative(-wide.normalize(), direction.as_dvec3(), side.as_dvec3());
    above_floor(build, format!("luminaire at {to}, aimed at {aim}"), intensity * wide.y / wide.length().powi(3), 1e-4)
}

/// The same in the middle of a ball of radius 1. Each point of its inside gets the lamp's intensity, and what all others
/// reflect: the flux F, which is 2π times the mean of the planes, over 4π, times the sum of the albedo's powers.
pub fn in_a_ball(albedo: f32, towards: Vec3) -> Exact {
    let mut build = Build::new("luminaire in a ball");
    let wall = build.paint(albedo, 0.0);
    build.sphere(Vec3::ZERO, 1.0, 40, Fronts::Inwards, wall);
    build.texture(web(), |_| Vec2::ZERO);
    let (direction, side) = (Vec3::NEG_Y, Vec3::X);
    build.light(Light::Luminaire { position: Vec3::ZERO, direction, side, intensity: Vec3::ONE, solid: 0 });
    let rho = f64::from(albedo);
    let flux = 2.0 * PI * PLANES.iter().sum::<f64>() / 4.0;
    let straight = relative(towards.as_dvec3().normalize(), direction.as_dvec3(), side.as_dvec3());
    let radiance = rho / PI * (straight + flux / (4.0 * PI) * rho / (1.0 - rho));
    let scene = build.seen(Vec3::ZERO, towards, 1.0, 4);
    Exact { name: format!("luminaire in a ball of albedo {albedo}"), scene, radiance, tolerance: 4e-3 }
}

/// A luminaire in a mirror beside the floor point: its image is as far away, and intensity is that towards the mirror.
pub fn mirrored(to: Vec3) -> Exact {
    let mut build = Build::new("luminaire in a mirror");
    build.texture(web(), |_| Vec2::ZERO);
    let mirror = build.surface(scenes::Surface::Mirror { reflectance: Vec3::ONE });
    build.quad(Vec3::X * 2.0, Vec3::Z * 100.0, Vec3::Y * 100.0, mirror);
    let (direction, side) = (Vec3::new(0.6, -0.8, 0.0), Vec3::Z);
    build.light(Light::Luminaire { position: to, direction, side, intensity: Vec3::ONE, solid: 0 });
    let brought = |from: DVec3, away: DVec3| {
        relative(away.normalize(), direction.as_dvec3(), side.as_dvec3()) * from.y / from.length().powi(3)
    };
    let straight = to.as_dvec3();
    let image = DVec3::new(4.0 - straight.x, straight.y, straight.z);
    // From the lamp to where the mirror reflects it to the floor point, which is seen mirrored at x = 4.
    let reflected = brought(image, DVec3::X * 4.0 - straight);
    above_floor(build, "luminaire beside a mirror".into(), brought(straight, -straight) + reflected, 2e-3)
}
