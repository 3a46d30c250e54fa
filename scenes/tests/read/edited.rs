//! Scenes that name another and list what was done to it.

use glam::Vec3;
use scenes::Light;

use crate::folder::{Folder, notes};

const OBJ: &[u8] = b"o chair\nv -1 0 0\nv 1 0 0\nv 0 2 0\nf 1 2 3\no table\nf 1 2 3\n";
const JSON: &[u8] = br#"{ "obj": "a.obj", "movable": ["chair", "table"], "background": [1, 1, 1],
    "lights": [{ "type": "point", "name": "candle", "position": [0, 1, 1], "intensity": [2, 2, 2] }] }"#;

fn folder(edited: &str) -> Folder {
    Folder::of(&[("a.obj", OBJ), ("scene.json", JSON), ("e.json", edited.as_bytes())])
}

const DIM: &str = r#"{ "of": "candle", "change":
    { "Light": { "light": 0, "value": { "Point": { "position": [0, 1, 1], "intensity": [0.8, 0.8, 0.8] } } } } }"#;
const HIDE: &str = r#"{ "of": "table", "change": { "Visible": { "object": 1, "visible": false } } }"#;

fn stands_on(scene: &str, edits: &str) -> String {
    format!(r#"{{ "scene": "{scene}", "edits": [{edits}] }}"#)
}

#[test]
fn edits_are_made_to_the_scene_that_is_named() {
    let folder = folder(&stands_on("scene.json", &[DIM, HIDE].join(",")));
    let loaded = folder.load("e.json");
    assert_eq!(notes(&loaded), notes(&folder.load("")), "nothing to be said of the edits");
    assert!(loaded.scene.objects[0].visible && !loaded.scene.objects[1].visible);
    assert!(matches!(loaded.scene.lights[0], Light::Point { intensity, .. } if intensity == Vec3::splat(0.8)));
    let base = loaded.base.expect("what it stands on");
    assert_eq!(base.file, folder.path("scene.json"));
    assert_eq!(base.scene, folder.load("").scene);
    assert_eq!(base.scene.changes_to(&loaded.scene).len(), 2);
}

#[test]
fn what_fits_no_longer_is_left_out_and_named() {
    let swapped = String::from_utf8_lossy(OBJ).replace("chair", "stool").replace("table", "chair");
    let gone = r#"{ "of": "table", "change": { "Visible": { "object": 1, "visible": false } } }"#;
    let there = r#"{ "of": "chair", "change": { "Visible": { "object": 0, "visible": false } } }"#;
    let folder = folder(&stands_on("scene.json", &[gone, there].join(",")));
    folder.write("a.obj", swapped.as_bytes());
    let json = String::from_utf8_lossy(JSON).replace(r#"["chair", "table"]"#, r#"["stool", "chair"]"#);
    folder.write("scene.json", json.as_bytes());
    let loaded = folder.load("e.json");
    let said = notes(&loaded);
    assert!(said.contains("edits[0]: `table`: there is no such thing any more; the edit is left out"), "{said}");
    assert!(!loaded.scene.objects[1].visible, "the chair is the second now");
    assert!(loaded.scene.objects[0].visible);
}

#[test]
fn what_cannot_be_is_refused_by_file_and_field() {
    let refused = |edited: &str| folder(edited).try_load("e.json").unwrap_err().to_string();
    let dark = DIM.replace("[0.8, 0.8, 0.8]", "[-1, 0, 0]");
    for (edited, words) in [
        (stands_on("scene.json", &[HIDE, &dark].join(",")), ["e.json: edits[1]: ", "light"]),
        (stands_on("scene.json", r#"{ "change": { "Explode": 1 } }"#), ["e.json: edits[0]: ", "Explode"]),
        (stands_on("scene.json", r#"{ "of": "candle" }"#), ["e.json: edits[0]: ", "change"]),
        (stands_on("nowhere.obj", ""), ["e.json: scene: ", "`nowhere.obj` is not there"]),
        (stands_on("e.json", ""), ["e.json: scene: ", "itself an edited scene"]),
        (r#"{ "scene": "scene.json", "edits": 3 }"#.into(), ["e.json:1", "invalid type"]),
        (r#"{ "scene": "scene.json" }"#.into(), ["e.json:1", "edits"]),
        (
            r#"{ "scene": "scene.json", "edits": [], "camera": { "origin": [0,0,0], "target": [0,0,0], "up": [0,1,0],
               "fov_y_deg": 40, "width": 4, "height": 3 } }"#
                .into(),
            ["e.json: camera: ", ""],
        ),
    ] {
        let said = refused(&edited);
        assert!(words.iter().all(|word| said.contains(word)), "{said}");
    }
}
