//! What pixels see, exactly: found by the master itself, so that edges, textures and what shines are sharp however roughly the
//! points of the cache lie, and light is interpolated where it varies slowly.

use std::f32::consts::FRAC_1_PI;

use glam::Vec3;
use rayon::prelude::*;
use scenes::{Camera, Scene};

use crate::parts::raster::{Hit, Raster};
use crate::parts::{Appearance, Finish, sky};

/// See the module's documentation.
#[derive(Clone, Debug, Default)]
pub(super) struct Guide {
    raster: Raster,
    /// Of each pixel; `None`: what is seen there is neither matt nor the sky, so only points can tell.
    pub exact: Vec<Option<Exact>>,
}

/// What the middle of a pixel sees, if it is matt.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Exact {
    /// Where, in the scene.
    pub position: Vec3,
    /// Towards the eye, of unit length.
    pub normal: Vec3,
    /// From the eye; 0: it is the sky.
    pub distance: f32,
    emission: Vec3,
    colour: Vec3,
}

impl Guide {
    /// Finds what a camera sees.
    pub fn look(&mut self, scene: &Scene, camera: &Camera) {
        let Self { raster, exact } = self;
        raster.draw(scene, camera);
        let (lens, width, raster) = (camera.lens(), raster.width(), &*raster);
        let see = |pixel: usize| {
            let direction = lens.direction((pixel % width) as f32 + 0.5, (pixel / width) as f32 + 0.5);
            let Some(hit) = raster.hit(pixel) else {
                let (emission, normal) = (sky(scene, direction), Vec3::ZERO);
                return Some(Exact { position: direction, normal, distance: 0.0, emission, colour: Vec3::ZERO });
            };
            let Appearance { emission, colour, finish } = Appearance::of(scene, &hit);
            let distance = hit.depth / direction.dot(lens.axes()[2]);
            let position = lens.origin() + direction * distance;
            let normal = normal(scene, &hit);
            let normal = if normal.dot(direction) > 0.0 { -normal } else { normal };
            (finish == Finish::Matt && normal != Vec3::ZERO).then_some(Exact {
                position,
                normal,
                distance,
                emission,
                colour,
            })
        };
        exact.clear();
        exact.par_extend((0..width * raster.height()).into_par_iter().with_min_len(1024).map(see));
    }
}

impl Exact {
    /// What is seen is not lit by anything, but shines as it does.
    pub fn is_sky(&self) -> bool {
        self.distance == 0.0
    }

    /// Radiance towards the eye, lit by so much.
    pub fn radiance(&self, irradiance: Vec3) -> Vec3 {
        self.emission + self.colour * irradiance * FRAC_1_PI
    }
}

/// The normal that light is reflected by; of unit length, towards either side.
fn normal(scene: &Scene, hit: &Hit) -> Vec3 {
    let object = &scene.objects[hit.object as usize];
    let (mesh, linear) = (&*scene.meshes[object.mesh as usize], object.scene_from_object.linear);
    let corners = mesh.triangles[hit.triangle as usize].map(|vertex| vertex as usize);
    let [u, v] = hit.uv;
    let [a, b, c] = corners.map(|vertex| mesh.normals.get(vertex).copied().unwrap_or_default());
    let smooth = a * (1.0 - u - v) + b * u + c * v;
    let flat = || {
        let [a, b, c] = corners.map(|vertex| mesh.positions[vertex]);
        // As large as one, whatever the size of the triangle.
        let size = (b - a).abs().max_element().max((c - a).abs().max_element());
        ((b - a) / size).cross((c - a) / size)
    };
    let normal = if smooth == Vec3::ZERO { flat() } else { smooth };
    if object.scene_from_object.is_identity() {
        return normal.normalize_or_zero();
    }
    (linear.inverse().transpose() * normal).normalize_or_zero()
}
