//! Axis-aligned boxes.

use glam::Vec3;

/// An axis-aligned box; empty where `min > max`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Aabb {
    /// Least corner.
    pub min: Vec3,
    /// Greatest corner.
    pub max: Vec3,
}

impl Aabb {
    /// Contains nothing; the neutral element of [`Self::union`].
    pub const EMPTY: Self = Self { min: Vec3::INFINITY, max: Vec3::NEG_INFINITY };

    /// The smallest box around some points.
    pub fn of(points: impl IntoIterator<Item = Vec3>) -> Self {
        points.into_iter().fold(Self::EMPTY, |bounds, p| Self { min: bounds.min.min(p), max: bounds.max.max(p) })
    }

    /// The smallest box around both.
    pub fn union(self, other: Self) -> Self {
        Self { min: self.min.min(other.min), max: self.max.max(other.max) }
    }

    /// Contains no point.
    pub fn is_empty(&self) -> bool {
        !(self.min.cmple(self.max)).all()
    }

    /// From corner to corner; zero if empty.
    pub fn diagonal(&self) -> Vec3 {
        if self.is_empty() { Vec3::ZERO } else { self.max - self.min }
    }

    /// The middle; the origin if empty.
    pub fn centre(&self) -> Vec3 {
        if self.is_empty() { Vec3::ZERO } else { self.min * 0.5 + self.max * 0.5 }
    }

    /// Half the surface area: what the surface-area heuristic compares.
    pub fn half_area(&self) -> f32 {
        let d = self.diagonal();
        d.x * d.y + d.y * d.z + d.z * d.x
    }

    /// Greatest absolute coordinate; 0 if empty.
    pub fn reach(&self) -> f32 {
        if self.is_empty() { 0.0 } else { self.min.abs().max(self.max.abs()).max_element() }
    }

    /// All eight corners.
    pub fn corners(&self) -> [Vec3; 8] {
        let pick = |bit: usize, min: f32, max: f32| if bit == 0 { min } else { max };
        std::array::from_fn(|i| {
            Vec3::new(
                pick(i & 1, self.min.x, self.max.x),
                pick(i & 2, self.min.y, self.max.y),
                pick(i & 4, self.min.z, self.max.z),
            )
        })
    }

    /// Grown by `margin` on all sides.
    pub fn grown(self, margin: f32) -> Self {
        Self { min: self.min - Vec3::splat(margin), max: self.max + Vec3::splat(margin) }
    }
}
