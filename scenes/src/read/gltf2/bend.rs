//! Meshes bent to a pose: by morph targets first, then by a skin.

use glam::{DMat3, DMat4, DVec3};
use gltf_json::mesh::{Primitive, Semantic};
use gltf_json::validation::Checked;
use gltf_json::{Accessor, Index, Node};

use super::super::ReadError;
use super::file::File;

/// How a mesh is bent.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Bend {
    /// Of morph targets.
    pub weights: Vec<f32>,
    /// Where each joint takes what it holds, in the scene; `None` without a skin.
    pub joints: Option<Vec<DMat4>>,
}

/// Attributes that bend.
pub(super) struct Bent<'a> {
    pub positions: &'a mut Vec<[f32; 3]>,
    pub normals: &'a mut Vec<[f32; 3]>,
    pub tangents: &'a mut Vec<[f32; 4]>,
}

impl Bend {
    /// The mesh stays as it is modelled.
    pub fn is_none(&self) -> bool {
        self.weights.is_empty() && self.joints.is_none()
    }

    /// The joints turn things inside out.
    pub fn mirrors(&self) -> bool {
        let inside_out = |joints: &Vec<DMat4>| joints.iter().filter(|joint| joint.determinant() < 0.0).count();
        self.joints.as_ref().is_some_and(|joints| inside_out(joints) * 2 > joints.len())
    }

    /// Bends the attributes of a primitive.
    pub fn apply(&self, file: &File, primitive: &Primitive, place: &str, bent: Bent) -> Result<(), ReadError> {
        let Bent { positions, normals, tangents } = bent;
        let targets = primitive.targets.iter().flatten().zip(&self.weights).enumerate();
        for (i, (target, weight)) in targets.filter(|(_, (_, weight))| **weight != 0.0) {
            let field = |name: &str| format!("{place}.targets[{i}].{name}");
            add(file, target.positions, &field("POSITION"), *weight, positions)?;
            add(file, target.normals, &field("NORMAL"), *weight, normals)?;
            add(file, target.tangents, &field("TANGENT"), *weight, tangents)?;
        }
        let Some(joints) = &self.joints else { return Ok(()) };
        let held = held(file, primitive, place, positions.len(), joints)?;
        for (i, matrix) in held.iter().enumerate() {
            positions[i] = matrix.transform_point3(DVec3::from(positions[i].map(f64::from))).as_vec3().to_array();
        }
        for (normal, matrix) in normals.iter_mut().zip(&held) {
            let (x, y, z) = (matrix.x_axis.truncate(), matrix.y_axis.truncate(), matrix.z_axis.truncate());
            // The inverse transpose up to a factor.
            let cofactors = DMat3::from_cols(y.cross(z), z.cross(x), x.cross(y));
            let side = if matrix.determinant() < 0.0 { -1.0 } else { 1.0 };
            *normal = (cofactors * DVec3::from(normal.map(f64::from)) * side).normalize_or_zero().as_vec3().to_array();
        }
        for (tangent, matrix) in tangents.iter_mut().zip(&held) {
            let [x, y, z, w] = *tangent;
            let along = matrix.transform_vector3(DVec3::from([x, y, z].map(f64::from))).normalize_or_zero();
            *tangent = along.as_vec3().extend(w).to_array();
        }
        Ok(())
    }
}

/// Adds a morph target's displacements.
fn add<const N: usize>(
    file: &File,
    target: Option<Index<Accessor>>,
    field: &str,
    weight: f32,
    to: &mut [[f32; N]],
) -> Result<(), ReadError> {
    let Some(target) = target.filter(|_| !to.is_empty()) else { return Ok(()) };
    let moved = file.vectors::<3>(target, field)?;
    if moved.len() != to.len() {
        return Err(file.refuse(field, format!("has {} elements, but there are {} vertices", moved.len(), to.len())));
    }
    for (value, by) in to.iter_mut().zip(moved) {
        value.iter_mut().zip(by).for_each(|(value, by)| *value += by * weight);
    }
    Ok(())
}

/// The matrix of each vertex: that of its joints, by their weights.
fn held(
    file: &File,
    primitive: &Primitive,
    place: &str,
    vertices: usize,
    joints: &[DMat4],
) -> Result<Vec<DMat4>, ReadError> {
    let attribute = |semantic: Semantic| primitive.attributes.get(&Checked::Valid(semantic)).copied();
    let mut matrices = vec![DMat4::ZERO; vertices];
    let mut sums = vec![0.0_f64; vertices];
    for set in 0.. {
        let (Some(numbers), Some(weights)) = (attribute(Semantic::Joints(set)), attribute(Semantic::Weights(set)))
        else {
            break;
        };
        let field = |name: &str| format!("{place}.attributes.{name}_{set}");
        let numbers = file.vectors::<4>(numbers, &field("JOINTS"))?;
        let weights = file.vectors::<4>(weights, &field("WEIGHTS"))?;
        if numbers.len() != vertices || weights.len() != vertices {
            return Err(file.refuse(&field("JOINTS"), "has not as many elements as there are vertices"));
        }
        for (i, (numbers, weights)) in numbers.iter().zip(&weights).enumerate() {
            for (number, weight) in numbers.iter().zip(weights).filter(|(_, weight)| **weight > 0.0) {
                let joint = joints.get(*number as usize).ok_or_else(|| {
                    file.refuse(&field("JOINTS"), format!("names joint {number}; the skin has {}", joints.len()))
                })?;
                matrices[i] += *joint * f64::from(*weight);
                sums[i] += f64::from(*weight);
            }
        }
    }
    for (matrix, sum) in matrices.iter_mut().zip(&sums) {
        // What nothing holds goes with the first joint, as in other programs.
        *matrix = if *sum > 0.0 { *matrix * (1.0 / sum) } else { joints.first().copied().unwrap_or_default() };
    }
    Ok(matrices)
}

/// Where the joints of a node's skin take what they hold; `None` if it has none. `scene_from_node` is known of the nodes that
/// are in the scene.
pub(super) fn joints(
    file: &File,
    node: &Node,
    field: &str,
    scene_from_node: impl Fn(usize) -> Option<DMat4>,
) -> Result<Option<Vec<DMat4>>, ReadError> {
    let Some(index) = node.skin else { return Ok(None) };
    let skin = file.get(&file.root.skins, index, || format!("{field}.skin"))?;
    let place = format!("skins[{}]", index.value());
    let bind = match skin.inverse_bind_matrices {
        Some(matrices) => file.matrices(matrices, &format!("{place}.inverseBindMatrices"))?,
        None => vec![DMat4::IDENTITY; skin.joints.len()],
    };
    if skin.joints.is_empty() || bind.len() < skin.joints.len() {
        return Err(file.refuse(&place, "has no joints, or fewer inverse bind matrices than joints"));
    }
    let joint = |(joint, bind): (&Index<Node>, &DMat4)| {
        scene_from_node(joint.value()).map(|place| place * *bind).ok_or_else(|| {
            file.refuse(&format!("{place}.joints"), format!("node {} is not in the scene", joint.value()))
        })
    };
    skin.joints.iter().zip(&bind).map(joint).collect::<Result<Vec<_>, _>>().map(Some)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bend_says_whether_it_turns_things_inside_out() {
        let mirror = DMat4::from_scale(DVec3::new(-1.0, 1.0, 1.0));
        let bend = |joints: Vec<DMat4>| Bend { weights: Vec::new(), joints: Some(joints) };
        assert!(bend(vec![mirror, mirror, DMat4::IDENTITY]).mirrors());
        assert!(!bend(vec![mirror, DMat4::IDENTITY]).mirrors() && !Bend::default().mirrors());
        assert!(Bend::default().is_none() && !bend(vec![]).is_none());
    }
}
