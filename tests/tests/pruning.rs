//! Leaving out what a scene does not need changes no bit: the whole pipeline, every stage forced to run, and the
//! pruned one, on shipped scenes and on many that are made up; and counters of what is left out read 0.

use std::cell::Cell;
use std::path::Path;
use std::sync::Arc;

use cases::worlds::build::{Build, Fronts};
use frame::{Absorbed, Answered, Filter, FrontEnd, Igi, Plane, Setup};
use glam::{Mat3, Vec2, Vec3};
use light::{LightSetCache, Prepared};
use proptest::prelude::*;
use protocol::answer::{Answer, Body, Cost, CostStage, Fields, Pixels};
use protocol::pack;
use protocol::question::{Asked, Bound, Motion, Quality, Scramble};
use runtime::pruning::plain_room::{laden_room, plain_room};
use scenes::{
    Colour, Coverage, Dielectric, Environment, Gloss, Keep, Light, LookUp, Material, Needs, Object, Pixels as Texels,
    Scalar, Scene, Surface, Texture, Transform,
};

/// What some frames are made of.
struct Drawn {
    needs: Needs,
    cost: Cost,
    /// Every number of every answer, before it is packed.
    numbers: Vec<u32>,
    /// Of what the master shows, unfiltered and filtered.
    pictures: [[u8; 32]; 2],
}

/// Frames by the whole way: question, light, record, film, filter. The clock counts how often a stage is timed.
fn draw(scene: &Scene, keep: Keep, quality: Quality, frames: u32) -> Drawn {
    let prepared = Prepared::keeping(scene.clone(), keep);
    let (cache, fields) = (LightSetCache::default(), Fields::of(&prepared.needs));
    let filter = Filter::plane(quality.interleave);
    let (camera, world) = (scene.camera, Default::default());
    let mut front = Igi::new(Setup { world, camera, quality, fields, seed: 7, filter });
    front.set_limit(frames);
    let (mut cost, mut numbers) = (Cost::default(), Vec::new());
    let ticks = Cell::new(0);
    let clock = || {
        ticks.set(ticks.get() + 1);
        ticks.get()
    };
    while !front.is_finished() {
        for Asked { ticket, question } in front.ask(64) {
            let Answer { mut body, cost: paid } = light::answer(&prepared, &cache, &question, &clock);
            cost += paid;
            if let Body::Pixels(pixels) = &body {
                numbers.extend(bits(pixels));
            }
            cost.dropped += pack::drop_unsound(&mut body);
            let packed = pack::pack(&question, &body, fields);
            let body = pack::unpack(&question, &packed, fields).expect("what was packed can be unpacked");
            assert_ne!(front.absorb(Answered { ticket, body, worker: 0, cost: &paid }), Absorbed::Unwanted);
        }
    }
    let pictures = [Plane::Raw, Plane::Final].map(|layer| front.show(layer).sha256());
    Drawn { needs: Needs::of(scene), cost, numbers, pictures }
}

fn bits(pixels: &Pixels) -> Vec<u32> {
    let vectors = [&pixels.emitted, &pixels.reflectance, &pixels.irradiance, &pixels.normal];
    let numbers = vectors.into_iter().flatten().flat_map(|v| v.to_array()).chain(pixels.distance.iter().copied());
    numbers.map(f32::to_bits).collect()
}

/// Both pipelines, and what they must have in common. Returns the pruned one's cost, and the whole one's.
fn compare(scene: &Scene, quality: Quality, frames: u32) -> Result<[Cost; 2], TestCaseError> {
    let whole = draw(scene, Keep::All, quality, frames);
    let pruned = draw(scene, Keep::Needed, quality, frames);
    prop_assert_eq!(whole.numbers.len(), pruned.numbers.len());
    let first = whole.numbers.iter().zip(&pruned.numbers).position(|(a, b)| a != b);
    prop_assert!(
        first.is_none(),
        "{}: number {first:?} of {} differs: {:?}, {:?}",
        scene.name,
        whole.numbers.len(),
        first.map(|at| f32::from_bits(whole.numbers[at])),
        first.map(|at| f32::from_bits(pruned.numbers[at]))
    );
    prop_assert_eq!(whole.pictures, pruned.pictures, "{}: the master shows something else", scene.name);

    let (needs, cost) = (pruned.needs, pruned.cost);
    let lit = needs.light() && needs.diffuse > 0;
    if !lit {
        prop_assert_eq!([cost.shadow_rays, cost.compensation_rays, cost.light_rays], [0; 3]);
    }
    if !needs.caustics() || quality.photons == 0 {
        prop_assert_eq!([cost.photon_queries, cost.micros_of(CostStage::Photons)], [0; 2]);
        // No photon was shot either: none is missed where none is allowed.
        let without = draw(scene, Keep::Needed, Quality { photons: 0, ..quality }, frames).cost.light_rays;
        prop_assert_eq!(cost.light_rays, without);
    }
    // Rays follow rough lobes whatever the bound.
    let cut_off = quality.bias_compensation && (quality.bound != Bound::None || needs.glossy > 0);
    if !lit || !(cut_off || (quality.indirect_caustics && needs.caustics())) {
        prop_assert_eq!([cost.compensation_rays, cost.micros_of(CostStage::BiasCompensation)], [0; 2]);
    }
    Ok([pruned.cost, whole.cost])
}

/// A scene made up: which materials are used where, and what shines.
#[derive(Clone, Debug)]
struct Recipe {
    /// Materials that may be used: most features are missing from most scenes.
    palette: Vec<usize>,
    /// Which of the palette the room's faces, the ball and the block have.
    paints: [usize; 8],
    /// Point, spot, directional light, constant and image environment.
    lights: [bool; 5],
    power: f32,
    uvs: bool,
    normals: bool,
    moved: bool,
    hidden: bool,
}

/// How many materials [`materials`] makes.
const MATERIALS: usize = 12;

fn materials() -> [Material; MATERIALS] {
    let surface = |surface| Material { surface, ..Material::diffuse("surface", Vec3::ZERO) };
    let papered = Colour { value: Vec3::new(0.8, 0.7, 0.6), texture: Some(0) };
    let lamp = |texture| Material {
        emission: Colour { value: Vec3::new(3.0, 2.0, 1.0), texture },
        ..Material::diffuse("lamp", Vec3::splat(0.3))
    };
    let glossy = |base, roughness| Surface::Glossy(Gloss::new(base, roughness, Scalar::plain(0.3)));
    let plain = Colour::plain(Vec3::new(0.5, 0.4, 0.3));
    [
        Material::diffuse("grey", Vec3::splat(0.6)),
        Material::diffuse("black", Vec3::ZERO),
        surface(Surface::Mirror { reflectance: Vec3::splat(0.8) }),
        surface(Surface::Dielectric(Dielectric {
            transmittance: Colour::plain(Vec3::splat(0.9)),
            ..Dielectric::clear(1.5, false)
        })),
        surface(Surface::Dielectric(Dielectric::clear(1.5, true))),
        surface(glossy(plain, Scalar::plain(0.7))),
        surface(glossy(plain, Scalar::plain(0.1))),
        surface(Surface::Diffuse { albedo: papered }),
        Material { coverage: Some(Coverage::mask(0, 3, 0.5)), ..Material::diffuse("lace", Vec3::splat(0.5)) },
        lamp(None),
        lamp(Some(0)),
        surface(glossy(papered, Scalar { value: 0.9, texture: Some((0, 1)) })),
    ]
}

fn textures() -> Vec<Texture> {
    let texel = |i: u8| [40 + 30 * (i % 7), 255 - 20 * (i % 5), 80 + 9 * i, if i.is_multiple_of(3) { 0 } else { 255 }];
    let texture = |pixels| Texture { name: "texture".into(), width: 4, height: 4, pixels, look_up: LookUp::REPEAT };
    vec![
        texture(Texels::Srgb8((0..16).map(texel).collect())),
        texture(Texels::Float((0..16).map(|i| [i as f32 * 0.1, 0.2, 0.4]).collect())),
    ]
}

/// Places for all materials, which follow with their textures.
fn unpainted(name: &str) -> Build {
    let mut build = Build::new(name);
    (0..MATERIALS).for_each(|_| _ = build.paint(0.5, 0.0));
    build
}

impl Recipe {
    fn scene(&self) -> Scene {
        let mut build = unpainted("made up");
        let paint = |place: usize| self.palette[self.paints[place] % self.palette.len()] as u32;
        build.room(1.0, std::array::from_fn(paint));
        build.sphere(Vec3::new(0.3, -0.4, -0.2), 0.35, 2, Fronts::Outwards, paint(6));
        let [point, spot, directional, constant, image] = self.lights;
        let power = Vec3::splat(self.power);
        let position = Vec3::new(0.1, 0.8, 0.3);
        let direction = Vec3::new(0.0, -0.8, -0.6);
        if point {
            build.light(Light::Point { position, intensity: power });
        }
        if spot {
            build.light(Light::Spot { position, direction, intensity: power, cos_inner: 0.9, cos_outer: 0.7 });
        }
        if directional {
            build.light(Light::Directional { direction, irradiance: power, diameter_deg: 0.0 });
        }
        // The camera looks into the room through its wall, which is behind it.
        let mut scene = build.seen(Vec3::new(0.0, 0.1, 0.9), Vec3::new(0.0, -0.1, 0.0), 70.0, 9);
        (scene.materials, scene.textures) = (materials().into(), textures().into_iter().map(Arc::new).collect());
        scene.environment = match (constant, image) {
            (true, _) => Environment::Constant(power),
            (_, true) => Environment::Image { texture: 1, scale: power, turn: 0.0 },
            _ => Environment::Black,
        };
        let room = Arc::make_mut(&mut scene.meshes[0]);
        if self.uvs {
            room.uvs = room.positions.iter().map(|p| Vec2::new(p.x + p.z, p.y)).collect();
        }
        if self.normals {
            room.normals = room.positions.iter().map(|p| -p.normalize()).collect();
        }
        // A second object, which is the ball alone.
        let mut ball = unpainted("ball");
        ball.sphere(Vec3::new(-0.4, -0.5, 0.0), 0.3, 2, Fronts::Outwards, paint(7));
        let ball = ball.seen(Vec3::ZERO, Vec3::X, 40.0, 4).meshes.remove(0);
        scene.meshes.push(ball);
        let place = Transform { linear: Mat3::from_rotation_y(0.5), translation: Vec3::new(0.1, 0.2, 0.0) };
        let scene_from_object = if self.moved { place } else { Transform::IDENTITY };
        scene.objects.push(Object { scene_from_object, visible: !self.hidden, ..Object::fixed("ball", 1) });
        scene.check().expect("made-up scenes are sound");
        scene
    }
}

fn recipes() -> impl Strategy<Value = Recipe> {
    let palette = prop::collection::vec(0..MATERIALS, 1..4);
    let power = prop_oneof![4 => 0.1..10.0_f32, 1 => Just(0.0_f32)];
    let lights = prop::array::uniform5(prop::bool::weighted(0.3));
    let flags = prop::array::uniform4(any::<bool>());
    (palette, prop::array::uniform8(0..8_usize), lights, power, flags).prop_map(
        |(palette, paints, lights, power, [uvs, normals, moved, hidden])| Recipe {
            palette,
            paints,
            lights,
            power,
            uvs,
            normals,
            moved,
            hidden,
        },
    )
}

fn qualities() -> impl Strategy<Value = Quality> {
    let bound = prop_oneof![
        Just(Bound::None),
        Just(Bound::Clip { distance: 0.05 }),
        Just(Bound::Geometry { distance: 0.1 }),
        Just(Bound::Smooth { distance: 0.1 }),
    ];
    let counts = (1..4_u8, 1..5_u16, 1..6_u16, prop_oneof![Just(0), Just(40_u32)], 1..4_u8);
    let flags = prop::array::uniform5(any::<bool>());
    (bound, counts, flags, prop_oneof![Just(None), (0..4_u8).prop_map(Some)], 0..3_u8).prop_map(
        |(bound, (n, light_samples, vpls, photons, replicates), flags, max_length, motion)| {
            let [bias_compensation, importance, indirect_caustics, shrink_radius, owen] = flags;
            Quality {
                interleave: [n, 2],
                light_samples,
                vpls,
                photons,
                bound,
                bias_compensation,
                importance,
                max_length,
                indirect_caustics,
                photon_radius: 0.05,
                shrink_radius,
                scramble: if owen { Scramble::Owen } else { Scramble::Xor },
                motion: [Motion::Still, Motion::Moving, Motion::Fresh][usize::from(motion)],
                replicates,
                illuminance: false,
            }
        },
    )
}

proptest! {
    #![proptest_config(ProptestConfig { cases: cases(), ..ProptestConfig::default() })]

    #[test]
    fn made_up_scenes_do_not_change_when_nothing_is_left_out(recipe in recipes(), quality in qualities()) {
        compare(&recipe.scene(), quality, 2)?;
    }
}

/// As many as `PROPTEST_CASES` says, or few enough for every day.
fn cases() -> u32 {
    std::env::var("PROPTEST_CASES").ok().and_then(|cases| cases.parse().ok()).unwrap_or(200)
}

#[test]
fn shipped_scenes_do_not_change_when_nothing_is_left_out() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenes");
    let mut drawn = 0;
    for entry in std::fs::read_dir(folder).expect("scenes are there") {
        let path = entry.expect("an entry").path();
        if !path.join("scene.json").is_file() {
            continue;
        }
        let mut scene = scenes::read::load(&path).expect("shipped scenes can be read").scene;
        (scene.camera.width, scene.camera.height) = (20, 15);
        for quality in [Quality { photons: 200, ..Quality::default() }, Quality::paper()] {
            compare(&scene, quality, 1).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
        }
        drawn += 1;
    }
    assert!(drawn >= 5, "only {drawn} scenes");
}

/// The whole pipeline does work that the pruned one leaves out: otherwise the tests above compare it with itself.
#[test]
fn a_plain_room_needs_little_of_the_whole_pipeline() {
    let mut scene = plain_room();
    (scene.camera.width, scene.camera.height) = (24, 24);
    let quality = Quality { photons: 100, ..Quality::default() };
    let [pruned, whole] = compare(&scene, quality, 2).unwrap();
    assert_eq!([pruned.photon_queries, pruned.micros_of(CostStage::Photons)], [0; 2]);
    assert!(whole.photon_queries > 0 && whole.micros_of(CostStage::Photons) > 0);
    // A photon that meets a diffuse wall at once costs one ray. Of the pilot's none arrives, so that one in sixteen is shot
    // after it; there are nine sets, twice. And 64 rays find no gloss.
    assert_eq!(whole.light_rays - pruned.light_rays, 64 + 512 + 2 * 9 * (100 / 16));
    let dark = Scene { lights: vec![], ..scene };
    let [pruned, whole] = compare(&dark, quality, 2).unwrap();
    assert_eq!(pruned.rays(), pruned.eye_rays, "in the dark, only eye paths are left");
    assert!(whole.compensation_rays > 0);
}

/// What is in a file and takes no part in the picture costs nothing and changes nothing.
#[test]
fn things_that_nobody_sees_are_left_out() {
    let quality = Quality { photons: 100, ..Quality::default() };
    let [plain, laden] = [plain_room(), laden_room()].map(|mut scene| {
        scene.check().unwrap();
        (scene.camera.width, scene.camera.height) = (24, 24);
        draw(&scene, Keep::Needed, quality, 2)
    });
    assert_eq!((plain.needs, plain.numbers, plain.cost), (laden.needs, laden.numbers, laden.cost));
    assert_eq!(plain.pictures, laden.pictures);
}
