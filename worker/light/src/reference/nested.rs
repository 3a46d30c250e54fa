//! Glass in glass, for the path tracer: what a path is in, remembered from boundary to boundary.
//!
//! Schmidt and Budge, "Simple Nested Dielectrics in Ray Traced Images" (2002): of all solids that a point is within, the one of
//! the highest priority is there; a boundary within a higher one is none. [`crate::prepared`] finds the same at each place by
//! a ray instead; here it follows from the way.

use glam::Vec3;
use scenes::{Dielectric, Rgb, Scene, Surface};

use crate::bvh::Ray;
use crate::prepared::Prepared;
use crate::surface::{Around, Scatter, Surfel};

/// The solids with a priority that a path is within, by material, in no order.
#[derive(Clone, Default)]
pub struct Interior(Vec<u32>);

impl Interior {
    /// Of a path that begins somewhere: solids that are left on the way out of the scene and were not entered there.
    pub fn at(prepared: &Prepared, origin: Vec3, direction: Vec3) -> Self {
        let mut found = Self::default();
        if !prepared.needs.nesting() {
            return found;
        }
        let mut entered = Vec::new();
        let mut ray = Ray { origin, direction, t_max: f32::INFINITY };
        for _ in 0..STEPS_MAX {
            let Some(hit) = prepared.world.closest(&ray) else { break };
            let at = prepared.surfel(&ray, &hit);
            ray.origin = at.off(direction);
            if solid(&prepared.scene, at.material).is_some() && !entered.contains(&at.material) {
                entered.push(at.material);
                if !at.front {
                    found.0.push(at.material);
                }
            }
        }
        found
    }

    /// How a surface scatters for a path that is here.
    pub fn scatter(&self, scene: &Scene, at: &Surfel) -> Scatter {
        // As if in air.
        let alone = Surfel { around: Around::default(), ..*at }.scatter(scene);
        let Some(own) = solid(scene, at.material) else { return alone };
        let Some((other, glass)) = self.highest(scene, Some(at.material)) else { return alone };
        if outranks((other, glass), (at.material, own)) {
            return match alone {
                Scatter::Glass { .. } | Scatter::Frosted(_) => {
                    Scatter::Glass { ior: 1.0, transmittance: Vec3::ONE, thin: false }
                }
                opaque => opaque,
            };
        }
        match alone {
            Scatter::Glass { ior, transmittance, thin } => Scatter::Glass { ior: ior / glass.ior, transmittance, thin },
            Scatter::Frosted(mut frosted) => {
                frosted.ior /= glass.ior;
                Scatter::Frosted(frosted)
            }
            opaque => opaque,
        }
    }

    /// The path goes on from a surface in some direction.
    pub fn pass(&mut self, scene: &Scene, at: &Surfel, direction: Vec3) {
        if solid(scene, at.material).is_none() || at.geometric.dot(direction) >= 0.0 {
            return;
        }
        self.0.retain(|material| *material != at.material);
        if at.front {
            self.0.push(at.material);
        }
    }

    /// σ of what the path is in; `None` if that is no solid with a priority.
    pub fn absorption(&self, scene: &Scene) -> Option<Rgb> {
        self.highest(scene, None).map(|(_, glass)| glass.absorption)
    }

    fn highest<'s>(&self, scene: &'s Scene, but: Option<u32>) -> Option<(u32, &'s Dielectric)> {
        let others = self.0.iter().filter(|material| Some(**material) != but);
        let glasses = others.filter_map(|material| Some((*material, solid(scene, *material)?)));
        glasses.reduce(|best, next| if outranks(next, best) { next } else { best })
    }
}

/// Surfaces on a straight way that are looked at to find out what the eye is in, at most.
const STEPS_MAX: usize = 4096;

fn outranks(one: (u32, &Dielectric), other: (u32, &Dielectric)) -> bool {
    one.1.priority > other.1.priority || one.1.priority == other.1.priority && one.0 < other.0
}

/// The glass of a solid with a priority.
fn solid(scene: &Scene, material: u32) -> Option<&Dielectric> {
    match &scene.materials[material as usize].surface {
        Surface::Dielectric(glass) | Surface::Glazed { glass, .. } if !glass.thin && glass.priority > 0 => Some(glass),
        _ => None,
    }
}
