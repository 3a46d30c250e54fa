//! Lights that no triangle is: points, spots, luminaires, suns.

use glam::Vec3;
use serde::{Deserialize, Serialize};

use crate::Rgb;

/// A light that is given by numbers, not by a surface that emits.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Light {
    /// Isotropic: `E = intensity · cosθ / d²`.
    Point {
        /// Scene space.
        position: Vec3,
        /// W·sr⁻¹.
        intensity: Rgb,
    },
    /// A point light within a cone, smooth between the two angles (KHR_lights_punctual).
    Spot {
        /// Scene space.
        position: Vec3,
        /// Unit vector along the axis, away from the light.
        direction: Vec3,
        /// W·sr⁻¹ on the axis.
        intensity: Rgb,
        /// cos of the angle where the fall-off begins; greater than `cos_outer`.
        cos_inner: f32,
        /// cos of the angle where the light ends.
        cos_outer: f32,
    },
    /// A point light whose intensity depends on direction as a photometric web says (IES LM-63, EULUMDAT).
    ///
    /// Angles are those of C-planes (CIE 121): γ from `direction`; C about it, counter-clockwise as seen from behind, 0 at
    /// `side`.
    Luminaire {
        /// Scene space.
        position: Vec3,
        /// Unit vector, γ = 0°: where it is aimed.
        direction: Vec3,
        /// Unit vector; what of it is across `direction` is C = 0°, γ = 90°.
        side: Vec3,
        /// W·sr⁻¹ where the web is 1.
        intensity: Rgb,
        /// Index into [`crate::Scene::textures`], with [`crate::Pixels::Float`]: a row for each angle γ, evenly from 0 to 180°,
        /// and a column for each plane, evenly from 0 to less than 360°; one, if all planes are alike. Between them, what the
        /// first channel says is bilinear.
        solid: u32,
    },
    /// A sun: light from afar, in parallel rays or from a disc.
    Directional {
        /// Unit vector in which the light travels; from a disc, that of its middle.
        direction: Vec3,
        /// Irradiance on a surface that faces it, W·m⁻².
        irradiance: Rgb,
        /// Degrees that the disc is wide, as seen from anywhere: 0, parallel rays; or [`DISC_DEG_MIN`] to
        /// [`DISC_DEG_MAX`]. A disc is seen in the sky, with the same radiance `irradiance / (π sin²(diameter / 2))` all
        /// over, and its shadows have soft edges. The Sun's is 0.53.
        #[serde(default)]
        diameter_deg: f32,
    },
}

/// Smaller discs are told from parallel rays by nobody, and hardly by the numbers of a direction.
pub const DISC_DEG_MIN: f32 = 0.01;
/// Half of all directions.
pub const DISC_DEG_MAX: f32 = 180.0;

impl Light {
    /// What stands for a light that was taken away while others behind it keep their numbers: nothing shines.
    pub const ABSENT: Self =
        Self::Directional { direction: Vec3::NEG_Y, irradiance: Vec3::ZERO, diameter_deg: DISC_DEG_MAX };

    /// It was taken away: see [`Self::ABSENT`].
    pub fn is_absent(&self) -> bool {
        *self == Self::ABSENT
    }

    /// It is afar and has a disc, so that rays can meet it.
    pub fn has_disc(&self) -> bool {
        matches!(self, Self::Directional { diameter_deg, .. } if *diameter_deg > 0.0)
    }

    /// Its power, of whatever kind: W·sr⁻¹, or W·m⁻² of suns.
    pub fn power(&self) -> Rgb {
        match self {
            Self::Point { intensity, .. } | Self::Spot { intensity, .. } | Self::Luminaire { intensity, .. } => {
                *intensity
            }
            Self::Directional { irradiance, .. } => *irradiance,
        }
    }
}
