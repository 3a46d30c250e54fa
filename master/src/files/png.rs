//! PNG, marked as sRGB.

use anyhow::Context;
use frame::tone::Image8;
use image::codecs::png::PngEncoder;
use image::{ExtendedColorType, ImageEncoder};

/// The bytes of a PNG file.
///
/// # Errors
/// If the picture is empty or too large for the format.
pub fn encode_png(picture: &Image8) -> anyhow::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    PngEncoder::new(&mut bytes)
        .write_image(picture.bytes(), picture.width, picture.height, ExtendedColorType::Rgb8)
        .context("the picture cannot be encoded as PNG")?;
    // The encoder does not say what its numbers mean: the sRGB chunk does, right after the header.
    bytes.splice(HEADER_END..HEADER_END, SRGB_CHUNK);
    Ok(bytes)
}

/// Signature (8) and IHDR chunk (25).
const HEADER_END: usize = 33;
/// Length 1, name, rendering intent 0 (perceptual), checksum.
const SRGB_CHUNK: [u8; 13] = [0, 0, 0, 1, b's', b'R', b'G', b'B', 0, 0xae, 0xce, 0x1c, 0xe9];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_written_can_be_read_and_says_srgb() {
        let pixels = vec![[1, 2, 3], [4, 5, 6], [7, 8, 9], [250, 251, 252], [0, 0, 0], [255, 255, 255]];
        let picture = Image8 { width: 3, height: 2, pixels };
        let bytes = encode_png(&picture).unwrap();
        assert_eq!(&bytes[37..41], b"sRGB");
        let read = image::load_from_memory(&bytes).unwrap().to_rgb8();
        assert_eq!((read.width(), read.height(), read.as_raw().as_slice()), (3, 2, picture.bytes()));
    }
}
