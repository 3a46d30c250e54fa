//! How large pictures are that people look at: as large as the place for them, pixel for pixel, as far as there is
//! memory.

use frame::Chosen;
use protocol::answer::Fields;
use scenes::Camera;

use crate::memory;

/// Most pixels of a picture on a viewer's screen: 3840×2160. `--size` may ask for more.
pub(super) const PIXELS_MAX: u64 = 3840 * 2160;
/// Shortest side of a picture, pixels.
const SIDE_MIN: u32 = 32;
/// Longest side over the shortest.
const LONGEST: f64 = 5.0;
/// Pictures leave this share of the free memory to workers and to everything else: one over this.
const MEMORY_LEFT: u64 = 2;

/// The size for a screen of these pixels, width and height; smaller, of the same shape, where they are too many.
pub(super) fn fitted(now: &Camera, screen: [u32; 2], method: &Chosen, fields: Fields) -> [u32; 2] {
    let one = Camera { width: 1, height: 1, ..*now };
    let bytes = |camera: &Camera| method.memory_bytes(camera, fields).max(1);
    // What the picture of now takes is free again then.
    let free = memory::available_bytes().saturating_add(bytes(now));
    within((free / MEMORY_LEFT / bytes(&one)).min(PIXELS_MAX), screen)
}

/// The largest size of this shape, up to its own, with no more pixels than allowed.
pub(super) fn within(allowed: u64, screen: [u32; 2]) -> [u32; 2] {
    let [width, height] = screen.map(|side| f64::from(side.max(1)));
    let shape = (width / height).clamp(1.0 / LONGEST, LONGEST);
    let least = f64::from(SIDE_MIN).powi(2) * shape.max(1.0 / shape);
    let pixels = (width * height).min(allowed as f64).max(least);
    let height = (pixels / shape).sqrt();
    [height * shape, height].map(|side| (side.round() as u32).max(SIDE_MIN))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_screen_is_filled_pixel_for_pixel() {
        for screen in [[1157, 900], [2314, 1800], [390, 371], [780, 742], [3840, 2160], [33, 150], [1919, 1079]] {
            assert_eq!(within(PIXELS_MAX, screen), screen);
        }
    }

    #[test]
    fn where_it_is_too_large_or_none_the_picture_keeps_its_shape_or_is_made_to_fit() {
        for screen in [[7680, 4320], [390, 84_400], [1, 1], [0, 0], [u32::MAX, 1], [u32::MAX, u32::MAX]] {
            let [width, height] = within(PIXELS_MAX, screen);
            assert!(u64::from(width) * u64::from(height) <= PIXELS_MAX + 4096, "{screen:?}: {width}x{height}");
            assert!(width.min(height) >= SIDE_MIN && width.max(height) <= 5 * width.min(height), "{width}x{height}");
        }
        assert_eq!(within(640 * 480, [1280, 960]), [640, 480], "little memory");
    }
}
