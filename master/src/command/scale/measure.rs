//! One measurement: so many clients, so many frames.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::{Duration, Instant};

use anyhow::{Context, anyhow};
use frame::{FrontEnd, Plane};
use protocol::question::WorldState;
use scenes::Scene;

use super::clients::Clients;
use super::settings::Drawing;
use super::watched::{Took, Watched};
use runtime::cluster::{Cluster, ClusterOptions};
use runtime::console::Console;
use runtime::failure::Failure;
use runtime::interrupt::Interrupt;
use runtime::render_loop::{self, run_watched};
use runtime::stats::{Ending, Stop};
use runtime::stopwatch::StopWatch;
use runtime::threads::{DISPATCHER, MAIN, NETWORK, Threads, Used};

/// What some clients did.
#[derive(Clone, Debug)]
pub struct Measured {
    /// The share of a core that each client had; of clients on machines of their own, the threads of the first client
    /// that do as much.
    pub shares: Vec<f64>,
    /// The first frame that was timed, and the first that was not any more.
    pub timed: [u32; 2],
    /// Frames that were timed.
    pub frames: u32,
    /// Time for these, seconds.
    pub seconds: f64,
    /// Bytes from all clients, a frame.
    pub bytes_per_frame: f64,
    /// Answers, a frame.
    pub answers_per_frame: f64,
    /// Of a core, for the master's whole process.
    pub master_cores: f64,
    /// Of that, by thread.
    pub master: Costs,
    /// Of a core, for all clients together.
    pub client_cores: f64,
    /// Mean number of light sets that a client has made for a frame that it took part in.
    pub sets_per_share: f64,
    /// Light sets made by all clients, a frame.
    pub sets_per_frame: f64,
    /// From the first question of a frame to its end, milliseconds, sorted.
    pub latencies_ms: Vec<f64>,
    /// Hash of the unfiltered picture.
    pub picture: [u8; 32],
    /// What each answer took.
    pub answers: Vec<Took>,
}

impl Measured {
    /// Seconds for a frame.
    pub fn frame_time(&self) -> f64 {
        self.seconds / f64::from(self.frames)
    }

    /// Shares of a core of all clients together.
    pub fn cores(&self) -> f64 {
        self.shares.iter().sum()
    }

    /// Of all the time that clients might have used.
    pub fn quota_used(&self) -> f64 {
        self.client_cores / self.cores()
    }
}

/// Processor time of the master's threads for an answer, microseconds.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Costs {
    /// Of the network's threads, which unpack it.
    pub network: f64,
    /// Of the thread that says who is asked what.
    pub dispatcher: f64,
    /// Of the thread that asks and absorbs, …
    pub main: f64,
    /// … and of all that help it.
    pub helpers: f64,
}

impl Costs {
    /// Of all of them, microseconds. Where the system does not tell threads apart, all is the main one's.
    pub fn of(used: &BTreeMap<String, Used>, all: f64, answers: f64) -> Self {
        let each = |seconds: f64| seconds * 1e6 / answers.max(1.0);
        let of = |kind: &str| each(used.get(kind).map_or(0.0, |used| used.all()));
        let (network, dispatcher) = (of(NETWORK), of(DISPATCHER));
        if used.is_empty() {
            return Self { main: each(all), ..Self::default() };
        }
        let main = of(MAIN);
        Self { network, dispatcher, main, helpers: (each(all) - network - dispatcher - main).max(0.0) }
    }

    /// Of all threads, microseconds.
    pub fn all(&self) -> f64 {
        self.network + self.dispatcher + self.main + self.helpers
    }
}

/// A percentile of sorted numbers; 0 of none.
pub fn percentile(sorted: &[f64], percent: usize) -> f64 {
    sorted.get((sorted.len().saturating_sub(1) * percent).div_ceil(100)).copied().unwrap_or(0.0)
}

/// Light sets of a frame, at least.
const SETS: usize = 9;

/// Which frames are timed; the same for all numbers of clients, so that all draw the same picture.
#[derive(Clone, Copy, Debug)]
pub struct Timing {
    /// Frames before the clock starts: whoever has joined gets to know its speed, and the first frames come all at once.
    around: u32,
    /// Frames that are timed.
    frames: u32,
}

impl Timing {
    /// For runs with at most so many clients.
    pub fn new(frames: u32, most_clients: usize) -> Self {
        // As many as a front end has in flight at a time, at most.
        let around = (1 + (2 * most_clients).div_ceil(SETS)).clamp(3, 16) as u32;
        Self { around, frames }
    }

    /// Frames in all: after the clock stops as many as before it starts, so that it stops at full swing.
    pub fn total(self) -> u32 {
        self.frames + 2 * self.around
    }

    /// The clock starts and stops when so many frames are complete.
    fn marks(self) -> [u32; 2] {
        [self.around, self.around + self.frames]
    }
}

/// Longest wait until all clients have built the scene.
const PATIENCE: Duration = Duration::from_secs(300);

/// Draws with a client for each share of a core. Nothing if it was interrupted.
///
/// # Errors
/// If clients cannot be started or held to their shares, or if one of them is lost.
pub fn measure(
    scene: &Arc<Scene>,
    shares: &[f64],
    timing: Timing,
    drawing: &Drawing,
    interrupt: &Interrupt,
) -> Result<Option<Measured>, Failure> {
    let listen = Some((std::net::Ipv4Addr::LOCALHOST, 0).into());
    let mut cluster =
        Cluster::start(ClusterOptions { listen, ..ClusterOptions::default() }).context("cannot listen for clients")?;
    let world = cluster.publish(Arc::clone(scene)).context("the scene cannot be sent to clients")?;
    let mut clients = Clients::start(shares, &cluster)?;
    if !wait_until_ready(&mut cluster, &mut clients, shares.len(), interrupt)? {
        return Ok(None);
    }
    clients.hold()?;
    let used = || clients.cpu_seconds();
    let Some(drawn) = draw(scene, world, &mut cluster, &used, timing, drawing, interrupt)? else { return Ok(None) };
    let lost = clients.lost();
    if lost > 0 {
        return Err(anyhow!("{lost} clients were lost").into());
    }
    // Its good-bye ends the clients.
    drop(cluster);
    Ok(Some(Measured { shares: shares.to_vec(), ..drawn }))
}

/// Draws with those workers of a cluster that are called; whose shares they have is not said. Nothing if it was
/// interrupted.
///
/// # Errors
/// If frames are not completed, or have gaps.
pub(super) fn draw(
    scene: &Arc<Scene>,
    world: WorldState,
    cluster: &mut Cluster,
    used: &dyn Fn() -> f64,
    timing: Timing,
    drawing: &Drawing,
    interrupt: &Interrupt,
) -> Result<Option<Measured>, Failure> {
    let before = cluster.status();
    let mut front = Watched::new(drawing.method.begin(&drawing.view(scene, world)));
    let frames = timing.total();
    let stop = Stop { frames: Some(frames), without_workers: Some(PATIENCE), ..Stop::default() };
    let mut quiet = Console::silent();
    let watch = StopWatch::start();
    // When, after how many frames and answers, and processor time of clients and master by then.
    let mut marks: Vec<Mark> = Vec::new();
    let stats = run_watched(&mut front, cluster, &stop, interrupt, &mut quiet, &mut |front, stats| {
        let due = timing.marks().get(marks.len()).is_some_and(|due| front.frames() >= *due);
        if let (true, Some((at, _))) = (due, front.done.last()) {
            let (clients, master, threads) = (used(), watch.elapsed().cpu, Threads::now());
            marks.push(Mark { at: *at, frames: front.frames(), answers: stats.answers, clients, master, threads });
        }
        render_loop::Watched::GoOn
    });
    if stats.ending == Ending::Interrupted {
        return Ok(None);
    }
    let [begun, ended] = &marks[..] else {
        return Err(anyhow!("the frames were not completed: clients were lost").into());
    };
    if !stats.gaps.is_empty() {
        return Err(anyhow!("the picture has {} gaps", stats.gaps.len()).into());
    }
    let (seconds, status) = ((ended.at - begun.at).as_secs_f64(), cluster.status());
    let (first, last, master) = (begun.frames, ended.frames, ended.master - begun.master);
    let (by_thread, answers) = (ended.threads.since(&begun.threads), ended.answers - begun.answers);
    let mut latencies_ms: Vec<f64> =
        front.done[first as usize..last as usize].iter().map(|(_, took)| took.as_secs_f64() * 1e3).collect();
    latencies_ms.sort_by(f64::total_cmp);
    let begun_sets = status.counters.sets_begun - before.counters.sets_begun;
    let per_frame = |count: u64| count as f64 / f64::from(frames);
    Ok(Some(Measured {
        shares: Vec::new(),
        timed: [first, last],
        frames: last - first,
        seconds,
        bytes_per_frame: per_frame(status.bytes_received - before.bytes_received),
        answers_per_frame: per_frame(stats.answers),
        master_cores: master / seconds,
        master: Costs::of(&by_thread, master, answers as f64),
        client_cores: (ended.clients - begun.clients) / seconds,
        sets_per_share: begun_sets as f64 / (status.counters.shares - before.counters.shares).max(1) as f64,
        sets_per_frame: per_frame(begun_sets),
        latencies_ms,
        picture: front.show(Plane::Raw).sha256(),
        answers: std::mem::take(&mut front.answers),
    }))
}

/// How far it was at a moment: after how many frames and answers, and processor time of clients and master, in all and by
/// thread, seconds.
struct Mark {
    at: Instant,
    frames: u32,
    answers: u64,
    clients: f64,
    master: f64,
    threads: Threads,
}

/// All clients have built the scene; false if it was interrupted.
fn wait_until_ready(
    cluster: &mut Cluster,
    clients: &mut Clients,
    count: usize,
    interrupt: &Interrupt,
) -> Result<bool, Failure> {
    let begun = Instant::now();
    while cluster.status().ready < count {
        if interrupt.asked() {
            return Ok(false);
        }
        match clients.lost() {
            0 if begun.elapsed() < PATIENCE => {}
            0 => {
                return Err(anyhow!(
                    "after {} s only {} of {count} clients are ready",
                    PATIENCE.as_secs(),
                    cluster.status().ready
                )
                .into());
            }
            lost => return Err(anyhow!("{lost} of {count} clients ended before they were ready").into()),
        }
        // Comings and goings are no news here.
        cluster.next(Duration::from_millis(20));
    }
    Ok(true)
}

#[cfg(test)]
mod tests {
    use super::percentile;

    #[test]
    fn percentiles_are_taken_from_above() {
        let ten: Vec<f64> = (1..=10).map(f64::from).collect();
        assert_eq!(
            [percentile(&ten, 0), percentile(&ten, 50), percentile(&ten, 99), percentile(&ten, 100)],
            [1.0, 6.0, 10.0, 10.0]
        );
        assert_eq!(percentile(&[], 50), 0.0);
    }
}
