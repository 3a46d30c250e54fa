//! `bench --live`: how fast and how steady the loop is while a person moves a camera, an object, a lamp, the time, a knob.

use std::sync::Arc;
use std::time::{Duration, Instant};

use anyhow::{Context, bail};
use frame::front_end::{Effort, Panel, Value};
use frame::live::{Event, Frame, Knobs, Making, pick};
use frame::parts::reproject;
use frame::{Chosen, Layer};
use glam::{Mat3, Vec3};
use protocol::question::{Ask, Asked, Lit, Quality, Question, Rect, Ticket, Tile};
use scenes::{Camera, Change, Key, Light, Material, Mesh, Motion, Object, Offset, Scene, Transform};

use super::player::Player;
use crate::cluster::{self, Cluster, ClusterOptions};

/// What one kind of input costs.
#[derive(Clone, Debug, serde::Serialize)]
pub struct Row {
    /// What was done.
    pub input: &'static str,
    /// Pictures a second.
    pub frames_per_second: f64,
    /// Size of most of them, pixels.
    pub size: [u32; 2],
    /// From an input to the first picture that shows it, as browsers receive it: half of them waited less.
    pub latency_p50_ms: f64,
    /// … and 99 of 100 less.
    pub latency_p99_ms: f64,
    /// From an edit until a worker has answered a question about a single pixel: half of them took less. For looks
    /// and knobs, which edit nothing, this is the question alone.
    pub edit_ms: f64,
    /// The same for the first edit of all.
    pub first_edit_ms: f64,
    /// Bytes that each worker is sent for an edit, besides questions.
    pub bytes_per_edit: f64,
}

/// How much moving pictures flicker, by what is done about it.
#[derive(Clone, Copy, Debug, serde::Serialize)]
pub struct Flicker {
    /// The same light sets in every frame; `None` if the method does not tell where its points lie.
    pub fixed: Option<f64>,
    /// As people see it: each has its own, and what is seen again is their mean.
    pub steady: Option<f64>,
}

/// Each kind of input goes on for this long.
const EACH: Duration = Duration::from_secs(4);
/// Inputs come as fast as screens are drawn.
const BETWEEN_INPUTS: Duration = Duration::from_micros(16_667);
/// Edits of a kind whose cost is measured.
const EDITS: usize = 31;
/// Time of the scene between two of them, seconds.
const BETWEEN_EDITS: f32 = 0.37;
/// Pieces that are moved for the first time, each once.
const PIECES_MAX: u32 = 64;
/// Longest wait for an answer.
const PATIENCE: Duration = Duration::from_secs(600);
/// Frames that flicker is measured over.
const FLICKER_FRAMES: u32 = 24;

/// Moves everything that a scene has, and a lamp and a box that are added if none is there to be moved, in real time, by so many
/// threads, as if they were so far away (there and back). `say` hears what comes next, and about how many seconds are left.
///
/// # Errors
/// No worker can be started, or none draws anything.
pub fn measure(
    scene: &Scene,
    method: &Chosen,
    rate: f32,
    (threads, far): (usize, Duration),
    say: &dyn Fn(&str, u64),
) -> anyhow::Result<Vec<Row>> {
    let knobs = knobs(method, rate);
    let scene = &furnished(scene);
    let workers = || ClusterOptions { far, ..options(threads) };
    let mut player = Player::start(scene.clone(), knobs.clone(), workers(), false)?;
    player.wait_for(|frame| frame.frames > 0)?;
    let mut bare = Bare::start(scene, workers())?;
    let (mut rows, inputs) = (Vec::new(), inputs(scene, &knobs));
    let all = inputs.len();
    for Input { name: input, step, back, moves } in inputs {
        say(input, (all - rows.len()) as u64 * EACH.as_secs() * 2);
        let [first_edit_ms, edit_ms] = bare.edit_ms(&*step)?;
        if !back.is_empty() {
            bare.cluster.change(back.clone())?;
        }
        // The pace finds its effort before anything counts.
        play(&mut player, &*step, EACH / 2, moves);
        player.take_latency();
        player.edit_bytes = [0; 2];
        let began = Instant::now();
        let frames = play(&mut player, &*step, EACH, moves);
        let seconds = began.elapsed().as_secs_f64();
        let latency = player.take_latency();
        let ms = |share| latency.percentile(share).unwrap_or(0) as f64 / 1e3;
        let [bytes, edits] = player.edit_bytes;
        rows.push(Row {
            input,
            frames_per_second: frames.len() as f64 / seconds,
            size: frames.last().map_or([0; 2], |frame| [frame.picture.width, frame.picture.height]),
            latency_p50_ms: ms(0.5),
            latency_p99_ms: ms(0.99),
            edit_ms,
            first_edit_ms,
            bytes_per_edit: bytes as f64 / edits.max(1) as f64,
        });
        // The next input finds everything as it was.
        if !back.is_empty() {
            player.handle(Event::Edit(back));
        }
        player.wait_for(|frame| frame.moving.is_none() && frame.frames > 0)?;
    }
    Ok(rows)
}

/// Workers without the loop: what an edit costs by itself.
struct Bare {
    cluster: Cluster,
    camera: Camera,
}

impl Bare {
    fn start(scene: &Scene, options: ClusterOptions) -> anyhow::Result<Self> {
        let mut cluster = Cluster::start(options).context("workers cannot be started")?;
        cluster.publish(Arc::new(scene.clone())).context("the scene cannot be sent to workers")?;
        let mut bare = Self { cluster, camera: scene.camera };
        bare.ask()?;
        Ok(bare)
    }

    /// The first one's, and the median.
    fn edit_ms(&mut self, step: &dyn Fn(f32) -> Event) -> anyhow::Result<[f64; 2]> {
        let mut times = Vec::new();
        for edit in 0..EDITS {
            let began = Instant::now();
            if let Event::Edit(changes) = step(edit as f32 * BETWEEN_EDITS) {
                self.cluster.change(changes)?;
            }
            self.ask()?;
            times.push(began.elapsed().as_secs_f64() * 1e3);
        }
        let first = times[0];
        times.sort_by(f64::total_cmp);
        Ok([first, times[EDITS / 2]])
    }

    /// Asks about one pixel by next to no light, and waits for the answer.
    fn ask(&mut self) -> anyhow::Result<()> {
        let world = self.cluster.state().context("the scene was not published")?;
        let quality = Quality {
            interleave: [1, 1],
            light_samples: 1,
            vpls: 1,
            photons: 0,
            bias_compensation: false,
            importance: false,
            ..Quality::default()
        };
        let rect = Rect { x: self.camera.width / 2, y: self.camera.height / 2, width: 1, height: 1 };
        let tile = Tile { camera: self.camera, rect, lit: Lit { set: 0, frame: 0, seed: 0, quality } };
        self.cluster.ask(vec![Asked::new(Ticket::default(), Question { world, ask: Ask::Tile(tile) })]);
        let until = Instant::now() + PATIENCE;
        while Instant::now() < until {
            match self.cluster.next(PATIENCE) {
                Some(cluster::Event::Answered { .. }) => return Ok(()),
                Some(cluster::Event::Unanswered { reason, .. }) => bail!("no answer about one pixel: {reason}"),
                _ => {}
            }
        }
        bail!("no answer for {} minutes", PATIENCE.as_secs() / 60)
    }
}

/// Gives inputs for this long, and returns the pictures that came of it: the moving ones, if something moves.
fn play(player: &mut Player, step: &dyn Fn(f32) -> Event, time: Duration, moves: bool) -> Vec<Frame> {
    let began = Instant::now();
    let (mut next, mut frames) = (began, Vec::new());
    while began.elapsed() < time {
        if Instant::now() >= next {
            next += BETWEEN_INPUTS;
            player.handle(step(began.elapsed().as_secs_f32()));
        }
        let patience = next.saturating_duration_since(Instant::now());
        frames.extend(player.recv(patience).filter(|frame| !moves || frame.moving.is_some()));
    }
    frames
}

/// The scene, with a dim lamp at the eye if it has no point light, and a box at the side that moves if nothing does.
fn furnished(scene: &Scene) -> Scene {
    let mut scene = scene.clone();
    let camera = scene.camera;
    let lens = camera.lens();
    let aside = lens.direction(camera.width as f32 * 0.25, camera.height as f32 * 0.4).normalize();
    // A copy, so that workers have yet to find pieces when the first is moved.
    let found = pick::pick(&scene.clone(), lens.origin(), aside);
    let distance = found.map_or(camera.origin.distance(camera.target), |found| found.distance);
    if point_light(&scene).is_none() {
        let intensity = Vec3::splat(LAMP_IRRADIANCE * distance * distance);
        scene.lights.push(Light::Point { position: camera.origin, intensity });
    }
    if scene.objects.iter().all(|object| object.motion.is_none()) {
        let (middle, side) = (lens.origin() + aside * (0.6 * distance), 0.05 * distance);
        let corner = |i: u32| middle + side * (Vec3::new((i & 1) as f32, (i >> 1 & 1) as f32, (i >> 2) as f32) - 0.5);
        let triangles = BOX.map(|[a, b, c, d]| [[a, b, c], [a, c, d]]).concat();
        let (material, mesh) = (scene.materials.len() as u32, scene.meshes.len() as u32);
        let key = |t: u32| Key { time: t.into(), translate: Vec3::Y * (side * (t % 2) as f32), angle_deg: 0.0 };
        let motion = Motion {
            pivot: middle,
            axis: Vec3::Y,
            keys: (0..KEYS).map(key).collect(),
            poses: Vec::new(),
            offset: Offset::default(),
        };
        scene.materials.push(Material::diffuse("box", Vec3::splat(0.5)));
        let materials = vec![material; triangles.len()];
        let positions = (0..8).map(corner).collect();
        scene.meshes.push(Mesh { positions, triangles, materials, ..Mesh::default() }.into());
        scene.objects.push(Object { motion: Some(motion), ..Object::fixed("box", mesh) });
    }
    scene
}

/// Of a lamp that is added, on what is seen, W/m²: it is there to be moved, not to be seen.
const LAMP_IRRADIANCE: f32 = 0.01;
/// Of a box that is added: one a second, for longer than it is moved.
const KEYS: u32 = 20;
/// Its sides, counter-clockwise from outside; bits of a corner are its x, y, z.
const BOX: [[u32; 4]; 6] = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];

fn point_light(scene: &Scene) -> Option<(u32, Vec3, Vec3)> {
    (0..).zip(&scene.lights).find_map(|(number, light)| match light {
        Light::Point { position, intensity } => Some((number, *position, *intensity)),
        _ => None,
    })
}

/// The first thing that shines: its object, and a triangle of it.
fn lamp(scene: &Scene) -> Option<(u32, usize)> {
    (0..).zip(&scene.objects).find_map(|(number, object)| {
        let mut materials = scene.meshes[object.mesh as usize].materials.iter();
        let shines = |material: &u32| !scene.materials[*material as usize].emission.is_black();
        materials.position(shines).map(|triangle| (number, triangle))
    })
}

/// How much a camera that circles makes what it sees flicker, at a fixed effort, deterministically.
///
/// # Errors
/// No worker can be started, or none draws anything.
pub fn flicker(scene: &Scene, method: &Chosen, threads: usize) -> anyhow::Result<Flicker> {
    let circle = |is_fixed| -> anyhow::Result<Option<f64>> {
        let fixed = [("steady", Value::Switch(false)), ("fixed-sets", Value::Switch(true))];
        // A method that has no such knobs is the same either way.
        let method = method.with(fixed).ok().filter(|_| is_fixed).unwrap_or_else(|| method.clone());
        let knobs = Knobs { effort: Some(Effort(0.25)), rest_after: 1, ..knobs(&method, 10.0) };
        let mut player = Player::start(scene.clone(), knobs, options(threads), true)?;
        player.wait_for_rest()?;
        // Time stands still, so that pictures that are made at once have to be told when.
        let making = Making::Of { batches: 1, still: 0 };
        player.handle(Event::Turn(Knobs { making, ..player.live().knobs().clone() }));
        let (mut sum, mut count) = (0.0, 0);
        let mut before: Option<reproject::Shown> = None;
        for frame in 0..FLICKER_FRAMES {
            player.handle(Event::Look(circling(&scene.camera, 0.02 * frame as f32 + 0.01)));
            player.wait_for(|frame| frame.moving.is_some() && frame.ended)?;
            let Some(shown) = player.live().shown().cloned() else { continue };
            // The first frames are still becoming steady.
            if let Some((change, _)) =
                before.as_ref().filter(|_| frame > 6).and_then(|old| reproject::flicker(old, &shown))
            {
                (sum, count) = (sum + change, count + 1);
            }
            before = Some(shown);
        }
        Ok((count > 0).then(|| sum / f64::from(count)))
    };
    Ok(Flicker { fixed: circle(true)?, steady: circle(false)? })
}

fn knobs(method: &Chosen, rate: f32) -> Knobs {
    Knobs {
        method: method.clone(),
        seed: 0,
        rate,
        effort: None,
        rest_after: 4096,
        layer: Layer::FINAL,
        making: Making::InTime,
    }
}

fn options(threads: usize) -> ClusterOptions {
    ClusterOptions { embedded: Some(threads), give_way: true, ..ClusterOptions::default() }
}

/// What happens at a time, and what takes it back.
struct Input {
    name: &'static str,
    step: Box<dyn Fn(f32) -> Event>,
    back: Vec<Change>,
    /// Pictures are those of something that moves.
    moves: bool,
}

/// Everything that can be moved in a scene, as a function of the time in seconds.
fn inputs(scene: &Scene, knobs: &Knobs) -> Vec<Input> {
    let mut inputs = Vec::new();
    // What was done at these times has to be taken back.
    let mut add_for = |name, times: &mut dyn Iterator<Item = f32>, step: Box<dyn Fn(f32) -> Change>| {
        let back = times.filter_map(|t| step(t).undo(scene)).collect();
        inputs.push(Input { name, step: Box::new(move |t| Event::Edit(vec![step(t)])), back, moves: true });
    };
    let mut lift = None;
    let mut add = |name, step| add_for(name, &mut std::iter::once(0.0), step);
    let camera = scene.camera;
    let lens = camera.lens();
    let middle = lens.direction(camera.width as f32 * 0.5, camera.height as f32 * 0.6);
    // A copy, for the same reason as above.
    let copy = scene.clone();
    let found = pick::pick(&copy, lens.origin(), middle);
    let far = found.map_or(0.0, |found| found.distance * 0.05);
    let sway = move |t: f32| Vec3::X * (far * (3.0 * t).sin());
    let shifted = move |t: f32| Transform { translation: sway(t), ..Transform::IDENTITY };
    if let Some(pick::Picked { object, material, piece, is_room, .. }) = found {
        let before = scene.objects[object as usize].scene_from_object;
        match piece.filter(|_| is_room) {
            Some(piece) => {
                lift = Some(object);
                let step = move |t| Change::PieceTransform { object, piece, whole_from_piece: shifted(t + 0.1) };
                add("object", Box::new(step));
                let step =
                    move |t: f32| Change::PieceVisible { object, piece, visible: ((t * 2.0) as u32).is_multiple_of(2) };
                add("visibility", Box::new(step));
            }
            None => {
                let put = put(scene, object);
                let step = move |t| put(Transform { translation: before.translation + sway(t), ..before });
                add("object", Box::new(step));
                let step = move |t: f32| Change::Visible { object, visible: ((t * 2.0) as u32).is_multiple_of(2) };
                add("visibility", Box::new(step));
            }
        }
        let value = scene.materials[material as usize].clone();
        let step = move |t: f32| {
            let mut value = value.clone();
            let share = 0.5 + 0.4 * (3.0 * t).sin();
            match &mut value.surface {
                scenes::Surface::Diffuse { albedo } => albedo.value = Vec3::splat(share),
                scenes::Surface::Glossy(scenes::Gloss { base, .. }) => base.value = Vec3::splat(share),
                scenes::Surface::Mirror { reflectance } => *reflectance = Vec3::splat(share),
                scenes::Surface::Dielectric(glass) => glass.transmittance.value = Vec3::splat(share),
                scenes::Surface::Glazed { amount, .. } => amount.value = share,
                scenes::Surface::Translucent { transmittance, .. } => transmittance.value = Vec3::splat(share),
            }
            Change::Material { material, value }
        };
        add("material", Box::new(step));
    }
    if let Some(lamp) = scene.materials.iter().position(|material| !material.emission.is_black()) {
        let before = scene.materials[lamp].clone();
        let step = move |t: f32| {
            let mut value = before.clone();
            value.emission.value *= 1.0 + 0.8 * (3.0 * t).sin();
            Change::Material { material: lamp as u32, value }
        };
        add("lamp (power)", Box::new(step));
    }
    if let Some((object, triangle)) = lamp(scene) {
        let before = scene.objects[object as usize].scene_from_object;
        let pieces = copy.meshes[copy.objects[object as usize].mesh as usize].pieces();
        let piece = (pieces.count() > 1).then(|| pieces.of_triangle(triangle));
        let around = match piece {
            Some(piece) => pick::bounds_of_piece(&copy, object, piece),
            None => pick::bounds(&copy, object),
        };
        let middle = around.map_or(Vec3::ZERO, |[least, greatest]| 0.5 * (least + greatest));
        let put = put(scene, object);
        let step = move |t: f32| {
            let size = 0.8 + 0.1 * (3.0 * t).cos();
            let resized = Transform {
                linear: Mat3::from_diagonal(Vec3::splat(size)),
                translation: middle * (1.0 - size) + sway(t),
            };
            match piece {
                Some(piece) => Change::PieceTransform { object, piece, whole_from_piece: resized },
                None => put(before.after(&resized)),
            }
        };
        add("lamp (place, size)", Box::new(step));
    }
    if let Some((light, position, intensity)) = point_light(scene) {
        let step =
            move |t: f32| Change::Light { light, value: Light::Point { position: position + sway(t), intensity } };
        add("lamp (point)", Box::new(step));
    }
    if scene.objects.iter().any(|object| object.motion.is_some()) {
        add("time", Box::new(|t| Change::Time(f64::from(t))));
    }
    if let Some(object) = lift {
        let count = scene.meshes[scene.objects[object as usize].mesh as usize].pieces().count();
        let count = (count as u32).min(PIECES_MAX);
        let step = move |t: f32| {
            let piece = (t / BETWEEN_EDITS + 0.5) as u32 % count;
            Change::PieceTransform { object, piece, whole_from_piece: shifted(t + 0.1) }
        };
        let mut times = (0..count).map(|edit| edit as f32 * BETWEEN_EDITS);
        add_for("object, the first time", &mut times, Box::new(step));
        // Before any other, so that pieces have yet to be found.
        inputs.rotate_right(1);
    }
    let look = Box::new(move |t: f32| Event::Look(circling(&camera, 0.3 * t)));
    inputs.insert(0, Input { name: "camera", step: look, back: Vec::new(), moves: true });
    let sliders = knobs.method.method.knobs().iter().filter(|knob| matches!(knob.panel, Panel::Slider(_)));
    let mut whole = sliders.filter_map(|knob| match knobs.method.settings.get(knob.name) {
        Value::Whole(n) => Some((knob.name, *n)),
        _ => None,
    });
    if let Some((name, value)) = whole.next() {
        let knobs = knobs.clone();
        let turn = Box::new(move |t: f32| {
            let more = Value::Whole(value + (2.0 * t) as u32 % 2);
            let method = knobs.method.with([(name, more)]).unwrap_or_else(|_| knobs.method.clone());
            Event::Turn(Knobs { method, ..knobs.clone() })
        });
        inputs.push(Input { name: "a knob, twice a second", step: turn, back: Vec::new(), moves: false });
    }
    inputs
}

/// What puts an object somewhere.
fn put(scene: &Scene, object: u32) -> impl Fn(Transform) -> Change + use<> {
    let (motion, time) = (scene.objects[object as usize].motion.clone(), scene.time);
    move |place| Change::place(object, motion.as_ref(), time, place)
}

/// A camera that circles about what it looks at, within a few degrees.
fn circling(camera: &Camera, angle: f32) -> Camera {
    let forward = camera.target - camera.origin;
    let up = camera.up.normalize();
    let right = forward.cross(up).normalize();
    let reach = forward.length() * 0.1;
    let by = right * (reach * angle.sin()) + up * (reach * 0.3 * (1.0 - angle.cos()));
    Camera { origin: camera.origin + by, ..*camera }
}
