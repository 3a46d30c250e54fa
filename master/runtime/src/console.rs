//! What is said while it draws, and after: lines, a bar, or JSON.

use std::io::{IsTerminal, Write};
use std::path::Path;
use std::time::{Duration, Instant};

use frame::metrics::Estimate;
use indicatif::{ProgressBar, ProgressStyle};
use protocol::answer::Cost;
use protocol::schedule::WorkerState;
use serde_json::{Value, json};

use crate::cluster::roster::{self, Roster};
use crate::cluster::{Event, Status};
use crate::series::Series;
use crate::spoken::{duration, short};
use crate::stats::{Ending, Gap, RenderStats, Stop};

/// How much is said.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ConsoleOptions {
    /// Nothing but errors for people.
    pub quiet: bool,
    /// Events for programs.
    pub json: bool,
}

/// Tells what happens: people read standard error, programs standard output.
pub struct Console {
    options: ConsoleOptions,
    bar: Option<ProgressBar>,
    last: Option<Instant>,
    roster: Roster,
    series: Option<Series>,
}

/// Where it stands.
pub struct Progress<'a> {
    /// What was done so far.
    pub stats: &'a RenderStats,
    /// When it will be enough.
    pub stop: &'a Stop,
    /// The workers.
    pub status: &'a Status,
    /// How much of the current frame is there, 0..=1.
    pub frame: f32,
}

impl Console {
    /// A bar if a person watches, else plain lines; `--quiet` and `--json` as asked for.
    pub fn new(options: ConsoleOptions) -> Self {
        let watched = !options.quiet && std::io::stderr().is_terminal();
        let bar = watched.then(|| {
            let style =
                ProgressStyle::with_template("{spinner} {wide_msg}").unwrap_or_else(|_| ProgressStyle::default_bar());
            ProgressBar::new_spinner().with_style(style)
        });
        Self { options, bar, last: None, roster: Roster::default(), series: None }
    }

    /// Says nothing at all.
    pub fn silent() -> Self {
        Self::new(ConsoleOptions { quiet: true, json: false })
    }

    /// Something worth a line.
    pub fn line(&self, line: &str) {
        match &self.bar {
            _ if self.options.quiet => {}
            Some(bar) => bar.suspend(|| eprintln!("{line}")),
            None => eprintln!("{line}"),
        }
    }

    /// An event for programs. A reader that went away is no reason to stop.
    pub fn emit(&self, event: &str, mut fields: Value) {
        if self.options.json {
            fields["event"] = json!(event);
            let _ = writeln!(std::io::stdout(), "{fields}");
        }
    }

    /// Who came and went.
    pub fn event(&self, event: &Event) {
        match event {
            Event::WorkerJoined { worker, name, threads, address } => {
                if let Some(address) = address {
                    self.line(&format!("worker {worker} joined: {name} at {address}, {threads} threads"));
                }
                let address = address.map(|address| address.to_string());
                let fields = json!({ "worker": worker, "name": name, "threads": threads, "address": address });
                self.emit("worker_joined", fields);
            }
            Event::WorkerReady { worker } => self.emit("worker_ready", json!({ "worker": worker })),
            Event::WorkerLeft { worker, name, reason } => {
                self.line(&format!("worker {worker} ({name}) left: {reason}"));
                self.emit("worker_left", json!({ "worker": worker, "name": name, "reason": reason }));
            }
            Event::NoWorkers => self.line("no worker is left; waiting for others"),
            Event::WorkerExposed { worker, name, reason, gave } => {
                let again = if *gave { "; what is drawn begins again" } else { "" };
                self.line(&format!("worker {worker} ({name}) is asked no more: {reason}{again}"));
                let fields = json!({ "worker": worker, "name": name, "reason": reason, "begins_again": gave });
                self.emit("worker_exposed", fields);
            }
            Event::Undecided { workers, ask } => {
                self.line(&format!(
                    "workers {workers:?} give different answers to {ask}, and there is no other to decide: the picture may be \
                     wrong until there is (--workers embedded decides at once)"
                ));
                self.emit("undecided", json!({ "workers": workers, "ask": ask }));
            }
            Event::Checked | Event::Answered { .. } | Event::Unanswered { .. } => {}
        }
    }

    /// A part of the picture was set aside.
    pub fn gap(&self, gap: &Gap) {
        self.line(&format!("set aside {}: {}", gap.what, gap.reason));
        self.emit("set_aside", json!({ "what": gap.what, "reason": gap.reason }));
    }

    /// How the workers are, if that is news. All are looked at: so only when there can be any.
    pub fn workers(&mut self, status: &Status) {
        for info in self.roster.news(status) {
            if info.state == WorkerState::Quarantined {
                let reason = info.reason.as_deref().unwrap_or_default();
                self.line(&format!("worker {} ({}) is in quarantine: {reason}", info.worker, info.name));
            }
            self.emit("worker", roster::json(info));
        }
    }

    /// How far it is, now and then.
    pub fn progress(&mut self, progress: &Progress, now: Instant) {
        if self.is_due(now) {
            let left = progress.left();
            let (mut line, mut fields) = (progress.line(), progress.json());
            if let Some(series) = &self.series {
                line = format!("{}: {}", series.line(left, now), line.trim_start());
                fields["series"] = series.json(left, now);
            }
            self.show(line);
            self.emit("progress", fields);
        }
    }

    /// What is drawn from now on is one picture of these.
    pub fn within(&mut self, series: Series) {
        self.series = Some(series);
    }

    /// How far something else is, now and then: a line for people, fields for programs.
    pub fn status(&mut self, now: Instant, said: impl FnOnce() -> (String, Value)) {
        if self.is_due(now) {
            let (line, fields) = said();
            self.show(line);
            self.emit("progress", fields);
        }
    }

    /// Somebody listens, and the last word was a while ago.
    fn is_due(&mut self, now: Instant) -> bool {
        let pause = if self.bar.is_some() { Duration::from_millis(200) } else { Duration::from_secs(2) };
        let due = self.last.is_none_or(|last| now - last >= pause) && (!self.options.quiet || self.options.json);
        if due {
            self.last = Some(now);
        }
        due
    }

    fn show(&self, line: String) {
        match &self.bar {
            Some(bar) => {
                bar.set_message(line);
                bar.tick();
            }
            None => self.line(&line),
        }
    }

    /// The drawing is over: no bar any more.
    pub fn clear(&self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }

    /// A picture was saved.
    pub fn saved(&self, path: &Path) {
        self.line(&format!("saved {}", path.display()));
        self.emit("saved", json!({ "path": path.display().to_string() }));
    }

    /// A picture could not be saved there.
    pub fn unsaved(&self, path: &Path, reason: &str) {
        self.line(reason);
        self.emit("unsaved", json!({ "path": path.display().to_string(), "reason": reason }));
    }

    /// The end: what was done, and at what cost.
    pub fn summary(&self, stats: &RenderStats, traffic: Traffic) {
        let cost = &stats.cost;
        if stats.begun_again > 0 {
            self.line("all was drawn again, as a worker was found to compute wrongly");
        }
        self.line(&format!(
            "{} frames{} in {:.2} s (and {:.2} s of preparation): {:.2} frames/s, {:.2} Mray/s",
            stats.drawn(),
            if stats.resumed > 0 { format!(" more, {} in all,", stats.frames) } else { String::new() },
            stats.elapsed.as_secs_f64(),
            stats.preparation.as_secs_f64(),
            stats.rate(stats.drawn()),
            stats.rate(cost.rays()) / 1e6
        ));
        self.line(&format!(
            "rays: {} eye, {} shadow, {} light, {} compensation; {} photon queries",
            short(cost.eye_rays),
            short(cost.shadow_rays),
            short(cost.light_rays),
            short(cost.compensation_rays),
            short(cost.photon_queries)
        ));
        let frames = stats.drawn().max(1) as f64;
        let stages = cost.micros_by_stage().into_iter().filter(|(_, micros)| *micros > 0);
        let stages: Vec<String> =
            stages.map(|(name, micros)| format!("{:.1} {name}", micros as f64 / 1e3 / frames)).collect();
        self.line(&format!("ms of a thread per frame: {}", stages.join(", ")));
        if stats.answer_bytes > 0 {
            self.line(&format!(
                "answers: {:.2} bytes a pixel, {} bytes a frame; {} sent, {} received in all",
                stats.answer_bytes as f64 / stats.pixels.max(1) as f64,
                short(stats.answer_bytes / stats.drawn().max(1)),
                short(traffic.sent),
                short(traffic.received)
            ));
        }
        if let Some(estimate) = stats.error {
            self.line(&format!("estimated error: {}", described(&estimate)));
        }
        if cost.dropped > 0 {
            self.line(&format!("{} samples were not finite and count as black", cost.dropped));
        }
        self.emit("done", stats.json(traffic));
    }
}

/// Writes to standard output. A reader that went away (`| head`) is nothing to complain about.
pub fn print(text: &str) {
    let _ = std::io::stdout().write_all(text.as_bytes());
}

/// A line for [`console::print`](print()), as `println!` makes it, which would panic.
#[macro_export]
macro_rules! print_line {
    ($($line:tt)*) => {
        $crate::console::print(&(format!($($line)*) + "\n"))
    };
}
pub use crate::print_line;

/// Bytes that went over the network.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Traffic {
    /// From this process.
    pub sent: u64,
    /// To it.
    pub received: u64,
}

impl Progress<'_> {
    fn line(&self) -> String {
        let Self { stats, status, frame, .. } = self;
        match (status.workers, status.ready) {
            (0, _) => return "waiting for workers".to_string(),
            (_, 0) => return roster::summary(status),
            _ => {}
        }
        let mut line = format!(
            "{:6.1} s  frame {}  {:.2} frames/s  {:.2} Mray/s  {}",
            stats.elapsed.as_secs_f64(),
            stats.frames + 1,
            stats.rate(stats.drawn()),
            stats.rate(stats.cost.rays()) / 1e6,
            roster::summary(status),
        );
        if stats.frames < 3 {
            line += &format!("  {:.0} % of the frame", frame * 100.0);
        }
        if let Some(estimate) = &stats.error {
            line += &format!("  {}", described(estimate));
        }
        if let Some(left) = self.left() {
            line += &format!("  {} left", duration(left.as_secs_f64()));
        }
        line
    }

    fn json(&self) -> Value {
        let Self { stats, status, frame, .. } = self;
        json!({
            "seconds": stats.elapsed.as_secs_f64(),
            "frames": stats.frames,
            "frame_progress": frame,
            "frames_per_second": stats.rate(stats.drawn()),
            "rays_per_second": stats.rate(stats.cost.rays()),
            "workers": status.workers,
            "workers_ready": status.ready,
            "busy": { "dispatcher": status.busy.dispatcher, "drawing": status.busy.drawing },
            "worker_states": status.list.iter().map(roster::json).collect::<Vec<_>>(),
            "rel_mse": estimate_json(stats.error),
            "seconds_left": self.left().map(|left| left.as_secs_f64()),
        })
    }

    /// Time until the first of the conditions is met, as far as can be told.
    fn left(&self) -> Option<Duration> {
        let Self { stats, stop, .. } = self;
        let elapsed = stats.elapsed.as_secs_f64();
        let by_time = stop.after.map(|after| after.as_secs_f64() - elapsed - stats.spent.as_secs_f64());
        let frames = f64::from(stats.frames);
        let for_all = (stats.drawn() > 0).then(|| elapsed * frames / stats.drawn() as f64);
        let by_frames = for_all.zip(stop.frames).map(|(time, all)| time * (f64::from(all) / frames - 1.0));
        // The error falls about in proportion to the number of frames.
        let by_error = for_all.zip(stop.error.zip(stats.error));
        let by_error = by_error.map(|(time, (enough, now))| time * (now.high / enough - 1.0));
        let left = [by_time, by_frames, by_error].into_iter().flatten().reduce(f64::min)?;
        Duration::try_from_secs_f64(left.max(0.0)).ok()
    }
}

impl RenderStats {
    /// All of it, for programs.
    pub fn json(&self, traffic: Traffic) -> Value {
        let Cost { eye_rays, shadow_rays, light_rays, compensation_rays, photon_queries, dropped, .. } = self.cost;
        let stages: serde_json::Map<String, Value> = self
            .cost
            .micros_by_stage()
            .into_iter()
            .map(|(name, micros)| (name.replace(' ', "_"), json!(micros as f64 / 1e3)))
            .collect();
        json!({
            "ending": match self.ending {
                Ending::Enough => "enough",
                Ending::Interrupted => "interrupted",
                Ending::NoWorkers | Ending::Deserted => "no_workers",
            },
            "set_aside": self.gaps.iter().map(|gap| json!({ "what": gap.what, "reason": gap.reason })).collect::<Vec<_>>(),
            "preparation_seconds": self.preparation.as_secs_f64(),
            "seconds": self.elapsed.as_secs_f64(),
            "frames": self.frames,
            "frames_resumed": self.resumed,
            "frames_per_second": self.rate(self.drawn()),
            "rays_per_second": self.rate(self.cost.rays()),
            "rays": { "eye": eye_rays, "shadow": shadow_rays, "light": light_rays, "compensation": compensation_rays },
            "photon_queries": photon_queries,
            "samples_dropped": dropped,
            "thread_ms": stages,
            "answers": self.answers,
            "answers_unused": self.unused,
            "answer_bytes": self.answer_bytes,
            "answer_bytes_per_pixel": self.answer_bytes as f64 / self.pixels.max(1) as f64,
            "bytes_sent": traffic.sent,
            "bytes_received": traffic.received,
            "rel_mse": estimate_json(self.error),
        })
    }
}

fn described(estimate: &Estimate) -> String {
    format!("relMSE {:.2e} ({:.1e} to {:.1e})", estimate.rel_mse, estimate.low, estimate.high)
}

fn estimate_json(estimate: Option<Estimate>) -> Value {
    estimate.map_or(Value::Null, |e| json!({ "estimate": e.rel_mse, "low": e.low, "high": e.high }))
}
