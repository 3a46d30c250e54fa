//! The discontinuity buffer: irradiance is smoothed over neighbours that see the same surface.
//!
//! **Idea** (IGI-8): interleaved light sets make neighbouring pixels wrong in different ways. Where
//! irradiance is smooth, the mean over a block of neighbours has all sets in it, and n·m times
//! fewer light sources per pixel do. Reflectance is multiplied in afterwards, so textures stay
//! sharp; what must not be filtered (lamps, reflections) never comes here.
//!
//! **Bad** where irradiance is not smooth on a smooth surface: contact shadows and caustics blur by
//! the window. [`super::fade`] therefore takes the filter back as samples accumulate.

use scenes::Camera;

use super::Film;
use super::planes::{Block, LANES, MARGIN, Planes, block};

/// What is smoothed, and where it stops.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Filter {
    /// How surfaces are told apart; `None`: no filter at all.
    pub edges: Option<Edges>,
    /// Columns and rows of the window, 1..=16. The interleaving's n×m meets every light set once;
    /// more is smoother and blurs more.
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

/// What the filter works on: the film's means, as planes of `f32`.
///
/// Planes 0..8 are the guide: position (3), normal (3; no number where there is no surface, so that
/// every comparison fails), distance, tolerance. Then irradiance/π of one half of the film (3) and of
/// the other (3), reflectance (3), and radiance (3).
#[derive(Clone, Debug, Default)]
pub(super) struct Means(pub(super) Planes<20>);

/// What the filter does to each pixel: the change of radiance by channel; the square of the change of
/// irradiance, and the part of that square that is noise (see [`super::fade`]).
#[derive(Clone, Debug, Default)]
pub(super) struct Change(pub(super) Planes<5>);

const POSITION: usize = 0;
const NORMAL: usize = 3;
const DISTANCE: usize = 6;
const TOLERANCE: usize = 7;
const HALVES: [usize; 2] = [8, 11];
const REFLECTANCE: usize = 14;
pub(super) const RADIANCE: usize = 17;

impl Means {
    /// Divides the film's sums. Positions are rebuilt from distances; as samples are jittered within
    /// their pixels, a single one may lie half a footprint off the plane through the pixel's
    /// middle, and means lie closer.
    pub fn take(&mut self, film: &Film, camera: &Camera) {
        let tiling = film.tiling();
        let (width, height) = (tiling.width as usize, tiling.height as usize);
        let lens = camera.lens();
        let jitter = 0.5 / f64::from(film.frames().max(1)).sqrt() as f32;
        let tolerance = (0.5 + jitter) * lens.pixel();
        let averager = film.averager();
        self.0.fill(width, height, |y, mut planes| {
            for plane in &mut planes[NORMAL..NORMAL + 3] {
                plane[..MARGIN].fill(f32::NAN);
                plane[MARGIN + width..].fill(f32::NAN);
            }
            let mut planes = planes.map(|plane| &mut plane[MARGIN..MARGIN + width]);
            for (x, pixel) in (y * width..(y + 1) * width).enumerate() {
                let mut put = |plane: usize, [a, b, c]: [f32; 3]| {
                    planes[plane][x] = a;
                    planes[plane + 1][x] = b;
                    planes[plane + 2][x] = c;
                };
                let seen = averager.mean(pixel);
                put(RADIANCE, seen.radiance.to_array());
                put(REFLECTANCE, seen.reflectance.to_array());
                put(HALVES[0], seen.irradiance[0].to_array());
                put(HALVES[1], seen.irradiance[1].to_array());
                put(NORMAL, seen.normal.to_array());
                let position = lens.direction(x as f32 + 0.5, y as f32 + 0.5) * seen.distance;
                put(POSITION, position.to_array());
                planes[DISTANCE][x] = seen.distance;
                planes[TOLERANCE][x] = seen.distance * tolerance;
            }
        });
    }
}

impl Change {
    /// Smooths all pixels by the mean irradiance over the neighbours in the window that see the same
    /// surface.
    pub fn take(&mut self, film: &Film, means: &Means, window: [u8; 2], edges: Edges) {
        let (width, height) = (film.tiling().width as usize, film.tiling().height as usize);
        let shares = film.halves().map(|half| half as f32 / film.frames().max(1) as f32);
        let [columns, rows] = window.map(taps);
        self.0.fill(width, height, |y, planes| {
            let near = |(dy, weight): &(isize, f32)| {
                let there = y.checked_add_signed(*dy).filter(|there| *there < height)?;
                Some((means.0.row(there), *dy, *weight))
            };
            let rows: Vec<_> = rows.iter().filter_map(near).collect();
            Row { here: means.0.row(y), rows: &rows, columns: &columns, width, edges, shares }.smooth(planes);
        });
    }
}

/// A row of pixels and all that it takes to smooth it.
struct Row<'a> {
    here: [&'a [f32]; 20],
    /// Rows in the window: planes, offset, weight.
    rows: &'a [([&'a [f32]; 20], isize, f32)],
    /// Columns in the window: offset, weight.
    columns: &'a [(isize, f32)],
    width: usize,
    edges: Edges,
    /// Share of each half in all frames.
    shares: [f32; 2],
}

impl Row<'_> {
    /// Fills the planes of [`Change`], with the widest vectors that the machine has. They compute the same
    /// bits: no operation is fused or reordered.
    fn smooth(&self, planes: [&mut [f32]; 5]) {
        #[cfg(target_arch = "x86_64")]
        if std::arch::is_x86_feature_detected!("avx2") {
            // SAFETY: the machine has just said that it has AVX2.
            return unsafe { self.smooth_avx2(planes) };
        }
        self.smooth_blocks(planes);
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2")]
    fn smooth_avx2(&self, planes: [&mut [f32]; 5]) {
        self.smooth_blocks(planes);
    }

    #[inline(always)]
    fn smooth_blocks(&self, mut planes: [&mut [f32]; 5]) {
        let here = &self.here;
        for at in (MARGIN..MARGIN + self.width).step_by(LANES) {
            let mut sums = Sums::default();
            for (there, dy, weight_y) in self.rows {
                for (dx, weight_x) in self.columns {
                    let neighbour = Neighbour { there, at: at.wrapping_add_signed(*dx) };
                    let weight = weight_x * weight_y;
                    let offset = ((dx * dx + dy * dy) as f32).sqrt();
                    let same = match self.edges {
                        _ if *dx == 0 && *dy == 0 => [1.0; LANES],
                        Edges::Thresholds { distance, cosine } => neighbour.is_near(here, at, distance, cosine),
                        Edges::Planes { cosine } => neighbour.is_coplanar(here, at, offset, cosine),
                    };
                    neighbour.add_to(&mut sums, same.map(|same| same * weight));
                }
            }
            sums.write(here, at, self.shares, &mut planes);
        }
    }
}

/// A row of neighbours, and where in it the block of pixels lies.
struct Neighbour<'a> {
    there: &'a [&'a [f32]; 20],
    at: usize,
}

/// Sums of known irradiance of both halves by channel, and of the weights of each channel.
#[derive(Clone, Copy, Default)]
struct Sums {
    irradiance: [[Block; 3]; 2],
    known: [Block; 3],
}

impl Neighbour<'_> {
    /// 1 where the paper's thresholds find the same surface, else 0.
    #[inline(always)]
    fn is_near(&self, here: &[&[f32]; 20], at: usize, most: f32, cosine: f32) -> Block {
        let (mine, theirs) = (block(here[DISTANCE], at), block(self.there[DISTANCE], self.at));
        let aligned = self.cosine(here, at);
        std::array::from_fn(|i| flag(((mine[i] - theirs[i]).abs() <= most * mine[i]) & (aligned[i] >= cosine)))
    }

    /// 1 where both points lie in each other's tangent plane, else 0.
    #[inline(always)]
    fn is_coplanar(&self, here: &[&[f32]; 20], at: usize, offset: f32, cosine: f32) -> Block {
        let (mut in_mine, mut in_theirs) = ([0.0; LANES], [0.0; LANES]);
        for axis in 0..3 {
            let (p, q) = (block(here[POSITION + axis], at), block(self.there[POSITION + axis], self.at));
            let (n, m) = (block(here[NORMAL + axis], at), block(self.there[NORMAL + axis], self.at));
            for i in 0..LANES {
                let towards = q[i] - p[i];
                in_mine[i] += n[i] * towards;
                in_theirs[i] += m[i] * towards;
            }
        }
        let aligned = self.cosine(here, at);
        let tolerance = block(here[TOLERANCE], at);
        std::array::from_fn(|i| {
            let limit = tolerance[i] * offset;
            flag((in_mine[i].abs() <= limit) & (in_theirs[i].abs() <= limit) & (aligned[i] >= cosine))
        })
    }

    /// Cosine between the normals; no number where there is no surface.
    #[inline(always)]
    fn cosine(&self, here: &[&[f32]; 20], at: usize) -> Block {
        let mut cosine = [0.0; LANES];
        for axis in 0..3 {
            let (n, m) = (block(here[NORMAL + axis], at), block(self.there[NORMAL + axis], self.at));
            for i in 0..LANES {
                cosine[i] += n[i] * m[i];
            }
        }
        cosine
    }

    #[inline(always)]
    fn add_to(&self, sums: &mut Sums, weight: Block) {
        for channel in 0..3 {
            let reflectance = block(self.there[REFLECTANCE + channel], self.at);
            let known: Block = std::array::from_fn(|i| weight[i] * flag(reflectance[i] > 0.0));
            for (half, sums) in HALVES.iter().zip(&mut sums.irradiance) {
                let irradiance = block(self.there[half + channel], self.at);
                for i in 0..LANES {
                    sums[channel][i] += known[i] * irradiance[i];
                }
            }
            sums.known[channel].iter_mut().zip(known).for_each(|(sum, known)| *sum += known);
        }
    }
}

impl Sums {
    /// Sums to means to changes.
    #[inline(always)]
    fn write(&self, here: &[&[f32]; 20], at: usize, [a, b]: [f32; 2], planes: &mut [&mut [f32]; 5]) {
        let (mut square, mut noise) = ([0.0; LANES], [0.0; LANES]);
        for channel in 0..3 {
            let [sum_a, sum_b] = self.irradiance.each_ref().map(|half| half[channel]);
            let [was_a, was_b] = HALVES.map(|half| block(here[half + channel], at));
            let reflectance = block(here[REFLECTANCE + channel], at);
            let mut change = [0.0; LANES];
            for i in 0..LANES {
                let known = self.known[channel][i];
                let scale = if known > 0.0 { 1.0 / known } else { 0.0 };
                let (change_a, change_b) = (sum_a[i] * scale - was_a[i], sum_b[i] * scale - was_b[i]);
                let both = a * change_a + b * change_b;
                let difference = change_a - change_b;
                change[i] = both * reflectance[i];
                square[i] += both * both;
                noise[i] += a * b * difference * difference;
            }
            planes[channel][at..at + LANES].copy_from_slice(&change);
        }
        planes[3][at..at + LANES].copy_from_slice(&square);
        planes[4][at..at + LANES].copy_from_slice(&noise);
    }
}

/// 1 or 0, without a branch.
#[inline(always)]
fn flag(yes: bool) -> f32 {
    if yes { 1.0 } else { 0.0 }
}

/// Offsets along one axis with their weights. An odd window is symmetric by itself. An even one is
/// made so by two half weights at its ends, which are `size` apart and so of the same light set:
/// each set still has weight 1.
fn taps(size: u8) -> Vec<(isize, f32)> {
    let reach = isize::from(size.clamp(1, 16) / 2);
    let even = size.is_multiple_of(2);
    let weight = |offset: isize| if even && offset.abs() == reach { 0.5 } else { 1.0 };
    (-reach..=reach).map(|offset| (offset, weight(offset))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn windows_give_every_light_set_the_same_weight() {
        for size in 1..=16u8 {
            let mut per_set = vec![0.0; usize::from(size)];
            for (offset, weight) in taps(size) {
                per_set[offset.rem_euclid(isize::from(size)) as usize] += weight;
            }
            assert!(per_set.iter().all(|weight| *weight == 1.0), "{size}: {per_set:?}");
            assert!(size / 2 <= MARGIN as u8, "the margin is wide enough");
        }
    }
}
