//! Light's own way: quasi-random walks from the lights that leave virtual lights (IGI-2); and what else
//! belongs to a light set, as its photons ([`crate::caustics`]).
//!
//! # Partition of paths (B6)
//! Light reaches a diffuse point x from its previous non-specular vertex y
//! * directly: virtual lights carry it, on emitters and on surfaces alike;
//! * through mirrors and glass, y on an emitter: caustic photons and the gather ray share it ([`crate::caustics`]), and where
//!   glass alone is passed light samples as well ([`crate::through_glass`]);
//! * through mirrors and glass, y on a surface: the gather ray finds it ([`crate::bias_compensation`]).
//!
//! What the eye sees of emitters, directly or through mirrors and glass, is emission. So every path is
//! counted once. (B6 proposes photons for the third kind as well; but light off a wall is spread so
//! wide that photons of it are few and far between, while a ray that meets glass finds it with ease.)

use glam::Vec3;
use protocol::question::Quality;
use scenes::Rgb;

use crate::bvh::{Ray, ShaftScratch};
use crate::caustics::{self, Sharing};
use crate::glossy::Glossy;
use crate::importance::Importance;
use crate::photons::PhotonMap;
use crate::prepared::Prepared;
use crate::sample::Sequence;
use crate::surface::{Carries, Scatter, Surfel};
use crate::vpl::{Shape, Vpl};
use crate::warp;

/// The light set with id k: all that its pixels need to know of light.
#[derive(Clone, Debug, Default)]
pub struct LightSet {
    /// Points on lights first, then points on surfaces.
    pub vpls: Vec<Vpl>,
    /// Caustics; empty where a scene can have none.
    pub photons: PhotonMap,
    /// What they count beside rays that find the same light.
    pub sharing: Sharing,
    /// Segments traced to make the set.
    pub rays: u64,
}

/// Which set is meant, in the numbers of its sequence.
#[derive(Clone, Copy, Debug)]
pub struct SetAddress {
    /// Index of the set among all that one replicate ever makes: epoch · sets + k.
    pub block: u32,
    /// Photon radius, scene units.
    pub radius: f32,
}

/// Sequences of the three stages.
#[derive(Clone, Copy, Debug)]
pub struct Sequences {
    /// Points on lights.
    pub lights: Sequence,
    /// Light paths.
    pub walk: Sequence,
    /// Photon paths.
    pub photons: Sequence,
}

/// Walks longer than this end whatever they carry: with continuation at most 0.999 this has
/// probability e⁻⁶⁵, so it only guards against mirrors of reflectance 1 that face each other.
const LONGEST: u32 = 65_536;

/// Group of the number that says where systematic thinning begins; no walk is so long.
const PHASE: u32 = u32::MAX;

/// Dimensions of one vertex of a walk: a group for the way on, one for choices.
const GROUPS_PER_VERTEX: u32 = 2;

impl LightSet {
    /// Makes a set from scratch: a pure function of its arguments.
    pub fn trace(
        prepared: &Prepared,
        importance: &Importance,
        quality: &Quality,
        sequences: &Sequences,
        at: SetAddress,
    ) -> Self {
        let mut set = Self { sharing: Sharing::new(quality, at.radius), ..Self::default() };
        if prepared.emitters.is_empty() && prepared.may_skip() {
            return set;
        }
        set.sample_lights(prepared, importance, &sequences.lights, at.block);
        if prepared.needs.diffuse > 0 && quality.max_length != Some(0) {
            set.walk(prepared, importance, quality.max_length, &sequences.walk, at.block);
        }
        if quality.photons > 0 && prepared.needs.caustics() {
            let (photons, rays) = caustics::shoot(prepared, quality, &sequences.photons, at.block, at.radius);
            set.photons = photons;
            set.rays += rays;
        }
        set
    }

    fn sample_lights(&mut self, prepared: &Prepared, importance: &Importance, sequence: &Sequence, block: u32) {
        let plan = importance.emitters;
        let mut scratch = ShaftScratch::default();
        let mut phase = sequence.point(PHASE, block)[0];
        for i in 0..plan.candidates {
            let index = block.wrapping_mul(plan.candidates).wrapping_add(i);
            if let Some(emitter) = prepared.emitters.sample(&prepared.scene, sequence.point(0, index)) {
                let p = plan.probability(importance.brings(prepared, &emitter, &mut scratch, &mut self.rays));
                self.keep(emitter, p, &mut phase, plan.candidates);
            }
        }
    }

    fn walk(
        &mut self,
        prepared: &Prepared,
        importance: &Importance,
        max_length: Option<u8>,
        sequence: &Sequence,
        block: u32,
    ) {
        let plan = importance.walks;
        let mut scratch = ShaftScratch::default();
        let mut phase = sequence.point(PHASE, block)[0];
        for i in 0..plan.candidates {
            let index = block.wrapping_mul(plan.candidates).wrapping_add(i);
            let mut path = LightPath::start(prepared, sequence, index);
            while let Some(vpl) = path.next_vpl(prepared, max_length) {
                let p = plan.probability(importance.brings(prepared, &vpl, &mut scratch, &mut self.rays));
                self.keep(vpl, p, &mut phase, plan.candidates);
            }
            self.rays += path.rays;
        }
    }

    /// Keeps a light with probability p and lets it stand for all that are dropped. Systematic: kept
    /// lights are spread evenly over the candidates, which keeps the strata of their sequence.
    fn keep(&mut self, mut vpl: Vpl, p: f32, phase: &mut f32, candidates: u32) {
        *phase += p;
        if *phase >= 1.0 {
            *phase -= 1.0;
            vpl.strength /= candidates as f32 * p;
            self.vpls.push(vpl);
        }
    }
}

/// A light path on its way: flux travels along `ray`.
pub struct LightPath<'a> {
    sequence: &'a Sequence,
    index: u32,
    vertex: u32,
    depth: u16,
    ray: Option<(Vec3, Vec3)>,
    flux: Rgb,
    /// See [`Vpl::source`].
    source: u32,
    /// Segments traced so far.
    pub rays: u64,
}

impl<'a> LightPath<'a> {
    /// Leaves a light in a direction of its own.
    pub fn start(prepared: &Prepared, sequence: &'a Sequence, index: u32) -> Self {
        let mut path = Self { sequence, index, vertex: 0, depth: 0, ray: None, flux: Vec3::ZERO, source: 0, rays: 0 };
        let choice = sequence.point(0, index);
        let way = sequence.point(1, index);
        if let Some(light) = prepared.emitters.sample(&prepared.scene, choice) {
            let (origin, direction, flux) = leave(prepared, &light, [way[0], way[1]]);
            path.ray = Some((origin, direction));
            path.flux = flux;
            path.source = light.source;
        }
        path
    }

    /// Walks to the next diffuse vertex and stands a virtual light on it.
    pub fn next_vpl(&mut self, prepared: &Prepared, max_length: Option<u8>) -> Option<Vpl> {
        while let Some((origin, direction)) = self.ray.take() {
            self.vertex += 1;
            if self.vertex > LONGEST || self.flux == Vec3::ZERO {
                return None;
            }
            let ray = Ray { origin, direction, t_max: f32::INFINITY };
            self.rays += 1;
            let hit = prepared.world.closest(&ray)?;
            let at = prepared.surfel(&ray, &hit);
            let way = self.sequence.point(GROUPS_PER_VERTEX * self.vertex, self.index);
            let choice = self.sequence.point(GROUPS_PER_VERTEX * self.vertex + 1, self.index);
            match at.scatter(&prepared.scene) {
                Scatter::Diffuse { albedo } => {
                    self.depth += 1;
                    let vpl = self.stand(&at, direction, albedo);
                    if max_length.is_none_or(|most| self.depth < u16::from(most)) {
                        self.go_on(&at, direction, albedo, choice[0], [way[0], way[1]]);
                    }
                    return Some(vpl);
                }
                Scatter::Glossy(material) => {
                    self.depth += 1;
                    let vpl = Vpl {
                        position: at.above(),
                        normal: at.geometric,
                        strength: self.flux * slant(&at, direction),
                        shape: Shape::Glossy { material, from: -direction, shading: at.shading },
                        depth: self.depth,
                        source: self.source,
                        density: None,
                    };
                    if max_length.is_none_or(|most| self.depth < u16::from(most)) {
                        self.go_on_glossy(&at, direction, &material, choice, way);
                    }
                    return Some(vpl);
                }
                specular => {
                    if let Some(bounce) = specular.branch(&at, direction, Carries::Flux, choice[1]) {
                        self.survive(bounce.weight, choice[0], bounce.origin, bounce.direction);
                    }
                }
            }
        }
        None
    }

    fn stand(&self, at: &Surfel, incoming: Vec3, albedo: Rgb) -> Vpl {
        Vpl {
            position: at.above(),
            normal: at.geometric,
            strength: self.flux * albedo * (slant(at, incoming) * std::f32::consts::FRAC_1_PI),
            shape: Shape::Surface,
            depth: self.depth,
            source: self.source,
            density: None,
        }
    }

    /// Leaves a diffuse surface. Directions are distributed about the geometric normal: then the
    /// weight is the albedo exactly, and shading normals act on arriving light alone.
    fn go_on(&mut self, at: &Surfel, incoming: Vec3, albedo: Rgb, u: f32, way: [f32; 2]) {
        self.flux *= slant(at, incoming);
        self.survive(albedo, u, at.above(), warp::cosine(at.geometric, way));
    }

    /// Leaves a glossy surface by its base or its lobe. A sharp lobe leads on like a mirror.
    fn go_on_glossy(&mut self, at: &Surfel, incoming: Vec3, material: &Glossy, choice: [f32; 4], way: [f32; 4]) {
        let to = -incoming;
        self.flux *= slant(at, incoming);
        let cos = at.shading.dot(to);
        let lobe = material.lobe_albedo(cos).max_element();
        let base = material.base(cos, 1.0).max_element() * std::f32::consts::PI;
        let p = lobe / (lobe + base).max(1e-9);
        if choice[1] < p {
            if let Some((direction, weight)) = material.sample(at.shading, to, [way[2], way[3]]) {
                let side = at.geometric.dot(direction) / at.shading.dot(direction).max(1e-4);
                if side > 0.0 {
                    self.survive(weight * (side / p), choice[0], at.off(direction), direction);
                }
            }
        } else {
            let direction = warp::cosine(at.geometric, [way[0], way[1]]);
            let weight = material.base(cos, at.shading.dot(direction).max(0.0)) * std::f32::consts::PI;
            self.survive(weight / (1.0 - p), choice[0], at.above(), direction);
        }
    }

    /// Russian roulette by what is left: keeps the flux of surviving paths about constant.
    fn survive(&mut self, weight: Rgb, u: f32, origin: Vec3, direction: Vec3) {
        let q = weight.max_element().clamp(0.0, 1.0);
        if u < q {
            self.flux *= weight / q;
            self.ray = Some((origin, direction));
        }
    }
}

/// |cosθ_shading| / |cosθ_geometric| of arriving light: the correction of the adjoint for
/// interpolated normals (Veach 1996).
pub(crate) fn slant(at: &Surfel, incoming: Vec3) -> f32 {
    let geometric = at.geometric.dot(incoming).abs();
    let shading = at.shading.dot(incoming).abs();
    if at.shading == at.geometric { 1.0 } else { shading / geometric.max(1e-4) }
}

/// Origin, unit direction and flux of light that leaves a light in a direction of its own.
fn leave(prepared: &Prepared, light: &Vpl, u: [f32; 2]) -> (Vec3, Vec3, Rgb) {
    match light.shape {
        Shape::Surface | Shape::Glossy { .. } => (light.position, warp::cosine(light.normal, u), light.flux()),
        Shape::Point => (light.position, warp::sphere(u), light.flux()),
        Shape::Spot { axis, cos_outer, .. } => {
            let direction = warp::cone(axis, 1.0 - cos_outer, u);
            let flux = light.intensity(direction) / warp::cone_density(1.0 - cos_outer);
            (light.position, direction, flux)
        }
        Shape::Distant => {
            let (origin, area) = prepared.emitters.entry(light.normal, u);
            (origin, -light.normal, light.strength * area)
        }
    }
}
