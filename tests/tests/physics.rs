//! Light against closed forms, and the machinery against chaos: the quick cases of the table that
//! `igi-master selftest` prints, one test a part of it. The slow ones are `igi-master selftest --long`.

use std::time::Instant;

use cases::worlds::{emitters, furnaces};
use cases::{Case, Effort, Exact, Method, Pace, Trial, Verdict, rows};
use protocol::question::Quality;

/// Runs the quick cases among these; fails with a line for each finding that is not as it should be.
fn check(cases: &[Case], effort: Effort) {
    let mut wrong = Vec::new();
    for case in cases.iter().filter(|case| case.pace == Pace::Quick) {
        for method in case.methods {
            // The reference takes its time.
            let effort = if *method == Method::Reference { Effort::Brief } else { effort };
            let began = Instant::now();
            let clock = || began.elapsed().as_micros() as u64;
            let findings = (case.run)(&Trial { method: *method, effort, threads: 1, clock: &clock, stop: &|| false });
            eprintln!("{} {} {}: {:.1} s", case.row, case.name, method.name(), began.elapsed().as_secs_f64());
            assert!(!findings.is_empty(), "{}: found nothing", case.name);
            for finding in findings {
                let verdict = case.judge(*method, &finding);
                if !verdict.is_fine() {
                    wrong.push(format!("{} ({}): {verdict:?}: {finding:?}", case.name, method.name()));
                }
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn closed_rooms() {
    check(rows::closed_rooms::CASES, Effort::Brief);
}

#[test]
fn emitters_and_skies() {
    check(rows::emitters::CASES, Effort::Brief);
}

#[test]
fn glass_and_mirrors() {
    check(rows::glass::CASES, Effort::Brief);
}

#[test]
fn highlights_of_lights_without_surface() {
    check(rows::highlights::CASES, Effort::Brief);
}

#[test]
fn edges_of_numbers() {
    check(rows::edges::CASES, Effort::Thorough);
}

#[test]
fn pictures_and_wire() {
    check(rows::pictures::CASES, Effort::Thorough);
}

#[test]
fn broken_files() {
    check(rows::files::CASES, Effort::Thorough);
}

#[test]
fn faults_and_edits() {
    check(rows::faults::CASES, Effort::Thorough);
}

#[test]
fn hunted() {
    check(rows::hunted::CASES, Effort::Thorough);
}

#[test]
fn coverage() {
    check(rows::coverage::CASES, Effort::Brief);
}

#[test]
fn suns() {
    check(rows::suns::CASES, Effort::Brief);
}

#[test]
fn luminaires() {
    check(rows::luminaires::CASES, Effort::Brief);
}

#[test]
fn relief() {
    check(rows::relief::CASES, Effort::Brief);
}

/// A test that cannot fail proves nothing: a biased picture must not pass for the right one.
#[test]
fn a_biased_mode_fails_where_it_is_held_to_the_truth() {
    let corner = furnaces::furnace_corner(0.7);
    let trial = Trial { method: Method::Bounded, effort: Effort::Thorough, threads: 1, clock: &|| 0, stop: &|| false };
    assert_eq!(trial.exact(&corner).verdict(), Verdict::Wrong);
}

/// What shines, brighter or dimmer by a factor; what is expected stays.
fn faulty(mut exact: Exact, factor: f32) -> Exact {
    exact.scene.materials.iter_mut().for_each(|material| material.emission.value *= factor);
    exact
}

/// The self-test as people run it is coarser than the strictest one, and still no row may be wrong by two per cent.
#[test]
fn two_per_cent_of_light_too_much_or_too_little_are_found() {
    for method in Method::LIGHT {
        let trial = Trial { method: *method, effort: Effort::Usual, threads: 1, clock: &|| 0, stop: &|| false };
        let lamp = || emitters::polygon_above_floor(&emitters::tilted_pentagon());
        let many = Quality { light_samples: 64, importance: false, ..trial.quality() };
        let mut scenes = vec![(lamp(), many)];
        if method.is_unbiased() {
            scenes.push((furnaces::furnace_sphere(0.5), trial.quality_for(0.5)));
        }
        for (exact, quality) in scenes {
            for (factor, verdict) in [(1.0, Verdict::Right), (1.02, Verdict::Wrong), (0.98, Verdict::Wrong)] {
                let finding = trial.agrees(&faulty(exact.clone(), factor), &quality, exact.radiance);
                assert_eq!(finding.verdict(), verdict, "{} times {factor}: {finding:?}", method.name());
            }
        }
    }
}

#[test]
fn what_nobody_waits_for_ends_as_no_number() {
    let exact = furnaces::furnace_sphere(0.5);
    let trial = Trial { method: Method::Igi, effort: Effort::Long, threads: 2, clock: &|| 0, stop: &|| true };
    let finding = trial.exact(&exact);
    assert!(finding.got.is_nan() && finding.verdict() == Verdict::Wrong, "{finding:?}");
}
