//! Edges of numbers and of shapes: shared edges, needles, planes along rays, nonsense.

use super::*;

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
