//! `igi-master bench`: whole frames; with --paper at the paper's settings, beside its figures.

mod caches;
mod ingest;
mod mixing;
mod pruning;
mod questions;
pub(super) mod schedule;

use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, Instant};

use anyhow::Context;
use frame::tone::{Exposure, Operator, Tone};
use frame::{Plane, View};
use protocol::answer::{CostStage, Fields};
use scenes::Needs;
use serde_json::json;

use crate::cli::BenchArgs;
use runtime::cluster::embedded::cores;
use runtime::cluster::{Cluster, ClusterOptions};
use runtime::console::{Console, print_line};
use runtime::failure::{Failure, Success};
use runtime::files::name_of;
use runtime::interrupt::Interrupt;
use runtime::live::measure;
use runtime::memory;
use runtime::render_loop::run;
use runtime::stats::{Ending, RenderStats, Stop};

/// What the paper reports at 640×480 (section 5.1): scene of ours that is most like it, its name
/// there, and its frames a second on how many processors.
const PAPER: [(&str, &str, f64, u32); 2] =
    [("cornell_spheres", "room with table", 3.3, 16), ("conference", "conference room", 1.7, 24)];

/// One scene's figures.
struct Row {
    name: String,
    triangles: usize,
    stats: RenderStats,
    /// Filter and tone curve, pixels a second.
    filtered_per_second: f64,
}

/// Renders every scene for some frames and prints a table.
///
/// # Errors
/// [`Failure`] if a scene cannot be read or no worker can be started.
pub fn bench(args: &BenchArgs) -> Result<Success, Failure> {
    if args.live {
        return bench_live(args);
    }
    if args.ingest {
        return ingest::bench_ingest(args);
    }
    if args.pruning {
        return pruning::bench_pruning(args);
    }
    if args.questions {
        return questions::bench_questions(args);
    }
    if args.mix {
        return mixing::bench_mix(args);
    }
    if args.caches {
        return caches::bench_caches(args);
    }
    let interrupt = Interrupt::listen();
    let mut rows = Vec::new();
    for scene in &args.scenes {
        let row = time(scene, args, &interrupt)?;
        if row.stats.ending == Ending::Interrupted {
            return Ok(Success::Interrupted);
        }
        if args.json {
            print_line!("{}", described(&row));
        } else {
            eprintln!("{}: {:.2} frames/s", row.name, rate(&row.stats));
        }
        rows.push(row);
    }
    if !args.json {
        print(&rows, args);
    }
    Ok(Success::Done)
}

/// Measures the interactive loop on every scene.
fn bench_live(args: &BenchArgs) -> Result<Success, Failure> {
    let threads = args.threads.map_or_else(cores, usize::from);
    for path in &args.scenes {
        let mut scene = scenes::read::load(path)?.scene;
        (scene.camera.width, scene.camera.height) = (args.size.width, args.size.height);
        let method = &args.method.0;
        let say = |input: &str, left: u64| eprintln!("{}: {input}, about {left} s left", path.display());
        let far = Duration::from_secs_f64(args.far / 1e3);
        let rows = measure::measure(&scene, method, args.rate, (threads, far), &say)?;
        eprintln!("{}: flicker", path.display());
        let flicker = measure::flicker(&scene, method, threads)?;
        if args.json {
            print_line!("{}", json!({ "scene": path.display().to_string(), "inputs": rows, "flicker": flicker }));
            continue;
        }
        print_line!(
            "{}: {}x{}, {threads} threads {} ms away, aiming at {} frames/s\n",
            path.display(),
            args.size.width,
            args.size.height,
            args.far,
            args.rate
        );
        print_line!(
            "| what moves | frames/s | drawn at | latency p50 ms | p99 ms | ms the first edit | ms an edit | bytes an edit, each worker |\n|---|---|---|---|---|---|---|---|"
        );
        for row in rows {
            let [width, height] = row.size;
            print_line!(
                "| {} | {:.1} | {width}x{height} | {:.0} | {:.0} | {:.1} | {:.1} | {:.0} |",
                row.input,
                row.frames_per_second,
                row.latency_p50_ms,
                row.latency_p99_ms,
                row.first_edit_ms,
                row.edit_ms,
                row.bytes_per_edit
            );
        }
        let measure::Flicker { fixed, steady } = flicker;
        let [fixed, steady] = [fixed, steady].map(|value| value.map_or("–".into(), |value| format!("{value:.5}")));
        print_line!("\nflicker: {fixed} frame by frame, {steady} as shown\n");
    }
    Ok(Success::Done)
}

fn time(path: &Path, args: &BenchArgs, interrupt: &Interrupt) -> Result<Row, Failure> {
    let mut scene = scenes::read::load(path)?.scene;
    (scene.camera.width, scene.camera.height) = (args.size.width, args.size.height);
    let (camera, triangles) = (scene.camera, scene.triangle_count());
    let fields = Fields::of(&Needs::of(&scene));
    memory::demand(args.method.0.memory_bytes(&camera, fields), &camera)?;
    let options =
        ClusterOptions { embedded: Some(args.threads.map_or_else(cores, usize::from)), ..ClusterOptions::default() };
    let mut cluster = Cluster::start(options).context("workers cannot be started")?;
    let scene = Arc::new(scene);
    let world = cluster.publish(Arc::clone(&scene)).context("the scene cannot be sent to workers")?;
    let mut front = args.method.0.begin(&View { world, scene, fields, camera, seed: 0 });
    let stop = Stop { frames: Some(args.frames), ..Stop::default() };
    let mut quiet = Console::silent();
    let stats = run(front.as_mut(), &mut cluster, &stop, interrupt, &mut quiet);
    let began = Instant::now();
    for _ in 0..SHOWN {
        let tone = Tone { exposure: Exposure::Fixed(0.0), operator: Operator::None };
        std::hint::black_box(tone.develop(&front.show(Plane::Final)));
    }
    let shown = f64::from(camera.width) * f64::from(camera.height) * f64::from(SHOWN);
    Ok(Row { name: name_of(path), triangles, stats, filtered_per_second: shown / began.elapsed().as_secs_f64() })
}

fn rate(stats: &RenderStats) -> f64 {
    f64::from(stats.frames) / stats.elapsed.as_secs_f64().max(1e-9)
}

fn described(row: &Row) -> serde_json::Value {
    let RenderStats { cost, frames, .. } = &row.stats;
    let per_frame = |micros: u64| micros as f64 / 1e3 / f64::from((*frames).max(1));
    json!({
        "scene": row.name, "triangles": row.triangles, "frames_per_second": rate(&row.stats),
        "shadow_rays_per_second": cost.shadow_rays as f64 / row.stats.elapsed.as_secs_f64(),
        "rays_per_second": cost.rays() as f64 / row.stats.elapsed.as_secs_f64(),
        "thread_ms_per_frame": cost.micros_by_stage().into_iter().map(|(s, m)| (s, per_frame(m))).collect::<std::collections::BTreeMap<_, _>>(),
        "packed_bytes_per_pixel": row.stats.answer_bytes as f64 / row.stats.pixels.max(1) as f64,
        "filter_and_tone_pixels_per_second": row.filtered_per_second,
    })
}

fn print(rows: &[Row], args: &BenchArgs) {
    let (width, height, frames) = (args.size.width, args.size.height, args.frames);
    print_line!("{width}x{height}, {frames} frames, {:?}\n", args.method.0);
    print_line!(
        "| scene | triangles | frames/s | the paper | Mshadow rays/s | {} | packed bytes/pixel | filter and tone curve Mpixel/s |",
        CostStage::ALL.map(|stage| format!("ms {}", stage.name())).join(" | ")
    );
    print_line!("|{}", "---|".repeat(7 + CostStage::ALL.len()));
    for row in rows {
        let cost = &row.stats.cost;
        let paper = PAPER.iter().find(|(ours, ..)| *ours == row.name);
        let paper = paper
            .map_or("–".into(), |(_, theirs, fps, processors)| format!("{fps} ({theirs}, {processors} processors)"));
        let stages =
            cost.micros.map(|m| format!("{:.1}", m as f64 / 1e3 / f64::from(row.stats.frames.max(1)))).join(" | ");
        print_line!(
            "| {} | {} | {:.2} | {paper} | {:.1} | {stages} | {:.2} | {:.1} |",
            row.name,
            row.triangles,
            rate(&row.stats),
            cost.shadow_rays as f64 / 1e6 / row.stats.elapsed.as_secs_f64(),
            row.stats.answer_bytes as f64 / row.stats.pixels.max(1) as f64,
            row.filtered_per_second / 1e6,
        );
    }
    print_line!(
        "\nms are a thread's time for each frame, summed over threads; a frame takes their sum over the number of threads."
    );
}

/// How often filter and tone curve are timed.
const SHOWN: u32 = 20;
