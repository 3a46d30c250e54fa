//! Eye paths: from the eye through mirrors and glass to the surfaces that scatter light (IGI-1).
//!
//! The path splits **once**, at the first surface: one continuation for each component of its BSDF.
//! Later vertices choose one component at random.

use glam::{Mat3, Vec3};
use protocol::answer::Cost;
use scenes::Rgb;
use scenes::camera::Lens;

use crate::bvh::{Hit, PacketScratch, Ray};
use crate::chain;
use crate::frosted::{Frosted, Ways};
use crate::glossy::Glossy;
use crate::lobe::Shares;
use crate::mirrors::Image;
use crate::photons::Photon;
use crate::prepared::{Prepared, beyond};
use crate::sample::Sequence;
use crate::surface::{Bounce, Carries, Scatter, Surfel};
use crate::through_glass::{self, Arriving};
use crate::vpl::{Gate, Vpl};
use crate::walk::LightSet;

/// A surface point whose irradiance is asked for.
#[derive(Clone, Copy, Debug)]
pub struct EndPoint {
    /// Where; normals on the side the eye path arrived on.
    pub at: Surfel,
    /// Product of all reflectances, the end point's own included: radiance is `weight · E / π`.
    pub weight: Rgb,
    /// A glossy surface here: it weighs light by direction, and may have a rough lobe to be lit.
    pub glossy: Option<Gloss>,
    /// Length of the path.
    pub distance: f32,
    /// The normal, mirrored back through the mirrors on the way.
    pub seen_normal: Vec3,
}

impl EndPoint {
    /// Nothing but a sharp lobe reflects here, so that only light samples and photons that lobes are lit by count.
    pub fn is_dark(&self) -> bool {
        self.weight == Vec3::ZERO && self.glossy.is_some_and(|gloss| gloss.material.is_sharp())
    }
}

/// The glossy part of an end point.
#[derive(Clone, Copy, Debug)]
pub struct Gloss {
    /// The material.
    pub material: Glossy,
    /// Unit direction back along the eye path.
    pub to: Vec3,
    /// Product of all reflectances before this surface: scales the lobe.
    pub throughput: Rgb,
    /// The lobe has light samples here. In chains of sharp lobes it has had them on the way.
    pub lit: bool,
}

/// What one eye path found.
#[derive(Clone, Copy, Debug, Default)]
pub struct Sight {
    /// Light of emitters and sky that is seen directly or through specular surfaces.
    pub emitted: Rgb,
    /// Where irradiance is needed; the first one is filtered, the second is not. A surface that only has a sharp lobe is
    /// never the first.
    pub ends: [Option<EndPoint>; 2],
    /// Segments traced.
    pub rays: u64,
}

/// Roulette begins after so many specular surfaces.
const FREE_BOUNCES: u32 = 6;

/// Dimensions: group 0 is the pixel, then one group a vertex for the first branch, then for the second.
const SECOND_BRANCH: u32 = 1 << 16;

/// Follows the eye path through a point of pixel (x, y). What it sees of emitters is told as if no light samples were made.
pub fn look(prepared: &Prepared, lens: &Lens, pixel: [u32; 2], sequence: &Sequence, index: u32) -> Sight {
    let ray = ray(lens, pixel, sequence, index);
    let around = Around { prepared, shares: &Shares::default(), set: None, illuminance: false };
    see(around, &ray, (meet(prepared, lens, &ray), None), sequence, index)
}

/// Where the eye path through a point of pixel (x, y) begins.
pub fn ray(lens: &Lens, pixel: [u32; 2], sequence: &Sequence, index: u32) -> Ray {
    let u = sequence.first::<2>(0, index);
    let direction = lens.direction(pixel[0] as f32 + u[0], pixel[1] as f32 + u[1]);
    Ray { origin: lens.origin(), direction, t_max: f32::INFINITY }
}

/// What a ray from the eye meets first of what is not cut away; its distance is from the eye.
pub fn meet(prepared: &Prepared, lens: &Lens, ray: &Ray) -> Option<Hit> {
    let start = lens.start(ray.direction);
    let hit = prepared.world.closest(&Ray { origin: ray.origin + ray.direction * start, ..*ray })?;
    Some(Hit { t: hit.t + start, ..hit })
}

/// The same of many rays, in order.
pub fn meet_all(
    prepared: &Prepared,
    lens: &Lens,
    directions: &[Vec3],
    packet: &mut PacketScratch,
    hits: &mut Vec<Option<Hit>>,
) {
    hits.clear();
    if lens.near() > 0.0 {
        let ray = |direction: &Vec3| Ray { origin: lens.origin(), direction: *direction, t_max: f32::INFINITY };
        hits.extend(directions.iter().map(|direction| meet(prepared, lens, &ray(direction))));
        return;
    }
    hits.resize(directions.len(), None);
    prepared.world.closest_from(lens.origin(), directions, packet, hits);
}

/// What shines where a ray from the eye first meets something; or beyond all things, if it meets nothing.
pub fn shine(prepared: &Prepared, ray: &Ray, hit: Option<Hit>) -> Rgb {
    let scene = &prepared.scene;
    let Some(hit) = hit else { return prepared.emitters.sky_radiance(scene, ray.direction) };
    let material = scene.material_of(hit.object as usize, hit.triangle as usize);
    if scene.materials[material as usize].emission.is_black() {
        return Vec3::ZERO;
    }
    let at = prepared.surfel(ray, &hit);
    at.emission(scene) * prepared.left(None, &at, ray.direction, hit.t)
}

/// Follows an eye path from its first hit. If given, `shone` is what shines there instead of what does at the very place.
pub fn see(
    around: Around,
    ray: &Ray,
    (hit, shone): (Option<Hit>, Option<Rgb>),
    sequence: &Sequence,
    index: u32,
) -> Sight {
    let prepared = around.prepared;
    let mut sight = Sight { rays: 1, ..Sight::default() };
    let direction = ray.direction;
    let Some(hit) = hit else {
        sight.emitted = shone.unwrap_or_else(|| prepared.emitters.sky_radiance(&prepared.scene, direction));
        return sight;
    };
    let at = prepared.surfel(ray, &hit);
    let throughput = prepared.left(None, &at, direction, hit.t);
    sight.emitted = shone.unwrap_or_else(|| at.emission(&prepared.scene) * throughput);
    let here = Leg { throughput, distance: hit.t, unfold: Mat3::IDENTITY, lobe: None, medium: None };
    let scatter = match around.illuminance {
        true => Scatter::Diffuse { albedo: Vec3::ONE },
        false => at.scatter(&prepared.scene),
    };
    match scatter {
        Scatter::Diffuse { albedo } => sight.ends[0] = here.end(at, albedo),
        Scatter::Translucent { albedo, transmittance } => {
            let sides = [here.end(at, albedo), here.end(at.turned(), transmittance)];
            sight.ends = if sides[0].is_some() { sides } else { [sides[1], None] };
        }
        Scatter::Glossy(material) => {
            let end = here.end_glossy(around, at, &material, -direction, (1.0, true));
            let mut beyond = None;
            let [choice] = sequence.with(LIGHT).first(0, index);
            let (light, rays) = around.light_mirrored(&at, &material, -direction, choice);
            sight.emitted += throughput * light;
            sight.rays += rays;
            if material.is_sharp()
                && let [_, _, a, b] = sequence.point(0, index)
                && let Some(bounce) = lobe(&at, direction, &material, [a, b])
            {
                let leg = here.after_lobe(around, &bounce, &at, &material, direction);
                beyond = sight.follow(around, leg, bounce, sequence, index, 1);
            }
            sight.ends = match end {
                Some(end) if end.weight != Vec3::ZERO || !material.is_sharp() => [Some(end), beyond],
                end => [beyond, end],
            };
        }
        specular => {
            let [_, _, a, b] = match &specular {
                Scatter::Frosted(frosted) => {
                    let [choice] = sequence.with(LIGHT).first(0, index);
                    let (light, rays) = around.light_frosted(&at, frosted, -direction, choice, Ways::Both);
                    sight.emitted += throughput * light;
                    sight.rays += rays;
                    sequence.point(0, index)
                }
                _ => [0.0; 4],
            };
            let mut branches = specular.branches(&at, direction, Carries::Radiance, [a, b]);
            // The stronger branch is the one that neighbouring pixels share: it goes first.
            if let [Some(a), Some(b)] = branches
                && b.weight.max_element() > a.weight.max_element()
            {
                branches.swap(0, 1);
            }
            for (bounce, group) in branches.into_iter().zip([1, SECOND_BRANCH]) {
                let Some(bounce) = bounce else { continue };
                let leg = here.after_specular(around, &bounce, (&hit, &at), (&specular, Ways::Both), direction);
                let end = sight.follow(around, leg, bounce, sequence, index, group);
                let slot = usize::from(sight.ends[0].is_some());
                if end.is_some() {
                    sight.ends[slot] = end;
                }
            }
        }
    }
    sight
}

/// What is the same for all paths.
#[derive(Clone, Copy)]
pub struct Around<'a> {
    /// The scene.
    pub prepared: &'a Prepared,
    /// How light of lobes is shared.
    pub shares: &'a Shares,
    /// What lights the lobes in chains, if anything does.
    pub set: Option<&'a LightSet>,
    /// The first surface counts as matt and white ([`protocol::question::Quality::illuminance`]).
    pub illuminance: bool,
}

/// A lobe that a path follows, and that has light samples.
#[derive(Clone, Copy)]
struct Lobe {
    /// Of the path's direction, sr⁻¹.
    density: f32,
    /// Length of the path from the lobe to a flat mirror, if it has been reflected there.
    before: f32,
    /// It has light samples by way of one flat mirror as well ([`crate::mirrors`]), which the path has not met.
    may_reflect: bool,
}

/// What a path has gathered so far.
#[derive(Clone, Copy)]
struct Leg {
    throughput: Rgb,
    distance: f32,
    /// Takes normals from behind mirrors to where they seem to be.
    unfold: Mat3,
    /// The lobe that it follows, if that has light samples as well.
    lobe: Option<Lobe>,
    /// What absorbs light along it, as far as is known where it begins ([`Prepared::medium`]).
    medium: Option<Rgb>,
}

impl Leg {
    fn end(&self, at: Surfel, albedo: Rgb) -> Option<EndPoint> {
        let weight = self.throughput * albedo;
        (weight != Vec3::ZERO).then(|| self.end_point(at, weight, None))
    }

    /// The end at a glossy surface, which was chosen with probability `p`. A sharp lobe is followed
    /// elsewhere; then a surface without base is an end only where light samples are made for the lobe.
    fn end_glossy(
        &self,
        around: Around,
        at: Surfel,
        material: &Glossy,
        to: Vec3,
        (p, lit): (f32, bool),
    ) -> Option<EndPoint> {
        let throughput = self.throughput / p;
        let weight = throughput * material.reflectance(at.shading.dot(to).max(0.0));
        let dark = weight == Vec3::ZERO && material.is_sharp() && !(lit && around.lights(material));
        let gloss = Gloss { material: *material, to, throughput, lit };
        (!dark).then(|| self.end_point(at, weight, Some(gloss)))
    }

    fn end_point(&self, at: Surfel, weight: Rgb, glossy: Option<Gloss>) -> EndPoint {
        EndPoint { at, weight, glossy, distance: self.distance, seen_normal: self.unfold * at.shading }
    }

    fn after(&self, bounce: &Bounce, at: &Surfel) -> Self {
        let mut next = Self { lobe: None, medium: None, ..*self };
        next.throughput *= bounce.weight;
        if bounce.reflected {
            let m = at.shading;
            next.unfold = self.unfold
                * Mat3::from_cols(Vec3::X - m * (2.0 * m.x), Vec3::Y - m * (2.0 * m.y), Vec3::Z - m * (2.0 * m.z));
        }
        next
    }

    fn after_lobe(&self, around: Around, bounce: &Bounce, at: &Surfel, material: &Glossy, incoming: Vec3) -> Self {
        let lobe = || Lobe {
            density: material.density(at.shading, -incoming, bounce.direction),
            before: 0.0,
            may_reflect: true,
        };
        Self { lobe: around.shares.has_samples(material.widest()).then(lobe), ..self.after(bounce, at) }
    }

    /// After a mirror or glass, which may be frosted.
    fn after_specular(
        &self,
        around: Around,
        bounce: &Bounce,
        (hit, at): (&Hit, &Surfel),
        (scatter, ways): (&Scatter, Ways),
        incoming: Vec3,
    ) -> Self {
        let lobe = match scatter {
            Scatter::Frosted(frosted) if around.shares.has_samples(frosted.facets.alpha()) => {
                let density = frosted.value_and_density(at, -incoming, bounce.direction, ways).1;
                Some(Lobe { density, before: 0.0, may_reflect: false })
            }
            Scatter::Mirror { .. } => self
                .lobe
                .filter(|lobe| lobe.may_reflect && around.prepared.mirrors.plane_of(hit).is_some())
                .map(|lobe| Lobe { before: hit.t, may_reflect: false, ..lobe }),
            _ => None,
        };
        let medium = around.prepared.medium(at, bounce.direction);
        Self { lobe, medium, ..self.after(bounce, at) }
    }
}

impl Around<'_> {
    /// Light samples are made for the sharp lobe of a surface.
    fn lights(&self, material: &Glossy) -> bool {
        self.light_lobes_of(material.widest())
    }

    fn light_lobes_of(&self, alpha: f32) -> bool {
        self.prepared.emitters.any_bodiless() || self.shares.has_samples(alpha)
    }

    /// One of the light samples of a set, chosen by what it would bring, that, and how many it stands for.
    fn choose(set: &LightSet, bring: impl Fn(&Vpl) -> Rgb, u: f32) -> Option<Chosen<'_, Vpl>> {
        Self::choose_among(set.vpls.iter().take_while(|vpl| vpl.depth == 0), bring, u)
    }

    fn choose_among<'s, T>(
        samples: impl Iterator<Item = &'s T>,
        bring: impl Fn(&T) -> Rgb,
        u: f32,
    ) -> Option<Chosen<'s, T>> {
        // Each takes the place of those before it by its share of all so far, and the number is stretched again.
        let (mut u, mut total) = (f64::from(u), 0.0);
        let mut chosen = None;
        for sample in samples {
            let brings = bring(sample);
            let share = f64::from(brings.max_element());
            if share > 0.0 {
                let place = u * (total + share);
                if place < share {
                    chosen = Some((sample, brings, share));
                    u = place / share;
                } else {
                    u = (place - share) / total;
                }
                total += share;
            }
        }
        let (sample, brings, share) = chosen?;
        let stands_for = (total / share) as f32;
        stands_for.is_finite().then_some(Chosen { sample, brings, stands_for })
    }

    /// Radiance that frosted glass has from light samples and photons, as [`Self::light_lobe`]; from either side.
    fn light_frosted(&self, at: &Surfel, frosted: &Frosted, to: Vec3, u: f32, ways: Ways) -> (Rgb, u64) {
        let Some(set) = self.set.filter(|_| self.light_lobes_of(frosted.facets.alpha())) else {
            return (Vec3::ZERO, 0);
        };
        let (mut radiance, mut rays) = (Vec3::ZERO, 0);
        let bring = |vpl: &Vpl| self.shares.scattered(frosted, at, to, vpl, ways);
        if let Some(Chosen { sample: vpl, brings, stands_for: scale }) = Self::choose(set, bring, u) {
            rays = 1;
            let from = vpl.towards(at.position);
            if self.prepared.sees(vpl, at.off(from)) {
                let length = if vpl.is_distant() { f32::INFINITY } else { vpl.position.distance(at.position) };
                let medium = self.prepared.medium(at, from).filter(|_| length.is_finite());
                radiance = brings * scale * medium.map_or(Vec3::ONE, |medium| beyond(medium, length));
            } else if vpl.is_bodiless() && through_glass::is_needed(self.prepared, set.sharing) {
                let mut cost = Cost::default();
                let side = if at.shading.dot(from) < 0.0 { at.turned() } else { *at };
                let arriving = through_glass::arrive(self.prepared, set.ways(), vpl, &side, &mut cost);
                rays += cost.compensation_rays;
                if let Some(Arriving { from, irradiance, .. }) = arriving {
                    radiance = frosted.value_and_density(at, to, from, ways).0 * irradiance * scale;
                }
            }
        }
        if self.prepared.emitters.any_bodiless() && !set.photons.is_empty() {
            let scattered = |photon: &Photon| match photon.shines_on {
                true => frosted.value_and_density(at, to, photon.from, ways).0,
                false => Vec3::ZERO,
            };
            for normal in [at.shading, -at.shading] {
                radiance += set.photons.gather(at.position, normal, scattered);
            }
        }
        (radiance, rays)
    }

    /// Radiance that the sharp lobe at a vertex of a chain has from light samples: all are weighed, one is chosen by what it
    /// would bring and tested for visibility; and from the photons that shine on such lobes. The number of rays.
    fn light_lobe(&self, at: &Surfel, material: &Glossy, to: Vec3, u: f32) -> (Rgb, u64) {
        let Some(set) = self.set.filter(|_| self.lights(material)) else { return (Vec3::ZERO, 0) };
        let normal = at.shading;
        let bring = |vpl: &Vpl| self.shares.reflected(material, normal, to, vpl, at.position, Gate::Open);
        let (mut radiance, mut rays) = (Vec3::ZERO, 0);
        if let Some(Chosen { sample: vpl, brings, stands_for }) = Self::choose(set, bring, u) {
            rays = 1;
            if self.prepared.sees(vpl, at.above()) {
                radiance = brings * stands_for;
            } else if vpl.is_bodiless() && through_glass::is_needed(self.prepared, set.sharing) {
                // Of other lights, the ray that follows the lobe finds what comes through glass.
                let mut cost = Cost::default();
                let arriving = through_glass::arrive(self.prepared, set.ways(), vpl, at, &mut cost);
                rays += cost.compensation_rays;
                if let Some(Arriving { from, irradiance, .. }) = arriving {
                    radiance = material.lobe(normal, to, from) * irradiance * stands_for;
                }
            }
        }
        if self.prepared.emitters.any_bodiless() && !set.photons.is_empty() {
            let lobe = |photon: &Photon| match photon.shines_on {
                true => material.lobe(normal, to, photon.from),
                false => Vec3::ZERO,
            };
            radiance += set.photons.gather(at.position, at.smooth, lobe);
        }
        (radiance, rays)
    }

    /// Radiance that a sharp lobe has from light samples by way of a flat mirror: one image is chosen by what it would bring,
    /// and looked at. The number of rays.
    fn light_mirrored(&self, at: &Surfel, material: &Glossy, to: Vec3, u: f32) -> (Rgb, u64) {
        const NOTHING: (Rgb, u64) = (Vec3::ZERO, 0);
        let (prepared, shares) = (self.prepared, self.shares);
        let Some(set) = self.set.filter(|set| !set.images.is_empty()) else { return NOTHING };
        if !material.is_sharp() || !shares.has_samples(material.widest()) {
            return NOTHING;
        }
        let bring = |image: &Image| match prepared.mirrors.shows(image, at.position) {
            true => shares.reflected(material, at.shading, to, &image.seen, at.position, Gate::Open),
            false => Vec3::ZERO,
        };
        let Some(Chosen { sample: image, brings, stands_for }) = Self::choose_among(set.images.iter(), bring, u) else {
            return NOTHING;
        };
        let direction = image.seen.towards(at.position);
        if at.geometric.dot(direction) <= 0.0 {
            return NOTHING;
        }
        let ray = Ray { origin: at.off(direction), direction, t_max: f32::INFINITY };
        let Some(hit) = prepared.world.closest(&ray).filter(|hit| prepared.mirrors.plane_of(hit) == Some(image.plane))
        else {
            return (Vec3::ZERO, 1);
        };
        let mirror = prepared.surfel(&ray, &hit);
        let scatter = mirror.scatter(&prepared.scene);
        let [Some(bounce), None] = scatter.branches(&mirror, direction, Carries::Radiance, [0.0; 2]) else {
            return (Vec3::ZERO, 1);
        };
        match prepared.sees(&set.vpls[image.of as usize], bounce.origin) {
            true => (brings * bounce.weight * stands_for, 2),
            false => (Vec3::ZERO, 2),
        }
    }
}

/// A light sample, or its image, that was chosen among those of a set.
struct Chosen<'a, T> {
    sample: &'a T,
    /// What it would bring.
    brings: Rgb,
    /// One over the probability of the choice.
    stands_for: f32,
}

/// Sequence of the choice among light samples in chains, one number a vertex.
const LIGHT: u32 = 0x6c69;

impl Sight {
    /// Walks on from a specular surface until something scatters light or nothing is left.
    fn follow(
        &mut self,
        around: Around,
        mut leg: Leg,
        mut bounce: Bounce,
        sequence: &Sequence,
        index: u32,
        first_group: u32,
    ) -> Option<EndPoint> {
        let Around { prepared, shares, set, .. } = around;
        let samples = (prepared, set.map(|set| &*set.light_choice));
        for vertex in 0..chain::LONGEST {
            let ray = Ray { origin: bounce.origin, direction: bounce.direction, t_max: f32::INFINITY };
            self.rays += 1;
            let Some(hit) = prepared.world.closest(&ray) else {
                match (leg.lobe, samples) {
                    (Some(lobe), (_, Some(choice))) => {
                        for (radiance, share) in shares.of_sky((prepared, choice), lobe.density, ray.direction) {
                            self.emitted += leg.throughput * radiance * share;
                        }
                    }
                    _ => {
                        self.emitted += leg.throughput * prepared.emitters.sky_radiance(&prepared.scene, ray.direction)
                    }
                }
                return None;
            };
            let at = prepared.surfel(&ray, &hit);
            leg.distance += hit.t;
            leg.throughput *= prepared.left(leg.medium, &at, ray.direction, hit.t);
            let emission = at.emission(&prepared.scene);
            if emission != Vec3::ZERO {
                let share = leg.lobe.map_or(1.0, |lobe| {
                    let whole = Hit { t: lobe.before + hit.t, ..hit };
                    shares.of_emitter(samples, lobe.density, &ray, &whole, &at)
                });
                self.emitted += leg.throughput * emission * share;
            }
            let u = sequence.point(first_group + vertex, index);
            let (at, scatter) = at.scatter(&prepared.scene).side(at, u[1]);
            let next = match scatter {
                Scatter::Diffuse { albedo } => return leg.end(at, albedo),
                Scatter::Glossy(material) if material.is_sharp() => {
                    let base = material.diffuse_albedo().max_element();
                    let [choice] = sequence.with(LIGHT).first(first_group + vertex, index);
                    for (light, rays) in [
                        around.light_lobe(&at, &material, -ray.direction, choice),
                        around.light_mirrored(&at, &material, -ray.direction, choice),
                    ] {
                        self.emitted += leg.throughput * light;
                        self.rays += rays;
                    }
                    let shine = || material.lobe_albedo(at.shading.dot(-ray.direction).max(0.0)).max_element();
                    let p = if base > 0.0 { share(shine(), base) } else { 1.0 };
                    if u[1] >= p {
                        return leg.end_glossy(around, at, &material, -ray.direction, (1.0 - p, false));
                    }
                    let bounce = lobe(&at, ray.direction, &material, [u[2], u[3]])?;
                    let bounce = Bounce { weight: bounce.weight / p, ..bounce };
                    leg = leg.after_lobe(around, &bounce, &at, &material, ray.direction);
                    bounce
                }
                Scatter::Glossy(material) => {
                    return leg.end_glossy(around, at, &material, -ray.direction, (1.0, true));
                }
                specular => {
                    if let Scatter::Frosted(frosted) = &specular {
                        let [choice] = sequence.with(LIGHT).first(first_group + vertex, index);
                        let (light, rays) = around.light_frosted(&at, frosted, -ray.direction, choice, Ways::Either);
                        self.emitted += leg.throughput * light;
                        self.rays += rays;
                    }
                    let bounce = specular.branch(&at, ray.direction, Carries::Radiance, u[1], [u[2], u[3]])?;
                    leg = leg.after_specular(around, &bounce, (&hit, &at), (&specular, Ways::Either), ray.direction);
                    bounce
                }
            };
            if vertex >= FREE_BOUNCES {
                let q = leg.throughput.max_element().clamp(0.0, chain::most(vertex));
                if u[0] >= q {
                    return None;
                }
                leg.throughput /= q;
            }
            bounce = next;
        }
        None
    }
}

/// What one of two is of both.
fn share(one: f32, other: f32) -> f32 {
    one / (one + other)
}

/// One direction of a sharp lobe.
fn lobe(at: &Surfel, incoming: Vec3, material: &Glossy, u: [f32; 2]) -> Option<Bounce> {
    let (direction, weight) = material.sample(at.shading, -incoming, u)?;
    (at.geometric.dot(direction) > 0.0).then(|| Bounce {
        origin: at.off(direction),
        direction,
        weight,
        reflected: true,
    })
}
