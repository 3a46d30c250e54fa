//! Photometric solids: how strongly a luminaire shines in each direction, apart from any file. [`crate::read::photometry`] makes
//! them of bytes that somebody sends, [`crate::Change::Solid`] brings them into a scene.

use std::f64::consts::PI;

use serde::{Deserialize, Serialize};

use crate::{LookUp, Pixels, Texture};

/// Intensities over an even grid of angles, as shares of the largest: what [`crate::Light::Luminaire`] says of its texture.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Solid {
    /// For people: the file that it is from.
    pub name: String,
    /// Planes, evenly from 0 to less than 360°; one, if all are alike.
    pub planes: u32,
    /// A row for each angle γ, evenly from 0 to 180°: 0..=1.
    pub relative: Vec<f32>,
}

/// Longest name, bytes.
pub const NAME_MAX: usize = 255;
/// Most planes, and most rows: half a degree either way.
pub const PLANES_MAX: u32 = 720;
/// As above.
pub const ROWS_MAX: usize = 361;

impl Solid {
    /// Of a texture that a lamp has; `None` if it is none of radiance.
    pub fn of(texture: &Texture) -> Option<Self> {
        let Pixels::Float(texels) = &texture.pixels else { return None };
        let relative = texels.iter().map(|texel| texel[0]).collect();
        Some(Self { name: texture.name.clone(), planes: texture.width, relative })
    }

    /// As a scene keeps it.
    pub fn texture(&self) -> Texture {
        let (width, height) = (self.planes, (self.relative.len() / self.planes.max(1) as usize) as u32);
        let pixels = Pixels::Float(self.relative.iter().map(|share| [*share; 3]).collect());
        Texture { name: self.name.clone(), width, height, pixels, look_up: LookUp::CLAMP }
    }

    /// Whether it is one.
    ///
    /// # Errors
    /// In words, why not.
    pub fn check(&self) -> Result<(), String> {
        let demand = |ok: bool, what: &str| if ok { Ok(()) } else { Err(what.to_owned()) };
        let is_shown = self.name.len() <= NAME_MAX && !self.name.chars().any(char::is_control);
        demand(is_shown, "its name is too long or cannot be shown")?;
        demand((1..=PLANES_MAX).contains(&self.planes), "it has no planes, or too many")?;
        let (planes, values) = (self.planes as usize, self.relative.len());
        let is_grid = values.is_multiple_of(planes) && (2..=ROWS_MAX).contains(&(values / planes));
        demand(is_grid, "its intensities are no grid of angles")?;
        demand(self.relative.iter().all(|share| (0.0..=1.0).contains(share)), "an intensity is not within 0..1")
    }

    /// Bytes of its intensities.
    pub fn bytes(&self) -> usize {
        size_of_val(&self.relative[..])
    }
}

/// The solid angle, sr, that a luminaire of this texture would fill with its largest intensity to send as much light as it does:
/// its lumens over its largest candela. The integral in closed form of what is linear in both angles.
pub fn solid_angle(texture: &Texture) -> f64 {
    let Pixels::Float(texels) = &texture.pixels else { return 0.0 };
    let (planes, rows) = (texture.width as usize, texture.height as usize);
    let mean = |row: usize| {
        let row = &texels[row * planes..][..planes];
        row.iter().map(|texel| f64::from(texel[0])).sum::<f64>() / planes as f64
    };
    let step = PI / (rows - 1).max(1) as f64;
    let mut sum = 0.0;
    for row in 0..rows - 1 {
        let (from, to) = (step * row as f64, step * (row + 1) as f64);
        // ∫ sin, and ∫ s sin of the share s of the way from one angle to the next.
        let whole = libm::cos(from) - libm::cos(to);
        let part = (libm::sin(to) - libm::sin(from)) / step - libm::cos(to);
        sum += mean(row) * (whole - part) + mean(row + 1) * part;
    }
    2.0 * PI * sum
}

#[cfg(test)]
mod tests {
    use super::*;

    fn solid(planes: u32, rows: usize, share: f32) -> Solid {
        Solid { name: "lamp.ies".into(), planes, relative: vec![share; planes as usize * rows] }
    }

    #[test]
    fn it_is_what_its_texture_was_and_half_a_ball_fills_half_of_all_directions() {
        let ball = solid(4, 19, 1.0);
        assert_eq!(Solid::of(&ball.texture()), Some(ball.clone()));
        assert!((solid_angle(&ball.texture()) - 4.0 * PI).abs() < 1e-12);
        let mut half = solid(1, 361, 1.0);
        half.relative[181..].fill(0.0);
        let found = solid_angle(&half.texture());
        // The light ends within the half degree below the horizon.
        assert!((found - 2.0 * PI * (1.0 + 0.25_f64.to_radians())).abs() < 1e-4, "{found}");
    }

    #[test]
    fn what_is_no_grid_of_shares_is_refused() {
        assert_eq!(solid(24, 37, 0.5).check(), Ok(()));
        let odd = Solid { relative: vec![0.5; 25], ..solid(24, 37, 0.5) };
        let named = |name: &str| Solid { name: name.into(), ..solid(1, 2, 1.0) };
        let wrong = [solid(0, 2, 1.0), solid(1, 1, 1.0), solid(1, 362, 1.0), solid(721, 2, 1.0), odd, solid(1, 2, 1.5)];
        for wrong in wrong.into_iter().chain([solid(1, 2, f32::NAN), named("a\nb"), named(&"x".repeat(256))]) {
            assert!(wrong.check().is_err(), "{} {}", wrong.name, wrong.planes);
        }
    }
}
