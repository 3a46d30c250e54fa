//! The clock: what happens to questions and answers, one after the other.

use std::cmp::Reverse;
use std::collections::{BTreeMap, BTreeSet, BinaryHeap, VecDeque};
use std::sync::Arc;

use frame::{Answered, Chosen, FrontEnd, View};
use protocol::answer::{Body, Cost, Means, Moments, Pixels};
use protocol::question::{Ask, Asked, Motion, Question, Ticket, Tile, WorldState};
use protocol::schedule::{Action, Event, HELD_PER_THREAD, Moment, QuestionId, Schedule, WorkerId};

use super::super::measure::percentile;
use super::super::watched::Place;
use super::{Crew, Model, NAMES, Simulated};
use runtime::render_loop::QUESTIONS_WAITING_MAX;

/// Light sets that a client remembers.
const SHELF: usize = 128;
/// Number of the hub that is the master.
const MASTER: usize = 0;
/// Threads that a relay tells of, at most.
const RELAYED_MAX: usize = protocol::message::RELAYED_MAX as usize;

/// Something that will happen.
#[derive(Clone, Debug, PartialEq)]
enum Happening {
    Received(Seat, QuestionId, Arc<Question>),
    Cancelled(Seat, Vec<QuestionId>),
    Finished(usize, QuestionId),
    /// An answer has come to a hub through its link, …
    Came(Answer),
    /// … is unpacked, …
    Unpacked(Answer),
    /// … and has been dealt with by the dispatcher, …
    Arrived(Answer),
    /// … and been absorbed.
    Absorbed(Asked, WorkerId),
    Woke(usize, Moment),
}

/// Who is asked.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Seat {
    Client(usize),
    Relay(usize),
}

/// On its way to a hub.
#[derive(Clone, Debug, PartialEq)]
struct Answer {
    hub: usize,
    worker: WorkerId,
    id: QuestionId,
    micros: u64,
}

/// A client: what it has to do, and what it knows.
#[derive(Clone, Debug, Default)]
struct Client {
    /// Relative to the one that was measured.
    speed: f64,
    /// Whom it works for, and as whom.
    hub: usize,
    worker: u64,
    queue: VecDeque<(QuestionId, Arc<Question>)>,
    current: BTreeMap<QuestionId, f64>,
    sets: VecDeque<(u32, u16)>,
}

/// The master, or a relay.
struct Hub {
    schedule: Schedule,
    /// Whom it works for, and as whom.
    above: (usize, u64),
    /// By their numbers.
    below: Vec<Seat>,
    /// When the schedule wants to be woken.
    alarm: Option<Moment>,
    /// When link, threads of the network, dispatcher, main thread and cores are free again, microseconds.
    link_free: f64,
    network_free: Vec<f64>,
    dispatcher_free: Vec<f64>,
    main_free: Vec<f64>,
    cores_free: Vec<f64>,
    work: [f64; NAMES.len()],
    link: f64,
}

impl Hub {
    fn new(model: &Model, above: (usize, u64)) -> Self {
        Self {
            schedule: Schedule::default(),
            above,
            below: Vec::new(),
            alarm: None,
            link_free: 0.0,
            network_free: vec![0.0; model.threads.max(1)],
            dispatcher_free: vec![0.0],
            main_free: vec![0.0],
            cores_free: vec![0.0; model.cores.max(1)],
            work: [0.0; NAMES.len()],
            link: 0.0,
        }
    }

    /// A part of it is busy for so long, and all its cores together for so long.
    fn works(&mut self, part: usize, micros: f64, of_all: f64) {
        self.work[part] += micros;
        self.work[NAMES.len() - 1] += of_all;
    }
}

/// See [`super::simulate_crew`].
pub(super) struct Simulation<'a> {
    model: &'a Model,
    front: Box<dyn FrontEnd>,
    world: WorldState,
    /// The master, then relays.
    hubs: Vec<Hub>,
    clients: Vec<Client>,
    /// Of each client.
    threads: u16,
    /// Frames before the clock starts.
    warm_up: u32,
    now: f64,
    mail: BinaryHeap<Reverse<(Moment, u64)>>,
    letters: BTreeMap<u64, Happening>,
    next_letter: u64,
    outstanding: usize,
    /// Microseconds of clients on tiles, and on light sets.
    tiles: f64,
    sets: f64,
    asked: BTreeMap<u32, f64>,
    /// When frames were complete, and how long after their first question.
    done: Vec<(f64, f64)>,
}

/// What was done by some moment.
struct Mark {
    at: f64,
    hubs: Vec<([f64; NAMES.len()], f64)>,
    tiles: f64,
    sets: f64,
}

/// Work of so many microseconds, that may begin then, on the first of some threads, and the first of the cores, that are free;
/// when it ends.
fn take(threads: &mut [f64], cores: &mut [f64], from: f64, micros: f64) -> f64 {
    let first = |free: &[f64]| (0..free.len()).min_by(|a, b| free[*a].total_cmp(&free[*b])).unwrap_or(0);
    let (thread, core) = (first(threads), first(cores));
    let end = from.max(threads[thread]).max(cores[core]) + micros;
    (threads[thread], cores[core]) = (end, end);
    end
}

/// The number of a question above a relay, as a ticket below it.
fn ticket_of(id: QuestionId) -> Ticket {
    Ticket { batch: (id.0 >> 32) as u32, slot: id.0 as u32 }
}

/// Inverse of [`ticket_of`].
fn number_of(ticket: Ticket) -> QuestionId {
    QuestionId(u64::from(ticket.batch) << 32 | u64::from(ticket.slot))
}

impl<'a> Simulation<'a> {
    /// Nobody has joined yet.
    pub(super) fn new(model: &'a Model, method: &Chosen, view: &View, crew: Crew<'_>, warm_up: u32) -> Self {
        let mut hubs = vec![Hub::new(model, (MASTER, 0))];
        let mut lowest = vec![MASTER];
        for each in crew.relays {
            let joined: Vec<usize> = lowest.iter().flat_map(|hub| vec![*hub; *each]).collect();
            lowest = joined
                .into_iter()
                .map(|above| {
                    let number = hubs.len();
                    let worker = hubs[above].below.len() as u64;
                    hubs[above].below.push(Seat::Relay(number));
                    hubs.push(Hub::new(model, (above, worker)));
                    number
                })
                .collect();
        }
        let mut clients = Vec::new();
        for (number, speed) in crew.speeds.iter().enumerate() {
            let hub = lowest[number % lowest.len()];
            let worker = hubs[hub].below.len() as u64;
            hubs[hub].below.push(Seat::Client(number));
            clients.push(Client { speed: *speed, hub, worker, ..Client::default() });
        }
        Self {
            model,
            front: method.begin(view),
            world: view.world,
            hubs,
            clients,
            threads: crew.threads,
            warm_up,
            now: 0.0,
            mail: BinaryHeap::new(),
            letters: BTreeMap::new(),
            next_letter: 0,
            outstanding: 0,
            tiles: 0.0,
            sets: 0.0,
            asked: BTreeMap::new(),
            done: Vec::new(),
        }
    }

    /// Draws, and says what that took.
    pub(super) fn run(mut self, frames: u32) -> Simulated {
        self.front.set_parallelism(self.clients.len() * usize::from(self.threads));
        self.join();
        // The last frames only keep everybody busy until the clock stops.
        let timed = self.warm_up + frames;
        let mut before = self.mark();
        self.ask();
        while self.done.len() < timed as usize {
            let Some(Reverse((at, letter))) = self.mail.pop() else { break };
            self.now = self.now.max(at.0 as f64);
            let complete = self.done.len();
            if let Some(happening) = self.letters.remove(&letter) {
                self.happen(happening);
            }
            self.ask();
            if complete < self.warm_up as usize && self.done.len() >= self.warm_up as usize {
                before = self.mark();
            }
        }
        self.sum_up(&before)
    }

    /// Everybody joins, and knows the scene: the lowest first, so that relays know how many threads are behind them.
    fn join(&mut self) {
        let state = self.world;
        let mut behind = vec![0_usize; self.hubs.len()];
        for hub in (0..self.hubs.len()).rev() {
            self.handle(hub, Event::World { state, edit: false });
            for (number, seat) in self.hubs[hub].below.clone().into_iter().enumerate() {
                let worker = WorkerId(number as u64);
                let (threads, relayed) = match seat {
                    Seat::Client(_) => (self.threads, None),
                    Seat::Relay(relay) => (1, Some(behind[relay].min(RELAYED_MAX) as u16)),
                };
                behind[hub] += relayed.map_or(usize::from(threads), usize::from);
                self.handle(hub, Event::Joined { worker, threads, depth: HELD_PER_THREAD, trusted: false });
                if let Some(threads) = relayed {
                    self.handle(hub, Event::Relays { worker, threads });
                }
                self.handle(hub, Event::Ready { worker, state });
            }
        }
    }

    fn mark(&self) -> Mark {
        let hubs = self.hubs.iter().map(|hub| (hub.work, hub.link)).collect();
        Mark { at: self.now, hubs, tiles: self.tiles, sets: self.sets }
    }

    fn sum_up(&self, before: &Mark) -> Simulated {
        let time = (self.now - before.at).max(1.0);
        let (clients, threads) = (self.clients.len(), self.clients.len() * usize::from(self.threads));
        let among = [self.model.threads.max(1), 1, 1, self.model.cores.max(1)];
        let busy_of = |hub: usize, part: usize| {
            (self.hubs[hub].work[part] - before.hubs[hub].0[part]) / (time * among[part] as f64)
        };
        let busy = (0..NAMES.len()).map(|part| (busy_of(MASTER, part), NAMES[part]));
        let (master_busy, busiest) = busy.max_by(|a, b| a.0.total_cmp(&b.0)).unwrap_or((0.0, NAMES[0]));
        let relays = (1..self.hubs.len()).map(|hub| busy_of(hub, 0).max(busy_of(hub, NAMES.len() - 1)));
        let timed = self.done.get(self.warm_up as usize..).unwrap_or_default();
        let mut latencies: Vec<f64> = timed.iter().map(|(_, took)| took / 1e3).collect();
        latencies.sort_by(f64::total_cmp);
        let counters = self.hubs[MASTER].schedule.counters();
        Simulated {
            clients,
            frame_time: time / 1e6 / timed.len().max(1) as f64,
            sets_per_share: counters.sets_begun as f64 / counters.shares.max(1) as f64,
            master_busy,
            busiest,
            relays_busy: relays.fold(0.0, f64::max),
            link_busy: (self.hubs[MASTER].link - before.hubs[MASTER].1) / time,
            on_tiles: (self.tiles - before.tiles) / (time * threads as f64),
            on_sets: (self.sets - before.sets) / (time * threads as f64),
            latency_ms: [percentile(&latencies, 50), percentile(&latencies, 99)],
            asked_twice: counters.asked_twice as f64 / counters.asked.max(1) as f64,
        }
    }

    fn ask(&mut self) {
        let questions = self.front.ask(QUESTIONS_WAITING_MAX.saturating_sub(self.outstanding));
        if questions.is_empty() {
            return;
        }
        for asked in &questions {
            self.asked.entry(asked.ticket.batch).or_insert(self.now);
        }
        self.outstanding += questions.len();
        self.handle(MASTER, Event::Asked(questions));
    }

    fn happen(&mut self, happening: Happening) {
        match happening {
            Happening::Received(Seat::Client(client), id, question) => {
                self.clients[client].queue.push_back((id, question));
                self.begin(client);
            }
            Happening::Received(Seat::Relay(hub), id, question) => {
                self.handle(hub, Event::Asked(vec![Asked { ticket: ticket_of(id), question }]));
            }
            Happening::Cancelled(Seat::Client(client), ids) => {
                self.clients[client].queue.retain(|(id, _)| !ids.contains(id));
            }
            Happening::Cancelled(Seat::Relay(hub), ids) => {
                let tickets: BTreeSet<Ticket> = ids.into_iter().map(ticket_of).collect();
                self.handle(hub, Event::Cancelled(tickets));
            }
            Happening::Finished(client, id) => {
                let micros = self.clients[client].current.remove(&id).unwrap_or(0.0) as u64;
                let Client { hub, worker, .. } = self.clients[client];
                self.answer(Answer { hub, worker: WorkerId(worker), id, micros });
                self.begin(client);
            }
            Happening::Came(answer) => {
                let takes = if answer.hub == MASTER { self.costs().network } else { self.model.relay };
                let hub = &mut self.hubs[answer.hub];
                let done = take(&mut hub.network_free, &mut hub.cores_free, self.now, takes);
                hub.works(0, takes, takes);
                let next = if answer.hub == MASTER { Happening::Unpacked(answer) } else { Happening::Arrived(answer) };
                self.post(done, next);
            }
            Happening::Unpacked(answer) => {
                let takes = self.costs().dispatcher;
                let hub = &mut self.hubs[answer.hub];
                let done = take(&mut hub.dispatcher_free, &mut hub.cores_free, self.now, takes);
                hub.works(1, takes, takes);
                self.post(done, Happening::Arrived(answer));
            }
            Happening::Absorbed(asked, worker) => self.deliver(&asked, worker),
            Happening::Arrived(Answer { hub, worker, id, micros }) => {
                let round_trip = (2.0 * self.model.delay) as u64;
                self.handle(hub, Event::Answered { worker, id, micros, round_trip, digest: 0 });
            }
            Happening::Woke(hub, at) => {
                // Later requests have made earlier ones void.
                if self.hubs[hub].alarm.take_if(|alarm| *alarm == at).is_some() {
                    self.handle(hub, Event::Woke);
                }
            }
        }
    }

    /// What the master's threads take, with as many connections as it has.
    fn costs(&self) -> super::Costs {
        self.model.master.with(self.hubs[MASTER].below.len())
    }

    /// An answer goes up: through the link of whom it goes to, one after the other.
    fn answer(&mut self, answer: Answer) {
        let hub = &mut self.hubs[answer.hub];
        let sending = self.model.bytes / self.model.link;
        hub.link_free = hub.link_free.max(self.now) + sending;
        hub.link += sending;
        let arrival = hub.link_free + self.model.delay;
        self.post(arrival, Happening::Came(answer));
    }

    /// A client that has an idle thread takes the next question.
    fn begin(&mut self, number: usize) {
        let client = &mut self.clients[number];
        if client.current.len() >= usize::from(self.threads) {
            return;
        }
        let Some((id, question)) = client.queue.pop_front() else { return };
        let place = Place::of(&question);
        let tile_time = self.model.micros(place) * f64::from(question.ask.frames()) / client.speed;
        // Where light stands still between frames, so do the sets.
        let set = |Tile { lit, .. }: Tile| match lit.quality.motion {
            Motion::Moving => (0, lit.set),
            Motion::Still | Motion::Fresh => (lit.frame, lit.set),
        };
        let sets: Vec<_> = match &question.ask {
            Ask::Tile(tile) => vec![set(tile.clone())],
            Ask::Frames(frames) => frames.tiles().map(set).collect(),
            Ask::Reference(_) | Ask::Lights(_) | Ask::Rays(_) | Ask::Points(_) => Vec::new(),
        };
        let mut set_time = 0.0;
        for set in sets {
            if !client.sets.contains(&set) {
                set_time += self.model.set / client.speed;
                client.sets.push_back(set);
                if client.sets.len() > SHELF {
                    client.sets.pop_front();
                }
            }
        }
        self.tiles += tile_time;
        self.sets += set_time;
        let time = tile_time + set_time;
        client.current.insert(id, time);
        let at = self.now + time;
        self.post(at, Happening::Finished(number, id));
    }

    fn handle(&mut self, hub: usize, event: Event) {
        for action in self.hubs[hub].schedule.handle(event, Moment(self.now as u64)) {
            self.carry_out(hub, action);
        }
    }

    fn carry_out(&mut self, hub: usize, action: Action) {
        let there = self.now + self.model.delay;
        let seat = |hubs: &[Hub], worker: WorkerId| hubs[hub].below[worker.0 as usize];
        match action {
            Action::Teach(_) | Action::Update(_) => {}
            // Nothing is checked here.
            Action::Expose { .. } | Action::Undecided { .. } | Action::ChecksFinished => {}
            Action::Send { worker, id, question } => {
                let seat = seat(&self.hubs, worker);
                self.post(there, Happening::Received(seat, id, question));
            }
            Action::Cancel { worker, ids } => {
                let seat = seat(&self.hubs, worker);
                self.post(there, Happening::Cancelled(seat, ids));
            }
            Action::Deliver { asked, .. } if hub != MASTER => {
                let (above, worker) = self.hubs[hub].above;
                self.answer(Answer { hub: above, worker: WorkerId(worker), id: number_of(asked.ticket), micros: 0 });
            }
            Action::Deliver { asked, worker, .. } => {
                let costs = self.costs();
                let master = &mut self.hubs[MASTER];
                // It waits for its helpers, which have all cores.
                let takes = costs.main + costs.helpers / master.cores_free.len() as f64;
                let done = take(&mut master.main_free, &mut master.cores_free, self.now, takes);
                master.works(2, takes, costs.main + costs.helpers);
                self.post(done, Happening::Absorbed(asked, worker));
            }
            // Clients answer all that they are asked.
            Action::GiveUp { .. } if hub != MASTER => {}
            Action::GiveUp { asked, .. } => {
                self.outstanding = self.outstanding.saturating_sub(1);
                self.front.give_up(asked.ticket);
            }
            Action::WakeAt(at) => {
                self.hubs[hub].alarm = Some(at);
                self.post(at.0 as f64, Happening::Woke(hub, at));
            }
        }
    }

    fn deliver(&mut self, Asked { ticket, question }: &Asked, worker: WorkerId) {
        self.outstanding = self.outstanding.saturating_sub(1);
        let first = self.front.frames();
        let body = match &question.ask {
            Ask::Reference(_) => Body::Moments(Moments::zero(question.ask.len())),
            Ask::Frames(_) => Body::Means(Means::black(question.ask.len())),
            _ => Body::Pixels(Pixels::black(question.ask.len())),
        };
        let cost = Cost::default();
        self.front.absorb(Answered { ticket: *ticket, body, worker: worker.0 as u32, cost: &cost });
        // Frames that were asked for together begin with the first of them.
        let mut asked = self.now;
        for frame in first..self.front.frames() {
            asked = self.asked.remove(&frame).unwrap_or(asked);
            self.done.push((self.now, self.now - asked));
        }
    }

    fn post(&mut self, at: f64, happening: Happening) {
        self.next_letter += 1;
        // Never before now, and never at the same moment in another order.
        self.mail.push(Reverse((Moment(at.max(self.now).ceil() as u64), self.next_letter)));
        self.letters.insert(self.next_letter, happening);
    }
}
