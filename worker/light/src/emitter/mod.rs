//! Everything that shines, and how to pick points on it by importance (IGI-12).
//!
//! Sources are triangles, lights, suns and the sky; an *emitter* is all triangles of one object and material together, or one of
//! the others. First an emitter is chosen, by a [`Choice`] that depends on who asks; then one of its sources in proportion
//! to power. Cumulative tables, searched by bisection: a million sources cost twenty steps, and inversion keeps the strata
//! of the quasi-random numbers.
//!
//! By power alone, mixed with an equal share for all so that a dim emitter beside a huge one is never starved
//! (algorithms.md E22), goes [`Emitters::by_power`]: it knows nothing of what light meets. [`crate::importance`] starts
//! from it, and from then on goes by what light brings.

mod afar;

use std::collections::BTreeMap;
use std::f32::consts::PI;
use std::ops::Range;
use std::sync::Arc;

use glam::Vec3;
use scenes::{Light, LightGroup, Material, Mesh, Place, Rgb, Scene};

use crate::aims::{Choice, Part};
use crate::luminaire::{Luminaire, Web};
use crate::sky::Sky;
use crate::sun::Sun;
use crate::vpl::{Shape, Vpl};
use crate::warp;

/// The lights of a scene.
#[derive(Clone, Debug, Default)]
pub struct Emitters {
    /// Those of an emitter stand together.
    sources: Vec<Source>,
    /// Cumulative probabilities of the sources of each emitter, the last one 1.
    within: Vec<f64>,
    emitters: Vec<Emitter>,
    sky: Option<Sky>,
    /// Photometric webs by their textures.
    webs: BTreeMap<u32, Arc<Web>>,
    /// Numbers of sources that are suns with a disc.
    suns: Vec<u32>,
}

/// Sources that are chosen together.
#[derive(Clone, Copy, Debug)]
struct Emitter {
    /// Number of its first source.
    first: usize,
    power: Power,
    /// About where it is; means nothing of what is afar.
    place: Vec3,
}

/// How much an emitter sends, mean of the channels.
#[derive(Clone, Copy, Debug)]
enum Power {
    /// W.
    Here(f64),
    /// From afar, through each unit of area across its way: W·m⁻².
    Across(f64),
}

#[derive(Clone, Copy, Debug)]
enum Source {
    Triangle { corner: Vec3, ab: Vec3, ac: Vec3, area: f32, object: u32, triangle: u32, material: u32 },
    Light(u32),
    Sun { light: u32, disc: Sun },
    Sky,
}

/// Share of [`Emitters::by_power`] that goes by power; the rest goes to all emitters alike.
const POWER_SHARE: f64 = 0.75;

impl Emitters {
    /// Finds all lights of the visible objects.
    pub fn new(scene: &Scene) -> Self {
        let sky = Sky::new(scene);
        let mut found = BTreeMap::<(u32, u32), Vec<(Source, f64)>>::new();
        for (object_index, object) in scene.objects.iter().enumerate().filter(|(_, o)| o.visible) {
            let mesh = &scene.meshes[object.mesh as usize];
            for triangle in scene.triangles(object_index) {
                let (corners, number) = (mesh.triangles[triangle], scene.material_of(object_index, triangle));
                let material = &scene.materials[number as usize];
                if material.emission.is_black() {
                    continue;
                }
                let [a, b, c] = corners.map(|v| object.scene_from_object.point(mesh.positions[v as usize]));
                let (ab, ac) = (b - a, c - a);
                let area = ab.cross(ac).length() * 0.5;
                let sides = if material.emits_both_sides { 2.0 } else { 1.0 };
                let power = mean(average(scene, mesh, triangle, material)) * area * PI * sides;
                if power > 0.0 && power.is_finite() {
                    let (object, triangle) = (object_index as u32, triangle as u32);
                    let source = Source::Triangle { corner: a, ab, ac, area, object, triangle, material: number };
                    found.entry((object, number)).or_default().push((source, f64::from(power)));
                }
            }
        }
        let webs = scene.lights.iter().filter_map(|light| match light {
            Light::Luminaire { solid, .. } => Some((*solid, Arc::new(Web::new(&scene.textures[*solid as usize])))),
            _ => None,
        });
        let mut all = Self { sky, webs: webs.collect(), ..Self::default() };
        for sources in found.into_values() {
            all.add_triangles(&sources);
        }
        for (index, light) in (0..).zip(&scene.lights) {
            let (power, place) = match light {
                Light::Point { position, .. } | Light::Spot { position, .. } | Light::Luminaire { position, .. } => {
                    (Power::Here(f64::from(mean(all.point_light(light).flux()))), *position)
                }
                Light::Directional { irradiance, .. } => (Power::Across(f64::from(mean(*irradiance))), Vec3::ZERO),
            };
            let source = match Sun::of(light) {
                Some(disc) => Source::Sun { light: index, disc },
                None => Source::Light(index),
            };
            all.add(source, power, place);
        }
        if let Some(power) = all.sky.as_ref().map(Sky::power) {
            all.add(Source::Sky, Power::Across(f64::from(power)), Vec3::ZERO);
        }
        all
    }

    fn add_triangles(&mut self, sources: &[(Source, f64)]) {
        let power: f64 = sources.iter().map(|(_, power)| power).sum();
        let (mut low, mut high) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
        let first = self.sources.len();
        let mut sum = 0.0;
        for (source, share) in sources {
            if let Source::Triangle { corner, ab, ac, .. } = *source {
                for corner in [corner, corner + ab, corner + ac] {
                    (low, high) = (low.min(corner), high.max(corner));
                }
            }
            sum += share;
            self.sources.push(*source);
            self.within.push(sum / power);
        }
        self.emitters.push(Emitter { first, power: Power::Here(power), place: (low + high) * 0.5 });
    }

    fn add(&mut self, source: Source, power: Power, place: Vec3) {
        let (Power::Here(watts) | Power::Across(watts)) = power;
        if watts > 0.0 && watts.is_finite() {
            let number = self.sources.len();
            if let Source::Sun { .. } = source {
                self.suns.push(number as u32);
            }
            self.emitters.push(Emitter { first: number, power, place });
            self.sources.push(source);
            self.within.push(1.0);
        }
    }

    /// By power, mixed with an equal share for each emitter. What comes from afar counts as much as passes a disc of so
    /// great a radius.
    pub fn by_power(&self, radius: f32) -> Choice {
        let disc = f64::from(PI * radius * radius);
        let powers: Vec<f64> = self
            .emitters
            .iter()
            .map(|emitter| match emitter.power {
                Power::Here(watts) => watts,
                Power::Across(irradiance) => irradiance * disc,
            })
            .collect();
        let (total, count) = (powers.iter().sum::<f64>(), powers.len() as f64);
        let share = |power: &f64| POWER_SHARE * power / total + (1.0 - POWER_SHARE) / count;
        Choice::new(&powers.iter().map(share).collect::<Vec<_>>())
    }

    /// How many emitters there are.
    pub fn count(&self) -> usize {
        self.emitters.len()
    }

    /// The emitter that a source belongs to.
    pub fn emitter_of(&self, source: u32) -> usize {
        self.emitters.partition_point(|emitter| emitter.first <= source as usize).saturating_sub(1)
    }

    /// About where an emitter is; `None` if afar.
    pub fn place(&self, emitter: usize) -> Option<Vec3> {
        let emitter = &self.emitters[emitter];
        matches!(emitter.power, Power::Here(_)).then_some(emitter.place)
    }

    /// Bytes that the tables take.
    pub fn bytes(&self) -> usize {
        let sky = self.sky.as_ref().map_or(0, Sky::bytes);
        let webs: usize = self.webs.values().map(|web| web.bytes()).sum();
        size_of_val(&self.sources[..]) + size_of_val(&self.within[..]) + size_of_val(&self.emitters[..]) + sky + webs
    }

    /// Nothing shines.
    pub fn is_empty(&self) -> bool {
        self.sources.is_empty()
    }

    /// Some light has no surface, so that no ray can meet it.
    pub fn any_bodiless(&self) -> bool {
        // Triangles come first.
        let mut others = self.sources.iter().rev().take_while(|source| !matches!(source, Source::Triangle { .. }));
        others.any(|source| matches!(source, Source::Light(_)))
    }

    /// Number of sources: emissive triangles, lights and sky.
    pub fn len(&self) -> usize {
        self.sources.len()
    }

    /// Object and triangle of a source that is an emitter's ([`Vpl::source`]).
    pub fn triangle(&self, source: u32) -> Option<[u32; 2]> {
        match self.sources.get(source as usize)? {
            Source::Triangle { object, triangle, .. } => Some([*object, *triangle]),
            Source::Light(_) | Source::Sun { .. } | Source::Sky => None,
        }
    }

    /// The light group of each source.
    pub fn groups(&self, scene: &Scene) -> Vec<LightGroup> {
        let group = |source: &Source| match *source {
            Source::Triangle { object, triangle, .. } => LightGroup::of_triangle(scene, object, triangle),
            Source::Light(light) | Source::Sun { light, .. } => LightGroup::Light(light),
            Source::Sky => LightGroup::Environment,
        };
        self.sources.iter().map(group).collect()
    }

    /// A point on a light as a virtual light of depth 0, its strength divided by its density: that of the whole choice,
    /// whichever part of it is taken.
    ///
    /// `u` = choice, two coordinates, a spare. `None` if nothing shines.
    pub fn sample(&self, scene: &Scene, choice: &Choice, part: Part, u: [f32; 4]) -> Option<Vpl> {
        let sampled = self.sample_with_density(scene, choice, part, u);
        sampled.map(|(light, density)| Vpl { density, ..light })
    }

    /// As [`Self::sample`]; and the density of the point (on one side of an emitter, per unit area) or of the direction
    /// (of the sky and of suns, sr⁻¹). `None` for lights that no ray can meet.
    pub fn sample_with_density(
        &self,
        scene: &Scene,
        choice: &Choice,
        part: Part,
        u: [f32; 4],
    ) -> Option<(Vpl, Option<f32>)> {
        // 24 bits are too coarse to choose among a million: the spare supplies 24 more.
        let fine = f64::from(u[0]) + f64::from(u[3]) * (1.0 / 16_777_216.0);
        let (emitter, rest) = choice.choose(part, fine)?;
        let sources = self.sources_of(emitter);
        let within = &self.within[sources.clone()];
        let index = sources.start + within.partition_point(|sum| *sum <= rest).min(within.len() - 1);
        let probability = self.probability(choice, index);
        let scale = (1.0 / probability) as f32;
        Some(match self.sources[index] {
            Source::Triangle { corner, ab, ac, area, object, triangle, material } => {
                let [b, c] = warp::triangle([u[1], u[2]]);
                let object = &scene.objects[object as usize];
                let mesh = &scene.meshes[object.mesh as usize];
                let material = &scene.materials[material as usize];
                let radiance = emitted(scene, mesh, triangle as usize, material, [b, c]);
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
                (emitter, Some(density_on(probability, area, material)))
            }
            Source::Light(light) => {
                let light = &scene.lights[light as usize];
                let vpl = match light {
                    Light::Directional { direction, irradiance, .. } => distant(-*direction, *irradiance, 0),
                    Light::Point { .. } | Light::Spot { .. } | Light::Luminaire { .. } => self.point_light(light),
                };
                (Vpl { strength: vpl.strength * scale, source: index as u32, ..vpl }, None)
            }
            Source::Sun { disc, .. } => {
                let (towards, density) = (disc.sample([u[1], u[2]]), disc.density());
                let strength = disc.radiance() * (scale / density);
                (distant(towards, strength, index as u32), Some(probability as f32 * density))
            }
            Source::Sky => {
                let sky = self.sky.as_ref()?;
                let (towards, density) = sky.sample(scene, [u[1], u[2], u[3]]);
                let strength = sky.radiance(scene, towards) * (scale / density);
                (distant(towards, strength, index as u32), Some(probability as f32 * density))
            }
        })
    }

    /// The density that [`Self::sample_with_density`] tells of points on one side of an emitter's triangle; 0 if it chooses
    /// none there.
    pub fn density(&self, scene: &Scene, choice: &Choice, object: u32, triangle: u32) -> f32 {
        let material = scene.material_of(object as usize, triangle as usize);
        // Triangles come first and in this order.
        let number = |source: &Source| match source {
            Source::Triangle { object, triangle, material, .. } => (*object, *material, *triangle),
            Source::Light(_) | Source::Sun { .. } | Source::Sky => (u32::MAX, u32::MAX, u32::MAX),
        };
        match self.sources.binary_search_by_key(&(object, material, triangle), number).map(|i| (i, self.sources[i])) {
            Ok((index, Source::Triangle { area, .. })) => {
                density_on(self.probability(choice, index), area, &scene.materials[material as usize])
            }
            _ => 0.0,
        }
    }

    /// A light that lies at a point.
    fn point_light(&self, light: &Light) -> Vpl {
        let (position, strength, shape) = match *light {
            Light::Spot { position, direction, intensity, cos_inner, cos_outer } => {
                (position, intensity, Shape::Spot { axis: direction, cos_inner, cos_outer })
            }
            Light::Luminaire { position, direction, side, intensity, solid } => {
                let lamp = Luminaire::new(Arc::clone(&self.webs[&solid]), direction, side);
                (position, intensity, Shape::Luminaire(lamp))
            }
            Light::Point { position, intensity } => (position, intensity, Shape::Point),
            Light::Directional { .. } => (Vec3::ZERO, Vec3::ZERO, Shape::Distant),
        };
        Vpl { position, normal: Vec3::ZERO, strength, shape, depth: 0, source: 0, density: None }
    }

    fn sources_of(&self, emitter: usize) -> Range<usize> {
        let end = self.emitters.get(emitter + 1).map_or(self.sources.len(), |next| next.first);
        self.emitters[emitter].first..end
    }

    fn probability(&self, choice: &Choice, source: usize) -> f64 {
        let emitter = self.emitter_of(source as u32);
        let before = if source > self.emitters[emitter].first { self.within[source - 1] } else { 0.0 };
        choice.probability(emitter) * (self.within[source] - before)
    }
}

/// Of points on one side of a triangle that is chosen so often.
fn density_on(probability: f64, area: f32, material: &Material) -> f32 {
    let sides = if material.emits_both_sides { 2.0 } else { 1.0 };
    probability as f32 / (area * sides)
}

/// Light from afar, in parallel rays.
fn distant(towards: Vec3, strength: Rgb, source: u32) -> Vpl {
    let (position, shape) = (Vec3::ZERO, Shape::Distant);
    Vpl { position, normal: towards, strength, shape, depth: 0, source, density: None }
}

/// Radiance of an emitter's surface at a place of a triangle, times how much of it is there: rays meet it as often.
fn emitted(scene: &Scene, mesh: &Mesh, triangle: usize, material: &Material, [b, c]: [f32; 2]) -> Rgb {
    let place = Place { mesh, triangle, weights: [1.0 - b - c, b, c] };
    let whole = material.emission.value * place.colour(scene, material.emission.texture);
    match &material.coverage {
        None => whole,
        Some(coverage) => whole * place.present(scene, coverage),
    }
}

/// Mean emission over a triangle: by 36 look-ups where it varies; only the choice depends on it.
fn average(scene: &Scene, mesh: &Mesh, triangle: usize, material: &Material) -> Rgb {
    let emission = material.emission;
    if emission.texture.is_none() && material.coverage.is_none() {
        return emission.value;
    }
    let mut sum = Vec3::ZERO;
    for i in 0..36 {
        let place = warp::triangle([((i % 6) as f32 + 0.5) / 6.0, ((i / 6) as f32 + 0.5) / 6.0]);
        sum += emitted(scene, mesh, triangle, material, place);
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
    use scenes::{Colour, Coverage, Environment, LookUp, Mesh, Object, Pixels, Texture};

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
        let emitters = Emitters::new(&scene);
        let choice = emitters.by_power(2.0);
        assert_eq!((emitters.len(), emitters.count()), (4, 4));
        assert_eq!([0, 1, 2, 3].map(|emitter| emitters.place(emitter).is_some()), [true, true, true, false]);
        let n = 100_000_u32;
        let mut counts = [0.0_f64; 4];
        let mut flux = Vec3::ZERO;
        for i in 0..n {
            let u = std::array::from_fn(|d| (crate::sample::mix(4 * i + d as u32) >> 8) as f32 / 16_777_216.0);
            let (vpl, density) = emitters.sample_with_density(&scene, &choice, Part::Any, u).expect("something shines");
            let source = match vpl.shape {
                Shape::Surface => usize::from(vpl.position.z > 0.5),
                Shape::Point => 2,
                _ => 3,
            };
            let found = match source {
                0 | 1 => Some(emitters.density(&scene, &choice, 0, source as u32)),
                2 => None,
                _ => Some(emitters.density_of_sky(&scene, &choice, vpl.normal)),
            };
            assert_eq!(density, found, "source {source}");
            counts[source] += 1.0;
            flux += vpl.flux() / n as f32;
        }
        let x2: f64 = (0..4)
            .map(|i| {
                let expected = choice.probability(i) * f64::from(n);
                (counts[i] - expected).powi(2) / expected
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
        let emitters = Emitters::new(&scene);
        assert!(emitters.by_power(2.0).probability(0) > 0.05);
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
            Texture { name: "cut".into(), width: 2, height: 1, pixels: Pixels::Srgb8(texels), look_up: LookUp::REPEAT };
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
        let emitters = Emitters::new(&scene);
        let n = 10_000;
        let flux: f32 = (0..n)
            .map(|i| {
                let u = std::array::from_fn(|d| (crate::sample::mix(4 * i + d as u32) >> 8) as f32 / 16_777_216.0);
                let vpl = emitters.sample(&scene, &emitters.by_power(1.0), Part::Any, u).expect("something shines");
                assert_eq!(vpl.strength == Vec3::ZERO, vpl.position.x > 0.5, "at {}", vpl.position);
                vpl.flux().x / n as f32
            })
            .sum();
        assert!((flux / (PI * 0.375) - 1.0).abs() < 0.03, "{flux}");
    }
}
