//! Rows 40 and 42: workers that die, answers that are late, doubled or out of order, and scenes that are
//! edited a hundred times a second. The real schedule, the real worker's manners, the real codec, in one
//! thread and in virtual time.

use std::collections::{BTreeMap, BTreeSet};

use frame::{Absorbed, Answered, Filter, FrontEnd, Igi, Plane, Setup};
use glam::Vec3;
use protocol::answer::{Body, Cost, Fields, Pixels};
use protocol::message::{ToMaster, ToWorker};
use protocol::pack;
use protocol::question::{Asked, Quality, Question, WorldState};
use protocol::schedule::{Action, Event, Moment, QuestionId, Schedule, WorkerId};
use protocol::serve::{self, Serve};
use scenes::{Camera, Needs};

use crate::case::{Case, Finding, Method, Pace};
use crate::worlds::glass;

/// The cases.
pub const CASES: &[Case] = &[
    Case {
        row: 40,
        name: "faults",
        teaches: "a worker that is killed, one that joins, late, doubled and reordered answers change no bit",
        pace: Pace::Quick,
        methods: &[Method::Machinery],
        run: |_| faults(),
    },
    Case {
        row: 42,
        name: "edit-storm",
        teaches: "at a hundred edits a second no stale tile is shown, and no queue grows",
        pace: Pace::Quick,
        methods: &[Method::Machinery],
        run: |_| edit_storm(),
    },
];

/// What is in flight.
enum Letter {
    ToWorker(WorkerId, ToWorker),
    ToMaster(WorkerId, ToMaster),
    Done(WorkerId, serve::Event),
    Answer(WorkerId, QuestionId, Vec<u8>),
    Join(WorkerId),
    Kill(WorkerId),
    Wake,
}

/// A master and its workers.
struct Play<'a> {
    schedule: Schedule,
    front: Igi,
    workers: BTreeMap<WorkerId, Serve>,
    /// Answers that threads have finished and not yet sent.
    finished: BTreeMap<(WorkerId, QuestionId), Vec<u8>>,
    mail: BTreeMap<(u64, u64), Letter>,
    /// When the last letter to a worker arrives: messages to one worker keep their order.
    arrivals: BTreeMap<WorkerId, u64>,
    now: u64,
    letters: u64,
    /// Answers arrive late, twice and out of order.
    rough: bool,
    answer: &'a dyn Fn(&Question) -> Vec<u8>,
    fields: Fields,
    seen: Seen,
}

/// What must not happen, and how large things became.
#[derive(Default)]
struct Seen {
    stale: usize,
    broken: usize,
    given_up: usize,
    delivered: BTreeSet<QuestionId>,
    doubled: usize,
    open_max: usize,
    worker_max: usize,
    mail_max: usize,
}

/// Questions that may wait for workers.
const WAITING_MAX: usize = 256;
/// Threads of each worker.
const THREADS: u16 = 2;

impl<'a> Play<'a> {
    fn new(setup: Setup, rough: bool, answer: &'a dyn Fn(&Question) -> Vec<u8>) -> Self {
        let fields = setup.fields;
        let state = setup.world;
        let mut play = Self {
            schedule: Schedule::default(),
            front: Igi::new(setup),
            workers: BTreeMap::new(),
            finished: BTreeMap::new(),
            mail: BTreeMap::new(),
            arrivals: BTreeMap::new(),
            now: 0,
            letters: 0,
            rough,
            answer,
            fields,
            seen: Seen::default(),
        };
        play.feed(Event::World { state, edit: false });
        play
    }

    /// A number below `below`, by seed and turn.
    fn draw(&self, salt: u64, below: u64) -> u64 {
        let mixed = light::sample::mix((self.letters as u32).wrapping_mul(31).wrapping_add(salt as u32));
        u64::from(mixed) % below
    }

    fn post(&mut self, delay: u64, letter: Letter) {
        self.letters += 1;
        self.mail.insert((self.now + delay, self.letters), letter);
    }

    fn feed(&mut self, event: Event) {
        for action in self.schedule.handle(event, Moment(self.now)) {
            self.carry_out(action);
        }
        self.seen.open_max = self.seen.open_max.max(self.schedule.open_len());
        self.seen.mail_max = self.seen.mail_max.max(self.mail.len());
    }

    fn send(&mut self, worker: WorkerId, message: ToWorker) {
        let earliest = self.arrivals.get(&worker).copied().unwrap_or(0);
        let at = earliest.max(self.now + 200);
        self.arrivals.insert(worker, at);
        self.post(at - self.now, Letter::ToWorker(worker, message));
    }

    fn carry_out(&mut self, action: Action) {
        let state = self.schedule.state();
        match action {
            Action::Teach(worker) => self.send(worker, ToWorker::World { state, changes: Vec::new() }),
            Action::Update(worker) => {
                let from = WorldState { revision: state.revision - 1, ..state };
                self.send(worker, ToWorker::Changes { from, revision: state.revision, changes: Vec::new() });
            }
            Action::Send { worker, id, question } => self.send(worker, ToWorker::Ask { id, question }),
            Action::Cancel { worker, ids } => self.send(worker, ToWorker::Cancel { ids }),
            Action::GiveUp { .. } => self.seen.given_up += 1,
            Action::WakeAt(at) => self.post(at.0.saturating_sub(self.now), Letter::Wake),
            // Deliveries are handled where the answer is at hand.
            _ => {}
        }
    }

    fn handle_worker(&mut self, worker: WorkerId, event: serve::Event) {
        let Some(serve) = self.workers.get_mut(&worker) else { return };
        let actions = serve.handle(event);
        self.seen.worker_max = self.seen.worker_max.max(serve.len());
        for action in actions {
            match action {
                serve::Action::Send(message) => self.post(200, Letter::ToMaster(worker, message)),
                serve::Action::Look(world) => {
                    self.post(1, Letter::Done(worker, serve::Event::Looked { world, missing: Vec::new(), of: 1 }));
                }
                serve::Action::Build { state, .. } => self.post(5000, Letter::Done(worker, serve::Event::Built(state))),
                serve::Action::Edit { to, .. } => self.post(500, Letter::Done(worker, serve::Event::Built(to))),
                serve::Action::Start(id, question) => {
                    let packed = (self.answer)(&question);
                    self.finished.insert((worker, id), packed);
                    let time = 1000 + self.draw(1, if self.rough { 8000 } else { 1 });
                    self.post(time, Letter::Done(worker, serve::Event::Finished(id)));
                }
                serve::Action::Answer(id) => {
                    let packed = self.finished.remove(&(worker, id)).unwrap_or_default();
                    if self.rough && self.draw(2, 4) == 0 {
                        self.post(30_000, Letter::Answer(worker, id, packed.clone()));
                    }
                    let delay = if self.rough { self.draw(3, 40_000) } else { 200 };
                    self.post(delay, Letter::Answer(worker, id, packed));
                }
                // Its threads begin at once.
                serve::Action::Recall(_) | serve::Action::Stop(_) => {}
            }
        }
    }

    fn receive(&mut self, worker: WorkerId, id: QuestionId, packed: &[u8]) {
        let event = Event::Answered { worker, id, micros: 1000, round_trip: 400, digest: 0 };
        let actions = self.schedule.handle(event, Moment(self.now));
        for action in actions {
            let Action::Deliver { id, asked: Asked { ticket, question }, worker } = action else {
                self.carry_out(action);
                continue;
            };
            self.seen.doubled += usize::from(!self.seen.delivered.insert(id));
            self.seen.stale += usize::from(question.world != self.schedule.state());
            let raw = pack::decompress(packed, pack::packed_len_max(&question.ask)).unwrap_or_default();
            match pack::unpack(&question, &raw, self.fields) {
                Ok(body) => {
                    let (worker, cost) = (worker.0 as u32, &Cost::default());
                    let absorbed = self.front.absorb(Answered { ticket, body, worker, cost });
                    self.seen.stale += usize::from(absorbed == Absorbed::Unwanted);
                }
                Err(_) => self.seen.broken += 1,
            }
        }
    }

    fn step(&mut self) -> bool {
        let room = WAITING_MAX.saturating_sub(self.schedule.open_len());
        let questions = self.front.ask(room);
        if !questions.is_empty() {
            self.feed(Event::Asked(questions));
        }
        let Some(((at, _), letter)) = self.mail.pop_first() else { return false };
        self.now = at;
        match letter {
            Letter::ToWorker(worker, message) => self.handle_worker(worker, serve::Event::Received(message)),
            Letter::Done(worker, event) => self.handle_worker(worker, event),
            Letter::ToMaster(worker, message) => match message {
                ToMaster::Ready { state } => self.feed(Event::Ready { worker, state }),
                ToMaster::Missing { id } => self.feed(Event::Missing { worker, id }),
                ToMaster::Failed { id, reason } => self.feed(Event::Failed { worker, id, reason }),
                ToMaster::Refused { id, reason } => self.feed(Event::Refused { worker, id, reason }),
                _ => {}
            },
            Letter::Answer(worker, id, packed) => self.receive(worker, id, &packed),
            Letter::Join(worker) => {
                self.workers.insert(worker, Serve::new(usize::from(THREADS)));
                self.feed(Event::Joined { worker, threads: THREADS, depth: 2, trusted: false });
            }
            Letter::Kill(worker) => {
                self.workers.remove(&worker);
                self.feed(Event::Left { worker });
            }
            Letter::Wake => self.feed(Event::Woke),
        }
        true
    }

    /// Plays until all frames are made, or nothing happens any more.
    fn finish(&mut self) {
        while !self.front.is_finished() && self.step() {}
    }

    fn hash(&mut self) -> [u8; 32] {
        self.front.show(Plane::Raw).sha256()
    }
}

fn faults() -> Vec<Finding> {
    let scene = glass::ball_in_a_box(1.5)[1].clone();
    let quality = Quality { light_samples: 4, vpls: 8, photons: 200, ..Quality::default() };
    let fields = Fields::of(&Needs::of(&scene));
    let camera = Camera { width: 48, height: 32, ..scene.camera };
    let (prepared, cache) = (light::Prepared::new(scene), light::LightSetCache::default());
    let answer = |question: &Question| {
        let mut answer = light::answer(&prepared, &cache, question, &|| 0);
        pack::drop_unsound(&mut answer.body);
        pack::compress(&pack::pack(question, &answer.body, fields))
    };
    let setup = Setup { world: WorldState::default(), camera, quality, fields, seed: 5, filter: Filter::OFF };
    let frames = 3;

    let mut calm = Play::new(setup.clone(), false, &answer);
    calm.front.set_limit(frames);
    calm.post(0, Letter::Join(WorkerId(0)));
    calm.finish();

    let mut storm = Play::new(setup, true, &answer);
    storm.front.set_limit(frames);
    for (at, worker) in [(0, 1), (100, 2), (60_000, 3)] {
        storm.post(at, Letter::Join(WorkerId(worker)));
    }
    storm.post(40_000, Letter::Kill(WorkerId(1)));
    storm.finish();

    let complete = [&calm, &storm].iter().filter(|play| play.front.frames() == frames).count();
    vec![
        Finding::exact("runs that were completed", 2.0, complete as f64, 0.0),
        Finding::holds("the pictures are the same bits", calm.hash() == storm.hash()),
        Finding::none("answers used twice", storm.seen.doubled),
        Finding::none("broken answers", storm.seen.broken),
        Finding::none("questions given up", storm.seen.given_up),
    ]
}

fn edit_storm() -> Vec<Finding> {
    let quality = Quality { interleave: [3, 3], ..Quality::default() };
    let fields = Fields { emitted: true, surface: false };
    let camera = Camera { width: 96, height: 64, ..Camera::default() };
    // Each revision has a colour of its own, so that a stale tile would be seen.
    let answer = |question: &Question| {
        let mut pixels = Pixels::black(question.ask.len());
        pixels.emitted.fill(Vec3::splat(1.0 + question.world.revision as f32));
        pack::compress(&pack::pack(question, &Body::Pixels(pixels), fields))
    };
    let setup = |world| Setup { world, camera, quality, fields, seed: 5, filter: Filter::OFF };
    let mut world = WorldState::default();
    let mut play = Play::new(setup(world), true, &answer);
    play.post(0, Letter::Join(WorkerId(1)));
    play.post(0, Letter::Join(WorkerId(2)));
    let edits = 300;
    let (mut mixed, mut shown) = (0, 0);
    for edit in 1..=edits {
        // A hundred edits a second, and now and then a breath in which frames are completed.
        let until = play.now + if edit % 30 == 0 { 400_000 } else { 10_000 };
        while play.now < until && play.step() {}
        mixed += mixed_pixels(&mut play, world);
        shown += usize::from(play.front.frames() > 0);
        world.revision += 1;
        play.front.restart(setup(world));
        play.feed(Event::World { state: world, edit: true });
    }
    play.front.set_limit(1);
    play.finish();
    mixed += mixed_pixels(&mut play, world);
    let calm = play.front.frames() == 1;
    let seen = &play.seen;
    let most = |what: &str, got: usize, most: usize| {
        Finding::holds(format!("{what} stays below {most}"), got <= most).note(format!("at most {got}"))
    };
    vec![
        Finding::none("stale tiles delivered", seen.stale),
        Finding::none("pixels of another revision shown", mixed),
        Finding::holds("frames are completed in between", shown >= 10).note(format!("of {shown} revisions")),
        Finding::holds("the last revision is drawn after the storm", calm),
        most("number of open questions", seen.open_max, WAITING_MAX),
        most("number of questions at one worker", seen.worker_max, 64),
        most("number of letters in flight", seen.mail_max, 4 * WAITING_MAX),
    ]
}

/// Pixels of the picture that have another colour than this revision's.
fn mixed_pixels(play: &mut Play, world: WorldState) -> usize {
    if play.front.frames() == 0 {
        return 0;
    }
    let own = 1.0 + world.revision as f32;
    play.front.show(Plane::Raw).pixels.iter().filter(|pixel| **pixel != Vec3::splat(own)).count()
}
