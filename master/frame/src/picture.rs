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

    /// The same number of columns and of rows.
    pub fn same_size(&self, other: &Self) -> bool {
        (self.width, self.height) == (other.width, other.height)
    }
}
