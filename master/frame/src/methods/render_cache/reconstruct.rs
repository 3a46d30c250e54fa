//! A picture of the points that pixels show: gaps are filled from around, and what is smooth is smoothed (section 3.1).
//!
//! **The paper's**: each pixel is the mean of its 3×3 neighbourhood with weights 4, 2 and 1; pixels without a point have
//! none. Where all nine have none, the mean of 7×7 (Walter et al. 2002).
//!
//! **Ours**: only irradiance is smoothed, over points of the same surface, and no farther than it takes to have
//! [`SAMPLES_ENOUGH`] samples; it is multiplied by the reflectance of the pixel's own point. So textures and edges stay, and
//! what has been sampled well is left alone. Gaps take the colour of one surface, never of two.

use std::f32::consts::FRAC_1_PI;

use glam::{Vec3, Vec4};
use rayon::prelude::*;

use super::points::{Light, Place, Points};
use super::project::{NONE, PointImage};

/// What is made of a [`PointImage`].
#[derive(Clone, Debug, Default)]
pub(super) struct Reconstruction {
    /// Radiance; of no meaning where nothing is known.
    pub pixels: Vec<Vec3>,
    pub known: Vec<bool>,
}

/// How gaps are filled.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Filling {
    /// Pixels that show a point show its very colour.
    pub sharp: bool,
    /// 7×7 where 3×3 has nothing.
    pub prefilter: bool,
    /// By surfaces (ours).
    pub surfaces: bool,
}

/// The weights of a 3×3 neighbourhood are products of these: 4, 2 and 1.
const WEIGHTS: [f32; 3] = [1.0, 2.0, 1.0];
/// How far the prefilter reaches.
const PREFILTER: usize = 3;
/// As many samples as make irradiance smooth enough.
const SAMPLES_ENOUGH: u32 = 64;
/// How far they are looked for, pixels.
const REACH: usize = 3;
/// Normals of one surface have at least this cosine …
const SAME_NORMAL: f32 = 0.9;
/// … and its points are no farther from the plane of another than this share of the distance.
const SAME_PLANE: f32 = 0.01;
/// Without normals: distances that differ by less than this share.
const SAME_DISTANCE: f32 = 0.05;

/// A pixel's point.
#[derive(Clone, Copy)]
struct Shown {
    position: Vec3,
    light: Light,
    /// As in [`super::points::Known::count`]; 0 also if there is none.
    count: u8,
    revision: u32,
}

/// Makes the picture.
pub(super) fn reconstruct(points: &Points, image: &PointImage, filling: Filling) -> Reconstruction {
    let filled =
        if filling.surfaces { by_surfaces(points, image, filling) } else { by_weights(points, image, filling) };
    Reconstruction {
        known: filled.iter().map(|colour| colour.w > 0.0).collect(),
        pixels: filled.into_iter().map(Vec4::truncate).collect(),
    }
}

/// Rows that a thread takes at a time, at least.
const ROWS: usize = 16;

/// The papers' way. Red, green, blue, and a weight; 0 where nothing is known.
fn by_weights(points: &Points, image: &PointImage, filling: Filling) -> Vec<Vec4> {
    let (width, height) = (image.width.max(1), image.height);
    let coloured = |slot: &u32| if *slot == NONE { Vec4::ZERO } else { points.radiance(*slot).extend(1.0) };
    let colours: Vec<Vec4> = image.slots.par_iter().with_min_len(ROWS * width).map(coloured).collect();
    // The weights are products: first along rows, then along columns.
    let mut across = colours.clone();
    let along = |(sums, row): (&mut [Vec4], &[Vec4])| {
        sums.iter_mut().for_each(|sum| *sum *= WEIGHTS[1]);
        sums.iter_mut().skip(1).zip(row).for_each(|(sum, left)| *sum += WEIGHTS[2] * *left);
        sums.iter_mut().zip(&row[1..]).for_each(|(sum, right)| *sum += WEIGHTS[0] * *right);
    };
    across.par_chunks_mut(width).zip(colours.par_chunks(width)).with_min_len(ROWS).for_each(along);
    let mut filled = vec![Vec4::ZERO; colours.len()];
    let down = |(y, row): (usize, &mut [Vec4])| {
        for (there, weight) in [(y.checked_sub(1), WEIGHTS[0]), (Some(y), WEIGHTS[1]), (Some(y + 1), WEIGHTS[2])] {
            let Some(there) = there.filter(|there| *there < height) else { continue };
            row.iter_mut().zip(&across[there * width..]).for_each(|(sum, more)| *sum += weight * *more);
        }
        for (pixel, sum) in (y * width..).zip(row) {
            *sum = match colours[pixel] {
                own if own.w > 0.0 && filling.sharp => own,
                _ if sum.w > 0.0 => *sum / sum.w,
                _ if filling.prefilter => mean(&colours, image, pixel),
                _ => Vec4::ZERO,
            };
        }
    };
    filled.par_chunks_mut(width).enumerate().with_min_len(ROWS).for_each(down);
    filled
}

/// Our way, as [`by_weights`].
fn by_surfaces(points: &Points, image: &PointImage, filling: Filling) -> Vec<Vec4> {
    let shown: Vec<Shown> = image.slots.par_iter().with_min_len(1024).map(|slot| shown(points, *slot)).collect();
    let len = shown.len();
    let rings = [1, 2, 3].map(ring);
    let smooth = |pixel: usize| smooth(&shown, image, &rings, pixel);
    let colours: Vec<Vec3> = (0..len).into_par_iter().with_min_len(1024).map(smooth).collect();
    let fill = |pixel: usize| {
        if image.slots[pixel] != NONE {
            return colours[pixel].extend(1.0);
        }
        let near = mean_of_one_surface(&colours, &shown, image, pixel, 1);
        // A wide gap is mostly what came into view behind something.
        let far = || mean_of_one_surface(&colours, &shown, image, pixel, PREFILTER).filter(|_| filling.prefilter);
        near.or_else(far).map_or(Vec4::ZERO, |colour| colour.extend(1.0))
    };
    (0..len).into_par_iter().with_min_len(1024).map(fill).collect()
}

fn shown(points: &Points, slot: u32) -> Shown {
    if slot == NONE {
        return Shown { position: Vec3::ZERO, light: Light::default(), count: 0, revision: 0 };
    }
    let known = points.known(slot);
    let position = match points.places()[slot as usize] {
        Some(Place::Near(point) | Place::Far(point)) => point,
        None => Vec3::ZERO,
    };
    Shown { position, light: known.light, count: known.count, revision: known.revision }
}

/// The pixels of a neighbourhood, row by row, with how far they are in columns and rows.
fn around(image: &PointImage, pixel: usize, reach: usize) -> impl Iterator<Item = (usize, [usize; 2])> + use<> {
    let (width, height) = (image.width, image.height);
    let (x, y) = (pixel % width, pixel / width);
    let rows = y.saturating_sub(reach)..(y + reach + 1).min(height);
    rows.flat_map(move |there_y| {
        let columns = x.saturating_sub(reach)..(x + reach + 1).min(width);
        columns.map(move |there_x| (there_y * width + there_x, [there_x.abs_diff(x), there_y.abs_diff(y)]))
    })
}

fn has_point(image: &PointImage) -> impl Fn(&(usize, [usize; 2])) -> bool {
    |(there, _)| image.slots[*there] != NONE
}

/// The sequel's 7×7.
fn mean(colours: &[Vec4], image: &PointImage, pixel: usize) -> Vec4 {
    let sum: Vec4 = around(image, pixel, PREFILTER).map(|(there, _)| colours[there]).sum();
    if sum.w > 0.0 { sum / sum.w } else { Vec4::ZERO }
}

/// Whether two pixels show the same surface, as far as their points tell.
fn is_same(a: (&Shown, f32), b: (&Shown, f32)) -> bool {
    let ((here, depth), (there, other)) = (a, b);
    let (normal, other_normal) = (here.light.normal, there.light.normal);
    if normal == Vec3::ZERO || other_normal == Vec3::ZERO {
        return normal == other_normal && (depth - other).abs() <= SAME_DISTANCE * depth;
    }
    normal.dot(other_normal) >= SAME_NORMAL && (there.position - here.position).dot(normal).abs() <= SAME_PLANE * depth
}

/// How far the pixels are that lie so many columns or rows away and no fewer, in the order of lines.
fn ring(reach: isize) -> Vec<[isize; 2]> {
    let square = (-reach..=reach).flat_map(|dy| (-reach..=reach).map(move |dx| [dx, dy]));
    square.filter(|[dx, dy]| dx.abs().max(dy.abs()) == reach).collect()
}

/// The pixel's point with the irradiance of its surface around it.
fn smooth(shown: &[Shown], image: &PointImage, rings: &[Vec<[isize; 2]>; REACH], pixel: usize) -> Vec3 {
    let here = &shown[pixel];
    let light = &here.light;
    let is_matt = light.reflectance != Vec3::ZERO && light.normal != Vec3::ZERO;
    if !is_matt || u32::from(here.count) >= SAMPLES_ENOUGH {
        return light.radiance();
    }
    let (width, height) = (image.width as isize, image.height as isize);
    let (x, y) = ((pixel % image.width) as isize, (pixel / image.width) as isize);
    let depth = image.depths[pixel];
    let own = here.count.max(1);
    let (mut irradiance, mut samples) = (light.irradiance * f32::from(own), u32::from(own));
    for ring in rings {
        for [dx, dy] in ring {
            let (there_x, there_y) = (x + dx, y + dy);
            if there_x < 0 || there_y < 0 || there_x >= width || there_y >= height {
                continue;
            }
            let there = (there_y * width + there_x) as usize;
            let other = &shown[there];
            // What is known of the world before an edit is no measure for what was seen after it. Pixels without a point
            // have no samples.
            let is_of_use = other.count > 0 && other.revision >= here.revision;
            if is_of_use && is_same((here, depth), (other, image.depths[there])) {
                irradiance += other.light.irradiance * f32::from(other.count);
                samples += u32::from(other.count);
            }
        }
        if samples >= SAMPLES_ENOUGH {
            break;
        }
    }
    light.emitted + light.reflectance * (irradiance / samples as f32) * FRAC_1_PI
}

/// The mean over the points of one surface: within a step that of the nearest point, and of equally near ones the foremost;
/// farther away that of the farthest from the eye.
fn mean_of_one_surface(
    colours: &[Vec3],
    shown: &[Shown],
    image: &PointImage,
    pixel: usize,
    reach: usize,
) -> Option<Vec3> {
    let apart = |[dx, dy]: [usize; 2]| dx * dx + dy * dy;
    let is_nearer = |a: &(usize, [usize; 2]), b: &(usize, [usize; 2])| match reach {
        0 | 1 => apart(a.1).cmp(&apart(b.1)).then(image.depths[a.0].total_cmp(&image.depths[b.0])),
        _ => image.depths[b.0].total_cmp(&image.depths[a.0]),
    };
    let (nearest, _) = around(image, pixel, reach).filter(has_point(image)).min_by(is_nearer)?;
    let first = (&shown[nearest], image.depths[nearest]);
    let (mut sum, mut weights) = (Vec3::ZERO, 0.0);
    for (there, by) in around(image, pixel, reach).filter(has_point(image)) {
        if there == nearest || is_same(first, (&shown[there], image.depths[there])) {
            let weight = 1.0 / apart(by).max(1) as f32;
            sum += colours[there] * weight;
            weights += weight;
        }
    }
    Some(sum / weights)
}

#[cfg(test)]
mod tests {
    use scenes::Camera;

    use super::super::points::{Hint, Known};
    use super::*;

    const FAITHFUL: Filling = Filling { sharp: false, prefilter: true, surfaces: false };
    const OURS: Filling = Filling { sharp: true, prefilter: true, surfaces: true };

    /// A picture with points in some pixels: distance and light.
    fn image(width: u32, height: u32, point: impl Fn(u32, u32) -> Option<(f32, Light)>) -> (Points, PointImage) {
        let lens = Camera { width, height, ..Camera::default() }.lens();
        let mut points = Points::new((width * height) as usize);
        for (x, y) in (0..height).flat_map(|y| (0..width).map(move |x| (x, y))) {
            let Some((distance, light)) = point(x, y) else { continue };
            let place = Place::Near(lens.origin() + lens.direction(x as f32 + 0.5, y as f32 + 0.5) * distance);
            points.insert(place, Known { name: None, light, count: 1, revision: 0, hint: Hint::Matt, last: None });
        }
        let mut image = PointImage::default();
        image.clear([width, height]);
        image.project(&mut points, &lens);
        (points, image)
    }

    fn bright(brightness: f32) -> Light {
        Light { emitted: Vec3::splat(brightness), ..Light::default() }
    }

    #[test]
    fn the_weights_are_4_2_and_1_over_what_is_there() {
        let (points, image) = image(5, 5, |x, y| match (x, y) {
            (2, 2) => Some((3.0, bright(1.0))),
            (3, 2) => Some((3.0, bright(10.0))),
            (1, 1) => Some((3.0, bright(100.0))),
            _ => None,
        });
        let made = reconstruct(&points, &image, Filling { prefilter: false, ..FAITHFUL });
        assert_eq!(made.pixels[12].x, (4.0 * 1.0 + 2.0 * 10.0 + 100.0) / 7.0);
        assert_eq!(made.pixels[7].x, (2.0 * 1.0 + 10.0 + 2.0 * 100.0) / 5.0, "a gap takes what is around it");
        assert!(!made.known[24 - 4] && made.known[0], "nothing is near the lower left corner");
        let sharp = reconstruct(&points, &image, Filling { sharp: true, ..FAITHFUL });
        assert_eq!((sharp.pixels[12].x, sharp.pixels[7].x), (1.0, made.pixels[7].x));
    }

    #[test]
    fn the_prefilter_is_a_mean_of_7_by_7_where_3_by_3_has_nothing() {
        let (points, image) = image(9, 9, |x, y| match (x, y) {
            (4, 4) => Some((3.0, bright(1.0))),
            (6, 4) => Some((3.0, bright(4.0))),
            _ => None,
        });
        let made = reconstruct(&points, &image, FAITHFUL);
        assert_eq!(made.pixels[2 * 9 + 5].x, 2.5);
        assert_eq!(made.pixels[4 * 9 + 2].x, 1.0, "the other is four columns away");
        assert!(!made.known[0] && made.known[9 + 1]);
    }

    #[test]
    fn irradiance_is_smoothed_within_a_surface_and_texture_stays() {
        // A textured wall with noisy light, beside a nearer one that is lit otherwise.
        let is_near = |x: u32| x >= 8;
        let texture = |x: u32, y: u32| 0.2 + 0.6 * ((x + y) % 2) as f32;
        let noise = |x: u32, y: u32| 1.0 + 0.5 * (((x * 7 + y * 13) % 5) as f32 - 2.0) / 2.0;
        let light = |x: u32, y: u32| {
            let base = if is_near(x) { 10.0 } else { 1.0 };
            let (reflectance, irradiance) = (Vec3::splat(texture(x, y)), Vec3::splat(base * noise(x, y)));
            Light { reflectance, irradiance, normal: Vec3::Z, ..Light::default() }
        };
        let lens = Camera { width: 16, height: 12, ..Camera::default() }.lens();
        // Planes, so that all points of one lie in it.
        let distance = |x: u32, y: u32| {
            let z = if is_near(x) { 2.0 } else { 3.0 };
            -z / lens.direction(x as f32 + 0.5, y as f32 + 0.5).z
        };
        let (points, image) = image(16, 12, |x, y| ((x, y) != (3, 5)).then(|| (distance(x, y), light(x, y))));
        let made = reconstruct(&points, &image, OURS);
        for (pixel, colour) in made.pixels.iter().enumerate() {
            let (x, y) = (pixel as u32 % 16, pixel as u32 / 16);
            if (x, y) == (3, 5) {
                continue;
            }
            let truth = texture(x, y) * if is_near(x) { 10.0 } else { 1.0 } * FRAC_1_PI;
            assert!((colour.x / truth - 1.0).abs() < 0.15, "{x} {y}: {} for {truth}", colour.x);
        }
        assert!(made.pixels[5 * 16 + 3].x < 0.4, "a gap is filled from its own wall");
    }

    #[test]
    fn what_was_sampled_well_is_left_alone() {
        let light = |x: u32| Light {
            reflectance: Vec3::ONE,
            irradiance: Vec3::splat(x as f32),
            normal: Vec3::Z,
            ..Light::default()
        };
        let (mut points, image) = image(8, 8, |x, _| Some((3.0, light(x))));
        for slot in 0..64 {
            points.set_count(slot, 64);
        }
        let made = reconstruct(&points, &image, OURS);
        assert!((0..64).all(|pixel| made.pixels[pixel].x == (pixel % 8) as f32 * FRAC_1_PI));
    }

    #[test]
    fn pictures_of_a_pixel_and_of_a_row_are_pictures() {
        for [width, height] in [[1, 1], [1, 9], [9, 1]] {
            for filling in [FAITHFUL, OURS] {
                let (points, image) = image(width, height, |x, y| (x + y == 0).then(|| (3.0, bright(2.0))));
                let made = reconstruct(&points, &image, filling);
                assert_eq!((made.pixels[0].x, made.known[0]), (2.0, true));
                assert_eq!(made.pixels.len(), (width * height) as usize);
            }
        }
    }
}
