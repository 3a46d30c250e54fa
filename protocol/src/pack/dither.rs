//! Unbiased rounding: up with a probability equal to the fraction that is lost by rounding down.

/// One number in [0, 1) a pixel, from a key. The three channels of a pixel share it: each is
/// unbiased all the same, and grey stays grey, which compresses to a third.
#[derive(Clone, Copy)]
pub(super) struct Dither {
    key: u64,
}

impl Dither {
    /// Fields of one answer must round independently: their products are formed later.
    pub(super) fn new(key: u64, field: u64) -> Self {
        Self { key: mix(key ^ mix(field)) }
    }

    /// The threshold of a pixel: multiples of 2⁻²⁴ in [0, 1).
    pub(super) fn threshold(self, pixel: usize) -> f32 {
        const UNIT: f32 = 1.0 / (1 << 24) as f32;
        (mix(self.key.wrapping_add(pixel as u64)) >> 40) as f32 * UNIT
    }
}

/// Rounds a number ≥ 0 down, or up if the threshold lies below its fraction; integers stay.
pub(super) fn round(x: f32, threshold: f32) -> u32 {
    let down = x as u32;
    down + u32::from(threshold < x - down as f32)
}

/// A permutation of 64 bits that scatters (the finaliser of SplitMix64, Steele et al. 2014).
pub(super) fn mix(x: u64) -> u64 {
    let x = x.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ (x >> 31)
}
