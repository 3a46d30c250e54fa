//! The cache before worlds whose light is known in closed form.

use std::collections::BTreeSet;
use std::f32::consts::PI;
use std::sync::Arc;

use glam::{Vec2, Vec3};
use proptest::prelude::*;
use protocol::answer::{Body, Cost, Fields, Pixels, Seen};
use protocol::question::{Ask, Asked, Part, Ticket, WorldState};
use scenes::{
    Camera, Change, Colour, Gloss, Light, LookUp, Material, Mesh, Object, Scalar, Scene, Surface, SurfacePoint,
    Texture, Transform,
};

use super::cache::Cache;
use super::lit::LitLeaves;
use super::mesh::{NONE, PatchMesh};
use super::select::{Enough, PriorityMap, Why};
use super::settings::{Options, PRIORITY, Scale};
use super::sight::Sight;
use crate::Picture;
use crate::front_end::{Answered, Chosen, Effort, Interactive, Literal, Plane, Value, View, preset};
use crate::methods::SHADING_CACHE;
use crate::methods::at_once::Memory;

mod extremes;

/// Irradiance, or radiance of what is not matt, at a place.
type Lit = fn(&Scene, &SurfacePoint, Vec3) -> Vec3;

/// A square of two triangles that faces the eye.
fn square(side: f32, z: f32, material: u32) -> Mesh {
    let corner = |x: f32, y: f32| Vec3::new(x * side, y * side, z);
    let positions = vec![corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)];
    Mesh { positions, triangles: vec![[0, 1, 2], [0, 2, 3]], materials: vec![material; 2], ..Mesh::default() }
}

/// A wall that fills the picture.
fn wall() -> Scene {
    Scene {
        meshes: vec![square(4.0, 0.0, 0).into()],
        objects: vec![Object::fixed("wall", 0)],
        materials: vec![Material::diffuse("grey", Vec3::splat(0.5))],
        lights: vec![Light::Point { position: Vec3::Z, intensity: Vec3::ONE }],
        ..Scene::default()
    }
}

fn chosen(values: &[(&str, Value)]) -> Chosen {
    Chosen::new(&SHADING_CACHE).with(values.iter().cloned()).expect("there are such knobs")
}

struct World {
    cache: Cache,
    view: View,
    lit: Lit,
    /// What single light sets are off by at most, as a share, each at each place otherwise.
    noise: f32,
    /// Points that were asked about, each by one light set.
    asked: usize,
}

impl World {
    fn new(scene: Scene, values: &[(&str, Value)], lit: Lit) -> Self {
        let camera = Camera { width: 64, height: 48, ..Camera::default() };
        let world = WorldState { world: [1; 32], revision: 0 };
        let fields = Fields { emitted: true, surface: true };
        let view = View { world, scene: Arc::new(scene), fields, camera, seed: 5 };
        // Most worlds have no noise to be told from light: what is known is shown as it is.
        let values: Vec<_> =
            std::iter::once(("confidence", Value::Switch(false))).chain(values.iter().cloned()).collect();
        let cache = Cache::new(SHADING_CACHE.quality, &chosen(&values).settings);
        Self { cache, view, lit, noise: 0.0, asked: 0 }
    }

    fn answers(&self, batch: &<Cache as Memory>::Batch) -> Vec<Option<Body>> {
        let answered = |ask: &Ask| match (answer(&self.view.scene, self.lit, ask), ask) {
            (Body::Irradiance(lights), Ask::Points(points)) if self.noise > 0.0 => {
                let noisy = |(light, point): (Vec3, &protocol::question::Point)| {
                    let [u, v] = point.at.uv.map(|along| u64::from(along.to_bits()));
                    let address = super::cache::mix(u64::from(point.at.triangle) ^ u << 32 ^ v);
                    let unit =
                        (super::cache::mix(address ^ u64::from(point.address.number)) >> 40) as f32 / 16_777_216.0;
                    light * (1.0 + self.noise * (2.0 * unit - 1.0))
                };
                Body::Irradiance(lights.into_iter().zip(&points.at).map(noisy).collect())
            }
            (body, _) => body,
        };
        batch.questions.iter().map(|(question, _)| Some(answered(&question.ask))).collect()
    }

    /// One picture, and what it asked for is known in the next. Returns the picture.
    fn step(&mut self, samples: usize) -> Picture {
        let batch = self.cache.tick(&self.view, samples, &mut |_| {});
        let picture = Picture::clone(&self.cache.picture(&self.view).0.picture);
        if let Some(batch) = batch {
            self.asked += batch.questions.iter().map(|(question, _)| question.ask.len()).sum::<usize>();
            let answers = self.answers(&batch);
            self.cache.absorb(&self.view, &batch, &answers);
        }
        picture
    }

    /// The picture after so many with so many samples each.
    fn after(&mut self, pictures: usize, samples: usize) -> Picture {
        (0..pictures).for_each(|_| drop(self.step(samples)));
        self.step(0)
    }

    fn edit(&mut self, change: &Change) {
        change.apply(Arc::make_mut(&mut self.view.scene)).expect("it can be done");
        self.view.world.revision += 1;
        self.cache.move_to(&self.view, std::slice::from_ref(change), true);
    }

    /// Leaves in sight.
    fn leaves(&self) -> impl Iterator<Item = u32> {
        self.cache.sight.leaves.iter().map(|leaf| leaf.patch)
    }

    /// A corner of a patch has not been lit by all light sets yet.
    fn has_room(&self, patch: u32) -> bool {
        let mesh = self.cache.mesh();
        let corners = mesh.patches[patch as usize].vertices.map(|vertex| &mesh.vertices[vertex as usize]);
        corners.iter().any(|vertex| self.cache.worth().has_room(vertex))
    }

    /// All that the last picture chose was chosen by chance.
    fn by_chance(&self) -> bool {
        !self.cache.chosen.is_empty() && self.cache.chosen.iter().all(|(_, why)| *why == Why::Chance)
    }

    /// Patches below the triangles.
    fn divided(&self) -> usize {
        self.cache.mesh().patch_count() - self.cache.mesh().roots.len()
    }

    /// What a pixel should show of matt grey.
    fn truth(&self, x: u32, y: u32) -> Vec3 {
        let lens = self.view.camera.lens();
        let direction = lens.direction(x as f32 + 0.5, y as f32 + 0.5);
        let at = lens.origin() - direction * (lens.origin().z / direction.z);
        (self.lit)(&self.view.scene, &SurfacePoint::default(), at) * 0.5 / PI
    }

    /// Mean and greatest difference from that, over a mean of 1.
    fn errors(&self, picture: &Picture) -> [f32; 2] {
        let (mut sum, mut most, mut all) = (0.0, 0.0_f32, 0.0);
        for (index, pixel) in (0..).zip(&picture.pixels) {
            let truth = self.truth(index % picture.width, index / picture.width);
            let off = (*pixel - truth).abs().max_element();
            (sum, most, all) = (sum + off, most.max(off), all + truth.x);
        }
        [sum / all, most * picture.pixels.len() as f32 / all]
    }
}

fn answer(scene: &Scene, lit: Lit, ask: &Ask) -> Body {
    let Ask::Points(points) = ask else { panic!("points are asked for") };
    let lights = points.at.iter().map(|point| lit(scene, &point.at, scene.place(&point.at).expect("it is there")));
    match points.part {
        Part::All => Body::Irradiance(lights.collect()),
        Part::Towards(_) => {
            let emitted: Vec<Vec3> = lights.collect();
            let hits = points.at.iter().map(|point| Some(point.at)).collect();
            let nothing = vec![Vec3::ZERO; emitted.len()];
            let (reflectance, irradiance, normal) = (nothing.clone(), nothing.clone(), nothing);
            let distance = vec![1.0; emitted.len()];
            Body::Seen(Seen { pixels: Pixels { emitted, reflectance, irradiance, normal, distance }, hits })
        }
        _ => panic!("no part of it is asked for"),
    }
}

#[test]
fn even_light_is_divided_by_chance_alone_and_is_even_in_every_picture() {
    let mut world = World::new(wall(), &[], |_, _, _| Vec3::new(3.0, 2.0, 1.0));
    let picture = world.after(20, 400);
    let expected = Vec3::new(3.0, 2.0, 1.0) * 0.5 / PI;
    assert!(picture.pixels.iter().all(|pixel| (*pixel - expected).length() < 1e-5), "{:?}", picture.pixels[0]);
    // It is worth nothing: what was asked beyond the corners was chosen by chance.
    let worth = world.cache.plane(Plane::Own(PRIORITY)).expect("there is one");
    assert!(worth.pixels.iter().all(|pixel| pixel.x < 1e-3) && world.divided() > 0);
    world.step(400);
    assert!(world.by_chance());
}

#[test]
fn a_ramp_is_exact_across_patches_of_any_size_and_worth_something_only_by_contrast() {
    let ramp: Lit = |_, _, at| Vec3::splat(5.0 + at.x);
    let mut ours = World::new(wall(), &[], ramp);
    let picture = ours.after(12, 400);
    let [_, most] = ours.errors(&picture);
    // Vertices are lit a little inside of their triangle.
    assert!(most < 2e-3, "{most}");
    let mut paper = World::new(wall(), &[("patch-error", Value::from(Literal::Word("contrast")))], ramp);
    paper.after(12, 400);
    let [ours, paper] = [ours, paper].map(|world| {
        let worth = world.cache.plane(Plane::Own(PRIORITY)).expect("there is one");
        worth.pixels.iter().map(|pixel| pixel.x).sum::<f32>() / worth.pixels.len() as f32
    });
    assert!(ours < 0.1 * paper, "worth {ours} by curvature, {paper} by contrast");
}

#[test]
fn the_edge_of_a_shadow_gets_sharp_and_the_patches_are_there() {
    let mut world = World::new(wall(), &[], |_, _, at| Vec3::splat(if at.x + 0.3 * at.y > 0.21 { 3.0 } else { 0.2 }));
    let early = world.after(3, 400);
    let middle = world.after(12, 400);
    let [early, middle] = [early, middle].map(|picture| world.errors(&picture)[0]);
    let mesh = world.cache.mesh();
    let (mut near, mut far) = (0, 0);
    let finest = mesh.patches.iter().map(|patch| patch.level).max().expect("there are patches");
    let leaves =
        (0..).zip(&mesh.patches).filter(|(number, patch)| mesh.children(*number) == NONE && patch.level == finest);
    for (_, patch) in leaves {
        let at = world.view.scene.place(&mesh.at(patch.vertices[0])).expect("it is there");
        let is_near = (at.x + 0.3 * at.y - 0.21).abs() < 0.2;
        (near, far) = (near + usize::from(is_near), far + usize::from(!is_near));
    }
    // An eighth of what is in sight is so near.
    assert!(2 * near > far, "{near} at the edge, {far} elsewhere");
    let late = world.after(60, 400);
    let late = world.errors(&late)[0];
    assert!(middle < 0.5 * early && late < 0.25 * early && late < 0.05, "{early}, then {middle}, then {late}");
    let mesh = world.cache.mesh();
    mesh.check();
    assert!(mesh.bytes() <= 100 * mesh.patch_count(), "{} of {}", mesh.bytes(), mesh.patch_count());
}

#[test]
fn noise_is_lit_by_more_light_sets_and_shown_smoothed_until_then() {
    let even: Lit = |_, _, _| Vec3::splat(2.0);
    let [told, taken] = [true, false].map(|is_told| {
        let mut world = World::new(wall(), &[("confidence", Value::Switch(is_told))], even);
        world.noise = 0.8;
        let picture = world.after(20, 400);
        (world.errors(&picture), world.divided(), world)
    });
    // Off by 0.46 of the mean a set, four of which are 0.23: half of 20 pictures' vertices have no more if they are divided.
    assert!(told.0[0] < 0.5 * taken.0[0], "{:?}, not {:?}", told.0, taken.0);
    assert!(2 * told.1 < taken.1, "{} patches, not {}", told.1, taken.1);
    // What is divided although its corners could be lit by more sets must stand out of noise by three deviations: one in a
    // hundred of all patches that are looked at, three edges each, and as many again for deviations that few sets tell. What
    // is chosen by chance, or hit so often that it is divided twice, is divided by the same rule.
    let mut world = World::new(wall(), &[("confidence", Value::Switch(true)), ("tested", Value::Switch(false))], even);
    world.noise = 0.8;
    let (mut looked_at, mut early) = (0, 0);
    for _ in 0..40 {
        let with_room: Vec<u32> = world.leaves().filter(|leaf| world.has_room(*leaf)).collect();
        world.step(400);
        looked_at += world.cache.chosen.len();
        early += with_room.into_iter().filter(|leaf| world.cache.mesh().children(*leaf) != NONE).count();
    }
    assert!(looked_at > 1000 && early * 50 <= looked_at, "{early} of {looked_at}");
}

#[test]
fn well_known_vertices_are_shown_as_they_are() {
    let edge: Lit = |_, _, at| Vec3::splat(if at.x + 0.3 * at.y > 0.21 { 3.0 } else { 0.2 });
    let mut world = World::new(wall(), &[("confidence", Value::Switch(true))], edge);
    world.noise = 0.3;
    world.after(120, 800);
    let mesh = world.cache.mesh();
    let (mut known, mut moved) = (0, 0.0_f32);
    for seen in &world.cache.sight.leaves {
        for vertex in seen.vertices.map(|vertex| &mesh.vertices[vertex as usize]) {
            if vertex.samples > 0 && !world.cache.worth().has_room(vertex) {
                let by = (vertex.light - vertex.mean).abs().element_sum() / vertex.mean.element_sum();
                (known, moved) = (known + 1, moved.max(by / world.cache.usual.share(vertex)));
            }
        }
    }
    // A neighbour as well known counts if it is no farther than the root of two of what either may be off by, one that is known
    // worse counts less; and two hundredths of the light, which here is less than one deviation.
    assert!(known > 100 && moved < 2.0, "{known} vertices, shown up to {moved} deviations from what they are");
}

#[test]
fn an_edge_that_stands_out_of_noise_is_found_and_stays_sharp() {
    let edge: Lit = |_, _, at| Vec3::splat(if at.x + 0.3 * at.y > 0.21 { 3.0 } else { 0.2 });
    let mut world = World::new(wall(), &[("confidence", Value::Switch(true))], edge);
    world.noise = 0.3;
    let picture = world.after(70, 400);
    let [mean, _] = world.errors(&picture);
    assert!(mean < 0.12, "{mean}");
}

#[test]
fn triangles_that_were_never_divided_are_tested_once() {
    let even: Lit = |_, _, _| Vec3::splat(2.0);
    let worth = |world: &World| {
        let plane = world.cache.plane(Plane::Own(PRIORITY)).expect("there is one");
        plane.pixels.iter().map(|pixel| pixel.x).fold(f32::INFINITY, f32::min)
    };
    let [tested, trusted] = [true, false].map(|is_tested| {
        let mut world = World::new(wall(), &[("tested", Value::Switch(is_tested))], even);
        world.step(16);
        world.step(0);
        (worth(&world), world)
    });
    assert!(tested.0 > 10.0 && trusted.0 < 1e-3, "{} and {}", tested.0, trusted.0);
    let mut world = tested.1;
    world.after(4, 400);
    assert!(worth(&world) < 1e-3, "its middle is like its corners");
}

#[test]
fn small_triangles_are_lit_where_they_are_seen_and_corners_within_other_things_blacken_nothing() {
    // Strips as of a blind, whose ends lie in its rails, where nothing is lit.
    let (mut positions, mut triangles) = (Vec::new(), Vec::new());
    for strip in 0..80_u32 {
        let x = strip as f32 * 0.05 - 2.0;
        positions.extend([[0.0, -2.0], [0.05, -2.0], [0.05, 2.0], [0.0, 2.0]].map(|[dx, y]| Vec3::new(x + dx, y, 0.0)));
        let [a, b, c, d] = [0, 1, 2, 3].map(|corner| 4 * strip + corner);
        triangles.extend([[a, b, c], [a, c, d]]);
    }
    let mesh = Mesh { positions, materials: vec![0; triangles.len()], triangles, ..Mesh::default() };
    let mut scene = Scene { meshes: vec![mesh.into()], ..wall() };
    // Rails hide the ends, and much of what lies between them.
    scene.meshes.push(square(4.0, 0.5, 0).into());
    let rail = |y: f32| Transform { translation: Vec3::Y * y, ..Transform::IDENTITY };
    for y in [4.2, -4.2] {
        scene.objects.push(Object { scene_from_object: rail(y), ..Object::fixed("rail", 1) });
    }
    let lit: Lit = |_, at, place| Vec3::splat(if at.object == 0 && place.y.abs() > 1.0 { 0.0 } else { 2.0 });
    let dark = |is_tested: bool| {
        let mut world = World::new(scene.clone(), &[("tested", Value::Switch(is_tested))], lit);
        let picture = world.after(12, 800);
        (picture.pixels.iter().filter(|pixel| pixel.x < 0.5 / PI).count(), world)
    };
    let ((spots, world), (corners, _)) = (dark(true), dark(false));
    assert!(spots == 0 && corners > 100, "{spots} and {corners} pixels are dark");
    world.cache.mesh().check();
}

#[test]
fn corners_that_are_hidden_darken_nothing_that_is_seen() {
    // A wall whose corners lie behind a frame, where nothing is lit.
    let mut scene = wall();
    scene.meshes = vec![square(1.1, 0.0, 0).into(), square(4.0, 0.5, 0).into()];
    let beside = |x: f32, y: f32| Transform { translation: Vec3::new(x, y, 0.0), ..Transform::IDENTITY };
    for (x, y) in [(4.6, 0.0), (-4.6, 0.0), (0.0, 4.6), (0.0, -4.6)] {
        scene.objects.push(Object { scene_from_object: beside(x, y), ..Object::fixed("frame", 1) });
    }
    let lit: Lit =
        |_, at, place| Vec3::splat(if at.object == 0 && place.abs().max_element() > 0.8 { 0.0 } else { 2.0 });
    let mut world = World::new(scene, &[], lit);
    let picture = world.after(16, 400);
    let is_wall = |pixel: usize| world.cache.raster.hit(pixel).is_some_and(|hit| hit.object == 0);
    let dark = (0..).zip(&picture.pixels).filter(|(pixel, colour)| is_wall(*pixel) && colour.x < 0.8 / PI).count();
    let sight = &world.cache.sight;
    let mut hidden = 0;
    for seen in &sight.vertices[..sight.corners] {
        let (vertex, at) = (&world.cache.mesh().vertices[seen.vertex as usize], world.cache.mesh().at(seen.vertex));
        let place = world.view.scene.place(&at).expect("it is there").abs().max_element();
        if at.object > 0 {
            continue;
        }
        // The frame's inner edges are seen before 0.72 of the wall, a pixel of which is 0.05.
        assert!(place > 0.7 || !seen.is_hidden, "{place} can be seen");
        if seen.is_hidden && place > 0.8 && vertex.samples > 0 {
            hidden += 1;
            assert!(vertex.mean == Vec3::ZERO && vertex.light.x > 1.9, "it is dark, and shown as what is beside it");
        }
    }
    // Those within a pixel of the frame count as seen.
    assert!(hidden > 8 && dark < 1024 / 50, "{hidden} corners are hidden, {dark} pixels are dark");
}

#[test]
fn textures_divide_nothing_and_are_sharp() {
    let mut scene = wall();
    let mesh = Arc::make_mut(&mut scene.meshes[0]);
    mesh.uvs = mesh.positions.iter().map(|at| Vec2::new(at.x, at.y) * 3.0).collect();
    let pixels = scenes::Pixels::Linear8(vec![[255; 4], [0, 0, 0, 255]]);
    let look_up = LookUp { nearest: true, ..LookUp::REPEAT };
    scene.textures.push(Texture { name: String::new(), width: 2, height: 1, pixels, look_up }.into());
    scene.materials[0].surface = Surface::Diffuse { albedo: Colour { value: Vec3::splat(0.8), texture: Some(0) } };
    let mut world = World::new(scene, &[], |_, _, _| Vec3::splat(2.0));
    let picture = world.after(12, 400);
    let bright = picture.pixels.iter().filter(|pixel| (pixel.x - 1.6 / PI).abs() < 1e-4).count();
    let dark = picture.pixels.iter().filter(|pixel| pixel.x == 0.0).count();
    assert!(bright + dark == 64 * 48 && bright > 1000 && dark > 1000, "{bright} {dark}");
    world.step(400);
    assert!(world.by_chance(), "light is the same everywhere, whatever it falls on");
}

#[test]
fn a_thin_wall_has_two_sides_and_each_its_light() {
    let lit: Lit = |_, at, _| Vec3::splat(if at.back { 9.0 } else { 1.0 });
    let mut world = World::new(wall(), &[], lit);
    let front = world.after(3, 400);
    world.view.camera.origin.z = -3.0;
    let back = world.after(3, 400);
    for (picture, light) in [(front, 1.0), (back, 9.0)] {
        assert!(picture.pixels.iter().all(|pixel| (pixel.x - light * 0.5 / PI).abs() < 1e-5), "{light}");
    }
}

#[test]
fn the_camera_moves_without_asking_and_sees_the_same_light() {
    let mut world = World::new(wall(), &[], |_, _, at| Vec3::splat(5.0 + at.x));
    world.after(10, 2000);
    let asked = world.asked;
    for step in 1..20 {
        let by = Vec3::new(0.02, 0.01, -0.03) * step as f32;
        world.view.camera = Camera { origin: Vec3::Z * 3.0 + by, target: by, ..world.view.camera };
        let picture = world.step(0);
        let [_, most] = world.errors(&picture);
        assert!(most < 5e-3, "{most}");
    }
    assert_eq!(world.asked, asked);
}

#[test]
fn after_an_edit_light_is_renewed_and_what_has_not_changed_keeps_its_mean() {
    let brightness: Lit = |scene, _, _| {
        let Light::Point { intensity, .. } = scene.lights[0] else { panic!("it is one") };
        intensity
    };
    for paper in [false, true] {
        let values: Vec<(&str, Value)> = match paper {
            true => preset(&SHADING_CACHE, "paper")
                .expect("there is one")
                .iter()
                .map(|(k, v)| (*k, Value::from(*v)))
                .collect(),
            false => Vec::new(),
        };
        let mut world = World::new(wall(), &values, brightness);
        world.after(10, 2000);
        world.edit(&Change::Light { light: 0, value: Light::Point { position: Vec3::Z, intensity: Vec3::splat(4.0) } });
        let mut pictures = 0;
        while world.step(2000).pixels.iter().any(|pixel| (pixel.x - 4.0 * 0.5 / PI).abs() > 1e-4) {
            pictures += 1;
            assert!(pictures < 400, "it never gets right");
        }
        assert!(paper || pictures < 20, "{pictures}");
    }
    // Asked again, what is the same as before keeps all of its samples.
    let mut world = World::new(wall(), &[], |_, _, at| Vec3::splat(2.0 + at.x));
    world.after(30, 4000);
    let samples = |world: &World| world.cache.mesh().vertices.iter().map(|vertex| u32::from(vertex.samples)).max();
    let before = samples(&world);
    world.edit(&Change::Light { light: 0, value: Light::Point { position: Vec3::Z, intensity: Vec3::splat(4.0) } });
    world.after(5, 4000);
    assert!(before > Some(4) && samples(&world) >= before, "{before:?}");
}

#[test]
fn what_is_glossy_is_kept_as_radiance_and_renewed_when_the_eye_moves() {
    let mut scene = wall();
    let base = Colour::plain(Vec3::new(0.5, 0.25, 0.75));
    let (roughness, metalness) = (Scalar::plain(0.3), Scalar::plain(0.0));
    scene.materials[0].surface = Surface::Glossy(Gloss::new(base, roughness, metalness));
    for untinted in [true, false] {
        let mut world = World::new(scene.clone(), &[("untinted", Value::Switch(untinted))], |_, _, _| Vec3::splat(3.0));
        let picture = world.after(3, 400);
        assert!(picture.pixels.iter().all(|pixel| (*pixel - Vec3::splat(3.0)).length() < 1e-4));
        // As seen from elsewhere, it shines more.
        world.lit = |_, _, _| Vec3::splat(5.0);
        world.view.camera.origin.x = 0.1;
        let picture = world.after(60, 400);
        let renewed = picture.pixels.iter().filter(|pixel| (pixel.x - 5.0).abs() < 0.01).count();
        assert!(renewed > 64 * 48 * 9 / 10, "{renewed}");
    }
}

#[test]
fn nothing_is_black_because_it_is_not_there_yet_and_what_is_given_up_is_not_asked_for_ever() {
    let mut scene = wall();
    scene.meshes.push(square(0.5, 1.0, 0).into());
    scene.objects.push(Object::fixed("square", 1));
    scene.objects[1].visible = false;
    let mut world = World::new(scene, &[], |_, _, _| Vec3::splat(2.0));
    world.after(3, 400);
    world.edit(&Change::Visible { object: 1, visible: true });
    let picture = world.step(400);
    assert!(picture.pixels.iter().all(|pixel| (pixel.x - 1.0 / PI).abs() < 1e-4), "the mean of what is known");
    // Nobody answers.
    let mut world = World::new(wall(), &[], |_, _, _| Vec3::splat(2.0));
    let batch = world.cache.tick(&world.view, 400, &mut |_| {}).expect("everything is unknown");
    let none: Vec<Option<Body>> = batch.questions.iter().map(|_| Some(Body::Irradiance(Vec::new()))).collect();
    world.cache.absorb(&world.view, &batch, &none);
    assert!(world.cache.is_empty());
    assert!(world.cache.tick(&world.view, 400, &mut |_| {}).is_none_or(|batch| batch.wanted.is_empty()));
}

#[test]
fn light_stays_on_what_is_moved_hidden_and_shown_again() {
    let mut scene = wall();
    scene.meshes.push(square(0.5, 1.0, 0).into());
    scene.objects.push(Object::fixed("square", 1));
    let mut world = World::new(scene, &[], |_, at, _| Vec3::splat(1.0 + at.object as f32));
    world.after(4, 400);
    let place = |x: f32| Transform { translation: Vec3::X * x, ..Transform::IDENTITY };
    let bright = |picture: &Picture| picture.pixels.iter().filter(|pixel| (pixel.x - 1.0 / PI).abs() < 1e-4).count();
    let before = world.step(0);
    world.edit(&Change::Transform { object: 1, scene_from_object: place(0.2) });
    let moved = world.step(0);
    assert!(bright(&before) > 200 && bright(&moved).abs_diff(bright(&before)) < 40 && moved != before);
    world.edit(&Change::Visible { object: 1, visible: false });
    assert_eq!(bright(&world.step(0)), 0, "no ghost stays");
    world.edit(&Change::Visible { object: 1, visible: true });
    assert_eq!(bright(&world.step(0)), bright(&moved));
    // Questions are about what is there.
    world.edit(&Change::PieceVisible { object: 1, piece: 0, visible: false });
    world.after(3, 400);
}

#[test]
fn all_of_a_thing_that_changes_is_coarse_until_it_can_be_renewed_in_time() {
    let lit: Lit = |scene, _, at| {
        let Light::Point { intensity, .. } = scene.lights[0] else { panic!("it is one") };
        intensity * if at.x + 0.3 * at.y > 0.21 { 3.0 } else { 0.2 }
    };
    let mut world = World::new(wall(), &[("clean-up", Value::Whole(2))], lit);
    world.after(60, 2000);
    let fine = world.divided();
    world.edit(&Change::Light { light: 0, value: Light::Point { position: Vec3::Z, intensity: Vec3::splat(2.0) } });
    world.step(80);
    let coarse = world.divided();
    assert!(coarse * 4 < fine, "{fine}, then {coarse}");
    let picture = world.after(60, 2000);
    assert!(world.errors(&picture)[0] < 0.06 && world.divided() * 2 > fine, "{:?}", world.errors(&picture));
    world.cache.mesh().check();
}

#[test]
fn what_was_seen_at_rest_is_what_moving_pictures_begin_with() {
    let lit: Lit = |_, _, at| Vec3::splat(if at.x + 0.3 * at.y > 0.21 { 3.0 } else { 0.2 });
    let mut world = World::new(wall(), &[], lit);
    let still = Picture::from_fn(64, 48, |x, y| world.truth(x, y));
    world.cache.begin_with(&world.view, &mut |_| still.clone(), 9);
    let seen = world.divided();
    let picture = world.step(0);
    let [same, _] = world.errors(&picture);
    world.view.camera.origin.x += 0.1;
    world.view.camera.target.x += 0.1;
    let picture = world.step(0);
    let [moved, _] = world.errors(&picture);
    // A step of light runs across the wall, in as many patches as there may be: most of the error is along it.
    assert!(world.asked == 0 && same < 0.1 && moved < 0.1, "{same}, then {moved}");
    assert!((100..2000).contains(&seen), "{seen} patches for 3072 pixels");
    world.cache.mesh().check();
}

#[test]
fn triangles_smaller_than_pixels_look_like_what_is_around_them() {
    // 40 000 triangles that are no neighbours, on 3072 pixels.
    let mut positions = Vec::new();
    for i in 0..20_000 {
        let corner = Vec3::new((i % 100) as f32 * 0.04 - 2.0, (i / 100) as f32 * 0.02 - 2.0, 0.0);
        let [x, y] = [Vec3::X * 0.04, Vec3::Y * 0.02];
        positions.extend([corner, corner + x, corner + x + y, corner, corner + x + y, corner + y]);
    }
    let triangles: Vec<[u32; 3]> = (0..40_000).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    let mesh = Mesh { positions, materials: vec![0; triangles.len()], triangles, ..Mesh::default() };
    let scene = Scene { meshes: vec![mesh.into()], ..wall() };
    let mut world = World::new(scene, &[], |_, _, at| Vec3::splat(5.0 + at.x));
    let picture = world.after(3, 1200);
    // 300 of them are lit a picture; the same light everywhere would be 0.2 off.
    let [mean, _] = world.errors(&picture);
    assert!(mean < 0.1, "{mean}");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(32))]

    #[test]
    fn dividing_and_joining_leaves_nothing_behind(steps in prop::collection::vec((any::<prop::sample::Index>(), 0..4), 1..200)) {
        let scene = wall();
        let mut mesh = PatchMesh::default();
        let roots = [0, 1].map(|triangle| mesh.make_root(&scene, [0, triangle], false, 0));
        let (patches, vertices) = (mesh.patch_count(), mesh.vertices.len());
        prop_assert_eq!((patches, vertices), (2, 4), "the two triangles are one square");
        for (index, what) in steps {
            let mut there = Vec::new();
            roots.iter().for_each(|root| mesh.below(mesh.roots[*root as usize].patch, &mut |patch| there.push(patch)));
            let patch = there[index.index(there.len())];
            match what {
                0 => mesh.merge(patch),
                1 => drop(mesh.lower(patch, 1)),
                _ => drop(mesh.split(patch, 0)),
            }
            mesh.check();
        }
        roots.iter().for_each(|root| mesh.merge(mesh.roots[*root as usize].patch));
        mesh.check();
        prop_assert_eq!(mesh.patch_count(), patches);
    }

    /// Whatever is divided how often, and however its vertices are lit: no seams, and nothing that no vertex is.
    #[test]
    fn light_goes_on_across_all_edges(
        splits in prop::collection::vec(any::<prop::sample::Index>(), 1..60),
        along in prop::collection::vec((0..=64_u32, 0.0_f32..1.0), 64),
        seed: u64,
    ) {
        let scene = wall();
        let mut mesh = PatchMesh::default();
        let roots = [0, 1].map(|triangle| mesh.make_root(&scene, [0, triangle], false, 0));
        for index in splits {
            let patches = mesh.patches.len();
            // No finer than the places that are looked at.
            if mesh.patches[index.index(patches)].level < 6 {
                mesh.split(index.index(patches) as u32, 0);
            }
        }
        let (mut low, mut high) = (1.0_f32, 0.0_f32);
        for (number, vertex) in (0..).zip(&mut mesh.vertices) {
            let value = (super::cache::mix(seed ^ number) >> 40) as f32 / 16_777_216.0;
            (vertex.light, vertex.has_light) = (Vec3::splat(value), true);
            (low, high) = (low.min(value), high.max(value));
        }
        let light = |mesh: &mut PatchMesh, places: &[(usize, [f32; 2])]| {
            let pixels: Vec<_> = places.iter().map(|(root, uv)| mesh.find(roots[*root], *uv)).collect();
            let mut sight = Sight::default();
            sight.find(mesh, &pixels, 1, &Options::of(&chosen(&[("tested", Value::Switch(false))]).settings));
            let lit = LitLeaves::of(mesh, &sight.leaves, true);
            let at = sight.slots.iter().zip(&pixels).map(|(slot, leaf)| lit.at(*slot, leaf.weights));
            at.map(|light| light.expect("all is known").x).collect::<Vec<f32>>()
        };
        // On both sides of lines that edges of patches lie in, and of the triangles' own edge.
        let beside = 1e-6;
        let places: Vec<(usize, [f32; 2])> = along.iter().enumerate().flat_map(|(kind, (line, t))| {
            let (line, root) = ((*line as f32 / 64.0).clamp(2.0 * beside, 1.0 - 2.0 * beside), kind / 4 % 2);
            let rest = (1.0 - line - 2.0 * beside) * t;
            match kind % 4 {
                0 => [(root, [line - beside, rest]), (root, [line + beside, rest])],
                1 => [(root, [rest, line - beside]), (root, [rest, line + beside])],
                2 => [(root, [line * t, line * (1.0 - t) - beside]), (root, [line * t, line * (1.0 - t) + beside])]
                    .map(|(root, [u, v])| (root, [u.max(0.0), v.max(0.0)])),
                _ => [(0, [0.0, line]), (1, [line, 0.0])],
            }
        }).collect();
        let lights = light(&mut mesh, &places);
        for (pair, places) in lights.chunks(2).zip(places.chunks(2)) {
            // The steepest patch goes from 0 to 1 in a 64th.
            prop_assert!((pair[0] - pair[1]).abs() < 1e-3, "{pair:?} at {places:?}");
            prop_assert!(pair.iter().all(|light| (low - 1e-5..=high + 1e-5).contains(light)), "{pair:?}");
        }
    }

    /// Each pixel is taken as often as its probability says.
    #[test]
    fn pixels_are_hit_by_their_priority(seed: u32) {
        const PIXELS: usize = 16;
        let priorities: Vec<f32> = (0..PIXELS).map(|pixel| pixel as f32).collect();
        // Each its own patch; none beside another one of more worth is flooded, because nothing is above the threshold.
        let patches: Vec<u32> = (0..PIXELS as u32).collect();
        let map = PriorityMap { width: PIXELS, patches: &patches, priorities: &priorities, scale: Scale::Worst, chance: 0.1 };
        let mut counts = [0_u32; PIXELS];
        for round in 0..6000_u32 {
            let random = |index: u32| super::cache::mix(u64::from(seed) << 40 ^ u64::from(round) << 16 ^ u64::from(index)) as u32;
            map.select(random, |pixel, why| {
                counts[pixel] += u32::from(why != Why::Flood);
                Enough::Little
            });
        }
        let mean = 7.5_f64;
        let deviation = (priorities.iter().map(|p| (f64::from(*p) - mean).powi(2)).sum::<f64>() / 16.0).sqrt();
        let chi: f64 = (0..PIXELS).map(|pixel| {
            let expected = 6000.0 * (0.1 + 0.9 * (pixel as f64 / (mean + 4.0 * deviation)).min(1.0));
            (f64::from(counts[pixel]) - expected).powi(2) / expected
        }).sum();
        // Of 16 degrees of freedom, one in a million is above this.
        prop_assert!(chi < 60.0, "{chi} {counts:?}");
    }
}

#[test]
fn there_is_a_seam_beside_finer_patches_only_if_they_are_not_fitted() {
    let mut mesh = PatchMesh::default();
    let roots = [0, 1].map(|triangle| mesh.make_root(&wall(), [0, triangle], false, 0));
    let fine = mesh.roots[roots[0] as usize].patch;
    mesh.split(fine, 0);
    mesh.vertices.iter_mut().for_each(|vertex| vertex.has_light = true);
    // In the middle of the square's diagonal.
    let [a, _, c] = mesh.patches[fine as usize].vertices;
    let middle = mesh.middle_of(a, c).expect("it is divided there");
    mesh.vertices[middle as usize].light = Vec3::ONE;
    let pixels = [mesh.find(roots[0], [0.0, 0.5]), mesh.find(roots[1], [0.5, 0.0])];
    let mut sight = Sight::default();
    sight.find(&mut mesh, &pixels, 1, &Options::of(&chosen(&[("tested", Value::Switch(false))]).settings));
    let lights = [true, false].map(|is_fitted| {
        let lit = LitLeaves::of(&mesh, &sight.leaves, is_fitted);
        [0, 1].map(|pixel| lit.at(sight.slots[pixel], pixels[pixel].weights).expect("it is known").x)
    });
    assert_eq!(lights, [[1.0, 1.0], [1.0, 0.0]]);
}

#[test]
fn a_flood_takes_what_is_around_and_worth_it_once() {
    // A ridge across a plain, two pixels wide; each pixel is a patch.
    const WIDTH: usize = 32;
    let priorities: Vec<f32> =
        (0..WIDTH * 24).map(|pixel| if (14..16).contains(&(pixel % WIDTH)) { 200.0 } else { 0.0 }).collect();
    let patches: Vec<u32> = (0..priorities.len() as u32).collect();
    let map =
        PriorityMap { width: WIDTH, patches: &patches, priorities: &priorities, scale: Scale::Worst, chance: 1e-6 };
    let mut flooded = BTreeSet::new();
    let mut hits = 0;
    map.select(
        |index| super::cache::mix(u64::from(index)) as u32,
        |pixel, why| {
            if why == Why::Flood {
                assert!(flooded.insert(pixel), "{pixel} comes twice");
            } else {
                hits += 1;
            }
            if hits < 2 { Enough::Little } else { Enough::Half }
        },
    );
    assert!(flooded.len() + 2 >= 48, "{}", flooded.len());
    assert!(flooded.iter().all(|pixel| (14..16).contains(&(pixel % WIDTH))));
}

/// Answers all that is asked, in an order that a seed decides.
fn answer_all(front: &mut dyn Interactive, scene: &Scene, seed: u64) {
    let lit: Lit = |_, _, at| Vec3::splat(3.0 + at.x.sin());
    let mut open: Vec<Asked> = front.ask(4096);
    while !open.is_empty() {
        let next = super::cache::mix(seed ^ open.len() as u64) as usize % open.len();
        let Asked { ticket, question } = open.swap_remove(next);
        let body = answer(scene, lit, &question.ask);
        front.absorb(Answered { ticket, body, worker: 0, cost: &Cost::default() });
        open.extend(front.ask(4096));
    }
}

#[test]
fn whatever_order_answers_come_in_pictures_are_the_same() {
    let world = World::new(wall(), &[], |_, _, _| Vec3::ONE);
    let play = |seed: u64| {
        let mut front = chosen(&[]).interactive(0);
        let mut pictures = Vec::new();
        for step in 0..8 {
            let camera = Camera { origin: Vec3::new(0.05 * step as f32, 0.0, 3.0), ..world.view.camera };
            if let Some(stock) = front.stock() {
                front.take_in(stock.whole);
            }
            front.look(&View { camera, ..world.view.clone() }, &[]);
            front.begin(Some(Effort(0.1)));
            if step == 0 {
                answer_all(front.as_mut(), &world.view.scene, seed);
            }
            front.end();
            pictures.push(front.shot(None).and_then(|shot| shot.picture).expect("something is known").sha256());
            answer_all(front.as_mut(), &world.view.scene, seed);
        }
        pictures
    };
    let one = play(1);
    assert!(one == play(77) && one[1] != one[7]);
}

#[test]
fn where_nothing_shines_pictures_are_there_and_nobody_is_asked() {
    let world = World::new(wall(), &[], |_, _, _| Vec3::ONE);
    let mut front = chosen(&[]).interactive(0);
    for step in 0..3 {
        let camera = Camera { origin: Vec3::new(0.05 * step as f32, 0.0, 3.0), ..world.view.camera };
        let fields = Fields { emitted: false, surface: false };
        front.look(&View { camera, fields, ..world.view.clone() }, &[]);
        front.begin(Some(Effort(0.1)));
        assert!(front.ask(100).is_empty() && front.stock().is_some());
        front.end();
        let picture = front.shot(None).and_then(|shot| shot.picture).expect("it is black at once");
        assert!(picture.pixels.iter().all(|pixel| *pixel == Vec3::ZERO));
    }
}

#[test]
fn tickets_tell_own_questions_from_the_renderers_and_those_of_before() {
    let world = World::new(wall(), &[], |_, _, _| Vec3::ONE);
    let mut front = chosen(&[]).interactive(6);
    front.look(&world.view, &[]);
    front.begin(Some(Effort(0.1)));
    let first = front.ask(1000);
    assert!(!first.is_empty() && first.iter().all(|asked| asked.ticket.batch % 2 == 1 && asked.ticket.batch >= 6));
    // An edit: what was asked before is of no use.
    let edited = View { world: WorldState { revision: 1, ..world.view.world }, ..world.view.clone() };
    let change = Change::Light { light: 0, value: Light::Point { position: Vec3::Z, intensity: Vec3::ONE } };
    front.look(&edited, &[change]);
    front.begin(Some(Effort(0.1)));
    let second = front.ask(1000);
    let tickets = |asked: &[Asked]| asked.iter().map(|asked| asked.ticket).collect::<BTreeSet<Ticket>>();
    assert!(!second.is_empty() && tickets(&first).is_disjoint(&tickets(&second)), "vertices are asked about again");
}
