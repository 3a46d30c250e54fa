//! Pictures that are saved on the way: those of an animation, one after another, and those of `--autosave`.

use std::fs;
use std::path::Path;
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};

use exr::prelude::{AttributeValue, Text};
use serde_json::Value;

const CORNELL: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../scenes/cornell");

fn igi_master(folder: &Path) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_igi-master"));
    command.current_dir(folder).env_remove("RUST_LOG").env_remove("IGI_WORKERS").env_remove("IGI_LISTEN");
    command
}

/// A bright plate that slides over a dark floor, and a lamp.
fn moving_scene(folder: &Path) {
    let obj = "mtllib s.mtl\no floor\nv -2 0 -2\nv 2 0 -2\nv 2 0 2\nv -2 0 2\nusemtl grey\nf 4 3 2 1\n\
               o plate\nv -0.5 0.5 -0.5\nv 0.5 0.5 -0.5\nv 0.5 0.5 0.5\nv -0.5 0.5 0.5\nusemtl white\nf 8 7 6 5\n";
    let mtl = "newmtl grey\nillum 1\nKd 0.3 0.3 0.3\nnewmtl white\nillum 1\nKd 0.9 0.9 0.9\n";
    let json = r#"{ "obj": "s.obj", "lights": [{ "type": "point", "position": [0, 3, 1], "intensity": [9, 9, 9] }],
        "camera": { "origin": [0, 3, 4], "target": [0, 0, 0], "fov_y_deg": 50, "width": 32, "height": 24 },
        "animation": [{ "object": "plate", "keyframes": [{ "t": 0, "translate": [-1, 0, 0] }, { "t": 1, "translate": [1, 0, 0] }] }] }"#;
    for (name, text) in [("s.obj", obj), ("s.mtl", mtl), ("s.json", json)] {
        fs::write(folder.join(name), text).unwrap();
    }
}

fn draw(folder: &Path, more: &[&str]) -> Output {
    let mut command = igi_master(folder);
    command.args(["render", "s.json", "--frames", "2", "--workers", "embedded:1", "--json"]).args(more);
    command.output().expect("the program starts")
}

fn series(folder: &Path, more: &[&str]) -> Output {
    draw(folder, &[&["--frames-range", "1..=3", "--fps", "4", "-o", "out.%03d.exr"], more].concat())
}

/// All events of a kind.
fn events(output: &Output, kind: &str) -> Vec<Value> {
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let lines = String::from_utf8_lossy(&output.stdout).into_owned();
    let all = lines.lines().map(|line| serde_json::from_str::<Value>(line).expect("JSON"));
    all.filter(|event| event["event"] == kind).collect()
}

fn hash(path: &Path) -> String {
    let image = exr::prelude::read_all_data_from_file(path).unwrap();
    match image.layer_data[0].attributes.other.get(&Text::from("igi:raw_sha256")) {
        Some(AttributeValue::Text(text)) => text.to_string(),
        other => panic!("{other:?}"),
    }
}

#[test]
fn an_animation_goes_on_where_it_was_and_every_picture_is_that_of_its_moment() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    moving_scene(folder);
    let path = |name: &str| folder.join(name);
    let drawn = events(&series(folder, &[]), "picture");
    assert_eq!(drawn.iter().map(|event| event["time"].as_f64()).collect::<Vec<_>>(), [0.25, 0.5, 0.75].map(Some));
    let hashes = ["out.001.exr", "out.002.exr", "out.003.exr"].map(|name| hash(&path(name)));
    assert!(hashes[0] != hashes[1] && hashes[1] != hashes[2], "it moves");

    draw(folder, &["--time", "0.5", "-o", "still.exr"]);
    assert_eq!(hash(&path("still.exr")), hashes[1], "the same bits as a picture of that moment alone");

    fs::remove_file(path("out.002.exr")).unwrap();
    let again = series(folder, &[]);
    let numbers: Vec<_> = events(&again, "picture").iter().map(|event| event["number"].as_u64()).collect();
    assert_eq!(numbers, [Some(2)], "only what is missing is drawn");
    assert_eq!(hash(&path("out.002.exr")), hashes[1]);
    assert!(events(&series(folder, &[]), "picture").is_empty(), "all is there");

    for (other, what) in [(["--seed", "1"], "seed"), (["--filter", "off"], "filter")] {
        let other = series(folder, &other);
        let said = String::from_utf8_lossy(&other.stderr).into_owned();
        assert_eq!(other.status.code(), Some(2), "{said}");
        assert!(said.contains(&format!("out.001.exr: is there, but of another {what}")), "{said}");
    }
}

#[test]
fn series_that_cannot_be_are_refused_before_any_work() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    moving_scene(folder);
    for (more, hint) in [
        (&["--frames-range", "0..3", "-o", "out.exr"][..], "out.%04d.exr"),
        (&["--frames-range", "3..3"], "no picture"),
        (&["--frames-range", "0..x"], "0..240"),
        (&["--frames-range", "0..3", "--fps", "0"], "--fps"),
        (&["--fps", "4"], "--frames-range"),
        (&["--frames-range", "0..3", "--autosave", "1"], "--autosave"),
    ] {
        let output = draw(folder, more);
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(2), "{more:?}: {said}");
        assert!(said.contains(hint), "{more:?}: {said}");
    }
    assert_eq!(fs::read_dir(folder).unwrap().count(), 3, "nothing was written");
}

#[test]
fn what_is_drawn_so_far_is_saved_now_and_then_and_is_always_whole() {
    let folder = tempfile::tempdir().unwrap();
    let mut command = igi_master(folder.path());
    command.args(["render", CORNELL, "--size", "64x48", "--seconds", "60", "--autosave", "0.05", "--quiet"]);
    command.args(["--workers", "embedded:1", "-o", "a.exr", "-o", "a.png"]).stdin(Stdio::null()).stderr(Stdio::null());
    let mut process = command.spawn().unwrap();
    let began = Instant::now();
    let mut seen = std::collections::BTreeSet::new();
    while seen.len() < 3 && began.elapsed() < Duration::from_secs(30) {
        if folder.path().join("a.png").is_file() {
            seen.insert(hash(&folder.path().join("a.exr")));
        }
        std::thread::sleep(Duration::from_millis(20));
    }
    process.kill().unwrap();
    process.wait().unwrap();
    assert!(seen.len() >= 3, "{} different pictures in {:?}", seen.len(), began.elapsed());
    image::open(folder.path().join("a.png")).expect("a whole picture, although the program was killed");
}
