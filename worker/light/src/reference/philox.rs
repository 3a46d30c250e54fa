//! Random numbers by counter: Philox 4×32-10 (Salmon, Moraes, Dror and Shaw, *Parallel Random Numbers:
//! As Easy as 1, 2, 3*, SC 2011).
//!
//! It has nothing in common with [`crate::sample`]: no sequence, no net, no scramble. Every sample of
//! every pixel has its own stream, addressed by (seed, pixel, sample); within a path the numbers are
//! drawn in turn.

/// The stream of one path.
pub struct Stream {
    key: [u32; 2],
    /// Pixel x, pixel y, sample, block.
    counter: [u32; 4],
    block: [u32; 4],
    used: usize,
}

impl Stream {
    /// The numbers of one sample of one pixel.
    pub fn new(seed: u64, [x, y]: [u32; 2], sample: u32) -> Self {
        Self { key: [seed as u32, (seed >> 32) as u32], counter: [x, y, sample, 0], block: [0; 4], used: 4 }
    }

    /// 32 random bits.
    pub fn bits(&mut self) -> u32 {
        if self.used == 4 {
            self.block = philox(self.key, self.counter);
            self.counter[3] = self.counter[3].wrapping_add(1);
            self.used = 0;
        }
        self.used += 1;
        self.block[self.used - 1]
    }

    /// Uniform in [0, 1): a multiple of 2⁻²⁴.
    pub fn unit(&mut self) -> f32 {
        (self.bits() >> 8) as f32 * (1.0 / 16_777_216.0)
    }

    /// Two of them, in order.
    pub fn pair(&mut self) -> [f32; 2] {
        [self.unit(), self.unit()]
    }
}

const MULTIPLIERS: [u32; 2] = [0xd251_1f53, 0xcd9e_8d57];
const WEYL: [u32; 2] = [0x9e37_79b9, 0xbb67_ae85];
const ROUNDS: u32 = 10;

fn philox(mut key: [u32; 2], mut counter: [u32; 4]) -> [u32; 4] {
    for _ in 0..ROUNDS {
        let [a, b] = [0, 1].map(|i| u64::from(MULTIPLIERS[i]) * u64::from(counter[2 * i]));
        counter = [(b >> 32) as u32 ^ counter[1] ^ key[0], b as u32, (a >> 32) as u32 ^ counter[3] ^ key[1], a as u32];
        key = [key[0].wrapping_add(WEYL[0]), key[1].wrapping_add(WEYL[1])];
    }
    counter
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The known answers that come with Random123, the authors' own library.
    #[test]
    fn it_gives_the_published_numbers() {
        let all = 0xffff_ffff;
        assert_eq!(philox([0; 2], [0; 4]), [0x6627_e8d5, 0xe169_c58d, 0xbc57_ac4c, 0x9b00_dbd8]);
        assert_eq!(philox([all; 2], [all; 4]), [0x408f_276d, 0x41c8_3b0e, 0xa20b_c7c6, 0x6d54_51fd]);
        let pi = [0x243f_6a88, 0x85a3_08d3, 0x1319_8a2e, 0x0370_7344];
        let answer = [0xd16c_fe09, 0x94fd_cceb, 0x5001_e420, 0x2412_6ea1];
        assert_eq!(philox([0xa409_3822, 0x299f_31d0], pi), answer);
    }

    #[test]
    fn a_stream_is_its_address() {
        let draw = |seed, pixel, sample| {
            let mut stream = Stream::new(seed, pixel, sample);
            [0; 9].map(|_| stream.bits())
        };
        assert_eq!(draw(5, [1, 2], 3), draw(5, [1, 2], 3));
        for other in [draw(6, [1, 2], 3), draw(5 | 1 << 40, [1, 2], 3), draw(5, [2, 1], 3), draw(5, [1, 2], 4)] {
            assert!(other.iter().zip(draw(5, [1, 2], 3)).all(|(a, b)| *a != b));
        }
    }
}
