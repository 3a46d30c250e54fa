//! OpenEXR: linear radiance, further layers, and all that repeats the render.

use std::io::Cursor;

use anyhow::Context;
use exr::prelude::*;
use frame::Picture;

/// Pairs of attribute name and value; names get the prefix `igi:`.
pub type Metadata = Vec<(&'static str, String)>;

/// The bytes of an EXR file: `picture` as channels R, G, B, and each of `layers` as `NAME.R` and
/// so on, or `NAME.Y` where one channel says it all. 32-bit float, ZIP.
///
/// # Errors
/// If the picture is empty or too large for the format.
pub fn encode_exr(
    picture: &Picture,
    layers: &[(&str, bool, Picture)],
    metadata: &[(&'static str, String)],
) -> anyhow::Result<Vec<u8>> {
    let mut channels = Vec::new();
    for (index, name) in ["R", "G", "B"].into_iter().enumerate() {
        channels.push(channel(name.to_string(), picture, index));
    }
    for (layer, coloured, picture) in layers {
        let names: &[&str] = if *coloured { &["R", "G", "B"] } else { &["Y"] };
        for (index, name) in names.iter().enumerate() {
            channels.push(channel(format!("{layer}.{name}"), picture, index));
        }
    }
    let size = (picture.width as usize, picture.height as usize);
    let layer = Layer::new(size, attributes(metadata), Encoding::SMALL_LOSSLESS, AnyChannels::sort(channels.into()));
    let mut bytes = Cursor::new(Vec::new());
    Image::from_layer(layer).write().to_buffered(&mut bytes).context("the picture cannot be encoded as EXR")?;
    Ok(bytes.into_inner())
}

/// What a file says of itself.
pub(super) fn attributes(metadata: &[(&'static str, String)]) -> LayerAttributes {
    let mut attributes = LayerAttributes { software_name: Some(Text::from(SOFTWARE)), ..LayerAttributes::default() };
    for (name, value) in metadata {
        attributes
            .other
            .insert(Text::from(format!("igi:{name}").as_str()), AttributeValue::Text(Text::from(value.as_str())));
    }
    attributes
}

pub(super) fn channel(name: String, picture: &Picture, index: usize) -> AnyChannel<FlatSamples> {
    let samples = picture.pixels.iter().map(|pixel| pixel[index]).collect();
    AnyChannel::new(name.as_str(), FlatSamples::F32(samples))
}

const SOFTWARE: &str = concat!("igi ", env!("CARGO_PKG_VERSION"));
