//! The light at single points of surfaces, part by part: as if they were matt, from all sides of the hemisphere.
//!
//! The parts are those of [`crate::gather`]. Straight from lights come the virtual lights on them and what the bound cut
//! off these ([`Missing::straight`]); all else is indirect: virtual lights on surfaces, caustics, and the rest of the
//! compensation of bias. A point takes the numbers of its address, so that the first hit of a ray is lit by the ray's bits.

use std::f32::consts::PI;

use glam::Vec3;
use protocol::answer::{Answer, Body, Cost, CostStage, EachLight};
use protocol::question::{BLOCK, Part, Point, Points, WorldState};
use scenes::{LightGroup, Rgb, Scene, light_groups};

use crate::answer::{Path, Watch, light_set};
use crate::bias_compensation::{BiasCompensation, Missing};
use crate::cache::LightSetCache;
use crate::emitter::Emitters;
use crate::eye::EndPoint;
use crate::gather::{self, Gathered};
use crate::lobe::Shares;
use crate::prepared::Prepared;
use crate::rays;
use crate::through_glass::Arriving;
use crate::vpl::{Gates, Vpl};
use crate::walk::LightSet;

/// The light groups of a scene, and who belongs to which.
#[derive(Clone, Debug, Default)]
pub struct Groups {
    list: Vec<LightGroup>,
    /// By [`Vpl::source`].
    of_source: Vec<u32>,
}

impl Groups {
    /// Sorts all that shines into groups.
    pub fn new(scene: &Scene, emitters: &Emitters) -> Self {
        let list = light_groups(scene);
        let find = |group: LightGroup| list.binary_search(&group).expect("all that shines belongs to a group") as u32;
        let of_source = emitters.groups(scene).into_iter().map(find).collect();
        Self { list, of_source }
    }

    /// How many there are.
    pub fn len(&self) -> usize {
        self.list.len()
    }

    /// Nothing shines.
    pub fn is_empty(&self) -> bool {
        self.list.is_empty()
    }

    /// Whose light a virtual light is.
    pub fn of_light(&self, vpl: &Vpl) -> u32 {
        self.of_source[vpl.source as usize]
    }

    /// Whose light a triangle sends.
    fn of_emitter(&self, scene: &Scene, [object, triangle]: [u32; 2]) -> Option<u32> {
        let group = LightGroup::of_triangle(scene, object, triangle);
        self.list.binary_search(&group).ok().map(|number| number as u32)
    }
}

/// Answers about points.
pub(crate) fn answer(
    prepared: &Prepared,
    cache: &LightSetCache,
    world: WorldState,
    asked: &Points,
    clock: &dyn Fn() -> u64,
) -> Answer {
    let Points { view, at, part, lit } = asked;
    if let Part::Towards(eye) = part {
        return rays::towards(prepared, cache, world, (view.as_ref(), lit), (*eye, at), clock);
    }
    let mut cost = Cost::default();
    let mut watch = Watch::start(clock);
    let cached = light_set(prepared, cache, world, view.as_ref(), lit, &mut cost);
    watch.stop(&mut cost, CostStage::LightSets);
    let nothing = LightSet::default();
    let set = cached.get().unwrap_or(&nothing);
    let mut work = Work { prepared, set, gates: set.gates, asked, cost, watch, scratch: gather::Scratch::default() };
    let body = match part {
        Part::EachLight { first, count } => work.each_light(*first, *count),
        _ => work.irradiance(),
    };
    Answer { body, cost: work.cost }
}

/// Everything that an answer is made of.
struct Work<'a> {
    prepared: &'a Prepared,
    set: &'a LightSet,
    gates: Gates,
    asked: &'a Points,
    cost: Cost,
    watch: Watch<'a>,
    scratch: gather::Scratch,
}

impl Work<'_> {
    fn irradiance(&mut self) -> Body {
        let Self { prepared, set, gates, asked, .. } = *self;
        let quality = &asked.lit.quality;
        let estimate = match asked.part {
            Part::Direct | Part::DirectOf(_) => BiasCompensation::straight(prepared, set, gates, quality),
            _ => BiasCompensation::new(prepared, set, gates, quality),
        };
        let kinds = self.kinds();
        let mut irradiance = Vec::with_capacity(asked.at.len() * kinds.len());
        let mut sums = Vec::new();
        for block in asked.at.chunks(BLOCK) {
            let ends = self.ends(block);
            // One sum a kind and point, kind after kind.
            sums.clear();
            sums.resize(kinds.len() * ends.len(), Gathered::default());
            for (lights, sums) in kinds.iter().zip(sums.chunks_mut(ends.len())) {
                gather::virtual_lights(
                    prepared,
                    lights,
                    (gates, &Shares::default()),
                    &ends,
                    &mut self.scratch,
                    sums,
                    &mut self.cost,
                );
            }
            self.watch.stop(&mut self.cost, CostStage::Shadows);
            let has_photons = !(set.photons.is_empty() && prepared.may_skip());
            if matches!(asked.part, Part::All | Part::Indirect) && has_photons {
                gather::caustics(set, &ends, &mut sums, &mut self.cost);
                self.watch.stop(&mut self.cost, CostStage::Photons);
            }
            if estimate.is_needed() {
                for (i, (point, end)) in block.iter().zip(&ends).enumerate() {
                    let path = Path::of(&asked.lit, &point.address);
                    let missing = estimate.sample(&end.at, &path.compensation, 0, path.index, &mut self.cost);
                    let add = |light: Arriving| sums[i].irradiance += light.irradiance;
                    estimate.through_glass(&end.at, &path.compensation, 0, path.index, &mut self.cost, add);
                    if let Some((kind, radiance)) = missing.and_then(|missing| self.share(&missing)) {
                        sums[kind * ends.len() + i].irradiance += radiance * PI;
                    }
                }
                self.watch.stop(&mut self.cost, CostStage::BiasCompensation);
            }
            for i in 0..ends.len() {
                irradiance.extend(sums[i..].iter().step_by(ends.len()).map(|sum| sum.irradiance));
            }
        }
        self.drop_unless_finite(&mut irradiance);
        Body::Irradiance(irradiance)
    }

    /// The virtual lights of each irradiance that is asked for.
    fn kinds(&self) -> Vec<Vec<Vpl>> {
        let (all, groups) = (&self.set.vpls, || self.prepared.groups());
        let pick = |wanted: &dyn Fn(&Vpl) -> bool| all.iter().filter(|vpl| wanted(vpl)).cloned().collect();
        match &self.asked.part {
            Part::Direct => vec![pick(&|vpl| vpl.depth == 0)],
            Part::Indirect => vec![pick(&|vpl| vpl.depth > 0)],
            Part::DirectOf(asked) => {
                let of = |group: &u32| pick(&|vpl| vpl.depth == 0 && groups().of_light(vpl) == *group);
                asked.iter().map(of).collect()
            }
            Part::All | Part::EachLight { .. } | Part::Towards(_) => vec![all.clone()],
        }
    }

    /// What of the light that virtual lights leave out belongs to what is asked for, and to which irradiance.
    fn share(&self, missing: &Missing) -> Option<(usize, Rgb)> {
        match &self.asked.part {
            Part::Direct => Some((0, missing.straight)),
            // A part of a sum of numbers that are not negative: neither is the difference.
            Part::Indirect => Some((0, missing.radiance - missing.straight)),
            Part::DirectOf(_) if missing.straight == Vec3::ZERO => None,
            Part::DirectOf(asked) => {
                let group = self.prepared.groups().of_emitter(&self.prepared.scene, missing.emitter)?;
                asked.binary_search(&group).ok().map(|kind| (kind, missing.straight))
            }
            Part::All | Part::EachLight { .. } | Part::Towards(_) => Some((0, missing.radiance)),
        }
    }

    fn each_light(&mut self, first: u32, count: u32) -> Body {
        let vpls = &self.set.vpls;
        let first = (first as usize).min(vpls.len());
        let lights = &vpls[first..first.saturating_add(count as usize).min(vpls.len())];
        let pairs = self.asked.at.len() * lights.len();
        let (mut unhidden, mut visible) = (vec![Vec3::ZERO; pairs], vec![false; pairs]);
        for (block, points) in (0..).zip(self.asked.at.chunks(BLOCK)) {
            let ends = self.ends(points);
            let (prepared, tests) = (self.prepared, self.scratch.tests());
            gather::each_light(prepared, lights, self.gates, &ends, tests, &mut self.cost, |beam| {
                for i in 0..ends.len() {
                    let pair = (block * BLOCK + i) * lights.len() + beam.number;
                    unhidden[pair] = gather::unhidden(&beam, &ends, i);
                    visible[pair] = beam.visible[i / 64] >> (i % 64) & 1 == 1;
                }
            });
        }
        self.watch.stop(&mut self.cost, CostStage::Shadows);
        self.drop_unless_finite(&mut unhidden);
        Body::EachLight(EachLight { of: vpls.len() as u32, lights: lights.len() as u32, unhidden, visible })
    }

    /// Points as if eye paths ended there on something matt.
    fn ends(&mut self, points: &[Point]) -> Vec<EndPoint> {
        let prepared = self.prepared;
        let end = |point: &Point| {
            let found = prepared.scene.find_point(&point.at).expect("questions are checked before they are answered");
            let at = prepared.surfel_on(found as u32, &point.at);
            EndPoint { at, weight: Vec3::ONE, glossy: None, distance: 0.0, seen_normal: at.shading }
        };
        let ends = points.iter().map(end).collect();
        self.watch.stop(&mut self.cost, CostStage::Eye);
        ends
    }

    /// As with pixels: one bad sample must not spoil a sum for ever.
    fn drop_unless_finite(&mut self, irradiance: &mut [Rgb]) {
        for sum in irradiance.iter_mut().filter(|sum| !sum.is_finite()) {
            *sum = Vec3::ZERO;
            self.cost.dropped += 1;
        }
    }
}
