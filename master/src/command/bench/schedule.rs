//! The schedule alone: what it takes to say who is asked what, for so many workers.

use std::collections::VecDeque;
use std::time::Instant;

use protocol::question::{Ask, Asked, Lit, Quality, Question, Rect, Ticket, Tile, WorldState};
use protocol::schedule::{Action, Event, HELD_PER_THREAD, Moment, QuestionId, Schedule, WorkerId};
use scenes::Camera;

/// Rectangles of a frame: 640×480 pixels have as many.
const RECTS: u32 = 20;
/// Frames in flight, as of a front end with many threads.
const FRAMES: u32 = 16;
/// What a thread takes for an answer, microseconds.
const ANSWER: u64 = 10_000;

/// Microseconds of a core for an answer: question, way and answer of so many workers that all are there and well.
pub fn micros_per_answer(workers: u16, threads: u16, answers: u32) -> f64 {
    let (world, mut schedule) = (WorldState::default(), Schedule::default());
    let (mut sent, mut open, mut frame) = (VecDeque::new(), 0_u32, 0);
    // As fast as they are together.
    let pause = (ANSWER / (u64::from(workers) * u64::from(threads))).max(1);
    let mut now = Moment(0);
    let tell = |schedule: &mut Schedule, event, now, sent: &mut VecDeque<(WorkerId, QuestionId)>| {
        for action in schedule.handle(event, now) {
            if let Action::Send { worker, id, .. } = action {
                sent.push_back((worker, id));
            }
        }
    };
    tell(&mut schedule, Event::World { state: world, edit: false }, now, &mut sent);
    for worker in (0..u64::from(workers)).map(WorkerId) {
        tell(&mut schedule, Event::Joined { worker, threads, depth: HELD_PER_THREAD, trusted: false }, now, &mut sent);
        tell(&mut schedule, Event::Ready { worker, state: world }, now, &mut sent);
    }
    let (warm_up, mut begun) = (answers / 4, Instant::now());
    for answer in 0..warm_up + answers {
        if answer == warm_up {
            begun = Instant::now();
        }
        while open < FRAMES * RECTS * u32::from(Quality::default().sets()) {
            let asked = questions(world, frame);
            (frame, open) = (frame + 1, open + asked.len() as u32);
            tell(&mut schedule, Event::Asked(asked), now, &mut sent);
        }
        now = Moment(now.0 + pause);
        let Some((worker, id)) = sent.pop_front() else { break };
        open -= u32::from(schedule.question(id).is_some());
        tell(&mut schedule, Event::Answered { worker, id, micros: ANSWER, round_trip: 300, digest: 0 }, now, &mut sent);
    }
    begun.elapsed().as_secs_f64() * 1e6 / f64::from(answers)
}

/// Microseconds more for an answer with every doubling of the workers, from so many to so many, of one thread each.
pub fn growth(from: usize, to: usize) -> f64 {
    let [from, to] = [from, to].map(|workers| u16::try_from(workers).unwrap_or(u16::MAX));
    if to <= from {
        return 0.0;
    }
    let [few, many] = [from, to].map(|workers| micros_per_answer(workers, 1, 8000));
    ((many - few) / (f64::from(to) / f64::from(from)).log2()).max(0.0)
}

fn questions(world: WorldState, frame: u32) -> Vec<Asked> {
    let quality = Quality::default();
    let tile = |slot: u32| {
        let (set, rect) = ((slot / RECTS) as u16, Rect { x: slot % RECTS * 96, y: 0, width: 96, height: 96 });
        let tile = Tile { camera: Camera::default(), rect, lit: Lit { set, frame, seed: 0, quality } };
        Asked::new(Ticket { batch: frame, slot }, Question { world, ask: Ask::Tile(tile) })
    };
    (0..RECTS * u32::from(quality.sets())).map(tile).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A thousand workers cost little more than eight: it grew four hundred times when everybody was looked at for every answer.
    #[test]
    fn an_answer_costs_about_the_same_however_many_workers_there_are() {
        let few = micros_per_answer(8, 8, 4000);
        let many = micros_per_answer(1000, 8, 4000);
        assert!(many < 12.0 * few + 10.0, "{few} µs with 8 workers, {many} µs with 1000");
    }
}
