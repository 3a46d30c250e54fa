//! Primitives into meshes.

use std::collections::BTreeMap;

use glam::{Mat2, Vec2, Vec3};
use gltf_json::mesh::{Mode, Primitive, Semantic};
use gltf_json::validation::Checked;
use gltf_json::{self as json, Index};

use super::super::ReadError;
use super::super::error::{Notes, Tally};
use super::super::limits::TRIANGLES_MAX;
use super::super::mesh::{Added, MeshBuilder, Vertex};
use super::bend::{Bend, Bent};
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
    /// Of each material.
    layouts: Vec<(Vec<Layout>, Option<usize>)>,
    known_meshes: BTreeMap<(usize, bool), Option<u32>>,
    known_materials: BTreeMap<Option<usize>, u32>,
    triangles: usize,
    degenerate: Tally,
    not_finite: Tally,
    repaired: Tally,
    no_uvs: Tally,
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
            no_uvs: Tally::default(),
        }
    }

    /// Index of a mesh of the file among the scene's; `None` if it has no triangles.
    ///
    /// `mirrored` turns it inside out along x, for instances whose transform does so too: every
    /// object's triangles are then counter-clockwise seen from outside, in object and scene space.
    pub fn mesh(&mut self, index: Index<json::Mesh>, mirrored: bool, field: &str) -> Result<Option<u32>, ReadError> {
        let key = (index.value(), mirrored);
        if let Some(&known) = self.known_meshes.get(&key) {
            return Ok(known);
        }
        let added = self.bent(index, mirrored, &Bend::default(), field)?;
        self.known_meshes.insert(key, added);
        Ok(added)
    }

    /// The same of a mesh that is bent, always a new one.
    pub fn bent(
        &mut self,
        index: Index<json::Mesh>,
        mirrored: bool,
        bend: &Bend,
        field: &str,
    ) -> Result<Option<u32>, ReadError> {
        let file = self.looks.file;
        let source = match file.get(&file.root.meshes, index, || field.into()) {
            Ok(source) => source,
            Err(error) => {
                file.leave_out(error, "not drawn", self.looks.notes);
                return Ok(None);
            }
        };
        let mut builder = MeshBuilder::default();
        for (i, primitive) in source.primitives.iter().enumerate() {
            let place = format!("meshes[{}].primitives[{i}]", index.value());
            if let Err(error) = self.primitive(&mut builder, primitive, i, (mirrored, bend), &place) {
                file.leave_out(error, "not drawn", self.looks.notes);
            }
            if self.triangles > TRIANGLES_MAX {
                return Err(file.refuse(&place, format!("more than {TRIANGLES_MAX} triangles")));
            }
        }
        if builder.repaired > 0 {
            self.repaired.count += builder.repaired;
        }
        let mesh = builder.finish();
        let added = (!mesh.triangles.is_empty()).then_some(self.meshes.len() as u32);
        self.meshes.extend(added.map(|_| mesh));
        Ok(added)
    }

    /// Adds the triangles of a primitive.
    fn primitive(
        &mut self,
        builder: &mut MeshBuilder<(usize, u32)>,
        primitive: &Primitive,
        number: usize,
        (mirrored, bend): (bool, &Bend),
        place: &str,
    ) -> Result<(), ReadError> {
        let file = self.looks.file;
        let path = &file.path;
        let Checked::Valid(mode) = primitive.mode else {
            return Err(file.refuse(place, "has an unknown mode"));
        };
        if !matches!(mode, Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan) {
            self.looks.notes.at(path, place, "points and lines are not drawn");
            return Ok(());
        }
        let material = self.material(primitive.material, place);
        let (layouts, relief) = self.layouts[material as usize].clone();
        builder.use_sets(layouts.len());
        let opaque = self.materials[material as usize].coverage.is_none();
        let wanted = Wanted { layouts, relief, opaque, mirrored };
        let mut vertices = Vertices::read(file, primitive, wanted, place, self.looks.notes)?;
        if !bend.is_none() {
            let Vertices { positions, normals, tangents, .. } = &mut vertices;
            bend.apply(file, primitive, place, Bent { positions, normals, tangents })?;
        }
        let inside_out = mirrored != bend.mirrors();
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
            if inside_out {
                triangle.swap(1, 2);
            }
            let corners = triangle.map(|index| ((number, index), vertices.get(index as usize)));
            match builder.triangle(corners, material, relief) {
                Added::Yes => {
                    self.triangles += 1;
                    self.no_uvs.add_if(vertices.lacks_uvs, 0);
                }
                Added::Degenerate => self.degenerate.add(0),
                Added::NotFinite => self.not_finite.add(0),
            }
        }
        Ok(())
    }

    fn material(&mut self, index: Option<Index<json::Material>>, place: &str) -> u32 {
        let key = index.map(|index| index.value());
        if let Some(&known) = self.known_materials.get(&key) {
            return known;
        }
        let look = self.looks.look(index, place);
        let added = self.materials.len() as u32;
        self.materials.push(look.material);
        self.layouts.push((look.layouts, look.relief));
        self.known_materials.insert(key, added);
        added
    }

    /// Does something that has been done before, of which nothing more is to be said.
    pub fn again<T>(&mut self, something: impl FnOnce(&mut Self) -> T) -> T {
        let (notes, counts) = (std::mem::take(self.looks.notes), [self.degenerate.count, self.not_finite.count]);
        let (repaired, no_uvs) = (self.repaired.count, self.no_uvs.count);
        let done = something(self);
        *self.looks.notes = notes;
        [self.degenerate.count, self.not_finite.count] = counts;
        (self.repaired.count, self.no_uvs.count) = (repaired, no_uvs);
        done
    }

    /// Says what was left out.
    pub fn report(&mut self) {
        let (path, notes) = (&self.looks.file.path, &mut *self.looks.notes);
        self.degenerate.report(notes, path, "triangles without area were dropped");
        self.not_finite.report(notes, path, "triangles with a vertex that is no finite number were dropped");
        self.repaired.report(notes, path, "normals or texture coordinates were no usable numbers: replaced");
        let message = "triangles of textured materials have no texture coordinates: 0 0 is used";
        self.no_uvs.report(notes, path, message);
    }
}

/// Which attributes of a primitive are looked at, and how.
struct Wanted {
    layouts: Vec<Layout>,
    /// The set of texture coordinates of a normal map.
    relief: Option<usize>,
    /// The alpha of vertex colours means nothing.
    opaque: bool,
    mirrored: bool,
}

/// A primitive's attributes.
struct Vertices {
    wanted: Wanted,
    positions: Vec<[f32; 3]>,
    normals: Vec<[f32; 3]>,
    tangents: Vec<[f32; 4]>,
    colours: Vec<[f32; 4]>,
    /// Of each layout.
    uvs: Vec<Vec<[f32; 2]>>,
    /// Its material has a texture that lies by coordinates which the primitive does not have.
    lacks_uvs: bool,
}

impl Vertices {
    /// Of a primitive; nothing is left of it without positions.
    fn read(
        file: &File,
        primitive: &Primitive,
        wanted: Wanted,
        place: &str,
        notes: &mut Notes,
    ) -> Result<Self, ReadError> {
        let attribute = |semantic: Semantic| primitive.attributes.get(&Checked::Valid(semantic)).copied();
        let field = |name: &str| format!("{place}.attributes.{name}");
        let positions = attribute(Semantic::Positions).ok_or_else(|| file.refuse(&field("POSITION"), "is missing"))?;
        let positions = file.vectors(positions, &field("POSITION"))?;
        let count = positions.len();
        let normals = match attribute(Semantic::Normals) {
            Some(normals) => one_each(file, normals, &field("NORMAL"), count, notes),
            None => Vec::new(),
        };
        // A normal map that is turned or scaled lies by tangents of its own.
        let is_turned = |set: usize| wanted.layouts[set].linear != Mat2::IDENTITY;
        let tangents = match attribute(Semantic::Tangents).filter(|_| wanted.relief.is_some_and(|set| !is_turned(set)))
        {
            Some(tangents) => one_each(file, tangents, &field("TANGENT"), count, notes),
            None => Vec::new(),
        };
        let colours = match attribute(Semantic::Colors(0)) {
            Some(colours) => file
                .colours(colours, &field("COLOR_0"))
                .and_then(|colours| same(file, colours, count, &field("COLOR_0"))),
            None => Ok(Vec::new()),
        };
        let colours = colours.unwrap_or_else(|error| {
            file.leave_out(error, "left out", notes);
            Vec::new()
        });
        let mut uvs = Vec::new();
        for layout in &wanted.layouts {
            uvs.push(match attribute(Semantic::TexCoords(layout.set)) {
                Some(set) => one_each(file, set, &field("TEXCOORD"), count, notes),
                None => Vec::new(),
            });
        }
        let lacks_uvs = wanted.layouts.iter().any(|layout| attribute(Semantic::TexCoords(layout.set)).is_none());
        Ok(Self { wanted, positions, normals, tangents, colours, uvs, lacks_uvs })
    }

    fn get(&self, i: usize) -> Vertex {
        let mirrored = self.wanted.mirrored;
        let side = if mirrored { Vec3::new(-1.0, 1.0, 1.0) } else { Vec3::ONE };
        let mut vertex = Vertex {
            position: Vec3::from(self.positions[i]) * side,
            normal: self.normals.get(i).map_or(Vec3::ZERO, |&normal| Vec3::from(normal) * side),
            ..Vertex::default()
        };
        for ((set, layout), uvs) in vertex.uvs.iter_mut().zip(&self.wanted.layouts).zip(&self.uvs) {
            let uv = uvs.get(i).map_or(Vec2::ZERO, |&uv| layout.linear * Vec2::from(uv) + layout.offset);
            // In glTF v = 0 is the top row.
            *set = Vec2::new(uv.x, 1.0 - uv.y);
        }
        if let Some(&[x, y, z, w]) = self.tangents.get(i) {
            // A mirror image turns by the other hand.
            vertex.tangent = (Vec3::new(x, y, z) * side).extend(if mirrored { -w } else { w });
        }
        if let Some(&[r, g, b, a]) = self.colours.get(i) {
            let part = |value: f32| (value.clamp(0.0, 1.0) * 65535.0).round() as u16;
            vertex.colour = [part(r), part(g), part(b), if self.wanted.opaque { u16::MAX } else { part(a) }];
        }
        vertex
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
    let vectors = file.vectors(attribute, field).and_then(|vectors| same(file, vectors, vertices, field));
    vectors.unwrap_or_else(|error| {
        file.leave_out(error, "left out", notes);
        Vec::new()
    })
}

/// As many as there are vertices, or a message.
fn same<T>(file: &File, list: Vec<T>, vertices: usize, field: &str) -> Result<Vec<T>, ReadError> {
    let message = || format!("has {} elements, but there are {vertices} positions", list.len());
    if list.len() == vertices { Ok(list) } else { Err(file.refuse(field, message())) }
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
