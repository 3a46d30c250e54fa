//! Undo and redo: every edit is kept with what takes it back.

use scenes::change::{Lamp, Refused};
use scenes::{Change, Motion, Scene};

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
    /// Edits of one gesture (a drag, a turn of a slider) are one step; `None`: a step of its own.
    gesture: Option<u64>,
}

/// What a step does, and what takes it back, in order.
pub type Step = (Vec<Change>, Vec<Change>);

/// Steps that can be taken back.
const STEPS_MAX: usize = 1000;

impl Edits {
    /// Remembers changes that are **about to be made** to a scene, after others that wait to be made.
    pub fn remember(&mut self, scene: &Scene, waiting: &[Change], changes: &[Change], gesture: Option<u64>) {
        self.undone.clear();
        let back: Vec<_> = changes.iter().rev().filter_map(|change| way_back(scene, waiting, change)).collect();
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

    /// The changes that take the last step back; `None` if there is none.
    pub fn undo(&mut self) -> Option<Vec<Change>> {
        let mut edit = self.done.pop()?;
        edit.gesture = None;
        let back = edit.back.clone();
        self.undone.push(edit);
        Some(back)
    }

    /// The changes that make the last step that was taken back again; `None` if there is none.
    pub fn redo(&mut self) -> Option<Vec<Change>> {
        let edit = self.undone.pop()?;
        let forth = edit.forth.clone();
        self.done.push(edit);
        Some(forth)
    }

    /// The last steps that can be taken back, and the first that can be made again, at most so many of each; the later
    /// ones, which come last, are taken back and made again first.
    pub fn history(&self, most: usize) -> [Vec<Step>; 2] {
        [&self.done, &self.undone].map(|steps| {
            let last = &steps[steps.len().saturating_sub(most)..];
            last.iter().map(|Edit { forth, back, .. }| (forth.clone(), back.clone())).collect()
        })
    }

    /// With such a history.
    pub fn with_history(history: [Vec<Step>; 2]) -> Self {
        let [done, undone] = history.map(|steps| {
            let first = steps.len().saturating_sub(STEPS_MAX);
            let steps = steps.into_iter().skip(first);
            steps.map(|(forth, back)| Edit { forth, back, gesture: None }).collect()
        });
        Self { done, undone }
    }

    /// How many steps can be taken back, and how many made again.
    pub fn steps(&self) -> [usize; 2] {
        [self.done.len(), self.undone.len()]
    }
}

/// What takes a change back, as if those that wait had been made.
fn way_back(scene: &Scene, waiting: &[Change], change: &Change) -> Option<Change> {
    let back = change.undo(scene)?;
    Some(waiting.iter().rev().find(|earlier| change.supersedes(earlier)).cloned().unwrap_or(back))
}

/// The moment at which everything that moves stands where it is, when the changes that wait have been made.
pub fn time(scene: &Scene, waiting: &[Change]) -> f64 {
    let mut times =
        waiting.iter().rev().filter_map(|change| if let Change::Time(time) = change { Some(*time) } else { None });
    times.next().unwrap_or(scene.time)
}

/// How an object moves, when the changes that wait have been made; `None` if it does not.
pub fn motion(scene: &Scene, waiting: &[Change], object: u32) -> Option<Motion> {
    let motion = scene.objects.get(object as usize)?.motion.clone()?;
    let mut offsets = waiting.iter().rev().filter_map(|change| match change {
        Change::Offset { object: there, offset } if *there == object => Some(*offset),
        _ => None,
    });
    let offset = offsets.next().unwrap_or(motion.offset);
    Some(Motion { offset, ..motion })
}

/// Whether a scene can take changes, after others that wait to be made: lamps may have solids that any of these brings along.
///
/// # Errors
/// [`Refused`] names what is out of range.
pub fn check(scene: &Scene, waiting: &[Change], changes: &[Change]) -> Result<(), Refused> {
    let solids: Vec<_> =
        waiting.iter().chain(changes).filter(|change| matches!(change, Change::Solid { .. })).collect();
    if solids.is_empty() {
        return changes.iter().try_for_each(|change| change.check(scene));
    }
    let mut with = scene.clone();
    solids.into_iter().try_for_each(|solid| solid.apply(&mut with))?;
    changes.iter().try_for_each(|change| change.check(&with))
}

/// What people want, as changes for a scene, after others that wait to be made: they say where an object should be, of
/// one that moves by itself too.
pub fn composed(scene: &Scene, waiting: &[Change], wanted: Vec<Change>) -> Vec<Change> {
    let mut all = waiting.to_vec();
    for change in wanted {
        all.push(match change {
            Change::Transform { object, scene_from_object } => {
                Change::place(object, motion(scene, &all, object).as_ref(), time(scene, &all), scene_from_object)
            }
            change => change,
        });
    }
    all.split_off(waiting.len())
}

/// The same changes, in which lights that the scene's file does not have, `files` of which it has, are spoken of as lamps: so
/// each says all there is to say, and may come before the lamp has been put there.
pub fn of_lamps(scene: &Scene, waiting: &[Change], wanted: Vec<Change>, files: usize) -> Vec<Change> {
    let mut all = waiting.to_vec();
    for change in wanted {
        let whole = match &change {
            Change::Light { light, value } if *light as usize >= files => {
                let mut before = all.iter().rev().filter_map(|earlier| match earlier {
                    Change::Lamp { light: there, value } if there == light => Some(value.clone()),
                    _ => None,
                });
                let lamp = before.next().unwrap_or_else(|| scene.lamp(*light));
                lamp.map(|lamp| Change::Lamp { light: *light, value: Some(Lamp { light: value.clone(), ..lamp }) })
            }
            _ => None,
        };
        all.push(whole.unwrap_or(change));
    }
    all.split_off(waiting.len())
}

#[cfg(test)]
mod tests {
    use glam::Vec3;
    use proptest::prelude::*;
    use scenes::{Environment, Key, Light, Material, Mesh, Object, Offset, Transform};

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
        let motion = Motion {
            pivot: Vec3::ZERO,
            axis: Vec3::Y,
            keys: keys.to_vec(),
            poses: Vec::new(),
            offset: Offset::default(),
        };
        let mut objects: Vec<_> = (0..3).map(|i| Object::fixed(i.to_string(), 0)).collect();
        objects[2].motion = Some(motion);
        Scene {
            meshes: vec![mesh.into()],
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
            (0u32..2, any::<u8>())
                .prop_map(move |(object, x)| Change::Transform { object, scene_from_object: transform(x) }),
            any::<u8>().prop_map(|x| {
                let shift = Vec3::splat(f32::from(x));
                Change::Offset { object: 2, offset: Offset { shift, ..Offset::default() } }
            }),
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
            (0u32..5, prop::option::of(any::<u8>())).prop_map(move |(light, x)| {
                let value = x.map(|x| Lamp { name: String::new(), light: point(x) });
                Change::Lamp { light: light + 2, value }
            }),
            any::<u8>().prop_map(|x| Change::Environment(Environment::Constant(Vec3::splat(x.into())))),
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
            let mut edits = Edits::default();
            for (changes, gesture, waits) in steps {
                edits.remember(&stage.scene, &stage.waiting, &changes, gesture);
                stage.take(changes);
                if !waits {
                    stage.now();
                }
            }
            let end = stage.now().clone();
            while let Some(back) = edits.undo() {
                stage.take(back);
            }
            prop_assert_eq!(stage.now(), &start);
            while let Some(forth) = edits.redo() {
                stage.take(forth);
            }
            prop_assert_eq!(stage.now(), &end);
        }
    }

    #[test]
    fn what_moves_is_put_where_it_is_wanted_at_the_time_that_waits_and_goes_on_from_there() {
        let (mut now, mut edits) = (scene(), Edits::default());
        let waiting = [Change::Time(4.0)];
        let place = Transform { translation: Vec3::new(4.0, 4.0, 5.0), ..Transform::IDENTITY };
        let wanted = vec![Change::Transform { object: 2, scene_from_object: place }];
        let changes = composed(&now, &waiting, wanted);
        assert_eq!(changes, [Change::Offset { object: 2, offset: Offset { shift: Vec3::Z, ..Offset::default() } }]);
        edits.remember(&now, &waiting, &changes, None);
        waiting.iter().chain(&changes).for_each(|change| change.apply(&mut now).unwrap());
        assert_eq!(now.objects[2].scene_from_object, place);
        Change::Time(6.0).apply(&mut now).unwrap();
        assert_eq!(now.objects[2].scene_from_object.translation, Vec3::new(6.0, 6.0, 7.0));
        assert_eq!(edits.undo(), Some(vec![Change::Offset { object: 2, offset: Offset::default() }]));
    }

    #[test]
    fn a_scrub_that_is_taken_back_leaves_what_somebody_moved() {
        let (mut now, mut edits) = (scene(), Edits::default());
        let offset = Offset { shift: Vec3::X, ..Offset::default() };
        Change::Offset { object: 2, offset }.apply(&mut now).unwrap();
        Change::Time(1.0).apply(&mut now).unwrap();
        let before = now.clone();
        edits.remember(&now, &[], &[Change::Time(5.0)], Some(1));
        edits.remember(&now, &[Change::Time(5.0)], &[Change::Time(6.0)], Some(1));
        Change::Time(6.0).apply(&mut now).unwrap();
        let back = edits.undo().unwrap();
        assert_eq!(back, [Change::Time(1.0)]);
        back[0].apply(&mut now).unwrap();
        assert_eq!(now, before);
        assert_eq!(edits.redo(), Some(vec![Change::Time(6.0)]));
    }

    #[test]
    fn a_lamp_that_waits_to_be_put_there_is_moved_and_goes_as_a_whole() {
        let start = Scene { light_names: vec!["a".into(), "b".into()], ..scene() };
        let (mut now, mut edits) = (start.clone(), Edits::default());
        let point = |x: f32| Light::Point { position: Vec3::X * x, intensity: Vec3::ONE };
        let lamp = |x: f32| Change::Lamp { light: 3, value: Some(Lamp { name: "new".into(), light: point(x) }) };
        let added = [lamp(1.0)];
        edits.remember(&now, &[], &added, None);
        let moved = of_lamps(&now, &added, vec![Change::Light { light: 3, value: point(2.0) }], now.lights.len());
        assert_eq!(moved, [lamp(2.0)]);
        edits.remember(&now, &added, &moved, None);
        moved[0].apply(&mut now).unwrap();
        assert_eq!((now.lights.len(), now.lamp(2), now.light_names[3].as_str()), (4, None, "new"));
        assert_eq!(edits.undo(), Some(added.to_vec()));
        edits.undo().unwrap().iter().for_each(|change| change.apply(&mut now).unwrap());
        assert_eq!(now, start);
        let own = vec![Change::Light { light: 1, value: point(2.0) }];
        assert_eq!(of_lamps(&now, &[], own.clone(), 2), own, "the file's own keeps its kind of change");
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
