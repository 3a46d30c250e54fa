//! Reading pictures back, for comparing.

use std::collections::BTreeMap;
use std::fs;
use std::io::Cursor;
use std::path::Path;

use anyhow::{Context, bail};
use frame::Picture;
use frame::tone::linear_from_srgb;
use scenes::Rgb;

/// Reads red, green and blue of an EXR, or a PNG turned into linear light.
///
/// # Errors
/// If the file is missing, broken, or neither.
pub fn read_picture(path: &Path) -> anyhow::Result<Picture> {
    let extension = path.extension().map(|extension| extension.to_string_lossy().to_lowercase());
    let context = || format!("{}: cannot be read", path.display());
    match extension.as_deref() {
        Some("exr") => read_exr(path).with_context(context),
        Some("png") => read_png(path).with_context(context),
        _ => bail!("{}: pictures are .exr or .png", path.display()),
    }
}

fn read_exr(path: &Path) -> anyhow::Result<Picture> {
    use exr::prelude::*;
    let image = read()
        .no_deep_data()
        .largest_resolution_level()
        .rgb_channels(
            |size, _| Picture::black(size.width() as u32, size.height() as u32),
            |picture, at, (r, g, b): (f32, f32, f32)| {
                let index = at.y() * picture.width as usize + at.x();
                picture.pixels[index] = Rgb::new(r, g, b);
            },
        )
        .first_valid_layer()
        .all_attributes()
        .from_buffered(Cursor::new(exr_bytes(path)?))?;
    Ok(image.layer_data.channel_data.pixels)
}

/// Reflectance and normals of an EXR that has them, as `albedo.R` and `normal.X` (or `.R`) and so on; black where it has none.
///
/// # Errors
/// If the file is missing, or no EXR.
pub fn read_guides(path: &Path) -> anyhow::Result<[Picture; 2]> {
    let planes = Planes::read(path)?;
    let either = |name: &str| planes.layer(name, ["R", "G", "B"]).or_else(|| planes.layer(name, ["X", "Y", "Z"]));
    let [width, height] = planes.size;
    Ok(["albedo", "normal"].map(either).map(|guide| guide.unwrap_or_else(|| Picture::black(width, height))))
}

/// Coloured layers of an EXR, by name.
///
/// # Errors
/// If the file is missing, no EXR, or lacks one of them.
pub fn read_layers(path: &Path, names: &[String]) -> anyhow::Result<Vec<Picture>> {
    let planes = Planes::read(path)?;
    let layer = |name: &String| {
        let found = planes.layer(name, ["R", "G", "B"]);
        found.with_context(|| format!("{}: has no layer {name}", path.display()))
    };
    names.iter().map(layer).collect()
}

/// All channels of an EXR.
struct Planes {
    size: [u32; 2],
    channels: BTreeMap<String, Vec<f32>>,
}

impl Planes {
    fn read(path: &Path) -> anyhow::Result<Self> {
        use exr::prelude::*;
        let read = || -> anyhow::Result<Self> {
            let image = read()
                .no_deep_data()
                .largest_resolution_level()
                .all_channels()
                .first_valid_layer()
                .all_attributes()
                .from_buffered(Cursor::new(exr_bytes(path)?))?;
            let layer = &image.layer_data;
            let channels = layer.channel_data.list.iter();
            let values =
                channels.map(|channel| (channel.name.to_string(), channel.sample_data.values_as_f32().collect()));
            Ok(Self { size: [layer.size.width() as u32, layer.size.height() as u32], channels: values.collect() })
        };
        read().with_context(|| format!("{}: cannot be read", path.display()))
    }

    /// A layer by the names of its three channels; `None` if it has not all of them.
    fn layer(&self, name: &str, parts: [&str; 3]) -> Option<Picture> {
        let planes = parts.map(|part| self.channels.get(&format!("{name}.{part}")));
        let [Some(a), Some(b), Some(c)] = planes else { return None };
        let [width, height] = self.size;
        let at = |x: u32, y: u32| y as usize * width as usize + x as usize;
        Some(Picture::from_fn(width, height, |x, y| Rgb::new(a[at(x, y)], b[at(x, y)], c[at(x, y)])))
    }
}

/// An EXR's bytes, once its size is known to be bearable.
pub(super) fn exr_bytes(path: &Path) -> anyhow::Result<Vec<u8>> {
    let bytes = fs::read(path)?;
    scenes::read::check_exr(&bytes, PICTURE_SIDE_MAX).map_err(anyhow::Error::msg)?;
    Ok(bytes)
}

/// Longest side of a picture that is read, pixels.
const PICTURE_SIDE_MAX: u32 = 65_536;

fn read_png(path: &Path) -> anyhow::Result<Picture> {
    // By its bytes, not by its name; and from memory, which the library does by code of its own.
    let image = image::load_from_memory(&fs::read(path)?)?.to_rgb16();
    let decode = |value: u16| linear_from_srgb(f64::from(value) / 65_535.0) as f32;
    let pixels = image.pixels().map(|pixel| Rgb::from_array(pixel.0.map(decode))).collect();
    Ok(Picture { width: image.width(), height: image.height(), pixels })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::files::{encode_exr, encode_png};

    #[test]
    fn an_exr_comes_back_bit_by_bit_with_its_metadata_and_layers() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.exr");
        let picture = Picture::from_fn(5, 3, |x, y| Rgb::new(x as f32 * 1e6, y as f32 * 1e-9, 0.1));
        let depth = Picture::from_fn(5, 3, |x, y| Rgb::splat((x * y) as f32));
        let layers = [("distance", false, depth.clone()), ("albedo", true, depth)];
        std::fs::write(&path, encode_exr(&picture, &layers, &[("seed", "42".to_string())]).unwrap()).unwrap();
        assert_eq!(read_picture(&path).unwrap(), picture);

        let [albedo, normal] = read_guides(&path).unwrap();
        assert_eq!([albedo, normal], [layers[1].2.clone(), Picture::black(5, 3)]);

        let image = exr::prelude::read_all_data_from_file(&path).unwrap();
        let layer = &image.layer_data[0];
        let names: Vec<String> = layer.channel_data.list.iter().map(|c| c.name.to_string()).collect();
        assert_eq!(names, ["B", "G", "R", "albedo.B", "albedo.G", "albedo.R", "distance.Y"]);
        assert!(layer.attributes.other.contains_key(&exr::prelude::Text::from("igi:seed")));
    }

    #[test]
    fn a_png_comes_back_linear() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.png");
        let image = frame::tone::Image8 { width: 1, height: 1, pixels: vec![[188, 0, 255]] };
        std::fs::write(&path, encode_png(&image).unwrap()).unwrap();
        let read = read_picture(&path).unwrap().at(0, 0);
        assert!((read - Rgb::new(0.5029, 0.0, 1.0)).abs().max_element() < 1e-4, "{read}");
    }

    #[test]
    fn broken_files_are_refused_with_their_name() {
        let folder = tempfile::tempdir().unwrap();
        for name in ["a.exr", "a.png", "a.txt", "missing.exr"] {
            let path = folder.path().join(name);
            if !name.starts_with("missing") {
                std::fs::write(&path, b"not a picture at all").unwrap();
            }
            assert!(read_picture(&path).unwrap_err().to_string().contains(name));
        }
    }
}
