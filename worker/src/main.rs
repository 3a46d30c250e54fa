//! The worker's process: command line, signals, log.

use std::io::IsTerminal;
use std::process::ExitCode;
use std::time::Duration;

use clap::Parser;
use secrets::command_line::Flag;
use tokio::signal::unix::{SignalKind, signal};
use tokio::sync::watch;
use tracing_subscriber::Layer;
use tracing_subscriber::filter::{LevelFilter, Targets};
use tracing_subscriber::layer::SubscriberExt;
use tracing_subscriber::util::SubscriberInitExt;
use worker::network::{NetworkError, Options, StopSign, work};
use worker::settings::{Command, DoctorArgs, HealthArgs, Settings};

fn main() -> ExitCode {
    let settings = Settings::parse();
    log_to_stderr(&settings);
    if let Err(error) = secrets::command_line::hide(&[TOKEN], warn_of_token) {
        tracing::warn!("it stays there: the program cannot begin again without it ({error})");
    }
    match &settings.command {
        Some(Command::Health(args)) => health(args),
        Some(Command::Doctor(args)) => doctor(args),
        None => start(&settings),
    }
}

/// What nobody else should read on our command line.
const TOKEN: Flag = Flag { name: "--token", variable: "IGI_TOKEN" };

fn warn_of_token(Flag { name, variable }: &Flag) {
    tracing::warn!(
        "{name}: every user of this machine could read it on the command line; use {variable} or --token-file"
    );
}

/// How another worker is, in its own words.
fn health(args: &HealthArgs) -> ExitCode {
    match health::ask::check(args.address, args.ready) {
        Ok(words) => {
            println!("{words}");
            ExitCode::SUCCESS
        }
        Err(reason) => {
            eprintln!("igi-worker: {reason}");
            ExitCode::from(1)
        }
    }
}

/// How this machine is, and the connection to its master.
fn doctor(args: &DoctorArgs) -> ExitCode {
    let options = args.options();
    let visit = match &options {
        Err(error) => Err(error.to_string()),
        Ok(options) => match tokio::runtime::Builder::new_current_thread().enable_all().build() {
            Ok(runtime) => runtime.block_on(worker::network::visit::visit(options)).map_err(|error| error.to_string()),
            Err(error) => Err(error.to_string()),
        },
    };
    let facts = worker::doctor::Facts::here();
    if args.json {
        println!("{}", facts.json(&visit));
    } else {
        print!("{}", facts.screen(&visit));
    }
    ExitCode::from(u8::from(!facts.troubles(&visit).is_empty()))
}

fn start(settings: &Settings) -> ExitCode {
    let options = match settings.options() {
        Ok(options) => options,
        Err(error) => {
            eprintln!("igi-worker: {error}");
            return ExitCode::from(2);
        }
    };
    let runtime = match tokio::runtime::Builder::new_current_thread().enable_all().build() {
        Ok(runtime) => runtime,
        Err(error) => {
            eprintln!("igi-worker: cannot start: {error}");
            return ExitCode::from(1);
        }
    };
    if settings.nice.is_some()
        && let Err(error) = worker::load_policy::lower_priority()
    {
        eprintln!("igi-worker: cannot run at a low priority: {error}");
        return ExitCode::from(1);
    }
    match runtime.block_on(work_until_signal(&options, settings.nice)) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("igi-worker: {error}");
            ExitCode::from(if matches!(error, NetworkError::Refused(_)) { 3 } else { 1 })
        }
    }
}

async fn work_until_signal(options: &Options, nice: Option<f64>) -> Result<(), NetworkError> {
    let broken = |error: std::io::Error| NetworkError::Broken(format!("cannot watch for signals: {error}"));
    let mut interrupt = signal(SignalKind::interrupt()).map_err(broken)?;
    let mut terminate = signal(SignalKind::terminate()).map_err(broken)?;
    let (sign, stop) = watch::channel(StopSign::Work);
    if let Some(allowed) = nice {
        tokio::spawn(worker::load_policy::watch(allowed, sign.clone()));
    }
    tokio::spawn(async move {
        let mut first: Option<tokio::time::Instant> = None;
        loop {
            let is_pressed = tokio::select! {
                _ = interrupt.recv() => true,
                _ = terminate.recv() => false,
            };
            sign.send_replace(StopSign::Drain);
            if first.is_some_and(|first| is_impatient(is_pressed, first.elapsed())) {
                std::process::exit(130);
            }
            first.get_or_insert_with(tokio::time::Instant::now);
        }
    });
    work(options, stop).await
}

/// Whether a further signal, so long after the first, means "at once". Batch systems send SIGTERM to a whole group, and
/// again through its shell: that is one wish. Nobody presses Ctrl-C twice for one.
fn is_impatient(is_pressed: bool, since: Duration) -> bool {
    is_pressed || since > ONE_WISH
}

/// SIGTERMs within this time of the first are the same.
const ONE_WISH: Duration = Duration::from_secs(1);

fn log_to_stderr(settings: &Settings) {
    let level = match (settings.quiet, settings.verbose) {
        (true, _) => "error",
        (false, 0) => "warn,worker=info",
        (false, 1) => "info,worker=debug",
        (false, _) => "debug,worker=trace",
    };
    let words = std::env::var("RUST_LOG").unwrap_or_else(|_| level.into());
    let filter = words.parse().unwrap_or_else(|_| Targets::new().with_default(LevelFilter::WARN));
    let colours = std::io::stderr().is_terminal() && std::env::var_os("NO_COLOR").is_none();
    let log = tracing_subscriber::fmt::layer().with_writer(std::io::stderr).with_ansi(colours);
    let registry = tracing_subscriber::registry();
    let _ = match std::env::var_os("IGI_LOG") {
        Some(form) if form == "json" => registry.with(log.json().flatten_event(true).with_filter(filter)).try_init(),
        _ => registry.with(log.with_target(false).with_filter(filter)).try_init(),
    };
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_batch_systems_second_sigterm_is_not_impatience() {
        let [soon, late] = [20, 1500].map(Duration::from_millis);
        assert!(!is_impatient(false, soon) && is_impatient(false, late));
        assert!(is_impatient(true, soon) && is_impatient(true, late));
    }
}
