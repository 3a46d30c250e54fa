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
    /// Two-point perspective: the picture stays parallel to `up`, as a shift lens leaves it, so that what is upright is so in
    /// the picture, too. The target stays in its middle as long as that is not steeper than [`STEEPEST_SHIFT`].
    #[serde(default)]
    pub two_point: bool,
    /// A plan or a section: nothing is seen that lies nearer than the plane through the target, across the view. It is still
    /// there for light.
    #[serde(default)]
    pub cut: bool,
}

/// So steeply a shift lens looks up or down, at most: the slope of its middle, tan 60°.
pub const STEEPEST_SHIFT: f32 = 1.732;
/// So many times half its picture's height is the eye away from what it sees as if in parallel ([`Camera::parallel`]): rays are
/// within a quarter of a degree of each other.
pub const PARALLEL_HEIGHTS: f64 = 500.0;

/// A camera made ready to shoot rays.
#[derive(Clone, Copy, Debug)]
pub struct Lens {
    origin: Vec3,
    forward: Vec3,
    right: Vec3,
    down: Vec3,
    /// Where the forward axis is in the picture, pixels.
    middle: [f32; 2],
    pixel: f32,
    /// Depth of the plane before which nothing is seen.
    near: f32,
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
            two_point: false,
            cut: false,
        }
    }
}

impl Camera {
    /// Computes the picture plane once.
    pub fn lens(&self) -> Lens {
        let towards = self.target - self.origin;
        let (forward, slope) = if self.two_point { self.level() } else { (towards.normalize(), 0.0) };
        let right = forward.cross(self.up).normalize();
        let down = forward.cross(right);
        let half_tan = libm::tan(f64::from(self.fov_y_deg).to_radians() / 2.0) as f32;
        let pixel = 2.0 * half_tan / self.height as f32;
        Lens {
            origin: self.origin,
            forward,
            right,
            down,
            middle: [self.width as f32 / 2.0, self.height as f32 / 2.0 + slope / pixel],
            pixel,
            near: if self.cut { towards.dot(forward) } else { 0.0 },
        }
    }

    /// The level direction towards the target, and how steeply the target lies above that: the tangent, as far as a lens shifts.
    pub fn level(&self) -> (Vec3, f32) {
        let (towards, up) = (self.target - self.origin, self.up.normalize());
        let along = towards.reject_from_normalized(up);
        let slope = towards.dot(up) / along.length();
        (along.normalize(), slope.clamp(-STEEPEST_SHIFT, STEEPEST_SHIFT))
    }

    /// The same view as if in parallel, of a picture that is so high in the scene: from [`PARALLEL_HEIGHTS`] times half of that.
    #[must_use]
    pub fn parallel(self, height: f64) -> Self {
        let (away, half) = (PARALLEL_HEIGHTS * height / 2.0, 2.0 * libm::atan(1.0 / PARALLEL_HEIGHTS));
        let back = (self.origin - self.target).as_dvec3().normalize() * away;
        let origin = (self.target.as_dvec3() + back).as_vec3();
        Self { origin, fov_y_deg: half.to_degrees() as f32, ..self }
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
        let sideways = self.right * ((x - self.middle[0]) * self.pixel);
        let downwards = self.down * ((y - self.middle[1]) * self.pixel);
        (self.forward + sideways + downwards).normalize()
    }

    /// How far from the eye a ray begins that sees in this direction: 0, unless something is cut away.
    #[inline]
    pub fn start(&self, direction: Vec3) -> f32 {
        if self.near > 0.0 { self.near / direction.dot(self.forward) } else { 0.0 }
    }

    /// Where a scene-space point is seen, in pixels from the top left corner, and its distance
    /// from the eye; `None` if it lies behind the eye, or is cut away.
    #[inline]
    pub fn project(&self, point: Vec3) -> Option<(f32, f32, f32)> {
        let offset = point - self.origin;
        let depth = offset.dot(self.forward);
        (depth > self.near).then(|| {
            let scale = 1.0 / (depth * self.pixel);
            let x = offset.dot(self.right) * scale + self.middle[0];
            let y = offset.dot(self.down) * scale + self.middle[1];
            (x, y, offset.length())
        })
    }

    /// Where the forward axis meets the picture, pixels from its top left corner.
    pub fn middle(&self) -> [f32; 2] {
        self.middle
    }

    /// Depth, along the forward axis, of the plane before which nothing is seen; 0: there is none.
    pub fn near(&self) -> f32 {
        self.near
    }

    /// Width of a pixel at unit depth.
    pub fn pixel(&self) -> f32 {
        self.pixel
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn camera() -> Camera {
        Camera { origin: Vec3::new(1.0, 4.0, 5.0), target: Vec3::new(0.5, 1.0, -1.0), ..Camera::default() }
    }

    #[test]
    fn with_a_shift_lens_verticals_are_upright_and_the_target_is_in_the_middle() {
        let lens = Camera { two_point: true, ..camera() }.lens();
        let (x, y, _) = lens.project(camera().target).unwrap();
        assert!((x - 320.0).abs() < 1e-3 && (y - 240.0).abs() < 1e-3, "{x} {y}");
        for foot in [Vec3::new(-1.0, 0.0, 0.0), Vec3::new(2.0, 0.5, -3.0)] {
            let column = |lens: &Lens, up: f32| lens.project(foot + Vec3::Y * up).unwrap().0;
            assert!((column(&lens, 0.0) - column(&lens, 2.0)).abs() < 1e-3);
            assert!((column(&camera().lens(), 0.0) - column(&camera().lens(), 2.0)).abs() > 5.0, "else they lean");
        }
        // Straight down there is no level: as steep as it goes.
        let steep = Camera { target: Vec3::new(1.0, -90.0, 4.9), two_point: true, ..camera() };
        assert_eq!(steep.level().1, -STEEPEST_SHIFT);
        assert!(steep.lens().direction(0.0, 0.0).is_finite());
    }

    #[test]
    fn what_lies_before_the_cut_is_not_seen_and_rays_begin_there() {
        for two_point in [false, true] {
            let camera = Camera { cut: true, two_point, ..camera() };
            let lens = camera.lens();
            let forward = lens.axes()[2];
            assert!(lens.project(camera.target - forward * 0.01).is_none());
            assert!(lens.project(camera.target + forward * 0.01).is_some());
            for (x, y) in [(0.0, 0.0), (320.0, 240.0), (640.0, 100.0)] {
                let direction = lens.direction(x, y);
                let begins = lens.origin() + direction * lens.start(direction);
                assert!((begins - camera.target).dot(forward).abs() < 1e-4, "on the plane");
            }
        }
        assert_eq!(camera().lens().start(Vec3::NEG_Z), 0.0);
    }

    #[test]
    fn in_parallel_a_picture_is_as_high_as_it_says_near_and_far() {
        let camera = camera().parallel(3.0);
        let lens = camera.lens();
        let [_, down, forward] = lens.axes();
        for depth in [-1.0, 0.0, 1.0] {
            let (_, y, _) = lens.project(camera.target + down * 1.5 + forward * depth).unwrap();
            assert!((y - 480.0).abs() < 0.5, "{y}");
        }
    }
}
