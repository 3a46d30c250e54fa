//! What the points of the cache look like from the camera: the nearest in each pixel (section 3), and which of these are
//! likely to lie behind a surface that shows gaps (section 3.1).

use scenes::camera::Lens;

use super::points::{Place, Points};

/// Which point each pixel shows.
#[derive(Clone, Debug, Default)]
pub(super) struct PointImage {
    pub width: usize,
    pub height: usize,
    /// Slots; [`NONE`] where there is no point.
    pub slots: Vec<u32>,
    /// Distances from the eye, [`FAR`] for what is infinitely far; 0 where there is no point.
    pub depths: Vec<f32>,
    /// While points are projected: the bits of the least distance, which order as distances do, and the slot below them.
    nearest: Vec<u64>,
}

/// No point.
pub(super) const NONE: u32 = u32::MAX;
/// The depth of what is infinitely far: so large that it is beyond everything, so small that nine of them have a mean.
pub(super) const FAR: f32 = 1e30;

impl PointImage {
    /// No pixel of a picture of this size shows anything.
    pub fn clear(&mut self, [width, height]: [u32; 2]) {
        (self.width, self.height) = (width as usize, height as usize);
        self.nearest.clear();
        self.nearest.resize(self.width * self.height, u64::MAX);
    }

    /// Projects all points onto a picture that is clear; of those in a pixel the nearest is shown, of equally near ones the
    /// one that comes first by name, so that nothing depends on the order of the cache.
    pub fn project(&mut self, points: &mut Points, lens: &Lens) {
        for (slot, place) in (0..).zip(points.places()) {
            let Some(place) = place else { continue };
            let Some((pixel, depth)) = self.pixel_of(lens, *place) else { continue };
            let shown = &mut self.nearest[pixel];
            let key = u64::from(depth.to_bits()) << 32 | u64::from(slot);
            let is_nearer = match (key >> 32).cmp(&(*shown >> 32)) {
                std::cmp::Ordering::Less => true,
                std::cmp::Ordering::Equal => rank(points, slot) < rank(points, *shown as u32),
                std::cmp::Ordering::Greater => false,
            };
            if is_nearer {
                *shown = key;
            }
        }
        points.unsee();
        self.slots.clear();
        self.depths.clear();
        self.slots.extend(self.nearest.iter().map(|key| *key as u32));
        let depth = |key: &u64| if *key == u64::MAX { 0.0 } else { f32::from_bits((key >> 32) as u32) };
        self.depths.extend(self.nearest.iter().map(depth));
        for (pixel, slot) in self.slots.iter().enumerate().filter(|(_, slot)| **slot != NONE) {
            points.see(*slot, pixel as u32);
        }
    }

    /// Where a place is seen, and how far it is.
    fn pixel_of(&self, lens: &Lens, place: Place) -> Option<(usize, f32)> {
        let (x, y, depth) = match place {
            Place::Near(point) => lens.project(point)?,
            Place::Far(direction) => {
                let (x, y, _) = lens.project(lens.origin() + direction)?;
                (x, y, FAR)
            }
        };
        let is_inside = x >= 0.0 && y >= 0.0 && x < self.width as f32 && y < self.height as f32;
        is_inside.then(|| (y as usize * self.width + x as usize, depth))
    }

    /// Takes away points that lie more than this share behind the mean depth of their 3×3 neighbourhood: a nearer surface
    /// that was seen from elsewhere, and shows gaps, should hide them. Takes some that are visible, too, at the edges of
    /// nearer things, which the interpolation covers.
    pub fn cull(&mut self, points: &mut Points, share: f32) {
        let (width, height) = (self.width, self.height);
        if width == 0 {
            return;
        }
        // Over three columns: the sum of depths, and how many there are.
        let len = self.depths.len();
        let (mut sums, mut counts) = (vec![0.0; len], vec![0.0; len]);
        let mut is_there = vec![0.0; width];
        for ((row, sums), counts) in self.depths.chunks(width).zip(sums.chunks_mut(width)).zip(counts.chunks_mut(width))
        {
            is_there.iter_mut().zip(row).for_each(|(is, depth)| *is = if *depth > 0.0 { 1.0 } else { 0.0 });
            over_three(row, sums);
            over_three(&is_there, counts);
        }
        let (mut sum, mut count, mut is_far) = (vec![0.0; width], vec![0.0; width], vec![false; width]);
        let limit = 1.0 + share;
        for y in 0..height {
            sum.fill(0.0);
            count.fill(0.0);
            for row in y.saturating_sub(1)..(y + 2).min(height) {
                sum.iter_mut().zip(&sums[row * width..]).for_each(|(sum, more)| *sum += more);
                count.iter_mut().zip(&counts[row * width..]).for_each(|(count, more)| *count += more);
            }
            let depths = &mut self.depths[y * width..][..width];
            let mean = sum.iter().zip(&count);
            for ((is_far, depth), (sum, count)) in is_far.iter_mut().zip(&*depths).zip(mean) {
                *is_far = depth * count > limit * sum;
            }
            let slots = &mut self.slots[y * width..][..width];
            for ((slot, depth), _) in slots.iter_mut().zip(depths).zip(&is_far).filter(|(_, is_far)| **is_far) {
                points.hide(std::mem::replace(slot, NONE));
                *depth = 0.0;
            }
        }
    }

    /// Share of the pixels that show a point, 0..=1.
    pub fn share_known(&self) -> f32 {
        let count = self.slots.iter().filter(|slot| **slot != NONE).count();
        count as f32 / self.slots.len().max(1) as f32
    }
}

/// Each value with its neighbours to the left and to the right.
fn over_three(row: &[f32], sums: &mut [f32]) {
    sums.copy_from_slice(row);
    sums.iter_mut().skip(1).zip(row).for_each(|(sum, left)| *sum += left);
    sums.iter_mut().zip(&row[1..]).for_each(|(sum, right)| *sum += right);
}

/// The order of points that are equally near.
fn rank(points: &Points, slot: u32) -> ([u32; 4], u32) {
    let name = points.known(slot).name;
    let key = name.map_or([u32::MAX; 4], |name| {
        let [u, v] = name.uv.map(f32::to_bits);
        [name.object, name.triangle, u, v]
    });
    (key, slot)
}

#[cfg(test)]
mod tests {
    use glam::Vec3;
    use proptest::prelude::*;
    use scenes::{Camera, SurfacePoint};

    use super::super::points::{Hint, Known, Light};
    use super::*;

    fn known(number: u32) -> Known {
        let name = Some(SurfacePoint { object: number, ..SurfacePoint::default() });
        let light = Light { emitted: Vec3::splat(number as f32), ..Light::default() };
        Known { name, light, count: 1, revision: 0, hint: Hint::Matt, last: None }
    }

    fn camera(width: u32, height: u32) -> Camera {
        Camera { width, height, ..Camera::default() }
    }

    /// A point for each pixel of a picture, on a plane before the eye.
    fn plane(points: &mut Points, camera: &Camera, distance: f32, number: u32, is_there: impl Fn(u32, u32) -> bool) {
        let lens = camera.lens();
        for y in 0..camera.height {
            for x in (0..camera.width).filter(|x| is_there(*x, y)) {
                let direction = lens.direction(x as f32 + 0.5, y as f32 + 0.5);
                points.insert(Place::Near(lens.origin() + direction * distance), known(number));
            }
        }
    }

    fn numbers(image: &PointImage, points: &Points) -> Vec<Option<u32>> {
        let number = |slot: &u32| (*slot != NONE).then(|| points.known(*slot).light.emitted.x as u32);
        image.slots.iter().map(number).collect()
    }

    #[test]
    fn the_same_camera_sees_every_point_where_it_was() {
        let camera = camera(17, 11);
        let mut points = Points::new(187);
        plane(&mut points, &camera, 3.0, 1, |_, _| true);
        let mut image = PointImage::default();
        image.clear([17, 11]);
        image.project(&mut points, &camera.lens());
        assert_eq!(image.share_known(), 1.0);
        for (pixel, slot) in (0..).zip(&image.slots) {
            let lens = camera.lens();
            let Some(Place::Near(point)) = points.places()[*slot as usize] else { panic!("it is there") };
            let (x, y, _) = lens.project(point).unwrap();
            assert_eq!(y as u32 * 17 + x as u32, pixel);
            assert!(points.is_seen(*slot));
        }
    }

    #[test]
    fn what_shows_through_the_gaps_of_a_nearer_surface_is_taken_away_and_nothing_else() {
        let camera = camera(24, 16);
        let mut points = Points::new(800);
        // Each third column of the near plane is missing, and the far one is behind all of it.
        plane(&mut points, &camera, 5.0, 2, |_, _| true);
        plane(&mut points, &camera, 2.0, 1, |x, _| x % 3 != 1);
        let mut image = PointImage::default();
        image.clear([24, 16]);
        image.project(&mut points, &camera.lens());
        let shown = numbers(&image, &points);
        assert_eq!((shown[0], shown[1]), (Some(1), Some(2)));
        image.cull(&mut points, 0.1);
        let culled = numbers(&image, &points);
        for (pixel, number) in culled.iter().enumerate() {
            let is_gap = pixel % 24 % 3 == 1;
            assert_eq!(*number, if is_gap { None } else { Some(1) }, "pixel {pixel}");
        }
        assert!(image.depths.iter().zip(&culled).all(|(depth, number)| (*depth > 0.0) == number.is_some()));
        let is_hidden = |slot: u32| !points.is_seen(slot);
        let far = (0..)
            .zip(points.places())
            .filter(|(slot, place)| place.is_some() && points.known(*slot).light.emitted.x == 2.0);
        assert!(far.clone().count() == 384 && far.into_iter().all(|(slot, _)| is_hidden(slot)));
    }

    #[test]
    fn a_surface_that_leans_back_is_no_gap() {
        // Ten per cent is not reached within three pixels, and what is infinitely far is one surface.
        let camera = camera(20, 20);
        let lens = camera.lens();
        let mut points = Points::new(400);
        for y in 0..20 {
            for x in 0..20 {
                let direction = lens.direction(x as f32 + 0.5, y as f32 + 0.5);
                let place = match y < 10 {
                    true => Place::Far(direction),
                    false => Place::Near(lens.origin() + direction * (2.0 + 0.1 * x as f32)),
                };
                points.insert(place, known(1));
            }
        }
        let mut image = PointImage::default();
        image.clear([20, 20]);
        image.project(&mut points, &lens);
        image.cull(&mut points, 0.1);
        let lost: Vec<usize> = (0..400).filter(|pixel| image.slots[*pixel] == NONE).collect();
        assert!(lost.iter().all(|pixel| pixel / 20 == 9), "only the sky beside the edge: {lost:?}");
    }

    proptest! {
        /// Points in any order: the same picture.
        #[test]
        fn the_nearest_wins_whatever_the_order_of_the_cache(
            places in prop::collection::vec((-1.0f32..1.0, -1.0f32..1.0, 0u8..4), 1..120),
            turn in 0usize..120,
        ) {
            let camera = camera(8, 6);
            let project = |order: Vec<usize>| {
                let mut points = Points::new(places.len());
                for number in order {
                    let (x, y, z) = places[number];
                    points.insert(Place::Near(Vec3::new(x, y, f32::from(z) * 0.5)), known(number as u32));
                }
                let mut image = PointImage::default();
                image.clear([8, 6]);
        image.project(&mut points, &camera.lens());
                numbers(&image, &points)
            };
            let mut order: Vec<usize> = (0..places.len()).collect();
            let first = project(order.clone());
            order.rotate_left(turn % places.len());
            order.reverse();
            prop_assert_eq!(first, project(order));
        }
    }
}
