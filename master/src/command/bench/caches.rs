//! `igi-master bench --caches`: the steps of a moving picture, for methods that make them at once of what they know; on one
//! thread, beside what Walter, Drettakis and Parker report (*Interactive Rendering using the Render Cache*, 1999, table 1).

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use anyhow::{Context, bail};
use frame::front_end::{Answered, Effort, Held, Interactive, Value, preset};
use frame::tone::Tone;
use frame::{Chosen, View};
use protocol::answer::Fields;
use protocol::question::WorldState;
use scenes::{Camera, Needs, Scene};
use serde_json::json;

use crate::cli::BenchArgs;
use runtime::cluster::embedded::cores;
use runtime::cluster::{Cluster, ClusterOptions, Event};
use runtime::console::print_line;
use runtime::failure::{Failure, Success};
use runtime::files::name_of;
use runtime::methods;
use runtime::stopwatch::thread_seconds;

/// Pictures that are measured of; the paper's is the first.
const SIZES: [[u32; 2]; 4] = [[256, 256], [512, 512], [640, 480], [1280, 720]];
/// What all steps should take together, ms.
const GOALS: [f64; 4] = [2.5, 9.0, 10.0, 32.0];
/// The paper's table, ms: 256×256 on an R10000 at 195 MHz. Its one figure for requests is of three steps of ours.
const PAPER: [(&str, f64); 7] = [
    ("initialize buffers", 4.6),
    ("point projection", 32.8),
    ("depth cull", 8.5),
    ("interpolation", 13.9),
    (DISPLAY, 2.7),
    ("update render cache", 2.7),
    ("sampling choice", 5.3),
];
const PAPER_ALL: f64 = 70.5;
/// Eight bits a channel.
const DISPLAY: &str = "display image";
/// One pixel of so many is asked about: in the middle of what the paper calls interactive (8 to 64).
const MISMATCH: f32 = 16.0;
/// Frames of the still picture before.
const STILL_FRAMES: u32 = 9;
/// Pictures before those that count, and those.
const BEFORE: u32 = 6;
const PICTURES: u32 = 15;
/// Longest wait for an answer.
const PATIENCE: Duration = Duration::from_secs(300);

/// Milliseconds of one size, by step; all steps; all that a picture takes beside answers; and what is kept in the end.
struct Column {
    steps: BTreeMap<&'static str, f64>,
    all: f64,
    picture: f64,
    held: Option<Held>,
}

/// Measures every scene by every method that has steps, and its paper's settings.
///
/// # Errors
/// [`Failure`] if a scene cannot be read, no worker can be started, or a question is not answered.
pub(super) fn bench_caches(args: &BenchArgs) -> Result<Success, Failure> {
    let mut chosen: Vec<Chosen> = args.method.typed().cloned().into_iter().collect();
    if chosen.is_empty() {
        for method in methods::all() {
            let plain = Chosen::new(*method);
            let paper = preset(*method, "paper")
                .and_then(|values| plain.with(values.iter().map(|(name, value)| (*name, Value::from(*value)))).ok());
            chosen.extend(std::iter::once(plain).chain(paper));
        }
    }
    chosen.retain(|chosen| chosen.interactive(0).tell_steps(Box::new(|_| {})));
    if chosen.is_empty() {
        return Err(Failure::Usage("no such method makes its moving pictures of what it knows".to_string()));
    }
    for path in &args.scenes {
        for chosen in &chosen {
            let columns = measure(path, chosen)?;
            if args.json {
                print_line!("{}", described(path, chosen, &columns));
            } else {
                print(path, chosen, &columns);
            }
        }
    }
    Ok(Success::Done)
}

fn measure(path: &Path, chosen: &Chosen) -> anyhow::Result<Vec<Column>> {
    let scene = Arc::new(scenes::read::load(path)?.scene);
    let options = ClusterOptions { embedded: Some(cores()), ..ClusterOptions::default() };
    let mut cluster = Cluster::start(options).context("workers cannot be started")?;
    let world = cluster.publish(Arc::clone(&scene)).context("the scene cannot be sent to workers")?;
    let mut room = Room { cluster, scene, world };
    SIZES
        .iter()
        .map(|size| {
            eprintln!("{}: {}, {}x{}", path.display(), chosen.flags().join(" "), size[0], size[1]);
            room.measure(chosen, *size)
        })
        .collect()
}

/// Where it takes place.
struct Room {
    cluster: Cluster,
    scene: Arc<Scene>,
    world: WorldState,
}

/// Processor time of this thread by step, of one picture.
#[derive(Default)]
struct Meter {
    since: f64,
    steps: BTreeMap<&'static str, f64>,
}

/// Seconds of a picture in all, and of its steps.
type Taken = (f64, BTreeMap<&'static str, f64>);

impl Meter {
    fn hear(&mut self, step: Option<&'static str>) {
        let now = thread_seconds();
        if let Some(step) = step {
            *self.steps.entry(step).or_default() += now - self.since;
        }
        self.since = thread_seconds();
    }
}

impl Room {
    fn measure(&mut self, chosen: &Chosen, [width, height]: [u32; 2]) -> anyhow::Result<Column> {
        let meter = Arc::new(Mutex::new(Meter::default()));
        let heard = Arc::clone(&meter);
        let mut front = chosen.interactive(0);
        front.tell_steps(Box::new(move |step| heard.lock().unwrap_or_else(PoisonError::into_inner).hear(step)));
        let own = Camera { width, height, ..self.scene.camera };
        front.look(&self.view(own), &[]);
        front.begin(None);
        front.set_limit(STILL_FRAMES);
        self.answer(front.as_mut())?;
        let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().context("cannot start a thread")?;
        let mut pictures = Vec::new();
        for number in 1..=BEFORE + PICTURES {
            let view = self.view(along(&own, number));
            let front = front.as_mut();
            let picture = pool.install(|| {
                let began = thread_seconds();
                if let Some(stock) = front.stock() {
                    front.take_in(stock.whole);
                }
                front.look(&view, &[]);
                front.begin(Some(Effort(1.0 / MISMATCH)));
                front.end();
                let shot = front.shot(None);
                let displays = thread_seconds();
                let shown = shot.and_then(|shot| Some(Tone::PLAIN.develop(shot.picture.as_deref()?)));
                std::hint::black_box(shown);
                let ended = thread_seconds();
                [ended - began, ended - displays]
            });
            let mut steps = std::mem::take(&mut meter.lock().unwrap_or_else(PoisonError::into_inner).steps);
            steps.insert(DISPLAY, picture[1]);
            if number > BEFORE {
                pictures.push((picture[0], steps));
            }
            self.answer(front)?;
        }
        let ms = |of: &dyn Fn(&Taken) -> f64| {
            let mut times: Vec<f64> = pictures.iter().map(of).collect();
            times.sort_by(f64::total_cmp);
            times[times.len() / 2] * 1e3
        };
        let names: std::collections::BTreeSet<&'static str> =
            pictures.iter().flat_map(|(_, steps)| steps.keys().copied()).collect();
        let step = |name: &'static str| (name, ms(&|(_, steps)| steps.get(name).copied().unwrap_or(0.0)));
        Ok(Column {
            steps: names.into_iter().map(step).collect(),
            all: ms(&|(_, steps)| steps.values().sum()),
            picture: ms(&|(picture, _)| *picture),
            held: front.held(),
        })
    }

    fn view(&self, camera: Camera) -> View {
        let fields = Fields::of(&Needs::of(&self.scene));
        View { world: self.world, scene: Arc::clone(&self.scene), fields, camera, seed: 1 }
    }

    /// Has all answered that is asked, until nothing more is.
    fn answer(&mut self, front: &mut dyn Interactive) -> anyhow::Result<()> {
        let (mut open, mut heard) = (0_usize, Instant::now());
        loop {
            let asked = front.ask(1024 - open.min(1024));
            open += asked.len();
            self.cluster.ask(asked);
            if open == 0 {
                return Ok(());
            }
            match self.cluster.next(Duration::from_millis(100)) {
                Some(Event::Answered { asked, body, cost, worker, .. }) => {
                    (open, heard) = (open - 1, Instant::now());
                    front.absorb(Answered { ticket: asked.ticket, body, worker, cost: &cost });
                }
                Some(Event::Unanswered { reason, .. }) => bail!("a question was not answered: {reason}"),
                _ if heard.elapsed() > PATIENCE => bail!("no answer for {} minutes", PATIENCE.as_secs() / 60),
                _ => {}
            }
        }
    }
}

/// The camera some pictures later: it goes sideways, a hundredth of the distance to what it looks at each time.
fn along(camera: &Camera, number: u32) -> Camera {
    let forward = camera.target - camera.origin;
    let right = forward.cross(camera.up).normalize_or_zero();
    let by = right * (forward.length() * 0.01 * number as f32);
    Camera { origin: camera.origin + by, target: camera.target + 0.5 * by, ..*camera }
}

fn described(path: &Path, chosen: &Chosen, columns: &[Column]) -> serde_json::Value {
    let column = |(size, column): (&[u32; 2], &Column)| {
        json!({ "width": size[0], "height": size[1], "ms": column.steps, "ms_all_steps": column.all,
            "ms_picture": column.picture, "kept": column.held.map(|held| held.count),
            "kept_of": column.held.map(|held| held.of), "bytes_kept": column.held.map(|held| held.bytes) })
    };
    let columns: Vec<_> = SIZES.iter().zip(columns).map(column).collect();
    json!({ "scene": name_of(path), "method": chosen.flags().join(" "), "mismatch": MISMATCH, "sizes": columns })
}

fn print(path: &Path, chosen: &Chosen, columns: &[Column]) {
    let flags = chosen.flags().join(" ");
    print_line!("{}: {flags}, one new sample for {MISMATCH} pixels, ms of one thread\n", name_of(path));
    let sizes = SIZES.map(|[width, height]| format!("{width}x{height}")).join(" | ");
    print_line!("| step | 1999, 256x256 | {sizes} |\n|{}", "---|".repeat(2 + SIZES.len()));
    let cells = |of: &dyn Fn(&Column) -> f64| {
        columns.iter().map(|column| format!("{:.2}", of(column))).collect::<Vec<_>>().join(" | ")
    };
    let order = |name: &str| PAPER.iter().position(|(step, _)| *step == name).unwrap_or(PAPER.len());
    let mut names: Vec<&'static str> = columns.iter().flat_map(|column| column.steps.keys().copied()).collect();
    names.sort_by_key(|name| (order(name), *name));
    names.dedup();
    for name in names {
        let paper = PAPER.iter().find(|(step, _)| *step == name);
        let paper = paper.map_or("–".to_owned(), |(_, ms)| format!("{ms:.1}"));
        print_line!("| {name} | {paper} | {} |", cells(&|column| column.steps.get(name).copied().unwrap_or(0.0)));
    }
    print_line!("| **all steps** | {PAPER_ALL} | {} |", cells(&|column| column.all));
    print_line!("| goal | – | {} |", GOALS.map(|goal| format!("{goal}")).join(" | "));
    print_line!("| all of a picture | – | {} |", cells(&|column| column.picture));
    if let Some(held) = columns.iter().find_map(|column| column.held) {
        let each = |column: &Column| {
            let Held { count, bytes, .. } = column.held?;
            Some(format!("{} in {count}", bytes / count.max(1)))
        };
        let cells = columns.iter().map(|column| each(column).unwrap_or_default()).collect::<Vec<_>>().join(" | ");
        print_line!("| bytes a {} | – | {cells} |", held.of);
    }
    print_line!("");
}
