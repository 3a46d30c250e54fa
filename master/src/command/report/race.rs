//! Our own methods, run in turn: run after run, every method once, so that whatever else this machine
//! does meets all of them alike, and an interrupted report has as many runs of each.

use std::time::Instant;

use anyhow::Context;
use frame::methods::reference::SAMPLES_PER_FRAME;
use frame::metrics::Checkpoints;
use frame::{Filter, FrontEnd, Igi, Layer, Reference, ReferenceSetup, Setup};
use protocol::answer::Fields;
use protocol::question::{Quality, WorldState};
use scenes::Needs;

use super::progress::Progress;
use super::record::{Description, Look, Record, Run, Slope, View};
use super::settings::Measurement;
use super::subject::Subject;
use crate::cli::{Knobs, MethodArg, VariantArg, flags_for};
use crate::cluster::{Cluster, ClusterOptions};
use crate::console::Console;
use crate::failure::Failure;
use crate::interrupt::Interrupt;
use crate::render_loop::{Watched, run, run_watched};
use crate::stats::Stop;
use crate::stopwatch::StopWatch;

/// One of our methods.
pub struct Method {
    name: String,
    way: Way,
}

/// How a method makes its pictures.
enum Way {
    /// Virtual lights, as set.
    Igi { quality: Quality, filter: Filter },
    /// The reference path tracer.
    Reference,
}

/// All of ours that were asked for.
pub fn methods(named: &[MethodArg], variants: &[VariantArg]) -> Vec<Method> {
    let igi = |name: &str, knobs: &Knobs| {
        let way = Way::Igi { quality: knobs.quality(), filter: knobs.filter() };
        Method { name: name.to_string(), way }
    };
    let preset = |name: &str, flags: &str| igi(name, &Knobs::from_text(flags).unwrap_or_default());
    let of_name = |method: &MethodArg| match method {
        MethodArg::Igi => Some(preset("igi", "--preset default")),
        MethodArg::IgiPaper => Some(preset("igi-paper", "--preset paper")),
        MethodArg::Reference => Some(Method { name: "reference".to_string(), way: Way::Reference }),
        MethodArg::None => None,
    };
    let variants = variants.iter().map(|variant| igi(&variant.name, &variant.knobs));
    named.iter().filter_map(of_name).chain(variants).collect()
}

impl Method {
    /// For plots and tables.
    pub fn name(&self) -> &str {
        &self.name
    }

    fn describe(&self) -> Description {
        let (settings, filtered) = match &self.way {
            Way::Igi { quality, filter } => (flags_for(quality, filter).join(" "), filter.edges.is_some()),
            Way::Reference => ("igi-master reference, no limit to bounces".to_string(), false),
        };
        Description {
            name: self.name.clone(),
            settings,
            views: if filtered { vec![View::Shown, View::Raw] } else { vec![View::Raw] },
            expected: self.expected(),
            is_rival: matches!(self.way, Way::Reference),
        }
    }

    /// Independent samples: −1. What is cut off for ever, or blurred for ever, is a floor: 0.
    fn expected(&self) -> Slope {
        match &self.way {
            Way::Igi { quality: q, .. } if q.max_length.is_some() || !q.bias_compensation || !q.shrink_radius => 0.0,
            Way::Igi { .. } | Way::Reference => -1.0,
        }
    }

    /// Samples a pixel that a frame adds.
    fn samples_per_frame(&self) -> u64 {
        match &self.way {
            Way::Igi { .. } => 1,
            Way::Reference => SAMPLES_PER_FRAME.into(),
        }
    }

    fn front(&self, subject: &Subject, world: WorldState, seed: u64) -> Box<dyn FrontEnd> {
        let camera = subject.scene.camera;
        match self.way {
            Way::Igi { quality, filter } => {
                let fields = Fields::of(&Needs::of(&subject.scene));
                Box::new(Igi::new(Setup { world, camera, quality, fields, seed, filter }))
            }
            Way::Reference => Box::new(Reference::new(ReferenceSetup { world, camera, seed, max_bounces: None })),
        }
    }
}

/// Runs all methods on a scene.
///
/// # Errors
/// If there can be no workers. An interrupted race is no error: the records are as long as it was.
pub fn race(
    subject: &Subject,
    methods: &[Method],
    measurement: &Measurement,
    interrupt: &Interrupt,
    progress: &mut Progress,
) -> Result<Vec<Record>, Failure> {
    let mut records: Vec<Record> = methods.iter().map(|method| Record::new(method.describe())).collect();
    if methods.is_empty() {
        return Ok(records);
    }
    let options = ClusterOptions { embedded: Some(measurement.clock.threads), ..ClusterOptions::default() };
    let began = Instant::now();
    let mut cluster = Cluster::start(options).context("workers cannot be started")?;
    let world = cluster.publish(subject.scene.clone()).context("the scene cannot be sent to workers")?;
    let mut track = Track { subject, world, cluster: &mut cluster, measurement, interrupt };
    // The first frame waits until the trees are built; it is nobody's run.
    track.warm_up(&methods[0]);
    let preparation = began.elapsed().as_secs_f64();
    records.iter_mut().for_each(|record| record.preparation = preparation);
    for number in 0..measurement.runs {
        for (method, record) in methods.iter().zip(&mut records) {
            if interrupt.asked() {
                return Ok(records);
            }
            let (run, trouble) = track.run(method, measurement.seed.wrapping_add(u64::from(number)), progress);
            record.runs.push(run);
            record.trouble = trouble.or(record.trouble.take());
        }
    }
    Ok(records)
}

/// Where runs take place.
struct Track<'a> {
    subject: &'a Subject,
    world: WorldState,
    cluster: &'a mut Cluster,
    measurement: &'a Measurement,
    interrupt: &'a Interrupt,
}

impl Track<'_> {
    fn warm_up(&mut self, method: &Method) {
        let mut front = method.front(self.subject, self.world, !self.measurement.seed);
        let stop = Stop { frames: Some(1), ..Stop::default() };
        run(front.as_mut(), self.cluster, &stop, self.interrupt, &mut silence());
    }

    /// What is shown is drawn on the clock, comparing comes later.
    fn run(&mut self, method: &Method, seed: u64, progress: &mut Progress) -> (Run, Option<String>) {
        let mut front = method.front(self.subject, self.world, seed);
        let views = method.describe().views;
        let mut run = Run::new(self.measurement.marks.len());
        let mut checkpoints = Checkpoints::new(&self.measurement.marks);
        let (clock, enough) = (self.measurement.clock, self.measurement.seconds);
        let watch = StopWatch::start();
        let stats = run_watched(
            front.as_mut(),
            self.cluster,
            &Stop::default(),
            self.interrupt,
            &mut silence(),
            &mut |front, stats| {
                let elapsed = watch.elapsed();
                let seconds = clock.seconds(elapsed);
                let passed = checkpoints.pass(u64::from(stats.frames), seconds);
                if passed.power || !passed.marks.is_empty() {
                    let pictures = views.iter().map(|view| front.show(layer(*view))).collect();
                    let samples = u64::from(stats.frames) * method.samples_per_frame();
                    let (cost, bytes) = (stats.cost, stats.answer_bytes);
                    run.keep(&passed, Look { samples, elapsed, cost, bytes, pictures });
                }
                progress.running(&method.name, (seconds / enough).min(1.0));
                if seconds >= enough { Watched::Enough } else { Watched::GoOn }
            },
        );
        progress.reached(progress.done() + 1);
        let trouble = stats.gaps.first().map(|gap| format!("{} was set aside: {}", gap.what, gap.reason));
        (run, trouble)
    }
}

fn layer(view: View) -> Layer {
    match view {
        View::Shown => Layer::Final,
        View::Raw => Layer::Raw,
    }
}

/// Progress is the report's business, not each run's.
fn silence() -> Console {
    Console::silent()
}
