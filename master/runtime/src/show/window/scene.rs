//! The window's copy of the scene: what the studio sent of it, with the edits since.

use glam::Vec3;
use scenes::change::Lamp;
use scenes::{Change, Light, Material, Transform};

use crate::display::hues::{Hues, own_key};
use crate::display::message::{ObjectInfo, PieceInfo, SceneInfo};

/// See the module's documentation.
#[derive(Clone, Debug, Default)]
pub(super) struct SceneCopy {
    pub info: SceneInfo,
    /// Of what is off.
    pub hues: Hues,
}

impl SceneCopy {
    /// Makes a change in this copy.
    pub fn learn(&mut self, change: &Change) {
        match change {
            Change::Transform { object, scene_from_object } => self.put(*object, *scene_from_object),
            Change::Visible { object, visible } => {
                if let Some(known) = self.info.objects.get_mut(*object as usize) {
                    known.visible = *visible;
                }
            }
            Change::PieceTransform { object, piece, whole_from_piece } => {
                if let Some(known) = self.piece_mut(*object, *piece) {
                    known.place = *whole_from_piece;
                }
            }
            Change::PieceVisible { object, piece, visible } => {
                if let Some(known) = self.piece_mut(*object, *piece) {
                    known.visible = *visible;
                }
            }
            Change::Material { material, value } => {
                if let Some(old) = self.info.materials.get_mut(*material as usize) {
                    self.hues.learn_material(*material, old, value);
                    *old = value.clone();
                }
            }
            Change::OwnMaterial { object, piece, material, value } => {
                let key = own_key(*object, *piece, *material);
                match (value, self.made_of(*object, *piece, *material).cloned()) {
                    (Some(is), Some(was)) => self.hues.learn_own(key, &was, is),
                    _ => drop(self.hues.own.remove(&key)),
                }
                let own = match piece {
                    None => self.info.objects.get_mut(*object as usize).map(|known| &mut known.own),
                    Some(piece) => self.piece_mut(*object, *piece).map(|known| &mut known.own),
                };
                if let Some(own) = own {
                    own.retain(|(of, _)| of != material);
                    own.extend(value.clone().map(|value| (*material, value)));
                }
            }
            Change::Light { light, value } => {
                if let Some(old) = self.info.lights.get_mut(*light as usize) {
                    self.hues.learn_light(*light, old, value);
                    *old = value.clone();
                }
            }
            // The camera is each viewer's own; where what moves is, the studio sends.
            Change::Lamp { light, value } => {
                let number = *light as usize;
                self.info.lights.resize(self.info.lights.len().max(number + 1), Light::ABSENT);
                self.info.light_names.resize(self.info.lights.len(), String::new());
                let lamp = value.clone().unwrap_or(Lamp { name: String::new(), light: Light::ABSENT });
                (self.info.light_names[number], self.info.lights[number]) = (lamp.name, lamp.light);
            }
            Change::Environment(environment) => self.info.environment = *environment,
            // Of solids, the names come beside the changes.
            Change::Camera(_) | Change::Time(_) | Change::Offset { .. } | Change::Solid { .. } => {}
        }
    }

    /// A lamp's name in its file; one is made up only where there is none.
    pub fn lamp_name(&self, index: usize) -> String {
        let made_up = || match self.info.lights.get(index) {
            Some(Light::Point { .. }) => format!("Point lamp {}", index + 1),
            Some(Light::Spot { .. }) => format!("Spot lamp {}", index + 1),
            Some(Light::Luminaire { .. }) => format!("Luminaire lamp {}", index + 1),
            Some(Light::Directional { .. }) => format!("Directional lamp {}", index + 1),
            None => String::new(),
        };
        self.info.light_names.get(index).filter(|name| !name.is_empty()).cloned().unwrap_or_else(made_up)
    }

    /// Puts an object there.
    pub fn put(&mut self, object: u32, place: Transform) {
        if let Some(known) = self.info.objects.get_mut(object as usize) {
            known.place = place;
        }
    }

    /// Adds a piece, unless it is known.
    pub fn meet(&mut self, piece: PieceInfo) {
        if self.piece(piece.object, piece.piece).is_none() {
            self.info.pieces.push(piece);
        }
    }

    /// A piece that is known.
    pub fn piece(&self, object: u32, piece: u32) -> Option<&PieceInfo> {
        self.info.pieces.iter().find(|known| (known.object, known.piece) == (object, piece))
    }

    fn piece_mut(&mut self, object: u32, piece: u32) -> Option<&mut PieceInfo> {
        self.info.pieces.iter_mut().find(|known| (known.object, known.piece) == (object, piece))
    }

    /// What of a kind of material an object or a piece of it has: its own, or else its whole's own, or else what all have.
    pub fn made_of(&self, object: u32, piece: Option<u32>, material: u32) -> Option<&Material> {
        let of_piece = piece.and_then(|piece| self.piece(object, piece)).map(|known| &known.own);
        let of_whole = self.info.objects.get(object as usize).map(|known| &known.own);
        let own = of_piece.into_iter().chain(of_whole).flatten();
        let found = own.into_iter().find(|(of, _)| *of == material).map(|(_, own)| own);
        found.or_else(|| self.info.materials.get(material as usize))
    }

    /// A piece as if it were an object: its name is made of its materials', its place is in scene space.
    pub fn piece_as_object(&self, object: u32, piece: u32) -> Option<ObjectInfo> {
        let known = self.piece(object, piece)?;
        let whole = self.info.objects.get(object as usize)?;
        let made =
            known.materials.iter().filter_map(|material| Some(&*self.info.materials.get(*material as usize)?.name));
        let made = made.filter(|name| !name.is_empty()).take(3).collect::<Vec<_>>().join(", ");
        let name = if made.is_empty() { format!("Piece {}", piece + 1) } else { made };
        let (place, materials) = (whole.place.after(&known.place), known.materials.clone());
        let (visible, bounds, own) = (known.visible, known.bounds, known.own.clone());
        Some(ObjectInfo { name, place, visible, moves: whole.moves, bounds, materials, own })
    }

    /// Whether a point lies among the objects: from within a room people look around, from before a thing they turn it.
    pub fn surrounds(&self, point: Vec3) -> bool {
        let visible = self.info.objects.iter().filter(|object| object.visible);
        let corners: Vec<Vec3> = visible.filter_map(ObjectInfo::corners).flatten().collect();
        (0..3)
            .all(|axis| corners.iter().any(|c| c[axis] < point[axis]) && corners.iter().any(|c| c[axis] > point[axis]))
    }
}

impl ObjectInfo {
    /// Its eight corners, scene space.
    pub(super) fn corners(&self) -> Option<[Vec3; 8]> {
        let [low, high] = self.bounds?;
        let corner = |i: usize| {
            let side = |axis: usize| if i >> axis & 1 == 1 { high[axis] } else { low[axis] };
            self.place.point(Vec3::new(side(0), side(1), side(2)))
        };
        Some(std::array::from_fn(corner))
    }
}

impl PieceInfo {
    /// It was moved, hidden, or made of something else.
    pub(super) fn is_lifted(&self) -> bool {
        !self.visible || !self.place.is_identity() || !self.own.is_empty()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn edits_are_made_in_the_copy() {
        let mut scene = scenes::Scene { name: "box".into(), ..scenes::Scene::default() };
        let positions = vec![Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z];
        let mesh = scenes::Mesh {
            positions,
            triangles: vec![[0, 1, 2], [0, 2, 3]],
            materials: vec![0; 2],
            ..Default::default()
        };
        scene.meshes.push(mesh.into());
        scene.materials.push(scenes::Material::diffuse("m", Vec3::ONE));
        let place = Transform { translation: Vec3::Y, ..Transform::IDENTITY };
        scene.objects.push(scenes::Object { scene_from_object: place, ..scenes::Object::fixed("o", 0) });
        let mut copy = SceneCopy { info: SceneInfo::of(&scene), ..SceneCopy::default() };
        assert_eq!((copy.info.objects[0].name.as_str(), copy.info.materials.len()), ("o", 1));
        assert!(copy.surrounds(Vec3::new(0.5, 1.5, 0.5)) && !copy.surrounds(Vec3::new(0.5, 0.5, 0.5)));
        let elsewhere = Transform { translation: Vec3::X, ..place };
        copy.learn(&Change::Transform { object: 0, scene_from_object: elsewhere });
        copy.learn(&Change::Visible { object: 7, visible: false });
        assert_eq!(copy.info.objects[0].place, elsewhere);
        assert_eq!(copy.info.objects[0].corners().unwrap()[0], Vec3::X);

        // A piece is where its object is, and is known from when it was picked first.
        let shifted = Transform { translation: Vec3::Z, ..Transform::IDENTITY };
        let lift = Change::PieceTransform { object: 0, piece: 0, whole_from_piece: shifted };
        copy.learn(&lift);
        assert!(copy.info.pieces.is_empty());
        copy.meet(PieceInfo::of(&scene, 0, 0));
        assert!(!copy.info.pieces[0].is_lifted());
        copy.learn(&lift);
        let piece = copy.piece_as_object(0, 0).unwrap();
        assert_eq!((piece.name.as_str(), piece.place.translation), ("m", Vec3::X + Vec3::Z));
        assert!(copy.info.pieces[0].is_lifted());
        let value = Some(Material::diffuse("red", Vec3::X));
        copy.learn(&Change::OwnMaterial { object: 0, piece: Some(0), material: 0, value });
        let names = [Some(0), None].map(|piece| copy.made_of(0, piece, 0).unwrap().name.as_str());
        assert_eq!(names, ["red", "m"]);
    }
}
