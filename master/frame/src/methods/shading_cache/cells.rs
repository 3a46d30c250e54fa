//! What light is like about a place, roughly: so that patches of which nothing is known yet look like what is around them, and
//! what has more triangles than pixels is not asked about triangle by triangle.

use std::collections::BTreeMap;

use glam::Vec3;
use scenes::{Scene, SurfacePoint};

/// Means of light by object, side, direction and place.
#[derive(Clone, Debug, Default)]
pub(super) struct Cells {
    /// Width of a cell, scene units; 0: nothing is kept.
    width: f32,
    cells: BTreeMap<Cell, Mean>,
}

/// Where something lies, and which way it faces.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Cell {
    object: u32,
    material: u32,
    /// Of six directions, the one that its visible side faces.
    facing: u8,
    at: [i32; 3],
}

#[derive(Clone, Copy, Debug, Default)]
struct Mean {
    light: Vec3,
    count: f32,
}

/// Cells along the longest side of the scene.
const ALONG: f32 = 64.0;
/// Values that a mean is made of at most: older ones fade.
const COUNT_MAX: f32 = 8.0;
/// Cells at most; then all begin again.
const CELLS_MAX: usize = 1 << 18;

impl Cells {
    /// Nothing known of a scene.
    pub fn of(scene: &Scene) -> Self {
        let (mut low, mut high) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
        for object in scene.objects.iter().filter(|object| object.visible) {
            for at in &scene.meshes[object.mesh as usize].positions {
                let at = object.scene_from_object.point(*at);
                (low, high) = (low.min(at), high.max(at));
            }
        }
        let longest = (high - low).max_element();
        Self { width: if longest.is_finite() { longest / ALONG } else { 0.0 }, cells: BTreeMap::new() }
    }

    /// Nothing is known any more, of the same scene.
    pub fn clear(&mut self) {
        self.cells.clear();
    }

    /// The cell that a point lies in, as the scene stands; `None` if it is not in it.
    pub fn cell(&self, scene: &Scene, point: &SurfacePoint) -> Option<Cell> {
        let number = scene.find_point(point).ok()?;
        let object = &scene.objects[number];
        let mesh = &*scene.meshes[object.mesh as usize];
        let corners = mesh.triangles[point.triangle as usize];
        let [a, b, c] = corners.map(|vertex| object.scene_from_object.point(mesh.positions[vertex as usize]));
        let size = (b - a).abs().max_element().max((c - a).abs().max_element());
        let normal = ((b - a) / size).cross((c - a) / size) * if point.back { -1.0 } else { 1.0 };
        let axis = normal.abs().max_position();
        let facing = 2 * axis as u8 + u8::from(normal[axis] < 0.0);
        let [u, v] = point.uv;
        let place = (a * (1.0 - u - v) + b * u + c * v) / self.width.max(f32::MIN_POSITIVE);
        // Casts saturate.
        let at = place.to_array().map(|along| along.floor() as i32);
        Some(Cell { object: point.object, material: scene.material_of(number, point.triangle as usize), facing, at })
    }

    /// Light of a point that is known.
    pub fn add(&mut self, cell: Cell, light: Vec3) {
        if self.cells.len() >= CELLS_MAX {
            self.cells.clear();
        }
        let mean = self.cells.entry(cell).or_default();
        mean.count = (mean.count + 1.0).min(COUNT_MAX);
        mean.light += (light - mean.light) / mean.count;
    }

    /// What light there is likely to be.
    pub fn guess(&self, cell: Cell) -> Option<Vec3> {
        self.cells.get(&cell).map(|mean| mean.light)
    }
}
