//! `igi-master report`: error against run time, honestly (algorithms.md D).
//!
//! ```text
//! Subject (scene, reference) ─► race (our methods, in turn) ─┐
//!                            └► peers (other renderers) ─────┴► Record ─► judge ─► Series ─┬► findings
//!                                                               pictures      errors       ├► plots, tables, strips ─► page
//!                                                                                          └► csv
//! ```
//!
//! The statistics are in [`frame::metrics`], pure and tested on errors that are known; here is what
//! happens: runs, clocks, processes, files.

mod csv;
mod findings;
mod finish;
mod judgement;
mod left_out;
pub(crate) mod page;
mod peer;
pub(crate) mod plot;
mod progress;
mod race;
mod record;
mod session;
mod settings;
pub(crate) mod strip;
mod subject;
pub(crate) mod tables;

use std::path::PathBuf;

use anyhow::{Context, anyhow};

use self::findings::{Finding, findings};
use self::finish::Finish;
use self::judgement::{Series, judge};
use self::left_out::LeftOut;
use self::peer::Peer;
use self::progress::Progress;
use self::race::{Method, race};
use self::record::{Description, Record};
use self::settings::{Measurement, Settings};
use self::subject::Subject;
use crate::cli::ReportArgs;
use runtime::console::Console;
use runtime::failure::{Failure, Success};
use runtime::files::{Fallback, try_to_write, write_each};
use runtime::interrupt::Interrupt;
use runtime::memory;

/// Runs everything on every scene, and writes the report after each.
///
/// # Errors
/// [`Failure`] if nothing can be measured, if the report cannot be written, or if any value of any picture
/// was not finite or depends on what was left out (then the report is there, and says so).
pub fn report(args: &ReportArgs) -> Result<Success, Failure> {
    if !args.session.session.is_empty() {
        return session::report(args);
    }
    let settings = Settings::new(args);
    let Settings { methods, peers, measurement, output, .. } = &settings;
    let mut console = Console::new(settings.console);
    let subjects = subjects(&settings, &console)?;
    check(&settings, &subjects)?;
    let finish = settings.finish()?;
    std::fs::create_dir_all(output).with_context(|| format!("{}: cannot be made", output.display()))?;
    try_to_write(&output.join("index.html"))?;

    let interrupt = Interrupt::listen();
    let with_pruning = settings.with_pruning;
    let runs = subjects.len() * (methods.len() + peers.len()) * measurement.runs as usize;
    let others = if with_pruning { subjects.len() + left_out::ROOMS } else { 0 };
    let mut progress = Progress::new(&mut console, runs + others);
    let mut sections = Vec::new();
    let mut written = Ok(());
    let mut left_out = if with_pruning { LeftOut::of_rooms(&interrupt, &mut progress)? } else { LeftOut::default() };
    for subject in subjects {
        if interrupt.asked() {
            break;
        }
        progress.scene(&subject.name);
        let section = measure(subject, &settings, finish.as_ref(), &interrupt, &mut progress)?;
        section.print(&progress);
        if with_pruning {
            left_out.add(&section.subject.name, &section.subject.scene, &interrupt, &mut progress)?;
        }
        sections.push(section);
        written = write_each(files(&sections, &left_out, &settings), Fallback::Nothing);
        if let Err(error) = &written {
            progress.line(&format!("measuring goes on, but {error:#}"));
        }
    }
    console.clear();
    if written.is_err() {
        write_each(files(&sections, &left_out, &settings), Fallback::Copy)?;
    }
    console.saved(&output.join("index.html"));

    let bad: u64 = sections.iter().flat_map(|section| &section.series).map(Series::non_finite).sum();
    match (bad, left_out.broken()) {
        (0, None) if interrupt.asked() => Ok(Success::Interrupted),
        (0, None) => Ok(Success::Done),
        (0, Some(broken)) => Err(Failure::Failed(anyhow!(broken))),
        _ => Err(Failure::Failed(anyhow!("{bad} values were not finite; the report says of which method"))),
    }
}

/// What was found about one scene.
struct Section {
    subject: Subject,
    series: Vec<Series>,
    findings: Vec<Finding>,
    /// What is missing, and why.
    troubles: Vec<String>,
    /// What ran.
    methods: Vec<Description>,
    /// Seconds until a method could begin.
    preparations: Vec<(String, f64)>,
}

/// One scene: our methods, then the others, then what the pictures say.
fn measure(
    subject: Subject,
    settings: &Settings,
    finish: Option<&Finish>,
    interrupt: &Interrupt,
    progress: &mut Progress,
) -> Result<Section, Failure> {
    let Settings { methods, peers, measurement, .. } = settings;
    let mut records = race(&subject, methods, measurement, finish, interrupt, progress)?;
    for peer in peers {
        if !interrupt.asked() {
            records.push(peer.run(&subject, measurement, finish, interrupt, progress));
        }
    }
    let series: Vec<Series> = records.iter().flat_map(|record| judge(record, &subject, measurement.clock)).collect();
    let findings = findings(&subject, &series, &measurement.marks);
    let trouble = |record: &Record| Some(format!("{}: {}", record.method.name, record.trouble.as_ref()?));
    let troubles = records.iter().filter_map(trouble).collect();
    let preparations = records.iter().map(|record| (record.method.name.clone(), record.preparation)).collect();
    let methods = records.into_iter().map(|record| record.method).collect();
    Ok(Section { subject, series, findings, troubles, methods, preparations })
}

impl Section {
    fn error_plot(&self, seconds: &str) -> anyhow::Result<String> {
        plot::error_plot(&self.series, self.subject.floor, seconds)
    }

    fn parts_plot(&self, seconds: &str) -> anyhow::Result<String> {
        plot::parts_plot(&self.series, seconds)
    }

    fn print(&self, progress: &Progress) {
        let findings = self.findings.iter().map(|finding| &finding.text);
        for line in findings.chain(&self.troubles) {
            progress.line(&format!("{}: {line}", self.subject.name));
        }
    }
}

/// Page, numbers, settings, and the plots of the last scene once more as files.
fn files(sections: &[Section], left_out: &LeftOut, settings: &Settings) -> Vec<(PathBuf, anyhow::Result<Vec<u8>>)> {
    let Measurement { clock, marks, .. } = &settings.measurement;
    let block = settings::block(sections, settings);
    let page = page::page(sections, left_out, marks, &clock.to_string(), &block, &settings::machine());
    let rows = sections.iter().map(|s| csv::rows(&s.subject.name, &s.series, s.subject.floor, marks));
    let numbers: String = std::iter::once(csv::HEADING.to_string()).chain(rows).collect();
    let mut texts =
        vec![("index.html".into(), page), ("points.csv".into(), Ok(numbers)), ("settings.json".into(), Ok(block))];
    if settings.with_pruning {
        texts.push(("left-out.csv".into(), Ok(left_out.csv())));
    }
    if let Some(section) = sections.last().filter(|section| section.series.iter().any(|s| !s.points.is_empty())) {
        let seconds = format!("seconds, {clock}");
        let name = |what: &str| format!("{}-{what}.svg", section.subject.name);
        texts.push((name("error"), section.error_plot(&seconds)));
        texts.push((name("parts"), section.parts_plot(&seconds)));
    }
    texts.into_iter().map(|(name, text)| (settings.output.join(name), text.map(String::into_bytes))).collect()
}

/// All scenes that can be measured; those that cannot are said, unless it is all of them.
fn subjects(settings: &Settings, console: &Console) -> Result<Vec<Subject>, Failure> {
    if settings.target.reference.is_some() && settings.scenes.len() > 1 {
        return Err(Failure::Usage("--reference is for a single scene".to_string()));
    }
    let mut subjects = Vec::new();
    let mut last = None;
    for path in &settings.scenes {
        match Subject::load(path, &settings.target) {
            Ok(subject) => subjects.push(subject),
            Err(failure) => {
                console.line(&format!("{}: left out: {failure}", path.display()));
                last = Some(failure);
            }
        }
    }
    match last {
        Some(failure) if subjects.is_empty() => Err(failure),
        _ => Ok(subjects),
    }
}

/// What makes no sense, or does not fit into memory, is refused before the work.
fn check(settings: &Settings, subjects: &[Subject]) -> Result<(), Failure> {
    let Settings { methods, peers, measurement, .. } = settings;
    let mut names: Vec<&str> = methods.iter().map(Method::name).chain(peers.iter().map(Peer::name)).collect();
    if names.is_empty() {
        return Err(Failure::Usage("nothing to measure: give a method, a --variant or a --peer".to_string()));
    }
    names.sort_unstable();
    if let Some(twice) = names.windows(2).find(|pair| pair[0] == pair[1]) {
        return Err(Failure::Usage(format!("two methods are called {}", twice[0])));
    }
    let pixels = subjects.iter().map(|s| s.reference.pixels.len() as u64).max().unwrap_or(0);
    let looks = u64::from(measurement.runs) * LOOKS_EXPECTED * 2 * (methods.len() + peers.len()) as u64;
    let (needed, free) = (pixels * size_of::<glam::Vec3>() as u64 * looks, memory::available_bytes());
    if needed > free {
        return Err(Failure::Usage(format!(
            "the pictures of all runs need about {} of memory, and {} are free: choose a larger --shrink, fewer --runs or \
             fewer methods",
            memory::described(needed),
            memory::described(free)
        )));
    }
    Ok(())
}

/// Looks of a run that are kept, as far as memory is concerned: 2¹⁴ frames and the marks.
const LOOKS_EXPECTED: u64 = 18;
