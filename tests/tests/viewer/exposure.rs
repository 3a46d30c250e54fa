//! How bright a picture is while no exposure is chosen: lights in candela and lux may have any strength.

use std::path::Path;
use std::process::Command;

use serde_json::Value;
use tests::programs::program;

use super::master::{Master, Watcher};
use super::room;

const FLAGS: [&str; 6] = ["--rest-after", "2", "--preset", "draft", "--workers", "embedded:2"];

/// Stops, as the first viewer learns them; `is_right` says whether these are they.
async fn stops(watcher: &mut Watcher, is_right: impl Fn(f64) -> bool) -> f64 {
    let stops = |knobs: &Value| knobs["tone"]["exposure"].as_f64().expect("a number");
    let mut now = stops(&watcher.recv("welcome").await["knobs"]);
    while !is_right(now) {
        now = stops(&watcher.recv("knobs").await);
    }
    now
}

#[tokio::test]
async fn lights_in_candela_are_exposed_by_the_first_picture_alike_on_all_screens() {
    let folder = tempfile::tempdir().expect("a folder");
    let scene = room::write_candela(folder.path());
    let mut chosen = Vec::new();
    for [width, height] in [[96, 72], [200, 60]] {
        let master = Master::at("127.0.0.1:0", &scene, &FLAGS);
        let mut watcher = Watcher::join(&master).await;
        watcher.send(serde_json::json!({ "say": "shape", "width": width, "height": height })).await;
        chosen.push(stops(&mut watcher, |stops| stops != 0.0).await);
        let fits = |header: &Value| header["camera"]["width"] == width && header["camera"]["height"] == height;
        let seen = watcher.recv_frame(|header| fits(header) && header["finished"] == true).await;
        assert_eq!(seen.header["frames"], 2, "it goes on to where it rests");
        let lit: Vec<f64> = seen.image.as_raw().iter().filter(|code| **code > 0).map(|code| f64::from(*code)).collect();
        let mean = lit.iter().sum::<f64>() / lit.len() as f64;
        assert!((80.0..180.0).contains(&mean), "{mean} of 255");
    }
    assert!(chosen[0] > 2.0 && chosen[0] == chosen[1], "{chosen:?}");

    let chosen = [&FLAGS[..], &["--exposure", "-1.5"]].concat();
    let master = Master::at("127.0.0.1:0", &scene, &chosen);
    let mut watcher = Watcher::join(&master).await;
    watcher.recv_frame(|header| header["finished"] == true).await;
    let mut again = Watcher::join(&master).await;
    let welcome = again.recv("welcome").await;
    assert_eq!(welcome["knobs"]["tone"]["exposure"], -1.5);
    assert_eq!(welcome["scene"]["unit"], "as in the file: lights in cd and lx");
}

#[tokio::test]
async fn scenes_in_watts_are_shown_as_they_are() {
    let folder = tempfile::tempdir().expect("a folder");
    room::write_lamps(folder.path());
    let master = Master::at("127.0.0.1:0", folder.path(), &FLAGS);
    Watcher::join(&master).await.recv_frame(|header| header["finished"] == true).await;
    let mut again = Watcher::join(&master).await;
    assert_eq!(stops(&mut again, |_| true).await, 0.0);
}

#[test]
fn files_are_exposed_alike() {
    let folder = tempfile::tempdir().expect("a folder");
    let candela = room::write_candela(folder.path());
    room::write_lamps(folder.path());
    let png = |scene: &Path, flags: &[&str]| {
        let path = folder.path().join("a.png");
        let mut command = Command::new(program("igi-master"));
        command.arg("render").arg(scene).args(["--size", "80x60", "--frames", "2", "--preset", "draft", "-o"]);
        let output = command.arg(&path).args(flags).output().expect("igi-master runs");
        assert!(output.status.success());
        (std::fs::read(path).expect("a picture"), String::from_utf8_lossy(&output.stderr).into_owned())
    };
    let (chosen, text) = png(&candela, &[]);
    let line = text.lines().find(|line| line.starts_with("exposure ")).expect("it says so");
    let stops: f32 = line.split(' ').nth(1).and_then(|stops| stops.parse().ok()).expect("a number");
    assert!(stops > 2.0 && line.contains("--exposure EV"), "{line}");
    assert_eq!(chosen, png(&candela, &["--exposure", "auto"]).0);
    let (plain, text) = png(&candela, &["--exposure", "0"]);
    assert!(chosen != plain && !text.contains("exposure 0"), "{text}");
    let watts = folder.path().join("scene.json");
    assert_eq!(png(&watts, &[]).0, png(&watts, &["--exposure", "0"]).0);
}
