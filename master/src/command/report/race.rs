//! Our own methods, run in turn: run after run, every method once, so that whatever else this machine
//! does meets all of them alike, and an interrupted report has as many runs of each.

use std::sync::Arc;
use std::time::Instant;

use anyhow::Context;
use frame::metrics::Checkpoints;
use frame::parts::Undenoised;
use frame::{Chosen, FrontEnd, Plane};
use protocol::answer::Fields;
use protocol::question::WorldState;
use scenes::{Needs, Scene};

use super::finish::{DENOISED, Finish};
use super::progress::Progress;
use super::record::{Description, Look, Record, Run, View};
use super::settings::Measurement;
use super::subject::Subject;
use crate::cli::{NamedArg, VariantArg};
use runtime::cluster::{Cluster, ClusterOptions};
use runtime::console::Console;
use runtime::failure::Failure;
use runtime::interrupt::Interrupt;
use runtime::render_loop::{Watched, run, run_watched};
use runtime::stats::Stop;
use runtime::stopwatch::StopWatch;

/// One of our methods.
pub struct Method {
    name: String,
    chosen: Chosen,
    is_denoised: bool,
}

/// All of ours that were asked for.
pub fn methods(named: &[NamedArg], variants: &[VariantArg]) -> Vec<Method> {
    let new = |name: String, chosen| Method { is_denoised: name.ends_with(DENOISED), name, chosen };
    let of_name = |NamedArg(named): &NamedArg| named.clone().map(|(name, chosen)| new(name, chosen));
    let variants = variants.iter().map(|variant| new(variant.name.clone(), variant.method.clone()));
    named.iter().filter_map(of_name).chain(variants).collect()
}

impl Method {
    /// For plots and tables.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Its pictures are denoised.
    pub fn is_denoised(&self) -> bool {
        self.is_denoised
    }

    fn describe(&self, scene: &Scene) -> Description {
        let Chosen { method, settings } = &self.chosen;
        let views = match (self.is_denoised, method.is_filtered(settings)) {
            (true, _) => vec![View::Shown],
            (false, true) => vec![View::Shown, View::Raw],
            (false, false) => vec![View::Raw],
        };
        Description {
            name: self.name.clone(),
            settings: self.chosen.flags().join(" "),
            views,
            expected: method.expected_slope(settings),
            // Who lacks light is no measure for others.
            is_rival: method.is_reference() && method.misses(scene).is_none(),
        }
    }

    fn front(&self, subject: &Subject, world: WorldState, seed: u64) -> Box<dyn FrontEnd> {
        let (camera, fields) = (subject.scene.camera, Fields::of(&Needs::of(&subject.scene)));
        self.chosen.begin(&frame::View { world, scene: Arc::clone(&subject.scene), fields, camera, seed })
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
    finish: Option<&Finish>,
    interrupt: &Interrupt,
    progress: &mut Progress,
) -> Result<Vec<Record>, Failure> {
    let mut records: Vec<Record> = methods
        .iter()
        .map(|method| {
            let missing = method.chosen.method.misses(&subject.scene);
            let trouble = missing.map(|missing| format!("not compared with others: its pictures lack {missing}"));
            let mut description = method.describe(&subject.scene);
            if let Some(finish) = finish.filter(|_| method.is_denoised) {
                description.settings += &finish.said();
            }
            Record { trouble, ..Record::new(description) }
        })
        .collect();
    if methods.is_empty() {
        return Ok(records);
    }
    let options = ClusterOptions { embedded: Some(measurement.clock.threads), ..ClusterOptions::default() };
    let began = Instant::now();
    let mut cluster = Cluster::start(options).context("workers cannot be started")?;
    let world = cluster.publish(subject.scene.clone()).context("the scene cannot be sent to workers")?;
    let size = [subject.reference.width, subject.reference.height];
    let shortened = finish.map(|finish| finish.shortened(measurement, size)).transpose()?;
    let mut track = Track { subject, world, cluster: &mut cluster, interrupt };
    // The first frame waits until the trees are built; it is nobody's run.
    track.warm_up(&methods[0]);
    let preparation = began.elapsed().as_secs_f64();
    records.iter_mut().for_each(|record| record.preparation = preparation);
    for number in 0..measurement.runs {
        for (method, record) in methods.iter().zip(&mut records) {
            if interrupt.asked() {
                return Ok(records);
            }
            let finish = finish.zip(shortened.as_ref()).filter(|_| method.is_denoised);
            let seed = measurement.seed.wrapping_add(u64::from(number));
            let (mut run, trouble) = track.run(method, finish.map_or(measurement, |(_, short)| short), seed, progress);
            finish.map_or(Ok(()), |(finish, _)| finish.finish(&mut run))?;
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
    interrupt: &'a Interrupt,
}

impl Track<'_> {
    fn warm_up(&mut self, method: &Method) {
        let mut front = method.front(self.subject, self.world, u64::MAX);
        let stop = Stop { frames: Some(1), ..Stop::default() };
        run(front.as_mut(), self.cluster, &stop, self.interrupt, &mut silence());
    }

    /// What is shown is drawn on the clock, comparing comes later.
    fn run(
        &mut self,
        method: &Method,
        measurement: &Measurement,
        seed: u64,
        progress: &mut Progress,
    ) -> (Run, Option<String>) {
        let mut front = method.front(self.subject, self.world, seed);
        let views = method.describe(&self.subject.scene).views;
        let mut run = Run::new(measurement.marks.len());
        let mut checkpoints = Checkpoints::new(&measurement.marks);
        let (clock, enough) = (measurement.clock, measurement.seconds);
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
                    let undenoised = method.is_denoised.then(|| Undenoised::of(front));
                    let views = if method.is_denoised { &[][..] } else { &views };
                    let pictures = views.iter().map(|view| front.show(plane(*view))).collect();
                    let samples = u64::from(stats.frames) * u64::from(method.chosen.method.samples_per_frame());
                    let (cost, bytes) = (stats.cost, stats.answer_bytes);
                    run.keep(&passed, Look { samples, elapsed, cost, bytes, pictures, undenoised });
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

fn plane(view: View) -> Plane {
    match view {
        View::Shown => Plane::Final,
        View::Raw => Plane::Raw,
    }
}

/// Progress is the report's business, not each run's.
fn silence() -> Console {
    Console::silent()
}
