//! Where caustics come from: balls around the specular parts of a scene, to aim photons at.

use glam::Vec3;
use scenes::{Dielectric, Gloss, Scene, Surface};

use crate::vpl::{Shape, Vpl};
use crate::warp;

/// A ball that encloses something, scene space.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Ball {
    /// Middle.
    pub centre: Vec3,
    /// Greater than 0, unless it encloses nothing.
    pub radius: f32,
}

/// All specular surfaces of a scene, enclosed in few balls.
#[derive(Clone, Debug, Default)]
pub struct Targets {
    balls: Vec<Ball>,
}

/// More balls fit closer but cost time at every photon vertex.
const MOST_BALLS: usize = 16;

impl Targets {
    /// Finds the specular triangles of visible objects and splits them by midpoints of the longest
    /// axis until balls no longer get smaller or [`MOST_BALLS`] are made.
    pub fn new(scene: &Scene) -> Self {
        Self::among(scene, |surface| match surface {
            Surface::Mirror { .. } | Surface::Dielectric(_) | Surface::Glazed { .. } => true,
            Surface::Glossy(Gloss { roughness, coat, .. }) => scenes::needs::has_sharp_lobe(roughness, coat.as_ref()),
            Surface::Diffuse { .. } | Surface::Translucent { .. } => false,
        })
    }

    /// The same of clear glass alone.
    pub fn of_clear_glass(scene: &Scene) -> Self {
        Self::among(scene, |surface| surface.glass().is_some_and(Dielectric::may_be_clear))
    }

    fn among(scene: &Scene, is_meant: impl Fn(&Surface) -> bool) -> Self {
        let meant: Vec<bool> = scene.materials.iter().map(|material| is_meant(&material.surface)).collect();
        let mut triangles = Vec::new();
        for (number, object) in scene.objects.iter().enumerate().filter(|(_, o)| o.visible) {
            let mesh = &scene.meshes[object.mesh as usize];
            for triangle in scene.triangles(number) {
                if meant[scene.material_of(number, triangle) as usize] {
                    triangles.push(
                        mesh.triangles[triangle].map(|v| object.scene_from_object.point(mesh.positions[v as usize])),
                    );
                }
            }
        }
        if triangles.is_empty() {
            return Self::default();
        }
        let mut parts = vec![triangles];
        while parts.len() < MOST_BALLS {
            // Split the largest ball that can be split with profit.
            let Some((index, [left, right])) = (0..parts.len())
                .filter_map(|i| Some((i, split(&parts[i])?)))
                .max_by(|(a, _), (b, _)| enclose(&parts[*a]).radius.total_cmp(&enclose(&parts[*b]).radius))
            else {
                break;
            };
            parts[index] = left;
            parts.push(right);
        }
        Self { balls: parts.iter().map(|part| enclose(part)).collect() }
    }

    /// All balls.
    pub fn balls(&self) -> &[Ball] {
        &self.balls
    }

    /// The distance beyond which a ray can meet nothing specular; 0 if it passes all by.
    pub fn far_end(&self, origin: Vec3, direction: Vec3) -> f32 {
        let mut far = 0.0_f32;
        for ball in &self.balls {
            let offset = ball.centre - origin;
            let along = offset.dot(direction);
            let half = ball.radius * ball.radius - (offset - direction * along).length_squared();
            if half > 0.0 {
                far = far.max(along + half.sqrt());
            }
        }
        far
    }

    /// The balls as cones from a point light or surface point; those behind a surface are left out.
    pub fn seen_from(&self, light: &Vpl) -> Cones {
        let mut cones = Cones::default();
        for ball in self.balls.iter().filter(|ball| !ball.is_behind(light)) {
            cones.add(Cone::around(ball, light.position));
        }
        cones
    }

    /// What is looked at from a light within a ball, or close to one: to such a light all is specular, and says nothing of
    /// where its light is wanted.
    pub fn view_from_within(&self, light: &Vpl, view: &Ball) -> Option<Nested> {
        let is_within = self.balls.iter().any(|ball| Cone::around(ball, light.position).is_all());
        let cone = Cone::around(view, light.position);
        (is_within && !cone.is_all() && !view.is_behind(light)).then(|| Nested::around(cone))
    }
}

impl Ball {
    /// A light on a surface sends none of its light there.
    fn is_behind(&self, light: &Vpl) -> bool {
        let is_one_sided = matches!(light.shape, Shape::Surface | Shape::Glossy { .. });
        is_one_sided && (self.centre - light.position).dot(light.normal) < -self.radius
    }
}

#[derive(Clone, Copy, Debug, Default)]
struct Cone {
    axis: Vec3,
    one_minus_cos: f32,
}

impl Cone {
    /// From a place.
    fn around(ball: &Ball, place: Vec3) -> Self {
        let offset = ball.centre - place;
        let sin2 = ball.radius * ball.radius / offset.length_squared().max(f32::MIN_POSITIVE);
        // From within a ball, or close to it, all directions may be the right ones.
        let one_minus_cos = if sin2 < 0.99 { sin2 / (1.0 + (1.0 - sin2).sqrt()) } else { 2.0 };
        Self { axis: offset.normalize_or(Vec3::Z), one_minus_cos }
    }

    /// It holds all directions.
    fn is_all(&self) -> bool {
        self.one_minus_cos >= 2.0
    }
}

/// Directions about an axis: those of a cone, of one twice as wide, and so on, all as often. So what bends light on its way
/// to what the first one holds may bend it little or much: whatever comes there has left by a density that falls no faster
/// than with the square of the angle. Some go the other way: what a wall there reflects comes back.
#[derive(Clone, Copy, Debug)]
pub struct Nested {
    least: Cone,
    count: u32,
}

/// How often the other way is taken.
const BACKWARDS: f32 = 0.25;

impl Nested {
    fn around(least: Cone) -> Self {
        let cone = |i: i32| least.one_minus_cos * libm::exp2f(2.0 * i as f32);
        let count = (1..32).find(|i| cone(*i) > 1.0).unwrap_or(1) as u32;
        Self { least, count }
    }

    /// 1 − cos of a cone.
    fn width(&self, number: u32) -> f32 {
        self.least.one_minus_cos * (1_u64 << (2 * number)) as f32
    }

    /// A direction.
    pub fn sample(&self, choice: f32, u: [f32; 2]) -> Vec3 {
        let (side, rest) = match choice < BACKWARDS {
            true => (-1.0, choice / BACKWARDS),
            false => (1.0, (choice - BACKWARDS) / (1.0 - BACKWARDS)),
        };
        let number = ((rest * self.count as f32) as u32).min(self.count - 1);
        warp::cone(self.least.axis * side, self.width(number), u)
    }

    /// Density of [`Self::sample`], sr⁻¹.
    pub fn density(&self, direction: Vec3) -> f32 {
        let about = |axis: Vec3| -> f32 {
            let drop = (direction - axis).length_squared() * 0.5;
            let widths = (0..self.count).map(|number| self.width(number));
            widths.filter(|width| drop <= width * (1.0 + 1e-5) + 1e-12).map(warp::cone_density).sum()
        };
        let (there, back) = (about(self.least.axis), about(-self.least.axis));
        ((1.0 - BACKWARDS) * there + BACKWARDS * back) / self.count as f32
    }
}

/// A mixture of cones, each weighted by its solid angle: inside disjoint cones the density is uniform.
#[derive(Clone, Copy, Debug, Default)]
pub struct Cones {
    cones: [Cone; MOST_BALLS],
    count: usize,
    total: f32,
}

impl Cones {
    fn add(&mut self, cone: Cone) {
        if self.count < MOST_BALLS {
            self.cones[self.count] = cone;
            self.count += 1;
            self.total += cone.one_minus_cos;
        }
    }

    /// Nothing specular can be seen.
    pub fn is_empty(&self) -> bool {
        self.count == 0
    }

    /// A direction into one of the cones.
    pub fn sample(&self, choice: f32, u: [f32; 2]) -> Vec3 {
        let mut rest = choice * self.total;
        let mut chosen = self.cones[0];
        for cone in &self.cones[..self.count] {
            chosen = *cone;
            if rest < cone.one_minus_cos {
                break;
            }
            rest -= cone.one_minus_cos;
        }
        warp::cone(chosen.axis, chosen.one_minus_cos, u)
    }

    /// Density of [`Self::sample`], sr⁻¹.
    pub fn density(&self, direction: Vec3) -> f32 {
        let mut inside = 0;
        for cone in &self.cones[..self.count] {
            // 1 − cos from the chord, which keeps the precision of narrow cones.
            let drop = (direction - cone.axis).length_squared() * 0.5;
            inside += u32::from(drop <= cone.one_minus_cos * (1.0 + 1e-5) + 1e-12);
        }
        // Σ (w_i / total) · 1/(2π w_i) over the cones that hold the direction
        if inside == 0 { 0.0 } else { inside as f32 * warp::cone_density(self.total) }
    }
}

fn corners(part: &[[Vec3; 3]]) -> impl Iterator<Item = Vec3> {
    part.iter().flatten().copied()
}

fn enclose(part: &[[Vec3; 3]]) -> Ball {
    let low = corners(part).fold(Vec3::INFINITY, Vec3::min);
    let high = corners(part).fold(Vec3::NEG_INFINITY, Vec3::max);
    let centre = (low + high) * 0.5;
    let radius = corners(part).map(|p| p.distance_squared(centre)).fold(0.0, f32::max).sqrt();
    Ball { centre, radius: (radius * 1.001).max(f32::MIN_POSITIVE) }
}

/// Splits at the middle of the longest axis; `None` if one side stays empty or the parts' balls are
/// not clearly smaller than the whole's.
fn split(part: &[[Vec3; 3]]) -> Option<[Vec<[Vec3; 3]>; 2]> {
    let low = corners(part).fold(Vec3::INFINITY, Vec3::min);
    let high = corners(part).fold(Vec3::NEG_INFINITY, Vec3::max);
    let size = high - low;
    let axis = if size.x >= size.y && size.x >= size.z {
        0
    } else if size.y >= size.z {
        1
    } else {
        2
    };
    let middle = (low[axis] + high[axis]) * 1.5;
    let (left, right): (Vec<_>, Vec<_>) = part.iter().partition(|t| t[0][axis] + t[1][axis] + t[2][axis] < middle);
    if left.is_empty() || right.is_empty() {
        return None;
    }
    let whole = enclose(part).radius;
    let (a, b) = (enclose(&left).radius, enclose(&right).radius);
    (a * a + b * b < 0.8 * whole * whole).then_some([left, right])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nested_cones_match_their_density() {
        let ball = Ball { centre: Vec3::new(0.0, 1.0, 3.0), radius: 0.2 };
        let nested = Nested::around(Cone::around(&ball, Vec3::ZERO));
        assert!(nested.count > 3, "{nested:?}");
        let random = |i: u32, d: u32| (crate::sample::mix(4 * i + d) >> 8) as f32 / 16_777_216.0;
        // ∫ density dω = 1 by its own samples: of each the inverse density is the solid angle it stands for.
        let n = 400_000_u32;
        let narrow = nested.least.one_minus_cos;
        let mut inside = 0.0;
        let mut solid_angle = 0.0;
        for i in 0..n {
            let w = nested.sample(random(i, 2), [random(i, 0), random(i, 1)]);
            let density = nested.density(w);
            assert!(density > 0.0, "every sample has a density");
            let is_inside = f64::from(u8::from((w - nested.least.axis).length_squared() * 0.5 <= narrow));
            inside += is_inside / f64::from(n);
            solid_angle += is_inside / f64::from(density * n as f32);
        }
        let expected = f64::from(2.0 * std::f32::consts::PI * narrow);
        assert!((solid_angle / expected - 1.0).abs() < 0.02, "{solid_angle} of {expected}");
        // The least cone, and its share of each of the wider ones.
        let shares: f64 = (0..nested.count).map(|i| 0.25_f64.powi(i as i32)).sum();
        let expected = f64::from(1.0 - BACKWARDS) * shares / f64::from(nested.count);
        assert!((inside / expected - 1.0).abs() < 0.02, "{inside} of {expected}");
    }

    #[test]
    fn aimed_directions_match_their_density() {
        let targets = Targets {
            balls: vec![
                Ball { centre: Vec3::new(0.0, 0.0, 3.0), radius: 1.0 },
                Ball { centre: Vec3::new(1.0, 0.0, 3.0), radius: 1.2 },
                Ball { centre: Vec3::new(0.0, 50.0, 0.0), radius: 0.01 },
            ],
        };
        let light = Vpl {
            position: Vec3::ZERO,
            normal: Vec3::Z,
            strength: Vec3::ONE,
            shape: Shape::Point,
            depth: 0,
            source: 0,
            density: None,
        };
        let cones = targets.seen_from(&light);
        // ∫ density dω = 1, estimated with the samples themselves over uniform directions.
        let n = 1_000_000_u32;
        let random = |i: u32, d: u32| (crate::sample::mix(4 * i + d) >> 8) as f32 / 16_777_216.0;
        let integral: f64 =
            (0..n).map(|i| f64::from(cones.density(warp::sphere([random(i, 0), random(i, 1)])))).sum::<f64>()
                / f64::from(n)
                * f64::from(4.0 * std::f32::consts::PI);
        assert!((integral - 1.0).abs() < 0.02, "{integral}");
        for i in 0..10_000 {
            let w = cones.sample(random(i, 2), [random(i, 0), random(i, 1)]);
            assert!(cones.density(w) > 0.0, "every sample has a density");
        }
        // Samples in the overlap are as frequent as the density says.
        let in_first = |w: Vec3| w.dot(Vec3::Z) > 1.0 - cones.cones[0].one_minus_cos;
        let drawn = (0..n).filter(|i| in_first(cones.sample(random(*i, 2), [random(*i, 0), random(*i, 1)]))).count();
        let expected: f64 = (0..n)
            .map(|i| warp::cone(Vec3::Z, cones.cones[0].one_minus_cos, [random(i, 0), random(i, 1)]))
            .map(|w| f64::from(cones.density(w)) * f64::from(2.0 * std::f32::consts::PI * cones.cones[0].one_minus_cos))
            .sum();
        assert!((drawn as f64 / expected - 1.0).abs() < 0.01, "{drawn} against {expected}");
    }
}
