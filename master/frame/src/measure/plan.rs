//! Where light is measured: a grid on a horizontal plane, or on a surface of the scene and as far above it as people want.
//!
//! A plane in the air is a sheet of which nothing is there ([`Coverage`] 0): all light passes it, and its points can be lit.

use std::sync::Arc;

use glam::{DVec2, DVec3, Vec3};
use scenes::{Coverage, Material, Mesh, Object, Scene, SurfacePoint};

use super::Grid;
use super::buried::{GAP, buried};
use super::grid::counts;

/// What is measured. Lengths are metres, but for heights of planes and their areas, which are numbers of the scene's file.
#[derive(Clone, Debug, PartialEq)]
pub enum Target {
    /// A horizontal plane, seen from above.
    Plane {
        /// Along the camera's upright, in the file's space.
        height: f64,
        /// Two opposite corners of the area in the file's space, along the two other axes; `None`: all of the scene.
        area: Option<[f64; 4]>,
    },
    /// What has this name: objects, or else materials.
    Surface {
        /// As in the file.
        name: String,
        /// How far above the surface.
        above: f64,
    },
}

/// A grid, and the points of it that are measured.
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    /// Where cells lie.
    pub grid: Grid,
    /// Metres of a unit of the scene.
    pub metre: f64,
    /// The point of each cell; `None` where the surface is not, or is buried.
    pub points: Vec<Option<SurfacePoint>>,
    /// How many cells have no point because it would be within furniture, or too close under something.
    pub buried: usize,
    /// Rows are counted upwards, as on a wall; else towards the viewer, as on a map.
    pub rises: bool,
}

/// Plans a measurement: the scene with a sheet in it, if one is needed, and the points. `border` metres along the area's edges
/// are left out; a unit of the scene is `metre` metres.
///
/// # Errors
/// In words, what is wrong with the target.
pub fn plan(scene: &Scene, target: &Target, border: f64, metre: f64) -> Result<(Scene, Plan), String> {
    let up = upright(scene);
    let mut scene = scene.clone();
    let (mut plan, hidden) = match target {
        Target::Plane { height, area } => {
            let grid = horizontal(&scene, up, *height, *area, border, metre)?;
            let places: Vec<_> = (0..grid.len()).map(|number| Some(grid.point(number))).collect();
            let hidden = buried(&scene, &grid, up, &places, metre);
            let points = sheet(&mut scene, &grid, up).into_iter().map(Some).collect();
            (Plan { grid, metre, points, buried: 0, rises: false }, hidden)
        }
        Target::Surface { name, above } => {
            let facets = facets(&scene, name)?;
            let (grid, normal, hits) = on_surface(&scene, &facets, up, border / metre, metre)?;
            let place = |number: usize| match *above > 0.0 {
                true => hits[number].map(|_| grid.point(number) + normal * (above / metre)),
                false => hits[number].and_then(|hit| scene.place(&hit).ok()).map(|place| place.as_dvec3()),
            };
            let places: Vec<_> = (0..grid.len()).map(place).collect();
            let hidden = buried(&scene, &grid, normal, &places, metre);
            let points = match *above > 0.0 {
                true => {
                    let lifted = Grid { origin: grid.origin + normal * (above / metre), ..grid };
                    let sheet = sheet(&mut scene, &lifted, normal);
                    sheet.into_iter().zip(&hits).map(|(point, hit)| hit.map(|_| point)).collect()
                }
                false => hits,
            };
            (Plan { grid, metre, points, buried: 0, rises: normal != up }, hidden)
        }
    };
    if plan.points.iter().all(Option::is_none) {
        return Err("no point of the grid lies on the surface: it is too narrow for its own grid".into());
    }
    for (point, _) in plan.points.iter_mut().zip(hidden).filter(|(point, is_hidden)| *is_hidden && point.is_some()) {
        *point = None;
        plan.buried += 1;
    }
    if plan.points.iter().all(Option::is_none) {
        return Err(format!("every point of the grid is within furniture, or less than {GAP} m under something"));
    }
    Ok((scene, plan))
}

/// The axis that is upright for the camera, on its side.
fn upright(scene: &Scene) -> DVec3 {
    let up = scene.camera.up;
    let axis = up.abs().max_position();
    let mut upright = DVec3::ZERO;
    upright[axis] = f64::from(up[axis].signum());
    upright
}

/// The two axes beside the upright, such that the first goes right and the second towards the viewer where it is up.
fn beside(up: DVec3) -> [DVec3; 2] {
    let first = if up.x == 0.0 { DVec3::X } else { DVec3::Y };
    [first, first.cross(up)]
}

fn horizontal(
    scene: &Scene,
    up: DVec3,
    height: f64,
    area: Option<[f64; 4]>,
    border: f64,
    metre: f64,
) -> Result<Grid, String> {
    let axes = beside(up);
    let centre = [0, 1].map(|axis| scene.centre.dot(axes[axis]));
    let corners = match area {
        Some([a, b, c, d]) => {
            // Axes may run against the file's.
            let signs = axes.map(|axis| axis.element_sum());
            let along = |axis: usize, from: f64, to: f64| [from, to].map(|at| at * signs[axis] - centre[axis]);
            [along(0, a, c), along(1, b, d)]
        }
        None => {
            let all = bounds(scene, axes);
            if all[0][0] > all[0][1] {
                return Err("nothing of the scene is visible".into());
            }
            all
        }
    };
    let [low, sides] = inset(corners, border / metre)?;
    let height = height - scene.centre.dot(up.abs());
    let origin = axes[0] * low[0] + axes[1] * low[1] + up.abs() * height;
    Ok(Grid { origin, axes, sides, counts: counts(sides.map(|side| side * metre)) })
}

/// How far the visible scene reaches along two axes.
fn bounds(scene: &Scene, axes: [DVec3; 2]) -> [[f64; 2]; 2] {
    let mut bounds = [[f64::INFINITY, f64::NEG_INFINITY]; 2];
    for (number, object) in scene.objects.iter().enumerate().filter(|(_, object)| object.visible) {
        let mesh = &scene.meshes[object.mesh as usize];
        for corner in scene.triangles(number).flat_map(|triangle| mesh.triangles[triangle]) {
            let place = object.scene_from_object.point(mesh.positions[corner as usize]).as_dvec3();
            widen(&mut bounds, [place.dot(axes[0]), place.dot(axes[1])]);
        }
    }
    bounds
}

fn widen(bounds: &mut [[f64; 2]; 2], place: [f64; 2]) {
    for (bound, at) in bounds.iter_mut().zip(place) {
        *bound = [bound[0].min(at), bound[1].max(at)];
    }
}

/// Lower corner and sides of a rectangle without its border.
fn inset(corners: [[f64; 2]; 2], border: f64) -> Result<[[f64; 2]; 2], String> {
    let low = corners.map(|[a, b]| a.min(b) + border);
    let high = corners.map(|[a, b]| a.max(b) - border);
    let sides = [high[0] - low[0], high[1] - low[1]];
    // Also of numbers that are none.
    let is_area = sides.iter().all(|side| *side > 0.0 && side.is_finite());
    if is_area { Ok([low, sides]) } else { Err("nothing is left of the area within its border".into()) }
}

/// A triangle of the surface that is measured, scene space.
struct Facet {
    whole: u32,
    triangle: u32,
    corners: [DVec3; 3],
}

impl Facet {
    /// Twice its area along its normal, counter-clockwise.
    fn normal(&self) -> DVec3 {
        let [a, b, c] = self.corners;
        (b - a).cross(c - a)
    }
}

/// The visible triangles of the objects of a name, or else those of materials of that name.
fn facets(scene: &Scene, name: &str) -> Result<Vec<Facet>, String> {
    let all = |wanted: &dyn Fn(usize, usize) -> bool| {
        let mut facets = Vec::new();
        for (number, object) in scene.objects.iter().enumerate().filter(|(_, object)| object.visible) {
            let mesh = &scene.meshes[object.mesh as usize];
            for triangle in scene.triangles(number).filter(|triangle| wanted(number, *triangle)) {
                let place = |corner: u32| object.scene_from_object.point(mesh.positions[corner as usize]).as_dvec3();
                facets.push(Facet {
                    whole: scene.whole_of(number as u32),
                    triangle: triangle as u32,
                    corners: mesh.triangles[triangle].map(place),
                });
            }
        }
        facets
    };
    let of_object = all(&|object, _| scene.objects[scene.whole_of(object as u32) as usize].name == name);
    if !of_object.is_empty() {
        return Ok(of_object);
    }
    let material =
        |object: usize, triangle: usize| scene.materials[scene.material_of(object, triangle) as usize].name == name;
    let of_material = all(&material);
    if of_material.is_empty() { Err(unknown(scene, name)) } else { Ok(of_material) }
}

fn unknown(scene: &Scene, name: &str) -> String {
    let objects = scene.objects[..scene.wholes()].iter().map(|object| object.name.as_str());
    let names = objects.chain(scene.materials.iter().map(|material| material.name.as_str()));
    let mut names: Vec<_> = names.filter(|name| !name.is_empty()).collect();
    names.dedup();
    let more = if names.len() > NAMED_MAX { ", …" } else { "" };
    let some = names.iter().take(NAMED_MAX).copied().collect::<Vec<_>>().join(", ");
    format!("no visible object or material is called `{name}`; there are: {some}{more}")
}

/// So many names are offered.
const NAMED_MAX: usize = 30;
/// Facets of a surface are within this angle of its largest one: the cosine of 15°.
const ALIKE: f64 = 0.965_925_826;

/// The grid over the surface, its normal, and the uppermost place of the surface under each point.
fn on_surface(
    scene: &Scene,
    facets: &[Facet],
    up: DVec3,
    border: f64,
    metre: f64,
) -> Result<(Grid, DVec3, Vec<Option<SurfacePoint>>), String> {
    let largest = facets.iter().max_by(|a, b| a.normal().length().total_cmp(&b.normal().length()));
    let largest = largest.ok_or("the surface has no area")?;
    let along = largest.normal().try_normalize().ok_or("the surface has no area")?;
    // What lies is measured from above, what stands from where the camera is.
    let lies = along.dot(up).abs() > ALIKE;
    let to_camera = scene.camera.origin.as_dvec3() - largest.corners[0];
    let (normal, axes) = if lies {
        (up, beside(up))
    } else {
        let normal = if along.dot(to_camera) < 0.0 { -along } else { along };
        let across = up.cross(normal).normalize();
        (normal, [across, normal.cross(across)])
    };
    let facets: Vec<&Facet> =
        facets.iter().filter(|facet| facet.normal().normalize_or_zero().dot(along).abs() > ALIKE).collect();
    let flat = |place: DVec3| [place.dot(axes[0]), place.dot(axes[1])];
    let mut corners = [[f64::INFINITY, f64::NEG_INFINITY]; 2];
    facets.iter().flat_map(|facet| facet.corners).for_each(|corner| widen(&mut corners, flat(corner)));
    let [low, sides] = inset(corners, border)?;
    let top = facets.iter().flat_map(|facet| facet.corners).map(|corner| corner.dot(normal)).fold(f64::MIN, f64::max);
    let origin = axes[0] * low[0] + axes[1] * low[1] + normal * top;
    let grid = Grid { origin, axes, sides, counts: counts(sides.map(|side| side * metre)) };
    let under = |number: usize| {
        let place = DVec2::from(flat(grid.point(number)));
        let hits = facets.iter().filter_map(|facet| {
            let [a, b, c] = facet.corners.map(|corner| DVec2::from(flat(corner)));
            let uv = barycentric(place, [a, b, c])?;
            let [p, q, r] = facet.corners;
            let at = p * (1.0 - uv[0] - uv[1]) + q * uv[0] + r * uv[1];
            Some((at.dot(normal), facet, uv))
        });
        let (_, facet, uv) = hits.max_by(|a, b| a.0.total_cmp(&b.0))?;
        let back = facet.normal().dot(normal) < 0.0;
        let Facet { whole, triangle, .. } = **facet;
        Some(SurfacePoint { object: whole, triangle, uv: uv.map(|share| share as f32), back, turned: false })
    };
    let hits = (0..grid.len()).map(under).collect();
    Ok((grid, normal, hits))
}

/// The coordinates of a place within a triangle of the plane; `None` outside. A place on the side of two triangles is in both.
pub(super) fn barycentric(place: DVec2, [a, b, c]: [DVec2; 3]) -> Option<[f64; 2]> {
    let [ab, ac, ap] = [b - a, c - a, place - a];
    let area = ab.perp_dot(ac);
    let [u, v] = [ap.perp_dot(ac) / area, ab.perp_dot(ap) / area];
    // False as well where there is no area.
    let is_inside = u >= -ROUNDING && v >= -ROUNDING && u + v <= 1.0 + ROUNDING;
    is_inside.then(|| [u, v].map(|share| share.clamp(0.0, 1.0)))
}

/// How far rounding carries a place on the side of a triangle beyond it, in its coordinates.
const ROUNDING: f64 = 1e-9;

/// Puts a sheet of nothing into the scene, and returns its points at the cells of a grid, on the side that the normal is on.
pub(super) fn sheet(scene: &mut Scene, grid: &Grid, normal: DVec3) -> Vec<SurfacePoint> {
    let [a, b] = [grid.axes[0] * grid.sides[0], grid.axes[1] * grid.sides[1]];
    let corners = [grid.origin, grid.origin + a, grid.origin + a + b, grid.origin + b].map(|place| place.as_vec3());
    let material = scene.materials.len() as u32;
    let nothing = Material { coverage: Some(Coverage::plain(0.0)), ..Material::diffuse("measured", Vec3::ZERO) };
    scene.materials.push(nothing);
    let mesh = scene.meshes.len() as u32;
    let triangles = vec![[0, 1, 2], [0, 2, 3]];
    scene.meshes.push(Arc::new(Mesh {
        positions: corners.to_vec(),
        triangles,
        materials: vec![material; 2],
        ..Mesh::default()
    }));
    // What is lifted out of objects comes after these.
    let object = scene.wholes();
    scene.objects.insert(object, Object::fixed("measured", mesh));
    let back = a.cross(b).dot(normal) < 0.0;
    let point = |number: usize| {
        let middle = grid.middle(number);
        let [s, t] = [0, 1].map(|axis| (middle[axis] / grid.sides[axis]) as f32);
        // Of the first triangle, the corners are 0, a, a + b; of the second 0, a + b, b.
        let (triangle, uv) = if s >= t { (0, [s - t, t]) } else { (1, [s, t - s]) };
        SurfacePoint { object: object as u32, triangle, uv, back, turned: false }
    };
    (0..grid.len()).map(point).collect()
}

#[cfg(test)]
mod tests {
    use scenes::{Camera, Change, Transform};

    use super::*;

    /// An L-shaped floor of 6 m × 4 m with a 3 m × 2 m corner missing, modelled upside down; a wall; a table top.
    fn room() -> Scene {
        let quad = |corners: [[f32; 3]; 4]| corners.map(Vec3::from).to_vec();
        let mesh = |quads: &[[[f32; 3]; 4]], material: u32| {
            let positions = quads.iter().flat_map(|corners| quad(*corners)).collect::<Vec<_>>();
            let triangles: Vec<_> = (0..quads.len() as u32)
                .flat_map(|quad| [[4 * quad, 4 * quad + 1, 4 * quad + 2], [4 * quad, 4 * quad + 2, 4 * quad + 3]])
                .collect();
            let materials = vec![material; triangles.len()];
            Arc::new(Mesh { positions, triangles, materials, ..Mesh::default() })
        };
        let floor = [
            [[0.0, 0.0, 0.0], [6.0, 0.0, 0.0], [6.0, 0.0, 2.0], [0.0, 0.0, 2.0]],
            [[0.0, 0.0, 2.0], [3.0, 0.0, 2.0], [3.0, 0.0, 4.0], [0.0, 0.0, 4.0]],
        ];
        let wall = [[[0.0, 0.0, 0.0], [6.0, 0.0, 0.0], [6.0, 2.5, 0.0], [0.0, 2.5, 0.0]]];
        let table = [[[-0.5, 0.0, -0.5], [-0.5, 0.0, 0.5], [0.5, 0.0, 0.5], [0.5, 0.0, -0.5]]];
        let place = Transform { translation: Vec3::new(1.0, 0.75, 1.0), ..Transform::IDENTITY };
        Scene {
            meshes: vec![mesh(&floor, 0), mesh(&wall, 1), mesh(&table, 1)],
            objects: vec![
                Object::fixed("floor", 0),
                Object::fixed("wall", 1),
                Object { scene_from_object: place, ..Object::fixed("table", 2) },
            ],
            materials: vec![Material::diffuse("wood", Vec3::ONE), Material::diffuse("paint", Vec3::ONE)],
            camera: Camera { origin: Vec3::new(3.0, 1.5, 3.0), target: Vec3::new(3.0, 1.0, 0.0), ..Camera::default() },
            ..Scene::default()
        }
    }

    fn surface(name: &str, above: f64) -> Target {
        Target::Surface { name: name.into(), above }
    }

    /// Where the points lie, proved by the scene that they are asked about in.
    fn places(target: &Target, border: f64) -> (Plan, Vec<Option<Vec3>>) {
        let (scene, plan) = plan(&room(), target, border, 1.0).unwrap();
        scene.check().unwrap();
        let place = |point: &Option<SurfacePoint>| point.map(|point| scene.place(&point).unwrap());
        let places = plan.points.iter().map(place).collect();
        (plan, places)
    }

    #[test]
    fn points_lie_in_the_cells_of_the_grid() {
        let plane = Target::Plane { height: 0.8, area: None };
        for (target, lift) in [(plane, 0.0), (surface("floor", 0.0), 0.0), (surface("floor", 0.85), 0.85)] {
            let (plan, places) = places(&target, 0.5);
            assert!((plan.grid.sides[0] - 5.0).abs() < 1e-6 && (plan.grid.sides[1] - 3.0).abs() < 1e-6);
            for (number, place) in places.iter().enumerate() {
                let expected = plan.grid.point(number) + DVec3::Y * lift;
                if let Some(place) = place {
                    assert!((place.as_dvec3() - expected).length() < 1e-5, "{place} {expected}");
                }
            }
        }
    }

    #[test]
    fn a_surface_has_points_where_it_is_and_they_look_up() {
        for above in [0.0, 0.8] {
            let (plan, places) = places(&surface("floor", above), 0.0);
            let is_missing = |place: DVec3| place.x > 3.0 && place.z > 2.0;
            // The edge between both parts goes through points of the grid.
            let is_clear = |number: &usize| (plan.grid.point(*number).x - 3.0).abs() > 1e-6;
            for (number, found) in places.iter().enumerate().filter(|(number, _)| is_clear(number)) {
                assert_eq!(found.is_none(), is_missing(plan.grid.point(number)), "{}", plan.grid.point(number));
            }
            let (scene, _) = super::plan(&room(), &surface("floor", above), 0.0, 1.0).unwrap();
            let looks = |point: &SurfacePoint| {
                let mesh = &scene.meshes[scene.objects[point.object as usize].mesh as usize];
                let [a, b, c] = mesh.triangles[point.triangle as usize].map(|i| mesh.positions[i as usize]);
                (b - a).cross(c - a).y * if point.back { -1.0 } else { 1.0 }
            };
            assert!(plan.points.iter().flatten().all(|point| looks(point) > 0.0));
        }
        let (plan, places) = places(&surface("table", 0.0), 0.0);
        assert!(places.iter().all(|place| place.is_some_and(|place| (place.y - 0.75).abs() < 1e-6)));
        assert_eq!(plan.grid.counts, counts([1.0, 1.0]));
    }

    #[test]
    fn a_wall_is_measured_from_where_the_camera_is() {
        let (plan, _) = places(&surface("wall", 0.0), 0.0);
        let [across, upwards] = plan.grid.axes;
        assert!(upwards.dot(DVec3::Y) > 0.99 && across.dot(DVec3::Y).abs() < 1e-9);
        assert!(across.cross(upwards).z > 0.99, "its right is that of who looks at it");
        assert_eq!(plan.points.iter().flatten().count(), plan.grid.len());
    }

    #[test]
    fn a_material_is_a_surface_as_well_and_edits_count() {
        let (plan, _) = places(&surface("wood", 0.0), 0.0);
        assert!(plan.points.iter().flatten().all(|point| point.object == 0));
        let mut edited = room();
        Change::Visible { object: 2, visible: false }.apply(&mut edited).unwrap();
        let refused = super::plan(&edited, &surface("table", 0.0), 0.0, 1.0).unwrap_err();
        assert!(refused.contains("`table`; there are: floor, wall"), "{refused}");
    }

    #[test]
    fn what_leaves_no_area_is_refused() {
        for (target, border) in [
            (surface("table", 0.0), 0.5),
            (Target::Plane { height: 0.0, area: Some([0.0, 0.0, 0.0, 1.0]) }, 0.0),
            (Target::Plane { height: 0.0, area: Some([f64::NAN, 0.0, 1.0, 1.0]) }, 0.0),
        ] {
            assert!(super::plan(&room(), &target, border, 1.0).unwrap_err().contains("nothing is left"));
        }
    }
}
