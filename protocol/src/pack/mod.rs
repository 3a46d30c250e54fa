//! Pixels in few bytes.
//!
//! **Promise.** What [`unpack`] returns is finite and not negative whatever bytes it is given, and
//! its mean over frames equals the mean of what was packed: light is rounded *stochastically*,
//! from a hash of the question and the pixel, so that accumulated pictures have no bias from the
//! wire. Values that can be represented exactly stay exact.
//!
//! **Who packs.** Every answer passes through here, also those of workers in the master's own
//! process; so the picture does not depend on where the workers are. [`squeeze`] (LZ4) only
//! shortens the way over a network and changes nothing.
//!
//! ```text
//! packed   := flags u8 , [ emitted: rgb ] , [ reflectance: rgb , irradiance: rgb , normals , distances ]
//! rgb      := black u8 | palette u8 … | shared exponent u8 … | roots u8 …        (see [`rgb`])
//! normals  := 3 planes                  octahedral, 2 × 12 bits, differences      (see [`normal`])
//! distances:= first u32 , step u32 , 2 planes    16 bits, differences             (see [`distance`])
//! ```
//! All numbers are little endian; a *plane* has one byte a pixel. Planes of one kind of byte
//! compress where interleaved records do not.

mod distance;
mod dither;
mod normal;
mod rgb;
pub mod squeeze;

#[cfg(test)]
mod tests;

use crate::answer::{Fields, Pixels};
use crate::question::{Ask, Question};
use dither::Dither;
use rgb::Style;

pub use squeeze::{compress, decompress};

/// Largest sample that is sent; what exceeds it is cut down to it and flagged, see [`is_saturated`].
pub const LARGEST: f32 = 1.329_228e36; // 2^120

/// Bytes that are no packed pixels.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum PackError {
    /// The record ends early.
    #[error("packed pixels end after {got} bytes where {needed} more were due")]
    Cut {
        /// Bytes asked for at this point.
        needed: usize,
        /// Bytes that were left.
        got: usize,
    },
    /// The record goes on.
    #[error("{0} bytes after the end of the packed pixels")]
    Trailing(usize),
    /// A number out of its range.
    #[error("packed pixels with {0}")]
    Invalid(&'static str),
    /// Other fields than the scene has.
    #[error("packed pixels have other fields than this scene")]
    OtherFields,
    /// A compressed block declares more than its receiver allows.
    #[error("compressed block claims {claimed} bytes, at most {limit} are allowed")]
    TooLong {
        /// What the block says of itself.
        claimed: usize,
        /// What is allowed.
        limit: usize,
    },
    /// LZ4 refuses.
    #[error("compressed block is broken")]
    Broken,
}

/// The most bytes that [`pack`] makes of `len` pixels.
pub const fn packed_len_max(len: usize) -> usize {
    1 + 3 * (14 + 4 * len) + 3 * len + (8 + 2 * len)
}

/// The key of the rounding of an answer: a function of the question alone, so that whoever answers
/// rounds alike. Different frames and sets round independently.
pub fn dither_key(question: &Question) -> u64 {
    match &question.ask {
        Ask::Tile(tile) => [
            u64::from(tile.frame) << 32 | u64::from(tile.set),
            u64::from(tile.rect.x) << 32 | u64::from(tile.rect.y),
            u64::from(tile.rect.width) << 32 | u64::from(tile.rect.height),
        ]
        .into_iter()
        .fold(dither::mix(tile.seed), |key, word| dither::mix(key ^ word)),
    }
}

/// Turns every pixel with a NaN, an infinity or a negative number in it black, and counts them.
pub fn drop_unsound(pixels: &mut Pixels) -> u64 {
    let mut dropped = 0;
    for i in 0..pixels.len() {
        let light = [pixels.emitted[i], pixels.reflectance[i], pixels.irradiance[i]];
        let sound = light.iter().all(|rgb| rgb.is_finite() && rgb.min_element() >= 0.0)
            && pixels.normal[i].is_finite()
            && pixels.distance[i].is_finite()
            && pixels.distance[i] >= 0.0;
        if !sound {
            [pixels.emitted[i], pixels.reflectance[i], pixels.irradiance[i], pixels.normal[i]] = Default::default();
            pixels.distance[i] = 0.0;
            dropped += 1;
        }
    }
    dropped
}

/// Quantises pixels and lays them out in planes. `fields` says what the scene can have; the rest is left out.
///
/// Expects pixels that passed [`drop_unsound`]; a number that is unsound all the same becomes 0.
///
/// | field | bytes a pixel | error |
/// |---|---|---|
/// | emitted, irradiance | 0, 1 or 4 | < 1/256 of the pixel's largest channel, unbiased; 0 with ≤ 256 colours a tile |
/// | reflectance | 0, 1 or 3 | < 1/127 of the root of value × tile scale, unbiased; 0 with ≤ 256 colours a tile |
/// | normal | 3 | < 0.06° |
/// | distance | 2 | < 2⁻¹⁶ of the octaves that the tile spans (65 m to 1 m: 5e-5) |
pub fn pack(pixels: &Pixels, fields: Fields, dither_key: u64) -> Vec<u8> {
    let mut out = Vec::with_capacity(packed_len_max(pixels.len()));
    let mut saturated = false;
    out.push(0);
    if fields.emitted {
        saturated |= rgb::write(&pixels.emitted, Style::Exponent, Dither::new(dither_key, 0), &mut out);
    }
    if fields.surface {
        saturated |= rgb::write(&pixels.reflectance, Style::Root, Dither::new(dither_key, 1), &mut out);
        saturated |= rgb::write(&pixels.irradiance, Style::Exponent, Dither::new(dither_key, 2), &mut out);
        normal::write(&pixels.normal, &mut out);
        distance::write(&pixels.distance, &mut out);
    }
    out[0] = flags(fields) | if saturated { SATURATED } else { 0 };
    out
}

/// Reads what [`pack`] wrote about `len` pixels of a scene with these `fields`.
///
/// # Errors
/// [`PackError`] for anything else. Nothing is allocated beyond the size of `len` pixels.
pub fn unpack(bytes: &[u8], len: usize, fields: Fields) -> Result<Pixels, PackError> {
    let mut from = Reader { bytes };
    if from.u8()? & !SATURATED != flags(fields) {
        return Err(PackError::OtherFields);
    }
    let emitted = if fields.emitted { rgb::read(&mut from, len)? } else { black(len) };
    let pixels = if fields.surface {
        let (reflectance, irradiance) = (rgb::read(&mut from, len)?, rgb::read(&mut from, len)?);
        let (normal, distance) = (normal::read(&mut from, len)?, distance::read(&mut from, len)?);
        Pixels { emitted, reflectance, irradiance, normal, distance }
    } else {
        Pixels { emitted, ..Pixels::black(len) }
    };
    match from.bytes.len() {
        0 => Ok(pixels),
        rest => Err(PackError::Trailing(rest)),
    }
}

/// Whether a sample exceeded [`LARGEST`] and was cut.
pub fn is_saturated(packed: &[u8]) -> bool {
    packed.first().is_some_and(|flags| flags & SATURATED != 0)
}

const EMITTED: u8 = 1;
const SURFACE: u8 = 2;
const SATURATED: u8 = 4;

fn flags(fields: Fields) -> u8 {
    let if_set = |set: bool, flag: u8| if set { flag } else { 0 };
    if_set(fields.emitted, EMITTED) | if_set(fields.surface, SURFACE)
}

fn black(len: usize) -> Vec<glam::Vec3> {
    vec![glam::Vec3::ZERO; len]
}

/// Bytes yet to be read.
struct Reader<'a> {
    bytes: &'a [u8],
}

impl<'a> Reader<'a> {
    fn take(&mut self, needed: usize) -> Result<&'a [u8], PackError> {
        let Some((taken, rest)) = self.bytes.split_at_checked(needed) else {
            return Err(PackError::Cut { needed, got: self.bytes.len() });
        };
        self.bytes = rest;
        Ok(taken)
    }

    /// The next `N` planes of `len` bytes each.
    fn planes<const N: usize>(&mut self, len: usize) -> Result<[&'a [u8]; N], PackError> {
        let mut planes = [&[][..]; N];
        for plane in &mut planes {
            *plane = self.take(len)?;
        }
        Ok(planes)
    }

    fn array<const N: usize>(&mut self) -> Result<[u8; N], PackError> {
        let mut array = [0; N];
        array.copy_from_slice(self.take(N)?);
        Ok(array)
    }

    fn u8(&mut self) -> Result<u8, PackError> {
        self.array().map(|[byte]| byte)
    }

    fn u32(&mut self) -> Result<u32, PackError> {
        self.array().map(u32::from_le_bytes)
    }
}

/// Appends `N` planes of `len` bytes and hands them out to be filled.
fn planes_mut<const N: usize>(out: &mut Vec<u8>, len: usize) -> [&mut [u8]; N] {
    let start = out.len();
    out.resize(start + N * len, 0);
    let mut rest = &mut out[start..];
    std::array::from_fn(|_| {
        let (plane, others) = std::mem::take(&mut rest).split_at_mut(len);
        rest = others;
        plane
    })
}

/// Small differences of either sign become small numbers: 0, −1, 1, −2 … ↦ 0, 1, 2, 3 …
fn zigzag(difference: i32) -> u32 {
    ((difference << 1) ^ (difference >> 31)) as u32
}

/// Inverse of [`zigzag`].
fn unzigzag(number: u32) -> i32 {
    (number >> 1) as i32 ^ -((number & 1) as i32)
}
