//! Which points of a tile see a light so far away that its rays are parallel: all shadow rays of one direction from a
//! cluster of points walk the tree together.
//!
//! # How
//! Rays of one direction differ only in the two origins by which they meet boxes ([`Slabs`]). The outermost origins of
//! some rays make one *thick ray*: every operation of the test is monotone, so it can never refuse a box that one of
//! them would accept. The rays of a cluster are one thick ray, each group of sixteen is another. A walk tests boxes
//! against the first, then against the eight groups at once, then ray by ray, sixteen at once, as that of a shaft does
//! ([`super::shaft`]); a triangle is tested against sixteen rays by the operations of single rays ([`super::ray`]). So
//! results are the same to the bit.

use glam::Vec3;

use super::bounds::Aabb;
use super::bundle::{Entry, Reach, combine};
use super::lanes::{Isa, Lanes};
use super::ray::{Faces, Probe, Visit, barycentric, walk};
use super::shaft::{ShaftScratch, asked, report};
use super::slabs::{Slabs, WIDENING};
use super::solid::{Place, Solid};
use super::targets::{CLUSTER, Cluster, GROUP, Targets};
use super::tree::LEAF;
use super::triangle::{Block, NONE, Seen, bounds_of};
use super::vector::V3;
use super::world::{Instance, World};

/// So few rays go on singly.
const SINGLE_MAX: u32 = 6;
/// So few rays meet eight triangles at once, ray by ray; more, sixteen at once, triangle by triangle.
const FEW_RAYS: u32 = 8;

/// Rays of one direction, and what they have not met so far.
pub(super) struct Parallel {
    origins: [[f32; CLUSTER]; 3],
    /// [`Slabs::low_origin`] and [`Slabs::high_origin`] of each ray …
    rays: Origins<CLUSTER>,
    /// … and the outermost of each group.
    groups: Origins<8>,
    /// Groups in use.
    count: usize,
    /// Rays not occluded so far: bit i of entry g is ray 16 g + i.
    alive: [u16; 8],
    /// Bit g is set where `alive[g]` is not zero.
    awake: u32,
}

/// By axis, what is subtracted from the least and the greatest corner of a box.
struct Origins<const N: usize> {
    low: [[f32; N]; 3],
    high: [[f32; N]; 3],
}

/// What all rays share, in the space of a solid.
struct Beam<'a> {
    solid: &'a Solid,
    object: u32,
    direction: Vec3,
    inverse: Vec3,
}

/// [`World::shade_along`].
#[inline(always)]
pub(super) fn shade<I: Isa>(
    isa: I,
    world: &World,
    direction: Vec3,
    targets: &Targets,
    wanted: &[u64],
    scratch: &mut ShaftScratch,
    visible: &mut [u64],
) {
    let ShaftScratch { parallel, stack, open, .. } = scratch;
    for cluster in &targets.clusters {
        let mut alive = asked(targets, cluster, Some(wanted));
        if alive == [0; 8] {
            continue;
        }
        instances_in_reach(isa, world, direction, &cluster.bounds, open);
        while let Some((_, number)) = open.pop() {
            let instance = &world.instances()[number as usize];
            parallel.aim(isa, instance, targets, cluster, alive);
            parallel.occlude(isa, &Beam::new(instance, direction), stack);
            alive = parallel.alive;
            if alive == [0; 8] {
                break;
            }
        }
        report(targets, cluster, alive, visible);
    }
}

/// Instances whose boxes some ray from a box may meet.
#[inline(always)]
fn instances_in_reach<I: Isa>(isa: I, world: &World, direction: Vec3, from: &Aabb, found: &mut Vec<(f32, u32)>) {
    found.clear();
    if world.is_flat() {
        found.push((0.0, 0));
        return;
    }
    // Not less than that of any ray: rounding is monotone.
    let thick = Vec3::splat(WIDENING * from.reach().max(world.bounds().reach()));
    let (low_origin, high_origin) = (from.max + thick, from.min - thick);
    let slabs = Slabs { low_origin, high_origin, inverse: (direction + Vec3::ZERO).recip(), t_max: f32::INFINITY };
    let _ = walk::<I::Eight, _>(isa.eight(), world.top(), &slabs, f32::INFINITY, &mut Collect { found });
}

/// Notes all leaves.
struct Collect<'a> {
    found: &'a mut Vec<(f32, u32)>,
}

impl<F: Lanes> Visit<F> for &mut Collect<'_> {
    type Break = ();
    const SORTED: bool = false;

    #[inline(always)]
    fn leaf(&mut self, _: F::Proof, leaf: u32, _: &mut f32) -> std::ops::ControlFlow<()> {
        self.found.push((0.0, leaf));
        std::ops::ControlFlow::Continue(())
    }
}

impl<const N: usize> Origins<N> {
    const ZERO: Self = Self { low: [[0.0; N]; 3], high: [[0.0; N]; 3] };

    /// [`Slabs::meets`] for as many rays from `at` on as there are lanes.
    #[inline(always)]
    fn meet<F: Lanes>(&self, proof: F::Proof, at: usize, bounds: &Aabb, inverse: Vec3) -> u32 {
        let (mut near, mut far) = (F::splat(proof, 0.0), F::splat(proof, f32::INFINITY));
        for axis in 0..3 {
            let factor = F::splat(proof, inverse[axis]);
            let low = (F::splat(proof, bounds.min[axis]) - F::load(proof, &self.low[axis][at..])) * factor;
            let high = (F::splat(proof, bounds.max[axis]) - F::load(proof, &self.high[axis][at..])) * factor;
            let (enter, leave) = if inverse[axis] >= 0.0 { (low, high) } else { (high, low) };
            near = enter.max(near);
            far = leave.min(far);
        }
        F::bits(near.le(far))
    }

    fn corner(of: &[[f32; N]; 3], at: usize) -> Vec3 {
        Vec3::new(of[0][at], of[1][at], of[2][at])
    }
}

impl<'a> Beam<'a> {
    fn new(instance: &'a Instance, direction: Vec3) -> Self {
        let direction = instance.object_from_scene.map_or(direction, |place| place.vector(direction));
        let inverse = (direction + Vec3::ZERO).recip();
        Self { solid: &instance.solid, object: instance.object, direction, inverse }
    }
}

impl Parallel {
    pub fn new() -> Self {
        Self {
            origins: [[0.0; CLUSTER]; 3],
            rays: Origins::ZERO,
            groups: Origins::ZERO,
            count: 0,
            alive: [0; 8],
            awake: 0,
        }
    }

    /// Becomes the rays from those points of a cluster that are `alive`, in the space of an instance.
    #[inline(always)]
    fn aim<I: Isa>(&mut self, isa: I, instance: &Instance, targets: &Targets, cluster: &Cluster, alive: [u16; 8]) {
        self.count = cluster.count.div_ceil(GROUP);
        self.alive = alive;
        self.awake = (0..8).fold(0, |awake, group| awake | u32::from(alive[group] != 0) << group);
        let proof = isa.wide();
        let reach = I::Wide::splat(proof, instance.solid.bounds.reach());
        let widening = I::Wide::splat(proof, WIDENING);
        let [xs, ys, zs] = targets.arranged.each_ref().map(|axis| &axis[cluster.start..]);
        for at in (0..self.count * GROUP).step_by(I::Wide::COUNT) {
            let mut origin = V3::<I::Wide>::load(proof, [&xs[at..], &ys[at..], &zs[at..]]);
            if let Some(place) = &instance.object_from_scene {
                origin = combine(proof, &place.linear, origin).add(V3::splat(proof, place.translation));
            }
            let thick = widening * origin.x.abs().max(origin.y.abs()).max(origin.z.abs()).max(reach);
            for (axis, origin) in origin.to_array().into_iter().enumerate() {
                origin.store(&mut self.origins[axis][at..]);
                (origin + thick).store(&mut self.rays.low[axis][at..]);
                (origin - thick).store(&mut self.rays.high[axis][at..]);
            }
        }
        for axis in 0..3 {
            for group in 0..self.count {
                let members = group * GROUP..(group + 1) * GROUP;
                let (low, high) = (&self.rays.low[axis][members.clone()], &self.rays.high[axis][members]);
                self.groups.low[axis][group] = low.iter().copied().fold(f32::NEG_INFINITY, f32::max);
                self.groups.high[axis][group] = high.iter().copied().fold(f32::INFINITY, f32::min);
            }
        }
    }

    /// All groups awake as one thick ray.
    fn slabs(&self, beam: &Beam) -> Slabs {
        let (mut low_origin, mut high_origin) = (Vec3::NEG_INFINITY, Vec3::INFINITY);
        for group in (0..self.count).filter(|group| self.awake >> group & 1 != 0) {
            low_origin = low_origin.max(Origins::corner(&self.groups.low, group));
            high_origin = high_origin.min(Origins::corner(&self.groups.high, group));
        }
        Slabs { low_origin, high_origin, inverse: beam.inverse, t_max: f32::INFINITY }
    }

    /// Walks the tree until nothing is left of it or of the rays.
    #[inline(always)]
    fn occlude<I: Isa>(&mut self, isa: I, beam: &Beam, stack: &mut Vec<Entry>) {
        if self.awake == 0 || beam.solid.nodes.is_empty() {
            return;
        }
        stack.clear();
        stack.push(Entry::ROOT);
        let mut faces = Faces::<I::Eight>::new(isa.eight(), &self.slabs(beam));
        let mut width = self.awake.count_ones();
        while let Some(entry) = stack.pop() {
            let reach = self.rays_in_reach(isa, beam, &entry);
            if reach.groups == 0 {
                continue;
            }
            if entry.reference & LEAF == 0 {
                if reach.count > SINGLE_MAX {
                    let node = &beam.solid.nodes[entry.reference as usize];
                    let (mut hits, _) = faces.meet(isa.eight(), node, f32::INFINITY);
                    while hits != 0 {
                        let slot = 31 - hits.leading_zeros();
                        hits &= !(1 << slot);
                        let reference = node.children[slot as usize];
                        stack.push(Entry { reference, parent: entry.reference, slot, near: 0.0 });
                    }
                    continue;
                }
                for ray in reach.each() {
                    let probe = self.probe(beam, ray);
                    if probe.any_from::<I::Eight>(isa.eight(), beam.solid, entry.reference).is_some() {
                        self.end(ray);
                    }
                }
            } else {
                self.meet_block(isa, beam, &beam.solid.blocks[(entry.reference & !LEAF) as usize], &reach);
            }
            if self.awake == 0 {
                return;
            }
            if self.awake.count_ones() * 2 <= width {
                faces = Faces::new(isa.eight(), &self.slabs(beam));
                width = self.awake.count_ones();
            }
        }
    }

    /// Which rays alive meet the box of an entry: first by groups, then one by one.
    #[inline(always)]
    fn rays_in_reach<I: Isa>(&self, isa: I, beam: &Beam, entry: &Entry) -> Reach {
        if entry.reference == Entry::ROOT.reference {
            // Its box is the solid's own.
            return Reach { groups: self.awake, count: CLUSTER as u32, rays: self.alive };
        }
        let faces = &beam.solid.nodes[entry.parent as usize].faces;
        let face = |face: usize| faces[face][entry.slot as usize & 7];
        let bounds = Aabb { min: Vec3::new(face(0), face(1), face(2)), max: Vec3::new(face(3), face(4), face(5)) };
        let mut groups = self.groups.meet::<I::Eight>(isa.eight(), 0, &bounds, beam.inverse) & self.awake;
        let mut reach = Reach { groups: 0, count: 0, rays: [0; 8] };
        while groups != 0 {
            let group = groups.trailing_zeros() as usize & 7;
            groups &= groups - 1;
            let rays = self.meet_box(isa, group, &bounds, beam.inverse) & self.alive[group];
            reach.rays[group] = rays;
            reach.groups |= u32::from(rays != 0) << group;
            reach.count += rays.count_ones();
        }
        reach
    }

    /// Which rays of a group meet a box.
    #[inline(always)]
    fn meet_box<I: Isa>(&self, isa: I, group: usize, bounds: &Aabb, inverse: Vec3) -> u16 {
        let mut met = 0;
        for part in 0..GROUP / I::Wide::COUNT {
            let at = group * GROUP + part * I::Wide::COUNT;
            met |= self.rays.meet::<I::Wide>(isa.wide(), at, bounds, inverse) << (part * I::Wide::COUNT);
        }
        met as u16
    }

    /// Tests eight triangles against rays.
    #[inline(always)]
    fn meet_block<I: Isa>(&mut self, isa: I, beam: &Beam, block: &Block, reach: &Reach) {
        let proof = isa.eight();
        if reach.count <= FEW_RAYS {
            for ray in reach.each() {
                let probe = self.probe(beam, ray);
                let seen = block.seen_from::<I::Eight>(proof, probe.origin);
                if probe.closest_in::<I::Eight>(proof, &seen, block, beam.solid, f32::INFINITY).is_some() {
                    self.end(ray);
                }
            }
            return;
        }
        for lane in (0..8).filter(|lane| block.ids[*lane] != NONE) {
            let bounds = bounds_of(block.corners(lane));
            let mut groups = self.groups.meet::<I::Eight>(proof, 0, &bounds, beam.inverse) & reach.groups & self.awake;
            while groups != 0 {
                let group = groups.trailing_zeros() as usize & 7;
                groups &= groups - 1;
                let occluded = self.meet_triangle(isa, beam, block, lane, &bounds, group);
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
        beam: &Beam,
        block: &Block,
        lane: usize,
        bounds: &Aabb,
        group: usize,
    ) -> u16 {
        let proof = isa.wide();
        let [p, q, r] = block.corners(lane);
        let corners = [V3::<I::Wide>::splat(proof, p), V3::splat(proof, q), V3::splat(proof, r)];
        let direction = V3::splat(proof, beam.direction);
        let (zero, infinity) = (I::Wide::splat(proof, 0.0), I::Wide::splat(proof, f32::INFINITY));
        let [xs, ys, zs] = &self.origins;
        let mut occluded = 0;
        for part in 0..GROUP / I::Wide::COUNT {
            let at = group * GROUP + part * I::Wide::COUNT;
            let alive = u32::from(self.alive[group]) >> (part * I::Wide::COUNT);
            let seen = Seen::new(corners, V3::load(proof, [&xs[at..], &ys[at..], &zs[at..]]));
            let meeting = seen.meets(zero, direction, infinity);
            let mut hits = I::Wide::bits(meeting.mask) & alive;
            if hits != 0 {
                hits &= self.rays.meet::<I::Wide>(proof, at, bounds, beam.inverse);
            }
            if hits != 0 && beam.solid.has_gaps() {
                let mut values = [[0.0; GROUP]; 3];
                for (edge, values) in meeting.edges.into_iter().zip(&mut values) {
                    edge.store(values);
                }
                hits = self.keep_present(beam, block.ids[lane], at, &values, hits);
            }
            occluded |= hits << (part * I::Wide::COUNT);
        }
        occluded as u16
    }

    /// Leaves out those hits that meet nothing.
    #[cold]
    fn keep_present(&self, beam: &Beam, triangle: u32, at: usize, edges: &[[f32; GROUP]; 3], hits: u32) -> u32 {
        (0..GROUP).filter(|lane| hits >> lane & 1 != 0).fold(0, |present, lane| {
            let (origin, uv) = (Origins::corner(&self.origins, at + lane), barycentric(edges.map(|edge| edge[lane])));
            let place = Place { object: beam.object, triangle, origin, direction: beam.direction, uv };
            present | u32::from(beam.solid.is_present(&place)) << lane
        })
    }

    /// A ray is occluded.
    #[inline(always)]
    fn end(&mut self, ray: usize) {
        let group = ray / GROUP;
        self.alive[group] &= !(1 << (ray % GROUP));
        self.awake &= !(u32::from(self.alive[group] == 0) << group);
    }

    /// A ray by itself.
    #[inline(always)]
    fn probe(&self, beam: &Beam, ray: usize) -> Probe {
        let slabs = Slabs {
            low_origin: Origins::corner(&self.rays.low, ray),
            high_origin: Origins::corner(&self.rays.high, ray),
            inverse: beam.inverse,
            t_max: f32::INFINITY,
        };
        let origin = Origins::corner(&self.origins, ray);
        Probe { origin, direction: beam.direction, slabs, object: beam.object }
    }
}
