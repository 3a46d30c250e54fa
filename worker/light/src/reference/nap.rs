//! Sheen for the path tracer: the nap of cloth, by Estevez and Kulla's formulas (2017) as KHR_materials_sheen has them, written
//! down a second time and in double precision, with a table of its own.
//!
//! [`crate::glossy::Sheen`] says how it is meant.

use std::f64::consts::{FRAC_PI_2, PI};
use std::sync::OnceLock;

use glam::Vec3;
use scenes::Rgb;

use crate::glossy::Sheen;

/// A sheen of some roughness.
pub struct Nap {
    colour: Rgb,
    /// The inverse of α.
    sharpness: f64,
    /// Where its roughness is among the table's rows.
    place: f64,
}

impl Nap {
    /// Of sheen at a point.
    pub fn new(sheen: &Sheen) -> Self {
        let roughness = f64::from(sheen.roughness);
        let place = ((roughness - SHORTEST) / (1.0 - SHORTEST)).clamp(0.0, 1.0) * ROWS as f64;
        Self { colour: sheen.colour, sharpness: 1.0 / (roughness * roughness), place }
    }

    /// What it reflects of light that is the same from everywhere.
    pub fn albedo(&self, cos: f32) -> Rgb {
        self.colour * self.find(cos, |row| &row.reflected) as f32
    }

    /// What passes it.
    pub fn lets_through(&self, cos: f32) -> f32 {
        1.0 - self.albedo(cos).max_element()
    }

    /// Value of its lobe; unit vectors in the frame of the surface.
    pub fn value(&self, to: Vec3, from: Vec3) -> Rgb {
        let half = (to + from).normalize_or_zero();
        let across2 = f64::from(half.x * half.x + half.y * half.y);
        let excess = self.find(to.z, |row| &row.free).max(self.find(from.z, |row| &row.free)).max(1.0);
        let value = charlie(self.sharpness, across2, f64::from(to.z), f64::from(from.z)) / excess;
        self.colour * value as f32
    }

    fn find(&self, cos: f32, of: impl Fn(&Row) -> &[f64; ANGLES + 1]) -> f64 {
        let (above, share) = entry(self.place, ROWS);
        let at = |number: usize| along(of(row(number)), f64::from(cos));
        at(above) * (1.0 - share) + at(above + 1) * share
    }
}

/// Light is the same from everywhere: towards a direction, by angle above the surface.
struct Row {
    /// What the lobe would reflect as it was fitted.
    free: [f64; ANGLES + 1],
    /// What it reflects once nothing is too much.
    reflected: [f64; ANGLES + 1],
}

/// Least roughness, which counts for lesser ones too.
const SHORTEST: f64 = 0.1;
/// Steps of the table: of roughness, and of the square root of the angle above the surface.
const ROWS: usize = 30;
const ANGLES: usize = 60;

/// Each made when it is first asked for.
static KNOWN: [OnceLock<Row>; ROWS + 1] = [const { OnceLock::new() }; ROWS + 1];

fn row(number: usize) -> &'static Row {
    KNOWN[number].get_or_init(|| {
        let roughness = SHORTEST + (1.0 - SHORTEST) * number as f64 / ROWS as f64;
        let sharpness = 1.0 / (roughness * roughness);
        let cosines: [f64; ANGLES + 1] = std::array::from_fn(|entry| {
            let angle = (entry as f64 / ANGLES as f64).powi(2) * FRAC_PI_2;
            libm::sin(angle).max(1e-4)
        });
        let free = cosines.map(|cos| sum(sharpness, cos, |_| 1.0));
        let most = |cos: f64| along(&free, cos).max(1.0);
        let reflected = cosines.map(|cos| sum(sharpness, cos, |other| 1.0 / most(cos).max(most(other))));
        Row { free, reflected }
    })
}

/// What the lobe reflects towards an eye of light from everywhere, weighed by its cosine: over angles above the surface, evenly
/// in their square roots, and round the half turn.
fn sum(sharpness: f64, cos: f64, weight: impl Fn(f64) -> f64) -> f64 {
    const STEPS: [usize; 2] = [72, 40];
    let sin = (1.0 - cos * cos).max(0.0).sqrt();
    let mut sum = 0.0;
    for i in 0..STEPS[0] {
        let root = (i as f64 + 0.5) / STEPS[0] as f64;
        let (up, across) = libm::sincos(root * root * FRAC_PI_2);
        // cosθ dω = up · across dangle dφ
        let ring = up * across * 2.0 * root * FRAC_PI_2 * weight(up);
        for j in 0..STEPS[1] {
            let turn = (j as f64 + 0.5) / STEPS[1] as f64 * PI;
            let along = [sin + across * libm::cos(turn), across * libm::sin(turn), cos + up];
            let [x2, y2, z2] = along.map(|part| part * part);
            sum += ring * charlie(sharpness, (x2 + y2) / (x2 + y2 + z2), cos, up);
        }
    }
    sum * 2.0 * PI / (STEPS[0] * STEPS[1]) as f64
}

/// The lobe: D by the squared sine of the half vector, and V by both cosines.
fn charlie(sharpness: f64, across2: f64, o: f64, i: f64) -> f64 {
    let d = (2.0 + sharpness) / (2.0 * PI) * libm::pow(across2.max(0.0), sharpness / 2.0);
    d / (4.0 * o * i * (1.0 + lambda(sharpness, o) + lambda(sharpness, i)))
}

/// Smith's Λ by table 1 of the paper, for roughness 0 and 1, between which its numbers go by (1 − α)².
fn lambda(sharpness: f64, cos: f64) -> f64 {
    const ROUGH: [f64; 5] = [21.5473, 3.82987, 0.19823, -1.97760, -4.32054];
    const SHARP: [f64; 5] = [25.3245, 3.32435, 0.16801, -1.27393, -4.85967];
    let blend = (1.0 - 1.0 / sharpness).powi(2);
    let p: [f64; 5] = std::array::from_fn(|k| (1.0 - blend) * ROUGH[k] + blend * SHARP[k]);
    let l = |x: f64| p[0] / (1.0 + p[1] * libm::pow(x, p[2])) + p[3] * x + p[4];
    libm::exp(if cos < 0.5 { l(cos) } else { 2.0 * l(0.5) - l(1.0 - cos) })
}

/// Of a row, at a cosine.
fn along(row: &[f64; ANGLES + 1], cos: f64) -> f64 {
    let angle = libm::asin(cos.clamp(0.0, 1.0)) / FRAC_PI_2;
    let (before, share) = entry(angle.sqrt() * ANGLES as f64, ANGLES);
    row[before] * (1.0 - share) + row[before + 1] * share
}

fn entry(place: f64, steps: usize) -> (usize, f64) {
    let entry = (place as usize).min(steps - 1);
    (entry, place - entry as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two tables, made by different sums over different grids, and two sets of formulas.
    #[test]
    fn both_renderers_know_the_same_sheen() {
        for (roughness, cos) in
            [0.0, 0.13, 0.24, 0.4, 0.65, 1.0].iter().flat_map(|r| [0.01, 0.05, 0.2, 0.6, 1.0].map(|c| (*r, c)))
        {
            let sheen = Sheen::new(Vec3::new(0.9, 0.5, 0.2), roughness);
            let nap = Nap::new(&sheen);
            let (one, other) = (nap.albedo(cos), sheen.albedo(cos));
            assert!((one - other).length() < 5e-3, "roughness {roughness} cos {cos}: {one}, {other}");
            let to = Vec3::new((1.0 - cos * cos).sqrt(), 0.0, cos);
            for from in [Vec3::new(0.6, 0.0, 0.8), Vec3::new(0.98, 0.1, 0.17).normalize(), Vec3::Z] {
                let (one, other) = (nap.value(to, from), sheen.value((to + from).normalize().z, to.z, from.z));
                assert!(
                    (one - other).length() < 0.01 + 0.01 * one.length(),
                    "{roughness} {cos} {from}: {one}, {other}"
                );
            }
        }
    }
}
