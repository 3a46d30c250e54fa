//! Tests of `serve`.

use scenes::Camera;

use super::*;
use crate::question::{Ask, Lit, Quality, Rect, Tile};

const WORLD: WorldState = WorldState { world: [1; 32], revision: 0 };
const EDITED: WorldState = WorldState { world: [1; 32], revision: 1 };
const OTHER: WorldState = WorldState { world: [2; 32], revision: 0 };

fn question(world: WorldState) -> Question {
    let rect = Rect { x: 0, y: 0, width: 8, height: 8 };
    let tile =
        Tile { camera: Camera::default(), rect, lit: Lit { set: 0, frame: 0, seed: 0, quality: Quality::default() } };
    Question { world, ask: Ask::Tile(tile) }
}

fn ask(id: u64, world: WorldState) -> Event {
    Event::Received(ToWorker::Ask { id: QuestionId(id), question: question(world).into() })
}

fn world(state: WorldState) -> Event {
    Event::Received(ToWorker::World { state, changes: vec![] })
}

fn edit() -> Event {
    Event::Received(ToWorker::Changes { from: WORLD, revision: 1, changes: vec![Change::Time(1.0)] })
}

fn start(id: u64, world: WorldState) -> Action {
    Action::Start(QuestionId(id), question(world).into())
}

fn send(message: ToMaster) -> Action {
    Action::Send(message)
}

fn recall(ids: &[u64]) -> Action {
    Action::Recall(ids.iter().map(|id| QuestionId(*id)).collect())
}

/// A worker with one thread that has built [`WORLD`].
fn built() -> Serve {
    let mut serve = Serve::new(1);
    assert_eq!(serve.handle(world(WORLD)), [Action::Look(WORLD.world)]);
    let looked = Event::Looked { world: WORLD.world, missing: vec![], of: 3 };
    assert_eq!(serve.handle(looked), [Action::Build { state: WORLD, changes: vec![] }]);
    assert_eq!(serve.handle(Event::Built(WORLD)), [send(ToMaster::Ready { state: WORLD })]);
    serve
}

#[test]
fn only_what_is_missing_is_fetched() {
    let mut serve = Serve::new(1);
    serve.handle(world(WORLD));
    let manifest = Event::Looked { world: WORLD.world, missing: vec![WORLD.world], of: 0 };
    assert_eq!(serve.handle(manifest), [send(ToMaster::Want { hashes: vec![WORLD.world] })]);
    assert_eq!(serve.handle(Event::Stored(WORLD.world)), [Action::Look(WORLD.world)]);
    let parts = Event::Looked { world: WORLD.world, missing: vec![[7; 32], [8; 32]], of: 5 };
    let wanted = send(ToMaster::Want { hashes: vec![[7; 32], [8; 32]] });
    assert_eq!(serve.handle(parts), [wanted, send(ToMaster::Progress { have: 3, of: 5 })]);
    assert_eq!(serve.handle(Event::Stored([9; 32])), []);
    assert_eq!(serve.handle(Event::Stored([8; 32])), [send(ToMaster::Progress { have: 4, of: 5 })]);
    assert_eq!(serve.handle(Event::Stored([7; 32])), [Action::Look(WORLD.world)]);
}

#[test]
fn questions_wait_for_a_hand_and_the_cancelled_are_dropped() {
    let mut serve = built();
    assert_eq!(serve.handle(ask(1, WORLD)), [start(1, WORLD)]);
    assert_eq!(serve.handle(ask(2, WORLD)), [start(2, WORLD)], "lies ready");
    assert_eq!(serve.handle(ask(3, WORLD)), []);
    assert_eq!(serve.handle(ask(4, WORLD)), []);
    assert_eq!(serve.handle(ask(4, WORLD)), [], "asked again by mistake");
    let cancel = || Event::Received(ToWorker::Cancel { ids: vec![QuestionId(1), QuestionId(2), QuestionId(3)] });
    assert_eq!(serve.handle(cancel()), [recall(&[1, 2])]);
    assert_eq!(serve.handle(cancel()), [], "once is enough");
    let unbegun = Event::ThreadFailed { id: QuestionId(2), reason: "recalled".into() };
    assert_eq!(serve.handle(unbegun), [start(4, WORLD)]);
    assert_eq!(serve.handle(Event::Finished(QuestionId(1))), []);
    assert_eq!(serve.handle(Event::Finished(QuestionId(4))), [Action::Answer(QuestionId(4))]);
}

#[test]
fn another_world_is_missing() {
    let mut serve = built();
    assert_eq!(serve.handle(ask(1, OTHER)), [send(ToMaster::Missing { id: QuestionId(1) })]);
    assert_eq!(serve.handle(ask(2, EDITED)), [send(ToMaster::Missing { id: QuestionId(2) })]);
}

#[test]
fn no_answer_mixes_revisions() {
    let mut serve = built();
    serve.handle(ask(1, WORLD));
    serve.handle(ask(2, WORLD));
    let editing = Action::Edit { from: WORLD, to: EDITED, changes: vec![Change::Time(1.0)] };
    let cancel = Event::Received(ToWorker::Cancel { ids: vec![QuestionId(1), QuestionId(2)] });
    assert_eq!(serve.handle(cancel), [recall(&[1, 2])]);
    assert_eq!(serve.handle(edit()), [editing]);
    assert_eq!(serve.handle(ask(3, EDITED)), [], "waits until the revision is built");
    assert_eq!(serve.handle(Event::Finished(QuestionId(1))), [], "nobody wants the old revision");
    assert_eq!(serve.handle(Event::Finished(QuestionId(2))), []);
    assert_eq!(serve.handle(Event::Built(EDITED)), [start(3, EDITED)]);
}

#[test]
fn what_was_asked_before_an_edit_is_answered_before_it() {
    let mut serve = built();
    (1..=4).for_each(|id| drop(serve.handle(ask(id, WORLD))));
    let again = WorldState { revision: 3, ..WORLD };
    let change = |from: WorldState, revision| {
        let changes = vec![Change::Time(f64::from(revision))];
        Event::Received(ToWorker::Changes { from, revision, changes })
    };
    assert_eq!(serve.handle(change(WORLD, 1)), []);
    assert_eq!(serve.handle(ask(5, EDITED)), []);
    assert_eq!(serve.handle(ask(6, WORLD)), [send(ToMaster::Missing { id: QuestionId(6) })], "it is too late for that");
    assert_eq!(serve.handle(change(EDITED, 2)), []);
    assert_eq!(serve.handle(change(WorldState { revision: 2, ..WORLD }, 3)), []);
    assert_eq!(serve.handle(ask(7, again)), []);
    assert_eq!(serve.handle(Event::Finished(QuestionId(1))), [Action::Answer(QuestionId(1)), start(3, WORLD)]);
    let editing = Action::Edit { from: WORLD, to: EDITED, changes: vec![Change::Time(1.0)] };
    let answer = |id| Action::Answer(QuestionId(id));
    // The last has been begun: whoever carries this out waits until nobody uses the world.
    assert_eq!(serve.handle(Event::Finished(QuestionId(2))), [answer(2), start(4, WORLD), editing]);
    assert_eq!(serve.handle(Event::Finished(QuestionId(3))), [answer(3)]);
    assert_eq!(serve.handle(Event::Finished(QuestionId(4))), [answer(4)]);
    let editing = Action::Edit { from: EDITED, to: again, changes: vec![Change::Time(2.0), Change::Time(3.0)] };
    assert_eq!(serve.handle(Event::Built(EDITED)), [start(5, EDITED), editing], "nobody asks about the one between");
    assert_eq!(serve.handle(Event::Finished(QuestionId(5))), [answer(5)]);
    assert_eq!(serve.handle(Event::Built(again)), [start(7, again)]);
}

#[test]
fn edits_during_a_build_are_made_after_it() {
    let mut serve = Serve::new(1);
    serve.handle(world(WORLD));
    serve.handle(Event::Looked { world: WORLD.world, missing: vec![], of: 1 });
    assert_eq!(serve.handle(edit()), []);
    let editing = Action::Edit { from: WORLD, to: EDITED, changes: vec![Change::Time(1.0)] };
    assert_eq!(serve.handle(Event::Built(WORLD)), [editing]);
    assert_eq!(serve.handle(Event::Built(EDITED)), [send(ToMaster::Ready { state: EDITED })]);
}

#[test]
fn a_world_that_is_overtaken_is_not_announced() {
    let mut serve = Serve::new(1);
    serve.handle(world(WORLD));
    serve.handle(Event::Looked { world: WORLD.world, missing: vec![], of: 1 });
    assert_eq!(serve.handle(world(OTHER)), [Action::Look(OTHER.world)]);
    assert_eq!(serve.handle(Event::Built(WORLD)), []);
}

#[test]
fn who_is_stopped_finishes_what_is_in_hand() {
    let mut serve = built();
    for id in 1..=3 {
        serve.handle(ask(id, WORLD));
    }
    assert_eq!(
        serve.handle(Event::Drain("asked to".into())),
        [send(ToMaster::Leaving { started: vec![QuestionId(1), QuestionId(2)] })]
    );
    assert_eq!(serve.handle(ask(5, WORLD)), []);
    assert_eq!(serve.handle(Event::Finished(QuestionId(2))), [Action::Answer(QuestionId(2))]);
    let [Action::Answer(QuestionId(1)), Action::Send(ToMaster::Goodbye { .. }), Action::Stop(_)] =
        &serve.handle(Event::Finished(QuestionId(1)))[..]
    else {
        panic!("a drained worker answers, says good-bye and stops");
    };
    assert_eq!(serve.handle(ask(4, WORLD)), []);
}

#[test]
fn a_hand_that_fails_says_so_and_goes_on() {
    let mut serve = built();
    for id in 1..=3 {
        serve.handle(ask(id, WORLD));
    }
    let failure = Event::ThreadFailed { id: QuestionId(1), reason: "it hurts".into() };
    let told = send(ToMaster::Failed { id: QuestionId(1), reason: "it hurts".into() });
    assert_eq!(serve.handle(failure), [told, start(3, WORLD)]);
}

#[test]
fn a_hand_that_refuses_says_so_and_goes_on() {
    let mut serve = built();
    for id in 1..=3 {
        serve.handle(ask(id, WORLD));
    }
    let refusal = Event::ThreadRefused { id: QuestionId(1), reason: "no such point".into() };
    let told = send(ToMaster::Refused { id: QuestionId(1), reason: "no such point".into() });
    assert_eq!(serve.handle(refusal), [told, start(3, WORLD)]);
}

#[test]
fn the_queue_is_bounded() {
    let mut serve = built();
    let given = 1 + READY;
    for id in 0..(QUEUE_MAX + given) as u64 {
        serve.handle(ask(id, WORLD));
    }
    let [Action::Send(ToMaster::Failed { .. })] = &serve.handle(ask(1 << 40, WORLD))[..] else {
        panic!("one question too many must be refused");
    };
    assert_eq!(serve.len(), QUEUE_MAX + given);
}

#[test]
fn a_world_that_cannot_be_built_ends_the_connection() {
    let mut serve = Serve::new(1);
    serve.handle(world(WORLD));
    serve.handle(Event::Looked { world: WORLD.world, missing: vec![], of: 1 });
    let actions = serve.handle(Event::BuildFailed { state: WORLD, reason: "no such mesh".into() });
    let [Action::Send(ToMaster::Goodbye { reason }), Action::Stop(_)] = &actions[..] else {
        panic!("{actions:?}");
    };
    assert!(reason.contains("no such mesh"));
}

#[test]
fn who_has_threads_elsewhere_has_as_many_as_there_are() {
    let mut serve = built();
    assert_eq!(serve.handle(ask(1, WORLD)), [start(1, WORLD)]);
    // One lies ready.
    assert_eq!(serve.handle(ask(2, WORLD)), [start(2, WORLD)]);
    assert_eq!(serve.handle(ask(3, WORLD)), []);
    assert_eq!(serve.handle(Event::Resized(2)), [start(3, WORLD)]);
    serve.handle(ask(4, WORLD));
    assert_eq!(serve.handle(Event::Resized(0)), [recall(&[1, 2, 3])]);
    for id in 1..=3 {
        assert_eq!(serve.handle(Event::ThreadFailed { id: QuestionId(id), reason: "recalled".into() }), []);
    }
    assert!(serve.is_empty());
    assert_eq!(serve.handle(ask(5, WORLD)), [], "the master has been told");
    assert_eq!(serve.handle(Event::Resized(1)), []);
    assert_eq!(serve.handle(ask(1, WORLD)), [start(1, WORLD)]);
}
