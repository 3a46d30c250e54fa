//! How far the report is.

use std::time::Instant;

use serde_json::json;

use runtime::console::Console;
use runtime::spoken::duration;

/// Counts runs, and says how long it will take.
pub struct Progress<'a> {
    console: &'a mut Console,
    scene: String,
    began: Instant,
    done: usize,
    all: usize,
}

/// Share of a run that must be over before the rest can be told from it: before, it is mostly preparation.
const SHARE_TO_JUDGE: f64 = 0.1;

impl<'a> Progress<'a> {
    /// So many runs are to come.
    pub fn new(console: &'a mut Console, runs: usize) -> Self {
        Self { console, scene: String::new(), began: Instant::now(), done: 0, all: runs }
    }

    /// A scene begins.
    pub fn scene(&mut self, name: &str) {
        self.scene = name.to_string();
    }

    /// Number of runs that are over.
    pub fn done(&self) -> usize {
        self.done
    }

    /// So many runs are over, or will never take place.
    pub fn reached(&mut self, done: usize) {
        self.done = self.done.max(done).min(self.all);
    }

    /// A share of a run is over, 0..=1.
    pub fn running(&mut self, method: &str, share: f64) {
        let Self { console, scene, began, done, all } = self;
        let now = Instant::now();
        let over = *done as f64 + share;
        let left = (over > SHARE_TO_JUDGE).then(|| {
            let left = (now - *began).as_secs_f64() * (*all as f64 / over - 1.0);
            left.max(0.0)
        });
        console.status(now, || {
            let said = left.map(|left| format!("  {} left", duration(left))).unwrap_or_default();
            let line = format!("{scene}  {method}  run {} of {all}{said}", *done + 1);
            let fields = json!({
                "scene": scene, "method": method, "runs_done": done, "runs": all, "run_progress": share,
                "seconds_left": left,
            });
            (line, fields)
        });
    }

    /// Something worth a line.
    pub fn line(&self, line: &str) {
        self.console.line(line);
    }
}
