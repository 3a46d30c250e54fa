//! What rays from one origin hit first: primary rays walk the tree together.
//!
//! Boxes are discarded as for shafts ([`super::shaft`]): by the interval of all directions, by those of
//! the groups, ray by ray, each time also where they lie behind the hits so far; near boxes go first.
//! Every hit is found by the operations of single rays ([`super::ray`]), and the best of them is best
//! whatever the order; so results are the same to the bit.

use glam::Vec3;

use super::bundle::{Bundle, Ends, Entry, Reach, Scene, instances_in_reach};
use super::interval::Interval;
use super::lanes::{Isa, Lanes};
use super::ray::{Probe, Spot, barycentric};
use super::targets::{CLUSTER, GROUP};
use super::tree::LEAF;
use super::triangle::{Block, NONE, Seen, in_box, same_side};
use super::vector::V3;
use super::world::{Hit, World};

/// So few rays go on singly.
const SINGLE_MAX: u32 = 3;
/// So few rays meet eight triangles at once, ray by ray; more, sixteen at once, triangle by triangle.
const FEW_RAYS: u32 = 12;

/// Memory between calls of [`World::closest_from`]; one per thread. It changes time, never results.
pub struct PacketScratch {
    bundle: Box<Bundle>,
    directions: Box<[[f32; CLUSTER]; 3]>,
    ends: Box<Ends>,
    stack: Vec<Entry>,
    /// Instances still to be visited.
    open: Vec<(f32, u32)>,
}

impl Default for PacketScratch {
    fn default() -> Self {
        Self {
            bundle: Box::new(Bundle::new()),
            directions: Box::new([[0.0; CLUSTER]; 3]),
            ends: Box::new(Ends { rays: [0.0; CLUSTER], groups: [0.0; 8] }),
            stack: Vec::new(),
            open: Vec::new(),
        }
    }
}

/// [`World::closest_from`] for 1 to [`CLUSTER`] finite directions.
#[inline(always)]
pub(super) fn closest<I: Isa>(
    isa: I,
    world: &World,
    origin: Vec3,
    directions: &[Vec3],
    scratch: &mut PacketScratch,
    hits: &mut [Option<Hit>],
) {
    let PacketScratch { bundle, directions: padded, ends, stack, open } = scratch;
    let (count, groups) = (directions.len(), directions.len().div_ceil(GROUP));
    hits.fill(None);
    for place in 0..groups * GROUP {
        let direction = directions[place.min(count - 1)].to_array();
        for axis in 0..3 {
            padded[axis][place] = direction[axis];
        }
    }
    // Padding ends before it starts.
    ends.rays = std::array::from_fn(|place| if place < count { f32::INFINITY } else { -1.0 });
    ends.groups = std::array::from_fn(|group| if group < groups { f32::INFINITY } else { -1.0 });
    let alive = std::array::from_fn(|group| {
        let members = count.saturating_sub(group * GROUP).min(GROUP);
        ((1_u32 << members) - 1) as u16
    });
    let bounds = super::bounds::Aabb::of(directions.iter().copied());
    instances_in_reach(isa, world, origin, &bounds, f32::INFINITY, open);
    // The nearest last: it is taken first.
    open.sort_unstable_by(|a, b| b.0.total_cmp(&a.0).then(b.1.cmp(&a.1)));
    while let Some((near, number)) = open.pop() {
        if near > farthest(ends) {
            break;
        }
        let instance = &world.instances()[number as usize];
        bundle.aim_along(isa, instance, padded, alive, count);
        let scene = Scene::new(instance, origin);
        Search { bundle, scene, ends, hits }.walk(isa, stack);
    }
}

/// The largest t at which a hit may still be the closest of its ray.
#[inline(always)]
fn farthest(ends: &Ends) -> f32 {
    ends.groups.iter().fold(0.0, |far, end| far.max(*end))
}

/// A walk through one instance.
struct Search<'a> {
    bundle: &'a mut Bundle,
    scene: Scene<'a>,
    /// t of the best hits so far.
    ends: &'a mut Ends,
    hits: &'a mut [Option<Hit>],
}

impl Search<'_> {
    #[inline(always)]
    fn walk<I: Isa>(&mut self, isa: I, stack: &mut Vec<Entry>) {
        let interval = Interval::new(&self.bundle.bounds, self.scene.low_origin, self.scene.high_origin);
        let mut farthest = farthest(self.ends);
        stack.clear();
        stack.push(Entry::ROOT);
        while let Some(entry) = stack.pop() {
            if entry.near > farthest {
                continue;
            }
            let reach = self.bundle.rays_in_reach(isa, &self.scene, &entry, Some(self.ends));
            if reach.groups == 0 {
                continue;
            }
            if reach.count <= SINGLE_MAX {
                self.walk_singly(isa, entry.reference, &reach);
            } else if entry.reference & LEAF != 0 {
                self.meet_block(isa, &self.scene.solid.blocks[(entry.reference & !LEAF) as usize], &reach);
            } else {
                let node = &self.scene.solid.nodes[entry.reference as usize];
                let (mut hits, near) = interval.meets::<I::Eight>(isa.eight(), node, farthest);
                let mut nears = [0.0; 8];
                near.store(&mut nears);
                let base = stack.len();
                while hits != 0 {
                    let slot = hits.trailing_zeros() & 7;
                    hits &= hits - 1;
                    let (reference, near) = (node.children[slot as usize], nears[slot as usize]);
                    if reference == NONE {
                        continue;
                    }
                    insert(stack, base, Entry { reference, parent: entry.reference, slot, near });
                }
                continue;
            }
            self.draw_in(isa, reach.groups);
            farthest = self::farthest(self.ends);
        }
    }

    /// Finds where the farthest ray of some groups ends now.
    #[inline(always)]
    fn draw_in<I: Isa>(&mut self, isa: I, mut groups: u32) {
        let proof = isa.eight();
        while groups != 0 {
            let group = groups.trailing_zeros() as usize & 7;
            groups &= groups - 1;
            let ends = &self.ends.rays[group * GROUP..];
            let mut each = [0.0; 8];
            I::Eight::load(proof, ends).max(I::Eight::load(proof, &ends[8..])).store(&mut each);
            self.ends.groups[group] = each.iter().fold(-1.0, |far, end| if *end > far { *end } else { far });
        }
    }

    /// Sends a few rays below a node or leaf, one by one.
    #[inline(always)]
    fn walk_singly<I: Isa>(&mut self, isa: I, start: u32, reach: &Reach) {
        for ray in reach.each() {
            let (direction, slabs) = self.ray(ray);
            let probe = Probe { origin: self.scene.apex, direction, slabs, object: self.scene.object };
            let limit = self.ends.rays[ray];
            if let Some(spot) = probe.closest_from::<I::Eight>(isa.eight(), self.scene.solid, start, limit) {
                self.take(ray, spot);
            }
        }
    }

    /// Tests eight triangles against rays.
    #[inline(always)]
    fn meet_block<I: Isa>(&mut self, isa: I, block: &Block, reach: &Reach) {
        let seen = block.seen_from::<I::Eight>(isa.eight(), self.scene.apex);
        if reach.count <= FEW_RAYS {
            for ray in reach.each() {
                let (direction, slabs) = self.ray(ray);
                let probe = Probe { origin: self.scene.apex, direction, slabs, object: self.scene.object };
                let limit = self.ends.rays[ray];
                let spot = probe.closest_in::<I::Eight>(isa.eight(), &seen, block, self.scene.solid, limit);
                if let Some(spot) = spot {
                    self.take(ray, spot);
                }
            }
            return;
        }
        let bounds = self.bundle.bounds;
        let mut candidates = seen.candidates(isa.eight(), bounds.min, bounds.max, f32::INFINITY);
        if candidates == 0 {
            return;
        }
        let each = seen.to_arrays();
        while candidates != 0 {
            let lane = candidates.trailing_zeros() as usize & 7;
            candidates &= candidates - 1;
            let triangle = Seen::<I::Wide>::broadcast(isa.wide(), &each, lane);
            let mut groups = reach.groups;
            while groups != 0 {
                let group = groups.trailing_zeros() as usize & 7;
                groups &= groups - 1;
                self.meet_triangle(isa, block, lane, &triangle, group, reach.rays[group]);
            }
        }
    }

    /// Tests a triangle against some rays of a group.
    #[inline(always)]
    fn meet_triangle<I: Isa>(
        &mut self,
        isa: I,
        block: &Block,
        lane: usize,
        triangle: &Seen<I::Wide>,
        group: usize,
        rays: u16,
    ) {
        let proof = isa.wide();
        let (zero, infinity) = (I::Wide::splat(proof, 0.0), I::Wide::splat(proof, f32::INFINITY));
        for part in 0..GROUP / I::Wide::COUNT {
            let at = group * GROUP + part * I::Wide::COUNT;
            let rays = u32::from(rays) >> (part * I::Wide::COUNT);
            let [xs, ys, zs] = &self.bundle.directions;
            let direction = V3::load(proof, [&xs[at..], &ys[at..], &zs[at..]]);
            let edges = triangle.edges_along(direction);
            if I::Wide::bits(same_side(zero, edges)) & rays == 0 {
                continue;
            }
            let slope = triangle.normal.dot(direction);
            let t = triangle.height / slope;
            let before = t.le(I::Wide::load(proof, &self.ends.rays[at..]));
            let met = same_side(zero, edges) & triangle.in_range(zero, slope, infinity) & before;
            let mut met = I::Wide::bits(met) & rays;
            if met == 0 {
                continue;
            }
            let (mut ts, mut values) = ([0.0; GROUP], [[0.0; GROUP]; 3]);
            t.store(&mut ts);
            edges[0].store(&mut values[0]);
            edges[1].store(&mut values[1]);
            edges[2].store(&mut values[2]);
            while met != 0 {
                let i = met.trailing_zeros() as usize & 15;
                met &= met - 1;
                self.confirm(block, lane, at + i, ts[i], values.each_ref().map(|edge| edge[i]));
            }
        }
    }

    /// What is left of the definition of a hit, for a ray that meets conditions 1 and 2.
    #[inline(always)]
    fn confirm(&mut self, block: &Block, lane: usize, ray: usize, t: f32, edges: [f32; 3]) {
        let (direction, slabs) = self.ray(ray);
        let Some(near) = in_box(block.corners(lane), &slabs) else { return };
        let ([u, v], triangle) = (barycentric(edges), block.ids[lane]);
        if !self.scene.solid.has_gaps() || self.scene.solid.is_present(&self.scene.place(direction, triangle, [u, v])) {
            self.take(ray, Spot { t: t.min(f32::MAX).max(near), u, v, triangle });
        }
    }

    /// Keeps a hit if it is the best of its ray so far.
    #[inline(always)]
    fn take(&mut self, ray: usize, Spot { t, u, v, triangle }: Spot) {
        let hit = Hit { t, u, v, object: self.scene.object, triangle };
        let best = &mut self.hits[ray];
        if best.is_none_or(|old| (t, hit.object, triangle) < (old.t, old.object, old.triangle)) {
            *best = Some(hit);
            self.ends.rays[ray] = t;
        }
    }

    #[inline(always)]
    fn ray(&self, ray: usize) -> (Vec3, super::slabs::Slabs) {
        (self.bundle.direction(ray), self.bundle.slabs(&self.scene, ray, f32::INFINITY))
    }
}

/// Keeps the entries from `base` on in order, nearest on top.
#[inline(always)]
fn insert(stack: &mut Vec<Entry>, base: usize, entry: Entry) {
    stack.push(entry);
    let mut place = stack.len() - 1;
    while place > base && stack[place - 1].near < entry.near {
        stack[place] = stack[place - 1];
        place -= 1;
    }
    stack[place] = entry;
}
