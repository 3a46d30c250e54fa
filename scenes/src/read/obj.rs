//! Wavefront OBJ text, read in one pass that knows every line by its number.
//!
//! The general parsers (tobj among them) lose what is needed here: faces with and without normals
//! within one group come out misaligned or with a neighbour's normal, `g` overwrites the name that
//! `o` gave, broken lines have no number, and some inputs panic. Reading the nine statements that
//! matter takes fewer lines than working around that.
//!
//! Understood: `v` (with `w` or colours behind it, or ZBrush's `#MRGB`), `vt`, `vn`, `f` with any number of corners and
//! negative indices, `s`, `o`, `g`, `usemtl`, `mtllib`, `\` at the end of a line, comments behind numbers, any encoding.
//! Skipped: points, lines.
//! Counted and skipped: curves and surfaces, faces of vertices that do not exist.
//! Counted and replaced: numbers that are missing or none, texture coordinates and normals that do not exist.

use std::collections::BTreeMap;
use std::path::Path;

use glam::{DVec2, DVec3};

use super::error::{Notes, Tally};
use super::limits::TRIANGLES_MAX;
use super::smoothing::Smoothing;
use super::text::{self, Line};
use super::vertex_colours::VertexColours;
use super::{ReadError, polygon};

/// What an OBJ file says, in file space.
#[derive(Debug, Default)]
pub(super) struct Obj {
    pub positions: Vec<DVec3>,
    pub normals: Vec<DVec3>,
    pub uvs: Vec<DVec2>,
    /// Linear, as [`crate::Mesh::colours`]: one a position, or none.
    pub colours: Vec<[u16; 4]>,
    /// In order of first appearance.
    pub groups: Vec<Group>,
    /// `mtllib` file names as written, each with its line.
    pub libraries: Vec<(String, u32)>,
    /// `o` (or, in a file without `o`, `g`) names in order of first appearance.
    pub objects: Vec<String>,
}

/// All triangles of one object that are of one material.
#[derive(Debug)]
pub(super) struct Group {
    /// Index into [`Obj::objects`].
    pub object: usize,
    /// Name given by `usemtl`, if any, and the line where it is first used.
    pub material: Option<String>,
    /// First line of the group's faces.
    pub line: u32,
    /// Indices are in range.
    pub triangles: Vec<Triangle>,
}

/// Three corners; all of them have normals or none, and likewise texture coordinates.
#[derive(Clone, Copy, Debug)]
pub(super) struct Triangle {
    pub corners: [Corner; 3],
    /// Where the face stands in the file.
    pub line: u32,
}

/// Zero-based indices into the arrays of [`Obj`]; [`NONE`] for an attribute that is not given.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) struct Corner {
    pub position: u32,
    pub uv: u32,
    pub normal: u32,
}

/// No such attribute.
pub(super) const NONE: u32 = u32::MAX;

/// Parses the text of `path`.
pub(super) fn parse(path: &Path, bytes: &[u8], notes: &mut Notes) -> Result<Obj, ReadError> {
    let text = text::decode(bytes);
    let mut parser = Parser::new(path, has_objects(&text));
    for line in text::lines(&text) {
        parser.line(&line);
    }
    parser.colours.paint(&text);
    parser.finish(notes)
}

/// In files that never say `o`, `g` names the objects.
fn has_objects(text: &str) -> bool {
    text.lines().any(|line| line.trim_ascii_start().strip_prefix('o').is_some_and(|rest| rest.starts_with([' ', '\t'])))
}

/// A face as written: its corners are a stretch of [`Parser::corners`].
struct Face {
    group: usize,
    line: u32,
    first: usize,
    count: usize,
    /// Smoothing group; 0 is none.
    smoothing: u32,
}

struct Parser<'a> {
    path: &'a Path,
    object_word: &'static str,
    obj: Obj,
    faces: Vec<Face>,
    corners: Vec<Corner>,
    colours: VertexColours,
    smoothing: u32,
    object: Option<String>,
    material: Option<String>,
    /// Where the current object and material keep their triangles, once there is one.
    group: Option<usize>,
    known_groups: BTreeMap<(usize, Option<String>), usize>,
    known_objects: BTreeMap<String, usize>,
    tallies: Tallies,
}

/// What was left out or replaced.
#[derive(Default)]
struct Tallies {
    too_few_corners: Tally,
    too_large: Tally,
    no_vertex: Tally,
    no_attribute: Tally,
    half_given: Tally,
    curves: Tally,
    missing: Tally,
    positions: Tally,
    normals: Tally,
    uvs: Tally,
}

impl Tallies {
    fn report(&self, path: &Path, notes: &mut Notes) {
        for (tally, message) in [
            (&self.missing, "vertices, normals or texture coordinates lack numbers: 0 is used"),
            (&self.positions, "vertices are no finite numbers; faces that use them were dropped"),
            (&self.normals, "normals were no usable numbers: faces that use them are flat"),
            (&self.uvs, "texture coordinates are no finite numbers: 0 is used"),
            (&self.too_few_corners, "faces with fewer than three corners were skipped"),
            (&self.no_vertex, "faces have corners at no vertex of the file: skipped"),
            (&self.no_attribute, "faces name normals or texture coordinates that do not exist: they have none"),
            (&self.half_given, "faces give normals or texture coordinates at some corners only: flat"),
            (&self.too_large, "faces that are not convex have too many corners to cut: skipped; split them"),
            (&self.curves, "free-form curves or surfaces were skipped; only faces are drawn"),
        ] {
            tally.report(notes, path, message);
        }
    }
}

impl<'a> Parser<'a> {
    fn new(path: &'a Path, has_objects: bool) -> Self {
        Self {
            path,
            object_word: if has_objects { "o" } else { "g" },
            obj: Obj::default(),
            faces: Vec::new(),
            corners: Vec::new(),
            colours: VertexColours::default(),
            smoothing: 0,
            object: None,
            material: None,
            group: None,
            known_groups: BTreeMap::new(),
            known_objects: BTreeMap::new(),
            tallies: Tallies::default(),
        }
    }

    fn line(&mut self, line: &Line) {
        let Some(keyword) = line.text.split_ascii_whitespace().next() else { return };
        match keyword {
            "v" => {
                let position = numbers(line, 3, &mut self.tallies.missing, &mut self.tallies.positions);
                self.obj.positions.push(DVec3::from(position.map(|number| number.unwrap_or(f64::NAN))));
                self.colours.vertex(line);
            }
            "vn" => {
                let normal = numbers(line, 3, &mut self.tallies.missing, &mut self.tallies.normals);
                self.obj.normals.push(all(normal).map_or(DVec3::ZERO, DVec3::from));
            }
            "vt" => {
                // `vt u` is short for `vt u 0`.
                let uv = numbers(line, 1, &mut self.tallies.missing, &mut self.tallies.uvs);
                self.obj.uvs.push(all::<2>(uv).map_or(DVec2::ZERO, DVec2::from));
            }
            "f" | "fo" => self.face(line),
            "usemtl" => {
                self.material = Some(line.rest_after(keyword).to_owned()).filter(|name| !name.is_empty());
                self.group = None;
            }
            "mtllib" => self.obj.libraries.push((line.rest_after(keyword).to_owned(), line.number)),
            word if word == self.object_word => {
                self.object = Some(line.rest_after(keyword).to_owned()).filter(|name| !name.is_empty());
                self.group = None;
            }
            // `s off` is `s 0`.
            "s" => self.smoothing = line.arguments().next().and_then(|word| word.parse().ok()).unwrap_or(0),
            "curv" | "curv2" | "surf" => self.tallies.curves.add(line.number),
            _ => {}
        }
    }

    fn face(&mut self, line: &Line) {
        let first = self.corners.len();
        let mut attributes_exist = true;
        for word in line.arguments() {
            let Some(corner) = self.corner(word, &mut attributes_exist) else {
                self.tallies.no_vertex.add_word(line.number, word);
                self.corners.truncate(first);
                return;
            };
            self.corners.push(corner);
        }
        let corners = &mut self.corners[first..];
        if corners.len() < 3 {
            self.tallies.too_few_corners.add(line.number);
            self.corners.truncate(first);
            return;
        }
        let alike = make_alike(corners);
        self.tallies.half_given.add_if(!alike && attributes_exist, line.number);
        self.tallies.no_attribute.add_if(!attributes_exist, line.number);
        let group = self.group(line.number);
        let count = self.corners.len() - first;
        self.faces.push(Face { group, line: line.number, first, count, smoothing: self.smoothing });
    }

    /// `v`, `v/vt`, `v//vn` or `v/vt/vn`; `None` if `v` is no vertex.
    fn corner(&self, word: &str, attributes_exist: &mut bool) -> Option<Corner> {
        let obj = &self.obj;
        let mut parts = word.split('/');
        let position = index(parts.next()?, obj.positions.len())?;
        let mut attribute = |count: usize| match parts.next() {
            None | Some("") => NONE,
            Some(digits) => index(digits, count).unwrap_or_else(|| {
                *attributes_exist = false;
                NONE
            }),
        };
        let (uv, normal) = (attribute(obj.uvs.len()), attribute(obj.normals.len()));
        Some(Corner { position, uv, normal })
    }

    /// Where the current object and material keep their triangles.
    fn group(&mut self, line: u32) -> usize {
        if let Some(group) = self.group {
            return group;
        }
        let obj = &mut self.obj;
        let name = self.object.clone().unwrap_or_else(|| "default".into());
        let object = *self.known_objects.entry(name.clone()).or_insert_with(|| {
            obj.objects.push(name);
            obj.objects.len() - 1
        });
        let material = self.material.clone();
        let group = *self.known_groups.entry((object, material.clone())).or_insert_with(|| {
            obj.groups.push(Group { object, material, line, triangles: Vec::new() });
            obj.groups.len() - 1
        });
        self.group = Some(group);
        group
    }

    /// Checks indices, which may point ahead, and cuts faces into triangles.
    fn finish(mut self, notes: &mut Notes) -> Result<Obj, ReadError> {
        let (mut corners, mut points, mut cuts) = (Vec::new(), Vec::new(), Vec::new());
        let mut total = 0;
        self.smooth();
        for face in &self.faces {
            corners.clear();
            corners.extend_from_slice(&self.corners[face.first..face.first + face.count]);
            if let Some(corner) = corners.iter().find(|c| c.position as usize >= self.obj.positions.len()) {
                self.tallies.no_vertex.add_word(face.line, u64::from(corner.position) + 1);
                continue;
            }
            self.tallies.no_attribute.add_if(drop_beyond(&mut corners, &self.obj), face.line);
            points.clear();
            points.extend(corners.iter().map(|corner| self.obj.positions[corner.position as usize]));
            cuts.clear();
            if polygon::triangulate(&points, &mut cuts).is_err() {
                self.tallies.too_large.add(face.line);
                continue;
            }
            total += cuts.len();
            if total > TRIANGLES_MAX {
                return Err(ReadError::line(self.path, face.line, format!("more than {TRIANGLES_MAX} triangles")));
            }
            let triangles = &mut self.obj.groups[face.group].triangles;
            triangles.extend(cuts.iter().map(|cut| Triangle { corners: cut.map(|i| corners[i]), line: face.line }));
        }
        self.tallies.report(self.path, notes);
        self.obj.colours = self.colours.finish(self.obj.positions.len());
        Ok(self.obj)
    }
}

impl Parser<'_> {
    /// Gives the corners of smoothing groups' faces normals, where the file gives none.
    fn smooth(&mut self) {
        let lacks_normal = |face: &&Face| face.smoothing > 0 && self.corners[face.first].normal == NONE;
        let mut smoothing = Smoothing::default();
        for face in self.faces.iter().filter(lacks_normal) {
            let corners = &self.corners[face.first..face.first + face.count];
            let there = |corner: &Corner| self.obj.positions.get(corner.position as usize).copied();
            if let Some(points) = corners.iter().map(there).collect::<Option<Vec<DVec3>>>() {
                let vertices = corners.iter().map(|corner| corner.position);
                smoothing.add(face.smoothing, vertices, &points);
            }
        }
        let faces: Vec<_> =
            self.faces.iter().filter(lacks_normal).map(|f| (f.first..f.first + f.count, f.smoothing)).collect();
        for (range, group) in faces {
            for corner in &mut self.corners[range] {
                if let Some(normal) = smoothing.normal(group, corner.position, &mut self.obj.normals) {
                    corner.normal = normal;
                }
            }
        }
    }
}

/// The numbers behind the keyword, `needed` of them at least; `None` for what is no finite number. What follows them
/// (`w`) is not used.
fn numbers<const N: usize>(line: &Line, needed: usize, missing: &mut Tally, broken: &mut Tally) -> [Option<f64>; N] {
    let mut words = line.arguments();
    let mut are_missing = false;
    let mut first_broken = None;
    let numbers = std::array::from_fn(|i| {
        let Some(word) = words.next() else {
            are_missing |= i < needed;
            return Some(0.0);
        };
        let number = text::finite(word);
        if number.is_none() {
            first_broken = first_broken.or(Some(word));
        }
        number
    });
    missing.add_if(are_missing, line.number);
    if let Some(word) = first_broken {
        broken.add_word(line.number, word);
    }
    numbers
}

fn all<const N: usize>(numbers: [Option<f64>; N]) -> Option<[f64; N]> {
    numbers.iter().all(Option::is_some).then(|| numbers.map(Option::unwrap_or_default))
}

/// Zero-based. Positive numbers count from the start of the file, and may point ahead; negative ones count back from
/// the last of the `count` so far. `None` for 0 and for what cannot be an index.
fn index(digits: &str, count: usize) -> Option<u32> {
    let whole = |number: f64| (number.fract() == 0.0 && number.abs() < f64::from(NONE)).then_some(number as i64);
    let written: i64 = digits.parse().ok().or_else(|| whole(text::finite(digits)?))?;
    let index = match written {
        0 => return None,
        1.. => written - 1,
        _ => written.saturating_add(count as i64),
    };
    u32::try_from(index).ok().filter(|index| *index != NONE)
}

/// Takes an attribute from all corners if one of them names what does not exist. True if that was necessary.
fn drop_beyond(corners: &mut [Corner], obj: &Obj) -> bool {
    let beyond = |index: u32, count: usize| index != NONE && index as usize >= count;
    let no_uvs = corners.iter().any(|corner| beyond(corner.uv, obj.uvs.len()));
    let no_normals = corners.iter().any(|corner| beyond(corner.normal, obj.normals.len()));
    for corner in corners {
        corner.uv = if no_uvs { NONE } else { corner.uv };
        corner.normal = if no_normals { NONE } else { corner.normal };
    }
    no_uvs || no_normals
}

/// An attribute that some corners lack is taken from all. False if that was necessary.
fn make_alike(corners: &mut [Corner]) -> bool {
    let alike = |given: fn(&Corner) -> u32| {
        let lacking = corners.iter().filter(|corner| given(corner) == NONE).count();
        lacking == 0 || lacking == corners.len()
    };
    let (uvs, normals) = (alike(|corner| corner.uv), alike(|corner| corner.normal));
    for corner in corners {
        corner.uv = if uvs { corner.uv } else { NONE };
        corner.normal = if normals { corner.normal } else { NONE };
    }
    uvs && normals
}
