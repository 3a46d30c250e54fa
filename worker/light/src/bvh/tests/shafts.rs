//! Shafts from lights, and parallel ones, against the same rays one by one.

use super::*;

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
            // What lies where is no matter to a direction.
            for direction in [apex, Vec3::new(0.0, apex.y, -0.0), Vec3::new(apex.x, 0.0, apex.z)] {
                check_parallel(&world, direction, &targets, &wanted, &mut scratch);
            }
        }
    }
}

fn check_parallel(world: &World, direction: Vec3, targets: &Targets, wanted: &[u64], scratch: &mut ShaftScratch) {
    let mut visible = vec![0; wanted.len()];
    world.shade_along(direction, targets, wanted, scratch, &mut visible);
    for (i, &origin) in targets.points().iter().enumerate() {
        let sees = visible[i / 64] >> (i % 64) & 1 != 0;
        let asked = wanted[i / 64] >> (i % 64) & 1 != 0;
        let single = !world.occluded_along(&Ray { origin, direction, t_max: f32::INFINITY });
        assert_eq!(sees, asked && single, "{origin} along {direction}");
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
