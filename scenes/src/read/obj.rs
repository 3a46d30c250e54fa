//! Wavefront OBJ text, read in one pass that knows every line by its number.
//!
//! The general parsers (tobj among them) lose what is needed here: faces with and without normals
//! within one group come out misaligned or with a neighbour's normal, `g` overwrites the name that
//! `o` gave, broken lines have no number, and some inputs panic. Reading the nine statements that
//! matter takes fewer lines than working around that.
//!
//! Understood: `v` (with `w` or colours behind it), `vt`, `vn`, `f` with any number of corners and
//! negative indices, `o`, `g`, `usemtl`, `mtllib`, `\` at the end of a line, any encoding.
//! Skipped: points, lines, smoothing groups (normals are explicit, or the face is flat).
//! Counted and skipped: curves and surfaces.

use std::collections::BTreeMap;
use std::path::Path;
use std::str::SplitAsciiWhitespace;

use glam::{DVec2, DVec3};

use super::error::{Notes, Tally};
use super::limits::TRIANGLES_MAX;
use super::text::{self, Line};
use super::{ReadError, polygon};

/// What an OBJ file says, in file space.
#[derive(Debug, Default)]
pub(super) struct Obj {
    pub positions: Vec<DVec3>,
    pub normals: Vec<DVec3>,
    pub uvs: Vec<DVec2>,
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
        parser.line(&line)?;
    }
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
}

struct Parser<'a> {
    path: &'a Path,
    object_word: &'static str,
    obj: Obj,
    faces: Vec<Face>,
    corners: Vec<Corner>,
    object: Option<String>,
    material: Option<String>,
    /// Where the current object and material keep their triangles, once there is one.
    group: Option<usize>,
    known_groups: BTreeMap<(usize, Option<String>), usize>,
    known_objects: BTreeMap<String, usize>,
    too_few: Tally,
    half_given: Tally,
    curves: Tally,
    not_numbers: Tally,
}

impl<'a> Parser<'a> {
    fn new(path: &'a Path, has_objects: bool) -> Self {
        Self {
            path,
            object_word: if has_objects { "o" } else { "g" },
            obj: Obj::default(),
            faces: Vec::new(),
            corners: Vec::new(),
            object: None,
            material: None,
            group: None,
            known_groups: BTreeMap::new(),
            known_objects: BTreeMap::new(),
            too_few: Tally::default(),
            half_given: Tally::default(),
            curves: Tally::default(),
            not_numbers: Tally::default(),
        }
    }

    fn line(&mut self, line: &Line) -> Result<(), ReadError> {
        let mut words = line.text.split_ascii_whitespace();
        let Some(keyword) = words.next() else { return Ok(()) };
        match keyword {
            "v" => {
                let position = self.numbers(line, words)?;
                self.not_numbers.add_if(!DVec3::from(position).is_finite(), line.number);
                self.obj.positions.push(position.into());
            }
            "vn" => {
                let normal = self.numbers(line, words)?;
                self.obj.normals.push(normal.into());
            }
            "vt" => {
                let [u, v] = self.texture_coordinates(line, words)?;
                self.obj.uvs.push(DVec2::new(u, v));
            }
            "f" | "fo" => self.face(line, words)?,
            "usemtl" => {
                self.material = Some(line.rest_after(keyword).to_owned()).filter(|name| !name.is_empty());
                self.group = None;
            }
            "mtllib" => self.obj.libraries.push((line.rest_after(keyword).to_owned(), line.number)),
            word if word == self.object_word => {
                self.object = Some(line.rest_after(keyword).to_owned()).filter(|name| !name.is_empty());
                self.group = None;
            }
            "curv" | "curv2" | "surf" => self.curves.add(line.number),
            _ => {}
        }
        Ok(())
    }

    /// Three numbers; what follows them (`w`, vertex colours) is not used.
    fn numbers<const N: usize>(&self, line: &Line, mut words: SplitAsciiWhitespace) -> Result<[f64; N], ReadError> {
        let mut values = [0.0; N];
        for value in &mut values {
            *value = self.number(line, words.next())?;
        }
        Ok(values)
    }

    /// One or two numbers: `vt u` is short for `vt u 0`.
    fn texture_coordinates(&self, line: &Line, mut words: SplitAsciiWhitespace) -> Result<[f64; 2], ReadError> {
        let u = self.number(line, words.next())?;
        let v = words.next().map_or(Ok(0.0), |word| self.number(line, Some(word)))?;
        Ok([u, v])
    }

    fn number(&self, line: &Line, word: Option<&str>) -> Result<f64, ReadError> {
        let keyword = line.text.split_ascii_whitespace().next().unwrap_or_default();
        let word = word.ok_or_else(|| self.broken(line, wanted(keyword)))?;
        word.parse().map_err(|_| self.broken(line, format!("`{keyword}`: `{}` is not a number", text::shorten(word))))
    }

    fn face(&mut self, line: &Line, words: SplitAsciiWhitespace) -> Result<(), ReadError> {
        let first = self.corners.len();
        for word in words.take_while(|word| !word.starts_with('#')) {
            let corner = self.corner(line, word)?;
            self.corners.push(corner);
        }
        let corners = &mut self.corners[first..];
        if corners.len() < 3 {
            self.too_few.add(line.number);
            self.corners.truncate(first);
            return Ok(());
        }
        self.half_given.add_if(!make_alike(corners), line.number);
        let group = self.group(line.number);
        self.faces.push(Face { group, line: line.number, first, count: self.corners.len() - first });
        Ok(())
    }

    /// `v`, `v/vt`, `v//vn` or `v/vt/vn`.
    fn corner(&self, line: &Line, word: &str) -> Result<Corner, ReadError> {
        let obj = &self.obj;
        let mut parts = word.split('/');
        let mut index = |count: usize, what: &str| match parts.next() {
            None | Some("") => Ok(NONE),
            Some(digits) => self.index(line, digits, count, what),
        };
        let position = index(obj.positions.len(), "v")?;
        let uv = index(obj.uvs.len(), "vt")?;
        let normal = index(obj.normals.len(), "vn")?;
        if position == NONE || parts.next().is_some() {
            let word = text::shorten(word);
            return Err(self.broken(line, format!("`{word}` is not a corner; write v, v/vt, v//vn or v/vt/vn")));
        }
        Ok(Corner { position, uv, normal })
    }

    /// Zero-based. Positive numbers count from the start of the file, and may point ahead;
    /// negative ones count back from here.
    fn index(&self, line: &Line, digits: &str, count: usize, what: &str) -> Result<u32, ReadError> {
        let written: i64 = digits
            .parse()
            .map_err(|_| self.broken(line, format!("`{}` is not a {what} index", text::shorten(digits))))?;
        let index = match written {
            0 => return Err(self.broken(line, format!("{what} index 0: OBJ counts from 1"))),
            1.. => written - 1,
            _ => written.saturating_add(count as i64),
        };
        match u32::try_from(index) {
            Ok(index) if index != NONE => Ok(index),
            _ => Err(self.broken(line, format!("{what} index {written} points nowhere: there are {count} so far"))),
        }
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
        let (mut points, mut cuts) = (Vec::new(), Vec::new());
        let mut total = 0;
        for face in &self.faces {
            let corners = &self.corners[face.first..face.first + face.count];
            self.check_range(face.line, corners)?;
            points.clear();
            points.extend(corners.iter().map(|corner| self.obj.positions[corner.position as usize]));
            cuts.clear();
            polygon::triangulate(&points, &mut cuts).map_err(|_| {
                let message = format!("a face of {} corners that is not convex is too large to cut", corners.len());
                ReadError::line(self.path, face.line, message + "; split it in the modelling program")
            })?;
            total += cuts.len();
            if total > TRIANGLES_MAX {
                return Err(ReadError::line(self.path, face.line, format!("more than {TRIANGLES_MAX} triangles")));
            }
            let triangles = &mut self.obj.groups[face.group].triangles;
            triangles.extend(cuts.iter().map(|cut| Triangle { corners: cut.map(|i| corners[i]), line: face.line }));
        }
        self.too_few.report(notes, self.path, "faces with fewer than three corners were skipped");
        self.half_given.report(
            notes,
            self.path,
            "faces give normals or texture coordinates at some corners only: flat",
        );
        self.curves.report(notes, self.path, "free-form curves or surfaces were skipped; only faces are drawn");
        self.not_numbers.report(notes, self.path, "vertices are no finite numbers; faces that use them were dropped");
        Ok(self.obj)
    }

    fn check_range(&self, line: u32, corners: &[Corner]) -> Result<(), ReadError> {
        let obj = &self.obj;
        let beyond = |index: u32, count: usize| index != NONE && index as usize >= count;
        for corner in corners {
            let wrong = [
                (corner.position, obj.positions.len(), "v"),
                (corner.uv, obj.uvs.len(), "vt"),
                (corner.normal, obj.normals.len(), "vn"),
            ];
            if let Some((index, count, what)) = wrong.into_iter().find(|(index, count, _)| beyond(*index, *count)) {
                let index = u64::from(index) + 1;
                let message = format!("the face uses {what} {index}, but the file has only {count}");
                return Err(ReadError::line(self.path, line, message));
            }
        }
        Ok(())
    }

    fn broken(&self, line: &Line, message: String) -> ReadError {
        ReadError::line(self.path, line.number, message)
    }
}

/// What a statement with too few numbers needs.
fn wanted(keyword: &str) -> String {
    match keyword {
        "vt" => "`vt` needs one or two numbers, such as vt 0.5 1".into(),
        _ => format!("`{keyword}` needs three numbers, such as {keyword} 0 1 0"),
    }
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
