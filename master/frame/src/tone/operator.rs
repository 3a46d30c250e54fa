//! Tone curves.

use glam::{Mat3, Vec3};
use serde::{Deserialize, Serialize};

use super::exposure::luminance;
use super::srgb::SrgbEncoder;

/// How radiance above white, and all below it, is fitted onto a screen.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
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
    /// The codes of radiance, with the widest vectors that the machine has. They compute the same bits: no
    /// operation is fused or reordered.
    pub(super) fn develop(self, radiance: &[Vec3], scale: f32, encoder: &SrgbEncoder, codes: &mut [[u8; 3]]) {
        #[cfg(target_arch = "x86_64")]
        {
            /// The same source, compiled for wider vectors.
            #[target_feature(enable = "avx2")]
            fn wide(operator: Operator, radiance: &[Vec3], scale: f32, encoder: &SrgbEncoder, codes: &mut [[u8; 3]]) {
                operator.develop_blocks(radiance, scale, encoder, codes);
            }
            if std::arch::is_x86_feature_detected!("avx2") {
                // SAFETY: the machine has just said that it has AVX2.
                return unsafe { wide(self, radiance, scale, encoder, codes) };
            }
        }
        self.develop_blocks(radiance, scale, encoder, codes);
    }

    #[inline(always)]
    fn develop_blocks(self, radiance: &[Vec3], scale: f32, encoder: &SrgbEncoder, codes: &mut [[u8; 3]]) {
        // AgX ends in display values: its curve is the display's encoding as well.
        let plain = |value: f32| (value.clamp(0.0, 1.0) * 255.0 + 0.5) as u8;
        let srgb = |value: f32| encoder.encode(value);
        match self {
            Self::None => blocks(radiance, scale, codes, |colour| colour, srgb),
            Self::Reinhard => blocks(radiance, scale, codes, reinhard, srgb),
            Self::Aces => blocks(radiance, scale, codes, aces, srgb),
            Self::Agx => blocks(radiance, scale, codes, agx, plain),
        }
    }
}

/// Curves and encodes a block of pixels at a time, so that curves become vector code.
#[inline(always)]
fn blocks(
    radiance: &[Vec3],
    scale: f32,
    codes: &mut [[u8; 3]],
    curve: impl Fn(Vec3) -> Vec3,
    encode: impl Fn(f32) -> u8,
) {
    for (radiance, codes) in radiance.chunks(BLOCK).zip(codes.chunks_mut(BLOCK)) {
        let [mut red, mut green, mut blue] = [[0.0; BLOCK]; 3];
        for (i, value) in radiance.iter().enumerate() {
            [red[i], green[i], blue[i]] = value.to_array();
        }
        for i in 0..BLOCK {
            // What is no number is black; what is infinite is very bright.
            let exposed = |value: f32| if value * scale > 0.0 { (value * scale).min(BRIGHTEST) } else { 0.0 };
            let colour = Vec3::new(exposed(red[i]), exposed(green[i]), exposed(blue[i]));
            [red[i], green[i], blue[i]] = curve(colour).to_array();
        }
        for (i, code) in codes.iter_mut().enumerate() {
            *code = [encode(red[i]), encode(green[i]), encode(blue[i])];
        }
    }
}

/// Pixels that are developed at once.
const BLOCK: usize = 16;
/// Keeps sums and squares in the curves finite.
const BRIGHTEST: f32 = 1e9;

#[inline(always)]
fn reinhard(colour: Vec3) -> Vec3 {
    let l = luminance(colour);
    colour * ((1.0 + l / (REINHARD_WHITE * REINHARD_WHITE)) / (1.0 + l))
}

#[inline(always)]
fn aces(colour: Vec3) -> Vec3 {
    let v = ACES_FROM_REC709 * colour;
    let low = v * (v + 0.024_578_6) - 0.000_090_537;
    let high = v * (0.983_729 * v + 0.432_951) + 0.238_081;
    REC709_FROM_ACES * (low / high)
}

#[inline(always)]
fn agx(colour: Vec3) -> Vec3 {
    let inset = AGX_INSET * colour;
    let stops = Vec3::new(log2(inset.x), log2(inset.y), log2(inset.z));
    let x = (stops - AGX_LOWEST_STOP) / (AGX_HIGHEST_STOP - AGX_LOWEST_STOP);
    let x = x.max(Vec3::ZERO).min(Vec3::ONE);
    let x2 = x * x;
    let x4 = x2 * x2;
    let curve = 15.5 * x4 * x2 - 40.14 * x4 * x + 31.96 * x4 - 6.868 * x2 * x + 0.429_8 * x2 + 0.119_1 * x - 0.002_32;
    AGX_OUTSET * curve
}

/// log₂ of a number ≥ 0, error below 10⁻⁶; about −127 at 0. Plain arithmetic: fast, and the same
/// bits everywhere.
#[inline(always)]
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
        let grey = |operator: Operator| {
            let mut codes = [[0; 3]];
            operator.develop(&[Vec3::splat(0.18)], 1.0, &encoder, &mut codes);
            codes[0][1]
        };
        assert_eq!(grey(Operator::None), 118);
        assert!((95..=135).contains(&grey(Operator::Reinhard)), "{}", grey(Operator::Reinhard));
        assert!((85..=135).contains(&grey(Operator::Aces)), "{}", grey(Operator::Aces));
        assert!((105..=135).contains(&grey(Operator::Agx)), "{}", grey(Operator::Agx));
    }
}
