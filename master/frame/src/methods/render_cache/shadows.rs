//! What a lamp sees, so what it lights (Williams 1978): depths on the faces of a cube around it, found by the master's own
//! rasteriser. Nothing is asked.

use glam::Vec3;
use scenes::camera::Lens;
use scenes::{Camera, Coverage, Scene};

use crate::parts::raster::Raster;

/// See the module's documentation.
#[derive(Clone, Debug)]
pub(super) struct ShadowMap {
    faces: Vec<Face>,
}

#[derive(Clone, Debug)]
struct Face {
    lens: Lens,
    forward: Vec3,
    /// Along the middle of the view, over 1; 0 where nothing is.
    inverse_depths: Vec<f32>,
}

/// Pixels along a face.
const SIDE: u32 = 128;
/// Its share is that of the pixels around: no farther than this, so that edges are soft.
const REACH: i32 = 2;
/// A place is lit if it lies behind what is seen by no more than this share of its distance, after it was lifted off its
/// surface by so many pixels of the map.
const BEHIND: f32 = 0.01;
const LIFTED: f32 = 2.0;

/// The scene with everything that shines taken away: lamps are in nobody's way, least of all in their own.
pub(super) fn without_lamps(scene: &Scene) -> Scene {
    let mut scene = scene.clone();
    for material in scene.materials.iter_mut().filter(|material| !material.emission.is_black()) {
        material.coverage = Some(Coverage::plain(0.0));
    }
    scene
}

impl ShadowMap {
    /// Of a lamp there that shines to one side of a plane, or for zero all around. `scene` is one [`without_lamps`].
    pub fn new(scene: &Scene, position: Vec3, normal: Vec3, raster: &mut Raster) -> Self {
        let axes = [Vec3::X, Vec3::NEG_X, Vec3::Y, Vec3::NEG_Y, Vec3::Z, Vec3::NEG_Z];
        // Of faces behind the plane not even an edge is lit.
        let is_lit = |axis: &Vec3| normal == Vec3::ZERO || axis.dot(normal) > -0.999;
        let faces = axes.into_iter().filter(is_lit).map(|axis| {
            let up = if axis.y == 0.0 { Vec3::Y } else { Vec3::Z };
            let (origin, target) = (position, position + axis);
            let camera = Camera { origin, target, up, fov_y_deg: 90.0, width: SIDE, height: SIDE, ..Camera::default() };
            raster.draw(scene, &camera);
            let lens = camera.lens();
            Face { lens, forward: lens.axes()[2], inverse_depths: raster.inverse_depths().to_vec() }
        });
        Self { faces: faces.collect() }
    }

    /// How much of the lamp a place sees, 0..=1; what no face shows is lit.
    pub fn lit(&self, at: Vec3, normal: Vec3) -> f32 {
        let Some(face) = self.faces.iter().max_by(|a, b| a.along(at).total_cmp(&b.along(at))) else { return 1.0 };
        let at = at + normal * (face.along(at) * face.lens.pixel() * LIFTED);
        let Some((x, y, _)) = face.lens.project(at) else { return 1.0 };
        let depth = face.along(at);
        let (column, row) = (x as i32, y as i32);
        let side = SIDE as i32;
        let (mut lit, mut all) = (0, 0);
        for y in (row - REACH).max(0)..(row + REACH + 1).min(side) {
            for x in (column - REACH).max(0)..(column + REACH + 1).min(side) {
                let nearest = face.inverse_depths[(y * side + x) as usize];
                lit += i32::from(nearest * depth <= 1.0 + BEHIND);
                all += 1;
            }
        }
        if all == 0 { 1.0 } else { lit as f32 / all as f32 }
    }
}

impl Face {
    fn along(&self, at: Vec3) -> f32 {
        (at - self.lens.origin()).dot(self.forward)
    }
}
