//! Broken input of every kind: a clear message or a counted repair, never a panic, never silence.

use std::path::Path;

use glam::Vec3;
use scenes::read::load;
use scenes::{Environment, Surface};

use crate::folder::{Folder, TRIANGLE, load_mtl, load_obj, notes, png};

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
fn broken_obj_lines_cost_only_themselves_and_are_named_by_number() {
    let no_vertex = "1 faces have corners at no vertex of the file: skipped";
    let no_attribute = "1 faces name normals or texture coordinates that do not exist: they have none";
    let cases = [
        // Line, triangles drawn, note.
        ("v 0 0 zero", 1, "1 vertices are no finite numbers; faces that use them were dropped: `zero`"),
        ("v -1.#IND 0 0", 1, "1 vertices are no finite numbers; faces that use them were dropped: `-1.#IND`"),
        ("v 0 0", 1, "1 vertices, normals or texture coordinates lack numbers: 0 is used"),
        ("vn 0", 1, "1 vertices, normals or texture coordinates lack numbers: 0 is used"),
        ("vn 0 1.#QNAN 0", 1, "1 normals were no usable numbers: faces that use them are flat: `1.#QNAN`"),
        ("vt", 1, "1 vertices, normals or texture coordinates lack numbers: 0 is used"),
        ("vt -nan(ind) 0", 1, "1 texture coordinates are no finite numbers: 0 is used: `-nan(ind)`"),
        ("vt 0 1.#INF", 1, "1 texture coordinates are no finite numbers: 0 is used: `1.#INF`"),
        ("f 1 2 x", 1, &format!("{no_vertex}: `x`")),
        ("f 1 2 3/a", 2, no_attribute),
        ("f 1 2 0", 1, &format!("{no_vertex}: `0`")),
        ("f 1 2 99", 1, &format!("{no_vertex}: `99`")),
        ("f 1//7 2//7 3//7", 2, no_attribute),
        ("f 1/5 2/5 3/5", 2, no_attribute),
        ("f 1/0/0 2/0/0 3/0/0", 2, no_attribute),
        ("f 1 2 -9", 1, &format!("{no_vertex}: `-9`")),
        ("f 1//-2 2//-2 3//-2", 2, no_attribute),
        ("f 1 2 99999999999999999999", 1, no_vertex),
        ("f 1 2 4294967296", 1, no_vertex),
        ("f // // //", 1, "1 faces with fewer than three corners were skipped"),
    ];
    for (line, triangles, expected) in cases {
        let loaded = load_obj(&format!("{OBJ}{line}\n"));
        let notes = notes(&loaded);
        assert!(notes.contains("a.obj: line 6: ") && notes.contains(expected), "{line}: {notes}");
        assert_eq!(loaded.scene.triangle_count(), triangles, "{line}");
    }
}

#[test]
fn what_is_no_face_is_named_once() {
    let lines = "2 points and lines are not drawn; only faces are; this is the first";
    for (text, expected) in [
        ("l 1 2\np 3\n", lines),
        (
            "usemap wood.png\nf 1 2 3\n",
            "1 textures given by usemap are not drawn; name them in the material, as map_Kd",
        ),
    ] {
        let notes = notes(&load_obj(&format!("{OBJ}{text}")));
        assert!(notes.contains(&format!("a.obj: line 6: {expected}")), "{text}: {notes}");
    }
    assert!(!notes(&load_obj(&format!("{OBJ}usemap off\n"))).contains("usemap"));
}

#[test]
fn comments_behind_numbers_are_none() {
    let plain = load_obj("v 0 0 0\nv 1 0 0\nv 0 1 0\nvn 0 0 1\nvt 0.5\nf 1/1/1 2/1/1 3/1/1\n");
    let commented = load_obj(
        "v 0 0 0 # a\nv 1 0 0 #b\nv 0 1 0 // c\nvn 0 0 1 # up\nvt 0.5 # half\nf 1/1/1 2/1/1 3/1/1 # 4 5\nf 1 2 # 3\n",
    );
    assert_eq!(commented.scene.meshes, plain.scene.meshes);
    assert!(notes(&commented).contains("line 7: 1 faces with fewer than three corners"), "{}", notes(&commented));
    for comma in ["v 0 0 0\nv 1,0 0 0\nv 0 1,0 0\nf 1 2 3\n", "v 0 0 0\nv 1.0 0 0\nv 0 1.0 0\nf 1.0 2 3\n"] {
        assert_eq!(load_obj(comma).scene.meshes[0].positions, plain.scene.meshes[0].positions);
    }
}

#[test]
fn a_million_bad_lines_are_few_notes() {
    let mut text = OBJ.to_owned();
    for i in 0..50_000 {
        text += &format!("v 0 nan 0\nvt 1.#INF\nf {i} 0 1\nf 1//9999999 2 3\nusemtl m{i}\nf 1 2 3\n");
    }
    let loaded = load_obj(&text);
    assert!(loaded.notes.len() < 32, "{} notes", loaded.notes.len());
    assert!(notes(&loaded).contains("49992 more like it"), "{}", notes(&loaded));
}

#[test]
fn long_garbage_makes_short_messages() {
    let message = refusal(&[("a.obj", format!("v {}", "x".repeat(1 << 20)).as_bytes())], "a.obj");
    assert!(message.len() < 600, "{} bytes", message.len());
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
fn broken_mtl_lines_cost_only_themselves_and_are_named_by_number() {
    for line in [
        "Kd red",
        "Kd nan nan nan",
        "Ke 1e99",
        "Ns",
        "Ns -1.#IND",
        "Ni 1.#QNAN",
        "d -nan(ind)",
        "Tr 1.#INF",
        "Kd 0.5 0.5",
        "illum",
        "illum two",
        "Pr # 0.5",
        "Tf",
        "Ks // 1 1 1",
    ] {
        let loaded = load_mtl(&format!("newmtl m\nKd 0.25 0.5 0.75 # blue\n{line}\n"));
        let expected = format!("a.mtl: line 3: 1 statements lack a finite number: left out: `{line}`");
        assert!(notes(&loaded).contains(&expected), "{line}: {}", notes(&loaded));
        let surface = &loaded.scene.materials[0].surface;
        assert!(
            matches!(surface, Surface::Diffuse { albedo } if albedo.value == Vec3::new(0.25, 0.5, 0.75)),
            "{surface:?}"
        );
        assert_eq!(loaded.scene.materials[0].emission.value, Vec3::ZERO);
    }
}

#[test]
fn maps_without_a_name_are_none() {
    let loaded = load_mtl("newmtl m\nKd 0.8 0.1 0.1\nmap_Ka \nmap_Kd\nmap_bump\t\nmap_d -s 1 1 1\n");
    let Surface::Diffuse { albedo } = &loaded.scene.materials[0].surface else { panic!("it is diffuse") };
    assert_eq!((albedo.value, albedo.texture), (Vec3::new(0.8, 0.1, 0.1), None));
    assert_eq!(loaded.scene.materials[0].coverage, None);
    assert!(notes(&loaded).contains("line 3: 4 textures have no file name: left out"), "{}", notes(&loaded));
}

#[test]
fn comments_behind_an_mtl_s_numbers_and_names_are_none() {
    let obj = TRIANGLE.replace("usemtl m", "usemtl m # the wall").replace("a.mtl", "a.mtl # ours");
    let mtl = "newmtl m # red\nillum 1 // flat\nKd 1 0 0 # red\nKd 0.5 # grey\nmap_Kd a.png # bricks\n";
    let files: &[(&str, &[u8])] =
        &[("a.obj", obj.as_bytes()), ("a.mtl", mtl.as_bytes()), ("a.png", &png(1, 1, [9; 4]))];
    let loaded = Folder::of(files).load("a.obj");
    let Surface::Diffuse { albedo } = &loaded.scene.materials[0].surface else { panic!("it is diffuse") };
    assert_eq!((albedo.value, albedo.texture), (Vec3::splat(0.5), Some(0)));
    assert!(!notes(&loaded).contains("exist") && !notes(&loaded).contains("lack"), "{}", notes(&loaded));
}

/// Pictures that are none, and what is said of each.
pub fn broken_pictures() -> Vec<(Vec<u8>, &'static str)> {
    let cut = {
        let whole = png(8, 8, [1, 2, 3, 255]);
        whole[..whole.len() / 2].to_vec()
    };
    let mut empty = png(1, 1, [0; 4]);
    empty[16..20].fill(0);
    vec![
        (b"".to_vec(), "is no picture of a known kind"),
        (b"not an image".to_vec(), "is no picture of a known kind"),
        (cut, "the image cannot be decoded"),
        (empty, "the image cannot be decoded"),
        (b"II*\0\x08\0\0\0".to_vec(), "the image cannot be decoded"),
        (b"RIFF\x24\0\0\0WEBPVP8 ".to_vec(), "the image cannot be decoded"),
        (b"GIF89a".to_vec(), "the image cannot be decoded"),
        (b"DDS |".to_vec(), "the image cannot be decoded"),
        (b"8BPS\0\x01".to_vec(), "Photoshop pictures are not read; make it PNG"),
        (b"\xabKTX 20\xbb".to_vec(), "KTX pictures are not read"),
        (vec![0x76, 0x2f, 0x31, 0x01, 2, 0, 0, 0], "the image cannot be decoded"),
    ]
}

#[test]
fn pictures_that_are_none_leave_the_colour_and_the_sky_and_are_named() {
    for (image, expected) in broken_pictures() {
        let files: &[(&str, &[u8])] =
            &[("a.obj", TRIANGLE.as_bytes()), ("a.mtl", b"newmtl m\nKd .2 .3 .4\nmap_Kd a.png\n"), ("a.png", &image)];
        let loaded = Folder::of(files).load("a.obj");
        let Surface::Diffuse { albedo } = &loaded.scene.materials[0].surface else { panic!("it is diffuse") };
        assert_eq!((albedo.value, albedo.texture), (Vec3::new(0.2, 0.3, 0.4), None));
        let notes_of = notes(&loaded);
        assert!(notes_of.contains("a.mtl: line 3: texture `a.png`: ") && notes_of.contains(expected), "{notes_of}");

        let json = br#"{"obj": "a.obj", "environment": {"image": "a.png"}}"#;
        let files: &[(&str, &[u8])] = &[("a.obj", OBJ.as_bytes()), ("scene.json", json), ("a.png", &image)];
        let loaded = Folder::of(files).load("");
        assert_eq!(loaded.scene.environment, Environment::Constant(Vec3::ONE));
        let notes_of = notes(&loaded);
        assert!(notes_of.contains("environment.image: `a.png`: ") && notes_of.contains(expected), "{notes_of}");
    }
}

#[test]
fn a_texture_that_says_it_is_enormous_costs_nothing() {
    // A PNG header that promises 2³¹ − 1 pixels to a side.
    let mut image = png(1, 1, [0; 4]);
    image[16..24].copy_from_slice(&[0x7f, 0xff, 0xff, 0xff, 0x7f, 0xff, 0xff, 0xff]);
    let files: &[(&str, &[u8])] =
        &[("a.obj", TRIANGLE.as_bytes()), ("a.mtl", b"newmtl m\nmap_Kd a.png\n"), ("a.png", &image)];
    let loaded = Folder::of(files).load("a.obj");
    assert!(notes(&loaded).contains("texture `a.png`: the image cannot be decoded"), "{}", notes(&loaded));
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
