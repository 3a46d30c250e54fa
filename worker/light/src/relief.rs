//! Normal maps: relief that is finer than the triangles.
//!
//! A texel is a normal along the surface's tangents; the frame is MikkTSpace's (Mikkelsen 2008), from the tangents that the
//! mesh has at its vertices, or else from the triangle's own texture coordinates.
//!
//! Such normals stay on the viewer's side of triangle and surface. Those of facets that face away are leant towards the
//! viewer until they are seen edge-on, instead of turned round as interpolated normals are: these are few, whereas of a
//! relief seen from the side, half the facets face away, and what is turned round is black. On the side of light that
//! means: a facet that faces away from it gets next to nothing.

use glam::{Mat3, Vec3, Vec4};
use scenes::{NormalMap, Place, Scene, texture};

/// Least cosine of a relief's normal and its triangle's: what is steeper is leant.
const STEEPEST: f32 = 0.05;
/// Least cosine of a relief's normal and the direction that it is seen from.
const EDGE_ON: f32 = 1e-3;

/// The normal that a map makes of an interpolated one, on the front side; `None` where it has no direction.
///
/// `smooth` is the unit interpolated normal in scene space, `scene_from_object` turns the mesh's tangents,
/// `edges` are two sides of the triangle in scene space; `mirrored` if the object turns it inside out.
pub fn normal(
    scene: &Scene,
    map: &NormalMap,
    place: &Place,
    smooth: Vec3,
    scene_from_object: &Mat3,
    edges: [Vec3; 2],
    mirrored: bool,
) -> Option<Vec3> {
    let texture = &scene.textures[map.texture as usize];
    let texel = texture::data(texture, place.uv(texture.look_up.set)) * 2.0 - Vec3::ONE;
    let (tangent, side) =
        given(place, scene_from_object, mirrored).or_else(|| own(place, texture.look_up.set, edges, smooth))?;
    let tangent = (tangent - smooth * smooth.dot(tangent)).try_normalize()?;
    let bitangent = smooth.cross(tangent) * side;
    let along = (tangent * texel.x + bitangent * texel.y) * map.scale;
    (along + smooth * texel.z.max(0.0)).try_normalize()
}

/// The tangent of the vertices, in scene space.
fn given(place: &Place, scene_from_object: &Mat3, mirrored: bool) -> Option<(Vec3, f32)> {
    if place.mesh.tangents.is_empty() {
        return None;
    }
    let [a, b, c] = place.mesh.triangles[place.triangle].map(|vertex| place.mesh.tangents[vertex as usize]);
    if a == Vec4::ZERO || b == Vec4::ZERO || c == Vec4::ZERO || a.w != b.w || a.w != c.w {
        return None;
    }
    let tangent = a * place.weights[0] + b * place.weights[1] + c * place.weights[2];
    let side = if mirrored { -a.w } else { a.w };
    Some((*scene_from_object * tangent.truncate(), side))
}

/// The tangent of the triangle alone: where u grows.
fn own(place: &Place, set: u8, [ab, ac]: [Vec3; 2], smooth: Vec3) -> Option<(Vec3, f32)> {
    let [a, b, c] = place.mesh.corner_uvs(place.triangle, set);
    let (b, c) = (b - a, c - a);
    let area = b.perp_dot(c);
    if area == 0.0 {
        return None;
    }
    let (u, v) = ((ab * c.y - ac * b.y) / area, (ac * b.x - ab * c.x) / area);
    Some((u, if smooth.cross(u).dot(v) < 0.0 { -1.0 } else { 1.0 }))
}

/// A relief's normal, on the viewer's side of the triangle's `geometric` and such that `to`, towards the viewer, sees it.
pub fn seen(normal: Vec3, geometric: Vec3, to: Option<Vec3>) -> Vec3 {
    let leant = |normal: Vec3, towards: Vec3, least: f32| {
        let cos = normal.dot(towards);
        if cos >= least { normal } else { (normal + towards * (least - cos)).normalize() }
    };
    let normal = leant(normal, geometric, STEEPEST);
    to.map_or(normal, |to| leant(normal, to, EDGE_ON))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn normals_stay_on_the_side_of_triangle_and_viewer() {
        let to = Vec3::new(0.99, 0.0, 0.1).normalize();
        for (x, z) in [(-1.0, 0.1), (-0.7, 0.7), (1.0, -0.2), (0.0, 1.0), (-1.0, -1.0)] {
            let normal = seen(Vec3::new(x, 0.1, z).normalize(), Vec3::Z, Some(to));
            assert!(normal.z > 0.0 && normal.dot(to) > 0.0, "{x} {z}: {normal}");
        }
        assert_eq!(seen(Vec3::Z, Vec3::Z, Some(to)), Vec3::Z, "what is seen is left alone");
    }
}
