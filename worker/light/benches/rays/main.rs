//! Rays a second by kind, on the shipped scenes, one thread, beside Embree where it is installed.
//!
//! `cargo bench -p light --bench rays` (with `-- conference` for one scene, `-- 'b '` for one kind). A folder
//! that `IGI_SCENES` names is where scenes are looked for that are not shipped.
//! Embree is found at run time: on Debian, `apt-get install libembree-dev`. Without it, only our own
//! kernels are measured, and a line says so.
//!
//! Kinds, as in Embree's and our design notes' tables: **a** primary rays, singly and as packets (16×8 pixels);
//! **b** shadow rays from 20 virtual lights to all primary hits, as shafts (16×8 pixels) and singly; **c** closest
//! hits of cosine-distributed bounces; **d** short random occlusion rays.

mod embree;

use std::hint::black_box;
use std::path::{Path, PathBuf};

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use glam::Vec3;
use light::bvh::{PacketScratch, Ray, ShaftScratch, Targets, World};
use scenes::Scene;

const SCENES: [&str; 4] = ["cornell", "cornell_spheres", "conference", "sponza"];
const PICTURE: [u32; 2] = [320, 240];
const TILE: [u32; 2] = [16, 8];
const LIGHTS: usize = 20;

fn rays(criterion: &mut Criterion) {
    let embree = embree::Library::open();
    if embree.is_none() {
        eprintln!("Embree is not installed (Debian: apt-get install libembree-dev): no comparison with it.");
    }
    let shipped = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes");
    let others = std::env::var_os("IGI_SCENES").map(PathBuf::from);
    for name in SCENES {
        let folder = match &others {
            Some(others) if !shipped.join(name).exists() => others.join(name),
            _ => shipped.join(name),
        };
        match scenes::read::load(&folder) {
            Ok(loaded) => bench_scene(criterion, name, &loaded.scene, embree.as_ref()),
            Err(error) => eprintln!("{name} is left out: {error}"),
        }
    }
}

fn bench_scene(criterion: &mut Criterion, name: &str, scene: &Scene, embree: Option<&embree::Library>) {
    let world = World::build(scene);
    let sets = Sets::new(scene, &world);
    let peer = embree.map(|library| library.scene(scene));
    let mut group = criterion.benchmark_group(name);
    group.sample_size(10);

    group.throughput(Throughput::Elements(sets.primary.len() as u64));
    group.bench_function("a primary", |b| b.iter(|| count(&sets.primary, |ray| world.closest(ray).is_some())));
    group.bench_function("a primary, packets", |b| b.iter(|| packets(&world, &sets.primary)));
    if let Some(peer) = &peer {
        group.bench_function("a primary, Embree", |b| b.iter(|| count(&sets.primary, |ray| peer.closest(ray))));
    }

    let shadow_rays = sets.tiles.iter().map(Vec::len).sum::<usize>() * LIGHTS;
    group.throughput(Throughput::Elements(shadow_rays as u64));
    let targets: Vec<_> = sets.tiles.iter().map(|tile| Targets::new(tile.iter().copied())).collect();
    group.bench_function("b shadow, shafts", |b| b.iter(|| shafts(&world, &targets, &sets.lights)));
    group.bench_function("b shadow, single", |b| b.iter(|| sets.shadows(|from, to| world.occluded(from, to))));
    if let Some(peer) = &peer {
        group.bench_function("b shadow, Embree", |b| b.iter(|| sets.shadows(|from, to| peer.occluded(from, to))));
        let differ = sets.shadows(|from, to| world.occluded(from, to) != peer.occluded(from, to));
        eprintln!("{name}: {differ} of {shadow_rays} shadow rays differ from Embree's");
    }

    group.throughput(Throughput::Elements(sets.bounces.len() as u64));
    group.bench_function("c bounce", |b| b.iter(|| count(&sets.bounces, |ray| world.closest(ray).is_some())));
    group.bench_function("d short", |b| b.iter(|| count(&sets.short, |ray| world.occluded_along(ray))));
    if let Some(peer) = &peer {
        group.bench_function("c bounce, Embree", |b| b.iter(|| count(&sets.bounces, |ray| peer.closest(ray))));
        group.bench_function("d short, Embree", |b| b.iter(|| count(&sets.short, |ray| peer.occluded_along(ray))));
    }
    group.finish();
}

/// How many rays something holds for.
fn count(rays: &[Ray], mut holds: impl FnMut(&Ray) -> bool) -> usize {
    rays.iter().filter(|ray| holds(black_box(ray))).count()
}

/// How many rays of tiles, which share their origin, hit something.
fn packets(world: &World, rays: &[Ray]) -> usize {
    let mut scratch = PacketScratch::default();
    let (mut directions, mut hits) = (Vec::new(), Vec::new());
    let mut met = 0;
    for tile in rays.chunks((TILE[0] * TILE[1]) as usize) {
        directions.clear();
        directions.extend(tile.iter().map(|ray| ray.direction));
        hits.resize(tile.len(), None);
        world.closest_from(tile[0].origin, &directions, &mut scratch, &mut hits);
        met += hits.iter().flatten().count();
    }
    met
}

/// Shades all tiles from all lights; how many points see how many lights.
fn shafts(world: &World, tiles: &[Targets], lights: &[Vec3]) -> u32 {
    let mut scratch = ShaftScratch::default();
    let mut visible = [0; (TILE[0] * TILE[1]).div_ceil(64) as usize];
    let mut seen = 0;
    for targets in tiles {
        for light in lights {
            world.shade_shaft(*light, targets, &mut scratch, &mut visible);
            seen += visible.iter().map(|bits| bits.count_ones()).sum::<u32>();
        }
    }
    seen
}

/// The rays that are measured.
struct Sets {
    primary: Vec<Ray>,
    /// Surface points seen, a little above their surface, by tile of the picture.
    tiles: Vec<Vec<Vec3>>,
    lights: Vec<Vec3>,
    bounces: Vec<Ray>,
    short: Vec<Ray>,
}

impl Sets {
    fn new(scene: &Scene, world: &World) -> Self {
        let mut camera = scene.camera;
        [camera.width, camera.height] = PICTURE;
        let lens = camera.lens();
        let through = |x: u32, y: u32| Ray {
            origin: lens.origin(),
            direction: lens.direction(x as f32 + 0.5, y as f32 + 0.5),
            t_max: f32::INFINITY,
        };
        let tiles = (0..PICTURE[1] / TILE[1]).flat_map(|y| (0..PICTURE[0] / TILE[0]).map(move |x| [x, y]));
        let mut sets = Self { primary: vec![], tiles: vec![], lights: vec![], bounces: vec![], short: vec![] };
        let mut dice = Dice(1);
        let reach = world.bounds().diagonal().length() * 0.1;
        for [tile_x, tile_y] in tiles {
            // In order of 4×4 squares, as the renderer does.
            let squares = (0..TILE[1]).step_by(4).flat_map(|y| (0..TILE[0]).step_by(4).map(move |x| [x, y]));
            let pixels = squares.flat_map(|[x, y]| (0..16).map(move |i| [x + i % 4, y + i / 4]));
            let rays: Vec<_> = pixels.map(|[x, y]| through(tile_x * TILE[0] + x, tile_y * TILE[1] + y)).collect();
            let seen: Vec<_> = rays.iter().filter_map(|ray| surface(scene, world, ray)).collect();
            for &(origin, normal) in &seen {
                let direction = dice.cosine(normal);
                sets.bounces.push(Ray { origin, direction, t_max: f32::INFINITY });
                sets.short.push(Ray { origin, direction, t_max: reach * dice.unit() });
            }
            sets.tiles.push(seen.into_iter().map(|(point, _)| point).collect());
            sets.primary.extend(rays);
        }
        // Virtual lights are where bounces end; if few do, where they start.
        let ends = sets.bounces.iter().filter_map(|ray| surface(scene, world, ray)).map(|(point, _)| point);
        let all: Vec<_> = ends.chain(sets.bounces.iter().map(|ray| ray.origin)).collect();
        sets.lights = (0..LIGHTS).map(|_| all[(dice.unit() * all.len() as f32) as usize % all.len()]).collect();
        sets
    }

    /// For how many pairs of light and point something holds.
    fn shadows(&self, mut holds: impl FnMut(Vec3, Vec3) -> bool) -> usize {
        let mut total = 0;
        for tile in &self.tiles {
            for &light in &self.lights {
                total += tile.iter().filter(|&&point| holds(light, black_box(point))).count();
            }
        }
        total
    }
}

/// What a ray sees: a point a little off the surface, and the normal on this side.
fn surface(scene: &Scene, world: &World, ray: &Ray) -> Option<(Vec3, Vec3)> {
    let hit = world.closest(ray)?;
    let object = &scene.objects[hit.object as usize];
    let mesh = &scene.meshes[object.mesh as usize];
    let [p, q, r] = mesh.triangles[hit.triangle as usize]
        .map(|vertex| object.scene_from_object.point(mesh.positions[vertex as usize]));
    let normal = (q - p).cross(r - p).normalize();
    let normal = if normal.dot(ray.direction) > 0.0 { -normal } else { normal };
    Some((ray.origin + ray.direction * hit.t + normal * (hit.t * 1e-4), normal))
}

/// Small reproducible random numbers.
struct Dice(u64);

impl Dice {
    fn unit(&mut self) -> f32 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 40) as f32 / (1 << 24) as f32
    }

    fn cosine(&mut self, normal: Vec3) -> Vec3 {
        loop {
            let p = Vec3::new(self.unit(), self.unit(), self.unit()) * 2.0 - 1.0;
            if (1e-3..1.0).contains(&p.length_squared()) {
                return (normal + p.normalize() * 0.999).normalize();
            }
        }
    }
}

criterion_group!(benches, rays);
criterion_main!(benches);
