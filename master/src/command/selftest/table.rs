//! What was found: a line or a JSON object each, and sums at the end.

use std::time::Duration;

use cases::{Case, Effort, Finding, Method, Pace, Verdict};
use serde_json::{Value, json};

use super::Run;
use runtime::console::print_line;
use runtime::stopwatch::Elapsed;

/// Says what is found, and counts.
pub struct Table {
    json: bool,
    /// Deviation, relative, that no finding is meant to hide.
    known_to: f64,
    counts: Counts,
    /// Runs that are in it.
    runs: usize,
    /// Findings that could hide more than they are meant to, each with how much.
    wide: Vec<String>,
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

const HEADING: &str = "\
within: how far from expected it can be at most, at four standard errors

row  case                       method       finding                                       expected          got       z  \
  within  verdict
";

impl Table {
    /// Nothing is known yet.
    pub fn new(effort: Effort, json: bool) -> Self {
        Self { json, known_to: 2.0 * effort.resolution(), counts: Counts::default(), runs: 0, wide: Vec::new() }
    }

    /// What stands above the lines.
    pub fn open(&self) {
        if !self.json {
            print_line!("{HEADING}");
        }
    }

    /// All that one case found by one method, in that time.
    pub fn add(&mut self, case: &Case, method: Method, findings: &[Finding], took: Elapsed) {
        self.runs += 1;
        for (i, finding) in findings.iter().enumerate() {
            let verdict = case.judge(method, finding);
            self.counts.add(&verdict);
            if finding.error > 0.0 && finding.expected != 0.0 && finding.within() > self.known_to + finding.slack() {
                self.wide.push(format!("{} ({}, {})", case.name, method.name(), within(finding)));
            }
            let took = if i == 0 { Some(took) } else { None };
            if self.json {
                print_line!("{}", described(case, method, finding, &verdict, took));
            } else {
                print_line!("{}", line(case, method, finding, &verdict, took));
            }
        }
    }

    /// The sums, and whether these are all runs that were asked for.
    pub fn close(&self, of: usize, took: Duration) {
        let seconds = took.as_secs_f64();
        if self.json {
            print_line!("{}", self.counts.json(self.runs, of, seconds));
            return;
        }
        print_line!("\n{} in {seconds:.0} s", self.counts.text());
        if !self.wide.is_empty() {
            let known_to = percent(self.known_to);
            print_line!("could hide a bias of more than {known_to}: {}", self.wide.join(", "));
        } else if self.runs == of {
            print_line!("none could hide a bias of {}", percent(self.known_to));
        }
        if self.runs < of {
            print_line!("INTERRUPTED after {} of {of} rows: the table is not whole", self.runs);
        }
    }

    /// Findings that somebody has to look at.
    pub fn troubles(&self) -> usize {
        self.counts.wrong + self.counts.unclear + self.counts.mended
    }
}

/// What cases there are among these, each once.
pub fn list(runs: &[Run], as_json: bool) {
    let mut last = "";
    for (case, _) in runs {
        if case.name == last {
            continue;
        }
        last = case.name;
        let Case { row, name, teaches, .. } = case;
        let methods: Vec<_> = case.methods.iter().map(|method| method.name()).collect();
        let pace = if case.pace == Pace::Long { "long" } else { "" };
        if as_json {
            print_line!(
                "{}",
                json!({ "row": row, "name": name, "teaches": teaches, "methods": methods, "pace": pace })
            );
        } else {
            print_line!("{row:>3}  {name:<26} {pace:<5} {teaches}\n{:38}{}", "", methods.join(", "));
        }
    }
}

fn line(case: &Case, method: Method, finding: &Finding, verdict: &Verdict, took: Option<Elapsed>) -> String {
    let mut text = format!(
        "{:>3}  {:<26} {:<12} {:<40} {:>13} {:>12} {:>7} {:>8}  {}",
        case.row,
        case.name,
        method.name(),
        finding.what,
        number(finding.expected),
        number(finding.got),
        finding.z().map_or("–".into(), |z| format!("{z:.1}")),
        within(finding),
        word(verdict),
    );
    if let Some(took) = took {
        text += &format!(" {:.1} s", took.wall);
    }
    if !finding.note.is_empty() {
        text += &format!("; {}", finding.note);
    }
    if let Verdict::Known(reason) = verdict {
        text += &format!("; {reason}");
    }
    text
}

fn described(case: &Case, method: Method, finding: &Finding, verdict: &Verdict, took: Option<Elapsed>) -> Value {
    json!({
        "row": case.row, "case": case.name, "method": method.name(), "teaches": case.teaches,
        "finding": finding.what, "expected": finding.expected, "got": finding.got,
        "standard_error": finding.error, "z": finding.z(), "tolerance": finding.tolerance, "within": finding.within(),
        "verdict": word(verdict), "reason": if let Verdict::Known(reason) = verdict { Some(reason) } else { None },
        "note": finding.note, "seconds": took.map(|took| took.wall), "cpu_seconds": took.map(|took| took.cpu),
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

/// [`Finding::within`], in the unit it has.
fn within(finding: &Finding) -> String {
    let within = finding.within();
    match within {
        0.0 => "0".into(),
        _ if finding.expected == 0.0 => format!("{within:.1e}"),
        _ => percent(within),
    }
}

/// Two digits.
fn percent(share: f64) -> String {
    let percent = 100.0 * share;
    match percent {
        0.1.. => format!("{} %", (percent * 100.0).round() / 100.0),
        _ => format!("{percent:.0e} %"),
    }
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

    fn json(&self, runs: usize, of: usize, seconds: f64) -> Value {
        let Self { right, wrong, unclear, known, mended } = self;
        json!({
            "right": right, "wrong": wrong, "unclear": unclear, "known": known, "mended": mended,
            "rows": runs, "rows_asked_for": of, "whole": runs == of, "seconds": seconds,
        })
    }
}
