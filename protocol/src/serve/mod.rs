//! The worker's manners: what it fetches, builds, answers and drops.
//!
//! **Promise.** Every question heard is answered, refused in words, or was cancelled; nothing is
//! answered about another world or revision than the question names. Its queue is bounded. An edit is made when what was asked
//! before it is answered, as far as it was not cancelled.
//!
//! It knows neither sockets nor scenes: events come in, actions go out. Who carries out the
//! actions says when they are done ([`Event::Looked`], [`Event::Built`], [`Event::Finished`] …).

#[cfg(test)]
mod tests;

use std::collections::{BTreeSet, VecDeque};
use std::sync::Arc;

use scenes::Change;

use crate::message::{REASON_MAX, ToMaster, ToWorker, WANT_MAX, cut};
use crate::parts::Hash;
use crate::question::{Question, WorldState};
use crate::schedule::QuestionId;

/// What can happen.
#[derive(Clone, Debug, PartialEq)]
pub enum Event {
    /// The master says something.
    Received(ToWorker),
    /// The store was searched, see [`Action::Look`].
    Looked {
        /// For which world.
        world: Hash,
        /// Parts that are not there; the manifest, if it is that.
        missing: Vec<Hash>,
        /// Parts the world has; 0 if the manifest is missing.
        of: u32,
    },
    /// A part has arrived, with the right hash, and is in the store.
    Stored(Hash),
    /// A world or revision is built.
    Built(WorldState),
    /// A world or revision cannot be built.
    BuildFailed {
        /// Which.
        state: WorldState,
        /// For people.
        reason: String,
    },
    /// A thread has finished, with an answer.
    Finished(QuestionId),
    /// A thread has finished, without.
    ThreadFailed {
        /// With what.
        id: QuestionId,
        /// For people.
        reason: String,
    },
    /// A thread has looked at a question, and the world does not have what it asks about.
    ThreadRefused {
        /// Which.
        id: QuestionId,
        /// For people.
        reason: String,
    },
    /// So many threads compute from now on, of whoever computes for a worker that does not do it itself. Without any, it drops
    /// its questions in silence: the master has been told of its threads, and asks others.
    Resized(usize),
    /// Somebody wants the worker to stop, for this reason: finish what is begun, and go.
    Drain(String),
}

/// What is to be done about it.
#[derive(Clone, Debug, PartialEq)]
pub enum Action {
    /// Say something to the master.
    Send(ToMaster),
    /// Find out which parts of a world are not in the store.
    Look(Hash),
    /// Build a world from its parts, and apply the changes.
    Build {
        /// What it will be then.
        state: WorldState,
        /// From revision 0 on.
        changes: Vec<Change>,
    },
    /// Apply changes to the world that was built last.
    Edit {
        /// What it is.
        from: WorldState,
        /// What it will be then.
        to: WorldState,
        /// What leads there.
        changes: Vec<Change>,
    },
    /// Let the next idle thread answer a question about the world that was built last.
    Start(QuestionId, Arc<Question>),
    /// Nobody waits for these any more: who has not begun with one may drop it, and report
    /// [`Event::ThreadFailed`] at once.
    Recall(Vec<QuestionId>),
    /// Send the answer that a thread has just finished.
    Answer(QuestionId),
    /// End the connection; nothing follows.
    Stop(String),
}

/// Questions that lie ready beside the threads, begun by whichever is first done: else a thread would wait until
/// its answer was put away. One is enough (640×480 on two threads: 9.5 frames/s before, 9.8 after).
const READY: usize = 1;

/// Most questions that may wait for a thread.
pub const QUEUE_MAX: usize = 4096;

/// The worker's half of the conversation with its master.
#[derive(Debug)]
pub struct Serve {
    threads: usize,
    target: Option<Target>,
    queue: VecDeque<(QuestionId, Arc<Question>)>,
    /// Questions given to threads; false if nobody waits for the answer any more.
    started: Vec<(QuestionId, bool)>,
    /// Why it goes, if it does.
    leaving: Option<String>,
    stopped: bool,
}

/// The world that questions will be about.
#[derive(Debug)]
struct Target {
    state: WorldState,
    /// What must still be done to what is built, or being built, and the revision that each leads to.
    pending: VecDeque<(u32, Vec<Change>)>,
    phase: Phase,
    /// The master has been told that the world is built.
    announced: bool,
    /// Parts of it.
    of: u32,
}

#[derive(Debug)]
enum Phase {
    Looking,
    Fetching(BTreeSet<Hash>),
    Building(WorldState),
    Built(WorldState),
    Broken,
}

impl Serve {
    /// A worker that answers so many questions at a time; at least one.
    pub fn new(threads: usize) -> Self {
        Self {
            threads: threads.max(1),
            target: None,
            queue: VecDeque::new(),
            started: Vec::new(),
            leaving: None,
            stopped: false,
        }
    }

    /// Takes an event in, gives actions out; they are to be carried out in order.
    pub fn handle(&mut self, event: Event) -> Vec<Action> {
        let mut actions = Vec::new();
        if self.stopped {
            return actions;
        }
        match event {
            Event::Received(ToWorker::World { state, changes }) => self.turn_to(state, changes, &mut actions),
            Event::Received(ToWorker::Changes { from, revision, changes }) => {
                self.edit(from, revision, changes, &mut actions);
            }
            Event::Received(ToWorker::Ask { id, question }) => self.ask(id, question, &mut actions),
            Event::Received(ToWorker::Cancel { ids }) => self.cancel(&ids, &mut actions),
            Event::Received(ToWorker::Goodbye { reason }) => {
                self.stopped = true;
                actions.push(Action::Stop(reason));
                return actions;
            }
            Event::Looked { world, missing, of } => self.looked(world, missing, of, &mut actions),
            Event::Stored(hash) => self.stored(&hash, &mut actions),
            Event::Built(state) => self.built(state, &mut actions),
            Event::BuildFailed { state, reason } => self.build_failed(state, &reason, &mut actions),
            Event::Finished(id) => {
                if self.put_down(id) {
                    actions.push(Action::Answer(id));
                }
            }
            Event::ThreadFailed { id, reason } => {
                if self.put_down(id) {
                    actions.push(failed(id, &reason));
                }
            }
            Event::ThreadRefused { id, reason } => {
                if self.put_down(id) {
                    let reason = cut(&reason, REASON_MAX);
                    actions.push(Action::Send(ToMaster::Refused { id, reason }));
                }
            }
            Event::Resized(threads) => {
                self.threads = threads;
                if threads == 0 {
                    self.drop_questions(&mut actions);
                }
            }
            Event::Drain(reason) => self.drain(reason, &mut actions),
        }
        self.start(&mut actions);
        if let Some(reason) = self.leaving.take_if(|_| self.started.is_empty()) {
            self.stopped = true;
            actions.push(Action::Send(ToMaster::Goodbye { reason: reason.clone() }));
            actions.push(Action::Stop(reason));
        }
        actions
    }

    /// Questions that wait or are worked on.
    pub fn len(&self) -> usize {
        self.queue.len() + self.started.len()
    }

    /// Nothing to do.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    fn turn_to(&mut self, state: WorldState, changes: Vec<Change>, actions: &mut Vec<Action>) {
        self.drop_questions(actions);
        let pending = VecDeque::from([(state.revision, changes)]);
        self.target = Some(Target { state, pending, phase: Phase::Looking, announced: false, of: 0 });
        actions.push(Action::Look(state.world));
    }

    fn edit(&mut self, from: WorldState, revision: u32, changes: Vec<Change>, actions: &mut Vec<Action>) {
        // Changes to a world we do not have: questions about it will be answered by `Missing`.
        let Some(target) = self.target.as_mut().filter(|target| target.state == from) else { return };
        target.state.revision = revision;
        target.pending.push_back((revision, changes));
        self.edit_if_answered(actions);
    }

    /// Edits what is built as far as no question is left about what it was.
    fn edit_if_answered(&mut self, actions: &mut Vec<Action>) {
        let Some(target) = &mut self.target else { return };
        let Phase::Built(built) = target.phase else { return };
        let asked = self.queue.front().map_or(target.state.revision, |(_, question)| question.world.revision);
        let (mut to, mut changes) = (built, Vec::new());
        while let Some((revision, more)) = target.pending.pop_front_if(|(revision, _)| *revision <= asked) {
            to.revision = revision;
            changes.extend(more);
        }
        if to != built {
            target.phase = Phase::Building(to);
            actions.push(Action::Edit { from: built, to, changes });
        }
    }

    fn ask(&mut self, id: QuestionId, question: Arc<Question>, actions: &mut Vec<Action>) {
        let known = self.queue.iter().map(|(id, _)| id).chain(self.started.iter().map(|(id, _)| id)).any(|k| *k == id);
        if known || self.leaving.is_some() || self.threads == 0 {
            return;
        }
        let target = self.target.as_ref().filter(|target| target.state == question.world);
        match target.map(|target| &target.phase) {
            None => actions.push(Action::Send(ToMaster::Missing { id })),
            Some(Phase::Broken) => actions.push(failed(id, "its world cannot be built")),
            Some(_) if self.queue.len() >= QUEUE_MAX => actions.push(failed(id, "too many questions wait")),
            Some(_) => self.queue.push_back((id, question)),
        }
    }

    fn cancel(&mut self, ids: &[QuestionId], actions: &mut Vec<Action>) {
        self.queue.retain(|(id, _)| !ids.contains(id));
        self.recall(|id| ids.contains(&id), actions);
    }

    fn recall(&mut self, which: impl Fn(QuestionId) -> bool, actions: &mut Vec<Action>) {
        let unwanted: Vec<_> = self.started.iter_mut().filter(|(id, wanted)| *wanted && which(*id)).collect();
        if !unwanted.is_empty() {
            actions.push(Action::Recall(unwanted.iter().map(|(id, _)| *id).collect()));
        }
        unwanted.into_iter().for_each(|(_, wanted)| *wanted = false);
    }

    fn looked(&mut self, world: Hash, missing: Vec<Hash>, of: u32, actions: &mut Vec<Action>) {
        let Some(target) = self.target.as_mut().filter(|target| target.state.world == world) else { return };
        if !matches!(target.phase, Phase::Looking) {
            return;
        }
        target.of = of;
        if missing.is_empty() {
            let changes = std::mem::take(&mut target.pending).into_iter().flat_map(|(_, changes)| changes).collect();
            target.phase = Phase::Building(target.state);
            actions.push(Action::Build { state: target.state, changes });
            return;
        }
        for hashes in missing.chunks(WANT_MAX) {
            actions.push(Action::Send(ToMaster::Want { hashes: hashes.to_vec() }));
        }
        target.phase = Phase::Fetching(missing.into_iter().collect());
        actions.extend(target.progress());
    }

    fn stored(&mut self, hash: &Hash, actions: &mut Vec<Action>) {
        let Some(target) = &mut self.target else { return };
        let Phase::Fetching(missing) = &mut target.phase else { return };
        if !missing.remove(hash) {
            return;
        }
        let left = missing.len() as u32;
        if left == 0 {
            // The manifest names more parts; and who keeps the store has the last word.
            target.phase = Phase::Looking;
            actions.push(Action::Look(target.state.world));
        } else if left.is_multiple_of(target.of.div_ceil(PROGRESS_STEPS).max(1)) {
            actions.extend(target.progress());
        }
    }

    fn built(&mut self, state: WorldState, actions: &mut Vec<Action>) {
        let Some(target) = &mut self.target else { return };
        if !matches!(target.phase, Phase::Building(building) if building == state) {
            return;
        }
        target.phase = Phase::Built(state);
        if target.state == state && !std::mem::replace(&mut target.announced, true) {
            actions.push(Action::Send(ToMaster::Ready { state }));
        }
        self.edit_if_answered(actions);
    }

    fn build_failed(&mut self, state: WorldState, reason: &str, actions: &mut Vec<Action>) {
        let Some(target) = &mut self.target else { return };
        if !matches!(target.phase, Phase::Building(building) if building == state) {
            return;
        }
        target.phase = Phase::Broken;
        let reason = cut(&format!("cannot build the scene: {reason}"), REASON_MAX);
        self.queue.clear();
        self.stopped = true;
        actions.push(Action::Send(ToMaster::Goodbye { reason: reason.clone() }));
        actions.push(Action::Stop(reason));
    }

    fn drain(&mut self, reason: String, actions: &mut Vec<Action>) {
        self.leaving = Some(cut(&reason, REASON_MAX));
        self.queue.clear();
        let started = self.started.iter().filter(|(_, wanted)| *wanted).map(|(id, _)| *id).collect();
        actions.push(Action::Send(ToMaster::Leaving { started }));
    }

    /// A thread is free again; whether anybody waits for what it did.
    fn put_down(&mut self, id: QuestionId) -> bool {
        let place = self.started.iter().position(|(known, _)| *known == id);
        place.is_some_and(|place| self.started.remove(place).1)
    }

    /// Whatever was asked was about a world or revision that is no more.
    fn drop_questions(&mut self, actions: &mut Vec<Action>) {
        self.queue.clear();
        self.recall(|_| true, actions);
    }

    fn start(&mut self, actions: &mut Vec<Action>) {
        let Some(Phase::Built(built)) = self.target.as_ref().map(|target| &target.phase) else { return };
        let built = *built;
        // No master asks about what it has told to edit already.
        let is_past =
            |question: &Question| question.world.revision < built.revision || question.world.world != built.world;
        while let Some((id, _)) = self.queue.pop_front_if(|(_, question)| is_past(question)) {
            actions.push(Action::Send(ToMaster::Missing { id }));
        }
        while !self.stopped && self.started.len() < self.threads + READY {
            let next = self.queue.pop_front_if(|(_, question)| question.world == built);
            let Some((id, question)) = next else { break };
            self.started.push((id, true));
            actions.push(Action::Start(id, question));
        }
        self.edit_if_answered(actions);
    }
}

impl Target {
    fn progress(&self) -> Option<Action> {
        let Phase::Fetching(missing) = &self.phase else { return None };
        let have = self.of.saturating_sub(missing.len() as u32);
        (self.of > 0).then_some(Action::Send(ToMaster::Progress { have, of: self.of }))
    }
}

/// Progress of a fetch is told about so often.
const PROGRESS_STEPS: u32 = 50;

fn failed(id: QuestionId, reason: &str) -> Action {
    Action::Send(ToMaster::Failed { id, reason: cut(reason, REASON_MAX) })
}
