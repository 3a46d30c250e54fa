//! The one triangle test, which every kernel performs operation by operation.
//!
//! **Edge-consistent.** Seen from a ray's origin o, the edge from p to q has the edge function
//! `e(d) = ((p − q) × ((p − o) + (q − o))) · d`, twice the Plücker product of line and edge. Swapping
//! p and q negates each intermediate result exactly, so two triangles that share an edge agree bit
//! for bit on which side of it a ray passes, and rays that meet it (`e = 0`) hit both: none slips
//! between. [after Davidovič et al., "3D Rasterization: A Bridge between Rasterization and Ray
//! Casting", 2012]
//!
//! **A hit**, for a ray `o + t·d` with `0 < t < t_max`, is a triangle
//! 1. whose three edge functions have no two opposite signs,
//! 2. whose plane is met within that range of t, and
//! 3. whose bounding box passes [`Slabs::meets`].
//!
//! The third looks redundant; it is what makes results independent of how boxes are nested and rays
//! are grouped: see [`super::slabs`]. It also refuses triangles seen exactly edge-on, where rounding
//! decides the first two.
//!
//! All of it is homogeneous in the coordinates: scaling a scene by a power of two changes no bit of
//! the result.

use glam::Vec3;

use super::bounds::Aabb;
use super::lanes::{Lanes, max, min};
use super::slabs::Slabs;
use super::vector::V3;

/// Marks an unused lane of a [`Block`].
pub(super) const NONE: u32 = u32::MAX;

/// Eight triangles as structure of arrays. Unused lanes, and those whose triangle was taken out, hold a degenerate
/// triangle, which nothing hits.
#[derive(Clone)]
#[repr(C, align(64))]
pub(super) struct Block {
    /// `[vertex][axis][lane]`.
    pub vertices: [[[f32; 8]; 3]; 3],
    /// Index of each triangle in its mesh, or [`NONE`].
    pub ids: [u32; 8],
}

/// Triangles as seen from a point: what is the same for all rays from there.
#[derive(Clone, Copy)]
pub(super) struct Seen<F> {
    /// Edge functions: dot with the direction. Edge i is opposite vertex i.
    pub edges: [V3<F>; 3],
    /// Geometric normal, not normalised.
    pub normal: V3<F>,
    /// Distance of the plane along the normal, times the normal's length.
    pub height: F,
}

/// How rays meet triangles.
pub(super) struct Meeting<F: Lanes> {
    /// Conditions 1 and 2.
    pub mask: F::Mask,
    /// Values of the edge functions: barycentric coordinates up to a factor.
    pub edges: [F; 3],
    /// `normal · direction`.
    pub slope: F,
}

impl Block {
    /// Up to eight triangles.
    pub fn new(triangles: impl Iterator<Item = (u32, [Vec3; 3])>) -> Self {
        let mut block = Self { vertices: [[[0.0; 8]; 3]; 3], ids: [NONE; 8] };
        for (lane, (id, corners)) in triangles.take(8).enumerate() {
            block.ids[lane] = id;
            block.put(lane, corners);
        }
        block
    }

    /// Gives a lane other corners; three times the same make it one that nothing hits.
    pub fn put(&mut self, lane: usize, corners: [Vec3; 3]) {
        for (vertex, corner) in corners.iter().enumerate() {
            for axis in 0..3 {
                self.vertices[vertex][axis][lane] = corner[axis];
            }
        }
    }

    /// The corners of one triangle.
    #[inline(always)]
    pub fn corners(&self, lane: usize) -> [Vec3; 3] {
        let corner = |vertex: usize| {
            let [x, y, z] = &self.vertices[vertex];
            Vec3::new(x[lane], y[lane], z[lane])
        };
        [corner(0), corner(1), corner(2)]
    }

    /// All eight, seen from a point.
    #[inline(always)]
    pub fn seen_from<F: Lanes>(&self, proof: F::Proof, origin: Vec3) -> Seen<F> {
        let [p, q, r] = &self.vertices;
        Seen::new([V3::load8(proof, p), V3::load8(proof, q), V3::load8(proof, r)], V3::splat(proof, origin))
    }
}

impl<F: Lanes> Seen<F> {
    #[inline(always)]
    pub fn new([p, q, r]: [V3<F>; 3], origin: V3<F>) -> Self {
        let (qr, rp, pq) = (q.sub(r), r.sub(p), p.sub(q));
        let (p, q, r) = (p.sub(origin), q.sub(origin), r.sub(origin));
        let normal = rp.cross(pq);
        Self { edges: [qr.cross(q.add(r)), rp.cross(r.add(p)), pq.cross(p.add(q))], normal, height: normal.dot(p) }
    }

    /// Values of the edge functions.
    #[inline(always)]
    pub fn edges_along(&self, direction: V3<F>) -> [F; 3] {
        [self.edges[0].dot(direction), self.edges[1].dot(direction), self.edges[2].dot(direction)]
    }

    /// Conditions 1 and 2 for rays in these directions.
    #[inline(always)]
    pub fn meets(&self, zero: F, direction: V3<F>, t_max: F) -> Meeting<F> {
        let edges = self.edges_along(direction);
        let slope = self.normal.dot(direction);
        let mask = same_side(zero, edges) & self.in_range(zero, slope, t_max);
        Meeting { mask, edges, slope }
    }

    /// Which of eight triangles may meet conditions 1 and 2 for some direction within a box.
    ///
    /// Sums of products of intervals, in the order of the exact test: rounding is monotone, so no
    /// triangle that the exact test accepts is left out.
    #[inline(always)]
    pub fn candidates(&self, proof: F::Proof, least: Vec3, greatest: Vec3, t_max: f32) -> u32 {
        let zero = F::splat(proof, 0.0);
        let (least, greatest) = (V3::splat(proof, least), V3::splat(proof, greatest));
        let a = self.edges[0].dot_interval(least, greatest);
        let b = self.edges[1].dot_interval(least, greatest);
        let c = self.edges[2].dot_interval(least, greatest);
        let sides = a.1.min(b.1.min(c.1)).ge(zero) | a.0.max(b.0.max(c.0)).le(zero);
        let (slope_least, slope_greatest) = self.normal.dot_interval(least, greatest);
        let (height, t_max) = (self.height, F::splat(proof, t_max));
        let before_end = (zero.lt(height) & height.lt(slope_greatest * t_max))
            | (height.lt(zero) & (slope_least * t_max).lt(height));
        F::bits(sides & before_end)
    }

    /// For [`Self::broadcast`].
    #[inline(always)]
    pub fn to_arrays(self) -> [[f32; 8]; 13] {
        let mut all = [[0.0; 8]; 13];
        let vectors = [self.edges[0], self.edges[1], self.edges[2], self.normal];
        for i in 0..4 {
            vectors[i].x.store(&mut all[3 * i]);
            vectors[i].y.store(&mut all[3 * i + 1]);
            vectors[i].z.store(&mut all[3 * i + 2]);
        }
        self.height.store(&mut all[12]);
        all
    }

    /// One of eight triangles, in all lanes.
    #[inline(always)]
    pub fn broadcast(proof: F::Proof, all: &[[f32; 8]; 13], lane: usize) -> Self {
        let vector = |i: usize| Vec3::new(all[i][lane], all[i + 1][lane], all[i + 2][lane]);
        let edges = [V3::splat(proof, vector(0)), V3::splat(proof, vector(3)), V3::splat(proof, vector(6))];
        Self { edges, normal: V3::splat(proof, vector(9)), height: F::splat(proof, all[12][lane]) }
    }

    /// Condition 2: `0 < height / slope < t_max`, without the division.
    #[inline(always)]
    pub fn in_range(&self, zero: F, slope: F, t_max: F) -> F::Mask {
        let height = self.height.flip(slope);
        zero.lt(height) & height.lt(t_max * slope.abs())
    }
}

/// Condition 1: no two of them have opposite signs.
#[inline(always)]
pub(super) fn same_side<F: Lanes>(zero: F, [a, b, c]: [F; 3]) -> F::Mask {
    a.min(b.min(c)).ge(zero) | a.max(b.max(c)).le(zero)
}

/// A triangle's box.
#[inline(always)]
pub(super) fn bounds_of([p, q, r]: [Vec3; 3]) -> Aabb {
    let least = |a: Vec3, b: Vec3| Vec3::new(min(a.x, b.x), min(a.y, b.y), min(a.z, b.z));
    let greatest = |a: Vec3, b: Vec3| Vec3::new(max(a.x, b.x), max(a.y, b.y), max(a.z, b.z));
    Aabb { min: least(p, least(q, r)), max: greatest(p, greatest(q, r)) }
}

/// Condition 3; where it holds, the least t at which the ray may be in the triangle's box.
#[inline(always)]
pub(super) fn in_box(corners: [Vec3; 3], slabs: &Slabs) -> Option<f32> {
    slabs.meets(&bounds_of(corners))
}
