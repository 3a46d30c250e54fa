//! Between the front end and the workers: [`Schedule`] decides, this carries out.
//!
//! A [`Dispatcher`] has no clock and no thread of its own: it is told what happens and when. [`run`] is the thread
//! that tells it; a simulation tells it by hand ([`super::Cluster::by_hand`]).

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::net::SocketAddr;
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use protocol::answer::{Body, Cost};
use protocol::message::{Behind, ToMaster, ToWorker};
use protocol::pack;
use protocol::question::{Asked, Ticket};
use protocol::schedule::{self, Action, Checking, Moment, QuestionId, Schedule, WorkerId, WorkerState};

use super::busy::{Busy, Watch};
use super::{Content, Event, Known, Letter, Status, WorkerInfo};
use crate::cluster::quic::Traffic;

/// What the dispatcher is told.
pub enum Note {
    /// By the front end.
    Order(Order),
    /// By or about a worker.
    Report(WorkerId, Report),
    /// A stranger was refused.
    Refused,
}

/// What the front end wants.
#[derive(Debug)]
pub enum Order {
    /// Questions will be about this world.
    World {
        /// Which.
        known: Arc<Known>,
        /// It is an edit of the one before.
        is_edit: bool,
        /// Answers from now on belong to it.
        epoch: u64,
    },
    /// Questions will be about the next revision; those that are open are still answered.
    Edited(Arc<Known>),
    /// Answer these.
    Ask(Vec<Asked>),
    /// Ask only these workers; `None`: all.
    Call(Option<Vec<WorkerId>>),
    /// Forget these questions.
    Cancel(BTreeSet<Ticket>),
    /// Forget all questions; a new epoch begins.
    CancelAll(u64),
    /// Say when nothing is being checked any more.
    FinishChecks,
    /// Say good-bye to all.
    Close,
}

/// What is heard of a worker.
pub enum Report {
    /// It has proved itself.
    Joined {
        /// What it calls itself.
        name: String,
        /// Questions it answers at a time.
        threads: u16,
        /// Questions it should hold for each of them.
        depth: u16,
        /// Where it is; `None`: in this process.
        address: Option<SocketAddr>,
        /// It is this program itself: what it computes counts as right.
        is_trusted: bool,
        /// The way to it.
        link: Box<dyn Link>,
    },
    /// It says something. `_room` is given back when that is dealt with.
    Received {
        /// What.
        message: ToMaster,
        /// Its place in the queue.
        _room: Option<Room>,
    },
    /// An answer. `_room` is given back when it is dealt with.
    Answered {
        /// To which question, as it says.
        id: QuestionId,
        /// What it cost, as it says.
        cost: Cost,
        /// What it says.
        content: Box<Content>,
        /// Length on its way.
        bytes: u64,
        /// As it came, compressed, if it will be handed on; else empty.
        as_it_came: Vec<u8>,
        /// There and back to the worker, as the transport measures it.
        round_trip: Duration,
        /// Its place in the queue.
        _room: Option<Room>,
    },
    /// The connection is gone; why.
    Left(String),
}

/// A place in a queue, given back when dropped.
pub type Room = tokio::sync::OwnedSemaphorePermit;

/// The way to a worker. Dropped, it ends the connection after what was said.
pub trait Link: Send {
    /// Tells it something.
    ///
    /// # Errors
    /// The worker does not listen.
    fn send(&mut self, message: ToWorker) -> Result<(), String>;

    /// From now on, these are the parts that it may want.
    fn offer(&mut self, known: &Arc<Known>);

    /// It wants parts.
    ///
    /// # Errors
    /// The worker asks for more than it can take.
    fn want(&mut self, parts: Vec<protocol::parts::Hash>) -> Result<(), String>;
}

/// Passes messages, worlds and answers to and fro; see the module's documentation.
pub struct Dispatcher {
    events: Sender<Letter>,
    board: Arc<Mutex<Status>>,
    traffic: Option<Arc<Traffic>>,
    schedule: Schedule,
    known: Option<Arc<Known>>,
    /// The revisions before it that questions may still be about, oldest first.
    past: VecDeque<Arc<Known>>,
    epoch: u64,
    peers: BTreeMap<WorkerId, Peer>,
    /// Workers that could not be told something, and why: they go when all is carried out.
    deaf: Vec<(WorkerId, String)>,
    /// When it last heard something.
    now: Moment,
    alarm: Option<Moment>,
    closed: bool,
    /// Bytes of answers from this process.
    near_bytes: u64,
    refused: u64,
    saturated: u64,
    /// Share of the last second that its thread was busy.
    busy: f64,
    /// Of the answers delivered.
    cost: Cost,
    /// What was just unpacked, until the schedule says whether it is the one that counts.
    fresh: Option<Fresh>,
}

struct Peer {
    link: Box<dyn Link>,
    name: String,
    address: Option<SocketAddr>,
    progress: Option<(u32, u32)>,
    behind: Option<Behind>,
    answer_bytes: u64,
}

/// An answer that is not delivered yet.
struct Fresh {
    body: Body,
    cost: Cost,
    bytes: u64,
    as_it_came: Vec<u8>,
}

/// The board is renewed at most so often, except when somebody comes or goes.
const BETWEEN_POSTS: Duration = Duration::from_millis(20);
/// Revisions that questions may still be about: more than anybody has pictures under way.
const PAST_MAX: usize = 64;

/// Tells the dispatcher what happens, until the front end closes.
pub(super) fn run(mut dispatcher: Dispatcher, notes: &Receiver<Note>) {
    let start = Instant::now();
    let now = || Moment(start.elapsed().as_micros() as u64);
    let (mut posted, mut stale) = (Instant::now(), true);
    let mut watch = Watch::new(start);
    while !dispatcher.closed {
        let alarm = dispatcher.alarm().map(|at| Duration::from_micros(at.0.saturating_sub(now().0)));
        let post = stale.then(|| BETWEEN_POSTS.saturating_sub(posted.elapsed()));
        let waits = Instant::now();
        let note = match alarm.into_iter().chain(post).min() {
            Some(time) => notes.recv_timeout(time),
            None => notes.recv().map_err(|_| RecvTimeoutError::Disconnected),
        };
        if let Some(share) = watch.waited(waits, Instant::now()) {
            (dispatcher.busy, stale) = (share, true);
        }
        stale |= note.is_ok();
        match note {
            Ok(note) => dispatcher.take(note, now()),
            Err(RecvTimeoutError::Disconnected) => dispatcher.take(Note::Order(Order::Close), now()),
            Err(RecvTimeoutError::Timeout) => {}
        }
        dispatcher.wake(now());
        if stale && posted.elapsed() >= BETWEEN_POSTS {
            dispatcher.post();
            (posted, stale) = (Instant::now(), false);
        }
    }
}

impl Dispatcher {
    pub(super) fn new(
        events: Sender<Letter>,
        board: Arc<Mutex<Status>>,
        traffic: Option<Arc<Traffic>>,
        checking: Checking,
    ) -> Self {
        Self {
            events,
            board,
            traffic,
            schedule: Schedule::new(checking),
            known: None,
            past: VecDeque::new(),
            epoch: 0,
            peers: BTreeMap::new(),
            deaf: Vec::new(),
            now: Moment(0),
            alarm: None,
            closed: false,
            near_bytes: 0,
            refused: 0,
            saturated: 0,
            busy: 0.0,
            cost: Cost::default(),
            fresh: None,
        }
    }

    /// Something has happened.
    pub fn take(&mut self, note: Note, now: Moment) {
        self.now = now;
        match note {
            Note::Order(order) => self.handle_order(order),
            Note::Report(worker, report) => self.handle_report(worker, report),
            Note::Refused => self.refused += 1,
        }
    }

    /// When it wants to be woken, if nothing happens before.
    pub fn alarm(&self) -> Option<Moment> {
        self.alarm
    }

    /// Time has passed.
    pub fn wake(&mut self, now: Moment) {
        self.now = now;
        if self.alarm.is_some_and(|at| at <= now) {
            self.alarm = None;
            self.handle(schedule::Event::Woke);
        }
    }

    fn handle_order(&mut self, order: Order) {
        match order {
            Order::World { known, is_edit, epoch } => {
                let state = known.state;
                self.known = Some(known);
                self.past.clear();
                self.epoch = epoch;
                self.handle(schedule::Event::World { state, edit: is_edit });
            }
            Order::Edited(known) => {
                let state = known.state;
                self.past.extend(self.known.replace(known));
                if self.past.len() > PAST_MAX {
                    self.past.pop_front();
                }
                self.handle(schedule::Event::Edited { state });
            }
            Order::Ask(questions) => {
                if let Some(traffic) = &self.traffic {
                    traffic.expect(
                        questions.iter().map(|asked| pack::packed_len_max(&asked.question.ask)).max().unwrap_or(0),
                    );
                }
                self.handle(schedule::Event::Asked(questions));
            }
            Order::Call(called) => self.handle(schedule::Event::Called(called)),
            Order::Cancel(tickets) => self.handle(schedule::Event::Cancelled(tickets)),
            Order::CancelAll(epoch) => {
                self.epoch = epoch;
                self.handle(schedule::Event::CancelledAll);
            }
            Order::FinishChecks => self.handle(schedule::Event::FinishChecks),
            Order::Close => self.close(),
        }
    }

    fn handle_report(&mut self, worker: WorkerId, report: Report) {
        match report {
            Report::Joined { name, threads, depth, address, is_trusted, link } => {
                let event = Event::WorkerJoined {
                    worker: number(worker),
                    name: name.clone(),
                    threads: threads.into(),
                    address,
                };
                self.peers.insert(worker, Peer { link, name, address, progress: None, behind: None, answer_bytes: 0 });
                self.emit(event);
                self.handle(schedule::Event::Joined { worker, threads, depth, trusted: is_trusted });
                self.post();
            }
            Report::Left(reason) => self.part(worker, reason),
            // What was in flight when it left.
            _ if !self.peers.contains_key(&worker) => {}
            Report::Answered { id, cost, content, bytes, as_it_came, round_trip, _room } => {
                self.settle(worker, id, cost, *content, (bytes, as_it_came), round_trip);
            }
            Report::Received { message, _room } => self.handle_message(worker, message),
        }
    }

    fn handle_message(&mut self, worker: WorkerId, message: ToMaster) {
        match message {
            ToMaster::Want { hashes } => {
                let wanted = self.peers.get_mut(&worker).map_or(Ok(()), |peer| peer.link.want(hashes));
                if let Err(reason) = wanted {
                    self.part(worker, reason);
                }
            }
            ToMaster::Progress { have, of } => {
                if let Some(peer) = self.peers.get_mut(&worker) {
                    peer.progress = Some((have.min(of), of));
                }
            }
            ToMaster::Ready { state } => {
                if let Some(peer) = self.peers.get_mut(&worker) {
                    peer.progress = None;
                }
                let is_ready = |dispatcher: &Self| dispatcher.schedule.is_ready(worker);
                let was_ready = is_ready(self);
                self.handle(schedule::Event::Ready { worker, state });
                if !was_ready && is_ready(self) {
                    self.emit(Event::WorkerReady { worker: number(worker) });
                    self.post();
                }
            }
            ToMaster::Missing { id } => self.handle(schedule::Event::Missing { worker, id }),
            ToMaster::Failed { id, reason } => {
                if self.schedule.question(id).is_some() {
                    tracing::warn!("worker {} cannot answer question {}: {reason}", number(worker), id.0);
                }
                self.handle(schedule::Event::Failed { worker, id, reason });
            }
            ToMaster::Refused { id, reason } => {
                if self.schedule.question(id).is_some() {
                    tracing::warn!("worker {} refuses question {}: {reason}", number(worker), id.0);
                }
                self.handle(schedule::Event::Refused { worker, id, reason });
            }
            ToMaster::Relaying(behind) => {
                if let Some(peer) = self.peers.get_mut(&worker) {
                    peer.behind = Some(behind);
                }
                self.handle(schedule::Event::Relays { worker, threads: behind.threads });
                self.post();
            }
            ToMaster::Retracted { reason } => self.handle(schedule::Event::Retracted { worker, reason }),
            ToMaster::Leaving { started } => self.handle(schedule::Event::Leaving { worker, started }),
            ToMaster::Goodbye { reason } => self.part(worker, reason),
        }
    }

    fn settle(
        &mut self,
        worker: WorkerId,
        id: QuestionId,
        cost: Cost,
        content: Content,
        (bytes, as_it_came): (u64, Vec<u8>),
        round_trip: Duration,
    ) {
        let round_trip = round_trip.as_micros() as u64;
        if let Some(peer) = self.peers.get_mut(&worker) {
            peer.answer_bytes += bytes;
            self.near_bytes += if peer.address.is_none() { bytes } else { 0 };
        }
        // Late and doubled answers are common, and not worth unpacking.
        let question = self.schedule.question(id);
        let is_about = |known: &&Arc<Known>| question.is_some_and(|question| question.world == known.state);
        let (Some(question), Some(known)) = (question, self.known.iter().chain(&self.past).find(is_about)) else {
            return self.handle(schedule::Event::Answered { worker, id, micros: 0, round_trip, digest: 0 });
        };
        let unpacked = match content {
            Content::Packed(packed) => Content::of(&packed, question, known),
            unpacked => unpacked,
        };
        match unpacked.sound() {
            Ok((body, is_saturated, digest)) => {
                self.saturated += u64::from(is_saturated);
                let micros = cost.total_micros();
                self.fresh = Some(Fresh { body, cost, bytes, as_it_came });
                self.handle(schedule::Event::Answered { worker, id, micros, round_trip, digest });
                self.fresh = None;
            }
            Err(reason) => {
                tracing::warn!("worker {} sent a broken answer: {reason}", number(worker));
                self.handle(schedule::Event::Failed { worker, id, reason });
            }
        }
    }

    fn part(&mut self, worker: WorkerId, reason: String) {
        let Some(mut peer) = self.peers.remove(&worker) else { return };
        let _ = peer.link.send(ToWorker::Goodbye { reason: reason.clone() });
        self.handle(schedule::Event::Left { worker });
        self.emit(Event::WorkerLeft { worker: number(worker), name: peer.name, reason });
        if self.peers.is_empty() {
            self.emit(Event::NoWorkers);
        }
        self.post();
    }

    fn handle(&mut self, event: schedule::Event) {
        for action in self.schedule.handle(event, self.now) {
            self.carry_out(action);
        }
        // Only now: what the schedule wants done about it comes after what it wanted before, its alarm above all.
        while let Some((worker, reason)) = self.deaf.pop() {
            self.part(worker, reason);
        }
    }

    fn carry_out(&mut self, action: Action) {
        match action {
            Action::Teach(worker) => {
                let Some(known) = self.known.clone() else { return };
                if let Some(peer) = self.peers.get_mut(&worker) {
                    peer.link.offer(&known);
                }
                self.send(worker, known.introduction());
            }
            Action::Update(worker) => {
                let Some(known) = self.known.clone() else { return };
                if let Some(peer) = self.peers.get_mut(&worker) {
                    peer.link.offer(&known);
                }
                self.send(worker, known.news().unwrap_or_else(|| known.introduction()));
            }
            Action::Send { worker, id, question } => self.send(worker, ToWorker::Ask { id, question }),
            Action::Cancel { worker, ids } => self.send(worker, ToWorker::Cancel { ids }),
            Action::Deliver { asked, worker, .. } => {
                if let Some(Fresh { body, cost, bytes, as_it_came }) = self.fresh.take() {
                    self.cost += cost;
                    self.emit(Event::Answered { asked, body, cost, worker: number(worker), bytes, as_it_came });
                }
            }
            Action::GiveUp { asked, reason } => self.emit(Event::Unanswered { asked, reason }),
            Action::Expose { worker, reason, gave } => {
                let name = self.peers.get(&worker).map_or_else(|| "gone".to_owned(), |peer| peer.name.clone());
                tracing::warn!("worker {} ({name}): {reason}", number(worker));
                self.emit(Event::WorkerExposed { worker: number(worker), name, reason, gave });
                self.post();
            }
            Action::Undecided { workers, ask } => {
                let workers: Vec<_> = workers.into_iter().map(number).collect();
                tracing::warn!("workers {workers:?} give different answers to {ask}, and there is no other to decide");
                self.emit(Event::Undecided { workers, ask });
            }
            Action::ChecksFinished => self.emit(Event::Checked),
            Action::WakeAt(at) => self.alarm = Some(at),
        }
    }

    fn send(&mut self, worker: WorkerId, message: ToWorker) {
        let told = self.peers.get_mut(&worker).map_or(Ok(()), |peer| peer.link.send(message));
        if let Err(reason) = told {
            self.deaf.push((worker, reason));
        }
    }

    fn emit(&self, event: Event) {
        // Nobody listens only while the cluster is being closed.
        let _ = self.events.send((self.epoch, Some(event)));
    }

    fn close(&mut self) {
        self.closed = true;
        for peer in self.peers.values_mut() {
            let _ = peer.link.send(ToWorker::Goodbye { reason: "the master has finished".into() });
        }
    }

    /// Renews the board, from which others learn how things stand.
    pub fn post(&self) {
        let (sent, received) = self.traffic.as_ref().map_or((0, 0), |traffic| traffic.bytes());
        let list: Vec<_> = self.schedule.workers().filter_map(|(id, status)| self.describe(id, status)).collect();
        // A relay can answer as long as somebody is behind it.
        let can_answer =
            |info: &&WorkerInfo| matches!(info.state, WorkerState::Ready | WorkerState::Slow) && info.threads > 0;
        let ready = list.iter().filter(can_answer).count();
        let mut board = self.board.lock().unwrap_or_else(PoisonError::into_inner);
        *board = Status {
            workers: list.len(),
            ready,
            list,
            counters: self.schedule.counters(),
            cost: self.cost,
            bytes_sent: sent,
            bytes_received: received + self.near_bytes,
            refused: self.refused,
            saturated: self.saturated,
            // Whoever draws says itself how busy it is.
            busy: Busy { dispatcher: self.busy, ..board.busy },
        };
    }

    fn describe(&self, id: WorkerId, status: schedule::WorkerStatus) -> Option<WorkerInfo> {
        let peer = self.peers.get(&id)?;
        Some(WorkerInfo {
            worker: number(id),
            name: peer.name.clone(),
            address: peer.address,
            state: status.state,
            reason: status.reason,
            progress: peer.progress,
            threads: status.threads,
            behind: peer.behind,
            places: status.places,
            in_flight: status.in_flight,
            answered: status.answered,
            confirmed: status.confirmed,
            thread_time: Duration::from_micros(status.thread_micros),
            turnaround: Duration::from_micros(status.turnaround_micros),
            round_trip: Duration::from_micros(status.round_trip_micros),
            lease: Duration::from_micros(status.lease_micros),
            answer_bytes: peer.answer_bytes,
        })
    }
}

/// The number that front ends and people know a worker by.
fn number(worker: WorkerId) -> u32 {
    worker.0 as u32
}
