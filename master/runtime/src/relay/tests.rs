//! Tests of `relay`: what it does is told by hand; there is no thread, no clock and no network.

use std::collections::BTreeMap;
use std::sync::mpsc::Receiver;
use std::sync::{Arc, Mutex};

use protocol::answer::{Body, Cost, Fields, Pixels};
use protocol::message::{Behind, ToMaster, ToWorker};
use protocol::parts::{Hash, split};
use protocol::question::{Question, WorldState};
use protocol::schedule::{Checking, HELD_PER_THREAD, Moment, QuestionId, WorkerId};
use protocol::{pack, parts};
use scenes::{Change, Needs};
use worker::blob_store::BlobStore;
use worker::engine::{Input, Output};

use super::hands::{Relay, Word};
use crate::cluster::dispatcher::{Dispatcher, Link, Note, Report};
use crate::cluster::{Cluster, Content, Known, tests as fakes};

type Heard<T> = Arc<Mutex<Vec<T>>>;

/// The way to a worker below.
struct Below(Heard<ToWorker>);

impl Link for Below {
    fn send(&mut self, message: ToWorker) -> Result<(), String> {
        self.0.lock().unwrap().push(message);
        Ok(())
    }

    fn offer(&mut self, _: &Arc<Known>) {}

    fn want(&mut self, _: Vec<Hash>) -> Result<(), String> {
        Ok(())
    }
}

struct Story {
    relay: Relay,
    dispatcher: Dispatcher,
    notes: Receiver<Note>,
    /// What the master has been told.
    up: Heard<Output>,
    /// What each worker has been told.
    down: BTreeMap<u64, Heard<ToWorker>>,
    /// The master's world.
    state: WorldState,
}

const NOW: Moment = Moment(1_000_000);

impl Story {
    /// A relay with the master's scene, and without workers.
    fn new(checking: Checking) -> Self {
        let (cluster, dispatcher, notes) = Cluster::by_hand(checking);
        let relay = Relay::new(cluster, Arc::new(BlobStore::in_memory()));
        let mut story = Self {
            relay,
            dispatcher,
            notes,
            up: Heard::default(),
            down: BTreeMap::new(),
            state: WorldState::default(),
        };
        story.begin();
        assert_eq!(story.said(), [said(behind(0, 0, 1))]);
        story.learn();
        story
    }

    fn begin(&mut self) {
        let up = Arc::clone(&self.up);
        self.relay.hear(Word::Begun(Box::new(move |output| up.lock().unwrap().push(output))));
        self.pass_on();
    }

    /// The master tells of its world, and sends what is wanted of it.
    fn learn(&mut self) {
        let (manifest, blobs) = split(&fakes::scene()).unwrap();
        let list = manifest.blob();
        self.state = WorldState { world: list.hash, revision: 0 };
        self.told(ToWorker::World { state: self.state, changes: Vec::new() });
        let mut all: BTreeMap<Hash, parts::Blob> =
            blobs.into_iter().chain([list]).map(|blob| (blob.hash, blob)).collect();
        loop {
            let said = self.said();
            let wanted: Vec<Hash> = said.iter().flat_map(|said| wanted(said).unwrap_or_default()).collect();
            if wanted.is_empty() {
                assert_eq!(said.last(), Some(&said_ready(self.state)));
                return;
            }
            for hash in wanted {
                let part = all.remove(&hash).expect("nothing is wanted twice");
                self.relay.hear(Word::Said(Input::Arrived(part)));
            }
            self.pass_on();
        }
    }

    fn told(&mut self, message: ToWorker) {
        self.relay.hear(Word::Said(Input::Received(message)));
        self.pass_on();
    }

    /// Lets everything run its course that is on its way within the relay.
    fn pass_on(&mut self) {
        loop {
            let mut is_quiet = true;
            while let Ok(note) = self.notes.try_recv() {
                self.dispatcher.take(note, NOW);
                is_quiet = false;
            }
            while let Some(event) = self.relay.cluster().next(std::time::Duration::ZERO) {
                self.relay.happened(event);
                is_quiet = false;
            }
            if is_quiet {
                self.dispatcher.post();
                let status = self.relay.cluster().status();
                self.relay.look(&status);
                return;
            }
        }
    }

    fn report(&mut self, worker: u64, report: Report) {
        self.dispatcher.take(Note::Report(WorkerId(worker), report), NOW);
        self.pass_on();
    }

    fn joins(&mut self, worker: u64, threads: u16) {
        let heard = Heard::default();
        self.down.insert(worker, Arc::clone(&heard));
        let (name, depth, link) = (format!("worker {worker}"), HELD_PER_THREAD, Box::new(Below(heard)));
        self.report(worker, Report::Joined { name, threads, depth, address: None, is_trusted: false, link });
        self.says(worker, ToMaster::Ready { state: self.state });
    }

    fn says(&mut self, worker: u64, message: ToMaster) {
        self.report(worker, Report::Received { message, _room: None });
    }

    fn leaves(&mut self, worker: u64) {
        self.report(worker, Report::Left("it is gone".into()));
    }

    fn question(&self, number: u64) -> Arc<Question> {
        Arc::clone(&fakes::questions(self.state, 3)[number as usize].question)
    }

    fn ask(&mut self, number: u64) {
        let question = self.question(number);
        self.told(ToWorker::Ask { id: QuestionId(number), question });
    }

    /// The relay's numbers of what a worker was asked since the last call.
    fn asked(&mut self, worker: u64) -> Vec<(QuestionId, Arc<Question>)> {
        let heard = std::mem::take(&mut *self.down[&worker].lock().unwrap());
        let asked = heard.into_iter().filter_map(|message| match message {
            ToWorker::Ask { id, question } => Some((id, question)),
            _ => None,
        });
        asked.collect()
    }

    fn answers(&mut self, worker: u64, id: QuestionId, packed: Vec<u8>, as_it_came: &[u8]) {
        let answered = Report::Answered {
            id,
            cost: Cost { eye_rays: 7, ..Cost::default() },
            content: Box::new(Content::Packed(packed)),
            bytes: 9,
            as_it_came: as_it_came.to_vec(),
            round_trip: std::time::Duration::ZERO,
            _room: None,
        };
        self.report(worker, answered);
    }

    /// What the master was told since the last call.
    fn said(&mut self) -> Vec<String> {
        let said = std::mem::take(&mut *self.up.lock().unwrap());
        said.into_iter().map(|output| format!("{output:?}")).collect()
    }
}

fn behind(workers: u32, threads: u16, depth: u8) -> ToMaster {
    ToMaster::Relaying(Behind { workers, threads, depth })
}

fn said(message: ToMaster) -> String {
    format!("{:?}", Output::Send(message))
}

fn said_ready(state: WorldState) -> String {
    said(ToMaster::Ready { state })
}

/// Parts in a [`ToMaster::Want`], as it is printed.
fn wanted(said: &str) -> Option<Vec<Hash>> {
    let (_, list) = said.split_once("Want { hashes: [[")?;
    let hash = |text: &str| {
        let bytes: Vec<u8> = text.split(|c: char| !c.is_ascii_digit()).filter_map(|byte| byte.parse().ok()).collect();
        Hash::try_from(bytes).unwrap()
    };
    Some(list.split("], [").map(hash).collect())
}

fn packed(question: &Question) -> Vec<u8> {
    let fields = Fields::of(&Needs::of(&fakes::scene()));
    pack::pack(question, &Body::Pixels(Pixels::black(question.ask.len())), fields)
}

#[test]
fn an_answer_goes_up_as_it_came() {
    let mut story = Story::new(Checking::default());
    story.joins(1, 2);
    assert_eq!(story.said(), [said(behind(1, 2, 1))]);
    story.ask(5);
    let [(id, question)] = &*story.asked(1) else { panic!("one question") };
    assert_eq!(*question, story.question(5));
    story.answers(1, *id, packed(question), b"as it came");
    let [answer] = &*story.said() else { panic!("one answer") };
    assert!(answer.starts_with("Answer(QuestionId(5)") && answer.contains("eye_rays: 7"), "{answer}");
    assert!(answer.contains(&format!("{:?}", b"as it came")), "{answer}");
}

#[test]
fn what_makes_no_sense_does_not_go_up_and_others_are_asked() {
    let mut story = Story::new(Checking::default());
    story.joins(1, 1);
    story.joins(2, 1);
    story.said();
    story.ask(5);
    let liar =
        if story.down[&1].lock().unwrap().iter().any(|said| matches!(said, ToWorker::Ask { .. })) { 1 } else { 2 };
    let id = story.asked(liar)[0].0;
    story.answers(liar, id, vec![1, 2, 3], b"nonsense");
    assert_eq!(story.said(), [""; 0]);
    let honest = 3 - liar;
    let (id, question) = story.asked(honest).pop().expect("the other is asked");
    story.answers(honest, id, packed(&question), b"sense");
    assert!(story.said().iter().any(|said| said.contains(&format!("{:?}", b"sense"))));
}

#[test]
fn what_nobody_can_answer_is_refused_as_far_as_the_relay_knows() {
    let mut story = Story::new(Checking::default());
    story.joins(1, 1);
    story.said();
    story.ask(5);
    for _ in 0..3 {
        let id = story.asked(1)[0].0;
        story.says(1, ToMaster::Refused { id, reason: "no such light".into() });
    }
    let said = story.said();
    assert!(said[0].contains("Refused { id: QuestionId(5)") && said[0].contains("no such light"), "{said:?}");
}

#[test]
fn a_lost_worker_is_the_relays_own_business_and_the_last_one_the_masters() {
    let mut story = Story::new(Checking::default());
    story.joins(1, 1);
    story.joins(2, 1);
    story.said();
    (0..4).for_each(|number| story.ask(number));
    let held = [story.asked(1).len(), story.asked(2).len()];
    assert_eq!(held.iter().sum::<usize>(), 4, "{held:?}");
    story.leaves(1);
    assert_eq!(story.said(), [said(behind(1, 1, 1))]);
    assert!(!story.asked(2).is_empty(), "what it held is asked of the other");
    story.leaves(2);
    // That says that nothing is held any more; nobody is blamed for it.
    assert_eq!(story.said(), [said(behind(0, 0, 1))]);
    story.ask(7);
    assert_eq!(story.said(), [""; 0], "it was sent before the master heard of it");
    story.joins(3, 1);
    assert_eq!(story.said(), [said(behind(1, 1, 1))]);
    assert!(story.asked(3).is_empty(), "what was given back is not asked any more");
}

#[test]
fn it_begins_no_more_than_its_workers_hold() {
    let mut story = Story::new(Checking::default());
    story.joins(1, 1);
    (0..40).for_each(|number| story.ask(number));
    let places = usize::from(HELD_PER_THREAD);
    assert_eq!(story.asked(1).len(), places);
    // The rest waits where the master can take it back in silence.
    story.told(ToWorker::Cancel { ids: (0..40).map(QuestionId).collect() });
    let cancelled =
        story.down[&1].lock().unwrap().iter().filter(|said| matches!(said, ToWorker::Cancel { .. })).count();
    assert_eq!(cancelled, places);
    story.said();
    story.ask(41);
    assert_eq!(story.asked(1).len(), 1);
}

#[test]
fn edits_go_down_and_a_master_that_comes_back_finds_the_scene() {
    let mut story = Story::new(Checking::default());
    story.joins(1, 1);
    story.said();
    story.down[&1].lock().unwrap().clear();
    let changes = vec![Change::Visible { object: 0, visible: false }];
    story.told(ToWorker::Changes { from: story.state, revision: 1, changes: changes.clone() });
    let heard = std::mem::take(&mut *story.down[&1].lock().unwrap());
    let [ToWorker::Changes { revision: 1, changes: told, .. }] = &*heard else { panic!("an edit: {heard:?}") };
    assert_eq!(*told, changes);
    let edited = WorldState { revision: 1, ..story.state };
    // The connection is lost, and made again.
    story.relay.hear(Word::Said(Input::Abandon));
    story.pass_on();
    story.begin();
    story.told(ToWorker::World { state: edited, changes });
    assert_eq!(story.said(), [said(behind(1, 1, 1)), said_ready(edited)]);
    assert!(story.down[&1].lock().unwrap().is_empty(), "the worker has it already");
    // The same number with another history is another world.
    story.told(ToWorker::World { state: edited, changes: Vec::new() });
    assert!(matches!(story.down[&1].lock().unwrap()[..], [ToWorker::World { .. }, ..]));
}

#[test]
fn relays_behind_it_count_with_all_who_are_behind_them() {
    let mut story = Story::new(Checking::default());
    story.joins(1, 1);
    story.joins(2, 1);
    story.says(2, behind(40, 320, 2));
    assert_eq!(story.said().pop(), Some(said(behind(41, 321, 3))));
    story.says(2, behind(0, 0, 2));
    assert_eq!(story.said().pop(), Some(said(behind(1, 1, 3))));
}

#[test]
fn a_worker_that_computes_wrongly_is_told_of_and_the_relay_begins_again() {
    let mut story = Story::new(Checking { share: 1.0, salt: 5 });
    (1..=3).for_each(|worker| story.joins(worker, 1));
    story.said();
    // It has a first question alone.
    story.ask(5);
    let asked = |story: &mut Story| {
        (1..=3).flat_map(|worker| story.asked(worker).into_iter().map(move |asked| (worker, asked))).collect::<Vec<_>>()
    };
    let mut votes: BTreeMap<u64, usize> = BTreeMap::new();
    let mut liar = None;
    for _ in 0..20 {
        for (worker, (id, question)) in asked(&mut story) {
            let liar = *liar.get_or_insert(worker);
            let mut pixels = Pixels::black(question.ask.len());
            pixels.emitted.fill(glam::Vec3::splat(if worker == liar { 2.0 } else { 1.0 }));
            let fields = Fields::of(&Needs::of(&fakes::scene()));
            let packed = pack::pack(&question, &Body::Pixels(pixels), fields);
            *votes.entry(worker).or_default() += 1;
            story.answers(worker, id, packed, b"whatever");
        }
    }
    let said = story.said();
    let retracted =
        said.iter().position(|said| said.contains("Retracted")).unwrap_or_else(|| panic!("{said:?} {votes:?}"));
    assert!(said[..retracted].iter().any(|said| said.starts_with("Answer")), "it had given something: {said:?}");
    assert!(said[retracted].contains(&format!("worker {}", liar.unwrap())), "{said:?}");
    assert!(said[retracted + 1].starts_with("Stop"), "{said:?}");
    story.begin();
    assert_eq!(story.said(), [self::said(behind(2, 2, 1))], "without the liar");
}
