//! Lamps without surface behind thin panes and in flat mirrors: images and Fresnel's factors in closed form.

use glam::{DVec3, Vec3};
use scenes::{Colour, Dielectric, Light, Surface};

use super::build::Build;
use super::emitters::above_floor;
use crate::case::Exact;
use crate::closed_form;

const IOR: f32 = 1.5;

/// The sun at that angle from the zenith, over a floor point under so many large panes, parallel and level: m faces of
/// reflectance R let `(1 − R)/(1 + (m − 1) R)` through, all reflections between the panes included.
pub fn sun_through_panes(panes: u32, angle_deg: f32) -> Exact {
    disc_through_panes(panes, angle_deg, 0.0)
}

/// The same with a disc, over which Fresnel's factors have about the mean of its middle.
pub fn disc_through_panes(panes: u32, angle_deg: f32, diameter_deg: f32) -> Exact {
    let mut build = Build::new("sun through panes");
    let pane = build.surface(Surface::Dielectric(Dielectric::clear(IOR, true)));
    for number in 0..panes {
        build.quad(Vec3::Y * (0.5 + 0.25 * number as f32), Vec3::Z * 50.0, Vec3::X * 50.0, pane);
    }
    let (sin, cos) = angle_deg.to_radians().sin_cos();
    build.light(Light::Directional { direction: Vec3::new(sin, -cos, 0.0), irradiance: Vec3::ONE, diameter_deg });
    let (face, faces) = (closed_form::fresnel(cos.into(), IOR.into()), f64::from(2 * panes));
    let passed = (1.0 - face) / (1.0 + (faces - 1.0) * face);
    above_floor(build, format!("sun at {angle_deg}° through {panes} panes"), f64::from(cos) * passed, 1e-3)
}

/// A point light behind a slanting pane that takes half of the red, green and blue it lets pass.
pub fn point_through_a_tinted_pane() -> Exact {
    let mut build = Build::new("point through a tinted pane");
    let pane = build.surface(Surface::Dielectric(Dielectric {
        transmittance: Colour::plain(Vec3::splat(0.5)),
        ..Dielectric::clear(IOR, true)
    }));
    let (position, across) = (Vec3::new(0.5, 1.5, -0.25), Vec3::new(1.0, 0.5, 0.0));
    build.quad(Vec3::Y * 0.6, across, Vec3::Z, pane);
    build.light(Light::Point { position, intensity: Vec3::ONE });
    let (to, normal) = (position.as_dvec3(), across.as_dvec3().cross(DVec3::Z).normalize());
    let face = closed_form::fresnel(to.normalize().dot(normal).abs(), IOR.into());
    let passed = 0.5 * (1.0 - closed_form::sheet(face));
    above_floor(build, "point light through a tinted pane".into(), passed * to.y / to.length().powi(3), 1e-3)
}

/// A point light between two upright mirrors at x = ±1 that face each other: image k of either row has ρ^k of it. With a
/// spot instead, which shines on one mirror alone, only the images in that one first.
pub fn between_mirrors(reflectance: f32, spot: bool) -> Exact {
    let mut build = Build::new("between mirrors");
    let mirror = build.surface(Surface::Mirror { reflectance: Vec3::splat(reflectance) });
    for side in [-1.0, 1.0] {
        build.quad(Vec3::X * side, Vec3::Y * 200.0, Vec3::Z * 200.0, mirror);
    }
    let position = Vec3::new(0.25, 1.0, 0.5);
    let place = position.as_dvec3();
    // Image k, first reflected at −1 or at +1, is 2k away from the light or from its mirror image.
    let image = |k: i32, side: f64| {
        let x = if k % 2 == 0 { place.x } else { -place.x };
        DVec3::new(x + 2.0 * side * f64::from(k), place.y, place.z)
    };
    let of = |k: i32, to: DVec3| f64::from(reflectance).powi(k) * to.y / to.length().powi(3);
    let irradiance = if spot {
        // Towards the image of the floor point in the mirror at x = 1, and too narrow for the next.
        let direction = (DVec3::X * 2.0 - place).normalize().as_vec3();
        let (cos_inner, cos_outer) = (0.999, 0.998);
        build.light(Light::Spot { position, direction, intensity: Vec3::ONE, cos_inner, cos_outer });
        of(1, image(1, 1.0))
    } else {
        build.light(Light::Point { position, intensity: Vec3::ONE });
        let rows = (1..2000).map(|k| of(k, image(k, -1.0)) + of(k, image(k, 1.0)));
        of(0, place) + rows.sum::<f64>()
    };
    let lamp = if spot { "spot" } else { "point light" };
    above_floor(build, format!("{lamp} between mirrors of {reflectance}"), irradiance, 2e-3)
}
