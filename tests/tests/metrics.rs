//! What master and worker tell those who look after them: numbers that grow, health that follows the work, and a
//! dashboard that asks for nothing else.

use std::collections::BTreeSet;
use std::net::SocketAddr;
use std::time::{Duration, Instant};

use health::ask::{ask, check};
use serde_json::Value;
use tests::programs::{PATIENCE, Process, free_address};

const SCENE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../scenes/cornell");
const DASHBOARD: &str = include_str!("../../deploy/grafana.json");

/// The value of a sample.
fn sample(page: &str, name: &str) -> Option<f64> {
    page.lines().find_map(|line| line.strip_prefix(name)?.strip_prefix(' ')?.parse().ok())
}

fn metrics(address: SocketAddr) -> String {
    let (status, page) = ask(address, "/metrics").expect("it answers");
    assert_eq!(status, 200);
    page
}

fn wait_until(what: &str, mut enough: impl FnMut() -> bool) {
    let deadline = Instant::now() + PATIENCE;
    while !enough() {
        assert!(Instant::now() < deadline, "waited in vain for {what}");
        std::thread::sleep(Duration::from_millis(20));
    }
}

#[test]
fn master_and_worker_tell_what_they_do() {
    let listen = free_address().to_string();
    let folder = tempfile::tempdir().unwrap();
    let output = folder.path().join("out.png");
    let output = output.to_str().unwrap();
    let what = ["render", SCENE, "--size", "64x48", "--seconds", "600", "--json", "-o", output];
    let mut master = Process::master(&[&what[..], &["--listen", &listen, "--metrics", "127.0.0.1:0"]].concat());
    let mut events = master.lines().map(|line| serde_json::from_str::<Value>(&line).expect("JSON"));
    let (mut join, mut address) = (None, None::<SocketAddr>);
    while join.is_none() || address.is_none() {
        let event = events.next().expect("it says where it is");
        join = join.or_else(|| event["join"].as_str().map(str::to_owned));
        address = address.or_else(|| event["url"].as_str().and(event["address"].as_str()).map(|a| a.parse().unwrap()));
    }
    // Nobody has to read the rest, and nobody waits for that.
    let _reader = std::thread::spawn(move || events.count());
    let (join, address) = (join.unwrap(), address.unwrap());

    // A master without workers is well: they have to find it.
    assert_eq!(check(address, true), Ok("waiting for workers".into()));
    assert_eq!(sample(&metrics(address), "igi_workers{state=\"ready\"}"), Some(0.0));

    let own = std::net::TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap();
    let mut words: Vec<&str> = join.split_whitespace().skip(1).collect();
    let port = own.port().to_string();
    words.extend(["--threads", "1", "--metrics", &port]);
    let worker = Process::worker(&words);
    wait_until("a worker that is ready", || check(own, true).is_ok());
    wait_until("frames", || sample(&metrics(address), "igi_frames_total").is_some_and(|frames| frames >= 3.0));

    let (ours, theirs) = (metrics(address), metrics(own));
    let positive = |page: &str, name: &str| assert!(sample(page, name) > Some(0.0), "{name} in\n{page}");
    for name in [
        "igi_tiles_total",
        "igi_rays_total{kind=\"eye\"}",
        "igi_rays_total{kind=\"shadow\"}",
        "igi_work_seconds_total{stage=\"eye\"}",
        "igi_bytes_total{direction=\"sent\"}",
        "igi_bytes_total{direction=\"received\"}",
        "igi_frame_latency_seconds_count",
    ] {
        positive(&ours, name);
    }
    assert_eq!(sample(&ours, "igi_workers{state=\"ready\"}"), Some(1.0));
    assert_eq!(sample(&ours, "igi_leases_expired_total"), Some(0.0));
    for name in ["igi_worker_tiles_total", "igi_worker_rays_total{kind=\"eye\"}", "igi_worker_state{state=\"ready\"}"] {
        positive(&theirs, name);
    }
    the_dashboard_asks_for(&(ours + &theirs));

    // The check for images without a shell, in words and exit codes.
    let (code, said) = Process::worker(&["health", "--ready", &port]).end();
    assert_eq!(code, Some(0), "{said}");
    let (code, said) = Process::master(&["health", &address.to_string()]).end();
    assert_eq!(code, Some(0), "{said}");

    // Both go politely when asked.
    worker.signal("-TERM");
    let (code, said) = worker.end();
    assert_eq!(code, Some(0), "{said}");
    let (code, said) = Process::worker(&["health", &port]).end();
    assert_eq!(code, Some(1), "{said}");
    assert!(said.contains("nobody answers"), "{said}");
    wait_until("the worker's end", || sample(&metrics(address), "igi_workers{state=\"ready\"}") == Some(0.0));
}

/// Every series that the dashboard draws is told by somebody.
fn the_dashboard_asks_for(told: &str) {
    let dashboard: Value = serde_json::from_str(DASHBOARD).expect("the dashboard is JSON");
    let mut asked = BTreeSet::new();
    let panels = dashboard["panels"].as_array().expect("it has panels");
    for target in panels.iter().flat_map(|panel| panel["targets"].as_array().cloned().unwrap_or_default()) {
        let query = target["expr"].as_str().expect("every target has a query").to_owned();
        let names = query.split(|c: char| !c.is_ascii_alphanumeric() && c != '_');
        asked.extend(names.filter(|word| word.starts_with("igi_")).map(str::to_owned));
    }
    assert!(asked.len() > 8, "{asked:?}");
    // Told by `serve` alone, once somebody has moved something.
    asked.remove("igi_input_latency_seconds");
    for name in asked {
        let is_told =
            told.lines().any(|line| line.strip_prefix(&*name).is_some_and(|rest| rest.starts_with([' ', '{'])));
        assert!(is_told, "the dashboard asks for {name}, which nobody tells");
    }
}
