//! The light that a scene gets which has none: a soft sky with a key light, or a lamp where no sky can be seen.
//!
//! A white furnace shows neither white things nor chrome: all of them are as bright as what is around. So the sky is
//! darker below, and brightest in one place, to the left above whoever looks.

use glam::Vec3;

use super::enclosure::Room;
use crate::{Camera, Environment, Light, LookUp, Pixels, Scene, Texture};

/// Texels of the sky.
const SIZE: [u32; 2] = [128, 64];
/// Radiance from straight below, from the horizon, and from straight above.
const BELOW: Vec3 = Vec3::new(0.12, 0.115, 0.11);
const HORIZON: Vec3 = Vec3::new(0.42, 0.43, 0.45);
const ABOVE: Vec3 = Vec3::new(0.7, 0.73, 0.78);
/// Radiance of the key light's middle, and the angle at which it is down to a half, radians.
const KEY: Vec3 = Vec3::new(16.0, 15.2, 14.0);
const KEY_SIZE: f64 = 0.22;
/// How high it is, and how far to the left of the view, radians.
const KEY_HEIGHT: f64 = 0.85;
const KEY_LEFT: f64 = 0.8;

/// A sky about what a camera looks at.
pub(super) fn sky(scene: &mut Scene, camera: &Camera) {
    let ahead = (camera.target - camera.origin).as_dvec3();
    // Longitude of where the key light is: behind the viewer, to the left.
    let behind = libm::atan2(-ahead.x, ahead.z);
    let key = behind + KEY_LEFT;
    let [width, height] = SIZE;
    let mut texels = Vec::with_capacity((width * height) as usize);
    for row in 0..height {
        let latitude = std::f64::consts::PI * (0.5 - (f64::from(row) + 0.5) / f64::from(height));
        let (sin, cos) = (libm::sin(latitude), libm::cos(latitude));
        let (end, share) = if sin < 0.0 { (BELOW, -sin) } else { (ABOVE, sin) };
        let around = HORIZON.lerp(end, libm::sqrt(share) as f32);
        for column in 0..width {
            let longitude = std::f64::consts::TAU * ((f64::from(column) + 0.5) / f64::from(width) - 0.5);
            let towards = libm::sin(KEY_HEIGHT) * sin + libm::cos(KEY_HEIGHT) * cos * libm::cos(longitude - key);
            let angle = libm::acos(towards.clamp(-1.0, 1.0)) / KEY_SIZE;
            let glow = libm::exp2(-angle * angle) as f32;
            texels.push((around + KEY * glow).to_array());
        }
    }
    let texture =
        Texture { name: "studio".into(), width, height, pixels: Pixels::Float(texels), look_up: LookUp::REPEAT };
    scene.textures.push(texture.into());
    scene.environment = Environment::Image { texture: (scene.textures.len() - 1) as u32, scale: Vec3::ONE, turn: 0.0 };
}

/// A lamp below the ceiling of a room that no sky lights: it gives the floor as much as a sky of radiance 1 would.
pub(super) fn lamp(scene: &mut Scene, room: &Room) {
    let up = room.up as f32;
    let position = room.middle.as_vec3() + Vec3::Y * (0.7 * up);
    let height = 0.7 * up + room.down as f32;
    scene.lights.push(Light::Point { position, intensity: Vec3::splat(std::f32::consts::PI * height * height) });
    scene.light_names.resize(scene.lights.len() - 1, String::new());
    scene.light_names.push("studio".into());
}
