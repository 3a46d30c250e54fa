//! A sun with a disc: a round piece of sky of even radiance.
//!
//! Rays that leave the scene meet it, as they meet the sky, and light samples are directions within it: so both share its
//! light like that of any emitter, and it needs no ways of its own. Only parallel rays do ([`scenes::Light::has_disc`]).

use glam::Vec3;
use scenes::{Light, Rgb};

use crate::warp;

/// A disc, as it is seen from everywhere.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sun {
    /// Unit, to its middle.
    towards: Vec3,
    /// Of half its angular diameter, 1 − cos: so narrow discs keep their precision.
    one_minus_cos: f32,
    /// W·m⁻²·sr⁻¹.
    radiance: Rgb,
}

impl Sun {
    /// `None` for what has no disc.
    pub fn of(light: &Light) -> Option<Self> {
        match *light {
            Light::Directional { direction, irradiance, diameter_deg } if diameter_deg > 0.0 => {
                let half_sine = libm::sin(f64::from(diameter_deg).to_radians() / 4.0);
                let one_minus_cos = 2.0 * half_sine * half_sine;
                // ∫ cosθ dω over the cone is π sin² of its half-angle.
                let projected = std::f64::consts::PI * one_minus_cos * (2.0 - one_minus_cos);
                let radiance = irradiance * (1.0 / projected) as f32;
                Some(Self { towards: -direction, one_minus_cos: one_minus_cos as f32, radiance })
            }
            _ => None,
        }
    }

    /// Radiance of all of it.
    pub fn radiance(&self) -> Rgb {
        self.radiance
    }

    /// Whether a ray in a unit direction meets it.
    pub fn is_seen(&self, direction: Vec3) -> bool {
        // By the chord: cosines of narrow cones are all 1.
        (direction - self.towards).length_squared() <= 2.0 * self.one_minus_cos
    }

    /// A direction towards it, even over its solid angle.
    pub fn sample(&self, u: [f32; 2]) -> Vec3 {
        warp::cone(self.towards, self.one_minus_cos, u)
    }

    /// Density of [`Self::sample`] within it, sr⁻¹.
    pub fn density(&self) -> f32 {
        warp::cone_density(self.one_minus_cos)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Radiance over density is the irradiance on a surface that faces it, less the cosine; and rays meet what is sampled.
    #[test]
    fn samples_make_the_irradiance_and_are_met() {
        let direction = Vec3::new(0.48, -0.8, 0.36);
        for diameter_deg in [0.01_f32, 0.53, 30.0, 180.0] {
            let sun = Sun::of(&Light::Directional { direction, irradiance: Vec3::splat(3.0), diameter_deg }).unwrap();
            let (n, mut irradiance, mut seen) = (64_u32, 0.0, 0);
            for i in 0..n * n {
                let towards = sun.sample([((i % n) as f32 + 0.5) / n as f32, ((i / n) as f32 + 0.5) / n as f32]);
                irradiance += sun.radiance().x / sun.density() * towards.dot(-direction) / (n * n) as f32;
                seen += u32::from(sun.is_seen(towards));
            }
            assert!((irradiance / 3.0 - 1.0).abs() < 1e-3, "{diameter_deg}°: {irradiance}");
            assert!(f64::from(seen) > 0.98 * f64::from(n * n), "{diameter_deg}°: {seen} of {}", n * n);
            let beside = |turns: f32| {
                let (sin, cos) = (diameter_deg.to_radians() * turns).sin_cos();
                sun.is_seen(-direction * cos + direction.any_orthonormal_vector() * sin)
            };
            assert_eq!((beside(0.49), beside(0.51)), (true, false), "{diameter_deg}°");
        }
    }

    #[test]
    fn parallel_rays_have_no_disc() {
        let light = Light::Directional { direction: Vec3::NEG_Y, irradiance: Vec3::ONE, diameter_deg: 0.0 };
        assert_eq!(Sun::of(&light), None);
    }
}
