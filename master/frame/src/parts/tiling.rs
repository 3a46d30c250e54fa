//! How a picture is cut into rectangles.

use protocol::question::{Quality, Rect};

/// A picture cut into equal rectangles; those at the right and lower edges may be smaller.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Tiling {
    /// Width of the picture, pixels; at least 1.
    pub width: u32,
    /// Height of the picture, pixels; at least 1.
    pub height: u32,
    /// Width of a rectangle, pixels; at least 1.
    pub tile_width: u32,
    /// Height of a rectangle, pixels; at least 1.
    pub tile_height: u32,
}

impl Tiling {
    /// Rectangles in which each light set has about 64×32 pixels: enough work to be worth an answer's way
    /// (half as many pixels cost 6 % of the frames/s), little enough that the slowest task does not hold up
    /// a frame. Small pictures get smaller ones, so that a frame still makes a few dozen tasks.
    pub fn of(width: u32, height: u32, quality: &Quality) -> Self {
        let edge = |axis: usize| (PIXELS_PER_SET[axis] * u32::from(quality.interleave[axis])).max(1);
        let [mut tile_width, mut tile_height] = [edge(0), edge(1)];
        let smallest = quality.interleave.map(|i| SMALLEST_PER_SET_EDGE * u32::from(i));
        let tasks =
            |w: u32, h: u32| u64::from(width.div_ceil(w)) * u64::from(height.div_ceil(h)) * u64::from(quality.sets());
        while tasks(tile_width, tile_height) < TASKS_WANTED {
            let halved = if tile_width >= tile_height { &mut tile_width } else { &mut tile_height };
            *halved = halved.div_ceil(2);
            if tile_width < smallest[0].max(1) || tile_height < smallest[1].max(1) {
                break;
            }
        }
        Self { width, height, tile_width: tile_width.min(width), tile_height: tile_height.min(height) }
    }

    /// Number of rectangles in a row.
    pub fn columns(&self) -> u32 {
        self.width.div_ceil(self.tile_width)
    }

    /// Number of rows of rectangles.
    pub fn rows(&self) -> u32 {
        self.height.div_ceil(self.tile_height)
    }

    /// Number of rectangles.
    pub fn len(&self) -> usize {
        self.columns() as usize * self.rows() as usize
    }

    /// There is nothing to draw.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// A rectangle by its number, row by row.
    pub fn rect(&self, index: usize) -> Rect {
        let columns = self.columns() as usize;
        let x = (index % columns) as u32 * self.tile_width;
        let y = (index / columns) as u32 * self.tile_height;
        Rect { x, y, width: self.tile_width.min(self.width - x), height: self.tile_height.min(self.height - y) }
    }

    /// The number of a rectangle, if it is one of these.
    pub fn index(&self, rect: Rect) -> Option<usize> {
        if rect.x >= self.width || rect.y >= self.height {
            return None;
        }
        let (column, row) = (rect.x / self.tile_width, rect.y / self.tile_height);
        let index = row as usize * self.columns() as usize + column as usize;
        (self.rect(index) == rect).then_some(index)
    }
}

const PIXELS_PER_SET: [u32; 2] = [64, 32];
const SMALLEST_PER_SET_EDGE: u32 = 8;
const TASKS_WANTED: u64 = 64;

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn rectangles_cover_every_pixel_once(
            width in 1u32..400, height in 1u32..300, n in 1u8..=16, m in 1u8..=16
        ) {
            let tiling = Tiling::of(width, height, &Quality { interleave: [n, m], ..Quality::default() });
            let mut seen = vec![0u8; (width * height) as usize];
            for index in 0..tiling.len() {
                let rect = tiling.rect(index);
                prop_assert_eq!(tiling.index(rect), Some(index));
                for y in rect.y..rect.y + rect.height {
                    for x in rect.x..rect.x + rect.width {
                        seen[(y * width + x) as usize] += 1;
                    }
                }
            }
            prop_assert!(seen.iter().all(|count| *count == 1));
        }
    }

    #[test]
    fn ordinary_pictures_get_64_by_32_pixels_a_set() {
        let tiling = Tiling::of(640, 480, &Quality::default());
        assert_eq!((tiling.tile_width, tiling.tile_height), (192, 96));
    }

    #[test]
    fn foreign_rectangles_are_not_found() {
        let tiling = Tiling::of(640, 480, &Quality::default());
        assert_eq!(tiling.index(Rect { x: 1, y: 0, width: 192, height: 96 }), None);
        assert_eq!(tiling.index(Rect { x: 640, y: 0, width: 192, height: 96 }), None);
        assert_eq!(tiling.index(Rect { x: 0, y: 0, width: 191, height: 96 }), None);
    }
}
