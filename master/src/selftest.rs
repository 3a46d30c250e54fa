//! `igi-master selftest`: stiff and extreme cases with known answers, on this machine.

use std::io::IsTerminal;
use std::time::Instant;

use cases::{Case, Effort, Finding, Method, Pace, Trial, Verdict};
use serde_json::{Value, json};

use crate::cli::SelftestArgs;
use crate::embedded::cores;
use crate::failure::{Failure, Success};
use crate::interrupt::Interrupt;
use crate::narrator::say;

/// A case and an estimator.
type Run = (Case, Method);

/// Runs what was asked for and prints a line for each finding.
///
/// # Errors
/// [`Failure::Usage`] for a name that no case has, [`Failure::Failed`] if a finding is wrong, or too noisy to tell.
pub fn selftest(args: &SelftestArgs) -> Result<Success, Failure> {
    let runs = chosen(args)?;
    if args.list {
        list(&runs, args.json);
        return Ok(Success::Done);
    }
    let interrupt = Interrupt::listen();
    let began = Instant::now();
    let clock = || began.elapsed().as_micros() as u64;
    let (effort, threads) =
        (if args.long { Effort::Long } else { Effort::Quick }, args.threads.map_or_else(cores, usize::from));
    let mut counts = Counts::default();
    if !args.json {
        say!("{HEADING}");
    }
    for (done, (case, method)) in runs.iter().enumerate() {
        progress(done, &runs, began);
        let started = Instant::now();
        let findings = (case.run)(&Trial { method: *method, effort, threads, clock: &clock });
        let seconds = started.elapsed().as_secs_f64();
        for (i, finding) in findings.iter().enumerate() {
            let verdict = case.judge(*method, finding);
            counts.add(&verdict);
            let seconds = if i == 0 { Some(seconds) } else { None };
            if args.json {
                say!("{}", described(case, *method, finding, &verdict, seconds));
            } else {
                say!("{}", line(case, *method, finding, &verdict, seconds));
            }
        }
        if interrupt.asked() {
            return Ok(Success::Interrupted);
        }
    }
    let seconds = began.elapsed().as_secs_f64();
    if args.json {
        say!("{}", counts.json(seconds));
    } else {
        say!("\n{} in {seconds:.0} s", counts.text());
    }
    match counts.wrong + counts.unclear + counts.mended {
        0 => Ok(Success::Done),
        bad => Err(Failure::Failed(anyhow::anyhow!("{bad} findings are not as they should be"))),
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

fn list(runs: &[Run], as_json: bool) {
    let mut last = "";
    for (case, _) in runs {
        if case.name == last {
            continue;
        }
        last = case.name;
        let methods: Vec<_> = case.methods.iter().map(|method| method.name()).collect();
        let pace = if case.pace == Pace::Long { "long" } else { "" };
        if as_json {
            let Case { row, name, teaches, .. } = case;
            say!("{}", json!({ "row": row, "name": name, "teaches": teaches, "methods": methods, "pace": pace }));
        } else {
            say!("{:>3}  {:<26} {pace:<5} {}\n{:38}{}", case.row, case.name, case.teaches, "", methods.join(", "));
        }
    }
}

const HEADING: &str = "\
row  case                       method       finding                                       expected          got       z  \
tolerance  verdict
";

fn line(case: &Case, method: Method, finding: &Finding, verdict: &Verdict, seconds: Option<f64>) -> String {
    let z = finding.z().map_or("–".into(), |z| format!("{z:.1}"));
    let tolerance = finding.tolerance + cases::case::SIGMAS * finding.error;
    let mut text = format!(
        "{:>3}  {:<26} {:<12} {:<40} {:>13} {:>12} {z:>7} {:>10}  {}",
        case.row,
        case.name,
        method.name(),
        finding.what,
        number(finding.expected),
        number(finding.got),
        format!("{tolerance:.1e}"),
        word(verdict),
    );
    if let Some(seconds) = seconds {
        text += &format!(" {seconds:.1} s");
    }
    if !finding.note.is_empty() {
        text += &format!("; {}", finding.note);
    }
    if let Verdict::Known(reason) = verdict {
        text += &format!("; {reason}");
    }
    text
}

fn described(case: &Case, method: Method, finding: &Finding, verdict: &Verdict, seconds: Option<f64>) -> Value {
    json!({
        "row": case.row, "case": case.name, "method": method.name(), "teaches": case.teaches,
        "finding": finding.what, "expected": finding.expected, "got": finding.got,
        "standard_error": finding.error, "z": finding.z(), "tolerance": finding.tolerance,
        "verdict": word(verdict), "reason": if let Verdict::Known(reason) = verdict { Some(reason) } else { None },
        "note": finding.note, "seconds": seconds,
    })
}

fn word(verdict: &Verdict) -> &'static str {
    match verdict {
        Verdict::Right => "right",
        Verdict::Wrong => "WRONG",
        Verdict::Unclear => "UNCLEAR",
        Verdict::Known(_) => "known",
        Verdict::Mended => "MENDED",
    }
}

/// Six digits, plain where that is short.
fn number(value: f64) -> String {
    let plain = value == 0.0 || (1e-3..1e6).contains(&value.abs());
    match plain {
        true if value.fract() == 0.0 => format!("{value}"),
        true => format!("{value:.6}"),
        false => format!("{value:.5e}"),
    }
}

/// How far it is, for who watches.
fn progress(done: usize, runs: &[Run], began: Instant) {
    if !std::io::stderr().is_terminal() {
        return;
    }
    let elapsed = began.elapsed().as_secs_f64();
    let left = if done == 0 {
        String::new()
    } else {
        format!(", about {:.0} s left", elapsed / done as f64 * (runs.len() - done) as f64)
    };
    let (case, method) = &runs[done];
    eprint!("\r{done} of {}: {} ({}){left}\x1b[K\r", runs.len(), case.name, method.name());
}

/// Findings by verdict.
#[derive(Default)]
struct Counts {
    right: usize,
    wrong: usize,
    unclear: usize,
    known: usize,
    mended: usize,
}

impl Counts {
    fn add(&mut self, verdict: &Verdict) {
        match verdict {
            Verdict::Right => self.right += 1,
            Verdict::Wrong => self.wrong += 1,
            Verdict::Unclear => self.unclear += 1,
            Verdict::Known(_) => self.known += 1,
            Verdict::Mended => self.mended += 1,
        }
    }

    fn text(&self) -> String {
        let Self { right, wrong, unclear, known, mended } = self;
        let mended = if *mended > 0 { format!(", {mended} listed as known and right") } else { String::new() };
        format!("{right} right, {wrong} wrong, {unclear} too noisy to tell, {known} known to be wrong{mended}")
    }

    fn json(&self, seconds: f64) -> Value {
        let Self { right, wrong, unclear, known, mended } = self;
        json!({ "right": right, "wrong": wrong, "unclear": unclear, "known": known, "mended": mended, "seconds": seconds })
    }
}
