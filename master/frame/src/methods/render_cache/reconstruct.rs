//! A picture of the points that pixels show: gaps are filled from around, and what is smooth is smoothed (section 3.1).
//!
//! **The paper's** ([`super::weights`]): each pixel is the mean of its 3×3 neighbourhood with weights 4, 2 and 1; pixels
//! without a point have none. Where all nine have none, the mean of 7×7 (Walter et al. 2002).
//!
//! **Ours** ([`super::surfaces`]): only irradiance is smoothed, over points of the same surface, and no farther than it takes
//! to have enough samples; it is multiplied by the reflectance of the pixel's own point. So textures and edges stay, and what
//! has been sampled well is left alone. Gaps take the colour of one surface, never of two.

use glam::Vec3;

use super::points::Points;
use super::project::{NONE, PointImage};
use super::surfaces::Surfaces;
use super::weights::Weights;

/// What is made of a [`PointImage`], and the memory that it is made in.
#[derive(Clone, Debug, Default)]
pub(super) struct Reconstruction {
    /// Radiance; of no meaning where nothing is known.
    pub pixels: Vec<Vec3>,
    pub known: Vec<bool>,
    weights: Weights,
    surfaces: Surfaces,
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

/// How far the prefilter reaches.
pub(super) const PREFILTER: usize = 3;
/// Rows that a thread takes at a time.
pub(super) const ROWS: usize = 16;

impl Reconstruction {
    /// Makes the picture.
    pub fn make(&mut self, points: &Points, image: &PointImage, filling: Filling) {
        self.pixels.resize(image.slots.len(), Vec3::ZERO);
        self.known.resize(image.slots.len(), false);
        if image.slots.is_empty() {
            return;
        }
        let (pixels, known) = (&mut self.pixels[..], &mut self.known[..]);
        match filling.surfaces {
            true => self.surfaces.make(points, image, filling.prefilter, (pixels, known)),
            false => self.weights.make(points, image, filling, (pixels, known)),
        }
    }
}

/// The pixels of a neighbourhood, row by row, with how far they are in columns and rows.
pub(super) fn around(
    image: &PointImage,
    pixel: usize,
    reach: usize,
) -> impl Iterator<Item = (usize, [usize; 2])> + use<> {
    let (width, height) = (image.width, image.height);
    let (x, y) = (pixel % width, pixel / width);
    let rows = y.saturating_sub(reach)..(y + reach + 1).min(height);
    rows.flat_map(move |there_y| {
        let columns = x.saturating_sub(reach)..(x + reach + 1).min(width);
        columns.map(move |there_x| (there_y * width + there_x, [there_x.abs_diff(x), there_y.abs_diff(y)]))
    })
}

/// Whether a pixel shows a point.
pub(super) fn has_point(image: &PointImage) -> impl Fn(&(usize, [usize; 2])) -> bool {
    |(there, _)| image.slots[*there] != NONE
}

#[cfg(test)]
mod tests {
    use std::f32::consts::FRAC_1_PI;

    use scenes::Camera;

    use super::super::point::{Known, Light, Place, Sampled};
    use super::*;

    const FAITHFUL: Filling = Filling { sharp: false, prefilter: true, surfaces: false };
    const OURS: Filling = Filling { sharp: true, prefilter: true, surfaces: true };

    /// A picture with points in some pixels: distance and light.
    fn image(width: u32, height: u32, point: impl Fn(u32, u32) -> Option<(f32, Light)>) -> (Points, PointImage) {
        let camera = Camera { width, height, ..Camera::default() };
        let lens = camera.lens();
        let mut points = Points::new((width * height) as usize);
        for (x, y) in (0..height).flat_map(|y| (0..width).map(move |x| (x, y))) {
            let Some((distance, light)) = point(x, y) else { continue };
            let place = Place::Near(lens.origin() + lens.direction(x as f32 + 0.5, y as f32 + 0.5) * distance);
            points.insert(
                place,
                Known { sampled: Sampled { light, count: 1, ..Sampled::default() }, ..Known::default() },
            );
        }
        let mut image = PointImage::default();
        image.clear([width, height]);
        image.project(&mut points, &camera);
        (points, image)
    }

    fn reconstruct(points: &Points, image: &PointImage, filling: Filling) -> Reconstruction {
        let mut made = Reconstruction::default();
        made.make(points, image, filling);
        made
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
