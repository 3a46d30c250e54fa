//! A worker of a story: the real manners and the real store of parts; how long it takes, and what is wrong with it, is made up.

use std::collections::{BTreeMap, VecDeque};
use std::sync::Arc;

use protocol::answer::Cost;
use protocol::message::{Answered, HEADER_LEN, Header, ToMaster, ToWorker, decode, encode};
use protocol::pack;
use protocol::parts::Blob;
use protocol::question::{Ask, Frames, Question, Rect, WorldState};
use protocol::schedule::QuestionId;
use protocol::serve::{Action, Event, QUEUE_MAX, Serve};
use scenes::{Change, Scene};
use worker::blob_store::BlobStore;
use worker::engine::Store;

use super::chance::Chance;
use super::network::Parcel;
use super::story::rect_of;
use super::truth;

/// What a worker is like.
#[derive(Clone, Debug)]
pub struct Nature {
    pub threads: u16,
    /// Every tile takes so many times as long.
    pub slowness: u64,
    /// Of a thousand answers, so many are broken …
    pub breaks: u64,
    /// … never sent …
    pub loses: u64,
    /// … refused with a word …
    pub fails: u64,
    /// … or sent twice.
    pub doubles: u64,
    /// Says that it is ready before it is, for this revision and for another.
    pub lies: bool,
    /// Dies of every tile of this rectangle.
    pub poison: Option<Rect>,
    /// Forgets its world once in a thousand questions so many times.
    pub forgets: u64,
    /// Every message takes so much longer each way, microseconds.
    pub far: u64,
    /// Says nothing more after so many answers, but stays connected.
    pub silent_after: Option<u64>,
    /// Computes wrongly.
    pub lie: Option<Lie>,
}

/// How a worker computes wrongly.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Lie {
    /// In so many of a thousand answers a bit has flipped.
    Flips(u64),
    /// It is of another build: all bits may be others.
    OtherBuild,
    /// It answers about the next frame.
    OtherFrame,
}

/// What happens to a worker later.
#[derive(Clone, Debug)]
pub enum Timer {
    Finished(QuestionId),
    Built(WorldState, Arc<Scene>),
}

/// What a worker does.
pub enum Deed {
    Send(Parcel),
    /// What follows is wrong.
    Lie,
    /// After so many microseconds.
    Later(u64, Timer),
    Stop,
    Crash,
}

pub struct SimulatedWorker {
    serve: Serve,
    pub blobs: Arc<BlobStore>,
    pub nature: Nature,
    chance: Chance,
    world: Option<(WorldState, Arc<Scene>)>,
    busy: BTreeMap<QuestionId, Arc<Question>>,
    /// What lies ready for whoever is first done.
    ready: VecDeque<(QuestionId, Arc<Question>)>,
    /// What a thread has just finished, until `serve` has said whether anybody wants it.
    fresh: Option<Arc<Question>>,
    /// The world that was asked for last.
    wanted: Option<WorldState>,
    /// An edit that waits until no thread is busy.
    edit: Option<(WorldState, Vec<Change>)>,
    /// A tile of the smallest rectangle, microseconds.
    tile: u64,
    pub longest_tile: u64,
    answers: u64,
}

impl SimulatedWorker {
    pub fn new(nature: Nature, blobs: Arc<BlobStore>, mut chance: Chance) -> Self {
        let tile = chance.between(3_000, 12_000) * nature.slowness;
        let serve = Serve::new(usize::from(nature.threads));
        Self {
            serve,
            blobs,
            nature,
            chance,
            world: None,
            busy: BTreeMap::new(),
            ready: VecDeque::new(),
            fresh: None,
            wanted: None,
            edit: None,
            tile,
            longest_tile: 0,
            answers: 0,
        }
    }

    /// A parcel from the master.
    pub fn receive(&mut self, parcel: Parcel) -> Vec<Deed> {
        match parcel {
            Parcel::Words(bytes) => {
                let head = bytes[..HEADER_LEN].try_into().expect("a header");
                let header = Header::parse(head).expect("the master speaks our version");
                let message: ToWorker =
                    decode(header.kind, &bytes[HEADER_LEN..]).expect("the master's words are sound");
                let mut deeds = self.lie(&message);
                if matches!(message, ToWorker::Ask { .. }) && self.chance.per_mille(self.nature.forgets) {
                    // As after a restart that its connection outlives.
                    self.serve = Serve::new(usize::from(self.nature.threads));
                    (self.world, self.wanted, self.edit) = (None, None, None);
                    self.busy.clear();
                    self.ready.clear();
                }
                deeds.extend(self.handle(Event::Received(message)));
                deeds
            }
            Parcel::Blob(hash, bytes) => {
                self.blobs.put(Blob { hash, bytes: bytes.to_vec() }).expect("memory takes it");
                self.handle(Event::Stored(hash))
            }
            Parcel::Answer(_) | Parcel::Closed => vec![Deed::Stop],
        }
    }

    fn lie(&self, message: &ToWorker) -> Vec<Deed> {
        let ToWorker::World { state, .. } = message else { return Vec::new() };
        if !self.nature.lies {
            return Vec::new();
        }
        let other = WorldState { revision: state.revision + 1, ..*state };
        [*state, other].map(|state| Deed::Send(message_of(&ToMaster::Ready { state }))).into()
    }

    pub fn wake(&mut self, timer: Timer) -> Vec<Deed> {
        match timer {
            Timer::Finished(id) if !self.busy.contains_key(&id) => Vec::new(),
            Timer::Finished(id) if self.chance.per_mille(self.nature.fails) => {
                self.busy.remove(&id);
                self.handle(Event::ThreadFailed { id, reason: "by chance".into() })
            }
            Timer::Finished(id) => {
                self.fresh = self.busy.remove(&id);
                self.handle(Event::Finished(id))
            }
            Timer::Built(state, _) if self.wanted != Some(state) => Vec::new(),
            Timer::Built(state, scene) => {
                self.world = Some((state, scene));
                self.handle(Event::Built(state))
            }
        }
    }

    /// Every tile takes so many times as long from now on.
    pub fn slow_down(&mut self, times: u64) {
        self.tile *= times;
    }

    fn is_deadly(&self, question: &Question) -> bool {
        self.nature.poison == Some(rect_of(question))
    }

    pub fn drain(&mut self) -> Vec<Deed> {
        self.handle(Event::Drain("asked to".into()))
    }

    fn handle(&mut self, event: Event) -> Vec<Deed> {
        let mut deeds = Vec::new();
        for action in self.serve.handle(event) {
            self.carry_out(action, &mut deeds);
        }
        while self.busy.len() < usize::from(self.nature.threads)
            && let Some((id, question)) = self.ready.pop_front()
        {
            self.begin(id, question, &mut deeds);
        }
        assert!(self.ready.len() <= 1, "more than one question lies ready");
        assert!(self.serve.len() <= QUEUE_MAX + usize::from(self.nature.threads) + self.ready.len());
        if self.busy.is_empty()
            && let Some((from, scene)) = &self.world
            && let Some((to, changes)) = self.edit.take()
        {
            assert_eq!(from.world, to.world);
            deeds.push(Deed::Later(2_000, Timer::Built(to, edited(scene, &changes))));
        }
        deeds
    }

    fn carry_out(&mut self, action: Action, deeds: &mut Vec<Deed>) {
        match action {
            Action::Send(message) => deeds.push(Deed::Send(message_of(&message))),
            Action::Look(world) => {
                let (missing, of) = self.blobs.look(&world);
                deeds.extend(self.handle(Event::Looked { world, missing, of }));
            }
            Action::Build { state, changes } => {
                (self.world, self.edit, self.wanted) = (None, None, Some(state));
                let scene = self.blobs.scene(&state.world).expect("all parts are there");
                let time = self.chance.between(5_000, 200_000) * self.nature.slowness;
                deeds.push(Deed::Later(time, Timer::Built(state, edited(&scene, &changes))));
            }
            Action::Edit { to, changes, .. } => (self.edit, self.wanted) = (Some((to, changes)), Some(to)),
            Action::Start(id, question) => self.ready.push_back((id, question)),
            Action::Recall(ids) => {
                for id in ids {
                    let unbegun = self.ready.len();
                    self.ready.retain(|(ready, _)| *ready != id);
                    if self.ready.len() < unbegun {
                        deeds.extend(self.handle(Event::ThreadFailed { id, reason: "recalled".into() }));
                    }
                }
            }
            Action::Answer(id) => {
                let question = self.fresh.take().expect("it has just been finished");
                self.answer(id, &question, deeds);
            }
            Action::Stop(_) => deeds.push(Deed::Stop),
        }
    }

    fn begin(&mut self, id: QuestionId, question: Arc<Question>, deeds: &mut Vec<Deed>) {
        if self.is_deadly(&question) {
            return deeds.push(Deed::Crash);
        }
        let time = self.tile + self.chance.draw(self.tile);
        self.longest_tile = self.longest_tile.max(time);
        let (state, _) = self.world.as_ref().expect("there is a world");
        assert_eq!(*state, question.world, "a worker answers about another revision");
        self.busy.insert(id, question);
        deeds.push(Deed::Later(time, Timer::Finished(id)));
    }

    fn answer(&mut self, id: QuestionId, question: &Question, deeds: &mut Vec<Deed>) {
        let (_, scene) = self.world.as_ref().expect("it answers about its world");
        let right = truth::answer(scene, question);
        let mut squeezed = match self.nature.lie {
            Some(lie) => lie.instead_of(&right, scene, question, &mut self.chance),
            None => right.to_vec(),
        };
        if squeezed[..] != right[..] {
            deeds.push(Deed::Lie);
        }
        if self.chance.per_mille(self.nature.loses) {
            return;
        }
        self.answers += 1;
        if self.nature.silent_after.is_some_and(|last| self.answers > last) {
            return;
        }
        if self.chance.per_mille(self.nature.breaks) {
            // Cut, or of a hostile length: what the codec must notice by itself.
            match self.chance.draw(3) {
                0 => squeezed.truncate(squeezed.len() * 2 / 3),
                1 => squeezed[..4].fill(0xff),
                _ => squeezed.clear(),
            }
        }
        let bytes = Answered { id, cost: Cost::default(), squeezed }.encode();
        for _ in 0..1 + u32::from(self.chance.per_mille(self.nature.doubles)) {
            deeds.push(Deed::Send(Parcel::Answer(bytes.clone())));
        }
    }
}

impl Lie {
    /// A wrong answer; the right one in between, if only some are wrong.
    fn instead_of(self, right: &[u8], scene: &Arc<Scene>, question: &Question, chance: &mut Chance) -> Vec<u8> {
        let mut other = question.clone();
        let lit = match &mut other.ask {
            Ask::Tile(tile) | Ask::Frames(Frames { tile, .. }) => Some(&mut tile.lit),
            _ => None,
        };
        match (self, lit) {
            (Self::OtherBuild, Some(lit)) => lit.seed += 1,
            (Self::OtherFrame, Some(lit)) => lit.frame += 1,
            (Self::Flips(share), _) if chance.per_mille(share) => {
                let packed = pack::decompress(right, truth::LONGEST).expect("it was just compressed");
                // One that is no answer any more is refused at once: who flips such a bit is not found, and does no harm.
                loop {
                    let (mut flipped, bit) = (packed.clone(), chance.draw(8 * packed.len() as u64));
                    flipped[bit as usize / 8] ^= 1 << (bit % 8);
                    if truth::is_sound(scene, question, &flipped) {
                        return pack::compress(&flipped);
                    }
                }
            }
            _ => return right.to_vec(),
        }
        truth::answer(scene, &other).to_vec()
    }
}

fn message_of(message: &ToMaster) -> Parcel {
    Parcel::Words(encode(message).expect("words fit"))
}

fn edited(scene: &Arc<Scene>, changes: &[Change]) -> Arc<Scene> {
    let mut scene = Arc::clone(scene);
    changes.iter().for_each(|change| change.apply(Arc::make_mut(&mut scene)).expect("the edit is sound"));
    scene
}
