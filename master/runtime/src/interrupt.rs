//! Ctrl-C: once to finish and save, twice to stop.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use tokio::signal::unix::{SignalKind, signal};

use crate::failure::INTERRUPTED;

/// Tells whether somebody wants the work to end.
#[derive(Clone, Debug, Default)]
pub struct Interrupt(Arc<AtomicBool>);

impl Interrupt {
    /// Listens for Ctrl-C and for the polite request to terminate. The second of them ends the
    /// process at once, with nothing saved.
    pub fn listen() -> Self {
        Self::listen_saying("finishing the frame, then saving; once more to stop at once", "stopped; nothing was saved")
    }

    /// As [`Self::listen`], in other words: what is said at the first, and at the second.
    pub fn listen_saying(first: &'static str, second: &'static str) -> Self {
        let interrupt = Self::default();
        let asked = interrupt.clone();
        std::thread::spawn(move || {
            let Ok(runtime) = tokio::runtime::Builder::new_current_thread().enable_all().build() else { return };
            runtime.block_on(async {
                while next_signal().await {
                    if asked.0.swap(true, Ordering::Relaxed) {
                        eprintln!("igi-master: {second}");
                        std::process::exit(i32::from(INTERRUPTED));
                    }
                    eprintln!("igi-master: {first}");
                }
            });
        });
        interrupt
    }

    /// Ends the work as Ctrl-C would.
    pub fn ask(&self) {
        self.0.store(true, Ordering::Relaxed);
    }

    /// Somebody does.
    pub fn asked(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }
}

/// Waits for a signal; false if none can come.
async fn next_signal() -> bool {
    let Ok(mut terminate) = signal(SignalKind::terminate()) else { return false };
    tokio::select! {
        result = tokio::signal::ctrl_c() => result.is_ok(),
        request = terminate.recv() => request.is_some(),
    }
}
