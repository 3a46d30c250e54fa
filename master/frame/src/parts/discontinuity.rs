//! The discontinuity buffer: irradiance is smoothed over neighbours that see the same surface.
//!
//! **Idea** (IGI-8): interleaved light sets make neighbouring pixels wrong in different ways. Where
//! irradiance is smooth, the mean over a block of neighbours has all sets in it, and n·m times
//! fewer light sources per pixel do. Reflectance is multiplied in afterwards, so textures stay
//! sharp; what must not be filtered (lamps, reflections) never comes here.
//!
//! **Bad** where irradiance is not smooth on a smooth surface: contact shadows and caustics blur by
//! the window. `super::fade` therefore takes the filter back as samples accumulate.

use glam::DVec3;
use scenes::Camera;

use super::film::divide;
use super::planes::Planes;
use super::{Film, Tiling};

/// What is smoothed, and where it stops.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Filter {
    /// How surfaces are told apart; `None`: no filter at all.
    pub edges: Option<Edges>,
    /// Columns and rows of the window. The interleaving's n×m meets every light set once; more is
    /// smoother and blurs more.
    pub window: [u8; 2],
    /// Let the filter fade where accumulated samples say that it does harm.
    pub fade: bool,
}

/// How two pixels are found to see the same surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Edges {
    /// The paper's thresholds. Blurs across small offsets between parallel planes, and fails to
    /// smooth floors near the horizon.
    Thresholds {
        /// Largest difference of distances, as a fraction of the distance.
        distance: f32,
        /// Smallest cosine between the normals.
        cosine: f32,
    },
    /// Each point lies in the other's tangent plane, up to about half a pixel's footprint
    /// (algorithms.md B4): any plane is smooth at any slant, and an offset of a pixel is an edge.
    Planes {
        /// Smallest cosine between the normals.
        cosine: f32,
    },
}

impl Filter {
    /// Shows every pixel as it is.
    pub const OFF: Self = Self { edges: None, window: [1, 1], fade: false };

    /// The paper's: thresholds, never fading.
    pub fn paper(window: [u8; 2]) -> Self {
        Self { edges: Some(Edges::Thresholds { distance: 0.1, cosine: 0.9 }), window, fade: false }
    }

    /// The plane test, fading.
    pub fn plane(window: [u8; 2]) -> Self {
        Self { edges: Some(Edges::Planes { cosine: 0.9 }), window, fade: true }
    }
}

/// Planes of the guide: position, normal, distance or −1 where there is no surface, tolerance.
const GUIDE: usize = 8;
/// Planes of irradiance: both halves' three channels, and 1 or 0 for each channel known or not.
const LIGHT: usize = 9;

/// What pixels see, ready for comparing: the film's guide as planes of `f32`.
pub(super) struct Scenery {
    tiling: Tiling,
    guide: Planes<GUIDE>,
}

/// Irradiance (times 1/π) of both halves of a film, before or after smoothing.
pub(super) struct Light(Planes<LIGHT>);

impl Scenery {
    /// Rebuilds positions from distances. Samples are jittered within their pixels, so a single
    /// one may lie half a footprint off the plane through the pixel's middle; means lie closer.
    pub fn of(film: &Film, camera: &Camera) -> Option<Self> {
        let tiling = film.tiling();
        let (_, guides) = film.surface()?;
        let lens = camera.lens();
        let width = tiling.width as usize;
        let jitter = 0.5 / f64::from(film.frames().max(1)).sqrt() as f32;
        let tolerance_per_unit = (0.5 + jitter) * lens.pixel();
        let guide = Planes::fill(width, tiling.height as usize, |y, [px, py, pz, nx, ny, nz, distance, tolerance]| {
            for (x, guide) in guides[y * width..(y + 1) * width].iter().enumerate() {
                if guide.hits == 0.0 {
                    distance[x] = NOTHING;
                    continue;
                }
                let mean_distance = (guide.distance / guide.hits) as f32;
                let position = lens.direction(x as f32 + 0.5, y as f32 + 0.5) * mean_distance;
                let normal = guide.normal.as_vec3().normalize_or_zero();
                [px[x], py[x], pz[x]] = position.to_array();
                [nx[x], ny[x], nz[x]] = normal.to_array();
                distance[x] = mean_distance;
                tolerance[x] = tolerance_per_unit * mean_distance;
            }
        });
        Some(Self { tiling, guide })
    }

    /// Mean irradiance over the neighbours in the window that see the same surface.
    pub fn smooth(&self, light: &Light, window: [u8; 2], edges: Edges) -> Light {
        let (width, height) = (self.tiling.width as usize, self.tiling.height as usize);
        let [columns, rows] = window.map(Window::of);
        Light(Planes::fill(width, height, |y, mut sums| {
            for (dy, weight_y) in rows.iter() {
                let Some(there_y) = y.checked_add_signed(dy).filter(|there| *there < height) else { continue };
                for (dx, weight_x) in columns.iter() {
                    if dx.unsigned_abs() >= width {
                        continue;
                    }
                    let (here, there) = overlap(width, dx);
                    let pair = Pair {
                        here: self.guide.row(y).map(|plane| &plane[here.clone()]),
                        there: self.guide.row(there_y).map(|plane| &plane[there.clone()]),
                        light: light.0.row(there_y).map(|plane| &plane[there.clone()]),
                        sums: sums.each_mut().map(|plane| &mut plane[here.clone()]),
                    };
                    let weight = weight_x * weight_y;
                    let offset = ((dx * dx + dy * dy) as f32).sqrt();
                    match edges {
                        _ if dx == 0 && dy == 0 => pair.add(|_, _, _| weight),
                        Edges::Thresholds { distance, cosine } => {
                            pair.add(|here, there, x| weight * thresholds(here, there, x, distance, cosine));
                        }
                        Edges::Planes { cosine } => {
                            pair.add(|here, there, x| weight * planes(here, there, x, offset, cosine));
                        }
                    }
                }
            }
            normalise(sums);
        }))
    }
}

impl Light {
    /// Takes the reflectance out of the film's sums.
    pub fn of(film: &Film) -> Option<Self> {
        let tiling = film.tiling();
        let ([a, b], guides) = film.surface()?;
        let width = tiling.width as usize;
        let frames = f64::from(film.frames());
        let [scale_a, scale_b] = film.halves().map(|half| if half == 0 { 0.0 } else { frames / f64::from(half) });
        let fill = |y: usize, planes: [&mut [f32]; LIGHT]| {
            let [ar, ag, ab, br, bg, bb, kr, kg, kb] = planes;
            let row = y * width..(y + 1) * width;
            for (x, ((a, b), guide)) in a[row.clone()].iter().zip(&b[row.clone()]).zip(&guides[row]).enumerate() {
                [ar[x], ag[x], ab[x]] = divide(*a * scale_a, guide.reflectance).as_vec3().to_array();
                [br[x], bg[x], bb[x]] = divide(*b * scale_b, guide.reflectance).as_vec3().to_array();
                let known = |reflectance: f64| f32::from(u8::from(reflectance > 0.0));
                [kr[x], kg[x], kb[x]] = guide.reflectance.to_array().map(known);
            }
        };
        Some(Self(Planes::fill(width, tiling.height as usize, fill)))
    }

    /// Both halves' irradiance in a row, channel by channel.
    pub fn row(&self, y: usize) -> [[&[f32]; 3]; 2] {
        let [ar, ag, ab, br, bg, bb, ..] = self.0.row(y);
        [[ar, ag, ab], [br, bg, bb]]
    }
}

/// A row of pixels and the row of their neighbours at one offset.
struct Pair<'a> {
    here: [&'a [f32]; GUIDE],
    there: [&'a [f32]; GUIDE],
    light: [&'a [f32]; LIGHT],
    sums: [&'a mut [f32]; LIGHT],
}

impl Pair<'_> {
    /// Adds the neighbours' light, weighted. The inner loop has no branch, so that it vectorises.
    #[inline(always)]
    fn add(self, weight: impl Fn(&[&[f32]; GUIDE], &[&[f32]; GUIDE], usize) -> f32) {
        let len = self.here[0].len();
        // The compiler sees equal lengths and leaves the bounds checks out.
        let here = self.here.map(|plane| &plane[..len]);
        let there = self.there.map(|plane| &plane[..len]);
        let light = self.light.map(|plane| &plane[..len]);
        let [ar, ag, ab, br, bg, bb, kr, kg, kb] = self.sums.map(|plane| &mut plane[..len]);
        for x in 0..len {
            let weight = weight(&here, &there, x);
            let known = [weight * light[6][x], weight * light[7][x], weight * light[8][x]];
            ar[x] += known[0] * light[0][x];
            ag[x] += known[1] * light[1][x];
            ab[x] += known[2] * light[2][x];
            br[x] += known[0] * light[3][x];
            bg[x] += known[1] * light[4][x];
            bb[x] += known[2] * light[5][x];
            kr[x] += known[0];
            kg[x] += known[1];
            kb[x] += known[2];
        }
    }
}

/// 1 if the paper's thresholds find the same surface, else 0.
#[inline(always)]
fn thresholds(here: &[&[f32]; GUIDE], there: &[&[f32]; GUIDE], x: usize, distance: f32, cosine: f32) -> f32 {
    let [_, _, _, nx, ny, nz, d, _] = here;
    let [_, _, _, mx, my, mz, e, _] = there;
    let near = (d[x] - e[x]).abs() <= distance * d[x];
    let aligned = nx[x] * mx[x] + ny[x] * my[x] + nz[x] * mz[x] >= cosine;
    f32::from(u8::from(near & aligned & (e[x] > 0.0)))
}

/// 1 if both points lie in each other's tangent plane, else 0.
#[inline(always)]
fn planes(here: &[&[f32]; GUIDE], there: &[&[f32]; GUIDE], x: usize, offset: f32, cosine: f32) -> f32 {
    let [px, py, pz, nx, ny, nz, _, tolerance] = here;
    let [qx, qy, qz, mx, my, mz, e, _] = there;
    let [dx, dy, dz] = [qx[x] - px[x], qy[x] - py[x], qz[x] - pz[x]];
    let limit = tolerance[x] * offset;
    let in_mine = (nx[x] * dx + ny[x] * dy + nz[x] * dz).abs() <= limit;
    let in_theirs = (mx[x] * dx + my[x] * dy + mz[x] * dz).abs() <= limit;
    let aligned = nx[x] * mx[x] + ny[x] * my[x] + nz[x] * mz[x] >= cosine;
    f32::from(u8::from(in_mine & in_theirs & aligned & (e[x] > 0.0)))
}

/// Sums to means; 0 where nothing is known.
fn normalise(planes: [&mut [f32]; LIGHT]) {
    let [ar, ag, ab, br, bg, bb, kr, kg, kb] = planes;
    for (a, b, known) in [(ar, br, kr), (ag, bg, kg), (ab, bb, kb)] {
        for ((a, b), known) in a.iter_mut().zip(b).zip(known) {
            let scale = if *known > 0.0 { 1.0 / *known } else { 0.0 };
            *a *= scale;
            *b *= scale;
            *known = f32::from(u8::from(*known > 0.0));
        }
    }
}

/// Offsets along one axis with their weights.
struct Window(Vec<(isize, f32)>);

impl Window {
    /// An odd window is symmetric by itself. An even one is made so by two half weights at its
    /// ends, which are `size` apart and so of the same light set: each set still has weight 1.
    fn of(size: u8) -> Self {
        let reach = isize::from(size.max(1) / 2);
        let even = size.is_multiple_of(2);
        let weight = |offset: isize| if even && offset.abs() == reach { 0.5 } else { 1.0 };
        Self((-reach..=reach).map(|offset| (offset, weight(offset))).collect())
    }

    fn iter(&self) -> impl Iterator<Item = (isize, f32)> {
        self.0.iter().copied()
    }
}

/// Columns that have a neighbour at `dx`, and these neighbours' columns.
fn overlap(width: usize, dx: isize) -> (std::ops::Range<usize>, std::ops::Range<usize>) {
    let shift = dx.unsigned_abs();
    if dx < 0 { (shift..width, 0..width - shift) } else { (0..width - shift, shift..width) }
}

const NOTHING: f32 = -1.0;

/// Used by `super::fade` to turn irradiance back into radiance.
pub(super) fn mean_reflectance(sum: DVec3, frames: u32) -> DVec3 {
    sum / f64::from(frames.max(1))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn windows_give_every_light_set_the_same_weight() {
        for size in 1..=16u8 {
            let mut per_set = vec![0.0; usize::from(size)];
            for (offset, weight) in Window::of(size).iter() {
                per_set[offset.rem_euclid(isize::from(size)) as usize] += weight;
            }
            assert!(per_set.iter().all(|weight| *weight == 1.0), "{size}: {per_set:?}");
        }
    }
}
