//! What shines, one by one, and how strongly: what is dimmed and coloured while all else stays as it is.

use serde::{Deserialize, Serialize};

use crate::{Change, Environment, Light, Rgb, Scene};

/// Something whose power can be changed by itself. Ordered as they are listed here.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub enum Shiner {
    /// A light without surface: index into [`Scene::lights`].
    Light(u32),
    /// All surfaces of a material of the file: index into [`Scene::materials`].
    Material(u32),
    /// What an object or a piece has of its own: as in [`Change::OwnMaterial`].
    Own {
        /// As there.
        object: u32,
        /// As there.
        piece: Option<u32>,
        /// As there.
        material: u32,
    },
    /// What shines from beyond all objects.
    Sky,
}

impl Scene {
    /// All that shines or may be made to by a power: lights, materials, what things have of their own, and the sky, if there is
    /// one; ascending.
    pub fn shiners(&self) -> Vec<Shiner> {
        let lights = (0..).zip(&self.lights).filter(|(_, light)| !light.is_absent());
        let lights = lights.map(|(number, _)| Shiner::Light(number));
        let materials = (0..self.shared_materials() as u32).map(Shiner::Material);
        let mut own: Vec<Shiner> = Vec::new();
        for (number, object) in (0..).zip(&self.objects) {
            let (whole, piece) = object.lifted.as_ref().map_or((number, None), |it| (it.of, Some(it.piece)));
            own.extend(object.own.iter().map(|own| Shiner::Own { object: whole, piece, material: own.instead_of }));
        }
        own.sort_unstable();
        let sky = (self.environment != Environment::Black).then_some(Shiner::Sky);
        lights.chain(materials).chain(own).chain(sky).collect()
    }

    /// What it gives: W·sr⁻¹, or W·m⁻² of suns, W·m⁻²·sr⁻¹ of surfaces and skies, or the factor of a texture; `None` if there is
    /// no such thing.
    pub fn power(&self, of: Shiner) -> Option<Rgb> {
        match of {
            Shiner::Light(number) => {
                self.lights.get(number as usize).filter(|light| !light.is_absent()).map(Light::power)
            }
            Shiner::Material(number) => {
                let file = self.materials.get(..self.shared_materials())?;
                file.get(number as usize).map(|material| material.emission.value)
            }
            Shiner::Own { object, piece, material } => {
                self.own_material(object, piece, material).map(|material| material.emission.value)
            }
            Shiner::Sky => match self.environment {
                Environment::Black => None,
                Environment::Constant(radiance) => Some(radiance),
                Environment::Image { scale, .. } => Some(scale),
            },
        }
    }

    /// The change that gives it another power, and leaves all else as it is; `None` if there is no such thing.
    pub fn powered(&self, of: Shiner, power: Rgb) -> Option<Change> {
        self.power(of)?;
        Some(match of {
            Shiner::Light(light) => {
                let mut value = self.lights[light as usize].clone();
                match &mut value {
                    Light::Point { intensity, .. }
                    | Light::Spot { intensity, .. }
                    | Light::Luminaire { intensity, .. } => {
                        *intensity = power;
                    }
                    Light::Directional { irradiance, .. } => *irradiance = power,
                }
                Change::Light { light, value }
            }
            Shiner::Material(material) => {
                let mut value = self.materials[material as usize].clone();
                value.emission.value = power;
                Change::Material { material, value }
            }
            Shiner::Own { object, piece, material } => {
                let mut value = self.own_material(object, piece, material)?.clone();
                value.emission.value = power;
                Change::OwnMaterial { object, piece, material, value: Some(value) }
            }
            Shiner::Sky => Change::Environment(match self.environment {
                Environment::Image { texture, turn, .. } => Environment::Image { texture, scale: power, turn },
                Environment::Black | Environment::Constant(_) => Environment::Constant(power),
            }),
        })
    }

    /// What a change gives another power, and which, if it leaves all else as it is.
    pub fn is_of_power(&self, change: &Change) -> Option<(Shiner, Rgb)> {
        let (of, power) = match change {
            Change::Light { light, value } => (Shiner::Light(*light), value.power()),
            // A lamp that was added is spoken of as a whole.
            Change::Lamp { light, value: Some(lamp) } => {
                let now = self.lamp(*light)?;
                let (of, power) = (Shiner::Light(*light), lamp.light.power());
                let same = Change::Light { light: *light, value: lamp.light.clone() };
                return (now.name == lamp.name && self.powered(of, power)? == same).then_some((of, power));
            }
            Change::Material { material, value } => (Shiner::Material(*material), value.emission.value),
            Change::OwnMaterial { object, piece, material, value: Some(value) } => {
                (Shiner::Own { object: *object, piece: *piece, material: *material }, value.emission.value)
            }
            Change::Environment(Environment::Constant(power) | Environment::Image { scale: power, .. }) => {
                (Shiner::Sky, *power)
            }
            _ => return None,
        };
        (self.powered(of, power)? == *change).then_some((of, power))
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;
    use crate::change::Lamp;
    use crate::{Material, Mesh, Object};

    #[test]
    fn each_thing_that_shines_is_powered_by_itself_and_nothing_else_counts_as_that() {
        let positions = vec![Vec3::ZERO, Vec3::X, Vec3::Y];
        let mesh = Mesh { positions, triangles: vec![[0, 1, 2]], materials: vec![1], ..Mesh::default() };
        let mut scene = Scene {
            meshes: vec![mesh.into()],
            objects: vec![Object::fixed("o", 0)],
            materials: vec![Material::diffuse("a", Vec3::ONE), Material::diffuse("b", Vec3::ONE)],
            lights: vec![Light::ABSENT, Light::Point { position: Vec3::X, intensity: Vec3::ONE }],
            environment: Environment::Constant(Vec3::ONE),
            ..Scene::default()
        };
        let value = Some(Material::diffuse("red", Vec3::X));
        Change::OwnMaterial { object: 0, piece: None, material: 1, value }.apply(&mut scene).unwrap();
        let own = Shiner::Own { object: 0, piece: None, material: 1 };
        let all = [Shiner::Light(1), Shiner::Material(0), Shiner::Material(1), own, Shiner::Sky];
        assert_eq!(scene.shiners(), all);
        for of in all {
            let (power, mut now) = (Vec3::new(0.5, 2.0, 0.0), scene.clone());
            let change = scene.powered(of, power).unwrap();
            assert_eq!(scene.is_of_power(&change), Some((of, power)));
            change.apply(&mut now).unwrap();
            assert_eq!((now.power(of), now.check()), (Some(power), Ok(())));
            let others = all.iter().filter(|other| **other != of);
            assert!(others.into_iter().all(|other| now.power(*other) == scene.power(*other)));
        }
        let moved = Light::Point { position: Vec3::Y, intensity: Vec3::ONE };
        let lamp = |light: Light| Change::Lamp { light: 1, value: Some(Lamp { name: String::new(), light }) };
        assert_eq!(scene.is_of_power(&lamp(scene.lights[1].clone())), Some((Shiner::Light(1), Vec3::ONE)));
        let image = Change::Environment(Environment::Image { texture: 0, scale: Vec3::ONE, turn: 0.0 });
        let others = [Change::Light { light: 1, value: moved.clone() }, lamp(moved), image, Change::Time(1.0)];
        for other in others {
            assert_eq!(scene.is_of_power(&other), None, "{other:?}");
        }
        assert_eq!((scene.power(Shiner::Light(0)), scene.powered(Shiner::Material(2), Vec3::ONE)), (None, None));
    }
}
