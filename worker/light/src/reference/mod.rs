//! The reference: an unbiased path tracer (Kajiya 1986) to compare everything else with.
//!
//! At every surface it looks at one light (next-event estimation) and goes on in one direction; light
//! found both ways is weighed by the power heuristic (Veach & Guibas 1995). Roulette alone ends paths,
//! unless a longest path is asked for.
//!
//! **What it misses**: points, spots and suns in parallel rays cannot be hit. Straight, from frosted glass, through thin panes and in flat
//! mirrors they are aimed at ([`relayed`]); what clear solid glass or curved mirrors make of their light is not in its pictures, nor in what
//! their noise says. Whoever draws them says so ([`scenes::relays::Beyond`]).
//!
//! **What it shares** with the rest of this room: rays ([`crate::bvh`]), what a ray meets
//! ([`crate::surface::Surfel`]), textures, and the description of materials and lights. **What it does
//! not**: random numbers ([`philox`]), choice of lights ([`emitters`], [`relayed`], [`sky`]), values and densities of
//! materials ([`material`], [`rough`]), and any virtual light, bound, photon, filter or quantisation. So an error
//! in those shows as a difference.
//!
//! Its samples are independent and identically distributed, so that the mean of L and L² of a pixel tell
//! its error.

mod albedo;
mod emitters;
mod luminaire;
mod material;
mod nap;
mod nested;
mod philox;
mod relayed;
mod rough;
mod sky;
mod sun;

use glam::{DVec3, Vec3};
use protocol::answer::{Answer, Body, Cost, CostStage, Moments};
use protocol::question::Samples;
use scenes::Rgb;

use crate::bvh::{Hit, Ray};
use crate::prepared::Prepared;
use crate::surface::{Scatter, Surfel};
pub use emitters::Emitters;
use emitters::{Arrival, Chosen};
use material::{Material, Way};
use nested::Interior;
use philox::Stream;
use rough::{medium, transmitted};

/// Roulette begins after so many bounces: earlier, it costs more variance than time.
const FREE_BOUNCES: u32 = 5;
/// Paths so long end by chance even if nothing is lost on the way (mirrors face to face): 2¹⁶ bounces keep
/// 0.1 % of the light at reflectance 0.9999.
const LONG: u32 = 1 << 16;
/// Their chance to go on, each time.
const LONG_SURVIVAL: f32 = 0.999;

/// Draws the samples that are asked for.
pub fn answer(prepared: &Prepared, samples: &Samples, clock: &dyn Fn() -> u64) -> Answer {
    let start = clock();
    let mut moments = Moments::zero(samples.rect.len());
    let lens = samples.camera.lens();
    let mut tracer = Tracer {
        prepared,
        emitters: prepared.reference_emitters(),
        longest: samples.max_bounces,
        begins_in: Interior::at(prepared, lens.origin(), lens.direction(0.0, 0.0)),
        cost: Cost::default(),
    };
    for (index, pixel) in samples.rect.pixels().enumerate() {
        for number in samples.first..samples.first.saturating_add(samples.count) {
            let mut stream = Stream::new(samples.seed, pixel, number);
            let [x, y] = stream.pair();
            let direction = lens.direction(pixel[0] as f32 + x, pixel[1] as f32 + y);
            let mut origin = lens.origin();
            if lens.near() > 0.0 {
                origin += direction * lens.start(direction);
                tracer.begins_in = Interior::at(prepared, origin, direction);
            }
            let light = tracer.radiance(origin, direction, &mut stream);
            if light.is_finite() {
                moments.sum[index] += light;
                moments.squares[index] += light * light;
            } else {
                tracer.cost.dropped += 1;
            }
        }
    }
    let mut cost = tracer.cost;
    cost.spend(CostStage::Eye, clock().saturating_sub(start));
    Answer { body: Body::Moments(moments), cost }
}

struct Tracer<'a> {
    prepared: &'a Prepared,
    emitters: &'a Emitters,
    longest: Option<u32>,
    /// What the eye is in.
    begins_in: Interior,
    cost: Cost,
}

/// How a path came to where it is.
struct Leg {
    from: Vec3,
    /// Density of its direction; `None` if no light could have been chosen instead.
    density: Option<f32>,
    /// What absorbs light behind the surface that it left.
    medium: Option<Rgb>,
    /// Whether lamps were aimed at along its way; heeded for suns alone, the lamps that a path can hit as well.
    course: Course,
}

/// How a path has come to where it is, since it was last scattered.
#[derive(Clone, Copy, PartialEq)]
enum Course {
    /// It never was: no lamp was aimed at.
    FromEye,
    /// By nothing else.
    Straight,
    /// By thin panes and flat mirrors: lamps were aimed at by way of just these ([`relayed`]).
    Relayed,
    /// By something else as well, beyond which nobody aims.
    Astray,
}

impl Tracer<'_> {
    /// Radiance that arrives at a point from a direction: one sample of it.
    fn radiance(&mut self, origin: Vec3, direction: Vec3, stream: &mut Stream) -> DVec3 {
        let scene = &self.prepared.scene;
        let mut light = DVec3::ZERO;
        let mut throughput = Vec3::ONE;
        let mut squeezed = 1.0;
        let mut ray = Ray { origin, direction, t_max: f32::INFINITY };
        let mut interior = self.begins_in.clone();
        let nests = self.prepared.needs.nesting();
        let mut leg = Leg { from: origin, density: None, medium: None, course: Course::FromEye };
        for bounces in 0_u32.. {
            self.cost.eye_rays += 1;
            let Some(hit) = self.prepared.world.closest(&ray) else {
                let (radiance, density) = self.emitters.sky(scene, ray.direction);
                light += (throughput * radiance * leg.weight(density)).as_dvec3();
                for (radiance, density) in self.emitters.suns(ray.direction) {
                    light += (throughput * radiance * leg.weight_of_lamp(density)).as_dvec3();
                }
                break;
            };
            let at = self.prepared.surfel(&ray, &hit);
            throughput *= match interior.absorption(scene) {
                Some(absorption) => transmitted([Some(absorption), None], hit.t),
                None => transmitted([leg.medium, medium(scene, &at, -ray.direction)], hit.t),
            };
            let emitted = at.emission(scene);
            if emitted != Vec3::ZERO {
                let density = self.emitters.density(hit.object, hit.triangle, leg.from, at.position);
                light += (throughput * emitted * leg.weight(density)).as_dvec3();
            }
            if self.longest.is_some_and(|longest| bounces >= longest) {
                break;
            }
            let scatter = if nests { interior.scatter(scene, &at) } else { at.scatter(scene) };
            let material = Material::new(&at, scatter, ray.direction);
            if !material.is_specular() {
                // Light that arrives here was scattered once more.
                let left = self.longest.map_or(u32::MAX, |longest| longest - bounces - 1);
                light += (throughput * self.direct(&at, &material, left, stream)).as_dvec3();
            }
            let Some(way) = material.sample(stream) else { break };
            throughput *= way.weight;
            squeezed *= way.squeeze;
            if !survives(&mut throughput, squeezed, bounces, stream) {
                break;
            }
            interior.pass(scene, &at, way.direction);
            let course = if self.emitters.any_suns() { self.course(&leg, &hit, &at, &way) } else { leg.course };
            leg = Leg { from: at.position, density: way.density, medium: medium(scene, &at, way.direction), course };
            ray = Ray { origin: at.off(way.direction), direction: way.direction, t_max: f32::INFINITY };
        }
        light
    }

    /// How a path that goes on from a surface has come there since it was last scattered.
    fn course(&self, leg: &Leg, hit: &Hit, at: &Surfel, way: &Way) -> Course {
        if way.density.is_some() {
            return Course::Straight;
        }
        let passes = at.geometric.dot(way.direction) < 0.0;
        let is_aimed = match at.straight(&self.prepared.scene).0 {
            Scatter::Glass { thin: true, .. } if passes => true,
            Scatter::Glass { thin: true, .. } | Scatter::Mirror { .. } => {
                self.emitters.relays().plane_of(hit.object, hit.triangle).is_some()
            }
            _ => false,
        };
        match leg.course {
            Course::Straight | Course::Relayed if is_aimed => Course::Relayed,
            Course::FromEye => Course::FromEye,
            _ => Course::Astray,
        }
    }

    /// Light of one source, reflected towards the viewer; by way of at most `left` mirrors and panes if no path can hit
    /// the source.
    fn direct(&mut self, at: &Surfel, material: &Material, left: u32, stream: &mut Stream) -> Rgb {
        let scene = &self.prepared.scene;
        match self.emitters.sample(scene, at, stream) {
            None => Vec3::ZERO,
            Some(Chosen::Place(arrival)) => self.straight(&arrival, at, material),
            Some(Chosen::Bare(lamp, scale)) => {
                self.bare((&scene.lights[lamp as usize], scale), at, material, left, stream)
            }
        }
    }

    /// Light straight from a place that a path might hit as well.
    fn straight(&mut self, arrival: &Arrival, at: &Surfel, material: &Material) -> Rgb {
        let (value, density) = material.value(arrival.direction);
        if value == Vec3::ZERO {
            return Vec3::ZERO;
        }
        self.cost.shadow_rays += 1;
        let start = at.off(arrival.direction);
        let ray = Ray { origin: start, direction: arrival.direction, t_max: f32::INFINITY };
        let hidden = match arrival.origin {
            Some(end) => self.prepared.world.occluded(start, end),
            None => self.prepared.world.occluded_along(&ray),
        };
        if hidden {
            return Vec3::ZERO;
        }
        let inside = arrival.origin.map_or(Vec3::ONE, |end| {
            transmitted([medium(&self.prepared.scene, at, arrival.direction), None], end.distance(at.position))
        });
        let share = match arrival.origin {
            Some(end) if self.is_covered(at, &ray, end) => 1.0,
            _ => power_heuristic(arrival.density, density),
        };
        value * arrival.weight * inside * share
    }

    /// Whether a ray towards a place on an emitter, which nothing hides, finds another surface there, because of surfaces in
    /// one place the first is seen (an emitter in the very plane of a ceiling). Then chance never finds that light.
    fn is_covered(&mut self, at: &Surfel, ray: &Ray, end: Vec3) -> bool {
        self.cost.shadow_rays += 1;
        let Some(first) = self.prepared.world.closest(ray) else { return false };
        let place = ray.origin + ray.direction * first.t;
        let is_emitter = || self.emitters.density(first.object, first.triangle, at.position, place) > 0.0;
        first.t >= (end - ray.origin).dot(ray.direction) && !is_emitter()
    }
}

impl Leg {
    /// What light counts that this leg has found, and that would have been chosen with some density.
    fn weight(&self, chosen: f32) -> f32 {
        self.density.map_or(1.0, |mine| power_heuristic(mine, chosen))
    }

    /// The same, if it is a lamp's, which is aimed at by way of mirrors and panes as well.
    fn weight_of_lamp(&self, chosen: f32) -> f32 {
        if self.course == Course::Relayed { 0.0 } else { self.weight(chosen) }
    }
}

/// a² / (a² + b²), without overflow.
fn power_heuristic(a: f32, b: f32) -> f32 {
    let ratio = b / a;
    1.0 / (1.0 + ratio * ratio)
}

/// Roulette: what survives is brightened so that the mean stays. Its chance is the share of light that is
/// left: so the weight of long paths stays bounded however much the surfaces reflect.
fn survives(throughput: &mut Rgb, squeezed: f32, bounces: u32, stream: &mut Stream) -> bool {
    let left = throughput.max_element();
    if left <= 0.0 {
        return false;
    }
    let chance = match bounces {
        0..FREE_BOUNCES => return true,
        FREE_BOUNCES..LONG => (left / squeezed).min(1.0),
        LONG.. => (left / squeezed).min(LONG_SURVIVAL),
    };
    *throughput /= chance;
    stream.unit() < chance
}
