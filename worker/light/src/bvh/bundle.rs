//! A bundle of rays from one apex, on its way through a tree: the inner half of [`super::shaft`].
//!
//! Rays are kept in groups of sixteen. A group is tested against boxes as an interval of directions,
//! against triangles ray by ray in vectors.

use glam::{Mat3, Vec3};

use super::bounds::Aabb;
use super::interval::{GroupIntervals, Interval};
use super::lanes::{Isa, Lanes, max, min};
use super::ray::{Probe, barycentric};
use super::shaft::Task;
use super::slabs::{meets_lanes, thickness};
use super::solid::Solid;
use super::targets::{CLUSTER, GROUP, longest_axis};
use super::tree::{LEAF, Node};
use super::triangle::{Block, Seen, bounds_of, same_side};
use super::vector::V3;
use super::world::Instance;

/// Leaves a shaft may visit before it splits. More: less overhead in open space, more waste in foliage.
const LEAVES_MAX: u32 = 64;
/// Up to so many groups, triangles are first tested against the bounds of each group, instead of all.
const FEW_GROUPS: u32 = 2;

/// What all shafts from an apex towards a solid share, in object space.
pub(super) struct Scene<'a> {
    pub solid: &'a Solid,
    pub apex: Vec3,
    pub low_origin: Vec3,
    pub high_origin: Vec3,
}

/// Rays from one apex, and what they still have to visit.
#[derive(Clone)]
pub(super) struct Bundle {
    /// From the apex to the targets, by axis.
    directions: [[f32; CLUSTER]; 3],
    /// Number of rays, and of groups in use.
    rays: usize,
    groups: usize,
    /// Rays not occluded so far: bit i of entry g is ray 16 g + i.
    pub alive: [u16; 8],
    /// Bit g is set where `alive[g]` is not zero.
    pub awake: u32,
    /// Which ray of the cluster each ray is; not yet set in the bundle of the whole cluster.
    pub members: [u8; CLUSTER],
    /// Bounds of the directions of each group, as in [`Node::faces`].
    spans: [[f32; 8]; 6],
    /// Bounds of the directions of all groups that were awake when it was last asked.
    bounds: Aabb,
    /// The groups as intervals; made when a leaf first asks.
    intervals: GroupIntervals,
    intervals_known: bool,
    pub stack: Vec<Entry>,
}

/// A reference to visit, and in which slot of which node it stands.
#[derive(Clone, Copy)]
pub(super) struct Entry {
    pub reference: u32,
    pub parent: u32,
    pub slot: u32,
}

/// How a walk ended.
pub(super) enum Outcome {
    Done,
    TooMuch,
}

impl<'a> Scene<'a> {
    #[inline(always)]
    pub fn new(instance: &'a Instance, apex: Vec3) -> Self {
        let solid = &*instance.solid;
        let apex = instance.object_from_scene.map_or(apex, |place| place.point(apex));
        let thick = thickness(apex, solid.bounds.reach());
        Self { solid, apex, low_origin: apex + thick, high_origin: apex - thick }
    }
}

impl Bundle {
    pub fn new() -> Self {
        Self {
            directions: [[0.0; CLUSTER]; 3],
            rays: 0,
            groups: 0,
            alive: [0; 8],
            awake: 0,
            members: [0; CLUSTER],
            spans: [[0.0; 8]; 6],
            bounds: Aabb::EMPTY,
            intervals: GroupIntervals::default(),
            intervals_known: false,
            stack: Vec::with_capacity(128),
        }
    }

    /// Becomes the rays from an apex to those points of a cluster that are `alive`, in the space of an
    /// instance.
    #[inline(always)]
    pub fn aim<I: Isa>(&mut self, isa: I, instance: &Instance, task: &Task, alive: [u16; 8]) {
        let Task { apex, targets, cluster } = *task;
        self.rays = cluster.count;
        self.groups = cluster.count.div_ceil(GROUP);
        self.alive = alive;
        self.count_awake();
        self.intervals_known = false;
        let proof = isa.wide();
        let from = V3::<I::Wide>::splat(proof, apex);
        let [xs, ys, zs] = targets.arranged.each_ref().map(|axis| &axis[cluster.start..]);
        for at in (0..self.groups * GROUP).step_by(I::Wide::COUNT) {
            let target = V3::load(proof, [&xs[at..], &ys[at..], &zs[at..]]);
            let mut direction = target.sub(from);
            if let Some(place) = &instance.object_from_scene {
                direction = combine(proof, &place.linear, direction);
            }
            self.store(at, direction);
        }
        if instance.object_from_scene.is_none() {
            let proof = isa.eight();
            for face in 0..6 {
                let from = I::Eight::splat(proof, apex[face % 3]);
                (I::Eight::load(proof, &cluster.groups[face]) - from).store(&mut self.spans[face]);
            }
            if self.awake.count_ones() as usize == self.groups {
                self.bounds = Aabb { min: cluster.bounds.min - apex, max: cluster.bounds.max - apex };
            } else {
                self.bound();
            }
        } else {
            self.measure();
            self.bound();
        }
    }

    #[inline(always)]
    fn store<F: Lanes>(&mut self, at: usize, direction: V3<F>) {
        let [xs, ys, zs] = &mut self.directions;
        direction.x.store(&mut xs[at..]);
        direction.y.store(&mut ys[at..]);
        direction.z.store(&mut zs[at..]);
    }

    /// Finds the bounds of the groups.
    fn measure(&mut self) {
        for axis in 0..3 {
            for group in 0..self.groups {
                let members = &self.directions[axis][group * GROUP..][..GROUP];
                self.spans[axis][group] = members.iter().copied().fold(f32::INFINITY, f32::min);
                self.spans[3 + axis][group] = members.iter().copied().fold(f32::NEG_INFINITY, f32::max);
            }
        }
    }

    #[inline(always)]
    fn count_awake(&mut self) {
        self.awake = (0..8).fold(0, |awake, group| awake | u32::from(self.alive[group] != 0) << group);
    }

    pub fn count_alive(&self) -> u32 {
        self.alive.iter().map(|group| group.count_ones()).sum()
    }

    /// Finds the bounds of the directions of all groups awake.
    #[inline(always)]
    fn bound(&mut self) {
        self.bounds = self.bounds_of(self.awake);
    }

    /// Bounds of the directions of some groups.
    #[inline(always)]
    fn bounds_of(&self, groups: u32) -> Aabb {
        let mut bounds = Aabb::EMPTY;
        let mut rest = groups;
        while rest != 0 {
            let group = rest.trailing_zeros() as usize & 7;
            rest &= rest - 1;
            for axis in 0..3 {
                bounds.min[axis] = min(self.spans[axis][group], bounds.min[axis]);
                bounds.max[axis] = max(self.spans[axis + 3][group], bounds.max[axis]);
            }
        }
        bounds
    }

    /// Visits what is on the stack, until nothing is left of it or of the rays, or it takes too long.
    #[inline(always)]
    pub fn advance<I: Isa>(&mut self, isa: I, scene: &Scene, occluder: &mut Option<u32>) -> Outcome {
        let mut interval = Interval::new(&self.bounds, scene.low_origin, scene.high_origin);
        let mut width = self.awake.count_ones();
        let mut leaves = 0;
        while let Some(entry) = self.stack.pop() {
            if entry.reference & LEAF == 0 {
                let node = &scene.solid.nodes[entry.reference as usize];
                let mut hits = interval.meets::<I::Eight>(isa.eight(), node);
                while hits != 0 {
                    let slot = 31 - hits.leading_zeros();
                    hits &= !(1 << slot);
                    let reference = node.children[slot as usize];
                    self.stack.push(Entry { reference, parent: entry.reference, slot });
                }
                continue;
            }
            let parent = &scene.solid.nodes[entry.parent as usize];
            let groups = self.groups_in_reach(isa, scene, parent, entry.slot as usize);
            if groups == 0 {
                continue;
            }
            let leaf = entry.reference & !LEAF;
            if self.meet_block(isa, scene, &scene.solid.blocks[leaf as usize], groups) {
                *occluder = Some(leaf);
                if self.awake == 0 {
                    return Outcome::Done;
                }
                if self.awake.count_ones() * 2 <= width {
                    self.bound();
                    interval = Interval::new(&self.bounds, scene.low_origin, scene.high_origin);
                    width = self.awake.count_ones();
                }
            }
            leaves += 1;
            if leaves > LEAVES_MAX {
                return Outcome::TooMuch;
            }
        }
        Outcome::Done
    }

    /// Which groups awake may touch a child's box.
    #[inline(always)]
    fn groups_in_reach<I: Isa>(&mut self, isa: I, scene: &Scene, parent: &Node, slot: usize) -> u32 {
        if !self.intervals_known {
            self.intervals.set::<I::Eight>(isa.eight(), &self.spans);
            self.intervals_known = true;
        }
        let low = Vec3::new(parent.faces[0][slot], parent.faces[1][slot], parent.faces[2][slot]) - scene.low_origin;
        let high = Vec3::new(parent.faces[3][slot], parent.faces[4][slot], parent.faces[5][slot]) - scene.high_origin;
        self.intervals.meet::<I::Eight>(isa.eight(), low, high) & self.awake
    }

    /// Tests eight triangles against the rays of some groups; whether that occluded any.
    #[inline(always)]
    pub fn meet_block<I: Isa>(&mut self, isa: I, scene: &Scene, block: &Block, groups: u32) -> bool {
        let seen = block.seen_from::<I::Eight>(isa.eight(), scene.apex);
        let before = self.alive;
        if groups.count_ones() > FEW_GROUPS {
            let candidates = seen.candidates(isa.eight(), self.bounds.min, self.bounds.max);
            if candidates != 0 {
                self.meet_candidates(isa, scene, block, &seen.to_arrays(), candidates, groups);
            }
            return before != self.alive;
        }
        let mut rest = groups;
        while rest != 0 {
            let group = rest.trailing_zeros() as usize & 7;
            rest &= rest - 1;
            let corner = |first: usize| {
                Vec3::new(self.spans[first][group], self.spans[first + 1][group], self.spans[first + 2][group])
            };
            let candidates = seen.candidates(isa.eight(), corner(0), corner(3));
            if candidates != 0 {
                self.meet_candidates(isa, scene, block, &seen.to_arrays(), candidates, 1 << group);
            }
        }
        before != self.alive
    }

    /// Tests some triangles of a block against the rays of some groups.
    #[inline(always)]
    fn meet_candidates<I: Isa>(
        &mut self,
        isa: I,
        scene: &Scene,
        block: &Block,
        each: &[[f32; 8]; 13],
        mut candidates: u32,
        groups: u32,
    ) {
        while candidates != 0 {
            let lane = candidates.trailing_zeros() as usize & 7;
            candidates &= candidates - 1;
            let triangle = Seen::<I::Wide>::broadcast(isa.wide(), each, lane);
            let mut groups = groups & self.awake;
            if groups == 0 {
                return;
            }
            while groups != 0 {
                let group = groups.trailing_zeros() as usize & 7;
                groups &= groups - 1;
                let occluded = self.meet_triangle(isa, scene, block, lane, &triangle, group);
                self.alive[group] &= !occluded;
                self.awake &= !(u32::from(self.alive[group] == 0) << group);
            }
        }
    }

    /// Which rays of a group a triangle occludes.
    #[inline(always)]
    fn meet_triangle<I: Isa>(
        &self,
        isa: I,
        scene: &Scene,
        block: &Block,
        lane: usize,
        triangle: &Seen<I::Wide>,
        group: usize,
    ) -> u16 {
        let proof = isa.wide();
        let (zero, one) = (I::Wide::splat(proof, 0.0), I::Wide::splat(proof, 1.0));
        let [xs, ys, zs] = &self.directions;
        let mut occluded = 0;
        for part in 0..GROUP / I::Wide::COUNT {
            let at = group * GROUP + part * I::Wide::COUNT;
            let alive = u32::from(self.alive[group]) >> (part * I::Wide::COUNT);
            let direction = V3::load(proof, [&xs[at..], &ys[at..], &zs[at..]]);
            let edges = triangle.edges_along(direction);
            if I::Wide::bits(same_side(zero, edges)) & alive == 0 {
                continue;
            }
            let slope = triangle.normal.dot(direction);
            let mut hits = I::Wide::bits(same_side(zero, edges) & triangle.in_range(zero, slope, one)) & alive;
            if hits == 0 {
                continue;
            }
            let bounds = bounds_of(block.corners(lane));
            let (low, high) = (bounds.min - scene.low_origin, bounds.max - scene.high_origin);
            hits &= meets_lanes(proof, low, high, direction);
            if scene.solid.has_holes() {
                let mut values = [[0.0; GROUP]; 3];
                edges[0].store(&mut values[0]);
                edges[1].store(&mut values[1]);
                edges[2].store(&mut values[2]);
                hits = keep_present(scene.solid, block.ids[lane], &values, hits);
            }
            occluded |= hits << (part * I::Wide::COUNT);
        }
        occluded as u16
    }

    /// Moves about half of the rays that are alive to another bundle, which has all still to do.
    pub fn split_into(&mut self, other: &mut Self) {
        let mut rays: Vec<usize> = self.rays_alive().collect();
        let axis = longest_axis(&Aabb::of(rays.iter().map(|&ray| self.direction(ray))));
        let (along, middle) = (&self.directions[axis], rays.len() / 2);
        rays.select_nth_unstable_by(middle, |&a, &b| along[a].total_cmp(&along[b]).then(a.cmp(&b)));
        let (low, high) = rays.split_at_mut(middle);
        other.directions = self.directions;
        other.members = self.members;
        other.stack.clone_from(&self.stack);
        other.keep(high);
        self.keep(low);
    }

    /// Keeps these rays only.
    fn keep(&mut self, rays: &mut [usize]) {
        rays.sort_unstable();
        self.groups = rays.len().div_ceil(GROUP);
        self.alive = [0; 8];
        for place in 0..self.groups * GROUP {
            // In ascending order nothing is overwritten before it is read. Padding repeats the last.
            let ray = rays[place.min(rays.len() - 1)];
            for axis in &mut self.directions {
                axis[place] = axis[ray];
            }
            if place < rays.len() {
                self.members[place] = self.members[ray];
                self.alive[place / GROUP] |= 1 << (place % GROUP);
            }
        }
        self.rays = rays.len();
        self.measure();
        self.count_awake();
        self.bound();
        self.intervals_known = false;
    }

    /// Clears the bits of those rays of the cluster that have been occluded in this bundle.
    pub fn report(&self, alive: &mut [u16; 8]) {
        for ray in (0..self.rays).filter(|&ray| !self.is_alive(ray)) {
            let member = usize::from(self.members[ray]);
            alive[member / GROUP] &= !(1 << (member % GROUP));
        }
    }

    /// Finishes what is on the stack one ray at a time.
    #[inline(always)]
    pub fn finish_singly<I: Isa>(&mut self, isa: I, scene: &Scene) {
        let reach = scene.solid.bounds.reach();
        for ray in 0..self.rays {
            if !self.is_alive(ray) {
                continue;
            }
            let probe = Probe::new(scene.apex, self.direction(ray), 1.0, reach);
            for entry in self.stack.iter().rev() {
                if probe.any_from::<I::Eight>(isa.eight(), scene.solid, entry.reference).is_some() {
                    self.alive[ray / GROUP] &= !(1 << (ray % GROUP));
                    break;
                }
            }
        }
        self.stack.clear();
        self.count_awake();
    }

    fn rays_alive(&self) -> impl Iterator<Item = usize> + '_ {
        (0..self.rays).filter(|&ray| self.is_alive(ray))
    }

    fn direction(&self, ray: usize) -> Vec3 {
        let [x, y, z] = &self.directions;
        Vec3::new(x[ray], y[ray], z[ray])
    }

    fn is_alive(&self, ray: usize) -> bool {
        self.alive[ray / GROUP] >> (ray % GROUP) & 1 != 0
    }
}

/// A linear map, in the order of operations of [`scenes::Transform::vector`].
#[inline(always)]
fn combine<F: Lanes>(proof: F::Proof, map: &Mat3, v: V3<F>) -> V3<F> {
    let a = V3::<F>::splat(proof, map.x_axis);
    let b = V3::<F>::splat(proof, map.y_axis);
    let c = V3::<F>::splat(proof, map.z_axis);
    V3 {
        x: a.x * v.x + b.x * v.y + c.x * v.z,
        y: a.y * v.x + b.y * v.y + c.y * v.z,
        z: a.z * v.x + b.z * v.y + c.z * v.z,
    }
}

/// Leaves out those hits that fall into holes.
#[cold]
fn keep_present(solid: &Solid, triangle: u32, edges: &[[f32; GROUP]; 3], hits: u32) -> u32 {
    (0..GROUP).filter(|lane| hits >> lane & 1 != 0).fold(0, |present, lane| {
        let [u, v] = barycentric(edges.map(|edge| edge[lane]));
        present | u32::from(solid.is_present(triangle, u, v)) << lane
    })
}
