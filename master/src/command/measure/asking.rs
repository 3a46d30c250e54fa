//! Asks workers about the light at points, until it is known well enough.

use std::time::{Duration, Instant};

use frame::measure::Tally;
use protocol::answer::Body;
use protocol::question::{
    Address, Ask, Asked, Lit, Motion, Part, Point, Points, Quality, Question, Ticket, WorldState, points_per_question,
};
use scenes::SurfacePoint;
use scenes::photometry::photometric;
use serde_json::json;

use runtime::cluster::{Cluster, Event};
use runtime::console::Console;
use runtime::failure::Failure;
use runtime::interrupt::Interrupt;

/// Independent replicates: a round asks each of them once.
pub(super) const REPLICATES: u8 = 16;
/// What a point is taken to cost, microseconds: decides how many make a question.
pub(super) const MICROS_EACH: f64 = 10.0;
/// Longest wait before a look around.
const PATIENCE: Duration = Duration::from_millis(100);

/// What is asked, and when it is enough.
pub(super) struct Asking {
    /// Of which world.
    pub(super) world: WorldState,
    /// All randomness comes from it.
    pub(super) seed: u64,
    /// Enough when every point is known to within this share of the mean.
    pub(super) error: f64,
    /// Enough after this time.
    pub(super) seconds: Duration,
}

/// What came of it.
pub(super) struct Found {
    /// Illuminances, lx.
    pub(super) tally: Tally,
    /// How long it took.
    pub(super) seconds: f64,
}

impl Asking {
    /// Asks for a part of the irradiance, round by round. Whole rounds count, so that what is found is a function of their number.
    pub(super) fn ask(
        &self,
        points: &[SurfacePoint],
        part: &Part,
        cluster: &mut Cluster,
        interrupt: &Interrupt,
        console: &mut Console,
    ) -> Result<Found, Failure> {
        let mut tally = Tally::new(points.len(), usize::from(REPLICATES));
        let begun = Instant::now();
        let is_enough = |tally: &Tally| {
            let is_known = tally.rounds() > 0 && tally.error() <= self.error;
            is_known || interrupt.asked() || (tally.rounds() > 0 && begun.elapsed() >= self.seconds)
        };
        for round in 0.. {
            if is_enough(&tally) {
                break;
            }
            let questions = self.round(points, part, round);
            let Some(answers) = settled(questions, cluster, interrupt, console)? else { break };
            let lux = |body: Body| {
                body.irradiance().map(|rgb| rgb.into_iter().map(|rgb| f64::from(photometric(rgb))).collect())
            };
            let answers: Option<Vec<Vec<f64>>> = answers.into_iter().map(lux).collect();
            let answers =
                answers.ok_or_else(|| Failure::Incomplete("points were answered with something else".into()))?;
            let each = answers.len() / usize::from(REPLICATES);
            for (replicate, lux) in answers.chunks(each).enumerate() {
                tally.add(replicate, lux.iter().flatten().copied());
            }
            let error = tally.error();
            console.status(Instant::now(), || {
                let line =
                    format!("{} light sets: every point to within {:.2} % of the mean", tally.rounds(), 100.0 * error);
                (line, json!({ "light_sets": tally.rounds(), "error": error }))
            });
        }
        cluster.cancel_all();
        Ok(Found { tally, seconds: begun.elapsed().as_secs_f64() })
    }

    /// The questions of a round: replicate by replicate, all points.
    fn round(&self, points: &[SurfacePoint], part: &Part, round: u32) -> Vec<Asked> {
        let frames = (0..u32::from(REPLICATES)).map(|replicate| round * u32::from(REPLICATES) + replicate);
        let numbered: Vec<Numbered<'_>> = (0..).zip(points).collect();
        let chunks =
            frames.flat_map(|frame| numbered.chunks(points_per_question(MICROS_EACH)).map(move |chunk| (frame, chunk)));
        let question = |(slot, (frame, chunk)): (usize, (u32, &[Numbered<'_>]))| {
            let at =
                chunk.iter().map(|(number, point)| Point { at: **point, address: address(*number, frame) }).collect();
            let lit = Lit { set: 0, frame, seed: self.seed, quality: quality() };
            let ask = Ask::Points(Points { view: None, at, part: part.clone(), lit });
            Asked::new(Ticket { batch: round, slot: slot as u32 }, Question { world: self.world, ask })
        };
        chunks.enumerate().map(question).collect()
    }
}

/// A point by its number.
type Numbered<'a> = (u32, &'a SurfacePoint);

/// Points have the addresses of pixels of a picture so wide.
const COLUMNS: u32 = 1024;

pub(super) fn address(number: u32, frame: u32) -> Address {
    Address { pixel: [number % COLUMNS, number / COLUMNS], number: frame }
}

/// One light set for all points: what they share as an error, the tally sees. Light is chosen for no camera.
pub(super) fn quality() -> Quality {
    Quality {
        interleave: [1, 1],
        light_samples: 32,
        vpls: 96,
        importance: false,
        motion: Motion::Still,
        replicates: REPLICATES,
        ..Quality::default()
    }
}

/// The answers to all questions in order; `None` if somebody wants it to end before.
pub(super) fn settled(
    questions: Vec<Asked>,
    cluster: &mut Cluster,
    interrupt: &Interrupt,
    console: &Console,
) -> Result<Option<Vec<Body>>, Failure> {
    let mut answers: Vec<Option<Body>> = vec![None; questions.len()];
    let mut open = questions.len();
    cluster.ask(questions);
    while open > 0 {
        if interrupt.asked() {
            return Ok(None);
        }
        match cluster.next(PATIENCE) {
            Some(Event::Answered { asked, body, .. }) => {
                let before = answers[asked.ticket.slot as usize].replace(body);
                open -= usize::from(before.is_none());
            }
            Some(Event::Unanswered { asked, reason }) => {
                return Err(Failure::Incomplete(format!("{} were not measured: {reason}", asked.question.ask)));
            }
            Some(event) => console.event(&event),
            None => {}
        }
    }
    Ok(Some(answers.into_iter().flatten().collect()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_round_asks_every_replicate_about_every_point_once() {
        let asking = Asking { world: WorldState::default(), seed: 3, error: 0.01, seconds: Duration::from_secs(1) };
        let points: Vec<_> = (0..3000).map(|triangle| SurfacePoint { triangle, ..SurfacePoint::default() }).collect();
        let asked = asking.round(&points, &Part::All, 2);
        let mut told = vec![Vec::new(); usize::from(REPLICATES)];
        for (slot, asked) in asked.iter().enumerate() {
            assert_eq!(asked.ticket, Ticket { batch: 2, slot: slot as u32 });
            let Ask::Points(about) = &asked.question.ask else { panic!("a question about points") };
            let frame = about.lit.frame;
            assert_eq!(about.lit.quality.replicate_of(frame), (frame % u32::from(REPLICATES)) as u8);
            assert!(about.at.iter().all(|point| point.address.number == frame));
            told[usize::from(about.lit.quality.replicate_of(frame))]
                .extend(about.at.iter().map(|point| point.at.triangle));
        }
        assert!(told.iter().all(|told| *told == (0..3000).collect::<Vec<_>>()));
        assert_eq!(asked.len() % usize::from(REPLICATES), 0);
    }
}
