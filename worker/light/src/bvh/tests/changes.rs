//! Worlds that were edited against brute force, and against worlds built anew.

use super::*;

#[test]
fn a_material_that_loses_its_holes_rebuilds_only_what_is_made_of_it() {
    let mut dice = Dice(23);
    let mut scene = instances_with_holes(&mut dice);
    let before = World::build(&scene);
    scene.materials[1].coverage = None;
    let mut after = before.clone();
    after.rebuild_with(&scene, 1);
    for (old, new) in before.instances().iter().zip(after.instances()) {
        let is_kept = std::sync::Arc::ptr_eq(&old.solid, &new.solid);
        assert_eq!(is_kept, scene.objects[old.object as usize].mesh == 0);
    }
    let fresh = World::build(&scene);
    for _ in 0..500 {
        let ray = Ray { origin: dice.point() * 3.0, direction: dice.direction(), t_max: f32::INFINITY };
        assert_eq!(after.closest(&ray), fresh.closest(&ray));
    }
}

#[test]
fn moving_an_object_gives_the_world_built_anew() {
    let mut dice = Dice(3);
    let mut scene = scene_of(vec![mesh_of(&soup(&mut dice, 50, 0.4)), mesh_of(&soup(&mut dice, 20, 0.4))]);
    scene.objects[1].visible = false;
    let mut world = World::build(&scene);
    scene.objects[1].visible = true;
    scene.objects[0].scene_from_object.translation.x = 0.25;
    world.rebuild_top(&scene);
    for _ in 0..2000 {
        let ray = Ray { origin: dice.point() * 1.5, direction: dice.point(), t_max: f32::INFINITY };
        check_ray(&world, &scene, &ray);
    }
}

/// Some change of a piece of one of the first objects.
fn lifting(scene: &Scene, dice: &mut Dice) -> Change {
    let object = dice.word() % scene.wholes().min(4) as u32;
    let mesh = scene.objects[object as usize].mesh;
    let piece = dice.word() % scene.meshes[mesh as usize].pieces().count() as u32;
    let whole_from_piece = Transform { translation: dice.point() * 0.5, ..Transform::IDENTITY };
    match dice.word() % 4 {
        0 => Change::PieceVisible { object, piece, visible: false },
        1 => Change::PieceVisible { object, piece, visible: true },
        2 => Change::Visible { object, visible: dice.word().is_multiple_of(2) },
        _ => Change::PieceTransform { object, piece, whole_from_piece },
    }
}

#[test]
fn lifted_pieces_equal_brute_force_and_a_world_built_anew() {
    let mut dice = Dice(31);
    let mut scene = scene_of(vec![mesh_of(&soup(&mut dice, 60, 0.15)), mesh_of(&soup(&mut dice, 20, 0.4))]);
    scene.objects.extend([0, 0, 1].map(|mesh| Object::fixed("", mesh)));
    scene.objects[2].scene_from_object.translation = Vec3::X;
    let mut world = World::build(&scene);
    for _ in 0..120 {
        lifting(&scene, &mut dice).apply(&mut scene).unwrap();
        world.rebuild_top(&scene);
        let fresh = World::build(&scene);
        assert_eq!((world.bounds(), world.left_out()), (fresh.bounds(), fresh.left_out()));
        for _ in 0..60 {
            let ray = Ray { origin: dice.point() * 1.5, direction: dice.point(), t_max: f32::INFINITY };
            check_ray(&world, &scene, &ray);
            assert_eq!(fresh.closest(&ray), world.closest(&ray));
        }
    }
    assert!(scene.objects.len() > scene.wholes() + 5);
}

#[test]
fn pieces_with_holes_can_be_lifted_and_everything_be_put_back() {
    let mut dice = Dice(32);
    let mut scene = instances_with_holes(&mut dice);
    let (first, mut world) = (scene.clone(), World::build(&scene));
    let (bytes, bounds) = (world.bytes(), world.bounds());
    let mut back = Vec::new();
    for _ in 0..40 {
        let change = lifting(&scene, &mut dice);
        back.push(change.undo(&scene).unwrap());
        change.apply(&mut scene).unwrap();
        world.rebuild_top(&scene);
        for _ in 0..20 {
            let ray = Ray { origin: dice.point() * 3.0, direction: dice.direction(), t_max: f32::INFINITY };
            assert_eq!(world.closest(&ray), World::build(&scene).closest(&ray));
        }
    }
    back.iter().rev().for_each(|change| change.apply(&mut scene).unwrap());
    assert_eq!(scene, first);
    world.rebuild_top(&scene);
    assert_eq!((world.bytes(), world.bounds()), (bytes, bounds));
    let before = World::build(&scene);
    for _ in 0..2000 {
        let ray = Ray { origin: dice.point() * 3.0, direction: dice.direction(), t_max: f32::INFINITY };
        assert_eq!(world.closest(&ray), before.closest(&ray));
    }
}

#[test]
fn an_object_all_of_whose_pieces_are_gone_is_met_by_nothing() {
    let mut dice = Dice(33);
    let mut scene = scene_of(vec![mesh_of(&soup(&mut dice, 30, 0.1)), mesh_of(&soup(&mut dice, 30, 0.1))]);
    let mut world = World::build(&scene);
    for piece in 0..scene.meshes[0].pieces().count() as u32 {
        Change::PieceVisible { object: 0, piece, visible: false }.apply(&mut scene).unwrap();
    }
    world.rebuild_top(&scene);
    check_random_rays(&scene, &mut dice, 200);
    for _ in 0..200 {
        let ray = Ray { origin: dice.point() * 1.5, direction: dice.point(), t_max: f32::INFINITY };
        check_ray(&world, &scene, &ray);
    }
    assert_eq!(world.left_out(), LeftOut::default());
}
