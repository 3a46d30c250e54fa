//! From radiometric to photometric figures, and back.
//!
//! A scene's light is in watts in three channels. Photometric figures count a watt of the channels' luminance as a watt
//! of green light, which the definition of the candela makes 683 lumens: so that what a file gives in candela or lux
//! reads the same on a meter, and a colour shifts only the shares of the channels.

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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_watt_of_grey_is_683_lumens_and_candela_come_back() {
        assert_eq!(photometric(Rgb::ONE), LUMENS_PER_WATT);
        assert!((photometric(radiometric(100.0, Rgb::ONE)) - 100.0).abs() < 1e-3);
        assert!((photometric(radiometric(100.0, Rgb::X)) - 21.26).abs() < 1e-3);
    }
}
