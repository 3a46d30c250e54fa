//! Caustic photons: flux that emitters send through mirrors and glass (IGI-4), and how photons share that light with
//! rays from the other end.
//!
//! # Two ways to find the same light
//! A photon leaves an emitter, passes specular surfaces, and lies where it first meets a diffuse one; it is found by all
//! who look within its radius. A gather ray from a diffuse point ([`crate::bias_compensation`]) passes specular surfaces and
//! may meet an emitter. Photons find what is small and bright, with an error that shrinks like N^(−2/3) at best, because
//! their radius must go to 0; rays find large emitters, with an error like 1/N. So each path counts partly on either
//! way, by the balance heuristic (vertex connection and merging: Georgiev et al. 2012, eq. 9; Hachisuka et al. 2012).
//!
//! Along a specular chain étendue dA cosθ dω is conserved. With D the density of photon paths per étendue where they
//! leave (a point's density on the emitter × a direction's / cosθ), a set of N photons finds a path at x with density
//! N πr² D cosθ_x, a cosine-distributed ray with density cosθ_x/π. So photons count by `R/(1+R)`, rays by `1/(1+R)`,
//! with `R = N πr² π D`: the same number at both ends, whatever lies between. As the radius shrinks, rays take over,
//! and a photon's weight over its area stays bounded.
//!
//! Where a path passes glass and is never reflected, light samples find it as well ([`crate::through_glass`]): λ of them
//! for each ray. Then photons count by `R/(1+R+λ)`, rays by `1/(1+R+λ)`, light samples by `λ/(1+R+λ)`.

use std::f32::consts::PI;

use glam::Vec3;
use protocol::answer::Cost;
use protocol::question::Quality;
use scenes::Rgb;

use crate::aims::{Aims, Choice, Entry, Part, density_through};
use crate::bvh::{Hit, Ray};
use crate::chain;
use crate::footprint::concentration;
use crate::glossy::Glossy;
use crate::photons::{Photon, PhotonMap};
use crate::prepared::Prepared;
use crate::sample::Sequence;
use crate::surface::{Bounce, Carries, Scatter, Surfel};
use crate::targets::{Cones, Nested};
use crate::through_glass;
use crate::vpl::{Shape, Vpl};
use crate::walk::slant;
use crate::warp;

/// Who finds how much of the light that emitters send through specular surfaces.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sharing {
    /// N πr² π: photons for each ray, per unit of the density of photon paths. `None` if no rays look for emitters.
    merges: Option<f32>,
    /// π n: light samples for each ray, per unit of the density of directions to lights over cosθ_x; 0 if they are not looked
    /// for through glass.
    samples: f32,
}

impl Sharing {
    /// Between so many photons of a set, with their radius, and the rays of its pixels.
    pub fn new(quality: &Quality, photons: u32, radius: f32) -> Self {
        let merges = photons as f32 * (PI * radius) * (PI * radius);
        let samples = PI * f32::from(quality.light_samples);
        let is_shared = quality.indirect_caustics;
        Self { merges: is_shared.then_some(merges), samples: if is_shared { samples } else { 0.0 } }
    }

    /// π n, as above.
    pub fn samples(self) -> f32 {
        self.samples
    }

    /// What rays count that meet an emitter which photons leave with a density of `density` per étendue, 0..=1; for each of
    /// them there are `aimed` light samples.
    pub fn of_rays(self, density: f32, aimed: f32) -> f32 {
        self.merges.map_or(0.0, |merges| 1.0 / (1.0 + merges * density + aimed))
    }

    /// What photons count that left with a density of `density` per étendue; `None` if no ray can find their emitter.
    pub fn of_photons(self, density: Option<f32>, aimed: f32) -> f32 {
        match density {
            Some(density) => 1.0 - (1.0 + aimed) * self.of_rays(density, aimed),
            // Light samples find all of it or nothing.
            None => 1.0 / (1.0 + aimed),
        }
    }

    /// What light samples count, of which there are `aimed` for each ray.
    pub fn of_samples(self, density: f32, aimed: f32) -> f32 {
        aimed * self.of_rays(density, aimed)
    }
}

/// All that the ways to find light through specular surfaces have to agree on.
#[derive(Clone, Copy, Debug)]
pub struct Ways<'a> {
    /// Who finds how much.
    pub sharing: Sharing,
    /// How photons leave emitters.
    pub photons: &'a Aims,
    /// How light samples are chosen.
    pub samples: &'a Choice,
}

/// Shoots so many photons of a set, with their radius. The map, and the segments traced.
pub fn shoot(
    prepared: &Prepared,
    ways: Ways,
    (count, radius): (u32, f32),
    sequence: &Sequence,
    block: u32,
) -> (PhotonMap, u64) {
    let mut photons = Vec::new();
    let mut rays = 0;
    for i in 0..count {
        let index = block.wrapping_mul(count).wrapping_add(i);
        let flight = fly(prepared, ways, sequence, index);
        rays += flight.rays;
        if let Some(Landed { photon, density, aimed }) = flight.landed {
            let share = ways.sharing.of_photons(density, aimed) / count as f32;
            let about = sequence.with(FOOTPRINT).with(index);
            let flux = photon.flux * (share * concentration(prepared, &photon, radius, &about, &mut rays));
            photons.push(Photon { flux, ..photon });
        }
    }
    (PhotonMap::new(photons, radius), rays)
}

/// What became of a photon.
pub struct Flight {
    /// Where it lies; `None` if it is lost, or all of its light is found in other ways.
    pub landed: Option<Landed>,
    /// The emitter's source that it left ([`Vpl::source`]).
    pub source: u32,
    /// Segments traced.
    pub rays: u64,
}

/// A photon that has arrived.
pub struct Landed {
    /// With all of its flux.
    pub photon: Photon,
    /// Density per étendue of such photons where it left; `None` where chance never meets the light.
    pub density: Option<f32>,
    /// Light samples for each ray that finds the same light.
    pub aimed: f32,
}

/// A photon as it leaves an emitter.
struct Departure {
    origin: Vec3,
    /// Unit.
    direction: Vec3,
    flux: Rgb,
    /// Density of such photons per étendue; `None` where chance never meets the light.
    density: Option<f32>,
}

/// Probability that a photon which may be seen on frosted glass ([`Photon::shines_on`]) passes or leaves it all the same.
const FROSTED_SHARE: f32 = 0.75;

/// Tells the numbers by which a photon's disc is looked at from those of its way.
const FOOTPRINT: u32 = 0x6670;

/// Dimensions of one vertex: a group for the way on, one for choices.
const GROUPS_PER_VERTEX: u32 = 2;

/// Traces one photon from a light through specular surfaces to the first diffuse one, where it stays.
pub fn fly(prepared: &Prepared, ways: Ways, sequence: &Sequence, index: u32) -> Flight {
    let aims = ways.photons;
    let mut flight = Flight { landed: None, source: 0, rays: 0 };
    let choice = sequence.point(0, index);
    let way = sequence.point(1, index);
    let sampled = prepared.emitters.sample_with_density(&prepared.scene, &aims.choice, Part::Any, choice);
    let Some((light, density)) = sampled else { return flight };
    flight.source = light.source;
    let Some(departure) = aim(prepared, &aims.entry, &light, density, way) else { return flight };
    let Departure { mut origin, mut direction, mut flux, density } = departure;
    // Eye paths end at the sharp gloss that light meets first, if no ray can meet the light itself.
    let mut shines_on = density.is_none();
    let mut glass = Glass::default();
    let mut medium = None;
    for vertex in 1..chain::LONGEST {
        let ray = Ray { origin, direction, t_max: f32::INFINITY };
        flight.rays += 1;
        let Some(hit) = prepared.world.closest(&ray) else { return flight };
        let at = prepared.surfel(&ray, &hit);
        flux *= prepared.left(medium, &at, direction, hit.t);
        let way = sequence.point(GROUPS_PER_VERTEX * vertex, index);
        let choice = sequence.point(GROUPS_PER_VERTEX * vertex + 1, index);
        let scatter = at.scatter(&prepared.scene);
        let bounce = match &scatter {
            Scatter::Glossy(material) => {
                let share = sharp_share(material, at.shading.dot(-direction), shines_on);
                if choice[1] < share {
                    let bounce = sharp_bounce(&at, direction, material, share, [way[2], way[3]]);
                    if bounce.is_none() {
                        return flight;
                    }
                    shines_on = false;
                    bounce
                } else {
                    flux /= 1.0 - share;
                    None
                }
            }
            Scatter::Frosted(frosted) => {
                // Eye paths have light samples here of what comes straight.
                let share = if shines_on && vertex > 1 { FROSTED_SHARE } else { 1.0 };
                if choice[1] < share {
                    shines_on = false;
                    let facet = [way[2], way[3]];
                    let bounce = frosted.sample(&at, direction, Carries::Flux, choice[1] / share, facet);
                    let Some(bounce) = bounce else { return flight };
                    Some(Bounce { weight: bounce.weight / share, ..bounce })
                } else {
                    flux /= 1.0 - share;
                    None
                }
            }
            other => other.branch(&at, direction, Carries::Flux, choice[1], [way[2], way[3]]),
        };
        let Some(bounce) = bounce else {
            let stays = vertex > 1 && !matches!(scatter, Scatter::Mirror { .. } | Scatter::Glass { .. });
            if !stays {
                return flight;
            }
            let mut cost = Cost::default();
            let aimed = match (density, glass) {
                (Some(_), Glass { passed: true, .. }) => {
                    through_glass::aimed(prepared, ways, &at, -direction, &mut cost)
                }
                (None, Glass { passed: true, thin: true }) if ways.sharing.samples() > 0.0 => f32::INFINITY,
                _ => 0.0,
            };
            flight.rays += cost.shadow_rays;
            let flux = flux * slant(&at, direction);
            let photon = Photon { position: at.position, normal: at.smooth, from: -direction, flux, shines_on };
            flight.landed =
                (ways.sharing.of_photons(density, aimed) > 0.0).then_some(Landed { photon, density, aimed });
            return flight;
        };
        let q = bounce.weight.max_element().clamp(0.0, chain::most(vertex));
        if choice[0] >= q {
            return flight;
        }
        glass.meet(&scatter, &bounce);
        flux *= bounce.weight / q;
        medium = prepared.medium(&at, bounce.direction);
        (origin, direction) = (bounce.origin, bounce.direction);
    }
    flight
}

/// What a path has met on its way.
#[derive(Clone, Copy, Debug)]
pub struct Glass {
    /// It has passed glass alone, and was never reflected.
    pub passed: bool,
    /// All glass was thin.
    pub thin: bool,
}

impl Default for Glass {
    /// Nothing.
    fn default() -> Self {
        Self { passed: true, thin: true }
    }
}

impl Glass {
    /// The path goes on like this from a surface.
    pub fn meet(&mut self, scatter: &Scatter, bounce: &Bounce) {
        self.passed &= matches!(scatter, Scatter::Glass { .. }) && !bounce.reflected;
        self.thin &= matches!(scatter, Scatter::Glass { thin: true, .. });
    }
}

/// Probability that a photon follows the lobe of a glossy surface like a mirror; 0 for rough ones. One that shines on
/// sharp lobes ([`Photon::shines_on`]) is wanted where nothing is under the lobe as well.
fn sharp_share(material: &Glossy, cos: f32, shines_on: bool) -> f32 {
    if !material.is_sharp() {
        return 0.0;
    }
    if material.diffuse_albedo() == Vec3::ZERO {
        return if shines_on { 0.75 } else { 1.0 };
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

/// Share of photons that are aimed at specular objects, where any can be seen.
fn aimed(any: bool) -> f32 {
    if any { 0.85 } else { 0.0 }
}

/// How photons leave a light that lies somewhere: its own way, and by cones around specular objects; from within glass also by
/// ones around what is looked at, for most of what encases lamps bends light little, and what is seen may be small.
struct Departures {
    targets: Cones,
    view: Option<Nested>,
}

/// Share of photons that go about the way to what is looked at, from within glass. More: less of what is small and far escapes
/// them; of what the glass throws there by detours, more does.
const TOWARDS_VIEW: f32 = 0.75;

impl Departures {
    fn of(prepared: &Prepared, entry: &Entry, light: &Vpl) -> Self {
        let view = entry.part().and_then(|part| prepared.targets.view_from_within(light, &part));
        Self { targets: prepared.targets.seen_from(light), view }
    }

    fn sample(&self, light: &Vpl, choice: f32, u: [f32; 2]) -> Vec3 {
        let mut rest = choice;
        if let Some(view) = &self.view {
            if rest < TOWARDS_VIEW {
                return view.sample(rest / TOWARDS_VIEW, u);
            }
            rest = (rest - TOWARDS_VIEW) / (1.0 - TOWARDS_VIEW);
        }
        let aimed = aimed(!self.targets.is_empty());
        if rest < aimed { self.targets.sample(rest / aimed, u) } else { own_direction(light, u) }
    }

    /// Of [`Self::sample`], sr⁻¹.
    fn density(&self, light: &Vpl, direction: Vec3) -> f32 {
        let aimed = aimed(!self.targets.is_empty());
        let usual = aimed * self.targets.density(direction) + (1.0 - aimed) * own_density(light, direction);
        match &self.view {
            Some(view) => TOWARDS_VIEW * view.density(direction) + (1.0 - TOWARDS_VIEW) * usual,
            None => usual,
        }
    }
}

/// Sends light on its way, mostly towards specular objects. Its flux is intensity over the density of all ways that it may
/// take there.
fn aim(prepared: &Prepared, entry: &Entry, light: &Vpl, density: Option<f32>, u: [f32; 4]) -> Option<Departure> {
    if light.shape == Shape::Distant {
        return Some(aim_from_afar(prepared, entry, light, density, u));
    }
    let departures = Departures::of(prepared, entry, light);
    let direction = departures.sample(light, u[2], [u[0], u[1]]);
    let chosen = departures.density(light, direction);
    let flux = light.intensity(direction) / chosen;
    let density = density.map(|density| density * chosen / light.normal.dot(direction).max(f32::MIN_POSITIVE));
    (chosen > 0.0 && flux.is_finite() && flux != Vec3::ZERO).then_some(Departure {
        origin: light.position,
        direction,
        flux,
        density,
    })
}

/// A direction of light that leaves a light by itself.
pub fn own_direction(light: &Vpl, u: [f32; 2]) -> Vec3 {
    match &light.shape {
        Shape::Point => warp::sphere(u),
        Shape::Spot { axis, cos_outer, .. } => warp::cone(*axis, 1.0 - cos_outer, u),
        Shape::Luminaire(lamp) => lamp.sample(u),
        Shape::Surface | Shape::Glossy { .. } | Shape::Distant => warp::cosine(light.normal, u),
    }
}

/// Of [`own_direction`], sr⁻¹.
pub fn own_density(light: &Vpl, direction: Vec3) -> f32 {
    match &light.shape {
        Shape::Point => warp::SPHERE_DENSITY,
        Shape::Luminaire(lamp) => lamp.density(direction),
        Shape::Spot { axis, cos_outer, .. } => {
            if axis.dot(direction) >= *cos_outer {
                warp::cone_density(1.0 - cos_outer)
            } else {
                0.0
            }
        }
        Shape::Surface | Shape::Glossy { .. } | Shape::Distant => warp::cosine_density(light.normal.dot(direction)),
    }
}

/// Parallel light enters as all light from afar does, and through a disc for each specular object.
fn aim_from_afar(prepared: &Prepared, entry: &Entry, light: &Vpl, density: Option<f32>, u: [f32; 4]) -> Departure {
    let balls = prepared.targets.balls();
    let aimed = aimed(!balls.is_empty());
    let towards = light.normal;
    let origin = if u[2] < aimed {
        let chosen = balls[((u[2] / aimed * balls.len() as f32) as usize).min(balls.len() - 1)];
        entry.through(chosen, towards, [u[0], u[1]])
    } else {
        entry.sample(towards, [u[0], u[1], u[3]])
    };
    let chosen = density_of_entry(prepared, entry, origin, towards);
    Departure {
        origin,
        direction: -towards,
        flux: light.strength / chosen,
        density: density.map(|density| density * chosen),
    }
}

/// Density of [`aim_from_afar`] among the rays that come from one direction: per unit area across it.
fn density_of_entry(prepared: &Prepared, entry: &Entry, origin: Vec3, towards: Vec3) -> f32 {
    let balls = prepared.targets.balls();
    let aimed = aimed(!balls.is_empty());
    let parts: f32 = balls.iter().map(|ball| density_through(*ball, origin, towards)).sum();
    (1.0 - aimed) * entry.density(origin, towards) + aimed * parts / balls.len().max(1) as f32
}

/// Density per étendue with which photons leave an emitter towards where a ray that met it comes from.
pub fn density_at_emitter(prepared: &Prepared, ways: Ways, ray: &Ray, hit: &Hit, at: &Surfel) -> f32 {
    let (position, normal) = (at.above(), at.geometric);
    let (strength, shape) = (Vec3::ONE, Shape::Surface);
    let emitter = Vpl { position, normal, strength, shape, depth: 0, source: 0, density: None };
    let area = prepared.emitters.density(&prepared.scene, &ways.photons.choice, hit.object, hit.triangle);
    let departures = Departures::of(prepared, &ways.photons.entry, &emitter);
    let direction = departures.density(&emitter, -ray.direction);
    area * direction / normal.dot(-ray.direction).max(f32::MIN_POSITIVE)
}

/// Radiance that a ray meets which leaves the scene, of sky and suns each, and the density per étendue with which photons come
/// from there.
pub fn seen_afar(prepared: &Prepared, ways: Ways, ray: &Ray) -> impl Iterator<Item = (Rgb, f32)> {
    let seen = prepared.emitters.seen_afar(&prepared.scene, &ways.photons.choice, ray.direction);
    let entry = move || density_of_entry(prepared, &ways.photons.entry, ray.origin, ray.direction);
    seen.map(move |(radiance, direction)| (radiance, direction * entry()))
}

#[cfg(test)]
mod tests {
    use scenes::{Colour, Environment, Material, Mesh, Object, Scene};

    use super::*;
    use crate::targets::Ball;

    /// An emitter of two triangles that shines down, and perhaps a sky; two small mirrors on the ground.
    fn scene(environment: Environment, emits_both_sides: bool) -> Scene {
        let mut mesh = Mesh::default();
        let mut triangle = |corners: [Vec3; 3], material| {
            let first = mesh.positions.len() as u32;
            mesh.positions.extend(corners);
            mesh.triangles.push([first, first + 1, first + 2]);
            mesh.materials.push(material);
        };
        triangle([Vec3::Y, Vec3::Y + Vec3::X, Vec3::Y + Vec3::Z], 0);
        triangle([Vec3::Y, Vec3::Y + Vec3::Z * 0.5, Vec3::Y - Vec3::X], 0);
        for place in [Vec3::X * 0.4, Vec3::Z * -0.7] {
            triangle([place, place + Vec3::Z * 0.3, place + Vec3::X * 0.2], 1);
        }
        let emitter =
            Material { emission: Colour::plain(Vec3::ONE), emits_both_sides, ..Material::diffuse("lamp", Vec3::ZERO) };
        let surface = scenes::Surface::Mirror { reflectance: Vec3::ONE };
        let mirror = Material { surface, ..Material::diffuse("mirror", Vec3::ZERO) };
        Scene {
            meshes: vec![mesh.into()],
            objects: vec![Object::fixed("all", 0)],
            materials: vec![emitter, mirror],
            environment,
            ..Scene::default()
        }
    }

    fn random(i: u32, salt: u32) -> [f32; 4] {
        std::array::from_fn(|d| (crate::sample::mix(i * 8 + salt * 4 + d as u32) >> 8) as f32 / 16_777_216.0)
    }

    /// A ray that comes to an emitter or leaves for the sky finds the density with which photons go its way.
    #[test]
    fn both_ends_of_a_path_agree_on_its_density() {
        for (environment, both_sides) in
            [(Environment::Black, false), (Environment::Black, true), (Environment::Constant(Vec3::ONE), false)]
        {
            let prepared = Prepared::new(scene(environment, both_sides));
            let part = Ball { centre: Vec3::X * 0.4, radius: 0.4 };
            let choice = Choice::new(&[1.0, 3.0][..prepared.emitters.count()]);
            let aims = Aims { choice, entry: Entry::mostly(prepared.ball, part, 0.5), at_panes: 0.0 };
            assert!(aims.entry.part().is_some());
            let ways = Ways { sharing: Sharing::default(), photons: &aims, samples: &aims.choice };
            let mut seen = [0, 0];
            for i in 0..2_000 {
                let sampled =
                    prepared.emitters.sample_with_density(&prepared.scene, &aims.choice, Part::Any, random(i, 0));
                let (light, density) = sampled.expect("something shines");
                let Some(departure) = aim(&prepared, &aims.entry, &light, density, random(i, 1)) else { continue };
                let expected = departure.density.expect("rays can meet both lamp and sky");
                let direction = -departure.direction;
                let (found, kind) = if light.shape == Shape::Distant {
                    // From somewhere along the photon's way; what lies on it is no matter here.
                    let origin = departure.origin + departure.direction * 1.5;
                    let ray = Ray { origin, direction, t_max: f32::INFINITY };
                    (seen_afar(&prepared, ways, &ray).map(|(_, density)| density).sum(), 1)
                } else {
                    let origin = departure.origin + departure.direction * 0.05;
                    let ray = Ray { origin, direction, t_max: f32::INFINITY };
                    let hit = prepared.world.closest(&ray).expect("the lamp it came from");
                    (density_at_emitter(&prepared, ways, &ray, &hit, &prepared.surfel(&ray, &hit)), 0)
                };
                seen[kind] += 1;
                assert!((found / expected - 1.0).abs() < 1e-2, "photon {i}: {expected} left, {found} came");
            }
            assert!(seen[0] > 200 && (seen[1] > 200) == (environment != Environment::Black), "{seen:?}");
        }
    }

    #[test]
    fn shares_make_one_and_are_whole_where_only_one_can_find_the_light() {
        let quality = Quality::default();
        let sharing = Sharing::new(&quality, 500, 0.01);
        for density in [0.0, 1e-6, 1.0, 1e6, f32::INFINITY] {
            for aimed in [0.0, 1e-3, 1.0, 1e5] {
                let (rays, photons) = (sharing.of_rays(density, aimed), sharing.of_photons(Some(density), aimed));
                let samples = sharing.of_samples(density, aimed);
                let all = [rays, photons, samples];
                assert!(
                    (all.iter().sum::<f32>() - 1.0).abs() < 1e-6 && all.iter().all(|share| *share >= 0.0),
                    "{all:?}"
                );
            }
        }
        assert_eq!(sharing.of_photons(None, 0.0), 1.0, "no ray meets a point");
        assert_eq!(sharing.of_photons(None, f32::INFINITY), 0.0, "light samples find it through panes");
        let none = Sharing::new(&quality, 0, 0.01);
        assert_eq!(none.of_rays(3.0, 0.0), 1.0, "no photons are shot");
        let direct = Sharing::new(&Quality { indirect_caustics: false, ..quality }, 500, 0.01);
        assert_eq!((direct.of_rays(3.0, 0.0), direct.of_photons(Some(3.0), 0.0)), (0.0, 1.0), "no rays look for lamps");
        assert_eq!(direct.samples(), 0.0, "nor do light samples");
    }
}
