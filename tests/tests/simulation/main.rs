//! The whole cluster in one thread, by seed: the real front end, cluster handle, dispatcher and schedule on the master's
//! side, the real `Serve`, store of parts and light on the workers', the real messages between them; simulated are the
//! network, the clock, and how long threads take.
//!
//! A story draws several pictures while its seed's faults happen: messages late, overtaken and doubled, directions of
//! a connection clogged one by one and released in another order, partitions both ways and one way, crashes, restarts,
//! hangs, slowness, broken answers, answers that never come, peers of another version, workers that lie about their
//! revision, edits and new scenes in mid-frame. At every step: no answer is counted twice, none is about another
//! revision, queues keep to their bounds. In the end every picture has the bits that one process gives it.
//!
//! `cargo test -p tests --test simulation -- --seeds N` tells N stories instead of 10,000, `-- --seed S` the one with that
//! seed, with all that happens in it.

mod chance;
mod network;
mod story;
mod truth;
mod worker;

use std::process::ExitCode;
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Instant;

use libtest_mimic::{Arguments, Trial};
use network::ROUND_TRIP_MAX;
use story::{Outcome, Plan, Story};
use worker::Lie;

const SEEDS: u64 = 10_000;

/// Functions as tests by their names.
macro_rules! trials {
    ($($name:ident),* $(,)?) => {
        vec![$(Trial::test(stringify!($name), || {
            $name();
            Ok(())
        })),*]
    };
}

/// As the usual harness, whose words are understood, but with two more: it would refuse them.
fn main() -> ExitCode {
    let (mut seeds, mut seed, mut others) = (None, None, Vec::new());
    let mut words = std::env::args();
    while let Some(word) = words.next() {
        let place = match word.as_str() {
            "--seeds" => &mut seeds,
            "--seed" => &mut seed,
            _ => {
                others.push(word);
                continue;
            }
        };
        let Some(number) = words.next().and_then(|number| number.parse::<u64>().ok()) else {
            eprintln!("{word} wants a number");
            return ExitCode::from(2);
        };
        *place = Some(number);
    }
    if let Some(seed) = seed {
        println!("{:?}", Story::new(seed, Plan::storm()).aloud().run());
        return ExitCode::SUCCESS;
    }
    let mut trials = trials![
        a_seed_repeats_its_story_exactly,
        a_tile_that_kills_is_given_up_and_the_rest_is_right,
        a_lost_worker_costs_at_most_a_lease_and_a_tile,
        silent_workers_cost_at_most_a_lease_and_a_tile_however_many_they_are,
        a_long_way_costs_a_picture_one_way_there_and_back,
        who_is_far_away_does_not_hold_what_others_could_do_sooner,
        who_computes_wrongly_is_found_and_the_picture_ends_in_the_right_bits,
        a_share_finds_who_is_always_wrong_before_it_does_harm,
    ];
    trials.push(Trial::test("whatever_happens_pictures_have_the_same_bits", move || {
        whatever_happens_pictures_have_the_same_bits(seeds.unwrap_or(SEEDS));
        Ok(())
    }));
    libtest_mimic::run(&Arguments::from_iter(others), trials).exit_code()
}

/// Runs a story for each seed on all cores; a seed that fails is named.
fn for_each_seed(seeds: std::ops::Range<u64>, tell: impl Fn(u64) -> Outcome + Sync) -> Vec<Outcome> {
    let (next, outcomes) = (AtomicU64::new(seeds.start), Mutex::new(Vec::new()));
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    std::thread::scope(|scope| {
        for _ in 0..cores {
            scope.spawn(|| {
                loop {
                    let seed = next.fetch_add(1, Ordering::Relaxed);
                    if seed >= seeds.end {
                        return;
                    }
                    let told = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| tell(seed)));
                    let Ok(outcome) = told else {
                        // The reason stands above.
                        eprintln!("the story of seed {seed} went wrong: cargo test -p tests --test simulation -- --seed {seed} tells it again");
                        std::process::exit(101);
                    };
                    outcomes.lock().unwrap().push(outcome);
                }
            });
        }
    });
    outcomes.into_inner().unwrap()
}

fn whatever_happens_pictures_have_the_same_bits(seeds: u64) {
    let begun = Instant::now();
    let outcomes = for_each_seed(0..seeds, |seed| Story::new(seed, Plan::storm()).run());

    let sum = |value: fn(&Outcome) -> u64| outcomes.iter().map(value).sum::<u64>();
    let longest = outcomes.iter().map(|outcome| outcome.longest_picture).max().unwrap_or(0);
    println!(
        "{seeds} stories in {:.1} s: {} faults, {} answers delivered, {} useless, {} leases expired, {} asked twice, \
         {} quarantines, {} gaps; {} answers about revisions before an edit, {} pictures of them whole; the longest picture took \
         {:.1} simulated s",
        begun.elapsed().as_secs_f64(),
        sum(|outcome| outcome.faults),
        sum(|outcome| outcome.counters.delivered),
        sum(|outcome| outcome.counters.useless),
        sum(|outcome| outcome.counters.leases_expired),
        sum(|outcome| outcome.counters.asked_twice),
        sum(|outcome| outcome.counters.quarantines),
        sum(|outcome| outcome.gaps),
        sum(|outcome| outcome.past[0]),
        sum(|outcome| outcome.past[1]),
        longest as f64 / 1e6,
    );
    assert!(sum(|outcome| outcome.past[0]) * 100 >= sum(|outcome| outcome.counters.delivered), "the past is answered");
    // A gap is right only after three deaths; storms hardly ever kill one question thrice.
    assert!(sum(|outcome| outcome.gaps) * 1000 <= sum(|outcome| outcome.counters.delivered));
}

fn a_seed_repeats_its_story_exactly() {
    for seed in 0..30 {
        let tell = || Story::new(seed, Plan::storm()).run();
        assert_eq!(tell(), tell(), "seed {seed}");
    }
}

/// A tile that kills whoever touches it costs three workers and its place in the picture; nothing else.
fn a_tile_that_kills_is_given_up_and_the_rest_is_right() {
    for_each_seed(0..200, |seed| {
        let outcome = Story::new(seed, Plan::poisoned()).run();
        assert!(outcome.gaps > 0, "seed {seed}");
        outcome
    });
}

/// One of three workers dies, hangs or slows down at any moment: compared with the two others alone, that costs at
/// most the longest lease and one tile.
fn a_lost_worker_costs_at_most_a_lease_and_a_tile() {
    let mut costs = costs_beyond_two(0..600, Plan::one_is_lost());
    println!("a lost worker of three costs {}", spread(&mut costs));
}

/// Workers that are connected, take questions and never answer, or not for long: however many they are, two who
/// answer draw the picture.
fn silent_workers_cost_at_most_a_lease_and_a_tile_however_many_they_are() {
    for silent in [1, 2, 5, 12] {
        let mut costs = costs_beyond_two(0..150, Plan::many_are_silent(silent));
        println!("{silent} silent workers beside two others cost {}", spread(&mut costs));
    }
}

/// Workers far away hold what lies on the way: a picture takes as much longer as its first question and its last answer,
/// not as all its questions one after the other.
fn a_long_way_costs_a_picture_one_way_there_and_back() {
    const FAR: u64 = 50_000;
    let costs = Mutex::new(Vec::new());
    for_each_seed(0..300, |seed| {
        let near = Story::new(seed, Plan::far(3, 0, 0)).run();
        let far = Story::new(seed, Plan::far(3, 3, FAR)).run();
        let cost = far.last_picture.saturating_sub(near.last_picture);
        costs.lock().unwrap().push(cost);
        far
    });
    let mut costs = costs.into_inner().unwrap();
    println!("50 ms each way cost a picture {}", spread(&mut costs));
    assert!(costs[costs.len() / 2] <= 2 * FAR * 5 / 4 && costs[costs.len() * 99 / 100] <= 4 * FAR);
}

/// Beside two next door, a worker far away takes no part in a picture that they have drawn before it could answer.
fn who_is_far_away_does_not_hold_what_others_could_do_sooner() {
    let costs = Mutex::new(Vec::new());
    for_each_seed(0..300, |seed| {
        let alone = Story::new(seed, Plan::far(2, 0, 0)).run();
        let joined = Story::new(seed, Plan::far(3, 1, 200_000)).run();
        let cost = joined.last_picture.saturating_sub(alone.last_picture);
        costs.lock().unwrap().push(cost);
        joined
    });
    let mut costs = costs.into_inner().unwrap();
    println!("a worker 200 ms away beside two others costs {}", spread(&mut costs));
    assert!(costs[costs.len() / 2] <= 10_000 && costs[costs.len() * 99 / 100] <= 100_000);
}

/// Of four workers one computes wrongly, and all answers are checked: it is found soon after it was wrong for the first
/// time, nobody else is suspected, and every picture has the right bits.
fn who_computes_wrongly_is_found_and_the_picture_ends_in_the_right_bits() {
    // One answer of a thousand: seven stories of eight have none, and some of them is to be said about many.
    for (lie, stories) in [(Lie::Flips(1), 900), (Lie::Flips(50), 150), (Lie::OtherBuild, 150), (Lie::OtherFrame, 150)]
    {
        let outcomes = for_each_seed(0..stories, |seed| Story::new(seed, Plan::one_lies(lie, 1.0)).run());
        let mut found: Vec<_> = outcomes.iter().filter_map(|outcome| outcome.found_after).collect();
        let lied = outcomes.iter().filter(|outcome| outcome.wrong > 0).count();
        println!("{lie:?}: found in {} of {lied} stories, after {}", found.len(), spread(&mut found));
        // One that comes when another's has been taken is looked at by nobody.
        assert!(found.len() + lied / 50 >= lied, "{} of {lied}", found.len());
        assert!(found.last().is_none_or(|longest| *longest <= FOUND_WITHIN), "{found:?}");
    }
}

/// Where all is checked: what it holds is answered, a second worker asked, and a third, with packets sent again.
const FOUND_WITHIN: u64 = 3_000_000;

/// With a hundredth of all answers checked, who is always wrong is found by its first ones.
fn a_share_finds_who_is_always_wrong_before_it_does_harm() {
    for lie in [Lie::OtherBuild, Lie::OtherFrame] {
        let outcomes = for_each_seed(0..150, |seed| Story::new(seed, Plan::one_lies(lie, 0.01)).run());
        let wrong: u64 = outcomes.iter().map(|outcome| outcome.wrong_pictures).sum();
        let mut found: Vec<_> = outcomes.iter().filter_map(|outcome| outcome.found_after).collect();
        let lied = outcomes.iter().filter(|outcome| outcome.wrong > 0).count();
        println!("{lie:?}, 1 % checked: found in {} of {lied} stories, after {}", found.len(), spread(&mut found));
        assert_eq!((found.len(), wrong), (lied, 0));
        assert!(found.last().is_none_or(|longest| *longest <= FOUND_WITHIN), "{found:?}");
    }
}

/// What a picture takes longer than one that two healthy workers draw alone, by seed, microseconds.
fn costs_beyond_two(seeds: std::ops::Range<u64>, plan: Plan) -> Vec<u64> {
    let costs = Mutex::new(Vec::new());
    for_each_seed(seeds, |seed| {
        let alone = Story::new(seed, Plan::calm(2)).run();
        let outcome = Story::new(seed, plan.clone()).run();
        if outcome.longest_lease == 0 {
            // The picture was complete before anything happened.
            return outcome;
        }
        let cost = outcome.longest_picture.saturating_sub(alone.longest_picture);
        let bound = outcome.longest_lease + outcome.longest_tile + ROUND_TRIP_MAX;
        assert!(cost <= bound, "seed {seed}: it cost {cost} µs where a lease and a tile (and its way) are {bound} µs");
        costs.lock().unwrap().push(cost);
        outcome
    });
    costs.into_inner().unwrap()
}

/// Median, 99th hundredth and greatest, in words.
fn spread(micros: &mut [u64]) -> String {
    micros.sort_unstable();
    let at = |percent: usize| micros[(micros.len() - 1) * percent / 100] as f64 / 1e3;
    format!("{:.0} ms (median), {:.0} ms (p99), {:.0} ms at most", at(50), at(99), at(100))
}
