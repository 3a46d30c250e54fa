//! Whether a scene is a room, to be looked at from within, or a thing, to be looked at from without.
//!
//! Rays from a few places in it tell: in a room, nearly all of them meet front sides, and the room is most of the scene.
//! From within a closed thing they meet the back sides of its skin; from the middle of a forest or a town, many leave.

use glam::DVec3;
use rayon::prelude::*;

use super::mesh::Bounds;
use crate::Scene;

/// The inside of a room.
#[derive(Clone, Copy, Debug)]
pub(super) struct Room {
    /// A place from which most of it can be seen.
    pub middle: DVec3,
    /// How far it is from there to the ceiling, and to the floor.
    pub up: f64,
    pub down: f64,
    /// The level direction in which it is longest, and how far it goes on there and behind.
    pub along: DVec3,
    pub ahead: f64,
    pub behind: f64,
}

/// Directions looked into from each place.
const RAYS: usize = 96;
/// Shares of these that meet something, and that meet front sides, in a room.
const CLOSED: f64 = 0.85;
const FRONTS: f64 = 0.7;
/// Half of what is seen in a room is further away than such a share of the scene's diameter; from a car's seat it is nearer.
const ROOMY: f64 = 0.14;
/// A room is at least such a share of the scene's length, width and height.
const SHARE: f64 = 0.5;
/// So upright is the normal of a floor, and so much of what is seen below is floor.
const LEVEL_FLOOR: f64 = 0.97;
const FLOOR: f64 = 0.4;
/// Level directions.
const LEVEL: usize = 24;
/// Triangles times rays: more are not worth it. Larger scenes are looked at by fewer rays.
const WORK_MAX: usize = 1 << 29;

/// The room that a scene is; `None` if it is none.
pub(super) fn room(scene: &Scene, bounds: &Bounds) -> Option<Room> {
    let places = places(bounds);
    let seen = scene.objects.iter().filter(|object| object.visible);
    let count: usize = seen.map(|object| scene.meshes[object.mesh as usize].triangles.len()).sum();
    let rays = (WORK_MAX / count.max(1) / places.len()).min(RAYS);
    if rays < 16 {
        return None;
    }
    let triangles = triangles(scene);
    let mut best: Option<(f64, DVec3)> = None;
    for place in places {
        let met: Vec<Option<Met>> =
            (0..rays).into_par_iter().map(|i| first(&triangles, place, on_sphere(i, rays))).collect();
        let all = rays as f64;
        let closed = met.iter().flatten().count() as f64 / all;
        let fronts = met.iter().flatten().filter(|met| met.front).count() as f64 / all;
        // A hollow ball has no floor.
        let below: Vec<&Met> =
            (0..rays).filter(|i| on_sphere(*i, rays).y < -0.5).filter_map(|i| met[i].as_ref()).collect();
        let floor = below.iter().filter(|met| met.upright > LEVEL_FLOOR).count() as f64 / below.len().max(1) as f64;
        if closed < CLOSED || fronts < FRONTS || floor < FLOOR {
            continue;
        }
        // Where there is room around, half of what is seen is far away.
        let mut distances: Vec<f64> = met.iter().flatten().map(|met| met.distance).collect();
        distances.sort_by(f64::total_cmp);
        let roomy = distances[distances.len() / 4];
        if distances[distances.len() / 2] < ROOMY * bounds.diameter() {
            continue;
        }
        if best.is_none_or(|(known, _)| roomy > known) {
            best = Some((roomy, place));
        }
    }
    let (_, middle) = best?;
    let diameter = bounds.diameter();
    let reach = |direction: DVec3| first(&triangles, middle, direction).map_or(diameter, |met| met.distance);
    let level = |i: usize| {
        let angle = std::f64::consts::TAU * i as f64 / LEVEL as f64;
        DVec3::new(libm::sin(angle), 0.0, libm::cos(angle))
    };
    let reaches: Vec<f64> = (0..LEVEL).map(|i| reach(level(i))).collect();
    let length = |i: usize| reaches[i] + reaches[(i + LEVEL / 2) % LEVEL];
    let longest = (0..LEVEL).max_by(|&a, &b| length(a).total_cmp(&length(b)))?;
    let behind = reaches[(longest + LEVEL / 2) % LEVEL];
    let (up, down) = (reach(DVec3::Y), reach(DVec3::NEG_Y));
    let both_ways = |axis: DVec3| reach(axis) + reach(-axis);
    let inside = DVec3::new(both_ways(DVec3::X), up + down, both_ways(DVec3::Z));
    if inside.cmplt((bounds.max - bounds.min) * SHARE).any() {
        return None;
    }
    Some(Room { middle, up, down, along: level(longest), ahead: reaches[longest], behind })
}

/// Places to look around from: the middle of the scene, and around it.
fn places(bounds: &Bounds) -> Vec<DVec3> {
    let (middle, size) = (bounds.middle(), bounds.max - bounds.min);
    let steps = [0.0, -0.22, 0.22];
    let mut places = Vec::new();
    for y in [0.03, -0.2] {
        for x in steps {
            for z in steps {
                places.push(middle + size * DVec3::new(x, y, z));
            }
        }
    }
    places
}

/// The i-th of n directions that are spread evenly (a spherical Fibonacci lattice).
fn on_sphere(i: usize, n: usize) -> DVec3 {
    let y = 1.0 - (2.0 * i as f64 + 1.0) / n as f64;
    let radius = (1.0 - y * y).max(0.0).sqrt();
    let turn = i as f64 * 2.399_963_229_728_653;
    DVec3::new(radius * libm::cos(turn), y, radius * libm::sin(turn))
}

/// Corners of all triangles that are to be seen.
fn triangles(scene: &Scene) -> Vec<[DVec3; 3]> {
    let mut all = Vec::new();
    for object in scene.objects.iter().filter(|object| object.visible) {
        let mesh = &scene.meshes[object.mesh as usize];
        let mirrored = object.scene_from_object.linear.determinant() < 0.0;
        let corner = |vertex: u32| object.scene_from_object.point(mesh.positions[vertex as usize]).as_dvec3();
        for triangle in &mesh.triangles {
            let [a, b, c] = triangle.map(corner);
            all.push(if mirrored { [a, c, b] } else { [a, b, c] });
        }
    }
    all
}

/// What a ray meets first.
struct Met {
    distance: f64,
    /// Its front side.
    front: bool,
    /// How upright its normal is, 0..1.
    upright: f64,
}

/// The first triangle in a direction (Möller & Trumbore 1997).
fn first(triangles: &[[DVec3; 3]], origin: DVec3, direction: DVec3) -> Option<Met> {
    let mut nearest: Option<Met> = None;
    for [a, b, c] in triangles {
        let (ab, ac) = (*b - *a, *c - *a);
        let p = direction.cross(ac);
        let determinant = ab.dot(p);
        if determinant == 0.0 {
            continue;
        }
        let t = origin - *a;
        let u = t.dot(p) / determinant;
        if !(0.0..=1.0).contains(&u) {
            continue;
        }
        let q = t.cross(ab);
        let v = direction.dot(q) / determinant;
        if v < 0.0 || u + v > 1.0 {
            continue;
        }
        let distance = ac.dot(q) / determinant;
        if distance > 0.0 && nearest.as_ref().is_none_or(|known| distance < known.distance) {
            let upright = ab.cross(ac).normalize_or_zero().y.abs();
            nearest = Some(Met { distance, front: determinant > 0.0, upright });
        }
    }
    nearest
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use glam::Vec3;

    use super::*;
    use crate::{Material, Mesh, Object};

    /// A box, its front sides outwards or inwards, perhaps without its ceiling.
    fn a_box(inwards: bool, ceiling: bool) -> Scene {
        let positions =
            (0..8).map(|i| Vec3::new((i & 1) as f32 * 6.0, (i >> 1 & 1) as f32 * 3.0, (i >> 2) as f32 * 4.0));
        let sides = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
        let kept = sides.iter().enumerate().filter(|(side, _)| ceiling || *side != 3);
        let triangles: Vec<[u32; 3]> = kept
            .flat_map(|(_, &[a, b, c, d])| [[a, b, c], [a, c, d]])
            .map(|[a, b, c]| if inwards { [a, c, b] } else { [a, b, c] })
            .collect();
        let materials = vec![0; triangles.len()];
        let mesh = Mesh { positions: positions.collect(), triangles, materials, ..Mesh::default() };
        Scene {
            meshes: vec![Arc::new(mesh)],
            objects: vec![Object::fixed("box", 0)],
            materials: vec![Material::diffuse("wall", Vec3::ONE)],
            ..Scene::default()
        }
    }

    fn found(scene: &Scene) -> Option<Room> {
        let mut bounds = Bounds::default();
        scene.meshes[0].positions.iter().for_each(|p| bounds.add(p.as_dvec3()));
        room(scene, &bounds)
    }

    #[test]
    fn a_room_is_told_from_a_box_and_from_a_yard() {
        let room = found(&a_box(true, true)).expect("its walls face inwards");
        assert!(room.along.x.abs() > 0.7 && room.up + room.down > 2.9, "{room:?}");
        assert!(found(&a_box(false, true)).is_none(), "a thing's skin faces outwards");
        assert!(found(&a_box(true, false)).is_none(), "a yard has no ceiling");
        // A cabin in a corner of a large thing.
        let mut cabin = a_box(true, true);
        let far = Object {
            scene_from_object: crate::Transform { translation: Vec3::X * 30.0, ..crate::Transform::IDENTITY },
            ..Object::fixed("elsewhere", 0)
        };
        cabin.objects.push(far);
        let mut bounds = Bounds::default();
        bounds.add(DVec3::ZERO);
        bounds.add(DVec3::new(36.0, 3.0, 4.0));
        assert!(super::room(&cabin, &bounds).is_none());
    }
}
