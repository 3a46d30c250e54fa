//! `igi-master reference`: the picture to judge others by, path-traced until its noise is small enough.

use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, Instant};

use anyhow::{Context, anyhow};
use frame::methods::reference::{REFERENCE, SAMPLES_PER_FRAME};
use frame::{FrontEnd, Plane, Reference, ReferenceSetup};
use protocol::question::WorldState;
use scenes::Camera;
use scenes::read::Loaded;
use serde_json::json;

use crate::cli::ReferenceArgs;
use crate::command::load::{load, say_what_is_missing};
use crate::command::options::{self, duration};
use crate::command::outcome::conclude;
use runtime::cluster::Cluster;
use runtime::console::{Console, Traffic};
use runtime::failure::{Failure, Success};
use runtime::files::{Fallback, MISSES, Metadata, OutputKind, Unsaved, encode_record, read_record, write_whole};
use runtime::interrupt::Interrupt;
use runtime::memory;
use runtime::reception::Reception;
use runtime::render_loop::{Watched, run_watched};
use runtime::spoken::hex;
use runtime::stats::{RenderStats, Stop};

/// Draws a reference, or goes on with one, and saves it now and then.
///
/// # Errors
/// [`Failure`], before any work is done where that is possible.
pub fn reference(args: &ReferenceArgs) -> Result<Success, Failure> {
    let mut console = Console::new(options::console(args.talk));
    if args.output.kind != OutputKind::Exr {
        return Err(Failure::Usage("a reference is saved as .exr: its numbers are linear and need 32 bits".into()));
    }
    args.output.check()?;
    let Loaded { scene, time, .. } = load(&args.scene, args.time, args.size, &console)?;
    let misses = say_what_is_missing(&REFERENCE, &scene, &console);
    let camera = scene.camera;
    memory::demand(Reference::memory_bytes(&camera), &camera)?;
    let interrupt = Interrupt::listen();
    let mut cluster = Cluster::start(options::cluster(&args.cluster)).context("workers cannot be started")?;
    let _reception = Reception::open(&options::reception(&args.cluster), &cluster, &console)?;
    let world = cluster.publish(Arc::new(scene)).context("the scene cannot be sent to workers")?;
    let setup = ReferenceSetup { world, camera, seed: args.seed, max_bounces: args.max_bounces };
    let mut front = begin(args, setup, &console)?;

    let mut saved = Instant::now();
    let path = &args.output.path;
    let mut keep = |front: &mut Reference, _: &RenderStats| {
        if front.frames() > 0 && saved.elapsed() >= BETWEEN_SAVES {
            saved = Instant::now();
            // There may be room again when it is done.
            if let Err(error) =
                encode((args, time), &setup, misses.as_ref(), front).and_then(|bytes| write_whole(path, &bytes))
            {
                tracing::warn!("what is drawn so far was not saved, and drawing goes on: {error:#}");
            }
        }
        Watched::GoOn
    };
    let stats = run_watched(&mut front, &mut cluster, &stop(args), &interrupt, &mut console, &mut keep);
    let status = cluster.status();
    drop(cluster);
    console.clear();
    let mut unsaved = Unsaved::new(Fallback::Copy);
    if front.frames() > 0 {
        let raw = hex(&front.show(Plane::Raw).sha256());
        console.emit("picture", json!({ "raw_sha256": raw, "samples": front.samples() }));
        match unsaved.write(path, encode((args, time), &setup, misses.as_ref(), &mut front)) {
            Ok(()) => console.saved(path),
            Err(reason) => console.unsaved(path, &reason),
        }
    }
    console.line(&format!(
        "{} samples a pixel; {:.2} million samples/s in this run",
        front.samples(),
        stats.rate(stats.pixels * u64::from(SAMPLES_PER_FRAME)) / 1e6
    ));
    console.summary(&stats, Traffic { sent: status.bytes_sent, received: status.bytes_received });
    let ended = conclude(&stats, front.frames() > 0, &unsaved)?;
    match misses {
        Some(missing) if ended == Success::Done => {
            Err(Failure::Lacking(format!("the reference is no truth to judge by: it lacks {missing}")))
        }
        _ => Ok(ended),
    }
}

/// From nothing, or from what an earlier run has saved.
fn begin(args: &ReferenceArgs, setup: ReferenceSetup, console: &Console) -> Result<Reference, Failure> {
    let path = &args.output.path;
    if args.fresh || !path.exists() {
        return Ok(Reference::new(setup));
    }
    let advice = "name another file, or begin again with --fresh";
    let record = read_record(path).map_err(|error| Failure::Failed(anyhow!("{error:#}; {advice}")))?;
    let mut other: Vec<&str> = identity(&setup)
        .into_iter()
        .filter(|(name, value)| record.metadata.get(*name) != Some(value))
        .map(|(name, _)| name)
        .collect();
    if (record.width, record.height) != (setup.camera.width, setup.camera.height) {
        other.push("size");
    }
    if !other.is_empty() {
        let path = path.display();
        return Err(Failure::Usage(format!("{path}: is there, but differs in {}: {advice}", other.join(", "))));
    }
    let front = Reference::resume(setup, record.state);
    console.line(&format!("going on with {}: {} samples a pixel are there", path.display(), front.samples()));
    Ok(front)
}

/// What must be the same for samples to be added up.
fn identity(setup: &ReferenceSetup) -> [(&'static str, String); 5] {
    let ReferenceSetup { world: WorldState { world, revision }, camera, seed, max_bounces } = setup;
    [
        ("world", hex(world)),
        ("revision", revision.to_string()),
        ("camera", described(camera)),
        ("seed", seed.to_string()),
        ("max_bounces", max_bounces.map_or("none".into(), |most| most.to_string())),
    ]
}

fn described(camera: &Camera) -> String {
    serde_json::to_string(camera).unwrap_or_default()
}

fn stop(args: &ReferenceArgs) -> Stop {
    let asked = &args.stop;
    let none = asked.seconds.is_none() && asked.samples.is_none() && asked.until_noise.is_none();
    Stop {
        after: asked.seconds.map(duration),
        frames: asked.samples.map(|samples| samples.div_ceil(SAMPLES_PER_FRAME)),
        error: if none { Some(DEFAULT_NOISE) } else { asked.until_noise },
        without_workers: options::wait(&args.wait),
        spent: Duration::ZERO,
    }
}

/// The file: mean, variance, and what is needed to go on.
fn encode(
    (args, time): (&ReferenceArgs, f64),
    setup: &ReferenceSetup,
    misses: Option<&String>,
    front: &mut Reference,
) -> anyhow::Result<Vec<u8>> {
    let mut metadata: Metadata = identity(setup).into();
    metadata.push(("version", env!("CARGO_PKG_VERSION").to_string()));
    metadata.push(("scene", args.scene.display().to_string()));
    metadata.push(("time", time.to_string()));
    metadata.push(("command", command(&args.scene, setup, time, front.samples())));
    metadata.extend(misses.map(|missing| (MISSES, missing.clone())));
    if let Some(noise) = front.error() {
        metadata.push(("noise_rel_mse", format!("{:e}", noise.rel_mse)));
    }
    encode_record(front, &metadata)
}

/// The command that draws the same picture, bit for bit.
fn command(scene: &Path, setup: &ReferenceSetup, time: f64, samples: u32) -> String {
    let Camera { width, height, .. } = setup.camera;
    let longest = setup.max_bounces.map_or(String::new(), |most| format!(" --max-bounces {most}"));
    let (scene, seed) = (scene.display(), setup.seed);
    format!(
        "igi-master reference {scene} --size {width}x{height} --time {time} --seed {seed} --samples {samples}{longest}"
    )
}

/// At most so much work is lost if the machine fails.
const BETWEEN_SAVES: Duration = Duration::from_secs(60);
/// Good enough to tell most things, on most scenes within minutes.
const DEFAULT_NOISE: f64 = 1e-3;
