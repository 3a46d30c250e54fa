//! Logs for programs: with `IGI_LOG=json`, every line that either program logs is a JSON object with time, level and place.

use std::io::{BufRead, BufReader};
use std::process::{Command, Stdio};

use serde_json::Value;
use tests::programs::{Process, free_address, program};

/// What it logs, up to so many lines.
fn logged(name: &str, arguments: &[&str], token: Option<&str>, lines: usize) -> Vec<Value> {
    let mut command = Command::new(program(name));
    command.env_remove("IGI_TOKEN").envs(token.map(|token| ("IGI_TOKEN", token)));
    command.args(arguments).env("IGI_LOG", "json").env("RUST_LOG", "trace");
    command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::piped());
    let mut process = Process(command.spawn().expect("it starts"));
    let said = BufReader::new(process.0.stderr.take().expect("it is piped")).lines();
    let value = |line: String| serde_json::from_str(&line).unwrap_or_else(|error| panic!("{error}: {line}"));
    said.map_while(Result::ok).take(lines).map(value).collect()
}

fn check(logged: &[Value]) {
    assert!(!logged.is_empty(), "it logs nothing");
    for line in logged {
        let text = |field: &str| line[field].as_str().unwrap_or_else(|| panic!("no {field} in {line}"));
        assert!(["ERROR", "WARN", "INFO", "DEBUG", "TRACE"].contains(&text("level")), "{line}");
        assert!(text("timestamp").contains('T') && !text("target").is_empty(), "{line}");
    }
}

#[test]
fn a_worker_logs_in_json() {
    let made = Command::new(program("igi-master")).arg("token").output().expect("a token");
    let token = String::from_utf8(made.stdout).expect("text");
    let nobody = free_address().to_string();
    let logged = logged("igi-worker", &["--master", &nobody, "--threads", "1"], Some(token.trim()), 3);
    check(&logged);
    assert!(logged.iter().any(|line| line["message"].is_string()), "{logged:?}");
}

#[test]
fn a_master_logs_in_json() {
    let folder = tempfile::tempdir().expect("a folder");
    let picture = folder.path().join("a.png");
    let scene = concat!(env!("CARGO_MANIFEST_DIR"), "/../scenes/cornell");
    let output = picture.to_str().expect("a name");
    let rest = [
        "--size",
        "16x16",
        "--frames",
        "1",
        "--quiet",
        "--listen",
        "127.0.0.1:0",
        "--no-announce",
        "--workers",
        "embedded:1",
    ];
    check(&logged("igi-master", &[&["render", scene, "-o", output][..], &rest].concat(), None, usize::MAX));
    assert!(picture.exists());
}
