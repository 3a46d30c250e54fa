//! Vertices as questions: points that one light set after the other lights, sorted so that neighbours make slim shafts.

use std::collections::BTreeMap;
use std::ops::Range;

use glam::Vec3;
use protocol::question::{Address, Ask, Asked, BLOCK, Lit, Part, Point, Points, Quality, Question, Ticket, WorldState};
use scenes::{Scene, SurfacePoint};

use crate::parts::order::sort_by_point;

/// What is wanted of a vertex.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Wanted {
    pub vertex: u32,
    /// Whoever has that number by then may be another one.
    pub serial: u32,
    pub at: SurfacePoint,
    /// Not irradiance, but what the eye sees there.
    pub is_seen: bool,
    /// Light sets that it has been lit by before and that stay in its mean.
    pub before: u8,
}

/// A batch on its way.
#[derive(Clone, Debug)]
pub struct Batch {
    pub(super) wanted: Vec<Wanted>,
    /// A question, and what it is about.
    pub(super) questions: Vec<(Question, Range<usize>)>,
    pub(super) revision: u32,
    pub(super) tick: u32,
}

/// What all questions of a batch have in common.
#[derive(Clone, Copy, Debug)]
pub(super) struct Asking {
    pub world: WorldState,
    pub eye: Vec3,
    pub seed: u64,
    pub quality: Quality,
    pub sets: u8,
    pub tick: u32,
}

/// Points of a question at most: a few milliseconds of a thread.
const POINTS_MAX: usize = 8 * BLOCK;

impl Asking {
    /// The questions of a batch about what is there.
    pub fn batch(&self, scene: &Scene, mut wanted: Vec<Wanted>) -> Batch {
        wanted.sort_by_key(|wanted| (wanted.is_seen, wanted.before));
        let mut groups: BTreeMap<(bool, u8), Range<usize>> = BTreeMap::new();
        for (index, Wanted { is_seen, before, .. }) in wanted.iter().enumerate() {
            groups.entry((*is_seen, *before)).or_insert(index..index).end = index + 1;
        }
        let mut questions = Vec::new();
        for ((is_seen, before), range) in groups {
            let group = &mut wanted[range.clone()];
            sort_by_point(scene, group, |wanted| wanted.at);
            for first in range.clone().step_by(POINTS_MAX) {
                let part = first..(first + POINTS_MAX).min(range.end);
                for number in before..before + self.sets {
                    questions.push((self.question(&wanted[part.clone()], is_seen, number), part.clone()));
                }
            }
        }
        Batch { wanted, questions, revision: self.world.revision, tick: self.tick }
    }

    /// All points share their random numbers, and so their error: what differs between neighbours is light.
    fn question(&self, wanted: &[Wanted], is_seen: bool, number: u8) -> Question {
        let sets = self.quality.sets();
        let (set, frame) = (u16::from(number) % sets, u32::from(number) / u32::from(sets));
        let address = Address { pixel: [0, 0], number: u32::from(number) };
        let at = wanted.iter().map(|wanted| Point { at: wanted.at, address }).collect();
        let part = if is_seen { Part::Towards(self.eye) } else { Part::All };
        let lit = Lit { set, frame, seed: self.seed, quality: self.quality };
        Question { world: self.world, ask: Ask::Points(Points { view: None, at, part, lit }) }
    }
}

impl Batch {
    /// What is asked, numbered by `ticket`.
    pub(super) fn asked(&self, ticket: &dyn Fn(usize) -> Ticket) -> Vec<Asked> {
        let questions = self.questions.iter().enumerate();
        questions.map(|(slot, (question, _))| Asked::new(ticket(slot), question.clone())).collect()
    }
}
