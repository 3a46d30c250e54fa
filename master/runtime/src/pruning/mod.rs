//! What leaving out saves, measured: a scene drawn by the whole pipeline and by the pruned one in turn, in one
//! process, on one thread, by processor time; the pictures must be the same bits.

pub mod parts;
pub mod plain_room;

use std::sync::Arc;

use anyhow::Context;
use frame::{Filter, FrontEnd, Igi, Plane, Setup};
use protocol::answer::{Cost, Fields};
use protocol::question::{Quality, WorldState};
use scenes::{Keep, Needs, Scene};

use self::parts::parts;
use self::plain_room::{laden_room, plain_room};
use crate::cluster::embedded::{Light, Renderer};
use crate::cluster::{Cluster, ClusterOptions};
use crate::console::Console;
use crate::failure::Failure;
use crate::interrupt::Interrupt;
use crate::render_loop::run;
use crate::stats::{Ending, Stop};
use crate::stopwatch::StopWatch;

/// Turns of each pipeline: odd, so that there is a median.
pub const TURNS: usize = 7;

/// What is drawn in each turn.
#[derive(Clone, Copy, Debug)]
pub struct RaceSettings {
    /// Frames of each turn, at least 1.
    pub frames: u32,
    /// As for any picture.
    pub quality: Quality,
    /// As for any picture.
    pub filter: Filter,
}

/// One scene's figures.
pub struct Row {
    /// For people.
    pub name: String,
    /// Parts of the pipeline that the scene has no work for.
    pub left_out: Vec<&'static str>,
    /// The whole pipeline, and the pruned one.
    pub sides: [Figures; 2],
    /// Time of the whole one over that of the pruned one.
    pub ratio: Ratio,
    /// The two drew the same bits, raw and as shown.
    pub same_bits: bool,
    /// Frames of each turn.
    pub frames: u32,
}

/// What a pipeline took.
pub struct Figures {
    /// Of the whole process, median over turns.
    pub cpu_ms_per_frame: f64,
    /// Answers, packed and compressed.
    pub packed_bytes_per_pixel: f64,
    /// The master's memory for the picture.
    pub film_bytes_per_pixel: u64,
    /// A worker's memory for the scene beside the scene itself: ray structure and tables.
    pub worker_bytes: usize,
    /// Of all turns together.
    pub cost: Cost,
}

/// A ratio of times, turn by turn.
#[derive(Clone, Copy, Debug)]
pub struct Ratio {
    /// Of all turns.
    pub least: f64,
    /// Of all turns.
    pub median: f64,
    /// Of all turns.
    pub greatest: f64,
}

/// What the plain room costs more if its file also holds all that can be left out, hidden, unused or black.
pub struct Burden {
    /// Time of the laden room over that of the plain one.
    pub ratio: Ratio,
    /// They look the same, to the bit.
    pub same_bits: bool,
}

impl std::fmt::Display for Ratio {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{:.2} ({:.2}–{:.2})", self.median, self.least, self.greatest)
    }
}

/// Measures a scene at its camera's size; `None` if it was interrupted.
///
/// # Errors
/// [`Failure`] if no worker can be started.
pub fn measure(
    name: String,
    scene: Scene,
    settings: &RaceSettings,
    interrupt: &Interrupt,
    progress: &mut dyn FnMut(f64),
) -> Result<Option<Row>, Failure> {
    let scene = Arc::new(scene);
    let mut sides = [Side::start(Keep::All, &scene)?, Side::start(Keep::Needed, &scene)?];
    let Some((ratio, same_bits)) = race(&mut sides, settings, interrupt, progress) else { return Ok(None) };
    let plan = parts(&Needs::of(&scene), &settings.quality, &settings.filter);
    Ok(Some(Row {
        name,
        left_out: plan.iter().filter(|part| !part.used).map(|part| part.name).collect(),
        same_bits,
        sides: sides.map(|side| side.figures(settings)),
        ratio,
        frames: settings.frames,
    }))
}

/// The room that needs least: diffuse, untextured, with a point light.
///
/// # Errors
/// As [`measure`].
pub fn measure_plain_room(
    size: [u32; 2],
    settings: &RaceSettings,
    interrupt: &Interrupt,
    progress: &mut dyn FnMut(f64),
) -> Result<Option<Row>, Failure> {
    let mut room = plain_room();
    [room.camera.width, room.camera.height] = size;
    measure("a plain room".to_string(), room, settings, interrupt, progress)
}

/// What it costs that room if its file holds what nobody sees.
///
/// # Errors
/// [`Failure`] if no worker can be started.
pub fn measure_burden(
    size: [u32; 2],
    settings: &RaceSettings,
    interrupt: &Interrupt,
    progress: &mut dyn FnMut(f64),
) -> Result<Option<Burden>, Failure> {
    let mut rooms = [laden_room(), plain_room()];
    for room in &mut rooms {
        [room.camera.width, room.camera.height] = size;
    }
    let [laden, plain] = rooms.map(|room| Side::start(Keep::Needed, &Arc::new(room)));
    let measured = race(&mut [laden?, plain?], settings, interrupt, progress);
    Ok(measured.map(|(ratio, same_bits)| Burden { ratio, same_bits }))
}

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

/// Both draw in turn: the time of the first over that of the second, and whether their pictures are the same bits.
/// Nothing if it was interrupted.
fn race(
    sides: &mut [Side; 2],
    settings: &RaceSettings,
    interrupt: &Interrupt,
    progress: &mut dyn FnMut(f64),
) -> Option<(Ratio, bool)> {
    for turn in 0..=TURNS {
        // The first turn builds trees and warms caches: it is nobody's.
        for place in 0..2 {
            let side = &mut sides[(place + turn) % 2];
            let run = side.draw(turn as u64, settings, interrupt)?;
            if turn > 0 {
                side.runs.push(run);
            }
            progress((2 * turn + place + 1) as f64 / (2 * TURNS + 2) as f64);
        }
    }
    let both = || sides[0].runs.iter().zip(&sides[1].runs);
    let mut ratios: Vec<f64> = both().map(|(a, b)| a.cpu_ms_per_frame / b.cpu_ms_per_frame).collect();
    ratios.sort_by(f64::total_cmp);
    let same_bits = both().all(|(a, b)| a.picture == b.picture);
    let ratio = Ratio { least: ratios[0], median: ratios[TURNS / 2], greatest: ratios[TURNS - 1] };
    Some((ratio, same_bits))
}

impl Side {
    fn start(keep: Keep, scene: &Arc<Scene>) -> Result<Self, Failure> {
        let options = ClusterOptions { embedded: Some(1), keep, ..ClusterOptions::default() };
        let mut cluster = Cluster::start(options).context("workers cannot be started")?;
        let world = cluster.publish(Arc::clone(scene)).context("the scene cannot be sent to workers")?;
        Ok(Self { keep, cluster, world, scene: Arc::clone(scene), runs: Vec::new() })
    }

    /// Some frames of a picture; `None` if interrupted. Each seed has light sets of its own, so that none is there
    /// from the turn before.
    fn draw(&mut self, seed: u64, settings: &RaceSettings, interrupt: &Interrupt) -> Option<Run> {
        let RaceSettings { frames, quality, filter } = *settings;
        let (world, camera, fields) = (self.world, self.scene.camera, self.fields());
        let mut front = Igi::new(Setup { world, camera, quality, fields, seed, filter });
        let stop = Stop { frames: Some(frames), ..Stop::default() };
        let mut quiet = Console::silent();
        let watch = StopWatch::start();
        let stats = run(&mut front, &mut self.cluster, &stop, interrupt, &mut quiet);
        let shown = front.show(Plane::Final);
        let cpu = watch.elapsed().cpu;
        (stats.ending == Ending::Enough).then(|| Run {
            cpu_ms_per_frame: cpu * 1e3 / f64::from(stats.frames.max(1)),
            bytes_per_pixel: stats.answer_bytes as f64 / stats.pixels.max(1) as f64,
            cost: stats.cost,
            picture: [front.show(Plane::Raw).sha256(), shown.sha256()],
        })
    }

    fn fields(&self) -> Fields {
        Fields::of(&Needs::kept(&self.scene, self.keep))
    }

    fn figures(&self, settings: &RaceSettings) -> Figures {
        let mut times: Vec<f64> = self.runs.iter().map(|run| run.cpu_ms_per_frame).collect();
        times.sort_by(f64::total_cmp);
        let mut cost = Cost::default();
        self.runs.iter().for_each(|run| cost += run.cost);
        Figures {
            cpu_ms_per_frame: times[TURNS / 2],
            packed_bytes_per_pixel: self.runs[0].bytes_per_pixel,
            film_bytes_per_pixel: frame::parts::Film::bytes_per_pixel(settings.quality.replicates, self.fields()),
            worker_bytes: Light { keep: self.keep }.build(Arc::clone(&self.scene)).bytes(),
            cost,
        }
    }
}

impl Figures {
    /// Millions of rays of a turn.
    pub fn rays_m(&self) -> f64 {
        self.cost.rays() as f64 / 1e6 / TURNS as f64
    }

    /// Megabytes of a worker.
    pub fn worker_mb(&self) -> f64 {
        self.worker_bytes as f64 / 1e6
    }
}
