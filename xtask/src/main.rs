//! `cargo xtask`: the chores of people who change this project. Today there is one: running tests by tier.
//!
//! It knows the variables, features and programs that each tier needs, so that nobody has to. It depends on nothing, so
//! that it is built in a second or two.

mod command_line;
mod need;
mod run;
mod tier;

use std::process::ExitCode;

use command_line::{Request, TestRequest};
use tier::{TIERS, Tier};

const HELP: &str = "\
Runs the tests of igi by tier: sets what they need in the environment, says
what is missing on this machine and how to install it.

Usage: cargo xtask test [--tier NAME[,NAME…]] [--dry-run] [-- ARGS…]
       cargo xtask test --list

  --tier NAME  which tests (`quick` if not given); several with commas; `all`
               runs every tier whose needs are met, and names the others
  --list       the tiers: what each runs, what it needs, how long it takes,
               and whether this machine has what it needs
  --dry-run    prints the commands with their variables, runs nothing
  -- ARGS…     go to the test programs: a part of a test's name, --nocapture,
               or what the tier itself understands

Examples:
  cargo xtask test
  cargo xtask test --tier physics -- glass
  cargo xtask test --tier browser,window
  cargo xtask test --tier simulation -- --seeds 100000
  cargo xtask test --tier simulation -- --seed 4711

Variables that are set already are kept (IGI_FUZZ=100000 cargo xtask test
--tier hostile). Exit code: 0 if all tests that ran passed, 1 if a test failed,
2 if a tier that was named cannot run here or the command line is wrong.
CONTRIBUTING.md says when to run which.";

fn main() -> ExitCode {
    match command_line::parse(std::env::args().skip(1)) {
        Ok(Request::Help) => {
            println!("{HELP}");
            ExitCode::SUCCESS
        }
        Ok(Request::List) => {
            print!("{}", list());
            ExitCode::SUCCESS
        }
        Ok(Request::Test(request)) => test(&request),
        Err(wrong) => {
            eprintln!("{wrong}\n`cargo xtask --help` says what there is.");
            ExitCode::from(2)
        }
    }
}

/// What `--list` prints.
fn list() -> String {
    let mut text = String::new();
    for tier in TIERS {
        text += &format!("{}\n    {}\n    takes: {}\n", tier.name, tier.what, tier.takes);
        if !tier.needs.is_empty() {
            text +=
                &format!("    needs: {}\n", tier.needs.iter().map(ToString::to_string).collect::<Vec<_>>().join(", "));
        }
        for missing in tier.missing() {
            text += &format!("    missing here: {missing}. {}\n", missing.remedy());
        }
        if !tier.arguments.is_empty() {
            text += &format!("    after `--`: {}\n", tier.arguments);
        }
    }
    text
}

fn test(request: &TestRequest) -> ExitCode {
    let (can_run, cannot): (Vec<&Tier>, Vec<&Tier>) =
        request.tiers.iter().copied().partition(|tier| request.dry_run || tier.missing().is_empty());
    for tier in &cannot {
        for need in tier.missing() {
            eprintln!("{}: missing here: {need}. {}", tier.name, need.remedy());
        }
    }
    // Who asks for everything gets what there is; who names tiers is told before any of them takes time.
    if !cannot.is_empty() && !request.all {
        return ExitCode::from(2);
    }
    let mut failed = Vec::new();
    for tier in &can_run {
        if !run::tier(tier, &request.arguments, request.dry_run) {
            failed.push(tier.name);
        }
    }
    for tier in cannot {
        eprintln!("{}: not run: it lacks what is named above", tier.name);
    }
    if failed.is_empty() {
        return ExitCode::SUCCESS;
    }
    eprintln!("failed: {}", failed.join(", "));
    ExitCode::from(1)
}
