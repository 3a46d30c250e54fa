//! What relays the light of lamps without surface: mirrors, panes and glass.
//!
//! A point, a spot or a sun has no surface that a path from the eye could meet by chance. Behind flat mirrors and thin
//! panes it stands where geometry says: at its image in the planes that reflect it, straight through the panes that let
//! it pass. Behind curved mirrors and solid glass there is no such place. [`Relays`] lists the planes, and says what else
//! there is.

use glam::Vec3;

use crate::{Needs, Scene, Surface};

/// The flat mirrors and panes of a scene, and how much there is beside them.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Relays {
    /// Planes that have a mirror or a thin pane in them; none where there are more than [`PLANES_MAX`].
    pub planes: Vec<Plane>,
    /// Some of it is a thin pane.
    pub panes: bool,
    /// What planes do not tell of.
    pub beyond: Beyond,
    /// Object, triangle and plane of what lies in a plane, in order.
    flat: Vec<(u32, u32, u32)>,
}

/// What relays light to where no plane tells.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Beyond {
    /// Triangles of solid glass.
    pub glass: u64,
    /// Triangles of mirrors and thin panes that are shaded as if they were curved.
    pub curved: u64,
    /// There are more planes than are told apart.
    pub planes: bool,
}

/// An infinite plane in scene space: `normal · p = offset`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plane {
    /// Unit; of either side.
    pub normal: Vec3,
    /// Distance from the origin along the normal.
    pub offset: f32,
}

/// More planes than this are a curved thing in facets: each of them relays next to nothing, and one that is chosen by
/// chance is next to never the right one.
pub const PLANES_MAX: usize = 64;

impl Relays {
    /// Looks for them; nothing where no lamp without surface shines, nor a sun.
    pub fn of(scene: &Scene, needs: &Needs) -> Self {
        let mut found = Self::default();
        if needs.bare_lights() + needs.suns == 0 || !needs.specular() {
            return found;
        }
        for (number, _) in scene.objects.iter().enumerate().filter(|(_, object)| object.visible) {
            for triangle in scene.triangles(number) {
                let surface = &scene.materials[scene.material_of(number, triangle) as usize].surface;
                match surface {
                    Surface::Mirror { .. } => found.add(scene, number, triangle),
                    Surface::Dielectric(glass) | Surface::Glazed { glass, .. } => match glass.thin {
                        // At frosted glass lamps are aimed at, as at any that scatters light.
                        _ if !glass.may_be_clear() => {}
                        true => {
                            found.panes = true;
                            found.add(scene, number, triangle);
                        }
                        false => found.beyond.glass += 1,
                    },
                    Surface::Diffuse { .. } | Surface::Glossy(_) | Surface::Translucent { .. } => {}
                }
            }
        }
        found.unless_many()
    }

    /// The flat mirrors alone, whatever shines.
    pub fn mirrors(scene: &Scene) -> Self {
        let mut found = Self::default();
        for (number, _) in scene.objects.iter().enumerate().filter(|(_, object)| object.visible) {
            for triangle in scene.triangles(number) {
                if let Surface::Mirror { .. } = scene.materials[scene.material_of(number, triangle) as usize].surface {
                    found.add(scene, number, triangle);
                }
            }
        }
        found.unless_many()
    }

    /// Of more planes than are told apart, none.
    fn unless_many(mut self) -> Self {
        if self.beyond.planes {
            (self.planes, self.flat) = (Vec::new(), Vec::new());
        }
        self
    }

    /// The plane that a triangle of an object lies in, if it is a mirror or a pane, and flat.
    pub fn plane_of(&self, object: u32, triangle: u32) -> Option<u32> {
        let found = self.flat.binary_search_by_key(&(object, triangle), |(object, triangle, _)| (*object, *triangle));
        Some(self.flat[found.ok()?].2)
    }

    fn add(&mut self, scene: &Scene, number: usize, triangle: usize) {
        if self.beyond.planes {
            return;
        }
        let object = &scene.objects[number];
        let mesh = &scene.meshes[object.mesh as usize];
        let vertices = mesh.triangles[triangle].map(|vertex| vertex as usize);
        let local = vertices.map(|vertex| mesh.positions[vertex]);
        let across = (local[1] - local[0]).cross(local[2] - local[0]).normalize_or_zero();
        let is_flat = |normal: &Vec3| normal.dot(across).abs() >= FLAT * normal.length();
        let curved = !mesh.normals.is_empty() && !vertices.iter().all(|vertex| is_flat(&mesh.normals[*vertex]));
        if curved {
            self.beyond.curved += 1;
            return;
        }
        let corners = local.map(|corner| object.scene_from_object.point(corner));
        let normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]).normalize_or_zero();
        if normal == Vec3::ZERO {
            return;
        }
        let reach = corners.iter().fold(0.0, |most: f32, corner| most.max(corner.abs().max_element()));
        let holds = |plane: &Plane| corners.iter().all(|corner| plane.height(*corner).abs() <= reach * IN_PLANE);
        let plane = self.planes.iter().position(holds).unwrap_or(self.planes.len());
        if plane == self.planes.len() {
            if plane == PLANES_MAX {
                self.beyond.planes = true;
                return;
            }
            self.planes.push(Plane { normal, offset: normal.dot(corners[0]) });
        }
        self.flat.push((number as u32, triangle as u32, plane as u32));
    }
}

impl Beyond {
    /// There is such a thing.
    pub fn any(&self) -> bool {
        self.glass > 0 || self.curved > 0 || self.planes
    }
}

impl Plane {
    /// Signed distance of a point.
    pub fn height(&self, point: Vec3) -> f32 {
        self.normal.dot(point) - self.offset
    }

    /// The mirror image of a point.
    pub fn image(&self, point: Vec3) -> Vec3 {
        point - self.normal * (2.0 * self.height(point))
    }

    /// A direction as the mirror turns it.
    pub fn turned(&self, direction: Vec3) -> Vec3 {
        direction - self.normal * (2.0 * self.normal.dot(direction))
    }
}

/// Cosine between a triangle and its shading normals from which on it is flat: a twentieth of a degree, what exporters
/// leave of equal normals.
const FLAT: f32 = 1.0 - 4e-7;
/// How far off a plane a corner may lie, as a share of its largest coordinate: a few roundings of it.
const IN_PLANE: f32 = 1.0 / 262_144.0;

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::{Dielectric, Light, Material, Mesh, Object};

    /// A pane of two triangles at x = 1, one more at x = 2, and a lamp.
    fn scene(surface: Surface) -> Scene {
        let quad = |x: f32| [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]].map(|[y, z]| Vec3::new(x, y, z));
        let mesh = Mesh {
            positions: quad(1.0).into_iter().chain(quad(2.0)).collect(),
            triangles: vec![[0, 1, 2], [0, 2, 3], [4, 5, 6]],
            materials: vec![0; 3],
            ..Mesh::default()
        };
        Scene {
            meshes: vec![Arc::new(mesh)],
            objects: vec![Object::fixed("panes", 0)],
            materials: vec![Material { surface, ..Material::diffuse("pane", Vec3::ZERO) }],
            lights: vec![Light::Point { position: Vec3::ZERO, intensity: Vec3::ONE }],
            ..Scene::default()
        }
    }

    fn relays(scene: &Scene) -> Relays {
        Relays::of(scene, &Needs::of(scene))
    }

    fn glass(thin: bool) -> Surface {
        Surface::Dielectric(Dielectric::clear(1.5, thin))
    }

    #[test]
    fn triangles_in_one_plane_are_one_mirror() {
        let found = relays(&scene(Surface::Mirror { reflectance: Vec3::ONE }));
        assert_eq!((found.planes.len(), found.panes, found.beyond.any()), (2, false, false));
        assert_eq!([0, 1, 2, 3].map(|triangle| found.plane_of(0, triangle)), [Some(0), Some(0), Some(1), None]);
        assert_eq!(found.planes[0].image(Vec3::new(0.25, 3.0, 4.0)), Vec3::new(1.75, 3.0, 4.0));
        assert_eq!(found.planes[0].turned(Vec3::new(0.6, 0.0, 0.8)), Vec3::new(-0.6, 0.0, 0.8));
        assert!(relays(&scene(glass(true))).panes);
    }

    #[test]
    fn what_bends_light_is_counted() {
        assert_eq!(relays(&scene(glass(false))).beyond, Beyond { glass: 3, ..Beyond::default() });
        let mut curved = scene(glass(true));
        let mesh = Arc::make_mut(&mut curved.meshes[0]);
        mesh.normals = vec![Vec3::X; 8];
        assert!(!relays(&curved).beyond.any(), "normals of flat things are no curve");
        Arc::make_mut(&mut curved.meshes[0]).normals[5] = Vec3::new(1.0, 0.1, 0.0).normalize();
        assert_eq!(relays(&curved).beyond, Beyond { curved: 1, ..Beyond::default() });
    }

    #[test]
    fn many_planes_are_a_curve_in_facets() {
        let mut faceted = scene(Surface::Mirror { reflectance: Vec3::ONE });
        let mesh = Arc::make_mut(&mut faceted.meshes[0]);
        for number in 0..PLANES_MAX {
            let first = mesh.positions.len() as u32;
            let x = 10.0 + number as f32;
            mesh.positions.extend([Vec3::X * x, Vec3::X * x + Vec3::Y, Vec3::X * x + Vec3::Z]);
            mesh.triangles.push([first, first + 1, first + 2]);
            mesh.materials.push(0);
        }
        let found = relays(&faceted);
        assert!(found.beyond.planes && found.planes.is_empty() && found.plane_of(0, 0).is_none());
    }

    #[test]
    fn without_such_lamps_nobody_looks() {
        let mut dark = scene(glass(false));
        dark.lights.clear();
        assert_eq!(relays(&dark), Relays::default());
    }
}
