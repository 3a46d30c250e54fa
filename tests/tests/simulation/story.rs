//! A story: what its seed makes happen, and what must be true all the time.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::mpsc::Receiver;
use std::time::Duration;

use frame::front_end::GivenUp;
use frame::{Absorbed, FrontEnd, Igi, Plane};
use protocol::answer::{Body, Cost};
use protocol::message::{Answered, HEADER_LEN, Header, Kind, ToMaster, WireError, decode};
use protocol::pack::decompress;
use protocol::question::{Ask, Asked, Frames, Question, Rect, WorldState};
use protocol::schedule::{Checking, Counters, HELD_MAX, HELD_PER_THREAD, Moment, WorkerId};
use runtime::cluster::dispatcher::{Dispatcher, Note, Report};
use runtime::cluster::{Cluster, Content, Event};
use scenes::Scene;
use worker::blob_store::BlobStore;

use super::chance::Chance;
use super::network::{Far, IDLE, Outbox, Parcel, RESENT_MAX, Way};
use super::truth::{self, FRAMES, LONGEST};
use super::worker::{Deed, Lie, Nature, SimulatedWorker, Timer};

/// What kind of story.
#[derive(Clone, Debug)]
pub struct Plan {
    pictures: u32,
    /// Workers that are there from the beginning and well.
    healthy: u64,
    /// Faults may happen until then, microseconds.
    storm: u64,
    /// A third worker, to which one thing happens.
    one_is_lost: bool,
    poison: bool,
    /// Workers that are connected and fall silent after few answers, or before the first.
    silent: u64,
    /// Of the workers that are well, this many are far away: every message takes so much longer, microseconds. Nothing
    /// is lost on the way, and all pictures are of the same world.
    far: Option<(u64, u64)>,
    /// One more worker, which computes wrongly.
    liar: Option<Lie>,
    /// Share of answers that are checked.
    share: f64,
}

/// Share of answers that are checked in every other storm.
const SHARE_IN_STORMS: f64 = 0.2;

impl Plan {
    pub fn storm() -> Self {
        Self { pictures: 3, storm: 20_000_000, ..Self::calm(1) }
    }

    pub fn calm(healthy: u64) -> Self {
        Self {
            pictures: 1,
            healthy,
            storm: 0,
            one_is_lost: false,
            poison: false,
            silent: 0,
            far: None,
            liar: None,
            share: 0.0,
        }
    }

    /// Beside three that are well, and such a share is checked.
    pub fn one_lies(lie: Lie, share: f64) -> Self {
        Self { pictures: 4, liar: Some(lie), share, ..Self::calm(3) }
    }

    pub fn many_are_silent(silent: u64) -> Self {
        Self { silent, ..Self::calm(2) }
    }

    /// Some of them far away.
    pub fn far(healthy: u64, far: u64, micros: u64) -> Self {
        Self { pictures: 4, far: Some((far, micros)), ..Self::calm(healthy) }
    }

    pub fn one_is_lost() -> Self {
        Self { one_is_lost: true, ..Self::calm(2) }
    }

    pub fn poisoned() -> Self {
        Self { poison: true, pictures: 1, ..Self::calm(3) }
    }
}

/// How a story ended.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Outcome {
    pub faults: u64,
    pub counters: Counters,
    pub gaps: u64,
    /// Simulated microseconds, as all times here.
    pub longest_picture: u64,
    pub last_picture: u64,
    /// Of those that things happen to, from then on.
    pub longest_lease: u64,
    pub longest_tile: u64,
    /// From when a worker sent a wrong answer for the first time until it was exposed, if it was.
    pub found_after: Option<u64>,
    /// Wrong answers by then, but for those to pictures that were left before they were whole: these are compared with nothing.
    pub wrong: u64,
    /// Pictures whose bits were another's, as far as that was allowed.
    pub wrong_pictures: u64,
    /// Answers about revisions before an edit, and pictures that were whole all the same.
    pub past: [u64; 2],
}

enum Happening {
    ToWorker(WorkerId, Parcel),
    ToMaster(WorkerId, Parcel),
    Timer(WorkerId, Timer),
    /// The master notices that a connection is gone; or the worker does.
    LostByMaster(WorkerId),
    LostByWorker(WorkerId),
    /// A process starts; the last says whether it is kept from harm.
    Join(Box<Nature>, Arc<BlobStore>, bool),
    Fault,
}

/// A worker's process and its connection. A connection that was lost is another worker to the master.
struct Place {
    /// Nothing: the process is gone.
    worker: Option<SimulatedWorker>,
    there: Way,
    back: Way,
    /// Every message takes so much longer, microseconds.
    far: u64,
    /// Stopped (SIGSTOP) until then.
    frozen_until: Moment,
    /// Nothing happens to it.
    is_safe: bool,
    /// Something has.
    is_hit: bool,
}

pub struct Story {
    plan: Plan,
    chance: Chance,
    now: Moment,
    mail: BTreeMap<(Moment, u64), Happening>,
    letters: u64,
    cluster: Cluster,
    dispatcher: Dispatcher,
    notes: Receiver<Note>,
    outbox: Outbox,
    places: BTreeMap<WorkerId, Place>,
    joined: u64,
    scene: Arc<Scene>,
    state: WorldState,
    front: Igi,
    gaps: Vec<Rect>,
    /// Pictures of revisions before an edit, which are under way.
    past: Vec<Past>,
    poison: Option<Rect>,
    outcome: Outcome,
    is_aloud: bool,
    /// When a worker sent a wrong answer for the first time.
    lied: Option<Moment>,
    /// Wrong answers since this picture was begun.
    lies: u64,
    checks: Checks,
}

/// A picture of a revision before the current one.
struct Past {
    scene: Arc<Scene>,
    state: WorldState,
    front: Igi,
    /// Part of it was given up.
    has_gaps: bool,
}

/// What is being checked when all is drawn.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Checks {
    Unasked,
    Awaited,
    Finished,
}

/// No picture takes longer while one healthy worker lives.
const PICTURE_MAX: u64 = 900_000_000;
/// Most processes at a time.
const PLACES_MAX: usize = 7;

impl Story {
    pub fn new(seed: u64, plan: Plan) -> Self {
        // Whatever goes wrong, nobody who computes right may be taken for a liar.
        let share = if plan.storm > 0 && seed % 2 == 1 { SHARE_IN_STORMS } else { plan.share };
        let (cluster, dispatcher, notes) = Cluster::by_hand(Checking { share, salt: seed });
        let scene = truth::scene(0);
        let state = WorldState::default();
        let front = Igi::new(truth::setup(&scene, state));
        Self {
            plan,
            chance: Chance::new(seed),
            now: Moment(0),
            mail: BTreeMap::new(),
            letters: 0,
            cluster,
            dispatcher,
            notes,
            outbox: Outbox::default(),
            places: BTreeMap::new(),
            joined: 0,
            scene,
            state,
            front,
            gaps: Vec::new(),
            past: Vec::new(),
            poison: None,
            outcome: Outcome::default(),
            is_aloud: false,
            lied: None,
            lies: 0,
            checks: Checks::Unasked,
        }
    }

    /// Says what happens.
    pub fn aloud(self) -> Self {
        Self { is_aloud: true, ..self }
    }

    pub fn run(mut self) -> Outcome {
        self.turn(0);
        self.set_the_scene();
        for picture in 0..self.plan.pictures {
            if picture > 0 {
                self.turn(picture);
            }
            let is_last = picture + 1 == self.plan.pictures;
            let patience = if !is_last && self.chance.per_mille(400) { self.chance.draw(60) } else { u64::MAX };
            self.draw(patience);
        }
        self.outcome.counters = self.status().counters;
        self.outcome
    }

    fn set_the_scene(&mut self) {
        if self.plan.poison {
            let asked = self.front.ask(1).remove(0);
            self.poison = Some(rect_of(&asked.question));
            self.front = Igi::new(self.front.setup().clone());
            self.front.set_limit(FRAMES);
        }
        for number in 0..self.plan.healthy {
            let far =
                self.plan.far.filter(|(far, _)| number + far >= self.plan.healthy).map_or(0, |(_, micros)| micros);
            let nature = Nature { far, ..self.well() };
            let delay = if self.plan.storm > 0 { self.chance.draw(3_000_000) } else { 0 };
            self.post(delay, Happening::Join(Box::new(nature), Arc::default(), true));
        }
        if self.plan.storm > 0 {
            self.post(0, Happening::Fault);
        }
        for _ in 0..self.plan.silent {
            let nature = Nature { silent_after: Some(self.chance.draw(12).saturating_sub(4)), ..self.well() };
            let delay = self.chance.draw(1_000_000);
            self.post(delay, Happening::Join(Box::new(nature), Arc::default(), false));
        }
        if let Some(lie) = self.plan.liar {
            let nature = Nature { lie: Some(lie), ..self.well() };
            let when = self.chance.draw(400_000);
            self.post(when, Happening::Join(Box::new(nature), Arc::default(), false));
        }
        if self.plan.one_is_lost {
            let nature = self.well();
            self.post(0, Happening::Join(Box::new(nature), Arc::default(), false));
            let when = self.chance.draw(1_500_000);
            self.post(when, Happening::Fault);
        }
    }

    fn well(&mut self) -> Nature {
        let threads = self.chance.between(1, 4) as u16;
        let poison = self.poison;
        Nature {
            threads,
            slowness: 1,
            breaks: 0,
            loses: 0,
            fails: 0,
            doubles: 0,
            lies: false,
            forgets: 0,
            poison,
            far: 0,
            silent_after: None,
            lie: None,
        }
    }

    fn of_any_kind(&mut self) -> Nature {
        let mut nature = self.well();
        for trouble in
            [&mut nature.breaks, &mut nature.loses, &mut nature.fails, &mut nature.doubles, &mut nature.forgets]
        {
            if self.chance.per_mille(250) {
                *trouble = self.chance.between(5, 100);
            }
        }
        nature.silent_after = self.chance.per_mille(100).then(|| self.chance.draw(20));
        nature.lies = self.chance.per_mille(100);
        if self.chance.per_mille(200) {
            nature.far = self.chance.between(5_000, 200_000);
        }
        if self.chance.per_mille(50) {
            nature.breaks = 1000;
        }
        nature
    }

    /// The next world: another scene, an edit, or the same once more.
    fn turn(&mut self, picture: u32) {
        let kind = match (picture, self.plan.far) {
            (0, _) => 0,
            (_, Some(_)) => 2,
            _ if self.plan.storm > 0 => self.chance.draw(4),
            _ => self.chance.draw(3),
        };
        if kind < 3 {
            self.past.clear();
        }
        match kind {
            0 => {
                self.scene = truth::scene(picture);
                self.state = self.cluster.publish(Arc::clone(&self.scene)).expect("the scene can be sent");
            }
            1 => {
                let change = truth::edit(self.state.revision + 1);
                self.state = self.cluster.change(vec![change.clone()]).expect("the edit is sound");
                change.apply(Arc::make_mut(&mut self.scene)).expect("the edit is sound");
            }
            2 => self.cluster.cancel_all(),
            // What is open is wanted all the same.
            _ => {
                let before = (Arc::clone(&self.scene), self.state);
                let change = truth::edit(self.state.revision + 1);
                self.state = self.cluster.change_behind(vec![change.clone()], None).expect("the edit is sound");
                change.apply(Arc::make_mut(&mut self.scene)).expect("the edit is sound");
                let new = Igi::new(truth::setup(&self.scene, self.state));
                let (scene, state) = before;
                let front = std::mem::replace(&mut self.front, new);
                self.past.push(Past { scene, state, front, has_gaps: !self.gaps.is_empty() });
            }
        }
        self.gaps.clear();
        self.lies = 0;
        self.checks = Checks::Unasked;
        self.front = Igi::new(truth::setup(&self.scene, self.state));
        self.front.set_limit(FRAMES);
        self.log(|| format!("picture {picture} (kind {kind})"));
    }

    /// Draws until the picture is complete, or after so many answers somebody wants another.
    fn draw(&mut self, patience: u64) {
        let begun = self.now;
        let mut answers = 0;
        loop {
            answers += self.talk();
            if self.front.is_finished() && self.has_checked() {
                break;
            }
            if answers >= patience {
                return;
            }
            self.step();
            let waited = self.now.0 - begun.0;
            assert!(waited < PICTURE_MAX, "the picture does not end: {:?}", self.status());
        }
        self.outcome.wrong += std::mem::take(&mut self.lies);
        self.outcome.last_picture = self.now.0 - begun.0;
        self.outcome.longest_picture = self.outcome.longest_picture.max(self.outcome.last_picture);
        self.outcome.gaps += self.gaps.len() as u64;
        let (drawn, truth) = (self.front.show(Plane::Raw), truth::picture(&self.scene, self.state));
        assert_eq!(self.front.frames(), FRAMES);
        if self.plan.liar.is_some() && self.plan.share < 1.0 {
            // What nobody has compared may be wrong.
            self.outcome.wrong_pictures += u64::from(drawn.sha256() != truth.sha256());
            return;
        }
        if self.gaps.is_empty() {
            assert_eq!(drawn.sha256(), truth.sha256(), "the picture is another");
        }
        let width = truth.width;
        let is_gap = |x: u32, y: u32| {
            let within = |start: u32, length: u32, at: u32| (start..start + length).contains(&at);
            self.gaps.iter().any(|rect| within(rect.x, rect.width, x) && within(rect.y, rect.height, y))
        };
        for (at, (drawn, truth)) in drawn.pixels.iter().zip(&truth.pixels).enumerate() {
            let (x, y) = (at as u32 % width, at as u32 / width);
            assert!(drawn == truth || is_gap(x, y), "pixel {x},{y} is another");
        }
    }

    /// Nothing is being checked any more; to be asked when all is drawn.
    fn has_checked(&mut self) -> bool {
        if self.checks == Checks::Unasked {
            self.checks = if self.cluster.has_checks() { Checks::Awaited } else { Checks::Finished };
            self.cluster.finish_checks();
            self.talk();
        }
        self.checks == Checks::Finished && self.front.is_finished()
    }

    /// Somebody computes wrongly: what is drawn begins again, as in the loop that draws for files.
    fn begin_again(&mut self) {
        self.cluster.cancel_all();
        self.past.clear();
        self.front.begin_again();
        self.front.set_limit(FRAMES);
        self.gaps.clear();
        self.checks = Checks::Unasked;
    }

    /// Front end and cluster talk until both have said all; how many answers there were.
    fn talk(&mut self) -> u64 {
        let mut answers = 0;
        loop {
            let questions = self.front.ask(self.cluster.room().min(1024));
            let mut is_news = !questions.is_empty();
            if is_news {
                self.cluster.ask(questions);
            }
            while let Ok(note) = self.notes.try_recv() {
                is_news = true;
                self.report(note);
            }
            while let Some(event) = self.cluster.next(Duration::ZERO) {
                is_news = true;
                answers += self.listen(event);
            }
            if !is_news {
                return answers;
            }
        }
    }

    /// A picture of the past has got an answer, or will get none.
    fn listen_to_the_past(&mut self, Asked { ticket, question }: Asked, body: Option<(Body, Cost)>) {
        let past = self.past.iter_mut().find(|past| past.state == question.world).expect("somebody has asked");
        let Some((body, cost)) = body else {
            past.front.give_up(ticket);
            past.has_gaps = true;
            return;
        };
        self.outcome.past[0] += 1;
        let absorbed = past.front.absorb(frame::Answered { ticket, body, worker: 0, cost: &cost });
        assert!(past.has_gaps || absorbed != Absorbed::Unwanted, "an answer came twice, or too late");
        if past.front.is_finished() && !past.has_gaps && self.plan.liar.is_none() {
            self.outcome.past[1] += 1;
            let truth = truth::picture(&past.scene, past.state);
            assert_eq!(past.front.show(Plane::Raw).sha256(), truth.sha256(), "a picture of the past is another");
        }
    }

    fn listen(&mut self, event: Event) -> u64 {
        match event {
            Event::Answered { asked, body, cost, .. } if asked.question.world != self.state => {
                self.listen_to_the_past(asked, Some((body, cost)));
                0
            }
            Event::Unanswered { asked, .. } if asked.question.world != self.state => {
                self.listen_to_the_past(asked, None);
                0
            }
            Event::Answered { asked: Asked { ticket, question }, body, cost, worker, .. } => {
                assert_eq!(question.world, self.state, "two revisions are mixed");
                let absorbed = self.front.absorb(frame::Answered { ticket, body, worker, cost: &cost });
                let rect = rect_of(&question);
                let is_given_up = self.gaps.contains(&rect);
                let counts = matches!(absorbed, Absorbed::Kept | Absorbed::Completed { .. });
                assert!(counts != is_given_up, "{absorbed:?}: an answer came twice, or too late");
                1
            }
            Event::Unanswered { asked: Asked { ticket, question }, reason } => {
                self.log(|| format!("given up {}: {reason}", question.ask));
                if let GivenUp::Part(rect) = self.front.give_up(ticket) {
                    self.gaps.push(rect);
                }
                0
            }
            Event::WorkerExposed { worker, reason, gave, .. } => {
                self.log(|| format!("worker {worker} is exposed: {reason}"));
                let liar = self.places.get(&WorkerId(worker.into())).and_then(|place| place.worker.as_ref());
                assert!(liar.is_some_and(|worker| worker.nature.lie.is_some()), "worker {worker} is well: {reason}");
                let lied = self.lied.expect("it is exposed by a wrong answer");
                self.outcome.found_after.get_or_insert(self.now.0 - lied.0);
                self.outcome.wrong += std::mem::take(&mut self.lies).max(1);
                if gave {
                    self.begin_again();
                }
                0
            }
            Event::Checked => {
                self.checks = Checks::Finished;
                0
            }
            _ => 0,
        }
    }

    fn report(&mut self, note: Note) {
        self.dispatcher.take(note, self.now);
        self.send_out();
    }

    /// What the dispatcher has said goes into the network.
    fn send_out(&mut self) {
        for (worker, parcel) in self.outbox.take() {
            let delay = self.delay();
            let Some(place) = self.places.get_mut(&worker) else { continue };
            let ordered = matches!(parcel, Parcel::Words(_) | Parcel::Closed);
            let arrival = place.there.arrival(self.now, place.far + delay, ordered);
            self.post_at(arrival, Happening::ToWorker(worker, parcel));
        }
    }

    fn delay(&mut self) -> u64 {
        // Now and then a packet is lost and has to be sent again.
        if self.plan.far.is_none() && self.chance.per_mille(20) {
            self.chance.between(20_000, RESENT_MAX)
        } else {
            self.chance.between(100, 5_000)
        }
    }

    fn post(&mut self, delay: u64, happening: Happening) {
        self.post_at(Moment(self.now.0 + delay), happening);
    }

    fn post_at(&mut self, at: Moment, happening: Happening) {
        self.letters += 1;
        self.mail.insert((at, self.letters), happening);
    }

    /// The next thing happens.
    fn step(&mut self) {
        let next = self.mail.first_key_value().map(|((at, _), _)| *at);
        match self.dispatcher.alarm() {
            Some(alarm) if next.is_none_or(|next| alarm <= next) => {
                self.now = self.now.max(alarm);
                self.dispatcher.wake(self.now);
                self.send_out();
            }
            _ => {
                let ((at, _), happening) = self.mail.pop_first().expect("questions wait, and nothing will happen");
                self.now = at;
                self.happen(happening);
            }
        }
        self.check();
    }

    fn check(&mut self) {
        assert!(self.mail.len() < 20_000, "messages pile up");
        let status = self.status();
        for info in &status.list {
            let near = info.threads * usize::from(HELD_PER_THREAD);
            assert!((near..=near.max(HELD_MAX)).contains(&info.places), "{info:?}");
            assert!(info.in_flight <= near.max(HELD_MAX), "{info:?} holds too much");
            if self.places.get(&WorkerId(info.worker.into())).is_some_and(|place| place.is_hit) {
                self.outcome.longest_lease = self.outcome.longest_lease.max(info.lease.as_micros() as u64);
            }
        }
        let tiles = self.places.values().filter_map(|place| place.worker.as_ref()).map(|worker| worker.longest_tile);
        self.outcome.longest_tile = self.outcome.longest_tile.max(tiles.max().unwrap_or(0));
    }

    fn status(&self) -> runtime::cluster::Status {
        self.dispatcher.post();
        self.cluster.status()
    }

    fn happen(&mut self, happening: Happening) {
        match happening {
            Happening::Join(nature, blobs, is_safe) => self.join(*nature, blobs, is_safe),
            Happening::Fault => self.fault(),
            Happening::ToMaster(worker, parcel) => self.handle_parcel(worker, parcel),
            Happening::LostByMaster(worker) => {
                self.report(Note::Report(worker, Report::Left("no word from it".into())))
            }
            Happening::LostByWorker(worker) => self.lose_master(worker),
            Happening::ToWorker(worker, parcel) => {
                let Some(place) = self.places.get_mut(&worker) else { return };
                if place.frozen_until > self.now {
                    let until = place.frozen_until;
                    return self.post_at(until, Happening::ToWorker(worker, parcel));
                }
                let deeds = place.worker.as_mut().map(|worker| worker.receive(parcel));
                self.carry_out(worker, deeds.unwrap_or_default());
            }
            Happening::Timer(worker, timer) => {
                let Some(place) = self.places.get_mut(&worker) else { return };
                if place.frozen_until > self.now {
                    let until = place.frozen_until;
                    return self.post_at(until, Happening::Timer(worker, timer));
                }
                let deeds = place.worker.as_mut().map(|worker| worker.wake(timer));
                self.carry_out(worker, deeds.unwrap_or_default());
            }
        }
    }

    fn join(&mut self, nature: Nature, blobs: Arc<BlobStore>, is_safe: bool) {
        let places_max = PLACES_MAX.max((self.plan.healthy + self.plan.silent) as usize);
        if !is_safe && self.places.values().filter(|place| place.worker.is_some()).count() >= places_max {
            return;
        }
        self.joined += 1;
        let worker = WorkerId(self.joined);
        let (threads, far, is_hit) = (nature.threads, nature.far, nature.silent_after.is_some());
        self.log(|| format!("{worker:?} joins: {nature:?}"));
        let simulated = SimulatedWorker::new(nature, blobs, self.chance.of(self.joined));
        let (there, back, frozen_until) = (Way::default(), Way::default(), Moment(0));
        self.places.insert(worker, Place { worker: Some(simulated), there, back, far, frozen_until, is_safe, is_hit });
        let link = Box::new(Far { worker, outbox: self.outbox.clone(), parts: Arc::default() });
        let name = format!("worker {}", worker.0);
        self.report(Note::Report(
            worker,
            Report::Joined { name, threads, depth: HELD_PER_THREAD, address: None, is_trusted: false, link },
        ));
    }

    fn carry_out(&mut self, worker: WorkerId, deeds: Vec<Deed>) {
        for deed in deeds {
            match deed {
                Deed::Send(parcel) => self.send_back(worker, parcel),
                Deed::Lie => {
                    self.lied.get_or_insert(self.now);
                    self.lies += u64::from(self.outcome.found_after.is_none());
                }
                Deed::Later(delay, timer) => self.post(delay, Happening::Timer(worker, timer)),
                Deed::Stop => {
                    self.send_back(worker, Parcel::Closed);
                    self.rejoin_later(worker);
                }
                Deed::Crash => {
                    self.log(|| format!("{worker:?} dies of its tile"));
                    self.post(IDLE, Happening::LostByMaster(worker));
                    self.rejoin_later(worker);
                }
            }
        }
    }

    fn send_back(&mut self, worker: WorkerId, parcel: Parcel) {
        let delay = self.delay();
        let Some(place) = self.places.get_mut(&worker) else { return };
        let ordered = matches!(parcel, Parcel::Words(_) | Parcel::Closed);
        let arrival = place.back.arrival(self.now, place.far + delay, ordered);
        self.post_at(arrival, Happening::ToMaster(worker, parcel));
    }

    /// The process starts again, or its connection: with its parts of scenes, or without.
    fn rejoin_later(&mut self, worker: WorkerId) {
        let Some(place) = self.places.get_mut(&worker) else { return };
        let (Some(simulated), is_safe) = (place.worker.take(), place.is_safe) else { return };
        let blobs = if self.chance.per_mille(500) { simulated.blobs } else { Arc::default() };
        let delay = self.chance.between(100_000, 5_000_000);
        self.post(delay, Happening::Join(Box::new(simulated.nature), blobs, is_safe));
    }

    /// A connection that was idle too long is closed without a word.
    fn lose_master(&mut self, worker: WorkerId) {
        if self.places.get(&worker).is_some_and(|place| place.worker.is_some()) {
            self.log(|| format!("{worker:?} has lost its master"));
            self.rejoin_later(worker);
        }
    }

    /// As `cluster/quic/remote_worker.rs` does it.
    fn handle_parcel(&mut self, worker: WorkerId, parcel: Parcel) {
        let round_trip = self.places.get(&worker).map_or(0, |place| place.there.usual + place.back.usual);
        let report = match parcel {
            Parcel::Words(bytes) => {
                match header(&bytes).and_then(|header| decode::<ToMaster>(header.kind, &bytes[HEADER_LEN..])) {
                    Ok(message) => Report::Received { message, _room: None },
                    Err(error) => Report::Left(format!("it talks nonsense: {error}")),
                }
            }
            Parcel::Answer(bytes) => {
                match header(&bytes).and_then(|header| Answered::decode(header.kind, &bytes[HEADER_LEN..])) {
                    Ok(Answered { id, cost, squeezed }) => {
                        let content = match decompress(&squeezed, LONGEST) {
                            Ok(packed) => Content::Packed(packed),
                            Err(error) => Content::Broken(error.to_string()),
                        };
                        Report::Answered {
                            id,
                            cost,
                            content: Box::new(content),
                            bytes: bytes.len() as u64,
                            as_it_came: Vec::new(),
                            round_trip: Duration::from_micros(round_trip),
                            _room: None,
                        }
                    }
                    Err(error) => Report::Left(format!("it sends nonsense: {error}")),
                }
            }
            Parcel::Blob(..) => Report::Left("workers send no parts".into()),
            Parcel::Closed => Report::Left("it closed the connection".into()),
        };
        self.report(Note::Report(worker, report));
    }

    /// Something goes wrong, and the next thing is planned.
    fn fault(&mut self) {
        self.outcome.faults += 1;
        let victims: Vec<_> = self
            .places
            .iter()
            .filter(|(_, place)| place.worker.is_some() && !place.is_safe)
            .map(|(id, _)| *id)
            .collect();
        let victim = victims.get(self.chance.draw(victims.len() as u64) as usize).copied();
        if let Some(place) = victim.and_then(|victim| self.places.get_mut(&victim)) {
            place.is_hit = true;
            self.check();
        }
        let kind = if self.plan.one_is_lost { [0, 1, 8][self.chance.draw(3) as usize] } else { self.chance.draw(14) };
        self.log(|| format!("fault {kind} to {victim:?}"));
        match (kind, victim) {
            (0, Some(victim)) => {
                // kill -9.
                self.post(IDLE, Happening::LostByMaster(victim));
                self.rejoin_later(victim);
            }
            (1, Some(victim)) => self.freeze(victim),
            (2..=6, Some(victim)) => self.cut(victim, kind),
            (7, Some(victim)) => {
                let deeds =
                    self.places.get_mut(&victim).and_then(|place| place.worker.as_mut()).map(SimulatedWorker::drain);
                self.carry_out(victim, deeds.unwrap_or_default());
            }
            (8, Some(victim)) => {
                if let Some(worker) = self.places.get_mut(&victim).and_then(|place| place.worker.as_mut()) {
                    worker.slow_down(10);
                }
            }
            (9, _) => self.swizzle(&victims),
            (10, _) => {
                // A peer of another version is not let in.
                let mut hello = Header { kind: Kind::Hello, length: 0 }.bytes();
                hello[4] ^= 1;
                assert!(matches!(Header::parse(hello), Err(WireError::Version { .. })));
                self.report(Note::Refused);
            }
            (11, Some(victim)) => {
                // The process ends, and the system closes its connection.
                self.send_back(victim, Parcel::Closed);
                self.rejoin_later(victim);
            }
            _ => {
                let nature = self.of_any_kind();
                self.post(0, Happening::Join(Box::new(nature), Arc::default(), false));
            }
        }
        let pause = self.chance.between(20_000, 1_000_000);
        if self.now.0 + pause < self.plan.storm {
            self.post(pause, Happening::Fault);
        }
    }

    /// SIGSTOP, and SIGCONT later.
    fn freeze(&mut self, victim: WorkerId) {
        let time = self.chance.between(10_000, 25_000_000);
        if let Some(place) = self.places.get_mut(&victim) {
            place.frozen_until = Moment(self.now.0 + time);
        }
        if time > IDLE {
            self.post(IDLE, Happening::LostByMaster(victim));
            self.post(time, Happening::LostByWorker(victim));
        }
    }

    /// A partition: towards the worker, from it, or both; short ones are only late.
    fn cut(&mut self, victim: WorkerId, kind: u64) {
        let longest = if kind < 4 { 3_000_000 } else { 30_000_000 };
        let time = self.chance.between(10_000, longest);
        let until = Moment(self.now.0 + time);
        let Some(place) = self.places.get_mut(&victim) else { return };
        let (there, back) = (kind != 3 && kind != 5, kind != 2 && kind != 4);
        if there {
            place.there.clogged_until = place.there.clogged_until.max(until);
        }
        if back {
            place.back.clogged_until = place.back.clogged_until.max(until);
        }
        if time > IDLE {
            // Who hears nothing closes silently; the other side hears nothing from then on.
            self.post(if there { IDLE } else { 2 * IDLE }, Happening::LostByWorker(victim));
            self.post(if back { IDLE } else { 2 * IDLE }, Happening::LostByMaster(victim));
        }
    }

    /// Some directions are clogged one after the other, and released in another order.
    fn swizzle(&mut self, victims: &[WorkerId]) {
        for victim in victims {
            let (there, back) = (self.chance.draw(4_000_000), self.chance.draw(4_000_000));
            let Some(place) = self.places.get_mut(victim) else { continue };
            place.there.clogged_until = place.there.clogged_until.max(Moment(self.now.0 + there));
            place.back.clogged_until = place.back.clogged_until.max(Moment(self.now.0 + back));
        }
    }

    fn log(&self, line: impl FnOnce() -> String) {
        if self.is_aloud {
            println!("{:10.3} s  {}", self.now.0 as f64 / 1e6, line());
        }
    }
}

/// Where a question is about.
pub fn rect_of(question: &Question) -> Rect {
    match &question.ask {
        Ask::Tile(tile) | Ask::Frames(Frames { tile, .. }) => tile.rect,
        Ask::Reference(samples) => samples.rect,
        Ask::Lights(_) | Ask::Rays(_) | Ask::Points(_) => Rect::default(),
    }
}

fn header(bytes: &[u8]) -> Result<Header, WireError> {
    let head = bytes.first_chunk::<HEADER_LEN>().ok_or(WireError::Magic)?;
    Header::parse(*head)
}
