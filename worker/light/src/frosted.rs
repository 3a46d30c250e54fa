//! Frosted glass: a surface of facets, each of which reflects and refracts like clear glass (Walter et al. 2007).
//!
//! It is followed like clear glass, by a facet drawn among those that are seen (Heitz 2018), so that all estimators find its
//! light as they find that of chains ([`crate::walk`]). On eye paths, light samples find emitters beside the ray
//! that may meet them, and lights without surface alone ([`crate::lobe`]).
//!
//! Shadows are Smith's, of either direction by itself (Walter et al., eq. 23). What facets cast to each other is
//! left out, so rough glass loses light: the rougher, the more. A sheet ([`scenes::Dielectric::thin`]) sends what passes
//! it where a mirror would behind it, as glTF's KHR_materials_transmission has it.

use glam::Vec3;
use scenes::Rgb;

use crate::facets::Facets;
use crate::surface::{Bounce, Carries, Surfel, fresnel};
use crate::warp;

/// Frosted glass at a point, textures looked up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frosted {
    /// Index of the inside, over that of the outside.
    pub ior: f32,
    /// Tint at each crossing.
    pub transmittance: Rgb,
    /// What its surface is made of.
    pub facets: Facets,
    /// Sheet of two faces.
    pub thin: bool,
}

/// Who decides between the ways that a facet reflects and refracts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ways {
    /// Chance, by Fresnel's reflectance.
    Either,
    /// Nobody: both are followed.
    Both,
}

impl Frosted {
    /// Both ways that a facet leads; a way on the wrong side of the surface is none.
    pub fn branches(&self, at: &Surfel, incoming: Vec3, carries: Carries, u: [f32; 2]) -> [Option<Bounce>; 2] {
        let to = -incoming;
        let half = self.facets.visible(at.shading, to, warp::disc(u));
        let (reflectance, cos_t) = self.fresnel(at, to.dot(half));
        [
            self.reflected(at, to, half).map(|way| Bounce { weight: way.weight * reflectance, ..way }),
            self.passed(at, to, half, cos_t, carries)
                .map(|way| Bounce { weight: way.weight * (1.0 - reflectance), ..way }),
        ]
    }

    /// One of them, chosen by Fresnel's reflectance.
    pub fn sample(&self, at: &Surfel, incoming: Vec3, carries: Carries, choice: f32, u: [f32; 2]) -> Option<Bounce> {
        let to = -incoming;
        let half = self.facets.visible(at.shading, to, warp::disc(u));
        let (reflectance, cos_t) = self.fresnel(at, to.dot(half));
        if choice < reflectance { self.reflected(at, to, half) } else { self.passed(at, to, half, cos_t, carries) }
    }

    /// Value of the BSDF for radiance, sr⁻¹, and the density of the directions that are followed. `to` and `from` are unit
    /// vectors away from the surface, `to` on the viewer's side.
    pub fn value_and_density(&self, at: &Surfel, to: Vec3, from: Vec3, ways: Ways) -> (Rgb, f32) {
        const NOTHING: (Rgb, f32) = (Vec3::ZERO, 0.0);
        let n = at.shading;
        let (cos_o, cos_i) = (n.dot(to), n.dot(from));
        if cos_o <= 0.0 || cos_i == 0.0 || cos_i * at.geometric.dot(from) <= 0.0 {
            return NOTHING;
        }
        let passes = cos_i < 0.0;
        let eta = self.eta(at);
        let half = match passes {
            false => to + from,
            true if self.thin => to + from - n * (2.0 * cos_i),
            true => to + from * eta,
        };
        let half = half.normalize_or_zero();
        let half = if n.dot(half) < 0.0 { -half } else { half };
        let met = to.dot(half);
        if met <= 0.0 {
            return NOTHING;
        }
        let (reflectance, _) = self.fresnel(at, met);
        let seen = self.unshadowed(cos_o);
        // All but what depends on the way: D G₁(o) / cosθ_o.
        let facets = self.facets.density(n.dot(half)) * seen / cos_o;
        let lit = self.unshadowed(cos_i.abs()) / cos_i.abs();
        let share = if passes { 1.0 - reflectance } else { reflectance };
        let chosen = if ways == Ways::Both { 1.0 } else { share };
        if !passes || self.thin {
            let tint = if passes { self.transmittance } else { Vec3::ONE };
            return (tint * (facets * lit * share * 0.25), facets * chosen * 0.25);
        }
        let behind = -from.dot(half);
        if behind <= 0.0 {
            return NOTHING;
        }
        let root = met - eta * behind;
        let turn = met * behind / (root * root);
        (self.transmittance * (facets * lit * share * turn), facets * chosen * turn * eta * eta)
    }

    /// Index behind the surface over the index before it.
    fn eta(&self, at: &Surfel) -> f32 {
        if at.front || self.thin { self.ior } else { 1.0 / self.ior }
    }

    /// Reflectance of a facet, and the cosine of what it refracts.
    fn fresnel(&self, at: &Surfel, cos: f32) -> (f32, f32) {
        let (single, cos_t) = fresnel(cos.clamp(0.0, 1.0), self.eta(at));
        if self.thin { (2.0 * single / (1.0 + single), cos_t) } else { (single, cos_t) }
    }

    /// G₁.
    fn unshadowed(&self, cos: f32) -> f32 {
        1.0 / (1.0 + self.facets.lambda(cos))
    }

    /// The way of a mirror, by what of it is not shadowed.
    fn reflected(&self, at: &Surfel, to: Vec3, half: Vec3) -> Option<Bounce> {
        let direction = (half * (2.0 * to.dot(half)) - to).normalize();
        self.way(at, direction, Vec3::ONE, true)
    }

    /// The way behind, likewise, tinted.
    fn passed(&self, at: &Surfel, to: Vec3, half: Vec3, cos_t: f32, carries: Carries) -> Option<Bounce> {
        if self.thin {
            let mirrored = half * (2.0 * to.dot(half)) - to;
            let cos = at.shading.dot(mirrored);
            if cos <= 0.0 {
                return None;
            }
            return self.way(at, (mirrored - at.shading * (2.0 * cos)).normalize(), self.transmittance, false);
        }
        if cos_t <= 0.0 {
            return None;
        }
        let eta = self.eta(at);
        let direction = (half * (to.dot(half) / eta - cos_t) - to / eta).normalize();
        // Radiance is squeezed by (n_before/n_behind)² on its way to the eye, flux is not.
        let squeeze = if carries == Carries::Radiance { 1.0 / (eta * eta) } else { 1.0 };
        self.way(at, direction, self.transmittance * squeeze, false)
    }

    fn way(&self, at: &Surfel, direction: Vec3, weight: Rgb, reflected: bool) -> Option<Bounce> {
        let cos = at.shading.dot(direction);
        let is_above = |cos: f32| if reflected { cos > 0.0 } else { cos < 0.0 };
        (is_above(cos) && is_above(at.geometric.dot(direction))).then(|| Bounce {
            origin: at.off(direction),
            direction,
            weight: weight * self.unshadowed(cos.abs()),
            reflected,
        })
    }
}

#[cfg(test)]
mod tests {
    use std::f32::consts::PI;

    use glam::Vec2;

    use super::*;

    fn facing(front: bool) -> Surfel {
        Surfel {
            position: Vec3::ZERO,
            epsilon: 1e-6,
            geometric: Vec3::Z,
            shading: Vec3::Z,
            smooth: Vec3::Z,
            front,
            uv: Vec2::ZERO,
            tint: Vec3::ONE,
            mesh: 0,
            triangle: 0,
            weights: [0.0; 2],
            material: 0,
            around: Default::default(),
            chance: 0.0,
        }
    }

    fn glass(roughness: f32, thin: bool) -> Frosted {
        Frosted { ior: 1.5, transmittance: Vec3::ONE, facets: Facets::new(roughness), thin }
    }

    fn towards(angle: f32, turn: f32) -> Vec3 {
        let (sin, cos) = angle.to_radians().sin_cos();
        Vec3::new(sin * turn.cos(), sin * turn.sin(), cos)
    }

    fn random(i: u32) -> [f32; 3] {
        std::array::from_fn(|d| (crate::sample::mix(3 * i + d as u32) >> 8) as f32 / 16_777_216.0)
    }

    /// n²-weighted as refraction has it: f(o, i) / n_o² = f(i, o) / n_i², seen from either side.
    #[test]
    fn light_finds_its_way_back() {
        for thin in [false, true] {
            let glass = glass(0.6, thin);
            for (a, b) in [(10.0, 170.0), (50.0, 120.0), (40.0, 60.0), (70.0, 150.0)] {
                let (to, from) = (towards(a, 0.0), towards(b, 2.6));
                let there = glass.value_and_density(&facing(true), to, from, Ways::Either).0.x;
                let passes = from.z < 0.0;
                // Turned over, so that what was behind is before.
                let over = |w: Vec3| if passes { Vec3::new(w.x, -w.y, -w.z) } else { w };
                let back = glass.value_and_density(&facing(!passes || thin), over(from), over(to), Ways::Either).0.x;
                let squeeze = if passes && !thin { 1.5 * 1.5 } else { 1.0 };
                assert!(there > 1e-3, "{a} {b}: {there}");
                assert!((there * squeeze / back - 1.0).abs() < 1e-4, "{a}° {b}° thin {thin}: {there} {back}");
            }
        }
    }

    /// χ² of directions that are followed against the density, over cells of the sphere; and their weights.
    #[test]
    fn directions_match_their_density() {
        const CELLS: usize = 16;
        let cell = |w: Vec3| {
            let turns = (w.y.atan2(w.x) / (2.0 * PI)).rem_euclid(1.0);
            let height = ((w.z * 0.5 + 0.5) * CELLS as f32) as usize;
            height.min(CELLS - 1) * CELLS + ((turns * CELLS as f32) as usize).min(CELLS - 1)
        };
        for (front, thin) in [(true, false), (false, false), (true, true)] {
            let (at, glass, to) = (facing(front), glass(0.75, thin), towards(35.0, 0.4));
            let mut share = vec![0.0_f64; CELLS * CELLS];
            const FINE: usize = 1600;
            for i in 0..FINE * FINE {
                let z = ((i % FINE) as f32 + 0.5) / FINE as f32 * 2.0 - 1.0;
                let (sin, cos) = warp::turn(((i / FINE) as f32 + 0.5) / FINE as f32);
                let r = (1.0 - z * z).sqrt();
                let w = Vec3::new(r * cos, r * sin, z);
                let density = glass.value_and_density(&at, to, w, Ways::Either).1;
                share[cell(w)] += f64::from(density) * f64::from(4.0 * PI) / (FINE * FINE) as f64;
            }
            let n = 100_000_u32;
            let mut counts = vec![0.0_f64; CELLS * CELLS];
            let mut kept = 0.0;
            for i in 0..n {
                let [choice, u, v] = random(i);
                let Some(way) = glass.sample(&at, -to, Carries::Radiance, choice, [u, v]) else { continue };
                counts[cell(way.direction)] += 1.0;
                kept += 1.0;
                let (value, density) = glass.value_and_density(&at, to, way.direction, Ways::Either);
                let expected = value.x * way.direction.z.abs() / density;
                assert!((way.weight.x - expected).abs() < 2e-3 * expected, "{front} {thin}: {} {expected}", way.weight);
            }
            assert!(kept > 0.7 * f64::from(n), "{front} {thin}: {kept}");
            let cells = counts.iter().zip(&share).filter(|(_, s)| **s > 1e-4);
            let (mut x2, mut degrees) = (0.0_f64, 0.0_f64);
            for (count, share) in cells {
                x2 += (count - share * f64::from(n)).powi(2) / (share * f64::from(n));
                degrees += 1.0;
            }
            assert!(x2 < degrees + 5.0 * (2.0 * degrees).sqrt(), "front {front} thin {thin}: χ² = {x2} of {degrees}");
        }
    }

    /// What goes on of a flux is never more than all, and next to all where it is hardly rough.
    #[test]
    fn flux_is_conserved_but_for_what_facets_hide() {
        for (front, thin) in [(true, false), (false, false), (true, true)] {
            for roughness in [0.05, 0.3, 0.6, 1.0] {
                for angle in [0.0, 30.0, 60.0, 80.0, 89.0] {
                    let (at, glass, to) = (facing(front), glass(roughness, thin), towards(angle, 0.3));
                    let n = 4096_u32;
                    let mut sum = 0.0;
                    for i in 0..n {
                        let [_, u, v] = random(i);
                        let ways = glass.branches(&at, -to, Carries::Flux, [u, v]);
                        sum += ways.iter().flatten().map(|way| f64::from(way.weight.x)).sum::<f64>();
                    }
                    let kept = sum / f64::from(n);
                    assert!(kept < 1.0 + 1e-5, "{front} {thin} roughness {roughness} at {angle}°: {kept}");
                    let least = if roughness < 0.1 && angle < 85.0 { 0.99 } else { 0.05 };
                    assert!(kept > least, "{front} {thin} roughness {roughness} at {angle}°: {kept}");
                }
            }
        }
    }

    #[test]
    fn hardly_rough_glass_is_clear() {
        let to = towards(40.0, 0.0);
        let [Some(mirror), Some(through)] = glass(0.03, false).branches(&facing(true), -to, Carries::Flux, [0.5, 0.5])
        else {
            panic!()
        };
        assert!((mirror.direction - Vec3::new(-to.x, 0.0, to.z)).length() < 1e-2);
        assert!((through.direction.x + to.x / 1.5).abs() < 1e-2);
        assert!((mirror.weight.x + through.weight.x - 1.0).abs() < 1e-3);
    }
}
