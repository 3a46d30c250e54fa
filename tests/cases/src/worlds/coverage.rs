//! Surfaces that are there in part: row 54.

use std::f64::consts::PI;

use glam::Vec3;
use scenes::{Colour, Coverage, Light, LookUp, Material, Pixels, Surface, Texture};

use super::build::{Build, Fronts, Paint};
use super::emitters::{FLOOR, above_floor};
use crate::case::Exact;

/// Pixels to a side.
const SIDE: u32 = 8;

/// A floor under a slanting sun, behind a black pane that is there to that part.
pub fn sun_through_a_pane(amount: f32) -> Exact {
    let mut build = Build::new("sun through a pane");
    let pane = partial(&mut build, 0.0, 0.0, Coverage::plain(amount));
    build.quad(Vec3::new(0.0, 3.0, 0.0), Vec3::X * 9.0, Vec3::Z * 9.0, pane);
    let direction = Vec3::new(0.6, -0.8, 0.0);
    build.light(Light::Directional { direction, irradiance: Vec3::splat(2.0), diameter_deg: 0.0 });
    let irradiance = 2.0 * 0.8 * (1.0 - f64::from(amount));
    above_floor(build, format!("floor, sun through a pane of which {amount} is there"), irradiance, 1e-3)
}

/// The same with two panes: where one is, says nothing about the other.
pub fn sun_through_two_panes() -> Exact {
    let mut build = Build::new("sun through two panes");
    let pane = partial(&mut build, 0.0, 0.0, Coverage::plain(0.5));
    // Not with the seam between two triangles above what is seen: rays that meet a seam meet both.
    for y in [3.0, 4.0] {
        build.quad(Vec3::new(2.0, y, -1.0), Vec3::X * 9.0, Vec3::Z * 9.0, pane);
    }
    build.light(Light::Directional { direction: Vec3::NEG_Y, irradiance: Vec3::splat(2.0), diameter_deg: 0.0 });
    above_floor(build, "floor, sun through two panes".into(), 0.5, 1e-3)
}

/// A film that shines with radiance 2 before a sky of radiance 1, looked at. It is covered by a factor, by a
/// texture that fades from nothing to all, or by the same cut off at a quarter.
pub fn glowing_films() -> Vec<Exact> {
    let fading = |value, cutoff| Coverage { amount: scenes::Scalar { value, texture: Some((0, 3)) }, cutoff };
    let films = [
        ("of which 0.3 is there", Coverage::plain(0.3), 0.3),
        ("that fades", fading(1.0, None), 0.5),
        ("of which 0.6 is there and that fades", fading(0.6, None), 0.3),
        ("that fades, cut off at 0.25", fading(1.0, Some(0.25)), 0.75),
        ("of which 0.2 is there, cut off at 0.25", Coverage { cutoff: Some(0.25), ..Coverage::plain(0.2) }, 0.0),
    ];
    let each = films.map(|(name, coverage, mean)| {
        let mut build = Build::new("glowing film");
        let film = partial(&mut build, 0.0, 2.0, coverage);
        build.quad(Vec3::ZERO, Vec3::X, Vec3::Y, film);
        build.environment(1.0);
        let pixels = Pixels::Linear8((0..=255).map(|alpha| [255, 255, 255, alpha]).collect());
        let fade = Texture { name: "fade".into(), width: 256, height: 1, pixels, look_up: LookUp::CLAMP };
        build.texture(fade, |p| (p.truncate() + 1.0) / 2.0);
        // The film fills the picture.
        let scene = build.seen(Vec3::new(0.0, 0.0, 1.0), Vec3::ZERO, 90.0, SIDE);
        Exact { name: format!("film {name}"), scene, radiance: 2.0 * mean + (1.0 - mean), tolerance: 1e-3 }
    });
    each.into()
}

/// A floor under a dome that shines with radiance 1 where it is there, 0.8 of it.
pub fn glowing_dome() -> Exact {
    let mut build = Build::new("glowing dome");
    let dome = partial(&mut build, 0.0, 1.0, Coverage::plain(0.8));
    build.sphere(Vec3::ZERO, 2.0, 16, Fronts::Inwards, dome);
    above_floor(build, "floor under a dome of which 0.8 is there".into(), PI * 0.8, 1e-3)
}

/// A floor at the bottom of a shaft of perfect mirrors under a lid that shines where it is there: light that passes
/// mirrors, which photons and rays share.
pub fn glowing_lid() -> Exact {
    let mut build = Build::new("glowing lid");
    let lid = partial(&mut build, 0.0, 1.0, Coverage::plain(0.8));
    let (mirror, floor) = (build.surface(Surface::Mirror { reflectance: Vec3::ONE }), build.paint(FLOOR, 0.0));
    build.room(1.0, [mirror, mirror, floor, lid, mirror, mirror]);
    Exact {
        name: "floor of a shaft of mirrors under a lid of which 0.8 is there".into(),
        scene: build.seen(Vec3::new(0.1, 0.0, 0.2), Vec3::new(0.1, -1.0, 0.2), 40.0, SIDE),
        radiance: f64::from(FLOOR) * 0.8,
        tolerance: 3e-3,
    }
}

/// A furnace under a sky of radiance 1 whose walls, which shine and reflect, are there by half: all is 1.
pub fn thin_furnace() -> Exact {
    let mut build = Build::new("thin furnace");
    let wall = partial(&mut build, 0.5, 0.5, Coverage::plain(0.5));
    build.room(1.0, [wall; 6]);
    build.environment(1.0);
    Exact {
        name: "furnace whose walls are there by half".into(),
        scene: build.seen(Vec3::ZERO, Vec3::new(0.3, 0.2, -1.0), 60.0, SIDE),
        radiance: 1.0,
        tolerance: 1e-3,
    }
}

fn partial(build: &mut Build, albedo: f32, radiance: f32, coverage: Coverage) -> Paint {
    let emission = Colour::plain(Vec3::splat(radiance));
    let whole = Material::diffuse("partial", Vec3::splat(albedo));
    build.material(Material { emission, coverage: Some(coverage), ..whole })
}
