//! Every kernel against a scalar brute force that knows no tree.

use glam::{Mat3, Quat, Vec2, Vec3};
use proptest::prelude::*;
use scenes::{AlphaCut, Camera, Change, Material, Mesh, Object, Pixels, Scene, Texture, Transform, Wrap};

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

/// All packets hit what single rays hit, on every machine.
fn check_packets(scene: &Scene, origins: &[Vec3], directions: &[Vec3]) {
    for machine in Machine::all() {
        let world = World::build(scene).on(machine);
        let mut scratch = PacketScratch::default();
        let mut hits = vec![None; directions.len()];
        for &origin in origins {
            world.closest_from(origin, directions, &mut scratch, &mut hits);
            for (&direction, hit) in directions.iter().zip(&hits) {
                let ray = Ray { origin, direction, t_max: f32::INFINITY };
                assert_eq!(*hit, world.closest(&ray), "{machine:?} {ray:?}");
            }
        }
    }
}

/// Directions like those of a tile of a picture: a narrow or a wide bundle of them.
fn bundle(dice: &mut Dice, count: usize) -> Vec<Vec3> {
    let (forward, width) = (dice.direction(), dice.unit());
    (0..count).map(|_| (forward + dice.point() * width * width).normalize()).collect()
}

#[test]
fn packets_equal_single_rays_in_soups() {
    let mut dice = Dice(20);
    for (count, size) in [(0, 1.0), (1, 2.0), (20, 0.5), (300, 0.2), (20_000, 0.03)] {
        let scene = scene_of(vec![mesh_of(&soup(&mut dice, count, size))]);
        for rays in [0, 1, 5, 16, 100, 128, 300] {
            let origins: Vec<_> = (0..10).map(|_| dice.point() * 1.2).collect();
            let directions = bundle(&mut dice, rays);
            check_packets(&scene, &origins, &directions);
        }
    }
}

#[test]
fn packets_equal_single_rays_among_instances_and_holes() {
    let mut dice = Dice(21);
    let scene = instances_with_holes(&mut dice);
    for _ in 0..20 {
        let origins: Vec<_> = (0..10).map(|_| dice.point() * 2.0).collect();
        let directions = bundle(&mut dice, 150);
        check_packets(&scene, &origins, &directions);
    }
}

#[test]
fn packets_equal_single_rays_where_everything_is_aligned() {
    let mut dice = Dice(22);
    // Straight down through grid lines and diagonals, within the plane, and zeros of both signs.
    let mut two = grid(8);
    two.positions.extend(grid(8).positions);
    let again: Vec<_> = grid(8).triangles.iter().map(|t| t.map(|i| i + two.positions.len() as u32 / 2)).collect();
    two.materials.extend(vec![0; again.len()]);
    two.triangles.extend(again);
    let scene = scene_of(vec![two]);
    let quarter = |dice: &mut Dice| (dice.word() % 65) as f32 / 4.0 - 8.0;
    let axis = |dice: &mut Dice| [-1.0, -0.0, 0.0, 1.0][dice.word() as usize % 4];
    for height in [0.0, 2.0] {
        let origins: Vec<_> = (0..20).map(|_| Vec3::new(quarter(&mut dice), quarter(&mut dice), height)).collect();
        let directions: Vec<_> =
            (0..256).map(|_| Vec3::new(axis(&mut dice), axis(&mut dice), axis(&mut dice) - 0.5)).collect();
        check_packets(&scene, &origins, &directions);
        check_packets(&scene, &origins, &[Vec3::NEG_Z; 40]);
    }
    check_packets(&scene, &[Vec3::ZERO, Vec3::NAN], &[Vec3::X, Vec3::ZERO, Vec3::NAN, Vec3::NEG_Z]);
}

/// All shafts see what single rays see, on every machine.
fn check_shafts(scene: &Scene, apexes: &[Vec3], points: &[Vec3]) {
    check_shafts_in(&World::build(scene), apexes, points);
}

fn check_shafts_in(world: &World, apexes: &[Vec3], points: &[Vec3]) {
    let targets = Targets::new(points.iter().copied());
    let mut dice = Dice(points.len() as u64);
    for machine in Machine::all() {
        let world = world.clone().on(machine);
        let mut scratch = ShaftScratch::default();
        let mut visible = vec![0; points.len().div_ceil(64)];
        for &apex in apexes {
            world.shade_shaft(apex, &targets, &mut scratch, &mut visible);
            for (i, &point) in points.iter().enumerate() {
                let sees = visible[i / 64] >> (i % 64) & 1 != 0;
                assert_eq!(sees, !world.occluded(apex, point), "{machine:?} {apex} {point}");
            }
            let wanted: Vec<u64> = (0..visible.len()).map(|word| dice.bits(word)).collect();
            let mut wanted_and_visible = visible.clone();
            world.shade_wanted(apex, &targets, &wanted, &mut scratch, &mut wanted_and_visible);
            let expected: Vec<u64> = visible.iter().zip(&wanted).map(|(visible, wanted)| visible & wanted).collect();
            assert_eq!(wanted_and_visible, expected);
        }
    }
}

#[test]
fn shafts_equal_single_rays_in_soups() {
    let mut dice = Dice(10);
    for (count, size) in [(1, 2.0), (20, 0.5), (300, 0.2), (20_000, 0.03)] {
        let scene = scene_of(vec![mesh_of(&soup(&mut dice, count, size))]);
        for points in [0, 1, 5, 128, 200, 256, 700] {
            let (centre, spread) = (dice.point(), dice.unit());
            let points: Vec<_> = (0..points).map(|_| centre + dice.point() * spread).collect();
            let apexes: Vec<_> = (0..20).map(|_| dice.point() * 1.2).collect();
            check_shafts(&scene, &apexes, &points);
        }
    }
}

/// What a picture of a shipped scene sees, in 16×8 tiles, from lights on its surfaces.
#[test]
fn shafts_equal_single_rays_in_real_scenes() {
    for name in ["cornell_spheres", "conference"] {
        let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes").join(name);
        let Ok(loaded) = scenes::read::load(&folder) else { continue };
        let scene = loaded.scene;
        let world = World::build(&scene);
        let lens = Camera { width: 320, height: 240, ..scene.camera }.lens();
        let see = |x: u32, y: u32| {
            let direction = lens.direction(x as f32 + 0.5, y as f32 + 0.5);
            let hit = world.closest(&Ray { origin: lens.origin(), direction, t_max: f32::INFINITY })?;
            Some(lens.origin() + direction * (hit.t * 0.9999))
        };
        let mut dice = Dice(14);
        for _ in 0..20 {
            let corner = [dice.word() % 300, dice.word() % 230];
            let tile: Vec<_> = (0..128).filter_map(|i| see(corner[0] + i % 16, corner[1] + i / 16)).collect();
            let apexes: Vec<_> = (0..10).filter_map(|_| see(dice.word() % 320, dice.word() % 240)).collect();
            check_shafts_in(&world, &apexes, &tile);
        }
    }
}

/// Two meshes, one of them with holes, placed a dozen times.
fn instances_with_holes(dice: &mut Dice) -> Scene {
    let mut meshes = vec![mesh_of(&soup(dice, 50, 0.4)), mesh_of(&soup(dice, 200, 0.2))];
    for vertex in 0..meshes[1].positions.len() {
        meshes[1].uvs.push(Vec2::new((vertex % 3 == 1) as u8 as f32, (vertex % 3 == 2) as u8 as f32) * 3.0);
    }
    meshes[1].materials.iter_mut().for_each(|material| *material = 1);
    let mut scene = scene_of(meshes);
    scene.materials.push(Material::diffuse("", Vec3::ONE));
    scene.materials[1].alpha = Some(AlphaCut { texture: 0, channel: 3, threshold: 0.5 });
    let texels = (0..16).map(|_| [255, 255, 255, dice.word() as u8]).collect();
    let pixels = Pixels::Srgb8(texels);
    scene.textures.push(Texture { name: String::new(), width: 4, height: 4, pixels, wrap: Wrap::Repeat });
    for number in 0..12 {
        let rotation = Mat3::from_quat(Quat::from_axis_angle(dice.direction(), 3.0 * dice.unit()));
        let place = Transform { linear: rotation * (0.2 + dice.unit()), translation: dice.point() * 2.0 };
        scene.objects.push(Object { scene_from_object: place, ..Object::fixed("", number % 2) });
    }
    scene
}

#[test]
fn a_material_that_loses_its_holes_rebuilds_only_what_is_made_of_it() {
    let mut dice = Dice(23);
    let mut scene = instances_with_holes(&mut dice);
    let before = World::build(&scene);
    scene.materials[1].alpha = None;
    let mut after = before.clone();
    after.rebuild_with(&scene, 1);
    for (old, new) in before.instances().iter().zip(after.instances()) {
        let is_kept = std::sync::Arc::ptr_eq(&old.solid, &new.solid);
        assert_eq!(is_kept, scene.objects[old.object as usize].mesh == 0);
    }
    let fresh = World::build(&scene);
    for _ in 0..500 {
        let ray = Ray { origin: dice.point() * 3.0, direction: dice.direction(), t_max: f32::INFINITY };
        assert_eq!(after.closest(&ray), fresh.closest(&ray));
    }
}

#[test]
fn shafts_equal_single_rays_among_instances_and_holes() {
    let mut dice = Dice(11);
    let scene = instances_with_holes(&mut dice);
    for _ in 0..20 {
        let (centre, spread) = (dice.point() * 2.0, dice.unit());
        let points: Vec<_> = (0..150).map(|_| centre + dice.point() * spread).collect();
        let apexes: Vec<_> = (0..20).map(|_| dice.point() * 2.0).collect();
        check_shafts(&scene, &apexes, &points);
    }
}

#[test]
fn shafts_equal_single_rays_where_everything_is_aligned() {
    let mut dice = Dice(12);
    // Grid lines, diagonals, the plane itself; directions with zeros of both signs.
    let scene = scene_of(vec![grid(8)]);
    let quarter = |dice: &mut Dice| (dice.word() % 65) as f32 / 4.0 - 8.0;
    for height in [0.0, 2.0] {
        for flat in [true, false] {
            let mut point = |z: f32| Vec3::new(quarter(&mut dice), quarter(&mut dice), z);
            let points: Vec<_> = (0..256).map(|i| point(if flat { -2.0 } else { (i % 3) as f32 - 2.0 })).collect();
            let apexes: Vec<_> = (0..50).map(|_| point(height)).collect();
            check_shafts(&scene, &apexes, &points);
        }
    }
}

#[test]
fn shafts_take_nonsense() {
    let scene = scene_of(vec![mesh_of(&soup(&mut Dice(13), 500, 0.5))]);
    let nonsense = [Vec3::NAN, Vec3::INFINITY, Vec3::splat(1e30), Vec3::ZERO, -Vec3::ZERO, Vec3::splat(1e-40)];
    check_shafts(&scene, &nonsense, &nonsense);
    check_shafts(&scene_of(vec![]), &nonsense, &nonsense);
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
fn moving_an_object_gives_the_world_built_anew() {
    let mut dice = Dice(3);
    let mut scene = scene_of(vec![mesh_of(&soup(&mut dice, 50, 0.4)), mesh_of(&soup(&mut dice, 20, 0.4))]);
    scene.objects[1].visible = false;
    let mut world = World::build(&scene);
    scene.objects[1].visible = true;
    scene.objects[0].scene_from_object.translation.x = 0.25;
    world.rebuild_top(&scene);
    for _ in 0..2000 {
        let ray = Ray { origin: dice.point() * 1.5, direction: dice.point(), t_max: f32::INFINITY };
        check_ray(&world, &scene, &ray);
    }
}

/// Some change of a piece of one of the first objects.
fn lifting(scene: &Scene, dice: &mut Dice) -> Change {
    let object = dice.word() % scene.wholes().min(4) as u32;
    let mesh = scene.objects[object as usize].mesh;
    let piece = dice.word() % scene.meshes[mesh as usize].pieces().count() as u32;
    let whole_from_piece = Transform { translation: dice.point() * 0.5, ..Transform::IDENTITY };
    match dice.word() % 4 {
        0 => Change::PieceVisible { object, piece, visible: false },
        1 => Change::PieceVisible { object, piece, visible: true },
        2 => Change::Visible { object, visible: dice.word().is_multiple_of(2) },
        _ => Change::PieceTransform { object, piece, whole_from_piece },
    }
}

#[test]
fn lifted_pieces_equal_brute_force_and_a_world_built_anew() {
    let mut dice = Dice(31);
    let mut scene = scene_of(vec![mesh_of(&soup(&mut dice, 60, 0.15)), mesh_of(&soup(&mut dice, 20, 0.4))]);
    scene.objects.extend([0, 0, 1].map(|mesh| Object::fixed("", mesh)));
    scene.objects[2].scene_from_object.translation = Vec3::X;
    let mut world = World::build(&scene);
    for _ in 0..120 {
        lifting(&scene, &mut dice).apply(&mut scene).unwrap();
        world.rebuild_top(&scene);
        let fresh = World::build(&scene);
        assert_eq!((world.bounds(), world.left_out()), (fresh.bounds(), fresh.left_out()));
        for _ in 0..60 {
            let ray = Ray { origin: dice.point() * 1.5, direction: dice.point(), t_max: f32::INFINITY };
            check_ray(&world, &scene, &ray);
            assert_eq!(fresh.closest(&ray), world.closest(&ray));
        }
    }
    assert!(scene.objects.len() > scene.wholes() + 5);
}

#[test]
fn pieces_with_holes_can_be_lifted_and_everything_be_put_back() {
    let mut dice = Dice(32);
    let mut scene = instances_with_holes(&mut dice);
    let (first, mut world) = (scene.clone(), World::build(&scene));
    let (bytes, bounds) = (world.bytes(), world.bounds());
    let mut back = Vec::new();
    for _ in 0..40 {
        let change = lifting(&scene, &mut dice);
        back.push(change.undo(&scene).unwrap());
        change.apply(&mut scene).unwrap();
        world.rebuild_top(&scene);
        for _ in 0..20 {
            let ray = Ray { origin: dice.point() * 3.0, direction: dice.direction(), t_max: f32::INFINITY };
            assert_eq!(world.closest(&ray), World::build(&scene).closest(&ray));
        }
    }
    back.iter().rev().for_each(|change| change.apply(&mut scene).unwrap());
    assert_eq!(scene, first);
    world.rebuild_top(&scene);
    assert_eq!((world.bytes(), world.bounds()), (bytes, bounds));
    let before = World::build(&scene);
    for _ in 0..2000 {
        let ray = Ray { origin: dice.point() * 3.0, direction: dice.direction(), t_max: f32::INFINITY };
        assert_eq!(world.closest(&ray), before.closest(&ray));
    }
}

#[test]
fn an_object_all_of_whose_pieces_are_gone_is_met_by_nothing() {
    let mut dice = Dice(33);
    let mut scene = scene_of(vec![mesh_of(&soup(&mut dice, 30, 0.1)), mesh_of(&soup(&mut dice, 30, 0.1))]);
    let mut world = World::build(&scene);
    for piece in 0..scene.meshes[0].pieces().count() as u32 {
        Change::PieceVisible { object: 0, piece, visible: false }.apply(&mut scene).unwrap();
    }
    world.rebuild_top(&scene);
    check_random_rays(&scene, &mut dice, 200);
    for _ in 0..200 {
        let ray = Ray { origin: dice.point() * 1.5, direction: dice.point(), t_max: f32::INFINITY };
        check_ray(&world, &scene, &ray);
    }
    assert_eq!(world.left_out(), LeftOut::default());
}

/// A closed sphere of triangles around the origin.
fn sphere(rings: usize) -> Mesh {
    let at = |i: usize, j: usize| {
        let (theta, phi) =
            (i as f64 / rings as f64 * std::f64::consts::PI, j as f64 / rings as f64 * std::f64::consts::PI);
        if i == 0 || i == rings {
            return Vec3::Z * if i == 0 { 1.0 } else { -1.0 };
        }
        let (sin, cos) = (libm::sin(theta), libm::cos(theta));
        glam::dvec3(sin * libm::cos(phi), sin * libm::sin(phi), cos).as_vec3()
    };
    let mut triangles = Vec::new();
    for i in 0..rings {
        for j in 0..2 * rings {
            let next = (j + 1) % (2 * rings);
            triangles.extend([[at(i, j), at(i + 1, j), at(i + 1, next)], [at(i, j), at(i + 1, next), at(i, next)]]);
        }
    }
    mesh_of(&triangles)
}

#[test]
fn no_ray_escapes_through_a_shared_edge() {
    let mut dice = Dice(4);
    let mesh = sphere(40);
    let world = World::build(&scene_of(vec![mesh.clone()]));
    let mut escaped = 0;
    for _ in 0..100_000 {
        let triangle = mesh.triangles[dice.word() as usize % mesh.triangles.len()];
        let side = dice.word() as usize % 3;
        let [p, q] = [side, (side + 1) % 3].map(|i| mesh.positions[triangle[i] as usize]);
        let origin = dice.point() * 0.5;
        let direction = p.lerp(q, 0.01 + 0.98 * dice.unit()) - origin;
        escaped += u32::from(!world.occluded_along(&Ray { origin, direction, t_max: f32::INFINITY }));
    }
    assert_eq!(escaped, 0);
}

#[test]
fn degenerate_triangles_are_counted_and_change_nothing() {
    let mut dice = Dice(5);
    let clean = soup(&mut dice, 300, 0.3);
    let mut dirty = clean.clone();
    dirty.extend([[Vec3::ONE; 3], [Vec3::NAN; 3], [Vec3::ZERO, Vec3::X, Vec3::X * 2.0]]);
    dirty.push([Vec3::ZERO, Vec3::X, Vec3::new(0.0, f32::INFINITY, 0.0)]);
    dirty.push([Vec3::ZERO, Vec3::X * 1e30, Vec3::Y]);
    let (clean, dirty) = (scene_of(vec![mesh_of(&clean)]), scene_of(vec![mesh_of(&dirty)]));
    let (clean, dirty) = (World::build(&clean), World::build(&dirty));
    assert_eq!((clean.left_out().triangles, dirty.left_out().triangles), (0, 5));
    assert_eq!(clean.bounds(), dirty.bounds());
    for _ in 0..2000 {
        let ray = Ray { origin: dice.point(), direction: dice.direction(), t_max: f32::INFINITY };
        assert_eq!(clean.closest(&ray), dirty.closest(&ray));
    }
}

#[test]
fn needles_equal_brute_force() {
    let mut dice = Dice(6);
    let mut needles = Vec::new();
    for _ in 0..200 {
        let (start, along) = (dice.point(), dice.direction());
        needles.push([start, start + along, start + along + dice.direction() * 1e-6]);
    }
    let scene = scene_of(vec![mesh_of(&needles)]);
    let world = World::build(&scene);
    for _ in 0..3000 {
        let needle = needles[dice.word() as usize % needles.len()];
        let origin = dice.point() * 2.0;
        let direction = needle[0].lerp(needle[1], dice.unit()) - origin;
        check_ray(&world, &scene, &Ray { origin, direction, t_max: f32::INFINITY });
    }
}

#[test]
fn coplanar_duplicates_give_the_lowest_number() {
    let mut dice = Dice(7);
    let mut triangles = soup(&mut dice, 100, 0.5);
    let copies = triangles.clone();
    triangles.extend(copies);
    let mut scene = scene_of(vec![mesh_of(&triangles)]);
    scene.objects.push(Object::fixed("again", 0));
    let world = World::build(&scene);
    let mut hits = 0;
    for _ in 0..2000 {
        let ray = Ray { origin: dice.point(), direction: dice.direction(), t_max: f32::INFINITY };
        if let Some(hit) = world.closest(&ray) {
            assert!(hit.triangle < 100 && hit.object == 0);
            hits += 1;
        }
    }
    assert!(hits > 300);
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

#[test]
fn axis_parallel_rays_hit_grid_points_lines_and_diagonals() {
    let scene = scene_of(vec![grid(8)]);
    let world = World::build(&scene);
    for (x, y) in (-32..=32).flat_map(|x| (-32..=32).map(move |y| (x as f32 / 4.0, y as f32 / 4.0))) {
        for zero in [0.0, -0.0] {
            for (z, down) in [(2.0, -1.0), (-2.0, 1.0)] {
                let origin = Vec3::new(x, y, z);
                let ray = Ray { origin, direction: Vec3::new(zero, zero, down), t_max: f32::INFINITY };
                assert_eq!(world.closest(&ray).map(|hit| hit.t), Some(2.0), "{ray:?}");
                assert!(world.occluded(origin, Vec3::new(x, y, -z)));
                assert!(!world.occluded(origin, Vec3::new(x, y, 0.0)), "segments are open");
            }
        }
    }
}

#[test]
fn rays_within_the_plane_of_a_grid_do_not_panic_or_hit_wildly() {
    let scene = scene_of(vec![grid(8)]);
    let world = World::build(&scene);
    for y in -32..=32 {
        let ray = Ray { origin: Vec3::new(-20.0, y as f32 / 4.0, 0.0), direction: Vec3::X, t_max: f32::INFINITY };
        assert_eq!(world.closest(&ray), None);
    }
}

#[test]
fn scaling_by_powers_of_two_changes_no_bit() {
    let mut dice = Dice(8);
    let triangles = soup(&mut dice, 500, 0.2);
    let world = World::build(&scene_of(vec![mesh_of(&triangles)]));
    for power in [-20, -3, 7, 20] {
        let scale = 2.0_f32.powi(power);
        let larger: Vec<_> = triangles.iter().map(|t| t.map(|p| p * scale)).collect();
        let scaled = World::build(&scene_of(vec![mesh_of(&larger)]));
        for _ in 0..1000 {
            let (origin, direction) = (dice.point(), dice.direction());
            let ray = Ray { origin, direction, t_max: f32::INFINITY };
            let scaled_ray = Ray { origin: origin * scale, direction: direction * scale, t_max: f32::INFINITY };
            assert_eq!(world.closest(&ray), scaled.closest(&scaled_ray));
        }
    }
}

#[test]
fn nonsense_rays_hit_nothing_and_do_not_panic() {
    let world = World::build(&scene_of(vec![mesh_of(&soup(&mut Dice(9), 500, 0.5))]));
    let nonsense = [
        (Vec3::ZERO, Vec3::ZERO),
        (Vec3::NAN, Vec3::X),
        (Vec3::ZERO, Vec3::NAN),
        (Vec3::INFINITY, Vec3::X),
        (Vec3::ZERO, Vec3::new(f32::INFINITY, 0.0, 0.0)),
    ];
    for (origin, direction) in nonsense {
        let ray = Ray { origin, direction, t_max: f32::INFINITY };
        assert_eq!(world.closest(&ray), None, "{ray:?}");
        assert!(!world.occluded_along(&ray));
    }
    let backwards = Ray { origin: Vec3::ZERO, direction: Vec3::X, t_max: -1.0 };
    assert_eq!(world.closest(&backwards), None);
    assert_eq!(world.closest(&Ray { t_max: f32::NAN, ..backwards }), None);
}

#[test]
fn builders_worst_cases_take_no_quadratic_time() {
    let one = [Vec3::ZERO, Vec3::X, Vec3::Y];
    let row = |i: usize| one.map(|p| p + Vec3::X * i as f32);
    for triangles in [vec![one; 100_000], (0..100_000).map(row).collect()] {
        let world = World::build(&scene_of(vec![mesh_of(&triangles)]));
        let ray = Ray { origin: Vec3::new(0.25, 0.25, 1.0), direction: Vec3::NEG_Z, t_max: f32::INFINITY };
        assert_eq!(world.closest(&ray).map(|hit| hit.triangle), Some(0));
    }
}

#[test]
fn holes_let_rays_through() {
    // Left half of the image absent.
    let texels = vec![[255, 255, 255, 0], [255, 255, 255, 255]];
    let texture =
        Texture { name: String::new(), width: 2, height: 1, pixels: Pixels::Srgb8(texels), wrap: Wrap::Clamp };
    let mut mesh = mesh_of(&[[Vec3::ZERO, Vec3::X, Vec3::Y], [Vec3::ZERO, Vec3::X, Vec3::Y].map(|p| p - Vec3::Z)]);
    mesh.uvs = mesh.positions.iter().map(|p| Vec2::new(p.x, p.y)).collect();
    mesh.materials[1] = 1;
    let mut scene = scene_of(vec![mesh]);
    scene.materials.push(Material::diffuse("", Vec3::ONE));
    scene.materials[0].alpha = Some(AlphaCut { texture: 0, channel: 3, threshold: 0.5 });
    scene.textures.push(texture);
    let world = World::build(&scene);
    for (x, triangle) in [(0.25, 1), (0.75, 0)] {
        let origin = Vec3::new(x, 0.1, 1.0);
        let ray = Ray { origin, direction: Vec3::NEG_Z, t_max: f32::INFINITY };
        assert_eq!(world.closest(&ray).map(|hit| hit.triangle), Some(triangle));
        assert_eq!(world.occluded(origin, Vec3::new(x, 0.1, -0.5)), triangle == 0);
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
