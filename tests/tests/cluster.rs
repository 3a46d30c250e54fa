//! Real worker processes, real QUIC, real faults: whoever answers, the picture has the same bits.
//!
//! The master's side runs in the test; workers are the program `igi-worker`.

use std::sync::{Arc, OnceLock};

use frame::{Answered, FrontEnd, Igi, Plane};
use protocol::identity::Token;
use protocol::question::WorldState;
use runtime::cluster::{Cluster, ClusterOptions, Event};
use scenes::Scene;
use tests::clusters::{draw_as, scene, setup, wait_for};
use tests::programs::{PATIENCE, Process, free_address};

/// A worker that has the cluster's token.
fn join(cluster: &Cluster, more: &[&str]) -> Process {
    let master = cluster.address().expect("the cluster listens").to_string();
    Process::worker_with(&token(cluster), &[&["--master", &master], more].concat())
}

fn token(cluster: &Cluster) -> String {
    cluster.token().expect("the cluster listens").to_string()
}

fn cluster(embedded: Option<usize>) -> Cluster {
    let listen = Some("127.0.0.1:0".parse().expect("an address"));
    Cluster::start(ClusterOptions { embedded, listen, ..ClusterOptions::default() }).expect("a cluster starts")
}

const FRAMES: u32 = 2;

/// Draws some frames, doing something after every answer; the hash of the raw picture.
fn draw(cluster: &mut Cluster, scene: &Arc<Scene>, meanwhile: impl FnMut(u64, &Cluster)) -> [u8; 32] {
    let world = cluster.publish(Arc::clone(scene)).expect("the scene can be sent");
    draw_as(cluster, setup(scene, world), FRAMES, meanwhile)
}

/// What one embedded thread draws.
fn truth() -> [u8; 32] {
    static TRUTH: OnceLock<[u8; 32]> = OnceLock::new();
    *TRUTH.get_or_init(|| {
        let mut alone = Cluster::start(ClusterOptions { embedded: Some(1), ..ClusterOptions::default() }).unwrap();
        draw(&mut alone, &scene(SCENE), |_, _| {})
    })
}

const SCENE: &str = "cornell_spheres";

#[test]
fn any_number_of_threads_gives_the_same_bits() {
    for threads in 2..=4 {
        let options = ClusterOptions { embedded: Some(threads), ..ClusterOptions::default() };
        let mut cluster = Cluster::start(options).unwrap();
        assert_eq!(draw(&mut cluster, &scene(SCENE), |_, _| {}), truth(), "{threads} threads");
    }
}

#[test]
fn three_processes_give_the_same_bits() {
    let mut cluster = cluster(None);
    let _workers = ["1", "2", "1"].map(|threads| join(&cluster, &["--threads", threads]));
    wait_for(&mut cluster, "three workers", |status| status.workers == 3);
    assert_eq!(draw(&mut cluster, &scene(SCENE), |_, _| {}), truth());
    let status = cluster.status();
    assert!(status.list.iter().filter(|info| info.answered > 0).count() >= 2, "{status:?}");
}

/// Frames that are asked for one by one, several at a time, and one by one again.
#[test]
fn a_picture_at_rest_has_the_same_bits_whoever_draws_it() {
    let scene = scene(SCENE);
    let long = |cluster: &mut Cluster| {
        let world = cluster.publish(Arc::clone(&scene)).expect("the scene can be sent");
        let mut setup = setup(&scene, world);
        (setup.camera.width, setup.camera.height) = (40, 30);
        setup.quality.interleave = [2, 2];
        let mut answers = 0;
        let picture = draw_as(cluster, setup, 32 + 8 + 1, |so_many, _| answers = so_many);
        (picture, answers)
    };
    let mut alone = Cluster::start(ClusterOptions { embedded: Some(1), ..ClusterOptions::default() }).unwrap();
    let truth = long(&mut alone);
    // All batches but the first have a question of the cross-check.
    let [batches, checks] = [32 + 2 + 1, 32 + 2];
    assert!((truth.1 - checks).is_multiple_of(batches), "eight frames make two batches: {} answers", truth.1);
    let mut cluster = cluster(Some(2));
    let _workers = ["1", "2"].map(|threads| join(&cluster, &["--threads", threads]));
    wait_for(&mut cluster, "three workers", |status| status.workers == 3);
    assert_eq!(long(&mut cluster), truth);
}

#[test]
fn processes_and_embedded_threads_together_give_the_same_bits() {
    let mut cluster = cluster(Some(1));
    let _worker = join(&cluster, &["--threads", "1"]);
    wait_for(&mut cluster, "two workers", |status| status.workers == 2);
    assert_eq!(draw(&mut cluster, &scene(SCENE), |_, _| {}), truth());
}

#[test]
fn one_killed_and_one_joining_mid_frame_change_no_bit() {
    let mut cluster = cluster(None);
    let mut victim = Some(join(&cluster, &["--threads", "2", "--name", "victim"]));
    let _survivor = join(&cluster, &["--threads", "1", "--name", "survivor"]);
    wait_for(&mut cluster, "two workers", |status| status.workers == 2);
    let mut latecomer = None;
    let hash = draw(&mut cluster, &scene(SCENE), |answers, cluster| {
        if answers == 10 {
            // Drop is kill -9.
            drop(victim.take());
        }
        if answers == 20 {
            latecomer = Some(join(cluster, &["--threads", "2", "--name", "latecomer"]));
        }
    });
    assert_eq!(hash, truth());
}

#[test]
fn a_frozen_worker_costs_time_and_no_bit() {
    let mut cluster = cluster(Some(1));
    let frozen = join(&cluster, &["--threads", "1"]);
    wait_for(&mut cluster, "two workers", |status| status.workers == 2);
    let hash = draw(&mut cluster, &scene(SCENE), |answers, _| {
        if answers == 10 {
            frozen.signal("-STOP");
        }
    });
    assert_eq!(hash, truth());
}

#[test]
fn a_worker_that_is_told_to_stop_finishes_what_it_has_in_hand() {
    let mut cluster = cluster(Some(1));
    let mut worker = Some(join(&cluster, &["--threads", "1"]));
    wait_for(&mut cluster, "two workers", |status| status.workers == 2);
    let mut stopped = None;
    let hash = draw(&mut cluster, &scene(SCENE), |answers, _| {
        if answers == 10 {
            worker.as_ref().unwrap().signal("-TERM");
            stopped = worker.take();
        }
    });
    assert_eq!(hash, truth());
    let (code, said) = stopped.unwrap().end();
    assert_eq!(code, Some(0), "{said}");
    assert_eq!(cluster.status().counters.leases_expired, 0);
}

#[test]
fn an_edit_reaches_remote_workers() {
    let mut room = (*scene(SCENE)).clone();
    let mut cluster = cluster(None);
    let _worker = join(&cluster, &["--threads", "1"]);
    let before = draw(&mut cluster, &Arc::new(room.clone()), |_, _| {});

    let hide = scenes::Change::Visible { object: 0, visible: false };
    let world = cluster.change(vec![hide.clone()]).expect("there is an object");
    assert_eq!(world.revision, 1);
    let edited = draw_again(&mut cluster, &room, world);
    assert_ne!(edited, before);

    // The same scene from the ground up.
    hide.apply(&mut room).unwrap();
    let mut afresh = Cluster::start(ClusterOptions { embedded: Some(1), ..ClusterOptions::default() }).unwrap();
    assert_eq!(draw(&mut afresh, &Arc::new(room), |_, _| {}), edited);
}

/// Draws the cluster's present world.
fn draw_again(cluster: &mut Cluster, scene: &Scene, world: WorldState) -> [u8; 32] {
    let mut front = Igi::new(setup(scene, world));
    front.set_limit(FRAMES);
    while !front.is_finished() {
        cluster.ask(front.ask(cluster.room().min(1024)));
        if let Some(Event::Answered { asked, body, cost, worker, .. }) = cluster.next(PATIENCE) {
            front.absorb(Answered { ticket: asked.ticket, body, worker, cost: &cost });
        }
    }
    front.show(Plane::Raw).sha256()
}

#[test]
fn a_cache_saves_the_second_download() {
    let cache = tempfile::tempdir().unwrap();
    let folder = cache.path().to_str().unwrap();
    let scene = scene(SCENE);
    let parts: usize = protocol::parts::split(&scene).unwrap().1.iter().map(|blob| blob.bytes.len()).sum();
    let mut cluster = cluster(None);
    cluster.publish(scene).unwrap();

    let sent_to = |cluster: &mut Cluster| {
        let before = cluster.status().bytes_sent;
        let worker = join(cluster, &["--threads", "1", "--cache", folder]);
        wait_for(cluster, "the worker", |status| status.ready == 1);
        worker.signal("-TERM");
        assert_eq!(worker.end().0, Some(0));
        wait_for(cluster, "its end", |status| status.workers == 0);
        (cluster.status().bytes_sent - before) as usize
    };
    let (first, second) = (sent_to(&mut cluster), sent_to(&mut cluster));
    assert!(first > parts, "{first} bytes sent of a scene of {parts}");
    assert!(second < 20_000, "{second} bytes sent to a worker that had everything");
}

#[test]
fn wrong_tokens_are_refused_in_words() {
    let mut cluster = cluster(Some(1));
    let (address, token) = (cluster.address().unwrap().to_string(), cluster.token().unwrap());
    let with = |token: &str| Process::worker_with(token, &["--master", &address]);

    // The right master, and not its secret: the master refuses.
    let guessed = Token { secret: [0; 16], ..token.for_workers() }.to_string();
    let (code, said) = with(&guessed).end();
    assert_eq!(code, Some(3), "{said}");
    assert!(said.contains("wrong token"), "{said}");
    wait_for(&mut cluster, "the refusal", |status| status.refused == 1);

    // A token of another master: the worker refuses.
    let other = Token { fingerprint: [0; 16], ..token }.to_string();
    let (code, said) = with(&other).end();
    assert_eq!(code, Some(3), "{said}");
    assert!(said.contains("not the master that this token is for"), "{said}");

    let (code, said) = with("igi1-hello").end();
    assert_eq!(code, Some(2), "{said}");

    // The picture does not care.
    assert_eq!(draw(&mut cluster, &scene(SCENE), |_, _| {}), truth());
}

#[test]
fn garbage_on_the_port_disturbs_nobody() {
    let mut cluster = cluster(Some(1));
    let address = cluster.address().unwrap();
    let socket = std::net::UdpSocket::bind("127.0.0.1:0").unwrap();
    let mut noise = 1_u64;
    let hash = draw(&mut cluster, &scene(SCENE), |_, _| {
        for _ in 0..20 {
            noise = noise.wrapping_mul(0x5851_f42d_4c95_7f2d).wrapping_add(1);
            let length = (noise >> 32) as usize % 1400;
            let bytes: Vec<u8> = (0..length).map(|i| (noise >> (i % 57)) as u8).collect();
            socket.send_to(&bytes, address).unwrap();
        }
    });
    assert_eq!(hash, truth());
}

#[test]
fn a_master_that_starts_again_with_its_token_gets_its_workers_back() {
    let address = free_address();
    let start = |token: Option<String>| {
        Cluster::start(ClusterOptions { listen: Some(address), token, ..ClusterOptions::default() })
            .expect("a cluster starts")
    };
    let mut first = start(None);
    let token = token(&first);
    let _worker = join(&first, &["--threads", "1"]);
    wait_for(&mut first, "the worker", |status| status.workers == 1);
    drop(first);
    let mut second = start(Some(token));
    wait_for(&mut second, "the worker again", |status| status.workers == 1);
    assert_eq!(draw(&mut second, &scene(SCENE), |_, _| {}), truth());
}

#[test]
fn once_means_once() {
    let mut cluster = cluster(None);
    let worker = join(&cluster, &["--threads", "1", "--once"]);
    wait_for(&mut cluster, "the worker", |status| status.workers == 1);
    drop(cluster);
    let (code, said) = worker.end();
    assert_eq!(code, Some(0), "{said}");
}
