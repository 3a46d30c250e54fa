//! A step of somebody who walks through the scene: not through walls, and with the eyes so high above whatever is stood on.
//!
//! A few rays against every triangle ([`pick`]): as many as people take steps.

use glam::Vec3;
use scenes::Scene;

use super::pick::pick;

/// Nearer to a wall nobody's eyes come, as a share of their height.
const BODY: f32 = 0.15;
/// A wall that is walked along so nearly is not come nearer to: the cosine.
const GRAZING: f32 = 0.05;
/// What is lower than this share of the eyes' height is stepped over.
const STEP: f32 = 0.3;
/// Along how many walls a step is turned: the two of a corner.
const WALLS: usize = 2;

/// Where the eyes are after a step: `from` where they were, `by` how far people want to go, of which what is level counts,
/// `height` how high they are above the ground (+y is up). Over nothing at all they stay as high as they were.
pub fn step(scene: &Scene, from: Vec3, by: Vec3, height: f32) -> Vec3 {
    let (mut at, mut left) = (from, Vec3::new(by.x, 0.0, by.z));
    for _ in 0..=WALLS {
        let far = left.length();
        let Some(direction) = left.try_normalize() else { break };
        let wall =
            [0.0, 1.0 - STEP].into_iter().filter_map(|down| pick(scene, at - Vec3::Y * (down * height), direction));
        let wall = wall.min_by(|a, b| a.distance.total_cmp(&b.distance));
        let Some(wall) = wall else {
            at += left;
            break;
        };
        let away = Vec3::new(wall.normal.x, 0.0, wall.normal.z).normalize_or_zero();
        let room = (wall.distance - BODY * height / direction.dot(away).abs().max(GRAZING)).clamp(0.0, far);
        at += direction * room;
        // The rest leads along it.
        let rest = direction * (far - room);
        left = rest - away * rest.dot(away);
    }
    match pick(scene, at, Vec3::NEG_Y) {
        Some(ground) => Vec3::new(at.x, ground.point.y + height, at.z),
        None => at,
    }
}

#[cfg(test)]
mod tests {
    use scenes::{Material, Mesh, Object};

    use super::*;

    /// A floor with a low and a high step on it, and walls at x = 3 and z = 3.
    fn scene() -> Scene {
        let mut mesh = Mesh::default();
        let mut add = |corners: [[f32; 3]; 4]| {
            let first = mesh.positions.len() as u32;
            mesh.positions.extend(corners.map(Vec3::from));
            mesh.triangles.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
            mesh.materials.extend([0, 0]);
        };
        add([[-9.0, 0.0, -9.0], [-9.0, 0.0, 9.0], [9.0, 0.0, 9.0], [9.0, 0.0, -9.0]]);
        for (x, high) in [(-2.0, 0.2), (-5.0, 1.0)] {
            add([[x, high, -1.0], [x, high, 1.0], [x - 1.0, high, 1.0], [x - 1.0, high, -1.0]]);
            add([[x, 0.0, -1.0], [x, high, -1.0], [x, high, 1.0], [x, 0.0, 1.0]]);
        }
        add([[3.0, 0.0, -9.0], [3.0, 4.0, -9.0], [3.0, 4.0, 9.0], [3.0, 0.0, 9.0]]);
        add([[-9.0, 0.0, 3.0], [-9.0, 4.0, 3.0], [9.0, 4.0, 3.0], [9.0, 0.0, 3.0]]);
        Scene {
            meshes: vec![mesh.into()],
            objects: vec![Object::fixed("room", 0)],
            materials: vec![Material::diffuse("grey", Vec3::ONE)],
            ..Scene::default()
        }
    }

    #[test]
    fn people_stand_on_floors_and_steps_stop_at_walls_and_slide_along_them() {
        let scene = scene();
        let near = |from: [f32; 3], by: [f32; 3], to: [f32; 3]| {
            let found = step(&scene, from.into(), by.into(), 1.6);
            assert!(found.abs_diff_eq(to.into(), 1e-4), "{from:?} by {by:?}: {found}, not {to:?}");
        };
        near([0.0, 5.0, 0.0], [0.0; 3], [0.0, 1.6, 0.0]);
        near([0.0, 1.6, 0.0], [1.0, -7.0, 0.5], [1.0, 1.6, 0.5]);
        near([-1.5, 1.6, 0.0], [-1.0, 0.0, 0.0], [-2.5, 1.8, 0.0]);
        near([-3.5, 1.6, 0.0], [-2.0, 0.0, 0.0], [-4.76, 1.6, 0.0]);
        near([2.0, 1.6, 0.0], [4.0, 0.0, 0.0], [2.76, 1.6, 0.0]);
        near([2.0, 1.6, 0.0], [4.0, 0.0, 1.0], [2.76, 1.6, 1.0]);
        // Into the corner, and no farther.
        near([2.0, 1.6, 2.0], [9.0, 0.0, 9.0], [2.76, 1.6, 2.76]);
        near([20.0, 3.0, 0.0], [1.0, 0.0, 0.0], [21.0, 3.0, 0.0]);
    }
}
