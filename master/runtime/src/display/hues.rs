//! What gave light before it was turned off: it is to come back as it was, in colour and power.

use std::collections::BTreeMap;

use glam::Vec3;
use scenes::change::LIGHTS_MAX;
use scenes::{Change, Environment, Light, Material, Scene, Shiner};
use serde::de::Error;
use serde::{Deserialize, Deserializer, Serialize};

/// For each light and glowing material that is off now, its power before ([`Light::power`], or the emission's factor).
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Hues {
    /// By their numbers in the scene.
    #[serde(default, deserialize_with = "numbered")]
    pub lights: BTreeMap<u32, Vec3>,
    /// By their numbers in the scene.
    #[serde(default, deserialize_with = "numbered")]
    pub materials: BTreeMap<u32, Vec3>,
    /// Of materials that things have of their own, by the thing: `OBJECT/PIECE/MATERIAL`, as [`Change::OwnMaterial`] has them,
    /// with `all` for no piece.
    #[serde(default)]
    pub own: BTreeMap<String, Vec3>,
    /// Of the environment.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sky: Option<Vec3>,
}

impl Hues {
    /// A scene is about to be changed, after changes that wait to be made.
    pub fn learn(&mut self, scene: &Scene, waiting: &[Change], change: &Change) {
        let before = waiting.iter().rev().find(|earlier| change.supersedes(earlier));
        match (change, before) {
            (Change::Light { light, value }, Some(Change::Light { value: was, .. })) => {
                self.learn_light(*light, was, value);
            }
            (Change::Light { light, value }, _) => {
                if let Some(was) = scene.lights.get(*light as usize) {
                    self.learn_light(*light, was, value);
                }
            }
            (Change::Material { material, value }, Some(Change::Material { value: was, .. })) => {
                self.learn_material(*material, was, value);
            }
            (Change::Material { material, value }, _) => {
                if let Some(was) = scene.materials.get(*material as usize) {
                    self.learn_material(*material, was, value);
                }
            }
            (Change::OwnMaterial { object, piece, material, value: Some(is) }, before) => {
                let own = |piece| scene.own_material(*object, piece, *material);
                let was = match before {
                    Some(Change::OwnMaterial { value: Some(value), .. }) => Some(value),
                    _ => own(*piece).or_else(|| own(None)).or_else(|| scene.materials.get(*material as usize)),
                };
                if let Some(was) = was {
                    self.learn_own(own_key(*object, *piece, *material), was, is);
                }
            }
            (Change::OwnMaterial { object, piece, material, value: None }, _) => {
                self.own.remove(&own_key(*object, *piece, *material));
            }
            (Change::Lamp { light, value: Some(is) }, before) => {
                let was = match before {
                    Some(Change::Light { value, .. }) => Some(value),
                    Some(Change::Lamp { value, .. }) => value.as_ref().map(|lamp| &lamp.light),
                    _ => scene.lights.get(*light as usize),
                };
                if let Some(was) = was {
                    self.learn_light(*light, was, &is.light);
                }
            }
            (Change::Lamp { light, value: None }, _) => {
                self.lights.remove(light);
            }
            (Change::Environment(is), before) => {
                let was = if let Some(Change::Environment(was)) = before { was } else { &scene.environment };
                match (power(was), power(is)) {
                    (_, is) if is != Vec3::ZERO => self.sky = None,
                    (was, _) if was != Vec3::ZERO => self.sky = Some(was),
                    _ => {}
                }
            }
            _ => {}
        }
    }

    /// What something that is off gave before.
    pub fn of(&self, shiner: Shiner) -> Option<Vec3> {
        match shiner {
            Shiner::Light(number) => self.lights.get(&number).copied(),
            Shiner::Material(number) => self.materials.get(&number).copied(),
            Shiner::Own { object, piece, material } => self.own.get(&own_key(object, piece, material)).copied(),
            Shiner::Sky => self.sky,
        }
    }

    /// A light becomes another.
    pub fn learn_light(&mut self, light: u32, was: &Light, is: &Light) {
        learn(&mut self.lights, light, was.power(), is.power());
    }

    /// A material becomes another.
    pub fn learn_material(&mut self, material: u32, was: &Material, is: &Material) {
        learn(&mut self.materials, material, was.emission.value, is.emission.value);
    }

    /// What a thing has of its own becomes another; `key` as [`own_key`] makes it.
    pub fn learn_own(&mut self, key: String, was: &Material, is: &Material) {
        if self.own.len() < OWN_MAX || self.own.contains_key(&key) {
            learn(&mut self.own, key, was.emission.value, is.emission.value);
        }
    }

    /// All are of things that the scene has, and can be turned on again.
    pub fn is_sound(&self, scene: &Scene) -> bool {
        let fit = |hues: &BTreeMap<u32, Vec3>, count: usize| {
            hues.iter().all(|(number, hue)| (*number as usize) < count && is_hue(*hue))
        };
        // Lamps may have been added.
        let lights = scene.lights.len().max(LIGHTS_MAX as usize);
        let own = self.own.len() <= OWN_MAX && self.own.values().all(|hue| is_hue(*hue));
        let materials = scene.shared_materials();
        own && fit(&self.lights, lights) && fit(&self.materials, materials) && self.sky.is_none_or(is_hue)
    }
}

/// The key of [`Hues::own`].
pub fn own_key(object: u32, piece: Option<u32>, material: u32) -> String {
    let piece = piece.map_or("all".into(), |piece| piece.to_string());
    format!("{object}/{piece}/{material}")
}

/// So many colours of things' own materials are kept.
const OWN_MAX: usize = 4096;

fn learn<K: Ord>(hues: &mut BTreeMap<K, Vec3>, key: K, was: Vec3, is: Vec3) {
    if is.max_element() > 0.0 {
        hues.remove(&key);
    } else if was.max_element() > 0.0 {
        hues.insert(key, was);
    }
}

/// JSON's keys are text. serde_json reads numbers from them, but not within an enum that is told apart by a tag.
fn numbered<'de, D: Deserializer<'de>>(deserializer: D) -> Result<BTreeMap<u32, Vec3>, D::Error> {
    let hues = BTreeMap::<String, Vec3>::deserialize(deserializer)?;
    hues.into_iter().map(|(number, hue)| Ok((number.parse().map_err(D::Error::custom)?, hue))).collect()
}

/// What an environment gives, or the factor of its image.
fn power(environment: &Environment) -> Vec3 {
    match environment {
        Environment::Black => Vec3::ZERO,
        Environment::Constant(radiance) => *radiance,
        Environment::Image { scale, .. } => *scale,
    }
}

fn is_hue(hue: Vec3) -> bool {
    hue.is_finite() && hue.min_element() >= 0.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_off_keeps_its_power_until_it_is_on() {
        let lamp = |intensity: Vec3| Light::Point { position: Vec3::ZERO, intensity };
        let sun = |irradiance: Vec3| Light::Directional { direction: Vec3::Y, irradiance, diameter_deg: 0.0 };
        let glow =
            |value: Vec3| Material { emission: scenes::Colour::plain(value), ..Material::diffuse("m", Vec3::ONE) };
        let red = Vec3::new(8.0, 4.0, 2.0);
        let scene = Scene { lights: vec![lamp(red), sun(red)], materials: vec![glow(red)], ..Scene::default() };
        let mut hues = Hues::default();
        let off = [
            Change::Light { light: 0, value: lamp(Vec3::ZERO) },
            Change::Light { light: 1, value: sun(Vec3::ZERO) },
            Change::Material { material: 0, value: glow(Vec3::ZERO) },
        ];
        off.iter().for_each(|change| hues.learn(&scene, &[], change));
        assert_eq!((hues.lights[&0], hues.lights[&1], hues.materials[&0]), (red, red, red));
        // Off once more, while the first waits: nothing new. On: nothing to keep.
        hues.learn(&scene, &off, &off[0]);
        assert_eq!(hues.lights[&0], red);
        hues.learn(&scene, &off, &Change::Light { light: 0, value: lamp(Vec3::ONE) });
        assert_eq!(hues.lights.keys().collect::<Vec<_>>(), [&1]);
        assert!(hues.is_sound(&scene) && !hues.is_sound(&Scene::default()));
        let sky =
            [Change::Environment(Environment::Constant(red)), Change::Environment(Environment::Constant(Vec3::ZERO))];
        hues.learn(&scene, &[], &sky[0]);
        hues.learn(&scene, &sky[..1], &sky[1]);
        assert_eq!(hues.sky, Some(red));
        hues.learn(&scene, &sky[1..], &sky[0]);
        assert_eq!(hues.sky, None);
        hues.lights.insert(0, Vec3::new(f32::NAN, 0.0, 2.0));
        assert!(!hues.is_sound(&scene));
    }
}
