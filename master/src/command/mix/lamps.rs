//! What people call a lamp: all lights of a name, all surfaces of a material that shines, the sky.

use glam::Vec3;
use scenes::{Environment, Light, Scene};

/// A lamp, and what of the scene it is.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Lamp {
    /// As in the file, or made up; no two lamps share one.
    pub(super) name: String,
    sources: Vec<Source>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Source {
    Light(usize),
    Material(usize),
    Environment,
}

/// All lamps of a scene in order: lights, materials that shine, the sky.
pub(super) fn lamps(scene: &Scene) -> Vec<Lamp> {
    let mut lamps: Vec<Lamp> = Vec::new();
    let mut add = |name: String, source: Source| match lamps.iter_mut().find(|lamp| lamp.name == name) {
        Some(lamp) => lamp.sources.push(source),
        None => lamps.push(Lamp { name, sources: vec![source] }),
    };
    for number in (0..scene.lights.len()).filter(|number| !scene.lights[*number].is_absent()) {
        let name = scene.light_names.get(number).filter(|name| !name.is_empty());
        add(name.cloned().unwrap_or_else(|| format!("lamp {}", number + 1)), Source::Light(number));
    }
    for (number, material) in scene.materials.iter().enumerate().filter(|(_, material)| !material.emission.is_black()) {
        let name = if material.name.is_empty() { format!("material {}", number + 1) } else { material.name.clone() };
        add(name, Source::Material(number));
    }
    if scene.environment != Environment::Black {
        add("sky".into(), Source::Environment);
    }
    lamps
}

/// The scene with all lamps off but one.
pub(super) fn lit_by(scene: &Scene, lamp: &Lamp) -> Scene {
    let mut alone = scene.clone();
    let is_on = |source: Source| lamp.sources.contains(&source);
    for (number, light) in alone.lights.iter_mut().enumerate() {
        if !is_on(Source::Light(number)) {
            put_out(light);
        }
    }
    for (number, material) in alone.materials.iter_mut().enumerate() {
        if !is_on(Source::Material(number)) {
            material.emission.value = Vec3::ZERO;
        }
    }
    if !is_on(Source::Environment) {
        alone.environment = Environment::Black;
    }
    alone
}

fn put_out(light: &mut Light) {
    match light {
        Light::Point { intensity, .. } | Light::Spot { intensity, .. } | Light::Luminaire { intensity, .. } => {
            *intensity = Vec3::ZERO;
        }
        Light::Directional { irradiance, .. } => *irradiance = Vec3::ZERO,
    }
}

#[cfg(test)]
mod tests {
    use scenes::{Colour, Material};

    use super::*;

    #[test]
    fn every_source_belongs_to_one_lamp_and_alone_it_is_the_only_one_that_shines() {
        let shining =
            |name: &str| Material { emission: Colour::plain(Vec3::ONE), ..Material::diffuse(name, Vec3::ONE) };
        let point = Light::Point { position: Vec3::X, intensity: Vec3::ONE };
        let scene = Scene {
            lights: vec![point.clone(), point.clone(), point],
            light_names: vec!["candle".into(), String::new(), "candle".into()],
            materials: vec![Material::diffuse("wall", Vec3::ONE), shining("panel")],
            environment: Environment::Constant(Vec3::ONE),
            ..Scene::default()
        };
        let lamps = lamps(&scene);
        assert_eq!(
            lamps.iter().map(|lamp| lamp.name.as_str()).collect::<Vec<_>>(),
            ["candle", "lamp 2", "panel", "sky"]
        );
        let sources = |scene: &Scene| {
            let lights = scene
                .lights
                .iter()
                .filter(|light| !matches!(light, Light::Point { intensity, .. } if *intensity == Vec3::ZERO));
            let materials = scene.materials.iter().filter(|material| !material.emission.is_black());
            lights.count() + materials.count() + usize::from(scene.environment != Environment::Black)
        };
        let counts: Vec<_> = lamps.iter().map(|lamp| sources(&lit_by(&scene, lamp))).collect();
        assert_eq!(counts, [2, 1, 1, 1]);
        assert_eq!(counts.iter().sum::<usize>(), sources(&scene));
    }
}
