//! The time that a run takes: by the watch, and by the processors.

use std::time::Instant;

/// Seconds since a run began.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Elapsed {
    /// By the watch.
    pub wall: f64,
    /// Of all threads of the process that works, together.
    pub cpu: f64,
}

/// Measures this process.
pub struct StopWatch {
    started: Instant,
    cpu: f64,
}

impl StopWatch {
    /// Now.
    pub fn start() -> Self {
        Self { started: Instant::now(), cpu: cpu_seconds() }
    }

    /// Since then.
    pub fn elapsed(&self) -> Elapsed {
        Elapsed { wall: self.started.elapsed().as_secs_f64(), cpu: cpu_seconds() - self.cpu }
    }
}

/// CPU time of all threads of this process so far.
fn cpu_seconds() -> f64 {
    let time = rustix::time::clock_gettime(rustix::time::ClockId::ProcessCPUTime);
    time.tv_sec as f64 + time.tv_nsec as f64 * 1e-9
}

/// CPU time of the thread that asks, so far.
pub fn thread_seconds() -> f64 {
    let time = rustix::time::clock_gettime(rustix::time::ClockId::ThreadCPUTime);
    time.tv_sec as f64 + time.tv_nsec as f64 * 1e-9
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn clocks_go_on() {
        let watch = StopWatch::start();
        let mut sum = 0.0_f64;
        while watch.elapsed().wall < 0.02 {
            sum = (sum + 1.0).sqrt();
        }
        let elapsed = watch.elapsed();
        assert!(sum > 0.0 && elapsed.wall >= 0.02 && elapsed.cpu > 0.0, "{elapsed:?}");
        assert!(thread_seconds() > 0.0);
    }
}
