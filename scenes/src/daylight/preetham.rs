//! Preetham, Shirley & Smits 1999, "A Practical Analytic Model for Daylight", appendix A.2: luminance and chromaticity by
//! Perez' five-parameter formula, whose parameters are linear in turbidity.

use std::f64::consts::PI;

/// Slope and intercept of A … E over turbidity.
type Lines = [[f64; 2]; 5];

const LUMINANCE: Lines =
    [[0.1787, -1.4630], [-0.3554, 0.4275], [-0.0227, 5.3251], [0.1206, -2.5771], [-0.0670, 0.3703]];
const X: Lines = [[-0.0193, -0.2592], [-0.0665, 0.0008], [-0.0004, 0.2125], [-0.0641, -0.8989], [-0.0033, 0.0452]];
const Y: Lines = [[-0.0167, -0.2608], [-0.0950, 0.0092], [-0.0079, 0.2102], [-0.0441, -1.6537], [-0.0109, 0.0529]];

/// The zenith's chromaticity: rows by falling powers of turbidity, columns by those of the sun's angle from the zenith.
type Cubics = [[f64; 4]; 3];

const ZENITH_X: Cubics =
    [[0.00166, -0.00375, 0.00209, 0.0], [-0.02903, 0.06377, -0.03202, 0.00394], [0.11693, -0.21196, 0.06052, 0.25886]];
const ZENITH_Y: Cubics =
    [[0.00275, -0.00610, 0.00317, 0.0], [-0.04214, 0.08970, -0.04153, 0.00516], [0.15346, -0.26756, 0.06670, 0.26688]];

/// Luminance of the zenith, cd·m⁻², with the sun so far from it, rad.
pub(super) fn zenith(turbidity: f64, sun: f64) -> f64 {
    let chi = (4.0 / 9.0 - turbidity / 120.0) * (PI - 2.0 * sun);
    1000.0 * ((4.0453 * turbidity - 4.9710) * libm::tan(chi) - 0.2155 * turbidity + 2.4192).max(0.0)
}

/// Luminance of a direction beside the zenith's; angles from the zenith, from the sun, and between these, rad.
pub(super) fn relative(turbidity: f64, zenith_angle: f64, to_sun: f64, sun: f64) -> f64 {
    perez(&LUMINANCE, turbidity, zenith_angle, to_sun) / perez(&LUMINANCE, turbidity, 0.0, sun)
}

/// CIE 1931 xy of a direction.
pub(super) fn chromaticity(turbidity: f64, zenith_angle: f64, to_sun: f64, sun: f64) -> [f64; 2] {
    let part = |lines: &Lines, zenith: &Cubics| {
        let at_zenith = [turbidity * turbidity, turbidity, 1.0]
            .iter()
            .zip(zenith)
            .map(|(power, [a, b, c, d])| power * (((a * sun + b) * sun + c) * sun + d))
            .sum::<f64>();
        at_zenith * perez(lines, turbidity, zenith_angle, to_sun) / perez(lines, turbidity, 0.0, sun)
    };
    [part(&X, &ZENITH_X), part(&Y, &ZENITH_Y)]
}

/// What is left of sunlight of three wavelengths, red to blue, that comes so far from the zenith, rad: Rayleigh's scattering
/// and Ångström's of haze (appendix A.1; Iqbal 1983).
pub(super) fn sunlight_left(turbidity: f64, sun: f64) -> [f64; 3] {
    let haze = 0.046_083_6 * turbidity - 0.045_860_25;
    let air_mass = 1.0 / (libm::cos(sun) + 0.15 * libm::pow(93.885 - sun.to_degrees(), -1.253));
    // Micrometres: about where the primaries of Rec. 709 have their dominant wavelengths.
    [0.611, 0.549, 0.464].map(|wavelength| {
        let rayleigh = 0.008_735 * libm::pow(wavelength, -4.08);
        let angstrom = haze * libm::pow(wavelength, -1.3);
        libm::exp(-(rayleigh + angstrom) * air_mass)
    })
}

fn perez(lines: &Lines, turbidity: f64, zenith_angle: f64, to_sun: f64) -> f64 {
    let [a, b, c, d, e] = lines.map(|[slope, intercept]| slope * turbidity + intercept);
    let cos = libm::cos(to_sun);
    (1.0 + a * libm::exp(b / libm::cos(zenith_angle))) * (1.0 + c * libm::exp(d * to_sun) + e * cos * cos)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The zenith under turbidity 2.2, sun at 45° (the paper's figure of zenith values, and its formulas by hand).
    #[test]
    fn the_zenith_is_as_published() {
        let sun = PI / 4.0;
        let chi: f64 = (4.0 / 9.0 - 2.2 / 120.0) * PI / 2.0;
        let expected = (4.0453 * 2.2 - 4.9710) * chi.tan() - 0.2155 * 2.2 + 2.4192;
        assert!((zenith(2.2, sun) / 1000.0 - expected).abs() < 1e-9 && (expected - 5.01).abs() < 0.1, "{expected}");
        let [x, y] = chromaticity(2.2, 0.0, sun, sun);
        assert!((0.23..0.27).contains(&x) && (0.23..0.28).contains(&y), "a blue sky: {x} {y}");
    }

    #[test]
    fn the_sky_is_brightest_about_the_sun() {
        let sun = 0.8;
        assert!(relative(3.0, sun, 0.0, sun) > 5.0 * relative(3.0, sun, 1.5, sun));
        assert_eq!(relative(3.0, 0.0, sun, sun), 1.0);
    }
}
