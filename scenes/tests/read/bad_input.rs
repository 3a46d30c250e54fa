//! Broken input of every kind: a clear message or a counted repair, never a panic, never silence.

use std::path::Path;

use scenes::read::load;

use crate::folder::{Folder, TRIANGLE, notes, png};

const OBJ: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\no thing\nf 1 2 3\n";

fn refusal(files: &[(&str, &[u8])], name: &str) -> String {
    match Folder::of(files).try_load(name) {
        Err(error) => error.to_string(),
        Ok(loaded) => panic!("{files:?} was read: {}", notes(&loaded)),
    }
}

#[test]
fn paths_that_lead_nowhere() {
    let message = load(Path::new("/no/such/scene")).unwrap_err().to_string();
    assert_eq!(message, "/no/such/scene: no such file or folder");
    assert!(refusal(&[("a.blend", b"")], "a.blend").contains("not a kind of scene file"));
    assert!(refusal(&[], "").contains("holds scene.json, or exactly one .obj, .gltf or .glb file; there is none"));
}

#[test]
fn broken_obj_lines_are_named_by_number() {
    let cases = [
        ("v 0 0 zero", "`v`: `zero` is not a number"),
        ("v 0 0", "`v` needs three numbers, such as v 0 1 0"),
        ("vn 0", "`vn` needs three numbers, such as vn 0 1 0"),
        ("vt", "`vt` needs one or two numbers, such as vt 0.5 1"),
        ("f 1 2 x", "`x` is not a v index"),
        ("f 1 2 3/a", "`a` is not a vt index"),
        ("f 1 2 0", "v index 0: OBJ counts from 1"),
        ("f 1 2 99", "the face uses v 99, but the file has only 3"),
        ("f 1//7 2//7 3//7", "the face uses vn 7, but the file has only 0"),
        ("f 1/5 2/5 3/5", "the face uses vt 5, but the file has only 0"),
        ("f 1 2 -9", "v index -9 points nowhere: there are 3 so far"),
        ("f 1//-2 2//-2 3//-2", "vn index -2 points nowhere: there are 0 so far"),
        ("f 1 2 99999999999999999999", "is not a v index"),
        ("f 1 2 4294967296", "points nowhere"),
        ("f 1 2 3/1/1/1", "is not a corner; write v, v/vt, v//vn or v/vt/vn"),
        ("f // // //", "is not a corner"),
    ];
    for (line, expected) in cases {
        let message = refusal(&[("a.obj", format!("{OBJ}{line}\n").as_bytes())], "a.obj");
        assert!(message.contains("a.obj:6: ") && message.contains(expected), "{line}: {message}");
    }
}

#[test]
fn long_garbage_makes_short_messages() {
    let message = refusal(&[("a.obj", format!("v {}", "x".repeat(1 << 20)).as_bytes())], "a.obj");
    assert!(message.len() < 300, "{} bytes", message.len());
}

#[test]
fn a_file_without_a_triangle_is_refused() {
    for text in
        ["", "v 0 0 0\n", "v 0 0 0\nv 1 0 0\nf 1 2\n", "v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n", "v nan 0 0\nf 1 1 1\n"]
    {
        assert!(
            refusal(&[("a.obj", text.as_bytes())], "a.obj").contains("holds no triangle that could be drawn"),
            "{text}"
        );
    }
}

#[test]
fn broken_mtl_lines_are_named_by_number() {
    for (line, expected) in [
        ("Kd red", "`Kd`: `red` is not a finite number"),
        ("Kd nan nan nan", "`Kd`: `nan` is not a finite number"),
        ("Ke 1e99", "`Ke`: `1e99` is not a finite number"),
        ("Ns", "`Ns` has too few numbers"),
        ("map_Kd", "a file name is missing"),
    ] {
        let mtl = format!("newmtl m\n{line}\n");
        let message = refusal(&[("a.obj", TRIANGLE.as_bytes()), ("a.mtl", mtl.as_bytes())], "a.obj");
        assert!(message.contains("a.mtl:2: ") && message.contains(expected), "{line}: {message}");
    }
}

#[test]
fn broken_textures_are_named() {
    let cut = {
        let whole = png(8, 8, [1, 2, 3, 255]);
        whole[..whole.len() / 2].to_vec()
    };
    let mut empty = png(1, 1, [0; 4]);
    empty[16..20].fill(0);
    for image in [b"".to_vec(), b"not an image".to_vec(), cut, empty] {
        let files: &[(&str, &[u8])] =
            &[("a.obj", TRIANGLE.as_bytes()), ("a.mtl", b"newmtl m\nmap_Kd a.png\n"), ("a.png", &image)];
        let message = refusal(files, "a.obj");
        assert!(message.contains("a.png: the image cannot be decoded"), "{message}");
    }
}

#[test]
fn a_texture_that_says_it_is_enormous_costs_nothing() {
    // A PNG header that promises 2³¹ − 1 pixels to a side.
    let mut image = png(1, 1, [0; 4]);
    image[16..24].copy_from_slice(&[0x7f, 0xff, 0xff, 0xff, 0x7f, 0xff, 0xff, 0xff]);
    let files: &[(&str, &[u8])] =
        &[("a.obj", TRIANGLE.as_bytes()), ("a.mtl", b"newmtl m\nmap_Kd a.png\n"), ("a.png", &image)];
    assert!(refusal(files, "a.obj").contains("a.png"));
}

#[test]
fn broken_json_is_named_by_line_or_field() {
    let camera = |fields: &str| format!("{{\"obj\": \"a.obj\",\n \"camera\": {{{fields}}}}}");
    let light = |fields: &str| format!("{{\"obj\": \"a.obj\", \"lights\": [{{{fields}}}]}}");
    let track = |fields: &str| format!("{{\"obj\": \"a.obj\", \"animation\": [{{{fields}}}]}}");
    let view = r#""origin": [0,0,3], "target": [0,0,0]"#;
    let cases = [
        ("{".to_owned(), "scene.json:1: column 1: EOF while parsing"),
        ("{\n\n\"obj\": 3}".to_owned(), "scene.json:3: column 8: invalid type"),
        ("{}".to_owned(), "missing field `obj`"),
        ("[]".to_owned(), "scene.json:1"),
        (r#"{"obj": "gone.obj"}"#.to_owned(), "gone.obj: no such file"),
        (r#"{"obj": "scene.json"}"#.to_owned(), "obj: names another scene.json"),
        (r#"{"obj": "."}"#.to_owned(), "not a kind of scene file"),
        (camera(r#""origin": [0,0,3], "target": [0,0,0]"#), "missing field `fov_y_deg`"),
        (camera(&format!("{view}, \"fov_y_deg\": 180")), "camera: fov_y_deg must lie between 0 and 180"),
        (camera(&format!("{view}, \"fov_y_deg\": -5")), "camera: fov_y_deg"),
        (camera(&format!("{view}, \"fov_y_deg\": 40, \"width\": 0")), "camera.width: 0 is not within 1..65536"),
        (camera(&format!("{view}, \"fov_y_deg\": 40, \"height\": 1000000")), "camera.height: 1000000"),
        (camera(&format!("{view}, \"fov_y_deg\": 40, \"up\": [0,0,1]")), "camera: up must not be zero or parallel"),
        (
            camera(r#""origin": [1,1,1], "target": [1,1,1], "fov_y_deg": 40"#),
            "camera: target must not be where origin is",
        ),
        (
            camera(r#""origin": [1e300,1,1], "target": [1,1,1], "fov_y_deg": 40"#),
            "camera: origin, target and up must be finite",
        ),
        (light(r#""type": "laser""#), "unknown variant `laser`"),
        (light(r#""type": "point", "position": [0,0], "intensity": [1,1,1]"#), "invalid length 2"),
        (
            light(r#""type": "point", "position": [0,0,0], "intensity": [1,-1,1]"#),
            "lights[0].intensity: must be three finite",
        ),
        (light(r#""type": "point", "position": [0,0,0], "intensity": [1,1e99,1]"#), "lights[0].intensity"),
        (
            light(r#""type": "directional", "direction": [0,0,0], "irradiance": [1,1,1]"#),
            "lights[0].direction: has no direction",
        ),
        (
            light(r#""type": "spot", "position": [0,0,0], "intensity": [1,1,1], "outer_deg": 30"#),
            "either direction or target",
        ),
        (
            light(r#""type": "spot", "position": [0,0,0], "direction": [0,1,0], "intensity": [1,1,1], "outer_deg": 0"#),
            "0 ≤ inner_deg",
        ),
        (track(r#""object": "thnig", "keyframes": [{"t": 0}]"#), "there is no object `thnig`; there are: thing"),
        (track(r#""object": "thing", "keyframes": []"#), "animation[0].keyframes: is empty"),
        (
            track(r#""object": "thing", "axis": [0,0,0], "keyframes": [{"t": 0, "angle_deg": 1}]"#),
            "animation[0].axis: has no direction",
        ),
        (
            track(r#""object": "thing", "keyframes": [{"t": 0, "translate": [1e99,0,0]}]"#),
            "keyframes[0]: holds a number that is not finite",
        ),
        (r#"{"obj": "a.obj", "background": [-1,0,0]}"#.to_owned(), "background: must be"),
        (
            r#"{"obj": "a.obj", "environment": {"image": "gone.hdr"}}"#.to_owned(),
            "environment.image: `gone.hdr` does not exist",
        ),
        (r#"{"obj": "a.obj", "environment": {"image": "a.obj"}}"#.to_owned(), "a.obj: is no image of a known kind"),
    ];
    for (json, expected) in &cases {
        let message = refusal(&[("a.obj", OBJ.as_bytes()), ("scene.json", json.as_bytes())], "");
        assert!(message.contains(expected), "{json}\n{message}");
    }
}

#[test]
fn a_camera_in_a_wall_is_a_camera() {
    let json = r#"{"obj": "a.obj", "camera": {"origin": [0.2, 0.2, 0], "target": [0, 0, 0], "fov_y_deg": 40}}"#;
    Folder::of(&[("a.obj", OBJ.as_bytes()), ("scene.json", json.as_bytes())]).load("");
}
