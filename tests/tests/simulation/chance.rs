//! Random numbers that are addressed by seed and number, so that a story can be told again.

#[derive(Clone, Debug)]
pub struct Chance {
    seed: u64,
    draws: u64,
}

impl Chance {
    pub fn new(seed: u64) -> Self {
        Self { seed: mix(seed), draws: 0 }
    }

    /// Another sequence for each number, whatever was drawn before.
    pub fn of(&self, number: u64) -> Self {
        Self::new(self.seed ^ mix(!number))
    }

    /// A number in 0..below.
    pub fn draw(&mut self, below: u64) -> u64 {
        self.draws += 1;
        mix(self.seed ^ self.draws) % below.max(1)
    }

    pub fn between(&mut self, low: u64, high: u64) -> u64 {
        low + self.draw(high - low)
    }

    /// True so many times of a thousand.
    pub fn per_mille(&mut self, share: u64) -> bool {
        share > 0 && self.draw(1000) < share
    }
}

/// The finaliser of SplitMix64 (Steele et al. 2014).
fn mix(x: u64) -> u64 {
    let x = x.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ (x >> 31)
}
