//! What shines, in one list that everybody who has the scene makes alike: the lights that can be asked about, dimmed
//! and mixed one by one.

use std::collections::BTreeSet;

use crate::{Environment, Scene};

/// Something that shines as one. Groups are ordered as they are listed here.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum LightGroup {
    /// A light without surface: index into [`Scene::lights`].
    Light(u32),
    /// The emissive triangles of one material of the mesh on one piece of an object, lifted or not, whatever it has of its own
    /// instead.
    Surface {
        /// Index into [`Scene::materials`], of one of the file's.
        material: u32,
        /// Index into [`Scene::objects`], of an object that the file keeps apart.
        object: u32,
        /// Which of its mesh's [`crate::Pieces`].
        piece: u32,
    },
    /// What shines from beyond all objects.
    Environment,
}

/// All light groups of a scene, ascending: each light, then emissive surfaces by material, object and piece, then the
/// environment. Lights that are dimmed to nothing and emitters that are hidden keep their place, so that a number stays with
/// its emitter until a material begins or ceases to shine.
pub fn light_groups(scene: &Scene) -> Vec<LightGroup> {
    let mut surfaces = BTreeSet::new();
    let shines: Vec<bool> = scene.materials.iter().map(|material| !material.emission.is_black()).collect();
    let has_own = scene.shared_materials() < scene.materials.len();
    for (object, whole) in (0..).zip(&scene.objects[..scene.wholes()]) {
        let mesh = &scene.meshes[whole.mesh as usize];
        let made_of = |triangle: usize, material: u32| {
            if !has_own {
                return material;
            }
            let lifted = scene.find_lifted(object, mesh.pieces().of_triangle(triangle));
            scene.made_of(lifted.unwrap_or(object as usize), material)
        };
        for (triangle, material) in mesh.materials.iter().enumerate() {
            if !shines[made_of(triangle, *material) as usize] {
                continue;
            }
            let piece = mesh.pieces().of_triangle(triangle);
            surfaces.insert(LightGroup::Surface { material: *material, object, piece });
        }
    }
    let lights = (0..scene.lights.len() as u32).map(LightGroup::Light);
    let environment = (scene.environment != Environment::Black).then_some(LightGroup::Environment);
    lights.chain(surfaces).chain(environment).collect()
}

impl LightGroup {
    /// The group that an emissive triangle belongs to; `object` may be a lifted piece.
    pub fn of_triangle(scene: &Scene, object: u32, triangle: u32) -> Self {
        let mesh = &scene.meshes[scene.objects[object as usize].mesh as usize];
        let (material, piece) = (mesh.materials[triangle as usize], mesh.pieces().of_triangle(triangle as usize));
        Self::Surface { material, object: scene.whole_of(object), piece }
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;
    use crate::{Change, Colour, Light, Material, Mesh, Object, Transform};

    /// Three emitters far apart in one mesh, the first and last of one material, beside a wall; a light and a sky.
    fn scene() -> Scene {
        let corner = |x: f32| [Vec3::X * x, Vec3::X * (x + 0.1), Vec3::X * x + Vec3::Y * 0.1];
        let positions = [corner(0.0), corner(10.0), corner(20.0), corner(30.0)].concat();
        let triangles = (0..4).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
        let emitter = Material { emission: Colour::plain(Vec3::ONE), ..Material::diffuse("lamp", Vec3::ZERO) };
        Scene {
            meshes: vec![Mesh { positions, triangles, materials: vec![2, 1, 0, 2], ..Mesh::default() }.into()],
            objects: vec![Object::fixed("room", 0)],
            materials: vec![Material::diffuse("wall", Vec3::ONE), emitter.clone(), emitter],
            lights: vec![Light::Point { position: Vec3::Z, intensity: Vec3::ZERO }],
            environment: Environment::Constant(Vec3::ONE),
            ..Scene::default()
        }
    }

    #[test]
    fn groups_go_by_light_then_by_material_and_piece() {
        let emitter = |material, piece| LightGroup::Surface { material, object: 0, piece };
        let expected = [LightGroup::Light(0), emitter(1, 1), emitter(2, 0), emitter(2, 3), LightGroup::Environment];
        assert_eq!(light_groups(&scene()), expected);
        assert!(expected.is_sorted(), "so that they are found by bisection");
        assert_eq!(LightGroup::of_triangle(&scene(), 0, 3), emitter(2, 3));
    }

    #[test]
    fn edits_of_place_and_visibility_keep_the_list() {
        let mut scene = scene();
        let before = light_groups(&scene);
        let whole_from_piece = Transform { translation: Vec3::Y, ..Transform::IDENTITY };
        Change::PieceTransform { object: 0, piece: 3, whole_from_piece }.apply(&mut scene).unwrap();
        Change::PieceVisible { object: 0, piece: 1, visible: false }.apply(&mut scene).unwrap();
        assert_eq!(light_groups(&scene), before);
        let lifted = scene.find_lifted(0, 3).unwrap() as u32;
        assert_eq!(LightGroup::of_triangle(&scene, lifted, 3), before[3]);
        Change::Visible { object: 0, visible: false }.apply(&mut scene).unwrap();
        assert_eq!(light_groups(&scene), before);
    }
}
