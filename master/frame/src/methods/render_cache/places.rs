//! Where points lie, eight by eight, and where a camera sees them: coordinate by coordinate, so that eight are projected in
//! the time of two.

use glam::Vec3;
use scenes::Camera;

use super::point::Place;

/// Places that lie together.
pub(super) const GROUP: usize = 8;
/// Of what no pixel shows.
pub(super) const NOWHERE: u32 = u32::MAX;
/// The distance of what is infinitely far: so large that it is beyond everything, so small that nine of them have a mean.
pub(super) const FAR: f32 = 1e30;

type Eight = [f32; GROUP];

/// Where the points of a group lie.
#[derive(Clone, Copy, Debug)]
#[repr(align(64))]
pub(super) struct Places {
    x: Eight,
    y: Eight,
    z: Eight,
    /// 1 for what is in the scene, 0 for what is infinitely far in this direction, no number where there is nothing.
    w: Eight,
}

impl Places {
    pub const NOTHING: Self =
        Self { x: [f32::NAN; GROUP], y: [f32::NAN; GROUP], z: [f32::NAN; GROUP], w: [f32::NAN; GROUP] };

    /// `None` where there is nothing.
    pub fn get(&self, at: usize) -> Option<Place> {
        let place = Vec3::new(self.x[at], self.y[at], self.z[at]);
        match self.w[at] {
            1.0 => Some(Place::Near(place)),
            0.0 => Some(Place::Far(place)),
            _ => None,
        }
    }

    pub fn set(&mut self, at: usize, place: Option<Place>) {
        let (place, w) = match place {
            Some(Place::Near(place)) => (place, 1.0),
            Some(Place::Far(direction)) => (direction, 0.0),
            None => (Vec3::NAN, f32::NAN),
        };
        (self.x[at], self.y[at], self.z[at], self.w[at]) = (place.x, place.y, place.z, w);
    }
}

/// A camera made ready to find the pixels of many points: [`scenes::camera::Lens::project`], many at a time.
#[derive(Clone, Copy, Debug)]
pub(super) struct Projection {
    eye: Vec3,
    /// Along the picture's axes and into it; the first two in pixels at unit depth.
    right: Vec3,
    down: Vec3,
    forward: Vec3,
    width: f32,
    height: f32,
    /// Where the axis into the picture is.
    middle: [f32; 2],
    /// Depth before which nothing is seen.
    near: f32,
    columns: i32,
}

impl Projection {
    pub fn of(camera: &Camera) -> Self {
        let lens = camera.lens();
        let [right, down, forward] = lens.axes();
        let per_pixel = 1.0 / lens.pixel();
        Self {
            eye: lens.origin(),
            right: right * per_pixel,
            down: down * per_pixel,
            forward,
            width: camera.width as f32,
            height: camera.height as f32,
            middle: lens.middle(),
            near: lens.near(),
            columns: camera.width as i32,
        }
    }

    /// The same with square cells of so many pixels a side in their place, the last of which may stand out.
    pub fn in_cells(self, side: u32) -> Self {
        let share = 1.0 / side as f32;
        Self {
            right: self.right * share,
            down: self.down * share,
            width: self.width * share,
            height: self.height * share,
            middle: self.middle.map(|at| at * share),
            columns: (self.columns as u32).div_ceil(side) as i32,
            ..self
        }
    }

    /// The pixels in which points are seen, [`NOWHERE`] for those that are not, and their distances from the eye.
    #[inline]
    pub fn pixels(&self, places: &Places) -> ([u32; GROUP], Eight) {
        let (mut pixels, mut distances) = ([NOWHERE; GROUP], [0.0; GROUP]);
        let [half_width, half_height] = self.middle;
        for at in 0..GROUP {
            let w = places.w[at];
            let (x, y, z) =
                (places.x[at] - w * self.eye.x, places.y[at] - w * self.eye.y, places.z[at] - w * self.eye.z);
            let along = |axis: Vec3| x * axis.x + y * axis.y + z * axis.z;
            let depth = along(self.forward);
            let scale = 1.0 / depth;
            let column = along(self.right) * scale + half_width;
            let row = along(self.down) * scale + half_height;
            // Each is false of what is no number; what is infinitely far is cut away by nothing.
            let is_seen =
                (depth > self.near * w) & (column >= 0.0) & (column < self.width) & (row >= 0.0) & (row < self.height);
            let pixel = (row as i32).wrapping_mul(self.columns).wrapping_add(column as i32);
            pixels[at] = if is_seen { pixel as u32 } else { NOWHERE };
            distances[at] = if w > 0.0 { (x * x + y * y + z * z).sqrt() } else { FAR };
        }
        (pixels, distances)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn eight_are_projected_as_each_is(
            places in prop::array::uniform8((-4.0f32..4.0, -4.0f32..4.0, -4.0f32..4.0, 0u8..3)),
        ) {
            let camera = Camera { width: 40, height: 30, ..Camera::default() };
            let lens = camera.lens();
            let mut group = Places::NOTHING;
            for (at, (x, y, z, kind)) in places.into_iter().enumerate() {
                let at_place = Vec3::new(x, y, z);
                let place = [None, Some(Place::Near(at_place)), Some(Place::Far(at_place))][usize::from(kind)];
                group.set(at, place);
                prop_assert_eq!(group.get(at), place);
            }
            let (pixels, distances) = Projection::of(&camera).pixels(&group);
            for at in 0..GROUP {
                let seen = match group.get(at) {
                    None => None,
                    Some(Place::Near(point)) => lens.project(point),
                    Some(Place::Far(direction)) => lens.project(lens.origin() + direction),
                };
                // What lies on the edge of a pixel may be rounded into either.
                let is_edge = |x: f32| (x - x.round()).abs() < 1e-2;
                let Some((x, y, distance)) = seen.filter(|(x, y, _)| !is_edge(*x) && !is_edge(*y)) else {
                    prop_assert!(seen.is_some() || pixels[at] == NOWHERE);
                    continue;
                };
                let is_inside = x > 0.0 && y > 0.0 && x < 40.0 && y < 30.0;
                prop_assert_eq!(pixels[at], if is_inside { y as u32 * 40 + x as u32 } else { NOWHERE });
                if let Some(Place::Near(_)) = group.get(at) {
                    prop_assert!((distances[at] - distance).abs() <= 1e-5 * distance);
                } else {
                    prop_assert_eq!(distances[at], FAR);
                }
            }
        }
    }
}
