//! What other users of a machine can see of a token: nothing, neither on a command line nor in a file nor in what is said.

use std::fs::{self, Permissions};
use std::io::{Read, Write};
use std::net::TcpStream;
use std::os::unix::fs::PermissionsExt;
use std::path::Path;
use std::time::{Duration, Instant};

use serde_json::Value;
use tests::programs::{PATIENCE, Process, free_address};

const SCENE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../scenes/cornell");

fn fresh_token() -> String {
    Process::master(&["token"]).lines().next().expect("it prints one")
}

/// Waits until a secret is on a process's command line no more, and in its environment.
fn wait_until_hidden(process: &Process, secret: &str) {
    let read = |what: &str| {
        let bytes = fs::read(format!("/proc/{}/{what}", process.0.id())).expect("it runs");
        String::from_utf8_lossy(&bytes).into_owned()
    };
    let deadline = Instant::now() + PATIENCE;
    while read("cmdline").contains(secret) || !read("environ").contains(secret) {
        assert!(Instant::now() < deadline, "{}", read("cmdline"));
        std::thread::sleep(Duration::from_millis(5));
    }
    assert!(read("cmdline").starts_with('/'), "its name stays: {}", read("cmdline"));
}

#[test]
fn a_token_does_not_stay_on_the_command_line() {
    let token = fresh_token();
    let nobody = free_address().to_string();
    let worker = Process::worker(&["--master", &nobody, "--token", &token, "--threads", "1"]);
    wait_until_hidden(&worker, &token);
    // Somebody asks it to go when it has begun again, and catches signals.
    std::thread::sleep(Duration::from_millis(500));
    worker.signal("-TERM");
    let (_, said) = worker.end();
    assert_eq!(said.matches("--token: every user of this machine could read it").count(), 1, "{said}");

    let viewer = format!("--viewer-token={token}x");
    let serve = ["serve", SCENE, "--http", "127.0.0.1:0", "--listen", "127.0.0.1:0", "--no-announce"];
    let master = Process::master(&[&serve[..], &["--token", &token, &viewer]].concat());
    wait_until_hidden(&master, &token);
    wait_until_hidden(&master, &format!("{token}x"));
}

/// What a server answers to a request for a page.
fn get(address: &str, path: &str) -> String {
    let mut stream = TcpStream::connect(address).expect("it listens");
    write!(stream, "GET {path} HTTP/1.1\r\nHost: {address}\r\nConnection: close\r\n\r\n").expect("it reads");
    let mut answer = String::new();
    stream.read_to_string(&mut answer).expect("it answers");
    answer
}

#[test]
fn the_browser_that_is_opened_here_is_not_told_the_viewers_token() {
    let folder = tempfile::tempdir().expect("a folder");
    let (opener, told) = (folder.path().join("xdg-open"), folder.path().join("told"));
    fs::write(&opener, format!("#!/bin/sh\necho \"$*\" >{0}.new; mv {0}.new {0}\n", told.display())).expect("a script");
    fs::set_permissions(&opener, Permissions::from_mode(0o755)).expect("it is ours");
    let path = format!("{}:{}", folder.path().display(), std::env::var("PATH").expect("there is one"));
    let variables = [("PATH", path.as_str()), ("IGI_VIEWER_TOKEN", "a-viewers-token")];
    let mut master = Process::master_with(&variables, &["view", SCENE, "--browser", "--http", "127.0.0.1:0", "--json"]);
    let serving = master.lines().map(|line| serde_json::from_str::<Value>(&line).expect("JSON"));
    let serving = { serving }.find(|event| event["event"] == "serving").expect("it serves");
    let address = serving["address"].as_str().expect("an address");
    let begun = Instant::now();
    while !told.exists() {
        assert!(begun.elapsed() < PATIENCE, "nothing is opened");
        std::thread::sleep(Duration::from_millis(10));
    }
    let link = fs::read_to_string(&told).expect("text");
    assert!(!link.contains("a-viewers-token"), "{link}");
    let page = link.trim().strip_prefix(&format!("http://{address}")).expect("our address");
    assert!(get(address, page).contains("location: /?token=a-viewers-token"), "it opens");
    assert!(get(address, page).starts_with("HTTP/1.1 401"), "once");
}

#[test]
fn a_token_that_was_given_is_never_printed() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = |name: &str| folder.path().join(name).to_str().expect("a readable path").to_owned();
    let (token, file, output, kept) = (fresh_token(), path("to ken"), path("a.png"), path("kept"));
    fs::write(&file, format!("{token}\n")).expect("it can be written");
    fs::set_permissions(&file, Permissions::from_mode(0o600)).expect("it is ours");
    let what = ["render", SCENE, "--size", "8x8", "--frames", "1", "--workers", "embedded:1", "--json", "-o", &output];
    let listen = ["--listen", "127.0.0.1:0", "--no-announce"];
    let by_variable = [("IGI_TOKEN", token.as_str())];
    for (variables, more, line) in [
        (&by_variable[..], &[][..], "(with IGI_TOKEN in its environment: the workers' half, by".to_owned()),
        (&[], &["--token-file", &file], format!("--token-file '{file}'")),
        // What a master has kept is as what it was given.
        (&by_variable, &["--checkpoint", &kept], "(with IGI_TOKEN in its environment".to_owned()),
        (&[], &["--checkpoint", &kept], format!("--token-file {kept}/token")),
    ] {
        let mut master = Process::master_with(variables, &[&what[..], &listen, more].concat());
        let told: Vec<String> = master.lines().collect();
        let (code, said) = master.end();
        assert_eq!(code, Some(0), "{said}");
        assert!(!said.contains(&token) && !told.iter().any(|line| line.contains(&token)), "{said}{told:?}");
        assert!(said.contains(&line), "{said}");
    }
    for (name, mode) in [("kept", 0o700), ("kept/token", 0o600), ("kept/picture", 0o600)] {
        assert_eq!(fs::metadata(path(name)).expect("it is there").permissions().mode() & 0o777, mode, "{name}");
    }
}

#[test]
fn a_token_of_the_masters_own_is_in_a_file_as_long_as_it_runs() {
    let address = free_address().to_string();
    let what = ["render", SCENE, "--size", "16x12", "--seconds", "600", "--json", "-o", "/dev/shm/never.png"];
    let mut master = Process::master(&[&what[..], &["--listen", &address, "--no-announce"]].concat());
    let mut told = Vec::new();
    let mut lines = master.lines();
    let mut wait = |kind: &str| loop {
        told.push(lines.next().expect("it says so"));
        let event: Value = serde_json::from_str(&told[told.len() - 1]).expect("JSON");
        if event["event"] == kind {
            break event;
        }
    };
    let listening = wait("listening");
    let file = listening["token_file"].as_str().expect("it keeps its token");
    let token = fs::read_to_string(file).expect("we may read it").trim().to_owned();
    assert_eq!(fs::metadata(file).expect("it is there").permissions().mode() & 0o777, 0o600);
    assert_eq!(listening["join"], format!("igi-worker --master {address} --token-file {file}"));

    let join: Vec<&str> = listening["join"].as_str().expect("a line").split_whitespace().skip(1).collect();
    let _worker = Process::worker(&[&join[..], &["--threads", "1"]].concat());
    wait("worker_joined");
    master.signal("-INT");
    told.extend(lines);
    let (_, said) = master.end();
    // Nobody sits at a terminal here.
    assert!(!said.contains(&token) && !told.iter().any(|line| line.contains(&token)), "{said}{told:?}");
    assert!(!Path::new(file).exists(), "it is of no use any more");
}

#[test]
fn a_token_file_that_others_may_read_is_refused_with_the_remedy() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("token");
    fs::write(&file, fresh_token()).expect("it can be written");
    fs::set_permissions(&file, Permissions::from_mode(0o644)).expect("it is ours");
    let (path, nobody) = (file.to_str().expect("a readable path"), free_address().to_string());
    let worker = Process::worker(&["--master", &nobody, "--token-file", path]);
    let master =
        Process::master(&["render", SCENE, "--listen", "127.0.0.1:0", "--token-file", path, "-o", "/tmp/x.png"]);
    for (process, expected) in [(worker, 2), (master, 1)] {
        let (code, said) = process.end();
        assert_eq!(code, Some(expected), "{said}");
        assert!(said.contains(&format!("chmod 600 {path}")), "{said}");
    }
}
