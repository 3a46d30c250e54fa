//! Skies by formula: where the sun stands, and the luminance and colour of each direction.
//!
//! Directions are those of a scene: +y is up. North is where a turn says, and east is to the right of it
//! ([`Compass::direction`]). Luminance is in cd·m⁻².

mod cie;
mod preetham;
mod sun_position;

use std::f64::consts::{FRAC_PI_2, PI};

use glam::DVec3;

pub use cie::GENERAL_SKIES;
pub use sun_position::{Moment, sun_position};

use crate::photometry;

/// A place in the sky, degrees.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Angles {
    /// Above the horizon, −90..90.
    pub altitude_deg: f64,
    /// From north by east.
    pub azimuth_deg: f64,
}

/// Which way north is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Compass {
    /// From −z towards +x, degrees.
    pub north_deg: f64,
}

impl Compass {
    /// The unit direction to a place in the sky.
    pub fn direction(self, at: Angles) -> DVec3 {
        let (altitude, turn) = (at.altitude_deg.to_radians(), (self.north_deg + at.azimuth_deg).to_radians());
        let level = libm::cos(altitude);
        DVec3::new(level * libm::sin(turn), libm::sin(altitude), -level * libm::cos(turn))
    }
}

/// A model of the sky.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Model {
    /// One of the general skies of ISO 15469:2004 (CIE S 011), 1..=15, grey.
    Cie {
        /// Its number there.
        number: u8,
    },
    /// Preetham, Shirley & Smits 1999, clear and coloured.
    Preetham,
}

/// A sky above the horizon.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sky {
    model: Model,
    turbidity: f64,
    /// Unit.
    towards_sun: DVec3,
    /// Of the zenith, before `scale`, cd·m⁻².
    zenith: f64,
    scale: f64,
}

/// Turbidity that the models are good for: clear air to haze.
pub const TURBIDITY: [f64; 2] = [1.7, 10.0];
/// Radiance's formulas for the zenith go to infinity where the sun stands there; so they stop here, as `gensky` does.
const ALTITUDE_MAX_DEG: f64 = 87.0;
/// Degrees that the sun is wide, seen from the earth, in the mean of a year.
pub const SUN_DEG: f32 = 0.53;

impl Sky {
    /// With the sun in some direction, above the horizon, and so much haze. The zenith's luminance is that of Radiance's
    /// `gensky` (G. Ward, `src/gen/gensky.c`) for CIE's overcast, intermediate and clear skies; Preetham's has its own.
    pub fn new(model: Model, towards_sun: DVec3, turbidity: f64) -> Self {
        let most = ALTITUDE_MAX_DEG.to_radians();
        let altitude = libm::asin(towards_sun.y.clamp(-1.0, 1.0)).min(most);
        let zenith = match model {
            Model::Cie { number } => cie::zenith(number, altitude, turbidity),
            Model::Preetham => preetham::zenith(turbidity, FRAC_PI_2 - altitude),
        };
        Self { model, turbidity, towards_sun, zenith, scale: 1.0 }
    }

    /// The same as bright that its zenith has a luminance, cd·m⁻².
    #[must_use]
    pub fn with_zenith(self, luminance: f64) -> Self {
        self.scaled(luminance / (self.zenith * self.scale))
    }

    /// The same so much brighter.
    #[must_use]
    pub fn scaled(self, factor: f64) -> Self {
        Self { scale: self.scale * factor, ..self }
    }

    /// Luminance, cd·m⁻², in a unit direction above the horizon.
    pub fn luminance(&self, towards: DVec3) -> f64 {
        self.scale * self.zenith * self.relative(towards)
    }

    /// Linear Rec. 709 colour of luminance 1 in a unit direction above the horizon.
    pub fn colour(&self, towards: DVec3) -> DVec3 {
        match self.model {
            Model::Cie { .. } => DVec3::ONE,
            Model::Preetham => {
                let (zenith_angle, to_sun, sun) = self.angles(towards);
                let xy = preetham::chromaticity(self.turbidity, zenith_angle, to_sun, sun);
                photometry::of_chromaticity(xy).unwrap_or(DVec3::ONE)
            }
        }
    }

    /// Beside the zenith's.
    fn relative(&self, towards: DVec3) -> f64 {
        let (zenith_angle, to_sun, sun) = self.angles(towards);
        match self.model {
            Model::Cie { number } => cie::relative(number, zenith_angle, to_sun, sun),
            Model::Preetham => preetham::relative(self.turbidity, zenith_angle, to_sun, sun),
        }
    }

    /// Angles from the zenith and from the sun, and the sun's from the zenith, rad.
    fn angles(&self, towards: DVec3) -> (f64, f64, f64) {
        let angle = |a: DVec3, b: DVec3| libm::atan2(a.cross(b).length(), a.dot(b));
        // At the horizon and below, formulas divide by the cosine.
        let zenith_angle = angle(towards, DVec3::Y).min(FRAC_PI_2 - 1e-4);
        (zenith_angle, angle(towards, self.towards_sun), angle(self.towards_sun, DVec3::Y))
    }

    /// Illuminance of the ground by the sky alone, lx: by the midpoint rule, 90 × 360.
    pub fn illuminance(&self) -> f64 {
        let (rows, columns) = (90, 360);
        let mut sum = 0.0;
        for row in 0..rows {
            // Even in the square of the sine, so each counts alike.
            let sine = ((f64::from(row) + 0.5) / f64::from(rows)).sqrt();
            let level = (1.0 - sine * sine).sqrt();
            for column in 0..columns {
                let turn = 2.0 * PI * (f64::from(column) + 0.5) / f64::from(columns);
                sum += self.luminance(DVec3::new(level * libm::sin(turn), sine, -level * libm::cos(turn)));
            }
        }
        PI * sum / f64::from(rows * columns)
    }

    /// Linear Rec. 709 colour of the sun's light, of luminance 1: white under CIE's skies; under Preetham's that of a black body
    /// of 5800 K, less what air and haze scatter away on so long a way (his appendix A.1), at one wavelength a channel.
    pub fn sun_colour(&self) -> DVec3 {
        if let Model::Cie { .. } = self.model {
            return DVec3::ONE;
        }
        let black_body = photometry::planck(5800.0).and_then(photometry::of_chromaticity).unwrap_or(DVec3::ONE);
        let left = preetham::sunlight_left(self.turbidity, libm::acos(self.towards_sun.y.clamp(0.0, 1.0)));
        let colour = black_body * DVec3::from(left);
        colour / photometry::luminance(colour)
    }

    /// Illuminance of a surface that faces the sun, by the sun alone, lx; 0 under an overcast sky. Radiance's `gensky`: a disc
    /// of 6·10⁻⁵ sr.
    pub fn sun_illuminance(&self) -> f64 {
        let clear = 1.5e9 * 6e-5 * (1.147 - 0.147 / self.towards_sun.y.max(0.16));
        match self.model {
            Model::Cie { number } => clear * cie::sun_share(number),
            Model::Preetham => clear,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sun(altitude_deg: f64) -> DVec3 {
        Compass { north_deg: 0.0 }.direction(Angles { altitude_deg, azimuth_deg: 180.0 })
    }

    #[test]
    fn east_is_to_the_right_of_north() {
        let at = |azimuth_deg| Compass { north_deg: 0.0 }.direction(Angles { altitude_deg: 0.0, azimuth_deg });
        assert!((at(0.0) - DVec3::NEG_Z).length() < 1e-12 && (at(90.0) - DVec3::X).length() < 1e-12);
        let turned = Compass { north_deg: 90.0 }.direction(Angles { altitude_deg: 0.0, azimuth_deg: 90.0 });
        assert!((turned - DVec3::Z).length() < 1e-12);
    }

    /// The ratio of a sky's illuminance to its zenith's luminance, as `gensky` approximates it: 7π/9 of the overcast sky in
    /// closed form, and of the clear and the intermediate one by Ward's polynomials.
    #[test]
    fn illuminance_is_that_of_published_integrals() {
        let ratio = |number, altitude| {
            let sky = Sky::new(Model::Cie { number }, sun(altitude), 2.45).with_zenith(1.0);
            sky.illuminance()
        };
        // The traditional overcast sky (1 + 2 sin) / 3 is none of the fifteen; the first is close to it.
        assert!((ratio(1, 40.0) / (7.0 / 9.0 * PI) - 1.0).abs() < 0.02, "{}", ratio(1, 40.0));
        assert!((ratio(5, 40.0) / PI - 1.0).abs() < 1e-6, "uniform: {}", ratio(5, 40.0));
    }

    #[test]
    fn a_sky_can_be_as_bright_as_is_said() {
        let sky = Sky::new(Model::Preetham, sun(50.0), 3.0);
        assert!((sky.with_zenith(4000.0).luminance(DVec3::Y) / 4000.0 - 1.0).abs() < 1e-9);
        assert!((sky.scaled(2.0).illuminance() / sky.illuminance() - 2.0).abs() < 1e-9);
        let colour = sky.colour(DVec3::Y);
        assert!(colour.z > 1.5 * colour.x, "the zenith is blue: {colour}");
        let [high, low] = [60.0, 5.0].map(|altitude| Sky::new(Model::Preetham, sun(altitude), 3.0).sun_colour());
        assert!(low.x / low.z > 2.0 * high.x / high.z, "the sun sets red: {high}, {low}");
    }
}
