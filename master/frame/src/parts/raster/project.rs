//! From the scene to the picture plane.

use glam::{DVec3, Vec3};
use scenes::{Camera, Transform};

/// Steps of a pixel that vertices are snapped to, as a power of two.
pub(super) const SUBPIXEL_BITS: u32 = 8;
pub(super) const SUBPIXELS: i32 = 1 << SUBPIXEL_BITS;
/// Vertices farther aside than so many pixels are not put on the plane: edges between those that are fit into 64 bits.
const ASIDE_MAX: f32 = (1 << 20) as f32;
/// What is clipped ends here, well before.
pub(super) const CLIPPED_ASIDE: f64 = (1 << 19) as f64;

/// How a camera sees. *View space* has the eye at its origin and the axes right, down and forward.
#[derive(Clone, Copy, Debug)]
pub(super) struct Projection {
    origin: Vec3,
    axes: [Vec3; 3],
    pixel: f32,
    /// Where the forward axis meets the picture, pixels.
    half: [f32; 2],
    /// Depth before which nothing is seen.
    near: f32,
}

/// A vertex on the picture plane, in steps from its top left corner; or that it cannot be put there.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct OnPicture(pub [i32; 2]);

impl OnPicture {
    /// Behind the eye, or cut away.
    const BEHIND: Self = Self([i32::MIN, 0]);
    /// Too far aside.
    const ASIDE: Self = Self([i32::MIN, 1]);

    pub fn is_behind(self) -> bool {
        self == Self::BEHIND
    }

    pub fn is_known(self) -> bool {
        self.0[0] != i32::MIN
    }
}

impl Projection {
    pub fn of(camera: &Camera) -> Self {
        let lens = camera.lens();
        let (half, near) = (lens.middle(), lens.near());
        Self { origin: lens.origin(), axes: lens.axes(), pixel: lens.pixel(), half, near }
    }

    /// Into view space.
    #[inline]
    pub fn view(&self, point: Vec3) -> Vec3 {
        let offset = point - self.origin;
        Vec3::from_array(self.axes.map(|axis| offset.dot(axis)))
    }

    /// Where a point of view space is on the picture.
    #[inline]
    pub fn on_picture(&self, view: Vec3) -> OnPicture {
        if view.z <= self.near {
            return OnPicture::BEHIND;
        }
        let scale = 1.0 / (view.z * self.pixel);
        let [x, y] = [view.x * scale + self.half[0], view.y * scale + self.half[1]];
        // Also of no number: then it is clipped.
        if x.abs().max(y.abs()) <= ASIDE_MAX { OnPicture([snap(x), snap(y)]) } else { OnPicture::ASIDE }
    }

    /// The vertices of a mesh at a place.
    pub fn project_all(&self, place: &Transform, from: &[Vec3], to: &mut [OnPicture]) {
        let is_placed = place.is_identity();
        for (to, from) in to.iter_mut().zip(from) {
            let at = if is_placed { *from } else { place.point(*from) };
            *to = self.on_picture(self.view(at));
        }
    }

    /// As [`Self::on_picture`], of a corner of what was clipped: it is in front, and not too far aside. A corner that was one
    /// before is where it is for triangles that were not clipped: else there would be gaps between these and those.
    pub fn clipped(&self, view: DVec3) -> [i32; 2] {
        let before = view.as_vec3();
        if before.as_dvec3() == view
            && let known = self.on_picture(before)
            && known.is_known()
        {
            return known.0;
        }
        let scale = 1.0 / (view.z * f64::from(self.pixel));
        [view.x * scale + f64::from(self.half[0]), view.y * scale + f64::from(self.half[1])]
            .map(|at| (at * f64::from(SUBPIXELS)).round() as i32)
    }

    /// Depth before which nothing is seen.
    pub fn near(&self) -> f64 {
        f64::from(self.near)
    }

    /// How far aside, over the depth, clipping leaves things.
    pub fn clipped_slope(&self) -> f64 {
        f64::from(self.pixel) * CLIPPED_ASIDE
    }

    /// A linear function of the direction in view space whose forward part is 1, as one of pixels: `[a, b, c]` for
    /// `a x + b y + c`.
    pub fn by_pixel(&self, by_direction: DVec3) -> [f64; 3] {
        let pixel = f64::from(self.pixel);
        let [a, b] = [by_direction.x * pixel, by_direction.y * pixel];
        [a, b, by_direction.z - a * f64::from(self.half[0]) - b * f64::from(self.half[1])]
    }
}

#[inline]
fn snap(at: f32) -> i32 {
    // Truncation, where rounding would be a call of a function: what lies left or above of the picture is off by one step,
    // for all triangles alike.
    (at * SUBPIXELS as f32 + 0.5) as i32
}
