//! What lies under a point of the picture.
//!
//! One ray against every triangle: a click is rare, and a million triangles take a few hundredths of a second,
//! so the master needs no tree.

use glam::Vec3;
use scenes::{Scene, Transform};

/// What a ray from the eye meets first.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Picked {
    /// Index into [`Scene::objects`], of what the file keeps apart.
    pub object: u32,
    /// Which of its mesh's [`scenes::Pieces`]; `None` if there is only one.
    pub piece: Option<u32>,
    /// The object is the better part of the scene: a room rather than a chair, so that people mean the piece.
    pub is_room: bool,
    /// Index into [`Scene::materials`].
    pub material: u32,
    /// Scene space.
    pub point: Vec3,
    /// Unit normal of the triangle, towards the eye.
    pub normal: Vec3,
    /// From the eye.
    pub distance: f32,
}

/// An object whose box's diagonal is more than this share of that of everything is a room.
const ROOM: f32 = 0.5;

/// The first thing that the ray meets; of equally near ones the first in the scene. Holes in
/// materials, and whether they are there by half, are not seen; what is nowhere at all is passed.
pub fn pick(scene: &Scene, origin: Vec3, direction: Vec3) -> Option<Picked> {
    let direction = direction.normalize_or_zero();
    let mut best: Option<(Picked, usize)> = None;
    for (number, object) in scene.objects.iter().enumerate().filter(|(_, object)| object.visible) {
        let mesh = &scene.meshes[object.mesh as usize];
        let from_scene = object.scene_from_object.inverse();
        let (o, d) = (from_scene.point(origin), from_scene.vector(direction));
        for triangle in scene.triangles(number) {
            let coverage = &scene.materials[scene.material_of(number, triangle) as usize].coverage;
            if coverage.is_some_and(|coverage| coverage.of(1.0) == 0.0) {
                continue;
            }
            let corners = mesh.triangles[triangle].map(|corner| mesh.positions[corner as usize]);
            let Some(distance) = meets(corners, o, d) else { continue };
            if best.is_none_or(|(best, _)| distance < best.distance) {
                let picked = Picked {
                    object: object.lifted.as_ref().map_or(number as u32, |lifted| lifted.of),
                    piece: None,
                    is_room: false,
                    material: mesh.materials[triangle],
                    point: origin + direction * distance,
                    normal: facing(&object.scene_from_object, corners, direction),
                    distance,
                };
                best = Some((picked, triangle));
            }
        }
    }
    let (mut picked, triangle) = best?;
    let pieces = scene.meshes[scene.objects[picked.object as usize].mesh as usize].pieces();
    if pieces.count() > 1 {
        picked.piece = Some(pieces.of_triangle(triangle));
        picked.is_room = is_room(scene, picked.object);
    }
    Some(picked)
}

fn is_room(scene: &Scene, object: u32) -> bool {
    let diagonal = |objects: &mut dyn Iterator<Item = u32>| {
        let corners = objects.filter_map(|object| corners(scene, object)).flatten();
        let (least, greatest) = corners.fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(a, b), p| (a.min(p), b.max(p)));
        least.distance(greatest)
    };
    let all = diagonal(&mut (0..scene.wholes() as u32).filter(|whole| scene.objects[*whole as usize].visible));
    diagonal(&mut std::iter::once(object)) > ROOM * all
}

/// Of an object's box, scene space.
fn corners(scene: &Scene, object: u32) -> Option<[Vec3; 8]> {
    let [low, high] = bounds(scene, object)?;
    let place = scene.objects[object as usize].scene_from_object;
    let corner = |i: usize| {
        let side = |axis: usize| if i >> axis & 1 == 1 { high[axis] } else { low[axis] };
        place.point(Vec3::new(side(0), side(1), side(2)))
    };
    Some(std::array::from_fn(corner))
}

/// Where a ray meets a triangle (Möller and Trumbore 1997), in units of its direction.
fn meets([a, b, c]: [Vec3; 3], origin: Vec3, direction: Vec3) -> Option<f32> {
    let (ab, ac) = (b - a, c - a);
    let p = direction.cross(ac);
    let determinant = ab.dot(p);
    if determinant == 0.0 {
        return None;
    }
    let from = origin - a;
    let u = from.dot(p) / determinant;
    let q = from.cross(ab);
    let v = direction.dot(q) / determinant;
    let t = ac.dot(q) / determinant;
    (u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t > 0.0 && t.is_finite()).then_some(t)
}

fn facing(scene_from_object: &Transform, corners: [Vec3; 3], direction: Vec3) -> Vec3 {
    let [a, b, c] = corners.map(|corner| scene_from_object.point(corner));
    let normal = (b - a).cross(c - a).normalize_or_zero();
    if normal.dot(direction) > 0.0 { -normal } else { normal }
}

/// Box around an object, as its least and greatest corner **in object space**; `None` if it is empty.
pub fn bounds(scene: &Scene, object: u32) -> Option<[Vec3; 2]> {
    let mesh = scene.meshes.get(scene.objects.get(object as usize)?.mesh as usize)?;
    around(mesh.positions.iter().copied())
}

/// Box around a piece of an object, as [`bounds`].
pub fn bounds_of_piece(scene: &Scene, object: u32, piece: u32) -> Option<[Vec3; 2]> {
    let mesh = scene.meshes.get(scene.objects.get(object as usize)?.mesh as usize)?;
    let vertices = mesh.pieces().triangles(piece).iter().flat_map(|triangle| mesh.triangles[*triangle as usize]);
    around(vertices.map(|vertex| mesh.positions[vertex as usize]))
}

fn around(points: impl Iterator<Item = Vec3>) -> Option<[Vec3; 2]> {
    points.fold(None, |bounds, p| {
        let [least, greatest] = bounds.unwrap_or([p; 2]);
        Some([least.min(p), greatest.max(p)])
    })
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use glam::Mat3;
    use scenes::{Coverage, Material, Mesh, Object};

    use super::*;

    /// A triangle at z = 0 as object 0, and the same behind it, twice as large, as object 1.
    fn scene() -> Scene {
        let mesh = Mesh {
            positions: vec![Vec3::new(-1.0, -1.0, 0.0), Vec3::new(1.0, -1.0, 0.0), Vec3::new(0.0, 1.0, 0.0)],
            triangles: vec![[0, 1, 2]],
            materials: vec![0],
            ..Mesh::default()
        };
        let behind = Transform { linear: Mat3::from_diagonal(Vec3::splat(2.0)), translation: Vec3::NEG_Z };
        let objects = vec![Object::fixed("front", 0), Object { scene_from_object: behind, ..Object::fixed("back", 0) }];
        Scene {
            meshes: vec![mesh.into()],
            objects,
            materials: vec![Material::diffuse("white", Vec3::ONE)],
            ..Scene::default()
        }
    }

    #[test]
    fn the_nearest_visible_object_is_picked() {
        let mut scene = scene();
        let look = |scene: &Scene, x: f32| pick(scene, Vec3::new(x, 0.0, 3.0), Vec3::new(0.0, 0.0, -2.0));
        let front = look(&scene, 0.0).unwrap();
        assert_eq!((front.object, front.distance, front.normal), (0, 3.0, Vec3::Z));
        assert_eq!(look(&scene, 0.9).unwrap().object, 1, "past the small one");
        assert_eq!(look(&scene, 5.0), None);
        scene.materials.push(Material { coverage: Some(Coverage::plain(0.1)), ..scene.materials[0].clone() });
        Arc::make_mut(&mut scene.meshes[0]).materials[0] = 1;
        assert_eq!(look(&scene, 0.0).unwrap().object, 0, "thin as it is");
        Arc::make_mut(&mut scene.meshes[0]).materials[0] = 0;
        scene.objects[0].visible = false;
        let back = look(&scene, 0.0).unwrap();
        assert_eq!((back.object, back.point), (1, Vec3::NEG_Z));
        assert_eq!(pick(&scene, Vec3::ZERO, Vec3::ZERO), None, "no direction, nothing met");
        scene.materials[0].coverage = Some(Coverage::plain(0.0));
        assert_eq!(look(&scene, 0.0), None, "nothing is there");
    }

    #[test]
    fn a_room_is_picked_piece_by_piece_and_a_thing_as_a_whole() {
        let mut scene = scene();
        // A second triangle far away in the same mesh: two pieces, in both objects.
        let far = [Vec3::X * 50.0, Vec3::X * 51.0, Vec3::new(50.0, 1.0, 0.0)];
        let mesh = Arc::make_mut(&mut scene.meshes[0]);
        mesh.positions.extend(far);
        mesh.triangles.push([3, 4, 5]);
        mesh.materials.push(0);
        scene.objects[1].scene_from_object.linear = Mat3::from_diagonal(Vec3::splat(3.0));
        let look = |scene: &Scene, x: f32| {
            let picked = pick(scene, Vec3::new(x, 0.2, 3.0), Vec3::NEG_Z)?;
            Some((picked.object, picked.piece, picked.is_room))
        };
        assert_eq!(look(&scene, 0.0), Some((0, Some(0), false)), "less than half of what the other makes of it");
        assert_eq!(look(&scene, 50.3), Some((0, Some(1), false)));
        scene.objects[0].visible = false;
        assert_eq!(look(&scene, 0.0), Some((1, Some(0), true)));
        // Where it is lifted to, it is still a piece of its whole.
        let whole_from_piece = Transform { translation: Vec3::X * 5.0, ..Transform::IDENTITY };
        scenes::Change::PieceTransform { object: 1, piece: 0, whole_from_piece }.apply(&mut scene).unwrap();
        assert_eq!(look(&scene, 0.0), None);
        assert_eq!(look(&scene, 15.0), Some((1, Some(0), true)));
        assert_eq!(bounds_of_piece(&scene, 1, 1), Some([far[0], Vec3::new(51.0, 1.0, 0.0)]));
    }

    #[test]
    fn bounds_are_in_object_space() {
        assert_eq!(bounds(&scene(), 1), Some([Vec3::new(-1.0, -1.0, 0.0), Vec3::new(1.0, 1.0, 0.0)]));
        assert_eq!(bounds(&scene(), 2), None);
    }
}
