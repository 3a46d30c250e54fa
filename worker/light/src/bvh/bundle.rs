//! A bundle of rays from one apex, and which of them meet a box: what shadow rays ([`super::occlusion`])
//! and primary rays ([`super::packet`]) share.
//!
//! Rays are kept in groups of sixteen. All together, and each group, are intervals of directions; what
//! these cannot discard is tested ray by ray, in vectors.

use glam::{Mat3, Vec3};

use super::bounds::Aabb;
use super::interval::{GroupIntervals, Interval};
use super::lanes::{Isa, Lanes, max, min};
use super::shaft::Task;
use super::slabs::{Slabs, meets_lanes, thickness};
use super::solid::{Place, Solid};
use super::targets::{CLUSTER, GROUP};
use super::tree::LEAF;
use super::triangle::NONE;
use super::vector::V3;
use super::world::{Instance, World};

/// What all bundles from an apex towards a solid share, in object space.
pub(super) struct Scene<'a> {
    pub solid: &'a Solid,
    /// Whose solid it is.
    pub object: u32,
    pub apex: Vec3,
    pub low_origin: Vec3,
    pub high_origin: Vec3,
}

/// Rays from one apex, and what they still have to visit.
pub(super) struct Bundle {
    /// From the apex to the targets, by axis.
    pub directions: [[f32; CLUSTER]; 3],
    /// Reciprocals of the directions, for those groups whose bit is set in `inverses_known`.
    inverses: [[f32; CLUSTER]; 3],
    inverses_known: u32,
    /// Groups in use.
    groups: usize,
    /// Rays not occluded so far: bit i of entry g is ray 16 g + i.
    pub alive: [u16; 8],
    /// Bit g is set where `alive[g]` is not zero.
    pub awake: u32,
    /// Bounds of the directions of each group, as in [`super::tree::Node::faces`].
    pub spans: [[f32; 8]; 6],
    /// Bounds of the directions of all groups that were awake when it was last asked.
    pub bounds: Aabb,
    /// The groups as intervals; made when first asked for.
    intervals: GroupIntervals,
    intervals_known: bool,
}

/// A reference to visit, and in which slot of which node it stands.
#[derive(Clone, Copy)]
pub(super) struct Entry {
    pub reference: u32,
    pub parent: u32,
    pub slot: u32,
    /// Before this t no ray meets its box.
    pub near: f32,
}

/// Where rays end, if not at t = 1: by ray, and the farthest of each group.
pub(super) struct Ends {
    pub rays: [f32; CLUSTER],
    pub groups: [f32; 8],
}

/// The rays that meet a box.
pub(super) struct Reach {
    /// Bit g is set where `rays[g]` is not zero.
    pub groups: u32,
    /// How many in all.
    pub count: u32,
    /// By group.
    pub rays: [u16; 8],
}

impl Reach {
    /// Their numbers.
    #[inline(always)]
    pub fn each(&self) -> Each {
        let group = self.groups.trailing_zeros() as usize & 7;
        Each { groups: self.groups, rays: self.rays, group }
    }
}

/// The numbers of the rays of a [`Reach`].
pub(super) struct Each {
    groups: u32,
    rays: [u16; 8],
    group: usize,
}

impl Iterator for Each {
    type Item = usize;

    #[inline(always)]
    fn next(&mut self) -> Option<usize> {
        while self.groups != 0 {
            let rays = &mut self.rays[self.group];
            if *rays != 0 {
                let lane = rays.trailing_zeros() as usize & 15;
                *rays &= *rays - 1;
                return Some(self.group * GROUP + lane);
            }
            self.groups &= self.groups - 1;
            self.group = self.groups.trailing_zeros() as usize & 7;
        }
        None
    }
}

impl<'a> Scene<'a> {
    #[inline(always)]
    pub fn new(instance: &'a Instance, apex: Vec3) -> Self {
        let solid = &*instance.solid;
        let apex = instance.object_from_scene.map_or(apex, |place| place.point(apex));
        let thick = thickness(apex, solid.bounds.reach());
        Self { solid, object: instance.object, apex, low_origin: apex + thick, high_origin: apex - thick }
    }

    /// Where a ray meets a triangle.
    pub fn place(&self, direction: Vec3, triangle: u32, uv: [f32; 2]) -> Place {
        Place { object: self.object, triangle, origin: self.apex, direction, uv }
    }
}

impl Entry {
    /// Where every walk starts.
    pub const ROOT: Self = Self { reference: 0, parent: 0, slot: 0, near: 0.0 };
}

impl Bundle {
    pub fn new() -> Self {
        Self {
            directions: [[0.0; CLUSTER]; 3],
            inverses: [[0.0; CLUSTER]; 3],
            inverses_known: 0,
            groups: 0,
            alive: [0; 8],
            awake: 0,
            spans: [[0.0; 8]; 6],
            bounds: Aabb::EMPTY,
            intervals: GroupIntervals::default(),
            intervals_known: false,
        }
    }

    /// Becomes the rays from an apex to those points of a cluster that are `alive`, in the space of an
    /// instance.
    #[inline(always)]
    pub fn aim<I: Isa>(&mut self, isa: I, instance: &Instance, task: &Task, alive: [u16; 8]) {
        let Task { apex, targets, cluster } = *task;
        self.start(cluster.count, alive);
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

    /// Becomes rays in these directions, padded to whole groups, in the space of an instance.
    #[inline(always)]
    pub fn aim_along<I: Isa>(
        &mut self,
        isa: I,
        instance: &Instance,
        directions: &[[f32; CLUSTER]; 3],
        alive: [u16; 8],
        count: usize,
    ) {
        self.start(count, alive);
        let proof = isa.wide();
        let [xs, ys, zs] = directions;
        for at in (0..self.groups * GROUP).step_by(I::Wide::COUNT) {
            let mut direction = V3::<I::Wide>::load(proof, [&xs[at..], &ys[at..], &zs[at..]]);
            if let Some(place) = &instance.object_from_scene {
                direction = combine(proof, &place.linear, direction);
            }
            self.store(at, direction);
        }
        self.measure();
        self.bound();
    }

    #[inline(always)]
    fn start(&mut self, count: usize, alive: [u16; 8]) {
        self.groups = count.div_ceil(GROUP);
        self.alive = alive;
        self.awake = (0..8).fold(0, |awake, group| awake | u32::from(alive[group] != 0) << group);
        self.intervals_known = false;
        self.inverses_known = 0;
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

    /// As if all rays alive met a box.
    pub fn all_alive(&self) -> Reach {
        Reach { groups: self.awake, count: CLUSTER as u32, rays: self.alive }
    }

    /// Finds the bounds of the directions of all groups awake.
    #[inline(always)]
    pub fn bound(&mut self) {
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

    /// Which rays alive meet the box of an entry: first by groups, then one by one.
    #[inline(always)]
    pub fn rays_in_reach<I: Isa>(&mut self, isa: I, scene: &Scene, entry: &Entry, ends: Option<&Ends>) -> Reach {
        if entry.reference == Entry::ROOT.reference {
            // Its box is the solid's own.
            return self.all_alive();
        }
        if !self.intervals_known {
            self.intervals.set::<I::Eight>(isa.eight(), &self.spans);
            self.intervals_known = true;
        }
        let faces = &scene.solid.nodes[entry.parent as usize].faces;
        let face = |face: usize| faces[face][entry.slot as usize & 7];
        let low = Vec3::new(face(0), face(1), face(2)) - scene.low_origin;
        let high = Vec3::new(face(3), face(4), face(5)) - scene.high_origin;
        let proof = isa.eight();
        let far = ends.map_or(I::Eight::splat(proof, 1.0), |ends| I::Eight::load(proof, &ends.groups));
        let mut groups = self.intervals.meet::<I::Eight>(proof, low, high, far) & self.awake;
        let mut reach = Reach { groups: 0, count: 0, rays: [0; 8] };
        while groups != 0 {
            let group = groups.trailing_zeros() as usize & 7;
            groups &= groups - 1;
            let rays = self.meet_box(isa, group, low, high, ends) & self.alive[group];
            reach.rays[group] = rays;
            reach.groups |= u32::from(rays != 0) << group;
            reach.count += rays.count_ones();
        }
        reach
    }

    /// Which rays of a group meet a box, given by its corners minus the origins of [`super::slabs::Slabs`].
    #[inline(always)]
    pub fn meet_box<I: Isa>(&mut self, isa: I, group: usize, low: Vec3, high: Vec3, ends: Option<&Ends>) -> u16 {
        let proof = isa.wide();
        let known = self.inverses_known >> group & 1 != 0;
        let mut met = 0;
        for part in 0..GROUP / I::Wide::COUNT {
            let at = group * GROUP + part * I::Wide::COUNT;
            if !known {
                let (zero, one) = (I::Wide::splat(proof, 0.0), I::Wide::splat(proof, 1.0));
                for axis in 0..3 {
                    let direction = I::Wide::load(proof, &self.directions[axis][at..]);
                    (one / (direction + zero)).store(&mut self.inverses[axis][at..]);
                }
            }
            let [xs, ys, zs] = &self.inverses;
            let inverse = V3::<I::Wide>::load(proof, [&xs[at..], &ys[at..], &zs[at..]]);
            let far = ends.map_or(I::Wide::splat(proof, 1.0), |ends| I::Wide::load(proof, &ends.rays[at..]));
            met |= meets_lanes(proof, low, high, inverse, far) << (part * I::Wide::COUNT);
        }
        self.inverses_known |= 1 << group;
        met as u16
    }

    /// One ray, ready to meet boxes; its group's reciprocals are known.
    #[inline(always)]
    pub fn slabs(&self, scene: &Scene, ray: usize, t_max: f32) -> Slabs {
        let [xs, ys, zs] = &self.inverses;
        let inverse = Vec3::new(xs[ray], ys[ray], zs[ray]);
        Slabs { low_origin: scene.low_origin, high_origin: scene.high_origin, inverse, t_max }
    }

    #[inline(always)]
    pub fn direction(&self, ray: usize) -> Vec3 {
        let [x, y, z] = &self.directions;
        Vec3::new(x[ray], y[ray], z[ray])
    }
}

/// Instances whose boxes some rays may meet, and before which t none does.
#[inline(always)]
pub(super) fn instances_in_reach<I: Isa>(
    isa: I,
    world: &World,
    apex: Vec3,
    directions: &Aabb,
    end: f32,
    found: &mut Vec<(f32, u32)>,
) {
    found.clear();
    if world.is_flat() {
        found.push((0.0, 0));
        return;
    }
    let thick = thickness(apex, world.bounds().reach());
    let interval = Interval::new(directions, apex + thick, apex - thick);
    let mut nodes = if world.top().is_empty() { vec![] } else { vec![0] };
    while let Some(node) = nodes.pop() {
        let node = &world.top()[node as usize];
        let (mut hits, near) = interval.meets::<I::Eight>(isa.eight(), node, end);
        let mut nears = [0.0; 8];
        near.store(&mut nears);
        while hits != 0 {
            let slot = hits.trailing_zeros() as usize & 7;
            hits &= hits - 1;
            match node.children[slot] {
                NONE => {}
                leaf if leaf & LEAF != 0 => found.push((nears[slot], leaf & !LEAF)),
                inner => nodes.push(inner),
            }
        }
    }
}

/// A linear map, in the order of operations of [`scenes::Transform::vector`].
#[inline(always)]
pub(super) fn combine<F: Lanes>(proof: F::Proof, map: &Mat3, v: V3<F>) -> V3<F> {
    let a = V3::<F>::splat(proof, map.x_axis);
    let b = V3::<F>::splat(proof, map.y_axis);
    let c = V3::<F>::splat(proof, map.z_axis);
    V3 {
        x: a.x * v.x + b.x * v.y + c.x * v.z,
        y: a.y * v.x + b.y * v.y + c.y * v.z,
        z: a.z * v.x + b.z * v.y + c.z * v.z,
    }
}
