//! `igi-master bench --questions`: rays and points a second that one core answers, part by part, sorted and scattered; by
//! a thread of this process, or by a worker process over QUIC.

use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, Instant};

use anyhow::{Context, anyhow, ensure};
use frame::parts::order;
use protocol::answer::{Body, Cost};
use protocol::question::{
    Address, Ask, Asked, Lit, Part, Point, Points, Quality, Question, Ray, Rays, Ticket, WorldState,
    points_per_question,
};
use scenes::Camera;
use serde_json::json;

use crate::cli::BenchArgs;
use crate::command::scale::clients::Clients;
use runtime::cluster::{Cluster, ClusterOptions, Event};
use runtime::console::print_line;
use runtime::failure::{Failure, Success};
use runtime::files::name_of;
use runtime::stopwatch::StopWatch;

/// One pixel of so many is asked about, by chance: as when a cache asks for what it lacks.
const ONE_OF: u32 = 16;
/// Every measurement is taken so often; the least counts.
const TURNS: usize = 3;
/// Over QUIC, all is asked so often at once: beside that, the way to the first answer and from the last does not count.
const ROUNDS: usize = 8;
/// Longest wait until the worker process has built the scene.
const PATIENCE: Duration = Duration::from_secs(300);
/// What a ray or point is taken to cost, microseconds: decides how many make a question.
const MICROS_EACH: f64 = 4.0;

/// What is measured, and in which order it is asked: sorted, scattered.
struct Row {
    what: &'static str,
    orders: [Figures; 2],
}

/// Per ray or point.
#[derive(Clone, Copy)]
struct Figures {
    micros: f64,
    shadow_rays: f64,
    /// Of the answer: packed; over QUIC squeezed as well.
    bytes: f64,
}

impl Figures {
    fn per_second(&self) -> f64 {
        1e6 / self.micros
    }
}

/// Measures every scene.
///
/// # Errors
/// [`Failure`] if a scene cannot be read, no worker can be started, or a question is not answered.
pub(super) fn bench_questions(args: &BenchArgs) -> Result<Success, Failure> {
    for path in &args.scenes {
        let (quality, _) = args.method.igi().map_err(Failure::Usage)?;
        let (count, rows) = measure(path, [args.size.width, args.size.height], quality, args.over_quic)?;
        if args.json {
            print_line!("{}", described(path, count, &rows));
        } else {
            print(path, count, &quality, args.over_quic, &rows);
        }
    }
    Ok(Success::Done)
}

/// How many rays and points were asked about, and what they cost.
fn measure(
    path: &Path,
    [width, height]: [u32; 2],
    quality: Quality,
    over_quic: bool,
) -> Result<(usize, Vec<Row>), Failure> {
    let mut scene = scenes::read::load(path)?.scene;
    (scene.camera.width, scene.camera.height) = (width, height);
    let (camera, scene) = (scene.camera, Arc::new(scene));
    let loopback = (std::net::Ipv4Addr::LOCALHOST, 0).into();
    let (embedded, listen) = if over_quic { (None, Some(loopback)) } else { (Some(1), None) };
    let options = ClusterOptions { embedded, listen, ..ClusterOptions::default() };
    let mut cluster = Cluster::start(options).context("workers cannot be started")?;
    let world = cluster.publish(Arc::clone(&scene)).context("the scene cannot be sent to workers")?;
    let client = if over_quic { Some(ready_client(&mut cluster)?) } else { None };
    let lit = Lit { set: 0, frame: 0, seed: 0, quality };
    let mut bench = Bench { cluster, client, world, camera, lit };

    let pixels = (0..height).flat_map(|y| (0..width).map(move |x| [x, y]));
    let chosen = pixels.filter(|[x, y]| mix(y * width + x).is_multiple_of(ONE_OF));
    let ray = |pixel| Ray { address: Address { pixel, number: 0 }, aim: None };
    let mut rays: Vec<Ray> = chosen.map(ray).collect();
    let key = |address: &Address| mix(mix(address.pixel[1] * width + address.pixel[0]) ^ 1);
    order::sort_rays(&mut rays);
    let mut scattered_rays = rays.clone();
    scattered_rays.sort_by_key(|ray| key(&ray.address));

    let hits: Vec<Body> = bench.ask(&rays, 1, &|bench, rays| bench.rays(rays))?.0;
    let hits = hits.into_iter().filter_map(Body::seen).flat_map(|seen| seen.hits);
    let mut points: Vec<Point> =
        hits.zip(&rays).filter_map(|(hit, ray)| Some(Point { at: hit?, address: ray.address })).collect();
    if points.is_empty() {
        return Err(anyhow!("{}: its camera sees no surface", path.display()).into());
    }
    order::sort_points(&scene, &mut points);
    let mut scattered_points = points.clone();
    scattered_points.sort_by_key(|point| key(&point.address));

    let both = [bench.time(&rays, &|b, rays| b.rays(rays))?, bench.time(&scattered_rays, &|b, rays| b.rays(rays))?];
    let mut rows = vec![Row { what: "rays", orders: both }];
    let each = Part::EachLight { first: 0, count: EACH_LIGHTS };
    let parts = [
        ("points, all light", Part::All),
        ("points, direct", Part::Direct),
        ("points, indirect", Part::Indirect),
        ("points, each virtual light", each),
        ("points, towards an eye", Part::Towards(camera.origin)),
    ];
    for (what, part) in parts {
        let ask = |bench: &Bench, points: &[Point]| bench.points(points, part.clone());
        let orders = [bench.time(&points, &ask)?, bench.time(&scattered_points, &ask)?];
        rows.push(Row { what, orders });
    }
    Ok((points.len(), rows))
}

/// More than sets of the default settings have.
const EACH_LIGHTS: u32 = 64;

/// A worker process that has built the scene.
fn ready_client(cluster: &mut Cluster) -> anyhow::Result<Clients> {
    let mut client = Clients::one(cluster)?;
    let begun = Instant::now();
    while cluster.status().ready == 0 {
        ensure!(client.lost() == 0, "igi-worker ended before it was ready");
        ensure!(begun.elapsed() < PATIENCE, "igi-worker was not ready after {} s", PATIENCE.as_secs());
        cluster.next(Duration::from_millis(20));
    }
    Ok(client)
}

/// A worker of one thread, and what all questions to it have in common.
struct Bench {
    /// Dropped first: its good-bye ends the client.
    cluster: Cluster,
    /// The worker, if it is a process of its own.
    client: Option<Clients>,
    world: WorldState,
    camera: Camera,
    lit: Lit,
}

impl Bench {
    fn rays(&self, rays: &[Ray]) -> Ask {
        Ask::Rays(Rays { camera: self.camera, view: Some(self.camera), through: rays.to_vec(), lit: self.lit })
    }

    fn points(&self, points: &[Point], part: Part) -> Ask {
        Ask::Points(Points { view: Some(self.camera), at: points.to_vec(), part, lit: self.lit })
    }

    /// The least time of some turns, the light set being made before.
    fn time<T>(&mut self, all: &[T], ask: &dyn Fn(&Self, &[T]) -> Ask) -> Result<Figures, Failure> {
        let mut least = Figures { micros: f64::INFINITY, shadow_rays: 0.0, bytes: 0.0 };
        self.ask(&all[..1], 1, ask)?;
        let rounds = if self.client.is_some() { ROUNDS } else { 1 };
        let count = (all.len() * rounds) as f64;
        for _ in 0..TURNS {
            let watch = StopWatch::start();
            let (_, cost, bytes) = self.ask(all, rounds, ask)?;
            let elapsed = watch.elapsed();
            let seconds = if self.client.is_some() { elapsed.wall } else { elapsed.cpu };
            least.micros = least.micros.min(seconds * 1e6 / count);
            (least.shadow_rays, least.bytes) = (cost.shadow_rays as f64 / count, bytes as f64 / count);
        }
        Ok(least)
    }

    /// Asks about all, some rounds at once: the answers in order, what they cost, and their bytes.
    fn ask<T>(
        &mut self,
        all: &[T],
        rounds: usize,
        ask: &dyn Fn(&Self, &[T]) -> Ask,
    ) -> Result<(Vec<Body>, Cost, u64), Failure> {
        let world = self.world;
        let chunks = (0..rounds).flat_map(|_| all.chunks(points_per_question(MICROS_EACH))).enumerate();
        let asked = |(slot, some)| {
            let ticket = Ticket { batch: 0, slot: slot as u32 };
            Asked::new(ticket, Question { world, ask: ask(self, some) })
        };
        let questions: Vec<Asked> = chunks.map(asked).collect();
        let (mut bodies, mut cost, mut bytes) = (vec![None; questions.len()], Cost::default(), 0);
        self.cluster.ask(questions);
        while bodies.iter().any(Option::is_none) {
            match self.cluster.next(Duration::from_secs(1)) {
                Some(Event::Answered { asked, body, cost: paid, bytes: length, .. }) => {
                    bodies[asked.ticket.slot as usize] = Some(body);
                    cost += paid;
                    bytes += length;
                }
                Some(Event::Unanswered { reason, .. }) => {
                    return Err(anyhow!("a question is not answered: {reason}").into());
                }
                _ => {}
            }
        }
        Ok((bodies.into_iter().flatten().collect(), cost, bytes))
    }
}

fn described(path: &Path, count: usize, rows: &[Row]) -> serde_json::Value {
    let figures = |figures: &Figures| {
        json!({
            "per_second": figures.per_second(), "micros": figures.micros, "shadow_rays": figures.shadow_rays,
            "bytes": figures.bytes,
        })
    };
    let row = |row: &Row| {
        let [sorted, scattered] = &row.orders;
        json!({ "what": row.what, "sorted": figures(sorted), "scattered": figures(scattered) })
    };
    json!({ "scene": name_of(path), "points": count, "questions": rows.iter().map(row).collect::<Vec<_>>() })
}

fn print(path: &Path, count: usize, quality: &Quality, over_quic: bool, rows: &[Row]) {
    let by = if over_quic { "by the clock, over QUIC" } else { "by CPU time of the whole process" };
    print_line!(
        "{}: {count} points, one pixel of {ONE_OF} by chance, {} + {} virtual lights; each {by}, best of {TURNS}\n",
        name_of(path),
        quality.light_samples,
        quality.vpls
    );
    print_line!(
        "| what | thousands a second and core, sorted | scattered | µs each, sorted | scattered | shadow rays each | bytes each |"
    );
    print_line!("|---|---|---|---|---|---|---|");
    for Row { what, orders: [sorted, scattered] } in rows {
        print_line!(
            "| {what} | {:.0} | {:.0} | {:.2} | {:.2} | {:.1} | {:.1} |",
            sorted.per_second() / 1e3,
            scattered.per_second() / 1e3,
            sorted.micros,
            scattered.micros,
            sorted.shadow_rays,
            sorted.bytes
        );
    }
    print_line!("");
}

/// Scatters numbers ("lowbias32", C. Wellons).
fn mix(mut x: u32) -> u32 {
    x ^= x >> 16;
    x = x.wrapping_mul(0x7feb_352d);
    x ^= x >> 15;
    x = x.wrapping_mul(0x846c_a68b);
    x ^ (x >> 16)
}
