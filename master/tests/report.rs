//! `igi-master report` from outside: the files it leaves, and how it takes what goes wrong.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use frame::Picture;
use runtime::files::{encode_exr, read_picture};

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

/// A walk through the Cornell box: three looks and a lamp that is dimmed, a picture each.
fn recording(folder: &Path) -> PathBuf {
    let look = |x: f32| {
        format!(
            "{{\"t\":{x},\"look\":{{\"origin\":[{x},1.0,3.4],\"target\":[0,1,0],\"up\":[0,1,0],\"fov_y_deg\":40,\"width\":24,\
             \"height\":20}}}}"
        )
    };
    let begun = look(0.0).replace(
        "{\"t\":0,\"look\":",
        "{\"igi_session\":3,\"scene\":\"SCENE\",\"time\":0.0,\"seed\":1,\
        \"world\":null,\"method\":{\"name\":\"igi\",\"settings\":{}},\"camera\":",
    );
    let begun = begun.replace("SCENE", &scene("cornell").display().to_string());
    let shown = |batches: u32| format!("{{\"t\":0,\"shown\":{{\"batches\":{batches},\"effort\":0.25}}}}");
    let hide = "{\"t\":0.3,\"edit\":[{\"PieceVisible\":{\"object\":0,\"piece\":2,\"visible\":false}}]}".to_owned();
    let lines = [begun, look(0.1), shown(1), look(0.2), shown(1), hide, shown(1)];
    let path = folder.join("walk.session");
    std::fs::write(&path, lines.join("\n") + "\n").expect("it can be written");
    path
}

fn session_report(session: &Path, more: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_igi-master"));
    command.arg("report").arg("--session").arg(session).args(["--threads", "2", "--quiet"]).args(more);
    command.output().expect("igi-master runs")
}

#[test]
fn a_recording_is_judged_method_by_method_and_the_same_again_with_the_truths_that_are_kept() {
    let folder = tempfile::tempdir().expect("a folder");
    let session = recording(folder.path());
    let (out, truths) = (folder.path().join("report"), folder.path().join("truths"));
    let [out_text, truths_text] = [&out, &truths].map(|path| path.display().to_string());
    let more = [
        "--methods",
        "igi,reference,render-cache,render-cache-paper",
        "--samples",
        "2",
        "--truth-frames",
        "4",
        "--truths",
        &truths_text,
        "-o",
        &out_text,
    ];
    let output = session_report(&session, &more);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let page = page(folder.path());
    assert!(page.matches("<svg").count() == 2 && page.contains("data:image/png;base64,") && !page.contains("<script"));
    let rows = points(folder.path());
    let of = |method: &str, played: &str| -> Vec<f64> {
        let is_it = |row: &&BTreeMap<String, String>| row["method"] == method && row["played"] == played;
        rows.iter().filter(is_it).map(|row| row["flip"].parse().expect("a number")).collect()
    };
    for method in ["igi", "reference", "render-cache", "render-cache-paper"] {
        let flips = of(method, "step");
        assert_eq!(flips.len(), 3, "{method}: two pictures, and the standing one");
        assert!(flips.iter().all(|flip| *flip > 0.0 && *flip < 0.9), "{method}: {flips:?}");
        assert!(!of(method, "time").is_empty(), "{method} is shown in real time");
    }
    // What is looked at last has lost a wall: whoever judged by the state before it would see it.
    let kept = || std::fs::read_dir(&truths).expect("a folder").count();
    let before = kept();
    assert!((2..=4).contains(&before), "{before}");
    let markdown = std::fs::read_to_string(out.join("tables.md")).expect("tables");
    assert!(markdown.contains("| igi | in step |") && markdown.contains("| render-cache-paper | real time |"));

    // Another report finds the truths, and in step the same bits.
    let more = [&more[..], &["--pace", "step", "--threads", "1"]].concat();
    let more: Vec<&str> = more.into_iter().collect();
    let first: Vec<_> = rows.iter().filter(|row| row["played"] == "step").cloned().collect();
    let mut command = Command::new(env!("CARGO_BIN_EXE_igi-master"));
    command.arg("report").arg("--session").arg(&session).arg("--quiet").args(&more);
    assert!(command.status().expect("igi-master runs").success());
    assert_eq!(points(folder.path()), first);
    assert_eq!(kept(), before);
}

#[test]
fn ratios_make_a_table_and_fewer_samples_are_worse() {
    let folder = tempfile::tempdir().expect("a folder");
    let session = recording(folder.path());
    let out = folder.path().join("report").display().to_string();
    let more = [
        "--methods=render-cache,igi",
        "--pace=step",
        "--mismatch=1,16,256",
        "--samples=3",
        "--truth-frames=16",
        "-o",
        &out,
    ];
    let output = session_report(&session, &more);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let markdown = std::fs::read_to_string(folder.path().join("report/tables.md")).expect("tables");
    assert!(markdown.contains("| recording | method | 1 | 16 | 256 |"), "{markdown}");
    let row = markdown.lines().find(|line| line.starts_with("| walk | render-cache |")).expect("a row of the sweep");
    let flips: Vec<f64> = row.split('|').filter_map(|cell| cell.trim().parse().ok()).collect();
    assert!(flips.len() == 3 && flips[0] < flips[2], "{flips:?}");
    assert!(page(folder.path()).matches("<svg").count() == 3);
}

#[test]
fn recordings_and_settings_that_cannot_be_used_are_refused_in_words() {
    let folder = tempfile::tempdir().expect("a folder");
    let session = recording(folder.path());
    let text = std::fs::read_to_string(&session).expect("it was written");
    let variant = |name: &str, text: &str| {
        let path = folder.path().join(name);
        std::fs::write(&path, text).expect("it can be written");
        path
    };
    let unshown: String = text.lines().filter(|line| !line.contains("shown")).map(|line| format!("{line}\n")).collect();
    let out = folder.path().join("report").display().to_string();
    for (path, more, words) in [
        (variant("unshown.session", &unshown), vec![], "no moving picture is in it"),
        (variant("damaged.session", &text.replacen("\"look\"", "\"lo\\u0000k\"", 1)), vec![], "damaged.session:2:"),
        (variant("beyond.session", &text.replace("\"object\":0", "\"object\":99")), vec![], "at 0.3 s"),
        (folder.path().join("missing.session"), vec![], "missing.session"),
        (session.clone(), vec!["--mismatch", "0"], "--mismatch"),
        (session.clone(), vec!["--methods", "unheard-of"], "unheard-of"),
        (session.clone(), vec!["--methods", "igi+oidn"], "not denoised"),
        (session.clone(), vec!["--methods", "igi", "--variant", "igi=--vpls 3"], "two methods are called igi"),
        (session.clone(), vec!["--variant", "none=--method render-cache --points 0"], "points"),
        (session.clone(), vec!["--runs", "3"], "--runs"),
    ] {
        let output = session_report(&path, &[&more[..], &["-o", &out]].concat());
        let said = String::from_utf8_lossy(&output.stderr);
        assert!(!output.status.success() && said.contains(words), "{}: {said}", path.display());
    }
}
