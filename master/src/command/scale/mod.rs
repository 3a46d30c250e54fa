//! `igi-master scale`: frames a second against the number of clients, measured and simulated.
//!
//! ```text
//! quota ─► clients (processes) ─┬► measure ─┬► Curves ─► findings, tables, plots ─► page, CSV
//! connected (other machines) ───┘           └► Model ─► simulate ─┘
//! ```

pub(crate) mod clients;
mod connected;
mod findings;
pub(crate) mod measure;
mod page;
pub mod quota;
mod settings;
pub(crate) mod simulate;
mod tables;
mod watched;

use std::sync::Arc;
use std::time::Duration;

use anyhow::Context;
use protocol::question::WorldState;
use scenes::Scene;
use serde_json::json;

use self::connected::Connected;
use self::measure::{Measured, Timing, measure};
use self::settings::{ClientSource, Settings};
use self::simulate::{Model, Simulated, simulate};
use crate::cli::ScaleArgs;
use crate::command::bench::schedule;
use crate::command::load::load;
use runtime::cluster::embedded;
use runtime::console::Console;
use runtime::failure::{Failure, Success};
use runtime::files::{Fallback, name_of, try_to_write, write_each};
use runtime::interrupt::Interrupt;

/// Everything that was found out.
pub struct Curves {
    /// Clients are processes of this machine that emulate slow ones; else they are on machines of their own.
    pub is_emulated: bool,
    /// Increasing numbers of clients, one first; equal ones, if they are emulated.
    pub measured: Vec<Measured>,
    /// Clients of unequal speed, if asked for.
    pub uneven: Option<Measured>,
    /// Increasing numbers of clients, one first.
    pub simulated: Vec<Simulated>,
    /// Of clients as unequal as those that were measured.
    pub simulated_uneven: Option<Simulated>,
}

impl Curves {
    /// T₁ / (P · T_P), where P is how many times as fast as the first all clients are together: their number, if they are
    /// equal.
    pub fn efficiency(&self, measured: &Measured) -> f64 {
        self.speed_up(measured) / self.firsts(measured)
    }

    /// How many times as fast as the first client all are together.
    pub fn firsts(&self, measured: &Measured) -> f64 {
        measured.cores() / self.measured[0].cores()
    }

    /// T₁ / T_P.
    pub fn speed_up(&self, measured: &Measured) -> f64 {
        self.measured[0].frame_time() / measured.frame_time()
    }

    /// Frames a second that clients would make by themselves, all added up.
    pub fn ideal_rate(&self, measured: &Measured) -> f64 {
        self.firsts(measured) / self.measured[0].frame_time()
    }

    /// As [`Self::efficiency`].
    pub fn simulated_efficiency(&self, simulated: &Simulated) -> f64 {
        self.simulated[0].frame_time / simulated.frame_time / simulated.clients as f64
    }
}

/// Measures, simulates, and writes the page.
///
/// # Errors
/// [`Failure`] if clients cannot be started or held to their shares, if pictures differ, or if nothing can be written.
pub fn scale(args: &ScaleArgs) -> Result<Success, Failure> {
    let settings = Settings::new(args)?;
    let Settings { counts, drawing, frames, output, .. } = &settings;
    let console = Console::new(settings.console);
    std::fs::create_dir_all(output).with_context(|| format!("{}: cannot be made", output.display()))?;
    try_to_write(&output.join("index.html"))?;
    let scene = Arc::new(load(&settings.scene, None, settings.size, &console)?.scene);
    let share = match settings.clients {
        ClientSource::Emulated(share) => Some(share),
        ClientSource::Connected { .. } => None,
    };
    if let Some(share) = share {
        warn_if_crowded(&settings, share, &console);
    }

    let interrupt = Interrupt::listen();
    let most = usize::from(settings.most());
    let mut connected = match &settings.clients {
        ClientSource::Emulated(_) => None,
        ClientSource::Connected { cluster, origin } => {
            match Connected::wait_for(most, &scene, cluster.clone(), origin, &interrupt, &console)? {
                None => return Ok(Success::Interrupted),
                connected => connected,
            }
        }
    };
    let uneven = settings.uneven.as_ref().map_or(0, Vec::len);
    let timing = Timing::new(*frames, most.max(uneven));
    let mut measured: Vec<Measured> = Vec::new();
    for (at, count) in counts.iter().enumerate() {
        let left = measured.first().map(|one| time_left(one, &counts[at..], timing, settings.uneven_sum()));
        print_begin(*count, left, &console);
        let count = usize::from(*count);
        let one = match &mut connected {
            Some(connected) => connected.measure(count, &scene, timing, drawing, &interrupt)?,
            None => measure(&scene, &vec![share.unwrap_or(1.0); count], timing, drawing, &interrupt)?,
        };
        let Some(one) = one else { return Ok(Success::Interrupted) };
        if let Some(first) = measured.first()
            && first.picture != one.picture
        {
            return Err(anyhow::anyhow!("{count} clients draw another picture than one").into());
        }
        print_end(&one, measured.first(), &console);
        measured.push(one);
    }
    // Its good-bye ends those that were started for this.
    drop(connected);
    let uneven = match (&settings.uneven, share) {
        (None, _) | (_, None) => None,
        (Some(parts), Some(share)) => {
            console.line(&format!("{} unequal clients …", parts.len()));
            let shares: Vec<f64> = parts.iter().map(|part| part * share).collect();
            let Some(one) = measure(&scene, &shares, timing, drawing, &interrupt)? else {
                return Ok(Success::Interrupted);
            };
            print_end(&one, measured.first(), &console);
            Some(one)
        }
    };

    let largest = &measured[measured.len() - 1];
    let growth = schedule::growth(largest.shares.len(), settings.simulate as usize);
    let model = Model::of(&measured[0], largest, growth, [settings.bandwidth, settings.delay]);
    let view = drawing.view(&scene, WorldState::default());
    let simulate = |speeds: &[f64]| simulate(&model, &drawing.method, &view, speeds, (*frames).max(24));
    let simulated = simulated_counts(counts, settings.simulate)
        .map(|count| simulate(&vec![1.0; count]))
        .take_while(|_| !interrupt.asked())
        .collect();
    let simulated_uneven = settings.uneven.as_deref().map(simulate);
    let curves = Curves { is_emulated: share.is_some(), measured, uneven, simulated, simulated_uneven };
    report(&curves, &model, &scene, &settings, &console)
}

fn report(
    curves: &Curves,
    model: &Model,
    scene: &Scene,
    settings: &Settings,
    console: &Console,
) -> Result<Success, Failure> {
    let pixels = u64::from(scene.camera.width) * u64::from(scene.camera.height);
    let said = findings::findings(curves, model, pixels);
    let name = name_of(&settings.scene);
    console.line(&format!(
        "\n{}\n{}",
        tables::text(&tables::measured(curves)),
        tables::text(&tables::simulated(curves))
    ));
    said.iter().for_each(|sentence| console.line(sentence));
    let [speed_up, efficiency] = page::plots(curves)?;
    let page = page::page(&name, curves, &said, &[&speed_up, &efficiency], scene, settings);
    console.emit("findings", json!({ "said": said }));
    let files = [
        ("speed-up.svg", speed_up),
        ("efficiency.svg", efficiency),
        ("scale.csv", tables::csv(curves)),
        ("index.html", page),
    ];
    write_each(files.map(|(name, text)| (settings.output.join(name), Ok(text.into_bytes()))), Fallback::Copy)?;
    console.saved(&settings.output.join("index.html"));
    Ok(Success::Done)
}

/// Those that are measured, powers of two, and the most.
fn simulated_counts(counts: &[u16], most: u32) -> impl Iterator<Item = usize> {
    let powers = (0..).map(|power| 1_usize << power).take_while(move |count| *count < most as usize);
    let mut all: Vec<usize> =
        counts.iter().map(|count| usize::from(*count)).chain(powers).chain([most as usize]).collect();
    all.sort_unstable();
    all.dedup();
    all.into_iter()
}

/// Clients that want more than there is do not get their shares.
fn warn_if_crowded(settings: &Settings, share: f64, console: &Console) {
    let cores = embedded::cores() as f64;
    let wanted = f64::from(settings.most()).max(settings.uneven_sum()) * share;
    if wanted > cores * 0.85 {
        console.line(&format!(
            "warning: clients want {wanted:.2} of {cores} cores, which leaves too little for the master: lower --cpu-per-client"
        ));
    }
}

fn time_left(one: &Measured, counts: &[u16], timing: Timing, uneven: f64) -> Duration {
    let frames = one.frame_time() * f64::from(timing.total());
    let uneven = if uneven > 0.0 { frames / uneven } else { 0.0 };
    let seconds = counts.iter().map(|count| frames / f64::from(*count)).sum::<f64>() + uneven;
    // Starting clients takes a moment each time.
    Duration::from_secs_f64(seconds * 1.1)
}

fn print_begin(count: u16, left: Option<Duration>, console: &Console) {
    let left = left.map_or(String::new(), |left| format!(", about {} s left", left.as_secs().max(1)));
    console.line(&format!("{count} clients{left} …"));
}

fn print_end(one: &Measured, first: Option<&Measured>, console: &Console) {
    let first = first.unwrap_or(one);
    let rate = 1.0 / one.frame_time();
    let efficiency = first.cores() * first.frame_time() / (one.cores() * one.frame_time());
    console.line(&format!(
        "  {rate:.3} frames/s, efficiency {efficiency:.3}, {:.0} % of their shares used",
        one.quota_used() * 100.0
    ));
    console.emit(
        "measured",
        json!({ "shares": one.shares, "frames_per_second": rate, "efficiency": efficiency, "quota_used": one.quota_used() }),
    );
}
