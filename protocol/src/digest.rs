//! Telling answers apart by a few bytes.
//!
//! A [`Key`] makes a number of any bytes: a polynomial with them as coefficients, at a secret place, modulo 2⁶¹ − 1
//! (Carter and Wegman, *Universal Classes of Hash Functions*, 1979). Whoever does not know the place cannot make two
//! different answers of n bytes that have the same number but by a chance of n / 2⁶³: one in 10¹² for a megabyte. It costs a
//! multiplication every seven bytes: two gigabytes a second.

/// A secret place x: 0 < x < 2⁶¹ − 1; its first powers.
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct Key([u64; LANES]);

/// 2⁶¹ − 1, a prime.
const PRIME: u64 = (1 << 61) - 1;
/// Bytes of a coefficient: the most that are always below [`PRIME`].
const STEP: usize = 7;
/// Coefficients that are taken at once, so that one multiplication need not wait for the other.
const LANES: usize = 4;

impl Key {
    /// A key of random bits.
    pub fn new(random: u64) -> Self {
        let x = 1 + random % (PRIME - 1);
        let mut powers = [x; LANES];
        for i in 1..LANES {
            powers[i] = folded(u128::from(powers[i - 1]) * u128::from(x));
        }
        Self(powers)
    }

    /// The number of some bytes, below 2⁶¹.
    pub fn digest(self, bytes: &[u8]) -> u64 {
        let [x, x2, x3, x4] = self.0.map(u128::from);
        // Their length comes first, so that zeros at the end count.
        let mut sum = bytes.len() as u64 % PRIME;
        let mut blocks = bytes.chunks_exact(LANES * STEP);
        for block in blocks.by_ref() {
            let at = |i: usize| coefficient(&block[i * STEP..(i + 1) * STEP]);
            sum = folded(u128::from(sum) * x4 + at(0) * x3 + at(1) * x2 + at(2) * x + at(3));
        }
        blocks.remainder().chunks(STEP).fold(sum, |sum, step| folded(u128::from(sum) * x + coefficient(step)))
    }
}

/// At most [`STEP`] bytes as a number.
fn coefficient(step: &[u8]) -> u128 {
    let mut word = [0; 8];
    word[..step.len()].copy_from_slice(step);
    u64::from_le_bytes(word).into()
}

/// What is left of it modulo [`PRIME`]; it is below 2¹²⁴.
fn folded(value: u128) -> u64 {
    // 2⁶¹ is 1: the upper bits are added to the lower ones. There are so many that this is to be done twice.
    let once = (value as u64 & PRIME) + (value >> 61) as u64;
    let twice = (once & PRIME) + (once >> 61);
    if twice >= PRIME { twice - PRIME } else { twice }
}

/// A secret is not printed.
impl std::fmt::Debug for Key {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Key(…)")
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// By the schoolbook, number by number.
    fn plain(x: u128, bytes: &[u8]) -> u128 {
        let next = |sum: u128, step: &[u8]| (sum * x + coefficient(step)) % u128::from(PRIME);
        bytes.chunks(STEP).fold(bytes.len() as u128, next)
    }

    #[test]
    fn it_is_the_polynomial() {
        let bytes: Vec<u8> = (0..200_u8).map(|i| i.wrapping_mul(151) ^ 0xa5).collect();
        for random in [0, 1, 1 << 40, PRIME - 2, PRIME - 1, u64::MAX] {
            let key = Key::new(random);
            for length in 0..bytes.len() {
                let (digest, x) = (key.digest(&bytes[..length]), u128::from(key.0[0]));
                assert_eq!(u128::from(digest), plain(x, &bytes[..length]), "{random}, {length} bytes");
            }
            let full = [0xff; 57];
            assert_eq!(u128::from(key.digest(&full)), plain(u128::from(key.0[0]), &full));
        }
    }

    proptest! {
        #[test]
        fn a_flipped_bit_a_cut_and_a_zero_more_are_told(
            bytes in prop::collection::vec(any::<u8>(), 1..200), bit in any::<prop::sample::Index>(), random in any::<u64>(),
        ) {
            let key = Key::new(random);
            let digest = key.digest(&bytes);
            prop_assert_eq!(digest, key.digest(&bytes.clone()));
            let mut other = bytes.clone();
            let bit = bit.index(8 * other.len());
            other[bit / 8] ^= 1 << (bit % 8);
            prop_assert_ne!(digest, key.digest(&other));
            prop_assert_ne!(digest, key.digest(&bytes[..bytes.len() - 1]));
            prop_assert_ne!(digest, key.digest(&[&bytes[..], &[0]].concat()));
            prop_assert_ne!(digest, Key::new(random ^ 1 << 50).digest(&bytes));
        }
    }
}
