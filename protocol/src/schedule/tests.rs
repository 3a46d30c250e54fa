//! Tests of `schedule`.

use scenes::Camera;

use super::*;
use crate::question::{Lit, Quality, Rect, Ticket, Tile};

const WORLD: WorldState = WorldState { world: [1; 32], revision: 0 };
const EDITED: WorldState = WorldState { world: [1; 32], revision: 1 };
const W0: WorkerId = WorkerId(0);
const W1: WorkerId = WorkerId(1);

fn at_ms(ms: u64) -> Moment {
    Moment(ms * 1000)
}

fn tile_of(world: WorldState, frame: u32, set: u16, x: u32) -> Asked {
    let rect = Rect { x, y: 0, width: 8, height: 8 };
    let tile = Tile { camera: Camera::default(), rect, lit: Lit { set, frame, seed: 0, quality: Quality::default() } };
    Asked::new(Ticket::default(), Question { world, ask: Ask::Tile(tile) })
}

fn tile(set: u16, x: u32) -> Asked {
    tile_of(WORLD, 0, set, x)
}

/// A schedule whose workers 0 … n−1, of one thread and depth one, are ready.
fn schedule_with(workers: u64) -> Schedule {
    let mut schedule = Schedule::default();
    schedule.handle(Event::World { state: WORLD, edit: false }, at_ms(0));
    for worker in (0..workers).map(WorkerId) {
        join(&mut schedule, worker, at_ms(0));
    }
    schedule
}

fn join(schedule: &mut Schedule, worker: WorkerId, now: Moment) -> Vec<Action> {
    schedule.handle(Event::Joined { worker, threads: 1, depth: 1, trusted: false }, now);
    schedule.handle(Event::Ready { worker, state: schedule.state() }, now)
}

fn sent(actions: &[Action]) -> Vec<(WorkerId, QuestionId)> {
    let send = |action: &Action| match action {
        Action::Send { worker, id, .. } => Some((*worker, *id)),
        _ => None,
    };
    actions.iter().filter_map(send).collect()
}

fn answered(worker: WorkerId, id: QuestionId) -> Event {
    Event::Answered { worker, id, micros: 1000, round_trip: 0, digest: 0 }
}

fn delivered(actions: &[Action]) -> usize {
    actions.iter().filter(|action| matches!(action, Action::Deliver { .. })).count()
}

fn given_up(actions: &[Action]) -> usize {
    actions.iter().filter(|action| matches!(action, Action::GiveUp { .. })).count()
}

const Q0: QuestionId = QuestionId(0);
const Q1: QuestionId = QuestionId(1);

#[test]
fn a_worker_who_leaves_gives_its_question_back() {
    let mut schedule = schedule_with(2);
    assert_eq!(sent(&schedule.handle(Event::Asked(vec![tile(0, 0)]), at_ms(1))), [(W0, Q0)]);
    assert_eq!(sent(&schedule.handle(Event::Left { worker: W0 }, at_ms(2))), [(W1, Q0)]);
    assert_eq!(delivered(&schedule.handle(answered(W1, Q0), at_ms(3))), 1);
}

#[test]
fn only_those_who_are_called_are_asked() {
    let mut schedule = schedule_with(3);
    schedule.handle(Event::Called(Some(vec![W1])), at_ms(0));
    join(&mut schedule, WorkerId(3), at_ms(0));
    let [q2, q3] = [2, 3].map(QuestionId);
    let ask = Event::Asked((0..4).map(|x| tile(0, x)).collect());
    assert_eq!(sent(&schedule.handle(ask, at_ms(1))), [(W1, Q0)]);
    assert_eq!(sent(&schedule.handle(answered(W1, Q0), at_ms(2))), [(W1, Q1)]);
    let all = [(W0, q2), (WorkerId(2), q3)];
    assert_eq!(sent(&schedule.handle(Event::Called(None), at_ms(3))), all);
}

#[test]
fn only_those_who_hold_the_world_are_asked() {
    let mut schedule = Schedule::default();
    let joined = schedule.handle(Event::Joined { worker: W0, threads: 1, depth: 1, trusted: false }, at_ms(0));
    assert_eq!(joined, []);
    assert_eq!(schedule.handle(Event::World { state: WORLD, edit: false }, at_ms(0)), [Action::Teach(W0)]);
    assert_eq!(schedule.handle(Event::Asked(vec![tile(0, 0)]), at_ms(1)), []);
    assert_eq!(sent(&schedule.handle(Event::Ready { worker: W0, state: WORLD }, at_ms(2))), [(W0, Q0)]);
}

#[test]
fn an_edit_cancels_what_is_open_and_updates_the_workers() {
    let mut schedule = schedule_with(1);
    schedule.handle(Event::Asked(vec![tile(0, 0), tile(0, 1)]), at_ms(1));
    let actions = schedule.handle(Event::World { state: EDITED, edit: true }, at_ms(2));
    assert_eq!(actions, [Action::Cancel { worker: W0, ids: vec![Q0] }, Action::Update(W0)]);
    assert_eq!(delivered(&schedule.handle(answered(W0, Q0), at_ms(3))), 0, "two revisions would be mixed");
    assert_eq!(given_up(&schedule.handle(Event::Asked(vec![tile(0, 0)]), at_ms(4))), 1, "asked of the old revision");
    assert_eq!(sent(&schedule.handle(Event::Asked(vec![tile_of(EDITED, 0, 0, 0)]), at_ms(5))).len(), 1);
}

/// Five questions, of which two have a place, and an edit behind them; who holds which.
fn edited_behind() -> (Schedule, Vec<(WorkerId, QuestionId)>) {
    let mut schedule = schedule_with(2);
    let mut held = sent(&schedule.handle(Event::Asked((0..5).map(|x| tile(0, x)).collect()), at_ms(1)));
    assert_eq!(held.len(), 2);
    let actions = schedule.handle(Event::Edited { state: EDITED }, at_ms(2));
    held.extend(sent(&actions));
    let is_update = |action: &Action| matches!(action, Action::Update(_));
    let updates = actions.iter().position(is_update).expect("workers are told");
    assert!(actions[updates..].iter().filter(|action| is_update(action)).count() == 2);
    assert!(actions[..updates].iter().all(|action| matches!(action, Action::Send { .. })), "{actions:?}");
    (schedule, held)
}

#[test]
fn an_edit_behind_what_is_open_is_told_after_that_is_handed_out() {
    let (mut schedule, held) = edited_behind();
    assert_eq!(held.len(), 5, "over their places");
    let of = |worker| held.iter().filter(|(holder, _)| *holder == worker).count();
    assert!(of(W0).abs_diff(of(W1)) == 1, "each takes its share");
    assert_eq!(sent(&schedule.handle(Event::Asked(vec![tile_of(EDITED, 0, 0, 0)]), at_ms(3))), [], "they are full");
    assert_eq!(given_up(&schedule.handle(Event::Asked(vec![tile(0, 9)]), at_ms(3))), 1, "of the past nothing is asked");
    let mut asked = Vec::new();
    for (worker, id) in held {
        let actions = schedule.handle(answered(worker, id), at_ms(4));
        assert_eq!(delivered(&actions), 1);
        asked.extend(sent(&actions));
    }
    assert_eq!(asked.len(), 1, "the new one");
}

#[test]
fn what_is_of_the_past_is_asked_of_nobody_else() {
    let (mut schedule, held) = edited_behind();
    let lost = held.iter().filter(|(worker, _)| *worker == W1).count();
    let actions = schedule.handle(Event::Left { worker: W1 }, at_ms(5));
    assert_eq!((given_up(&actions), sent(&actions).len()), (lost, 0));
    // The other is silent: however long, nobody is asked in its place, and its lease ends it.
    join(&mut schedule, W1, at_ms(6));
    let mut ended = 0;
    for s in 1..100 {
        let actions = schedule.handle(Event::Woke, at_ms(1000 * s));
        assert_eq!(sent(&actions), []);
        ended += given_up(&actions);
    }
    assert_eq!((ended, schedule.open_len()), (held.len() - lost, 0));
}

#[test]
fn an_answer_counts_once_and_only_from_those_who_were_asked() {
    let mut schedule = schedule_with(2);
    schedule.handle(Event::Asked(vec![tile(0, 0)]), at_ms(1));
    assert_eq!(delivered(&schedule.handle(answered(W1, Q0), at_ms(2))), 0, "nobody has asked it");
    assert_eq!(delivered(&schedule.handle(answered(W0, Q0), at_ms(2))), 1);
    assert_eq!(delivered(&schedule.handle(answered(W0, Q0), at_ms(2))), 0);
    assert_eq!(schedule.counters().useless, 2);
}

#[test]
fn idle_hands_ask_the_slowest_question_again_and_the_loser_is_cancelled() {
    let mut schedule = schedule_with(2);
    schedule.handle(Event::Asked(vec![tile(0, 0), tile(1, 0)]), at_ms(0));
    let actions = schedule.handle(answered(W1, Q1), at_ms(10));
    assert!(actions.contains(&Action::WakeAt(at_ms(20))), "{actions:?}");
    assert_eq!(sent(&schedule.handle(Event::Woke, at_ms(20))), [(W1, Q0)]);
    let actions = schedule.handle(answered(W1, Q0), at_ms(30));
    assert!(actions.contains(&Action::Cancel { worker: W0, ids: vec![Q0] }));
    assert_eq!(delivered(&actions), 1);
}

#[test]
fn a_lease_ends_and_the_late_answer_is_still_good() {
    let mut schedule = schedule_with(1);
    let actions = schedule.handle(Event::Asked(vec![tile(0, 0)]), at_ms(0));
    let Some(Action::WakeAt(lease)) = actions.last() else { panic!("no alarm for the lease") };
    let actions = schedule.handle(Event::Woke, *lease);
    assert_eq!(sent(&actions), [(W0, Q0)], "there is nobody else to ask");
    assert_eq!(schedule.workers().next().unwrap().1.state, WorkerState::Slow);
    assert_eq!(delivered(&schedule.handle(answered(W0, Q0), Moment(lease.0 + 5))), 1);
    assert_eq!(schedule.workers().next().unwrap().1.state, WorkerState::Ready);
    assert_eq!(schedule.counters().leases_expired, 1);
}

#[test]
fn a_question_that_kills_three_workers_is_given_up_and_the_rest_is_answered() {
    let mut schedule = schedule_with(1);
    schedule.handle(Event::Asked(vec![tile(0, 0), tile(0, 1)]), at_ms(1));
    for dead in 0..2 {
        schedule.handle(Event::Left { worker: WorkerId(dead) }, at_ms(2));
        assert_eq!(sent(&join(&mut schedule, WorkerId(dead + 1), at_ms(2))), [(WorkerId(dead + 1), Q0)]);
    }
    assert_eq!(given_up(&schedule.handle(Event::Left { worker: WorkerId(2) }, at_ms(3))), 1);
    assert_eq!(sent(&join(&mut schedule, WorkerId(3), at_ms(4))), [(WorkerId(3), Q1)]);
}

#[test]
fn polite_leave_blames_no_question() {
    let mut schedule = schedule_with(1);
    schedule.handle(Event::Asked(vec![tile(0, 0)]), at_ms(1));
    for gone in (0..5).map(WorkerId) {
        schedule.handle(Event::Leaving { worker: gone, started: vec![Q0] }, at_ms(2));
        assert_eq!(given_up(&schedule.handle(Event::Left { worker: gone }, at_ms(2))), 0);
        join(&mut schedule, WorkerId(gone.0 + 1), at_ms(3));
    }
    assert_eq!(schedule.open_len(), 1);
}

fn failed(worker: WorkerId, id: QuestionId) -> Event {
    Event::Failed { worker, id, reason: "no".into() }
}

fn state_of(schedule: &Schedule, worker: WorkerId) -> WorkerState {
    schedule.workers().find(|(id, _)| *id == worker).expect("it is there").1.state
}

#[test]
fn a_question_that_failed_goes_to_another_worker_first() {
    let mut schedule = schedule_with(2);
    schedule.handle(Event::Asked(vec![tile(0, 0), tile(1, 0)]), at_ms(1));
    // Its thread is free, but others have not tried.
    assert_eq!(sent(&schedule.handle(failed(W0, Q0), at_ms(2))), []);
    assert_eq!(sent(&schedule.handle(answered(W1, Q1), at_ms(3))), [(W1, Q0)]);
    assert_eq!(delivered(&schedule.handle(answered(W1, Q0), at_ms(4))), 1);
}

#[test]
fn a_question_is_not_given_up_because_one_worker_says_thrice_that_it_failed() {
    let mut schedule = schedule_with(2);
    schedule.handle(Event::Asked(vec![tile(0, 0), tile(1, 0)]), at_ms(1));
    for ms in 2..6 {
        assert_eq!(given_up(&schedule.handle(failed(W0, Q0), at_ms(ms))), 0);
    }
    assert_eq!(delivered(&schedule.handle(answered(W0, Q0), at_ms(6))), 0, "who failed is not heard about it any more");
    assert_eq!(sent(&schedule.handle(answered(W1, Q1), at_ms(7))), [(W1, Q0)]);
    assert_eq!(delivered(&schedule.handle(answered(W1, Q0), at_ms(8))), 1);
}

fn refused(worker: WorkerId, id: QuestionId) -> Event {
    Event::Refused { worker, id, reason: "there is no such point".into() }
}

#[test]
fn what_all_refuse_is_given_up_and_nobody_is_blamed() {
    // Alone, among two, among more than have to agree.
    for workers in [1, 2, 5] {
        let mut schedule = schedule_with(workers);
        for round in 0..u64::from(STRIKES_MAX) * 2 {
            let mut actions = schedule.handle(Event::Asked(vec![tile(0, 0)]), at_ms(round));
            let mut reason = None;
            while reason.is_none() {
                let [(worker, id)] = sent(&actions)[..] else { panic!("{actions:?}") };
                actions = schedule.handle(refused(worker, id), at_ms(round));
                reason = actions.iter().find_map(|action| match action {
                    Action::GiveUp { reason, .. } => Some(reason.clone()),
                    _ => None,
                });
            }
            assert!(reason.unwrap_or_default().ends_with("refused: there is no such point"));
        }
        assert_eq!((schedule.open_len(), schedule.counters().quarantines), (0, 0));
        assert!((0..workers).all(|worker| state_of(&schedule, WorkerId(worker)) == WorkerState::Ready));
    }
}

#[test]
fn who_refuses_what_others_answer_is_asked_nothing_for_a_while() {
    let mut schedule = schedule_with(2);
    let mut now = 0;
    while state_of(&schedule, W0) == WorkerState::Ready {
        now += 1;
        assert!(now < 100, "a liar goes on for ever");
        let mut actions = schedule.handle(Event::Asked(vec![tile(0, 0), tile(1, 0)]), at_ms(now));
        while schedule.open_len() > 0 {
            let news: Vec<_> = sent(&actions);
            actions = news
                .into_iter()
                .flat_map(|(worker, id)| {
                    let event = if worker == W0 { refused(worker, id) } else { answered(worker, id) };
                    schedule.handle(event, at_ms(now))
                })
                .collect();
        }
    }
    assert_eq!(state_of(&schedule, W0), WorkerState::Quarantined);
    assert_eq!(schedule.counters().given_up, 0);
}

/// Silent workers with small numbers, then one that answers.
#[test]
fn a_question_that_failed_does_not_go_to_the_same_silent_worker_for_ever() {
    let mut schedule = schedule_with(3);
    let [w2, w3] = [2, 3].map(WorkerId);
    schedule.handle(Event::Asked((0..3).map(|x| tile(x, 0)).collect()), at_ms(1));
    schedule.handle(answered(w2, QuestionId(2)), at_ms(2));
    schedule.handle(Event::Left { worker: w2 }, at_ms(2));
    join(&mut schedule, w3, at_ms(3));
    schedule.handle(Event::Asked(vec![tile(3, 0)]), at_ms(3));
    schedule.handle(failed(w3, QuestionId(3)), at_ms(4));
    // 0 and 1 never say a word; whatever waits comes to who does, in a few leases.
    let mut now = 5;
    while schedule.open_len() > 0 {
        for id in schedule.workers[&w3].oldest() {
            schedule.handle(answered(w3, id), at_ms(now));
        }
        now += 10;
        schedule.handle(Event::Woke, at_ms(now));
        assert!(now < 65_000, "{:?}", schedule.open);
    }
}

#[test]
fn silent_workers_do_not_keep_a_question_from_one_that_answers() {
    // Four have never said a word, and will not; a fifth has.
    let mut schedule = schedule_with(4);
    schedule.handle(Event::Asked((0..4).map(|x| tile(x, 0)).collect()), at_ms(0));
    schedule.handle(Event::Woke, at_ms(20));
    let w4 = WorkerId(4);
    join(&mut schedule, w4, at_ms(30));
    schedule.handle(Event::Asked(vec![tile(4, 0)]), at_ms(30));
    schedule.handle(answered(w4, QuestionId(4)), at_ms(60));
    let mut now = 60;
    while schedule.open_len() > 0 {
        now += 10;
        schedule.handle(Event::Woke, at_ms(now));
        for id in schedule.workers[&w4].oldest() {
            schedule.handle(answered(w4, id), at_ms(now));
        }
        assert!(now < 500, "they wait for the leases of the silent");
    }
    assert_eq!(schedule.counters().leases_expired, 0);
}

/// Its questions are answered by the other before a lease runs out, frame after frame.
#[test]
fn somebody_dead_does_not_slow_every_frame() {
    let mut schedule = schedule_with(2);
    schedule.handle(Event::Asked(vec![tile(0, 0), tile(1, 0)]), at_ms(0));
    schedule.handle(answered(W0, Q0), at_ms(30));
    schedule.handle(answered(W1, Q1), at_ms(30));
    // From now on 0 is dead. Each frame has one question that it could be asked first.
    let (mut now, mut to_the_dead) = (30, 0);
    for frame in 1..=50 {
        let mut actions =
            schedule.handle(Event::Asked(vec![tile_of(WORLD, frame, 0, 0), tile_of(WORLD, frame, 1, 0)]), at_ms(now));
        while schedule.open_len() > 0 {
            to_the_dead += sent(&actions).iter().filter(|(worker, _)| *worker == W0).count();
            now += 10;
            let held = schedule.workers[&W1].oldest();
            actions = held.into_iter().flat_map(|id| schedule.handle(answered(W1, id), at_ms(now))).collect();
            actions.extend(schedule.handle(Event::Woke, at_ms(now)));
        }
    }
    let seconds = now as usize / 1000 + 1;
    assert!(to_the_dead <= usize::from(RACES_MAX) + seconds, "{to_the_dead} questions in {seconds} s");
    assert_eq!(state_of(&schedule, W0), WorkerState::Slow);
    assert_eq!(schedule.counters().leases_expired, 0);
}

#[test]
fn the_first_lease_is_that_of_the_slowest_other() {
    let mut schedule = schedule_with(1);
    assert_eq!(schedule.workers().next().unwrap().1.lease_micros, LEASE_UNKNOWN);
    schedule.handle(Event::Asked(vec![tile(0, 0)]), at_ms(0));
    schedule.handle(answered(W0, Q0), at_ms(500));
    join(&mut schedule, W1, at_ms(600));
    assert_eq!(schedule.workers().last().unwrap().1.lease_micros, LEASE_FACTOR * 500_000);
}

#[test]
fn a_question_that_kills_takes_no_innocent_one_along() {
    let mut schedule = Schedule::default();
    schedule.handle(Event::World { state: WORLD, edit: false }, at_ms(0));
    schedule.handle(Event::Asked((0..40).map(|x| tile(0, x)).collect()), at_ms(0));
    let mut given_up_in_all = 0;
    for worker in (0..20).map(WorkerId) {
        let now = at_ms(10 * worker.0);
        schedule.handle(Event::Joined { worker, threads: 4, depth: 3, trusted: false }, now);
        schedule.handle(Event::Ready { worker, state: WORLD }, now);
        // It answers in any order until it comes to the seventh question, which kills it.
        while let Some(held) = schedule.workers[&worker].oldest().last().copied()
            && !schedule.workers[&worker].in_flight.is_empty()
        {
            if schedule.workers[&worker].oldest().contains(&QuestionId(7)) {
                given_up_in_all += given_up(&schedule.handle(Event::Left { worker }, now));
                break;
            }
            schedule.handle(answered(worker, held), now);
        }
    }
    assert_eq!((given_up_in_all, schedule.open_len()), (1, 0));
    assert_eq!(schedule.counters().delivered, 39);
}

#[test]
fn who_fails_again_and_again_is_asked_nothing_for_a_while_and_others_take_over() {
    let mut schedule = schedule_with(1);
    schedule.handle(Event::Asked((0..9).map(|x| tile(0, x)).collect()), at_ms(1));
    while state_of(&schedule, W0) != WorkerState::Quarantined {
        let held = schedule.workers[&W0].oldest()[0];
        schedule.handle(failed(W0, held), at_ms(2));
        assert!(schedule.counters().given_up <= 1);
    }
    let status = schedule.workers().next().unwrap().1;
    assert!(status.reason.unwrap().contains("again and again: no"));
    assert_eq!(schedule.workers[&W0].room(at_ms(9_000)), 0);

    // After ten seconds it is tried with one question, and fails; then it is left alone for twice as long.
    let actions = schedule.handle(Event::Woke, at_ms(10_002));
    let [(W0, tried)] = sent(&actions)[..] else { panic!("it is not tried: {actions:?}") };
    schedule.handle(failed(W0, tried), at_ms(10_003));
    assert_eq!(sent(&schedule.handle(Event::Woke, at_ms(30_002))), []);
    assert_eq!(sent(&schedule.handle(Event::Woke, at_ms(30_003))).len(), 1);

    // Another takes what is there meanwhile, and an answer makes the first as good as new.
    assert_eq!(sent(&join(&mut schedule, W1, at_ms(30_004))).len(), 1);
    let held = schedule.workers[&W0].oldest()[0];
    schedule.handle(answered(W0, held), at_ms(30_005));
    assert_eq!(state_of(&schedule, W0), WorkerState::Ready);
    assert_eq!(schedule.counters().quarantines, 2);
}

#[test]
fn the_first_worker_that_is_ready_answers_while_others_still_prepare() {
    let mut schedule = schedule_with(0);
    for worker in [W0, W1] {
        schedule.handle(Event::Joined { worker, threads: 1, depth: 1, trusted: false }, at_ms(0));
    }
    schedule.handle(Event::Asked(vec![tile(0, 0), tile(0, 1)]), at_ms(1));
    assert_eq!(sent(&schedule.handle(Event::Ready { worker: W1, state: WORLD }, at_ms(2))), [(W1, Q0)]);
    assert_eq!(sent(&schedule.handle(answered(W1, Q0), at_ms(3))), [(W1, Q1)]);
    assert_eq!(state_of(&schedule, W0), WorkerState::Preparing);
}

#[test]
fn a_worker_that_lost_its_world_is_taught_again_once() {
    let mut schedule = Schedule::default();
    schedule.handle(Event::World { state: WORLD, edit: false }, at_ms(0));
    schedule.handle(Event::Joined { worker: W0, threads: 2, depth: 1, trusted: false }, at_ms(0));
    schedule.handle(Event::Ready { worker: W0, state: WORLD }, at_ms(0));
    schedule.handle(Event::Asked(vec![tile(0, 0), tile(0, 1)]), at_ms(1));
    let missing = |id| Event::Missing { worker: W0, id };
    assert!(schedule.handle(missing(Q0), at_ms(2)).contains(&Action::Teach(W0)));
    assert!(!schedule.handle(missing(Q1), at_ms(2)).contains(&Action::Teach(W0)));
    assert_eq!(sent(&schedule.handle(Event::Ready { worker: W0, state: WORLD }, at_ms(3))).len(), 2);
}

#[test]
fn too_many_questions_are_refused() {
    let mut schedule = schedule_with(0);
    let questions = vec![tile(0, 0); OPEN_MAX + 3];
    assert_eq!(given_up(&schedule.handle(Event::Asked(questions), at_ms(0))), 3);
}

/// Runs whole frames of 9 sets with equal workers, and says how many distinct sets a worker met in a frame.
fn sets_per_worker(workers: u64, frames: u32, tiles: u32) -> f64 {
    let mut schedule = Schedule::default();
    schedule.handle(Event::World { state: WORLD, edit: false }, at_ms(0));
    for worker in (0..workers).map(WorkerId) {
        schedule.handle(Event::Joined { worker, threads: 1, depth: 3, trusted: false }, at_ms(0));
        schedule.handle(Event::Ready { worker, state: WORLD }, at_ms(0));
    }
    let ask = |frame| Event::Asked((0..tiles * 9).map(|i| tile_of(WORLD, frame, (i % 9) as u16, i)).collect());
    // Every worker answers its oldest question each 10 ms; the next frame is asked when half of this one is there.
    let mut asked = 0;
    let mut now = 0;
    while schedule.counters().delivered < u64::from(frames * tiles * 9) {
        let half_way = u64::from(asked * tiles * 9).saturating_sub(u64::from(tiles * 9 / 2));
        if asked < frames && schedule.counters().delivered >= half_way {
            schedule.handle(ask(asked), at_ms(now));
            asked += 1;
        }
        now += 10;
        for worker in (0..workers).map(WorkerId) {
            if let Some(id) = schedule.workers[&worker].oldest().first().copied() {
                schedule.handle(answered(worker, id), at_ms(now));
            }
        }
        assert!(now < 1_000_000, "{workers} workers never end");
    }
    let counters = schedule.counters();
    counters.sets_begun as f64 / counters.shares as f64
}

/// The paper met about 2 distinct sets a client and frame. With 9 sets nobody can meet fewer than 9 over
/// the number of workers.
#[test]
fn a_worker_meets_few_sets() {
    for (workers, most) in [(1, 9.0), (2, 5.0), (3, 3.0), (4, 3.0), (6, 2.0), (8, 1.7), (9, 1.0), (16, 1.3), (64, 1.2)]
    {
        let mean = sets_per_worker(workers, 20, 35);
        assert!(mean <= most, "{workers} workers met {mean:.2} sets each in a frame, {most} wanted");
    }
}

/// Of which frames the questions are that workers are sent when all of these are asked.
fn frames_sent(schedule: &mut Schedule, questions: Vec<Asked>) -> Vec<(WorkerId, u32)> {
    let frame = |action: &Action| match action {
        Action::Send { worker, question, .. } => match &question.ask {
            Ask::Tile(tile) => Some((*worker, tile.lit.frame)),
            _ => None,
        },
        _ => None,
    };
    schedule.handle(Event::Asked(questions), at_ms(9)).iter().filter_map(frame).collect()
}

/// One light set in each of two frames.
fn two_frames(first: u32) -> Vec<Asked> {
    [first, first + 1].into_iter().flat_map(|frame| (0..16).map(move |x| tile_of(WORLD, frame, 0, 8 * x))).collect()
}

#[test]
fn no_set_is_made_twice_while_there_are_others_to_begin() {
    let mut schedule = schedule_with(2);
    let actions = schedule.handle(Event::Asked(vec![tile(0, 0)]), at_ms(1));
    let (worker, id) = sent(&actions)[0];
    schedule.handle(answered(worker, id), at_ms(2));
    let sent = frames_sent(&mut schedule, two_frames(1));
    assert_eq!(sent, [(W0, 1), (W1, 2)]);
    assert_eq!(schedule.counters().sets_begun, 3);
}

#[test]
fn the_first_frame_is_shared_before_the_next_is_begun() {
    let mut schedule = schedule_with(2);
    assert_eq!(frames_sent(&mut schedule, two_frames(0)), [(W0, 0), (W1, 0)]);
    // So it is after everything was cancelled.
    schedule.handle(Event::CancelledAll, at_ms(10));
    assert_eq!(frames_sent(&mut schedule, two_frames(7)), [(W0, 7), (W1, 7)]);
}

#[test]
fn a_relay_has_as_much_room_as_it_says_and_gives_back_what_it_has_none_for() {
    let mut schedule = schedule_with(1);
    schedule.handle(Event::Relays { worker: W0, threads: 3 }, at_ms(1));
    let ask = Event::Asked((0..5).map(|x| tile(0, x)).collect());
    assert_eq!(sent(&schedule.handle(ask, at_ms(1))).len(), 3);
    schedule.handle(Event::Relays { worker: W0, threads: 0 }, at_ms(2));
    assert_eq!(schedule.workers().next().map(|(_, status)| status.in_flight), Some(0));
    // None of them is suspected: five are asked of somebody else at once.
    schedule.handle(Event::Joined { worker: W1, threads: 5, depth: 1, trusted: false }, at_ms(3));
    let ready = Event::Ready { worker: W1, state: WORLD };
    assert_eq!(sent(&schedule.handle(ready, at_ms(3))).iter().filter(|(worker, _)| *worker == W1).count(), 5);
}

#[test]
fn nobody_is_blamed_for_the_end_of_a_relay() {
    let mut schedule = schedule_with(0);
    schedule.handle(Event::Asked(vec![tile(0, 0)]), at_ms(1));
    for relay in (1..=u64::from(DEATHS_MAX) + 2).map(WorkerId) {
        let asked = sent(&join(&mut schedule, relay, at_ms(2)));
        assert_eq!(asked, [(relay, Q0)]);
        schedule.handle(Event::Relays { worker: relay, threads: 2 }, at_ms(3));
        assert_eq!(given_up(&schedule.handle(Event::Left { worker: relay }, at_ms(4))), 0);
    }
    assert_eq!(sent(&join(&mut schedule, W0, at_ms(5))), [(W0, Q0)]);
    assert_eq!(delivered(&schedule.handle(answered(W0, Q0), at_ms(6))), 1);
}

#[test]
fn what_is_cancelled_by_ticket_ends_and_all_else_goes_on() {
    let mut schedule = schedule_with(1);
    let ticket = |slot| Ticket { batch: 7, slot };
    let ask = |slot| Asked { ticket: ticket(slot), ..tile(0, slot) };
    schedule.handle(Event::Asked((0..4).map(ask).collect()), at_ms(1));
    let ended = schedule.handle(Event::Cancelled([ticket(0), ticket(2), ticket(9)].into()), at_ms(2));
    assert!(ended.contains(&Action::Cancel { worker: W0, ids: vec![Q0] }), "{ended:?}");
    assert_eq!(sent(&ended), [(W0, Q1)]);
    assert_eq!(delivered(&schedule.handle(answered(W0, Q0), at_ms(3))), 0);
    let last = schedule.handle(answered(W0, Q1), at_ms(4));
    assert_eq!((delivered(&last), sent(&last)), (1, vec![(W0, QuestionId(3))]), "the third was cancelled");
}

#[test]
fn who_takes_back_what_it_gave_is_asked_no_more_and_all_is_to_be_made_again() {
    let mut schedule = schedule_with(2);
    schedule.handle(Event::Asked(vec![tile(0, 0)]), at_ms(1));
    let actions = schedule.handle(Event::Retracted { worker: W0, reason: "behind it".into() }, at_ms(2));
    // Though nothing of it was delivered since it joined.
    assert!(actions.contains(&Action::Expose { worker: W0, reason: "behind it".into(), gave: true }), "{actions:?}");
    assert_eq!(sent(&actions), [(W1, Q0)]);
    assert_eq!(delivered(&schedule.handle(answered(W0, Q0), at_ms(3))), 0, "it was under way");
    assert_eq!(delivered(&schedule.handle(answered(W1, Q0), at_ms(4))), 1);
}
