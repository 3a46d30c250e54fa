//! Workers that are told a token and nothing else; polite ones; doctors; the script that starts them on other machines.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::{Duration, Instant};

use serde_json::Value;
use tests::programs::{PATIENCE, Process, free_address, program};

const SCENE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../scenes/cornell");

/// A master that draws for long, and the line that starts a worker.
fn master(address: &str, more: &[&str]) -> (Process, Vec<String>, impl Iterator<Item = Value> + use<>) {
    // It is killed before it saves anything.
    let what = ["render", SCENE, "--size", "64x48", "--seconds", "600", "--json", "-o", "never.png"];
    let mut master = Process::master(&[&what[..], &["--listen", address], more].concat());
    let mut events = master.lines().map(|line| serde_json::from_str::<Value>(&line).expect("JSON"));
    let listening = events.find(|event| event["event"] == "listening").expect("it listens");
    let join = listening["join"].as_str().expect("a line").split_whitespace().skip(1).map(str::to_owned).collect();
    (master, join, events)
}

/// Where the master keeps its token.
fn token_file(join: &[String]) -> &str {
    &join[3]
}

fn token(join: &[String]) -> String {
    std::fs::read_to_string(token_file(join)).expect("the master keeps it").trim().to_owned()
}

#[test]
fn a_worker_finds_its_master_by_the_token_alone() {
    let (_stranger, other, _) = master(&free_address().to_string(), &[]);
    let (_master, join, mut events) = master(&free_address().to_string(), &[]);
    assert_ne!(token(&other), token(&join));
    let _worker = Process::worker(&["--token-file", token_file(&join), "--threads", "1", "--name", "seeker"]);
    let joined = events.find(|event| event["event"] == "worker_joined").expect("it comes");
    assert_eq!(joined["name"], "seeker", "{joined}");
}

#[test]
fn a_master_that_keeps_quiet_is_not_found() {
    let (_master, join, _) = master(&free_address().to_string(), &["--no-announce"]);
    let mut doctor = Process::worker(&["doctor", "--json", "--token-file", token_file(&join)]);
    let said: Value = serde_json::from_str(&doctor.lines().collect::<String>()).expect("one JSON object");
    assert!(said["connection"].is_null() && said["troubles"].to_string().contains("no master found"), "{said}");
}

#[test]
fn doctors_measure_the_way() {
    let (_master, join, _) = master(&free_address().to_string(), &[]);
    let mut words = vec!["doctor", "--json"];
    words.extend(join.iter().map(String::as_str));
    let mut worker = Process::worker(&words);
    let said: Value = serde_json::from_str(&worker.lines().collect::<String>()).expect("one JSON object");
    assert!(
        said["connection"]["bytes_per_second"].is_null(),
        "a scene that small tells nothing of the network: {said}"
    );
    assert!(said["connection"]["mtu"].as_u64().is_some_and(|mtu| mtu >= 1200), "{said}");
    assert!(said["memory"].as_u64().is_some_and(|memory| memory > 1 << 28), "{said}");

    // The same through `ssh`, which here is a shell of this machine.
    let folder = tempfile::tempdir().unwrap();
    let ssh = fake_ssh(folder.path());
    let mut command = Command::new(program("igi-master"));
    command.args(["doctor", "--json", "--listen", &free_address().to_string(), "here", "there"]);
    command.env("IGI_SSH", &ssh).env("IGI_WORKER", program("igi-worker")).env_remove("IGI_TOKEN");
    let output = command.output().unwrap();
    let said: Vec<Value> =
        String::from_utf8_lossy(&output.stdout).lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    assert_eq!(said.len(), 2, "{output:?}");
    assert!(said[0]["said"]["connection"]["bytes_per_second"].as_f64().is_some_and(|rate| rate > 0.0), "{said:?}");
    // It is the same clock; how long asking takes is the machine's affair.
    let [skew, doubt] = ["clock_skew", "clock_skew_known_to"].map(|name| said[0][name].as_f64().expect(name));
    assert!(skew.abs() <= doubt + 0.01, "{said:?}");
    assert!(said[1]["troubles"][0].as_str().is_some_and(|trouble| trouble.contains("no such machine")), "{said:?}");
    assert_eq!(output.status.code(), Some(1), "one of the two is not well");
}

/// Something that does as `ssh HOST COMMAND` does, with a home of its own for each host; `there` is not there.
fn fake_ssh(folder: &Path) -> PathBuf {
    let path = folder.join("ssh");
    let script = format!(
        "#!/bin/sh\nhost=$1; shift\n[ \"$host\" != there ] || {{ echo 'no such machine' >&2; exit 255; }}\n\
         export HOME={}/$host; mkdir -p \"$HOME\"; exec sh -c \"$*\"\n",
        folder.display()
    );
    std::fs::write(&path, script).expect("it can be written");
    done(Command::new("chmod").arg("755").arg(&path));
    path
}

fn done(command: &mut Command) -> String {
    let output = command.output().expect("it starts");
    let said = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(output.status.success(), "{command:?}: {said}{}", String::from_utf8_lossy(&output.stderr));
    said
}

#[test]
fn the_script_starts_and_stops_workers_on_a_list_of_machines() {
    let (_master, join, mut events) = master(&free_address().to_string(), &[]);
    let folder = tempfile::tempdir().unwrap();
    let ssh = fake_ssh(folder.path());
    let hosts = folder.path().join("hosts");
    std::fs::write(&hosts, "# two machines\nlab1   # the fast one\n\nlab2\n").unwrap();
    let script = |what: &str, more: &[&str]| {
        let mut command = Command::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../deploy/lan/workers.sh"));
        command.arg(what).arg(&hosts).args(more).env("IGI_SSH", &ssh).env("IGI_TOKEN", token(&join));
        done(&mut command)
    };
    assert_eq!(script("push", &[program("igi-worker").to_str().unwrap()]), "lab1: pushed\nlab2: pushed\n");
    let started = script("start", &["--master", &join[1], "--threads", "1", "--name", "a machine's name"]);
    assert_eq!(started.matches("started").count(), 2, "{started}");
    for _ in 0..2 {
        let joined = events.find(|event| event["event"] == "worker_joined").expect("they come");
        assert_eq!(joined["name"], "a machine's name");
    }
    assert_eq!(script("start", &[]).matches("runs already").count(), 2);
    assert!(script("status", &[]).contains("lab2: runs"));
    assert_eq!(script("stop", &[]), "lab1: stopped\nlab2: stopped\n");
    let left = events.find(|event| event["event"] == "worker_left").expect("they go");
    assert!(left["reason"].as_str().unwrap().contains("asked to stop"), "{left}");
    assert_eq!(script("stop", &[]), "lab1: does not run\nlab2: does not run\n");
}

#[test]
fn a_polite_worker_makes_room_and_says_so() {
    let (_master, join, mut events) = master(&free_address().to_string(), &[]);
    let mut words: Vec<&str> = join.iter().map(String::as_str).collect();
    // Whoever runs this test uses more than nothing.
    words.extend(["--threads", "1", "--nice=0"]);
    let worker = Process::worker(&words);
    let id = worker.0.id();
    events.find(|event| event["event"] == "worker_joined").expect("it comes");
    let stat = std::fs::read_to_string(format!("/proc/{id}/stat")).unwrap();
    assert_eq!(stat.rsplit_once(')').unwrap().1.split_whitespace().nth(16), Some("19"), "the lowest priority");
    // A neighbour who needs the machine.
    let begun = Instant::now();
    let neighbour = std::thread::spawn(move || {
        while begun.elapsed() < Duration::from_secs(8) {
            std::hint::spin_loop();
        }
    });
    let left = events.find(|event| event["event"] == "worker_left").expect("it makes room");
    assert!(left["reason"].as_str().unwrap().contains("others need the machine"), "{left}");
    assert!(begun.elapsed() < PATIENCE);
    neighbour.join().unwrap();
    // It is still there, and ends when asked.
    worker.signal("-TERM");
    let (code, said) = worker.end();
    assert_eq!(code, Some(0), "{said}");
}
