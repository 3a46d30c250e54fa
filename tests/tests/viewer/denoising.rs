//! Pictures at rest, denoised by Open Image Denoise. Skipped where it is not installed, unless IGI_TEST_OIDN is set.

use std::path::PathBuf;

use runtime::denoise::{Denoiser, Place};
use serde_json::{Value, json};

use super::master::{Master, Watcher};

const FLAGS: [&str; 7] = ["--size", "96x72", "--rest-after", "9", "--workers", "embedded:2", "--denoise"];

#[tokio::test]
async fn a_picture_at_rest_is_shown_and_saved_denoised_until_that_is_turned_off() {
    let library = std::env::var_os("IGI_OIDN").map(PathBuf::from);
    let name = match Denoiser::open(library.as_deref(), Place::Processor) {
        Ok(denoiser) => denoiser.name(),
        Err(reason) => {
            assert!(std::env::var_os("IGI_TEST_OIDN").is_none(), "{reason}");
            return eprintln!("skipped: {reason}");
        }
    };
    let master = Master::start("cornell", &FLAGS);
    let mut watcher = Watcher::join(&master).await;
    let camera = watcher.recv("welcome").await["camera"].clone();
    let is_last = |denoised: bool| {
        move |header: &Value| header["finished"] == true && header["denoised"] == denoised && header["moving"] == false
    };
    let says = |bytes: &[u8]| bytes.windows(name.len()).any(|window| window == name.as_bytes());
    let denoised = watcher.recv_frame(is_last(true)).await;
    let saved = master.get("/picture.png", "").1;
    assert_eq!(image::load_from_memory(&saved).expect("a picture").to_rgb8(), denoised.image, "what is shown is saved");
    assert!(says(&saved) && says(&master.get("/picture.exr", "").1), "files say what they went through");

    watcher.send(json!({ "say": "denoise", "on": false })).await;
    let plain = watcher.recv_frame(is_last(false)).await;
    assert_ne!(plain.image, denoised.image);
    let saved = master.get("/picture.png", "").1;
    assert_eq!(image::load_from_memory(&saved).expect("a picture").to_rgb8(), plain.image);
    assert!(!says(&saved));
    watcher.send(json!({ "say": "denoise", "on": true })).await;
    watcher.recv_frame(is_last(true)).await;

    // Elsewhere: plain pictures lead, and the last is denoised again, of what is looked at then.
    let mut look = camera.clone();
    look["say"] = json!("look");
    let x = camera["origin"][0].as_f64().expect("a number") + 0.1;
    look["origin"][0] = json!(x);
    watcher.send(look).await;
    let elsewhere = |header: &Value| (header["camera"]["origin"][0].as_f64().unwrap_or(0.0) - x).abs() < 1e-5;
    let first = watcher.recv_frame(elsewhere).await;
    assert_eq!(first.header["denoised"], false, "nothing waits for the denoiser");
    let last = watcher.recv_frame(|header| elsewhere(header) && is_last(true)(header)).await;
    assert_ne!(last.image, denoised.image);

    // Other layers are numbers.
    watcher.send(json!({ "say": "inspect", "layer": "raw" })).await;
    assert_eq!(watcher.recv_frame(|header| header["layer"] == "raw").await.header["denoised"], false);
}
