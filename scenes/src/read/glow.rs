//! How much light glowing surfaces give the rest of a scene, beside daylight: an emitter lights a room, the LED of a
//! product lights nothing.
//!
//! A few points on what glows, picked by power, and a few on what does not, as textures tell the one from the other; between
//! them light goes as between small discs that nothing hides. Both picks are regular, so that the same scene gives the same
//! number anywhere.

use std::f64::consts::PI;

use glam::{DVec3, Vec3};

use super::textures::mean;
use crate::place::Place;
use crate::{Material, Mesh, Scene};

/// What glows in a scene.
pub(super) struct Glow {
    /// The irradiance that it gives to what is lit well (a quarter of the scene is lit better), over that under a sky
    /// of radiance 1. Where everything glows: the radiance of what glows well. 0 if nothing does.
    pub share_of_daylight: f64,
    /// Largest factor of an emission, a channel's.
    pub brightest: f32,
}

/// Points on what glows.
const GLOWING: usize = 256;
/// Points on all surfaces, for each of two ways to pick them.
const LIT: usize = 1024;
/// A point glows that is no darker than this share of the brightest: textures that were packed with losses are not quite
/// black elsewhere.
const GLOWS_FROM: f64 = 0.01;
/// Everything glows if no more than this share of the points does not.
const NEXT_TO_NONE: f64 = 0.02;

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
    let power = |triangle: &Triangle| {
        let sides = if scene.materials[triangle.material as usize].emits_both_sides { 2.0 } else { 1.0 };
        radiances[triangle.material as usize] * sides * triangle.area()
    };
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
    let brightest = |picked: &[Picked]| picked.iter().map(|point| point.radiance).fold(0.0, f64::max);
    let lit_well = |picked: &[Picked]| {
        let from = GLOWS_FROM * brightest(&sources).max(brightest(picked));
        let (glowing, dark): (Vec<&Picked>, Vec<&Picked>) = picked.iter().partition(|point| point.radiance > from);
        if dark.len() as f64 <= NEXT_TO_NONE * picked.len() as f64 {
            return upper_quartile(glowing.iter().map(|point| point.radiance));
        }
        let irradiance = |point: &Picked| glow.iter().map(|source| source.irradiance(point)).sum::<f64>();
        upper_quartile(dark.iter().map(|point| irradiance(point) / PI))
    };
    lit_well(&pick(scene, LIT, |triangle| triangle.area()).0).max(lit_well(&pick(scene, LIT, |_| 1.0).0))
}

/// What a quarter of some numbers exceeds; 0 without any.
fn upper_quartile(numbers: impl Iterator<Item = f64>) -> f64 {
    let mut numbers: Vec<f64> = numbers.collect();
    numbers.sort_by(f64::total_cmp);
    numbers.get(numbers.len() * 3 / 4).copied().unwrap_or(0.0)
}

/// Mean over channels and texels of the radiance that a material emits.
fn radiance(material: &Material, scene: &Scene) -> f64 {
    let texels = material.emission.texture.map_or(Vec3::ONE, |texture| mean(&scene.textures[texture as usize]));
    f64::from((material.emission.value * texels).element_sum() / 3.0)
}

/// In scene space.
struct Triangle<'a> {
    corners: [DVec3; 3],
    material: u32,
    mesh: &'a Mesh,
    /// Index into the mesh's.
    index: usize,
}

impl Triangle<'_> {
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
    /// That it emits, mean over channels.
    radiance: f64,
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
            picked.push(triangle_point(scene, &triangle, picked.len()));
        }
    });
    (picked, total)
}

/// The n-th of points that fill a triangle evenly: an R₂ sequence (Roberts 2018), folded.
fn triangle_point(scene: &Scene, triangle: &Triangle, n: usize) -> Picked {
    let step = n as f64 + 0.5;
    let [mut u, mut v] = [0.754_877_666_246_692_8 * step, 0.569_840_290_998_053_3 * step].map(f64::fract);
    if u + v > 1.0 {
        (u, v) = (1.0 - u, 1.0 - v);
    }
    let [a, b, c] = triangle.corners;
    let point = a + (b - a) * u + (c - a) * v;
    let weights = [1.0 - u - v, u, v].map(|weight| weight as f32);
    let place = Place { mesh: triangle.mesh, triangle: triangle.index, weights };
    let emission = scene.materials[triangle.material as usize].emission;
    let radiance = f64::from((emission.value * place.colour(scene, emission.texture)).element_sum() / 3.0);
    Picked { point, normal: triangle.cross().normalize_or_zero(), material: triangle.material, radiance }
}

fn each_triangle<'a>(scene: &'a Scene, mut see: impl FnMut(Triangle<'a>)) {
    for (number, object) in scene.objects.iter().enumerate().filter(|(_, object)| object.visible) {
        let mesh = &scene.meshes[object.mesh as usize];
        for i in scene.triangles(number) {
            let corner = |vertex: u32| object.scene_from_object.point(mesh.positions[vertex as usize]).as_dvec3();
            see(Triangle { corners: mesh.triangles[i].map(corner), material: mesh.materials[i], mesh, index: i });
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
