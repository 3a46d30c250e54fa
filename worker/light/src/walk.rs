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

use std::sync::Arc;

use glam::Vec3;
use protocol::question::Quality;
use scenes::Rgb;

use crate::aims::{Aims, Choice, Part};
use crate::bvh::{Ray, ShaftScratch};
use crate::caustics::{self, Sharing, Ways};
use crate::glossy::Glossy;
use crate::importance::{Brought, Importance, Plan};
use crate::mirrors::Image;
use crate::panes::{self, Aimed};
use crate::photons::{PhotonMap, radius_of_round};
use crate::prepared::Prepared;
use crate::sample::Sequence;
use crate::surface::{Carries, Scatter, Surfel};
use crate::vpl::{Gates, Shape, Vpl};
use crate::warp;

/// The light set with id k: all that its pixels need to know of light.
#[derive(Clone, Debug, Default)]
pub struct LightSet {
    /// Points on lights first, then points on surfaces.
    pub vpls: Vec<Vpl>,
    /// Images of points on lights in mirrors, for lobes.
    pub images: Vec<Image>,
    /// Numbers of those that are hidden from all points that importance looks at, in order.
    pub hidden: Vec<u32>,
    /// Caustics; empty where a scene can have none.
    pub photons: PhotonMap,
    /// What they count beside rays that find the same light.
    pub sharing: Sharing,
    /// How they left emitters.
    pub photon_aims: Arc<Aims>,
    /// How points on lights were chosen.
    pub light_choice: Arc<Choice>,
    /// The gates on virtual lights.
    pub gates: Gates,
    /// What points on lights count beside rays that follow lobes ([`crate::lobe_pilot`]).
    pub worth_to_lobes: f32,
    /// Segments traced to make the set.
    pub rays: u64,
}

/// Which set is meant, in the numbers of its sequence.
#[derive(Clone, Copy, Debug)]
pub struct SetAddress {
    /// Index of the set among all that one replicate ever makes: epoch · sets + k.
    pub block: u32,
    /// How often the photon radius has shrunk.
    pub round: u32,
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

/// Group of the number that says where systematic thinning begins; no walk is so long. The one before it does for samples
/// that are added to some sets.
const PHASE: u32 = u32::MAX;

/// Tells the sequence of samples by what was known of emitters from that of the others.
const KNOWN: u32 = 1;

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
        let radius = radius_of_round(quality.photon_radius * importance.extent, at.round);
        let mut set = Self {
            sharing: Sharing::new(quality, importance.photons, radius),
            photon_aims: Arc::clone(&importance.photon_aims),
            light_choice: Arc::clone(&importance.light_choice),
            gates: importance.gates,
            worth_to_lobes: importance.worth_to_lobes,
            ..Self::default()
        };
        if prepared.emitters.is_empty() && prepared.may_skip() {
            return set;
        }
        set.sample_lights(prepared, importance, &sequences.lights, at.block);
        set.images = prepared.mirrors.images(&set.vpls);
        if prepared.needs.spreading > 0 && quality.max_length != Some(0) {
            set.walk(prepared, importance, quality.max_length, &sequences.walk, at.block);
        }
        if importance.photons > 0 && prepared.needs.caustics() {
            let size = (importance.photons, radius);
            let (photons, rays) = caustics::shoot(prepared, set.ways(), size, &sequences.photons, at.block);
            set.photons = photons;
            set.rays += rays;
        }
        set
    }

    /// What all who find light through specular surfaces have to agree on.
    pub fn ways(&self) -> Ways<'_> {
        Ways { sharing: self.sharing, photons: &self.photon_aims, samples: &self.light_choice }
    }

    fn sample_lights(&mut self, prepared: &Prepared, importance: &Importance, sequence: &Sequence, block: u32) {
        let (plan, choice) = (importance.emitters, &importance.light_choice);
        let mut scratch = ShaftScratch::default();
        let mut phase = sequence.point(PHASE, block)[0];
        let (samples, expected) = allotted(sequence, choice, plan.candidates, block);
        for (sequence, part, index) in samples {
            let sampled = prepared.emitters.sample(&prepared.scene, choice, part, sequence.point(0, index));
            if let Some(emitter) = sampled {
                let brought = importance.brings(prepared, &emitter, plan.keeps_all(), &mut scratch, &mut self.rays);
                self.keep(emitter, brought, plan, &mut phase, expected);
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
        let (plan, aims) = (importance.walks, &importance.walk_aims);
        let mut scratch = ShaftScratch::default();
        let mut phase = sequence.point(PHASE, block)[0];
        let (samples, expected) = allotted(sequence, &aims.choice, plan.candidates, block);
        for (sequence, part, index) in samples {
            let mut path = LightPath::start(prepared, aims, part, &sequence, index);
            while let Some(vpl) = path.next_vpl(prepared, max_length) {
                let brought = importance.brings(prepared, &vpl, plan.keeps_all(), &mut scratch, &mut self.rays);
                self.keep(vpl, brought, plan, &mut phase, expected);
            }
            self.rays += path.rays;
        }
    }

    /// Keeps a light with the probability of a plan and lets it stand for all that are dropped. Systematic: kept
    /// lights are spread evenly over the candidates, which keeps the strata of their sequence.
    fn keep(&mut self, mut vpl: Vpl, brought: Brought, plan: Plan, phase: &mut f32, candidates: f32) {
        let p = plan.probability(brought.amount);
        *phase += p;
        if *phase >= 1.0 {
            *phase -= 1.0;
            vpl.strength /= candidates * p;
            if brought.is_hidden {
                self.hidden.push(self.vpls.len() as u32);
            }
            self.vpls.push(vpl);
        }
    }
}

/// The samples of a set, as sequence, part of the choice and index; and how many they are on average.
///
/// `candidates` of them go by what was found of emitters: a whole net of the sequence, which loses none of its strata to what
/// hardly matters. Those that go by what was known before are added, less than one a set perhaps: then to every so manyth.
fn allotted(
    sequence: &Sequence,
    choice: &Choice,
    candidates: u32,
    block: u32,
) -> (impl Iterator<Item = (Sequence, Part, u32)>, f32) {
    let found = (0..candidates).map(move |i| block.wrapping_mul(candidates).wrapping_add(i));
    let more = f64::from(candidates) * choice.known_for_each_found();
    let begin = f64::from(sequence.point(PHASE - 1, 0)[0]);
    let before = |block: f64| (block * more + begin) as u32;
    let known = before(f64::from(block))..before(f64::from(block) + 1.0);
    let (whole, other) = (*sequence, sequence.with(KNOWN));
    let samples = found.map(move |i| (whole, Part::Found, i)).chain(known.map(move |i| (other, Part::Known, i)));
    (samples, candidates as f32 + more as f32)
}

/// A light path on its way: flux travels along `ray`.
pub struct LightPath<'a> {
    aims: &'a Aims,
    sequence: &'a Sequence,
    index: u32,
    vertex: u32,
    depth: u16,
    ray: Option<(Vec3, Vec3)>,
    /// What absorbs light along it, as far as is known where it begins ([`Prepared::medium`]).
    medium: Option<Rgb>,
    flux: Rgb,
    /// It has passed clear glass, and is no longer aimed at any ([`crate::panes`]).
    pub passed_glass: bool,
    /// How often light takes this way by itself, for each time that it was chosen.
    pub natural: f32,
    /// See [`Vpl::source`].
    pub source: u32,
    /// Segments traced so far.
    pub rays: u64,
}

impl<'a> LightPath<'a> {
    /// Leaves a light in a direction of its own.
    pub fn start(prepared: &Prepared, aims: &'a Aims, part: Part, sequence: &'a Sequence, index: u32) -> Self {
        let mut path = Self {
            aims,
            sequence,
            index,
            vertex: 0,
            depth: 0,
            ray: None,
            medium: None,
            flux: Vec3::ZERO,
            passed_glass: false,
            natural: 1.0,
            source: 0,
            rays: 0,
        };
        let choice = sequence.point(0, index);
        let way = sequence.point(1, index);
        if let Some(light) = prepared.emitters.sample(&prepared.scene, &aims.choice, part, choice) {
            let Departure { origin, direction, flux, natural } = leave(prepared, aims, &light, way);
            path.ray = Some((origin, direction));
            path.flux = flux;
            path.natural = natural;
            path.source = light.source;
        }
        path
    }

    /// Walks to the next vertex that spreads light and stands a virtual light on it. (One on a dark mirror would shine on nothing.)
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
            self.flux *= prepared.left(self.medium.take(), &at, direction, hit.t);
            let way = self.sequence.point(GROUPS_PER_VERTEX * self.vertex, self.index);
            let choice = self.sequence.point(GROUPS_PER_VERTEX * self.vertex + 1, self.index);
            let (at, scatter) = at.scatter(&prepared.scene).side(at, choice[1]);
            match scatter {
                Scatter::Diffuse { albedo } => {
                    self.depth += 1;
                    let vpl = self.stand(&at, direction, albedo);
                    if max_length.is_none_or(|most| self.depth < u16::from(most)) {
                        self.go_on(prepared, (&at, &vpl), direction, albedo, choice, [way[0], way[1]]);
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
                        self.go_on_glossy(prepared, (&at, &vpl), direction, &material, choice, way);
                    }
                    if !material.is_dark() {
                        return Some(vpl);
                    }
                }
                specular => {
                    let facet = [way[2], way[3]];
                    if let Some(bounce) = specular.branch(&at, direction, Carries::Flux, choice[1], facet) {
                        self.passed_glass |= !bounce.reflected && matches!(specular, Scatter::Glass { .. });
                        self.medium = prepared.medium(&at, bounce.direction);
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
    fn go_on(
        &mut self,
        prepared: &Prepared,
        (at, light): (&Surfel, &Vpl),
        incoming: Vec3,
        albedo: Rgb,
        choice: [f32; 4],
        way: [f32; 2],
    ) {
        self.flux *= slant(at, incoming);
        let direction = self.scattered(prepared, light, choice[2], way);
        self.survive(albedo, choice[0], at.above(), direction);
    }

    /// A direction from a surface that would be distributed by the cosine alone, if none were aimed.
    fn scattered(&mut self, prepared: &Prepared, light: &Vpl, choice: f32, way: [f32; 2]) -> Vec3 {
        let own = || warp::cosine(light.normal, way);
        if self.passed_glass {
            return own();
        }
        let density = |direction: Vec3| warp::cosine_density(light.normal.dot(direction));
        match panes::from_place(prepared, self.aims, light, (own, density), (choice, way)) {
            None => own(),
            Some(Aimed { direction, natural, .. }) => {
                self.natural *= natural;
                self.flux *= natural;
                direction
            }
        }
    }

    /// Leaves a glossy surface by its base or its lobe. A sharp lobe leads on like a mirror.
    fn go_on_glossy(
        &mut self,
        prepared: &Prepared,
        (at, light): (&Surfel, &Vpl),
        incoming: Vec3,
        material: &Glossy,
        choice: [f32; 4],
        way: [f32; 4],
    ) {
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
            let direction = self.scattered(prepared, light, choice[2], [way[0], way[1]]);
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

/// A path as it leaves a light.
struct Departure {
    origin: Vec3,
    /// Unit.
    direction: Vec3,
    flux: Rgb,
    /// See [`LightPath::natural`].
    natural: f32,
}

/// Sends light on its way, some of it towards panes.
fn leave(prepared: &Prepared, aims: &Aims, light: &Vpl, u: [f32; 4]) -> Departure {
    let [a, b, _, choice] = u;
    let own = (|| caustics::own_direction(light, [a, b]), |direction| caustics::own_density(light, direction));
    let aimed = match light.shape {
        Shape::Distant => panes::from_afar(prepared, aims, light, u),
        _ => panes::from_place(prepared, aims, light, own, (choice, [a, b])),
    };
    let Some(Aimed { origin, direction, natural }) = aimed else {
        let (origin, direction, flux) = leave_by_itself(aims, light, u);
        return Departure { origin, direction, flux, natural: 1.0 };
    };
    let whole = match light.shape {
        Shape::Distant => light.strength / aims.entry.density(origin, -direction),
        _ => light.intensity(direction) / caustics::own_density(light, direction),
    };
    let flux = whole * natural;
    Departure { origin, direction, flux: if flux.is_finite() { flux } else { Vec3::ZERO }, natural }
}

/// Origin, unit direction and flux of light that leaves a light in a direction of its own.
fn leave_by_itself(aims: &Aims, light: &Vpl, [a, b, choice, _]: [f32; 4]) -> (Vec3, Vec3, Rgb) {
    let u = [a, b];
    match &light.shape {
        Shape::Surface | Shape::Glossy { .. } => (light.position, warp::cosine(light.normal, u), light.flux()),
        Shape::Point => (light.position, warp::sphere(u), light.flux()),
        Shape::Spot { axis, cos_outer, .. } => {
            let direction = warp::cone(*axis, 1.0 - cos_outer, u);
            let flux = light.intensity(direction) / warp::cone_density(1.0 - cos_outer);
            (light.position, direction, flux)
        }
        Shape::Luminaire(lamp) => {
            let direction = lamp.sample(u);
            let flux = light.intensity(direction) / lamp.density(direction);
            (light.position, direction, if flux.is_finite() { flux } else { Vec3::ZERO })
        }
        Shape::Distant => {
            let origin = aims.entry.sample(light.normal, [a, b, choice]);
            (origin, -light.normal, light.strength / aims.entry.density(origin, light.normal))
        }
    }
}
