//! The master: a command line that asks workers about light and makes pictures of their answers.
//!
//! # Reading order
//! [`command::render`] (from file to file) or [`command::serve`] (with people at the other end) → the library `runtime` (the loops; who
//! answers; who watches) → the library `frame` (what is asked, and how pictures are made).

pub mod cli;
pub mod command;

use std::process::ExitCode;

pub use command::run;

/// The whole program, with these methods, the default one first: a program of its own may have others than this project.
pub fn main_with(methods: &'static [&'static dyn frame::Method]) -> ExitCode {
    runtime::methods::set(methods);
    match cli::Cli::read(std::env::args_os()) {
        Ok(line) => run(line),
        Err(wrong) => wrong.exit(),
    }
}
