//! Quasi-random numbers by address: a pure function of (seed, stage, dimension, index).
//!
//! One four-dimensional Sobol' sequence (Joe & Kuo's direction numbers) is padded to any number of
//! dimensions: each further group of four has its own scramble and its own shuffle of the index.
//! The shuffle is an Owen hash too, so it maps aligned power-of-two blocks of indices to such
//! blocks, and a light set that takes such a block stays a net (algorithms.md B8; Burley 2020;
//! Kollig & Keller 2001 for the padding).
//!
//! Groups are numbered **statically per stage**: leaving a stage out changes no number of another.

use glam::Vec3;
use protocol::question::Scramble;

/// What a random number is for. Stages never share numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stage {
    /// Points on lights.
    Lights = 1,
    /// Light paths that leave VPLs.
    Walk = 2,
    /// Photon paths.
    Photons = 3,
    /// Eye paths.
    Eye = 4,
    /// What compensates the bias of bounds.
    BiasCompensation = 5,
    /// Statistics gathered when a scene is prepared.
    Pilot = 6,
}

/// A randomised sequence of points of any dimension.
#[derive(Clone, Copy, Debug)]
pub struct Sequence {
    seed: u32,
    scramble: Scramble,
}

impl Sequence {
    /// The sequence of a stage; `address` tells apart what must be independent (replicate, pixel).
    pub fn new<const N: usize>(seed: u64, stage: Stage, address: [u32; N], scramble: Scramble) -> Self {
        let hash = mix(seed as u32 ^ mix((seed >> 32) as u32 ^ mix(stage as u32)));
        address.into_iter().fold(Self { seed: hash, scramble }, Self::with)
    }

    /// The sequence whose address goes on with `part`: `new(…, [a, b, c])` is `new(…, []).with(a).with(b).with(c)`.
    pub fn with(self, part: u32) -> Self {
        Self { seed: mix(self.seed ^ part).wrapping_add(0x9e37_79b9), ..self }
    }

    /// Dimensions `4·group .. 4·group + 4` of point `index`, each in [0, 1).
    pub fn point(&self, group: u32, index: u32) -> [f32; 4] {
        self.first(group, index)
    }

    /// The first `N ≤ 4` of these dimensions.
    pub fn first<const N: usize>(&self, group: u32, index: u32) -> [f32; N] {
        let seed = mix(self.seed ^ group.wrapping_mul(0x85eb_ca6b));
        match self.scramble {
            Scramble::Owen => {
                let shuffled = owen(index, mix(seed ^ 0x51ed_270b));
                let raw = sobol(shuffled);
                let mut numbers = [0.0; N];
                for (d, number) in numbers.iter_mut().enumerate() {
                    *number = unit(owen(raw[d], mix(seed.wrapping_add(d as u32 + 1))));
                }
                numbers
            }
            Scramble::Xor => {
                // The first group goes unshuffled, as in the paper; without a shuffle, later groups
                // would repeat the first one's numbers up to an XOR.
                let shuffled = if group == 0 { index } else { owen(index, mix(seed ^ 0x51ed_270b)) };
                let raw = sobol(shuffled);
                std::array::from_fn(|d| unit(raw[d] ^ mix(seed.wrapping_add(d as u32 + 1))))
            }
        }
    }
}

/// The number in [0, 1) by which chance decides at a surface that is something in part. It belongs to ray and triangle: a
/// shaft, a packet, and a single ray agree, and as no ray is traced twice, each decides anew, and anew at every surface.
pub fn chance(salt: u32, place: [u32; 2], ray: [Vec3; 2], [u, v]: [f32; 2]) -> f32 {
    let numbers = [ray[0].to_array(), ray[1].to_array(), [u, v, 0.0]];
    // There is only one zero; and the unit of length, a power of two, is in the exponents alone.
    let digits = numbers.into_iter().flatten().map(|number| (number + 0.0).to_bits() & 0x807f_ffff);
    let hash = place.into_iter().chain(digits).fold(salt, |hash, part| mix(hash ^ part).wrapping_add(0x9e37_79b9));
    unit(hash)
}

/// A good 32-bit mixing function (bijective; "lowbias32", C. Wellons).
pub fn mix(mut x: u32) -> u32 {
    x ^= x >> 16;
    x = x.wrapping_mul(0x7feb_352d);
    x ^= x >> 15;
    x = x.wrapping_mul(0x846c_a68b);
    x ^ (x >> 16)
}

/// Owen-scrambles the bits of `x` by a hash: each bit is flipped by a function of the bits above it
/// (Laine & Karras 2011, with the constants of Vegdahl 2021).
fn owen(x: u32, seed: u32) -> u32 {
    let mut x = x.reverse_bits();
    x ^= x.wrapping_mul(0x3d20_adea);
    x = x.wrapping_add(seed);
    x = x.wrapping_mul((seed >> 16) | 1);
    x ^= x.wrapping_mul(0x0552_6c56);
    x ^= x.wrapping_mul(0x53a2_2864);
    x.reverse_bits()
}

/// The top 24 bits as a number in [0, 1).
fn unit(bits: u32) -> f32 {
    (bits >> 8) as f32 * (1.0 / 16_777_216.0)
}

/// Four dimensions of the Sobol' sequence, byte by byte from tables.
fn sobol(index: u32) -> [u32; 4] {
    let mut point = [0; 4];
    for (table, byte) in TABLES.iter().zip(index.to_le_bytes()) {
        let part = table[usize::from(byte)];
        for d in 0..4 {
            point[d] ^= part[d];
        }
    }
    point
}

/// `TABLES[b][v]`: what byte number `b` of the index contributes when it has value `v`.
static TABLES: [[[u32; 4]; 256]; 4] = tables();

const fn tables() -> [[[u32; 4]; 256]; 4] {
    let directions = directions();
    let mut tables = [[[0; 4]; 256]; 4];
    let mut byte = 0;
    while byte < 4 {
        let mut value = 0;
        while value < 256 {
            let mut bit = 0;
            while bit < 8 {
                if value >> bit & 1 == 1 {
                    let mut d = 0;
                    while d < 4 {
                        tables[byte][value][d] ^= directions[d][8 * byte + bit];
                        d += 1;
                    }
                }
                bit += 1;
            }
            value += 1;
        }
        byte += 1;
    }
    tables
}

/// Direction numbers of the first four dimensions (Joe & Kuo 2008, new-joe-kuo-6).
const fn directions() -> [[u32; 32]; 4] {
    // degree s, polynomial a, initial numbers m
    const JOE_KUO: [(usize, u32, [u32; 3]); 3] = [(1, 0, [1, 0, 0]), (2, 1, [1, 3, 0]), (3, 1, [1, 3, 1])];
    let mut v = [[0; 32]; 4];
    let mut i = 0;
    while i < 32 {
        v[0][i] = 1 << (31 - i);
        i += 1;
    }
    let mut d = 0;
    while d < 3 {
        let (s, a, m) = JOE_KUO[d];
        let mut i = 0;
        while i < 32 {
            v[d + 1][i] = if i < s {
                m[i] << (31 - i)
            } else {
                let mut x = v[d + 1][i - s] ^ (v[d + 1][i - s] >> s);
                let mut k = 1;
                while k < s {
                    if a >> (s - 1 - k) & 1 == 1 {
                        x ^= v[d + 1][i - k];
                    }
                    k += 1;
                }
                x
            };
            i += 1;
        }
        d += 1;
    }
    v
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_sequence_begins_as_published() {
        // new-joe-kuo-6, first points in Gray-code-free order: 0, 1/2, …
        let at = |i: u32| sobol(i).map(|x| x as f64 / 4_294_967_296.0);
        assert_eq!(at(0), [0.0; 4]);
        assert_eq!(at(1), [0.5; 4]);
        assert_eq!(at(2), [0.25, 0.75, 0.75, 0.75]);
        assert_eq!(at(3), [0.75, 0.25, 0.25, 0.25]);
        assert_eq!(at(4), [0.125, 0.625, 0.375, 0.125]);
    }

    /// Every aligned block of 2^a points puts exactly one point into each of 2^a equal intervals.
    #[test]
    fn blocks_are_stratified_under_both_scrambles_and_in_every_group() {
        for scramble in [Scramble::Owen, Scramble::Xor] {
            let sequence = Sequence::new(7, Stage::Walk, [1, 2, 3], scramble);
            for group in [0, 1, 5] {
                for block in 0..4 {
                    for d in 0..4 {
                        let mut seen = [false; 64];
                        for i in 0..64 {
                            let x = sequence.point(group, block * 64 + i)[d];
                            seen[(x * 64.0) as usize] = true;
                        }
                        assert!(seen.iter().all(|s| *s), "{scramble:?} group {group} block {block} dimension {d}");
                    }
                }
            }
        }
    }

    #[test]
    fn groups_and_seeds_are_uncorrelated() {
        let covariance = |a: &dyn Fn(u32) -> f32, b: &dyn Fn(u32) -> f32| {
            (0..4096).map(|i| (a(i) - 0.5) * (b(i) - 0.5)).sum::<f32>() / 4096.0 * 12.0
        };
        for scramble in [Scramble::Owen, Scramble::Xor] {
            let s = Sequence::new(1, Stage::Eye, [0, 0, 0], scramble);
            let t = Sequence::new(2, Stage::Eye, [0, 0, 0], scramble);
            assert!(covariance(&|i| s.point(0, i)[0], &|i| s.point(1, i)[0]).abs() < 0.06);
            assert!(covariance(&|i| s.point(2, i)[1], &|i| s.point(3, i)[1]).abs() < 0.06);
            if scramble == Scramble::Owen {
                assert!(covariance(&|i| s.point(0, i)[0], &|i| t.point(0, i)[0]).abs() < 0.06);
            }
        }
    }

    #[test]
    fn a_joined_sequence_beats_independent_sets() {
        // IGI-11: nine consecutive blocks of 16 integrate a smooth function better than nine
        // independently randomised ones.
        let f = |p: [f32; 4]| p.iter().map(|x| f64::from(*x) * 2.0).product::<f64>();
        let rms = |estimate: &dyn Fn(u64) -> f64| {
            ((0..64).map(|seed| (estimate(seed) - 1.0).powi(2)).sum::<f64>() / 64.0).sqrt()
        };
        let joined = rms(&|seed| {
            let s = Sequence::new(seed, Stage::Walk, [0; 3], Scramble::Owen);
            (0..144).map(|i| f(s.point(0, i))).sum::<f64>() / 144.0
        });
        let apart = rms(&|seed| {
            (0..9)
                .flat_map(|k| {
                    let s = Sequence::new(seed, Stage::Walk, [k, 1, 0], Scramble::Owen);
                    (0..16).map(move |i| f(s.point(0, i)))
                })
                .sum::<f64>()
                / 144.0
        });
        assert!(joined < 0.7 * apart, "joined {joined} apart {apart}");
    }
}
