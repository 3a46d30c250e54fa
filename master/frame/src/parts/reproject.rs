//! The last picture, as seen from where the camera is now.
//!
//! Every pixel that was shown is a point in the scene. Moved to the new picture, these points fill
//! what the workers have not answered yet (algorithms.md A2), and steady what they have: a
//! point that is seen again keeps part of its old colour (B5), within what its neighbours have now, so
//! that what changes is not dragged along.

use std::sync::Arc;

use glam::Vec3;
use rayon::prelude::*;
use scenes::Camera;
use scenes::camera::Lens;

use crate::Picture;

/// A picture and where its points lie.
#[derive(Clone, Debug, Default)]
pub struct Shown {
    /// From where; its size is the picture's.
    pub camera: Camera,
    /// Radiance.
    pub picture: Arc<Picture>,
    /// Length of the eye path to each pixel's point; 0 for what is infinitely far.
    pub distance: Vec<f32>,
    /// In how many frames each pixel's point has been seen, at most [`AGE_MAX`].
    pub age: Vec<f32>,
}

/// A new picture, perhaps with holes.
#[derive(Clone, Debug)]
pub struct Fresh {
    /// From where; its size is the picture's.
    pub camera: Camera,
    /// Radiance; of no meaning in holes.
    pub picture: Picture,
    /// As in [`Shown::distance`].
    pub distance: Vec<f32>,
    /// Which pixels are not holes.
    pub known: Vec<bool>,
}

/// How much a new picture takes of the last one.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Steady {
    /// Nothing, but in holes.
    #[default]
    Off,
    /// What is seen again keeps part of its old colour, within what its neighbours have now: what changes is gone in a few
    /// pictures.
    Clamped,
    /// Nothing has changed but the camera: what is seen again is the mean of its pictures, so that noise goes and nothing
    /// else does.
    Mean,
}

impl Steady {
    /// A new picture counts at least one over this.
    fn age_max(self) -> f32 {
        if self == Self::Mean { AGE_MAX } else { CLAMPED_AGE_MAX }
    }
}

/// Pictures that a mean is made of at most: what reprojection blurs and misses is gone after as many.
pub const AGE_MAX: f32 = 16.0;
/// Five pictures make one steady, and what has changed is gone in a few.
const CLAMPED_AGE_MAX: f32 = 5.0;
/// Two points are the same if their distances from the eye differ by less than this share.
const SAME_DISTANCE: f32 = 0.03;
/// Standard deviations of the new neighbourhood that an old colour may be away from its mean.
const CLAMP_DEVIATIONS: f32 = 1.25;

impl Fresh {
    /// Fills the holes between pixels that are known in every so many columns and rows: where a light set or more of each
    /// block has come, the picture is whole, though coarse. A hole takes the mean of the known pixels around it that see
    /// the surface that the nearest sees, so that edges stay edges.
    pub fn between(mut self, [columns, rows]: [u8; 2]) -> Self {
        let (width, height) = (self.picture.width as usize, self.picture.height as usize);
        let (reach_x, reach_y) = (usize::from(columns.max(1)), usize::from(rows.max(1)));
        let (known, colours, distances) = (&self.known, &self.picture.pixels, &self.distance);
        let around = |index: usize| {
            let (x, y) = (index % width, index / width);
            let across = (x + 1).saturating_sub(reach_x)..(x + reach_x).min(width);
            let down = (y + 1).saturating_sub(reach_y)..(y + reach_y).min(height);
            let there = down.flat_map(move |there_y| across.clone().map(move |there_x| (there_x, there_y)));
            there.map(move |(there_x, there_y)| {
                let (dx, dy) = (there_x.abs_diff(x) as f32, there_y.abs_diff(y) as f32);
                let tent = (1.0 - dx / reach_x as f32) * (1.0 - dy / reach_y as f32);
                (there_y * width + there_x, dx * dx + dy * dy, tent)
            })
        };
        let fill = |index: usize| {
            let neighbours = || around(index).filter(|(there, ..)| known[*there]);
            let (nearest, ..) = neighbours().min_by(|a, b| a.1.total_cmp(&b.1))?;
            let far = distances[nearest];
            let sees_the_same = |there: &usize| (distances[*there] - far).abs() <= SAME_DISTANCE * far;
            let (mut sum, mut weights) = (Vec3::ZERO, 0.0);
            for (there, square, tent) in neighbours().filter(|(there, ..)| sees_the_same(there)) {
                let weight = tent / square;
                sum += colours[there] * weight;
                weights += weight;
            }
            Some((sum / weights, far))
        };
        let fill = |index: usize| if known[index] { None } else { fill(index) };
        let filled: Vec<_> = (0..known.len()).into_par_iter().with_min_len(2048).map(fill).collect();
        for (index, filled) in filled.into_iter().enumerate() {
            let Some((colour, distance)) = filled else { continue };
            (self.picture.pixels[index], self.distance[index], self.known[index]) = (colour, distance, true);
        }
        self
    }

    /// Fills the holes from the last picture, then from around them; without either they stay as they are. What is known
    /// takes as much of its old colour as `steady` says.
    pub fn after(mut self, last: Option<&Shown>, steady: Steady) -> Shown {
        let age = match last.filter(|_| steady != Steady::Off) {
            Some(last) => self.steady(last, steady),
            None => vec![1.0; self.distance.len()],
        };
        if self.known.contains(&false) {
            match last {
                Some(last) if is_same_view(&last.camera, &self.camera) => self.fill_enlarged(last),
                Some(last) => self.fill_from(last),
                None => {}
            }
            fill_from_around([self.camera.width, self.camera.height], &mut self.picture.pixels, &mut self.known);
        }
        Shown { camera: self.camera, picture: Arc::new(self.picture), distance: self.distance, age }
    }

    /// Blends known pixels with what they were; the age of each.
    fn steady(&mut self, last: &Shown, steady: Steady) -> Vec<f32> {
        let width = self.picture.width as usize;
        let mut age = vec![1.0; self.distance.len()];
        let mut pixels = std::mem::take(&mut self.picture.pixels);
        if steady != Steady::Mean {
            // What neighbours have is looked at.
            self.picture.pixels.clone_from(&pixels);
        }
        let (lens, old_lens, has_holes) = (self.camera.lens(), last.camera.lens(), self.known.contains(&false));
        let blend = Blend { fresh: self, last, lens, old_lens, steady, has_holes };
        let rows = pixels.par_chunks_mut(width).zip(age.par_chunks_mut(width));
        rows.enumerate().with_min_len(ROWS_MIN).for_each(|(y, (pixels, age))| blend.row(y, pixels, age));
        self.picture.pixels = pixels;
        age
    }

    /// Mean and standard deviation of the known pixels of a neighbourhood; `None` if they are few.
    fn around(&self, index: usize, reach: usize) -> Option<(Vec3, Vec3)> {
        let (width, height) = (self.picture.width as usize, self.picture.height as usize);
        let (x, y) = (index % width, index / width);
        let (mut sum, mut squares, mut count) = (Vec3::ZERO, Vec3::ZERO, 0.0);
        for there_y in y.saturating_sub(reach)..(y + reach + 1).min(height) {
            for there_x in x.saturating_sub(reach)..(x + reach + 1).min(width) {
                let there = there_y * width + there_x;
                if self.known[there] {
                    let value = self.picture.pixels[there];
                    sum += value;
                    squares += value * value;
                    count += 1.0;
                }
            }
        }
        let mean = sum / count;
        let variance = (squares / count - mean * mean).max(Vec3::ZERO);
        (count >= 4.0).then(|| (mean, variance.map(f32::sqrt)))
    }

    /// Fills the holes from a picture of the same view, whatever its size.
    fn fill_enlarged(&mut self, last: &Shown) {
        let width = self.picture.width as usize;
        let scale = self.camera.lens().pixel() / last.camera.lens().pixel();
        let middle = |camera: &Camera| [camera.width, camera.height].map(|side| side as f32 / 2.0);
        let (here, there) = (middle(&self.camera), middle(&last.camera));
        let sides = [last.picture.width, last.picture.height].map(|side| side as usize);
        // Between which two columns or rows, and how far from the first.
        let between = |at: usize, axis: usize| {
            let place = (at as f32 + 0.5 - here[axis]) * scale + there[axis] - 0.5;
            let place = place.clamp(0.0, (sides[axis] - 1) as f32);
            let first = place as usize;
            (first, (first + 1).min(sides[axis] - 1), place - place.floor())
        };
        let look = |index: usize| {
            let ((left, right, across), (top, bottom, down)) = (between(index % width, 0), between(index / width, 1));
            let row = |y: usize| {
                let colour = |x: usize| last.picture.pixels[y * sides[0] + x];
                colour(left).lerp(colour(right), across)
            };
            let nearest = |first: usize, second: usize, share: f32| if share < 0.5 { first } else { second };
            let nearest = nearest(top, bottom, down) * sides[0] + nearest(left, right, across);
            (row(top).lerp(row(bottom), down), last.distance[nearest])
        };
        let known = &self.known;
        let looked: Vec<_> = (0..known.len())
            .into_par_iter()
            .with_min_len(2048)
            .map(|index| (!known[index]).then(|| look(index)))
            .collect();
        for (index, looked) in looked.into_iter().enumerate() {
            let Some((colour, distance)) = looked else { continue };
            (self.picture.pixels[index], self.distance[index], self.known[index]) = (colour, distance, true);
        }
    }

    /// Moves the last picture's points into the holes, nearest first.
    fn fill_from(&mut self, last: &Shown) {
        let (lens, old_lens) = (self.camera.lens(), last.camera.lens());
        let (width, height) = (self.picture.width as i64, self.picture.height as i64);
        // A point covers as many pixels as its old pixel does now.
        let reach = (old_lens.pixel() / lens.pixel()).ceil().clamp(1.0, 8.0) as i64;
        let mut nearest = vec![f32::INFINITY; self.known.len()];
        let mut filled = vec![false; self.known.len()];
        for (index, (colour, distance)) in last.picture.pixels.iter().zip(&last.distance).enumerate() {
            let (x, y) = (index as u32 % last.picture.width, index as u32 / last.picture.width);
            let place = Place::of(&old_lens, x as f32 + 0.5, y as f32 + 0.5, *distance);
            let Some((x, y, far)) = place.seen_by(&lens) else { continue };
            let (left, top) = (x - reach as f32 / 2.0, y - reach as f32 / 2.0);
            let (left, top) = (left.round() as i64, top.round() as i64);
            for y in top.max(0)..(top + reach).min(height) {
                for x in left.max(0)..(left + reach).min(width) {
                    let there = (y * width + x) as usize;
                    if !self.known[there] && far < nearest[there] {
                        nearest[there] = far;
                        filled[there] = true;
                        self.picture.pixels[there] = *colour;
                        self.distance[there] = if far.is_finite() { far } else { 0.0 };
                    }
                }
            }
        }
        self.known.iter_mut().zip(filled).for_each(|(known, filled)| *known |= filled);
    }
}

/// Fills what is not known with the mean of what is near: the picture is halved until there are no holes, and holes take their
/// colour from the half. Where nothing is known at all, nothing happens.
pub fn fill_from_around([width, height]: [u32; 2], pixels: &mut [Vec3], known: &mut [bool]) {
    if !known.contains(&false) || !known.contains(&true) {
        return;
    }
    let weighted = |(colour, known): (&Vec3, &bool)| if *known { (*colour, 1.0) } else { (Vec3::ZERO, 0.0) };
    let weighted: Weighted = pixels.iter().zip(&*known).map(weighted).collect();
    let mut levels = vec![(width as usize, height as usize, weighted)];
    while let Some((width, height, pixels)) = levels.last()
        && (*width > 1 || *height > 1)
        && pixels.iter().any(|pixel| pixel.1 == 0.0)
    {
        levels.push(halved(*width, *height, pixels));
    }
    while let Some((coarse_width, _, coarse)) = levels.pop() {
        let Some((width, _, finer)) = levels.last_mut() else {
            for (index, (colour, weight)) in coarse.into_iter().enumerate() {
                if !known[index] && weight > 0.0 {
                    (pixels[index], known[index]) = (colour / weight, true);
                }
            }
            return;
        };
        for (index, pixel) in finer.iter_mut().enumerate().filter(|(_, pixel)| pixel.1 == 0.0) {
            *pixel = coarse[index / *width / 2 * coarse_width + index % *width / 2];
        }
    }
}

/// From the same place in the same direction; sizes may differ.
fn is_same_view(a: &Camera, b: &Camera) -> bool {
    let [a, b] = [a, b].map(|camera| Camera { width: 1, height: 1, ..*camera });
    a == b
}

type Weighted = Vec<(Vec3, f32)>;

fn halved(width: usize, height: usize, pixels: &Weighted) -> (usize, usize, Weighted) {
    let (half_width, half_height) = (width.div_ceil(2), height.div_ceil(2));
    let mut half = vec![(Vec3::ZERO, 0.0); half_width * half_height];
    for (index, (colour, weight)) in pixels.iter().enumerate() {
        let there = &mut half[index / width / 2 * half_width + index % width / 2];
        there.0 += *colour;
        there.1 += *weight;
    }
    (half_width, half_height, half)
}

/// A point in the scene, or a direction to what is infinitely far.
#[derive(Clone, Copy)]
enum Place {
    Near(Vec3),
    Far(Vec3),
}

impl Place {
    fn of(lens: &Lens, x: f32, y: f32, distance: f32) -> Self {
        let direction = lens.direction(x, y);
        if distance > 0.0 { Self::Near(lens.origin() + direction * distance) } else { Self::Far(direction) }
    }

    /// Where in a picture, and how far.
    fn seen_by(self, lens: &Lens) -> Option<(f32, f32, f32)> {
        match self {
            Self::Near(point) => lens.project(point),
            Self::Far(direction) => lens.project(lens.origin() + direction).map(|(x, y, _)| (x, y, f32::INFINITY)),
        }
    }
}

/// A picture that is looked up.
struct View<'a> {
    shown: &'a Shown,
    lens: Lens,
}

impl<'a> View<'a> {
    fn new(shown: &'a Shown) -> Self {
        Self { shown, lens: shown.camera.lens() }
    }

    /// Colour and age of a place.
    fn at(&self, place: Place) -> Option<(Vec3, f32)> {
        let (x, y, distance) = place.seen_by(&self.lens)?;
        self.shown.at(x, y, distance)
    }
}

impl Shown {
    /// Colour and age of what is seen there, in pixels, and so far away; infinitely far if that is not finite: bilinear
    /// over those of four pixels that show the same place.
    #[inline(always)]
    fn at(&self, x: f32, y: f32, distance: f32) -> Option<(Vec3, f32)> {
        let (width, height) = (self.picture.width as usize, self.picture.height as usize);
        let (left, top) = ((x - 0.5).floor(), (y - 0.5).floor());
        if !(left >= -1.0 && top >= -1.0 && left < width as f32 && top < height as f32) {
            return None;
        }
        let (across, down) = (x - 0.5 - left, y - 0.5 - top);
        let (mut colour, mut age, mut weights) = (Vec3::ZERO, 0.0, 0.0);
        for (dy, weight_y) in [(0, 1.0 - down), (1, down)] {
            // Beyond the edge, it is no row.
            let row = (top as i32 + dy) as usize;
            if row >= height {
                continue;
            }
            for (dx, weight_x) in [(0, 1.0 - across), (1, across)] {
                let column = (left as i32 + dx) as usize;
                if column >= width {
                    continue;
                }
                let there = row * width + column;
                let seen = self.distance[there];
                let same = if distance.is_finite() {
                    (seen - distance).abs() <= SAME_DISTANCE * distance
                } else {
                    seen == 0.0
                };
                if same {
                    let weight = weight_x * weight_y;
                    colour += self.picture.pixels[there] * weight;
                    age += self.age[there] * weight;
                    weights += weight;
                }
            }
        }
        (weights > 0.05).then(|| (colour / weights, age / weights))
    }
}

/// A new picture is blended with the last.
struct Blend<'a> {
    fresh: &'a Fresh,
    last: &'a Shown,
    lens: Lens,
    old_lens: Lens,
    steady: Steady,
    /// The new picture has holes.
    has_holes: bool,
}

/// Pixels of a row that are projected at a time.
const AT_A_TIME: usize = 64;
/// Rows that a thread takes at least.
const ROWS_MIN: usize = 8;

impl Blend<'_> {
    /// Blends a row, with the widest vectors that the machine has. They compute the same bits: no operation is fused or
    /// reordered.
    fn row(&self, y: usize, pixels: &mut [Vec3], age: &mut [f32]) {
        #[cfg(target_arch = "x86_64")]
        if std::arch::is_x86_feature_detected!("avx2") {
            // SAFETY: the machine has just said that it has AVX2.
            return unsafe { self.row_avx2(y, pixels, age) };
        }
        self.row_as_it_is(y, pixels, age);
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2")]
    fn row_avx2(&self, y: usize, pixels: &mut [Vec3], age: &mut [f32]) {
        self.row_as_it_is(y, pixels, age);
    }

    #[inline(always)]
    fn row_as_it_is(&self, y: usize, pixels: &mut [Vec3], age: &mut [f32]) {
        let width = pixels.len();
        let places = pixels.chunks_mut(AT_A_TIME).zip(age.chunks_mut(AT_A_TIME)).enumerate();
        for (chunk, (pixels, age)) in places {
            let first = y * width + chunk * AT_A_TIME;
            let distance = &self.fresh.distance[first..first + pixels.len()];
            let there = self.project([chunk * AT_A_TIME, y], distance);
            for (i, (pixel, age)) in pixels.iter_mut().zip(age).enumerate() {
                if !self.fresh.known[first + i] {
                    continue;
                }
                let Some((old, old_age)) = self.last.at(there.x[i], there.y[i], there.distance[i]) else { continue };
                let old = self.within_new(first + i, old);
                *age = (old_age + 1.0).min(self.steady.age_max());
                *pixel = old + (*pixel - old) / *age;
            }
        }
    }

    /// Where the points of some pixels of a row, from this one on, are in the last picture.
    #[inline(always)]
    fn project(&self, [first, y]: [usize; 2], distance: &[f32]) -> Projected {
        let mut there = Projected::default();
        let y = y as f32 + 0.5;
        let (here, from, pixel) = (self.lens.origin(), self.old_lens.origin(), self.old_lens.pixel());
        let [right, down, forward] = self.old_lens.axes();
        let ([middle_x, middle_y], near) = (self.old_lens.middle(), self.old_lens.near());
        let mut fars = [0.0; AT_A_TIME];
        fars[..distance.len()].copy_from_slice(distance);
        // All of them, in numbers of 32 bits, so that this becomes vectors.
        let first = first as i32;
        #[expect(clippy::needless_range_loop, reason = "four arrays of one length: as iterators they are no vectors")]
        for i in 0..AT_A_TIME {
            let direction = self.lens.direction((first + i as i32) as f32 + 0.5, y);
            let is_near = fars[i] > 0.0;
            let point = if is_near { here + direction * fars[i] } else { from + direction };
            let offset = point - from;
            let depth = offset.dot(forward);
            let scale = 1.0 / (depth * pixel);
            // What is behind the eye, or cut away, is nowhere in the picture.
            there.x[i] = if depth > near { offset.dot(right) * scale + middle_x } else { f32::INFINITY };
            there.y[i] = offset.dot(down) * scale + middle_y;
            there.distance[i] = if is_near { offset.length() } else { f32::INFINITY };
        }
        there
    }

    /// An old colour, within what its neighbours have now, where more than the camera has changed.
    #[inline(always)]
    fn within_new(&self, index: usize, old: Vec3) -> Vec3 {
        if self.steady == Steady::Mean {
            return old;
        }
        // With holes, neighbours are farther apart. Where too little is new around it, nothing tells what changed.
        let reach = if self.has_holes { 2 } else { 1 };
        self.fresh.around(index, reach).map_or(old, |(mean, deviation)| {
            let reach = deviation * CLAMP_DEVIATIONS;
            old.clamp(mean - reach, mean + reach)
        })
    }
}

/// Places in a picture, in pixels, and how far from the eye.
struct Projected {
    x: [f32; AT_A_TIME],
    y: [f32; AT_A_TIME],
    distance: [f32; AT_A_TIME],
}

impl Default for Projected {
    fn default() -> Self {
        Self { x: [0.0; AT_A_TIME], y: [0.0; AT_A_TIME], distance: [0.0; AT_A_TIME] }
    }
}

/// Mean absolute change of the pixels of `new` whose points were seen in `old` as well, and how many
/// these are: flicker, if nothing but the camera has changed. In units of radiance, each channel
/// compressed to x/(1+x), so that a lamp does not count for more than the walls.
pub fn flicker(old: &Shown, new: &Shown) -> Option<(f64, usize)> {
    let there = View::new(old);
    let lens = new.camera.lens();
    let width = new.picture.width as usize;
    let compressed = |colour: Vec3| {
        let colour = colour.max(Vec3::ZERO);
        colour / (colour + 1.0)
    };
    let (mut sum, mut count) = (0.0, 0);
    for (index, (colour, distance)) in new.picture.pixels.iter().zip(&new.distance).enumerate() {
        let (x, y) = ((index % width) as f32 + 0.5, (index / width) as f32 + 0.5);
        let place = Place::of(&lens, x, y, *distance);
        if let Some((was, _)) = there.at(place) {
            sum += f64::from((compressed(*colour) - compressed(was)).abs().element_sum()) / 3.0;
            count += 1;
        }
    }
    (count > 0).then(|| (sum / count as f64, count))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A wall at z = 0 whose colour is its place.
    fn wall(camera: Camera) -> Shown {
        let lens = camera.lens();
        let (mut distance, mut pixels) = (Vec::new(), Vec::new());
        for y in 0..camera.height {
            for x in 0..camera.width {
                let direction = lens.direction(x as f32 + 0.5, y as f32 + 0.5);
                let t = -camera.origin.z / direction.z;
                let point = camera.origin + direction * t;
                pixels.push(Vec3::new(point.x + 2.0, point.y + 2.0, 1.0));
                distance.push(t);
            }
        }
        let age = vec![1.0; pixels.len()];
        let picture = Picture { width: camera.width, height: camera.height, pixels }.into();
        Shown { camera, picture, distance, age }
    }

    fn camera(x: f32, width: u32, height: u32) -> Camera {
        Camera { origin: Vec3::new(x, 0.0, 3.0), target: Vec3::new(x, 0.0, 0.0), width, height, ..Camera::default() }
    }

    fn unknown(camera: Camera) -> Fresh {
        let len = (camera.width * camera.height) as usize;
        let picture = Picture::black(camera.width, camera.height);
        Fresh { camera, picture, distance: vec![0.0; len], known: vec![false; len] }
    }

    #[test]
    fn a_picture_of_holes_shows_the_last_one_from_the_new_place() {
        for (width, height) in [(60, 40), (90, 60), (31, 20)] {
            let new = camera(0.1, width, height);
            let shown = unknown(new).after(Some(&wall(camera(0.0, 60, 40))), Steady::Off);
            let expected = wall(new);
            let pairs = shown.picture.pixels.iter().zip(&expected.picture.pixels).enumerate();
            // The strip at the right edge was never seen.
            let pairs = pairs.filter(|(i, _)| (*i as u32 % width) * 10 < width * 9);
            let errors = pairs.map(|(_, (a, b))| (*a - *b).abs().max_element());
            // Points land within an old pixel and a half, each 0.055 wide.
            let worst = errors.fold(0.0, f32::max);
            assert!(worst < 0.12, "{width}x{height}: {worst}");
        }
    }

    #[test]
    fn no_hole_stays_black() {
        let mut fresh = unknown(camera(0.0, 33, 17));
        fresh.known[5] = true;
        fresh.picture.pixels[5] = Vec3::splat(0.5);
        let shown = fresh.after(None, Steady::Off);
        assert!(shown.picture.pixels.iter().all(|pixel| *pixel == Vec3::splat(0.5)));
    }

    #[test]
    fn one_light_set_of_each_block_is_a_whole_picture_with_its_edges() {
        // A near wall before a far one, lit by one set in nine.
        let camera = camera(0.0, 60, 40);
        let truth = |x: u32| if x < 31 { (Vec3::splat(1.0), 2.0) } else { (Vec3::new(0.0, 4.0, 0.0), 3.0) };
        let mut fresh = unknown(camera);
        for (index, known) in fresh.known.iter_mut().enumerate() {
            let (x, y) = (index as u32 % 60, index as u32 / 60);
            (*known, (fresh.picture.pixels[index], fresh.distance[index])) = (x % 3 == 1 && y % 3 == 2, truth(x));
        }
        let filled = fresh.clone().between([3, 3]);
        assert!(filled.known.iter().all(|known| *known));
        for (index, colour) in filled.picture.pixels.iter().enumerate() {
            let x = index as u32 % 60;
            assert!(*colour == truth(x).0 || (30..33).contains(&x), "{colour} at {x}");
            assert!(*colour == truth(0).0 || *colour == truth(59).0, "surfaces do not mix: {colour} at {x}");
        }
        // Nothing is known too far away.
        fresh.known.iter_mut().enumerate().for_each(|(index, known)| *known &= index % 60 < 30);
        assert!(!fresh.between([3, 3]).known[59]);
    }

    #[test]
    fn a_small_picture_of_the_same_view_is_enlarged_smoothly() {
        let small = wall(camera(0.0, 60, 40));
        let shown = unknown(camera(0.0, 240, 160)).after(Some(&small), Steady::Off);
        let expected = wall(camera(0.0, 240, 160));
        for (index, (a, b)) in shown.picture.pixels.iter().zip(&expected.picture.pixels).enumerate() {
            let (x, y) = (index % 240, index / 240);
            // At the border there is nothing to go on with.
            let most = if (2..238).contains(&x) && (2..158).contains(&y) { 1e-3 } else { 0.05 };
            assert!((*a - *b).abs().max_element() < most, "{a} {b} at {x} {y}");
        }
    }

    #[test]
    fn a_steady_picture_is_less_noisy_and_not_dragged_along() {
        let noise = |i: usize, frame: u32| {
            ((i as u32).wrapping_mul(0x9e37_79b9).wrapping_add(frame.wrapping_mul(0x85eb_ca6b)) >> 8) as f32
                / 2f32.powi(24)
        };
        let mut last: Option<Shown> = None;
        let mut changes = Vec::new();
        for frame in 0..12 {
            let clean = wall(camera(0.01 * frame as f32, 60, 40));
            let pixels = clean.picture.pixels.iter().enumerate();
            let pixels = pixels.map(|(i, _)| Vec3::splat(0.5 + 0.2 * noise(i, frame * 977))).collect();
            let picture = Picture { pixels, ..Picture::clone(&clean.picture) };
            let fresh = Fresh { camera: clean.camera, picture, distance: clean.distance, known: vec![true; 2400] };
            let noisy = fresh.clone().after(None, Steady::Off);
            let shown = fresh.after(last.as_ref(), Steady::Clamped);
            if let Some(last) = &last {
                changes.push((flicker(last, &shown).unwrap().0, flicker(last, &noisy).unwrap().0));
            }
            last = Some(shown);
        }
        let (steady, noisy) = *changes.last().unwrap();
        assert!(steady < 0.5 * noisy, "{steady} against {noisy}");

        // A light goes on: the old colour is gone at once, since none of the neighbours has it.
        let last = last.unwrap();
        let bright = Picture { pixels: vec![Vec3::splat(5.0); 2400], ..Picture::clone(&last.picture) };
        let fresh =
            Fresh { camera: last.camera, picture: bright, distance: last.distance.clone(), known: vec![true; 2400] };
        assert!(
            fresh.after(Some(&last), Steady::Clamped).picture.pixels.iter().all(|pixel| *pixel == Vec3::splat(5.0))
        );
    }

    /// Each picture is wrong in its own way, and right on average: light sets that change.
    #[test]
    fn a_mean_over_pictures_gets_right_and_a_clamped_one_does_not() {
        let (camera, truth) = (camera(0.0, 32, 24), 5.0);
        let noisy = |number: u32| {
            // All of a picture is off by the same: neighbours tell nothing.
            let error = [3.0, -2.5, 1.5, -2.0][number as usize % 4];
            let picture = Picture::from_fn(32, 24, |_, _| Vec3::splat(truth + error));
            Fresh { camera, picture, distance: vec![3.0; 32 * 24], known: vec![true; 32 * 24] }
        };
        let error_by = |steady: Steady| {
            let mut last: Option<Shown> = None;
            for number in 0..32 {
                last = Some(noisy(number).after(last.as_ref(), steady));
            }
            let shown = last.unwrap().picture;
            shown.pixels.iter().map(|pixel| (pixel.x - truth).abs()).fold(0.0, f32::max)
        };
        assert!(error_by(Steady::Mean) < 0.3, "{}", error_by(Steady::Mean));
        assert!(error_by(Steady::Clamped) > 1.5, "{}", error_by(Steady::Clamped));
    }

    #[test]
    fn a_still_camera_and_a_still_scene_do_not_flicker() {
        let shown = wall(camera(0.0, 40, 30));
        let (change, count) = flicker(&shown, &shown).unwrap();
        assert!(change < 1e-6 && count == 1200, "{change} of {count}");
    }
}
