//! Which points of a tile can see a virtual light: all shadow rays from one apex to a cluster of
//! points walk the tree together, as a **shaft**.
//!
//! # How
//! All rays share their origin, so their directions lie in a box, and a shaft is a ray whose
//! direction is an *interval*: [`Interval`] is the slab test of single rays in interval arithmetic.
//! Rounding is monotone, so it can never refuse a box that one of its rays would accept, and the
//! same holds for the edge functions of a triangle. In open space, one walk of a few nodes shows that
//! a hundred points see the light.
//!
//! At a leaf, from coarse to fine: the leaf's box against eight groups of sixteen rays at once; eight
//! triangles against the interval at once, which discards most; each remaining triangle against the
//! groups, sixteen rays at once, three dot products a ray. What is occluded drops out; the walk ends
//! when all is.
//!
//! Work is bounded: a shaft that has been to [`LEAVES_MAX`] leaves splits its rays in two, each
//! half with a slimmer shaft and a copy of what remains to be done; a handful of rays go on one by one.
//!
//! # When it is bad
//! Where neighbouring rays meet different small things (leaves, balusters) there is nothing to share.

use glam::Vec3;

use super::bounds::Aabb;
use super::bundle::{Bundle, Entry, Outcome, Scene};
use super::interval::Interval;
use super::lanes::Isa;
use super::slabs::thickness;
use super::targets::{Cluster, GROUP, Targets};
use super::tree::LEAF;
use super::triangle::NONE;
use super::world::World;

/// So few rays go on singly.
const SINGLE_MAX: u32 = 4;
/// Bundles that can wait at once: halving the rays of a cluster until [`SINGLE_MAX`] are left.
const BUNDLES: usize = 6;
/// Remembered occluders; a power of two, above the number of virtual lights in a set.
const MEMORIES: usize = 128;

/// Memory between calls of [`World::shade_shaft`]; one per thread. It changes time, never results.
pub struct ShaftScratch {
    bundles: Vec<Bundle>,
    /// By hash of the apex: what hid something from it last.
    memories: Vec<Memory>,
    /// Instances still to be visited.
    open: Vec<u32>,
}

#[derive(Clone, Copy)]
struct Memory {
    apex: Vec3,
    /// [`NONE`]: nothing yet.
    instance: u32,
    leaf: u32,
}

impl Default for Memory {
    fn default() -> Self {
        Self { apex: Vec3::ZERO, instance: NONE, leaf: 0 }
    }
}

/// What [`shade`] does for one cluster.
pub(super) struct Task<'a> {
    pub apex: Vec3,
    pub targets: &'a Targets,
    pub cluster: &'a Cluster,
}
impl Default for ShaftScratch {
    fn default() -> Self {
        Self { bundles: vec![Bundle::new(); BUNDLES], memories: vec![Memory::default(); MEMORIES], open: Vec::new() }
    }
}

/// [`World::shade_shaft`].
#[inline(always)]
pub(super) fn shade<I: Isa>(
    isa: I,
    world: &World,
    apex: Vec3,
    targets: &Targets,
    wanted: Option<&[u64]>,
    scratch: &mut ShaftScratch,
    visible: &mut [u64],
) {
    let slot = memory_slot(apex);
    for cluster in &targets.clusters {
        let asked = asked(targets, cluster, wanted);
        if asked == [0; 8] {
            continue;
        }
        let task = Task { apex, targets, cluster };
        let alive = shade_cluster(isa, world, &task, asked, scratch, slot);
        report(targets, cluster, alive, visible);
    }
}

fn memory_slot(apex: Vec3) -> usize {
    let [x, y, z] = apex.to_array().map(f32::to_bits);
    let hash = x.wrapping_mul(0x9E37_79B1) ^ y.wrapping_mul(0x85EB_CA77) ^ z.wrapping_mul(0xC2B2_AE3D);
    (hash >> 16) as usize % MEMORIES
}

/// Sets the bits of the points that are alive.
#[inline(always)]
fn report(targets: &Targets, cluster: &Cluster, alive: [u16; 8], visible: &mut [u64]) {
    for (group, alive) in alive.into_iter().enumerate() {
        let mut bits = alive;
        // Most groups are seen or hidden as a whole.
        let whole = bits != 0 && bits == cluster.members(group);
        if let (true, Some(all)) = (whole, targets.bits.get(cluster.start / GROUP + group)) {
            for (visible, bits) in visible.iter_mut().zip(all) {
                *visible |= bits;
            }
            continue;
        }
        while bits != 0 {
            let place = cluster.start + group * GROUP + bits.trailing_zeros() as usize;
            let number = targets.numbers[place] as usize;
            visible[number / 64] |= 1 << (number % 64);
            bits &= bits - 1;
        }
    }
}

/// The points of a cluster that somebody wants to know about, by group.
#[inline(always)]
fn asked(targets: &Targets, cluster: &Cluster, wanted: Option<&[u64]>) -> [u16; 8] {
    let mut asked = [0; 8];
    for (group, asked) in asked.iter_mut().enumerate() {
        let members = cluster.members(group);
        *asked = members;
        let Some(wanted) = wanted else { continue };
        // Most groups are wanted or not as a whole.
        if let (true, Some(all)) = (members != 0, targets.bits.get(cluster.start / GROUP + group)) {
            let of = |bits: &[u64; 4]| {
                wanted
                    .iter()
                    .zip(bits)
                    .fold((true, true), |(none, every), (w, b)| (none && w & b == 0, every && w & b == *b))
            };
            match of(all) {
                (true, _) => {
                    *asked = 0;
                    continue;
                }
                (_, true) => continue,
                _ => {}
            }
        }
        let mut rest = members;
        while rest != 0 {
            let lane = rest.trailing_zeros();
            let number = targets.numbers[cluster.start + group * GROUP + lane as usize] as usize;
            *asked &= !(u16::from(wanted[number / 64] >> (number % 64) & 1 == 0) << lane);
            rest &= rest - 1;
        }
    }
    asked
}

/// Which rays to a cluster reach it, of those asked for.
#[inline(always)]
fn shade_cluster<I: Isa>(
    isa: I,
    world: &World,
    task: &Task,
    asked: [u16; 8],
    scratch: &mut ShaftScratch,
    slot: usize,
) -> [u16; 8] {
    let ShaftScratch { bundles, memories, open } = scratch;
    let memory = &mut memories[slot];
    if memory.apex != task.apex {
        *memory = Memory { apex: task.apex, instance: NONE, leaf: 0 };
    }
    let mut alive = asked;
    // What hid something last time is likely to do so again.
    let mut aimed = NONE;
    if let Some(instance) = world.instances().get(memory.instance as usize) {
        aimed = memory.instance;
        bundles[0].aim(isa, instance, task, alive);
        if let Some(block) = instance.solid.blocks.get(memory.leaf as usize) {
            let awake = bundles[0].awake;
            bundles[0].meet_block(isa, &Scene::new(instance, task.apex), block, awake);
            alive = bundles[0].alive;
        }
    }
    instances_in_reach(isa, world, task, open);
    while let Some(number) = open.pop() {
        if alive == [0; 8] {
            break;
        }
        let instance = &world.instances()[number as usize];
        if aimed != number {
            bundles[0].aim(isa, instance, task, alive);
        }
        aimed = NONE;
        let mut occluder = None;
        alive = trace(isa, &Scene::new(instance, task.apex), bundles, &mut occluder);
        if let Some(leaf) = occluder {
            (memory.instance, memory.leaf) = (number, leaf);
        }
    }
    alive
}

/// The instances whose boxes the shaft may touch.
#[inline(always)]
fn instances_in_reach<I: Isa>(isa: I, world: &World, task: &Task, found: &mut Vec<u32>) {
    found.clear();
    if world.instances().len() == 1 {
        found.push(0);
        return;
    }
    let bounds = task.cluster.bounds;
    let directions = Aabb { min: bounds.min - task.apex, max: bounds.max - task.apex };
    let thick = thickness(task.apex, world.bounds().reach());
    let interval = Interval::new(&directions, task.apex + thick, task.apex - thick);
    let mut nodes = if world.top().is_empty() { vec![] } else { vec![0] };
    while let Some(node) = nodes.pop() {
        let node = &world.top()[node as usize];
        let mut hits = interval.meets::<I::Eight>(isa.eight(), node);
        while hits != 0 {
            let child = node.children[hits.trailing_zeros() as usize & 7];
            hits &= hits - 1;
            let (list, number) = if child & LEAF != 0 { (&mut *found, child & !LEAF) } else { (&mut nodes, child) };
            list.push(number);
        }
    }
}

/// Walks the tree with the first bundle; the others are room for its splits. What is alive at the end.
#[inline(always)]
fn trace<I: Isa>(isa: I, scene: &Scene, bundles: &mut [Bundle], occluder: &mut Option<u32>) -> [u16; 8] {
    let root = Entry { reference: 0, parent: 0, slot: 0 };
    bundles[0].stack.clear();
    bundles[0].stack.push(root);
    if bundles[0].awake == 0 {
        return bundles[0].alive;
    }
    if let Outcome::Done = bundles[0].advance(isa, scene, occluder) {
        return bundles[0].alive;
    }
    let mut alive = bundles[0].alive;
    bundles[0].members = std::array::from_fn(|ray| ray as u8);
    let (mut top, mut outcome) = (0, Outcome::TooMuch);
    loop {
        let splits = top + 1 < bundles.len() && bundles[top].count_alive() > SINGLE_MAX;
        match outcome {
            Outcome::TooMuch if splits => {
                bundles[top].report(&mut alive);
                let (lower, upper) = bundles.split_at_mut(top + 1);
                lower[top].split_into(&mut upper[0]);
                top += 1;
            }
            Outcome::TooMuch | Outcome::Done => {
                if matches!(outcome, Outcome::TooMuch) {
                    bundles[top].finish_singly(isa, scene);
                }
                bundles[top].report(&mut alive);
                if top == 0 {
                    return alive;
                }
                top -= 1;
            }
        }
        outcome = bundles[top].advance(isa, scene, occluder);
    }
}
