//! A photometric web: intensities by angle, and what follows from them.
//!
//! Angles are those of C-planes (CIE 121): γ from where the luminaire is aimed, 0..180°; C about that, from its side 0°,
//! counter-clockwise as seen from behind the luminaire: 0..360°. Between angles, intensities are linear in both; beyond
//! the first and last γ there is no light.

use std::f64::consts::PI;

use glam::DVec3;

use crate::{LookUp, Pixels, Texture};

/// Intensities over a grid of angles.
#[derive(Clone, Debug, PartialEq)]
pub struct Web {
    /// Planes, degrees, ascending within 0..360; of one, all are alike.
    c_deg: Vec<f64>,
    /// Ascending within 0..180.
    gamma_deg: Vec<f64>,
    /// cd, plane after plane.
    candela: Vec<f64>,
}

/// How a web repeats itself about its axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Symmetry {
    /// All planes are given.
    None,
    /// One plane stands for all.
    Axial,
    /// Planes 0..180, mirrored in that plane.
    Half,
    /// Planes 90..270, mirrored in that plane.
    HalfAcross,
    /// Planes 0..90, mirrored in both.
    Quarter,
}

/// Steps of an even grid, degrees: the widest that meets all angles of a file is taken.
const STEPS_DEG: [f64; 9] = [90.0, 45.0, 22.5, 15.0, 10.0, 5.0, 2.5, 1.0, 0.5];
/// Light of such a share of the largest intensity does not end at once.
const EDGE: f64 = 0.01;
/// So near, an angle is met, degrees.
const SAME_DEG: f64 = 1e-3;

impl Web {
    /// Of intensities in planes as they are given; all lists ascend, and there is an intensity for each pair.
    pub fn new(symmetry: Symmetry, planes_deg: &[f64], gamma_deg: Vec<f64>, candela: &[f64]) -> Self {
        let row = |plane: usize| &candela[plane * gamma_deg.len()..][..gamma_deg.len()];
        let given = || (0..planes_deg.len()).map(|plane| (planes_deg[plane], plane));
        let mirrored = |axis: f64| given().map(move |(c, plane)| (2.0 * axis - c, plane));
        let mut planes: Vec<(f64, usize)> = match symmetry {
            Symmetry::Axial => vec![(0.0, 0)],
            Symmetry::None => given().collect(),
            Symmetry::Half => given().chain(mirrored(180.0)).collect(),
            Symmetry::HalfAcross => given().chain(mirrored(90.0)).collect(),
            Symmetry::Quarter => given()
                .chain(mirrored(90.0))
                .chain(given().map(|(c, plane)| (c + 180.0, plane)))
                .chain(mirrored(180.0))
                .collect(),
        };
        for (c, _) in &mut planes {
            *c = c.rem_euclid(360.0);
            if 360.0 - *c < SAME_DEG {
                *c = 0.0;
            }
        }
        planes.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        planes.dedup_by(|next, kept| next.0 - kept.0 < SAME_DEG);
        Self {
            c_deg: planes.iter().map(|(c, _)| *c).collect(),
            candela: planes.iter().flat_map(|(_, plane)| row(*plane)).copied().collect(),
            gamma_deg,
        }
    }

    /// Of intensities by direction: x to the side, y at C = 90°, z where it is aimed. On a grid of one degree.
    pub fn of_directions(intensity: impl Fn(DVec3) -> f64) -> Self {
        let c_deg: Vec<f64> = (0..360).map(f64::from).collect();
        let gamma_deg: Vec<f64> = (0..=180).map(f64::from).collect();
        let direction = |c: f64, gamma: f64| {
            let (c, gamma) = (c.to_radians(), gamma.to_radians());
            let sine = libm::sin(gamma);
            DVec3::new(sine * libm::cos(c), sine * libm::sin(c), libm::cos(gamma))
        };
        let pairs = c_deg.iter().flat_map(|c| gamma_deg.iter().map(move |gamma| (*c, *gamma)));
        let candela = pairs.map(|(c, gamma)| intensity(direction(c, gamma))).collect();
        Self { c_deg, gamma_deg, candela }
    }

    /// The same so many times as bright.
    #[must_use]
    pub fn scaled(mut self, factor: f64) -> Self {
        self.candela.iter_mut().for_each(|candela| *candela *= factor);
        self
    }

    /// The largest intensity, cd.
    pub fn peak(&self) -> f64 {
        self.candela.iter().fold(0.0, |most, candela| candela.max(most))
    }

    /// Luminous flux, lm: the integral in closed form of what is linear in both angles.
    pub fn flux(&self) -> f64 {
        let planes = self.c_deg.len();
        let mut flux = 0.0;
        for (number, pair) in self.gamma_deg.windows(2).enumerate() {
            let [from, to] = [pair[0].to_radians(), pair[1].to_radians()];
            let (width, [cos_from, cos_to]) = (to - from, [libm::cos(from), libm::cos(to)]);
            // ∫ sin, and ∫ s sin of the share s of the way from one angle to the next.
            let whole = cos_from - cos_to;
            let part = (libm::sin(to) - libm::sin(from)) / width - cos_to;
            for plane in 0..planes {
                let next = (plane + 1) % planes;
                let across = match planes {
                    1 => 2.0 * PI,
                    _ => (self.c_deg[next] - self.c_deg[plane]).rem_euclid(360.0).to_radians(),
                };
                let mean = |gamma: usize| (self.of(plane, gamma) + self.of(next, gamma)) / 2.0;
                let [first, last] = [mean(number), mean(number + 1)];
                flux += across * (first * (whole - part) + last * part);
            }
        }
        flux
    }

    /// The share of its flux that it sends beyond an angle from where it is aimed; to about a percent.
    pub fn share_beyond(&self, gamma_deg: f64) -> f64 {
        let [mut beyond, mut all] = [0.0; 2];
        for gamma in (0..180).map(|step| f64::from(step) + 0.5) {
            let ring = (0..72).map(|step| self.at(5.0 * f64::from(step), gamma)).sum::<f64>();
            let flux = ring * libm::sin(gamma.to_radians());
            all += flux;
            beyond += if gamma > gamma_deg { flux } else { 0.0 };
        }
        if all > 0.0 { beyond / all } else { 0.0 }
    }

    /// Intensity, cd, in a direction.
    pub fn at(&self, c_deg: f64, gamma_deg: f64) -> f64 {
        let gammas = &self.gamma_deg;
        let (Some(first), Some(last)) = (gammas.first(), gammas.last()) else { return 0.0 };
        if gamma_deg < first - SAME_DEG || gamma_deg > last + SAME_DEG {
            return 0.0;
        }
        let after = gammas.partition_point(|gamma| *gamma <= gamma_deg).clamp(1, gammas.len().max(2) - 1);
        let (before, after) = (after - 1, after.min(gammas.len() - 1));
        let way =
            |from: f64, to: f64, at: f64| if to > from { ((at - from) / (to - from)).clamp(0.0, 1.0) } else { 0.0 };
        let down = way(gammas[before], gammas[after], gamma_deg);
        let planes = self.c_deg.len();
        let next = self.c_deg.partition_point(|c| *c <= c_deg);
        let (west, east) = ((next + planes - 1) % planes, next % planes);
        let gap = (self.c_deg[east] - self.c_deg[west]).rem_euclid(360.0);
        let across = way(0.0, gap, (c_deg - self.c_deg[west]).rem_euclid(360.0));
        let plane = |plane: usize| self.of(plane, before) + (self.of(plane, after) - self.of(plane, before)) * down;
        plane(west) + (plane(east) - plane(west)) * across
    }

    /// Between rows of the grid: narrow, where light ends at once at the first or last angle.
    fn step_down(&self) -> f64 {
        let shines = |gamma: usize| (0..self.c_deg.len()).any(|plane| self.of(plane, gamma) > EDGE * self.peak());
        let last = self.gamma_deg.len() - 1;
        let ends_at_once =
            (self.gamma_deg[0] > SAME_DEG && shines(0)) || (self.gamma_deg[last] < 180.0 - SAME_DEG && shines(last));
        if ends_at_once { STEPS_DEG[STEPS_DEG.len() - 1] } else { step(&self.gamma_deg) }
    }

    fn of(&self, plane: usize, gamma: usize) -> f64 {
        self.candela[plane * self.gamma_deg.len() + gamma]
    }

    /// The web as a scene keeps it ([`crate::Light::Luminaire`]), relative to its peak, on an even grid; and how far that is
    /// from it at the file's own angles at most, as a share of the peak.
    pub fn texture(&self, name: &str) -> (Texture, f64) {
        let rows = (180.0 / self.step_down()) as u32 + 1;
        let columns = if self.c_deg.len() == 1 { 1 } else { (360.0 / step(&self.c_deg)) as u32 };
        let peak = self.peak();
        let mut texels = Vec::with_capacity((rows * columns) as usize);
        for row in 0..rows {
            for column in 0..columns {
                let c = 360.0 * f64::from(column) / f64::from(columns);
                let relative = self.at(c, 180.0 * f64::from(row) / f64::from(rows - 1)) / peak;
                texels.push([relative as f32; 3]);
            }
        }
        let kept = Self {
            c_deg: (0..columns).map(|column| 360.0 * f64::from(column) / f64::from(columns)).collect(),
            gamma_deg: (0..rows).map(|row| 180.0 * f64::from(row) / f64::from(rows - 1)).collect(),
            candela: (0..columns)
                .flat_map(|column| (0..rows).map(move |row| (row * columns + column) as usize))
                .map(|texel| f64::from(texels[texel][0]) * peak)
                .collect(),
        };
        let mut off = 0.0_f64;
        for (plane, c) in self.c_deg.iter().enumerate() {
            for (number, gamma) in self.gamma_deg.iter().enumerate() {
                off = off.max((kept.at(*c, *gamma) - self.of(plane, number)).abs() / peak);
            }
        }
        let pixels = Pixels::Float(texels);
        (Texture { name: name.into(), width: columns, height: rows, pixels, look_up: LookUp::CLAMP }, off)
    }
}

/// The widest even step that meets all angles; the narrowest, if none does.
fn step(angles_deg: &[f64]) -> f64 {
    let meets = |step: &&f64| {
        angles_deg.iter().all(|angle| {
            let steps = angle / **step;
            (steps - steps.round()).abs() * **step < SAME_DEG
        })
    };
    *STEPS_DEG.iter().find(meets).unwrap_or(&STEPS_DEG[STEPS_DEG.len() - 1])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn gammas(step: usize, last: usize) -> Vec<f64> {
        (0..=last / step).map(|i| (i * step) as f64).collect()
    }

    #[test]
    fn the_flux_of_a_ball_and_of_a_plate() {
        let ball = Web::new(Symmetry::Axial, &[0.0], gammas(10, 180), &[100.0; 19]);
        assert!((ball.flux() / (400.0 * PI) - 1.0).abs() < 1e-12, "{}", ball.flux());
        let half = Web::new(Symmetry::None, &[0.0, 90.0, 180.0, 270.0], gammas(90, 90), &[100.0; 8]);
        assert!((half.flux() / (200.0 * PI) - 1.0).abs() < 1e-12, "{}", half.flux());
        let cosines: Vec<f64> = gammas(1, 90).iter().map(|gamma| 100.0 * gamma.to_radians().cos()).collect();
        let plate = Web::new(Symmetry::Axial, &[0.0], gammas(1, 90), &cosines);
        assert!((plate.flux() / (100.0 * PI) - 1.0).abs() < 1e-4, "{}", plate.flux());
    }

    #[test]
    fn planes_are_mirrored_as_their_symmetry_says() {
        let gamma = vec![0.0, 90.0];
        let at = |symmetry, planes: &[f64], c: f64| {
            let candela: Vec<f64> = planes.iter().flat_map(|c| [0.0, *c]).collect();
            Web::new(symmetry, planes, gamma.clone(), &candela).at(c, 90.0)
        };
        for (c, expected) in [(30.0, 30.0), (150.0, 30.0), (210.0, 30.0), (330.0, 30.0), (90.0, 90.0), (270.0, 90.0)] {
            assert_eq!(at(Symmetry::Quarter, &[0.0, 30.0, 90.0], c), expected, "{c}");
        }
        for (c, expected) in [(30.0, 30.0), (330.0, 30.0), (120.0, 120.0), (240.0, 120.0), (180.0, 180.0)] {
            assert_eq!(at(Symmetry::Half, &[0.0, 30.0, 120.0, 180.0], c), expected, "{c}");
        }
        for (c, expected) in [(90.0, 90.0), (60.0, 120.0), (120.0, 120.0), (0.0, 180.0), (270.0, 270.0), (300.0, 240.0)]
        {
            assert_eq!(at(Symmetry::HalfAcross, &[90.0, 120.0, 180.0, 240.0, 270.0], c), expected, "{c}");
        }
        // Between the last plane and the first, too.
        assert_eq!(at(Symmetry::None, &[0.0, 90.0, 180.0, 270.0], 315.0), 135.0);
        assert_eq!(at(Symmetry::None, &[0.0, 90.0, 180.0, 270.0, 360.0], 315.0), 135.0, "360 is 0");
    }

    #[test]
    fn beyond_the_first_and_last_angle_it_is_dark() {
        let up = Web::new(Symmetry::Axial, &[0.0], vec![90.0, 180.0], &[50.0, 100.0]);
        assert_eq!(
            (up.at(0.0, 89.0), up.at(0.0, 90.0), up.at(10.0, 135.0), up.at(0.0, 180.0)),
            (0.0, 50.0, 75.0, 100.0)
        );
    }

    #[test]
    fn usual_angles_are_kept_to_the_bit_of_a_float_and_others_nearly() {
        let candela: Vec<f64> = (0..37 * 4).map(|i| if i % 37 == 36 { 0.0 } else { f64::from(i * 7 % 31) }).collect();
        let usual: Vec<f64> = (0..37).map(|i| 2.5 * f64::from(i)).collect();
        let web = Web::new(Symmetry::None, &[0.0, 45.0, 90.0, 225.0], usual, &candela);
        let (texture, off) = web.texture("lamp");
        assert_eq!((texture.width, texture.height), (8, 73));
        assert!(off < 1e-6, "{off}");
        let odd = Web::new(Symmetry::Axial, &[0.0], vec![0.0, 7.3, 33.33, 90.0], &[10.0, 9.0, 2.0, 0.0]);
        let (texture, off) = odd.texture("lamp");
        assert_eq!((texture.width, texture.height), (1, 361));
        assert!(off < 0.01, "{off}");
        let half = Web::new(Symmetry::Axial, &[0.0], vec![0.0, 90.0], &[10.0, 10.0]);
        assert_eq!(half.texture("lamp").0.height, 361, "so that little light is above the horizon");
    }
}
