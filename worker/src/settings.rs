//! The worker's command line.

use std::path::PathBuf;

use clap::{Args, Parser, Subcommand};
use protocol::identity::Token;

use crate::network::{Options, read_token};

/// Interactive global illumination on a cluster: this is a worker, which answers a master's questions about light
///
/// The master prints the line that starts a worker (--listen). Its token comes in IGI_TOKEN or --token-file. Workers may be started and stopped at any time, before their
/// master too: pictures do not change. With the token alone, a worker finds its master by itself on the local network.
#[derive(Clone, Debug, Parser)]
#[command(name = "igi-worker", version, after_help = AFTER_HELP)]
#[command(args_conflicts_with_subcommands = true, subcommand_negates_reqs = true)]
pub struct Settings {
    /// What else it can do than work.
    #[command(subcommand)]
    pub command: Option<Command>,

    /// Whom to work for.
    #[command(flatten)]
    pub whom: WhomArgs,

    /// Questions answered at a time. [default: one a core]
    #[arg(long, value_name = "N", env = "IGI_THREADS", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub threads: Option<u16>,

    /// Be polite to whoever uses this machine: run at the lowest priority, go home while programs of usual priority
    /// use more than this many cores, and come back when they have done.
    #[arg(
        long, value_name = "CORES", env = "IGI_NICE", num_args = 0..=1, require_equals = true,
        default_missing_value = "0.5", value_parser = cores_allowed
    )]
    pub nice: Option<f64>,

    /// Keep scenes in this folder, so that they need not be fetched again: about 8 GiB, those used last. Workers may share
    /// it.
    #[arg(long, value_name = "DIR", env = "IGI_CACHE")]
    pub cache: Option<PathBuf>,

    /// What the master calls this worker. [default: the machine's name]
    #[arg(long, value_name = "NAME", env = "IGI_NAME")]
    pub name: Option<String>,

    /// Answer /metrics (Prometheus), /healthz and /readyz (the scene is ready) here; a port alone answers to this
    /// machine only.
    #[arg(long, value_name = "[ADDR:]PORT", env = "IGI_METRICS", value_parser = health::address)]
    pub metrics: Option<std::net::SocketAddr>,

    /// Go when the master has finished. [default: wait for it to start again]
    #[arg(long)]
    pub once: bool,

    /// Say more; twice: even more.
    #[arg(short, long, action = clap::ArgAction::Count)]
    pub verbose: u8,

    /// Say only what goes wrong.
    #[arg(short, long, conflicts_with = "verbose")]
    pub quiet: bool,
}

/// Whom to work for, and what proves it.
#[derive(Clone, Debug, Args)]
pub struct WhomArgs {
    /// Whom to work for. [default: the master of the token, wherever it is on the local network (DNS-SD, _igi._udp)]
    #[arg(long, value_name = "HOST:PORT", env = "IGI_MASTER")]
    pub master: Option<String>,

    /// What the master prints when it starts. Better in IGI_TOKEN or a file: every user of the machine can read a command
    /// line, until this program has taken the token off it.
    #[arg(long, value_name = "TOKEN", env = "IGI_TOKEN", hide_env_values = true)]
    pub token: Option<String>,

    /// A file with the token, which nobody else may read; it counts more than --token and IGI_TOKEN, and is read again before each attempt to
    /// connect, so that a master can be given another one while both run (`igi-master token --rotate`).
    #[arg(long, value_name = "FILE")]
    pub token_file: Option<PathBuf>,
}

/// What a worker can do besides work.
#[derive(Clone, Debug, Subcommand)]
pub enum Command {
    /// Ask a worker that runs with --metrics how it is: exit code 0 if it is well, else 1.
    Health(HealthArgs),
    /// Look whether this machine could work, and how the connection to its master is: versions, memory, buffers, ports, packet
    /// size, bandwidth. Exit code 0 if all is well, else 1.
    Doctor(DoctorArgs),
}

/// `doctor`.
#[derive(Clone, Debug, Args)]
pub struct DoctorArgs {
    /// Whom it would work for.
    #[command(flatten)]
    pub whom: WhomArgs,

    /// Write it to standard output as one JSON object.
    #[arg(long)]
    pub json: bool,
}

/// `health`.
#[derive(Clone, Debug, Args)]
pub struct HealthArgs {
    /// Where it answers.
    #[arg(value_name = "[ADDR:]PORT", env = "IGI_METRICS", value_parser = health::address, default_value_t = health::ADDRESS)]
    pub address: std::net::SocketAddr,

    /// Well is only who is ready to answer questions about light.
    #[arg(long)]
    pub ready: bool,
}

const AFTER_HELP: &str = "\
Exit codes:
  0  the work is done, or somebody asked the worker to stop
  1  this machine does not let it work, or (--once) it cannot build the scene
  2  the command line makes no sense
  3  the master refused it: wrong token, or another version

Ctrl-C or SIGTERM once: finish what is begun, and go; twice: go at once (of two SIGTERMs within a second, the second
is the same wish).

RUST_LOG=debug says more; IGI_LOG=json says it as one JSON object a line.";

/// Settings that cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum SettingsError {
    /// Neither given nor in the environment.
    #[error("no token: give the one that the master prints or keeps in a file, as IGI_TOKEN or --token-file")]
    NoToken,
    /// The token file cannot be read.
    #[error("{0}")]
    TokenFile(String),
    /// The token is not one.
    #[error(transparent)]
    Token(#[from] protocol::identity::NoToken),
    /// The address is not one.
    #[error("--master wants HOST:PORT, such as 192.168.1.5:7464, not `{0}`")]
    Master(String),
}

impl Settings {
    /// What they mean.
    ///
    /// # Errors
    /// [`SettingsError`] says what to change.
    pub fn options(&self) -> Result<Options, SettingsError> {
        Ok(Options {
            master: self.whom.master()?,
            token: self.whom.token()?,
            token_file: self.whom.token_file.clone(),
            threads: self.threads.map_or_else(cores, usize::from),
            cache: self.cache.clone(),
            name: self.name.clone().unwrap_or_else(machine),
            once: self.once,
            metrics: self.metrics,
        })
    }
}

impl DoctorArgs {
    /// A visit to the master: no work, no cache, no metrics.
    ///
    /// # Errors
    /// [`SettingsError`] says what to change.
    pub fn options(&self) -> Result<Options, SettingsError> {
        let (master, token) = (self.whom.master()?, self.whom.token()?);
        let (threads, name) = (cores(), machine());
        Ok(Options { master, token, token_file: None, threads, cache: None, name, once: true, metrics: None })
    }
}

impl WhomArgs {
    fn master(&self) -> Result<Option<String>, SettingsError> {
        let is_address = |master: &&String| {
            let port =
                master.rsplit_once(':').filter(|(host, _)| !host.is_empty()).map(|(_, port)| port.parse::<u16>());
            port.is_some_and(|port| port.is_ok_and(|port| port > 0))
        };
        if let Some(master) = self.master.as_ref().filter(|master| !is_address(master)) {
            return Err(SettingsError::Master(master.clone()));
        }
        Ok(self.master.clone())
    }

    fn token(&self) -> Result<Token, SettingsError> {
        match (&self.token_file, &self.token) {
            (Some(file), _) => read_token(file).map_err(SettingsError::TokenFile),
            (None, Some(token)) => Ok(token.parse()?),
            (None, None) => Err(SettingsError::NoToken),
        }
    }
}

fn cores_allowed(text: &str) -> Result<f64, String> {
    let cores = text.parse().ok().filter(|cores: &f64| cores.is_finite() && *cores >= 0.0);
    cores.ok_or_else(|| "wants a number of cores, such as 0.5".to_owned())
}

pub(crate) fn cores() -> usize {
    std::thread::available_parallelism().map_or(1, usize::from)
}

/// What this machine is called.
pub fn machine() -> String {
    let file = std::fs::read_to_string("/proc/sys/kernel/hostname").ok();
    let name = file.or_else(|| std::env::var("HOSTNAME").ok()).unwrap_or_default();
    match name.trim() {
        "" => "a worker".into(),
        name => name.into(),
    }
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory;

    use super::*;

    fn parse(line: &str) -> Result<Options, String> {
        let words = std::iter::once("igi-worker").chain(line.split_whitespace());
        let settings = Settings::try_parse_from(words).map_err(|error| error.to_string())?;
        settings.options().map_err(|error| error.to_string())
    }

    fn token() -> String {
        Token { fingerprint: [1; 16], secret: [2; 16], expires: None, own: None }.to_string()
    }

    #[test]
    fn the_command_line_is_sound() {
        Settings::command().debug_assert();
    }

    #[test]
    fn the_printed_line_works() {
        let options = parse(&format!("--master 10.0.0.1:7464 --token {} --threads 3", token())).unwrap();
        assert_eq!((options.master.as_deref(), options.threads), (Some("10.0.0.1:7464"), 3));
    }

    #[test]
    fn a_token_is_enough() {
        assert_eq!(parse(&format!("--token {}", token())).unwrap().master, None);
    }

    #[test]
    fn politeness_has_a_measure() {
        let nice = |line: &str| Settings::try_parse_from(["igi-worker", line]).map(|settings| settings.nice).ok();
        assert_eq!([nice("--nice"), nice("--nice=2"), nice("-v")], [Some(Some(0.5)), Some(Some(2.0)), Some(None)]);
        assert_eq!([nice("--nice=-1"), nice("--nice=x"), nice("--nice=inf")], [None; 3]);
    }

    #[test]
    fn a_token_file_may_end_with_a_new_line() {
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), token() + "\n").unwrap();
        let options = parse(&format!("--master m:1 --token-file {}", file.path().display())).unwrap();
        assert_eq!(options.token.to_string(), token());
    }

    #[test]
    fn what_is_wrong_is_said() {
        for (line, reason) in [
            (format!("--master 10.0.0.1 --token {}", token()), "HOST:PORT"),
            (format!("--master 10.0.0.1:0 --token {}", token()), "HOST:PORT"),
            ("--master m:1 --token igi1-x".into(), "characters"),
            ("--master m:1 --token hello".into(), "begins with"),
            ("--master m:1 --token-file /nowhere/at/all".into(), "/nowhere/at/all"),
            (format!("--master m:1 --threads 0 --token {}", token()), "0"),
        ] {
            let said = parse(&line).expect_err(&line);
            assert!(said.contains(reason), "{line}: {said}");
        }
    }
}
