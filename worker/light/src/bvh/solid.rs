//! One mesh, or a piece of one, made ready for rays (the lower of the two levels).

use std::sync::Arc;

use glam::{Vec2, Vec3};
use scenes::{Coverage, Keep, Mesh, Scene, Texture, texture};

use super::bounds::Aabb;
use super::build;
use super::tree::{self, Node};
use super::triangle::{Block, NONE};
use crate::sample;

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
    pub gaps: Option<Arc<Gaps>>,
}

/// Where a ray meets a triangle.
pub(super) struct Place {
    /// Whose solid it is of.
    pub object: u32,
    pub triangle: u32,
    /// Of the ray, in object space.
    pub origin: Vec3,
    pub direction: Vec3,
    /// Barycentric coordinates.
    pub uv: [f32; 2],
}

/// Where a mesh is not, or only in part.
pub(super) struct Gaps {
    /// By triangle; `None` where all of it is there.
    triangles: Vec<Option<Partial>>,
}

/// What decides whether a point of a triangle is there.
struct Partial {
    coverage: Coverage,
    uvs: [Vec2; 3],
    /// Of vertex colours.
    alphas: [f32; 3],
    /// The one of the coverage.
    texture: Option<Arc<Texture>>,
}

impl Solid {
    /// Leaves out triangles that no ray can sensibly hit, and counts them. `gaps` are those of the mesh.
    pub fn build(mesh: &Mesh, triangles: impl Iterator<Item = u32>, gaps: Option<Arc<Gaps>>) -> Self {
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
        Self { nodes: tree.nodes, blocks, bounds: around(&boxes), dropped, gaps }
    }

    /// Takes triangles out, or puts them back where they were: `now` says of a triangle whether it is to be there, or
    /// `None` if it stays as it is. The tree keeps its shape; its boxes become those of what is there.
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

    /// Memory taken, but for textures of coverage.
    pub fn bytes(&self) -> usize {
        let gaps = self.gaps.as_ref().map_or(0, |gaps| size_of_val(&gaps.triangles[..]));
        size_of_val(&self.nodes[..]) + size_of_val(&self.blocks[..]) + gaps
    }

    /// Whether some triangles are not wholly there.
    #[inline(always)]
    pub fn has_gaps(&self) -> bool {
        self.gaps.is_some()
    }

    /// Whether a triangle is there for a ray that meets it.
    #[inline(always)]
    pub fn is_present(&self, place: &Place) -> bool {
        self.gaps.as_ref().is_none_or(|gaps| gaps.is_present(place))
    }
}

impl Gaps {
    /// Of a mesh, where `made_of` says what there is of each of its materials.
    pub fn find(mesh: &Mesh, scene: &Scene, keep: Keep, made_of: impl Fn(u32) -> u32) -> Option<Arc<Self>> {
        let coverage =
            |material: &u32| scene.materials.get(made_of(*material) as usize).and_then(|material| material.coverage);
        if keep == Keep::Needed && !mesh.materials.iter().any(|material| coverage(material).is_some()) {
            return None;
        }
        let triangles = mesh.materials.iter().enumerate().map(|(triangle, material)| {
            let coverage = coverage(material)?;
            let texture =
                coverage.amount.texture.and_then(|(texture, _)| scene.textures.get(texture as usize).cloned());
            let uvs = mesh.corner_uvs(triangle, texture.as_ref().map_or(0, |texture| texture.look_up.set));
            let alphas = mesh.corner_colours(triangle).map(|colour| colour.w);
            Some(Partial { coverage, uvs, alphas, texture })
        });
        Some(Arc::new(Self { triangles: triangles.collect() }))
    }

    #[cold]
    fn is_present(&self, place: &Place) -> bool {
        let Some(Some(partial)) = self.triangles.get(place.triangle as usize) else { return true };
        let amount = partial.amount(place.uv);
        amount >= 1.0 || place.chance() < amount
    }
}

impl Partial {
    /// How much is there, 0..1.
    fn amount(&self, [u, v]: [f32; 2]) -> f32 {
        let [a, b, c] = self.uvs;
        let texel = match (&self.texture, self.coverage.amount.texture) {
            (Some(texture), Some((_, channel))) => {
                texture::channel(texture, a * (1.0 - u - v) + b * u + c * v, channel)
            }
            _ => 1.0,
        };
        let [p, q, r] = self.alphas;
        // Without vertex colours, exactly 1.
        let alpha = if self.alphas == [1.0; 3] { 1.0 } else { p * (1.0 - u - v) + q * u + r * v };
        self.coverage.of(texel * alpha)
    }
}

impl Place {
    /// By which chance decides whether a surface is there.
    fn chance(&self) -> f32 {
        sample::chance(0x51ab_3c95, [self.object, self.triangle], [self.origin, self.direction], self.uv)
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
