//! In a real browser: one thing is recoloured, and those that are made of the same are not, unless that is wanted.

use serde_json::json;

use super::master::Master;
use super::page::Page;
use super::room;
use super::webdriver::Driver;

const FLAGS: [&str; 8] = ["--size", "200x150", "--rest-after", "4", "--preset", "draft", "--workers", "embedded:2"];
const DESK: [u32; 2] = [1280, 800];
/// Where the two boxes are seen.
const LEFT: [f64; 2] = [0.25, 0.62];
const RIGHT: [f64; 2] = [0.6, 0.62];

/// The pixel at a place of the picture, red, green and blue.
fn pixel(page: &Page, [x, y]: [f64; 2]) -> [f64; 3] {
    let pixel = page.get(&format!(
        "(() => {{ const c = document.getElementById('picture');
           return [...c.getContext('2d').getImageData({x} * c.width, {y} * c.height, 1, 1).data].slice(0, 3); }})()"
    ));
    [0, 1, 2].map(|channel| pixel[channel].as_f64().expect("a number"))
}

fn is_red([red, _, blue]: [f64; 3]) -> bool {
    red > 1.5 * blue
}

/// Picks a colour for what is selected.
fn colour(page: &Page, hex: &str) {
    page.after(|| {
        page.run(&format!(
            "const c = document.querySelector('#selection input[type=color]'); c.value = '{hex}';
             c.dispatchEvent(new Event('input')); c.dispatchEvent(new Event('change', {{ bubbles: true }}));"
        ));
    });
}

#[test]
fn one_box_is_recoloured_and_the_other_only_with_all_that_are_made_of_it() {
    let Some(driver) = Driver::start() else { return };
    let folder = tempfile::tempdir().expect("a folder");
    room::write_boxes(folder.path());
    let master = Master::at("127.0.0.1:0", folder.path(), &FLAGS);
    let page = Page::open(&driver, DESK, false, &master.url);
    page.at_rest();
    let first = page.fingerprint();
    assert!(!is_red(pixel(&page, LEFT)) && !is_red(pixel(&page, RIGHT)), "both are blue");

    page.click(page.on_picture(LEFT));
    page.until("window.igi.selection?.kind === 'piece'");
    colour(&page, "#e01010");
    page.photograph("own_material");
    assert!(is_red(pixel(&page, LEFT)) && !is_red(pixel(&page, RIGHT)), "one is red");
    let own = "window.igi.scene.pieces.map((piece) => piece.own.length).join()";
    assert_eq!(page.get(own), "1");

    // A scene that is saved has it so.
    let one = page.fingerprint();
    page.keys(&["\u{e009}", "s"]);
    page.until("document.getElementById('toast').textContent.startsWith('Saved')");
    let path = std::fs::read_dir(folder.path()).expect("a folder").filter_map(|entry| Some(entry.ok()?.path()));
    let path = path.into_iter().find(|path| path.to_string_lossy().ends_with(".edited.json")).expect("it is saved");
    let again = Master::at("127.0.0.1:0", &path, &FLAGS);
    let other = Page::open(&driver, DESK, false, &again.url);
    other.at_rest();
    assert_eq!((other.fingerprint(), other.get(own)), (one.clone(), json!("1")), "to the bit");
    drop((other, again));

    // All that are made of it; but for what has its own.
    page.click(page.on_picture(RIGHT));
    page.until("window.igi.selection.piece !== window.igi.scene.pieces.find((piece) => piece.own.length).piece");
    page.run("document.getElementById('alike').click()");
    colour(&page, "#10c010");
    let green = |[red, green, blue]: [f64; 3]| green > 1.5 * red.max(blue);
    assert!(is_red(pixel(&page, LEFT)) && green(pixel(&page, RIGHT)));
    page.click(page.on_picture(LEFT));
    page.until("document.getElementById('like-others')");
    page.after(|| page.click(page.middle_of("#like-others")));
    assert!(green(pixel(&page, LEFT)) && green(pixel(&page, RIGHT)));
    page.photograph("own_material_alike");

    // Step by step back, and forth.
    page.after(|| page.keys(&["\u{e009}", "z"]));
    page.after(|| page.keys(&["\u{e009}", "z"]));
    assert_eq!(page.fingerprint(), one);
    page.after(|| page.keys(&["\u{e009}", "z"]));
    assert_eq!((page.fingerprint(), page.get(own)), (first, json!("0,0")));
    page.after(|| page.click(page.middle_of("#redo")));
    assert_eq!((page.fingerprint(), page.get("document.getElementById('back').disabled")), (one, json!(false)));
    page.assert_content();
}
