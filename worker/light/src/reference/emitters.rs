//! What shines, for the path tracer: one place is chosen on one source; and how likely that was, given
//! that a path has hit the source by itself (for multiple importance sampling).
//!
//! Sources are chosen by Vose's alias method, half by power and half evenly among emitters (all emissive
//! triangles of an object count as one emitter), so that none is starved however dim it is. What is afar, sky and suns,
//! has no power that could be compared with a lamp's: where there are both, either gets half.

use std::f64::consts::PI;

use glam::Vec3;
use scenes::{Environment, Light, Needs, Place, Relays, Rgb, Scene};

use super::luminaire;
use super::philox::Stream;
use super::sky::Sky;
use super::sun::Disc;
use crate::surface::Surfel;

/// All sources of a scene.
#[derive(Default)]
pub struct Emitters {
    sources: Vec<Source>,
    /// How likely each source is to be chosen.
    probability: Vec<f64>,
    alias: Alias,
    sky: Option<Sky>,
    /// Suns, each with its number among the sources.
    suns: Vec<(usize, Disc)>,
    /// What relays the light of lamps without surface.
    relays: Relays,
}

enum Source {
    /// An emissive triangle. They come first, in the order of objects and triangles.
    Triangle(Triangle),
    /// [`Scene::lights`].
    Light(u32),
    Sky,
}

struct Triangle {
    object: u32,
    triangle: u32,
    corners: [Vec3; 3],
    /// Unit, of the side that shines.
    normal: Vec3,
    area: f32,
    material: u32,
}

/// A source that was chosen.
pub enum Chosen {
    /// A place that a path might hit.
    Place(Arrival),
    /// One of [`Scene::lights`], which is aimed at; and one over the probability of the choice.
    Bare(u32, f32),
}

/// Light that may arrive at a point, if nothing is in between.
pub struct Arrival {
    /// Unit direction to where it comes from.
    pub direction: Vec3,
    /// Radiance over the probability of the choice and the density.
    pub weight: Rgb,
    /// Where it comes from; `None`: from afar.
    pub origin: Option<Vec3>,
    /// Density of `direction`, sr⁻¹.
    pub density: f32,
}

impl Emitters {
    /// Finds them.
    pub fn new(scene: &Scene) -> Self {
        let mut sources = Vec::new();
        let mut powers = Vec::new();
        let mut emitters: Vec<usize> = Vec::new();
        for (number, _) in scene.objects.iter().enumerate().filter(|(_, object)| object.visible) {
            let emitter = emitters.last().map_or(0, |last| last + 1);
            for triangle in scene.triangles(number) {
                let Some(found) = Triangle::find(scene, number, triangle) else { continue };
                let power = found.power(scene);
                if power <= 0.0 {
                    continue;
                }
                powers.push(power);
                emitters.push(emitter);
                sources.push(Source::Triangle(found));
            }
        }
        let mut add = |source, power: f64| {
            if power > 0.0 {
                sources.push(source);
                powers.push(power);
                emitters.push(emitters.last().map_or(0, |last| last + 1));
            }
        };
        for (number, light) in (0..).zip(&scene.lights) {
            add(Source::Light(number), power_of(scene, light));
        }
        let sky = match scene.environment {
            Environment::Black => None,
            _ => Some(Sky::new(scene)).filter(|sky| sky.integral() > 0.0),
        };
        if let Some(sky) = &sky {
            add(Source::Sky, sky.integral());
        }
        let is_afar: Vec<bool> = sources.iter().map(|source| source.is_afar(scene)).collect();
        let mut probability = shares(&powers, &emitters, |source| is_afar[source]);
        let here = shares(&powers, &emitters, |source| !is_afar[source]);
        probability.iter_mut().zip(here).for_each(|(share, here)| *share += here);
        let both = probability.iter().sum::<f64>();
        probability.iter_mut().for_each(|share| *share /= both);
        let alias = Alias::new(&probability);
        let relays = Relays::of(scene, &Needs::of(scene));
        let sun = |(number, source): (usize, &Source)| match source {
            Source::Light(light) => Some((number, Disc::of(&scene.lights[*light as usize])?)),
            Source::Triangle(_) | Source::Sky => None,
        };
        let suns = sources.iter().enumerate().filter_map(sun).collect();
        Self { sources, probability, alias, sky, suns, relays }
    }

    /// Mirrors and panes that relay the light of lamps without surface.
    pub fn relays(&self) -> &Relays {
        &self.relays
    }

    /// One random place that light may come from, towards a point.
    pub fn sample(&self, scene: &Scene, from: &Surfel, stream: &mut Stream) -> Option<Chosen> {
        let chosen = self.alias.choose(stream)?;
        let scale = (1.0 / self.probability[chosen]) as f32;
        match &self.sources[chosen] {
            Source::Triangle(triangle) => {
                let arrival = triangle.sample(scene, from.position, stream.pair())?;
                let density = arrival.density / scale;
                Some(Chosen::Place(Arrival { weight: arrival.weight * scale, density, ..arrival }))
            }
            Source::Light(number) => Some(Chosen::Bare(*number, scale)),
            Source::Sky => {
                let sky = self.sky.as_ref()?;
                let (direction, density) = sky.sample(stream);
                let weight = sky.radiance(scene, direction) * (scale / density);
                Some(Chosen::Place(Arrival { direction, weight, origin: None, density: density / scale }))
            }
        }
    }

    /// Some sun has a disc, which a path can hit.
    pub fn any_suns(&self) -> bool {
        !self.suns.is_empty()
    }

    /// What is seen of each sun in a direction, and the density with which [`Self::sample`] looks that way.
    pub fn suns(&self, direction: Vec3) -> impl Iterator<Item = (Rgb, f32)> {
        let seen = move |(number, disc): &(usize, Disc)| {
            (disc.radiance(direction), self.probability[*number] as f32 * disc.density())
        };
        self.suns.iter().map(seen)
    }

    /// Radiance of the sky, and the density with which [`Self::sample`] looks that way.
    pub fn sky(&self, scene: &Scene, direction: Vec3) -> (Rgb, f32) {
        let Some(sky) = &self.sky else { return (Vec3::ZERO, 0.0) };
        let share = self.probability.last().copied().unwrap_or(0.0);
        (sky.radiance(scene, direction), sky.density(direction) * share as f32)
    }

    /// The density with which [`Self::sample`] would have looked from a point to a place on a triangle; 0 if that does
    /// not shine.
    pub fn density(&self, object: u32, triangle: u32, from: Vec3, to: Vec3) -> f32 {
        let key = |source: &Source| match source {
            Source::Triangle(t) => (t.object, t.triangle),
            Source::Light(_) | Source::Sky => (u32::MAX, u32::MAX),
        };
        let Ok(found) = self.sources.binary_search_by_key(&(object, triangle), key) else { return 0.0 };
        let Source::Triangle(triangle) = &self.sources[found] else { return 0.0 };
        triangle.density(to - from) * self.probability[found] as f32
    }
}

impl Source {
    fn is_afar(&self, scene: &Scene) -> bool {
        match self {
            Self::Triangle(_) => false,
            Self::Light(number) => matches!(scene.lights[*number as usize], Light::Directional { .. }),
            Self::Sky => true,
        }
    }
}

impl Triangle {
    /// `None` unless it shines.
    fn find(scene: &Scene, number: usize, triangle: usize) -> Option<Self> {
        let object = &scene.objects[number];
        let mesh = &scene.meshes[object.mesh as usize];
        let material = scene.material_of(number, triangle);
        if scene.materials[material as usize].emission.is_black() {
            return None;
        }
        let vertices = mesh.triangles[triangle].map(|vertex| vertex as usize);
        let corners = vertices.map(|vertex| object.scene_from_object.point(mesh.positions[vertex]));
        let cross = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
        let flip = if object.scene_from_object.linear.determinant() < 0.0 { -1.0 } else { 1.0 };
        let area = cross.length() * 0.5;
        let normal = cross.normalize_or_zero() * flip;
        let (object, triangle) = (number as u32, triangle as u32);
        (area > 0.0).then_some(Self { object, triangle, corners, normal, area, material })
    }

    fn power(&self, scene: &Scene) -> f64 {
        let material = &scene.materials[self.material as usize];
        let sides = if material.emits_both_sides { 2.0 } else { 1.0 };
        brightness(material.emission.value) * f64::from(self.area) * PI * sides
    }

    fn sample(&self, scene: &Scene, from: Vec3, u: [f32; 2]) -> Option<Arrival> {
        // Square roots make the density even (Turk 1990).
        let root = u[0].sqrt();
        let weights = [1.0 - root, root * (1.0 - u[1]), root * u[1]];
        let mix = |[a, b, c]: [Vec3; 3]| a * weights[0] + b * weights[1] + c * weights[2];
        let place = mix(self.corners);
        let material = &scene.materials[self.material as usize];
        let mesh = &scene.meshes[scene.objects[self.object as usize].mesh as usize];
        let on = Place { mesh, triangle: self.triangle as usize, weights };
        let towards = place - from;
        let density = self.density(towards);
        let side = -self.normal.dot(towards);
        let dark = density <= 0.0 || !density.is_finite() || (side < 0.0 && !material.emits_both_sides);
        let there = material.coverage.map_or(1.0, |coverage| on.present(scene, &coverage));
        if dark || there == 0.0 {
            return None;
        }
        let radiance = material.emission.value * on.colour(scene, material.emission.texture);
        // The shadow ray ends just before the triangle: as far as its coordinates are uncertain.
        let reach = self.corners.iter().fold(0.0, |most: f32, corner| most.max(corner.abs().max_element()));
        let off = self.normal * (reach * (1.0 / 524_288.0) * side.signum());
        Some(Arrival {
            direction: towards.normalize(),
            weight: radiance * (there / density),
            origin: Some(place + off),
            density,
        })
    }

    /// Density of a direction to a place on it, of any length, for points chosen evenly on it.
    fn density(&self, towards: Vec3) -> f32 {
        let distance2 = towards.length_squared();
        let cos = self.normal.dot(towards).abs() / distance2.sqrt();
        distance2 / (cos * self.area)
    }
}

/// Mean of the channels: only choices depend on it.
pub(super) fn brightness(rgb: Rgb) -> f64 {
    let rgb = rgb.as_dvec3();
    (rgb.x + rgb.y + rgb.z) / 3.0
}

/// W; of what is afar W·m⁻².
fn power_of(scene: &Scene, light: &Light) -> f64 {
    match light {
        Light::Point { intensity, .. } => brightness(*intensity) * 4.0 * PI,
        // Between the two angles it is about half as bright.
        Light::Spot { intensity, cos_inner, cos_outer, .. } => {
            brightness(*intensity) * PI * f64::from(2.0 - cos_inner - cos_outer)
        }
        Light::Luminaire { intensity, solid, .. } => {
            brightness(*intensity) * luminaire::solid_angle(&scene.textures[*solid as usize])
        }
        Light::Directional { irradiance, .. } => brightness(*irradiance),
    }
}

/// Probabilities of the sources that belong; 0 of all others. Half by power, half evenly among emitters and within an
/// emitter by power.
fn shares(powers: &[f64], emitters: &[usize], belongs: impl Fn(usize) -> bool) -> Vec<f64> {
    let power = |source: usize| if belongs(source) { powers[source] } else { 0.0 };
    let total: f64 = (0..powers.len()).map(power).sum();
    let mut of_emitter = vec![0.0; emitters.last().map_or(0, |last| last + 1)];
    for (source, emitter) in emitters.iter().enumerate() {
        of_emitter[*emitter] += power(source);
    }
    let count = of_emitter.iter().filter(|power| **power > 0.0).count() as f64;
    let share = |(source, emitter): (usize, &usize)| match power(source) {
        0.0 => 0.0,
        power => 0.5 * power / total + 0.5 * power / of_emitter[*emitter] / count,
    };
    emitters.iter().enumerate().map(share).collect()
}

/// Vose's alias method: one column is chosen evenly, then one of the two outcomes in it.
#[derive(Default)]
pub(super) struct Alias {
    columns: Vec<(f64, u32)>,
}

impl Alias {
    pub(super) fn new(probability: &[f64]) -> Self {
        let n = probability.len();
        let mut columns: Vec<_> = (0..n as u32).zip(probability).map(|(i, p)| (p * n as f64, i)).collect();
        let (mut poor, mut rich): (Vec<_>, Vec<_>) = (0..n).partition(|i| columns[*i].0 < 1.0);
        while let (Some(small), Some(large)) = (poor.pop(), rich.last().copied()) {
            columns[small].1 = large as u32;
            columns[large].0 -= 1.0 - columns[small].0;
            if columns[large].0 < 1.0 {
                poor.extend(rich.pop());
            }
        }
        Self { columns }
    }

    pub(super) fn choose(&self, stream: &mut Stream) -> Option<usize> {
        if self.columns.is_empty() {
            return None;
        }
        let column = (u64::from(stream.bits()) * self.columns.len() as u64) >> 32;
        let (keep, other) = self.columns[column as usize];
        let stay = f64::from(stream.bits()) * (1.0 / 4_294_967_296.0) < keep;
        Some(if stay { column as usize } else { other as usize })
    }
}
