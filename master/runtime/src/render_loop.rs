//! The whole program in one loop: what the front end asks goes to the workers, what they answer goes to
//! the front end, until it is enough.

use std::time::{Duration, Instant};

use frame::front_end::GivenUp;
use frame::{Absorbed, Answered, FrontEnd};

use crate::cluster::{Cluster, Event, Status};
use crate::console::{Console, Progress};
use crate::interrupt::Interrupt;
use crate::stats::{Ending, Gap, RenderStats, Stop};

/// Draws until it is enough.
pub fn run<F: FrontEnd + ?Sized>(
    front: &mut F,
    cluster: &mut Cluster,
    stop: &Stop,
    interrupt: &Interrupt,
    console: &mut Console,
) -> RenderStats {
    run_watched(front, cluster, stop, interrupt, console, &mut |_, _| Watched::GoOn)
}

/// What somebody who watches thinks of it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Watched {
    /// More frames, please.
    GoOn,
    /// No frame after the one in progress.
    Enough,
}

/// As [`run`], and shows whoever watches every frame as it is completed (or several, where several
/// are completed at once), and that the picture begins again, without any frame, when a worker was found to compute wrongly. Top to bottom: ask, listen, look around.
pub fn run_watched<F: FrontEnd + ?Sized>(
    front: &mut F,
    cluster: &mut Cluster,
    stop: &Stop,
    interrupt: &Interrupt,
    console: &mut Console,
    watch: &mut dyn FnMut(&mut F, &RenderStats) -> Watched,
) -> RenderStats {
    let mut stats = RenderStats::default();
    let mut clock = Clock::new();
    let mut status = cluster.status();
    let mut looked = Instant::now();
    let mut outstanding = 0_usize;
    // What counts towards the time that there is, from before.
    let mut spent = stop.spent;
    // No frame is begun any more.
    let mut is_over = false;
    let mut checks = Checks::new(cluster);
    if let Some(frames) = stop.frames {
        front.set_limit(frames);
    }
    // What another process has drawn before is no work of ours.
    stats.frames = front.frames();
    (stats.resumed, stats.spent) = (stats.frames, spent);
    for rect in front.gaps() {
        let gap = Gap { what: rect.to_string(), reason: "workers died of it before".into() };
        console.gap(&gap);
        stats.gaps.push(gap);
    }

    while !front.is_finished() || !checks.are_finished(cluster, Instant::now()) {
        // Ask: as much as the front end wants, as long as the queue is short.
        let questions = front.ask(QUESTIONS_WAITING_MAX.saturating_sub(outstanding));
        if !questions.is_empty() {
            outstanding += questions.len();
            cluster.ask(questions);
        }

        // Listen.
        match cluster.next(PATIENCE) {
            Some(Event::Answered { asked, body, cost, worker, bytes, .. }) => {
                outstanding = outstanding.saturating_sub(1);
                stats.cost += cost;
                stats.answer_bytes += bytes;
                stats.pixels += body.len() as u64;
                match front.absorb(Answered { ticket: asked.ticket, body, worker, cost: &cost }) {
                    Absorbed::Kept | Absorbed::Completed { .. } | Absorbed::Marked => stats.answers += 1,
                    Absorbed::Unwanted => stats.unused += 1,
                }
            }
            Some(Event::Unanswered { asked, reason }) => {
                outstanding = outstanding.saturating_sub(1);
                if front.give_up(asked.ticket) != GivenUp::Unwanted {
                    let gap = Gap { what: asked.question.ask.to_string(), reason };
                    console.gap(&gap);
                    stats.gaps.push(gap);
                }
            }
            Some(Event::Checked) => checks.finish(),
            Some(event @ Event::WorkerExposed { gave: true, .. }) => {
                console.event(&event);
                cluster.cancel_all();
                front.begin_again();
                stop.frames.iter().for_each(|frames| front.set_limit(*frames));
                // Time counts from now on: what was drawn before is not in the picture.
                (outstanding, is_over, spent) = (0, false, Duration::ZERO);
                (checks, clock) = (Checks::new(cluster), clock.again(Instant::now()));
                stats.begin_again();
                watch(front, &stats);
            }
            Some(event) => {
                if matches!(event, Event::WorkerReady { .. }) {
                    // A worker may be ready and gone again between two looks.
                    clock.begin(Instant::now());
                }
                console.event(&event);
            }
            None => {}
        }

        // Look around: is it enough?
        let now = Instant::now();
        if now >= looked + BETWEEN_LOOKS {
            looked = now;
            status = cluster.status();
            clock.look(&status, now);
            front.set_parallelism(status.parallelism());
            console.workers(&status);
        }
        let grown = front.frames().saturating_sub(stats.frames);
        cluster.pulse().drawn(grown, now);
        stats.frames = front.frames();
        stats.elapsed = clock.elapsed(now);
        is_over |= grown > 0 && watch(front, &stats) == Watched::Enough;
        if clock.alone_for(now) >= stop.without_workers.unwrap_or(Duration::MAX) {
            stats.ending = Ending::NoWorkers;
            break;
        }
        if interrupt.asked() {
            stats.ending = Ending::Interrupted;
            is_over = true;
        }
        let has_begun = clock.ready.is_some() || stats.frames > 0;
        is_over |= has_begun && stop.after.is_some_and(|after| stats.elapsed + spent >= after);
        if clock.estimate_is_due(now, stats.frames) {
            stats.error = front.error();
            is_over |= stats.error.zip(stop.error).is_some_and(|(estimate, enough)| estimate.high <= enough);
        }
        if is_over {
            front.finish();
            if !front.is_finished() && is_deserted(&status, stats.frames) {
                console.line("no worker is left to complete the frame in progress: it is left out");
                if stats.frames == 0 && stats.ending == Ending::Enough {
                    stats.ending = Ending::Deserted;
                }
                break;
            }
        }
        console.progress(&Progress { stats: &stats, stop, status: &status, frame: front.frame_progress() }, now);
    }

    cluster.cancel_all();
    stats.frames = front.frames();
    stats.elapsed = clock.elapsed(Instant::now());
    stats.preparation = clock.preparation();
    stats.error = front.error();
    stats
}

/// What is being checked when all is drawn: the picture waits for it, as it would begin again if something were wrong.
struct Checks {
    /// Since when that is waited for.
    since: Option<Instant>,
    is_finished: bool,
}

impl Checks {
    fn new(cluster: &Cluster) -> Self {
        Self { since: None, is_finished: !cluster.has_checks() }
    }

    /// Nothing is being checked any more.
    fn finish(&mut self) {
        self.is_finished |= self.since.is_some();
    }

    /// To be asked when all is drawn.
    fn are_finished(&mut self, cluster: &Cluster, now: Instant) -> bool {
        if self.since.is_none() && !self.is_finished {
            cluster.finish_checks();
            self.since = Some(now);
        }
        self.is_finished || self.since.is_some_and(|since| now >= since + CHECKS_PATIENCE)
    }
}

/// Nobody is there to complete the frame in progress. For a first frame, whoever still fetches the scene is waited for.
fn is_deserted(status: &Status, frames: u32) -> bool {
    if frames > 0 { status.ready == 0 } else { status.workers == 0 }
}

/// Questions that may wait for workers: enough for some hundreds of them.
pub const QUESTIONS_WAITING_MAX: usize = 4096;
/// Longest time without a look around.
const PATIENCE: Duration = Duration::from_millis(50);
/// Longest wait for what is being checked when all is drawn: as long as a silent worker is taken for connected.
const CHECKS_PATIENCE: Duration = Duration::from_secs(10);
/// How things stand with the workers is asked this often.
const BETWEEN_LOOKS: Duration = Duration::from_millis(20);
/// The estimate looks at every pixel, so not too often.
const BETWEEN_ESTIMATES: Duration = Duration::from_millis(500);

/// Who watches the time.
struct Clock {
    started: Instant,
    /// When the first worker was ready.
    ready: Option<Instant>,
    /// Since when there is none at all.
    alone_since: Option<Instant>,
    /// Last estimate: when, and of which frame.
    estimated: Option<(Instant, u32)>,
}

impl Clock {
    fn new() -> Self {
        let started = Instant::now();
        Self { started, ready: None, alone_since: Some(started), estimated: None }
    }

    /// The same from now on, where somebody was ready before.
    fn again(self, now: Instant) -> Self {
        Self { ready: self.ready.map(|_| now), estimated: None, ..self }
    }

    /// A worker is ready; from the first on, time counts.
    fn begin(&mut self, now: Instant) {
        self.ready.get_or_insert(now);
    }

    fn look(&mut self, status: &Status, now: Instant) {
        if status.ready > 0 {
            self.begin(now);
        }
        match status.workers {
            0 => _ = self.alone_since.get_or_insert(now),
            _ => self.alone_since = None,
        }
    }

    fn preparation(&self) -> Duration {
        self.ready.map_or(Duration::ZERO, |ready| ready - self.started)
    }

    fn elapsed(&self, now: Instant) -> Duration {
        self.ready.map_or(Duration::ZERO, |ready| now.saturating_duration_since(ready))
    }

    fn alone_for(&self, now: Instant) -> Duration {
        self.alone_since.map_or(Duration::ZERO, |since| now - since)
    }

    /// A new frame is there, and the last estimate is a while ago.
    fn estimate_is_due(&mut self, now: Instant, frames: u32) -> bool {
        let due = self.estimated.is_none_or(|(when, of)| frames > of && now - when >= BETWEEN_ESTIMATES);
        if due {
            self.estimated = Some((now, frames));
        }
        due
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use frame::{Chosen, Plane, View};
    use protocol::answer::{Body, Fields, Means, Moments, Pixels};
    use protocol::pack;
    use protocol::question::{Ask, Question};
    use scenes::{Camera, Light, Material, Mesh, Object, Scene};

    use super::*;
    use crate::cluster::ClusterOptions;
    use crate::cluster::embedded::{Canned, stand_in};

    /// A lit triangle before the camera.
    fn scene() -> Arc<Scene> {
        use glam::Vec3;
        let mesh = Mesh {
            positions: vec![Vec3::new(-2.0, -2.0, 0.0), Vec3::new(2.0, -2.0, 0.0), Vec3::new(0.0, 3.0, 0.0)],
            triangles: vec![[0, 1, 2]],
            materials: vec![0],
            ..Mesh::default()
        };
        Arc::new(Scene {
            meshes: vec![mesh.into()],
            objects: vec![Object::fixed("triangle", 0)],
            materials: vec![Material::diffuse("grey", Vec3::splat(0.5))],
            lights: vec![Light::Point { position: Vec3::new(1.0, 1.0, 2.0), intensity: Vec3::splat(9.0) }],
            camera: Camera { origin: Vec3::new(0.0, 0.0, 4.0), width: 48, height: 32, ..Camera::default() },
            ..Scene::default()
        })
    }

    /// Of this fit, nothing is there.
    fn black(question: &Question, fields: Fields) -> Option<Canned> {
        let len = question.ask.len();
        let body = match &question.ask {
            Ask::Tile(_) => Body::Pixels(Pixels::black(len)),
            Ask::Frames(_) => Body::Means(Means::black(len)),
            Ask::Reference(_) => Body::Moments(Moments::zero(len)),
            _ => return None,
        };
        let squeezed = pack::compress(&pack::pack(question, &body, fields)).into();
        Some(Canned { squeezed, takes: Duration::from_millis(1) })
    }

    fn draw(cluster: &mut Cluster, frames: u32, watch: &mut dyn FnMut(u32, u32)) -> ([u8; 32], RenderStats) {
        let (world, scene) = (cluster.state().unwrap(), cluster.shared_scene().unwrap());
        let (camera, fields) = (scene.camera, cluster.fields().unwrap());
        let mut front = Chosen::new(crate::methods::all()[0]).begin(&View { world, scene, fields, camera, seed: 0 });
        let stop = Stop { frames: Some(frames), ..Stop::default() };
        let mut look = |front: &mut (dyn FrontEnd + 'static), stats: &RenderStats| {
            watch(front.frames(), stats.begun_again);
            Watched::GoOn
        };
        let (interrupt, mut console) = (Interrupt::default(), Console::silent());
        let stats = run_watched(&mut *front, cluster, &stop, &interrupt, &mut console, &mut look);
        (front.show(Plane::Raw).sha256(), stats)
    }

    /// A worker over the network answers black to everything, from the first question on: what was made of it is drawn again,
    /// whoever watches hears of it, and the picture has the right bits.
    #[test]
    fn a_picture_of_wrong_answers_begins_again_and_ends_right() {
        const FRAMES: u32 = 12;
        let embedded = ClusterOptions { embedded: Some(1), ..ClusterOptions::default() };
        let mut alone = Cluster::start(embedded.clone()).unwrap();
        alone.publish(scene()).unwrap();
        let (truth, _) = draw(&mut alone, FRAMES, &mut |_, _| {});

        let listen = Some("127.0.0.1:0".parse().unwrap());
        let mut cluster = Cluster::start(ClusterOptions { listen, check_share: 1.0, ..embedded }).unwrap();
        cluster.publish(scene()).unwrap();
        let runtime = tokio::runtime::Builder::new_multi_thread().worker_threads(1).enable_all().build().unwrap();
        let (address, token, fields) =
            (cluster.address().unwrap(), cluster.token().unwrap(), cluster.fields().unwrap());
        runtime.spawn(stand_in(address, token, 4, move |question: &Question| black(question, fields)));
        // Before anybody answers: it is no newcomer that could be examined.
        while cluster.status().ready < 2 {
            cluster.next(Duration::from_millis(20));
        }
        let mut last = (0, 0);
        let mut has_begun_again = false;
        let (drawn, stats) = draw(&mut cluster, FRAMES, &mut |frames, begun_again| {
            has_begun_again |= begun_again == 1 && last.1 == 0 && frames == 0;
            last = (frames, begun_again);
        });
        assert_eq!((stats.begun_again, last), (1, (FRAMES, 1)));
        assert!(has_begun_again && stats.frames == FRAMES);
        assert_eq!(drawn, truth);
    }
}
