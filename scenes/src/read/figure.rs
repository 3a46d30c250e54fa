//! Figures with their units, as they are typed into a scene JSON: `"400 cd"`, `"1500 lm"`, `"3000 cd/m2"`; and the colours in
//! which they shine: `"2700 K"`, `{ "xy": [0.46, 0.41] }`, three numbers.
//!
//! Three plain numbers are watts in three channels, as everywhere in a scene.

use glam::DVec3;
use serde_json::Value;

use super::ReadError;
use super::json::Reader;
use crate::Rgb;
use crate::photometry::{self, LUMENS_PER_WATT};

/// What a field measures, and so which units it may have.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Measure {
    /// W·sr⁻¹, or candela; or lumen, of a light that sends its intensity into so great a solid angle, sr.
    Intensity { solid_angle: f64 },
    /// W·m⁻², or lux.
    Irradiance,
    /// W·m⁻²·sr⁻¹, or candela per square metre.
    Radiance,
}

/// What a field says.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Figure {
    /// In the scene's unit.
    pub rgb: Rgb,
    /// It was given in a unit of photometry.
    pub is_photometric: bool,
}

impl Reader<'_> {
    /// The colour that a field says, of luminance 1; white where there is none.
    pub(super) fn hue(&self, field: &str, colour: Option<&Value>) -> Result<DVec3, ReadError> {
        colour.map_or(Ok(DVec3::ONE), |colour| hue(colour).map_err(|why| self.refuse(field, why)))
    }

    /// Reads a figure: three numbers; a figure with its unit; or both this and its colour, as `{ "value": …, "colour": … }`.
    /// `colour` is what stands beside it.
    pub(super) fn figure(
        &self,
        field: &str,
        value: &Value,
        colour: Option<&Value>,
        measure: Measure,
    ) -> Result<Figure, ReadError> {
        let (value, colour) = match value {
            Value::Object(parts) if parts.contains_key("value") => (&parts["value"], parts.get("colour").or(colour)),
            _ => (value, colour),
        };
        match (value, colour) {
            (Value::String(typed), colour) => {
                let colour = self.hue(&beside(field), colour)?;
                let (watts, is_photometric) = watts(typed, measure).map_err(|why| self.refuse(field, why))?;
                let rgb = (colour * watts).as_vec3();
                let is_good = rgb.is_finite() && (rgb.max_element() > 0.0 || watts == 0.0);
                if !is_good {
                    return Err(self.refuse(field, format!("`{typed}` is beyond what numbers can hold")));
                }
                Ok(Figure { rgb, is_photometric })
            }
            (_, Some(_)) => {
                let why = "goes with a figure and its unit; three numbers say themselves what colour they are";
                Err(self.refuse(&beside(field), why))
            }
            (numbers, None) => match triple(numbers) {
                Some(numbers) => Ok(Figure { rgb: self.power(field, numbers)?, is_photometric: false }),
                None => {
                    let example = measure.units()[0].0;
                    let what = format!("must be three numbers, or a figure with its unit, such as \"400 {example}\"");
                    Err(self.refuse(field, what))
                }
            },
        }
    }
}

/// The field of the colour of a figure's.
fn beside(field: &str) -> String {
    let lamp = field.rsplit_once('.').map_or(field, |(lamp, _)| lamp);
    format!("{lamp}.colour")
}

/// Prefixes of units.
const THOUSANDS: [(&str, f64); 3] = [("k", 1e3), ("m", 1e-3), ("M", 1e6)];

impl Measure {
    /// Its units, and how many watts of white one is; `None`: it is in watts already.
    fn units(self) -> Vec<(&'static str, Option<f64>)> {
        let lumen = 1.0 / f64::from(LUMENS_PER_WATT);
        match self {
            Self::Intensity { solid_angle } => {
                vec![("cd", Some(lumen)), ("lm", Some(lumen / solid_angle)), ("W/sr", None)]
            }
            Self::Irradiance => vec![("lx", Some(lumen)), ("lux", Some(lumen)), ("lm/m2", Some(lumen)), ("W/m2", None)],
            Self::Radiance => {
                vec![("cd/m2", Some(lumen)), ("nt", Some(lumen)), ("W/m2/sr", None), ("W/sr/m2", None)]
            }
        }
    }
}

/// Watts of white that a typed figure is, and whether its unit is one of photometry.
fn watts(typed: &str, measure: Measure) -> Result<(f64, bool), String> {
    let (number, unit) = split(typed).ok_or_else(|| format!("`{typed}` is no number with a unit"))?;
    if !(number.is_finite() && number >= 0.0) {
        return Err(format!("`{typed}` is negative or not finite"));
    }
    let units = measure.units();
    let of = |name: &str| units.iter().find(|(known, _)| *known == name).map(|(_, lumens)| *lumens);
    let thousands = THOUSANDS.iter().find_map(|(prefix, factor)| Some((of(unit.strip_prefix(prefix)?)?, *factor)));
    let Some((lumens, factor)) = of(&unit).map(|lumens| (lumens, 1.0)).or(thousands) else {
        let known: Vec<_> = units.iter().map(|(name, _)| *name).collect();
        return Err(format!("`{typed}` has another unit than {}", known.join(", ")));
    };
    Ok((number * factor * lumens.unwrap_or(1.0), lumens.is_some()))
}

/// Number and unit, the latter without blanks and with plain figures and dots: `cd·m⁻²` and `cd/m²` are `cd/m2`.
fn split(typed: &str) -> Option<(f64, String)> {
    let typed = typed.trim();
    let is_of_number = |(at, letter): (usize, char)| {
        // The e of an exponent is followed by a digit or a sign.
        let next = typed[at + letter.len_utf8()..].chars().next();
        letter.is_ascii_digit()
            || "+-.".contains(letter)
            || ("eE".contains(letter) && next.is_some_and(|next| next.is_ascii_digit() || "+-".contains(next)))
    };
    let end = typed.char_indices().find(|place| !is_of_number(*place)).map_or(typed.len(), |(at, _)| at);
    let number = typed[..end].parse().ok()?;
    let unit = typed[end..].replace(char::is_whitespace, "").replace('²', "2").replace('^', "");
    Some((number, unit.replace("·m⁻2", "/m2").replace("·sr⁻¹", "/sr")))
}

/// The colour that something says, of luminance 1: what a meter reads is the figure, whatever the colour.
fn hue(value: &Value) -> Result<DVec3, String> {
    if let Some(typed) = value.as_str() {
        return match split(typed) {
            Some((kelvin, unit)) if unit == "K" => {
                let xy = photometry::planck(kelvin).ok_or_else(|| {
                    let [low, high] = photometry::KELVIN;
                    format!("`{typed}` is not within {low}..{high} K")
                })?;
                photometry::of_chromaticity(xy).ok_or_else(|| "is no colour".to_owned())
            }
            _ => Err(format!("`{typed}` is no number of kelvin, such as \"2700 K\"")),
        };
    }
    if let Some(xy) = value.get("xy") {
        let pair: Option<[f64; 2]> = serde_json::from_value(xy.clone()).ok();
        return pair.and_then(photometry::of_chromaticity).ok_or_else(|| format!("xy: {xy} is no chromaticity"));
    }
    let numbers = triple(value).filter(|rgb| rgb.iter().all(|part| part.is_finite() && *part >= 0.0));
    let luminance = numbers.map_or(0.0, |rgb| photometry::luminance(DVec3::from(rgb)));
    match numbers {
        Some(rgb) if luminance > 0.0 && luminance.is_finite() => Ok(DVec3::from(rgb) / luminance),
        _ => Err("must be kelvin, such as \"2700 K\", {\"xy\": [x, y]}, or three numbers, none negative".to_owned()),
    }
}

fn triple(value: &Value) -> Option<[f64; 3]> {
    let [r, g, b] = value.as_array()?.as_slice() else { return None };
    Some([r.as_f64()?, g.as_f64()?, b.as_f64()?])
}
