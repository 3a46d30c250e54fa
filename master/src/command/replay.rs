//! `igi-master replay`: a recorded session once more, every picture drawn whole.
//!
//! Time stands still while a picture is drawn, so that none is shown half: what comes out is a function
//! of the recording alone, whoever the workers are and however long they take.

use std::path::Path;
use std::time::Instant;

use frame::front_end::Effort;
use frame::live::{Event, Knobs, Making};
use frame::parts::reproject;
use frame::tone::Tone;
use frame::{Chosen, Layer, Picture};
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
use crate::live::record::{self, Line, What};
use crate::memory;
use crate::methods::Named;
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
    let at = |line: &Line, what: &dyn std::fmt::Display| format!("{}: at {} s: {what}", args.session.display(), line.t);
    for line in &lines {
        if let What::Edit(changes) = &line.what {
            let checked = changes.iter().try_for_each(|change| change.check(&scene));
            checked.map_err(|refused| Failure::Scene(at(line, &refused)))?;
        }
    }
    // Another method plays the same inputs; what was turned of the recorded one means nothing to it.
    let mut methods = vec![match args.method.typed() {
        Some(chosen) => chosen.clone(),
        None => begun.method.after(None).map_err(Failure::Scene)?,
    }];
    for line in &lines {
        if let (What::Turn(named), None) = (&line.what, args.method.typed()) {
            let turned = named.after(methods.last()).map_err(|wrong| Failure::Scene(at(line, &wrong)))?;
            methods.push(turned);
        }
    }
    let looks = lines.iter().filter_map(|line| if let What::Look(camera) = &line.what { Some(camera) } else { None });
    let pixels = |camera: &&Camera| u64::from(camera.width) * u64::from(camera.height);
    let largest = looks.chain([&begun.camera]).max_by_key(pixels).unwrap_or(&begun.camera);
    let fields = Fields::of(&Needs::of(&scene));
    let bytes = methods.iter().map(|method| method.memory_bytes(largest, fields));
    memory::demand(bytes.max().unwrap_or(0), largest)?;
    let mut methods = methods.into_iter();
    let method = methods.next().unwrap_or_else(|| Chosen::new(crate::methods::all()[0]));
    let (rest_after, layer) = (args.frames, Layer::FINAL);
    let mut knobs =
        Knobs { method, seed: begun.seed, rate: 10.0, effort: None, rest_after, layer, making: Making::InTime };
    let mut player = Player::start(scene, knobs.clone(), options::cluster(&args.cluster), true)?;
    let _reception = Reception::open(&options::reception(&args.cluster), player.cluster(), &console)?;
    let world = player.cluster().state().map(|state| hex(&state.world));
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
    let shown: Vec<(Effort, [u32; 2])> = lines.iter().filter_map(|line| shown(&line.what)).collect();
    let (mut drawn, mut skipped, mut hashes) = (0, 0, Vec::new());
    let (mut flicker, mut compared) = (0.0, 0);
    let mut last: Option<reproject::Shown> = None;
    for (index, line) in lines.iter().enumerate() {
        match &line.what {
            What::Shown { batches, still, .. } => {
                if !player.live().is_moving() && !player.live().has_news() {
                    // A method that shows pictures at once has shown all inputs by now that another has gathered.
                    if args.method.typed().is_some() {
                        skipped += 1;
                        continue;
                    }
                    return Err(Failure::Scene(at(line, &"a moving picture, and nothing that moves")));
                }
                let making = Making::Of { batches: *batches, still: *still };
                player.handle(Event::Turn(Knobs { making, ..player.live().knobs().clone() }));
                let frame = player.wait_for(|frame| frame.moving.is_some() && frame.ended)?;
                let other = frame.frames.max(1);
                if other != (*batches).max(1) && args.method.typed().is_none() {
                    let words = format!("a picture of {batches} batches, of which this program draws {other}");
                    return Err(Failure::Scene(at(line, &words)));
                }
                if let Some(output) = numbered(drawn) {
                    save(&output, &frame.picture);
                }
                drawn += 1;
                hashes.extend(frame.picture.sha256());
                // Flicker is change where nothing but the camera has changed.
                let only_looked = index.checked_sub(1).is_some_and(|i| matches!(lines[i].what, What::Look(_)));
                let shown = player.live().shown().cloned();
                if let (true, Some(last), Some(shown)) = (only_looked, &last, &shown)
                    && let Some((change, _)) = reproject::flicker(last, shown)
                {
                    (flicker, compared) = (flicker + change, compared + 1);
                }
                last = shown;
                console.emit("frame", json!({ "t": line.t, "sha256": hex(&frame.picture.sha256()) }));
            }
            // The picture that begins next has the effort of the next that was begun, and is made of as much.
            What::Look(_) | What::Edit(_) | What::Turn(_) => {
                if let What::Turn(_) = line.what {
                    knobs.method = methods.next().unwrap_or(knobs.method);
                }
                let next = shown.get(drawn + skipped + usize::from(player.live().is_moving())).copied();
                let (effort, still) = (next.map(|(effort, _)| effort), next.map_or(0, |(_, [_, still])| still));
                player.handle(Event::Turn(Knobs { effort, making: Making::Held { still }, ..knobs.clone() }));
                match &line.what {
                    What::Look(camera) => player.handle(Event::Look(*camera)),
                    What::Edit(changes) => player.handle(Event::Edit(changes.clone())),
                    What::Turn(_) | What::Shown { .. } => {}
                }
            }
        }
    }
    player.handle(Event::Turn(knobs.clone()));
    let end = player.wait_for_rest()?;
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

/// At what effort a moving picture was drawn; of how many batches, and after how many still frames.
fn shown(what: &What) -> Option<(Effort, [u32; 2])> {
    match *what {
        What::Shown { effort, batches, still } => Some((Effort(effort.clamp(EFFORT_MIN, 1.0)), [batches, still])),
        _ => None,
    }
}

/// Less is no picture.
const EFFORT_MIN: f32 = 1e-4;

/// What a recording begins with.
pub(super) fn begun(scene: &Path, world: &WorldState, time: f64, camera: Camera, knobs: &Knobs) -> record::Begun {
    let (igi_session, world, method) = (record::VERSION, Some(hex(&world.world)), Named::from(&knobs.method));
    record::Begun { igi_session, scene: scene.to_path_buf(), time, seed: knobs.seed, world, method, camera }
}
