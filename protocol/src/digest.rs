//! Telling answers apart by a few bytes.
//!
//! A [`Key`] makes a number of any bytes: a polynomial with them as coefficients, at a secret place, modulo 2⁶¹ − 1
//! (Carter and Wegman, *Universal Classes of Hash Functions*, 1979). Whoever does not know the place cannot make two
//! different answers of n bytes that have the same number but by a chance of n / 2⁶³: one in 10¹² for a megabyte. It costs a
//! multiplication every seven bytes.

/// A secret place: 0 < x < 2⁶¹ − 1.
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct Key(u64);

/// 2⁶¹ − 1, a prime.
const PRIME: u64 = (1 << 61) - 1;
/// Bytes of a coefficient: the most that are always below [`PRIME`].
const STEP: usize = 7;

impl Key {
    /// A key of random bits.
    pub fn new(random: u64) -> Self {
        Self(1 + random % (PRIME - 1))
    }

    /// The number of some bytes, below 2⁶¹.
    pub fn digest(self, bytes: &[u8]) -> u64 {
        let mut steps = bytes.chunks_exact(STEP);
        // Their length comes first, so that zeros at the end count.
        let sum = steps.by_ref().fold(bytes.len() as u64 % PRIME, |sum, step| self.next(sum, step));
        self.next(sum, steps.remainder())
    }

    fn next(self, sum: u64, step: &[u8]) -> u64 {
        let mut word = [0; 8];
        word[..step.len()].copy_from_slice(step);
        let value = u128::from(sum) * u128::from(self.0) + u128::from(u64::from_le_bytes(word));
        // 2⁶¹ is 1: the upper bits are added to the lower ones.
        let folded = (value as u64 & PRIME) + (value >> 61) as u64;
        if folded >= PRIME { folded - PRIME } else { folded }
    }
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

    #[test]
    fn it_is_the_polynomial() {
        let (key, bytes) = (Key(1 << 40), [1, 2, 3, 4, 5, 6, 7, 8, 9]);
        let place = 1_u128 << 40;
        let [first, rest] = [0x07_06_05_04_03_02_01_u128, 0x09_08];
        let sum = ((9 * place + first) % u128::from(PRIME) * place + rest) % u128::from(PRIME);
        assert_eq!(u128::from(key.digest(&bytes)), sum);
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
