//! The thread between the front end and the workers: [`Schedule`] decides, this carries out.

use std::collections::BTreeMap;
use std::net::SocketAddr;
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use protocol::answer::{Body, Cost};
use protocol::message::{ToMaster, ToWorker};
use protocol::pack;
use protocol::question::Question;
use protocol::schedule::{self, Action, Moment, QuestionId, Schedule, WorkerId, WorkerState};

use super::{Event, Known, Status, WorkerInfo};
use crate::network::Traffic;

/// What the desk is told.
pub(crate) enum Note {
    /// By the front end.
    Order(Order),
    /// By or about a worker.
    Report(WorkerId, Report),
    /// A stranger was refused.
    Refused,
}

/// What the front end wants.
pub(crate) enum Order {
    World { known: Arc<Known>, is_edit: bool, epoch: u64 },
    Ask(Vec<Question>),
    CancelAll(u64),
    Close,
}

/// What is heard of a worker.
pub(crate) enum Report {
    Joined {
        name: String,
        threads: u16,
        depth: u16,
        address: Option<SocketAddr>,
        link: Box<dyn Link>,
    },
    Said(ToMaster),
    /// An answer; it is packed, not compressed, and hostile. `_room` is given back when it is dealt with.
    Answered {
        id: QuestionId,
        cost: Cost,
        packed: Result<Vec<u8>, String>,
        bytes: u64,
        _room: Option<Room>,
    },
    /// The connection is gone; why.
    Left(String),
}

/// A place in a queue, given back when dropped.
pub(crate) type Room = tokio::sync::OwnedSemaphorePermit;

/// The way to a worker. Dropped, it ends the connection after what was said.
pub(crate) trait Link: Send {
    /// Tells it something.
    ///
    /// # Errors
    /// The worker does not listen.
    fn tell(&mut self, words: ToWorker) -> Result<(), String>;

    /// From now on, these are the parts that it may want.
    fn offer(&mut self, known: &Arc<Known>);

    /// It wants parts.
    ///
    /// # Errors
    /// The worker asks for more than it can take.
    fn want(&mut self, parts: Vec<protocol::parts::Hash>) -> Result<(), String>;
}

pub(crate) struct Desk {
    notes: Receiver<Note>,
    events: Sender<(u64, Event)>,
    board: Arc<Mutex<Status>>,
    traffic: Option<Arc<Traffic>>,
    schedule: Schedule,
    known: Option<Arc<Known>>,
    epoch: u64,
    peers: BTreeMap<WorkerId, Peer>,
    start: Instant,
    alarm: Option<Moment>,
    /// When the board was renewed, and whether something has happened since.
    posted: Instant,
    stale: bool,
    /// Bytes of answers from this process.
    near_bytes: u64,
    refused: u64,
    saturated: u64,
    /// What was just unpacked, until the schedule says whether it is the one that counts.
    fresh: Option<(Body, Cost, u64)>,
}

struct Peer {
    link: Box<dyn Link>,
    name: String,
    address: Option<SocketAddr>,
    progress: Option<(u32, u32)>,
    answer_bytes: u64,
}

/// The board is renewed at most so often, except when somebody comes or goes.
const BETWEEN_POSTS: Duration = Duration::from_millis(20);

impl Desk {
    pub(crate) fn new(
        notes: Receiver<Note>,
        events: Sender<(u64, Event)>,
        board: Arc<Mutex<Status>>,
        traffic: Option<Arc<Traffic>>,
    ) -> Self {
        Self {
            notes,
            events,
            board,
            traffic,
            schedule: Schedule::default(),
            known: None,
            epoch: 0,
            peers: BTreeMap::new(),
            start: Instant::now(),
            alarm: None,
            posted: Instant::now(),
            stale: true,
            near_bytes: 0,
            refused: 0,
            saturated: 0,
            fresh: None,
        }
    }

    /// Works until the front end closes.
    pub(crate) fn run(mut self) {
        loop {
            let note = match self.time_to_alarm() {
                Some(time) => self.notes.recv_timeout(time),
                None => self.notes.recv().map_err(|_| RecvTimeoutError::Disconnected),
            };
            self.stale |= note.is_ok();
            match note {
                Ok(Note::Order(Order::Close)) | Err(RecvTimeoutError::Disconnected) => return self.close(),
                Ok(Note::Order(order)) => self.obey(order),
                Ok(Note::Report(worker, report)) => self.hear(worker, report),
                Ok(Note::Refused) => self.refused += 1,
                Err(RecvTimeoutError::Timeout) => {}
            }
            if self.alarm.is_some_and(|at| at <= self.now()) {
                self.alarm = None;
                self.handle(schedule::Event::Woke);
            }
            if self.stale && self.posted.elapsed() >= BETWEEN_POSTS {
                self.post();
            }
        }
    }

    fn now(&self) -> Moment {
        Moment(self.start.elapsed().as_micros() as u64)
    }

    /// Until the schedule wants to be woken, or the board to be renewed.
    fn time_to_alarm(&self) -> Option<Duration> {
        let alarm = self.alarm.map(|at| Duration::from_micros(at.0.saturating_sub(self.now().0)));
        let post = self.stale.then(|| BETWEEN_POSTS.saturating_sub(self.posted.elapsed()));
        alarm.into_iter().chain(post).min()
    }

    fn obey(&mut self, order: Order) {
        match order {
            Order::World { known, is_edit, epoch } => {
                let state = known.state;
                self.known = Some(known);
                self.epoch = epoch;
                self.handle(schedule::Event::World { state, edit: is_edit });
            }
            Order::Ask(questions) => {
                if let Some(traffic) = &self.traffic {
                    traffic.expect(
                        questions.iter().map(|question| pack::packed_len_max(&question.ask)).max().unwrap_or(0),
                    );
                }
                self.handle(schedule::Event::Asked(questions));
            }
            Order::CancelAll(epoch) => {
                self.epoch = epoch;
                self.handle(schedule::Event::CancelledAll);
            }
            Order::Close => {}
        }
    }

    fn hear(&mut self, worker: WorkerId, report: Report) {
        match report {
            Report::Joined { name, threads, depth, address, link } => {
                let event = Event::WorkerJoined {
                    worker: number(worker),
                    name: name.clone(),
                    threads: threads.into(),
                    address,
                };
                self.peers.insert(worker, Peer { link, name, address, progress: None, answer_bytes: 0 });
                self.say(event);
                self.handle(schedule::Event::Joined { worker, threads, depth });
                self.post();
            }
            Report::Left(reason) => self.part(worker, reason),
            // What was under way when a worker was dismissed.
            _ if !self.peers.contains_key(&worker) => {}
            Report::Answered { id, cost, packed, bytes, _room } => self.settle(worker, id, cost, packed, bytes),
            Report::Said(words) => self.listen(worker, words),
        }
    }

    fn listen(&mut self, worker: WorkerId, words: ToMaster) {
        match words {
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
                self.handle(schedule::Event::Ready { worker, state });
                self.say(Event::WorkerReady { worker: number(worker) });
                self.post();
            }
            ToMaster::Missing { id } => self.handle(schedule::Event::Missing { worker, id }),
            ToMaster::Failed { id, reason } => {
                tracing::warn!("worker {} cannot answer question {}: {reason}", number(worker), id.0);
                self.handle(schedule::Event::Failed { worker, id, reason });
            }
            ToMaster::Leaving { in_hand } => self.handle(schedule::Event::Leaving { worker, in_hand }),
            ToMaster::Goodbye { reason } => self.part(worker, reason),
        }
    }

    fn settle(&mut self, worker: WorkerId, id: QuestionId, cost: Cost, packed: Result<Vec<u8>, String>, bytes: u64) {
        if let Some(peer) = self.peers.get_mut(&worker) {
            peer.answer_bytes += bytes;
            self.near_bytes += if peer.address.is_none() { bytes } else { 0 };
        }
        // Late and doubled answers are common, and not worth unpacking.
        let (Some(question), Some(known)) = (self.schedule.question(id), &self.known) else {
            return self.handle(schedule::Event::Answered { worker, id, micros: 0 });
        };
        let unpacked = packed.and_then(|packed| {
            self.saturated += u64::from(pack::is_saturated(&packed));
            pack::unpack(question, &packed, known.fields).map_err(|error| error.to_string())
        });
        match unpacked {
            Ok(body) => {
                let micros = cost.micros.iter().sum();
                self.fresh = Some((body, cost, bytes));
                self.handle(schedule::Event::Answered { worker, id, micros });
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
        let _ = peer.link.tell(ToWorker::Goodbye { reason: reason.clone() });
        self.handle(schedule::Event::Left { worker });
        self.say(Event::WorkerLeft { worker: number(worker), name: peer.name, reason });
        if self.peers.is_empty() {
            self.say(Event::NoWorkers);
        }
        self.post();
    }

    fn handle(&mut self, event: schedule::Event) {
        for action in self.schedule.handle(event, self.now()) {
            self.carry_out(action);
        }
    }

    fn carry_out(&mut self, action: Action) {
        match action {
            Action::Teach(worker) => {
                let Some(known) = self.known.clone() else { return };
                if let Some(peer) = self.peers.get_mut(&worker) {
                    peer.link.offer(&known);
                }
                self.tell(worker, known.introduction());
            }
            Action::Update(worker) => {
                let Some(known) = self.known.clone() else { return };
                if let Some(peer) = self.peers.get_mut(&worker) {
                    peer.link.offer(&known);
                }
                self.tell(worker, known.news().unwrap_or_else(|| known.introduction()));
            }
            Action::Send { worker, id, question } => self.tell(worker, ToWorker::Ask { id, question }),
            Action::Cancel { worker, ids } => self.tell(worker, ToWorker::Cancel { ids }),
            Action::Deliver { question, worker, .. } => {
                if let Some((body, cost, bytes)) = self.fresh.take() {
                    self.say(Event::Answered { question, body, cost, worker: number(worker), bytes });
                }
            }
            Action::GiveUp { question, reason } => self.say(Event::Unanswered { question, reason }),
            Action::Dismiss { worker, reason } => self.part(worker, format!("dismissed: {reason}")),
            Action::WakeAt(at) => self.alarm = Some(at),
        }
    }

    fn tell(&mut self, worker: WorkerId, words: ToWorker) {
        let told = self.peers.get_mut(&worker).map_or(Ok(()), |peer| peer.link.tell(words));
        if let Err(reason) = told {
            self.part(worker, reason);
        }
    }

    fn say(&self, event: Event) {
        // Nobody listens only while the cluster is being closed.
        let _ = self.events.send((self.epoch, event));
    }

    fn close(mut self) {
        for peer in self.peers.values_mut() {
            let _ = peer.link.tell(ToWorker::Goodbye { reason: "the master has finished".into() });
        }
    }

    fn post(&mut self) {
        (self.posted, self.stale) = (Instant::now(), false);
        let (sent, received) = self.traffic.as_ref().map_or((0, 0), |traffic| traffic.bytes());
        let list: Vec<_> = self.schedule.workers().filter_map(|(id, status)| self.describe(id, &status)).collect();
        let ready = list.iter().filter(|info| matches!(info.state, WorkerState::Ready | WorkerState::Slow)).count();
        let status = Status {
            workers: list.len(),
            ready,
            list,
            counters: self.schedule.counters(),
            bytes_sent: sent,
            bytes_received: received + self.near_bytes,
            refused: self.refused,
            saturated: self.saturated,
        };
        *self.board.lock().unwrap_or_else(PoisonError::into_inner) = status;
    }

    fn describe(&self, id: WorkerId, status: &schedule::WorkerStatus) -> Option<WorkerInfo> {
        let peer = self.peers.get(&id)?;
        Some(WorkerInfo {
            worker: number(id),
            name: peer.name.clone(),
            address: peer.address,
            state: status.state,
            progress: peer.progress,
            threads: status.threads,
            in_flight: status.in_flight,
            answered: status.answered,
            thread_time: Duration::from_micros(status.thread_micros),
            turnaround: Duration::from_micros(status.turnaround_micros),
            answer_bytes: peer.answer_bytes,
        })
    }
}

/// The number that front ends and people know a worker by.
fn number(worker: WorkerId) -> u32 {
    worker.0 as u32
}
