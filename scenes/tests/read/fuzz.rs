//! Files that were damaged: whatever is read is sound, and nothing panics.

use proptest::prelude::*;

use crate::folder::{Folder, png};
use crate::gltf;

/// One piece of damage.
#[derive(Clone, Debug)]
enum Damage {
    Set(prop::sample::Index, u8),
    Cut(prop::sample::Index),
    Drop(prop::sample::Index, u8),
    Insert(prop::sample::Index, &'static str),
    Repeat(prop::sample::Index, u8),
}

fn damage() -> impl Strategy<Value = Vec<Damage>> {
    let at = || any::<prop::sample::Index>();
    let words = prop::sample::select(&[
        "-1",
        "0",
        "nan",
        "inf",
        "1e999",
        "-",
        "/",
        "//",
        "\n",
        "\\\n",
        "f",
        "v",
        "o",
        "usemtl",
        "4294967295",
        "é",
        "\"",
        "{",
        "]",
        ":",
        ",",
        "null",
        "true",
        "-0.0",
        "1e-40",
        "18446744073709551615",
        "\0",
        "#",
        "map_Kd",
        "illum",
        "-s",
    ]);
    let one = prop_oneof![
        (at(), any::<u8>()).prop_map(|(at, byte)| Damage::Set(at, byte)),
        at().prop_map(Damage::Cut),
        (at(), 1..9_u8).prop_map(|(at, count)| Damage::Drop(at, count)),
        (at(), words).prop_map(|(at, word)| Damage::Insert(at, word)),
        (at(), 1..40_u8).prop_map(|(at, count)| Damage::Repeat(at, count)),
    ];
    prop::collection::vec(one, 1..6)
}

fn apply(bytes: &[u8], damages: &[Damage]) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    for damage in damages {
        let length = bytes.len().max(1);
        match damage {
            Damage::Set(at, byte) => bytes.iter_mut().skip(at.index(length)).take(1).for_each(|slot| *slot = *byte),
            Damage::Cut(at) => bytes.truncate(at.index(length)),
            Damage::Drop(at, count) => {
                let start = at.index(length).min(bytes.len());
                bytes.drain(start..(start + usize::from(*count)).min(bytes.len()));
            }
            Damage::Insert(at, word) => {
                let start = at.index(length).min(bytes.len());
                bytes.splice(start..start, word.bytes());
            }
            Damage::Repeat(at, count) => {
                let start = at.index(length).min(bytes.len());
                let piece = bytes[start..(start + usize::from(*count)).min(bytes.len())].to_vec();
                bytes.splice(start..start, piece);
            }
        }
    }
    bytes
}

const OBJ: &str = "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0.5\nv 0 1 0\nv 0.5 0.5 1\nvt 0 0\nvt 1 0\nvt 1 1\n\
    vn 0 0 1\nvn 0 1 0\no one\nusemtl m\nf 1/1/1 2/2/1 3/3/2\nf 1 3 4\no two\nusemtl n\nf 1//1 2//2 5//1\nf -4 -3 -2 -1\n\
    usemtl k\nf 1 2 5 3 4\n";
const MTL: &str = "newmtl m\nillum 2\nKd .5 .6 .7\nKs .1 .1 .1\nNs 30\nmap_Kd -s 2 2 1 a.png\nnewmtl n\nillum 7\nNi 1.5\n\
    Tf 1 1 1\nd 0.2\nnewmtl k\nKe 1 2 3\nPr 0.2\nPm 1\nmap_d a.png\n";
const JSON: &str = r#"{"name": "x", "obj": "a.obj", "camera": {"origin": [0, 0, 3], "target": [0, 0, 0], "up": [0, 1, 0],
    "fov_y_deg": 40, "width": 64, "height": 48}, "lights": [{"type": "point", "position": [0, 2, 0], "intensity": [1, 1, 1]},
    {"type": "spot", "position": [0, 2, 0], "direction": [0, -1, 0], "intensity": [1, 1, 1], "outer_deg": 30}],
    "background": [0, 0, 0], "animation": [{"object": "one", "pivot": [0, 0, 0], "axis": [0, 1, 0],
    "keyframes": [{"t": 0, "translate": [0, 0, 0], "angle_deg": 0}, {"t": 1, "angle_deg": 90}]}]}"#;

/// Loads the folder with one file damaged; [`Folder::try_load`] demands soundness.
fn survive(name: &str, damages: &[Damage]) {
    let png = png(4, 4, [1, 2, 3, 200]);
    let files: [(&str, &[u8]); 4] =
        [("a.obj", OBJ.as_bytes()), ("a.mtl", MTL.as_bytes()), ("scene.json", JSON.as_bytes()), ("a.png", &png)];
    let folder = Folder::of(&files);
    let (_, content) = files.iter().find(|(file, _)| *file == name).unwrap();
    folder.write(name, &apply(content, damages));
    if let Err(error) = folder.try_load("") {
        assert!(!error.to_string().is_empty());
    }
}

#[test]
fn the_undamaged_scene_is_read() {
    let png = png(4, 4, [1, 2, 3, 200]);
    let files: &[(&str, &[u8])] =
        &[("a.obj", OBJ.as_bytes()), ("a.mtl", MTL.as_bytes()), ("scene.json", JSON.as_bytes()), ("a.png", &png)];
    let loaded = Folder::of(files).load("");
    assert_eq!((loaded.scene.triangle_count(), loaded.scene.objects.len(), loaded.scene.textures.len()), (8, 2, 2));
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn damaged_obj_is_survived(damages in damage()) {
        survive("a.obj", &damages);
    }

    #[test]
    fn damaged_mtl_is_survived(damages in damage()) {
        survive("a.mtl", &damages);
    }

    #[test]
    fn damaged_json_is_survived(damages in damage()) {
        survive("scene.json", &damages);
    }

    #[test]
    fn damaged_images_are_survived(damages in damage()) {
        survive("a.png", &damages);
    }

    #[test]
    fn damaged_gltf_is_survived(damages in damage()) {
        let text = rich_gltf().to_string();
        let damaged = apply(text.as_bytes(), &damages);
        let files: &[(&str, &[u8])] = &[("a.gltf", &damaged), ("square.bin", &gltf::square_bytes()), ("a.png", &png(1, 1, [9; 4]))];
        let _ = Folder::of(files).try_load("a.gltf");
    }

    #[test]
    fn damaged_glb_is_survived(damages in damage()) {
        let bytes = apply(&gltf::glb(rich_gltf(), &gltf::square_bytes()), &damages);
        let _ = Folder::of(&[("a.glb", &bytes), ("a.png", &png(1, 1, [9; 4]))]).try_load("a.glb");
    }

    #[test]
    fn numbers_of_any_size_in_gltf_are_survived(which in any::<prop::sample::Index>(), value in number()) {
        let mut document = rich_gltf();
        let mut pointers = Vec::new();
        collect_numbers(&document, String::new(), &mut pointers);
        gltf::set(&mut document, &pointers[which.index(pointers.len())], value);
        let _ = gltf::try_load(&document);
    }
}

fn number() -> impl Strategy<Value = serde_json::Value> {
    prop_oneof![
        any::<u64>().prop_map(Into::into),
        any::<i64>().prop_map(Into::into),
        (0..9_u32).prop_map(Into::into),
        any::<f64>().prop_map(Into::into),
        prop::sample::select(vec![1e308, -1e308, 1e-308, 1e38, 1e-45, 0.0, -1.0]).prop_map(Into::into),
    ]
}

/// With one of everything.
fn rich_gltf() -> serde_json::Value {
    use serde_json::json;
    let mut document = gltf::square();
    let lamps = json!([{ "type": "spot", "intensity": 2, "spot": { "innerConeAngle": 0.1, "outerConeAngle": 0.5 } }]);
    let sparse =
        json!({ "count": 1, "indices": { "bufferView": 3, "componentType": 5123 }, "values": { "bufferView": 0 } });
    let texture =
        json!({ "index": 0, "extensions": { "KHR_texture_transform": { "scale": [2, 2], "rotation": 0.5 } } });
    for (pointer, value) in [
        ("/extensions", json!({ "KHR_lights_punctual": { "lights": lamps } })),
        ("/cameras", json!([{ "type": "perspective", "perspective": { "yfov": 0.8, "znear": 0.1 } }])),
        ("/nodes/0/children", json!([1])),
        (
            "/nodes/-",
            json!({ "mesh": 0, "scale": [1, -1, 1], "rotation": [0, 0, 0.6, 0.8], "translation": [3, 0, 0],
            "camera": 0, "extensions": { "KHR_lights_punctual": { "light": 0 } } }),
        ),
        ("/accessors/1/sparse", sparse),
        ("/textures", json!([{ "source": 0, "sampler": 0 }])),
        ("/samplers", json!([{ "wrapS": 33071, "wrapT": 33071 }])),
        ("/images", json!([{ "uri": "a.png" }])),
        ("/materials/0/pbrMetallicRoughness/baseColorTexture", texture),
        (
            "/materials/0/extensions",
            json!({ "KHR_materials_ior": { "ior": 1.4 },
            "KHR_materials_transmission": { "transmissionFactor": 0.9 },
            "KHR_materials_volume": { "thicknessFactor": 1, "attenuationDistance": 2, "attenuationColor": [1, 0.5, 0.5] } }),
        ),
    ] {
        gltf::set(&mut document, pointer, value);
    }
    document
}

fn collect_numbers(value: &serde_json::Value, pointer: String, pointers: &mut Vec<String>) {
    match value {
        serde_json::Value::Number(_) => pointers.push(pointer),
        serde_json::Value::Array(list) => {
            list.iter().enumerate().for_each(|(i, item)| collect_numbers(item, format!("{pointer}/{i}"), pointers));
        }
        serde_json::Value::Object(fields) => {
            fields.iter().for_each(|(name, item)| collect_numbers(item, format!("{pointer}/{name}"), pointers));
        }
        _ => {}
    }
}
