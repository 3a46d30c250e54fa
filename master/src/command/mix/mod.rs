//! `igi-master mix`: what each lamp brings to the picture, apart; and any mix of that without tracing a ray, since light adds up.

mod file;
mod lamps;

use std::sync::Arc;

use anyhow::Context;
use frame::tone::{Exposure, Tone};
use frame::{Picture, Plane, View};
use glam::Vec3;
use protocol::answer::Fields;
use scenes::photometry::photometric;
use scenes::{Needs, Scene};
use serde_json::json;

use crate::cli::MixArgs;
use crate::command::load::{load, say_what_is_missing};
use crate::command::options::{self, duration};
use crate::command::outcome::finish;
use lamps::{lamps, lit_by};
use runtime::cluster::Cluster;
use runtime::console::Console;
use runtime::display::short_number;
use runtime::failure::{Failure, Success};
use runtime::files::{Fallback, Metadata, Output, OutputKind, Unsaved, encode_png, name_of};
use runtime::interrupt::Interrupt;
use runtime::memory;
use runtime::reception::Reception;
use runtime::render_loop::run;
use runtime::stats::Stop;

/// What a lamp brings to the picture.
pub(crate) struct Share {
    /// What people call it.
    pub(crate) name: String,
    /// Radiance, W·m⁻²·sr⁻¹, that is there because of it.
    pub(crate) picture: Picture,
}

/// All lamps of a picture, and what is known of how they were drawn.
pub(crate) struct Mix {
    /// One at least, all of one size.
    pub(crate) shares: Vec<Share>,
    /// For files.
    pub(crate) metadata: Metadata,
    /// Where nothing is said.
    pub(crate) exposure: Exposure,
}

/// Draws lamps one by one, or reads what was drawn; mixes, and saves.
///
/// # Errors
/// [`Failure`] if the source cannot be used, a lamp is not there, no worker answers, or a file cannot be written.
pub fn mix(args: &MixArgs) -> Result<Success, Failure> {
    let mut console = Console::new(options::console(args.talk));
    let default = Output { path: format!("{}-mix.exr", name_of(&args.source)).into(), kind: OutputKind::Exr };
    let outputs = if args.output.is_empty() { vec![default] } else { args.output.clone() };
    outputs.iter().try_for_each(Output::check)?;
    let is_picture = args.source.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("exr"));
    let interrupt = Interrupt::listen();
    let mix = match is_picture {
        true => file::read(&args.source)?,
        false => draw(args, &interrupt, &mut console)?,
    };
    let factors = factors(&mix, args)?;
    let picture = mixed(&mix.shares, &factors);
    say(&mix, &factors, &console);
    let exposure = args.exposure.map_or(mix.exposure, |chosen| chosen.0);
    let tone = Tone { exposure, operator: args.tone.into() };
    let mut unsaved = Unsaved::new(Fallback::Copy);
    for output in &outputs {
        let encoded = match output.kind {
            OutputKind::Png => encode_png(&tone.develop(&picture)),
            OutputKind::Exr => file::encode(&mix, &factors, &picture),
        };
        match unsaved.write(&output.path, encoded) {
            Ok(()) => console.saved(&output.path),
            Err(reason) => console.unsaved(&output.path, &reason),
        }
    }
    unsaved.verdict()?;
    Ok(if interrupt.asked() { Success::Interrupted } else { Success::Done })
}

/// Draws each lamp by itself: the same scene with all others off.
fn draw(args: &MixArgs, interrupt: &Interrupt, console: &mut Console) -> Result<Mix, Failure> {
    let scene = load(&args.source, args.time, args.size, console)?.scene;
    let method = &args.method.0;
    say_what_is_missing(method.method, &scene, console);
    let lamps = lamps(&scene);
    known(args, &lamps.iter().map(|lamp| lamp.name.as_str()).collect::<Vec<_>>())?;
    let camera = scene.camera;
    memory::demand(method.memory_bytes(&camera, Fields::of(&Needs::of(&scene))), &camera)?;
    let mut cluster = Cluster::start(options::cluster(&args.cluster)).context("workers cannot be started")?;
    let _reception = Reception::open(&options::reception(&args.cluster), &cluster, console)?;
    let seconds = args.seconds.or(if args.frames.is_none() { Some(DEFAULT_SECONDS) } else { None });
    let stop = Stop { after: seconds.map(duration), frames: args.frames, ..Stop::default() };
    let (mut shares, mut frames) = (Vec::new(), Vec::new());
    for (number, lamp) in (0..).zip(&lamps) {
        let alone: Arc<Scene> = Arc::new(lit_by(&scene, lamp));
        let fields = Fields::of(&Needs::of(&alone));
        let world = cluster.publish(Arc::clone(&alone)).context("the scene cannot be sent to workers")?;
        // Noise of one is no noise of another: in sums it does not add up.
        let view = View { world, scene: alone, fields, camera, seed: args.seed.wrapping_add(number) };
        let mut front = method.begin(&view);
        console.line(&format!("lamp {} of {}: {}", number + 1, lamps.len(), lamp.name));
        let stats = run(front.as_mut(), &mut cluster, &stop, interrupt, console);
        if finish(&stats, front.frames() > 0)? == Success::Interrupted {
            return Err(Failure::Failed(anyhow::anyhow!("interrupted: {} was not drawn to its end", lamp.name)));
        }
        frames.push(stats.frames.to_string());
        shares.push(Share { name: lamp.name.clone(), picture: front.show(Plane::Final) });
    }
    console.clear();
    let metadata = vec![
        ("version", env!("CARGO_PKG_VERSION").to_string()),
        ("scene", args.source.display().to_string()),
        ("method", method.method.name().to_string()),
        ("seed", args.seed.to_string()),
        ("frames", frames.join(" ")),
    ];
    Ok(Mix { shares, metadata, exposure: options::exposure(None, &scene) })
}

/// Seconds for a lamp, if nobody says otherwise.
const DEFAULT_SECONDS: f64 = 10.0;

/// Whether all lamps that are named are there.
fn known(args: &MixArgs, names: &[&str]) -> Result<(), Failure> {
    let asked = args.set.iter().map(|(name, _)| name).chain(&args.solo);
    match asked.into_iter().find(|name| !names.contains(&name.as_str())) {
        None => Ok(()),
        Some(name) => Err(Failure::Usage(format!("there is no lamp `{name}`; there are: {}", names.join(", ")))),
    }
}

/// The factor of each lamp.
fn factors(mix: &Mix, args: &MixArgs) -> Result<Vec<Vec3>, Failure> {
    known(args, &mix.shares.iter().map(|share| share.name.as_str()).collect::<Vec<_>>())?;
    let factor = |share: &Share| {
        let set = args.set.iter().rev().find(|(name, _)| *name == share.name);
        let is_on = args.solo.is_empty() || args.solo.contains(&share.name);
        if is_on { set.map_or(Vec3::ONE, |(_, factor)| Vec3::from(*factor)) } else { Vec3::ZERO }
    };
    Ok(mix.shares.iter().map(factor).collect())
}

/// Light adds up: the sum of all shares, each by its factor, in order.
fn mixed(shares: &[Share], factors: &[Vec3]) -> Picture {
    let Some(first) = shares.first() else { return Picture::black(1, 1) };
    let mut sum = Picture::black(first.picture.width, first.picture.height);
    for (share, factor) in shares.iter().zip(factors) {
        sum.pixels.iter_mut().zip(&share.picture.pixels).for_each(|(sum, pixel)| *sum += *pixel * *factor);
    }
    sum
}

/// What each lamp brings to the mix.
fn say(mix: &Mix, factors: &[Vec3], console: &Console) {
    let mean = |share: &Share, factor: &Vec3| {
        let sum: f64 = share.picture.pixels.iter().map(|pixel| f64::from(photometric(*pixel * *factor))).sum();
        sum / share.picture.pixels.len().max(1) as f64
    };
    let means: Vec<f64> = mix.shares.iter().zip(factors).map(|(share, factor)| mean(share, factor)).collect();
    let all: f64 = means.iter().sum();
    let mut told = Vec::new();
    for ((share, factor), mean) in mix.shares.iter().zip(factors).zip(&means) {
        let percent = if all > 0.0 { 100.0 * mean / all } else { 0.0 };
        let luminance = short_number(*mean as f32);
        console.line(&format!("{percent:5.1} %  {luminance:>8} cd/m² on average  {}  × {factor}", share.name));
        told.push(json!({ "lamp": share.name, "factor": factor, "mean_cd_m2": mean }));
    }
    console.emit("mixed", json!({ "lamps": told }));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mix_is_the_sum_of_all_shares_by_their_factors() {
        let share = |name: &str, value: f32| Share {
            name: name.into(),
            picture: Picture::from_fn(2, 1, |x, _| Vec3::splat(value + x as f32)),
        };
        let shares = [share("a", 1.0), share("b", 10.0)];
        let picture = mixed(&shares, &[Vec3::new(0.5, 1.0, 0.0), Vec3::splat(2.0)]);
        assert_eq!(picture.pixels, [Vec3::new(20.5, 21.0, 20.0), Vec3::new(23.0, 24.0, 22.0)]);
    }
}
