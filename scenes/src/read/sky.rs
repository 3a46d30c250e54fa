//! Skies by formula in a scene JSON: place, date and time become a sun with its disc, and a picture of the sky.

use std::collections::BTreeMap;

use glam::{DVec3, Vec3};
use serde::Deserialize;
use serde_json::Value;

use super::ReadError;
use super::figure::Measure;
use super::json::{Reader, Triple};
use crate::daylight::{Angles, Compass, GENERAL_SKIES, Model, Moment, SUN_DEG, Sky, TURBIDITY, sun_position};
use crate::photometry::{LUMENS_PER_WATT, luminance};
use crate::{Environment, Light, LookUp, Pixels, Rgb, Scene, Texture};

/// What stands under `environment.sky`.
#[derive(Deserialize)]
pub(super) struct Entry {
    model: String,
    #[serde(rename = "type")]
    number: Option<u64>,
    turbidity: Option<f64>,
    latitude: Option<f64>,
    longitude: Option<f64>,
    date: Option<String>,
    time: Option<String>,
    utc_offset: Option<f64>,
    sun_altitude_deg: Option<f64>,
    sun_azimuth_deg: Option<f64>,
    #[serde(default)]
    north_deg: f64,
    zenith: Option<Value>,
    illuminance: Option<Value>,
    colour: Option<Value>,
    #[serde(default)]
    sun: Sun,
    ground: Option<Ground>,
    #[serde(flatten)]
    unknown: BTreeMap<String, Value>,
}

#[derive(Deserialize)]
#[serde(untagged)]
enum Sun {
    Shines(bool),
    Given { irradiance: Value, colour: Option<Value> },
}

#[derive(Deserialize)]
#[serde(untagged)]
enum Ground {
    Grey(f64),
    Rgb(Triple),
}

impl Default for Sun {
    fn default() -> Self {
        Self::Shines(true)
    }
}

/// Texels of the picture: two thirds of a degree. [`Sky`] is smooth enough for a hundredth, but for the place where the sun
/// stands and the row at the horizon.
const WIDTH: u32 = 512;
const HEIGHT: u32 = 256;
/// Without another word, air is as clear as in Radiance's `gensky`, and the ground as dark.
const USUAL_TURBIDITY: f64 = 2.45;
const USUAL_GROUND: f64 = 0.2;
const PLACE: &str = "environment.sky";

impl Reader<'_> {
    /// Makes a sky the environment, and its sun a light.
    pub(super) fn sky(&mut self, entry: &Entry, scale: Rgb, scene: &mut Scene) -> Result<(), ReadError> {
        for field in entry.unknown.keys() {
            self.notes.at(self.path, format!("{PLACE}.{field}"), "is not a field that is known here; it is ignored");
        }
        let compass = Compass { north_deg: self.finite("north_deg", Some(entry.north_deg), 0.0)? };
        let turbidity = self.within("turbidity", entry.turbidity, TURBIDITY, USUAL_TURBIDITY)?;
        let sun = self.sun_stands(entry)?;
        let towards_sun = compass.direction(sun);
        let sky = Sky::new(self.model(entry)?, towards_sun, turbidity);
        let sky = self.as_bright_as_said(entry, sky)?;
        let tint = self.hue(&at("colour"), entry.colour.as_ref())?;
        let irradiance = self.of_sun(entry, &sky)?;
        let ground = self.ground(entry)?;
        let scale = scale.as_dvec3();
        let watts = 1.0 / f64::from(LUMENS_PER_WATT);
        // The ground reflects sky and sun alike.
        let level = tint * (sky.illuminance() * watts) + irradiance * towards_sun.y;
        let below = ground * level * scale / std::f64::consts::PI;
        let radiance = |towards: DVec3| match towards.y > 0.0 {
            true => sky.colour(towards) * tint * scale * (sky.luminance(towards) * watts),
            false => below,
        };
        let texture = picture(radiance);
        scene.environment = Environment::Image { texture: scene.textures.len() as u32, scale: Vec3::ONE, turn: 0.0 };
        scene.textures.push(texture.into());
        scene.lights_are_photometric = true;
        let irradiance = (irradiance * scale).as_vec3();
        if irradiance != Vec3::ZERO {
            let direction = -towards_sun.as_vec3();
            scene.lights.push(Light::Directional { direction, irradiance, diameter_deg: SUN_DEG });
            scene.light_names.resize(scene.lights.len() - 1, String::new());
            scene.light_names.push("sun".into());
        }
        let Angles { altitude_deg, azimuth_deg } = sun;
        let said = format!("the sun stands {altitude_deg:.1}° high, {azimuth_deg:.1}° from north by east");
        self.notes.at(self.path, PLACE, said);
        Ok(())
    }

    fn model(&self, entry: &Entry) -> Result<Model, ReadError> {
        let skies = GENERAL_SKIES.len() as u64;
        match (entry.model.to_lowercase().as_str(), entry.number) {
            ("cie", Some(number)) if (1..=skies).contains(&number) => Ok(Model::Cie { number: number as u8 }),
            ("cie", _) => Err(self.refuse(&at("type"), format!("must be 1 to {skies}, a general sky of the CIE"))),
            ("preetham", None) => Ok(Model::Preetham),
            ("preetham", Some(_)) => Err(self.refuse(&at("type"), "goes with the model `cie`")),
            (other, _) => Err(self.refuse(&at("model"), format!("`{other}` is neither `cie` nor `preetham`"))),
        }
    }

    /// By place and moment, or as is said.
    fn sun_stands(&self, entry: &Entry) -> Result<Angles, ReadError> {
        let angles = match (entry.sun_altitude_deg, entry.sun_azimuth_deg) {
            (None, None) => self.sun_at_moment(entry)?,
            (altitude, azimuth) => Angles {
                altitude_deg: self.within("sun_altitude_deg", altitude, [-90.0, 90.0], f64::NAN)?,
                azimuth_deg: self.finite("sun_azimuth_deg", azimuth, 180.0)?,
            },
        };
        if angles.altitude_deg > 0.0 {
            return Ok(angles);
        }
        let below = -angles.altitude_deg;
        Err(self
            .refuse(PLACE, format!("the sun is {below:.1}° below the horizon then; skies by formula end at sunset")))
    }

    fn sun_at_moment(&self, entry: &Entry) -> Result<Angles, ReadError> {
        let latitude = self.within("latitude", entry.latitude, [-90.0, 90.0], f64::NAN)?;
        let longitude = self.within("longitude", entry.longitude, [-180.0, 180.0], f64::NAN)?;
        let ahead = self.within("utc_offset", entry.utc_offset, [-14.0, 14.0], (longitude / 15.0).round())?;
        let date =
            entry.date.as_deref().and_then(numbers::<3>).filter(|date| date.iter().all(|part| part.fract() == 0.0));
        let date = date.ok_or_else(|| self.refuse(&at("date"), "must be a date such as \"2026-06-21\""))?;
        let clock = entry.time.as_deref().and_then(hours);
        let clock = clock.ok_or_else(|| self.refuse(&at("time"), "must be a time such as \"14:30\""))?;
        let moment = Moment::new(date.map(|part| part as i64), clock, ahead);
        let moment = moment.ok_or_else(|| self.refuse(&at("date"), "is no date of the years 1900 to 2100"))?;
        Ok(sun_position(moment, latitude, longitude))
    }

    fn as_bright_as_said(&self, entry: &Entry, sky: Sky) -> Result<Sky, ReadError> {
        let lumens = |field: &str, value: &Value, measure: Measure| -> Result<f64, ReadError> {
            let figure = self.figure(&at(field), value, None, measure)?.rgb.as_dvec3();
            Ok(luminance(figure) * f64::from(LUMENS_PER_WATT))
        };
        match (&entry.zenith, &entry.illuminance) {
            (None, None) => Ok(sky),
            (Some(zenith), None) => Ok(sky.with_zenith(lumens("zenith", zenith, Measure::Radiance)?)),
            (None, Some(level)) => {
                Ok(sky.scaled(lumens("illuminance", level, Measure::Irradiance)? / sky.illuminance()))
            }
            _ => Err(self.refuse(&at("illuminance"), "says the same as zenith; give one of them")),
        }
    }

    /// Irradiance of a surface that faces the sun, by the sun alone, W·m⁻².
    fn of_sun(&self, entry: &Entry, sky: &Sky) -> Result<DVec3, ReadError> {
        match &entry.sun {
            Sun::Shines(false) => Ok(DVec3::ZERO),
            Sun::Shines(true) => Ok(sky.sun_colour() * (sky.sun_illuminance() / f64::from(LUMENS_PER_WATT))),
            Sun::Given { irradiance, colour } => {
                let field = at("sun.irradiance");
                Ok(self.figure(&field, irradiance, colour.as_ref(), Measure::Irradiance)?.rgb.as_dvec3())
            }
        }
    }

    fn ground(&self, entry: &Entry) -> Result<DVec3, ReadError> {
        let ground = match entry.ground {
            None => DVec3::splat(USUAL_GROUND),
            Some(Ground::Grey(grey)) => DVec3::splat(grey),
            Some(Ground::Rgb(rgb)) => DVec3::from(rgb),
        };
        let is_one = ground.to_array().iter().all(|part| (0.0..=1.0).contains(part));
        if is_one { Ok(ground) } else { Err(self.refuse(&at("ground"), "is a reflectance: within 0..1")) }
    }

    fn finite(&self, field: &str, value: Option<f64>, otherwise: f64) -> Result<f64, ReadError> {
        self.within(field, value, [-1e6, 1e6], otherwise)
    }

    /// A number within bounds, or what else it is; that it is missing, if that is no number.
    fn within(&self, field: &str, value: Option<f64>, [low, high]: [f64; 2], otherwise: f64) -> Result<f64, ReadError> {
        match value {
            None if otherwise.is_finite() => Ok(otherwise),
            None => Err(self.refuse(&at(field), "is missing")),
            Some(value) if (low..=high).contains(&value) => Ok(value),
            Some(value) => Err(self.refuse(&at(field), format!("{value} is not within {low}..{high}"))),
        }
    }
}

fn at(field: &str) -> String {
    format!("{PLACE}.{field}")
}

/// The numbers of a date.
fn numbers<const N: usize>(typed: &str) -> Option<[f64; N]> {
    let parts: Vec<f64> = typed.split('-').map(|part| part.trim().parse().ok()).collect::<Option<_>>()?;
    parts.try_into().ok()
}

/// Hours of a time of day.
fn hours(typed: &str) -> Option<f64> {
    let mut hours = 0.0;
    let parts: Vec<&str> = typed.split(':').collect();
    let limits = [24.0, 60.0, 60.0];
    if !(2..=limits.len()).contains(&parts.len()) {
        return None;
    }
    for (part, (limit, unit)) in parts.iter().zip(limits.into_iter().zip([1.0, 60.0, 3600.0])) {
        let value: f64 = part.trim().parse().ok()?;
        if !(0.0..limit).contains(&value) {
            return None;
        }
        hours += value / unit;
    }
    Some(hours)
}

/// A latitude-longitude picture of what comes from each direction.
fn picture(radiance: impl Fn(DVec3) -> DVec3) -> Texture {
    let mut texels = Vec::with_capacity((WIDTH * HEIGHT) as usize);
    for row in 0..HEIGHT {
        let latitude = std::f64::consts::PI * (0.5 - (f64::from(row) + 0.5) / f64::from(HEIGHT));
        let (up, level) = (libm::sin(latitude), libm::cos(latitude));
        for column in 0..WIDTH {
            let turn = std::f64::consts::TAU * ((f64::from(column) + 0.5) / f64::from(WIDTH) - 0.5);
            let towards = DVec3::new(level * libm::sin(turn), up, -level * libm::cos(turn));
            texels.push(radiance(towards).as_vec3().to_array());
        }
    }
    Texture { name: "sky".into(), width: WIDTH, height: HEIGHT, pixels: Pixels::Float(texels), look_up: LookUp::REPEAT }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What is between texels, bilinear, is what the formula says there.
    #[test]
    fn the_picture_is_as_good_as_the_formula() {
        let compass = Compass { north_deg: 20.0 };
        let towards_sun = compass.direction(Angles { altitude_deg: 35.0, azimuth_deg: 200.0 });
        let models = [1, 12, 15].map(|number| Model::Cie { number }).into_iter().chain([Model::Preetham]);
        for sky in models.map(|model| Sky::new(model, towards_sun, 3.0)) {
            let baked =
                picture(
                    |towards| if towards.y > 0.0 { sky.colour(towards) * sky.luminance(towards) } else { DVec3::ZERO },
                );
            let Pixels::Float(texels) = &baked.pixels else { panic!("it is radiance") };
            let texel = |row: f64, column: f64| {
                let at = row as usize * WIDTH as usize + column.rem_euclid(f64::from(WIDTH)) as usize;
                f64::from(texels[at][1])
            };
            let mut worst = 0.0_f64;
            // In the middle between four texels, where interpolation is worst.
            for row in 1..HEIGHT / 2 {
                for column in 0..WIDTH {
                    let latitude = std::f64::consts::PI * (0.5 - f64::from(row) / f64::from(HEIGHT));
                    let turn = std::f64::consts::TAU * (f64::from(column) / f64::from(WIDTH) - 0.5);
                    let level = latitude.cos();
                    let towards = DVec3::new(level * turn.sin(), latitude.sin(), -level * turn.cos());
                    if towards.dot(towards_sun) > 2_f64.to_radians().cos() {
                        continue;
                    }
                    let (y, x) = (f64::from(row), f64::from(column));
                    let mean = (texel(y - 1.0, x - 1.0) + texel(y - 1.0, x) + texel(y, x - 1.0) + texel(y, x)) / 4.0;
                    let expected = sky.colour(towards).y * sky.luminance(towards);
                    worst = worst.max((mean / expected - 1.0).abs());
                }
            }
            assert!(worst < 0.01, "{sky:?}: {worst}");
        }
    }

    #[test]
    fn times_and_dates_are_read() {
        assert_eq!((hours("14:30"), hours("06:00:36")), (Some(14.5), Some(6.01)));
        for none in ["24:00", "12", "12:60", "noon", "-1:00", "12:00:00:00"] {
            assert_eq!(hours(none), None, "{none}");
        }
        assert_eq!(numbers::<3>("2026-06-21"), Some([2026.0, 6.0, 21.0]));
    }
}
