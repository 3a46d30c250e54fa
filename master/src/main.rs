//! `igi-master`: see `igi-master --help`.

use std::process::ExitCode;

fn main() -> ExitCode {
    master::main_with(frame::methods::ALL)
}
