//! LDR-FLIP: how different two pictures look to a person who flips between them.
//!
//! Andersson, Nilsson, Akenine-Möller, Oskarsson, Åström, Fairchild: *FLIP: A Difference Evaluator
//! for Alternating Images*, 2020. Written from the paper and checked against its authors'
//! evaluator (see the tests). 0: no difference; 1: as different as green and blue.

use glam::Vec3;
use rayon::prelude::*;

use crate::tone::{Image8, linear_from_srgb};

/// Per-pixel differences and their mean.
#[derive(Clone, Debug, PartialEq)]
pub struct FlipMap {
    /// Mean over all pixels, 0..=1.
    pub mean: f64,
    /// One a pixel, row by row, 0..=1.
    pub map: Vec<f32>,
}

/// Compares two pictures as shown, watched at [`PIXELS_PER_DEGREE`]; `None` if their sizes differ
/// or they are empty.
pub fn flip(reference: &Image8, test: &Image8) -> Option<FlipMap> {
    if (reference.width, reference.height) != (test.width, test.height) || test.pixels.is_empty() {
        return None;
    }
    let [a, b] = [reference, test].map(Seen::of);
    let (green, blue) = (hunt(lab(Vec3::Y)), hunt(lab(Vec3::Z)));
    let most = libm::powf(hyab(green, blue), COLOUR_POWER);
    let map: Vec<f32> = (0..test.pixels.len())
        .into_par_iter()
        .map(|pixel| {
            let colour = redistribute(libm::powf(hyab(a.colour[pixel], b.colour[pixel]), COLOUR_POWER), most);
            let edge = (a.edge[pixel] - b.edge[pixel]).abs();
            let point = (a.point[pixel] - b.point[pixel]).abs();
            let feature = libm::sqrtf(edge.max(point) * std::f32::consts::FRAC_1_SQRT_2);
            libm::powf(colour, 1.0 - feature.min(1.0))
        })
        .collect();
    let mean = map.iter().map(|value| f64::from(*value)).sum::<f64>() / map.len() as f64;
    Some(FlipMap { mean, map })
}

/// A colour for a value in 0..=1: Zucker's polynomial fit of the *magma* map, which FLIP uses.
/// Display values, not linear ones.
pub fn heat(value: f32) -> [u8; 3] {
    const POWERS: [Vec3; 7] = [
        Vec3::new(-0.002_136_485, -0.000_749_655, -0.005_386_128),
        Vec3::new(0.251_660_54, 0.677_523_24, 2.494_026_6),
        Vec3::new(8.353_717, -3.577_719_5, 0.314_467_9),
        Vec3::new(-27.668_733, 14.264_731, -13.649_213),
        Vec3::new(52.176_14, -27.943_606, 12.944_169),
        Vec3::new(-50.768_526, 29.046_583, 4.234_153),
        Vec3::new(18.655_705, -11.489_774, -5.601_961_5),
    ];
    let value = value.clamp(0.0, 1.0);
    let colour = POWERS.iter().rev().fold(Vec3::ZERO, |sum, power| sum * value + *power);
    colour.to_array().map(|channel| (channel.clamp(0.0, 1.0) * 255.0 + 0.5) as u8)
}

/// Resolution of the eye's picture: a screen 0.7 m wide with 3840 pixels, watched from 0.7 m.
pub const PIXELS_PER_DEGREE: f32 = 67.020_64;

/// Exponent on colour differences (q_c).
const COLOUR_POWER: f32 = 0.7;
/// Differences up to this fraction of the largest (p_c) are mapped to 0..=0.95 (p_t).
const KNEE: f32 = 0.4;
const KNEE_VALUE: f32 = 0.95;
/// Width of the edge and point detectors, degrees.
const FEATURE_WIDTH: f32 = 0.082;
/// Contrast sensitivities as sums of Gaussians, `a·√(π/b)·exp(−π²x²/b)`: achromatic, red-green,
/// blue-yellow.
const SENSITIVITY: [&[(f32, f32)]; 3] = [&[(1.0, 0.004_7)], &[(1.0, 0.005_3)], &[(34.1, 0.04), (13.5, 0.025)]];
const WIDEST: f32 = 0.04;

/// What the eye makes of a picture.
struct Seen {
    /// Filtered by contrast sensitivity; Hunt-adjusted CIELAB.
    colour: Vec<Vec3>,
    /// Strength of edges in lightness.
    edge: Vec<f32>,
    /// Strength of points in lightness.
    point: Vec<f32>,
}

impl Seen {
    fn of(image: &Image8) -> Self {
        let size = Size { width: image.width as usize, height: image.height as usize };
        let decode: Vec<f32> = (0..=255u8).map(|code| linear_from_srgb(f64::from(code) / 255.0) as f32).collect();
        let opponent: Vec<Vec3> =
            image.pixels.par_iter().map(|p| ycxcz(Vec3::from_array(p.map(|c| decode[usize::from(c)])))).collect();
        let channels = [0, 1, 2].map(|c| opponent.iter().map(|o| o[c]).collect::<Vec<f32>>());

        let [y, cx, cz] = std::array::from_fn(|c| contrast_filtered(&channels[c], size, SENSITIVITY[c]));
        let colour = |pixel| {
            let filtered = rgb_from_ycxcz(Vec3::new(y[pixel], cx[pixel], cz[pixel]));
            hunt(lab(filtered.clamp(Vec3::ZERO, Vec3::ONE)))
        };

        let lightness: Vec<f32> = channels[0].iter().map(|y| (y + 16.0) / 116.0).collect();
        let [gaussian, slope, curve] = feature_kernels();
        let detect = |kernel: &[f32]| {
            let across = convolved(&lightness, size, kernel, &gaussian);
            let down = convolved(&lightness, size, &gaussian, kernel);
            across.iter().zip(&down).map(|(x, y)| libm::sqrtf(x * x + y * y)).collect::<Vec<f32>>()
        };
        let (edge, point) = (detect(&slope), detect(&curve));
        Self { colour: (0..opponent.len()).into_par_iter().map(colour).collect(), edge, point }
    }
}

#[derive(Clone, Copy)]
struct Size {
    width: usize,
    height: usize,
}

/// Filters by a sum of Gaussians, normalised to leave flat areas as they are.
fn contrast_filtered(channel: &[f32], size: Size, sensitivity: &[(f32, f32)]) -> Vec<f32> {
    let pi = std::f32::consts::PI;
    let radius = libm::ceilf(3.0 * libm::sqrtf(WIDEST / (2.0 * pi * pi)) * PIXELS_PER_DEGREE) as i32;
    let mut total = 0.0;
    let mut sum = vec![0.0; channel.len()];
    for (a, b) in sensitivity {
        let gauss = |x: i32| libm::expf(-pi * pi * libm::powf(x as f32 / PIXELS_PER_DEGREE, 2.0) / b);
        let kernel: Vec<f32> = (-radius..=radius).map(gauss).collect();
        let scale = a * libm::sqrtf(pi / b);
        let area: f32 = kernel.iter().sum();
        total += scale * area * area;
        let term = convolved(channel, size, &kernel, &kernel);
        sum.iter_mut().zip(term).for_each(|(sum, term)| *sum += scale * term);
    }
    sum.iter_mut().for_each(|value| *value /= total);
    sum
}

/// A Gaussian and its first and second derivative; each derivative's positive weights add up to 1,
/// and so do its negative ones.
fn feature_kernels() -> [Vec<f32>; 3] {
    let deviation = 0.5 * FEATURE_WIDTH * PIXELS_PER_DEGREE;
    let radius = libm::ceilf(3.0 * deviation) as i32;
    let gauss = |x: i32| libm::expf(-((x * x) as f32) / (2.0 * deviation * deviation));
    let slope = |x: i32| -(x as f32) * gauss(x);
    let curve = |x: i32| ((x * x) as f32 / (deviation * deviation) - 1.0) * gauss(x);
    let balanced = |kernel: Vec<f32>| {
        let positive: f32 = kernel.iter().filter(|weight| **weight > 0.0).sum();
        let negative: f32 = -kernel.iter().filter(|weight| **weight < 0.0).sum::<f32>();
        let scale =
            |weight: f32| if weight > 0.0 { weight / positive } else { weight / negative.max(f32::MIN_POSITIVE) };
        kernel.into_iter().map(scale).collect()
    };
    let sampled = |kernel: &dyn Fn(i32) -> f32| (-radius..=radius).map(kernel).collect::<Vec<f32>>();
    [balanced(sampled(&gauss)), balanced(sampled(&slope)), balanced(sampled(&curve))]
}

/// Separable convolution; the picture's edge goes on for ever.
fn convolved(channel: &[f32], size: Size, across: &[f32], down: &[f32]) -> Vec<f32> {
    let Size { width, height } = size;
    let at = |centre: usize, tap: usize, taps: usize, len: usize| (centre + tap).saturating_sub(taps / 2).min(len - 1);
    let rows: Vec<f32> = (0..channel.len())
        .into_par_iter()
        .with_min_len(1024)
        .map(|i| {
            let (x, y) = (i % width, i / width);
            let tap = |(t, weight): (usize, &f32)| weight * channel[y * width + at(x, t, across.len(), width)];
            across.iter().enumerate().map(tap).sum()
        })
        .collect();
    (0..channel.len())
        .into_par_iter()
        .with_min_len(1024)
        .map(|i| {
            let (x, y) = (i % width, i / width);
            let tap = |(t, weight): (usize, &f32)| weight * rows[at(y, t, down.len(), height) * width + x];
            down.iter().enumerate().map(tap).sum()
        })
        .collect()
}

/// Tristimulus values of linear Rec. 709 over those of its white.
fn relative_xyz(rgb: Vec3) -> Vec3 {
    let x = 10_135_552.0 * rgb.x + 8_788_810.0 * rgb.y + 4_435_075.0 * rgb.z;
    let y = 2_613_072.0 * rgb.x + 8_788_810.0 * rgb.y + 887_015.0 * rgb.z;
    let z = 1_425_312.0 * rgb.x + 8_788_810.0 * rgb.y + 70_074_185.0 * rgb.z;
    Vec3::new(x / 23_359_437.0, y / 12_288_897.0, z / 80_288_307.0)
}

/// Lightness and two opponent colours, linear in radiance.
fn ycxcz(rgb: Vec3) -> Vec3 {
    let v = relative_xyz(rgb);
    Vec3::new(116.0 * v.y - 16.0, 500.0 * (v.x - v.y), 200.0 * (v.y - v.z))
}

fn rgb_from_ycxcz(colour: Vec3) -> Vec3 {
    let y = (colour.x + 16.0) / 116.0;
    let relative = glam::DVec3::new(f64::from(y + colour.y / 500.0), f64::from(y), f64::from(y - colour.z / 200.0));
    let xyz = relative * glam::DVec3::new(23_359_437.0 / 24_577_794.0, 1.0, 80_288_307.0 / 73_733_382.0);
    let rgb = glam::DMat3::from_cols(
        glam::DVec3::new(3.241_003_1, -0.969_224_4, 0.055_639_6),
        glam::DVec3::new(-1.537_398_9, 1.875_930_0, -0.204_011_2),
        glam::DVec3::new(-0.498_615_9, 0.041_554_2, 1.057_149_0),
    ) * xyz;
    rgb.as_vec3()
}

fn lab(rgb: Vec3) -> Vec3 {
    const DELTA: f32 = 6.0 / 29.0;
    let f = |v: f32| if v > DELTA * DELTA * DELTA { libm::cbrtf(v) } else { v / (3.0 * DELTA * DELTA) + 4.0 / 29.0 };
    let [x, y, z] = relative_xyz(rgb).to_array().map(f);
    Vec3::new(116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z))
}

/// Hunt effect: colours look stronger where it is bright.
fn hunt(lab: Vec3) -> Vec3 {
    Vec3::new(lab.x, 0.01 * lab.x * lab.y, 0.01 * lab.x * lab.z)
}

fn hyab(a: Vec3, b: Vec3) -> f32 {
    let d = a - b;
    d.x.abs() + libm::sqrtf(d.y * d.y + d.z * d.z)
}

/// Spreads the differences that occur over 0..=1.
fn redistribute(difference: f32, most: f32) -> f32 {
    let knee = KNEE * most;
    if difference < knee {
        difference * KNEE_VALUE / knee
    } else {
        KNEE_VALUE + (difference - knee) / (most - knee) * (1.0 - KNEE_VALUE)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn image(width: u32, height: u32, colour: impl Fn(u32, u32) -> [u8; 3]) -> Image8 {
        let pixels = (0..height).flat_map(|y| (0..width).map(move |x| (x, y))).map(|(x, y)| colour(x, y)).collect();
        Image8 { width, height, pixels }
    }

    #[test]
    fn the_opponent_space_can_be_left_again() {
        for rgb in [Vec3::new(0.2, 0.5, 0.9), Vec3::ONE, Vec3::X, Vec3::Z, Vec3::ZERO] {
            let there_and_back = rgb_from_ycxcz(ycxcz(rgb));
            assert!((there_and_back - rgb).abs().max_element() < 1e-5, "{rgb} became {there_and_back}");
        }
    }

    #[test]
    fn equal_pictures_look_equal() {
        let a = image(40, 30, |x, y| [(x * 6) as u8, (y * 8) as u8, 77]);
        assert_eq!(flip(&a, &a).unwrap().mean, 0.0);
    }

    #[test]
    fn green_and_blue_are_as_different_as_can_be() {
        let (green, blue) = (image(20, 20, |_, _| [0, 255, 0]), image(20, 20, |_, _| [0, 0, 255]));
        assert!((flip(&green, &blue).unwrap().mean - 1.0).abs() < 1e-4);
    }

    /// The expected numbers are those of the authors' own evaluator, flip-evaluator 1.7.
    #[test]
    fn the_authors_evaluator_finds_the_same() {
        let wrap = |value: u32| (value % 256) as u8;
        let ramps = image(64, 48, |x, y| [wrap(x * 4), wrap(y * 5), wrap(x * y / 7)]);
        let changed = image(64, 48, |x, y| {
            let checks = (x / 8 + y / 8) % 2 * 20;
            [wrap(x * 4 + checks), wrap(y * 5), wrap(x * y / 7 + if x > 40 { 9 } else { 0 })]
        });
        let grey = image(64, 48, |_, _| [128; 3]);
        let spot =
            image(64, 48, |x, y| if (30..33).contains(&x) && (20..23).contains(&y) { [200, 60, 90] } else { [128; 3] });
        let pixel = 21 * 64 + 31;
        for (a, b, mean, there) in [
            (&ramps, &changed, 0.188_968_73, 0.175_463_17),
            (&grey, &spot, 0.004_561_654_8, 0.587_832_15),
            (&ramps, &grey, 0.790_036_92, 0.440_800_2),
        ] {
            let found = flip(a, b).unwrap();
            assert!((found.mean - mean).abs() < 2e-5, "{} instead of {mean}", found.mean);
            assert!((found.map[pixel] - there).abs() < 2e-4, "{} instead of {there}", found.map[pixel]);
        }
    }

    #[test]
    fn pictures_of_different_sizes_are_refused() {
        assert_eq!(flip(&image(2, 3, |_, _| [0; 3]), &image(3, 2, |_, _| [0; 3])), None);
        assert_eq!(flip(&image(0, 0, |_, _| [0; 3]), &image(0, 0, |_, _| [0; 3])), None);
    }
}
