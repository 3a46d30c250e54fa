//! From corners to sound meshes: vertices shared, broken triangles dropped and counted.

use std::collections::HashMap;
use std::hash::Hash;

use glam::{DVec3, Vec2, Vec3};

use crate::Mesh;
use crate::check::is_degenerate;

/// A corner of a triangle with its attributes.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Vertex {
    pub position: Vec3,
    /// Any length; zero or not finite: flat.
    pub normal: Vec3,
    pub uv: Vec2,
}

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
    seen: HashMap<K, u32>,
    /// Normals and texture coordinates that were no numbers, or normals of no length.
    pub repaired: u64,
}

impl<K: Hash + Eq> Default for MeshBuilder<K> {
    fn default() -> Self {
        Self { mesh: Mesh::default(), seen: HashMap::new(), repaired: 0 }
    }
}

impl<K: Hash + Eq> MeshBuilder<K> {
    /// Adds a triangle, unless it is none.
    pub fn triangle(&mut self, corners: [(K, Vertex); 3], material: u32) -> Added {
        let [a, b, c] = [&corners[0], &corners[1], &corners[2]].map(|(_, vertex)| vertex.position);
        if !(a.is_finite() && b.is_finite() && c.is_finite()) {
            return Added::NotFinite;
        }
        if is_degenerate(a, b, c) {
            return Added::Degenerate;
        }
        let triangle = corners.map(|(key, vertex)| self.vertex(key, vertex));
        self.mesh.triangles.push(triangle);
        self.mesh.materials.push(material);
        Added::Yes
    }

    fn vertex(&mut self, key: K, vertex: Vertex) -> u32 {
        let (mesh, repaired) = (&mut self.mesh, &mut self.repaired);
        *self.seen.entry(key).or_insert_with(|| {
            let uv = if vertex.uv.is_finite() { vertex.uv } else { Vec2::ZERO };
            let normal = unit_or_zero(vertex.normal);
            let broken = !vertex.uv.is_finite() || (normal == Vec3::ZERO && vertex.normal != Vec3::ZERO);
            *repaired += u64::from(broken);
            mesh.positions.push(vertex.position);
            mesh.normals.push(normal);
            mesh.uvs.push(uv);
            (mesh.positions.len() - 1) as u32
        })
    }

    /// The mesh, without attributes that nobody has or looks at.
    pub fn finish(self, textured: bool) -> Mesh {
        let mut mesh = self.mesh;
        if mesh.normals.iter().all(|normal| *normal == Vec3::ZERO) {
            mesh.normals = Vec::new();
        }
        if !textured {
            mesh.uvs = Vec::new();
        }
        mesh
    }
}

/// Unit length, computed so that no finite input overflows; zero for what has no direction.
fn unit_or_zero(v: Vec3) -> Vec3 {
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
