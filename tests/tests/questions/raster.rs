//! What the master finds by rasterising is what rays meet.

use std::path::Path;

use ::light::Prepared;
use ::light::bvh::Ray;
use frame::parts::raster::{Hit, Raster};
use scenes::{Camera, Coverage, Material, Scene};

/// Steps of a pixel that vertices are snapped to, and some more for rounding.
const BESIDE: f32 = 1.5 / 256.0;

/// Compares all pixels with rays through their middles, and the others with rays that pass next to these. Returns how many agree
/// with the ray through the middle itself, how many with none, and how many there are.
fn compare(scene: &Scene, camera: &Camera) -> [usize; 3] {
    let prepared = Prepared::new(scene.clone());
    let lens = camera.lens();
    let mut raster = Raster::new();
    raster.draw(scene, camera);
    let forward = lens.axes()[2];
    let agrees = |hit: Option<Hit>, x: f32, y: f32| {
        let direction = lens.direction(x, y);
        let start = lens.start(direction);
        let ray = Ray { origin: lens.origin() + direction * start, direction, t_max: f32::INFINITY };
        match (hit, prepared.world.closest(&ray)) {
            (None, None) => true,
            (Some(hit), Some(met)) => {
                let depth = (met.t + start) * direction.dot(forward);
                let is_there = (hit.depth - depth).abs() <= 1e-5 * depth;
                let is_same = (hit.object, hit.triangle) == (met.object, met.triangle);
                // On one triangle the place says more than the depth; two that lie on each other are told apart by rounding.
                let off = [hit.uv[0] - met.u, hit.uv[1] - met.v].map(f32::abs);
                is_there && (!is_same || off[0].max(off[1]) < 0.02)
            }
            _ => false,
        }
    };
    let (mut exact, mut lost) = (0, 0);
    let pixels = raster.width() * raster.height();
    for pixel in 0..pixels {
        let [x, y] = [pixel % raster.width(), pixel / raster.width()].map(|at| at as f32 + 0.5);
        let hit = raster.hit(pixel);
        if agrees(hit, x, y) {
            exact += 1;
            continue;
        }
        let around = [-BESIDE, 0.0, BESIDE];
        let agrees = around.iter().any(|dy| around.iter().any(|dx| agrees(hit, x + dx, y + dy)));
        lost += usize::from(!agrees);
    }
    [exact, lost, pixels]
}

#[test]
fn what_is_seen_is_what_rays_meet() {
    let mut scenes = vec![crate::world::room()];
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenes");
    for name in ["cornell", "veach_door", "conference"] {
        scenes.push(scenes::read::load(&folder.join(name)).expect("it is shipped").scene);
    }
    for mut scene in scenes {
        // Rays meet what is there in part by chance.
        let whole = |material: &Material| material.coverage.is_none_or(|Coverage { cutoff, .. }| cutoff.is_some());
        scene.materials.iter_mut().filter(|material| !whole(material)).for_each(|material| material.coverage = None);
        let camera = Camera { width: 200, height: 150, ..scene.camera };
        let within = Camera { origin: scene.camera.target, target: scene.camera.origin, fov_y_deg: 90.0, ..camera };
        // Half-way to what people look at, from a little aside, and with verticals upright.
        let half = camera.origin.lerp(camera.target, 0.5) + 0.05 * camera.target.distance(camera.origin) * camera.up;
        let cut = Camera { target: half, cut: true, ..camera };
        let upright = Camera { target: half, two_point: true, ..camera };
        for camera in [camera, within, cut, upright, Camera { cut: true, ..upright }] {
            let [exact, lost, all] = compare(&scene, &camera);
            // What is seen nearly edge-on is thinner than the steps that vertices are snapped to: no ray may meet it.
            let is_fine = exact as f64 > 0.999 * all as f64 && lost * 2_000 <= all;
            assert!(is_fine, "{}: of {all} pixels, {exact} are as their rays, {lost} as none", scene.name);
        }
    }
}
