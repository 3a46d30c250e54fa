//! All workers as one: questions in, answers out, whoever gives them.
//!
//! A [`Cluster`] is a handle that one thread holds. Behind it, the *dispatcher* ([`dispatcher`]) is a thread
//! that owns the [`protocol::schedule`] and passes everything on to workers in this process
//! ([`embedded`]) or behind the network ([`quic`]). Which worker answers changes
//! no bit of an answer; workers may come and go at any time.

mod busy;
pub mod dispatcher;
mod distance;
pub mod embedded;
mod known;
mod ledger;
pub mod pulse;
pub mod quic;
pub mod roster;
#[cfg(feature = "otel")]
mod spans;

#[cfg(test)]
pub(crate) mod tests;

use std::collections::{BTreeSet, VecDeque};
use std::net::SocketAddr;
use std::path::PathBuf;
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use protocol::answer::{Body, Cost, Fields};
use protocol::digest::Key;
use protocol::identity::Token;
use protocol::message::Behind;
use protocol::parts::PartError;
use protocol::question::{Asked, Ticket, WorldState};
use protocol::schedule::{Checking, Counters, HELD_PER_THREAD, OPEN_MAX, WorkerId, WorkerState};
use scenes::change::Refused;
use scenes::{Change, Keep, Scene};

pub use busy::Busy;
pub use dispatcher::{Link, Note, Report};
pub use known::{Known, Told};
pub use ledger::Content;
pub(crate) use ledger::Ledger;
pub use quic::threads as network_threads;

use busy::Watch;
use dispatcher::{Dispatcher, Order};
use known::World;
use pulse::Pulse;

/// Who does the work.
#[derive(Clone, Debug, Default)]
pub struct ClusterOptions {
    /// Threads of this process, if it works at all.
    pub embedded: Option<usize>,
    /// They give way to the threads that make pictures for people.
    pub give_way: bool,
    /// They work as if they were so far away, there and back: to measure what that costs.
    pub far: Duration,
    /// Where workers of other processes may join, if they may.
    pub listen: Option<SocketAddr>,
    /// What they have to know; `None`: a fresh one.
    pub token: Option<String>,
    /// A file of what they have to know, read again while we listen; it counts more than the token.
    pub token_file: Option<PathBuf>,
    /// How long a fresh token lets them in; `None`: as long as we listen.
    pub token_lifetime: Option<Duration>,
    /// What becomes of stages, and fields of answers, that a scene has no use for. Workers of other processes
    /// leave them out, and do not understand who does not: only for embedded ones.
    pub keep: Keep,
    /// Share of the answers of workers of other processes that are checked, 0..=1: asked of another as well, and compared.
    pub check_share: f64,
    /// Answers of workers of other processes are kept as they came as well, for whoever hands them on.
    pub hand_on: bool,
}

/// A cluster that cannot be.
#[derive(Debug, thiserror::Error)]
pub enum ClusterError {
    /// Neither embedded workers nor a place to join.
    #[error("nobody would work: allow embedded workers, or listen for others")]
    Nobody,
    /// The system refuses threads.
    #[error("cannot start a thread: {0}")]
    Threads(#[from] std::io::Error),
    /// The network refuses, or the token is wrong.
    #[error("{0}")]
    Network(String),
    /// The scene cannot be sent.
    #[error(transparent)]
    Scene(#[from] PartError),
}

/// What happened, and in which epoch; `None`: it is only to end a wait.
type Letter = (u64, Option<Event>);

/// Workers, and what goes on between them and us.
pub struct Cluster {
    dispatcher: Sender<Note>,
    events: Receiver<Letter>,
    wakers: Sender<Letter>,
    status: Arc<Mutex<Status>>,
    pulse: Pulse,
    thread: Option<JoinHandle<()>>,
    network: Option<quic::Network>,
    keep: Keep,
    /// By which answers are told apart, if some are checked.
    key: Option<Key>,
    world: Option<World>,
    /// How busy the thread that holds this is.
    watch: Watch,
    /// Questions asked in this epoch that [`Self::next`] has not returned.
    outstanding: usize,
    /// Grows whenever open questions end: answers of earlier epochs are not for us.
    epoch: u64,
    /// Questions there was no room for; they end without an answer.
    unasked: VecDeque<Asked>,
    #[cfg(feature = "otel")]
    spans: Option<spans::Spans>,
}

/// Ends a wait in [`Cluster::next`], from any thread.
#[derive(Clone, Debug)]
pub struct Waker(Sender<Letter>);

impl Waker {
    /// The wait that goes on now, or the next one, ends at once.
    pub fn wake(&self) {
        // Nobody waits when the cluster is gone.
        let _ = self.0.send((0, None));
    }
}

/// What can happen.
#[derive(Clone, Debug, PartialEq)]
#[expect(clippy::large_enum_variant, reason = "nearly all are answers")]
pub enum Event {
    /// A question is answered: the one and only time.
    Answered {
        /// What was asked.
        asked: Asked,
        /// What the answer says.
        body: Body,
        /// What it cost the worker.
        cost: Cost,
        /// Who answered.
        worker: u32,
        /// Bytes of the answer on its way.
        bytes: u64,
        /// The answer as it came, output of [`protocol::pack::compress`], if [`ClusterOptions::hand_on`].
        as_it_came: Vec<u8>,
    },
    /// A question is given up: several workers died of it or failed at it. The rest goes on.
    Unanswered {
        /// What was asked.
        asked: Asked,
        /// For people.
        reason: String,
    },
    /// A worker has joined; it still has to fetch and build the scene.
    WorkerJoined {
        /// A number of its own, never used again.
        worker: u32,
        /// What it calls itself.
        name: String,
        /// Questions it answers at a time.
        threads: usize,
        /// Where it is; `None`: in this process.
        address: Option<SocketAddr>,
    },
    /// A worker has built the scene.
    WorkerReady {
        /// Its number.
        worker: u32,
    },
    /// A worker has gone, whatever the reason; its questions are asked of others.
    WorkerLeft {
        /// Its number.
        worker: u32,
        /// What it called itself.
        name: String,
        /// For people.
        reason: String,
    },
    /// The last worker has gone. Others may come.
    NoWorkers,
    /// A worker has given wrong answers, and is asked no more.
    WorkerExposed {
        /// Its number.
        worker: u32,
        /// What it calls itself.
        name: String,
        /// How that is known, for people.
        reason: String,
        /// Some of its answers may be among those that were handed out: what was made of them has to be made again.
        gave: bool,
    },
    /// Workers give different answers to the same question, and there is no other to decide: what is drawn may be wrong.
    Undecided {
        /// Their numbers.
        workers: Vec<u32>,
        /// Which question.
        ask: String,
    },
    /// In answer to [`Cluster::finish_checks`]: nothing is being checked any more.
    Checked,
}

/// How things stand.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Status {
    /// Number of workers that are there.
    pub workers: usize,
    /// Number of workers that have built the scene, and of relays with some.
    pub ready: usize,
    /// Everything about each.
    pub list: Vec<WorkerInfo>,
    /// What was done so far.
    pub counters: Counters,
    /// What it cost the workers: that of all answers delivered.
    pub cost: Cost,
    /// Bytes sent to workers: scenes, questions, and what the network adds.
    pub bytes_sent: u64,
    /// Bytes received from workers: answers, and what the network adds.
    pub bytes_received: u64,
    /// Connections refused: wrong token, wrong version, other protocols.
    pub refused: u64,
    /// Answers with light too bright to be sent, see [`protocol::pack::LARGEST`].
    pub saturated: u64,
    /// How busy this process is with them.
    pub busy: Busy,
}

impl Status {
    /// Questions that can be answered at a time, those on a long way included: what lies there keeps threads busy that
    /// nobody has.
    pub fn parallelism(&self) -> usize {
        self.list.iter().map(|worker| worker.threads.max(worker.places / usize::from(HELD_PER_THREAD))).sum()
    }
}

/// How a worker is.
#[derive(Clone, Debug, PartialEq)]
pub struct WorkerInfo {
    /// Its number.
    pub worker: u32,
    /// What it calls itself.
    pub name: String,
    /// Where it is; `None`: in this process.
    pub address: Option<SocketAddr>,
    /// What it is doing.
    pub state: WorkerState,
    /// Why, if all is not well: for people.
    pub reason: Option<String>,
    /// Parts of the scene that it has, and all parts, while it fetches.
    pub progress: Option<(u32, u32)>,
    /// Questions it answers at a time.
    pub threads: usize,
    /// Who is behind it, if it computes nothing itself.
    pub behind: Option<Behind>,
    /// Questions it may hold: more where the way to it is long.
    pub places: usize,
    /// Questions it has been asked and has not answered.
    pub in_flight: usize,
    /// Questions it has answered.
    pub answered: u64,
    /// Of these, how many were asked of others as well, who answered the same.
    pub confirmed: u64,
    /// Usual thread time of an answer.
    pub thread_time: Duration,
    /// Usual time between a question and its answer.
    pub turnaround: Duration,
    /// There and back, as the transport measures it.
    pub round_trip: Duration,
    /// How long it may take over a question before another is asked.
    pub lease: Duration,
    /// Bytes of its answers.
    pub answer_bytes: u64,
}

impl Cluster {
    /// Starts the workers of this process, and listens for others.
    ///
    /// # Errors
    /// [`ClusterError`] says what to do about it.
    pub fn start(options: ClusterOptions) -> Result<Self, ClusterError> {
        let renderer = embedded::Light { keep: options.keep };
        Self::start_with(options, renderer)
    }

    /// As [`Self::start`], with another renderer for the embedded worker.
    pub fn start_with<C: embedded::Renderer>(options: ClusterOptions, renderer: C) -> Result<Self, ClusterError> {
        if options.embedded.is_none() && options.listen.is_none() {
            return Err(ClusterError::Nobody);
        }
        let (dispatcher, notes) = channel();
        let (sender, events) = channel();
        let status = Arc::new(Mutex::new(Status::default()));
        let network = match options.listen {
            Some(address) => Some(quic::Network::listen(address, &options, dispatcher.clone())?),
            None => None,
        };
        // Who computes in this process is trusted.
        let share = if network.is_some() { options.check_share } else { 0.0 };
        let checking = Checking { share, salt: quic::random()? };
        let key = if share > 0.0 { Some(Key::new(quic::random()?)) } else { None };
        let mut cluster = Self::beside(dispatcher, (sender.clone(), events), Arc::clone(&status), key);
        cluster.keep = options.keep;
        let traffic = network.as_ref().map(quic::Network::traffic);
        let work = move || dispatcher::run(Dispatcher::new(sender, status, traffic, checking), &notes);
        cluster.thread = Some(std::thread::Builder::new().name("dispatcher".into()).spawn(work)?);
        cluster.network = network;
        #[cfg(feature = "otel")]
        {
            cluster.spans = spans::Spans::from_environment();
        }
        if let Some(threads) = options.embedded {
            let how = embedded::How { threads: threads.max(1), give_way: options.give_way, far: options.far };
            embedded::start(renderer, how, WorkerId(0), &cluster.dispatcher)?;
        }
        Ok(cluster)
    }

    /// A cluster without threads, clock and workers: whoever has the dispatcher passes on what comes out of the
    /// receiver, reports what workers do, and says what time it is. For simulations.
    pub fn by_hand(checking: Checking) -> (Self, Dispatcher, Receiver<Note>) {
        let (dispatcher, notes) = channel();
        let (sender, events) = channel();
        let status = Arc::new(Mutex::new(Status::default()));
        let key = (checking.share > 0.0).then(|| Key::new(checking.salt));
        let cluster = Self::beside(dispatcher, (sender.clone(), events), Arc::clone(&status), key);
        (cluster, Dispatcher::new(sender, status, None, checking), notes)
    }

    /// A handle to a dispatcher, which says what happens through the channel, and writes how things stand into `status`.
    fn beside(
        dispatcher: Sender<Note>,
        (wakers, events): (Sender<Letter>, Receiver<Letter>),
        status: Arc<Mutex<Status>>,
        key: Option<Key>,
    ) -> Self {
        Self {
            dispatcher,
            events,
            wakers,
            status,
            pulse: Pulse::default(),
            thread: None,
            network: None,
            keep: Keep::Needed,
            key,
            world: None,
            watch: Watch::new(Instant::now()),
            outstanding: 0,
            epoch: 0,
            unasked: VecDeque::new(),
            #[cfg(feature = "otel")]
            spans: None,
        }
    }

    /// Where workers of other machines find it, if it listens.
    pub fn reachable(&self) -> Option<SocketAddr> {
        self.network.as_ref().map(quic::Network::reachable)
    }

    /// What a worker has to know to be let in, if the cluster listens.
    pub fn token(&self) -> Option<Token> {
        self.network.as_ref().map(quic::Network::token)
    }

    /// The same, with others that are valid as well for a while, whenever it is called.
    pub fn tokens(&self) -> Option<impl Fn() -> Vec<Token> + Send + use<>> {
        self.network.as_ref().map(quic::Network::tokens)
    }

    /// Where it listens.
    pub fn address(&self) -> Option<SocketAddr> {
        self.network.as_ref().map(quic::Network::address)
    }

    /// From now on, questions are about this scene; those that are open end here, without an answer.
    ///
    /// # Errors
    /// [`ClusterError::Scene`] if a part of it is too big for the wire.
    pub fn publish(&mut self, scene: Arc<Scene>) -> Result<WorldState, ClusterError> {
        self.world = Some(World::new(scene, self.has_others(), self.keep, self.key)?);
        Ok(self.turn_to(false))
    }

    /// As [`Self::publish`], of a world in a state that another master says: its scene at revision 0, every part of that with its
    /// manifest, and what leads from there to the state. Nothing happens if that is what questions are about already.
    ///
    /// # Errors
    /// [`Refused`] if the scene cannot take one of the changes.
    pub fn adopt(&mut self, state: WorldState, told: Told) -> Result<(), Refused> {
        if self.world.as_ref().is_some_and(|world| world.known.state == state && world.known.changes == told.changes) {
            return Ok(());
        }
        self.world = Some(World::told(state, told, self.keep, self.key)?);
        self.turn_to(false);
        Ok(())
    }

    /// Edits the scene: the next revision of the world. Questions that are open end here, without an answer.
    ///
    /// # Errors
    /// [`Refused`] if the scene cannot take one of the changes; then none is made.
    pub fn change(&mut self, changes: Vec<Change>) -> Result<WorldState, Refused> {
        let is_edit = self.edit(changes, None)?;
        Ok(self.turn_to(is_edit))
    }

    /// As [`Self::change`], but questions that are open are still answered as far as workers can; `revision`: it is to be that
    /// one, and later than the current one.
    ///
    /// # Errors
    /// As of [`Self::change`].
    pub fn change_behind(&mut self, changes: Vec<Change>, revision: Option<u32>) -> Result<WorldState, Refused> {
        if !self.edit(changes, revision)? {
            // Everything is another scene now.
            return Ok(self.turn_to(false));
        }
        let Some(world) = &self.world else { return Ok(WorldState::default()) };
        let known = Arc::clone(&world.known);
        let state = known.state;
        self.order(Order::Edited(known));
        Ok(state)
    }

    fn edit(&mut self, changes: Vec<Change>, revision: Option<u32>) -> Result<bool, Refused> {
        let Some(world) = &mut self.world else { return Err(Refused("there is no scene yet".into())) };
        world.edit(changes, revision)
    }

    /// The scene at the current revision; `None` before [`Self::publish`].
    pub fn scene(&self) -> Option<&Scene> {
        self.world.as_ref().map(World::scene)
    }

    /// The same, shared: it stays as it is however the cluster's is edited.
    pub fn shared_scene(&self) -> Option<Arc<Scene>> {
        self.world.as_ref().map(World::shared_scene)
    }

    /// Hashes of the published scene's meshes and textures; `None` before [`Self::publish`].
    pub fn manifest(&self) -> Option<&protocol::parts::Manifest> {
        self.world.as_ref().map(World::manifest)
    }

    /// What questions are about now; `None` before [`Self::publish`].
    pub fn state(&self) -> Option<WorldState> {
        self.world.as_ref().map(|world| world.known.state)
    }

    /// What answers can contain; `None` before [`Self::publish`].
    pub fn fields(&self) -> Option<Fields> {
        self.world.as_ref().map(|world| world.known.fields)
    }

    /// Lets other threads end a wait for the next event.
    pub fn waker(&self) -> Waker {
        Waker(self.wakers.clone())
    }

    /// Asks. Each question comes back from [`Self::next`] once, [`Event::Answered`] or
    /// [`Event::Unanswered`], unless the world changes or all are cancelled. Beyond
    /// [`Self::room`], questions come back unanswered.
    pub fn ask(&mut self, mut questions: Vec<Asked>) {
        let refused = questions.split_off(self.room().min(questions.len()));
        self.outstanding += questions.len() + refused.len();
        self.unasked.extend(refused);
        if !questions.is_empty() {
            #[cfg(feature = "otel")]
            self.spans.iter_mut().for_each(|spans| spans.asked(&questions));
            self.order(Order::Ask(questions));
        }
    }

    /// How many questions may be asked now.
    pub fn room(&self) -> usize {
        OPEN_MAX.saturating_sub(self.outstanding)
    }

    /// What happens next; `None` if nothing happens in time, or somebody used a [`Waker`].
    pub fn next(&mut self, timeout: Duration) -> Option<Event> {
        if let Some(asked) = self.unasked.pop_front() {
            self.outstanding = self.outstanding.saturating_sub(1);
            return Some(Event::Unanswered { asked, reason: "too many questions are open".into() });
        }
        let deadline = Instant::now() + timeout;
        loop {
            let now = Instant::now();
            let received = self.events.recv_timeout(deadline.saturating_duration_since(now));
            if let Some(share) = self.watch.waited(now, Instant::now()) {
                self.status.lock().unwrap_or_else(PoisonError::into_inner).busy.drawing = share;
            }
            let (epoch, event) = match received {
                Ok((epoch, Some(event))) => (epoch, event),
                Ok((_, None)) => return None,
                Err(RecvTimeoutError::Timeout | RecvTimeoutError::Disconnected) => return None,
            };
            let ends = matches!(event, Event::Answered { .. } | Event::Unanswered { .. });
            if ends && epoch != self.epoch {
                continue;
            }
            self.outstanding -= usize::from(ends).min(self.outstanding);
            #[cfg(feature = "otel")]
            self.spans.iter_mut().for_each(|spans| spans.received(&event));
            return Some(event);
        }
    }

    /// Asks only these workers from now on, whoever else is there; `None`: all.
    pub fn call(&mut self, workers: Option<&[u32]>) {
        let called = workers.map(|workers| workers.iter().map(|worker| WorkerId(u64::from(*worker))).collect());
        self.order(Order::Call(called));
    }

    /// Ends these questions without an answer; one that is on its way out of [`Self::next`] may come all the same.
    pub fn cancel(&mut self, tickets: BTreeSet<Ticket>) {
        self.outstanding = self.outstanding.saturating_sub(tickets.len());
        self.order(Order::Cancel(tickets));
    }

    /// Ends all open questions without an answer.
    pub fn cancel_all(&mut self) {
        self.begin_epoch();
        self.order(Order::CancelAll(self.epoch));
    }

    /// Some answers are checked.
    pub fn has_checks(&self) -> bool {
        self.key.is_some()
    }

    /// [`Event::Checked`] is to come as soon as nothing is being checked any more that could be decided now.
    pub fn finish_checks(&self) {
        self.order(Order::FinishChecks);
    }

    /// How things stand, at most some hundredths of a second ago.
    pub fn status(&self) -> Status {
        self.status.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// As [`Self::status`], for other threads.
    pub fn board(&self) -> impl Fn() -> Status + Send + Sync + use<> {
        let status = Arc::clone(&self.status);
        move || status.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// The heart beat of the loop that draws.
    pub fn pulse(&self) -> &Pulse {
        &self.pulse
    }

    /// Workers that know nothing may come: they will ask for scene parts.
    fn has_others(&self) -> bool {
        self.network.is_some() || self.thread.is_none()
    }

    fn turn_to(&mut self, is_edit: bool) -> WorldState {
        self.begin_epoch();
        let Some(world) = &self.world else { return WorldState::default() };
        let known = Arc::clone(&world.known);
        let state = known.state;
        self.order(Order::World { known, is_edit, epoch: self.epoch });
        state
    }

    fn begin_epoch(&mut self) {
        self.epoch += 1;
        self.outstanding = 0;
        self.unasked.clear();
        #[cfg(feature = "otel")]
        self.spans.iter_mut().for_each(spans::Spans::close_all);
    }

    fn order(&self, order: Order) {
        // The dispatcher lives as long as we do.
        let _ = self.dispatcher.send(Note::Order(order));
    }
}

impl Drop for Cluster {
    /// Says good-bye to all workers.
    fn drop(&mut self) {
        self.order(Order::Close);
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}
