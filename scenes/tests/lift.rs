//! Pieces are lifted out of objects, and put back.

use glam::{Mat3, Vec3};
use proptest::prelude::*;
use scenes::{Change, Key, Material, Mesh, Motion, Object, Offset, Scene, Transform};

/// Two objects of one mesh of five far triangles; the second moves over time.
fn scene() -> Scene {
    let corner = |i: u32| Vec3::new((i / 3 * 10) as f32, (i % 3 % 2) as f32, (i % 3 / 2) as f32);
    let mesh = Mesh {
        positions: (0..15).map(corner).collect(),
        triangles: (0..5).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect(),
        materials: vec![0; 5],
        ..Mesh::default()
    };
    let key = |time: f64| Key { time, translate: Vec3::Y * time as f32, angle_deg: 0.0 };
    let motion = Motion {
        pivot: Vec3::ZERO,
        axis: Vec3::Y,
        keys: vec![key(0.0), key(8.0)],
        poses: Vec::new(),
        offset: Offset::default(),
    };
    let objects = vec![Object::fixed("a", 0), Object { motion: Some(motion), ..Object::fixed("b", 0) }];
    Scene { meshes: vec![mesh.into()], objects, materials: vec![Material::diffuse("m", Vec3::ONE)], ..Scene::default() }
}

fn shift(x: f32) -> Transform {
    Transform { translation: Vec3::X * x, ..Transform::IDENTITY }
}

fn change() -> impl Strategy<Value = Change> {
    prop_oneof![
        (0u32..2, 0u32..5, 0u8..3).prop_map(|(object, piece, x)| Change::PieceTransform {
            object,
            piece,
            whole_from_piece: shift(f32::from(x))
        }),
        (0u32..2, 0u32..5, any::<bool>()).prop_map(|(object, piece, visible)| Change::PieceVisible {
            object,
            piece,
            visible
        }),
        (0u8..3).prop_map(|x| Change::Transform { object: 0, scene_from_object: shift(f32::from(x)) }),
        (0u8..3, any::<bool>()).prop_map(|(x, turned)| {
            let own =
                Transform { linear: Mat3::from_rotation_y(if turned { 0.5 } else { 0.0 }), ..shift(f32::from(x)) };
            Change::Offset { object: 1, offset: Offset { own, shift: Vec3::Z * f32::from(x) } }
        }),
        (0u32..2, any::<bool>()).prop_map(|(object, visible)| Change::Visible { object, visible }),
        (0u8..9).prop_map(|time| Change::Time(f64::from(time))),
    ]
}

/// The same, without changes that later ones supersede: what a worker that comes late is told.
fn in_brief(changes: &[Change]) -> Vec<Change> {
    let mut brief: Vec<Change> = Vec::new();
    for change in changes {
        brief.retain(|earlier| !change.supersedes(earlier));
        brief.push(change.clone());
    }
    brief
}

proptest! {
    #[test]
    fn undoing_gives_the_exact_scene_and_late_workers_the_same(changes in prop::collection::vec(change(), 1..40)) {
        let mut now = scene();
        let mut scenes = Vec::new();
        for change in &changes {
            scenes.push((now.clone(), change.undo(&now).unwrap()));
            change.apply(&mut now).unwrap();
            prop_assert_eq!(now.check(), Ok(()));
            // Every triangle of both objects is there once.
            let mut there: Vec<_> = (0..now.objects.len())
                .flat_map(|o| {
                    let of = now.objects[o].lifted.as_ref().map_or(o, |lifted| lifted.of as usize);
                    now.triangles(o).map(move |triangle| (of, triangle))
                })
                .collect();
            there.sort_unstable();
            prop_assert!(there.into_iter().eq((0..2).flat_map(|o| (0..5).map(move |t| (o, t)))));
        }
        let mut again = scene();
        scene().changes_to(&now).iter().for_each(|change| change.apply(&mut again).unwrap());
        prop_assert_eq!(&again, &now);
        let mut late = scene();
        in_brief(&changes).iter().for_each(|change| change.apply(&mut late).unwrap());
        prop_assert_eq!(&late, &now);
        for (before, back) in scenes.into_iter().rev() {
            back.apply(&mut now).unwrap();
            prop_assert_eq!(&now, &before);
        }
    }
}

#[test]
fn a_piece_follows_its_whole() {
    let mut scene = scene();
    let lift = Change::PieceTransform { object: 1, piece: 3, whole_from_piece: shift(2.0) };
    lift.apply(&mut scene).unwrap();
    Change::Time(4.0).apply(&mut scene).unwrap();
    assert_eq!(scene.wholes(), 2);
    assert_eq!(scene.objects[2].scene_from_object.translation, Vec3::new(2.0, 4.0, 0.0));
    assert_eq!(scene.triangles(1).collect::<Vec<_>>(), [0, 1, 2, 4]);
    assert_eq!(scene.triangles(2).collect::<Vec<_>>(), [3]);
    Change::Visible { object: 1, visible: false }.apply(&mut scene).unwrap();
    assert!(!scene.objects[2].visible && scene.piece(1, 3).visible);
}

#[test]
fn what_does_not_exist_is_not_lifted() {
    let scene = scene();
    let refused = |object: u32, piece: u32| {
        let change = Change::PieceVisible { object, piece, visible: false };
        change.undo(&scene).is_none() && change.check(&scene).is_err()
    };
    assert!(!refused(1, 4) && refused(1, 5) && refused(2, 0) && refused(u32::MAX, u32::MAX));
    let flat = Transform { linear: glam::Mat3::ZERO, ..Transform::IDENTITY };
    assert!(Change::PieceTransform { object: 0, piece: 0, whole_from_piece: flat }.check(&scene).is_err());
    // Lifted pieces have no numbers of their own.
    let mut lifted = scene.clone();
    Change::PieceVisible { object: 0, piece: 0, visible: false }.apply(&mut lifted).unwrap();
    assert!(Change::Visible { object: 2, visible: true }.check(&lifted).is_err());
}

#[test]
fn liftings_that_cannot_be_are_unsound() {
    let mut sound = scene();
    for (piece, visible) in [(1, false), (3, false)] {
        Change::PieceVisible { object: 0, piece, visible }.apply(&mut sound).unwrap();
    }
    assert_eq!(sound.check(), Ok(()));
    let unsound = |edit: &dyn Fn(&mut Scene)| {
        let mut scene = sound.clone();
        edit(&mut scene);
        scene.check().is_err()
    };
    assert!(unsound(&|scene| scene.objects.swap(2, 3)));
    assert!(unsound(&|scene| scene.objects.swap(0, 3)));
    assert!(unsound(&|scene| scene.objects.push(Object::fixed("c", 0))));
    assert!(unsound(&|scene| scene.objects[3].lifted.as_mut().unwrap().piece = 5));
    assert!(unsound(&|scene| scene.objects[3].lifted.as_mut().unwrap().of = 3));
    assert!(unsound(&|scene| scene.objects[3].lifted.as_mut().unwrap().visible = true));
    assert!(unsound(&|scene| scene.objects[3].motion = scene.objects[1].motion.clone()));
}
