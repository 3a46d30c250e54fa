//! What layers look like: colours for quantities that are none.

use frame::front_end::{Colours, Mark};
use frame::tone::{Image8, Tone};
use frame::{Layer, Picture};
use glam::Vec3;
use scenes::photometry::{LUMENS_PER_WATT, photometric};
use serde::Serialize;

use super::encoded::ToneMapper;

/// What the colours of a layer mean.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Legend {
    /// What is shown.
    pub title: String,
    /// From the first colour to the last, if they are in an order.
    #[serde(flatten)]
    pub scale: Option<Scale>,
}

/// Numbers for the colours of a ramp.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Scale {
    /// Of the numbers.
    pub unit: &'static str,
    /// The first colour.
    pub from: f32,
    /// The last.
    pub to: f32,
    /// Equal steps of colour are equal factors.
    pub logarithmic: bool,
    /// The colours.
    pub ramp: Ramp,
}

impl Scale {
    /// The numbers that belong to the first colour, the one in the middle, and the last.
    pub fn marks(&self) -> [f32; 3] {
        let Self { from, to, .. } = *self;
        [from, if self.logarithmic { (from * to).sqrt() } else { 0.5 * (from + to) }, to]
    }
}

/// Colours for numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Ramp {
    /// From dark blue over green to dark red.
    Turbo,
    /// From white to dark.
    Grey,
}

/// The picture of a layer, and what its colours mean, if they are not its own.
pub(super) fn paint(
    layer: &Layer,
    picture: &Picture,
    tone: &Tone,
    tone_mapper: &mut dyn ToneMapper,
) -> (Image8, Option<Legend>) {
    match layer.colours {
        Colours::Light { title: "" } => (tone_mapper.tone_map(tone, picture), None),
        Colours::Light { title } => (tone_mapper.tone_map(tone, picture), titled(title)),
        // As a white wall would look: E/π.
        Colours::Wall => {
            let wall = each(picture, |pixel| pixel * std::f32::consts::FRAC_1_PI);
            (tone_mapper.tone_map(tone, &wall), titled("irradiance, as on a white wall"))
        }
        Colours::Plain => (Tone::PLAIN.develop(picture), None),
        Colours::Direction => {
            let code = |v: f32| ((v.clamp(-1.0, 1.0) * 0.5 + 0.5) * 255.0) as u8;
            (codes(picture, |pixel| pixel.to_array().map(code)), None)
        }
        Colours::Illuminance => {
            let lux = values(layer, picture);
            let most = percentile(&lux, 0.98);
            // Whole powers of two, nine of them.
            let top = (most.max(1e-6) * 1.5).log2().ceil().exp2();
            let bottom = top / 512.0;
            let shade = |lux: f32| if lux > 0.0 { turbo((lux / bottom).log2() / 9.0) } else { [0; 3] };
            let title = format!("illuminance (W/m² at {LUMENS_PER_WATT} lm/W)");
            (codes(&lux, |pixel| shade(pixel.x)), legend(&title, "lx", [bottom, top], true))
        }
        Colours::Ramp { title, unit, share, grey } => {
            let is_coloured = layer.exr.is_some_and(|channels| channels.coloured);
            let size = |pixel: Vec3| if is_coloured { pixel.element_sum() / 3.0 } else { pixel.x };
            let size = each(picture, |pixel| Vec3::splat(size(pixel)));
            let most = percentile(&size, share);
            let ramp = if grey { Ramp::Grey } else { Ramp::Turbo };
            let scale = Scale { unit, from: 0.0, to: most, logarithmic: false, ramp };
            let legend = Legend { title: title.into(), scale: Some(scale) };
            (codes(&size, |pixel| ramp.at(pixel.x / most)), Some(legend))
        }
        Colours::Numbers { title } => (codes(picture, |pixel| number_colour(pixel.x as u32)), titled(title)),
    }
}

/// The values that the colours of a layer stand for; the same in all channels where there is one a pixel.
pub(super) fn values(layer: &Layer, picture: &Picture) -> Picture {
    let is_single = layer.exr.is_some_and(|channels| !channels.coloured);
    match layer.colours {
        Colours::Illuminance => grey_values(picture, photometric),
        _ if is_single => grey_values(picture, |pixel| pixel.x),
        _ => picture.clone(),
    }
}

impl Ramp {
    /// The colour at a share of the way, 0..=1.
    pub fn at(self, share: f32) -> [u8; 3] {
        match self {
            Self::Turbo => turbo(share),
            Self::Grey => grey(1.0 - 0.9 * share),
        }
    }
}

/// Draws a method's marks, such as virtual lights: discs, and rings where something is before them; their area grows with their strength.
pub(super) fn marks(image: &mut Image8, marks: &[Mark]) {
    let unit = (image.height as f32 / 160.0).max(1.0);
    for Mark { x, y, strength, depth, hidden } in marks {
        let [x, y] = [x * image.width as f32, y * image.height as f32];
        let radius = unit * (1.2 + 1.8 * strength.sqrt());
        let around = |at: f32, side: u32| {
            let reach = radius + 1.5;
            ((at - reach).max(0.0) as u32)..((at + reach).max(0.0) as u32 + 1).min(side)
        };
        for row in around(y, image.height) {
            for column in around(x, image.width) {
                let far = (column as f32 + 0.5 - x).hypot(row as f32 + 0.5 - y);
                let edge = (far - radius).abs();
                let colour = match hidden {
                    // A dark rim, so that they are seen on white walls as well.
                    false if far < radius => light_colour(*depth),
                    false if edge < 1.2 => [0; 3],
                    true if edge < 0.7 => light_colour(*depth),
                    _ => continue,
                };
                image.pixels[(row * image.width + column) as usize] = colour;
            }
        }
    }
}

/// By the number of reflections.
fn light_colour(depth: u16) -> [u8; 3] {
    const COLOURS: [[u8; 3]; 5] = [[255, 214, 10], [0, 190, 255], [255, 60, 172], [120, 230, 80], [170, 120, 255]];
    COLOURS[usize::from(depth).min(COLOURS.len() - 1)]
}

/// A picture of this layer changes in every pixel from frame to frame, and says something while frames are few.
pub(super) fn is_light(layer: &Layer) -> bool {
    matches!(layer.colours, Colours::Light { .. } | Colours::Wall)
}

fn titled(title: &str) -> Option<Legend> {
    Some(Legend { title: title.into(), scale: None })
}

fn legend(title: &str, unit: &'static str, [from, to]: [f32; 2], logarithmic: bool) -> Option<Legend> {
    Some(Legend { title: title.into(), scale: Some(Scale { unit, from, to, logarithmic, ramp: Ramp::Turbo }) })
}

fn each(picture: &Picture, value: impl Fn(Vec3) -> Vec3) -> Picture {
    Picture { pixels: picture.pixels.iter().map(|pixel| value(*pixel)).collect(), ..*picture }
}

fn grey_values(picture: &Picture, value: impl Fn(Vec3) -> f32) -> Picture {
    each(picture, |pixel| Vec3::splat(value(pixel)))
}

fn codes(picture: &Picture, code: impl Fn(Vec3) -> [u8; 3]) -> Image8 {
    let pixels = picture.pixels.iter().map(|pixel| code(*pixel)).collect();
    Image8 { width: picture.width, height: picture.height, pixels }
}

/// The value below which that share of the positive first components lies; at least something above 0.
fn percentile(picture: &Picture, share: f64) -> f32 {
    let mut values: Vec<f32> = picture.pixels.iter().map(|p| p.x).filter(|v| v.is_finite() && *v > 0.0).collect();
    values.sort_unstable_by(f32::total_cmp);
    let rank = (share * values.len() as f64).ceil() as usize;
    values.get(rank.saturating_sub(1)).copied().unwrap_or(1.0)
}

fn grey(value: f32) -> [u8; 3] {
    [(value.clamp(0.0, 1.0) * 255.0) as u8; 3]
}

/// Turbo (Mikhailov 2019), its polynomial fit: from dark blue over green to dark red.
fn turbo(value: f32) -> [u8; 3] {
    let x = if value > 0.0 { value.min(1.0) } else { 0.0 };
    let horner = |c: [f32; 6]| c.iter().rev().fold(0.0, |sum, c| sum * x + c);
    let red = horner([0.135_721, 4.615_39, -42.660_32, 132.131_08, -152.942_4, 59.286_38]);
    let green = horner([0.091_402_6, 2.194_188, 4.842_966, -14.185_033, 4.277_298, 2.829_566]);
    let blue = horner([0.106_673, 12.641_946, -60.582_05, 110.362_77, -89.903_11, 27.348_25]);
    [red, green, blue].map(|v| (v.clamp(0.0, 1.0) * 255.0) as u8)
}

/// Colours that are far apart, for any number of workers: hues by the golden angle.
pub(super) fn number_colour(worker: u32) -> [u8; 3] {
    let hue = (worker as f32 * 0.618_034 + 0.58).fract() * 6.0;
    let channel = |shift: f32| {
        let h = (hue + shift) % 6.0;
        let v = (h - 3.0).abs() - 1.0;
        ((0.25 + 0.65 * v.clamp(0.0, 1.0)) * 255.0) as u8
    };
    [channel(0.0), channel(4.0), channel(2.0)]
}

#[cfg(test)]
mod tests {
    use super::super::encoded::CpuToneMapper;
    use super::*;

    #[test]
    fn every_layer_of_anything_can_be_painted() {
        let odd = [0.0, 1.0, -1.0, f32::INFINITY, f32::NAN, 1e30];
        let picture = Picture::from_fn(6, 6, |x, y| Vec3::new(odd[x as usize], odd[y as usize], 0.5));
        for what in crate::methods::all().iter().flat_map(|method| method.layers()) {
            assert_eq!(paint(what, &picture, &Tone::PLAIN, &mut CpuToneMapper).0.pixels.len(), 36);
            assert_eq!(paint(what, &Picture::black(2, 2), &Tone::PLAIN, &mut CpuToneMapper).0.pixels.len(), 4);
        }
    }

    #[test]
    fn lights_are_discs_and_hidden_ones_rings_wherever_they_lie() {
        let mark = |x, y, hidden| Mark { x, y, strength: 1.0, depth: 0, hidden };
        for (hidden, middle) in [(false, light_colour(0)), (true, [9; 3])] {
            let mut image = Image8 { width: 40, height: 40, pixels: vec![[9; 3]; 1600] };
            marks(&mut image, &[mark(0.5, 0.5, hidden), mark(0.0, 0.0, hidden), mark(0.999, 0.999, hidden)]);
            assert_eq!(image.pixels[20 * 40 + 20], middle);
            assert!(image.pixels.iter().filter(|pixel| **pixel == light_colour(0)).count() > 20);
            assert!(image.pixels.iter().filter(|pixel| **pixel == [9; 3]).count() > 1200);
        }
    }

    #[test]
    fn turbo_goes_from_blue_to_red() {
        let [low, high] = [turbo(0.1), turbo(0.9)];
        assert!(low[2] > low[0] && high[0] > high[2], "{low:?} {high:?}");
        assert_ne!(number_colour(0), number_colour(1));
    }
}
