//! Suns with a disc: what they bring, the edges of their shadows, and what is seen of them.

use std::f64::consts::PI;

use glam::Vec3;
use scenes::{Light, Surface};

use super::build::Build;
use super::emitters::above_floor;
use crate::case::Exact;

/// A sun of irradiance 1, so far from the zenith, on a surface that faces it.
fn sun(angle_deg: f32, diameter_deg: f32) -> Light {
    let (sin, cos) = angle_deg.to_radians().sin_cos();
    Light::Directional { direction: Vec3::new(sin, -cos, 0.0), irradiance: Vec3::ONE, diameter_deg }
}

/// Wholly above the horizon, a disc brings what parallel rays bring: its irradiance times the cosine of its middle.
pub fn open(angle_deg: f32, diameter_deg: f32) -> Exact {
    let mut build = Build::new("sun with a disc");
    build.light(sun(angle_deg, diameter_deg));
    let irradiance = f64::from(angle_deg).to_radians().cos();
    above_floor(build, format!("disc of {diameter_deg}° at {angle_deg}°"), irradiance, 1e-4)
}

/// A sun in the zenith over half a roof, whose edge is `x` away at height 1: over there for x > 0, so that less than half
/// of the disc is hidden.
///
/// Projected on the floor, the disc is one of radius sin σ, and the edge the ellipse of those directions that meet it. What
/// is on this side of it is a sum over strips across the edge.
pub fn penumbra(diameter_deg: f32, x: f32) -> Exact {
    let mut build = Build::new("penumbra");
    let black = build.paint(0.0, 0.0);
    build.quad(Vec3::new(-x - 50.0, 1.0, 0.0), Vec3::X * 50.0, Vec3::Z * 50.0, black);
    build.light(sun(0.0, diameter_deg));
    let radius = (f64::from(diameter_deg) / 2.0).to_radians().sin();
    // A direction (a, b, c) meets the edge where a / c = −x.
    let slope = f64::from(x) / (1.0 + f64::from(x).powi(2)).sqrt();
    let strips = 100_000;
    let open: f64 = (0..strips)
        .map(|strip| {
            let b = radius * (2.0 * (f64::from(strip) + 0.5) / f64::from(strips) - 1.0);
            let most = (radius * radius - b * b).sqrt();
            let edge = -slope * (1.0 - b * b).sqrt();
            (most - edge.clamp(-most, most)) * 2.0 * radius / f64::from(strips)
        })
        .sum();
    let irradiance = open / (PI * radius * radius);
    above_floor(build, format!("disc of {diameter_deg}°, edge at {x}"), irradiance, 1e-3)
}

/// What is seen of a disc, and nothing else, straight or in a mirror: its irradiance over its projected solid angle.
pub fn seen(diameter_deg: f32, in_mirror: bool) -> Exact {
    let mut build = Build::new("the sun itself");
    build.light(sun(90.0, diameter_deg));
    // The sun is at −x.
    let mirror = build.surface(Surface::Mirror { reflectance: Vec3::splat(0.5) });
    build.quad(Vec3::X * 2.0, Vec3::Y, Vec3::Z, mirror);
    let target = if in_mirror { Vec3::X } else { Vec3::NEG_X };
    let sine = (f64::from(diameter_deg) / 2.0).to_radians().sin();
    let radiance = if in_mirror { 0.5 } else { 1.0 } / (PI * sine * sine);
    let way = if in_mirror { "in a mirror" } else { "straight" };
    let scene = build.seen(Vec3::ZERO, target, diameter_deg / 2.0, 4);
    Exact { name: format!("disc of {diameter_deg}° seen {way}"), scene, radiance, tolerance: 1e-4 }
}
