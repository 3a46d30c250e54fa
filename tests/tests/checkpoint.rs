//! A master that is killed in the middle: the same command goes on, its worker comes back, and the picture has the
//! same bits as if nothing had happened.

use std::time::Instant;

use protocol::transport::IDLE_MAX;
use serde_json::Value;
use tests::programs::{Process, free_address};

const SCENE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../scenes/cornell_spheres");

/// Events that a master writes, until one says that it is the last to wait for.
fn events(master: &mut Process) -> impl Iterator<Item = Value> + use<> {
    master.lines().map(|line| serde_json::from_str(&line).expect("one JSON object a line"))
}

fn picture(mut events: impl Iterator<Item = Value>) -> (String, u64) {
    let picture = events.find(|event| event["event"] == "picture").expect("a picture is made");
    (picture["raw_sha256"].as_str().unwrap().to_owned(), picture["frames"].as_u64().unwrap())
}

#[test]
fn a_killed_master_goes_on_with_its_workers_and_ends_in_the_same_bits() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let (output, kept, address) = (path("a.exr"), path("kept"), free_address().to_string());
    let what = ["render", SCENE, "--size", "96x72", "--frames", "24", "--photons", "500", "--json", "-o", &output];

    let mut alone = Process::master(&[&what[..], &["--workers", "embedded:2"]].concat());
    let truth = picture(events(&mut alone));
    assert_eq!(truth.1, 24);

    let command = [&what[..], &["--listen", &address, "--checkpoint", &kept, "--checkpoint-every", "0.2"]].concat();
    let mut first = Process::master(&command);
    let mut heard = events(&mut first);
    let listening = heard.find(|event| event["event"] == "listening").expect("it listens");
    let join: Vec<_> = listening["join"].as_str().unwrap().split_whitespace().skip(1).map(str::to_owned).collect();
    let join: Vec<&str> = join.iter().map(String::as_str).collect();
    let worker = Process::worker(&[&join[..], &["--threads", "2"]].concat());
    // Killed as soon as something was kept, and long before the end.
    let begun = Instant::now();
    while !folder.path().join("kept/picture").exists() {
        assert!(begun.elapsed() < tests::programs::PATIENCE, "nothing is kept");
        std::thread::sleep(std::time::Duration::from_millis(5));
    }
    drop(first);

    let killed = Instant::now();
    let mut second = Process::master(&command);
    let mut heard = events(&mut second);
    heard.find(|event| event["event"] == "listening").expect("it listens again");
    let away = killed.elapsed();
    let resumed = heard.find(|event| event["event"] == "resumed").expect("it goes on");
    assert!((1..24).contains(&resumed["frames"].as_u64().unwrap()), "{resumed}");
    heard.find(|event| event["event"] == "worker_joined").expect("the worker comes again");
    println!(
        "the worker was back {:.2} s after the kill, {away:.2?} of them without a master",
        killed.elapsed().as_secs_f64()
    );
    assert_eq!(picture(&mut heard), truth);
    worker.signal("-TERM");
    let (_, said) = worker.end();
    // Unless the machine is so busy that the silence was too long, the worker was told.
    assert!(away > IDLE_MAX / 2 || said.contains("was started again; joining it again"), "{away:?}: {said}");

    // Once more: nothing is left to do.
    let mut third = Process::master(&command);
    assert_eq!(picture(events(&mut third)), truth);

    // Another picture is not mixed with this one.
    let mut other = command.clone();
    other.extend(["--seed", "2"]);
    let (code, said) = Process::master(&other).end();
    assert_eq!(code, Some(1), "{said}");
    assert!(said.contains("of another picture"), "{said}");
}
