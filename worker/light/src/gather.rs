//! Light arriving at the end points of a block of eye paths: virtual lights tested by shafts,
//! caustics looked up, and what compensates the bias of bounds.

use glam::Vec3;
use protocol::answer::Cost;
use scenes::Rgb;

use crate::bias_compensation::{BiasCompensation, Missing};
use crate::bvh::{ShaftScratch, Targets};
use crate::eye::{EndPoint, Gloss};
use crate::lobe::Shares;
use crate::photons::{Nearby, Photon};
use crate::prepared::Prepared;
use crate::sample::Sequence;
use crate::through_glass::Arriving;
use crate::vpl::{Gate, Gates, Shape, Vpl, blur};
use crate::walk::LightSet;

/// Light at one end point.
#[derive(Clone, Copy, Debug, Default)]
pub struct Gathered {
    /// Irradiance, W·m⁻².
    pub irradiance: Rgb,
    /// For a glossy surface, the same weighed by what its base admits.
    pub admitted: Rgb,
    /// Radiance reflected by the lobe towards the eye, less what is seen by rays that follow sharp ones.
    pub lobe: Rgb,
}

/// Memory between blocks; one per question. It changes time, never results.
#[derive(Default)]
pub struct Scratch {
    tests: Tests,
    irradiance: [Vec<f32>; 3],
}

impl Scratch {
    /// What [`each_light`] needs.
    pub fn tests(&mut self) -> &mut Tests {
        &mut self.tests
    }
}

/// Memory of [`each_light`].
#[derive(Default)]
pub struct Tests {
    shaft: ShaftScratch,
    lanes: Lanes,
    weights: Vec<f32>,
    wanted: Vec<u64>,
    visible: Vec<u64>,
}

/// A virtual light as some end points see it.
pub struct Beam<'a> {
    /// The light.
    pub vpl: &'a Vpl,
    /// Its place among the lights that are looked at.
    pub number: usize,
    /// The gate on it.
    pub gate: Gate,
    /// By end point: the gated geometry term times all that depends on direction, the light's strength left out. Of a
    /// glossy light only whether it is 0.
    pub weights: &'a mut Vec<f32>,
    /// Bit by bit, whether the end point sees it.
    pub visible: &'a [u64],
}

/// Positions and normals as structure of arrays, for the inner loop over a virtual light's targets.
///
/// Positions are on the surface: only rays start off it. The offset would take a tenth of the cosine of a
/// light 0.001° above a floor of two metres.
#[derive(Default)]
struct Lanes {
    position: [Vec<f32>; 3],
    normal: [Vec<f32>; 3],
    /// [`blur`] of each position.
    blur: Vec<f32>,
    /// Those where nothing but a sharp lobe reflects, and so little light counts.
    dark: Vec<usize>,
}

impl Lanes {
    fn load(&mut self, ends: &[EndPoint]) {
        self.blur.clear();
        self.blur.extend(ends.iter().map(|e| blur(e.at.position)));
        self.dark.clear();
        self.dark.extend((0..ends.len()).filter(|i| ends[*i].is_dark()));
        let coordinate = |v: Vec3, axis: usize| v.to_array()[axis];
        for axis in 0..3 {
            self.position[axis].clear();
            self.position[axis].extend(ends.iter().map(|e| coordinate(e.at.position, axis)));
            self.normal[axis].clear();
            self.normal[axis].extend(ends.iter().map(|e| coordinate(e.at.shading, axis)));
        }
    }
}

/// Virtual lights at all end points: adds irradiance and lobes in the order of the lights.
pub fn virtual_lights(
    prepared: &Prepared,
    lights: &[Vpl],
    (gates, shares): (Gates, &Shares),
    ends: &[EndPoint],
    scratch: &mut Scratch,
    sums: &mut [Gathered],
    cost: &mut Cost,
) {
    let any_glossy = ends.iter().any(|e| e.glossy.is_some()) || !prepared.may_skip();
    let Scratch { tests, irradiance } = scratch;
    for sum in irradiance.iter_mut() {
        sum.clear();
        sum.resize(ends.len(), 0.0);
    }
    each_light(prepared, lights, gates, ends, tests, cost, |beam| {
        let Beam { vpl, gate, weights, visible, .. } = beam;
        if any_glossy || matches!(vpl.shape, Shape::Glossy { .. }) {
            hide(visible, weights);
            add_to_any(vpl, (gate, shares), ends, weights, irradiance, sums);
        } else {
            add_visible(vpl.strength, visible, weights, irradiance);
        }
    });
    let [r, g, b] = irradiance;
    for (i, sum) in sums.iter_mut().enumerate() {
        sum.irradiance += Vec3::new(r[i], g[i], b[i]);
    }
}

/// Shows each of some virtual lights, in order, as all end points see it; but for those that no point could see if
/// nothing were between.
pub fn each_light(
    prepared: &Prepared,
    lights: &[Vpl],
    gates: Gates,
    ends: &[EndPoint],
    tests: &mut Tests,
    cost: &mut Cost,
    mut show: impl FnMut(Beam),
) {
    if ends.is_empty() {
        return;
    }
    let Tests { shaft, lanes, weights, wanted, visible } = tests;
    lanes.load(ends);
    let targets = Targets::new(ends.iter().map(|e| e.at.above()));
    visible.clear();
    visible.resize(ends.len().div_ceil(64), 0);
    for (number, vpl) in lights.iter().enumerate() {
        let gate = gates.of(vpl);
        weigh(vpl, gate, ends, lanes, weights);
        if vpl.depth > 0 {
            lanes.dark.iter().for_each(|i| weights[*i] = 0.0);
        }
        let count = weights.iter().filter(|w| **w > 0.0).count();
        if count == 0 {
            continue;
        }
        cost.shadow_rays += count as u64;
        note_wanted(weights, wanted);
        if vpl.shape == Shape::Distant {
            prepared.world.shade_along(vpl.normal, &targets, wanted, shaft, visible);
        } else {
            prepared.world.shade_wanted(vpl.position, &targets, wanted, shaft, visible);
        }
        show(Beam { vpl, number, gate, weights, visible });
    }
}

/// Irradiance that a light brings to an end point if nothing is between: what is added of it if nothing is.
pub fn unhidden(beam: &Beam, ends: &[EndPoint], i: usize) -> Rgb {
    match beam.vpl.shape {
        _ if beam.weights[i] <= 0.0 => Vec3::ZERO,
        Shape::Glossy { .. } => beam.vpl.irradiance(ends[i].at.position, ends[i].at.shading, beam.gate).0,
        _ => beam.vpl.strength * beam.weights[i],
    }
}

/// One bit for each target that a light can bring anything to.
fn note_wanted(weights: &[f32], wanted: &mut Vec<u64>) {
    wanted.clear();
    let word = |weights: &[f32]| weights.iter().rev().fold(0, |bits, w| bits << 1 | u64::from(*w > 0.0));
    wanted.extend(weights.chunks(64).map(word));
}

/// Geometry term (gated) times all that depends on direction, for each target; the strength is left out.
fn weigh(vpl: &Vpl, gate: Gate, ends: &[EndPoint], lanes: &Lanes, weights: &mut Vec<f32>) {
    weights.clear();
    match vpl.shape {
        Shape::Surface => {
            weights.resize(ends.len(), 0.0);
            surface_weights(vpl, gate, lanes, blur(vpl.position), weights);
        }
        Shape::Glossy { .. } | Shape::Point | Shape::Spot { .. } | Shape::Luminaire(_) | Shape::Distant => {
            let white = Vpl { strength: Vec3::ONE, ..vpl.clone() };
            weights.extend(ends.iter().map(|e| white.irradiance(e.at.position, e.at.shading, gate).0.max_element()));
        }
    }
}

/// Defines a function that runs a loop compiled for the widest vectors at hand: the same source and so
/// the same bits.
macro_rules! vectorised {
    ($(#[$doc:meta])* fn $name:ident($($argument:ident: $type:ty),*) = $kernel:ident) => {
        $(#[$doc])*
        fn $name($($argument: $type),*) {
            #[cfg(target_arch = "x86_64")]
            {
                #[target_feature(enable = "avx2")]
                fn wide($($argument: $type),*) {
                    $kernel($($argument),*);
                }
                if std::arch::is_x86_feature_detected!("avx2") {
                    // SAFETY: the machine has AVX2, as was just asked.
                    return unsafe { wide($($argument),*) };
                }
            }
            $kernel($($argument),*);
        }
    };
}

vectorised! {
    /// The weights of a light on a surface.
    fn surface_weights(vpl: &Vpl, gate: Gate, lanes: &Lanes, own: f32, weights: &mut [f32]) = surface_weights_gated
}

vectorised! {
    /// Takes the weight from those that are not visible, and adds `strength · weight` to the sums.
    fn add_visible(strength: Rgb, visible: &[u64], weights: &mut [f32], sums: &mut [Vec<f32>; 3]) = add_visible_any
}

#[inline(always)]
fn add_visible_any(strength: Rgb, visible: &[u64], weights: &mut [f32], sums: &mut [Vec<f32>; 3]) {
    hide(visible, weights);
    let n = weights.len();
    let [r, g, b] = sums.each_mut().map(|sum| &mut sum[..n]);
    for (i, weight) in weights.iter().enumerate() {
        r[i] += strength.x * weight;
        g[i] += strength.y * weight;
        b[i] += strength.z * weight;
    }
}

/// Takes the weight from those that are not visible.
#[inline(always)]
fn hide(visible: &[u64], weights: &mut [f32]) {
    for (weights, bits) in weights.chunks_mut(64).zip(visible) {
        for (i, weight) in weights.iter_mut().enumerate() {
            *weight *= (bits >> i & 1) as f32;
        }
    }
}

#[inline(always)]
fn surface_weights_gated(vpl: &Vpl, gate: Gate, lanes: &Lanes, own: f32, weights: &mut [f32]) {
    match gate {
        Gate::Open => surface_weights_by(vpl, |c, d2| Gate::Open.geometry(c, d2), lanes, own, weights),
        Gate::Clip { least } => {
            surface_weights_by(vpl, |c, d2| Gate::Clip { least }.geometry(c, d2), lanes, own, weights)
        }
        Gate::Bound { most } => {
            surface_weights_by(vpl, |c, d2| Gate::Bound { most }.geometry(c, d2), lanes, own, weights)
        }
        Gate::Smooth { middle } => {
            surface_weights_by(vpl, |c, d2| Gate::Smooth { middle }.geometry(c, d2), lanes, own, weights);
        }
    }
}

#[inline(always)]
fn surface_weights_by(vpl: &Vpl, geometry: impl Fn(f32, f32) -> f32, lanes: &Lanes, own: f32, weights: &mut [f32]) {
    let n = weights.len();
    let [x, y, z] = lanes.position.each_ref().map(|v| &v[..n]);
    let [nx, ny, nz] = lanes.normal.each_ref().map(|v| &v[..n]);
    let blurs = &lanes.blur[..n];
    for (i, weight) in weights.iter_mut().enumerate() {
        let (dx, dy, dz) = (vpl.position.x - x[i], vpl.position.y - y[i], vpl.position.z - z[i]);
        let d2 = dx * dx + dy * dy + dz * dz;
        let cos_x = (nx[i] * dx + ny[i] * dy + nz[i] * dz).max(0.0);
        let cos_y = (-(vpl.normal.x * dx + vpl.normal.y * dy + vpl.normal.z * dz)).max(0.0);
        // Cosines times d each, so their product is divided by d² once more.
        let g = geometry(cos_x * cos_y / d2, d2);
        // As [`crate::vpl::tiny`]; of each point by itself, so that it does not matter with which others it is lit.
        let reach = if blurs[i] > own { blurs[i] } else { own };
        *weight = if d2 > reach * reach { g } else { 0.0 };
    }
}

/// The general case: some end points are glossy, or the light is. Those that are neither get what
/// [`add_visible`] would give them, to the bit: what a pixel's neighbours are made of is none of its business.
fn add_to_any(
    vpl: &Vpl,
    (gate, shares): (Gate, &Shares),
    ends: &[EndPoint],
    weights: &[f32],
    plain: &mut [Vec<f32>; 3],
    sums: &mut [Gathered],
) {
    let scattered = matches!(vpl.shape, Shape::Glossy { .. });
    let strength = vpl.strength.to_array();
    for (i, end) in ends.iter().enumerate().filter(|(i, _)| weights[*i] > 0.0) {
        if scattered || end.glossy.is_some() {
            add_by_direction(vpl, (gate, shares), end, &mut sums[i]);
        } else {
            plain.iter_mut().zip(strength).for_each(|(sum, strength)| sum[i] += strength * weights[i]);
        }
    }
}

/// The material at the light, at the end point, or both, weighs by direction.
fn add_by_direction(vpl: &Vpl, (gate, shares): (Gate, &Shares), end: &EndPoint, sum: &mut Gathered) {
    let (place, normal) = (end.at.position, end.at.shading);
    let Some(gloss) = &end.glossy else {
        sum.irradiance += vpl.irradiance(place, normal, gate).0;
        return;
    };
    if !end.is_dark() {
        add_to_base(gloss, normal, vpl.irradiance(place, normal, gate), sum);
    }
    if gloss.lit {
        sum.lobe += gloss.throughput * shares.reflected(&gloss.material, normal, gloss.to, vpl, place, gate);
    }
}

/// Light of a given irradiance from one direction on the base of a glossy surface.
fn add_to_base(gloss: &Gloss, normal: Vec3, (irradiance, from): (Rgb, Vec3), sum: &mut Gathered) {
    sum.irradiance += irradiance;
    sum.admitted += irradiance * gloss.material.admitted(normal.dot(from).max(0.0));
}

/// Caustics at all end points.
pub fn caustics(set: &LightSet, ends: &[EndPoint], sums: &mut [Gathered], cost: &mut Cost) {
    cost.photon_queries += ends.len() as u64;
    let place = |end: &EndPoint| end.at.position;
    let low = ends.iter().map(place).fold(Vec3::INFINITY, Vec3::min);
    let high = ends.iter().map(place).fold(Vec3::NEG_INFINITY, Vec3::max);
    let photons = set.photons.around(low, high);
    if !photons.is_empty() {
        ends.iter().zip(sums).for_each(|(end, sum)| caustic(photons, end, sum));
    }
}

fn caustic(photons: Nearby, end: &EndPoint, sum: &mut Gathered) {
    match &end.glossy {
        None => sum.irradiance += photons.irradiance(end.at.position, end.at.smooth),
        Some(gloss) => {
            let (n, surface) = (end.at.shading, end.at.smooth);
            let admitted = |photon: &Photon| gloss.material.admitted(n.dot(photon.from).max(0.0));
            sum.irradiance += photons.irradiance(end.at.position, surface);
            sum.admitted += photons.gather(end.at.position, surface, admitted);
            let sharp = gloss.material.is_sharp();
            let lobe = |photon: &Photon| match sharp && !(gloss.lit && photon.shines_on) {
                true => Vec3::ZERO,
                false => gloss.material.lobe(n, gloss.to, photon.from),
            };
            sum.lobe += gloss.throughput * photons.gather(end.at.position, surface, lobe);
        }
    }
}

/// What the bound cut off at an end point, what lobes have from rays that follow them, and light samples behind glass.
pub fn bias_compensation(
    estimate: &BiasCompensation,
    end: &EndPoint,
    sequence: &Sequence,
    first_group: u32,
    index: u32,
    sum: &mut Gathered,
    cost: &mut Cost,
) {
    let by_lobe = end.glossy.as_ref().filter(|gloss| estimate.follows(&gloss.material));
    if let Some(gloss) = by_lobe {
        let radiance = estimate.along_lobe(&end.at, gloss, sequence, first_group, index, cost);
        sum.lobe += gloss.throughput * radiance;
    }
    let mut add = |Arriving { from, irradiance, bodiless }, lobe: bool| match &end.glossy {
        None => sum.irradiance += irradiance,
        Some(gloss) => {
            if !end.is_dark() {
                add_to_base(gloss, end.at.shading, (irradiance, from), sum);
            }
            if lobe && (!gloss.material.is_sharp() || bodiless && gloss.lit) {
                sum.lobe += gloss.throughput * gloss.material.lobe(end.at.shading, gloss.to, from) * irradiance;
            }
        }
    };
    // Where black, or dark as what lies under a metal's lobe, nothing of it would be seen.
    let black = end.weight == Vec3::ZERO && (by_lobe.is_some() || end.is_dark());
    if !black && let Some(Missing { from, radiance, .. }) = estimate.sample(&end.at, sequence, first_group, index, cost)
    {
        let irradiance = radiance * std::f32::consts::PI;
        add(Arriving { from, irradiance, bodiless: false }, by_lobe.is_none());
    }
    // What finds it by lobe and by base is the same there: photons, rays by their share, and these.
    estimate.through_glass(&end.at, sequence, first_group, index, cost, |light| add(light, true));
}
