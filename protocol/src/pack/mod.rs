//! Answers in few bytes.
//!
//! **Promise.** What [`unpack`] returns is finite and not negative whatever bytes it is given.
//! Pixels are quantised, and their mean over frames equals the mean of what was packed: light is
//! rounded *stochastically*, from a hash of the question and the pixel, so that accumulated pictures
//! have no bias from the wire. Values that can be represented exactly stay exact. Sums over reference
//! samples are not rounded at all.
//!
//! **Who packs.** Every answer passes through here, also those of workers in the master's own
//! process; so the picture does not depend on where the workers are. [`squeeze`] (LZ4) only
//! shortens the way over a network and changes nothing.
//!
//! ```text
//! packed   := flags u8 , ( pixels | means | moments | lights | seen | irradiance | each light )
//! pixels   := [ emitted: rgb ] , [ reflectance: rgb , irradiance: rgb , normals , distances ]
//! means    := [ emitted: rgb ] , [ reflected: rgb ]
//! rgb      := black u8 | palette u8 … | shared exponent u8 … | roots u8 … | fine u8 …  (see [`rgb`])
//! normals  := 3 planes                  octahedral, 2 × 12 bits, differences      (see [`normal`])
//! distances:= first u32 , step u32 , 2 planes    16 bits, differences             (see [`distance`])
//! moments  := 6 × f64 a pixel                                                     (see [`moments`])
//! lights   := count u32 , 38 bytes a light                                        (see [`lights`])
//! the rest                                                                        (see [`points`])
//! ```
//! All numbers are little endian; a *plane* has one byte a pixel. Planes of one kind of byte
//! compress where interleaved records do not.

mod absolute;
mod distance;
mod dither;
mod lights;
mod moments;
mod normal;
mod pixels;
mod points;
mod rgb;
pub mod squeeze;

#[cfg(test)]
mod tests;

use crate::answer::{Body, Fields};
use crate::question::{Ask, Question};

pub use pixels::is_saturated;
pub use squeeze::{compress, decompress};

/// Largest sample that is sent; what exceeds it is cut down to it and flagged, see [`is_saturated`].
pub const LARGEST: f32 = 1.329_228e36; // 2^120

/// Bytes that are no packed answer.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum PackError {
    /// The record ends early.
    #[error("a packed answer ends after {got} bytes where {needed} more were due")]
    Cut {
        /// Bytes asked for at this point.
        needed: usize,
        /// Bytes that were left.
        got: usize,
    },
    /// The record goes on.
    #[error("{0} bytes after the end of a packed answer")]
    Trailing(usize),
    /// A number out of its range.
    #[error("a packed answer with {0}")]
    Invalid(&'static str),
    /// Other fields than the question asks for, or the scene has.
    #[error("a packed answer has other fields than its question and scene")]
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

/// The most bytes that [`pack`] makes of the answer to a question.
pub fn packed_len_max(ask: &Ask) -> usize {
    match ask {
        Ask::Tile(_) => pixels::packed_len_max(ask.len()),
        Ask::Frames(_) => pixels::means_len_max(ask.len()),
        Ask::Reference(_) => moments::packed_len(ask.len()),
        Ask::Lights(_) => lights::PACKED_MAX,
        Ask::Rays(rays) => points::seen_len_max(rays.through.len()),
        Ask::Points(asked) => points::packed_len_max(asked),
    }
}

/// The most bytes that an answer within the limits of [`crate::message`] can have.
pub(crate) const PACKED_MAX: usize = {
    let tile = pixels::packed_len_max(crate::message::TILE_PIXELS_MAX);
    let reference = moments::packed_len(crate::message::REFERENCE_PIXELS_MAX);
    let pixels = if tile > reference { tile } else { reference };
    if pixels > lights::PACKED_MAX { pixels } else { lights::PACKED_MAX }
};
const _: () = assert!(
    pixels::means_len_max(1) <= pixels::packed_len_max(1) && pixels::means_len_max(2) <= pixels::packed_len_max(2)
);
const _: () = assert!(points::PACKED_MAX <= PACKED_MAX, "no answer about points is longer than that about a tile");

/// Turns every pixel, ray or irradiance with a NaN, an infinity or a negative number in it black, leaves out such
/// lights, and counts them.
pub fn drop_unsound(body: &mut Body) -> u64 {
    match body {
        Body::Pixels(pixels) => pixels::drop_unsound(pixels),
        Body::Means(means) => pixels::drop_unsound_means(means),
        Body::Moments(moments) => moments::drop_unsound(moments),
        Body::Lights(lights) => lights::drop_unsound(lights),
        Body::Seen(seen) => pixels::drop_unsound(&mut seen.pixels),
        Body::Irradiance(irradiance) => points::drop_unsound(irradiance),
        Body::EachLight(each) => points::drop_unsound(&mut each.unhidden),
    }
}

/// Lays out the answer to a question. `fields` says what pixels of the scene can have; the rest is left out.
///
/// Expects a body that passed [`drop_unsound`]; a number that is unsound all the same becomes 0.
pub fn pack(question: &Question, body: &Body, fields: Fields) -> Vec<u8> {
    match body {
        Body::Pixels(pixels) => pixels::write(pixels, fields, pixels::rounding_key(&question.ask)),
        Body::Means(means) => pixels::write_means(means, fields, pixels::rounding_key(&question.ask)),
        Body::Moments(moments) => moments::write(moments),
        Body::Lights(lights) => lights::write(lights),
        Body::Seen(seen) => points::write_seen(seen, &question.ask, fields),
        Body::Irradiance(irradiance) => points::write_irradiance(irradiance, &question.ask),
        Body::EachLight(each) => points::write_each_light(each),
    }
}

/// Reads what [`pack`] wrote about a question and a scene with these `fields`.
///
/// # Errors
/// [`PackError`] for anything else. Nothing is allocated beyond the size of what was asked for.
pub fn unpack(question: &Question, bytes: &[u8], fields: Fields) -> Result<Body, PackError> {
    let mut from = Reader { bytes };
    let body = match &question.ask {
        Ask::Tile(_) => Body::Pixels(pixels::read(&mut from, question.ask.len(), fields)?),
        Ask::Frames(_) => Body::Means(pixels::read_means(&mut from, question.ask.len(), fields)?),
        Ask::Reference(_) => Body::Moments(moments::read(&mut from, question.ask.len())?),
        Ask::Lights(_) => Body::Lights(lights::read(&mut from)?),
        Ask::Rays(rays) => Body::Seen(points::read_seen(&mut from, rays.through.len(), Some(&rays.through), fields)?),
        Ask::Points(asked) => points::read(&mut from, asked, fields)?,
    };
    match from.bytes.len() {
        0 => Ok(body),
        rest => Err(PackError::Trailing(rest)),
    }
}

// Bits of the first byte.
const EMITTED: u8 = 1;
const SURFACE: u8 = 2;
const SATURATED: u8 = 4;
const MOMENTS: u8 = 8;
const LIGHTS: u8 = 16;
const SEEN: u8 = 32;
const IRRADIANCE: u8 = 64;
const EACH_LIGHT: u8 = 128;

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

    fn f32(&mut self) -> Result<f32, PackError> {
        self.array().map(f32::from_le_bytes)
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
