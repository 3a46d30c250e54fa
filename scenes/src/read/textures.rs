//! Images into textures: found, decoded once, bounded and cleaned.

use std::collections::BTreeMap;
use std::io::Cursor;
use std::path::{Component, Path, PathBuf};

use exr::prelude::{ReadChannels, ReadLayers};
use image::{DynamicImage, ImageReader};

use super::ReadError;
use super::exr_header::check_exr;
use super::limits::{self, TEXTURE_BYTES_MAX, TEXTURE_SIDE_MAX};
use crate::{Pixels, Texture, Wrap};

/// What the numbers of an image mean.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Meaning {
    /// Colour, sRGB-encoded if the file has 8 or 16 bits a channel.
    Colour,
    /// Numbers, linear: roughness, masks.
    Data,
    /// Radiance, linear: environments.
    Radiance,
}

/// A scene's textures as they gather; the same image with the same meaning is stored once.
#[derive(Debug, Default)]
pub(super) struct Textures {
    /// Becomes [`crate::Scene::textures`].
    pub list: Vec<Texture>,
    known: BTreeMap<(PathBuf, Meaning, bool), Option<u32>>,
    bytes: u64,
}

impl Textures {
    /// Goes on where another reader ended.
    pub fn after(list: Vec<Texture>) -> Self {
        let bytes = list.iter().map(size).sum();
        Self { list, bytes, ..Self::default() }
    }

    /// The texture in a file, or nothing (and a note) if there is no such file.
    pub fn file(
        &mut self,
        folder: &Path,
        name: &str,
        meaning: Meaning,
        wrap: Wrap,
        missing: impl FnOnce(String),
    ) -> Result<Option<u32>, ReadError> {
        let Some(path) = find(folder, name) else {
            missing(format!("texture `{name}` does not exist; the plain colour is used"));
            return Ok(None);
        };
        let key = (path.clone(), meaning, wrap == Wrap::Clamp);
        if let Some(&known) = self.known.get(&key) {
            return Ok(known);
        }
        let bytes = limits::read_bytes(&path)?;
        let index = self.add(&path, name, &bytes, meaning, wrap)?;
        self.known.insert(key, Some(index));
        Ok(Some(index))
    }

    /// The texture in an encoded image; `path` is for messages.
    pub fn add(
        &mut self,
        path: &Path,
        name: &str,
        bytes: &[u8],
        meaning: Meaning,
        wrap: Wrap,
    ) -> Result<u32, ReadError> {
        let image = decode(path, bytes)?;
        let texture = convert(image, name, meaning, wrap);
        self.bytes += size(&texture);
        if self.bytes > TEXTURE_BYTES_MAX {
            let gib = TEXTURE_BYTES_MAX >> 30;
            return Err(ReadError::file(path, format!("with it, textures take more than {gib} GiB; shrink some")));
        }
        self.list.push(texture);
        Ok((self.list.len() - 1) as u32)
    }
}

/// Memory that a texture takes.
fn size(texture: &Texture) -> u64 {
    let bytes = match &texture.pixels {
        Pixels::Srgb8(texels) | Pixels::Linear8(texels) => size_of_val(texels.as_slice()),
        Pixels::Float(texels) => size_of_val(texels.as_slice()),
    };
    bytes as u64
}

/// By content, so that a PNG named `.jpg` is read.
fn decode(path: &Path, bytes: &[u8]) -> Result<DynamicImage, ReadError> {
    let refuse = |message: String| ReadError::file(path, message);
    if bytes.starts_with(&exr::meta::magic_number::BYTES) {
        return decode_exr(bytes).map_err(|message| refuse(format!("the image cannot be decoded: {message}")));
    }
    let mut reader = ImageReader::new(Cursor::new(bytes))
        .with_guessed_format()
        .map_err(|error| refuse(format!("the image cannot be read: {error}")))?;
    if reader.format().is_none() {
        // Some kinds (TGA) have no mark at their start.
        let format = image::ImageFormat::from_path(path)
            .map_err(|_| refuse("is no image of a known kind; use PNG, JPEG, TGA, BMP or HDR".into()))?;
        reader.set_format(format);
    }
    let mut bounds = image::Limits::default();
    bounds.max_image_width = Some(TEXTURE_SIDE_MAX);
    bounds.max_image_height = Some(TEXTURE_SIDE_MAX);
    bounds.max_alloc = Some(TEXTURE_BYTES_MAX);
    reader.limits(bounds);
    let image = reader.decode().map_err(|error| refuse(format!("the image cannot be decoded: {error}")))?;
    if image.width() == 0 || image.height() == 0 {
        return Err(refuse("the image has no pixels".into()));
    }
    if image.width().max(image.height()) > TEXTURE_SIDE_MAX {
        return Err(refuse(format!("the image is larger than {TEXTURE_SIDE_MAX} pixels to a side; shrink it")));
    }
    Ok(image)
}

/// The first layer with red, green and blue, once its size is known to be bearable.
fn decode_exr(bytes: &[u8]) -> Result<DynamicImage, String> {
    check_exr(bytes, TEXTURE_SIDE_MAX)?;
    let picture = exr::prelude::read()
        .no_deep_data()
        .largest_resolution_level()
        .rgb_channels(
            |size, _| image::Rgb32FImage::new(size.0 as u32, size.1 as u32),
            |image, at, (r, g, b): (f32, f32, f32)| image.put_pixel(at.0 as u32, at.1 as u32, image::Rgb([r, g, b])),
        )
        .first_valid_layer()
        .all_attributes()
        .from_buffered(Cursor::new(bytes))
        .map_err(|error| error.to_string())?;
    Ok(DynamicImage::ImageRgb32F(picture.layer_data.channel_data.pixels))
}

fn convert(image: DynamicImage, name: &str, meaning: Meaning, wrap: Wrap) -> Texture {
    let (width, height) = (image.width(), image.height());
    let is_float = matches!(image, DynamicImage::ImageRgb32F(_) | DynamicImage::ImageRgba32F(_));
    let pixels = match meaning {
        Meaning::Colour if !is_float => Pixels::Srgb8(texels(image)),
        Meaning::Data => Pixels::Linear8(texels(image)),
        Meaning::Radiance if !is_float => {
            let linear = |texel: [u8; 4]| [0, 1, 2].map(|channel| srgb_to_linear(texel[channel]));
            Pixels::Float(texels(image).into_iter().map(linear).collect())
        }
        Meaning::Colour => Pixels::Float(floats(image, 1.0)),
        Meaning::Radiance => Pixels::Float(floats(image, f32::MAX)),
    };
    Texture { name: name.into(), width, height, pixels, wrap }
}

fn texels(image: DynamicImage) -> Vec<[u8; 4]> {
    image.into_rgba8().into_raw().chunks_exact(4).map(|texel| [texel[0], texel[1], texel[2], texel[3]]).collect()
}

/// Finite, not negative and not above `most`.
fn floats(image: DynamicImage, most: f32) -> Vec<[f32; 3]> {
    let clean = |value: f32| if value >= 0.0 { value.min(most) } else { 0.0 };
    image.into_rgb32f().into_raw().chunks_exact(3).map(|texel| [texel[0], texel[1], texel[2]].map(clean)).collect()
}

/// IEC 61966-2-1.
fn srgb_to_linear(value: u8) -> f32 {
    let encoded = f64::from(value) / 255.0;
    let linear = if encoded <= 0.04045 { encoded / 12.92 } else { libm::pow((encoded + 0.055) / 1.055, 2.4) };
    linear as f32
}

/// Where a name leads: as written, with `\` for `/`, in another case, or by its last part alone in
/// the folder or one of the usual places (files move; absolute paths of other machines mean nothing).
pub(super) fn find(folder: &Path, name: &str) -> Option<PathBuf> {
    let slashed = name.replace('\\', "/");
    let exact = folder.join(&slashed);
    if exact.is_file() {
        return Some(exact);
    }
    let last = slashed.rsplit('/').next().unwrap_or(&slashed);
    let tries = std::iter::once(slashed.clone())
        .chain(["", "tex/", "textures/", "maps/"].map(|place| format!("{place}{last}")));
    tries.filter_map(|name| find_in_any_case(folder, Path::new(&name))).next()
}

fn find_in_any_case(folder: &Path, name: &Path) -> Option<PathBuf> {
    let mut path = folder.to_owned();
    for part in name.components() {
        let Component::Normal(part) = part else {
            path.push(part);
            continue;
        };
        let wanted = part.to_string_lossy().to_lowercase();
        let mut entries: Vec<_> =
            std::fs::read_dir(&path).ok()?.filter_map(|entry| Some(entry.ok()?.file_name())).collect();
        entries.sort();
        path.push(entries.into_iter().find(|entry| entry.to_string_lossy().to_lowercase() == wanted)?);
    }
    path.is_file().then_some(path)
}
