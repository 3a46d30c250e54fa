//! The loop without people: for replays and measurements.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use anyhow::{Context, anyhow};
use frame::live::latency::Latency;
use frame::live::{Action, Event, Frame, Knobs, Live, Moment};
use frame::tone::Tone;
use scenes::{Change, Scene};
use serde_json::Value;

use crate::cluster::{self, Cluster, ClusterOptions};
use crate::display::develop::{Darkroom, Here, Manner};
use crate::display::words::Inspect;

/// A loop and its workers.
pub(crate) struct Player {
    pub(crate) cluster: Cluster,
    pub(crate) live: Live,
    begun: Instant,
    /// Time stands still: no deadline ever passes, so that what is shown is a function of what was said alone.
    frozen: bool,
    shown: VecDeque<Frame>,
    /// Where pictures become what a browser receives, unless time stands still.
    darkroom: Option<Darkroom>,
    /// From inputs to then.
    latency: Arc<Mutex<Latency>>,
    /// What the last edits were sent to each worker as, bytes, and how many there were.
    pub(crate) edit_bytes: [u64; 2],
}

/// Longest wait for a picture.
const PATIENCE: Duration = Duration::from_secs(600);

impl Player {
    /// Publishes the scene and begins; waits until the first picture is there.
    ///
    /// # Errors
    /// No worker can be started, or none draws anything.
    pub(crate) fn start(scene: Scene, knobs: Knobs, options: ClusterOptions, frozen: bool) -> anyhow::Result<Self> {
        let mut cluster = Cluster::start(options).context("workers cannot be started")?;
        let camera = scene.camera;
        let world = cluster.publish(Arc::new(scene)).context("the scene cannot be sent to workers")?;
        let fields = cluster.fields().context("the scene was not published")?;
        let (live, shown) = (Live::new(camera, knobs), VecDeque::new());
        let (begun, latency) = (Instant::now(), Arc::<Mutex<Latency>>::default());
        let waited = Arc::clone(&latency);
        let develop = || {
            let manner = Manner { inspect: Inspect::Final, tone: Tone::PLAIN };
            Darkroom::start(manner, Box::new(Here), move |print| {
                let (made, micros) = (print.message().is_ok(), begun.elapsed().as_micros() as u64);
                if let Some(since) = print.since.filter(|_| made) {
                    waited.lock().unwrap_or_else(PoisonError::into_inner).add(micros.saturating_sub(since.0));
                }
            })
        };
        let darkroom = (!frozen).then(develop).transpose().context("cannot start a thread")?;
        let mut player = Self { cluster, live, begun, frozen, shown, darkroom, latency, edit_bytes: [0; 2] };
        player.say(Event::Published { world, fields });
        Ok(player)
    }

    pub(crate) fn now(&self) -> Moment {
        Moment(if self.frozen { 0 } else { self.begun.elapsed().as_micros() as u64 })
    }

    /// Something happens.
    pub(crate) fn say(&mut self, event: Event) {
        let now = self.now();
        for action in self.live.handle(event, now) {
            match action {
                Action::Publish(changes) => self.publish(changes),
                Action::Forget => self.cluster.cancel_all(),
                Action::Ask(questions) => self.cluster.ask(questions),
                Action::Show => {
                    let now = self.now();
                    let Some(frame) = self.live.picture(now) else { continue };
                    if let Some(darkroom) = &self.darkroom {
                        darkroom.frame(frame.clone(), Value::Null);
                    }
                    self.shown.push_back(frame);
                }
            }
        }
    }

    /// How long people would have waited since this was asked last.
    pub(crate) fn take_latency(&mut self) -> Latency {
        std::mem::take(&mut self.latency.lock().unwrap_or_else(PoisonError::into_inner))
    }

    fn publish(&mut self, changes: Vec<Change>) {
        use protocol::message::{ToWorker, encode};
        // Recordings and measurements only hold changes that the scene can take; others are left out.
        if let Ok(world) = self.cluster.change(changes.clone()) {
            let from = protocol::question::WorldState { revision: world.revision.saturating_sub(1), ..world };
            let message = encode(&ToWorker::Changes { from, revision: world.revision, changes });
            self.edit_bytes[0] += message.map_or(0, |bytes| bytes.len() as u64);
            self.edit_bytes[1] += 1;
        }
        if let (Some(state), Some(fields)) = (self.cluster.state(), self.cluster.fields()) {
            self.say(Event::Published { world: state, fields });
        }
    }

    /// Listens to workers for so long at most; the next picture that came of it, if one did.
    pub(crate) fn listen(&mut self, patience: Duration) -> Option<Frame> {
        if let Some(frame) = self.shown.pop_front() {
            return Some(frame);
        }
        let wake = self.live.wake_at().filter(|_| !self.frozen);
        let patience =
            wake.map_or(patience, |at| patience.min(Duration::from_micros(at.0.saturating_sub(self.now().0))));
        match self.cluster.next(patience) {
            Some(cluster::Event::Answered { asked, body, cost, worker, .. }) => {
                self.say(Event::Answered { ticket: asked.ticket, body, worker, cost });
            }
            Some(cluster::Event::Unanswered { asked, .. }) => self.say(Event::Unanswered(asked.ticket)),
            Some(_) => {}
            None => self.say(Event::Woke),
        }
        let shown = self.shown.pop_front();
        self.cluster.pulse().drawn(u32::from(shown.is_some()), Instant::now());
        shown
    }

    /// Waits for a picture that is as wanted.
    ///
    /// # Errors
    /// None comes.
    pub(crate) fn wait_for(&mut self, wanted: impl Fn(&Frame) -> bool) -> anyhow::Result<Frame> {
        let until = Instant::now() + PATIENCE;
        while Instant::now() < until {
            if let Some(frame) = self.listen(Duration::from_millis(50))
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
    pub(crate) fn wait_for_rest(&mut self) -> anyhow::Result<Frame> {
        let until = Instant::now() + PATIENCE;
        while Instant::now() < until {
            self.listen(Duration::from_millis(50));
            if self.live.is_at_rest() {
                let now = self.now();
                return self.live.picture(now).context("nothing was drawn");
            }
        }
        Err(anyhow!("no picture for {} minutes", PATIENCE.as_secs() / 60))
    }
}
