//! Which lights matter to the picture: probabilistic acceptance (Georgiev & Slusallek 2010; B2).
//!
//! A candidate is kept with probability `p = min(1, Φ̂/Φ_v + ε)` and made 1/p stronger; Φ̂ is what it
//! brings to a few points that the camera sees, Φ_v what a typical kept light brings. Lights in the
//! next room are mostly dropped before any pixel pays for them, and those that stay matter alike. Any
//! p > 0 is unbiased. The points, Φ_v and all that a pilot finds ([`crate::pilot`]) are a pure function of
//! scene, camera and knobs, so every worker finds the same ones without asking.

use std::sync::Arc;

use glam::Vec3;
use protocol::answer::Cost;
use protocol::question::{Quality, Scramble};
use scenes::Camera;

use crate::aims::{Aims, Choice};
use crate::bvh::{ShaftScratch, Targets};
use crate::eye;
use crate::lobe_pilot;
use crate::pilot::Pilot;
use crate::prepared::Prepared;
use crate::sample::{Sequence, Stage};
use crate::through_glass;
use crate::vpl::{Gates, Shape, Vpl};

/// What a camera sees, in few points, and how much light there matters.
#[derive(Default)]
pub struct Importance {
    points: Vec<Point>,
    targets: Option<Targets>,
    /// The length that bounds and photon radii are fractions of, scene units: how far apart the places are that light
    /// which matters comes from; in a closed room that the camera stands in, about the diagonal of its bounding box.
    /// Without a camera, that of all places that light comes to. Never more than that of the whole scene: but what is
    /// out of sight, and lights nothing that is seen, has no part in it.
    pub extent: f32,
    /// The gates on virtual lights.
    pub gates: Gates,
    /// What a light sample counts beside a ray that follows a lobe ([`crate::lobe_pilot`]).
    pub worth_to_lobes: f32,
    /// How points on lights are chosen …
    pub light_choice: Arc<Choice>,
    /// … how light paths leave lights …
    pub walk_aims: Aims,
    /// … and how photons do.
    pub photon_aims: Arc<Aims>,
    /// Photons per set.
    pub photons: u32,
    /// Candidates per set and the measure of a typical one, for points on lights …
    pub emitters: Plan,
    /// … and for light paths.
    pub walks: Plan,
    /// Segments and visibility tests of the pilot.
    pub rays: u64,
}

/// How many candidates to make of one kind, and how to thin them out.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Plan {
    /// Points on lights, or light paths, per set.
    pub candidates: u32,
    /// Φ_v; 0 keeps everything.
    pub typical: f32,
    /// Plain thinning on top, 0..1, where one path leaves more lights than wanted.
    pub share: f32,
}

/// What a light brings to the points.
#[derive(Clone, Copy, Debug)]
pub struct Brought {
    /// Φ̂: occlusion included. 0 where nothing is looked at.
    pub amount: f32,
    /// It would bring something to some of them, if nothing were between.
    pub is_hidden: bool,
}

/// A place that the camera sees.
pub struct Point {
    /// Off its surface.
    pub position: Vec3,
    /// Unit shading normal.
    pub normal: Vec3,
    /// How much irradiance here counts in the picture.
    pub weight: f32,
}

/// Points that stand for the picture: 8×8 pixels.
const SIDE: u32 = 8;
/// ε: even lights that no point sees keep this chance.
const DEFENCE: f32 = 0.1;
/// Importance is used where it drops at least so many.
const WORTHWHILE: f32 = 0.6;
/// At most so many candidates for each light kept: beyond, finding costs more than it saves.
const CANDIDATES_PER_LIGHT: f32 = 16.0;

impl Importance {
    /// Looks through the camera and flies a pilot. Without `quality.importance`, the pilot knows no camera.
    pub fn new(prepared: &Prepared, camera: &Camera, quality: &Quality) -> Self {
        let mut importance = Self { photons: quality.photons, worth_to_lobes: 1.0, ..Self::default() };
        importance.set_extent(2.0 * prepared.ball.radius, quality);
        if prepared.emitters.is_empty() && prepared.may_skip() {
            return importance;
        }
        if quality.importance {
            importance.look(prepared, camera);
            if prepared.needs.glossy > 0 {
                let (worth, rays) = lobe_pilot::worth_of_light_samples(prepared, camera);
                importance.worth_to_lobes = worth;
                importance.rays += rays;
            }
        }
        Pilot::new(prepared, quality, &mut importance).fly();
        importance
    }

    /// The places that the camera sees; none if nobody looks.
    pub fn points(&self) -> &[Point] {
        &self.points
    }

    /// Sets the extent, and the gates that follow from it.
    pub fn set_extent(&mut self, extent: f32, quality: &Quality) {
        self.extent = extent;
        self.gates = Gates::new(quality.bound, extent);
    }

    /// Φ̂, light samples through glass included, and whether all of it is hidden; of lights that are `all_kept`, Φ̂ may be less
    /// than that. `rays` counts the visibility tests.
    pub fn brings(
        &self,
        prepared: &Prepared,
        vpl: &Vpl,
        all_kept: bool,
        scratch: &mut ShaftScratch,
        rays: &mut u64,
    ) -> Brought {
        let nothing = Brought { amount: 0.0, is_hidden: false };
        let Some(targets) = &self.targets else { return nothing };
        let gate = self.gates.of(vpl);
        let mut shares = [0.0; (SIDE * SIDE) as usize];
        for (point, share) in self.points.iter().zip(&mut shares) {
            let (irradiance, _) = vpl.irradiance(point.position, point.normal, gate);
            *share = point.weight * irradiance.max_element();
        }
        if shares.iter().all(|share| *share == 0.0) {
            return nothing;
        }
        let mut visible = [0];
        if vpl.shape == Shape::Distant {
            let wanted = shares.iter().rev().fold(0, |bits, share| bits << 1 | u64::from(*share > 0.0));
            *rays += u64::from(wanted.count_ones());
            prepared.world.shade_along(vpl.normal, targets, &[wanted], scratch, &mut visible);
        } else {
            *rays += self.points.len() as u64;
            prepared.world.shade_shaft(vpl.position, targets, scratch, &mut visible);
        }
        let is_visible = |i: usize| visible[0] >> i & 1 == 1;
        let mut amount: f32 = (0..shares.len()).filter(|i| is_visible(*i)).map(|i| shares[i]).sum();
        if vpl.depth == 0 && prepared.needs.glass > 0 {
            let mut cost = Cost::default();
            let unseen = self.points.iter().enumerate().filter(|(i, _)| shares[*i] > 0.0 && !is_visible(*i));
            for (i, point) in unseen {
                // To look through glass takes several rays, each by itself.
                if all_kept && amount > 0.0 {
                    break;
                }
                amount += shares[i] * through_glass::passes(prepared, vpl, point.position, &mut cost).max_element();
            }
            *rays += cost.shadow_rays;
        }
        Brought { amount, is_hidden: amount == 0.0 }
    }

    fn look(&mut self, prepared: &Prepared, camera: &Camera) {
        let lens = camera.lens();
        let sequence = Sequence::new(0, Stage::Pilot, [0, 0, 0], Scramble::Owen);
        let (width, height) = (camera.width as f32, camera.height as f32);
        for i in 0..SIDE * SIDE {
            let x = ((i % SIDE) as f32 + 0.5) * width / SIDE as f32;
            let y = ((i / SIDE) as f32 + 0.5) * height / SIDE as f32;
            let sight = eye::look(prepared, &lens, [x as u32, y as u32], &sequence, i);
            if let Some(end) = sight.ends[0].or(sight.ends[1]) {
                let weight = end.weight.max_element().max(0.05);
                self.points.push(Point { position: end.at.above(), normal: end.at.shading, weight });
            }
        }
        if !self.points.is_empty() {
            self.targets = Some(Targets::new(self.points.iter().map(|p| p.position)));
        }
    }
}

impl Plan {
    /// From what the pilot's lights brought, so that about `wanted` lights will be kept.
    pub fn new(brought: &[f32], pilots: u32, wanted: f32) -> Self {
        if brought.is_empty() || wanted <= 0.0 {
            return Self::default();
        }
        let mut plan = Self { candidates: 0, typical: typical(brought), share: 1.0 };
        let kept: f32 = brought.iter().map(|b| plan.probability(*b)).sum();
        // Where most lights matter anyway, thinning would only spoil their even spread.
        let kept = if kept > WORTHWHILE * brought.len() as f32 { brought.len() as f32 } else { kept };
        if kept == brought.len() as f32 {
            plan.typical = 0.0;
        }
        let kept_each = (kept / pilots as f32).max(1e-4);
        let most = CANDIDATES_PER_LIGHT * wanted;
        let candidates = (wanted / kept_each).clamp((wanted / 4.0).max(1.0), most);
        // Blocks of 2^a quasi-random points are nets.
        let candidates = libm::exp2f(libm::roundf(libm::log2f(candidates))).max(1.0);
        let share = (wanted / (candidates * kept_each)).min(1.0);
        Self { candidates: candidates as u32, share, ..plan }
    }

    /// Lights are kept whatever they bring.
    pub fn keeps_all(&self) -> bool {
        self.typical == 0.0
    }

    /// The probability to keep a light that brings so much; greater than 0.
    pub fn probability(&self, brings: f32) -> f32 {
        if self.keeps_all() { self.share } else { (brings / self.typical + DEFENCE).min(1.0) * self.share }
    }
}

/// Φ_v: the mean weighted by itself, which is what the lights that matter bring.
pub fn typical(brought: &[f32]) -> f32 {
    let total: f32 = brought.iter().sum();
    if total > 0.0 { brought.iter().map(|b| b * b).sum::<f32>() / total } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lights_alike_are_all_kept() {
        let plan = Plan::new(&[2.0; 64], 64, 16.0);
        assert_eq!(plan.candidates, 16);
        assert_eq!(plan.probability(2.0), 1.0);
    }

    #[test]
    fn lights_unseen_are_thinned_and_made_up_for() {
        let mut brought = vec![0.0; 90];
        brought.extend([1.0; 10]);
        let plan = Plan::new(&brought, 100, 16.0);
        assert_eq!(plan.probability(1.0), plan.share);
        assert!(plan.probability(0.0) > 0.0);
        let kept = 0.1 * plan.probability(1.0) + 0.9 * plan.probability(0.0);
        assert!((kept * plan.candidates as f32 - 16.0).abs() < 5.0);
    }

    #[test]
    fn a_white_room_does_not_drown_in_the_lights_of_one_path() {
        let plan = Plan::new(&[1.0; 4000], 4, 16.0);
        assert_eq!(plan.candidates, 4);
        assert!((plan.probability(1.0) * 4000.0 - 16.0).abs() < 1.0);
    }
}
