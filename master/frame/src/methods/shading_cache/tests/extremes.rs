//! Extremes: worlds that break caches.

use super::*;

/// As [`World::new`], with all that is a rule.
fn world(scene: Scene, lit: Lit) -> World {
    World::new(scene, &[("confidence", Value::Switch(true))], lit)
}

fn is_finite(picture: &Picture) -> bool {
    picture.pixels.iter().all(|pixel| pixel.is_finite())
}

#[test]
fn light_on_a_vertex_is_a_spot_and_spoils_nothing_beyond() {
    // In the middle of the wall's diagonal there is a vertex from the first division on. As near as that, one is lit by as much
    // as numbers can say.
    let lit: Lit = |_, _, at| Vec3::splat(1.0 + if at.length() < 0.02 { 1e30 } else { 0.0 });
    let mut world = world(wall(), lit);
    for _ in 0..60 {
        assert!(is_finite(&world.step(400)));
    }
    let picture = world.step(0);
    let right = picture.pixels.iter().filter(|pixel| (pixel.x - 0.5 / PI).abs() < 0.02).count();
    // The vertex has six patches, of a pixel each in the end.
    assert!(right > 64 * 48 * 9 / 10, "{right}");
    assert!(world.cache.adaptation.is_finite(), "what people are adapted to stays a number");
}

#[test]
fn needles_are_seen_and_divided_no_farther_than_pixels() {
    // Half a unit wide and a million times as long, straight away from the eye.
    let positions = vec![Vec3::new(-0.25, -0.5, 0.0), Vec3::new(0.25, -0.5, 0.0), Vec3::new(0.0, -0.5, -5e5)];
    let needle = Mesh { positions, triangles: vec![[0, 1, 2]], materials: vec![0], ..Mesh::default() };
    let scene = Scene { meshes: vec![needle.into()], ..wall() };
    let mut world = world(scene, |_, _, at| Vec3::splat(if at.z < -1.0 { 3.0 } else { 2.0 }));
    let picture = world.after(40, 400);
    let seen = picture.pixels.iter().filter(|pixel| pixel.x > 0.0).count();
    assert!(is_finite(&picture) && seen > 20, "{seen} pixels");
    assert!(picture.pixels.iter().all(|pixel| pixel.x < 3.01 * 0.5 / PI));
    // Towards its end there are thousands of units in a pixel.
    assert!(world.cache.mesh().patch_count() < 64 * seen, "{} patches", world.cache.mesh().patch_count());
    world.cache.mesh().check();
}

#[test]
fn of_two_surfaces_in_one_place_the_first_is_seen_and_nobody_asks_about_the_other() {
    let mut scene = wall();
    scene.meshes.push(square(4.0, 0.0, 0).into());
    scene.objects.push(Object::fixed("its double", 1));
    let lit: Lit = |_, at, _| {
        assert_eq!(at.object, 0, "what is not seen is not asked about");
        Vec3::splat(2.0)
    };
    let picture = world(scene, lit).after(12, 400);
    assert!(picture.pixels.iter().all(|pixel| (pixel.x - 1.0 / PI).abs() < 1e-4));
}

#[test]
fn a_piece_that_is_taken_out_and_put_back_has_its_patches_and_its_light() {
    let mut scene = wall();
    scene.meshes.push(square(0.5, 1.0, 0).into());
    scene.objects.push(Object::fixed("square", 1));
    let mut world = World::new(scene, &[], |_, at, _| Vec3::splat(1.0 + at.object as f32));
    let before = world.after(6, 400);
    let (roots, asked) = (world.cache.mesh().roots.len(), world.asked);
    let place = |x: f32| Transform { translation: Vec3::X * x, ..Transform::IDENTITY };
    world.edit(&Change::PieceTransform { object: 1, piece: 0, whole_from_piece: place(0.3) });
    let moved = world.step(0);
    world.edit(&Change::PieceVisible { object: 1, piece: 0, visible: false });
    let without = world.step(0);
    world.edit(&Change::PieceVisible { object: 1, piece: 0, visible: true });
    world.edit(&Change::PieceTransform { object: 1, piece: 0, whole_from_piece: place(0.0) });
    assert!(moved != before && without != moved);
    assert!(world.step(0) == before, "the same patches, and the same light");
    assert_eq!((world.cache.mesh().roots.len(), world.asked), (roots, asked));
}

#[test]
fn within_a_closed_thing_its_inside_is_seen() {
    let at = |corner: usize| Vec3::from_array([0, 1, 2].map(|axis| if corner >> axis & 1 == 1 { 4.0 } else { -4.0 }));
    let faces = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let triangles: Vec<[u32; 3]> = faces.iter().flat_map(|[a, b, c, d]| [[*a, *b, *c], [*a, *c, *d]]).collect();
    let positions = (0..8).map(at).collect();
    let cube = Mesh { positions, materials: vec![0; triangles.len()], triangles, ..Mesh::default() };
    let scene = Scene { meshes: vec![cube.into()], ..wall() };
    let mut world = world(scene, |_, at, _| Vec3::splat(if at.back { 2.0 } else { 9.0 }));
    let inside = world.after(8, 400);
    assert!(inside.pixels.iter().all(|pixel| (pixel.x - 1.0 / PI).abs() < 1e-3));
    world.view.camera.origin.z = 12.0;
    let outside = world.after(8, 400);
    let seen = outside.pixels.iter().filter(|pixel| (pixel.x - 9.0 * 0.5 / PI).abs() < 1e-3).count();
    assert!(seen > 100 && outside.pixels.iter().all(|pixel| pixel.x == 0.0 || pixel.x > 1.0), "{seen}");
}

#[test]
fn what_shines_and_reflects_nothing_is_right_at_once() {
    let mut scene = wall();
    scene.materials[0] =
        Material { emission: Colour::plain(Vec3::new(3.0, 2.0, 1.0)), ..Material::diffuse("lamp", Vec3::ZERO) };
    let mut world = world(scene, |_, _, _| Vec3::splat(5.0));
    for _ in 0..6 {
        assert!(world.step(400).pixels.iter().all(|pixel| *pixel == Vec3::new(3.0, 2.0, 1.0)));
    }
}
