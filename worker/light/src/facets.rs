//! The facets that rough surfaces are made of: GGX (Trowbridge & Reitz 1975; Walter et al. 2007) with Smith's shadows,
//! correlated in height (Heitz 2014).

use std::f32::consts::FRAC_1_PI;

use glam::{Vec2, Vec3};

use crate::warp;

/// Smallest α: below it a lobe is narrower than f32 can tell.
pub const ALPHA_MIN: f32 = 1e-3;

/// Facets of some roughness.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Facets {
    alpha: f32,
}

impl Facets {
    /// Of a perceptual roughness 0..1: α is its square.
    pub fn new(roughness: f32) -> Self {
        Self { alpha: (roughness * roughness).clamp(ALPHA_MIN, 1.0) }
    }

    /// Of that α, 0.001..=1.
    pub fn of_width(alpha: f32) -> Self {
        Self { alpha }
    }

    /// α, 0.001..=1.
    pub fn alpha(&self) -> f32 {
        self.alpha
    }

    /// D: density of facet normals at a cosine from the surface's.
    pub fn density(&self, cos: f32) -> f32 {
        if cos <= 0.0 {
            return 0.0;
        }
        let a2 = self.alpha * self.alpha;
        // 1 − cos² (1 − α²), without cancellation near cos = 1
        let sin2 = (1.0 - cos * cos).max(0.0);
        let t = sin2 + cos * cos * a2;
        a2 * FRAC_1_PI / (t * t)
    }

    /// Smith's Λ.
    pub fn lambda(&self, cos: f32) -> f32 {
        let cos2 = cos * cos;
        let tan2 = (1.0 - cos2).max(0.0) / cos2.max(1e-12);
        ((1.0 + self.alpha * self.alpha * tan2).sqrt() - 1.0) * 0.5
    }

    /// The facet that is seen at a point of the unit disc, on which all that are visible lie evenly (Heitz 2018).
    pub fn visible(&self, n: Vec3, to: Vec3, disc: Vec2) -> Vec3 {
        let (s, t) = warp::frame(n);
        let local = Vec3::new(s.dot(to) * self.alpha, t.dot(to) * self.alpha, n.dot(to)).normalize();
        let (t1, t2) = warp::frame(local);
        let blend = 0.5 * (1.0 + local.z);
        // The frame's orientation about `local` does not matter up to the split below, which needs
        // t1 horizontal.
        let horizontal = Vec3::new(-local.y, local.x, 0.0);
        let (t1, t2) = if horizontal.length_squared() > 1e-12 {
            let t1 = horizontal.normalize();
            (t1, local.cross(t1))
        } else {
            (t1, t2)
        };
        let x = disc.x;
        let y = (1.0 - blend) * (1.0 - x * x).max(0.0).sqrt() + blend * disc.y;
        let z = (1.0 - x * x - y * y).max(0.0).sqrt();
        let m = t1 * x + t2 * y + local * z;
        let m = Vec3::new(m.x * self.alpha, m.y * self.alpha, m.z.max(1e-6)).normalize();
        (s * m.x + t * m.y + n * m.z).normalize()
    }
}
