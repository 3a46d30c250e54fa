//! Undo and redo: every edit is kept with what takes it back.

use scenes::{Change, Scene};

/// What was edited, and what was taken back.
#[derive(Clone, Debug, Default)]
pub struct Edits {
    done: Vec<Edit>,
    undone: Vec<Edit>,
}

/// One step, as a person sees it.
#[derive(Clone, Debug, PartialEq)]
struct Edit {
    /// What was done.
    forth: Vec<Change>,
    /// What takes it back, in this order.
    back: Vec<Change>,
    /// Edits of one gesture (a drag, a turn of a slider) are one step; nothing: a step of its own.
    gesture: Option<u64>,
}

/// Steps that can be taken back.
const STEPS_MAX: usize = 1000;

impl Edits {
    /// Remembers changes that are **about to be made** to a scene, after others that wait to be made.
    pub fn remember(&mut self, scene: &Scene, waiting: &[Change], changes: &[Change], gesture: Option<u64>) {
        self.undone.clear();
        let undo = |change: &Change| {
            let earlier = waiting.iter().rev().find(|earlier| change.supersedes(earlier));
            earlier.cloned().or_else(|| change.undo(scene))
        };
        let back: Vec<_> = changes.iter().filter_map(undo).collect();
        if let Some(last) = self.done.last_mut().filter(|last| gesture.is_some() && last.gesture == gesture) {
            // The oldest way back counts, and the newest way forth.
            let is_new = |change: &Change| !last.back.iter().any(|earlier| earlier.supersedes(change));
            let new: Vec<_> = back.into_iter().filter(is_new).collect();
            last.back.splice(0..0, new);
            for change in changes {
                last.forth.retain(|earlier| !change.supersedes(earlier));
                last.forth.push(change.clone());
            }
            return;
        }
        if self.done.len() == STEPS_MAX {
            self.done.remove(0);
        }
        self.done.push(Edit { forth: changes.to_vec(), back: back.into_iter().rev().collect(), gesture });
    }

    /// The changes that take the last step back; nothing if there is none.
    pub fn undo(&mut self) -> Option<Vec<Change>> {
        let mut edit = self.done.pop()?;
        edit.gesture = None;
        let back = edit.back.clone();
        self.undone.push(edit);
        Some(back)
    }

    /// The changes that make the last step that was taken back again; nothing if there is none.
    pub fn redo(&mut self) -> Option<Vec<Change>> {
        let edit = self.undone.pop()?;
        let forth = edit.forth.clone();
        self.done.push(edit);
        Some(forth)
    }

    /// How many steps can be taken back, and how many made again.
    pub fn steps(&self) -> [usize; 2] {
        [self.done.len(), self.undone.len()]
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;
    use proptest::prelude::*;
    use scenes::{Light, Material, Mesh, Object, Transform};

    use super::*;

    fn scene() -> Scene {
        let corner = |i: u32| Vec3::new((i / 3 * 10) as f32, (i % 3 % 2) as f32, (i % 3 / 2) as f32);
        let mesh = Mesh {
            positions: (0..9).map(corner).collect(),
            triangles: (0..3).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect(),
            materials: vec![0; 3],
            ..Mesh::default()
        };
        Scene {
            meshes: vec![mesh],
            objects: (0..3).map(|i| Object::fixed(i.to_string(), 0)).collect(),
            materials: vec![Material::diffuse("a", Vec3::ONE); 2],
            lights: vec![Light::Point { position: Vec3::ZERO, intensity: Vec3::ONE }; 2],
            ..Scene::default()
        }
    }

    fn change() -> impl Strategy<Value = Change> {
        let transform = |x: u8| Transform { translation: Vec3::splat(f32::from(x)), ..Transform::IDENTITY };
        let point = |x: u8| Light::Point { position: Vec3::splat(f32::from(x)), intensity: Vec3::ONE };
        prop_oneof![
            (0u32..3, any::<u8>())
                .prop_map(move |(object, x)| Change::Transform { object, scene_from_object: transform(x) }),
            (0u32..3, any::<bool>()).prop_map(|(object, visible)| Change::Visible { object, visible }),
            (0u32..3, 0u32..3, any::<u8>()).prop_map(move |(object, piece, x)| Change::PieceTransform {
                object,
                piece,
                whole_from_piece: transform(x)
            }),
            (0u32..3, 0u32..3, any::<bool>()).prop_map(|(object, piece, visible)| Change::PieceVisible {
                object,
                piece,
                visible
            }),
            (0u32..2, any::<u8>()).prop_map(move |(light, x)| Change::Light { light, value: point(x) }),
            (0u32..2, any::<u8>()).prop_map(|(material, x)| Change::Material {
                material,
                value: Material::diffuse(x.to_string(), Vec3::splat(f32::from(x) / 255.0))
            }),
        ]
    }

    proptest! {
        #[test]
        fn undoing_everything_gives_the_scene_of_the_beginning_and_redoing_that_of_the_end(
            steps in prop::collection::vec((prop::collection::vec(change(), 1..4), prop::option::of(0u64..3)), 1..20)
        ) {
            let start = scene();
            let (mut now, mut edits) = (start.clone(), Edits::default());
            for (changes, gesture) in steps {
                edits.remember(&now, &[], &changes, gesture);
                changes.iter().for_each(|change| change.apply(&mut now).unwrap());
            }
            let end = now.clone();
            while let Some(back) = edits.undo() {
                back.iter().for_each(|change| change.apply(&mut now).unwrap());
            }
            prop_assert_eq!(&now, &start);
            while let Some(forth) = edits.redo() {
                forth.iter().for_each(|change| change.apply(&mut now).unwrap());
            }
            prop_assert_eq!(&now, &end);
        }
    }

    #[test]
    fn what_waits_counts_as_done() {
        let (now, mut edits) = (scene(), Edits::default());
        let hide = Change::Visible { object: 2, visible: false };
        let show = Change::Visible { object: 2, visible: true };
        edits.remember(&now, std::slice::from_ref(&hide), std::slice::from_ref(&show), None);
        assert_eq!(edits.undo(), Some(vec![hide]));
    }

    #[test]
    fn a_drag_is_one_step() {
        let (mut now, mut edits) = (scene(), Edits::default());
        for x in 0..50 {
            let place = Transform { translation: Vec3::splat(x as f32), ..Transform::IDENTITY };
            let change = Change::Transform { object: 1, scene_from_object: place };
            edits.remember(&now, &[], std::slice::from_ref(&change), Some(7));
            change.apply(&mut now).unwrap();
        }
        assert_eq!(edits.steps(), [1, 0]);
        edits.undo().unwrap().iter().for_each(|change| change.apply(&mut now).unwrap());
        assert_eq!(now, scene());
        assert_eq!(edits.steps(), [0, 1]);
    }
}
