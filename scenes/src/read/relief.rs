//! Bump maps into normal maps.
//!
//! The format says neither how high white is nor what stands behind `map_Bump`: many exporters (Blender's among them) write
//! normal maps there. So a picture that is bluish, its red and green about a half, is taken for normals as it is; of all
//! others, the lightness is a height.

use image::DynamicImage;

use super::textures::texels;
use crate::{LookUp, Wrap};

/// How much higher white is than black, in widths of the picture.
const HEIGHT: f32 = 0.01;

/// Normals of a picture of heights, or the picture if it is one of normals already; as they are stored, 128 being 0.
pub(super) fn normals(image: DynamicImage, look_up: LookUp) -> Vec<[u8; 4]> {
    let (width, height) = (image.width() as usize, image.height() as usize);
    let grey = image.to_luma16();
    let plain = texels(image);
    if shows_normals(&plain) {
        return plain;
    }
    let heights = grey.as_raw();
    let beside = |i: usize, step: isize, size: usize, wrap: Wrap| {
        let moved = i as isize + step;
        match wrap {
            Wrap::Repeat => moved.rem_euclid(size as isize) as usize,
            Wrap::Clamp | Wrap::Mirror => moved.clamp(0, size as isize - 1) as usize,
        }
    };
    let at = |x: usize, y: usize| f32::from(heights[y * width + x]) / 65535.0;
    let steepness = HEIGHT * width as f32 / 2.0;
    let byte = |part: f32| ((part * 127.0).round() + 128.0).clamp(0.0, 255.0) as u8;
    let mut normals = Vec::with_capacity(plain.len());
    for y in 0..height {
        let [above, below] = [-1, 1].map(|step| beside(y, step, height, look_up.up));
        for x in 0..width {
            let [left, right] = [-1, 1].map(|step| beside(x, step, width, look_up.across));
            // v points up.
            let (along_u, along_v) = (at(right, y) - at(left, y), at(x, above) - at(x, below));
            let normal = glam::Vec3::new(-along_u * steepness, -along_v * steepness, 1.0).normalize();
            normals.push([byte(normal.x), byte(normal.y), byte(normal.z), u8::MAX]);
        }
    }
    normals
}

/// Bluish, and red and green about a half.
fn shows_normals(texels: &[[u8; 4]]) -> bool {
    let mean =
        |channel: usize| texels.iter().map(|texel| f64::from(texel[channel])).sum::<f64>() / texels.len().max(1) as f64;
    let [red, green, blue] = [0, 1, 2].map(mean);
    blue - red > 40.0 && blue - green > 40.0 && (red - 128.0).abs() < 48.0 && (green - 128.0).abs() < 48.0
}

#[cfg(test)]
mod tests {
    use image::{GrayImage, Luma, Rgb, RgbImage};

    use super::*;

    #[test]
    fn a_slope_leans_against_what_rises() {
        let image = GrayImage::from_fn(100, 4, |x, _| Luma([(x * 2) as u8]));
        let normals = normals(DynamicImage::ImageLuma8(image), LookUp::CLAMP);
        let [x, y, z, _] = normals[50];
        assert!(x < 128 && y == 128 && z > 128, "{x} {y} {z}");
        // Two of 255 a texel, a hundredth of a hundred texels high: a slope of 2 / 255.
        assert_eq!(128 - x, 1);
    }

    #[test]
    fn heights_go_on_beyond_the_edge_where_the_picture_is_repeated() {
        let image = GrayImage::from_fn(4, 1, |x, _| Luma([if x == 0 { 255 } else { 0 }]));
        let repeated = normals(DynamicImage::ImageLuma8(image.clone()), LookUp::REPEAT);
        let clamped = normals(DynamicImage::ImageLuma8(image), LookUp::CLAMP);
        assert!(repeated[3][0] < 128, "{:?}", repeated[3]);
        assert_eq!(clamped[3][0], 128);
    }

    #[test]
    fn what_looks_like_normals_is_left_alone() {
        let image = RgbImage::from_pixel(2, 2, Rgb([120, 140, 250]));
        assert_eq!(normals(DynamicImage::ImageRgb8(image), LookUp::REPEAT), [[120, 140, 250, 255]; 4]);
    }
}
