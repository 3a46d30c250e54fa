//! The slab test for many rays at once: the direction is an interval.
//!
//! All rays have one origin and directions within a box. Where no direction changes sign along an
//! axis, the ray whose component there is largest is the first to enter a slab, and the slowest the
//! last to leave. Where some do, rays enter from both sides, and may never leave. Each bound is
//! computed by the operations [`super::slabs`] uses for single rays, from directions at the ends of
//! the interval; as those operations are monotone, also after rounding, a box that any of the rays
//! meets is never refused.

use glam::Vec3;

use super::bounds::Aabb;
use super::lanes::Lanes;
use super::tree::Node;
use super::vector::V3;

/// Rays from one origin, with directions within a box.
pub(super) struct Interval {
    /// Those that find where the first ray enters, then those that find where the last one leaves.
    tests: [Test; 6],
    enters: usize,
}

/// `t = (face − origin) · inverse`.
#[derive(Clone, Copy, Default)]
struct Test {
    /// Index into [`Node::faces`].
    face: usize,
    origin: f32,
    inverse: f32,
}

impl Test {
    #[inline(always)]
    fn t<F: Lanes>(&self, proof: F::Proof, node: &Node) -> F {
        (F::load(proof, &node.faces[self.face]) - F::splat(proof, self.origin)) * F::splat(proof, self.inverse)
    }
}

impl Interval {
    /// The origins are those of [`super::slabs::Slabs`].
    #[inline(always)]
    pub fn new(directions: &Aabb, low_origin: Vec3, high_origin: Vec3) -> Self {
        let mut interval = Self { tests: [Test::default(); 6], enters: 0 };
        let mut leaves = 6;
        for axis in 0..3 {
            let (least, greatest) = (directions.min[axis], directions.max[axis]);
            let low = |inverse: f32| Test { face: axis, origin: low_origin[axis], inverse };
            let high = |inverse: f32| Test { face: axis + 3, origin: high_origin[axis], inverse };
            let (enter, other, other_enters) = if least > 0.0 {
                (low(1.0 / greatest), high(1.0 / least), false)
            } else if greatest < 0.0 {
                (high(1.0 / least), low(1.0 / greatest), false)
            } else {
                // Of a zero, whatever its sign, the infinity that points outwards.
                (low(1.0 / greatest.abs()), high(-1.0 / least.abs()), true)
            };
            interval.tests[interval.enters] = enter;
            interval.enters += 1;
            if other_enters {
                interval.tests[interval.enters] = other;
                interval.enters += 1;
            } else {
                leaves -= 1;
                interval.tests[leaves] = other;
            }
        }
        interval
    }

    /// Which children of a node some ray may meet before `end`, and before which t none meets them.
    /// If `end` is infinite and directions go all ways, empty slots are among them.
    #[inline(always)]
    pub fn meets<F: Lanes>(&self, proof: F::Proof, node: &Node, end: f32) -> (u32, F) {
        let (mut near, mut far) = (F::splat(proof, 0.0), F::splat(proof, end));
        for test in &self.tests[..self.enters] {
            near = test.t::<F>(proof, node).max(near);
        }
        for test in &self.tests[self.enters..] {
            far = test.t::<F>(proof, node).min(far);
        }
        (F::bits(near.le(far)), near)
    }
}

/// Eight intervals of directions from one origin, to be tested against one box at a time.
#[derive(Clone, Default)]
pub(super) struct GroupIntervals {
    /// Multiplies (least corner − origin) where rays enter there, else 0.
    enter_low: [[f32; 8]; 3],
    /// Multiplies (greatest corner − origin) where rays enter there, else 0.
    enter_high: [[f32; 8]; 3],
    /// Multiplies both; the greater is where the last ray leaves.
    leave: [[f32; 8]; 3],
    /// ∞ where rays may never leave, else −∞.
    never: [[f32; 8]; 3],
}

impl GroupIntervals {
    /// To the bounds of directions: least x, y, z, then greatest x, y, z.
    #[inline(always)]
    pub fn set<F: Lanes>(&mut self, proof: F::Proof, spans: &[[f32; 8]; 6]) {
        let (zero, one) = (F::splat(proof, 0.0), F::splat(proof, 1.0));
        let infinity = F::splat(proof, f32::INFINITY);
        for axis in 0..3 {
            let (least, greatest) = (F::load(proof, &spans[axis]), F::load(proof, &spans[axis + 3]));
            let (forward, backward) = (zero.lt(least), greatest.lt(zero));
            let (by_least, by_greatest) = (one / least.abs(), one / greatest.abs());
            F::select(backward, zero, by_greatest).store(&mut self.enter_low[axis]);
            F::select(forward, zero, zero - by_least).store(&mut self.enter_high[axis]);
            let leave = F::select(forward, by_least, F::select(backward, zero - by_greatest, zero));
            leave.store(&mut self.leave[axis]);
            F::select(forward | backward, zero - infinity, infinity).store(&mut self.never[axis]);
        }
    }

    /// Which groups may meet a box before they end at `far`; the box is given by its corners minus the
    /// origins of [`super::slabs::Slabs`].
    #[inline(always)]
    pub fn meet<F: Lanes>(&self, proof: F::Proof, low: Vec3, high: Vec3, mut far: F) -> u32 {
        let mut near = F::splat(proof, 0.0);
        let (low, high) = (V3::<F>::splat(proof, low).to_array(), V3::<F>::splat(proof, high).to_array());
        for axis in 0..3 {
            near = (low[axis] * F::load(proof, &self.enter_low[axis])).max(near);
            near = (high[axis] * F::load(proof, &self.enter_high[axis])).max(near);
            let leave = F::load(proof, &self.leave[axis]);
            let last = (low[axis] * leave).max(high[axis] * leave);
            far = F::load(proof, &self.never[axis]).max(last).min(far);
        }
        F::bits(near.le(far))
    }
}
