//! `igi-master selftest` as people run it: what it says while it runs, and when it is interrupted.

use std::io::{BufRead, BufReader, Read};
use std::process::{Child, Command, Stdio};

use serde_json::Value;

fn start(args: &[&str]) -> Child {
    let mut command = Command::new(env!("CARGO_BIN_EXE_igi-master"));
    command.arg("selftest").args(args).env_remove("RUST_LOG");
    command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("the program starts")
}

/// Presses Ctrl-C after the first line that contains `word`; exit code, and all that it wrote from then on.
fn interrupted_after(word: &str, args: &[&str]) -> (Option<i32>, String) {
    let mut selftest = start(args);
    let mut lines = BufReader::new(selftest.stdout.take().expect("it is piped"));
    let mut line = String::new();
    while !line.contains(word) {
        line.clear();
        assert!(lines.read_line(&mut line).expect("it writes text") > 0, "it ended before {word}");
    }
    let sent = Command::new("kill").args(["-INT", &selftest.id().to_string()]).status().expect("kill runs");
    assert!(sent.success());
    let mut rest = String::new();
    lines.read_to_string(&mut rest).expect("it writes text");
    (selftest.wait().expect("it ends").code(), rest)
}

#[test]
fn it_says_how_long_it_takes_and_how_well_all_is_known() {
    let output = start(&["furnace-limited", "fresnel"]).wait_with_output().expect("it ends");
    let [out, err] = [&output.stdout, &output.stderr].map(|bytes| String::from_utf8_lossy(bytes).into_owned());
    assert_eq!(output.status.code(), Some(0), "{out}{err}");
    assert!(err.starts_with("3 rows, about "), "{err}");
    assert!(out.contains("furnace-limited") && out.contains("machinery"), "{out}");
    assert!(out.contains(" 0 wrong, 0 too noisy to tell") && out.ends_with("none could hide a bias of 2 %\n"), "{out}");
}

#[test]
fn ctrl_c_ends_it_with_the_table_so_far_and_a_code_that_says_so() {
    let (code, rest) = interrupted_after("furnace-cube", &["--threads", "1"]);
    assert_eq!(code, Some(130), "{rest}");
    assert!(rest.contains(" right, 0 wrong, ") && rest.contains("INTERRUPTED after "), "{rest}");
    assert!(!rest.contains("NaN") && !rest.contains("WRONG"), "what was being measured does not count: {rest}");

    let (code, rest) = interrupted_after("furnace-cube", &["--threads", "1", "--json"]);
    assert_eq!(code, Some(130), "{rest}");
    let sums: Value = serde_json::from_str(rest.lines().last().expect("a last line")).expect("it is JSON");
    assert_eq!((sums["whole"].as_bool(), sums["wrong"].as_u64()), (Some(false), Some(0)), "{sums}");
}
