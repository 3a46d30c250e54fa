//! Flags by the names that other renderers have for them: who types one is told ours.

use clap::builder::StyledStr;
use clap::error::{ContextKind, ContextValue, ErrorKind};
use clap::{Command, Error};

/// What is typed, our flag, and how it is used.
const NAMES: &[(&str, &str, &str)] = &[
    ("--threads", "workers", "--workers embedded:N"),
    ("--jobs", "workers", "--workers embedded:N"),
    ("--nthreads", "workers", "--workers embedded:N"),
    ("--cpus", "workers", "--workers embedded:N"),
    ("--spp", "frames", "--frames N"),
    ("--samples", "frames", "--frames N"),
    ("--passes", "frames", "--frames N"),
    ("--iterations", "frames", "--frames N"),
    ("--timeout", "seconds", "--seconds N"),
    ("--duration", "seconds", "--seconds N"),
    ("--width", "size", "--size WIDTHxHEIGHT"),
    ("--height", "size", "--size WIDTHxHEIGHT"),
    ("--resolution", "size", "--size WIDTHxHEIGHT"),
    ("--dimensions", "size", "--size WIDTHxHEIGHT"),
    ("--out", "output", "-o FILE"),
    ("--host", "http", "--http ADDR:PORT"),
    ("--port", "http", "--http ADDR:PORT"),
    ("--bind", "http", "--http ADDR:PORT"),
    ("--integrator", "method", "--method NAME"),
    ("--engine", "method", "--method NAME"),
    ("--algorithm", "method", "--method NAME"),
];

/// The same error, which names our flag if the command of these words has it.
pub(super) fn explain(mut error: Error, command: &Command, name: Option<&str>) -> Error {
    if error.kind() != ErrorKind::UnknownArgument {
        return error;
    }
    let Some(ContextValue::String(typed)) = error.get(ContextKind::InvalidArg) else { return error };
    let Some((_, id, ours)) = NAMES.iter().find(|known| known.0 == typed.split('=').next().unwrap_or_default()) else {
        return error;
    };
    let has_it = |command: &Command| command.get_arguments().any(|arg| arg.get_id() == *id);
    if name.and_then(|name| command.find_subcommand(name)).is_some_and(has_it) {
        error.remove(ContextKind::SuggestedArg);
        error.insert(
            ContextKind::Suggested,
            ContextValue::StyledStrs(vec![StyledStr::from(format!("here it is '{ours}'"))]),
        );
    }
    error
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory;

    use super::*;
    use crate::cli::Cli;

    #[test]
    fn who_types_another_renderers_flag_is_told_ours() {
        let said = |words: &[&str]| Cli::read([&["igi-master"], words].concat()).unwrap_err().to_string();
        assert!(said(&["render", "scene", "--threads", "4"]).contains("here it is '--workers embedded:N'"));
        assert!(said(&["render", "scene", "--width=640"]).contains("here it is '--size WIDTHxHEIGHT'"));
        assert!(said(&["serve", "scene", "--port", "80"]).contains("here it is '--http ADDR:PORT'"));
        assert!(said(&["render", "scene", "--siez", "4x4"]).contains("'--size'"), "others are told what is near");
        assert!(!said(&["health", "--threads", "4"]).contains("here it is"), "it has no such flag");
    }

    #[test]
    fn each_flag_that_is_named_is_one() {
        let command = Cli::command();
        for (typed, id, _) in NAMES {
            let has = |name: &str| {
                command.find_subcommand(name).unwrap().get_arguments().any(|argument| argument.get_id() == *id)
            };
            assert!(has("render") || has("serve"), "{typed}: {id}");
        }
    }
}
