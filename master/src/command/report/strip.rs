//! Strips of pictures: what the methods looked like at the marks, and where they were wrong.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use frame::Picture;
use frame::metrics::{RELATIVE_FLOOR, heat};
use frame::tone::{Image8, Tone};
use glam::Vec3;

use runtime::files::encode_png;

/// A picture as `data:` address, at exposure 0, clipped.
///
/// # Errors
/// If it cannot be encoded.
pub fn shown(picture: &Picture) -> anyhow::Result<String> {
    address(&Tone::PLAIN.develop(picture))
}

/// Where a picture is wrong, as `data:` address: black where it is right, white where it is off by a
/// quarter of the reference or more.
///
/// # Errors
/// If it cannot be encoded.
pub fn difference(picture: &Picture, reference: &Picture) -> anyhow::Result<String> {
    let wrong = |(x, r): (&Vec3, &Vec3)| {
        let squares = (*x - *r) * (*x - *r) / (*r * *r + Vec3::splat(RELATIVE_FLOOR as f32));
        heat(((squares.element_sum() / 3.0).sqrt() / WHITE).clamp(0.0, 1.0))
    };
    let pixels = picture.pixels.iter().zip(&reference.pixels).map(wrong).collect();
    address(&Image8 { width: picture.width, height: picture.height, pixels })
}

/// A picture as `data:` address.
///
/// # Errors
/// If it cannot be encoded.
pub(crate) fn address(image: &Image8) -> anyhow::Result<String> {
    Ok(format!("data:image/png;base64,{}", STANDARD.encode(encode_png(image)?)))
}

/// Relative error that is shown as white.
const WHITE: f32 = 0.25;
