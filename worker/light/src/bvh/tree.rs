//! The 8-wide tree: its shape, and how it is collapsed from a binary one.
//!
//! Which binary nodes become children of one wide node is chosen by dynamic programming on the
//! surface-area cost [Ylitie, Karras, Laine 2017, section 3]: `cost[n][i]` is the least cost of
//! representing the subtree of n by at most i+1 wide-tree references.

use glam::Vec3;
use obvhs::bvh2::Bvh2;

use super::bounds::Aabb;
use super::triangle::NONE;

/// Reference to a leaf: the rest is its number.
pub(super) const LEAF: u32 = 1 << 31;

/// Cost of testing the eight children of a node, in units of itself.
const NODE_COST: f32 = 1.0;
/// Cost of testing a leaf of up to eight triangles.
const LEAF_COST: f32 = 1.2;

/// Eight children: bounds as structure of arrays, references.
///
/// An empty slot has bounds that no ray meets.
#[derive(Clone, Debug)]
#[repr(C, align(64))]
pub(super) struct Node {
    /// Faces of the child boxes: least x, y, z, then greatest x, y, z.
    pub faces: [[f32; 8]; 6],
    /// Index of a node, or of a leaf | [`LEAF`].
    pub children: [u32; 8],
}

/// An 8-wide tree over numbered things.
pub(super) struct Tree {
    /// Node 0 is the root; empty if there is nothing.
    pub nodes: Vec<Node>,
    /// The things in each leaf, [`NONE`] in unused places.
    pub leaves: Vec<[u32; 8]>,
}

impl Node {
    fn new() -> Self {
        let [low, high] = [[f32::INFINITY; 8], [f32::NEG_INFINITY; 8]];
        Self { faces: [low, low, low, high, high, high], children: [NONE; 8] }
    }

    fn set(&mut self, slot: usize, bounds: &Aabb, child: u32) {
        for axis in 0..3 {
            self.faces[axis][slot] = bounds.min[axis];
            self.faces[3 + axis][slot] = bounds.max[axis];
        }
        self.children[slot] = child;
    }

    /// Around all children.
    fn bounds(&self) -> Aabb {
        let [x, y, z, right, top, front] = &self.faces;
        let corner = |fold: fn(f32, f32) -> f32, empty: f32, faces: [&[f32; 8]; 3]| {
            let [x, y, z] = faces.map(|face| face.iter().copied().fold(empty, fold));
            Vec3::new(x, y, z)
        };
        let min = corner(f32::min, f32::INFINITY, [x, y, z]);
        Aabb { min, max: corner(f32::max, f32::NEG_INFINITY, [right, top, front]) }
    }
}

/// Fits the boxes of a tree to leaves that have become larger or smaller; its shape stays. Children have greater numbers
/// than their parents.
pub(super) fn refit(nodes: &mut [Node], leaf: impl Fn(u32) -> Aabb) {
    for number in (0..nodes.len()).rev() {
        for slot in 0..8 {
            let child = nodes[number].children[slot];
            let bounds = match child {
                NONE => continue,
                leaf_child if leaf_child & LEAF != 0 => leaf(leaf_child & !LEAF),
                node => nodes[node as usize].bounds(),
            };
            nodes[number].set(slot, &bounds, child);
        }
    }
}

impl Tree {
    /// Collapses a binary tree with one thing a leaf, whose boxes are `boxes`, into leaves of at most
    /// `leaf_size ≤ 8` things.
    pub fn collapse(binary: &Bvh2, boxes: &[Aabb], leaf_size: usize) -> Self {
        let mut tree = Self { nodes: Vec::new(), leaves: Vec::new() };
        if boxes.is_empty() {
            return tree;
        }
        let plan = Plan::new(binary, boxes, leaf_size);
        tree.nodes.push(Node::new());
        let mut open = vec![(0, 0)];
        while let Some((wide, root)) = open.pop() {
            let mut children = Vec::with_capacity(8);
            plan.children(root, &mut children);
            // Larger boxes first: any-hit walks meet more early.
            children.sort_by(|a, b| plan.area(*b).total_cmp(&plan.area(*a)));
            for (slot, &child) in children.iter().enumerate() {
                let reference = if plan.is_leaf(child) {
                    tree.leaves.push(plan.things(child));
                    LEAF | (tree.leaves.len() - 1) as u32
                } else {
                    tree.nodes.push(Node::new());
                    let number = tree.nodes.len() - 1;
                    open.push((number, child));
                    number as u32
                };
                tree.nodes[wide].set(slot, &plan.bounds[child], reference);
            }
        }
        tree
    }
}

impl Tree {
    /// The nodes, with leaves of one thing each renumbered: a leaf's number is that of its thing.
    pub fn with_things_as_leaves(mut self) -> Vec<Node> {
        for child in self.nodes.iter_mut().flat_map(|node| &mut node.children) {
            if *child != NONE && *child & LEAF != 0 {
                *child = LEAF | self.leaves[(*child & !LEAF) as usize][0];
            }
        }
        self.nodes
    }
}

/// What the dynamic programme found out.
struct Plan<'a> {
    binary: &'a Bvh2,
    leaf_size: usize,
    /// Exact, from the things upwards: the builder saw perturbed boxes.
    bounds: Vec<Aabb>,
    /// Things below each binary node.
    counts: Vec<u32>,
    /// By number of references − 1.
    cost: Vec<[f32; 8]>,
    /// References given to the left child, by number of references − 1; 0: one fewer is as good.
    /// In `[0]`: those of the left child if the node becomes a wide node, or 0 if it becomes a leaf.
    left: Vec<[u8; 8]>,
}

impl<'a> Plan<'a> {
    fn new(binary: &'a Bvh2, boxes: &[Aabb], leaf_size: usize) -> Self {
        let count = binary.nodes.len();
        let mut plan = Self {
            binary,
            leaf_size,
            bounds: vec![Aabb::EMPTY; count],
            counts: vec![0; count],
            cost: vec![[0.0; 8]; count],
            left: vec![[0; 8]; count],
        };
        for &node in parents_first(binary).iter().rev() {
            plan.visit(node as usize, boxes);
        }
        plan
    }

    /// Fills in one node; its children are done.
    fn visit(&mut self, node: usize, boxes: &[Aabb]) {
        let Some((left, right)) = self.pair(node) else {
            let thing = self.binary.primitive_indices[self.binary.nodes[node].first_index as usize];
            self.bounds[node] = boxes[thing as usize];
            self.counts[node] = 1;
            self.cost[node] = [self.area(node) * LEAF_COST; 8];
            return;
        };
        self.bounds[node] = self.bounds[left].union(self.bounds[right]);
        self.counts[node] = self.counts[left] + self.counts[right];
        let area = self.area(node);

        let best_split = |references: usize| {
            (1..references)
                .map(|k| (self.cost[left][k - 1] + self.cost[right][references - k - 1], k as u8))
                .min_by(|a, b| a.0.total_cmp(&b.0))
                .unwrap_or((f32::INFINITY, 1))
        };
        let (mut cost, mut split) = ([0.0; 8], [0; 8]);
        let (below, at) = best_split(8);
        let as_node = area * NODE_COST + below;
        let as_leaf = if self.counts[node] as usize <= self.leaf_size { area * LEAF_COST } else { f32::INFINITY };
        (cost[0], split[0]) = if as_leaf <= as_node { (as_leaf, 0) } else { (as_node, at) };
        for references in 2..=8 {
            let (shared, at) = best_split(references);
            let fewer = cost[references - 2];
            (cost[references - 1], split[references - 1]) = if fewer <= shared { (fewer, 0) } else { (shared, at) };
        }
        (self.cost[node], self.left[node]) = (cost, split);
    }

    fn pair(&self, node: usize) -> Option<(usize, usize)> {
        let node = &self.binary.nodes[node];
        (!node.is_leaf()).then_some((node.first_index as usize, node.first_index as usize + 1))
    }

    fn area(&self, node: usize) -> f32 {
        self.bounds[node].half_area()
    }

    fn is_leaf(&self, node: usize) -> bool {
        self.pair(node).is_none() || (self.left[node][0] == 0 && self.counts[node] as usize <= self.leaf_size)
    }

    /// The binary nodes that become children of the wide node made of `node`.
    fn children(&self, node: usize, into: &mut Vec<usize>) {
        match self.pair(node) {
            Some((left, right)) if !self.is_leaf(node) => {
                let to_left = self.left[node][0].max(1);
                self.gather(left, to_left, into);
                self.gather(right, 8 - to_left, into);
            }
            _ => into.push(node),
        }
    }

    fn gather(&self, node: usize, mut references: u8, into: &mut Vec<usize>) {
        while references > 1 && self.left[node][references as usize - 1] == 0 {
            references -= 1;
        }
        match self.pair(node) {
            Some((left, right)) if references > 1 => {
                let to_left = self.left[node][references as usize - 1];
                self.gather(left, to_left, into);
                self.gather(right, references - to_left, into);
            }
            _ => into.push(node),
        }
    }

    /// What is below a node that becomes a leaf, in order of number.
    fn things(&self, node: usize) -> [u32; 8] {
        let mut things = [NONE; 8];
        let (mut count, mut open) = (0, vec![node]);
        while let Some(node) = open.pop() {
            if let Some((left, right)) = self.pair(node) {
                open.extend([left, right]);
            } else {
                things[count] = self.binary.primitive_indices[self.binary.nodes[node].first_index as usize];
                count += 1;
            }
        }
        things.sort_unstable();
        things
    }
}

/// All nodes of a binary tree, parents before children.
fn parents_first(binary: &Bvh2) -> Vec<u32> {
    let mut order = Vec::with_capacity(binary.nodes.len());
    let mut open = vec![0];
    while let Some(number) = open.pop() {
        order.push(number);
        let node = &binary.nodes[number as usize];
        if !node.is_leaf() {
            open.extend([node.first_index + 1, node.first_index]);
        }
    }
    order
}
