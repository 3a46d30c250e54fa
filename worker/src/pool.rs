//! The threads that compute.

use std::collections::{BTreeMap, VecDeque};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::Instant;

use protocol::answer::{Cost, CostStage, over_frames};
use protocol::message::check_question;
use protocol::pack;
use protocol::question::{Ask, Question};
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
                    let is_wanted = || queue.is_wanted(id);
                    let work = || answer(&*renderer, &world, &question, packing, &is_wanted);
                    let outcome = catch_unwind(AssertUnwindSafe(work));
                    drop(world);
                    queue.put_down(id);
                    done(id, outcome.unwrap_or_else(|panic| Err(Fault::Failed(panic_text(&*panic)))));
                }
            };
            pool.threads.push(std::thread::Builder::new().name(format!("thread {number}")).spawn(work)?);
        }
        Ok(pool)
    }

    pub(crate) fn take(&self, job: Job<W>) {
        self.queue.lock().waiting.push_back(job);
        self.queue.news.notify_one();
    }

    /// Whether a job was not begun; then nobody will. Who has begun it leaves off at the next frame.
    pub(crate) fn give_back(&self, id: QuestionId) -> bool {
        let jobs = &mut *self.queue.lock();
        if let Some(is_wanted) = jobs.begun.get_mut(&id) {
            *is_wanted = false;
        }
        let place = jobs.waiting.iter().position(|job| job.id == id);
        place.is_some_and(|place| jobs.waiting.remove(place).is_some())
    }
}

impl<W> Drop for Pool<W> {
    fn drop(&mut self) {
        self.queue.lock().is_over = true;
        self.queue.news.notify_all();
        for thread in self.threads.drain(..) {
            let _ = thread.join();
        }
    }
}

/// What threads have to do.
struct Jobs<W> {
    waiting: VecDeque<Job<W>>,
    /// What threads have begun, and whether anybody waits for it.
    begun: BTreeMap<QuestionId, bool>,
    /// There will be no more.
    is_over: bool,
}

struct Queue<W> {
    jobs: Mutex<Jobs<W>>,
    news: Condvar,
}

impl<W> Queue<W> {
    fn new() -> Self {
        let jobs = Jobs { waiting: VecDeque::new(), begun: BTreeMap::new(), is_over: false };
        Self { jobs: Mutex::new(jobs), news: Condvar::new() }
    }

    fn lock(&self) -> MutexGuard<'_, Jobs<W>> {
        self.jobs.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Waits for a job; `None` when all is over.
    fn next(&self) -> Option<Job<W>> {
        let idle = |jobs: &mut Jobs<W>| jobs.waiting.is_empty() && !jobs.is_over;
        let mut jobs = self.news.wait_while(self.lock(), idle).unwrap_or_else(PoisonError::into_inner);
        let job = jobs.waiting.pop_front()?;
        jobs.begun.insert(job.id, true);
        Some(job)
    }

    fn is_wanted(&self, id: QuestionId) -> bool {
        self.lock().begun.get(&id) == Some(&true)
    }

    fn put_down(&self, id: QuestionId) {
        self.lock().begun.remove(&id);
    }
}

fn answer<C: Renderer>(
    renderer: &C,
    world: &C::World,
    question: &Question,
    packing: Packing,
    is_wanted: &dyn Fn() -> bool,
) -> Result<Work, Fault> {
    // What comes over a network has been looked at; what a front end of this process asks has not.
    check_question(question).map_err(|error| Fault::Refused(error.to_string()))?;
    renderer.check(world, question).map_err(|unfit| Fault::Refused(unfit.to_string()))?;
    let start = Instant::now();
    let clock = || start.elapsed().as_micros() as u64;
    let mut answer = match &question.ask {
        // Frame by frame, as the renderer would, so that what nobody waits for any more is left before its end.
        Ask::Frames(frames) => over_frames(frames, |tile| {
            let one = Question { world: question.world, ask: Ask::Tile(tile) };
            is_wanted().then(|| renderer.answer(world, &one, &clock)).ok_or_else(recalled)
        })?,
        _ => renderer.answer(world, question, &clock),
    };

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

/// Why what nobody waits for is not there.
fn recalled() -> Fault {
    Fault::Failed("recalled".into())
}

/// What a panic said.
pub(crate) fn panic_text(panic: &(dyn std::any::Any + Send)) -> String {
    let text = panic.downcast_ref::<String>().map(String::as_str).or_else(|| panic.downcast_ref::<&str>().copied());
    format!("it panicked: {}", text.unwrap_or("no reason given"))
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicU32, Ordering};
    use std::sync::mpsc::channel;

    use protocol::answer::{Answer, Body, Fields, Pixels};
    use protocol::question::{Frames, Lit, Quality, Rect, Tile, Unfit};
    use scenes::change::Refused;
    use scenes::{Camera, Change, Scene};

    use super::*;

    /// Says when it begins with a frame, and goes on when it is told.
    struct Slow {
        began: std::sync::mpsc::Sender<u32>,
        go_on: Mutex<std::sync::mpsc::Receiver<()>>,
        frames: Arc<AtomicU32>,
    }

    impl Renderer for Slow {
        type World = ();

        fn build(&self, _: Arc<Scene>) {}

        fn edit(&self, _: &mut (), _: &Change) -> Result<(), Refused> {
            Ok(())
        }

        fn fields(&self, _: &()) -> Fields {
            Fields { emitted: true, surface: false }
        }

        fn check(&self, _: &(), _: &Question) -> Result<(), Unfit> {
            Ok(())
        }

        fn answer(&self, _: &(), question: &Question, _: &dyn Fn() -> u64) -> Answer {
            let Ask::Tile(tile) = &question.ask else { panic!("frame by frame") };
            self.frames.fetch_add(1, Ordering::Relaxed);
            self.began.send(tile.lit.frame).unwrap();
            self.go_on.lock().unwrap().recv().unwrap();
            Answer { body: Body::Pixels(Pixels::black(tile.grid().len())), cost: Cost::default() }
        }
    }

    #[test]
    fn what_nobody_waits_for_is_left_at_the_next_frame() {
        let ((began, news), (go_on, signs), (done, outcomes)) = (channel(), channel(), channel());
        let frames = Arc::new(AtomicU32::new(0));
        let renderer = Slow { began, go_on: Mutex::new(signs), frames: Arc::clone(&frames) };
        let done = move |id, outcome| done.send((id, outcome)).unwrap();
        let pool = Pool::start(&Arc::new(renderer), 1, Packing::Quantised, done).unwrap();
        let lit = Lit { set: 0, frame: 9, seed: 0, quality: Quality::default() };
        let tile = Tile { camera: Camera::default(), rect: Rect { x: 0, y: 0, width: 9, height: 9 }, lit };
        let question = Arc::new(Question { world: Default::default(), ask: Ask::Frames(Frames { tile, count: 9 }) });
        let job = |id| Job { id: QuestionId(id), question: Arc::clone(&question), world: Arc::new(()) };
        pool.take(job(1));
        assert_eq!(news.recv().unwrap(), 9);
        go_on.send(()).unwrap();
        assert_eq!(news.recv().unwrap(), 10);
        assert!(!pool.give_back(QuestionId(1)), "it was begun");
        go_on.send(()).unwrap();
        assert_eq!(outcomes.recv().unwrap(), (QuestionId(1), Err(recalled())));
        assert_eq!(frames.load(Ordering::Relaxed), 2, "of nine");
        // What is wanted is done to its end.
        pool.take(job(2));
        (0..9).for_each(|_| go_on.send(()).unwrap());
        assert!(matches!(outcomes.recv().unwrap(), (QuestionId(2), Ok(_))));
    }
}
