//! `igi-master`: see `igi-master --help`.

use std::process::ExitCode;

fn main() -> ExitCode {
    match master::cli::Cli::read(std::env::args_os()) {
        Ok(line) => master::run(line),
        Err(wrong) => wrong.exit(),
    }
}
