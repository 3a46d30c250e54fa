//! Relays between master and workers, as processes: whoever dies or lies, the picture has the same bits.
//!
//! The master's side runs in the test; relays are `igi-master relay`, workers the program `igi-worker`, or stand-ins that lie.

use std::net::SocketAddr;
use std::sync::{Arc, OnceLock};
use std::time::Duration;

use protocol::answer::{Body, Fields, Pixels};
use protocol::pack::{compress, pack};
use protocol::question::Question;
use runtime::cluster::{Cluster, ClusterOptions, Event, Status};
use scenes::{Needs, Scene};
use tests::clusters::{draw_as, scene, setup, wait_for};
use tests::programs::{Process, free_address};
use worker::network::Options;
use worker::network::stand_in::{Canned, stand_in};

fn cluster() -> Cluster {
    let listen = Some("127.0.0.1:0".parse().expect("an address"));
    Cluster::start(ClusterOptions { listen, ..ClusterOptions::default() }).expect("a cluster starts")
}

fn token(cluster: &Cluster) -> String {
    cluster.token().expect("it listens").to_string()
}

fn relay(token: &str, above: SocketAddr, here: SocketAddr, more: &[&str]) -> Process {
    let (above, here) = (above.to_string(), here.to_string());
    let arguments = ["relay", "--master", &above, "--listen", &here, "--quiet"];
    Process::master_with(&[("IGI_TOKEN", token)], &[&arguments[..], more].concat())
}

/// Workers need only their half of the token.
fn worker(cluster: &Cluster, above: SocketAddr, name: &str) -> Process {
    let half = cluster.token().expect("it listens").for_workers().to_string();
    Process::worker_with(&half, &["--master", &above.to_string(), "--threads", "1", "--name", name])
}

/// A stand-in that gives an answer to every question; it lives as long as the runtime.
fn liar(
    runtime: &tokio::runtime::Runtime,
    cluster: &Cluster,
    above: SocketAddr,
    lie: impl Fn(&Question) -> Vec<u8> + Send + Sync + 'static,
) {
    let token = cluster.token().expect("it listens").for_workers();
    let (master, name) = (Some(above.to_string()), "liar".to_owned());
    let options = Options { master, token, token_file: None, threads: 1, cache: None, name, once: true, metrics: None };
    runtime.spawn(async move {
        let answer =
            |question: &Question| Some(Canned { squeezed: lie(question).into(), takes: Duration::from_millis(1) });
        // Until the relay is there.
        while stand_in(&options, answer).await.is_err() {
            tokio::time::sleep(Duration::from_millis(100)).await;
        }
    });
}

fn runtime() -> tokio::runtime::Runtime {
    tokio::runtime::Builder::new_multi_thread().worker_threads(1).enable_all().build().expect("a runtime starts")
}

const SCENE: &str = "cornell_spheres";

fn draw(cluster: &mut Cluster, scene: &Arc<Scene>, frames: u32, meanwhile: impl FnMut(u64, &Cluster)) -> [u8; 32] {
    let world = cluster.state().unwrap_or_else(|| cluster.publish(Arc::clone(scene)).expect("it can be sent"));
    draw_as(cluster, setup(scene, world), frames, meanwhile)
}

/// What one embedded thread draws in so many frames.
fn truth(frames: u32) -> [u8; 32] {
    let mut alone = Cluster::start(ClusterOptions { embedded: Some(1), ..ClusterOptions::default() }).unwrap();
    draw(&mut alone, &scene(SCENE), frames, |_, _| {})
}

/// What two frames are.
fn two_frames() -> [u8; 32] {
    static TRUTH: OnceLock<[u8; 32]> = OnceLock::new();
    *TRUTH.get_or_init(|| truth(2))
}

/// Threads that can be asked, workers that have them, and relays on the longest way to one.
fn behind(status: &Status) -> (usize, u32, u8) {
    let behind = || status.list.iter().filter_map(|info| info.behind);
    let threads = status.list.iter().filter(|info| info.behind.is_some()).map(|info| info.threads).sum();
    (threads, behind().map(|behind| behind.workers).sum(), behind().map(|behind| behind.depth).max().unwrap_or(0))
}

#[test]
fn one_of_each_killed_changes_no_bit() {
    let scene = scene(SCENE);
    let mut cluster = cluster();
    let (token, master) = (token(&cluster), cluster.address().expect("it listens"));
    let [upper, lower] = [free_address(), free_address()];
    let mut first = Some(relay(&token, master, upper, &[]));
    let mut second = Some(relay(&token, upper, lower, &[]));
    let mut victim = Some(worker(&cluster, upper, "victim"));
    let _beside = worker(&cluster, upper, "beside the lower relay");
    let _below = worker(&cluster, lower, "below both");
    cluster.publish(Arc::clone(&scene)).expect("it can be sent");
    wait_for(&mut cluster, "three workers behind two relays", |status| {
        status.ready == 1 && behind(status) == (3, 3, 2)
    });

    const FRAMES: u32 = 6;
    let hash = draw(&mut cluster, &scene, FRAMES, |answers, _| match answers {
        // Drop is kill -9.
        20 => drop(victim.take()),
        80 => drop(second.take()),
        // Who was below it comes back by itself.
        90 => second = Some(relay(&token, upper, lower, &[])),
        // Nobody is left but those below it.
        150 => {
            drop(first.take());
            first = Some(relay(&token, master, upper, &[]));
        }
        _ => {}
    });
    assert!(first.is_some(), "all of it happened");
    assert_eq!(hash, truth(FRAMES));
    wait_for(&mut cluster, "two workers again", |status| behind(status) == (2, 2, 2));
    assert_eq!(draw(&mut cluster, &scene, 2, |_, _| {}), two_frames());
    let status = cluster.status();
    assert_eq!((status.counters.given_up, status.counters.quarantines), (0, 0), "{status:?}");
}

#[test]
fn edits_go_through_relays() {
    let mut room = (*scene(SCENE)).clone();
    let mut cluster = cluster();
    let (token, master, here) = (token(&cluster), cluster.address().expect("it listens"), free_address());
    let _relay = relay(&token, master, here, &[]);
    let _worker = worker(&cluster, here, "below");
    let before = draw(&mut cluster, &Arc::new(room.clone()), 2, |_, _| {});
    assert_eq!(before, two_frames());

    let hide = scenes::Change::Visible { object: 0, visible: false };
    let world = cluster.change(vec![hide.clone()]).expect("there is an object");
    let edited = draw_as(&mut cluster, setup(&room, world), 2, |_, _| {});
    hide.apply(&mut room).unwrap();
    let mut afresh = Cluster::start(ClusterOptions { embedded: Some(1), ..ClusterOptions::default() }).unwrap();
    assert_eq!(draw(&mut afresh, &Arc::new(room), 2, |_, _| {}), edited);
    assert_ne!(edited, before);
}

#[test]
fn a_worker_behind_a_relay_that_sends_nonsense_is_the_relays_business() {
    let (mut cluster, runtime) = (cluster(), runtime());
    let (token, master, here) = (token(&cluster), cluster.address().expect("it listens"), free_address());
    let _relay = relay(&token, master, here, &[]);
    let _honest = worker(&cluster, here, "honest");
    liar(&runtime, &cluster, here, |_| compress(&[0xff; 100]));
    cluster.publish(scene(SCENE)).expect("it can be sent");
    wait_for(&mut cluster, "both", |status| status.ready == 1 && behind(status).1 == 2);
    assert_eq!(draw(&mut cluster, &scene(SCENE), 2, |_, _| {}), two_frames());
    let status = cluster.status();
    assert_eq!((status.counters.quarantines, status.counters.given_up), (0, 0), "{status:?}");
}

/// An answer that makes sense, and is wrong.
fn black(scene: &Scene) -> impl Fn(&Question) -> Vec<u8> + Send + Sync + use<> {
    let fields = Fields::of(&Needs::of(scene));
    move |question| compress(&pack(question, &Body::Pixels(Pixels::black(question.ask.len())), fields))
}

#[test]
fn a_worker_behind_a_relay_that_computes_wrongly_is_found_there_and_all_ends_right() {
    let (mut cluster, runtime) = (cluster(), runtime());
    let (token, master, here) = (token(&cluster), cluster.address().expect("it listens"), free_address());
    let _relay = relay(&token, master, here, &["--check-share", "1"]);
    // It is no newcomer that could be examined: nobody has answered anything yet.
    liar(&runtime, &cluster, here, black(&scene(SCENE)));
    let _honest = ["one", "another"].map(|name| worker(&cluster, here, name));
    cluster.publish(scene(SCENE)).expect("it can be sent");
    wait_for(&mut cluster, "all three", |status| status.ready == 1 && behind(status).1 == 3);
    // Checks may end after the picture.
    let mut exposed = None;
    for _ in 0..20 {
        draw(&mut cluster, &scene(SCENE), 2, |_, _| {});
        if cluster.status().counters.exposed > 0 {
            exposed = Some(cluster.status().counters.exposed);
            break;
        }
    }
    assert_eq!(exposed, Some(1), "{:?}", cluster.status());
    assert_eq!(draw(&mut cluster, &scene(SCENE), 2, |_, _| {}), two_frames());
    wait_for(&mut cluster, "the relay again, without the liar", |status| behind(status).1 == 2);
}

/// The master's own checks go through: to it, the relay is one worker.
#[test]
fn the_master_checks_what_comes_through_relays() {
    let listen = Some("127.0.0.1:0".parse().expect("an address"));
    let options = ClusterOptions { embedded: Some(1), listen, check_share: 1.0, ..ClusterOptions::default() };
    let mut cluster = Cluster::start(options).expect("a cluster starts");
    let runtime = runtime();
    let (token, master, here) = (token(&cluster), cluster.address().expect("it listens"), free_address());
    let _relay = relay(&token, master, here, &["--check-share", "0", "--name", "the relay"]);
    liar(&runtime, &cluster, here, black(&scene(SCENE)));
    cluster.publish(scene(SCENE)).expect("it can be sent");
    wait_for(&mut cluster, "both", |status| status.ready == 2 && behind(status).1 == 1);
    while cluster.status().counters.exposed == 0 {
        draw(&mut cluster, &scene(SCENE), 2, |_, _| {});
        cluster.finish_checks();
        while !matches!(cluster.next(Duration::from_secs(10)), Some(Event::Checked) | None) {}
    }
    let status = cluster.status();
    let exposed = status.list.iter().find(|info| info.name == "the relay").expect("it is there");
    assert!(exposed.reason.as_ref().is_some_and(|reason| reason.contains("computes wrongly")), "{status:?}");
    assert_eq!(draw(&mut cluster, &scene(SCENE), 2, |_, _| {}), two_frames());
}

#[test]
fn a_relay_wants_the_whole_token_and_ends_with_its_master_if_told_so() {
    let cluster = cluster();
    let (whole, master) = (token(&cluster), cluster.address().expect("it listens"));
    let half = cluster.token().expect("it listens").for_workers().to_string();
    let (code, said) = relay(&half, master, free_address(), &[]).end();
    assert_eq!(code, Some(1), "{said}");
    assert!(said.contains("workers' half of a token"), "{said}");
    let mut cluster = cluster;
    let once = relay(&whole, master, free_address(), &["--once"]);
    wait_for(&mut cluster, "the relay", |status| status.workers == 1);
    drop(cluster);
    let (code, said) = once.end();
    assert_eq!(code, Some(0), "{said}");
}
