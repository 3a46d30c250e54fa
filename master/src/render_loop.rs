//! The whole program in one loop: what the front end asks goes to the workers, what they answer goes to
//! the front end, until it is enough.

use std::time::{Duration, Instant};

use frame::front_end::GivenUp;
use frame::{Absorbed, Answered, FrontEnd};

use crate::cluster::{Cluster, Event, Status};
use crate::console::{Console, Progress};
use crate::interrupt::Interrupt;
use crate::stats::{Ending, Gap, RenderStats, Stop};

/// Draws until it is enough.
pub fn run<F: FrontEnd + ?Sized>(
    front: &mut F,
    cluster: &mut Cluster,
    stop: &Stop,
    interrupt: &Interrupt,
    console: &mut Console,
) -> RenderStats {
    run_watched(front, cluster, stop, interrupt, console, &mut |_, _| Watched::GoOn)
}

/// What somebody who watches thinks of it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Watched {
    /// More frames, please.
    GoOn,
    /// No frame after the one in progress.
    Enough,
}

/// As [`run`], and shows whoever watches every frame as it is completed (or several, where several
/// are completed at once). Top to bottom: ask, listen, look around.
pub fn run_watched<F: FrontEnd + ?Sized>(
    front: &mut F,
    cluster: &mut Cluster,
    stop: &Stop,
    interrupt: &Interrupt,
    console: &mut Console,
    watch: &mut dyn FnMut(&mut F, &RenderStats) -> Watched,
) -> RenderStats {
    let mut stats = RenderStats::new();
    let mut clock = Clock::new();
    let mut status = cluster.status();
    let mut looked = Instant::now();
    let mut outstanding = 0_usize;
    // No frame is begun any more.
    let mut is_over = false;
    if let Some(frames) = stop.frames {
        front.set_limit(frames);
    }
    // What another process has drawn before is no work of ours.
    stats.frames = front.frames();
    (stats.resumed, stats.spent) = (stats.frames, stop.spent);
    for rect in front.gaps() {
        let gap = Gap { what: rect.to_string(), reason: "workers died of it before".into() };
        console.gap(&gap);
        stats.gaps.push(gap);
    }

    while !front.is_finished() {
        // Ask: as much as the front end wants, as long as the queue is short.
        let questions = front.ask(QUESTIONS_WAITING_MAX.saturating_sub(outstanding));
        if !questions.is_empty() {
            outstanding += questions.len();
            cluster.ask(questions);
        }

        // Listen.
        match cluster.next(PATIENCE) {
            Some(Event::Answered { asked, body, cost, worker, bytes }) => {
                outstanding = outstanding.saturating_sub(1);
                stats.cost += cost;
                stats.answer_bytes += bytes;
                stats.pixels += body.len() as u64;
                match front.absorb(Answered { ticket: asked.ticket, body, worker, cost: &cost }) {
                    Absorbed::Kept | Absorbed::Completed { .. } | Absorbed::Marked => stats.answers += 1,
                    Absorbed::Unwanted => stats.unused += 1,
                }
            }
            Some(Event::Unanswered { asked, reason }) => {
                outstanding = outstanding.saturating_sub(1);
                if front.give_up(asked.ticket) != GivenUp::Unwanted {
                    let gap = Gap { what: asked.question.ask.to_string(), reason };
                    console.gap(&gap);
                    stats.gaps.push(gap);
                }
            }
            Some(event) => {
                if matches!(event, Event::WorkerReady { .. }) {
                    // A worker may be ready and gone again between two looks.
                    clock.begin(Instant::now());
                }
                console.event(&event);
            }
            None => {}
        }

        // Look around: is it enough?
        let now = Instant::now();
        if now >= looked + BETWEEN_LOOKS {
            looked = now;
            status = cluster.status();
            clock.look(&status, now);
            front.set_parallelism(status.parallelism());
            console.workers(&status);
        }
        let grown = front.frames().saturating_sub(stats.frames);
        cluster.pulse().drawn(grown, now);
        stats.frames = front.frames();
        stats.elapsed = clock.elapsed(now);
        is_over |= grown > 0 && watch(front, &stats) == Watched::Enough;
        if clock.alone_for(now) >= stop.without_workers.unwrap_or(Duration::MAX) {
            stats.ending = Ending::NoWorkers;
            break;
        }
        if interrupt.asked() {
            stats.ending = Ending::Interrupted;
            is_over = true;
        }
        let has_begun = clock.ready.is_some() || stats.frames > 0;
        is_over |= has_begun && stop.after.is_some_and(|after| stats.elapsed + stats.spent >= after);
        if clock.estimate_is_due(now, stats.frames) {
            stats.error = front.error();
            is_over |= stats.error.zip(stop.error).is_some_and(|(estimate, enough)| estimate.high <= enough);
        }
        if is_over {
            front.finish();
            if !front.is_finished() && is_deserted(&status, stats.frames) {
                console.line("no worker is left to complete the frame in progress: it is left out");
                if stats.frames == 0 && stats.ending == Ending::Enough {
                    stats.ending = Ending::Deserted;
                }
                break;
            }
        }
        console.progress(&Progress { stats: &stats, stop, status: &status, frame: front.frame_progress() }, now);
    }

    cluster.cancel_all();
    stats.frames = front.frames();
    stats.elapsed = clock.elapsed(Instant::now());
    stats.preparation = clock.preparation();
    stats.error = front.error();
    stats
}

/// Nobody is there to complete the frame in progress. For a first frame, whoever still fetches the scene is waited for.
fn is_deserted(status: &Status, frames: u32) -> bool {
    if frames > 0 { status.ready == 0 } else { status.workers == 0 }
}

/// Questions that may wait for workers: enough for some hundreds of them.
pub(crate) const QUESTIONS_WAITING_MAX: usize = 4096;
/// Longest time without a look around.
const PATIENCE: Duration = Duration::from_millis(50);
/// How things stand with the workers is asked this often.
const BETWEEN_LOOKS: Duration = Duration::from_millis(20);
/// The estimate looks at every pixel, so not too often.
const BETWEEN_ESTIMATES: Duration = Duration::from_millis(500);

/// Who watches the time.
struct Clock {
    started: Instant,
    /// When the first worker was ready.
    ready: Option<Instant>,
    /// Since when there is none at all.
    alone_since: Option<Instant>,
    /// Last estimate: when, and of which frame.
    estimated: Option<(Instant, u32)>,
}

impl Clock {
    fn new() -> Self {
        let started = Instant::now();
        Self { started, ready: None, alone_since: Some(started), estimated: None }
    }

    /// A worker is ready; from the first on, time counts.
    fn begin(&mut self, now: Instant) {
        self.ready.get_or_insert(now);
    }

    fn look(&mut self, status: &Status, now: Instant) {
        if status.ready > 0 {
            self.begin(now);
        }
        match status.workers {
            0 => _ = self.alone_since.get_or_insert(now),
            _ => self.alone_since = None,
        }
    }

    fn preparation(&self) -> Duration {
        self.ready.map_or(Duration::ZERO, |ready| ready - self.started)
    }

    fn elapsed(&self, now: Instant) -> Duration {
        self.ready.map_or(Duration::ZERO, |ready| now.saturating_duration_since(ready))
    }

    fn alone_for(&self, now: Instant) -> Duration {
        self.alone_since.map_or(Duration::ZERO, |since| now - since)
    }

    /// A new frame is there, and the last estimate is a while ago.
    fn estimate_is_due(&mut self, now: Instant, frames: u32) -> bool {
        let due = self.estimated.is_none_or(|(when, of)| frames > of && now - when >= BETWEEN_ESTIMATES);
        if due {
            self.estimated = Some((now, frames));
        }
        due
    }
}
