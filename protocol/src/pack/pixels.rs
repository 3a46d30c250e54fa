//! Pixels of a tile: quantised, field by field.

use scenes::Rgb;

use super::dither::{Dither, mix};
use super::rgb::{self, Style};
use super::{EMITTED, PackError, Reader, SATURATED, SURFACE, black, distance, normal};
use crate::answer::{Fields, Means, Pixels};
use crate::question::{Ask, Lights, Points, Rays, Tile};

/// The most bytes that [`write`] makes of `len` pixels.
pub(super) const fn packed_len_max(len: usize) -> usize {
    1 + 3 * (14 + 4 * len) + 3 * len + (8 + 2 * len)
}

/// The key of the rounding of an answer: a function of the question alone, so that whoever answers
/// rounds alike. Different frames and sets round independently.
pub(super) fn rounding_key(ask: &Ask) -> u64 {
    match ask {
        Ask::Tile(tile) => key_of_tile(tile),
        // Not that of the first frame alone, whose light it has.
        Ask::Frames(frames) => mix(key_of_tile(&frames.tile) ^ u64::from(frames.count)),
        Ask::Reference(samples) => mix(samples.seed),
        Ask::Lights(Lights { lit, .. }) | Ask::Rays(Rays { lit, .. }) | Ask::Points(Points { lit, .. }) => {
            mix(lit.seed)
        }
    }
}

fn key_of_tile(tile: &Tile) -> u64 {
    let words = [
        u64::from(tile.lit.frame) << 32 | u64::from(tile.lit.set),
        u64::from(tile.rect.x) << 32 | u64::from(tile.rect.y),
        u64::from(tile.rect.width) << 32 | u64::from(tile.rect.height),
    ];
    words.into_iter().fold(mix(tile.lit.seed), |key, word| mix(key ^ word))
}

/// Turns every pixel with a NaN, an infinity or a negative number in it black, and counts them.
pub(super) fn drop_unsound(pixels: &mut Pixels) -> u64 {
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
/// | field | bytes a pixel | error |
/// |---|---|---|
/// | emitted, irradiance | 0, 1 or 4 | < 1/256 of the pixel's largest channel, unbiased; 0 with ≤ 256 colours a tile |
/// | reflectance | 0, 1 or 3 | < 1/127 of the root of value × tile scale, unbiased; 0 with ≤ 256 colours a tile |
/// | normal | 3 | < 0.06° |
/// | distance | 2 | < 2⁻¹⁶ of the octaves that the tile spans (65 m to 1 m: 5e-5) |
pub(super) fn write(pixels: &Pixels, fields: Fields, dither_key: u64) -> Vec<u8> {
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

/// Reads what [`write`] wrote about `len` pixels of a scene with these `fields`.
pub(super) fn read(from: &mut Reader, len: usize, fields: Fields) -> Result<Pixels, PackError> {
    if from.u8()? & !SATURATED != flags(fields) {
        return Err(PackError::OtherFields);
    }
    let emitted = if fields.emitted { rgb::read(from, len)? } else { black(len) };
    Ok(if fields.surface {
        let (reflectance, irradiance) = (rgb::read(from, len)?, rgb::read(from, len)?);
        let (normal, distance) = (normal::read(from, len)?, distance::read(from, len)?);
        Pixels { emitted, reflectance, irradiance, normal, distance }
    } else {
        Pixels { emitted, ..Pixels::black(len) }
    })
}

/// The most bytes that [`write_means`] makes of `len` pixels.
pub(super) const fn means_len_max(len: usize) -> usize {
    1 + 2 * (14 + 7 * len)
}

/// As [`drop_unsound`], for means.
pub(super) fn drop_unsound_means(means: &mut Means) -> u64 {
    let mut dropped = 0;
    let is_sound = |rgb: &Rgb| rgb.is_finite() && rgb.min_element() >= 0.0;
    for i in 0..means.len() {
        let parts = [means.emitted.get_mut(i), means.reflected.get_mut(i)];
        if !parts.iter().flatten().all(|rgb| is_sound(rgb)) {
            parts.into_iter().flatten().for_each(|rgb| *rgb = Rgb::ZERO);
            dropped += 1;
        }
    }
    dropped
}

/// Quantises means over frames, and lays them out in planes: 7 bytes a pixel and field at most, with an error below 1/16384 of
/// the pixel's largest channel, unbiased; 0 with ≤ 256 colours a tile. A mean of many frames must not be rounded as
/// coarsely as one of them.
pub(super) fn write_means(means: &Means, fields: Fields, dither_key: u64) -> Vec<u8> {
    let mut out = Vec::with_capacity(means_len_max(means.len()));
    let mut saturated = false;
    out.push(0);
    if fields.emitted {
        saturated |= rgb::write(&means.emitted, Style::Fine, Dither::new(dither_key, 0), &mut out);
    }
    if fields.surface {
        saturated |= rgb::write(&means.reflected, Style::Fine, Dither::new(dither_key, 2), &mut out);
    }
    out[0] = flags(fields) | if saturated { SATURATED } else { 0 };
    out
}

/// Reads what [`write_means`] wrote about `len` pixels of a scene with these `fields`.
pub(super) fn read_means(from: &mut Reader, len: usize, fields: Fields) -> Result<Means, PackError> {
    if from.u8()? & !SATURATED != flags(fields) {
        return Err(PackError::OtherFields);
    }
    let mut read = |is_there: bool| if is_there { rgb::read(from, len) } else { Ok(Vec::new()) };
    Ok(Means { emitted: read(fields.emitted)?, reflected: read(fields.surface)? })
}

/// Whether a sample exceeded [`super::LARGEST`] and was cut.
pub fn is_saturated(packed: &[u8]) -> bool {
    packed.first().is_some_and(|flags| flags & SATURATED != 0)
}

pub(super) fn flags(fields: Fields) -> u8 {
    let if_set = |set: bool, flag: u8| if set { flag } else { 0 };
    if_set(fields.emitted, EMITTED) | if_set(fields.surface, SURFACE)
}
