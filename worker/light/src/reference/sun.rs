//! A sun with a disc, for the path tracer: what a ray sees of it, and parallel rays from places on it.

use std::f64::consts::PI;

use glam::Vec3;
use scenes::{Light, Rgb};

use super::philox::Stream;

/// The disc of a directional light.
pub struct Disc {
    /// Unit, to its middle.
    middle: Vec3,
    /// Of its angular radius.
    sine: f64,
    /// sr.
    solid_angle: f64,
    radiance: Rgb,
}

impl Disc {
    /// `None` if the light has none.
    pub fn of(light: &Light) -> Option<Self> {
        let Light::Directional { direction, irradiance, diameter_deg } = *light else { return None };
        let radius = f64::from(diameter_deg).to_radians() / 2.0;
        if radius <= 0.0 {
            return None;
        }
        let sine = libm::sin(radius);
        // sin² / (1 + cos) is 1 − cos without cancellation.
        let solid_angle = 2.0 * PI * sine * sine / (1.0 + libm::cos(radius));
        let radiance = irradiance * (1.0 / (PI * sine * sine)) as f32;
        Some(Self { middle: -direction, sine, solid_angle, radiance })
    }

    /// What is seen of it in a unit direction.
    pub fn radiance(&self, direction: Vec3) -> Rgb {
        let (middle, direction) = (self.middle.as_dvec3(), direction.as_dvec3());
        let is_seen = middle.dot(direction) > 0.0 && middle.cross(direction).length() <= self.sine;
        if is_seen { self.radiance } else { Vec3::ZERO }
    }

    /// One over its solid angle, sr⁻¹: the density of [`Self::beam`]'s directions.
    pub fn density(&self) -> f32 {
        (1.0 / self.solid_angle) as f32
    }

    /// Parallel rays that are on average what comes from the disc.
    pub fn beam(&self, stream: &mut Stream) -> Light {
        let [u, v] = stream.pair().map(f64::from);
        // Even in the cosine, which is 1 at the middle.
        let cosine = 1.0 - u * self.solid_angle / (2.0 * PI);
        let sine = ((1.0 - cosine) * (1.0 + cosine)).max(0.0).sqrt();
        let (north, east) = (libm::sin(2.0 * PI * v), libm::cos(2.0 * PI * v));
        let middle = self.middle.as_dvec3();
        let (right, up) = middle.any_orthonormal_pair();
        let towards = middle * cosine + (right * east + up * north) * sine;
        let irradiance = self.radiance * self.solid_angle as f32;
        Light::Directional { direction: -towards.normalize().as_vec3(), irradiance, diameter_deg: 0.0 }
    }
}
