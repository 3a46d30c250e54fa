//! In a real browser: lamps found, grouped, dimmed in their units and turned off and on again; quantities as people type
//! them; the lens, the markers, and a picture beside another.

use serde_json::{Value, json};

use super::master::Master;
use super::page::Page;
use super::room;
use super::webdriver::Driver;

const FLAGS: [&str; 8] = ["--size", "200x150", "--rest-after", "4", "--preset", "draft", "--workers", "embedded:2"];
const DESK: [u32; 2] = [1280, 800];
const PHONE: [u32; 2] = [390, 844];

/// Types into a field, and Enter.
fn typed(page: &Page, field: &str, text: &str) {
    page.run(&format!(
        "const f = document.querySelector('{field}'); f.focus(); f.value = '{text}';
         f.dispatchEvent(new Event('input', {{ bubbles: true }})); f.dispatchEvent(new Event('change', {{ bubbles: true }}));
         document.activeElement.dispatchEvent(new KeyboardEvent('keydown', {{ key: 'Enter', bubbles: true }}));"
    ));
    assert_eq!(page.get("document.activeElement.id"), "picture", "keys are the picture's again");
}

fn number(page: &Page, expression: &str) -> f64 {
    page.get(expression).as_f64().unwrap_or_else(|| panic!("no number: {expression}"))
}

/// What the candles give, watts a steradian, of one channel.
fn candles(page: &Page, channel: usize) -> Vec<f64> {
    let all = page.get(&format!("window.igi.scene.lights.map((l) => l.Point.intensity[{channel}])"));
    all.as_array().expect("lights").iter().map(|v| v.as_f64().expect("a number")).collect()
}

fn assert_near(found: &[f64], expected: f64) {
    assert!(found.iter().all(|v| (v / expected - 1.0).abs() < 1e-3), "{found:?}, not {expected}");
}

#[test]
fn quantities_are_read_with_their_units_and_nothing_else_is() {
    let Some(driver) = Driver::start() else { return };
    let folder = tempfile::tempdir().expect("a folder");
    room::write(folder.path());
    let master = Master::at("127.0.0.1:0", folder.path(), &FLAGS);
    let page = Page::open(&driver, DESK, false, &master.url);
    let read = page.run_and_wait(
        "import('/assets/units.js').then(({ parse, quantity }) => {
           const lamp = { lm: 0.5, cd: 1, lx: 1 }, kelvin = { K: 1 };
           return [
             ...['800 lm', '800', '1.2 klx', '1,5 cd', '2e3lm', '12 kcd', '1 200 lm', '.5 lumens', '-3', '40 lux'].map((t) => parse(t, lamp, 'lm')),
             ...['2700 K', '2700k', '2.7 kK', '3000'].map((t) => parse(t, kelvin, 'K')),
             parse('35 mm', { mm: (v) => v + 1 }), parse('1.2k'), parse('50 %', { '%': 0.25 }),
             ...['', 'lm', '800 furlongs', '1,200 lm', '12 34', '1e999', '5 lm lm', 'NaN', '800 mm'].map((t) => parse(t, lamp, 'lm')),
             quantity(400, lamp, 'lm'), quantity(0.25),
           ];
         })",
    );
    let expected = json!([
        400.0, 400.0, 1200.0, 1.5, 1000.0, 12000.0, 600.0, 0.25, -1.5, 40.0, 2700.0, 2700.0, 2700.0, 3000.0, 36.0,
        1200.0, 12.5, null, null, null, null, null, null, null, null, null, "800 lm", "0.25"
    ]);
    let differs = |(read, expected): (&Value, &Value)| match (read.as_f64(), expected.as_f64()) {
        (Some(a), Some(b)) => (a - b).abs() > 1e-9 * b.abs(),
        _ => read != expected,
    };
    let (read, expected) = (read.as_array().expect("a list"), expected.as_array().expect("a list"));
    assert_eq!(read.len(), expected.len());
    assert!(!read.iter().zip(expected).any(differs), "{read:?}");

    // Temperatures lead to a colour and back, and are as the scene's files have them.
    let colours = page.run_and_wait(
        "import('/assets/light.js').then(({ ofKelvin, kelvinOf }) => [ofKelvin(2700), ...[1800, 2700, 4000, 6500, 15000].map((k) => kelvinOf(ofKelvin(k))), kelvinOf([0, 1, 0])])",
    );
    let [x, y] = scenes::photometry::planck(2700.0).map_or([0.0; 2], |xy| xy);
    let colour = scenes::photometry::of_chromaticity([x, y]).expect("a colour");
    let colour = colour / colour.max_element();
    for (channel, expected) in colour.to_array().into_iter().enumerate() {
        let found = colours[0][channel].as_f64().expect("a number");
        assert!((found - expected).abs() < 2e-3, "{found} {expected}");
    }
    for (at, kelvin) in [1800.0, 2700.0, 4000.0, 6500.0, 15000.0].into_iter().enumerate() {
        assert!((colours[at + 1].as_f64().expect("a number") / kelvin - 1.0).abs() < 0.01, "{colours}");
    }
    assert_eq!(colours[6], Value::Null, "no lamp is so green");
    let spot = page.run_and_wait(
        "import('/assets/light.js').then(({ measures }) => measures({ Spot: { cos_inner: 0.9, cos_outer: 0.5 } }, [1, 1, 1]).units.lm)",
    );
    // ∫ of the square of a ramp in the cosine.
    let lumens = 683.0 * 2.0 * std::f64::consts::PI * (0.1 + 0.4 / 3.0);
    assert_near(&[spot.as_f64().expect("a number")], 1.0 / lumens);
    page.assert_content();
}

#[test]
fn lamps_are_found_dimmed_together_in_their_units_and_turned_on_as_they_were() {
    let Some(driver) = Driver::start() else { return };
    let folder = tempfile::tempdir().expect("a folder");
    room::write_candles(folder.path(), [2.0; 4]);
    let master = Master::at("127.0.0.1:0", folder.path(), &FLAGS);
    let page = Page::open(&driver, DESK, false, &master.url);
    page.at_rest();
    let first = page.fingerprint();
    let names =
        "[...document.querySelectorAll('#lamps button:not(.solo)')].map((b) => b.firstChild.textContent).join()";
    assert_eq!(page.get(names), "candle,candle 1,candle 2,candle 3,candle 4,lamp,sky", "a group, its lamps, the panel");
    page.run("const w = document.getElementById('lamp-words'); w.value = 'DLE 3'; w.oninput()");
    assert_eq!(page.get(names), "candle 3");
    page.run("const w = document.getElementById('lamp-words'); w.value = ''; w.oninput()");

    // All candles of the group, by a share and by their unit; each is a step to be undone.
    page.click(page.middle_of("#lamps .group-row button"));
    assert_eq!(page.get("document.querySelector('#chosen-lamps .title').textContent"), "4 lamps");
    let dim = "#chosen-lamps input[aria-label=\"Dim all to\"]";
    page.after(|| typed(&page, dim, "40 %"));
    assert_near(&candles(&page, 0), 0.8);
    page.after(|| typed(&page, dim, "800 lm"));
    assert_near(&candles(&page, 1), 800.0 / (683.0 * 4.0 * std::f64::consts::PI));
    page.photograph("lamps");
    page.after(|| typed(&page, "#chosen-lamps input[aria-label=\"Temperature, typed\"]", "2700 K"));
    let luminance = |page: &Page| {
        let [r, g, b] = [0, 1, 2].map(|channel| candles(page, channel)[2]);
        0.2126 * r + 0.7152 * g + 0.0722 * b
    };
    assert_near(&[luminance(&page)], 800.0 / (683.0 * 4.0 * std::f64::consts::PI));
    assert!(candles(&page, 2)[0] < 0.5 * candles(&page, 0)[0], "it is as bright, and warm");
    page.photograph("lamps_warm");
    typed(&page, dim, "1,200 lm");
    assert_near(&[luminance(&page)], 800.0 / (683.0 * 4.0 * std::f64::consts::PI));
    for _ in 0..3 {
        page.after(|| page.keys(&["\u{e009}", "z"]));
    }
    assert_eq!(page.fingerprint(), first);

    // One is turned off and comes back as it was, also for who joins meanwhile.
    let boxes = |name: &str| format!("#lamps input[aria-label=\"{name}: on\"]");
    page.after(|| page.click(page.middle_of(&boxes("candle 3"))));
    assert_eq!(candles(&page, 0)[2], 0.0);
    let other = Page::open(&driver, DESK, false, &master.url);
    other.at_rest();
    assert_eq!(other.get("window.igi.hues.lights[2][0]"), 2.0);
    page.after(|| page.click(page.middle_of(&boxes("candle 3"))));
    assert_eq!(page.fingerprint(), first);
    // The panel under the ceiling is a lamp as well.
    page.after(|| page.click(page.middle_of(&boxes("lamp"))));
    page.photograph("lamps_panel_off");
    page.after(|| page.click(page.middle_of(&boxes("lamp"))));
    assert_eq!(page.fingerprint(), first);

    // One by itself has a field beside its slider.
    page.run("[...document.querySelectorAll('#lamps button:not(.solo)')].find((b) => b.textContent.includes('candle 3')).click()");
    page.after(|| typed(&page, "#selection input[aria-label=\"Power, typed\"]", "0.1 kcd"));
    assert_near(&candles(&page, 0)[2..3], 100.0 / 683.0);
    page.photograph("lamp_typed");
    // It is put where it is said to be, in a step of its own.
    page.after(|| typed(&page, "#selection input[aria-label=\"Place y, typed\"]", "200 cm"));
    let height = || number(&page, "window.igi.scene.lights[2].Point.position[1]");
    assert_eq!(height(), 2.0);
    page.after(|| page.keys(&["\u{e009}", "z"]));
    assert!((height() - 1.4).abs() < 1e-6, "{}", height());
    page.assert_content();
}

#[test]
fn lamps_are_added_duplicated_taken_away_and_saved_and_the_sky_is_dimmed() {
    let Some(driver) = Driver::start() else { return };
    let folder = tempfile::tempdir().expect("a folder");
    room::write_candles(folder.path(), [2.0; 4]);
    let master = Master::at("127.0.0.1:0", folder.path(), &FLAGS);
    let page = Page::open(&driver, DESK, false, &master.url);
    page.at_rest();
    let first = page.fingerprint();
    let names = "window.igi.scene.lights.map((l, i) => l.Directional ? '-' : window.igi.scene.light_names[i]).join()";
    let click = |id: &str| page.run(&format!("document.getElementById('{id}').click()"));
    let choose = |name: &str| {
        page.run(&format!(
            "[...document.querySelectorAll('#lamps button:not(.solo)')].find((b) => b.textContent.includes('{name}')).click()"
        ));
    };

    // One more, which stands where its grips are and can be moved at once; a candle twice; another one gone.
    page.after(|| click("add-lamp"));
    assert_eq!(page.get(names), "candle 1,candle 2,candle 3,candle 4,new lamp 1");
    assert_ne!(page.fingerprint(), first, "it is drawn");
    page.photograph("lamp_added");
    let place = || number(&page, "window.igi.scene.lights[4].Point.position[0]");
    let was = place();
    page.after(|| page.keys(&["\u{e00a}", "\u{e014}"]));
    assert_ne!(place(), was);
    choose("candle 2");
    page.after(|| click("duplicate-lamps"));
    assert_eq!(page.get(names), "candle 1,candle 2,candle 3,candle 4,new lamp 1,candle 5");
    choose("candle 3");
    page.after(|| page.keys(&["\u{e017}"]));
    assert_eq!(page.get(names), "candle 1,candle 2,-,candle 4,new lamp 1,candle 5");
    assert_eq!(page.get("document.querySelectorAll('[data-light]').length"), 5);
    choose("sky");
    page.after(|| typed(&page, "#chosen-lamps input[aria-label=\"Dim all to\"]", "50 %"));
    assert_eq!(
        page.get("window.igi.scene.environment.Constant.map((v) => +v.toFixed(4))"),
        json!([0.01, 0.015, 0.025])
    );
    page.photograph("lamps_changed");

    // Saved, it is a scene that has them.
    let end = page.fingerprint();
    page.keys(&["\u{e009}", "s"]);
    page.until("document.getElementById('toast').textContent.startsWith('Saved')");
    let path = std::fs::read_dir(folder.path()).expect("a folder").filter_map(|entry| Some(entry.ok()?.path()));
    let path = path.into_iter().find(|path| path.to_string_lossy().ends_with(".edited.json")).expect("it is saved");
    let saved = scenes::read::load(&path).expect("a scene").scene;
    let lamps: Vec<_> = (0..6).map(|light| saved.lamp(light).map(|lamp| lamp.name)).collect();
    let expected = [Some("candle 1"), Some("candle 2"), None, Some("candle 4"), Some("new lamp 1"), Some("candle 5")];
    assert_eq!(lamps, expected.map(|name| name.map(str::to_owned)));
    let again = Master::at("127.0.0.1:0", &path, &FLAGS);
    let other = Page::open(&driver, DESK, false, &again.url);
    other.at_rest();
    assert_eq!(other.get(names), "candle 1,candle 2,-,candle 4,new lamp 1,candle 5");
    assert_eq!(other.fingerprint(), end, "and is drawn so, to the bit");
    drop((other, again));

    // Taken back, step by step, it is as it was.
    for _ in 0..5 {
        page.after(|| page.keys(&["\u{e009}", "z"]));
    }
    assert_eq!((page.get(names), page.fingerprint()), (json!("candle 1,candle 2,candle 3,candle 4"), first));
    page.assert_content();
}

#[test]
fn the_lens_the_exposure_of_a_camera_markers_and_a_picture_that_is_kept() {
    let Some(driver) = Driver::start() else { return };
    let folder = tempfile::tempdir().expect("a folder");
    room::write_candles(folder.path(), [2.0; 4]);
    let master = Master::at("127.0.0.1:0", folder.path(), &FLAGS);
    let page = Page::open(&driver, DESK, false, &master.url);
    page.at_rest();

    // A focal length is a field of view; EV at ISO 100 is an exposure.
    page.after(|| typed(&page, "input[aria-label=\"Field of view, typed\"]", "35 mm"));
    let height = 2.0 * (12.0_f64 / 35.0).atan().to_degrees();
    assert!((number(&page, "window.igi.header.camera.fov_y_deg") - height).abs() < 1e-3, "{height}");
    typed(&page, "input[aria-label=\"EV100, typed\"]", "8");
    let stops = (683.0_f64 / 1.2).log2() - 8.0;
    page.until(&format!("Math.abs(window.igi.tone.exposure - {stops}) < 1e-4"));
    page.photograph("lens");

    // The kept picture lies over the left half.
    page.run("document.getElementById('keep-picture').click()");
    page.run("const e = document.getElementById('exposure-number'); e.value = '-3'; e.oninput()");
    page.until("window.igi.tone.exposure === -3");
    page.at_rest();
    page.photograph("compared");
    assert_eq!(page.get("document.getElementById('kept').hidden"), false);
    let clip = page.get("document.getElementById('kept').style.clipPath");
    page.run("const c = document.getElementById('compare'); c.value = 80; c.oninput()");
    assert_ne!(page.get("document.getElementById('kept').style.clipPath"), clip);
    page.run("document.getElementById('keep-picture').click()");
    assert_eq!(page.get("document.getElementById('kept').hidden"), true);

    // From behind the box the candles' markers are not seen; and nowhere if they are switched off.
    assert_eq!(page.get("document.querySelectorAll('[data-light]').length"), 4);
    page.after(|| {
        page.run("window.igi.views = [{ origin: [0, 0.6, -1.6], target: [0, 0.7, 0], up: [0, 1, 0], fov_y_deg: 45 }]");
        page.keys(&["1"]);
    });
    page.until("document.querySelectorAll('[data-light]').length < 4");
    page.photograph("markers");
    page.after(|| page.keys(&["r"]));
    page.until("document.querySelectorAll('[data-light]').length === 4");
    page.run("document.getElementById('markers').click()");
    assert_eq!(page.get("document.querySelectorAll('[data-light]').length"), 0);
    page.assert_content();
}

#[test]
fn a_sky_is_turned_with_its_sun_and_saved_so() {
    let Some(driver) = Driver::start() else { return };
    let folder = tempfile::tempdir().expect("a folder");
    room::write_sky(folder.path());
    let master = Master::at("127.0.0.1:0", folder.path(), &FLAGS);
    let page = Page::open(&driver, DESK, false, &master.url);
    page.at_rest();
    let first = page.fingerprint();
    page.run(
        "[...document.querySelectorAll('#lamps button:not(.solo)')].find((b) => b.textContent.includes('sky')).click()",
    );
    let turn = "input[aria-label=\"Turn °, typed\"]";
    assert_eq!(page.get(&format!("document.querySelector('#chosen-lamps {turn}').value")), "45");
    page.photograph("sky");
    page.after(|| typed(&page, &format!("#chosen-lamps {turn}"), "135"));
    page.photograph("sky_turned");
    assert_ne!(page.fingerprint(), first);
    let sun = "window.igi.scene.lights[0].Directional.direction.map((v) => +v.toFixed(3)).join()";
    assert_eq!(
        (page.get("window.igi.scene.environment.Image.turn"), page.get(sun)),
        (json!(0.375), json!("0.707,-0.707,0"))
    );
    let end = page.fingerprint();
    page.keys(&["\u{e009}", "s"]);
    page.until("document.getElementById('toast').textContent.startsWith('Saved')");
    let path = std::fs::read_dir(folder.path()).expect("a folder").filter_map(|entry| Some(entry.ok()?.path()));
    let path = path.into_iter().find(|path| path.to_string_lossy().ends_with(".edited.json")).expect("it is saved");
    let again = Master::at("127.0.0.1:0", &path, &FLAGS);
    let other = Page::open(&driver, DESK, false, &again.url);
    other.at_rest();
    assert_eq!(other.fingerprint(), end, "to the bit");
    page.after(|| page.keys(&["\u{e009}", "z"]));
    assert_eq!(page.fingerprint(), first, "one step");
    page.assert_content();
}

#[test]
fn on_a_phone_nothing_to_touch_is_smaller_than_a_finger() {
    let Some(driver) = Driver::start() else { return };
    let folder = tempfile::tempdir().expect("a folder");
    room::write_candles(folder.path(), [2.0; 4]);
    let master = Master::at("127.0.0.1:0", folder.path(), &FLAGS);
    let page = Page::open(&driver, PHONE, true, &master.url);
    page.at_rest();
    page.run("document.querySelectorAll('details').forEach((d) => { d.open = true; }); document.querySelector('#lamps button').click()");
    let small = page.get(
        "[...document.querySelectorAll('button, a.button, select, summary, input')].flatMap((node) => {
           const touched = node.matches('[type=checkbox]') ? (node.closest('label') ?? node) : node, r = touched.getBoundingClientRect();
           return r.width > 0 && (r.height < 43.9 || r.width < 43.9) ? [`${node.tagName} ${node.id || node.ariaLabel || node.textContent} ${r.width}×${r.height}`] : [];
         })",
    );
    page.photograph("phone_lamps");
    assert_eq!(small, json!([]));
    page.assert_content();
}
