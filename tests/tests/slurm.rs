//! The batch script under a real Slurm: array tasks draw a picture while one is cancelled, one is put back into the
//! queue, one runs into its time limit, one is killed and others join; the picture has the bits that one process draws.
//!
//! Needs a Slurm that this machine is part of, with room for three tasks of one CPU:
//! `IGI_TEST_SLURM=1 cargo test -p tests --test slurm -- --nocapture`. One node is enough, without accounting or
//! control groups (`slurm-wlm` and `munge` of Debian; `ProctrackType=proctrack/linuxproc`, `TaskPlugin=task/none`,
//! `JobAcctGatherType=jobacct_gather/none`, `SelectType=select/cons_tres`, `SelectTypeParameters=CR_CPU`).

use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::{Duration, Instant};

use serde_json::Value;
use tests::programs::{Process, free_address, program};

/// Longest wait for anything; a time limit takes two minutes.
const PATIENCE: Duration = Duration::from_secs(180);
const SCENE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../scenes/cornell");
const WHAT: [&str; 2] = ["--size", "64x48"];

/// Runs it, and gives what it writes to standard output.
fn done(command: &mut Command) -> String {
    let output = command.output().unwrap_or_else(|error| panic!("{command:?} does not start: {error}"));
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{command:?} failed:\n{said}");
    String::from_utf8_lossy(&output.stdout).trim().to_owned()
}

/// Jobs of this test; cancelled when dropped.
struct Jobs {
    folder: tempfile::TempDir,
    master: String,
    token: PathBuf,
    arrays: Vec<String>,
}

impl Jobs {
    /// Submits the script as its comments say; the array's number.
    fn submit(&mut self, options: &[&str]) -> String {
        let mut command = Command::new("sbatch");
        command.args(["--parsable", "--cpus-per-task=1", "--mem=300M"]).args(options);
        command.arg(concat!(env!("CARGO_MANIFEST_DIR"), "/../deploy/slurm/workers.sbatch"));
        command.current_dir(&self.folder).env("IGI_MASTER", &self.master).env("IGI_TOKEN_FILE", &self.token);
        command.env("IGI_WORKER", program("igi-worker")).env("IGI_CACHE", self.folder.path().join("cache"));
        let number = done(command.env_remove("IGI_TOKEN"));
        self.arrays.push(number.clone());
        number
    }

    fn log(&self, task: &str) -> String {
        std::fs::read_to_string(self.folder.path().join(format!("igi-worker-{task}.log"))).unwrap_or_default()
    }

    /// Waits until Slurm says this of a task.
    fn wait_for(&self, task: &str, what: &[&str]) {
        let deadline = Instant::now() + PATIENCE;
        loop {
            let said = done(Command::new("scontrol").args(["--oneliner", "show", "job", task]));
            if what.iter().all(|word| said.split_whitespace().any(|one| one == *word)) {
                return;
            }
            assert!(Instant::now() < deadline, "not {what:?}: {said}\n{}", self.log(task));
            std::thread::sleep(Duration::from_millis(200));
        }
    }
}

impl Drop for Jobs {
    fn drop(&mut self) {
        let _ = Command::new("scancel").args(&self.arrays).status();
    }
}

/// Bits of the picture, and its frames.
fn picture(events: &mut impl Iterator<Item = Value>) -> (String, u64) {
    let picture = events.find(|event| event["event"] == "picture").expect("a picture was made");
    (picture["raw_sha256"].as_str().expect("a hash").to_owned(), picture["frames"].as_u64().expect("a number"))
}

fn parsed(line: String) -> Value {
    serde_json::from_str(&line).expect("JSON")
}

#[test]
fn array_tasks_may_be_cancelled_requeued_killed_and_time_out_and_the_picture_is_the_same() {
    if std::env::var_os("IGI_TEST_SLURM").is_none() {
        println!("skipped: it needs a Slurm and is run where IGI_TEST_SLURM is set");
        return;
    }
    println!("{}", done(&mut Command::new("sinfo")));
    program("igi-worker");

    let folder = tempfile::tempdir().expect("a folder");
    let output = folder.path().join("out.png");
    let output = output.to_str().expect("a path");
    let address = free_address().to_string();
    let what = ["render", SCENE, "--frames", "1000000", "--json", "-o", output, "--no-announce", "--listen", &address];
    let mut master = Process::master(&[&what[..], &WHAT].concat());
    let mut events = master.lines().map(parsed);
    let listening = events.find(|event| event["event"] == "listening").expect("it listens");
    let join: Vec<_> = listening["join"].as_str().expect("a line").split_whitespace().collect();
    let token = folder.path().join("token");
    std::fs::copy(join[4], &token).expect("it can be written");
    let mut jobs = Jobs { folder, master: join[2].to_owned(), token, arrays: Vec::new() };

    // The name says which task it is. Tasks come in any order.
    let mut passed = Vec::new();
    let mut next = |what: &str, task: &str| {
        let it = |event: &Value| {
            event["event"] == what && event["name"].as_str().is_some_and(|name| name.ends_with(&format!("-{task}")))
        };
        println!("{what}: {task}");
        let found = passed.iter().position(it).map(|place| passed.remove(place));
        found.unwrap_or_else(|| {
            loop {
                let event = events.next().expect("the master tells of it");
                if it(&event) {
                    return event;
                }
                passed.push(event);
            }
        })
    };

    let array = jobs.submit(&["--array=0-3%2", "--time=10"]);
    let task = |number: u32| format!("{array}_{number}");
    for number in [0, 1] {
        next("worker_joined", &task(number));
    }

    println!("scancel {}", task(0));
    done(Command::new("scancel").arg(task(0)));
    let left = next("worker_left", &task(0));
    assert_eq!(left["reason"], "the worker was asked to stop", "{left}");
    jobs.wait_for(&task(0), &["JobState=CANCELLED", "ExitCode=0:0"]);
    assert!(jobs.log(&task(0)).contains("finishing what is begun"), "{}", jobs.log(&task(0)));
    next("worker_joined", &task(2));

    println!("requeue {}", task(1));
    done(Command::new("scontrol").args(["requeue", &task(1)]));
    let left = next("worker_left", &task(1));
    assert_eq!(left["reason"], "the worker was asked to stop", "{left}");
    next("worker_joined", &task(3));
    jobs.wait_for(&task(1), &["JobState=PENDING", "Restarts=1"]);

    println!("kill -9 {}", task(2));
    done(Command::new("scancel").args(["--batch", "--signal=KILL", &task(2)]));
    next("worker_left", &task(2));
    jobs.wait_for(&task(2), &["JobState=FAILED", "ExitCode=0:9"]);

    println!("a time limit");
    let short = jobs.submit(&["--array=7", "--time=2"]);
    let short = format!("{short}_7");
    next("worker_joined", &short);
    let left = next("worker_left", &short);
    assert_eq!(left["reason"], "the worker was asked to stop", "{left}");
    jobs.wait_for(&short, &["JobState=COMPLETED", "ExitCode=0:0"]);

    println!("the requeued one comes back");
    next("worker_joined", &task(1));

    master.signal("-INT");
    let (drawn, frames) = picture(&mut events);
    println!("{frames} frames, {drawn}");
    // Who is there at the end goes with the master.
    for number in [1, 3] {
        jobs.wait_for(&task(number), &["JobState=COMPLETED", "ExitCode=0:0"]);
    }
    // Both of its lives are in one file.
    assert_eq!(jobs.log(&task(1)).matches(" joined ").count(), 2, "{}", jobs.log(&task(1)));

    let frames = frames.to_string();
    let truth = Path::new(output).with_file_name("truth.png");
    let what = ["render", SCENE, "--frames", &frames, "--json", "-o", truth.to_str().expect("a path")];
    let mut alone = Process::master(&[&what[..], &WHAT].concat());
    assert_eq!(picture(&mut alone.lines().map(parsed)).0, drawn);
}
