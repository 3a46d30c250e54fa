//! `igi-master replay`: a recorded session once more, every picture drawn whole.
//!
//! Time stands still while a picture is drawn, so that none is shown half: what comes out is a function
//! of the recording alone, whoever the workers are and however long they take.

use std::path::Path;
use std::time::Instant;

use frame::Igi;
use frame::live::pace::Level;
use frame::live::{Event, Knobs, reproject};
use frame::tone::Tone;
use protocol::answer::Fields;
use protocol::question::WorldState;
use scenes::{Camera, Needs};
use serde_json::json;

use crate::cli::ReplayArgs;
use crate::command::load::load;
use crate::command::options;
use crate::console::Console;
use crate::failure::{Failure, Success};
use crate::files::{Fallback, Output, OutputKind, Unsaved, encode_exr, encode_png};
use crate::live::player::Player;
use crate::live::record::{self, What};
use crate::memory;
use crate::reception::Reception;
use crate::spoken::hex;

/// Replays, and says what came of it.
///
/// # Errors
/// [`Failure`] if the recording or its scene cannot be read, or no worker draws.
pub fn replay(args: &ReplayArgs) -> Result<Success, Failure> {
    let console = Console::new(options::console(args.talk));
    args.output.iter().try_for_each(Output::check)?;
    let recording = record::read(&args.session)?;
    let begun = recording.begun.clone();
    let path = args.scene.as_deref().unwrap_or(&begun.scene);
    let mut scene = load(path, begun.time, None, &console)?;
    let lines = recording.into_lines(&scene);
    scene.camera = begun.camera;
    for line in &lines {
        if let What::Edit(changes) = &line.what {
            let checked = changes.iter().try_for_each(|change| change.check(&scene));
            checked
                .map_err(|refused| Failure::Scene(format!("{}: at {} s: {refused}", args.session.display(), line.t)))?;
        }
    }
    let looks = lines.iter().filter_map(|line| if let What::Look(camera) = &line.what { Some(camera) } else { None });
    let pixels = |camera: &&Camera| u64::from(camera.width) * u64::from(camera.height);
    let largest = looks.chain([&begun.camera]).max_by_key(pixels).unwrap_or(&begun.camera);
    let turns =
        lines.iter().filter_map(|line| if let What::Turn { quality, .. } = &line.what { Some(quality) } else { None });
    let bytes = |quality| Igi::memory_bytes(largest, quality, Fields::of(&Needs::of(&scene)));
    memory::demand(turns.chain([&begun.quality]).map(bytes).max().unwrap_or(0), largest)?;
    let mut knobs = Knobs {
        quality: begun.quality,
        filter: begun.filter.filter(),
        seed: begun.seed,
        rate: 10.0,
        level: None,
        steady: begun.steady,
        rest_after: args.frames,
        layer: frame::Layer::Final,
        lights: false,
    };
    let mut player = Player::start(scene, knobs, options::cluster(&args.cluster), true)?;
    let _reception = Reception::open(&options::reception(&args.cluster), &player.cluster, &console)?;
    let world = player.cluster.state().map(|state| hex(&state.world));
    let doubt = match &begun.world {
        None => Some("the recording is of an older format: whether its scene is this one cannot be told"),
        was if *was != world => Some("the scene is not the one that was recorded: pictures will differ"),
        _ => None,
    };
    if let Some(words) = doubt {
        console.line(&format!("{}: {words}", path.display()));
        console.emit("note", json!({ "message": words }));
    }

    let began = Instant::now();
    let levels: Vec<Level> = lines.iter().filter_map(|line| level(&line.what)).collect();
    let (mut drawn, mut hashes) = (0, Vec::new());
    let (mut flicker, mut compared) = (0.0, 0);
    let mut last: Option<reproject::Shown> = None;
    for (index, line) in lines.iter().enumerate() {
        match &line.what {
            What::Moving { .. } => {
                if !player.live.is_moving() {
                    let place = format!("{}: at {} s", args.session.display(), line.t);
                    return Err(Failure::Scene(format!("{place}: a moving picture, and nothing that moves")));
                }
                let frame = player.wait_for(|frame| frame.moving.is_some() && frame.ended)?;
                drawn += 1;
                hashes.extend(frame.picture.sha256());
                // Flicker is change where nothing but the camera has changed.
                let only_looked = index.checked_sub(1).is_some_and(|i| matches!(lines[i].what, What::Look(_)));
                let shown = player.live.shown().cloned();
                if let (true, Some(last), Some(shown)) = (only_looked, &last, &shown)
                    && let Some((change, _)) = reproject::flicker(last, shown)
                {
                    (flicker, compared) = (flicker + change, compared + 1);
                }
                last = shown;
                console.emit("frame", json!({ "t": line.t, "sha256": hex(&frame.picture.sha256()) }));
            }
            // The frame that begins next has the level of the next that was begun.
            What::Look(_) | What::Edit(_) | What::Turn { .. } => {
                if let What::Turn { quality, filter } = line.what {
                    (knobs.quality, knobs.filter) = (quality, filter.filter());
                }
                let level = levels.get(drawn + usize::from(player.live.is_moving())).copied();
                player.say(Event::Turn(Knobs { level, ..knobs }));
                match &line.what {
                    What::Look(camera) => player.say(Event::Look(*camera)),
                    What::Edit(changes) => player.say(Event::Edit(changes.clone())),
                    What::Turn { .. } | What::Moving { .. } => {}
                }
            }
        }
    }
    let end = player.wait_for_rest()?;
    hashes.extend(end.picture.sha256());
    let seconds = began.elapsed().as_secs_f64();
    let mut unsaved = Unsaved::new(Fallback::Copy);
    if let Some(output) = &args.output {
        let encoded = match output.kind {
            OutputKind::Png => encode_png(&Tone::PLAIN.develop(&end.picture)),
            OutputKind::Exr => encode_exr(&end.picture, &[], &[("session", args.session.display().to_string())]),
        };
        match unsaved.write(&output.path, encoded) {
            Ok(()) => console.saved(&output.path),
            Err(reason) => console.unsaved(&output.path, &reason),
        }
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

fn level(what: &What) -> Option<Level> {
    match *what {
        What::Moving { scale, lights } => Some(Level { scale: scale.clamp(0.01, 1.0), lights: lights.clamp(0.0, 1.0) }),
        _ => None,
    }
}

/// What a recording begins with.
pub(super) fn begun(
    scene: &Path,
    world: &WorldState,
    time: f64,
    camera: scenes::Camera,
    knobs: &Knobs,
) -> record::Begun {
    let Knobs { quality, filter, seed, steady, .. } = *knobs;
    let (igi_session, world, filter) = (record::VERSION, Some(hex(&world.world)), filter.into());
    record::Begun { igi_session, scene: scene.to_path_buf(), world, time, seed, quality, filter, steady, camera }
}
