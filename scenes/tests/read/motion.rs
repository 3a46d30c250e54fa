//! What of a glTF file is posed: skins, morph targets, animations, instances, what is switched off.

use glam::{Vec3, vec3};
use scenes::read::{Loaded, load_at};
use scenes::{Change, Scene};
use serde_json::{Value, json};

use crate::attributes::accessor;
use crate::folder::{Folder, notes};
use crate::gltf::{set, square, square_bytes, try_load};

fn at(document: &Value, time: f64) -> Loaded {
    let text = document.to_string();
    let folder = Folder::of(&[("a.gltf", text.as_bytes()), ("square.bin", &square_bytes())]);
    let loaded = load_at(&folder.path("a.gltf"), Some(time)).unwrap_or_else(|error| panic!("{error}"));
    loaded.scene.check().unwrap();
    loaded
}

/// Where the corners of an object are.
fn corners(scene: &Scene, object: usize) -> Vec<Vec3> {
    let object = &scene.objects[object];
    scene.meshes[object.mesh as usize].positions.iter().map(|p| object.scene_from_object.point(*p)).collect()
}

fn assert_near(found: &[Vec3], expected: &[Vec3]) {
    let near = found.len() == expected.len() && found.iter().zip(expected).all(|(a, b)| (*a - *b).length() < 1e-4);
    assert!(near, "{found:?} is not {expected:?}");
}

/// The square, held at its lower corners by one joint and at its upper ones by another, 1 above it.
fn skinned() -> Value {
    let mut document = square();
    let first = [1.0_f32, 0.0, 0.0, 0.0];
    let weights = accessor(&mut document, "VEC4", 4, &first.repeat(4));
    let mut joints = vec![0_u8; 16];
    (joints[8], joints[12]) = (1, 1);
    let uri = format!("data:;base64,{}", crate::gltf::base64(&joints));
    let (buffer, view) =
        (document["buffers"].as_array().unwrap().len(), document["bufferViews"].as_array().unwrap().len());
    set(&mut document, "/buffers/-", json!({ "uri": uri, "byteLength": 16 }));
    set(&mut document, "/bufferViews/-", json!({ "buffer": buffer, "byteLength": 16 }));
    set(
        &mut document,
        "/accessors/-",
        json!({ "bufferView": view, "componentType": 5121, "count": 4, "type": "VEC4" }),
    );
    let joint_numbers = document["accessors"].as_array().unwrap().len() - 1;
    #[rustfmt::skip]
    let bind = accessor(&mut document, "MAT4", 2, &[
        1.0, 0.0, 0.0, 0.0,  0.0, 1.0, 0.0, 0.0,  0.0, 0.0, 1.0, 0.0,  0.0, 0.0, 0.0, 1.0,
        1.0, 0.0, 0.0, 0.0,  0.0, 1.0, 0.0, 0.0,  0.0, 0.0, 1.0, 0.0,  0.0, -1.0, 0.0, 1.0,
    ]);
    set(&mut document, "/meshes/0/primitives/0/attributes/JOINTS_0", json!(joint_numbers));
    set(&mut document, "/meshes/0/primitives/0/attributes/WEIGHTS_0", json!(weights));
    set(&mut document, "/skins", json!([{ "joints": [1, 2], "inverseBindMatrices": bind }]));
    // The specification says that a skinned mesh's own node moves nothing.
    set(&mut document, "/nodes/0/scale", json!([0.01, 0.01, 0.01]));
    set(&mut document, "/nodes/0/skin", json!(0));
    set(&mut document, "/nodes/-", json!({ "children": [2], "translation": [5, 0, 0] }));
    set(&mut document, "/nodes/-", json!({ "translation": [0, 1, 0] }));
    set(&mut document, "/scenes/0/nodes", json!([0, 1]));
    document
}

#[test]
fn skins_bend_meshes_and_their_own_node_moves_nothing() {
    let mut document = skinned();
    let at_rest = try_load(&document).unwrap().scene;
    assert_near(
        &corners(&at_rest, 0),
        &[vec3(5.0, 0.0, 0.0), vec3(6.0, 0.0, 0.0), vec3(6.0, 1.0, 0.0), vec3(5.0, 1.0, 0.0)],
    );
    // The upper joint turns by a quarter about x: what was up at it leans over it.
    set(&mut document, "/nodes/2/rotation", json!([0.707_106_77, 0, 0, 0.707_106_77]));
    set(&mut document, "/nodes/2/translation", json!([0, 2, 0]));
    let bent = try_load(&document).unwrap();
    assert_near(&corners(&bent.scene, 0)[2..], &[vec3(6.0, 2.0, 0.0), vec3(5.0, 2.0, 0.0)]);
    assert_near(&bent.scene.meshes[0].normals[2..3], &[Vec3::NEG_Y]);
    set(&mut document, "/skins/0/joints", json!([1, 9]));
    let broken = try_load(&document).unwrap();
    assert!(notes(&broken).contains("the mesh stays as modelled"), "{}", notes(&broken));
}

#[test]
fn morph_targets_have_the_weights_of_the_mesh_or_the_node() {
    let mut document = square();
    let up = accessor(&mut document, "VEC3", 4, &[0.0_f32, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 2.0, 0.0, 0.0, 2.0, 0.0]);
    set(&mut document, "/meshes/0/primitives/0/targets", json!([{ "POSITION": up }]));
    let top = |document: &Value| corners(&try_load(document).unwrap().scene, 0)[2].y;
    assert_eq!(top(&document), 1.0, "not at all, if nobody says");
    set(&mut document, "/meshes/0/weights", json!([1.0]));
    assert_eq!(top(&document), 3.0);
    set(&mut document, "/nodes/0/weights", json!([0.5]));
    assert_eq!(top(&document), 2.0);
}

/// A channel that moves a node's property.
fn animate(document: &mut Value, node: usize, path: &str, (kind, count): (&str, usize), times: &[f32], values: &[f32]) {
    let input = accessor(document, "SCALAR", times.len(), times);
    let output = accessor(document, kind, count, values);
    let sampler = json!({ "input": input, "output": output });
    let channel = json!({ "sampler": 0, "target": { "node": node, "path": path } });
    if document.get("animations").is_none() {
        set(document, "/animations", json!([]));
    }
    set(document, "/animations/-", json!({ "channels": [channel], "samplers": [sampler] }));
}

#[test]
fn animations_carry_nodes_and_what_hangs_on_them() {
    let mut document = square();
    set(&mut document, "/nodes", json!([{ "children": [1] }, { "mesh": 0, "translation": [0, 0, 1] }]));
    animate(&mut document, 0, "translation", ("VEC3", 2), &[1.0, 3.0], &[0.0, 0.0, 0.0, 4.0, 0.0, 0.0]);
    let half = std::f32::consts::FRAC_1_SQRT_2;
    animate(&mut document, 1, "rotation", ("VEC4", 2), &[1.0, 3.0], &[0.0, 0.0, 0.0, 1.0, 0.0, half, 0.0, half]);
    let mut scene = at(&document, 1.0).scene;
    assert_near(&corners(&scene, 0)[..2], &[vec3(0.0, 0.0, 1.0), vec3(1.0, 0.0, 1.0)]);
    // An eighth of a turn about y, in the middle; and the same by an edit of the time.
    let middle = [vec3(2.0, 0.0, 1.0), vec3(2.0 + half, 0.0, 1.0 - half)];
    assert_near(&corners(&at(&document, 2.0).scene, 0)[..2], &middle);
    Change::Time(2.0).apply(&mut scene).unwrap();
    assert_near(&corners(&scene, 0)[..2], &middle);
    Change::Time(9.0).apply(&mut scene).unwrap();
    assert_near(&corners(&scene, 0)[..2], &[vec3(4.0, 0.0, 1.0), vec3(4.0, 0.0, 0.0)]);
}

#[test]
fn what_is_bent_by_an_animation_has_a_mesh_for_each_moment() {
    let mut document = skinned();
    animate(&mut document, 2, "translation", ("VEC3", 2), &[0.0, 1.0], &[0.0, 1.0, 0.0, 0.0, 3.0, 0.0]);
    let mut scene = at(&document, 0.0).scene;
    let top = |scene: &Scene| corners(scene, 0)[2].y;
    assert!((top(&scene) - 1.0).abs() < 1e-4);
    Change::Time(0.5).apply(&mut scene).unwrap();
    assert!((top(&scene) - 2.0).abs() < 0.05, "{}", top(&scene));
    Change::Time(1.0).apply(&mut scene).unwrap();
    assert!((top(&scene) - 3.0).abs() < 1e-4);
    let piece = Change::PieceVisible { object: 0, piece: 0, visible: false };
    assert!(piece.apply(&mut scene).is_err(), "its pieces would change with it");
    // Morph targets likewise.
    let mut document = square();
    let up = accessor(&mut document, "VEC3", 4, &[0.0_f32, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 2.0, 0.0, 0.0, 2.0, 0.0]);
    set(&mut document, "/meshes/0/primitives/0/targets", json!([{ "POSITION": up }]));
    animate(&mut document, 0, "weights", ("SCALAR", 2), &[0.0, 1.0], &[0.0, 1.0]);
    let mut scene = at(&document, 0.0).scene;
    Change::Time(1.0).apply(&mut scene).unwrap();
    assert!((top(&scene) - 3.0).abs() < 1e-4, "{}", top(&scene));
}

#[test]
fn of_animations_that_move_the_same_the_first_is_played() {
    let mut document = square();
    animate(&mut document, 0, "translation", ("VEC3", 1), &[0.0], &[1.0, 0.0, 0.0]);
    animate(&mut document, 0, "translation", ("VEC3", 1), &[0.0], &[7.0, 0.0, 0.0]);
    let loaded = at(&document, 0.0);
    assert_eq!(corners(&loaded.scene, 0)[0], Vec3::X);
    assert!(notes(&loaded).contains("not played are `1`"), "{}", notes(&loaded));
}

#[test]
fn instances_stand_where_their_attributes_say() {
    let mut document = square();
    let shifts = accessor(&mut document, "VEC3", 3, &[0.0_f32, 0.0, 0.0, 2.0, 0.0, 0.0, 4.0, 0.0, 0.0]);
    let sizes = accessor(&mut document, "VEC3", 3, &[1.0_f32, 1.0, 1.0, 2.0, 2.0, 2.0, 1.0, 1.0, 1.0]);
    let instancing = json!({ "attributes": { "TRANSLATION": shifts, "SCALE": sizes } });
    set(&mut document, "/nodes/0/extensions", json!({ "EXT_mesh_gpu_instancing": instancing }));
    let scene = try_load(&document).unwrap().scene;
    assert_eq!((scene.objects.len(), scene.meshes.len()), (3, 1));
    assert_near(&corners(&scene, 1)[..2], &[vec3(2.0, 0.0, 0.0), vec3(4.0, 0.0, 0.0)]);
}

#[test]
fn what_is_switched_off_is_there_but_hidden() {
    let mut document = square();
    set(
        &mut document,
        "/nodes/-",
        json!({ "children": [2], "extensions": { "KHR_node_visibility": { "visible": false } } }),
    );
    set(&mut document, "/nodes/-", json!({ "mesh": 0 }));
    set(&mut document, "/scenes/0/nodes", json!([0, 1]));
    let scene = try_load(&document).unwrap().scene;
    assert_eq!(scene.objects.iter().map(|object| object.visible).collect::<Vec<_>>(), [true, false]);
}

#[test]
fn an_orthographic_camera_sees_as_much_from_afar() {
    let mut document = square();
    set(
        &mut document,
        "/cameras",
        json!([{ "type": "orthographic",
        "orthographic": { "xmag": 2.0, "ymag": 1.0, "zfar": 10.0, "znear": 0.1 } }]),
    );
    set(&mut document, "/nodes/-", json!({ "camera": 0, "translation": [0, 0, 5] }));
    set(&mut document, "/scenes/0/nodes", json!([0, 1]));
    let loaded = try_load(&document).unwrap();
    let camera = loaded.scene.camera;
    assert_eq!((camera.width, camera.height), (960, 480));
    let lens = camera.lens();
    for z in [5.0, 0.0, -5.0] {
        let (x, y, _) = lens.project(vec3(2.0, 1.0, z)).unwrap();
        assert!((x - 960.0).abs() < 10.0 && y.abs() < 5.0, "{x} {y}");
    }
    assert!(notes(&loaded).contains("is orthographic: drawn from afar"), "{}", notes(&loaded));
}
