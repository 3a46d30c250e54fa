//! glTF 2.0.

use glam::{Vec2, Vec3};
use scenes::photometry::{LUMENS_PER_WATT, photometric};
use scenes::read::{Loaded, ReadError};
use scenes::{Coat, Colour, Coverage, Dielectric, Gloss, Light, Material, Pixels, Scalar, Sheen, Specular, Surface};
use serde_json::{Value, json};

use crate::folder::{Folder, notes, png, textures};

/// Corners of a unit square in z = 0, normals +z, texture coordinates from the top left, two triangles.
pub fn square_bytes() -> Vec<u8> {
    let positions = [[0.0_f32, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
    let normals = [[0.0_f32, 0.0, 1.0]; 4];
    let uvs = [[0.0_f32, 1.0], [1.0, 1.0], [1.0, 0.0], [0.0, 0.0]];
    let floats = positions.iter().flatten().chain(normals.iter().flatten()).chain(uvs.iter().flatten());
    let mut bytes: Vec<u8> = floats.flat_map(|f| f.to_le_bytes()).collect();
    bytes.extend([0_u16, 1, 2, 0, 2, 3].iter().flat_map(|i| i.to_le_bytes()));
    bytes
}

/// A document with one node that shows the square in `square.bin`.
pub fn square() -> Value {
    json!({
        "asset": { "version": "2.0" },
        "scene": 0,
        "scenes": [{ "nodes": [0] }],
        "nodes": [{ "mesh": 0, "name": "square" }],
        "meshes": [{ "primitives": [
            { "attributes": { "POSITION": 0, "NORMAL": 1, "TEXCOORD_0": 2 }, "indices": 3, "material": 0 }] }],
        "materials": [{ "name": "paint", "pbrMetallicRoughness": { "baseColorFactor": [0.8, 0.4, 0.2, 1.0] } }],
        "accessors": [
            { "bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3", "min": [0, 0, 0], "max": [1, 1, 0] },
            { "bufferView": 1, "componentType": 5126, "count": 4, "type": "VEC3" },
            { "bufferView": 2, "componentType": 5126, "count": 4, "type": "VEC2" },
            { "bufferView": 3, "componentType": 5123, "count": 6, "type": "SCALAR" }],
        "bufferViews": [
            { "buffer": 0, "byteOffset": 0, "byteLength": 48 },
            { "buffer": 0, "byteOffset": 48, "byteLength": 48 },
            { "buffer": 0, "byteOffset": 96, "byteLength": 32 },
            { "buffer": 0, "byteOffset": 128, "byteLength": 12 }],
        "buffers": [{ "uri": "square.bin", "byteLength": 140 }]
    })
}

/// The same in one file.
pub fn glb(mut document: Value, binary: &[u8]) -> Vec<u8> {
    document["buffers"][0].as_object_mut().unwrap().remove("uri");
    let mut text = document.to_string().into_bytes();
    text.resize(text.len().next_multiple_of(4), b' ');
    let mut binary = binary.to_vec();
    binary.resize(binary.len().next_multiple_of(4), 0);
    let mut bytes = b"glTF".to_vec();
    let length = 28 + text.len() + binary.len();
    for word in [2, length, text.len()] {
        bytes.extend((word as u32).to_le_bytes());
    }
    bytes.extend(b"JSON");
    bytes.extend(&text);
    bytes.extend((binary.len() as u32).to_le_bytes());
    bytes.extend(b"BIN\0");
    bytes.extend(&binary);
    bytes
}

pub fn try_load(document: &Value) -> Result<Loaded, ReadError> {
    let text = document.to_string();
    let files: &[(&str, &[u8])] = &[
        ("a.gltf", text.as_bytes()),
        ("square.bin", &square_bytes()),
        ("a.png", &png(1, 1, [10, 20, 30, 40])),
        ("opaque.png", &png(1, 1, [10, 20, 30, 255])),
    ];
    Folder::of(files).try_load("a.gltf")
}

fn load(document: &Value) -> Loaded {
    try_load(document).unwrap_or_else(|error| panic!("{error}"))
}

/// The document after a change at a JSON pointer.
fn with(pointer: &str, value: Value) -> Value {
    let mut document = square();
    set(&mut document, pointer, value);
    document
}

pub fn set(document: &mut Value, pointer: &str, value: Value) {
    let (parent, field) = pointer.rsplit_once('/').unwrap();
    match document.pointer_mut(parent).unwrap() {
        Value::Array(list) if field == "-" => list.push(value),
        Value::Array(list) => list[field.parse::<usize>().unwrap()] = value,
        parent => parent[field] = value,
    }
}

fn material(value: Value) -> Material {
    load(&with("/materials/0", value)).scene.materials[0].clone()
}

#[test]
fn a_square_arrives_as_it_left() {
    let scene = load(&square()).scene;
    let mesh = &scene.meshes[0];
    assert_eq!(mesh.positions, [Vec3::ZERO, Vec3::X, Vec3::new(1.0, 1.0, 0.0), Vec3::Y]);
    assert_eq!(mesh.triangles, [[0, 1, 2], [0, 2, 3]]);
    assert_eq!(mesh.normals, [Vec3::Z; 4]);
    assert_eq!((scene.objects[0].name.as_str(), scene.materials[0].name.as_str()), ("square", "paint"));
}

#[test]
fn texture_coordinates_count_from_the_bottom_here() {
    let mut document = square();
    set(&mut document, "/textures", json!([{ "source": 0 }]));
    set(&mut document, "/images", json!([{ "uri": "a.png" }]));
    set(&mut document, "/materials/0/pbrMetallicRoughness/baseColorTexture", json!({ "index": 0 }));
    let scene = load(&document).scene;
    assert_eq!(scene.meshes[0].uvs, [Vec2::ZERO, Vec2::X, Vec2::ONE, Vec2::Y]);
    assert_eq!(scene.textures[0].pixels, Pixels::Srgb8(vec![[10, 20, 30, 40]]));
    // The extension's own example: the lower left quarter of the image, turned by a quarter.
    let transform = json!({ "offset": [0, 1], "rotation": std::f32::consts::FRAC_PI_2, "scale": [0.5, 0.5] });
    let info = json!({ "index": 0, "extensions": { "KHR_texture_transform": transform } });
    set(&mut document, "/materials/0/pbrMetallicRoughness/baseColorTexture", info);
    for uv in &load(&document).scene.meshes[0].uvs {
        assert!(uv.x > -1e-6 && uv.x < 0.500_001 && uv.y > -1e-6 && uv.y < 0.500_001, "{uv}");
    }
}

#[test]
fn containers_of_all_kinds_hold_the_same_scene() {
    let plain = load(&square()).scene;
    let packed = Folder::of(&[("a.glb", &glb(square(), &square_bytes()))]).load("");
    assert_eq!(packed.scene, plain);
    let inline =
        with("/buffers/0/uri", json!(format!("data:application/octet-stream;base64,{}", base64(&square_bytes()))));
    assert_eq!(load(&inline).scene, plain);
    assert_eq!(load(&with("/bufferViews/0/byteStride", json!(0))).scene, plain, "some exporters mean none by 0");
    let json = br#"{"gltf": "a.glb", "name": "a"}"#;
    let named = Folder::of(&[("a.glb", &glb(square(), &square_bytes())), ("scene.json", json)]).load("");
    assert_eq!(named.scene, plain);
}

pub fn base64(bytes: &[u8]) -> String {
    const DIGITS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let group = |chunk: &[u8]| {
        let word = (0..3).fold(0_u32, |word, i| word << 8 | u32::from(*chunk.get(i).unwrap_or(&0)));
        let digit = |i: usize| if i > chunk.len() { '=' } else { DIGITS[(word >> (18 - 6 * i)) as usize & 63] as char };
        (0..4).map(digit).collect::<String>()
    };
    bytes.chunks(3).map(group).collect()
}

#[test]
fn nodes_place_shared_meshes() {
    let mut document = square();
    let nodes = json!([
        { "children": [1, 2], "translation": [10, 0, 0], "scale": [2, 2, 2] },
        { "mesh": 0, "translation": [0, 1, 0] },
        { "mesh": 0, "rotation": [0, 0, 0.707_106_77, 0.707_106_77] }
    ]);
    set(&mut document, "/nodes", nodes);
    let scene = load(&document).scene;
    assert_eq!((scene.meshes.len(), scene.objects.len()), (1, 2));
    let place = |i: usize, p: Vec3| scene.objects[i].scene_from_object.point(p);
    assert_eq!(place(0, Vec3::X), Vec3::new(12.0, 2.0, 0.0));
    assert!((place(1, Vec3::X) - Vec3::new(10.0, 2.0, 0.0)).length() < 1e-5, "{}", place(1, Vec3::X));
}

#[test]
fn mirrored_instances_are_not_turned_inside_out() {
    let scene = load(&with("/nodes/0/scale", json!([1, -1, 1]))).scene;
    let (mesh, pose) = (&scene.meshes[0], &scene.objects[0].scene_from_object);
    assert!(pose.linear.determinant() > 0.0);
    for triangle in &mesh.triangles {
        let [a, b, c] = triangle.map(|i| pose.point(mesh.positions[i as usize]));
        assert!((b - a).cross(c - a).z > 0.0, "wound the other way than its normals, which face +z");
        assert!([a, b, c].iter().all(|p| p.y <= 0.0 && p.x >= 0.0), "stands elsewhere");
    }
    assert_eq!(mesh.normals, [Vec3::Z; 4]);
}

#[test]
fn squeezed_nodes_are_left_out() {
    let mut document = square();
    set(&mut document, "/nodes/-", json!({ "mesh": 0, "scale": [1, 0, 1], "name": "flat" }));
    set(&mut document, "/scenes/0/nodes", json!([0, 1]));
    let loaded = load(&document);
    assert_eq!(loaded.scene.objects.len(), 1);
    assert!(notes(&loaded).contains("nodes[1]: its transform squeezes it flat"), "{}", notes(&loaded));
}

#[test]
fn a_node_that_is_its_own_ancestor_ends_somewhere() {
    let loaded = load(&with("/nodes/0/children", json!([0])));
    assert_eq!(loaded.scene.objects.len(), 1);
    assert!(notes(&loaded).contains("its own ancestor"), "{}", notes(&loaded));
}

#[test]
fn far_instances_keep_their_millimetres() {
    let mut document = square();
    set(&mut document, "/nodes/0/children", json!([1]));
    set(&mut document, "/nodes/-", json!({ "mesh": 0, "translation": [0.001, 0, 0] }));
    set(&mut document, "/nodes/0/translation", json!([8_388_608, 0, 0]));
    let scene = load(&document).scene;
    assert!(scene.centre.x > 8e6);
    let gap = scene.objects[1].scene_from_object.translation.x - scene.objects[0].scene_from_object.translation.x;
    assert!((gap - 0.001).abs() < 1e-6, "{gap}");
}

#[test]
fn cameras_look_along_minus_z() {
    let mut document = square();
    set(
        &mut document,
        "/cameras",
        json!([{ "type": "perspective",
        "perspective": { "yfov": std::f32::consts::FRAC_PI_4, "aspectRatio": 1.5, "znear": 0.1 } }]),
    );
    set(&mut document, "/nodes/-", json!({ "camera": 0, "translation": [0, 0, 5] }));
    set(&mut document, "/scenes/0/nodes", json!([0, 1]));
    let camera = load(&document).scene.camera;
    assert_eq!((camera.origin, camera.target, camera.up), (Vec3::Z * 5.0, Vec3::Z * 4.0, Vec3::Y));
    assert!((camera.fov_y_deg - 45.0).abs() < 1e-4);
    assert_eq!((camera.width, camera.height), (720, 480));
}

#[test]
fn punctual_lights_shine_along_minus_z_whatever_the_scale() {
    let mut document = square();
    let lights = json!([
        { "type": "point", "color": [1, 0.5, 0], "intensity": 10 },
        { "type": "spot", "intensity": 2, "spot": { "innerConeAngle": 0.1, "outerConeAngle": 0.5 } },
        { "type": "directional", "intensity": 3, "name": "sun" }]);
    set(&mut document, "/extensions", json!({ "KHR_lights_punctual": { "lights": lights } }));
    let shine = |light| json!({ "KHR_lights_punctual": { "light": light } });
    set(
        &mut document,
        "/nodes/-",
        json!({ "name": "desk", "extensions": shine(0), "translation": [0, 0, 5], "scale": [9, 9, 9] }),
    );
    // A quarter turn about x: -z becomes +y.
    let turn = json!([0.707_106_77, 0, 0, 0.707_106_77]);
    set(&mut document, "/nodes/-", json!({ "extensions": shine(1), "rotation": turn, "scale": [3, 3, 3] }));
    set(&mut document, "/nodes/-", json!({ "extensions": shine(2) }));
    set(&mut document, "/scenes/0/nodes", json!([0, 1, 2, 3]));
    let scenes::Scene { lights, light_names, lights_are_photometric, .. } = load(&document).scene;
    assert!(lights_are_photometric && !load(&square()).scene.lights_are_photometric);
    assert_eq!(light_names, ["desk", "", "sun"], "the node's name before the lamp's");
    let intensity = Vec3::new(10.0, 5.0, 0.0) / LUMENS_PER_WATT;
    assert_eq!(lights[0], Light::Point { position: Vec3::Z * 5.0, intensity });
    let Light::Spot { direction, intensity, cos_inner, cos_outer, .. } = lights[1] else { panic!("no spot") };
    assert!((direction - Vec3::Y).length() < 1e-6, "{direction}");
    assert!((photometric(intensity) - 2.0).abs() < 1e-5, "candela");
    assert!((cos_inner - 0.1_f32.cos()).abs() < 1e-6 && (cos_outer - 0.5_f32.cos()).abs() < 1e-6);
    let Light::Directional { direction, irradiance, .. } = lights[2] else { panic!("no sun") };
    assert_eq!(direction, Vec3::NEG_Z);
    assert!((photometric(irradiance) - 3.0).abs() < 1e-5, "lux");
}

#[test]
fn a_cone_that_is_wider_within_than_without_is_mended() {
    let spot = |cone: Value| {
        let mut document = square();
        let lights = json!([{ "type": "spot", "intensity": 2, "spot": cone }]);
        set(&mut document, "/extensions", json!({ "KHR_lights_punctual": { "lights": lights } }));
        set(&mut document, "/nodes/-", json!({ "extensions": { "KHR_lights_punctual": { "light": 0 } } }));
        set(&mut document, "/scenes/0/nodes", json!([0, 1]));
        let loaded = load(&document);
        let cosines = loaded.scene.lights.first().map(|light| match light {
            Light::Spot { cos_inner, cos_outer, .. } => [*cos_inner, *cos_outer],
            light => panic!("{light:?}"),
        });
        (cosines, notes(&loaded))
    };
    let (Some([inner, outer]), said) = spot(json!({ "innerConeAngle": 1.5, "outerConeAngle": 0.5 })) else { panic!() };
    assert!((inner - 0.5_f32.cos()).abs() < 1e-6 && outer < inner && inner - outer < 1e-6, "{inner} {outer}");
    assert!(said.contains("the nearest cone"), "{said}");
    let (Some([inner, outer]), _) = spot(json!({ "innerConeAngle": -1, "outerConeAngle": 9 })) else { panic!() };
    assert_eq!([inner, outer], [1.0, -1.0]);
    let (none, said) = spot(json!({ "innerConeAngle": 0, "outerConeAngle": 0 }));
    assert!(none.is_none() && said.contains("outerConeAngle must be above 0"), "{said}");
    assert!(!spot(json!({ "innerConeAngle": 0.1, "outerConeAngle": 0.5 })).1.contains("cone"));
}

#[test]
fn metallic_roughness_keeps_its_factors_and_extensions() {
    let surface = material(json!({
        "pbrMetallicRoughness": { "baseColorFactor": [0.8, 0.4, 0.2, 1], "roughnessFactor": 0.3, "metallicFactor": 0.5 },
        "extensions": { "KHR_materials_ior": { "ior": 2.0 }, "KHR_materials_specular": { "specularFactor": 0.5 } }
    }))
    .surface;
    let Surface::Glossy(gloss) = surface else { panic!("{surface:?}") };
    let factors = (gloss.base.value, gloss.roughness.value, gloss.metalness.value);
    assert_eq!(factors, (Vec3::new(0.8, 0.4, 0.2), 0.3, 0.5));
    assert!((gloss.f0 - 1.0 / 9.0).abs() < 1e-6 && gloss.coat.is_none(), "{}", gloss.f0);
    assert_eq!(gloss.specular, Specular { amount: Scalar::plain(0.5), ..Specular::WHOLE });
}

#[test]
fn highlights_have_a_strength_and_a_colour_by_factor_and_texture() {
    let of = |specular: Value, ior: f32| {
        let mut document = square();
        set(&mut document, "/textures", json!([{ "source": 0 }]));
        set(&mut document, "/images", json!([{ "uri": "a.png" }]));
        let extensions = json!({ "KHR_materials_specular": specular, "KHR_materials_ior": { "ior": ior } });
        let plastic = json!({ "pbrMetallicRoughness": { "metallicFactor": 0 }, "extensions": extensions });
        set(&mut document, "/materials/0", plastic);
        let loaded = load(&document);
        let Surface::Glossy(gloss) = &loaded.scene.materials[0].surface else { panic!("it is glossy") };
        (*gloss, notes(&loaded), loaded.scene)
    };
    let bright = json!({ "specularFactor": 0.25, "specularColorFactor": [20, 1, 0] });
    let (gloss, said, _) = of(bright, 1.5);
    let colour = Colour::plain(Vec3::new(20.0, 1.0, 0.0));
    assert_eq!(gloss.specular, Specular { amount: Scalar::plain(0.25), colour });
    assert!(!said.contains("specular"), "{said}");
    let texture = json!({ "index": 0 });
    let (gloss, _, scene) = of(json!({ "specularTexture": texture, "specularColorTexture": texture }), 1.5);
    let [amount, colour] = [gloss.specular.amount.texture.unwrap().0, gloss.specular.colour.texture.unwrap()];
    assert_eq!(gloss.specular.amount.texture.unwrap().1, 3, "by its alpha");
    assert!(matches!(scene.textures[amount as usize].pixels, Pixels::Linear8(_)));
    assert!(matches!(scene.textures[colour as usize].pixels, Pixels::Srgb8(_)));
    // What converters write: F₀ is the colour.
    assert_eq!(of(json!({ "specularColorFactor": [0.5, 0.4, 0.3] }), 0.0).0.f0, 1.0);
    let (gloss, said, _) = of(json!({ "specularColorFactor": [-1, 0, 0] }), 1.5);
    assert_eq!(gloss.specular, Specular::WHOLE);
    assert!(said.contains("specularColorFactor is negative"), "{said}");
}

#[test]
fn a_clear_coat_is_a_coat_unless_it_is_over_glass() {
    let of = |base: Value, more: Value| {
        let mut extensions = json!({ "KHR_materials_clearcoat":
            { "clearcoatFactor": 0.75, "clearcoatRoughnessFactor": 0.25 } });
        for (name, value) in more.as_object().unwrap() {
            extensions[name] = value.clone();
        }
        material(json!({ "pbrMetallicRoughness": base, "extensions": extensions })).surface
    };
    let expected = Coat { amount: Scalar::plain(0.75), roughness: Scalar::plain(0.25) };
    // Smooth metal, which would be a mirror.
    let metal = of(json!({ "roughnessFactor": 0 }), json!({}));
    assert!(matches!(metal, Surface::Glossy(Gloss { coat: Some(coat), .. }) if coat == expected), "{metal:?}");
    let glass = json!({ "KHR_materials_transmission": { "transmissionFactor": 1 } });
    assert!(matches!(of(json!({ "metallicFactor": 0 }), glass), Surface::Dielectric(_)));
}

#[test]
fn sheen_lies_over_all_but_glass() {
    let of = |base: Value, more: Value, sheen: Value| {
        let mut document = square();
        set(&mut document, "/textures", json!([{ "source": 0 }]));
        set(&mut document, "/images", json!([{ "uri": "a.png" }]));
        let mut extensions = json!({ "KHR_materials_sheen": sheen });
        for (name, value) in more.as_object().unwrap() {
            extensions[name] = value.clone();
        }
        set(&mut document, "/materials/0", json!({ "pbrMetallicRoughness": base, "extensions": extensions }));
        let loaded = load(&document);
        (loaded.scene.materials[0].surface.clone(), notes(&loaded))
    };
    let matt = json!({ "KHR_materials_specular": { "specularFactor": 0 } });
    let red = json!({ "sheenColorFactor": [0.9, 0.2, 0.1], "sheenRoughnessFactor": 0.4 });
    let expected = Sheen { colour: Colour::plain(Vec3::new(0.9, 0.2, 0.1)), roughness: Scalar::plain(0.4) };
    let bases = [(json!({ "metallicFactor": 0 }), matt), (json!({ "roughnessFactor": 0 }), json!({}))];
    for (base, more) in bases {
        let (surface, said) = of(base, more, red.clone());
        assert!(
            matches!(surface, Surface::Glossy(Gloss { sheen: Some(sheen), .. }) if sheen == expected),
            "{surface:?}"
        );
        assert!(!said.contains("sheen"), "{said}");
    }
    let texture = json!({ "index": 0 });
    let by_texture = json!({ "sheenColorFactor": [1, 1, 1], "sheenRoughnessFactor": 1,
        "sheenColorTexture": texture, "sheenRoughnessTexture": texture });
    let (surface, _) = of(json!({}), json!({}), by_texture);
    let Surface::Glossy(Gloss { sheen: Some(sheen), .. }) = surface else { panic!("{surface:?}") };
    assert!(sheen.colour.texture.is_some() && sheen.roughness.texture.is_some_and(|(_, channel)| channel == 3));
    // Black is none.
    let (surface, _) = of(json!({}), json!({}), json!({ "sheenRoughnessFactor": 0.4 }));
    assert!(matches!(surface, Surface::Glossy(Gloss { sheen: None, .. })), "{surface:?}");
    let glass = json!({ "KHR_materials_transmission": { "transmissionFactor": 0.5 } });
    let (surface, said) = of(json!({ "metallicFactor": 0 }), glass, red);
    assert!(matches!(surface, Surface::Glazed { .. }) && said.contains("sheen over glass is not drawn"), "{said}");
}

#[test]
fn smooth_metals_are_mirrors_and_surfaces_without_lobe_are_diffuse() {
    let mirror =
        material(json!({ "pbrMetallicRoughness": { "roughnessFactor": 0.0, "baseColorFactor": [0.9, 0.9, 0.9, 1] } }));
    assert_eq!(mirror.surface, Surface::Mirror { reflectance: Vec3::splat(0.9) });
    let diffuse = material(json!({ "pbrMetallicRoughness": { "metallicFactor": 0 },
        "extensions": { "KHR_materials_specular": { "specularFactor": 0 } } }));
    assert!(matches!(diffuse.surface, Surface::Diffuse { .. }));
}

#[test]
fn transmission_is_glass_and_thin_without_volume() {
    let glass = |extensions: Value| {
        let base = json!({ "baseColorFactor": [0.5, 1, 1, 1], "roughnessFactor": 0, "metallicFactor": 0 });
        material(json!({ "pbrMetallicRoughness": base, "extensions": extensions })).surface
    };
    let pane = glass(json!({ "KHR_materials_transmission": { "transmissionFactor": 1 } }));
    let tint = Colour::plain(Vec3::new(0.5, 1.0, 1.0));
    assert_eq!(pane, Surface::Dielectric(Dielectric { transmittance: tint, ..Dielectric::clear(1.5, true) }));
    let volume = json!({ "thicknessFactor": 2, "attenuationDistance": 1, "attenuationColor": [1, 0.5, 1] });
    let solid = glass(json!({ "KHR_materials_transmission": { "transmissionFactor": 1 },
        "KHR_materials_ior": { "ior": 1.33 }, "KHR_materials_volume": volume }));
    let Surface::Dielectric(Dielectric { ior, transmittance, absorption, thin, .. }) = solid else {
        panic!("{solid:?}")
    };
    assert_eq!((ior, transmittance, thin), (1.33, tint, false));
    assert!((absorption - Vec3::new(0.0, std::f32::consts::LN_2, 0.0)).length() < 1e-6, "{absorption}");
    // Without a thickness it has no inside, and so nothing that absorbs.
    let volume = json!({ "attenuationDistance": 1, "attenuationColor": [1, 0.5, 1] });
    let film = glass(json!({ "KHR_materials_transmission": { "transmissionFactor": 1 },
        "KHR_materials_volume": volume }));
    assert_eq!(film, pane);
}

#[test]
fn what_transmits_in_part_is_glass_in_part() {
    let of = |base: Value, transmission: Value| {
        let extensions = json!({ "KHR_materials_transmission": transmission });
        material(json!({ "pbrMetallicRoughness": base, "extensions": extensions })).surface
    };
    let plain =
        |metal: f32| json!({ "baseColorFactor": [0.5, 1, 1, 1], "roughnessFactor": 0.5, "metallicFactor": metal });
    let Surface::Glazed { amount, glass, base, metalness, f0, .. } =
        of(plain(0.0), json!({ "transmissionFactor": 0.45 }))
    else {
        panic!()
    };
    assert_eq!((amount, metalness), (Scalar::plain(0.45), Scalar::plain(0.0)));
    assert_eq!((glass.roughness, glass.thin, glass.transmittance), (Scalar::plain(0.5), true, base));
    assert!((f0 - 0.04).abs() < 1e-6);
    // Frosted where all of it is glass, and no glass where all of it is metal.
    let frosted = of(plain(0.0), json!({ "transmissionFactor": 1 }));
    assert!(matches!(frosted, Surface::Dielectric(glass) if glass.roughness == Scalar::plain(0.5)));
    let metal = of(plain(1.0), json!({ "transmissionFactor": 1 }));
    assert!(matches!(metal, Surface::Glazed { metalness, .. } if metalness.value == 1.0));
    assert!(matches!(of(plain(0.0), json!({})), Surface::Glossy(_)));
}

#[test]
fn diffuse_transmission_is_a_sheet() {
    let sheet = |extension: Value| {
        let base = json!({ "baseColorFactor": [0.5, 1, 1, 1], "metallicFactor": 0 });
        let extensions = json!({ "KHR_materials_diffuse_transmission": extension });
        material(json!({ "pbrMetallicRoughness": base, "extensions": extensions })).surface
    };
    let paper = sheet(json!({ "diffuseTransmissionFactor": 0.25, "diffuseTransmissionColorFactor": [1, 0.5, 0] }));
    let albedo = Colour::plain(Vec3::new(0.375, 0.75, 0.75));
    assert_eq!(paper, Surface::Translucent { albedo, transmittance: Colour::plain(Vec3::new(0.25, 0.125, 0.0)) });
    assert!(matches!(sheet(json!({})), Surface::Glossy(_)));
    assert!(matches!(sheet(json!({ "diffuseTransmissionFactor": "much" })), Surface::Glossy(_)));
}

#[test]
fn emission_and_unlit() {
    let lamp = material(json!({ "emissiveFactor": [1, 0.5, 0], "doubleSided": true,
        "extensions": { "KHR_materials_emissive_strength": { "emissiveStrength": 12 } } }));
    assert_eq!((lamp.emission.value, lamp.emits_both_sides), (Vec3::new(12.0, 6.0, 0.0), true));
    let unlit = material(json!({ "pbrMetallicRoughness": { "baseColorFactor": [0.5, 0.5, 0.5, 1] },
        "extensions": { "KHR_materials_unlit": {} } }));
    assert_eq!(unlit.emission.value, Vec3::splat(0.5));
    assert!(matches!(unlit.surface, Surface::Diffuse { albedo } if albedo.is_black()));
}

/// What of a surface is there, by mode, factor, and the texture's alpha.
#[test]
fn alpha_is_coverage() {
    let coverage = |mode: &str, factor: f32, image: Option<&str>| {
        let mut document = square();
        let mut base = json!({ "baseColorFactor": [1, 1, 1, factor] });
        if let Some(image) = image {
            set(&mut document, "/textures", json!([{ "source": 0 }]));
            set(&mut document, "/images", json!([{ "uri": image }]));
            set(&mut base, "/baseColorTexture", json!({ "index": 0 }));
        }
        let material = json!({ "alphaMode": mode, "alphaCutoff": 0.25, "pbrMetallicRoughness": base });
        set(&mut document, "/materials/0", material);
        let loaded = load(&document);
        assert!(!notes(&loaded).contains("alpha"), "{}", notes(&loaded));
        loaded.scene.materials[0].coverage
    };
    let textured = |value, cutoff| Some(Coverage { amount: Scalar { value, texture: Some((0, 3)) }, cutoff });
    for image in [None, Some("a.png"), Some("opaque.png")] {
        assert_eq!(coverage("OPAQUE", 0.1, image), None, "{image:?}");
    }
    for image in [None, Some("opaque.png")] {
        assert_eq!(coverage("BLEND", 0.15, image), Some(Coverage::plain(0.15)), "{image:?}");
        assert_eq!(coverage("BLEND", 1.0, image), None, "{image:?}");
        assert_eq!(coverage("MASK", 0.25, image), None, "{image:?}");
        assert_eq!(coverage("MASK", 0.2, image).map(|coverage| coverage.of(1.0)), Some(0.0), "{image:?}");
    }
    assert_eq!(coverage("BLEND", 1.0, Some("a.png")), textured(1.0, None));
    assert_eq!(coverage("BLEND", 0.3, Some("a.png")), textured(0.3, None));
    assert_eq!(coverage("MASK", 0.5, Some("a.png")), textured(0.5, Some(0.25)));
}

#[test]
fn integers_and_sparse_accessors_are_read() {
    let mut document = square();
    // Positions: zeros, of which two are replaced; first and third corner of the square's own.
    let sparse = json!({ "count": 2, "indices": { "bufferView": 4, "componentType": 5123 },
        "values": { "bufferView": 0, "byteOffset": 12 } });
    set(
        &mut document,
        "/accessors/0",
        json!({ "componentType": 5126, "count": 4, "type": "VEC3",
        "min": [0, 0, 0], "max": [1, 1, 0], "sparse": sparse }),
    );
    set(&mut document, "/bufferViews/-", json!({ "buffer": 0, "byteOffset": 130, "byteLength": 4 }));
    let scene = load(&document).scene;
    assert_eq!(scene.meshes[0].positions, [Vec3::ZERO, Vec3::X, Vec3::new(1.0, 1.0, 0.0)]);
    assert_eq!(scene.triangle_count(), 1, "the other triangle lost its area");

    let mut document = square();
    let view = json!({ "bufferView": 0, "componentType": 5121, "normalized": true, "count": 4, "type": "VEC2" });
    set(&mut document, "/accessors/2", view);
    set(&mut document, "/textures", json!([{ "source": 0 }]));
    set(&mut document, "/images", json!([{ "uri": "a.png" }]));
    set(&mut document, "/materials/0/pbrMetallicRoughness/baseColorTexture", json!({ "index": 0 }));
    assert_eq!(load(&document).scene.meshes[0].uvs[0], Vec2::new(0.0, 1.0));
}

#[test]
fn extensions_that_are_not_known_are_named_once() {
    let needed = load(&with("/extensionsRequired", json!(["KHR_lights_punctual", "KHR_texture_basisu"])));
    let said = notes(&needed);
    assert!(said.contains("extensionsRequired: KHR_texture_basisu is not understood"), "{said}");
    let mut both = with("/extensionsUsed", json!(["KHR_materials_ior", "XYZ_odd"]));
    set(&mut both, "/extensionsRequired", json!(["XYZ_odd"]));
    let said = notes(&load(&both));
    assert_eq!(said.matches("XYZ_odd is not understood").count(), 1, "{said}");
    assert!(!said.contains("_ior"));
}

#[test]
fn what_is_not_drawn_is_said() {
    let mut document = square();
    set(&mut document, "/meshes/0/primitives/-", json!({ "attributes": { "POSITION": 0 }, "mode": 1 }));
    let said = notes(&load(&document));
    assert!(said.contains("points and lines"), "{said}");
}

/// Whether anything is left of a document, and what is said about it.
fn outcome(document: &Value) -> (bool, String) {
    match try_load(document) {
        Ok(loaded) => (true, notes(&loaded)),
        Err(error) => (false, error.to_string()),
    }
}

#[test]
fn what_is_broken_is_left_out_by_name_and_what_has_nothing_left_is_refused() {
    let cases: &[(&str, Value, bool, &str)] = &[
        ("/scene", json!(7), true, "scene: index 7 is out of range: there are 1; the first is used"),
        ("/scenes/0/nodes", json!([9]), false, "nodes[9]: index 9 is out of range: there are 1"),
        ("/scenes/0/nodes", json!([0, -1]), true, "scenes[0].nodes[1]: invalid type: integer `-1`"),
        ("/nodes/0/children", json!([4_000_000_000_u32]), true, "nodes[4000000000]: index 4000000000 is out of range"),
        ("/nodes/0/mesh", json!(3), false, "nodes[0].mesh: index 3"),
        ("/nodes/0/camera", json!(3), true, "nodes[0].camera: index 3"),
        ("/nodes/0/camera", json!(-1), true, "nodes[0].camera: invalid type: integer `-1`"),
        ("/nodes/0/translation", json!([1, null, 3]), true, "nodes[0].translation"),
        ("/nodes/0/extensions", json!({ "KHR_lights_punctual": { "light": 0 } }), true, "punctual.light: index 0"),
        ("/meshes/0/primitives/0/material", json!(5), true, "meshes[0].primitives[0].material: index 5"),
        ("/meshes/0/primitives/0/material", json!("a"), true, "meshes[0].primitives[0].material: invalid type: string"),
        ("/meshes/0/primitives/0/indices", json!(50), false, "meshes[0].primitives[0].indices: index 50"),
        ("/meshes/0/primitives/0/attributes/POSITION", json!(50), false, "attributes.POSITION: index 50"),
        ("/meshes/0/primitives/0/attributes", json!({}), false, "attributes.POSITION: is missing"),
        ("/meshes/0/primitives/0/mode", json!(77), false, "has an unknown mode"),
        ("/meshes/0/primitives/0/indices", json!(0), false, "indices must be unsigned integers"),
        ("/meshes/0/primitives/0/attributes/NORMAL", json!(2), true, "has type Vec2; 3 numbers each are expected"),
        ("/meshes/0/primitives/-", json!({ "attributes": {} }), true, "primitives[1].attributes.POSITION: is missing"),
        ("/meshes/0/primitives/-", json!(7), true, "meshes[0].primitives[1]: invalid type"),
        ("/materials/0", json!(7), true, "materials[0]: invalid type"),
        ("/materials/0/alphaCutoff", json!("half"), true, "materials[0].alphaCutoff: invalid type"),
        ("/materials", json!({}), true, "materials: is no list: left out"),
        ("/accessors/3/bufferView", json!(2), false, "index 16256 is out of range: there are 4 vertices"),
        ("/accessors/0/bufferView", json!(88), false, "index 88"),
        ("/accessors/0/count", json!(5), false, "needs 5 elements of 12 bytes, more than bufferViews[0] holds"),
        ("/accessors/0/count", json!(u64::MAX), false, "elements"),
        ("/accessors/0/byteOffset", json!(u64::MAX), false, "more than bufferViews[0] holds"),
        ("/accessors/1/count", json!(3), true, "has 3 elements, but there are 4 positions; left out"),
        ("/accessors/0/componentType", json!(1), false, "unknown component type"),
        ("/bufferViews/0/buffer", json!(6), false, "leaves buffers[6]"),
        ("/bufferViews/0/byteLength", json!(u64::MAX), false, "leaves buffers[0]"),
        ("/bufferViews/0/byteOffset", json!(u64::MAX), false, "leaves buffers[0]"),
        ("/bufferViews/0/byteStride", json!(4), false, "has a stride of 4, less than 12"),
        ("/buffers/0/byteLength", json!(141), true, "buffers[0]: should have 141 bytes but has 140"),
        ("/buffers/0/uri", json!("gone.bin"), false, "file `gone.bin` does not exist"),
        ("/buffers/0/uri", json!("https://example.org/a.bin"), false, "is not on this machine"),
        ("/buffers/0/uri", json!("data:;base64,%%%"), false, "cannot be decoded"),
        ("/buffers/0/uri", json!("%ff%fe"), false, "does not exist"),
        ("/asset/version", json!("1.0"), false, "asset.version: 1.0 is not read here"),
        ("/asset", json!({}), false, "missing field `version`"),
        ("/nodes", json!([]), false, "index 0"),
        ("/nodes/0/scale", json!([1e-300, 1, 1]), false, "holds no triangle"),
    ];
    for (pointer, value, drawn, expected) in cases {
        let (is_drawn, message) = outcome(&with(pointer, value.clone()));
        assert!(message.contains(expected), "{pointer} = {value}: {message}");
        assert_eq!(is_drawn, *drawn, "{pointer} = {value}: {message}");
        assert!(message.contains("a.gltf"), "{message}");
    }
}

#[test]
fn triangles_of_vertices_that_do_not_exist_are_dropped() {
    let mut bytes = square_bytes();
    bytes[138] = 77;
    let files: &[(&str, &[u8])] = &[("a.gltf", &square().to_string().into_bytes()), ("square.bin", &bytes)];
    let loaded = Folder::of(files).load("a.gltf");
    assert_eq!(loaded.scene.triangle_count(), 1);
    assert!(notes(&loaded).contains("index 77 is out of range: there are 4 vertices; its triangles are dropped"));
}

#[test]
fn whole_numbers_may_be_written_with_a_point() {
    let plain = load(&square());
    let text = square().to_string();
    for (from, to) in [(":48", ":48.0"), (":48", ":4.8e1"), (":5126", ":5126.0"), ("[0]", "[0.0]"), (":0,", ":0.0,")] {
        let text = text.replace(from, to);
        let files: &[(&str, &[u8])] = &[("a.gltf", text.as_bytes()), ("square.bin", &square_bytes())];
        let loaded = Folder::of(files).load("a.gltf");
        assert_eq!(loaded.scene, plain.scene, "{to}");
    }
    let every = text.replace("\":48", "\":48.0");
    let files: &[(&str, &[u8])] = &[("a.gltf", every.as_bytes()), ("square.bin", &square_bytes())];
    let said = notes(&Folder::of(files).load("a.gltf"));
    assert!(said.contains("bufferViews[0]: whole numbers are written with a point"), "{said}");
    assert!(load(&with("/asset/version", json!(2.0))).scene == plain.scene);
}

#[test]
fn what_is_valid_though_a_crate_refuses_it_is_read() {
    let mut document = square();
    set(&mut document, "/scenes/-", json!({ "name": "nothing in it" }));
    let moved = json!({ "sampler": 0, "target": { "node": 0, "path": "translation" } });
    let aimless = json!({ "sampler": 0, "target": { "path": "pointer" } });
    let samplers = json!([{ "input": 0, "output": 0 }]);
    set(&mut document, "/animations", json!([{ "channels": [aimless, moved, aimless], "samplers": samplers }]));
    set(&mut document, "/textures", json!([{ "extensions": { "KHR_texture_basisu": { "source": 0 } } }, {}]));
    set(&mut document, "/materials/0/pbrMetallicRoughness/baseColorTexture", json!({ "index": 0 }));
    let loaded = load(&document);
    let said = notes(&loaded);
    assert!(said.contains("animations[0].channels: a channel's target has no node: left out; so in 1 more places"));
    assert!(said.contains("textures[0]: has its picture only from an extension KHR_texture_basisu"), "{said}");
    assert!(said.contains("textures[1]: has no source: the plain colour is used"), "{said}");
    assert!(!said.contains("scenes[1]"), "{said}");
    assert_eq!(loaded.scene.triangle_count(), 2);
}

#[test]
fn a_document_of_many_faults_is_read_in_few_words() {
    let mut document = square();
    let broken = json!({ "mesh": -1, "camera": "none", "translation": [1, 2], "children": [-1, -2, -3] });
    let nodes = document["nodes"].as_array_mut().unwrap();
    nodes.extend(std::iter::repeat_n(broken, 20_000));
    let loaded = load(&document);
    assert!(loaded.notes.len() < 100, "{} notes", loaded.notes.len());
    assert!(notes(&loaded).contains("19992 more like it"), "{}", notes(&loaded));
}

#[test]
fn pictures_that_are_missing_or_none_leave_the_colour() {
    let mut document = square();
    set(&mut document, "/textures", json!([{ "source": 0, "sampler": 9 }]));
    set(&mut document, "/materials/0/pbrMetallicRoughness/baseColorTexture", json!({ "index": 0 }));
    for (image, expected) in [
        (json!({ "uri": "gone.png" }), "images[0]: file `gone.png` does not exist; the plain colour is used"),
        (json!({ "uri": "square.bin" }), "images[0]: square.bin: is no picture of a known kind"),
        (json!({ "bufferView": 0, "mimeType": "image/png" }), "images[0]: is no picture of a known kind"),
        (json!({ "uri": "data:image/png;base64,iVBORw0KGgo=" }), "images[0]: the image cannot be decoded"),
        (json!({ "uri": "data:image/png;base64,%" }), "images[0]: its data: URI cannot be decoded"),
        (json!({ "bufferView": 12 }), "images[0]: index 12"),
        (json!({ "bufferView": -1 }), "images[0].bufferView: invalid type"),
        (json!({}), "images[0]: has neither uri nor bufferView"),
    ] {
        set(&mut document, "/images", json!([image]));
        let loaded = load(&document);
        let said = notes(&loaded);
        assert!(said.contains(expected) && said.contains("textures[0].sampler: index 9 is out of range"), "{said}");
        assert!(textures(&loaded.scene).is_empty());
    }
    for (image, expected) in crate::bad_input::broken_pictures() {
        let files: &[(&str, &[u8])] = &[("square.bin", &square_bytes()), ("a.png", &image)];
        set(&mut document, "/images", json!([{ "uri": "a.png" }]));
        let folder = Folder::of(files);
        folder.write("a.gltf", document.to_string().as_bytes());
        let said = notes(&folder.load("a.gltf"));
        assert!(said.contains("images[0]: a.png: ") && said.contains(expected), "{said}");
    }
    set(&mut document, "/textures", json!([{ "source": 3 }]));
    assert!(notes(&load(&document)).contains("textures[0].source: index 3"));
    set(&mut document, "/textures", json!([]));
    assert!(notes(&load(&document)).contains("baseColorTexture: index 0 is out of range"));
}

#[test]
fn a_glowing_texture_that_is_lost_is_dark() {
    let mut document = square();
    set(&mut document, "/materials/0/emissiveFactor", json!([1, 1, 1]));
    set(&mut document, "/materials/0/emissiveTexture", json!({ "index": 0 }));
    assert_eq!(load(&document).scene.materials[0].emission.value, Vec3::ZERO);
}

#[test]
fn a_glb_cut_off_anywhere_is_refused() {
    let bytes = glb(square(), &square_bytes());
    for length in 0..bytes.len() {
        let result = Folder::of(&[("a.glb", &bytes[..length])]).try_load("a.glb");
        assert!(result.is_err(), "cut at {length} of {}", bytes.len());
    }
}

#[test]
fn textures_without_texture_coordinates_are_named() {
    let mut document = square();
    document["images"] = json!([{ "uri": "a.png" }]);
    document["textures"] = json!([{ "source": 0 }]);
    document["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"] = json!({ "index": 0 });
    let said = |document: &Value| {
        let (text, texture) = (document.to_string(), png(1, 1, [10, 20, 30, 255]));
        let files: [(&str, &[u8]); 3] =
            [("a.gltf", text.as_bytes()), ("square.bin", &square_bytes()), ("a.png", &texture)];
        notes(&Folder::of(&files).load("a.gltf"))
    };
    let expected = "2 triangles of textured materials have no texture coordinates: 0 0 is used";
    assert!(!said(&document).contains(expected), "{}", said(&document));
    document["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"]["texCoord"] = json!(1);
    assert!(said(&document).contains(expected), "{}", said(&document));
    document["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"]["texCoord"] = json!(0);
    document["meshes"][0]["primitives"][0]["attributes"].as_object_mut().unwrap().remove("TEXCOORD_0");
    assert!(said(&document).contains(expected), "{}", said(&document));
}
