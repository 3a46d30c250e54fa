//! Where a picture is taken from.

use glam::Vec3;
use serde::{Deserialize, Serialize};

/// A pinhole camera with square pixels, in scene space. Row 0 of the picture is at the top.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Camera {
    /// The eye.
    pub origin: Vec3,
    /// A point in the middle of the picture; not the origin.
    pub target: Vec3,
    /// Roughly up; not parallel to the view.
    pub up: Vec3,
    /// Full **vertical** field of view, degrees, in (0, 180).
    pub fov_y_deg: f32,
    /// The picture's width, pixels.
    pub width: u32,
    /// The picture's height, pixels.
    pub height: u32,
}

/// A camera made ready to shoot rays.
#[derive(Clone, Copy, Debug)]
pub struct Lens {
    origin: Vec3,
    forward: Vec3,
    right: Vec3,
    down: Vec3,
    half_width: f32,
    half_height: f32,
    pixel: f32,
}

impl Default for Camera {
    fn default() -> Self {
        Self {
            origin: Vec3::new(0.0, 0.0, 3.0),
            target: Vec3::ZERO,
            up: Vec3::Y,
            fov_y_deg: 40.0,
            width: 640,
            height: 480,
        }
    }
}

impl Camera {
    /// Computes the picture plane once.
    pub fn lens(&self) -> Lens {
        let forward = (self.target - self.origin).normalize();
        let right = forward.cross(self.up).normalize();
        let down = forward.cross(right);
        let half_tan = libm::tan(f64::from(self.fov_y_deg).to_radians() / 2.0) as f32;
        Lens {
            origin: self.origin,
            forward,
            right,
            down,
            half_width: self.width as f32 / 2.0,
            half_height: self.height as f32 / 2.0,
            pixel: 2.0 * half_tan / self.height as f32,
        }
    }
}

impl Lens {
    /// The eye.
    pub fn origin(&self) -> Vec3 {
        self.origin
    }

    /// Unit vectors to the right, downwards and forward, as people see the picture.
    pub fn axes(&self) -> [Vec3; 3] {
        [self.right, self.down, self.forward]
    }

    /// Unit direction through a point of the picture, in pixels from its top left corner.
    #[inline]
    pub fn direction(&self, x: f32, y: f32) -> Vec3 {
        let sideways = self.right * ((x - self.half_width) * self.pixel);
        let downwards = self.down * ((y - self.half_height) * self.pixel);
        (self.forward + sideways + downwards).normalize()
    }

    /// Where a scene-space point is seen, in pixels from the top left corner, and its distance
    /// from the eye; `None` if it lies behind the eye.
    #[inline]
    pub fn project(&self, point: Vec3) -> Option<(f32, f32, f32)> {
        let offset = point - self.origin;
        let depth = offset.dot(self.forward);
        (depth > 0.0).then(|| {
            let scale = 1.0 / (depth * self.pixel);
            let x = offset.dot(self.right) * scale + self.half_width;
            let y = offset.dot(self.down) * scale + self.half_height;
            (x, y, offset.length())
        })
    }

    /// Width of a pixel at unit depth.
    pub fn pixel(&self) -> f32 {
        self.pixel
    }
}
