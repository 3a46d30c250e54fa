//! Plans, sections and two-point perspective: what is cut away is not seen and still lights and is lit, what is upright stays so;
//! in the viewer, in saved scenes and in `render`.

use std::path::Path;
use std::process::Command;

use frame::tone::{Exposure, Operator, Tone};
use serde_json::{Value, json};
use tempfile::TempDir;
use tests::programs::program;

use super::master::{Master, Watcher};
use super::page::Page;
use super::room;
use super::webdriver::Driver;

const FLAGS: [&str; 8] = ["--size", "96x72", "--rest-after", "16", "--preset", "draft", "--workers", "embedded:2"];

/// The mean difference of two pictures' channels, of 255.
fn difference(a: &image::RgbImage, b: &image::RgbImage) -> f64 {
    assert_eq!(a.dimensions(), b.dimensions());
    let pairs = a.as_raw().iter().zip(b.as_raw());
    pairs.map(|(a, b)| f64::from(a.abs_diff(*b))).sum::<f64>() / a.as_raw().len() as f64
}

/// As it would be seen without exposure and curve.
fn rendered(command: &str, scene: &Path, words: &[&str], into: &Path) -> image::RgbImage {
    let mut all = Command::new(program("igi-master"));
    all.arg(command).arg(scene).args(["--quiet", "--workers", "embedded:2"]).args(words);
    assert!(all.arg("-o").arg(into).status().expect("igi-master runs").success());
    let picture = runtime::files::read_picture(into).expect("an EXR");
    let tone = Tone { exposure: Exposure::Fixed(0.0), operator: Operator::None };
    let image = tone.develop(&picture);
    image::RgbImage::from_raw(image.width, image.height, image.bytes().to_vec()).expect("all pixels")
}

/// Cut at 1.8 m: the eye is 500 times half the picture's height above.
fn plan(cut: f64) -> Value {
    json!({ "say": "look", "origin": [0, cut + 1500.0, 0.5], "target": [0, cut, 0.5], "up": [0, 0, -1],
            "fov_y_deg": 2.0 * (1.0_f64 / 500.0).atan().to_degrees(), "cut": true })
}

#[tokio::test]
async fn a_plan_is_cut_where_it_says_and_is_rendered_from_the_saved_scene_by_both_renderers() {
    let folder = tempfile::tempdir().expect("a folder");
    room::write(folder.path());
    let master = Master::at("127.0.0.1:0", folder.path(), &FLAGS);
    let mut watcher = Watcher::join(&master).await;
    watcher.recv("welcome").await;
    watcher.send(json!({ "say": "tone", "exposure": 0, "operator": "none" })).await;
    watcher.send(plan(1.8)).await;
    let seen = watcher.recv_frame(|header| header["camera"]["cut"] == true && header["finished"] == true).await;
    let what = async |watcher: &mut Watcher, x: f64, y: f64| {
        watcher.send(json!({ "say": "pick", "x": x, "y": y })).await;
        watcher.recv("picked").await["found"].clone()
    };
    // The picture is 6 m high: the box, 1 m wide, lies half a metre above its middle; beside it is the floor; not the ceiling.
    let found = what(&mut watcher, 0.5, 0.42).await;
    assert!((found["point"][1].as_f64().expect("a height") - 1.2).abs() < 1e-3, "the top of the box: {found}");
    let found = what(&mut watcher, 0.5, 0.65).await;
    assert!(found["point"][1].as_f64().expect("a height").abs() < 1e-3, "the floor: {found}");
    let floor = seen.image.get_pixel(48, 50).0;
    assert!(floor[0] > 40, "the lamp that is cut away lights the floor: {floor:?}");
    watcher.send(json!({ "say": "save" })).await;
    let saved = watcher.recv("saved").await;
    let file = std::path::PathBuf::from(saved["file"].as_str().expect("a file"));
    watcher.send(plan(3.5)).await;
    let above = watcher.recv_frame(|header| header["camera"]["target"][1] == 3.5 && header["finished"] == true).await;
    assert!(difference(&above.image, &seen.image) > 20.0, "from above the roof is seen");

    let words = ["--size", "96x72", "--frames", "64"];
    let drawn = rendered("render", &file, &words, &folder.path().join("plan.exr"));
    let path_traced =
        rendered("reference", &file, &["--size", "96x72", "--samples", "128"], &folder.path().join("truth.exr"));
    for (name, other) in [("as seen", &seen.image), ("path-traced", &path_traced)] {
        let off = difference(&drawn, other);
        assert!(off < 6.0, "{name}: {off}");
    }
    // As scene JSON says it: so high, in parallel.
    let text = std::fs::read_to_string(folder.path().join("scene.json")).expect("a scene");
    let (head, rest) = text.split_once("\"camera\": {").expect("a camera");
    let (_, tail) = rest.split_once('}').expect("its end");
    let camera = r#""camera": { "origin": [0, 9, 0.5], "target": [0, 1.8, 0.5], "up": [0, 0, -1], "parallel_height": 6, "cut": true, "width": 96, "height": 72 }"#;
    std::fs::write(folder.path().join("plan.json"), format!("{head}{camera}{tail}")).expect("it can be written");
    let named =
        rendered("render", &folder.path().join("plan.json"), &["--frames", "64"], &folder.path().join("named.exr"));
    assert!(difference(&drawn, &named) < 0.5, "{}", difference(&drawn, &named));
}

/// The room, its master, and a page of it that is at rest.
fn at_rest_in_the_room(driver: &Driver) -> (TempDir, Master, Page) {
    let folder = tempfile::tempdir().expect("a folder");
    room::write(folder.path());
    let flags = ["--size", "160x120", "--rest-after", "2", "--preset", "draft", "--workers", "embedded:2"];
    let master = Master::at("127.0.0.1:0", folder.path(), &flags);
    let page = Page::open(driver, [1280, 800], false, &master.url);
    page.at_rest();
    (folder, master, page)
}

#[test]
fn in_a_browser_people_go_to_a_plan_and_a_section_and_back() {
    let Some(driver) = Driver::start() else { return };
    let (_folder, _master, page) = at_rest_in_the_room(&driver);
    let first = page.get("JSON.stringify(window.igi.header.camera)");
    let choose = |kind: &str| {
        page.after(|| {
            page.run(&format!("const s = document.getElementById('projection'); s.value = '{kind}'; s.onchange()"));
        });
    };
    let meets = |y: f64| {
        page.run("window.igi.picked = undefined");
        page.click(page.on_picture([0.5, y]));
        page.until("window.igi.picked !== undefined");
        page.keys(&["\u{e00c}"]);
        page.get("window.igi.picked.point.map((v) => +v.toFixed(2))")
    };
    choose("plan");
    page.photograph("plan");
    assert_eq!(page.get("window.igi.header.camera.cut"), true);
    assert_eq!(page.get("document.getElementById('lens-row').hidden"), true);
    // At the eye's height, over the middle of the room.
    let height = page.get("document.querySelector('#cut-row input.quantity').value");
    assert_eq!(height, "1.7 m");
    assert_eq!(meets(0.65)[1], 0.0, "the floor");
    // Lower than the box is high, by typing; the wheel and drags keep the cut.
    page.after(|| {
        page.run(
            "const f = document.querySelector('#cut-row input.quantity'); f.focus(); f.value = '60 cm';
             f.dispatchEvent(new Event('input', { bubbles: true })); f.dispatchEvent(new Event('change', { bubbles: true })); f.blur()",
        );
    });
    assert_eq!(page.get("+window.igi.header.camera.target[1].toFixed(3)"), 0.6);
    page.photograph("plan_low");
    page.after(|| page.wheel(page.on_picture([0.5, 0.5]), -300));
    page.after(|| page.drag("mouse", page.on_picture([0.5, 0.5]), [40.0, 30.0]));
    assert_eq!(page.get("+window.igi.header.camera.target[1].toFixed(3)"), 0.6);
    assert_eq!(page.get("window.igi.header.camera.up.map(Math.round)"), json!([0, 0, -1]));
    choose("-z");
    page.photograph("section");
    let there = meets(0.4);
    assert_eq!(there[2], -2.0, "the wall behind: {there}");
    page.run("document.getElementById('view-name').value = 'section'; document.getElementById('save-view').click()");
    page.until("window.igi.views.length === 1");
    choose("perspective");
    assert_eq!(page.get("JSON.stringify(window.igi.header.camera)"), first, "where people stood");
    page.after(|| page.keys(&["1"]));
    assert_eq!(page.get("window.igi.header.camera.cut && document.getElementById('projection').value"), "-z");
    page.assert_content();
}

#[test]
fn in_a_browser_verticals_are_upright_in_two_point_perspective() {
    let Some(driver) = Driver::start() else { return };
    let (_folder, _master, page) = at_rest_in_the_room(&driver);
    // Looking down, verticals lean; two-point perspective has them upright: both ends of each have one column.
    page.after(|| page.drag("mouse", page.on_picture([0.3, 0.3]), [0.0, 60.0]));
    let leaning = "import('/assets/vector.js').then(({ lens }) => {
        const l = lens(window.igi.header.camera);
        return Math.max(...[[-2, -2], [2, -2], [-0.5, 0.5]].map(([x, z]) => Math.abs(l.project([x, 0, z]).x - l.project([x, 1.2, z]).x)));
    })";
    let lean = |page: &Page| page.run_and_wait(leaning).as_f64().expect("a share");
    let before = lean(&page);
    page.photograph("one_point");
    page.after(|| page.run("const s = document.getElementById('projection'); s.value = 'two_point'; s.onchange()"));
    page.photograph("two_point");
    assert!(before > 0.01 && lean(&page) < 1e-6, "{before} {}", lean(&page));
    // What is seen is where the page says it is.
    page.click(page.place_of("box"));
    page.until("window.igi.selection?.index != null || window.igi.selection?.object != null");
    assert_eq!(
        page.get("window.igi.scene.objects[window.igi.selection.index ?? window.igi.selection.object].name"),
        "box"
    );
    page.assert_content();
}

#[test]
fn in_a_browser_people_walk_on_the_floor_and_stop_at_walls() {
    let Some(driver) = Driver::start() else { return };
    let (_folder, _master, page) = at_rest_in_the_room(&driver);
    page.run("document.getElementById('walk').click()");
    let key = |kind: &str, key: &str| {
        page.run(&format!("document.getElementById('picture').dispatchEvent(new KeyboardEvent('{kind}', {{ key: '{key}', bubbles: true }}))"));
    };
    let eye = |axis: usize| page.get(&format!("window.igi.camera.origin[{axis}]")).as_f64().expect("a number");
    // Into the room, past the box to the left, and on against the wall behind.
    key("keydown", "a");
    page.until("window.igi.camera.origin[0] < -0.9");
    key("keyup", "a");
    key("keydown", "w");
    page.until("window.igi.camera.origin[2] < 2.5");
    assert!((eye(1) - 1.6).abs() < 1e-3, "on the floor: {}", eye(1));
    page.until("window.igi.camera.origin[2] < -1.6");
    std::thread::sleep(std::time::Duration::from_millis(1500));
    key("keyup", "w");
    assert!(eye(2) > -2.0 + 0.2, "not through the wall: {}", eye(2));
    assert!(eye(0) > -2.0 && eye(0) < 2.0, "nor through the one beside it: {}", eye(0));
    page.at_rest();
    page.photograph("walk");
    // As a child.
    page.after(|| {
        page.run(
            "const f = document.querySelector('.row.walk input.quantity'); f.focus(); f.value = '110 cm';
             f.dispatchEvent(new Event('input', { bubbles: true })); f.dispatchEvent(new Event('change', { bubbles: true })); f.blur()",
        );
    });
    page.until("Math.abs(window.igi.camera.origin[1] - 1.1) < 1e-3");
    page.assert_content();
}
