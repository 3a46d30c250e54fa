//! Carries out what the loop decides, on a cluster: the same for people, replays and measurements.

use std::collections::VecDeque;
use std::time::{Duration, Instant};

use frame::live::{Action, Ended, Event, Frame, Knobs, Live, Moment, Step};
use frame::{Answered, FrontEnd};
use protocol::answer::Cost;
use protocol::question::WorldState;
use scenes::change::Refused;
use scenes::{Camera, Change};

use crate::cluster::{self, Cluster};

/// The loop and its workers.
pub(crate) struct Driver {
    pub(crate) cluster: Cluster,
    pub(crate) live: Live,
    begun: Instant,
    /// Time stands still: no deadline ever passes, so that what is shown is a function of inputs and answers alone.
    is_frozen: bool,
    outcomes: VecDeque<Outcome>,
    /// What all answers cost since this was asked last, and their packed size.
    cost: Cost,
    answer_bytes: u64,
}

/// What came from workers to a picture of its own.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Came {
    Nothing,
    /// An answer, or word that none will come.
    Answer,
    /// News of workers.
    Other,
    /// A worker has computed wrongly, and may have drawn some of it.
    Distrust,
}

/// What came of an event, in order.
#[derive(Debug)]
pub(crate) enum Outcome {
    /// A moving picture has ended; its frame, if there is one, comes next.
    Ended(Ended),
    /// Something was done with moving pictures that are under way.
    Step(Step),
    /// A picture.
    Frame(Box<Frame>),
    /// The world has been edited.
    Edited {
        /// To this state.
        world: WorldState,
        /// By these changes.
        changes: Vec<Change>,
    },
    /// An edit was refused, or a question given up: the reason, for people.
    Trouble(String),
    /// Something about workers.
    Cluster(Box<cluster::Event>),
}

impl Driver {
    /// Nothing is drawn before [`Self::begin`].
    pub(crate) fn new(cluster: Cluster, camera: Camera, knobs: Knobs, is_frozen: bool) -> Self {
        let (live, begun) = (Live::new(camera, knobs), Instant::now());
        let (outcomes, cost) = (VecDeque::new(), Cost::default());
        Self { cluster, live, begun, is_frozen, outcomes, cost, answer_bytes: 0 }
    }

    /// When it began.
    pub(crate) fn begun(&self) -> Instant {
        self.begun
    }

    /// The scene has been published.
    pub(crate) fn begin(&mut self) {
        let (Some(world), Some(fields), Some(scene)) =
            (self.cluster.state(), self.cluster.fields(), self.cluster.shared_scene())
        else {
            return;
        };
        self.handle(Event::Published { world, scene, fields });
    }

    /// The time by the loop's clock.
    pub(crate) fn now(&self) -> Moment {
        Moment(if self.is_frozen { 0 } else { self.begun.elapsed().as_micros() as u64 })
    }

    /// Handles an event; what comes of it waits in [`Self::next_outcome`].
    pub(crate) fn handle(&mut self, event: Event) {
        let now = self.now();
        for action in self.live.handle(event, now) {
            match action {
                Action::Publish { changes, behind } => self.publish(changes, behind),
                Action::Forget => self.cluster.cancel_all(),
                Action::Cancel(tickets) => self.cluster.cancel(tickets),
                Action::Note(step) => self.outcomes.push_back(Outcome::Step(step)),
                Action::Ask(questions) => self.cluster.ask(questions),
                Action::Show => {
                    // Also of those that no picture shows: what is drawn next follows from them.
                    self.outcomes.extend(self.live.ended().map(Outcome::Ended));
                    let now = self.now();
                    let frame = self.live.picture(now);
                    self.outcomes.extend(frame.map(|frame| Outcome::Frame(Box::new(frame))));
                }
            }
        }
    }

    /// Edits the world as far as it can be, and goes on in any case: the loop waits for it.
    fn publish(&mut self, changes: Vec<Change>, behind: bool) {
        let (mut changes, mut edited) = (changes.clone(), self.change(changes, behind));
        if let Err(refused) = &edited {
            self.outcomes.push_back(Outcome::Trouble(refused.to_string()));
            let mut scene = self.cluster.scene().cloned().unwrap_or_default();
            changes.retain(|change| change.apply(&mut scene).is_ok());
            edited = self.change(changes.clone(), behind);
        }
        self.outcomes.extend(edited.ok().map(|world| Outcome::Edited { world, changes }));
        self.begin();
    }

    /// `behind`: what was asked is still to be answered.
    fn change(&mut self, changes: Vec<Change>, behind: bool) -> Result<WorldState, Refused> {
        if behind { self.cluster.change_behind(changes, None) } else { self.cluster.change(changes) }
    }

    /// Handles the next event of workers; waits for it so long at most, less if the loop wants to be woken. Returns whether
    /// one has come.
    pub(crate) fn recv(&mut self, patience: Duration) -> bool {
        let wake = self.live.wake_at().filter(|_| !self.is_frozen);
        let until = wake.map(|at| Duration::from_micros(at.0.saturating_sub(self.now().0)));
        let event = self.cluster.next(until.map_or(patience, |until| until.min(patience)));
        let has_come = event.is_some();
        match event {
            Some(cluster::Event::Answered { asked, body, cost, worker, bytes, .. }) => {
                self.cost += cost;
                self.answer_bytes += bytes;
                self.handle(Event::Answered { ticket: asked.ticket, body, worker, cost });
            }
            Some(cluster::Event::Unanswered { asked, reason }) => {
                // What the scene was before is soon overtaken.
                if self.cluster.state() == Some(asked.question.world) {
                    self.outcomes.push_back(Outcome::Trouble(reason));
                }
                self.handle(Event::Unanswered(asked.ticket));
            }
            Some(event) => {
                let is_tainted = matches!(event, cluster::Event::WorkerExposed { gave: true, .. });
                self.outcomes.push_back(Outcome::Cluster(Box::new(event)));
                if is_tainted {
                    self.handle(Event::Distrusted);
                }
            }
            None => self.handle(Event::Woke),
        }
        has_come
    }

    /// The same for a picture that the loop knows nothing of, while it rests ([`Event::Held`]).
    pub(crate) fn recv_apart(&mut self, front: &mut dyn FrontEnd, patience: Duration) -> Came {
        match self.cluster.next(patience) {
            Some(cluster::Event::Answered { asked, body, cost, worker, bytes, .. }) => {
                self.cost += cost;
                self.answer_bytes += bytes;
                front.absorb(Answered { ticket: asked.ticket, body, worker, cost: &cost });
                Came::Answer
            }
            Some(cluster::Event::Unanswered { asked, reason }) => {
                self.outcomes.push_back(Outcome::Trouble(reason));
                front.give_up(asked.ticket);
                Came::Answer
            }
            Some(event) => {
                let is_tainted = matches!(event, cluster::Event::WorkerExposed { gave: true, .. });
                self.outcomes.push_back(Outcome::Cluster(Box::new(event)));
                if is_tainted { Came::Distrust } else { Came::Other }
            }
            None => Came::Nothing,
        }
    }

    /// What has come of events, one after the other.
    pub(crate) fn next_outcome(&mut self) -> Option<Outcome> {
        self.outcomes.pop_front()
    }

    /// Tells the loop how far the workers are, and how many questions they answer at a time: to be done now and then.
    pub(crate) fn look_at_workers(&mut self, status: &cluster::Status) {
        let round_trips = status.list.iter().filter(|info| info.answered > 0).map(|info| info.round_trip);
        self.live.set_round_trip(round_trips.min().unwrap_or_default().as_micros() as u64);
        self.live.set_parallelism(status.parallelism());
    }

    /// What all answers cost since this was asked last, and their packed size, bytes.
    pub(crate) fn take_cost(&mut self) -> (Cost, u64) {
        (std::mem::take(&mut self.cost), std::mem::take(&mut self.answer_bytes))
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use frame::{Chosen, Layer};
    use scenes::{Light, Scene};

    use super::*;
    use crate::cluster::ClusterOptions;
    use frame::live::Making;

    fn driver(is_frozen: bool) -> Driver {
        let options = ClusterOptions { embedded: Some(1), ..ClusterOptions::default() };
        let mut cluster = Cluster::start(options).unwrap();
        let light = Light::Point { position: glam::Vec3::ZERO, intensity: glam::Vec3::ONE };
        let camera = Camera { width: 8, height: 6, ..Camera::default() };
        let scene = Scene { lights: vec![light], camera, ..Scene::default() };
        cluster.publish(Arc::new(scene)).unwrap();
        let method = Chosen::new(crate::methods::all()[0]);
        let knobs = Knobs {
            method,
            seed: 0,
            rate: 10.0,
            effort: None,
            rest_after: 1,
            layer: Layer::FINAL,
            making: Making::InTime,
        };
        let mut driver = Driver::new(cluster, camera, knobs, is_frozen);
        driver.begin();
        driver
    }

    fn settle(driver: &mut Driver) -> Vec<Outcome> {
        let until = Instant::now() + Duration::from_secs(120);
        while !driver.live.is_at_rest() {
            assert!(Instant::now() < until, "the view is frozen");
            driver.recv(Duration::from_millis(20));
        }
        std::iter::from_fn(|| driver.next_outcome()).collect()
    }

    fn brighter(light: u32) -> Change {
        Change::Light { light, value: Light::Point { position: glam::Vec3::Y, intensity: glam::Vec3::splat(3.0) } }
    }

    /// Meshes and textures are shared in any case; the scene itself is held by the cluster and by the loop, which gives it away.
    #[test]
    fn an_edit_copies_no_scene() {
        let mut driver = driver(true);
        settle(&mut driver);
        for edit in 1..=2 {
            driver.handle(Event::Edit(vec![brighter(0)]));
            settle(&mut driver);
            let scene = driver.cluster.shared_scene().unwrap();
            assert_eq!(Arc::strong_count(&scene), 3, "after edit {edit}: cluster, loop, and this test");
        }
    }

    /// For people as for replays: what the cluster refuses is reported and left out, the rest is done, the view goes on.
    #[test]
    fn a_refused_change_freezes_no_view() {
        for is_frozen in [false, true] {
            let mut driver = driver(is_frozen);
            settle(&mut driver);
            driver.handle(Event::Edit(vec![brighter(7), brighter(0)]));
            let outcomes = settle(&mut driver);
            let is_said = |outcome: &Outcome| matches!(outcome, Outcome::Trouble(_));
            assert!(outcomes.iter().any(is_said), "{outcomes:?}");
            let edited = outcomes.iter().find_map(|outcome| match outcome {
                Outcome::Edited { world, changes } => Some((world.revision, changes.clone())),
                _ => None,
            });
            assert_eq!(edited, Some((1, vec![brighter(0)])));
            driver.handle(Event::Edit(vec![brighter(0)]));
            let outcomes = settle(&mut driver);
            assert!(
                outcomes.iter().any(|outcome| matches!(outcome, Outcome::Frame(frame) if frame.world.revision == 2))
            );
        }
    }
}
