//! Primitives into meshes.

use std::collections::BTreeMap;

use glam::{Vec2, Vec3};
use gltf_json::mesh::{Mode, Primitive, Semantic};
use gltf_json::validation::Checked;
use gltf_json::{self as json, Index};

use super::super::ReadError;
use super::super::error::{Notes, Tally};
use super::super::limits::TRIANGLES_MAX;
use super::super::mesh::{Added, MeshBuilder, Vertex};
use super::file::File;
use super::material::{Layout, Looks};
use crate::{Material, Mesh};

/// The scene's meshes and materials as they gather: each of the file's meshes that is used, and its
/// mirror image if that is used.
pub(super) struct Meshes<'a> {
    pub looks: Looks<'a>,
    /// Become the scene's.
    pub meshes: Vec<Mesh>,
    /// Become the scene's.
    pub materials: Vec<Material>,
    layouts: Vec<Layout>,
    known_meshes: BTreeMap<(usize, bool), Option<u32>>,
    known_materials: BTreeMap<Option<usize>, u32>,
    triangles: usize,
    degenerate: Tally,
    not_finite: Tally,
    repaired: Tally,
}

impl<'a> Meshes<'a> {
    pub fn new(looks: Looks<'a>) -> Self {
        Self {
            looks,
            meshes: Vec::new(),
            materials: Vec::new(),
            layouts: Vec::new(),
            known_meshes: BTreeMap::new(),
            known_materials: BTreeMap::new(),
            triangles: 0,
            degenerate: Tally::default(),
            not_finite: Tally::default(),
            repaired: Tally::default(),
        }
    }

    /// Index of a mesh of the file among the scene's; `None` if it has no triangles.
    ///
    /// `mirrored` turns it inside out along x, for instances whose transform does so too: every
    /// object's triangles are then counter-clockwise seen from outside, in object and scene space.
    pub fn mesh(&mut self, index: Index<json::Mesh>, mirrored: bool, field: &str) -> Result<Option<u32>, ReadError> {
        let file = self.looks.file;
        let key = (index.value(), mirrored);
        if let Some(&known) = self.known_meshes.get(&key) {
            return Ok(known);
        }
        let source = match file.get(&file.root.meshes, index, || field.into()) {
            Ok(source) => source,
            Err(error) => {
                file.leave_out(error, "not drawn", self.looks.notes);
                return Ok(None);
            }
        };
        let mut builder = MeshBuilder::default();
        let mut textured = false;
        for (i, primitive) in source.primitives.iter().enumerate() {
            let place = format!("meshes[{}].primitives[{i}]", index.value());
            match self.primitive(&mut builder, primitive, i, mirrored, &place) {
                Ok(is_textured) => textured |= is_textured,
                Err(error) => file.leave_out(error, "not drawn", self.looks.notes),
            }
            if self.triangles > TRIANGLES_MAX {
                return Err(file.refuse(&place, format!("more than {TRIANGLES_MAX} triangles")));
            }
        }
        if builder.repaired > 0 {
            self.repaired.count += builder.repaired;
        }
        let mesh = builder.finish(textured);
        let added = (!mesh.triangles.is_empty()).then_some(self.meshes.len() as u32);
        self.meshes.extend(added.map(|_| mesh));
        self.known_meshes.insert(key, added);
        Ok(added)
    }

    /// Adds the triangles of a primitive; says whether its material is textured.
    fn primitive(
        &mut self,
        builder: &mut MeshBuilder<(usize, u32)>,
        primitive: &Primitive,
        number: usize,
        mirrored: bool,
        place: &str,
    ) -> Result<bool, ReadError> {
        let file = self.looks.file;
        let path = &file.path;
        let Checked::Valid(mode) = primitive.mode else {
            return Err(file.refuse(place, "has an unknown mode"));
        };
        if !matches!(mode, Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan) {
            self.looks.notes.at(path, place, "points and lines are not drawn");
            return Ok(false);
        }
        if primitive.targets.as_ref().is_some_and(|targets| !targets.is_empty()) {
            self.looks.notes.at(path, place, "morph targets are not drawn: the mesh stays as modelled");
        }
        let material = self.material(primitive.material, place);
        let layout = self.layouts[material as usize];
        let flat = self.materials[material as usize].emission != crate::Colour::default();
        let vertices = Vertices::read(file, primitive, layout, flat, mirrored, place, self.looks.notes)?;
        let order = match primitive.indices {
            Some(indices) => file.indices(indices, &format!("{place}.indices"))?,
            None => (0..vertices.positions.len() as u32).collect(),
        };
        let exists = |&index: &u32| (index as usize) < vertices.positions.len();
        if let Some(beyond) = order.iter().find(|index| !exists(index)) {
            let count = vertices.positions.len();
            let message =
                format!("index {beyond} is out of range: there are {count} vertices; its triangles are dropped");
            self.looks.notes.at(path, format!("{place}.indices"), message);
        }
        for mut triangle in triangles(mode, &order).into_iter().filter(|triangle| triangle.iter().all(exists)) {
            if mirrored {
                triangle.swap(1, 2);
            }
            let corners = triangle.map(|index| ((number, index), vertices.get(index as usize)));
            match builder.triangle(corners, material) {
                Added::Yes => self.triangles += 1,
                Added::Degenerate => self.degenerate.add(0),
                Added::NotFinite => self.not_finite.add(0),
            }
        }
        Ok(layout.textured)
    }

    fn material(&mut self, index: Option<Index<json::Material>>, place: &str) -> u32 {
        let key = index.map(|index| index.value());
        if let Some(&known) = self.known_materials.get(&key) {
            return known;
        }
        let look = self.looks.look(index, place);
        let added = self.materials.len() as u32;
        self.materials.push(look.material);
        self.layouts.push(look.layout);
        self.known_materials.insert(key, added);
        added
    }

    /// Says what was left out.
    pub fn report(&mut self) {
        let (path, notes) = (&self.looks.file.path, &mut *self.looks.notes);
        self.degenerate.report(notes, path, "triangles without area were dropped");
        self.not_finite.report(notes, path, "triangles with a vertex that is no finite number were dropped");
        self.repaired.report(notes, path, "normals or texture coordinates were no usable numbers: replaced");
    }
}

/// A primitive's attributes.
struct Vertices {
    positions: Vec<[f32; 3]>,
    normals: Vec<[f32; 3]>,
    uvs: Vec<[f32; 2]>,
    layout: Layout,
    mirrored: bool,
}

impl Vertices {
    /// Of a primitive; nothing is left of it without positions.
    fn read(
        file: &File,
        primitive: &Primitive,
        layout: Layout,
        flat: bool,
        mirrored: bool,
        place: &str,
        notes: &mut Notes,
    ) -> Result<Self, ReadError> {
        let attribute = |semantic: Semantic| primitive.attributes.get(&Checked::Valid(semantic)).copied();
        let field = |name: &str| format!("{place}.attributes.{name}");
        let positions = attribute(Semantic::Positions).ok_or_else(|| file.refuse(&field("POSITION"), "is missing"))?;
        let positions = file.vectors(positions, &field("POSITION"))?;
        let normals = match attribute(Semantic::Normals).filter(|_| !flat) {
            Some(normals) => one_each(file, normals, &field("NORMAL"), positions.len(), notes),
            None => Vec::new(),
        };
        let uvs = match attribute(Semantic::TexCoords(layout.set)).filter(|_| layout.textured) {
            Some(uvs) => one_each(file, uvs, &field("TEXCOORD"), positions.len(), notes),
            None => Vec::new(),
        };
        Ok(Self { positions, normals, uvs, layout, mirrored })
    }

    fn get(&self, i: usize) -> Vertex {
        let side = if self.mirrored { Vec3::new(-1.0, 1.0, 1.0) } else { Vec3::ONE };
        let uv = self.uvs.get(i).map_or(Vec2::ZERO, |&uv| self.layout.linear * Vec2::from(uv) + self.layout.offset);
        Vertex {
            position: Vec3::from(self.positions[i]) * side,
            normal: self.normals.get(i).map_or(Vec3::ZERO, |&normal| Vec3::from(normal) * side),
            // In glTF v = 0 is the top row.
            uv: Vec2::new(uv.x, 1.0 - uv.y),
        }
    }
}

/// Vectors of an attribute, as many as there are vertices; none, and a note, if it is broken.
fn one_each<const N: usize>(
    file: &File,
    attribute: Index<json::Accessor>,
    field: &str,
    vertices: usize,
    notes: &mut Notes,
) -> Vec<[f32; N]> {
    let vectors = file.vectors(attribute, field).and_then(|vectors| {
        let message = || format!("has {} elements, but there are {vertices} positions", vectors.len());
        if vectors.len() == vertices { Ok(vectors) } else { Err(file.refuse(field, message())) }
    });
    vectors.unwrap_or_else(|error| {
        file.leave_out(error, "left out", notes);
        Vec::new()
    })
}

/// Vertex indices of each triangle, all wound alike.
fn triangles(mode: Mode, order: &[u32]) -> Vec<[u32; 3]> {
    match mode {
        Mode::TriangleStrip => (2..order.len())
            .map(|i| {
                let odd = i % 2;
                [order[i - 2], order[i - 1 + odd], order[i - odd]]
            })
            .collect(),
        Mode::TriangleFan => (2..order.len()).map(|i| [order[i - 1], order[i], order[0]]).collect(),
        _ => order.chunks_exact(3).map(|triangle| [triangle[0], triangle[1], triangle[2]]).collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn strips_and_fans_are_wound_as_the_specification_draws_them() {
        assert_eq!(triangles(Mode::TriangleStrip, &[0, 1, 2, 3, 4]), [[0, 1, 2], [1, 3, 2], [2, 3, 4]]);
        assert_eq!(triangles(Mode::TriangleFan, &[0, 1, 2, 3]), [[1, 2, 0], [2, 3, 0]]);
        assert_eq!(triangles(Mode::Triangles, &[0, 1, 2, 3]), [[0, 1, 2]]);
        assert!(triangles(Mode::TriangleStrip, &[0, 1]).is_empty());
    }
}
