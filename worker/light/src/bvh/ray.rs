//! One ray at a time: eight boxes, then eight triangles, in one step each.

use std::ops::ControlFlow;

use glam::Vec3;

use super::lanes::Lanes;
use super::slabs::Slabs;
use super::solid::{Place, Solid};
use super::tree::{LEAF, Node};
use super::triangle::{Block, Seen, in_box};
use super::vector::V3;

/// A ray in the space of what it is traced against.
#[derive(Clone, Copy, Debug)]
pub(super) struct Probe {
    pub origin: Vec3,
    pub direction: Vec3,
    pub slabs: Slabs,
    /// Whose solid it is traced against.
    pub object: u32,
}

/// A hit on a solid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Spot {
    pub t: f32,
    pub u: f32,
    pub v: f32,
    pub triangle: u32,
}

impl Probe {
    /// For things with no coordinate beyond `reach`.
    #[inline(always)]
    pub fn new(object: u32, origin: Vec3, direction: Vec3, t_max: f32, reach: f32) -> Self {
        Self { origin, direction, slabs: Slabs::new(origin, direction, t_max, reach), object }
    }

    /// The nearest hit with `t ≤ limit`; of several at the same t, that of least number.
    #[inline(always)]
    pub fn closest<F: Lanes>(&self, proof: F::Proof, solid: &Solid, limit: f32) -> Option<Spot> {
        if solid.nodes.is_empty() { None } else { self.closest_from::<F>(proof, solid, 0, limit) }
    }

    /// Likewise, below one node or leaf.
    #[inline(always)]
    pub fn closest_from<F: Lanes>(&self, proof: F::Proof, solid: &Solid, start: u32, limit: f32) -> Option<Spot> {
        let mut nearest = Nearest { probe: self, solid, best: None };
        let _ = walk_from::<F, _>(proof, &solid.nodes, start, &self.slabs, limit, &mut nearest);
        nearest.best
    }

    /// Whether there is any hit; if so, the leaf it is in.
    #[inline(always)]
    pub fn any<F: Lanes>(&self, proof: F::Proof, solid: &Solid) -> Option<u32> {
        if solid.nodes.is_empty() { None } else { self.any_from::<F>(proof, solid, 0) }
    }

    /// Likewise, below one node or leaf.
    #[inline(always)]
    pub fn any_from<F: Lanes>(&self, proof: F::Proof, solid: &Solid, start: u32) -> Option<u32> {
        let mut any = Any { probe: self, solid };
        match walk_from::<F, _>(proof, &solid.nodes, start, &self.slabs, self.slabs.t_max, &mut any) {
            ControlFlow::Break(leaf) => Some(leaf),
            ControlFlow::Continue(()) => None,
        }
    }

    /// Likewise, in one block, as seen from the ray's origin.
    #[inline(always)]
    pub fn closest_in<F: Lanes>(
        &self,
        proof: F::Proof,
        seen: &Seen<F>,
        block: &Block,
        solid: &Solid,
        limit: f32,
    ) -> Option<Spot> {
        let mut suspects = self.meet::<F>(proof, seen, limit)?;
        let mut best: Option<Spot> = None;
        while suspects.lanes != 0 {
            let lane = suspects.lanes.trailing_zeros() as usize & 7;
            suspects.lanes &= suspects.lanes - 1;
            let Some(spot) = self.confirm(&suspects, lane, block, solid) else { continue };
            let better = best.is_none_or(|old| (spot.t, spot.triangle) < (old.t, old.triangle));
            if spot.t <= limit && better {
                best = Some(spot);
            }
        }
        best
    }

    /// What may be hits on a block, with `t ≤ limit`.
    #[inline(always)]
    fn meet<F: Lanes>(&self, proof: F::Proof, seen: &Seen<F>, limit: f32) -> Option<Suspects> {
        let direction = V3::splat(proof, self.direction);
        let meeting = seen.meets(F::splat(proof, 0.0), direction, F::splat(proof, self.slabs.t_max));
        if F::bits(meeting.mask) == 0 {
            return None;
        }
        let t = seen.height / meeting.slope;
        let mut suspects = Suspects { lanes: 0, edges: [[0.0; 8]; 3], t: [0.0; 8] };
        suspects.lanes = F::bits(meeting.mask & t.le(F::splat(proof, limit)));
        meeting.edges[0].store(&mut suspects.edges[0]);
        meeting.edges[1].store(&mut suspects.edges[1]);
        meeting.edges[2].store(&mut suspects.edges[2]);
        t.store(&mut suspects.t);
        Some(suspects)
    }

    fn place(&self, triangle: u32, uv: [f32; 2]) -> Place {
        Place { object: self.object, triangle, origin: self.origin, direction: self.direction, uv }
    }

    /// The hit, if it is one.
    #[inline]
    fn confirm(&self, suspects: &Suspects, lane: usize, block: &Block, solid: &Solid) -> Option<Spot> {
        let near = in_box(block.corners(lane), &self.slabs)?;
        let [u, v] = barycentric(suspects.edges.map(|edge| edge[lane]));
        if solid.has_gaps() && !solid.is_present(&self.place(block.ids[lane], [u, v])) {
            return None;
        }
        // Not before the ray enters the box: then no walk that skips boxes behind the best hit so far
        // can skip a better one.
        Some(Spot { t: suspects.t[lane].min(f32::MAX).max(near), u, v, triangle: block.ids[lane] })
    }
}

/// Triangles of a block that meet conditions 1 and 2 of [`super::triangle`].
struct Suspects {
    lanes: u32,
    edges: [[f32; 8]; 3],
    t: [f32; 8],
}

/// What a walk does at leaves.
///
/// A trait and not a closure: closures are compiled without the vector instructions of the function
/// they are written in, unless they happen to be inlined.
pub(super) trait Visit<F: Lanes> {
    /// What ends the walk early.
    type Break;
    /// Whether near leaves are better visited first.
    const SORTED: bool;
    /// Visits a leaf; may draw the limit closer.
    fn leaf(&mut self, proof: F::Proof, leaf: u32, limit: &mut f32) -> ControlFlow<Self::Break>;
}

/// Finds the closest hit.
struct Nearest<'a> {
    probe: &'a Probe,
    solid: &'a Solid,
    best: Option<Spot>,
}

impl<F: Lanes> Visit<F> for &mut Nearest<'_> {
    type Break = ();
    const SORTED: bool = true;

    #[inline(always)]
    fn leaf(&mut self, proof: F::Proof, leaf: u32, limit: &mut f32) -> ControlFlow<()> {
        let block = &self.solid.blocks[leaf as usize];
        let seen = block.seen_from::<F>(proof, self.probe.origin);
        if let Some(spot) = self.probe.closest_in::<F>(proof, &seen, block, self.solid, *limit)
            && self.best.is_none_or(|old| (spot.t, spot.triangle) < (old.t, old.triangle))
        {
            (self.best, *limit) = (Some(spot), spot.t);
        }
        ControlFlow::Continue(())
    }
}

/// Finds whether there is a hit, and in which leaf.
struct Any<'a> {
    probe: &'a Probe,
    solid: &'a Solid,
}

impl<F: Lanes> Visit<F> for &mut Any<'_> {
    type Break = u32;
    const SORTED: bool = false;

    #[inline(always)]
    fn leaf(&mut self, proof: F::Proof, leaf: u32, _: &mut f32) -> ControlFlow<u32> {
        let block = &self.solid.blocks[leaf as usize];
        let seen = block.seen_from::<F>(proof, self.probe.origin);
        let suspects = self.probe.meet::<F>(proof, &seen, f32::INFINITY);
        let Some(mut suspects) = suspects else { return ControlFlow::Continue(()) };
        while suspects.lanes != 0 {
            let lane = suspects.lanes.trailing_zeros() as usize;
            suspects.lanes &= suspects.lanes - 1;
            if self.probe.confirm(&suspects, lane, block, self.solid).is_some() {
                return ControlFlow::Break(leaf);
            }
        }
        ControlFlow::Continue(())
    }
}

/// (u, v) from the three edge functions; the middle where rounding left nothing of them.
#[inline(always)]
pub(super) fn barycentric([a, b, c]: [f32; 3]) -> [f32; 2] {
    let sum = a + b + c;
    if sum == 0.0 || !sum.is_finite() {
        return [1.0 / 3.0; 2];
    }
    [b / sum, c / sum]
}

/// Visits the leaves whose boxes the ray meets within `limit`.
#[inline(always)]
pub(super) fn walk<F: Lanes, V: Visit<F>>(
    proof: F::Proof,
    nodes: &[Node],
    slabs: &Slabs,
    limit: f32,
    visit: V,
) -> ControlFlow<V::Break> {
    if nodes.is_empty() {
        return ControlFlow::Continue(());
    }
    walk_from::<F, V>(proof, nodes, 0, slabs, limit, visit)
}

/// Likewise, from a node or leaf on.
#[inline(always)]
fn walk_from<F: Lanes, V: Visit<F>>(
    proof: F::Proof,
    nodes: &[Node],
    start: u32,
    slabs: &Slabs,
    mut limit: f32,
    mut visit: V,
) -> ControlFlow<V::Break> {
    let faces = Faces::<F>::new(proof, slabs);
    let mut stack = Stack::new();
    let mut current = start;
    loop {
        if current & LEAF != 0 {
            visit.leaf(proof, current & !LEAF, &mut limit)?;
        } else {
            let node = &nodes[current as usize];
            let (mut hits, near) = faces.meet(proof, node, limit);
            if hits != 0 && hits & (hits - 1) == 0 {
                current = node.children[hits.trailing_zeros() as usize & 7];
                continue;
            }
            if V::SORTED {
                let mut nears = [0.0; 8];
                near.store(&mut nears);
                let base = stack.len();
                while hits != 0 {
                    let child = hits.trailing_zeros() as usize & 7;
                    hits &= hits - 1;
                    stack.insert(base, Entry { near: nears[child], reference: node.children[child] });
                }
            } else if hits != 0 {
                current = node.children[hits.trailing_zeros() as usize & 7];
                hits &= hits - 1;
                while hits != 0 {
                    let child = 31 - hits.leading_zeros();
                    hits &= !(1 << child);
                    stack.push(Entry { near: 0.0, reference: node.children[child as usize & 7] });
                }
                continue;
            }
        }
        current = loop {
            let Some(entry) = stack.pop() else { return ControlFlow::Continue(()) };
            if entry.near <= limit {
                break entry.reference;
            }
        };
    }
}

/// A ray against eight boxes: [`Slabs::meets`] in lanes.
pub(super) struct Faces<F> {
    /// Indices into [`Node::faces`]: where the ray enters, and where it leaves.
    enter: [usize; 3],
    leave: [usize; 3],
    enter_origin: V3<F>,
    leave_origin: V3<F>,
    inverse: V3<F>,
    zero: F,
}

impl<F: Lanes> Faces<F> {
    #[inline(always)]
    pub fn new(proof: F::Proof, slabs: &Slabs) -> Self {
        let forward = slabs.inverse.cmpge(Vec3::ZERO);
        let enter = [0, 1, 2].map(|axis| if forward.test(axis) { axis } else { axis + 3 });
        Self {
            enter,
            leave: [3 - enter[0], 5 - enter[1], 7 - enter[2]],
            enter_origin: V3::splat(proof, Vec3::select(forward, slabs.low_origin, slabs.high_origin)),
            leave_origin: V3::splat(proof, Vec3::select(forward, slabs.high_origin, slabs.low_origin)),
            inverse: V3::splat(proof, slabs.inverse),
            zero: F::splat(proof, 0.0),
        }
    }

    /// Which children the ray meets within `limit`, and from where on.
    #[inline(always)]
    pub fn meet(&self, proof: F::Proof, node: &Node, limit: f32) -> (u32, F) {
        let [x, y, z] = self.enter;
        let enter = V3::<F>::load(proof, [&node.faces[x], &node.faces[y], &node.faces[z]]).sub(self.enter_origin);
        let [x, y, z] = self.leave;
        let leave = V3::<F>::load(proof, [&node.faces[x], &node.faces[y], &node.faces[z]]).sub(self.leave_origin);
        let near = (enter.x * self.inverse.x).max(self.zero);
        let near = (enter.y * self.inverse.y).max(near);
        let near = (enter.z * self.inverse.z).max(near);
        let far = (leave.x * self.inverse.x).min(F::splat(proof, limit));
        let far = (leave.y * self.inverse.y).min(far);
        let far = (leave.z * self.inverse.z).min(far);
        (F::bits(near.le(far)), near)
    }
}

/// What is still to be visited, and from where on the ray is in it.
#[derive(Clone, Copy, Default)]
struct Entry {
    near: f32,
    reference: u32,
}

/// A stack that has room for all but the deepest trees on the spot.
struct Stack {
    near_top: [Entry; Self::ROOM],
    length: usize,
    deep: Vec<Entry>,
}

impl Stack {
    const ROOM: usize = 64;

    #[inline(always)]
    fn new() -> Self {
        Self { near_top: [Entry::default(); Self::ROOM], length: 0, deep: Vec::new() }
    }

    #[inline(always)]
    fn len(&self) -> usize {
        self.length
    }

    #[inline(always)]
    fn push(&mut self, entry: Entry) {
        if self.length < Self::ROOM {
            self.near_top[self.length] = entry;
        } else {
            self.deep.push(entry);
        }
        self.length += 1;
    }

    #[inline(always)]
    fn pop(&mut self) -> Option<Entry> {
        self.length = self.length.checked_sub(1)?;
        if self.length < Self::ROOM { Some(self.near_top[self.length]) } else { self.deep.pop() }
    }

    /// Keeps the entries from `base` on in order, nearest on top.
    #[inline(always)]
    fn insert(&mut self, base: usize, entry: Entry) {
        self.push(entry);
        let mut place = self.length - 1;
        while place > base && self.get(place - 1).near < entry.near {
            *self.get(place) = *self.get(place - 1);
            place -= 1;
        }
        *self.get(place) = entry;
    }

    #[inline(always)]
    fn get(&mut self, place: usize) -> &mut Entry {
        if place < Self::ROOM { &mut self.near_top[place] } else { &mut self.deep[place - Self::ROOM] }
    }
}
