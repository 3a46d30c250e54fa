//! The formulas, in `f64`, each with its row of the table.

use std::f64::consts::PI;

use glam::DVec3;

/// Row 1: radiance in a closed room whose every point emits `emitted` and reflects `albedo`.
pub fn furnace(emitted: f64, albedo: f64) -> f64 {
    emitted / (1.0 - albedo)
}

/// Row 1: the same with light of at most `bounces` reflections.
pub fn furnace_bounces(emitted: f64, albedo: f64, bounces: i32) -> f64 {
    emitted * (1.0 - albedo.powi(bounces + 1)) / (1.0 - albedo)
}

/// Row 4: irradiance everywhere in a sphere with a point light of that flux in its middle.
pub fn integrating_sphere(flux: f64, radius: f64, albedo: f64) -> f64 {
    flux / (4.0 * PI * radius * radius * (1.0 - albedo))
}

/// Row 5: what a bound b on the geometry term leaves of the indirect light in a sphere, where that
/// term is 1 / 4R² between any two points.
pub fn bounded_sphere(radius: f64, bound: f64) -> f64 {
    (4.0 * radius * radius * bound).min(1.0)
}

/// Row 6: radiosities of concentric spheres of radii r₁ < r₂, exitance `m` on the inner.
pub fn concentric_spheres(m: f64, albedo: [f64; 2], radius: [f64; 2]) -> [f64; 2] {
    let back = (radius[0] / radius[1]).powi(2);
    // B₁ = m + ρ₁ B₂;  B₂ = ρ₂ (back · B₁ + (1 − back) B₂).
    let gain = albedo[1] * back / (1.0 - albedo[1] * (1.0 - back));
    let inner = m / (1.0 - albedo[0] * gain);
    [inner, gain * inner]
}

/// Row 7: radiosities of two parallel plates between perfect mirrors, exitance `m` on the first.
pub fn mirror_shaft(m: f64, albedo: [f64; 2]) -> [f64; 2] {
    let first = m / (1.0 - albedo[0] * albedo[1]);
    [first, albedo[1] * first]
}

/// Row 11: form factor from a point to a parallel rectangle a × b at distance h, a corner of which
/// is straight above the point.
pub fn corner_rectangle(a: f64, b: f64, h: f64) -> f64 {
    let (x, y) = (a / h, b / h);
    let (x1, y1) = ((1.0 + x * x).sqrt(), (1.0 + y * y).sqrt());
    (x / x1 * (y / x1).atan() + y / y1 * (x / y1).atan()) / (2.0 * PI)
}

/// Row 12: irradiance at the origin, normal `n`, from a flat polygon of radiance 1 all of which is
/// above the horizon (Lambert 1760).
pub fn polygon(corners: &[DVec3], n: DVec3) -> f64 {
    let mut sum = 0.0;
    for (i, &a) in corners.iter().enumerate() {
        let b = corners[(i + 1) % corners.len()];
        let angle = (a.dot(b) / (a.length() * b.length())).clamp(-1.0, 1.0).acos();
        sum += angle * n.dot(a.cross(b).normalize());
    }
    sum.abs() / 2.0
}

/// Row 13: irradiance on the axis of a disc of radiance 1.
pub fn disc(radius: f64, h: f64) -> f64 {
    PI * radius * radius / (radius * radius + h * h)
}

/// Row 13: irradiance from a sphere of radiance 1 wholly above the horizon, whose middle is at
/// distance d under the angle β from the normal.
pub fn ball(radius: f64, distance: f64, cos_beta: f64) -> f64 {
    PI * (radius / distance).powi(2) * cos_beta
}

/// Row 14: form factor from a floor point at distance h to a wall of height a that reaches c to
/// either side.
pub fn wall(height: f64, half_width: f64, h: f64) -> f64 {
    let slant = (height * height + h * h).sqrt();
    ((half_width / h).atan() - h / slant * (half_width / slant).atan()) / PI
}

/// Row 15: (h√b, fraction of an infinite wall's light that a bound b on the geometry term keeps at
/// distance h).
pub const KEPT_BY_BOUND: [(f64, f64); 8] =
    [(0.5699, 1.0), (0.5, 0.989), (0.4, 0.936), (0.3, 0.834), (0.2, 0.677), (0.1, 0.448), (0.05, 0.287), (0.01, 0.099)];

/// Row 16: form factors between opposite and between adjacent faces of a cube.
pub const CUBE_FACES: [f64; 2] = [0.199_824_9, 0.200_043_8];

/// Row 28: reflectance of a smooth dielectric for unpolarised light; `eta` is the index behind over
/// the index before the surface. 1 beyond the critical angle.
pub fn fresnel(cos_in: f64, eta: f64) -> f64 {
    let sin2_out = (1.0 - cos_in * cos_in) / (eta * eta);
    if sin2_out >= 1.0 {
        return 1.0;
    }
    let cos_out = (1.0 - sin2_out).sqrt();
    let s = (cos_in - eta * cos_out) / (cos_in + eta * cos_out);
    let p = (eta * cos_in - cos_out) / (eta * cos_in + cos_out);
    (s * s + p * p) / 2.0
}

/// Row 29: reflectance of a sheet of two faces, with all reflections between them; it transmits the rest.
pub fn sheet(face: f64) -> f64 {
    2.0 * face / (1.0 + face)
}

/// What white metal with GGX facets of width α reflects of a uniform sky towards an eye at `cos` from its
/// normal: mean of G₂/G₁ over the visible facets' reflections (Smith; Heitz 2018), where Fresnel's
/// factor is 1. Counts light that meets the facets once.
pub fn ggx_albedo(alpha: f64, cos: f64) -> f64 {
    ggx_lobe(alpha, 1.0, cos, |_| 1.0)
}

/// What facets of width α reflect of a uniform sky whose Schlick term has those ends, F₀ and F₉₀ > 0.
pub fn highlight(alpha: f64, [f0, f90]: [f64; 2], cos: f64) -> f64 {
    f90 * ggx_lobe(alpha, f0 / f90, cos, |_| 1.0)
}

/// What grey metal of that F₀ reflects of a uniform sky together with light that meets several facets (Kulla and Conty 2017):
/// of what the lobe leaves over, the part that comes back after two facets, three, and so on, F̄ being kept at each.
pub fn whole_metal(alpha: f64, f0: f64, cos: f64) -> f64 {
    const STEPS: usize = 64;
    let mean = |f0: f64| {
        let at = |i: usize| ggx_lobe(alpha, f0, ((i as f64 + 0.5) / STEPS as f64).sqrt(), |_| 1.0);
        (0..STEPS).map(at).sum::<f64>() / STEPS as f64
    };
    let (white, lobe, fresnel) = (mean(1.0), mean(f0), f0 + (1.0 - f0) / 21.0);
    let after = |facets: i32| fresnel.powi(facets) * (1.0 - white).powi(facets - 1) * white;
    let back = (2..40).map(after).sum::<f64>() / (1.0 - lobe);
    let seen = ggx_lobe(alpha, f0, cos, |_| 1.0);
    seen + back * (1.0 - seen)
}

/// What a surface under clear lacquer reflects of a uniform sky towards an eye at `cos`: so much of it is under a GGX lobe of
/// F₀ 0.04 and width α, below which are another of F₀ `f0` and `under`, seen by what the lacquer lets through one way (the way
/// that lets less through), and, `white` or not, a base that reflects all that comes to it.
pub fn lacquered(amount: f64, alpha: f64, (f0, under): (f64, f64), white: bool, cos: f64) -> f64 {
    const STEPS: usize = 96;
    let over = |cos: f64| amount * ggx_lobe(alpha, f64::from(0.04_f32), cos, |_| 1.0);
    // By the fourth root of the cosine: what happens near the horizon is as wide as α.
    let table: Vec<f64> = (0..=STEPS).map(|i| 1.0 - over((i as f64 / STEPS as f64).powi(4).max(1e-6))).collect();
    let passes = |cos: f64| {
        let place = cos.clamp(0.0, 1.0).powf(0.25) * STEPS as f64;
        let entry = (place as usize).min(STEPS - 1);
        table[entry] + (table[entry + 1] - table[entry]) * (place - entry as f64)
    };
    let seen = 1.0 - over(cos);
    let lobe = ggx_lobe(under, f0, cos, |out| seen.min(passes(out)));
    let base = if white { seen * (1.0 - ggx_lobe(under, f0, cos, |_| 1.0)) } else { 0.0 };
    1.0 - seen + lobe + base
}

/// What sheen of that strength and width α reflects of a uniform sky (Estevez and Kulla 2017, Charlie), and with it what lies
/// below: a white lobe of facets of that width, if any, seen by what the sheen lets through one way (the way that lets less
/// through), or else so much of what passes. Not for α < 0.07, where the fit gives more than comes.
pub fn sheen(strength: f64, alpha: f64, under: Under, cos: f64) -> f64 {
    const STEPS: usize = 64;
    let reflected = |cos: f64| strength * charlie_albedo(alpha, cos);
    let seen = 1.0 - reflected(cos);
    let below = match under {
        Under::Matt(albedo) => albedo * seen,
        Under::Metal(under) => {
            let table: Vec<f64> =
                (0..=STEPS).map(|i| 1.0 - reflected((i as f64 / STEPS as f64).powi(3).max(1e-5))).collect();
            let passes = |cos: f64| {
                let place = cos.clamp(0.0, 1.0).cbrt() * STEPS as f64;
                let entry = (place as usize).min(STEPS - 1);
                table[entry] + (table[entry + 1] - table[entry]) * (place - entry as f64)
            };
            ggx_lobe(under, 1.0, cos, |out| seen.min(passes(out)))
        }
    };
    1.0 - seen + below
}

/// What lies under sheen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Under {
    /// Matt and of that albedo, 0 or 1.
    Matt(f64),
    /// White metal of that α.
    Metal(f64),
}

/// Of white sheen, over directions evenly in the cube root of their cosines.
fn charlie_albedo(alpha: f64, cos: f64) -> f64 {
    let (steps, mut sum) = (160, 0.0);
    let fit = |x: f64| {
        let mix = |p: f64, q: f64| p * (1.0 - (1.0 - alpha).powi(2)) + q * (1.0 - alpha).powi(2);
        let [a, b, c] = [mix(21.5473, 25.3245), mix(3.82987, 3.32435), mix(0.19823, 0.16801)];
        a / (1.0 + b * x.powf(c)) + mix(-1.97760, -1.27393) * x + mix(-4.32054, -4.85967)
    };
    let lambda = |cos: f64| if cos < 0.5 { fit(cos) } else { 2.0 * fit(0.5) - fit(1.0 - cos) }.exp();
    let to = DVec3::new((1.0 - cos * cos).sqrt(), 0.0, cos);
    for i in 0..steps {
        let root = (f64::from(i) + 0.5) / f64::from(steps);
        let z = root.powi(3);
        // dz = 3 root² droot; the cosine of light and that of V cancel.
        let ring = 3.0 * root * root / (4.0 * cos * (1.0 + lambda(cos) + lambda(z)));
        for j in 0..steps {
            let (sin, along) = ((f64::from(j) + 0.5) / f64::from(steps) * PI).sin_cos();
            let half = (to + DVec3::new(along, sin, 0.0) * (1.0 - z * z).sqrt() + DVec3::Z * z).normalize();
            sum += ring * (1.0 - half.z * half.z).powf(0.5 / alpha);
        }
    }
    // D's factor, and the whole turn.
    sum / f64::from(steps * steps) * (2.0 + 1.0 / alpha)
}

/// The same of GGX facets with Schlick's reflectance of F₀ `f0`, light weighed by the cosine of where it comes from.
fn ggx_lobe(alpha: f64, f0: f64, cos: f64, weight: impl Fn(f64) -> f64) -> f64 {
    let lambda = |cos: f64| {
        let tan2 = (1.0 - cos * cos).max(0.0) / (cos * cos);
        ((1.0 + alpha * alpha * tan2).sqrt() - 1.0) / 2.0
    };
    let to = DVec3::new((1.0 - cos * cos).sqrt(), 0.0, cos);
    // Facets m by density D: D cosθ_m dω_m is even in u = tan²θ/(tan²θ + α²).
    let (steps, mut sum) = (400, 0.0);
    for i in 0..steps {
        let u = (f64::from(i) + 0.5) / f64::from(steps);
        let tan2 = alpha * alpha * u / (1.0 - u);
        let (cos_m, sin_m) = ((1.0 + tan2).powf(-0.5), (tan2 / (1.0 + tan2)).sqrt());
        for j in 0..steps {
            let phi = (f64::from(j) + 0.5) / f64::from(steps) * 2.0 * PI;
            let m = DVec3::new(sin_m * phi.cos(), sin_m * phi.sin(), cos_m);
            let from = m * (2.0 * to.dot(m)) - to;
            if to.dot(m) > 0.0 && from.z > 0.0 {
                // D G₂ / (4 cos_o) dω_from = D G₂ (o·m) / cos_o dω_m
                let fresnel = f0 + (1.0 - f0) * (1.0 - to.dot(m)).max(0.0).powi(5);
                sum += weight(from.z) * fresnel * to.dot(m) / (cos * cos_m) / (1.0 + lambda(cos) + lambda(from.z));
            }
        }
    }
    sum / f64::from(steps * steps)
}

/// What rough glass reflects and passes of flux that comes at `cos` from its normal: Walter et al. 2007, over all facets by
/// their distribution, with Smith's shadows of either direction by itself. `eta` is the index behind over the index
/// before; a sheet (`thin`) has two faces of that index, and passes light as a mirror behind it would.
pub fn rough_glass(alpha: f64, cos: f64, eta: f64, thin: bool) -> [f64; 2] {
    let shadow = |cos: f64| {
        let tan2 = (1.0 - cos * cos).max(0.0) / (cos * cos);
        2.0 / (1.0 + (1.0 + alpha * alpha * tan2).sqrt())
    };
    let to = DVec3::new((1.0 - cos * cos).sqrt(), 0.0, cos);
    let (steps, mut sums) = (800, [0.0; 2]);
    for i in 0..steps {
        // D cosθ dω is even in the square of this, which does not miss the far tail.
        let rest = (f64::from(i) + 0.5) / f64::from(steps);
        let tan2 = alpha * alpha * (1.0 - rest * rest) / (rest * rest);
        let (cos_m, sin_m) = ((1.0 + tan2).powf(-0.5), (tan2 / (1.0 + tan2)).sqrt());
        for j in 0..steps {
            let phi = (f64::from(j) + 0.5) / f64::from(steps) * 2.0 * PI;
            let m = DVec3::new(sin_m * phi.cos(), sin_m * phi.sin(), cos_m);
            let met = to.dot(m);
            if met <= 0.0 {
                continue;
            }
            let face = fresnel(met, eta);
            let reflected = if thin { sheet(face) } else { face };
            let weight = 2.0 * rest * met / (cos * cos_m) * shadow(cos);
            let mirror = m * (2.0 * met) - to;
            if mirror.z > 0.0 {
                sums[0] += weight * reflected * shadow(mirror.z);
            }
            let through = match thin {
                true => -mirror.z,
                false => {
                    let sin2 = (1.0 - met * met) / (eta * eta);
                    (m * (met / eta - (1.0 - sin2).max(0.0).sqrt()) - to / eta).z
                }
            };
            if through < 0.0 {
                sums[1] += weight * (1.0 - reflected) * shadow(-through);
            }
        }
    }
    sums.map(|sum| sum / f64::from(steps * steps))
}

/// BSDF of a rough sheet for light that passes it, sr⁻¹; both directions by what they have to the normal and along
/// the sheet, `from` away from where the light comes, mirrored to the viewer's side.
pub fn rough_sheet(alpha: f64, to: DVec3, from: DVec3, eta: f64) -> f64 {
    let shadow = |cos: f64| {
        let tan2 = (1.0 - cos * cos).max(0.0) / (cos * cos);
        2.0 / (1.0 + (1.0 + alpha * alpha * tan2).sqrt())
    };
    let half = (to + from).normalize();
    let a2 = alpha * alpha;
    let d = a2 / (PI * (half.z * half.z * (a2 - 1.0) + 1.0).powi(2));
    (1.0 - sheet(fresnel(to.dot(half), eta))) * d * shadow(to.z) * shadow(from.z) / (4.0 * to.z * from.z)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn close(value: f64, expected: f64, tolerance: f64) {
        assert!((value - expected).abs() <= tolerance, "{value}, expected {expected}");
    }

    /// Irradiance at the origin, normal +y, from a parallelogram of radiance 1, by brute force.
    fn integrate(middle: DVec3, half_u: DVec3, half_v: DVec3) -> f64 {
        let (n, steps) = (half_u.cross(half_v).normalize(), 1000);
        let area = half_u.cross(half_v).length() * 4.0 / f64::from(steps * steps);
        let at = |i: i32| (f64::from(i) + 0.5) / f64::from(steps) * 2.0 - 1.0;
        let mut sum = 0.0;
        for i in 0..steps {
            for j in 0..steps {
                let to = middle + half_u * at(i) + half_v * at(j);
                sum += (to.y * n.dot(to).abs() / to.length_squared().powi(2)) * area;
            }
        }
        sum
    }

    #[test]
    fn published_numbers_are_met() {
        for (albedo, share) in [(0.5, 0.969), (0.9, 0.410), (0.99, 0.0490), (0.999, 0.0050)] {
            close(furnace_bounces(1.0, albedo, 4) / furnace(1.0, albedo), share, 5e-4);
        }
        close(concentric_spheres(1.0, [0.5, 0.8], [1.0, 2.0])[0], 4.0 / 3.0, 1e-12);
        close(concentric_spheres(1.0, [0.5, 0.8], [1.0, 2.0])[1], 2.0 / 3.0, 1e-12);
        close(mirror_shaft(1.0, [0.8, 0.2])[0], 1.190_476, 1e-6);
        close(mirror_shaft(1.0, [0.8, 0.2])[1], 0.238_095, 1e-6);
        close(mirror_shaft(1.0, [0.9, 0.99])[1], 9.082_569, 1e-6);
        close(4.0 * corner_rectangle(1.0, 1.0, 1.0), 0.554_126, 1e-6);
        close(wall(1.0, 0.5, 0.1), 0.422_545, 1e-6);
        close(wall(1e6, 1e6, 1.0), 0.5, 1e-6);
        close(fresnel(1.0, 1.5), 0.04, 1e-12);
        close(sheet(fresnel(1.0, 1.5)), 0.076_923, 1e-6);
    }

    #[test]
    fn emitters_agree_with_brute_force() {
        let up = DVec3::Y;
        let square = integrate(up, DVec3::X, DVec3::Z);
        close(square / PI, 4.0 * corner_rectangle(1.0, 1.0, 1.0), 1e-5);
        let upright = integrate(DVec3::new(0.0, 0.5, 0.1), DVec3::X * 0.5, DVec3::Y * 0.5);
        close(upright / PI, wall(1.0, 0.5, 0.1), 1e-3);
        let (middle, u, v) = (DVec3::new(0.3, 1.2, -0.4), DVec3::new(0.5, 0.2, 0.0), DVec3::new(0.1, 0.0, 0.6));
        let corners = [middle - u - v, middle + u - v, middle + u + v, middle - u + v];
        close(polygon(&corners, up), integrate(middle, u, v), 1e-5);
        let ring = |i: i32| f64::from(i) / 4096.0 * 2.0 * PI;
        let circle: Vec<DVec3> = (0..4096).map(|i| DVec3::new(ring(i).cos(), 2.0, ring(i).sin())).collect();
        close(polygon(&circle, up), disc(1.0, 2.0), 1e-5);
    }

    #[test]
    fn facets_reflect_all_when_flat_and_less_when_rough() {
        close(ggx_albedo(1e-3, 0.7), 1.0, 1e-4);
        // With α = 1 all facets are as frequent, and seen straight on G₂ = 2 cos/(1 + cos).
        close(ggx_albedo(1.0, 1.0), 1.0 - 2.0_f64.ln(), 1e-3);
        assert!(ggx_albedo(0.25, 0.5) > ggx_albedo(0.5, 0.5));
    }

    #[test]
    fn rough_glass_is_clear_when_flat_and_keeps_some_light_when_rough() {
        for (eta, thin) in [(1.5, false), (1.0 / 1.5, false), (1.5, true)] {
            let [reflected, passed] = rough_glass(1e-3, 0.9, eta, thin);
            let face = fresnel(0.9, eta);
            close(reflected, if thin { sheet(face) } else { face }, 1e-3);
            close(reflected + passed, 1.0, 1e-3);
            let rough: f64 = rough_glass(0.36, 0.9, eta, thin).iter().sum();
            // From within, many facets lie beyond the critical angle, and much of what they reflect meets others.
            assert!(rough > 0.8 && rough < 0.995, "{rough}");
        }
    }

    #[test]
    fn cube_faces_see_each_other_wholly() {
        close(CUBE_FACES[0] + 4.0 * CUBE_FACES[1], 1.0, 1e-6);
    }

    #[test]
    fn the_bound_keeps_what_brute_force_keeps() {
        // In the plane of a wall at distance h = 1, with r² = 1 + y² + z²: G = y / (r² r²) for a
        // floor point, wall radiance 1; half of the wall is above the floor.
        for (reach, kept) in KEPT_BY_BOUND {
            let bound = reach * reach;
            let (mut whole, mut part) = (0.0, 0.0);
            let steps = 1500;
            for i in 0..steps {
                for j in 0..steps {
                    // y = tan(a), z = tan(c)·√(1 + y²) cover the half plane.
                    let cell = |k: i32| (f64::from(k) + 0.5) / f64::from(steps);
                    let (a, c) = (cell(i) * PI / 2.0, (cell(j) - 0.5) * PI);
                    let y = a.tan();
                    let z = c.tan() * (1.0 + y * y).sqrt();
                    let jacobian = (1.0 + y * y) * (1.0 + y * y).sqrt() * (1.0 + c.tan().powi(2));
                    let g = y / (1.0 + y * y + z * z).powi(2);
                    whole += g * jacobian;
                    part += g.min(bound) * jacobian;
                }
            }
            close(part / whole, kept, 2e-3);
        }
    }

    #[test]
    fn all_light_is_reflected_beyond_the_critical_angle_and_only_there() {
        let critical = (1.0_f64 / 1.5).asin();
        close(critical.to_degrees(), 41.8103, 1e-4);
        assert_eq!(fresnel((critical + 1e-9).cos(), 1.0 / 1.5), 1.0);
        assert!(fresnel((critical - 1e-6).cos(), 1.0 / 1.5) < 1.0);
        close(fresnel(0.3, 1.0), 0.0, 1e-15);
    }
}
