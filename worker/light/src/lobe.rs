//! Who finds the light of a glossy lobe: virtual lights, or a ray that follows it.
//!
//! Alone, virtual lights are too few for a narrow lobe, and rays miss small lamps. So both look, and each path counts
//! partly on either way, by the balance heuristic (Veach 1997, section 9.2): a function of the path alone, in which the
//! densities are nominal.
//!
//! * Points on **emitters** and directions of the **sky**: n p against p_lobe, n being the light samples of a set
//!   times what they are worth ([`crate::lobe_pilot`]), p the density of one ([`Vpl::density`]), and p_lobe that of the ray's
//!   direction ([`Glossy::density`]).
//! * **Lights without surface**: virtual lights alone.
//! * Light off **surfaces**: virtual lights lie there with about b to the unit of area, so they count
//!   `b / (b + p_lobe cosθ_y / d²)`. Since `p_lobe` is about f cosθ_x, that bounds what one of them may bring by the lobe,
//!   f G ≤ b (Kollig & Keller 2004 bound G alone), and what lies beyond is left to the ray (Dammertz et al. 2010): almost
//!   all in narrow lobes, little in wide ones.
//!
//! A lobe that is followed like a mirror ([`Glossy::is_sharp`]) has all light off surfaces from its ray.

use glam::Vec3;
use protocol::question::Quality;
use scenes::Rgb;

use crate::aims::Choice;
use crate::bvh::{Hit, Ray};
use crate::frosted::{Frosted, Ways};
use crate::glossy::Glossy;
use crate::prepared::Prepared;
use crate::surface::Surfel;
use crate::vpl::{Gate, Gates, Vpl};
use crate::walk::LightSet;

/// How virtual lights and rays share the light of lobes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Shares {
    /// Rays follow rough lobes too, and light samples are made for sharp ones.
    both: bool,
    /// n, times what they are worth.
    samples: f32,
    /// b, length⁻²; infinite where virtual lights have no bound.
    bound: f32,
}

/// Narrower lobes have next to nothing from light samples, which are not worth their shadow rays: α.
const NARROW: f32 = 0.02;
/// Virtual lights of a set to the square of the distance within which they are bounded, in a room ten such distances wide.
const LIGHTS_PER_SQUARE: f32 = 1.0 / 200.0;

impl Shares {
    /// With the number of a set's lights, what they count, and their bound; without [`Quality::bias_compensation`] no ray
    /// follows rough lobes.
    pub fn new(quality: &Quality, set: &LightSet, gates: Gates) -> Self {
        let bound = match gates.surfaces {
            Gate::Open => f32::INFINITY,
            Gate::Clip { least } => 1.0 / least,
            Gate::Bound { most } => most,
            Gate::Smooth { middle } => 1.0 / middle,
        };
        Self {
            both: quality.bias_compensation,
            samples: f32::from(quality.light_samples) * set.worth_to_lobes,
            bound: bound * f32::from(quality.vpls) * LIGHTS_PER_SQUARE,
        }
    }

    /// Rays follow rough lobes too.
    pub fn follow_rough(&self) -> bool {
        self.both
    }

    /// Points on emitters and directions of the sky are found by light samples as well as by rays, for a lobe of this α.
    pub fn has_samples(&self, alpha: f32) -> bool {
        self.both && self.samples > 0.0 && alpha >= NARROW
    }

    /// What frosted glass sends towards `to` of a light sample that nothing hides: radiance. The ray that is followed from
    /// there has one density for each of its `ways`.
    pub fn scattered(&self, frosted: &Frosted, at: &Surfel, to: Vec3, vpl: &Vpl, ways: Ways) -> Rgb {
        if !vpl.is_bodiless() && !self.has_samples(frosted.facets.alpha()) {
            return Vec3::ZERO;
        }
        let normal = if at.shading.dot(vpl.towards(at.position)) < 0.0 { -at.shading } else { at.shading };
        let (irradiance, from) = vpl.irradiance(at.position, normal, Gate::Open);
        if irradiance == Vec3::ZERO {
            return Vec3::ZERO;
        }
        let (value, density) = frosted.value_and_density(at, to, from, ways);
        let d2 = vpl.position.distance_squared(at.position);
        let (mine, rays) = self.of_sample(vpl, -vpl.normal.dot(from), d2, density);
        value * irradiance * share(mine, rays)
    }

    /// Densities of a light sample and of a ray with a given density that may find the same light, up to one factor.
    fn of_sample(&self, vpl: &Vpl, cos: f32, d2: f32, density: f32) -> (f32, f32) {
        match vpl.density {
            Some(sky) if vpl.is_distant() => (self.samples * sky, density),
            Some(area) => (self.samples * area * d2 / cos.max(f32::MIN_POSITIVE), density),
            None => (1.0, 0.0),
        }
    }

    /// What the lobe at a point reflects towards `to` of a virtual light that nothing hides: radiance.
    pub fn reflected(&self, material: &Glossy, n: Vec3, to: Vec3, vpl: &Vpl, at: Vec3, gate: Gate) -> Rgb {
        let sharp = material.is_sharp();
        if vpl.is_bodiless() || !self.both {
            if sharp && !vpl.is_bodiless() {
                return Vec3::ZERO;
            }
            let (irradiance, from) = vpl.irradiance(at, n, gate);
            return material.lobe(n, to, from) * irradiance;
        }
        if if vpl.depth == 0 { !self.has_samples(material.widest()) } else { sharp } {
            return Vec3::ZERO;
        }
        let (irradiance, from) = vpl.irradiance(at, n, Gate::Open);
        if irradiance == Vec3::ZERO {
            return Vec3::ZERO;
        }
        let (value, density) = material.lobe_and_density(n, to, from);
        let d2 = vpl.position.distance_squared(at);
        let cos = -vpl.normal.dot(from);
        // By fractions of their own: one less the ray's would be all rounding where next to nothing is left.
        let (mine, rays) = match vpl.depth {
            0 => self.of_sample(vpl, cos, d2, density),
            _ if self.bound == f32::INFINITY => (1.0, 0.0),
            _ => (self.bound * d2, density * cos.abs()),
        };
        value * irradiance * share(mine, rays)
    }

    /// What a ray counts that follows the lobe with some density and finds light off a surface, whose cosine there is given.
    pub fn of_surface(&self, density: f32, cos: f32, d2: f32) -> f32 {
        if self.bound == f32::INFINITY {
            return 0.0;
        }
        let by_ray = density * cos.abs();
        if by_ray > 0.0 { by_ray / (by_ray + self.bound * d2) } else { 0.0 }
    }

    /// What it counts if it meets an emitter, beside light samples of a choice.
    pub fn of_emitter(
        &self,
        (prepared, choice): (&Prepared, Option<&Choice>),
        density: f32,
        ray: &Ray,
        hit: &Hit,
        at: &Surfel,
    ) -> f32 {
        let Some(choice) = choice else { return 1.0 };
        let area = prepared.emitters.density(&prepared.scene, choice, hit.object, hit.triangle);
        let cos = at.geometric.dot(ray.direction).abs().max(f32::MIN_POSITIVE);
        self.of_emission(density, area * hit.t * hit.t / cos)
    }

    /// Radiance that it meets if it leaves for the sky, of sky and suns each, and what that counts beside light samples of
    /// a choice.
    pub fn of_sky(
        self,
        (prepared, choice): (&Prepared, &Choice),
        density: f32,
        direction: Vec3,
    ) -> impl Iterator<Item = (Rgb, f32)> {
        let seen = prepared.emitters.seen_afar(&prepared.scene, choice, direction);
        seen.map(move |(radiance, sample)| (radiance, self.of_emission(density, sample)))
    }

    /// Beside light samples of so great a density each, sr⁻¹.
    fn of_emission(&self, density: f32, sample: f32) -> f32 {
        let both = density + self.samples * sample;
        if both > 0.0 { (density / both).min(1.0) } else { 0.0 }
    }
}

/// What one way counts beside another.
fn share(mine: f32, rays: f32) -> f32 {
    if mine.is_finite() { mine / (mine + rays) } else { 1.0 }
}
