//! Edits are saved as a scene, which every command reads: nothing that a designer did is lost, and nothing is said to be
//! kept that is not.

use std::path::{Path, PathBuf};
use std::process::Command;

use frame::Picture;
use serde_json::{Value, json};
use tests::programs::program;

use super::master::{Master, Watcher};
use super::page::Page;
use super::room;
use super::webdriver::Driver;

const FLAGS: [&str; 8] = ["--size", "96x72", "--rest-after", "2", "--preset", "draft", "--workers", "embedded:2"];

fn master(words: &[&str], paths: &[(&str, &Path)]) {
    let mut command = Command::new(program("igi-master"));
    command.args(words);
    for (flag, path) in paths {
        command.args((!flag.is_empty()).then_some(flag)).arg(path);
    }
    let output = command.output().expect("igi-master runs");
    assert!(output.status.success(), "{words:?}: {}", String::from_utf8_lossy(&output.stderr));
}

/// A picture of a scene at another size than it was edited at.
fn render(scene: &Path, into: &Path) -> Picture {
    let words = ["render", "--size", "64x48", "--frames", "3", "--quiet", "--workers", "embedded:2"];
    master(&words, &[("", scene), ("-o", into)]);
    runtime::files::read_picture(into).expect("an EXR")
}

/// The scene with the third candle as strong as this, written by hand.
fn by_hand(strength: f32) -> (tempfile::TempDir, Picture) {
    let folder = tempfile::tempdir().expect("a folder");
    room::write_candles(folder.path(), [2.0, 2.0, strength, 2.0]);
    let picture = render(folder.path(), &folder.path().join("hand.exr"));
    (folder, picture)
}

fn saved_path(saved: &Value) -> PathBuf {
    saved["file"].as_str().or(saved["path"].as_str()).expect("it says where").into()
}

fn dimmed(light: &Value, factor: f64) -> Value {
    let mut light = light.clone();
    for channel in light["Point"]["intensity"].as_array_mut().expect("a point light") {
        *channel = json!(channel.as_f64().expect("a number") * factor);
    }
    light
}

#[tokio::test]
async fn the_third_candle_is_dimmed_saved_and_rendered_at_another_size() {
    let folder = tempfile::tempdir().expect("a folder");
    room::write_candles(folder.path(), [2.0; 4]);
    let mut first = Master::at("127.0.0.1:0", folder.path(), &FLAGS);
    let mut watcher = Watcher::join(&first).await;
    let welcome = watcher.recv("welcome").await;
    let names = welcome["scene"]["light_names"].as_array().expect("names");
    let third = names.iter().position(|name| name == "candle 3").expect("the third candle");
    let value = dimmed(&welcome["scene"]["lights"][third], 0.4);
    let dim = json!({ "Light": { "light": third, "value": value } });
    watcher.send(json!({ "say": "edit", "changes": [dim], "gesture": 1 })).await;
    watcher.send(json!({ "say": "save" })).await;
    let saved = watcher.recv("saved").await;
    assert_eq!(saved["edits"], 1, "{saved}");
    let path = saved_path(&saved);
    assert!(path.starts_with(folder.path()) && path.to_string_lossy().ends_with(".edited.json"), "{saved}");
    let text = std::fs::read_to_string(&path).expect("a file");
    assert!(text.contains("\"scene\": \"scene.json\"") && text.contains("\"of\":\"candle 3\""), "{text}");
    let end = first.interrupted("saved_scene");
    assert_eq!((&end["is_saved"], &end["edits"]), (&json!(true), &json!(1)), "{end}");
    drop(first);

    // Another size, and other commands.
    let picture = render(&path, &folder.path().join("edited.exr"));
    let (_hand, expected) = by_hand(0.8);
    assert_eq!(picture.sha256(), expected.sha256(), "as if it had been written so");
    assert_ne!(picture.sha256(), by_hand(2.0).1.sha256(), "and not as it was");
    let exported = folder.path().join("mitsuba");
    master(&["export"], &[("", &path), ("--mitsuba", &exported)]);
    let xml = std::fs::read_to_string(exported.join("scene.xml")).expect("it is written");
    assert_eq!(xml.matches("value=\"0.8, 0.8, 0.8\"").count(), 1, "{xml}");
    let reference = folder.path().join("reference.exr");
    let words = ["reference", "--size", "16x12", "--samples", "4", "--quiet", "--workers", "embedded:2"];
    master(&words, &[("", &path), ("-o", &reference)]);

    // Opened again, it is as it was, and goes on in the same file.
    let mut second = Master::at("127.0.0.1:0", &path, &FLAGS);
    let mut watcher = Watcher::join(&second).await;
    let welcome = watcher.recv("welcome").await;
    assert_eq!(welcome["scene"]["lights"][third]["Point"]["intensity"], json!([0.8, 0.8, 0.8]), "{welcome}");
    let off = json!({ "Visible": { "object": 2, "visible": false } });
    watcher.send(json!({ "say": "edit", "changes": [off], "gesture": 1 })).await;
    watcher.send(json!({ "say": "save" })).await;
    let saved = watcher.recv("saved").await;
    assert_eq!((saved_path(&saved), &saved["edits"]), (path, &json!(2)));
    watcher.send(json!({ "say": "undo" })).await;
    while watcher.recv("edited").await["changes"][0]["Visible"]["visible"] != true {}
    let end = second.interrupted("saved_scene");
    assert_eq!((&end["is_saved"], &end["edits"]), (&json!(false), &json!(1)), "it was undone since: {end}");
}

#[tokio::test]
async fn beside_a_recording_the_scene_is_saved_by_itself_and_nothing_is_said_to_be_saved_that_is_not() {
    let folder = tempfile::tempdir().expect("a folder");
    room::write_candles(folder.path(), [2.0; 4]);
    let hide = json!({ "say": "edit", "changes": [{ "Visible": { "object": 2, "visible": false } }] });
    let mut plain = Master::at("127.0.0.1:0", folder.path(), &FLAGS);
    let mut watcher = Watcher::join(&plain).await;
    watcher.send(hide.clone()).await;
    while watcher.recv("edited").await["changes"][0]["Visible"].is_null() {}
    let end = plain.interrupted("saved_scene");
    assert_eq!((&end["is_saved"], &end["path"]), (&json!(false), &Value::Null), "{end}");
    drop(plain);

    let recording = folder.path().join("walk.igis");
    let record = recording.to_str().expect("text");
    let mut recorded = Master::at("127.0.0.1:0", folder.path(), &[&FLAGS[..], &["--record", record]].concat());
    let mut watcher = Watcher::join(&recorded).await;
    watcher.send(hide).await;
    while watcher.recv("edited").await["changes"][0]["Visible"].is_null() {}
    let end = recorded.interrupted("saved_scene");
    assert_eq!((saved_path(&end), &end["is_saved"]), (folder.path().join("walk.scene.json"), &json!(true)), "{end}");
    let scene = scenes::read::load(&folder.path().join("walk.scene.json")).expect("a scene").scene;
    assert!(!scene.objects[2].visible);
}

#[test]
fn in_a_browser_a_slider_and_ctrl_s_do_the_same_and_nothing_is_lost() {
    let Some(driver) = Driver::start() else { return };
    let folder = tempfile::tempdir().expect("a folder");
    room::write_candles(folder.path(), [2.0; 4]);
    let master = Master::at("127.0.0.1:0", folder.path(), &FLAGS);
    let page = Page::open(&driver, [1280, 800], false, &master.url);
    page.at_rest();
    page.run("[...document.querySelectorAll('#lamps button:not(.solo)')].find((b) => b.textContent.includes('candle 3')).click()");
    page.until("document.querySelector('#selection .title').textContent === 'candle 3'");
    page.after(|| {
        drop(page.get(
            "(() => { const s = document.querySelector('#selection input[type=range]');
              s.value = Math.log10(0.8); s.dispatchEvent(new Event('input')); return true; })()",
        ));
    });
    page.keys(&[CONTROL, "s"]);
    page.until(
        "!document.getElementById('toast').hidden && document.getElementById('toast').textContent.startsWith('Saved')",
    );
    page.photograph("saved_scene");
    let path = std::fs::read_dir(folder.path()).expect("a folder").filter_map(|entry| Some(entry.ok()?.path()));
    let path = path.into_iter().find(|path| path.to_string_lossy().ends_with(".edited.json")).expect("it is saved");
    let scenes::Light::Point { intensity, .. } = scenes::read::load(&path).expect("a scene").scene.lights[2] else {
        panic!("a point light")
    };
    assert!((intensity.x - 0.8).abs() < 1e-5, "{intensity}");
    page.assert_content();
    drop((page, master));

    // Started again, the page has it dimmed; and it is drawn so, at another size.
    let again = Master::at("127.0.0.1:0", &path, &FLAGS);
    let page = Page::open(&driver, [1280, 800], false, &again.url);
    page.at_rest();
    assert_eq!(page.get("window.igi.scene.lights[2].Point.intensity[0].toFixed(4)"), "0.8000");
    page.click(page.middle_of("#save"));
    let picture = render(&path, &folder.path().join("edited.exr"));
    let off = |(_, other): (tempfile::TempDir, Picture)| {
        let pairs = picture.pixels.iter().zip(&other.pixels);
        pairs.map(|(a, b)| f64::from((*a - *b).abs().element_sum())).sum::<f64>() / picture.pixels.len() as f64
    };
    let (same, before) = (off(by_hand(0.8)), off(by_hand(2.0)));
    assert!(same < 1e-3 && before > 0.05, "{same} {before}");
}

#[test]
fn a_view_has_a_name_a_picture_and_its_lamps_in_the_session_and_in_the_saved_scene() {
    let Some(driver) = Driver::start() else { return };
    let folder = tempfile::tempdir().expect("a folder");
    room::write_candles(folder.path(), [2.0; 4]);
    let master = Master::at("127.0.0.1:0", folder.path(), &FLAGS);
    let page = Page::open(&driver, [1280, 800], false, &master.url);
    page.at_rest();
    let day = page.fingerprint();
    let third = "window.igi.scene.lights[2].Point.intensity[0]";
    let click = |selector: &str| page.run(&format!("document.querySelector('{selector}').click()"));

    // The third candle is out; the view is called so, and remembers it.
    page.after(|| click("#lamps input[aria-label=\"candle 3: on\"]"));
    let evening = page.fingerprint();
    page.run(
        "document.getElementById('view-name').value = 'evening'; document.getElementById('view-lamps').checked = true",
    );
    click("#save-view");
    page.until("document.querySelector('#views img')?.naturalWidth === 96");
    page.after(|| page.keys(&[CONTROL, "z"]));
    assert_eq!((page.get(third), page.fingerprint()), (json!(2), day.clone()));
    page.run("document.getElementById('view-lamps').checked = false");
    page.after(|| page.run("document.getElementById('fov').value = 60; document.getElementById('fov').oninput()"));
    click("#save-view");
    page.until("window.igi.views.length === 2");
    page.run("const f = document.querySelectorAll('#views input')[1]; f.value = 'wide'; f.onchange()");
    page.until("window.igi.views[1].name === 'wide'");
    page.run("document.getElementById('views').scrollIntoView()");
    page.photograph("views");

    // A key leads there, lamps and all, in a step to be undone; the other one leaves lamps as they are.
    page.after(|| page.keys(&["1"]));
    page.until(&format!("{third} === 0"));
    page.at_rest();
    assert_eq!(page.fingerprint(), evening, "as it was, to the bit");
    page.after(|| page.keys(&[CONTROL, "z"]));
    assert_eq!((page.get(third), page.fingerprint()), (json!(2), day));
    page.after(|| page.run("document.querySelectorAll('#views button')[1].click()"));
    assert_eq!(
        page.get("[Math.round(window.igi.header.camera.fov_y_deg), window.igi.scene.lights[2].Point.intensity[0]]"),
        json!([60, 2])
    );

    page.keys(&[CONTROL, "s"]);
    page.until("document.getElementById('toast').textContent.startsWith('Saved')");
    let path = std::fs::read_dir(folder.path()).expect("a folder").filter_map(|entry| Some(entry.ok()?.path()));
    let path = path.into_iter().find(|path| path.to_string_lossy().ends_with(".edited.json")).expect("it is saved");
    let again = Master::at("127.0.0.1:0", &path, &FLAGS);
    let other = Page::open(&driver, [1280, 800], false, &again.url);
    other.at_rest();
    other.until("document.querySelector('#views img')?.naturalWidth === 96");
    assert_eq!(other.get("window.igi.views.map((view) => view.name).join()"), "evening,wide");
    other.after(|| other.keys(&["1"]));
    other.until(&format!("{third} === 0"));
    page.assert_content();
}

/// The key Control, in WebDriver's table of keys.
const CONTROL: &str = "\u{e009}";
