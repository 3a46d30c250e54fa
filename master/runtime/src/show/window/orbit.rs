//! Moving the camera by drags, wheel and keys. It only computes.

use std::f32::consts::PI;

use glam::{Quat, Vec2, Vec3};
use scenes::Camera;

/// What dragging does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Drag {
    /// Turns around what is under the pointer.
    Orbit,
    /// Looks around from where one stands.
    Look,
    /// Shifts the view.
    Pan,
}

/// A camera that is moved.
#[derive(Clone, Copy, Debug)]
pub(super) struct Orbit {
    camera: Camera,
    /// Where it began.
    home: Camera,
    /// Upright, unit length: the poles are never crossed.
    up: Vec3,
    /// What is turned around, if not the middle of the picture.
    pub pivot: Option<Vec3>,
}

/// Largest cosine between view and upright.
const STEEPEST: f32 = 0.995;
/// Points of the window that a drag of half a turn takes at least.
const HALF_TURN: f32 = 300.0;
/// Shares of the first distance to the target that keys walk in a second.
const WALK: f32 = 0.6;

impl Orbit {
    /// Begins here.
    pub fn new(camera: Camera) -> Self {
        Self { camera, home: camera, up: camera.up.normalize_or(Vec3::Y), pivot: None }
    }

    /// From where it looks.
    pub fn camera(&self) -> Camera {
        self.camera
    }

    /// Upright, unit length.
    pub fn up(&self) -> Vec3 {
        self.up
    }

    /// Looks from elsewhere.
    pub fn set(&mut self, camera: Camera) {
        self.camera = camera;
    }

    /// Back to where it began.
    pub fn go_home(&mut self) {
        let Camera { width, height, .. } = self.camera;
        self.camera = Camera { width, height, ..self.home };
    }

    /// Follows a drag by `by` points, in a view `height` points high.
    pub fn drag(&mut self, kind: Drag, by: Vec2, height: f32) {
        let angle = -by * (PI / height.max(HALF_TURN));
        match kind {
            Drag::Orbit => self.turn(angle, self.pivot.unwrap_or(self.camera.target)),
            Drag::Look => self.turn(angle * 0.6, self.camera.origin),
            Drag::Pan => {
                let (forward, right) = self.axes();
                let half = (self.camera.fov_y_deg.to_radians() / 2.0).tan();
                let scale = self.reach().max(1e-6) * 2.0 * half / height.max(1.0);
                self.shift(right * (-by.x * scale) + forward.cross(right) * (-by.y * scale));
            }
        }
    }

    /// Turns eye and target about a pivot, radians about the upright and up and down.
    fn turn(&mut self, angle: Vec2, pivot: Vec3) {
        let about = |axis: Vec3, angle: f32| {
            let rotation = Quat::from_axis_angle(axis, angle);
            move |point: Vec3| pivot + rotation * (point - pivot)
        };
        let yaw = about(self.up, angle.x);
        let (origin, target) = (yaw(self.camera.origin), yaw(self.camera.target));
        let Some(right) = (target - origin).cross(self.up).try_normalize() else { return };
        let pitch = about(right, angle.y);
        let (steep_origin, steep_target) = (pitch(origin), pitch(target));
        let steepness = (steep_target - steep_origin).normalize_or_zero().dot(self.up).abs();
        if steepness > STEEPEST {
            self.place(origin, target);
        } else {
            self.place(steep_origin, steep_target);
        }
    }

    /// Nearer to or farther from the pivot by a factor e^amount; through it there is no way.
    pub fn dolly(&mut self, amount: f32) {
        let factor = amount.clamp(-0.5, 0.5).exp();
        let (forward, _) = self.axes();
        let origin = self.camera.origin + forward * (self.reach() * (1.0 - factor));
        let near = self.camera.target.distance(self.camera.origin) * factor;
        self.place(origin, origin + forward * near.max(1e-4));
    }

    /// Walks for some seconds: to the right, up, forward; 1 is full speed.
    pub fn walk(&mut self, way: Vec3, seconds: f32) {
        let (forward, right) = self.axes();
        let speed = WALK * self.home.target.distance(self.home.origin) * seconds;
        self.shift((right * way.x + self.up * way.y + forward * way.z) * speed);
    }

    /// Looks around for some seconds: left, up; 1 is full speed.
    pub fn gaze(&mut self, way: Vec2, seconds: f32) {
        self.turn(way * seconds, self.camera.origin);
    }

    /// Brings a ball into view, in a view of this shape (width / height).
    pub fn frame(&mut self, centre: Vec3, radius: f32, shape: f32) {
        let (forward, _) = self.axes();
        let half = self.camera.fov_y_deg.to_radians() / 2.0;
        let distance = 1.25 * radius / half.sin() / shape.min(1.0);
        self.place(centre - forward * distance, centre);
    }

    /// How far what people look at is.
    fn reach(&self) -> f32 {
        let (forward, _) = self.axes();
        let along = self.pivot.map_or(0.0, |pivot| (pivot - self.camera.origin).dot(forward));
        if along > 0.0 { along } else { self.camera.target.distance(self.camera.origin) }
    }

    fn axes(&self) -> (Vec3, Vec3) {
        let forward = (self.camera.target - self.camera.origin).normalize_or(Vec3::NEG_Z);
        (forward, forward.cross(self.up).normalize_or(Vec3::X))
    }

    fn shift(&mut self, by: Vec3) {
        self.place(self.camera.origin + by, self.camera.target + by);
    }

    fn place(&mut self, origin: Vec3, target: Vec3) {
        if origin.is_finite() && target.is_finite() && origin.distance(target) > 1e-6 {
            self.camera = Camera { origin, target, up: self.up, ..self.camera };
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn orbit() -> Orbit {
        Orbit::new(Camera::default())
    }

    #[test]
    fn turning_keeps_the_distance_and_never_crosses_the_pole() {
        let mut turned = orbit();
        for _ in 0..100 {
            turned.drag(Drag::Orbit, Vec2::new(7.0, 40.0), 600.0);
            let camera = turned.camera();
            assert!((camera.origin.distance(camera.target) - 3.0).abs() < 1e-3);
            assert!(camera.check().is_ok(), "{camera:?}");
        }
        assert!(turned.camera().origin.y > 2.5, "it looks down from above: {:?}", turned.camera());
    }

    #[test]
    fn panning_follows_the_pointer() {
        let mut panned = orbit();
        let lens = panned.camera().lens();
        // What lies in the middle of the picture, at the target's depth, is dragged by 48 of 480 points to the right.
        panned.drag(Drag::Pan, Vec2::new(48.0, -24.0), 480.0);
        let (x, y, _) = panned.camera().lens().project(Vec3::ZERO).unwrap();
        let (x_before, y_before, _) = lens.project(Vec3::ZERO).unwrap();
        assert!((x - x_before - 48.0).abs() < 0.1 && (y - y_before + 24.0).abs() < 0.1, "{x} {y}");
    }

    #[test]
    fn there_is_no_way_through_the_pivot_and_home_is_home() {
        let mut near = orbit();
        near.pivot = Some(Vec3::new(0.0, 0.0, 1.0));
        for _ in 0..100 {
            near.dolly(-0.5);
        }
        assert!(near.camera().origin.z > 0.999, "{:?}", near.camera());
        near.walk(Vec3::new(1.0, 1.0, -1.0), 0.1);
        near.gaze(Vec2::ONE, 0.1);
        near.go_home();
        assert_eq!(near.camera(), Camera::default());
    }

    #[test]
    fn a_ball_that_is_framed_fits() {
        let mut framed = orbit();
        let (centre, radius) = (Vec3::new(5.0, 1.0, 2.0), 0.7);
        framed.frame(centre, radius, 4.0 / 3.0);
        let lens = framed.camera().lens();
        for side in [Vec3::X, Vec3::Y, -Vec3::X, -Vec3::Y] {
            let (x, y, _) = lens.project(centre + side * radius).unwrap();
            assert!((0.0..640.0).contains(&x) && (0.0..480.0).contains(&y), "{x} {y}");
        }
    }
}
