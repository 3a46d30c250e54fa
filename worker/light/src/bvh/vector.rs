//! Three-vectors of lanes.

use glam::Vec3;

use super::lanes::Lanes;

/// A three-vector in each lane.
#[derive(Clone, Copy)]
pub(super) struct V3<F> {
    pub x: F,
    pub y: F,
    pub z: F,
}

impl<F: Lanes> V3<F> {
    #[inline(always)]
    pub fn splat(proof: F::Proof, v: Vec3) -> Self {
        Self { x: F::splat(proof, v.x), y: F::splat(proof, v.y), z: F::splat(proof, v.z) }
    }

    #[inline(always)]
    pub fn load(proof: F::Proof, [x, y, z]: [&[f32]; 3]) -> Self {
        Self { x: F::load(proof, x), y: F::load(proof, y), z: F::load(proof, z) }
    }

    #[inline(always)]
    pub fn load8(proof: F::Proof, [x, y, z]: &[[f32; 8]; 3]) -> Self {
        Self::load(proof, [x, y, z])
    }

    #[inline(always)]
    pub fn add(self, other: Self) -> Self {
        Self { x: self.x + other.x, y: self.y + other.y, z: self.z + other.z }
    }

    #[inline(always)]
    pub fn sub(self, other: Self) -> Self {
        Self { x: self.x - other.x, y: self.y - other.y, z: self.z - other.z }
    }

    #[inline(always)]
    pub fn to_array(self) -> [F; 3] {
        [self.x, self.y, self.z]
    }

    /// Always `(xx + yy) + zz`: the order is part of the result.
    #[inline(always)]
    pub fn dot(self, other: Self) -> F {
        self.x * other.x + self.y * other.y + self.z * other.z
    }

    #[inline(always)]
    pub fn cross(self, other: Self) -> Self {
        Self {
            x: self.y * other.z - self.z * other.y,
            y: self.z * other.x - self.x * other.z,
            z: self.x * other.y - self.y * other.x,
        }
    }

    /// Least and greatest value of [`Self::dot`] with a vector between two others.
    #[inline(always)]
    pub fn dot_interval(self, least: Self, greatest: Self) -> (F, F) {
        let (x, ox) = (self.x * least.x, self.x * greatest.x);
        let (y, oy) = (self.y * least.y, self.y * greatest.y);
        let (z, oz) = (self.z * least.z, self.z * greatest.z);
        (x.min(ox) + y.min(oy) + z.min(oz), x.max(ox) + y.max(oy) + z.max(oz))
    }
}
