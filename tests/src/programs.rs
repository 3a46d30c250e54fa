//! The programs of this workspace as processes: built if need be, watched, signalled, ended.

use std::io::{BufRead, BufReader, Read};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Longest wait for anything.
pub const PATIENCE: Duration = Duration::from_secs(60);

/// A program of this workspace, built now if it is not: cargo builds it only for its own package's tests.
///
/// # Panics
/// If it cannot be built.
pub fn program(name: &str) -> PathBuf {
    static BUILDING: Mutex<Vec<String>> = Mutex::new(Vec::new());
    let test = std::env::current_exe().expect("this test has a path");
    let folder = test.parent().and_then(Path::parent).expect("tests lie in PROFILE/deps");
    let mut built = BUILDING.lock().unwrap_or_else(PoisonError::into_inner);
    if !built.iter().any(|known| known == name) {
        let profile = folder.file_name().and_then(|name| name.to_str()).expect("a profile's folder");
        let mut build = Command::new(env!("CARGO"));
        // As `cargo test --workspace` has it: with all packages and, since a test is among what is built, with what tests
        // want of dependencies. So features are the same, and nothing is built twice.
        build.args(["build", "--quiet", "--workspace", "--bin", name, "--test", "tidy"]);
        build.args(["--profile", if profile == "debug" { "dev" } else { profile }]);
        build.arg("--target-dir").arg(folder.parent().expect("a target folder"));
        // Cargo tells a test about its package; to crates whose build scripts ask for these variables, each change of one is
        // a reason to be built again, with all that depends on them.
        for (variable, _) in std::env::vars_os() {
            if ["CARGO_MANIFEST_", "CARGO_PKG_"].iter().any(|start| variable.to_string_lossy().starts_with(start)) {
                build.env_remove(variable);
            }
        }
        assert!(build.status().expect("cargo runs").success(), "{name} cannot be built");
        built.push(name.to_owned());
    }
    folder.join(name)
}

/// A process; killed (kill -9) when dropped.
#[derive(Debug)]
pub struct Process(pub Child);

impl Process {
    /// Starts `igi-worker`; what it says on standard error can be read at its end.
    ///
    /// # Panics
    /// If it does not start.
    pub fn worker(arguments: &[&str]) -> Self {
        Self::start("igi-worker", &[], arguments)
    }

    /// The same, with a token.
    ///
    /// # Panics
    /// If it does not start.
    pub fn worker_with(token: &str, arguments: &[&str]) -> Self {
        Self::start("igi-worker", &[("IGI_TOKEN", token)], arguments)
    }

    /// Starts `igi-master`; its standard output is for [`Self::lines`].
    ///
    /// # Panics
    /// If it does not start.
    pub fn master(arguments: &[&str]) -> Self {
        Self::master_with(&[], arguments)
    }

    /// The same, with variables in its environment.
    ///
    /// # Panics
    /// If it does not start.
    pub fn master_with(variables: &[(&str, &str)], arguments: &[&str]) -> Self {
        Self::start("igi-master", variables, arguments)
    }

    /// Starts `igi-worker` in a network namespace of this machine; nobody reads what it says.
    ///
    /// # Panics
    /// If it does not start.
    pub fn worker_within(namespace: &str, token: &str, arguments: &[&str]) -> Self {
        // `ip netns exec` becomes the program: signals go to the worker.
        let mut command = Command::new("ip");
        command.args(["netns", "exec", namespace]).arg(program("igi-worker")).args(arguments);
        command.env("IGI_TOKEN", token);
        command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
        Self(command.spawn().expect("ip runs"))
    }

    fn start(name: &str, variables: &[(&str, &str)], arguments: &[&str]) -> Self {
        let program = program(name);
        let mut command = Command::new(&program);
        for (variable, _) in std::env::vars_os() {
            if variable == "RUST_LOG" || variable.to_string_lossy().starts_with("IGI_") {
                command.env_remove(variable);
            }
        }
        // What masters keep there is no business of the user's own folders.
        command.env("XDG_RUNTIME_DIR", program.with_file_name("runtime")).envs(variables.iter().copied());
        let command = command.args(arguments).stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
        Self(command.spawn().expect("the program starts"))
    }

    /// Sends a signal, such as `-TERM`.
    ///
    /// # Panics
    /// If the process is not there any more.
    pub fn signal(&self, signal: &str) {
        let id = self.0.id().to_string();
        let sent = Command::new("kill").args([signal, &id]).status().expect("kill runs");
        assert!(sent.success());
    }

    /// What it writes to standard output, line by line, until it ends.
    ///
    /// # Panics
    /// The second time.
    pub fn lines(&mut self) -> impl Iterator<Item = String> + use<> {
        BufReader::new(self.0.stdout.take().expect("stdout is read once")).lines().map_while(Result::ok)
    }

    /// Exit code and what it said on standard error, once it has ended by itself.
    ///
    /// # Panics
    /// If it does not end in time.
    pub fn end(mut self) -> (Option<i32>, String) {
        let deadline = Instant::now() + PATIENCE;
        let status = loop {
            match self.0.try_wait().expect("a child can be waited for") {
                Some(status) => break status,
                None if Instant::now() > deadline => panic!("it does not end"),
                None => std::thread::sleep(Duration::from_millis(10)),
            }
        };
        let mut said = String::new();
        self.0.stderr.take().expect("stderr is piped").read_to_string(&mut said).expect("it says text");
        (status.code(), said)
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// A UDP port of this machine that was free a moment ago.
///
/// # Panics
/// If the machine has none.
pub fn free_address() -> std::net::SocketAddr {
    let free = std::net::UdpSocket::bind("127.0.0.1:0").expect("a free port");
    free.local_addr().expect("it has an address")
}
