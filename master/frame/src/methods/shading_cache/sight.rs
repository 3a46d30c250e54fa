//! What is in sight of the mesh, each leaf and each vertex once: found anew for each picture, so that what a picture takes
//! goes with what it sees, not with all that is kept.

use glam::Vec3;

use super::mesh::{Leaf, NONE, PatchMesh};
use super::settings::{Error, Options};

/// See the module's documentation.
#[derive(Clone, Debug, Default)]
pub(super) struct Sight {
    /// Of each pixel, the place of its leaf among those in sight; [`NONE`] where there is none.
    pub slots: Vec<u32>,
    /// Leaves, in the order of the first pixel that sees each.
    pub leaves: Vec<LeafSeen>,
    /// Their corners, in the order of leaves; then others that it takes to tell what leaves are worth.
    pub vertices: Vec<VertexSeen>,
    /// So many are corners.
    pub corners: usize,
}

/// A leaf in sight.
#[derive(Clone, Copy, Debug)]
pub(super) struct LeafSeen {
    pub patch: u32,
    pub pixels: u32,
    /// Sum over its pixels of where they see it, by the weights of the second and the third corner.
    place: [f32; 2],
    /// The vertices that light it: its corners, or thrice the spot of its triangle.
    pub vertices: [u32; 3],
    /// Their places among all in sight.
    pub corners: [u32; 3],
}

/// Triangles of fewer pixels are lit where they are seen, as long as not all of their corners have been lit for others.
const SPOT_PIXELS: u32 = 12;

/// A vertex of what is in sight.
#[derive(Clone, Copy, Debug)]
pub(super) struct VertexSeen {
    pub vertex: u32,
    /// The eye cannot see it, and it is shown as what is beside it.
    pub is_hidden: bool,
    /// Square of what its mean may be off by.
    pub variance: f32,
    /// Of its neighbours' means, each by how well it is known, and of these weights.
    pub sum: Vec3,
    pub weight: f32,
    /// Display codes of what it has by itself, and by how many noise may have changed them.
    pub codes: [f32; 2],
}

impl Sight {
    /// Counts the pixels of each leaf, and finds what lights it.
    pub fn find(&mut self, mesh: &mut PatchMesh, pixels: &[Leaf], tick: u32, options: &Options) {
        let Self { slots, leaves, vertices, corners } = self;
        slots.clear();
        leaves.clear();
        vertices.clear();
        let (mut patch, mut slot) = (NONE, NONE);
        for leaf in pixels {
            // What is beside is mostly the same.
            if leaf.patch != patch {
                patch = leaf.patch;
                slot = if patch == NONE { NONE } else { place_leaf(leaves, mesh, patch, tick) };
            }
            slots.push(slot);
            if let Some(seen) = leaves.get_mut(slot as usize) {
                seen.pixels += 1;
                let [u, v] = seen.place;
                seen.place = [u + leaf.weights[0], v + leaf.weights[1]];
            }
        }
        for seen in leaves.iter_mut() {
            seen.vertices = mesh.patches[seen.patch as usize].vertices;
            if options.tested && seen.is_lit_by_spot(mesh) {
                let root = mesh.patches[seen.patch as usize].root;
                if mesh.roots[root as usize].spot == NONE {
                    mesh.make_spot(root, seen.place.map(|sum| sum / seen.pixels as f32));
                }
                seen.vertices = [mesh.roots[root as usize].spot; 3];
            }
            seen.corners = seen.vertices.map(|vertex| place_vertex(vertices, mesh, vertex));
        }
        *corners = vertices.len();
        for seen in leaves.iter().filter(|_| options.error == Error::Curvature) {
            let Some(middles) = mesh.middles_above(seen.patch) else { continue };
            for [middle, end, _] in middles {
                place_vertex(vertices, mesh, middle);
                place_vertex(vertices, mesh, end);
            }
        }
    }

    /// The leaf that a patch is, if it is in sight.
    pub fn leaf(&self, mesh: &PatchMesh, patch: u32) -> Option<&LeafSeen> {
        self.leaves.get(mesh.patches[patch as usize].slot as usize).filter(|seen| seen.patch == patch)
    }

    /// Nothing is in sight.
    pub fn clear(&mut self) {
        self.slots.fill(NONE);
        self.leaves.clear();
        self.vertices.clear();
        self.corners = 0;
    }
}

impl LeafSeen {
    /// It is a triangle of which little is seen and whose corners are not all known.
    fn is_lit_by_spot(&self, mesh: &PatchMesh) -> bool {
        let is_small = self.pixels < SPOT_PIXELS && mesh.patches[self.patch as usize].level == 0;
        is_small && self.vertices.iter().any(|vertex| mesh.vertices[*vertex as usize].samples == 0)
    }

    /// What [`Self::vertices`] are.
    pub fn has_spot(&self) -> bool {
        self.vertices[0] == self.vertices[1]
    }
}

/// The place of a leaf among those in sight.
fn place_leaf(leaves: &mut Vec<LeafSeen>, mesh: &mut PatchMesh, number: u32, tick: u32) -> u32 {
    let patch = &mut mesh.patches[number as usize];
    patch.seen = tick;
    if leaves.get(patch.slot as usize).is_none_or(|seen| seen.patch != number) {
        patch.slot = leaves.len() as u32;
        let none = [NONE; 3];
        leaves.push(LeafSeen { patch: number, pixels: 0, place: [0.0; 2], vertices: none, corners: none });
    }
    patch.slot
}

/// The place of a vertex among those that are looked at.
fn place_vertex(vertices: &mut Vec<VertexSeen>, mesh: &mut PatchMesh, number: u32) -> u32 {
    let vertex = &mut mesh.vertices[number as usize];
    if vertices.get(vertex.slot as usize).is_none_or(|seen| seen.vertex != number) {
        vertex.slot = vertices.len() as u32;
        vertices.push(VertexSeen {
            vertex: number,
            is_hidden: false,
            variance: 0.0,
            sum: Vec3::ZERO,
            weight: 0.0,
            codes: [0.0; 2],
        });
    }
    vertex.slot
}
