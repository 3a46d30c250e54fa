//! glTF 2.0: nodes with meshes become objects, meshes are shared by their instances.
//!
//! Not drawn, and said so: skins, morph targets, animations, normal maps, points and lines, vertex
//! colours, everything in extensions that are not listed in [`file`].

mod accessor;
mod file;
mod geometry;
mod material;
mod nodes;
mod repair;

use std::path::Path;
use std::sync::Arc;

use glam::{DMat3, DMat4, DVec3};

use super::error::Notes;
use super::limits::OBJECTS_MAX;
use super::mesh::Bounds;
use super::textures::Textures;
use super::{Draft, ReadError};
use crate::{Mesh, Object, Scene, Transform};
use file::File;
use geometry::Meshes;
use material::Looks;
use nodes::Placed;

/// Reads a `.gltf` or `.glb` file.
pub(super) fn read(path: &Path, notes: &mut Notes) -> Result<Draft, ReadError> {
    let file = File::read(path, notes)?;
    mention_what_is_not_drawn(&file, notes);
    let placed = nodes::flatten(&file, notes);
    let mut textures = Textures::default();
    let (instances, meshes, materials) = {
        let mut meshes = Meshes::new(Looks::new(&file, &mut textures, notes));
        let instances = instances(&file, &placed, &mut meshes)?;
        meshes.report();
        (instances, meshes.meshes.into_iter().map(Arc::new).collect::<Vec<_>>(), meshes.materials)
    };
    let centre = bounds(&instances, &meshes).centre();
    let mut scene = Scene { centre, meshes, materials, textures: textures.list, ..Scene::default() };
    for instance in &instances {
        match instance.object(centre) {
            Some(object) => scene.objects.push(object),
            None => notes.at(path, &instance.name, "is too far away or too large for single precision: not drawn"),
        }
    }
    let camera = camera(&file, &placed, centre, notes);
    for node in &placed {
        match nodes::light(&file, node, centre) {
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

/// A mesh at a place, in file space.
struct Instance {
    name: String,
    mesh: u32,
    linear: DMat3,
    translation: DVec3,
}

impl Instance {
    fn object(&self, centre: DVec3) -> Option<Object> {
        let scene_from_object =
            Transform { linear: self.linear.as_mat3(), translation: (self.translation - centre).as_vec3() };
        let sound = scene_from_object.linear.is_finite()
            && scene_from_object.translation.is_finite()
            && scene_from_object.is_invertible();
        sound.then(|| Object { scene_from_object, ..Object::fixed(self.name.clone(), self.mesh) })
    }
}

fn instances(file: &File, placed: &[Placed], meshes: &mut Meshes) -> Result<Vec<Instance>, ReadError> {
    let mut instances = Vec::new();
    for Placed { index, scene_from_node } in placed {
        let node = &file.root.nodes[*index];
        let Some(mesh) = node.mesh else { continue };
        let field = format!("nodes[{index}]");
        let Some(linear) = nodes::linear(scene_from_node) else {
            let message = "its transform squeezes it flat or is no number: not drawn";
            meshes.looks.notes.at(&file.path, &field, message);
            continue;
        };
        let mirrored = linear.determinant() < 0.0;
        let Some(index) = meshes.mesh(mesh, mirrored, &format!("{field}.mesh"))? else { continue };
        let linear = if mirrored { linear * DMat3::from_diagonal(DVec3::new(-1.0, 1.0, 1.0)) } else { linear };
        let mesh_name = || file.root.meshes.get(mesh.value()).and_then(|mesh| mesh.name.clone());
        let name = node.name.clone().or_else(mesh_name).unwrap_or(field);
        instances.push(Instance { name, mesh: index, linear, translation: translation(scene_from_node) });
        if instances.len() > OBJECTS_MAX {
            return Err(file.refuse("nodes", format!("more than {OBJECTS_MAX} objects")));
        }
    }
    Ok(instances)
}

fn translation(matrix: &DMat4) -> DVec3 {
    matrix.w_axis.truncate()
}

/// Box around the boxes of all instances.
fn bounds(instances: &[Instance], meshes: &[Arc<Mesh>]) -> Bounds {
    let boxes: Vec<Bounds> = meshes.iter().map(|mesh| local_bounds(mesh)).collect();
    let mut bounds = Bounds::default();
    for instance in instances {
        let local = boxes[instance.mesh as usize];
        for corner in 0..8 {
            let side = |axis: usize| if corner >> axis & 1 == 0 { local.min[axis] } else { local.max[axis] };
            bounds.add(instance.linear * DVec3::new(side(0), side(1), side(2)) + instance.translation);
        }
    }
    bounds
}

fn local_bounds(mesh: &Mesh) -> Bounds {
    let mut bounds = Bounds::default();
    mesh.positions.iter().for_each(|position| bounds.add(position.as_dvec3()));
    bounds
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

fn mention_what_is_not_drawn(file: &File, notes: &mut Notes) {
    let root = &file.root;
    if !root.animations.is_empty() {
        notes.at(&file.path, "animations", "are not played: everything stands where its node puts it");
    }
    if root.nodes.iter().any(|node| node.skin.is_some()) {
        notes.at(&file.path, "skins", "are not drawn: skinned meshes stay as modelled");
    }
    let uses = |wanted: fn(&gltf_json::mesh::Semantic) -> bool| {
        let primitives = root.meshes.iter().flat_map(|mesh| &mesh.primitives);
        let mut semantics = primitives.flat_map(|primitive| primitive.attributes.keys());
        semantics.any(|key| matches!(key, gltf_json::validation::Checked::Valid(semantic) if wanted(semantic)))
    };
    if uses(|semantic| matches!(semantic, gltf_json::mesh::Semantic::Colors(_))) {
        notes.at(&file.path, "meshes", "vertex colours are not drawn");
    }
}
