//! Where what shines ends in the picture: pixels in which lamps, or the sky, are seen in part.
//!
//! The ray that a frame sends through such a pixel meets the lamp or passes it by, and a lamp is a hundred times as bright as
//! what it lights: few pixels, and a large part of a picture's error. So each of them has [`SAMPLES`] rays more a frame, which end at
//! what they meet first. The mean of what shines there takes the place of what the frame's own ray finds; all light that is
//! reflected is found by that as everywhere. Which pixels have them is no matter of chance, so the mean of frames stays.
//!
//! Rays through the corners of all pixels find them, once for each view, a cell of the picture at a time, as it is asked about. What is
//! thinner than a pixel may be missed: then it is as noisy as it would be without.

use std::sync::OnceLock;

use glam::Vec3;
use protocol::answer::Cost;
use protocol::question::Motion;
use scenes::camera::Lens;
use scenes::{Camera, Needs, Rgb};

use crate::bvh::{PacketScratch, Ray};
use crate::eye;
use crate::prepared::Prepared;
use crate::sample::Sequence;

/// Rays a frame through a pixel in which something that shines ends; a power of two, so that those of a frame are a net.
pub const SAMPLES: u32 = 16;

/// Emission differs if it does by more than this share of the brightest: a sky that grows darker does not end.
const CONTRAST: f32 = 0.25;

/// Corners of pixels along the side of a cell: whole packets …
const CORNERS: u32 = 64;
/// … and so many pixels lie between them.
const CELL: u32 = CORNERS - 1;
/// Corners are looked at in blocks of so many by so many, a packet each.
const PACKET: [u32; 2] = [16, 8];

/// Tells the rays' numbers from those of the frame's own ray.
const EDGE: u32 = 0x6564;

/// What a view sees end, found as far as it was asked about.
pub struct Edges {
    lens: Lens,
    /// Of the picture, pixels.
    size: [u32; 2],
    /// Row by row; one in which nothing ends has no room.
    cells: Vec<OnceLock<Option<Box<Cell>>>>,
}

/// Row by row, a bit for each pixel.
type Cell = [u64; CELL as usize];

/// Whether anything that shines can be seen to end, and a view lasts for long enough to look for it.
pub fn are_wanted(prepared: &Prepared, motion: Motion) -> bool {
    let Needs { emissive_triangles, environment, suns, .. } = prepared.needs;
    motion == Motion::Still && (emissive_triangles > 0 || environment || suns > 0)
}

impl Edges {
    /// Nothing looked at yet.
    pub fn new(camera: &Camera) -> Self {
        let size = [camera.width, camera.height];
        let [columns, rows] = size.map(|pixels| pixels.div_ceil(CELL) as usize);
        Self { lens: camera.lens(), size, cells: (0..columns * rows).map(|_| OnceLock::new()).collect() }
    }

    /// Whether something that shines ends in a pixel of the picture.
    pub fn are_in(&self, prepared: &Prepared, [x, y]: [u32; 2], packet: &mut PacketScratch, cost: &mut Cost) -> bool {
        let (column, row) = (x / CELL, y / CELL);
        let cell = self.cells[(row * self.size[0].div_ceil(CELL) + column) as usize].get_or_init(|| {
            let cell = self.look(prepared, [column * CELL, row * CELL], packet, cost);
            cell.iter().any(|row| *row != 0).then(|| Box::new(cell))
        });
        cell.as_ref().is_some_and(|cell| cell[(y % CELL) as usize] >> (x % CELL) & 1 == 1)
    }

    /// The pixels of a cell, from its upper left corner.
    fn look(&self, prepared: &Prepared, from: [u32; 2], packet: &mut PacketScratch, cost: &mut Cost) -> Cell {
        let mut shines = [Vec3::ZERO; (CORNERS * CORNERS) as usize];
        // The last row and column of pixels have corners on both sides.
        let count: [u32; 2] = std::array::from_fn(|axis| (self.size[axis] - from[axis] + 1).min(CORNERS));
        let (mut places, mut directions, mut hits) = (Vec::new(), Vec::new(), Vec::new());
        for (top, left) in (0..count[1])
            .step_by(PACKET[1] as usize)
            .flat_map(|top| (0..count[0]).step_by(PACKET[0] as usize).map(move |left| (top, left)))
        {
            places.clear();
            places.extend(
                (top..(top + PACKET[1]).min(count[1]))
                    .flat_map(|row| (left..(left + PACKET[0]).min(count[0])).map(move |column| [column, row])),
            );
            directions.clear();
            directions
                .extend(places.iter().map(|[x, y]| self.lens.direction((from[0] + x) as f32, (from[1] + y) as f32)));
            eye::meet_all(prepared, &self.lens, &directions, packet, &mut hits);
            cost.eye_rays += hits.len() as u64;
            for (([x, y], direction), hit) in places.iter().zip(&directions).zip(&hits) {
                shines[(y * CORNERS + x) as usize] = {
                    let ray = Ray { origin: self.lens.origin(), direction: *direction, t_max: f32::INFINITY };
                    eye::shine(prepared, &ray, *hit)
                };
            }
        }
        let mut cell = [0; CELL as usize];
        for y in 0..count[1] - 1 {
            for x in 0..count[0] - 1 {
                let corners =
                    [[x, y], [x + 1, y], [x, y + 1], [x + 1, y + 1]].map(|[x, y]| shines[(y * CORNERS + x) as usize]);
                cell[y as usize] |= u64::from(differ(&corners)) << x;
            }
        }
        cell
    }
}

/// Emission that differs among the corners of a pixel.
fn differ(corners: &[Rgb; 4]) -> bool {
    let low = corners.iter().copied().fold(Vec3::INFINITY, Vec3::min);
    let high = corners.iter().copied().fold(Vec3::ZERO, Vec3::max);
    (high - low).max_element() > CONTRAST * high.max_element()
}

/// Directions of the rays that a frame sends through a pixel where something that shines ends, beside its own, which has
/// these numbers.
pub fn directions(lens: &Lens, [x, y]: [u32; 2], numbers: &Sequence, index: u32) -> impl Iterator<Item = Vec3> {
    let (numbers, first) = (numbers.with(EDGE), index.wrapping_mul(SAMPLES));
    (0..SAMPLES).map(move |i| {
        let [u, v] = numbers.first(0, first.wrapping_add(i));
        lens.direction(x as f32 + u, y as f32 + v)
    })
}

#[cfg(test)]
mod tests {
    use protocol::question::{Ask, Lit, Quality, Question, Rect, Tile, WorldState};
    use scenes::{Colour, Material, Mesh, Object, Scene};

    use super::*;
    use crate::cache::LightSetCache;

    const RADIANCE: f32 = 50.0;
    /// Columns and rows between which a lamp is seen, pixels from the upper left corner of a picture: over two cells.
    const LAMP: [[f32; 2]; 2] = [[3.3, 70.7], [2.6, 5.45]];
    const SIZE: [u32; 2] = [80, 8];

    /// A black lamp straight ahead. Halfway to it stands a black screen before the left half of the picture, unless that is cut away.
    fn scene(cut: bool) -> Scene {
        let camera = Camera {
            origin: Vec3::ZERO,
            target: Vec3::new(0.2, 0.1, -1.0),
            width: SIZE[0],
            height: SIZE[1],
            cut,
            ..Camera::default()
        };
        let lens = camera.lens();
        let mut mesh = Mesh::default();
        let mut stand = |depth: f32, [[left, right], [top, bottom]]: [[f32; 2]; 2], material: u32| {
            let [rightwards, downwards, forward] = lens.axes();
            let at = |x: f32, y: f32| {
                let [x, y] = [x - lens.middle()[0], y - lens.middle()[1]].map(|pixels| pixels * lens.pixel());
                (forward + rightwards * x + downwards * y) * depth
            };
            let first = mesh.positions.len() as u32;
            mesh.positions.extend([at(left, top), at(right, top), at(right, bottom), at(left, bottom)]);
            mesh.triangles.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
            mesh.materials.extend([material; 2]);
        };
        stand(2.0, LAMP, 0);
        stand(0.5, [[-1.0, 40.0], [-1.0, 9.0]], 1);
        let lamp = Material {
            emission: Colour::plain(Vec3::splat(RADIANCE)),
            emits_both_sides: true,
            ..Material::diffuse("lamp", Vec3::ZERO)
        };
        Scene {
            meshes: vec![mesh.into()],
            objects: vec![Object::fixed("all", 0)],
            materials: vec![lamp, Material::diffuse("screen", Vec3::ZERO)],
            camera,
            ..Scene::default()
        }
    }

    /// What all pixels emit, as the mean of so many frames.
    fn drawn(scene: &Scene, frames: u32) -> Vec<f32> {
        let (prepared, cache) = (Prepared::new(scene.clone()), LightSetCache::default());
        let [width, height] = SIZE;
        let mut mean = vec![0.0; (width * height) as usize];
        for frame in 0..frames {
            let quality = Quality { interleave: [1, 1], ..Quality::default() };
            let lit = Lit { set: 0, frame, seed: 1, quality };
            let tile = Tile { camera: scene.camera, rect: Rect { x: 0, y: 0, width, height }, lit };
            let question = Question { world: WorldState::default(), ask: Ask::Tile(tile) };
            let pixels = crate::answer(&prepared, &cache, &question, &|| 0).body.pixels().expect("tiles have pixels");
            mean.iter_mut().zip(pixels.emitted).for_each(|(mean, emitted)| *mean += emitted.x / frames as f32);
        }
        mean
    }

    /// A lamp covers a pixel by the product of what it covers of either side, and a net of n samples tells each to within 1/n.
    #[test]
    fn lamps_end_smoothly_whatever_is_cut_away() {
        for (cut, begins) in [(true, LAMP[0][0]), (false, 40.0)] {
            let scene = scene(cut);
            // Each of four replicates has a net of its own.
            for (frames, samples) in [(1, SAMPLES as f32), (64, (16 * SAMPLES) as f32)] {
                let mut partly = 0;
                for (i, emitted) in drawn(&scene, frames).into_iter().enumerate() {
                    let pixel = [i as u32 % SIZE[0], i as u32 / SIZE[0]];
                    let lamp = [[begins, LAMP[0][1]], LAMP[1]];
                    let covers: [f32; 2] = std::array::from_fn(|axis| {
                        let ([low, high], at) = (lamp[axis], pixel[axis] as f32);
                        (high.min(at + 1.0) - low.max(at)).clamp(0.0, 1.0)
                    });
                    let edges = covers.iter().filter(|share| (0.001..0.999).contains(*share)).count();
                    let is_seen = covers.iter().all(|share| *share > 0.0);
                    partly += u32::from(is_seen && edges > 0);
                    let within = if is_seen { edges as f32 / samples } else { 0.0 };
                    let (share, expected) = (emitted / RADIANCE, covers[0] * covers[1]);
                    assert!(
                        (share - expected).abs() <= within + 1e-3,
                        "{pixel:?} in {frames}: {share}, not {expected}"
                    );
                }
                assert!(partly > 60, "{partly} pixels");
            }
        }
    }

    #[test]
    fn nothing_is_looked_for_where_nothing_shines_or_something_moves() {
        let scene = scene(true);
        let prepared = Prepared::new(scene.clone());
        assert!(are_wanted(&prepared, Motion::Still) && !are_wanted(&prepared, Motion::Moving));
        let dark = Scene { materials: vec![Material::diffuse("black", Vec3::ZERO); 2], ..scene };
        assert!(!are_wanted(&Prepared::new(dark), Motion::Still));
    }
}
