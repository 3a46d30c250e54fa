//! Through its sockets, without a browser.

use std::process::Command;

use serde_json::{Value, json};
use tests::programs::program;
use tokio_tungstenite::tungstenite::Message;

use super::master::{Master, PATIENCE, Watcher, scene};
use super::room;

/// Small pictures that are soon at rest.
const SMALL: [&str; 6] = ["--size", "96x72", "--rest-after", "4", "--workers", "embedded:2"];

fn finished(header: &Value) -> bool {
    header["finished"] == true
}

fn moved(object: u32, x: f32) -> Value {
    let place = json!({ "linear": [1, 0, 0, 0, 1, 0, 0, 0, 1], "translation": [x, 0, 0] });
    json!({ "Transform": { "object": object, "scene_from_object": place } })
}

#[tokio::test]
async fn a_picture_at_rest_is_bit_for_bit_what_render_saves() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("a.png");
    let render = Command::new(program("igi-master"))
        .arg("render")
        .arg(scene("cornell"))
        .args(["--size", "96x72", "--frames", "4", "--quiet", "-o"])
        .arg(&path)
        .status();
    assert!(render.expect("igi-master runs").success());
    let expected = image::open(&path).expect("a picture").to_rgb8();

    let master = Master::start("cornell", &SMALL);
    let mut watcher = Watcher::join(&master).await;
    let seen = watcher.recv_frame(finished).await;
    assert_eq!((seen.header["kind"].as_str(), seen.header["frames"].as_u64()), (Some("image/png"), Some(4)));
    assert_eq!(seen.image, expected, "on the screen");
    let (head, body) = master.get("/picture.png", "");
    assert!(head.starts_with("http/1.1 200"), "{head}");
    assert_eq!(image::load_from_memory(&body).expect("a picture").to_rgb8(), expected, "downloaded");
    let (head, body) = master.get("/picture.exr", "");
    assert!(head.contains("image/x-exr") && body.starts_with(&[0x76, 0x2f, 0x31, 0x01]), "{head}");
}

#[tokio::test]
async fn edits_reach_the_workers_and_everyone_who_watches_and_can_be_taken_back() {
    let master = Master::start("cornell", &SMALL);
    let mut first = Watcher::join(&master).await;
    let welcome = first.recv("welcome").await;
    assert!(welcome["scene"]["objects"].as_array().is_some_and(|objects| !objects.is_empty()), "{welcome}");
    let before = first.recv_frame(finished).await;
    let mut second = Watcher::join(&master).await;
    let controls = second.recv("controls").await;
    assert_ne!(controls["holder"], second_number(&controls));

    // Who has no controls can only watch.
    second.send(json!({ "say": "edit", "changes": [moved(0, 1.0)], "gesture": null })).await;
    assert!(second.recv("refused").await["reason"].as_str().is_some_and(|reason| reason.contains("controls")));

    let revision = before.header["world"].as_u64().expect("a number");
    let hide = json!({ "Visible": { "object": 0, "visible": false } });
    first.send(json!({ "say": "edit", "changes": [moved(0, 0.5), hide], "gesture": 1, "at": 7.0 })).await;
    let edited = second.recv("edited").await;
    assert_eq!(edited["changes"].as_array().map(Vec::len), Some(2), "{edited}");
    let edited = |header: &Value| finished(header) && header["world"].as_u64() > Some(revision);
    let (mine, theirs) = (first.recv_frame(edited).await, second.recv_frame(edited).await);
    assert_ne!(mine.image, before.image, "something has changed");
    assert_eq!(mine.image, theirs.image, "two watchers see the same");
    assert_eq!(mine.header["beside"]["at"], 7.0, "the picture says which input it shows");

    first.send(json!({ "say": "undo" })).await;
    let undone = first.recv_frame(|header| finished(header) && header["world"].as_u64() > Some(revision + 1)).await;
    assert_eq!(undone.image, before.image, "the same scene, the same bits");

    // Hand-over is explicit.
    second.send(json!({ "say": "take" })).await;
    first.recv("asked").await;
    first.send(json!({ "say": "give", "to": welcome["you"] })).await;
    assert!(second.recv("refused").await["reason"].as_str().is_some_and(|reason| reason.contains("keeps")));
    second.send(json!({ "say": "take" })).await;
    let asked = first.recv("asked").await;
    first.send(json!({ "say": "give", "to": asked["by"] })).await;
    while second.recv("controls").await["holder"] != asked["by"] {}
    second.send(json!({ "say": "redo" })).await;
    let redone = second.recv_frame(|header| finished(header) && header["world"].as_u64() > Some(revision + 2)).await;
    assert_eq!(redone.image, mine.image);
}

#[tokio::test]
async fn where_things_are_at_a_time_is_told_and_the_time_when_it_is_taken_back() {
    let folder = tempfile::tempdir().expect("a folder");
    room::write_moving(folder.path());
    let master = Master::at("127.0.0.1:0", folder.path(), &SMALL);
    let mut watcher = Watcher::join(&master).await;
    let joined = watcher.recv("edited").await;
    assert_eq!(joined["changes"], json!([{ "Time": 0.0 }]));
    watcher.send(json!({ "say": "edit", "changes": [{ "Time": 2.0 }], "gesture": 1 })).await;
    let edited = watcher.recv("edited").await;
    let put = |edited: &Value| {
        assert_eq!(edited["poses"].as_array().map(Vec::len), Some(1), "{edited}");
        [0, 2].map(|axis| edited["poses"][0][1]["translation"][axis].as_f64().expect("a number") as f32)
    };
    let near = |[a, b]: [f32; 2], [c, d]: [f32; 2]| (a - c).abs() < 1e-5 && (b - d).abs() < 1e-5;
    assert!(edited["poses"][0][0] == 2 && near(put(&edited), [0.4, 0.0]), "{edited}");

    // It is put elsewhere there, and goes on from there: back in time, and undone.
    let place = json!({ "linear": [1, 0, 0, 0, 1, 0, 0, 0, 1], "translation": [0.4, 0, 0.5] });
    let change = json!({ "Transform": { "object": 2, "scene_from_object": place } });
    watcher.send(json!({ "say": "edit", "changes": [change], "gesture": 2 })).await;
    assert!(near(put(&watcher.recv("edited").await), [0.4, 0.5]));
    watcher.send(json!({ "say": "edit", "changes": [{ "Time": 4.0 }], "gesture": 3 })).await;
    assert!(near(put(&watcher.recv("edited").await), [0.8, 0.5]));
    let mut late = Watcher::join(&master).await;
    let joined = late.recv("edited").await;
    assert_eq!(
        joined["changes"].as_array().and_then(|changes| changes.last()),
        Some(&json!({ "Time": 4.0 })),
        "{joined}"
    );
    assert!(near(put(&joined), [0.8, 0.5]), "{joined}");
    for expected in [[0.4, 0.5], [0.4, 0.0], [0.0, 0.0]] {
        watcher.send(json!({ "say": "undo" })).await;
        let undone = watcher.recv("edited").await;
        assert!(near(put(&undone), expected), "{undone}");
    }
}

/// The newest of the viewers.
fn second_number(controls: &Value) -> Value {
    controls["viewers"].as_array().and_then(|viewers| viewers.last()).cloned().unwrap_or_default()
}

#[tokio::test]
async fn a_moving_camera_is_followed_and_then_the_picture_sharpens() {
    let master = Master::start("cornell", &SMALL);
    let mut watcher = Watcher::join(&master).await;
    let camera = watcher.recv("welcome").await["camera"].clone();
    let before = watcher.recv_frame(finished).await;
    let mut look = camera.clone();
    look["say"] = json!("look");
    let x = |value: &Value| value["origin"][0].as_f64().expect("a number");
    // On a fast machine a picture at rest may take the place of those that moved before they are sent: then on.
    let mut moving = None;
    for walk in 0..10 {
        for step in 1..=20 {
            look["origin"][0] = json!(x(&camera) + 0.02 * f64::from(20 * walk + step));
            watcher.send(look.clone()).await;
        }
        let there = |header: &Value| finished(header) && (x(&header["camera"]) - x(&look)).abs() < 1e-5;
        let seen = watcher.recv_frame(|header| header["moving"] == true || there(header)).await;
        if seen.header["moving"] == true {
            moving = Some(seen);
            break;
        }
    }
    let moving = moving.expect("moving pictures are shown");
    assert_eq!(moving.header["kind"], "image/jpeg");
    let at_rest = watcher.recv_frame(finished).await;
    assert!((x(&at_rest.header["camera"]) - x(&look)).abs() < 1e-5, "the last input won");
    assert_ne!(at_rest.image, before.image);

    // Layers, picking, the light meter.
    for layer in
        ["lux", "albedo", "normal", "distance", "samples", "error", "worker", "cost", "irradiance", "raw", "final"]
    {
        watcher.send(json!({ "say": "inspect", "layer": layer })).await;
        watcher.recv_frame(|header| header["layer"] == layer).await;
    }
    watcher.send(json!({ "say": "inspect", "layer": "lights" })).await;
    // They have been asked for only now: pictures that were under way come without them. Without any there is no other
    // picture, and this ends by its deadline.
    while watcher.recv_frame(|header| header["layer"] == "lights").await.image == at_rest.image {}
    watcher.send(json!({ "say": "pick", "x": 0.5, "y": 0.9 })).await;
    assert!(watcher.recv("picked").await["found"]["object"].is_u64());
    watcher.send(json!({ "say": "probe", "x": 0.5, "y": 0.9 })).await;
    assert!(watcher.recv("probed").await["found"]["lux"].as_f64().is_some_and(|lux| lux > 0.0));
}

#[tokio::test]
async fn the_page_is_there_and_strangers_are_not_let_in() {
    let master = Master::start("cornell", &SMALL);
    let (head, page) = master.get("/", "");
    assert!(head.starts_with("http/1.1 200") && head.contains("content-security-policy"), "{head}");
    let page = String::from_utf8(page).expect("text");
    for part in page.split("\"/assets/").skip(1).map(|rest| rest.split('"').next().unwrap_or("")) {
        let (head, body) = master.get(&format!("/assets/{part}"), "");
        assert!(head.starts_with("http/1.1 200") && !body.is_empty(), "{part}: {head}");
    }
    let status = |path: &str, headers: &str| master.get(path, headers).0[9..12].to_string();
    assert_eq!(status("/assets/../Cargo.toml", ""), "404");
    assert_eq!(status("/", "Host: evil.example\r\n"), "403");
    assert_eq!(status("/picture.png", "Origin: http://evil.example\r\n"), "403");
    let upgrade = "Connection: Upgrade\r\nUpgrade: websocket\r\nSec-WebSocket-Version: 13\r\n\
                   Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nOrigin: http://evil.example\r\n";
    assert_eq!(status("/socket", upgrade), "403");
}

#[tokio::test]
async fn another_address_wants_the_token() {
    let mut flags = SMALL.to_vec();
    flags.extend(["--viewer-token", "a-secret-of-mine"]);
    let master = Master::start("cornell", &flags);
    let status = |path: &str| master.get(path, "").0[9..12].to_string();
    assert!(master.url.ends_with("?token=a-secret-of-mine"));
    assert_eq!(status("/?token=a-secret-of-mine"), "200");
    assert_eq!(status("/assets/style.css"), "200");
    for path in ["/", "/?token=wrong", "/picture.png", "/socket", "/?token="] {
        assert_eq!(status(path), "401", "{path}");
    }
}

#[tokio::test]
async fn nonsense_does_no_harm() {
    let master = Master::start("cornell", &SMALL);
    let mut watcher = Watcher::join(&master).await;
    let mut look = watcher.recv("welcome").await["camera"].clone();
    let wrong = [
        json!({ "say": "edit", "changes": [moved(4_000_000, 0.0)], "gesture": null }),
        json!({ "say": "edit", "changes": [{ "Time": null }], "gesture": null }),
        json!({ "say": "look", "origin": [0, 0, 0], "target": [0, 0, 0], "up": [0, 1, 0], "fov_y_deg": 40 }),
        json!({ "say": "turn", "values": { "vpls": 0 } }),
        json!({ "say": "turn", "values": { "unheard-of": 1 } }),
        json!({ "say": "rate", "rate": 1e9 }),
        json!({ "say": "method", "name": "unheard of" }),
        json!({ "say": "inspect", "layer": "unheard of" }),
        json!({ "say": "give", "to": 999 }),
        json!({ "say": "unheard of" }),
    ];
    for message in wrong {
        watcher.send(message.clone()).await;
        let refused = tokio::time::timeout(PATIENCE, watcher.recv("refused")).await;
        assert!(refused.is_ok(), "{message}");
    }
    for text in [r#"{"say":"edit","changes":[{"Time":1e400}],"gesture":null}"#, "", "[", "\u{0}", "{\"say\":{}}"] {
        watcher.send_raw(Message::Text(text.into())).await;
        watcher.recv("refused").await;
    }
    // With --size, no screen changes the picture's. The last picture may have come long ago: another is caused.
    watcher.send(json!({ "say": "shape", "width": 4_294_967_295_u32, "height": 0 })).await;
    (look["say"], look["fov_y_deg"]) = (json!("look"), json!(30.0));
    watcher.send(look).await;
    let seen = watcher.recv_frame(|header| finished(header) && header["camera"]["fov_y_deg"] == 30.0).await;
    assert_eq!(seen.image.dimensions(), (96, 72));

    let mut rude = Watcher::join(&master).await;
    rude.send_raw(Message::Binary(vec![0; 10].into())).await;
    assert!(rude.ends().await);
    let mut long = Watcher::join(&master).await;
    long.send_too_much(Message::Text("x".repeat(1 << 20).into())).await;
    assert!(long.ends().await);

    watcher.send(json!({ "say": "inspect", "layer": "raw" })).await;
    watcher.recv_frame(|header| header["layer"] == "raw").await;
}

#[tokio::test]
async fn the_picture_has_the_size_of_the_screen_of_the_controls_holder() {
    let master = Master::start("cornell", &SMALL[2..]);
    // The first viewer has the controls, and the master may not know yet of a connection that is made.
    let mut first = Watcher::join(&master).await;
    first.recv("welcome").await;
    let mut second = Watcher::join(&master).await;
    let you = second.recv("welcome").await["you"].clone();
    let has_size = |width: u32, height: u32| {
        move |header: &Value| {
            finished(header) && header["camera"]["width"] == width && header["camera"]["height"] == height
        }
    };
    first.send(json!({ "say": "shape", "width": 121, "height": 84 })).await;
    assert_eq!(first.recv_frame(has_size(121, 84)).await.image.dimensions(), (121, 84));
    second.send(json!({ "say": "shape", "width": 60, "height": 101 })).await;
    second.send(json!({ "say": "probe", "x": 0.5, "y": 0.5 })).await;
    second.recv("probed").await;
    second.send(json!({ "say": "take" })).await;
    first.send(json!({ "say": "give", "to": you })).await;
    second.recv_frame(has_size(60, 101)).await;
    // Shapes of any kind are made to fit.
    second.send(json!({ "say": "shape", "width": 4, "height": 0 })).await;
    second.recv_frame(|header| finished(header) && header["camera"]["height"] == 32).await;
}

#[tokio::test]
async fn another_method_can_be_chosen_while_people_watch() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("a.png");
    let render = Command::new(program("igi-master"))
        .arg("render")
        .arg(scene("cornell"))
        .args(["--method", "reference", "--size", "96x72", "--frames", "4", "--quiet", "-o"])
        .arg(&path)
        .status();
    assert!(render.expect("igi-master runs").success());
    let traced = image::open(&path).expect("a picture").to_rgb8();

    let master = Master::start("cornell", &SMALL);
    let mut watcher = Watcher::join(&master).await;
    let before = watcher.recv_frame(finished).await;
    // A layer that the other method does not have.
    watcher.send(json!({ "say": "inspect", "layer": "normal" })).await;
    watcher.recv_frame(|header| header["layer"] == "normal").await;
    watcher.send(json!({ "say": "method", "name": "reference" })).await;
    let seen = watcher.recv_frame(|header| finished(header) && header["revision"] == 1).await;
    assert_eq!((seen.header["layer"].as_str(), seen.image), (Some("final"), traced), "as render saves it");
    watcher.send(json!({ "say": "method", "name": "igi" })).await;
    let again = watcher.recv_frame(|header| finished(header) && header["revision"] == 2).await;
    assert_eq!(again.image, before.image, "nothing is left of the other");
}

#[tokio::test]
async fn workers_rest_while_no_viewer_is_in_sight() {
    let master = Master::start("cornell", &["--size", "96x72", "--workers", "embedded:2"]);
    let mut watcher = Watcher::join(&master).await;
    let is_busy = |status: &Value| status["rays_per_second"].as_f64() > Some(0.0);
    watcher.recv_frame(|header| header["frames"].as_u64() > Some(2)).await;
    watcher.send(json!({ "say": "hidden", "hidden": true })).await;
    // What was in hand is finished, and then nothing more is done.
    while is_busy(&watcher.recv("status").await) {}
    for _ in 0..4 {
        assert!(!is_busy(&watcher.recv("status").await));
    }
    watcher.send(json!({ "say": "hidden", "hidden": false })).await;
    while !is_busy(&watcher.recv("status").await) {}
}
