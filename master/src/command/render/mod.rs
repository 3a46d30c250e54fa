//! `igi-master render`: from a scene file to a picture.

mod meanwhile;
mod saving;
mod settings;

use std::sync::Arc;
use std::time::Duration;

use anyhow::Context;
use frame::{FrontEnd, Plane, View};
use protocol::answer::Fields;
use protocol::question::WorldState;
use scenes::read::Loaded;
use scenes::{Needs, Scene};
use serde_json::json;

use crate::cli::RenderArgs;
use crate::command::load::{load, say_what_is_missing};
use crate::command::outcome::conclude;
use runtime::checkpoint::CheckpointFolder;
use runtime::cluster::{Cluster, quic};
use runtime::console::{Console, Traffic};
use runtime::failure::{Failure, Success};
use runtime::files::{Fallback, Output, OutputKind, Unsaved, name_of};
use runtime::interrupt::Interrupt;
use runtime::memory;
use runtime::reception::Reception;
use runtime::reception::invitation::Origin;
use runtime::render_loop::run_watched;
use runtime::spoken::hex;
use runtime::stats::{RenderStats, Stop};

pub(crate) use meanwhile::Meanwhile;
pub(crate) use saving::{Saver, described};
pub(crate) use settings::Settings;

/// Renders, and saves.
///
/// # Errors
/// [`Failure`], before any work is done where that is possible.
pub fn render(args: &RenderArgs) -> Result<Success, Failure> {
    let settings = Settings::new(args);
    let mut console = Console::new(settings.console);
    let outputs = match settings.outputs.as_slice() {
        [] => vec![Output { path: format!("{}.png", name_of(&settings.scene)).into(), kind: OutputKind::Png }],
        outputs => outputs.to_vec(),
    };
    outputs.iter().try_for_each(Output::check)?;
    let denoiser = settings.denoiser()?;

    let Loaded { scene, time, .. } = load(&settings.scene, settings.time, settings.size, &console)?;
    let scene = Arc::new(scene);
    say_what_is_missing(settings.method.method, &scene, &console);
    let view = view(&settings, &scene)?;
    let interrupt = Interrupt::listen();
    let mut checkpoint =
        settings.checkpoint.as_ref().map(|kept| CheckpointFolder::new(&kept.folder, kept.every)).transpose()?;
    let mut cluster = start(&settings, checkpoint.as_ref())?;
    let mut reception = settings.reception.clone();
    if let (Some(checkpoint), Origin::Fresh) = (&checkpoint, &reception.origin) {
        reception.origin = Origin::File(checkpoint.token_file());
    }
    let _reception = Reception::open(&reception, &cluster, &console)?;

    let world = cluster.publish(scene).context("the scene cannot be sent to workers")?;
    let view = View { world, ..view };
    let (mut front, before) = begin(&settings, &view, checkpoint.as_mut(), &console)?;
    let front = front.as_mut();
    let stop = Stop { spent: before, ..settings.stop };
    let saver = Saver::new(&settings, &view, denoiser);
    let mut meanwhile = Meanwhile::new(&settings, time, (&saver, &outputs), checkpoint)?;
    let mut look = |front: &mut (dyn FrontEnd + 'static), stats: &RenderStats| meanwhile.look(front, stats);
    let stats = run_watched(front, &mut cluster, &stop, &interrupt, &mut console, &mut look);
    meanwhile.end(front, &stats);
    let status = cluster.status();
    drop(cluster);

    console.clear();
    let mut unsaved = Unsaved::new(Fallback::Copy);
    if front.frames() > 0 {
        let raw = hex(&front.show(Plane::Raw).sha256());
        console.emit("picture", json!({ "raw_sha256": raw, "frames": front.frames() }));
        saver.save(&outputs, time, front, &stats, &mut unsaved, &console);
    }
    console.summary(&stats, Traffic { sent: status.bytes_sent, received: status.bytes_received });
    conclude(&stats, front.frames() > 0, &unsaved)
}

/// Starts the workers of this process and listens for others, with the token that was kept if there is one.
pub(crate) fn start(settings: &Settings, checkpoint: Option<&CheckpointFolder>) -> anyhow::Result<Cluster> {
    let mut options = settings.cluster.clone();
    if let (Some(checkpoint), None, None) = (checkpoint, &options.token, &options.token_file) {
        options.token = checkpoint.token()?.filter(|token| quic::is_current(token));
    }
    let cluster = Cluster::start(options).context("workers cannot be started")?;
    if let (Some(checkpoint), Some(token)) = (checkpoint, cluster.token()) {
        checkpoint.keep_token(&token.to_string())?;
    }
    Ok(cluster)
}

/// A new picture, or what was kept of it and how long that took.
fn begin(
    settings: &Settings,
    view: &View,
    checkpoint: Option<&mut CheckpointFolder>,
    console: &Console,
) -> Result<(Box<dyn FrontEnd>, Duration), Failure> {
    let method = &settings.method;
    let is_kept = checkpoint.is_some();
    let kept = checkpoint.map(|checkpoint| checkpoint.resume(method, view)).transpose()?.flatten();
    let Some((front, before)) = kept else {
        let front = method.begin(view);
        if is_kept && front.keep().is_none() {
            let name = method.method.name();
            return Err(Failure::Usage(format!("--checkpoint: method {name} cannot go on with a picture")));
        }
        return Ok((front, Duration::ZERO));
    };
    console.line(&format!("going on after {} frames, {:.1} s", front.frames(), before.as_secs_f64()));
    console.emit("resumed", json!({ "frames": front.frames(), "seconds": before.as_secs_f64() }));
    Ok((front, before))
}

/// What to draw, of a world that is published later; refused if it does not fit into memory.
pub(crate) fn view(settings: &Settings, scene: &Arc<Scene>) -> Result<View, Failure> {
    let camera = scene.camera;
    let fields = Fields::of(&Needs::kept(scene, settings.keep));
    memory::demand(settings.method.memory_bytes(&camera, fields), &camera)?;
    Ok(View { world: WorldState::default(), scene: Arc::clone(scene), fields, camera, seed: settings.seed })
}
