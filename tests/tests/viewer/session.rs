//! What people have done outlives the master.

use std::path::Path;
use std::time::Duration;

use serde_json::{Value, json};

use super::master::{Master, Watcher};
use super::room;

const FLAGS: [&str; 8] = ["--size", "96x72", "--rest-after", "4", "--preset", "draft", "--workers", "embedded:2"];

fn start(user: &Path, scene: &Path, more: &[&str]) -> Master {
    Master::of_user(user, "127.0.0.1:0", scene, &[&FLAGS[..], more].concat())
}

/// The files of sessions that are kept.
pub fn kept(user: &Path) -> Vec<Value> {
    let folder = user.join("igi/sessions");
    let slots = std::fs::read_dir(folder).into_iter().flatten().map(|slot| slot.expect("an entry").path());
    let read = |slot: std::path::PathBuf| std::fs::read(slot.join("session.json")).ok();
    slots.filter_map(read).map(|bytes| serde_json::from_slice(&bytes).expect("a whole file")).collect()
}

pub async fn until(what: &str, is_so: impl Fn() -> bool) {
    for _ in 0..1200 {
        if is_so() {
            return;
        }
        tokio::time::sleep(Duration::from_millis(100)).await;
    }
    panic!("waited in vain until {what}");
}

fn finished(header: &Value) -> bool {
    header["finished"] == true
}

/// Looks from elsewhere, moves the box (which moves by itself) at a time, turns the lamp off, saves a view.
async fn work(watcher: &mut Watcher) {
    let camera = watcher.recv("welcome").await["camera"].clone();
    let mut look = camera.clone();
    look["say"] = json!("look");
    look["origin"][0] = json!(1.0);
    watcher.send(look).await;
    let place = json!({ "linear": [1, 0, 0, 0, 1, 0, 0, 0, 1], "translation": [0.4, 0, 0.5] });
    let moved = json!({ "Transform": { "object": 2, "scene_from_object": place } });
    watcher.send(json!({ "say": "edit", "changes": [{ "Time": 2.0 }], "gesture": 1 })).await;
    watcher.send(json!({ "say": "edit", "changes": [moved], "gesture": 2 })).await;
    let off = json!({ "Spot": {
        "position": [-1, 2.5, 1], "direction": [0, -1, 0], "intensity": [0, 0, 0], "cos_inner": 0.8, "cos_outer": 0.7 } });
    watcher.send(json!({ "say": "edit", "changes": [{ "Light": { "light": 0, "value": off } }], "gesture": 3 })).await;
    watcher.send(json!({ "say": "tone", "exposure": 0.75, "operator": "aces" })).await;
    let mut view = camera;
    view["say"] = json!("save_view");
    watcher.send(view).await;
    watcher.recv("views").await;
}

/// Nothing asks a master that is killed: what it did not keep in time is lost.
#[tokio::test]
async fn a_killed_master_loses_nothing_that_is_older_than_a_moment() {
    let (folder, user) = (tempfile::tempdir().expect("a folder"), tempfile::tempdir().expect("a folder"));
    room::write_moving(folder.path());
    let first = start(user.path(), folder.path(), &[]);
    let mut watcher = Watcher::join(&first).await;
    work(&mut watcher).await;
    let is_shown =
        |header: &Value| finished(header) && (header["camera"]["origin"][0].as_f64().unwrap_or(0.0) - 1.0).abs() < 1e-6;
    let mut seen = watcher.recv_frame(is_shown).await;
    while let Ok(next) = tokio::time::timeout(Duration::from_millis(1500), watcher.recv_frame(is_shown)).await {
        seen = next;
    }
    until("all is kept", || {
        kept(user.path()).first().is_some_and(|session| {
            session["edits"].as_array().map(Vec::len) == Some(3)
                && session["views"].as_array().map(Vec::len) == Some(1)
                && session["tone"]["exposure"] == 0.75
        })
    })
    .await;
    drop(first);

    // The next one offers it, and shows the files until the offer is answered. It is not: nothing is lost.
    let mut second = start(user.path(), folder.path(), &[]);
    let mut watcher = Watcher::join(&second).await;
    let offer = watcher.recv("offer").await["offer"].clone();
    assert_eq!((&offer["edits"], &offer["files_changed"]), (&json!(3), &json!(false)), "{offer}");
    watcher.send(json!({ "say": "edit", "changes": [{ "Visible": { "object": 1, "visible": false } }] })).await;
    until("its own session is kept beside", || kept(user.path()).len() == 2).await;
    watcher.send(json!({ "say": "undo" })).await;
    watcher.recv("edited").await;
    watcher.recv("edited").await;
    let end = second.interrupted("kept");
    assert_eq!(end["edits"], 0, "{end}");
    drop(second);

    // Taken up: the same picture, the same steps to be undone, the lamp's colour, the view.
    let mut third = start(user.path(), folder.path(), &[]);
    let mut watcher = Watcher::join(&third).await;
    assert_eq!(watcher.recv("offer").await["offer"]["edits"], 3);
    watcher.send(json!({ "say": "take_up" })).await;
    let edited = watcher.recv("edited").await;
    assert_eq!(edited["steps"], json!([3, 0]), "{edited}");
    assert!(watcher.recv("hues").await["hues"]["lights"]["0"].is_array());
    assert_eq!(watcher.recv("views").await["views"].as_array().map(Vec::len), Some(1));
    assert_eq!(watcher.recv("offer").await["offer"], Value::Null);
    let is_same = |header: &Value| is_shown(header) && header["world"].as_u64() > Some(0);
    let mut again = watcher.recv_frame(is_same).await;
    while again.image != seen.image {
        again = watcher.recv_frame(is_same).await;
    }
    for left in [2, 1, 0] {
        watcher.send(json!({ "say": "undo" })).await;
        assert_eq!(watcher.recv("edited").await["steps"][0], left);
    }
    watcher.send(json!({ "say": "redo" })).await;
    watcher.recv("edited").await;
    let end = third.interrupted("kept");
    let path = end["path"].as_str().expect("it says where");
    assert!(end["edits"] == 1 && Path::new(path).is_file(), "{end}");
    drop(third);

    // By the command line; and forgotten.
    let fourth = start(user.path(), folder.path(), &["--resume"]);
    let mut watcher = Watcher::join(&fourth).await;
    assert_eq!(watcher.recv("welcome").await["steps"], json!([1, 2]));
    drop(fourth);
    let mut fifth = start(user.path(), folder.path(), &["--fresh"]);
    let mut watcher = Watcher::join(&fifth).await;
    assert_eq!(watcher.recv("views").await["views"].as_array().map(Vec::len), Some(1), "views are kept");
    assert_eq!(watcher.recv("offer").await["offer"], Value::Null);
    fifth.interrupted("kept");
    assert!(kept(user.path()).iter().all(|session| session["edits"] == json!([])), "{:?}", kept(user.path()));
}

#[tokio::test]
async fn when_the_files_have_changed_what_fits_is_taken_up_and_the_rest_named() {
    let (folder, user) = (tempfile::tempdir().expect("a folder"), tempfile::tempdir().expect("a folder"));
    room::write_moving(folder.path());
    let mut first = start(user.path(), folder.path(), &[]);
    let mut watcher = Watcher::join(&first).await;
    work(&mut watcher).await;
    let hide = json!({ "Visible": { "object": 1, "visible": false } });
    watcher.send(json!({ "say": "edit", "changes": [hide] })).await;
    // It was handled, and nothing more has to be waited for.
    while watcher.recv("edited").await["changes"][0]["Visible"].is_null() {}
    first.interrupted("kept");
    drop(first);
    assert_eq!(kept(user.path())[0]["edits"].as_array().map(Vec::len), Some(4));

    // The spot has another cone in the file now.
    let file = folder.path().join("scene.json");
    let text = std::fs::read_to_string(&file).expect("a scene");
    std::fs::write(&file, text.replace("\"outer_deg\": 40", "\"outer_deg\": 50")).expect("it can be written");
    let second = start(user.path(), folder.path(), &[]);
    let mut watcher = Watcher::join(&second).await;
    assert_eq!(watcher.recv("offer").await["offer"]["files_changed"], true);
    watcher.send(json!({ "say": "take_up" })).await;
    let notice = watcher.recv("notice").await["text"].as_str().unwrap_or_default().to_owned();
    assert!(notice.contains("3 edits") && notice.contains("Desk lamp") && notice.contains("changed"), "{notice}");
}

#[tokio::test]
async fn as_many_views_are_saved_as_people_want_until_there_is_no_room_and_then_it_is_refused() {
    let master = Master::start("cornell", &FLAGS);
    let mut watcher = Watcher::join(&master).await;
    let mut view = watcher.recv("welcome").await["camera"].clone();
    view["say"] = json!("save_view");
    watcher.recv("views").await;
    for number in 1..=runtime::live::kept::VIEWS_MAX {
        watcher.send(view.clone()).await;
        assert_eq!(watcher.recv("views").await["views"].as_array().map(Vec::len), Some(number));
    }
    watcher.send(view.clone()).await;
    let reason = watcher.recv("refused").await["reason"].as_str().unwrap_or_default().to_owned();
    assert!(reason.contains("views are saved"), "{reason}");
    watcher.send(json!({ "say": "forget_view", "number": 9 })).await;
    let left = watcher.recv("views").await["views"].as_array().map(Vec::len);
    assert_eq!(left, Some(runtime::live::kept::VIEWS_MAX - 1));
}
