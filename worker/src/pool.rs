//! The threads that compute.

use std::collections::VecDeque;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::Instant;

use protocol::answer::{Cost, CostStage};
use protocol::message::check_question;
use protocol::pack;
use protocol::question::Question;
use protocol::schedule::QuestionId;

use crate::renderer::Renderer;

/// A question for a thread, about a world.
pub(crate) struct Job<W> {
    pub(crate) id: QuestionId,
    pub(crate) question: Arc<Question>,
    pub(crate) world: Arc<W>,
}

/// What a thread brings back.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Work {
    /// Output of [`pack::pack`], compressed if [`Packing`] says so.
    pub bytes: Vec<u8>,
    /// What it cost.
    pub cost: Cost,
}

/// Why a thread brings nothing back.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Fault {
    /// It could not.
    Failed(String),
    /// Nobody can: the world does not have what is asked about.
    Refused(String),
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
pub(crate) struct Pool<W> {
    queue: Arc<Queue<W>>,
    threads: Vec<JoinHandle<()>>,
}

impl<W: Send + Sync + 'static> Pool<W> {
    /// `done` is called on the thread, after it has let go of the world.
    pub(crate) fn start<C: Renderer<World = W>>(
        renderer: &Arc<C>,
        count: usize,
        packing: Packing,
        done: impl Fn(QuestionId, Result<Work, Fault>) + Clone + Send + 'static,
    ) -> std::io::Result<Self> {
        let mut pool = Self { queue: Arc::new(Queue::new()), threads: Vec::with_capacity(count) };
        for number in 0..count {
            let (renderer, queue, done) = (Arc::clone(renderer), Arc::clone(&pool.queue), done.clone());
            let work = move || {
                while let Some(Job { id, question, world }) = queue.next() {
                    let outcome = catch_unwind(AssertUnwindSafe(|| answer(&*renderer, &world, &question, packing)));
                    drop(world);
                    done(id, outcome.unwrap_or_else(|panic| Err(Fault::Failed(panic_text(&*panic)))));
                }
            };
            pool.threads.push(std::thread::Builder::new().name(format!("thread {number}")).spawn(work)?);
        }
        Ok(pool)
    }

    pub(crate) fn take(&self, job: Job<W>) {
        self.queue.lock().0.push_back(job);
        self.queue.news.notify_one();
    }

    /// Whether a job was not begun; then nobody will.
    pub(crate) fn give_back(&self, id: QuestionId) -> bool {
        let jobs = &mut self.queue.lock().0;
        let place = jobs.iter().position(|job| job.id == id);
        place.is_some_and(|place| jobs.remove(place).is_some())
    }
}

impl<W> Drop for Pool<W> {
    fn drop(&mut self) {
        self.queue.lock().1 = true;
        self.queue.news.notify_all();
        for thread in self.threads.drain(..) {
            let _ = thread.join();
        }
    }
}

/// Jobs not begun, and whether there will be no more.
struct Queue<W> {
    jobs: Mutex<(VecDeque<Job<W>>, bool)>,
    news: Condvar,
}

impl<W> Queue<W> {
    fn new() -> Self {
        Self { jobs: Mutex::new((VecDeque::new(), false)), news: Condvar::new() }
    }

    fn lock(&self) -> MutexGuard<'_, (VecDeque<Job<W>>, bool)> {
        self.jobs.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Waits for a job; `None` when all is over.
    fn next(&self) -> Option<Job<W>> {
        let idle = |(jobs, over): &mut (VecDeque<Job<W>>, bool)| jobs.is_empty() && !*over;
        self.news.wait_while(self.lock(), idle).unwrap_or_else(PoisonError::into_inner).0.pop_front()
    }
}

fn answer<C: Renderer>(renderer: &C, world: &C::World, question: &Question, packing: Packing) -> Result<Work, Fault> {
    // What comes over a network has been looked at; what a front end of this process asks has not.
    check_question(question).map_err(|error| Fault::Refused(error.to_string()))?;
    renderer.check(world, question).map_err(|unfit| Fault::Refused(unfit.to_string()))?;
    let start = Instant::now();
    let clock = || start.elapsed().as_micros() as u64;
    let mut answer = renderer.answer(world, question, &clock);

    let before_pack = clock();
    answer.cost.dropped += pack::drop_unsound(&mut answer.body);
    let packed = pack::pack(question, &answer.body, renderer.fields(world));
    let bytes = match packing {
        Packing::Quantised => packed,
        Packing::Compressed => pack::compress(&packed),
    };
    answer.cost.spend(CostStage::Packing, clock() - before_pack);
    Ok(Work { bytes, cost: answer.cost })
}

/// What a panic said.
pub(crate) fn panic_text(panic: &(dyn std::any::Any + Send)) -> String {
    let text = panic.downcast_ref::<String>().map(String::as_str).or_else(|| panic.downcast_ref::<&str>().copied());
    format!("it panicked: {}", text.unwrap_or("no reason given"))
}
