//! Speed of the master's side of a frame: absorbing answers, discontinuity buffer, tone curve; and of finding what pixels see.
//! 640×480 and 3×3 as in the paper's table; its master managed 1.5 Mpixel/s.

use std::hint::black_box;

use criterion::{BatchSize, Criterion, Throughput, criterion_group, criterion_main};
use frame::parts::raster::Raster;
use frame::tone::{Exposure, Operator, Tone};
use frame::{Answered, Filter, FrontEnd, Igi, Plane, Setup};
use protocol::answer::{Body, Cost, Fields, Pixels};
use protocol::question::{Ask, Asked, Quality, Question, Ticket, WorldState};
use scenes::{Camera, Rgb};

const WIDTH: u32 = 640;
const HEIGHT: u32 = 480;

fn setup() -> Setup {
    let quality = Quality::default();
    Setup {
        world: WorldState::default(),
        camera: Camera { width: WIDTH, height: HEIGHT, ..Camera::default() },
        quality,
        fields: Fields { emitted: true, surface: true },
        seed: 0,
        filter: Filter::plane(quality.interleave),
    }
}

/// A noisy corner of two walls.
fn answer(question: &Question) -> Pixels {
    // The cross-check's question: as it is answered wrongly, it is given up.
    let Ask::Tile(tile) = &question.ask else { return Pixels::default() };
    let lens = tile.camera.lens();
    let mut pixels = Pixels::default();
    for [x, y] in tile.grid().pixels() {
        let noise = (x * 7 + y * 13 + tile.lit.frame * 29) as f32 % 17.0;
        let left = x < WIDTH / 2;
        let direction = lens.direction(x as f32 + 0.5, y as f32 + 0.5);
        pixels.emitted.push(Rgb::ZERO);
        pixels.reflectance.push(Rgb::new(0.5, 0.25, 0.75));
        pixels.irradiance.push(Rgb::splat(1.0 + noise + f32::from(tile.lit.set)));
        pixels.normal.push(if left { Rgb::X } else { Rgb::Z });
        pixels.distance.push(if left { 2.0 / direction.x.abs() } else { 3.0 / direction.z.abs() }.min(100.0));
    }
    pixels
}

/// All questions of a frame, answered.
fn frame(igi: &mut Igi) -> Vec<(Ticket, Pixels)> {
    let tasks = igi.ask(usize::MAX);
    let number = tasks[0].ticket.batch;
    let of_frame = tasks.into_iter().filter(|asked| asked.ticket.batch == number);
    of_frame.map(|Asked { ticket, question }| (ticket, answer(&question))).collect()
}

fn absorb(igi: &mut Igi, answers: impl IntoIterator<Item = (Ticket, Pixels)>) {
    for (ticket, pixels) in answers {
        igi.absorb(Answered { ticket, body: Body::Pixels(pixels), worker: 0, cost: &Cost::default() });
    }
}

/// Asks and answers until all frames are made.
fn draw(igi: &mut Igi) {
    while !igi.is_finished() {
        let asked = igi.ask(usize::MAX);
        absorb(igi, asked.into_iter().map(|Asked { ticket, question }| (ticket, answer(&question))));
    }
}

fn master_side(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("640x480");
    group.throughput(Throughput::Elements(u64::from(WIDTH * HEIGHT)));

    let answers = frame(&mut Igi::new(setup()));
    let ready = || {
        let mut igi = Igi::new(setup());
        igi.ask(1);
        igi
    };
    group.bench_function("absorb", |bencher| {
        let begin = || (ready(), answers.clone());
        let routine = |(mut igi, answers)| {
            absorb(&mut igi, answers);
            igi
        };
        bencher.iter_batched(begin, routine, BatchSize::LargeInput);
    });

    let mut igi = ready();
    absorb(&mut igi, answers.clone());
    for (name, filter) in [
        ("filter off", Filter::OFF),
        ("discontinuity buffer, paper", Filter::paper([3, 3])),
        ("discontinuity buffer, planes", Filter::plane([3, 3])),
        ("discontinuity buffer, planes 5x5", Filter::plane([5, 5])),
    ] {
        igi.set_filter(filter);
        group.bench_function(name, |bencher| bencher.iter(|| black_box(igi.show(Plane::Final))));
    }

    // Two rounds: from then on the filter is judged and fades.
    let mut long = Igi::new(setup());
    long.set_limit(18);
    draw(&mut long);
    group.bench_function("discontinuity buffer, planes, fading", |bencher| {
        bencher.iter(|| black_box(long.show(Plane::Final)));
    });
    group.bench_function("error estimate", |bencher| {
        let mut quality = setup().quality;
        quality.replicates = 2;
        let mut igi = Igi::new(Setup { quality, ..setup() });
        igi.set_limit(18);
        draw(&mut igi);
        bencher.iter(|| black_box(igi.error()));
    });

    let picture = long.show(Plane::Final);
    for operator in [Operator::None, Operator::Reinhard, Operator::Aces, Operator::Agx] {
        let tone = Tone { exposure: Exposure::Fixed(0.0), operator };
        group
            .bench_function(format!("tone {operator:?}"), |bencher| bencher.iter(|| black_box(tone.develop(&picture))));
    }

    igi.set_filter(Filter::plane([3, 3]));
    group.bench_function("all: absorb, planes, tone", |bencher| {
        let begin = || (ready(), answers.clone());
        let routine = |(mut igi, answers)| {
            absorb(&mut igi, answers);
            Tone::PLAIN.develop(&igi.show(Plane::Final))
        };
        bencher.iter_batched(begin, routine, BatchSize::LargeInput);
    });
    group.finish();
}

/// Conference, on one thread.
fn raster(criterion: &mut Criterion) {
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes/conference");
    let scene = scenes::read::load(&folder).expect("it is shipped").scene;
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a thread can be had");
    let mut group = criterion.benchmark_group("raster");
    for [width, height] in [[640, 480], [1280, 720]] {
        let camera = Camera { width, height, ..scene.camera };
        let mut raster = Raster::new();
        group.throughput(Throughput::Elements(u64::from(width * height)));
        group.bench_function(format!("conference {width}x{height}"), |bencher| {
            pool.install(|| bencher.iter(|| raster.draw(&scene, &camera)));
        });
    }
    group.finish();
}

criterion_group!(benches, master_side, raster);
criterion_main!(benches);
