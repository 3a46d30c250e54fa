//! Luminaires as the path tracer sees them: intensities of a photometric web, read a second time.

use std::f64::consts::PI;

use glam::{DVec3, Vec3};
use scenes::{Light, Pixels, Rgb, Scene, Texture};

/// Intensity of a luminaire in a unit direction away from it, W·sr⁻¹: bilinear in the two angles of its web.
pub fn intensity(scene: &Scene, lamp: &Light, away: Vec3) -> Rgb {
    let Light::Luminaire { direction, side, intensity, solid, .. } = lamp else { return Vec3::ZERO };
    let (aim, away) = (direction.as_dvec3(), away.as_dvec3());
    let flat = |v: DVec3| v - aim * aim.dot(v);
    let side = flat(side.as_dvec3()).try_normalize().unwrap_or_else(|| side_of(*direction));
    let gamma = libm::acos(aim.dot(away).clamp(-1.0, 1.0));
    // Counter-clockwise about the way back.
    let c = libm::atan2(side.cross(aim).dot(away), side.dot(away)).rem_euclid(2.0 * PI);
    *intensity * relative(&scene.textures[*solid as usize], c, gamma) as f32
}

/// As in IGI, where a side along the aim says nothing.
fn side_of(direction: Vec3) -> DVec3 {
    direction.any_orthonormal_vector().as_dvec3()
}

/// ∫ of relative intensity over all directions, sr: by the midpoint rule, which only choices depend on.
pub fn solid_angle(texture: &Texture) -> f64 {
    let (rows, columns) = (180, 72);
    let mut sum = 0.0;
    for row in 0..rows {
        let gamma = PI * (f64::from(row) + 0.5) / f64::from(rows);
        for column in 0..columns {
            let c = 2.0 * PI * (f64::from(column) + 0.5) / f64::from(columns);
            sum += relative(texture, c, gamma) * libm::sin(gamma);
        }
    }
    // A web of single bright angles may be dark at all of these.
    (sum * 2.0 * PI * PI / f64::from(rows * columns)).max(1e-6)
}

fn relative(texture: &Texture, c: f64, gamma: f64) -> f64 {
    let Pixels::Float(texels) = &texture.pixels else { return 0.0 };
    let (columns, rows) = (texture.width as usize, texture.height as usize);
    let texel = |column: usize, row: usize| f64::from(texels[row.min(rows - 1) * columns + column % columns][0]);
    let (x, y) = (c / (2.0 * PI) * columns as f64, gamma / PI * (rows - 1) as f64);
    let (west, north) = (x.floor(), y.floor());
    let (s, t) = (x - west, y - north);
    let plane = |column: usize| texel(column, north as usize) * (1.0 - t) + texel(column, north as usize + 1) * t;
    plane(west as usize) * (1.0 - s) + plane(west as usize + 1) * s
}
