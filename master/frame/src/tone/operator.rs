//! Tone curves.

use glam::{Mat3, Vec3};

use super::exposure::luminance;
use super::srgb::SrgbEncoder;

/// How radiance above white, and all below it, is fitted onto a screen.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Operator {
    /// Clips at 1. What is below is shown exactly: for comparing.
    None,
    /// Reinhard et al. 2002 (equation 4) on luminance, white at 4: keeps hues, low contrast.
    Reinhard,
    /// Stephen Hill's fit of the ACES reference and output transforms: contrasty, hues shift to
    /// yellow and magenta where it is bright.
    Aces,
    /// Troy Sobotka's AgX, base look, in Benjamin Wrensch's fit: bright colours fade to white as on
    /// film.
    Agx,
}

impl Operator {
    /// The code of a colour whose components are finite and not negative.
    #[inline]
    pub(super) fn encode(self, colour: Vec3, encoder: &SrgbEncoder) -> [u8; 3] {
        let srgb = |linear: Vec3| linear.to_array().map(|value| encoder.encode(value));
        match self {
            Self::None => srgb(colour),
            Self::Reinhard => srgb(reinhard(colour)),
            Self::Aces => srgb(aces(colour)),
            // AgX ends in display values: its curve is the display's encoding as well.
            Self::Agx => agx(colour).to_array().map(|value| (value.clamp(0.0, 1.0) * 255.0 + 0.5) as u8),
        }
    }
}

fn reinhard(colour: Vec3) -> Vec3 {
    let l = luminance(colour);
    colour * ((1.0 + l / (REINHARD_WHITE * REINHARD_WHITE)) / (1.0 + l))
}

fn aces(colour: Vec3) -> Vec3 {
    let v = ACES_FROM_REC709 * colour;
    let low = v * (v + 0.024_578_6) - 0.000_090_537;
    let high = v * (0.983_729 * v + 0.432_951) + 0.238_081;
    REC709_FROM_ACES * (low / high)
}

fn agx(colour: Vec3) -> Vec3 {
    let inset = AGX_INSET * colour;
    let stops = Vec3::new(log2(inset.x), log2(inset.y), log2(inset.z));
    let x = ((stops - AGX_LOWEST_STOP) / (AGX_HIGHEST_STOP - AGX_LOWEST_STOP)).clamp(Vec3::ZERO, Vec3::ONE);
    let x2 = x * x;
    let x4 = x2 * x2;
    let curve = 15.5 * x4 * x2 - 40.14 * x4 * x + 31.96 * x4 - 6.868 * x2 * x + 0.429_8 * x2 + 0.119_1 * x - 0.002_32;
    AGX_OUTSET * curve
}

/// log₂ of a number ≥ 0, error below 10⁻⁶; about −127 at 0. Plain arithmetic: fast, and the same
/// bits everywhere.
#[inline]
pub(super) fn log2(x: f32) -> f32 {
    // Split into 2^exponent · mantissa with the mantissa in [√½, √2).
    let bits = x.max(f32::MIN_POSITIVE).to_bits();
    let shifted = bits.wrapping_sub(SQRT_HALF_BITS);
    let exponent = (shifted as i32) >> 23;
    let mantissa = f32::from_bits((shifted & 0x007f_ffff) + SQRT_HALF_BITS);
    // ln m = 2·artanh t, t = (m − 1) / (m + 1), |t| < 0.172.
    let t = (mantissa - 1.0) / (mantissa + 1.0);
    let t2 = t * t;
    let artanh = t * (1.0 + t2 * (1.0 / 3.0 + t2 * (0.2 + t2 * (1.0 / 7.0 + t2 * (1.0 / 9.0)))));
    exponent as f32 + artanh * (2.0 * std::f32::consts::LOG2_E)
}

const SQRT_HALF_BITS: u32 = 0x3f35_04f3;
const REINHARD_WHITE: f32 = 4.0;

const ACES_FROM_REC709: Mat3 = Mat3::from_cols(
    Vec3::new(0.597_19, 0.076, 0.028_4),
    Vec3::new(0.354_58, 0.908_34, 0.133_83),
    Vec3::new(0.048_23, 0.015_66, 0.837_77),
);
const REC709_FROM_ACES: Mat3 = Mat3::from_cols(
    Vec3::new(1.604_75, -0.102_08, -0.003_27),
    Vec3::new(-0.531_08, 1.108_13, -0.072_76),
    Vec3::new(-0.073_67, -0.006_05, 1.076_02),
);

const AGX_INSET: Mat3 = Mat3::from_cols(
    Vec3::new(0.842_479_1, 0.042_328_242, 0.042_375_655),
    Vec3::new(0.078_433_6, 0.878_468_6, 0.078_433_6),
    Vec3::new(0.079_223_745, 0.079_166_13, 0.879_143),
);
const AGX_OUTSET: Mat3 = Mat3::from_cols(
    Vec3::new(1.196_879, -0.052_896_85, -0.052_971_635),
    Vec3::new(-0.098_020_88, 1.151_903_1, -0.098_043_45),
    Vec3::new(-0.099_029_74, -0.098_961_18, 1.151_073_7),
);
const AGX_LOWEST_STOP: f32 = -12.473_93;
const AGX_HIGHEST_STOP: f32 = 4.026_069;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn log2_is_right_to_a_millionth() {
        let mut x = 1e-37f32;
        while x < 1e37 {
            let exact = libm::log2(f64::from(x));
            let error = (f64::from(log2(x)) - exact).abs();
            assert!(error < 1e-6 * exact.abs().max(1.0), "{x}: {error}");
            x *= 1.0317;
        }
    }

    #[test]
    fn middle_grey_stays_in_the_middle() {
        let encoder = SrgbEncoder::new();
        let grey = |operator: Operator| operator.encode(Vec3::splat(0.18), &encoder)[1];
        assert_eq!(grey(Operator::None), 118);
        assert!((95..=135).contains(&grey(Operator::Reinhard)), "{}", grey(Operator::Reinhard));
        assert!((85..=135).contains(&grey(Operator::Aces)), "{}", grey(Operator::Aces));
        assert!((105..=135).contains(&grey(Operator::Agx)), "{}", grey(Operator::Agx));
    }
}
