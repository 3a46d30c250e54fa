//! A master that is given another token while it runs: real programs, real QUIC, one file.

use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, Instant};

use runtime::cluster::{Cluster, ClusterOptions, Event, Status};
use tests::clusters::wait_for;
use tests::programs::{PATIENCE, Process};

/// `igi-master token --rotate FILE`; the new token.
fn rotate(file: &Path, more: &[&str]) -> String {
    let file = file.to_str().expect("a readable path");
    let mut made = Process::master(&[&["token", "--rotate", file], more].concat());
    let token = made.lines().next().expect("it prints the token");
    assert_eq!(made.end().0, Some(0));
    token
}

/// A cluster whose tokens are in a file.
fn with_tokens(file: &Path) -> Cluster {
    let listen = Some("127.0.0.1:0".parse().expect("an address"));
    let token_file = Some(file.to_path_buf());
    Cluster::start(ClusterOptions { listen, token_file, ..ClusterOptions::default() }).expect("a cluster starts")
}

fn number(status: &Status, name: &str) -> Option<u32> {
    status.list.iter().find(|info| info.name == name).map(|info| info.worker)
}

#[test]
fn a_running_master_takes_another_token_and_the_old_one_opens_nothing_any_more() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("tokens");
    let first = rotate(&file, &[]);
    let mut cluster = with_tokens(&file);
    assert_eq!(cluster.token().expect("it listens").to_string(), first);
    let scenes = Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("the workspace").join("scenes/cornell");
    cluster.publish(Arc::new(scenes::read::load(&scenes).expect("it is sound").scene)).expect("it can be sent");

    let master = cluster.address().expect("it listens").to_string();
    let with =
        |name: &str, token: &str| Process::worker_with(token, &["--master", &master, "--threads", "1", "--name", name]);
    let path = file.to_str().expect("a readable path");
    let by_file = ["--master", &master, "--threads", "1", "--name", "by file", "--token-file", path];
    let _by_file = Process::worker(&by_file);
    let by_token = with("by token", &first);
    let before = wait_for(&mut cluster, "two workers", |status| status.ready == 2);

    // With grace, both tokens are good, and nobody has to go.
    let second = rotate(&file, &["--grace", "1h"]);
    wait_for_token(&cluster, &second);
    let old = with("late, with the old token", &first);
    let new = with("late, with the new token", &second);
    let during = wait_for(&mut cluster, "four workers", |status| status.ready == 4);
    for name in ["by file", "by token"] {
        assert_eq!(number(&during, name), number(&before, name), "{name} had to come again");
    }

    // Without, who came in with one of them is sent away, and comes back only with the new one.
    let third = rotate(&file, &[]);
    wait_for_token(&cluster, &third);
    let after = wait_for(&mut cluster, "the one with the file", |status| {
        let again = number(status, "by file").filter(|again| Some(*again) != number(&before, "by file"));
        status.list.len() == 1 && status.ready == 1 && again.is_some()
    });
    assert!(number(&after, "by file").is_some(), "{after:?}");
    for process in [by_token, old, new] {
        let (code, said) = process.end();
        assert_eq!(code, Some(3), "{said}");
        assert!(said.contains("its token is valid no more"), "{said}");
    }
    for revoked in [&first, &second] {
        let (code, said) = with("too late", revoked).end();
        assert_eq!(code, Some(3), "{said}");
    }
    let left = std::iter::from_fn(|| cluster.next(Duration::from_millis(10)));
    assert!(!left.into_iter().any(|event| matches!(event, Event::WorkerJoined { name, .. } if name == "too late")));
}

#[test]
fn a_broken_file_changes_nothing_and_a_revoked_token_ends_by_itself() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("tokens");
    let first = rotate(&file, &[]);
    let mut cluster = with_tokens(&file);
    let master = cluster.address().expect("it listens").to_string();
    let worker = Process::worker_with(&first, &["--master", &master, "--threads", "1"]);
    wait_for(&mut cluster, "a worker", |status| status.workers == 1);

    let good = std::fs::read_to_string(&file).expect("the file is there");
    std::fs::write(&file, "nonsense\n").expect("it can be written");
    std::thread::sleep(Duration::from_millis(2500));
    assert_eq!(cluster.token().expect("it listens").to_string(), first);
    assert_eq!(cluster.status().workers, 1);

    // Its grace is over while nobody looks at the file.
    std::fs::write(&file, good).expect("it can be written");
    let second = rotate(&file, &["--grace", "4s"]);
    wait_for_token(&cluster, &second);
    assert_eq!(cluster.status().workers, 1, "its grace has not ended");
    wait_for(&mut cluster, "the worker to go", |status| status.workers == 0);
    assert_eq!(worker.end().0, Some(3));
}

/// `igi-master token` with these; what it prints.
fn made(more: &[&str]) -> String {
    let mut made = Process::master(&[&["token"], more].concat());
    let token = made.lines().next().expect("it prints a token");
    assert_eq!(made.end().0, Some(0));
    token
}

/// A worker with a token of its own is sent away alone; and with what workers are given, nobody can be the master.
#[test]
fn one_worker_is_revoked_alone_and_no_worker_plays_the_master() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("tokens");
    let path = file.to_str().expect("a readable path");
    rotate(&file, &[]);
    let (shared, own) = (made(&["--for-workers", path]), made(&["--add", path]));
    let mut cluster = with_tokens(&file);
    let master = cluster.address().expect("it listens").to_string();
    let with =
        |name: &str, token: &str| Process::worker_with(token, &["--master", &master, "--threads", "1", "--name", name]);
    let (_stays, goes) = (with("stays", &shared), with("goes", &own));
    let both = wait_for(&mut cluster, "two workers", |status| status.workers == 2);

    let text = std::fs::read_to_string(&file).expect("the file is there");
    let last = text.trim_end().rfind('\n').expect("several lines");
    std::fs::write(&file, &text[..=last]).expect("it can be written");
    let left = wait_for(&mut cluster, "one to go", |status| status.workers == 1);
    assert_eq!(number(&left, "stays"), number(&both, "stays"));
    let (code, said) = goes.end();
    assert_eq!((code, said.contains("its token is valid no more")), (Some(3), true), "{said}");

    let listen = Some("127.0.0.1:0".parse().expect("an address"));
    for half in [shared, own] {
        let options = ClusterOptions { listen, token: Some(half), ..ClusterOptions::default() };
        let refused = Cluster::start(options).err().expect("it is no master's").to_string();
        assert!(refused.contains("the workers' half of a token"), "{refused}");
    }
}

fn wait_for_token(cluster: &Cluster, token: &str) {
    let deadline = Instant::now() + PATIENCE;
    while cluster.token().is_none_or(|now| now.to_string() != token) {
        assert!(Instant::now() < deadline, "the master does not take the new token");
        std::thread::sleep(Duration::from_millis(20));
    }
}
