//! IES LM-63 of 1986, 1991, 1995, 2002 and 2019: keywords, TILT, and then nothing but numbers, however they are broken into
//! lines.

use std::path::Path;

use glam::DVec3;

use super::web::{Symmetry, Web};
use super::{Photometry, number};
use crate::read::ReadError;
use crate::read::error::Notes;
use crate::read::{find::find, limits, text};

/// Its numbers, one after the other.
struct Numbers<'a> {
    file: &'a Path,
    /// Each with its line.
    words: std::vec::IntoIter<(u32, &'a str)>,
    /// Of the last one.
    line: u32,
}

/// What stands before the angles.
struct Head {
    lamps: f64,
    lumens: f64,
    multiplier: f64,
    kind: Kind,
    counts: [usize; 2],
    ballast: f64,
}

/// How angles are measured.
#[derive(Clone, Copy, PartialEq)]
enum Kind {
    /// C-planes about the vertical: indoors, streets.
    C,
    /// Planes about a horizontal axis: floodlights.
    B,
    /// Planes about the vertical, from straight ahead: headlamps.
    A,
}

pub(super) fn read(file: &Path, text: &str, folder: Option<&Path>, notes: &mut Notes) -> Result<Photometry, ReadError> {
    let mut lines = (1_u32..).zip(text.lines());
    let is_of_the_nineties =
        ["IESNA:LM-63-2002", "IESNA:LM-63-2019"].iter().all(|later| !text.trim_start().starts_with(later));
    let tilt = lines.by_ref().find_map(|(line, words)| {
        let (key, what) = words.trim().split_once('=')?;
        key.trim().eq_ignore_ascii_case("TILT").then(|| (line, what.trim()))
    });
    let Some((line, tilt)) = tilt else {
        return Err(ReadError::file(file, "has no line TILT=, so it is no IES LM-63 file"));
    };
    let rest: Vec<(u32, &str)> = lines.collect();
    let lacks_multiplier = lacks_multiplier(&rest, tilt);
    let mut numbers = Numbers::new(file, line, &rest);
    let tilt = match tilt.to_ascii_uppercase().as_str() {
        "NONE" | "" => Vec::new(),
        "INCLUDE" => numbers.tilt()?,
        _ => tilt_of_file(file, line, tilt, folder)?,
    };
    let head = numbers.head(lacks_multiplier, is_of_the_nineties)?;
    if lacks_multiplier {
        notes.line(file, numbers.line, "the multiplier of the intensities is missing: taken as 1");
    }
    let [verticals, horizontals] = [numbers.angles(head.counts[0])?, numbers.angles(head.counts[1])?];
    let mut candela = numbers.list(head.counts[0] * head.counts[1])?;
    let more = numbers.words.count();
    if more > 0 {
        notes.file(file, format!("{more} numbers behind the last intensity are left out"));
    }
    let negative = candela.iter().filter(|value| **value < 0.0).count();
    if negative > 0 {
        notes.file(file, format!("{negative} intensities are negative: taken as 0"));
        candela.iter_mut().for_each(|value| *value = value.max(0.0));
    }
    let web = match head.kind {
        Kind::C => of_planes(file, &horizontals, verticals, &candela, notes)?,
        kind => of_goniometer(file, kind, &horizontals, &verticals, &candela)?,
    };
    let factor = head.multiplier * head.ballast;
    let lamps = (head.lumens >= 0.0 && head.lamps > 0.0).then_some(head.lamps * head.lumens).filter(|flux| *flux > 0.0);
    Ok(Photometry { web: web.scaled(factor), lamps, tilt })
}

/// Some files have nine numbers where ten belong, and then three in a line of their own: what lacks is the multiplier, third.
fn lacks_multiplier(rest: &[(u32, &str)], tilt: &str) -> bool {
    if tilt.eq_ignore_ascii_case("INCLUDE") {
        return false;
    }
    let mut counts = rest.iter().map(|(_, line)| words(line).count()).filter(|count| *count > 0);
    (counts.next(), counts.next()) == (Some(9), Some(3))
}

fn words(line: &str) -> impl Iterator<Item = &str> {
    // Commas part numbers here: LM-63 allows both, and knows no decimal ones.
    line.split(|letter: char| letter.is_whitespace() || letter == ',' || letter == '\u{1a}')
        .filter(|word| !word.is_empty())
}

fn tilt_of_file(file: &Path, line: u32, name: &str, folder: Option<&Path>) -> Result<Vec<[f64; 2]>, ReadError> {
    let found = folder.and_then(|folder| find(&[folder], name)).ok_or_else(|| {
        let name = text::shorten(name);
        ReadError::line(file, line, format!("TILT={name}: there is no such file beside it"))
    })?;
    let bytes = limits::read_bytes(&found)?;
    let text = text::decode(&bytes);
    let lines: Vec<(u32, &str)> = (1..).zip(text.lines()).collect();
    Numbers::new(&found, 1, &lines).tilt()
}

impl<'a> Numbers<'a> {
    fn new(file: &'a Path, line: u32, lines: &[(u32, &'a str)]) -> Self {
        let all = lines.iter().flat_map(|&(line, text)| words(text).map(move |word| (line, word)));
        Self { file, words: all.collect::<Vec<_>>().into_iter(), line }
    }

    fn next(&mut self, what: &str) -> Result<f64, ReadError> {
        let Some((line, word)) = self.words.next() else {
            return Err(ReadError::line(self.file, self.line, format!("the file ends where {what} should be")));
        };
        self.line = line;
        number(word).ok_or_else(|| {
            let word = text::shorten(word);
            ReadError::line(self.file, line, format!("`{word}` is no number, where {what} should be"))
        })
    }

    fn count(&mut self, what: &str) -> Result<usize, ReadError> {
        let value = self.next(what)?;
        if value.fract() == 0.0 && (1.0..=limits::ANGLES_MAX as f64).contains(&value) {
            return Ok(value as usize);
        }
        let most = limits::ANGLES_MAX;
        Err(ReadError::line(self.file, self.line, format!("{value} is no {what}: 1 to {most}")))
    }

    fn list(&mut self, count: usize) -> Result<Vec<f64>, ReadError> {
        // Nothing is reserved that the file does not fill.
        (0..count).map(|i| self.next(&format!("intensity {} of {count}", i + 1))).collect()
    }

    fn angles(&mut self, count: usize) -> Result<Vec<f64>, ReadError> {
        let mut angles: Vec<f64> = Vec::new();
        for i in 0..count {
            let angle = self.next(&format!("angle {} of {count}", i + 1))?;
            if angles.last().is_some_and(|last| *last >= angle) {
                return Err(ReadError::line(
                    self.file,
                    self.line,
                    format!("angle {angle} is not greater than the one before"),
                ));
            }
            angles.push(angle);
        }
        Ok(angles)
    }

    /// Which way the lamp lies, how many pairs, angles, factors.
    fn tilt(&mut self) -> Result<Vec<[f64; 2]>, ReadError> {
        self.next("the lamp's geometry")?;
        let count = self.count("number of tilt angles")?;
        let angles = self.angles(count)?;
        angles.into_iter().map(|angle| Ok([angle, self.next("a factor of tilt")?.max(0.0)])).collect()
    }

    fn head(&mut self, lacks_multiplier: bool, is_of_the_nineties: bool) -> Result<Head, ReadError> {
        let lamps = self.next("the number of lamps")?;
        let lumens = self.next("the lumens of a lamp")?;
        let multiplier = if lacks_multiplier { 1.0 } else { self.next("the multiplier")? };
        if multiplier <= 0.0 {
            return Err(ReadError::line(self.file, self.line, format!("a multiplier of {multiplier} leaves no light")));
        }
        let counts = [self.count("number of vertical angles")?, self.count("number of horizontal angles")?];
        if counts[0] * counts[1] > limits::INTENSITIES_MAX {
            let most = limits::INTENSITIES_MAX;
            return Err(ReadError::line(self.file, self.line, format!("more than {most} intensities are too many")));
        }
        let kind = match self.next("the photometric type")? as i64 {
            1 => Kind::C,
            2 => Kind::B,
            3 => Kind::A,
            other => {
                let what = format!("there is no photometric type {other}: 1, 2 and 3 are C, B and A");
                return Err(ReadError::line(self.file, self.line, what));
            }
        };
        for what in ["the unit of length", "the width", "the length", "the height"] {
            self.next(what)?;
        }
        let ballast = self.next("the ballast factor")?;
        // Of the nineties this is a factor, too; later it has no meaning, and then says how the file was made.
        let lamp = self.next("the ballast-lamp factor")?;
        self.next("the input watts")?;
        let usable = |factor: f64| if factor > 0.0 { factor } else { 1.0 };
        let ballast = usable(ballast) * if is_of_the_nineties { usable(lamp) } else { 1.0 };
        Ok(Head { lamps, lumens, multiplier, kind, counts, ballast })
    }
}

fn of_planes(
    file: &Path,
    planes: &[f64],
    verticals: Vec<f64>,
    candela: &[f64],
    notes: &mut Notes,
) -> Result<Web, ReadError> {
    let (first, last) = (planes[0], planes[planes.len() - 1]);
    if verticals[0] < 0.0 || verticals[verticals.len() - 1] > 180.0 {
        return Err(ReadError::file(file, "has vertical angles beyond 0..180, which type C has not"));
    }
    if !(-360.0..=720.0).contains(&first) || last - first > 360.0 {
        return Err(ReadError::file(file, "has horizontal angles of more than one turn"));
    }
    let symmetry = match (planes.len(), first, last) {
        (1, ..) => Symmetry::Axial,
        (_, 0.0, 90.0) => Symmetry::Quarter,
        (_, 0.0, 180.0) => Symmetry::Half,
        (_, 90.0, 270.0) => Symmetry::HalfAcross,
        _ => {
            if last - first < 180.0 {
                notes.file(file, format!("has planes from {first}° to {last}° alone: between the last and the first it is as between others"));
            }
            Symmetry::None
        }
    };
    Ok(Web::new(symmetry, planes, verticals, candela))
}

/// Types B and A: angles from straight ahead, up and to the right; one side alone is mirrored. They become C-planes about
/// the way ahead.
fn of_goniometer(
    file: &Path,
    kind: Kind,
    horizontals: &[f64],
    verticals: &[f64],
    candela: &[f64],
) -> Result<Web, ReadError> {
    let within = |angles: &[f64]| angles.iter().all(|angle| (-180.0..=180.0).contains(angle));
    if !within(horizontals) || !within(verticals) {
        return Err(ReadError::file(file, "has angles beyond −180..180, which types A and B have not"));
    }
    let rows = verticals.len();
    let way = |angles: &[f64], at: f64| -> Option<(usize, f64)> {
        let (first, last) = (angles[0], angles[angles.len() - 1]);
        // One side stands for both.
        let at = if first >= 0.0 { at.abs() } else { at };
        if at < first - 1e-6 || at > last + 1e-6 {
            return None;
        }
        let after = angles.partition_point(|angle| *angle <= at).clamp(1, angles.len().max(2) - 1);
        let (a, b) = (angles[after - 1], angles[after.min(angles.len() - 1)]);
        Some((after - 1, if b > a { ((at - a) / (b - a)).clamp(0.0, 1.0) } else { 0.0 }))
    };
    let intensity = |direction: DVec3| {
        let DVec3 { x: right, y: up, z: ahead } = direction;
        let (horizontal, vertical) = match kind {
            Kind::A => (libm::atan2(right, ahead), libm::asin(up.clamp(-1.0, 1.0))),
            _ => (libm::asin(right.clamp(-1.0, 1.0)), libm::atan2(up, ahead)),
        };
        let (Some((h, across)), Some((v, along))) =
            (way(horizontals, horizontal.to_degrees()), way(verticals, vertical.to_degrees()))
        else {
            return 0.0;
        };
        let of = |h: usize, v: usize| candela[h.min(horizontals.len() - 1) * rows + v.min(rows - 1)];
        let plane = |h: usize| of(h, v) + (of(h, v + 1) - of(h, v)) * along;
        plane(h) + (plane(h + 1) - plane(h)) * across
    };
    Ok(Web::of_directions(intensity))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lamp(text: &str) -> (Result<Photometry, String>, String) {
        let mut notes = Notes::default();
        let read = read(Path::new("lamp.ies"), text, None, &mut notes).map_err(|error| error.to_string());
        (read, notes.into_list().iter().map(|note| format!("{note}\n")).collect())
    }

    const HEAD: &str = "IESNA:LM-63-2002\r\n[TEST] none\r\n[MANUFAC] nobody\r\nTILT=NONE\r\n";

    #[test]
    fn a_ball_is_read_however_its_lines_are_broken() {
        let expected = 4.0 * std::f64::consts::PI * 200.0;
        for text in [
            "IESNA91\nTILT=NONE\n1 2500 2 3 1 1 2 0 0 0\n1 1 20\n0 90 180\n0\n100 100 100\n",
            "TILT=NONE\r1,2500,2,3,1,1,2,0,0,0\r1,1,20\r0,90,180\r0\r100,100,100\r",
            "\u{feff}IESNA:LM-63-1995\r\n[OTHER] TILT is none\r\n tilt = none \r\n1 2500 2\r\n3 1 1 2 0 0 0 1 1 20 0\r\n90 180 0 100 100\r\n100\r\n\u{1a}",
        ] {
            let text = text.trim_start_matches('\u{feff}').replace('\r', "\n");
            let (read, said) = lamp(&text);
            let read = read.unwrap();
            assert!((read.web.flux() - expected).abs() < 1e-6, "{}", read.web.flux());
            assert_eq!((read.lamps, said.as_str()), (Some(2500.0), ""));
        }
    }

    #[test]
    fn factors_count_where_they_mean_something() {
        let flux = |edition: &str| {
            let text = format!("{edition}\nTILT=NONE\n1 -1 1 2 1 1 2 0 0 0\n0.8 0.5 20\n0 180\n0\n100 100\n");
            let read = lamp(&text).0.unwrap();
            (read.web.flux() / (400.0 * std::f64::consts::PI), read.lamps)
        };
        let close = |(found, lamps): (f64, Option<f64>), expected: f64| {
            assert!((found - expected).abs() < 1e-9 && lamps.is_none(), "{found}");
        };
        close(flux("IESNA91"), 0.4);
        close(flux("IESNA:LM-63-1995"), 0.4);
        close(flux("IESNA:LM-63-2002"), 0.8);
        close(flux("IESNA:LM-63-2019"), 0.8);
    }

    #[test]
    fn what_is_missing_or_too_much_is_said() {
        let (read, said) = lamp(&format!("{HEAD}1 1000 2 1 1 2 0 0 0\n1 1 20\n0 180\n0\n100 100 5 6 7\n"));
        assert!((read.unwrap().web.peak() - 100.0).abs() < 1e-9);
        assert!(said.contains("the multiplier of the intensities is missing: taken as 1"), "{said}");
        assert!(said.contains("3 numbers behind the last intensity are left out"), "{said}");
    }

    #[test]
    fn tilt_is_read_with_the_rest() {
        let text = "IESNA91\nTILT=INCLUDE\n1\n3\n0 45 90\n1 0.9 0.5\n1 1000 1 2 1 1 2 0 0 0\n1 1 20\n0 180\n0\n10 10\n";
        assert_eq!(lamp(text).0.unwrap().tilt, [[0.0, 1.0], [45.0, 0.9], [90.0, 0.5]]);
    }

    /// A searchlight ahead, 10° to the right and 20° up: B turns up first, A to the right first.
    #[test]
    fn types_a_and_b_look_ahead() {
        for (kind, direction) in [
            (2, [10_f64.to_radians().sin(), 10_f64.to_radians().cos() * 20_f64.to_radians().sin()]),
            (3, [20_f64.to_radians().cos() * 10_f64.to_radians().sin(), 20_f64.to_radians().sin()]),
        ] {
            let mut text = format!("{HEAD}1 1000 1 9 9 {kind} 2 0 0 0\n1 1 20\n");
            text += &"-40 -30 -20 -10 0 10 20 30 40\n".repeat(2);
            for h in 0..9 {
                for v in 0..9 {
                    text += if (h, v) == (5, 6) { "1000 " } else { "0 " };
                }
                text += "\n";
            }
            let web = lamp(&text).0.unwrap().web;
            let [right, up] = direction;
            let gamma = (right * right + up * up).sqrt().asin().to_degrees();
            let c = up.atan2(right).to_degrees();
            let found = web.at(c, gamma);
            assert!((900.0..=1000.0).contains(&found), "type {kind}: {found}");
            assert_eq!(web.at(c + 180.0, gamma), 0.0);
        }
        // One side stands for both.
        let text = format!("{HEAD}1 1000 1 2 2 2 2 0 0 0\n1 1 20\n-90 90\n0 90\n50 50 50 50\n");
        let web = lamp(&text).0.unwrap().web;
        assert_eq!((web.at(0.0, 45.0), web.at(180.0, 45.0)), (50.0, 50.0));
    }

    #[test]
    fn what_is_broken_is_named_with_its_line() {
        for (rest, expected) in [
            ("", "lamp.ies:4: the file ends where the number of lamps should be"),
            ("1 1000 x\n", "lamp.ies:5: `x` is no number, where the multiplier should be"),
            ("1 1000 0 2 1 1 2 0 0 0 1 1 1\n", "a multiplier of 0 leaves no light"),
            ("1 1000 1 0 1 1 2 0 0 0\n", "lamp.ies:5: 0 is no number of vertical angles"),
            ("1 1000 1 1e9 1 1 2 0 0 0\n", "lamp.ies:5: 1000000000 is no number of vertical angles"),
            ("1 1000 1 2 1 7 2 0 0 0\n", "there is no photometric type 7"),
            ("1 1000 1 2 1 1 2 0 0 0\n1 1 1\n90 0\n", "lamp.ies:7: angle 0 is not greater"),
            ("1 1000 1 2 1 1 2 0 0 0\n1 1 1\n0 270\n0\n1 1\n", "vertical angles beyond 0..180"),
            (
                "1 1000 1 2 1 1 2 0 0 0\n1 1 1\n0 90\n0\n1\n",
                "lamp.ies:9: the file ends where intensity 2 of 2 should be",
            ),
        ] {
            let error = lamp(&format!("{}{rest}", HEAD.replace('\r', ""))).0.unwrap_err();
            assert!(error.contains(expected), "{rest}\n{error}");
        }
        assert!(lamp("hello\nworld\n").0.unwrap_err().contains("has no line TILT="));
    }
}
