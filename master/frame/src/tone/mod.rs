//! From linear radiance to what a screen shows: exposure, tone curve, sRGB.

mod exposure;
mod operator;
mod srgb;

use rayon::prelude::*;

pub use exposure::{Exposure, STOPS_MAX};
pub use operator::Operator;
pub use srgb::{SrgbEncoder, linear_from_srgb};

use crate::Picture;

/// How a linear picture is developed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tone {
    /// Brightness before the curve.
    pub exposure: Exposure,
    /// The curve.
    pub operator: Operator,
}

/// A picture of 8 bits a channel, sRGB, row 0 at the top.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Image8 {
    /// Pixels.
    pub width: u32,
    /// Pixels.
    pub height: u32,
    /// `width · height` of them: red, green, blue.
    pub pixels: Vec<[u8; 3]>,
}

impl Tone {
    /// Shows radiance 1 as white and clips what is above: for comparing.
    pub const PLAIN: Self = Self { exposure: Exposure::Fixed(0.0), operator: Operator::None };

    /// Develops a picture. What is no number becomes black, what is infinite white: nothing here
    /// can fail, and [`crate::metrics`] counts such pixels.
    pub fn develop(&self, picture: &Picture) -> Image8 {
        let scale = self.exposure.scale(picture);
        let encoder = SrgbEncoder::new();
        let mut pixels = vec![[0; 3]; picture.pixels.len()];
        let parts = pixels.par_chunks_mut(PART).zip(picture.pixels.par_chunks(PART));
        parts.for_each(|(codes, radiance)| self.operator.develop(radiance, scale, &encoder, codes));
        Image8 { width: picture.width, height: picture.height, pixels }
    }
}

/// Pixels that a thread develops at a time.
const PART: usize = 4096;

impl Image8 {
    /// All three channels of all pixels, in order.
    pub fn bytes(&self) -> &[u8] {
        self.pixels.as_flattened()
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;

    const ALL: [Operator; 4] = [Operator::None, Operator::Reinhard, Operator::Aces, Operator::Agx];

    #[test]
    fn black_stays_black_white_becomes_white_and_greys_stay_grey_and_in_order() {
        for operator in ALL {
            let tone = Tone { exposure: Exposure::Fixed(0.0), operator };
            let ramp = Picture::from_fn(200, 1, |x, _| Vec3::splat(libm::exp2f(x as f32 / 10.0 - 13.0)));
            let image = tone.develop(&ramp);
            for pixel in &image.pixels {
                assert!(pixel.iter().all(|c| c.abs_diff(pixel[0]) <= 1), "{operator:?}: {pixel:?}");
            }
            assert!(image.pixels.windows(2).all(|w| w[0][0] <= w[1][0]), "{operator:?} is not monotone");
            assert!(image.pixels[0][0] <= 2 && image.pixels[199][0] >= 250, "{operator:?}: {:?}", image.pixels);
        }
    }

    #[test]
    fn anything_can_be_developed() {
        let odd = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, -1.0, f32::MAX, f32::MIN_POSITIVE];
        let picture = Picture::from_fn(6, 6, |x, y| Vec3::new(odd[x as usize], odd[y as usize], 0.5));
        for operator in ALL {
            for exposure in [Exposure::Auto, Exposure::Fixed(0.0), Exposure::Fixed(100.0), Exposure::Fixed(-100.0)] {
                let image = Tone { exposure, operator }.develop(&picture);
                assert_eq!(image.pixels.len(), 36);
            }
        }
        let image = Tone::PLAIN.develop(&picture);
        assert_eq!(image.pixels[0], [0, 0, 188]);
        assert_eq!(image.pixels[1], [255, 0, 188]);
    }

    #[test]
    fn fixed_exposure_counts_in_stops() {
        let tone = |stops| Tone { exposure: Exposure::Fixed(stops), ..Tone::PLAIN };
        let (one, four) =
            (Picture::from_fn(1, 1, |_, _| Vec3::splat(0.1)), Picture::from_fn(1, 1, |_, _| Vec3::splat(0.4)));
        assert_eq!(tone(2.0).develop(&one), tone(0.0).develop(&four));
    }
}
