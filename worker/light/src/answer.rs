//! The only door: a question in, an answer out, the same bits whoever asks whom.

use std::convert::Infallible;
use std::sync::{Arc, OnceLock};

use glam::Vec3;
use protocol::answer::{Answer, Body, Cost, CostStage, LIGHTS_MAX, LightPoint, Pixels, over_frames};
use protocol::question::{
    Address, Ask, Grid, Lights, Lit, Motion, Quality, Question, Scramble, Tile, Unfit, WorldState,
};
use scenes::camera::Lens;
use scenes::{Camera, Rgb};

use crate::bias_compensation::BiasCompensation;
use crate::bvh::{Hit, PacketScratch, Ray};
use crate::cache::{EdgesKey, LightSetCache, SetKey, ViewKey};
use crate::edges::{self, Edges};
use crate::eye::{self, Around, EndPoint};
use crate::gather::{self, Gathered};
use crate::importance::Importance;
use crate::lobe::Shares;
use crate::prepared::Prepared;
use crate::sample::{Sequence, Stage};
use crate::vpl::{Shape, Vpl};
use crate::walk::{LightSet, Sequences, SetAddress};
use crate::{points, rays, reference};

/// Pixels are lit in blocks of so many by so many of the tile's grid: their end points make slim shafts.
const BLOCK: [u32; 2] = [16, 8];

/// Which numbers of which sequence a frame uses (algorithms.md B8).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Turn {
    /// Tells independent scrambles apart.
    replicate: u32,
    /// How often any has: decides the photon radius.
    round: u32,
    /// Index of the frame among those of this replicate: numbers eye paths, and how far the light
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
                let replicate = u32::from(quality.replicate_of(frame));
                let rounds_before = round / u32::from(quality.replicates.max(1));
                Self { replicate, round, index: rounds_before * sets + frame % sets }
            }
            Motion::Moving => Self { replicate: 0, round: 0, index: 0 },
            Motion::Fresh => Self { replicate: frame, round: frame, index: 0 },
        }
    }
}

/// Looks whether a scene has what a question asks about.
///
/// # Errors
/// [`Unfit`] names what it does not have; then there is no answer.
pub fn check(prepared: &Prepared, question: &Question) -> Result<(), Unfit> {
    question.ask.check_in(&prepared.scene, || prepared.groups().len())
}

/// Answers a question about a prepared scene.
///
/// `clock` gives microseconds and only fills [`Cost::micros`].
///
/// # Panics
/// If the scene does not have what is asked about ([`check`]).
pub fn answer(prepared: &Prepared, cache: &LightSetCache, question: &Question, clock: &dyn Fn() -> u64) -> Answer {
    match &question.ask {
        Ask::Tile(tile) => {
            let mut work = Work { pixels: Pixels::black(tile.grid().len()), cost: Cost::default() };
            paint_tile(prepared, cache, question.world, tile, clock, &mut work);
            Answer { body: Body::Pixels(work.pixels), cost: work.cost }
        }
        Ask::Frames(frames) => {
            let one = |tile| Question { world: question.world, ask: Ask::Tile(tile) };
            let Ok(mean) = over_frames(frames, |tile| Ok::<_, Infallible>(answer(prepared, cache, &one(tile), clock)));
            mean
        }
        Ask::Reference(samples) => reference::answer(prepared, samples, clock),
        Ask::Lights(lights) => show_lights(prepared, cache, question.world, lights),
        Ask::Rays(rays) => rays::answer(prepared, cache, question.world, rays, clock),
        Ask::Points(points) => points::answer(prepared, cache, question.world, points, clock),
    }
}

/// The answer about pixels, as it grows.
pub(crate) struct Work {
    pub(crate) pixels: Pixels,
    pub(crate) cost: Cost,
}

fn paint_tile(
    prepared: &Prepared,
    cache: &LightSetCache,
    world: WorldState,
    tile: &Tile,
    clock: &dyn Fn() -> u64,
    work: &mut Work,
) {
    let grid = tile.grid();
    if grid.is_empty() {
        return;
    }
    let mut watch = Watch::start(clock);
    let cached = light_set(prepared, cache, world, Some(&tile.camera), &tile.lit, &mut work.cost);
    let Some(set) = cached.get() else { return };
    watch.stop(&mut work.cost, CostStage::LightSets);

    let lens = tile.camera.lens();
    let paths = Paths::of(&tile.lit, tile.lit.frame);
    let painter = Painter::new(prepared, set, &tile.lit.quality, lens.origin());
    let edges = edges_seen(prepared, cache, world, &tile.camera, &tile.lit);
    let edges = edges.as_ref().and_then(|edges| edges.get());
    let mut scratch = Scratch::default();
    let mut eyes = Vec::new();
    let through = |slot: usize, scratch: &mut Scratch, cost: &mut Cost| {
        let (row, column) = (slot as u32 / grid.columns, slot as u32 % grid.columns);
        let pixel = [grid.x + column * grid.step_x, grid.y + row * grid.step_y];
        let path = paths.at(pixel);
        let direction = eye::ray(&lens, pixel, &path.eye, path.index).direction;
        Eye { slot, direction, path, edge: edge_in(prepared, edges, pixel, scratch, cost) }
    };
    for top in (0..grid.rows).step_by(BLOCK[1] as usize) {
        for left in (0..grid.columns).step_by(BLOCK[0] as usize) {
            eyes.clear();
            let block = block_at(&grid, top, left).into_iter();
            eyes.extend(block.map(|slot| through(slot, &mut scratch, &mut work.cost)));
            painter.trace(&lens, &eyes, &mut scratch);
            painter.paint(&eyes, &mut scratch, work, &mut watch);
        }
    }
}

/// The sequences of all eye paths of a frame, without the pixel.
///
/// They are Owen-scrambled in every mode: one scramble a pixel, which XOR would make alike.
#[derive(Clone, Copy)]
pub(crate) struct Paths {
    eye: Sequence,
    compensation: Sequence,
    index: u32,
}

/// Random numbers of one eye path, and of what the bounds cut off where it ends.
#[derive(Clone, Copy)]
pub(crate) struct Path {
    pub(crate) eye: Sequence,
    pub(crate) compensation: Sequence,
    pub(crate) index: u32,
}

impl Paths {
    /// Of frame `number`, with the seed and knobs of a light set.
    pub(crate) fn of(lit: &Lit, number: u32) -> Self {
        let turn = Turn::of(&lit.quality, number);
        let sequence = |stage| Sequence::new(lit.seed, stage, [turn.replicate], Scramble::Owen);
        Self { eye: sequence(Stage::Eye), compensation: sequence(Stage::BiasCompensation), index: turn.index }
    }

    /// That of a pixel.
    pub(crate) fn at(&self, [x, y]: [u32; 2]) -> Path {
        let Self { eye, compensation, index } = *self;
        Path { eye: eye.with(x).with(y), compensation: compensation.with(x).with(y), index }
    }
}

impl Path {
    /// That of an address: the path that a tile has in this pixel and frame.
    pub(crate) fn of(lit: &Lit, address: &Address) -> Self {
        Paths::of(lit, address.number).at(address.pixel)
    }
}

/// Where a camera sees things end that shine, from the cache; `None` if that is not looked for.
pub(crate) fn edges_seen(
    prepared: &Prepared,
    cache: &LightSetCache,
    world: WorldState,
    camera: &Camera,
    lit: &Lit,
) -> Option<Arc<OnceLock<Edges>>> {
    let key = EdgesKey { world, camera: *camera };
    edges::are_wanted(prepared, lit.quality.motion).then(|| cache.edges.get(&key, || Edges::new(camera)).0)
}

/// The pixel, if something that shines ends in it.
pub(crate) fn edge_in(
    prepared: &Prepared,
    edges: Option<&Edges>,
    pixel: [u32; 2],
    scratch: &mut Scratch,
    cost: &mut Cost,
) -> Option<[u32; 2]> {
    edges.is_some_and(|edges| edges.are_in(prepared, pixel, &mut scratch.packet, cost)).then_some(pixel)
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

/// Memory between blocks; one per question. It changes time, never results.
#[derive(Default)]
pub(crate) struct Scratch {
    packet: PacketScratch,
    gather: gather::Scratch,
    directions: Vec<Vec3>,
    /// What each eye path of the block meets first.
    pub(crate) hits: Vec<Option<Hit>>,
    /// First and second end points of the block.
    ends: [Vec<EndPoint>; 2],
    /// Which pixel of the block each belongs to.
    owners: [Vec<usize>; 2],
    sums: Vec<Gathered>,
}

/// The set's light, from the cache or made now. Without a view, light is chosen for nobody.
pub(crate) fn light_set(
    prepared: &Prepared,
    cache: &LightSetCache,
    world: WorldState,
    view: Option<&Camera>,
    lit: &Lit,
    cost: &mut Cost,
) -> Arc<OnceLock<LightSet>> {
    let Lit { set, frame, seed, quality } = lit;
    let turn = Turn::of(quality, *frame);
    let quality = &Quality { importance: quality.importance && view.is_some(), ..*quality };
    let block = turn.index.wrapping_mul(u32::from(quality.sets())).wrapping_add(u32::from(*set));
    let round = if quality.shrink_radius { turn.round } else { 0 };
    let camera = view.copied().unwrap_or_default();
    let view = ViewKey { world, camera: quality.importance.then_some(camera), quality: *quality };
    let key = SetKey { view, seed: *seed, replicate: turn.replicate, block, round };
    let at = SetAddress { block, round };
    let sequence = |stage| Sequence::new(*seed, stage, [turn.replicate, 0, 0], quality.scramble);
    let sequences =
        Sequences { lights: sequence(Stage::Lights), walk: sequence(Stage::Walk), photons: sequence(Stage::Photons) };
    let (slot, made) = cache.sets.get(&key, || {
        let (importance, looked) = cache.views.get(&view, || Importance::new(prepared, &camera, quality));
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
fn show_lights(prepared: &Prepared, cache: &LightSetCache, world: WorldState, which: &Lights) -> Answer {
    let mut cost = Cost::default();
    let set = light_set(prepared, cache, world, Some(&which.camera), &which.lit, &mut cost);
    let lights = set.get().map_or(&[][..], |set| &set.vpls);
    let point = |vpl: &Vpl| LightPoint {
        position: vpl.position,
        normal: match vpl.shape {
            Shape::Surface | Shape::Glossy { .. } => vpl.normal,
            Shape::Point | Shape::Spot { .. } | Shape::Luminaire(_) | Shape::Distant => Vec3::ZERO,
        },
        strength: vpl.strength,
        depth: vpl.depth,
    };
    let somewhere = lights.iter().filter(|vpl| vpl.shape != Shape::Distant);
    Answer { body: Body::Lights(somewhere.take(LIGHTS_MAX).map(point).collect()), cost }
}

/// An eye path that is to be followed.
pub(crate) struct Eye {
    /// Where among the pixels of the answer what it finds is written.
    pub(crate) slot: usize,
    /// Unit.
    pub(crate) direction: Vec3,
    pub(crate) path: Path,
    /// The pixel, if something that shines ends in it.
    pub(crate) edge: Option<[u32; 2]>,
}

/// Everything that is the same for all eye paths of a question.
pub(crate) struct Painter<'a> {
    prepared: &'a Prepared,
    set: &'a LightSet,
    shares: Shares,
    estimate: BiasCompensation<'a>,
    /// Where they all begin.
    origin: Vec3,
    /// What they meet first counts as matt and white.
    illuminance: bool,
}

impl<'a> Painter<'a> {
    pub(crate) fn new(prepared: &'a Prepared, set: &'a LightSet, quality: &Quality, origin: Vec3) -> Self {
        let shares = Shares::new(quality, set, set.gates);
        let estimate = BiasCompensation::new(prepared, set, set.gates, quality);
        Self { prepared, set, shares, estimate, origin, illuminance: quality.illuminance }
    }

    /// Finds what each eye path of a block meets first; and then, in the order of those at edges, what their other rays do.
    pub(crate) fn trace(&self, lens: &Lens, eyes: &[Eye], scratch: &mut Scratch) {
        let Scratch { packet, directions, hits, .. } = scratch;
        directions.clear();
        directions.extend(eyes.iter().map(|eye| eye.direction));
        for eye in eyes {
            directions.extend(
                eye.edge.iter().flat_map(|pixel| edges::directions(lens, *pixel, &eye.path.eye, eye.path.index)),
            );
        }
        eye::meet_all(self.prepared, lens, directions, packet, hits);
    }

    /// Follows the eye paths of a block from where they first meet something, lights and writes the pixels.
    pub(crate) fn paint(&self, eyes: &[Eye], scratch: &mut Scratch, work: &mut Work, watch: &mut Watch) {
        let cost = &mut work.cost;
        let Scratch { gather: gathering, directions, hits, ends, owners, sums, .. } = scratch;
        // Follow the eye paths.
        let illuminance = self.illuminance;
        let around = Around { prepared: self.prepared, shares: &self.shares, set: Some(self.set), illuminance };
        ends.iter_mut().for_each(Vec::clear);
        owners.iter_mut().for_each(Vec::clear);
        let ray = |direction: Vec3| Ray { origin: self.origin, direction, t_max: f32::INFINITY };
        let mut others = (eyes.len()..).step_by(edges::SAMPLES as usize);
        for (owner, (eye, hit)) in eyes.iter().zip(hits.iter()).enumerate() {
            let shone = eye.edge.and_then(|_| others.next()).map(|first| {
                let those = first..first + edges::SAMPLES as usize;
                cost.eye_rays += u64::from(edges::SAMPLES);
                those.map(|i| eye::shine(self.prepared, &ray(directions[i]), hits[i])).sum::<Rgb>()
                    / edges::SAMPLES as f32
            });
            let sight = eye::see(around, &ray(eye.direction), (*hit, shone), &eye.path.eye, eye.path.index);
            cost.eye_rays += sight.rays;
            work.pixels.emitted[eye.slot] = sight.emitted;
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
            let of = |slot: usize| owners[slot].iter().map(move |owner| (&eyes[*owner], slot));
            of(0).chain(of(1))
        };
        watch.stop(cost, CostStage::Eye);
        // Light from virtual lights, through shafts.
        sums.clear();
        sums.resize(ends.len(), Gathered::default());
        let rules = (self.set.gates, &self.shares);
        gather::virtual_lights(self.prepared, &self.set.vpls, rules, ends, gathering, sums, cost);
        watch.stop(cost, CostStage::Shadows);
        // Light from caustics.
        if !(self.set.photons.is_empty() && self.prepared.may_skip()) {
            gather::caustics(self.set, ends, sums, cost);
            watch.stop(cost, CostStage::Photons);
        }
        // Light that the bound cut off, and light off surfaces through glass and mirrors.
        if self.estimate.is_needed() {
            for ((end, sum), (eye, slot)) in ends.iter().zip(sums.iter_mut()).zip(owners()) {
                let group = (slot as u32) << 16;
                gather::bias_compensation(
                    &self.estimate,
                    end,
                    &eye.path.compensation,
                    group,
                    eye.path.index,
                    sum,
                    cost,
                );
            }
            watch.stop(cost, CostStage::BiasCompensation);
        }
        // Write the pixels.
        for ((end, sum), (eye, slot)) in ends.iter().zip(sums.iter()).zip(owners()) {
            let is_guide = slot == 0 && end.at.coverage(&self.prepared.scene) >= GUIDE_COVERAGE;
            write(&mut work.pixels, eye.slot, is_guide, end, sum);
        }
        for eye in eyes {
            drop_unless_finite(&mut work.pixels, eye.slot, cost);
        }
    }
}

/// What is there to a lesser part is not what a pixel is a picture of: its light is never filtered, and the place
/// that the pixel is taken for is the one behind.
const GUIDE_COVERAGE: f32 = 0.5;

/// Lobes whose albedo is less than this share of all are left to themselves.
const LEAST_LOBE: f32 = 1e-4;

/// The first end point is kept apart for the filter; all other light is emission to it.
fn write(pixels: &mut Pixels, pixel: usize, is_guide: bool, end: &EndPoint, sum: &Gathered) {
    let Split { reflectance, irradiance, lobe } = Split::of(end, sum);
    pixels.emitted[pixel] += lobe;
    if is_guide {
        pixels.reflectance[pixel] = reflectance;
        pixels.irradiance[pixel] = irradiance;
        pixels.normal[pixel] = end.seen_normal;
        pixels.distance[pixel] = end.distance;
    } else {
        pixels.emitted[pixel] += reflectance * irradiance * std::f32::consts::FRAC_1_PI;
    }
}

/// The light of an end point as what neighbours share, how much of it is reflected, and what is the pixel's own.
struct Split {
    reflectance: Rgb,
    irradiance: Rgb,
    lobe: Rgb,
}

impl Split {
    fn of(end: &EndPoint, sum: &Gathered) -> Self {
        let Some(gloss) = &end.glossy else {
            return Self { reflectance: end.weight, irradiance: sum.irradiance, lobe: sum.lobe };
        };
        let albedo = gloss.throughput * gloss.material.lobe_albedo(end.at.shading.dot(gloss.to).max(0.0));
        let both = end.weight + albedo;
        let counts = albedo.min_element() > LEAST_LOBE * both.max_element();
        if counts && !gloss.material.is_sharp() && albedo.max_element() > end.weight.max_element() {
            // A rough metal: neighbours share what its lobe reflects, once the lobe's albedo is taken out.
            let irradiance = (end.weight * sum.admitted + sum.lobe * std::f32::consts::PI) / both;
            return Self { reflectance: both, irradiance, lobe: Vec3::ZERO };
        }
        // What falls on the surface, and the share of it that gets through the lobe.
        let share = |admitted: f32, all: f32| if all > 0.0 { admitted / all } else { 1.0 };
        let [a, e] = [sum.admitted, sum.irradiance].map(|rgb| rgb.to_array());
        let admitted = Vec3::new(share(a[0], e[0]), share(a[1], e[1]), share(a[2], e[2]));
        Self { reflectance: end.weight * admitted, irradiance: sum.irradiance, lobe: sum.lobe }
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
pub(crate) struct Watch<'a> {
    clock: &'a dyn Fn() -> u64,
    last: u64,
}

impl<'a> Watch<'a> {
    pub(crate) fn start(clock: &'a dyn Fn() -> u64) -> Self {
        Self { clock, last: clock() }
    }

    pub(crate) fn stop(&mut self, cost: &mut Cost, stage: CostStage) {
        let now = (self.clock)();
        cost.spend(stage, now.saturating_sub(self.last));
        self.last = now;
    }
}
