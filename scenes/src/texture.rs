//! Looking up textures: bilinear unless they say otherwise, in linear colour, the same bits on every machine.
//!
//! Texel centres lie at half-integers; `v = 0` is the bottom of the image, whose row 0 is the top.
//! sRGB texels are decoded **before** they are mixed, as light mixes linearly.

use std::sync::LazyLock;

use crate::{LookUp, Pixels, Rgb, Texture, Wrap};
use glam::{Vec2, Vec3};

/// Linear colour of a texture at `uv`: bilinear, sRGB decoded. Coordinates that are not finite count as 0.
pub fn colour(texture: &Texture, uv: Vec2) -> Rgb {
    colour_of(texture, &Patch::at(texture, uv, texture.look_up))
}

/// The same of a sky in all directions: longitude goes round, latitude ends at the poles.
pub fn sky_colour(texture: &Texture, uv: Vec2) -> Rgb {
    colour_of(texture, &Patch::at(texture, uv, SKY))
}

/// How all skies are looked up.
const SKY: LookUp = LookUp { up: Wrap::Clamp, ..LookUp::REPEAT };

/// Texture coordinates of a direction in a sky that is turned by so many whole turns: `u = ½ + atan2(x, −z)/2π − turn`, `v = 1`
/// straight up.
pub fn sky_uv(direction: Vec3, turn: f32) -> Vec2 {
    const TURN: f32 = std::f32::consts::TAU;
    let u = 0.5 + libm::atan2f(direction.x, -direction.z) / TURN - turn;
    // Not by the arc sine, which tells nothing apart near the poles.
    let across = (direction.x * direction.x + direction.z * direction.z).sqrt();
    Vec2::new(u, 0.5 + libm::atan2f(direction.y, across) / (TURN / 2.0))
}

fn colour_of(texture: &Texture, patch: &Patch) -> Rgb {
    match &texture.pixels {
        Pixels::Srgb8(texels) => patch.mix(|i| srgb(texels[i])),
        Pixels::Linear8(texels) => patch.mix(|i| linear(texels[i])),
        Pixels::Float(texels) => patch.mix(|i| Vec3::from(texels[i])),
    }
}

/// Red, green and blue at `uv` as they are stored, 0..1, without any sRGB decoding.
pub fn data(texture: &Texture, uv: Vec2) -> Vec3 {
    let patch = Patch::at(texture, uv, texture.look_up);
    match &texture.pixels {
        Pixels::Srgb8(texels) | Pixels::Linear8(texels) => patch.mix(|i| linear(texels[i])),
        Pixels::Float(texels) => patch.mix(|i| Vec3::from(texels[i])),
    }
}

/// Linear colour of one texel, row by row from the top.
pub fn texel(texture: &Texture, index: usize) -> Rgb {
    match &texture.pixels {
        Pixels::Srgb8(texels) => srgb(texels[index]),
        Pixels::Linear8(texels) => linear(texels[index]),
        Pixels::Float(texels) => Vec3::from(texels[index]),
    }
}

/// One channel (0..=3: red, green, blue, alpha) at `uv`, bilinear, 8-bit values as `value / 255` without
/// any sRGB decoding. Textures without alpha have alpha 1.
pub fn channel(texture: &Texture, uv: Vec2, channel: u8) -> f32 {
    let patch = Patch::at(texture, uv, texture.look_up);
    let channel = usize::from(channel.min(3));
    match &texture.pixels {
        Pixels::Srgb8(texels) | Pixels::Linear8(texels) => patch.mix(|i| unit(texels[i][channel])),
        Pixels::Float(texels) => patch.mix(|i| texels[i].get(channel).copied().unwrap_or(1.0)),
    }
}

/// The four texels around a point and how near it is to each.
struct Patch {
    /// Bottom-up in `v` is top-down in rows: `[upper left, upper right, lower left, lower right]`.
    texels: [usize; 4],
    right: f32,
    lower: f32,
}

impl Patch {
    fn at(texture: &Texture, uv: Vec2, look_up: LookUp) -> Self {
        let (x0, x1, right) = neighbours(uv.x, texture.width, look_up.across);
        let (y0, y1, lower) = neighbours(1.0 - uv.y, texture.height, look_up.up);
        let nearest = |weight: f32| if look_up.nearest { f32::from(u8::from(weight >= 0.5)) } else { weight };
        let (right, lower) = (nearest(right), nearest(lower));
        let width = texture.width as usize;
        Self { texels: [y0 * width + x0, y0 * width + x1, y1 * width + x0, y1 * width + x1], right, lower }
    }

    fn mix<T>(&self, texel: impl Fn(usize) -> T) -> T
    where
        T: std::ops::Add<Output = T> + std::ops::Mul<f32, Output = T>,
    {
        let [a, b, c, d] = self.texels.map(texel);
        let upper = a * (1.0 - self.right) + b * self.right;
        let lower = c * (1.0 - self.right) + d * self.right;
        upper * (1.0 - self.lower) + lower * self.lower
    }
}

/// The two texels beside coordinate `s` (1 = the whole image) and the weight of the second.
fn neighbours(s: f32, size: u32, wrap: Wrap) -> (usize, usize, f32) {
    let s = if s.is_finite() { s } else { 0.0 };
    let s = match wrap {
        Wrap::Repeat => s - s.floor(),
        Wrap::Clamp => s.clamp(0.0, 1.0),
        Wrap::Mirror => {
            let s = s - 2.0 * (s * 0.5).floor();
            if s > 1.0 { 2.0 - s } else { s }
        }
    };
    let x = s * size as f32 - 0.5;
    let first = x.floor();
    let (last, first_texel) = (i64::from(size) - 1, first as i64);
    let texel = |i: i64| match wrap {
        Wrap::Repeat if i < 0 => last,
        Wrap::Repeat if i > last => 0,
        _ => i.clamp(0, last),
    };
    (texel(first_texel) as usize, texel(first_texel + 1) as usize, x - first)
}

fn unit(byte: u8) -> f32 {
    f32::from(byte) / 255.0
}

fn linear(texel: [u8; 4]) -> Vec3 {
    Vec3::new(unit(texel[0]), unit(texel[1]), unit(texel[2]))
}

fn srgb(texel: [u8; 4]) -> Vec3 {
    let table = &*DECODED;
    Vec3::new(table[usize::from(texel[0])], table[usize::from(texel[1])], table[usize::from(texel[2])])
}

/// Linear value of each sRGB byte (IEC 61966-2-1).
static DECODED: LazyLock<[f32; 256]> = LazyLock::new(|| {
    std::array::from_fn(|byte| {
        let encoded = byte as f64 / 255.0;
        let decoded = if encoded <= 0.04045 { encoded / 12.92 } else { libm::pow((encoded + 0.055) / 1.055, 2.4) };
        decoded as f32
    })
});

#[cfg(test)]
mod tests {
    use super::*;

    fn two_by_two(look_up: LookUp) -> Texture {
        let texel = |grey: u8| [grey, grey, grey, 255 - grey];
        // Rows from the top: black white / grey black.
        let pixels = Pixels::Linear8(vec![texel(0), texel(255), texel(51), texel(0)]);
        Texture { name: String::new(), width: 2, height: 2, pixels, look_up }
    }

    #[test]
    fn texel_centres_are_exact_and_v_points_up() {
        let texture = two_by_two(LookUp::REPEAT);
        assert_eq!(channel(&texture, Vec2::new(0.25, 0.75), 0), 0.0);
        assert_eq!(channel(&texture, Vec2::new(0.75, 0.75), 0), 1.0);
        assert_eq!(channel(&texture, Vec2::new(0.25, 0.25), 0), 0.2);
        assert_eq!(channel(&texture, Vec2::new(0.25, 0.25), 3), 0.8);
        assert_eq!(colour(&texture, Vec2::new(0.5, 0.75)), Vec3::splat(0.5));
    }

    #[test]
    fn edges_tile_or_stretch() {
        assert_eq!(channel(&two_by_two(LookUp::REPEAT), Vec2::new(0.0, 0.75), 0), 0.5);
        assert_eq!(channel(&two_by_two(LookUp::CLAMP), Vec2::new(0.0, 0.75), 0), 0.0);
        assert_eq!(channel(&two_by_two(LookUp::CLAMP), Vec2::new(9.0, 0.75), 0), 1.0);
        let (near, far) = (Vec2::new(0.3, 0.6), Vec2::new(-3.7, 4.6));
        assert!(
            (channel(&two_by_two(LookUp::REPEAT), near, 0) - channel(&two_by_two(LookUp::REPEAT), far, 0)).abs() < 1e-5
        );
    }

    const MIRROR: LookUp = LookUp { across: Wrap::Mirror, up: Wrap::Clamp, nearest: false, set: 0 };

    #[test]
    fn edges_mirror_and_each_way_has_its_own() {
        let texture = two_by_two(MIRROR);
        for (s, expected) in
            [(0.25, 0.0), (0.75, 1.0), (1.0, 1.0), (1.25, 1.0), (1.75, 0.0), (2.25, 0.0), (-0.25, 0.0), (-0.75, 1.0)]
        {
            assert_eq!(channel(&texture, Vec2::new(s, 0.75), 0), expected, "{s}");
        }
        assert_eq!(channel(&texture, Vec2::new(0.75, 7.0), 0), 1.0, "clamped upwards");
    }

    #[test]
    fn the_nearest_texel_is_not_mixed() {
        let texture = two_by_two(LookUp { nearest: true, ..LookUp::REPEAT });
        for (s, expected) in [(0.01, 0.0), (0.49, 0.0), (0.51, 1.0), (0.99, 1.0), (1.01, 0.0)] {
            assert_eq!(channel(&texture, Vec2::new(s, 0.75), 0), expected, "{s}");
        }
    }

    #[test]
    fn srgb_is_decoded_before_mixing_but_alpha_never() {
        let pixels = Pixels::Srgb8(vec![[0, 0, 0, 128], [255, 188, 255, 128]]);
        let texture = Texture { name: String::new(), width: 2, height: 1, pixels, look_up: LookUp::CLAMP };
        assert_eq!(colour(&texture, Vec2::new(0.5, 0.5)).x, 0.5);
        assert!((colour(&texture, Vec2::new(1.0, 0.5)).y - 0.502_886).abs() < 1e-5);
        assert_eq!(channel(&texture, Vec2::new(0.5, 0.5), 3), 128.0 / 255.0);
        assert_eq!(channel(&texture, Vec2::new(1.0, 0.5), 1), 188.0 / 255.0);
    }

    #[test]
    fn nonsense_coordinates_still_give_a_texel() {
        for wrap in [LookUp::REPEAT, LookUp::CLAMP, MIRROR] {
            for s in [f32::NAN, f32::INFINITY, -f32::MAX, f32::MAX, -1e-30, 1.0] {
                assert!(channel(&two_by_two(wrap), Vec2::splat(s), 0).is_finite());
            }
        }
    }
}
