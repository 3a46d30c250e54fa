//! `igi-master bench --pruning`: what leaving out saves, as a table.

use anyhow::anyhow;
use serde_json::json;

use crate::cli::BenchArgs;
use runtime::console::print_line;
use runtime::failure::{Failure, Success};
use runtime::files::name_of;
use runtime::interrupt::Interrupt;
use runtime::pruning::{Burden, Figures, RaceSettings, Row, TURNS, measure, measure_burden, measure_plain_room};

/// Measures all scenes, and a room that is built here.
///
/// # Errors
/// [`Failure`] if a scene cannot be read, no worker can be started, or the two pipelines draw different pictures.
pub(super) fn bench_pruning(args: &BenchArgs) -> Result<Success, Failure> {
    let interrupt = Interrupt::listen();
    let (quality, filter) = args.method.igi().map_err(Failure::Usage)?;
    let settings = RaceSettings { frames: args.frames, quality, filter };
    let mut scenes = Vec::new();
    for path in &args.scenes {
        let mut scene = scenes::read::load(path)?.scene;
        (scene.camera.width, scene.camera.height) = (args.size.width, args.size.height);
        scenes.push((name_of(path), scene));
    }
    let quiet = &mut |_| ();
    let mut rows = Vec::new();
    let mut keep = |row: Row| {
        if args.json {
            print_line!("{}", described(&row));
        } else {
            eprintln!("{}: {:.3}", row.name, row.ratio.median);
        }
        rows.push(row);
    };
    for (name, scene) in scenes {
        let Some(row) = measure(name, scene, &settings, &interrupt, quiet)? else { return Ok(Success::Interrupted) };
        keep(row);
    }
    let size = [args.size.width, args.size.height];
    let Some(row) = measure_plain_room(size, &settings, &interrupt, quiet)? else { return Ok(Success::Interrupted) };
    keep(row);
    let Some(burden) = measure_burden(size, &settings, &interrupt, quiet)? else { return Ok(Success::Interrupted) };
    if args.json {
        let Burden { ratio, same_bits } = burden;
        print_line!(
            "{}",
            json!({
                "laden_over_plain": ratio.median, "least": ratio.least, "greatest": ratio.greatest, "same_bits": same_bits,
            })
        );
    } else {
        print(&rows, args);
        print_line!(
            "\nThe plain room from a file that also holds glass, mirrors, gloss, textures, holes, lamps, a moving object, lights \
             and an environment, all hidden, unused or black: {} times its time, {}.",
            burden.ratio,
            if burden.same_bits { "the same bits" } else { "ANOTHER PICTURE" }
        );
    }
    if !burden.same_bits {
        return Err(anyhow!("what nobody sees in a file changes the picture").into());
    }
    match rows.iter().find(|row| !row.same_bits) {
        Some(row) => Err(anyhow!("{}: the pruned pipeline draws another picture than the whole one", row.name).into()),
        None => Ok(Success::Done),
    }
}

fn described(row: &Row) -> serde_json::Value {
    let frames = f64::from(row.frames) * TURNS as f64;
    let side = |figures: &Figures| {
        let stages: std::collections::BTreeMap<_, _> =
            figures.cost.micros_by_stage().into_iter().map(|(s, m)| (s, m as f64 / 1e3 / frames)).collect();
        json!({
            "cpu_ms_per_frame": figures.cpu_ms_per_frame, "packed_bytes_per_pixel": figures.packed_bytes_per_pixel,
            "film_bytes_per_pixel": figures.film_bytes_per_pixel,
            "worker_bytes": figures.worker_bytes, "thread_ms_per_frame": stages,
            "rays": figures.cost.rays(), "light_rays": figures.cost.light_rays,
            "photon_queries": figures.cost.photon_queries, "compensation_rays": figures.cost.compensation_rays,
        })
    };
    let [all, needed] = &row.sides;
    json!({
        "scene": row.name, "left_out": row.left_out, "same_bits": row.same_bits,
        "whole": side(all), "pruned": side(needed),
        "ratio": { "least": row.ratio.least, "median": row.ratio.median, "greatest": row.ratio.greatest },
    })
}

fn print(rows: &[Row], args: &BenchArgs) {
    let (width, height, frames) = (args.size.width, args.size.height, args.frames);
    print_line!(
        "{width}x{height}, {TURNS} turns of {frames} frames each, one thread; CPU ms a frame of the whole process, medians\n"
    );
    print_line!(
        "| scene | parts left out | CPU ms, all kept | pruned | ratio (least–greatest) | rays kept, M | pruned | packed bytes/pixel kept | pruned | film bytes/pixel kept | pruned | worker MB kept | pruned | same bits |"
    );
    print_line!("|{}", "---|".repeat(14));
    for row in rows {
        let [all, needed] = &row.sides;
        print_line!(
            "| {} | {} | {:.1} | {:.1} | {} | {:.2} | {:.2} | {:.3} | {:.3} | {} | {} | {:.3} | {:.3} | {} |",
            row.name,
            row.left_out.len(),
            all.cpu_ms_per_frame,
            needed.cpu_ms_per_frame,
            row.ratio,
            all.rays_m(),
            needed.rays_m(),
            all.packed_bytes_per_pixel,
            needed.packed_bytes_per_pixel,
            all.film_bytes_per_pixel,
            needed.film_bytes_per_pixel,
            all.worker_mb(),
            needed.worker_mb(),
            if row.same_bits { "yes" } else { "NO" },
        );
    }
}
