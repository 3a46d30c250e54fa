//! A picture of the points that pixels show: gaps are filled from around, and what is smooth is smoothed (section 3.1).
//!
//! **The paper's** ([`super::weights`]): each pixel is the mean of its 3×3 neighbourhood with weights 4, 2 and 1; pixels
//! without a point have none. Where all nine have none, the mean of 7×7 (Walter et al. 2002).
//!
//! **Ours** ([`super::surfaces`]): only irradiance is smoothed, over points of the same surface, and no farther than it takes
//! to have enough samples; it is multiplied by the reflectance of the pixel's own point. So textures and edges stay, and what
//! has been sampled well is left alone. Gaps take the colour of one surface, never of two.

use glam::Vec3;

use super::guide::Exact;
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
    /// Makes the picture. `exact`: what pixels see, if that is known besides points.
    pub fn make(&mut self, points: &Points, image: &PointImage, exact: &[Option<Exact>], filling: Filling) {
        self.pixels.resize(image.slots.len(), Vec3::ZERO);
        self.known.resize(image.slots.len(), false);
        if image.slots.is_empty() {
            return;
        }
        let (pixels, known) = (&mut self.pixels[..], &mut self.known[..]);
        match filling.surfaces {
            true => self.surfaces.make(points, image, exact, filling.prefilter, (pixels, known)),
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

    use scenes::{Camera, Colour, Material, Mesh, Object, Scene};

    use super::super::guide::Guide;
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
        made.make(points, image, &[], filling);
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
    fn where_pixels_are_known_exactly_edges_and_lamps_are_sharp_however_points_lie() {
        // A wall, a nearer square of another colour that is lit otherwise, and a lamp beside it.
        let square = |[x, y]: [f32; 2], half: f32, z: f32, material: u32| {
            let corner = |dx: f32, dy: f32| Vec3::new(x + dx * half, y + dy * half, z);
            let positions = vec![corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)];
            Mesh { positions, triangles: vec![[0, 1, 2], [0, 2, 3]], materials: vec![material; 2], ..Mesh::default() }
        };
        let lamp = Material { emission: Colour::plain(Vec3::splat(9.0)), ..Material::diffuse("lamp", Vec3::ZERO) };
        let squares = [([0.0; 2], 20.0, 0.0), ([-0.3, 0.1], 0.4, 1.0), ([0.6, 0.1], 0.2, 1.0)];
        let scene = Scene {
            meshes: (0..).zip(squares).map(|(material, (at, half, z))| square(at, half, z, material).into()).collect(),
            objects: ["wall", "square", "lamp"]
                .iter()
                .zip(0..)
                .map(|(name, mesh)| Object::fixed(*name, mesh))
                .collect(),
            materials: vec![Material::diffuse("grey", Vec3::splat(0.5)), Material::diffuse("red", Vec3::X * 0.8), lamp],
            ..Scene::default()
        };
        // What a ray meets: where, and its light.
        let meet = |direction: Vec3| {
            let at = |z: f32| Vec3::Z * 3.0 + direction * ((z - 3.0) / direction.z);
            let is_on = |([x, y], half, z): ([f32; 2], f32, f32)| {
                let at = at(z);
                ((at.x - x).abs() < half && (at.y - y).abs() < half).then_some(at)
            };
            let matt = |reflectance: Vec3, irradiance: f32| Light {
                reflectance,
                irradiance: Vec3::splat(irradiance),
                normal: Vec3::Z,
                emitted: Vec3::ZERO,
            };
            if let Some(at) = is_on(squares[2]) {
                return (at, Light { emitted: Vec3::splat(9.0), ..matt(Vec3::ZERO, 1.0) });
            }
            match is_on(squares[1]) {
                Some(at) => (at, matt(Vec3::X * 0.8, 6.0)),
                None => (at(0.0), matt(Vec3::splat(0.5), 2.0)),
            }
        };
        let camera = Camera { width: 40, height: 30, ..Camera::default() };
        let lens = camera.lens();
        let mut points = Points::new(40 * 30);
        for pixel in 0..40 * 30_u32 {
            // Anywhere in their pixels.
            let off = |salt: u32| (pixel.wrapping_mul(0x9e37_79b9).rotate_left(salt) >> 8) as f32 / 16_777_216.0;
            let (x, y) = ((pixel % 40) as f32 + off(3), (pixel / 40) as f32 + off(11));
            let (at, light) = meet(lens.direction(x, y));
            let sampled = Sampled { light, count: 1, ..Sampled::default() };
            points.insert(Place::Near(at), Known { sampled, ..Known::default() });
        }
        let mut image = PointImage::default();
        image.clear([40, 30]);
        image.project(&mut points, &camera);
        let mut guide = Guide::default();
        guide.look(&scene, &camera);
        let wrong = |exact: &[Option<Exact>]| {
            let mut made = Reconstruction::default();
            made.make(&points, &image, exact, OURS);
            let is_wrong = |(pixel, colour): &(u32, &Vec3)| {
                let (_, light) = meet(lens.direction((pixel % 40) as f32 + 0.5, (pixel / 40) as f32 + 0.5));
                (**colour - light.radiance()).abs().max_element() > 1e-4
            };
            (0..).zip(&made.pixels).filter(is_wrong).count()
        };
        let (guided, unguided) = (wrong(&guide.exact), wrong(&[]));
        assert!(guided == 0 && unguided > 10, "{guided} and {unguided} of 1200 pixels are wrong");
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
