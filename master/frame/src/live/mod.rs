//! The interactive loop: what people do comes in, questions and pictures go out.
//!
//! **Promise.** The newest input wins: no picture shows an older state than the one before it, and when
//! people stop, the picture sharpens to that of the last state, whatever came late, twice or never.
//! Nothing is ever black because it is not there yet.
//!
//! **Principles.**
//! * *One state a frame.* Inputs gather while a frame is drawn; the next takes them all.
//! * *Moving*: one frame a state, at a size that holds the frame rate ([`pace`]), with light sets that
//!   stay where they are. A frame that has not come in time is shown as far as it has, the rest filled from
//!   the last picture as seen from the new place ([`reproject`]).
//! * *Still*: when nothing is new, the same is drawn at full size, and frames accumulate. Only what
//!   changes the light begins again; filter, layer and tone do not.
//! * *Workers first.* The next questions go out before the last picture is developed.
//!
//! It has no clock and no threads: events and times come in, actions go out, to be carried out in order.
//! Pictures are made in [`Live::picture`], so that who carries out chooses when.

pub mod edits;
pub mod latency;
pub mod lights;
pub mod pace;
pub mod pick;
pub mod reproject;

#[cfg(test)]
mod tests;

use protocol::answer::{Body, Cost, Fields, LightPoint};
use protocol::question::{Asked, Quality, Ticket, WorldState};
use scenes::{Camera, Change};

use crate::metrics::Estimate;
use crate::parts::Smoother;
use crate::{Absorbed, Answered, Filter, FrontEnd, Igi, Layer, Picture, Probe, Setup};
use lights::{Collection, Dot};
use pace::{Level, Pace};
use reproject::Shown;

/// Microseconds since some beginning.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct Moment(pub u64);

impl Moment {
    /// So many microseconds later; later still for large pictures, which take longer to develop and to send.
    fn after(self, micros: u64, Setup { camera, .. }: &Setup) -> Self {
        let pixels = u64::from(camera.width) * u64::from(camera.height);
        Self(self.0 + micros * pixels.max(QUICK_PIXELS) / QUICK_PIXELS)
    }
}

/// What is shown to people, as long as it is not about the scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Knobs {
    /// How a still picture is drawn.
    pub quality: Quality,
    /// How it is smoothed.
    pub filter: Filter,
    /// All randomness comes from it.
    pub seed: u64,
    /// Frames a second that are aimed at while something moves.
    pub rate: f32,
    /// The level of moving pictures, whatever rate that gives; nothing: the one that holds the rate.
    pub level: Option<Level>,
    /// Moving pictures keep part of the last one's light where it is seen again, so that they flicker less.
    pub steady: bool,
    /// Still frames after which it rests.
    pub rest_after: u32,
    /// What is shown.
    pub layer: Layer,
    /// Where virtual lights lie is shown as well.
    pub lights: bool,
}

/// What can happen.
#[derive(Clone, Debug)]
pub enum Event {
    /// Somebody looks from elsewhere, or at another size.
    Look(Camera),
    /// Somebody edits the scene.
    Edit(Vec<Change>),
    /// Somebody turns a knob.
    Turn(Knobs),
    /// The workers have been told of a world: in answer to [`Action::Publish`], and once in the beginning.
    Published {
        /// Questions are about this from now on.
        world: WorldState,
        /// What answers can contain.
        fields: Fields,
    },
    /// An answer, as [`FrontEnd::absorb`] takes it.
    Answered {
        /// The question's.
        ticket: Ticket,
        /// What came.
        body: Body,
        /// By whom.
        worker: u32,
        /// At what cost.
        cost: Cost,
    },
    /// A question was given up.
    Unanswered(Ticket),
    /// Somebody looks at the pictures, or nobody does.
    Watched(bool),
    /// It is later now; see [`Live::wake_at`].
    Woke,
}

/// What is to be done.
#[derive(Clone, Debug, PartialEq)]
pub enum Action {
    /// Edit the world; in answer, [`Event::Published`] must come next. Changes that are refused are
    /// left out.
    Publish(Vec<Change>),
    /// Forget all open questions.
    Forget,
    /// Ask.
    Ask(Vec<Asked>),
    /// Show what [`Live::picture`] gives.
    Show,
}

/// A picture to be shown, and what it shows.
#[derive(Clone, Debug)]
pub struct Frame {
    /// Counts all pictures.
    pub number: u64,
    /// Counts inputs: the last that is in this picture.
    pub revision: u64,
    /// The world that was drawn.
    pub world: WorldState,
    /// From where; its size is that of a still picture.
    pub camera: Camera,
    /// What is in `picture`.
    pub layer: Layer,
    /// The virtual lights that are seen from there, if they are wanted and known.
    pub lights: Vec<Dot>,
    /// The oldest input that this is the first picture of, if there was any: people have waited since then.
    pub since: Option<Moment>,
    /// The layer; smaller than the camera's picture while something moves.
    pub picture: Picture,
    /// Something moves, and is drawn so.
    pub moving: Option<Level>,
    /// It is the last picture of its state that is drawn so.
    pub ended: bool,
    /// Complete frames that were accumulated.
    pub frames: u32,
    /// Share of the pixels that were drawn for it, 0..=1; the others are from the last picture.
    pub known: f32,
    /// It rests: nothing more will come.
    pub finished: bool,
}

/// The interactive loop: see the module's documentation.
pub struct Live {
    knobs: Knobs,
    camera: Camera,
    world: Option<(WorldState, Fields)>,
    /// Not published yet; later ones supersede earlier ones.
    changes: Vec<Change>,
    /// [`Event::Published`] is awaited.
    publishing: bool,
    /// Since the oldest input that no frame has begun with.
    news: Option<Moment>,
    /// Inputs so far, and how many of them are more than a look from elsewhere.
    revision: u64,
    edits: u64,
    take: Option<Take>,
    /// A moving take that was drawn, or given up, but not developed.
    taken: Option<Take>,
    /// The last picture, its edits, and whether it is of a still take.
    shown: Option<(Shown, u64)>,
    /// The last picture of a layer that is not the picture itself.
    layer_shown: Option<(Layer, Picture)>,
    /// The virtual lights that were last known as a whole.
    lights: Vec<LightPoint>,
    pace: Pace,
    /// To the nearest workers and back, microseconds.
    way: u64,
    /// Questions that can be answered at a time.
    parallelism: usize,
    /// The number from which on no ticket was given.
    next_ticket: u32,
    /// The moving frame that has ended last, until somebody asks.
    ended: Option<Level>,
    number: u64,
    smoother: Option<Box<dyn Smoother>>,
    watched: bool,
    /// When the last picture was begun to be developed; nothing has happened since.
    developing: Option<Moment>,
}

/// One state of everything that is being drawn.
struct Take {
    igi: Igi,
    revision: u64,
    edits: u64,
    moving: Option<Level>,
    began: Moment,
    /// When what has come is shown; nothing: not before a frame is complete.
    deadline: Option<Moment>,
    /// The oldest input that has not been seen in a picture.
    since: Option<Moment>,
    /// Questions without an answer.
    open: usize,
    /// Number of the batch of questions for its virtual lights.
    first_ticket: u32,
    /// Its virtual lights, if they are wanted; asked for when it is asked for the first time.
    lights: Option<Collection>,
    /// Complete frames in the last picture, and the earliest time of the next.
    shown_frames: Option<u32>,
    next_show: Moment,
}

impl Live {
    /// Waits for the first [`Event::Published`].
    pub fn new(camera: Camera, knobs: Knobs) -> Self {
        Self {
            knobs,
            camera,
            world: None,
            changes: Vec::new(),
            publishing: true,
            news: None,
            revision: 0,
            edits: 0,
            take: None,
            taken: None,
            shown: None,
            layer_shown: None,
            lights: Vec::new(),
            pace: Pace::new(knobs.rate, [camera.width, camera.height], &knobs.quality),
            way: 0,
            parallelism: 0,
            next_ticket: 0,
            ended: None,
            number: 0,
            smoother: None,
            watched: true,
            developing: None,
        }
    }

    /// Has pictures smoothed elsewhere from now on, as far as they are for eyes only.
    pub fn smooth_by(&mut self, smoother: Box<dyn Smoother>) {
        self.smoother = Some(smoother);
    }

    /// How long the way is to the nearest workers and back, microseconds: no choice of what to draw makes it shorter.
    pub fn set_way(&mut self, micros: u64) {
        self.way = micros;
    }

    /// So many questions can be answered at a time: with many, more still frames are in flight at once.
    pub fn set_parallelism(&mut self, questions: usize) {
        self.parallelism = questions;
        if let Some(take) = &mut self.take {
            take.igi.set_parallelism(questions);
        }
    }

    /// The level of the moving frame that has ended since this was asked last, if one has. Frames end one by one, each
    /// followed by [`Action::Show`].
    pub fn ended(&mut self) -> Option<Level> {
        self.ended.take()
    }

    /// Takes an event in, gives actions out; they are to be carried out in order.
    pub fn handle(&mut self, event: Event, now: Moment) -> Vec<Action> {
        let mut actions = Vec::new();
        self.note_developed(now);
        match event {
            Event::Look(camera) if camera == self.camera => {}
            Event::Look(camera) => {
                let size = [camera.width, camera.height];
                if size != [self.camera.width, self.camera.height] {
                    self.pace.resize(size, &self.knobs.quality);
                }
                self.camera = camera;
                self.note(now, &mut actions);
            }
            Event::Edit(changes) => {
                for change in changes {
                    self.changes.retain(|earlier| !change.supersedes(earlier));
                    self.changes.push(change);
                }
                self.edits += 1;
                self.note(now, &mut actions);
            }
            Event::Turn(knobs) => self.turn(knobs, now, &mut actions),
            Event::Published { world, fields } => {
                self.world = Some((world, fields));
                self.publishing = false;
                self.begin(now, &mut actions);
            }
            Event::Answered { ticket, body, worker, cost } => {
                self.absorb(Answered { ticket, body, worker, cost: &cost }, now, &mut actions);
            }
            Event::Unanswered(ticket) => self.give_up(ticket, now, &mut actions),
            Event::Watched(watched) => self.watched = watched,
            Event::Woke => {}
        }
        self.look_at_the_clock(now, &mut actions);
        self.pause(&mut actions);
        self.ask(&mut actions);
        actions
    }

    /// When [`Event::Woke`] should come at the latest.
    pub fn wake_at(&self) -> Option<Moment> {
        let take = self.take.as_ref()?;
        let unseen = take.is_unseen().then_some(take.next_show);
        take.deadline.into_iter().chain(unseen).min()
    }

    /// Develops what [`Action::Show`] announced; nothing if nothing has ever been drawn.
    pub fn picture(&mut self, now: Moment) -> Option<Frame> {
        self.developing = Some(now);
        let is_current = self.taken.is_none();
        let mut take = self.taken.take().or_else(|| self.take.take())?;
        let developed = self.develop(&mut take, !is_current, now);
        if is_current {
            self.take = Some(take);
        }
        developed
    }

    /// The layer that people look at: of a still picture all that has come; while something moves, and before there is a
    /// still picture, what was shown last. Nothing if nothing was.
    pub fn as_shown(&mut self) -> Option<Picture> {
        let layer = self.knobs.layer;
        if let Some(take) = self.take.as_mut().filter(|take| take.moving.is_none() && take.igi.frames() > 0) {
            return Some(take.igi.show(layer));
        }
        match layer {
            Layer::Final => self.shown().map(|shown| shown.picture.clone()),
            _ => self.layer_shown.as_ref().filter(|(shown, _)| *shown == layer).map(|(_, picture)| picture.clone()),
        }
    }

    /// The virtual lights over the current picture, if they are wanted and known.
    pub fn dots(&self) -> Vec<Dot> {
        let take = self.take.as_ref().filter(|_| self.knobs.lights);
        take.map_or(Vec::new(), |take| take.dots(&self.lights))
    }

    /// What is known of a pixel of the current still picture.
    pub fn probe(&self, x: u32, y: u32) -> Option<Probe> {
        self.take.as_ref().filter(|take| take.moving.is_none())?.igi.probe(x, y)
    }

    /// How far the still picture is from its limit.
    pub fn error(&self) -> Option<Estimate> {
        self.take.as_ref().filter(|take| take.moving.is_none())?.igi.error()
    }

    /// A moving picture is being drawn.
    pub fn is_moving(&self) -> bool {
        self.take.as_ref().is_some_and(|take| take.moving.is_some())
    }

    /// The still picture has all its frames.
    pub fn is_at_rest(&self) -> bool {
        let take = self.take.as_ref();
        take.is_some_and(|take| take.moving.is_none() && take.igi.frames() > 0 && take.igi.is_finished())
    }

    /// Changes that wait for the next frame.
    pub fn waiting(&self) -> &[Change] {
        &self.changes
    }

    /// From where people look now.
    pub fn camera(&self) -> Camera {
        self.camera
    }

    /// Inputs so far; [`Frame::revision`] says how many of them a picture shows.
    pub fn revision(&self) -> u64 {
        self.revision
    }

    /// As they are turned now.
    pub fn knobs(&self) -> &Knobs {
        &self.knobs
    }

    /// How moving pictures are drawn now.
    pub fn level(&self) -> Level {
        self.knobs.level.unwrap_or_else(|| self.pace.level())
    }

    /// What is being drawn; nothing before the first world.
    pub fn front(&mut self) -> Option<&mut Igi> {
        self.take.as_mut().map(|take| &mut take.igi)
    }

    /// The last picture and where its points lie, for measuring flicker.
    pub fn shown(&self) -> Option<&Shown> {
        self.shown.as_ref().map(|(shown, _)| shown)
    }

    /// The last picture is developed. However long that takes, answers have most of the time: the next still one waits.
    fn note_developed(&mut self, now: Moment) {
        let Some(began) = self.developing.take() else { return };
        let Some(take) = self.take.as_mut().filter(|take| take.moving.is_none()) else { return };
        let rested = Moment(now.0 + REST * now.0.saturating_sub(began.0));
        take.deadline = take.deadline.map(|deadline| deadline.max(rested));
        take.next_show = take.next_show.max(rested);
    }

    /// Something is new.
    fn note(&mut self, now: Moment, actions: &mut Vec<Action>) {
        self.revision += 1;
        self.news.get_or_insert(now);
        // A moving frame is finished first: pictures keep coming however fast inputs do.
        if self.take.as_ref().is_none_or(|take| take.moving.is_none()) {
            self.begin(now, actions);
        }
    }

    fn turn(&mut self, knobs: Knobs, now: Moment, actions: &mut Vec<Action>) {
        let old = std::mem::replace(&mut self.knobs, knobs);
        self.pace.aim(knobs.rate);
        if (old.quality, old.seed) != (knobs.quality, knobs.seed) {
            // The same state, drawn otherwise: not moving, but from the beginning.
            self.revision += 1;
            if self.take.as_ref().is_none_or(|take| take.moving.is_none()) {
                let since = self.take.as_ref().and_then(|take| take.since).unwrap_or(now);
                self.begin(now, actions);
                if let Some(take) = &mut self.take {
                    take.since.get_or_insert(since);
                }
            }
            return;
        }
        let Some(take) = &mut self.take else { return };
        take.igi.set_filter(knobs.filter);
        if take.moving.is_none() {
            take.igi.set_limit(knobs.rest_after);
        }
        let shown = |knobs: &Knobs| (knobs.filter, knobs.layer, knobs.lights);
        if shown(&old) != shown(&knobs) && take.moving.is_none() {
            actions.push(Action::Show);
        }
    }

    /// Begins with the newest state: a moving frame if there is news, else still ones.
    fn begin(&mut self, now: Moment, actions: &mut Vec<Action>) {
        if self.publishing {
            return;
        }
        let had_questions = self.take.take().is_some_and(|take| take.open > 0);
        if !self.changes.is_empty() {
            self.publishing = true;
            actions.push(Action::Publish(std::mem::take(&mut self.changes)));
            return;
        }
        if had_questions {
            actions.push(Action::Forget);
        }
        let Some((world, fields)) = self.world else { return };
        let since = self.news.take();
        let moving = since.map(|_| self.level());
        let Knobs { quality, filter, seed, rest_after, .. } = self.knobs;
        let (mut camera, mut drawn) = (self.camera, quality);
        if let Some(level) = moving {
            [camera.width, camera.height] = level.size([camera.width, camera.height]);
            drawn = level.quality(&quality);
        }
        // The first number is for its virtual lights.
        let first_ticket = self.next_ticket;
        self.next_ticket += 1;
        let mut igi =
            Igi::numbered_from(self.next_ticket, Setup { world, camera, quality: drawn, fields, seed, filter });
        igi.set_parallelism(self.parallelism);
        igi.set_limit(if moving.is_some() { 1 } else { rest_after.max(1) });
        self.take = Some(Take {
            igi,
            revision: self.revision,
            edits: self.edits,
            moving,
            began: now,
            deadline: Some(self.pace.deadline(now)),
            since,
            open: 0,
            first_ticket,
            lights: None,
            shown_frames: None,
            next_show: now,
        });
    }

    fn absorb(&mut self, answered: Answered<'_>, now: Moment, actions: &mut Vec<Action>) {
        let Some(take) = &mut self.take else { return };
        if take.lights.as_ref().is_some_and(|lights| lights.waits_for(answered.ticket)) {
            take.learn_lights(answered.ticket, Some(answered.body));
            return self.note_lights(actions);
        }
        match take.igi.absorb(answered) {
            Absorbed::Unwanted => {}
            Absorbed::Kept => take.open = take.open.saturating_sub(1),
            Absorbed::Completed { .. } => {
                take.open = take.open.saturating_sub(1);
                take.deadline = None;
                if take.moving.is_some() {
                    self.finish_moving(1.0, now, actions);
                }
            }
        }
    }

    /// Workers die of a question: its part of the picture is given up, the rest goes on.
    fn give_up(&mut self, ticket: Ticket, now: Moment, actions: &mut Vec<Action>) {
        let Some(take) = &mut self.take else { return };
        if take.learn_lights(ticket, None) {
            return self.note_lights(actions);
        }
        if take.igi.give_up(ticket).is_none() {
            return;
        }
        take.open = take.open.saturating_sub(1);
        if take.moving.is_some() && take.igi.frames() > 0 {
            return self.finish_moving(1.0, now, actions);
        }
        actions.push(Action::Show);
    }

    /// Some virtual lights have come; when all have, they are shown.
    fn note_lights(&mut self, actions: &mut Vec<Action>) {
        let Some(take) = &self.take else { return };
        let Some(lights) = take.lights.as_ref().and_then(Collection::whole) else { return };
        self.lights = lights;
        if take.moving.is_none() && take.igi.frames() > 0 {
            actions.push(Action::Show);
        }
    }

    /// The moving frame has come, or as much of it as will: on to the next, then show it.
    fn finish_moving(&mut self, done: f32, now: Moment, actions: &mut Vec<Action>) {
        let Some(take) = self.take.take() else { return };
        let size = [self.camera.width, self.camera.height];
        self.pace.learn(size, &self.knobs.quality, done, now.0.saturating_sub(take.began.0), self.way);
        if take.open > 0 {
            actions.push(Action::Forget);
        }
        self.ended = take.moving;
        self.taken = Some(take);
        self.begin(now, actions);
        self.ask(actions);
        actions.push(Action::Show);
    }

    fn look_at_the_clock(&mut self, now: Moment, actions: &mut Vec<Action>) {
        let Some(take) = &mut self.take else { return };
        if take.deadline.is_some_and(|deadline| deadline <= now) {
            let done = take.igi.frame_progress();
            let is_late = now.0 >= take.began.0 + PATIENCE;
            if take.moving.is_some() && (done > 0.0 || (is_late && self.news.is_some())) {
                return self.finish_moving(done, now, actions);
            }
            // A still frame is shown as far as it has come, again and again; a moving one of which
            // nothing has come as far as the last picture tells.
            take.deadline = Some(now.after(2 * self.pace.target(), take.igi.setup()));
            if done > 0.0 || take.since.is_some() {
                actions.push(Action::Show);
            }
        } else if take.is_unseen() && take.next_show <= now {
            actions.push(Action::Show);
        }
    }

    /// Drawing may pause: nobody looks, and whoever looks next has a whole picture to begin with.
    fn may_pause(&self) -> bool {
        !self.watched && self.take.as_ref().is_some_and(|take| take.moving.is_none() && take.igi.frames() > 0)
    }

    /// Lets workers rest while nobody looks. What they had in hand is asked again later, so nothing of the picture
    /// depends on it.
    fn pause(&mut self, actions: &mut Vec<Action>) {
        if !self.may_pause() {
            return;
        }
        let Some(take) = self.take.as_mut().filter(|take| take.open > 0) else { return };
        take.open = 0;
        take.igi.ask_again();
        take.lights = take.lights.take().filter(|lights| lights.whole().is_some());
        actions.push(Action::Forget);
    }

    fn ask(&mut self, actions: &mut Vec<Action>) {
        if self.may_pause() {
            return;
        }
        let Some(take) = self.take.as_mut().filter(|_| !self.publishing) else { return };
        if self.knobs.lights && take.lights.is_none() {
            take.want_lights(actions);
        }
        let questions = take.igi.ask(QUESTIONS_OPEN_MAX.saturating_sub(take.open));
        self.next_ticket = take.igi.next_ticket();
        if !questions.is_empty() {
            take.open += questions.len();
            actions.push(Action::Ask(questions));
        }
    }

    fn develop(&mut self, take: &mut Take, ended: bool, now: Moment) -> Option<Frame> {
        let (last, smoother) = (self.shown.as_ref(), self.smoother.as_deref());
        let frames = take.igi.frames();
        let mut known = 1.0;
        let shown = if frames > 0 && take.moving.is_none() {
            take.igi.shown(smoother)
        } else {
            // The first still frame grows from coarse to fine; the last picture, which is of the same state, stays
            // until there is more to see.
            let is_still = take.moving.is_none();
            let least = if is_still && last.is_some() { COARSE_MIN } else { 0.0 };
            let fresh = take.igi.fresh(smoother, least);
            let count = fresh.known.iter().filter(|known| **known).count();
            known = count as f32 / fresh.known.len().max(1) as f32;
            if count == 0 && last.is_none() {
                return None;
            }
            let fresh = if is_still { fresh.between(take.igi.setup().quality.interleave) } else { fresh };
            let steady =
                self.knobs.steady && take.moving.is_some() && last.is_some_and(|(_, edits)| *edits == take.edits);
            fresh.after(last.map(|(shown, _)| shown), steady)
        };
        let picture = match self.knobs.layer {
            Layer::Final => Some(shown.picture.clone()),
            layer => (frames > 0).then(|| take.igi.show(layer)),
        };
        // What is only filled from the last picture shows its edits, not ours.
        let edits = if known > 0.0 { take.edits } else { last.map_or(take.edits, |(_, edits)| *edits) };
        self.shown = Some((shown, edits));
        let pause = if frames < FIRST_FRAMES { BETWEEN_FIRST } else { BETWEEN_LATER };
        (take.shown_frames, take.next_show) = (Some(frames), now.after(pause, take.igi.setup()));
        // Other layers are not filled in: they wait for a whole frame.
        let (picture, layer) = (picture?, self.knobs.layer);
        self.layer_shown = (layer != Layer::Final).then(|| (layer, picture.clone()));
        let since = take.since.take_if(|_| known > 0.0 || edits == take.edits);
        self.number += 1;
        let setup = take.igi.setup();
        let wanted = if self.knobs.lights { &self.lights[..] } else { &[] };
        let lights = take.dots(wanted);
        let camera = Camera { width: self.camera.width, height: self.camera.height, ..setup.camera };
        Some(Frame {
            number: self.number,
            revision: take.revision,
            world: setup.world,
            camera,
            layer,
            lights,
            since,
            picture,
            moving: take.moving,
            ended,
            frames,
            known,
            finished: take.moving.is_none() && take.igi.is_finished(),
        })
    }
}

impl Take {
    fn want_lights(&mut self, actions: &mut Vec<Action>) {
        let (lights, questions) = Collection::new(self.first_ticket, self.igi.setup());
        self.open += questions.len();
        actions.push(Action::Ask(questions));
        self.lights = Some(lights);
    }

    /// Whether this was a question for them.
    fn learn_lights(&mut self, ticket: Ticket, body: Option<Body>) -> bool {
        let is_news = self.lights.as_mut().is_some_and(|lights| lights.take(ticket, body));
        self.open = self.open.saturating_sub(usize::from(is_news));
        is_news
    }

    fn dots(&self, lights: &[LightPoint]) -> Vec<Dot> {
        lights::dots(lights, &self.igi.setup().camera, |x, y| self.igi.probe(x, y).map(|probe| probe.distance))
    }

    /// There are still frames that no picture shows.
    fn is_unseen(&self) -> bool {
        self.moving.is_none() && self.igi.frames() > 0 && self.shown_frames != Some(self.igi.frames())
    }
}

/// Questions that may wait for workers: enough for some dozens of them.
const QUESTIONS_OPEN_MAX: usize = 1024;
/// A moving frame nothing of which has come is waited for so long, microseconds: an edit may take workers longer than
/// a frame, and if every frame were given up, none would ever come.
const PATIENCE: u64 = 3_000_000;
/// Share of the light sets of a rectangle that must have come before it takes the place of the last picture: three of
/// nine, which are as sharp as a moving picture, and have as little noise.
const COARSE_MIN: f32 = 0.25;
/// The first still frames change much, and are shown often.
const FIRST_FRAMES: u32 = 9;
/// Between pictures of still frames, microseconds, if they have so many pixels at most.
const BETWEEN_FIRST: u64 = 60_000;
const BETWEEN_LATER: u64 = 400_000;
const QUICK_PIXELS: u64 = 500_000;
/// Between still pictures, so many times as long as the last took to develop.
const REST: u64 = 3;
