//! How surfaces scatter, for the path tracer: values, random directions and their densities.
//!
//! Only the description of materials is shared with the rest of the room ([`Scatter`]); the formulas are written down a
//! second time, in the local frame of the surface, and so is the albedo that couples a base to its lobe ([`Albedo`]).

use std::f32::consts::FRAC_1_PI;

use glam::Vec3;
use scenes::Rgb;

use super::albedo::{Albedo, LACQUER};
use super::nap::Nap;
use super::philox::Stream;
use super::rough::Rough;
use crate::glossy::{Coat, Fresnel, Glossy};
use crate::surface::{Scatter, Surfel};

/// A surface at a point, seen from a direction.
pub struct Material {
    scatter: Scatter,
    /// Of a glossy surface.
    lobe: Option<Lobe>,
    /// Of frosted glass.
    rough: Option<Rough>,
    /// Columns: two tangents and the shading normal.
    frame: [Vec3; 3],
    geometric: Vec3,
    /// Towards the viewer, in the frame.
    to: Vec3,
    front: bool,
}

/// A random way on.
pub struct Way {
    /// Unit.
    pub direction: Vec3,
    /// Value times cosine over density.
    pub weight: Rgb,
    /// Density, sr⁻¹; `None` for mirrors and glass.
    pub density: Option<f32>,
    /// By how much refraction alone has changed the radiance: no loss, so roulette must not count it.
    pub squeeze: f32,
}

impl Material {
    /// `incoming` is the unit direction of the ray that met the surface.
    pub fn new(at: &Surfel, scatter: Scatter, incoming: Vec3) -> Self {
        let n = at.shading;
        // Any tangent will do: the axis that n is farthest from gives a good one.
        let axis = if n.x.abs() < 0.6 { Vec3::X } else { Vec3::Y };
        let s = n.cross(axis).normalize();
        let frame = [s, n.cross(s), n];
        let to = -Vec3::new(s.dot(incoming), frame[1].dot(incoming), n.dot(incoming));
        let (lobe, rough) = match &scatter {
            Scatter::Glossy(glossy) => (Some(Lobe::new(glossy, to)), None),
            Scatter::Frosted(frosted) => (None, Some(Rough::new(frosted, at.front, to))),
            Scatter::Diffuse { .. } | Scatter::Translucent { .. } | Scatter::Mirror { .. } | Scatter::Glass { .. } => {
                (None, None)
            }
        };
        Self { scatter, lobe, rough, frame, geometric: at.geometric, to, front: at.front }
    }

    /// Light from single directions is never scattered to the eye.
    pub fn is_specular(&self) -> bool {
        matches!(self.scatter, Scatter::Mirror { .. } | Scatter::Glass { .. })
    }

    /// Value times cosine for light from a unit direction, and the density with which [`Self::sample`]
    /// chooses it.
    pub fn value(&self, from: Vec3) -> (Rgb, f32) {
        let local = Vec3::from_array(self.frame.map(|axis| axis.dot(from)));
        if let Some(rough) = &self.rough {
            return if self.geometric.dot(from) * local.z > 0.0 { rough.value(local) } else { (Vec3::ZERO, 0.0) };
        }
        if let Scatter::Translucent { albedo, transmittance } = &self.scatter {
            if self.geometric.dot(from) * local.z <= 0.0 {
                return (Vec3::ZERO, 0.0);
            }
            let p = leaving(*albedo, *transmittance);
            let cos = FRAC_1_PI * local.z.abs();
            return if local.z < 0.0 { (*transmittance * cos, p * cos) } else { (*albedo * cos, (1.0 - p) * cos) };
        }
        // Shading normals must not let light in from behind the surface.
        if local.z <= 0.0 || self.to.z <= 0.0 || self.geometric.dot(from) <= 0.0 {
            return (Vec3::ZERO, 0.0);
        }
        match (&self.scatter, &self.lobe) {
            (Scatter::Diffuse { albedo }, _) => (*albedo * (FRAC_1_PI * local.z), FRAC_1_PI * local.z),
            (_, Some(lobe)) => {
                let (share, value) = (lobe.share(), lobe.base(local.z) + lobe.value(local));
                (value * local.z, share * lobe.density(local) + (1.0 - share) * FRAC_1_PI * local.z)
            }
            (_, None) => (Vec3::ZERO, 0.0),
        }
    }

    /// A random direction; `None` if it would lead below the surface.
    pub fn sample(&self, stream: &mut Stream) -> Option<Way> {
        let local = match &self.scatter {
            Scatter::Mirror { reflectance } => return Some(self.specular(self.mirrored(), *reflectance, 1.0)),
            Scatter::Glass { ior, transmittance, thin } => return self.glass(*ior, *transmittance, *thin, stream),
            Scatter::Diffuse { .. } => hemisphere(stream.pair()),
            Scatter::Translucent { albedo, transmittance } => {
                let side = if stream.unit() < leaving(*albedo, *transmittance) { -1.0 } else { 1.0 };
                hemisphere(stream.pair()) * Vec3::new(1.0, 1.0, side)
            }
            Scatter::Frosted(_) => self.rough.as_ref()?.sample(stream)?,
            Scatter::Glossy(_) => {
                let lobe = self.lobe.as_ref()?;
                if stream.unit() < lobe.share() { lobe.sample(stream) } else { hemisphere(stream.pair()) }
            }
        };
        let direction = self.outwards(local);
        let (value, density) = self.value(direction);
        let squeeze = self.rough.as_ref().map_or(1.0, |rough| rough.squeeze(local.z));
        (density > 0.0).then(|| Way { direction, weight: value / density, density: Some(density), squeeze })
    }

    fn outwards(&self, local: Vec3) -> Vec3 {
        (self.frame[0] * local.x + self.frame[1] * local.y + self.frame[2] * local.z).normalize()
    }

    fn mirrored(&self) -> Vec3 {
        Vec3::new(-self.to.x, -self.to.y, self.to.z)
    }

    fn specular(&self, local: Vec3, weight: Rgb, squeeze: f32) -> Way {
        Way { direction: self.outwards(local), weight: weight * squeeze, density: None, squeeze }
    }

    /// Reflected or refracted, by chance in proportion to Fresnel's reflectance.
    fn glass(&self, ior: f32, tint: Rgb, thin: bool, stream: &mut Stream) -> Option<Way> {
        let relative = if self.front || thin { ior } else { 1.0 / ior };
        let cos = self.to.z.clamp(0.0, 1.0);
        let reflected = if thin { sheet(cos, ior) } else { reflectance(cos, relative) };
        if stream.unit() < reflected {
            return Some(self.specular(self.mirrored(), Vec3::ONE, 1.0));
        }
        if thin {
            return Some(self.specular(-self.to, tint, 1.0));
        }
        let sideways = Vec3::new(-self.to.x, -self.to.y, 0.0) / relative;
        let depth2 = 1.0 - sideways.length_squared();
        let through = Vec3::new(sideways.x, sideways.y, -depth2.max(0.0).sqrt());
        Some(self.specular(through, tint, 1.0 / (relative * relative)))
    }
}

/// How often a translucent sheet is left on its other side.
fn leaving(albedo: Rgb, transmittance: Rgb) -> f32 {
    let (stays, leaves) = (albedo.element_sum(), transmittance.element_sum());
    if leaves > 0.0 { leaves / (stays + leaves) } else { 0.0 }
}

/// What a sheet of two faces reflects, all that goes to and fro between them included.
pub(super) fn sheet(cos: f32, ior: f32) -> f32 {
    let single = reflectance(cos, ior);
    2.0 * single / (1.0 + single)
}

/// Fresnel's equations for unpolarised light, in the form of Cook & Torrance (1982); `relative` is the
/// index behind the surface over the one before it.
pub(super) fn reflectance(cos: f32, relative: f32) -> f32 {
    let g2 = relative * relative - 1.0 + cos * cos;
    if g2 <= 0.0 {
        return 1.0;
    }
    let g = g2.sqrt();
    let (minus, plus) = (g - cos, g + cos);
    let ratio = minus / plus;
    let other = (cos * plus - 1.0) / (cos * minus + 1.0);
    0.5 * ratio * ratio * (1.0 + other * other)
}

/// Around the normal by the cosine: Malley's method with polar coordinates.
fn hemisphere(u: [f32; 2]) -> Vec3 {
    let r = u[0].sqrt();
    let (sin, cos) = libm::sincosf(std::f32::consts::TAU * u[1]);
    Vec3::new(r * cos, r * sin, (1.0 - u[0]).sqrt())
}

/// Over the hemisphere, of density 1 / 2π.
fn evenly([z, turn]: [f32; 2]) -> Vec3 {
    let r = (1.0 - z * z).sqrt();
    let (sin, cos) = libm::sincosf(std::f32::consts::TAU * turn);
    Vec3::new(r * cos, r * sin, z)
}

/// Of the mean of what passes three lobes.
const STEPS: u32 = 64;

/// A GGX lobe in the frame of its surface, over a diffuse base.
struct Lobe {
    f0: Rgb,
    /// At grazing angles.
    f90: f32,
    alpha: f32,
    to: Vec3,
    /// Nothing over black.
    base: Option<Base>,
    nap: Option<Layered>,
    lacquer: Option<Lacquer>,
}

/// Sheen over the lobe, under any lacquer.
struct Layered {
    nap: Nap,
    /// What it lets through towards the viewer.
    seen: f32,
    /// How often it is followed rather than the lobe below.
    share: f32,
}

/// What lies under a lobe, coupled to it as Kelemen and Szirmay-Kalos (2001) do.
struct Base {
    /// ρ (1 − E(ω_o)) / (1 − Ē).
    reflectance: Rgb,
    /// E(ω_o): what the lobe reflects of uniform light towards the viewer, in the channel of which it reflects most if it
    /// is no metal's.
    hidden: Rgb,
    albedo: Albedo,
}

/// A second lobe over all that ([`crate::glossy::Coat`] says how it is meant).
struct Lacquer {
    amount: f32,
    lobe: Box<Lobe>,
    albedo: Albedo,
    /// What it lets through towards the viewer.
    seen: f32,
    /// How often it is followed rather than the lobe below.
    share: f32,
}

impl Lacquer {
    fn new(coat: &Coat, to: Vec3) -> Self {
        let (f0, f90, alpha) = (Vec3::splat(LACQUER as f32), 1.0, coat.facets.alpha());
        let lobe = Box::new(Lobe { f0, f90, alpha, to, base: None, nap: None, lacquer: None });
        let albedo = Albedo::new(f0, f90, alpha);
        let seen = 1.0 - coat.amount * albedo.towards(to.z).x;
        Self { amount: coat.amount, lobe, albedo, seen, share: 0.5 }
    }

    fn lets_through(&self, cos: f32) -> f32 {
        1.0 - self.amount * self.albedo.towards(cos).x
    }
}

impl Lobe {
    fn new(glossy: &Glossy, to: Vec3) -> Self {
        let (Fresnel { f0, f90 }, hiding, alpha) = (glossy.fresnel(), glossy.hiding(), glossy.alpha());
        let hiding = || Albedo::new(hiding.f0, hiding.f90, alpha);
        let diffuse = match glossy.is_multiply_scattering() {
            true => spread(glossy.under(), (f0, f90), alpha, hiding().mean()),
            false => glossy.under(),
        };
        let own = Albedo::new(f0, f90, alpha).towards(to.z).max_element();
        let nap = glossy.sheen().map(|sheen| {
            let nap = Nap::new(sheen);
            let (seen, reflected) = (nap.lets_through(to.z), nap.albedo(to.z).max_element());
            let share = (reflected / (reflected + own * seen).max(1e-9)).clamp(0.1, 0.9);
            Layered { nap, seen, share }
        });
        let lacquer = glossy.coat().map(|coat| Lacquer::new(coat, to));
        let base = (diffuse != Vec3::ZERO).then(|| {
            let albedo = hiding();
            let hidden = albedo.towards(to.z);
            let mut kept = Vec3::ONE - albedo.mean();
            let mut admitted = Vec3::ONE - hidden;
            let mut least = 1e-6;
            if let Some(Lacquer { amount, albedo: over, seen, .. }) = &lacquer {
                kept += (albedo.mean_with(over) - over.mean()) * *amount;
                admitted *= *seen;
                // Less is lost in rounding.
                least = 1e-3;
            }
            if let Some(Layered { nap, seen, .. }) = &nap {
                // No table knows three lobes: by cosines.
                let passes = |cos: f32| lacquer.as_ref().map_or(1.0, |lacquer| lacquer.lets_through(cos));
                let left = |cos: f32| (Vec3::ONE - albedo.towards(cos)) * (nap.lets_through(cos) * passes(cos));
                let cosine = |i: u32| ((i as f32 + 0.5) / STEPS as f32).sqrt();
                kept = (0..STEPS).map(|i| left(cosine(i))).sum::<Rgb>() / STEPS as f32;
                admitted *= *seen;
            }
            Base { reflectance: diffuse * admitted / kept.max(Vec3::splat(least)), hidden, albedo }
        });
        let mut lobe = Self { f0, f90, alpha, to, base, nap, lacquer };
        if let Some(lacquer) = &mut lobe.lacquer {
            let below = lobe.nap.as_ref().map_or(own, |nap| 1.0 - nap.seen + own * nap.seen) * lacquer.seen;
            lacquer.share = ((1.0 - lacquer.seen) / (1.0 - lacquer.seen + below)).clamp(0.1, 0.9);
        }
        lobe
    }

    /// How often the lobe is sampled rather than the base.
    fn share(&self) -> f32 {
        let Some(base) = &self.base else { return 1.0 };
        let seen = self.lacquer.as_ref().map_or(1.0, |lacquer| lacquer.seen);
        let seen = self.nap.as_ref().map_or(seen, |nap| seen * nap.seen);
        let (lobe, base) = (1.0 - seen + base.hidden.max_element() * seen, base.reflectance.max_element());
        (lobe / (lobe + base)).clamp(0.1, 0.9)
    }

    /// Value of what lies under the lobe.
    fn base(&self, cos: f32) -> Rgb {
        let Some(base) = &self.base else { return Vec3::ZERO };
        let passes = self.lacquer.as_ref().map_or(1.0, |lacquer| lacquer.lets_through(cos));
        let passes = self.nap.as_ref().map_or(passes, |layer| passes * layer.nap.lets_through(cos));
        base.reflectance * (Vec3::ONE - base.albedo.towards(cos)) * (FRAC_1_PI * passes)
    }

    /// Of all lobes.
    fn value(&self, from: Vec3) -> Rgb {
        let Some(lacquer) = &self.lacquer else { return self.under_lacquer(from) };
        let passes = lacquer.seen.min(lacquer.lets_through(from.z));
        lacquer.lobe.own_value(from) * lacquer.amount + self.under_lacquer(from) * passes
    }

    fn under_lacquer(&self, from: Vec3) -> Rgb {
        let Some(Layered { nap, seen, .. }) = &self.nap else { return self.own_value(from) };
        nap.value(self.to, from) + self.own_value(from) * seen.min(nap.lets_through(from.z))
    }

    /// Density of [`Self::sample`].
    fn density(&self, from: Vec3) -> f32 {
        let mut density = self.own_density(from);
        if let Some(nap) = &self.nap {
            density = nap.share * FRAC_1_PI / 2.0 + (1.0 - nap.share) * density;
        }
        let Some(lacquer) = &self.lacquer else { return density };
        lacquer.share * lacquer.lobe.own_density(from) + (1.0 - lacquer.share) * density
    }

    /// A random direction of one of the lobes.
    fn sample(&self, stream: &mut Stream) -> Vec3 {
        match &self.lacquer {
            Some(lacquer) if stream.unit() < lacquer.share => lacquer.lobe.own_sample(stream.pair()),
            _ => match &self.nap {
                Some(nap) if stream.unit() < nap.share => evenly(stream.pair()),
                _ => self.own_sample(stream.pair()),
            },
        }
    }

    fn own_value(&self, from: Vec3) -> Rgb {
        let half = (self.to + from).normalize_or_zero();
        let grazing = 1.0 - self.to.dot(half).clamp(0.0, 1.0);
        let fresnel = self.f0 + (Vec3::splat(self.f90) - self.f0) * grazing.powi(5);
        // Smith's masking and shadowing, correlated in height (Heitz 2014, eq. 99).
        let (o, i) = (self.stretched(self.to), self.stretched(from));
        let shadowed = 2.0 * self.to.z * from.z / (from.z * o + self.to.z * i);
        fresnel * (self.facets(half) * shadowed / (4.0 * self.to.z * from.z))
    }

    /// Density of [`Self::own_sample`]: visible facets (Heitz 2018, eq. 17).
    fn own_density(&self, from: Vec3) -> f32 {
        let half = (self.to + from).normalize_or_zero();
        self.facets(half) / (2.0 * (self.to.z + self.stretched(self.to)))
    }

    /// A direction by visible facets.
    fn own_sample(&self, u: [f32; 2]) -> Vec3 {
        let half = visible_facet(self.to, self.alpha, u);
        half * (2.0 * self.to.dot(half)) - self.to
    }

    fn facets(&self, half: Vec3) -> f32 {
        facets(half, self.alpha)
    }

    /// √(α² sin² + cos²): the length of the direction with its tangential part stretched.
    fn stretched(&self, w: Vec3) -> f32 {
        (self.alpha * self.alpha * (w.x * w.x + w.y * w.y) + w.z * w.z).sqrt()
    }
}

/// Albedo of a base together with what facets reflect to each other, as Kulla and Conty (2017) sum it up: light that leaves
/// the surface after `k` more facets has lost `F̄` at each and found the way out with probability `Ē₁` after the last.
fn spread(base: Rgb, (f0, f90): (Rgb, f32), alpha: f32, hidden: Rgb) -> Rgb {
    let out = Albedo::new(Vec3::ONE, 1.0, alpha).mean().x;
    let fresnel = (f0 * 20.0 + Vec3::splat(f90)) / 21.0;
    let (mut ways, mut carried) = (Vec3::ZERO, (1.0 - out) * fresnel);
    for _ in 0..FACETS_MOST {
        carried *= fresnel;
        ways += carried * out;
        carried *= 1.0 - out;
    }
    // Of what the lobe leaves over.
    let part = ways / (Vec3::ONE - hidden).max(Vec3::splat(1e-6));
    base + (Vec3::ONE - base) * part.min(Vec3::ONE)
}

/// More facets in a row carry nothing worth a bit: at α = 1 six parts of ten find the way out at each.
const FACETS_MOST: u32 = 24;

/// A facet that is seen from a direction, as caps of a sphere (Dupuy & Benyoub 2023).
pub(super) fn visible_facet(to: Vec3, alpha: f32, u: [f32; 2]) -> Vec3 {
    let alpha = Vec3::new(alpha, alpha, 1.0);
    let standard = (to * alpha).normalize();
    let z = (1.0 - u[0]) * (1.0 + standard.z) - standard.z;
    let r = (1.0 - z * z).max(0.0).sqrt();
    let (sin, cos) = libm::sincosf(std::f32::consts::TAU * u[1]);
    ((Vec3::new(r * cos, r * sin, z) + standard) * alpha).normalize_or_zero()
}

/// Trowbridge and Reitz; the tangent is taken from the components, so nothing cancels.
pub(super) fn facets(half: Vec3, alpha: f32) -> f32 {
    if half.z <= 0.0 {
        return 0.0;
    }
    let a2 = alpha * alpha;
    let t = half.x * half.x + half.y * half.y + half.z * half.z * a2;
    a2 * FRAC_1_PI / (t * t)
}
