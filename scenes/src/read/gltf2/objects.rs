//! Nodes with meshes into objects, and what of them moves into motions.
//!
//! What is carried about by nodes has poses at regular times. What is bent, by a skin or by morph targets, has a mesh for
//! each of these times, as a film has pictures: whoever draws it has to know nothing about joints.

use std::sync::Arc;

use glam::{DMat3, DMat4, DVec3, Vec3};

use super::super::ReadError;
use super::super::limits::OBJECTS_MAX;
use super::super::mesh::Bounds;
use super::bend::{Bend, joints};
use super::file::File;
use super::geometry::Meshes;
use super::nodes::{self, Placed};
use super::pose::{Pose, Score};
use crate::{Mesh, Motion, Object, Offset, Posed, Transform};

/// Poses a second.
const RATE: f64 = 60.0;
/// Meshes a second of what is bent.
const BENT_RATE: f64 = 30.0;
/// Most poses of a scene, all objects together.
const POSES_MAX: usize = 1 << 20;
/// Most triangles of meshes that are bent, all times together.
const BENT_TRIANGLES_MAX: usize = 1 << 22;

/// A mesh at a place, in file space.
pub(super) struct Instance {
    pub name: String,
    mesh: u32,
    linear: DMat3,
    translation: DVec3,
    visible: bool,
    /// Times, places and bent meshes.
    moves: Vec<(f64, DMat3, DVec3, Option<u32>)>,
    source: Source,
}

/// Which of the placed nodes each of the file's nodes is.
struct Places(Vec<Option<usize>>);

impl Places {
    fn of(file: &File, placed: &[Placed]) -> Self {
        let mut places = vec![None; file.root.nodes.len()];
        placed.iter().enumerate().for_each(|(at, placed)| places[placed.index] = Some(at));
        Self(places)
    }

    fn find(&self, node: usize) -> Option<usize> {
        *self.0.get(node)?
    }
}

/// Where an instance is from.
struct Source {
    /// Index among the placed nodes.
    placed: usize,
    node_from_instance: DMat4,
    mirrored: bool,
    bends: bool,
}

impl Instance {
    /// What it is in the scene; `None` if single precision cannot say.
    pub fn object(&self, centre: DVec3) -> Option<Object> {
        let place = |linear: &DMat3, translation: &DVec3| {
            let place = Transform { linear: linear.as_mat3(), translation: (*translation - centre).as_vec3() };
            let sound = place.linear.is_finite() && place.translation.is_finite() && place.is_invertible();
            sound.then_some(place)
        };
        let scene_from_object = place(&self.linear, &self.translation)?;
        let poses = self.moves.iter().filter_map(|(time, linear, translation, mesh)| {
            Some(Posed { time: *time, place: place(linear, translation)?, mesh: *mesh })
        });
        let poses: Vec<Posed> = poses.collect();
        let (pivot, axis, keys, offset) = (Vec3::ZERO, Vec3::Y, Vec::new(), Offset::default());
        let motion = (!poses.is_empty()).then_some(Motion { pivot, axis, keys, poses, offset });
        let fixed = Object::fixed(self.name.clone(), self.mesh);
        Some(Object { scene_from_object, motion, visible: self.visible, ..fixed })
    }

    fn put(&mut self, scene_from_node: &DMat4) -> Option<(DMat3, DVec3)> {
        let at = *scene_from_node * self.source.node_from_instance;
        let linear = nodes::linear(&at)?;
        let side = DVec3::new(if self.source.mirrored { -1.0 } else { 1.0 }, 1.0, 1.0);
        Some((linear * DMat3::from_diagonal(side), at.w_axis.truncate()))
    }
}

/// All nodes with meshes, in a pose, and as they move.
pub(super) fn instances(
    file: &File,
    score: &Score,
    pose: &Pose,
    placed: &[Placed],
    meshes: &mut Meshes,
) -> Result<Vec<Instance>, ReadError> {
    let mut instances = Vec::new();
    let known_places = Places::of(file, placed);
    let place_of = |node: usize| known_places.find(node).map(|at| placed[at].scene_from_node);
    for (number, node) in placed.iter().enumerate() {
        let (index, source) = (node.index, &file.root.nodes[node.index]);
        let Some(mesh) = source.mesh else { continue };
        let field = format!("nodes[{index}]");
        let bend = match joints(file, source, &field, place_of) {
            Ok(joints) => Bend { weights: pose.weights(file, index), joints },
            Err(error) => {
                file.leave_out(error, "the mesh stays as modelled", meshes.looks.notes);
                Bend { weights: pose.weights(file, index), joints: None }
            }
        };
        let within = match nodes::instances(file, node) {
            Ok(within) => within,
            Err(error) => {
                file.leave_out(error, "one instance is drawn", meshes.looks.notes);
                vec![DMat4::IDENTITY]
            }
        };
        // A skin's joints say where the mesh is, whatever its node says.
        let scene_from_node = if bend.joints.is_some() { DMat4::IDENTITY } else { node.scene_from_node };
        let mut known: [Option<Option<u32>>; 2] = [None; 2];
        for node_from_instance in within {
            let at = scene_from_node * node_from_instance;
            let Some(linear) = nodes::linear(&at) else {
                let message = "its transform squeezes it flat or is no number: not drawn";
                meshes.looks.notes.at(&file.path, &field, message);
                continue;
            };
            let mirrored = linear.determinant() < 0.0;
            let of_mesh = format!("{field}.mesh");
            let found = match known[usize::from(mirrored)] {
                Some(found) => found,
                None if bend.is_none() => meshes.mesh(mesh, mirrored, &of_mesh)?,
                None => meshes.bent(mesh, mirrored, &bend, &of_mesh)?,
            };
            known[usize::from(mirrored)] = Some(found);
            let Some(drawn) = found else { continue };
            let joint_moves = || {
                let skin = source.skin.and_then(|skin| file.root.skins.get(skin.value()));
                let moves = |node: usize| known_places.find(node).is_some_and(|at| placed[at].moves);
                skin.is_some_and(|skin| skin.joints.iter().any(|joint| moves(joint.value())))
            };
            let bends = score.bends[index] || (bend.joints.is_some() && joint_moves());
            let mesh_name = || file.root.meshes.get(mesh.value()).and_then(|mesh| mesh.name.clone());
            let name = source.name.clone().or_else(mesh_name).unwrap_or_else(|| field.clone());
            let side = DVec3::new(if mirrored { -1.0 } else { 1.0 }, 1.0, 1.0);
            instances.push(Instance {
                name,
                mesh: drawn,
                linear: linear * DMat3::from_diagonal(side),
                translation: at.w_axis.truncate(),
                visible: node.visible,
                moves: Vec::new(),
                source: Source { placed: number, node_from_instance, mirrored, bends },
            });
            if instances.len() > OBJECTS_MAX {
                return Err(file.refuse("nodes", format!("more than {OBJECTS_MAX} objects")));
            }
        }
    }
    set_in_motion(file, score, placed, meshes, &mut instances)?;
    Ok(instances)
}

/// Finds where instances are at all times, and how they are bent.
fn set_in_motion(
    file: &File,
    score: &Score,
    placed: &[Placed],
    meshes: &mut Meshes,
    instances: &mut [Instance],
) -> Result<(), ReadError> {
    let Some([from, to]) = score.span else { return Ok(()) };
    let is_carried = |instance: &Instance| placed[instance.source.placed].moves;
    let carried = instances.iter().filter(|instance| is_carried(instance)).count();
    let triangles = |instance: &Instance| meshes.meshes[instance.mesh as usize].triangles.len();
    let bent: usize = instances.iter().filter(|instance| instance.source.bends).map(triangles).sum();
    let most =
        |rate: f64, each: usize, limit: usize| rate.min(limit as f64 / (each.max(1) as f64 * (to - from).max(1e-9)));
    if carried > 0 {
        for time in times([from, to], most(RATE, carried, POSES_MAX)) {
            let places = nodes::places(placed, &score.at(file, time));
            for instance in instances.iter_mut().filter(|instance| !instance.source.bends && is_carried(instance)) {
                let before = instance.moves.last().map_or(instance.linear, |(_, linear, ..)| *linear);
                let put = instance.put(&places[instance.source.placed]);
                // What is gone for a while is a speck: a place has to be invertible.
                let at = places[instance.source.placed] * instance.source.node_from_instance;
                let (linear, translation) = put.unwrap_or((before * SPECK, at.w_axis.truncate()));
                instance.moves.push((time, linear, translation, None));
            }
        }
    }
    if bent == 0 {
        return Ok(());
    }
    let rate = most(BENT_RATE, bent, BENT_TRIANGLES_MAX);
    if rate < BENT_RATE {
        let message = format!("are much to remember: what is bent moves {rate:.1} times a second");
        meshes.looks.notes.at(&file.path, "animations", message);
    }
    let known_places = Places::of(file, placed);
    for time in times([from, to], rate) {
        let pose = score.at(file, time);
        let places = nodes::places(placed, &pose);
        let place_of = |node: usize| known_places.find(node).map(|at| places[at]);
        for instance in instances.iter_mut().filter(|instance| instance.source.bends) {
            let index = placed[instance.source.placed].index;
            let source = &file.root.nodes[index];
            let (Some(mesh), field) = (source.mesh, format!("nodes[{index}]")) else { continue };
            let joints = joints(file, source, &field, place_of).unwrap_or_default();
            let here = if joints.is_some() { DMat4::IDENTITY } else { places[instance.source.placed] };
            let bend = Bend { weights: pose.weights(file, index), joints };
            let mirrored = instance.source.mirrored;
            let bent = meshes.again(|meshes| meshes.bent(mesh, mirrored, &bend, &field))?;
            let count = meshes.meshes[instance.mesh as usize].triangles.len();
            // Triangles keep their numbers: where some have no area for a while, the mesh before stays.
            let whole = bent.filter(|bent| meshes.meshes[*bent as usize].triangles.len() == count);
            if let (Some(bent), Some((linear, translation))) = (whole, instance.put(&here)) {
                instance.moves.push((time, linear, translation, Some(bent)));
            }
        }
    }
    Ok(())
}

/// How large something is that is not there for a while.
const SPECK: f64 = 1e-3;

/// Regular times, the first and the last among them.
fn times([from, to]: [f64; 2], rate: f64) -> impl Iterator<Item = f64> {
    let steps = ((to - from) * rate).ceil().max(1.0);
    (0..=steps as usize).map(move |step| from + (to - from) * (step as f64 / steps))
}

/// Box around the boxes of all instances that are to be seen.
pub(super) fn bounds(instances: &[Instance], meshes: &[Arc<Mesh>]) -> Bounds {
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
