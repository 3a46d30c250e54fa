//! What a scene uses, found in one walk, so that everything else can be left out.
//!
//! The rule: leaving out changes no pixel, only time. (algorithms.md, section C.)

use glam::Vec3;
use serde::{Deserialize, Serialize};

use crate::{Coat, Dielectric, Environment, Gloss, Light, Pixels, Scalar, Scene, Surface, Texture};

/// The features that visible objects, lights and environment of a scene use.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Needs {
    /// Number of perfect mirrors among the materials in use.
    pub mirrors: u32,
    /// Number of materials in use that are glass, or are so in part.
    pub glass: u32,
    /// Number of those that are so in part.
    pub glazed: u32,
    /// Number of those that absorb light inside.
    pub absorbing: u32,
    /// Number of solid ones with a priority, which mind what other glass they lie in.
    pub nested: u32,
    /// Number of glossy materials in use.
    pub glossy: u32,
    /// Number of those with sheen.
    pub sheen: u32,
    /// Number of those under a coat.
    pub coated: u32,
    /// Number of those whose lobe is, or may be, so sharp that it is followed like a mirror.
    pub sharp: u32,
    /// Number of materials in use that reflect diffusely (glossy ones have a diffuse base).
    pub diffuse: u32,
    /// Number of those that spread light: all but dark ones whose lobe is sharp, of which rays that are followed find
    /// everything, and virtual lights nothing.
    pub spreading: u32,
    /// Number of materials in use that look up a texture.
    pub textured: u32,
    /// Number of materials in use with relief that is finer than their triangles.
    pub relief: u32,
    /// Some mesh in use has colours at its vertices.
    pub vertex_colours: bool,
    /// Number of materials in use that are not everywhere wholly there.
    pub coverage: u32,
    /// Number of emissive triangles.
    pub emissive_triangles: u32,
    /// Number of emissive materials in use whose emission is textured.
    pub textured_emission: u32,
    /// Number of point lights that shine.
    pub point_lights: u32,
    /// Number of spot lights that shine.
    pub spot_lights: u32,
    /// Number of luminaires that shine.
    pub luminaires: u32,
    /// Number of directional lights in parallel rays that shine.
    pub directional_lights: u32,
    /// Number of directional lights with a disc that shine.
    pub suns: u32,
    /// The environment shines.
    pub environment: bool,
    /// … and is an image.
    pub environment_image: bool,
    /// Some mesh has shading normals.
    pub smooth_normals: bool,
    /// Number of visible objects.
    pub objects: u32,
    /// Number of visible objects that do not stand where they were modelled.
    pub moved_objects: u32,
    /// Number of visible objects with keyframes.
    pub animated: u32,
    /// Number of triangles of visible objects.
    pub triangles: u64,
}

/// What becomes of stages that a scene has no work for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Keep {
    /// They are left out.
    #[default]
    Needed,
    /// They run all the same, and find nothing. For measuring what leaving out saves, and for proving that it
    /// changes no bit.
    All,
}

impl Needs {
    /// What a scene is prepared for.
    pub fn kept(scene: &Scene, keep: Keep) -> Self {
        match keep {
            Keep::Needed => Self::of(scene),
            Keep::All => Self::of(scene).with_everything(),
        }
    }

    /// As if the scene used every feature at least once. (What is merely counted stays as it is.)
    #[must_use]
    pub fn with_everything(self) -> Self {
        let some = |count: u32| count.max(1);
        Self {
            mirrors: some(self.mirrors),
            glass: some(self.glass),
            glazed: some(self.glazed),
            absorbing: some(self.absorbing),
            nested: self.nested,
            glossy: some(self.glossy),
            sheen: some(self.sheen),
            coated: some(self.coated),
            sharp: some(self.sharp),
            diffuse: some(self.diffuse),
            spreading: some(self.spreading),
            textured: some(self.textured),
            relief: some(self.relief),
            vertex_colours: true,
            coverage: some(self.coverage),
            emissive_triangles: some(self.emissive_triangles),
            textured_emission: some(self.textured_emission),
            point_lights: some(self.point_lights),
            spot_lights: some(self.spot_lights),
            luminaires: some(self.luminaires),
            directional_lights: some(self.directional_lights),
            suns: some(self.suns),
            environment: true,
            environment_image: true,
            smooth_normals: true,
            objects: self.objects,
            moved_objects: some(self.moved_objects),
            animated: some(self.animated),
            triangles: self.triangles,
        }
    }

    /// Walks the scene once.
    pub fn of(scene: &Scene) -> Self {
        let mut needs = Self::default();
        let mut in_use = vec![false; scene.materials.len()];
        for (number, object) in scene.objects.iter().enumerate().filter(|(_, object)| object.visible) {
            let mesh = &scene.meshes[object.mesh as usize];
            needs.objects += 1;
            needs.moved_objects += u32::from(!object.scene_from_object.is_identity());
            needs.animated += u32::from(object.motion.is_some());
            needs.smooth_normals |= !mesh.normals.is_empty();
            needs.vertex_colours |= !mesh.colours.is_empty();
            for triangle in scene.triangles(number) {
                let material = scene.material_of(number, triangle);
                needs.triangles += 1;
                in_use[material as usize] = true;
                needs.emissive_triangles += u32::from(!scene.materials[material as usize].emission.is_black());
            }
        }
        for (material, _) in scene.materials.iter().zip(&in_use).filter(|(_, used)| **used) {
            let mut textured = false;
            match &material.surface {
                Surface::Diffuse { albedo } => {
                    needs.diffuse += u32::from(!albedo.is_black());
                    needs.spreading += u32::from(!albedo.is_black());
                    textured |= albedo.texture.is_some();
                }
                Surface::Mirror { .. } => needs.mirrors += 1,
                Surface::Dielectric(glass) => needs.note_glass(glass, &mut textured),
                Surface::Glazed { amount, glass, base, metalness, specular, .. } => {
                    needs.note_glass(glass, &mut textured);
                    needs.glazed += 1;
                    needs.glossy += 1;
                    needs.sharp += u32::from(is_sharp(&glass.roughness));
                    needs.diffuse += 1;
                    needs.spreading += 1;
                    textured |= base.texture.is_some() || amount.texture.is_some() || metalness.texture.is_some();
                    textured |= specular.is_textured();
                }
                Surface::Translucent { albedo, transmittance } => {
                    needs.diffuse += u32::from(!(albedo.is_black() && transmittance.is_black()));
                    needs.spreading += u32::from(!(albedo.is_black() && transmittance.is_black()));
                    textured |= albedo.texture.is_some() || transmittance.texture.is_some();
                }
                Surface::Glossy(Gloss { base, roughness, metalness, specular, sheen, coat, .. }) => {
                    needs.glossy += 1;
                    needs.sheen += u32::from(sheen.is_some());
                    needs.coated += u32::from(coat.is_some());
                    needs.sharp += u32::from(has_sharp_lobe(roughness, coat.as_ref()));
                    needs.diffuse += 1;
                    let is_dark = base.is_black() || metalness.texture.is_none() && metalness.value >= 1.0;
                    let is_mirror = roughness.texture.is_none() && is_sharp(roughness);
                    needs.spreading += u32::from(!(is_dark && is_mirror) || scene.multiple_scattering);
                    textured |= base.texture.is_some() || roughness.texture.is_some() || metalness.texture.is_some();
                    textured |= specular.is_textured();
                    textured |= sheen.is_some_and(|sheen| sheen.is_textured());
                    let of_coat = |coat: Coat| coat.amount.texture.is_some() || coat.roughness.texture.is_some();
                    textured |= coat.is_some_and(of_coat);
                }
            }
            let shines_through_texture = !material.emission.is_black() && material.emission.texture.is_some();
            needs.textured_emission += u32::from(shines_through_texture);
            needs.relief += u32::from(material.relief.is_some());
            needs.coverage += u32::from(material.coverage.is_some());
            let mask = material.coverage.is_some_and(|coverage| coverage.amount.texture.is_some());
            needs.textured += u32::from(textured || shines_through_texture || mask || material.relief.is_some());
        }
        for light in &scene.lights {
            let count = match light {
                Light::Point { .. } => &mut needs.point_lights,
                Light::Spot { .. } => &mut needs.spot_lights,
                Light::Luminaire { .. } => &mut needs.luminaires,
                Light::Directional { .. } if light.has_disc() => &mut needs.suns,
                Light::Directional { .. } => &mut needs.directional_lights,
            };
            *count += u32::from(light.power() != Vec3::ZERO);
        }
        match scene.environment {
            Environment::Black => {}
            Environment::Constant(radiance) => needs.environment = radiance != Vec3::ZERO,
            Environment::Image { scale, texture, .. } => {
                needs.environment = scale != Vec3::ZERO && !is_black(&scene.textures[texture as usize]);
                needs.environment_image = needs.environment;
            }
        }
        needs
    }

    fn note_glass(&mut self, glass: &Dielectric, textured: &mut bool) {
        self.glass += 1;
        self.absorbing += u32::from(glass.absorbs());
        self.nested += u32::from(glass.is_nested());
        *textured |= glass.transmittance.texture.is_some() || glass.roughness.texture.is_some();
    }

    /// Something focuses or relays light without scattering it, or frosted glass does so and scatters.
    pub fn specular(&self) -> bool {
        self.mirrors + self.glass > 0
    }

    /// There is something for light to fall on.
    pub fn surfaces(&self) -> bool {
        self.diffuse + self.mirrors + self.glass > 0
    }

    /// Number of lights without surface: points, spots, luminaires and suns in parallel rays, which no ray can hit.
    pub fn bare_lights(&self) -> u32 {
        self.point_lights + self.spot_lights + self.luminaires + self.directional_lights
    }

    /// Something shines at all.
    pub fn light(&self) -> bool {
        self.emissive_triangles + self.bare_lights() + self.suns > 0 || self.environment
    }

    /// Glass may lie in other glass that it minds.
    pub fn nesting(&self) -> bool {
        self.nested > 1
    }

    /// Caustics can exist: light exists and something relays it specularly to something that spreads it, or to gloss that
    /// shows lights which no ray meets.
    pub fn caustics(&self) -> bool {
        let is_lit = self.spreading > 0 || self.sharp > 0 && self.bare_lights() > 0;
        (self.specular() || self.sharp > 0) && self.light() && is_lit
    }

    /// Objects have to be told apart: one flat list of triangles will not do.
    pub fn instances(&self) -> bool {
        self.objects > 1 || self.moved_objects > 0
    }
}

/// GGX lobes of α below this are followed like mirrors; light of rougher ones is shared by virtual lights and rays.
pub const SHARP_ALPHA: f32 = 0.2;

/// Whether a glossy material of this roughness can have a lobe sharper than [`SHARP_ALPHA`].
pub fn is_sharp(roughness: &Scalar) -> bool {
    roughness.texture.is_some() || roughness.value * roughness.value < SHARP_ALPHA
}

/// The same of a glossy material, or of the coat over it.
pub fn has_sharp_lobe(roughness: &Scalar, coat: Option<&Coat>) -> bool {
    is_sharp(roughness) || coat.is_some_and(|coat| is_sharp(&coat.roughness))
}

fn is_black(texture: &Texture) -> bool {
    match &texture.pixels {
        Pixels::Srgb8(texels) | Pixels::Linear8(texels) => texels.iter().all(|t| t[..3] == [0; 3]),
        Pixels::Float(texels) => texels.iter().all(|t| *t == [0.0; 3]),
    }
}
