//! Eye paths: from the eye through mirrors and glass to the surfaces that scatter light (IGI-1).
//!
//! The path splits **once**, at the first surface: one continuation for each component of its BSDF.
//! Later vertices choose one component at random.

use glam::{Mat3, Vec3};
use scenes::Rgb;
use scenes::camera::Lens;

use crate::bvh::{Hit, Ray};
use crate::chain;
use crate::glossy::Glossy;
use crate::prepared::Prepared;
use crate::sample::Sequence;
use crate::surface::{Bounce, Carries, Scatter, Surfel};

/// A surface point whose irradiance is asked for.
#[derive(Clone, Copy, Debug)]
pub struct EndPoint {
    /// Where; normals on the side the eye path arrived on.
    pub at: Surfel,
    /// Product of all reflectances, the end point's own included: radiance is `weight · E / π`.
    pub weight: Rgb,
    /// A glossy surface here: it weighs light by direction, and may have a rough lobe to be lit.
    pub glossy: Option<Gloss>,
    /// Length of the path.
    pub distance: f32,
    /// The normal, mirrored back through the mirrors on the way.
    pub seen_normal: Vec3,
}

/// The glossy part of an end point.
#[derive(Clone, Copy, Debug)]
pub struct Gloss {
    /// The material.
    pub material: Glossy,
    /// Unit direction back along the eye path.
    pub to: Vec3,
    /// Product of all reflectances before this surface: scales the lobe.
    pub throughput: Rgb,
}

/// What one eye path found.
#[derive(Clone, Copy, Debug, Default)]
pub struct Sight {
    /// Light of emitters and sky that is seen directly or through specular surfaces.
    pub emitted: Rgb,
    /// Where irradiance is needed; the first one is filtered, the second is not. A surface that only has a sharp lobe is
    /// never the first.
    pub ends: [Option<EndPoint>; 2],
    /// Segments traced.
    pub rays: u64,
}

/// Roulette begins after so many specular surfaces.
const FREE_BOUNCES: u32 = 6;

/// The greatest probability with which a sharp lobe is followed where it may also have light of its own.
const MOST_FOLLOWED: f32 = 0.75;

/// Dimensions: group 0 is the pixel, then one group a vertex for the first branch, then for the second.
const SECOND_BRANCH: u32 = 1 << 16;

/// Follows the eye path through a point of pixel (x, y).
pub fn look(prepared: &Prepared, lens: &Lens, pixel: [u32; 2], sequence: &Sequence, index: u32) -> Sight {
    let ray = ray(lens, pixel, sequence, index);
    see(prepared, &ray, prepared.world.closest(&ray), sequence, index)
}

/// Where the eye path through a point of pixel (x, y) begins.
pub fn ray(lens: &Lens, pixel: [u32; 2], sequence: &Sequence, index: u32) -> Ray {
    let u = sequence.first::<2>(0, index);
    let direction = lens.direction(pixel[0] as f32 + u[0], pixel[1] as f32 + u[1]);
    Ray { origin: lens.origin(), direction, t_max: f32::INFINITY }
}

/// Follows an eye path from its first hit.
pub fn see(prepared: &Prepared, ray: &Ray, hit: Option<Hit>, sequence: &Sequence, index: u32) -> Sight {
    let mut sight = Sight { rays: 1, ..Sight::default() };
    let direction = ray.direction;
    let Some(hit) = hit else {
        sight.emitted = prepared.emitters.sky_radiance(&prepared.scene, direction);
        return sight;
    };
    let at = prepared.surfel(ray, &hit);
    sight.emitted = at.emission(&prepared.scene);
    let here = Leg { throughput: Vec3::ONE, distance: hit.t, unfold: Mat3::IDENTITY };
    match at.scatter(&prepared.scene) {
        Scatter::Diffuse { albedo } => sight.ends[0] = here.end(at, albedo),
        Scatter::Glossy(material) => {
            let end = here.end_glossy(prepared, at, &material, -direction, 1.0);
            let mut beyond = None;
            if material.is_sharp()
                && let [_, _, a, b] = sequence.point(0, index)
                && let Some(bounce) = lobe(&at, direction, &material, [a, b])
            {
                beyond = sight.follow(prepared, here.after(&bounce, &at), bounce, sequence, index, 1);
            }
            sight.ends = match end {
                Some(end) if end.weight != Vec3::ZERO || !material.is_sharp() => [Some(end), beyond],
                end => [beyond, end],
            };
        }
        specular => {
            let mut branches = specular.branches(&at, direction, Carries::Radiance);
            // The stronger branch is the one that neighbouring pixels share: it goes first.
            if let [Some(a), Some(b)] = branches
                && b.weight.max_element() > a.weight.max_element()
            {
                branches.swap(0, 1);
            }
            for (bounce, group) in branches.into_iter().zip([1, SECOND_BRANCH]) {
                let Some(bounce) = bounce else { continue };
                let end = sight.follow(prepared, here.after(&bounce, &at), bounce, sequence, index, group);
                let slot = usize::from(sight.ends[0].is_some());
                if end.is_some() {
                    sight.ends[slot] = end;
                }
            }
        }
    }
    sight
}

/// What a path has gathered so far.
#[derive(Clone, Copy)]
struct Leg {
    throughput: Rgb,
    distance: f32,
    /// Takes normals from behind mirrors to where they seem to be.
    unfold: Mat3,
}

impl Leg {
    fn end(&self, at: Surfel, albedo: Rgb) -> Option<EndPoint> {
        let weight = self.throughput * albedo;
        (weight != Vec3::ZERO).then(|| self.end_point(at, weight, None))
    }

    /// The end at a glossy surface, which was chosen with probability `p`. A sharp lobe is followed
    /// elsewhere; then a surface without base is an end for lights without surface alone.
    fn end_glossy(&self, prepared: &Prepared, at: Surfel, material: &Glossy, to: Vec3, p: f32) -> Option<EndPoint> {
        let throughput = self.throughput / p;
        let weight = throughput * material.reflectance(at.shading.dot(to).max(0.0));
        let dark = weight == Vec3::ZERO && material.is_sharp() && !prepared.emitters.any_bodiless();
        let gloss = Gloss { material: *material, to, throughput };
        (!dark).then(|| self.end_point(at, weight, Some(gloss)))
    }

    fn end_point(&self, at: Surfel, weight: Rgb, glossy: Option<Gloss>) -> EndPoint {
        EndPoint { at, weight, glossy, distance: self.distance, seen_normal: self.unfold * at.shading }
    }

    fn after(&self, bounce: &Bounce, at: &Surfel) -> Self {
        let mut next = *self;
        next.throughput *= bounce.weight;
        if bounce.reflected {
            let m = at.shading;
            next.unfold = self.unfold
                * Mat3::from_cols(Vec3::X - m * (2.0 * m.x), Vec3::Y - m * (2.0 * m.y), Vec3::Z - m * (2.0 * m.z));
        }
        next
    }
}

impl Sight {
    /// Walks on from a specular surface until something scatters light or nothing is left.
    fn follow(
        &mut self,
        prepared: &Prepared,
        mut leg: Leg,
        mut bounce: Bounce,
        sequence: &Sequence,
        index: u32,
        first_group: u32,
    ) -> Option<EndPoint> {
        for vertex in 0..chain::LONGEST {
            let ray = Ray { origin: bounce.origin, direction: bounce.direction, t_max: f32::INFINITY };
            self.rays += 1;
            let Some(hit) = prepared.world.closest(&ray) else {
                self.emitted += leg.throughput * prepared.emitters.sky_radiance(&prepared.scene, ray.direction);
                return None;
            };
            let at = prepared.surfel(&ray, &hit);
            leg.distance += hit.t;
            self.emitted += leg.throughput * at.emission(&prepared.scene);
            let u = sequence.point(first_group + vertex, index);
            let next = match at.scatter(&prepared.scene) {
                Scatter::Diffuse { albedo } => return leg.end(at, albedo),
                Scatter::Glossy(material) if material.is_sharp() => {
                    let base = material.diffuse_albedo().max_element();
                    let shine = material.lobe_albedo(at.shading.dot(-ray.direction).max(0.0)).max_element();
                    let mut p = shine / (shine + base);
                    if prepared.emitters.any_bodiless() {
                        // The lobe is lit here as well, by lights that none of its rays can meet.
                        p = p.min(MOST_FOLLOWED);
                    }
                    if u[1] >= p {
                        return leg.end_glossy(prepared, at, &material, -ray.direction, 1.0 - p);
                    }
                    let bounce = lobe(&at, ray.direction, &material, [u[2], u[3]])?;
                    Bounce { weight: bounce.weight / p, ..bounce }
                }
                Scatter::Glossy(material) => return leg.end_glossy(prepared, at, &material, -ray.direction, 1.0),
                specular => specular.branch(&at, ray.direction, Carries::Radiance, u[1])?,
            };
            leg = leg.after(&next, &at);
            if vertex >= FREE_BOUNCES {
                let q = leg.throughput.max_element().clamp(0.0, chain::most(vertex));
                if u[0] >= q {
                    return None;
                }
                leg.throughput /= q;
            }
            bounce = next;
        }
        None
    }
}

/// One direction of a sharp lobe.
fn lobe(at: &Surfel, incoming: Vec3, material: &Glossy, u: [f32; 2]) -> Option<Bounce> {
    let (direction, weight) = material.sample(at.shading, -incoming, u)?;
    (at.geometric.dot(direction) > 0.0).then(|| Bounce {
        origin: at.off(direction),
        direction,
        weight,
        reflected: true,
    })
}
