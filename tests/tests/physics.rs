//! Light against closed forms, and the machinery against chaos: the quick cases of the table that
//! `igi-master selftest` prints, one test a part of it. The slow ones are `igi-master selftest --long`.

use std::time::Instant;

use cases::{Case, Effort, Method, Pace, Trial, Verdict, rows};

/// Runs the quick cases among these; fails with a line for each finding that is not as it should be.
fn check(cases: &[Case], effort: Effort) {
    let mut wrong = Vec::new();
    for case in cases.iter().filter(|case| case.pace == Pace::Quick) {
        for method in case.methods {
            // The judge takes its time.
            let effort = if *method == Method::Reference { Effort::Brief } else { effort };
            let began = Instant::now();
            let clock = || began.elapsed().as_micros() as u64;
            let findings = (case.run)(&Trial { method: *method, effort, threads: 1, clock: &clock });
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
fn lamps_and_skies() {
    check(rows::lamps::CASES, Effort::Brief);
}

#[test]
fn glass_and_mirrors() {
    check(rows::glass::CASES, Effort::Brief);
}

#[test]
fn edges_of_numbers() {
    check(rows::edges::CASES, Effort::Quick);
}

#[test]
fn pictures_and_wire() {
    check(rows::pictures::CASES, Effort::Quick);
}

#[test]
fn broken_files() {
    check(rows::files::CASES, Effort::Quick);
}

#[test]
fn faults_and_edits() {
    check(rows::faults::CASES, Effort::Quick);
}

#[test]
fn hunted() {
    check(rows::hunted::CASES, Effort::Quick);
}

#[test]
fn coverage() {
    check(rows::coverage::CASES, Effort::Brief);
}

/// A test that cannot fail proves nothing: a biased picture must not pass for the right one.
#[test]
fn a_biased_mode_fails_where_it_is_held_to_the_truth() {
    let corner = cases::worlds::furnaces::furnace_corner(0.7);
    let trial = Trial { method: Method::Bounded, effort: Effort::Quick, threads: 1, clock: &|| 0 };
    assert_eq!(trial.exact(&corner).verdict(), Verdict::Wrong);
}
