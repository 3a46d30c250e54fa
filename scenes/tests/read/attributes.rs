//! What vertices and textures bring: colours, smoothing groups, relief, several sets of texture coordinates, pictures of all
//! kinds.

use glam::{Vec2, Vec3, Vec4};
use image::ImageFormat;
use scenes::{Colour, Gloss, LookUp, Mesh, Scene, Surface, Wrap};
use serde_json::{Value, json};

use crate::folder::{Folder, load_mtl, load_obj, notes, png, textures};
use crate::gltf::{base64, set, square, try_load};

/// Adds numbers in a buffer of their own; returns their accessor's index.
pub fn accessor(document: &mut Value, kind: &str, count: usize, numbers: &[f32]) -> usize {
    let bytes: Vec<u8> = numbers.iter().flat_map(|number| number.to_le_bytes()).collect();
    let uri = format!("data:;base64,{}", base64(&bytes));
    let length = |document: &Value, list: &str| document[list].as_array().unwrap().len();
    let (buffer, view) = (length(document, "buffers"), length(document, "bufferViews"));
    set(document, "/buffers/-", json!({ "uri": uri, "byteLength": bytes.len() }));
    set(document, "/bufferViews/-", json!({ "buffer": buffer, "byteLength": bytes.len() }));
    set(document, "/accessors/-", json!({ "bufferView": view, "componentType": 5126, "count": count, "type": kind }));
    length(document, "accessors") - 1
}

fn load(document: &Value) -> Scene {
    try_load(document).unwrap_or_else(|error| panic!("{error}")).scene
}

/// The square with a texture, and how it is sampled.
fn textured(sampler: Value) -> Value {
    let mut document = square();
    set(&mut document, "/textures", json!([{ "source": 0, "sampler": 0 }]));
    set(&mut document, "/samplers", json!([sampler]));
    set(&mut document, "/images", json!([{ "uri": "a.png" }]));
    set(&mut document, "/materials/0/pbrMetallicRoughness/baseColorTexture", json!({ "index": 0 }));
    document
}

fn base(scene: &Scene) -> Colour {
    match &scene.materials[0].surface {
        Surface::Glossy(Gloss { base, .. }) => *base,
        other => panic!("{other:?}"),
    }
}

#[test]
fn vertex_colours_of_every_type_multiply_the_colour() {
    let mut document = square();
    let rgb = [[1.0_f32, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.5, 0.5, 2.0]];
    let colours = accessor(&mut document, "VEC3", 4, rgb.as_flattened());
    set(&mut document, "/meshes/0/primitives/0/attributes/COLOR_0", json!(colours));
    let red = [65535, 0, 0, 65535];
    let mesh = &load(&document).meshes[0];
    assert_eq!((mesh.colours[0], mesh.colours[3]), (red, [32768, 32768, 65535, 65535]), "linear, at most 1");
    // The same in bytes with alpha, which counts where the material fades.
    for (mode, alpha) in [("OPAQUE", 65535), ("BLEND", 32896)] {
        let uri = format!("data:;base64,{}", base64(&[255, 0, 0, 128].repeat(4)));
        let mut document = square();
        set(&mut document, "/buffers/-", json!({ "uri": uri, "byteLength": 16 }));
        set(&mut document, "/bufferViews/-", json!({ "buffer": 1, "byteLength": 16 }));
        let bytes = json!({ "bufferView": 4, "componentType": 5121, "normalized": true, "count": 4, "type": "VEC4" });
        set(&mut document, "/accessors/-", bytes);
        set(&mut document, "/meshes/0/primitives/0/attributes/COLOR_0", json!(4));
        set(&mut document, "/materials/0/alphaMode", json!(mode));
        let scene = load(&document);
        assert_eq!(scene.meshes[0].colours[0], [65535, 0, 0, alpha], "{mode}");
        assert_eq!(scene.materials[0].coverage.is_some(), mode == "BLEND");
    }
}

#[test]
fn obj_vertex_colours_are_srgb_of_0_to_1_or_0_to_255() {
    let square = |rgb: &str| format!("v 0 0 0 {rgb}\nv 1 0 0 {rgb}\nv 1 1 0\nf 1 2 3\n");
    for rgb in ["1 0.5019608 0", "255 128 0"] {
        let scene = load_obj(&square(rgb)).scene;
        let [r, g, b, a] = scene.meshes[0].colours[0];
        assert_eq!((r, b, a), (65535, 0, 65535));
        assert!((f32::from(g) / 65535.0 - 0.215_86).abs() < 1e-4, "{g}");
        assert_eq!(scene.meshes[0].colours[2], [65535; 4], "what has no colour is white");
        assert_eq!(scene.materials[0].surface, Surface::Diffuse { albedo: Colour::plain(Vec3::ONE) });
    }
    assert!(load_obj("v 0 0 0 1\nv 1 0 0 1\nv 1 1 0 1\nf 1 2 3\n").scene.meshes[0].colours.is_empty());
    let painted = load_obj("v 0 0 0\nv 1 0 0\nv 1 1 0\n#MRGB ffff0000ff00ff00\nf 1 2 3\n").scene;
    let (red, green, white) = ([65535, 0, 0, 65535], [0, 65535, 0, 65535], [65535; 4]);
    assert_eq!(painted.meshes[0].colours, [red, green, white]);
}

#[test]
fn smoothing_groups_without_normals_are_smooth() {
    let roof = "v 0 0 0\nv 1 0 0\nv 1 1 1\nv 0 1 1\nv 1 2 0\nv 0 2 0\n";
    let ridge = |text: &str| {
        let scene = load_obj(&format!("{roof}{text}")).scene;
        let mesh = Mesh::clone(&scene.meshes[0]);
        let at = mesh.positions.iter().position(|p| *p == Vec3::ONE).unwrap();
        mesh.normals.get(at).copied()
    };
    let smooth = ridge("s 1\nf 1 2 3 4\nf 4 3 5 6\n").expect("it is smooth");
    assert!((smooth - Vec3::Z).length() < 1e-5, "{smooth}");
    let apart = ridge("s 1\nf 1 2 3 4\ns 2\nf 4 3 5 6\n").expect("each is smooth by itself");
    assert!((apart.z - std::f32::consts::FRAC_1_SQRT_2).abs() < 1e-5, "{apart}");
    for flat in ["s off\nf 1 2 3 4\nf 4 3 5 6\n", "s 0\nf 1 2 3 4\nf 4 3 5 6\n", "f 1 2 3 4\nf 4 3 5 6\n"] {
        assert_eq!(ridge(flat), None, "{flat}");
    }
}

#[test]
fn each_way_has_its_own_edges_and_texels_may_stay_apart() {
    let scene = load(&textured(json!({ "wrapS": 33071, "wrapT": 33648, "magFilter": 9728 })));
    let look_up = LookUp { across: Wrap::Clamp, up: Wrap::Mirror, nearest: true, set: 0 };
    assert_eq!(scene.textures[0].look_up, look_up);
    assert_eq!(load(&textured(json!({ "magFilter": 9729 }))).textures[0].look_up, LookUp::REPEAT);
}

#[test]
fn textures_that_lie_otherwise_have_coordinates_of_their_own() {
    let mut document = textured(json!({}));
    let second = accessor(&mut document, "VEC2", 4, &[0.5_f32; 8]);
    set(&mut document, "/meshes/0/primitives/0/attributes/TEXCOORD_1", json!(second));
    let moved = json!({ "KHR_texture_transform": { "offset": [0.25, 0.0] } });
    set(&mut document, "/materials/0/normalTexture", json!({ "index": 0, "texCoord": 1 }));
    set(&mut document, "/materials/0/occlusionTexture", json!({ "index": 0, "texCoord": 1 }));
    set(&mut document, "/materials/0/emissiveTexture", json!({ "index": 0, "extensions": moved }));
    set(&mut document, "/materials/0/emissiveFactor", json!([1, 1, 1]));
    let loaded = try_load(&document).unwrap();
    let scene = &loaded.scene;
    let set_of = |texture: Option<u32>| scene.textures[texture.unwrap() as usize].look_up.set;
    let material = &scene.materials[0];
    let relief = material.relief.map(|relief| relief.texture);
    assert_eq!([set_of(base(scene).texture), set_of(material.emission.texture), set_of(relief)], [0, 1, 2]);
    let mesh = &scene.meshes[0];
    assert_eq!(mesh.corner_uvs(0, 0)[0], Vec2::ZERO);
    assert_eq!(mesh.corner_uvs(0, 1)[0], Vec2::new(0.25, 0.0));
    assert_eq!(mesh.corner_uvs(0, 2), [Vec2::splat(0.5); 3]);
    assert!(!notes(&loaded).contains("lies otherwise") && !notes(&loaded).contains("not drawn"), "{}", notes(&loaded));
    // MTL's maps too.
    let mtl = "newmtl m\nKd 1 1 1\nmap_Kd a.png\nmap_Ke -s 2 2 1 a.png\n";
    let files: &[(&str, &[u8])] =
        &[("a.obj", crate::folder::TRIANGLE.as_bytes()), ("a.mtl", mtl.as_bytes()), ("a.png", &png(1, 1, [9; 4]))];
    let scene = Folder::of(files).load("a.obj").scene;
    assert_eq!(scene.meshes[0].more_uvs, [scene.meshes[0].uvs.iter().map(|uv| *uv * 2.0).collect::<Vec<_>>()]);
}

#[test]
fn normal_maps_have_tangents_the_files_own_or_found_ones() {
    let mut document = textured(json!({}));
    set(&mut document, "/materials/0/normalTexture", json!({ "index": 0, "scale": 0.5 }));
    let found = load(&document);
    assert_eq!(found.materials[0].relief.unwrap().scale, 0.5);
    // u grows along x; up in the picture, which is where v grows here, along y.
    assert_eq!(found.meshes[0].tangents, [Vec4::new(1.0, 0.0, 0.0, 1.0); 4]);
    let given = accessor(&mut document, "VEC4", 4, &[0.0_f32, 1.0, 0.0, -1.0].repeat(4));
    set(&mut document, "/meshes/0/primitives/0/attributes/TANGENT", json!(given));
    assert_eq!(load(&document).meshes[0].tangents, [Vec4::new(0.0, 1.0, 0.0, -1.0); 4]);
}

#[test]
fn bump_maps_are_heights_unless_they_look_like_normals() {
    let relief = |mtl: &str, image: &[u8]| {
        let files: &[(&str, &[u8])] =
            &[("a.obj", crate::folder::TRIANGLE.as_bytes()), ("a.mtl", mtl.as_bytes()), ("b.png", image)];
        let loaded = Folder::of(files).load("a.obj");
        assert!(!notes(&loaded).contains("not drawn"), "{}", notes(&loaded));
        let relief = loaded.scene.materials[0].relief.expect("a relief");
        (relief.scale, loaded.scene.textures[relief.texture as usize].pixels.clone())
    };
    let grey = png(4, 4, [90, 90, 90, 255]);
    let flat = scenes::Pixels::Linear8(vec![[128, 128, 255, 255]; 16]);
    assert_eq!(relief("newmtl m\nmap_Bump -bm 0.3 b.png\n", &grey), (0.3, flat.clone()));
    assert_eq!(relief("newmtl m\nbump b.png\n", &grey), (1.0, flat));
    let normals = scenes::Pixels::Linear8(vec![[150, 120, 240, 255]; 16]);
    let bluish = png(4, 4, [150, 120, 240, 255]);
    assert_eq!(relief("newmtl m\nmap_Bump -bm 2 b.png\n", &bluish), (2.0, normals.clone()));
    assert_eq!(relief("newmtl m\nnorm b.png\n", &bluish), (1.0, normals));
    assert!(load_mtl("newmtl m\nmap_Bump gone.png\n").scene.materials[0].relief.is_none());
}

#[test]
fn pictures_of_common_kinds_are_read() {
    let image = image::RgbImage::from_pixel(2, 2, image::Rgb([255, 0, 0]));
    for (name, format) in [
        ("a.tif", ImageFormat::Tiff),
        ("a.webp", ImageFormat::WebP),
        ("a.gif", ImageFormat::Gif),
        ("a.bmp", ImageFormat::Bmp),
        ("a.tga", ImageFormat::Tga),
    ] {
        let mut bytes = std::io::Cursor::new(Vec::new());
        image::DynamicImage::from(image.clone()).write_to(&mut bytes, format).unwrap();
        let mtl = format!("newmtl m\nKd 1 1 1\nmap_Kd {name}\n");
        let files: &[(&str, &[u8])] =
            &[("a.obj", crate::folder::TRIANGLE.as_bytes()), ("a.mtl", mtl.as_bytes()), (name, bytes.get_ref())];
        let loaded = Folder::of(files).load("a.obj");
        let pixels = loaded.scene.textures.first().map(|texture| texture.pixels.clone());
        assert_eq!(pixels, Some(scenes::Pixels::Srgb8(vec![[255, 0, 0, 255]; 4])), "{name}: {}", notes(&loaded));
    }
}

#[test]
fn a_texture_may_have_its_picture_from_an_extension() {
    let mut document = textured(json!({}));
    set(&mut document, "/images", json!([{ "uri": "gone.png" }, { "uri": "a.png" }]));
    set(&mut document, "/textures/0/extensions", json!({ "EXT_texture_webp": { "source": 1 } }));
    let loaded = try_load(&document).unwrap();
    assert_eq!(textures(&loaded.scene).len(), 1, "{}", notes(&loaded));
}

#[test]
fn specular_colour_and_glossiness_are_reflectance_and_roughness() {
    let mut document = square();
    let gloss =
        json!({ "diffuseFactor": [0.1, 0.0, 0.0, 1.0], "specularFactor": [1.0, 0.8, 0.3], "glossinessFactor": 0.75 });
    let only = json!({ "extensions": { "KHR_materials_pbrSpecularGlossiness": gloss } });
    set(&mut document, "/materials/0", only);
    let scene = load(&document);
    let Surface::Glossy(gloss) = &scene.materials[0].surface else { panic!("it is glossy") };
    assert_eq!((gloss.roughness.value, gloss.metalness.value, gloss.f0), (0.25, 0.0, 1.0));
    assert_eq!((gloss.base.value, gloss.specular.colour.value), (Vec3::X * 0.1, Vec3::new(1.0, 0.8, 0.3)));
    // By textures: roughness from the alpha, here 40 / 255; a colour of their own.
    let mut document = textured(json!({}));
    let info = json!({ "index": 0 });
    let gloss = json!({ "diffuseTexture": info, "specularGlossinessTexture": info });
    set(&mut document, "/materials/0", json!({ "extensions": { "KHR_materials_pbrSpecularGlossiness": gloss } }));
    let scene = load(&document);
    let Surface::Glossy(gloss) = &scene.materials[0].surface else { panic!("it is glossy") };
    assert!(gloss.base.texture.is_some() && gloss.base.texture == gloss.specular.colour.texture);
    let (texture, channel) = gloss.roughness.texture.expect("roughness by texture");
    let scenes::Pixels::Linear8(texels) = &scene.textures[texture as usize].pixels else { panic!("numbers") };
    assert_eq!((texels[0][usize::from(channel)], gloss.roughness.value), (215, 1.0));
}
