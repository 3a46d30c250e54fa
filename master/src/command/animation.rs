//! `igi-master render --frames-range`: pictures of a scene that moves, one after another.
//!
//! Files are written whole or not at all, so a picture that is there is finished, and nothing else has to be kept to go
//! on after a crash. The scene stays with the workers; each picture begins with an edit of its time.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Instant;

use anyhow::Context;
use frame::front_end::Value;
use frame::{Chosen, FrontEnd, Plane, View};
use scenes::{Change, Scene};
use serde_json::json;

use crate::cli::{FramesRange, RenderArgs};
use crate::command::load::load;
use crate::command::outcome::finish;
use crate::command::render::{Meanwhile, Saver, Settings, described, start, view};
use runtime::console::Console;
use runtime::denoise::Denoiser;
use runtime::failure::{Failure, Success};
use runtime::files::{Fallback, Output, OutputKind, Unsaved, name_of, read_metadata};
use runtime::interrupt::Interrupt;
use runtime::reception::Reception;
use runtime::render_loop::run_watched;
use runtime::series::Series;
use runtime::spoken::hex;
use runtime::stats::{Ending, Gap, RenderStats};

/// One picture.
#[derive(Clone, Debug, PartialEq)]
struct Shot {
    number: u32,
    /// Moment, in the scene's unit of time.
    time: f64,
    outputs: Vec<Output>,
}

/// Draws the pictures that are not there yet.
///
/// # Errors
/// [`Failure`], before any work is done where that is possible.
pub(crate) fn animation(args: &RenderArgs, range: &FramesRange) -> Result<Success, Failure> {
    let settings = Settings::new(args);
    let mut console = Console::new(settings.console);
    let denoiser = settings.denoiser()?;
    let loaded = load(&settings.scene, settings.time, settings.size, &console)?;
    let shots = shots(&settings, loaded.time, range, args.animation.fps)?;
    // All are in the folders of the first.
    shots[0].outputs.iter().try_for_each(Output::check)?;
    let in_the_way = shots.iter().flat_map(|shot| &shot.outputs).find(|output| output.path.is_dir());
    in_the_way.map_or(Ok(()), Output::check)?;
    let denoised_by = denoiser.as_ref().map(Denoiser::name);
    let scene = Arc::new(loaded.scene);
    check_times(&scene, &shots, &console)?;
    let view = view(&settings, &scene)?;

    let interrupt = Interrupt::listen();
    let mut cluster = start(&settings, None)?;
    let _reception = Reception::open(&settings.reception, &cluster, &console)?;
    let world = cluster.publish(scene).context("the scene cannot be sent to workers")?;
    let view = View { world, ..view };
    let (there, missing): (Vec<Shot>, Vec<Shot>) = shots.into_iter().partition(Shot::is_there);
    there.iter().try_for_each(|shot| shot.check(&settings.method, &view, denoised_by.as_ref()))?;
    if !there.is_empty() {
        console.line(&format!("there already: {} of {} pictures", there.len(), there.len() + missing.len()));
    }
    console.emit("series", json!({ "there": there.len(), "missing": missing.len() }));

    let mut front = settings.method.begin(&view);
    let front = front.as_mut();
    let mut series = Series::new(missing.len(), Instant::now());
    let mut gaps: Vec<(u32, Gap)> = Vec::new();
    let mut saved: Vec<u32> = Vec::new();
    let saver = Saver::new(&settings, &view, denoiser);
    let mut meanwhile = Meanwhile::new(&settings, loaded.time, (&saver, &[]), None)?;
    // The same command draws again what it does not find.
    let mut unsaved = Unsaved::new(Fallback::Nothing);
    for shot in &missing {
        console.within(series);
        let changes = vec![Change::Time(shot.time)];
        let world = cluster.change(changes.clone()).map_err(|refused| shot.refuse(&refused))?;
        let (fields, scene) = cluster.fields().zip(cluster.shared_scene()).context("the scene was not published")?;
        front.look(&View { world, fields, scene, ..view }, &changes);
        let mut look = |front: &mut (dyn FrontEnd + 'static), stats: &RenderStats| meanwhile.look(front, stats);
        let stats = run_watched(front, &mut cluster, &settings.stop, &interrupt, &mut console, &mut look);
        if stats.begun_again > 0 && !saved.is_empty() {
            console.line(&format!(
                "pictures {} to {} were saved before, and may be wrong: remove them to have them drawn again",
                saved[0],
                saved[saved.len() - 1]
            ));
            console.emit("doubtful", json!({ "pictures": saved }));
        }
        if stats.ending != Ending::Enough {
            console.clear();
            console.line(&format!("picture {} was not finished, and not saved", shot.number));
            return finish(&stats, false);
        }
        meanwhile.end(front, &stats);
        let missed = saver.save(&shot.outputs, shot.time, front, &stats, &mut unsaved, &console);
        if missed == shot.outputs.len() {
            console.clear();
            let stopped = || format!("picture {} could not be saved, and none after it was drawn", shot.number);
            unsaved.verdict().with_context(stopped)?;
        }
        shot.report(front, &stats, &console);
        gaps.extend(stats.gaps.into_iter().map(|gap| (shot.number, gap)));
        series.next(Instant::now());
        saved.push(shot.number);
    }
    console.clear();
    unsaved.verdict()?;
    match gaps.first() {
        None => Ok(Success::Done),
        Some((number, gap)) => Err(Failure::Incomplete(format!(
            "{} gaps in pictures that were saved, the first in picture {number}: {}: {}; \
             remove such a picture to have it drawn again",
            gaps.len(),
            gap.what,
            gap.reason
        ))),
    }
}

/// Every picture that was asked for; at least one.
fn shots(settings: &Settings, begin: f64, range: &FramesRange, fps: f64) -> Result<Vec<Shot>, Failure> {
    let plain = || {
        vec![Output { path: PathBuf::from(format!("{}.%04d.png", name_of(&settings.scene))), kind: OutputKind::Png }]
    };
    let patterns = if settings.outputs.is_empty() { plain() } else { settings.outputs.clone() };
    let numbered = |number: u32| {
        let outputs = patterns.iter().map(|pattern| {
            pattern.numbered(number).ok_or_else(|| {
                let path = pattern.path.display();
                Failure::Usage(format!(
                    "{path}: with --frames-range, a file name needs a place for the number, such as out.%04d.exr"
                ))
            })
        });
        let time = begin + f64::from(number) / fps;
        Ok(Shot { number, time, outputs: outputs.collect::<Result<_, Failure>>()? })
    };
    range.0.clone().map(numbered).collect()
}

/// Finds out now, not after hours, whether the scene can be posed at every moment.
fn check_times(scene: &Scene, shots: &[Shot], console: &Console) -> Result<(), Failure> {
    if scene.objects.iter().all(|object| object.motion.is_none()) {
        console.line("nothing moves in this scene: all pictures will show the same");
    }
    shots.iter().try_for_each(|shot| Change::Time(shot.time).check(scene).map_err(|refused| shot.refuse(&refused)))
}

/// The first knob that another picture's settings have otherwise.
fn other_knob(method: &Chosen, settings: Option<&String>) -> Option<&'static str> {
    let there: BTreeMap<String, Value> = serde_json::from_str(settings?).ok()?;
    method.settings.iter().find(|(name, value)| there.get(*name) != Some(value)).map(|(name, _)| name)
}

impl Shot {
    fn is_there(&self) -> bool {
        self.outputs.iter().all(|output| output.path.is_file())
    }

    /// A picture that is there must be of this scene and these settings; a PNG does not say.
    fn check(&self, method: &Chosen, view: &View, denoiser: Option<&String>) -> Result<(), Failure> {
        for output in self.outputs.iter().filter(|output| output.kind == OutputKind::Exr) {
            let (size, words) = read_metadata(&output.path)?;
            let is = |name: &str, value: &str| words.get(name).is_some_and(|there| there == value);
            let same = [
                ("scene", is("world", &hex(&view.world.world))),
                ("moment", is("time", &self.time.to_string())),
                ("seed", is("seed", &view.seed.to_string())),
                ("method", is("method", method.method.name())),
                (other_knob(method, words.get("settings")).unwrap_or("setting"), is("settings", &described(method))),
                ("size", size == [view.camera.width, view.camera.height]),
                ("denoiser", words.get("denoiser") == denoiser),
            ];
            let other = same.iter().find(|(_, same)| !same).map(|(what, _)| *what);
            if let Some(what) = other {
                return Err(Failure::Usage(format!(
                    "{}: is there, but of another {what}; remove it, or save under another name",
                    output.path.display()
                )));
            }
        }
        Ok(())
    }

    fn refuse(&self, refused: &scenes::change::Refused) -> Failure {
        Failure::Scene(format!("picture {}, at time {}: {refused}", self.number, self.time))
    }

    fn report(&self, front: &mut dyn FrontEnd, stats: &RenderStats, console: &Console) {
        let Self { number, time, .. } = self;
        let (frames, seconds) = (stats.frames, stats.elapsed.as_secs_f64());
        console.line(&format!("picture {number} at time {time}: {frames} frames in {seconds:.1} s"));
        let raw = hex(&front.show(Plane::Raw).sha256());
        let told = json!({ "number": number, "time": time, "raw_sha256": raw, "frames": frames, "seconds": seconds });
        console.emit("picture", told);
    }
}
