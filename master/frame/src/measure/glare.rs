//! Discomfort glare of a view by CIE 117: UGR = 8 log₁₀(0.25/Lb · Σ L²ω/p²), over the parts of all lamps that are seen.
//!
//! Lamps are what glows in the scene, cut into patches; points, spots and luminaires' webs have no surface, so no luminance,
//! and are none. Whoever asks finds out which patches are seen and how bright they are.

use glam::DVec3;
use scenes::{Scene, SurfacePoint};

use super::Grid;
use super::plan::sheet;

/// A part of a lamp, as large as an eye sees it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Patch {
    /// Its middle.
    pub at: SurfacePoint,
    /// Steradians that it would fill if nothing were before it.
    pub solid_angle: f64,
    /// Guth's position index p.
    pub index: f64,
}

/// A patch is no wider than this share of its distance: two degrees.
const WIDTH: f64 = 0.035;
/// How often a triangle is quartered at most.
const DEPTH_MAX: u32 = 7;
/// Beyond its table, the position index is that of its end.
const INDEX_MAX: f64 = 16.0;
/// Metres that the sheet at the eye is behind it, and half as wide.
const BEHIND: f64 = 1e-3;

/// Every patch that the camera would see of all lamps, within 90° of where it looks, if nothing were before them.
pub fn patches(scene: &Scene) -> Vec<Patch> {
    let eye = scene.camera.origin.as_dvec3();
    let axes = axes(scene);
    let mut patches = Vec::new();
    for (number, object) in scene.objects.iter().enumerate().filter(|(_, object)| object.visible) {
        let mesh = &scene.meshes[object.mesh as usize];
        for triangle in scene.triangles(number) {
            let material = &scene.materials[scene.material_of(number, triangle) as usize];
            if material.emission.is_black() {
                continue;
            }
            let corners = mesh.triangles[triangle]
                .map(|corner| object.scene_from_object.point(mesh.positions[corner as usize]).as_dvec3() - eye);
            let [a, b, c] = corners;
            let back = (b - a).cross(c - a).dot(a) >= 0.0;
            if back && !material.emits_both_sides {
                continue;
            }
            let object = scene.whole_of(number as u32);
            let patch = |uv: [f64; 2], direction: DVec3, solid_angle: f64| {
                let index = position_index(axes, direction)?;
                let uv = uv.map(|share| share as f32);
                let at = SurfacePoint { object, triangle: triangle as u32, uv, back, turned: false };
                Some(Patch { at, solid_angle, index })
            };
            cut(corners, &mut |uv, direction, solid_angle| patches.extend(patch(uv, direction, solid_angle)));
        }
    }
    patches
}

/// To the right, upwards and ahead.
fn axes(scene: &Scene) -> [DVec3; 3] {
    let [right, down, forward] = scene.camera.lens().axes().map(|axis| axis.as_dvec3());
    [right, -down, forward]
}

/// Quarters a triangle around the eye until it is small; tells of each part its middle's coordinates and direction, and its
/// solid angle.
fn cut(corners: [DVec3; 3], tell: &mut dyn FnMut([f64; 2], DVec3, f64)) {
    let [a, b, c] = corners;
    let place = |[u, v]: [f64; 2]| a * (1.0 - u - v) + b * u + c * v;
    let mut open = vec![([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]], 0)];
    while let Some((part, depth)) = open.pop() {
        let [p, q, r]: [[f64; 2]; 3] = part;
        let middle = [0, 1].map(|axis| (p[axis] + q[axis] + r[axis]) / 3.0);
        let [x, y, z] = part.map(place);
        let width = (y - x).length().max((z - y).length()).max((x - z).length());
        if width > WIDTH * place(middle).length() && depth < DEPTH_MAX {
            let half = |one: [f64; 2], other: [f64; 2]| [0, 1].map(|axis| (one[axis] + other[axis]) / 2.0);
            let (pq, qr, rp) = (half(p, q), half(q, r), half(r, p));
            open.extend([[p, pq, rp], [pq, q, qr], [rp, qr, r], [pq, qr, rp]].map(|part| (part, depth + 1)));
        } else {
            tell(middle, place(middle), solid_angle([x, y, z]));
        }
    }
}

/// That of a triangle as seen from 0: van Oosterom & Strackee 1983.
fn solid_angle([a, b, c]: [DVec3; 3]) -> f64 {
    let [x, y, z] = [a, b, c].map(DVec3::length);
    let triple = a.dot(b.cross(c)).abs();
    2.0 * libm::atan2(triple, x * y * z + a.dot(b) * z + b.dot(c) * x + c.dot(a) * y)
}

/// Guth's position index of a direction; `None` behind the eye. Above the line of sight that of CIE 117's table, by the formula
/// of Levin (1975) that fits it; below, where the table has none, that of Iwata & Tokura (1997). 1 straight ahead.
pub fn position_index([right, up, ahead]: [DVec3; 3], direction: DVec3) -> Option<f64> {
    let [x, y, z] = [right, up, ahead].map(|axis| axis.dot(direction));
    if z <= 0.0 {
        return None;
    }
    let across = x.hypot(y);
    let index = if y < 0.0 {
        let ratio = (across / z).min(3.0);
        1.0 + ratio * if ratio > 0.6 { 1.2 } else { 0.8 }
    } else {
        // From straight above the line of sight, and from it, degrees.
        let around = libm::atan2(x.abs(), y).to_degrees();
        let off = libm::atan2(across, z).to_degrees();
        let linear = (35.2 - 0.31889 * around - 1.22 * libm::exp(-2.0 * around / 9.0)) * 1e-3 * off;
        let square = (21.0 + 0.26667 * around - 0.002963 * around * around) * 1e-5 * off * off;
        libm::exp(linear + square)
    };
    Some(index.clamp(1.0, INDEX_MAX))
}

/// UGR of patches, each with its luminance, before a background luminance, both cd/m²; `None` if nothing shines, or nothing is
/// behind it.
pub fn ugr(background: f64, seen: impl IntoIterator<Item = (Patch, f64)>) -> Option<f64> {
    let of = |(patch, luminance): (Patch, f64)| luminance * luminance * patch.solid_angle / (patch.index * patch.index);
    let sum: f64 = seen.into_iter().map(of).sum();
    (sum > 0.0 && background > 0.0).then(|| 8.0 * libm::log10(0.25 / background * sum))
}

/// Puts a sheet of nothing where the eye is, and returns its point, which faces where the camera looks: its indirect
/// illuminance over π is the background luminance. A unit of the scene is `metre` metres.
pub fn at_eye(scene: &mut Scene, metre: f64) -> SurfacePoint {
    let [right, up, ahead] = axes(scene);
    let (behind, side) = (BEHIND / metre, 2.0 * BEHIND / metre);
    let middle = scene.camera.origin.as_dvec3() - ahead * behind;
    let origin = middle - (right + up) * (side / 2.0);
    let grid = Grid { origin, axes: [right, up], sides: [side; 2], counts: [1, 1] };
    sheet(scene, &grid, ahead)[0]
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use glam::Vec3;
    use scenes::{Camera, Colour, Material, Mesh, Object};

    use super::*;

    const AXES: [DVec3; 3] = [DVec3::X, DVec3::Y, DVec3::NEG_Z];

    /// CIE 117, table of position indices: to the side and above, over the distance.
    #[test]
    fn the_index_is_that_of_the_table() {
        for (aside, above, expected) in
            [(0.0, 0.0, 1.0), (0.0, 0.2, 1.53), (0.0, 0.5, 2.86), (0.0, 1.0, 7.0), (0.0, 1.4, 11.7), (1.0, 0.0, 2.11)]
        {
            for side in [-aside, aside] {
                let found = position_index(AXES, DVec3::new(side, above, -1.0)).unwrap();
                assert!((found / expected - 1.0).abs() < 0.04, "{aside} {above}: {found}, not {expected}");
            }
        }
        assert_eq!(position_index(AXES, DVec3::new(0.0, 9.0, -1.0)), Some(INDEX_MAX));
        assert_eq!(position_index(AXES, DVec3::Z), None);
        let below = position_index(AXES, DVec3::new(0.0, -0.5, -1.0)).unwrap();
        assert!((below - 1.4).abs() < 1e-9, "{below}");
    }

    /// A square lamp of 2 s at a place, that faces a way.
    fn lamp(place: Vec3, s: f32, faces: Vec3) -> Scene {
        let side = faces.any_orthonormal_vector();
        let other = faces.cross(side);
        let corner = |[a, b]: [f32; 2]| place + side * (a * s) + other * (b * s);
        let mesh = Mesh {
            positions: [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]].map(corner).to_vec(),
            triangles: vec![[0, 1, 2], [0, 2, 3]],
            materials: vec![0; 2],
            ..Mesh::default()
        };
        let glows = Material { emission: Colour::plain(Vec3::ONE), ..Material::diffuse("lamp", Vec3::ZERO) };
        Scene {
            meshes: vec![Arc::new(mesh)],
            objects: vec![Object::fixed("lamp", 0)],
            materials: vec![glows],
            camera: Camera { origin: Vec3::ZERO, target: Vec3::NEG_Z, ..Camera::default() },
            ..Scene::default()
        }
    }

    /// A rectangle straight ahead: ω = 4 asin(ab / √((a² + d²)(b² + d²))).
    #[test]
    fn patches_fill_the_solid_angle_of_their_lamp() {
        let scene = lamp(Vec3::new(0.0, 0.0, -2.0), 1.5, Vec3::Z);
        let patches = patches(&scene);
        let total: f64 = patches.iter().map(|patch| patch.solid_angle).sum();
        let expected = 4.0 * f64::asin(1.5 * 1.5 / (1.5 * 1.5 + 4.0));
        assert!((total / expected - 1.0).abs() < 1e-6, "{total}, not {expected}");
        assert!(patches.len() > 500 && patches.iter().all(|patch| scene.find_point(&patch.at) == Ok(0)));
    }

    /// A small lamp below a ceiling: ω = A cosθ / d², and its place's index.
    #[test]
    fn of_a_small_lamp_the_rating_is_in_closed_form() {
        let place = Vec3::new(0.5, 1.0, -4.0);
        let seen = patches(&lamp(place, 0.05, Vec3::NEG_Y)).into_iter().map(|patch| (patch, 20_000.0));
        let away = f64::from(place.length());
        let solid_angle = 0.01 * (1.0 / away) / (away * away);
        let index = position_index(AXES, place.as_dvec3()).unwrap();
        let expected = 8.0 * libm::log10(0.25 / 40.0 * 4e8 * solid_angle / (index * index));
        let found = ugr(40.0, seen).unwrap();
        assert!((found - expected).abs() < 0.02, "{found}, not {expected}");
        // From behind, and behind the viewer.
        assert!(patches(&lamp(place, 0.05, Vec3::Y)).is_empty());
        assert!(patches(&lamp(-place, 0.05, Vec3::Y)).is_empty());
        assert_eq!((ugr(40.0, []), ugr(0.0, [])), (None, None));
    }

    #[test]
    fn the_point_at_the_eye_faces_ahead() {
        let mut scene = lamp(Vec3::NEG_Z, 0.5, Vec3::Z);
        scene.camera.target = Vec3::new(3.0, -1.0, 2.0);
        let point = at_eye(&mut scene, 1.0);
        scene.check().unwrap();
        let place = scene.place(&point).unwrap();
        let ahead = scene.camera.target.normalize();
        assert!((place + ahead * 1e-3).length() < 1e-6, "{place}");
        let mesh = &scene.meshes[1];
        let [a, b, c] = mesh.triangles[point.triangle as usize].map(|corner| mesh.positions[corner as usize]);
        let normal = (b - a).cross(c - a).normalize() * if point.back { -1.0 } else { 1.0 };
        assert!(normal.dot(ahead) > 0.999, "{normal}");
    }
}
