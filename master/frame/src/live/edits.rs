//! Undo and redo: every edit is kept with what takes it back.

use scenes::{Change, Scene, Transform};

/// What was edited, and what was taken back.
#[derive(Clone, Debug, Default)]
pub struct Edits {
    done: Vec<Edit>,
    undone: Vec<Edit>,
    /// The moment that moving objects were posed at last: poses alone do not tell it.
    time: f64,
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
    /// Nothing has been edited yet, and everything that moves is where it is at this time.
    pub fn new(time: f64) -> Self {
        Self { time, ..Self::default() }
    }

    /// Remembers changes that are **about to be made** to a scene, after others that wait to be made.
    pub fn remember(&mut self, scene: &Scene, waiting: &[Change], changes: &[Change], gesture: Option<u64>) {
        self.undone.clear();
        let back: Vec<_> = changes.iter().rev().flat_map(|change| self.way_back(scene, waiting, change)).collect();
        self.note_time(changes);
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
        self.done.push(Edit { forth: changes.to_vec(), back, gesture });
    }

    /// What takes a change back, in this order, as if those that wait had been made.
    fn way_back(&self, scene: &Scene, waiting: &[Change], change: &Change) -> Vec<Change> {
        let Some(mut back) = change.undo(scene) else { return Vec::new() };
        let awaited = |(object, place): (u32, &mut Transform)| *place = awaited_pose(scene, waiting, object, *place);
        match &mut back {
            Change::Transform { object, scene_from_object } => awaited((*object, scene_from_object)),
            Change::Poses(poses) => poses.iter_mut().for_each(|(object, place)| awaited((*object, place))),
            _ => {
                let earlier = waiting.iter().rev().find(|earlier| change.supersedes(earlier));
                back = earlier.cloned().unwrap_or(back);
            }
        }
        // Poses do not tell what the time was.
        let time = matches!(change, Change::Time(_)).then_some(Change::Time(self.time));
        time.into_iter().chain([back]).collect()
    }

    fn note_time(&mut self, changes: &[Change]) {
        let mut times =
            changes.iter().filter_map(|change| if let Change::Time(time) = change { Some(*time) } else { None });
        self.time = times.next_back().unwrap_or(self.time);
    }

    /// The changes that take the last step back; nothing if there is none.
    pub fn undo(&mut self) -> Option<Vec<Change>> {
        let mut edit = self.done.pop()?;
        edit.gesture = None;
        let back = edit.back.clone();
        self.note_time(&back);
        self.undone.push(edit);
        Some(back)
    }

    /// The changes that make the last step that was taken back again; nothing if there is none.
    pub fn redo(&mut self) -> Option<Vec<Change>> {
        let edit = self.undone.pop()?;
        let forth = edit.forth.clone();
        self.note_time(&forth);
        self.done.push(edit);
        Some(forth)
    }

    /// What everything that moves was posed at last.
    pub fn time(&self) -> f64 {
        self.time
    }

    /// How many steps can be taken back, and how many made again.
    pub fn steps(&self) -> [usize; 2] {
        [self.done.len(), self.undone.len()]
    }
}

/// Where an object that is at `place` will be when the changes that wait have been made: several kinds put it somewhere.
fn awaited_pose(scene: &Scene, waiting: &[Change], object: u32, place: Transform) -> Transform {
    waiting.iter().fold(place, |place, change| {
        let put = match change {
            Change::Transform { object: moved, scene_from_object } => (*moved == object).then_some(*scene_from_object),
            Change::Poses(poses) => poses.iter().rev().find(|(moved, _)| *moved == object).map(|(_, there)| *there),
            Change::Time(time) => {
                let motion = scene.objects.get(object as usize).and_then(|object| object.motion.as_ref());
                motion.map(|motion| motion.at(*time))
            }
            _ => None,
        };
        put.unwrap_or(place)
    })
}

#[cfg(test)]
mod tests {
    use glam::Vec3;
    use proptest::prelude::*;
    use scenes::{Key, Light, Material, Mesh, Motion, Object};

    use super::*;

    fn scene() -> Scene {
        let corner = |i: u32| Vec3::new((i / 3 * 10) as f32, (i % 3 % 2) as f32, (i % 3 / 2) as f32);
        let mesh = Mesh {
            positions: (0..9).map(corner).collect(),
            triangles: (0..3).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect(),
            materials: vec![0; 3],
            ..Mesh::default()
        };
        let keys = [0.0_f32, 8.0].map(|t| Key { time: t.into(), translate: Vec3::splat(t), angle_deg: 0.0 });
        let motion = Motion { pivot: Vec3::ZERO, axis: Vec3::Y, keys: keys.to_vec() };
        let mut objects: Vec<_> = (0..3).map(|i| Object::fixed(i.to_string(), 0)).collect();
        objects[2].motion = Some(motion);
        Scene {
            meshes: vec![mesh],
            objects,
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
            (0u8..9).prop_map(|x| Change::Time(x.into())),
        ]
    }

    /// A scene, and the changes that wait to be made, as the loop keeps them.
    struct Stage {
        scene: Scene,
        waiting: Vec<Change>,
    }

    impl Stage {
        fn take(&mut self, changes: Vec<Change>) {
            for change in changes {
                self.waiting.retain(|earlier| !change.supersedes(earlier));
                self.waiting.push(change);
            }
        }

        fn now(&mut self) -> &Scene {
            self.waiting.drain(..).for_each(|change| change.apply(&mut self.scene).unwrap());
            &self.scene
        }
    }

    proptest! {
        #[test]
        fn undoing_everything_gives_the_scene_of_the_beginning_and_redoing_that_of_the_end(
            steps in prop::collection::vec(
                (prop::collection::vec(change(), 1..4), prop::option::of(0u64..3), any::<bool>()),
                1..20
            )
        ) {
            let start = scene();
            let mut stage = Stage { scene: start.clone(), waiting: Vec::new() };
            let mut edits = Edits::new(0.0);
            for (changes, gesture, waits) in steps {
                edits.remember(&stage.scene, &stage.waiting, &changes, gesture);
                stage.take(changes);
                if !waits {
                    stage.now();
                }
            }
            let (end, time) = (stage.now().clone(), edits.time);
            while let Some(back) = edits.undo() {
                stage.take(back);
            }
            prop_assert_eq!((stage.now(), edits.time), (&start, 0.0));
            while let Some(forth) = edits.redo() {
                stage.take(forth);
            }
            prop_assert_eq!((stage.now(), edits.time), (&end, time));
        }
    }

    #[test]
    fn what_moves_goes_back_to_where_a_time_that_waits_puts_it() {
        let (now, mut edits) = (scene(), Edits::default());
        let place = Transform { translation: Vec3::X, ..Transform::IDENTITY };
        edits.remember(&now, &[Change::Time(4.0)], &[Change::Transform { object: 2, scene_from_object: place }], None);
        let back = Transform { translation: Vec3::splat(4.0), ..Transform::IDENTITY };
        assert_eq!(edits.undo(), Some(vec![Change::Transform { object: 2, scene_from_object: back }]));
    }

    #[test]
    fn a_scrub_that_is_taken_back_tells_the_time_and_leaves_what_somebody_moved() {
        let (mut now, mut edits) = (scene(), Edits::new(1.0));
        now.objects[2].scene_from_object.translation = Vec3::X;
        edits.remember(&now, &[], &[Change::Time(5.0)], Some(1));
        edits.remember(&now, &[Change::Time(5.0)], &[Change::Time(6.0)], Some(1));
        let poses = Change::Poses(vec![(2, now.objects[2].scene_from_object)]);
        assert_eq!(edits.undo(), Some(vec![Change::Time(1.0), poses]));
        assert_eq!((edits.redo(), edits.time), (Some(vec![Change::Time(6.0)]), 6.0));
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
