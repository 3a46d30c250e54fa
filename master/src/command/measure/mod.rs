//! `igi-master measure`: illuminance on a grid, and the luminance of a view, as numbers that go into a report.

mod asking;
mod drawing;
mod glare;
mod page;
mod tables;
mod view;

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use anyhow::Context;
use frame::measure::{Figures, Measured, Plan, Target, at_eye, plan};
use protocol::question::{Part, WorldState};
use scenes::photometry::LUMENS_PER_WATT;
use scenes::read::Loaded;
use serde_json::json;

use crate::cli::MeasureArgs;
use crate::command::load::{load, say_what_is_missing};
use crate::command::options;
use asking::{Asking, Found};
use glare::Glare;
use runtime::cluster::Cluster;
use runtime::console::Console;
use runtime::display::short_number;
use runtime::failure::{Failure, Success};
use runtime::files::{Fallback, Unsaved, name_of, try_to_write};
use runtime::interrupt::Interrupt;
use runtime::reception::Reception;
use view::View;

/// What was measured on a grid.
pub(crate) struct Sheet {
    /// Where.
    pub(crate) plan: Plan,
    /// Of each cell that has a point: illuminance, lx.
    pub(crate) values: Vec<Option<Measured>>,
    /// Of all points, lx.
    pub(crate) figures: Figures,
    /// What the first colour and the last stand for, lx.
    pub(crate) scale: [f64; 2],
    /// In words, what was measured: `floor, 0.8 m above it`.
    pub(crate) title: String,
    /// How it was measured, in words.
    pub(crate) method: String,
}

/// Measures, and writes what was found.
///
/// # Errors
/// [`Failure`] if the scene or the target cannot be used, no worker answers, or a file cannot be written.
pub fn measure(args: &MeasureArgs) -> Result<Success, Failure> {
    let mut console = Console::new(options::console(args.talk));
    let stem = args
        .output
        .as_deref()
        .map_or_else(|| PathBuf::from(format!("{}-measured", name_of(&args.scene))), without_ending);
    let file = |ending: &str| PathBuf::from(format!("{}{ending}", stem.display()));
    try_to_write(&file(".html"))?;
    let Loaded { scene, .. } = load(&args.scene, args.time, args.size, &console)?;
    if args.view {
        say_what_is_missing(args.method.0.method, &scene, &console);
    }
    let target = target(args);
    let planned = target.map(|target| {
        let planned = plan(&scene, &target, args.border, args.metre)
            .map_err(|what| Failure::Scene(format!("{}: {what}", args.scene.display())))?;
        Ok::<_, Failure>((target, planned))
    });
    let planned = planned.transpose()?;

    let interrupt = Interrupt::listen();
    let mut cluster = Cluster::start(options::cluster(&args.cluster)).context("workers cannot be started")?;
    let _reception = Reception::open(&options::reception(&args.cluster), &cluster, &console)?;
    let (name, is_photometric) = (scene.name.clone(), scene.lights_are_photometric);
    // Sheets in the air change no light, so that view, grid and glare are of one world.
    let mut scene = planned.as_ref().map_or(scene, |(_, (scene, _))| scene.clone());
    let eye = args.ugr.then(|| at_eye(&mut scene, args.metre));
    let scene = Arc::new(scene);
    let world: WorldState = cluster.publish(Arc::clone(&scene)).context("the scene cannot be sent to workers")?;

    let seconds = Duration::try_from_secs_f64(args.seconds).unwrap_or(Duration::MAX);
    let mut sheet = None;
    let asking = Asking { world, seed: args.seed, error: args.error, seconds };
    if let Some((target, (_, plan))) = planned {
        let points: Vec<_> = plan.points.iter().flatten().copied().collect();
        let found = asking.ask(&points, &Part::All, &mut cluster, &interrupt, &mut console)?;
        sheet = Some(sheet_of(args, &target, plan, &found)?);
    }
    let glare = match eye {
        Some(eye) => Glare::find(&asking, &scene, eye, (&mut cluster, &interrupt, &mut console))?,
        None => None,
    };
    let view = match args.view {
        true => Some(View::draw(args, &scene, world, (&mut cluster, &interrupt, &mut console))?),
        false => None,
    };
    drop(cluster);
    console.clear();

    let unit = match is_photometric {
        true => format!("candela and lux of the file; a watt of luminance is {LUMENS_PER_WATT} lm"),
        false => format!("watts of the file, {LUMENS_PER_WATT} lm each: 1 W/m² is {LUMENS_PER_WATT} lx"),
    };
    let mut unsaved = Unsaved::new(Fallback::Copy);
    let mut save = |path: PathBuf, bytes: anyhow::Result<Vec<u8>>| match unsaved.write(&path, bytes) {
        Ok(()) => console.saved(&path),
        Err(reason) => console.unsaved(&path, &reason),
    };
    if let Some(sheet) = &sheet {
        save(file(".png"), drawing::png(sheet));
        save(file(".csv"), Ok(tables::csv(sheet).into_bytes()));
    }
    if let Some(view) = &view {
        save(file("-luminance.png"), view.png());
        save(file("-luminance.exr"), view.exr());
    }
    save(
        file(".html"),
        page::page(&name, (sheet.as_ref(), view.as_ref(), glare.as_ref()), &unit).map(String::into_bytes),
    );
    if let Some(sheet) = &sheet {
        if let Some(said) = drawing::left_out(sheet) {
            console.line(&format!("left out of all figures: {said}"));
        }
        let Figures { min, average, max, uniformity, .. } = sheet.figures;
        let [min, average, max] = [min, average, max].map(|figure| spoken(figure, " lx"));
        console.line(&format!("Emin {min}, Eavg {average}, Emax {max}, Uo {}", spoken(uniformity, "")));
    }
    if let Some(glare) = &glare {
        console.line(&glare.said().join(", "));
    }
    let (grid, view) = (sheet.as_ref().map(tables::json), view.as_ref().map(View::json));
    console.emit("measured", json!({ "grid": grid, "view": view, "glare": glare.as_ref().map(Glare::json) }));
    unsaved.verdict()?;
    Ok(if interrupt.asked() { Success::Interrupted } else { Success::Done })
}

/// `plan` of `plan.png`, which somebody may write who wants one of the files.
fn without_ending(name: &Path) -> PathBuf {
    let has_ours =
        name.extension().is_some_and(|ending| ["html", "png", "csv", "exr"].iter().any(|ours| ending == *ours));
    if has_ours { name.with_extension("") } else { name.to_owned() }
}

fn target(args: &MeasureArgs) -> Option<Target> {
    let plane = args.plane.map(|height| Target::Plane { height, area: args.area });
    plane.or_else(|| args.on.clone().map(|name| Target::Surface { name, above: args.above }))
}

fn sheet_of(args: &MeasureArgs, target: &Target, plan: Plan, found: &Found) -> Result<Sheet, Failure> {
    let tally = &found.tally;
    let nothing = || Failure::Failed(anyhow::anyhow!("nothing was measured"));
    let figures = tally.figures().filter(|_| tally.rounds() > 0).ok_or_else(nothing)?;
    let mut measured = tally.points().into_iter();
    let values: Vec<_> = plan.points.iter().map(|point| point.and_then(|_| measured.next())).collect();
    let found_scale = frame::measure::around([figures.min.value, figures.max.value]);
    let title = match target {
        Target::Plane { height, .. } => format!("horizontal plane at {height}"),
        Target::Surface { name, above } if *above > 0.0 => format!("{name}, {above} m above it"),
        Target::Surface { name, .. } => name.clone(),
    };
    let share = 100.0 * tally.error();
    let method = format!(
        "{} light sets in {} independent replicates, {:.1} s; every point is known to within {share:.2} % of the mean \
         (95 % confidence){}",
        tally.rounds(),
        asking::REPLICATES,
        found.seconds,
        if tally.error() <= args.error { "" } else { "; the time was over before the error that was asked for" }
    );
    Ok(Sheet { plan, values, figures, scale: args.scale.unwrap_or(found_scale), title, method })
}

/// A figure with its error, as many digits as make sense.
pub(crate) fn spoken(Measured { value, within }: Measured, unit: &str) -> String {
    let (value, within) = (short_number(value as f32), short_number(within as f32));
    format!("{value}{unit} ± {within}")
}
