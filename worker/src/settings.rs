//! The worker's command line.

use std::path::PathBuf;

use clap::Parser;
use protocol::identity::Token;

use crate::network::Options;

/// Interactive global illumination on a cluster: this is a worker, which answers a master's questions about light
///
/// Start the master first, with --listen; it prints the line that starts a worker. Workers may be
/// started and stopped at any time: pictures do not change.
#[derive(Clone, Debug, Parser)]
#[command(name = "igi-worker", version, after_help = AFTER_HELP)]
pub struct Settings {
    /// Whom to work for.
    #[arg(long, value_name = "HOST:PORT", env = "IGI_MASTER")]
    pub master: String,

    /// What the master prints when it starts.
    #[arg(long, value_name = "TOKEN", env = "IGI_TOKEN", hide_env_values = true)]
    pub token: Option<String>,

    /// A file with the token.
    #[arg(long, value_name = "FILE", conflicts_with = "token")]
    pub token_file: Option<PathBuf>,

    /// Questions answered at a time. [default: one a core]
    #[arg(long, value_name = "N", env = "IGI_THREADS", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub threads: Option<u16>,

    /// Keep scenes in this folder, so that they need not be fetched again. Workers may share it.
    #[arg(long, value_name = "DIR", env = "IGI_CACHE")]
    pub cache: Option<PathBuf>,

    /// What the master calls this worker. [default: the machine's name]
    #[arg(long, value_name = "NAME", env = "IGI_NAME")]
    pub name: Option<String>,

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

const AFTER_HELP: &str = "\
Exit codes:
  0  the work is done, or somebody asked the worker to stop
  1  this machine does not let it work
  2  the command line makes no sense
  3  the master refused it: wrong token, or another version

Ctrl-C or SIGTERM once: finish what is in hand, and go; twice: go at once.";

/// Settings that cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum SettingsError {
    /// Neither given nor in the environment.
    #[error("no token: give the one that the master prints, as --token, --token-file or IGI_TOKEN")]
    NoToken,
    /// The token file cannot be read.
    #[error("cannot read the token file {0}: {1}")]
    TokenFile(PathBuf, std::io::Error),
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
        let port =
            self.master.rsplit_once(':').and_then(|(host, port)| port.parse::<u16>().ok().filter(|_| !host.is_empty()));
        if port.is_none_or(|port| port == 0) {
            return Err(SettingsError::Master(self.master.clone()));
        }
        Ok(Options {
            master: self.master.clone(),
            token: self.token()?,
            threads: self.threads.map_or_else(cores, usize::from),
            cache: self.cache.clone(),
            name: self.name.clone().unwrap_or_else(machine),
            once: self.once,
        })
    }

    fn token(&self) -> Result<Token, SettingsError> {
        let text = match (&self.token_file, &self.token) {
            (Some(file), _) => {
                std::fs::read_to_string(file).map_err(|error| SettingsError::TokenFile(file.clone(), error))?
            }
            (None, Some(token)) => token.clone(),
            (None, None) => return Err(SettingsError::NoToken),
        };
        Ok(text.parse()?)
    }
}

fn cores() -> usize {
    std::thread::available_parallelism().map_or(1, usize::from)
}

fn machine() -> String {
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
        Token { fingerprint: [1; 16], secret: [2; 16] }.to_string()
    }

    #[test]
    fn the_command_line_is_sound() {
        Settings::command().debug_assert();
    }

    #[test]
    fn the_printed_line_works() {
        let options = parse(&format!("--master 10.0.0.1:7464 --token {} --threads 3", token())).unwrap();
        assert_eq!((options.master.as_str(), options.threads), ("10.0.0.1:7464", 3));
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
