//! How bright a picture is taken.

use glam::Vec3;

use super::operator::log2;
use crate::Picture;

/// Brightness before the tone curve.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Exposure {
    /// Stops: radiance is multiplied by 2^EV.
    Fixed(f32),
    /// The logarithmic mean of the luminances becomes middle grey, 0.18. The darkest tenth and the
    /// brightest twentieth do not count, nor do black pixels, so that neither a lamp in the picture
    /// nor a black background decides.
    Auto,
}

impl Exposure {
    /// Stops for this picture.
    pub fn stops(self, picture: &Picture) -> f32 {
        match self {
            Self::Fixed(stops) => stops,
            Self::Auto => {
                let mean = log_mean(picture).unwrap_or(log2(MIDDLE_GREY));
                (log2(MIDDLE_GREY) - mean).clamp(-STOPS_MAX, STOPS_MAX)
            }
        }
    }

    /// The factor for this picture; finite.
    pub fn scale(self, picture: &Picture) -> f32 {
        libm::exp2f(self.stops(picture).clamp(-STOPS_MAX, STOPS_MAX))
    }
}

/// Relative luminance of linear Rec. 709.
#[inline(always)]
pub(super) fn luminance(colour: Vec3) -> f32 {
    colour.dot(Vec3::new(0.2126, 0.7152, 0.0722))
}

/// Mean log₂ of the luminances between two quantiles.
fn log_mean(picture: &Picture) -> Option<f32> {
    let luminances = picture.pixels.iter().map(|pixel| luminance(*pixel));
    let mut logs: Vec<f32> = luminances.filter(|l| l.is_finite() && *l > 0.0).map(log2).collect();
    logs.sort_unstable_by(f32::total_cmp);
    let (darkest, brightest) = (logs.len() / 10, logs.len() - logs.len() / 20);
    let middle = &logs[darkest..brightest];
    (!middle.is_empty()).then(|| (middle.iter().map(|log| f64::from(*log)).sum::<f64>() / middle.len() as f64) as f32)
}

const MIDDLE_GREY: f32 = 0.18;
/// Exposures are at most so many stops either way: a sun's disc is shown at -17, starlight at 20.
pub const STOPS_MAX: f32 = 60.0;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn auto_exposure_turns_an_even_picture_to_middle_grey() {
        for radiance in [1e-6, 0.18, 3.0, 1e5] {
            let picture = Picture::from_fn(8, 8, |_, _| Vec3::splat(radiance));
            let shown = radiance * Exposure::Auto.scale(&picture);
            assert!((shown / 0.18 - 1.0).abs() < 1e-4, "{radiance} became {shown}");
        }
    }

    #[test]
    fn a_lamp_and_a_black_background_do_not_decide() {
        let room = |x: u32, y: u32| {
            Vec3::splat(if x == 0 && y < 3 {
                1e4
            } else if y > 10 {
                0.0
            } else {
                0.5
            })
        };
        let stops = Exposure::Auto.stops(&Picture::from_fn(16, 16, room));
        assert!((stops - libm::log2f(0.18 / 0.5)).abs() < 1e-3, "{stops}");
    }

    #[test]
    fn a_black_picture_is_left_alone() {
        assert_eq!(Exposure::Auto.stops(&Picture::black(4, 4)), 0.0);
        assert_eq!(Exposure::Auto.stops(&Picture::default()), 0.0);
    }
}
