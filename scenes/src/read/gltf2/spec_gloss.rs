//! KHR_materials_pbrSpecularGlossiness in terms of metalness and roughness.
//!
//! As the Khronos group's converter does it: what reflects more along the normal than a non-metal can, or has no diffuse
//! colour of its own, is metal in part (`extensions/2.0/Archived/KHR_materials_pbrSpecularGlossiness/examples`).

use glam::{Vec3, Vec4};

/// F₀ of a non-metal.
const DIELECTRIC: f32 = 0.04;

/// The other terms for a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Metallic {
    /// Linear, 0..1.
    pub base: Vec3,
    pub metalness: f32,
    /// Perceptual.
    pub roughness: f32,
}

/// Of a diffuse and a specular colour (linear), and a glossiness.
pub(super) fn metallic(diffuse: Vec3, specular: Vec3, glossiness: f32) -> Metallic {
    const LEAST: f32 = 1e-6;
    let rest = 1.0 - specular.max_element();
    let metalness = solve(brightness(diffuse), brightness(specular), rest);
    let of_diffuse = diffuse * (rest / (1.0 - DIELECTRIC) / (1.0 - metalness).max(LEAST));
    let of_specular = (specular - Vec3::splat(DIELECTRIC * (1.0 - metalness))) / metalness.max(LEAST);
    let base = of_diffuse.lerp(of_specular, metalness * metalness).clamp(Vec3::ZERO, Vec3::ONE);
    Metallic { base, metalness, roughness: (1.0 - glossiness).clamp(0.0, 1.0) }
}

/// The metalness at which both terms reflect alike.
fn solve(diffuse: f32, specular: f32, rest: f32) -> f32 {
    if specular < DIELECTRIC {
        return 0.0;
    }
    let a = DIELECTRIC;
    let b = diffuse * rest / (1.0 - DIELECTRIC) + specular - 2.0 * DIELECTRIC;
    let c = DIELECTRIC - specular;
    let d = (b * b - 4.0 * a * c).max(0.0);
    ((-b + d.sqrt()) / (2.0 * a)).clamp(0.0, 1.0)
}

/// As it is perceived.
fn brightness(colour: Vec3) -> f32 {
    let squares = colour * colour;
    (0.299 * squares.x + 0.587 * squares.y + 0.114 * squares.z).sqrt()
}

/// Texels of base colour (sRGB, with the diffuse texture's alpha) and of roughness and metalness (green and blue).
#[derive(Debug, Default)]
pub(super) struct Texels {
    pub base: Vec<[u8; 4]>,
    pub data: Vec<[u8; 4]>,
}

impl Texels {
    /// Adds a texel: a diffuse colour with alpha and a specular colour with glossiness, both linear.
    pub fn add(&mut self, diffuse: Vec4, specular: Vec4) {
        let found = metallic(diffuse.truncate(), specular.truncate(), specular.w);
        let [r, g, b] = found.base.to_array().map(encoded);
        self.base.push([r, g, b, byte(diffuse.w)]);
        self.data.push([u8::MAX, byte(found.roughness), byte(found.metalness), u8::MAX]);
    }
}

fn byte(value: f32) -> u8 {
    (value * 255.0).round().clamp(0.0, 255.0) as u8
}

/// IEC 61966-2-1.
fn encoded(linear: f32) -> u8 {
    byte(if linear <= 0.003_130_8 { linear * 12.92 } else { 1.055 * libm::powf(linear, 1.0 / 2.4) - 0.055 })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn plastic_stays_plastic_and_gold_becomes_gold() {
        let plastic = metallic(Vec3::new(0.0, 0.1, 0.8), Vec3::splat(0.04), 0.7);
        assert!(plastic.metalness < 0.01 && (plastic.base.z - 0.8).abs() < 0.01, "{plastic:?}");
        assert!((plastic.roughness - 0.3).abs() < 1e-6);
        let colour = Vec3::new(1.0, 0.77, 0.34);
        let gold = metallic(Vec3::ZERO, colour, 1.0);
        assert!(gold.metalness > 0.99 && (gold.base - colour).length() < 0.01, "{gold:?}");
    }

    #[test]
    fn texels_are_encoded_as_colours_and_as_numbers() {
        let mut texels = Texels::default();
        texels.add(Vec4::new(1.0, 0.214_04, 0.0, 0.5), Vec4::new(0.0, 0.0, 0.0, 0.25));
        // Without specular reflection, a non-metal's diffuse colour over what it would reflect.
        assert_eq!(texels.base[0][3], 128);
        assert_eq!(texels.data[0], [255, 191, 0, 255]);
        assert!(texels.base[0][0] == 255 && (127..=131).contains(&texels.base[0][1]), "{:?}", texels.base[0]);
    }
}
