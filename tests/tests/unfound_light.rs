//! Light that sampling does not find shows in the error estimate: faults put in on purpose, each of which all replicates
//! share, so that they agree on a picture that is too dark.

use cases::worlds::skies::Sun;
use cases::worlds::{hunted, panes, skies};
use frame::front_end::Answered;
use frame::{Filter, FrontEnd, Igi, Setup};
use light::{LightSetCache, Prepared};
use protocol::answer::Fields;
use protocol::question::{Ask, Quality, Question, Rect, Samples};
use scenes::{Needs, Scene, Surface};

/// What the estimate says after some frames: light samples and virtual lights are made in
/// `sampled`, the path tracer sees `scene`.
fn estimate(scene: &Scene, sampled: &Scene, frames: u32) -> f64 {
    let camera = scene.camera;
    let asked = Quality::default();
    let fields = Fields::of(&Needs::of(scene));
    let setup = Setup {
        world: Default::default(),
        camera,
        quality: asked,
        fields,
        seed: 5,
        filter: Filter::plane(asked.interleave),
    };
    let mut igi = Igi::new(setup);
    igi.set_limit(frames);
    let (whole, sampled) = (Prepared::new(scene.clone()), Prepared::new(sampled.clone()));
    let caches = [LightSetCache::default(), LightSetCache::default()];
    while !igi.is_finished() {
        for asked in igi.ask(64) {
            let Question { world, ask } = asked.question.as_ref().clone();
            let (prepared, cache) = match &ask {
                Ask::Tile(_) => (&sampled, &caches[0]),
                _ => (&whole, &caches[1]),
            };
            let answer = light::answer(prepared, cache, &Question { world, ask }, &|| 0);
            igi.absorb(Answered { ticket: asked.ticket, body: answer.body, worker: 0, cost: &answer.cost });
        }
    }
    igi.error().expect("there are several replicates").rel_mse
}

/// The estimates with and without a fault; what is missing is at least this much of the picture's square.
fn shows(name: &str, scene: &Scene, sampled: &Scene, missing: f64) {
    let sound = estimate(scene, scene, FRAMES);
    let faulty = estimate(scene, sampled, FRAMES);
    eprintln!("{name}: {sound:.5} without, {faulty:.5} with the fault, of which {missing} are missing");
    assert!(sound < 0.3 * missing, "{name}: a false alarm: {sound}");
    assert!((0.5 * missing..3.0 * missing).contains(&faulty), "{name}: {faulty}, where {missing} are missing");
}

/// Rounds that all replicates share alike.
const FRAMES: u32 = 72;

#[test]
fn a_sun_that_is_sampled_too_rarely_shows() {
    let mut scene = skies::sun_on_a_floor(Sun { size: [64, 32], at: [20, 8] }).scene;
    (scene.camera.width, scene.camera.height) = (32, 32);
    let mut sampled = scene.clone();
    let texture = std::sync::Arc::make_mut(&mut sampled.textures[0]);
    let scenes::Pixels::Float(pixels) = &mut texture.pixels else { panic!("the sky is bright") };
    // The sun gives nearly all light: 15 % of it are missing.
    pixels.iter_mut().filter(|texel| texel[0] > 1000.0).for_each(|texel| *texel = texel.map(|value| 0.85 * value));
    shows("sun", &scene, &sampled, 0.15 * 0.15);
}

#[test]
fn a_lamp_that_is_never_chosen_shows() {
    let mut scene = hunted::room_with_outdoors(false, false);
    (scene.camera.width, scene.camera.height) = (32, 32);
    let mut sampled = scene.clone();
    // One of the lamp's two triangles, and with it half of the light.
    let black = scenes::Material { emission: Default::default(), ..sampled.materials[1].clone() };
    sampled.materials.push(black);
    let of_black = (sampled.materials.len() - 1) as u16;
    let lamp = sampled.meshes.last_mut().map(std::sync::Arc::make_mut).expect("the lamp is the last that was built");
    *lamp.materials.last_mut().expect("it has two triangles") = of_black as _;
    shows("lamp", &scene, &sampled, 0.25);
}

#[test]
fn light_that_mirrors_lose_shows() {
    let mut scene = skies::mirror_well(skies::Sky::Uniform).scene;
    (scene.camera.width, scene.camera.height) = (32, 32);
    let mut sampled = scene.clone();
    for material in &mut sampled.materials {
        if let Surface::Mirror { reflectance } = &mut material.surface {
            *reflectance *= 0.7;
        }
    }
    let missing = 1.0 - estimate_of_mean(&sampled) / estimate_of_mean(&scene);
    shows("mirrors", &scene, &sampled, missing * missing);
}

/// Half of a hollow ball's light comes from a wall far before a window that hardly any path from there would find by
/// itself: none does.
#[test]
fn light_that_hardly_finds_a_window_shows() {
    let cases::Exact { mut scene, radiance, .. } = panes::lit_from_a_far_wall();
    (scene.camera.width, scene.camera.height) = (32, 32);
    // The ball shines as much by itself; of what it reflects, 0.7 of all but what the window lets out.
    scene.materials[0].emission = scenes::Colour::plain(glam::Vec3::splat(radiance as f32 * (1.0 - 0.7 * 0.975)));
    // Bright enough that relative errors are that.
    scene.materials.iter_mut().for_each(|material| material.emission.value *= 100.0);
    let mut sampled = scene.clone();
    let pane =
        sampled.materials.iter_mut().find(|material| material.surface.glass().is_some()).expect("there is a pane");
    pane.surface = Surface::Diffuse { albedo: scenes::Colour::plain(glam::Vec3::ZERO) };
    shows("window", &scene, &sampled, 0.5 * 0.5);
}

/// Mean of a picture by sixteen samples a pixel of the path tracer.
fn estimate_of_mean(scene: &Scene) -> f64 {
    let camera = scene.camera;
    let rect = Rect { x: 0, y: 0, width: camera.width, height: camera.height };
    let ask = Ask::Reference(Samples { camera, rect, first: 0, count: 16, seed: 9, max_bounces: None });
    let question = Question { world: Default::default(), ask };
    let answer = light::answer(&Prepared::new(scene.clone()), &LightSetCache::default(), &question, &|| 0);
    let moments = answer.body.moments().expect("the path tracer answers by moments");
    moments.sum.iter().map(|sum| sum.element_sum()).sum()
}
