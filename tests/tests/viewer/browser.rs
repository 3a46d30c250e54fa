//! In a real browser: Chromium without a screen, driven through chromedriver by real mouse, finger and keys.
//!
//! Skipped with a message unless IGI_TEST_BROWSER is set. With IGI_SCREENSHOTS=FOLDER the pages are saved there, to be
//! looked at.

use super::master::Master;
use super::page::Page;
use super::room;
use super::webdriver::Driver;

const FLAGS: [&str; 8] = ["--size", "200x150", "--rest-after", "4", "--preset", "draft", "--workers", "embedded:2"];
const DESK: [u32; 2] = [1280, 800];
const PHONE: [u32; 2] = [390, 844];
/// The key Control, in WebDriver's table of keys.
const CONTROL: &str = "\u{e009}";
/// Alt, and the arrow to the right.
const ALT: &str = "\u{e00a}";
const RIGHT: &str = "\u{e014}";
/// Home and End.
const HOME: &str = "\u{e011}";
const END: &str = "\u{e010}";

#[test]
fn people_look_around_and_move_things_and_others_see_it() {
    let Some(driver) = Driver::start() else { return };
    let folder = tempfile::tempdir().expect("a folder");
    room::write(folder.path());
    let master = Master::at("127.0.0.1:0", folder.path(), &FLAGS);
    let page = Page::open(&driver, DESK, false, &master.url);
    page.at_rest();
    assert_eq!(page.get("document.title"), "room");
    assert_eq!(page.difference_to_png(), 0, "the screen shows the PNG of the same revision");
    page.photograph("at_rest");
    let first = page.fingerprint();

    // The camera.
    page.after(|| page.drag("mouse", [300.0, 300.0], [120.0, 10.0]));
    assert_ne!(page.fingerprint(), first, "another view");
    assert_eq!(page.difference_to_png(), 0);
    page.photograph("turned");

    // A click selects; a drag of the selection reaches the workers.
    page.click(page.place_of("box"));
    page.until("window.igi.scene.objects[window.igi.selection?.index]?.name === 'box'");
    page.photograph("selected");
    let (was, world) = (page.translation("box"), page.get("window.igi.header.world"));
    let turned = page.fingerprint();
    page.after(|| page.drag("mouse", page.middle_of("[data-grab=\"free\"]"), [80.0, 0.0]));
    assert_ne!(page.translation("box"), was);
    assert!(page.get("window.igi.header.world").as_u64() > world.as_u64(), "the scene has a new revision");
    assert_ne!(page.fingerprint(), turned, "workers drew it where it is now");
    assert_eq!(page.difference_to_png(), 0);
    page.photograph("moved");
    // By keys as well; the master's numbers have fewer digits.
    let place = |page: &Page| {
        let place = page.translation("box");
        [0, 2].map(|axis| place[axis].as_f64().expect("a number") as f32)
    };
    let dragged = place(&page);
    page.after(|| page.keys(&[ALT, RIGHT]));
    assert_ne!(place(&page), dragged, "a key moves it on");
    page.after(|| page.keys(&[CONTROL, "z"]));
    assert_eq!(place(&page), dragged);

    // Another viewer sees the same, and may be given the controls.
    let other = Page::open(&driver, DESK, false, &master.url);
    other.at_rest();
    assert_eq!(other.fingerprint(), page.fingerprint(), "two watchers see the same");
    assert_eq!(other.get("document.body.dataset.holder"), "false");
    assert_eq!(
        other.get("document.getElementById('selection-section').inert"),
        true,
        "a viewer that only watches turns no knobs"
    );
    // The page says how to get them at the first attempt to use them, not before.
    assert_eq!(other.get("document.getElementById('controls-bar').hidden"), true, "no one is rebuffed for looking");
    other.photograph("watching");
    other.drag("mouse", [300.0, 300.0], [60.0, 0.0]);
    other.until("document.getElementById('controls-bar').textContent.includes('You are watching')");
    other.photograph("offered");
    other.click(other.middle_of("#controls-bar button"));
    page.until("document.querySelector('#controls-bar button')?.textContent === 'Hand over'");
    page.photograph("asked");
    page.click(page.middle_of("#controls-bar button"));
    other.until("document.body.dataset.holder === 'true'");

    // What one takes back, the other sees: to the bit as it was.
    other.after(|| other.keys(&[CONTROL, "z"]));
    page.at_rest();
    assert_eq!(page.translation("box"), was);
    assert_eq!((page.fingerprint(), other.fingerprint()), (turned.clone(), turned));

    // A viewer that is given the controls goes on from what all see.
    let origin = |page: &Page| {
        let origin = page.get("window.igi.header.camera.origin");
        [0, 1, 2].map(|axis| origin[axis].as_f64().expect("a number"))
    };
    let away = |a: [f64; 3], b: [f64; 3]| (0..3).map(|i| (a[i] - b[i]).abs()).sum::<f64>();
    let before = origin(&other);
    other.after(|| other.drag("mouse", [300.0, 300.0], [200.0, 0.0]));
    let seen = origin(&other);
    page.until(&format!("Math.abs(window.igi.header.camera.origin[0] - {}) < 1e-6", seen[0]));
    page.click(page.middle_of("#watching"));
    page.click(page.middle_of("#controls-bar button"));
    other.until("document.querySelector('#controls-bar button')?.textContent === 'Hand over'");
    other.click(other.middle_of("#controls-bar button"));
    page.until("document.body.dataset.holder === 'true'");
    page.after(|| page.drag("mouse", [300.0, 300.0], [12.0, 0.0]));
    let now = origin(&page);
    assert!(away(now, seen) < 0.3 * away(before, seen), "{before:?} {seen:?} {now:?}");

    // Lux, in false colours.
    page.run("const l = document.getElementById('layer'); l.value = 'lux'; l.onchange();");
    page.until("window.igi.header.layer === 'lux' && !document.getElementById('legend').hidden");
    page.photograph("lux");
    page.assert_content();
    other.assert_content();
}

#[test]
fn wheel_keys_sliders_time_and_views_are_obeyed() {
    let Some(driver) = Driver::start() else { return };
    let folder = tempfile::tempdir().expect("a folder");
    room::write_moving(folder.path());
    let master = Master::at("127.0.0.1:0", folder.path(), &FLAGS);
    let page = Page::open(&driver, DESK, false, &master.url);
    page.at_rest();
    let first = page.fingerprint();
    let depth = |page: &Page| page.get("window.igi.header.camera.origin[2]").as_f64().expect("a number");

    // A view is saved, left by wheel and keys, and gone back to.
    let home = depth(&page);
    page.run("document.getElementById('save-view').click()");
    page.after(|| page.wheel([300.0, 300.0], -200));
    let nearer = depth(&page);
    assert!(nearer < home - 0.1, "{home} {nearer}");
    page.after(|| page.keys(&["s"]));
    assert!(depth(&page) > nearer, "{nearer} {}", depth(&page));
    page.after(|| page.keys(&["1"]));
    assert_eq!(page.fingerprint(), first);
    page.keys(&["]"]);
    page.until("document.getElementById('exposure-number').value === '0.25'");
    page.keys(&["["]);
    page.until("document.getElementById('exposure-number').value === '0'");

    // What is in the middle of the picture is selected by a key, and glows by keys on its slider.
    page.keys(&[" "]);
    page.until("window.igi.selection");
    let glow = "Math.max(...window.igi.scene.materials[window.igi.selection.material].emission.value)";
    page.run("document.querySelector('#selection input[aria-label=Glow]').focus()");
    page.after(|| page.keys(&[RIGHT]));
    let faint = page.get(glow).as_f64();
    page.after(|| page.keys(&[RIGHT]));
    assert!(faint > Some(0.0) && page.get(glow).as_f64() > faint, "the focus stays: {faint:?}");
    page.after(|| page.keys(&[CONTROL, "z"]));
    page.after(|| page.keys(&[CONTROL, "z"]));
    assert_eq!(page.fingerprint(), first);

    // A lamp is listed under its name in the file. Turned off it comes back, and is aimed.
    assert!(
        page.get("document.getElementById('lamps').textContent").as_str().is_some_and(|all| all.contains("Desk lamp"))
    );
    page.click(page.middle_of("[data-light=\"0\"]"));
    page.until("window.igi.selection?.kind === 'light'");
    let power = || page.get("Math.max(...window.igi.scene.lights[0].Spot.intensity)").as_f64();
    page.run("document.querySelector('#selection input[aria-label=Power]').focus()");
    page.after(|| page.keys(&[HOME]));
    assert_eq!(power(), Some(0.0));
    page.after(|| page.keys(&[RIGHT]));
    assert!(power() > Some(0.0), "{:?}", power());
    page.run("document.querySelector('#selection input[aria-label=\"Tilt °\"]').focus()");
    page.after(|| page.keys(&[RIGHT]));
    let down = page.get("window.igi.scene.lights[0].Spot.direction[1]").as_f64().expect("a number");
    assert!(-1.0 < down && down < -0.99, "{down}");
    page.photograph("lamp");

    // Time goes on by its slider, and is taken back; what moves by itself can be taken hold of where it is then.
    let (lit, stood) = (page.fingerprint(), page.translation("box"));
    page.run("document.getElementById('time').focus()");
    page.after(|| page.keys(&[END]));
    assert_ne!(page.fingerprint(), lit);
    assert_ne!(page.translation("box"), stood);
    page.photograph("time");
    page.after(|| page.keys(&[CONTROL, "z"]));
    assert_eq!((page.fingerprint(), page.translation("box")), (lit, stood));
    assert_eq!(page.get("+document.getElementById('time').value"), 0);
    page.assert_content();
}

/// Where in the window a point of the first picture is that a ray says is a chair's, in the middle of its chair.
fn chair(page: &Page) -> [f64; 2] {
    let scene = scenes::read::load(&super::master::scene("conference")).expect("it is shipped").scene;
    let pieces = scene.meshes[0].pieces();
    let camera: scenes::Camera = serde_json::from_value(page.get("window.igi.header.camera")).expect("a camera");
    let lens = camera.lens();
    let [width, height] = [camera.width as f32, camera.height as f32];
    let spots = (0..40 * 30).map(|i| [(i % 40) as f32 / 40.0, (i / 40) as f32 / 30.0]);
    let seen = spots.filter_map(|[x, y]| {
        let found = frame::live::pick::pick(&scene, lens.origin(), lens.direction(x * width, y * height))?;
        let is_chair = pieces.triangles(found.piece?).len() == 1428;
        is_chair.then_some((found.piece?, [x, y]))
    });
    let seen: Vec<_> = seen.collect();
    let of = |piece: u32| seen.iter().filter(move |(other, _)| *other == piece).map(|(_, spot)| *spot);
    // The chair that is seen best.
    let piece = seen.iter().map(|(piece, _)| *piece).max_by_key(|piece| of(*piece).count()).expect("chairs are seen");
    let spots: Vec<_> = of(piece).collect();
    let [x, y] = spots[spots.len() / 2];
    page.on_picture([f64::from(x), f64::from(y)])
}

#[test]
fn a_chair_of_a_file_that_keeps_nothing_apart_is_picked_moved_and_put_back() {
    let Some(driver) = Driver::start() else { return };
    let flags = ["--size", "320x240", "--rest-after", "6", "--preset", "draft", "--workers", "embedded:2"];
    let master = Master::start("conference", &flags);
    let page = Page::open(&driver, DESK, false, &master.url);
    page.at_rest();
    let first = page.fingerprint();

    page.click(chair(&page));
    page.until("window.igi.selection?.kind === 'piece'");
    page.photograph("chair_selected");
    let place = "window.igi.scene.pieces[0].place.translation";
    assert_eq!(page.get(place), serde_json::json!([0, 0, 0]));
    page.after(|| page.drag("mouse", page.middle_of("[data-grab=\"0\"]"), [110.0, 60.0]));
    let moved = |page: &Page| [0, 1, 2].map(|axis| page.get(place)[axis].as_f64().expect("a number"));
    assert!(moved(&page)[0] > 0.5 && moved(&page)[1..] == [0.0; 2], "{:?}", moved(&page));
    assert_ne!(page.fingerprint(), first);
    assert_eq!(page.difference_to_png(), 0);
    page.photograph("chair_moved");

    // Another viewer shows it as well, hides it, and shows the whole object of which it is.
    let other = Page::open(&driver, DESK, false, &master.url);
    other.at_rest();
    assert!((moved(&other)[0] - moved(&page)[0]).abs() < 1e-5, "{:?}", moved(&other));
    assert_eq!(page.get("document.getElementById('back').disabled"), false);
    page.run("document.querySelector('#selection input[type=checkbox]').click()");
    other.until("window.igi.scene.pieces[0].visible === false");
    page.at_rest();
    page.photograph("chair_hidden");
    page.run("document.getElementById('whole').click()");
    page.until("window.igi.selection?.kind === 'object'");
    page.photograph("whole_selected");

    // Hidden and moved were two steps; then all is as it was, to the bit.
    page.after(|| page.keys(&[CONTROL, "z"]));
    page.after(|| page.keys(&[CONTROL, "z"]));
    assert_eq!(page.fingerprint(), first);
    page.assert_content();
    other.assert_content();
}

#[test]
fn a_phone_fits_and_a_page_comes_back_when_the_master_does() {
    let Some(driver) = Driver::start() else { return };
    let folder = tempfile::tempdir().expect("a folder");
    room::write(folder.path());
    let master = Master::at("127.0.0.1:0", folder.path(), &FLAGS);
    let page = Page::open(&driver, PHONE, true, &master.url);
    page.at_rest();
    page.photograph("phone");
    assert_eq!(page.get("[innerWidth, document.documentElement.scrollWidth]"), serde_json::json!([390, 390]));
    let out_of_reach = "[...document.querySelectorAll('#bar button')].filter((b) => b.offsetParent && b.getBoundingClientRect().right > innerWidth).length";
    assert_eq!(page.get(out_of_reach), 0, "all tools are in reach");
    let before = page.fingerprint();
    page.after(|| page.drag("touch", [120.0, 200.0], [90.0, 0.0]));
    assert_ne!(page.fingerprint(), before, "a finger turns the view");
    page.assert_content();

    let address = master.address.to_string();
    drop(master);
    page.until("document.getElementById('curtain').className === 'thin'");
    page.photograph("gone");
    let _again = Master::at(&address, folder.path(), &FLAGS);
    page.at_rest();
    assert_eq!(page.difference_to_png(), 0);
    assert_eq!(page.fingerprint(), before, "the same scene from the same place, to the bit");
}

#[test]
fn numbers_keep_their_zeros() {
    let Some(driver) = Driver::start() else { return };
    let folder = tempfile::tempdir().expect("a folder");
    room::write(folder.path());
    let master = Master::at("127.0.0.1:0", folder.path(), &FLAGS);
    let page = Page::open(&driver, DESK, false, &master.url);
    let written = page.run_and_wait(
        "import('/assets/number.js').then(({ short }) =>
           [0, 1, 100, -180, 1000, 67332, 0.25, 12.5, 99.96, 1.005, -0.07, 2e-5, 3e9, NaN].map((v) => short(v)))",
    );
    let expected = "0 1 100 -180 1000 67332 0.25 12.5 100 1 -0.07 2e-5 3e9 –";
    assert_eq!(written, serde_json::json!(expected.split(' ').collect::<Vec<_>>()));
}

#[test]
fn what_is_done_before_the_master_has_said_anything_harms_nothing() {
    let Some(driver) = Driver::start() else { return };
    let folder = tempfile::tempdir().expect("a folder");
    room::write(folder.path());
    let master = Master::at("127.0.0.1:0", folder.path(), &FLAGS);
    let page = Page::open_deaf(&driver, DESK, &master.url);
    page.until("window.release");
    page.run("document.getElementById('curtain').className = 'up'");
    page.drag("mouse", [300.0, 300.0], [120.0, 40.0]);
    page.wheel([300.0, 300.0], -200);
    for key in ["w", "f", "r", "p", "p", "1", " ", "[", "?"] {
        page.keys(&[key]);
    }
    page.until("document.getElementById('help').open");
    page.run("document.getElementById('help').close(); document.getElementById('save-view').click()");
    page.run("window.release()");
    page.at_rest();
    let depth = "window.igi.header.camera.origin[2]";
    let before = page.get(depth).as_f64();
    page.after(|| page.keys(&["w"]));
    assert!(page.get(depth).as_f64() < before, "keys walk");
    page.assert_content();
}

#[test]
fn markers_leave_drags_and_the_wheel_to_the_picture_and_a_sun_has_none() {
    let Some(driver) = Driver::start() else { return };
    let folder = tempfile::tempdir().expect("a folder");
    room::write_lamps(folder.path());
    let master = Master::at("127.0.0.1:0", folder.path(), &FLAGS);
    let page = Page::open(&driver, DESK, false, &master.url);
    page.at_rest();
    assert_eq!(page.get("document.querySelectorAll('[data-light]').length"), 1, "the sun is nowhere");
    let marker = || page.middle_of("[data-light=\"0\"]");
    let origin = |page: &Page| page.get("window.igi.header.camera.origin");
    let first = origin(&page);
    page.after(|| page.drag("mouse", marker(), [80.0, 0.0]));
    let dragged = origin(&page);
    assert_ne!(dragged, first, "a drag from a marker turns the view");
    assert_eq!(page.get("window.igi.selection"), serde_json::Value::Null, "and selects nothing");
    page.after(|| page.wheel(marker(), -200));
    assert_ne!(origin(&page), dragged, "the wheel over a marker goes nearer");
    page.after(|| page.keys(&["r"]));
    page.run("document.getElementById('probe-on').click()");
    page.hover(marker());
    page.until("!document.getElementById('probe').hidden");
    let meter = page.get("document.getElementById('probe').innerText");
    let says = |words: &str| meter.as_str().is_some_and(|meter| meter.contains(words));
    assert!(says(" lx") && says(" cd/m²") && says("1 W/m² in the files is 683 lx"), "{meter}");
    page.click(marker());
    page.until("window.igi.selection?.kind === 'light' && window.igi.selection.index === 0");
    page.photograph("lamp_selected");
    // The sun is selected from the list; it has no handle and no errors.
    page.run(
        "[...document.querySelectorAll('#lamps button:not(.solo)')].find((b) => b.textContent.includes('Sun')).click()",
    );
    page.until("document.querySelector('#selection .title').textContent === 'Sun'");
    page.run("document.getElementById('help-open').click()");
    page.until("document.getElementById('help').open");
    page.photograph("help");
    page.run("document.getElementById('help').close()");

    // A real sun needs -16.5: typed, or by the slider.
    let stops = || page.get("window.igi.tone.exposure");
    page.run(
        "const n = document.getElementById('exposure-number'); n.value = '-16.5'; n.dispatchEvent(new Event('input'))",
    );
    page.until("window.igi.tone.exposure === -16.5 && document.getElementById('exposure').value === '-16.5'");
    // The master's word of the exposure before may come just then.
    page.run(
        "const n = document.getElementById('exposure'), before = { ...window.igi.tone };
         n.value = '-24'; n.dispatchEvent(new Event('input')); window.igi.tone = before;",
    );
    page.until("window.igi.tone.exposure === -24");
    page.keys(&["]"]);
    page.until("window.igi.tone.exposure === -23.75");
    assert_eq!(stops(), -23.75);
    page.assert_content();
}

#[test]
fn the_picture_has_the_pixels_of_the_screen_of_the_controls_holder() {
    let Some(driver) = Driver::start() else { return };
    let folder = tempfile::tempdir().expect("a folder");
    room::write(folder.path());
    let flags = ["--rest-after", "1", "--preset", "draft", "--workers", "embedded:2"];
    let master = Master::at("127.0.0.1:0", folder.path(), &flags);
    let page = Page::open(&driver, [900, 500], false, &master.url);
    page.reshape([900, 500], 1.0);
    let drawn = "[window.igi.header.camera.width, window.igi.header.camera.height]";
    let fits = || {
        let screen = page.screen();
        page.until(&format!("window.igi.header?.finished && String({drawn}) === String({screen})"));
        page.at_rest();
        assert_eq!(page.get("[window.igi.header.width, window.igi.header.height]"), screen);
        assert_eq!(page.difference_to_png(), 0);
        screen
    };
    let first = fits();
    page.photograph("pixels_1");
    // A screen with twice as many pixels in each direction: nothing else of the page changes.
    page.reshape([900, 500], 2.0);
    let fine = fits();
    assert_eq!([0, 1].map(|i| fine[i].as_u64()), [0, 1].map(|i| first[i].as_u64().map(|side| 2 * side)));
    page.photograph("pixels_2");
    // A phone that is turned.
    page.reshape([390, 700], 1.0);
    let tall = fits();
    page.reshape([700, 390], 1.0);
    assert_ne!(fits(), tall);

    // Another viewer gets it scaled, and decides once it has the controls.
    let other = Page::open(&driver, [800, 600], false, &master.url);
    other.at_rest();
    assert_eq!(other.get(drawn), page.get(drawn));
    other.click(other.middle_of("#watching"));
    other.click(other.middle_of("#controls-bar button"));
    page.until("document.querySelector('#controls-bar button')?.textContent === 'Hand over'");
    page.click(page.middle_of("#controls-bar button"));
    other.until(&format!("window.igi.header?.finished && String({drawn}) === String({})", other.screen()));
    page.assert_content();
    other.assert_content();
}
