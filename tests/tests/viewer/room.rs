//! A small scene whose parts can be moved: a room with a coloured wall on either side, a lamp under the ceiling, and a
//! box on the floor.

use std::fs;
use std::path::{Path, PathBuf};

use base64::Engine;

/// Writes it into a folder.
pub fn write(folder: &Path) {
    let file = |name: &str, text: &str| fs::write(folder.join(name), text).expect("the folder can be written to");
    file("scene.obj", OBJ);
    file("scene.mtl", MTL);
    file("scene.json", JSON);
}

/// The same, with a box that moves by itself and a lamp that can be aimed.
pub fn write_moving(folder: &Path) {
    write(folder);
    let lamp = r#"{ "type": "spot", "name": "Desk lamp", "position": [-1, 2.5, 1], "direction": [0, -1, 0], "intensity": [9, 9, 9], "outer_deg": 40 }"#;
    let keys = r#"[{ "t": 0 }, { "t": 4, "translate": [0.8, 0, 0] }]"#;
    let more = format!(r#"{{ "lights": [{lamp}], "animation": [{{ "object": "box", "keyframes": {keys} }}],"#);
    fs::write(folder.join("scene.json"), JSON.replacen('{', &more, 1)).expect("the folder can be written to");
}

/// The same as one object, with a second box, of the same material, to the right of the first.
pub fn write_boxes(folder: &Path) {
    write(folder);
    let (mut obj, boxes) = OBJ.split_once("o box\n").map_or((String::new(), ""), |(room, boxes)| (room.into(), boxes));
    obj = obj.replace("o lamp\n", "");
    for (first, x) in [(13, -1.0), (21, 1.0)] {
        for line in boxes.lines() {
            let words: Vec<&str> = line.split(' ').collect();
            let number = |at: usize| words[at].parse::<f64>().expect("a number");
            match words[0] {
                "v" => obj += &format!("v {} {} {}\n", x + number(1), 0.2 + number(2), number(3)),
                "f" => {
                    let corner = |word: &&str| first - 13 + word.parse::<i32>().expect("an index");
                    let corners = words[1..].iter().map(|word| corner(word).to_string()).collect::<Vec<_>>();
                    obj += &format!("f {}\n", corners.join(" "));
                }
                _ => obj += &format!("{line}\n"),
            }
        }
    }
    fs::write(folder.join("scene.obj"), obj).expect("the folder can be written to");
}

/// The same, with four candles of these strengths, W/sr.
pub fn write_candles(folder: &Path, strengths: [f32; 4]) {
    write(folder);
    let candles = (1..).zip(strengths).map(|(number, strength)| {
        let x = 0.5 * f64::from(number) - 1.25;
        format!(
            r#"{{ "type": "point", "name": "candle {number}", "position": [{x}, 1.4, 0.8], "intensity": [{strength}, {strength}, {strength}] }}"#
        )
    });
    let more = format!("{{ \"lights\": [{}],", candles.collect::<Vec<_>>().join(", "));
    fs::write(folder.join("scene.json"), JSON.replacen('{', &more, 1)).expect("the folder can be written to");
}

/// The same, with a lamp in the room and a sun.
pub fn write_lamps(folder: &Path) {
    write(folder);
    let lamp = r#"{ "type": "point", "position": [0.8, 1.9, 1], "intensity": [2, 2, 2] }"#;
    let sun = r#"{ "type": "directional", "name": "Sun", "direction": [-0.2, -1, -0.4], "irradiance": [9, 9, 9] }"#;
    let more = format!(r#"{{ "lights": [{lamp}, {sun}],"#);
    fs::write(folder.join("scene.json"), JSON.replacen('{', &more, 1)).expect("the folder can be written to");
}

/// The same under an image of a sky that is bright on one side, with a sun.
pub fn write_sky(folder: &Path) {
    write(folder);
    let texels = image::Rgb32FImage::from_fn(16, 8, |x, _| image::Rgb([if x < 8 { 2.0 } else { 0.1 }, 0.5, 0.5]));
    texels.save(folder.join("sky.hdr")).expect("the folder can be written to");
    let sun = r#"{ "type": "directional", "name": "Sun", "direction": [0, -1, -1], "irradiance": [9, 9, 9] }"#;
    let more = format!(r#"{{ "lights": [{sun}], "environment": {{ "image": "sky.hdr", "turn_deg": 45 }},"#);
    fs::write(folder.join("scene.json"), JSON.replacen('{', &more, 1)).expect("the folder can be written to");
}

/// A floor under a lamp of 40 candela, as glTF has it: its path.
pub fn write_candela(folder: &Path) -> PathBuf {
    let corners: [[f32; 3]; 4] = [[-2.0, 0.0, -2.0], [-2.0, 0.0, 2.0], [2.0, 0.0, 2.0], [2.0, 0.0, -2.0]];
    let mut bytes: Vec<u8> = corners.as_flattened().iter().flat_map(|v| v.to_le_bytes()).collect();
    bytes.extend([0_u16, 1, 2, 0, 2, 3].iter().flat_map(|index| index.to_le_bytes()));
    let data = base64::engine::general_purpose::STANDARD.encode(&bytes);
    let document = serde_json::json!({
        "asset": { "version": "2.0" },
        "scene": 0,
        "scenes": [{ "nodes": [0, 1, 2] }],
        "nodes": [
            { "mesh": 0, "name": "floor" },
            { "translation": [0, 2, 0], "extensions": { "KHR_lights_punctual": { "light": 0 } } },
            { "translation": [0, 2.5, 2.5], "rotation": [-0.382_683, 0, 0, 0.923_88], "camera": 0 },
        ],
        "cameras": [{ "type": "perspective", "perspective": { "yfov": 0.7, "aspectRatio": 1.333, "znear": 0.1 } }],
        "meshes": [{ "primitives": [{ "attributes": { "POSITION": 0 }, "indices": 1 }] }],
        "accessors": [
            { "bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3", "min": [-2, 0, -2], "max": [2, 0, 2] },
            { "bufferView": 1, "componentType": 5123, "count": 6, "type": "SCALAR" },
        ],
        "bufferViews": [
            { "buffer": 0, "byteLength": 48 },
            { "buffer": 0, "byteOffset": 48, "byteLength": 12 },
        ],
        "buffers": [{ "byteLength": 60, "uri": format!("data:application/octet-stream;base64,{data}") }],
        "extensionsUsed": ["KHR_lights_punctual"],
        "extensions": { "KHR_lights_punctual": { "lights": [{ "type": "point", "intensity": 40 }] } },
    });
    let path = folder.join("candela.gltf");
    fs::write(&path, document.to_string()).expect("the folder can be written to");
    path
}

const OBJ: &str = "mtllib scene.mtl
o room
v -2 0 -2
v 2 0 -2
v 2 3 -2
v -2 3 -2
v -2 0 3
v 2 0 3
v 2 3 3
v -2 3 3
usemtl white
f 1 5 6 2
f 1 2 3 4
f 4 3 7 8
usemtl red
f 1 4 8 5
usemtl green
f 2 6 7 3
o lamp
v -0.6 2.9 -0.6
v 0.6 2.9 -0.6
v 0.6 2.9 0.6
v -0.6 2.9 0.6
usemtl lamp
f 9 10 11 12
o box
v -0.5 0.01 -0.5
v 0.5 0.01 -0.5
v 0.5 0.01 0.5
v -0.5 0.01 0.5
v -0.5 1.2 -0.5
v 0.5 1.2 -0.5
v 0.5 1.2 0.5
v -0.5 1.2 0.5
usemtl blue
f 13 14 15 16
f 17 20 19 18
f 13 17 18 14
f 14 18 19 15
f 15 19 20 16
f 16 20 17 13
";

const MTL: &str = "newmtl white
illum 1
Kd 0.75 0.75 0.75
newmtl red
illum 1
Kd 0.7 0.1 0.1
newmtl green
illum 1
Kd 0.1 0.6 0.1
newmtl blue
illum 1
Kd 0.2 0.3 0.7
newmtl lamp
illum 1
Kd 0 0 0
Ke 14 12 9
";

const JSON: &str = r#"{
  "name": "room",
  "obj": "scene.obj",
  "camera": {
    "origin": [0.6, 1.7, 5.2], "target": [0, 1.1, 0], "up": [0, 1, 0], "fov_y_deg": 45, "width": 200, "height": 150
  },
  "background": [0.02, 0.03, 0.05]
}
"#;
