//! From corners to sound meshes: vertices shared, broken triangles dropped and counted.

use std::collections::HashMap;
use std::hash::Hash;

use foldhash::fast::RandomState;
use glam::{DVec3, Vec2, Vec3, Vec4};

use super::tangents::Tangents;
use crate::check::is_degenerate;
use crate::{Mesh, SETS_MAX};

/// A corner of a triangle with its attributes.
#[derive(Clone, Copy, Debug)]
pub(super) struct Vertex {
    pub position: Vec3,
    /// Any length; zero or not finite: flat.
    pub normal: Vec3,
    /// Of each set.
    pub uvs: [Vec2; SETS_MAX],
    /// As [`Mesh::colours`].
    pub colour: [u16; 4],
    /// As [`Mesh::tangents`]; zero: to be found.
    pub tangent: Vec4,
}

impl Default for Vertex {
    fn default() -> Self {
        let (position, normal, uvs) = (Vec3::ZERO, Vec3::ZERO, [Vec2::ZERO; SETS_MAX]);
        Self { position, normal, uvs, colour: WHITE, tangent: Vec4::ZERO }
    }
}

/// What changes no colour.
pub(super) const WHITE: [u16; 4] = [u16::MAX; 4];

/// What became of a triangle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Added {
    Yes,
    /// Repeated corners or no area.
    Degenerate,
    /// A position that is no number.
    NotFinite,
}

/// A mesh that grows. Vertices with equal keys are stored once, in order of first use.
pub(super) struct MeshBuilder<K> {
    mesh: Mesh,
    seen: HashMap<(K, i8), u32, RandomState>,
    tangents: Tangents,
    /// Sets of texture coordinates that somebody looks at.
    sets: usize,
    /// Normals and texture coordinates that were no numbers, or normals of no length.
    pub repaired: u64,
}

impl<K: Hash + Eq> Default for MeshBuilder<K> {
    fn default() -> Self {
        let mesh = Mesh { more_uvs: vec![Vec::new(); SETS_MAX - 1], ..Mesh::default() };
        Self { mesh, seen: HashMap::default(), tangents: Tangents::default(), sets: 0, repaired: 0 }
    }
}

impl<K: Hash + Eq> MeshBuilder<K> {
    /// The first so many sets of texture coordinates are looked at.
    pub fn use_sets(&mut self, sets: usize) {
        self.sets = self.sets.max(sets);
    }

    /// Adds a triangle, unless it is none. `relief` is the set of texture coordinates that its normal map lies by.
    pub fn triangle(&mut self, corners: [(K, Vertex); 3], material: u32, relief: Option<usize>) -> Added {
        let vertices = [&corners[0], &corners[1], &corners[2]].map(|(_, vertex)| *vertex);
        let [a, b, c] = vertices.map(|vertex| vertex.position);
        if !(a.is_finite() && b.is_finite() && c.is_finite()) {
            return Added::NotFinite;
        }
        if is_degenerate(a, b, c) {
            return Added::Degenerate;
        }
        // Where the picture of a normal map is mirrored, vertices are not shared with where it is not.
        let side = relief.map_or(0, |set| super::tangents::side(&vertices, set));
        let triangle = corners.map(|(key, vertex)| self.vertex((key, side), vertex));
        if let Some(set) = relief {
            self.tangents.add(triangle, &vertices, set, side);
        }
        self.mesh.triangles.push(triangle);
        self.mesh.materials.push(material);
        Added::Yes
    }

    fn vertex(&mut self, key: (K, i8), vertex: Vertex) -> u32 {
        let (mesh, repaired) = (&mut self.mesh, &mut self.repaired);
        *self.seen.entry(key).or_insert_with(|| {
            let uvs = vertex.uvs.map(|uv| if uv.is_finite() { uv } else { Vec2::ZERO });
            let normal = unit_or_zero(vertex.normal);
            let broken = uvs != vertex.uvs || (normal == Vec3::ZERO && vertex.normal != Vec3::ZERO);
            *repaired += u64::from(broken);
            mesh.positions.push(vertex.position);
            mesh.normals.push(normal);
            let at = mesh.positions.len() - 1;
            push(&mut mesh.colours, at, vertex.colour, WHITE);
            push(&mut mesh.uvs, at, uvs[0], Vec2::ZERO);
            mesh.more_uvs.iter_mut().zip(&uvs[1..]).for_each(|(list, uv)| push(list, at, *uv, Vec2::ZERO));
            at as u32
        })
    }

    /// The mesh, without attributes that nobody has or looks at.
    pub fn finish(self) -> Mesh {
        let mut mesh = self.mesh;
        mesh.tangents = self.tangents.finish(&mesh.normals);
        if mesh.normals.iter().all(|normal| *normal == Vec3::ZERO) {
            mesh.normals = Vec::new();
        }
        mesh.more_uvs.truncate(self.sets.saturating_sub(1));
        let vertices = mesh.positions.len();
        for list in std::iter::once(&mut mesh.uvs).chain(&mut mesh.more_uvs).take(self.sets) {
            list.resize(vertices, Vec2::ZERO);
        }
        if self.sets == 0 {
            mesh.uvs = Vec::new();
        }
        if !mesh.colours.is_empty() {
            mesh.colours.resize(vertices, WHITE);
        }
        mesh
    }
}

/// Appends what stands at an index. A list begins with the first value that is not the usual one: most never do.
fn push<T: Clone + PartialEq>(list: &mut Vec<T>, at: usize, value: T, usual: T) {
    if value != usual {
        list.resize(at, usual);
        list.push(value);
    }
}

/// Unit length, computed so that no finite input overflows; zero for what has no direction.
pub(super) fn unit_or_zero(v: Vec3) -> Vec3 {
    let wide = v.as_dvec3();
    let length = wide.length();
    if length > 0.0 && length.is_finite() { (wide / length).as_vec3() } else { Vec3::ZERO }
}

/// A box that grows.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bounds {
    pub min: DVec3,
    pub max: DVec3,
}

impl Default for Bounds {
    fn default() -> Self {
        Self { min: DVec3::INFINITY, max: DVec3::NEG_INFINITY }
    }
}

impl Bounds {
    /// Includes a point, unless it is no point.
    pub fn add(&mut self, p: DVec3) {
        if p.is_finite() {
            self.min = self.min.min(p);
            self.max = self.max.max(p);
        }
    }

    /// Nothing was added.
    pub fn is_empty(&self) -> bool {
        self.min.x > self.max.x
    }

    /// Length of the diagonal.
    pub fn diameter(&self) -> f64 {
        if self.is_empty() { 0.0 } else { (self.max - self.min).length() }
    }

    /// Middle of the box.
    pub fn middle(&self) -> DVec3 {
        if self.is_empty() { DVec3::ZERO } else { self.min + (self.max - self.min) * 0.5 }
    }

    /// Where scene space gets its origin, see [`crate::Scene::centre`].
    pub fn centre(&self) -> DVec3 {
        let middle = self.middle();
        let near = middle.abs().max_element() <= CENTRE_DIAMETERS * self.diameter();
        let rounded = middle.as_vec3().as_dvec3();
        if near || !rounded.is_finite() { DVec3::ZERO } else { rounded }
    }
}

/// A scene whose middle is within so many diameters of the file's origin is left where it is:
/// `f32` then resolves a millionth of its size, and the picture does not depend on a subtraction.
const CENTRE_DIAMETERS: f64 = 4.0;
