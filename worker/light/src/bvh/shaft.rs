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
//! Every box that the interval meets is then tested against eight groups of sixteen rays at once,
//! as smaller intervals, and what is left of those ray by ray, sixteen at once: the points of one light
//! set lie pixels apart, so most small things that a shaft meets lie between its rays. Where only a
//! handful of rays meets a box, they go on below it one by one. At a leaf, a few rays meet eight
//! triangles at once, ray by ray; many meet one triangle after another, sixteen at once, those that the
//! interval cannot discard. What is occluded drops out; the walk ends when all is.

use glam::Vec3;

use super::bounds::Aabb;
use super::bundle::{Bundle, Entry, Scene, instances_in_reach};
use super::lanes::Isa;
use super::parallel::Parallel;
use super::targets::{Cluster, GROUP, Targets};
use super::triangle::NONE;
use super::world::World;

/// Remembered occluders; a power of two, above the number of virtual lights in a set.
const MEMORIES: usize = 128;

/// Memory between calls of [`World::shade_shaft`] and [`World::shade_along`]; one per thread. It changes time, never results.
pub struct ShaftScratch {
    bundle: Box<Bundle>,
    pub(super) parallel: Box<Parallel>,
    pub(super) stack: Vec<Entry>,
    /// By hash of the apex: what hid something from it last.
    memories: Vec<Memory>,
    /// Instances still to be visited.
    pub(super) open: Vec<(f32, u32)>,
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
        Self {
            bundle: Box::new(Bundle::new()),
            parallel: Box::new(Parallel::new()),
            stack: Vec::new(),
            memories: vec![Memory::default(); MEMORIES],
            open: Vec::new(),
        }
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
pub(super) fn report(targets: &Targets, cluster: &Cluster, alive: [u16; 8], visible: &mut [u64]) {
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
pub(super) fn asked(targets: &Targets, cluster: &Cluster, wanted: Option<&[u64]>) -> [u16; 8] {
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
    let ShaftScratch { bundle, stack, memories, open, .. } = scratch;
    let memory = &mut memories[slot];
    if memory.apex != task.apex {
        *memory = Memory { apex: task.apex, instance: NONE, leaf: 0 };
    }
    let mut alive = asked;
    // What hid something last time is likely to do so again.
    let mut aimed = NONE;
    if let Some(instance) = world.instances().get(memory.instance as usize) {
        aimed = memory.instance;
        bundle.aim(isa, instance, task, alive);
        if let Some(block) = instance.solid.blocks.get(memory.leaf as usize) {
            let reach = bundle.all_alive();
            bundle.meet_block(isa, &Scene::new(instance, task.apex), block, &reach);
            alive = bundle.alive;
        }
    }
    let bounds = task.cluster.bounds;
    let directions = Aabb { min: bounds.min - task.apex, max: bounds.max - task.apex };
    instances_in_reach(isa, world, task.apex, &directions, 1.0, open);
    while let Some((_, number)) = open.pop() {
        if alive == [0; 8] {
            break;
        }
        let instance = &world.instances()[number as usize];
        if aimed != number {
            bundle.aim(isa, instance, task, alive);
        }
        aimed = NONE;
        if let Some(leaf) = bundle.occlude(isa, &Scene::new(instance, task.apex), stack) {
            (memory.instance, memory.leaf) = (number, leaf);
        }
        alive = bundle.alive;
    }
    alive
}
