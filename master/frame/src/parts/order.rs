//! In which order rays and points are best asked about: those of one block ([`BLOCK`], 128) are lit together, and their
//! shadow rays cost least where they make a slim shaft. No answer depends on the order.

use glam::Vec3;
use protocol::question::{BLOCK, Point, Ray};
use scenes::{Scene, SurfacePoint};

/// Pixels of a screen block: as many as [`BLOCK`].
const SCREEN_BLOCK: [u32; 2] = [16, 8];
const _: () = assert!((SCREEN_BLOCK[0] * SCREEN_BLOCK[1]) as usize == BLOCK);

/// Sorts rays by screen blocks of 16×8 pixels, within each by squares of 4×4, then by pixel and number. Rays with an aim
/// count where their address is.
pub fn sort_rays(rays: &mut [Ray]) {
    rays.sort_by_key(|ray| (screen_key(ray.address.pixel), ray.address.number));
}

/// The place of a pixel in that order.
pub fn screen_key([x, y]: [u32; 2]) -> impl Ord {
    let block = (y / SCREEN_BLOCK[1], x / SCREEN_BLOCK[0]);
    (block, (y / 4, x / 4), (y, x))
}

/// Sorts points by object, within each along a Morton curve through the box of its points, then by name. Points that the
/// scene does not have come where the scene's origin would: they will be refused wherever they are.
pub fn sort_points(scene: &Scene, points: &mut [Point]) {
    points.sort_by_key(|point| point.address);
    sort_by_point(scene, points, |point| point.at);
}

/// Sorts what there is about points in the same order; what is about the same point stays as it is.
pub fn sort_by_point<T>(scene: &Scene, things: &mut [T], point: impl Fn(&T) -> SurfacePoint) {
    let place = |thing: &T| scene.place(&point(thing)).unwrap_or_default();
    things.sort_by_key(|thing| point(thing).object);
    for things in things.chunk_by_mut(|a, b| point(a).object == point(b).object) {
        let (least, greatest) = things
            .iter()
            .map(place)
            .fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(low, high), at| (low.min(at), high.max(at)));
        let cell = (greatest - least).max_element() / CELLS;
        things.sort_by_cached_key(|thing| {
            let at = (place(thing) - least) / cell;
            // All in one place: casts of no number are 0.
            let curve = at.to_array().map(|along| spread(along as u32)).into_iter().rev();
            let morton = curve.fold(0, |code, bits| code << 1 | bits);
            let SurfacePoint { triangle, uv, .. } = point(thing);
            (morton, triangle, uv.map(f32::to_bits))
        });
    }
}

/// Steps of the curve along the longest side of the box: 20 bits.
const CELLS: f32 = ((1 << 20) - 1) as f32;

/// Two zeros between all bits of a number below 2²¹.
fn spread(x: u32) -> u64 {
    let mut x = u64::from(x) & 0x1f_ffff;
    for (shift, mask) in [
        (32, 0x001f_0000_0000_ffff),
        (16, 0x001f_0000_ff00_00ff),
        (8, 0x100f_00f0_0f00_f00f),
        (4, 0x10c3_0c30_c30c_30c3),
        (2, 0x1249_2492_4924_9249),
    ] {
        x = (x | x << shift) & mask;
    }
    x
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;
    use protocol::question::Address;
    use scenes::{Material, Mesh, Object, Transform};

    use super::*;

    /// Two flat squares of 10 × 10, the second one elsewhere.
    fn scene() -> Scene {
        let positions =
            [[0.0, 0.0], [10.0, 0.0], [10.0, 10.0], [0.0, 10.0]].map(|[x, y]| Vec3::new(x, y, 0.0)).to_vec();
        let (triangles, materials) = (vec![[0, 1, 2], [0, 2, 3]], vec![0, 0]);
        let elsewhere = Transform { translation: Vec3::Z * 100.0, ..Transform::IDENTITY };
        Scene {
            meshes: vec![Mesh { positions, triangles, materials, ..Mesh::default() }.into()],
            objects: vec![Object::fixed("one", 0), Object { scene_from_object: elsewhere, ..Object::fixed("two", 0) }],
            materials: vec![Material::diffuse("grey", Vec3::splat(0.5))],
            ..Scene::default()
        }
    }

    fn points(count: u32, seed: u32) -> Vec<Point> {
        let random = |i: u32, salt: u32| {
            let x = (i * 4 + salt).wrapping_add(seed).wrapping_mul(0x9e37_79b9);
            ((x ^ x >> 15).wrapping_mul(0x85eb_ca6b) >> 8) as f32 / 16_777_216.0
        };
        (0..count)
            .map(|i| {
                let (a, b) = (random(i, 0), random(i, 1));
                let uv = if a + b <= 1.0 { [a, b] } else { [1.0 - a, 1.0 - b] };
                let (object, triangle) = ((random(i, 2) * 2.0) as u32, (random(i, 3) * 2.0) as u32);
                let at = SurfacePoint { object, triangle, uv, ..SurfacePoint::default() };
                Point { at, address: Address { pixel: [i, 0], number: 0 } }
            })
            .collect()
    }

    /// Mean half circumference of the boxes around blocks.
    fn spread_of(scene: &Scene, points: &[Point]) -> f32 {
        let size = |block: &[Point]| {
            let places = block.iter().map(|point| scene.place(&point.at).expect("it is there"));
            let (low, high) =
                places.fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(low, high), at| (low.min(at), high.max(at)));
            (high - low).element_sum()
        };
        points.chunks(BLOCK).map(size).sum::<f32>() / points.chunks(BLOCK).count() as f32
    }

    #[test]
    fn sorted_points_lie_close_together() {
        let scene = scene();
        let mut points = points(64 * BLOCK as u32, 1);
        let before = spread_of(&scene, &points);
        sort_points(&scene, &mut points);
        let after = spread_of(&scene, &points);
        // 32 blocks on each square: best is an eighth of it along x and a quarter along y, and one block is on both.
        assert!(before > 110.0 && after < 8.0, "{before} before, {after} after");
    }

    #[test]
    fn rays_of_a_picture_come_in_whole_screen_blocks() {
        let pixel = |i: u32| [i % 64, i / 64];
        let mut rays: Vec<Ray> =
            (0..64 * 48).rev().map(|i| Ray { address: Address { pixel: pixel(i), number: 3 }, aim: None }).collect();
        sort_rays(&mut rays);
        for block in rays.chunks(BLOCK) {
            let [x, y] = block[0].address.pixel;
            assert!(x.is_multiple_of(16) && y.is_multiple_of(8));
            assert!(block.iter().all(|ray| ray.address.pixel[0] / 16 == x / 16 && ray.address.pixel[1] / 8 == y / 8));
        }
    }

    proptest! {
        #[test]
        fn the_order_is_one_whatever_it_was_before(seed: u32, turn in 0..300_usize) {
            let scene = scene();
            let mut sorted = points(300, seed);
            let mut other = sorted.clone();
            other.rotate_left(turn);
            other.reverse();
            let mut rays: Vec<Ray> = other.iter().map(|point| Ray {
                address: Address { pixel: [point.at.uv[0].to_bits() % 100, point.at.uv[1].to_bits() % 80], number: point.address.pixel[0] },
                aim: None,
            }).collect();
            sort_points(&scene, &mut sorted);
            sort_points(&scene, &mut other);
            prop_assert_eq!(&sorted, &other);
            let mut numbers: Vec<u32> = sorted.iter().map(|point| point.address.pixel[0]).collect();
            numbers.sort_unstable();
            prop_assert!(numbers.into_iter().eq(0..300), "nothing is lost");
            let mut again = rays.clone();
            again.rotate_left(turn);
            sort_rays(&mut rays);
            sort_rays(&mut again);
            prop_assert_eq!(rays, again);
        }

        #[test]
        fn bits_are_spread(x in 0..1_u32 << 21) {
            let mut expected = 0;
            for bit in 0..21 {
                expected |= u64::from(x >> bit & 1) << (3 * bit);
            }
            prop_assert_eq!(spread(x), expected);
        }
    }
}
