//! How much a lobe reflects of light that is the same from everywhere, for the path tracer: a table of its own, so that
//! what is wrong with [`crate::glossy`]'s shows.
//!
//! That one sums over facets that are visible, this one over all facets by their density D (Walter et al. 2007, eq. 20),
//! in double precision: `E(ω_o) = ∫ F G₂ (ω_o·m) / (cosθ_o cosθ_m) · D cosθ_m dω_m`. With Schlick's Fresnel term, E is
//! `F₀ A + B`. What is kept is how far A and B are from those of a smooth mirror.

use std::f64::consts::{FRAC_PI_2, PI};
use std::sync::OnceLock;

use glam::Vec3;
use scenes::Rgb;

/// Directional albedos of a lobe, and their mean by cosines.
pub struct Albedo {
    f0: Rgb,
    f90: f32,
    alpha: Place,
}

/// An entry, and how far it is to the next.
#[derive(Clone, Copy)]
struct Place {
    entry: usize,
    beyond: f64,
}

impl Albedo {
    /// Of a lobe with these reflectances at normal and at grazing incidence and this GGX α, 0.001..=1.
    pub fn new(f0: Rgb, f90: f32, alpha: f32) -> Self {
        let height = (libm::log(f64::from(alpha)) - LOWEST) / -LOWEST;
        Self { f0, f90, alpha: Place::on(height, ALPHAS) }
    }

    /// Towards a direction.
    pub fn towards(&self, cos: f32) -> Rgb {
        let cos = f64::from(cos).clamp(0.0, 1.0);
        self.of(self.alpha.mix(|alpha| towards(&row(alpha).entries, cos)))
    }

    /// Mean over the directions of a hemisphere, by their cosines.
    pub fn mean(&self) -> Rgb {
        self.of(self.alpha.mix(|alpha| row(alpha).mean))
    }

    /// The same of the product with another lobe's, of the reflectance of lacquer along the normal.
    pub fn mean_with(&self, lacquer: &Self) -> Rgb {
        self.of(lacquer.alpha.mix(|over| self.alpha.mix(|under| product(over, under))))
    }

    fn of(&self, Parts([a, b]): Parts) -> Rgb {
        self.f0 * a as f32 + Vec3::splat(self.f90 * b as f32)
    }
}

/// A and B.
#[derive(Clone, Copy, Default)]
struct Parts([f64; 2]);

impl Place {
    fn on(place: f64, steps: usize) -> Self {
        let place = place.clamp(0.0, 1.0) * steps as f64;
        let entry = (place as usize).min(steps - 1);
        Self { entry, beyond: place - entry as f64 }
    }

    fn mix(self, at: impl Fn(usize) -> Parts) -> Parts {
        let (Parts(p), Parts(q)) = (at(self.entry), at(self.entry + 1));
        Parts([0, 1].map(|k| p[k] + (q[k] - p[k]) * self.beyond))
    }
}

/// Steps along the axes: of ln α, and of the square root of the angle above the surface.
const ALPHAS: usize = 64;
const ANGLES: usize = 80;
/// ln of the smallest α.
const LOWEST: f64 = -6.907_755_278_982_137;

/// Albedos by angle, and their mean.
struct Row {
    entries: [Parts; ANGLES + 1],
    mean: Parts,
}

/// Constants, each made when it is first asked for: all of them take half a second, and few materials have more than two.
static ROWS: [OnceLock<Row>; ALPHAS + 1] = [const { OnceLock::new() }; ALPHAS + 1];

fn row(i: usize) -> &'static Row {
    ROWS[i].get_or_init(|| {
        let alpha = libm::exp(LOWEST * (1.0 - i as f64 / ALPHAS as f64));
        let entries = std::array::from_fn(|j| {
            let angle = (j as f64 / ANGLES as f64).powi(2) * FRAC_PI_2;
            let cos = libm::sin(angle).max(1e-5);
            let (Parts(rough), Parts(smooth)) = (lobe(alpha, cos, [128, 48]), smooth(cos));
            Parts([0, 1].map(|k| rough[k] - smooth[k]))
        });
        Row { entries, mean: mean(&entries) }
    })
}

/// A and B of a row, interpolated.
fn towards(entries: &[Parts; ANGLES + 1], cos: f64) -> Parts {
    let place = Place::on((libm::asin(cos) / FRAC_PI_2).sqrt(), ANGLES);
    let (Parts(more), Parts(smooth)) = (place.mix(|entry| entries[entry]), smooth(cos));
    Parts([0, 1].map(|k| smooth[k] + more[k]))
}

/// `2 ∫ E(μ) μ dμ` of a row as it is interpolated.
fn mean(entries: &[Parts; ANGLES + 1]) -> Parts {
    const STEPS: usize = 4000;
    let mut sum = [0.0; 2];
    for i in 0..STEPS {
        // Even in μ².
        let Parts(at) = towards(entries, ((i as f64 + 0.5) / STEPS as f64).sqrt());
        sum = [0, 1].map(|k| sum[k] + at[k] / STEPS as f64);
    }
    Parts(sum)
}

/// Reflectance of lacquer along the normal.
pub const LACQUER: f64 = 0.04;

/// `2 ∫ E(μ) A(μ) μ dμ` of two rows as they are interpolated, E being lacquer's, and with B.
fn product(lacquer: usize, under: usize) -> Parts {
    const STEPS: usize = 2000;
    static KNOWN: OnceLock<Vec<OnceLock<Parts>>> = OnceLock::new();
    let known = KNOWN.get_or_init(|| (0..(ALPHAS + 1).pow(2)).map(|_| OnceLock::new()).collect());
    *known[lacquer * (ALPHAS + 1) + under].get_or_init(|| {
        let (over, under) = (&row(lacquer).entries, &row(under).entries);
        let mut sum = [0.0; 2];
        for i in 0..STEPS {
            let cos = ((i as f64 + 0.5) / STEPS as f64).sqrt();
            let (Parts([a, b]), Parts(at)) = (towards(over, cos), towards(under, cos));
            sum = [0, 1].map(|k| sum[k] + (LACQUER * a + b) * at[k] / STEPS as f64);
        }
        Parts(sum)
    })
}

/// A and B of a smooth mirror.
fn smooth(cos: f64) -> Parts {
    let grazing = (1.0 - cos).powi(5);
    Parts([1.0 - grazing, grazing])
}

/// A and B by a sum over so many rings and sectors (of a half turn) of facets.
fn lobe(alpha: f64, cos: f64, [rings, sectors]: [usize; 2]) -> Parts {
    let sin = (1.0 - cos * cos).sqrt();
    // Smith's Λ, plus a half.
    let masking = |cos: f64| (1.0 + alpha * alpha * (1.0 / (cos * cos) - 1.0)).sqrt() / 2.0;
    let mut sum = [0.0; 2];
    for i in 0..rings {
        // D cosθ dω is even in tan²θ / (tan²θ + α²). By the square of the rest, so that the far tail is met as well.
        let rest = (i as f64 + 0.5) / rings as f64;
        let tan2 = alpha * alpha * (1.0 / (rest * rest) - 1.0);
        let cos_m = 1.0 / (1.0 + tan2).sqrt();
        let sin_m = tan2.sqrt() * cos_m;
        for j in 0..sectors {
            let met = sin * sin_m * libm::cos((j as f64 + 0.5) / sectors as f64 * PI) + cos * cos_m;
            let out = 2.0 * met * cos_m - cos;
            if met > 0.0 && out > 0.0 {
                let grazing = (1.0 - met.min(1.0)).powi(5);
                let passed = 2.0 * rest * met / (cos * cos_m * (masking(cos) + masking(out)));
                sum[0] += passed * (1.0 - grazing);
                sum[1] += passed * grazing;
            }
        }
    }
    Parts(sum.map(|sum| sum / (rings * sectors) as f64))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::glossy::{Fresnel, Glossy};

    const ALPHAS: [f32; 9] = [0.001, 0.0036, 0.01, 0.032, 0.073, 0.16, 0.3, 0.64, 1.0];
    const COSINES: [f32; 9] = [0.01, 0.035, 0.06, 0.1, 0.17, 0.3, 0.5, 0.75, 1.0];

    #[test]
    fn entries_in_between_are_what_a_finer_sum_gives() {
        for (alpha, cos) in ALPHAS.iter().flat_map(|alpha| COSINES.map(|cos| (*alpha, cos))) {
            let Parts([a, b]) = lobe(alpha.into(), cos.into(), [400, 200]);
            for f0 in [0.0_f32, 0.04, 1.0] {
                let found = f64::from(Albedo::new(Vec3::splat(f0), 1.0, alpha).towards(cos).x);
                let expected = a * f64::from(f0) + b;
                assert!((found - expected).abs() < 0.002, "α {alpha} cos {cos} F₀ {f0}: {found}, {expected}");
            }
        }
    }

    /// The two tables, made by different sums over different grids.
    #[test]
    fn both_renderers_know_the_same_albedo() {
        for (alpha, cos) in ALPHAS.iter().flat_map(|alpha| COSINES.map(|cos| (*alpha, cos))) {
            for (f0, amount) in [(0.04_f32, 1.0), (0.9, 1.0), (0.5, 0.3)] {
                let fresnel = Fresnel::of_index(f0).times(amount, Vec3::ONE);
                let glossy = Glossy::new(Vec3::ZERO, alpha.sqrt(), 0.0, fresnel);
                let one = Albedo::new(Vec3::splat(f0 * amount), amount, glossy.alpha()).towards(cos).x;
                let other = glossy.lobe_albedo(cos).x;
                assert!((one - other).abs() < 0.003, "α {alpha} cos {cos} F₀ {f0} × {amount}: {one}, {other}");
            }
        }
    }
}
