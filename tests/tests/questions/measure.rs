//! `igi-master measure` against closed forms: from a file to the numbers of its table.

use std::f64::consts::PI;
use std::fs;
use std::path::Path;
use std::process::{Command, Output};

use glam::DVec3;
use serde_json::Value;
use tests::programs::program;

/// Lumens of a watt.
const LUMENS: f64 = 683.0;

/// A point of the table: metres from the grid's corner, lx, and half of its 95 % interval.
struct Row {
    place: [f64; 2],
    lux: f64,
    within: f64,
}

fn run(folder: &Path, flags: &[&str]) -> Output {
    let mut command = Command::new(program("igi-master"));
    command.arg("measure").arg(folder).args(flags).args(["--json", "--quiet", "--workers", "embedded:2", "-o"]);
    command.arg(folder.join("out")).output().expect("igi-master runs")
}

/// What it says to programs, and every point.
fn measured(folder: &Path, flags: &[&str]) -> (Value, Vec<Row>) {
    let output = run(folder, flags);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let lines = String::from_utf8(output.stdout).expect("text");
    let mut events = lines.lines().filter_map(|line| serde_json::from_str::<Value>(line).ok());
    let told = events.rfind(|event| event["event"] == "measured").expect("it says what was measured");
    for ending in ["html", "png"] {
        assert!(folder.join(format!("out.{ending}")).is_file(), "{ending}");
    }
    let table = fs::read_to_string(folder.join("out.csv")).expect("a table");
    let rows = table.lines().filter(|line| line.starts_with(|c: char| c.is_ascii_digit())).map(|line| {
        let numbers: Vec<f64> = line.split(',').map(|number| number.parse().expect("a number")).collect();
        Row { place: [numbers[2], numbers[3]], lux: numbers[4], within: numbers[5] }
    });
    (told["grid"].clone(), rows.collect())
}

fn write(folder: &Path, obj: &str, mtl: &str, json: &str) {
    for (name, text) in [("a.obj", obj), ("a.mtl", mtl), ("scene.json", json)] {
        fs::write(folder.join(name), text).expect("the folder can be written to");
    }
}

/// A small source over a floor that reflects nothing: E = I cos³θ / h², on the floor and on planes above it.
#[test]
fn a_small_source_lights_a_plane_by_the_cube_of_the_cosine() {
    let folder = tempfile::tempdir().expect("a folder");
    write(
        folder.path(),
        "mtllib a.mtl\no floor\nusemtl black\nv -3 0 -2\nv -3 0 2\nv 3 0 2\nv 3 0 -2\nf 1 2 3 4\n",
        "newmtl black\nillum 0\nKd 0 0 0\n",
        r#"{ "obj": "a.obj", "background": [0, 0, 0],
            "lights": [{ "type": "point", "position": [0.5, 2.5, -0.25], "intensity": [2, 2, 2] }],
            "camera": { "origin": [0, 1.5, 5], "target": [0, 0, 0], "fov_y_deg": 40, "width": 32, "height": 24 } }"#,
    );
    let (on_floor, plane) = (["--on", "floor"], ["--plane", "0.75", "--area", "-1,-1,2,1"]);
    for (flags, corner, height) in [
        (on_floor.to_vec(), [-3.0, -2.0], 2.5),
        ([&on_floor[..], &["--above", "0.75"]].concat(), [-3.0, -2.0], 1.75),
        (plane.to_vec(), [-1.0, -1.0], 1.75),
    ] {
        let (told, rows) = measured(folder.path(), &[&flags[..], &["--error", "0.005"]].concat());
        assert_eq!(told["points"].as_u64(), Some(rows.len() as u64), "{told}");
        let expected = |row: &Row| {
            let away = (row.place[0] + corner[0] - 0.5).hypot(row.place[1] + corner[1] + 0.25);
            let cosine: f64 = height / f64::hypot(height, away);
            2.0 * LUMENS * cosine.powi(3) / (height * height)
        };
        for row in &rows {
            let expected = expected(row);
            assert!(
                (row.lux / expected - 1.0).abs() < 0.01,
                "{flags:?} {:?}: {} lx, not {expected}",
                row.place,
                row.lux
            );
        }
        let all: Vec<f64> = rows.iter().map(expected).collect();
        let least = all.iter().copied().fold(f64::INFINITY, f64::min);
        let mean = all.iter().sum::<f64>() / all.len() as f64;
        for (figure, truth) in [("Emin", least), ("Eavg", mean), ("Uo = Emin/Eavg", least / mean)] {
            let value = told["figures"][figure]["value"].as_f64().expect("a number");
            assert!((value / truth - 1.0).abs() < 0.01, "{flags:?} {figure}: {value}, not {truth}");
        }
    }
}

/// A closed room, all of it of luminance 0.1 and reflectance 0.5.
fn furnace(folder: &Path) {
    write(
        folder,
        "mtllib a.mtl\no room\nusemtl white\nv 0 0 0\nv 2 0 0\nv 2 2 0\nv 0 2 0\nv 0 0 2\nv 2 0 2\nv 2 2 2\nv 0 2 2\n\
         f 1 5 6 2\nf 4 3 7 8\nf 1 2 3 4\nf 5 8 7 6\nf 1 4 8 5\nf 2 6 7 3\n",
        "newmtl white\nillum 0\nKd 0.5 0.5 0.5\nKe 0.1 0.1 0.1\n",
        r#"{ "obj": "a.obj", "background": [0, 0, 0],
            "camera": { "origin": [1, 1, 1.9], "target": [1, 1, 0], "fov_y_deg": 60, "width": 32, "height": 24 } }"#,
    );
}

/// In a room whose walls all shine and reflect alike, illuminance is π L / (1 − ρ) everywhere and on anything, also on a plane in
/// the air; and the errors that are stated are those that are made.
#[test]
fn in_a_white_furnace_every_point_is_as_bright() {
    let folder = tempfile::tempdir().expect("a folder");
    furnace(folder.path());
    let flags = ["--plane", "1", "--border", "0.2", "--error", "0.03", "--seconds", "100"];
    let (told, rows) = measured(folder.path(), &flags);
    let truth = PI * 0.1 / (1.0 - 0.5) * LUMENS;
    let [value, within] = ["value", "within"].map(|part| told["figures"]["Eavg"][part].as_f64().expect("a number"));
    assert!(within < 0.03 * truth && (value - truth).abs() < 2.0 * within, "{value} ± {within}, not {truth}");
    let sure = rows.iter().filter(|row| (row.lux - truth).abs() <= row.within).count();
    assert!(4 * sure >= 3 * rows.len(), "of {} points, {sure} are within their intervals of {truth}", rows.len());
}

/// In that room all that the eye sees is lamp, of luminance L, and all that comes back is background, L ρ / (1 − ρ).
#[test]
fn glare_in_a_white_furnace_is_that_of_a_lamp_all_around() {
    let folder = tempfile::tempdir().expect("a folder");
    furnace(folder.path());
    let output = run(folder.path(), &["--ugr", "--error", "0.01", "--seconds", "100"]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let lines = String::from_utf8(output.stdout).expect("text");
    let mut events = lines.lines().filter_map(|line| serde_json::from_str::<Value>(line).ok());
    let told = events.rfind(|event| event["event"] == "measured").expect("it says what was measured");
    let glare = &told["glare"];
    let figure = |name: &str| [&glare[name]["value"], &glare[name]["within"]].map(|part| part.as_f64().expect(name));
    let [background, within] = figure("background");
    let truth = 0.1 * 0.5 / (1.0 - 0.5) * LUMENS;
    assert!((background - truth).abs() < (2.0 * within).max(0.01 * truth), "{background} ± {within}, not {truth}");
    let solid_angle = glare["solid_angle"].as_f64().expect("a number");
    assert!((solid_angle / (2.0 * PI) - 1.0).abs() < 0.01, "half of all directions: {solid_angle}");
    // ∫ dω / p² over what is ahead.
    const STEPS: u32 = 400;
    let mut sum = 0.0;
    for row in 0..STEPS {
        let z = (f64::from(row) + 0.5) / f64::from(STEPS);
        for column in 0..STEPS {
            let (sin, cos) = (2.0 * PI * (f64::from(column) + 0.5) / f64::from(STEPS)).sin_cos();
            let across = (1.0 - z * z).sqrt();
            let direction = DVec3::new(across * cos, across * sin, -z);
            let index = frame::measure::position_index([DVec3::X, DVec3::Y, DVec3::NEG_Z], direction).expect("ahead");
            sum += 2.0 * PI / f64::from(STEPS * STEPS) / (index * index);
        }
    }
    let luminance = 0.1 * LUMENS;
    let expected = 8.0 * (0.25 / truth * luminance * luminance * sum).log10();
    let [ugr, within] = figure("ugr");
    assert!((ugr - expected).abs() < 0.1 && within < 0.3, "{ugr} ± {within}, not {expected}");
}

#[test]
fn what_cannot_be_measured_is_refused_in_words() {
    let folder = tempfile::tempdir().expect("a folder");
    write(
        folder.path(),
        "mtllib a.mtl\no floor\nusemtl grey\nv 0 0 0\nv 0 0 1\nv 1 0 1\nf 1 2 3\n",
        "newmtl grey\nillum 0\nKd 0.5 0.5 0.5\n",
        r#"{ "obj": "a.obj", "background": [1, 1, 1] }"#,
    );
    for (flags, words, code) in [
        (&["--on", "ceiling"][..], "no visible object or material is called `ceiling`; there are: floor, grey", 3),
        (&["--on", "floor", "--border", "9"], "nothing is left of the area within its border", 3),
        (&["--plane", "high"], "not a number", 2),
        (&[], "--plane", 2),
        (&["--plane", "1", "--scale", "9,3"], "the smaller first", 2),
    ] {
        let output = run(folder.path(), flags);
        let said = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.code() == Some(code) && said.contains(words), "{flags:?}: {said}");
    }
}
