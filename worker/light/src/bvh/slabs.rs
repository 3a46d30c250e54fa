//! Rays against boxes: slabs [Kay & Kajiya 1986], robust and **monotone**.
//!
//! Every operation of the test (subtract the origin, multiply by the reciprocal of the direction,
//! take minima and maxima) is a correctly rounded monotone function of the box's faces. So a ray that
//! passes the test of a box passes that of every box around it, in floating point, to the last bit.
//! As passing the test of a triangle's own box is part of what a hit *is* ([`super::triangle`]), no
//! tree built over the triangles can lose one: closest hits and occlusion are the same for every
//! tree, every order and every grouping.
//!
//! The ray is widened by [`WIDENING`] of the largest coordinate at hand, several times more than
//! subtraction and edge functions can be off, so that hits are not refused by rounding.
//!
//! Where the direction is zero along an axis its reciprocal is infinite: a face is then infinitely
//! far ahead or behind, or, where the origin lies exactly on it, NaN, which `min` and `max`
//! ignore as their first operand. −0 is made +0 first.

use glam::Vec3;

use super::bounds::Aabb;
use super::lanes::{Lanes, max, min};
use super::vector::V3;

/// By how much a ray is thicker than a line, relative to the coordinates it is compared with.
pub(super) const WIDENING: f32 = 1.0 / (1 << 19) as f32;

/// A ray made ready to meet boxes.
#[derive(Clone, Copy, Debug)]
pub(super) struct Slabs {
    /// Subtracted from the least corner of a box.
    pub low_origin: Vec3,
    /// Subtracted from the greatest corner.
    pub high_origin: Vec3,
    /// Reciprocal of the direction.
    pub inverse: Vec3,
    /// End of the ray.
    pub t_max: f32,
}

impl Slabs {
    /// For boxes with no coordinate beyond `reach`.
    #[inline(always)]
    pub fn new(origin: Vec3, direction: Vec3, t_max: f32, reach: f32) -> Self {
        let thickness = thickness(origin, reach);
        Self {
            low_origin: origin + thickness,
            high_origin: origin - thickness,
            inverse: (direction + Vec3::ZERO).recip(),
            t_max,
        }
    }

    /// The least t in `[0, t_max]` at which the widened ray may be in the box, if any.
    #[inline(always)]
    pub fn meets(&self, bounds: &Aabb) -> Option<f32> {
        let low = (bounds.min - self.low_origin) * self.inverse;
        let high = (bounds.max - self.high_origin) * self.inverse;
        let (mut near, mut far) = (0.0, self.t_max);
        for axis in 0..3 {
            let forward = self.inverse[axis] >= 0.0;
            let (enter, leave) = if forward { (low[axis], high[axis]) } else { (high[axis], low[axis]) };
            near = max(enter, near);
            far = min(leave, far);
        }
        (near <= far).then_some(near)
    }
}

/// How far a ray from `origin` reaches to each side.
#[inline(always)]
pub(super) fn thickness(origin: Vec3, reach: f32) -> Vec3 {
    Vec3::splat(WIDENING * origin.abs().max_element().max(reach))
}

/// [`Slabs::meets`] for rays that end at `far` and have these reciprocals of their directions; `low` and
/// `high` are the corners of the box minus the origins.
#[inline(always)]
pub(super) fn meets_lanes<F: Lanes>(proof: F::Proof, low: Vec3, high: Vec3, inverse: V3<F>, mut far: F) -> u32 {
    let zero = F::splat(proof, 0.0);
    let (low, high) = (V3::<F>::splat(proof, low).to_array(), V3::<F>::splat(proof, high).to_array());
    let mut near = zero;
    let inverse = inverse.to_array();
    for axis in 0..3 {
        let forward = inverse[axis].ge(zero);
        let (low, high) = (low[axis] * inverse[axis], high[axis] * inverse[axis]);
        near = F::select(forward, low, high).max(near);
        far = F::select(forward, high, low).min(far);
    }
    F::bits(near.le(far))
}
