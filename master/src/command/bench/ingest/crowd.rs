//! Workers that have all answers already: one real picture's, over and over.

use std::collections::BTreeMap;
use std::convert::Infallible;
use std::net::SocketAddr;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use anyhow::{Context, bail};
use frame::front_end::Effort;
use frame::{Answered, Chosen, FrontEnd, View};
use protocol::answer::{Answer, Body, Cost, Fields, Moments, Pixels, over_frames};
use protocol::identity::Token;
use protocol::pack;
use protocol::question::{Ask, Grid, Question};
use tokio::runtime::Runtime;

use runtime::cluster::embedded::{Canned, stand_in};
use runtime::cluster::{Cluster, ClusterOptions, Event};

/// Answers to all that a front end asks about one view, however it cuts it: out of one picture.
pub(super) struct Answers {
    fields: Fields,
    /// Row by row; columns of a row.
    picture: Pixels,
    width: usize,
    /// As they go over the network; made when they are wanted for the first time.
    squeezed: Mutex<BTreeMap<(Key, IsMean), Squeezed>>,
}

/// It is the mean of several frames.
type IsMean = bool;
type Squeezed = Arc<[u8]>;

/// Where in the picture: first column and row, steps, numbers.
type Key = [u32; 6];

fn key(grid: Grid) -> Key {
    let Grid { x, y, step_x, step_y, columns, rows } = grid;
    [x, y, step_x, step_y, columns, rows]
}

/// Pixel number `at` of some becomes number `to` of others.
fn copy(from: &Pixels, at: usize, others: &mut Pixels, to: usize) {
    others.emitted[to] = from.emitted[at];
    others.reflectance[to] = from.reflectance[at];
    others.irradiance[to] = from.irradiance[at];
    others.normal[to] = from.normal[at];
    others.distance[to] = from.distance[at];
}

/// Longest wait for an answer of this process.
const PATIENCE: Duration = Duration::from_secs(300);

impl Answers {
    /// Draws one frame at rest and one picture in motion, on so many threads of this process, and keeps what is answered.
    pub(super) fn record(
        scene: &Arc<scenes::Scene>,
        method: &Chosen,
        fields: Fields,
        threads: usize,
    ) -> anyhow::Result<Self> {
        let options = ClusterOptions { embedded: Some(threads), ..ClusterOptions::default() };
        let mut cluster = Cluster::start(options).context("workers cannot be started")?;
        let world = cluster.publish(Arc::clone(scene)).context("the scene cannot be sent to workers")?;
        let view = View { world, scene: Arc::clone(scene), fields, camera: scene.camera, seed: 0 };
        let (width, height) = (scene.camera.width as usize, scene.camera.height as usize);
        let mut answers = Self { fields, picture: Pixels::black(width * height), width, squeezed: Mutex::default() };
        let mut still = method.begin(&view);
        still.set_limit(1);
        answers.listen(&mut *still, &mut cluster)?;
        let mut moving = method.interactive(0);
        moving.look(&view, &[]);
        moving.begin(Some(WHOLE));
        answers.listen(&mut *moving, &mut cluster)?;
        Ok(answers)
    }

    fn listen<F: FrontEnd + ?Sized>(&mut self, front: &mut F, cluster: &mut Cluster) -> anyhow::Result<()> {
        while !front.is_finished() {
            let questions = front.ask(cluster.room());
            cluster.ask(questions);
            match cluster.next(PATIENCE) {
                Some(Event::Answered { asked, body, cost, worker, .. }) => {
                    let Some(tile) = asked.question.ask.tile() else {
                        bail!("--ingest knows methods that ask about tiles")
                    };
                    if let Body::Pixels(pixels) = &body {
                        self.keep(tile.grid(), pixels);
                    }
                    front.absorb(Answered { ticket: asked.ticket, body, worker, cost: &cost });
                }
                Some(Event::Unanswered { reason, .. }) => bail!("a question has no answer: {reason}"),
                Some(_) => {}
                None => bail!("there is no answer"),
            }
        }
        Ok(())
    }

    fn keep(&mut self, grid: Grid, pixels: &Pixels) {
        for (i, [x, y]) in grid.pixels().enumerate() {
            copy(pixels, i, &mut self.picture, y as usize * self.width + x as usize);
        }
    }

    fn cut(&self, grid: Grid) -> Pixels {
        let mut pixels = Pixels::black(grid.len());
        for (i, [x, y]) in grid.pixels().enumerate() {
            copy(&self.picture, y as usize * self.width + x as usize, &mut pixels, i);
        }
        pixels
    }

    /// The answer to a question as it goes over the network.
    pub(super) fn to(&self, question: &Question) -> Option<Arc<[u8]>> {
        if let Ask::Reference(samples) = &question.ask {
            // The cross-check's few paths: that they meet nothing is no reason for doubt.
            let body = Body::Moments(Moments::zero(samples.rect.len()));
            return Some(Arc::from(pack::compress(&pack::pack(question, &body, self.fields))));
        }
        let grid = question.ask.tile()?.grid();
        let key = key(grid);
        let body = || Body::Pixels(self.cut(grid));
        let mut squeezed = self.squeezed.lock().unwrap_or_else(PoisonError::into_inner);
        let pack = |body: &Body| Arc::from(pack::compress(&pack::pack(question, body, self.fields)));
        let make = || match &question.ask {
            // Frames that are all alike.
            Ask::Frames(frames) => {
                let one = |_| Ok::<_, Infallible>(Answer { body: body(), cost: Cost::default() });
                let Ok(mean) = over_frames(frames, one);
                pack(&mean.body)
            }
            _ => pack(&body()),
        };
        Some(Arc::clone(squeezed.entry((key, question.ask.frames() > 1)).or_insert_with(make)))
    }
}

/// A moving picture as large as a still one.
pub(super) const WHOLE: Effort = Effort(1.0);

/// Connections of workers that answer so. They end when the master says good-bye.
pub(super) struct Crowd {
    /// `None` only while being dropped.
    runtime: Option<Runtime>,
    kind: Kind,
    ends: Vec<tokio::task::JoinHandle<Result<(), String>>>,
}

/// What its workers are like.
#[derive(Clone)]
pub(super) struct Kind {
    pub(super) answers: Arc<Answers>,
    /// Questions that each answers at a time, …
    pub(super) threads: u16,
    /// … at so many pixels a second; `None`: answers come at once.
    pub(super) speed: Option<f64>,
    /// Whom they work for, in turn, and what they have to know for that.
    pub(super) masters: Vec<SocketAddr>,
    pub(super) token: Token,
}

/// What they are called, that their time can be told from the master's.
pub(super) const CROWD: &str = "canned";
/// Threads of the crowd: one would be its limit before a master with several.
const THREADS: usize = 2;
/// So many join at a time: a master hears out only so many strangers at once.
const AT_A_TIME: usize = 32;

impl Crowd {
    /// Nobody yet.
    pub(super) fn new(kind: Kind) -> anyhow::Result<Self> {
        let runtime = tokio::runtime::Builder::new_multi_thread()
            .worker_threads(THREADS)
            .thread_name(CROWD)
            .enable_all()
            .build()
            .context("there are no threads for workers")?;
        Ok(Self { runtime: Some(runtime), kind, ends: Vec::new() })
    }

    /// Lets more join, now that so many have, up to so many.
    pub(super) fn grow(&mut self, joined: usize, most: usize) {
        let Some(runtime) = &self.runtime else { return };
        while self.ends.len() < most.min(joined + AT_A_TIME) {
            let Kind { answers, threads, speed, masters, token } = self.kind.clone();
            let master = masters[self.ends.len() % masters.len()];
            let answer = move |question: &Question| {
                let pixels = question.ask.len() as f64 * f64::from(question.ask.frames());
                let takes = Duration::from_secs_f64(speed.map_or(0.0, |speed| pixels / speed));
                answers.to(question).map(|squeezed| Canned { squeezed, takes })
            };
            self.ends.push(runtime.spawn(stand_in(master, token, usize::from(threads), answer)));
        }
    }

    /// Why one of them is not there any more.
    pub(super) fn lost(&mut self) -> Option<String> {
        let runtime = self.runtime.as_ref()?;
        let gone = self.ends.iter_mut().find(|end| end.is_finished())?;
        match runtime.block_on(gone) {
            Ok(Ok(())) => Some("the master sent it away".into()),
            Ok(Err(reason)) => Some(reason),
            Err(panic) => Some(panic.to_string()),
        }
    }
}

impl Drop for Crowd {
    fn drop(&mut self) {
        if let Some(runtime) = self.runtime.take() {
            runtime.shutdown_background();
        }
    }
}
