//! From the unit square to where light goes; each sampling function stands beside its density.

use std::f32::consts::{FRAC_1_PI, PI};

use glam::{Vec2, Vec3};

/// Two unit vectors that make a right-handed frame with the unit vector `n`
/// (Duff et al. 2017, "Building an Orthonormal Basis, Revisited").
pub fn frame(n: Vec3) -> (Vec3, Vec3) {
    let sign = if n.z < 0.0 { -1.0 } else { 1.0 };
    let a = -1.0 / (sign + n.z);
    let b = n.x * n.y * a;
    (Vec3::new(1.0 + sign * n.x * n.x * a, sign * b, -sign * n.x), Vec3::new(b, sign + n.y * n.y * a, -n.y))
}

/// From coordinates in a frame around `n` to where `n` lives.
pub fn around(n: Vec3, local: Vec3) -> Vec3 {
    let (s, t) = frame(n);
    s * local.x + t * local.y + n * local.z
}

/// Sine and cosine of 2πu, the same on every machine.
pub fn turn(u: f32) -> (f32, f32) {
    libm::sincosf(2.0 * PI * u)
}

/// The concentric map from the square to the unit disc (Shirley & Chiu 1997): keeps strata compact.
pub fn disc(u: [f32; 2]) -> Vec2 {
    let (a, b) = (2.0 * u[0] - 1.0, 2.0 * u[1] - 1.0);
    if a == 0.0 && b == 0.0 {
        return Vec2::ZERO;
    }
    let (r, turns) = if a.abs() > b.abs() { (a, b / a / 8.0) } else { (b, 0.25 - a / b / 8.0) };
    let (sin, cos) = turn(turns);
    Vec2::new(r * cos, r * sin)
}

/// A direction around `n` with density cosθ/π.
pub fn cosine(n: Vec3, u: [f32; 2]) -> Vec3 {
    let d = disc(u);
    let z = (1.0 - d.length_squared()).max(0.0).sqrt();
    around(n, Vec3::new(d.x, d.y, z)).normalize()
}

/// Density of [`cosine`] a steradian.
pub fn cosine_density(cos: f32) -> f32 {
    cos.max(0.0) * FRAC_1_PI
}

/// A number in 0..1 whose density is linear, from `a` to `b` up to a factor; both not negative.
pub fn linear(a: f32, b: f32, u: f32) -> f32 {
    let most = a.max(b);
    if !(most > 0.0 && most.is_finite()) {
        return u;
    }
    let (a, b) = (a / most, b / most);
    // Solves a x + (b − a) x²/2 = u (a + b)/2 without cancellation.
    (u * (a + b) / (a + (a * a + (b * b - a * a) * u).max(0.0).sqrt()).max(f32::MIN_POSITIVE)).min(1.0)
}

/// A point of the unit square whose density is bilinear between values at (0, 0), (1, 0), (0, 1) and (1, 1), none of
/// them negative.
pub fn bilinear([a, b, c, d]: [f32; 4], u: [f32; 2]) -> [f32; 2] {
    let y = linear(a * 0.5 + b * 0.5, c * 0.5 + d * 0.5, u[1]);
    [linear(a + (c - a) * y, b + (d - b) * y, u[0]), y]
}

/// Density of [`bilinear`].
pub fn bilinear_density([a, b, c, d]: [f32; 4], [x, y]: [f32; 2]) -> f32 {
    let mean = a * 0.25 + b * 0.25 + c * 0.25 + d * 0.25;
    if mean <= 0.0 {
        return 1.0;
    }
    let (upper, lower) = (a * (1.0 - x) + b * x, c * (1.0 - x) + d * x);
    (upper * (1.0 - y) + lower * y) / mean
}

/// Any direction, density 1/4π.
pub fn sphere(u: [f32; 2]) -> Vec3 {
    let z = 1.0 - 2.0 * u[0];
    let r = (1.0 - z * z).max(0.0).sqrt();
    let (sin, cos) = turn(u[1]);
    Vec3::new(r * cos, r * sin, z)
}

/// Density of [`sphere`] a steradian.
pub const SPHERE_DENSITY: f32 = 0.25 * FRAC_1_PI;

/// A direction within a cone around `axis`, uniform; `one_minus_cos` is 1 − cos of its half-angle
/// (so that narrow cones keep their precision).
pub fn cone(axis: Vec3, one_minus_cos: f32, u: [f32; 2]) -> Vec3 {
    let drop = u[0] * one_minus_cos;
    let r = (drop * (2.0 - drop)).max(0.0).sqrt();
    let (sin, cos) = turn(u[1]);
    around(axis, Vec3::new(r * cos, r * sin, 1.0 - drop)).normalize()
}

/// Density of [`cone`] a steradian, within it.
pub fn cone_density(one_minus_cos: f32) -> f32 {
    1.0 / (2.0 * PI * one_minus_cos)
}

/// Barycentric coordinates (of the second and third corner), uniform over a triangle.
/// Heitz 2019, "A Low-Distortion Map Between Triangle and Square".
pub fn triangle(u: [f32; 2]) -> [f32; 2] {
    let [mut x, mut y] = u;
    if y > x {
        x *= 0.5;
        y -= x;
    } else {
        y *= 0.5;
        x -= y;
    }
    [x, y]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// χ² of samples in equal-probability cells: `cell` maps a sample to one of `cells` bins.
    fn chi_square(cells: usize, cell: impl Fn([f32; 2]) -> Option<usize>) -> f64 {
        let n = 200_000_u32;
        let mut counts = vec![0_u32; cells];
        let mut state = 1_u32;
        let mut next = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (crate::sample::mix(state) >> 8) as f32 / 16_777_216.0
        };
        for _ in 0..n {
            let u = [next(), next()];
            counts[cell(u).expect("every sample lies in the domain")] += 1;
        }
        let expected = f64::from(n) / cells as f64;
        counts.iter().map(|c| (f64::from(*c) - expected).powi(2) / expected).sum()
    }

    /// 99.99 % quantile for 64 cells (63 degrees of freedom).
    const LIMIT: f64 = 114.0;

    fn azimuth_cell(v: Vec3, height: f32) -> usize {
        let turns = (v.y.atan2(v.x) / (2.0 * PI)).rem_euclid(1.0);
        (height.clamp(0.0, 0.999_999) * 8.0) as usize * 8 + ((turns * 8.0) as usize).min(7)
    }

    #[test]
    fn cosine_samples_match_their_density() {
        // The distribution function of cosθ/π over height z is 1 − z².
        let x2 = chi_square(64, |u| {
            let v = cosine(Vec3::Z, u);
            (v.z >= 0.0).then(|| azimuth_cell(v, 1.0 - v.z * v.z))
        });
        assert!(x2 < LIMIT, "χ² = {x2}");
    }

    #[test]
    fn sphere_samples_match_their_density() {
        let x2 = chi_square(64, |u| {
            let v = sphere(u);
            Some(azimuth_cell(v, (v.z + 1.0) / 2.0))
        });
        assert!(x2 < LIMIT, "χ² = {x2}");
    }

    #[test]
    fn cone_samples_match_their_density_even_when_narrow() {
        for width in [1e-6_f32, 0.1, 1.0, 2.0] {
            let x2 = chi_square(64, |u| {
                let v = cone(Vec3::Z, width, u);
                let drop = if width < 1e-3 { (v.x * v.x + v.y * v.y) / 2.0 } else { 1.0 - v.z };
                (drop <= width * 1.01).then(|| azimuth_cell(v, drop / width))
            });
            assert!(x2 < LIMIT, "width {width}: χ² = {x2}");
        }
    }

    #[test]
    fn triangle_samples_are_uniform() {
        // Sub-triangles of equal area: the distance from corner 0 squared, times the angle within.
        let x2 = chi_square(64, |u| {
            let [b, c] = triangle(u);
            let s = b + c;
            (s <= 1.0 && b >= 0.0 && c >= 0.0).then(|| {
                let along = (s * s).min(0.999_999);
                let across = (c / s.max(1e-9)).clamp(0.0, 0.999_999);
                (along * 8.0) as usize * 8 + (across * 8.0) as usize
            })
        });
        assert!(x2 < LIMIT, "χ² = {x2}");
    }

    #[test]
    fn frames_are_orthonormal_at_the_poles_too() {
        for n in [Vec3::Z, -Vec3::Z, Vec3::X, Vec3::new(1e-20, 0.0, -1.0), Vec3::new(0.6, 0.0, -0.8)] {
            let (s, t) = frame(n);
            for (a, b) in [(s, t), (s, n), (t, n)] {
                assert!(a.dot(b).abs() < 1e-6);
            }
            assert!((s.cross(t) - n).length() < 1e-6);
        }
    }
}
