//! Real workers on machines that fail: each in a network namespace of its own, over real QUIC, with a share of a core,
//! while the camera moves on the master. What each fault costs is measured; every picture must have the bits that one
//! process gives it.
//!
//! Needs root, `iproute2` and `nftables`: `IGI_TEST_NETNS=1 cargo test -p tests --test netns -- --nocapture`. A larger
//! number repeats every fault so often, and makes the table of docs/faults.md.

mod delay;
mod place;

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, Instant};

use frame::{FrontEnd, Igi, Plane, Setup};
use protocol::answer::Fields;
use protocol::question::{Quality, WorldState};
use runtime::cluster::{Cluster, ClusterOptions, Event, Status};
use scenes::{Needs, Scene};

use place::Place;

/// The camera goes round in so many steps.
const STEPS: usize = 12;
/// Longest wait for anything.
const PATIENCE: Duration = Duration::from_secs(60);
/// A fault is looked at for so long before it is mended.
const LASTS: Duration = Duration::from_secs(3);
/// Machines, of which the first has the fault.
const MACHINES: usize = 3;

/// What goes wrong, and how it is made good again.
struct Fault {
    name: &'static str,
    strike: fn(&mut [Place]),
    mend: fn(&mut [Place]),
}

const FAULTS: [Fault; 12] = [
    Fault { name: "nothing", strike: |_| (), mend: |_| () },
    Fault { name: "one of three killed (kill -9), started again", strike: |at| at[0].kill(), mend: |at| at[0].start() },
    Fault {
        name: "one stopped (SIGSTOP), woken",
        strike: |at| at[0].signal("-STOP"),
        mend: |at| at[0].signal("-CONT"),
    },
    Fault {
        name: "two stopped, woken",
        strike: |at| at[..2].iter().for_each(|place| place.signal("-STOP")),
        mend: |at| at[..2].iter().for_each(|place| place.signal("-CONT")),
    },
    Fault {
        name: "one sent home (SIGTERM), another joins",
        strike: |at| assert_eq!(at[0].leave(), Some(0), "it drains and says good-bye"),
        mend: |at| at[0].start(),
    },
    Fault { name: "one at a tenth of its speed", strike: |at| at[0].set_slow(true), mend: |at| at[0].set_slow(false) },
    Fault {
        name: "cable of one pulled for 3 s",
        strike: |at| at[0].set_cable(false),
        mend: |at| at[0].set_cable(true),
    },
    Fault {
        name: "cables of all pulled for 3 s",
        strike: |at| at.iter().for_each(|place| place.set_cable(false)),
        mend: |at| at.iter().for_each(|place| place.set_cable(true)),
    },
    Fault {
        name: "5 % of all packets lost",
        strike: |at| at.iter().for_each(|place| place.set_loss(5)),
        mend: |at| at.iter().for_each(|place| place.set_loss(0)),
    },
    Fault {
        name: "50 ms each way, to all",
        strike: |at| at.iter().for_each(|place| place.set_delay(Duration::from_millis(50))),
        mend: |at| at.iter().for_each(|place| place.set_delay(Duration::ZERO)),
    },
    Fault {
        name: "1 Mbit/s to each",
        strike: |at| at.iter().for_each(|place| place.set_rate(Some(1000))),
        mend: |at| at.iter().for_each(|place| place.set_rate(None)),
    },
    Fault {
        name: "5 %, 50 ms and 1 Mbit/s together",
        strike: |at| {
            at.iter().for_each(|place| {
                (place.set_loss(5), place.set_delay(Duration::from_millis(50)), place.set_rate(Some(1000))).2
            })
        },
        mend: |at| {
            at.iter().for_each(|place| (place.set_loss(0), place.set_delay(Duration::ZERO), place.set_rate(None)).2)
        },
    },
];

/// A picture that was drawn.
#[derive(Clone, Copy)]
struct Drawn {
    begun: Instant,
    ended: Instant,
    /// It is whole, and has the bits that it must have.
    right: bool,
}

impl Drawn {
    fn took(&self) -> f64 {
        (self.ended - self.begun).as_secs_f64()
    }
}

/// One time that a fault happened.
struct Trial {
    /// Pictures a second, before and while it lasts.
    rate: [f64; 2],
    /// Longest wait for a picture since it happened, beyond the usual one before, seconds.
    standstill: f64,
    /// From its mending until all machines work again, seconds.
    back: f64,
    pictures: usize,
    lost: usize,
}

/// How many questions each connection's machine has answered.
type Answered = BTreeMap<u32, (String, u64)>;

fn answered(status: Status) -> Answered {
    status.list.into_iter().map(|info| (info.worker, (info.name, info.answered))).collect()
}

struct Lab {
    scene: Arc<Scene>,
    world: WorldState,
    cluster: Cluster,
    truth: Vec<[u8; 32]>,
    step: usize,
}

/// The picture from one step of the camera's way.
fn setup(scene: &Scene, world: WorldState, step: usize) -> Setup {
    let mut camera = scene.camera;
    (camera.width, camera.height) = (128, 96);
    let turn = glam::Quat::from_rotation_y(0.1 * (step as f32 / STEPS as f32 * std::f32::consts::TAU).sin());
    camera.origin = camera.target + turn * (camera.origin - camera.target);
    let quality = Quality { vpls: 8, ..Quality::default() };
    Setup {
        world,
        camera,
        quality,
        fields: Fields::of(&Needs::of(scene)),
        seed: 3,
        filter: frame::Filter::plane([3, 3]),
    }
}

/// Draws one picture while something else may happen; its bits, if it is whole.
fn draw(cluster: &mut Cluster, setup: Setup, mut meanwhile: impl FnMut()) -> Option<[u8; 32]> {
    let mut front = Igi::new(setup);
    front.set_limit(1);
    let (begun, mut is_whole) = (Instant::now(), true);
    while !front.is_finished() {
        assert!(begun.elapsed() < PATIENCE, "a picture does not end: {:?}", cluster.status());
        meanwhile();
        cluster.ask(front.ask(cluster.room().min(1024)));
        match cluster.next(Duration::from_millis(50)) {
            Some(Event::Answered { asked, body, cost, worker, .. }) => {
                front.absorb(frame::Answered { ticket: asked.ticket, body, worker, cost: &cost });
            }
            Some(Event::Unanswered { asked, reason }) => {
                println!("  {}: {reason}", asked.question.ask);
                is_whole = false;
                front.give_up(asked.ticket);
            }
            _ => {}
        }
    }
    is_whole.then(|| front.show(Plane::Raw).sha256())
}

impl Lab {
    fn new() -> Self {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("the workspace").join("scenes/cornell");
        let scene = Arc::new(scenes::read::load(&folder).expect("the shipped scene is sound").scene);
        let alone = ClusterOptions { embedded: Some(1), ..ClusterOptions::default() };
        let mut alone = Cluster::start(alone).expect("a cluster starts");
        let world = alone.publish(Arc::clone(&scene)).expect("the scene can be sent");
        let whole = |step| draw(&mut alone, setup(&scene, world, step), || ()).expect("nobody dies");
        let truth = (0..STEPS).map(whole).collect();
        let listen = Some("0.0.0.0:0".parse().expect("an address"));
        let mut cluster =
            Cluster::start(ClusterOptions { listen, ..ClusterOptions::default() }).expect("a cluster starts");
        assert_eq!(cluster.publish(Arc::clone(&scene)).expect("the scene can be sent"), world);
        Self { scene, world, cluster, truth, step: 0 }
    }

    /// Draws until it is enough.
    fn draw(&mut self, is_enough: impl Fn(&Cluster) -> bool, mut meanwhile: impl FnMut()) -> Vec<Drawn> {
        let (mut drawn, begun) = (Vec::new(), Instant::now());
        while !is_enough(&self.cluster) {
            assert!(begun.elapsed() < PATIENCE, "waited in vain: {:?}", self.cluster.status());
            self.step = (self.step + 1) % STEPS;
            let begun = Instant::now();
            let bits = draw(&mut self.cluster, setup(&self.scene, self.world, self.step), &mut meanwhile);
            drawn.push(Drawn { begun, ended: Instant::now(), right: bits == Some(self.truth[self.step]) });
        }
        drawn
    }

    fn draw_for(&mut self, time: Duration) -> Vec<Drawn> {
        let end = Instant::now() + time;
        self.draw(|_| Instant::now() > end, || ())
    }

    /// All machines have answered something since.
    fn is_well(cluster: &Cluster, before: &Answered) -> bool {
        let mut well: Vec<_> = answered(cluster.status()).into_iter().collect();
        well.retain(|(worker, (_, now))| *now > before.get(worker).map_or(0, |(_, then)| *then));
        let mut names: Vec<_> = well.into_iter().map(|(_, (name, _))| name).collect();
        names.sort();
        names.dedup();
        names.len() == MACHINES
    }

    fn trial(&mut self, fault: &Fault, places: &mut [Place]) -> Trial {
        let now = answered(self.cluster.status());
        self.draw(|cluster| Self::is_well(cluster, &now), || ());
        let before = self.draw_for(Duration::from_secs(2));
        let mend_at = Instant::now() + LASTS;
        (fault.strike)(places);
        // It is mended in the middle of a picture, too: perhaps none ends before.
        let mended = RefCell::new(None);
        let board = self.cluster.board();
        let mut since = self.draw(
            |cluster| mended.borrow().as_ref().is_some_and(|(_, then)| Self::is_well(cluster, then)),
            || {
                if mended.borrow().is_none() && Instant::now() >= mend_at {
                    (fault.mend)(places);
                    *mended.borrow_mut() = Some((Instant::now(), answered(board())));
                }
            },
        );
        let (mended, _) = mended.into_inner().expect("it was waited for");
        let back = mended.elapsed().as_secs_f64();
        since.extend(self.draw_for(Duration::from_millis(500)));

        let usual = middle(before.iter().map(Drawn::took).collect());
        let longest = since.iter().map(Drawn::took).fold(0.0, f64::max);
        let pace = |some: &[Drawn]| some.len() as f64 / some.iter().map(Drawn::took).sum::<f64>();
        let during = since.iter().filter(|drawn| drawn.ended <= mended).count();
        // All of a picture that was begun before it was mended belongs to it.
        let rate = [pace(&before), pace(&since[..since.len().min(during + 1)])];
        let lost = before.iter().chain(&since).filter(|drawn| !drawn.right).count();
        Trial { rate, standstill: longest - usual, back, pictures: before.len() + since.len(), lost }
    }
}

fn middle(values: Vec<f64>) -> f64 {
    quantile(values, 0.5)
}

fn quantile(mut values: Vec<f64>, at: f64) -> f64 {
    values.sort_by(f64::total_cmp);
    values[((values.len() - 1) as f64 * at).round() as usize]
}

/// What somebody sees who looks at the picture.
fn seen(standstill: f64, share: f64) -> String {
    let still =
        if standstill > 0.15 { format!("it stands still for {standstill:.1} s") } else { "no hitch".to_owned() };
    if share < 0.9 { format!("{still}; {:.0} % of the pace", 100.0 * share) } else { still }
}

#[test]
fn faults_of_machines_and_networks_cost_time_and_no_bit() {
    let Some(times) = std::env::var("IGI_TEST_NETNS").ok().and_then(|times| times.parse::<usize>().ok()) else {
        println!("skipped: IGI_TEST_NETNS is not set (it needs root, ip, tc and nft)");
        return;
    };
    let mut lab = Lab::new();
    let (address, token) =
        (lab.cluster.address().expect("it listens"), lab.cluster.token().expect("it listens").to_string());
    let mut places: Vec<_> = (1..=MACHINES as u8).map(|number| Place::new(number, address, &token)).collect();
    println!(
        "| what happens | what is seen | standstill, ms: p50, p99 | pictures/s before, with it | all at work again after s: p50, p99 | pictures, lost |"
    );
    println!("|---|---|---|---|---|---|");
    let mut lost = 0;
    for fault in &FAULTS {
        let trials: Vec<_> = (0..times.max(1)).map(|_| lab.trial(fault, &mut places)).collect();
        let of = |value: fn(&Trial) -> f64| trials.iter().map(value).collect::<Vec<_>>();
        let [still, still_99] = [0.5, 0.99].map(|at| quantile(of(|trial| trial.standstill), at));
        let [back, back_99] = [0.5, 0.99].map(|at| quantile(of(|trial| trial.back), at));
        let [before, with] = [middle(of(|trial| trial.rate[0])), middle(of(|trial| trial.rate[1]))];
        let share = middle(of(|trial| trial.rate[1] / trial.rate[0]));
        let lost_here: usize = trials.iter().map(|trial| trial.lost).sum();
        println!(
            "| {} | {} | {:.0}, {:.0} | {before:.1}, {with:.1} | {back:.2}, {back_99:.2} | {}, {lost_here} |",
            fault.name,
            seen(still, share),
            1e3 * still,
            1e3 * still_99,
            trials.iter().map(|trial| trial.pictures).sum::<usize>(),
        );
        lost += lost_here;
    }
    assert_eq!(lost, 0, "pictures were lost, or have other bits");
}
