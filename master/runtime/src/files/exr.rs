//! OpenEXR: linear radiance, further layers, and all that repeats the render.

use std::collections::BTreeMap;
use std::io::Cursor;
use std::path::Path;

use anyhow::Context;
use exr::meta::MetaData;
use exr::prelude::*;
use frame::Picture;

/// Pairs of attribute name and value; names get the prefix `igi:`.
pub type Metadata = Vec<(&'static str, String)>;

/// The attribute in which a picture says what light it lacks ([`frame::Method::misses`]).
pub const MISSES: &str = "misses";

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

/// What a file of ours says of itself, without the prefix `igi:`.
pub(super) fn own_words(attributes: &LayerAttributes) -> BTreeMap<String, String> {
    let ours = attributes.other.iter().filter_map(|(name, value)| match value {
        AttributeValue::Text(text) => Some((name.to_string().strip_prefix("igi:")?.to_owned(), text.to_string())),
        _ => None,
    });
    ours.collect()
}

/// Size of the picture, and what it says of itself, without reading its pixels.
///
/// # Errors
/// If the file is missing, or no EXR.
pub fn read_metadata(path: &Path) -> anyhow::Result<([u32; 2], BTreeMap<String, String>)> {
    let context = || format!("{}: cannot be read", path.display());
    let headers = MetaData::read_from_file(path, false).with_context(context)?.headers;
    let header = headers.first().context("it has no picture").with_context(context)?;
    let size = [header.layer_size.width() as u32, header.layer_size.height() as u32];
    Ok((size, own_words(&header.own_attributes)))
}

/// What light a picture says that it lacks; `None` if it says nothing, or is no EXR.
pub fn missing_from(path: &Path) -> Option<String> {
    read_metadata(path).ok()?.1.remove(MISSES)
}

pub(super) fn channel(name: String, picture: &Picture, index: usize) -> AnyChannel<FlatSamples> {
    let samples = picture.pixels.iter().map(|pixel| pixel[index]).collect();
    AnyChannel::new(name.as_str(), FlatSamples::F32(samples))
}

const SOFTWARE: &str = concat!("igi ", env!("CARGO_PKG_VERSION"));
