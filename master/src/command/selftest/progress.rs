//! Which row it is at, and how long the rest will take: a line that changes where a person watches, else a line
//! now and then.

use std::io::IsTerminal;
use std::sync::mpsc::{self, RecvTimeoutError, Sender};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use cases::{Effort, costs};
use indicatif::{ProgressBar, ProgressStyle};

use super::Run;
use runtime::spoken::duration;

/// Tells how far it is, on standard error, until it is dropped.
pub struct Progress {
    state: Arc<Mutex<State>>,
    bar: Option<ProgressBar>,
    ticker: Option<(Sender<()>, JoinHandle<()>)>,
}

/// Where it stands.
struct State {
    names: Vec<String>,
    forecast: Forecast,
    /// The run in progress.
    current: usize,
    began: Instant,
    current_began: Instant,
}

/// Between two looks where a person watches, and where nobody does.
const WATCHED: Duration = Duration::from_millis(250);
const UNWATCHED: Duration = Duration::from_secs(15);

impl Progress {
    /// Says how long all of it should take, and begins to tell how far it is.
    pub fn start(runs: &[Run], effort: Effort, threads: usize) -> Self {
        let cost = |(case, method): &Run| costs::of(case.name, *method, costs::affordable(case.name, *method, effort));
        let forecast = Forecast::new(runs.iter().map(cost), threads);
        let names = runs.iter().map(|(case, method)| format!("{} ({})", case.name, method.name())).collect();
        eprintln!("{} rows, about {} by {threads} threads", runs.len(), duration(forecast.left(0, 0.0, 0.0)));
        let now = Instant::now();
        let state = Arc::new(Mutex::new(State { names, forecast, current: 0, began: now, current_began: now }));
        let bar = std::io::stderr().is_terminal().then(|| {
            let style =
                ProgressStyle::with_template("{spinner} {wide_msg}").unwrap_or_else(|_| ProgressStyle::default_bar());
            ProgressBar::new_spinner().with_style(style)
        });
        let (end, ended) = mpsc::channel();
        let ticker = {
            let (state, bar) = (Arc::clone(&state), bar.clone());
            let pause = if bar.is_some() { WATCHED } else { UNWATCHED };
            std::thread::spawn(move || {
                while ended.recv_timeout(pause) == Err(RecvTimeoutError::Timeout) {
                    let line = state.lock().unwrap_or_else(PoisonError::into_inner).line(Instant::now());
                    match &bar {
                        Some(bar) => {
                            bar.set_message(line);
                            bar.tick();
                        }
                        None => eprintln!("{line}"),
                    }
                }
            })
        };
        Self { state, bar, ticker: Some((end, ticker)) }
    }

    /// The run of this number begins; those before it are done.
    pub fn begin(&self, current: usize) {
        let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        (state.current, state.current_began) = (current, Instant::now());
    }

    /// Writes to standard output without a progress line in between.
    pub fn beside<T>(&self, write: impl FnOnce() -> T) -> T {
        match &self.bar {
            Some(bar) => bar.suspend(write),
            None => write(),
        }
    }

    /// Tells no more.
    pub fn end(mut self) {
        if let Some((end, ticker)) = self.ticker.take() {
            drop(end);
            let _ = ticker.join();
        }
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }
}

impl State {
    fn line(&self, now: Instant) -> String {
        let [spent, here] = [self.began, self.current_began].map(|then| (now - then).as_secs_f64());
        format!(
            "row {} of {}, {}: {here:.0} s; about {} left",
            self.current + 1,
            self.names.len(),
            self.names[self.current],
            duration(self.forecast.left(self.current, spent - here, here)),
        )
    }
}

/// How long the rest takes, by what each run took elsewhere and by how this machine has done so far.
struct Forecast {
    /// Seconds of one core, of each run.
    costs: Vec<f64>,
    threads: f64,
}

/// Core-seconds for which the other machine's pace is believed; later, more and more, this one's.
const BELIEVED: f64 = 10.0;

impl Forecast {
    fn new(costs: impl Iterator<Item = f64>, threads: usize) -> Self {
        Self { costs: costs.collect(), threads: threads.clamp(1, cases::measure::SEEDS) as f64 }
    }

    /// Seconds left in run `current` after `here` seconds in it; those before it took `spent`.
    fn left(&self, current: usize, spent: f64, here: f64) -> f64 {
        let (done, rest) = self.costs.split_at(current);
        let done: f64 = done.iter().sum();
        // What a core-second takes here.
        let pace = (BELIEVED / self.threads + spent) / (BELIEVED + done);
        let Some((this, later)) = rest.split_first() else { return 0.0 };
        (this * pace - here).max(0.0) + later.iter().sum::<f64>() * pace
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_forecast_goes_by_the_costs_then_by_this_machine() {
        let forecast = Forecast::new([10.0, 90.0, 100.0].into_iter(), 2);
        assert_eq!(forecast.left(0, 0.0, 0.0), 100.0, "as fast as the machine where costs were measured");
        // Half as fast as expected: 95 core-seconds of 190 are left after a long row.
        let left = forecast.left(2, 100.0, 0.0);
        assert!((90.0..100.0).contains(&left), "{left}");
        let within = forecast.left(1, 10.0, 30.0);
        assert!(within < forecast.left(1, 10.0, 0.0) - 29.0, "time within a row counts: {within}");
        assert!(forecast.left(1, 10.0, 1e4) > 50.0, "a row that is late does not take from those after it");
    }

    #[test]
    fn more_threads_than_seeds_are_of_no_use() {
        assert_eq!(Forecast::new([160.0].into_iter(), 64).left(0, 0.0, 0.0), 10.0);
    }
}
