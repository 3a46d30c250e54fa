//! Light samples in flat mirrors: images of the points on lights of a set, for lobes to be lit by.
//!
//! A ray that follows a lobe, meets a mirror and then a lamp is as rare as one that meets the lamp itself is where the lobe is
//! wide and the lamp small. A flat mirror shows each point on a light as an image behind it (Allen & Berkley 1979), as far away
//! and as steep as the way by the mirror is: so an image has the density that its point has, and shares its light with rays
//! as the point does ([`crate::lobe`]), whose way is one mirror longer. Ways by several mirrors, by curved ones or by
//! others than perfect ones are the rays' alone.

use glam::Vec3;
use scenes::relays::Plane;
use scenes::{Relays, Scene, Surface};

use crate::bvh::Hit;
use crate::vpl::{Shape, Vpl};

/// The flat perfect mirrors of a scene.
#[derive(Clone, Debug, Default)]
pub struct Mirrors {
    flat: Relays,
}

/// A point on a light as a mirror shows it.
#[derive(Clone, Debug)]
pub struct Image {
    /// Where it seems to be.
    pub seen: Vpl,
    /// Number of the light itself, in its set.
    pub of: u32,
    /// Number of the mirror's plane.
    pub plane: u32,
}

/// More planes than this are a curved thing in facets, or cost more to weigh than they find.
const PLANES_MAX: usize = 4;

impl Mirrors {
    /// Finds them; nothing in a scene where something absorbs light, nor where no lobe wants it.
    pub fn new(scene: &Scene, any_lobe: bool) -> Self {
        let absorbs = |surface: &Surface| surface.glass().is_some_and(scenes::Dielectric::absorbs);
        if !any_lobe || scene.materials.iter().any(|material| absorbs(&material.surface)) {
            return Self::default();
        }
        let flat = Relays::mirrors(scene);
        if flat.planes.len() > PLANES_MAX { Self::default() } else { Self { flat } }
    }

    /// The number of the plane of a mirror that was hit.
    pub fn plane_of(&self, hit: &Hit) -> Option<u32> {
        self.flat.plane_of(hit.object, hit.triangle)
    }

    /// Images of points on lights which rays can meet.
    pub fn images(&self, lights: &[Vpl]) -> Vec<Image> {
        let lights = || (0..).zip(lights).take_while(|(_, vpl)| vpl.depth == 0).filter(|(_, vpl)| !vpl.is_bodiless());
        let of_plane = |(plane, mirror): (u32, &Plane)| {
            let mirror = *mirror;
            lights().map(move |(of, vpl)| Image { seen: image(vpl, &mirror), of, plane })
        };
        (0..).zip(&self.flat.planes).flat_map(of_plane).collect()
    }

    /// Whether a place lies on the side of a mirror that its image of a light can be seen from.
    pub fn shows(&self, image: &Image, place: Vec3) -> bool {
        let mirror = &self.flat.planes[image.plane as usize];
        let behind = match image.seen.shape {
            Shape::Distant => mirror.normal.dot(image.seen.normal),
            _ => mirror.height(image.seen.position),
        };
        mirror.height(place) * behind < 0.0
    }
}

fn image(vpl: &Vpl, mirror: &Plane) -> Vpl {
    let position = if vpl.is_distant() { vpl.position } else { mirror.image(vpl.position) };
    Vpl { position, normal: mirror.turned(vpl.normal), ..vpl.clone() }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use scenes::{Dielectric, Material, Mesh, Object, Rgb};

    use super::*;

    /// Quads across x at some places.
    fn scene(places: &[f32], surface: Surface) -> Scene {
        let mut mesh = Mesh::default();
        for x in places {
            let first = mesh.positions.len() as u32;
            mesh.positions.extend([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]].map(|[y, z]| Vec3::new(*x, y, z)));
            mesh.triangles.push([first, first + 1, first + 2]);
            mesh.materials.push(0);
        }
        Scene {
            meshes: vec![Arc::new(mesh)],
            objects: vec![Object::fixed("mirrors", 0)],
            materials: vec![Material { surface, ..Material::diffuse("mirror", Rgb::ZERO) }],
            ..Scene::default()
        }
    }

    const MIRROR: Surface = Surface::Mirror { reflectance: Rgb::ONE };

    fn lamp(shape: Shape, density: Option<f32>) -> Vpl {
        let (position, normal) = (Vec3::new(0.5, 3.0, 2.0), Vec3::new(0.6, 0.8, 0.0));
        Vpl { position, normal, strength: Rgb::ONE, shape, depth: 0, source: 0, density }
    }

    #[test]
    fn each_mirror_shows_what_rays_can_meet() {
        let mirrors = Mirrors::new(&scene(&[1.0, 4.0], MIRROR), true);
        let bare = lamp(Shape::Point, None);
        let off_surface = Vpl { depth: 1, ..lamp(Shape::Surface, None) };
        let lights = [lamp(Shape::Surface, Some(2.0)), bare, lamp(Shape::Distant, Some(1.0)), off_surface];
        let images = mirrors.images(&lights);
        assert_eq!(
            images.iter().map(|image| (image.plane, image.of)).collect::<Vec<_>>(),
            [(0, 0), (0, 2), (1, 0), (1, 2)]
        );
        assert_eq!(images[0].seen.position, Vec3::new(1.5, 3.0, 2.0));
        assert_eq!(images[0].seen.normal, Vec3::new(-0.6, 0.8, 0.0));
        assert_eq!(images[0].seen.density, Some(2.0), "as far as the way is long");
        assert_eq!(images[1].seen.normal, Vec3::new(-0.6, 0.8, 0.0));
        assert!(mirrors.shows(&images[0], Vec3::ZERO) && !mirrors.shows(&images[0], Vec3::X * 3.0));
        assert!(mirrors.shows(&images[1], Vec3::X * 3.0) && !mirrors.shows(&images[1], Vec3::ZERO));
    }

    #[test]
    fn facets_and_other_things_are_no_mirrors() {
        let none = |mirrors: Mirrors| mirrors.images(&[lamp(Shape::Surface, Some(1.0))]).is_empty();
        let many: Vec<f32> = (0..=PLANES_MAX as u32).map(|i| i as f32).collect();
        assert!(none(Mirrors::new(&scene(&many, MIRROR), true)));
        assert!(none(Mirrors::new(&scene(&[1.0], MIRROR), false)), "no lobe wants them");
        let glass = Surface::Dielectric(Dielectric::clear(1.5, true));
        assert!(none(Mirrors::new(&scene(&[1.0], glass), true)));
        let mut smoky = scene(&[1.0], MIRROR);
        let glass = Dielectric { absorption: Rgb::ONE, ..Dielectric::clear(1.5, false) };
        smoky.materials.push(Material { surface: Surface::Dielectric(glass), ..smoky.materials[0].clone() });
        assert!(none(Mirrors::new(&smoky, true)));
    }
}
