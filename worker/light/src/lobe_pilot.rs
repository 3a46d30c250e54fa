//! Whether light samples are worth anything to the lobes that the camera sees.
//!
//! A ray that follows a lobe knows all of the lobe and nothing of emitters; light samples the reverse. Where emitters are
//! about the same in all directions, as an overcast sky is, nothing has to be known of them, and each light sample
//! brings the noise of a lobe that it does not know. The balance heuristic cannot tell: it sees densities alone. So a
//! few rays find out how much what a lobe's rays meet differs, and light samples count so many times their number.
//! Any factor is right in the mean (Veach 1997, section 9.2).

use glam::Vec3;
use protocol::question::Scramble;
use scenes::Camera;

use crate::bvh::Ray;
use crate::eye;
use crate::prepared::Prepared;
use crate::sample::{Sequence, Stage};
use crate::surface::Scatter;

/// Places that are looked at: 8×8 pixels.
const SIDE: u32 = 8;
/// Rays from each.
const RAYS: u32 = 8;
/// Light samples count no less than this: a lamp may be too small for so few rays.
const LEAST: f32 = 1.0 / 16.0;

/// What a light sample counts beside a ray, `LEAST..=1`; and the rays that were traced. 1 where the camera sees no gloss.
pub fn worth_of_light_samples(prepared: &Prepared, camera: &Camera) -> (f32, u64) {
    let lens = camera.lens();
    let sequence = Sequence::new(0, Stage::Pilot, [7, 0, 0], Scramble::Owen);
    let ([mut variance, mut square], mut rays) = ([0.0; 2], 0);
    for i in 0..SIDE * SIDE {
        let middle = |k: u32, size: u32| ((k as f32 + 0.5) * size as f32 / SIDE as f32) as u32;
        let pixel = [middle(i % SIDE, camera.width), middle(i / SIDE, camera.height)];
        let ray = eye::ray(&lens, pixel, &sequence, i);
        rays += 1;
        let Some(hit) = eye::meet(prepared, &lens, &ray) else { continue };
        let at = prepared.surfel(&ray, &hit);
        let Scatter::Glossy(material) = at.scatter(&prepared.scene) else { continue };
        let [mut sum, mut squares] = [0.0; 2];
        for j in 0..RAYS {
            let [a, b] = sequence.first(1, i * RAYS + j);
            let Some((direction, weight)) = material.sample(at.shading, -ray.direction, [a, b]) else { continue };
            if at.geometric.dot(direction) <= 0.0 {
                continue;
            }
            rays += 1;
            let brings = f64::from((weight * met(prepared, at.off(direction), direction)).max_element());
            sum += brings;
            squares += brings * brings;
        }
        let mean = sum / f64::from(RAYS);
        variance += squares / f64::from(RAYS) - mean * mean;
        square += mean * mean;
    }
    let worth = if square > 0.0 { ((variance / square) as f32).clamp(LEAST, 1.0) } else { 1.0 };
    (worth, rays)
}

/// Radiance of emitters that a ray meets.
fn met(prepared: &Prepared, origin: Vec3, direction: Vec3) -> Vec3 {
    let ray = Ray { origin, direction, t_max: f32::INFINITY };
    match prepared.world.closest(&ray) {
        Some(hit) => prepared.surfel(&ray, &hit).emission(&prepared.scene),
        None => prepared.emitters.sky_radiance(&prepared.scene, direction),
    }
}

#[cfg(test)]
mod tests {
    use scenes::{Colour, Environment, Gloss, Material, Mesh, Object, Scalar, Scene, Surface};

    use super::*;

    /// A floor of metal under a lamp of some size, and perhaps a sky.
    fn worth(lamp: f32, sky: f32) -> f32 {
        let mut mesh = Mesh::default();
        let mut quad = |middle: Vec3, u: Vec3, v: Vec3, material: u32| {
            let first = mesh.positions.len() as u32;
            mesh.positions.extend([middle - u - v, middle + u - v, middle + u + v, middle - u + v]);
            mesh.triangles.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
            mesh.materials.extend([material; 2]);
        };
        quad(Vec3::ZERO, Vec3::Z * 5.0, Vec3::X * 5.0, 0);
        quad(Vec3::Y * 2.0, Vec3::X * lamp, Vec3::Z * lamp, 1);
        let (base, roughness, metalness) = (Colour::plain(Vec3::ONE), Scalar::plain(0.6), Scalar::plain(1.0));
        let metal = Surface::Glossy(Gloss::new(base, roughness, metalness));
        let shines = Colour::plain(Vec3::ONE);
        let scene = Scene {
            meshes: vec![mesh.into()],
            objects: vec![Object::fixed("all", 0)],
            materials: vec![
                Material { surface: metal, ..Material::diffuse("metal", Vec3::ZERO) },
                Material { emission: shines, ..Material::diffuse("lamp", Vec3::ZERO) },
            ],
            environment: if sky > 0.0 { Environment::Constant(Vec3::splat(sky)) } else { Environment::Black },
            camera: Camera {
                origin: Vec3::new(0.0, 1.5, 4.0),
                target: Vec3::ZERO,
                fov_y_deg: 30.0,
                width: 64,
                height: 64,
                ..Camera::default()
            },
            ..Scene::default()
        };
        let camera = scene.camera;
        worth_of_light_samples(&Prepared::new(scene), &camera).0
    }

    #[test]
    fn light_samples_are_worth_much_where_lobes_meet_little_light() {
        assert_eq!(worth(0.1, 0.0), 1.0, "a small lamp");
        assert_eq!(worth(1e-4, 0.0), 1.0, "one that no ray has met");
        for lamp in [1e-4, 1.0] {
            assert!((LEAST..0.2).contains(&worth(lamp, 1.0)), "a sky, and a lamp no brighter: {}", worth(lamp, 1.0));
        }
    }
}
