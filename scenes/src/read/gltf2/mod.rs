//! glTF 2.0: nodes with meshes become objects, meshes are shared by their instances; what moves, or is bent, is posed.
//!
//! Not drawn, and said so: points and lines, everything in extensions that are not listed in [`file`].

mod accessor;
mod bend;
mod file;
mod geometry;
mod material;
mod meshopt;
mod nodes;
mod objects;
mod packed;
mod pose;
mod repair;

use std::path::Path;
use std::sync::Arc;

use glam::DVec3;

use super::error::Notes;
use super::textures::Textures;
use super::{Draft, ReadError};
use crate::Scene;
use file::File;
use geometry::Meshes;
use material::Looks;
use nodes::Placed;
use pose::Score;

/// Reads a `.gltf` or `.glb` file. Cameras and lights are where they are at `time`.
pub(super) fn read(path: &Path, time: f64, notes: &mut Notes) -> Result<Draft, ReadError> {
    let file = File::read(path, notes)?;
    let score = Score::read(&file, notes);
    let pose = score.at(&file, time);
    let placed = nodes::flatten(&file, &score, &pose, notes);
    mention_what_stays(&file, &placed, notes);
    let mut textures = Textures::default();
    let (instances, meshes, materials) = {
        let mut meshes = Meshes::new(Looks::new(&file, &mut textures, notes));
        let instances = objects::instances(&file, &score, &pose, &placed, &mut meshes)?;
        meshes.report();
        (instances, meshes.meshes.into_iter().map(Arc::new).collect::<Vec<_>>(), meshes.materials)
    };
    let centre = objects::bounds(&instances, &meshes).centre();
    let mut scene = Scene { centre, meshes, materials, textures: textures.list, ..Scene::default() };
    for instance in &instances {
        match instance.object(centre) {
            Some(object) => scene.objects.push(object),
            None => notes.at(path, &instance.name, "is too far away or too large for single precision: not drawn"),
        }
    }
    let camera = camera(&file, &placed, centre, notes);
    for node in placed.iter().filter(|node| node.visible) {
        match nodes::light(&file, node, centre, notes) {
            Ok(None) => {}
            Ok(Some((name, light))) => {
                scene.lights.push(light);
                scene.light_names.push(name);
                scene.lights_are_photometric = true;
            }
            Err(error) => file.leave_out(error, "the light is left out", notes),
        }
    }
    Ok(Draft { scene, camera, sky_is_said: false })
}

/// The first camera of the hierarchy.
fn camera(file: &File, placed: &[Placed], centre: DVec3, notes: &mut Notes) -> Option<crate::Camera> {
    let mut cameras = Vec::new();
    for node in placed {
        match nodes::camera(file, node, centre, notes) {
            Ok(camera) => cameras.extend(camera),
            Err(error) => file.leave_out(error, "the camera is left out", notes),
        }
    }
    if cameras.len() > 1 {
        notes.file(&file.path, format!("has {} cameras: the first is used", cameras.len()));
    }
    cameras.first().copied()
}

fn mention_what_stays(file: &File, placed: &[Placed], notes: &mut Notes) {
    let is_one = |node: &Placed| {
        let node = &file.root.nodes[node.index];
        let light = node.extensions.as_ref().is_some_and(|all| all.khr_lights_punctual.is_some());
        light || node.camera.is_some()
    };
    let moving = placed.iter().filter(|node| node.moves && is_one(node)).count();
    if moving > 0 {
        notes.at(
            &file.path,
            "animations",
            format!("{moving} cameras or lights move: they stay where they are at --time"),
        );
    }
}
