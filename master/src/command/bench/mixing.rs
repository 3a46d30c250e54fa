//! `igi-master bench --mix`: where the time goes between a slider of a lamp and the picture of it, and how noisy pictures of lamps
//! drawn apart are beside those drawn together.

use std::path::Path;
use std::sync::Arc;

use anyhow::Context;
use frame::metrics::Difference;
use frame::tone::{Exposure, Operator, Tone};
use frame::{Films, Picture, Plane, View};
use protocol::answer::Fields;
use scenes::{Change, Needs, Rgb, Scene, Shiner};
use serde_json::json;

use crate::cli::BenchArgs;
use runtime::cluster::embedded::cores;
use runtime::cluster::{Cluster, ClusterOptions};
use runtime::console::{Console, print_line};
use runtime::display::encoded::encode_mix;
use runtime::failure::{Failure, Success};
use runtime::files::name_of;
use runtime::interrupt::Interrupt;
use runtime::render_loop::run;
use runtime::stats::Stop;
use runtime::stopwatch::StopWatch;

/// Steps of a slider that are timed.
const STEPS: usize = 300;
/// Frames of the truth, for each frame of the picture that is judged.
const TRUTH: u32 = 16;
/// As in sessions.
const FILMS_MAX: usize = 24;

/// What a step of a slider takes, milliseconds: by the clock at half and at 99 of 100 steps, and processor time on average.
struct Stage {
    name: &'static str,
    wall_ms: [f64; 2],
    cpu_ms: f64,
}

/// One scene's figures.
struct Row {
    name: String,
    films: usize,
    stages: Vec<Stage>,
    /// Relative squared error of the picture drawn at once, and of lamps apart in about the same processor time.
    noise: [f64; 2],
    /// Processor time of the one and of the other, seconds.
    cpu: [f64; 2],
    /// Frames of the one, and of all films of the other.
    frames: [u32; 2],
}

impl Row {
    /// The noise of lamps apart over that of the picture drawn at once, as standard deviations in the same processor time: variance
    /// falls as that grows.
    fn noise_ratio(&self) -> f64 {
        (self.noise[1] / self.noise[0] * self.cpu[1] / self.cpu[0]).sqrt()
    }
}

/// Measures every scene.
///
/// # Errors
/// [`Failure`] if a scene cannot be read, has no lamp, or no worker can be started.
pub(super) fn bench_mix(args: &BenchArgs) -> Result<Success, Failure> {
    let interrupt = Interrupt::listen();
    let mut rows = Vec::new();
    for path in &args.scenes {
        let Some(row) = measure(path, args, &interrupt)? else { return Ok(Success::Interrupted) };
        if args.json {
            print_line!("{}", described(&row));
        }
        rows.push(row);
    }
    if !args.json {
        rows.iter().for_each(|row| print(row, args));
    }
    Ok(Success::Done)
}

fn measure(path: &Path, args: &BenchArgs, interrupt: &Interrupt) -> Result<Option<Row>, Failure> {
    let mut scene = scenes::read::load(path)?.scene;
    (scene.camera.width, scene.camera.height) = (args.size.width, args.size.height);
    let lamps: Vec<(Shiner, Rgb)> = scene
        .shiners()
        .into_iter()
        .filter_map(|shiner| Some((shiner, scene.power(shiner).filter(|power| power.max_element() > 0.0)?)))
        .collect();
    if lamps.is_empty() {
        return Err(Failure::Usage(format!("{}: nothing shines that could be mixed", path.display())));
    }
    let options =
        ClusterOptions { embedded: Some(args.threads.map_or_else(cores, usize::from)), ..ClusterOptions::default() };
    let mut cluster = Cluster::start(options).context("workers cannot be started")?;
    cluster.publish(Arc::new(scene.clone())).context("the scene cannot be sent to workers")?;
    let mut studio = Studio { cluster, args, interrupt, seed: 0 };

    // Drawn at once, and what it should be.
    let Some((plain, cpu)) = studio.draw(Vec::new(), args.frames)? else { return Ok(None) };
    let Some((truth, _)) = studio.draw(Vec::new(), TRUTH * args.frames)? else { return Ok(None) };
    // Apart, until as much processor time is spent and each has a frame.
    let mut films = Films::of(&lamps, FILMS_MAX, |_| String::new());
    let mut spent = 0.0;
    while spent < cpu || films.frames() == 0 {
        let Some((film, frames)) = films.next(&scene, u32::MAX) else { break };
        // No more than there is time for: the last ones would double it.
        let each = spent / f64::from(films.frames_in_all().max(1));
        let left = if each > 0.0 { (((cpu - spent) / each) as u32).max(1) } else { 1 };
        let frames = frames.min(left);
        let now = studio.cluster.scene().cloned().unwrap_or_default();
        let Some((picture, cpu)) = studio.draw(films.alone(film, &now), frames)? else { return Ok(None) };
        films.add(film, picture, frames);
        spent += cpu;
    }
    let mixed = films.mixed(&scene).context("the lamps have no films")?;
    let error = |picture: &Picture| Difference::between(picture, &truth).map_or(f64::NAN, |found| found.rel_mse);
    Ok(Some(Row {
        name: name_of(path),
        films: films.drawn()[1],
        stages: slide(&films, &scene, &lamps),
        noise: [error(&plain), error(&mixed)],
        cpu: [cpu, spent],
        frames: [args.frames, films.frames_in_all()],
    }))
}

/// What draws.
struct Studio<'a> {
    cluster: Cluster,
    args: &'a BenchArgs,
    interrupt: &'a Interrupt,
    seed: u64,
}

impl Studio<'_> {
    /// Some frames of the scene after changes, and the processor time of them, seconds; `None` if interrupted.
    fn draw(&mut self, changes: Vec<Change>, frames: u32) -> Result<Option<(Picture, f64)>, Failure> {
        let watch = StopWatch::start();
        let world = match changes.is_empty() {
            true => self.cluster.state(),
            false => Some(self.cluster.change(changes).context("the lamps cannot be lit one by one")?),
        };
        let (world, scene) = world.zip(self.cluster.shared_scene()).context("there is no scene")?;
        let (camera, fields) = (scene.camera, Fields::of(&Needs::of(&scene)));
        self.seed += 1;
        let mut front = self.args.method.0.begin(&View { world, scene, fields, camera, seed: self.seed });
        let stop = Stop { frames: Some(frames), ..Stop::default() };
        run(front.as_mut(), &mut self.cluster, &stop, self.interrupt, &mut Console::silent());
        let cpu = watch.elapsed().cpu;
        Ok((!self.interrupt.asked()).then(|| (front.show(Plane::Final), cpu)))
    }
}

/// Moves a slider of the first lamp, and then of each in turn.
fn slide(films: &Films, scene: &Scene, lamps: &[(Shiner, Rgb)]) -> Vec<Stage> {
    let mut now = scene.clone();
    let names = ["lamps", "sum of films", "exposure and curve", "JPEG", "all"];
    let mut times = names.map(|_| Vec::new());
    let tone = Tone { exposure: Exposure::Fixed(0.0), operator: Operator::None };
    for step in 0..STEPS {
        let (shiner, power) = lamps[step % lamps.len()];
        let all = StopWatch::start();
        let mut note = |stage: usize, watch: &StopWatch| {
            let took = watch.elapsed();
            times[stage].push([took.wall, took.cpu]);
        };
        let watch = StopWatch::start();
        let factor = 0.2 + 0.7 * (step % 100) as f32 / 100.0;
        if let Some(change) = now.powered(shiner, power * factor) {
            // It only changes a power.
            drop(change.apply(&mut now));
        }
        note(0, &watch);
        let watch = StopWatch::start();
        let picture = films.mixed(&now).unwrap_or_else(|| Picture::black(1, 1));
        note(1, &watch);
        let watch = StopWatch::start();
        let image = tone.develop(&picture);
        note(2, &watch);
        let watch = StopWatch::start();
        drop(std::hint::black_box(encode_mix(&image)));
        note(3, &watch);
        note(4, &all);
    }
    let stage = |(name, times): (&'static str, Vec<[f64; 2]>)| {
        let mut wall: Vec<f64> = times.iter().map(|[wall, _]| wall * 1e3).collect();
        wall.sort_by(f64::total_cmp);
        let cpu = times.iter().map(|[_, cpu]| cpu * 1e3).sum::<f64>() / times.len() as f64;
        Stage { name, wall_ms: [wall[wall.len() / 2], wall[wall.len() * 99 / 100]], cpu_ms: cpu }
    };
    names.into_iter().zip(times).map(stage).collect()
}

fn described(row: &Row) -> serde_json::Value {
    let stage = |stage: &Stage| json!({ "stage": stage.name, "p50_ms": stage.wall_ms[0], "p99_ms": stage.wall_ms[1], "cpu_ms": stage.cpu_ms });
    let [plain, mixed] = row.noise;
    json!({
        "scene": row.name, "films": row.films, "stages": row.stages.iter().map(stage).collect::<Vec<_>>(),
        "frames_at_once": row.frames[0], "frames_apart": row.frames[1],
        "rel_mse_at_once": plain, "rel_mse_apart": mixed, "cpu_s_at_once": row.cpu[0], "cpu_s_apart": row.cpu[1],
        "noise_ratio": row.noise_ratio(),
    })
}

fn print(row: &Row, args: &BenchArgs) {
    let Row { name, films, stages, noise: [plain, mixed], cpu, frames } = row;
    print_line!("{name}: {}x{}, {films} films; {STEPS} steps of a slider\n", args.size.width, args.size.height);
    print_line!("| step | p50 ms | p99 ms | CPU ms of all threads, mean |\n|---|---|---|---|");
    for Stage { name, wall_ms: [half, most], cpu_ms } in stages {
        print_line!("| {name} | {half:.2} | {most:.2} | {cpu_ms:.2} |");
    }
    print_line!(
        "\nnoise: relMSE {plain:.5} of {} frames at once in {:.1} s of CPU time, {mixed:.5} of {} frames of lamps apart in {:.1} s: in the \
         same time {:.2} of its standard deviation\n",
        frames[0],
        cpu[0],
        frames[1],
        cpu[1],
        row.noise_ratio()
    );
}
