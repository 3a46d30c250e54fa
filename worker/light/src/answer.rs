//! The only door: a question in, an answer out, the same bits whoever asks whom.

use std::sync::{Arc, OnceLock};

use glam::Vec3;
use protocol::answer::{Answer, Body, Cost, LIGHTS_MAX, LightPoint, Pixels};
use protocol::question::{Ask, Grid, Lights, Lit, Motion, Quality, Question, Scramble, Tile, WorldState};

use scenes::camera::Lens;

use crate::bvh::{Hit, PacketScratch, Ray};
use crate::eye::{self, EndPoint};
use crate::gather::{self, Gathered};
use crate::importance::Importance;
use crate::photons::radius_of_round;
use crate::prepared::Prepared;
use crate::reference;
use crate::remainder::Remainder;
use crate::sample::{Sequence, Stage};
use crate::shelf::{SetKey, Shelf, ViewKey};
use crate::vpl::{Gates, Shape, Vpl};
use crate::walk::{LightSet, Sequences, SetAddress};

/// Pixels are lit in blocks of so many by so many of the tile's grid: their end points make slim shafts.
const BLOCK: [u32; 2] = [16, 8];

/// Which numbers of which sequence a frame uses (algorithms.md B8).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Turn {
    /// Tells independent scrambles apart.
    randomisation: u32,
    /// How often any has: decides the photon radius.
    round: u32,
    /// Index of the frame among those of this randomisation: numbers eye paths, and how far the light
    /// paths' sequence has come. It advances by all sets every frame: light sets cost little beside
    /// their shadows, and a frame with new ones repeats no error of the last.
    index: u32,
}

impl Turn {
    fn of(quality: &Quality, frame: u32) -> Self {
        let sets = u32::from(quality.sets());
        match quality.motion {
            Motion::Still => {
                let round = frame / sets;
                let randomisation = u32::from(quality.randomisation_of(frame));
                let rounds_before = round / u32::from(quality.randomisations.max(1));
                Self { randomisation, round, index: rounds_before * sets + frame % sets }
            }
            Motion::Moving => Self { randomisation: 0, round: 0, index: 0 },
            Motion::Fresh => Self { randomisation: frame, round: frame, index: 0 },
        }
    }
}

/// Answers a question about a prepared scene.
///
/// `clock` gives microseconds and only fills [`Cost::micros`].
pub fn answer(prepared: &Prepared, shelf: &Shelf, question: &Question, clock: &dyn Fn() -> u64) -> Answer {
    match &question.ask {
        Ask::Tile(tile) => {
            let mut work = Work { pixels: Pixels::black(tile.grid().len()), cost: Cost::default() };
            paint_tile(prepared, shelf, question.world, tile, clock, &mut work);
            Answer { body: Body::Pixels(work.pixels), cost: work.cost }
        }
        Ask::Reference(samples) => reference::answer(prepared, samples, clock),
        Ask::Lights(lights) => show_lights(prepared, shelf, question.world, lights),
    }
}

/// The answer to a tile, as it grows.
struct Work {
    pixels: Pixels,
    cost: Cost,
}

fn paint_tile(
    prepared: &Prepared,
    shelf: &Shelf,
    world: WorldState,
    tile: &Tile,
    clock: &dyn Fn() -> u64,
    work: &mut Work,
) {
    let grid = tile.grid();
    if grid.is_empty() {
        return;
    }
    let mut watch = Watch { clock, last: clock() };
    let turn = Turn::of(&tile.lit.quality, tile.lit.frame);
    let shelved = light_set(prepared, shelf, world, &tile.lights(), turn, &mut work.cost);
    let Some(set) = shelved.get() else { return };
    watch.stop(&mut work.cost, 1);

    let gates = Gates::new(tile.lit.quality.bound, prepared.diameter);
    // Eye paths are Owen-scrambled in every mode: one scramble a pixel, which XOR would make alike.
    let sequence = |stage| Sequence::new(tile.lit.seed, stage, [turn.randomisation], Scramble::Owen);
    let sequences = [sequence(Stage::Eye), sequence(Stage::Remainder)];
    let painter = Painter { prepared, tile, grid, lens: tile.camera.lens(), turn, set, gates, sequences };
    let mut scratch = Scratch::default();
    for top in (0..grid.rows).step_by(BLOCK[1] as usize) {
        for left in (0..grid.columns).step_by(BLOCK[0] as usize) {
            let block = block_at(&grid, top, left);
            painter.paint(&block, &mut scratch, work, &mut watch);
        }
    }
}

/// The pixels of a block, as indices into the grid. In order of 4×4 squares, whose rays lie closest together.
fn block_at(grid: &Grid, top: u32, left: u32) -> Vec<usize> {
    let (bottom, right) = ((top + BLOCK[1]).min(grid.rows), (left + BLOCK[0]).min(grid.columns));
    let mut block = Vec::with_capacity((BLOCK[0] * BLOCK[1]) as usize);
    for (y, x) in (top..bottom).step_by(4).flat_map(|y| (left..right).step_by(4).map(move |x| (y, x))) {
        for row in y..(y + 4).min(bottom) {
            block.extend((x..(x + 4).min(right)).map(|column| (row * grid.columns + column) as usize));
        }
    }
    block
}

/// Memory between blocks; one per tile. It changes time, never results.
#[derive(Default)]
struct Scratch {
    packet: PacketScratch,
    gather: gather::Scratch,
    directions: Vec<Vec3>,
    hits: Vec<Option<Hit>>,
    /// First and second end points of the block.
    ends: [Vec<EndPoint>; 2],
    /// Which pixel of the block each belongs to.
    owners: [Vec<usize>; 2],
    sums: Vec<Gathered>,
}

/// The set's light, from the shelf or made now.
fn light_set(
    prepared: &Prepared,
    shelf: &Shelf,
    world: WorldState,
    which: &Lights,
    turn: Turn,
    cost: &mut Cost,
) -> Arc<OnceLock<LightSet>> {
    let Lights { camera, lit: Lit { set, seed, quality, .. } } = which;
    let block = turn.index.wrapping_mul(u32::from(quality.sets())).wrapping_add(u32::from(*set));
    let round = if quality.shrink_radius { turn.round } else { 0 };
    let view = ViewKey { world, camera: quality.importance.then_some(*camera), quality: *quality };
    let key = SetKey { view, seed: *seed, randomisation: turn.randomisation, block, round };
    let first = quality.photon_radius * prepared.diameter;
    let at = SetAddress { block, radius: radius_of_round(first, round) };
    let sequence = |stage| Sequence::new(*seed, stage, [turn.randomisation, 0, 0], quality.scramble);
    let sequences =
        Sequences { lights: sequence(Stage::Lights), walk: sequence(Stage::Walk), photons: sequence(Stage::Photons) };
    let (slot, made) = shelf.sets.get(&key, || {
        let (importance, looked) = shelf.views.get(&view, || Importance::new(prepared, camera, quality));
        let Some(importance) = importance.get() else { return LightSet::default() };
        if looked {
            cost.light_rays += importance.rays;
        }
        LightSet::trace(prepared, importance, quality, &sequences, at)
    });
    if made {
        cost.light_rays += slot.get().map_or(0, |set| set.rays);
    }
    slot
}

/// The virtual lights of a set that lie anywhere: suns do not.
fn show_lights(prepared: &Prepared, shelf: &Shelf, world: WorldState, which: &Lights) -> Answer {
    let mut cost = Cost::default();
    let turn = Turn::of(&which.lit.quality, which.lit.frame);
    let set = light_set(prepared, shelf, world, which, turn, &mut cost);
    let lights = set.get().map_or(&[][..], |set| &set.vpls);
    let point = |vpl: &Vpl| LightPoint {
        position: vpl.position,
        normal: match vpl.shape {
            Shape::Surface | Shape::Glossy { .. } => vpl.normal,
            Shape::Point | Shape::Spot { .. } | Shape::Distant => Vec3::ZERO,
        },
        strength: vpl.strength,
        depth: vpl.depth,
    };
    let somewhere = lights.iter().filter(|vpl| vpl.shape != Shape::Distant);
    Answer { body: Body::Lights(somewhere.take(LIGHTS_MAX).map(point).collect()), cost }
}

/// Everything that is the same for all pixels of a tile.
struct Painter<'a> {
    prepared: &'a Prepared,
    tile: &'a Tile,
    grid: Grid,
    lens: Lens,
    turn: Turn,
    set: &'a LightSet,
    gates: Gates,
    /// Of eye paths and of the remainder, without the pixel.
    sequences: [Sequence; 2],
}

impl Painter<'_> {
    /// Traces, lights and writes the pixels whose indices (into the tile's grid) are given.
    fn paint(&self, block: &[usize], scratch: &mut Scratch, work: &mut Work, watch: &mut Watch) {
        let quality = &self.tile.lit.quality;
        let cost = &mut work.cost;
        let Scratch { packet, gather: gathering, directions, hits, ends, owners, sums } = scratch;
        // Follow the eye paths.
        let [eye, remainder] = &self.sequences;
        let index = self.turn.index;
        let ray = |pixel: usize| eye::ray(&self.lens, self.place(pixel), &self.at(eye, pixel), index);
        directions.clear();
        directions.extend(block.iter().map(|pixel| ray(*pixel).direction));
        hits.resize(block.len(), None);
        self.prepared.world.closest_from(self.lens.origin(), directions, packet, hits);
        ends.iter_mut().for_each(Vec::clear);
        owners.iter_mut().for_each(Vec::clear);
        for (owner, pixel) in block.iter().enumerate() {
            let ray = Ray { origin: self.lens.origin(), direction: directions[owner], t_max: f32::INFINITY };
            let sight = eye::see(self.prepared, &ray, hits[owner], &self.at(eye, *pixel), index);
            cost.eye_rays += sight.rays;
            work.pixels.emitted[*pixel] = sight.emitted;
            for (slot, end) in sight.ends.iter().enumerate() {
                if let Some(end) = end {
                    ends[slot].push(*end);
                    owners[slot].push(owner);
                }
            }
        }
        let [ends, others] = ends;
        ends.append(others);
        let ends = &ends[..];
        let owners = || {
            let of = |slot: usize| owners[slot].iter().map(move |owner| (*owner, slot));
            of(0).chain(of(1))
        };
        watch.stop(cost, 0);
        // Light from virtual lights, through shafts.
        sums.clear();
        sums.resize(ends.len(), Gathered::default());
        gather::virtual_lights(self.prepared, self.set, self.gates, ends, gathering, sums, cost);
        watch.stop(cost, 2);
        // Light from caustics.
        if !(self.set.photons.is_empty() && self.prepared.may_skip()) {
            gather::caustics(self.set, ends, sums, cost);
            watch.stop(cost, 3);
        }
        // Light that the bound cut off, and light off surfaces through glass and mirrors.
        let estimate = Remainder::new(self.prepared, self.set, self.gates, quality);
        if estimate.is_needed() {
            for ((end, sum), (owner, slot)) in ends.iter().zip(sums.iter_mut()).zip(owners()) {
                let group = (slot as u32) << 16;
                gather::remainder(&estimate, end, &self.at(remainder, block[owner]), group, index, sum, cost);
            }
            watch.stop(cost, 4);
        }
        // Write the pixels.
        for ((end, sum), (owner, slot)) in ends.iter().zip(sums.iter()).zip(owners()) {
            write(&mut work.pixels, block[owner], slot, end, sum);
        }
        for pixel in block {
            drop_unless_finite(&mut work.pixels, *pixel, cost);
        }
    }

    /// Picture coordinates of a pixel of the grid.
    fn place(&self, pixel: usize) -> [u32; 2] {
        let grid = &self.grid;
        let (row, column) = (pixel as u32 / grid.columns, pixel as u32 % grid.columns);
        [grid.x + column * grid.step_x, grid.y + row * grid.step_y]
    }

    /// The sequence of one pixel of the grid.
    fn at(&self, sequence: &Sequence, pixel: usize) -> Sequence {
        let [x, y] = self.place(pixel);
        sequence.with(x).with(y)
    }
}

/// The first end point is kept apart for the filter; all other light is emission to it.
fn write(pixels: &mut Pixels, pixel: usize, slot: usize, end: &EndPoint, sum: &Gathered) {
    pixels.emitted[pixel] += sum.lobe;
    if slot == 0 {
        pixels.reflectance[pixel] = end.weight;
        pixels.irradiance[pixel] = sum.irradiance;
        pixels.normal[pixel] = end.seen_normal;
        pixels.distance[pixel] = end.distance;
    } else {
        pixels.emitted[pixel] += end.weight * sum.irradiance * std::f32::consts::FRAC_1_PI;
    }
}

/// One bad sample must not spoil a picture for ever: it is dropped and counted (E32).
fn drop_unless_finite(pixels: &mut Pixels, pixel: usize, cost: &mut Cost) {
    let numbers = [pixels.emitted[pixel], pixels.reflectance[pixel], pixels.irradiance[pixel], pixels.normal[pixel]];
    if numbers.iter().all(|v| v.is_finite()) && pixels.distance[pixel].is_finite() {
        return;
    }
    cost.dropped += 1;
    pixels.emitted[pixel] = Vec3::ZERO;
    pixels.reflectance[pixel] = Vec3::ZERO;
    pixels.irradiance[pixel] = Vec3::ZERO;
    pixels.normal[pixel] = Vec3::ZERO;
    pixels.distance[pixel] = 0.0;
}

/// Splits time among the stages.
struct Watch<'a> {
    clock: &'a dyn Fn() -> u64,
    last: u64,
}

impl Watch<'_> {
    fn stop(&mut self, cost: &mut Cost, stage: usize) {
        let now = (self.clock)();
        cost.micros[stage] += now.saturating_sub(self.last);
        self.last = now;
    }
}
