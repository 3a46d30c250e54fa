//! `igi-master`: see `igi-master --help`.

use std::process::ExitCode;

use clap::Parser;

fn main() -> ExitCode {
    master::run(master::cli::Cli::parse())
}
