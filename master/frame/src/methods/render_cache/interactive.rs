//! The cache with people before it.
//!
//! *Moving*: a picture is made at once of what is known, and asks about what it lacks; answers are for the pictures after
//! it, by whole batches. Only while nothing is known at all, the first picture waits for its first batch.
//! *Still*: the renderer draws as it does without a cache, and its picture takes over within [`HAND_OVER`] frames. When
//! something moves again, that picture is what the cache begins with.
//!
//! **Promise.** At rest the picture is the renderer's alone: nothing in it depends on what was seen before.

use std::collections::{BTreeMap, VecDeque};
use std::sync::Arc;

use protocol::answer::{Fields, Seen};
use protocol::question::{Asked, Quality, Rect, Ticket, WorldState};
use scenes::{Camera, Change, Scene};

use super::asking::{Asking, Batch};
use super::cache::{Cache, INTERPOLATE, UPDATE};
use super::naming::{Pose, poses};
use super::settings::{Options, POINTS, PRIORITY, REQUESTS};
use super::taking::Still;
use crate::Picture;
use crate::front_end::{
    Absorbed, Answered, Effort, FrontEnd, GivenUp, Interactive, Layer, Mark, Method, Open, Plane, Probe, Settings,
    Shot, Steps, Stock, Turned, View,
};
use crate::metrics::Estimate;
use crate::parts::reproject::Shown;
use crate::parts::{Batches, Slot, Smoother};

/// See the module's documentation.
pub(super) struct CachedInteractive {
    quality: fn(&Settings) -> Quality,
    settings: Settings,
    options: Options,
    /// Draws still pictures.
    still: Box<dyn Interactive>,
    cache: Option<Cache>,
    looked: Option<Looked>,
    /// How its objects stand.
    poses: Vec<Pose>,
    /// Held only while nothing is known, until the first batch has come: whoever edits a scene that is held copies it.
    scene: Option<Arc<Scene>>,
    drawing: Drawing,
    /// The moving picture has ended and was not shot yet.
    is_shot_due: bool,
    batches: Batches<Seen>,
    /// By their numbers.
    open: BTreeMap<u32, Batch>,
    /// Answered whole, in no picture yet.
    whole: VecDeque<(Batch, Vec<Slot<Seen>>)>,
    /// Batches that go into the next moving picture.
    taking: Option<u32>,
    /// Batches in the moving picture.
    taken: u32,
    /// Batches so far.
    number: u32,
    layer: Layer,
    /// Who measures.
    steps: Option<Steps>,
}

/// What is looked at.
#[derive(Clone, Copy)]
struct Looked {
    world: WorldState,
    fields: Fields,
    camera: Camera,
    seed: u64,
}

/// What is being drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Drawing {
    Nothing,
    Still,
    Moving,
    /// The first picture of all, which waits for its first batch.
    First,
}

/// Batches that may be on their way. More: long ways to workers are used well; samples are for older cameras.
const IN_FLIGHT: usize = 4;
/// Still frames after which nothing is left of the cache in the picture.
const HAND_OVER: u32 = 8;
/// Still frames that a replay draws at most before something moves.
const STILL_MAX: u32 = 16;
/// Pictures a second: one is made at once, so there is no reason to wait longer.
const RATE: f32 = 30.0;
/// Work of an eye path, in units of a light's.
const EYE_WORK: f64 = 10.0;

impl CachedInteractive {
    /// Nothing to look at yet.
    pub fn new(
        renderer: &'static dyn Method,
        quality: fn(&Settings) -> Quality,
        settings: &Settings,
        first_ticket: u32,
    ) -> Self {
        let first = first_ticket.div_ceil(2);
        Self {
            quality,
            settings: settings.clone(),
            options: Options::of(settings),
            still: renderer.interactive(settings, first),
            cache: None,
            looked: None,
            poses: Vec::new(),
            scene: None,
            drawing: Drawing::Nothing,
            is_shot_due: false,
            batches: Batches::new(first, 0),
            open: BTreeMap::new(),
            whole: VecDeque::new(),
            taking: None,
            taken: 0,
            number: 0,
            layer: Layer::FINAL,
            steps: None,
        }
    }

    fn is_still(&self) -> bool {
        self.drawing == Drawing::Still
    }

    fn knows_something(&self) -> bool {
        self.cache.as_ref().is_some_and(|cache| !cache.is_empty())
    }

    /// Samples for a moving picture.
    fn budget(&self, camera: &Camera, Effort(share): Effort) -> usize {
        let pixels = f64::from(camera.width) * f64::from(camera.height);
        let wanted = match self.options.budget {
            Some(points) => f64::from(points),
            None => (pixels * f64::from(share)).round(),
        };
        wanted.clamp(1.0, pixels.max(1.0)) as usize
    }

    /// What is known of the still picture goes into the cache.
    fn seed(&mut self) {
        let Some(Looked { camera, world, .. }) = self.looked.filter(|_| self.is_still() && self.still.frames() > 0)
        else {
            return;
        };
        let still = Still {
            camera,
            shown: self.still.show(Plane::Final),
            radiance: self.still.show(Plane::Raw),
            reflectance: self.still.show(Plane::Albedo),
            irradiance: self.still.show(Plane::Irradiance),
            normal: self.still.show(Plane::Normal),
            distance: self.still.show(Plane::Distance),
            samples: self.still.frames(),
            revision: world.revision,
        };
        let options = self.options;
        self.cache.get_or_insert_with(|| Cache::new(options, &camera)).seed(&still);
    }

    /// Takes in batches that were answered whole.
    fn take(&mut self, count: u32, scene: &Scene) {
        let Some(cache) = &mut self.cache else { return };
        tell(&mut self.steps, None);
        for (batch, slots) in self.whole.drain(..(count as usize).min(self.whole.len())) {
            let answers = batch.parts.iter().zip(&slots).filter_map(|(part, slot)| match slot {
                Slot::Answered(seen) => Some((&part.requests[..], &part.origins[..], &part.camera, seen)),
                Slot::Empty | Slot::Missing | Slot::GivenUp => None,
            });
            cache.absorb(scene, answers);
        }
        tell(&mut self.steps, Some(UPDATE));
    }

    /// Answers to what was asked so far are of no use any more.
    fn drop_batches(&mut self) {
        self.batches = Batches::new(self.batches.next_ticket(), 0);
        self.open.clear();
        self.whole.clear();
    }

    fn request(&mut self, effort: Effort) {
        let (Some(looked), quality) = (self.looked, (self.quality)(&self.settings)) else { return };
        let shines = looked.fields.emitted || looked.fields.surface;
        let has_room = self.open.len() + self.whole.len() < IN_FLIGHT && shines;
        let budget = if has_room { self.budget(&looked.camera, effort) } else { 0 };
        let options = self.options;
        let cache = self.cache.get_or_insert_with(|| Cache::new(options, &looked.camera));
        let steps = &mut self.steps;
        let requests = cache.tick(&looked.camera, budget, looked.world.revision, &mut |step| tell(steps, step));
        if requests.rays.is_empty() {
            return;
        }
        let Looked { world, camera, seed, .. } = looked;
        let asking = Asking { world, camera, seed, quality: Asking::quality(&quality), number: self.number };
        let number = self.batches.taken() + self.open.len() as u32;
        let batch = asking.batch(&requests, |slot| own(self.batches.ticket(number, slot)));
        self.batches.open(number, vec![Slot::Missing; batch.parts.len()]);
        self.open.insert(number, batch);
        self.number = self.number.wrapping_add(1);
    }

    /// Own questions that nobody has in hand.
    fn ask_own(&mut self, room: usize) -> Vec<Asked> {
        let mut questions = Vec::new();
        for (number, batch) in &mut self.open {
            for (slot, part) in batch.parts.iter_mut().enumerate() {
                let is_missing = matches!(self.batches.slots(*number).get(slot), Some(Slot::Missing));
                if questions.len() < room && is_missing && !part.is_out {
                    part.is_out = true;
                    questions.push(part.asked.clone());
                }
            }
        }
        questions
    }

    fn forget_own(&mut self) {
        let parts = self.open.values_mut().flat_map(|batch| &mut batch.parts);
        parts.for_each(|part| part.is_out = false);
    }

    fn collect(&mut self) -> u32 {
        let before = self.whole.len();
        while let Some((number, slots)) = self.batches.take_complete() {
            self.whole.extend(self.open.remove(&number).map(|batch| (batch, slots)));
        }
        (self.whole.len() - before) as u32
    }

    /// What is shown of the moving picture.
    fn develop(&mut self) -> Option<Shot> {
        if !self.knows_something() {
            return None;
        }
        let (plane, frames) = (self.layer.plane, self.taken);
        let cache = self.cache.as_mut()?;
        tell(&mut self.steps, None);
        let (shown, known) = cache.picture();
        tell(&mut self.steps, Some(INTERPOLATE));
        let picture = match plane {
            Plane::Final => Some(Arc::clone(&shown.picture)),
            plane => own_plane(cache, plane).map(Arc::new),
        };
        Some(Shot { picture, frames, known, is_current: true, marks: Vec::new() })
    }

    /// The last moving picture, if it is of what is looked at now.
    fn last_picture(&self) -> Option<&Shown> {
        let (shown, looked) = (self.cache.as_ref()?.shown()?, self.looked?);
        (shown.camera == looked.camera).then_some(shown)
    }

    fn develop_still(&mut self, smoother: Option<&dyn Smoother>) -> Option<Shot> {
        let frames = self.still.frames();
        if frames == 0 && self.last_picture().is_some() {
            return None;
        }
        let mut shot = self.still.shot(smoother)?;
        match self.layer.plane {
            Plane::Own(_) => {
                let own = self.cache.as_ref().and_then(|cache| own_plane(cache, self.layer.plane));
                shot.picture = own.map(Arc::new).or(shot.picture);
            }
            Plane::Final if frames < HAND_OVER && !self.still.is_finished() => {
                if let (Some(last), Some(picture)) = (self.last_picture(), shot.picture.as_mut())
                    && last.picture.same_size(picture)
                {
                    let share = frames as f32 / HAND_OVER as f32;
                    let pixels = last.picture.pixels.iter().zip(&picture.pixels);
                    let pixels = pixels.map(|(cached, still)| *cached + (*still - *cached) * share).collect();
                    *picture = Arc::new(Picture { pixels, ..Picture::black(picture.width, picture.height) });
                }
            }
            _ => {}
        }
        Some(shot)
    }
}

fn tell(steps: &mut Option<Steps>, step: Option<&'static str>) {
    if let Some(steps) = steps {
        steps(step);
    }
}

fn own_plane(cache: &Cache, plane: Plane) -> Option<Picture> {
    let [points, priority, requested] = cache.planes();
    match plane {
        Plane::Own(POINTS) => Some(points),
        Plane::Own(PRIORITY) => Some(priority),
        Plane::Own(REQUESTS) => Some(requested),
        _ => None,
    }
}

/// Tickets of the renderer are even, those of the cache odd.
fn renderers(ticket: Ticket) -> Ticket {
    Ticket { batch: ticket.batch << 1, ..ticket }
}

fn own(ticket: Ticket) -> Ticket {
    Ticket { batch: ticket.batch << 1 | 1, ..ticket }
}

fn is_own(ticket: Ticket) -> bool {
    ticket.batch & 1 == 1
}

/// As whoever gave it out has numbered it.
fn inner(ticket: Ticket) -> Ticket {
    Ticket { batch: ticket.batch >> 1, ..ticket }
}

impl FrontEnd for CachedInteractive {
    fn look(&mut self, view: &View, changes: &[Change]) -> Open {
        let was_still = self.is_still();
        if self.taking.is_some() {
            self.seed();
        }
        let is_edited = self.looked.is_some_and(|looked| looked.world != view.world) || !changes.is_empty();
        if let Some(cache) = &mut self.cache {
            cache.edited(&view.scene, changes, &self.poses);
        }
        if is_edited || self.poses.is_empty() {
            self.poses = poses(&view.scene);
        }
        let taking = self.taking.take().unwrap_or(0);
        self.taken = taking;
        self.take(taking, &view.scene);
        if is_edited {
            self.drop_batches();
        }
        let View { world, fields, camera, seed, .. } = *view;
        self.looked = Some(Looked { world, fields, camera, seed });
        self.scene = (!self.knows_something()).then(|| Arc::clone(&view.scene));
        self.still.look(view, changes);
        self.drawing = Drawing::Nothing;
        if was_still {
            self.forget_own();
            return Open::Unwanted;
        }
        Open::Wanted
    }

    fn ask(&mut self, room: usize) -> Vec<Asked> {
        let mut questions = self.ask_own(room);
        if self.is_still() {
            let more = self.still.ask(room - questions.len());
            questions.extend(more.into_iter().map(|asked| Asked { ticket: renderers(asked.ticket), ..asked }));
        }
        questions
    }

    fn ask_again(&mut self) {
        self.forget_own();
        self.still.ask_again();
    }

    fn begin_again(&mut self) {
        self.still.begin_again();
        self.batches = Batches::new(self.batches.next_ticket(), 0);
        self.open.clear();
        self.whole.clear();
        (self.cache, self.taking, self.taken) = (None, None, 0);
        (self.drawing, self.is_shot_due) = (Drawing::Nothing, false);
    }

    fn absorb(&mut self, answered: Answered<'_>) -> Absorbed {
        let ticket = inner(answered.ticket);
        if !is_own(answered.ticket) {
            let is_wanted = self.is_still();
            return if is_wanted { self.still.absorb(Answered { ticket, ..answered }) } else { Absorbed::Unwanted };
        }
        let Some((number, slot)) = self.batches.find(ticket) else { return Absorbed::Unwanted };
        let rays = self.open.get(&number).and_then(|batch| batch.parts.get(slot)).map_or(0, |part| part.requests.len());
        let seen = answered.body.seen().filter(|seen| seen.hits.len() == rays);
        // What does not fit would be asked again for ever.
        self.batches.answer((number, slot), seen.unwrap_or_default());
        match self.collect() {
            frames if frames > 0 && self.drawing == Drawing::First => Absorbed::Completed { frames },
            _ => Absorbed::Kept,
        }
    }

    fn set_parallelism(&mut self, questions: usize) {
        self.still.set_parallelism(questions);
    }

    fn set_limit(&mut self, frames: u32) {
        if self.is_still() {
            self.still.set_limit(frames);
        }
    }

    fn finish(&mut self) {
        self.still.finish();
    }

    fn is_finished(&self) -> bool {
        self.is_still() && self.still.is_finished()
    }

    fn frame_progress(&self) -> f32 {
        if self.is_still() { self.still.frame_progress() } else { self.batches.progress() }
    }

    fn give_up(&mut self, ticket: Ticket) -> GivenUp {
        if !is_own(ticket) {
            return if self.is_still() { self.still.give_up(inner(ticket)) } else { GivenUp::Unwanted };
        }
        let Some(place) = self.batches.find(inner(ticket)) else { return GivenUp::Unwanted };
        self.batches.answer(place, Seen::default());
        self.collect();
        // The first picture of all must not wait for ever.
        match self.looked.filter(|_| self.drawing == Drawing::First) {
            Some(Looked { camera: Camera { width, height, .. }, .. }) => {
                GivenUp::Part(Rect { x: 0, y: 0, width, height })
            }
            None => GivenUp::Other,
        }
    }

    fn gaps(&self) -> Vec<Rect> {
        if self.is_still() { self.still.gaps() } else { Vec::new() }
    }

    fn show(&mut self, plane: Plane) -> Picture {
        if let Some(own) = self.cache.as_ref().and_then(|cache| own_plane(cache, plane)) {
            return own;
        }
        if self.is_still() {
            return self.still.show(plane);
        }
        let shown = self.cache.as_ref().and_then(Cache::shown).filter(|_| plane == Plane::Final);
        shown.map_or(Picture::default(), |shown| Picture::clone(&shown.picture))
    }

    fn frames(&self) -> u32 {
        match self.drawing {
            Drawing::Nothing => 0,
            Drawing::Still => self.still.frames(),
            Drawing::Moving => self.taken,
            Drawing::First => self.whole.len() as u32,
        }
    }

    fn error(&self) -> Option<Estimate> {
        if self.is_still() { self.still.error() } else { None }
    }

    fn probe(&self, x: u32, y: u32) -> Option<Probe> {
        if self.is_still() { self.still.probe(x, y) } else { None }
    }
}

impl Interactive for CachedInteractive {
    fn begin(&mut self, moving: Option<Effort>) {
        let Some(effort) = moving else {
            self.still.begin(None);
            self.drawing = Drawing::Still;
            return;
        };
        self.drawing = if self.knows_something() { Drawing::Moving } else { Drawing::First };
        self.request(effort);
    }

    fn end(&mut self) {
        self.is_shot_due = true;
        if self.drawing == Drawing::First
            && let (Some(scene), Some(looked)) = (self.scene.take(), self.looked)
        {
            self.taken = self.whole.len() as u32;
            self.take(self.taken, &scene);
            if let Some(cache) = &mut self.cache {
                cache.tick(&looked.camera, 0, looked.world.revision, &mut |_| {});
            }
        }
        self.drawing = Drawing::Nothing;
    }

    fn work(&self, camera: &Camera, effort: Effort) -> f64 {
        let quality = (self.quality)(&self.settings);
        let each = EYE_WORK + f64::from(quality.light_samples) + f64::from(quality.vpls);
        self.budget(camera, effort) as f64 * each
    }

    fn turn(&mut self, settings: &Settings) -> Turned {
        self.settings = settings.clone();
        self.options = Options::of(settings);
        if let Some(cache) = &mut self.cache {
            cache.set(self.options);
        }
        self.still.turn(settings)
    }

    fn inspect(&mut self, layer: &Layer) {
        self.layer = *layer;
        let is_own = [POINTS, PRIORITY, REQUESTS].contains(&layer.name);
        self.still.inspect(if is_own { &Layer::FINAL } else { layer });
    }

    fn shot(&mut self, smoother: Option<&dyn Smoother>) -> Option<Shot> {
        let is_due = std::mem::take(&mut self.is_shot_due);
        if is_due || !self.is_still() { self.develop() } else { self.develop_still(smoother) }
    }

    fn shown(&self) -> Option<&Shown> {
        let still = self.still.shown().filter(|_| self.is_still() && self.still.frames() > 0);
        still.or_else(|| self.cache.as_ref().and_then(Cache::shown))
    }

    fn marks(&self) -> Vec<Mark> {
        if self.is_still() { self.still.marks() } else { Vec::new() }
    }

    fn next_ticket(&self) -> u32 {
        self.still.next_ticket().max(self.batches.next_ticket()) << 1
    }

    fn stock(&self) -> Option<Stock> {
        let still = if self.is_still() { self.still.frames() } else { 0 };
        let can_begin = self.knows_something() || still > 0;
        let (whole, open) = (self.whole.len(), self.whole.len() + self.open.len());
        can_begin.then(|| Stock { whole: whole as u32, open: open as u32, still: still.min(STILL_MAX) })
    }

    fn take_in(&mut self, batches: u32) {
        self.taking = Some(batches);
    }

    fn rate_min(&self) -> f32 {
        RATE
    }

    fn tell_steps(&mut self, steps: Steps) -> bool {
        self.steps = Some(steps);
        true
    }
}
