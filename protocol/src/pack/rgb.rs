//! Colours: exactly by palette where a tile has few of them, else by shared exponent or by square roots.
//!
//! ```text
//! black           := 0 u8
//! palette         := 1 u8 , count − 1 u8 , colours 3 × f32 × count , [ index plane, if count > 1 ]
//! shared exponent := 2 u8 , top i8 , plane of (exponent << 3 | mantissa bits 8) , planes of R, G − R, B − R
//! roots           := 3 u8 , top i8 , planes of R, G − R, B − R
//! fine            := 4 u8 , top i8 , plane of exponents , high and low bytes of R, G − R, B − R
//! ```

use std::collections::BTreeMap;

use glam::Vec3;
use scenes::Rgb;

use super::dither::{Dither, round};
use super::{LARGEST, PackError, Reader, planes_mut};

/// How colours are quantised that no palette can hold.
#[derive(Clone, Copy)]
pub(super) enum Style {
    /// 9-bit mantissas with a common 5-bit exponent below the tile's largest: for light.
    Exponent,
    /// 8-bit square roots, relative to the tile's largest: for reflectance, which spans few octaves.
    Root,
    /// 15-bit mantissas with a common 5-bit exponent below the tile's largest: for means over frames.
    Fine,
}

const BLACK: u8 = 0;
const PALETTE: u8 = 1;
const EXPONENT: u8 = 2;
const ROOT: u8 = 3;
const FINE: u8 = 4;

/// Writes colours; true if one had to be cut down to [`LARGEST`].
pub(super) fn write(colours: &[Rgb], style: Style, dither: Dither, out: &mut Vec<u8>) -> bool {
    let largest = colours.iter().map(|colour| sound(*colour).max_element()).fold(0.0, f32::max);
    if largest == 0.0 {
        out.push(BLACK);
        return false;
    }
    if let Some(palette) = Palette::of(colours) {
        palette.write(out);
    } else {
        match style {
            Style::Exponent => write_exponents(colours, largest, dither, out),
            Style::Root => write_roots(colours, largest, dither, out),
            Style::Fine => write_fine(colours, largest, dither, out),
        }
    }
    colours.iter().any(|colour| colour.max_element() > LARGEST)
}

/// Reads what [`write`] wrote.
pub(super) fn read(from: &mut Reader, len: usize) -> Result<Vec<Rgb>, PackError> {
    match from.u8()? {
        BLACK => Ok(super::black(len)),
        PALETTE => read_palette(from, len),
        EXPONENT => read_exponents(from, len),
        ROOT => read_roots(from, len),
        FINE => read_fine(from, len),
        _ => Err(PackError::Invalid("an unknown kind of colours")),
    }
}

/// NaN and negative numbers become 0, too large ones [`LARGEST`].
pub(super) fn sound(colour: Rgb) -> Rgb {
    let channel = |x: f32| if x > 0.0 { x.min(LARGEST) } else { 0.0 };
    Vec3::new(channel(colour.x), channel(colour.y), channel(colour.z))
}

/// All colours of a tile, and which pixel has which.
struct Palette {
    colours: Vec<[f32; 3]>,
    indices: Vec<u8>,
}

impl Palette {
    /// `None` if that would take more bytes than the other encodings.
    fn of(pixels: &[Rgb]) -> Option<Self> {
        let most = (pixels.len() / 6).clamp(1, 256);
        let mut known = BTreeMap::new();
        let mut palette = Self { colours: Vec::new(), indices: Vec::with_capacity(pixels.len()) };
        let mut last = ([f32::NAN; 3], 0);
        for pixel in pixels {
            let colour = sound(*pixel).to_array();
            if colour != last.0 {
                let index = *known.entry(colour.map(f32::to_bits)).or_insert(palette.colours.len());
                if index == palette.colours.len() {
                    if index == most {
                        return None;
                    }
                    palette.colours.push(colour);
                }
                last = (colour, index as u8);
            }
            palette.indices.push(last.1);
        }
        Some(palette)
    }

    fn write(&self, out: &mut Vec<u8>) {
        out.extend([PALETTE, (self.colours.len() - 1) as u8]);
        out.extend(self.colours.iter().flatten().flat_map(|channel| channel.to_le_bytes()));
        if self.colours.len() > 1 {
            out.extend_from_slice(&self.indices);
        }
    }
}

fn read_palette(from: &mut Reader, len: usize) -> Result<Vec<Rgb>, PackError> {
    let count = usize::from(from.u8()?) + 1;
    let mut colours = [Vec3::ZERO; 256];
    for colour in &mut colours[..count] {
        let channels = [from.u32()?, from.u32()?, from.u32()?].map(f32::from_bits);
        if channels.iter().any(|x| !(0.0..=LARGEST).contains(x)) {
            return Err(PackError::Invalid("a colour that is negative or not finite"));
        }
        *colour = Vec3::from_array(channels);
    }
    if count == 1 {
        return Ok(vec![colours[0]; len]);
    }
    let indices = from.take(len)?;
    if indices.iter().any(|index| usize::from(*index) >= count) {
        return Err(PackError::Invalid("a colour beyond the palette"));
    }
    Ok(indices.iter().map(|index| colours[usize::from(*index)]).collect())
}

/// Bits of a mantissa; the largest channel's first bit is set unless the exponent is at its least.
const MANTISSA: u32 = 9;
const MANTISSA_MAX: f32 = ((1 << MANTISSA) - 1) as f32;
const EXPONENT_MAX: i32 = 31;
/// Tiles darker than 2^TOP_MIN (8e-25) are rounded as if they were that bright; all steps stay normal numbers.
const TOP_MIN: i32 = -80;
/// [`LARGEST`] is 2^120, and one octave more is needed to round it up.
const TOP_MAX: i32 = 122;

/// The least `e` with `x < 2^e`, for positive normal numbers.
pub(super) fn exponent_above(x: f32) -> i32 {
    (x.to_bits() >> 23) as i32 - 126
}

/// 2^e for a normal result.
pub(super) fn power_of_two(e: i32) -> f32 {
    f32::from_bits(((e + 127) as u32) << 23)
}

/// The weight of mantissa 1 under every exponent code of a tile.
fn steps(top: i32, mantissa: u32) -> [f32; EXPONENT_MAX as usize + 1] {
    std::array::from_fn(|code| power_of_two(top - EXPONENT_MAX + code as i32 - mantissa as i32))
}

/// The exponent code of a pixel whose largest channel is this, beside a tile's largest. No mantissa may be rounded up to
/// one bit more.
fn exponent_code(largest: f32, top: i32, steps: &[f32], mantissa_max: f32) -> usize {
    let code = (exponent_above(largest) - top + EXPONENT_MAX).clamp(0, EXPONENT_MAX) as usize;
    code + usize::from(largest > mantissa_max * steps[code])
}

fn write_exponents(colours: &[Rgb], largest: f32, dither: Dither, out: &mut Vec<u8>) {
    let top = (exponent_above(largest) + 1).clamp(TOP_MIN, TOP_MAX);
    let steps = steps(top, MANTISSA);
    out.extend([EXPONENT, top as i8 as u8]);
    let [high, red, green, blue] = planes_mut(out, colours.len());
    for (i, colour) in colours.iter().enumerate() {
        let colour = sound(*colour);
        let code = exponent_code(colour.max_element(), top, &steps, MANTISSA_MAX);
        // Steps are powers of two: this division is exact.
        let threshold = dither.threshold(i);
        let [r, g, b] = (colour / steps[code]).to_array().map(|x| round(x, threshold));
        high[i] = (code as u32 * 8 + (r >> 8) * 4 + (g >> 8) * 2 + (b >> 8)) as u8;
        red[i] = r as u8;
        green[i] = (g as u8).wrapping_sub(r as u8);
        blue[i] = (b as u8).wrapping_sub(r as u8);
    }
}

fn read_exponents(from: &mut Reader, len: usize) -> Result<Vec<Rgb>, PackError> {
    let top = i32::from(from.u8()? as i8);
    if !(TOP_MIN..=TOP_MAX).contains(&top) {
        return Err(PackError::Invalid("an exponent out of range"));
    }
    let steps = steps(top, MANTISSA);
    let [high, red, green, blue] = from.planes(len)?;
    let channels = red.iter().zip(green).zip(blue);
    let colour = |(high, ((r, g), b)): (&u8, ((&u8, &u8), &u8))| {
        let mantissa = |bit: u8, low: u8| f32::from(u16::from(high >> bit & 1) << 8 | u16::from(low));
        let (g, b) = (g.wrapping_add(*r), b.wrapping_add(*r));
        Vec3::new(mantissa(2, *r), mantissa(1, g), mantissa(0, b)) * steps[usize::from(high >> 3)]
    };
    Ok(high.iter().zip(channels).map(colour).collect())
}

/// As [`MANTISSA`], of means: the smallest step of all is then still a normal number.
const FINE_MANTISSA: u32 = 15;
const FINE_MANTISSA_MAX: f32 = ((1 << FINE_MANTISSA) - 1) as f32;

fn write_fine(colours: &[Rgb], largest: f32, dither: Dither, out: &mut Vec<u8>) {
    let top = (exponent_above(largest) + 1).clamp(TOP_MIN, TOP_MAX);
    let steps = steps(top, FINE_MANTISSA);
    out.extend([FINE, top as i8 as u8]);
    let [exponents, planes @ ..] = planes_mut::<7>(out, colours.len());
    for (i, colour) in colours.iter().enumerate() {
        let colour = sound(*colour);
        let code = exponent_code(colour.max_element(), top, &steps, FINE_MANTISSA_MAX);
        let threshold = dither.threshold(i);
        // Steps are powers of two: this division is exact.
        let [r, g, b] = (colour / steps[code]).to_array().map(|x| round(x, threshold) as u16);
        exponents[i] = code as u8;
        let bytes = [r, g.wrapping_sub(r), b.wrapping_sub(r)].into_iter().flat_map(u16::to_be_bytes);
        for (index, byte) in bytes.enumerate() {
            planes[index][i] = byte;
        }
    }
}

/// Numbers of 16 bits from a plane of their high and one of their low bytes.
fn words<'a>(high: &'a [u8], low: &'a [u8]) -> impl Iterator<Item = u16> + 'a {
    high.iter().zip(low).map(|(high, low)| u16::from_be_bytes([*high, *low]))
}

fn read_fine(from: &mut Reader, len: usize) -> Result<Vec<Rgb>, PackError> {
    let top = i32::from(from.u8()? as i8);
    if !(TOP_MIN..=TOP_MAX).contains(&top) {
        return Err(PackError::Invalid("an exponent out of range"));
    }
    let steps = steps(top, FINE_MANTISSA);
    let [exponents, r_high, r_low, g_high, g_low, b_high, b_low] = from.planes(len)?;
    if exponents.iter().any(|code| i32::from(*code) > EXPONENT_MAX) {
        return Err(PackError::Invalid("an exponent out of range"));
    }
    let channels = words(r_high, r_low).zip(words(g_high, g_low).zip(words(b_high, b_low)));
    let colour = |(code, (r, (g, b))): (&u8, (u16, (u16, u16)))| {
        let [r, g, b] = [r, g.wrapping_add(r), b.wrapping_add(r)].map(f32::from);
        Vec3::new(r, g, b) * steps[usize::from(*code)]
    };
    Ok(exponents.iter().zip(channels).map(colour).collect())
}

/// The values of all codes: squares of 0/255 … 255/255 times 2^top.
fn squares(top: i32) -> [f32; 256] {
    let scale = power_of_two(top);
    std::array::from_fn(|code| (code * code) as f32 / 65025.0 * scale)
}

fn write_roots(colours: &[Rgb], largest: f32, dither: Dither, out: &mut Vec<u8>) {
    // 1 itself, a power of two, needs no higher top than 0.
    let octave = exponent_above(largest);
    let top = if power_of_two(octave - 1) == largest { octave - 1 } else { octave }.clamp(TOP_MIN, TOP_MAX);
    let squares = squares(top);
    let scale = power_of_two(top);
    let code = |x: f32, threshold: f32| {
        let guess = (((x / scale).sqrt() * 255.0) as usize).min(254);
        // The root is rounded: the code below x may be one off.
        let below = match guess {
            0 => 0,
            _ if squares[guess] > x => guess - 1,
            _ if guess < 254 && squares[guess + 1] <= x => guess + 1,
            _ => guess,
        };
        let fraction = (x - squares[below]) / (squares[below + 1] - squares[below]);
        below as u8 + round(fraction.min(1.0), threshold) as u8
    };
    out.extend([ROOT, top as i8 as u8]);
    let [red, green, blue] = planes_mut(out, colours.len());
    for (i, colour) in colours.iter().enumerate() {
        let threshold = dither.threshold(i);
        let [r, g, b] = sound(*colour).to_array().map(|x| code(x, threshold));
        red[i] = r;
        green[i] = g.wrapping_sub(r);
        blue[i] = b.wrapping_sub(r);
    }
}

fn read_roots(from: &mut Reader, len: usize) -> Result<Vec<Rgb>, PackError> {
    let top = i32::from(from.u8()? as i8);
    if !(TOP_MIN..=TOP_MAX).contains(&top) {
        return Err(PackError::Invalid("an exponent out of range"));
    }
    let squares = squares(top);
    let [red, green, blue] = from.planes(len)?;
    let value = |code: u8| squares[usize::from(code)];
    let colour =
        |((r, g), b): ((&u8, &u8), &u8)| Vec3::new(value(*r), value(g.wrapping_add(*r)), value(b.wrapping_add(*r)));
    Ok(red.iter().zip(green).zip(blue).map(colour).collect())
}
