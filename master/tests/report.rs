//! `igi-master report` from outside: the files it leaves, and how it takes what goes wrong.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use frame::Picture;
use master::files::{encode_exr, read_picture};

/// A shipped scene.
fn scene(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenes").join(name)
}

/// A report on the Cornell box, at 20×20 unless `more` says otherwise, three very short runs of every method.
fn report(folder: &Path, more: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_igi-master"));
    command.arg("report").arg(scene("cornell")).args(["--runs", "3", "--seconds", "0.3"]);
    if !more.contains(&"--size") {
        command.args(["--size", "20x20"]);
    }
    if !more.contains(&"--methods=igi") {
        command.arg("--without-pruning");
    }
    command.args(["--threads", "2", "--quiet"]).arg("-o").arg(folder.join("report")).args(more);
    command.output().expect("igi-master runs")
}

fn page(folder: &Path) -> String {
    std::fs::read_to_string(folder.join("report/index.html")).expect("there is a page")
}

/// Rows of points.csv, by column.
fn points(folder: &Path) -> Vec<BTreeMap<String, String>> {
    let text = std::fs::read_to_string(folder.join("report/points.csv")).expect("there are numbers");
    let mut lines = text.lines();
    let heading: Vec<String> = lines.next().expect("a heading").split(',').map(String::from).collect();
    let row = |line: &str| {
        let fields: Vec<String> = line.split(',').map(String::from).collect();
        assert_eq!(fields.len(), heading.len(), "{line}");
        heading.iter().cloned().zip(fields).collect()
    };
    lines.map(row).collect()
}

/// A renderer that is there at once, and shows `picture` in every run: a shell script.
fn fake(folder: &Path, name: &str, picture: &Picture) -> String {
    let (exr, script) = (folder.join(format!("{name}.exr")), folder.join(format!("{name}.sh")));
    std::fs::write(&exr, encode_exr(picture, &[], &[]).expect("it can be encoded")).expect("it can be written");
    let text = format!(
        "echo '{{\"prepared\": 0.5, \"version\": \"fake\"}}'\nfor run in 0 1 2; do for n in 1 2 4; do\n\
         echo \"{{\\\"run\\\": $run, \\\"samples\\\": $n, \\\"seconds\\\": 0.0$n, \\\"picture\\\": \\\"{}\\\"}}\"\ndone; done\n",
        exr.display()
    );
    std::fs::write(&script, text).expect("it can be written");
    format!("{name}=sh {}", script.display())
}

#[test]
fn a_report_is_a_page_that_needs_nothing_else_and_numbers() {
    let folder = tempfile::tempdir().expect("a folder");
    let reference = read_picture(&scene("cornell/ref.exr")).expect("it is shipped").shrunk(16).expect("16 divides 320");
    let right = fake(folder.path(), "right", &reference);
    let output =
        report(folder.path(), &["--peer", &right, "--peer", "nobody=/no/such/program", "--variant", "one=--vpls 2"]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));

    let page = page(folder.path());
    for outside in ["src=\"http", "href=\"http", "<script", "@import"] {
        assert!(!page.contains(outside), "the page needs {outside}");
    }
    assert!(page.contains("nobody: /no/such/program cannot be started"), "a peer that is missing gets a line");
    assert!(page.matches("<svg").count() == 2 && page.contains("data:image/png;base64,"));
    assert!(page.contains("--variant &#39;one=--vpls 2&#39;") || page.contains("--variant 'one=--vpls 2'"));

    let points = points(folder.path());
    let of = |method: &str| points.iter().filter(|p| p["method"] == method).collect::<Vec<_>>();
    let number = |point: &BTreeMap<String, String>, column: &str| point[column].parse::<f64>().expect("a number");
    for method in ["igi", "igi raw", "igi-paper", "igi-paper raw", "one", "one raw"] {
        let curve = of(method);
        assert!(curve.len() >= 2, "{method} has {} points", curve.len());
        let (first, last) = (curve[0], curve[curve.len() - 1]);
        assert!(number(last, "rel_mse") < number(first, "rel_mse"), "{method} gets better");
        assert!(number(last, "shadow_rays") > number(first, "shadow_rays") && number(last, "bytes") > 0.0);
        assert!(curve.iter().all(|point| point["non_finite"] == "0"));
    }
    let right = of("right");
    assert_eq!(right.len(), 3);
    assert!(right.iter().all(|point| number(point, "rel_mse") == 0.0 && point["runs"] == "3"), "{right:?}");

    let settings = std::fs::read_to_string(folder.path().join("report/settings.json")).expect("there are settings");
    assert!(settings.contains("--runs 3 --seconds 0.3 --seed 1") && settings.contains("fake: sh "));
}

#[test]
fn values_that_are_not_finite_fail_the_report_and_are_in_it() {
    let folder = tempfile::tempdir().expect("a folder");
    let broken =
        fake(folder.path(), "broken", &Picture::from_fn(20, 20, |x, _| glam::Vec3::splat(0.5 / (x as f32 - 3.0))));
    let output = report(folder.path(), &["--methods", "igi", "--peer", &broken]);
    assert_eq!(output.status.code(), Some(1));
    assert!(String::from_utf8_lossy(&output.stderr).contains("were not finite"));
    assert!(
        page(folder.path()).contains("broken: 540 values are not finite"),
        "3 looks of 3 runs, 20 pixels, 3 channels"
    );
}

#[test]
fn renderers_that_talk_nonsense_are_trouble_of_their_own() {
    let folder = tempfile::tempdir().expect("a folder");
    let small = fake(folder.path(), "small", &Picture::black(3, 3));
    let talk = |name: &str, text: &str| {
        let path = folder.path().join(name);
        std::fs::write(&path, text).expect("it can be written");
        format!("{name}=sh {}", path.display())
    };
    let peers = [
        talk("babble", "echo hello"),
        talk("late", "echo '{\"run\": 2, \"share\": 0.5}'"),
        talk("silent", "true"),
        talk("failing", "echo first >&2; echo the disk is full >&2; exit 3"),
        small,
    ];
    let mut more = vec!["--methods", "igi"];
    more.extend(peers.iter().flat_map(|peer| ["--peer", peer]));
    let output = report(folder.path(), &more);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let page = page(folder.path());
    for trouble in [
        "babble: it said: hello: not a JSON object",
        "run 2 before run 0",
        "silent: ended without a picture",
        "failing: the disk is full",
        "its picture is 3x3 instead of 20x20",
    ] {
        assert!(page.contains(trouble), "the page does not say: {trouble}");
    }
}

#[test]
fn what_cannot_be_measured_is_refused_before_the_work() {
    let folder = tempfile::tempdir().expect("a folder");
    let refused = |more: &[&str], code: i32, says: &str| {
        let output = report(folder.path(), more);
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(output.status.code() == Some(code) && said.contains(says), "{more:?}: {:?}, {said}", output.status);
        assert!(!folder.path().join("report").exists(), "{more:?} leaves a report");
    };
    refused(&["--size", "30x30"], 2, "no whole multiple of the size asked for: try 320x320, 160x160");
    refused(&["--reference", "/no/ref.exr"], 1, "/no/ref.exr: there is no such reference");
    refused(&["--variant", "igi=--vpls 3"], 2, "two methods are called igi");
    refused(&["--methods", "none"], 2, "nothing to measure");
    refused(&["--variant", "odd=--no-such-flag"], 2, "unexpected argument");
    refused(&["--peer", "odd"], 2, "NAME=COMMAND");
}

#[test]
fn what_leaving_out_saves_is_a_chapter_and_a_table_for_programs() {
    let folder = tempfile::tempdir().expect("a folder");
    let output = report(folder.path(), &["--methods=igi"]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let page = page(folder.path());
    assert!(page.contains("id=\"left-out\"") && page.contains("cornell does without: "), "there is no such chapter");
    let text = std::fs::read_to_string(folder.path().join("report/left-out.csv")).expect("there are numbers");
    let rows: Vec<Vec<&str>> = text.lines().map(|line| line.split(',').collect()).collect();
    assert_eq!(rows.iter().map(|row| row[0]).collect::<Vec<_>>(), ["scene", "a plain room", "cornell"]);
    for row in &rows[1..] {
        let number = |column: usize| row[column].parse::<f64>().expect("a number");
        assert_eq!((row.len(), row[13]), (rows[0].len(), "true"), "both pipelines draw the same bits");
        assert!(number(2) > 0.0 && number(3) > 0.0 && number(5) <= number(4) && number(4) <= number(6), "{row:?}");
        let smaller = |columns: [usize; 2]| number(columns[1]) <= number(columns[0]);
        assert!(smaller([7, 8]) && smaller([9, 10]) && smaller([11, 12]), "leaving out makes nothing larger: {row:?}");
    }
}
