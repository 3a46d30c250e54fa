//! `igi-master selftest`: stiff and extreme cases with known answers, on this machine.

mod progress;
mod table;

use std::time::Instant;

use cases::{Case, Effort, Method, Pace, Trial, costs};

use crate::cli::SelftestArgs;
use runtime::cluster::embedded::cores;
use runtime::failure::{Failure, Success};
use runtime::interrupt::Interrupt;
use runtime::stopwatch::StopWatch;

use progress::Progress;
use table::Table;

/// A case and an estimator: what progress counts.
type Run = (Case, Method);

/// Runs what was asked for and prints a line for each finding.
///
/// # Errors
/// [`Failure::Usage`] for a name that no case has, [`Failure::Failed`] if a finding is wrong, or too noisy to tell.
pub fn selftest(args: &SelftestArgs) -> Result<Success, Failure> {
    let runs = chosen(args)?;
    if args.list {
        table::list(&runs, args.json);
        return Ok(Success::Done);
    }
    let interrupt = Interrupt::listen_saying(
        "ending the row, whose numbers do not count; once more to stop at once",
        "stopped; the table is not whole",
    );
    let began = Instant::now();
    let clock = || began.elapsed().as_micros() as u64;
    let stop = || interrupt.asked();
    let (effort, threads) = (effort(args), args.threads.map_or_else(cores, usize::from));
    let mut table = Table::new(effort, args.json);
    let progress = Progress::start(&runs, effort, threads);
    progress.beside(|| table.open());
    for (i, (case, method)) in runs.iter().enumerate() {
        progress.begin(i);
        let watch = StopWatch::start();
        let effort = costs::affordable(case.name, *method, effort);
        let findings = (case.run)(&Trial { method: *method, effort, threads, clock: &clock, stop: &stop });
        if interrupt.asked() {
            break;
        }
        progress.beside(|| table.add(case, *method, &findings, watch.elapsed()));
    }
    progress.end();
    table.close(runs.len(), began.elapsed());
    match table.troubles() {
        _ if interrupt.asked() => Ok(Success::Interrupted),
        0 => Ok(Success::Done),
        bad => Err(Failure::Failed(anyhow::anyhow!("{bad} findings are not as they should be"))),
    }
}

/// How exactly all is to be known.
fn effort(args: &SelftestArgs) -> Effort {
    match (args.long, args.thorough) {
        (true, _) => Effort::Long,
        (false, true) => Effort::Thorough,
        (false, false) => Effort::Usual,
    }
}

/// By name, pace and method; in the order of the table.
fn chosen(args: &SelftestArgs) -> Result<Vec<Run>, Failure> {
    let all = cases::all();
    if let Some(unknown) = args.names.iter().find(|name| !all.iter().any(|case| case.name == **name)) {
        let near: Vec<_> = all.iter().map(|case| case.name).filter(|name| name.contains(unknown.as_str())).collect();
        let hint = if near.is_empty() { "see --list".into() } else { format!("perhaps {}", near.join(", ")) };
        return Err(Failure::Usage(format!("there is no case `{unknown}`: {hint}")));
    }
    let named = |case: &Case| args.names.iter().any(|name| name == case.name);
    let wanted = |case: &Case| match args.names.is_empty() {
        true => args.long || args.list || case.pace == Pace::Quick,
        false => named(case),
    };
    let of = |method: &Method| args.method.is_empty() || args.method.contains(method);
    let runs: Vec<Run> = all
        .into_iter()
        .filter(wanted)
        .flat_map(|case| case.methods.iter().filter(|m| of(m)).map(move |method| (case, *method)))
        .collect();
    if runs.is_empty() {
        return Err(Failure::Usage("none of these cases concerns that method: see --list".into()));
    }
    Ok(runs)
}
