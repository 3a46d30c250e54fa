//! EULUMDAT (`.ldt`): a field to a line, intensities in candela for a thousand lumens of the lamps (A. Stockmar, 1990).

use std::path::Path;

use super::web::{Symmetry, Web};
use super::{Photometry, number};
use crate::read::ReadError;
use crate::read::error::Notes;
use crate::read::{limits, text};

/// Its lines; blank ones count.
struct Lines<'a> {
    file: &'a Path,
    rest: std::str::Lines<'a>,
    /// Of the last one.
    line: u32,
}

pub(super) fn read(file: &Path, text: &str, notes: &mut Notes) -> Result<Photometry, ReadError> {
    let mut lines = Lines { file, rest: text.lines(), line: 0 };
    lines.skip(2);
    let symmetry = lines.count("symmetry (Isym)", 0, 4)?;
    let planes = lines.count("number of C-planes (Mc)", 1, limits::ANGLES_MAX)?;
    lines.skip(1);
    let gammas = lines.count("number of intensities in a plane (Ng)", 1, limits::ANGLES_MAX)?;
    if planes * gammas > limits::INTENSITIES_MAX {
        let most = limits::INTENSITIES_MAX;
        return Err(ReadError::line(file, lines.line, format!("more than {most} intensities are too many")));
    }
    // Names, sizes and shares that say nothing of intensities: lines 7 to 23.
    lines.skip(17);
    let factor = lines.next("the conversion factor")?;
    lines.skip(1);
    let sets = lines.count("number of sets of lamps", 0, LAMP_SETS_MAX)?;
    let (mut flux, mut is_absolute) = (0.0, false);
    for set in 0..sets {
        let lamps = lines.next("the number of lamps")?;
        lines.skip(1);
        let of_set = lines.next("the lamps' flux")?;
        lines.skip(3);
        if set == 0 {
            // Less than no lamps: what is measured is the luminaire itself.
            (flux, is_absolute) = (of_set, lamps < 0.0);
        }
    }
    if sets > 1 {
        notes.file(file, format!("may have {sets} sets of lamps: taken with the first"));
    }
    lines.skip(DIRECT_RATIOS);
    let c_deg = lines.ascending("C-plane", planes)?;
    let gamma_deg = lines.ascending("angle γ", gammas)?;
    let (symmetry, kept) = match symmetry {
        0 => (Symmetry::None, 0..planes),
        1 => (Symmetry::Axial, 0..1),
        2 => (Symmetry::Half, 0..planes / 2 + 1),
        3 => (Symmetry::HalfAcross, 0..planes / 2 + 1),
        _ => (Symmetry::Quarter, 0..planes / 4 + 1),
    };
    // Half a turn from C = 270° on is written as planes 270 … 360 … 450.
    let first = if symmetry == Symmetry::HalfAcross { 3 * planes / 4 } else { 0 };
    let turned = |plane: usize| c_deg[(first + plane) % planes] + if first + plane >= planes { 360.0 } else { 0.0 };
    let planes_deg: Vec<f64> =
        kept.clone().map(|plane| if symmetry == Symmetry::Axial { 0.0 } else { turned(plane) }).collect();
    let mut candela = Vec::new();
    for i in 0..kept.len() * gammas {
        candela.push(lines.next(&format!("intensity {} of {}", i + 1, kept.len() * gammas))?);
    }
    let more = lines.rest.filter(|line| !line.trim().is_empty()).count();
    if more > 0 {
        notes.file(file, format!("{more} lines behind the last intensity are left out"));
    }
    let negative = candela.iter().filter(|value| **value < 0.0).count();
    if negative > 0 {
        notes.file(file, format!("{negative} intensities are negative: taken as 0"));
        candela.iter_mut().for_each(|value| *value = value.max(0.0));
    }
    if flux <= 0.0 {
        notes.file(file, "its lamps have no flux: intensities are taken as for 1000 lm");
        flux = 1000.0;
    }
    if !gamma_deg.iter().all(|gamma| (0.0..=180.0).contains(gamma)) {
        return Err(ReadError::file(file, "has angles γ beyond 0..180"));
    }
    let factor = if factor > 0.0 { factor } else { 1.0 };
    let web = Web::new(symmetry, &planes_deg, gamma_deg, &candela).scaled(factor * flux / 1000.0);
    Ok(Photometry { web, lamps: (!is_absolute).then_some(flux), tilt: Vec::new() })
}

/// The format has 20 at most; files with more are none.
const LAMP_SETS_MAX: usize = 20;
/// Shares of the flux for ten rooms.
const DIRECT_RATIOS: usize = 10;

impl Lines<'_> {
    fn skip(&mut self, count: usize) {
        for _ in 0..count {
            self.rest.next();
            self.line += 1;
        }
    }

    fn next(&mut self, what: &str) -> Result<f64, ReadError> {
        self.line += 1;
        let Some(line) = self.rest.next() else {
            return Err(ReadError::line(self.file, self.line, format!("the file ends where {what} should be")));
        };
        number(line).ok_or_else(|| {
            let line = text::shorten(line.trim());
            ReadError::line(self.file, self.line, format!("`{line}` is no number, where {what} should be"))
        })
    }

    fn count(&mut self, what: &str, least: usize, most: usize) -> Result<usize, ReadError> {
        let value = self.next(what)?;
        if value.fract() == 0.0 && (least as f64..=most as f64).contains(&value) {
            return Ok(value as usize);
        }
        Err(ReadError::line(self.file, self.line, format!("{value} is no {what}: {least} to {most}")))
    }

    fn ascending(&mut self, what: &str, count: usize) -> Result<Vec<f64>, ReadError> {
        let mut angles: Vec<f64> = Vec::new();
        for i in 0..count {
            let angle = self.next(&format!("{what} {} of {count}", i + 1))?;
            if angles.last().is_some_and(|last| *last >= angle) {
                return Err(ReadError::line(
                    self.file,
                    self.line,
                    format!("{what} {angle} is not greater than the one before"),
                ));
            }
            angles.push(angle);
        }
        Ok(angles)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A file with so many planes and angles, whose intensities are made of their angles, for 2000 lm.
    fn file(symmetry: usize, planes: usize, stored: usize, intensity: impl Fn(usize, usize) -> f64) -> String {
        let mut lines: Vec<String> = vec!["nobody".into(), "2".into(), symmetry.to_string(), planes.to_string()];
        lines.extend(["0", "3", "45", "r", "lamp", "1", "lamp.ldt", "today"].map(String::from));
        lines.extend(["0"; 9].map(String::from));
        lines.extend(["100", "80,5", "1", "0", "1", "2", "any", "2000", "3000", "80", "20"].map(String::from));
        lines.extend(["0"; 10].map(String::from));
        lines.extend((0..planes).map(|plane| (360 * plane / planes).to_string()));
        lines.extend([0, 45, 90].map(|gamma| gamma.to_string()));
        for plane in 0..stored {
            lines.extend([0, 45, 90].map(|gamma| format!("{}", intensity(plane, gamma))));
        }
        lines.join("\r\n")
    }

    fn lamp(text: &str) -> (Result<Photometry, String>, String) {
        let mut notes = Notes::default();
        let read = read(Path::new("lamp.ldt"), text, &mut notes).map_err(|error| error.to_string());
        (read, notes.into_list().iter().map(|note| format!("{note}\n")).collect())
    }

    #[test]
    fn each_symmetry_stores_its_planes_and_fills_the_turn() {
        // Intensity at γ = 90° is the plane's number as stored; twice, for 2000 lm.
        let at = |symmetry, stored, c| {
            let intensity = |plane: usize, gamma: usize| if gamma == 90 { plane as f64 } else { 0.0 };
            let (read, said) = lamp(&file(symmetry, 8, stored, intensity));
            assert_eq!(said, "");
            read.unwrap().web.at(c, 90.0) / 2.0
        };
        for (symmetry, stored, c, plane) in [
            (0, 8, 45.0, 1.0),
            (0, 8, 315.0, 7.0),
            (1, 1, 200.0, 0.0),
            (2, 5, 135.0, 3.0),
            (2, 5, 225.0, 3.0),
            (3, 5, 270.0, 0.0),
            (3, 5, 0.0, 2.0),
            (3, 5, 90.0, 4.0),
            (3, 5, 180.0, 2.0),
            (3, 5, 225.0, 1.0),
            (4, 3, 90.0, 2.0),
            (4, 3, 135.0, 1.0),
            (4, 3, 315.0, 1.0),
        ] {
            assert_eq!(at(symmetry, stored, c), plane, "Isym {symmetry}, C = {c}°");
        }
    }

    #[test]
    fn intensities_are_for_a_thousand_lumens() {
        let (read, said) = lamp(&file(1, 4, 1, |_, _| 100.0));
        let read = read.unwrap();
        assert_eq!((read.web.peak(), read.lamps, said.as_str()), (200.0, Some(2000.0), ""));
        let absolute = file(1, 4, 1, |_, _| 100.0).replace("\r\n2\r\nany", "\r\n-2\r\nany");
        assert_eq!(lamp(&absolute).0.unwrap().lamps, None);
        let dark = file(1, 4, 1, |_, _| 100.0).replace("\r\n2000\r\n", "\r\n0\r\n");
        assert!(lamp(&dark).1.contains("its lamps have no flux"));
    }

    #[test]
    fn what_is_broken_is_named_with_its_line() {
        let whole = file(4, 8, 3, |_, _| 1.0);
        let cut = &whole[..whole.len() - 3];
        assert!(
            lamp(cut).0.unwrap_err().contains("the file ends where intensity 9 of 9 should be"),
            "{:?}",
            lamp(cut).0
        );
        let odd = whole.replacen("\r\n4\r\n", "\r\n7\r\n", 1);
        assert!(lamp(&odd).0.unwrap_err().contains("lamp.ldt:3: 7 is no symmetry (Isym): 0 to 4"));
        let word = whole.replacen("\r\n8\r\n", "\r\neight\r\n", 1);
        assert!(lamp(&word).0.unwrap_err().contains("lamp.ldt:4: `eight` is no number"));
    }
}
