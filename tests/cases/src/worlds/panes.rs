//! Lamps and skies behind panes and in houses of glass.

use glam::{DVec3, Vec3};
use scenes::{Dielectric, Light, Surface};

use super::build::{Build, Fronts, Paint};
use super::emitters::above_floor;
use crate::case::Exact;
use crate::closed_form;

const IOR: f32 = 1.5;

/// What shines on a house of glass.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outside {
    /// A uniform sky of radiance 1.
    Sky,
    /// A room whose walls emit radiance 1.
    Room,
}

/// A block that emits ½ and reflects half of what it gets, in a closed house of glass, thin panes or walls that have a
/// thickness, in light of radiance 1 from all sides: all that the eye can see has radiance 1. All light comes through glass,
/// past one wall straight, or by any number of reflections within; who counts a path twice gets more.
pub fn greenhouse(thin: bool, outside: Outside) -> Exact {
    let mut build = Build::new("greenhouse");
    let (glass, block) = (clear(&mut build, thin), build.paint(0.5, 0.5));
    if !thin {
        build.block(Vec3::ZERO, Vec3::splat(1.05), glass);
    }
    build.room(1.0, [glass; 6]);
    build.block(Vec3::ZERO, Vec3::new(0.4, 0.1, 0.4), block);
    match outside {
        Outside::Sky => build.environment(1.0),
        Outside::Room => {
            let wall = build.paint(0.0, 1.0);
            build.room(2.0, [wall; 6]);
        }
    }
    Exact {
        name: format!("block in a house of {} glass in a {outside:?}", if thin { "thin" } else { "thick" }),
        scene: build.seen(Vec3::new(0.0, 0.4, 0.3), Vec3::Y * 0.1, 20.0, 8),
        radiance: 1.0,
        tolerance: 1e-3,
    }
}

/// A light over a floor point behind two small panes that slant against each other, so that what one reflects to the other
/// goes astray: a point, or a lamp of the same intensity towards the floor.
pub fn light_through_slanting_panes(bodiless: bool) -> Exact {
    let mut build = Build::new("light through slanting panes");
    let pane = clear(&mut build, true);
    let place = Vec3::new(0.5, 1.2, 0.3);
    let (to, distance) = (place.as_dvec3().normalize(), place.as_dvec3().length());
    let mut passed = 1.0;
    for (along, across, other) in [
        (0.4, Vec3::new(1.0, -0.3, 0.0), Vec3::new(0.0, 0.1, 1.0)),
        (0.6, Vec3::new(1.0, 0.2, 0.4), Vec3::new(0.0, -0.5, 1.0)),
    ] {
        build.quad(place * along, across * 0.15, other * 0.15, pane);
        let normal: DVec3 = across.as_dvec3().cross(other.as_dvec3()).normalize();
        passed *= 1.0 - closed_form::sheet(closed_form::fresnel(to.dot(normal).abs(), IOR.into()));
    }
    if bodiless {
        build.light(Light::Point { position: place, intensity: Vec3::ONE });
    } else {
        let (half, side) = (0.02, place.cross(Vec3::Z).normalize());
        let front = side.cross(place).normalize();
        let lamp = build.paint(0.0, 1.0 / (4.0 * half * half));
        // Its front faces the floor point.
        build.quad(place, side * half, front * half, lamp);
    }
    let name = format!("{} behind two slanting panes", if bodiless { "point" } else { "lamp" });
    above_floor(build, name, passed * to.y / (distance * distance), 2e-3)
}

/// A ball, hollow and grey, with a window of clear glass; all its light comes from a distant glowing wall before the window,
/// which sees hardly anything of it. Where the wall is not seen, the ball is lit evenly, by what the part opposite to the window sends on.
pub fn lit_from_a_far_wall() -> Exact {
    const ALBEDO: f32 = 0.7;
    let mut build = Build::new("lit from a far wall");
    let inside = build.paint(ALBEDO, 0.0);
    let opening = build.sphere_but(Vec3::ZERO, 1.0, 24, Fronts::Inwards, inside, |towards| towards.x > 0.95);
    let area_of = |[a, b, c]: [DVec3; 3]| (b - a).cross(c - a) / 2.0;
    let opening: Vec<DVec3> = opening.into_iter().map(|triangle| area_of(triangle.map(|p| p.as_dvec3()))).collect();
    // All but not there: of index 1, it reflects nothing.
    let pane = build.surface(Surface::Dielectric(Dielectric::clear(1.0, true)));
    build.quad(Vec3::X * 1.01, Vec3::Y * 0.4, Vec3::Z * 0.4, pane);
    let paint = build.paint(0.5, 1.0);
    let (half, distance) = (12.0_f32, 30.0);
    build.quad(Vec3::X * distance, Vec3::Z * half, Vec3::Y * half, paint);
    // So far away, its light is the same all over the window.
    let corner = |y: f32, z: f32| Vec3::new(distance - 1.0, y * half, z * half).as_dvec3();
    let corners = [corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)];
    let across: f64 = opening.iter().map(|area| area.x.abs()).sum();
    let flux = closed_form::polygon(&corners, DVec3::X) * across;
    let share = opening.iter().map(|area| area.length()).sum::<f64>() / (4.0 * std::f64::consts::PI);
    // What leaves by the window does not come back.
    let albedo = f64::from(ALBEDO);
    let irradiance = flux * albedo / (4.0 * std::f64::consts::PI) / (1.0 - albedo * (1.0 - share));
    Exact {
        name: "hollow ball before a wall".into(),
        scene: build.seen(Vec3::ZERO, Vec3::new(0.0, -0.3, 1.0), 30.0, 8),
        radiance: albedo / std::f64::consts::PI * irradiance,
        tolerance: 1e-2,
    }
}

fn clear(build: &mut Build, thin: bool) -> Paint {
    build.surface(Surface::Dielectric(Dielectric::clear(IOR, thin)))
}
