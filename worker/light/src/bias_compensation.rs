//! One ray from where an eye path ends, for all light that virtual lights and photons leave out.
//!
//! **What the bound cut off (B1).** With the gate g on virtual lights,
//! `∫ f L V G dA = ∫ f L V G g dA + ∫ f L cosθ (1−g) dω`. The sum over virtual lights estimates the
//! first term; a direction from the BSDF the second. Only what lies within [`Gates::reach`] has g < 1,
//! so the ray is short and mostly meets nothing. What it meets shines with just the light that gated
//! virtual lights stood for: emission, and light reflected diffusely.
//!
//! **Light off surfaces through mirrors and glass (B6).** If the ray meets something specular it is
//! followed to the next diffuse surface y. Light that y reflects counts; light that emitters send this
//! way counts in part: photons and light samples carry the rest ([`crate::caustics`], [`crate::through_glass`]). The ray is lengthened only as far as
//! specular objects lie.
//!
//! **What narrow lobes see.** Light of a rough lobe is shared by virtual lights and a ray that follows it ([`crate::lobe`]).
//! That ray goes on until it meets something; all it meets counts in part. The ray by cosines then serves what lies
//! under the lobe alone.
//!
//! All need the radiance that y reflects: one virtual light is chosen by what it would bring and
//! tested, caustics are looked up, and what they leave out at y is found by another such ray. The
//! walk is iterative and ends by roulette.

use std::cell::RefCell;

use glam::Vec3;
use protocol::answer::Cost;
use protocol::question::Quality;
use scenes::Rgb;

use crate::bvh::Ray;
use crate::caustics::{self, Glass};
use crate::chain;
use crate::eye::Gloss;
use crate::glossy::Glossy;
use crate::lobe::Shares;
use crate::prepared::Prepared;
use crate::sample::Sequence;
use crate::surface::{Bounce, Carries, Scatter, Surfel};
use crate::through_glass::{self, Arriving};
use crate::vpl::{Gates, Vpl, scattered};
use crate::walk::LightSet;
use crate::warp;

/// The estimator for the end points of a tile.
pub struct BiasCompensation<'a> {
    prepared: &'a Prepared,
    set: &'a LightSet,
    /// Of each virtual light, 0 if it is hidden from all points that importance looks at, else 1.
    seen: Vec<f32>,
    gates: Gates,
    shares: Shares,
    /// Estimate what the gates cut off.
    cut_off: bool,
    /// Estimate light off surfaces through specular ones.
    through_specular: bool,
    max_length: Option<u8>,
    /// What each virtual light would bring to a place: memory alone.
    shown: RefCell<Vec<f32>>,
}

/// Light that virtual lights and photons leave out at a point.
#[derive(Clone, Copy, Debug)]
pub struct Missing {
    /// Unit direction that it comes from, cosine-distributed: `E ≈ π · radiance`.
    pub from: Vec3,
    /// All of it.
    pub radiance: Rgb,
    /// What of that comes straight from an emitter …
    pub straight: Rgb,
    /// … which is this triangle of this object ([`crate::bvh::Hit`]).
    pub emitter: [u32; 2],
}

/// How a chain of specular surfaces began.
struct Start<'a> {
    /// Where.
    x: &'a Surfel,
    /// Unit direction of the ray from there.
    direction: Vec3,
    /// What its first surface was.
    glass: Glass,
    /// What absorbs light behind it ([`Prepared::medium`]).
    medium: Option<Rgb>,
}

/// How the direction of a ray was chosen.
#[derive(Clone, Copy)]
enum Chosen {
    /// By the cosine: it finds what the gates cut off.
    Cosine,
    /// By a lobe, with this density: it finds the lobe's light, and shares it with virtual lights.
    Lobe(f32),
}

/// A ray of the estimate on its way.
struct Sent {
    direction: Vec3,
    chosen: Chosen,
    /// What it finds counts by this factor.
    throughput: Rgb,
}

/// What a ray of the estimate meets.
struct Met {
    /// Radiance from what is specular.
    passed: Rgb,
    /// What of that the surface shines which the ray meets first.
    shone: Rgb,
    /// Object and triangle that the ray meets first.
    first: [u32; 2],
    /// The diffuse surface whose light is missing, if there is one.
    arrival: Option<Arrival>,
}

/// Where a ray ended, and what part of the light there is still missing at its start.
struct Arrival {
    surfel: Surfel,
    scatter: Scatter,
    /// Unit direction back along the ray.
    to: Vec3,
    /// Radiance reflected here counts by this factor.
    reflected: Rgb,
    /// Radiance emitted here, as far as it counts.
    emitted: Rgb,
}

/// Roulette begins after so many specular surfaces.
const FREE_BOUNCES: u32 = 4;
/// Dimensions: each level of the walk has its direction, its choices, and its specular chain.
const GROUPS_PER_LEVEL: u32 = 2 + chain::PATIENT;
/// … and walks that begin by a lobe are far from the others.
const LOBE: u32 = 1 << 18;
/// Lobes that reflect more than one part in so many are followed each time.
const PATIENCE: f32 = 4.0;

impl<'a> BiasCompensation<'a> {
    /// What a quality asks for, less what the scene cannot have.
    pub fn new(prepared: &'a Prepared, set: &'a LightSet, gates: Gates, quality: &Quality) -> Self {
        let mut seen = vec![1.0; set.vpls.len()];
        for hidden in &set.hidden {
            seen[*hidden as usize] = 0.0;
        }
        Self {
            prepared,
            set,
            seen,
            gates,
            shares: Shares::new(quality, set, gates),
            cut_off: quality.bias_compensation && !gates.are_open(),
            through_specular: quality.indirect_caustics
                && !(prepared.targets.balls().is_empty() && prepared.may_skip()),
            max_length: quality.max_length,
            shown: RefCell::default(),
        }
    }

    /// The same, for light that comes straight from emitters and nothing else.
    pub fn straight(prepared: &'a Prepared, set: &'a LightSet, gates: Gates, quality: &Quality) -> Self {
        Self { through_specular: false, max_length: Some(0), ..Self::new(prepared, set, gates, quality) }
    }

    /// Light samples are looked for through glass.
    fn looks_through_glass(&self) -> bool {
        self.through_specular && through_glass::is_needed(self.prepared, self.set.sharing)
    }

    /// What light samples bring to `x` through glass.
    pub fn through_glass(
        &self,
        x: &Surfel,
        sequence: &Sequence,
        first_group: u32,
        index: u32,
        cost: &mut Cost,
        add: impl FnMut(Arriving),
    ) {
        if self.looks_through_glass() {
            // The first two numbers are the direction's of the estimate.
            let u = || sequence.point(first_group, index)[2];
            through_glass::gather(self.prepared, self.set, x, u, cost, add);
        }
    }

    /// Some ray has to be traced. (Even where chance has left the set without virtual lights: what the gates
    /// cut off them is missing on average.)
    pub fn is_needed(&self) -> bool {
        let needs = &self.prepared.needs;
        let lobes = self.shares.follow_rough() && needs.glossy > 0;
        let spread = needs.spreading > 0 && (self.cut_off || self.through_specular || lobes);
        needs.light() && (spread || needs.glossy > 0 && self.looks_through_glass())
    }

    /// Rays follow the lobe of a material here: it is rough, and not followed by the eye's own.
    pub fn follows(&self, material: &Glossy) -> bool {
        self.shares.follow_rough() && !material.is_sharp()
    }

    /// The missing light from a cosine-distributed direction at `x`; `None` if the direction brings none.
    pub fn sample(
        &self,
        x: &Surfel,
        sequence: &Sequence,
        first_group: u32,
        index: u32,
        cost: &mut Cost,
    ) -> Option<Missing> {
        let u = sequence.point(first_group, index);
        let direction = warp::cosine(x.shading, [u[0], u[1]]);
        let sent = Sent { direction, chosen: Chosen::Cosine, throughput: Vec3::ONE };
        self.walk(x, sent, sequence, first_group, index, cost)
    }

    /// Radiance that the lobe at `x` reflects towards the eye, less what it has from virtual lights and photons.
    pub fn along_lobe(
        &self,
        x: &Surfel,
        gloss: &Gloss,
        sequence: &Sequence,
        first_group: u32,
        index: u32,
        cost: &mut Cost,
    ) -> Rgb {
        let Gloss { material, to, .. } = *gloss;
        let first_group = first_group + LOBE;
        let u = sequence.point(first_group, index);
        // A weak lobe over a bright base is worth few rays.
        let cos = x.shading.dot(to).max(0.0);
        let (lobe, base) = (material.lobe_albedo(cos).max_element(), material.reflectance(cos).max_element());
        let q = (PATIENCE * lobe / (lobe + base)).clamp(0.1, 1.0);
        if u[2] >= q {
            return Vec3::ZERO;
        }
        let Some((direction, weight)) = material.sample(x.shading, to, [u[0], u[1]]) else { return Vec3::ZERO };
        let chosen = Chosen::Lobe(material.density(x.shading, to, direction));
        let sent = Sent { direction, chosen, throughput: weight / q };
        self.walk(x, sent, sequence, first_group, index, cost).map_or(Vec3::ZERO, |missing| missing.radiance)
    }

    /// All that a ray from `x` finds, and those that go on from where it ends.
    fn walk(
        &self,
        x: &Surfel,
        sent: Sent,
        sequence: &Sequence,
        first_group: u32,
        index: u32,
        cost: &mut Cost,
    ) -> Option<Missing> {
        let mut first: Option<Missing> = None;
        let mut radiance = Vec3::ZERO;
        let mut throughput = Vec3::ONE;
        let mut at = *x;
        let mut sent = Some(sent);
        for level in 0_u32.. {
            let group = first_group + GROUPS_PER_LEVEL * level;
            let Some(ray) = sent.take() else { break };
            throughput *= ray.throughput;
            let met = self.arrive(&at, &ray, sequence, group + 2, index, cost);
            if met.arrival.is_none() && met.passed == Vec3::ZERO {
                break;
            }
            radiance += throughput * met.passed;
            let emitter = met.first;
            let missing = first.get_or_insert(Missing { from: ray.direction, radiance, straight: met.shone, emitter });
            let Some(y) = met.arrival else { break };
            let emitted = throughput * y.emitted;
            if level == 0 {
                missing.straight += emitted;
            }
            radiance += emitted;
            throughput *= y.reflected;
            let Some(orders) = self.orders_left(level) else { break };
            let choice = sequence.point(group + 1, index);
            if throughput != Vec3::ZERO {
                radiance += throughput * self.reflected_at(&y, orders, choice[0], cost);
            }
            let q = (throughput * albedo_bound(&y.scatter)).max_element().clamp(0.0, 0.99);
            // Also where paths may become no longer: what the gates cut off of an emitter's light at y is emission, which the
            // next ray finds.
            if choice[1] >= q {
                break;
            }
            throughput /= q;
            sent = self.send(&y, sequence.point(group + GROUPS_PER_LEVEL, index));
            at = y.surfel;
        }
        first.map(|missing| Missing { radiance, ..missing })
    }

    /// The next ray, from where one ended.
    fn send(&self, y: &Arrival, u: [f32; 4]) -> Option<Sent> {
        let normal = y.surfel.shading;
        let by_cosine = || warp::cosine(normal, [u[0], u[1]]);
        // f cosθ / (cosθ/π)
        let cosine = |direction: Vec3, value: Rgb| Sent {
            direction,
            chosen: Chosen::Cosine,
            throughput: value * std::f32::consts::PI,
        };
        match &y.scatter {
            Scatter::Glossy(material) if self.follows(material) => {
                let cos = normal.dot(y.to).max(0.0);
                let (lobe, base) = (material.lobe_albedo(cos).max_element(), material.reflectance(cos).max_element());
                let p = if base > 0.0 { (lobe / (lobe + base)).clamp(0.1, 0.9) } else { 1.0 };
                if u[2] < p {
                    let (direction, weight) = material.sample(normal, y.to, [u[0], u[1]])?;
                    let chosen = Chosen::Lobe(material.density(normal, y.to, direction));
                    Some(Sent { direction, chosen, throughput: weight / p })
                } else {
                    let direction = by_cosine();
                    Some(cosine(direction, base_value(material, normal, y.to, direction) / (1.0 - p)))
                }
            }
            scatter => {
                let direction = by_cosine();
                Some(cosine(direction, value(scatter, normal, y.to, direction)))
            }
        }
    }

    /// Follows a ray from `x` to the diffuse surface whose light is missing at x. Before it, radiance that is missing from
    /// the specular surface which the ray met first, because that is an emitter.
    fn arrive(
        &self,
        x: &Surfel,
        sent: &Sent,
        sequence: &Sequence,
        first_group: u32,
        index: u32,
        cost: &mut Cost,
    ) -> Met {
        let Sent { direction, chosen, .. } = *sent;
        let scene = &self.prepared.scene;
        let cos_x = x.shading.dot(direction);
        if x.geometric.dot(direction) <= 0.0 {
            // Above the smooth surface, below the triangle: virtual lights there are hidden by the triangle itself.
            return NOTHING;
        }
        let origin = x.off(direction);
        let near = if self.cut_off { self.gates.reach(cos_x) } else { 0.0 };
        let far = if self.through_specular { self.prepared.targets.far_end(origin, direction) } else { 0.0 };
        let t_max = match chosen {
            Chosen::Cosine => near.max(far),
            Chosen::Lobe(_) => f32::INFINITY,
        };
        if t_max <= 0.0 {
            return NOTHING;
        }
        cost.compensation_rays += 1;
        let ray = Ray { origin, direction, t_max };
        let Some(hit) = self.prepared.world.closest(&ray) else {
            let Chosen::Lobe(density) = chosen else { return NOTHING };
            let seen = self.shares.of_sky((self.prepared, &self.set.light_choice), density, direction);
            let shone = seen.map(|(radiance, share)| radiance * share).sum();
            return Met { passed: shone, shone, ..NOTHING };
        };
        let y = self.prepared.surfel(&ray, &hit);
        let left = self.prepared.left(None, &y, direction, hit.t);
        let scatter = y.scatter(scene);
        let d2 = y.position.distance_squared(x.position);
        let cosines = cos_x * y.geometric.dot(direction).abs();
        let first = [hit.object, hit.triangle];
        let emission = y.emission(scene) * left;
        // What counts of light that is reflected there, and of what shines there.
        let (reflected, emitted) = match chosen {
            Chosen::Cosine if self.cut_off && cosines > 0.0 => {
                (self.gates.surfaces.compensation(cosines, d2), self.gates.emitters.compensation(cosines, d2))
            }
            Chosen::Cosine => (0.0, 0.0),
            Chosen::Lobe(density) => {
                let emitted = match emission == Vec3::ZERO {
                    true => 0.0,
                    false => {
                        self.shares.of_emitter((self.prepared, Some(&self.set.light_choice)), density, &ray, &hit, &y)
                    }
                };
                (self.shares.of_surface(density, y.geometric.dot(direction), d2), emitted)
            }
        };
        let u = sequence.point(first_group, index);
        match self.specular(&y, &scatter, direction, u) {
            Way::On(bounce) => {
                // Of gloss, the way that ends there has it.
                let is_whole = !matches!(scatter, Scatter::Glossy(_));
                let seen = if is_whole { emission * emitted } else { Vec3::ZERO };
                if !self.through_specular {
                    return Met { passed: seen, shone: seen, first, arrival: None };
                }
                let mut glass = Glass::default();
                glass.meet(&scatter, &bounce);
                let start = Start { x, direction, glass, medium: self.prepared.medium(&y, bounce.direction) };
                let bounce = Bounce { weight: bounce.weight * left, ..bounce };
                let (passed, arrival) = self.follow(&start, bounce, sequence, first_group, index, cost);
                Met { passed: seen + passed, shone: seen, first, arrival }
            }
            Way::End(share) => {
                let arrival = (reflected > 0.0 || emitted > 0.0).then(|| {
                    let (surfel, scatter) = scatter.side(y, u[1]);
                    let (reflected, emitted) = (left * (reflected / share), emission * (emitted / share));
                    Arrival { surfel, scatter, to: -direction, reflected, emitted }
                });
                Met { passed: Vec3::ZERO, shone: Vec3::ZERO, first, arrival }
            }
        }
    }

    /// Follows a specular chain from its first bounce to the surface where it ends, if there is one. Before it, the rays'
    /// share of radiance from emitters and sky that it meets.
    fn follow(
        &self,
        start: &Start,
        mut bounce: Bounce,
        sequence: &Sequence,
        first_group: u32,
        index: u32,
        cost: &mut Cost,
    ) -> (Rgb, Option<Arrival>) {
        let (prepared, scene) = (self.prepared, &self.prepared.scene);
        let mut shone = Vec3::ZERO;
        let mut throughput = Vec3::ONE;
        let (mut glass, mut medium) = (start.glass, start.medium);
        let aimed = |glass: &Glass, cost: &mut Cost| match glass.passed {
            true => through_glass::aimed(prepared, self.set.ways(), start.x, start.direction, cost),
            false => 0.0,
        };
        for vertex in 1..chain::LONGEST {
            throughput *= bounce.weight;
            let u = match vertex < chain::PATIENT {
                true => sequence.point(first_group + vertex, index),
                // Far from all others, and from those of other levels.
                false => sequence.with(first_group).point(vertex, index),
            };
            if vertex > FREE_BOUNCES {
                let q = throughput.max_element().clamp(0.0, chain::most(vertex));
                if u[0] >= q {
                    return (shone, None);
                }
                throughput /= q;
            }
            cost.compensation_rays += 1;
            let ray = Ray { origin: bounce.origin, direction: bounce.direction, t_max: f32::INFINITY };
            let Some(hit) = prepared.world.closest(&ray) else {
                let mut seen = caustics::seen_afar(prepared, self.set.ways(), &ray).peekable();
                if seen.peek().is_some() {
                    let aimed = aimed(&glass, cost);
                    for (radiance, density) in seen {
                        shone += throughput * radiance * self.set.sharing.of_rays(density, aimed);
                    }
                }
                return (shone, None);
            };
            let y = prepared.surfel(&ray, &hit);
            throughput *= prepared.left(medium, &y, ray.direction, hit.t);
            let radiance = y.emission(scene);
            if radiance != Vec3::ZERO {
                let density = caustics::density_at_emitter(prepared, self.set.ways(), &ray, &hit, &y);
                let share = self.set.sharing.of_rays(density, aimed(&glass, cost));
                shone += throughput * radiance * share;
            }
            let scatter = y.scatter(scene);
            match self.specular(&y, &scatter, ray.direction, u) {
                Way::On(next) => {
                    glass.meet(&scatter, &next);
                    medium = prepared.medium(&y, next.direction);
                    bounce = next;
                }
                Way::End(share) => {
                    let reflected = throughput / share;
                    let (surfel, scatter) = scatter.side(y, u[1]);
                    let arrival = Arrival { surfel, scatter, to: -ray.direction, reflected, emitted: Vec3::ZERO };
                    return (shone, Some(arrival));
                }
            }
        }
        (shone, None)
    }

    /// Whether a path goes on like light at a mirror here, or ends.
    fn specular(&self, at: &Surfel, scatter: &Scatter, incoming: Vec3, u: [f32; 4]) -> Way {
        match scatter {
            Scatter::Diffuse { .. } | Scatter::Translucent { .. } => Way::End(1.0),
            Scatter::Glossy(material) if material.is_sharp() => {
                let to = -incoming;
                let shine = material.lobe_albedo(at.shading.dot(to).max(0.0)).max_element();
                let p = if material.diffuse_albedo() == Vec3::ZERO { 0.9 } else { shine.clamp(0.1, 0.9) };
                if u[1] >= p {
                    return Way::End(1.0 - p);
                }
                match material.sample(at.shading, to, [u[2], u[3]]) {
                    Some((direction, weight)) if at.geometric.dot(direction) > 0.0 => {
                        Way::On(Bounce { origin: at.off(direction), direction, weight: weight / p, reflected: true })
                    }
                    _ => Way::On(Bounce { origin: at.above(), direction: to, weight: Vec3::ZERO, reflected: true }),
                }
            }
            Scatter::Glossy(_) => Way::End(1.0),
            specular => match specular.branch(at, incoming, Carries::Radiance, u[1], [u[2], u[3]]) {
                Some(bounce) => Way::On(bounce),
                None => {
                    Way::On(Bounce { origin: at.above(), direction: -incoming, weight: Vec3::ZERO, reflected: true })
                }
            },
        }
    }

    /// Depth that virtual lights may have at the vertex of `level` within the path-length limit.
    fn orders_left(&self, level: u32) -> Option<u16> {
        match self.max_length {
            None => Some(u16::MAX),
            Some(most) => u32::from(most).checked_sub(1 + level).map(|orders| orders as u16),
        }
    }

    /// Radiance that y reflects towards where the ray came from: all virtual lights weighed, one chosen
    /// by what it would bring, and by whether it is hidden elsewhere, and tested for visibility; and the caustics.
    fn reflected_at(&self, y: &Arrival, orders: u16, u: f32, cost: &mut Cost) -> Rgb {
        let (place, normal) = (y.surfel.above(), y.surfel.shading);
        let bring = |vpl: &Vpl| {
            let gate = self.gates.of(vpl);
            let (irradiance, towards) = vpl.irradiance(y.surfel.position, normal, gate);
            match &y.scatter {
                Scatter::Glossy(material) if self.follows(material) => {
                    irradiance * base_value(material, normal, y.to, towards)
                        + self.shares.reflected(material, normal, y.to, vpl, y.surfel.position, gate)
                }
                scatter => irradiance * value(scatter, normal, y.to, towards),
            }
        };
        let usable = || self.seen.iter().zip(&self.set.vpls).filter(|(_, vpl)| vpl.depth <= orders);
        let mut shown = self.shown.borrow_mut();
        shown.clear();
        shown.extend(usable().map(|(_, vpl)| bring(vpl).max_element()));
        let total: f32 = shown.iter().sum();
        let seen_total: f32 = shown.iter().zip(usable()).map(|(share, (seen, _))| share * seen).sum();
        // Half of the choice is among those that are seen somewhere: what is hidden, such as the sky outside a closed room,
        // is strong where it is kept at all, and must not take the choice from lights that do arrive.
        let some_seen = seen_total > total * 1e-6;
        let [base, boost] = if some_seen { [0.5, 0.5 * (total / seen_total)] } else { [1.0, 0.0] };
        let mut radiance = Vec3::ZERO;
        if total > 0.0 && total.is_finite() {
            let mut rest = u * total;
            let mut chosen = None;
            for ((seen, vpl), share) in usable().zip(shown.iter()) {
                let share = share * (base + boost * seen);
                if share > 0.0 {
                    chosen = Some((vpl, share / total));
                    if rest < share {
                        break;
                    }
                    rest -= share;
                }
            }
            if let Some((vpl, chance)) = chosen {
                cost.compensation_rays += 1;
                if self.prepared.sees(vpl, place) {
                    radiance += bring(vpl) / chance;
                } else if vpl.depth == 0 && self.looks_through_glass() {
                    let ways = self.set.ways();
                    if let Some(Arriving { from, irradiance, .. }) =
                        through_glass::arrive(self.prepared, ways, vpl, &y.surfel, cost)
                    {
                        radiance += irradiance * value(&y.scatter, normal, y.to, from) / chance;
                    }
                }
            }
        }
        if !(self.set.photons.is_empty() && self.prepared.may_skip()) {
            cost.photon_queries += 1;
            let photons = &self.set.photons;
            radiance += photons
                .gather(y.surfel.position, y.surfel.smooth, |photon| value(&y.scatter, normal, y.to, photon.from));
        }
        radiance
    }
}

/// A ray that brings none of the missing light.
const NOTHING: Met = Met { passed: Vec3::ZERO, shone: Vec3::ZERO, first: [0; 2], arrival: None };

/// How a path fares at a surface.
enum Way {
    /// On like at a mirror.
    On(Bounce),
    /// It ends here, which had this probability.
    End(f32),
}

/// Value of the non-specular part of a BSDF.
fn value(scatter: &Scatter, n: Vec3, to: Vec3, from: Vec3) -> Rgb {
    match scatter {
        Scatter::Diffuse { albedo } => *albedo * std::f32::consts::FRAC_1_PI,
        Scatter::Glossy(material) => scattered(material, n, to, from),
        // Rays end on one side of a sheet, which is matt.
        Scatter::Mirror { .. } | Scatter::Glass { .. } | Scatter::Frosted(_) | Scatter::Translucent { .. } => {
            Vec3::ZERO
        }
    }
}

/// Value of what lies under the lobe.
fn base_value(material: &Glossy, n: Vec3, to: Vec3, from: Vec3) -> Rgb {
    let (cos_o, cos_i) = (n.dot(to), n.dot(from));
    if cos_o > 0.0 && cos_i > 0.0 { material.base(cos_o, cos_i) } else { Vec3::ZERO }
}

fn albedo_bound(scatter: &Scatter) -> Rgb {
    match scatter {
        Scatter::Glossy(_) => Vec3::ONE,
        other => other.albedo(),
    }
}
