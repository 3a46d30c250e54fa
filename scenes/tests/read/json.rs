//! The scene JSON.

use glam::{Vec2, Vec3};
use scenes::read::{self, Loaded};
use scenes::{Coverage, Environment, Light, Pixels};

use crate::folder::{Folder, notes};

const OBJ: &[u8] = b"v -1 0 0\nv 1 0 0\nv 0 2 0\no thing\nf 1 2 3\n";

fn load(json: &str) -> Loaded {
    Folder::of(&[("a.obj", OBJ), ("scene.json", json.as_bytes())]).load("")
}

#[test]
fn a_camera_is_read_or_made() {
    let read = load(
        r#"{"obj": "a.obj", "camera": {"origin": [0,1,5], "target": [0,1,0], "fov_y_deg": 30, "width": 40, "height": 20}}"#,
    );
    let camera = read.scene.camera;
    assert_eq!((camera.origin, camera.up), (Vec3::new(0.0, 1.0, 5.0), Vec3::Y));
    assert_eq!((camera.fov_y_deg, camera.width, camera.height), (30.0, 40, 20));
    assert!(!notes(&read).contains("no camera"));

    let made = load(r#"{"obj": "a.obj"}"#);
    assert!(notes(&made).contains("no camera: made one"), "{}", notes(&made));
    let lens = made.scene.camera.lens();
    for corner in &made.scene.meshes[0].positions {
        let (x, y, _) = lens.project(*corner).expect("in front of the camera");
        assert!(x > 0.0 && x < 640.0 && y > 0.0 && y < 480.0, "{corner} is seen at {x} {y}");
    }
}

#[test]
fn a_dark_scene_is_lit_and_says_so() {
    let dark = load(r#"{"obj": "a.obj", "background": [0, 0, 0], "lights": []}"#);
    assert!(matches!(dark.scene.environment, Environment::Image { .. }));
    assert!(notes(&dark).contains("nothing in the scene shines"), "{}", notes(&dark));
    let lit = load(r#"{"obj": "a.obj", "background": [0.1, 0.2, 0.3]}"#);
    assert_eq!(lit.scene.environment, Environment::Constant(Vec3::new(0.1, 0.2, 0.3)));
}

#[test]
fn a_material_can_be_made_half_transparent() {
    let obj = b"mtllib a.mtl\nusemtl curtain\nv -1 0 0\nv 1 0 0\nv 0 2 0\nf 1 2 3\n";
    let read = |coverage: &str| {
        let json = format!(r#"{{"obj": "a.obj", "coverage": {coverage}}}"#);
        let files: &[(&str, &[u8])] =
            &[("a.obj", obj), ("a.mtl", b"newmtl curtain\nKd 1 1 1\n"), ("scene.json", json.as_bytes())];
        Folder::of(files).try_load("")
    };
    let curtain = |coverage: &str| read(coverage).unwrap().scene.materials[0].coverage;
    assert_eq!(curtain(r#"{"curtain": 0.6}"#), Some(Coverage::plain(0.6)));
    assert_eq!(curtain(r#"{"curtain": 1}"#), None);
    let unknown = read(r#"{"wall": 0.6}"#).unwrap();
    assert!(notes(&unknown).contains("coverage: there is no material `wall`"), "{}", notes(&unknown));
    let error = read(r#"{"curtain": 1.5}"#).unwrap_err().to_string();
    assert!(error.contains("coverage.curtain: 1.5 is not within 0..1"), "{error}");
}

#[test]
fn a_glass_has_a_priority() {
    let obj = b"mtllib a.mtl\nusemtl water\nv -1 0 0\nv 1 0 0\nv 0 2 0\nf 1 2 3\n";
    let read = |priority: &str| {
        let json = format!(r#"{{"obj": "a.obj", "priority": {priority}}}"#);
        let mtl = b"newmtl water\nillum 7\nNi 1.33\nTf 1 1 1\n";
        let files: &[(&str, &[u8])] = &[("a.obj", obj), ("a.mtl", mtl), ("scene.json", json.as_bytes())];
        Folder::of(files).try_load("")
    };
    let water = |priority: &str| read(priority).unwrap().scene.materials[0].surface.glass().unwrap().priority;
    assert_eq!((water("{}"), water(r#"{"water": 2}"#)), (0, 2));
    let unknown = read(r#"{"wine": 1}"#).unwrap();
    assert!(notes(&unknown).contains("priority: there is no glass `wine`"), "{}", notes(&unknown));
    let error = read(r#"{"water": 256}"#).unwrap_err().to_string();
    assert!(error.contains("priority.water: 256 is not within 0..255"), "{error}");
}

#[test]
fn lights_of_all_kinds() {
    let scene = load(
        r#"{"obj": "a.obj", "lights": [
            {"type": "point", "position": [1, 2, 3], "intensity": [4, 5, 6]},
            {"type": "spot", "name": "desk", "position": [0, 2, 0], "target": [0, 0, 0], "intensity": [1, 1, 1], "inner_deg": 0, "outer_deg": 60},
            {"type": "directional", "direction": [0, -3, 0], "irradiance": [7, 8, 9]}]}"#,
    )
    .scene;
    let point = Light::Point { position: Vec3::new(1.0, 2.0, 3.0), intensity: Vec3::new(4.0, 5.0, 6.0) };
    let sun = Light::Directional { direction: Vec3::NEG_Y, irradiance: Vec3::new(7.0, 8.0, 9.0), diameter_deg: 0.0 };
    assert_eq!((&scene.lights[0], &scene.lights[2]), (&point, &sun));
    assert_eq!(scene.light_names, ["", "desk", ""]);
    let Light::Spot { direction, cos_inner, cos_outer, .. } = scene.lights[1] else { panic!("no spot") };
    assert_eq!((direction, cos_inner), (Vec3::NEG_Y, 1.0));
    assert!((cos_outer - 0.5).abs() < 1e-6);
}

#[test]
fn a_spot_whose_cones_are_equal_still_has_an_edge() {
    let json = r#"{"obj": "a.obj", "lights": [{"type": "spot", "position": [0,1,0], "direction": [0,-1,0],
        "intensity": [1,1,1], "inner_deg": 30, "outer_deg": 30}]}"#;
    let Light::Spot { cos_inner, cos_outer, .. } = load(json).scene.lights[0] else { panic!("no spot") };
    assert!(cos_outer < cos_inner);
}

#[test]
fn motion_moves_the_object_at_a_time() {
    let json = r#"{"obj": "a.obj", "animation": [{"object": "thing", "pivot": [1, 0, 0], "axis": [0, 0, 2],
        "keyframes": [{"t": 2, "translate": [4, 0, 0], "angle_deg": 180}, {"t": 0}]}]}"#;
    let folder = Folder::of(&[("a.obj", OBJ), ("scene.json", json.as_bytes())]);
    let at = |time| {
        let scene = read::load_at(&folder.path(""), time).unwrap().scene;
        scene.objects[0].scene_from_object.point(Vec3::new(2.0, 0.0, 0.0))
    };
    assert_eq!(at(None), Vec3::new(2.0, 0.0, 0.0));
    assert!((at(Some(1.0)) - Vec3::new(3.0, 1.0, 0.0)).length() < 1e-6, "{}", at(Some(1.0)));
    assert!((at(Some(9.0)) - Vec3::new(4.0, 0.0, 0.0)).length() < 1e-6);
}

#[test]
fn environments_are_linear_radiance_and_repaired() {
    let mut sky = Vec::new();
    let texels = [image::Rgb([1.0, 2.0, 0.5]), image::Rgb([100.0, 0.0, 0.25])];
    image::codecs::hdr::HdrEncoder::new(&mut sky).encode(&texels, 2, 1).unwrap();
    let json = r#"{"obj": "a.obj", "environment": {"image": "sky.hdr", "scale": 2}}"#;
    let scene = Folder::of(&[("a.obj", OBJ), ("scene.json", json.as_bytes()), ("sky.hdr", &sky)]).load("").scene;
    assert_eq!(scene.environment, Environment::Image { texture: 0, scale: Vec3::splat(2.0), turn: 0.0 });
    let Pixels::Float(texels) = &scene.textures[0].pixels else { panic!("not radiance") };
    assert!((texels[1][0] - 100.0).abs() < 1.0 && (texels[0][1] - 2.0).abs() < 0.02, "{texels:?}");
}

#[test]
fn an_exr_environment_loses_what_is_no_number() {
    let folder =
        Folder::of(&[("a.obj", OBJ), ("scene.json", br#"{"obj": "a.obj", "environment": {"image": "sky.exr"}}"#)]);
    let radiance = |x: usize, _| if x == 0 { (f32::NAN, -1.0, 0.25) } else { (1e5, 2.0, 3.0) };
    exr::prelude::write_rgb_file(folder.path("sky.exr"), 2, 1, radiance).unwrap();
    let scene = folder.load("").scene;
    assert_eq!(scene.textures[0].pixels, Pixels::Float(vec![[0.0, 0.0, 0.25], [1e5, 2.0, 3.0]]));
}

#[test]
fn fields_that_are_not_known_are_named() {
    let loaded = load(r#"{"obj": "a.obj", "camrea": {}, "references": [], "format": "scene-json-1"}"#);
    assert!(notes(&loaded).contains("camrea: is not a field that is known here"), "{}", notes(&loaded));
    assert!(!notes(&loaded).contains("references"));
}

#[test]
fn a_folder_means_its_only_model() {
    let folder = Folder::of(&[("only.obj", OBJ), ("readme.txt", b"")]);
    assert_eq!(folder.load("").scene.name, "only");
    assert_eq!(folder.load("").scene.meshes[0].uvs, Vec::<Vec2>::new());
    folder.write("other.glb", b"");
    assert!(folder.try_load("").unwrap_err().to_string().contains("only.obj, other.glb"));
}
