//! How things end, and with which exit code.

use std::process::ExitCode;

/// Why a command failed.
#[derive(Debug)]
pub enum Failure {
    /// Something in the way: files, memory, network.
    Failed(anyhow::Error),
    /// Flags that make no sense.
    Usage(String),
    /// The scene cannot be used.
    Scene(String),
    /// Nobody came to work, or everybody left.
    NoWorkers(String),
    /// Parts of the picture were set aside, because workers die of them.
    Incomplete(String),
    /// The picture lacks light, and should have all of it.
    Lacking(String),
}

/// How a command ended well.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Success {
    /// All was done.
    Done,
    /// Interrupted; what was there has been saved.
    Interrupted,
}

impl Failure {
    fn code(&self) -> u8 {
        match self {
            Self::Failed(_) => 1,
            Self::Usage(_) => 2,
            Self::Scene(_) => 3,
            Self::NoWorkers(_) => 4,
            Self::Incomplete(_) => 5,
            Self::Lacking(_) => 6,
        }
    }
}

impl std::fmt::Display for Failure {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        match self {
            // All causes in one line, outermost first.
            Self::Failed(error) => write!(f, "{error:#}"),
            Self::Usage(message)
            | Self::Scene(message)
            | Self::NoWorkers(message)
            | Self::Incomplete(message)
            | Self::Lacking(message) => f.write_str(message),
        }
    }
}

impl From<anyhow::Error> for Failure {
    fn from(error: anyhow::Error) -> Self {
        Self::Failed(error)
    }
}

impl From<scenes::read::ReadError> for Failure {
    fn from(error: scenes::read::ReadError) -> Self {
        Self::Scene(error.to_string())
    }
}

/// Says what went wrong, if anything did, and gives the process's exit code.
pub fn exit_code(result: Result<Success, Failure>) -> ExitCode {
    match result {
        Ok(Success::Done) => ExitCode::SUCCESS,
        Ok(Success::Interrupted) => ExitCode::from(INTERRUPTED),
        Err(failure) => {
            eprintln!("igi-master: {failure}");
            ExitCode::from(failure.code())
        }
    }
}

/// As shells expect it of a process ended by Ctrl-C.
pub const INTERRUPTED: u8 = 130;
