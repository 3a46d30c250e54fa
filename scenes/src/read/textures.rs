//! Images into textures: found, decoded once, bounded and cleaned.

use std::collections::BTreeMap;
use std::io::Cursor;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use exr::prelude::{ReadChannels, ReadLayers};
use glam::Vec3;
use image::{DynamicImage, ImageReader};

use super::exr_header::check_exr;
use super::find::Finder;
use super::limits::{self, TEXTURE_BYTES_MAX, TEXTURE_SIDE_MAX};
use super::relief;
use crate::{LookUp, Pixels, Texture};

/// What the numbers of an image mean.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Meaning {
    /// Colour, sRGB-encoded if the file has 8 or 16 bits a channel.
    Colour,
    /// Numbers, linear: roughness, masks, normals.
    Data,
    /// Heights, which become normals; or normals, if it looks like some (see [`relief`]).
    Relief,
    /// Radiance, linear: environments.
    Radiance,
}

/// A scene's textures as they gather; the same image with the same meaning is stored once.
#[derive(Debug, Default)]
pub(super) struct Textures {
    /// Becomes [`crate::Scene::textures`].
    pub list: Vec<Arc<Texture>>,
    known: BTreeMap<(PathBuf, Meaning, LookUp), Option<u32>>,
    finder: Finder,
    bytes: u64,
}

impl Textures {
    /// Goes on where another reader ended.
    pub fn after(list: Vec<Arc<Texture>>) -> Self {
        let bytes = list.iter().map(|texture| size(texture)).sum();
        Self { list, bytes, ..Self::default() }
    }

    /// The texture in a file that may be called by several names, looked for from several folders; `None` (and a note)
    /// if there is no such file or no picture in it.
    pub fn file<'n>(
        &mut self,
        folders: &[&Path],
        names: impl Iterator<Item = &'n str> + Clone,
        meaning: Meaning,
        look_up: LookUp,
        said: impl FnOnce(String),
    ) -> Option<u32> {
        let name = names.clone().next().unwrap_or_default();
        let mut found = names.filter_map(|name| self.finder.find(folders, name));
        let Some(path) = found.next() else {
            said(format!("texture `{name}` does not exist; the plain colour is used"));
            return None;
        };
        let key = (path.clone(), meaning, look_up);
        if let Some(&known) = self.known.get(&key) {
            return known;
        }
        let bytes = limits::read_bytes(&path).map_err(|error| error.to_string());
        let added = bytes.and_then(|bytes| self.add(&path, name, &bytes, meaning, look_up));
        let index = added.map_err(|why| said(format!("texture `{name}`: {why}; the plain colour is used"))).ok();
        self.known.insert(key, index);
        index
    }

    /// The texture in an encoded image of a file; or why there is none, in words.
    pub fn add(
        &mut self,
        path: &Path,
        name: &str,
        bytes: &[u8],
        meaning: Meaning,
        look_up: LookUp,
    ) -> Result<u32, String> {
        let image = decode(path, bytes)?;
        let texture = convert(image, name, meaning, look_up);
        if self.bytes + size(&texture) > TEXTURE_BYTES_MAX {
            let gib = TEXTURE_BYTES_MAX >> 30;
            return Err(format!("with it, textures take more than {gib} GiB; shrink some"));
        }
        self.list.push(Arc::new(texture));
        Ok((self.list.len() - 1) as u32)
    }

    /// A texture of numbers that are made of a channel of another's, all 0..1; `None` if textures then took too much.
    pub fn mapped(&mut self, texture: u32, channel: u8, of: impl Fn(f32) -> f32) -> Option<u32> {
        let source = Arc::clone(&self.list[texture as usize]);
        let byte = |number: f32| [(of(number).clamp(0.0, 1.0) * 255.0).round() as u8; 4];
        let channel = usize::from(channel);
        let texels: Vec<[u8; 4]> = match &source.pixels {
            Pixels::Srgb8(texels) | Pixels::Linear8(texels) => {
                let known: Vec<[u8; 4]> = (0..=u8::MAX).map(|number| byte(f32::from(number) / 255.0)).collect();
                texels.iter().map(|texel| known[usize::from(texel[channel])]).collect()
            }
            Pixels::Float(texels) => texels.iter().map(|texel| byte(texel[channel.min(2)])).collect(),
        };
        let Texture { name, width, height, look_up, .. } = &*source;
        let pixels = Pixels::Linear8(texels);
        let made = Texture { name: name.clone(), width: *width, height: *height, pixels, look_up: *look_up };
        self.bytes += size(&made);
        if self.bytes > TEXTURE_BYTES_MAX {
            return None;
        }
        self.list.push(Arc::new(made));
        Some((self.list.len() - 1) as u32)
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
fn decode(path: &Path, bytes: &[u8]) -> Result<DynamicImage, String> {
    if bytes.starts_with(&exr::meta::magic_number::BYTES) {
        return decode_exr(bytes).map_err(|message| format!("the image cannot be decoded: {message}"));
    }
    if let Some(kind) = unread_kind(bytes) {
        return Err(format!("{kind} pictures are not read; make it {READ_KINDS}"));
    }
    let mut reader = ImageReader::new(Cursor::new(bytes))
        .with_guessed_format()
        .map_err(|error| format!("the image cannot be read: {error}"))?;
    if reader.format().is_none() {
        // Some kinds (TGA) have no mark at their start.
        let format = image::ImageFormat::from_path(path).ok().filter(|format| *format == image::ImageFormat::Tga);
        reader.set_format(format.ok_or_else(|| format!("is no picture of a known kind; make it {READ_KINDS}"))?);
    }
    let mut bounds = image::Limits::default();
    bounds.max_image_width = Some(TEXTURE_SIDE_MAX);
    bounds.max_image_height = Some(TEXTURE_SIDE_MAX);
    bounds.max_alloc = Some(TEXTURE_BYTES_MAX);
    reader.limits(bounds);
    let image = reader.decode().map_err(|error| format!("the image cannot be decoded: {error}"))?;
    if image.width() == 0 || image.height() == 0 {
        return Err("the image has no pixels".into());
    }
    if image.width().max(image.height()) > TEXTURE_SIDE_MAX {
        return Err(format!("the image is larger than {TEXTURE_SIDE_MAX} pixels to a side; shrink it"));
    }
    Ok(image)
}

/// Kinds of pictures that are read.
const READ_KINDS: &str = "PNG, JPEG, WebP, TIFF, GIF, TGA, BMP, DDS, HDR or EXR";

/// The name of a common kind that is not read, by how it begins.
fn unread_kind(bytes: &[u8]) -> Option<&'static str> {
    let at = |offset: usize, mark: &[u8]| bytes.get(offset..).is_some_and(|rest| rest.starts_with(mark));
    let marks: [(&str, usize, &[u8]); 8] = [
        ("KTX", 0, b"\xabKTX"),
        ("Photoshop", 0, b"8BPS"),
        ("AVIF", 4, b"ftypavif"),
        ("HEIC", 4, b"ftyphei"),
        ("JPEG XL", 0, b"\xff\x0a"),
        ("JPEG 2000", 4, b"jP  "),
        ("SVG", 0, b"<svg"),
        ("XML", 0, b"<?xml"),
    ];
    marks.into_iter().find(|(_, offset, mark)| at(*offset, mark)).map(|(kind, ..)| kind)
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

fn convert(image: DynamicImage, name: &str, meaning: Meaning, look_up: LookUp) -> Texture {
    let (width, height) = (image.width(), image.height());
    let is_float = matches!(image, DynamicImage::ImageRgb32F(_) | DynamicImage::ImageRgba32F(_));
    let pixels = match meaning {
        Meaning::Colour if !is_float => Pixels::Srgb8(texels(image)),
        Meaning::Data => Pixels::Linear8(texels(image)),
        Meaning::Relief => Pixels::Linear8(relief::normals(image, look_up)),
        Meaning::Radiance if !is_float => {
            let linear = |texel: [u8; 4]| [0, 1, 2].map(|channel| srgb_to_linear(texel[channel]));
            Pixels::Float(texels(image).into_iter().map(linear).collect())
        }
        Meaning::Colour => Pixels::Float(floats(image, 1.0)),
        Meaning::Radiance => Pixels::Float(floats(image, f32::MAX)),
    };
    Texture { name: name.into(), width, height, pixels, look_up }
}

pub(super) fn texels(image: DynamicImage) -> Vec<[u8; 4]> {
    image.into_rgba8().into_raw().chunks_exact(4).map(|texel| [texel[0], texel[1], texel[2], texel[3]]).collect()
}

/// Finite, not negative and not above `most`.
fn floats(image: DynamicImage, most: f32) -> Vec<[f32; 3]> {
    let clean = |value: f32| if value >= 0.0 { value.min(most) } else { 0.0 };
    image.into_rgb32f().into_raw().chunks_exact(3).map(|texel| [texel[0], texel[1], texel[2]].map(clean)).collect()
}

/// Mean over its texels, linear.
pub(super) fn mean(texture: &Texture) -> Vec3 {
    let mut sum = [0.0_f64; 3];
    let texels = match &texture.pixels {
        Pixels::Srgb8(texels) => {
            let linear: [f64; 256] = std::array::from_fn(|code| f64::from(srgb_to_linear(code as u8)));
            texels.iter().for_each(|texel| (0..3).for_each(|c| sum[c] += linear[usize::from(texel[c])]));
            texels.len()
        }
        Pixels::Linear8(texels) => {
            texels.iter().for_each(|texel| (0..3).for_each(|c| sum[c] += f64::from(texel[c]) / 255.0));
            texels.len()
        }
        Pixels::Float(texels) => {
            texels.iter().for_each(|texel| (0..3).for_each(|c| sum[c] += f64::from(texel[c])));
            texels.len()
        }
    };
    Vec3::from(sum.map(|sum| (sum / texels.max(1) as f64) as f32))
}

/// IEC 61966-2-1.
pub(super) fn srgb_to_linear(value: u8) -> f32 {
    let encoded = f64::from(value) / 255.0;
    let linear = if encoded <= 0.04045 { encoded / 12.92 } else { libm::pow((encoded + 0.055) / 1.055, 2.4) };
    linear as f32
}
