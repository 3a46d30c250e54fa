//! The commands: one module each, named like what is typed.

pub mod animation;
pub mod bench;
pub mod compare;
pub mod doctor;
pub mod export;
pub mod health;
mod load;
mod lockstep;
pub mod measure;
pub mod mix;
mod options;
mod outcome;
pub mod plan;
pub mod reference;
pub mod relay;
pub mod render;
pub mod replay;
pub mod report;
pub mod scale;
mod script;
pub mod selftest;
pub mod serve;
pub mod token;

use std::io::IsTerminal;
use std::process::ExitCode;

use tracing_subscriber::Layer;
use tracing_subscriber::filter::{LevelFilter, Targets};
use tracing_subscriber::layer::SubscriberExt;
use tracing_subscriber::util::SubscriberInitExt;

use crate::cli::{self, Cli, Command};
use runtime::failure;

/// Does what the command line says.
pub fn run(cli: Cli) -> ExitCode {
    log_to_stderr();
    if let Err(error) = secrets::command_line::hide(&cli::SECRETS, cli::warn_of_secret) {
        tracing::warn!("it stays there: the program cannot begin again without it ({error})");
    }
    failure::exit_code(match &cli.command {
        Command::Render(args) => match &args.animation.frames_range {
            Some(range) => animation::animation(args, range),
            None => render::render(args),
        },
        Command::Measure(args) => measure::measure(args),
        Command::Mix(args) => mix::mix(args),
        Command::Plan(args) => plan::plan(args),
        Command::Compare(args) => compare::compare(args),
        Command::Bench(args) => bench::bench(args),
        Command::Reference(args) => reference::reference(args),
        Command::Relay(args) => relay::relay(args),
        Command::Report(args) => report::report(args),
        Command::Export(args) => export::export(args),
        Command::Serve(args) => serve::serve(args, serve::Open::Nothing),
        Command::View(args) => {
            serve::serve(&args.serve, if args.browser { serve::Open::Browser } else { serve::Open::Window })
        }
        Command::Replay(args) => replay::replay(args),
        Command::Token(args) => token::token(args),
        Command::Doctor(args) => doctor::doctor(args),
        Command::Health(args) => health::health(args),
        Command::Scale(args) => scale::scale(args),
        Command::Selftest(args) => selftest::selftest(args),
    })
}

/// Warnings, and more if RUST_LOG says so; for programs if IGI_LOG does.
fn log_to_stderr() {
    let asked = std::env::var("RUST_LOG").ok().and_then(|words| words.parse::<Targets>().ok());
    let filter = asked.unwrap_or_else(|| Targets::new().with_default(LevelFilter::WARN));
    let colours = std::io::stderr().is_terminal() && std::env::var_os("NO_COLOR").is_none();
    let log = tracing_subscriber::fmt::layer().with_writer(std::io::stderr).with_ansi(colours);
    let registry = tracing_subscriber::registry();
    let _ = match std::env::var_os("IGI_LOG") {
        Some(form) if form == "json" => registry.with(log.json().flatten_event(true).with_filter(filter)).try_init(),
        _ => registry.with(log.without_time().with_filter(filter)).try_init(),
    };
}
