//! What the points of the cache look like from the camera: the nearest in each pixel (section 3), and which of these are
//! likely to lie behind a surface that shows gaps (section 3.1).

use rayon::prelude::*;
use scenes::Camera;

use super::places::{GROUP, NOWHERE, Places, Projection};
use super::points::Points;

/// Which point each pixel shows.
#[derive(Clone, Debug, Default)]
pub(super) struct PointImage {
    pub width: usize,
    pub height: usize,
    /// Slots; [`NONE`] where there is no point.
    pub slots: Vec<u32>,
    /// Distances from the eye, [`super::places::FAR`] for what is infinitely far; 0 where there is no point.
    pub depths: Vec<f32>,
    /// While points are projected, of what each thread has met: the bits of the least distance, which order as distances do,
    /// and the slot below them; behind the pixels one more, which takes what none shows.
    nearest: Vec<Vec<u64>>,
    culling: [Rows; 3],
}

/// No point.
pub(super) const NONE: u32 = u32::MAX;
/// No point has been met.
const NOTHING: u64 = u64::MAX;
/// Threads that project, at most: each has a picture of its own.
const THREADS_MAX: usize = 4;
/// Pictures with fewer pixels are projected by one thread.
const PIXELS_MIN: usize = 1 << 14;

/// Sums of three rows over three columns: of depths, and of how many there are.
#[derive(Clone, Debug, Default)]
struct Rows {
    depths: Vec<f32>,
    counts: Vec<f32>,
}

impl PointImage {
    /// No pixel of a picture of this size shows anything.
    pub fn clear(&mut self, [width, height]: [u32; 2]) {
        (self.width, self.height) = (width as usize, height as usize);
        let pixels = self.width * self.height;
        let threads = if pixels < PIXELS_MIN { 1 } else { rayon::current_num_threads().clamp(1, THREADS_MAX) };
        self.nearest.resize(threads, Vec::new());
        self.nearest.par_iter_mut().for_each(|nearest| {
            nearest.clear();
            nearest.resize(pixels + 1, NOTHING);
        });
    }

    /// Projects all points onto a picture that is clear; of those in a pixel the nearest is shown, of equally near ones that
    /// in the first slot, so that nothing depends on how many threads there are.
    pub fn project(&mut self, points: &mut Points, camera: &Camera) {
        let projection = Projection::of(camera);
        let (places, pixels) = points.projected();
        let part = places.len().div_ceil(self.nearest.len().max(1)).max(1);
        let parts = places.par_chunks(part).zip(pixels.par_chunks_mut(part * GROUP));
        self.nearest.par_iter_mut().zip(parts).enumerate().for_each(|(number, (nearest, (places, pixels)))| {
            project_part(&projection, nearest, (number * part * GROUP) as u32, places, pixels);
        });
        self.merge();
        // Whoever is behind another is not seen.
        let slots = &self.slots;
        pixels.par_chunks_mut(SLOTS_AT_A_TIME).enumerate().for_each(|(part, pixels)| {
            for (slot, pixel) in ((part * SLOTS_AT_A_TIME) as u32..).zip(pixels) {
                let shown = slots.get(*pixel as usize).copied().unwrap_or(NONE);
                *pixel = if shown == slot { *pixel } else { NOWHERE };
            }
        });
    }

    /// The nearest of all that threads have met.
    fn merge(&mut self) {
        let pixels = self.width * self.height;
        self.slots.resize(pixels, NONE);
        self.depths.resize(pixels, 0.0);
        let nearest = &self.nearest;
        let parts = self.slots.par_chunks_mut(PIXELS_MIN).zip(self.depths.par_chunks_mut(PIXELS_MIN));
        parts.enumerate().for_each(|(part, (slots, depths))| {
            let first = part * PIXELS_MIN;
            for (pixel, (slot, depth)) in (first..).zip(slots.iter_mut().zip(depths)) {
                let least = nearest.iter().fold(NOTHING, |least, nearest| least.min(nearest[pixel]));
                *slot = least as u32;
                *depth = if least == NOTHING { 0.0 } else { f32::from_bits((least >> 32) as u32) };
            }
        });
    }

    /// Takes away points that lie more than this share behind the mean depth of their 3×3 neighbourhood: a nearer surface
    /// that was seen from elsewhere, and shows gaps, should hide them. Takes some that are visible, too, at the edges of
    /// nearer things, which the interpolation covers.
    pub fn cull(&mut self, points: &mut Points, share: f32) {
        let (width, height) = (self.width, self.height);
        if width == 0 {
            return;
        }
        for rows in &mut self.culling {
            rows.depths.resize(width, 0.0);
            rows.counts.resize(width, 0.0);
        }
        let (mut depth, mut count, mut is_far) = (vec![0.0; width], vec![0.0; width], vec![false; width]);
        let limit = 1.0 + share;
        for y in 0..height {
            // A row is summed up before anything is taken out of it.
            for below in if y == 0 { 0..2.min(height) } else { y + 1..(y + 2).min(height) } {
                self.culling[below % 3].sum(&self.depths[below * width..][..width]);
            }
            depth.fill(0.0);
            count.fill(0.0);
            for row in y.saturating_sub(1)..(y + 2).min(height) {
                let rows = &self.culling[row % 3];
                depth.iter_mut().zip(&rows.depths).for_each(|(sum, more)| *sum += more);
                count.iter_mut().zip(&rows.counts).for_each(|(sum, more)| *sum += more);
            }
            let (depths, slots) = (&mut self.depths[y * width..][..width], &mut self.slots[y * width..][..width]);
            for ((is_far, own), (sum, count)) in is_far.iter_mut().zip(&*depths).zip(depth.iter().zip(&count)) {
                *is_far = own * count > limit * sum;
            }
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

/// Slots that a thread takes at a time.
const SLOTS_AT_A_TIME: usize = 1 << 14;

/// Finds the nearest of a part of the points, the first of which is in slot `first`, and the pixel that each would be in.
/// There are no branches, so that pixels that are far apart in memory are waited for together.
fn project_part(projection: &Projection, nearest: &mut [u64], first: u32, places: &[Places], pixels: &mut [u32]) {
    let nowhere = nearest.len() - 1;
    for ((number, places), pixels) in (0..).zip(places).zip(pixels.chunks_exact_mut(GROUP)) {
        let (seen, distances) = projection.pixels(places);
        pixels.copy_from_slice(&seen);
        for at in 0..GROUP {
            let key = u64::from(distances[at].to_bits()) << 32 | u64::from(first + number * GROUP as u32 + at as u32);
            let shown = &mut nearest[(seen[at] as usize).min(nowhere)];
            *shown = (*shown).min(key);
        }
    }
}

impl Rows {
    /// Each value of a row with its neighbours to the left and to the right.
    fn sum(&mut self, row: &[f32]) {
        over_three(row, &mut self.depths, |depth| depth);
        over_three(row, &mut self.counts, |depth| if depth > 0.0 { 1.0 } else { 0.0 });
    }
}

fn over_three(row: &[f32], sums: &mut [f32], value: impl Fn(f32) -> f32) {
    sums.iter_mut().zip(row).for_each(|(sum, own)| *sum = value(*own));
    sums.iter_mut().skip(1).zip(row).for_each(|(sum, left)| *sum += value(*left));
    sums.iter_mut().zip(&row[1..]).for_each(|(sum, right)| *sum += value(*right));
}

#[cfg(test)]
mod tests {
    use glam::Vec3;
    use proptest::prelude::*;
    use scenes::Camera;

    use super::super::point::{Known, Light, Place, Sampled};
    use super::*;

    fn known(number: u32) -> Known {
        let light = Light { emitted: Vec3::splat(number as f32), ..Light::default() };
        Known { sampled: Sampled { light, count: 1, ..Sampled::default() }, ..Known::default() }
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
        let number = |slot: &u32| (*slot != NONE).then(|| points.light(*slot).emitted.x as u32);
        image.slots.iter().map(number).collect()
    }

    #[test]
    fn the_same_camera_sees_every_point_where_it_was() {
        let camera = camera(17, 11);
        let mut points = Points::new(187);
        plane(&mut points, &camera, 3.0, 1, |_, _| true);
        let mut image = PointImage::default();
        image.clear([17, 11]);
        image.project(&mut points, &camera);
        assert_eq!(image.share_known(), 1.0);
        for (pixel, slot) in (0..).zip(&image.slots) {
            let lens = camera.lens();
            let Some(Place::Near(point)) = points.place(*slot) else { panic!("it is there") };
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
        image.project(&mut points, &camera);
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
        let far = points.all().into_iter().filter(|(slot, _)| points.light(*slot).emitted.x == 2.0);
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
        image.project(&mut points, &camera);
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
                    let z = f32::from(z) * 0.5 + number as f32 * 1e-3;
                    points.insert(Place::Near(Vec3::new(x, y, z)), known(number as u32));
                }
                let mut image = PointImage::default();
                image.clear([8, 6]);
                image.project(&mut points, &camera);
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
