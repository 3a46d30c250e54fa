//! What shines in a scene, and how much each of it gives to a place that nothing hides from it: by numbers alone, without
//! asking anybody. The sum over all of it is no picture; the difference of what an edit has changed is most of what a picture
//! needs after it.
//!
//! Surfaces that shine are a few patches, each as a disc is on its axis: `E = L A cosθ cosθ' / (d² + A / π)`, which is right far
//! away, too. Textured emission and photometric solids are left to samples ([`Lamps::is_known`]).

use std::collections::BTreeMap;
use std::f32::consts::PI;

use glam::Vec3;
use scenes::{Environment, Light, LightGroup, Scene, texture};

/// All that shines, by what it is part of.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Lamps(BTreeMap<LightGroup, Lamp>);

/// One thing that shines.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Lamp {
    /// W·sr⁻¹ within a cone, as a [`Light::Spot`]; cosines of −1 and less: everywhere.
    Point {
        position: Vec3,
        intensity: Vec3,
        direction: Vec3,
        cos_inner: f32,
        cos_outer: f32,
    },
    /// W·m⁻² on what faces the way light comes.
    Sun {
        towards: Vec3,
        irradiance: Vec3,
    },
    Surface(Vec<Patch>),
    /// Irradiance of a place that sees nothing else, W·m⁻².
    Sky(Vec3),
    /// Too intricate to be known by numbers: whatever tells it apart from another.
    Other(Light),
}

/// A small part of a surface that shines.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Patch {
    position: Vec3,
    /// Unit, to the side that shines.
    normal: Vec3,
    /// Both sides shine.
    is_two_sided: bool,
    area: f32,
    radiance: Vec3,
    is_textured: bool,
}

/// A surface of more triangles is as many patches as there are octants that these face.
const PATCHES_MAX: usize = 8;

impl Lamps {
    /// Those of a scene that are not hidden.
    pub fn of(scene: &Scene) -> Self {
        let mut lamps = BTreeMap::new();
        for (number, light) in (0..).zip(&scene.lights).filter(|(_, light)| light.power() != Vec3::ZERO) {
            lamps.insert(LightGroup::Light(number), Lamp::of(light));
        }
        let shines: Vec<bool> = scene.materials.iter().map(|material| !material.emission.is_black()).collect();
        let mut surfaces: BTreeMap<LightGroup, Vec<Patch>> = BTreeMap::new();
        for (number, object) in scene.objects.iter().enumerate().filter(|(_, object)| object.visible) {
            let mesh = &scene.meshes[object.mesh as usize];
            // What the whole object is made of tells of nearly all that nothing of it shines.
            let may_shine = |material: &u32| shines[scene.made_of(number, *material) as usize];
            if !mesh.materials.iter().any(may_shine) {
                continue;
            }
            for triangle in scene.triangles(number) {
                let material = scene.material_of(number, triangle);
                if !shines[material as usize] {
                    continue;
                }
                let of = &scene.materials[material as usize];
                let [a, b, c] = mesh.triangles[triangle]
                    .map(|vertex| object.scene_from_object.point(mesh.positions[vertex as usize]));
                let across = (b - a).cross(c - a);
                let patch = Patch {
                    position: (a + b + c) / 3.0,
                    normal: across.normalize_or_zero(),
                    is_two_sided: of.emits_both_sides,
                    area: across.length() / 2.0,
                    radiance: of.emission.value,
                    is_textured: of.emission.texture.is_some(),
                };
                let group = LightGroup::of_triangle(scene, number as u32, triangle as u32);
                surfaces.entry(group).or_default().push(patch);
            }
        }
        lamps.extend(surfaces.into_iter().map(|(group, patches)| (group, Lamp::Surface(merged(patches)))));
        let sky = match scene.environment {
            Environment::Black => Vec3::ZERO,
            Environment::Constant(radiance) => radiance * PI,
            // How bright its image is does not matter for what it is dimmed to.
            Environment::Image { texture, scale, .. } => scale * mean(scene, texture) * PI,
        };
        if sky != Vec3::ZERO {
            lamps.insert(LightGroup::Environment, Lamp::Sky(sky));
        }
        Self(lamps)
    }

    /// What is otherwise than it was: each with what it was and what it is.
    pub fn changed<'a>(&'a self, now: &'a Self) -> Vec<[Option<&'a Lamp>; 2]> {
        let all = self.0.keys().chain(now.0.keys().filter(|group| !self.0.contains_key(group)));
        all.map(|group| [self.0.get(group), now.0.get(group)]).filter(|[was, is]| was != is).collect()
    }
}

fn mean(scene: &Scene, image: u32) -> Vec3 {
    let image = &scene.textures[image as usize];
    let texels = image.width as usize * image.height as usize;
    // A few hundred of them: it is a mean of what is seen from everywhere.
    let step = (texels / SKY_TEXELS).max(1);
    let sum: Vec3 = (0..texels).step_by(step).map(|texel| texture::texel(image, texel)).sum();
    sum / texels.div_ceil(step).max(1) as f32
}

const SKY_TEXELS: usize = 509;

/// As few patches as need be.
fn merged(patches: Vec<Patch>) -> Vec<Patch> {
    if patches.len() <= PATCHES_MAX {
        return patches;
    }
    let mut octants: [Vec<Patch>; 8] = Default::default();
    for patch in patches {
        let octant = patch.normal.cmplt(Vec3::ZERO).bitmask() as usize;
        octants[octant].push(patch);
    }
    octants.iter().filter(|octant| !octant.is_empty()).map(|octant| together(octant)).collect()
}

fn together(patches: &[Patch]) -> Patch {
    let mut sum = Patch {
        position: Vec3::ZERO,
        normal: Vec3::ZERO,
        is_two_sided: false,
        area: 0.0,
        radiance: Vec3::ZERO,
        is_textured: false,
    };
    for patch in patches {
        sum.position += patch.position * patch.area;
        sum.normal += patch.normal * patch.area;
        sum.radiance += patch.radiance * patch.area;
        sum.area += patch.area;
        sum.is_two_sided |= patch.is_two_sided;
        sum.is_textured |= patch.is_textured;
    }
    let area = sum.area.max(f32::MIN_POSITIVE);
    let (position, radiance) = (sum.position / area, sum.radiance / area);
    Patch { position, radiance, normal: sum.normal.normalize_or_zero(), ..sum }
}

impl Lamp {
    fn of(light: &Light) -> Self {
        match *light {
            Light::Point { position, intensity } => {
                Self::Point { position, intensity, direction: Vec3::Z, cos_inner: -2.0, cos_outer: -3.0 }
            }
            Light::Spot { position, direction, intensity, cos_inner, cos_outer } => {
                Self::Point { position, intensity, direction, cos_inner, cos_outer }
            }
            Light::Directional { direction, irradiance, .. } => Self::Sun { towards: -direction, irradiance },
            Light::Luminaire { .. } => Self::Other(light.clone()),
        }
    }

    /// Irradiance can be told from numbers.
    pub fn is_known(&self) -> bool {
        match self {
            Self::Point { .. } | Self::Sun { .. } | Self::Sky(_) => true,
            Self::Surface(patches) => !patches.iter().any(|patch| patch.is_textured),
            Self::Other(_) => false,
        }
    }

    /// Where it is, and which way it shines; zero: all around. `None`: it is everywhere, or far away.
    pub fn place(&self) -> Option<(Vec3, Vec3)> {
        match self {
            Self::Point { position, .. } => Some((*position, Vec3::ZERO)),
            Self::Surface(patches) => {
                let all = together(patches);
                let is_flat = patches.iter().all(|patch| !patch.is_two_sided && patch.normal.dot(all.normal) > FLAT);
                Some((all.position, if is_flat { all.normal } else { Vec3::ZERO }))
            }
            Self::Sun { .. } | Self::Sky(_) | Self::Other(_) => None,
        }
    }

    /// What it gives to a place that nothing hides from it, W·m⁻².
    pub fn irradiance(&self, at: Vec3, normal: Vec3) -> Vec3 {
        match self {
            Self::Point { position, intensity, direction, cos_inner, cos_outer } => {
                let offset = *position - at;
                let distance = offset.length().max(f32::MIN_POSITIVE);
                let to_lamp = offset / distance;
                let within = ((-direction.dot(to_lamp) - cos_outer) / (cos_inner - cos_outer)).clamp(0.0, 1.0);
                *intensity * (within * within * normal.dot(to_lamp).max(0.0) / (distance * distance))
            }
            Self::Sun { towards, irradiance } => *irradiance * normal.dot(*towards).max(0.0),
            Self::Surface(patches) => patches.iter().map(|patch| patch.irradiance(at, normal)).sum(),
            Self::Sky(irradiance) => *irradiance,
            Self::Other(_) => Vec3::ZERO,
        }
    }
}

/// What faces one way, by the cosine.
const FLAT: f32 = 0.99;

impl Patch {
    fn irradiance(&self, at: Vec3, normal: Vec3) -> Vec3 {
        let offset = self.position - at;
        let d2 = offset.length_squared();
        let to_lamp = offset / d2.sqrt().max(f32::MIN_POSITIVE);
        let leaving = -self.normal.dot(to_lamp);
        let leaving = if self.is_two_sided { leaving.abs() } else { leaving.max(0.0) };
        let cosines = normal.dot(to_lamp).max(0.0) * leaving;
        self.radiance * (self.area * cosines / (d2 + self.area / PI))
    }
}
