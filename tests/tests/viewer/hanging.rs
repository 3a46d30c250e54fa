//! Luminaires' files that are dropped into the viewer: a lamp gets the photometric solid, or a new one hangs where it was dropped;
//! saved, undone, recorded, kept and exported as any edit, with the light that the file says.

use std::path::Path;
use std::process::Command;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use serde_json::{Value, json};
use tests::programs::program;

use super::master::{Master, Watcher};
use super::page::Page;
use super::room;
use super::webdriver::Driver;

const FLAGS: [&str; 8] = ["--size", "96x72", "--rest-after", "4", "--preset", "draft", "--workers", "embedded:2"];
/// 100 cd straight down, 50 at 45°, none from 90° on; of one lamp of 500 lm, half of which is left where it is tilted by 90°.
const IES: &str =
    "IESNA:LM-63-2002\nTILT=INCLUDE\n1\n2\n0 90\n1 0.5\n1 500 1 3 1 1 2 0 0 0\n1 1 10\n0 45 90\n0\n100 50 0\n";
/// ∫ of what falls evenly to 0 at 90°.
const LUMENS: f64 = 200.0 * std::f64::consts::PI - 400.0;

fn hang(file: &str, text: &str, lights: &[u32], at: Option<[f64; 2]>) -> Value {
    let at = at.map(|[x, y]| json!({ "x": x, "y": y }));
    json!({ "say": "hang", "file": file, "data": STANDARD.encode(text), "lights": lights, "at": at })
}

fn near(found: &Value, expected: f64) {
    let found = found.as_f64().expect("a number");
    assert!((found - expected).abs() < 1e-3 * expected.abs().max(1.0), "{found}, not {expected}");
}

fn rendered(scene: &Path, into: &Path) -> [u8; 32] {
    let mut command = Command::new(program("igi-master"));
    command.args(["render", "--size", "64x48", "--frames", "3", "--quiet", "--workers", "embedded:2"]);
    assert!(command.arg(scene).arg("-o").arg(into).status().expect("igi-master runs").success());
    runtime::files::read_picture(into).expect("an EXR").sha256()
}

#[tokio::test]
async fn a_lamp_gets_the_light_of_a_file_that_is_sent_and_is_saved_undone_recorded_and_kept_with_it() {
    let folder = tempfile::tempdir().expect("a folder");
    room::write_candles(folder.path(), [2.0, 2.0, 0.0, 2.0]);
    let state = tempfile::tempdir().expect("a folder");
    let recording = folder.path().join("walk.igis");
    let flags = [&FLAGS[..], &["--record", recording.to_str().expect("text")]].concat();
    let mut first = Master::of_user(state.path(), "127.0.0.1:0", folder.path(), &flags);
    let mut watcher = Watcher::join(&first).await;
    let before = watcher.recv("welcome").await["scene"]["lights"][2].clone();
    watcher.recv_frame(|header| header["finished"] == true).await;
    watcher.send(hang("spot.ies", IES, &[2], None)).await;
    let edited = watcher.recv("edited").await;
    let solid = edited["solids"][0].clone();
    assert_eq!(solid["name"], "spot.ies", "{edited}");
    near(&solid["steradians"], LUMENS / 100.0);
    let lamp = watcher.recv("edited").await["changes"][0]["Light"]["value"]["Luminaire"].clone();
    assert_eq!((&lamp["position"], &lamp["solid"]), (&before["Point"]["position"], &solid["texture"]), "{lamp}");
    for channel in lamp["intensity"].as_array().expect("a colour") {
        near(channel, 100.0 / 683.0);
    }
    let hung = watcher.recv("hung").await;
    assert_eq!(hung["text"], "candle 3: 228 lm (228 lm, of 500 lm of its lamps, 100 cd at most)", "{hung}");
    watcher.recv_frame(|header| header["finished"] == true && header["beside"].is_null()).await;

    // The same again takes no more room; dimmed by hand, undone step by step.
    watcher.send(hang("spot.ies", IES, &[1], None)).await;
    let edited = watcher.recv("edited").await;
    assert_eq!((&edited["solids"], &edited["steps"]), (&json!([]), &json!([2, 0])), "{edited}");
    watcher.send(json!({ "say": "undo" })).await;
    watcher.recv("edited").await;
    watcher.send(json!({ "say": "save" })).await;
    let saved = watcher.recv("saved").await;
    let file = std::path::PathBuf::from(saved["file"].as_str().expect("a file"));
    watcher.send(json!({ "say": "undo" })).await;
    let undone = watcher.recv("edited").await;
    assert_eq!((&undone["changes"][0]["Light"]["value"], &undone["steps"]), (&before, &json!([0, 2])), "{undone}");
    watcher.send(json!({ "say": "redo" })).await;
    let look = json!({ "say": "look", "origin": [0.7, 1.7, 5.2], "target": [0, 1.1, 0], "up": [0, 1, 0], "fov_y_deg": 45, "at": 77 });
    watcher.send(look).await;
    let last = watcher.recv_frame(|header| header["finished"] == true && header["beside"]["at"] == 77.0).await;

    // What cannot be hung is refused in words, with file and line, and nothing else happens.
    let torn = "IESNA:LM-63-2002\nTILT=NONE\n1 500 1 3 one";
    let large = "x".repeat((1 << 20) + 1);
    for (message, expected) in [
        (hang("a.ies", torn, &[2], None), "a.ies:3: `one` is no number"),
        (hang("a.ies", "TILT=/etc/passwd\n1 2 3", &[2], None), "a.ies:1: TILT=/etc/passwd: there is no such file"),
        (hang("a.ies", IES, &[77], None), "there is no lamp 77"),
        (hang("a.ies", IES, &[], None), "neither a lamp nor a place"),
        (hang("a.ies", &large, &[2], None), "has 1024 KiB"),
        (json!({ "say": "hang", "file": "a.ies", "data": "?" }), "did not come whole"),
    ] {
        watcher.send(message).await;
        let refused = watcher.recv("refused").await;
        let reason = refused["reason"].as_str().expect("a reason");
        assert!(reason.contains(expected), "{reason}");
    }
    let mut other = Watcher::join(&first).await;
    other.send(hang("spot.ies", IES, &[2], None)).await;
    assert!(other.recv("refused").await["reason"].as_str().is_some_and(|reason| reason.contains("has the controls")));
    // Its end keeps all there is; killed, it may lose the last second.
    first.interrupted("kept");
    drop(first);

    // The saved scene is as if the file had been named in it.
    let by_hand = tempfile::tempdir().expect("a folder");
    room::write_candles(by_hand.path(), [2.0, 2.0, 0.0, 2.0]);
    let text = std::fs::read_to_string(by_hand.path().join("scene.json")).expect("a scene");
    let candle = r#"{ "type": "point", "name": "candle 3", "position": [0.25, 1.4, 0.8], "intensity": [0, 0, 0] }"#;
    let named = r#"{ "type": "luminaire", "name": "candle 3", "position": [0.25, 1.4, 0.8], "profile": "spot.ies" }"#;
    assert!(text.contains(candle), "{text}");
    std::fs::write(by_hand.path().join("scene.json"), text.replace(candle, named)).expect("it can be written");
    std::fs::write(by_hand.path().join("spot.ies"), IES).expect("it can be written");
    let drawn = rendered(&file, &folder.path().join("saved.exr"));
    assert_eq!(drawn, rendered(by_hand.path(), &folder.path().join("hand.exr")));
    let exported = folder.path().join("mitsuba");
    let export = Command::new(program("igi-master")).arg("export").arg(&file).arg("--mitsuba").arg(&exported).status();
    assert!(export.expect("igi-master runs").success());

    // What was recorded is drawn again; and the next master goes on with undo, redo and the lamp.
    let replayed = folder.path().join("replay.png");
    let replay = Command::new(program("igi-master"))
        .arg("replay")
        .arg(&recording)
        .args(["--frames", "4", "--quiet", "--workers", "embedded:2", "-o"])
        .arg(&replayed)
        .status();
    assert!(replay.expect("igi-master runs").success());
    let replayed = image::open(&replayed).expect("a picture").to_rgb8();
    assert!(replayed == last.image, "the last picture again");
    let flags = [&FLAGS[..], &["--resume"]].concat();
    let second = Master::of_user(state.path(), "127.0.0.1:0", folder.path(), &flags);
    let mut watcher = Watcher::join(&second).await;
    assert_eq!(watcher.recv("welcome").await["steps"], json!([1, 1]), "steps undone can be made again");
    watcher.send(json!({ "say": "redo" })).await;
    let redone = loop {
        let edited = watcher.recv("edited").await;
        if edited["steps"] == json!([2, 0]) {
            break edited;
        }
    };
    let again = &redone["changes"][0]["Light"];
    assert_eq!((&again["light"], &again["value"]["Luminaire"]["solid"]), (&json!(1), &lamp["solid"]), "{redone}");
}

#[test]
fn in_a_browser_a_file_is_dropped_on_the_ceiling_on_a_lamp_and_chosen_by_a_button() {
    let Some(driver) = Driver::start() else { return };
    let folder = tempfile::tempdir().expect("a folder");
    room::write_candles(folder.path(), [2.0; 4]);
    let flags = ["--size", "320x240", "--rest-after", "8", "--preset", "draft", "--workers", "embedded:2"];
    let master = Master::at("127.0.0.1:0", folder.path(), &flags);
    let page = Page::open(&driver, [1280, 800], false, &master.url);
    page.at_rest();
    let first = page.fingerprint();
    let event = |kind: &str, [x, y]: [f64; 2], name: &str, text: &str| {
        page.run(&format!(
            "const data = new DataTransfer(); data.items.add(new File([{text:?}], '{name}'));
             document.elementFromPoint({x}, {y}).dispatchEvent(new DragEvent('{kind}', {{ bubbles: true, cancelable: true, clientX: {x}, clientY: {y}, dataTransfer: data }}));"
        ));
    };
    // On the ceiling: a new lamp there, aimed down, chosen.
    let ceiling = page.on_picture([0.3, 0.1]);
    event("dragover", ceiling, "spot.ies", IES);
    assert_eq!(page.get("document.getElementById('drop-hint').textContent"), "Luminaire's file: hangs a new lamp here");
    page.photograph("hang_hint");
    page.after(|| event("drop", ceiling, "spot.ies", IES));
    page.until("window.igi.selection?.index === 4 && document.getElementById('drop-hint').hidden");
    let lamp = page.get("window.igi.scene.lights[4].Luminaire");
    let height = |lamp: &Value| lamp["position"][1].as_f64().expect("a number");
    assert!((2.95..3.0).contains(&height(&lamp)), "{lamp}");
    assert_eq!(page.get("window.igi.scene.lights[4].Luminaire.direction.map(Math.round)"), json!([0, -1, 0]));
    assert_eq!(page.get("window.igi.scene.light_names[4]"), "spot");
    let toast = page.get("document.getElementById('toast').textContent");
    assert!(toast.as_str().is_some_and(|toast| toast.starts_with("spot: 228 lm")), "{toast}");
    assert_eq!(page.get("document.querySelector('#selection input[aria-label=\"Power, typed\"]').value"), "228 lm");
    page.photograph("hang_ceiling");
    assert_ne!(page.fingerprint(), first);

    // On the floor, with nothing chosen: above it, below the ceiling.
    page.keys(&["\u{e00c}"]);
    let floor = page.on_picture([0.5, 0.93]);
    page.after(|| event("drop", floor, "spot.ies", IES));
    page.until("window.igi.selection?.index === 5");
    let lamp = page.get("window.igi.scene.lights[5].Luminaire");
    assert!((2.95..3.0).contains(&height(&lamp)), "{lamp}");
    assert_eq!(page.get("window.igi.scene.light_names[5]"), "spot 2");
    page.photograph("hang_floor");

    // By the button, for the lamps that are chosen: where they are; one step to be undone.
    page.run("document.querySelector('#lamps .group-row button').click()");
    let chosen = page.get("[...window.igi.lamps.chosen].filter((key) => key.startsWith('light')).length");
    page.after(|| {
        page.run(&format!(
            "const data = new DataTransfer(); data.items.add(new File([{IES:?}], 'spot.ies'));
             const input = document.getElementById('luminaire-file'); input.files = data.files; input.dispatchEvent(new Event('change'));"
        ));
    });
    assert_eq!((chosen, page.get("window.igi.scene.lights.filter((l) => l.Luminaire).length")), (json!(4), json!(6)));
    assert_eq!(
        page.get("window.igi.scene.lights[0].Luminaire.position.map((v) => +v.toFixed(3))"),
        json!([-0.75, 1.4, 0.8])
    );
    page.photograph("hang_group");
    for lights in [2, 1, 0] {
        page.after(|| page.run("document.getElementById('undo').click()"));
        assert_eq!(page.get("window.igi.scene.lights.filter((l) => l.Luminaire).length"), lights);
    }
    assert_eq!(page.fingerprint(), first);

    // What is none is told at once, or by the master.
    event("drop", ceiling, "spot.exe", IES);
    assert_eq!(
        page.get("document.getElementById('toast').textContent"),
        "spot.exe: a luminaire's file ends in .ies or .ldt."
    );
    event("drop", ceiling, "bad.ies", "TILT=NONE\n1 2 x");
    page.until("document.getElementById('toast').textContent.startsWith('bad.ies:2: `x` is no number')");
    page.assert_content();
}
