//! Lamps are mixed at rest: dimmed, they are seen so at once and no worker is asked; and what is seen is what would be drawn.

use image::RgbImage;
use serde_json::{Value, json};
use tempfile::TempDir;

use super::master::{Master, Watcher};
use super::page::Page;
use super::room;
use super::webdriver::Driver;

const FLAGS: [&str; 8] = ["--size", "96x72", "--rest-after", "16", "--preset", "draft", "--workers", "embedded:2"];

/// Waits until each lamp is drawn apart, and workers rest.
async fn is_ready(watcher: &mut Watcher) -> Value {
    loop {
        let status = watcher.recv("status").await;
        let mix = &status["mix"];
        let is_drawn = mix["lamps"].as_u64() > Some(0) && mix["drawn"] == mix["lamps"] && mix["frames"] == 16;
        if is_drawn && status["rays_per_second"] == 0.0 {
            return status;
        }
    }
}

/// The mean difference of means over 8 by 8 pixels, of 255.
fn difference(a: &RgbImage, b: &RgbImage) -> f64 {
    assert_eq!(a.dimensions(), b.dimensions());
    let mean = |image: &RgbImage, x: u32, y: u32, channel: usize| {
        let pixels = (0..64).map(|i| f64::from(image.get_pixel(8 * x + i % 8, 8 * y + i / 8).0[channel]));
        pixels.sum::<f64>() / 64.0
    };
    let blocks = (0..a.width() / 8).flat_map(|x| (0..a.height() / 8).map(move |y| (x, y)));
    let all = blocks.flat_map(|(x, y)| (0..3).map(move |channel| (x, y, channel)));
    let all: Vec<f64> = all.map(|(x, y, channel)| (mean(a, x, y, channel) - mean(b, x, y, channel)).abs()).collect();
    all.iter().sum::<f64>() / all.len() as f64
}

/// The last picture of a master that draws it anew.
async fn drawn(strengths: [f32; 4]) -> RgbImage {
    let folder = tempfile::tempdir().expect("a folder");
    room::write_candles(folder.path(), strengths);
    let master = Master::at("127.0.0.1:0", folder.path(), &FLAGS);
    let mut watcher = Watcher::join(&master).await;
    watcher.recv_frame(|header| header["finished"] == true).await.image
}

#[tokio::test]
async fn a_lamp_that_is_dimmed_is_seen_at_once_without_a_ray_as_it_would_be_drawn() {
    let folder = tempfile::tempdir().expect("a folder");
    room::write_candles(folder.path(), [2.0; 4]);
    let mut master = Master::at("127.0.0.1:0", folder.path(), &FLAGS);
    let mut watcher = Watcher::join(&master).await;
    let light = watcher.recv("welcome").await["scene"]["lights"][2].clone();
    watcher.recv_frame(|header| header["finished"] == true).await;
    watcher.send(json!({ "say": "mix", "on": true })).await;
    let status = is_ready(&mut watcher).await;
    assert_eq!(status["mix"]["lamps"], 6, "four candles, a panel, a sky: {status}");

    // Step by step down to 40 %, as a slider sends it.
    for step in 1..=40 {
        let mut value = light.clone();
        value["Point"]["intensity"] = json!([2.0 - 0.03 * f64::from(step)].repeat(3));
        let at = f64::from(step);
        let edit = json!({ "Light": { "light": 2, "value": value } });
        watcher.send(json!({ "say": "edit", "changes": [edit], "gesture": 1, "at": at })).await;
        watcher.recv_frame(|header| header["beside"]["at"] == at).await;
    }
    let mixed = watcher.recv_frame(|header| header["finished"] == true && header["beside"]["at"] == 40.0).await;
    for _ in 0..4 {
        let status = watcher.recv("status").await;
        assert_eq!(status["rays_per_second"], 0.0, "{status}");
    }
    let [expected, before] = [drawn([2.0, 2.0, 0.8, 2.0]).await, drawn([2.0; 4]).await];
    let (same, other) = (difference(&mixed.image, &expected), difference(&mixed.image, &before));
    println!("mixed from drawn: {same}; from what it was: {other}");
    // Of so few frames, what is left is noise: of 256, less than half as much.
    assert!(same < 3.5 && other > 2.0 * same, "{same} {other}");

    // The EXR has each lamp, to be mixed on.
    let exr = folder.path().join("mix.exr");
    std::fs::write(&exr, master.get("/picture.exr", "").1).expect("the folder can be written to");
    let solo = folder.path().join("solo.exr");
    let mut command = std::process::Command::new(tests::programs::program("igi-master"));
    command.arg("mix").arg(&exr).args(["--solo", "candle 3", "--quiet", "-o"]).arg(&solo);
    assert!(command.status().expect("igi-master runs").success());
    let mean = |path: &std::path::Path| {
        let picture = runtime::files::read_picture(path).expect("an EXR");
        picture.pixels.iter().map(|pixel| f64::from(pixel.element_sum())).sum::<f64>()
    };
    let share = mean(&solo) / mean(&exr);
    assert!((0.02..0.2).contains(&share), "a dim candle of four beside a panel: {share}");

    // It is an edit as any other: undone in one step, made again, saved; and what else is done draws anew.
    watcher.send(json!({ "say": "undo" })).await;
    let undone = watcher.recv_frame(|header| header["finished"] == true).await;
    assert!(difference(&undone.image, &before) < 3.5, "{}", difference(&undone.image, &before));
    watcher.send(json!({ "say": "redo" })).await;
    let redone = watcher.recv_frame(|header| header["finished"] == true).await;
    assert!(redone.image == mixed.image, "the same, to the bit");
    let hide = json!({ "Visible": { "object": 2, "visible": false } });
    watcher.send(json!({ "say": "edit", "changes": [hide], "gesture": 2, "at": 50 })).await;
    watcher.recv_frame(|header| header["beside"]["at"] == 50.0 && header["frames"].as_u64() > Some(3)).await;
    is_ready(&mut watcher).await;
    watcher.send(json!({ "say": "save" })).await;
    let saved = watcher.recv("saved").await;
    assert_eq!(saved["edits"], 2, "{saved}");
    let scene = scenes::read::load(saved["file"].as_str().expect("a file").as_ref()).expect("a scene").scene;
    let scenes::Light::Point { intensity, .. } = scene.lights[2] else { panic!("a point light") };
    assert!((intensity.x - 0.8).abs() < 1e-5 && !scene.objects[2].visible, "{intensity}");
    let [others, panel] = [&scene.lights[0], &scene.lights[3]].map(scenes::Light::power);
    assert_eq!((others.x, panel.x), (2.0, 2.0), "no lamp is left as it was drawn apart");
    let end = master.interrupted("saved_scene");
    assert_eq!(end["is_saved"], true, "{end}");
}

/// The room with candles, its master, and a page of it on which its lamps are ready to be mixed.
fn ready_to_mix(driver: &Driver) -> (TempDir, Master, Page) {
    let folder = tempfile::tempdir().expect("a folder");
    room::write_candles(folder.path(), [2.0; 4]);
    let flags = ["--size", "160x120", "--rest-after", "8", "--preset", "draft", "--workers", "embedded:2"];
    let master = Master::at("127.0.0.1:0", folder.path(), &flags);
    let page = Page::open(driver, [1280, 800], false, &master.url);
    page.at_rest();
    page.click(page.middle_of("#mix"));
    page.until("document.getElementById('mix-status').textContent === 'ready, 8 frames'");
    page.at_rest();
    (folder, master, page)
}

#[test]
fn in_a_browser_sliders_of_the_lamps_mix() {
    let Some(driver) = Driver::start() else { return };
    let (_folder, _master, page) = ready_to_mix(&driver);
    let first = page.fingerprint();
    page.photograph("mix_before");
    page.run("[...document.querySelectorAll('#lamps input')].find((b) => b.ariaLabel === 'lamp: on').click()");
    page.until("window.igi.header.finished && window.igi.scene.materials.some((m) => m.name === 'lamp' && m.emission.value[0] === 0)");
    page.at_rest();
    page.photograph("mix_panel_off");
    assert_ne!(page.fingerprint(), first);
    assert_eq!(page.get("window.igi.status.rays_per_second"), 0);
    page.after(|| page.keys(&["\u{e009}", "z"]));
    assert_eq!(page.fingerprint(), first);

    // A group by its slider: many messages, one step to be undone, and no ray.
    page.run("document.querySelector('#lamps .group-row button').click()");
    for step in ["-0.1", "-0.2", "-0.3"] {
        page.after(|| {
            page.run(&format!(
                "const r = document.querySelector('#chosen-lamps input[type=range]'); r.value = {step}; r.oninput()"
            ))
        });
    }
    page.run("document.querySelector('#chosen-lamps input[type=range]').onchange()");
    let strengths = page.get("window.igi.scene.lights.map((l) => l.Point.intensity[0].toFixed(3)).join()");
    assert_eq!(strengths, "1.002,1.002,1.002,1.002", "half of what they gave");
    assert_eq!(page.get("window.igi.status.rays_per_second"), 0);
    page.run("document.getElementById('chosen-lamps').scrollIntoView({ block: 'end' })");
    page.photograph("mix_group");
    page.after(|| page.run("document.getElementById('undo').click()"));
    assert_eq!(page.fingerprint(), first);
    page.assert_content();
}

#[test]
fn in_a_browser_presets_fade_into_each_other_and_a_lamp_is_alone_without_a_ray() {
    let Some(driver) = Driver::start() else { return };
    let (_folder, mut master, page) = ready_to_mix(&driver);
    let first = page.fingerprint();
    let press = |selector: &str| page.run(&format!("document.querySelector('{selector}').click()"));
    let keep = |name: &str| {
        page.run(&format!(
            "document.getElementById('preset-name').value = '{name}'; document.getElementById('save-preset').click()"
        ));
        page.until(&format!("window.igi.presets.some((preset) => preset.name === '{name}')"));
    };
    keep("day");

    // One lamp alone, another, and all as they were.
    page.after(|| press("[aria-label=\"candle 2: solo\"]"));
    let lit = "[...window.igi.scene.lights.map((l) => +(l.Point.intensity[0] > 0)), +(window.igi.scene.materials.find((m) => m.name === 'lamp').emission.value[0] > 0)].join('')";
    assert_eq!(page.get(lit), "01000");
    page.photograph("mix_solo");
    page.after(|| press("[aria-label=\"candle: solo\"]"));
    assert_eq!(page.get(lit), "11110");
    page.after(|| press("[aria-label=\"candle: solo\"]"));
    assert_eq!((page.get(lit), page.fingerprint()), (json!("11111"), first.clone()));

    // Another preset: half as bright, blue; and slowly back.
    page.run("document.querySelector('#lamps .group-row button').click()");
    page.after(|| page.run("const d = document.querySelector('#chosen-lamps input[aria-label=\"Dim all to\"]'); d.value = '50 %'; d.onchange()"));
    page.after(|| press("[aria-label=\"lamp: on\"]"));
    keep("night");
    page.photograph("preset_night");
    let night = page.fingerprint();
    let steps = page.get("document.getElementById('undo').disabled");
    assert_eq!(steps, false);
    page.run(
        "window.seen = []; window.igi.fade = 1.5;
              window.watch = setInterval(() => window.seen.push(window.igi.scene.lights[0].Point.intensity[0]), 50)",
    );
    page.after(|| press("#presets button:first-child"));
    page.until("window.igi.scene.lights[0].Point.intensity[0] === 2");
    page.at_rest();
    page.run("clearInterval(window.watch)");
    let seen = page.get("window.seen");
    let seen: Vec<f64> = seen.as_array().expect("a list").iter().map(|v| v.as_f64().expect("a number")).collect();
    let between: Vec<f64> = seen.iter().copied().filter(|v| *v > 1.01 && *v < 1.99).collect();
    assert!(between.len() >= 4 && between.is_sorted() && *between.first().expect("some") < 1.5, "{seen:?}");
    assert_eq!(page.fingerprint(), first, "as it was, to the last pixel");
    assert_eq!(page.get("window.igi.status.rays_per_second"), 0);
    page.photograph("preset_day");
    page.after(|| press("#undo"));
    assert_eq!(page.fingerprint(), night, "one step");

    // Kept in the saved scene; forgotten by a click.
    page.keys(&["\u{e009}", "s"]);
    page.until("document.getElementById('toast').textContent.startsWith('Saved')");
    let file = page.get("document.getElementById('toast').textContent.split(': ').at(-1)");
    let loaded = scenes::read::load(file.as_str().expect("a path").as_ref()).expect("a scene");
    let names: Vec<_> = loaded.base.expect("edits").presets.into_iter().map(|preset| preset.name).collect();
    assert_eq!(names, ["day", "night"]);
    page.run("document.querySelector('#presets button').onclick({ shiftKey: true })");
    page.until("window.igi.presets.length === 1 && document.querySelectorAll('#presets button').length === 1");
    page.assert_content();
    master.interrupted("saved_scene");
}
