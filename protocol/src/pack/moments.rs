//! Sums over reference samples: every bit, as planes of one kind of byte, so that signs and exponents compress.

use glam::DVec3;

use super::{MOMENTS, PackError, Reader, planes_mut};
use crate::answer::Moments;

/// Bytes of one pixel: two sums of three channels.
const PIXEL: usize = 2 * 3 * size_of::<f64>();

/// The bytes that [`write`] makes of `len` pixels.
pub(super) const fn packed_len(len: usize) -> usize {
    1 + PIXEL * len
}

/// Turns every pixel with a sum that is not finite or negative black, and counts them.
pub(super) fn drop_unsound(moments: &mut Moments) -> u64 {
    let mut dropped = 0;
    for (sum, squares) in moments.sum.iter_mut().zip(&mut moments.squares) {
        if !is_sound(*sum) || !is_sound(*squares) {
            (*sum, *squares) = (DVec3::ZERO, DVec3::ZERO);
            dropped += 1;
        }
    }
    dropped
}

fn is_sound(value: DVec3) -> bool {
    value.is_finite() && value.min_element() >= 0.0
}

/// Lays out the bytes of all numbers.
pub(super) fn write(moments: &Moments) -> Vec<u8> {
    let mut out = Vec::with_capacity(packed_len(moments.len()));
    out.push(MOMENTS);
    let numbers = [&moments.sum, &moments.squares].into_iter().flat_map(|sums| (0..3).map(move |c| (sums, c)));
    let mut planes = planes_mut::<PIXEL>(&mut out, moments.len());
    for (planes, (sums, channel)) in planes.chunks_exact_mut(size_of::<f64>()).zip(numbers) {
        for (pixel, sum) in sums.iter().enumerate() {
            for (plane, byte) in planes.iter_mut().zip(sum[channel].to_le_bytes()) {
                plane[pixel] = byte;
            }
        }
    }
    out
}

/// Reads what [`write`] wrote about `len` pixels.
pub(super) fn read(from: &mut Reader, len: usize) -> Result<Moments, PackError> {
    if from.u8()? != MOMENTS {
        return Err(PackError::OtherFields);
    }
    let planes = from.planes::<PIXEL>(len)?;
    let value = |number: usize, pixel: usize| {
        f64::from_le_bytes(std::array::from_fn(|byte| planes[number * size_of::<f64>() + byte][pixel]))
    };
    let colour = |first: usize, pixel: usize| {
        let colour = DVec3::from_array(std::array::from_fn(|channel| value(first + channel, pixel)));
        if is_sound(colour) { Ok(colour) } else { Err(PackError::Invalid("a sum that is negative or not finite")) }
    };
    let sums = |first: usize| (0..len).map(|pixel| colour(first, pixel)).collect::<Result<Vec<_>, _>>();
    Ok(Moments { sum: sums(0)?, squares: sums(3)? })
}
