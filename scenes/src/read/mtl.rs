//! Wavefront MTL text: what it says, material by material. What it means is [`super::surface`]'s.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use glam::Vec3;

use super::error::Notes;
use super::text::{self, Line};
use super::{ReadError, texture_name};
use texture_name::TextureName;

/// One `newmtl`, as written.
#[derive(Clone, Debug, Default)]
pub(super) struct Mtl {
    pub name: String,
    /// The file and the line of `newmtl`.
    pub file: PathBuf,
    pub line: u32,
    pub kd: Option<Vec3>,
    pub ks: Option<Vec3>,
    pub ke: Option<Vec3>,
    /// Transmission filter.
    pub tf: Option<Vec3>,
    /// Phong exponent.
    pub ns: Option<f32>,
    /// Index of refraction.
    pub ni: Option<f32>,
    /// Opacity.
    pub d: Option<f32>,
    /// Transparency, mostly `1 − d`.
    pub tr: Option<f32>,
    /// PBR extension: roughness.
    pub pr: Option<f32>,
    /// PBR extension: metalness.
    pub pm: Option<f32>,
    pub illum: Option<i32>,
    /// By lower-case keyword: `map_kd`, `map_d`, …
    pub maps: BTreeMap<String, TextureName>,
}

/// Parses the text of `path`. A name given twice means its last definition, as in other readers.
pub(super) fn parse(path: &Path, bytes: &[u8], notes: &mut Notes) -> Result<Vec<Mtl>, ReadError> {
    let text = text::decode(bytes);
    let mut materials: Vec<Mtl> = Vec::new();
    for line in text::lines(&text) {
        let keyword = line.text.split_ascii_whitespace().next().unwrap_or_default().to_owned();
        if keyword == "newmtl" {
            let name = line.rest_after(&keyword).to_owned();
            materials.push(Mtl { name, file: path.into(), line: line.number, ..Mtl::default() });
        } else if let Some(material) = materials.last_mut() {
            material.statement(path, &keyword, &line, notes)?;
        }
    }
    Ok(materials)
}

impl Mtl {
    fn statement(&mut self, path: &Path, keyword: &str, line: &Line, notes: &mut Notes) -> Result<(), ReadError> {
        let keyword = keyword.to_ascii_lowercase();
        match keyword.as_str() {
            "kd" => self.kd = colour(path, line, notes)?.or(self.kd),
            "ks" => self.ks = colour(path, line, notes)?.or(self.ks),
            "ke" => self.ke = colour(path, line, notes)?.or(self.ke),
            "tf" => self.tf = colour(path, line, notes)?.or(self.tf),
            "ns" => self.ns = Some(number(path, line, 1)?),
            "ni" => self.ni = Some(number(path, line, 1)?),
            // `d -halo 0.5` fades with the angle; the number is what counts here.
            "d" => self.d = Some(number(path, line, if line.text.contains("-halo") { 2 } else { 1 })?),
            "tr" => self.tr = Some(number(path, line, 1)?),
            "pr" => self.pr = Some(number(path, line, 1)?),
            "pm" => self.pm = Some(number(path, line, 1)?),
            "illum" => self.illum = Some(number(path, line, 1)? as i32),
            _ if is_map(&keyword) => {
                let texture = texture_name::parse(line.rest_after(&keyword), line.number)
                    .map_err(|message| ReadError::line(path, line.number, message))?;
                self.maps.insert(keyword, texture);
            }
            _ => {}
        }
        Ok(())
    }
}

fn is_map(keyword: &str) -> bool {
    keyword.starts_with("map_") && keyword != "map_aat" || matches!(keyword, "bump" | "disp" | "decal" | "norm")
}

/// `r g b`, or one number for all three. Spectral curves and CIE XYZ are noted and ignored.
fn colour(path: &Path, line: &Line, notes: &mut Notes) -> Result<Option<Vec3>, ReadError> {
    let words = line.text.split_ascii_whitespace().skip(1).count();
    if matches!(line.text.split_ascii_whitespace().nth(1), Some("spectral" | "xyz")) {
        notes.line(path, line.number, "spectral and CIE XYZ colours are not understood; write r g b");
        return Ok(None);
    }
    let r = number(path, line, 1)?;
    if words < 3 {
        return Ok(Some(Vec3::splat(r)));
    }
    Ok(Some(Vec3::new(r, number(path, line, 2)?, number(path, line, 3)?)))
}

/// The number at a place of the line, counted in words.
fn number(path: &Path, line: &Line, place: usize) -> Result<f32, ReadError> {
    let word = line.text.split_ascii_whitespace().nth(place).unwrap_or_default();
    let value: Option<f32> = word.parse().ok().filter(|value: &f32| value.is_finite());
    value.ok_or_else(|| {
        let keyword = line.text.split_ascii_whitespace().next().unwrap_or_default();
        let message = match word {
            "" => format!("`{keyword}` has too few numbers"),
            _ => format!("`{keyword}`: `{}` is not a finite number", text::shorten(word)),
        };
        ReadError::line(path, line.number, message)
    })
}
