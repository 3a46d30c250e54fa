//! Rays and points asked of a real worker process over QUIC, through the master's own cluster.

use std::path::Path;
use std::process::Command;
use std::sync::Arc;
use std::time::{Duration, Instant};

use protocol::answer::Body;
use protocol::question::{Ask, Asked, Part, Point, Points, Question, Ray, Rays, Ticket, WorldState};
use protocol::schedule::WorkerState;
use runtime::cluster::{Cluster, ClusterOptions, Event};
use scenes::{Change, SurfacePoint};
use serde_json::Value;
use tests::clusters::wait_for;
use tests::programs::{PATIENCE, Process, program};

use crate::world::{World, lit, rays_of};

/// What becomes of questions, in their order: the answers, or why there are none.
fn ask(cluster: &mut Cluster, world: WorldState, asks: &[Ask]) -> Vec<Result<Body, String>> {
    let asked = |(slot, ask): (u32, &Ask)| Asked::new(Ticket { batch: 0, slot }, Question { world, ask: ask.clone() });
    cluster.ask((0..).zip(asks).map(asked).collect());
    let mut ends = vec![None; asks.len()];
    let begun = Instant::now();
    while ends.iter().any(Option::is_none) {
        assert!(begun.elapsed() < PATIENCE, "no answer: {:?}", cluster.status());
        let (asked, end) = match cluster.next(Duration::from_millis(50)) {
            Some(Event::Answered { asked, body, .. }) => (asked, Ok(body)),
            Some(Event::Unanswered { asked, reason }) => (asked, Err(reason)),
            _ => continue,
        };
        let before = ends[asked.ticket.slot as usize].replace(end);
        assert!(before.is_none(), "a question ends once");
    }
    ends.into_iter().flatten().collect()
}

#[test]
fn a_worker_process_answers_rays_and_points_as_light_does_and_refuses_what_is_not_there() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenes/cornell_spheres");
    let mut scene = scenes::read::load(&folder).expect("the shipped scene is sound").scene;
    (scene.camera.width, scene.camera.height) = (48, 36);
    let camera = scene.camera;
    let truth = World::new(scene.clone());

    let listen = Some("127.0.0.1:0".parse().expect("an address"));
    let mut cluster = Cluster::start(ClusterOptions { listen, ..ClusterOptions::default() }).expect("it starts");
    let master = cluster.address().expect("it listens").to_string();
    let token = cluster.token().expect("it listens").to_string();
    let _worker = Process::worker_with(&token, &["--master", &master, "--threads", "2"]);
    let world = cluster.publish(Arc::new(scene)).expect("the scene can be sent");
    wait_for(&mut cluster, "the worker", |status| status.ready == 1);

    // Rays, then points where they hit.
    let lit = [lit(0, 0), lit(4, 2)];
    let rays = |lit| {
        let through: Vec<Ray> = rays_of(&truth.tile(lit));
        Ask::Rays(Rays { camera, view: Some(camera), through, lit })
    };
    let asks = lit.map(rays);
    let mut hits: Vec<Point> = Vec::new();
    for (end, ask) in ask(&mut cluster, world, &asks).into_iter().zip(&asks) {
        let body = end.expect("rays are answered");
        assert!(body == truth.packed(ask), "{ask} are answered otherwise");
        let (Ask::Rays(Rays { through, .. }), Body::Seen(seen)) = (ask, body) else { panic!("rays see") };
        hits.extend(
            seen.hits.iter().zip(through).filter_map(|(hit, ray)| Some(Point { at: (*hit)?, address: ray.address })),
        );
    }
    assert!(hits.len() > 300, "{} hits", hits.len());
    let each = Part::EachLight { first: 0, count: 64 };
    let groups = (0..truth.prepared.groups().len() as u32).collect();
    let parts = [Part::All, Part::Direct, Part::Indirect, Part::DirectOf(groups), each, Part::Towards(camera.origin)];
    let points = |part| Ask::Points(Points { view: Some(camera), at: hits.clone(), part, lit: lit[1] });
    let asks = parts.map(points);
    for (end, ask) in ask(&mut cluster, world, &asks).into_iter().zip(&asks) {
        assert!(end.expect("points are answered") == truth.packed(ask), "{ask} are answered otherwise");
    }

    // More refusals than failures would send a worker into quarantine.
    let wrong = |triangle| {
        let at = vec![Point { at: SurfacePoint { triangle, ..SurfacePoint::default() }, ..Point::default() }];
        Ask::Points(Points { view: Some(camera), at, part: Part::All, lit: lit[0] })
    };
    let asks: Vec<Ask> = (0..10).map(|i| wrong((1 << 20) + i)).collect();
    for end in ask(&mut cluster, world, &asks) {
        let reason = end.expect_err("nobody can answer");
        assert!(reason.contains("refused") && reason.contains("has no triangle 10485"), "{reason}");
    }
    let all = points(Part::All);
    let edited =
        cluster.change(vec![Change::Visible { object: hits[0].at.object, visible: false }]).expect("an object");
    let reason = ask(&mut cluster, edited, std::slice::from_ref(&all)).remove(0).expect_err("it is hidden");
    assert!(reason.contains("is hidden"), "{reason}");
    let back = cluster.change(vec![Change::Visible { object: hits[0].at.object, visible: true }]).expect("an object");
    let answer = ask(&mut cluster, back, std::slice::from_ref(&all)).remove(0).expect("it is there again");
    assert!(answer == truth.packed(&all), "it is lit otherwise than before");
    let status = cluster.status();
    assert!(status.list.iter().all(|worker| worker.state == WorkerState::Ready), "{:?}", status.list);
    assert_eq!(status.counters.quarantines, 0);
}

#[test]
fn rates_are_measured_in_this_process_and_over_quic_by_the_same_questions() {
    // It is looked for beside the master.
    program("igi-worker");
    let scene = Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenes/cornell");
    let measured = |flags: &[&str]| {
        let mut command = Command::new(program("igi-master"));
        command.args(["bench", "--questions", "--size", "48x36", "--json"]).arg(&scene).args(flags);
        let output = command.output().expect("igi-master runs");
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        let line: Value = serde_json::from_slice(&output.stdout).expect("one JSON object");
        let rows = line["questions"].as_array().expect("rows").clone();
        assert!(rows.len() == 6 && rows.iter().all(|row| row["sorted"]["per_second"].as_f64() > Some(0.0)), "{rows:?}");
        let rays = |row: &Value| ["sorted", "scattered"].map(|order| row[order]["shadow_rays"].clone());
        rows.iter().map(rays).collect::<Vec<_>>()
    };
    assert_eq!(measured(&[]), measured(&["--over-quic"]));
}
