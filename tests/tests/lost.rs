//! What is drawn is not lost, whatever goes away meanwhile: the folder of a file, that of the checkpoint, all workers.

use std::fs;
use std::path::{Path, PathBuf};

use serde_json::Value;
use tests::programs::{Process, free_address};

const SCENE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../scenes/cornell");

/// A folder with one that will go away, and one for temporary files.
struct Place(tempfile::TempDir);

impl Place {
    fn new() -> Self {
        let folder = tempfile::tempdir().expect("a folder");
        for name in ["gone", "tmp"] {
            fs::create_dir(folder.path().join(name)).expect("it can be made");
        }
        Self(folder)
    }

    fn path(&self, name: &str) -> String {
        self.0.path().join(name).to_str().expect("a readable path").to_owned()
    }

    fn master(&self, arguments: &[&str]) -> Process {
        Process::master_with(&[("TMPDIR", &self.path("tmp"))], arguments)
    }

    /// At once, whoever writes there.
    fn lose(&self) {
        fs::rename(self.path("gone"), self.path("elsewhere")).expect("it was there");
    }

    /// What was put into the folder for temporary files.
    fn copies(&self) -> Vec<PathBuf> {
        fs::read_dir(self.path("tmp")).expect("it is there").map(|entry| entry.expect("an entry").path()).collect()
    }
}

fn events(master: &mut Process) -> impl Iterator<Item = Value> + use<> {
    master.lines().map(|line| serde_json::from_str(&line).expect("one JSON object a line"))
}

/// Waits until frames are complete.
fn frames(events: &mut impl Iterator<Item = Value>) {
    let is_drawn = |event: &Value| event["event"] == "progress" && event["frames"].as_u64() > Some(0);
    events.find(is_drawn).expect("frames are drawn");
}

/// Ends it as Ctrl-C does: its exit code, and what it said.
fn interrupt(master: Process, events: impl Iterator<Item = Value>) -> (Option<i32>, String, Vec<Value>) {
    master.signal("-INT");
    let rest = events.collect();
    let (code, said) = master.end();
    (code, said, rest)
}

#[test]
fn a_file_that_cannot_be_written_costs_no_other_and_is_kept_elsewhere() {
    let place = Place::new();
    let (lost, saved) = (place.path("gone/a.exr"), place.path("a.png"));
    let what = ["render", SCENE, "--size", "48x36", "--seconds", "600", "--workers", "embedded:1", "--json"];
    let mut master = place.master(&[&what[..], &["-o", &lost, "-o", &saved]].concat());
    let mut heard = events(&mut master);
    frames(&mut heard);
    place.lose();
    let (code, said, rest) = interrupt(master, heard);
    assert_eq!(code, Some(1), "{said}");
    assert!(Path::new(&saved).is_file(), "{said}");
    assert!(rest.iter().any(|event| event["event"] == "unsaved" && event["path"] == lost.as_str()), "{rest:?}");
    let last = said.lines().last().expect("it says something");
    let copies = place.copies();
    assert_eq!(copies.len(), 1, "{said}");
    assert!(last.contains(&lost) && last.contains(copies[0].to_str().unwrap()), "{said}");
    assert_eq!(runtime::files::read_picture(&copies[0]).expect("a whole picture").width, 48);
}

#[test]
fn a_checkpoint_that_cannot_be_written_costs_no_picture() {
    let place = Place::new();
    let (kept, saved) = (place.path("gone/kept"), place.path("a.exr"));
    let what = ["render", SCENE, "--size", "48x36", "--seconds", "600", "--workers", "embedded:1", "--json"];
    let keep = ["--checkpoint", &kept, "--checkpoint-every", "0.1", "-o", &saved];
    let mut master = place.master(&[&what[..], &keep].concat());
    let mut heard = events(&mut master);
    frames(&mut heard);
    place.lose();
    frames(&mut heard);
    let (code, said, _) = interrupt(master, heard);
    assert_eq!(code, Some(130), "{said}");
    assert_eq!(said.matches("what is drawn so far was not kept").count(), 1, "once is enough: {said}");
    assert!(Path::new(&saved).is_file(), "{said}");
}

#[test]
fn a_series_stops_when_its_pictures_have_no_place() {
    let place = Place::new();
    let pattern = place.path("gone/out.%d.png");
    let what = ["render", SCENE, "--size", "16x12", "--frames", "1", "--workers", "embedded:1", "--json"];
    let mut master = place.master(&[&what[..], &["--frames-range", "0..100000", "-o", &pattern]].concat());
    let mut heard = events(&mut master);
    heard.find(|event| event["event"] == "saved").expect("pictures are saved");
    place.lose();
    heard.for_each(drop);
    let (code, said) = master.end();
    assert_eq!(code, Some(1), "{said}");
    assert!(said.lines().last().is_some_and(|last| last.contains("could not be saved, and none after it")), "{said}");
    assert!(place.copies().is_empty(), "it can be drawn again");
}

#[test]
fn a_reference_goes_on_without_a_place_and_is_kept_elsewhere() {
    let place = Place::new();
    let lost = place.path("gone/ref.exr");
    let what = ["reference", SCENE, "--size", "16x12", "--seconds", "600", "--workers", "embedded:1", "--json"];
    let mut master = place.master(&[&what[..], &["-o", &lost]].concat());
    let mut heard = events(&mut master);
    frames(&mut heard);
    place.lose();
    let (code, said, _) = interrupt(master, heard);
    assert_eq!(code, Some(1), "{said}");
    let copies = place.copies();
    assert!(copies.len() == 1 && said.contains(copies[0].to_str().unwrap()), "{said}");
    runtime::files::read_record(&copies[0]).expect("it can be gone on with");
}

#[test]
fn what_cannot_be_kept_is_found_out_before_drawing() {
    let place = Place::new();
    let file = place.path("file");
    fs::write(&file, "").expect("it can be written");
    fs::create_dir(place.path("gone/out.3.png")).expect("it can be made");
    let (inside, series) = (format!("{file}/kept"), place.path("gone/out.%d.png"));
    for (more, word) in [
        (&["--checkpoint", &inside][..], inside.as_str()),
        (&["-o", &format!("{file}/a.png")], "a.png"),
        (&["-o", &place.path("no/a.png")], "make it, or name another"),
        (&["--frames-range", "0..9", "-o", &series], "out.3.png: is a folder"),
    ] {
        let (code, said) = place.master(&[&["render", SCENE, "--seconds", "600"], more].concat()).end();
        assert_eq!(code, Some(1), "{said}");
        assert!(said.contains(word) && !said.contains("frames/s"), "{said}");
    }
}

/// A master that listens, and a worker that goes when `enough` is heard of.
fn deserted(place: &Place, size: &str, enough: impl Fn(&Value) -> bool) -> (Option<i32>, String) {
    let address = free_address().to_string();
    let what = ["render", SCENE, "--size", size, "--seconds", "3", "--json", "--no-announce"];
    let output = place.path("a.png");
    let mut master = place.master(&[&what[..], &["--listen", &address, "-o", &output]].concat());
    let mut heard = events(&mut master);
    let listening = heard.find(|event| event["event"] == "listening").expect("it listens");
    let token = listening["token_file"].as_str().expect("it keeps its token");
    let worker = Process::worker(&["--master", &address, "--token-file", token, "--threads", "1"]);
    heard.find(enough).expect("it is heard");
    worker.signal("-TERM");
    heard.for_each(drop);
    master.end()
}

#[test]
fn the_time_is_over_when_it_is_over_although_nobody_is_left() {
    let place = Place::new();
    let (code, said) =
        deserted(&place, "48x36", |event| event["event"] == "progress" && event["frames"].as_u64() > Some(0));
    assert_eq!(code, Some(0), "{said}");
    assert!(Path::new(&place.path("a.png")).is_file(), "{said}");
}

#[test]
fn who_has_no_frame_when_the_time_is_over_says_so() {
    let place = Place::new();
    // One thread needs minutes for a frame.
    let (code, said) = deserted(&place, "8000x6000", |event| event["event"] == "worker_ready");
    assert_eq!(code, Some(4), "{said}");
    assert!(said.contains("no worker was left to complete a frame"), "{said}");
    assert!(!Path::new(&place.path("a.png")).exists(), "{said}");
}
