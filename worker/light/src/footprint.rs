//! The area that a photon's light is spread over: as much of the disc about it as is surface.
//!
//! Density estimation spreads a photon's flux evenly over a disc of radius r. Near an edge, on anything narrower than the
//! disc, and where a surface is there in part, some of the disc is no surface, nobody looks there, and that share of the
//! light would be lost: half of it over a floor half as large as the disc (boundary bias; Jensen 2001, section 7.2). So the
//! flux is divided by the area A that is surface instead. πr²/A needs no A: it is how often, on average, points of the disc
//! have to be drawn until one lies on the surface. So chance finds it without bias, by one short ray where the disc is
//! whole, and all flux that arrives is reflected, however wide the disc is. It is still blurred, until radii shrink.

use glam::Vec3;

use crate::bvh::Ray;
use crate::photons::{Photon, same_surface};
use crate::prepared::Prepared;
use crate::sample::Sequence;
use crate::vpl::blur;
use crate::warp;

/// Points drawn at most: light on threads narrower than about a hundredth of the disc stays too dark, until it shrinks.
const TRIALS_MAX: u32 = 64;
/// Things in the way of a look at the surface, at most.
const LAYERS_MAX: usize = 4;
/// Radii that are less than so many times what rounding moves a place by tell nothing.
const RESOLVED: f32 = 64.0;

/// By how much a photon is brighter because its disc of a radius is not all surface: 1 or more, on average πr²/A. `rays`
/// counts the looks.
pub fn concentration(prepared: &Prepared, photon: &Photon, radius: f32, sequence: &Sequence, rays: &mut u64) -> f32 {
    if radius <= RESOLVED * blur(photon.position) {
        return 1.0;
    }
    let (s, t) = warp::frame(photon.normal);
    let lies_on_surface = |trial: &u32| {
        let d = warp::disc(sequence.first::<2>(*trial, 0)) * radius;
        is_surface(prepared, photon, photon.position + s * d.x + t * d.y, radius, rays)
    };
    (1..TRIALS_MAX).find(lies_on_surface).unwrap_or(TRIALS_MAX) as f32
}

/// Whether the surface that a photon lies on is there above or below a point of its disc: where those who look find it.
fn is_surface(prepared: &Prepared, photon: &Photon, point: Vec3, radius: f32, rays: &mut u64) -> bool {
    let direction = -photon.normal;
    let (mut origin, mut t_max) = (point - direction * radius, 2.0 * radius);
    for _ in 0..LAYERS_MAX {
        *rays += 1;
        let ray = Ray { origin, direction, t_max };
        let Some(hit) = prepared.world.closest(&ray) else { return false };
        let at = prepared.surfel(&ray, &hit);
        if same_surface(at.smooth, photon.normal) && photon.reaches(at.position, radius) {
            return true;
        }
        origin = at.off(direction);
        t_max -= hit.t;
    }
    false
}

#[cfg(test)]
mod tests {
    use protocol::question::Scramble;
    use scenes::{Coverage, Material, Mesh, Object, Scene};

    use super::*;
    use crate::sample::Stage;

    /// A floor of two triangles, from x = 0 to x = `width`, of which so much is there.
    fn floor(width: f32, amount: f32) -> Prepared {
        let corners = [Vec3::ZERO, Vec3::Z * 10.0, Vec3::new(width, 0.0, 10.0), Vec3::X * width];
        let mesh = Mesh {
            positions: corners.map(|corner| corner - Vec3::Z * 5.0).to_vec(),
            triangles: vec![[0, 1, 2], [0, 2, 3]],
            materials: vec![0; 2],
            ..Mesh::default()
        };
        let coverage = (amount < 1.0).then(|| Coverage::plain(amount));
        Prepared::new(Scene {
            meshes: vec![mesh.into()],
            objects: vec![Object::fixed("floor", 0)],
            materials: vec![Material { coverage, ..Material::diffuse("floor", Vec3::splat(0.5)) }],
            ..Scene::default()
        })
    }

    fn mean_concentration(prepared: &Prepared, x: f32) -> f32 {
        let photon =
            Photon { position: Vec3::X * x, normal: Vec3::Y, from: Vec3::Y, flux: Vec3::ONE, shines_on: false };
        let count = 20_000;
        let sum: f32 = (0..count)
            .map(|i| {
                let sequence = Sequence::new(i, Stage::Photons, [0; 0], Scramble::Owen);
                concentration(prepared, &photon, 1.0, &sequence, &mut 0)
            })
            .sum();
        sum / count as f32
    }

    #[test]
    fn light_is_concentrated_on_as_much_of_the_disc_as_is_there() {
        assert_eq!(mean_concentration(&floor(10.0, 1.0), 5.0), 1.0, "all of it");
        // At distance d from a straight edge, so much of a unit disc lies beyond.
        let beyond = |d: f32| (d.acos() - d * (1.0 - d * d).sqrt()) / std::f32::consts::PI;
        let strip = 1.0 - 2.0 * beyond(0.2);
        for (prepared, x, share, what) in [
            (floor(10.0, 1.0), 1e-3, 1.0 - beyond(1e-3), "at an edge"),
            (floor(10.0, 1.0), 0.5, 1.0 - beyond(0.5), "near an edge"),
            (floor(0.4, 1.0), 0.2, strip, "on a strip"),
            (floor(10.0, 0.3), 5.0, 0.3, "on what is there in part"),
        ] {
            let got = mean_concentration(&prepared, x);
            assert!((got * share - 1.0).abs() < 0.04, "{what}: {got} of {}", 1.0 / share);
        }
    }
}
