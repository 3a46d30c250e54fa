//! A diffuse base under a GGX lobe, energy conserving (glTF 2.0 metallic-roughness).
//!
//! The lobe is light that meets the facets once. What they pass on to each other is lost, or
//! ([`Glossy::multiply_scattering`]) comes back as diffuse light. The base is coupled to it as Kelemen & Szirmay-Kalos (2001) do: it gets
//! what the lobe does not reflect, `f_d = ρ/π · (1−E(ω_o))(1−E(ω_i)) / (1−Ē)`, E being the lobe's directional albedo
//! ([`albedo`]), so that a white base reflects all there is, at every angle and roughness. That form is reciprocal and
//! **factorises**: the eye's factor goes into the reflectance of a pixel, the light's into its irradiance, so that the
//! discontinuity buffer still blurs irradiance only.
//!
//! Lobes with α < [`SHARP_ALPHA`] are followed like mirrors ("specular gathering", Dammertz et al. 2010); those of rougher
//! ones are shared by VPLs and rays ([`crate::lobe`]).
//!
//! Over all that may lie sheen ([`sheen`]), and over that a coat ([`coat`]): layers, each with a lobe of its own and a part that
//! it lets through to what lies below. To all who ask, these lobes are one, which is followed like a mirror if the narrowest is.

mod albedo;
mod coat;
mod fresnel;
mod sheen;

use std::f32::consts::FRAC_1_PI;

use glam::Vec3;
use scenes::Rgb;
use scenes::needs::SHARP_ALPHA;

use crate::facets::Facets;
use crate::warp;
pub use coat::Coat;
pub use fresnel::Fresnel;
pub use sheen::Sheen;

/// Parameters of the material at a point, textures looked up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Glossy {
    /// ρ of what lies under the lobe.
    under: Rgb,
    /// The same, with what facets pass on to each other.
    diffuse: Rgb,
    fresnel: Fresnel,
    /// What the base is hidden by: as much of all channels as of the one that a non-metal's facets reflect most of.
    hiding: Fresnel,
    facets: Facets,
    sheen: Option<Sheen>,
    coat: Option<Coat>,
}

impl Glossy {
    /// From base colour, perceptual roughness, metalness (each 0..1) and what the non-metal reflects.
    pub fn new(base: Rgb, roughness: f32, metalness: f32, fresnel: Fresnel) -> Self {
        let metalness = metalness.clamp(0.0, 1.0);
        let base = base.clamp(Vec3::ZERO, Vec3::ONE);
        let under = base * (1.0 - metalness);
        Self {
            under,
            diffuse: under,
            fresnel: fresnel.towards_metal(base, metalness),
            hiding: fresnel.of_brightest_channel().towards_metal(base, metalness),
            facets: Facets::new(roughness),
            sheen: None,
            coat: None,
        }
    }

    /// The same with the light that meets several facets. It is spread as a base's is, of which it is a part: of all that the
    /// lobe does not reflect, `r` comes from the facets after all and the base gets the rest, `ρ' = r + ρ (1 − r)`. For white
    /// metals that is Kulla and Conty's lobe ("Revisiting Physically Based Shading at Imageworks", 2017), so that all light
    /// comes back; for others `r = F_ms (1−Ē₁) / (1−Ē)` keeps the energy of theirs in the mean, F_ms being what facets keep
    /// of light on such ways and Ē₁ the mean albedo of the lobe if it were white.
    #[must_use]
    pub fn multiply_scattering(self) -> Self {
        let [a, b] = albedo::mean(self.alpha());
        let white = a + b;
        let fresnel = self.fresnel.mean();
        let kept = fresnel * fresnel * white / (Vec3::ONE - fresnel * (1.0 - white));
        let missed = (Vec3::ONE - self.mean_hidden()).max(Vec3::splat(f32::MIN_POSITIVE));
        let r = (kept * (1.0 - white) / missed).clamp(Vec3::ZERO, Vec3::ONE);
        Self { diffuse: r + self.under * (Vec3::ONE - r), ..self }
    }

    /// The same under sheen of a colour (0..1) and a perceptual roughness.
    #[must_use]
    pub fn with_sheen(self, colour: Rgb, roughness: f32) -> Self {
        let sheen = Sheen::new(colour, roughness);
        Self { sheen: (sheen.colour != Vec3::ZERO).then_some(sheen), ..self }
    }

    /// The same under so much of a coat (0..1) of a perceptual roughness.
    #[must_use]
    pub fn coated(self, amount: f32, roughness: f32) -> Self {
        let amount = amount.clamp(0.0, 1.0);
        let coat = (amount > 0.0).then(|| Coat { amount, facets: Facets::new(roughness) });
        Self { coat, ..self }
    }

    /// What lies over the lobe, under the coat.
    pub fn sheen(&self) -> Option<&Sheen> {
        self.sheen.as_ref()
    }

    /// What lies over all.
    pub fn coat(&self) -> Option<&Coat> {
        self.coat.as_ref()
    }

    /// ρ of all that is spread diffusely.
    pub fn diffuse_albedo(&self) -> Rgb {
        self.diffuse
    }

    /// ρ of what lies under the lobe.
    pub fn under(&self) -> Rgb {
        self.under
    }

    /// With the light that meets several facets.
    pub fn is_multiply_scattering(&self) -> bool {
        self.diffuse != self.under
    }

    /// Reflectance of the lobe's facets.
    pub fn fresnel(&self) -> Fresnel {
        self.fresnel
    }

    /// What of the base they hide, likewise.
    pub fn hiding(&self) -> Fresnel {
        self.hiding
    }

    /// GGX α of the lobe, of the one under a coat: 0.001..=1.
    pub fn alpha(&self) -> f32 {
        self.facets.alpha()
    }

    /// α of the widest lobe; sheen is as wide as can be.
    pub fn widest(&self) -> f32 {
        if self.sheen.is_some() {
            return 1.0;
        }
        self.coat.map_or(self.alpha(), |coat| self.alpha().max(coat.facets.alpha()))
    }

    /// The lobe is followed like a mirror.
    pub fn is_sharp(&self) -> bool {
        self.coat.map_or(self.alpha(), |coat| self.alpha().min(coat.facets.alpha())) < SHARP_ALPHA
    }

    /// Rays that follow its lobe find everything: it is sharp, and nothing is spread.
    pub fn is_dark(&self) -> bool {
        self.diffuse == Vec3::ZERO && self.is_sharp()
    }

    /// The base's factor on the side of light: 1 − E(ω).
    pub fn admitted(&self, cos: f32) -> Rgb {
        (Vec3::ONE - self.hiding.albedo(albedo::directional(cos, self.alpha()))) * self.passes(cos)
    }

    /// What gets through all layers over the lobe.
    fn passes(&self, cos: f32) -> f32 {
        let sheen = self.sheen.map_or(1.0, |sheen| sheen.passes(cos));
        self.coat.map_or(sheen, |coat| sheen * coat.passes(cos))
    }

    /// Something lies over the lobe.
    fn is_layered(&self) -> bool {
        self.sheen.is_some() || self.coat.is_some()
    }

    /// [`Self::admitted`], averaged over a hemisphere by cosines, by Gauss's sum.
    fn mean_admitted(&self) -> Rgb {
        GAUSS.iter().map(|[cos, weight]| self.admitted(*cos) * (2.0 * cos * weight)).sum()
    }

    /// The base's reflectance towards the eye: ρ (1 − E(ω)) / (1 − Ē).
    pub fn reflectance(&self, cos: f32) -> Rgb {
        let mean = match &self.coat {
            // Less is lost in rounding.
            _ if self.sheen.is_some() => self.mean_admitted().max(Vec3::splat(1e-3)),
            // Of white metal a smooth lobe leaves over next to nothing, and near the horizon a part all the same.
            None => (Vec3::ONE - self.mean_hidden()).max(Vec3::splat(1e-6)),
            // The mean of (1 − E_c)(1 − E).
            Some(coat) => {
                let [a, b] = coat.mean_with(self.alpha());
                let Fresnel { f0, f90 } = self.hiding;
                let mean = Vec3::splat(1.0 - coat.mean()) - self.mean_hidden() + f0 * a + Vec3::splat(f90 * b);
                mean.max(Vec3::splat(1e-3))
            }
        };
        self.diffuse * self.admitted(cos) / mean
    }

    /// Value of the diffuse part of the BSDF.
    pub fn base(&self, cos_o: f32, cos_i: f32) -> Rgb {
        self.reflectance(cos_o) * self.admitted(cos_i) * FRAC_1_PI
    }

    /// Value of the lobe, sr⁻¹; `to` and `from` are unit vectors away from the surface.
    pub fn lobe(&self, n: Vec3, to: Vec3, from: Vec3) -> Rgb {
        let (cos_o, cos_i) = (n.dot(to), n.dot(from));
        let half = (to + from).normalize_or_zero();
        if cos_o <= 0.0 || cos_i <= 0.0 || half == Vec3::ZERO {
            return Vec3::ZERO;
        }
        let d = self.facets.density(n.dot(half));
        let g = 1.0 / (1.0 + self.facets.lambda(cos_o) + self.facets.lambda(cos_i));
        let value = self.fresnel.at(to.dot(half)) * (d * g / (4.0 * cos_o * cos_i));
        if self.is_layered() { self.layered(value, n, to, from, half) } else { value }
    }

    /// The lobe's value as it is seen through the layers over it, and theirs.
    fn layered(&self, mut value: Rgb, n: Vec3, to: Vec3, from: Vec3, half: Vec3) -> Rgb {
        let (cos_h, cos_o, cos_i) = (n.dot(half), n.dot(to), n.dot(from));
        if let Some(sheen) = &self.sheen {
            value = value * sheen.passes(cos_o).min(sheen.passes(cos_i)) + sheen.value(cos_h, cos_o, cos_i);
        }
        if let Some(coat) = &self.coat {
            let (d, facets) = (coat.facets.density(cos_h), &coat.facets);
            let g = 1.0 / (1.0 + facets.lambda(cos_o) + facets.lambda(cos_i));
            value = value * coat.passes(cos_o).min(coat.passes(cos_i))
                + Vec3::splat(coat.fresnel(to.dot(half)) * (d * g / (4.0 * cos_o * cos_i)));
        }
        value
    }

    /// [`Self::lobe`] and [`Self::density`].
    pub fn lobe_and_density(&self, n: Vec3, to: Vec3, from: Vec3) -> (Rgb, f32) {
        if self.is_layered() {
            return (self.lobe(n, to, from), self.density(n, to, from));
        }
        let (cos_o, cos_i) = (n.dot(to), n.dot(from));
        let half = (to + from).normalize_or_zero();
        if cos_o <= 0.0 || cos_i <= 0.0 || half == Vec3::ZERO {
            return (Vec3::ZERO, 0.0);
        }
        let density = self.facets.density(n.dot(half)) / (4.0 * cos_o);
        let (l_o, l_i) = (self.facets.lambda(cos_o), self.facets.lambda(cos_i));
        let value = self.fresnel.at(to.dot(half)) * (density / (cos_i * (1.0 + l_o + l_i)));
        (value, density / (1.0 + l_o))
    }

    /// A direction of the lobe by visible normals (Heitz 2018), and `f cosθ / density`.
    pub fn sample(&self, n: Vec3, to: Vec3, u: [f32; 2]) -> Option<(Vec3, Rgb)> {
        if self.is_layered() {
            return self.sample_layered(n, to, u);
        }
        let half = self.facets.visible(n, to, warp::disc(u));
        let (from, passed) = self.reflected(n, to, half)?;
        Some((from.normalize(), self.fresnel.at(to.dot(half)) * passed))
    }

    /// A direction of one of several lobes.
    fn sample_layered(&self, n: Vec3, to: Vec3, [mut u, v]: [f32; 2]) -> Option<(Vec3, Rgb)> {
        let mut takes = |share: f32| {
            let is_taken = u < share;
            u = if is_taken { u / share } else { (u - share) / (1.0 - share) };
            is_taken
        };
        let cos = n.dot(to);
        let facets = match (&self.coat, &self.sheen) {
            (Some(coat), _) if takes(self.share_of_coat(coat, cos)) => Some(&coat.facets),
            (_, Some(sheen)) if takes(self.share_of_sheen(sheen, cos)) => None,
            _ => Some(&self.facets),
        };
        let from = match facets {
            Some(facets) => {
                let half = facets.visible(n, to, warp::disc([u, v]));
                (half * (2.0 * to.dot(half)) - to).normalize()
            }
            None => sheen::direction(n, [u, v]),
        };
        let (value, density) = self.lobe_and_density(n, to, from);
        (density > 0.0 && value != Vec3::ZERO).then(|| (from, value * (n.dot(from) / density)))
    }

    /// How often the coat is followed rather than what lies under it: by what either reflects.
    fn share_of_coat(&self, coat: &Coat, cos: f32) -> f32 {
        share(coat.albedo(cos), coat.passes(cos) * self.under_coat(cos).max_element())
    }

    /// How often sheen is followed rather than the lobe under it.
    fn share_of_sheen(&self, sheen: &Sheen, cos: f32) -> f32 {
        share(sheen.albedo(cos).max_element(), sheen.passes(cos) * self.own_albedo(cos).max_element())
    }

    /// Density of [`Self::sample`], sr⁻¹.
    pub fn density(&self, n: Vec3, to: Vec3, from: Vec3) -> f32 {
        let cos_o = n.dot(to);
        let half = (to + from).normalize_or_zero();
        if cos_o <= 0.0 || half == Vec3::ZERO {
            return 0.0;
        }
        let of = |facets: &Facets| facets.density(n.dot(half)) / (4.0 * cos_o * (1.0 + facets.lambda(cos_o)));
        let mut density = of(&self.facets);
        if let Some(sheen) = &self.sheen {
            let p = self.share_of_sheen(sheen, cos_o);
            density = p * sheen::DENSITY + (1.0 - p) * density;
        }
        if let Some(coat) = &self.coat {
            let p = self.share_of_coat(coat, cos_o);
            density = p * of(&coat.facets) + (1.0 - p) * density;
        }
        density
    }

    /// Directional albedo of the lobe, with its layers': of what lies under them no less than it is.
    pub fn lobe_albedo(&self, cos: f32) -> Rgb {
        let under = self.under_coat(cos);
        self.coat.map_or(under, |coat| Vec3::splat(coat.albedo(cos)) + under * coat.passes(cos))
    }

    /// The same without coat.
    fn under_coat(&self, cos: f32) -> Rgb {
        let under = self.own_albedo(cos);
        self.sheen.map_or(under, |sheen| sheen.albedo(cos) + under * sheen.passes(cos))
    }

    /// The same of the lobe alone.
    fn own_albedo(&self, cos: f32) -> Rgb {
        self.fresnel.albedo(albedo::directional(cos, self.alpha()))
    }

    fn mean_hidden(&self) -> Rgb {
        self.hiding.albedo(albedo::mean(self.alpha()))
    }

    /// Where a facet reflects to, and which part of that passes the others: G₂/G₁.
    fn reflected(&self, n: Vec3, to: Vec3, half: Vec3) -> Option<(Vec3, f32)> {
        let from = half * (2.0 * to.dot(half)) - to;
        let (cos_o, cos_i) = (n.dot(to), n.dot(from));
        if cos_o <= 0.0 || cos_i <= 0.0 {
            return None;
        }
        let (l_o, l_i) = (self.facets.lambda(cos_o), self.facets.lambda(cos_i));
        Some((from, (1.0 + l_o) / (1.0 + l_o + l_i)))
    }
}

/// How often one lobe is followed rather than what lies under it, by what either reflects.
fn share(over: f32, under: f32) -> f32 {
    (over / (over + under).max(f32::MIN_POSITIVE)).clamp(0.1, 0.9)
}

/// Places and weights of Gauss and Legendre's sum of eight over 0..1.
const GAUSS: [[f32; 2]; 8] = [
    [0.019_855_07, 0.050_614_27],
    [0.101_666_76, 0.111_190_52],
    [0.237_233_8, 0.156_853_32],
    [0.408_282_68, 0.181_341_89],
    [0.591_717_3, 0.181_341_89],
    [0.762_766_2, 0.156_853_32],
    [0.898_333_25, 0.111_190_52],
    [0.980_144_9, 0.050_614_27],
];

#[cfg(test)]
mod tests {
    use std::f32::consts::PI;

    use super::*;

    /// What the lobe reflects of uniform light by another route than the table's: over facets by D, not over those that
    /// are visible; in double precision.
    fn lobe_integral(f0: f64, alpha: f64, cos: f64) -> f64 {
        const STEPS: usize = 300;
        let lambda = |cos: f64| ((1.0 + alpha * alpha * (1.0 / (cos * cos) - 1.0).max(0.0)).sqrt() - 1.0) / 2.0;
        let sin = (1.0 - cos * cos).sqrt();
        let mut sum = 0.0;
        for i in 0..STEPS {
            // D cosθ dω is even in tan²θ / (tan²θ + α²); squared, so that the far tail is not missed.
            let rest = (i as f64 + 0.5) / STEPS as f64;
            let share = 2.0 * rest;
            let tan2 = alpha * alpha * (1.0 - rest * rest) / (rest * rest);
            let (cos_m, sin_m) = ((1.0 / (1.0 + tan2)).sqrt(), (tan2 / (1.0 + tan2)).sqrt());
            for j in 0..STEPS {
                let turn = (j as f64 + 0.5) / STEPS as f64 * std::f64::consts::PI;
                let met = sin * sin_m * turn.cos() + cos * cos_m;
                let out = 2.0 * met * cos_m - cos;
                if met > 0.0 && out > 0.0 {
                    let fresnel = f0 + (1.0 - f0) * (1.0 - met).powi(5);
                    sum += share * fresnel * met / (cos * cos_m) / (1.0 + lambda(cos) + lambda(out));
                }
            }
        }
        sum / (STEPS * STEPS) as f64
    }

    const ROUGHNESSES: [f32; 10] = [0.032, 0.06, 0.1, 0.12, 0.18, 0.27, 0.4, 0.55, 0.8, 1.0];
    const COSINES: [f32; 10] = [0.01, 0.035, 0.06, 0.1, 0.17, 0.3, 0.5, 0.75, 0.95, 1.0];

    #[test]
    fn a_white_base_under_lacquer_reflects_all_there_is() {
        for (roughness, cos) in ROUGHNESSES.iter().flat_map(|r| COSINES.map(|cos| (*r, cos))) {
            for f0 in [0.02_f32, 0.04, 0.17, 0.5] {
                let m = Glossy::new(Vec3::ONE, roughness, 0.0, Fresnel::of_index(f0));
                let admitted = |i: u32| {
                    let cos = (f64::from(i) + 0.5) / 4000.0;
                    2.0 * cos * f64::from(m.base(1.0, cos as f32).x / m.reflectance(1.0).x) / 4000.0
                };
                let admitted: f64 = (0..4000).map(admitted).sum::<f64>() * std::f64::consts::PI;
                let base = f64::from(m.reflectance(cos).x) * admitted;
                let total = base + lobe_integral(f0.into(), m.alpha().into(), cos.into());
                assert!((total - 1.0).abs() < 0.002, "roughness {roughness} cos {cos} F₀ {f0}: {total}");
            }
        }
    }

    #[test]
    fn white_metals_lose_nothing_on_the_way_over_several_facets() {
        for (roughness, cos) in ROUGHNESSES.iter().flat_map(|r| COSINES.map(|cos| (*r, cos))) {
            let m = Glossy::new(Vec3::ONE, roughness, 1.0, Fresnel::of_index(0.04)).multiply_scattering();
            let admitted = |i: u32| {
                let cos = (f64::from(i) + 0.5) / 4000.0;
                2.0 * cos * f64::from(m.admitted(cos as f32).x) / 4000.0
            };
            let spread = f64::from(m.reflectance(cos).x) * (0..4000).map(admitted).sum::<f64>();
            let total = spread + lobe_integral(1.0, m.alpha().into(), cos.into());
            // The lobe itself is known to three thousandths.
            assert!((total - 1.0).abs() < 0.004, "roughness {roughness} cos {cos}: {total}");
            // Nothing that is not white gains as much, and what lies under a lobe gets the rest.
            let gold =
                Glossy::new(Vec3::new(1.0, 0.7, 0.3), roughness, 1.0, Fresnel::of_index(0.04)).multiply_scattering();
            assert!(gold.diffuse_albedo().cmple(Vec3::splat(1.0 + 1e-4)).all(), "{gold:?}");
            assert!(
                gold.diffuse_albedo().x > gold.diffuse_albedo().y && gold.diffuse_albedo().y > gold.diffuse_albedo().z
            );
            let plastic = Glossy::new(Vec3::ONE, roughness, 0.0, Fresnel::of_index(0.04));
            assert!((plastic.multiply_scattering().diffuse_albedo() - Vec3::ONE).length() < 1e-5, "all already");
        }
    }

    #[test]
    fn the_lobe_reflects_what_the_table_says() {
        for (roughness, cos) in ROUGHNESSES.iter().flat_map(|r| COSINES.map(|cos| (*r, cos))) {
            let m = Glossy::new(Vec3::ONE, roughness, 1.0, Fresnel::of_index(0.04));
            let expected = lobe_integral(1.0, m.alpha().into(), cos.into());
            let table = f64::from(m.lobe_albedo(cos).x);
            assert!((table - expected).abs() < 0.003, "roughness {roughness} cos {cos}: {table}, {expected}");
            let to = Vec3::new((1.0 - cos * cos).sqrt(), 0.0, cos);
            let count = 1 << 14;
            let u = |i: u32| [0, 1].map(|d| (crate::sample::mix(2 * i + d) >> 8) as f32 / 16_777_216.0);
            let drawn = (0..count).filter_map(|i| m.sample(Vec3::Z, to, u(i))).map(|(_, weight)| f64::from(weight.x));
            let drawn = drawn.sum::<f64>() / f64::from(count);
            assert!((drawn - expected).abs() < 0.015, "roughness {roughness} cos {cos}: {drawn}, {expected}");
        }
    }

    /// Facets of a colour take as much of all channels from the base, which keeps its hue (KHR_materials_specular).
    #[test]
    fn coloured_highlights_leave_the_base_its_hue() {
        let red = Fresnel::of_index(0.5).times(0.8, Vec3::new(1.5, 0.2, 0.0));
        let m = Glossy::new(Vec3::ONE, 0.4, 0.0, red);
        let base = m.base(0.7, 0.9);
        assert!(base == Vec3::splat(base.x) && base.x > 0.0, "{base}");
        let red_alone = Glossy::new(Vec3::ONE, 0.4, 0.0, Fresnel { f0: Vec3::splat(red.f0.x), ..red });
        assert_eq!(base, red_alone.base(0.7, 0.9));
        assert!(m.lobe_albedo(0.7).x > 3.0 * m.lobe_albedo(0.7).y, "{}", m.lobe_albedo(0.7));
    }

    #[test]
    fn the_bsdf_is_reciprocal() {
        let plain = Glossy::new(Vec3::new(0.8, 0.5, 0.1), 0.5, 0.3, Fresnel::of_index(0.04));
        for m in [plain, plain.coated(0.7, 0.3), plain.with_sheen(Vec3::new(0.9, 0.4, 0.1), 0.3).coated(0.7, 0.3)] {
            let (a, b) = (Vec3::new(0.6, 0.0, 0.8), Vec3::new(0.0, 0.28, 0.96));
            assert!((m.lobe(Vec3::Z, a, b) - m.lobe(Vec3::Z, b, a)).length() < 1e-6);
            assert!((m.base(a.z, b.z) - m.base(b.z, a.z)).length() < 1e-6);
        }
    }

    /// White things under a coat, metal and not: what comes back of uniform light.
    #[test]
    fn a_coat_makes_no_light_and_loses_little() {
        for (roughness, cos) in ROUGHNESSES.iter().flat_map(|r| COSINES.map(|cos| (*r, cos))) {
            for (under, amount) in [(0.0, 1.0), (0.1, 1.0), (0.5, 1.0), (1.0, 0.5)] {
                for metalness in [0.0, 1.0] {
                    let m = Glossy::new(Vec3::ONE, under, metalness, Fresnel::of_index(0.04)).coated(amount, roughness);
                    let admitted = |i: u32| {
                        let cos = (f64::from(i) + 0.5) / 4000.0;
                        2.0 * cos * f64::from(m.base(1.0, cos as f32).x / m.reflectance(1.0).x) / 4000.0
                    };
                    let base = match metalness {
                        0.0 => (0..4000).map(admitted).sum::<f64>() * std::f64::consts::PI,
                        _ => 0.0,
                    };
                    let base = f64::from(m.reflectance(cos).x) * base;
                    let to = Vec3::new((1.0 - cos * cos).sqrt(), 0.0, cos);
                    let count = 1 << 13;
                    let u = |i: u32| [0, 1].map(|d| (crate::sample::mix(2 * i + d) >> 8) as f32 / 16_777_216.0);
                    let drawn = (0..count).filter_map(|i| m.sample(Vec3::Z, to, u(i)));
                    let drawn = drawn.map(|(_, weight)| f64::from(weight.x)).sum::<f64>() / f64::from(count);
                    // Two lobes of a metal, one of which facets lose light of (`lobe_integral`).
                    let kept = lobe_integral(1.0, f64::from(under * under).max(1e-3), cos.into());
                    let least = if metalness == 1.0 { kept - 0.08 } else { 0.97 };
                    let what = format!("coat of {amount}, {roughness} over {under}, metal {metalness}, cos {cos}");
                    let total = base + drawn;
                    assert!(total < 1.012 && total > least, "{what}: {total}, least {least}");
                    let bound = base + f64::from(m.lobe_albedo(cos).x);
                    assert!(bound < 1.002, "{what}: at most {bound}");
                }
            }
        }
    }

    /// White things under white sheen, metal and not, and under a coat as well: a white base gets all that the layers leave.
    #[test]
    fn sheen_makes_no_light_and_loses_little() {
        for (roughness, cos) in [0.1_f32, 0.2, 0.3, 0.5, 0.8, 1.0].iter().flat_map(|r| COSINES.map(|cos| (*r, cos))) {
            for (metalness, coat) in [(0.0, 0.0), (0.0, 1.0), (1.0, 0.0), (1.0, 1.0)] {
                let m = Glossy::new(Vec3::ONE, 0.6, metalness, Fresnel::of_index(0.04));
                let m = m.with_sheen(Vec3::ONE, roughness).coated(coat, 0.2);
                let admitted = |i: u32| {
                    let cos = (f64::from(i) + 0.5) / 4000.0;
                    2.0 * cos * f64::from(m.admitted(cos as f32).x) / 4000.0
                };
                let base = f64::from(m.reflectance(cos).x) * (0..4000).map(admitted).sum::<f64>();
                let to = Vec3::new((1.0 - cos * cos).sqrt(), 0.0, cos);
                let count = 1 << 14;
                let u = |i: u32| [0, 1].map(|d| (crate::sample::mix(2 * i + d) >> 8) as f32 / 16_777_216.0);
                let drawn = (0..count).filter_map(|i| m.sample(Vec3::Z, to, u(i)));
                let drawn = drawn.map(|(_, weight)| f64::from(weight.x)).sum::<f64>() / f64::from(count);
                let what = format!("sheen of {roughness} over metal {metalness}, coat {coat}, cos {cos}");
                // What facets of metal pass on to each other is lost; of what passes the sheen one way, more.
                let least = if metalness == 1.0 { 0.5 } else { 0.95 };
                assert!(base + drawn < 1.012 && base + drawn > least, "{what}: {}", base + drawn);
                let bound = base + f64::from(m.lobe_albedo(cos).x);
                assert!(bound < 1.002, "{what}: at most {bound}");
            }
        }
    }

    #[test]
    fn sampled_directions_match_their_density() {
        let metal = Glossy::new(Vec3::ONE, 0.7, 1.0, Fresnel::of_index(0.04));
        directions_match_their_density(metal);
        directions_match_their_density(metal.coated(1.0, 0.5));
        directions_match_their_density(metal.with_sheen(Vec3::ONE, 0.5));
        directions_match_their_density(metal.with_sheen(Vec3::ONE, 0.5).coated(1.0, 0.5));
    }

    /// χ² of sampled directions against the density, over 8×8 cells of the hemisphere.
    fn directions_match_their_density(m: Glossy) {
        const CELLS: usize = 8;
        let to = Vec3::new(0.6, 0.0, 0.8);
        let cell = |w: Vec3| {
            let turns = (w.y.atan2(w.x) / (2.0 * PI)).rem_euclid(1.0);
            ((w.z * CELLS as f32) as usize).min(7) * CELLS + ((turns * CELLS as f32) as usize).min(7)
        };
        // Expected share of each cell: the density integrated by a fine grid.
        let mut share = [0.0_f64; CELLS * CELLS];
        const FINE: usize = 800;
        for i in 0..FINE * FINE {
            let z = ((i % FINE) as f32 + 0.5) / FINE as f32;
            let (sin, cos) = warp::turn(((i / FINE) as f32 + 0.5) / FINE as f32);
            let r = (1.0 - z * z).sqrt();
            let w = Vec3::new(r * cos, r * sin, z);
            share[cell(w)] += f64::from(m.density(Vec3::Z, to, w)) * f64::from(2.0 * PI) / (FINE * FINE) as f64;
        }
        let n = 100_000_u32;
        let mut counts = [0.0_f64; CELLS * CELLS];
        let mut kept = 0.0;
        for i in 0..n {
            let u = [0, 1].map(|d| (crate::sample::mix(2 * i + d) >> 8) as f32 / 16_777_216.0);
            if let Some((w, weight)) = m.sample(Vec3::Z, to, u) {
                counts[cell(w)] += 1.0;
                kept += 1.0;
                let expected = m.lobe(Vec3::Z, to, w) * (w.z / m.density(Vec3::Z, to, w));
                assert!((weight - expected).length() < 1e-3 * (1.0 + expected.length()));
            }
        }
        assert!(kept > 0.8 * f64::from(n));
        let x2: f64 = counts
            .iter()
            .zip(share)
            .filter(|(_, s)| *s > 1e-4)
            .map(|(c, s)| (c - s * f64::from(n)).powi(2) / (s * f64::from(n)))
            .sum();
        assert!(x2 < 120.0, "χ² = {x2}");
    }
}
