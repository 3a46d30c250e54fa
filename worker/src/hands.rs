//! The threads that compute.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::Instant;

use protocol::answer::Cost;
use protocol::pack;
use protocol::question::Question;
use protocol::schedule::QuestionId;

use crate::craft::Craft;

/// A question for a hand, about a world.
pub(crate) struct Job<W> {
    pub(crate) id: QuestionId,
    pub(crate) question: Question,
    pub(crate) world: Arc<W>,
}

/// What a hand brings back.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Work {
    /// Output of [`pack::pack`], compressed if [`Packing`] says so.
    pub bytes: Vec<u8>,
    /// What it cost.
    pub cost: Cost,
}

/// Whether answers go over a network.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Packing {
    /// Within a process.
    Quantised,
    /// Over a network.
    Compressed,
}

/// Threads that take jobs from one queue. They end when this is dropped and the queue is empty.
pub(crate) struct Hands<W> {
    jobs: Option<Sender<Job<W>>>,
    threads: Vec<JoinHandle<()>>,
}

impl<W: Send + Sync + 'static> Hands<W> {
    /// `done` is called on the hand's thread, after the hand has let go of the world.
    pub(crate) fn start<C: Craft<World = W>>(
        craft: &Arc<C>,
        count: usize,
        packing: Packing,
        done: impl Fn(QuestionId, Result<Work, String>) + Clone + Send + 'static,
    ) -> std::io::Result<Self> {
        let (jobs, queue) = channel::<Job<W>>();
        let queue = Arc::new(Mutex::new(queue));
        let thread = |number| {
            let (craft, queue, done) = (Arc::clone(craft), Arc::clone(&queue), done.clone());
            let work = move || {
                while let Some(Job { id, question, world }) = next(&queue) {
                    let outcome = catch_unwind(AssertUnwindSafe(|| answer(&*craft, &world, &question, packing)));
                    drop(world);
                    done(id, outcome.map_err(|panic| said(&*panic)));
                }
            };
            std::thread::Builder::new().name(format!("hand {number}")).spawn(work)
        };
        let threads = (0..count).map(thread).collect::<Result<_, _>>()?;
        Ok(Self { jobs: Some(jobs), threads })
    }

    pub(crate) fn take(&self, job: Job<W>) {
        if let Some(jobs) = &self.jobs {
            // The queue lives as long as the hands.
            let _ = jobs.send(job);
        }
    }
}

impl<W> Drop for Hands<W> {
    fn drop(&mut self) {
        self.jobs = None;
        for thread in self.threads.drain(..) {
            let _ = thread.join();
        }
    }
}

fn next<W>(queue: &Mutex<Receiver<Job<W>>>) -> Option<Job<W>> {
    queue.lock().unwrap_or_else(PoisonError::into_inner).recv().ok()
}

fn answer<C: Craft>(craft: &C, world: &C::World, question: &Question, packing: Packing) -> Work {
    let start = Instant::now();
    let clock = || start.elapsed().as_micros() as u64;
    let mut answer = craft.answer(world, question, &clock);

    let before_pack = clock();
    answer.cost.dropped += pack::drop_unsound(&mut answer.body);
    let packed = pack::pack(question, &answer.body, craft.fields(world));
    let bytes = match packing {
        Packing::Quantised => packed,
        Packing::Compressed => pack::compress(&packed),
    };
    answer.cost.micros[PACK_STAGE] += clock() - before_pack;
    Work { bytes, cost: answer.cost }
}

/// Where [`Cost::micros`] counts packing.
const PACK_STAGE: usize = 5;

/// What a panic said.
pub(crate) fn said(panic: &(dyn std::any::Any + Send)) -> String {
    let text = panic.downcast_ref::<String>().map(String::as_str).or_else(|| panic.downcast_ref::<&str>().copied());
    format!("it panicked: {}", text.unwrap_or("no reason given"))
}
