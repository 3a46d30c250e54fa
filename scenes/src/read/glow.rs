//! How much light glowing surfaces give the rest of a scene, beside daylight: an emitter lights a room, the LED of a
//! product lights nothing.
//!
//! A few points on what glows, picked by power, and a few on what does not; between them light goes as between small
//! discs that nothing hides. Both picks are regular, so that the same scene gives the same number anywhere.

use std::f64::consts::PI;

use glam::{DVec3, Vec3};

use super::textures::mean;
use crate::{Material, Scene};

/// What glows in a scene.
pub(super) struct Glow {
    /// The irradiance that it gives to what is lit well (a quarter of the scene is lit better), over that under a sky
    /// of radiance 1. More than any number if everything glows; 0 if nothing does.
    pub share_of_daylight: f64,
    /// Largest factor of an emission, a channel's.
    pub brightest: f32,
}

/// Points on what glows.
const GLOWING: usize = 256;
/// Points on what does not, for each of two ways to pick them.
const LIT: usize = 512;

/// Looks at a scene.
///
/// A quarter is counted once by area and once by triangles, and the brighter counts: neither a ground that goes on for
/// a mile nor a screw of a thousand faces decides alone.
pub(super) fn of(scene: &Scene) -> Glow {
    let brightest = scene.materials.iter().map(|material| material.emission.value.max_element()).fold(0.0, f32::max);
    Glow { share_of_daylight: share_of_daylight(scene), brightest }
}

fn share_of_daylight(scene: &Scene) -> f64 {
    let radiances: Vec<f64> = scene.materials.iter().map(|material| radiance(material, scene)).collect();
    let emits = |material: u32| radiances[material as usize] > 0.0;
    let power = |triangle: &Triangle| {
        let sides = if scene.materials[triangle.material as usize].emits_both_sides { 2.0 } else { 1.0 };
        radiances[triangle.material as usize] * sides * triangle.area()
    };
    let receives = |triangle: &Triangle| !emits(triangle.material);
    let area = |triangle: &Triangle| if receives(triangle) { triangle.area() } else { 0.0 };
    let count = |triangle: &Triangle| f64::from(u8::from(receives(triangle)));
    let (sources, total) = pick(scene, GLOWING, power);
    if sources.is_empty() {
        return 0.0;
    }
    let glow: Vec<Source> = sources
        .iter()
        .map(|source| {
            let both_sides = scene.materials[source.material as usize].emits_both_sides;
            let intensity = total / sources.len() as f64 / if both_sides { 2.0 } else { 1.0 };
            let area = intensity / radiances[source.material as usize];
            Source { position: source.point, normal: source.normal, intensity, area, both_sides }
        })
        .collect();
    let lit_well = |picked: &[Picked]| {
        let mut irradiance: Vec<f64> =
            picked.iter().map(|point| glow.iter().map(|source| source.irradiance(point)).sum()).collect();
        irradiance.sort_by(f64::total_cmp);
        irradiance.get(irradiance.len() * 3 / 4).map_or(f64::INFINITY, |irradiance| irradiance / PI)
    };
    lit_well(&pick(scene, LIT, area).0).max(lit_well(&pick(scene, LIT, count).0))
}

/// Mean over channels and texels of the radiance that a material emits.
fn radiance(material: &Material, scene: &Scene) -> f64 {
    let texels = material.emission.texture.map_or(Vec3::ONE, |texture| mean(&scene.textures[texture as usize]));
    f64::from((material.emission.value * texels).element_sum() / 3.0)
}

/// In scene space.
struct Triangle {
    corners: [DVec3; 3],
    material: u32,
}

impl Triangle {
    /// Twice the area, along the front side.
    fn cross(&self) -> DVec3 {
        let [a, b, c] = self.corners;
        (b - a).cross(c - a)
    }

    fn area(&self) -> f64 {
        self.cross().length() / 2.0
    }
}

/// A point on a triangle.
struct Picked {
    point: DVec3,
    normal: DVec3,
    material: u32,
}

/// `count` points, as many on each triangle as its weight's share of the total, and that total.
fn pick(scene: &Scene, count: usize, weight: impl Fn(&Triangle) -> f64) -> (Vec<Picked>, f64) {
    let mut total = 0.0;
    each_triangle(scene, |triangle| total += weight(&triangle));
    let mut picked = Vec::new();
    if !(total.is_finite() && total > 0.0) {
        return (picked, 0.0);
    }
    let mut passed = 0.0;
    each_triangle(scene, |triangle| {
        passed += weight(&triangle);
        while picked.len() < count && (picked.len() as f64 + 0.5) / count as f64 * total < passed {
            picked.push(triangle_point(&triangle, picked.len()));
        }
    });
    (picked, total)
}

/// The n-th of points that fill a triangle evenly: an R₂ sequence (Roberts 2018), folded.
fn triangle_point(triangle: &Triangle, n: usize) -> Picked {
    let step = n as f64 + 0.5;
    let [mut u, mut v] = [0.754_877_666_246_692_8 * step, 0.569_840_290_998_053_3 * step].map(f64::fract);
    if u + v > 1.0 {
        (u, v) = (1.0 - u, 1.0 - v);
    }
    let [a, b, c] = triangle.corners;
    let point = a + (b - a) * u + (c - a) * v;
    Picked { point, normal: triangle.cross().normalize_or_zero(), material: triangle.material }
}

fn each_triangle(scene: &Scene, mut see: impl FnMut(Triangle)) {
    for (number, object) in scene.objects.iter().enumerate().filter(|(_, object)| object.visible) {
        let mesh = &scene.meshes[object.mesh as usize];
        for i in scene.triangles(number) {
            let corner = |vertex: u32| object.scene_from_object.point(mesh.positions[vertex as usize]).as_dvec3();
            see(Triangle { corners: mesh.triangles[i].map(corner), material: mesh.materials[i] });
        }
    }
}

/// A small disc that shines.
struct Source {
    position: DVec3,
    normal: DVec3,
    /// Along the normal.
    intensity: f64,
    area: f64,
    both_sides: bool,
}

impl Source {
    /// On a point that scatters on both sides. The area keeps it below π times the radiance however near the point is.
    fn irradiance(&self, at: &Picked) -> f64 {
        let way = at.point - self.position;
        let distance_squared = way.length_squared();
        let direction = way.normalize_or_zero();
        let leaving = direction.dot(self.normal);
        let leaving = if self.both_sides { leaving.abs() } else { leaving.max(0.0) };
        self.intensity * leaving * direction.dot(at.normal).abs() / (distance_squared + self.area / PI)
    }
}
