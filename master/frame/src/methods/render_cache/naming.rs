//! Names for points of still pictures. Those know only how far a pixel sees; before something moves, the points on it get to
//! know what they are points of, so that they can go with it.

use glam::Vec3;
use scenes::camera::Lens;
use scenes::{Change, Mesh, Scene, SurfacePoint, Transform};

use super::point::Place;
use super::points::Points;
use super::project::{NONE, PointImage};

/// How an object stood.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pose {
    whole: u32,
    piece: Option<u32>,
    mesh: u32,
    scene_from_object: Transform,
}

/// How all objects stand.
pub(super) fn poses(scene: &Scene) -> Vec<Pose> {
    let pose = |(number, object): (u32, &scenes::Object)| Pose {
        whole: scene.whole_of(number),
        piece: object.lifted.as_ref().map(|lifted| lifted.piece),
        mesh: object.mesh,
        scene_from_object: object.scene_from_object,
    };
    (0..).zip(&scene.objects).map(pose).collect()
}

/// The whole objects that a change moves, shows or hides.
pub(super) fn moved(scene: &Scene, change: &Change) -> Vec<u32> {
    match change {
        Change::Transform { object, .. }
        | Change::Visible { object, .. }
        | Change::Offset { object, .. }
        | Change::PieceTransform { object, .. }
        | Change::PieceVisible { object, .. } => vec![*object],
        Change::Time(_) => {
            let moves = (0..).zip(&scene.objects).filter(|(_, object)| object.motion.is_some());
            moves.map(|(number, _)| number).collect()
        }
        Change::Camera(_)
        | Change::Light { .. }
        | Change::Lamp { .. }
        | Change::Environment(_)
        | Change::Material { .. }
        | Change::OwnMaterial { .. }
        | Change::Solid { .. } => Vec::new(),
    }
}

/// A point lies on a triangle if it is no farther from it than this share of its distance from the eye.
const SAME_DISTANCE: f32 = 0.01;
/// What is left over within the box of what moves is gone, but for this share of its size at each side: it stands on
/// something.
const MARGIN: f32 = 0.01;

/// Names the points that lie on what a change moves, as it stood before, and removes those that lie between. `image` and
/// `lens` are of the last picture.
pub(super) fn name(
    points: &mut Points,
    (image, lens): (&PointImage, &Lens),
    poses: &[Pose],
    scene: &Scene,
    change: &Change,
) {
    for whole in moved(scene, change) {
        let only = match change {
            Change::PieceTransform { piece, .. } | Change::PieceVisible { piece, .. } => Some(*piece),
            _ => None,
        };
        let own: Vec<&Pose> = poses.iter().filter(|pose| pose.whole == whole).collect();
        let Some(rest) = own.iter().find(|pose| pose.piece.is_none()) else { continue };
        let pieces = own.iter().filter_map(|pose| Some((pose.piece?, pose.scene_from_object)));
        let lifted: Vec<(u32, Transform)> = pieces.collect();
        let Some(mesh) = scene.meshes.get(rest.mesh as usize) else { continue };
        let stood = |piece: u32| lifted.iter().find(|(lifted, _)| *lifted == piece).map(|(_, stood)| *stood);
        let triangles: Vec<(usize, Transform)> = match only {
            Some(piece) => {
                let stood = stood(piece).unwrap_or(rest.scene_from_object);
                mesh.pieces().triangles(piece).iter().map(|triangle| (*triangle as usize, stood)).collect()
            }
            None if lifted.is_empty() => {
                (0..mesh.triangles.len()).map(|triangle| (triangle, rest.scene_from_object)).collect()
            }
            None => (0..mesh.triangles.len())
                .map(|triangle| {
                    (triangle, stood(mesh.pieces().of_triangle(triangle)).unwrap_or(rest.scene_from_object))
                })
                .collect(),
        };
        let (mut low, mut high) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
        for (triangle, scene_from_object) in triangles {
            let corners = corners(mesh, triangle, &scene_from_object);
            (low, high) = corners.iter().fold((low, high), |(low, high), at| (low.min(*at), high.max(*at)));
            name_triangle(points, image, lens, (whole, triangle as u32), corners);
        }
        let margin = (high - low) * MARGIN;
        points.remove_nameless(|at| at.cmpgt(low + margin).all() && at.cmplt(high - margin).all());
    }
}

fn corners(mesh: &Mesh, triangle: usize, scene_from_object: &Transform) -> [Vec3; 3] {
    mesh.triangles[triangle].map(|vertex| scene_from_object.point(mesh.positions[vertex as usize]))
}

fn name_triangle(
    points: &mut Points,
    image: &PointImage,
    lens: &Lens,
    (object, triangle): (u32, u32),
    [a, b, c]: [Vec3; 3],
) {
    let (width, height) = (image.width, image.height);
    let seen: Vec<(f32, f32, f32)> = [a, b, c].iter().filter_map(|corner| lens.project(*corner)).collect();
    let [columns, rows] = match seen[..] {
        [] => return,
        // Partly behind the eye: it may be seen anywhere.
        [_] | [_, _] => [0..width, 0..height],
        _ => {
            let range = |along: &dyn Fn(&(f32, f32, f32)) -> f32, side: usize| {
                let low = seen.iter().map(along).fold(f32::INFINITY, f32::min);
                let high = seen.iter().map(along).fold(f32::NEG_INFINITY, f32::max);
                // Points lie anywhere in their pixels. Casts saturate.
                (low - 1.0) as usize..((high + 2.0) as usize).min(side)
            };
            [range(&|seen| seen.0, width), range(&|seen| seen.1, height)]
        }
    };
    let eye = lens.origin();
    let (ab, ac) = (b - a, c - a);
    for pixel in rows.flat_map(|y| columns.clone().map(move |x| y * width + x)) {
        let slot = image.slots[pixel];
        if slot == NONE || points.name(slot).is_some() {
            continue;
        }
        let Some(Place::Near(point)) = points.place(slot) else { continue };
        // Möller and Trumbore, along the line from the eye through the point, which lies at 1.
        let ray = point - eye;
        let across = ray.cross(ac);
        let determinant = ab.dot(across);
        let offset = eye - a;
        let u = offset.dot(across) / determinant;
        let turned = offset.cross(ab);
        let v = ray.dot(turned) / determinant;
        let t = ac.dot(turned) / determinant;
        // Also false of numbers that are none.
        if u >= 0.0 && v >= 0.0 && u + v <= 1.0 && (t - 1.0).abs() <= SAME_DISTANCE {
            let back = ray.dot(ab.cross(ac)) > 0.0;
            let name = SurfacePoint { object, triangle, uv: [u, v], back, turned: false };
            points.set_name(slot, name);
        }
    }
}

#[cfg(test)]
mod tests {
    use scenes::{Camera, Material, Object};

    use super::super::point::Known;
    use super::*;

    /// A box of two squares, one behind the other, before a wall.
    fn scene() -> Scene {
        let square = |side: f32, z: f32| {
            [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]].map(|[x, y]| Vec3::new(x * side, y * side, z))
        };
        let triangles = [[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]];
        let mesh = |positions: Vec<Vec3>| Mesh {
            triangles: triangles[..positions.len() / 2].to_vec(),
            materials: vec![0; positions.len() / 2],
            positions,
            ..Mesh::default()
        };
        let both = [square(0.3, 1.0), square(0.3, 0.6)].concat();
        Scene {
            meshes: vec![mesh(square(20.0, 0.0).to_vec()).into(), mesh(both).into()],
            objects: vec![Object::fixed("wall", 0), Object::fixed("box", 1)],
            materials: vec![Material::diffuse("grey", Vec3::splat(0.5))],
            ..Scene::default()
        }
    }

    #[test]
    fn what_lies_on_a_thing_that_is_moved_gets_its_name_and_nothing_else_does() {
        let mut scene = scene();
        let camera = Camera { width: 32, height: 24, ..Camera::default() };
        let lens = camera.lens();
        let mut points = Points::new(32 * 24);
        let known = Known::default();
        let is_on_box = |x: f32, y: f32| x.abs() < 0.3 && y.abs() < 0.3;
        let (mut on_box, mut between) = (0, 0);
        for pixel in 0..32 * 24 {
            let direction = lens.direction((pixel % 32) as f32 + 0.5, (pixel / 32) as f32 + 0.5);
            let at = |z: f32| lens.origin() + direction * ((z - 3.0) / direction.z);
            let z = if is_on_box(at(1.0).x, at(1.0).y) { 1.0 } else { 0.0 };
            // One pixel in the middle of the box is a mean of near and far.
            let is_between = pixel == 12 * 32 + 16;
            on_box += usize::from(z == 1.0 && !is_between);
            between += usize::from(is_between);
            points.insert(Place::Near(at(if is_between { 0.8 } else { z })), known);
        }
        assert!(on_box > 20 && between == 1);
        let mut image = PointImage::default();
        image.clear([32, 24]);
        image.project(&mut points, &camera);
        let poses = poses(&scene);
        let scene_from_object = Transform { translation: Vec3::X, ..Transform::IDENTITY };
        let change = Change::Transform { object: 1, scene_from_object };
        change.apply(&mut scene).unwrap();
        name(&mut points, (&image, &lens), &poses, &scene, &change);
        let named: Vec<(Vec3, SurfacePoint)> = (0..points.len() as u32)
            .filter_map(|slot| match (points.place(slot), points.name(slot)) {
                (Some(Place::Near(at)), Some(name)) => Some((at, name)),
                _ => None,
            })
            .collect();
        assert_eq!(named.len(), on_box);
        for (at, name) in named {
            assert!(name.object == 1 && name.triangle < 2 && at.z > 0.99, "{at} {name:?}");
            // Where it is now is where it was, and the way of the box.
            assert!((scene.place(&name).unwrap() - at - Vec3::X).length() < 1e-4);
        }
        assert_eq!(points.all().len(), 32 * 24 - between, "what lay between is gone");
    }
}
