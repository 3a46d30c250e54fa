//! `igi-master mix`: light adds up, and what is dimmed after the fact is what would have been drawn dimmed.

use std::path::Path;
use std::process::Command;

use frame::Picture;
use runtime::files::read_picture;
use tests::programs::program;

const SIZE: [&str; 4] = ["--size", "24x18", "--workers", "embedded:2"];

fn run(words: &[&str]) -> std::process::Output {
    Command::new(program("igi-master")).args(words).arg("--quiet").output().expect("igi-master runs")
}

fn succeed(words: &[&str], into: &Path) -> Picture {
    let into_text = into.to_str().expect("text");
    let output = run(&[words, &["-o", into_text]].concat());
    assert!(output.status.success(), "{words:?}: {}", String::from_utf8_lossy(&output.stderr));
    read_picture(into).expect("an EXR")
}

/// A room with two lamps without surface, one of which a mirror-like floor shows, a panel and a little sky.
fn write(folder: &Path, third: &str) {
    let obj = "mtllib a.mtl\nusemtl white\nv -2 0 -2\nv 2 0 -2\nv 2 3 -2\nv -2 3 -2\nv -2 0 2\nv 2 0 2\nv 2 3 2\nv -2 3 2\n\
               f 1 5 6 2\nf 1 2 3 4\nf 1 4 8 5\nf 2 6 7 3\nusemtl panel\nv -0.5 2.9 -0.5\nv 0.5 2.9 -0.5\nv 0.5 2.9 0.5\n\
               v -0.5 2.9 0.5\nf 9 10 11 12\n";
    let mtl = "newmtl white\nillum 1\nKd 0.6 0.6 0.6\nnewmtl panel\nillum 1\nKd 0 0 0\nKe 3 3 3\n";
    let lamp = |name: &str, x: f32, power: &str| {
        format!(
            r#"{{ "type": "point", "name": "{name}", "position": [{x}, 1, 0], "intensity": [{power}, {power}, {power}] }}"#
        )
    };
    let json = format!(
        r#"{{ "obj": "a.obj", "background": [0.1, 0.1, 0.1], "lights": [{}, {}],
            "camera": {{ "origin": [0, 1.5, 6], "target": [0, 1.2, 0], "fov_y_deg": 40, "width": 24, "height": 18 }} }}"#,
        lamp("candle 2", -1.0, "2"),
        lamp("candle 3", 1.0, third)
    );
    for (name, text) in [("a.obj", obj), ("a.mtl", mtl), ("scene.json", &json)] {
        std::fs::write(folder.join(name), text).expect("the folder can be written to");
    }
}

/// Root of the mean squared difference, over the mean.
fn difference(a: &Picture, b: &Picture) -> f64 {
    let pairs = || a.pixels.iter().zip(&b.pixels);
    let squares: f64 = pairs().map(|(a, b)| f64::from((*a - *b).length_squared()) / 3.0).sum();
    let mean: f64 = pairs().map(|(_, b)| f64::from(b.element_sum()) / 3.0).sum();
    (squares * a.pixels.len() as f64).sqrt() / mean
}

fn bias(a: &Picture, b: &Picture) -> f64 {
    let mean = |picture: &Picture| picture.pixels.iter().map(|pixel| f64::from(pixel.element_sum())).sum::<f64>();
    mean(a) / mean(b) - 1.0
}

#[test]
fn all_lamps_together_are_the_picture_and_dimmed_ones_the_dimmed_picture() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = |name: &str| folder.path().join(name);
    let scene = folder.path().to_str().expect("text");
    write(folder.path(), "2");
    let mixed = at("mix.exr");
    let sum = succeed(&[&["mix", scene, "--frames", "144"], &SIZE[..]].concat(), &mixed);
    let plain = succeed(&[&["reference", scene, "--samples", "4096"], &SIZE[..]].concat(), &at("plain.exr"));
    // The reference path tracer has the light of all lamps at once; the noise of both is below this.
    assert!(
        difference(&sum, &plain) < 0.06 && bias(&sum, &plain).abs() < 0.01,
        "{} {}",
        difference(&sum, &plain),
        bias(&sum, &plain)
    );

    // Dimmed after the fact, from the file: no worker is asked.
    let mixed = mixed.to_str().expect("text");
    let dimmed = succeed(&["mix", mixed, "--set", "candle 3=0.4", "--set", "sky=0,0.5,1"], &at("dimmed.exr"));
    let only = succeed(&["mix", mixed, "--set", "candle 3=0.4"], &at("only.exr"));
    assert!(bias(&dimmed, &only) < 0.0);
    write(folder.path(), "0.8");
    let drawn = succeed(&[&["reference", scene, "--samples", "4096"], &SIZE[..]].concat(), &at("drawn.exr"));
    assert!(
        difference(&only, &drawn) < 0.06 && bias(&only, &drawn).abs() < 0.01,
        "{} {}",
        difference(&only, &drawn),
        bias(&only, &drawn)
    );
    assert!(difference(&only, &plain) > 0.1, "a candle is no trifle");

    // Solo, and the sum of solos.
    let solos =
        ["candle 2", "candle 3", "panel", "sky"].map(|lamp| succeed(&["mix", mixed, "--solo", lamp], &at("solo.exr")));
    let together = Picture::from_fn(24, 18, |x, y| solos.iter().map(|solo| solo.at(x, y)).sum());
    assert!(difference(&together, &sum) < 1e-6);

    let unknown = run(&["mix", mixed, "--set", "candle 9=1", "-o", at("x.exr").to_str().expect("text")]);
    let said = String::from_utf8_lossy(&unknown.stderr);
    assert!(said.contains("no lamp `candle 9`; there are: candle 2, candle 3, panel, sky"), "{said}");
    assert_eq!(unknown.status.code(), Some(2));
    let plain = run(&["mix", at("plain.exr").to_str().expect("text"), "-o", at("x.exr").to_str().expect("text")]);
    assert!(String::from_utf8_lossy(&plain.stderr).contains("has no layer for each lamp"), "a plain picture");
}
