//! Binary PLY, as Mitsuba reads it.

use std::collections::BTreeMap;

use glam::{Mat3, Vec2, Vec3};
use scenes::{Mesh, Transform};

/// Triangles of a mesh that share a material and a kind of shading.
pub struct Part<'a> {
    /// Where they are from.
    pub mesh: &'a Mesh,
    /// Which ones.
    pub triangles: Vec<usize>,
    /// With the mesh's normals, all of which are there; else flat.
    pub smooth: bool,
    /// With texture coordinates.
    pub textured: bool,
}

/// The bytes of a file, in scene space.
pub fn encode(part: &Part, scene_from_object: &Transform) -> Vec<u8> {
    let Part { mesh, triangles, smooth, textured } = part;
    let mirrored = scene_from_object.linear.determinant() < 0.0;
    // Vertices that are used, in the order in which they are met.
    let mut numbers = BTreeMap::new();
    let mut used = Vec::new();
    let mut faces = Vec::with_capacity(triangles.len() * 13);
    for triangle in triangles {
        let mut corners = mesh.triangles[*triangle].map(|vertex| {
            *numbers.entry(vertex).or_insert_with(|| {
                used.push(vertex as usize);
                used.len() as u32 - 1
            })
        });
        // A mirrored object keeps its outside.
        if mirrored {
            corners.swap(1, 2);
        }
        faces.push(3);
        faces.extend(corners.into_iter().flat_map(u32::to_le_bytes));
    }

    let mut names = vec!["x", "y", "z"];
    names.extend(if *smooth { &["nx", "ny", "nz"][..] } else { &[] });
    names.extend(if *textured { &["u", "v"][..] } else { &[] });
    let properties: String = names.iter().map(|name| format!("property float {name}\n")).collect();
    let mut bytes = format!(
        "ply\nformat binary_little_endian 1.0\nelement vertex {}\n{properties}element face {}\n\
         property list uchar int vertex_indices\nend_header\n",
        used.len(),
        triangles.len()
    )
    .into_bytes();
    let turn = normal_map(&scene_from_object.linear);
    for vertex in used {
        let mut put = |values: &[f32]| bytes.extend(values.iter().flat_map(|value| value.to_le_bytes()));
        put(&scene_from_object.point(mesh.positions[vertex]).to_array());
        if *smooth {
            put(&(turn * mesh.normals[vertex]).normalize_or(Vec3::Z).to_array());
        }
        if *textured {
            // Their images begin at the top, ours end there.
            let Vec2 { x: u, y: v } = mesh.uvs[vertex];
            put(&[u, 1.0 - v]);
        }
    }
    bytes.extend(faces);
    bytes
}

/// What normals go through when points go through `linear`.
fn normal_map(linear: &Mat3) -> Mat3 {
    linear.inverse().transpose()
}
