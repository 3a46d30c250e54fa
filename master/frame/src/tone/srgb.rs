//! The sRGB transfer function (IEC 61966-2-1), exact to the last of 8 bits.

/// Linear value of an sRGB-encoded one, 0..=1.
pub fn linear_from_srgb(encoded: f64) -> f64 {
    if encoded <= 0.040_45 { encoded / 12.92 } else { libm::pow((encoded + 0.055) / 1.055, 2.4) }
}

/// Encodes linear values by look-up, correctly rounded.
#[derive(Clone, Debug)]
pub struct SrgbEncoder {
    /// Code of the smallest value in each of many equal bins.
    first: [u8; BINS + 1],
    /// Smallest value that is encoded as at least `code`; beyond the last: infinity.
    threshold: [f32; 257],
}

impl SrgbEncoder {
    /// Computes the tables: 255 powers.
    #[expect(clippy::new_without_default, reason = "tables are computed, not defaulted")]
    pub fn new() -> Self {
        let mut threshold = [f32::INFINITY; 257];
        threshold[0] = 0.0;
        for (code, value) in threshold.iter_mut().enumerate().take(256).skip(1) {
            *value = linear_from_srgb((code as f64 - 0.5) / 255.0) as f32;
        }
        let mut first = [0; BINS + 1];
        let mut code = 0;
        for (bin, first) in first.iter_mut().enumerate() {
            while threshold[code + 1] <= bin as f32 / BINS as f32 {
                code += 1;
            }
            *first = code as u8;
        }
        Self { first, threshold }
    }

    /// The code of a linear value; outside 0..=1 it is clipped, and NaN is 0.
    #[inline]
    pub fn encode(&self, linear: f32) -> u8 {
        let linear = if linear > 0.0 { linear.min(1.0) } else { 0.0 };
        let code = self.first[((linear * BINS as f32) as usize).min(BINS)];
        // The curve is nowhere steeper than 12.92·255 codes a unit: at most one threshold a bin.
        code + u8::from(linear >= self.threshold[usize::from(code) + 1])
    }
}

const BINS: usize = 4096;

#[cfg(test)]
mod tests {
    use super::*;

    fn srgb_from_linear(linear: f64) -> f64 {
        if linear <= 0.003_130_8 { 12.92 * linear } else { 1.055 * libm::pow(linear, 1.0 / 2.4) - 0.055 }
    }

    #[test]
    fn codes_are_correctly_rounded_everywhere() {
        let encoder = SrgbEncoder::new();
        for step in 0..=1_000_000 {
            let linear = (step as f32) / 1e6;
            let exact = srgb_from_linear(f64::from(linear)) * 255.0;
            let code = f64::from(encoder.encode(linear));
            assert!((code - exact).abs() <= 0.5 + 1e-4, "{linear}: {code} for {exact}");
        }
    }

    #[test]
    fn every_code_survives_decoding_and_encoding() {
        let encoder = SrgbEncoder::new();
        for code in 0..=255u8 {
            assert_eq!(encoder.encode(linear_from_srgb(f64::from(code) / 255.0) as f32), code);
        }
    }

    #[test]
    fn odd_values_are_clipped() {
        let encoder = SrgbEncoder::new();
        let codes = [f32::NAN, -1.0, f32::NEG_INFINITY, 2.0, f32::INFINITY].map(|value| encoder.encode(value));
        assert_eq!(codes, [0, 0, 0, 255, 255]);
    }
}
