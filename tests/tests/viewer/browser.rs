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

    // Somebody else sees the same, and may be given the controls.
    let other = Page::open(&driver, DESK, false, &master.url);
    other.at_rest();
    assert_eq!(other.fingerprint(), page.fingerprint(), "two watchers see the same");
    assert_eq!(other.get("document.body.dataset.holder"), "false");
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

    // Lux, in false colours.
    other.run("const l = document.getElementById('layer'); l.value = 'lux'; l.onchange();");
    page.until("window.igi.header.layer === 'lux' && !document.getElementById('legend').hidden");
    page.photograph("lux");
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
