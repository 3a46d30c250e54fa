//! Every kernel against a scalar brute force that knows no tree.

mod changes;
mod edges;
mod packets;
mod shafts;

use std::sync::Arc;

use glam::{Mat3, Quat, Vec2, Vec3};
use proptest::prelude::*;
use scenes::{Camera, Change, Coverage, LookUp, Material, Mesh, Object, Pixels, Scene, Texture, Transform};

use super::lanes::Machine;
use super::*;

/// Small reproducible random numbers; tests need no quality.
struct Dice(u64);

impl Dice {
    fn word(&mut self) -> u32 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) as u32
    }
    /// A word of random bits, of all zeros, or of all ones.
    fn bits(&mut self, word: usize) -> u64 {
        match (self.word() as usize + word) % 4 {
            0 => 0,
            1 => u64::MAX,
            _ => u64::from(self.word()) << 32 | u64::from(self.word()),
        }
    }
    fn unit(&mut self) -> f32 {
        (self.word() >> 7) as f32 / (1 << 24) as f32
    }
    fn signed(&mut self) -> f32 {
        2.0 * self.unit() - 1.0
    }
    fn point(&mut self) -> Vec3 {
        Vec3::new(self.signed(), self.signed(), self.signed())
    }
    fn direction(&mut self) -> Vec3 {
        loop {
            let p = self.point();
            if (0.01..1.0).contains(&p.length_squared()) {
                return p.normalize();
            }
        }
    }
}

fn mesh_of(triangles: &[[Vec3; 3]]) -> Mesh {
    Mesh {
        positions: triangles.iter().flatten().copied().collect(),
        triangles: (0..triangles.len() as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect(),
        materials: vec![0; triangles.len()],
        ..Mesh::default()
    }
}

fn scene_of(meshes: Vec<Mesh>) -> Scene {
    let meshes: Vec<Arc<Mesh>> = meshes.into_iter().map(Arc::new).collect();
    let objects = (0..meshes.len() as u32).map(|mesh| Object::fixed("", mesh)).collect();
    Scene { meshes, objects, materials: vec![Material::diffuse("", Vec3::ONE)], ..Scene::default() }
}

fn soup(dice: &mut Dice, count: usize, size: f32) -> Vec<[Vec3; 3]> {
    (0..count)
        .map(|_| {
            let centre = dice.point();
            [0; 3].map(|_| centre + dice.point() * size)
        })
        .collect()
}

/// A grid of quads of size 1 in the plane z = 0, around the origin.
fn grid(size: i32) -> Mesh {
    let mut triangles = Vec::new();
    for (x, y) in (-size..size).flat_map(|x| (-size..size).map(move |y| (x as f32, y as f32))) {
        let [a, b, c, d] = [(x, y), (x + 1.0, y), (x + 1.0, y + 1.0), (x, y + 1.0)].map(|(x, y)| Vec3::new(x, y, 0.0));
        triangles.extend([[a, b, c], [a, c, d]]);
    }
    mesh_of(&triangles)
}

/// The definition of a hit in `triangle.rs`, written down again in plain scalars.
mod brute {
    use super::*;

    fn less(a: f32, b: f32) -> f32 {
        if a < b { a } else { b }
    }
    fn more(a: f32, b: f32) -> f32 {
        if a > b { a } else { b }
    }

    fn box_entry(corners: [Vec3; 3], ray: &Ray, reach: f32) -> Option<f32> {
        let thick = (ray.origin.abs().max_element().max(reach)) / 524_288.0;
        let (mut near, mut far) = (0.0, ray.t_max);
        for axis in 0..3 {
            let (mut low, mut high) = (f32::INFINITY, f32::NEG_INFINITY);
            for corner in corners {
                low = low.min(corner[axis]);
                high = high.max(corner[axis]);
            }
            let inverse = 1.0 / (ray.direction[axis] + 0.0);
            let low = (low - (ray.origin[axis] + thick)) * inverse;
            let high = (high - (ray.origin[axis] - thick)) * inverse;
            let (enter, leave) = if inverse >= 0.0 { (low, high) } else { (high, low) };
            near = more(enter, near);
            far = less(leave, far);
        }
        (near <= far).then_some(near)
    }

    pub fn hit([p, q, r]: [Vec3; 3], ray: &Ray, reach: f32) -> Option<[f32; 3]> {
        let normal = (q - p).cross(r - p);
        if normal == Vec3::ZERO || !normal.is_finite() {
            return None;
        }
        let dot = |a: Vec3, b: Vec3| a.x * b.x + a.y * b.y + a.z * b.z;
        let cross = |a: Vec3, b: Vec3| Vec3::new(a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x);
        let o = ray.origin;
        let edge = |a: Vec3, b: Vec3| dot(cross(a - b, (a - o) + (b - o)), ray.direction);
        let (e0, e1, e2) = (edge(q, r), edge(r, p), edge(p, q));
        let inside = (e0 >= 0.0 && e1 >= 0.0 && e2 >= 0.0) || (e0 <= 0.0 && e1 <= 0.0 && e2 <= 0.0);
        let normal = cross(r - p, p - q);
        let (height, slope) = (dot(normal, p - o), dot(normal, ray.direction));
        let signed = if slope.is_sign_negative() { -height } else { height };
        let in_range = signed > 0.0 && signed < ray.t_max * slope.abs();
        if !inside || !in_range {
            return None;
        }
        let near = box_entry([p, q, r], ray, reach)?;
        let sum = e0 + e1 + e2;
        let [u, v] = if sum == 0.0 || !sum.is_finite() { [1.0 / 3.0; 2] } else { [e1 / sum, e2 / sum] };
        Some([(height / slope).min(f32::MAX).max(near), u, v])
    }

    fn transformed(ray: &Ray, object: &Object) -> Ray {
        if object.scene_from_object.is_identity() {
            return *ray;
        }
        let place = object.scene_from_object.inverse();
        Ray { origin: place.point(ray.origin), direction: place.vector(ray.direction), t_max: ray.t_max }
    }

    pub fn closest(scene: &Scene, ray: &Ray) -> Option<Hit> {
        let mut best: Option<Hit> = None;
        for (object_number, object) in scene.objects.iter().enumerate().filter(|(_, o)| o.visible) {
            let mesh = &scene.meshes[object.mesh as usize];
            let ray = transformed(ray, object);
            let corners = |t: &[u32; 3]| t.map(|i| mesh.positions[i as usize]);
            let sound =
                |c: &[Vec3; 3]| c.iter().all(|p| p.is_finite()) && (c[1] - c[0]).cross(c[2] - c[0]) != Vec3::ZERO;
            let own: Vec<usize> = scene.triangles(object_number).collect();
            let all = own.iter().map(|number| corners(&mesh.triangles[*number])).filter(sound).flatten();
            let reach = all.fold(0.0, |reach: f32, p| reach.max(p.abs().max_element()));
            for number in own {
                if let Some([t, u, v]) = hit(corners(&mesh.triangles[number]), &ray, reach)
                    && best.is_none_or(|old| t < old.t)
                {
                    best = Some(Hit { t, u, v, object: object_number as u32, triangle: number as u32 });
                }
            }
        }
        best
    }
}

/// All answers of a world about one ray agree with brute force, and with each other.
fn check_ray(world: &World, scene: &Scene, ray: &Ray) {
    let expected = brute::closest(scene, ray);
    assert_eq!(world.closest(ray), expected, "{ray:?}");
    assert_eq!(world.occluded_along(ray), expected.is_some(), "{ray:?}");
}

fn check_random_rays(scene: &Scene, dice: &mut Dice, count: usize) {
    let worlds: Vec<_> = Machine::all().into_iter().map(|machine| World::build(scene).on(machine)).collect();
    for _ in 0..count {
        let t_max = if dice.unit() < 0.5 { f32::INFINITY } else { dice.unit() * 2.0 };
        let ray = Ray { origin: dice.point() * 1.5, direction: dice.point(), t_max };
        worlds.iter().for_each(|world| check_ray(world, scene, &ray));
    }
}

/// Directions like those of a tile of a picture: a narrow or a wide bundle of them.
fn bundle(dice: &mut Dice, count: usize) -> Vec<Vec3> {
    let (forward, width) = (dice.direction(), dice.unit());
    (0..count).map(|_| (forward + dice.point() * width * width).normalize()).collect()
}

/// Two meshes, one of them with holes, the other there in part, placed a dozen times.
fn instances_with_holes(dice: &mut Dice) -> Scene {
    let mut meshes = vec![mesh_of(&soup(dice, 50, 0.4)), mesh_of(&soup(dice, 200, 0.2))];
    for vertex in 0..meshes[1].positions.len() {
        meshes[1].uvs.push(Vec2::new((vertex % 3 == 1) as u8 as f32, (vertex % 3 == 2) as u8 as f32) * 3.0);
    }
    meshes[1].materials.iter_mut().for_each(|material| *material = 1);
    let mut scene = scene_of(meshes);
    scene.materials.push(Material::diffuse("", Vec3::ONE));
    scene.materials[0].coverage = Some(Coverage::plain(0.4));
    scene.materials[1].coverage = Some(Coverage::mask(0, 3, 0.5));
    let texels = (0..16).map(|_| [255, 255, 255, dice.word() as u8]).collect();
    let pixels = Pixels::Srgb8(texels);
    let texture = Texture { name: String::new(), width: 4, height: 4, pixels, look_up: LookUp::REPEAT };
    scene.textures.push(texture.into());
    for number in 0..12 {
        let rotation = Mat3::from_quat(Quat::from_axis_angle(dice.direction(), 3.0 * dice.unit()));
        let place = Transform { linear: rotation * (0.2 + dice.unit()), translation: dice.point() * 2.0 };
        scene.objects.push(Object { scene_from_object: place, ..Object::fixed("", number % 2) });
    }
    scene
}

#[test]
fn random_soups_equal_brute_force() {
    let mut dice = Dice(1);
    for (count, size) in [(0, 1.0), (1, 1.0), (7, 1.0), (9, 0.5), (100, 0.3), (2000, 0.05)] {
        let scene = scene_of(vec![mesh_of(&soup(&mut dice, count, size))]);
        check_random_rays(&scene, &mut dice, 2000);
    }
}

#[test]
fn overlapping_instances_equal_brute_force() {
    let mut dice = Dice(2);
    let mut scene = scene_of(vec![mesh_of(&soup(&mut dice, 50, 0.4)), mesh_of(&soup(&mut dice, 20, 0.4))]);
    for number in 0..20 {
        let rotation = Mat3::from_quat(Quat::from_axis_angle(dice.direction(), 3.0 * dice.unit()));
        let linear = rotation * (0.2 + dice.unit());
        let place = Transform { linear, translation: dice.point() };
        scene.objects.push(Object {
            scene_from_object: place,
            visible: number % 5 != 0,
            ..Object::fixed("", number % 2)
        });
    }
    check_random_rays(&scene, &mut dice, 3000);
}

#[test]
fn holes_let_rays_through() {
    // Left half of the image absent.
    let texels = vec![[255, 255, 255, 0], [255, 255, 255, 255]];
    let texture =
        Texture { name: String::new(), width: 2, height: 1, pixels: Pixels::Srgb8(texels), look_up: LookUp::CLAMP };
    let mut mesh = mesh_of(&[[Vec3::ZERO, Vec3::X, Vec3::Y], [Vec3::ZERO, Vec3::X, Vec3::Y].map(|p| p - Vec3::Z)]);
    mesh.uvs = mesh.positions.iter().map(|p| Vec2::new(p.x, p.y)).collect();
    mesh.materials[1] = 1;
    let mut scene = scene_of(vec![mesh]);
    scene.materials.push(Material::diffuse("", Vec3::ONE));
    scene.materials[0].coverage = Some(Coverage::mask(0, 3, 0.5));
    scene.textures.push(texture.into());
    let world = World::build(&scene);
    for (x, triangle) in [(0.25, 1), (0.75, 0)] {
        let origin = Vec3::new(x, 0.1, 1.0);
        let ray = Ray { origin, direction: Vec3::NEG_Z, t_max: f32::INFINITY };
        assert_eq!(world.closest(&ray).map(|hit| hit.triangle), Some(triangle));
        assert_eq!(world.occluded(origin, Vec3::new(x, 0.1, -0.5)), triangle == 0);
    }
}

/// Of many rays through two sheets, one behind the other, as many hit each as is there of it, whatever befell them at the
/// other; and none of them asks for anything but the place.
#[test]
fn rays_meet_as_much_as_is_there() {
    let sheet = [Vec3::ZERO, Vec3::X * 2.0, Vec3::Y * 2.0];
    let mut scene = scene_of(vec![mesh_of(&[sheet])]);
    let place = Transform { translation: Vec3::NEG_Z, ..Transform::IDENTITY };
    scene.objects.push(Object { scene_from_object: place, ..Object::fixed("", 0) });
    scene.materials[0].coverage = Some(Coverage::plain(0.3));
    let world = World::build(&scene);
    let (mut dice, count, mut hits) = (Dice(7), 100_000, [0_u32; 3]);
    for _ in 0..count {
        let origin = Vec3::new(dice.unit(), dice.unit(), 1.0) * Vec3::new(0.9, 0.9, 1.0);
        let ray = Ray { origin, direction: Vec3::NEG_Z, t_max: f32::INFINITY };
        hits[world.closest(&ray).map_or(2, |hit| hit.object as usize)] += 1;
    }
    for (got, share) in hits.into_iter().zip([0.3, 0.7 * 0.3, 0.7 * 0.7_f64]) {
        let (expected, deviation) = (share * f64::from(count), (share * (1.0 - share) * f64::from(count)).sqrt());
        assert!((f64::from(got) - expected).abs() < 4.0 * deviation, "{hits:?}: {expected}");
    }
}

proptest! {
    #[test]
    fn barycentric_coordinates_and_t_name_the_same_point(seed in any::<u64>()) {
        let mut dice = Dice(seed);
        let triangles = soup(&mut dice, 20, 0.5);
        let world = World::build(&scene_of(vec![mesh_of(&triangles)]));
        let ray = Ray { origin: dice.point(), direction: dice.direction(), t_max: f32::INFINITY };
        if let Some(hit) = world.closest(&ray) {
            let [p, q, r] = triangles[hit.triangle as usize];
            let inside = p * (1.0 - hit.u - hit.v) + q * hit.u + r * hit.v;
            let grazing = (q - p).cross(r - p).normalize().dot(ray.direction).abs();
            prop_assert!(inside.distance(ray.origin + ray.direction * hit.t) < 1e-6 / grazing);
        }
    }
}
