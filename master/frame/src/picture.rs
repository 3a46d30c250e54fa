//! A picture in linear light.

use glam::Vec3;
use sha2::{Digest, Sha256};

/// Linear Rec. 709 radiance (or any other three numbers a pixel), row 0 at the top.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Picture {
    /// Pixels.
    pub width: u32,
    /// Pixels.
    pub height: u32,
    /// `width · height` of them, row by row.
    pub pixels: Vec<Vec3>,
}

impl Picture {
    /// All black.
    pub fn black(width: u32, height: u32) -> Self {
        Self { width, height, pixels: vec![Vec3::ZERO; width as usize * height as usize] }
    }

    /// One colour for every pixel.
    pub fn from_fn(width: u32, height: u32, mut colour: impl FnMut(u32, u32) -> Vec3) -> Self {
        let pixels = (0..height).flat_map(|y| (0..width).map(move |x| (x, y))).map(|(x, y)| colour(x, y)).collect();
        Self { width, height, pixels }
    }

    /// The pixel in column `x` and row `y`, which must lie in the picture.
    pub fn at(&self, x: u32, y: u32) -> Vec3 {
        self.pixels[y as usize * self.width as usize + x as usize]
    }

    /// SHA-256 of width and height (`u32`) and all pixels' red, green and blue (`f32` bits), row by row,
    /// everything little-endian: equal if and only if the pictures are the same bits.
    pub fn sha256(&self) -> [u8; 32] {
        let mut hash = Sha256::new();
        hash.update(self.width.to_le_bytes());
        hash.update(self.height.to_le_bytes());
        for row in self.pixels.chunks(self.width.max(1) as usize) {
            let bytes: Vec<u8> = row.iter().flat_map(|p| p.to_array()).flat_map(f32::to_le_bytes).collect();
            hash.update(&bytes);
        }
        hash.finalize().into()
    }

    /// Each pixel the mean of `factor`² pixels; `None` unless the factor divides both sides.
    pub fn shrunk(&self, factor: u32) -> Option<Self> {
        if factor == 0 || !self.width.is_multiple_of(factor) || !self.height.is_multiple_of(factor) {
            return None;
        }
        let block =
            |x: u32, y: u32| (0..factor * factor).map(move |i| (x * factor + i % factor, y * factor + i / factor));
        let mean = |x: u32, y: u32| {
            let sum: glam::DVec3 = block(x, y).map(|(x, y)| self.at(x, y).as_dvec3()).sum();
            (sum / f64::from(factor * factor)).as_vec3()
        };
        Some(Self::from_fn(self.width / factor, self.height / factor, mean))
    }

    /// The picture at another size, as a screen enlarges it: each pixel is mixed of the four whose middles lie around its own
    /// (bilinear).
    pub fn enlarged(&self, width: u32, height: u32) -> Self {
        if self.pixels.is_empty() {
            return Self::black(width, height);
        }
        // Between which two columns or rows, and how far from the first.
        let between = |at: u32, side: u32, own: u32| {
            let place = ((at as f32 + 0.5) * own as f32 / side as f32 - 0.5).clamp(0.0, (own - 1) as f32);
            let first = place as u32;
            (first, (first + 1).min(own - 1), place - first as f32)
        };
        Self::from_fn(width, height, |x, y| {
            let (left, right, across) = between(x, width, self.width);
            let (top, bottom, down) = between(y, height, self.height);
            let row = |y: u32| self.at(left, y).lerp(self.at(right, y), across);
            row(top).lerp(row(bottom), down)
        })
    }

    /// The same number of columns and of rows.
    pub fn same_size(&self, other: &Self) -> bool {
        (self.width, self.height) == (other.width, other.height)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn enlarging_mixes_what_is_around_and_keeps_a_picture_of_that_size() {
        let picture = Picture::from_fn(2, 1, |x, _| Vec3::splat(4.0 * x as f32));
        let large = picture.enlarged(4, 2);
        assert_eq!((0..4).map(|x| large.at(x, 1).x).collect::<Vec<_>>(), [0.0, 1.0, 3.0, 4.0]);
        assert_eq!(picture.enlarged(2, 1), picture);
        assert_eq!(Picture::default().enlarged(2, 2), Picture::black(2, 2));
    }

    #[test]
    fn shrinking_takes_means_of_blocks() {
        let picture = Picture::from_fn(4, 2, |x, y| Vec3::splat((x + 10 * y) as f32));
        let small = picture.shrunk(2).unwrap();
        assert_eq!((small.width, small.height), (2, 1));
        assert_eq!([small.at(0, 0).x, small.at(1, 0).x], [5.5, 7.5]);
        assert_eq!(picture.shrunk(1), Some(picture.clone()));
        assert_eq!([picture.shrunk(4), picture.shrunk(0)], [None, None]);
    }
}
