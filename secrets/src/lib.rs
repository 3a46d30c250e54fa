//! What a process keeps from the other users of its machine: secrets on its command line and in files.
//!
//! It knows neither tokens nor networks: a secret is a text.

pub mod command_line;
pub mod file;
