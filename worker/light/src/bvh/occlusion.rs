//! Which rays of a bundle are occluded: the inner half of [`super::shaft`].

use glam::Vec3;

use super::bundle::{Bundle, Entry, Reach, Scene};
use super::interval::Interval;
use super::lanes::{Isa, Lanes};
use super::ray::{Probe, barycentric};
use super::targets::GROUP;
use super::tree::LEAF;
use super::triangle::{Block, Meeting, Seen, bounds_of, in_box, same_side};
use super::vector::V3;

/// So few rays go on singly.
const SINGLE_MAX: u32 = 6;
/// So few rays meet eight triangles at once, ray by ray; more, sixteen at once, triangle by triangle.
const FEW_RAYS: u32 = 12;
/// Up to so many groups, triangles are first tested against the bounds of each group, instead of all.
const FEW_GROUPS: u32 = 2;

impl Bundle {
    /// Walks the tree until nothing is left of it or of the rays; the last leaf that hid some.
    #[inline(always)]
    pub fn occlude<I: Isa>(&mut self, isa: I, scene: &Scene, stack: &mut Vec<Entry>) -> Option<u32> {
        let mut occluder = None;
        if self.awake == 0 {
            return None;
        }
        stack.clear();
        stack.push(Entry::ROOT);
        let mut interval = Interval::new(&self.bounds, scene.low_origin, scene.high_origin);
        let mut width = self.awake.count_ones();
        while let Some(entry) = stack.pop() {
            let reach = self.rays_in_reach(isa, scene, &entry, None);
            if reach.groups == 0 {
                continue;
            }
            if entry.reference & LEAF == 0 {
                if reach.count <= SINGLE_MAX {
                    self.walk_singly(isa, scene, entry.reference, &reach, &mut occluder);
                    if self.awake == 0 {
                        return occluder;
                    }
                    continue;
                }
                let node = &scene.solid.nodes[entry.reference as usize];
                let (mut hits, _) = interval.meets::<I::Eight>(isa.eight(), node, 1.0);
                while hits != 0 {
                    let slot = 31 - hits.leading_zeros();
                    hits &= !(1 << slot);
                    let reference = node.children[slot as usize];
                    stack.push(Entry { reference, parent: entry.reference, slot, near: 0.0 });
                }
                continue;
            }
            let leaf = entry.reference & !LEAF;
            if self.meet_block(isa, scene, &scene.solid.blocks[leaf as usize], &reach) {
                occluder = Some(leaf);
                if self.awake == 0 {
                    return occluder;
                }
                if self.awake.count_ones() * 2 <= width {
                    self.bound();
                    interval = Interval::new(&self.bounds, scene.low_origin, scene.high_origin);
                    width = self.awake.count_ones();
                }
            }
        }
        occluder
    }

    /// Tests eight triangles against rays; whether that occluded any.
    #[inline(always)]
    pub fn meet_block<I: Isa>(&mut self, isa: I, scene: &Scene, block: &Block, reach: &Reach) -> bool {
        let seen = block.seen_from::<I::Eight>(isa.eight(), scene.apex);
        let before = self.alive;
        if reach.count <= FEW_RAYS {
            self.meet_singly(isa, scene, block, &seen, reach);
        } else if reach.groups.count_ones() > FEW_GROUPS {
            let candidates = seen.candidates(isa.eight(), self.bounds.min, self.bounds.max, 1.0);
            if candidates != 0 {
                self.meet_candidates(isa, scene, block, &seen.to_arrays(), candidates, reach.groups);
            }
        } else {
            let mut rest = reach.groups;
            while rest != 0 {
                let group = rest.trailing_zeros() as usize & 7;
                rest &= rest - 1;
                let corner = |first: usize| {
                    Vec3::new(self.spans[first][group], self.spans[first + 1][group], self.spans[first + 2][group])
                };
                let candidates = seen.candidates(isa.eight(), corner(0), corner(3), 1.0);
                if candidates != 0 {
                    self.meet_candidates(isa, scene, block, &seen.to_arrays(), candidates, 1 << group);
                }
            }
        }
        before != self.alive
    }

    /// Sends a few rays below a node, one by one.
    #[inline(always)]
    fn walk_singly<I: Isa>(&mut self, isa: I, scene: &Scene, node: u32, reach: &Reach, occluder: &mut Option<u32>) {
        let mut groups = reach.groups;
        while groups != 0 {
            let group = groups.trailing_zeros() as usize & 7;
            groups &= groups - 1;
            let mut rays = reach.rays[group];
            while rays != 0 {
                let lane = rays.trailing_zeros() as usize & 15;
                rays &= rays - 1;
                let ray = group * GROUP + lane;
                let (direction, slabs) = (self.direction(ray), self.slabs(scene, ray, 1.0));
                let probe = Probe { origin: scene.apex, direction, slabs, object: scene.object };
                if let Some(leaf) = probe.any_from::<I::Eight>(isa.eight(), scene.solid, node) {
                    *occluder = Some(leaf);
                    self.alive[group] &= !(1 << lane);
                }
            }
            self.awake &= !(u32::from(self.alive[group] == 0) << group);
        }
    }

    /// Tests eight triangles against a few rays, ray by ray.
    #[inline(always)]
    fn meet_singly<I: Isa>(&mut self, isa: I, scene: &Scene, block: &Block, seen: &Seen<I::Eight>, reach: &Reach) {
        let proof = isa.eight();
        let (zero, one) = (I::Eight::splat(proof, 0.0), I::Eight::splat(proof, 1.0));
        let mut groups = reach.groups;
        while groups != 0 {
            let group = groups.trailing_zeros() as usize & 7;
            groups &= groups - 1;
            let mut rays = reach.rays[group];
            while rays != 0 {
                let lane = rays.trailing_zeros() as usize & 15;
                rays &= rays - 1;
                let ray = group * GROUP + lane;
                let meeting = seen.meets(zero, V3::splat(proof, self.direction(ray)), one);
                let suspects = I::Eight::bits(meeting.mask);
                if suspects != 0 && self.is_hit(scene, block, ray, suspects, &meeting) {
                    self.alive[group] &= !(1 << lane);
                }
            }
            self.awake &= !(u32::from(self.alive[group] == 0) << group);
        }
    }

    /// Whether a ray that meets conditions 1 and 2 of some triangles hits one of them.
    #[inline(always)]
    fn is_hit<F: Lanes>(
        &self,
        scene: &Scene,
        block: &Block,
        ray: usize,
        mut suspects: u32,
        meeting: &Meeting<F>,
    ) -> bool {
        let slabs = self.slabs(scene, ray, 1.0);
        while suspects != 0 {
            let lane = suspects.trailing_zeros() as usize & 7;
            suspects &= suspects - 1;
            if in_box(block.corners(lane), &slabs).is_none() {
                continue;
            }
            if !scene.solid.has_gaps() || is_present(scene, self.direction(ray), block.ids[lane], &meeting.edges, lane)
            {
                return true;
            }
        }
        false
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
        &mut self,
        isa: I,
        scene: &Scene,
        block: &Block,
        lane: usize,
        triangle: &Seen<I::Wide>,
        group: usize,
    ) -> u16 {
        let proof = isa.wide();
        let (zero, one) = (I::Wide::splat(proof, 0.0), I::Wide::splat(proof, 1.0));
        let mut occluded = 0;
        for part in 0..GROUP / I::Wide::COUNT {
            let at = group * GROUP + part * I::Wide::COUNT;
            let alive = u32::from(self.alive[group]) >> (part * I::Wide::COUNT);
            let [xs, ys, zs] = &self.directions;
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
            if scene.solid.has_gaps() {
                let mut values = [[0.0; GROUP]; 3];
                edges[0].store(&mut values[0]);
                edges[1].store(&mut values[1]);
                edges[2].store(&mut values[2]);
                let direction = |lane: usize| self.direction(at + lane);
                hits = keep_present(scene, direction, block.ids[lane], &values, hits);
            }
            occluded |= hits << (part * I::Wide::COUNT);
        }
        if occluded != 0 {
            let bounds = bounds_of(block.corners(lane));
            let (low, high) = (bounds.min - scene.low_origin, bounds.max - scene.high_origin);
            occluded &= u32::from(self.meet_box(isa, group, low, high, None));
        }
        occluded as u16
    }
}

/// Whether a triangle is there where a ray meets it.
#[cold]
fn is_present<F: Lanes>(scene: &Scene, direction: Vec3, triangle: u32, edges: &[F; 3], lane: usize) -> bool {
    let uv = barycentric(edges.map(|edge| {
        let mut values = [0.0; 8];
        edge.store(&mut values);
        values[lane]
    }));
    scene.solid.is_present(&scene.place(direction, triangle, uv))
}

/// Leaves out those hits that meet nothing.
#[cold]
fn keep_present(
    scene: &Scene,
    direction: impl Fn(usize) -> Vec3,
    triangle: u32,
    edges: &[[f32; GROUP]; 3],
    hits: u32,
) -> u32 {
    (0..GROUP).filter(|lane| hits >> lane & 1 != 0).fold(0, |present, lane| {
        let uv = barycentric(edges.map(|edge| edge[lane]));
        present | u32::from(scene.solid.is_present(&scene.place(direction(lane), triangle, uv))) << lane
    })
}
