//! Colours one by one: nothing about a colour's bytes depends on its neighbours. For answers about single rays and
//! points, which must not depend on what else was asked with them.
//!
//! Four planes: exponent, R, G − R, B − R (RGBE; Ward 1991, "Real Pixels"). A channel is `mantissa · 2^(exponent − 8)`;
//! its error is below 1/127 of the largest channel, and colours that fit are exact.

use glam::Vec3;
use scenes::Rgb;

use super::dither::round;
use super::rgb::{exponent_above, power_of_two, sound};
use super::{PackError, Reader, planes_mut};

/// Bytes of one colour.
pub(super) const COLOUR: usize = 4;

/// Exponent of code 1; code 0 is black. Darker colours are rounded as if they were that bright.
const LEAST: i32 = -110;
/// That of [`super::LARGEST`], and one octave more to round it up.
const GREATEST: i32 = 122;
const MANTISSA_MAX: f32 = 255.0;

/// Writes colours, each rounded by the threshold of its number; true if one had to be cut down to [`super::LARGEST`].
pub(super) fn write(colours: &[Rgb], threshold: impl Fn(usize) -> f32, out: &mut Vec<u8>) -> bool {
    let [exponents, red, green, blue] = planes_mut(out, colours.len());
    for (i, colour) in colours.iter().enumerate() {
        let colour = sound(*colour);
        let largest = colour.max_element();
        if largest == 0.0 {
            continue;
        }
        let mut exponent = exponent_above(largest).max(LEAST);
        // Before anything is rounded: which way that goes must not decide on the step.
        if largest * power_of_two(8 - exponent) > MANTISSA_MAX {
            exponent += 1;
        }
        let (scale, threshold) = (power_of_two(8 - exponent), threshold(i));
        let [r, g, b] = colour.to_array().map(|x| round(x * scale, threshold) as u8);
        [red[i], green[i], blue[i]] = [r, g.wrapping_sub(r), b.wrapping_sub(r)];
        exponents[i] = (exponent - LEAST + 1) as u8;
    }
    colours.iter().any(|colour| colour.max_element() > super::LARGEST)
}

/// Reads what [`write`] wrote.
pub(super) fn read(from: &mut Reader, len: usize) -> Result<Vec<Rgb>, PackError> {
    let [exponents, red, green, blue] = from.planes(len)?;
    let colour = |i: usize| match exponents[i] {
        0 if [red[i], green[i], blue[i]] != [0; 3] => Err(PackError::Invalid("a black colour that is not")),
        0 => Ok(Vec3::ZERO),
        code if i32::from(code) + LEAST - 1 > GREATEST => Err(PackError::Invalid("an exponent out of range")),
        code => {
            let step = power_of_two(i32::from(code) + LEAST - 1 - 8);
            let r = red[i];
            Ok(Vec3::from_array([r, green[i].wrapping_add(r), blue[i].wrapping_add(r)].map(f32::from)) * step)
        }
    };
    (0..len).map(colour).collect()
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn there_and_back(colours: &[Rgb], threshold: f32) -> Vec<Rgb> {
        let mut bytes = Vec::new();
        write(colours, |_| threshold, &mut bytes);
        assert_eq!(bytes.len(), COLOUR * colours.len());
        read(&mut Reader { bytes: &bytes }, colours.len()).expect("it was just written")
    }

    #[test]
    fn what_fits_is_exact_and_what_is_too_much_is_cut() {
        let exact =
            [Vec3::ZERO, Vec3::ONE, Vec3::new(255.0, 1.0, 0.0), Vec3::splat(0.75), Vec3::splat(super::super::LARGEST)];
        assert_eq!(there_and_back(&exact, 0.0), exact);
        let mut bytes = Vec::new();
        assert!(write(&[Vec3::splat(1e38)], |_| 0.0, &mut bytes));
        let odd = [Vec3::new(f32::NAN, -1.0, 2.0), Vec3::splat(1e-44), Vec3::splat(f32::INFINITY)];
        let back = there_and_back(&odd, 0.5);
        assert_eq!(back, [Vec3::new(0.0, 0.0, 2.0), Vec3::ZERO, Vec3::splat(super::super::LARGEST)]);
    }

    #[test]
    fn rounding_has_no_bias() {
        for colour in [Vec3::new(0.3, 0.01, 0.2), Vec3::new(0.998_5, 0.5, 1e-4), Vec3::splat(3e-20)] {
            let n = 4096;
            let sum: Rgb = (0..n).map(|i| there_and_back(&[colour], (i as f32 + 0.5) / n as f32)[0] / n as f32).sum();
            assert!((sum - colour).abs().max_element() < colour.max_element() * 1e-5, "{sum} is not {colour}");
        }
    }

    proptest! {
        #[test]
        fn errors_are_small_beside_the_largest_channel(
            mantissas in prop::array::uniform3(0.0_f32..1.0), exponent in -100..118_i32, threshold in 0.0_f32..1.0,
        ) {
            let colour = Vec3::from_array(mantissas) * power_of_two(exponent);
            let back = there_and_back(&[colour], threshold)[0];
            prop_assert!((back - colour).abs().max_element() <= colour.max_element() / 127.0, "{back} is not {colour}");
        }

        /// Also its neighbours may be anything.
        #[test]
        fn any_bytes_are_refused_or_sound(bytes in prop::collection::vec(any::<u8>(), 0..80), len in 0..20_usize) {
            if let Ok(colours) = read(&mut Reader { bytes: &bytes }, len) {
                prop_assert!(colours.iter().all(|colour| colour.is_finite() && colour.min_element() >= 0.0));
            }
        }
    }
}
