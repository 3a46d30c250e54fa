//! Clear lacquer over a glossy surface: a second GGX lobe, and what it lets through to the rest.
//!
//! With E_c, the directional albedo of the coat's lobe times how much of it there is, `T(ω) = 1 − E_c(ω)` passes. A ray that is
//! reflected below passes twice, but what the coat throws back to below is not lost. So what lies under it counts by
//! `min(T(ω_o), T(ω_i))`: exact for flat mirrors, where both are equal and all orders add up; reciprocal; and never more
//! light than came. The base is coupled to both lobes as in [`super`], with `(1 − E_c)(1 − E)` for `1 − E`.

use super::albedo;
use crate::facets::Facets;

/// Reflectance of the coat along the normal: that of index 1.5, as KHR_materials_clearcoat has it.
pub const F0: f32 = 0.04;

/// A coat at a point, textures looked up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Coat {
    /// How much of it there is, 0..1.
    pub amount: f32,
    /// What its surface is made of.
    pub facets: Facets,
}

impl Coat {
    /// What its lobe reflects towards a direction of light that is the same from everywhere.
    pub fn albedo(&self, cos: f32) -> f32 {
        let [a, b] = albedo::directional(cos, self.facets.alpha());
        self.amount * (F0 * a + b)
    }

    /// What gets through.
    pub fn passes(&self, cos: f32) -> f32 {
        1.0 - self.albedo(cos)
    }

    /// [`Self::albedo`], averaged by cosines.
    pub fn mean(&self) -> f32 {
        let [a, b] = albedo::mean(self.facets.alpha());
        self.amount * (F0 * a + b)
    }

    /// [`Self::albedo`] times A and B of a lobe of some α ([`albedo::directional`]), averaged likewise.
    pub fn mean_with(&self, alpha: f32) -> [f32; 2] {
        albedo::mean_under_coat(self.facets.alpha(), alpha).map(|mean| self.amount * mean)
    }

    /// Schlick's, of its facets, times its amount.
    pub fn fresnel(&self, cos: f32) -> f32 {
        let m = (1.0 - cos).clamp(0.0, 1.0);
        let m5 = m * m * m * m * m;
        self.amount * (F0 + (1.0 - F0) * m5)
    }
}
