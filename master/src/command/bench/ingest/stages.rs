//! What becomes of answers, stage by stage, each alone: the same answers, one after the other.

use std::sync::Arc;

use frame::{Answered, Chosen, FrontEnd, Plane, View};
use protocol::answer::{Body, Cost};
use protocol::digest::Key;
use protocol::pack;
use protocol::question::Asked;

use super::crowd::{Answers, WHOLE};
use runtime::stopwatch::StopWatch;

/// A stage and what it takes of a core for a pixel of an answer, nanoseconds.
pub(super) type Stage = (&'static str, f64);

/// Frames that are measured: one by one at the beginning, in motion, …
const FRAMES: u32 = 12;
/// … and of a picture at rest, from when its frames are asked for several at a time.
const AT_REST: std::ops::Range<u32> = 72..144;
/// Longest answer.
const LIMIT: usize = protocol::message::ANSWER_MAX;

/// Of answers at rest, and of pictures in motion.
pub(super) fn stages(answers: &Answers, method: &Chosen, view: &View) -> Vec<Stage> {
    let mut still = method.begin(view);
    still.set_limit(FRAMES);
    let mut spent = Spent::default();
    while !still.is_finished() {
        spent.take_all(answers, &mut *still, view);
    }
    let mut settled = method.begin(view);
    settled.set_limit(AT_REST.end);
    let mut rest = Spent::default();
    while !settled.is_finished() {
        if settled.frames() <= AT_REST.start {
            rest = Spent::default();
        }
        rest.take_all(answers, &mut *settled, view);
    }
    let pixels = f64::from(view.camera.width) * f64::from(view.camera.height);
    let each = |seconds: f64, frames: u32| seconds * 1e9 / (pixels * f64::from(frames));
    let watch = StopWatch::start();
    std::hint::black_box(still.show(Plane::Final));
    let filter = watch.elapsed().cpu;

    let mut moving = method.interactive(0);
    let mut shots = 0.0;
    let mut absorbed = Spent::default();
    for picture in 0..FRAMES {
        moving.look(&View { camera: super::turned(&view.camera, picture), ..view.clone() }, &[]);
        moving.begin(Some(WHOLE));
        while !moving.is_finished() {
            absorbed.take_all(answers, &mut *moving, view);
        }
        moving.end();
        let watch = StopWatch::start();
        std::hint::black_box(moving.shot(None));
        shots += watch.elapsed().cpu;
    }
    vec![
        ("LZ4", each(spent.lz4, FRAMES)),
        ("digests, where some are checked", each(spent.digests, FRAMES)),
        ("unpacking", each(spent.unpacking, FRAMES)),
        ("film", each(spent.film, FRAMES)),
        ("LZ4, at rest", each(rest.lz4, AT_REST.len() as u32)),
        ("digests, at rest", each(rest.digests, AT_REST.len() as u32)),
        ("unpacking, at rest", each(rest.unpacking, AT_REST.len() as u32)),
        ("film, at rest", each(rest.film, AT_REST.len() as u32)),
        ("filter, once a picture", each(filter, 1)),
        ("film, in motion", each(absorbed.film, FRAMES)),
        ("filter and reprojection, in motion", each(shots, FRAMES)),
    ]
}

/// Seconds of a core.
#[derive(Default)]
struct Spent {
    lz4: f64,
    digests: f64,
    unpacking: f64,
    film: f64,
}

impl Spent {
    /// Answers all that a front end asks now.
    fn take_all<F: FrontEnd + ?Sized>(&mut self, answers: &Answers, front: &mut F, view: &View) {
        let asked = front.ask(usize::MAX);
        let squeezed: Vec<(Asked, Arc<[u8]>)> =
            asked.into_iter().filter_map(|asked| answers.to(&asked.question).map(|bytes| (asked, bytes))).collect();
        let watch = StopWatch::start();
        let packed: Vec<Vec<u8>> =
            squeezed.iter().filter_map(|(_, bytes)| pack::decompress(bytes, LIMIT).ok()).collect();
        self.lz4 += watch.elapsed().cpu;
        let (key, watch) = (Key::new(7), StopWatch::start());
        packed.iter().for_each(|packed| _ = std::hint::black_box(key.digest(packed)));
        self.digests += watch.elapsed().cpu;
        let watch = StopWatch::start();
        let unpack =
            |((asked, _), packed): (&(Asked, _), &Vec<u8>)| pack::unpack(&asked.question, packed, view.fields).ok();
        let bodies: Vec<Body> = squeezed.iter().zip(&packed).filter_map(unpack).collect();
        self.unpacking += watch.elapsed().cpu;
        let watch = StopWatch::start();
        for ((asked, _), body) in squeezed.iter().zip(bodies) {
            front.absorb(Answered { ticket: asked.ticket, body, worker: 0, cost: &Cost::default() });
        }
        self.film += watch.elapsed().cpu;
    }
}
