//! Our way of filling gaps: irradiance is smoothed within a surface, no farther than it takes to have
//! [`SAMPLES_ENOUGH`] samples, and gaps take the colour of one surface.
//!
//! Where a guide says what pixels see, light comes from the points of that around them, their own or not; else from those of
//! what their own point lies on.
//!
//! A thread takes a strip of rows: it gathers what their points know plane by plane, with a margin, and then smooths four
//! pixels at a time. Sums are of the same numbers in the same order for each pixel, whoever its neighbours are.

use std::f32::consts::FRAC_1_PI;

use glam::{BVec4A, Vec3, Vec4};
use rayon::prelude::*;

use super::guide::Exact;
use super::point::{Light, Place};
use super::points::Points;
use super::project::{NONE, PointImage};
use super::reconstruct::{PREFILTER, ROWS, around, has_point};

/// As many samples as make irradiance smooth enough.
const SAMPLES_ENOUGH: f32 = 64.0;
/// How far they are looked for, pixels.
const REACH: usize = 3;
/// Normals of one surface have at least this cosine …
const SAME_NORMAL: f32 = 0.9;
/// … and its points are no farther from the plane of another than this share of the distance.
const SAME_PLANE: f32 = 0.01;
/// Without normals: distances that differ by less than this share.
const SAME_DISTANCE: f32 = 0.05;
/// Pixels that are smoothed at a time.
const LANES: usize = 4;

/// Memory of the filter: a strip for each thread and more, so that one that is held up holds up nobody else for long.
#[derive(Clone, Debug, Default)]
pub(super) struct Surfaces {
    strips: Vec<Strip>,
}

/// Strips for each thread.
const STRIPS: usize = 4;

impl Surfaces {
    /// Makes radiance of points; and where anything is known at all. `exact`: what pixels see, or nothing.
    pub fn make(
        &mut self,
        points: &Points,
        image: &PointImage,
        exact: &[Option<Exact>],
        prefilter: bool,
        (pixels, known): (&mut [Vec3], &mut [bool]),
    ) {
        let (width, blocks) = (image.width, image.height.div_ceil(ROWS));
        let strips = (STRIPS * rayon::current_num_threads()).clamp(1, blocks);
        let rows = blocks.div_ceil(strips) * ROWS;
        self.strips.resize(strips, Strip::default());
        let parts = pixels.par_chunks_mut(rows * width).zip(known.par_chunks_mut(rows * width));
        self.strips.par_iter_mut().zip(parts).enumerate().for_each(|(number, (strip, (pixels, known)))| {
            let blocks = pixels.chunks_mut(ROWS * width).zip(known.chunks_mut(ROWS * width));
            for (block, pixels) in blocks.enumerate() {
                strip.smooth(points, image, exact, number * rows + block * ROWS, pixels);
            }
        });
        // Gaps look at pixels that are none.
        let gaps: Vec<usize> = (0..image.slots.len()).filter(|pixel| !known[*pixel]).collect();
        let colours = &*pixels;
        let fill = |pixel: &usize| {
            let near = mean_of_one_surface(colours, points, image, *pixel, 1);
            // A wide gap is mostly what came into view behind something.
            near.or_else(|| mean_of_one_surface(colours, points, image, *pixel, PREFILTER).filter(|_| prefilter))
        };
        let filled: Vec<Option<Vec3>> = gaps.par_iter().with_min_len(GAPS_AT_A_TIME).map(fill).collect();
        for (pixel, colour) in gaps.into_iter().zip(filled) {
            (pixels[pixel], known[pixel]) = (colour.unwrap_or_default(), colour.is_some());
        }
    }
}

/// Gaps that a thread takes at a time, at least.
const GAPS_AT_A_TIME: usize = 256;

/// What the points of some rows and of those around them know, plane by plane; rows are [`Strip::stride`] apart, and begin
/// [`REACH`] before the picture does.
#[derive(Clone, Debug, Default)]
struct Strip {
    stride: usize,
    normal: [Vec<f32>; 3],
    position: [Vec<f32>; 3],
    irradiance: [Vec<f32>; 3],
    /// Samples; 0 also where there is no point.
    count: Vec<f32>,
    /// What is known of the world before an edit is no measure for what was seen after it. Rounding confuses no two of
    /// sixteen million.
    revision: Vec<f32>,
    /// What pixels themselves see: as their points have it, or a guide.
    here_normal: [Vec<f32>; 3],
    here_position: [Vec<f32>; 3],
    here_distance: Vec<f32>,
    /// 1 where a pixel's point lies on that.
    is_own: Vec<f32>,
    /// 1 where there is something to smooth.
    is_matt: Vec<f32>,
    /// The mean irradiance of a row; no number where there is none.
    smoothed: Vec<Vec3>,
}

impl Strip {
    /// The colours of [`ROWS`] rows, from `first` on, and whether anything is known of them.
    fn smooth(
        &mut self,
        points: &Points,
        image: &PointImage,
        exact: &[Option<Exact>],
        first: usize,
        (pixels, known): (&mut [Vec3], &mut [bool]),
    ) {
        let (width, rows) = (image.width, pixels.len() / image.width);
        self.gather(points, image, first, rows);
        self.look(points, image, exact, first, rows);
        let rows = pixels.chunks_mut(width).zip(known.chunks_mut(width));
        for (row, (pixels, known)) in rows.enumerate() {
            self.smooth_row(width, row);
            let own = (first + row) * width..;
            for (((number, pixel), known), irradiance) in own.zip(pixels).zip(known).zip(&self.smoothed) {
                let colour = match (exact.get(number).and_then(Option::as_ref), image.slots[number]) {
                    (Some(exact), _) if exact.is_sky() => Some(exact.radiance(Vec3::ZERO)),
                    (Some(exact), _) if !irradiance.is_nan() => Some(exact.radiance(*irradiance)),
                    (_, NONE) => None,
                    (_, slot) => {
                        let light = points.light(slot);
                        let is_smoothed = light.is_matt() && !irradiance.is_nan();
                        let irradiance = if is_smoothed { *irradiance } else { light.irradiance };
                        Some(light.emitted + light.reflectance * irradiance * FRAC_1_PI)
                    }
                };
                (*pixel, *known) = (colour.unwrap_or_default(), colour.is_some());
            }
        }
    }

    fn planes(&mut self) -> impl Iterator<Item = &mut Vec<f32>> {
        let vectors = self.normal.iter_mut().chain(&mut self.position).chain(&mut self.irradiance);
        let here = self.here_normal.iter_mut().chain(&mut self.here_position).chain([&mut self.here_distance]);
        vectors.chain(here).chain([&mut self.count, &mut self.revision, &mut self.is_own, &mut self.is_matt])
    }

    fn gather(&mut self, points: &Points, image: &PointImage, first: usize, rows: usize) {
        let width = image.width;
        // Room for the last four, wherever they begin.
        self.stride = width.next_multiple_of(LANES) + 2 * REACH;
        let len = (rows + 2 * REACH) * self.stride + LANES;
        self.planes().for_each(|plane| {
            plane.clear();
            plane.resize(len, 0.0);
        });
        self.smoothed.resize(width.next_multiple_of(LANES), Vec3::ZERO);
        for row in first.saturating_sub(REACH)..(first + rows + REACH).min(image.height) {
            let start = (row + REACH - first) * self.stride + REACH;
            for (at, slot) in (start..).zip(&image.slots[row * width..][..width]).filter(|(_, slot)| **slot != NONE) {
                let sampled = points.sampled(*slot);
                let light = &sampled.light;
                let position = position(points, *slot);
                for axis in 0..3 {
                    self.normal[axis][at] = light.normal[axis];
                    self.position[axis][at] = position[axis];
                    self.irradiance[axis][at] = light.irradiance[axis];
                }
                self.count[at] = f32::from(sampled.count);
                self.revision[at] = sampled.revision as f32;
            }
        }
    }

    /// Finds what the pixels of some rows see.
    fn look(&mut self, points: &Points, image: &PointImage, exact: &[Option<Exact>], first: usize, rows: usize) {
        let width = image.width;
        for row in first..(first + rows).min(image.height) {
            let start = (row + REACH - first) * self.stride + REACH;
            for (at, pixel) in (start..).zip(row * width..(row + 1) * width) {
                let slot = image.slots[pixel];
                let light = (slot != NONE).then(|| points.light(slot));
                let is_matt = light.is_some_and(Light::is_matt);
                let point = [0, 1, 2].map(|axis| [self.normal[axis][at], self.position[axis][at]]);
                let (here, distance, is_own, is_smoothed) = match exact.get(pixel).and_then(Option::as_ref) {
                    Some(exact) if !exact.is_sky() => {
                        let Exact { normal, position, distance, .. } = *exact;
                        let [by, apart] = [0, 1].map(|of| Vec3::from_array(point.map(|axis| axis[of])));
                        let is_own = normal.dot(by) >= SAME_NORMAL
                            && (apart - position).dot(normal).abs() <= SAME_PLANE * distance;
                        ([0, 1, 2].map(|axis| [normal[axis], position[axis]]), distance, is_matt && is_own, true)
                    }
                    _ => (point, image.depths[pixel], light.is_some(), is_matt),
                };
                for (axis, [normal, position]) in here.into_iter().enumerate() {
                    (self.here_normal[axis][at], self.here_position[axis][at]) = (normal, position);
                }
                self.here_distance[at] = distance;
                self.is_own[at] = if is_own { 1.0 } else { 0.0 };
                self.is_matt[at] = if is_smoothed { 1.0 } else { 0.0 };
            }
        }
    }

    /// The mean irradiance of a row of the strip, where there is something to smooth.
    fn smooth_row(&mut self, width: usize, row: usize) {
        let start = (row + REACH) * self.stride + REACH;
        for x in (0..width).step_by(LANES) {
            let is_own = four(&self.is_own, start + x).cmpgt(Vec4::ZERO);
            let here = self.here(start + x, is_own);
            let depth = four(&self.here_distance, start + x);
            let is_matt = four(&self.is_matt, start + x).cmpgt(Vec4::ZERO);
            let own = Vec4::select(is_own, here.count.max(Vec4::ONE), Vec4::ZERO);
            let [mut red, mut green, mut blue] = here.irradiance;
            (red, green, blue) = (red * own, green * own, blue * own);
            let mut samples = own;
            for ring in &RINGS {
                let needs = is_matt & samples.cmplt(Vec4::splat(SAMPLES_ENOUGH));
                if !needs.any() {
                    break;
                }
                for [dx, dy] in ring.iter() {
                    let at = start + x + dx + dy * self.stride - REACH - REACH * self.stride;
                    let there = self.four(at);
                    let is_of_use = needs & here.is_same(&there, depth) & there.revision.cmpge(here.revision);
                    let count = Vec4::select(is_of_use, there.count, Vec4::ZERO);
                    let of_use = |irradiance| Vec4::select(is_of_use, irradiance, Vec4::ZERO) * count;
                    red += of_use(there.irradiance[0]);
                    green += of_use(there.irradiance[1]);
                    blue += of_use(there.irradiance[2]);
                    samples += count;
                }
            }
            (red, green, blue) = (red / samples, green / samples, blue / samples);
            for (lane, smoothed) in self.smoothed[x..x + LANES].iter_mut().enumerate() {
                *smoothed = Vec3::new(red[lane], green[lane], blue[lane]);
            }
        }
    }

    /// What four pixels see, and what their own points know of that.
    #[inline(always)]
    fn here(&self, at: usize, is_own: BVec4A) -> Four {
        let each = |[x, y, z]: &[Vec<f32>; 3]| [four(x, at), four(y, at), four(z, at)];
        let of = self.four(at);
        // Where no point is of it, there was no edit before which something was known.
        let revision = Vec4::select(is_own, of.revision, Vec4::ZERO);
        Four { normal: each(&self.here_normal), position: each(&self.here_position), revision, ..of }
    }

    /// What the points of four pixels know.
    #[inline(always)]
    fn four(&self, at: usize) -> Four {
        let each = |[x, y, z]: &[Vec<f32>; 3]| [four(x, at), four(y, at), four(z, at)];
        Four {
            normal: each(&self.normal),
            position: each(&self.position),
            irradiance: each(&self.irradiance),
            count: four(&self.count, at),
            revision: four(&self.revision, at),
        }
    }
}

#[inline(always)]
fn four(plane: &[f32], at: usize) -> Vec4 {
    Vec4::from_slice(&plane[at..at + LANES])
}

/// Four pixels beside each other.
struct Four {
    normal: [Vec4; 3],
    position: [Vec4; 3],
    irradiance: [Vec4; 3],
    count: Vec4,
    revision: Vec4,
}

impl Four {
    /// Both are of the same surface, as [`is_same`] has it where normals are known.
    #[inline(always)]
    fn is_same(&self, there: &Self, depth: Vec4) -> BVec4A {
        let dot = |a: [Vec4; 3], b: [Vec4; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
        let ([x, y, z], [there_x, there_y, there_z]) = (self.position, there.position);
        let apart = dot([there_x - x, there_y - y, there_z - z], self.normal).abs();
        dot(self.normal, there.normal).cmpge(Vec4::splat(SAME_NORMAL)) & apart.cmple(depth * SAME_PLANE)
    }
}

/// How far the pixels are that lie so many columns or rows away and no fewer, in the order of lines; both by [`REACH`] more
/// than they are.
const RINGS: [&[[usize; 2]]; REACH] = [&ring::<8>(1), &ring::<16>(2), &ring::<24>(3)];

const fn ring<const COUNT: usize>(reach: usize) -> [[usize; 2]; COUNT] {
    let (mut ring, mut count) = ([[0; 2]; COUNT], 0);
    let (least, most) = (REACH - reach, REACH + reach);
    let mut y = least;
    while y <= most {
        let mut x = least;
        while x <= most {
            if x == least || x == most || y == least || y == most {
                ring[count] = [x, y];
                count += 1;
            }
            x += 1;
        }
        y += 1;
    }
    ring
}

fn position(points: &Points, slot: u32) -> Vec3 {
    match points.place(slot) {
        Some(Place::Near(place) | Place::Far(place)) => place,
        None => Vec3::ZERO,
    }
}

/// Whether two pixels show the same surface, as far as their points tell.
fn is_same(points: &Points, image: &PointImage, here: usize, there: usize) -> bool {
    let (depth, other_depth) = (image.depths[here], image.depths[there]);
    let (slot, other) = (image.slots[here], image.slots[there]);
    let (normal, other_normal) = (points.light(slot).normal, points.light(other).normal);
    if normal == Vec3::ZERO || other_normal == Vec3::ZERO {
        return normal == other_normal && (depth - other_depth).abs() <= SAME_DISTANCE * depth;
    }
    let apart = position(points, other) - position(points, slot);
    normal.dot(other_normal) >= SAME_NORMAL && apart.dot(normal).abs() <= SAME_PLANE * depth
}

/// The mean over the points of one surface: within a step that of the nearest point, and of equally near ones the foremost;
/// farther away that of the farthest from the eye.
fn mean_of_one_surface(
    colours: &[Vec3],
    points: &Points,
    image: &PointImage,
    pixel: usize,
    reach: usize,
) -> Option<Vec3> {
    let apart = |[dx, dy]: [usize; 2]| dx * dx + dy * dy;
    let is_nearer = |a: &(usize, [usize; 2]), b: &(usize, [usize; 2])| match reach {
        0 | 1 => apart(a.1).cmp(&apart(b.1)).then(image.depths[a.0].total_cmp(&image.depths[b.0])),
        _ => image.depths[b.0].total_cmp(&image.depths[a.0]),
    };
    let (nearest, _) = around(image, pixel, reach).filter(has_point(image)).min_by(is_nearer)?;
    let (mut sum, mut weights) = (Vec3::ZERO, 0.0);
    for (there, by) in around(image, pixel, reach).filter(has_point(image)) {
        if there == nearest || is_same(points, image, nearest, there) {
            let weight = 1.0 / apart(by).max(1) as f32;
            sum += colours[there] * weight;
            weights += weight;
        }
    }
    Some(sum / weights)
}
