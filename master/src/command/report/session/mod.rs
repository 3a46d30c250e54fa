//! `igi-master report --session`: how far what people see is from the truth while things move.
//!
//! ```text
//! Script (recording, scene) ─► play: each method, in step and in real time ─► Play (pictures, latency, flicker)
//!                                                                               │ states that they show
//!                                                        truths (kept in files) ◄┘
//!                                                               └─► judge ─► tables, plots, strips ─► page, markdown, csv
//! ```
//!
//! In step, a picture is a function of the recording: machines agree to the bit, and so do the errors. In real time it is what
//! this machine would have shown by then.

mod judge;
mod page;
mod play;
mod plot;
mod settings;
mod truths;

use std::path::PathBuf;

use anyhow::{Context, anyhow};

use self::judge::{Judged, judge};
use self::play::{Play, in_real_time, in_step};
use self::settings::{Mode, Settings};
use self::truths::Truths;
use super::progress::Progress;
use crate::cli::ReportArgs;
use crate::command::lockstep;
use crate::command::script::Script;
use runtime::console::Console;
use runtime::failure::{Failure, Success};
use runtime::files::{Fallback, name_of, try_to_write, write_each};
use runtime::interrupt::Interrupt;

/// Plays every recording through every method, and writes the report after each.
///
/// # Errors
/// [`Failure`] if a recording, its scene or a setting cannot be used, no worker draws, the report cannot be written, or a
/// value of a picture is not finite (then the report is there, and says so).
pub(super) fn report(args: &ReportArgs) -> Result<Success, Failure> {
    let settings = Settings::new(args)?;
    let mut console = Console::new(settings.console);
    let read = |path: &PathBuf| Script::read(path, settings.scene.as_deref(), &console);
    let scripts = settings.sessions.iter().map(read).collect::<Result<Vec<Script>, Failure>>()?;
    for script in &scripts {
        check(script, &settings)?;
    }
    let output = &settings.output;
    std::fs::create_dir_all(output).with_context(|| format!("{}: cannot be made", output.display()))?;
    std::fs::create_dir_all(&settings.truths)
        .with_context(|| format!("{}: cannot be made", settings.truths.display()))?;
    try_to_write(&output.join("index.html"))?;

    let interrupt = Interrupt::listen();
    let each = settings.methods.len() * settings.modes.len() + settings.samples;
    let mut progress = Progress::new(&mut console, scripts.len() * each);
    let (mut sections, mut written) = (Vec::new(), Ok(()));
    for (number, script) in scripts.iter().enumerate() {
        progress.scene(&name_of(&script.path));
        let section = measure(script, &settings, &interrupt, &mut progress)?;
        progress.reached((number + 1) * each);
        for judged in &section.judged {
            progress.line(&format!("{}: {}", section.name, judged.said()));
        }
        sections.push(section);
        written = write_each(files(&sections, &settings), Fallback::Nothing);
        if let Err(error) = &written {
            progress.line(&format!("measuring goes on, but {error:#}"));
        }
        if interrupt.asked() {
            break;
        }
    }
    console.clear();
    if written.is_err() {
        write_each(files(&sections, &settings), Fallback::Copy)?;
    }
    console.saved(&output.join("index.html"));
    let bad: u64 = sections.iter().flat_map(|section| &section.judged).map(|judged| judged.non_finite).sum();
    match bad {
        0 if interrupt.asked() => Ok(Success::Interrupted),
        0 => Ok(Success::Done),
        _ => Err(Failure::Failed(anyhow!("{bad} values were not finite; the report says of which method"))),
    }
}

/// What was found about one recording.
struct Section {
    /// Of the recording.
    name: String,
    path: PathBuf,
    scene: PathBuf,
    size: [u32; 2],
    /// Moving pictures of the recording.
    pictures: usize,
    /// What makes the truth one to judge by, or doubtful.
    notes: Vec<String>,
    judged: Vec<Judged>,
    /// The state of the middle sample, as it should be, for people.
    truth: Option<frame::Picture>,
    /// Expected relMSE of the truths themselves.
    floor: Option<f64>,
}

/// What a recording must have, and memory for what is kept of it.
fn check(script: &Script, settings: &Settings) -> Result<(), Failure> {
    if lockstep::pictures(&script.lines) == 0 {
        let path = script.path.display();
        return Err(Failure::Scene(format!("{path}: no moving picture is in it, so that there is nothing to compare")));
    }
    for (_, chosen) in &settings.methods {
        script.demand_memory(&script.methods(Some(chosen))?)?;
    }
    Ok(())
}

/// One recording by all methods.
fn measure(
    script: &Script,
    settings: &Settings,
    interrupt: &Interrupt,
    progress: &mut Progress,
) -> Result<Section, Failure> {
    let mut plays: Vec<Play> = Vec::new();
    for (name, chosen) in &settings.methods {
        for mode in &settings.modes {
            if interrupt.asked() {
                break;
            }
            let of = (name.as_str(), chosen);
            plays.push(match mode {
                Mode::InStep(ratio) => in_step(script, of, *ratio, settings, interrupt, progress)?,
                Mode::RealTime => in_real_time(script, of, settings, interrupt, progress)?,
            });
            progress.reached(progress.done() + 1);
        }
    }
    let mut truths = Truths::new(script, settings)?;
    let doubt = truths.doubt().map(str::to_owned);
    let mut shown: Vec<usize> = plays.iter().flat_map(Play::states).collect();
    shown.sort_unstable();
    shown.dedup();
    for (number, line) in shown.iter().enumerate() {
        if interrupt.asked() {
            break;
        }
        let share = |share: f32| (number as f32 + share) / shown.len() as f32 * settings.samples as f32;
        let done = progress.done();
        truths.draw(*line, interrupt, &mut |of_this| progress.running("truth", f64::from(share(of_this))))?;
        progress.reached(done);
    }
    let middle = plays.first().and_then(|play| play.shots.get(play.shots.len() / 2)).map(|shot| shot.shows);
    let judged = plays.into_iter().map(|play| judge(play, &truths)).collect();
    let camera = script.begun.camera;
    let missing = settings.truth.method.misses(&script.scene);
    let missing = missing.map(|missing| format!("the truths lack {missing}: they are none to judge by"));
    Ok(Section {
        name: name_of(&script.path),
        path: script.path.clone(),
        scene: script.scene_path.clone(),
        size: [camera.width, camera.height],
        pictures: lockstep::pictures(&script.lines),
        notes: doubt.into_iter().chain(missing).collect(),
        judged,
        truth: middle.and_then(|line| truths.of(line)).cloned(),
        floor: truths.floor(),
    })
}

/// Page, tables for documents, numbers, settings.
fn files(sections: &[Section], settings: &Settings) -> Vec<(PathBuf, anyhow::Result<Vec<u8>>)> {
    let block = settings::block(sections, settings);
    let texts = [
        ("index.html", page::page(sections, settings, &block)),
        ("tables.md", Ok(page::markdown(sections, settings))),
        ("points.csv", Ok(page::csv(sections))),
        ("settings.json", Ok(block.clone())),
    ];
    texts.into_iter().map(|(name, text)| (settings.output.join(name), text.map(String::into_bytes))).collect()
}
