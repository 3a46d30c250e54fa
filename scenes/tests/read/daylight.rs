//! When a studio is made up: where nothing lights the scene.

use glam::Vec3;
use scenes::read::Loaded;
use scenes::{Environment, Pixels, Scene};
use serde_json::json;

use crate::folder::{Folder, notes, png, png_of};
use crate::gltf;

/// Whether a scene is lit by a studio's sky.
fn is_studio(scene: &Scene) -> bool {
    match scene.environment {
        Environment::Image { texture, .. } => scene.textures[texture as usize].name == "studio",
        _ => false,
    }
}

/// A closed room, 4 m to a side, and a square panel under its ceiling, looking down.
fn room(side: f32, ke: f32) -> Loaded {
    let mut obj = String::from("mtllib a.mtl\nusemtl wall\n");
    for corner in 0..8 {
        let at = |axis: u32| if corner >> axis & 1 == 0 { -2 } else { 2 };
        obj += &format!("v {} {} {}\n", at(0), at(1), at(2));
    }
    obj += "f 1 2 4 3\nf 5 7 8 6\nf 1 5 6 2\nf 3 4 8 7\nf 1 3 7 5\nf 2 6 8 4\nusemtl lamp\n";
    for [x, z] in [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]] {
        obj += &format!("v {} 1.9 {}\n", x * side / 2.0, z * side / 2.0);
    }
    obj += "f -4 -3 -2 -1\n";
    let mtl = format!("newmtl wall\nKd .7 .7 .7\nnewmtl lamp\nKd 0 0 0\nKe {ke} {ke} {ke}\n");
    Folder::of(&[("a.obj", obj.as_bytes()), ("a.mtl", mtl.as_bytes())]).load("a.obj")
}

#[test]
fn a_lamp_lights_a_room_and_an_led_does_not() {
    // Side in metres, radiance, whether daylight is added.
    for (side, ke, daylight) in
        [(0.3, 17.0, false), (3.5, 1.0, false), (0.01, 1.0, true), (0.01, 20.0, true), (0.4, 1.0, true)]
    {
        let loaded = room(side, ke);
        assert_eq!(is_studio(&loaded.scene), daylight, "{side} m of {ke}: {}", notes(&loaded));
        let said = if daylight { "lit by a studio's sky" } else { "lit by what glows in it" };
        assert!(notes(&loaded).contains(said) && notes(&loaded).contains("\"background\""), "{}", notes(&loaded));
    }
}

#[test]
fn a_ground_that_goes_on_for_a_mile_changes_nothing() {
    let lit = |ground: &str| {
        let obj = format!(
            "mtllib a.mtl\nusemtl m\n{ground}v 0 0 0\nv 3 0 0\nv 3 0 3\nv 0 0 3\nf -1 -2 -3 -4\n\
             v 0 0 0\nv 3 0 0\nv 3 3 0\nv 0 3 0\nf -4 -3 -2 -1\nusemtl lamp\n\
             v 1 2.9 1\nv 2 2.9 1\nv 2 2.9 2\nv 1 2.9 2\nf -4 -3 -2 -1\n"
        );
        let mtl = b"newmtl m\nKd 1 1 1\nnewmtl lamp\nKe 10 10 10\n";
        Folder::of(&[("a.obj", obj.as_bytes()), ("a.mtl", mtl)]).load("a.obj").scene.environment
    };
    assert_eq!(lit(""), Environment::Black);
    let ground = "v -900 -1 -900\nv 900 -1 -900\nv 900 -1 900\nv -900 -1 900\nf -1 -2 -3 -4\n";
    assert_eq!(lit(ground), Environment::Black);
}

/// The square of a product, half of it before a texture that glows.
fn glowing(image: Vec<u8>, folded: bool) -> Scene {
    let mut document = gltf::square();
    gltf::set(&mut document, "/textures", json!([{ "source": 0 }]));
    gltf::set(&mut document, "/images", json!([{ "uri": "a.png" }]));
    let glow = json!({ "emissiveFactor": [1, 1, 1], "emissiveTexture": { "index": 0 }, "doubleSided": true,
        "extensions": { "KHR_materials_emissive_strength": { "emissiveStrength": 8 } } });
    gltf::set(&mut document, "/materials/-", glow);
    let primitive = json!({ "attributes": { "POSITION": 0, "TEXCOORD_0": 2 }, "indices": 3, "material": 1 });
    gltf::set(&mut document, "/meshes/-", json!({ "primitives": [primitive] }));
    let turn = if folded { json!([0.0, 0.707_106_77, 0.0, 0.707_106_77]) } else { json!([0, 0, 0, 1]) };
    gltf::set(&mut document, "/nodes/-", json!({ "mesh": 1, "rotation": turn, "translation": [1, 0, 0] }));
    gltf::set(&mut document, "/scenes/0/nodes", json!([0, 1]));
    let text = document.to_string();
    let files: &[(&str, &[u8])] =
        &[("a.gltf", text.as_bytes()), ("square.bin", &gltf::square_bytes()), ("a.png", &image)];
    Folder::of(files).load("a.gltf").scene
}

#[test]
fn a_texture_that_glows_counts_by_its_texels_not_by_its_factor() {
    assert_eq!(glowing(png(8, 8, [255; 4]), true).environment, Environment::Black);
    assert!(is_studio(&glowing(png(8, 8, [8, 8, 8, 255]), true)));
    assert!(is_studio(&glowing(png(8, 8, [255; 4]), false)), "beside it lies nothing that it could light");
}

/// A box of one material, as scans and games have them: what glows of it is in a texture.
fn glowing_box(texel: impl Fn(u32, u32) -> [u8; 4]) -> Loaded {
    let mut obj = String::from("mtllib a.mtl\nusemtl all\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n");
    for corner in 0..8 {
        let at = |axis: u32| if corner >> axis & 1 == 0 { -1 } else { 1 };
        obj += &format!("v {} {} {}\n", at(0), at(1), at(2));
    }
    for [a, b, c, d] in [[1, 3, 4, 2], [5, 6, 8, 7], [1, 2, 6, 5], [3, 7, 8, 4], [1, 5, 7, 3], [2, 4, 8, 6]] {
        obj += &format!("f {a}/1 {b}/2 {c}/3 {d}/4\n");
    }
    let files: &[(&str, &[u8])] = &[
        ("a.obj", obj.as_bytes()),
        ("a.mtl", b"newmtl all\nKd .5 .5 .5\nKe 1 1 1\nmap_Ke e.png\n"),
        ("e.png", &png_of(16, 16, texel)),
    ];
    Folder::of(files).load("a.obj")
}

#[test]
fn what_glows_in_the_texture_of_a_whole_product_does_not_light_it() {
    let (white, black, next_to_black) = ([255; 4], [0, 0, 0, 255], [3, 2, 3, 255]);
    let led = glowing_box(|x, y| if [x, y] == [5, 5] { white } else { black });
    assert!(is_studio(&led.scene), "{}", notes(&led));
    let packed_with_losses = glowing_box(|x, y| if [x, y] == [5, 5] { white } else { next_to_black });
    assert!(is_studio(&packed_with_losses.scene), "{}", notes(&packed_with_losses));
    let screens = glowing_box(|x, _| if x < 8 { white } else { black });
    assert!(is_studio(&screens.scene), "{}", notes(&screens));
    let all = glowing_box(|_, _| white);
    assert_eq!(all.scene.environment, Environment::Black);
    assert!(notes(&all).contains("about 100.0 % of daylight"), "{}", notes(&all));
    assert!(is_studio(&glowing_box(|_, _| next_to_black).scene), "all of it glows, and none to speak of");
}

#[test]
fn a_sky_that_a_scene_json_names_stays_be_it_black() {
    let obj = b"mtllib a.mtl\nusemtl m\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\nusemtl led\nv 0 0 1\nv .01 0 1\nv 0 .01 1\nf 4 5 6\n";
    let mtl = b"newmtl m\nKd 1 1 1\nnewmtl led\nKe 0 1 0\n";
    let sky = |json: &str| {
        let files: &[(&str, &[u8])] = &[("a.obj", obj), ("a.mtl", mtl), ("scene.json", json.as_bytes())];
        Folder::of(files).load("").scene
    };
    assert!(is_studio(&sky(r#"{"obj": "a.obj"}"#)));
    let black = Environment::Black;
    assert_eq!(sky(r#"{"obj": "a.obj", "background": [0, 0, 0]}"#).environment, black);
    let lamp = r#"{"type": "point", "position": [0, 0, 2], "intensity": [1, 1, 1]}"#;
    assert_eq!(sky(&format!(r#"{{"obj": "a.obj", "lights": [{lamp}]}}"#)).environment, black, "a light keeps it off");
}

#[test]
fn a_studio_shows_what_is_white_and_what_is_chrome() {
    let files: &[(&str, &[u8])] = &[("a.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")];
    let scene = Folder::of(files).load("a.obj").scene;
    let Environment::Image { texture, .. } = scene.environment else { panic!("{:?}", scene.environment) };
    let texture = &scene.textures[texture as usize];
    let Pixels::Float(texels) = &texture.pixels else { panic!("a sky is radiance") };
    let mean = |rows: std::ops::Range<u32>| {
        let all = &texels[(rows.start * texture.width) as usize..(rows.end * texture.width) as usize];
        all.iter().map(|texel| texel[1]).sum::<f32>() / all.len() as f32
    };
    let (above, below) = (mean(0..texture.height / 2), mean(texture.height / 2..texture.height));
    let brightest = texels.iter().map(|texel| texel[1]).fold(0.0, f32::max);
    assert!(above > 1.5 * below && brightest > 5.0 * above, "{above} {below} {brightest}");
    // The key light is before the triangle, above, to the left of the camera.
    let at = texels.iter().position(|texel| texel[1] == brightest).unwrap() as u32;
    let (row, column) = (at / texture.width, at % texture.width);
    let longitude = std::f32::consts::TAU * ((column as f32 + 0.5) / texture.width as f32 - 0.5);
    let key = Vec3::new(longitude.sin(), 0.0, -longitude.cos());
    let view = scene.camera.target - scene.camera.origin;
    let left = Vec3::Y.cross(view);
    assert!(row < texture.height / 2 && key.dot(view) < 0.0 && key.dot(left) > 0.0, "{key} {view}");
}

#[test]
fn in_a_closed_room_the_camera_stands_inside_under_a_lamp() {
    let loaded = room(0.3, 0.0);
    let (camera, said) = (loaded.scene.camera, notes(&loaded));
    assert!(camera.origin.abs().max_element() < 2.0, "{}: {said}", camera.origin);
    assert!(said.contains("in the room") && said.contains("a lamp in the room"), "{said}");
    assert_eq!(loaded.scene.lights.len(), 1);
}
