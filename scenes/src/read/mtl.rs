//! Wavefront MTL text: what it says, material by material. What it means is [`super::surface`]'s.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use glam::Vec3;

use super::error::{Notes, Tally};
use super::text::{self, Line};
use super::texture_name;
use texture_name::TextureName;

/// One `newmtl`, as written.
#[derive(Clone, Debug, Default)]
pub(super) struct Mtl {
    pub name: String,
    /// The file and the line of `newmtl`.
    pub file: PathBuf,
    pub line: u32,
    /// The file says that Blender wrote it.
    pub by_blender: bool,
    /// Ambient.
    pub ka: Option<Vec3>,
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
    /// PBR extension: how much of a clear coat there is, …
    pub pc: Option<f32>,
    /// … and its roughness.
    pub pcr: Option<f32>,
    /// PBR extension: sheen.
    pub ps: Option<f32>,
    /// PBR extension: anisotropy.
    pub aniso: Option<f32>,
    pub illum: Option<i32>,
    /// By lower-case keyword: `map_kd`, `map_d`, …
    pub maps: BTreeMap<String, TextureName>,
}

/// Parses the text of `path`. A name given twice means its last definition, as in other readers.
pub(super) fn parse(path: &Path, bytes: &[u8], notes: &mut Notes) -> Vec<Mtl> {
    let text = text::decode(bytes);
    let by_blender = text.lines().take(HEADER_LINES).any(|line| line.starts_with("# Blender"));
    let mut materials: Vec<Mtl> = Vec::new();
    let mut faults = Faults::default();
    for line in text::lines(&text) {
        let keyword = line.text.split_ascii_whitespace().next().unwrap_or_default().to_owned();
        if keyword.eq_ignore_ascii_case("newmtl") {
            let name = line.rest_after(&keyword).to_owned();
            materials.push(Mtl { name, file: path.into(), line: line.number, by_blender, ..Mtl::default() });
        } else if let Some(material) = materials.last_mut() {
            material.statement(&keyword, &line, &mut faults);
        }
    }
    faults.report(path, notes);
    materials
}

/// An exporter says its name in the first lines.
const HEADER_LINES: usize = 8;

/// Statements that were left out.
#[derive(Default)]
struct Faults {
    numbers: Tally,
    names: Tally,
    colours: Tally,
    halos: Tally,
    unknown: Tally,
}

impl Faults {
    fn report(&self, path: &Path, notes: &mut Notes) {
        self.numbers.report(notes, path, "statements lack a finite number: left out");
        self.names.report(notes, path, "textures have no file name: left out");
        self.colours.report(notes, path, "spectral or CIE XYZ colours are not understood: left out; write r g b");
        self.halos.report(notes, path, "halos are not drawn: what has one is as opaque from all sides");
        self.unknown.report(notes, path, "statements are not understood: left out");
    }
}

impl Mtl {
    fn statement(&mut self, keyword: &str, line: &Line, faults: &mut Faults) {
        let keyword = keyword.to_ascii_lowercase();
        let colour = |before: Option<Vec3>, faults: &mut Faults| colour(line, faults).or(before);
        let number = |before: Option<f32>, faults: &mut Faults| number(line, faults).or(before);
        match keyword.as_str() {
            "ka" => self.ka = colour(self.ka, faults),
            "kd" => self.kd = colour(self.kd, faults),
            "ks" => self.ks = colour(self.ks, faults),
            "ke" => self.ke = colour(self.ke, faults),
            "tf" => self.tf = colour(self.tf, faults),
            "ns" => self.ns = number(self.ns, faults),
            "ni" => self.ni = number(self.ni, faults),
            "d" => {
                faults.halos.add_if(line.arguments().next() == Some("-halo"), line.number);
                self.d = number(self.d, faults);
            }
            "tr" => self.tr = number(self.tr, faults),
            "pr" => self.pr = number(self.pr, faults),
            "pm" => self.pm = number(self.pm, faults),
            "pc" => self.pc = number(self.pc, faults),
            "pcr" => self.pcr = number(self.pcr, faults),
            "ps" => self.ps = number(self.ps, faults),
            "aniso" => self.aniso = number(self.aniso, faults),
            "illum" => self.illum = number(None, faults).map(|model| model as i32).or(self.illum),
            _ if is_map(&keyword) => match texture_name::parse(line.rest_after(&keyword), line.number) {
                Some(texture) => drop(self.maps.insert(keyword, texture)),
                None => faults.names.add_word(line.number, &line.text),
            },
            _ if MEANS_NOTHING.contains(&keyword.as_str()) => {}
            _ => faults.unknown.add_word(line.number, &line.text),
        }
    }
}

/// Statements that say how a picture is smoothed, or something of what is named as not drawn: `refl`, `aniso`.
const MEANS_NOTHING: [&str; 3] = ["map_aat", "sharpness", "anisor"];

fn is_map(keyword: &str) -> bool {
    keyword.starts_with("map_") && keyword != "map_aat"
        || matches!(keyword, "bump" | "disp" | "decal" | "norm" | "refl")
}

/// `r g b`, or one number for all three; `None` if that is not what is there.
fn colour(line: &Line, faults: &mut Faults) -> Option<Vec3> {
    let words: Vec<&str> = line.arguments().take(3).collect();
    let numbers: Option<Vec<f32>> = words.iter().map(|word| finite(word)).collect();
    match numbers.as_deref() {
        Some([grey]) => Some(Vec3::splat(*grey)),
        Some([r, g, b]) => Some(Vec3::new(*r, *g, *b)),
        _ if matches!(words.first(), Some(&("spectral" | "xyz"))) => {
            faults.colours.add(line.number);
            None
        }
        _ => {
            faults.numbers.add_word(line.number, &line.text);
            None
        }
    }
}

/// The number of the line; `None` if there is none.
fn number(line: &Line, faults: &mut Faults) -> Option<f32> {
    // `d -halo 0.5` fades with the angle; the number is what counts here.
    let number = line.arguments().find(|word| *word != "-halo").and_then(finite);
    if number.is_none() {
        faults.numbers.add_word(line.number, &line.text);
    }
    number
}

fn finite(word: &str) -> Option<f32> {
    text::finite(word).map(|number| number as f32).filter(|number| number.is_finite())
}
