//! What bounded virtual lights leave of the light in a box, by quadrature in `f64`.
//!
//! In a box whose faces each have one radiance, the irradiance at a point is an integral over
//! directions of smooth pieces; the gate of a bound weighs them by distance and cosines. This is how
//! the *wrong* answers of biased modes are predicted, with none of the renderer's code.

use std::f64::consts::PI;

use glam::DVec3;
use protocol::question::{Bound, Quality};
use scenes::Scene;

/// What is let through of `cosθ_x cosθ_y / d²`: the published formulas, once more.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Gate {
    /// All.
    Open,
    /// `min(1, d²/least)`.
    Clip {
        /// Squared distance.
        least: f64,
    },
    /// `min(1, most/G)`.
    Bound {
        /// 1 / squared distance.
        most: f64,
    },
}

impl Gate {
    /// Gates on emitters and on surfaces where light has that extent ([`light::importance::Importance::extent`]).
    ///
    /// # Panics
    /// For the smooth gate, which no method here uses.
    pub fn pair(quality: &Quality, extent: f64) -> [Self; 2] {
        match quality.bound {
            Bound::None => [Self::Open; 2],
            Bound::Clip { distance } => [Self::Clip { least: (f64::from(distance) * extent).powi(2) }; 2],
            Bound::Geometry { distance } => {
                let reach = f64::from(distance) * extent;
                let emitters = reach / f64::from(light::vpl::EMITTERS_CLOSER);
                [emitters, reach].map(|reach| Self::Bound { most: 1.0 / (reach * reach) })
            }
            Bound::Smooth { .. } => panic!("no method uses the smooth gate"),
        }
    }

    fn kept(self, cosines: f64, d2: f64) -> f64 {
        match self {
            Self::Open => 1.0,
            Self::Clip { least } => (d2 / least).min(1.0),
            Self::Bound { most } => (most * d2 / cosines).min(1.0),
        }
    }

    /// Share of the light between points of a sphere that is let through; `G` is the same between all.
    pub fn kept_in_sphere(self, radius: f64) -> f64 {
        let square = radius * radius;
        match self {
            Self::Open => 1.0,
            // Squared chords are evenly distributed over 0..4R².
            Self::Clip { least } => 1.0 - least / (8.0 * square),
            Self::Bound { most } => (4.0 * square * most).min(1.0),
        }
    }
}

/// A box centred at the origin, by half its edges.
#[derive(Clone, Copy, Debug)]
pub struct Room {
    /// Half the edges.
    pub half: DVec3,
}

/// Directions: so many rings of so many sectors.
const RINGS: u32 = 64;
const SECTORS: u32 = 128;
/// Points of the picture: so many to a side, denser towards its edges, where those of the room may be and
/// gates bite within a hair.
const SIDE: u32 = 40;

impl Room {
    /// A cube.
    pub fn cube(half: f64) -> Self {
        Self { half: DVec3::splat(half) }
    }

    /// Where a ray from inside leaves: distance and face, in the order −x, +x, −y, +y, −z, +z.
    fn exit(&self, from: DVec3, direction: DVec3) -> (f64, usize) {
        let mut nearest = (f64::INFINITY, 0);
        for axis in 0..3 {
            let (o, d, half) = (from[axis], direction[axis], self.half[axis]);
            if d != 0.0 {
                let t = (half.copysign(d) - o) / d;
                if t < nearest.0 {
                    nearest = (t, 2 * axis + usize::from(d > 0.0));
                }
            }
        }
        nearest
    }

    /// Irradiance / π at a point of a face: mean over cosine-distributed directions of
    /// `value(face, what cosines and squared distance the light has)`.
    fn gather(&self, at: DVec3, face: usize, value: &impl Fn(usize, f64, f64) -> f64) -> f64 {
        let axis = face / 2;
        let inwards = if face.is_multiple_of(2) { 1.0 } else { -1.0 };
        let mut sum = 0.0;
        for ring in 0..RINGS {
            let u = (f64::from(ring) + 0.5) / f64::from(RINGS);
            let (r, cos) = (u.sqrt(), (1.0 - u).sqrt());
            for sector in 0..SECTORS {
                let (sin_phi, cos_phi) = ((f64::from(sector) + 0.5) / f64::from(SECTORS) * 2.0 * PI).sin_cos();
                let mut direction = DVec3::ZERO;
                direction[axis] = inwards * cos;
                direction[(axis + 1) % 3] = r * cos_phi;
                direction[(axis + 2) % 3] = r * sin_phi;
                let (distance, met) = self.exit(at, direction);
                sum += value(met, cos * direction[met / 2].abs(), distance * distance);
            }
        }
        sum / f64::from(RINGS * SECTORS)
    }

    /// Mean over the picture of what `scene`'s camera, inside the box, sees of irradiance / π.
    fn seen(&self, scene: &Scene, value: &impl Fn(usize, f64, f64) -> f64) -> f64 {
        let camera = scene.camera;
        let lens = camera.lens();
        let mut sum = 0.0;
        // x = (1 − cos πu)/2, dx = π/2 sin πu du.
        let phase = |k: u32| (f64::from(k) + 0.5) / f64::from(SIDE) * PI;
        let place = |k: u32, size: u32| (1.0 - phase(k).cos()) as f32 / 2.0 * size as f32;
        let mut weights = 0.0;
        for i in 0..SIDE * SIDE {
            let (x, y) = (i % SIDE, i / SIDE);
            let direction = lens.direction(place(x, camera.width), place(y, camera.height)).as_dvec3();
            let from = camera.origin.as_dvec3();
            let (distance, face) = self.exit(from, direction);
            let weight = phase(x).sin() * phase(y).sin();
            sum += weight * self.gather(from + direction * distance, face, value);
            weights += weight;
        }
        sum / weights
    }

    /// Share of evenly spread light that a gate lets through to what the camera sees.
    pub fn kept(&self, scene: &Scene, gate: Gate) -> f64 {
        self.seen(scene, &|_, cosines, d2| gate.kept(cosines, d2))
    }

    /// Irradiance / π of what the camera sees, from faces of these radiances through a gate.
    pub fn irradiance(&self, scene: &Scene, radiance: [f64; 6], gate: Gate) -> f64 {
        self.seen(scene, &|face, cosines, d2| radiance[face] * gate.kept(cosines, d2))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::closed_form;
    use crate::worlds::emitters;

    #[test]
    fn the_quadrature_knows_the_form_factors_of_a_cube() {
        for (case, lit, factor) in [(0, 5, closed_form::CUBE_FACES[0]), (1, 0, closed_form::CUBE_FACES[1])] {
            let scene = &emitters::cube_faces()[case].scene;
            let mut radiance = [0.0; 6];
            radiance[lit] = 1.0;
            let got = Room::cube(1.0).irradiance(scene, radiance, Gate::Open);
            assert!((got / factor - 1.0).abs() < 5e-3, "{got} against {factor}");
        }
    }

    #[test]
    fn an_open_gate_keeps_all_and_a_bound_keeps_little_in_corners() {
        let scene = &crate::worlds::furnaces::furnace_corner(0.5).scene;
        assert!((Room::cube(1.0).kept(scene, Gate::Open) - 1.0).abs() < 1e-12);
        let kept = Room::cube(1.0).kept(scene, Gate::Bound { most: 1.0 });
        assert!((0.1..0.8).contains(&kept), "{kept}");
    }
}
