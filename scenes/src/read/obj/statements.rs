//! What the statements of a stretch of an OBJ file say.

use glam::{DVec3, Vec2, Vec3};

use super::super::error::Tally;
use super::super::text::{self, Line};
use super::super::vertex_colours::{PAINT, VertexColours};
use super::stretch::Stretch;
use super::{Corner, NONE};

/// What a stretch holds; indices are those of the whole file.
#[derive(Default)]
pub(super) struct Statements {
    pub positions: Vec<DVec3>,
    pub normals: Vec<Vec3>,
    pub uvs: Vec<Vec2>,
    pub colours: VertexColours,
    pub faces: Faces,
    /// In order.
    pub turns: Vec<Turn>,
    /// `mtllib` file names as written, each with its line.
    pub libraries: Vec<(String, u32)>,
    pub tallies: Tallies,
}

/// Faces as written, of three corners or more.
#[derive(Default)]
pub(super) struct Faces {
    pub corners: Vec<Corner>,
    /// The line of each, and where its corners end.
    pub list: Vec<(u32, u32)>,
}

impl Faces {
    /// Where the corners of a face stand.
    pub fn range(&self, face: usize) -> std::ops::Range<usize> {
        let first = face.checked_sub(1).map_or(0, |before| self.list[before].1);
        first as usize..self.list[face].1 as usize
    }
}

/// A statement about the faces that follow.
pub(super) struct Turn {
    /// The first of them, by its number in the stretch.
    pub face: usize,
    pub to: To,
}

/// See [`Turn`].
pub(super) enum To {
    Object(Option<String>),
    Material(Option<String>),
    /// 0 is none.
    Smoothing(u32),
}

/// What was left out or replaced.
#[derive(Default)]
pub(super) struct Tallies {
    pub too_few_corners: Tally,
    pub too_large: Tally,
    pub no_vertex: Tally,
    pub no_attribute: Tally,
    pub half_given: Tally,
    pub curves: Tally,
    pub lines: Tally,
    pub maps: Tally,
    pub missing: Tally,
    pub positions: Tally,
    pub normals: Tally,
    pub uvs: Tally,
}

impl Statements {
    /// Reads a stretch; `object_word` begins the statements that name objects.
    pub fn read(stretch: &Stretch, object_word: &str) -> Self {
        let mut statements = Self::default();
        for line in text::lines_from(stretch.text, stretch.before.lines.saturating_add(1)) {
            statements.line(&line, stretch, object_word);
        }
        if stretch.text.contains(PAINT) {
            statements.colours.paint(stretch.text);
        }
        statements
    }

    fn line(&mut self, line: &Line, stretch: &Stretch, object_word: &str) {
        let Some(keyword) = line.text.split_ascii_whitespace().next() else { return };
        match keyword {
            "v" => {
                let position = numbers(line, 3, &mut self.tallies.missing, &mut self.tallies.positions);
                self.positions.push(DVec3::from(position.map(|number| number.unwrap_or(f64::NAN))));
                self.colours.vertex(line);
            }
            "vn" => {
                let normal = numbers(line, 3, &mut self.tallies.missing, &mut self.tallies.normals);
                self.normals.push(all::<3>(normal).map_or(Vec3::ZERO, |normal| DVec3::from(normal).as_vec3()));
            }
            "vt" => {
                // `vt u` is short for `vt u 0`.
                let uv = numbers(line, 1, &mut self.tallies.missing, &mut self.tallies.uvs);
                self.uvs.push(all::<2>(uv).map_or(Vec2::ZERO, |uv| Vec2::from(uv.map(|part| part as f32))));
            }
            "f" | "fo" => self.face(line, stretch),
            "usemtl" => self.turn(To::Material(name(line, keyword))),
            "mtllib" => self.libraries.push((line.rest_after(keyword).to_owned(), line.number)),
            word if word == object_word => self.turn(To::Object(name(line, keyword))),
            "s" => {
                // `s off` is `s 0`.
                let group = line.arguments().next().and_then(|word| word.parse().ok()).unwrap_or(0);
                self.turn(To::Smoothing(group));
            }
            "curv" | "curv2" | "surf" => self.tallies.curves.add(line.number),
            "l" | "p" => self.tallies.lines.add(line.number),
            "usemap" if line.arguments().any(|name| name != "off") => self.tallies.maps.add(line.number),
            _ => {}
        }
    }

    fn turn(&mut self, to: To) {
        self.turns.push(Turn { face: self.faces.list.len(), to });
    }

    fn face(&mut self, line: &Line, stretch: &Stretch) {
        let first = self.faces.corners.len();
        let mut attributes_exist = true;
        for word in line.arguments() {
            let Some(corner) = self.corner(word, stretch, &mut attributes_exist) else {
                self.tallies.no_vertex.add_word(line.number, word);
                self.faces.corners.truncate(first);
                return;
            };
            self.faces.corners.push(corner);
        }
        let corners = &mut self.faces.corners[first..];
        if corners.len() < 3 {
            self.tallies.too_few_corners.add(line.number);
            self.faces.corners.truncate(first);
            return;
        }
        let alike = make_alike(corners);
        self.tallies.half_given.add_if(!alike && attributes_exist, line.number);
        self.tallies.no_attribute.add_if(!attributes_exist, line.number);
        let end = u32::try_from(self.faces.corners.len()).expect("a stretch is far shorter than 4 GiB, or one line");
        self.faces.list.push((line.number, end));
    }

    /// `v`, `v/vt`, `v//vn` or `v/vt/vn`; `None` if `v` is no vertex.
    fn corner(&self, word: &str, stretch: &Stretch, attributes_exist: &mut bool) -> Option<Corner> {
        let before = &stretch.before;
        let mut parts = word.split('/');
        let position = index(parts.next()?, before.positions + self.positions.len())?;
        let mut attribute = |count: usize| match parts.next() {
            None | Some("") => NONE,
            Some(digits) => index(digits, count).unwrap_or_else(|| {
                *attributes_exist = false;
                NONE
            }),
        };
        let uv = attribute(before.uvs + self.uvs.len());
        let normal = attribute(before.normals + self.normals.len());
        Some(Corner { position, uv, normal })
    }
}

/// What follows the keyword, if anything does.
fn name(line: &Line, keyword: &str) -> Option<String> {
    Some(line.rest_after(keyword).to_owned()).filter(|name| !name.is_empty())
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
