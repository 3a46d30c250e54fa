//! Distances: 16 bits between the tile's smallest and largest, as differences to the pixel before.
//!
//! The steps are even in the *bit patterns* of `f32`, which grow like logarithms (exactly so at
//! octaves, linearly between): reading takes an addition, no exponential, and gives the same bits
//! everywhere. A tile that spans fewer than 65 535 patterns is exact.
//!
//! `first u32` is the pattern of code 1, `step u32` the patterns between codes; code 0 is 0: nothing there.

use super::{PackError, Reader, planes_mut, unzigzag, zigzag};

const CODE_MAX: u32 = u16::MAX as u32;

pub(super) fn write(distances: &[f32], out: &mut Vec<u8>) {
    let pattern = |distance: f32| if distance > 0.0 && distance.is_finite() { distance.to_bits() } else { 0 };
    let there = || distances.iter().map(|d| pattern(*d)).filter(|bits| *bits > 0);
    let first = there().min().unwrap_or(0);
    let span = there().max().unwrap_or(0) - first;
    // The largest must not be rounded beyond the last code.
    let step = span.div_ceil(CODE_MAX - 1).max(1);
    out.extend(first.to_le_bytes());
    out.extend(step.to_le_bytes());

    let [low, high] = planes_mut(out, distances.len());
    let mut last = 0_u16;
    for (i, distance) in distances.iter().enumerate() {
        let code = match pattern(*distance) {
            0 => 0,
            bits => (1 + (bits - first + step / 2) / step) as u16,
        };
        let difference = i32::from(code.wrapping_sub(last) as i16);
        [low[i], high[i]] = (zigzag(difference) as u16).to_le_bytes();
        last = code;
    }
}

pub(super) fn read(from: &mut Reader, len: usize) -> Result<Vec<f32>, PackError> {
    let (first, step) = (from.u32()?, from.u32()?);
    let [low, high] = from.planes(len)?;
    let mut last = 0_u16;
    let mut largest = 0;
    let next = |(low, high): (&u8, &u8)| {
        let difference = unzigzag(u32::from(u16::from_le_bytes([*low, *high])));
        last = last.wrapping_add(difference as u16);
        largest = largest.max(last);
        match last {
            0 => 0.0,
            code => f32::from_bits(first.wrapping_add(u32::from(code - 1).wrapping_mul(step))),
        }
    };
    let distances = low.iter().zip(high).map(next).collect();
    let largest = u64::from(first) + u64::from(largest.saturating_sub(1)) * u64::from(step);
    if largest >= u64::from(f32::INFINITY.to_bits()) {
        return Err(PackError::Invalid("a distance that is not finite"));
    }
    Ok(distances)
}
