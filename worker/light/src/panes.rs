//! Light paths that are sent through clear glass, where that is how light comes to what is looked at.
//!
//! A room that is lit through a window has nearly all of its light from outside: from sky and sun, and from ground and walls
//! that these light. A path that is left to itself finds a pane in a plain about once in a hundred thousand times, and is
//! brighter than others by as much: a tenth of a room's light may come in one flash a minute. So a share of the paths
//! ([`Aims::at_panes`]) is aimed at balls around clear glass, from where they begin and from wherever they are
//! scattered, until they have passed some. The rest go their own way, so nothing is left out; and what either finds is divided
//! by the density of both together.
//!
//! How many are aimed is for the pilot to find ([`crate::pilot`]): none where paths find glass by themselves as often as it
//! matters.

use glam::Vec3;

use crate::aims::{Aims, density_through};
use crate::prepared::Prepared;
use crate::vpl::{Shape, Vpl};

/// A way that light takes.
#[derive(Clone, Copy, Debug)]
pub struct Aimed {
    /// Where it begins.
    pub origin: Vec3,
    /// Unit.
    pub direction: Vec3,
    /// Density with which light takes it by itself, over that with which it was chosen: its flux counts by this factor.
    pub natural: f32,
}

/// A way from a light or a lit surface, which takes `own` by itself with a density per solid angle; `None` if it is not aimed.
/// `choice` and `u` are random numbers.
pub fn from_place(
    prepared: &Prepared,
    aims: &Aims,
    light: &Vpl,
    own: (impl FnOnce() -> Vec3, impl Fn(Vec3) -> f32),
    (choice, u): (f32, [f32; 2]),
) -> Option<Aimed> {
    let share = aims.at_panes;
    if share <= 0.0 {
        return None;
    }
    let cones = prepared.panes.seen_from(light);
    if cones.is_empty() {
        return None;
    }
    let direction = if choice < share { cones.sample(choice / share, u) } else { own.0() };
    let density = own.1(direction);
    let natural = density / (share * cones.density(direction) + (1.0 - share) * density);
    let natural = if natural.is_finite() { natural } else { 0.0 };
    Some(Aimed { origin: light.position, direction, natural })
}

/// A way of parallel light into the scene; `None` if it is not aimed.
pub fn from_afar(prepared: &Prepared, aims: &Aims, light: &Vpl, [a, b, choice, other]: [f32; 4]) -> Option<Aimed> {
    let (share, balls, towards) = (aims.at_panes, prepared.panes.balls(), light.normal);
    if share <= 0.0 || balls.is_empty() || light.shape != Shape::Distant {
        return None;
    }
    let origin = if other < share {
        let chosen = (other / share * balls.len() as f32) as usize;
        aims.entry.through(balls[chosen.min(balls.len() - 1)], towards, [a, b])
    } else {
        aims.entry.sample(towards, [a, b, choice])
    };
    let density = aims.entry.density(origin, towards);
    let through: f32 = balls.iter().map(|ball| density_through(*ball, origin, towards)).sum();
    let natural = density / (share * through / balls.len() as f32 + (1.0 - share) * density);
    Some(Aimed { origin, direction: -towards, natural })
}

#[cfg(test)]
mod tests {
    use scenes::{Dielectric, Environment, Material, Mesh, Object, Scene, Surface};

    use super::*;
    use crate::aims::{Choice, Entry};
    use crate::targets::Ball;
    use crate::warp;

    /// Two panes and a plain under a sky.
    fn prepared() -> Prepared {
        let mut mesh = Mesh::default();
        let mut triangle = |corners: [Vec3; 3], material| {
            let first = mesh.positions.len() as u32;
            mesh.positions.extend(corners);
            mesh.triangles.push([first, first + 1, first + 2]);
            mesh.materials.push(material);
        };
        triangle([Vec3::new(-20.0, 0.0, -20.0), Vec3::Z * 40.0, Vec3::X * 40.0], 0);
        triangle([Vec3::Y, Vec3::new(0.3, 1.0, 0.0), Vec3::new(0.0, 1.5, 0.0)], 1);
        triangle([Vec3::new(2.0, 1.0, 1.0), Vec3::new(2.3, 1.0, 1.0), Vec3::new(2.0, 1.5, 1.0)], 1);
        let surface = Surface::Dielectric(Dielectric::clear(1.5, true));
        let pane = Material { surface, ..Material::diffuse("pane", Vec3::ZERO) };
        Prepared::new(Scene {
            meshes: vec![mesh.into()],
            objects: vec![Object::fixed("all", 0)],
            materials: vec![Material::diffuse("plain", Vec3::splat(0.5)), pane],
            environment: Environment::Constant(Vec3::ONE),
            ..Scene::default()
        })
    }

    fn random(i: u32) -> [f32; 4] {
        std::array::from_fn(|d| (crate::sample::mix(i * 4 + d as u32) >> 8) as f32 / 16_777_216.0)
    }

    /// What counts by the factor is distributed as if nothing were aimed; and much of it comes to panes.
    #[test]
    fn aimed_ways_count_for_as_much_as_those_that_are_not() {
        let prepared = prepared();
        assert_eq!(prepared.panes.balls().len(), 2);
        let entry = Entry::mostly(prepared.ball, Ball { centre: Vec3::Y, radius: 2.0 }, 0.75);
        let aims = Aims { choice: Choice::default(), entry, at_panes: 0.4 };
        let light = |position, normal, shape| Vpl {
            position,
            normal,
            strength: Vec3::ONE,
            shape,
            depth: 1,
            source: 0,
            density: None,
        };
        let place = light(Vec3::new(1.0, 0.0, 3.0), Vec3::Y, Shape::Surface);
        let afar = light(Vec3::ZERO, Vec3::new(0.48, 0.6, 0.64), Shape::Distant);
        let n = 200_000;
        for (light, what) in [(&place, "from a place"), (&afar, "from afar")] {
            // Of how much of it is there, of how much comes near a pane, and how often that is tried.
            let (mut all, mut near, mut tried, mut by_itself) = (0.0, 0.0, 0, 0);
            let comes_near = |origin: Vec3, direction: Vec3| prepared.panes.far_end(origin, direction) > 0.0;
            for i in 0..n {
                let u = random(i);
                let own = || warp::cosine(light.normal, [u[0], u[1]]);
                let density = |direction: Vec3| warp::cosine_density(light.normal.dot(direction));
                let (aimed, natural) = match light.shape {
                    Shape::Distant => {
                        let origin = aims.entry.sample(light.normal, [u[0], u[1], u[2]]);
                        (from_afar(&prepared, &aims, light, u), (origin, -light.normal))
                    }
                    _ => {
                        let choice = (u[3], [u[0], u[1]]);
                        (from_place(&prepared, &aims, light, (own, density), choice), (light.position, own()))
                    }
                };
                let aimed = aimed.expect("there are panes");
                all += f64::from(aimed.natural) / f64::from(n);
                if comes_near(aimed.origin, aimed.direction) {
                    near += f64::from(aimed.natural) / f64::from(n);
                    tried += 1;
                }
                by_itself += u32::from(comes_near(natural.0, natural.1));
            }
            let expected = f64::from(by_itself) / f64::from(n);
            assert!((all - 1.0).abs() < 0.01, "{what}: {all} of all");
            assert!((near / expected - 1.0).abs() < 0.05, "{what}: {near} near panes, {expected} by itself");
            assert!(tried > n * 2 / 5, "{what}: {tried} of {n}");
        }
    }

    #[test]
    fn nothing_is_aimed_where_that_is_not_wanted() {
        let prepared = prepared();
        let aims = Aims { entry: Entry::whole(prepared.ball), ..Aims::default() };
        let (position, normal, strength) = (Vec3::ZERO, Vec3::Y, Vec3::ONE);
        let light = Vpl { position, normal, strength, shape: Shape::Distant, depth: 0, source: 0, density: None };
        assert!(from_afar(&prepared, &aims, &light, [0.5; 4]).is_none());
    }
}
