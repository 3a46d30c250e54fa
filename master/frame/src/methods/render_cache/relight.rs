//! Light that an edit has changed everywhere is known anew at once, as far as it can be, and what is left is learnt from few
//! samples for all points alike.
//!
//! **By numbers.** Of lamps that were moved, dimmed or switched, what they gave to a point is taken away, and what they give is
//! added (a control variate: light and its change are the same but for what comes by way of other surfaces). Whether a point
//! sees them is found by a shadow map each; where lamps are too many for that, a point is thought to have seen what its
//! light leaves room for.
//!
//! **By samples.** Where a new sample lands on a point that has none since the edit, it says by how much what was foretold is
//! wrong: new over foretold, as sums over cells of space and of the way that surfaces face, from one cell for all to small
//! ones. Each cell that has few samples leans on the larger ones that it lies in, as if they were [`LEANING`] samples more: the
//! ratio estimator of survey sampling (Cochran 1977), by levels as push and pull fill gaps (Gortler et al. 1996). All points
//! that are not yet sampled anew are brought in line.
//!
//! A foretold mean counts as fewer samples the more was changed, as a Kalman filter has it, so that new samples prevail.

use std::sync::Arc;

use glam::Vec3;
use scenes::Scene;

use super::lamps::{Lamp, Lamps};
use super::point::luminance;
use super::shadows::{ShadowMap, without_lamps};
use crate::parts::raster::Raster;

/// What an edit has changed of light.
#[derive(Clone, Debug, Default)]
pub(super) struct Relight {
    changes: Vec<[Option<Shining>; 2]>,
    /// Something has changed that numbers do not tell.
    is_partial: bool,
}

/// A lamp, and what it sees, if that is known.
#[derive(Clone, Debug)]
struct Shining {
    lamp: Lamp,
    sees: Option<Arc<ShadowMap>>,
}

/// What a point is foretold.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Foretold {
    /// W·m⁻².
    pub irradiance: Vec3,
    /// Standard deviation of that over it, beside a sample's.
    pub doubt: f32,
}

/// Of more lamps no shadows are found: each takes some milliseconds.
const MAPS_MAX: usize = 4;
/// So much of a change is in doubt: penumbrae, and light that comes by way of other surfaces.
const DOUBTED: f32 = 0.25;
/// So much of its light a point keeps, whatever numbers say is taken away.
const KEPT: f32 = 0.05;

impl Relight {
    /// What has changed between lamps as they were and as they are in a scene; `last` is the edit before, whose shadows are
    /// known.
    pub fn between(was: &Lamps, is: &Lamps, scene: &Scene, last: &Self) -> Self {
        let changes = was.changed(is);
        let is_mapped = changes.iter().flatten().flatten().filter_map(|lamp| lamp.place()).count() <= 2 * MAPS_MAX;
        let is_partial = changes.iter().flatten().flatten().any(|lamp| !lamp.is_known());
        let mut raster = Raster::new();
        let mut dark: Option<Scene> = None;
        let mut maps: Vec<((Vec3, Vec3), Arc<ShadowMap>)> = last.maps().collect();
        let mut shining = |lamp: &Lamp| {
            let place = lamp.place().filter(|_| is_mapped);
            let sees = place.map(|place| {
                if let Some((_, map)) = maps.iter().find(|(there, _)| *there == place) {
                    return Arc::clone(map);
                }
                let dark = dark.get_or_insert_with(|| without_lamps(scene));
                let map = Arc::new(ShadowMap::new(dark, place.0, place.1, &mut raster));
                maps.push((place, Arc::clone(&map)));
                map
            });
            Shining { lamp: lamp.clone(), sees }
        };
        let changes = changes.into_iter().map(|pair| pair.map(|lamp| lamp.map(&mut shining))).collect();
        Self { changes, is_partial }
    }

    /// Where lamps are after it, and what they see there.
    fn maps(&self) -> impl Iterator<Item = ((Vec3, Vec3), Arc<ShadowMap>)> {
        let now = self.changes.iter().filter_map(|[_, now]| now.as_ref());
        now.filter_map(|shining| Some((shining.lamp.place()?, Arc::clone(shining.sees.as_ref()?))))
    }

    /// The light of a point after the edit that had this irradiance before.
    pub fn foretell(&self, before: Vec3, at: Vec3, normal: Vec3) -> Foretold {
        let (mut seen, mut guessed) = ([Vec3::ZERO; 2], [Vec3::ZERO; 2]);
        let mut change = Vec3::ZERO;
        for pair in &self.changes {
            let mut gives = [Vec3::ZERO; 2];
            for (time, shining) in pair.iter().enumerate() {
                let Some(Shining { lamp, sees }) = shining else { continue };
                gives[time] = lamp.irradiance(at, normal);
                match sees {
                    Some(map) if gives[time] != Vec3::ZERO => seen[time] += gives[time] * map.lit(at, normal),
                    Some(_) => {}
                    None => guessed[time] += gives[time],
                }
            }
            change += (gives[1] - gives[0]).abs();
        }
        let known = (before + seen[1] - seen[0]).max(before * KEPT);
        let by_channel = |channel: usize| {
            let (known, was, is) = (known[channel], guessed[0][channel], guessed[1][channel]);
            if was > 0.0 { known + known.clamp(0.0, was) * (is / was - 1.0) } else { known + is }
        };
        let irradiance = Vec3::from_array([0, 1, 2].map(by_channel));
        let scale = luminance(irradiance.max(before)).max(f32::MIN_POSITIVE);
        let change = luminance((irradiance - before).abs()) + DOUBTED * luminance(change);
        let doubt = (change / scale).min(DOUBT_MAX);
        Foretold { irradiance, doubt: if self.is_partial { doubt.max(1.0) } else { doubt } }
    }
}

/// Enough for a mean of any number of samples to count as none.
const DOUBT_MAX: f32 = 2.0;

impl Foretold {
    /// As how many samples a mean of so many counts: variances add up.
    pub fn count(&self, samples: u8) -> u8 {
        let samples = f32::from(samples);
        (samples / (1.0 + samples * self.doubt * self.doubt)).round() as u8
    }
}

/// What samples say of what was foretold.
#[derive(Clone, Debug, Default)]
pub(super) struct Learnt {
    samples: Vec<Compared>,
}

/// A new sample, and what was foretold of it; both irradiance.
#[derive(Clone, Copy, Debug)]
pub(super) struct Compared {
    pub at: Vec3,
    pub normal: Vec3,
    pub new: Vec3,
    pub foretold: Vec3,
    /// What it counts as.
    pub weight: f32,
}

/// By how much all that was foretold is to be multiplied, by place and normal.
#[derive(Clone, Debug)]
pub(super) struct Correction {
    low: Vec3,
    /// Of a cell of the finest level.
    side: f32,
    finest: Level,
}

/// Ratios of cells, by the way that surfaces face, then z, y and x.
#[derive(Clone, Debug)]
struct Level {
    side: usize,
    ratios: Vec<Vec3>,
}

/// Samples that a cell leans on a larger one for.
const LEANING: f32 = 8.0;
/// Cells along the sides of the levels.
const SIDES: [usize; 5] = [1, 2, 4, 8, 16];
/// Ways that surfaces face: along an axis or against it.
const WAYS: usize = 6;
/// Samples that are looked at, at most: the last ones.
const COMPARED_MAX: usize = 8192;
/// What samples of before an edit count after it, and when they are forgotten.
const FADED: f32 = 0.5;
const FORGOTTEN: f32 = 1.0 / 16.0;
/// No ratio is larger, nor smaller than one over it.
const RATIO_MAX: f32 = 8.0;

impl Learnt {
    /// Nothing is to be learnt any more.
    pub fn clear(&mut self) {
        self.samples.clear();
    }

    /// There is nothing to learn from.
    pub fn is_empty(&self) -> bool {
        self.samples.is_empty()
    }

    /// Light was edited again.
    pub fn fade(&mut self, relight: &Relight) {
        for sample in &mut self.samples {
            sample.weight *= FADED;
            for value in [&mut sample.new, &mut sample.foretold] {
                *value = relight.foretell(*value, sample.at, sample.normal).irradiance;
            }
        }
        self.samples.retain(|sample| sample.weight >= FORGOTTEN);
    }

    /// So much more is known.
    pub fn add(&mut self, sample: Compared) {
        self.samples.push(sample);
    }

    /// What follows from all that is known.
    pub fn learn(&mut self) -> Correction {
        let too_many = self.samples.len().saturating_sub(COMPARED_MAX);
        self.samples.drain(..too_many);
        let correction = Correction::of(&self.samples);
        for sample in &mut self.samples {
            sample.foretold *= correction.ratio(sample.at, sample.normal);
        }
        correction
    }
}

impl Correction {
    fn of(samples: &[Compared]) -> Self {
        let low = samples.iter().fold(Vec3::INFINITY, |low, sample| low.min(sample.at));
        let high = samples.iter().fold(Vec3::NEG_INFINITY, |high, sample| high.max(sample.at));
        let extent = (high - low).max_element().max(f32::MIN_POSITIVE);
        // All ways alike.
        let (mut sum, mut foretold, mut weight) = (Vec3::ZERO, Vec3::ZERO, 0.0);
        for sample in samples {
            sum += sample.new * sample.weight;
            foretold += sample.foretold * sample.weight;
            weight += sample.weight;
        }
        let whole = leaning(sum, foretold, weight, Vec3::ONE);
        let mut level = Level { side: 1, ratios: vec![whole; WAYS] };
        for side in SIDES {
            level = level.finer(side, samples, low, extent);
        }
        Self { low, side: extent / level.side as f32, finest: level }
    }

    /// The factor on what was foretold for a place.
    pub fn ratio(&self, at: Vec3, normal: Vec3) -> Vec3 {
        self.finest.ratio((at - self.low) / self.side, way(normal))
    }
}

impl Level {
    /// A level of so many cells a side that leans on this one.
    fn finer(&self, side: usize, samples: &[Compared], low: Vec3, extent: f32) -> Self {
        let cells = side * side * side;
        let mut sums = vec![(Vec3::ZERO, Vec3::ZERO, 0.0); WAYS * cells];
        let scale = side as f32 / extent;
        for sample in samples {
            let [x, y, z] = ((sample.at - low) * scale).to_array().map(|at| (at as usize).min(side - 1));
            let (new, foretold, weight) = &mut sums[way(sample.normal) * cells + (z * side + y) * side + x];
            *new += sample.new * sample.weight;
            *foretold += sample.foretold * sample.weight;
            *weight += sample.weight;
        }
        let to_coarser = self.side as f32 / side as f32;
        let ratio = |(number, (new, foretold, weight)): (usize, (Vec3, Vec3, f32))| {
            let (way, cell) = (number / cells, number % cells);
            let middle = [cell % side, cell / side % side, cell / side / side].map(|at| at as f32 + 0.5);
            leaning(new, foretold, weight, self.ratio(Vec3::from_array(middle) * to_coarser, way))
        };
        Self { side, ratios: sums.into_iter().enumerate().map(ratio).collect() }
    }

    /// Between the middles of cells; `at` in cells.
    fn ratio(&self, at: Vec3, way: usize) -> Vec3 {
        let side = self.side;
        let at = (at - 0.5).clamp(Vec3::ZERO, Vec3::splat((side - 1) as f32));
        let first = at.floor();
        let share = at - first;
        let [x, y, z] = first.to_array().map(|at| at as usize);
        let of = |dx: usize, dy: usize, dz: usize| {
            let [x, y, z] = [x + dx, y + dy, z + dz].map(|at| at.min(side - 1));
            self.ratios[((way * side + z) * side + y) * side + x]
        };
        let along = |dy, dz| of(0, dy, dz).lerp(of(1, dy, dz), share.x);
        let across = |dz| along(0, dz).lerp(along(1, dz), share.y);
        across(0).lerp(across(1), share.z)
    }
}

/// The ratio of two sums of so many samples, and of [`LEANING`] more of a known ratio.
fn leaning(new: Vec3, foretold: Vec3, weight: f32, known: Vec3) -> Vec3 {
    if weight <= 0.0 {
        return known;
    }
    let more = foretold * (LEANING / weight);
    let by_channel = |channel: usize| {
        let all = foretold[channel] + more[channel];
        if all > 0.0 { (new[channel] + more[channel] * known[channel]) / all } else { known[channel] }
    };
    Vec3::from_array([0, 1, 2].map(by_channel)).clamp(Vec3::splat(1.0 / RATIO_MAX), Vec3::splat(RATIO_MAX))
}

/// The axis that a normal is nearest to.
fn way(normal: Vec3) -> usize {
    let axis = normal.abs().max_position();
    2 * axis + usize::from(normal[axis] < 0.0)
}

#[cfg(test)]
mod tests {
    use scenes::{Light, Material, Mesh, Object};

    use super::*;

    /// A floor, a point lamp three above it, and between them a small square.
    fn scene(power: f32, x: f32) -> Scene {
        let square = |half: f32, z: f32| {
            let corner = |x: f32, y: f32| Vec3::new(x * half, y * half, z);
            let positions = vec![corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)];
            Mesh { positions, triangles: vec![[0, 1, 2], [0, 2, 3]], materials: vec![0, 0], ..Mesh::default() }
        };
        Scene {
            meshes: vec![square(20.0, 0.0).into(), square(0.5, 1.0).into()],
            objects: vec![Object::fixed("floor", 0), Object::fixed("square", 1)],
            materials: vec![Material::diffuse("grey", Vec3::splat(0.5))],
            lights: vec![Light::Point { position: Vec3::new(x, 0.0, 3.0), intensity: Vec3::splat(power) }],
            ..Scene::default()
        }
    }

    /// What the lamp gives to the floor where it is in sight, and what else there is.
    fn direct(power: f32, x: f32, at: Vec3) -> f32 {
        let offset = Vec3::new(x, 0.0, 3.0) - at;
        power * offset.z / offset.length().powi(3)
    }

    const AROUND: f32 = 0.05;

    fn foretell(before: &Scene, after: &Scene, light: f32, at: Vec3) -> Foretold {
        let [was, is] = [before, after].map(Lamps::of);
        Relight::between(&was, &is, after, &Relight::default()).foretell(Vec3::splat(light), at, Vec3::Z)
    }

    #[test]
    fn a_lamp_of_four_times_the_power_lights_what_it_sees_and_no_shadow() {
        let (before, after) = (scene(1.0, 0.0), scene(4.0, 0.0));
        let lit = Vec3::new(2.0, 0.0, 0.0);
        let foretold = foretell(&before, &after, direct(1.0, 0.0, lit) + AROUND, lit);
        let truth = direct(4.0, 0.0, lit) + AROUND;
        assert!((foretold.irradiance.x / truth - 1.0).abs() < 1e-3, "{foretold:?} for {truth}");
        let hidden = foretell(&before, &after, AROUND, Vec3::ZERO);
        assert!((hidden.irradiance.x / AROUND - 1.0).abs() < 1e-3, "{hidden:?}");
        assert!(foretold.count(16) < 4, "a mean of before counts for little: {}", foretold.count(16));
    }

    #[test]
    fn a_lamp_that_is_moved_takes_its_shadow_along() {
        let (before, after) = (scene(1.0, 0.0), scene(1.0, 2.0));
        // The square hides (0, 0) from the lamp as it was, and (-1, 0) from the lamp as it is.
        let (freed, hidden) = (Vec3::X * 0.5, -Vec3::X);
        let foretold = foretell(&before, &after, AROUND, freed).irradiance.x;
        let truth = direct(1.0, 2.0, freed) + AROUND;
        assert!((foretold / truth - 1.0).abs() < 1e-3, "{foretold} for {truth}");
        let foretold = foretell(&before, &after, direct(1.0, 0.0, hidden) + AROUND, hidden).irradiance.x;
        assert!((foretold / AROUND - 1.0).abs() < 1e-2, "{foretold} for {AROUND}");
    }

    #[test]
    fn a_lamp_that_stays_as_it_is_changes_nothing() {
        let scene = scene(1.0, 0.0);
        assert!(Lamps::of(&scene) == Lamps::of(&scene.clone()));
        let foretold = foretell(&scene, &scene, 0.3, Vec3::X);
        assert_eq!((foretold.irradiance, foretold.count(16)), (Vec3::splat(0.3), 16));
    }

    fn compared(number: u32, ratio: impl Fn(Vec3) -> f32) -> Compared {
        let random = |salt: u32| (number.wrapping_mul(0x9e37_79b9).rotate_left(salt) >> 8) as f32 / 16_777_216.0;
        let at = Vec3::new(random(3), random(11), 0.0);
        let noise = 1.0 + 0.4 * (random(17) - 0.5);
        let foretold = Vec3::splat(0.5 + random(23));
        Compared { at, normal: Vec3::Z, new: foretold * ratio(at) * noise, foretold, weight: 1.0 }
    }

    #[test]
    fn few_samples_tell_what_is_wrong_with_all_that_was_foretold() {
        let mut learnt = Learnt::default();
        (1..=64).for_each(|number| learnt.add(compared(number, |_| 3.0)));
        let correction = learnt.learn();
        for at in [Vec3::ZERO, Vec3::new(0.3, 0.7, 0.0), Vec3::ONE, Vec3::splat(9.0)] {
            let ratio = correction.ratio(at, Vec3::Z).x;
            assert!((2.5..3.3).contains(&ratio), "{ratio} at {at}");
        }
        // What was learnt is learnt once.
        let again = learnt.learn().ratio(Vec3::new(0.3, 0.7, 0.0), Vec3::Z).x;
        assert!((0.9..1.2).contains(&again), "{again}");
    }

    #[test]
    fn many_samples_tell_places_apart() {
        let mut learnt = Learnt::default();
        (1..=1024).for_each(|number| learnt.add(compared(number, |at| if at.x < 0.5 { 2.0 } else { 0.5 })));
        let correction = learnt.learn();
        let [left, right] = [0.2, 0.8].map(|x| correction.ratio(Vec3::new(x, 0.5, 0.0), Vec3::Z).x);
        assert!((left / 2.0 - 1.0).abs() < 0.25 && (right / 0.5 - 1.0).abs() < 0.25, "{left} and {right}");
    }
}
