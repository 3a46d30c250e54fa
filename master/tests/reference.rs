//! `igi-master reference` and `igi-master export` as a person runs them.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use runtime::files::read_record;

fn igi(folder: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_igi-master")).current_dir(folder).args(arguments).output().expect("it starts")
}

fn shipped(name: &str) -> String {
    let path: PathBuf = [env!("CARGO_MANIFEST_DIR"), "..", "scenes", name].iter().collect();
    path.to_string_lossy().into_owned()
}

/// Draws a tiny reference of the Cornell box into `file`.
fn draw(folder: &Path, file: &str, more: &[&str]) -> Output {
    let cornell = shipped("cornell");
    igi(folder, &[&["reference", &cornell, "-o", file, "--size", "20x14"], more].concat())
}

#[test]
fn interrupted_or_not_and_by_any_number_of_hands_it_is_the_same_picture() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    assert!(draw(path, "straight.exr", &["--samples", "64", "--workers", "embedded:1"]).status.success());
    assert!(draw(path, "twice.exr", &["--samples", "32", "--workers", "embedded:3"]).status.success());
    let again = draw(path, "twice.exr", &["--samples", "60", "--workers", "embedded:2"]);
    assert!(String::from_utf8_lossy(&again.stderr).contains("32 samples a pixel are there"));
    let [straight, twice] = ["straight.exr", "twice.exr"].map(|file| read_record(&path.join(file)).unwrap());
    assert_eq!(straight.state.frames, 4);
    assert_eq!(straight, twice, "every bit, the metadata included");
}

#[test]
fn other_pictures_are_not_gone_on_with() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    assert!(draw(path, "a.exr", &["--samples", "16"]).status.success());
    for (more, word) in
        [(["--seed", "1"], "seed"), (["--max-bounces", "2"], "max_bounces"), (["--size", "8x8"], "camera")]
    {
        let cornell = shipped("cornell");
        let size = if word == "camera" { &[][..] } else { &["--size", "20x14"][..] };
        let output = igi(path, &[&["reference", &cornell, "-o", "a.exr", "--samples", "32"], size, &more].concat());
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(!output.status.success() && said.contains(word) && said.contains("--fresh"), "{said}");
    }
    let output = draw(path, "a.png", &["--samples", "16"]);
    assert!(String::from_utf8_lossy(&output.stderr).contains(".exr"));
}

#[test]
fn noise_decides_when_it_is_enough() {
    let folder = tempfile::tempdir().unwrap();
    assert!(draw(folder.path(), "a.exr", &["--until-noise", "0.02"]).status.success());
    let record = read_record(&folder.path().join("a.exr")).unwrap();
    let noise: f64 = record.metadata["noise_rel_mse"].parse().unwrap();
    assert!(noise <= 0.02, "{noise}");
}

#[test]
fn scenes_are_exported_with_all_their_parts() {
    let folder = tempfile::tempdir().unwrap();
    let output = igi(folder.path(), &["export", &shipped("veach_door"), "--mitsuba", "out", "--size", "64x48"]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let xml = std::fs::read_to_string(folder.path().join("out/scene.xml")).unwrap();
    for part in ["perspective", "twosided", "dielectric", "bitmap", "type=\"area\"", "value=\"64\""] {
        assert!(xml.contains(part), "{part} is missing");
    }
    let files = xml.split("name=\"filename\" value=\"").skip(1).filter_map(|rest| rest.split('"').next());
    let mut count = 0;
    for file in files {
        assert!(folder.path().join("out").join(file).is_file(), "{file} is missing");
        count += 1;
    }
    assert!(count > 10);
}
