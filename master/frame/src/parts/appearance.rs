//! What a surface is like where a pixel sees it, as far as the master knows without asking: its colour and what it emits, by
//! its textures.

use glam::Vec3;
use scenes::{Colour, Environment, Gloss, Light, Place, Rgb, Scene, Surface, texture};

use super::raster::Hit;

/// What turns light that arrives at a place into light that leaves it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Appearance {
    /// Emitted towards the eye, W·m⁻²·sr⁻¹.
    pub emission: Rgb,
    /// Of matt surfaces the fraction that is reflected; of others the colour by which what they reflect is tinted, or white
    /// where it is not tinted by one.
    pub colour: Rgb,
    /// How it scatters.
    pub finish: Finish,
}

/// How a surface scatters light, as far as it matters to those who keep it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Finish {
    /// Lambert: irradiance and colour tell all.
    Matt,
    /// The same from everywhere, but not made of the irradiance of one side: sheets that let light through.
    Veiled,
    /// It depends on where the eye is, the more so the lower this perceptual roughness is; 0 for mirrors and clear glass.
    Shiny(f32),
}

impl Appearance {
    /// What a hit looks like.
    pub fn of(scene: &Scene, hit: &Hit) -> Self {
        let mesh = &*scene.meshes[scene.objects[hit.object as usize].mesh as usize];
        let [u, v] = hit.uv;
        let place = Place { mesh, triangle: hit.triangle as usize, weights: [1.0 - u - v, u, v] };
        let material = &scene.materials[scene.material_of(hit.object as usize, hit.triangle as usize) as usize];
        let colour = |colour: &Colour| colour.value * place.colour(scene, colour.texture);
        let tint = place.vertex_colour().map_or(Vec3::ONE, |colour| colour.truncate());
        let shines = !material.emission.is_black() && (!hit.back || material.emits_both_sides);
        let emission = if shines { colour(&material.emission) } else { Vec3::ZERO };
        let colour = match &material.surface {
            Surface::Diffuse { albedo: base }
            | Surface::Glossy(Gloss { base, .. })
            | Surface::Glazed { base, .. }
            | Surface::Translucent { albedo: base, .. } => colour(base) * tint,
            Surface::Mirror { .. } | Surface::Dielectric(_) => Vec3::ONE,
        };
        Self { emission, colour, finish: Finish::of(&material.surface) }
    }
}

impl Finish {
    /// Of a surface wherever on it.
    pub fn of(surface: &Surface) -> Self {
        match surface {
            Surface::Diffuse { .. } => Self::Matt,
            Surface::Translucent { .. } => Self::Veiled,
            Surface::Glossy(Gloss { roughness, .. }) => Self::Shiny(roughness.value.clamp(0.0, 1.0)),
            Surface::Mirror { .. } | Surface::Dielectric(_) | Surface::Glazed { .. } => Self::Shiny(0.0),
        }
    }
}

/// What shines from beyond all objects, discs of suns included, from a direction of unit length; W·m⁻²·sr⁻¹.
pub fn sky(scene: &Scene, direction: Vec3) -> Rgb {
    let around = match scene.environment {
        Environment::Black => Vec3::ZERO,
        Environment::Constant(radiance) => radiance,
        Environment::Image { texture, scale, turn } => {
            texture::sky_colour(&scene.textures[texture as usize], texture::sky_uv(direction, turn)) * scale
        }
    };
    scene.lights.iter().filter(|light| light.has_disc()).fold(around, |sum, light| sum + disc(light, direction))
}

/// Radiance of a sun's disc from a direction.
fn disc(light: &Light, towards: Vec3) -> Rgb {
    let Light::Directional { direction, irradiance, diameter_deg } = light else { return Vec3::ZERO };
    let (sin, cos) = libm::sincos(f64::from(*diameter_deg).to_radians() / 2.0);
    let is_within = f64::from(-direction.dot(towards)) >= cos;
    if is_within { *irradiance / (std::f64::consts::PI * sin * sin) as f32 } else { Vec3::ZERO }
}
