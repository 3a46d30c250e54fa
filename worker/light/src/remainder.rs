//! What the bound cut off, estimated without bias by one short ray (B1).
//!
//! With the gate g on virtual lights, `∫ f L V G dA = ∫ f L V G g dA + ∫ f L cosθ (1−g) dω`. The sum
//! over virtual lights estimates the first term; a direction from the BSDF the second. Only what lies
//! within [`crate::vpl::Gate::reach`] has g < 1, so the ray is short and mostly meets nothing. What it
//! meets shines with just the light that gated virtual lights stood for: emission, light reflected
//! diffusely (their own irradiance gated, caustics, and their own remainder, iterated).

use glam::Vec3;
use protocol::answer::Cost;
use scenes::Rgb;

use crate::bvh::Ray;
use crate::prepared::Prepared;
use crate::sample::Sequence;
use crate::surface::{Scatter, Surfel};
use crate::vpl::{Gate, scattered};
use crate::walk::LightSet;
use crate::warp;

/// Where the estimate is made, and what it may use.
pub struct Remainder<'a> {
    /// The scene.
    pub prepared: &'a Prepared,
    /// Its light.
    pub set: &'a LightSet,
    /// The gate on its virtual lights.
    pub gate: Gate,
    /// Longest light path, surface vertices.
    pub max_length: Option<u8>,
}

impl Remainder<'_> {
    /// A cosine-distributed direction at `x` and the cut-off radiance from there:
    /// `E ≈ π · radiance`. Nothing if the direction brings none.
    pub fn sample(
        &self,
        x: &Surfel,
        sequence: &Sequence,
        first_group: u32,
        index: u32,
        cost: &mut Cost,
    ) -> Option<(Vec3, Rgb)> {
        let mut found: Option<(Vec3, Rgb)> = None;
        let (mut at, mut throughput, mut level) = (*x, Vec3::ONE, 0_u32);
        let mut scatter: Option<(Scatter, Vec3)> = None;
        loop {
            let u = sequence.point(first_group + 2 * level, index);
            let direction = warp::cosine(at.shading, [u[0], u[1]]);
            let cos_x = at.shading.dot(direction);
            let reach = self.gate.reach(cos_x);
            // Leaving a scattering surface: f cosθ / (cosθ/π) = π f.
            if let Some((scatter, to)) = &scatter {
                throughput *= reflected(scatter, &at, *to, direction);
            }
            if reach <= 0.0 || throughput == Vec3::ZERO {
                return found;
            }
            cost.remainder_rays += 1;
            let ray = Ray { origin: at.off(direction), direction, t_max: reach };
            let Some(hit) = self.prepared.world.closest(&ray) else { return found };
            let y = Surfel::at(&self.prepared.scene, &ray, &hit);
            let d2 = y.position.distance_squared(at.position);
            let cosines = cos_x * y.geometric.dot(direction).abs();
            if cosines <= 0.0 {
                return found;
            }
            throughput *= self.gate.remainder(cosines, d2);
            if throughput == Vec3::ZERO {
                return found;
            }
            let first = found.map_or(direction, |(first, _)| first);
            let radiance = found.map_or(Vec3::ZERO, |(_, sum)| sum);
            let here = y.scatter(&self.prepared.scene);
            let orders = self.orders_left(level);
            let choice = sequence.point(first_group + 2 * level + 1, index);
            let mut shines = y.emission(&self.prepared.scene);
            if let Some(orders) = orders
                && matches!(here, Scatter::Diffuse { .. } | Scatter::Glossy(_))
            {
                shines += self.reflected_at(&y, &here, -direction, orders, choice[0], cost);
            }
            found = Some((first, radiance + throughput * shines));
            if orders.is_none_or(|o| o == 0) || matches!(here, Scatter::Mirror { .. } | Scatter::Glass { .. }) {
                return found;
            }
            let q = (throughput * albedo_bound(&here)).max_element().clamp(0.0, 0.99);
            if choice[1] >= q {
                return found;
            }
            throughput /= q;
            scatter = Some((here, -direction));
            at = y;
            level += 1;
        }
    }

    /// Depth that virtual lights may have at the vertex of `level` within the path-length limit.
    fn orders_left(&self, level: u32) -> Option<u16> {
        match self.max_length {
            None => Some(u16::MAX),
            Some(most) => u16::from(most).checked_sub(1 + level as u16),
        }
    }

    /// Radiance that y reflects towards `to`: all virtual lights weighed, one chosen by what it would
    /// bring and tested for visibility, and the caustics.
    fn reflected_at(&self, y: &Surfel, scatter: &Scatter, to: Vec3, orders: u16, u: f32, cost: &mut Cost) -> Rgb {
        let place = y.above();
        let bring = |vpl: &crate::vpl::Vpl| {
            let (irradiance, towards) = vpl.irradiance(place, y.shading, self.gate);
            irradiance * value(scatter, y.shading, to, towards)
        };
        let usable = || self.set.vpls.iter().filter(|vpl| vpl.depth <= orders);
        let total: f32 = usable().map(|vpl| bring(vpl).max_element()).sum();
        let mut radiance = Vec3::ZERO;
        if total > 0.0 && total.is_finite() {
            let mut rest = u * total;
            let mut chosen = None;
            for vpl in usable() {
                let brings = bring(vpl);
                let share = brings.max_element();
                if share > 0.0 {
                    chosen = Some((vpl, brings * (total / share)));
                    if rest < share {
                        break;
                    }
                    rest -= share;
                }
            }
            if let Some((vpl, brings)) = chosen {
                cost.remainder_rays += 1;
                if self.prepared.sees(vpl, place) {
                    radiance += brings;
                }
            }
        }
        if !self.set.photons.is_empty() {
            cost.photon_queries += 1;
            radiance +=
                self.set.photons.gather(y.position, y.shading, orders, |from| value(scatter, y.shading, to, from));
        }
        radiance
    }
}

/// π f: what a cosine-distributed direction is worth.
fn reflected(scatter: &Scatter, at: &Surfel, to: Vec3, from: Vec3) -> Rgb {
    value(scatter, at.shading, to, from) * std::f32::consts::PI
}

/// Value of the non-specular part of a BSDF.
fn value(scatter: &Scatter, n: Vec3, to: Vec3, from: Vec3) -> Rgb {
    match scatter {
        Scatter::Diffuse { albedo } => *albedo * std::f32::consts::FRAC_1_PI,
        Scatter::Glossy(material) => scattered(material, n, to, from),
        Scatter::Mirror { .. } | Scatter::Glass { .. } => Vec3::ZERO,
    }
}

fn albedo_bound(scatter: &Scatter) -> Rgb {
    match scatter {
        Scatter::Glossy(_) => Vec3::ONE,
        other => other.albedo(),
    }
}
