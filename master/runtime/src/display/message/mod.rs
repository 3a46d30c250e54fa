//! Messages between viewers and the master, JSON: what viewers send ([`ClientMessage`]) and what they are sent
//! ([`ServerMessage`]). The page in the browser and the native window use the same ones.

mod client;
mod method;
mod scene;
mod server;

use frame::tone::{Exposure, Operator, Tone};
use glam::Vec3;
use scenes::Camera;
use serde::{Deserialize, Serialize};

pub use client::{CLIENT_MESSAGE_MAX, ClientMessage, LUMINAIRE_FILE_MAX, LUMINAIRE_MESSAGE_MAX};
pub use method::{KnobInfo, KnobKind, LayerInfo, MethodInfo};
pub use scene::{ObjectInfo, PieceInfo, SceneInfo, SolidInfo};
pub use server::{Edited, Hit, Knobs, MixStatus, Offer, Picked, Probed, ServerMessage, Status, Welcome, WorkerStatus};

/// From where a viewer looks.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Viewpoint {
    /// As in [`Camera`].
    pub origin: Vec3,
    /// As in [`Camera`].
    pub target: Vec3,
    /// As in [`Camera`].
    pub up: Vec3,
    /// As in [`Camera`].
    pub fov_y_deg: f32,
    /// As in [`Camera`].
    #[serde(default)]
    pub two_point: bool,
    /// As in [`Camera`].
    #[serde(default)]
    pub cut: bool,
    /// The viewer's own clock, milliseconds; comes back with the first picture that shows this input
    /// ([`InputStamp::at`]).
    #[serde(default)]
    pub at: f64,
}

/// Which input is the last that a picture shows.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct InputStamp {
    /// The number of the viewer whose input it was.
    pub viewer: u64,
    /// That viewer's own clock at the input, milliseconds; 0 if the input had none.
    pub at: f64,
}

/// Brightness and curve.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ToneSettings {
    /// Stops, [`frame::tone::STOPS_MAX`] at most either way.
    pub exposure: f32,
    /// Curve.
    pub operator: Operator,
}

/// A point of the picture, 0..=1 from its top left corner.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Spot {
    /// Across.
    pub x: f32,
    /// Down.
    pub y: f32,
}

/// What the light meter reads.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct MeterReading {
    /// From the surface to the eye, W·m⁻²·sr⁻¹.
    pub radiance: Vec3,
    /// On the surface, W·m⁻².
    pub irradiance: Vec3,
    /// Fraction reflected.
    pub reflectance: Vec3,
    /// From the eye, in the scene's unit.
    pub distance: f32,
    /// Of the irradiance.
    pub lux: f32,
    /// Of the radiance.
    pub candela_per_m2: f32,
}

impl Viewpoint {
    /// Of a camera; `at` as in the field.
    pub fn of(camera: &Camera, at: f64) -> Self {
        let Camera { origin, target, up, fov_y_deg, two_point, cut, .. } = *camera;
        Self { origin, target, up, fov_y_deg, two_point, cut, at }
    }

    /// The camera, with a picture of this size.
    ///
    /// # Errors
    /// In words, if nothing can be seen so.
    pub fn camera(&self, [width, height]: [u32; 2]) -> Result<Camera, String> {
        let Self { origin, target, up, fov_y_deg, two_point, cut, .. } = *self;
        let camera = Camera { origin, target, up, fov_y_deg, width, height, two_point, cut };
        camera.check().map(|()| camera)
    }
}

impl From<ToneSettings> for Tone {
    fn from(ToneSettings { exposure, operator }: ToneSettings) -> Self {
        Self { exposure: Exposure::Fixed(exposure), operator }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn viewpoints_that_show_nothing_are_refused() {
        let from = |target: Vec3, fov_y_deg: f32| {
            Viewpoint::of(&Camera { origin: Vec3::ZERO, target, fov_y_deg, ..Camera::default() }, 0.0)
        };
        assert!(from(Vec3::X, 40.0).camera([8, 8]).is_ok());
        for (target, fov) in [(Vec3::ZERO, 40.0), (Vec3::Y, 40.0), (Vec3::X, 0.0), (Vec3::X, f32::NAN)] {
            assert!(from(target, fov).camera([8, 8]).is_err());
        }
    }
}
