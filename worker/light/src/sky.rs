//! The environment as a light: radiance by direction, and directions by radiance.
//!
//! An image's radiance is bilinear between the middles of its texels, so what lies between four of these is a **cell**:
//! one more row of them than of texels, as latitude ends half a texel beyond the middles of the first and last row, and
//! as many columns, as longitude goes round. A cell is chosen by its brightness times its solid angle; within it,
//! directions are drawn by the bilinear function of its corners' brightness over longitude and the *sine* of latitude.
//! So their density is positive wherever the radiance is, and nowhere less than half of proportional to it: no sample
//! outshines the others by much, however small and bright a sun is.

use std::f64::consts::PI;

use glam::Vec3;
use scenes::{Environment, Rgb, Scene, Texture, texture};

use crate::warp;

/// An environment that shines, with its sampling tables.
#[derive(Clone, Debug)]
pub struct Sky {
    kind: Kind,
    /// ∫ radiance dω, luminance-like (mean of the channels).
    power: f32,
}

#[derive(Clone, Debug)]
enum Kind {
    Constant(Rgb),
    Image(Image),
}

#[derive(Clone, Debug)]
struct Image {
    texture: u32,
    scale: Rgb,
    turn: f32,
    cells: Cells,
    /// Cumulative probabilities of the rows of cells.
    rows: Vec<f32>,
    /// The same of the cells of each row, row after row.
    columns: Vec<f32>,
}

/// How a sky is cut into cells.
#[derive(Clone, Copy, Debug)]
struct Cells {
    /// Texels, and cells, to a row.
    width: usize,
    /// Rows of texels; those of cells are one more.
    height: usize,
}

/// A cell, and where in it: 0..1 from west to east and from north to south.
#[derive(Clone, Copy, Debug)]
struct Place {
    row: usize,
    column: usize,
    across: f32,
    /// In units of the sine of latitude.
    along: f32,
}

/// Share of samples that go anywhere: for rooms that see little of what is bright.
const UNIFORM_SHARE: f32 = 0.1;

impl Sky {
    /// `None` for a black environment.
    pub fn new(scene: &Scene) -> Option<Self> {
        match scene.environment {
            Environment::Black => None,
            Environment::Constant(radiance) => (radiance != Vec3::ZERO)
                .then(|| Self { kind: Kind::Constant(radiance), power: mean(radiance) * (4.0 * PI) as f32 }),
            Environment::Image { texture, scale, turn } => {
                let (image, power) = Image::new(scene, texture, scale, turn)?;
                Some(Self { kind: Kind::Image(image), power })
            }
        }
    }

    /// Bytes that the tables take.
    pub fn bytes(&self) -> usize {
        match &self.kind {
            Kind::Constant(_) => 0,
            Kind::Image(image) => size_of_val(&image.rows[..]) + size_of_val(&image.columns[..]),
        }
    }

    /// ∫ L dω, mean of the channels; of an image about so much.
    pub fn power(&self) -> f32 {
        self.power
    }

    /// Radiance that arrives from a unit direction.
    pub fn radiance(&self, scene: &Scene, towards: Vec3) -> Rgb {
        match &self.kind {
            Kind::Constant(radiance) => *radiance,
            Kind::Image(image) => {
                texture::sky_colour(image.texture(scene), texture::sky_uv(towards, image.turn)) * image.scale
            }
        }
    }

    /// A direction towards the sky, and its density a steradian.
    pub fn sample(&self, scene: &Scene, u: [f32; 3]) -> (Vec3, f32) {
        let direction = match &self.kind {
            Kind::Image(image) if u[2] >= UNIFORM_SHARE => image.sample(scene, [u[0], u[1]]),
            _ => warp::sphere([u[0], u[1]]),
        };
        (direction, self.density(scene, direction))
    }

    /// Density of [`Self::sample`].
    pub fn density(&self, scene: &Scene, direction: Vec3) -> f32 {
        match &self.kind {
            Kind::Constant(_) => warp::SPHERE_DENSITY,
            Kind::Image(image) => {
                UNIFORM_SHARE * warp::SPHERE_DENSITY + (1.0 - UNIFORM_SHARE) * image.density(scene, direction)
            }
        }
    }
}

impl Image {
    /// And its power.
    fn new(scene: &Scene, texture: u32, scale: Rgb, turn: f32) -> Option<(Self, f32)> {
        let image = &scene.textures[texture as usize];
        let cells = Cells { width: image.width as usize, height: image.height as usize };
        let mut rows = Vec::with_capacity(cells.height + 1);
        let mut columns = Vec::with_capacity(cells.width * (cells.height + 1));
        let mut total = 0.0_f64;
        for row in 0..=cells.height {
            let first = columns.len();
            let mut sum = 0.0_f64;
            for column in 0..cells.width {
                let corners = cells.corners(row, column).map(|texel| mean(texture::texel(image, texel) * scale));
                sum += corners.iter().map(|corner| f64::from(*corner)).sum::<f64>() / 4.0;
                columns.push(sum as f32);
            }
            for part in &mut columns[first..] {
                *part = if sum > 0.0 { (f64::from(*part) / sum) as f32 } else { 1.0 };
            }
            total += sum * cells.solid_angle(row);
            rows.push(total);
        }
        let rows = rows.iter().map(|part| (part / total) as f32).collect();
        let power = total as f32;
        (total > 0.0 && power.is_finite()).then_some((Self { texture, scale, turn, cells, rows, columns }, power))
    }

    fn sample(&self, scene: &Scene, u: [f32; 2]) -> Vec3 {
        let (row, along) = invert(&self.rows, u[0]);
        let (column, across) = invert(self.row(row), u[1]);
        let [across, along] = warp::bilinear(self.corners(scene, row, column), [across, along]);
        self.cells.direction(Place { row, column, across, along }, self.turn)
    }

    /// Density of [`Self::sample`], sr⁻¹.
    fn density(&self, scene: &Scene, direction: Vec3) -> f32 {
        let Place { row, column, across, along } = self.cells.place(direction, self.turn);
        let step = |table: &[f32], i: usize| table[i] - if i > 0 { table[i - 1] } else { 0.0 };
        let share = step(&self.rows, row) * step(self.row(row), column);
        let within = warp::bilinear_density(self.corners(scene, row, column), [across, along]);
        share * within / self.cells.solid_angle(row) as f32
    }

    /// Cumulative probabilities within a row of cells.
    fn row(&self, row: usize) -> &[f32] {
        &self.columns[row * self.cells.width..][..self.cells.width]
    }

    /// Brightness at the corners of a cell.
    fn corners(&self, scene: &Scene, row: usize, column: usize) -> [f32; 4] {
        let image = self.texture(scene);
        self.cells.corners(row, column).map(|texel| mean(texture::texel(image, texel) * self.scale))
    }

    fn texture<'s>(&self, scene: &'s Scene) -> &'s Texture {
        &scene.textures[self.texture as usize]
    }
}

impl Cells {
    /// The texels at the corners of a cell: north west, north east, south west, south east.
    fn corners(self, row: usize, column: usize) -> [usize; 4] {
        let (west, east) = ((column + self.width - 1) % self.width, column);
        let (north, south) = (row.saturating_sub(1), row.min(self.height - 1));
        [(north, west), (north, east), (south, west), (south, east)].map(|(y, x)| y * self.width + x)
    }

    /// Sine of the latitude at which a row of cells begins; row `height + 1` is where the last one ends.
    fn sine(self, row: usize) -> f64 {
        match row {
            0 => 1.0,
            row if row > self.height => -1.0,
            row => libm::cos((row as f64 - 0.5) / self.height as f64 * PI),
        }
    }

    /// Of each cell of a row, sr.
    fn solid_angle(self, row: usize) -> f64 {
        (self.sine(row) - self.sine(row + 1)) * (2.0 * PI) / self.width as f64
    }

    fn direction(self, place: Place, turn: f32) -> Vec3 {
        let (begin, end) = (self.sine(place.row), self.sine(place.row + 1));
        let sine = begin + (end - begin) * f64::from(place.along);
        // Near a pole the sine is 1 in single precision, long before its cosine is 0.
        let cosine = ((1.0 - sine) * (1.0 + sine)).max(0.0).sqrt() as f32;
        let u = (place.column as f32 - 0.5 + place.across) / self.width as f32;
        let (east, north) = warp::turn(u - 0.5 + turn);
        Vec3::new(cosine * east, sine as f32, -cosine * north)
    }

    fn place(self, direction: Vec3, turn: f32) -> Place {
        let uv = texture::sky_uv(direction, turn);
        // As in [`texture::sky_colour`]: what is 0 there is 0 here, to the bit.
        let x = (uv.x - uv.x.floor()) * self.width as f32 - 0.5;
        let y = (1.0 - uv.y) * self.height as f32 - 0.5;
        let (west, north) = (x.floor(), y.floor());
        let row = ((north + 1.0) as usize).min(self.height);
        let (begin, end) = (self.sine(row), self.sine(row + 1));
        let sine = libm::cos((f64::from(y) + 0.5) / self.height as f64 * PI);
        let along = ((begin - sine) / (begin - end)).clamp(0.0, 1.0) as f32;
        Place { row, column: (west + 1.0) as usize % self.width, across: x - west, along }
    }
}

/// The bin of a cumulative table that `u` falls into, and where in it (0..1).
fn invert(table: &[f32], u: f32) -> (usize, f32) {
    let bin = table.partition_point(|sum| *sum <= u).min(table.len() - 1);
    let low = if bin > 0 { table[bin - 1] } else { 0.0 };
    let width = table[bin] - low;
    (bin, if width > 0.0 { ((u - low) / width).clamp(0.0, 1.0) } else { 0.5 })
}

fn mean(rgb: Rgb) -> f32 {
    (rgb.x + rgb.y + rgb.z) / 3.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use scenes::{LookUp, Pixels};

    fn sky_of(width: u32, texels: Vec<[f32; 3]>) -> Scene {
        let height = texels.len() as u32 / width;
        let pixels = Pixels::Float(texels);
        Scene {
            textures: vec![Texture { name: "sky".into(), width, height, pixels, look_up: LookUp::REPEAT }.into()],
            environment: Environment::Image { texture: 0, scale: Vec3::ONE, turn: 0.0 },
            ..Scene::default()
        }
    }

    fn gradient() -> Scene {
        sky_of(16, (0..16 * 8).map(|i| [0.1 + (i % 16) as f32, 0.5 * (i / 16) as f32, 0.3]).collect())
    }

    /// A dim sky with a sun of one texel.
    fn sun(width: u32, height: u32, at: u32) -> Scene {
        let texel = |i| if i == at { [60_000.0, 56_000.0, 50_000.0] } else { [0.3, 0.4, 0.6] };
        sky_of(width, (0..width * height).map(texel).collect())
    }

    fn random(i: u32) -> [f32; 3] {
        [0, 1, 2].map(|d| (crate::sample::mix(3 * i + d) >> 8) as f32 / 16_777_216.0)
    }

    fn turned(scene: Scene, by: f32) -> Scene {
        Scene { environment: Environment::Image { texture: 0, scale: Vec3::ONE, turn: by }, ..scene }
    }

    /// Where its middle is, that is where it looked along −z before: a quarter turn leads to +x.
    #[test]
    fn a_sky_that_is_turned_is_seen_where_it_is_turned_to() {
        let scene = sun(64, 32, 16 * 64 + 32);
        let sky = |turn: f32| turned(scene.clone(), turn);
        let seen = |scene: &Scene, towards: Vec3| Sky::new(scene).unwrap().radiance(scene, towards.normalize()).x;
        let at = Vec3::new(0.05, -0.05, -1.0);
        assert!(seen(&sky(0.0), at) > 1e4);
        assert!(seen(&sky(0.25), Vec3::new(1.0, -0.05, 0.05)) > 1e4 && seen(&sky(0.25), at) < 1.0);
        assert!(seen(&sky(-0.25), Vec3::new(-1.0, -0.05, -0.05)) > 1e4);
    }

    #[test]
    fn density_integrates_to_one_and_samples_follow_it() {
        let suns = [sun(3, 2, 1), sun(2, 1, 0), sun(1, 1, 0), sun(7, 5, 0), sun(6, 4, 23)];
        let around = [turned(gradient(), 0.3), turned(sun(7, 5, 0), -0.9)];
        for scene in suns.into_iter().chain([gradient()]).chain(around) {
            let sky = Sky::new(&scene).unwrap();
            const CELLS: usize = 8;
            let cell = |w: Vec3| {
                let uv = texture::sky_uv(w, 0.0);
                let z = ((w.y + 1.0) / 2.0 * CELLS as f32) as usize;
                z.min(CELLS - 1) * CELLS + ((uv.x * CELLS as f32) as usize).min(CELLS - 1)
            };
            let mut share = [0.0_f64; CELLS * CELLS];
            const FINE: usize = 1000;
            for i in 0..FINE * FINE {
                let w =
                    warp::sphere([((i % FINE) as f32 + 0.5) / FINE as f32, ((i / FINE) as f32 + 0.5) / FINE as f32]);
                share[cell(w)] += f64::from(sky.density(&scene, w)) * (4.0 * PI) / (FINE * FINE) as f64;
            }
            assert!((share.iter().sum::<f64>() - 1.0).abs() < 3e-3, "{}", share.iter().sum::<f64>());
            let n = 200_000_u32;
            let mut counts = [0.0_f64; CELLS * CELLS];
            for i in 0..n {
                let (w, density) = sky.sample(&scene, random(i));
                assert_eq!(density, sky.density(&scene, w));
                counts[cell(w)] += 1.0;
            }
            let x2: f64 =
                counts.iter().zip(share).map(|(c, s)| (c - s * f64::from(n)).powi(2) / (s * f64::from(n))).sum();
            assert!(x2 < 150.0, "χ² = {x2}");
        }
    }

    /// Whatever its size and wherever its sun stands: on the seam, at a pole, between texels of a large picture. The
    /// mean is ∫ L dω of what interpolation returns, and no sample is far from it.
    #[test]
    fn no_sample_outshines_the_others() {
        let sizes = [(1, 1), (2, 1), (1, 2), (3, 2), (5, 3), (16, 8), (64, 32), (512, 256), (16, 4096)];
        for (width, height) in sizes {
            let (last, middle) = (width * (height - 1), height / 2 * width);
            for at in [0, width / 2, last, last + width / 3, middle, middle + width - 1, middle + width / 3] {
                let scene = sun(width, height, at);
                let sky = Sky::new(&scene).unwrap();
                let exact = integral(&scene);
                let count = 20_000;
                let mut sum = 0.0;
                for i in 0..count {
                    let (w, density) = sky.sample(&scene, random(i));
                    let value = f64::from(mean(sky.radiance(&scene, w)) / density) / exact;
                    assert!(value < 2.4, "{width}x{height}, sun at {at}: {value} of the whole towards {w}");
                    sum += value;
                }
                let found = sum / f64::from(count);
                assert!((found - 1.0).abs() < 0.015, "{width}x{height}, sun at {at}: {found} of the whole");
            }
        }
    }

    /// ∫ L dω, mean of the channels: in each cell by eight strips of latitude, as longitude's mean is that of the corners.
    fn integral(scene: &Scene) -> f64 {
        let image = &scene.textures[0];
        let cells = Cells { width: image.width as usize, height: image.height as usize };
        let mut total = 0.0;
        for (row, column) in (0..=cells.height).flat_map(|row| (0..cells.width).map(move |column| (row, column))) {
            let [a, b, c, d] = cells.corners(row, column).map(|texel| f64::from(mean(texture::texel(image, texel))));
            let (north, south) = ((a + b) / 2.0, (c + d) / 2.0);
            for strip in 0..8 {
                let at = |edge: f64| (row as f64 - 0.5 + edge / 8.0).clamp(0.0, cells.height as f64);
                let cosine = |edge: f64| libm::cos(at(edge) / cells.height as f64 * PI);
                let solid_angle =
                    (cosine(strip.into()) - cosine(f64::from(strip) + 1.0)) * 2.0 * PI / cells.width as f64;
                let along = (f64::from(strip) + 0.5) / 8.0;
                total += (north + (south - north) * along) * solid_angle;
            }
        }
        total
    }
}
