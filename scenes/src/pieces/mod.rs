//! What a mesh falls into: things that a person would take hold of, though the file does not keep them apart.
//!
//! **The rule.** Triangles that share a vertex position are a *shell*. Two shells that come within [`REACH`] of each
//! other are of one *piece*, the smallest pairs first, as long as the piece stays within [`EXTENT`]; both are shares of
//! the mesh's diameter. So seat, back and legs become one chair, chairs do not grow together over the floor that
//! they all stand on, and whatever is larger than that stays a piece of its own.
//!
//! Pieces are numbered by their first triangle. They follow from positions and triangles alone, in plain arithmetic, and
//! are the same on every machine: a piece is named by a number, and never sent.

use std::collections::HashMap;

use glam::{DVec3, Vec3};

use crate::Mesh;

/// The pieces of a mesh.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Pieces {
    of_triangle: Vec<u32>,
    /// Where the triangles of each piece begin, and where those of the last end.
    begin: Vec<u32>,
    /// By piece, ascending.
    triangles: Vec<u32>,
}

/// Shells closer than this touch: a share of the mesh's diameter. In a hall of 30 m these are 6 cm, the gap between a
/// cushion and its frame.
pub const REACH: f64 = 1.0 / 500.0;
/// Pieces of more than one shell are no larger than this: a share of the mesh's diameter.
pub const EXTENT: f64 = 1.0 / 5.0;
/// Most pairs of boxes that are looked at, most pairs of shells that are kept, and most pairs of triangles that are
/// compared, so that time and memory are bounded. What is not looked at stays apart.
const LOOKS_MAX: u64 = 1 << 26;
const PAIRS_MAX: usize = 1 << 20;
const TESTS_MAX: u64 = 1 << 27;

impl Pieces {
    /// Finds them.
    pub fn of(mesh: &Mesh) -> Self {
        let shells = Shells::of(mesh);
        let mut sets = Sets::new(shells.boxes.len());
        shells.join(mesh, &mut sets);
        numbered(shells.of_triangle.iter().map(|shell| sets.find(*shell)))
    }

    /// The shells alone: triangles that share vertex positions, however close others are.
    pub fn shells(mesh: &Mesh) -> Self {
        numbered(Shells::of(mesh).of_triangle.into_iter())
    }

    /// How many there are.
    pub fn count(&self) -> usize {
        self.begin.len() - 1
    }

    /// The piece that a triangle belongs to.
    pub fn of_triangle(&self, triangle: usize) -> u32 {
        self.of_triangle[triangle]
    }

    /// The triangles of a piece, ascending; none if there is no such piece.
    pub fn triangles(&self, piece: u32) -> &[u32] {
        let begin = |piece: usize| self.begin.get(piece).map(|begin| *begin as usize);
        match (begin(piece as usize), begin(piece as usize + 1)) {
            (Some(from), Some(to)) => &self.triangles[from..to],
            _ => &[],
        }
    }
}

/// Pieces from any names of them, one a triangle: numbered in order of first appearance.
fn numbered(names: impl Iterator<Item = u32>) -> Pieces {
    let mut numbers = HashMap::new();
    let of_triangle: Vec<u32> = names
        .map(|name| {
            let next = numbers.len() as u32;
            *numbers.entry(name).or_insert(next)
        })
        .collect();
    let mut begin = vec![0; numbers.len() + 1];
    of_triangle.iter().for_each(|piece| begin[*piece as usize + 1] += 1);
    (1..begin.len()).for_each(|piece| begin[piece] += begin[piece - 1]);
    let (mut next, mut triangles) = (begin.clone(), vec![0; of_triangle.len()]);
    for (triangle, piece) in (0..).zip(&of_triangle) {
        let place = &mut next[*piece as usize];
        triangles[*place as usize] = triangle;
        *place += 1;
    }
    Pieces { of_triangle, begin, triangles }
}

/// Disjoint sets of numbers.
struct Sets(Vec<u32>);

impl Sets {
    fn new(count: usize) -> Self {
        Self((0..count as u32).collect())
    }

    /// The least of the set.
    fn find(&mut self, mut of: u32) -> u32 {
        while self.0[of as usize] != of {
            self.0[of as usize] = self.0[self.0[of as usize] as usize];
            of = self.0[of as usize];
        }
        of
    }

    fn unite(&mut self, a: u32, b: u32) -> u32 {
        let (a, b) = (self.find(a), self.find(b));
        self.0[a.max(b) as usize] = a.min(b);
        a.min(b)
    }
}

/// Connected triangles.
struct Shells {
    of_triangle: Vec<u32>,
    boxes: Vec<Extent>,
    /// Of everything.
    diameter: f64,
}

/// A box that grows.
#[derive(Clone, Copy, Debug)]
struct Extent {
    least: DVec3,
    greatest: DVec3,
}

type Corners = [DVec3; 3];

impl Shells {
    fn of(mesh: &Mesh) -> Self {
        let mut sets = Sets::new(mesh.positions.len());
        let mut first = HashMap::with_capacity(mesh.positions.len());
        for (vertex, position) in (0..).zip(&mesh.positions) {
            // Adding zero makes one zero of the two.
            let place = (*position + Vec3::ZERO).to_array().map(f32::to_bits);
            sets.unite(*first.entry(place).or_insert(vertex), vertex);
        }
        for [a, b, c] in &mesh.triangles {
            let ab = sets.unite(*a, *b);
            sets.unite(ab, *c);
        }
        let Pieces { of_triangle, begin, .. } = numbered(mesh.triangles.iter().map(|[a, ..]| sets.find(*a)));
        let mut boxes = vec![Extent::EMPTY; begin.len() - 1];
        for (triangle, shell) in of_triangle.iter().enumerate() {
            boxes[*shell as usize].include(&corners(mesh, triangle));
        }
        let diameter = boxes.iter().fold(Extent::EMPTY, |all, one| all.union(one)).diameter();
        Self { of_triangle, boxes, diameter }
    }

    /// Unites those that touch.
    fn join(&self, mesh: &Mesh, sets: &mut Sets) {
        let (reach, most) = (self.diameter * REACH, self.diameter * EXTENT);
        let mut boxes = self.boxes.clone();
        let triangles = numbered(self.of_triangle.iter().copied());
        let mut tests = TESTS_MAX;
        for (_, a, b) in self.pairs(reach, most) {
            let (set_a, set_b) = (sets.find(a), sets.find(b));
            let union = boxes[set_a as usize].union(&boxes[set_b as usize]);
            if set_a == set_b || union.diameter() > most {
                continue;
            }
            let near = |one: u32, other: u32| -> Vec<Corners> {
                let other = &self.boxes[other as usize];
                let all = triangles.triangles(one).iter().map(|triangle| corners(mesh, *triangle as usize));
                all.filter(|corners| Extent::of(corners).gap_within(other, reach)).collect()
            };
            if touch(&near(a, b), &near(b, a), reach, &mut tests) {
                boxes[sets.unite(a, b) as usize] = union;
            }
            if tests == 0 {
                return;
            }
        }
    }

    /// Pairs whose boxes are that close and together no larger than `most`, smallest first.
    fn pairs(&self, reach: f64, most: f64) -> Vec<(f64, u32, u32)> {
        let mut order: Vec<u32> = (0..self.boxes.len() as u32).collect();
        order.retain(|shell| self.boxes[*shell as usize].diameter() <= most);
        let from = |shell: &u32| self.boxes[*shell as usize].least.x;
        order.sort_by(|a, b| from(a).total_cmp(&from(b)).then(a.cmp(b)));
        let (mut pairs, mut looks) = (Vec::new(), LOOKS_MAX);
        'all: for (place, a) in order.iter().enumerate() {
            let one = &self.boxes[*a as usize];
            for b in order[place + 1..].iter().take_while(|b| from(b) <= one.greatest.x + reach) {
                let other = &self.boxes[*b as usize];
                looks -= 1;
                if looks == 0 || pairs.len() == PAIRS_MAX {
                    break 'all;
                }
                let size = one.union(other).diameter();
                if size <= most && one.gap_within(other, reach) {
                    pairs.push((size, *a.min(b), *a.max(b)));
                }
            }
        }
        pairs.sort_by(|a, b| a.0.total_cmp(&b.0).then((a.1, a.2).cmp(&(b.1, b.2))));
        pairs
    }
}

impl Extent {
    const EMPTY: Self = Self { least: DVec3::INFINITY, greatest: DVec3::NEG_INFINITY };

    fn of(corners: &Corners) -> Self {
        let mut extent = Self::EMPTY;
        extent.include(corners);
        extent
    }

    fn include(&mut self, corners: &Corners) {
        for corner in corners {
            self.least = self.least.min(*corner);
            self.greatest = self.greatest.max(*corner);
        }
    }

    fn union(&self, other: &Self) -> Self {
        Self { least: self.least.min(other.least), greatest: self.greatest.max(other.greatest) }
    }

    fn diameter(&self) -> f64 {
        (self.greatest - self.least).length()
    }

    /// No axis has more than this between them.
    fn gap_within(&self, other: &Self, reach: f64) -> bool {
        let gap = (self.least - other.greatest).max(other.least - self.greatest);
        gap.max_element() <= reach
    }
}

fn corners(mesh: &Mesh, triangle: usize) -> Corners {
    mesh.triangles[triangle].map(|vertex| mesh.positions[vertex as usize].as_dvec3())
}

/// Whether a triangle of one comes within reach of a triangle of the other; false if `tests` runs out.
fn touch(one: &[Corners], other: &[Corners], reach: f64, tests: &mut u64) -> bool {
    let boxes: Vec<Extent> = other.iter().map(Extent::of).collect();
    for a in one {
        let extent = Extent::of(a);
        *tests = tests.saturating_sub(other.len() as u64);
        if *tests == 0 {
            return false;
        }
        let near = boxes.iter().zip(other).filter(|(bounds, _)| extent.gap_within(bounds, reach));
        if near.into_iter().any(|(_, b)| distance_squared(a, b) <= reach * reach) {
            return true;
        }
    }
    false
}

/// Between two triangles; 0 where they cross.
fn distance_squared(a: &Corners, b: &Corners) -> f64 {
    let edges = |t: &Corners| [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])];
    let crosses = |a: &Corners, b: &Corners| edges(a).iter().any(|(from, to)| pierces(*from, *to, b));
    if crosses(a, b) || crosses(b, a) {
        return 0.0;
    }
    let corners = |a: &Corners, b: &Corners| a.iter().map(|p| to_triangle(*p, b)).fold(f64::INFINITY, f64::min);
    let mut least = corners(a, b).min(corners(b, a));
    for one in edges(a) {
        for other in edges(b) {
            least = least.min(between_segments(one, other));
        }
    }
    least
}

/// Whether a segment goes through a triangle (Möller and Trumbore 1997).
fn pierces(from: DVec3, to: DVec3, [a, b, c]: &Corners) -> bool {
    let (way, ab, ac) = (to - from, *b - *a, *c - *a);
    let p = way.cross(ac);
    let determinant = ab.dot(p);
    if determinant == 0.0 {
        return false;
    }
    let s = from - *a;
    let u = s.dot(p) / determinant;
    let q = s.cross(ab);
    let v = way.dot(q) / determinant;
    let t = ac.dot(q) / determinant;
    u >= 0.0 && v >= 0.0 && u + v <= 1.0 && (0.0..=1.0).contains(&t)
}

/// From a point to a triangle: to its plane where the point is above it, else to its nearest edge.
fn to_triangle(point: DVec3, [a, b, c]: &Corners) -> f64 {
    let normal = (*b - *a).cross(*c - *a);
    let inside = |from: &DVec3, to: &DVec3| (*to - *from).cross(point - *from).dot(normal) >= 0.0;
    if normal != DVec3::ZERO && inside(a, b) && inside(b, c) && inside(c, a) {
        let height = (point - *a).dot(normal);
        return height * height / normal.length_squared();
    }
    to_segment(point, *a, *b).min(to_segment(point, *b, *c)).min(to_segment(point, *c, *a))
}

fn to_segment(point: DVec3, from: DVec3, to: DVec3) -> f64 {
    let way = to - from;
    let length = way.length_squared();
    let share = if length > 0.0 { ((point - from).dot(way) / length).clamp(0.0, 1.0) } else { 0.0 };
    (from + way * share).distance_squared(point)
}

/// Between two segments: between their lines where these come closest within both, else from an end.
fn between_segments((a, b): (DVec3, DVec3), (c, d): (DVec3, DVec3)) -> f64 {
    let (ab, cd, ca) = (b - a, d - c, a - c);
    let (aa, cc, ac) = (ab.length_squared(), cd.length_squared(), ab.dot(cd));
    let determinant = aa * cc - ac * ac;
    if determinant > 0.0 {
        let s = (ac * cd.dot(ca) - cc * ab.dot(ca)) / determinant;
        let t = (aa * cd.dot(ca) - ac * ab.dot(ca)) / determinant;
        if (0.0..=1.0).contains(&s) && (0.0..=1.0).contains(&t) {
            return (a + ab * s).distance_squared(c + cd * t);
        }
    }
    to_segment(a, c, d).min(to_segment(b, c, d)).min(to_segment(c, a, b)).min(to_segment(d, a, b))
}

#[cfg(test)]
mod tests;
