//! A first flight of light that tells later ones where to go: what each emitter brings to the view, how far apart the places
//! are that light comes from, and whether photons are of use.
//!
//! All of it is chance's business alone: whatever the pilot finds, every path of light keeps a share of the samples, so
//! the mean stays. Its own samples light nothing. It is a pure function of scene, camera and knobs ([`crate::importance`]).

use std::f32::consts::PI;
use std::sync::Arc;

use glam::Vec3;
use protocol::question::{Bound, Quality, Scramble};

use crate::aims::{Aims, Choice, Entry, Part};
use crate::bvh::ShaftScratch;
use crate::caustics::{self, Landed, Sharing, Ways};
use crate::emitter::Emitters;
use crate::importance::{Importance, Plan, Point, typical};
use crate::prepared::Prepared;
use crate::sample::{Sequence, Stage};
use crate::targets::Ball;
use crate::vpl::{Gates, Vpl};
use crate::walk::LightPath;

/// Finds how light is best sent on its way.
pub struct Pilot<'a> {
    prepared: &'a Prepared,
    quality: &'a Quality,
    found: &'a mut Importance,
    scratch: ShaftScratch,
    /// The class of each emitter ([`classes`]).
    classes: &'a [u32],
    /// How many classes there are.
    class_count: usize,
    /// What the view is of; `None` where nobody looks, or at about everything.
    region: Option<Ball>,
    /// What is known of emitters before.
    base: Choice,
    /// Mean irradiance at the points.
    irradiance: f32,
}

/// Points on lights, and light paths, from which Φ_v is found; and half as many to choose emitters by.
const LIGHTS: u32 = 256;
const PATHS: u32 = 256;
/// Bounds the pilot in stiff scenes, where one path leaves thousands of lights.
const MOST_VPLS: usize = 4_096;
/// Photons.
const PHOTONS: u32 = 512;
/// Most classes of emitters that lie somewhere.
const MOST_CLASSES: usize = 64;
/// Of n classes, a share of n/(n + this) goes by what is known before: to emitters that bring nothing to the few points
/// looked at.
const DEFENCE: f64 = 38.0;
/// Emitters are chosen by what they bring where that differs by such a factor from what is known before: smaller ones may be
/// the pilot's own noise.
const WORTHWHILE: f64 = 2.0;
/// Share of light from afar that is sent through the disc that covers what is seen.
const TOWARDS_VIEW: f32 = 0.75;
/// Of the pilot's paths that look for glass, so many are aimed at it.
const AT_PANES_TRIED: f32 = 0.5;
/// Paths are aimed at glass where what comes through it has at least such a share of the light …
const AT_PANES_LEAST: f32 = 0.02;
/// … and so many times that share of the paths which are left to themselves; …
const AT_PANES_RARE: f32 = 4.0;
/// … about this many where that is not known; …
const AT_PANES_UNSEEN: f32 = 0.25;
/// … and never more than these: what lies before the glass sends light to it only if it is lit.
const AT_PANES_MOST: f32 = 0.5;
/// The bound on lights from which the extent is found.
const PILOT_BOUND: Bound = Bound::Geometry { distance: 0.1 };
/// The extent, in medians of the distances between two places that light comes from.
const MEDIANS: f32 = 3.75;
/// One virtual light in so many, where the pilot's bring nothing to what is looked at.
const VPLS_DEFENCE: f32 = 4.0;
/// One photon in so many, where they are of no use: there may be a light that no ray finds.
const PHOTONS_DEFENCE: u32 = 16;
/// Where fewer of the pilot's photons arrive, a set's would lie too far apart to tell more than rays do.
const FEW_PHOTONS: u32 = 8;
/// What caustics may add to the squared relative error of a sample.
const CAUSTICS_ERROR: f32 = 0.02;

/// One of the pilot's virtual lights.
struct Sent {
    position: Vec3,
    source: u32,
    /// Φ̂.
    brings: f32,
    /// It came through clear glass.
    passed_glass: bool,
}

/// Virtual lights of some light paths.
#[derive(Default)]
struct Flown {
    sent: Vec<Sent>,
    /// How many paths they were.
    paths: u32,
    /// How many of them would have come through clear glass to some surface if none had been aimed there.
    pass_by_chance: f32,
}

impl<'a> Pilot<'a> {
    /// Of what has been looked at.
    pub fn new(prepared: &'a Prepared, quality: &'a Quality, found: &'a mut Importance) -> Self {
        let whole = prepared.ball;
        let seen = ball_of(found.points()).filter(|ball| Entry::mostly(whole, *ball, TOWARDS_VIEW).part().is_some());
        let base = prepared.emitters.by_power(seen.unwrap_or(whole).radius);
        let classes = &prepared.emitter_classes[..];
        let class_count = classes.iter().max().map_or(0, |most| *most as usize + 1);
        let scratch = ShaftScratch::default();
        Self { prepared, quality, found, scratch, classes, class_count, region: seen, base, irradiance: 0.0 }
    }

    /// All of it.
    pub fn fly(&mut self) {
        self.aim();
        let lights = self.lights(&self.sequence(1), &self.found.light_choice.clone(), LIGHTS);
        let brought: Vec<f32> = lights.iter().map(|light| light.brings).collect();
        self.found.emitters = Plan::new(&brought, LIGHTS, f32::from(self.quality.light_samples));
        self.irradiance = brought.iter().sum::<f32>() / LIGHTS as f32;
        if self.prepared.needs.spreading > 0 {
            let Flown { sent, paths, .. } = self.walks(&self.sequence(2), &self.found.walk_aims.clone(), PATHS);
            let brought: Vec<f32> = sent.iter().map(|vpl| vpl.brings).collect();
            self.found.walks = Plan::new(&brought, paths, self.wanted(&brought));
            self.irradiance += brought.iter().sum::<f32>() / paths as f32;
            if self.found.points().is_empty() {
                self.measure(&sent);
            }
        }
        self.irradiance /= self.found.points().iter().map(|point| point.weight).sum::<f32>().max(f32::MIN_POSITIVE);
        if self.prepared.needs.caustics() && self.quality.photons > 0 {
            self.photons();
        }
    }

    /// How many virtual lights of light paths a set should have, from what the pilot's brought: few where all brought nothing.
    fn wanted(&self, brought: &[f32]) -> f32 {
        let vpls = f32::from(self.quality.vpls);
        let nothing = !self.found.points().is_empty() && brought.iter().all(|brings| *brings == 0.0);
        if nothing { (vpls / VPLS_DEFENCE).max(1.0) } else { vpls }
    }

    fn sequence(&self, number: u32) -> Sequence {
        Sequence::new(0, Stage::Pilot, [number, 0, 0], Scramble::Owen)
    }

    /// Finds which emitters to take points on, and light paths from; and the extent.
    fn aim(&mut self) {
        self.found.light_choice = Arc::new(self.base.clone());
        self.found.walk_aims = Aims { choice: self.base.clone(), entry: self.entry(self.region), at_panes: 0.0 };
        self.found.photon_aims = Arc::new(self.found.walk_aims.clone());
        let fair = self.fair();
        if self.found.points().is_empty() {
            self.found.walk_aims.at_panes = self.worth_aiming_at_panes(&fair);
            return;
        }
        // Of what is seen, until more is known.
        let seen: Vec<_> = self.found.points().iter().map(|point| (point.position, 1.0)).collect();
        self.set_extent(spread(&seen));
        // The extent is no matter of the bound that is asked for.
        self.found.gates = Gates::new(PILOT_BOUND, self.found.extent);
        let at_panes = self.worth_aiming_at_panes(&fair);
        self.found.walk_aims.at_panes = at_panes;
        if self.class_count > 1 {
            let lights = self.lights(&self.sequence(3), &fair.choice, LIGHTS / 2);
            self.found.light_choice = Arc::new(self.choice_by(&lights));
        }
        if self.prepared.needs.spreading > 0 {
            let Flown { sent, .. } = self.walks(&self.sequence(4), &Aims { at_panes, ..fair }, PATHS / 2);
            self.found.walk_aims.choice = self.choice_by(&sent);
            self.measure(&sent);
        }
        self.found.set_extent(self.found.extent, self.quality);
    }

    /// The share of paths that are best sent through clear glass: where it is rarely found by chance and matters, about the share
    /// of the light that comes through it.
    fn worth_aiming_at_panes(&mut self, fair: &Aims) -> f32 {
        if self.prepared.panes.balls().is_empty() || self.prepared.needs.spreading == 0 {
            return 0.0;
        }
        let aims = Aims { at_panes: AT_PANES_TRIED, ..fair.clone() };
        let Flown { sent, paths, pass_by_chance } = self.walks(&self.sequence(6), &aims, PATHS / 2);
        let brought = |vpls: &mut dyn Iterator<Item = &Sent>| vpls.map(|vpl| vpl.brings).sum::<f32>();
        let all = brought(&mut sent.iter());
        let of_light = match all > 0.0 {
            // Nobody looks, or what is looked at is hard to find.
            false => AT_PANES_UNSEEN,
            true => brought(&mut sent.iter().filter(|vpl| vpl.passed_glass)) / all,
        };
        let of_paths = pass_by_chance / paths as f32;
        let is_worthwhile = of_light > AT_PANES_LEAST && of_light > AT_PANES_RARE * of_paths;
        if is_worthwhile { of_light.min(AT_PANES_MOST) } else { 0.0 }
    }

    /// As often from each class of emitters as by what is known before.
    fn fair(&self) -> Aims {
        let shares = self.base.shares();
        let of_class = self.by_class(shares.iter().copied().enumerate());
        let count = of_class.iter().filter(|share| **share > 0.0).count() as f64;
        let fair = |(share, class): (&f64, &u32)| share * (0.5 + 0.5 / (count * of_class[*class as usize]));
        let weights: Vec<f64> = shares.iter().zip(self.classes).map(fair).collect();
        Aims { choice: Choice::new(&weights), entry: self.entry(self.region), at_panes: 0.0 }
    }

    fn entry(&self, region: Option<Ball>) -> Entry {
        match region {
            Some(region) => Entry::mostly(self.prepared.ball, region, TOWARDS_VIEW),
            None => Entry::whole(self.prepared.ball),
        }
    }

    /// Sums by class of what belongs to emitters.
    fn by_class(&self, of: impl Iterator<Item = (usize, f64)>) -> Vec<f64> {
        let mut sums = vec![0.0; self.class_count];
        for (emitter, part) in of {
            sums[self.classes[emitter] as usize] += part;
        }
        sums
    }

    /// By what the lights of each class bring, and within a class by what is known before.
    fn choice_by(&self, sent: &[Sent]) -> Choice {
        let emitters = &self.prepared.emitters;
        let brought = |sent: &Sent| (emitters.emitter_of(sent.source), f64::from(sent.brings));
        self.choice_among(&self.by_class(sent.iter().map(brought)))
    }

    fn choice_among(&self, brought: &[f64]) -> Choice {
        let total: f64 = brought.iter().sum();
        if !(total > 0.0 && total.is_finite()) {
            return self.base.clone();
        }
        let shares = self.base.shares();
        let of_class = self.by_class(shares.iter().copied().enumerate());
        let ratios: Vec<f64> = brought.iter().zip(&of_class).map(|(brought, known)| brought / total / known).collect();
        if ratios.iter().all(|ratio| (1.0 / WORTHWHILE..=WORTHWHILE).contains(ratio)) {
            return self.base.clone();
        }
        let weight = |(share, class): (&f64, &u32)| share * ratios[*class as usize];
        let weights: Vec<f64> = shares.iter().zip(self.classes).map(weight).collect();
        // The more classes, the fewer samples of each has the pilot had.
        let count = self.class_count as f64;
        Choice::mixed(&weights, &self.base, count / (count + DEFENCE))
    }

    fn lights(&mut self, sequence: &Sequence, choice: &Choice, count: u32) -> Vec<Sent> {
        let prepared = self.prepared;
        let sample = |i| prepared.emitters.sample(&prepared.scene, choice, Part::Any, sequence.point(0, i));
        (0..count).filter_map(sample).map(|light| self.judge(&light, false)).collect()
    }

    /// The virtual lights of some light paths.
    fn walks(&mut self, sequence: &Sequence, aims: &Aims, most: u32) -> Flown {
        let mut flown = Flown::default();
        while flown.paths < most && flown.sent.len() < MOST_VPLS {
            let mut path = LightPath::start(self.prepared, aims, Part::Any, sequence, flown.paths);
            let mut passed = false;
            while let Some(vpl) = path.next_vpl(self.prepared, self.quality.max_length) {
                flown.sent.push(self.judge(&vpl, path.passed_glass));
                if path.passed_glass && !passed {
                    passed = true;
                    flown.pass_by_chance += path.natural;
                }
            }
            self.found.rays += path.rays;
            flown.paths += 1;
        }
        flown
    }

    fn judge(&mut self, vpl: &Vpl, passed_glass: bool) -> Sent {
        let mut rays = 0;
        let brings = self.found.brings(self.prepared, vpl, false, &mut self.scratch, &mut rays).amount;
        self.found.rays += rays;
        Sent { position: vpl.position, source: vpl.source, brings, passed_glass }
    }

    /// Finds the extent: from virtual lights as far as they will be kept.
    fn measure(&mut self, sent: &[Sent]) {
        let nobody_looks = self.found.points().is_empty();
        let typical = typical(&sent.iter().map(|vpl| vpl.brings).collect::<Vec<_>>());
        let weight = |vpl: &Sent| match nobody_looks {
            true => 1.0,
            false if typical > 0.0 => (vpl.brings / typical).min(1.0),
            false => 0.0,
        };
        let places: Vec<_> = sent.iter().map(|vpl| (vpl.position, weight(vpl))).filter(|(_, w)| *w > 0.0).collect();
        // Few tell little.
        if places.iter().map(|(_, weight)| weight).sum::<f32>() >= FEW {
            self.set_extent(spread(&places));
        }
    }

    fn set_extent(&mut self, median: Option<f32>) {
        if let Some(median) = median.filter(|median| *median > 0.0 && median.is_finite()) {
            self.found.set_extent((MEDIANS * median).min(2.0 * self.prepared.ball.radius), self.quality);
        }
    }

    /// Finds which emitters photons are of use from, and how many.
    fn photons(&mut self) {
        let sequence = self.sequence(5);
        let radius = self.quality.photon_radius * self.found.extent;
        // What lies beside the view is seen as far as photons are wide.
        let region = self.region.map(|seen| Ball { radius: seen.radius + radius, ..seen });
        let aims = Aims { entry: self.entry(region), ..self.fair() };
        let sharing = Sharing::new(self.quality, self.quality.photons, radius);
        let light_choice = Arc::clone(&self.found.light_choice);
        let ways = Ways { sharing, photons: &aims, samples: &light_choice };
        let place = |ball: Ball, at: Vec3| at.distance_squared(ball.centre) <= ball.radius * ball.radius;
        let mut landed = vec![0.0; self.class_count];
        let mut met = Vec::new();
        let mut rays_find_all = true;
        let mut arrived = 0;
        for i in 0..PHOTONS {
            let flight = caustics::fly(self.prepared, ways, &sequence, i);
            self.found.rays += flight.rays;
            let Some(Landed { photon, density, aimed }) = flight.landed else { continue };
            if region.is_some_and(|region| !place(region, photon.position)) {
                continue;
            }
            arrived += 1;
            let flux = photon.flux.max_element();
            landed[self.classes[self.prepared.emitters.emitter_of(flight.source)] as usize] += f64::from(flux);
            match density {
                Some(density) => met.push((flux, density, aimed)),
                None => rays_find_all = false,
            }
        }
        self.found.photon_aims = Arc::new(Aims { choice: self.choice_among(&landed), ..aims });
        let least = (self.quality.photons / PHOTONS_DEFENCE).max(1);
        if !rays_find_all || !self.quality.indirect_caustics {
            self.found.photons = if arrived > 0 { self.quality.photons } else { least };
            return;
        }
        if arrived < FEW_PHOTONS {
            self.found.photons = least;
            return;
        }
        if self.found.points().is_empty() {
            return;
        }
        // The second moment of what a ray finds, over all that is lit, and what photons leave of it (caustics).
        let (extent, wanted) = (self.found.extent, self.irradiance);
        let left = |photons: u32| {
            let merges = photons as f32 * (PI * radius) * (PI * radius);
            let moment = |(flux, density, aimed): &(f32, f32, f32)| {
                PI * flux * flux * density / (1.0 + merges * density + aimed)
            };
            met.iter().map(moment).sum::<f32>() / (PHOTONS as f32 * extent * extent * wanted * wanted)
        };
        let mut photons = least;
        while photons < self.quality.photons && left(photons) > CAUSTICS_ERROR {
            photons = (photons * 2).min(self.quality.photons);
        }
        self.found.photons = photons;
    }
}

/// Lights, weighed, that tell nothing.
const FEW: f32 = 8.0;
/// Places that distances are taken of, at most.
const PLACES: usize = 1024;

/// The median of distances between two of some weighed places: of each and three others, all over the list.
fn spread(places: &[(Vec3, f32)]) -> Option<f32> {
    let step = places.len().div_ceil(PLACES).max(1);
    let places: Vec<_> = places.iter().step_by(step).collect();
    let n = places.len();
    let mut pairs = Vec::with_capacity(3 * n);
    for apart in [n / 2, n / 3, n / 5].map(|apart| apart.max(1)) {
        for (i, (a, weight)) in places.iter().enumerate() {
            let (b, other) = places[(i + apart) % n];
            pairs.push((a.distance(*b), weight * other));
        }
    }
    pairs.sort_by(|a, b| a.0.total_cmp(&b.0));
    let half = pairs.iter().map(|(_, weight)| weight).sum::<f32>() * 0.5;
    let mut sum = 0.0;
    pairs
        .iter()
        .find(|(_, weight)| {
            sum += weight;
            sum >= half
        })
        .map(|(distance, _)| *distance)
}

/// A ball that holds most of the points, and some of what is around them.
fn ball_of(points: &[Point]) -> Option<Ball> {
    let quantile = |mut numbers: Vec<f32>, q: usize| {
        numbers.sort_by(f32::total_cmp);
        numbers.get(numbers.len() * q / 100).copied()
    };
    let middle = |axis: usize| quantile(points.iter().map(|point| point.position[axis]).collect(), 50);
    let centre = Vec3::new(middle(0)?, middle(1)?, middle(2)?);
    let radius = quantile(points.iter().map(|point| point.position.distance(centre)).collect(), 75)? * 1.5;
    Some(Ball { centre, radius })
}

/// Which emitters a pilot judges together, by number of the class: each by itself where they are few; else neighbours, cut
/// by medians. Each that is afar is by itself.
pub fn classes(emitters: &Emitters) -> Vec<u32> {
    let mut classes = vec![0; emitters.count()];
    let near: Vec<_> = (0..emitters.count()).filter_map(|emitter| Some((emitter, emitters.place(emitter)?))).collect();
    let mut parts = vec![near];
    while parts.len() < MOST_CLASSES {
        let Some(largest) = (0..parts.len()).rev().max_by_key(|i| parts[*i].len()).filter(|i| parts[*i].len() > 1)
        else {
            break;
        };
        let mut part = std::mem::take(&mut parts[largest]);
        let low = part.iter().fold(Vec3::INFINITY, |low, (_, place)| low.min(*place));
        let high = part.iter().fold(Vec3::NEG_INFINITY, |high, (_, place)| high.max(*place));
        let axis = (high - low).max_position();
        part.sort_by(|a, b| a.1[axis].total_cmp(&b.1[axis]));
        parts.push(part.split_off(part.len() / 2));
        parts[largest] = part;
    }
    parts.retain(|part| !part.is_empty());
    let afar = (0..emitters.count()).filter(|emitter| emitters.place(*emitter).is_none());
    let apart = afar.map(|emitter| vec![(emitter, Vec3::ZERO)]);
    for (class, part) in (0..).zip(parts.into_iter().chain(apart)) {
        for (emitter, _) in part {
            classes[emitter] = class;
        }
    }
    classes
}

#[cfg(test)]
mod tests {
    use protocol::question::Quality;
    use scenes::{Camera, Colour, Environment, Material, Mesh, Object, Scene, Surface};

    use super::*;

    /// A floor, a wall and a lamp over them, all of a size; perhaps a sky. Far away, out of sight, perhaps a floor of its own
    /// for another lamp.
    fn scene(environment: Environment, elsewhere: bool) -> Scene {
        let mut mesh = Mesh::default();
        let mut quad = |corner: Vec3, u: Vec3, v: Vec3, material: u32| {
            let first = mesh.positions.len() as u32;
            mesh.positions.extend([corner, corner + u, corner + u + v, corner + v]);
            mesh.triangles.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
            mesh.materials.extend([material; 2]);
        };
        quad(Vec3::new(-1.0, 0.0, -1.0), Vec3::Z * 2.0, Vec3::X * 2.0, 0);
        quad(Vec3::new(-1.0, 0.0, -1.0), Vec3::X * 2.0, Vec3::Y * 2.0, 0);
        quad(Vec3::new(-0.2, 1.5, -0.2), Vec3::X * 0.4, Vec3::Z * 0.4, 1);
        if elsewhere {
            quad(Vec3::new(400.0, -50.0, -20.0), Vec3::Z * 40.0, Vec3::X * 40.0, 0);
            quad(Vec3::new(405.0, -30.0, -10.0), Vec3::X * 20.0, Vec3::Z * 20.0, 2);
        }
        let lamp = |radiance| Material {
            emission: Colour::plain(Vec3::splat(radiance)),
            ..Material::diffuse("lamp", Vec3::ZERO)
        };
        Scene {
            meshes: vec![mesh.into()],
            objects: vec![Object::fixed("all", 0)],
            materials: vec![Material::diffuse("wall", Vec3::splat(0.7)), lamp(10.0), lamp(10.0)],
            environment,
            camera: Camera {
                origin: Vec3::new(0.0, 1.0, 2.5),
                target: Vec3::new(0.0, 0.6, -0.5),
                fov_y_deg: 40.0,
                width: 32,
                height: 32,
                ..Camera::default()
            },
            ..Scene::default()
        }
    }

    fn importance(scene: &Scene, quality: &Quality) -> Importance {
        Importance::new(&Prepared::new(scene.clone()), &scene.camera, quality)
    }

    #[test]
    fn what_is_out_of_sight_has_no_part_in_the_extent() {
        let quality = Quality::default();
        let (alone, beside) = (scene(Environment::Black, false), scene(Environment::Black, true));
        let extents = [&alone, &beside].map(|scene| importance(scene, &quality).extent);
        assert!((extents[1] / extents[0] - 1.0).abs() < 0.2, "{extents:?}");
        let whole = 2.0 * Prepared::new(beside).ball.radius;
        assert!(whole > 100.0 * extents[1], "{whole} in all");
    }

    #[test]
    fn lamps_are_chosen_by_what_they_bring_and_none_is_left_out() {
        let found = importance(&scene(Environment::Black, true), &Quality::default());
        for choice in [&found.light_choice, &found.walk_aims.choice] {
            let shares = choice.shares();
            assert!(shares[0] > 0.9 && shares[1] > 0.01, "{shares:?}, and the second has 2500 times the first's power");
        }
        let nobody = Quality { importance: false, ..Quality::default() };
        let found = importance(&scene(Environment::Black, true), &nobody);
        assert!(found.light_choice.shares()[1] > 0.8, "without a camera, by power");
    }

    #[test]
    fn virtual_lights_are_few_where_they_bring_nothing() {
        let plan = |keep: usize| {
            let mut scene = scene(Environment::Constant(Vec3::ONE), false);
            let mut mesh = (*scene.meshes[0]).clone();
            mesh.triangles.truncate(keep);
            mesh.materials.truncate(keep);
            scene.meshes[0] = mesh.into();
            importance(&scene, &Quality::default()).walks
        };
        let [alone, with_wall] = [plan(2), plan(4)].map(|plan| plan.candidates as f32 * plan.share);
        assert!(alone <= 0.25 * with_wall, "paths: {alone} for a floor alone, {with_wall} beside a wall");
    }

    #[test]
    fn photons_are_few_where_none_arrives() {
        let quality = Quality { photons: 1600, ..Quality::default() };
        let with_mirror = |mut scene: Scene, triangle: usize| {
            let mut mesh = (*scene.meshes[0]).clone();
            mesh.materials[triangle] = scene.materials.len() as u32;
            scene.meshes[0] = mesh.into();
            let surface = Surface::Mirror { reflectance: Vec3::ONE };
            scene.materials.push(Material { surface, ..Material::diffuse("mirror", Vec3::ZERO) });
            scene
        };
        // A mirror on the wall sends light to the floor; on the floor far away, to nothing that is seen.
        let near = with_mirror(scene(Environment::Black, true), 2);
        let far = with_mirror(scene(Environment::Black, true), 6);
        let few = importance(&far, &quality).photons;
        assert_eq!(few, 100);
        assert!(importance(&near, &Quality { indirect_caustics: false, ..quality }).photons == 1600);
        assert!((100..=1600).contains(&importance(&near, &quality).photons));
    }

    #[test]
    fn the_median_of_distances_is_that_of_most() {
        let row: Vec<_> = (0..100).map(|i| (Vec3::X * i as f32, 1.0)).collect();
        let mut with_outliers = row.clone();
        with_outliers.extend((0..5).map(|i| (Vec3::Y * 1e6 * i as f32, 1.0)));
        let [plain, robust] = [&row, &with_outliers].map(|places| spread(places).expect("there are some"));
        assert!((20.0..60.0).contains(&plain) && (robust / plain - 1.0).abs() < 0.3, "{plain} and {robust}");
        assert_eq!(spread(&[]), None);
    }
}
