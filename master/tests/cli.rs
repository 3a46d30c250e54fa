//! The program as a person or a script uses it: flags in, files and exit codes out.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::time::Duration;

use exr::prelude::{AttributeValue, Text};
use serde_json::Value;

const CORNELL: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../scenes/cornell");

fn igi_master(args: &[&str], folder: &Path) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_igi-master"));
    command.args(args).current_dir(folder).env_remove("RUST_LOG").env_remove("IGI_WORKERS").env_remove("IGI_LISTEN");
    command.output().expect("the program starts")
}

/// Runs it, expects an exit code, and returns what it said on standard error.
fn refused(code: i32, args: &[&str], folder: &Path) -> String {
    let output = igi_master(args, folder);
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(code), "{args:?}: {said}");
    assert!(!said.contains("panicked"), "{said}");
    said
}

fn folder() -> tempfile::TempDir {
    tempfile::tempdir().expect("a folder")
}

fn files(folder: &Path) -> Vec<PathBuf> {
    let mut files: Vec<PathBuf> = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    files.sort();
    files
}

fn attribute(path: &Path, name: &str) -> String {
    let image = exr::prelude::read_all_data_from_file(path).unwrap();
    match image.layer_data[0].attributes.other.get(&Text::from(format!("igi:{name}").as_str())) {
        Some(AttributeValue::Text(text)) => text.to_string(),
        other => panic!("igi:{name} is {other:?}"),
    }
}

#[test]
fn wrong_use_is_refused_with_code_2_before_any_work() {
    let folder = folder();
    for (args, hint) in [
        (&["render"][..], "<SCENE>"),
        (&["render", CORNELL, "--size", "0x100"], "--size"),
        (&["render", CORNELL, "--size", "100"], "--size"),
        (&["render", CORNELL, "-o", "a.jpg"], ".png or .exr"),
        (&["render", CORNELL, "--seconds", "-1"], "--seconds"),
        (&["render", CORNELL, "--frames", "0"], "--frames"),
        (&["render", CORNELL, "--error", "nan"], "--error"),
        (&["render", CORNELL, "--bound", "soft"], "--bound"),
        (&["render", CORNELL, "--workers", "embedded:0"], "--workers"),
        (&["render", CORNELL, "--token", "x"], "--listen"),
        (&["serve", CORNELL, "--token-lifetime", "1h"], "--listen"),
        (&["render", CORNELL, "--no-such-knob"], "--no-such-knob"),
        (&["render", CORNELL, "--time", "inf"], "--time"),
        (&["compare", "a.exr"], "<REFERENCE>"),
        (&["paint"], "paint"),
    ] {
        let said = refused(2, args, folder.path());
        assert!(said.contains(hint), "{args:?}: {said}");
    }
    assert!(files(folder.path()).is_empty());
}

#[test]
fn a_token_in_the_environment_is_for_commands_that_listen() {
    let folder = folder();
    let mut command = Command::new(env!("CARGO_BIN_EXE_igi-master"));
    command.args(["render", CORNELL, "--size", "16x16", "--frames", "1", "-o", "a.png"]).current_dir(folder.path());
    let output = command.env("IGI_TOKEN", "igi1-anything").env_remove("IGI_LISTEN").output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
}

#[test]
fn scenes_that_cannot_be_used_have_code_3_and_are_named() {
    let folder = folder();
    std::fs::write(folder.path().join("broken.obj"), "v 1 2\nf 1 2 3\n").unwrap();
    for scene in ["missing", "missing.obj", "broken.obj"] {
        let said = refused(3, &["render", scene], folder.path());
        assert!(said.contains(scene), "{said}");
        refused(3, &["plan", scene], folder.path());
    }
}

#[test]
fn what_cannot_be_written_is_found_out_before_rendering() {
    let folder = folder();
    let said = refused(1, &["render", CORNELL, "--seconds", "3600", "-o", "no/such/folder/a.png"], folder.path());
    assert!(said.contains("no/such/folder/a.png"), "{said}");
}

#[test]
fn pictures_beyond_memory_are_refused_with_their_size() {
    let folder = folder();
    let said = refused(2, &["render", CORNELL, "--size", "65535x65535", "-o", "a.png"], folder.path());
    assert!(said.contains("65535x65535") && said.contains("GB"), "{said}");
    assert!(files(folder.path()).is_empty());
}

#[test]
fn a_picture_is_drawn_saved_and_told_about() {
    let folder = folder();
    let args = ["render", CORNELL, "--size", "40x30", "--frames", "2", "-o", "a.png", "-o", "a.exr", "--aov", "--json"];
    let output = igi_master(&args, folder.path());
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    assert_eq!(files(folder.path()), ["a.exr", "a.png"].map(|name| folder.path().join(name)));

    let lines: Vec<Value> =
        String::from_utf8(output.stdout).unwrap().lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    let done = lines.last().unwrap();
    let events: Vec<&str> = lines.iter().map(|line| line["event"].as_str().unwrap()).collect();
    assert!(events.contains(&"scene") && events.contains(&"saved"), "{events:?}");
    assert_eq!(done["event"], "done", "the last line sums up");
    assert_eq!(done["frames"], 2);
    assert_eq!(done["samples_dropped"], 0);
    assert!(done["rays"]["eye"].as_u64().unwrap() >= 2 * 40 * 30);

    let png = image::open(folder.path().join("a.png")).unwrap();
    assert_eq!((png.width(), png.height()), (40, 30));
    let mean = png.to_luma8().pixels().map(|pixel| u64::from(pixel.0[0])).sum::<u64>() / (40 * 30);
    assert!((20..230).contains(&mean), "neither black nor white: {mean}");
    assert_eq!(attribute(&folder.path().join("a.exr"), "frames"), "2");
}

#[test]
fn without_a_name_the_picture_is_called_as_the_scene() {
    let folder = folder();
    let output = igi_master(&["render", CORNELL, "--size", "8x8", "--frames", "1", "--quiet"], folder.path());
    assert_eq!(output.status.code(), Some(0));
    assert!(output.stderr.is_empty() && output.stdout.is_empty(), "--quiet says nothing");
    assert_eq!(files(folder.path()), [folder.path().join("cornell.png")]);
}

#[test]
fn the_exr_holds_the_command_that_draws_it_again_bit_by_bit() {
    let folder = folder();
    let first =
        ["render", CORNELL, "--size", "31x17", "--frames", "3", "--seed", "5", "--interleave", "2x3", "--vpls", "5"];
    let output = igi_master(&[&first[..], &["-o", "a.exr", "-q", "--workers", "embedded:1"]].concat(), folder.path());
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    let command = attribute(&folder.path().join("a.exr"), "command");
    let again: Vec<&str> = command.split_whitespace().skip(1).collect();
    let output = igi_master(&[&again[..], &["-o", "b.exr", "-q", "--workers", "embedded:3"]].concat(), folder.path());
    assert_eq!(output.status.code(), Some(0), "{command}: {}", String::from_utf8_lossy(&output.stderr));
    let [a, b] = ["a.exr", "b.exr"].map(|name| attribute(&folder.path().join(name), "raw_sha256"));
    assert_eq!(a, b);
    let output = igi_master(&["compare", "a.exr", "b.exr", "--json"], folder.path());
    let measures: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(measures["max"], 0.0);
}

#[test]
fn different_pictures_are_measured_and_mapped() {
    let folder = folder();
    for (seed, name) in [("1", "a.exr"), ("2", "b.exr")] {
        let args = ["render", CORNELL, "--size", "24x24", "--frames", "1", "-q", "--seed", seed, "-o", name];
        assert_eq!(igi_master(&args, folder.path()).status.code(), Some(0));
    }
    let output = igi_master(&["compare", "a.exr", "b.exr", "-o", "diff.png", "--json"], folder.path());
    let measures: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert!(measures["rel_mse"].as_f64().unwrap() > 0.0 && measures["flip"].as_f64().unwrap() > 0.0);
    assert_eq!(measures["non_finite"], 0);
    assert_eq!(image::open(folder.path().join("diff.png")).unwrap().width(), 24);

    refused(2, &["compare", "a.exr", "b.exr", "-o", "diff.exr"], folder.path());
    refused(1, &["compare", "a.exr", "missing.exr"], folder.path());
    let args = ["render", CORNELL, "--size", "24x23", "--frames", "1", "-q", "-o", "c.exr"];
    assert_eq!(igi_master(&args, folder.path()).status.code(), Some(0));
    assert!(refused(1, &["compare", "a.exr", "c.exr"], folder.path()).contains("24x24 and 24x23"));
}

#[test]
fn the_plan_says_what_is_left_out_and_why() {
    let folder = folder();
    let output = igi_master(&["plan", CORNELL, "--json"], folder.path());
    let plan: Value = serde_json::from_slice(&output.stdout).unwrap();
    let part = |name: &str| plan["parts"].as_array().unwrap().iter().find(|part| part["name"] == name).unwrap().clone();
    assert_eq!(part("virtual lights")["used"], true);
    assert_eq!(part("caustic photons")["used"], false);
    assert_eq!(part("caustic photons")["why"], "no mirror and no glass");
    let photons = &part("caustic photons")["saves"][0];
    assert_eq!((photons["amount"].as_u64(), photons["unit"].as_str()), (Some(2000), Some("photon paths a light set")));
    assert_eq!(part("virtual lights")["saves"].as_array().unwrap().len(), 0, "what is used saves nothing");
    let said = igi_master(&["plan", CORNELL], folder.path()).stdout;
    assert!(String::from_utf8_lossy(&said).contains("saves 2000 photon paths a light set"));
}

#[test]
fn without_workers_it_gives_up_after_the_wait_with_code_4() {
    let folder = folder();
    let args = ["render", CORNELL, "--size", "8x8", "--listen", "127.0.0.1:0", "--wait", "0.3", "-o", "a.png"];
    let said = refused(4, &args, folder.path());
    assert!(said.contains("waiting for workers"), "{said}");
    assert!(files(folder.path()).is_empty());
}

#[cfg(unix)]
#[test]
fn an_interrupt_without_any_worker_ends_at_once() {
    let folder = folder();
    let mut command = Command::new(env!("CARGO_BIN_EXE_igi-master"));
    command.args(["render", CORNELL, "-o", "a.exr", "--listen", "127.0.0.1:0", "--json"]).current_dir(folder.path());
    command.stdout(std::process::Stdio::piped()).stderr(std::process::Stdio::piped());
    let mut child = command.spawn().unwrap();
    // It says where it listens before it waits.
    let mut lines = std::io::BufRead::lines(std::io::BufReader::new(child.stdout.take().unwrap()));
    assert!(lines.by_ref().any(|line| line.unwrap().contains("\"progress\"")));
    let kill = Command::new("kill").args(["-TERM", &child.id().to_string()]).status().unwrap();
    assert!(kill.success());
    lines.for_each(drop);
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(130));
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(said.contains("nothing was saved"), "{said}");
    assert!(files(folder.path()).is_empty());
}

#[cfg(unix)]
#[test]
fn an_interrupt_finishes_the_frame_and_saves_it() {
    let folder = folder();
    let mut command = Command::new(env!("CARGO_BIN_EXE_igi-master"));
    let args = ["render", CORNELL, "--size", "64x48", "--seconds", "600", "-o", "a.exr", "--json"];
    command.args(args).current_dir(folder.path()).stdout(std::process::Stdio::piped());
    let mut child = command.stderr(std::process::Stdio::null()).spawn().unwrap();

    // The first progress line proves that it is under way.
    let mut lines = std::io::BufRead::lines(std::io::BufReader::new(child.stdout.take().unwrap()));
    assert!(lines.by_ref().any(|line| line.unwrap().contains("\"progress\"")));
    std::thread::sleep(Duration::from_millis(300));
    let kill = Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap();
    assert!(kill.success());
    let rest: Vec<String> = lines.map(Result::unwrap).collect();
    assert_eq!(child.wait().unwrap().code(), Some(130));
    assert!(rest.iter().any(|line| line.contains("\"interrupted\"")), "{rest:?}");
    assert_eq!(files(folder.path()), [folder.path().join("a.exr")]);
    assert!(attribute(&folder.path().join("a.exr"), "frames").parse::<u32>().unwrap() >= 1);
}

#[test]
fn what_a_master_takes_in_is_measured_with_answers_to_all_that_is_asked() {
    let folder = folder();
    let flags =
        ["--ingest", "--workers", "2", "--worker-threads", "1", "--size", "96x72", "--seconds", "0.5", "--json"];
    let output = igi_master(&[&["bench", CORNELL], &flags[..]].concat(), folder.path());
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success() && !said.contains("cannot answer"), "{said}");
    let first = output.stdout.split(|byte| *byte == b'\n').next().unwrap_or_default();
    let measured: Value = serde_json::from_slice(first).expect("a JSON object a line");
    let phases = measured["phases"].as_array().expect("phases");
    assert!(phases.len() == 3 && phases.iter().all(|phase| phase["answers"].as_u64() > Some(0)), "{measured}");
}
