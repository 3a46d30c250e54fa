//! Tests of `parts`.

use std::collections::BTreeMap;

use glam::{Mat3, vec2, vec3};
use proptest::prelude::*;
use scenes::{Colour, Gloss, Key, Motion, NormalMap, Offset, Scalar, Surface, Transform};

use super::*;

/// Small, but with one of everything that has a form of its own on the wire.
fn scene() -> Scene {
    let quad = Mesh {
        positions: vec![vec3(0.0, 0.0, 0.0), vec3(1.0, 0.0, 0.0), vec3(1.0, 1.0, 0.0), vec3(0.0, 1.0, 0.0)],
        normals: vec![Vec3::Z; 4],
        uvs: vec![vec2(0.0, 0.0), vec2(1.0, 0.0), vec2(1.0, 1.0), vec2(0.0, 1.0)],
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        materials: vec![0, 1],
        more_uvs: vec![vec![vec2(0.5, 0.25); 4]],
        tangents: vec![Vec4::new(1.0, 0.0, 0.0, -1.0); 4],
        colours: vec![[1, 2, 3, 65535]; 4],
        ..Mesh::default()
    };
    let bare =
        Mesh { normals: vec![], uvs: vec![], more_uvs: vec![], tangents: vec![], colours: vec![], ..quad.clone() };
    let look_up = LookUp { across: Wrap::Mirror, up: Wrap::Clamp, nearest: true, set: 1 };
    let texture = |name: &str, pixels| Texture { name: name.into(), width: 2, height: 1, pixels, look_up };
    let mut moving = Object::fixed("door", 1);
    let own = Transform { linear: Mat3::from_diagonal(vec3(1.0, 2.0, 3.0)), translation: Vec3::Y };
    let offset = Offset { own, shift: Vec3::X };
    let key = Key { time: 0.5, translate: Vec3::X, angle_deg: 30.0 };
    moving.motion = Some(Motion { pivot: Vec3::ZERO, axis: Vec3::Y, keys: vec![key], poses: Vec::new(), offset });
    let mut textured = Material::diffuse("paper", Vec3::ONE);
    textured.surface = Surface::Glossy(Gloss::new(
        Colour { value: Vec3::ONE, texture: Some(0) },
        Scalar { value: 0.5, texture: Some((1, 2)) },
        Scalar::plain(0.0),
    ));
    textured.relief = Some(NormalMap { texture: 1, scale: 0.5 });
    let mut scene = Scene {
        name: "a room".into(),
        centre: DVec3::new(1e6, 0.0, 0.0),
        camera: Camera::default(),
        meshes: vec![quad.clone().into(), bare.into(), quad.into()],
        objects: vec![Object::fixed("wall", 0), moving, Object::fixed("wall again", 2)],
        materials: vec![Material::diffuse("white", Vec3::splat(0.7)), textured],
        textures: vec![
            texture("colour", Pixels::Srgb8(vec![[1, 2, 3, 255], [4, 5, 6, 255]])).into(),
            texture("rough", Pixels::Linear8(vec![[9; 4]; 2])).into(),
            texture("sky", Pixels::Float(vec![[0.5; 3], [1e4; 3]])).into(),
        ],
        lights: vec![Light::Point { position: Vec3::Y, intensity: Vec3::ONE }],
        light_names: vec![],
        lights_are_photometric: false,
        multiple_scattering: true,
        environment: Environment::Image { texture: 2, scale: Vec3::ONE, turn: 0.0 },
        time: 0.0,
    };
    scene.pose(0.5);
    scene
}

fn store(blobs: &[Blob]) -> BTreeMap<Hash, Vec<u8>> {
    blobs.iter().map(|blob| (blob.hash, blob.bytes.clone())).collect()
}

#[test]
fn a_scene_survives_being_taken_apart() {
    let (manifest, blobs) = split(&scene()).unwrap();
    let store = store(&blobs);
    assert!(store.iter().all(|(known, bytes)| hash(bytes) == *known));
    assert_eq!(join(&manifest, |hash| store.get(hash)), Ok(scene()));
    assert_eq!(Manifest::parse(&manifest.blob().bytes), Ok(manifest));
}

#[test]
fn lifted_pieces_survive_as_well() {
    let mut lifted = scene();
    let door = Arc::make_mut(&mut lifted.meshes[1]);
    door.positions.extend([vec3(100.0, 0.0, 0.0), vec3(101.0, 0.0, 0.0), vec3(100.0, 1.0, 0.0)]);
    door.triangles.push([4, 5, 6]);
    door.materials.push(0);
    for (piece, visible) in [(1, false), (0, true)] {
        let whole_from_piece = Transform { translation: Vec3::X, ..Transform::IDENTITY };
        scenes::Change::PieceTransform { object: 1, piece, whole_from_piece }.apply(&mut lifted).unwrap();
        scenes::Change::PieceVisible { object: 1, piece, visible }.apply(&mut lifted).unwrap();
    }
    let (manifest, blobs) = split(&lifted).unwrap();
    let store = store(&blobs);
    assert_eq!(join(&manifest, |hash| store.get(hash)), Ok(lifted));
}

#[test]
fn equal_meshes_are_one_part() {
    let (manifest, blobs) = split(&scene()).unwrap();
    assert_eq!(manifest.meshes[0], manifest.meshes[2]);
    assert_eq!(blobs.len(), 1 + 2 + 3);
    assert_eq!(manifest.parts(), blobs.iter().map(|blob| blob.hash).collect::<Vec<_>>());
}

#[test]
fn an_edit_changes_only_the_layout() {
    let mut edited = scene();
    edited.objects[1].visible = false;
    let (before, after) = (split(&scene()).unwrap().0, split(&edited).unwrap().0);
    assert_ne!(before.layout, after.layout);
    assert_eq!((before.meshes, before.textures), (after.meshes, after.textures));
}

#[test]
fn a_missing_part_is_named_and_an_unsound_scene_refused() {
    let (manifest, blobs) = split(&scene()).unwrap();
    let store = store(&blobs);
    let without = |hash: &Hash| (*hash != manifest.textures[1]).then(|| &store[hash]);
    assert_eq!(join(&manifest, without), Err(PartError::Absent(short(&manifest.textures[1]))));

    let mut unsound = scene();
    Arc::make_mut(&mut unsound.meshes[1]).triangles[0] = [0, 1, 9];
    let (manifest, blobs) = split(&unsound).unwrap();
    let blobs = super::tests::store(&blobs);
    assert!(matches!(join(&manifest, |hash| blobs.get(hash)), Err(PartError::Unsound(_))));
}

#[test]
fn counts_that_lie_reserve_nothing() {
    let claim = |tag: &[u8; 4]| [&tag[..], &[0xff; 20]].concat();
    assert!(parse_mesh(&claim(MESH)).is_err());
    assert!(parse_texture(&claim(TEXTURE)).is_err());
    assert!(parse_layout(&claim(LAYOUT)).is_err());
    assert!(Manifest::parse(&claim(MANIFEST)).is_err());
}

/// The wire form may only change together with [`crate::message::VERSION`].
#[test]
fn the_bytes_are_golden() {
    let (manifest, _) = split(&scene()).unwrap();
    assert_eq!((crate::message::VERSION, short(&manifest.blob().hash).as_str()), (18, "f1d151f21aa4"));
}

proptest! {
    #[test]
    fn damaged_parts_never_panic(which in 0..6_usize, at in 0.0..1.0_f64, flip in 1_u8.., cut in 0.0..1.0_f64) {
        let (manifest, blobs) = split(&scene()).unwrap();
        let length = blobs[which].bytes.len();
        let place = |share: f64| (length as f64 * share) as usize;
        let mut damaged = blobs.clone();
        damaged[which].bytes[place(at)] ^= flip;
        let damaged = store(&damaged);
        let _ = join(&manifest, |hash| damaged.get(hash));
        // Of sound bytes: what is damaged and cut may be a sound part with one element less.
        let mut truncated = blobs;
        truncated[which].bytes.truncate(place(cut));
        let truncated = store(&truncated);
        prop_assert!(join(&manifest, |hash| truncated.get(hash)).is_err());
    }

    #[test]
    fn random_bytes_never_panic(tag in 0..4_usize, bytes: Vec<u8>) {
        let bytes = [&[MANIFEST, LAYOUT, MESH, TEXTURE][tag][..], &bytes].concat();
        let _ = Manifest::parse(&bytes);
        let _ = parse_layout(&bytes);
        let _ = parse_mesh(&bytes);
        let _ = parse_texture(&bytes);
    }
}
