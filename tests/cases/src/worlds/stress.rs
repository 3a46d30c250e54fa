//! Scenes at the edge: rows 20, 23, 25, 26, 31, 35.

use std::fmt::Write;
use std::sync::Arc;

use glam::Vec3;
use scenes::{Light, Scene};

use super::build::Build;

/// Row 20: two walls that meet, seen so closely that virtual lights lie on the very points they
/// light. All pixels must be finite and not negative.
pub fn touching_corner() -> Scene {
    let mut build = Build::new("touching corner");
    let (wall, emitter) = (build.paint(0.8, 0.0), build.paint(0.8, 1.0));
    build.quad(Vec3::ZERO, Vec3::Z, Vec3::X, wall);
    build.quad(Vec3::new(-1.0, 1.0, 0.0), Vec3::Y, Vec3::Z, emitter);
    build.seen(Vec3::new(-0.999, 0.001, 0.0), Vec3::new(-1.0, 0.0, 0.0), 60.0, 32)
}

/// Row 23: lengths times s, powers times s²: the picture is the same, and with s a power of two it
/// is the same in every bit.
pub fn scaled(scene: &Scene, s: f32) -> Scene {
    let mut scene = scene.clone();
    scene.centre *= f64::from(s);
    scene.camera.origin *= s;
    scene.camera.target *= s;
    scene.meshes.iter_mut().flat_map(|mesh| &mut Arc::make_mut(mesh).positions).for_each(|p| *p *= s);
    for object in &mut scene.objects {
        object.scene_from_object.translation *= s;
        if let Some(motion) = &mut object.motion {
            motion.pivot *= s;
            motion.keys.iter_mut().for_each(|key| key.translate *= s);
            motion.poses.iter_mut().for_each(|pose| pose.place.translation *= s);
        }
    }
    for light in &mut scene.lights {
        match light {
            Light::Point { position, intensity }
            | Light::Spot { position, intensity, .. }
            | Light::Luminaire { position, intensity, .. } => {
                *position *= s;
                *intensity *= s * s;
            }
            Light::Directional { .. } => {}
        }
    }
    scene
}

/// Row 25: the same room as OBJ text, clean and with broken triangles strewn in; both must load to
/// the same geometry, the second with a count of what was dropped.
pub fn obj_with_broken_triangles() -> [String; 2] {
    let mut clean = String::from("v -1 0 -1\nv 1 0 -1\nv 1 0 1\nv -1 0 1\nv 0 1 0\nv nan 0 0\nv 2 0 -1\n");
    let mut broken = clean.clone();
    for (face, junk) in ["1 3 2", "1 4 3", "1 2 5", "2 3 5"].iter().zip(["1 1 2", "1 2 7", "1 2 6", "5 5 5"]) {
        let _ = writeln!(clean, "f {face}");
        let _ = writeln!(broken, "f {junk}\nf {face}");
    }
    [clean, broken]
}

/// Row 25: a unit square in z = 0, radiance 1, and the same square cut into needles of a million to
/// one along its diagonal. Both look alike, without a hole.
pub fn needles() -> [Scene; 2] {
    let corners = [Vec3::ZERO, Vec3::X, Vec3::new(1.0, 1.0, 0.0), Vec3::Y];
    [false, true].map(|cut| {
        let mut build = Build::new("needles");
        let emitter = build.paint(0.0, 1.0);
        if cut {
            let near = Vec3::new(0.500_000_5, 0.499_999_5, 0.0);
            build.triangle([corners[0], corners[1], near], emitter);
            build.triangle([corners[1], corners[2], near], emitter);
            build.triangle([corners[0], near, corners[2]], emitter);
        } else {
            build.triangle([corners[0], corners[1], corners[2]], emitter);
        }
        build.triangle([corners[0], corners[2], corners[3]], emitter);
        build.seen(Vec3::new(0.5, 0.5, 1.0), Vec3::new(0.5, 0.5, 0.0), 45.0, 64)
    })
}

/// Row 38: every emissive triangle cut into n² alike.
pub fn split_emitters(scene: &Scene, n: u32) -> Scene {
    let mut scene = scene.clone();
    for mesh in scene.meshes.iter_mut().map(Arc::make_mut) {
        let old = mesh.clone();
        (mesh.triangles, mesh.materials) = (Vec::new(), Vec::new());
        for (corners, material) in old.triangles.iter().zip(&old.materials) {
            if scene.materials[*material as usize].emission.is_black() {
                mesh.triangles.push(*corners);
                mesh.materials.push(*material);
                continue;
            }
            let [a, b, c] = corners.map(|v| old.positions[v as usize]);
            let at = |i: u32, j: u32| a + (b - a) * (i as f32 / n as f32) + (c - a) * (j as f32 / n as f32);
            for i in 0..n {
                for j in 0..n - i {
                    let mut push = |corners: [Vec3; 3]| {
                        let first = mesh.positions.len() as u32;
                        mesh.positions.extend(corners);
                        mesh.triangles.push([first, first + 1, first + 2]);
                        mesh.materials.push(*material);
                    };
                    push([at(i, j), at(i + 1, j), at(i, j + 1)]);
                    if i + j + 2 <= n {
                        push([at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)]);
                    }
                }
            }
        }
        let grown = mesh.positions.len();
        if !mesh.normals.is_empty() {
            mesh.normals.resize(grown, Vec3::ZERO);
        }
        if !mesh.uvs.is_empty() {
            mesh.uvs.resize(grown, glam::Vec2::ZERO);
        }
    }
    scene
}

/// Row 26: every triangle that does not emit, twice. The picture stays the same: of two in one place
/// the first wins, on every worker.
pub fn doubled(scene: &Scene) -> Scene {
    let mut scene = scene.clone();
    let emits: Vec<bool> = scene.materials.iter().map(|material| !material.emission.is_black()).collect();
    for mesh in scene.meshes.iter_mut().map(Arc::make_mut) {
        let again: Vec<usize> = (0..mesh.triangles.len()).filter(|&i| !emits[mesh.materials[i] as usize]).collect();
        for i in again {
            mesh.triangles.push(mesh.triangles[i]);
            mesh.materials.push(mesh.materials[i]);
        }
    }
    scene
}

/// Row 31: a room in which nothing shines. Its picture is exactly black.
pub fn dark_room() -> Scene {
    let mut build = Build::new("dark room");
    let wall = build.paint(0.7, 0.0);
    build.room(1.0, [wall; 6]);
    build.seen(Vec3::ZERO, Vec3::X, 60.0, 8)
}

/// Row 35: widths and heights smaller than, or odd beside, tiles and interleaved blocks.
pub const PICTURE_SIZES: [(u32, u32); 7] = [(1, 1), (1, 7), (7, 1), (2, 2), (3, 5), (17, 9), (33, 1)];

/// The scene with a picture of another size.
pub fn sized(scene: &Scene, (width, height): (u32, u32)) -> Scene {
    let mut scene = scene.clone();
    (scene.camera.width, scene.camera.height) = (width, height);
    scene
}
