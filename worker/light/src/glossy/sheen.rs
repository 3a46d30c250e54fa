//! Sheen over a glossy surface: fibres that stand on it, as those of velvet and other cloth, or dust.
//!
//! A lobe of its own, Estevez and Kulla's ("Production Friendly Microfacet Sheen BRDF", 2017) as KHR_materials_sheen has it:
//! fibres that lie in all directions about the surface by Charlie's distribution, with a fit of the shadows that they cast on
//! each other. By that fit, short and orderly fibres would reflect more than comes at grazing angles. So the lobe is
//! multiplied by the reciprocal of that excess, of the direction for which it is greater, and reflects no more than all.
//!
//! With E_s, the lobe's directional albedo, `T(ω) = 1 − max(colour) E_s(ω)` passes, and what lies below counts as under a coat
//! ([`super::coat`]).

use std::f32::consts::PI;
use std::sync::OnceLock;

use glam::Vec3;
use scenes::Rgb;

use crate::warp;

/// Sheen at a point, textures looked up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sheen {
    /// Factor on the lobe, 0..1.
    pub colour: Rgb,
    /// Perceptual roughness; α is its square. Below [`ROUGHNESS_MIN`], nothing would be seen but at grazing angles.
    pub roughness: f32,
}

/// Smallest perceptual roughness.
pub const ROUGHNESS_MIN: f32 = 0.1;

impl Sheen {
    /// Of a colour (0..1) and a perceptual roughness.
    pub fn new(colour: Rgb, roughness: f32) -> Self {
        Self { colour: colour.clamp(Vec3::ZERO, Vec3::ONE), roughness: roughness.clamp(ROUGHNESS_MIN, 1.0) }
    }

    /// What its lobe reflects towards a direction of light that is the same from everywhere.
    pub fn albedo(&self, cos: f32) -> Rgb {
        self.colour * self.looked_up(cos, |entry| entry.albedo)
    }

    /// What gets through.
    pub fn passes(&self, cos: f32) -> f32 {
        1.0 - self.colour.max_element() * self.looked_up(cos, |entry| entry.albedo)
    }

    /// Value of its lobe, sr⁻¹, by the cosines between the normal and the half vector, the viewer and the light.
    pub fn value(&self, cos_h: f32, cos_o: f32, cos_i: f32) -> Rgb {
        let fibres = Fibres { alpha: self.roughness * self.roughness };
        let bound = self.looked_up(cos_o, |entry| entry.bound).min(self.looked_up(cos_i, |entry| entry.bound));
        self.colour * (bound * fibres.value(cos_h, [cos_o, fibres.shadow(cos_o)], [cos_i, fibres.shadow(cos_i)]))
    }

    fn looked_up(&self, cos: f32, of: impl Fn(&Entry) -> f32) -> f32 {
        let (upper, below) = split((self.roughness - ROUGHNESS_MIN) / (1.0 - ROUGHNESS_MIN), ROUGHNESSES);
        let (column, beside) = split(cos.clamp(0.0, 1.0).sqrt(), COSINES);
        let at = |i: usize| {
            let [near, far] = [column, column + 1].map(|column| of(&row(i)[column]));
            near + (far - near) * beside
        };
        let (above, under) = (at(upper), at(upper + 1));
        above + (under - above) * below
    }
}

/// A direction of any sheen, evenly over the hemisphere: at grazing angles, where most of it is, no other way finds as much.
pub fn direction(n: Vec3, [u, v]: [f32; 2]) -> Vec3 {
    let (s, t) = warp::frame(n);
    let (sin, cos) = warp::turn(v);
    let r = (1.0 - u * u).max(0.0).sqrt();
    (s * (r * cos) + t * (r * sin) + n * u).normalize()
}

/// Density of [`direction`], sr⁻¹.
pub const DENSITY: f32 = 0.5 / PI;

/// Charlie's fibres.
struct Fibres {
    alpha: f32,
}

impl Fibres {
    /// Value of the lobe by the extension's formulas; of viewer and light, their cosines and [`Self::shadow`]s.
    fn value(&self, cos_h: f32, [cos_o, shadow_o]: [f32; 2], [cos_i, shadow_i]: [f32; 2]) -> f32 {
        let sin2 = (1.0 - cos_h * cos_h).max(0.0);
        let density = (2.0 + 1.0 / self.alpha) * libm::powf(sin2, 0.5 / self.alpha) / (2.0 * PI);
        density / ((1.0 + shadow_o + shadow_i) * (4.0 * cos_o * cos_i))
    }

    /// Λ of a direction, as it was fitted (Estevez & Kulla 2017, equation 3).
    fn shadow(&self, cos: f32) -> f32 {
        let rest = (1.0 - self.alpha) * (1.0 - self.alpha);
        let mix = |p: f32, q: f32| p + (q - p) * rest;
        let [a, b, c] = [mix(21.5473, 25.3245), mix(3.82987, 3.32435), mix(0.19823, 0.16801)];
        let [d, e] = [mix(-1.97760, -1.27393), mix(-4.32054, -4.85967)];
        let fit = |x: f32| a / (1.0 + b * libm::powf(x, c)) + d * x + e;
        libm::expf(if cos < 0.5 { fit(cos) } else { 2.0 * fit(0.5) - fit(1.0 - cos) })
    }
}

/// Steps of the table's axes, roughness and the square root of the cosine; there is one entry more.
const ROUGHNESSES: usize = 24;
const COSINES: usize = 48;

/// Of white sheen of some roughness, towards a direction.
#[derive(Clone, Copy, Default)]
struct Entry {
    /// Factor that keeps the lobe from reflecting more than comes.
    bound: f32,
    /// What it then reflects of light that is the same from everywhere.
    albedo: f32,
}

/// Constants, each made when it is first asked for.
static ROWS: [OnceLock<[Entry; COSINES + 1]>; ROUGHNESSES + 1] = [const { OnceLock::new() }; ROUGHNESSES + 1];

fn row(i: usize) -> &'static [Entry; COSINES + 1] {
    ROWS[i].get_or_init(|| {
        let roughness = ROUGHNESS_MIN + (1.0 - ROUGHNESS_MIN) * i as f32 / ROUGHNESSES as f32;
        let fibres = Fibres { alpha: roughness * roughness };
        let free: [f32; COSINES + 1] = std::array::from_fn(|j| fibres.reflected(cosine(j), |_| 1.0));
        let bounds = free.map(|reflected| reflected.max(1.0).recip());
        let bound = |cos: f32| {
            let (column, beside) = split(cos.sqrt(), COSINES);
            bounds[column] + (bounds[column + 1] - bounds[column]) * beside
        };
        std::array::from_fn(|j| {
            let albedo = fibres.reflected(cosine(j), |cos| bounds[j].min(bound(cos)));
            Entry { bound: bounds[j], albedo: albedo.min(1.0) }
        })
    })
}

/// Of an entry; no direction lies in the surface.
fn cosine(entry: usize) -> f32 {
    let root = entry as f32 / COSINES as f32;
    (root * root).max(1e-4)
}

impl Fibres {
    /// What the lobe reflects towards a direction of light that is the same from everywhere, weighed by its cosine.
    fn reflected(&self, cos_o: f32, weight: impl Fn(f32) -> f32) -> f32 {
        const STEPS: [usize; 2] = [64, 32];
        let (sin_o, shadow_o) = ((1.0 - cos_o * cos_o).max(0.0).sqrt(), self.shadow(cos_o));
        let mut sum = 0.0;
        for i in 0..STEPS[0] {
            // By the root of the cosine, as light that grazes the surface counts most.
            let root = (i as f32 + 0.5) / STEPS[0] as f32;
            let cos_i = root * root;
            let (sin_i, shadow_i) = ((1.0 - cos_i * cos_i).sqrt(), self.shadow(cos_i));
            let mut ring = 0.0;
            for j in 0..STEPS[1] {
                // Of a half turn.
                let along = libm::cosf(PI * (j as f32 + 0.5) / STEPS[1] as f32);
                let length = (2.0 + 2.0 * (sin_o * sin_i * along + cos_o * cos_i)).max(1e-9).sqrt();
                ring += self.value((cos_o + cos_i) / length, [cos_o, shadow_o], [cos_i, shadow_i]);
            }
            sum += ring * weight(cos_i) * cos_i * 2.0 * root;
        }
        sum * 2.0 * PI / (STEPS[0] * STEPS[1]) as f32
    }
}

/// The entry before a place 0..1 on an axis, and how far it is to the next.
fn split(place: f32, steps: usize) -> (usize, f32) {
    let place = place * steps as f32;
    let entry = (place as usize).min(steps - 1);
    (entry, place - entry as f32)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The lobe by directions drawn round the normal, from no table but that of the bound.
    fn drawn(sheen: &Sheen, cos: f32) -> f32 {
        let to = Vec3::new((1.0 - cos * cos).sqrt(), 0.0, cos);
        let count = 1 << 16;
        let mut sum = 0.0;
        for i in 0..count {
            // More of those that graze the surface.
            let root = (i as f32 + 0.5) / count as f32;
            let turn = (crate::sample::mix(i) >> 8) as f32 / 16_777_216.0;
            let from = direction(Vec3::Z, [root * root, turn]);
            let value = sheen.value((to + from).normalize().z, cos, from.z).x;
            sum += f64::from(value * from.z * 2.0 * root / DENSITY);
        }
        (sum / f64::from(count)) as f32
    }

    #[test]
    fn the_lobe_reflects_what_the_table_says_and_no_more_than_all() {
        for roughness in [0.0, 0.12, 0.2, 0.3, 0.47, 0.7, 1.0] {
            let sheen = Sheen::new(Vec3::ONE, roughness);
            for cos in [0.005, 0.02, 0.07, 0.2, 0.45, 0.8, 1.0] {
                let (drawn, table) = (drawn(&sheen, cos), sheen.albedo(cos).x);
                assert!(drawn < 1.005 && (0.0..=1.0).contains(&table), "{roughness} {cos}: {drawn}, {table}");
                assert!((drawn - table).abs() < 6e-3, "roughness {roughness} cos {cos}: {drawn}, {table}");
            }
        }
    }

    /// Where the fit reflects less than all, the lobe is the extension's: sums of it in double precision, elsewhere.
    #[test]
    fn rough_sheen_is_as_it_was_fitted() {
        let expected = [(0.5, [0.8022, 0.5666, 0.2468, 0.0270]), (1.0, [0.9403, 0.7205, 0.4176, 0.1638])];
        for (roughness, albedos) in expected {
            let sheen = Sheen::new(Vec3::ONE, roughness);
            for (cos, albedo) in [0.01, 0.1, 0.4, 1.0].into_iter().zip(albedos) {
                assert_eq!(sheen.looked_up(cos, |entry| entry.bound), 1.0, "{roughness} {cos}");
                assert!((sheen.albedo(cos).x - albedo).abs() < 4e-3, "{roughness} {cos}: {}", sheen.albedo(cos).x);
            }
        }
    }
}
