//! The loop without people: for replays and measurements.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use anyhow::{Context, anyhow};
use frame::live::latency::Latency;
use frame::live::{Event, Frame, Knobs, Live};
use frame::tone::Tone;
use protocol::answer::Cost;
use protocol::message::{ToWorker, encode};
use protocol::question::WorldState;
use scenes::{Change, Scene};

use super::driver::{Driver, Outcome};
use crate::cluster::{Cluster, ClusterOptions};
use crate::display::encoded::{CpuToneMapper, DisplaySettings};
use crate::display::thread::DisplayThread;

/// A loop and its workers.
pub struct Player {
    driver: Driver,
    shown: VecDeque<Frame>,
    /// Makes of pictures what a browser receives; `None` if time stands still.
    display: Option<DisplayThread>,
    /// From inputs to then.
    latency: Arc<Mutex<Latency>>,
    /// When the loop was last told of workers; `None` if time stands still.
    looked: Option<Instant>,
    /// What the last edits were sent to each worker as, bytes, and how many there were.
    pub edit_bytes: [u64; 2],
}

/// The loop is told of workers this often, as in a session.
const BETWEEN_LOOKS: Duration = Duration::from_millis(250);
/// Longest wait for a picture.
const PATIENCE: Duration = Duration::from_secs(600);

impl Player {
    /// Publishes the scene and begins.
    ///
    /// # Errors
    /// No worker can be started, or the scene cannot be sent to them.
    pub fn start(scene: Scene, knobs: Knobs, options: ClusterOptions, frozen: bool) -> anyhow::Result<Self> {
        let mut cluster = Cluster::start(options).context("workers cannot be started")?;
        let camera = scene.camera;
        cluster.publish(Arc::new(scene)).context("the scene cannot be sent to workers")?;
        let layer = knobs.layer;
        let driver = Driver::new(cluster, camera, knobs, frozen);
        let (begun, latency) = (driver.begun(), Arc::<Mutex<Latency>>::default());
        let waited = Arc::clone(&latency);
        let start = || {
            let settings = DisplaySettings { layer, tone: Tone::PLAIN, denoise: false };
            DisplayThread::start(settings, Box::new(CpuToneMapper), move |encoded| {
                let (made, micros) = (encoded.message().is_ok(), begun.elapsed().as_micros() as u64);
                if let Some(since) = encoded.since.filter(|_| made) {
                    waited.lock().unwrap_or_else(PoisonError::into_inner).add(micros.saturating_sub(since.0));
                }
            })
        };
        let display = (!frozen).then(start).transpose().context("cannot start a thread")?;
        let looked = (!frozen).then_some(begun);
        let mut player = Self { driver, shown: VecDeque::new(), display, latency, looked, edit_bytes: [0; 2] };
        player.driver.begin();
        player.handle_outcomes();
        Ok(player)
    }

    /// The loop.
    pub fn live(&self) -> &Live {
        &self.driver.live
    }

    /// Its workers.
    pub fn cluster(&self) -> &Cluster {
        &self.driver.cluster
    }

    /// Something happens.
    pub fn handle(&mut self, event: Event) {
        self.driver.handle(event);
        self.handle_outcomes();
    }

    fn handle_outcomes(&mut self) {
        while let Some(outcome) = self.driver.next_outcome() {
            match outcome {
                Outcome::Frame(frame) => {
                    if let Some(display) = &self.display {
                        display.show((*frame).clone(), None);
                    }
                    self.shown.push_back(*frame);
                }
                Outcome::Edited { world, changes } => self.count_edit(world, changes),
                // Recordings and measurements only hold changes that the scene can take.
                Outcome::Ended(_) | Outcome::Step(_) | Outcome::Trouble(_) | Outcome::Cluster(_) => {}
            }
        }
    }

    fn count_edit(&mut self, world: WorldState, changes: Vec<Change>) {
        let from = WorldState { revision: world.revision.saturating_sub(1), ..world };
        let message = encode(&ToWorker::Changes { from, revision: world.revision, changes });
        self.edit_bytes[0] += message.map_or(0, |bytes| bytes.len() as u64);
        self.edit_bytes[1] += 1;
    }

    /// How long people would have waited since this was asked last.
    pub fn take_latency(&mut self) -> Latency {
        std::mem::take(&mut self.latency.lock().unwrap_or_else(PoisonError::into_inner))
    }

    /// What all answers cost since this was asked last, and their packed size, bytes.
    pub fn take_cost(&mut self) -> (Cost, u64) {
        self.driver.take_cost()
    }

    /// The next picture; waits for events of workers so long at most.
    pub fn recv(&mut self, patience: Duration) -> Option<Frame> {
        if let Some(frame) = self.shown.pop_front() {
            return Some(frame);
        }
        self.driver.recv(patience);
        self.handle_outcomes();
        if self.looked.take_if(|at| at.elapsed() >= BETWEEN_LOOKS).is_some() {
            self.driver.look_at_workers(&self.driver.cluster.status());
            self.looked = Some(Instant::now());
        }
        let shown = self.shown.pop_front();
        self.cluster().pulse().drawn(u32::from(shown.is_some()), Instant::now());
        shown
    }

    /// Waits for a picture that is as wanted.
    ///
    /// # Errors
    /// None comes.
    pub fn wait_for(&mut self, wanted: impl Fn(&Frame) -> bool) -> anyhow::Result<Frame> {
        let until = Instant::now() + PATIENCE;
        while Instant::now() < until {
            if let Some(frame) = self.recv(Duration::from_millis(50))
                && wanted(&frame)
            {
                return Ok(frame);
            }
        }
        Err(anyhow!("no picture for {} minutes", PATIENCE.as_secs() / 60))
    }

    /// Waits until the still picture has all its frames, and gives it.
    ///
    /// # Errors
    /// It never has.
    pub fn wait_for_rest(&mut self) -> anyhow::Result<Frame> {
        let until = Instant::now() + PATIENCE;
        while Instant::now() < until {
            self.recv(Duration::from_millis(50));
            if self.live().is_at_rest() {
                let now = self.driver.now();
                return self.driver.live.picture(now).context("nothing was drawn");
            }
        }
        Err(anyhow!("no picture for {} minutes", PATIENCE.as_secs() / 60))
    }
}
