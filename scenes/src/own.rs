//! Materials of objects' and pieces' own: what is edited of one chair is of that chair alone, although others share its mesh
//! or its material.
//!
//! They stand behind those of the file in [`Scene::materials`], in order of the objects that have them: so their numbers follow
//! from which there are, in whatever order they came, and change when others come or go.

use serde::{Deserialize, Serialize};

use crate::{Material, Object, Scene};

/// What an object is made of, instead of a material that its mesh names.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Own {
    /// The mesh's: index into [`Scene::materials`], of one of the file's.
    pub instead_of: u32,
    /// Index into [`Scene::materials`], of one that nothing else has.
    pub material: u32,
}

impl Scene {
    /// How many materials the file has: the first ones. Only these have numbers that last.
    pub fn shared_materials(&self) -> usize {
        let own = self.objects.iter().flat_map(|object| &object.own).map(|own| own.material as usize);
        own.min().unwrap_or(self.materials.len())
    }

    /// Of what a triangle of an object is made: index into [`Scene::materials`].
    #[inline]
    pub fn material_of(&self, object: usize, triangle: usize) -> u32 {
        let of = &self.objects[object];
        let material = self.meshes[of.mesh as usize].materials[triangle];
        if of.own.is_empty() && of.lifted.is_none() { material } else { self.made_of(object, material) }
    }

    /// What an object has of one of its mesh's materials: its own, or else its whole's own, or else that one.
    pub fn made_of(&self, object: usize, material: u32) -> u32 {
        let object = &self.objects[object];
        let whole = object.lifted.as_ref().map(|lifted| &self.objects[lifted.of as usize]);
        let mut own = std::iter::once(object).chain(whole).filter_map(|object| object.own_of(material));
        own.next().map_or(material, |own| own.material)
    }

    /// Whether something of an object that the file keeps apart, or of a piece of it, is of a material of the file; both must
    /// exist.
    pub(crate) fn has_material(&self, object: u32, piece: Option<u32>, material: u32) -> bool {
        let Object { mesh, motion, .. } = &self.objects[object as usize];
        let mesh = &self.meshes[*mesh as usize];
        match piece {
            Some(piece) => {
                let mut triangles = mesh.pieces().triangles(piece).iter();
                triangles.any(|triangle| mesh.materials[*triangle as usize] == material)
            }
            None => {
                let poses = motion.iter().flat_map(|motion| &motion.poses).filter_map(|pose| pose.mesh);
                let meshes = std::iter::once(mesh).chain(poses.map(|mesh| &self.meshes[mesh as usize]));
                meshes.into_iter().any(|mesh| mesh.materials.contains(&material))
            }
        }
    }

    /// What an object that the file keeps apart, or a piece of it, has of its own instead of a material of its mesh.
    pub fn own_material(&self, object: u32, piece: Option<u32>, material: u32) -> Option<&Material> {
        let place = match piece {
            None => object as usize,
            Some(piece) => self.find_lifted(object, piece).ok()?,
        };
        let own = self.objects.get(place)?.own_of(material)?;
        self.materials.get(own.material as usize)
    }

    /// Gives an object or a piece of it a material of its own, or takes that away; both must exist.
    pub(crate) fn put_own(&mut self, object: u32, piece: Option<u32>, material: u32, value: Option<Material>) {
        let shared = self.shared_materials();
        let place = match piece {
            None => object as usize,
            Some(piece) => match (self.find_lifted(object, piece), &value) {
                (Ok(place), _) => place,
                (Err(_), None) => return,
                (Err(place), Some(_)) => {
                    self.lift(place, self.piece(object, piece));
                    place
                }
            },
        };
        let before = shared + self.objects[..place].iter().map(|object| object.own.len()).sum::<usize>();
        let own = &mut self.objects[place].own;
        match (own.binary_search_by_key(&material, |own| own.instead_of), value) {
            (Ok(found), Some(value)) => self.materials[own[found].material as usize] = value,
            (Err(at), Some(value)) => {
                own.insert(at, Own { instead_of: material, material: 0 });
                self.materials.insert(before + at, value);
            }
            (Ok(found), None) => {
                own.remove(found);
                self.materials.remove(before + found);
            }
            (Err(_), None) => {}
        }
        let all = self.objects.iter_mut().flat_map(|object| &mut object.own);
        (shared as u32..).zip(all).for_each(|(number, own)| own.material = number);
        if let Some(piece) = piece {
            self.with_piece(object, piece, |_| {});
        }
    }
}

impl Object {
    fn own_of(&self, material: u32) -> Option<&Own> {
        let found = self.own.binary_search_by_key(&material, |own| own.instead_of);
        found.ok().map(|place| &self.own[place])
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;
    use crate::{Change, Mesh, Transform};

    /// Three triangles far apart, of two materials, in a mesh that two objects share.
    fn scene() -> Scene {
        let corner = |x: f32| [Vec3::X * x, Vec3::X * (x + 0.1), Vec3::X * x + Vec3::Y * 0.1];
        let positions = [corner(0.0), corner(10.0), corner(20.0)].concat();
        let triangles = (0..3).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
        let mesh = Mesh { positions, triangles, materials: vec![1, 0, 1], ..Mesh::default() };
        Scene {
            meshes: vec![mesh.into()],
            objects: vec![Object::fixed("left", 0), Object::fixed("right", 0)],
            materials: vec![Material::diffuse("wood", Vec3::ONE), Material::diffuse("cloth", Vec3::ONE)],
            ..Scene::default()
        }
    }

    fn own(object: u32, piece: impl Into<Option<u32>>, material: u32, grey: impl Into<Option<f32>>) -> Change {
        let value = grey.into().map(|grey: f32| Material::diffuse("own", Vec3::splat(grey)));
        Change::OwnMaterial { object, piece: piece.into(), material, value }
    }

    fn edited(changes: &[Change]) -> Scene {
        let mut scene = scene();
        for change in changes {
            change.apply(&mut scene).unwrap();
            scene.check().unwrap();
        }
        scene
    }

    /// What each triangle of each object is made of, as greys.
    fn greys(scene: &Scene) -> Vec<Vec<f32>> {
        let grey = |material: u32| match &scene.materials[material as usize].surface {
            crate::Surface::Diffuse { albedo } => albedo.value.x,
            other => panic!("{other:?}"),
        };
        let of = |object| scene.triangles(object).map(|triangle| grey(scene.material_of(object, triangle))).collect();
        (0..scene.objects.len()).map(of).collect()
    }

    #[test]
    fn one_thing_is_recoloured_and_those_that_share_its_mesh_and_material_are_not() {
        let now = edited(&[own(1, None, 1, 0.5)]);
        assert_eq!(greys(&now), [[1.0, 1.0, 1.0], [0.5, 1.0, 0.5]]);
        assert_eq!((now.materials.len(), now.shared_materials()), (3, 2));
        let now = edited(&[own(0, 2, 1, 0.25)]);
        assert_eq!(
            greys(&now),
            [vec![1.0, 1.0], vec![1.0, 1.0, 1.0], vec![0.25]],
            "the piece is lifted where it stands"
        );
        let all = Change::Material { material: 1, value: Material::diffuse("all", Vec3::splat(0.75)) };
        let now = edited(&[own(0, 2, 1, 0.25), all]);
        assert_eq!(greys(&now), [vec![0.75, 1.0], vec![0.75, 1.0, 0.75], vec![0.25]], "all alike but for it");
    }

    #[test]
    fn a_piece_has_what_its_whole_has_until_it_has_its_own() {
        let shift = Transform { translation: Vec3::Y, ..Transform::IDENTITY };
        let moved = Change::PieceTransform { object: 0, piece: 0, whole_from_piece: shift };
        let now = edited(&[moved.clone(), own(0, None, 1, 0.5)]);
        assert_eq!(greys(&now), [vec![1.0, 0.5], vec![1.0, 1.0, 1.0], vec![0.5]]);
        let now = edited(&[moved, own(0, None, 1, 0.5), own(0, 0, 1, 0.25)]);
        assert_eq!(greys(&now), [vec![1.0, 0.5], vec![1.0, 1.0, 1.0], vec![0.25]]);
    }

    #[test]
    fn in_whatever_order_they_come_the_scene_is_the_same_and_taken_back_as_it_was() {
        let changes =
            [own(1, 2, 1, 0.1), own(0, None, 0, 0.2), own(1, None, 1, 0.3), own(0, 1, 0, 0.4), own(1, 0, 1, 0.5)];
        let now = edited(&changes);
        assert_eq!(edited(&changes.iter().rev().cloned().collect::<Vec<_>>()), now);
        let mut found = scene().changes_to(&now);
        assert_eq!(found.len(), 5);
        assert_eq!(edited(&found), now);
        found.reverse();
        assert_eq!(edited(&found), now);
        let mut back = now.clone();
        for change in now.changes_to(&scene()) {
            let forth = change.undo(&back).unwrap();
            let before = back.clone();
            change.apply(&mut back).unwrap();
            back.check().unwrap();
            let mut again = back.clone();
            forth.apply(&mut again).unwrap();
            assert_eq!(again, before, "{change:?}");
        }
        assert_eq!(back, scene());
    }

    #[test]
    fn what_is_not_there_has_nothing_of_its_own() {
        let mut now = edited(&[own(0, None, 1, 0.5)]);
        for wrong in
            [own(2, None, 1, 0.5), own(0, 3, 1, 0.5), own(0, 1, 1, 0.5), own(0, None, 2, 0.5), own(0, None, 1, 2.0)]
        {
            assert!(wrong.apply(&mut now).is_err(), "{wrong:?}");
        }
        let value = Material::diffuse("x", Vec3::ONE);
        assert!(Change::Material { material: 2, value }.apply(&mut now).is_err(), "its number does not last");
        let broken = |change: &dyn Fn(&mut Scene)| {
            let mut scene = edited(&[own(0, None, 1, 0.5), own(1, 2, 1, 0.25)]);
            change(&mut scene);
            assert!(scene.check().is_err());
        };
        broken(&|scene| scene.objects[0].own[0].material = 3);
        broken(&|scene| scene.objects[0].own[0].material = 9);
        broken(&|scene| scene.objects[0].own[0].instead_of = 2);
        broken(&|scene| drop(scene.materials.pop()));
        broken(&|scene| scene.objects[1].own.push(Own { instead_of: 0, material: 2 }));
    }
}
