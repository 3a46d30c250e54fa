//! How much a lobe reflects of light that is the same from everywhere: its directional albedo E(ω), tabulated.
//!
//! With Schlick's Fresnel term, E is linear in F₀, so two numbers a direction do for all colours: `E = F₀ A + B`. On
//! smooth facets, `A = 1 − B` and `B = (1 − cosθ)⁵`. What the table holds is how far they are from that, which is little
//! and smooth but where cosθ is about α; and there α and cosθ are close to 0, so both axes are even in fourth roots. An
//! entry in between is within a thousandth, and within a quarter of a per cent below half a degree.

use std::sync::OnceLock;

use glam::{Vec2, Vec3};

use super::{Fresnel, Glossy, coat};
use crate::facets::{ALPHA_MIN, Facets};

/// A and B towards a direction.
pub fn directional(cos: f32, alpha: f32) -> [f32; 2] {
    let (upper, below) = split(height(alpha), ALPHAS);
    let (column, beside) = split(fourth_root(cos.clamp(0.0, 1.0)), COSINES);
    let at = |i: usize| {
        let directional = &row(i).directional;
        mix(directional[column], directional[column + 1], beside)
    };
    let [a, b] = mix(at(upper), at(upper + 1), below);
    let smooth = smooth(cos);
    [1.0 - smooth + a, smooth + b]
}

/// The same, averaged over the directions of a hemisphere by their cosines: of what [`directional`] says, exactly, for
/// so much energy is conserved.
pub fn mean(alpha: f32) -> [f32; 2] {
    let (upper, below) = split(height(alpha), ALPHAS);
    mix(row(upper).mean, row(upper + 1).mean, below)
}

/// `2 ∫ E(μ) A(μ) μ dμ`, and the same with B: E being the directional albedo of the coat's lobe ([`coat::F0`]), A and B those
/// of the lobe under it.
pub fn mean_under_coat(coat: f32, alpha: f32) -> [f32; 2] {
    let (upper, below) = split(height(coat), ALPHAS);
    let (left, beside) = split(height(alpha), ALPHAS);
    let row = |row: usize| mix(product(row, left), product(row, left + 1), beside);
    mix(row(upper), row(upper + 1), below)
}

/// Steps along the axes; there is one entry more.
const ALPHAS: usize = 48;
const COSINES: usize = 64;

struct Row {
    directional: [[f32; 2]; COSINES + 1],
    mean: [f32; 2],
}

/// Computed from the formulas of the lobe, so constants, each made when it is first asked for: all of them take some
/// hundredths of a second, and few materials have more than two.
static ROWS: [OnceLock<Row>; ALPHAS + 1] = [const { OnceLock::new() }; ALPHAS + 1];

fn row(i: usize) -> &'static Row {
    ROWS[i].get_or_init(|| {
        let root = |i: usize, steps: usize| i as f32 / steps as f32;
        let fourth = |root: f32| root * root * root * root;
        let lowest = fourth_root(ALPHA_MIN);
        let alpha = fourth(lowest + (1.0 - lowest) * root(i, ALPHAS));
        // No direction lies in the surface; so close to it, none differs from another.
        let directional = std::array::from_fn(|j| deviation(alpha, fourth(root(j, COSINES)).max(1e-6)));
        Row { directional, mean: average(&directional) }
    })
}

/// [`mean_under_coat`] of two rows, as both are interpolated; made when first asked for, as they are.
static PRODUCTS: [[OnceLock<[f32; 2]>; ALPHAS + 1]; ALPHAS + 1] =
    [const { [const { OnceLock::new() }; ALPHAS + 1] }; ALPHAS + 1];

fn product(coat: usize, under: usize) -> [f32; 2] {
    *PRODUCTS[coat][under].get_or_init(|| {
        /// Of the midpoint rule within an entry: the product bends little there.
        const STEPS: usize = 8;
        let (coat, under) = (&row(coat).directional, &row(under).directional);
        let mut sums = [0.0_f64; 2];
        for i in 0..COSINES * STEPS {
            let root = (i as f64 + 0.5) / (COSINES * STEPS) as f64;
            let (entry, share) = (i / STEPS, (i % STEPS) as f64 / STEPS as f64 + 0.5 / STEPS as f64);
            let at = |row: &[[f32; 2]; COSINES + 1], k: usize| {
                let [p, q] = [row[entry][k], row[entry + 1][k]].map(f64::from);
                p + (q - p) * share
            };
            let smooth = (1.0 - root.powi(4)).powi(5);
            let [a, b] = [at(coat, 0) + 1.0 - smooth, at(coat, 1) + smooth];
            let reflected = f64::from(coat::F0) * a + b;
            // 2 μ dμ is 8 x⁷ dx.
            let weight = 8.0 * root.powi(7) / (COSINES * STEPS) as f64;
            sums[0] += weight * reflected * (at(under, 0) + 1.0 - smooth);
            sums[1] += weight * reflected * (at(under, 1) + smooth);
        }
        sums.map(|sum| sum as f32)
    })
}

/// What A and B are more than on smooth facets.
fn deviation(alpha: f32, cos: f32) -> [f32; 2] {
    /// Of the quadrature over visible facets, half of which are like the other half.
    const STEPS: [usize; 2] = [32, 16];
    let (under, diffuse) = (Vec3::ZERO, Vec3::ZERO);
    let all = Fresnel::of_index(1.0);
    let lobe =
        Glossy { under, diffuse, fresnel: all, hiding: all, facets: Facets::of_width(alpha), sheen: None, coat: None };
    let to = Vec3::new((1.0 - cos * cos).max(0.0).sqrt(), 0.0, cos);
    let (mut a, mut b, mut weights) = (0.0, 0.0, 0.0);
    for i in 0..STEPS[0] {
        // Facets far off the normal are seen through the rim of the disc: the fourth power of the distance from it
        // gives them their due.
        let t = (i as f32 + 0.5) / STEPS[0] as f32;
        let (weight, radius) = (t * t * t, (1.0 - t * t * t * t).sqrt());
        for j in 0..STEPS[1] {
            let (sin, cos) = libm::sincosf(std::f32::consts::PI * (j as f32 + 0.5) / STEPS[1] as f32);
            let half = lobe.facets.visible(Vec3::Z, to, Vec2::new(sin, cos) * radius);
            weights += weight;
            if let Some((_, passed)) = lobe.reflected(Vec3::Z, to, half) {
                let grazing = smooth(to.dot(half));
                a += weight * passed * (1.0 - grazing);
                b += weight * passed * grazing;
            }
        }
    }
    let smooth = smooth(cos);
    [a / weights - (1.0 - smooth), b / weights - smooth]
}

/// `2 ∫ E(μ) μ dμ` of a row, exactly as it is interpolated.
fn average(row: &[[f32; 2]; COSINES + 1]) -> [f32; 2] {
    let mut sums = [0.0_f64; 2];
    for (i, ends) in row.windows(2).enumerate() {
        // With x = μ^¼ it is ∫ (p + (q − p)(x − x₀)/h) 8x⁷ dx, by moments of x.
        let (from, to) = (i as f64 / COSINES as f64, (i + 1) as f64 / COSINES as f64);
        let (eighth, ninth) = (to.powi(8) - from.powi(8), 8.0 / 9.0 * (to.powi(9) - from.powi(9)));
        for k in 0..2 {
            let [p, q] = [ends[0][k], ends[1][k]].map(f64::from);
            sums[k] += p * eighth + (q - p) * (ninth - from * eighth) * COSINES as f64;
        }
    }
    // 2 ∫ (1 − μ)⁵ μ dμ = 1/21
    let smooth = 1.0 / 21.0;
    [(1.0 - smooth + sums[0]) as f32, (smooth + sums[1]) as f32]
}

/// Schlick's (1 − cos)⁵.
fn smooth(cos: f32) -> f32 {
    let m = (1.0 - cos).clamp(0.0, 1.0);
    m * m * m * m * m
}

/// Where α stands on its axis, 0..1.
fn height(alpha: f32) -> f32 {
    let lowest = fourth_root(ALPHA_MIN);
    ((fourth_root(alpha) - lowest) / (1.0 - lowest)).clamp(0.0, 1.0)
}

fn fourth_root(x: f32) -> f32 {
    x.sqrt().sqrt()
}

/// The entry before a place on an axis, and how far it is to the next.
fn split(place: f32, steps: usize) -> (usize, f32) {
    let place = place * steps as f32;
    let entry = (place as usize).min(steps - 1);
    (entry, place - entry as f32)
}

fn mix(p: [f32; 2], q: [f32; 2], share: f32) -> [f32; 2] {
    std::array::from_fn(|k| p[k] + (q[k] - p[k]) * share)
}
