//! A session that was recorded, drawn again.

use std::path::Path;
use std::process::{Command, Output};
use std::time::Duration;

use serde_json::{Value, json};
use tests::programs::program;

use super::master::{Master, Watcher};
use super::room;

const FLAGS: [&str; 10] =
    ["--size", "96x72", "--rest-after", "4", "--preset", "draft", "--filter", "paper", "--workers", "embedded:2"];

/// After the last picture there is none for so long.
const QUIET: Duration = Duration::from_millis(800);

fn run(session: &Path, picture: &Path, workers: &str) -> Output {
    let mut command = Command::new(program("igi-master"));
    command.arg("replay").arg(session).args(["--frames", "4", "--json", "--quiet", "--workers", workers, "-o"]);
    command.arg(picture).output().expect("igi-master runs")
}

/// What a replay says: hashes of the moving pictures, and the end.
fn replay(session: &Path, picture: &Path, workers: &str) -> (Vec<Value>, Value) {
    let output = run(session, picture, workers);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let lines = String::from_utf8(output.stdout).expect("text");
    let events: Vec<Value> = lines.lines().map(|line| serde_json::from_str(line).expect("JSON")).collect();
    let moving = events.iter().filter(|event| event["event"] == "frame").map(|event| event["sha256"].clone());
    let end = events.iter().find(|event| event["event"] == "replayed").expect("it says that it is done");
    (moving.collect(), end["sha256"].clone())
}

#[tokio::test]
async fn a_replay_is_the_same_bits_each_time_and_ends_with_the_picture_that_people_saw() {
    let folder = tempfile::tempdir().expect("a folder");
    room::write(folder.path());
    let session = folder.path().join("a.session");
    let mut flags = FLAGS.to_vec();
    flags.extend(["--record", session.to_str().expect("a name")]);
    let master = Master::at("127.0.0.1:0", folder.path(), &flags);
    let mut watcher = Watcher::join(&master).await;
    let welcome = watcher.recv("welcome").await;
    watcher.recv_frame(|header| header["finished"] == true).await;

    // The camera walks, the box is dragged, the lamp dimmed, one step taken back, and a knob turned.
    let mut look = welcome["camera"].clone();
    look["say"] = json!("look");
    for step in 1..=6 {
        // For a while, a layer is looked at that moving pictures may not show.
        if let 3 | 5 = step {
            watcher.send(json!({ "say": "inspect", "layer": if step == 3 { "normal" } else { "final" } })).await;
        }
        look["origin"][0] = json!(0.6 + 0.05 * f64::from(step));
        watcher.send(look.clone()).await;
        let place = json!({ "linear": [1, 0, 0, 0, 1, 0, 0, 0, 1], "translation": [0.1 * f64::from(step), 0, 0] });
        let change = json!({ "Transform": { "object": 2, "scene_from_object": place } });
        watcher.send(json!({ "say": "edit", "changes": [change], "gesture": 1 })).await;
        // Moving or, if it was drawn so fast that the next one took its place, at rest.
        let x = look["origin"][0].as_f64().expect("a number");
        watcher
            .recv_frame(|header| header["camera"]["origin"][0].as_f64().is_some_and(|seen| (seen - x).abs() < 1e-5))
            .await;
    }
    let lamp = welcome["scene"]["materials"].as_array().expect("materials").len() - 2;
    let mut material = welcome["scene"]["materials"][lamp].clone();
    material["emission"]["value"] = json!([3, 3, 3]);
    let dimmed = json!({ "Material": { "material": lamp, "value": material } });
    watcher.send(json!({ "say": "edit", "changes": [dimmed], "gesture": null })).await;
    // The box alone is of another colour.
    let blue = welcome["scene"]["objects"][2]["materials"][0].as_u64().expect("its material");
    let mut own = welcome["scene"]["materials"][blue as usize].clone();
    own["surface"]["Diffuse"]["albedo"]["value"] = json!([0.9, 0.5, 0.1]);
    let own = json!({ "OwnMaterial": { "object": 2, "piece": null, "material": blue, "value": own } });
    watcher.send(json!({ "say": "edit", "changes": [own], "gesture": null })).await;
    watcher.send(json!({ "say": "edit", "changes": [{ "Visible": { "object": 2, "visible": false } }] })).await;
    watcher.send(json!({ "say": "undo" })).await;
    let knobs = json!({ "say": "turn", "values": { "light-samples": 5, "vpls": 7, "photons": 0 } });
    watcher.send(knobs).await;
    let mut seen = watcher.recv_frame(|header| header["finished"] == true && header["world"].as_u64() > Some(1)).await;
    // The last one: none follows.
    while let Ok(next) = tokio::time::timeout(QUIET, watcher.recv_frame(|_| true)).await {
        seen = next;
    }
    assert_eq!(seen.header["finished"], true);
    drop(master);

    let picture = folder.path().join("end.png");
    let (moving, end) = replay(&session, &picture, "embedded:1");
    assert!(moving.len() >= 6, "{} moving pictures", moving.len());
    assert_eq!(replay(&session, &picture, "embedded:3"), (moving, end), "by other workers");
    let last = image::open(&picture).expect("a picture").to_rgb8();
    assert_eq!(last, seen.image, "what was on the screen in the end");

    // A picture that cannot come is not waited for.
    let kept = std::fs::read_to_string(&session).expect("a session");
    let moving = "{\"t\":99.0,\"shown\":{\"batches\":1,\"effort\":0.25}}\n";
    std::fs::write(&session, kept + moving).expect("it can be written");
    let output = run(&session, &picture, "embedded:2");
    assert!(String::from_utf8_lossy(&output.stderr).contains("nothing that moves"), "{output:?}");
}
