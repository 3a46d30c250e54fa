//! `igi-master replay`: a recorded session once more, every picture drawn whole.
//!
//! Time stands still while a picture is drawn, so that none is shown half: what comes out is a function
//! of the recording alone, whoever the workers are and however long they take.

use std::path::Path;
use std::time::Instant;

use frame::Picture;
use frame::live::Knobs;
use frame::parts::reproject;
use frame::tone::Tone;
use protocol::question::WorldState;
use scenes::Camera;
use serde_json::json;

use crate::cli::ReplayArgs;
use crate::command::lockstep::{Asked, Played, play};
use crate::command::options;
use crate::command::script::Script;
use runtime::console::Console;
use runtime::failure::{Failure, Success};
use runtime::files::{Fallback, Output, OutputKind, Unsaved, encode_exr, encode_png};
use runtime::live::player::Player;
use runtime::live::record;
use runtime::methods::Named;
use runtime::reception::Reception;
use runtime::spoken::hex;

/// Replays, and says what came of it.
///
/// # Errors
/// [`Failure`] if the recording or its scene cannot be read, or no worker draws.
pub fn replay(args: &ReplayArgs) -> Result<Success, Failure> {
    let console = Console::new(options::console(args.talk));
    args.output.iter().try_for_each(Output::check)?;
    let script = Script::read(&args.session, args.scene.as_deref(), &console)?;
    let other = args.method.typed();
    let methods = script.methods(other)?;
    script.demand_memory(&methods)?;
    let knobs = script.knobs(methods[0].clone(), args.frames);
    let mut player = Player::start(script.scene.clone(), knobs.clone(), options::cluster(&args.cluster), true)?;
    let _reception = Reception::open(&options::reception(&args.cluster), player.cluster(), &console)?;
    if let Some(words) = script.doubt(player.cluster().state()) {
        console.line(&format!("{}: {words}", script.scene_path.display()));
        console.emit("note", json!({ "message": words }));
    }

    let began = Instant::now();
    let mut unsaved = Unsaved::new(Fallback::Copy);
    let mut save = |output: &Output, picture: &Picture| {
        let encoded = match output.kind {
            OutputKind::Png => encode_png(&Tone::PLAIN.develop(picture)),
            OutputKind::Exr => encode_exr(picture, &[], &[("session", args.session.display().to_string())]),
        };
        match unsaved.write(&output.path, encoded) {
            Ok(()) => console.saved(&output.path),
            Err(reason) => console.unsaved(&output.path, &reason),
        }
    };
    let numbered = |number: usize| args.output.as_ref()?.numbered(u32::try_from(number).ok()?);
    let (mut drawn, mut hashes) = (0, Vec::new());
    let (mut flicker, mut compared) = (0.0, 0);
    let mut last: Option<reproject::Shown> = None;
    let asked = Asked { is_other_method: other.is_some(), effort: None };
    let end = play(&script, &mut player, (knobs, &methods), asked, &mut |played: &Played| {
        let picture = &played.frame.picture;
        if let Some(output) = numbered(drawn) {
            save(&output, picture);
        }
        drawn += 1;
        hashes.extend(picture.sha256());
        // Flicker is change where nothing but the camera has changed.
        let shown = played.player.live().shown().cloned();
        if let (true, Some(last), Some(shown)) = (played.has_only_looked, &last, &shown)
            && let Some((change, _)) = reproject::flicker(last, shown)
        {
            (flicker, compared) = (flicker + change, compared + 1);
        }
        last = shown;
        let t = script.lines[played.line].t;
        console.emit("frame", json!({ "t": t, "sha256": hex(&picture.sha256()) }));
        Ok(())
    })?;
    hashes.extend(end.picture.sha256());
    let seconds = began.elapsed().as_secs_f64();
    if let Some(output) = numbered(drawn).as_ref().or(args.output.as_ref()) {
        save(output, &end.picture);
    }
    let sha256 = hex(&protocol::parts::hash(&hashes));
    let flicker = if compared > 0 { Some(flicker / f64::from(compared)) } else { None };
    console.line(&format!(
        "{drawn} moving pictures and {} still frames in {seconds:.1} s; flicker {}; all pictures {sha256}",
        end.frames,
        flicker.map_or("–".into(), |value| format!("{value:.5}")),
    ));
    let told =
        json!({ "moving": drawn, "frames": end.frames, "seconds": seconds, "flicker": flicker, "sha256": sha256 });
    console.emit("replayed", told);
    unsaved.verdict()?;
    Ok(Success::Done)
}

/// What a recording begins with.
pub(super) fn begun(scene: &Path, world: &WorldState, time: f64, camera: Camera, knobs: &Knobs) -> record::Begun {
    let (igi_session, world, method) = (record::VERSION, Some(hex(&world.world)), Named::from(&knobs.method));
    record::Begun { igi_session, scene: scene.to_path_buf(), time, seed: knobs.seed, world, method, camera }
}
