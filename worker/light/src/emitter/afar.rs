//! What shines from beyond all objects: the sky, and suns with a disc in it.
//!
//! Each is a source of its own: rays that leave the scene meet all of them, and what they find of each counts beside the light
//! samples of that one.

use glam::Vec3;
use scenes::{Rgb, Scene};

use super::{Emitters, Source};
use crate::aims::Choice;
use crate::sky::Sky;
use crate::sun::Sun;

impl Emitters {
    /// Radiance from beyond all objects: of the sky and of suns in it.
    pub fn sky_radiance(&self, scene: &Scene, direction: Vec3) -> Rgb {
        let sky = self.sky.as_ref().map_or(Vec3::ZERO, |sky| sky.radiance(scene, direction));
        self.suns_seen(direction).fold(sky, |sum, (_, sun)| sum + sun.radiance())
    }

    /// What shines from beyond all objects in a direction, each with its radiance and the density that
    /// [`Self::sample_with_density`] tells of that direction, sr⁻¹; what is black there is left out.
    pub fn seen_afar(&self, scene: &Scene, choice: &Choice, direction: Vec3) -> impl Iterator<Item = (Rgb, f32)> {
        let sky = self.sky.as_ref().and_then(|sky| {
            let radiance = sky.radiance(scene, direction);
            (radiance != Vec3::ZERO).then(|| (radiance, self.density_of_sky_alone(scene, choice, sky, direction)))
        });
        let suns = self.suns_seen(direction);
        sky.into_iter().chain(suns.map(|(number, sun)| (sun.radiance(), self.density_of_sun(choice, number, sun))))
    }

    /// Radiance of one source afar, sky or sun, in a direction that was chosen by it.
    pub fn radiance_afar(&self, scene: &Scene, source: u32, direction: Vec3) -> Rgb {
        match (self.sources.get(source as usize), &self.sky) {
            (Some(Source::Sun { disc, .. }), _) => disc.radiance(),
            (Some(Source::Sky), Some(sky)) => sky.radiance(scene, direction),
            _ => Vec3::ZERO,
        }
    }

    /// Suns that are seen in a direction, with the numbers of their sources.
    fn suns_seen(&self, direction: Vec3) -> impl Iterator<Item = (usize, &Sun)> {
        self.suns.iter().filter_map(move |number| match &self.sources[*number as usize] {
            Source::Sun { disc, .. } if disc.is_seen(direction) => Some((*number as usize, disc)),
            _ => None,
        })
    }

    fn density_of_sun(&self, choice: &Choice, number: usize, sun: &Sun) -> f32 {
        self.probability(choice, number) as f32 * sun.density()
    }

    /// The sky is the last source.
    fn density_of_sky_alone(&self, scene: &Scene, choice: &Choice, sky: &Sky, direction: Vec3) -> f32 {
        self.probability(choice, self.sources.len() - 1) as f32 * sky.density(scene, direction)
    }

    /// The density that [`Self::sample_with_density`] tells of directions of sky and suns together, sr⁻¹.
    pub fn density_of_sky(&self, scene: &Scene, choice: &Choice, direction: Vec3) -> f32 {
        let sky = match (&self.sky, self.sources.last()) {
            (Some(sky), Some(Source::Sky)) => self.density_of_sky_alone(scene, choice, sky, direction),
            _ => 0.0,
        };
        self.suns_seen(direction).fold(sky, |sum, (number, sun)| sum + self.density_of_sun(choice, number, sun))
    }
}
