//! What lies under a point of the picture.
//!
//! One ray against every triangle: a click is rare, and a million triangles take a few hundredths of a second,
//! so the master needs no tree.

use glam::Vec3;
use scenes::{Scene, Transform};

/// What a ray from the eye meets first.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Picked {
    /// Index into [`Scene::objects`].
    pub object: u32,
    /// Index into [`Scene::materials`].
    pub material: u32,
    /// Scene space.
    pub point: Vec3,
    /// Unit normal of the triangle, towards the eye.
    pub normal: Vec3,
    /// From the eye.
    pub distance: f32,
}

/// The first thing that the ray meets; of equally near ones the first in the scene. Holes in
/// materials are not seen.
pub fn pick(scene: &Scene, origin: Vec3, direction: Vec3) -> Option<Picked> {
    let direction = direction.normalize_or_zero();
    let mut best: Option<Picked> = None;
    for (number, object) in scene.objects.iter().enumerate().filter(|(_, object)| object.visible) {
        let mesh = &scene.meshes[object.mesh as usize];
        let from_scene = object.scene_from_object.inverse();
        let (o, d) = (from_scene.point(origin), from_scene.vector(direction));
        for (corners, material) in mesh.triangles.iter().zip(&mesh.materials) {
            let corners = corners.map(|corner| mesh.positions[corner as usize]);
            let Some(distance) = meets(corners, o, d) else { continue };
            if best.is_none_or(|best| distance < best.distance) {
                best = Some(Picked {
                    object: number as u32,
                    material: *material,
                    point: origin + direction * distance,
                    normal: facing(&object.scene_from_object, corners, direction),
                    distance,
                });
            }
        }
    }
    best
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

/// Box around an object, as its least and greatest corner **in object space**; nothing if it is empty.
pub fn bounds(scene: &Scene, object: u32) -> Option<[Vec3; 2]> {
    let mesh = scene.meshes.get(scene.objects.get(object as usize)?.mesh as usize)?;
    mesh.positions.iter().fold(None, |bounds, p| {
        let [least, greatest] = bounds.unwrap_or([*p; 2]);
        Some([least.min(*p), greatest.max(*p)])
    })
}

#[cfg(test)]
mod tests {
    use glam::Mat3;
    use scenes::{Material, Mesh, Object};

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
            meshes: vec![mesh],
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
        scene.objects[0].visible = false;
        let back = look(&scene, 0.0).unwrap();
        assert_eq!((back.object, back.point), (1, Vec3::NEG_Z));
        assert_eq!(pick(&scene, Vec3::ZERO, Vec3::ZERO), None, "no direction, nothing met");
    }

    #[test]
    fn bounds_are_in_object_space() {
        assert_eq!(bounds(&scene(), 1), Some([Vec3::new(-1.0, -1.0, 0.0), Vec3::new(1.0, 1.0, 0.0)]));
        assert_eq!(bounds(&scene(), 2), None);
    }
}
