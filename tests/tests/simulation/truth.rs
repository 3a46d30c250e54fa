//! What one process draws, and the answers that any number of stories share: light is computed once a question.

use std::collections::HashMap;
use std::path::Path;
use std::sync::{Arc, LazyLock, Mutex};

use frame::{Answered, FrontEnd, Igi, Picture, Plane, Setup};
use glam::Vec3;
use protocol::answer::{Cost, Fields};
use protocol::message::{ToWorker, encode};
use protocol::pack;
use protocol::question::{Asked, Quality, Question, WorldState};
use protocol::schedule::QuestionId;
use scenes::{Change, Material, Needs, Scene};
use worker::renderer::{Light, LightWorld, Renderer};

/// Frames of every picture.
pub const FRAMES: u32 = 2;

/// The edit that leads to a revision: walls of another grey.
pub fn edit(revision: u32) -> Change {
    let value = Material::diffuse(format!("revision {revision}"), Vec3::splat(0.1 * (1 + revision % 8) as f32));
    Change::Material { material: 0, value }
}

/// The scene of a story's chapter before edits: their names differ, and so their hashes.
pub fn scene(chapter: u32) -> Arc<Scene> {
    static BASE: LazyLock<Scene> = LazyLock::new(|| {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("the workspace").join("scenes/cornell");
        let mut scene = scenes::read::load(&folder).expect("the shipped scene is sound").scene;
        (scene.camera.width, scene.camera.height) = (40, 24);
        scene
    });
    let mut scene = BASE.clone();
    scene.name = format!("chapter {chapter}");
    Arc::new(scene)
}

/// What to draw of a world.
pub fn setup(scene: &Scene, world: WorldState) -> Setup {
    let quality =
        Quality { interleave: [2, 2], light_samples: 2, vpls: 4, photons: 0, replicates: 2, ..Quality::default() };
    let fields = Fields::of(&Needs::of(scene));
    Setup { world, camera: scene.camera, quality, fields, seed: 5, filter: frame::Filter::plane([2, 2]) }
}

/// Worlds built, answers given and pictures drawn so far.
type Memo<K, V> = LazyLock<Mutex<HashMap<K, Arc<V>>>>;

static WORLDS: Memo<WorldState, LightWorld> = LazyLock::new(Mutex::default);
static ANSWERS: Memo<Vec<u8>, [u8]> = LazyLock::new(Mutex::default);
static PICTURES: Memo<WorldState, Picture> = LazyLock::new(Mutex::default);

/// The compressed answer to a question about a world that a worker has built of `scene`.
pub fn answer(scene: &Arc<Scene>, question: &Question) -> Arc<[u8]> {
    let key = encode(&ToWorker::Ask { id: QuestionId(0), question: question.clone().into() }).expect("questions fit");
    if let Some(known) = ANSWERS.lock().unwrap().get(&key) {
        return Arc::clone(known);
    }
    let world = {
        let mut worlds = WORLDS.lock().unwrap();
        Arc::clone(worlds.entry(question.world).or_insert_with(|| Arc::new(Light::default().build(Arc::clone(scene)))))
    };
    let mut answer = Light::default().answer(&world, question, &|| 0);
    pack::drop_unsound(&mut answer.body);
    let packed = pack::pack(question, &answer.body, Light::default().fields(&world));
    let squeezed: Arc<[u8]> = pack::compress(&packed).into();
    ANSWERS.lock().unwrap().insert(key, Arc::clone(&squeezed));
    squeezed
}

/// Whether these packed bytes could be an answer to the question, right or wrong.
pub fn is_sound(scene: &Scene, question: &Question, packed: &[u8]) -> bool {
    let body = pack::unpack(question, packed, Fields::of(&Needs::of(scene)));
    body.is_ok_and(|body| body.check_in(scene).is_ok())
}

/// The picture of a world in one process, without a cluster.
pub fn picture(scene: &Arc<Scene>, state: WorldState) -> Arc<Picture> {
    if let Some(known) = PICTURES.lock().unwrap().get(&state) {
        return Arc::clone(known);
    }
    let setup = setup(scene, state);
    let mut front = Igi::new(setup.clone());
    front.set_limit(FRAMES);
    while !front.is_finished() {
        for Asked { ticket, question } in front.ask(8) {
            let packed = pack::decompress(&answer(scene, &question), LONGEST).expect("it was just compressed");
            let body = pack::unpack(&question, &packed, setup.fields).expect("it was just packed");
            front.absorb(Answered { ticket, body, worker: 0, cost: &Cost::default() });
        }
    }
    let picture = Arc::new(front.show(Plane::Raw));
    PICTURES.lock().unwrap().insert(state, Arc::clone(&picture));
    picture
}

/// Longer than any answer of these stories, bytes.
pub const LONGEST: usize = 1 << 20;
