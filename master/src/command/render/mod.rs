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

use crate::checkpoint::Keeper;
use crate::cli::RenderArgs;
use crate::cluster::{Cluster, quic};
use crate::command::load::load;
use crate::command::outcome::conclude;
use crate::conduct::conduct_watched;
use crate::failure::{Failure, Success};
use crate::files::{Fallback, Output, OutputKind, Unsaved, name_of};
use crate::interrupt::Interrupt;
use crate::memory;
use crate::narrator::{Narrator, Traffic};
use crate::reception::Reception;
use crate::reception::invitation::Origin;
use crate::spoken::hex;
use crate::stats::{Stop, Tally};

pub(crate) use meanwhile::Meanwhile;
pub(crate) use saving::{Saver, described};
pub(crate) use settings::Settings;

/// Renders, and saves.
///
/// # Errors
/// [`Failure`], before any work is done where that is possible.
pub fn render(args: &RenderArgs) -> Result<Success, Failure> {
    let settings = Settings::new(args);
    let mut narrator = Narrator::new(settings.console);
    let outputs = match settings.outputs.as_slice() {
        [] => vec![Output { path: format!("{}.png", name_of(&settings.scene)).into(), kind: OutputKind::Png }],
        outputs => outputs.to_vec(),
    };
    outputs.iter().try_for_each(Output::check)?;

    let scene = load(&settings.scene, settings.time, settings.size, &narrator)?;
    let setup = setup(&settings, &scene)?;
    let interrupt = Interrupt::listen();
    let checkpoint = settings.checkpoint.as_ref();
    let mut keeper = checkpoint.map(|kept| Keeper::new(&kept.folder, kept.every)).transpose()?;
    let mut cluster = start(&settings, keeper.as_ref())?;
    let mut reception = settings.reception.clone();
    if let (Some(keeper), Origin::Fresh) = (&keeper, &reception.origin) {
        reception.origin = Origin::File(keeper.token_file());
    }
    let _reception = Reception::open(&reception, &cluster, &narrator)?;

    let world = cluster.publish(Arc::new(scene)).context("the scene cannot be sent to workers")?;
    let setup = Setup { world, ..setup };
    let (mut front, before) = begin(setup, keeper.as_mut(), &narrator)?;
    let stop = Stop { spent: before, ..settings.stop };
    let saver = Saver::new(&settings);
    let mut meanwhile = Meanwhile::new(&settings, &saver, &outputs, keeper)?;
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
        saver.save(&outputs, settings.time, &mut front, &tally, &mut unsaved, &narrator);
    }
    narrator.summary(&tally, Traffic { sent: status.bytes_sent, received: status.bytes_received });
    conclude(&tally, front.frames() > 0, &unsaved)
}

/// Starts the workers of this process and listens for others, with the token that was kept if there is one.
pub(crate) fn start(settings: &Settings, keeper: Option<&Keeper>) -> anyhow::Result<Cluster> {
    let mut options = settings.cluster.clone();
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

/// What to draw, for a world that is published later; refused if it does not fit into memory.
pub(crate) fn setup(settings: &Settings, scene: &Scene) -> Result<Setup, Failure> {
    let Settings { quality, filter, seed, keep, .. } = *settings;
    let camera = scene.camera;
    let fields = Fields::of(&Needs::kept(scene, keep));
    memory::demand(Igi::memory_bytes(&camera, &quality, fields), &camera)?;
    Ok(Setup { world: WorldState::default(), camera, quality, fields, seed, filter })
}
