//! The worker's process: command line, signals, log.

use std::io::IsTerminal;
use std::process::ExitCode;

use clap::Parser;
use tokio::signal::unix::{SignalKind, signal};
use tokio::sync::watch;
use worker::network::{NetworkError, Options, StopSign, work};
use worker::settings::Settings;

fn main() -> ExitCode {
    let settings = Settings::parse();
    log_to_stderr(&settings);
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
    match runtime.block_on(work_until_signal(&options)) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("igi-worker: {error}");
            ExitCode::from(if matches!(error, NetworkError::Refused(_)) { 3 } else { 1 })
        }
    }
}

async fn work_until_signal(options: &Options) -> Result<(), NetworkError> {
    let broken = |error: std::io::Error| NetworkError::Broken(format!("cannot watch for signals: {error}"));
    let mut interrupt = signal(SignalKind::interrupt()).map_err(broken)?;
    let mut terminate = signal(SignalKind::terminate()).map_err(broken)?;
    let (sign, stop) = watch::channel(StopSign::Work);
    tokio::spawn(async move {
        for _ in 0..2 {
            tokio::select! {
                _ = interrupt.recv() => {}
                _ = terminate.recv() => {}
            }
            if sign.send_replace(StopSign::Drain) == StopSign::Drain {
                std::process::exit(130);
            }
        }
    });
    work(options, stop).await
}

fn log_to_stderr(settings: &Settings) {
    let level = match (settings.quiet, settings.verbose) {
        (true, _) => "error",
        (false, 0) => "warn,worker=info",
        (false, 1) => "info,worker=debug",
        (false, _) => "debug,worker=trace",
    };
    let filter = tracing_subscriber::EnvFilter::try_from_default_env().unwrap_or_else(|_| level.into());
    let colours = std::io::stderr().is_terminal() && std::env::var_os("NO_COLOR").is_none();
    let log = tracing_subscriber::fmt().with_env_filter(filter).with_writer(std::io::stderr).with_ansi(colours);
    let _ = log.with_target(false).try_init();
}
