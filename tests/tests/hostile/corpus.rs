//! The kept inputs, in `tests/corpus/DECODER/`: sound ones to begin with, and whatever once did harm.

use std::fs;
use std::path::PathBuf;
use std::sync::Arc;

use frame::tone::Operator;
use frame::{Chosen, FrontEnd, Igi, Picture, Reference, ReferenceSetup, ReferenceState};
use protocol::answer::{Body, Cost, EachLight, Moments, Pixels, Seen};
use protocol::message::{Answered, Behind, Hello, Refusal, ToMaster, ToWorker, Welcome, encode};
use protocol::pack;
use protocol::question::{Ask, Asked, Part, Points, Question, Ray};
use protocol::schedule::QuestionId;
use runtime::display::hues::Hues;
use runtime::display::message::ToneSettings;
use runtime::files::{encode_exr, encode_record};
use runtime::live::kept::{self, Files, KeptSession, VIEWS_MAX};
use runtime::live::record::{self, Begun, Recorder, What};
use runtime::methods::Named;
use scenes::{Camera, Change, Keep, Material, Offset, SavedView, SurfacePoint, Transform};
use worker::renderer::{Light, Renderer};

use super::decoders;

pub const OBJ: &str = "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 1\nvn 0 0 1\no one\nusemtl m\n\
                       f 1/1/1 2/2/1 3/1/1 4/2/1\nf -1//1 -2//1 -3//1\ns off\ng two\nf 1 2 4\n";
pub const MTL: &str = "newmtl m\nKd 0.5 0.5 0.5\nKs 0.1 0.1 0.1\nNs 30\nNi 1.5\nd 0.5\nillum 7\nKe 1 1 1\nTf 1 1 1\n";
const JSON: &str = r#"{ "format": "scene-json-1", "name": "kept", "obj": "a.obj", "camera": { "origin": [0, 0, 3], "target": [0, 0, 0], "up": [0, 1, 0],
"fov_y_deg": 40, "width": 32, "height": 16 }, "background": [1, 1, 1], "lights": [] }"#;
const EDITED: &str = r#"{ "scene": "a.obj", "centre": [0, 0, 0], "time": 1.5, "camera": { "origin": [0, 0, 3],
"target": [0, 0, 0], "up": [0, 1, 0], "fov_y_deg": 40, "width": 32, "height": 16 }, "textures": ["t"], "edits": [
{ "of": "one", "change": { "Visible": { "object": 0, "visible": false } } },
{ "of": "two", "triangles": 1, "change": { "PieceVisible": { "object": 1, "piece": 0, "visible": true } } },
{ "of": "m", "change": { "Material": { "material": 0, "value": { "name": "m", "surface": { "Mirror": {
"reflectance": [0.5, 0.5, 0.5] } }, "emission": { "value": [1, 1, 1], "texture": null }, "emits_both_sides": false,
"coverage": null, "relief": null } } } } ] }"#;
const LIT_JSON: &str = r#"{ "obj": "a.obj", "lights": [
{ "type": "point", "position": [0, 2, 0], "intensity": "400 cd", "colour": "2700 K" },
{ "type": "spot", "position": [0, 2, 1], "target": [0, 0, 0], "intensity": { "value": "1.5 klm", "colour": { "xy": [0.46, 0.41] } }, "outer_deg": 25 },
{ "type": "directional", "direction": [0.3, -1, 0.2], "irradiance": "80000 lx", "angular_diameter_deg": 0.53 }], "background": { "value": "3000 cd/m2", "colour": "6500 K" } }"#;

const IES: &str = "IESNA:LM-63-2002\r\n[TEST] none\r\nTILT=INCLUDE\r\n1\r\n2\r\n0 90\r\n1 0.5\r\n1 500 1 3 2 1 2 0 0 0\r\n1 1 10\r\n\
                   0 45 90\r\n0 90\r\n100 50 0\r\n100 70 0\r\n";
const FLOODLIGHT: &str = "IESNA91\nTILT=NONE\n1 -1 2.5 3 2 2 1 0.5 0.5 0\n1 1 100\n-30 0 30\n0 20\n10 100 10\n0 50 0\n";

/// Of eight planes, mirrored in both axes.
fn eulumdat() -> String {
    let head = ["nobody", "2", "4", "8", "45", "3", "45", "none", "lamp", "1", "lamp.ldt", "today"];
    let lamp = ["100", "80,5", "1", "0", "1", "2", "any", "2000", "3000", "80", "20"];
    let numbers =
        (0..8).map(|plane| 45 * plane).chain([0, 45, 90, 100, 70, 5, 90, 60, 5, 80, 50, 5]).map(|n| n.to_string());
    let texts = head.into_iter().chain(["0"; 9]).chain(lamp).chain(["0"; 10]).map(String::from);
    texts.chain(numbers).collect::<Vec<_>>().join("\r\n")
}

pub fn folder(decoder: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("corpus").join(decoder)
}

/// By name.
pub fn files(decoder: &str) -> Vec<(String, Vec<u8>)> {
    let entries = fs::read_dir(folder(decoder)).unwrap_or_else(|error| panic!("no corpus for {decoder}: {error}"));
    let mut files: Vec<_> = entries.map(|entry| entry.expect("an entry").path()).collect();
    files.sort();
    let name = |path: &PathBuf| path.file_name().expect("a name").to_string_lossy().into_owned();
    files.iter().map(|path| (name(path), fs::read(path).expect("a file of the corpus"))).collect()
}

/// What the corpus begins with: one sound input of each kind.
pub fn beginnings() -> Vec<(&'static str, &'static str, Vec<u8>)> {
    let state = protocol::question::WorldState { world: [7; 32], revision: 3 };
    let (id, question) = (QuestionId(9), decoders::question());
    let Ask::Tile(tile) = &question.ask else { panic!("the question is about a tile") };
    let lights = Question { ask: Ask::Lights(tile.lights()), ..question.clone() };
    let whole_from_piece = Transform { translation: glam::Vec3::X, ..Transform::IDENTITY };
    let changes = vec![
        Change::Time(0.25),
        Change::Visible { object: 3, visible: false },
        Change::Offset { object: 4, offset: Offset { own: whole_from_piece, shift: glam::Vec3::Y } },
        Change::Camera(Camera::default()),
        Change::PieceTransform { object: 3, piece: 300, whole_from_piece },
        Change::PieceVisible { object: 3, piece: 7, visible: false },
    ];
    let mut kept = vec![
        ("hello", "sound", encode(&Hello { proof: [1; 32], threads: 8, name: "büro-7".into(), bits: [5; 8] })),
        ("welcome", "sound", encode(&Welcome { proof: [2; 32] })),
        ("refusal", "sound", encode(&Refusal { reason: "wrong token".into() })),
        ("to_worker", "world", encode(&ToWorker::World { state, changes: changes.clone() })),
        ("to_worker", "changes", encode(&ToWorker::Changes { from: state, revision: 4, changes })),
        ("to_worker", "ask", encode(&ToWorker::Ask { id, question: question.clone().into() })),
        ("to_worker", "ask_lights", encode(&ToWorker::Ask { id, question: lights.into() })),
        ("to_worker", "ask_frames", encode(&ToWorker::Ask { id, question: decoders::frames().into() })),
        ("to_worker", "ask_rays", encode(&ToWorker::Ask { id, question: decoders::rays().into() })),
        (
            "to_worker",
            "ask_points",
            encode(&ToWorker::Ask { id, question: decoders::points(decoders::parts_of_light()[2].clone()).into() }),
        ),
        ("to_worker", "cancel", encode(&ToWorker::Cancel { ids: vec![id, QuestionId(u64::MAX)] })),
        ("to_master", "want", encode(&ToMaster::Want { hashes: vec![[3; 32]; 5] })),
        ("to_master", "ready", encode(&ToMaster::Ready { state })),
        ("to_master", "failed", encode(&ToMaster::Failed { id, reason: "no".into() })),
        ("to_master", "refused", encode(&ToMaster::Refused { id, reason: "no".into() })),
        ("to_master", "relaying", encode(&ToMaster::Relaying(Behind { workers: 40, threads: 320, depth: 2 }))),
        ("to_master", "retracted", encode(&ToMaster::Retracted { reason: "no".into() })),
        ("to_master", "leaving", encode(&ToMaster::Leaving { started: vec![id] })),
    ]
    .into_iter()
    .map(|(decoder, name, bytes)| (decoder, name, bytes.expect("words fit")))
    .collect::<Vec<_>>();

    // A real answer, of real light.
    let light = Light { keep: Keep::All };
    for (decoder, question) in [("answer", &question), ("answer_frames", &decoders::frames())] {
        let mut answer = light.answer(&light.build(Arc::new(decoders::scene())), question, &|| 0);
        pack::drop_unsound(&mut answer.body);
        let squeezed = pack::compress(&pack::pack(question, &answer.body, decoders::fields()));
        kept.push((decoder, "sound", Answered { id, cost: Cost::default(), squeezed }.encode()));
    }
    // What points and rays are answered, in all forms.
    let parts = decoders::parts_of_light().into_iter().map(decoders::points);
    for (question, body) in parts.chain([decoders::rays()]).zip(answers_about_points()) {
        let squeezed = pack::compress(&pack::pack(&question, &body, decoders::fields()));
        let name = match &question.ask {
            Ask::Points(points) if points.part == Part::All => "irradiance",
            Ask::Points(Points { part: Part::DirectOf(_), .. }) => "groups",
            Ask::Points(Points { part: Part::EachLight { .. }, .. }) => "each_light",
            Ask::Points(_) => "towards",
            _ => "rays",
        };
        kept.push(("answer_points", name, Answered { id, cost: Cost::default(), squeezed }.encode()));
    }
    // Claims four gigabytes.
    let squeezed = [&[0xff; 4][..], &[0x1f, 0, 1, 0], &[0xff; 64]].concat();
    kept.push(("answer", "lz4_bomb", Answered { id, cost: Cost::default(), squeezed }.encode()));

    let (manifest, parts) = decoders::parts();
    kept.push(("part", "manifest", manifest.blob().bytes));
    for (name, part) in ["layout", "mesh", "texture"].into_iter().zip(parts) {
        kept.push(("part", name, part.bytes));
    }
    kept.push(("json", "sound", JSON.into()));
    kept.push(("json", "edited", EDITED.into()));
    kept.push(("json", "lit", LIT_JSON.into()));
    kept.push(("luminaire", "ies", IES.into()));
    kept.push(("luminaire", "floodlight", FLOODLIGHT.into()));
    kept.push(("luminaire", "eulumdat", eulumdat().into()));
    kept.push(("obj", "sound", OBJ.into()));
    kept.push(("mtl", "sound", MTL.into()));
    kept.push(("gltf", "triangle", glb()));
    let mut image = image::RgbaImage::new(5, 3);
    image.pixels_mut().enumerate().for_each(|(at, pixel)| *pixel = image::Rgba([at as u8 * 17, 3, 200, 128]));
    for (name, format) in
        [("png", image::ImageFormat::Png), ("tga", image::ImageFormat::Tga), ("bmp", image::ImageFormat::Bmp)]
    {
        let mut bytes = std::io::Cursor::new(Vec::new());
        image.write_to(&mut bytes, format).expect("a small image");
        kept.push(("image", name, bytes.into_inner()));
    }
    let rgb = image::DynamicImage::ImageRgba8(image).to_rgb8();
    let mut bytes = std::io::Cursor::new(Vec::new());
    rgb.write_to(&mut bytes, image::ImageFormat::Jpeg).expect("a small image");
    kept.push(("image", "jpeg", bytes.into_inner()));
    kept.push((
        "image",
        "hdr",
        b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 2\n\x80\x80\x80\x80\x10\x20\x30\x81".to_vec(),
    ));
    let picture = Picture::from_fn(5, 3, |x, y| glam::Vec3::new(x as f32, y as f32, 0.5));
    let exr = encode_exr(&picture, &[], &[]).expect("a small picture");
    // The right and lower edge of its data window, in a file of some hundred bytes.
    let mut claims = exr.clone();
    let window = claims.windows(10).position(|name| name == b"dataWindow").expect("it says where its pixels are");
    claims[window + 31..][..8].copy_from_slice(&[16_383_i32.to_le_bytes(); 2].concat());
    kept.push(("image", "exr", exr));
    kept.push(("image", "exr_bomb", claims));
    kept.push(("gltf_json", "data_uri", gltf(DATA_URI).into()));
    kept.push(("gltf_json", "neighbours", gltf("a.bin").into()));
    let camera = Camera { width: 4, height: 2, ..Camera::default() };
    let setup = ReferenceSetup { world: state, camera, seed: 0, max_bounces: None };
    let moments = Moments { sum: vec![glam::DVec3::ONE; 8], squares: vec![glam::DVec3::ONE; 8] };
    let mut front = Reference::resume(setup, ReferenceState { frames: 2, moments });
    kept.push(("reference", "sound", encode_record(&mut front, &Vec::new()).expect("a small picture")));
    kept.push(("checkpoint", "empty", Igi::new(decoders::setup()).checkpoint()));
    kept.push(("checkpoint", "one_frame", one_frame()));
    let sound = recording();
    let text = String::from_utf8(sound.clone()).expect("a recording is text");
    let (begun, lines) = text.split_once('\n').expect("lines");
    // A picture without pixels, one that fits nowhere, a pattern that never ends.
    let looks = |[width, height]: [u32; 2]| {
        let size = format!("\"width\":{width},\"height\":{height}");
        format!("{begun}\n{}", lines.replace("\"width\":640,\"height\":480", &size))
    };
    kept.push(("recording", "harm_no_pixels", looks([0, 480]).into()));
    kept.push(("recording", "harm_huge", looks([300_000; 2]).into()));
    let endless = text.replace("\"interleave\":[3,3]", "\"interleave\":[0,0]");
    kept.push(("recording", "harm_interleave", endless.into()));
    kept.push(("recording", "cut_off", sound[..sound.len() - 9].to_vec()));
    kept.push(("recording", "sound", sound));
    kept.push(("recording", "format_2", include_bytes!("../../golden/format_2.session").to_vec()));
    let mut session = session();
    kept.push(("session", "sound", session.encode().expect("a short one")));
    session.views = vec![session.views[0].clone(); VIEWS_MAX + 1];
    kept.push(("session", "harm_many_views", session.encode().expect("a short one")));
    kept
}

fn session() -> KeptSession {
    let (scene, (manifest, _)) = (decoders::scene(), decoders::parts());
    let files = Files { scene: &scene, manifest: &manifest };
    let place = Transform { translation: glam::Vec3::X, ..Transform::IDENTITY };
    let paint = Change::Material { material: 0, value: Material::diffuse("red", glam::Vec3::X) };
    let put = Change::Transform { object: 0, scene_from_object: place };
    let step = (vec![put.clone()], vec![put.undo(&scene).expect("it can be")]);
    let view = SavedView { target: glam::Vec3::X, up: glam::Vec3::Y, fov_y_deg: 40.0, ..SavedView::default() };
    KeptSession {
        solids: Vec::new(),
        presets: Vec::new(),
        igi_kept: kept::VERSION,
        scene: "a.obj".into(),
        files: files.print(),
        saved: 7,
        edits: files.kept(vec![put, paint, Change::Time(0.5)]),
        history: [vec![step], Vec::new()],
        hues: Hues { materials: [(0, glam::Vec3::ONE)].into(), ..Hues::default() },
        camera: Camera::default(),
        tone: ToneSettings { exposure: 0.5, operator: Operator::Aces },
        views: vec![view],
    }
}

/// To nine points or rays each, in the order of [`decoders::parts_of_light`], rays last.
fn answers_about_points() -> [Body; 5] {
    let colours = |count: usize| (0..count).map(|i| glam::Vec3::new(0.1, 0.02, 3.0) * i as f32).collect::<Vec<_>>();
    let pixels = Pixels {
        emitted: colours(9),
        reflectance: vec![glam::Vec3::splat(0.5); 9],
        irradiance: colours(9),
        normal: vec![glam::Vec3::Z; 9],
        distance: (0..9).map(|i| i as f32).collect(),
    };
    let decoders_rays = decoders::rays();
    let Ask::Rays(rays) = &decoders_rays.ask else { panic!("they are rays") };
    let other = SurfacePoint { uv: [0.5, 0.25], back: true, ..SurfacePoint::default() };
    let hit = |(i, ray): (usize, &Ray)| if i == 7 { None } else { Some(ray.aim.unwrap_or(other)) };
    let hits = rays.through.iter().enumerate().map(hit).collect();
    [
        Body::Irradiance(colours(9)),
        Body::Irradiance(colours(9)),
        Body::EachLight(EachLight { of: 30, lights: 8, unhidden: colours(72), visible: vec![true; 72] }),
        Body::Seen(Seen { pixels: pixels.clone(), hits: Vec::new() }),
        Body::Seen(Seen { pixels, hits }),
    ]
}

fn recording() -> Vec<u8> {
    let (method, camera) = (Named::from(&Chosen::new(&frame::methods::igi::IGI)), Camera::default());
    let (scene, world) = (PathBuf::from("scenes/cornell"), Some("07".repeat(32)));
    let begun =
        Begun { igi_session: record::VERSION, scene, world, time: 0.0, seed: 7, method: method.clone(), camera };
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("session");
    let mut recorder = Recorder::create(&path).expect("it can be written");
    recorder.begin(&begun).expect("it can be written");
    let edit = What::Edit(vec![Change::Visible { object: 3, visible: false }, Change::Time(0.1)]);
    for what in [What::Look(camera), What::Shown { batches: 1, effort: 0.25, still: 0 }, What::Turn(method), edit] {
        recorder.line(0.25, what).expect("it can be written");
    }
    fs::read(&path).expect("it was just written")
}

/// The corners of one triangle.
fn corners() -> Vec<u8> {
    [0.0_f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0].iter().flat_map(|x| x.to_le_bytes()).collect()
}

/// The same as [`corners`].
const DATA_URI: &str = "data:application/octet-stream;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA";

/// One triangle with a texture, in words; its corners are elsewhere.
fn gltf(buffer: &str) -> String {
    serde_json::json!({
        "asset": { "version": "2.0" }, "scene": 0, "scenes": [{ "nodes": [0] }],
        "nodes": [{ "mesh": 0, "translation": [0, 1, 0] }],
        "meshes": [{ "primitives": [{ "attributes": { "POSITION": 0 }, "material": 0 }] }],
        "materials": [{ "pbrMetallicRoughness": { "baseColorTexture": { "index": 0 }, "roughnessFactor": 0.5 } }],
        "textures": [{ "source": 0 }], "images": [{ "uri": "a.bmp" }],
        "buffers": [{ "byteLength": 36, "uri": buffer }], "bufferViews": [{ "buffer": 0, "byteLength": 36 }],
        "accessors": [{ "bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3", "min": [0, 0, 0], "max": [1, 1, 0] }],
    })
    .to_string()
}

/// What lies beside such a glTF.
pub fn gltf_neighbours() -> [(&'static str, Vec<u8>); 2] {
    let mut bmp = std::io::Cursor::new(Vec::new());
    image::RgbImage::new(2, 2).write_to(&mut bmp, image::ImageFormat::Bmp).expect("a small image");
    [("a.bin", corners()), ("a.bmp", bmp.into_inner())]
}

/// One triangle.
fn glb() -> Vec<u8> {
    let json = serde_json::json!({
        "asset": { "version": "2.0" }, "scene": 0, "scenes": [{ "nodes": [0] }], "nodes": [{ "mesh": 0 }],
        "meshes": [{ "primitives": [{ "attributes": { "POSITION": 0 } }] }], "buffers": [{ "byteLength": 36 }],
        "bufferViews": [{ "buffer": 0, "byteLength": 36 }],
        "accessors": [{ "bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3", "min": [0, 0, 0], "max": [1, 1, 0] }],
    });
    let mut json = json.to_string().into_bytes();
    json.resize(json.len().next_multiple_of(4), b' ');
    let binary = corners();
    let chunk = |tag: &[u8; 4], bytes: &[u8]| [&(bytes.len() as u32).to_le_bytes(), &tag[..], bytes].concat();
    let chunks = [chunk(b"JSON", &json), chunk(b"BIN\0", &binary)].concat();
    [b"glTF", &2_u32.to_le_bytes()[..], &(12 + chunks.len() as u32).to_le_bytes(), &chunks].concat()
}

/// A checkpoint with light in it.
fn one_frame() -> Vec<u8> {
    let light = Light { keep: Keep::All };
    let world = light.build(Arc::new(decoders::scene()));
    let mut front = Igi::new(decoders::setup());
    front.set_limit(1);
    while !front.is_finished() {
        for Asked { ticket, question } in front.ask(64) {
            let mut answer = light.answer(&world, &question, &|| 0);
            pack::drop_unsound(&mut answer.body);
            let packed = pack::pack(&question, &answer.body, decoders::fields());
            let body = pack::unpack(&question, &packed, decoders::fields()).expect("it was just packed");
            front.absorb(frame::Answered { ticket, body, worker: 0, cost: &Cost::default() });
        }
    }
    front.checkpoint()
}
