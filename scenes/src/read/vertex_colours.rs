//! Colours of OBJ's vertices: three numbers behind a position (MeshLab, scanners), or ZBrush's `#MRGB` comments.
//!
//! The format knows neither. Values are sRGB, as those programs show them: of 0 to 1, or of 0 to 255 if one is above 1.

use super::mesh::WHITE;
use super::text::{self, Line};
use super::textures::srgb_to_linear;

/// Begins ZBrush's comments.
pub(super) const PAINT: &str = "#MRGB ";

/// Colours as they gather.
#[derive(Default)]
pub(super) struct VertexColours {
    /// sRGB as written; white for vertices before the first that has one.
    written: Vec<[f64; 3]>,
    /// Vertices so far.
    vertices: usize,
    brightest: f64,
    painted: Vec<[u16; 4]>,
}

impl VertexColours {
    /// A line `v x y z`, and perhaps `r g b` behind it.
    pub fn vertex(&mut self, line: &Line) {
        let mut words = line.arguments().skip(3);
        let mut part = || words.next().and_then(text::finite);
        if let (Some(r), Some(g), Some(b)) = (part(), part(), part()) {
            self.written.resize(self.vertices, [f64::NAN; 3]);
            self.written.push([r, g, b]);
            self.brightest = self.brightest.max(r).max(g).max(b);
        }
        self.vertices += 1;
    }

    /// `#MRGB` and words of eight hexadecimal digits in a row, one a vertex: a mask, red, green, blue.
    pub fn paint(&mut self, text: &str) {
        for line in text.lines().filter_map(|line| line.strip_prefix(PAINT)) {
            let digits = line.trim_ascii().as_bytes();
            for word in digits.chunks_exact(8) {
                let code = std::str::from_utf8(word).ok().and_then(|word| u32::from_str_radix(word, 16).ok());
                let [_, r, g, b] = code.unwrap_or(u32::MAX).to_be_bytes();
                let part = |byte: u8| (srgb_to_linear(byte) * 65535.0).round() as u16;
                self.painted.push([part(r), part(g), part(b), u16::MAX]);
            }
        }
    }

    /// Those of the vertices that follow.
    pub fn append(&mut self, mut later: Self) {
        if !later.written.is_empty() {
            self.written.resize(self.vertices, [f64::NAN; 3]);
            self.written.append(&mut later.written);
        }
        self.vertices += later.vertices;
        self.brightest = self.brightest.max(later.brightest);
        self.painted.append(&mut later.painted);
    }

    /// Linear colours, one for each of `count` positions; none if the file has none.
    pub fn finish(mut self, count: usize) -> Vec<[u16; 4]> {
        if self.written.is_empty() {
            if !self.painted.is_empty() {
                self.painted.resize(count, WHITE);
            }
            return self.painted;
        }
        self.written.resize(count, [f64::NAN; 3]);
        let scale = if self.brightest > 1.0 { 1.0 } else { 255.0 };
        let part = |value: f64| {
            // Between two codes, linearly: values need not be eight bits.
            let code = (value * scale).clamp(0.0, 255.0);
            let (low, high) = (srgb_to_linear(code.floor() as u8), srgb_to_linear(code.ceil() as u8));
            let linear = f64::from(low) + f64::from(high - low) * code.fract();
            (linear * 65535.0).round() as u16
        };
        let colour = |[r, g, b]: [f64; 3]| if r.is_nan() { WHITE } else { [part(r), part(g), part(b), u16::MAX] };
        self.written.into_iter().map(colour).collect()
    }
}
