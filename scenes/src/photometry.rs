//! From radiometric to photometric figures, and back; and colours of light.
//!
//! A scene's light is in watts in three channels. Photometric figures count a watt of the channels' luminance as a watt
//! of green light, which the definition of the candela makes 683 lumens: so that what a file gives in candela or lux
//! reads the same on a meter, and a colour shifts only the shares of the channels.

use glam::{DMat3, DVec3};

use crate::Rgb;

/// Luminous efficacy of radiation of 540 THz (555 nm), lm/W: BIPM, The International System of Units, 9th edition, 2.2.
pub const LUMENS_PER_WATT: f32 = 683.0;

/// Relative luminance of linear Rec. 709 (ITU-R BT.709-6, 3.2).
const LUMINANCE: Rgb = Rgb::new(0.2126, 0.7152, 0.0722);

/// Candela of W·sr⁻¹, candela per square metre of W·m⁻²·sr⁻¹, lux of W·m⁻².
pub fn photometric(radiometric: Rgb) -> f32 {
    LUMENS_PER_WATT * radiometric.dot(LUMINANCE)
}

/// W·sr⁻¹ of candela, W·m⁻² of lux, of a light of linear colour. White of 1 is what the figure says; other colours are
/// as bright as their luminance beside white's.
pub fn radiometric(figure: f32, colour: Rgb) -> Rgb {
    colour * figure / LUMENS_PER_WATT
}

/// Relative luminance of a linear colour; white's is 1.
pub fn luminance(colour: DVec3) -> f64 {
    colour.dot(LUMINANCE.as_dvec3())
}

/// Temperatures that [`planck`] knows, K.
pub const KELVIN: [f64; 2] = [1667.0, 25_000.0];

/// CIE 1931 xy of a black body of so many kelvin, to 0.001; `None` beyond [`KELVIN`]. Kim et al. 2002, "Design of advanced
/// color temperature control system for HDTV applications", J. Korean Phys. Soc. 41, 865.
pub fn planck(kelvin: f64) -> Option<[f64; 2]> {
    if !(KELVIN[0]..=KELVIN[1]).contains(&kelvin) {
        return None;
    }
    let inverse = 1e3 / kelvin;
    let cubic = |[a, b, c, d]: [f64; 4], x: f64| ((a * x + b) * x + c) * x + d;
    let x = match kelvin {
        ..=4000.0 => cubic([-0.266_123_9, -0.234_358_9, 0.877_695_6, 0.179_910], inverse),
        _ => cubic([-3.025_846_9, 2.107_037_9, 0.222_634_7, 0.240_390], inverse),
    };
    let y = match kelvin {
        ..=2222.0 => cubic([-1.106_381_4, -1.348_110_20, 2.185_558_32, -0.202_196_83], x),
        ..=4000.0 => cubic([-0.954_947_6, -1.374_185_93, 2.091_370_15, -0.167_488_67], x),
        _ => cubic([3.081_758_0, -5.873_386_70, 3.751_129_97, -0.370_014_83], x),
    };
    Some([x, y])
}

/// The linear Rec. 709 colour of luminance 1 and of a CIE 1931 chromaticity. What those primaries cannot mix has the nearest
/// colour that leaves no channel negative. `None` for no chromaticity.
pub fn of_chromaticity([x, y]: [f64; 2]) -> Option<DVec3> {
    let is_one = x.is_finite() && y.is_finite() && x >= 0.0 && y > 1e-3 && x + y <= 1.0;
    if !is_one {
        return None;
    }
    let colour = (rgb_from_xyz() * DVec3::new(x / y, 1.0, (1.0 - x - y) / y)).max(DVec3::ZERO);
    let luminance = luminance(colour);
    (luminance > 0.0).then(|| colour / luminance)
}

/// From CIE XYZ to linear Rec. 709: the inverse of what its primaries and its white, D65, say (BT.709-6, 1.3 and 1.4).
pub fn rgb_from_xyz() -> DMat3 {
    let xyz = |[x, y]: [f64; 2]| DVec3::new(x / y, 1.0, (1.0 - x - y) / y);
    let primaries = DMat3::from_cols(xyz([0.64, 0.33]), xyz([0.30, 0.60]), xyz([0.15, 0.06]));
    let white = xyz([0.3127, 0.3290]);
    (primaries * DMat3::from_diagonal(primaries.inverse() * white)).inverse()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_watt_of_grey_is_683_lumens_and_candela_come_back() {
        assert_eq!(photometric(Rgb::ONE), LUMENS_PER_WATT);
        assert!((photometric(radiometric(100.0, Rgb::ONE)) - 100.0).abs() < 1e-3);
        assert!((photometric(radiometric(100.0, Rgb::X)) - 21.26).abs() < 1e-3);
    }

    /// Of Planck's law and the CIE 1931 observer (CIE 15:2018; 2856 K is illuminant A).
    #[test]
    fn black_bodies_have_their_chromaticities() {
        for (kelvin, x, y) in
            [(2000.0, 0.5267, 0.4133), (2856.0, 0.4476, 0.4074), (4000.0, 0.3805, 0.3768), (6500.0, 0.3135, 0.3237)]
        {
            let [found_x, found_y] = planck(kelvin).unwrap();
            assert!((found_x - x).abs() < 1e-3 && (found_y - y).abs() < 1e-3, "{kelvin} K: {found_x} {found_y}");
        }
        assert_eq!((planck(1000.0), planck(f64::NAN)), (None, None));
    }

    #[test]
    fn white_is_white_and_what_no_screen_shows_is_not_negative() {
        let white = of_chromaticity([0.3127, 0.3290]).unwrap();
        assert!((white - DVec3::ONE).length() < 1e-3, "{white}");
        let green = of_chromaticity([0.08, 0.83]).unwrap();
        assert!(green.min_element() == 0.0 && (luminance(green) - 1.0).abs() < 1e-12, "{green}");
        assert_eq!((of_chromaticity([0.5, 0.6]), of_chromaticity([0.3, 0.0])), (None, None));
    }
}
