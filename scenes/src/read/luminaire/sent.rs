//! A file of photometric data that somebody sends: bytes and a name, and nothing of the file system is looked at.

use std::path::Path;

use glam::Vec3;

use super::{KEPT_EXACT, Photometry, of_tilt};
use crate::read::error::Notes;
use crate::read::{Note, ReadError};
use crate::solid::{NAME_MAX, Solid};

/// What it says of the luminaire.
#[derive(Clone, Debug)]
pub struct Measured {
    /// Intensity by direction.
    pub solid: Solid,
    /// The largest intensity, cd.
    pub peak: f64,
    /// Luminous flux, lm.
    pub flux: f64,
    /// Of the lamps in it, lm; `None` where only the luminaire's own is known.
    pub lamps: Option<f64>,
    /// What was repaired or left out.
    pub notes: Vec<Note>,
    tilt: Vec<[f64; 2]>,
}

impl Measured {
    /// The share of its light that it sends where it is aimed so (unit vector, +y up): lamps that burn otherwise when they
    /// are tilted say so in their file.
    pub fn share(&self, direction: Vec3) -> f64 {
        let from_below = f64::from(direction.dot(Vec3::NEG_Y).clamp(-1.0, 1.0));
        of_tilt(&self.tilt, libm::acos(from_below).to_degrees())
    }
}

/// Reads IES LM-63 or EULUMDAT, by the ending of its name.
///
/// # Errors
/// With file and line, if it is none.
pub fn photometry(name: &str, bytes: &[u8]) -> Result<Measured, ReadError> {
    let file = Path::new(Path::new(name).file_name().unwrap_or(name.as_ref()));
    let name = file.to_string_lossy().into_owned();
    if name.is_empty() || name.len() > NAME_MAX || name.chars().any(char::is_control) {
        return Err(ReadError::file(Path::new("the file"), "has a name that is too long, or cannot be shown"));
    }
    let mut notes = Notes::default();
    let Photometry { web, lamps, tilt } = super::of_bytes(file, bytes, None, &mut notes)?;
    let (flux, peak) = (web.flux(), web.peak());
    super::demand_light(file, flux, peak)?;
    let (texture, kept) = web.texture(&name);
    if kept > KEPT_EXACT {
        notes.file(file, super::kept_to(kept));
    }
    let solid = Solid::of(&texture).ok_or_else(|| ReadError::file(file, "sends no light"))?;
    solid.check().map_err(|what| ReadError::file(file, what))?;
    Ok(Measured { solid, peak, flux, lamps, notes: notes.into_list(), tilt })
}
