//! What facets reflect by the angle that light meets them at: Schlick's approximation (1994), with a colour along the
//! normal and a grey at grazing angles (KHR_materials_specular).

use glam::Vec3;
use scenes::Rgb;

/// Reflectance of a facet, 0..1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fresnel {
    /// Along the normal.
    pub f0: Rgb,
    /// At grazing angles.
    pub f90: f32,
}

impl Fresnel {
    /// Of a non-metal that reflects so much along the normal, and all that grazes it.
    pub fn of_index(f0: f32) -> Self {
        Self { f0: Vec3::splat(f0), f90: 1.0 }
    }

    /// The same times a factor at all angles, 0..1, and one along the normal, after which no more than all is reflected.
    #[must_use]
    pub fn times(self, amount: f32, colour: Rgb) -> Self {
        Self { f0: (self.f0 * colour).min(Vec3::ONE) * amount, f90: self.f90 * amount }
    }

    /// Of a mixture with a metal of some colour.
    pub(super) fn towards_metal(self, colour: Rgb, metalness: f32) -> Self {
        let rest = 1.0 - metalness;
        // What is 1 stays so to the bit.
        Self { f0: self.f0 * rest + colour * metalness, f90: 1.0 - (1.0 - self.f90) * rest }
    }

    /// Grey, as much as of the channel of which most is reflected.
    pub(super) fn of_brightest_channel(self) -> Self {
        Self { f0: Vec3::splat(self.f0.max_element()), ..self }
    }

    /// Of light that meets the facet at a cosine from its normal.
    pub fn at(&self, cos: f32) -> Rgb {
        let m = (1.0 - cos).clamp(0.0, 1.0);
        let m5 = m * m * m * m * m;
        self.f0 + (Vec3::splat(self.f90) - self.f0) * m5
    }

    /// Averaged over a hemisphere by cosines.
    pub(super) fn mean(&self) -> Rgb {
        self.f0 + (Vec3::splat(self.f90) - self.f0) / 21.0
    }

    /// What a lobe reflects of uniform light, given A and B ([`super::albedo`]).
    pub(super) fn albedo(&self, [a, b]: [f32; 2]) -> Rgb {
        self.f0 * a + Vec3::splat(self.f90 * b)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The extension's formulas: F₀ = min(f₀ · colour, 1) · amount, F₉₀ = amount.
    #[test]
    fn factors_are_those_of_the_extension() {
        let plastic = Fresnel::of_index(0.04);
        assert_eq!(plastic.times(1.0, Vec3::ONE), plastic);
        let bright = plastic.times(0.5, Vec3::new(50.0, 1.0, 0.0));
        assert_eq!(bright, Fresnel { f0: Vec3::new(0.5, 0.02, 0.0), f90: 0.5 });
        assert_eq!((bright.at(1.0), bright.at(0.0)), (bright.f0, Vec3::splat(0.5)));
        // Metal knows nothing of them.
        let gold = Vec3::new(1.0, 0.7, 0.3);
        assert_eq!(bright.towards_metal(gold, 1.0), Fresnel { f0: gold, f90: 1.0 });
    }
}
