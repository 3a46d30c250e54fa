//! The cache as a method, before people who look, move things and change lights, and workers who answer in any order.

use std::sync::Arc;

use glam::Vec3;
use proptest::prelude::*;
use protocol::answer::{Body, Cost, Fields, Moments, Pixels, Seen};
use protocol::question::{Ask, Asked, Question, WorldState};
use scenes::{Camera, Change, Light, Material, Mesh, Object, Scene, SurfacePoint, Transform};

use crate::Picture;
use crate::front_end::{Chosen, Effort, Layer, Value};
use crate::live::{Action, Ended, Event, Frame, Knobs, Live, Making, Moment};
use crate::methods::{ALL, RENDER_CACHE};

/// A square that faces the eye.
fn square(side: f32, z: f32) -> Mesh {
    let corner = |x: f32, y: f32| Vec3::new(x * side, y * side, z);
    let positions = vec![corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)];
    Mesh { positions, triangles: vec![[0, 1, 2], [0, 2, 3]], materials: vec![0, 0], ..Mesh::default() }
}

/// A wide wall, and a small square before it.
fn scene() -> Scene {
    Scene {
        meshes: vec![square(20.0, 0.0).into(), square(0.3, 1.0).into()],
        objects: vec![Object::fixed("wall", 0), Object::fixed("square", 1)],
        materials: vec![Material::diffuse("grey", Vec3::splat(0.5))],
        lights: vec![lamp(1.0)],
        ..Scene::default()
    }
}

fn lamp(brightness: f32) -> Light {
    Light::Point { position: Vec3::Z * 9.0, intensity: Vec3::splat(brightness) }
}

fn dim(brightness: f32) -> Change {
    Change::Light { light: 0, value: lamp(brightness) }
}

/// What a ray meets first.
fn hit(scene: &Scene, origin: Vec3, direction: Vec3) -> Option<(SurfacePoint, f32)> {
    let mut nearest: Option<(SurfacePoint, f32)> = None;
    for (object, it) in (0..).zip(&scene.objects).filter(|(_, it)| it.visible) {
        let mesh = &scene.meshes[it.mesh as usize];
        for (triangle, corners) in (0..).zip(&mesh.triangles) {
            let [a, b, c] = corners.map(|vertex| it.scene_from_object.point(mesh.positions[vertex as usize]));
            let t = (a.z - origin.z) / direction.z;
            let point = origin + direction * t;
            let (ab, ac, ap) = (b - a, c - a, point - a);
            let area = ab.cross(ac).z;
            let (u, v) = (ap.cross(ac).z / area, ab.cross(ap).z / area);
            let is_inside = u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t > 0.0;
            if is_inside && nearest.is_none_or(|(_, far)| t < far) {
                let at = SurfacePoint { object, triangle, uv: [u, v], ..SurfacePoint::default() };
                nearest = Some((at, t));
            }
        }
    }
    nearest
}

/// A smooth pattern on the wall; the square is as bright as the lamp is.
fn radiance(at: &SurfacePoint, point: Vec3, lamp: f32) -> Vec3 {
    match at.object {
        0 => Vec3::new(2.0 + (3.0 * point.x).sin(), 2.0 + (2.0 * point.y).cos(), 1.0),
        _ => Vec3::new(0.0, 0.0, 10.0 * lamp),
    }
}

struct Shell {
    live: Live,
    scene: Arc<Scene>,
    revision: u32,
    open: Vec<Asked>,
    frames: Vec<Frame>,
    ended: Vec<Ended>,
    now: Moment,
    /// Rays asked so far, and those of them that had an aim.
    rays: [usize; 2],
}

fn camera(x: f32) -> Camera {
    let (origin, target) = (Vec3::new(x, 0.0, 3.0), Vec3::new(x, 0.0, 0.0));
    Camera { origin, target, width: 48, height: 36, ..Camera::default() }
}

fn chosen(values: &[(&str, Value)]) -> Chosen {
    // Things look as `radiance` says, whatever their materials are.
    let own = [("interleave", Value::Pair([2, 2])), ("replicates", Value::Whole(1)), ("guide", Value::Switch(false))];
    Chosen::new(&RENDER_CACHE).with(own.iter().chain(values).cloned()).unwrap()
}

fn knobs(method: Chosen) -> Knobs {
    Knobs { method, seed: 1, rate: 10.0, effort: None, rest_after: 9, layer: Layer::FINAL, making: Making::InTime }
}

impl Shell {
    fn new(method: Chosen) -> Self {
        Self::with(knobs(method), scene())
    }

    fn with(knobs: Knobs, scene: Scene) -> Self {
        let live = Live::new(camera(0.0), knobs);
        let (open, frames, ended) = (Vec::new(), Vec::new(), Vec::new());
        let scene = Arc::new(scene);
        let mut shell = Self { live, scene, revision: 0, open, frames, ended, now: Moment(0), rays: [0; 2] };
        shell.publish();
        shell
    }

    fn publish(&mut self) {
        let world = WorldState { world: [1; 32], revision: self.revision };
        let (scene, fields) = (Arc::clone(&self.scene), Fields { emitted: true, surface: true });
        self.tell(Event::Published { world, scene, fields });
    }

    fn tell(&mut self, event: Event) {
        for action in self.live.handle(event, self.now) {
            match action {
                Action::Publish { changes, behind } => {
                    assert!(!behind, "nothing is under way that an edit could come behind");
                    let scene = Arc::make_mut(&mut self.scene);
                    for change in changes {
                        change.apply(scene).unwrap();
                    }
                    self.revision += 1;
                    self.open.clear();
                    self.publish();
                }
                Action::Forget => self.open.clear(),
                Action::Cancel(_) | Action::Note(_) => panic!("pictures that are made at once are not under way"),
                Action::Ask(questions) => {
                    for asked in &questions {
                        if let Ask::Rays(rays) = &asked.question.ask {
                            self.rays[0] += rays.through.len();
                            self.rays[1] += rays.through.iter().filter(|ray| ray.aim.is_some()).count();
                        }
                    }
                    self.open.extend(questions);
                }
                Action::Show => {
                    self.ended.extend(self.live.ended());
                    self.frames.extend(self.live.picture(self.now));
                }
            }
        }
    }

    fn lamp(&self) -> f32 {
        let Light::Point { intensity, .. } = self.scene.lights[0] else { panic!("it is a point") };
        intensity.x
    }

    fn answer(&mut self, pick: usize) {
        if self.open.is_empty() {
            return;
        }
        let Asked { ticket, question } = self.open.remove(pick % self.open.len());
        assert_eq!(question.world.revision, self.revision, "of a world that is gone");
        let body = self.made_up(&question);
        self.tell(Event::Answered { ticket, body, worker: 0, cost: Cost::default() });
    }

    fn made_up(&self, question: &Question) -> Body {
        let mut pixels = Pixels::default();
        let mut hits = Vec::new();
        let mut see = |origin: Vec3, direction: Vec3| {
            let found = hit(&self.scene, origin, direction);
            let (colour, distance) = found
                .map_or((Vec3::splat(0.25), 0.0), |(at, t)| (radiance(&at, origin + direction * t, self.lamp()), t));
            pixels.emitted.push(colour);
            pixels.reflectance.push(Vec3::ZERO);
            pixels.irradiance.push(Vec3::ZERO);
            pixels.normal.push(if found.is_some() { Vec3::Z } else { Vec3::ZERO });
            pixels.distance.push(distance);
            hits.push(found.map(|(at, _)| at));
        };
        match &question.ask {
            Ask::Tile(tile) => {
                let lens = tile.camera.lens();
                for [x, y] in tile.grid().pixels() {
                    see(lens.origin(), lens.direction(x as f32 + 0.5, y as f32 + 0.5));
                }
                Body::Pixels(pixels)
            }
            Ask::Rays(rays) => {
                let lens = rays.camera.lens();
                for ray in &rays.through {
                    let [x, y] = ray.address.pixel.map(|at| at as f32 + 0.5);
                    let direction = match ray.aim {
                        Some(aim) => (self.scene.place(&aim).unwrap() - lens.origin()).normalize(),
                        None => lens.direction(x, y),
                    };
                    see(lens.origin(), direction);
                }
                for (hit, ray) in hits.iter_mut().zip(&rays.through) {
                    if let (Some(hit), Some(aim)) = (hit, ray.aim)
                        && hit.object == aim.object
                    {
                        *hit = aim;
                    }
                }
                Body::Seen(Seen { pixels, hits })
            }
            // The still picture's cross-check.
            Ask::Reference(samples) => Body::Moments(Moments::zero(samples.rect.len())),
            _ => panic!("neither is asked for"),
        }
    }

    fn answer_all(&mut self) {
        while !self.open.is_empty() {
            self.now.0 += 100;
            self.answer(0);
        }
    }

    fn settle(&mut self) {
        for _ in 0..100_000 {
            self.answer_all();
            match self.live.wake_at() {
                Some(at) => self.now = self.now.max(at),
                None => return,
            }
            self.tell(Event::Woke);
        }
        panic!("it never rests");
    }

    /// Looks from there, and lets the time of a picture pass, in which everything is answered.
    fn step(&mut self, x: f32) {
        self.tell(Event::Look(camera(x)));
        self.pass();
    }

    fn edit(&mut self, change: Change) {
        self.tell(Event::Edit(vec![change]));
        self.pass();
    }

    fn pass(&mut self) {
        let until = self.live.wake_at().unwrap_or(self.now).max(self.now);
        let mut count = self.open.len();
        while count > 0 && !self.open.is_empty() {
            self.answer(0);
            count -= 1;
        }
        self.now = Moment(until.0);
        self.tell(Event::Woke);
    }

    fn last(&self) -> &Picture {
        &self.frames.last().expect("something is shown").picture
    }

    fn truth(&self, camera: &Camera) -> Picture {
        let lens = camera.lens();
        Picture::from_fn(camera.width, camera.height, |x, y| {
            let direction = lens.direction(x as f32 + 0.5, y as f32 + 0.5);
            hit(&self.scene, lens.origin(), direction)
                .map_or(Vec3::splat(0.25), |(at, t)| radiance(&at, lens.origin() + direction * t, self.lamp()))
        })
    }

    /// Mean difference from the truth in some columns.
    fn error(&self, camera: &Camera, columns: std::ops::Range<u32>) -> f32 {
        let (truth, count) = (self.truth(camera), columns.len() as f32 * camera.height as f32);
        let pixels = columns.flat_map(|x| (0..camera.height).map(move |y| (x, y)));
        pixels.map(|(x, y)| (truth.at(x, y) - self.last().at(x, y)).abs().element_sum()).sum::<f32>() / count
    }
}

#[test]
fn a_picture_from_elsewhere_is_there_at_once_and_nearly_right() {
    for preset in [vec![], paper()] {
        let mut shell = Shell::new(chosen(&preset));
        shell.settle();
        let before = shell.frames.len();
        shell.tell(Event::Look(camera(0.5)));
        assert_eq!(shell.frames.len(), before + 1, "without any answer");
        let frame = shell.frames.last().unwrap();
        assert_eq!((frame.camera, frame.since, frame.ended), (camera(0.5), Some(shell.now), true));
        assert!(frame.moving.is_some() && frame.known > 0.6, "{}", frame.known);
        assert_eq!(shell.ended.last().map(|ended| (ended.batches, ended.still)), Some((0, 9)));
        let first = shell.error(&camera(0.5), 38..48);
        assert!(shell.error(&camera(0.5), 0..38) < 0.6 && first < 2.0, "{first}");
        // Answers fill the strip that was never seen.
        for _ in 0..20 {
            shell.step(0.5001);
            shell.step(0.5);
        }
        let later = shell.error(&camera(0.5), 38..48);
        assert!(later < 0.5 * first, "{later} after {first}");
    }
}

fn paper() -> Vec<(&'static str, Value)> {
    crate::front_end::preset(&RENDER_CACHE, "paper").unwrap().iter().map(|(name, it)| (*name, (*it).into())).collect()
}

#[test]
fn at_rest_the_picture_is_the_renderers_whatever_was_seen_before() {
    let rest = |shell: &mut Shell| {
        shell.settle();
        let frame = shell.frames.last().unwrap();
        assert!(frame.finished && frame.moving.is_none() && frame.frames == 9);
        frame.picture.sha256()
    };
    let igi = Chosen::new(ALL[0]).with([("interleave", Value::Pair([2, 2])), ("replicates", Value::Whole(1))]).unwrap();
    let mut fresh = Shell::with(knobs(igi), scene());
    fresh.settle();
    fresh.tell(Event::Look(camera(0.3)));
    fresh.edit(Change::Visible { object: 1, visible: false });
    let truth = rest(&mut fresh);
    let mut shell = Shell::new(chosen(&[]));
    for step in 0..30 {
        shell.step(0.3 * (step + 1) as f32 / 30.0);
        if step == 10 {
            shell.settle();
            shell.edit(Change::Visible { object: 1, visible: false });
        }
    }
    assert_eq!(shell.live.camera(), camera(0.3));
    assert!(rest(&mut shell) == truth);
}

#[test]
fn while_something_moves_all_inputs_are_shown_at_once_or_in_the_next_picture() {
    let mut shell = Shell::new(chosen(&[]));
    shell.settle();
    let before = shell.frames.len();
    for step in 0..200 {
        shell.now.0 += 5_000;
        shell.tell(Event::Look(camera(0.001 * (step + 1) as f32)));
        if shell.live.wake_at().is_some_and(|at| at <= shell.now) {
            shell.tell(Event::Woke);
        }
        shell.answer(0);
    }
    let moving: Vec<_> = shell.frames[before..].iter().filter(|frame| frame.moving.is_some()).collect();
    // A second, at thirty pictures a second.
    assert!((28..=31).contains(&moving.len()), "{}", moving.len());
    assert!(moving.windows(2).all(|pair| pair[1].revision > pair[0].revision));
    assert!(shell.live.wake_at().is_some());
}

#[test]
fn a_view_of_which_nothing_is_known_waits_for_its_first_batch_and_is_never_black() {
    let mut shell = Shell::new(chosen(&[]));
    // Before anything is drawn, somebody moves.
    shell.tell(Event::Look(camera(0.2)));
    assert!(shell.frames.is_empty());
    shell.answer_all();
    let first = shell.frames.first().expect("the first batch is a picture");
    assert!(first.moving.is_some() && first.ended && first.known > 0.1);
    assert!(first.picture.pixels.iter().all(|pixel| pixel.max_element() > 0.5));
    assert_eq!(shell.ended[0].batches, 1);
}

#[test]
fn points_go_with_their_object_and_vanish_with_it() {
    let mut shell = Shell::new(chosen(&[]));
    shell.settle();
    // Long enough that all that is seen has a name.
    for step in 0..60 {
        shell.step(0.01 * (step % 2 + 1) as f32);
    }
    let blue = |picture: &Picture| {
        let columns = (0..48).map(|x| (0..36).filter(|y| picture.at(x, *y).z > 5.0).count());
        columns.enumerate().filter(|(_, count)| *count > 2).map(|(x, _)| x).collect::<Vec<_>>()
    };
    let there = blue(shell.last());
    let scene_from_object = Transform { translation: Vec3::X * 0.5, ..Transform::IDENTITY };
    shell.tell(Event::Edit(vec![Change::Transform { object: 1, scene_from_object }]));
    let moved = blue(shell.last());
    let truth = blue(&shell.truth(&shell.live.camera()));
    // What was behind it is not known yet: a few columns take their colour from beside.
    assert!(there[0] + BESIDE < truth[0] && there.len().abs_diff(truth.len()) <= 2, "{there:?}");
    assert!(moved[0] + BESIDE >= truth[0] && moved.last().unwrap().abs_diff(*truth.last().unwrap()) <= 1, "{moved:?}");
    shell.pass();
    shell.tell(Event::Edit(vec![Change::Visible { object: 1, visible: false }]));
    assert_eq!(blue(shell.last()), Vec::<usize>::new(), "no ghost");
    assert!(shell.last().pixels.iter().all(|pixel| pixel.x > 0.5), "what was behind it is filled in");
}

#[test]
fn a_thing_that_is_dragged_from_rest_leaves_no_ghost() {
    let mut shell = Shell::new(chosen(&[]));
    shell.settle();
    let scene_from_object = Transform { translation: Vec3::X * 0.5, ..Transform::IDENTITY };
    shell.tell(Event::Edit(vec![Change::Transform { object: 1, scene_from_object }]));
    let truth = shell.truth(&camera(0.0));
    let is_blue = |picture: &Picture, x: u32, y: u32| picture.at(x, y).z > 5.0;
    let pixels = || (0..36).flat_map(|y| (0..48).map(move |x| (x, y)));
    let is_missed = |(x, y): &(u32, u32)| is_blue(&truth, *x, *y) && !is_blue(shell.last(), *x, *y);
    let is_beside = |x: u32, y: u32| (x..x + BESIDE as u32 + 1).any(|x| x < 48 && is_blue(&truth, x, y));
    let is_ghost = |(x, y): &(u32, u32)| is_blue(shell.last(), *x, *y) && !is_beside(*x, *y);
    let all = pixels().filter(|(x, y)| is_blue(&truth, *x, *y)).count();
    let (missed, ghosts) = (pixels().filter(is_missed).count(), pixels().filter(is_ghost).count());
    assert!(all > 150 && missed < all / 10 && ghosts < all / 6, "{missed} and {ghosts} of {all}");
}

/// Columns beside a thing that take its colour while nothing is known of what is there.
const BESIDE: usize = 5;

#[test]
fn light_that_changes_is_found_by_asking_the_same_again() {
    for (changes, limit) in [("repeated", 12), ("colours", 40)] {
        let mut shell = Shell::new(chosen(&[("changes", Value::Word(changes.into())), ("points", Value::Whole(200))]));
        shell.settle();
        for step in 0..80 {
            shell.step(0.01 * (step % 2 + 1) as f32);
        }
        let still_old = |shell: &Shell| {
            let truth = shell.truth(&shell.live.camera());
            let pairs = truth.pixels.iter().zip(&shell.last().pixels);
            pairs.filter(|(truth, shown)| truth.x == 0.0 && (shown.z - truth.z).abs() > 0.1 * truth.z).count()
        };
        shell.tell(Event::Edit(vec![dim(0.2)]));
        let all = still_old(&shell);
        assert!(all > 20, "{all}");
        let mut steps = 0;
        while still_old(&shell) > all / 10 && steps < 200 {
            shell.step(0.01 * (steps % 2 + 1) as f32);
            steps += 1;
        }
        assert!(steps <= limit, "{changes}: {steps} pictures of 200 samples");
    }
}

#[test]
fn light_that_changes_after_a_rest_is_seen_as_soon_as_it_is_sampled() {
    let mut shell = Shell::new(chosen(&[("points", Value::Whole(200))]));
    shell.settle();
    shell.tell(Event::Edit(vec![dim(0.2)]));
    let mut steps = 0;
    let is_old = |shell: &Shell| {
        let truth = shell.truth(&shell.live.camera());
        let pairs = truth.pixels.iter().zip(&shell.last().pixels);
        pairs.filter(|(truth, shown)| truth.x == 0.0 && (shown.z - truth.z).abs() > 0.1).count()
    };
    let all = is_old(&shell);
    assert!(all > 100, "{all}");
    while is_old(&shell) > all / 10 && steps < 200 {
        shell.step(0.01 * (steps % 2 + 1) as f32);
        steps += 1;
    }
    // 1728 pixels by 200 samples.
    assert!(steps <= 16, "{steps} pictures");
}

#[test]
fn what_was_forgotten_is_asked_again_and_nothing_else() {
    let mut shell = Shell::new(chosen(&[]));
    shell.settle();
    shell.step(0.1);
    shell.tell(Event::Look(camera(0.11)));
    let asked: Vec<Asked> = shell.open.clone();
    assert!(!asked.is_empty());
    // Time passes, and the still picture begins: the batch is still on its way.
    shell.now = shell.live.wake_at().unwrap();
    shell.tell(Event::Woke);
    assert!(asked.iter().all(|asked| shell.open.contains(asked)));
    // Somebody moves again: all is forgotten, and the batch is asked again.
    shell.tell(Event::Look(camera(0.12)));
    assert!(asked.iter().all(|asked| shell.open.iter().filter(|open| *open == asked).count() == 1));
    let is_tile = |asked: &Asked| matches!(asked.question.ask, Ask::Tile(_));
    assert!(!shell.open.iter().any(is_tile));
}

#[test]
fn where_nothing_shines_nothing_is_asked() {
    let mut shell = Shell::new(chosen(&[]));
    shell.settle();
    let world = WorldState { world: [1; 32], revision: 0 };
    let (scene, fields) = (Arc::clone(&shell.scene), Fields { emitted: false, surface: false });
    shell.tell(Event::Published { world, scene, fields });
    shell.rays = [0; 2];
    shell.step(0.1);
    shell.step(0.2);
    assert_eq!(shell.rays, [0; 2]);
}

#[test]
fn a_number_of_samples_is_kept_to_and_known_points_are_aimed_at() {
    let mut shell = Shell::new(chosen(&[("points", Value::Whole(100)), ("predict", Value::Whole(0))]));
    shell.settle();
    for step in 0..40 {
        shell.step(0.005 * step as f32);
    }
    let pictures = shell.frames.iter().filter(|frame| frame.moving.is_some()).count();
    let mean = shell.rays[0] as f32 / pictures as f32;
    assert!((80.0..=101.0).contains(&mean), "{mean} a picture");
    assert!(shell.rays[1] > 0);
}

/// Error diffusion loses what is left at the edges: of two samples of a small picture perhaps both, and nothing would ever
/// come.
#[test]
fn however_few_samples_there_are_the_first_picture_comes() {
    for points in 1..=4 {
        let mut shell = Shell::new(chosen(&[("points", Value::Whole(points))]));
        shell.tell(Event::Look(camera(0.1)));
        shell.answer_all();
        shell.pass();
        assert!(shell.rays[0] > 0 && !shell.frames.is_empty(), "{points} samples");
    }
}

#[test]
fn pictures_of_one_pixel_and_teleports_are_pictures() {
    let mut shell = Shell::new(chosen(&[]));
    shell.settle();
    for (width, height) in [(1, 1), (1, 9), (13, 1), (48, 36)] {
        shell.tell(Event::Look(Camera { width, height, ..camera(0.1) }));
        shell.pass();
        let frame = shell.frames.last().unwrap();
        assert_eq!([frame.picture.width, frame.picture.height], [width, height]);
    }
    shell.settle();
    // Somewhere else, the other way round, and in the wall.
    for (origin, target) in
        [(Vec3::new(9.0, 9.0, 2.0), Vec3::new(9.0, 9.0, 0.0)), (Vec3::Z * 3.0, Vec3::Z * 6.0), (Vec3::ZERO, Vec3::X)]
    {
        shell.tell(Event::Look(Camera { origin, target, ..camera(0.0) }));
        shell.pass();
        shell.settle();
        assert!(shell.frames.iter().all(|frame| frame.picture.pixels.iter().all(|pixel| pixel.is_finite())));
        assert!(shell.frames.last().unwrap().finished);
    }
}

/// Walking sideways, with one new sample for 32 pixels: what comes into view was asked about before it did.
#[test]
fn what_will_come_into_view_is_known_when_it_does() {
    let known = |predict: u32| {
        let points = Value::Whole(48 * 36 / 32);
        let mut shell = Shell::new(chosen(&[("points", points), ("predict", Value::Whole(predict))]));
        shell.settle();
        let moving = shell.frames.len();
        (1..=16).for_each(|step| shell.step(step as f32 * 0.06));
        let frames = &shell.frames[moving..];
        // The columns that were beyond the edge two pictures ago.
        let camera = camera(16.0 * 0.06);
        (frames.iter().map(|frame| frame.known).sum::<f32>() / frames.len() as f32, shell.error(&camera, 42..48))
    };
    let ((with, edge), (without, bare_edge)) = (known(2), known(0));
    assert!(with > without, "share of the pixels that show a point: {with} with prediction, {without} without");
    assert!(edge < bare_edge, "error at the edge: {edge} with prediction, {bare_edge} without");
}

/// A lamp that is dragged faster than anything is answered: pictures keep coming, all inputs get into one, and soon after the
/// last edit light is right.
#[test]
fn a_hundred_edits_a_second_do_not_starve_the_picture() {
    let mut shell = Shell::new(chosen(&[]));
    shell.settle();
    let (before, began) = (shell.frames.len(), shell.now.0);
    for edit in 1..=100 {
        shell.tell(Event::Edit(vec![dim(1.0 + edit as f32 / 100.0)]));
        // Two questions are answered in the time of an edit.
        (0..2).for_each(|_| shell.answer(0));
        shell.now.0 = began + edit * 10_000;
        shell.tell(Event::Woke);
    }
    let frames = &shell.frames[before..];
    assert!(frames.len() >= 20, "{} pictures in a second", frames.len());
    assert!(frames.windows(2).all(|pair| pair[0].revision <= pair[1].revision), "no picture is older than the last");
    let last = frames.last().unwrap();
    assert!(shell.live.revision() - last.revision <= 10, "a tenth of a second at most: {}", last.revision);
    for _ in 0..15 {
        shell.pass();
    }
    assert!(shell.error(&camera(0.0), 0..48) < 0.2, "{}", shell.error(&camera(0.0), 0..48));
}

/// Mirrors depend on where the eye is: of what they show there is no long memory.
#[test]
fn what_a_mirror_shows_is_not_averaged_over_many_eyes() {
    let mut scene = scene();
    scene.materials.push(Material {
        surface: scenes::Surface::Mirror { reflectance: Vec3::ONE },
        ..Material::diffuse("mirror", Vec3::ONE)
    });
    let mut mirror = square(0.3, 1.0);
    mirror.materials = vec![1, 1];
    scene.meshes[1] = mirror.into();
    let mut shell =
        Shell::with(knobs(chosen(&[("history", Value::Whole(255)), ("points", Value::Whole(1728))])), scene);
    shell.settle();
    // The same place again and again, and then the lamp, which the square mirrors, is another; nobody edits the square.
    (0..12).for_each(|step| shell.step(0.02 * (step % 2) as f32));
    let square = |shell: &Shell| shell.last().at(24, 18).z;
    assert!((square(&shell) - 10.0).abs() < 0.5, "{}", square(&shell));
    shell.edit(dim(2.0));
    (0..6).for_each(|step| shell.step(0.02 * (step % 2) as f32));
    assert!((square(&shell) - 20.0).abs() < 2.0, "{}", square(&shell));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]
    /// A session that is recorded is the same pictures again, whatever order answers come in.
    #[test]
    fn a_replay_draws_the_same_whoever_answers(
        inputs in prop::collection::vec((0u8..8, 0usize..400), 1..14),
        orders in prop::array::uniform2(prop::collection::vec(any::<u16>(), 40)),
    ) {
        let event = |kind: u8, number: usize| match kind {
            0 => Event::Edit(vec![Change::Visible { object: 1, visible: number.is_multiple_of(2) }]),
            1 => {
                let translation = Vec3::X * (0.01 * number as f32);
                let scene_from_object = Transform { translation, ..Transform::IDENTITY };
                Event::Edit(vec![Change::Transform { object: 1, scene_from_object }])
            }
            _ => Event::Look(camera(0.02 * number as f32 + 0.005 * f32::from(kind))),
        };
        // Live: answers come when they like.
        enum Line { Input(Box<Event>), Shown(Ended) }
        let mut shell = Shell::new(chosen(&[]));
        let mut lines = Vec::new();
        let note = |shell: &mut Shell, lines: &mut Vec<Line>| {
            lines.extend(shell.ended.drain(..).map(Line::Shown));
        };
        shell.settle();
        for (number, (kind, answers)) in inputs.iter().enumerate() {
            let input = event(*kind, number);
            lines.push(Line::Input(Box::new(input.clone())));
            shell.tell(input);
            note(&mut shell, &mut lines);
            for i in 0..*answers {
                shell.answer(i * 7);
                note(&mut shell, &mut lines);
            }
            shell.now.0 += 20_000;
            shell.tell(Event::Woke);
            note(&mut shell, &mut lines);
        }
        // Replays: time stands still, answers come in another order.
        let replay = |order: &[u16]| {
            let shown: Vec<Ended> =
                lines.iter().filter_map(|line| if let Line::Shown(ended) = line { Some(*ended) } else { None }).collect();
            let mut shell = Shell::new(chosen(&[]));
            let (mut drawn, mut hashes, mut picks) = (0, Vec::new(), order.iter().cycle());
            for line in &lines {
                match line {
                    Line::Input(input) => {
                        let next = shown.get(drawn + shell.live.under_way());
                        let making = Making::Held { still: next.map_or(0, |next| next.still) };
                        let effort = next.map(|next| next.effort);
                        shell.tell(Event::Turn(Knobs { effort, making, ..knobs(chosen(&[])) }));
                        shell.tell((**input).clone());
                    }
                    Line::Shown(ended) => {
                        let making = Making::Of { batches: ended.batches, still: ended.still };
                        shell.tell(Event::Turn(Knobs { making, ..shell.live.knobs().clone() }));
                        for _ in 0..10_000 {
                            if shell.ended.len() > drawn {
                                break;
                            }
                            shell.answer(usize::from(*picks.next().unwrap()));
                        }
                        assert_eq!(shell.ended.len(), drawn + 1, "it waits for ever");
                        assert_eq!(shell.ended[drawn], Ended { effort: Effort(ended.effort.0), ..*ended });
                        hashes.push(shell.last().sha256());
                        drawn += 1;
                    }
                }
            }
            hashes
        };
        let [first, second] = orders;
        prop_assert!(replay(&first) == replay(&second));
    }
}
