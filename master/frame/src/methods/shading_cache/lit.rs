//! Light on the leaves in sight, as pictures show it: interpolated between corners.
//!
//! **Seams.** A leaf beside finer ones has vertices on its edges that are none of its corners, and a line of light would show
//! there. It is shown as if it were divided at them, as often as they are:
//!
//! ```text
//!        c                 m and n belong to what lies beyond a–b. The leaf is shown as its quarters; the other corners that
//!       / \                this makes are means of the ends of their edges, so that nothing changes along edges that have no
//!      o---o               vertices of their own, and everything that is shown lies between values of vertices.
//!     / \ / \
//!    a-n-m---b
//! ```
//!
//! So light goes on across every edge without a vertex being lit for it, which a balance of levels would ask for.

use glam::Vec3;
use rayon::prelude::*;

use super::mesh::{NONE, PatchMesh, quarter};
use super::sight::LeafSeen;

/// See the module's documentation.
pub(super) struct LitLeaves {
    leaves: Vec<Lit>,
    /// Four by four, of those that are shown divided.
    quarters: Vec<Lit>,
}

/// Light on a leaf, or on a part of it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Lit {
    corners: [Corner; 3],
    /// The first of its quarters; [`NONE`]: it is shown as it is.
    quarters: u32,
}

/// A corner, and its light if that is known or guessed.
#[derive(Clone, Copy, Debug)]
struct Corner {
    light: Vec3,
    is_known: bool,
}

/// A corner that may be a vertex.
#[derive(Clone, Copy, Debug)]
struct End {
    /// [`NONE`]: nobody's.
    vertex: u32,
    corner: Corner,
}

impl LitLeaves {
    /// Light on what is in sight; `is_fitted`: without seams.
    pub fn of(mesh: &PatchMesh, seen: &[LeafSeen], is_fitted: bool) -> Self {
        let leaf = |seen: &LeafSeen| {
            let ends = ends(mesh, seen);
            let is_divided =
                is_fitted && !seen.has_spot() && middles(mesh, &ends, [true; 3]).iter().any(Option::is_some);
            (ends, is_divided)
        };
        let ends: Vec<([End; 3], bool)> = seen.par_iter().with_min_len(256).map(leaf).collect();
        let mut quarters = Vec::new();
        let leaves = ends.into_iter().map(|(ends, is_divided)| match is_divided {
            true => divide(mesh, ends, [true; 3], &mut quarters),
            false => Lit::whole(ends),
        });
        Self { leaves: leaves.collect(), quarters }
    }

    /// Light at a place of a leaf, by the weights of its second and third corner; `None`: nothing is known, or there is no
    /// such leaf.
    #[inline]
    pub fn at(&self, leaf: u32, mut weights: [f32; 2]) -> Option<Vec3> {
        let mut lit = self.leaves.get(leaf as usize)?;
        while lit.quarters != NONE {
            let number;
            (number, weights) = quarter(weights);
            lit = &self.quarters[(lit.quarters + number) as usize];
        }
        lit.at(weights)
    }
}

impl Lit {
    /// On a leaf in sight.
    pub fn of(mesh: &PatchMesh, seen: &LeafSeen) -> Self {
        Self::whole(ends(mesh, seen))
    }

    fn whole(ends: [End; 3]) -> Self {
        Self { corners: ends.map(|end| end.corner), quarters: NONE }
    }

    /// Light at a place, by the weights of the second and the third corner; `None`: nothing is known.
    #[inline]
    pub fn at(&self, [u, v]: [f32; 2]) -> Option<Vec3> {
        let weights = [1.0 - u - v, u, v];
        let [a, b, c] = self.corners;
        if a.is_known && b.is_known && c.is_known {
            return Some(a.light * weights[0] + b.light * weights[1] + c.light * weights[2]);
        }
        let known = self.corners.iter().zip(weights).filter(|(corner, _)| corner.is_known);
        // The nearer the more, but a place that is nearest to what is unknown is not lost.
        let (sum, all) = known.fold((Vec3::ZERO, 0.0), |(sum, all), (corner, weight)| {
            let weight = weight + 1e-3;
            (sum + corner.light * weight, all + weight)
        });
        (all > 0.0).then(|| sum / all)
    }
}

/// The corners of a leaf. Those of a triangle that was never divided are like its spot, until they are known.
fn ends(mesh: &PatchMesh, seen: &LeafSeen) -> [End; 3] {
    let patch = &mesh.patches[seen.patch as usize];
    let spot = mesh.roots[patch.root as usize].spot;
    let spot = mesh.vertices.get(spot as usize).filter(|spot| patch.level == 0 && spot.samples > 0);
    seen.vertices.map(|vertex| match (End::of(mesh, vertex), spot) {
        (end, Some(spot)) if mesh.vertices[vertex as usize].samples == 0 => {
            End { corner: Corner { light: spot.light, is_known: spot.has_light }, ..end }
        }
        (end, _) => end,
    })
}

impl End {
    fn of(mesh: &PatchMesh, vertex: u32) -> Self {
        let at = &mesh.vertices[vertex as usize];
        Self { vertex, corner: Corner { light: at.light, is_known: at.has_light } }
    }

    /// Nobody's, between two others.
    fn between([a, b]: [Self; 2]) -> Self {
        let light = (a.corner.light + b.corner.light) * 0.5;
        Self { vertex: NONE, corner: Corner { light, is_known: a.corner.is_known && b.corner.is_known } }
    }
}

/// What lies in the middle of the edges a–b, b–c and c–a because something beyond is divided; of those that are asked for.
fn middles(mesh: &PatchMesh, [a, b, c]: &[End; 3], is_border: [bool; 3]) -> [Option<End>; 3] {
    let edges = [[a, b], [b, c], [c, a]];
    [0, 1, 2].map(|edge| {
        let [a, b] = edges[edge].map(|end| end.vertex);
        let middle = mesh.middle_of(a, b).filter(|_| is_border[edge])?;
        Some(End::of(mesh, middle)).filter(|end| end.corner.is_known)
    })
}

/// Shows a part of a leaf as its quarters, as far as it has vertices on those of its edges that are the leaf's own.
fn divide(mesh: &PatchMesh, ends: [End; 3], is_border: [bool; 3], quarters: &mut Vec<Lit>) -> Lit {
    let found = middles(mesh, &ends, is_border);
    let whole = Lit::whole(ends);
    if found.iter().all(Option::is_none) {
        return whole;
    }
    let [a, b, c] = ends;
    let [ab, bc, ca] =
        [(0, [a, b]), (1, [b, c]), (2, [c, a])].map(|(edge, ends)| found[edge].unwrap_or(End::between(ends)));
    let [on_ab, on_bc, on_ca] = is_border;
    let first = quarters.len();
    quarters.extend([whole; 4]);
    let parts = [
        ([a, ab, ca], [on_ab, false, on_ca]),
        ([ab, b, bc], [on_ab, on_bc, false]),
        ([ca, bc, c], [false, on_bc, on_ca]),
        ([bc, ca, ab], [false; 3]),
    ];
    for (number, (ends, is_border)) in parts.into_iter().enumerate() {
        quarters[first + number] = divide(mesh, ends, is_border, quarters);
    }
    Lit { quarters: first as u32, ..whole }
}
