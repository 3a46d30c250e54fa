//! The environment as a light: radiance by direction, and directions by radiance.

use std::f32::consts::PI;

use glam::{Vec2, Vec3};
use scenes::{Environment, Rgb, Scene};

use crate::texture;
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
    Image { texture: u32, scale: Rgb, rows: Vec<f32>, columns: Vec<f32>, width: usize, height: usize },
}

/// Share of samples that go anywhere: bilinear interpolation spreads light a little beyond the
/// texels that the tables know.
const UNIFORM_SHARE: f32 = 0.1;

impl Sky {
    /// Nothing for a black environment.
    pub fn new(scene: &Scene) -> Option<Self> {
        match scene.environment {
            Environment::Black => None,
            Environment::Constant(radiance) => (radiance != Vec3::ZERO)
                .then(|| Self { kind: Kind::Constant(radiance), power: mean(radiance) * 4.0 * PI }),
            Environment::Image { texture, scale } => Self::image(scene, texture, scale),
        }
    }

    fn image(scene: &Scene, texture: u32, scale: Rgb) -> Option<Self> {
        let image = &scene.textures[texture as usize];
        let (width, height) = (image.width as usize, image.height as usize);
        let mut rows = Vec::with_capacity(height);
        let mut columns = Vec::with_capacity(width * height);
        let mut total = 0.0_f64;
        for y in 0..height {
            let v = 1.0 - (y as f32 + 0.5) / height as f32;
            let sin = libm::sinf(PI * v);
            let mut row = 0.0_f64;
            for x in 0..width {
                let uv = Vec2::new((x as f32 + 0.5) / width as f32, v);
                row += f64::from(mean(texture::sky_colour(image, uv) * scale));
                columns.push(row as f32);
            }
            for sum in &mut columns[y * width..] {
                *sum = if row > 0.0 { (f64::from(*sum) / row) as f32 } else { 1.0 };
            }
            total += row * f64::from(sin);
            rows.push(total as f32);
        }
        if total <= 0.0 {
            return None;
        }
        for sum in &mut rows {
            *sum = (f64::from(*sum) / total) as f32;
        }
        let texel = 2.0 * PI * PI / (width * height) as f32;
        Some(Self { kind: Kind::Image { texture, scale, rows, columns, width, height }, power: total as f32 * texel })
    }

    /// Bytes that the tables take.
    pub fn bytes(&self) -> usize {
        match &self.kind {
            Kind::Constant(_) => 0,
            Kind::Image { rows, columns, .. } => size_of_val(&rows[..]) + size_of_val(&columns[..]),
        }
    }

    /// ∫ L dω, mean of the channels.
    pub fn power(&self) -> f32 {
        self.power
    }

    /// Radiance that arrives from a unit direction.
    pub fn radiance(&self, scene: &Scene, towards: Vec3) -> Rgb {
        match &self.kind {
            Kind::Constant(radiance) => *radiance,
            Kind::Image { texture, scale, .. } => {
                texture::sky_colour(&scene.textures[*texture as usize], lat_long(towards)) * *scale
            }
        }
    }

    /// A direction towards the sky, and its density a steradian.
    pub fn sample(&self, u: [f32; 3]) -> (Vec3, f32) {
        match &self.kind {
            Kind::Constant(_) => (warp::sphere([u[0], u[1]]), warp::SPHERE_DENSITY),
            Kind::Image { rows, columns, width, height, .. } => {
                if u[2] < UNIFORM_SHARE {
                    let direction = warp::sphere([u[0], u[1]]);
                    return (direction, self.density(direction));
                }
                let (row, along) = invert(rows, u[0]);
                let (column, across) = invert(&columns[row * width..(row + 1) * width], u[1]);
                let uv =
                    Vec2::new((column as f32 + across) / *width as f32, 1.0 - (row as f32 + along) / *height as f32);
                let (sin_lat, cos_lat) = libm::sincosf(PI * (uv.y - 0.5));
                let (sin, cos) = warp::turn(uv.x - 0.5);
                let direction = Vec3::new(cos_lat * sin, sin_lat, -cos_lat * cos);
                (direction, self.density(direction))
            }
        }
    }

    /// Density of [`Self::sample`].
    pub fn density(&self, direction: Vec3) -> f32 {
        match &self.kind {
            Kind::Constant(_) => warp::SPHERE_DENSITY,
            Kind::Image { rows, columns, width, height, .. } => {
                let uv = lat_long(direction);
                let row = (((1.0 - uv.y) * *height as f32) as usize).min(height - 1);
                let column = ((uv.x * *width as f32) as usize).min(width - 1);
                let step = |table: &[f32], i: usize| table[i] - if i > 0 { table[i - 1] } else { 0.0 };
                let share = step(rows, row) * step(&columns[row * width..(row + 1) * width], column);
                let sin = (1.0 - direction.y * direction.y).max(1e-12).sqrt();
                let image = share * (width * height) as f32 / (2.0 * PI * PI * sin);
                UNIFORM_SHARE * warp::SPHERE_DENSITY + (1.0 - UNIFORM_SHARE) * image
            }
        }
    }
}

/// Texture coordinates of a direction: `u = ½ + atan2(x, −z)/2π`, `v = 1` straight up.
fn lat_long(direction: Vec3) -> Vec2 {
    let u = 0.5 + libm::atan2f(direction.x, -direction.z) / (2.0 * PI);
    let v = 0.5 + libm::asinf(direction.y.clamp(-1.0, 1.0)) / PI;
    Vec2::new(u, v)
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
    use scenes::{Pixels, Texture, Wrap};

    fn gradient() -> Scene {
        let texels = (0..16 * 8).map(|i| [0.1 + (i % 16) as f32, 0.5 * (i / 16) as f32, 0.3]).collect();
        Scene {
            textures: vec![Texture {
                name: "sky".into(),
                width: 16,
                height: 8,
                pixels: Pixels::Float(texels),
                wrap: Wrap::Repeat,
            }],
            environment: Environment::Image { texture: 0, scale: Vec3::ONE },
            ..Scene::default()
        }
    }

    #[test]
    fn density_integrates_to_one_and_samples_follow_it() {
        let sky = Sky::new(&gradient()).unwrap();
        const CELLS: usize = 8;
        let cell = |w: Vec3| {
            let uv = lat_long(w);
            let z = ((w.y + 1.0) / 2.0 * CELLS as f32) as usize;
            z.min(CELLS - 1) * CELLS + ((uv.x * CELLS as f32) as usize).min(CELLS - 1)
        };
        let mut share = [0.0_f64; CELLS * CELLS];
        const FINE: usize = 1000;
        for i in 0..FINE * FINE {
            let w = warp::sphere([((i % FINE) as f32 + 0.5) / FINE as f32, ((i / FINE) as f32 + 0.5) / FINE as f32]);
            share[cell(w)] += f64::from(sky.density(w)) * f64::from(4.0 * PI) / (FINE * FINE) as f64;
        }
        assert!((share.iter().sum::<f64>() - 1.0).abs() < 3e-3, "{}", share.iter().sum::<f64>());
        let n = 200_000_u32;
        let mut counts = [0.0_f64; CELLS * CELLS];
        for i in 0..n {
            let u = [0, 1, 2].map(|d| (crate::sample::mix(3 * i + d) >> 8) as f32 / 16_777_216.0);
            let (w, density) = sky.sample(u);
            assert!((density / sky.density(w) - 1.0).abs() < 1e-4);
            counts[cell(w)] += 1.0;
        }
        let x2: f64 = counts.iter().zip(share).map(|(c, s)| (c - s * f64::from(n)).powi(2) / (s * f64::from(n))).sum();
        assert!(x2 < 150.0, "χ² = {x2}");
    }
}
