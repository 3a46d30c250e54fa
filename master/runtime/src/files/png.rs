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
    encode_png_saying(picture, None)
}

/// The same, with something for people to read in it: Latin-1, or what is left of it.
///
/// # Errors
/// As [`encode_png`].
pub fn encode_png_saying(picture: &Image8, comment: Option<&str>) -> anyhow::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    PngEncoder::new(&mut bytes)
        .write_image(picture.bytes(), picture.width, picture.height, ExtendedColorType::Rgb8)
        .context("the picture cannot be encoded as PNG")?;
    // The encoder does not say what its numbers mean: the sRGB chunk does, right after the header.
    let said = comment.map_or(Vec::new(), |comment| {
        let text = comment.chars().filter_map(|c| u8::try_from(c).ok()).filter(|byte| *byte != 0);
        chunk(*b"tEXt", b"Comment\0".iter().copied().chain(text).collect())
    });
    bytes.splice(HEADER_END..HEADER_END, SRGB_CHUNK.into_iter().chain(said));
    Ok(bytes)
}

/// Length, name, content, checksum.
fn chunk(name: [u8; 4], content: Vec<u8>) -> Vec<u8> {
    let mut bytes = (content.len() as u32).to_be_bytes().to_vec();
    bytes.extend(name.into_iter().chain(content));
    let checksum = crc32(&bytes[4..]);
    bytes.extend(checksum.to_be_bytes());
    bytes
}

/// As PNG has it (ISO 3309), bit by bit: what is said is short.
fn crc32(bytes: &[u8]) -> u32 {
    let step = |crc: u32, _| if crc & 1 == 1 { 0xedb8_8320 ^ (crc >> 1) } else { crc >> 1 };
    !bytes.iter().fold(u32::MAX, |crc, byte| (0..8).fold(crc ^ u32::from(*byte), step))
}

/// Signature (8) and IHDR chunk (25).
const HEADER_END: usize = 33;
/// Length 1, name, rendering intent 0 (perceptual), checksum.
const SRGB_CHUNK: [u8; 13] = [0, 0, 0, 1, b's', b'R', b'G', b'B', 0, 0xae, 0xce, 0x1c, 0xe9];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_it_says_is_read_by_others() {
        let picture = Image8 { width: 1, height: 1, pixels: vec![[1, 2, 3]] };
        let bytes = encode_png_saying(&picture, Some("denoised by a café\0 in 東京")).unwrap();
        assert_eq!(image::load_from_memory(&bytes).unwrap().to_rgb8().as_raw(), &[1, 2, 3]);
        let text = &bytes[HEADER_END + SRGB_CHUNK.len()..];
        assert_eq!(&text[4..8], b"tEXt");
        assert!(text[8..].starts_with(b"Comment\0denoised by a caf\xe9 in "), "{text:?}");
        assert_eq!(chunk(*b"sRGB", vec![0]), SRGB_CHUNK);
    }

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
