//! Moving pictures that are made at once, of what a method remembers, and still ones that a renderer makes.
//!
//! *Moving*: a picture shows what is known ([`Memory`]) and asks about what it lacks; answers are for the pictures after it,
//! by whole batches. Only while nothing is known at all, the first picture waits for its first batch.
//! *Still*: the renderer draws as it does without a memory, and its picture takes over within [`HAND_OVER`] frames. When
//! something moves again, that picture is what the memory begins with.
//!
//! **Promise.** At rest the picture is the renderer's alone: nothing in it depends on what was seen before. In motion it is a
//! function of inputs and of how many batches went into each picture, whoever answered.

use std::collections::{BTreeMap, VecDeque};
use std::sync::Arc;

use protocol::answer::Body;
use protocol::question::{Asked, Motion, Quality, Rect, Ticket};
use scenes::{Camera, Change};

use crate::Picture;
use crate::front_end::{
    Absorbed, Answered, Effort, FrontEnd, GivenUp, Held, Interactive, Knob, Layer, Mark, Method, Open, Plane, Probe,
    Settings, Shot, Steps, Stock, Turned, View,
};
use crate::metrics::Estimate;
use crate::parts::reproject::Shown;
use crate::parts::{Batches, Slot, Smoother};

/// What is remembered of light, and how it looks. One *tick* is one moving picture.
pub trait Memory: Send {
    /// What is asked together.
    type Batch: Send;

    /// The step in which answers are taken in, as people are told of it.
    const UPDATE: &'static str;

    /// Takes other settings; what is known stays.
    fn turn(&mut self, settings: &Settings);

    /// Nothing is known.
    fn is_empty(&self) -> bool;

    /// Forgets what is known, and the last picture.
    fn reset(&mut self);

    /// This is looked at from now on; `is_edited`: the world is another than it was, by `changes` if they are known.
    fn move_to(&mut self, view: &View, changes: &[Change], is_edited: bool);

    /// Takes over a still picture of what was looked at last, plane by plane (the final one is radiance as people saw it),
    /// and of how many frames it is made.
    fn begin_with(&mut self, view: &View, still: &mut dyn FnMut(Plane) -> Picture, frames: u32);

    /// Takes in a batch that was answered whole: an answer for each of its questions, or none where one will never come.
    fn absorb(&mut self, view: &View, batch: &Self::Batch, answers: &[Option<Body>]);

    /// Nobody will answer a batch.
    fn forget(&mut self, batch: &Self::Batch);

    /// The next picture looks like this; what should be asked about, with so many samples at most. `done` hears of steps.
    fn tick(&mut self, view: &View, samples: usize, done: &mut dyn FnMut(Option<&'static str>)) -> Option<Self::Batch>;

    /// The questions of a batch, numbered by `ticket`.
    fn questions(batch: &Self::Batch, ticket: &dyn Fn(usize) -> Ticket) -> Vec<Asked>;

    /// The picture of the last tick, and the share of its pixels that something is known of.
    fn picture(&mut self, view: &View) -> (&Shown, f32);

    /// The last picture, as it was shown.
    fn shown(&self) -> Option<&Shown>;

    /// A plane of its own, of the last picture.
    fn plane(&self, plane: Plane) -> Option<Picture>;

    /// The samples of a moving picture.
    fn samples(&self, camera: &Camera, effort: Effort) -> usize;

    /// Work of so many samples.
    fn work(&self, samples: usize) -> f64;

    /// What it takes.
    fn held(&self) -> Held;
}

/// What can be set and looked at: a memory's, and its renderer's.
#[derive(Clone, Debug)]
pub struct Tables {
    /// Knobs, the memory's first.
    pub knobs: Vec<Knob>,
    /// Layers, the renderer's first.
    pub layers: Vec<Layer>,
}

/// Knobs of a renderer that are about its own way of moving.
const OF_ITS_MOTION: [&str; 2] = ["steady", "fixed-sets"];

impl Tables {
    /// Those of a memory over this renderer.
    pub fn over(renderer: &dyn Method, knobs: &[Knob], layers: &[Layer]) -> Self {
        let its = renderer.knobs().iter().filter(|knob| !OF_ITS_MOTION.contains(&knob.name));
        Self {
            knobs: knobs.iter().chain(its).copied().collect(),
            layers: renderer.layers().iter().chain(layers).copied().collect(),
        }
    }
}

/// A renderer's quality for single rays and points: light is chosen for nobody, because the eye moves.
pub fn for_any_eye(quality: &Quality) -> Quality {
    let motion = if quality.motion == Motion::Fresh { Motion::Still } else { quality.motion };
    Quality { importance: false, motion, ..*quality }
}

/// See the module's documentation.
pub struct AtOnce<M: Memory> {
    memory: M,
    /// Draws still pictures.
    still: Box<dyn Interactive>,
    view: Option<View>,
    drawing: Drawing,
    /// The moving picture has ended and was not shot yet.
    is_shot_due: bool,
    batches: Batches<Body>,
    /// By their numbers.
    open: BTreeMap<u32, OpenBatch<M::Batch>>,
    /// Answered whole, in no picture yet.
    whole: VecDeque<(M::Batch, Vec<Option<Body>>)>,
    /// Batches that go into the next moving picture.
    taking: Option<u32>,
    /// Batches in the moving picture.
    taken: u32,
    layer: Layer,
    /// Who measures.
    steps: Option<Steps>,
}

struct OpenBatch<B> {
    batch: B,
    questions: Vec<Asked>,
    /// Which were given out, and nobody has said that they were forgotten.
    out: Vec<bool>,
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

/// Batches that may be on their way: at thirty pictures a second, workers may be a fifth of a second away. More: longer ways are
/// used well; where workers are slower than was thought, samples are for older cameras until the pace has learnt it.
const IN_FLIGHT: usize = 8;
/// Still frames after which nothing is left of what is remembered in the picture.
const HAND_OVER: u32 = 8;
/// Still frames that a replay draws at most before something moves.
const STILL_MAX: u32 = 16;
/// Pictures a second: one is made at once, so there is no reason to wait longer.
const RATE: f32 = 30.0;
/// The step in which a picture is made of what is known.
const DISPLAY: &str = "interpolation";

impl<M: Memory> AtOnce<M> {
    /// Nothing to look at yet.
    pub fn new(memory: M, renderer: &'static dyn Method, settings: &Settings, first_ticket: u32) -> Self {
        let first = first_ticket.div_ceil(2);
        Self {
            memory,
            still: renderer.interactive(settings, first),
            view: None,
            drawing: Drawing::Nothing,
            is_shot_due: false,
            batches: Batches::new(first, 0),
            open: BTreeMap::new(),
            whole: VecDeque::new(),
            taking: None,
            taken: 0,
            layer: Layer::FINAL,
            steps: None,
        }
    }

    fn is_still(&self) -> bool {
        self.drawing == Drawing::Still
    }

    /// A picture can be made at once; of what nothing shines in, it can be without knowing anything.
    fn knows_something(&self) -> bool {
        !self.memory.is_empty() || self.view.as_ref().is_some_and(|view| !shines(view))
    }

    /// The still picture is remembered, unless what it is of counted as white.
    fn begin_with_still(&mut self) {
        let frames = if self.layer.plane == Plane::Illuminance { 0 } else { self.still.frames() };
        if let Some(view) = self.view.as_ref().filter(|_| self.drawing == Drawing::Still && frames > 0) {
            let still = &mut self.still;
            self.memory.begin_with(view, &mut |plane| still.show(plane), frames.min(STILL_MAX));
        }
    }

    /// Takes in batches that were answered whole.
    fn take(&mut self, count: u32, view: &View) {
        tell(&mut self.steps, None);
        for (batch, answers) in self.whole.drain(..(count as usize).min(self.whole.len())) {
            self.memory.absorb(view, &batch, &answers);
        }
        tell(&mut self.steps, Some(M::UPDATE));
    }

    /// Answers to what was asked so far are of no use any more.
    fn drop_batches(&mut self) {
        self.batches = Batches::new(self.batches.next_ticket(), 0);
        for (_, OpenBatch { batch, .. }) in std::mem::take(&mut self.open) {
            self.memory.forget(&batch);
        }
        for (batch, _) in self.whole.drain(..) {
            self.memory.forget(&batch);
        }
    }

    fn request(&mut self, effort: Effort) {
        let Some(view) = &self.view else { return };
        let has_room = self.open.len() + self.whole.len() < IN_FLIGHT && shines(view);
        let samples = if has_room { self.memory.samples(&view.camera, effort) } else { 0 };
        let steps = &mut self.steps;
        let Some(batch) = self.memory.tick(view, samples, &mut |step| tell(steps, step)) else { return };
        let number = self.batches.taken() + self.open.len() as u32;
        let batches = &self.batches;
        let questions = M::questions(&batch, &|slot| own(batches.ticket(number, slot)));
        self.batches.open(number, vec![Slot::Missing; questions.len()]);
        let out = vec![false; questions.len()];
        self.open.insert(number, OpenBatch { batch, questions, out });
    }

    /// Own questions that nobody has in hand.
    fn ask_own(&mut self, room: usize) -> Vec<Asked> {
        let mut asked = Vec::new();
        for (number, OpenBatch { questions, out, .. }) in &mut self.open {
            for ((question, is_out), slot) in questions.iter().zip(out).zip(self.batches.slots(*number)) {
                if asked.len() < room && matches!(slot, Slot::Missing) && !*is_out {
                    *is_out = true;
                    asked.push(question.clone());
                }
            }
        }
        asked
    }

    fn forget_own(&mut self) {
        self.open.values_mut().for_each(|batch| batch.out.fill(false));
    }

    fn collect(&mut self) -> u32 {
        let before = self.whole.len();
        while let Some((number, slots)) = self.batches.take_complete() {
            let Some(OpenBatch { batch, .. }) = self.open.remove(&number) else { continue };
            let answers = slots.into_iter().map(|slot| match slot {
                Slot::Answered(body) => Some(body),
                Slot::Empty | Slot::Missing | Slot::GivenUp => None,
            });
            self.whole.push_back((batch, answers.collect()));
        }
        (self.whole.len() - before) as u32
    }

    /// What is shown of the moving picture.
    fn develop(&mut self) -> Option<Shot> {
        let view = self.view.as_ref().filter(|_| self.knows_something())?;
        tell(&mut self.steps, None);
        let (shown, known) = self.memory.picture(view);
        let picture = (self.layer.plane == Plane::Final).then(|| Arc::clone(&shown.picture));
        tell(&mut self.steps, Some(DISPLAY));
        let picture = picture.or_else(|| self.memory.plane(self.layer.plane).map(Arc::new));
        Some(Shot { picture, frames: self.taken, known, is_current: true, marks: Vec::new() })
    }

    /// The last moving picture, if it is of what is looked at now.
    fn last_picture(&self) -> Option<&Shown> {
        let (shown, view) = (self.memory.shown()?, self.view.as_ref()?);
        (shown.camera == view.camera).then_some(shown)
    }

    fn develop_still(&mut self, smoother: Option<&dyn Smoother>) -> Option<Shot> {
        let frames = self.still.frames();
        if frames == 0 && self.last_picture().is_some() {
            return None;
        }
        let mut shot = self.still.shot(smoother)?;
        match self.layer.plane {
            Plane::Own(_) => shot.picture = self.memory.plane(self.layer.plane).map(Arc::new).or(shot.picture),
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

fn shines(view: &View) -> bool {
    view.fields.emitted || view.fields.surface
}

fn tell(steps: &mut Option<Steps>, step: Option<&'static str>) {
    if let Some(steps) = steps {
        steps(step);
    }
}

/// Tickets of the renderer are even, own ones odd.
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

impl<M: Memory> FrontEnd for AtOnce<M> {
    fn look(&mut self, view: &View, changes: &[Change]) -> Open {
        let was_still = self.is_still();
        if self.taking.is_some() {
            self.begin_with_still();
        }
        let is_edited = self.view.as_ref().is_some_and(|before| before.world != view.world) || !changes.is_empty();
        self.memory.move_to(view, changes, is_edited);
        self.taken = self.taking.take().unwrap_or(0);
        self.take(self.taken, view);
        if is_edited {
            self.drop_batches();
        }
        self.view = Some(view.clone());
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
        self.drop_batches();
        self.memory.reset();
        (self.taking, self.taken) = (None, 0);
        (self.drawing, self.is_shot_due) = (Drawing::Nothing, false);
    }

    fn absorb(&mut self, answered: Answered<'_>) -> Absorbed {
        let ticket = inner(answered.ticket);
        if !is_own(answered.ticket) {
            let is_wanted = self.is_still();
            return if is_wanted { self.still.absorb(Answered { ticket, ..answered }) } else { Absorbed::Unwanted };
        }
        let Some(place) = self.batches.find(ticket) else { return Absorbed::Unwanted };
        self.batches.answer(place, answered.body);
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
        // An answer that says nothing.
        self.batches.answer(place, Body::Irradiance(Vec::new()));
        self.collect();
        // The first picture of all must not wait for ever.
        match self.view.as_ref().filter(|_| self.drawing == Drawing::First) {
            Some(View { camera: Camera { width, height, .. }, .. }) => {
                GivenUp::Part(Rect { x: 0, y: 0, width: *width, height: *height })
            }
            None => GivenUp::Other,
        }
    }

    fn gaps(&self) -> Vec<Rect> {
        if self.is_still() { self.still.gaps() } else { Vec::new() }
    }

    fn show(&mut self, plane: Plane) -> Picture {
        if let Some(own) = self.memory.plane(plane) {
            return own;
        }
        if self.is_still() {
            return self.still.show(plane);
        }
        let shown = self.memory.shown().filter(|_| plane == Plane::Final);
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

impl<M: Memory> Interactive for AtOnce<M> {
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
            && let Some(view) = self.view.take()
        {
            self.taken = self.whole.len() as u32;
            self.take(self.taken, &view);
            // What has just been learnt is in the picture.
            self.memory.tick(&view, 0, &mut |_| {});
            self.view = Some(view);
        }
        self.drawing = Drawing::Nothing;
    }

    fn work(&self, camera: &Camera, effort: Effort) -> f64 {
        self.memory.work(self.memory.samples(camera, effort))
    }

    fn turn(&mut self, settings: &Settings) -> Turned {
        self.memory.turn(settings);
        self.still.turn(settings)
    }

    fn inspect(&mut self, layer: &Layer) {
        self.layer = *layer;
        let is_own = matches!(layer.plane, Plane::Own(_));
        self.still.inspect(if is_own { &Layer::FINAL } else { layer });
    }

    fn shot(&mut self, smoother: Option<&dyn Smoother>) -> Option<Shot> {
        let is_due = std::mem::take(&mut self.is_shot_due);
        if is_due || !self.is_still() { self.develop() } else { self.develop_still(smoother) }
    }

    fn shown(&self) -> Option<&Shown> {
        let still = self.still.shown().filter(|_| self.is_still() && self.still.frames() > 0);
        still.or_else(|| self.memory.shown())
    }

    fn marks(&self) -> Vec<Mark> {
        if self.is_still() { self.still.marks() } else { Vec::new() }
    }

    fn next_ticket(&self) -> u32 {
        self.still.next_ticket().max(self.batches.next_ticket()) << 1
    }

    fn stock(&self) -> Option<Stock> {
        let still = if self.is_still() { self.still.frames().min(STILL_MAX) } else { 0 };
        let (whole, open) = (self.whole.len(), self.whole.len() + self.open.len());
        let can_begin = self.knows_something() || still > 0;
        can_begin.then_some(Stock { whole: whole as u32, open: open as u32, still })
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

    fn held(&self) -> Option<Held> {
        Some(self.memory.held())
    }
}
