//! The fifteen general skies of ISO 15469:2004 (CIE S 011/E:2003), after Kittler, Perez & Darula.

use std::f64::consts::FRAC_PI_2;

/// Parameters a … e of the skies, from number 1 on.
pub const GENERAL_SKIES: [[f64; 5]; 15] = [
    [4.0, -0.70, 0.0, -1.0, 0.0],
    [4.0, -0.70, 2.0, -1.5, 0.15],
    [1.1, -0.8, 0.0, -1.0, 0.0],
    [1.1, -0.8, 2.0, -1.5, 0.15],
    [0.0, -1.0, 0.0, -1.0, 0.0],
    [0.0, -1.0, 2.0, -1.5, 0.15],
    [0.0, -1.0, 5.0, -2.5, 0.30],
    [0.0, -1.0, 10.0, -3.0, 0.45],
    [-1.0, -0.55, 2.0, -1.5, 0.15],
    [-1.0, -0.55, 5.0, -2.5, 0.30],
    [-1.0, -0.55, 10.0, -3.0, 0.45],
    [-1.0, -0.32, 10.0, -3.0, 0.45],
    [-1.0, -0.32, 16.0, -3.0, 0.30],
    [-1.0, -0.15, 16.0, -3.0, 0.30],
    [-1.0, -0.15, 24.0, -2.8, 0.15],
];

/// The last sky that no sun is seen in …
const OVERCAST: u8 = 5;
/// … and the last that is partly cloudy.
const INTERMEDIATE: u8 = 10;

/// Luminance of a direction beside the zenith's; angles from the zenith, from the sun, and between these, rad.
pub(super) fn relative(number: u8, zenith_angle: f64, to_sun: f64, sun: f64) -> f64 {
    let [a, b, c, d, e] = GENERAL_SKIES[usize::from(number) - 1];
    let gradation = |angle: f64| 1.0 + a * libm::exp(b / libm::cos(angle));
    let indicatrix = |angle: f64| {
        let cos = libm::cos(angle);
        1.0 + c * (libm::exp(d * angle) - libm::exp(d * FRAC_PI_2)) + e * cos * cos
    };
    gradation(zenith_angle) * indicatrix(to_sun) / (gradation(0.0) * indicatrix(sun))
}

/// Of the zenith, cd·m⁻²: `gensky`'s formulas for overcast, intermediate and clear skies.
pub(super) fn zenith(number: u8, altitude: f64, turbidity: f64) -> f64 {
    let overcast = 8.6 * libm::sin(altitude) + 0.123;
    let clear = (1.376 * turbidity - 1.81) * libm::tan(altitude) + 0.38;
    let thousands = if number <= OVERCAST {
        overcast
    } else if number <= INTERMEDIATE {
        (overcast + clear) / 2.0
    } else {
        clear
    };
    1000.0 * thousands.max(0.0)
}

/// How much of a clear sky's sun comes through.
pub(super) fn sun_share(number: u8) -> f64 {
    if number <= OVERCAST {
        0.0
    } else if number <= INTERMEDIATE {
        0.15
    } else {
        1.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// ISO 15469's standard clear sky (12) is CIE's clear sky of 1973: `(0.91 + 10 e^(−3χ) + 0.45 cos²χ) (1 − e^(−0.32/cos Z))`
    /// over the same at the zenith, whose last factor is 0.274: that of Radiance's `skybright.cal`.
    #[test]
    fn the_clear_sky_is_the_one_of_1973() {
        let old = |zenith_angle: f64, to_sun: f64, sun: f64| {
            let scatter = |angle: f64| 0.91 + 10.0 * (-3.0 * angle).exp() + 0.45 * angle.cos().powi(2);
            scatter(to_sun) * (1.0 - (-0.32 / zenith_angle.cos()).exp()) / (scatter(sun) * 0.274)
        };
        for (zenith_angle, to_sun, sun) in [(0.0, 0.7, 0.7), (0.5, 0.2, 0.7), (1.2, 1.9, 0.7), (1.5, 0.3, 1.3)] {
            let (new, old) = (relative(12, zenith_angle, to_sun, sun), old(zenith_angle, to_sun, sun));
            assert!((new / old - 1.0).abs() < 3e-3, "{zenith_angle} {to_sun} {sun}: {new}, {old}");
        }
    }

    /// ISO 15469, table 1: the steep overcast sky falls to a third at the horizon; the others by their gradation.
    #[test]
    fn overcast_skies_fall_towards_the_horizon() {
        let horizon = |number| relative(number, FRAC_PI_2 - 1e-6, 1.0, 1.0);
        let steep = 1.0 / (1.0 + 4.0 * (-0.7_f64).exp());
        assert!((horizon(1) - steep).abs() < 1e-9 && (steep - 0.335).abs() < 1e-3);
        assert!((horizon(3) - 1.0 / (1.0 + 1.1 * (-0.8_f64).exp())).abs() < 1e-9);
        assert_eq!(horizon(5), 1.0);
    }

    /// `gensky 6 21 12 -a 0`-like values by hand: kcd/m².
    #[test]
    fn zeniths_are_as_bright_as_gensky_makes_them() {
        let altitude = 30_f64.to_radians();
        assert!((zenith(1, altitude, 2.45) - 4423.0).abs() < 1e-6);
        assert!((zenith(12, altitude, 2.45) - 1281.36).abs() < 0.1, "{}", zenith(12, altitude, 2.45));
        assert!((zenith(8, altitude, 2.45) - (4423.0 + 1281.36) / 2.0).abs() < 0.1);
    }
}
