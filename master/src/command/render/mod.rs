//! `igi-master render`: from a scene file to a picture.

mod animation;
mod meanwhile;
mod saving;

use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use anyhow::{Context, anyhow};
use frame::tone::Exposure;
use frame::{Filter, FrontEnd, Igi, Layer, Setup};
use protocol::answer::Fields;
use protocol::question::WorldState;
use scenes::{Keep, Needs, Scene};
use serde_json::json;

use crate::checkpoint::Keeper;
use crate::cli::{HandsArgs, RenderArgs, Size, flags_for};
use crate::cluster::embedded::cores;
use crate::cluster::quic;
use crate::cluster::{Cluster, ClusterOptions};
use crate::conduct::{Ending, Stop, Tally, conduct_watched};
use crate::failure::{Failure, Success};
use crate::files::{Fallback, Metadata, Output, OutputKind, Unsaved, name_of};
use crate::interrupt::Interrupt;
use crate::memory;
use crate::narrator::{Narrator, Traffic};
use crate::reception::Reception;

pub(crate) use meanwhile::Meanwhile;
pub(crate) use saving::save;

/// Renders, and saves.
///
/// # Errors
/// [`Failure`], before any work is done where that is possible.
pub fn render(args: &RenderArgs) -> Result<Success, Failure> {
    if let Some(range) = &args.animation.frames_range {
        return animation::animation(args, range);
    }
    let mut narrator = Narrator::new(args.talk);
    let outputs = match args.output.as_slice() {
        [] => vec![Output { path: format!("{}.png", name_of(&args.scene)).into(), kind: OutputKind::Png }],
        outputs => outputs.to_vec(),
    };
    outputs.iter().try_for_each(Output::check)?;

    let scene = load(&args.scene, args.time, args.size, &narrator)?;
    let setup = setup(args, &scene)?;
    let interrupt = Interrupt::listen();
    let mut keeper = keeper(args)?;
    let mut cluster = start(args, keeper.as_ref())?;
    let kept = keeper.as_ref().map(Keeper::token_file);
    let _reception = Reception::open(&args.hands, kept.as_deref(), &cluster, &narrator)?;

    let world = cluster.publish(Arc::new(scene)).context("the scene cannot be sent to workers")?;
    let setup = Setup { world, ..setup };
    let (mut front, before) = begin(setup, keeper.as_mut(), &narrator)?;
    let stop = Stop { spent: before, ..stop(args) };
    let mut meanwhile = Meanwhile::new(args, &outputs, keeper)?;
    let mut look = |front: &mut Igi, tally: &Tally| meanwhile.look(front, tally);
    let tally = conduct_watched(&mut front, &mut cluster, &stop, &interrupt, &mut narrator, &mut look);
    meanwhile.end(&mut front, &tally);
    let status = cluster.status();
    drop(cluster);

    narrator.clear();
    let mut unsaved = Unsaved::new(Fallback::Copy);
    if front.frames() > 0 {
        let raw = hex(&front.show(Layer::Raw).sha256());
        narrator.emit("picture", json!({ "raw_sha256": raw, "frames": front.frames() }));
        save(&outputs, args, args.time, &mut front, &tally, &mut unsaved, &narrator);
    }
    narrator.summary(&tally, Traffic { sent: status.bytes_sent, received: status.bytes_received });
    conclude(&tally, front.frames() > 0, &unsaved)
}

fn keeper(args: &RenderArgs) -> anyhow::Result<Option<Keeper>> {
    args.checkpoint.as_ref().map(|folder| Keeper::new(folder, duration(args.checkpoint_every))).transpose()
}

/// Starts the workers of this process and listens for others, with the token that was kept if there is one.
pub(crate) fn start(args: &RenderArgs, keeper: Option<&Keeper>) -> anyhow::Result<Cluster> {
    let mut options = ClusterOptions { keep: keep(args), ..options(&args.hands) };
    if let (Some(keeper), None, None) = (keeper, &options.token, &options.token_file) {
        options.token = keeper.token()?.filter(|token| quic::is_current(token));
    }
    let cluster = Cluster::start(options).context("workers cannot be started")?;
    if let (Some(keeper), Some(token)) = (keeper, cluster.token()) {
        keeper.keep_token(&token.to_string())?;
    }
    Ok(cluster)
}

/// A new picture, or what was kept of it and how long that took.
fn begin(setup: Setup, keeper: Option<&mut Keeper>, narrator: &Narrator) -> anyhow::Result<(Igi, Duration)> {
    let kept = keeper.map(|keeper| keeper.resume(&setup)).transpose()?.flatten();
    let Some((front, before)) = kept else { return Ok((Igi::new(setup), Duration::ZERO)) };
    narrator.say(&format!("going on after {} frames, {:.1} s", front.frames(), before.as_secs_f64()));
    narrator.emit("resumed", json!({ "frames": front.frames(), "seconds": before.as_secs_f64() }));
    Ok((front, before))
}

/// As [`finish`], for pictures that could be saved or not: one that is lost weighs more than how it came about.
pub(crate) fn conclude(tally: &Tally, drawn: bool, unsaved: &Unsaved) -> Result<Success, Failure> {
    let finished = finish(tally, drawn);
    match (unsaved.verdict(), finished) {
        (Ok(()), finished) => finished,
        (Err(lost), Ok(_)) => Err(lost.into()),
        (Err(lost), Err(other)) => Err(Failure::Failed(anyhow!("{lost}; besides, {other}"))),
    }
}

/// How it ended, in terms of exit codes.
pub(crate) fn finish(tally: &Tally, drawn: bool) -> Result<Success, Failure> {
    let fate =
        if drawn { "what was drawn by then is what there is" } else { "no frame was complete, so nothing was saved" };
    if let Some(first) = tally.gaps.first() {
        let count = tally.gaps.len();
        return Err(Failure::Incomplete(format!(
            "the picture has {count} gaps, the first {}: {}; {fate}",
            first.what, first.reason
        )));
    }
    if tally.ending == Ending::Interrupted && !drawn {
        tracing::warn!("{fate}");
    }
    match tally.ending {
        Ending::Enough => Ok(Success::Done),
        Ending::Interrupted => Ok(Success::Interrupted),
        Ending::NoWorkers => Err(Failure::NoWorkers(format!("no worker for longer than --wait; {fate}"))),
        Ending::Deserted => {
            Err(Failure::NoWorkers(format!("the time was over, and no worker was left to complete a frame; {fate}")))
        }
    }
}

/// Reads the scene at a moment, says what there is to say about it, and sets the camera's picture size.
pub(crate) fn load(path: &Path, time: f64, size: Option<Size>, narrator: &Narrator) -> Result<Scene, Failure> {
    if !time.is_finite() {
        return Err(Failure::Usage("--time must be a finite number".to_string()));
    }
    let mut loaded = scenes::read::load_at(path, Some(time))?;
    for note in &loaded.notes {
        narrator.say(&note.to_string());
        narrator.emit("note", json!({ "message": note.to_string() }));
    }
    if let Some(size) = size {
        loaded.scene.camera.width = size.width;
        loaded.scene.camera.height = size.height;
    }
    let scene = loaded.scene;
    let (width, height) = (scene.camera.width, scene.camera.height);
    narrator.say(&format!("{}: {} triangles, {width}x{height}", path.display(), scene.triangle_count()));
    narrator.emit("scene", json!({ "triangles": scene.triangle_count(), "width": width, "height": height }));
    Ok(scene)
}

/// What to draw, for a world that is published later; refused if it does not fit into memory.
pub(crate) fn setup(args: &RenderArgs, scene: &Scene) -> Result<Setup, Failure> {
    let camera = scene.camera;
    let quality = args.knobs.quality();
    let fields = Fields::of(&Needs::kept(scene, keep(args)));
    memory::demand(Igi::memory_bytes(&camera, &quality, fields), &camera)?;
    Ok(Setup { world: WorldState::default(), camera, quality, fields, seed: args.seed, filter: args.knobs.filter() })
}

fn keep(args: &RenderArgs) -> Keep {
    if args.keep_all { Keep::All } else { Keep::Needed }
}

/// Who does the work, as the command line says.
pub(crate) fn options(hands: &HandsArgs) -> ClusterOptions {
    let embedded = match hands.workers {
        Some(workers) => Some(workers.embedded.unwrap_or_else(cores)),
        None if hands.listen.is_some() => None,
        None => Some(cores()),
    };
    let (token, token_file) = (hands.token.clone(), hands.token_file.clone());
    let (listen, token_lifetime) = (hands.listen, hands.token_lifetime);
    ClusterOptions { embedded, listen, token, token_file, token_lifetime, keep: Keep::Needed }
}

/// When a picture is done, as the command line says.
pub(crate) fn stop(args: &RenderArgs) -> Stop {
    let asked = &args.stop;
    let none = asked.seconds.is_none() && asked.frames.is_none() && asked.error.is_none();
    let seconds = if none { Some(DEFAULT_SECONDS) } else { asked.seconds };
    Stop {
        after: seconds.map(duration),
        frames: asked.frames,
        error: asked.error,
        spent: Duration::ZERO,
        without_workers: args.wait.wait.map(duration),
    }
}

fn duration(seconds: f64) -> Duration {
    Duration::try_from_secs_f64(seconds).unwrap_or(Duration::MAX)
}

/// All that is needed to draw the same picture again, and what came of it.
fn metadata(args: &RenderArgs, time: f64, front: &mut Igi, tally: &Tally) -> Metadata {
    let raw = front.show(Layer::Raw).sha256();
    let Setup { world, camera, quality, seed, filter, .. } = front.setup();
    let mut metadata = vec![
        ("version", env!("CARGO_PKG_VERSION").to_string()),
        ("scene", args.scene.display().to_string()),
        ("world", hex(&world.world)),
        ("revision", world.revision.to_string()),
        ("settings", serde_json::to_string(quality).unwrap_or_default()),
        ("filter", described(filter)),
        ("seed", seed.to_string()),
        ("time", time.to_string()),
        ("frames", tally.frames.to_string()),
        ("seconds", format!("{:.3}", (tally.spent + tally.elapsed).as_secs_f64())),
        ("raw_sha256", hex(&raw)),
        ("command", command(args, time, [camera.width, camera.height], tally, &flags_for(quality, filter))),
    ];
    if let Some(estimate) = tally.error {
        metadata.push(("rel_mse", format!("{:e}", estimate.rel_mse)));
        metadata.push(("rel_mse_95_percent", format!("{:e} to {:e}", estimate.low, estimate.high)));
    }
    metadata
}

/// A filter in words by which it is known again.
pub(crate) fn described(filter: &Filter) -> String {
    format!("{filter:?}")
}

/// The command that draws the same picture, bit for bit.
fn command(args: &RenderArgs, time: f64, [width, height]: [u32; 2], tally: &Tally, flags: &[String]) -> String {
    let Tally { frames, .. } = tally;
    let (scene, seed) = (args.scene.display(), args.seed);
    let exposure = match args.look.exposure.0 {
        Exposure::Auto => "auto".to_string(),
        Exposure::Fixed(stops) => stops.to_string(),
    };
    let tone = format!("{:?}", args.look.tone).to_lowercase();
    format!(
        "igi-master render {scene} --size {width}x{height} --time {time} --seed {seed} --frames {frames} \
         --exposure {exposure} --tone {tone} {}",
        flags.join(" ")
    )
}

/// Bytes as digits.
pub(crate) fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

/// How long it draws if nobody says when to stop: enough for a clean picture of most scenes, short
/// enough not to wonder.
const DEFAULT_SECONDS: f64 = 10.0;
