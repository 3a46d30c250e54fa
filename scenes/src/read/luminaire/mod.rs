//! Luminaires: files of photometric data, IES LM-63 and EULUMDAT, as lights.

mod eulumdat;
mod lm63;
mod sent;
pub(super) mod stand;
mod web;

use std::path::Path;

use glam::DVec3;
use serde::Deserialize;
use serde_json::Value;

use super::ReadError;
use super::error::Notes;
use super::figure::Measure;
use super::find::find;
use super::json::{Reader, Triple};
use super::{limits, text};
use crate::photometry::LUMENS_PER_WATT;
use crate::{Light, Scene};
pub use sent::{Measured, photometry};
use web::Web;

/// What a file says of a luminaire.
#[derive(Debug)]
pub(super) struct Photometry {
    /// Intensity by direction, cd.
    pub web: Web,
    /// Luminous flux of the lamps in it, lm; `None` where only the luminaire's own is known ("absolute photometry").
    pub lamps: Option<f64>,
    /// What becomes of its lamps' flux where it is not aimed straight down: by degrees of that, ascending.
    pub tilt: Vec<[f64; 2]>,
}

/// An entry of `lights` of the type `luminaire`.
#[derive(Deserialize)]
pub(super) struct Entry {
    profile: String,
    position: Triple,
    direction: Option<Triple>,
    target: Option<Triple>,
    side: Option<Triple>,
    #[serde(default)]
    turn_deg: f64,
    lumens: Option<Value>,
    #[serde(default = "whole")]
    dimming: f64,
}

fn whole() -> f64 {
    1.0
}

impl Reader<'_> {
    /// Finds the file, reads it and hangs the lamp up.
    pub(super) fn luminaire(
        &mut self,
        place: &str,
        entry: &Entry,
        colour: Option<&Value>,
        scene: &mut Scene,
    ) -> Result<Light, ReadError> {
        let at = |field: &str| format!("{place}.{field}");
        let file = find(&[self.folder], &entry.profile)
            .ok_or_else(|| self.refuse(&at("profile"), format!("`{}` does not exist", entry.profile)))?;
        let photometry = read(&file, self.notes)?;
        self.hang(place, &file, photometry, entry, colour, scene)
    }

    /// Hangs up what was read from a file.
    fn hang(
        &mut self,
        place: &str,
        file: &Path,
        photometry: Photometry,
        entry: &Entry,
        colour: Option<&Value>,
        scene: &mut Scene,
    ) -> Result<Light, ReadError> {
        let at = |field: &str| format!("{place}.{field}");
        let Photometry { web, lamps, tilt } = photometry;
        let flux = web.flux();
        let peak = web.peak();
        demand_light(file, flux, peak)?;
        // Where it hangs.
        let direction = match (entry.direction, entry.target) {
            (Some(_), Some(_)) => return Err(self.refuse(place, "a luminaire has a direction or a target")),
            (Some(direction), None) => DVec3::from(direction),
            (None, Some(target)) => DVec3::from(target) - DVec3::from(entry.position),
            (None, None) => DVec3::NEG_Y,
        };
        let direction = self.direction(&at("direction"), direction)?.as_dvec3();
        let side = self.side(&at("side"), entry, direction)?;
        // How much of its light it sends.
        let dimming = entry.dimming;
        if !(0.0..=1.0).contains(&dimming) {
            return Err(self.refuse(&at("dimming"), format!("{dimming} is not within 0..1")));
        }
        let tilted = libm::acos(direction.dot(DVec3::NEG_Y).clamp(-1.0, 1.0)).to_degrees();
        let left = of_tilt(&tilt, tilted);
        let (peak, said) = match &entry.lumens {
            None => (peak * left, format!("{:.0} lm", flux * left)),
            Some(lumens) => {
                let lumens = self.lumens(&at("lumens"), lumens)?;
                (peak * lumens / flux, format!("{lumens:.0} lm instead of its own {:.0}", flux * left))
            }
        };
        let of_lamps = lamps.map_or(String::new(), |lamps| format!(", of {lamps:.0} lm of its lamps"));
        self.notes.file(file, format!("shines with {said}{of_lamps}, {peak:.0} cd at most"));
        let colour = self.hue(&at("colour"), colour)?;
        let intensity = (colour * (peak * dimming / f64::from(LUMENS_PER_WATT))).as_vec3();
        if !intensity.is_finite() {
            return Err(self.refuse(&at("lumens"), "is beyond what numbers can hold"));
        }
        let (solid, kept) = web.texture(&entry.profile);
        if kept > KEPT_EXACT {
            self.notes.file(file, kept_to(kept));
        }
        // Lamps of one kind share their web.
        let known = scene.textures.iter().position(|texture| **texture == solid);
        let number = known.unwrap_or(scene.textures.len());
        if known.is_none() {
            scene.textures.push(solid.into());
        }
        Ok(Light::Luminaire {
            position: self.point(&at("position"), entry.position, scene.centre)?,
            direction: direction.as_vec3(),
            side: side.as_vec3(),
            intensity,
            solid: number as u32,
        })
    }

    /// The unit direction of C = 0°, γ = 90°.
    fn side(&self, field: &str, entry: &Entry, direction: DVec3) -> Result<DVec3, ReadError> {
        let usual = if direction.x.abs() < 0.9 { DVec3::X } else { DVec3::NEG_Z };
        let wanted = entry.side.map_or(usual, DVec3::from);
        let across = wanted - direction * direction.dot(wanted);
        let side = across.try_normalize().filter(|_| across.length() > 1e-6 * wanted.length());
        let side = side.ok_or_else(|| self.refuse(field, "has no direction across the luminaire's"))?;
        if !entry.turn_deg.is_finite() {
            return Err(self.refuse(field, "turn_deg is not finite"));
        }
        let turn = entry.turn_deg.to_radians();
        Ok((side * libm::cos(turn) + side.cross(direction) * libm::sin(turn)).normalize())
    }

    fn lumens(&self, field: &str, value: &Value) -> Result<f64, ReadError> {
        let lumens = match value.as_f64() {
            Some(lumens) => lumens,
            None => {
                // As candela into one steradian.
                let one = Measure::Intensity { solid_angle: 1.0 };
                f64::from(crate::photometry::photometric(self.figure(field, value, None, one)?.rgb))
            }
        };
        if lumens > 0.0 && lumens.is_finite() { Ok(lumens) } else { Err(self.refuse(field, "must be more than 0")) }
    }
}

/// Beyond this share of the largest intensity, what is kept of a file is not what is in it.
const KEPT_EXACT: f64 = 2e-3;

/// Reads a file of photometric data.
///
/// # Errors
/// With file and line, if it is none.
pub(super) fn read(file: &Path, notes: &mut Notes) -> Result<Photometry, ReadError> {
    let bytes = limits::read_bytes(file)?;
    of_bytes(file, &bytes, Some(file.parent().unwrap_or(Path::new(""))), notes)
}

/// Reads what is in a file of photometric data. `folder`: where other files that it names are; `None`: nowhere.
fn of_bytes(file: &Path, bytes: &[u8], folder: Option<&Path>, notes: &mut Notes) -> Result<Photometry, ReadError> {
    if bytes.len() > limits::PHOTOMETRY_BYTES_MAX {
        return Err(ReadError::file(file, format!("has {} bytes; no photometric data has so many", bytes.len())));
    }
    let text = text::decode(bytes);
    match file.extension().and_then(|end| end.to_str()).map(str::to_ascii_lowercase).as_deref() {
        Some("ldt" | "eul") => eulumdat::read(file, &text, notes),
        _ => lm63::read(file, &text, folder, notes),
    }
}

/// It shines at all.
fn demand_light(file: &Path, flux: f64, peak: f64) -> Result<(), ReadError> {
    let shines = flux > 0.0 && flux.is_finite() && peak.is_finite();
    if shines { Ok(()) } else { Err(ReadError::file(file, "sends no light in any direction")) }
}

/// That a file is not kept exactly.
fn kept_to(share: f64) -> String {
    let percent = 100.0 * share;
    format!("its angles fit no even grid: intensities are kept to {percent:.1} % of the largest")
}

/// The share of its lamps' light that a luminaire sends so far from straight down; all, where nothing is said.
fn of_tilt(tilt: &[[f64; 2]], deg: f64) -> f64 {
    let after = tilt.partition_point(|[angle, _]| *angle <= deg);
    match (after.checked_sub(1).map(|before| tilt[before]), tilt.get(after).copied()) {
        (Some([a, x]), Some([b, y])) => x + (y - x) * (deg - a) / (b - a),
        (Some([_, share]), None) | (None, Some([_, share])) => share.max(0.0),
        (None, None) => 1.0,
    }
}

/// A number as such files have it: a comma for the point is one of a European's.
fn number(word: &str) -> Option<f64> {
    let plain = word.trim();
    let value: f64 = match plain.parse() {
        Ok(value) => value,
        Err(_) => plain.replacen(',', ".", 1).parse().ok()?,
    };
    value.is_finite().then_some(value)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tilt_is_interpolated_and_goes_on_as_it_ends() {
        let tilt = [[0.0, 1.0], [30.0, 0.9], [90.0, 0.3]];
        let close = |deg, share: f64| assert!((of_tilt(&tilt, deg) - share).abs() < 1e-12, "{deg}");
        close(0.0, 1.0);
        close(15.0, 0.95);
        close(60.0, 0.6);
        close(120.0, 0.3);
        assert_eq!(of_tilt(&[], 45.0), 1.0);
    }

    #[test]
    fn numbers_may_have_a_comma() {
        assert_eq!((number("12,5"), number(" -1 "), number("1e3")), (Some(12.5), Some(-1.0), Some(1000.0)));
        assert_eq!((number("nan"), number("1,2,3"), number("")), (None, None, None));
    }
}
