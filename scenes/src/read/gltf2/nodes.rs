//! The node hierarchy: world transforms, cameras, lights.

use glam::{DMat3, DMat4, DQuat, DVec3, Vec3};
use gltf_json::camera::{self, Type as Projection};
use gltf_json::extensions::scene::khr_lights_punctual::{Light as PunctualLight, Type as Kind};
use gltf_json::validation::Checked;
use gltf_json::{Index, Node};

use super::super::ReadError;
use super::super::error::Notes;
use super::super::json::spot_cosines;
use super::super::limits::PICTURE_SIDE_MAX;
use super::file::File;
use crate::photometry::radiometric;
use crate::{Camera, Light};

/// A node and where it is.
pub(super) struct Placed {
    pub index: usize,
    pub scene_from_node: DMat4,
}

/// All nodes of the default scene, parents before children, in the file's order.
pub(super) fn flatten(file: &File, notes: &mut Notes) -> Vec<Placed> {
    let nodes = &file.root.nodes;
    let mut seen = vec![false; nodes.len()];
    let mut waiting: Vec<(usize, DMat4)> =
        roots(file, notes).into_iter().rev().map(|root| (root, DMat4::IDENTITY)).collect();
    let mut placed = Vec::new();
    while let Some((index, scene_from_parent)) = waiting.pop() {
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
        let scene_from_node = scene_from_parent * parent_from_node(node);
        let children = node.children.iter().flatten().rev();
        waiting.extend(children.map(|child| (child.value(), scene_from_node)));
        placed.push(Placed { index, scene_from_node });
    }
    placed
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

fn parent_from_node(node: &Node) -> DMat4 {
    if let Some(matrix) = node.matrix {
        return DMat4::from_cols_array(&matrix.map(f64::from));
    }
    let wide = |v: Option<[f32; 3]>, default: f64| v.map_or(DVec3::splat(default), |v| DVec3::from(v.map(f64::from)));
    let rotation = DQuat::from_array(node.rotation.unwrap_or_default().0.map(f64::from));
    // What has no direction does not turn.
    let length = rotation.length();
    let rotation = if length > 0.0 && length.is_finite() { rotation / length } else { DQuat::IDENTITY };
    DMat4::from_scale_rotation_translation(wide(node.scale, 1.0), rotation, wide(node.translation, 0.0))
}

/// Unit vector of a node's axis in the scene; scale is ignored.
fn direction(scene_from_node: &DMat4, axis: DVec3) -> Option<Vec3> {
    scene_from_node.transform_vector3(axis).try_normalize().map(|d| d.as_vec3())
}

/// The camera of a node, if it has a perspective one.
pub(super) fn camera(
    file: &File,
    placed: &Placed,
    centre: DVec3,
    notes: &mut Notes,
) -> Result<Option<Camera>, ReadError> {
    let field = format!("nodes[{}].camera", placed.index);
    let Some(index) = file.root.nodes[placed.index].camera else { return Ok(None) };
    let source = file.get(&file.root.cameras, index, || field.clone())?;
    let (Checked::Valid(Projection::Perspective), Some(lens)) = (source.type_, &source.perspective) else {
        notes.at(&file.path, format!("cameras[{}]", index.value()), "only perspective cameras are used");
        return Ok(None);
    };
    let at = &placed.scene_from_node;
    let origin = at.w_axis.truncate() - centre;
    let (Some(forward), Some(up)) = (direction(at, DVec3::NEG_Z), direction(at, DVec3::Y)) else {
        notes.at(&file.path, &field, "the node's transform squeezes the camera flat: it is not used");
        return Ok(None);
    };
    let (width, height) = picture(lens);
    let camera = Camera {
        origin: origin.as_vec3(),
        target: (origin + forward.as_dvec3()).as_vec3(),
        up,
        fov_y_deg: lens.yfov.to_degrees(),
        width,
        height,
    };
    camera.check().map_err(|what| file.refuse(&field, what))?;
    Ok(Some(camera))
}

/// 480 pixels high, as wide as the aspect ratio asks.
fn picture(lens: &camera::Perspective) -> (u32, u32) {
    let height = 480;
    let aspect = lens.aspect_ratio.filter(|aspect| aspect.is_finite() && *aspect > 0.0).unwrap_or(4.0 / 3.0);
    let width = (aspect * height as f32).round().clamp(1.0, PICTURE_SIDE_MAX as f32);
    (width as u32, height)
}

/// The light of a node (KHR_lights_punctual), whose intensity is in candela or lux. The transform's scale changes
/// neither; `range` is a hint for rasterisers. With the name of the node or else of the light, which may be shared; empty
/// if neither has one.
pub(super) fn light(file: &File, placed: &Placed, centre: DVec3) -> Result<Option<(String, Light)>, ReadError> {
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
        Checked::Valid(Kind::Directional) => Light::Directional { direction: direction()?, irradiance: power },
        Checked::Valid(Kind::Spot) => {
            // The specification's cone, where the file has none.
            let [inner, outer] = punctual.spot.as_ref().map_or([0.0, std::f64::consts::FRAC_PI_4], |cone| {
                [cone.inner_cone_angle, cone.outer_cone_angle].map(f64::from)
            });
            let (cos_inner, cos_outer) = spot_cosines(inner, outer)
                .ok_or_else(|| file.refuse(&field, "needs 0 ≤ innerConeAngle ≤ outerConeAngle ≤ π, outer > 0"))?;
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
