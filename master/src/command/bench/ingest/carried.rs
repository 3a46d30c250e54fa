//! What was measured, carried on to more workers than a machine holds: the simulation of `scale`, with these costs.

use std::sync::Arc;

use frame::View;
use protocol::answer::Fields;
use scenes::Scene;
use serde_json::json;

use super::{FIRST, Phase, RELAYS, SETTLED};
use crate::cli::BenchArgs;
use crate::command::scale::measure::Costs;
use crate::command::scale::simulate::costs::Calibrated;
use crate::command::scale::simulate::{Crew, Model, Simulated, simulate_crew};
use runtime::cluster::embedded::cores;
use runtime::console::print_line;
use runtime::interrupt::Interrupt;

/// Pictures that begin again and again, and one that is at rest.
const KINDS: [&str; 2] = ["first frames", "at rest"];
/// Frames before the clock starts, and frames that are timed, of each: of one at rest, several times as many as may be in flight.
const FRAMES: [[u32; 2]; 2] = [[0, FIRST], [2 * SETTLED, 8 * SETTLED]];
/// Numbers of workers, and relays that they come through, level by level.
const CREWS: [(usize, &[usize]); 7] =
    [(1, &[]), (4, &[]), (16, &[]), (64, &[]), (256, &[]), (256, &[4, 4]), (1000, &[8, 8])];
/// Cores of masters that are not this machine.
const MORE_CORES: usize = 16;
/// What is busier than this is the limit.
const BUSY: f64 = 0.9;

/// Of the master's network, and each relay's, bytes a microsecond: 10 Gbit/s.
const LINK: f64 = 1250.0;

/// What answers cost, of each kind, by the number of connections, and their bytes.
#[derive(Default)]
pub(super) struct Measured([Calibrated; 2], [f64; 2]);

impl Measured {
    /// Takes in what was measured with so many workers.
    pub(super) fn add(&mut self, phases: &[Phase], workers: u16, relays: u16) {
        let connections = usize::from(if relays > 0 { relays } else { workers });
        for ((calibrated, bytes), phase) in self.0.iter_mut().zip(&mut self.1).zip(phases) {
            *bytes = phase.bytes as f64 / phase.answers.max(1) as f64;
            calibrated.and(connections, costs(phase));
            if relays > 0 {
                let relay = phase.of(RELAYS).all() * 1e6 / phase.answers.max(1) as f64;
                *calibrated = std::mem::take(calibrated).with_relay(relay);
            }
        }
    }

    /// What the simulation makes of so many workers of that speed, pixels a second of a thread: pictures a second of each kind.
    pub(super) fn simulated(&self, view: &View, speed: f64, workers: u16, args: &BenchArgs) -> [f64; 2] {
        let relays = usize::from(args.relays);
        let through = [relays];
        let crew = (usize::from(workers), if relays > 0 { &through[..] } else { &[] });
        // Here the link is this machine's memory.
        [0, 1].map(|kind| 1.0 / self.draw(kind, view, speed, crew, (cores(), LINK * 1e3), args).frame_time)
    }

    fn draw(
        &self,
        kind: usize,
        view: &View,
        speed: f64,
        (workers, relays): (usize, &[usize]),
        (cores, link): (usize, f64),
        args: &BenchArgs,
    ) -> Simulated {
        let mut model = Model::even(&args.method.0, view, 1e6 / speed, self.0[kind].clone()).with_cores(cores);
        (model.bytes, model.link) = (self.1[kind], link);
        let crew = Crew { speeds: &vec![1.0; workers], threads: args.worker_threads, relays };
        simulate_crew(&model, &args.method.0, view, crew, FRAMES[kind])
    }

    /// Carries it on, and prints what comes of it.
    pub(super) fn report(
        &self,
        scene: &Arc<Scene>,
        fields: Fields,
        speed: f64,
        args: &BenchArgs,
        interrupt: &Interrupt,
    ) {
        let view = View { world: Default::default(), scene: Arc::clone(scene), fields, camera: scene.camera, seed: 0 };
        if !args.json {
            print_line!(
                "| simulated | workers | relays | master's cores | pictures/s | Mpixel/s | efficiency | what is busiest |"
            );
            print_line!("|---|---|---|---|---|---|---|---|");
        }
        let pixels = f64::from(args.size.width) * f64::from(args.size.height);
        for (kind, cores) in [(0, cores()), (1, cores()), (0, MORE_CORES), (1, MORE_CORES)] {
            let mut one = None;
            for crew in CREWS {
                if interrupt.asked() {
                    return;
                }
                let simulated = self.draw(kind, &view, speed, crew, (cores, LINK), args);
                let (rate, (limit, share)) = (1.0 / simulated.frame_time, limit(&simulated));
                let one = *one.get_or_insert(rate);
                let efficiency = rate / one / crew.0 as f64;
                let relays: Vec<String> = crew.1.iter().map(usize::to_string).collect();
                let relays = if relays.is_empty() { "–".into() } else { relays.join("×") };
                if args.json {
                    print_line!(
                        "{}",
                        json!({ "simulated": KINDS[kind], "workers": crew.0, "relays": relays, "cores": cores,
                            "pictures_per_second": rate, "efficiency": efficiency, "busiest": limit, "busy": share })
                    );
                    continue;
                }
                print_line!(
                    "| {} | {} | {relays} | {cores} | {rate:.1} | {:.0} | {efficiency:.2} | {limit} {:.0} % |",
                    KINDS[kind],
                    crew.0,
                    rate * pixels / 1e6,
                    share * 100.0
                );
            }
        }
        if !args.json {
            print_line!("");
        }
    }
}

/// What an answer took of the master's threads.
fn costs(phase: &Phase) -> Costs {
    Costs::of(&phase.used, phase.master(), phase.answers as f64)
}

/// What is busiest, and what share of the time; workers that wait, where nothing else is busy, lack questions.
fn limit(simulated: &Simulated) -> (&'static str, f64) {
    let workers = simulated.on_tiles + simulated.on_sets;
    let all = [
        (simulated.busiest, simulated.master_busy),
        ("the relays", simulated.relays_busy),
        ("the link", simulated.link_busy),
        ("workers", workers),
    ];
    let busiest = all.into_iter().max_by(|a, b| a.1.total_cmp(&b.1)).unwrap_or(all[0]);
    if busiest.1 < BUSY { ("too few questions: workers", workers) } else { busiest }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn who_waits_with_nobody_busy_lacks_questions() {
        let simulated = Simulated {
            clients: 9,
            frame_time: 1.0,
            sets_per_share: 1.0,
            master_busy: 0.5,
            busiest: "its cores",
            relays_busy: 0.1,
            link_busy: 0.2,
            on_tiles: 0.3,
            on_sets: 0.1,
            latency_ms: [1.0; 2],
            asked_twice: 0.0,
        };
        assert_eq!(limit(&simulated), ("too few questions: workers", 0.4));
        assert_eq!(limit(&Simulated { master_busy: 0.95, ..simulated }), ("its cores", 0.95));
    }
}
