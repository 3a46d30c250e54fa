//! The discontinuity buffer: irradiance is smoothed over neighbours that see the same surface.
//!
//! **Idea** (IGI-8): interleaved light sets make neighbouring pixels wrong in different ways. Where
//! irradiance is smooth, the mean over a block of neighbours has all sets in it, and n·m times
//! fewer light sources per pixel do. Reflectance is multiplied in afterwards, so textures stay
//! sharp; what must not be filtered (lamps, reflections) never comes here.
//!
//! **Bad** where irradiance is not smooth on a smooth surface: contact shadows and caustics blur by
//! the window. [`super::fade`] therefore takes the filter back as samples accumulate.

use glam::Vec3;
use scenes::Camera;
use scenes::camera::Lens;

use super::Film;
use super::film::mean;
use super::planes::{Block, LANES, MARGIN, Rolling, RowBlock, each};

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

/// What the filter works on: rows of the film's means ([`mean`]), and behind them the position of the point that is
/// seen (3) and its tolerance.
pub(super) const GUIDED: usize = mean::PLANES + 4;
const POSITION: usize = mean::PLANES;
const TOLERANCE: usize = mean::PLANES + 3;

/// What the filter does to each pixel: the change of radiance by channel; and, if the halves of the film are kept
/// apart, the square of the change of irradiance, the part of that square that is noise, each half's change of
/// irradiance, all channels added (see [`super::fade`]), and by channel how much more radiance the first half's changes by
/// than the second's.
pub(super) const CHANGES: usize = 10;
pub(super) const SQUARE: usize = 3;
pub(super) const NOISE: usize = 4;
pub(super) const HALVES: [usize; 2] = [5, 6];
pub(super) const APART: usize = 7;

/// All that is the same for the whole picture.
pub(super) struct Window<'a> {
    film: &'a Film,
    lens: Lens,
    edges: Edges,
    /// Offsets along a row and down a column, with their weights.
    columns: Vec<(isize, f32)>,
    rows: Vec<(isize, f32)>,
    /// Sum of all weights, exact: they are halves and ones.
    area: f32,
    /// Half a footprint, and what jitter adds to it, at distance 1.
    tolerance: f32,
    /// Share of each half of the film in all frames.
    shares: [f32; 2],
}

impl<'a> Window<'a> {
    /// As samples are jittered within their pixels, a single one may lie half a footprint off the plane through
    /// the pixel's middle; means lie closer.
    pub fn new(film: &'a Film, camera: &Camera, window: [u8; 2], edges: Edges) -> Self {
        let lens = camera.lens();
        let frames = film.frames().max(1);
        let jitter = 0.5 / f64::from(frames).sqrt() as f32;
        let [columns, rows] = window.map(taps);
        let shares = film.halves().map(|half| half as f32 / frames as f32);
        let area = [&columns, &rows].map(|taps| taps.iter().map(|(_, weight)| weight).sum::<f32>()).iter().product();
        Self { film, lens, edges, columns, rows, area, tolerance: (0.5 + jitter) * lens.pixel(), shares }
    }

    /// How many rows up and down the window reaches.
    pub fn reach(&self) -> usize {
        self.rows.iter().map(|(offset, _)| offset.unsigned_abs()).max().unwrap_or(0)
    }

    /// Mean of a plane of changes over the window, whatever is seen there, into `mean`: row `y`, all of whose neighbours
    /// must be in `changes`. Both rows are as long as those of the planes; `down` is overwritten.
    #[inline(always)]
    pub fn mean(&self, (y, plane): (usize, usize), changes: &Rolling<CHANGES>, down: &mut [f32], mean: &mut [f32]) {
        let (width, height) = (self.film.tiling().width as usize, self.film.tiling().height as usize);
        down.fill(0.0);
        for (dy, weight) in &self.rows {
            let Some(there) = y.checked_add_signed(*dy).filter(|there| *there < height) else { continue };
            let values = changes.row(there).plane(plane);
            let inside = MARGIN..MARGIN + width;
            down[inside.clone()].iter_mut().zip(&values[inside]).for_each(|(sum, value)| *sum += weight * value);
        }
        let mean = &mut mean[MARGIN..MARGIN + width];
        mean.fill(0.0);
        for (dx, weight) in &self.columns {
            let weight = weight / self.area;
            mean.iter_mut()
                .zip(&down[MARGIN.wrapping_add_signed(*dx)..])
                .for_each(|(sum, value)| *sum += weight * value);
        }
    }

    /// Offsets along a row and down a column, with their weights.
    pub fn taps(&self) -> [Vec<(i32, f32)>; 2] {
        let plain = |taps: &[(isize, f32)]| taps.iter().map(|(offset, weight)| (*offset as i32, *weight)).collect();
        [plain(&self.columns), plain(&self.rows)]
    }

    /// Frames in the smaller half of the film.
    pub fn frames_in_half(&self) -> u32 {
        self.film.halves().into_iter().min().unwrap_or(0)
    }

    /// Share of each half of the film in all frames.
    pub fn shares(&self) -> [f32; 2] {
        self.shares
    }

    /// By how much more radiance the pixels of a row have in the first half of the film than in the second.
    pub fn halves_apart(&self, y: usize, row: &mut [Vec3]) {
        self.film.halves_apart(y, row);
    }

    /// Reads a row of the film into the middle of `planes`. In the margins, normals are no numbers: every comparison
    /// with what is not in the picture fails.
    #[inline(always)]
    pub fn read(&self, y: usize, apart: bool, mut planes: [&mut [f32]; GUIDED]) {
        let width = self.film.tiling().width as usize;
        for plane in &mut planes[mean::NORMAL..mean::NORMAL + 3] {
            plane[..MARGIN].fill(f32::NAN);
            plane[MARGIN + width..].fill(f32::NAN);
        }
        let mut planes = planes.map(|plane| &mut plane[MARGIN..MARGIN + width]);
        self.film.mean_row(y, apart, &mut planes);
        let (means, places) = planes.split_at_mut(POSITION);
        let distance = &means[mean::DISTANCE][..width];
        if let [x_plane, y_plane, z_plane, tolerance] = places {
            let [x_plane, y_plane, z_plane, tolerance] =
                [x_plane, y_plane, z_plane, tolerance].map(|plane| &mut plane[..width]);
            for x in 0..width {
                let position = self.lens.direction(x as f32 + 0.5, y as f32 + 0.5) * distance[x];
                [x_plane[x], y_plane[x], z_plane[x]] = position.to_array();
                tolerance[x] = distance[x] * self.tolerance;
            }
        }
    }

    /// What smoothing by the mean irradiance over the neighbours in the window that see the same surface changes
    /// in row `y`, all of whose neighbours must be in `means`.
    #[inline(always)]
    pub fn smooth<const APART: bool>(&self, y: usize, means: &Rolling<GUIDED>, mut planes: [&mut [f32]; CHANGES]) {
        let tiling = self.film.tiling();
        let row = means.row(y);
        let near = |(dy, weight): &(isize, f32)| {
            let there = y.checked_add_signed(*dy).filter(|there| *there < tiling.height as usize)?;
            Some((means.row(there), *dy, *weight))
        };
        let rows: Vec<_> = self.rows.iter().filter_map(near).collect();
        for at in (MARGIN..MARGIN + tiling.width as usize).step_by(LANES) {
            let here = row.block(at);
            let mut sums = Sums::default();
            for (there, dy, weight_y) in &rows {
                for (dx, weight_x) in &self.columns {
                    let there = there.block(at.wrapping_add_signed(*dx));
                    let weight = weight_x * weight_y;
                    let offset = ((dx * dx + dy * dy) as f32).sqrt();
                    let weights = match self.edges {
                        _ if *dx == 0 && *dy == 0 => [weight; LANES],
                        Edges::Thresholds { distance, cosine } => are_near(here, there, (distance, cosine), weight),
                        Edges::Planes { cosine } => are_coplanar(here, there, (offset, cosine), weight),
                    };
                    sums.add::<APART>(there, &weights);
                }
            }
            sums.write::<APART>(here, at, self.shares, &mut planes);
        }
    }
}

/// A block of pixels and all that the filter knows of them.
type Means<'a> = RowBlock<'a, GUIDED>;

/// The weight where the paper's thresholds find the same surface, else 0.
#[inline(always)]
fn are_near(here: Means, there: Means, (most, cosine): (f32, f32), weight: f32) -> Block {
    let (mine, theirs) = (here.plane(mean::DISTANCE), there.plane(mean::DISTANCE));
    let [n, m] = [here, there].map(normals);
    each(|i| {
        // No number where there is no surface.
        let aligned = n[0][i] * m[0][i] + n[1][i] * m[1][i] + n[2][i] * m[2][i];
        if ((mine[i] - theirs[i]).abs() <= most * mine[i]) & (aligned >= cosine) { weight } else { 0.0 }
    })
}

/// The weight where both points lie in each other's tangent plane, else 0.
#[inline(always)]
fn are_coplanar(here: Means, there: Means, (offset, cosine): (f32, f32), weight: f32) -> Block {
    let [n, m] = [here, there].map(normals);
    let [p, q] = [here, there].map(|means| [0, 1, 2].map(|axis| means.plane(POSITION + axis)));
    let tolerance = here.plane(TOLERANCE);
    each(|i| {
        let [x, y, z] = [q[0][i] - p[0][i], q[1][i] - p[1][i], q[2][i] - p[2][i]];
        let in_mine = n[0][i] * x + n[1][i] * y + n[2][i] * z;
        let in_theirs = m[0][i] * x + m[1][i] * y + m[2][i] * z;
        // No number where there is no surface.
        let aligned = n[0][i] * m[0][i] + n[1][i] * m[1][i] + n[2][i] * m[2][i];
        let limit = tolerance[i] * offset;
        let same = (in_mine.abs() <= limit) & (in_theirs.abs() <= limit) & (aligned >= cosine);
        if same { weight } else { 0.0 }
    })
}

#[inline(always)]
fn normals(means: Means<'_>) -> [&Block; 3] {
    [0, 1, 2].map(|axis| means.plane(mean::NORMAL + axis))
}

/// Sums of known irradiance of both halves by channel (or of all frames, in the first), and of the weights of each
/// channel.
#[derive(Clone, Copy)]
struct Sums {
    irradiance: [[Block; 3]; 2],
    known: [Block; 3],
}

impl Default for Sums {
    fn default() -> Self {
        Self { irradiance: [[[0.0; LANES]; 3]; 2], known: [[0.0; LANES]; 3] }
    }
}

impl Sums {
    /// Adds neighbours.
    #[inline(always)]
    fn add<const APART: bool>(&mut self, there: Means, weight: &Block) {
        for channel in 0..3 {
            let reflectance = there.plane(mean::REFLECTANCE + channel);
            let known = each(|i| if reflectance[i] > 0.0 { weight[i] } else { 0.0 });
            for (half, sums) in self.irradiance.iter_mut().enumerate().take(1 + usize::from(APART)) {
                let irradiance = there.plane(mean::IRRADIANCE[half] + channel);
                for i in 0..LANES {
                    sums[channel][i] += known[i] * irradiance[i];
                }
            }
            for (sum, known) in self.known[channel].iter_mut().zip(&known) {
                *sum += known;
            }
        }
    }

    /// Sums to means to changes.
    #[inline(always)]
    fn write<const APART: bool>(&self, here: Means, at: usize, [a, b]: [f32; 2], planes: &mut [&mut [f32]; CHANGES]) {
        let (mut square, mut noise, mut halves) = ([0.0; LANES], [0.0; LANES], [[0.0; LANES]; 2]);
        for channel in 0..3 {
            let mut apart = [0.0; LANES];
            let reflectance = here.plane(mean::REFLECTANCE + channel);
            let known = &self.known[channel];
            let scale = each(|i| if known[i] > 0.0 { 1.0 / known[i] } else { 0.0 });
            let mut both = self.change(here, 0, channel, &scale);
            if APART {
                // Irradiance on what is black is not known.
                let visible = each(|i| flag(reflectance[i] > 0.0));
                let (change_a, change_b) = (both, self.change(here, 1, channel, &scale));
                for i in 0..LANES {
                    let (change_a, change_b) = (visible[i] * change_a[i], visible[i] * change_b[i]);
                    both[i] = a * change_a + b * change_b;
                    let difference = change_a - change_b;
                    apart[i] = difference * reflectance[i];
                    square[i] += both[i] * both[i];
                    noise[i] += a * b * difference * difference;
                    halves[0][i] += change_a;
                    halves[1][i] += change_b;
                }
            }
            planes[channel][at..at + LANES].copy_from_slice(&each(|i| both[i] * reflectance[i]));
            if APART {
                planes[self::APART + channel][at..at + LANES].copy_from_slice(&apart);
            }
        }
        if APART {
            planes[SQUARE][at..at + LANES].copy_from_slice(&square);
            planes[NOISE][at..at + LANES].copy_from_slice(&noise);
            HALVES
                .into_iter()
                .zip(halves)
                .for_each(|(plane, half)| planes[plane][at..at + LANES].copy_from_slice(&half));
        }
    }

    /// What the mean changes a half's irradiance by.
    #[inline(always)]
    fn change(&self, here: Means, half: usize, channel: usize, scale: &Block) -> Block {
        let (sum, was) = (&self.irradiance[half][channel], here.plane(mean::IRRADIANCE[half] + channel));
        each(|i| sum[i] * scale[i] - was[i])
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
