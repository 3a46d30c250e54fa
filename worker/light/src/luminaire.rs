//! Luminaires: points of light whose intensity depends on direction as a photometric web says.
//!
//! The web lies on an even grid of angles ([`scenes::Light::Luminaire`]) and is bilinear between them. Light leaves by it: a
//! cell of the grid is chosen by the mean of its corners times its solid angle, and in it all directions are alike. So the
//! density is positive wherever the intensity is, and nowhere less than a quarter of proportional to it.

use std::f32::consts::PI;
use std::sync::Arc;

use glam::{Mat3, Vec3};
use scenes::{Pixels, Texture};

/// A web, with how to choose directions by it.
#[derive(Debug, PartialEq)]
pub struct Web {
    /// Planes C; 1 if all are alike.
    columns: usize,
    /// Rows of angles γ from 0 to 180°.
    rows: usize,
    /// Share of the largest intensity, row after row.
    relative: Vec<f32>,
    /// Of the angle of each row.
    cosines: Vec<f32>,
    /// Cumulative probabilities of the rows of cells, of which there is one less.
    of_rows: Vec<f32>,
    /// The same of the cells of each row, row after row.
    of_columns: Vec<f32>,
    /// ∫ relative dω, sr.
    solid_angle: f32,
}

/// A web in a place's frame.
#[derive(Clone, Debug, PartialEq)]
pub struct Luminaire {
    web: Arc<Web>,
    /// Columns: to its side (C = 0°), at C = 90°, and where it is aimed (γ = 0°).
    frame: Mat3,
}

impl Luminaire {
    /// Aimed in a unit direction, its side turned as far as it must be to be across.
    pub fn new(web: Arc<Web>, direction: Vec3, side: Vec3) -> Self {
        let across = (side - direction * direction.dot(side)).try_normalize();
        let side = across.unwrap_or_else(|| direction.any_orthonormal_vector());
        // Counter-clockwise as seen from behind: about −direction.
        Self { web, frame: Mat3::from_cols(side, side.cross(direction), direction) }
    }

    /// Share of the largest intensity in a unit direction away from it.
    pub fn relative(&self, direction: Vec3) -> f32 {
        self.web.relative(self.frame.transpose() * direction)
    }

    /// ∫ of that over all directions, sr.
    pub fn solid_angle(&self) -> f32 {
        self.web.solid_angle
    }

    /// A direction away from it, about in proportion to intensity; on the border to a dark cell its density may be 0.
    pub fn sample(&self, u: [f32; 2]) -> Vec3 {
        (self.frame * self.web.sample(u)).normalize()
    }

    /// Density of [`Self::sample`], sr⁻¹.
    pub fn density(&self, direction: Vec3) -> f32 {
        self.web.density(self.frame.transpose() * direction)
    }
}

impl Web {
    /// Of a texture as the scene keeps it.
    pub fn new(texture: &Texture) -> Self {
        let (columns, rows) = (texture.width as usize, texture.height as usize);
        let relative: Vec<f32> = match &texture.pixels {
            Pixels::Float(texels) => texels.iter().map(|texel| texel[0]).collect(),
            Pixels::Srgb8(_) | Pixels::Linear8(_) => vec![0.0; columns * rows],
        };
        let last = rows.max(2) - 1;
        let cosine = |row: usize| libm::cos(std::f64::consts::PI * row as f64 / last as f64);
        let mut web = Self {
            columns,
            rows,
            relative,
            cosines: (0..rows).map(|row| cosine(row) as f32).collect(),
            of_rows: Vec::with_capacity(last),
            of_columns: Vec::with_capacity(last * columns),
            solid_angle: 0.0,
        };
        let mut total = 0.0_f64;
        for row in 0..rows.saturating_sub(1) {
            let band = (cosine(row) - cosine(row + 1)) * std::f64::consts::TAU / columns as f64;
            let first = web.of_columns.len();
            let mut sum = 0.0_f64;
            for column in 0..columns {
                sum += f64::from(web.corners(row, column).iter().sum::<f32>()) / 4.0;
                web.of_columns.push(sum as f32);
            }
            for part in &mut web.of_columns[first..] {
                *part = if sum > 0.0 { (f64::from(*part) / sum) as f32 } else { 1.0 };
            }
            total += sum * band;
            web.of_rows.push(total as f32);
        }
        if total > 0.0 {
            web.of_rows.iter_mut().for_each(|part| *part /= total as f32);
        }
        web.solid_angle = total as f32;
        web
    }

    /// Bytes that it takes.
    pub fn bytes(&self) -> usize {
        let tables = [&self.relative, &self.cosines, &self.of_rows, &self.of_columns];
        tables.iter().map(|table| size_of_val(&table[..])).sum()
    }

    fn relative(&self, local: Vec3) -> f32 {
        let (row, column, down, across) = self.place(local);
        let [a, b, c, d] = self.corners(row, column);
        let (upper, lower) = (a + (b - a) * across, c + (d - c) * across);
        upper + (lower - upper) * down
    }

    fn sample(&self, u: [f32; 2]) -> Vec3 {
        let (row, down) = invert(&self.of_rows, u[0]);
        let (column, across) = invert(&self.of_columns[row * self.columns..][..self.columns], u[1]);
        let cos = self.cosines[row] + (self.cosines[row + 1] - self.cosines[row]) * down;
        let (sin_c, cos_c) = libm::sincosf(2.0 * PI * (column as f32 + across) / self.columns as f32);
        let sin = ((1.0 - cos) * (1.0 + cos)).max(0.0).sqrt();
        Vec3::new(sin * cos_c, sin * sin_c, cos)
    }

    fn density(&self, local: Vec3) -> f32 {
        let (row, column, ..) = self.place(local);
        let step = |table: &[f32], i: usize| table[i] - if i > 0 { table[i - 1] } else { 0.0 };
        let of_row = &self.of_columns[row * self.columns..][..self.columns];
        let solid_angle = (self.cosines[row] - self.cosines[row + 1]) * 2.0 * PI / self.columns as f32;
        step(&self.of_rows, row) * step(of_row, column) / solid_angle
    }

    /// The cell of a unit direction, and how far it is in it, from row to row and from column to column.
    fn place(&self, local: Vec3) -> (usize, usize, f32, f32) {
        let level = (local.x * local.x + local.y * local.y).sqrt();
        let cells = self.rows - 1;
        let y = libm::atan2f(level, local.z) / PI * cells as f32;
        let row = (y as usize).min(cells - 1);
        let (column, across) = match self.columns {
            1 => (0, 0.0),
            columns => {
                let turn = libm::atan2f(local.y, local.x) / (2.0 * PI);
                let x = (turn - turn.floor()) * columns as f32;
                let column = (x as usize).min(columns - 1);
                (column, x - column as f32)
            }
        };
        (row, column, y - row as f32, across)
    }

    /// Of a cell: at its first and second plane, at its first angle γ and then at its second.
    fn corners(&self, row: usize, column: usize) -> [f32; 4] {
        let next = if column + 1 == self.columns { 0 } else { column + 1 };
        let at = |row: usize, column: usize| self.relative[row * self.columns + column];
        [at(row, column), at(row, next), at(row + 1, column), at(row + 1, next)]
    }
}

/// The bin of a cumulative table that `u` falls into, and where in it (0..1).
fn invert(table: &[f32], u: f32) -> (usize, f32) {
    let bin = table.partition_point(|sum| *sum <= u).min(table.len() - 1);
    let low = if bin > 0 { table[bin - 1] } else { 0.0 };
    let width = table[bin] - low;
    (bin, if width > 0.0 { ((u - low) / width).clamp(0.0, 1.0) } else { 0.5 })
}

#[cfg(test)]
mod tests {
    use super::*;
    use scenes::LookUp;

    fn web(columns: u32, rows: u32, relative: impl Fn(u32, u32) -> f32) -> Arc<Web> {
        let texels = (0..rows).flat_map(|row| (0..columns).map(move |column| (row, column)));
        let pixels = Pixels::Float(texels.map(|(row, column)| [relative(row, column); 3]).collect());
        let texture = Texture { name: "web".into(), width: columns, height: rows, pixels, look_up: LookUp::CLAMP };
        Arc::new(Web::new(&texture))
    }

    fn random(i: u32) -> [f32; 2] {
        [0, 1].map(|d| (crate::sample::mix(2 * i + d) >> 8) as f32 / 16_777_216.0)
    }

    #[test]
    fn intensity_over_density_is_the_flux_and_no_sample_outshines_the_others() {
        let webs = [
            web(1, 3, |_, _| 1.0),
            web(1, 19, |row, _| if row == 3 { 1.0 } else { 0.0 }),
            web(24, 37, |row, column| if row < 18 { (1 + (row * 7 + column * 5) % 11) as f32 / 11.0 } else { 0.0 }),
        ];
        for web in webs {
            let lamp = Luminaire::new(web, Vec3::new(0.48, -0.8, 0.36), Vec3::X);
            let n = 40_000;
            let (mut flux, mut most) = (0.0_f64, 0.0_f32);
            for i in 0..n {
                let direction = lamp.sample(random(i));
                // On the border to a dark cell, rounding may put it there.
                let density = lamp.density(direction);
                let weight = if density > 0.0 { lamp.relative(direction) / density / lamp.solid_angle() } else { 0.0 };
                flux += f64::from(weight) / f64::from(n);
                most = most.max(weight);
            }
            assert!((flux - 1.0).abs() < 0.02, "{flux}");
            assert!(most < 4.1, "{most}");
        }
    }

    #[test]
    fn a_web_is_aimed_and_turned_counter_clockwise_seen_from_behind() {
        // Bright at C = 90° alone.
        let lamp = Luminaire::new(
            web(4, 3, |row, column| if (row, column) == (1, 1) { 1.0 } else { 0.0 }),
            Vec3::NEG_Y,
            Vec3::X,
        );
        assert!((lamp.relative(Vec3::NEG_Z) - 1.0).abs() < 1e-6, "from above, x to the right, −z is up");
        for dark in [Vec3::X, Vec3::NEG_X, Vec3::Z, Vec3::Y, Vec3::NEG_Y] {
            assert!(lamp.relative(dark) < 1e-6, "{dark}");
        }
        let half = (Vec3::NEG_Z + Vec3::NEG_Y).normalize();
        assert!((lamp.relative(half) - 0.5).abs() < 1e-6);
    }
}
