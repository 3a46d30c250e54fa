//! A method that this workspace does not know, in a program of its own: it goes through every command.

use std::path::Path;
use std::process::Command;

use serde_json::{Value, json};

use super::master::{Master, Watcher, scene};

const PROGRAM: &str = env!("CARGO_BIN_EXE_toy-master");

/// What a command says, one event a line; it must end well.
fn events(arguments: &[&str], paths: &[&Path]) -> Vec<Value> {
    let output = Command::new(PROGRAM).args(arguments).args(paths).output().expect("it runs");
    assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
    let lines = String::from_utf8(output.stdout).expect("text");
    lines.lines().filter_map(|line| serde_json::from_str(line).ok()).collect()
}

fn said(arguments: &[&str]) -> (Option<i32>, String) {
    let output = Command::new(PROGRAM).args(arguments).output().expect("it runs");
    (output.status.code(), String::from_utf8_lossy(&[output.stdout, output.stderr].concat()).into_owned())
}

/// The event of this kind.
fn of<'a>(events: &'a [Value], kind: &str) -> &'a Value {
    events.iter().find(|event| event["event"] == kind).unwrap_or_else(|| panic!("no {kind} in {events:?}"))
}

#[test]
fn it_renders_with_its_knobs_and_says_so_in_help_and_files() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("a.exr");
    let cornell = scene("cornell");
    let cornell = cornell.to_str().expect("text");
    let render = ["render", cornell, "--method", "toy", "--step", "0.25", "--size", "8x6", "--frames", "3", "--json"];
    let events = events(&[&render[..], &["-o"]].concat(), &[&path]);
    assert_eq!(of(&events, "picture")["frames"], 3);
    let picture = runtime::files::read_picture(&path).expect("a picture");
    assert!(picture.pixels.iter().all(|pixel| *pixel == glam::Vec3::splat(0.75)), "{:?}", picture.pixels[0]);
    let (_, words) = runtime::files::read_metadata(&path).expect("metadata");
    assert_eq!((words["method"].as_str(), words["settings"].as_str()), ("toy", r#"{"step":0.25}"#));
    assert!(words["command"].contains("--method toy --step 0.25"), "{}", words["command"]);

    let (_, help) = said(&["render", "--help"]);
    for words in ["one colour, brighter with every frame", "Knobs of method toy", "How much brighter each frame is"] {
        assert!(help.contains(words), "{help}");
    }
    let (code, refused) = said(&["render", cornell, "--method", "toy", "--vpls", "3"]);
    assert!(code == Some(2) && refused.contains("--vpls is a knob of method igi, not of toy"), "{refused}");
    let (code, refused) = said(&["render", cornell, "--method", "toy", "--step", "7"]);
    assert!(code == Some(2) && refused.contains("above 0 and at most 1"), "{refused}");
    let kept = folder.path().join("kept");
    let kept = kept.to_str().expect("text");
    let (code, refused) = said(&["render", cornell, "--method", "toy", "--frames", "1", "--checkpoint", kept]);
    assert!(code == Some(2) && refused.contains("toy cannot go on"), "{refused}");
}

#[test]
fn it_is_measured_and_reported_on() {
    let folder = tempfile::tempdir().expect("a folder");
    let cornell = scene("cornell");
    let cornell = cornell.to_str().expect("text");
    let bench = events(&["bench", cornell, "--method", "toy", "--size", "8x6", "--frames", "2", "--json"], &[]);
    assert!(bench[0]["frames_per_second"].as_f64() > Some(0.0), "{bench:?}");

    let reference = folder.path().join("ref.exr");
    let draw = ["reference", cornell, "--size", "8x6", "--samples", "16", "--quiet", "-o"];
    events(&draw, &[&reference]);
    let report = folder.path().join("report");
    let to = [reference.to_str().expect("text"), report.to_str().expect("text")];
    let measure = ["--shrink", "1", "--runs", "2", "--seconds", "0.2", "--without-pruning", "--quiet"];
    let what = ["--methods", "toy", "--variant", "bold=--method toy --step 1", "--reference", to[0], "-o", to[1]];
    events(&[&["report", cornell][..], &measure, &what].concat(), &[]);
    let points = std::fs::read_to_string(report.join("points.csv")).expect("it is written");
    assert!(points.contains("toy") && points.contains("bold"), "{points}");
}

#[tokio::test]
async fn it_is_served_turned_recorded_and_replayed() {
    let folder = tempfile::tempdir().expect("a folder");
    let session = folder.path().join("a.session");
    let file = session.to_str().expect("text");
    let flags = ["--method", "toy", "--size", "8x6", "--rest-after", "4", "--workers", "embedded:1", "--record", file];
    let mut master = Master::of_program(PROGRAM.as_ref(), "cornell", &flags);
    let mut watcher = Watcher::join(&master).await;
    let welcome = watcher.recv("welcome").await;
    let names: Vec<_> = welcome["methods"].as_array().into_iter().flatten().map(|method| &method["name"]).collect();
    assert_eq!(names, ["igi", "reference", "toy"]);
    assert_eq!(welcome["knobs"]["method"], json!({ "name": "toy", "settings": { "step": 0.125 } }));
    let finished = |header: &Value| header["finished"] == true;
    let grey = |seen: &image::RgbImage| seen.get_pixel(3, 3).0[0];
    let dark = grey(&watcher.recv_frame(finished).await.image);
    watcher.send(json!({ "say": "turn", "values": { "step": 0.25 } })).await;
    let bright = grey(&watcher.recv_frame(|header| finished(header) && header["revision"] == 1).await.image);
    assert!(dark > 0 && bright > dark, "{dark} {bright}");
    let mut look = welcome["camera"].clone();
    look["say"] = json!("look");
    for step in 1..=3 {
        look["origin"][0] = json!(look["origin"][0].as_f64().expect("a number") + 0.1);
        watcher.send(look.clone()).await;
        watcher.recv_frame(|header| finished(header) && header["revision"] == 1 + step).await;
    }
    master.interrupted("kept");

    let replayed = |more: &[&str]| {
        let replay = ["replay", file, "--frames", "4", "--json", "--quiet"];
        let events = events(&[&replay[..], more].concat(), &[]);
        (of(&events, "replayed")["moving"].clone(), of(&events, "replayed")["sha256"].clone())
    };
    let (moving, first) = replayed(&[]);
    assert_eq!((moving, &first), (json!(3), &replayed(&[]).1), "the same bits again");
    assert_ne!(replayed(&["--method", "toy"]).1, first, "the knob was turned");
    // The same inputs through another method.
    assert_ne!(replayed(&["--method", "igi", "--preset", "draft"]).1, first);
}
