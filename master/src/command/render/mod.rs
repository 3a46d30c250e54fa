//! `igi-master render`: from a scene file to a picture.

mod meanwhile;
mod saving;
mod settings;

use std::sync::Arc;
use std::time::Duration;

use anyhow::Context;
use frame::{FrontEnd, Igi, Layer, Setup};
use protocol::answer::Fields;
use protocol::question::WorldState;
use scenes::{Needs, Scene};
use serde_json::json;

use crate::checkpoint::CheckpointFolder;
use crate::cli::RenderArgs;
use crate::cluster::{Cluster, quic};
use crate::command::load::load;
use crate::command::outcome::conclude;
use crate::console::{Console, Traffic};
use crate::failure::{Failure, Success};
use crate::files::{Fallback, Output, OutputKind, Unsaved, name_of};
use crate::interrupt::Interrupt;
use crate::memory;
use crate::reception::Reception;
use crate::reception::invitation::Origin;
use crate::render_loop::run_watched;
use crate::spoken::hex;
use crate::stats::{RenderStats, Stop};

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

    let scene = load(&settings.scene, settings.time, settings.size, &console)?;
    let setup = setup(&settings, &scene)?;
    let interrupt = Interrupt::listen();
    let mut checkpoint =
        settings.checkpoint.as_ref().map(|kept| CheckpointFolder::new(&kept.folder, kept.every)).transpose()?;
    let mut cluster = start(&settings, checkpoint.as_ref())?;
    let mut reception = settings.reception.clone();
    if let (Some(checkpoint), Origin::Fresh) = (&checkpoint, &reception.origin) {
        reception.origin = Origin::File(checkpoint.token_file());
    }
    let _reception = Reception::open(&reception, &cluster, &console)?;

    let world = cluster.publish(Arc::new(scene)).context("the scene cannot be sent to workers")?;
    let setup = Setup { world, ..setup };
    let (mut front, before) = begin(setup, checkpoint.as_mut(), &console)?;
    let stop = Stop { spent: before, ..settings.stop };
    let saver = Saver::new(&settings);
    let mut meanwhile = Meanwhile::new(&settings, &saver, &outputs, checkpoint)?;
    let mut look = |front: &mut Igi, stats: &RenderStats| meanwhile.look(front, stats);
    let stats = run_watched(&mut front, &mut cluster, &stop, &interrupt, &mut console, &mut look);
    meanwhile.end(&mut front, &stats);
    let status = cluster.status();
    drop(cluster);

    console.clear();
    let mut unsaved = Unsaved::new(Fallback::Copy);
    if front.frames() > 0 {
        let raw = hex(&front.show(Layer::Raw).sha256());
        console.emit("picture", json!({ "raw_sha256": raw, "frames": front.frames() }));
        saver.save(&outputs, settings.time, &mut front, &stats, &mut unsaved, &console);
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
    setup: Setup,
    checkpoint: Option<&mut CheckpointFolder>,
    console: &Console,
) -> anyhow::Result<(Igi, Duration)> {
    let kept = checkpoint.map(|checkpoint| checkpoint.resume(&setup)).transpose()?.flatten();
    let Some((front, before)) = kept else { return Ok((Igi::new(setup), Duration::ZERO)) };
    console.line(&format!("going on after {} frames, {:.1} s", front.frames(), before.as_secs_f64()));
    console.emit("resumed", json!({ "frames": front.frames(), "seconds": before.as_secs_f64() }));
    Ok((front, before))
}

/// What to draw, for a world that is published later; refused if it does not fit into memory.
pub(crate) fn setup(settings: &Settings, scene: &Scene) -> Result<Setup, Failure> {
    let Settings { quality, filter, seed, keep, .. } = *settings;
    let camera = scene.camera;
    let fields = Fields::of(&Needs::kept(scene, keep));
    memory::demand(Igi::memory_bytes(&camera, &quality, fields), &camera)?;
    Ok(Setup { world: WorldState::default(), camera, quality, fields, seed, filter })
}
