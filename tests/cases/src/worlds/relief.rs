//! Relief by normal maps: row 65.

use std::f64::consts::PI;

use glam::{Vec2, Vec3};
use scenes::{Light, LookUp, Material, NormalMap, Pixels, Texture};

use super::build::Build;
use super::emitters::FLOOR;
use crate::case::Exact;

/// A floor whose normal map leans all of it by the same angle towards +x, under a sun that it leans to or from; then with
/// half its slope, and lying the other way round.
pub fn leaning_floors() -> Vec<Exact> {
    // Of the map, the sun's side, the factor on the slope, whether u grows along −x; and the cosine.
    let leant = Vec3::new(0.6, 0.8, 0.0);
    let half = Vec3::new(0.3, 0.8, 0.0).normalize();
    let floors = [
        ("to the sun", 0.6, 1.0, false, leant.dot(leant)),
        ("from the sun", -0.6, 1.0, false, leant.dot(Vec3::new(-0.6, 0.8, 0.0))),
        ("by half", 0.6, 0.5, false, half.dot(leant)),
        ("as its picture is turned", -0.6, 1.0, true, 1.0),
    ];
    let each = floors.map(|(name, sun, scale, turned, cos)| {
        let mut build = Build::new("relief");
        let relief = Some(NormalMap { texture: 0, scale });
        let floor = build.material(Material { relief, ..Material::diffuse("floor", Vec3::splat(FLOOR)) });
        build.quad(Vec3::ZERO, Vec3::Z, Vec3::X, floor);
        // The normal (0.6, 0, 0.8), stored from 0 to 1.
        let pixels = Pixels::Float(vec![[0.8, 0.5, 0.9]]);
        let map = Texture { name: "lean".into(), width: 1, height: 1, pixels, look_up: LookUp::REPEAT };
        build.texture(map, |p| if turned { Vec2::new(-p.x, p.z) } else { Vec2::new(p.x, -p.z) });
        let direction = Vec3::new(-sun, -0.8, 0.0);
        build.light(Light::Directional { direction, irradiance: Vec3::splat(2.0), diameter_deg: 0.0 });
        let scene = build.seen(Vec3::new(0.2, 1.0, 0.3), Vec3::ZERO, 20.0, 8);
        let radiance = f64::from(FLOOR) / PI * 2.0 * f64::from(cos);
        Exact { name: format!("floor that leans {name}"), scene, radiance, tolerance: 1e-3 }
    });
    each.into()
}
