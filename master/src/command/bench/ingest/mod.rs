//! `igi-master bench --ingest`: how many answers a master takes in, and what of it takes how long.
//!
//! Workers are [`crowd`]: connections of this process, over QUIC, whose answers were made before. All that is the master's is
//! real: network, dispatcher, schedule, method, film. What counts is the processor time of its threads ([`runtime::threads`]), which
//! a busy machine stretches little; that of the crowd is told apart. On the loopback, the system charges part of what
//! receiving costs to whoever sends.

mod carried;
mod crowd;
mod relays;
mod stages;

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, Instant};

use anyhow::{Context, anyhow, bail};
use frame::{Answered, View};
use protocol::answer::Fields;
use protocol::schedule::WorkerState;
use scenes::{Camera, Needs, Scene};
use serde_json::json;

use super::schedule;
use crate::cli::BenchArgs;
use runtime::cluster::embedded::cores;
use runtime::cluster::{Cluster, ClusterOptions, Event};
use runtime::console::{Console, print_line};
use runtime::failure::{Failure, Success};
use runtime::files::name_of;
use runtime::interrupt::Interrupt;
use runtime::memory;
use runtime::render_loop::{Watched, run_watched};
use runtime::stats::{RenderStats, Stop};
use runtime::threads::{DISPATCHER, MAIN, NETWORK, Threads, Used};

use carried::Measured;
use crowd::{Answers, CROWD, Crowd, Kind, WHOLE};
use relays::{RELAYS, Relays};

/// What a master did for some seconds.
struct Phase {
    what: &'static str,
    seconds: f64,
    answers: u64,
    /// Of all answers, as they came; 0: unknown.
    bytes: u64,
    /// Frames of the picture, or moving pictures.
    frames: u32,
    /// By kind of thread.
    used: BTreeMap<String, Used>,
    /// What the simulation of `scale` makes of that, where workers have a speed: pictures a second.
    simulated: Option<f64>,
}

impl Phase {
    /// Seconds of a core that the master took.
    fn master(&self) -> f64 {
        let others = [CROWD, RELAYS];
        self.used.iter().filter(|(kind, _)| !others.contains(&kind.as_str())).map(|(_, used)| used.all()).sum()
    }

    fn of(&self, kind: &str) -> Used {
        self.used.get(kind).copied().unwrap_or_default()
    }

    /// What the master's other threads took: those that work for the main one.
    fn helpers(&self) -> f64 {
        let known = [MAIN, CROWD, RELAYS, DISPATCHER, NETWORK];
        self.used.iter().filter(|(kind, _)| !known.contains(&kind.as_str())).map(|(_, used)| used.all()).sum()
    }
}

/// Measures every scene with every number of workers.
///
/// # Errors
/// [`Failure`] if a scene cannot be read, there can be no workers, or they do not answer.
pub(super) fn bench_ingest(args: &BenchArgs) -> Result<Success, Failure> {
    let interrupt = Interrupt::listen();
    for path in &args.scenes {
        let mut scene = scenes::read::load(path)?.scene;
        (scene.camera.width, scene.camera.height) = (args.size.width, args.size.height);
        let (scene, fields) = (Arc::new(scene.clone()), Fields::of(&Needs::of(&scene)));
        memory::demand(args.method.0.memory_bytes(&scene.camera, fields), &scene.camera)?;
        let threads = args.threads.map_or_else(cores, usize::from);
        let answers = Arc::new(Answers::record(&scene, &args.method.0, fields, threads)?);
        // Of a thread.
        let speed = args.worker_speed.map(|speed| speed * 1e6 / f64::from(args.worker_threads));
        let mut measured = Measured::default();
        for workers in &args.workers {
            let mut phases = measure(&scene, fields, &answers, (*workers, speed), args, &interrupt)?;
            if interrupt.asked() {
                return Ok(Success::Interrupted);
            }
            measured.add(&phases, *workers, args.relays);
            if let Some(speed) = speed {
                let view = View {
                    world: Default::default(),
                    scene: Arc::clone(&scene),
                    fields,
                    camera: scene.camera,
                    seed: 0,
                };
                let simulated = measured.simulated(&view, speed, *workers, args);
                phases.iter_mut().zip(simulated).for_each(|(phase, rate)| phase.simulated = Some(rate));
            }
            report(path, *workers, &phases, args);
        }
        if let Some(speed) = speed {
            measured.report(&scene, fields, speed, args, &interrupt);
        }
        let view = View { world: Default::default(), scene: Arc::clone(&scene), fields, camera: scene.camera, seed: 0 };
        report_stages(&stages::stages(&answers, &args.method.0, &view), args);
    }
    report_schedule(args);
    Ok(Success::Done)
}

/// Longest wait for all workers to have joined, and for an answer.
const PATIENCE: Duration = Duration::from_secs(60);
/// Frames of a picture that has just begun.
const FIRST: u32 = 36;
/// Frames after which a picture is at rest.
const SETTLED: u32 = 90;

fn measure(
    scene: &Arc<Scene>,
    fields: Fields,
    answers: &Arc<Answers>,
    (workers, speed): (u16, Option<f64>),
    args: &BenchArgs,
    interrupt: &Interrupt,
) -> anyhow::Result<Vec<Phase>> {
    let listen = Some((std::net::Ipv4Addr::LOCALHOST, 0).into());
    let options = ClusterOptions { listen, check_share: args.check_share, ..ClusterOptions::default() };
    let mut cluster = Cluster::start(options).context("cannot listen for workers")?;
    let world = cluster.publish(Arc::clone(scene)).context("the scene cannot be sent to workers")?;
    let (Some(address), Some(token)) = (cluster.address(), cluster.token()) else {
        bail!("the cluster does not listen")
    };
    let relays = Relays::start(args.relays, address, &token)?;
    let begun = Instant::now();
    while cluster.status().workers < usize::from(args.relays) && begun.elapsed() < PATIENCE {
        cluster.next(Duration::from_millis(20));
    }
    let masters = if args.relays > 0 { relays.addresses() } else { vec![address] };
    let kind = Kind { answers: Arc::clone(answers), threads: args.worker_threads, speed, masters, token };
    let mut crowd = Crowd::new(kind)?;
    let memory = memory::resident_bytes();
    let watch = || relays.and(Threads::now());
    let ready = |cluster: &Cluster| -> usize {
        let list = cluster.status().list;
        let able = list.iter().filter(|info| info.state == WorkerState::Ready);
        able.map(|info| info.behind.map_or(1, |behind| behind.workers as usize)).sum()
    };
    while ready(&cluster) < usize::from(workers) {
        crowd.grow(ready(&cluster), usize::from(workers));
        if let Some(reason) = crowd.lost() {
            bail!("a worker is not let in: {reason}");
        }
        if begun.elapsed() > PATIENCE {
            bail!("only {} of {workers} workers have joined", ready(&cluster));
        }
        cluster.next(Duration::from_millis(20));
    }
    if !args.json {
        let each = memory::resident_bytes().saturating_sub(memory) as f64 / f64::from(workers);
        print_line!("{workers} idle workers: {:.0} KiB each, both ends of their connections", each / 1024.0);
    }
    let view = View { world, scene: Arc::clone(scene), fields, camera: scene.camera, seed: 0 };
    let time = Duration::from_secs_f64(args.seconds);
    let phases = vec![
        begin_again_and_again(&mut cluster, args, &view, (time, interrupt), &watch),
        rest(&mut cluster, args, &view, (time, interrupt), &watch)?,
        move_about(&mut cluster, args, &view, (time, interrupt), &watch)?,
    ];
    if let Some(reason) = crowd.lost() {
        bail!("a worker was lost: {reason}");
    }
    Ok(phases)
}

/// The first frames of a picture, over and over.
fn begin_again_and_again(
    cluster: &mut Cluster,
    args: &BenchArgs,
    view: &View,
    (time, interrupt): (Duration, &Interrupt),
    watch: &dyn Fn() -> Threads,
) -> Phase {
    let stop = Stop { frames: Some(FIRST), ..Stop::default() };
    let (begun, before) = (Instant::now(), watch());
    let (mut answers, mut bytes, mut frames) = (0, 0, 0);
    while begun.elapsed() < time && !interrupt.asked() {
        let mut front = args.method.0.begin(view);
        let stats =
            run_watched(&mut *front, cluster, &stop, interrupt, &mut Console::silent(), &mut |_, _| Watched::GoOn);
        (answers, bytes, frames) = (answers + stats.answers, bytes + stats.answer_bytes, frames + stats.frames);
    }
    let (seconds, used) = (begun.elapsed().as_secs_f64(), watch().since(&before));
    Phase { what: "first frames", seconds, answers, bytes, frames, used, simulated: None }
}

/// A picture that nothing disturbs.
fn rest(
    cluster: &mut Cluster,
    args: &BenchArgs,
    view: &View,
    (time, interrupt): (Duration, &Interrupt),
    watch: &dyn Fn() -> Threads,
) -> anyhow::Result<Phase> {
    let mut front = args.method.0.begin(view);
    let mut marks: Vec<(Instant, Threads, [u64; 2], u32)> = Vec::new();
    let mut look = |_: &mut dyn frame::FrontEnd, stats: &RenderStats| {
        let is_due = match marks.as_slice() {
            [] => stats.frames >= SETTLED,
            [first] => first.0.elapsed() >= time,
            _ => false,
        };
        if is_due {
            marks.push((Instant::now(), watch(), [stats.answers, stats.answer_bytes], stats.frames));
        }
        if marks.len() < 2 { Watched::GoOn } else { Watched::Enough }
    };
    let front: &mut dyn frame::FrontEnd = &mut *front;
    run_watched(front, cluster, &Stop::default(), interrupt, &mut Console::silent(), &mut |front, stats| {
        look(front, stats)
    });
    let [(begun, before, first, first_frames), (ended, after, last, frames)] = &marks[..] else {
        bail!("the frames were not completed");
    };
    Ok(Phase {
        what: "at rest",
        seconds: (*ended - *begun).as_secs_f64(),
        answers: last[0] - first[0],
        bytes: last[1] - first[1],
        frames: frames - first_frames,
        used: after.since(before),
        simulated: None,
    })
}

/// A moving picture after the other, each as large as a still one.
fn move_about(
    cluster: &mut Cluster,
    args: &BenchArgs,
    view: &View,
    (time, interrupt): (Duration, &Interrupt),
    watch: &dyn Fn() -> Threads,
) -> anyhow::Result<Phase> {
    let mut front = args.method.0.interactive(0);
    front.set_parallelism(cluster.status().parallelism());
    let (begun, before) = (Instant::now(), watch());
    let (mut answers, mut frames) = (0, 0);
    while begun.elapsed() < time && !interrupt.asked() {
        front.look(&View { camera: turned(&view.camera, frames), ..view.clone() }, &[]);
        front.begin(Some(WHOLE));
        while !front.is_finished() {
            let questions = front.ask(cluster.room());
            cluster.ask(questions);
            match cluster.next(PATIENCE) {
                Some(Event::Answered { asked, body, cost, worker, .. }) => {
                    front.absorb(Answered { ticket: asked.ticket, body, worker, cost: &cost });
                    answers += 1;
                }
                Some(Event::Unanswered { reason, .. }) => bail!("a question has no answer: {reason}"),
                Some(_) => {}
                None => return Err(anyhow!("there is no answer")),
            }
        }
        front.end();
        std::hint::black_box(front.shot(None));
        frames += 1;
    }
    let (seconds, used) = (begun.elapsed().as_secs_f64(), watch().since(&before));
    Ok(Phase { what: "in motion", seconds, answers, bytes: 0, frames, used, simulated: None })
}

/// A camera on a little circle, so that what was seen is seen again.
fn turned(camera: &Camera, step: u32) -> Camera {
    let (sin, cos) = (step as f32 * 0.1).sin_cos();
    let reach = (camera.target - camera.origin).length() * 0.05;
    Camera { origin: camera.origin + glam::Vec3::new(sin, cos, 0.0) * reach, ..*camera }
}

fn report(path: &Path, workers: u16, phases: &[Phase], args: &BenchArgs) {
    let pixels = f64::from(args.size.width) * f64::from(args.size.height);
    if args.json {
        let rows: Vec<_> = phases
            .iter()
            .map(|phase| {
                let cpu: BTreeMap<_, _> =
                    phase.used.iter().map(|(kind, used)| (kind, json!([used.user, used.system]))).collect();
                json!({
                    "phase": phase.what, "seconds": phase.seconds, "answers": phase.answers, "frames": phase.frames,
                    "pixels": pixels * f64::from(phase.frames), "simulated": phase.simulated, "cpu_seconds_user_and_system": cpu,
                })
            })
            .collect();
        print_line!(
            "{}",
            json!({ "scene": name_of(path), "workers": workers, "threads": args.worker_threads, "relays": args.relays, "phases": rows })
        );
        return;
    }
    let speed = args.worker_speed.map_or("that answer at once".into(), |speed| format!("of {speed} Mpixel/s"));
    let way = if args.relays > 0 { format!(", through {} relays", args.relays) } else { String::new() };
    print_line!(
        "{}, {}x{}, {workers} workers of {} threads {speed}{way}\n",
        name_of(path),
        args.size.width,
        args.size.height,
        args.worker_threads
    );
    print_line!(
        "| phase | pictures/s | simulated | answers/s | Mpixel/s | … a core of the master | µs an answer | ns a pixel | main | helpers | dispatcher | network | of it the system | workers | relays |"
    );
    print_line!("|---|{}", "---|".repeat(14));
    for phase in phases {
        let all = (pixels * f64::from(phase.frames)).max(1.0);
        let each = |seconds: f64| seconds * 1e9 / all;
        print_line!(
            "| {} | {:.1} | {} | {:.0} | {:.1} | {:.1} | {:.1} | {:.1} | {:.1} | {:.1} | {:.1} | {:.1} | {:.1} | {:.1} | {:.1} |",
            phase.what,
            f64::from(phase.frames) / phase.seconds,
            phase.simulated.map_or("–".into(), |rate| format!("{rate:.1}")),
            phase.answers as f64 / phase.seconds,
            all / phase.seconds / 1e6,
            all / phase.master().max(1e-9) / 1e6,
            phase.master() * 1e6 / phase.answers.max(1) as f64,
            each(phase.master()),
            each(phase.of(MAIN).all()),
            each(phase.helpers()),
            each(phase.of(DISPATCHER).all()),
            each(phase.of(NETWORK).all()),
            each(phase.of(NETWORK).system),
            each(phase.of(CROWD).all()),
            each(phase.of(RELAYS).all()),
        );
    }
    print_line!("\nns a pixel are of a core, in all and by thread.\n");
}

fn report_stages(stages: &[stages::Stage], args: &BenchArgs) {
    if args.json {
        let stages: BTreeMap<_, _> = stages.iter().copied().collect();
        print_line!("{}", json!({ "stages_ns_per_pixel": stages }));
        return;
    }
    print_line!("| stage, alone | ns a pixel |\n|---|---|");
    stages.iter().for_each(|(name, ns)| print_line!("| {name} | {ns:.1} |"));
    print_line!("");
}

/// Workers and threads that the schedule is asked about, and answers.
const SCHEDULES: [(u16, u16, u32); 4] = [(8, 8, 40_000), (100, 64, 20_000), (400, 8, 20_000), (1000, 8, 4000)];

fn report_schedule(args: &BenchArgs) {
    let rows = SCHEDULES
        .map(|(workers, threads, answers)| (workers, threads, schedule::micros_per_answer(workers, threads, answers)));
    if args.json {
        let rows =
            rows.map(|(workers, threads, micros)| json!({ "workers": workers, "threads": threads, "micros": micros }));
        print_line!("{}", json!({ "schedule": rows }));
        return;
    }
    print_line!("| the schedule alone | µs an answer |\n|---|---|");
    rows.iter()
        .for_each(|(workers, threads, micros)| print_line!("| {workers} workers of {threads} threads | {micros:.1} |"));
}
