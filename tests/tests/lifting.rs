//! Pieces that people lift out of a room or make of something else: light is as if the file had kept them apart, and every
//! worker sees the same.

use std::path::Path;

use glam::Vec3;
use light::{LightSetCache, Prepared};
use protocol::answer::Body;
use protocol::question::{Ask, Lit, Quality, Question, Rect, Samples, Tile};
use scenes::{Change, Coverage, Material, Mesh, Object, Scene, Transform};

fn load(name: &str) -> Scene {
    scenes::read::load(&Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenes").join(name)).unwrap().scene
}

fn quality() -> Quality {
    Quality { light_samples: 4, vpls: 8, photons: 64, ..Quality::default() }
}

/// What a worker answers about a part of the picture, by both methods.
fn answers(prepared: &Prepared) -> [Body; 2] {
    let cache = LightSetCache::default();
    let mut camera = prepared.scene.camera;
    (camera.width, camera.height) = (64, 48);
    let rect = Rect { x: 0, y: 0, width: 64, height: 48 };
    let samples = Samples { camera, rect, first: 0, count: 2, seed: 1, max_bounces: Some(2) };
    let tile = Tile { camera, rect, lit: Lit { set: 1, frame: 0, seed: 3, quality: quality() } };
    [Ask::Tile(tile), Ask::Reference(samples)]
        .map(|ask| light::answer(prepared, &cache, &Question { world: Default::default(), ask }, &|| 0).body)
}

fn shifted(by: Vec3) -> Transform {
    Transform { translation: by, ..Transform::IDENTITY }
}

/// A chair, a table, a lamp, and a thing that is hidden; the chair is painted, nothing is left of the table and of what
/// the walls are made of, the lamp is brighter.
fn changes(scene: &Scene) -> Vec<Change> {
    let pieces = scene.meshes[0].pieces();
    let shines = |t: &u32| !scene.materials[scene.meshes[0].materials[*t as usize] as usize].emission.is_black();
    let find = |wanted: &dyn Fn(&[u32]) -> bool| {
        (0..pieces.count() as u32).find(|piece| wanted(pieces.triangles(*piece))).expect("conference has one")
    };
    let of_size = |size: usize| find(&|triangles| triangles.len() == size);
    let (chair, table, bin) = (of_size(1428), of_size(5000), of_size(1276));
    let lamp = find(&|triangles| triangles.iter().all(shines));
    let made_of = |piece: u32| scene.meshes[0].materials[pieces.triangles(piece)[0] as usize];
    let own = |piece: Option<u32>, material: u32, change: &dyn Fn(&mut Material)| {
        let mut value = scene.materials[material as usize].clone();
        change(&mut value);
        Change::OwnMaterial { object: 0, piece, material, value: Some(value) }
    };
    let bare = |material: &mut Material| material.coverage = Some(Coverage::plain(0.0));
    let red = |material: &mut Material| *material = Material::diffuse("red", Vec3::X * 0.8);
    let largest = (0..pieces.count() as u32).max_by_key(|piece| pieces.triangles(*piece).len()).expect("pieces");
    let put = |piece, by| Change::PieceTransform { object: 0, piece, whole_from_piece: shifted(by) };
    vec![
        put(chair, Vec3::new(0.0, 1.0, 2.0)),
        put(table, Vec3::new(0.5, 0.0, 0.0)),
        Change::PieceVisible { object: 0, piece: bin, visible: false },
        put(lamp, Vec3::new(0.0, -2.0, 0.0)),
        own(Some(table), made_of(table), &bare),
        own(None, made_of(largest), &bare),
        own(Some(lamp), made_of(lamp), &|material| material.emission.value *= 3.0),
        own(Some(chair), made_of(chair), &red),
        put(chair, Vec3::new(1.0, 0.0, 2.5)),
    ]
}

#[test]
fn a_worker_that_joins_late_answers_as_one_that_was_there_and_undo_gives_the_first_answers() {
    let scene = load("conference");
    let mut there = Prepared::new(scene.clone());
    let first = answers(&there);
    let mut back = Vec::new();
    for change in changes(&scene) {
        back.push(change.undo(&there.scene).unwrap());
        there.apply(&change).unwrap();
    }
    // Told the changes that count, in the order in which they count.
    let mut late = scene.clone();
    changes(&scene)[1..].iter().for_each(|change| change.apply(&mut late).unwrap());
    assert_eq!(late, *there.scene);
    let lifted = answers(&there);
    assert!(lifted == answers(&Prepared::new(late)), "the late worker sees something else");
    assert!(lifted != first, "nothing has changed");
    back.iter().rev().for_each(|change| there.apply(change).unwrap());
    assert_eq!(*there.scene, scene);
    assert!(answers(&there) == first, "undone, it is not as it was");
}

/// The same scene as if its file had kept every lifted piece apart.
fn taken_apart(scene: &Scene) -> Scene {
    let mut apart = Scene { objects: Vec::new(), meshes: Vec::new(), ..scene.clone() };
    for (number, object) in scene.objects.iter().enumerate() {
        let mesh = &scene.meshes[object.mesh as usize];
        let own: Vec<usize> = scene.triangles(number).collect();
        let (triangles, materials) = own.iter().map(|t| (mesh.triangles[*t], scene.material_of(number, *t))).unzip();
        apart.meshes.push(Mesh { triangles, materials, found: Default::default(), ..Mesh::clone(mesh) }.into());
        apart.objects.push(Object { mesh: number as u32, lifted: None, own: Vec::new(), ..object.clone() });
    }
    apart
}

#[test]
fn light_is_as_if_the_file_had_kept_the_pieces_apart() {
    let scene = load("conference");
    let mut lifted = Prepared::new(scene.clone());
    changes(&scene).iter().for_each(|change| lifted.apply(change).unwrap());
    let apart = Prepared::new(taken_apart(&lifted.scene));
    assert_eq!(lifted.needs, apart.needs);
    assert!(answers(&lifted) == answers(&apart), "light differs");
}
