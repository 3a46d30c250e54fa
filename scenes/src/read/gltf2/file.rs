//! The container: JSON and its buffers, from `.gltf` with files or data URIs, or from `.glb`.
//!
//! Of the `gltf` crates only the typed JSON is used. The accessors and the validation of `gltf` index out of
//! bounds on some broken files, so every index here goes through [`File::get`].

use std::path::{Path, PathBuf};

use base64::engine::{DecodePaddingMode, GeneralPurpose, GeneralPurposeConfig};
use base64::{Engine, alphabet};
use gltf_json::{Index, Root};
use serde_json::Value;

use super::super::error::Notes;
use super::super::find::{find, percent_decode};
use super::super::{ReadError, limits, text};
use super::repair;

/// Extensions that are drawn as they mean.
const KNOWN_EXTENSIONS: [&str; 21] = [
    "EXT_meshopt_compression",
    "EXT_mesh_gpu_instancing",
    "EXT_texture_webp",
    "KHR_draco_mesh_compression",
    "KHR_lights_punctual",
    "KHR_materials_clearcoat",
    "KHR_materials_diffuse_transmission",
    "KHR_materials_emissive_strength",
    "KHR_materials_ior",
    "KHR_materials_pbrSpecularGlossiness",
    "KHR_materials_sheen",
    "KHR_materials_specular",
    "KHR_materials_transmission",
    "KHR_materials_unlit",
    "KHR_materials_variants",
    "KHR_materials_volume",
    "KHR_mesh_quantization",
    "KHR_meshopt_compression",
    "KHR_node_visibility",
    "KHR_texture_transform",
    "MSFT_texture_dds",
];

/// A glTF file in memory; indices in it are not yet checked.
pub(super) struct File {
    pub path: PathBuf,
    pub root: Root,
    /// One for each of `root.buffers`, as long as it says or shorter; behind them, what was unpacked.
    pub buffers: Vec<Vec<u8>>,
}

impl File {
    pub fn read(path: &Path, notes: &mut Notes) -> Result<Self, ReadError> {
        let bytes = limits::read_bytes(path)?;
        let (words, binary) = split(path, &bytes)?;
        let document = serde_json::from_str(&text::decode(words)).map_err(|error| broken_json(path, &error))?;
        check_head(path, &document, notes)?;
        let mut file = Self { path: path.into(), root: repair::root(path, document, notes), buffers: Vec::new() };
        for i in 0..file.root.buffers.len() {
            if file.is_stand_in(i) {
                file.buffers.push(Vec::new());
                continue;
            }
            let buffer = file.buffer(i, binary, notes).unwrap_or_else(|error| {
                file.leave_out(error, "what is in it is not drawn", notes);
                Vec::new()
            });
            file.buffers.push(buffer);
        }
        file.unpack(notes);
        Ok(file)
    }

    fn buffer(&self, i: usize, binary: Option<&[u8]>, notes: &mut Notes) -> Result<Vec<u8>, ReadError> {
        let field = format!("buffers[{i}]");
        let buffer = &self.root.buffers[i];
        let mut bytes = match (&buffer.uri, binary) {
            (Some(uri), _) => self.resource(&field, uri)?,
            (None, Some(binary)) if i == 0 => binary.to_vec(),
            (None, _) => return Err(self.refuse(&field, "has no uri, and the file no binary chunk for it")),
        };
        let (wanted, found) = (buffer.byte_length.0, bytes.len() as u64);
        if found < wanted {
            let message =
                format!("should have {wanted} bytes but has {found}; is it cut off? What is missing is not drawn");
            notes.at(&self.path, &field, message);
        }
        bytes.truncate(usize::try_from(wanted).unwrap_or(usize::MAX));
        Ok(bytes)
    }

    /// Bytes behind a URI: inside it, or in a file beside this one.
    pub fn resource(&self, field: &str, uri: &str) -> Result<Vec<u8>, ReadError> {
        if uri.starts_with("data:") {
            return data(uri).ok_or_else(|| self.refuse(field, "its data: URI cannot be decoded; base64 is expected"));
        }
        let path = self.resource_path(field, uri)?;
        limits::read_bytes(&path)
    }

    /// The file that a relative URI names.
    pub fn resource_path(&self, field: &str, uri: &str) -> Result<PathBuf, ReadError> {
        if uri.contains("://") && !uri.starts_with("file://") {
            return Err(self.refuse(field, format!("`{uri}` is not on this machine; download it beside the file")));
        }
        let written = uri.trim_start_matches("file://");
        let name = percent_decode(written);
        let folder = self.path.parent().unwrap_or(Path::new(""));
        let found = find(&[folder], &name).or_else(|| find(&[folder], written));
        found.ok_or_else(|| self.refuse(field, format!("file `{name}` does not exist")))
    }

    /// An item by index, or a message about the field that holds the index.
    pub fn get<'a, T>(
        &self,
        list: &'a [T],
        index: Index<T>,
        field: impl FnOnce() -> String,
    ) -> Result<&'a T, ReadError> {
        list.get(index.value()).ok_or_else(|| {
            let message = format!("index {} is out of range: there are {}", index.value(), list.len());
            self.refuse(&field(), message)
        })
    }

    /// Notes that something is broken, and what becomes of it.
    pub fn leave_out(&self, error: ReadError, becomes: &str, notes: &mut Notes) {
        match error {
            ReadError::Field { path, field, message } if path == self.path => {
                notes.at(&path, field, format!("{message}; {becomes}"));
            }
            error => notes.file(&self.path, format!("{error}; {becomes}")),
        }
    }

    pub fn refuse(&self, field: &str, message: impl Into<String>) -> ReadError {
        ReadError::field(&self.path, field, message)
    }
}

/// What has to be known before the rest can be understood.
fn check_head(path: &Path, document: &Value, notes: &mut Notes) -> Result<(), ReadError> {
    let asset = &document["asset"];
    // A version is a text, but 2.0 without quotation marks is understood as well.
    let version = [&asset["minVersion"], &asset["version"]].into_iter().find_map(|version| match version {
        Value::String(version) => Some(version.clone()),
        Value::Number(version) => Some(version.to_string()),
        _ => None,
    });
    let needed =
        version.ok_or_else(|| ReadError::field(path, "asset", "missing field `version`; is this glTF 2.0?"))?;
    if needed.split('.').next() != Some("2") {
        return Err(ReadError::field(path, "asset.version", format!("{needed} is not read here; export glTF 2.0")));
    }
    let unknown = |list: &str| -> Vec<String> {
        let names = document[list].as_array().into_iter().flatten().filter_map(Value::as_str);
        names.filter(|name| !KNOWN_EXTENSIONS.contains(name)).map(text::shorten).collect()
    };
    let required = unknown("extensionsRequired");
    for unknown in &required {
        let message =
            format!("{unknown} is not understood, and the file says it cannot do without: much may be missing");
        notes.at(path, "extensionsRequired", message);
    }
    for unknown in unknown("extensionsUsed").iter().filter(|unknown| !required.contains(unknown)) {
        notes.at(path, "extensionsUsed", format!("{unknown} is not understood: what it adds is not drawn"));
    }
    let variants = document["extensions"]["KHR_materials_variants"]["variants"].as_array();
    let names: Vec<String> =
        variants.into_iter().flatten().filter_map(|variant| variant["name"].as_str()).map(text::shorten).collect();
    if !names.is_empty() {
        let message = format!("has variants ({}): it is drawn in its first materials", names.join(", "));
        notes.at(path, "KHR_materials_variants", message);
    }
    Ok(())
}

fn broken_json(path: &Path, error: &serde_json::Error) -> ReadError {
    let words = error.to_string();
    let end = words.rfind(" at line ").unwrap_or(words.len());
    ReadError::line(path, error.line() as u32, format!("column {}: {}", error.column(), &words[..end]))
}

/// The JSON text and the binary chunk of a file that may be a GLB.
fn split<'a>(path: &Path, bytes: &'a [u8]) -> Result<(&'a [u8], Option<&'a [u8]>), ReadError> {
    if !bytes.starts_with(b"glTF") {
        return Ok((bytes, None));
    }
    let cut_off = || ReadError::file(path, "the binary glTF is cut off or broken; export or download it again");
    let word = |at: usize| Some(u32::from_le_bytes(bytes.get(at..at + 4)?.try_into().ok()?));
    let version = word(4).ok_or_else(cut_off)?;
    if version != 2 {
        return Err(ReadError::file(path, format!("binary glTF of version {version} is not read here; export 2.0")));
    }
    let (mut text, mut binary, mut at) = (None, None, 12);
    while let (Some(length), Some(kind)) = (word(at), word(at + 4)) {
        let chunk = bytes.get(at + 8..at + 8 + length as usize).ok_or_else(cut_off)?;
        match &kind.to_le_bytes() {
            b"JSON" if text.is_none() => text = Some(chunk),
            b"BIN\0" if binary.is_none() => binary = Some(chunk),
            _ => {}
        }
        at += 8 + (length as usize).next_multiple_of(4);
    }
    Ok((text.ok_or_else(cut_off)?, binary))
}

/// What a `data:` URI holds (RFC 2397), in base64, whether or not its end is padded.
fn data(uri: &str) -> Option<Vec<u8>> {
    const LENIENT: GeneralPurposeConfig =
        GeneralPurposeConfig::new().with_decode_padding_mode(DecodePaddingMode::Indifferent);
    let (_, text) = uri.split_once(";base64,").or_else(|| uri.split_once(','))?;
    GeneralPurpose::new(&alphabet::STANDARD, LENIENT).decode(text).ok()
}

#[cfg(test)]
mod tests {
    use super::data;

    #[test]
    fn data_is_decoded_whether_or_not_it_is_padded() {
        for text in ["data:;base64,aWdp", "data:a/b;base64,aWdp", "data:,aWdp"] {
            assert_eq!(data(text).as_deref(), Some(&b"igi"[..]));
        }
        assert_eq!(data("data:;base64,aWc="), data("data:;base64,aWc"));
        assert_eq!((data("data:;base64,%"), data("data:")), (None, None));
    }
}
