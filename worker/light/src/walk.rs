//! Light's own way: quasi-random walks from the lights that leave virtual lights (IGI-2) and caustic
//! photons (IGI-4).
//!
//! # Partition of paths (B6)
//! Light reaches a diffuse point x from its previous non-specular vertex y
//! * directly: virtual lights carry it, on lamps and on surfaces alike;
//! * through mirrors and glass, y on a lamp: caustic photons carry it;
//! * through mirrors and glass, y on a surface: the gather ray finds it ([`crate::remainder`]).
//!
//! What the eye sees of lamps, directly or through mirrors and glass, is emission. So every path is
//! counted once. (B6 proposes photons for the third kind as well; but light off a wall is spread so
//! wide that photons of it are few and far between, while a ray that meets glass finds it with ease.)

use glam::Vec3;
use protocol::question::Quality;
use scenes::Rgb;

use crate::bvh::{Ray, ShaftScratch};
use crate::glossy::Glossy;
use crate::importance::Importance;
use crate::photons::{Photon, PhotonMap};
use crate::prepared::Prepared;
use crate::sample::Sequence;
use crate::surface::{Bounce, Carries, Scatter, Surfel};
use crate::vpl::{Shape, Vpl};
use crate::warp;

/// The light set with id k: all that its pixels need to know of light.
#[derive(Clone, Debug, Default)]
pub struct LightSet {
    /// Points on lights first, then points on surfaces.
    pub vpls: Vec<Vpl>,
    /// Caustics; empty where a scene can have none.
    pub photons: PhotonMap,
    /// Segments traced to make the set.
    pub rays: u64,
}

/// Which set is meant, in the numbers of its sequence.
#[derive(Clone, Copy, Debug)]
pub struct SetAddress {
    /// Index of the set among all that one randomisation ever makes: epoch · sets + k.
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
        let mut set = Self::default();
        if prepared.emitters.is_empty() && prepared.may_skip() {
            return set;
        }
        set.sample_lights(prepared, importance, &sequences.lights, at.block);
        if prepared.needs.diffuse > 0 && quality.max_length != Some(0) {
            set.walk(prepared, importance, quality.max_length, &sequences.walk, at.block);
        }
        if quality.photons > 0 && prepared.needs.caustics() {
            set.shoot(prepared, quality, &sequences.photons, at);
        }
        set
    }

    fn sample_lights(&mut self, prepared: &Prepared, importance: &Importance, sequence: &Sequence, block: u32) {
        let plan = importance.lamps;
        let mut scratch = ShaftScratch::default();
        let mut phase = sequence.point(PHASE, block)[0];
        for i in 0..plan.candidates {
            let index = block.wrapping_mul(plan.candidates).wrapping_add(i);
            if let Some(lamp) = prepared.emitters.sample(&prepared.scene, sequence.point(0, index)) {
                let p = plan.probability(importance.brings(prepared, &lamp, &mut scratch, &mut self.rays));
                self.keep(lamp, p, &mut phase, plan.candidates);
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

    fn shoot(&mut self, prepared: &Prepared, quality: &Quality, sequence: &Sequence, at: SetAddress) {
        let mut photons = Vec::new();
        for i in 0..quality.photons {
            let index = at.block.wrapping_mul(quality.photons).wrapping_add(i);
            let (photon, rays) = shoot_one(prepared, sequence, index);
            photons.extend(photon);
            self.rays += rays;
        }
        for photon in &mut photons {
            photon.flux /= quality.photons as f32;
        }
        self.photons = PhotonMap::new(photons, at.radius);
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
    /// Segments traced so far.
    pub rays: u64,
}

impl<'a> LightPath<'a> {
    /// Leaves a light in a direction of its own.
    pub fn start(prepared: &Prepared, sequence: &'a Sequence, index: u32) -> Self {
        let mut path = Self { sequence, index, vertex: 0, depth: 0, ray: None, flux: Vec3::ZERO, rays: 0 };
        let choice = sequence.point(0, index);
        let way = sequence.point(1, index);
        if let Some(light) = prepared.emitters.sample(&prepared.scene, choice) {
            let (origin, direction, flux) = leave(prepared, &light, [way[0], way[1]]);
            path.ray = Some((origin, direction));
            path.flux = flux;
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
fn slant(at: &Surfel, incoming: Vec3) -> f32 {
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

/// Share of photon directions that are aimed at specular objects, where any can be seen.
const AIMED: f32 = 0.85;

/// Traces one photon from a light through specular surfaces to the first diffuse one, where it stays.
fn shoot_one(prepared: &Prepared, sequence: &Sequence, index: u32) -> (Option<Photon>, u64) {
    let choice = sequence.point(0, index);
    let way = sequence.point(1, index);
    let Some(light) = prepared.emitters.sample(&prepared.scene, choice) else { return (None, 0) };
    let Some((mut origin, mut direction, mut flux)) = aim(prepared, &light, way) else { return (None, 0) };
    for vertex in 1..LONGEST {
        let ray = Ray { origin, direction, t_max: f32::INFINITY };
        let rays = u64::from(vertex);
        let Some(hit) = prepared.world.closest(&ray) else { return (None, rays) };
        let at = prepared.surfel(&ray, &hit);
        let way = sequence.point(GROUPS_PER_VERTEX * vertex, index);
        let choice = sequence.point(GROUPS_PER_VERTEX * vertex + 1, index);
        let scatter = at.scatter(&prepared.scene);
        let bounce = match &scatter {
            Scatter::Glossy(material) => {
                let share = sharp_share(material, at.shading.dot(-direction));
                if choice[1] < share {
                    sharp_bounce(&at, direction, material, share, [way[2], way[3]])
                } else {
                    flux /= 1.0 - share;
                    None
                }
            }
            other => other.branch(&at, direction, Carries::Flux, choice[1]),
        };
        let Some(bounce) = bounce else {
            let receives = matches!(scatter, Scatter::Diffuse { .. } | Scatter::Glossy(_));
            let stays = receives && vertex > 1;
            let flux = flux * slant(&at, direction);
            let photon = Photon { position: at.position, normal: at.shading, from: -direction, flux };
            return (stays.then_some(photon), rays);
        };
        let q = bounce.weight.max_element().clamp(0.0, 1.0);
        if choice[0] >= q {
            return (None, rays);
        }
        flux *= bounce.weight / q;
        (origin, direction) = (bounce.origin, bounce.direction);
    }
    (None, u64::from(LONGEST))
}

/// Probability that a photon follows the lobe of a glossy surface like a mirror; 0 for rough ones.
fn sharp_share(material: &Glossy, cos: f32) -> f32 {
    if !material.is_sharp() {
        return 0.0;
    }
    if material.diffuse_albedo() == Vec3::ZERO {
        return 1.0;
    }
    // A fair share for either, however dark it is: the density must not vanish where light does not.
    material.lobe_albedo(cos).max_element().clamp(0.1, 0.9)
}

/// The way on by a sharp lobe that was chosen with probability `p`.
fn sharp_bounce(at: &Surfel, incoming: Vec3, material: &Glossy, p: f32, way: [f32; 2]) -> Option<Bounce> {
    let (direction, weight) = material.sample(at.shading, -incoming, way)?;
    let side = at.geometric.dot(direction) / at.shading.dot(direction).max(1e-4);
    (side > 0.0).then(|| Bounce {
        origin: at.off(direction),
        direction,
        weight: weight * (slant(at, incoming) * side / p),
        reflected: true,
    })
}

/// Sends light on its way, mostly towards specular objects: origin, direction and flux, which is
/// intensity over the density of the mixture (cosine or whole, and cones around specular objects).
fn aim(prepared: &Prepared, light: &Vpl, u: [f32; 4]) -> Option<(Vec3, Vec3, Rgb)> {
    if light.shape == Shape::Distant {
        return Some(aim_from_afar(prepared, light, u));
    }
    let targets = prepared.targets.seen_from(light);
    let aimed = if targets.is_empty() { 0.0 } else { AIMED };
    let direction =
        if u[2] < aimed { targets.sample(u[2] / aimed, [u[0], u[1]]) } else { own_direction(light, [u[0], u[1]]) };
    let density = aimed * targets.density(direction) + (1.0 - aimed) * own_density(light, direction);
    let flux = light.intensity(direction) / density;
    (density > 0.0 && flux.is_finite() && flux != Vec3::ZERO).then_some((light.position, direction, flux))
}

fn own_direction(light: &Vpl, u: [f32; 2]) -> Vec3 {
    match light.shape {
        Shape::Point => warp::sphere(u),
        Shape::Spot { axis, cos_outer, .. } => warp::cone(axis, 1.0 - cos_outer, u),
        Shape::Surface | Shape::Glossy { .. } | Shape::Distant => warp::cosine(light.normal, u),
    }
}

fn own_density(light: &Vpl, direction: Vec3) -> f32 {
    match light.shape {
        Shape::Point => warp::SPHERE_DENSITY,
        Shape::Spot { axis, cos_outer, .. } => {
            if axis.dot(direction) >= cos_outer {
                warp::cone_density(1.0 - cos_outer)
            } else {
                0.0
            }
        }
        Shape::Surface | Shape::Glossy { .. } | Shape::Distant => warp::cosine_density(light.normal.dot(direction)),
    }
}

/// Parallel light enters through discs: one that covers the scene, one for each specular object.
fn aim_from_afar(prepared: &Prepared, light: &Vpl, u: [f32; 4]) -> (Vec3, Vec3, Rgb) {
    let balls = prepared.targets.balls();
    let aimed = if balls.is_empty() { 0.0 } else { AIMED };
    let towards = light.normal;
    let origin = if u[2] < aimed {
        let chosen = &balls[((u[2] / aimed * balls.len() as f32) as usize).min(balls.len() - 1)];
        prepared.emitters.entry_to(chosen.centre, chosen.radius, towards, [u[0], u[1]]).0
    } else {
        prepared.emitters.entry(towards, [u[0], u[1]]).0
    };
    let across = |centre: Vec3| {
        let offset = origin - centre;
        (offset - towards * offset.dot(towards)).length()
    };
    // A point on a disc's very edge may seem to lie outside.
    let share = |centre: Vec3, radius: f32| {
        if across(centre) <= radius * 1.0001 { 1.0 / (std::f32::consts::PI * radius * radius) } else { 0.0 }
    };
    let (centre, radius) = (prepared.emitters.scene_centre(), prepared.emitters.scene_radius());
    let whole = (1.0 - aimed) * share(centre, radius);
    let parts: f32 = balls.iter().map(|b| share(b.centre, b.radius)).sum();
    let density = whole + if balls.is_empty() { 0.0 } else { aimed * parts / balls.len() as f32 };
    // Enter from outside the scene whichever disc it was.
    let along = (centre - origin).dot(towards) + 2.0 * radius;
    (origin + towards * along, -towards, light.strength / density)
}
