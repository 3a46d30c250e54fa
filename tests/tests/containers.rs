//! The compose file for real: four workers in containers draw a picture while they are killed, paused, cut off from the
//! network, sent home and joined by others; the picture has the bits that one process draws.
//!
//! Needs a Docker daemon: `IGI_TEST_DOCKER=1 cargo test -p tests --test containers -- --nocapture`. The image is made of
//! the programs of this build by `deploy/image.sh`; no registry is needed. `IGI_TEST_IMAGE=igi` takes one that is there,
//! such as that of `deploy/Dockerfile`.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::time::{Duration, Instant};

use serde_json::Value;
use tests::programs::{Process, program};

/// Longest wait for anything.
const PATIENCE: Duration = Duration::from_secs(120);
const WHAT: [&str; 4] = ["--size", "128x96", "--photons", "500"];

/// One project of containers; taken down when dropped.
struct Compose {
    folder: tempfile::TempDir,
    image: String,
    project: String,
    token: String,
}

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("the workspace").to_path_buf()
}

fn run(command: &mut Command) -> Output {
    command.output().unwrap_or_else(|error| panic!("{command:?} does not start: {error}"))
}

/// Runs it, and gives what it writes to standard output.
fn done(command: &mut Command) -> String {
    let output = run(command);
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{command:?} failed:\n{said}");
    String::from_utf8_lossy(&output.stdout).trim().to_owned()
}

fn docker(arguments: &[&str]) -> String {
    done(Command::new("docker").args(arguments))
}

impl Compose {
    /// The compose file of deploy/, with a master that draws one long picture and then ends.
    fn new(image: &str) -> Self {
        let folder = tempfile::tempdir().expect("a folder");
        let project = format!("igi-test-{}", std::process::id());
        let token = docker(&["run", "--rm", image, "igi-master", "token"]);
        let command = [
            "igi-master",
            "render",
            "/scenes/cornell_spheres",
            "-o",
            "/tmp/out.png",
            "--json",
            "--listen",
            "0.0.0.0:7464",
        ];
        let command: Vec<_> = command.into_iter().chain(WHAT).chain(["--frames", "100000"]).collect();
        let other = serde_json::json!({ "services": {
            "master": { "command": command, "restart": "no", "ports": [] },
            "worker": { "restart": "no" },
        }});
        // JSON is YAML.
        std::fs::write(folder.path().join("test.yml"), other.to_string()).expect("it can be written");
        Self { folder, image: image.to_owned(), project, token }
    }

    fn compose(&self, arguments: &[&str]) -> String {
        let v2 =
            Command::new("docker").args(["compose", "version"]).output().is_ok_and(|output| output.status.success());
        let mut command = Command::new(if v2 { "docker" } else { "docker-compose" });
        if v2 {
            command.arg("compose");
        }
        let files = [root().join("deploy/docker-compose.yml"), self.folder.path().join("test.yml")];
        for file in &files {
            command.arg("-f").arg(file);
        }
        command.args(["-p", &self.project]).args(arguments);
        // Ports of this machine are not needed, and may be taken.
        command.envs([
            ("IGI_TOKEN", &*self.token),
            ("IGI_IMAGE", &*self.image),
            ("IGI_HTTP_PORT", "127.0.0.1:0"),
            ("IGI_PORT", "0"),
        ]);
        command.envs([("IGI_WORKER_CPUS", "0.5"), ("IGI_WORKER_MEMORY", "512m")]);
        done(&mut command)
    }

    /// Containers of a service that run, oldest name first.
    fn containers(&self, service: &str) -> Vec<String> {
        let (project, service) = (
            format!("label=com.docker.compose.project={}", self.project),
            format!("label=com.docker.compose.service={service}"),
        );
        let names = docker(&["ps", "--filter", &project, "--filter", &service, "--format", "{{.Names}}"]);
        let mut names: Vec<_> = names.lines().map(str::to_owned).collect();
        names.sort();
        names
    }

    fn master(&self) -> String {
        self.containers("master").pop().expect("the master runs")
    }

    /// Workers that the master calls ready, and frames that it has drawn.
    fn standing(&self) -> (usize, u64) {
        let page = docker(&["exec", &self.master(), "igi-master", "health"]);
        let events = self.events(&self.master());
        let progress = events.iter().rev().find(|event| event["event"] == "progress");
        let number = |name: &str| progress.and_then(|event| event[name].as_u64()).unwrap_or(0);
        println!("  {page}; {} frames", number("frames"));
        (number("workers_ready") as usize, number("frames"))
    }

    fn events(&self, container: &str) -> Vec<Value> {
        let log = docker(&["logs", container]);
        log.lines().filter_map(|line| serde_json::from_str(line).ok()).collect()
    }

    fn wait_for(&self, what: &str, enough: impl Fn(usize, u64) -> bool) -> u64 {
        println!("waiting for {what}");
        let deadline = Instant::now() + PATIENCE;
        loop {
            let (ready, frames) = self.standing();
            if enough(ready, frames) {
                return frames;
            }
            assert!(Instant::now() < deadline, "waited in vain for {what}");
            std::thread::sleep(Duration::from_millis(500));
        }
    }
}

impl Drop for Compose {
    fn drop(&mut self) {
        if std::thread::panicking() {
            for service in ["master", "worker"] {
                for name in self.containers(service) {
                    println!(
                        "{name}:\n{}",
                        String::from_utf8_lossy(
                            &run(Command::new("docker").args(["logs", "--tail", "20", &name])).stderr
                        )
                    );
                }
            }
        }
        let project = format!("label=com.docker.compose.project={}", self.project);
        let left = docker(&["ps", "-aq", "--filter", &project]);
        if !left.is_empty() {
            run(Command::new("docker").arg("rm").arg("-f").args(left.lines()));
        }
        run(Command::new("docker").args(["network", "rm", &format!("{}_igi", self.project)]));
    }
}

/// The image that is there already, or a new one.
fn image() -> String {
    std::env::var("IGI_TEST_IMAGE").unwrap_or_else(|_| {
        let folder = program("igi-master").parent().expect("a folder").to_path_buf();
        program("igi-worker");
        let tag = "igi-test".to_owned();
        done(Command::new(root().join("deploy/image.sh")).args(["-t", &tag]).arg(folder));
        tag
    })
}

/// What one process draws in so many frames.
fn truth(frames: u64) -> String {
    let scene = root().join("scenes/cornell_spheres");
    let folder = tempfile::tempdir().expect("a folder");
    let (scene, output) = (scene.to_str().expect("a path").to_owned(), folder.path().join("truth.png"));
    let (frames, output) = (frames.to_string(), output.to_str().expect("a path").to_owned());
    let what = [&["render", &scene, "-o", &output, "--json", "--frames", &frames], &WHAT[..]].concat();
    let mut master = Process::master(&what);
    let events: Vec<Value> = master.lines().filter_map(|line| serde_json::from_str(&line).ok()).collect();
    hash(&events).0
}

fn hash(events: &[Value]) -> (String, u64) {
    let picture = events.iter().find(|event| event["event"] == "picture").expect("a picture was made");
    (picture["raw_sha256"].as_str().expect("a hash").to_owned(), picture["frames"].as_u64().expect("a number"))
}

#[test]
fn containers_may_be_killed_paused_scaled_and_cut_off_and_the_picture_is_the_same() {
    if std::env::var_os("IGI_TEST_DOCKER").is_none() {
        println!("skipped: it needs a Docker daemon and is run where IGI_TEST_DOCKER is set");
        return;
    }
    let compose = Compose::new(&image());
    compose.compose(&["up", "-d", "--scale", "worker=4"]);
    let mut frames = compose.wait_for("four workers and a frame", |ready, frames| ready == 4 && frames > 0);
    let workers = compose.containers("worker");
    assert_eq!(workers.len(), 4);
    for name in &workers {
        assert_eq!(docker(&["exec", name, "igi-worker", "health", "--ready"]), "it answers");
        assert_eq!(
            docker(&["inspect", "-f", "{{.Config.User}} {{.HostConfig.ReadonlyRootfs}}", name]),
            "65532:65532 true"
        );
    }

    println!("kill -9 {}", workers[0]);
    docker(&["kill", "-s", "KILL", &workers[0]]);
    frames = compose.wait_for("three workers and more frames", |ready, now| ready == 3 && now > frames + 2);

    println!("pause {}", workers[1]);
    docker(&["pause", &workers[1]]);
    frames = compose.wait_for("frames without the paused one", |_, now| now > frames + 5);
    docker(&["unpause", &workers[1]]);

    let network = format!("{}_igi", compose.project);
    println!("cut off {}", workers[2]);
    docker(&["network", "disconnect", &network, &workers[2]]);
    frames = compose.wait_for("frames without the one cut off", |ready, now| ready <= 2 && now > frames + 5);
    docker(&["network", "connect", &network, &workers[2]]);
    frames = compose.wait_for("its return", |ready, now| ready == 3 && now > frames + 2);

    println!("five workers");
    compose.compose(&["up", "-d", "--no-recreate", "--scale", "worker=5"]);
    frames = compose.wait_for("five workers", |ready, now| ready == 5 && now > frames + 2);
    println!("two workers");
    let before = compose.containers("worker");
    compose.compose(&["up", "-d", "--no-recreate", "--scale", "worker=2"]);
    frames = compose.wait_for("two workers", |ready, now| ready == 2 && now > frames + 2);
    assert_eq!((before.len(), compose.containers("worker").len()), (5, 2));

    println!("SIGTERM for a worker, then for the master");
    let last = compose.containers("worker").pop().expect("there are two");
    docker(&["stop", "-t", "30", &last]);
    assert_eq!(docker(&["inspect", "-f", "{{.State.ExitCode}}", &last]), "0", "it drains and says good-bye");
    compose.wait_for("one worker", |ready, now| ready == 1 && now > frames + 1);
    let master = compose.master();
    docker(&["stop", "-t", "60", &master]);
    assert_eq!(docker(&["inspect", "-f", "{{.State.ExitCode}}", &master]), "130", "it saves the frame in progress");

    let (drawn, frames) = hash(&compose.events(&master));
    println!("{frames} frames, {drawn}");
    assert_eq!(truth(frames), drawn);
}
