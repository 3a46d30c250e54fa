//! The same schedule and front end with clients, network and clock that are computed: for more clients than a machine
//! can hold.
//!
//! What is real: the front end, which asks and completes frames, and [`protocol::schedule::Schedule`], which decides who is
//! asked what, at the master and at every relay. What is computed, from what real clients took: a client answers in order, one
//! question at a time, and takes for each tile what the real one took for it on average, and for a light set that it has not made
//! yet what the real one took for sets. Answers go one after the other through the master's link, then through its threads: one
//! of the network's, the dispatcher, the main one. Each takes as long for an answer as was measured with so many connections
//! ([`costs`]), and a core, of which the master has as many as this machine. A relay is a machine like that as well. Pixels are
//! black: nobody looks.

pub mod costs;
mod run;

use std::collections::{BTreeMap, BTreeSet};

use frame::{Chosen, View};
use protocol::question::Asked;

use super::measure::{Costs, Measured};
use super::watched::{Place, Took};
use costs::Calibrated;
use run::Simulation;
use runtime::cluster::embedded::cores;
use runtime::cluster::network_threads;
use runtime::render_loop::QUESTIONS_WAITING_MAX;

/// What clients, master and network are like.
#[derive(Clone, Debug)]
pub struct Model {
    /// Microseconds of one client for the question at each place: the mean of all frames, because a single time holds
    /// whatever else the machine did just then.
    places: BTreeMap<Place, f64>,
    /// The same at other places: pictures that have settled are cut otherwise, into as many questions.
    elsewhere: f64,
    /// Microseconds of one client for a light set.
    set: f64,
    /// What the master's threads take for an answer.
    pub master: Calibrated,
    /// Microseconds of a relay's core for an answer.
    pub relay: f64,
    /// Threads of the network, and cores, of the master and of each relay.
    pub threads: usize,
    pub cores: usize,
    /// Bytes of an answer on the wire.
    pub bytes: f64,
    /// Bytes a microsecond that the master's link takes, and each relay's.
    pub link: f64,
    /// Microseconds from the master to a client or a relay, or back, and from a relay to those behind it.
    pub delay: f64,
}

/// Who answers.
#[derive(Clone, Copy, Debug)]
pub struct Crew<'a> {
    /// Of each client, relative to the one that was measured.
    pub speeds: &'a [f64],
    /// Of each client.
    pub threads: u16,
    /// So many relays join the master, each of them is joined by so many, and so on; clients are dealt to the last in turn.
    pub relays: &'a [usize],
}

/// What some simulated clients did.
#[derive(Clone, Debug)]
pub struct Simulated {
    /// How many.
    pub clients: usize,
    /// Seconds for a frame.
    pub frame_time: f64,
    /// Mean number of light sets that a client has made for a frame that it took part in.
    pub sets_per_share: f64,
    /// Shares of time, 0..=1: the master at work, by the busiest of what it has, …
    pub master_busy: f64,
    /// … which is this, …
    pub busiest: &'static str,
    /// … the busiest relay's cores, …
    pub relays_busy: f64,
    /// … the master's link, …
    pub link_busy: f64,
    /// … clients at work on tiles, …
    pub on_tiles: f64,
    /// … and on light sets.
    pub on_sets: f64,
    /// From the first question of a frame to its end, milliseconds, median and 99th percentile.
    pub latency_ms: [f64; 2],
    /// Questions that were asked of a second client as well, of all.
    pub asked_twice: f64,
}

/// Frames before the clock starts: more than may be in flight.
const WARM_UP: u32 = 20;

impl Model {
    /// From what one client took. All its times are stretched alike, until they add up to the time that its frames took:
    /// what it spends beside them, on packing and sending, is in proportion.
    ///
    /// `growth` is in microseconds, `bandwidth` in Mbit/s, `delay` in milliseconds.
    pub fn of(one: &Measured, largest: &Measured, growth: f64, [bandwidth, delay]: [f64; 2]) -> Self {
        let mut times: BTreeMap<_, Vec<f64>> = BTreeMap::new();
        let mut sum = 0.0;
        for Took { place, micros, set_micros, .. } in &one.answers {
            times.entry(*place).or_default().push(*micros as f64);
            sum += (micros + set_micros) as f64;
        }
        let sets: BTreeSet<_> = one.answers.iter().filter_map(|took| Some((took.frame, took.place.set?))).collect();
        let set = one.answers.iter().map(|took| took.set_micros).sum::<u64>() as f64 / sets.len().max(1) as f64;
        let frames = one.answers.iter().map(|took| took.frame).max().map_or(1.0, |last| f64::from(last) + 1.0);
        let stretch = one.frame_time() * 1e6 * frames / sum.max(1.0);
        let mean = |times: Vec<f64>| stretch * times.iter().sum::<f64>() / times.len() as f64;
        let places: BTreeMap<_, _> = times.into_iter().map(|(place, times)| (place, mean(times))).collect();
        let master = Calibrated::by_one(largest.shares.len(), largest.master, growth);
        Self {
            elsewhere: mean_of(&places),
            places,
            set: set * stretch,
            relay: master.relay(),
            master,
            threads: network_threads(cores()),
            cores: cores(),
            bytes: one.bytes_per_frame / one.answers_per_frame,
            link: bandwidth / 8.0,
            delay: delay * 1e3,
        }
    }

    /// Clients that take so long for a pixel, microseconds of a thread, and for nothing else, on this machine.
    pub fn even(method: &Chosen, view: &View, micros: f64, master: Calibrated) -> Self {
        let questions = method.begin(view).ask(QUESTIONS_WAITING_MAX);
        let place = |asked: &Asked| (Place::of(&asked.question), asked.question.ask.len() as f64 * micros);
        let places: BTreeMap<_, _> = questions.iter().map(place).collect();
        let (elsewhere, relay) = (mean_of(&places), master.relay());
        let (threads, cores) = (network_threads(cores()), cores());
        let (set, bytes, link, delay) = (0.0, 1.0, 1e4, 50.0);
        Self { places, elsewhere, set, master, relay, threads, cores, bytes, link, delay }
    }

    /// The same where master and relays have so many cores each.
    pub fn with_cores(self, cores: usize) -> Self {
        Self { threads: network_threads(cores), cores, ..self }
    }

    /// What the master takes for an answer at least, with so many clients, microseconds: as long as the busiest of what it has.
    pub fn bottleneck(&self, clients: usize) -> (f64, &'static str) {
        let Costs { network, dispatcher, main, helpers } = self.master.with(clients);
        let cores = self.cores as f64;
        let all = (network + dispatcher + main + helpers) / cores;
        let parts = [
            (network / self.threads as f64, NAMES[0]),
            (dispatcher, NAMES[1]),
            (main + helpers / cores, NAMES[2]),
            (all, NAMES[3]),
        ];
        parts.into_iter().max_by(|a, b| a.0.total_cmp(&b.0)).unwrap_or(parts[0])
    }

    fn micros(&self, place: Place) -> f64 {
        self.places.get(&place).copied().unwrap_or(self.elsewhere)
    }
}

fn mean_of(places: &BTreeMap<Place, f64>) -> f64 {
    places.values().sum::<f64>() / places.len().max(1) as f64
}

/// What the master has, in the order of [`Costs`], and all of it together.
const NAMES: [&str; 4] =
    ["the threads of its network", "its dispatcher", "the thread that assembles pictures", "its cores"];

/// Draws frames with a client for each of the relative speeds.
pub fn simulate(model: &Model, method: &Chosen, view: &View, speeds: &[f64], frames: u32) -> Simulated {
    simulate_crew(model, method, view, Crew { speeds, threads: 1, relays: &[] }, [WARM_UP, frames])
}

/// The same with any clients; the clock starts after so many frames.
pub fn simulate_crew(
    model: &Model,
    method: &Chosen,
    view: &View,
    crew: Crew<'_>,
    [warm_up, frames]: [u32; 2],
) -> Simulated {
    Simulation::new(model, method, view, crew, warm_up).run(frames)
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use frame::front_end::Value;
    use frame::methods::igi::IGI;
    use protocol::answer::Fields;
    use protocol::question::{Ask, WorldState};
    use scenes::Camera;

    use super::*;

    /// 640×320 pixels: sixteen rectangles of nine light sets.
    fn view() -> View {
        View {
            world: WorldState::default(),
            scene: Arc::default(),
            camera: Camera { width: 640, height: 320, ..Camera::default() },
            fields: Fields { emitted: true, surface: true },
            seed: 0,
        }
    }

    fn igi() -> Chosen {
        Chosen::new(&IGI).with([("filter", Value::Word("off".into()))]).unwrap()
    }

    const TILES: f64 = 144.0;

    /// Ten milliseconds a tile, and so much for a light set.
    fn model(set: f64) -> Model {
        let mut front = igi().begin(&view());
        let questions = front.ask(TILES as usize);
        assert!(questions.iter().all(|asked| matches!(&asked.question.ask, Ask::Tile(tile) if tile.lit.frame == 0)));
        let places = questions.iter().map(|asked| (Place::of(&asked.question), 1e4));
        let master = Costs { network: 4.0, dispatcher: 3.0, main: 1.0, helpers: 2.0 };
        Model {
            places: places.collect(),
            elsewhere: 1e4,
            set,
            master: Calibrated::by_one(1, master, 0.0),
            relay: 10.0,
            threads: 2,
            cores: 4,
            bytes: 5_000.0,
            link: 125.0,
            delay: 200.0,
        }
    }

    #[test]
    fn one_client_takes_what_its_tiles_and_sets_take() {
        let one = simulate(&model(3e4), &igi(), &view(), &[1.0], 20);
        let expected = (TILES * 1e4 + 9.0 * 3e4) / 1e6;
        assert!((one.frame_time / expected - 1.0).abs() < 0.01, "{one:?} where {expected} s are due");
        assert!((one.on_tiles + one.on_sets - 1.0).abs() < 0.01 && one.sets_per_share > 0.0);
    }

    #[test]
    fn a_client_with_threads_is_as_good_as_so_many_clients_with_all_sets() {
        let clients = simulate(&model(0.0), &igi(), &view(), &[1.0; 8], 20);
        let threads = simulate_crew(
            &model(0.0),
            &igi(),
            &view(),
            Crew { speeds: &[1.0], threads: 8, relays: &[] },
            [WARM_UP, 20],
        );
        assert!((clients.frame_time / threads.frame_time - 1.0).abs() < 0.02, "{clients:?}, {threads:?}");
    }

    /// Frames that are asked for at once take as long as one by one; of settled ones, there is one light set instead of nine.
    #[test]
    fn frames_at_once_take_their_time() {
        let one = Crew { speeds: &[1.0], threads: 1, relays: &[] };
        let young = simulate_crew(&model(3e4), &igi(), &view(), one, [9, 27]);
        let old = simulate_crew(&model(3e4), &igi(), &view(), one, [90, 27]);
        let spared = 8.0 * 3e4 / 1e6;
        assert!(((old.frame_time + spared) / young.frame_time - 1.0).abs() < 0.02, "{old:?}, {young:?}");
    }

    #[test]
    fn a_simulation_repeats_itself() {
        let run = || format!("{:?}", simulate(&model(3e4), &igi(), &view(), &[1.0, 2.0, 3.0], 10));
        assert_eq!(run(), run());
    }

    /// The goals: 0.95 with 16 clients, 0.9 with 64, about two sets a client and frame at most; unequal clients within
    /// a twentieth of what they could do. While frames are asked for one by one: later, a question about a round of them needs
    /// all their sets, whoever answers.
    #[test]
    fn many_clients_are_used_well() {
        let model = model(3e4);
        let one = simulate(&model, &igi(), &view(), &[1.0], 20).frame_time;
        for (clients, goal) in [(16, 0.95), (64, 0.9)] {
            let many = simulate(&model, &igi(), &view(), &vec![1.0; clients], 20);
            let efficiency = one / many.frame_time / clients as f64;
            assert!(efficiency > goal && many.sets_per_share <= 2.0, "{efficiency}, {many:?}");
        }
        let uneven = simulate(&model, &igi(), &view(), &[1.0, 2.0, 4.0, 8.0], 20);
        assert!(one / uneven.frame_time > 0.95 * 15.0, "{uneven:?}");
    }

    #[test]
    fn a_slow_master_or_link_is_the_limit() {
        let clients = vec![1.0; 64];
        let by_64 = |master: Costs, growth| Calibrated::by_one(64, master, growth);
        let slow = |master: Costs, cores| Model { master: by_64(master, 0.0), cores, ..model(0.0) };
        let draw = |model: &Model, clients: &[f64]| simulate(model, &igi(), &view(), clients, 20);
        let quick = Costs { network: 1.0, dispatcher: 1.0, main: 1.0, helpers: 1.0 };
        // Milliseconds of each for an answer; two threads of the network share it, helpers are as many as cores.
        for (model, takes, what) in [
            (slow(Costs { network: 2e3, ..quick }, 4), 1e-3, NAMES[0]),
            (slow(Costs { dispatcher: 1e3, ..quick }, 4), 1e-3, NAMES[1]),
            (slow(Costs { main: 0.5e3, helpers: 2e3, ..quick }, 4), 1e-3, NAMES[2]),
            (slow(Costs { network: 1e3, dispatcher: 0.5e3, ..quick }, 1), 1.5e-3, NAMES[3]),
        ] {
            let slow = draw(&model, &clients);
            // Behind the clock, questions about whole rounds are begun.
            assert!((slow.frame_time / (TILES * takes) - 1.0).abs() < 0.06 && slow.master_busy > 0.95, "{slow:?}");
            assert_eq!((slow.busiest, model.bottleneck(64).1), (what, what));
        }
        // What grows with the clients: a millisecond at 64 of them, two and a half at 512.
        let grows = by_64(Costs { dispatcher: 1e3, ..quick }, 0.5e3);
        assert_eq!(grows.with(512).dispatcher, 2.5e3);
        let slow_link = simulate(&Model { link: 5.0, ..model(0.0) }, &igi(), &view(), &clients, 20);
        assert!((slow_link.frame_time / (TILES * 1e-3) - 1.0).abs() < 0.05 && slow_link.link_busy > 0.95);
    }

    /// Where answers wait for the master, asking for them again would only make it later.
    #[test]
    fn a_master_at_its_limit_is_not_slowed_down_by_more_clients() {
        let master = Costs { network: 1.0, dispatcher: 1e3, main: 1.0, helpers: 1.0 };
        let master = Calibrated::by_one(512, master, 0.0);
        let many = simulate(&Model { master, ..model(0.0) }, &igi(), &view(), &vec![1.0; 512], 100);
        assert!(many.frame_time < 1.15 * TILES * 1e-3, "{many:?}");
    }

    /// Two levels of relays make no worker idle; who has four connections pays for four; and a slow relay is the limit.
    #[test]
    fn relays_pass_on_what_their_clients_can_do() {
        let speeds = vec![1.0; 32];
        let direct = Crew { speeds: &speeds, threads: 2, relays: &[] };
        let relayed = Crew { relays: &[4, 2], ..direct };
        let draw = |model: &Model, crew: Crew<'_>| simulate_crew(model, &igi(), &view(), crew, [9, 54]);
        let [straight, round] = [direct, relayed].map(|crew| draw(&model(0.0), crew));
        assert!((round.frame_time / straight.frame_time - 1.0).abs() < 0.05, "{straight:?}, {round:?}");
        assert!(straight.relays_busy == 0.0 && (0.0..0.2).contains(&round.relays_busy) && round.relays_busy > 0.0);
        // A network thread of a connection takes a hundred times as long with 32 of them as with 4.
        let of = |network: f64| Costs { network, dispatcher: 1.0, main: 1.0, helpers: 1.0 };
        let mut master = Calibrated::by_one(4, of(20.0), 0.0);
        master.and(32, of(2e3));
        let crowded = Model { master, ..model(0.0) };
        let [straight, round] = [direct, relayed].map(|crew| draw(&crowded, crew));
        assert!(straight.master_busy > 0.95 && straight.busiest == NAMES[0], "{straight:?}");
        assert!(round.frame_time < 0.5 * straight.frame_time, "{round:?}, {straight:?}");
        let slow = draw(&Model { relay: 1e4, ..model(0.0) }, relayed);
        assert!(slow.relays_busy > 0.9 && slow.master_busy < 0.5, "{slow:?}");
    }
}
