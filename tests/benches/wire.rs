//! What answers weigh and what packing them costs, on tiles of real scenes.
//!
//! `cargo bench -p tests --bench wire` first prints bytes a pixel by field and scene, then times.

use std::hint::black_box;
use std::path::Path;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use light::{LightSetCache, Prepared};
use protocol::answer::{Body, Fields, Pixels};
use protocol::pack::{compress, decompress, pack, unpack};
use protocol::question::{Ask, Lit, Quality, Question, Rect, Tile, WorldState};

/// Tiles of this size, as the front end asks for them.
const TILE: u32 = 64;

struct Answered {
    question: Question,
    pixels: Pixels,
    fields: Fields,
}

/// Some tiles across the picture.
fn answers(name: &str) -> Vec<Answered> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("the workspace").join("scenes").join(name);
    let scene = scenes::read::load(&folder).expect("the shipped scene is sound").scene;
    let mut camera = scene.camera;
    (camera.width, camera.height) = (640, 480);
    let prepared = Prepared::new(scene);
    let fields = Fields::of(&prepared.needs);
    let cache = LightSetCache::default();
    let tile = |x: u32, y: u32, frame: u32| {
        let rect = Rect { x, y, width: TILE, height: TILE.min(480 - y) };
        let tile = Tile { camera, rect, lit: Lit { set: 4, frame, seed: 1, quality: Quality::default() } };
        Question { world: WorldState::default(), ask: Ask::Tile(tile) }
    };
    let places = (0..480).step_by(128).flat_map(|y| (0..640).step_by(128).map(move |x| (x, y)));
    places
        .map(|(x, y)| {
            let question = tile(x, y, 0);
            let body = light::answer(&prepared, &cache, &question, &|| 0).body;
            let pixels = body.pixels().expect("tiles are answered by pixels");
            Answered { question, pixels, fields }
        })
        .collect()
}

fn report(name: &str, answers: &[Answered]) {
    let pixels: usize = answers.iter().map(|answer| answer.pixels.len()).sum();
    // Each field alone, the others black; an answer with nothing in it weighs a few bytes.
    let weigh = |keep: &dyn Fn(&Pixels) -> Pixels| {
        let weights = answers.iter().map(|answer| {
            let part = Body::Pixels(keep(&answer.pixels));
            let packed = pack(&answer.question, &part, answer.fields);
            (packed.len(), compress(&packed).len())
        });
        let (raw, squeezed) = weights.fold((0, 0), |sum, (raw, squeezed)| (sum.0 + raw, sum.1 + squeezed));
        (raw as f64 / pixels as f64, squeezed as f64 / pixels as f64)
    };
    let black = |like: &Pixels| Pixels::black(like.len());
    let (raw, all) = weigh(&Pixels::clone);
    let (_, emitted) = weigh(&|p| Pixels { emitted: p.emitted.clone(), ..black(p) });
    let (_, reflectance) = weigh(&|p| Pixels { reflectance: p.reflectance.clone(), ..black(p) });
    let (_, irradiance) = weigh(&|p| Pixels { irradiance: p.irradiance.clone(), ..black(p) });
    let (_, normal) = weigh(&|p| Pixels { normal: p.normal.clone(), ..black(p) });
    let (_, distance) = weigh(&|p| Pixels { distance: p.distance.clone(), ..black(p) });
    println!(
        "{name:16} {all:5.2} bytes a pixel ({raw:5.2} before LZ4): emitted {emitted:.2}, reflectance {reflectance:.2}, \
         irradiance {irradiance:.2}, normal {normal:.2}, distance {distance:.2}"
    );
}

fn wire(criterion: &mut Criterion) {
    let mut last = Vec::new();
    for name in ["cornell", "veach_door", "cornell_spheres", "conference", "livingroom"] {
        last = answers(name);
        report(name, &last);
    }
    let pixels: usize = last.iter().map(|answer| answer.pixels.len()).sum();
    let bodies: Vec<_> = last.iter().map(|answer| Body::Pixels(answer.pixels.clone())).collect();
    let packed: Vec<_> = last.iter().zip(&bodies).map(|(a, body)| pack(&a.question, body, a.fields)).collect();
    let squeezed: Vec<_> = packed.iter().map(|packed| compress(packed)).collect();

    let mut group = criterion.benchmark_group("wire, livingroom");
    group.throughput(Throughput::Elements(pixels as u64));
    group.bench_function("pack", |bench| {
        let each = || last.iter().zip(&bodies);
        bench.iter(|| each().map(|(a, body)| pack(&a.question, black_box(body), a.fields).len()).sum::<usize>());
    });
    group.bench_function("compress", |bench| {
        bench.iter(|| packed.iter().map(|packed| compress(black_box(packed)).len()).sum::<usize>());
    });
    group.bench_function("decompress", |bench| {
        bench.iter(|| squeezed.iter().map(|s| decompress(black_box(s), 1 << 20).unwrap().len()).sum::<usize>());
    });
    group.bench_function("unpack", |bench| {
        let each = || last.iter().zip(&packed);
        bench.iter(|| each().map(|(a, p)| unpack(&a.question, black_box(p), a.fields).unwrap().len()).sum::<usize>());
    });
    group.finish();
}

criterion_group!(benches, wire);
criterion_main!(benches);
