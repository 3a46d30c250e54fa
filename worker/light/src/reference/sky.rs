//! The environment as seen by the path tracer: texels are chosen by an alias table, directions evenly
//! in them.

use std::f32::consts::PI;

use glam::{Vec2, Vec3};
use scenes::{Environment, Rgb, Scene, texture};

use super::emitters::{Alias, brightness};
use super::philox::Stream;

/// Tables of the environment.
pub struct Sky {
    /// `None` where it is the same everywhere.
    texels: Option<Texels>,
    /// Whole turns.
    turn: f32,
    /// ∫ radiance dω, mean of the channels.
    integral: f64,
}

struct Texels {
    alias: Alias,
    /// How likely each is.
    share: Vec<f64>,
    width: usize,
    height: usize,
}

impl Sky {
    /// Walks the image, if there is one.
    pub fn new(scene: &Scene) -> Self {
        match scene.environment {
            Environment::Black => Self { texels: None, turn: 0.0, integral: 0.0 },
            Environment::Constant(radiance) => {
                Self { texels: None, turn: 0.0, integral: brightness(radiance) * f64::from(4.0 * PI) }
            }
            Environment::Image { texture, turn, .. } => {
                let image = &scene.textures[texture as usize];
                Self::of_image(scene, image.width as usize, image.height as usize, turn)
            }
        }
    }

    fn of_image(scene: &Scene, width: usize, height: usize, turn: f32) -> Self {
        let at = |x: f32, y: f32| brightness(radiance(scene, Vec2::new(x / width as f32, 1.0 - y / height as f32)));
        let mut share = Vec::with_capacity(width * height);
        for row in 0..height {
            // ∫ dω over a texel of this row
            let edge = |y: usize| libm::cos(std::f64::consts::PI * y as f64 / height as f64);
            let solid_angle = (edge(row) - edge(row + 1)) * std::f64::consts::TAU / width as f64;
            for column in 0..width {
                // Interpolation is linear between texel centres, so where it is not 0 in a texel, it is not
                // 0 at one of nine places.
                let places = [0.0_f32, 0.5, 1.0];
                let values = places.map(|y| places.map(|x| at(column as f32 + x, row as f32 + y)));
                share.push(values.iter().flatten().sum::<f64>() / 9.0 * solid_angle);
            }
        }
        let integral: f64 = share.iter().sum();
        share.iter_mut().for_each(|share| *share /= integral);
        Self { texels: Some(Texels { alias: Alias::new(&share), share, width, height }), turn, integral }
    }

    /// ∫ radiance dω, mean of the channels; of an image about so much.
    pub fn integral(&self) -> f64 {
        self.integral
    }

    /// Radiance from a unit direction.
    pub fn radiance(&self, scene: &Scene, direction: Vec3) -> Rgb {
        match scene.environment {
            Environment::Black => Vec3::ZERO,
            Environment::Constant(radiance) => radiance,
            Environment::Image { turn, .. } => radiance(scene, place(direction, turn)),
        }
    }

    /// A direction, and its density.
    pub fn sample(&self, stream: &mut Stream) -> (Vec3, f32) {
        let (sine, longitude) = match &self.texels {
            None => {
                let sine = 1.0 - 2.0 * f64::from(stream.unit());
                (sine, 2.0 * PI * stream.unit())
            }
            Some(texels) => {
                let chosen = texels.alias.choose(stream).unwrap_or(0);
                let u = stream.pair();
                let x = ((chosen % texels.width) as f32 + u[0]) / texels.width as f32;
                // Even in the sine of the latitude.
                let row = chosen / texels.width;
                let edge = |y: usize| libm::cos(std::f64::consts::PI * y as f64 / texels.height as f64);
                (edge(row) + (edge(row + 1) - edge(row)) * f64::from(u[1]), (x - 0.5 + self.turn) * 2.0 * PI)
            }
        };
        let cosine = ((1.0 - sine) * (1.0 + sine)).max(0.0).sqrt() as f32;
        let (east, north) = libm::sincosf(longitude);
        let direction = Vec3::new(cosine * east, sine as f32, -cosine * north);
        (direction, self.density(direction))
    }

    /// Density of [`Self::sample`], sr⁻¹.
    pub fn density(&self, direction: Vec3) -> f32 {
        let Some(texels) = &self.texels else { return 0.25 / PI };
        let uv = place(direction, self.turn);
        let cell = |s: f32, count: usize| ((s * count as f32) as usize).min(count - 1);
        let across = if (0.0..=1.0).contains(&uv.x) { uv.x } else { uv.x - uv.x.floor() };
        let (column, row) = (cell(across, texels.width), cell(1.0 - uv.y, texels.height));
        let edge = |y: usize| libm::cos(std::f64::consts::PI * y as f64 / texels.height as f64);
        let solid_angle = (edge(row) - edge(row + 1)) * std::f64::consts::TAU / texels.width as f64;
        (texels.share[row * texels.width + column] / solid_angle) as f32
    }
}

/// `u = ½ + atan2(x, −z)/2π − turn`, `v = 1` straight up: the scene model's convention.
fn place(direction: Vec3, turn: f32) -> Vec2 {
    let u = 0.5 + libm::atan2f(direction.x, -direction.z) / (2.0 * PI) - turn;
    // The arc tangent keeps its digits at the poles.
    let horizontal = (direction.x * direction.x + direction.z * direction.z).sqrt();
    Vec2::new(u, 0.5 + libm::atan2f(direction.y, horizontal) / PI)
}

fn radiance(scene: &Scene, uv: Vec2) -> Rgb {
    match scene.environment {
        Environment::Image { texture, scale, .. } => texture::sky_colour(&scene.textures[texture as usize], uv) * scale,
        Environment::Constant(radiance) => radiance,
        Environment::Black => Vec3::ZERO,
    }
}
