//! Bits that must not change: pictures, checkpoints and recordings of earlier programs, in `tests/golden` (its README says
//! what is kept there, and how it is renewed).
//!
//! Neither the number of threads nor the instructions that a processor has make a difference to a bit, so the same hashes
//! hold on every machine.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::Value;
use sha2::{Digest, Sha256};
use tests::programs::program;

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("tests/ lies in the workspace").to_path_buf()
}

fn golden(name: &str) -> PathBuf {
    root().join("tests/golden").join(name)
}

fn renews() -> bool {
    std::env::var_os("IGI_RENEW_GOLDEN").is_some()
}

/// What `igi-master` says, one event a line, once it has ended well.
fn events(arguments: &[&str]) -> Vec<Value> {
    let mut command = Command::new(program("igi-master"));
    command.args(arguments).args(["--json", "--quiet"]).current_dir(root());
    let output = command.output().expect("igi-master runs");
    assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
    let lines = String::from_utf8(output.stdout).expect("text");
    lines.lines().map(|line| serde_json::from_str(line).expect("one JSON object a line")).collect()
}

/// The hashes of all pictures that were drawn; of a session's one, for all.
fn drawn(events: &[Value]) -> Vec<&str> {
    let field = |event: &Value| match event["event"].as_str() {
        Some("picture") => Some("raw_sha256"),
        Some("replayed") => Some("sha256"),
        _ => None,
    };
    events.iter().filter_map(|event| event[field(event)?].as_str()).collect()
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

/// What a command draws and what it saves, in two hashes.
fn hashes(command: &str, threads: usize) -> [String; 2] {
    let folder = tempfile::tempdir().expect("a folder");
    let is_series = command.contains("--frames-range");
    let name = if is_series { "%02d.exr" } else { "picture.exr" };
    let (output, workers) = (folder.path().join(name), format!("embedded:{threads}"));
    let output = output.to_str().expect("text");
    let arguments: Vec<&str> = command.split(' ').chain(["-o", output, "--workers", &workers]).collect();
    let events = events(&arguments);
    let drawn = match drawn(&events)[..] {
        [] => panic!("{command}: no picture was drawn"),
        [one] => one.to_owned(),
        ref several => hex(&Sha256::digest(several.concat())),
    };
    let mut saved: Vec<_> =
        fs::read_dir(folder.path()).expect("it is there").map(|entry| entry.unwrap().path()).collect();
    saved.sort();
    let last = saved.last().expect("a picture is saved");
    let saved = runtime::files::read_picture(last).expect("it can be read").sha256();
    [drawn, hex(&saved)]
}

/// A line of `hashes.txt`: what was drawn, what was saved, the command.
fn row(line: &str) -> Option<[&str; 3]> {
    let words: Vec<&str> = line.splitn(3, ' ').collect();
    words.try_into().ok().filter(|_| !line.starts_with('#'))
}

#[test]
fn commands_draw_the_bits_that_they_drew() {
    let path = golden("hashes.txt");
    let table = fs::read_to_string(&path).expect("it is there");
    let (mut renewed, mut changed) = (String::new(), String::new());
    for (number, line) in table.lines().enumerate() {
        if let Some([drawn, saved, command]) = row(line) {
            let threads = 1 + number % 3;
            let now = hashes(command, threads);
            if now != [drawn, saved] {
                changed += &format!("\n{command}");
            }
            renewed += &format!("{} {command}\n", now.join(" "));
        } else {
            renewed += &format!("{line}\n");
        }
    }
    if renews() {
        fs::write(&path, renewed).expect("it can be written");
    } else {
        assert!(changed.is_empty(), "other bits than before:{changed}");
    }
}

/// The picture of which two frames are kept, as it stands in `hashes.txt` when it is done.
const KEPT: &str = "render scenes/cornell_spheres --size 16x12 --photons 300";
const DONE: &str = "--frames 7";

fn render_kept(frames: &str, checkpoint: &Path) -> Vec<Value> {
    let folder = tempfile::tempdir().expect("a folder");
    let output = folder.path().join("picture.exr");
    let more = ["-o", output.to_str().expect("text"), "--checkpoint", checkpoint.to_str().expect("text")];
    events(&[&KEPT.split(' ').chain(frames.split(' ')).collect::<Vec<_>>()[..], &more].concat())
}

#[test]
fn a_checkpoint_of_before_goes_on_to_the_bits_of_a_picture_that_was_never_interrupted() {
    let (path, folder) = (golden("checkpoint/picture"), tempfile::tempdir().expect("a folder"));
    if renews() {
        render_kept("--frames 2", folder.path());
        fs::create_dir_all(golden("checkpoint")).expect("it can be made");
        fs::copy(folder.path().join("picture"), path).expect("it can be written");
        return;
    }
    fs::copy(path, folder.path().join("picture")).expect("it is there");
    let events = render_kept(DONE, folder.path());
    let resumed = events.iter().find(|event| event["event"] == "resumed").expect("it goes on");
    assert_eq!(resumed["frames"], 2);
    let table = fs::read_to_string(golden("hashes.txt")).expect("it is there");
    let command = format!("{KEPT} {DONE}");
    let truth = table.lines().filter_map(row).find(|[.., line]| *line == command).expect("it is among the commands");
    assert_eq!(drawn(&events), [truth[0]]);
}
