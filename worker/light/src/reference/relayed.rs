//! Light of points, spots and suns by way of thin panes and flat mirrors: what no path can hit is aimed at.
//!
//! A shadow ray goes straight through thin panes, weaker by what each takes. And one more ray aims at an image of the
//! light: a chain of planes is chosen by chance, the light is mirrored in them (the image sources of Allen & Berkley
//! 1979), and the ray counts if it meets just these, in order, as mirrors, and passes straight what else it meets. So
//! every path of reflections in planes and passages through thin panes is found by exactly one chain, and chains of any
//! length may be chosen: no bias. What solid glass refracts and curved mirrors focus is not found;
//! [`scenes::relays::Beyond`] tells that there is some.

use glam::Vec3;
use scenes::{Light, Relays, Rgb, Scene};

use super::Tracer;
use super::luminaire;
use super::material::{Material, sheet};
use super::philox::Stream;
use super::power_heuristic;
use super::rough::{medium, transmitted};
use super::sun::Disc;
use crate::bvh::Ray;
use crate::surface::{Scatter, Surfel};

/// Where a lamp, or its image, is seen from a surface.
struct Aim {
    /// Unit.
    direction: Vec3,
    /// The image; `None` for suns.
    end: Option<Vec3>,
    /// Square of the distance; 1 for suns, to which nothing is nearer than anything else.
    distance2: f32,
}

/// A lamp that is aimed at.
#[derive(Clone, Copy)]
struct Lamp<'a> {
    /// Of a sun with a disc, parallel rays from a place on it.
    light: &'a Light,
    /// One over the probability of all choices.
    scale: f32,
    /// Of such a sun, the density of its direction, sr⁻¹: a path may hit it as well.
    density: Option<f32>,
}

/// How light comes to a surface.
struct Passage {
    /// What mirrors and panes leave of it.
    share: Rgb,
    /// The direction in which the lamp itself is seen in the end.
    towards: Vec3,
    /// Mirrors and panes on the way.
    relays: u32,
}

impl Tracer<'_> {
    /// Light of one lamp without surface, or of a sun, reflected towards the viewer, times `scale`. `left` is how many more
    /// mirrors and panes a path may have.
    pub(super) fn bare(
        &mut self,
        (lamp, scale): (&Light, f32),
        at: &Surfel,
        material: &Material,
        left: u32,
        stream: &mut Stream,
    ) -> Rgb {
        let disc = Disc::of(lamp);
        let beam = disc.as_ref().map(|disc| disc.beam(stream));
        let density = disc.map(|disc| disc.density() / scale);
        let lamp = Lamp { light: beam.as_ref().unwrap_or(lamp), scale, density };
        let straight = self.along(&lamp, &[], at, material, left);
        let planes = self.emitters.relays().planes.len() as u32;
        if planes == 0 {
            return straight;
        }
        let (chain, weight) = chain(planes, stream);
        straight + self.along(&Lamp { scale: scale * weight, ..lamp }, &chain, at, material, left)
    }

    /// By way of the mirrors in some planes, those at the surface's end first.
    fn along(&mut self, lamp: &Lamp, chain: &[u32], at: &Surfel, material: &Material, left: u32) -> Rgb {
        if chain.len() as u64 > u64::from(left) {
            return Vec3::ZERO;
        }
        let aim = self.aim(lamp.light, chain, at.position);
        let (value, density) = material.value(aim.direction);
        if value == Vec3::ZERO {
            return Vec3::ZERO;
        }
        let Some(Passage { mut share, towards, relays }) = self.passage(chain, at, &aim, left) else {
            return Vec3::ZERO;
        };
        if let (Some(chosen), 0) = (lamp.density, relays) {
            // Straight, a path may hit it as well.
            share *= power_heuristic(chosen, density);
        }
        let inside = match aim.end {
            Some(_) => transmitted([medium(&self.prepared.scene, at, aim.direction), None], aim.distance2.sqrt()),
            None => Vec3::ONE,
        };
        let arriving = irradiance(&self.prepared.scene, lamp.light, towards, aim.distance2) * inside * lamp.scale;
        if arriving.is_finite() { value * share * arriving } else { Vec3::ZERO }
    }

    fn aim(&self, lamp: &Light, chain: &[u32], from: Vec3) -> Aim {
        let relays = self.emitters.relays();
        let planes = chain.iter().rev().map(|plane| &relays.planes[*plane as usize]);
        match lamp {
            Light::Point { position, .. } | Light::Spot { position, .. } | Light::Luminaire { position, .. } => {
                let image = planes.fold(*position, |image, plane| plane.image(image));
                let towards = image - from;
                let distance2 = towards.length_squared();
                Aim { direction: towards / distance2.sqrt(), end: Some(image), distance2 }
            }
            Light::Directional { direction, .. } => {
                let direction = planes.fold(-*direction, |towards, plane| plane.turned(towards));
                Aim { direction, end: None, distance2: 1.0 }
            }
        }
    }

    /// What mirrors and panes leave of the light; `None` if it is hidden, or not reflected as the chain says.
    fn passage(&mut self, chain: &[u32], at: &Surfel, aim: &Aim, mut left: u32) -> Option<Passage> {
        let (emitters, prepared) = (self.emitters, self.prepared);
        let (relays, scene): (&Relays, &Scene) = (emitters.relays(), &prepared.scene);
        let mut ray = Ray { origin: at.off(aim.direction), direction: aim.direction, t_max: f32::INFINITY };
        if !relays.panes && chain.is_empty() {
            self.cost.shadow_rays += 1;
            let hidden = match aim.end {
                Some(end) => prepared.world.occluded(ray.origin, end),
                None => prepared.world.occluded_along(&ray),
            };
            return (!hidden).then_some(Passage { share: Vec3::ONE, towards: ray.direction, relays: 0 });
        }
        let (mut share, mut next, mut met) = (Vec3::ONE, 0, 0);
        let mut ahead = aim.end.map_or(f32::INFINITY, |_| aim.distance2.sqrt());
        loop {
            self.cost.shadow_rays += 1;
            let Some(hit) = prepared.world.closest(&ray).filter(|hit| hit.t < ahead) else {
                return (next == chain.len()).then_some(Passage { share, towards: ray.direction, relays: met });
            };
            let here = prepared.surfel(&ray, &hit);
            left = left.checked_sub(1)?;
            met += 1;
            ahead -= hit.t;
            let plane = relays.plane_of(hit.object, hit.triangle);
            let reflecting = chain.get(next).filter(|next| plane == Some(**next));
            let cos = here.shading.dot(ray.direction).abs();
            let (scatter, part) = here.straight(scene);
            match (scatter, reflecting) {
                (Scatter::Mirror { reflectance }, Some(_)) => share *= reflectance,
                (Scatter::Glass { ior, thin: true, .. }, Some(_)) => share *= part * sheet(cos, ior),
                (Scatter::Glass { ior, transmittance, thin: true }, None) => {
                    share *= transmittance * (part * (1.0 - sheet(cos, ior)));
                }
                _ => return None,
            }
            if share.max_element() <= 0.0 {
                return None;
            }
            if let Some(plane) = reflecting {
                ray.direction = relays.planes[*plane as usize].turned(ray.direction);
                next += 1;
            }
            ray.origin = here.off(ray.direction);
        }
    }
}

/// A chain of at least one plane, no plane twice in turn, and one over its probability: K or more planes have the
/// probability 1/K, so that what long chains bring, which falls like 1/K² between facing mirrors, has a finite variance.
fn chain(planes: u32, stream: &mut Stream) -> (Vec<u32>, f32) {
    let choose = |among: u32, stream: &mut Stream| ((u64::from(stream.bits()) * u64::from(among)) >> 32) as u32;
    let mut chain = vec![choose(planes, stream)];
    let mut weight = planes as f32;
    if planes == 1 {
        return (chain, weight);
    }
    loop {
        let length = chain.len() as f32;
        if stream.unit() * (length + 1.0) >= length {
            // It ends here: 1 − K / (K + 1).
            return (chain, weight * (length + 1.0));
        }
        // Another than the last one.
        let other = choose(planes - 1, stream);
        let last = chain[chain.len() - 1];
        chain.push(if other < last { other } else { other + 1 });
        weight *= (planes - 1) as f32 * (length + 1.0) / length;
    }
}

/// Irradiance of a lamp at a surface that faces it, from how far away and in which direction it is looked at.
fn irradiance(scene: &Scene, lamp: &Light, towards: Vec3, distance2: f32) -> Rgb {
    match *lamp {
        Light::Point { intensity, .. } => intensity / distance2,
        Light::Spot { direction, intensity, cos_inner, cos_outer, .. } => {
            let cos = -towards.dot(direction);
            // KHR_lights_punctual: the square of a linear ramp in the cosine.
            let ramp = match cos {
                _ if cos >= cos_inner => 1.0,
                _ if cos <= cos_outer => 0.0,
                _ => (cos - cos_outer) / (cos_inner - cos_outer),
            };
            intensity / distance2 * (ramp * ramp)
        }
        Light::Luminaire { .. } => luminaire::intensity(scene, lamp, -towards) / distance2,
        Light::Directional { irradiance, .. } => irradiance,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn chains_are_as_likely_as_they_say() {
        // Three planes: the chance of every chain of up to three, by counting.
        let (mut counts, draws) = (std::collections::BTreeMap::new(), 400_000_u32);
        let mut weights = std::collections::BTreeMap::new();
        for number in 0..draws {
            let mut stream = Stream::new(7, [0, 0], number);
            let (chain, weight) = chain(3, &mut stream);
            assert!(chain.windows(2).all(|pair| pair[0] != pair[1]), "{chain:?}");
            if chain.len() <= 3 {
                weights.insert(chain.clone(), weight);
                *counts.entry(chain).or_insert(0_u32) += 1;
            }
        }
        assert_eq!(counts.len(), 3 + 6 + 12);
        for (chain, count) in &counts {
            let expected = f64::from(draws) / f64::from(weights[chain]);
            let off = (f64::from(*count) - expected) / expected.sqrt();
            assert!(off.abs() < 4.5, "{chain:?}: {count}, expected {expected}");
        }
        // A single plane cannot reflect twice.
        assert_eq!(super::chain(1, &mut Stream::new(1, [0, 0], 0)), (vec![0], 1.0));
    }
}
