//! What is saved is what is shown.

use serde_json::{Value, json};

use super::master::{Master, Watcher};
use super::room;

const FLAGS: [&str; 6] = ["--size", "160x120", "--rest-after", "4", "--workers", "embedded:2"];

fn name(head: &str) -> String {
    let line = head.lines().find_map(|line| line.strip_prefix("content-disposition:")).expect("a name");
    line.split('"').nth(1).expect("a name in quotes").to_owned()
}

#[tokio::test]
async fn every_layer_is_saved_as_it_is_shown_and_called_so() {
    let folder = tempfile::tempdir().expect("a folder");
    room::write(folder.path());
    let master = Master::at("127.0.0.1:0", folder.path(), &FLAGS);
    let mut watcher = Watcher::join(&master).await;
    watcher.recv_frame(|header| header["finished"] == true).await;
    watcher.send(json!({ "say": "tone", "exposure": -1.5, "operator": "agx" })).await;
    let layers = [
        ("lux", "room-illuminance-1.png"),
        ("error", "room-error-1.png"),
        ("cost", "room-cost-1.png"),
        ("normal", "room-normals-1.png"),
        ("raw", "room-unfiltered-1.png"),
        ("final", "room-1.png"),
    ];
    let tone = json!({ "exposure": -1.5, "operator": "agx" });
    while watcher.recv("knobs").await["tone"] != tone {}
    for (layer, called) in layers {
        watcher.send(json!({ "say": "inspect", "layer": layer })).await;
        let seen = watcher.recv_frame(|header| header["layer"] == layer && header["finished"] == true).await;
        let (head, body) = master.get("/picture.png", "");
        let saved = image::load_from_memory(&body).expect("a picture").to_rgb8();
        assert_eq!(name(&head), called);
        assert_eq!(saved.width(), 160);
        assert!(saved.as_raw().starts_with(seen.image.as_raw()), "{layer}: not what was shown");
        assert_eq!(saved.height() > 120, seen.header["legend"].is_object(), "{layer}: with its legend");
    }

    // The light meter's mark, and lux as numbers.
    watcher.send(json!({ "say": "inspect", "layer": "lux" })).await;
    watcher.recv_frame(|header| header["layer"] == "lux" && header["finished"] == true).await;
    let [bare, marked] = ["/picture.png", "/picture.png?meter_x=0.5&meter_y=0.9"]
        .map(|path| image::load_from_memory(&master.get(path, "").1).expect("a picture").to_rgb8());
    assert!(marked.height() > bare.height(), "with its reading");
    assert_eq!(marked.get_pixel(80, 108).0, [255; 3]);
    watcher.send(json!({ "say": "probe", "x": 0.5, "y": 0.9 })).await;
    let probed: Value = watcher.recv("probed").await;
    let (head, body) = master.get("/picture.exr", "");
    assert_eq!(name(&head), "room-illuminance-1.exr");
    let path = folder.path().join("a.exr");
    std::fs::write(&path, body).expect("it can be written");
    let values = runtime::files::read_picture(&path).expect("an EXR");
    let [x, y] = [0, 1].map(|at| probed["pixel"][at].as_u64().expect("a number") as usize);
    let lux = probed["found"]["lux"].as_f64().expect("a number") as f32;
    assert!((values.pixels[y * 160 + x].x / lux - 1.0).abs() < 1e-5, "{} and {lux}", values.pixels[y * 160 + x]);
}
