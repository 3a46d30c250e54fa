//! Primary rays in packets against the same rays one by one.

use super::*;

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
