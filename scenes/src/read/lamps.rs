//! The lamps of a scene JSON: points, spots, luminaires and suns.

use std::f64::consts::PI;

use glam::DVec3;
use serde::Deserialize;
use serde_json::Value;

use super::ReadError;
use super::figure::{Figure, Measure};
use super::json::{Reader, Triple};
use super::luminaire;
use crate::light::{DISC_DEG_MAX, DISC_DEG_MIN};
use crate::{Light, Scene};

/// An entry of `lights`.
#[derive(Deserialize)]
pub(super) struct Lamp {
    #[serde(default)]
    name: String,
    /// In which a figure with a unit shines.
    colour: Option<Value>,
    #[serde(flatten)]
    kind: Kind,
}

#[derive(Deserialize)]
#[serde(tag = "type", rename_all = "lowercase")]
enum Kind {
    Point {
        position: Triple,
        intensity: Value,
    },
    Spot {
        position: Triple,
        direction: Option<Triple>,
        target: Option<Triple>,
        intensity: Value,
        #[serde(default)]
        inner_deg: f64,
        outer_deg: f64,
    },
    Luminaire(luminaire::Entry),
    Directional {
        direction: Triple,
        irradiance: Value,
        #[serde(default)]
        angular_diameter_deg: f64,
    },
}

impl Reader<'_> {
    /// Adds a lamp to the scene.
    pub(super) fn lamp(&mut self, place: &str, lamp: &Lamp, scene: &mut Scene) -> Result<(), ReadError> {
        let at = |field: &str| format!("{place}.{field}");
        let colour = lamp.colour.as_ref();
        let (light, is_photometric) = match &lamp.kind {
            Kind::Point { position, intensity } => {
                let all = Measure::Intensity { solid_angle: 4.0 * PI };
                let Figure { rgb, is_photometric } = self.figure(&at("intensity"), intensity, colour, all)?;
                let position = self.point(&at("position"), *position, scene.centre)?;
                (Light::Point { position, intensity: rgb }, is_photometric)
            }
            Kind::Spot { position, direction, target, intensity, inner_deg, outer_deg } => {
                let along = match (direction, target) {
                    (Some(direction), None) => DVec3::from(*direction),
                    (None, Some(target)) => DVec3::from(*target) - DVec3::from(*position),
                    _ => return Err(self.refuse(place, "a spot light needs either direction or target")),
                };
                let (cos_inner, cos_outer) = spot_cosines(inner_deg.to_radians(), outer_deg.to_radians())
                    .ok_or_else(|| self.refuse(place, "needs 0 ≤ inner_deg ≤ outer_deg ≤ 180, outer_deg > 0"))?;
                // The fall-off is the square of a ramp in the cosine: a third of what is between the cones.
                let [inner, outer] = [cos_inner, cos_outer].map(f64::from);
                let cone = Measure::Intensity { solid_angle: 2.0 * PI * ((1.0 - inner) + (inner - outer) / 3.0) };
                let Figure { rgb, is_photometric } = self.figure(&at("intensity"), intensity, colour, cone)?;
                let position = self.point(&at("position"), *position, scene.centre)?;
                let direction = self.direction(&at("direction"), along)?;
                (Light::Spot { position, direction, intensity: rgb, cos_inner, cos_outer }, is_photometric)
            }
            Kind::Luminaire(entry) => (self.luminaire(place, entry, colour, scene)?, true),
            Kind::Directional { direction, irradiance, angular_diameter_deg } => {
                let Figure { rgb, is_photometric } =
                    self.figure(&at("irradiance"), irradiance, colour, Measure::Irradiance)?;
                let direction = self.direction(&at("direction"), DVec3::from(*direction))?;
                let diameter_deg = self.diameter(&at("angular_diameter_deg"), *angular_diameter_deg)?;
                (Light::Directional { direction, irradiance: rgb, diameter_deg }, is_photometric)
            }
        };
        scene.lights.push(light);
        scene.light_names.push(lamp.name.clone());
        scene.lights_are_photometric |= is_photometric;
        Ok(())
    }

    /// Of a sun's disc.
    fn diameter(&self, field: &str, deg: f64) -> Result<f32, ReadError> {
        let narrowed = deg as f32;
        if narrowed == 0.0 || (DISC_DEG_MIN..=DISC_DEG_MAX).contains(&narrowed) {
            return Ok(narrowed);
        }
        let range = format!("{deg} is neither 0, for parallel rays, nor within {DISC_DEG_MIN}..{DISC_DEG_MAX}");
        Err(self.refuse(field, range))
    }
}

/// Cosines of a spot light's half angles, the inner strictly greater; `None` if the angles are none.
pub(super) fn spot_cosines(inner: f64, outer: f64) -> Option<(f32, f32)> {
    let good = 0.0 <= inner && inner <= outer && outer > 0.0 && outer <= std::f64::consts::PI;
    let (cos_inner, cos_outer) = (libm::cos(inner) as f32, libm::cos(outer) as f32);
    good.then(|| (cos_inner, cos_outer.min(cos_inner.next_down())))
}
