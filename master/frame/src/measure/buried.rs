//! Points of a grid at which there is nothing to measure: within furniture, or so close under a surface that no meter fits
//! between.
//!
//! **The rule.** A point is within a body if triangles that share vertex positions close around it without a gap (every
//! edge has an even number of them). A body that holds the camera, a lamp, or every point of the grid is a room, and is
//! measured in. A point is under a surface if one that light does not pass is less than [`GAP`] before it, on the side
//! that is measured.

use std::collections::{BTreeSet, HashMap, HashSet};

use glam::{DVec2, DVec3, Vec3};
use scenes::{Light, Material, Mesh, Pieces, Scene, Surface};

use super::Grid;
use super::plan::barycentric;

/// Metres: an illuminance meter is no flatter.
pub(super) const GAP: f64 = 0.02;
/// Metres: what is no further from a point is the surface that it lies on.
const SKIN: f64 = 1e-4;
/// Points are looked at so far aside, in cells: no line through one runs along the edge of a triangle.
const ASIDE: [f64; 2] = [1.4e-6, 0.9e-6];

/// Which points are buried, by cell. `places` are theirs, `normal` is the side that is measured.
pub(super) fn buried(scene: &Scene, grid: &Grid, normal: DVec3, places: &[Option<DVec3>], metre: f64) -> Vec<bool> {
    let aside = [0, 1].map(|axis| grid.axes[axis] * grid.spacing()[axis] * ASIDE[axis]);
    let lift = normal * (SKIN / metre) + aside[0] + aside[1];
    let look = Look { grid, normal, probes: places.iter().map(|place| place.map(|place| place + lift)).collect() };
    let mut buried = vec![false; places.len()];
    let mut shells_of = HashMap::new();
    for (number, object) in scene.objects.iter().enumerate().filter(|(_, object)| object.visible) {
        let mesh = &scene.meshes[object.mesh as usize];
        let place = |corner: u32| object.scene_from_object.point(mesh.positions[corner as usize]).as_dvec3();
        let shells = shells_of.entry(object.mesh).or_insert_with(|| Pieces::shells(mesh));
        let mut odd = vec![BTreeSet::new(); shells.count()];
        let mut own = vec![Vec::new(); shells.count()];
        for triangle in scene.triangles(number) {
            let corners = mesh.triangles[triangle].map(place);
            let shell = shells.of_triangle(triangle) as usize;
            let stops_light = stops_light(&scene.materials[scene.material_of(number, triangle) as usize]);
            own[shell].push(triangle);
            for (cell, height) in look.above(corners) {
                buried[cell] |= stops_light && height < GAP / metre;
                if !odd[shell].remove(&cell) {
                    odd[shell].insert(cell);
                }
            }
        }
        for (within, triangles) in odd.into_iter().zip(own) {
            if within.is_empty() || !is_closed(mesh, &triangles) {
                continue;
            }
            let body: Vec<[DVec3; 3]> = triangles.iter().map(|triangle| mesh.triangles[*triangle].map(place)).collect();
            let is_occupied =
                || occupants(scene, number, &triangles).any(|at| look.is_within(&body, at + aside[0] + aside[1]));
            if within.len() < look.probes.iter().flatten().count() && !is_occupied() {
                within.into_iter().for_each(|cell| buried[cell] = true);
            }
        }
    }
    buried
}

/// The points of the grid, each as it looks along the normal.
struct Look<'a> {
    grid: &'a Grid,
    normal: DVec3,
    probes: Vec<Option<DVec3>>,
}

impl Look<'_> {
    fn flat(&self, place: DVec3) -> DVec2 {
        DVec2::new(place.dot(self.grid.axes[0]), place.dot(self.grid.axes[1]))
    }

    /// The points that a triangle is straight above of, and how high.
    fn above(&self, corners: [DVec3; 3]) -> Vec<(usize, f64)> {
        let (origin, spacing) = (self.flat(self.grid.origin), self.grid.spacing());
        let flat = corners.map(|corner| self.flat(corner) - origin);
        let cells = [0, 1].map(|axis| {
            let along = flat.map(|corner| corner[axis] / spacing[axis] - 0.5);
            let [low, high] = [along[0].min(along[1]).min(along[2]), along[0].max(along[1]).max(along[2])];
            // One more on either side: points are looked at aside. Casts saturate.
            let first = (low.floor().max(0.0) as usize).saturating_sub(1);
            let end = ((high.ceil() + 2.0).max(0.0) as usize).min(self.grid.counts[axis]);
            first..end
        });
        let [columns, rows] = cells;
        let numbers = rows.flat_map(|row| columns.clone().map(move |column| row * self.grid.counts[0] + column));
        numbers.filter_map(|cell| Some((cell, self.height(corners, self.probes[cell]?)?))).collect()
    }

    /// How high a triangle is above a place; `None` where it is not.
    fn height(&self, corners: [DVec3; 3], at: DVec3) -> Option<f64> {
        let [u, v] = barycentric(self.flat(at), corners.map(|corner| self.flat(corner)))?;
        let [a, b, c] = corners;
        let height = (a * (1.0 - u - v) + b * u + c * v - at).dot(self.normal);
        (height > 0.0).then_some(height)
    }

    /// Whether a place is within a body.
    fn is_within(&self, body: &[[DVec3; 3]], at: DVec3) -> bool {
        body.iter().filter(|corners| self.height(**corners, at).is_some()).count() % 2 == 1
    }
}

/// Where the camera is, and whatever shines that is no part of a body itself.
fn occupants<'a>(scene: &'a Scene, body: usize, own: &'a [usize]) -> impl Iterator<Item = DVec3> + use<'a> {
    let lamps = scene.lights.iter().filter_map(|light| match light {
        Light::Point { position, .. } | Light::Spot { position, .. } | Light::Luminaire { position, .. } => {
            Some(*position)
        }
        Light::Directional { .. } => None,
    });
    let visible = scene.objects.iter().enumerate().filter(|(_, object)| object.visible);
    let glows = visible.flat_map(move |(number, object)| {
        let mesh = &scene.meshes[object.mesh as usize];
        let shines =
            move |triangle: &usize| !scene.materials[scene.material_of(number, *triangle) as usize].emission.is_black();
        let others = move |triangle: &usize| number != body || own.binary_search(triangle).is_err();
        scene.triangles(number).filter(shines).filter(others).map(move |triangle| {
            let [a, b, c] = mesh.triangles[triangle].map(|corner| mesh.positions[corner as usize]);
            object.scene_from_object.point((a + b + c) / 3.0)
        })
    });
    std::iter::once(scene.camera.origin).chain(lamps).chain(glows).map(|place| place.as_dvec3())
}

/// No light passes where it is.
fn stops_light(material: &Material) -> bool {
    let passes =
        matches!(material.surface, Surface::Dielectric(_) | Surface::Glazed { .. } | Surface::Translucent { .. });
    material.coverage.is_none() && !passes
}

/// Every edge, by the positions of its ends, has an even number of triangles.
fn is_closed(mesh: &Mesh, triangles: &[usize]) -> bool {
    let mut open = HashSet::new();
    for triangle in triangles {
        // Adding zero makes one zero of the two.
        let place = |corner: u32| (mesh.positions[corner as usize] + Vec3::ZERO).to_array().map(f32::to_bits);
        let [a, b, c] = mesh.triangles[*triangle].map(place);
        for (from, to) in [(a, b), (b, c), (c, a)].into_iter().filter(|(from, to)| from != to) {
            let edge = (from.min(to), from.max(to));
            if !open.remove(&edge) {
                open.insert(edge);
            }
        }
    }
    open.is_empty()
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use scenes::{Camera, Coverage, Object};

    use super::super::{Plan, Target, plan};
    use super::*;

    /// A box of twelve triangles, without its lid if it is open.
    fn block(low: [f32; 3], high: [f32; 3], material: u32, is_open: bool) -> Mesh {
        let corner = |number: u32| {
            let side = |axis: usize| if number >> axis & 1 == 0 { low[axis] } else { high[axis] };
            Vec3::new(side(0), side(1), side(2))
        };
        let mut quads = vec![[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [0, 2, 3, 1], [4, 5, 7, 6]];
        if !is_open {
            quads.push([2, 6, 7, 3]);
        }
        let triangles: Vec<_> = quads.iter().flat_map(|[a, b, c, d]| [[*a, *b, *c], [*a, *c, *d]]).collect();
        let materials = vec![material; triangles.len()];
        Mesh { positions: (0..8).map(corner).collect(), triangles, materials, ..Mesh::default() }
    }

    /// A closed room of 4 m × 2.5 m × 4 m seen from outside, a lamp in it; and things.
    fn room(things: impl IntoIterator<Item = Mesh>) -> Scene {
        let mut scene = Scene {
            materials: vec![
                Material::diffuse("wood", Vec3::ONE),
                Material { coverage: Some(Coverage::plain(0.5)), ..Material::diffuse("gauze", Vec3::ONE) },
            ],
            lights: vec![Light::Point { position: Vec3::new(2.0, 2.2, 2.0), intensity: Vec3::ONE }],
            light_names: vec!["lamp".into()],
            camera: Camera { origin: Vec3::new(2.0, 1.5, 9.0), target: Vec3::new(2.0, 1.0, 0.0), ..Camera::default() },
            ..Scene::default()
        };
        for mesh in [block([0.0; 3], [4.0, 2.5, 4.0], 0, false)].into_iter().chain(things) {
            scene.objects.push(Object::fixed(format!("thing {}", scene.meshes.len()), scene.meshes.len() as u32));
            scene.meshes.push(Arc::new(mesh));
        }
        scene
    }

    const AREA: [f64; 4] = [0.0, 0.0, 4.0, 4.0];
    /// A cupboard's floor.
    const CUPBOARD: [f64; 4] = [1.0, 0.5, 2.0, 3.0];

    fn at_height(scene: &Scene, height: f64) -> Plan {
        plan(scene, &Target::Plane { height, area: Some(AREA) }, 0.0, 1.0).unwrap().1
    }

    /// The points that have something in their way are those over a rectangle x, z, x, z.
    fn assert_gone(plan: &Plan, [x, z, to_x, to_z]: [f64; 4]) {
        for (number, point) in plan.points.iter().enumerate() {
            let place = plan.grid.point(number);
            let is_in = place.x > x && place.x < to_x && place.z > z && place.z < to_z;
            assert_eq!(point.is_none(), is_in, "{place}");
        }
        assert_eq!(plan.buried, plan.points.iter().filter(|point| point.is_none()).count());
        assert!(plan.buried > 0);
    }

    #[test]
    fn what_is_within_furniture_is_left_out_and_a_room_is_none() {
        let cupboard = || block([1.0, 0.0, 0.5], [2.0, 1.8, 3.0], 0, false);
        assert_gone(&at_height(&room([cupboard()]), 0.8), CUPBOARD);
        // Its own bottom lies on the floor, where the grid lies as well.
        assert_gone(&at_height(&room([cupboard()]), 0.0), CUPBOARD);
        assert_eq!(at_height(&room([cupboard()]), 2.0).buried, 0, "above it");
        // Whichever way its triangles look.
        let mut inside_out = cupboard();
        inside_out.triangles.iter_mut().for_each(|triangle| triangle.swap(1, 2));
        assert_gone(&at_height(&room([inside_out]), 0.8), CUPBOARD);
        // What is open can be looked into, and a lamp within makes a lantern.
        assert_eq!(at_height(&room([block([1.0, 0.0, 0.5], [2.0, 1.8, 3.0], 0, true)]), 0.8).buried, 0);
        let mut lit = room([cupboard()]);
        lit.lights.push(Light::Point { position: Vec3::new(1.5, 1.0, 1.0), intensity: Vec3::ONE });
        lit.light_names.push("within".into());
        assert_eq!(at_height(&lit, 0.8).buried, 0);
        // Alone with the grid, it is what is measured.
        let inside = Target::Plane { height: 0.8, area: Some(CUPBOARD) };
        assert_eq!(plan(&room([cupboard()]), &inside, 0.1, 1.0).unwrap().1.buried, 0);
    }

    #[test]
    fn no_meter_fits_under_a_sheet_that_is_too_close() {
        let sheet = |height: f32, material: u32| Mesh {
            positions: [[1.0, 0.5], [2.0, 0.5], [2.0, 3.0], [1.0, 3.0]].map(|[x, z]| Vec3::new(x, height, z)).to_vec(),
            triangles: vec![[0, 1, 2], [0, 2, 3]],
            materials: vec![material; 2],
            ..Mesh::default()
        };
        assert_gone(&at_height(&room([sheet(0.81, 0)]), 0.8), CUPBOARD);
        for (height, material) in [(0.83, 0), (0.81, 1), (0.79, 0)] {
            assert_eq!(at_height(&room([sheet(height, material)]), 0.8).buried, 0, "{height}, {material}");
        }
        // A unit of a millimetre: 10 m above.
        let (_, plan) =
            plan(&room([sheet(0.81, 0)]), &Target::Plane { height: 0.8, area: Some(AREA) }, 0.0, 1000.0).unwrap();
        assert_eq!(plan.buried, 0);
        let floor = Target::Surface { name: "thing 1".into(), above: 0.0 };
        let refused = super::super::plan(&room([sheet(0.8, 0), sheet(0.805, 0)]), &floor, 0.0, 1.0).unwrap_err();
        assert!(refused.contains("less than 0.02 m"), "{refused}");
    }
}
