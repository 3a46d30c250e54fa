//! Against every triangle, ray by ray, in `f64`.

use glam::{DVec3, Mat3, Vec2, Vec3};
use proptest::prelude::*;
use scenes::{Change, Coverage, LookUp, Material, Mesh, Object, Pixels, Texture, Transform};

use super::*;

/// Deterministic numbers in 0..1.
struct Dice(u32);

impl Dice {
    fn roll(&mut self) -> f32 {
        self.0 = self.0.wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
        let word = (self.0 >> ((self.0 >> 28) + 4) ^ self.0).wrapping_mul(277_803_737);
        ((word >> 22 ^ word) >> 8) as f32 / 16_777_216.0
    }

    fn within(&mut self, size: f32) -> Vec3 {
        Vec3::from_array([0; 3].map(|_| (self.roll() * 2.0 - 1.0) * size))
    }
}

fn scene(triangles: &[[Vec3; 3]]) -> Scene {
    Scene {
        meshes: vec![mesh(triangles).into()],
        objects: vec![Object::fixed("all", 0)],
        materials: vec![Material::diffuse("grey", Vec3::splat(0.5))],
        ..Scene::default()
    }
}

fn mesh(triangles: &[[Vec3; 3]]) -> Mesh {
    Mesh {
        positions: triangles.iter().flatten().copied().collect(),
        triangles: (0..triangles.len() as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect(),
        materials: vec![0; triangles.len()],
        ..Mesh::default()
    }
}

fn camera(width: u32, height: u32) -> Camera {
    Camera { width, height, ..Camera::default() }
}

fn draw(scene: &Scene, camera: &Camera) -> Raster {
    let mut raster = Raster::new();
    raster.draw(scene, camera);
    raster
}

/// Object, triangle and depth of what a ray through a place of the picture meets first.
fn meet(scene: &Scene, camera: &Camera, x: f64, y: f64) -> Option<(u32, u32, f64)> {
    let lens = camera.lens();
    let [right, down, forward] = lens.axes().map(|axis| axis.as_dvec3());
    let half = [camera.width, camera.height].map(|side| f64::from(side) / 2.0);
    let pixel = f64::from(lens.pixel());
    let direction = right * ((x - half[0]) * pixel) + down * ((y - half[1]) * pixel) + forward;
    let origin = lens.origin().as_dvec3();
    let mut best: Option<(u32, u32, f64)> = None;
    for (number, object) in (0..).zip(&scene.objects).filter(|(_, object)| object.visible) {
        let mesh = &scene.meshes[object.mesh as usize];
        for triangle in scene.triangles(number as usize) {
            let corners = mesh.triangles[triangle].map(|vertex| mesh.positions[vertex as usize]);
            let [a, b, c] = corners.map(|corner| object.scene_from_object.point(corner).as_dvec3() - origin);
            let over: [DVec3; 3] = [b.cross(c), c.cross(a), a.cross(b)];
            let volume = a.dot(over[0]);
            let weights = over.map(|over| direction.dot(over) / volume);
            let inverse: f64 = weights.iter().sum();
            let is_met = weights.iter().all(|weight| *weight >= 0.0) && inverse > 0.0 && inverse.is_finite();
            if is_met && best.is_none_or(|(.., depth)| 1.0 / inverse < depth * (1.0 - 1e-7)) {
                best = Some((number, triangle as u32, 1.0 / inverse));
            }
        }
    }
    best
}

/// Every pixel sees what a ray through its middle meets, or one through a place next to it. Returns how many see something.
fn check(scene: &Scene, camera: &Camera) -> usize {
    const STEP: f64 = 1.5 / 256.0;
    let raster = draw(scene, camera);
    let mut seen = 0;
    for pixel in 0..raster.width() * raster.height() {
        let [x, y] = [pixel % raster.width(), pixel / raster.width()].map(|at| at as f64 + 0.5);
        let hit = raster.hit(pixel);
        seen += usize::from(hit.is_some());
        let is_like = |expected: Option<(u32, u32, f64)>| match (hit, expected) {
            (None, None) => true,
            (Some(hit), Some((object, triangle, depth))) => {
                // Of two that lie there, either.
                let is_same = (hit.object, hit.triangle) == (object, triangle);
                is_same || (f64::from(hit.depth) - depth).abs() < 1e-6 * depth
            }
            _ => false,
        };
        let beside = [[0.0, 0.0], [-STEP, 0.0], [STEP, 0.0], [0.0, -STEP], [0.0, STEP], [-STEP, -STEP], [STEP, STEP]];
        let beside = beside.map(|[dx, dy]| meet(scene, camera, x + dx, y + dy));
        assert!(beside.into_iter().any(is_like), "pixel {x} {y}: {hit:?}, but rays meet {beside:?}");
        if let Some(hit) = hit {
            let lens = camera.lens();
            let place = scene.place(&hit.point(scene)).expect("it is there");
            let (at_x, at_y, _) = lens.project(place).expect("it is in front");
            let off = (f64::from(at_x) - x).abs().max((f64::from(at_y) - y).abs());
            // Of a triangle that is large beside its distance, single precision tells places no better.
            let mesh = &scene.meshes[scene.objects[hit.object as usize].mesh as usize];
            let corners = mesh.triangles[hit.triangle as usize].map(|vertex| mesh.positions[vertex as usize]);
            let reach = corners.iter().fold(0.0_f32, |reach, corner| reach.max(corner.abs().max_element()));
            let rounding = 8.0 * f32::EPSILON * reach / (hit.depth * lens.pixel());
            assert!(off < 0.02 + f64::from(rounding), "pixel {x} {y}: {hit:?} is seen {off} beside");
            let depth = (place - lens.origin()).dot(lens.axes()[2]);
            assert!((depth - hit.depth).abs() < depth * (0.01 + rounding), "pixel {x} {y}: {hit:?} lies at {depth}");
        }
    }
    seen
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    /// Some of them behind the eye, some through it, some far aside.
    #[test]
    fn triangles_of_any_size_anywhere_are_seen_as_rays_see_them(seed: u32, reach in 0_u32..4) {
        let mut dice = Dice(seed);
        let triangles: Vec<[Vec3; 3]> = (0..40)
            .map(|_| {
                let middle = dice.within(3.0);
                let size = [0.1, 1.0, 30.0, 1e4][reach as usize] * dice.roll();
                [0; 3].map(|_| middle + dice.within(size))
            })
            .collect();
        let camera = Camera { origin: dice.within(2.0), target: dice.within(1.0), ..camera(40, 30) };
        prop_assume!(camera.check().is_ok());
        check(&scene(&triangles), &camera);
    }

    /// Edges through middles of pixels, in all directions: no pixel is left out, and none belongs to two.
    #[test]
    fn triangles_that_fit_together_cover_each_pixel_once(seed: u32) {
        let mut dice = Dice(seed);
        // Whole pixels apart, at depth 1, where a pixel is `pixel` wide.
        let camera = Camera { origin: Vec3::ZERO, target: Vec3::NEG_Z, ..camera(33, 21) };
        let pixel = camera.lens().pixel();
        let at = |x: f32, y: f32| Vec3::new((x - 16.5) * pixel, (10.5 - y) * pixel, -1.0);
        let mut snapped = |size: f32| (dice.roll() * size * 2.0).round() / 2.0;
        let hub = at(snapped(33.0), snapped(21.0));
        let rim: Vec<Vec3> = [(0.0, 0.0), (snapped(33.0), 0.0), (33.0, 0.0), (33.0, snapped(21.0)), (33.0, 21.0),
            (snapped(33.0), 21.0), (0.0, 21.0), (0.0, snapped(21.0))].iter().map(|(x, y)| at(*x, *y)).collect();
        let fan: Vec<[Vec3; 3]> = (0..8).map(|i| [hub, rim[i], rim[(i + 1) % 8]]).collect();
        let mut covered = vec![0; 33 * 21];
        for triangle in &fan {
            let raster = draw(&scene(&[*triangle]), &camera);
            covered.iter_mut().enumerate().for_each(|(pixel, times)| *times += u32::from(raster.hit(pixel).is_some()));
        }
        prop_assert!(covered.iter().all(|times| *times == 1), "{covered:?}");
    }
}

/// A room of so many sides, seen from within.
fn room(size: f32) -> Vec<[Vec3; 3]> {
    let corner = |i: usize| Vec3::new((i & 1) as f32 - 0.5, (i >> 1 & 1) as f32 - 0.5, (i >> 2) as f32 - 0.5) * size;
    let quads = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]];
    quads.iter().flat_map(|[a, b, c, d]| [[*a, *b, *c], [*a, *c, *d]]).map(|t: [usize; 3]| t.map(corner)).collect()
}

#[test]
fn a_room_is_closed_wherever_in_it_the_eye_is() {
    let scene = scene(&room(4.0));
    for origin in [Vec3::ZERO, Vec3::splat(1.999_999), Vec3::new(1.9999, 0.0, -1.9999), Vec3::new(2.0, 0.3, 0.1)] {
        for target in [Vec3::new(0.1, 0.0, 0.0), Vec3::new(-3.0, 0.5, 0.2), Vec3::new(3.0, 0.5, 9.0)] {
            let camera = Camera { origin, target, fov_y_deg: 100.0, ..camera(48, 36) };
            let seen = check(&scene, &camera);
            let is_within = origin.abs().max_element() < 2.0;
            assert!(!is_within || seen == 48 * 36, "{origin} {target}: {seen}");
        }
    }
}

#[test]
fn needles_and_planes_as_large_as_the_world_are_seen() {
    let ground = [[-1e6, -1.0, 1e6], [1e6, -1.0, 1e6], [0.0, -1.0, -1e6]].map(Vec3::from);
    // A million times as long as they are wide.
    let needle = |x: f32| [[x, -3.0, 0.0], [x + 6e-6, -3.0, 0.0], [x, 3.0, 0.0]].map(Vec3::from);
    let mut triangles = vec![ground];
    triangles.extend((0..50).map(|i| needle(i as f32 * 0.02)));
    let seen = check(&scene(&triangles), &camera(80, 60));
    assert!(seen > 80 * 20, "the ground is half of the picture: {seen}");
}

#[test]
fn one_triangle_may_fill_a_picture_of_any_size() {
    let scene = scene(&[[[-9e3, -9e3, 0.0], [9e3, -9e3, 0.0], [0.0, 9e3, 0.0]].map(Vec3::from)]);
    for [width, height] in [[1, 1], [1, 77], [77, 1], [17, 16], [4096, 4096]] {
        let raster = draw(&scene, &camera(width, height));
        assert!(raster.facets_seen.iter().all(|facet| *facet != NONE), "{width} {height}");
        let depths = raster.inverse_depths();
        assert!(
            depths.len() == (width * height) as usize && depths.iter().all(|depth| (depth * 3.0 - 1.0).abs() < 1e-6)
        );
    }
    // It is drawn again, smaller, and larger.
    let mut raster = draw(&scene, &camera(40, 30));
    raster.draw(&scene, &camera(10, 10));
    raster.draw(&Scene::default(), &camera(20, 50));
    assert!((0..1000).all(|pixel| raster.hit(pixel).is_none()) && raster.hit(1000).is_none());
}

#[test]
fn of_equals_the_first_is_seen_whichever_corner_it_begins_with() {
    let mut dice = Dice(7);
    for _ in 0..50 {
        let [a, b, c] = [0; 3].map(|_| dice.within(1.5));
        let mut scene = scene(&[[b, c, a], [a, b, c], [c, a, b], [b, a, c]]);
        scene.objects.push(Object::fixed("again", 0));
        let raster = draw(&scene, &camera(40, 30));
        for pixel in 0..40 * 30 {
            let hit = raster.hit(pixel);
            assert!(hit.is_none_or(|hit| (hit.object, hit.triangle) == (0, 0)), "{hit:?}");
        }
    }
}

#[test]
fn sides_are_told_apart_and_mirrored_things_have_theirs() {
    // Counter-clockwise as seen by the eye.
    let front = [[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [0.0, 1.0, 0.0]].map(Vec3::from);
    let side = |object: Transform, triangle: [Vec3; 3]| {
        let mut scene = scene(&[triangle]);
        scene.objects[0].scene_from_object = object;
        draw(&scene, &camera(9, 9)).hit(40).expect("it is in the middle").back
    };
    let [a, b, c] = front;
    let mirrored = Transform { linear: Mat3::from_diagonal(Vec3::new(-1.0, 1.0, 1.0)), translation: Vec3::ZERO };
    assert!(!side(Transform::IDENTITY, [a, b, c]) && side(Transform::IDENTITY, [a, c, b]));
    assert!(!side(mirrored, [a, b, c]) && side(mirrored, [a, c, b]), "as the file means it, not as it lies");
}

#[test]
fn holes_are_seen_through_and_what_is_there_by_half() {
    let front = [[-9.0, -9.0, 1.0], [9.0, -9.0, 1.0], [0.0, 18.0, 1.0]].map(Vec3::from);
    let behind = front.map(|corner| corner - Vec3::Z);
    let mut scene = scene(&[front, behind]);
    let mesh = std::sync::Arc::make_mut(&mut scene.meshes[0]);
    // The left half of the texture is a hole; it reaches from −1 to 1.
    let at = |corner: Vec3| Vec2::new((corner.x + 1.0) / 2.0, 0.5);
    mesh.uvs = mesh.positions.iter().map(|corner| at(*corner)).collect();
    mesh.materials = vec![1, 0];
    let texels = vec![[0, 0, 0, 0], [0, 0, 0, 255]];
    let look_up = LookUp { nearest: true, ..LookUp::CLAMP };
    let texture = Texture { name: String::new(), width: 2, height: 1, pixels: Pixels::Linear8(texels), look_up };
    scene.textures.push(texture.into());
    scene.materials.push(Material { coverage: Some(Coverage::mask(0, 3, 0.5)), ..scene.materials[0].clone() });
    let raster = draw(&scene, &camera(32, 24));
    for pixel in 0..32 * 24 {
        let expected = u32::from(pixel % 32 < 16);
        assert_eq!(raster.hit(pixel).map(|hit| hit.triangle), Some(expected), "{pixel}");
    }
    for (amount, expected) in [(0.0, 1), (0.49, 1), (0.5, 0), (1.0, 0)] {
        scene.materials[1].coverage = Some(Coverage::plain(amount));
        let raster = draw(&scene, &camera(32, 24));
        assert!((0..32 * 24).all(|pixel| raster.hit(pixel).map(|hit| hit.triangle) == Some(expected)), "{amount}");
    }
}

#[test]
fn lifted_pieces_are_seen_where_they_are_and_named_by_their_whole() {
    let piece = |x: f32| [[x, -0.5, 0.0], [x + 1.0, -0.5, 0.0], [x, 0.5, 0.0]].map(Vec3::from);
    let mut scene = scene(&[piece(-1.5), piece(0.5)]);
    let camera = camera(64, 48);
    assert!(check(&scene, &camera) > 0);
    let whole_from_piece = Transform { translation: Vec3::new(-0.2, 0.7, 0.0), ..Transform::IDENTITY };
    Change::PieceTransform { object: 0, piece: 1, whole_from_piece }.apply(&mut scene).expect("there is such a piece");
    assert!(check(&scene, &camera) > 0);
    let raster = draw(&scene, &camera);
    let hits: Vec<Hit> = (0..64 * 48).filter_map(|pixel| raster.hit(pixel)).collect();
    assert!(hits.iter().any(|hit| hit.object == 0) && hits.iter().any(|hit| hit.object == 1));
    assert!(hits.iter().all(|hit| hit.triangle == hit.object && hit.point(&scene).object == 0));
    scene.objects[0].visible = false;
    let raster = draw(&scene, &camera);
    assert!((0..64 * 48).all(|pixel| raster.hit(pixel).is_none_or(|hit| hit.object == 1)));
}

#[test]
fn any_number_of_threads_draws_the_same() {
    let mut dice = Dice(3);
    let triangles: Vec<[Vec3; 3]> = (0..20_000)
        .map(|_| {
            let middle = dice.within(1.5);
            [0; 3].map(|_| middle + dice.within(0.05))
        })
        .collect();
    let (scene, camera) = (scene(&triangles), camera(320, 240));
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads can be had");
        let raster = pool.install(|| draw(&scene, &camera));
        let hits: Vec<_> = (0..320 * 240)
            .map(|pixel| raster.hit(pixel).map(|hit| (hit.object, hit.triangle, hit.uv.map(f32::to_bits))))
            .collect();
        (raster.inverse_depths().to_vec(), hits)
    };
    let one = with(1);
    assert!(one.0.iter().filter(|depth| **depth > 0.0).count() > 50_000);
    assert!(one == with(7));
}
