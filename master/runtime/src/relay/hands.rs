//! What a relay does: the manners of a worker ([`Serve`]) towards the master, with a cluster where a worker has threads.
//!
//! It never queues without bound: the master asks no more than the threads behind the relay can hold, and what the relay has
//! begun is what its workers hold. An answer goes up as it came, once it was unpacked and looked at: its bytes are those that
//! the worker would have sent to the master.

use std::collections::BTreeSet;
use std::sync::Arc;

use protocol::message::{Behind, REASON_MAX, RELAYED_MAX, ToMaster, cut};
use protocol::question::{Asked, Ticket, WorldState};
use protocol::schedule::{QuestionId, WorkerState};
use protocol::serve::{Action, Event, Serve};
use scenes::Change;
use worker::blob_store::BlobStore;
use worker::engine::{Input, Output, Store, Work};

use crate::cluster::{self, Cluster, Status, Told};

/// What takes what is said to the master.
pub(super) type Out = Box<dyn FnMut(Output) + Send>;

/// What is heard from above.
pub(super) enum Word {
    /// A master has let us in.
    Begun(Out),
    /// By the connection to it.
    Said(Input),
}

/// See the module's documentation.
pub(super) struct Relay {
    serve: Serve,
    cluster: Cluster,
    store: Arc<BlobStore>,
    /// The way to the master, if there is one.
    out: Option<Out>,
    /// Who the master was told is behind us.
    told: Option<Behind>,
    /// Places that there are with them.
    places: usize,
    /// An answer that has just come, until [`Serve`] has said whether anybody wants it.
    fresh: Option<Work>,
    /// A master has to be told, and was not there, that some of what it was given is wrong.
    owed: Option<String>,
}

impl Relay {
    pub(super) fn new(cluster: Cluster, store: Arc<BlobStore>) -> Self {
        let (serve, out, told, fresh, owed) = (Serve::new(1), None, None, None, None);
        Self { serve, cluster, store, out, told, places: 0, fresh, owed }
    }

    pub(super) fn cluster(&mut self) -> &mut Cluster {
        &mut self.cluster
    }

    /// Something comes from above.
    pub(super) fn hear(&mut self, word: Word) {
        match word {
            Word::Begun(out) => {
                self.forget();
                self.out = Some(out);
                if let Some(reason) = self.owed.take() {
                    return self.retract(&reason);
                }
                let status = self.cluster.status();
                self.look(&status);
            }
            Word::Said(Input::Received(message)) => self.handle(Event::Received(message)),
            Word::Said(Input::Arrived(part)) => {
                let hash = part.hash;
                match self.store.put(part) {
                    Ok(()) => self.handle(Event::Stored(hash)),
                    Err(reason) => self.say(Output::Stop(reason)),
                }
            }
            Word::Said(Input::Drain(reason)) => self.handle(Event::Drain(reason)),
            Word::Said(Input::Abandon) => self.forget(),
        }
    }

    /// Something comes from below.
    pub(super) fn happened(&mut self, event: cluster::Event) {
        match event {
            cluster::Event::Answered { asked, cost, as_it_came, .. } => {
                self.fresh = Some(Work { bytes: as_it_came, cost });
                self.handle(Event::Finished(number_of(asked.ticket)));
                self.fresh = None;
            }
            // Our workers cannot, and whoever else can shows that we were wrong about it.
            cluster::Event::Unanswered { asked, reason } => {
                self.handle(Event::ThreadRefused { id: number_of(asked.ticket), reason });
            }
            cluster::Event::WorkerExposed { name, reason, gave: true, .. } => {
                let reason = cut(&format!("{name}, which is behind it: {reason}"), REASON_MAX);
                if self.out.is_some() {
                    self.retract(&reason);
                } else {
                    self.owed = Some(reason);
                }
            }
            _ => {}
        }
    }

    /// How our workers are; the master is told if that is news.
    pub(super) fn look(&mut self, status: &Status) {
        let is_able = |state| matches!(state, WorkerState::Ready | WorkerState::Slow);
        let able = || status.list.iter().filter(|info| is_able(info.state));
        let threads: usize = able().map(|info| info.threads).sum();
        let deepest = status.list.iter().filter_map(|info| info.behind).map(|behind| behind.depth).max();
        let behind = Behind {
            workers: able().map(|info| info.behind.map_or(1, |behind| behind.workers)).sum(),
            threads: threads.min(usize::from(RELAYED_MAX)) as u16,
            depth: deepest.unwrap_or(0).saturating_add(1),
        };
        let places = able().map(|info| info.places).sum();
        if self.out.is_none() || (self.told == Some(behind) && self.places == places) {
            return;
        }
        self.places = places;
        // First, so that what is dropped for want of threads is asked of others at once.
        if self.told.replace(behind) != Some(behind) {
            self.say(Output::Send(ToMaster::Relaying(behind)));
        }
        self.handle(Event::Resized(places));
    }

    /// The master is gone, and what it wanted is wanted no more. Workers stay, and keep the scene.
    fn forget(&mut self) {
        (self.out, self.told, self.fresh) = (None, None, None);
        self.serve = Serve::new(1);
        self.cluster.cancel_all();
    }

    /// Some of what we have given is wrong. To the master we are somebody else from then on: what of it is under way counts no
    /// more.
    fn retract(&mut self, reason: &str) {
        self.say(Output::Send(ToMaster::Retracted { reason: reason.to_owned() }));
        self.say(Output::Stop(reason.to_owned()));
        self.forget();
    }

    fn say(&mut self, output: Output) {
        if let Some(out) = &mut self.out {
            out(output);
        }
    }

    fn handle(&mut self, event: Event) {
        for action in self.serve.handle(event) {
            self.carry_out(action);
        }
    }

    fn carry_out(&mut self, action: Action) {
        match action {
            Action::Send(message) => self.say(Output::Send(message)),
            Action::Stop(reason) => self.say(Output::Stop(reason)),
            Action::Answer(id) => {
                if let Some(work) = self.fresh.take() {
                    self.say(Output::Answer(id, work));
                }
            }
            Action::Start(id, question) => self.cluster.ask(vec![Asked { ticket: ticket_of(id), question }]),
            Action::Recall(ids) => {
                self.cluster.cancel(ids.iter().map(|id| ticket_of(*id)).collect::<BTreeSet<_>>());
                ids.into_iter().for_each(|id| self.handle(Event::ThreadFailed { id, reason: "recalled".into() }));
            }
            Action::Look(world) => {
                let (missing, of) = self.store.look(&world);
                self.handle(Event::Looked { world, missing, of });
            }
            Action::Build { state, changes } => {
                let outcome = self.build(state, changes);
                self.built(state, outcome);
            }
            Action::Edit { to, changes, .. } => {
                let outcome = match self.cluster.change_behind(changes, Some(to.revision)) {
                    Ok(state) if state == to => Ok(()),
                    Ok(_) => Err("edits lead to another world than the master's".to_owned()),
                    Err(refused) => Err(refused.to_string()),
                };
                self.built(to, outcome);
            }
        }
    }

    /// Hands a world on to our workers.
    fn build(&mut self, state: WorldState, changes: Vec<Change>) -> Result<(), String> {
        let (manifest, parts) = self.store.whole(&state.world)?;
        let scene = self.store.scene(&state.world)?;
        self.cluster.adopt(state, Told { scene, parts, manifest, changes }).map_err(|refused| refused.to_string())
    }

    fn built(&mut self, state: WorldState, outcome: Result<(), String>) {
        self.handle(match outcome {
            Ok(()) => Event::Built(state),
            Err(reason) => Event::BuildFailed { state, reason },
        });
    }
}

/// The master's number of a question, as a ticket of ours.
fn ticket_of(id: QuestionId) -> Ticket {
    Ticket { batch: (id.0 >> 32) as u32, slot: id.0 as u32 }
}

/// Inverse of [`ticket_of`].
fn number_of(ticket: Ticket) -> QuestionId {
    QuestionId(u64::from(ticket.batch) << 32 | u64::from(ticket.slot))
}
