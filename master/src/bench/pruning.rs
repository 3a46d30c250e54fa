//! `igi-master bench --pruning`: what leaving out saves, measured: every scene drawn by the whole pipeline and by
//! the pruned one in turn, in one process, on one thread, by processor time; the pictures must be the same bits.

use std::sync::Arc;

use anyhow::{Context, anyhow};
use frame::{FrontEnd, Igi, Layer, Setup};
use protocol::answer::{Cost, Fields};
use protocol::question::WorldState;
use scenes::{Keep, Needs, Scene};
use serde_json::json;

use super::plain_room::{laden_room, plain_room};
use crate::cli::{BenchArgs, TalkArgs};
use crate::cluster::{Cluster, ClusterOptions};
use crate::conduct::{Ending, Stop, conduct};
use crate::failure::{Failure, Success};
use crate::files::name_of;
use crate::interrupt::Interrupt;
use crate::narrator::{Narrator, say};
use crate::plan::parts::parts;
use crate::report::clock::StopWatch;

/// Turns of each pipeline: odd, so that there is a median.
const TURNS: usize = 7;

/// One pipeline, ready to draw.
struct Side {
    keep: Keep,
    cluster: Cluster,
    world: WorldState,
    scene: Arc<Scene>,
    runs: Vec<Run>,
}

/// What some frames took.
struct Run {
    cpu_ms_per_frame: f64,
    bytes_per_pixel: f64,
    cost: Cost,
    picture: [[u8; 32]; 2],
}

/// One scene's figures.
struct Row {
    name: String,
    left_out: Vec<&'static str>,
    /// The whole pipeline, and the pruned one.
    sides: [Figures; 2],
    /// Whole over pruned, turn by turn: least, median, greatest.
    ratio: [f64; 3],
    same_bits: bool,
    frames: u32,
}

struct Figures {
    cpu_ms_per_frame: f64,
    bytes_per_pixel: f64,
    film_bytes_per_pixel: u64,
    cost: Cost,
}

/// Measures all scenes, and a room that is built here.
///
/// # Errors
/// [`Failure`] if a scene cannot be read, no worker can be started, or the two pipelines draw different pictures.
pub(super) fn bench_pruning(args: &BenchArgs) -> Result<Success, Failure> {
    let interrupt = Interrupt::listen();
    let mut rows = Vec::new();
    let mut scenes = Vec::new();
    for path in &args.scenes {
        scenes.push((name_of(path), scenes::read::load(path)?.scene));
    }
    scenes.push(("a plain room".into(), plain_room()));
    for (name, mut scene) in scenes {
        (scene.camera.width, scene.camera.height) = (args.size.width, args.size.height);
        let Some(row) = measure(name, scene, args, &interrupt)? else { return Ok(Success::Interrupted) };
        if args.json {
            say!("{}", row.json());
        } else {
            eprintln!("{}: {:.3}", row.name, row.ratio[1]);
        }
        rows.push(row);
    }
    let mut rooms = [laden_room(), plain_room()];
    for room in &mut rooms {
        (room.camera.width, room.camera.height) = (args.size.width, args.size.height);
    }
    let [laden, plain] = rooms.map(|room| Side::start(Keep::Needed, &Arc::new(room)));
    let Some((burden, same_room)) = race(&mut [laden?, plain?], args, &interrupt) else {
        return Ok(Success::Interrupted);
    };
    if args.json {
        say!(
            "{}",
            json!({ "laden_over_plain": burden[1], "least": burden[0], "greatest": burden[2], "same_bits": same_room })
        );
    } else {
        print(&rows, args);
        say!(
            "\nThe plain room from a file that also holds glass, mirrors, gloss, textures, holes, lamps, a moving object, lights \
             and an environment, all hidden, unused or black: {:.3} ({:.3}–{:.3}) times its time, {}.",
            burden[1],
            burden[0],
            burden[2],
            if same_room { "the same bits" } else { "ANOTHER PICTURE" }
        );
    }
    if !same_room {
        return Err(anyhow!("what nobody sees in a file changes the picture").into());
    }
    match rows.iter().find(|row| !row.same_bits) {
        Some(row) => Err(anyhow!("{}: the pruned pipeline draws another picture than the whole one", row.name).into()),
        None => Ok(Success::Done),
    }
}

/// Nothing if it was interrupted.
fn measure(name: String, scene: Scene, args: &BenchArgs, interrupt: &Interrupt) -> Result<Option<Row>, Failure> {
    let scene = Arc::new(scene);
    let mut sides = [Side::start(Keep::All, &scene)?, Side::start(Keep::Needed, &scene)?];
    let Some((ratio, same_bits)) = race(&mut sides, args, interrupt) else { return Ok(None) };
    let plan = parts(&Needs::of(&scene), &args.knobs.quality(), &args.knobs.filter());
    Ok(Some(Row {
        name,
        left_out: plan.iter().filter(|part| !part.used).map(|part| part.name).collect(),
        same_bits,
        sides: sides.map(|side| side.figures(args)),
        ratio,
        frames: args.frames,
    }))
}

/// Both draw in turn: the time of the first over that of the second, turn by turn (least, median, greatest), and whether
/// their pictures are the same bits. Nothing if it was interrupted.
fn race(sides: &mut [Side; 2], args: &BenchArgs, interrupt: &Interrupt) -> Option<([f64; 3], bool)> {
    for turn in 0..=TURNS {
        // The first turn builds trees and warms caches: it is nobody's.
        for place in 0..2 {
            let side = &mut sides[(place + turn) % 2];
            let run = side.draw(turn as u64, args, interrupt)?;
            if turn > 0 {
                side.runs.push(run);
            }
        }
    }
    let both = || sides[0].runs.iter().zip(&sides[1].runs);
    let mut ratios: Vec<f64> = both().map(|(a, b)| a.cpu_ms_per_frame / b.cpu_ms_per_frame).collect();
    ratios.sort_by(f64::total_cmp);
    let same_bits = both().all(|(a, b)| a.picture == b.picture);
    Some(([ratios[0], ratios[TURNS / 2], ratios[TURNS - 1]], same_bits))
}

impl Side {
    fn start(keep: Keep, scene: &Arc<Scene>) -> Result<Self, Failure> {
        let options = ClusterOptions { embedded: Some(1), keep, ..ClusterOptions::default() };
        let mut cluster = Cluster::start(options).context("workers cannot be started")?;
        let world = cluster.publish(Arc::clone(scene)).context("the scene cannot be sent to workers")?;
        Ok(Self { keep, cluster, world, scene: Arc::clone(scene), runs: Vec::new() })
    }

    /// Some frames of a picture; nothing if interrupted. Each seed has light sets of its own, so that none is there
    /// from the turn before.
    fn draw(&mut self, seed: u64, args: &BenchArgs, interrupt: &Interrupt) -> Option<Run> {
        let (quality, filter) = (args.knobs.quality(), args.knobs.filter());
        let (world, camera, fields) = (self.world, self.scene.camera, self.fields());
        let mut front = Igi::new(Setup { world, camera, quality, fields, seed, filter });
        let stop = Stop { frames: Some(args.frames), ..Stop::default() };
        let mut quiet = Narrator::new(TalkArgs { quiet: true, json: false });
        let watch = StopWatch::start();
        let tally = conduct(&mut front, &mut self.cluster, &stop, interrupt, &mut quiet);
        let shown = front.show(Layer::Final);
        let cpu = watch.elapsed().cpu;
        (tally.ending == Ending::Enough).then(|| Run {
            cpu_ms_per_frame: cpu * 1e3 / f64::from(tally.frames.max(1)),
            bytes_per_pixel: tally.answer_bytes as f64 / tally.pixels.max(1) as f64,
            cost: tally.cost,
            picture: [front.show(Layer::Raw).sha256(), shown.sha256()],
        })
    }

    fn fields(&self) -> Fields {
        Fields::of(&Needs::kept(&self.scene, self.keep))
    }

    fn figures(&self, args: &BenchArgs) -> Figures {
        let mut times: Vec<f64> = self.runs.iter().map(|run| run.cpu_ms_per_frame).collect();
        times.sort_by(f64::total_cmp);
        let mut cost = Cost::default();
        self.runs.iter().for_each(|run| cost += run.cost);
        Figures {
            cpu_ms_per_frame: times[TURNS / 2],
            bytes_per_pixel: self.runs[0].bytes_per_pixel,
            film_bytes_per_pixel: frame::parts::Film::bytes_per_pixel(
                args.knobs.quality().randomisations,
                self.fields(),
            ),
            cost,
        }
    }
}

impl Row {
    fn json(&self) -> serde_json::Value {
        let frames = f64::from(self.frames) * TURNS as f64;
        let side = |figures: &Figures| {
            let stages: std::collections::BTreeMap<_, _> =
                Cost::STAGES.iter().zip(figures.cost.micros).map(|(s, m)| (*s, m as f64 / 1e3 / frames)).collect();
            json!({
                "cpu_ms_per_frame": figures.cpu_ms_per_frame, "packed_bytes_per_pixel": figures.bytes_per_pixel,
                "film_bytes_per_pixel": figures.film_bytes_per_pixel, "thread_ms_per_frame": stages,
                "rays": figures.cost.rays(), "light_rays": figures.cost.light_rays,
                "photon_queries": figures.cost.photon_queries, "remainder_rays": figures.cost.remainder_rays,
            })
        };
        let [all, needed] = &self.sides;
        json!({
            "scene": self.name, "left_out": self.left_out, "same_bits": self.same_bits,
            "whole": side(all), "pruned": side(needed),
            "ratio": { "least": self.ratio[0], "median": self.ratio[1], "greatest": self.ratio[2] },
        })
    }
}

fn print(rows: &[Row], args: &BenchArgs) {
    let (width, height, frames) = (args.size.width, args.size.height, args.frames);
    say!(
        "{width}x{height}, {TURNS} turns of {frames} frames each, one thread; CPU ms a frame of the whole process, medians\n"
    );
    say!(
        "| scene | parts left out | CPU ms, all kept | pruned | ratio (least–greatest) | rays kept, M | pruned | packed bytes/pixel kept | pruned | film bytes/pixel kept | pruned | same bits |"
    );
    say!("|{}", "---|".repeat(12));
    for row in rows {
        let [all, needed] = &row.sides;
        let rays = |figures: &Figures| figures.cost.rays() as f64 / 1e6 / TURNS as f64;
        say!(
            "| {} | {} | {:.1} | {:.1} | {:.3} ({:.3}–{:.3}) | {:.2} | {:.2} | {:.3} | {:.3} | {} | {} | {} |",
            row.name,
            row.left_out.len(),
            all.cpu_ms_per_frame,
            needed.cpu_ms_per_frame,
            row.ratio[1],
            row.ratio[0],
            row.ratio[2],
            rays(all),
            rays(needed),
            all.bytes_per_pixel,
            needed.bytes_per_pixel,
            all.film_bytes_per_pixel,
            needed.film_bytes_per_pixel,
            if row.same_bits { "yes" } else { "NO" },
        );
    }
}
