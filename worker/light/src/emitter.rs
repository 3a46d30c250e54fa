//! Everything that shines, and how to pick points on it by importance (IGI-12).
//!
//! A source is chosen in proportion to its power, mixed with an equal share for every *emitter* (all
//! triangles of one object and material together), so that a dim emitter beside a huge one is never
//! starved (algorithms.md E22). One cumulative table, searched by bisection: a million sources cost
//! twenty steps, and inversion keeps the strata of the quasi-random numbers.

use std::collections::BTreeMap;
use std::f32::consts::PI;

use glam::{Vec2, Vec3};
use scenes::{Light, LightGroup, Material, Rgb, Scene};

use crate::sky::Sky;
use crate::texture;
use crate::vpl::{Shape, Vpl};
use crate::warp;

/// The lights of a scene.
#[derive(Clone, Debug, Default)]
pub struct Emitters {
    sources: Vec<Source>,
    /// Cumulative probabilities, the last one 1.
    table: Vec<f64>,
    sky: Option<Sky>,
    /// Middle and radius of the scene: where light from afar enters.
    centre: Vec3,
    radius: f32,
}

#[derive(Clone, Copy, Debug)]
enum Source {
    Triangle { corner: Vec3, ab: Vec3, ac: Vec3, area: f32, object: u32, triangle: u32 },
    Light(u32),
    Sky,
}

/// Share of the choice that goes by power; the rest goes to all emitters alike.
const POWER_SHARE: f64 = 0.75;

impl Emitters {
    /// Finds all lights of the visible objects; `centre` and `radius` enclose these.
    pub fn new(scene: &Scene, centre: Vec3, radius: f32) -> Self {
        let sky = Sky::new(scene);
        let mut sources = Vec::new();
        let mut powers = Vec::new();
        let mut emitters = Vec::new();
        let mut emitter_ids = BTreeMap::new();
        for (object_index, object) in scene.objects.iter().enumerate().filter(|(_, o)| o.visible) {
            let mesh = &scene.meshes[object.mesh as usize];
            for triangle in scene.triangles(object_index) {
                let (corners, number) = (mesh.triangles[triangle], mesh.materials[triangle]);
                let material = &scene.materials[number as usize];
                if material.emission.is_black() {
                    continue;
                }
                let [a, b, c] = corners.map(|v| object.scene_from_object.point(mesh.positions[v as usize]));
                let (ab, ac) = (b - a, c - a);
                let area = ab.cross(ac).length() * 0.5;
                let sides = if material.emits_both_sides { 2.0 } else { 1.0 };
                let uvs = corners.map(|v| mesh.uvs.get(v as usize).copied().unwrap_or_default());
                let power = mean(average(scene, material, uvs)) * area * PI * sides;
                if power > 0.0 && power.is_finite() {
                    let next = emitter_ids.len();
                    emitters.push(*emitter_ids.entry((object_index, number)).or_insert(next));
                    powers.push(f64::from(power));
                    let (object, triangle) = (object_index as u32, triangle as u32);
                    sources.push(Source::Triangle { corner: a, ab, ac, area, object, triangle });
                }
            }
        }
        let disc = PI * radius * radius;
        let mut emitter_count = emitter_ids.len();
        for (index, light) in scene.lights.iter().enumerate() {
            let power = match light {
                Light::Point { .. } | Light::Spot { .. } => mean(point_light(light).flux()),
                Light::Directional { irradiance, .. } => mean(*irradiance) * disc,
            };
            if power > 0.0 && power.is_finite() {
                sources.push(Source::Light(index as u32));
                powers.push(f64::from(power));
                emitters.push(emitter_count);
                emitter_count += 1;
            }
        }
        if let Some(sky) = &sky {
            sources.push(Source::Sky);
            powers.push(f64::from(sky.power() * disc));
            emitters.push(emitter_count);
            emitter_count += 1;
        }
        let table = cumulative(&powers, &emitters, emitter_count);
        Self { sources, table, sky, centre, radius }
    }

    /// Bytes that the tables take.
    pub fn bytes(&self) -> usize {
        let sky = self.sky.as_ref().map_or(0, Sky::bytes);
        size_of_val(&self.sources[..]) + size_of_val(&self.table[..]) + sky
    }

    /// Nothing shines.
    pub fn is_empty(&self) -> bool {
        self.sources.is_empty()
    }

    /// Some light has no surface, so that no ray can meet it.
    pub fn any_bodiless(&self) -> bool {
        // Triangles come first, the sky last.
        self.sources.iter().rev().take(2).any(|source| matches!(source, Source::Light(_)))
    }

    /// Number of sources: emissive triangles, lights and sky.
    pub fn len(&self) -> usize {
        self.sources.len()
    }

    /// Object and triangle of a source that is an emitter's ([`Vpl::source`]).
    pub fn triangle(&self, source: u32) -> Option<[u32; 2]> {
        match self.sources.get(source as usize)? {
            Source::Triangle { object, triangle, .. } => Some([*object, *triangle]),
            Source::Light(_) | Source::Sky => None,
        }
    }

    /// The light group of each source.
    pub fn groups(&self, scene: &Scene) -> Vec<LightGroup> {
        let group = |source: &Source| match *source {
            Source::Triangle { object, triangle, .. } => LightGroup::of_triangle(scene, object, triangle),
            Source::Light(light) => LightGroup::Light(light),
            Source::Sky => LightGroup::Environment,
        };
        self.sources.iter().map(group).collect()
    }

    /// Radiance from beyond all objects.
    pub fn sky_radiance(&self, scene: &Scene, direction: Vec3) -> Rgb {
        self.sky.as_ref().map_or(Vec3::ZERO, |sky| sky.radiance(scene, direction))
    }

    /// A point on a light as a virtual light of depth 0, its strength divided by its density.
    ///
    /// `u` = choice, two coordinates, a spare. `None` if nothing shines.
    pub fn sample(&self, scene: &Scene, u: [f32; 4]) -> Option<Vpl> {
        self.sample_with_density(scene, u).map(|(light, density)| Vpl { density, ..light })
    }

    /// As [`Self::sample`]; and the density of the point (on one side of an emitter, per unit area) or of the direction
    /// (of the sky, sr⁻¹). `None` for lights that no ray can meet.
    pub fn sample_with_density(&self, scene: &Scene, u: [f32; 4]) -> Option<(Vpl, Option<f32>)> {
        // 24 bits are too coarse to choose among a million: the spare supplies 24 more.
        let fine = f64::from(u[0]) + f64::from(u[3]) * (1.0 / 16_777_216.0);
        let choice = self.table.partition_point(|sum| *sum <= fine);
        let index = choice.min(self.sources.len().checked_sub(1)?);
        let probability = self.probability(index);
        let scale = (1.0 / probability) as f32;
        Some(match self.sources[index] {
            Source::Triangle { corner, ab, ac, area, object, triangle } => {
                let [b, c] = warp::triangle([u[1], u[2]]);
                let object = &scene.objects[object as usize];
                let mesh = &scene.meshes[object.mesh as usize];
                let material = &scene.materials[mesh.materials[triangle as usize] as usize];
                let corners = mesh.triangles[triangle as usize];
                let uvs = corners.map(|v| mesh.uvs.get(v as usize).copied().unwrap_or_default());
                let radiance = emitted(scene, material, uvs[0] * (1.0 - b - c) + uvs[1] * b + uvs[2] * c);
                let mut normal = ab.cross(ac).normalize_or_zero();
                if object.scene_from_object.linear.determinant() < 0.0 {
                    normal = -normal;
                }
                let mut strength = radiance * (area * scale);
                if material.emits_both_sides {
                    strength *= 2.0;
                    normal = if u[3] < 0.5 { normal } else { -normal };
                }
                let on = corner + ab * b + ac * c;
                let reach = corner.abs().max((corner + ab).abs()).max((corner + ac).abs()).max_element();
                let position = on + normal * (reach * (1.0 / 524_288.0));
                let (shape, source) = (Shape::Surface, index as u32);
                let emitter = Vpl { position, normal, strength, shape, depth: 0, source, density: None };
                (emitter, Some(self.density_on(index, area, material)))
            }
            Source::Light(light) => {
                let light = &scene.lights[light as usize];
                let vpl = match light {
                    Light::Directional { direction, irradiance } => Vpl {
                        position: Vec3::ZERO,
                        normal: -*direction,
                        strength: *irradiance,
                        shape: Shape::Distant,
                        depth: 0,
                        source: 0,
                        density: None,
                    },
                    Light::Point { .. } | Light::Spot { .. } => point_light(light),
                };
                (Vpl { strength: vpl.strength * scale, source: index as u32, ..vpl }, None)
            }
            Source::Sky => {
                let (towards, density) = self.sky.as_ref()?.sample(scene, [u[1], u[2], u[3]]);
                let radiance = self.sky_radiance(scene, towards);
                let strength = radiance * (scale / density);
                let sky = Vpl {
                    position: Vec3::ZERO,
                    normal: towards,
                    strength,
                    shape: Shape::Distant,
                    depth: 0,
                    source: index as u32,
                    density: None,
                };
                (sky, Some(probability as f32 * density))
            }
        })
    }

    /// The density that [`Self::sample_with_density`] tells of points on one side of an emitter's triangle; 0 if it chooses
    /// none there.
    pub fn density(&self, scene: &Scene, object: u32, triangle: u32) -> f32 {
        // Triangles come first and in this order.
        let number = |source: &Source| match source {
            Source::Triangle { object, triangle, .. } => (*object, *triangle),
            Source::Light(_) | Source::Sky => (u32::MAX, u32::MAX),
        };
        match self.sources.binary_search_by_key(&(object, triangle), number).map(|index| (index, self.sources[index])) {
            Ok((index, Source::Triangle { area, .. })) => {
                let mesh = &scene.meshes[scene.objects[object as usize].mesh as usize];
                self.density_on(index, area, &scene.materials[mesh.materials[triangle as usize] as usize])
            }
            _ => 0.0,
        }
    }

    /// The density that [`Self::sample_with_density`] tells of directions of the sky, sr⁻¹.
    pub fn density_of_sky(&self, scene: &Scene, direction: Vec3) -> f32 {
        match (&self.sky, self.sources.last()) {
            (Some(sky), Some(Source::Sky)) => {
                self.probability(self.sources.len() - 1) as f32 * sky.density(scene, direction)
            }
            _ => 0.0,
        }
    }

    fn density_on(&self, index: usize, area: f32, material: &Material) -> f32 {
        let sides = if material.emits_both_sides { 2.0 } else { 1.0 };
        self.probability(index) as f32 / (area * sides)
    }

    /// Where light from afar enters the scene: a point on the disc that covers it, and the disc's area.
    pub fn entry(&self, towards: Vec3, u: [f32; 2]) -> (Vec3, f32) {
        disc_entry(self.centre, self.radius, towards, self.radius, u)
    }

    /// A point on the disc that covers a ball within the scene, as seen from a distant light, moved
    /// out of the scene; and the disc's area.
    pub fn entry_to(&self, centre: Vec3, radius: f32, towards: Vec3, u: [f32; 2]) -> (Vec3, f32) {
        disc_entry(centre, radius, towards, 2.0 * self.radius, u)
    }

    /// Radius of the ball that holds the scene.
    pub fn scene_radius(&self) -> f32 {
        self.radius
    }

    /// Middle of the ball that holds the scene.
    pub fn scene_centre(&self) -> Vec3 {
        self.centre
    }

    fn probability(&self, index: usize) -> f64 {
        self.table[index] - if index > 0 { self.table[index - 1] } else { 0.0 }
    }
}

fn disc_entry(centre: Vec3, radius: f32, towards: Vec3, out: f32, u: [f32; 2]) -> (Vec3, f32) {
    let (s, t) = warp::frame(towards);
    let d = warp::disc(u) * radius;
    (centre + s * d.x + t * d.y + towards * out, PI * radius * radius)
}

fn point_light(light: &Light) -> Vpl {
    let (position, strength, shape) = match *light {
        Light::Spot { position, direction, intensity, cos_inner, cos_outer } => {
            (position, intensity, Shape::Spot { axis: direction, cos_inner, cos_outer })
        }
        Light::Point { position, intensity } => (position, intensity, Shape::Point),
        Light::Directional { .. } => (Vec3::ZERO, Vec3::ZERO, Shape::Distant),
    };
    Vpl { position, normal: Vec3::ZERO, strength, shape, depth: 0, source: 0, density: None }
}

fn cumulative(powers: &[f64], emitters: &[usize], emitter_count: usize) -> Vec<f64> {
    let total: f64 = powers.iter().sum();
    let mut emitter_power = vec![0.0; emitter_count];
    for (power, emitter) in powers.iter().zip(emitters) {
        emitter_power[*emitter] += power;
    }
    let mut sum = 0.0;
    let mut table: Vec<f64> = powers
        .iter()
        .zip(emitters)
        .map(|(power, emitter)| {
            let by_emitter = power / emitter_power[*emitter] / emitter_count as f64;
            sum += POWER_SHARE * power / total + (1.0 - POWER_SHARE) * by_emitter;
            sum
        })
        .collect();
    for entry in &mut table {
        *entry /= sum;
    }
    table
}

/// Radiance of an emitter's surface, times how much of it is there: rays meet it as often.
fn emitted(scene: &Scene, material: &Material, uv: Vec2) -> Rgb {
    let emission = material.emission;
    let whole = match emission.texture {
        None => emission.value,
        Some(index) => emission.value * texture::colour(&scene.textures[index as usize], uv),
    };
    match &material.coverage {
        None => whole,
        Some(coverage) => whole * texture::coverage(&scene.textures, coverage, uv),
    }
}

/// Mean emission over a triangle: by 36 look-ups where it varies; only the choice depends on it.
fn average(scene: &Scene, material: &Material, uvs: [Vec2; 3]) -> Rgb {
    let emission = material.emission;
    if emission.texture.is_none() && material.coverage.is_none() {
        return emission.value;
    }
    let mut sum = Vec3::ZERO;
    for i in 0..36 {
        let [b, c] = warp::triangle([((i % 6) as f32 + 0.5) / 6.0, ((i / 6) as f32 + 0.5) / 6.0]);
        sum += emitted(scene, material, uvs[0] * (1.0 - b - c) + uvs[1] * b + uvs[2] * c);
    }
    // An emitter whose texture is dark at all 36 places may still shine elsewhere.
    (sum / 36.0).max(emission.value * 1e-3)
}

fn mean(rgb: Rgb) -> f32 {
    (rgb.x + rgb.y + rgb.z) / 3.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use scenes::{Colour, Coverage, Environment, Mesh, Object, Pixels, Texture, Wrap};

    /// A large dim emitter, a small bright one, a point light and a sky.
    fn scene() -> Scene {
        let mut mesh = Mesh::default();
        for (i, size) in [2.0_f32, 0.1].into_iter().enumerate() {
            let first = mesh.positions.len() as u32;
            mesh.positions.extend([Vec3::ZERO, Vec3::X * size, Vec3::Y * size].map(|p| p + Vec3::Z * i as f32));
            mesh.triangles.push([first, first + 1, first + 2]);
            mesh.materials.push(i as u32);
        }
        let emitter = |radiance| Material {
            emission: Colour::plain(Vec3::splat(radiance)),
            ..Material::diffuse("lamp", Vec3::ZERO)
        };
        Scene {
            meshes: vec![mesh.into()],
            objects: vec![Object::fixed("lamps", 0)],
            materials: vec![emitter(1.0), emitter(100.0)],
            lights: vec![Light::Point { position: Vec3::ONE, intensity: Vec3::ONE }],
            environment: Environment::Constant(Vec3::splat(0.1)),
            ..Scene::default()
        }
    }

    #[test]
    fn sources_are_chosen_as_often_as_their_probabilities_say() {
        let scene = scene();
        let emitters = Emitters::new(&scene, Vec3::ZERO, 2.0);
        assert_eq!(emitters.len(), 4);
        let n = 100_000_u32;
        let mut counts = [0.0_f64; 4];
        let mut flux = Vec3::ZERO;
        for i in 0..n {
            let u = std::array::from_fn(|d| (crate::sample::mix(4 * i + d as u32) >> 8) as f32 / 16_777_216.0);
            let (vpl, density) = emitters.sample_with_density(&scene, u).expect("something shines");
            let source = match vpl.shape {
                Shape::Surface => usize::from(vpl.position.z > 0.5),
                Shape::Point => 2,
                _ => 3,
            };
            let found = match source {
                0 | 1 => Some(emitters.density(&scene, 0, source as u32)),
                2 => None,
                _ => Some(emitters.density_of_sky(&scene, vpl.normal)),
            };
            assert_eq!(density, found, "source {source}");
            counts[source] += 1.0;
            flux += vpl.flux() / n as f32;
        }
        let x2: f64 = (0..4)
            .map(|i| {
                (counts[i] - emitters.probability(i) * f64::from(n)).powi(2) / (emitters.probability(i) * f64::from(n))
            })
            .sum();
        assert!(x2 < 21.1, "χ² = {x2} for 3 degrees of freedom (99.99 %)");
        // Strength over density integrates to the flux: emitters π A L, the point light 4π I.
        let expected = PI * (2.0 * 1.0 + 0.005 * 100.0) + 4.0 * PI;
        assert!((flux.x / expected - 1.0).abs() < 0.02, "{} against {expected}", flux.x);
    }

    #[test]
    fn a_dim_emitter_beside_a_huge_one_is_not_starved() {
        let mut scene = scene();
        scene.materials[1].emission = Colour::plain(Vec3::splat(1e12));
        let emitters = Emitters::new(&scene, Vec3::ZERO, 2.0);
        assert!(emitters.probability(0) > 0.05);
    }

    #[test]
    fn holes_do_not_shine() {
        let corners = [Vec3::ZERO, Vec3::X, Vec3::Y];
        let mesh = Mesh {
            positions: corners.to_vec(),
            uvs: corners.map(|p| p.truncate()).to_vec(),
            triangles: vec![[0, 1, 2]],
            materials: vec![0],
            ..Mesh::default()
        };
        // Present to the left of u = 1/2: three quarters of the triangle.
        let texels = vec![[255; 4], [255, 255, 255, 0]];
        let texture =
            Texture { name: "cut".into(), width: 2, height: 1, pixels: Pixels::Srgb8(texels), wrap: Wrap::Repeat };
        let emitter = Material {
            emission: Colour::plain(Vec3::ONE),
            coverage: Some(Coverage::mask(0, 3, 0.5)),
            ..Material::diffuse("lamp", Vec3::ZERO)
        };
        let scene = Scene {
            meshes: vec![mesh.into()],
            objects: vec![Object::fixed("lamp", 0)],
            materials: vec![emitter],
            textures: vec![texture.into()],
            ..Scene::default()
        };
        let emitters = Emitters::new(&scene, Vec3::ZERO, 1.0);
        let n = 10_000;
        let flux: f32 = (0..n)
            .map(|i| {
                let u = std::array::from_fn(|d| (crate::sample::mix(4 * i + d as u32) >> 8) as f32 / 16_777_216.0);
                let vpl = emitters.sample(&scene, u).expect("something shines");
                assert_eq!(vpl.strength == Vec3::ZERO, vpl.position.x > 0.5, "at {}", vpl.position);
                vpl.flux().x / n as f32
            })
            .sum();
        assert!((flux / (PI * 0.375) - 1.0).abs() < 0.03, "{flux}");
    }
}
