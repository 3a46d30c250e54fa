//! `igi-master scale --listen` with real workers: it measures with those that are connected, as many as it is told.

use std::io::BufRead;

use tests::programs::{Process, free_address};

#[test]
fn scale_measures_with_the_workers_that_are_connected() {
    let folder = tempfile::tempdir().expect("a folder");
    let scene = concat!(env!("CARGO_MANIFEST_DIR"), "/../scenes/cornell");
    let (output, address) = (folder.path().to_str().expect("a readable path"), free_address().to_string());
    let mut token = Process::master(&["token"]);
    let token = token.lines().next().expect("it prints one");
    let arguments = ["scale", scene, "--size", "48x36", "--listen", &address, "--clients", "1,2"];
    let more = ["--frames", "2", "--simulate", "4", "--vpls", "4", "-o", output];
    let mut master = Process::master_with(&[("IGI_TOKEN", &token)], &[&arguments[..], &more].concat());
    let join =
        |name: &str| Process::worker_with(&token, &["--master", &address, "--name", name, "--threads", "1", "--once"]);
    let workers = [join("one"), join("another")];
    // It says how it goes; nobody else reads that.
    let said: Vec<_> = master.0.stderr.take().map(std::io::BufReader::new).expect("it is piped").lines().collect();
    let status = master.0.wait().expect("a child can be waited for");
    assert!(status.success(), "{said:?}");
    for worker in workers {
        assert_eq!(worker.end().0, Some(0), "the master says good-bye");
    }

    let csv = std::fs::read_to_string(folder.path().join("scale.csv")).expect("there is a table");
    let rows: Vec<Vec<&str>> = csv.lines().map(|line| line.split(',').collect()).collect();
    let column = |name: &str| rows[0].iter().position(|column| *column == name).expect("the column is there");
    let measured: Vec<_> = rows.iter().filter(|row| row[0] == "measured").collect();
    let number = |row: &[&str], name: &str| row[column(name)].parse::<f64>().expect("a number");
    assert_eq!(measured.iter().map(|row| row[column("clients")]).collect::<Vec<_>>(), ["1", "2"]);
    assert_eq!(number(measured[0], "cores"), 1.0, "all are counted in threads of the first");
    // The other's thread may have had less of the machine, or more.
    let both = number(measured[1], "cores");
    assert!((1.1..=6.0).contains(&both), "{both}");
    for row in measured {
        assert!(number(row, "frames_per_second") > 0.0 && number(row, "sets_per_client_and_frame") >= 1.0, "{row:?}");
        assert!((0.05..=1.5).contains(&number(row, "quota_used")), "{row:?}");
        assert_eq!(row.len(), rows[0].len());
    }
    let page = std::fs::read_to_string(folder.path().join("index.html")).expect("there is a page");
    assert!(page.contains("2 clients that were connected") && page.contains(&format!("--listen {address}")), "{page}");
    assert!(!page.contains("emulates"), "{page}");
}
