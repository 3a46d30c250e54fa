//! `igi-master scale`: frames a second against the number of clients, measured and simulated.
//!
//! ```text
//! quota ─► clients (processes) ─┬► measure ─┬► Curves ─► findings, tables, plots ─► page, CSV
//! connected (other machines) ───┘           └► Model ─► simulate ─┘
//! ```

pub(crate) mod clients;
mod connected;
mod findings;
mod measure;
mod page;
pub mod quota;
mod simulate;
mod tables;
mod watched;

use std::sync::Arc;
use std::time::Duration;

use anyhow::Context;
use frame::View;
use protocol::answer::Fields;
use protocol::question::WorldState;
use scenes::{Needs, Scene};
use serde_json::json;

use self::connected::Connected;
use self::measure::{Measured, Timing, measure};
use self::simulate::{Model, Simulated, simulate};
use crate::cli::ScaleArgs;
use crate::cluster::embedded;
use crate::command::load::load;
use crate::command::options;
use crate::console::Console;
use crate::failure::{Failure, Success};
use crate::files::{Fallback, name_of, try_to_write, write_each};
use crate::interrupt::Interrupt;

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
    let console = Console::new(options::console(args.talk));
    let counts = counts(args)?;
    std::fs::create_dir_all(&args.output).with_context(|| format!("{}: cannot be made", args.output.display()))?;
    try_to_write(&args.output.join("index.html"))?;
    let scene = Arc::new(load(&args.scene, 0.0, args.size, &console)?);
    if args.listen.is_none() {
        warn_if_crowded(&counts, args, &console);
    }

    let interrupt = Interrupt::listen();
    let most = usize::from(counts.last().copied().unwrap_or(1));
    let mut connected = match args.listen {
        None => None,
        Some(_) => match Connected::wait_for(most, &scene, args, &interrupt, &console)? {
            None => return Ok(Success::Interrupted),
            connected => connected,
        },
    };
    let uneven = args.uneven.as_ref().map_or(0, |ratio| ratio.0.len());
    let timing = Timing::new(args, most.max(uneven));
    let mut measured: Vec<Measured> = Vec::new();
    for (at, count) in counts.iter().enumerate() {
        let left = measured.first().map(|one| time_left(one, &counts[at..], timing, args));
        print_begin(*count, left, &console);
        let count = usize::from(*count);
        let one = match &mut connected {
            Some(connected) => connected.measure(count, &scene, timing, args, &interrupt)?,
            None => measure(&scene, &vec![args.cpu_per_client; count], timing, args, &interrupt)?,
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
    let uneven = match &args.uneven {
        None => None,
        Some(ratio) => {
            console.line(&format!("{} unequal clients …", ratio.0.len()));
            let shares: Vec<f64> = ratio.0.iter().map(|part| part * args.cpu_per_client).collect();
            let Some(one) = measure(&scene, &shares, timing, args, &interrupt)? else {
                return Ok(Success::Interrupted);
            };
            print_end(&one, measured.first(), &console);
            Some(one)
        }
    };

    let model = Model::of(&measured[0], &measured[measured.len() - 1], args.bandwidth, args.delay);
    let view = view(&scene, args);
    let method = &args.method.0;
    let simulated = simulated_counts(&counts, args.simulate)
        .map(|count| simulate(&model, method, &view, &vec![1.0; count], args.frames.max(24)))
        .take_while(|_| !interrupt.asked())
        .collect();
    let simulated_uneven =
        args.uneven.as_ref().map(|ratio| simulate(&model, method, &view, &ratio.0, args.frames.max(24)));
    let curves = Curves { is_emulated: args.listen.is_none(), measured, uneven, simulated, simulated_uneven };
    report(&curves, &model, &scene, args, &console)
}

fn report(
    curves: &Curves,
    model: &Model,
    scene: &Scene,
    args: &ScaleArgs,
    console: &Console,
) -> Result<Success, Failure> {
    let pixels = u64::from(scene.camera.width) * u64::from(scene.camera.height);
    let said = findings::findings(curves, model, pixels);
    let name = name_of(&args.scene);
    console.line(&format!(
        "\n{}\n{}",
        tables::text(&tables::measured(curves)),
        tables::text(&tables::simulated(curves))
    ));
    said.iter().for_each(|sentence| console.line(sentence));
    let [speed_up, efficiency] = page::plots(curves)?;
    let page = page::page(&name, curves, &said, &[&speed_up, &efficiency], scene, args);
    console.emit("findings", json!({ "said": said }));
    let files = [
        ("speed-up.svg", speed_up),
        ("efficiency.svg", efficiency),
        ("scale.csv", tables::csv(curves)),
        ("index.html", page),
    ];
    write_each(files.map(|(name, text)| (args.output.join(name), Ok(text.into_bytes()))), Fallback::Copy)?;
    console.saved(&args.output.join("index.html"));
    Ok(Success::Done)
}

/// What is drawn.
fn view(scene: &Arc<Scene>, args: &ScaleArgs) -> View {
    let fields = Fields::of(&Needs::of(scene));
    let world = WorldState::default();
    View { world, scene: Arc::clone(scene), fields, camera: scene.camera, seed: args.seed }
}

/// Numbers of clients to measure: one comes first, because all others are compared with it.
fn counts(args: &ScaleArgs) -> Result<Vec<u16>, Failure> {
    if !args.clients.is_sorted_by(|a, b| a < b) {
        return Err(Failure::Usage("--clients wants increasing numbers, such as 1,2,4,8,16".into()));
    }
    let one = (args.clients.first() != Some(&1)).then_some(1);
    Ok(one.into_iter().chain(args.clients.iter().copied()).collect())
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
fn warn_if_crowded(counts: &[u16], args: &ScaleArgs, console: &Console) {
    let cores = embedded::cores() as f64;
    let even = f64::from(counts.last().copied().unwrap_or(1));
    let uneven = args.uneven.as_ref().map_or(0.0, |ratio| ratio.0.iter().sum());
    let wanted = even.max(uneven) * args.cpu_per_client;
    if wanted > cores * 0.85 {
        console.line(&format!(
            "warning: clients want {wanted:.2} of {cores} cores, which leaves too little for the master: lower --cpu-per-client"
        ));
    }
}

fn time_left(one: &Measured, counts: &[u16], timing: Timing, args: &ScaleArgs) -> Duration {
    let frames = one.frame_time() * f64::from(timing.total());
    let uneven = args.uneven.as_ref().map_or(0.0, |ratio| frames / ratio.0.iter().sum::<f64>());
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
