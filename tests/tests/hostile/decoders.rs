//! Everything that reads bytes of others, each with what it may take.

use std::path::Path;

use frame::{FrontEnd, Igi, Plane, Setup};
use protocol::answer::Fields;
use protocol::message::{Answered, Control, HEADER_LEN, Header, Hello, Refusal, ToMaster, ToWorker, Welcome, decode};
use protocol::pack;
use protocol::parts::{Blob, Manifest, join, split};
use protocol::question::{
    Address, Ask, Frames, Lit, Part, Point, Points, Quality, Question, Ray, Rays, Rect, Tile, WorldState,
};
use runtime::live::kept::{Files, KeptSession};
use scenes::{Camera, Keep, LookUp, Material, Mesh, Needs, Object, Pixels, Scene, SurfacePoint, Texture};
use sha2::{Digest, Sha256};

/// A reader of bytes.
pub struct Decoder {
    /// Its folder of the corpus.
    pub name: &'static str,
    /// Bytes that it may take at a time, whatever it is given.
    pub memory: usize,
    /// Reads; whether it found the bytes sound.
    pub read: fn(&[u8], &Path) -> bool,
}

const MIB: usize = 1 << 20;

/// All of them, but those that read a line or a word (tokens, DNS-SD, what viewers say), which are given random text where
/// they are. Their limits are those of small inputs: what a header claims must not count before it is there. Images
/// may be large on a few bytes (`scenes/src/read/limits.rs`: 16384² texels, and a copy while it is converted).
pub const DECODERS: [Decoder; 20] = [
    Decoder { name: "hello", memory: MIB / 16, read: |bytes, _| words::<Hello>(bytes) },
    Decoder { name: "welcome", memory: MIB / 16, read: |bytes, _| words::<Welcome>(bytes) },
    Decoder { name: "refusal", memory: MIB / 16, read: |bytes, _| words::<Refusal>(bytes) },
    Decoder { name: "to_worker", memory: 2 * MIB, read: |bytes, _| words::<ToWorker>(bytes) },
    Decoder { name: "to_master", memory: 2 * MIB, read: |bytes, _| words::<ToMaster>(bytes) },
    Decoder { name: "answer", memory: 4 * MIB, read: |bytes, _| answer(bytes, &question()) },
    Decoder { name: "answer_frames", memory: 4 * MIB, read: |bytes, _| answer(bytes, &frames()) },
    Decoder { name: "answer_points", memory: 4 * MIB, read: |bytes, _| answer_about_points(bytes) },
    Decoder { name: "part", memory: 4 * MIB, read: |bytes, _| part(bytes) },
    Decoder { name: "json", memory: 16 * MIB, read: |bytes, folder| file(bytes, folder, "scene.json", "") },
    Decoder { name: "luminaire", memory: 48 * MIB, read: luminaire },
    Decoder { name: "obj", memory: 16 * MIB, read: |bytes, folder| file(bytes, folder, "a.obj", "a.obj") },
    Decoder { name: "mtl", memory: 16 * MIB, read: |bytes, folder| file(bytes, folder, "a.mtl", "a.obj") },
    Decoder { name: "gltf", memory: 16 * MIB, read: |bytes, folder| file(bytes, folder, "a.glb", "a.glb") },
    Decoder { name: "gltf_json", memory: 16 * MIB, read: gltf_json },
    Decoder { name: "image", memory: 3 << 30, read: image },
    Decoder { name: "reference", memory: 4 * MIB, read: reference },
    Decoder { name: "checkpoint", memory: MIB, read: |bytes, _| checkpoint(bytes) },
    Decoder { name: "recording", memory: 2 * MIB, read: recording },
    Decoder { name: "session", memory: 2 * MIB, read: session },
];

fn words<T: Control>(bytes: &[u8]) -> bool {
    let Some((head, body)) = bytes.split_first_chunk::<HEADER_LEN>() else { return false };
    Header::parse(*head).is_ok_and(|header| decode::<T>(header.kind, body).is_ok())
}

/// What answers are about.
pub fn question() -> Question {
    let rect = Rect { x: 0, y: 0, width: 16, height: 16 };
    let tile =
        Tile { camera: Camera::default(), rect, lit: Lit { set: 0, frame: 0, seed: 0, quality: Quality::default() } };
    Question { world: WorldState::default(), ask: Ask::Tile(tile) }
}

/// The same in several frames.
pub fn frames() -> Question {
    let Question { world, ask } = question();
    let tile = ask.tile().expect("it is about a tile").clone();
    Question { world, ask: Ask::Frames(Frames { tile, count: 9 }) }
}

pub fn fields() -> Fields {
    Fields::of(&Needs::kept(&scene(), Keep::All))
}

/// An answer as it comes: framed, squeezed, packed.
fn answer(bytes: &[u8], question: &Question) -> bool {
    let Some((head, body)) = bytes.split_first_chunk::<HEADER_LEN>() else { return false };
    let Ok(header) = Header::parse(*head) else { return false };
    let Ok(answered) = Answered::decode(header.kind, body) else { return false };
    let packed = pack::decompress(&answered.squeezed, pack::packed_len_max(&question.ask));
    packed.is_ok_and(|packed| pack::unpack(question, &packed, fields()).is_ok())
}

/// Each form that an answer about points has.
pub fn parts_of_light() -> [Part; 4] {
    let each = Part::EachLight { first: 0, count: 8 };
    [Part::All, Part::DirectOf(vec![0]), each, Part::Towards(glam::Vec3::Z)]
}

fn lit() -> Lit {
    Lit { set: 0, frame: 0, seed: 0, quality: Quality::default() }
}

/// Of one triangle.
fn point(number: u32) -> Point {
    let at = SurfacePoint { uv: [0.25, 0.5], ..SurfacePoint::default() };
    Point { at, address: Address { pixel: [320, 240], number } }
}

pub fn points(part: Part) -> Question {
    let at = (0..9).map(point).collect();
    let points = Points { view: Some(Camera::default()), at, part, lit: lit() };
    Question { world: WorldState::default(), ask: Ask::Points(points) }
}

/// With an aim and without.
pub fn rays() -> Question {
    let ray = |number| Ray { address: point(number).address, aim: (number % 2 == 0).then_some(point(number).at) };
    let through = (0..9).map(ray).collect();
    let rays = Rays { camera: Camera::default(), view: Some(Camera::default()), through, lit: lit() };
    Question { world: WorldState::default(), ask: Ask::Rays(rays) }
}

/// The same about rays and points, to whichever question it fits; what it names is looked for in the scene.
fn answer_about_points(bytes: &[u8]) -> bool {
    let Some((head, body)) = bytes.split_first_chunk::<HEADER_LEN>() else { return false };
    let Ok(header) = Header::parse(*head) else { return false };
    let Ok(answered) = Answered::decode(header.kind, body) else { return false };
    let questions = parts_of_light().map(points).into_iter().chain([rays()]);
    questions
        .filter(|question| {
            let packed = pack::decompress(&answered.squeezed, pack::packed_len_max(&question.ask));
            let body = packed.and_then(|packed| pack::unpack(question, &packed, fields()));
            body.is_ok_and(|body| body.check_in(&scene()).is_ok())
        })
        .count()
        > 0
}

/// A scene of one of everything.
pub fn scene() -> Scene {
    let mesh = Mesh {
        positions: vec![glam::Vec3::ZERO, glam::Vec3::X, glam::Vec3::Y],
        triangles: vec![[0, 1, 2]],
        materials: vec![0],
        ..Mesh::default()
    };
    let pixels = Pixels::Srgb8(vec![[1, 2, 3, 255]; 2]);
    let texture = Texture { name: "dots".into(), width: 2, height: 1, pixels, look_up: LookUp::REPEAT };
    let object = Object::fixed("one", 0);
    Scene {
        name: "corpus".into(),
        meshes: vec![mesh.into()],
        materials: vec![Material::diffuse("grey", glam::Vec3::splat(0.5))],
        objects: vec![object],
        textures: vec![texture.into()],
        ..Scene::default()
    }
}

pub fn parts() -> (Manifest, Vec<Blob>) {
    split(&scene()).expect("a small scene can be sent")
}

/// A part of a scene, in the place of the one that has its tag.
fn part(bytes: &[u8]) -> bool {
    let (manifest, parts) = parts();
    let tag = |bytes: &[u8]| bytes.first_chunk::<4>().copied();
    if tag(bytes) == tag(&manifest.blob().bytes) {
        return Manifest::parse(bytes).is_ok();
    }
    let find = |hash: &[u8; 32]| {
        let part = parts.iter().find(|part| part.hash == *hash)?;
        Some(if tag(&part.bytes) == tag(bytes) { bytes.to_vec() } else { part.bytes.clone() })
    };
    join(&manifest, find).is_ok()
}

/// A file of a scene, beside others that are sound.
fn file(bytes: &[u8], folder: &Path, name: &str, load: &str) -> bool {
    for (other, content) in [("a.obj", super::corpus::OBJ), ("a.mtl", super::corpus::MTL)] {
        std::fs::write(folder.join(other), content).expect("a temporary file");
    }
    std::fs::write(folder.join(name), bytes).expect("a temporary file");
    let loaded = scenes::read::load(&folder.join(load));
    std::fs::remove_file(folder.join(name)).expect("it was just written");
    loaded.is_ok_and(|loaded| {
        loaded.scene.check().expect("what is read is sound");
        true
    })
}

/// A file of photometric data: EULUMDAT, unless it has the line that IES LM-63 has.
fn luminaire(bytes: &[u8], folder: &Path) -> bool {
    let name = if bytes.windows(5).any(|word| word == b"TILT=") { "lamp.ies" } else { "lamp.ldt" };
    std::fs::write(folder.join(name), bytes).expect("a temporary file");
    let lamp = format!(r#"{{ "type": "luminaire", "profile": "{name}", "position": [0, 2, 0] }}"#);
    let json = format!(r#"{{ "obj": "a.obj", "lights": [{lamp}] }}"#);
    let read = file(json.as_bytes(), folder, "scene.json", "");
    std::fs::remove_file(folder.join(name)).expect("it was just written");
    read
}

/// A texture of any format, by what its first bytes say.
fn image(bytes: &[u8], folder: &Path) -> bool {
    let name = match bytes {
        [0x89, ..] => "a.png",
        [0xff, ..] => "a.jpg",
        [b'#', ..] => "a.hdr",
        [b'B', ..] => "a.bmp",
        [0x76, ..] => "a.exr",
        _ => "a.tga",
    };
    std::fs::write(folder.join(name), bytes).expect("a temporary file");
    let mtl = format!("newmtl m\nmap_Kd {name}\n");
    let read = file(mtl.as_bytes(), folder, "a.mtl", "a.obj");
    let _ = runtime::files::read_picture(&folder.join(name));
    std::fs::remove_file(folder.join(name)).expect("it was just written");
    read
}

/// A glTF in words, with a buffer and an image beside it.
fn gltf_json(bytes: &[u8], folder: &Path) -> bool {
    for (name, content) in super::corpus::gltf_neighbours() {
        std::fs::write(folder.join(name), content).expect("a temporary file");
    }
    file(bytes, folder, "a.gltf", "a.gltf")
}

/// A reference to be gone on with.
fn reference(bytes: &[u8], folder: &Path) -> bool {
    let path = folder.join("a.exr");
    std::fs::write(&path, bytes).expect("a temporary file");
    let _ = runtime::files::read_picture(&path);
    let read = runtime::files::read_record(&path).is_ok();
    std::fs::remove_file(&path).expect("it was just written");
    read
}

fn recording(bytes: &[u8], folder: &Path) -> bool {
    let path = folder.join("a.session");
    std::fs::write(&path, bytes).expect("a temporary file");
    runtime::live::record::read(&path).is_ok_and(|recording| {
        let _ = recording.into_lines(&scene());
        true
    })
}

/// What an earlier master has kept, and whether it fits a scene.
fn session(bytes: &[u8], folder: &Path) -> bool {
    let path = folder.join("session.json");
    std::fs::write(&path, bytes).expect("a temporary file");
    KeptSession::read(&path).is_ok_and(|session| {
        let (scene, (manifest, _)) = (scene(), parts());
        let files = Files { scene: &scene, manifest: &manifest };
        let (changes, _) = session.fitting(files);
        let mut edited = scene.clone();
        for change in changes {
            // Alone each of them fits; numbers near the limits may not, together.
            let _ = change.apply(&mut edited);
        }
        edited.check().expect("what is taken up is sound");
        let _ = session.fitting_history(files);
        true
    })
}

pub fn setup() -> Setup {
    let camera = Camera { width: 32, height: 16, ..Camera::default() };
    let filter = frame::Filter::plane([1, 1]);
    Setup { world: WorldState::default(), camera, quality: Quality::default(), fields: fields(), seed: 1, filter }
}

/// As somebody would damage it who knows the checksum.
fn checkpoint(bytes: &[u8]) -> bool {
    let content = &bytes[..bytes.len().saturating_sub(32)];
    let signed = [content, &Sha256::digest(content)[..]].concat();
    let _ = Igi::resume(setup(), bytes);
    Igi::resume(setup(), &signed).is_ok_and(|mut igi| {
        igi.ask(4);
        igi.show(Plane::Raw);
        true
    })
}
