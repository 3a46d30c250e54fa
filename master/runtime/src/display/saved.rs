//! What is saved of what is shown: the same layer with the same exposure and curve, and below it what its colours mean
//! and what the light meter reads.

use std::sync::Arc;

use frame::front_end::Mark;
use frame::tone::Image8;
use frame::{Layer, Picture};

use super::encoded::{CpuToneMapper, DisplaySettings};
use super::paint::{self, Legend};
use super::{letters, short_number};
use crate::display::message::{MeterReading, Spot};
use crate::files::{Metadata, OutputKind, encode_exr, encode_png_saying};

/// The picture as it is now.
#[derive(Debug)]
pub struct Taken {
    /// The scene's name and the layer's, as a file may be called; without number and ending.
    pub name: String,
    /// The layer, its own values.
    pub picture: Arc<Picture>,
    /// How it is shown.
    pub settings: DisplaySettings,
    /// The method's marks over it, if they are shown.
    pub marks: Vec<Mark>,
    /// Where the light meter stands, if it does, and what it reads.
    pub meter: Option<(Spot, Option<MeterReading>)>,
    /// What else is known, for EXR.
    pub metadata: Metadata,
    /// Of a mix: what each lamp brings, by its name, for EXR.
    pub lamps: Vec<(String, Picture)>,
}

impl Taken {
    /// The file.
    ///
    /// # Errors
    /// The picture is too large for it.
    pub fn encode(&self, kind: OutputKind) -> anyhow::Result<Vec<u8>> {
        match kind {
            OutputKind::Png => {
                let denoiser = self.metadata.iter().find(|(name, _)| *name == "denoiser");
                let comment = denoiser.map(|(_, denoiser)| format!("denoised by {denoiser}"));
                encode_png_saying(&self.image(), comment.as_deref())
            }
            OutputKind::Exr => {
                let layer = &self.settings.layer;
                let mut metadata = self.metadata.clone();
                let name = if layer.file.is_empty() { "picture" } else { layer.file };
                metadata.extend([("layer", name.into()), ("values", layer.values.into())]);
                metadata.extend(self.reading().map(|reading| ("meter", reading)));
                // As `igi-master mix` has them, and reads them again.
                let numbered: Vec<String> = (1..=self.lamps.len()).map(|number| format!("lamp{number}")).collect();
                if !self.lamps.is_empty() {
                    let names: Vec<&str> = self.lamps.iter().map(|(name, _)| name.as_str()).collect();
                    metadata.push(("lamps", serde_json::to_string(&names)?));
                    metadata.push(("factors", serde_json::to_string(&vec![[1.0_f32; 3]; names.len()])?));
                }
                let lamps = numbered.iter().zip(&self.lamps);
                let layers: Vec<_> = lamps.map(|(layer, (_, share))| (layer.as_str(), true, share.clone())).collect();
                encode_exr(&paint::values(layer, &self.picture), &layers, &metadata)
            }
        }
    }

    /// As viewers see it.
    fn image(&self) -> Image8 {
        let DisplaySettings { layer, tone, .. } = &self.settings;
        let (mut image, legend) = paint::paint(layer, &self.picture, tone, &mut CpuToneMapper);
        paint::marks(&mut image, &self.marks);
        if let Some((spot, _)) = self.meter {
            cross(&mut image, spot);
        }
        match (legend, self.reading()) {
            (None, None) => image,
            (legend, reading) => with_caption(image, legend.as_ref(), reading.as_deref()),
        }
    }

    fn reading(&self) -> Option<String> {
        let (spot, measured) = self.meter?;
        let place = format!("at {:.0} %, {:.0} % from the top left", spot.x * 100.0, spot.y * 100.0);
        Some(measured.map_or(format!("meter {place}: nothing there"), |found| {
            let [lux, candela, distance] = [found.lux, found.candela_per_m2, found.distance].map(short_number);
            format!("meter {place}: {lux} lx, {candela} cd/m², {distance} away")
        }))
    }
}

/// A scene's name as a file's, with the layer's: without what leads elsewhere.
pub fn file_name(scene: &str, layer: &Layer) -> String {
    let kept = scene.chars().take(NAME_MAX).map(|c| if c.is_alphanumeric() || "-_".contains(c) { c } else { '_' });
    let name: String = kept.collect();
    let name = if name.is_empty() { "igi".into() } else { name };
    if layer.file.is_empty() { name } else { format!("{name}-{}", layer.file) }
}

/// Characters of a scene's name that files have.
const NAME_MAX: usize = 60;
const BACKDROP: [u8; 3] = [17, 18, 20];
const INK: [u8; 3] = [235; 3];
/// Points around the caption, and height of the ramp, before they are enlarged.
const MARGIN: u32 = 5;
const RAMP: u32 = 8;

/// Where the light meter stands: a cross in black and white, seen on any ground.
fn cross(image: &mut Image8, spot: Spot) {
    let place = |share: f32, side: u32| (share.clamp(0.0, 1.0) * side as f32) as u32;
    let [x, y] = [place(spot.x, image.width), place(spot.y, image.height)];
    let arm = (image.height / 60).max(3);
    for (colour, more) in [([0; 3], 1), ([255; 3], 0)] {
        let (thick, long) = (1 + 2 * more, 2 * (arm + more) + 1);
        let back = |from: u32, by: u32| from.saturating_sub(by);
        letters::fill(image, [back(x, arm + more), back(y, more)], [long, thick], colour);
        letters::fill(image, [back(x, more), back(y, arm + more)], [thick, long], colour);
    }
}

/// The picture, untouched, and below it a strip with legend and reading.
pub fn with_caption(image: Image8, legend: Option<&Legend>, reading: Option<&str>) -> Image8 {
    let size = (image.width / 420).max(1);
    let margin = MARGIN * size;
    let inner = image.width.saturating_sub(2 * margin).max(1);
    let broken = |text: &str| letters::broken(text, (inner / (letters::ADVANCE * size)) as usize);
    let titles = legend.map_or(Vec::new(), |legend| broken(&legend.title));
    let readings = reading.map_or(Vec::new(), broken);
    let scale = legend.and_then(|legend| legend.scale);
    let ramp = scale.map_or(0, |_| (RAMP + 3 + letters::LINE) * size);
    let lines = (titles.len() + readings.len()) as u32 * letters::LINE * size;
    let strip = 2 * margin + ramp + lines;

    let Image8 { width, height, mut pixels } = image;
    pixels.resize(width as usize * (height + strip) as usize, BACKDROP);
    let mut image = Image8 { width, height: height + strip, pixels };
    let mut y = height + margin;
    let write = |image: &mut Image8, y: &mut u32, lines: Vec<String>| {
        for line in lines {
            letters::draw(image, &line, [margin, *y], size, INK);
            *y += letters::LINE * size;
        }
    };
    write(&mut image, &mut y, titles);
    if let Some(scale) = scale {
        for column in 0..inner {
            let colour = scale.ramp.at((column as f32 + 0.5) / inner as f32);
            letters::fill(&mut image, [margin + column, y], [1, RAMP * size], colour);
        }
        y += (RAMP + 3) * size;
        let numbers = scale.marks().map(|value| format!("{} {}", short_number(value), scale.unit).trim().to_owned());
        let wide = |text: &str| text.chars().count() as u32 * letters::ADVANCE * size;
        // The middle one only where there is room for it.
        let has_room = numbers.iter().map(|text| wide(text) + letters::ADVANCE * size).sum::<u32>() <= inner;
        for (text, share) in numbers.iter().zip([0, 1, 2]).filter(|(_, share)| has_room || *share != 1) {
            let x = margin + inner.saturating_sub(wide(text)) * share / 2;
            letters::draw(&mut image, text, [x, y], size, INK);
        }
        y += letters::LINE * size;
    }
    write(&mut image, &mut y, readings);
    image
}

#[cfg(test)]
mod tests {
    use frame::tone::{Exposure, Tone};
    use glam::Vec3;

    use super::*;

    fn taken(layer: Layer, [width, height]: [u32; 2]) -> Taken {
        let picture = Picture::from_fn(width, height, |x, y| Vec3::new(x as f32 + 0.1, y as f32, 0.5));
        let tone = Tone { exposure: Exposure::Fixed(-3.0), ..Tone::PLAIN };
        let (settings, name) = (DisplaySettings { layer, tone, denoise: false }, file_name("room", &layer));
        let picture = picture.into();
        let (marks, lamps, metadata) = (Vec::new(), Vec::new(), Vec::new());
        Taken { name, picture, settings, marks, meter: None, metadata, lamps }
    }

    fn decoded(bytes: &[u8]) -> image::RgbImage {
        image::load_from_memory(bytes).unwrap().to_rgb8()
    }

    /// The pixels people see come first, and the strip below them says what they mean.
    #[test]
    fn a_layer_is_saved_as_it_is_shown_with_its_legend_below() {
        for size in [[400, 300], [40, 20], [1, 1]] {
            for layer in crate::methods::all().iter().flat_map(|method| method.layers()) {
                let taken = taken(*layer, size);
                let (shown, legend) = paint::paint(layer, &taken.picture, &taken.settings.tone, &mut CpuToneMapper);
                let saved = decoded(&taken.encode(OutputKind::Png).unwrap());
                assert_eq!(saved.width(), size[0]);
                assert_eq!(saved.height() > size[1], legend.is_some(), "{layer:?}");
                assert!(saved.as_raw().starts_with(shown.bytes()), "{layer:?}");
            }
        }
        let lux = decoded(&taken(Layer::LUX, [400, 300]).encode(OutputKind::Png).unwrap());
        let strip: Vec<_> = lux.pixels().skip(400 * 300).collect();
        let inks = strip.iter().filter(|pixel| pixel.0 == INK).count();
        let colours: std::collections::BTreeSet<_> = strip.iter().map(|pixel| pixel.0).collect();
        assert!(inks > 300 && colours.len() > 100, "{inks} points of letters, {} colours", colours.len());
    }

    #[test]
    fn the_meter_is_marked_and_read() {
        let bare = taken(Layer::FINAL, [200, 100]);
        let measured = MeterReading { lux: 512.0, candela_per_m2: 163.0, distance: 3.2, ..MeterReading::default() };
        let with = Taken { meter: Some((Spot { x: 0.5, y: 0.25 }, Some(measured))), ..taken(Layer::FINAL, [200, 100]) };
        assert_eq!(with.reading().unwrap(), "meter at 50 %, 25 % from the top left: 512 lx, 163 cd/m², 3.20 away");
        let [bare, with] = [bare, with].map(|taken| decoded(&taken.encode(OutputKind::Png).unwrap()));
        assert_eq!((bare.height(), with.get_pixel(100, 25).0), (100, [255; 3]));
        let touched =
            (0..200 * 100).filter(|at| bare.get_pixel(at % 200, at / 200) != with.get_pixel(at % 200, at / 200));
        assert!(touched.count() < 100 && with.height() > 100);
        // In a corner, too.
        let corner = Taken { meter: Some((Spot { x: 1.0, y: 0.0 }, None)), ..taken(Layer::LUX, [9, 9]) };
        assert!(corner.encode(OutputKind::Png).is_ok() && corner.reading().unwrap().contains("nothing"));
    }

    #[test]
    fn the_exr_of_a_layer_has_its_own_values() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.exr");
        let saved = |layer: Layer| {
            let taken = taken(layer, [8, 4]);
            std::fs::write(&path, taken.encode(OutputKind::Exr).unwrap()).unwrap();
            (taken.picture, crate::files::read_picture(&path).unwrap(), crate::files::read_metadata(&path).unwrap().1)
        };
        let (picture, read, words) = saved(Layer::LUX);
        assert_eq!(read.pixels, paint::values(&Layer::LUX, &picture).pixels);
        assert_eq!((words["layer"].as_str(), words["values"].as_str()), ("illuminance", "lx"));
        let (picture, read, _) = saved(Layer::DISTANCE);
        assert!(read.pixels.iter().zip(&picture.pixels).all(|(read, value)| *read == Vec3::splat(value.x)));
        let (picture, read, _) = saved(Layer::FINAL);
        assert_eq!(read.pixels, picture.pixels);
    }

    #[test]
    fn files_are_named_after_scene_and_layer_and_lead_nowhere_else() {
        assert_eq!(file_name("Sponza 2", &Layer::FINAL), "Sponza_2");
        assert_eq!(file_name("../../etc/passwd", &Layer::LUX), "______etc_passwd-illuminance");
        assert_eq!(file_name("", &Layer::ERROR), "igi-error");
        assert_eq!(file_name(&"x".repeat(500), &Layer::FINAL).len(), NAME_MAX);
    }
}
