//! The node hierarchy: world transforms, cameras, lights.

use glam::{DMat3, DMat4, DQuat, DVec3, Vec3};
use gltf_json::camera::Type as Projection;
use gltf_json::extensions::scene::khr_lights_punctual::{Light as PunctualLight, Type as Kind};
use gltf_json::validation::Checked;
use gltf_json::{Index, Node};

use super::super::ReadError;
use super::super::error::Notes;
use super::super::lamps::spot_cosines;
use super::super::limits::PICTURE_SIDE_MAX;
use super::file::File;
use super::pose::{Pose, Score, turn};
use crate::camera::PARALLEL_HEIGHTS;
use crate::photometry::radiometric;
use crate::{Camera, Light};

/// A node and where it is.
pub(super) struct Placed {
    pub index: usize,
    /// Its parent's place in the list; comes before it.
    pub parent: Option<usize>,
    pub scene_from_node: DMat4,
    /// Neither it nor an ancestor is switched off (KHR_node_visibility).
    pub visible: bool,
    /// It or an ancestor moves.
    pub moves: bool,
}

/// All nodes of the default scene in a pose, parents before children, in the file's order.
pub(super) fn flatten(file: &File, score: &Score, pose: &Pose, notes: &mut Notes) -> Vec<Placed> {
    let nodes = &file.root.nodes;
    let mut seen = vec![false; nodes.len()];
    let mut waiting: Vec<(usize, Option<usize>)> =
        roots(file, notes).into_iter().rev().map(|root| (root, None)).collect();
    let mut placed: Vec<Placed> = Vec::new();
    while let Some((index, parent)) = waiting.pop() {
        let field = format!("nodes[{index}]");
        let node = match file.get(nodes, Index::new(index as u32), || field.clone()) {
            Ok(node) => node,
            Err(error) => {
                file.leave_out(error, "left out", notes);
                continue;
            }
        };
        if std::mem::replace(&mut seen[index], true) {
            notes.at(&file.path, &field, "has several parents, or is its own ancestor: only the first place counts");
            continue;
        }
        let above = parent.map(|parent: usize| &placed[parent]);
        let scene_from_parent = above.map_or(DMat4::IDENTITY, |above| above.scene_from_node);
        let visible = above.is_none_or(|above| above.visible) && is_switched_on(node);
        let moves = above.is_some_and(|above| above.moves) || score.moves(index);
        let scene_from_node = scene_from_parent * pose.parent_from_node[index];
        let number = placed.len();
        waiting.extend(node.children.iter().flatten().rev().map(|child| (child.value(), Some(number))));
        placed.push(Placed { index, parent, scene_from_node, visible, moves });
    }
    placed
}

/// Where all placed nodes are in another pose.
pub(super) fn places(placed: &[Placed], pose: &Pose) -> Vec<DMat4> {
    let mut places: Vec<DMat4> = Vec::with_capacity(placed.len());
    for node in placed {
        let above = node.parent.map_or(DMat4::IDENTITY, |parent| places[parent]);
        places.push(above * pose.parent_from_node[node.index]);
    }
    places
}

/// KHR_node_visibility.
fn is_switched_on(node: &Node) -> bool {
    let extension = node.extensions.as_ref().and_then(|all| all.others.get("KHR_node_visibility"));
    extension.and_then(|extension| extension["visible"].as_bool()).unwrap_or(true)
}

/// The places of a node's instances, from the node (EXT_mesh_gpu_instancing); one at the node itself without.
pub(super) fn instances(file: &File, placed: &Placed) -> Result<Vec<DMat4>, ReadError> {
    let node = &file.root.nodes[placed.index];
    let extension = node.extensions.as_ref().and_then(|all| all.others.get("EXT_mesh_gpu_instancing"));
    let Some(extension) = extension else { return Ok(vec![DMat4::IDENTITY]) };
    let place = format!("nodes[{}].extensions.EXT_mesh_gpu_instancing.attributes", placed.index);
    let attribute = |name: &str| {
        let index = extension["attributes"][name].as_u64()?;
        Some((Index::new(u32::try_from(index).unwrap_or(u32::MAX)), format!("{place}.{name}")))
    };
    let shifts = attribute("TRANSLATION").map(|(index, field)| file.vectors::<3>(index, &field)).transpose()?;
    let turns = attribute("ROTATION").map(|(index, field)| file.vectors::<4>(index, &field)).transpose()?;
    let sizes = attribute("SCALE").map(|(index, field)| file.vectors::<3>(index, &field)).transpose()?;
    let counts = [shifts.as_ref().map(Vec::len), turns.as_ref().map(Vec::len), sizes.as_ref().map(Vec::len)];
    let count = counts.into_iter().flatten().min().unwrap_or(1);
    if counts.into_iter().flatten().any(|other| other != count) {
        return Err(file.refuse(&place, "its attributes have different numbers of elements"));
    }
    let wide = |list: &Option<Vec<[f32; 3]>>, i: usize, default: f64| {
        list.as_ref().map_or(DVec3::splat(default), |list| DVec3::from(list[i].map(f64::from)))
    };
    let instance = |i: usize| {
        let rotation = turns.as_ref().map_or(DQuat::IDENTITY, |turns| turn(DQuat::from_array(turns[i].map(f64::from))));
        DMat4::from_scale_rotation_translation(wide(&sizes, i, 1.0), rotation, wide(&shifts, i, 0.0))
    };
    Ok((0..count).map(instance).collect())
}

/// Roots of the default scene, or of the first; of all nodes in a file without scenes.
fn roots(file: &File, notes: &mut Notes) -> Vec<usize> {
    let scenes = &file.root.scenes;
    let chosen = file.root.scene.map(|index| file.get(scenes, index, || "scene".into()));
    let chosen = chosen.and_then(|scene| scene.map_err(|error| file.leave_out(error, "the first is used", notes)).ok());
    if let Some(scene) = chosen.or(scenes.first()) {
        return scene.nodes.iter().map(Index::value).collect();
    }
    let mut is_child = vec![false; file.root.nodes.len()];
    for child in file.root.nodes.iter().flat_map(|node| node.children.iter().flatten()) {
        if let Some(flag) = is_child.get_mut(child.value()) {
            *flag = true;
        }
    }
    (0..is_child.len()).filter(|&i| !is_child[i]).collect()
}

/// Unit vector of a node's axis in the scene; scale is ignored.
fn direction(scene_from_node: &DMat4, axis: DVec3) -> Option<Vec3> {
    scene_from_node.transform_vector3(axis).try_normalize().map(|d| d.as_vec3())
}

/// The camera of a node, if it has one. An orthographic one is a perspective one from afar.
pub(super) fn camera(
    file: &File,
    placed: &Placed,
    centre: DVec3,
    notes: &mut Notes,
) -> Result<Option<Camera>, ReadError> {
    let field = format!("nodes[{}].camera", placed.index);
    let Some(index) = file.root.nodes[placed.index].camera else { return Ok(None) };
    let source = file.get(&file.root.cameras, index, || field.clone())?;
    let at = &placed.scene_from_node;
    let origin = at.w_axis.truncate() - centre;
    let (Some(forward), Some(up)) = (direction(at, DVec3::NEG_Z), direction(at, DVec3::Y)) else {
        notes.at(&file.path, &field, "the node's transform squeezes the camera flat: it is not used");
        return Ok(None);
    };
    let (fov_y_deg, aspect, back) = match (source.type_, &source.perspective, &source.orthographic) {
        (Checked::Valid(Projection::Perspective), Some(lens), _) => (lens.yfov.to_degrees(), lens.aspect_ratio, 0.0),
        (Checked::Valid(Projection::Orthographic), _, Some(lens)) => {
            let height = f64::from(lens.ymag.abs()) * at.transform_vector3(DVec3::Y).length();
            let (half, place) = (2.0 * libm::atan(1.0 / PARALLEL_HEIGHTS), format!("cameras[{}]", index.value()));
            let message =
                format!("is orthographic: drawn from afar, {PARALLEL_HEIGHTS} times half the picture's height");
            notes.at(&file.path, place, message);
            (half.to_degrees() as f32, Some(lens.xmag.abs() / lens.ymag.abs()), height * PARALLEL_HEIGHTS)
        }
        _ => return Err(file.refuse(&field, "the camera has no projection")),
    };
    let origin = origin - forward.as_dvec3() * back;
    let (width, height) = picture(aspect);
    let ahead = forward.as_dvec3() * back.max(1.0);
    let (origin, target) = (origin.as_vec3(), (origin + ahead).as_vec3());
    let camera = Camera { origin, target, up, fov_y_deg, width, height, ..Camera::default() };
    camera.check().map_err(|what| file.refuse(&field, what))?;
    Ok(Some(camera))
}

/// 480 pixels high, as wide as the aspect ratio asks.
fn picture(aspect: Option<f32>) -> (u32, u32) {
    let height = 480;
    let aspect = aspect.filter(|aspect| aspect.is_finite() && *aspect > 0.0).unwrap_or(4.0 / 3.0);
    let width = (aspect * height as f32).round().clamp(1.0, PICTURE_SIDE_MAX as f32);
    (width as u32, height)
}

/// The light of a node (KHR_lights_punctual), whose intensity is in candela or lux. The transform's scale changes
/// neither; `range` is a hint for rasterisers. With the name of the node or else of the light, which may be shared; empty
/// if neither has one.
pub(super) fn light(
    file: &File,
    placed: &Placed,
    centre: DVec3,
    notes: &mut Notes,
) -> Result<Option<(String, Light)>, ReadError> {
    let node = &file.root.nodes[placed.index];
    let extension = node.extensions.as_ref().and_then(|all| all.khr_lights_punctual.as_ref());
    let Some(extension) = extension else { return Ok(None) };
    let punctuals = file.root.extensions.as_ref().and_then(|all| all.khr_lights_punctual.as_ref());
    let punctuals: &[PunctualLight] = punctuals.map_or(&[], |all| &all.lights);
    let field = format!("nodes[{}].extensions.KHR_lights_punctual.light", placed.index);
    let punctual = file.get(punctuals, extension.light, || field.clone())?;
    let field = format!("extensions.KHR_lights_punctual.lights[{}]", extension.light.value());
    let power = radiometric(punctual.intensity, Vec3::from(punctual.color));
    if !power.is_finite() || power.min_element() < 0.0 {
        return Err(file.refuse(&field, "color times intensity must be finite and not negative"));
    }
    let position = (placed.scene_from_node.w_axis.truncate() - centre).as_vec3();
    if !position.is_finite() {
        return Err(file.refuse(&field, "the light's place is no finite number"));
    }
    let direction = || {
        direction(&placed.scene_from_node, DVec3::NEG_Z)
            .ok_or_else(|| file.refuse(&field, "the node's transform leaves the light no direction"))
    };
    let light = match punctual.type_ {
        Checked::Valid(Kind::Point) => Light::Point { position, intensity: power },
        Checked::Valid(Kind::Directional) => {
            Light::Directional { direction: direction()?, irradiance: power, diameter_deg: 0.0 }
        }
        Checked::Valid(Kind::Spot) => {
            // The specification's cone, where the file has none.
            let [inner, outer] = punctual.spot.as_ref().map_or([0.0, std::f64::consts::FRAC_PI_4], |cone| {
                [cone.inner_cone_angle, cone.outer_cone_angle].map(f64::from)
            });
            let within = outer.min(std::f64::consts::PI);
            let between = inner.max(0.0).min(within);
            let (cos_inner, cos_outer) =
                spot_cosines(between, within).ok_or_else(|| file.refuse(&field, "outerConeAngle must be above 0"))?;
            if [between, within] != [inner, outer] {
                let message =
                    "0 ≤ innerConeAngle ≤ outerConeAngle ≤ π does not hold: the nearest cone that does is used";
                notes.at(&file.path, &field, message);
            }
            Light::Spot { position, direction: direction()?, intensity: power, cos_inner, cos_outer }
        }
        Checked::Invalid => return Err(file.refuse(&field, "has an unknown type; point, spot or directional")),
    };
    let name = node.name.clone().or_else(|| punctual.name.clone()).unwrap_or_default();
    Ok(Some((name, light)))
}

/// The node's linear part if it can be inverted.
pub(super) fn linear(scene_from_node: &DMat4) -> Option<DMat3> {
    let linear = DMat3::from_mat4(*scene_from_node);
    let lengths = linear.x_axis.length() * linear.y_axis.length() * linear.z_axis.length();
    (linear.is_finite() && linear.determinant().abs() > lengths * 1e-6).then_some(linear)
}
