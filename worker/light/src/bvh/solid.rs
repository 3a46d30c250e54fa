//! One mesh, or a piece of one, made ready for rays (the lower of the two levels).

use std::sync::Arc;

use glam::{Vec2, Vec3};
use scenes::{AlphaCut, Keep, Mesh, Scene, Texture};

use super::bounds::Aabb;
use super::build;
use super::tree::{self, Node};
use super::triangle::{Block, NONE};
use crate::texture;

/// Coordinates beyond this are refused: products of three of them leave the range of `f32`.
const FAR: f32 = (1u64 << 40) as f32;

/// The triangles of a mesh in a tree of their own, in object space.
#[derive(Clone)]
pub(super) struct Solid {
    pub nodes: Vec<Node>,
    /// One per leaf of the tree.
    pub blocks: Vec<Block>,
    pub bounds: Aabb,
    /// Triangles left out: not finite, too far away, or without area.
    pub dropped: u32,
    pub cutouts: Option<Arc<Cutouts>>,
}

/// Where a mesh has holes.
pub(super) struct Cutouts {
    /// By triangle.
    holes: Vec<Option<Hole>>,
}

/// What decides whether a point of a triangle is there.
struct Hole {
    uvs: [Vec2; 3],
    cut: AlphaCut,
    texture: Arc<Texture>,
}

impl Solid {
    /// Leaves out triangles that no ray can sensibly hit, and counts them. `cutouts` are those of the mesh.
    pub fn build(mesh: &Mesh, triangles: impl Iterator<Item = u32>, cutouts: Option<Arc<Cutouts>>) -> Self {
        let mut dropped = 0;
        let sound: Vec<(u32, [Vec3; 3])> = triangles
            .filter_map(|id| {
                let sound = corners(mesh, &mesh.triangles[id as usize]).filter(has_area);
                dropped += u32::from(sound.is_none());
                Some((id, sound?))
            })
            .collect();
        let boxes: Vec<Aabb> = sound.iter().map(|(_, corners)| Aabb::of(*corners)).collect();
        let tree = build::tree(&boxes, 8);
        let blocks = tree
            .leaves
            .iter()
            .map(|leaf| Block::new(leaf.iter().filter(|&&thing| thing != NONE).map(|&thing| sound[thing as usize])))
            .collect();
        Self { nodes: tree.nodes, blocks, bounds: around(&boxes), dropped, cutouts }
    }

    /// Takes triangles out, or puts them back where they were: `now` says of a triangle whether it is to be there, or
    /// nothing if it stays as it is. The tree keeps its shape; its boxes become those of what is there.
    pub fn take_out(&mut self, mesh: &Mesh, now: impl Fn(u32) -> Option<bool>) {
        for block in &mut self.blocks {
            for (lane, id) in block.ids.into_iter().enumerate().filter(|(_, id)| *id != NONE) {
                match now(id) {
                    Some(true) => block.put(lane, known_corners(mesh, id)),
                    Some(false) => block.put(lane, [Vec3::ZERO; 3]),
                    None => {}
                }
            }
        }
        let leaf = |block: &Block| {
            let boxes = (0..8).map(|lane| block.corners(lane)).filter(has_area).map(Aabb::of);
            boxes.fold(Aabb::EMPTY, Aabb::union)
        };
        let leaves: Vec<Aabb> = self.blocks.iter().map(leaf).collect();
        tree::refit(&mut self.nodes, |leaf| leaves[leaf as usize]);
        self.bounds = around(&leaves);
    }

    /// Memory taken, but for textures that cut holes.
    pub fn bytes(&self) -> usize {
        let holes = self.cutouts.as_ref().map_or(0, |cutouts| size_of_val(&cutouts.holes[..]));
        size_of_val(&self.nodes[..]) + size_of_val(&self.blocks[..]) + holes
    }

    /// Whether some triangles have holes.
    #[inline(always)]
    pub fn has_holes(&self) -> bool {
        self.cutouts.is_some()
    }

    /// Whether a triangle is there at barycentric coordinates (u, v).
    #[inline(always)]
    pub fn is_present(&self, triangle: u32, u: f32, v: f32) -> bool {
        self.cutouts.as_ref().is_none_or(|cutouts| cutouts.is_present(triangle, u, v))
    }
}

impl Cutouts {
    pub fn find(mesh: &Mesh, scene: &Scene, textures: &mut AlphaTextures, keep: Keep) -> Option<Arc<Self>> {
        let alpha = |material: &u32| scene.materials.get(*material as usize).and_then(|material| material.alpha);
        if keep == Keep::Needed && !mesh.materials.iter().any(|material| alpha(material).is_some()) {
            return None;
        }
        let holes = mesh.triangles.iter().zip(&mesh.materials).map(|(triangle, material)| {
            let cut = alpha(material)?;
            let uvs = triangle.map(|vertex| mesh.uvs.get(vertex as usize).copied().unwrap_or_default());
            Some(Hole { uvs, cut, texture: textures.get(scene, cut.texture)? })
        });
        Some(Arc::new(Self { holes: holes.collect() }))
    }

    #[cold]
    fn is_present(&self, triangle: u32, u: f32, v: f32) -> bool {
        let Some(Some(hole)) = self.holes.get(triangle as usize) else { return true };
        let [a, b, c] = hole.uvs;
        let uv = a * (1.0 - u - v) + b * u + c * v;
        texture::channel(&hole.texture, uv, hole.cut.channel) >= hole.cut.threshold
    }
}

/// Copies of the textures that cut holes, each made once.
#[derive(Default)]
pub(super) struct AlphaTextures(std::collections::BTreeMap<u32, Arc<Texture>>);

impl AlphaTextures {
    fn get(&mut self, scene: &Scene, texture: u32) -> Option<Arc<Texture>> {
        let original = scene.textures.get(texture as usize)?;
        Some(Arc::clone(self.0.entry(texture).or_insert_with(|| Arc::new(original.clone()))))
    }
}

/// The corners of a triangle, if they exist and are finite.
fn corners(mesh: &Mesh, triangle: &[u32; 3]) -> Option<[Vec3; 3]> {
    let corner = |i: usize| mesh.positions.get(triangle[i] as usize).filter(|p| p.abs().cmple(Vec3::splat(FAR)).all());
    Some([*corner(0)?, *corner(1)?, *corner(2)?])
}

/// The corners of a triangle that has some.
fn known_corners(mesh: &Mesh, triangle: u32) -> [Vec3; 3] {
    mesh.triangles[triangle as usize].map(|vertex| mesh.positions[vertex as usize])
}

/// A box around boxes, in whatever order they come: there is only one zero in it.
fn around(boxes: &[Aabb]) -> Aabb {
    let Aabb { min, max } = boxes.iter().fold(Aabb::EMPTY, |all, one| all.union(*one));
    Aabb { min: min + Vec3::ZERO, max: max + Vec3::ZERO }
}

fn has_area([p, q, r]: &[Vec3; 3]) -> bool {
    (*q - *p).cross(*r - *p) != Vec3::ZERO
}
