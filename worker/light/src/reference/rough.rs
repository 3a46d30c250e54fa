//! Frosted glass and what absorbs light in glass, for the path tracer.
//!
//! Walter, Marschner, Li and Torrance, "Microfacet Models for Refraction through Rough Surfaces" (2007), as it is written
//! there: section 4 for values, 5.2 for the distribution and its shadows; in the frame of the surface.

use glam::Vec3;
use scenes::{Rgb, Scene, Surface};

use super::material::{facets, reflectance, sheet, visible_facet};
use super::philox::Stream;
use crate::frosted::Frosted;
use crate::surface::Surfel;

/// A rough dielectric, seen from a direction.
pub struct Rough {
    alpha: f32,
    tint: Rgb,
    /// Index behind the surface over the one before it.
    relative: f32,
    ior: f32,
    thin: bool,
    /// Towards the viewer.
    to: Vec3,
}

impl Rough {
    /// Its front or its back, in the frame of the surface.
    pub fn new(frosted: &Frosted, front: bool, to: Vec3) -> Self {
        let Frosted { ior, transmittance, facets, thin } = *frosted;
        let relative = if front { ior } else { 1.0 / ior };
        Self { alpha: facets.alpha(), tint: transmittance, relative, ior, thin, to }
    }

    /// Value times cosine for light from a direction, and the density of [`Self::sample`].
    pub fn value(&self, from: Vec3) -> (Rgb, f32) {
        let o = self.to;
        if o.z <= 0.0 {
            return (Vec3::ZERO, 0.0);
        }
        let mirrored = Vec3::new(from.x, from.y, from.z.abs());
        if from.z > 0.0 || self.thin {
            let h = (o + mirrored).normalize_or_zero();
            let reflected = self.reflected(o.dot(h));
            let share = if from.z > 0.0 { reflected } else { 1.0 - reflected };
            let tint = if from.z > 0.0 { Vec3::ONE } else { self.tint };
            let d = facets(h, self.alpha);
            // Equation 20, and 24 over 4 o·h with facets that are seen.
            let value = share * d * self.shadow(o) * self.shadow(mirrored) / (4.0 * o.z);
            return (tint * value, share * d * self.shadow(o) / (4.0 * o.z));
        }
        // Equation 16, turned to the viewer's side.
        let (n_o, n_i) = (1.0, self.relative);
        let h = -(from * n_i + o * n_o);
        let h = if h.z < 0.0 { -h } else { h }.normalize_or_zero();
        let (o_h, i_h) = (o.dot(h), from.dot(h));
        if o_h <= 0.0 || i_h >= 0.0 {
            return (Vec3::ZERO, 0.0);
        }
        let passed = 1.0 - self.reflected(o_h);
        let d = facets(h, self.alpha);
        let root = n_i * i_h + n_o * o_h;
        // Equation 21 times |i·n|.
        let value = o_h * -i_h / o.z * n_o * n_o * passed * self.shadow(o) * self.shadow(from) * d / (root * root);
        // Density of the facet times equation 17, for light that goes the other way.
        let density = passed * d * self.shadow(o) * o_h / o.z * (n_i * n_i * -i_h) / (root * root);
        (self.tint * value, density)
    }

    /// A random direction.
    pub fn sample(&self, stream: &mut Stream) -> Option<Vec3> {
        let h = visible_facet(self.to, self.alpha, stream.pair());
        let cos = self.to.dot(h);
        let mirrored = h * (2.0 * cos) - self.to;
        if stream.unit() < self.reflected(cos) {
            return (mirrored.z > 0.0).then_some(mirrored);
        }
        if self.thin {
            return (mirrored.z > 0.0).then(|| mirrored * Vec3::new(1.0, 1.0, -1.0));
        }
        // Equation 40.
        let eta = 1.0 / self.relative;
        let root = 1.0 + eta * eta * (cos * cos - 1.0);
        let through = h * (eta * cos - root.max(0.0).sqrt()) - self.to * eta;
        (root > 0.0 && through.z < 0.0).then(|| through.normalize())
    }

    /// See [`super::material::Way::squeeze`]; `z` of the direction that was chosen.
    pub fn squeeze(&self, z: f32) -> f32 {
        if z < 0.0 && !self.thin { 1.0 / (self.relative * self.relative) } else { 1.0 }
    }

    fn reflected(&self, cos: f32) -> f32 {
        let cos = cos.clamp(0.0, 1.0);
        if self.thin { sheet(cos, self.ior) } else { reflectance(cos, self.relative) }
    }

    /// Equation 34.
    fn shadow(&self, w: Vec3) -> f32 {
        let tan2 = (w.x * w.x + w.y * w.y) / (w.z * w.z);
        2.0 / (1.0 + (1.0 + self.alpha * self.alpha * tan2).sqrt())
    }
}

/// σ on the side of a surface that a direction points to, if that is inside of solid glass.
pub fn medium(scene: &Scene, at: &Surfel, towards: Vec3) -> Option<Rgb> {
    let outwards = if at.front { at.geometric } else { -at.geometric };
    match scene.materials[at.material as usize].surface {
        Surface::Dielectric(glass) | Surface::Glazed { glass, .. } if !glass.thin && glass.absorption != Vec3::ZERO => {
            (outwards.dot(towards) < 0.0).then_some(glass.absorption)
        }
        _ => None,
    }
}

/// Beer and Lambert's law for a way whose ends may lie in glass; if both do, in half of either.
pub fn transmitted(ends: [Option<Rgb>; 2], length: f32) -> Rgb {
    let [sigma, ends] = ends.iter().flatten().fold([Vec3::ZERO, Vec3::ZERO], |[sum, n], s| [sum + *s, n + Vec3::ONE]);
    if ends == Vec3::ZERO {
        return Vec3::ONE;
    }
    let depth = (sigma / ends * length).as_dvec3();
    Vec3::new(libm::exp(-depth.x) as f32, libm::exp(-depth.y) as f32, libm::exp(-depth.z) as f32)
}
