//! Tests of `cluster`.

use crate::cluster::embedded::Renderer;
use glam::Vec3;
use protocol::answer::{Answer, Cost, Fields, Pixels};
use protocol::question::{Ask, Lit, Quality, Question, Rect, Ticket, Tile};
use scenes::{Camera, Light};

use super::*;

/// Light that can be foretold: a function of the question, and of the first light's colour.
#[derive(Clone, Copy)]
struct Fake {
    micros: u64,
}

impl Renderer for Fake {
    type World = Scene;

    fn build(&self, scene: Arc<Scene>) -> Scene {
        (*scene).clone()
    }

    fn edit(&self, world: &mut Scene, change: &Change) -> Result<(), Refused> {
        change.apply(world)
    }

    fn check(&self, _: &Scene, _: &Question) -> Result<(), protocol::question::Unfit> {
        Ok(())
    }

    fn fields(&self, _: &Scene) -> Fields {
        FIELDS
    }

    fn answer(&self, world: &Scene, question: &Question, _: &dyn Fn() -> u64) -> Answer {
        let Ask::Tile(tile) = &question.ask else { panic!("these tests ask about tiles") };
        assert!(tile.lit.seed != PANIC, "as the test wants");
        std::thread::sleep(Duration::from_micros(self.micros));
        let mut pixels = Pixels::black(tile.grid().len());
        for (pixel, [x, y]) in tile.grid().pixels().enumerate() {
            pixels.emitted[pixel] = Vec3::new(x as f32, y as f32, brightness(world));
        }
        let cost = Cost { eye_rays: tile.grid().len() as u64, ..Cost::default() };
        Answer { body: Body::Pixels(pixels), cost }
    }
}

/// A point light alone has nothing to show, so the tests say what there is.
const FIELDS: Fields = Fields { emitted: true, surface: true };
const PANIC: u64 = 13;

/// A master with one slow embedded thread, that others may join.
pub(crate) fn embedded_and_listening() -> Cluster {
    start_listening(None)
}

/// The same, with a token that expires.
pub(crate) fn listening_for(lifetime: Duration) -> Cluster {
    start_listening(Some(lifetime))
}

fn start_listening(token_lifetime: Option<Duration>) -> Cluster {
    let listen = Some("127.0.0.1:0".parse().unwrap());
    let options = ClusterOptions { embedded: Some(1), listen, token_lifetime, ..ClusterOptions::default() };
    Cluster::start_with(options, Fake { micros: 2000 }).unwrap()
}

fn brightness(scene: &Scene) -> f32 {
    match scene.lights[0] {
        Light::Point { intensity, .. } => intensity.x,
        _ => 0.0,
    }
}

pub(crate) fn scene() -> Arc<Scene> {
    let quad = scenes::Mesh {
        positions: vec![Vec3::ZERO, Vec3::X, Vec3::Y],
        triangles: vec![[0, 1, 2]],
        materials: vec![0],
        ..scenes::Mesh::default()
    };
    let mut white = scenes::Material::diffuse("white", Vec3::ONE);
    white.emission.value = Vec3::ONE;
    Arc::new(Scene {
        meshes: vec![quad.into()],
        objects: vec![scenes::Object::fixed("quad", 0)],
        materials: vec![white],
        lights: vec![Light::Point { position: Vec3::Z, intensity: Vec3::ONE }],
        ..Scene::default()
    })
}

pub(crate) fn questions(world: WorldState, frame: u32) -> Vec<Asked> {
    let quality = Quality::default();
    let tile = |i: u32| {
        let rect = Rect { x: i / 9 * 32, y: 0, width: 32, height: 32 };
        Tile { camera: Camera::default(), rect, lit: Lit { set: (i % 9) as u16, frame, seed: 1, quality } }
    };
    (0..90).map(|i| Asked::new(Ticket { batch: frame, slot: i }, Question { world, ask: Ask::Tile(tile(i)) })).collect()
}

fn embedded(threads: usize) -> Cluster {
    let options = ClusterOptions { embedded: Some(threads), ..ClusterOptions::default() };
    Cluster::start_with(options, Fake { micros: 200 }).unwrap()
}

pub(crate) const PATIENCE: Duration = Duration::from_secs(20);

/// The pixels of all answers, in the order of the questions.
fn answers(cluster: &mut Cluster, mut wanted: Vec<Asked>) -> Vec<Pixels> {
    let order = wanted.clone();
    cluster.ask(wanted.clone());
    let mut found = vec![Pixels::default(); order.len()];
    while !wanted.is_empty() {
        match cluster.next(PATIENCE).expect("workers answer in time") {
            Event::Answered { asked: answered, body, .. } => {
                let place = wanted.iter().position(|asked| *asked == answered).expect("an answer nobody asked for");
                wanted.remove(place);
                found[order.iter().position(|asked| *asked == answered).unwrap()] =
                    body.pixels().expect("tiles are answered by pixels");
            }
            Event::Unanswered { reason, .. } => panic!("{reason}"),
            _ => {}
        }
    }
    found
}

/// Over the network, beside this process: what it gave is found to be wrong, and all is asked again.
#[test]
fn who_computes_wrongly_is_found_and_all_ends_right() {
    let mut alone = embedded(1);
    let world = alone.publish(scene()).unwrap();
    let truth = answers(&mut alone, questions(world, 3));

    let listen = Some("127.0.0.1:0".parse().unwrap());
    let options = ClusterOptions { embedded: Some(1), listen, check_share: 1.0, ..ClusterOptions::default() };
    let mut cluster = Cluster::start_with(options, Fake { micros: 2000 }).unwrap();
    let world = cluster.publish(scene()).unwrap();
    let black = |question: &Question| {
        let pixels = Body::Pixels(Pixels::black(question.ask.len()));
        let squeezed = protocol::pack::compress(&protocol::pack::pack(question, &pixels, FIELDS)).into();
        Some(embedded::Canned { squeezed, takes: Duration::from_millis(1) })
    };
    let runtime = tokio::runtime::Builder::new_multi_thread().worker_threads(1).enable_all().build().unwrap();
    runtime.spawn(embedded::stand_in(cluster.address().unwrap(), cluster.token().unwrap(), 2, black));
    // Before anybody answers: it is no newcomer that could be examined.
    while cluster.status().ready < 2 {
        cluster.next(Duration::from_millis(20));
    }
    let wanted = questions(world, 3);
    let ask = |cluster: &mut Cluster| cluster.ask(wanted.clone());
    ask(&mut cluster);
    let mut found = vec![None; wanted.len()];
    let mut exposed = Vec::new();
    let mut is_checked = false;
    while !is_checked {
        match cluster.next(PATIENCE).expect("workers answer in time") {
            Event::Answered { asked, body, .. } => found[asked.ticket.slot as usize] = body.pixels(),
            Event::WorkerExposed { name, gave, reason, .. } => {
                assert!(reason.contains("worker 0 gives another answer"), "{reason}");
                exposed.push((name, gave));
                cluster.cancel_all();
                found.fill(None);
                ask(&mut cluster);
            }
            Event::Unanswered { reason, .. } => panic!("{reason}"),
            Event::Checked => is_checked = found.iter().all(Option::is_some),
            _ => {}
        }
        if found.iter().all(Option::is_some) {
            cluster.finish_checks();
        }
    }
    assert_eq!(exposed, [("canned".to_owned(), true)]);
    assert!(found.into_iter().map(Option::unwrap).eq(truth));
    let status = cluster.status();
    let liar = status.list.iter().find(|info| info.name == "canned").unwrap();
    assert_eq!((liar.state, liar.confirmed), (WorkerState::Quarantined, 0));
    assert!(liar.reason.as_ref().is_some_and(|reason| reason.starts_with("it computes wrongly")), "{liar:?}");
}

#[test]
fn any_number_of_threads_gives_the_same_bits() {
    let all: Vec<_> = (1..=4)
        .map(|threads| {
            let mut cluster = embedded(threads);
            let world = cluster.publish(scene()).unwrap();
            answers(&mut cluster, questions(world, 3))
        })
        .collect();
    assert!(all.windows(2).all(|pair| pair[0] == pair[1]));
    assert_eq!(all[0][0].emitted[0].z, 1.0);
}

#[test]
fn an_edit_reaches_all_answers_after_it_and_none_before() {
    let mut cluster = embedded(2);
    let world = cluster.publish(scene()).unwrap();
    cluster.ask(questions(world, 0));
    for step in 1..=20_u32 {
        let value = Light::Point { position: Vec3::Z, intensity: Vec3::splat(step as f32) };
        let world = cluster.change(vec![Change::Light { light: 0, value }]).unwrap();
        assert_eq!(world.revision, step);
        if step % 5 == 0 {
            let pixels = answers(&mut cluster, questions(world, step));
            assert!(pixels.iter().flat_map(|pixels| &pixels.emitted).all(|rgb| rgb.z == step as f32));
        } else {
            cluster.ask(questions(world, step));
        }
    }
}

#[test]
fn a_refused_edit_leaves_everything_as_it_was() {
    let mut cluster = embedded(1);
    let world = cluster.publish(scene()).unwrap();
    assert!(cluster.change(vec![Change::Visible { object: 7, visible: false }]).is_err());
    assert_eq!(answers(&mut cluster, questions(world, 0)).len(), 90);
}

#[test]
fn cancelled_questions_do_not_come_back() {
    let mut cluster = embedded(2);
    let world = cluster.publish(scene()).unwrap();
    cluster.ask(questions(world, 0));
    cluster.cancel_all();
    assert_eq!(cluster.room(), OPEN_MAX);
    // `answers` complains of any that do.
    answers(&mut cluster, questions(world, 1));
}

#[test]
fn a_question_that_panics_is_given_up_and_the_rest_answered() {
    let mut cluster = embedded(2);
    let world = cluster.publish(scene()).unwrap();
    let mut bad = questions(world, 0);
    let Ask::Tile(tile) = &mut Arc::make_mut(&mut bad[40].question).ask else { panic!("these tests ask about tiles") };
    tile.lit.seed = PANIC;
    cluster.ask(bad);
    let mut ends = [0, 0];
    while ends.iter().sum::<usize>() < 90 {
        match cluster.next(PATIENCE).expect("workers answer in time") {
            Event::Answered { .. } => ends[0] += 1,
            Event::Unanswered { reason, .. } => {
                assert!(reason.contains("as the test wants"), "{reason}");
                ends[1] += 1;
            }
            _ => {}
        }
    }
    assert_eq!(ends, [89, 1]);
}

#[test]
fn more_questions_than_there_is_room_for_come_back_unanswered() {
    let mut cluster = embedded(1);
    let world = cluster.publish(scene()).unwrap();
    cluster.ask(vec![questions(world, 0)[0].clone(); OPEN_MAX + 2]);
    assert_eq!(cluster.room(), 0);
    assert!(matches!(cluster.next(PATIENCE), Some(Event::Unanswered { .. })));
    assert!(matches!(cluster.next(PATIENCE), Some(Event::Unanswered { .. })));
}

#[test]
fn the_status_knows_the_worker() {
    let mut cluster = embedded(3);
    let world = cluster.publish(scene()).unwrap();
    answers(&mut cluster, questions(world, 0));
    std::thread::sleep(Duration::from_millis(30));
    cluster.cancel_all();
    std::thread::sleep(Duration::from_millis(50));
    let status = cluster.status();
    assert_eq!((status.workers, status.ready, status.counters.delivered), (1, 1, 90));
    assert_eq!((status.list[0].threads, status.list[0].answered), (3, 90));
    assert!(status.bytes_received > 0);
}

#[test]
fn nobody_is_no_cluster() {
    assert!(matches!(Cluster::start(ClusterOptions::default()), Err(ClusterError::Nobody)));
}

/// The niceness of a thread, as Linux tells it.
fn niceness(stat: &std::path::Path) -> Option<i32> {
    let text = std::fs::read_to_string(stat).ok()?;
    // The name in parentheses may contain anything; the niceness is field 19.
    text.rsplit_once(')')?.1.split_whitespace().nth(16)?.parse().ok()
}

#[test]
fn workers_of_this_process_give_way_where_people_wait_for_pictures() {
    let own = niceness("/proc/thread-self/stat".as_ref()).unwrap();
    if own >= 19 {
        return;
    }
    let options = ClusterOptions { embedded: Some(1), give_way: true, ..ClusterOptions::default() };
    let _cluster = Cluster::start_with(options, Fake { micros: 0 }).unwrap();
    let threads = std::fs::read_dir("/proc/self/task").unwrap();
    let nice: Vec<i32> = threads.filter_map(|task| niceness(&task.unwrap().path().join("stat"))).collect();
    assert!(nice.iter().any(|nice| *nice > own), "{nice:?}");
    assert_eq!(niceness("/proc/thread-self/stat".as_ref()), Some(own), "whoever starts them keeps its own");
}
