//! The master: a command line that asks workers about light and makes pictures of their answers.
//!
//! # Reading order
//! [`command::render`] (from file to file) → [`render_loop`] (the loop: ask, absorb, look around) → the
//! library `frame` (what is asked, and how pictures are made) → [`cluster`] (who answers).
//! With people at the other end: [`live::session`] (the loop), [`show::browser`] (where they watch;
//! with the feature `window`, there is also `show::window`).

pub mod checkpoint;
pub mod cli;
pub mod cluster;
pub mod command;
pub mod console;
pub mod denoise;
pub mod display;
pub mod failure;
pub mod files;
pub mod interrupt;
pub mod live;
pub mod memory;
pub mod methods;
pub mod pruning;
pub mod reception;
pub mod relay;
pub mod render_loop;
mod series;
pub mod show;
mod spoken;
pub mod stats;
pub mod stopwatch;
pub mod threads;

use std::process::ExitCode;

pub use command::run;

/// The whole program, with these methods, the default one first: a program of its own may have others than this project.
pub fn main_with(methods: &'static [&'static dyn frame::Method]) -> ExitCode {
    methods::set(methods);
    match cli::Cli::read(std::env::args_os()) {
        Ok(line) => run(line),
        Err(wrong) => wrong.exit(),
    }
}
