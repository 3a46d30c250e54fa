//! Tests of `kept`.

use frame::tone::Operator;
use glam::Vec3;
use protocol::parts::split;
use scenes::{Colour, Light, LookUp, Mesh, Pixels, Texture, Transform};

use super::*;

fn triangle(x: f32) -> Mesh {
    let positions = vec![Vec3::X * x, Vec3::X * (x + 1.0), Vec3::Y];
    Mesh { positions, triangles: vec![[0, 1, 2]], materials: vec![0], ..Mesh::default() }
}

/// A chair, a table and a lamp; one material has a texture.
fn scene() -> Scene {
    let texture = |name: &str, value| {
        let (name, pixels) = (name.to_owned(), Pixels::Srgb8(vec![[value; 4]]));
        Texture { name, width: 1, height: 1, pixels, look_up: LookUp::REPEAT }
    };
    let mut wood = Material::diffuse("wood", Vec3::ONE);
    wood.surface = Surface::Diffuse { albedo: Colour { value: Vec3::ONE, texture: Some(1) } };
    Scene {
        name: "room".into(),
        meshes: [0.0, 2.0].map(|x| triangle(x).into()).to_vec(),
        objects: vec![Object::fixed("chair", 0), Object::fixed("table", 1)],
        materials: vec![Material::diffuse("plain", Vec3::ONE), wood],
        textures: vec![texture("a", 1).into(), texture("b", 2).into()],
        lights: vec![Light::Point { position: Vec3::Y, intensity: Vec3::ONE }],
        ..Scene::default()
    }
}

fn away(object: u32) -> Change {
    Change::Transform { object, scene_from_object: Transform { translation: Vec3::Z, ..Transform::IDENTITY } }
}

fn edits() -> Vec<Change> {
    let mut red = scene().materials[1].clone();
    red.surface = Surface::Diffuse { albedo: Colour { value: Vec3::X, texture: Some(1) } };
    let off = Light::Point { position: Vec3::Y, intensity: Vec3::ZERO };
    let piece = Change::PieceVisible { object: 0, piece: 0, visible: false };
    vec![
        away(1),
        piece,
        Change::Material { material: 1, value: red },
        Change::Light { light: 0, value: off },
        Change::Time(0.5),
    ]
}

/// A session of that room.
pub(in crate::live) fn session() -> KeptSession {
    let scene = scene();
    let (manifest, _) = split(&scene).unwrap();
    let files = Files { scene: &scene, manifest: &manifest };
    let step = |change: Change| (vec![change.clone()], vec![change.undo(&scene).unwrap()]);
    KeptSession {
        solids: Vec::new(),
        presets: Vec::new(),
        igi_kept: VERSION,
        scene: "room.obj".into(),
        files: files.print(),
        saved: 1_000_000,
        edits: files.kept(edits()),
        history: [edits().into_iter().map(step).collect(), Vec::new()],
        hues: Hues { lights: [(0, Vec3::ONE)].into(), ..Hues::default() },
        camera: Camera::default(),
        tone: ToneSettings { exposure: 1.5, operator: Operator::Agx },
        views: vec![view()],
    }
}

fn view() -> SavedView {
    SavedView { target: Vec3::X, up: Vec3::Y, fov_y_deg: 40.0, ..SavedView::default() }
}

fn fitting(scene: &Scene) -> (Vec<Change>, Vec<String>, bool) {
    let (manifest, _) = split(scene).unwrap();
    let files = Files { scene, manifest: &manifest };
    let (changes, left_out) = session().fitting(files);
    (changes, left_out, session().fitting_history(files).is_some())
}

#[test]
fn what_is_kept_can_be_read_and_fits() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("session.json");
    std::fs::write(&path, session().encode().unwrap()).unwrap();
    assert_eq!(KeptSession::read(&path).unwrap(), session());
    // Size and time at the start are no matter of files.
    let mut same = scene();
    same.camera.width = 77;
    assert_eq!(fitting(&same), (edits(), vec![], true));
}

#[test]
fn edits_of_files_that_have_changed_fit_what_is_still_there() {
    // Another object before the others, another texture, a lamp that the file has moved.
    let mut changed = scene();
    changed.objects.insert(0, Object::fixed("door", 0));
    changed.lights[0] = Light::Point { position: Vec3::X, intensity: Vec3::ONE };
    let (fit, left_out, history) = fitting(&changed);
    let piece = Change::PieceVisible { object: 1, piece: 0, visible: false };
    assert_eq!(fit, [away(2), piece, edits()[2].clone(), Change::Time(0.5)]);
    assert_eq!((left_out, history), (vec!["lamp 1".to_owned()], false));

    // What is not the same any more is left as the files have it.
    let mut changed = scene();
    changed.meshes[1] = triangle(3.0).into();
    changed.textures.swap(0, 1);
    changed.objects.push(Object::fixed("chair", 0));
    changed.objects.swap(0, 1);
    let (fit, left_out, _) = fitting(&changed);
    assert_eq!(fit, [edits()[3].clone(), Change::Time(0.5)], "two chairs: it is not known which");
    assert_eq!(left_out, ["table", "chair", "wood"]);
    assert_eq!(fitting(&Scene::default()).0, [Change::Time(0.5)]);
}

#[test]
fn what_is_no_session_is_refused_with_its_file() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("session.json");
    let good = String::from_utf8(session().encode().unwrap()).unwrap();
    let views = vec![view(); VIEWS_MAX + 1];
    for text in [
        String::new(),
        "{}".into(),
        good.replacen("\"igi_kept\":1", "\"igi_kept\":0", 1),
        good.replacen("\"fov_y_deg\":40.0", "\"fov_y_deg\":0.0", 1),
        good.replacen("\"width\":640", "\"width\":4000000000", 1),
        good[..good.len() - 5].into(),
        serde_json::to_string(&KeptSession { views, ..session() }).unwrap(),
        " ".repeat(FILE_MAX as usize + 1),
    ] {
        std::fs::write(&path, &text).unwrap();
        let error = format!("{:#}", KeptSession::read(&path).unwrap_err());
        assert!(error.contains("session.json"), "{error}");
    }
}
