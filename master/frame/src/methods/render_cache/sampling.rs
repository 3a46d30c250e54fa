//! Where the renderer should look next (section 4): a priority for each pixel, made binary by error diffusion, so that
//! samples lie dense where they matter and well apart everywhere; and, before the camera gets there, what it will see
//! that nothing is known of (Walter et al. 2002).

use scenes::Camera;

use super::places::{NOWHERE, Projection};
use super::points::{AGE_UNIT, Points};
use super::project::{NONE, PointImage};

/// Of a pixel without points around it; the same as of the oldest point.
const PRIORITY_MAX: u32 = 255 * AGE_UNIT;
/// … and less for each neighbour that has one.
const PER_NEIGHBOUR: u32 = 16 * AGE_UNIT;

/// How much a sample of each pixel is worth, in 1/256 of a byte: the age of its point, or of a pixel without one the
/// more the fewer of its neighbours have any. Never 0.
pub(super) fn priorities(points: &Points, image: &PointImage, into: &mut Vec<u32>) {
    let (width, height) = (image.width, image.height);
    into.clear();
    into.extend(image.slots.iter().enumerate().map(|(pixel, slot)| {
        if *slot != NONE {
            return u32::from(points.age(*slot)).clamp(1, PRIORITY_MAX);
        }
        let (x, y) = (pixel % width, pixel / width);
        let mut neighbours = 0;
        for there_y in y.saturating_sub(1)..(y + 2).min(height) {
            let row = &image.slots[there_y * width..][x.saturating_sub(1)..(x + 2).min(width)];
            neighbours += row.iter().filter(|slot| **slot != NONE).count() as u32;
        }
        PRIORITY_MAX - PER_NEIGHBOUR * neighbours
    }));
}

/// What error diffusion gives.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct Dithered {
    /// Pixels that are requested, in the order of the scan.
    pub pixels: Vec<u32>,
    /// The priority that a request is worth.
    pub threshold: u64,
    /// Priority that fell off the lower edge.
    pub lost: u64,
}

/// Chooses about `count` pixels. Lines are scanned in alternating directions; a pixel whose priority reaches the threshold
/// Σp/count is requested, and the threshold subtracted; what is left goes on, half to the next pixel and half to the next
/// line. In whole numbers, so that nothing is lost to rounding.
pub(super) fn dither(priorities: &[u32], [width, height]: [usize; 2], count: usize) -> Dithered {
    let total: u64 = priorities.iter().map(|p| u64::from(*p)).sum();
    if count == 0 || total == 0 {
        return Dithered { lost: total, ..Dithered::default() };
    }
    let threshold = (total / count as u64).max(1);
    let mut pixels = Vec::with_capacity(count + 1);
    let (mut here, mut below) = (vec![0_u64; width], vec![0_u64; width]);
    for y in 0..height {
        let row = &priorities[y * width..][..width];
        let mut carried = 0;
        for step in 0..width {
            let x = if y % 2 == 0 { step } else { width - 1 - step };
            let mut worth = u64::from(row[x]) + here[x] + carried;
            if worth >= threshold {
                pixels.push((y * width + x) as u32);
                worth -= threshold;
            }
            // The pixel after the last of a line is the one below it.
            let on = if step + 1 < width { worth / 2 } else { 0 };
            (carried, below[x]) = (on, worth - on);
        }
        std::mem::swap(&mut here, &mut below);
    }
    Dithered { pixels, threshold, lost: here.iter().sum() }
}

/// Sides of the cells in which occupancy is predicted, pixels.
const CELL: u32 = 4;

/// Where a camera that goes on as from `before` to `now` is so many pictures later.
pub(super) fn ahead(before: &Camera, now: &Camera, pictures: u32) -> Camera {
    let times = pictures as f32;
    let origin = now.origin + (now.origin - before.origin) * times;
    let target = now.target + (now.target - before.target) * times;
    Camera { origin, target, ..*now }
}

/// Pixels of the camera around which no point is seen: one in the middle of each cell of 4×4 without any, at most `most`
/// of them, then evenly chosen in the order of lines.
pub(super) fn unoccupied(points: &Points, camera: &Camera, most: usize) -> Vec<[u32; 2]> {
    let [columns, rows] = [camera.width, camera.height].map(|side| side.div_ceil(CELL));
    let cells = Projection::of(camera).in_cells(CELL);
    let mut occupied = vec![false; columns as usize * rows as usize];
    for places in points.places() {
        let (seen, _) = cells.pixels(places);
        seen.into_iter().filter(|cell| *cell != NOWHERE).for_each(|cell| occupied[cell as usize] = true);
    }
    let empty: Vec<u32> = (0..).zip(&occupied).filter_map(|(cell, is)| (!is).then_some(cell)).collect();
    let count = most.min(empty.len());
    let middle = |cell: u32| {
        let middle = [cell % columns, cell / columns].map(|at| at * CELL + CELL / 2);
        [middle[0].min(camera.width - 1), middle[1].min(camera.height - 1)]
    };
    (0..count).map(|number| middle(empty[number * empty.len() / count])).collect()
}

#[cfg(test)]
mod tests {
    use glam::Vec3;
    use proptest::prelude::*;

    use super::super::point::{Known, Place};
    use super::*;

    proptest! {
        #[test]
        fn priority_is_neither_made_nor_lost(
            width in 1usize..40, height in 1usize..30, count in 0usize..300, seed: u32,
        ) {
            let random = |i: usize| (i as u32 + 1).wrapping_mul(seed | 1).wrapping_mul(0x9e37_79b9) >> 16;
            let priorities: Vec<u32> = (0..width * height).map(random).collect();
            let total: u64 = priorities.iter().map(|p| u64::from(*p)).sum();
            let dithered = dither(&priorities, [width, height], count);
            prop_assert_eq!(dithered.threshold * dithered.pixels.len() as u64 + dithered.lost, total);
            let mut sorted = dithered.pixels.clone();
            sorted.sort_unstable();
            sorted.dedup();
            prop_assert_eq!(sorted.len(), dithered.pixels.len(), "each pixel once");
            // The threshold is rounded down: no more than one in a threshold is too many.
            let most = count as u64 + count as u64 / dithered.threshold.max(1) + 1;
            prop_assert!(dithered.pixels.len() as u64 <= most);
        }
    }

    #[test]
    fn equal_priorities_make_an_even_pattern() {
        let dithered = dither(&vec![256; 64 * 64], [64, 64], 256);
        assert!((230..=256).contains(&dithered.pixels.len()), "{}", dithered.pixels.len());
        for block in 0..16 {
            let [left, top] = [block % 4 * 16, block / 4 * 16];
            let inside = dithered.pixels.iter().filter(|pixel| {
                (left..left + 16).contains(&(**pixel % 64)) && (top..top + 16).contains(&(**pixel / 64))
            });
            let count = inside.count();
            // The first line of all gathers what the first requests are made of.
            assert!((9..=22).contains(&count), "block {block} has {count}");
        }
    }

    #[test]
    fn samples_go_where_the_priority_is() {
        let priorities: Vec<u32> = (0..64 * 1024).map(|pixel| if pixel % 64 < 16 { 30 } else { 1 }).collect();
        let dithered = dither(&priorities, [64, 1024], 4800);
        let inside = dithered.pixels.iter().filter(|pixel| **pixel % 64 < 16).count() as f32;
        let share = inside / dithered.pixels.len() as f32;
        assert!((share - 30.0 * 16.0 / (30.0 * 16.0 + 48.0)).abs() < 0.05, "{share}");
    }

    fn point(points: &mut Points, place: Vec3) -> u32 {
        points.insert(Place::Near(place), Known::default())
    }

    #[test]
    fn a_pixel_is_worth_the_age_of_its_point_or_what_its_neighbours_lack() {
        let camera = Camera { width: 8, height: 8, ..Camera::default() };
        let lens = camera.lens();
        let mut points = Points::new(8);
        let mut put = |x: f32, y: f32| point(&mut points, lens.origin() + lens.direction(x, y));
        let (old, _) = (put(2.5, 2.5), put(3.5, 2.5));
        points.age_early(old, 77);
        let (mut image, mut worth) = (PointImage::default(), Vec::new());
        image.clear([8, 8]);
        image.project(&mut points, &camera);
        priorities(&points, &image, &mut worth);
        let at = |x: usize, y: usize| worth[y * 8 + x];
        assert_eq!([at(2, 2), at(3, 2)], [77, 1], "never nothing");
        assert_eq!([at(7, 7), at(1, 1), at(2, 1)], [255, 239, 223].map(|byte| byte << 8));
    }

    #[test]
    fn what_a_turning_camera_will_see_is_asked_for_before_it_gets_there() {
        let now = Camera { width: 64, height: 48, ..Camera::default() };
        let lens = now.lens();
        let mut points = Points::new(64 * 48);
        for pixel in 0..64 * 48 {
            let (x, y) = ((pixel % 64) as f32 + 0.5, (pixel / 64) as f32 + 0.5);
            point(&mut points, lens.origin() + lens.direction(x, y) * 3.0);
        }
        assert_eq!(unoccupied(&points, &now, 1000), Vec::<[u32; 2]>::new());
        let before = Camera { origin: now.origin - Vec3::X * 0.15, target: now.target - Vec3::X * 0.15, ..now };
        let then = ahead(&before, &now, 2);
        assert!((then.origin - now.origin - Vec3::X * 0.3).length() < 1e-6);
        let asked = unoccupied(&points, &then, 1000);
        assert!(!asked.is_empty() && asked.iter().all(|[x, _]| *x >= 56), "the strip at the right: {asked:?}");
        let fewer = unoccupied(&points, &then, 5);
        assert_eq!(fewer.len(), 5.min(asked.len()));
        assert!(fewer.iter().all(|pixel| asked.contains(pixel)));
        let rows: Vec<u32> = fewer.iter().map(|[_, y]| *y).collect();
        assert!(rows.first() < Some(&12) && rows.last() > Some(&30), "evenly: {rows:?}");
        assert!(unoccupied(&points, &then, 0).is_empty());
    }
}
