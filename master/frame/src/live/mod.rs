//! The interactive loop: what people do comes in, questions and pictures go out.
//!
//! **Promise.** The newest input wins: no picture shows an older state than the one before it, and when
//! people stop, the picture sharpens to that of the last state, whatever came late, twice or never.
//! Nothing is ever black because it is not there yet.
//!
//! **Principles.**
//! * *One state a frame.* Inputs gather while a frame is drawn; the next takes them all.
//! * *Moving*: one picture a state, at an effort that holds the frame rate ([`pace`]). One that has not come in time is
//!   shown as far as the method has it. A method that keeps what it knows shows it at once, with all batches that have come
//!   by then ([`Interactive::stock`]); the next picture waits until its time has come, not for answers.
//! * *On the way*: where workers are far away, a moving picture begins while earlier ones are under way, each with its own
//!   camera ([`flight`]). They are shown in order; one that a newer overtakes is dropped.
//! * *Still*: when nothing is new, the same is drawn at full size, and frames accumulate. Only what
//!   changes the light begins again; filter, layer and tone do not.
//! * *Workers first.* The next questions go out before the last picture is developed.
//!
//! The loop decides when, and how much; the method ([`Interactive`]) decides what is asked, and how it looks. The loop
//! knows no method.
//!
//! It has no clock and no threads: events and times come in, actions go out, to be carried out in order.
//! Pictures are made in [`Live::picture`], so that who carries out chooses when.

pub mod edits;
mod event;
mod flight;
pub mod latency;
mod learning;
mod look;
pub mod pace;
pub mod pick;
pub mod walk;

#[cfg(test)]
mod tests;

use std::collections::{BTreeSet, VecDeque};
use std::sync::Arc;

use protocol::answer::Fields;
use protocol::question::{Ticket, WorldState};
use scenes::{Camera, Change, Scene};

use crate::Picture;
use crate::front_end::{Absorbed, Answered, Effort, GivenUp, Interactive, Layer, Open, Plane, Shot, Turned, View};
use crate::parts::Smoother;
pub use event::{Action, Ended, Event, Frame, Knobs, Making, Moment, Step};
use pace::Pace;

/// The interactive loop: see the module's documentation.
pub struct Live {
    front: Box<dyn Interactive>,
    knobs: Knobs,
    camera: Camera,
    /// The scene is given away while a change of it is published, so that nobody has to copy it.
    world: Option<(WorldState, Fields, Option<Arc<Scene>>)>,
    /// Not published yet; later ones supersede earlier ones.
    changes: Vec<Change>,
    /// Published, and not looked at yet.
    published: Vec<Change>,
    /// [`Event::Published`] is awaited.
    publishing: bool,
    /// Since the oldest input that no picture has begun with.
    news: Option<Moment>,
    /// Inputs so far.
    revision: u64,
    take: Option<Take>,
    /// Moving takes that were begun while `take` was under way, oldest first.
    behind: VecDeque<Take>,
    /// A moving take that was drawn, or given up, but not developed.
    taken: Option<Take>,
    /// Questions without an answer.
    open: BTreeSet<Ticket>,
    /// The last picture, and its layer.
    shown: Option<(Layer, Arc<Picture>)>,
    pace: Pace,
    /// When a moving picture was last begun.
    last_began: Moment,
    /// When something was last learnt from one that had ended, and the work of those that have ended since.
    learnt: Moment,
    unlearnt: f64,
    /// To the nearest workers and back, microseconds.
    round_trip: u64,
    /// Questions that can be answered at a time.
    parallelism: usize,
    /// The moving picture that has ended last, until somebody asks.
    ended: Option<Ended>,
    number: u64,
    smoother: Option<Box<dyn Smoother>>,
    watched: bool,
    /// See [`Event::Held`].
    held: bool,
    /// When the last picture was begun to be developed; nothing has happened since.
    developing: Option<Moment>,
    /// There is news, and what the next picture should be made of has not come.
    is_short: bool,
    /// When the batches were asked that are in no moving picture yet, oldest first; when the last was answered.
    batches_asked: VecDeque<Moment>,
    batch_answered: Moment,
}

/// One state of everything that is being drawn.
#[derive(Clone, Copy)]
struct Take {
    world: WorldState,
    camera: Camera,
    revision: u64,
    moving: Option<Effort>,
    /// It was made at once, and has ended: its time is not yet over.
    at_once: bool,
    began: Moment,
    /// When what has come is shown; `None`: not before a frame is complete.
    deadline: Option<Moment>,
    /// The oldest input that has not been seen in a picture.
    since: Option<Moment>,
    /// [`Ticket::batch`] of its questions is this or a later one, and before that of the take after it.
    first_ticket: u32,
    /// Complete frames in the last picture, and the earliest time of the next.
    shown_frames: Option<u32>,
    next_show: Moment,
}

impl Live {
    /// Waits for the first [`Event::Published`].
    pub fn new(camera: Camera, knobs: Knobs) -> Self {
        let mut front = knobs.method.interactive(0);
        front.inspect(&knobs.layer);
        Self {
            pace: Pace::new(knobs.rate.max(front.rate_min()), pixels(&camera), |effort| front.work(&camera, effort)),
            front,
            knobs,
            camera,
            world: None,
            changes: Vec::new(),
            published: Vec::new(),
            publishing: true,
            news: None,
            revision: 0,
            take: None,
            behind: VecDeque::new(),
            taken: None,
            open: BTreeSet::new(),
            shown: None,
            last_began: Moment(0),
            learnt: Moment(0),
            unlearnt: 0.0,
            round_trip: 0,
            parallelism: 0,
            ended: None,
            number: 0,
            smoother: None,
            watched: true,
            held: false,
            developing: None,
            is_short: false,
            batches_asked: VecDeque::new(),
            batch_answered: Moment(0),
        }
    }

    /// Has pictures smoothed elsewhere from now on, as far as they are for eyes only.
    pub fn smooth_by(&mut self, smoother: Box<dyn Smoother>) {
        self.smoother = Some(smoother);
    }

    /// How long a question takes to the nearest workers and back, microseconds: no choice of what to draw makes it
    /// shorter.
    pub fn set_round_trip(&mut self, micros: u64) {
        self.round_trip = micros;
    }

    /// So many questions can be answered at a time: with many, more still frames are in flight at once.
    pub fn set_parallelism(&mut self, questions: usize) {
        self.parallelism = questions;
        self.front.set_parallelism(questions);
    }

    /// The moving picture that has ended since this was asked last, if one has. They end one by one, each followed by
    /// [`Action::Show`].
    pub fn ended(&mut self) -> Option<Ended> {
        self.ended.take()
    }

    /// Takes an event in, gives actions out; they are to be carried out in order.
    pub fn handle(&mut self, event: Event, now: Moment) -> Vec<Action> {
        let mut actions = Vec::new();
        self.note_developed(now);
        match event {
            Event::Look(camera) if camera == self.camera => {}
            Event::Look(camera) => {
                if [camera.width, camera.height] != [self.camera.width, self.camera.height] {
                    self.pace.resize(pixels(&camera), |effort| self.front.work(&camera, effort));
                }
                self.camera = camera;
                self.note(now, &mut actions);
            }
            Event::Edit(changes) => {
                for change in changes {
                    self.changes.retain(|earlier| !change.supersedes(earlier));
                    self.changes.push(change);
                }
                self.note(now, &mut actions);
            }
            Event::Turn(knobs) => self.turn(knobs, now, &mut actions),
            Event::Published { world, scene, fields } => {
                self.world = Some((world, fields, Some(scene)));
                self.publishing = false;
                match self.is_waiting() {
                    true => self.begin_behind(now, &mut actions),
                    false => self.begin(now, &mut actions),
                }
            }
            Event::Answered { ticket, body, worker, cost } => {
                self.absorb(Answered { ticket, body, worker, cost: &cost }, now, &mut actions);
            }
            Event::Unanswered(ticket) => self.give_up(ticket, now, &mut actions),
            Event::Distrusted => {
                self.front.begin_again();
                self.drop_take(&mut actions);
                self.draw_otherwise(now, &mut actions);
            }
            Event::Watched(watched) => self.watched = watched,
            Event::Held(held) => self.hold(held, now, &mut actions),
            Event::Replayed(Step::Began) => self.begin_behind(now, &mut actions),
            Event::Replayed(Step::Overtaken) => self.overtake(&mut actions),
            Event::Woke => {}
        }
        self.look_at_the_clock(now, &mut actions);
        self.pause(&mut actions);
        self.ask(&mut actions);
        actions
    }

    /// When [`Event::Woke`] should come at the latest.
    pub fn wake_at(&self) -> Option<Moment> {
        if self.held {
            return None;
        }
        if self.is_short && self.knobs.making == Making::InTime {
            return Some(Moment(0));
        }
        let take = self.take.as_ref()?;
        let unseen = self.is_unseen(take).then_some(take.next_show);
        take.deadline.into_iter().chain(unseen).chain(self.flies_at()).chain(self.lands_at()).min()
    }

    /// Develops what [`Action::Show`] announced; `None` if nothing has ever been drawn.
    pub fn picture(&mut self, now: Moment) -> Option<Frame> {
        self.developing = Some(now);
        let is_ended = self.taken.is_some();
        let mut take = self.taken.take().or_else(|| self.take.take())?;
        let is_finished = take.moving.is_none() && self.front.is_finished();
        let shot = self.front.shot(self.smoother.as_deref());
        if shot.is_none() {
            // There is nothing more to see yet, and it is soon looked again.
            take.deadline = take.deadline.map(|_| Moment(now.0 + self.pace.target()));
        }
        let frame = shot.and_then(|shot| self.frame(shot, &mut take, [is_ended, is_finished], now));
        if !is_ended {
            self.take = Some(take);
        }
        frame
    }

    /// The last picture is developed. However long that takes, answers have most of the time: the next still one waits.
    fn note_developed(&mut self, now: Moment) {
        let Some(began) = self.developing.take() else { return };
        let Some(take) = &mut self.take else { return };
        if take.at_once {
            // Half of the time is for answers, however long pictures take.
            let rested = Moment(now.0 + now.0.saturating_sub(began.0));
            take.deadline = take.deadline.map(|deadline| deadline.max(rested));
        }
        if take.moving.is_some() {
            return;
        }
        let rested = Moment(now.0 + REST * now.0.saturating_sub(began.0));
        take.deadline = take.deadline.map(|deadline| deadline.max(rested));
        take.next_show = take.next_show.max(rested);
    }

    /// Something is new.
    fn note(&mut self, now: Moment, actions: &mut Vec<Action>) {
        self.revision += 1;
        self.news.get_or_insert(now);
        // A moving frame is finished first: pictures keep coming however fast inputs do.
        if !self.is_moving() {
            self.begin(now, actions);
        }
    }

    fn turn(&mut self, knobs: Knobs, now: Moment, actions: &mut Vec<Action>) {
        let is_still = self.is_still();
        let old = std::mem::replace(&mut self.knobs, knobs);
        let knobs = &self.knobs;
        self.pace.aim(knobs.rate.max(self.front.rate_min()));
        let has_layer = old.layer != knobs.layer;
        if has_layer {
            self.front.inspect(&knobs.layer);
        }
        let turned = if old.method.method.name() == knobs.method.method.name() {
            self.front.turn(&knobs.method.settings)
        } else {
            self.front = knobs.method.interactive(self.front.next_ticket());
            self.front.inspect(&knobs.layer);
            self.front.set_parallelism(self.parallelism);
            let (front, camera) = (&self.front, self.camera);
            let rate = knobs.rate.max(front.rate_min());
            self.pace = Pace::new(rate, pixels(&camera), |effort| front.work(&camera, effort));
            self.drop_take(actions);
            Turned::Drawn
        };
        // What falls on surfaces is asked for by itself.
        let [was, is] = [&old, &self.knobs].map(|knobs| knobs.layer.plane == Plane::Illuminance);
        if turned == Turned::Drawn || was != is || old.seed != self.knobs.seed {
            return self.draw_otherwise(now, actions);
        }
        if is_still {
            self.front.set_limit(self.limit());
            if has_layer || turned == Turned::Shown {
                actions.push(Action::Show);
            }
        }
    }

    /// Gives the workers away, or draws again: what was begun is begun anew.
    fn hold(&mut self, held: bool, now: Moment, actions: &mut Vec<Action>) {
        if std::mem::replace(&mut self.held, held) == held {
            return;
        }
        self.drop_take(actions);
        if !held {
            self.front.ask_again();
            self.begin(now, actions);
        }
    }

    /// What is being drawn is drawn by nobody any more.
    fn drop_take(&mut self, actions: &mut Vec<Action>) {
        self.taken = None;
        self.behind.clear();
        self.batches_asked.clear();
        if let Some(take) = self.take.as_mut() {
            (take.moving, take.at_once) = (None, false);
        }
        self.forget_all(actions);
    }

    fn forget_all(&mut self, actions: &mut Vec<Action>) {
        if !self.open.is_empty() {
            self.open.clear();
            actions.push(Action::Forget);
        }
    }

    /// The same state, drawn otherwise: not moving, but from the beginning.
    fn draw_otherwise(&mut self, now: Moment, actions: &mut Vec<Action>) {
        self.revision += 1;
        if !self.is_moving() {
            let since = self.take.as_ref().and_then(|take| take.since).unwrap_or(now);
            self.begin(now, actions);
            if let Some(take) = &mut self.take {
                take.since.get_or_insert(since);
            }
        }
    }

    /// Frames of the still picture.
    fn limit(&self) -> u32 {
        self.knobs.making.still().unwrap_or(self.knobs.rest_after.max(1))
    }

    /// Batches of a moving picture that is made at once; `None` if the next waits for its own.
    fn batches_at_once(&self) -> Option<u32> {
        let stock = self.front.stock().filter(|_| self.news.is_some())?;
        match self.knobs.making {
            Making::Of { batches, .. } => Some(batches.min(stock.open)),
            Making::InTime | Making::Held { .. } => Some(stock.whole),
        }
    }

    /// What the next moving picture should be made of has not come yet.
    fn is_short_of_batches(&self) -> bool {
        let Some(still) = self.knobs.making.still().filter(|_| self.news.is_some()) else { return false };
        let stock = self.front.stock();
        if let Making::Held { .. } = self.knobs.making {
            return stock.is_some() || still > 0;
        }
        let is_still_short = self.is_still() && self.front.frames() < still && !self.front.is_finished();
        let whole = stock.map_or(u32::MAX, |stock| stock.whole);
        is_still_short || self.batches_at_once().is_some_and(|batches| whole < batches)
    }

    /// Begins with the newest state: a moving picture if there is news, else a still one.
    fn begin(&mut self, now: Moment, actions: &mut Vec<Action>) {
        if self.publishing || self.held {
            return;
        }
        self.is_short = self.is_short_of_batches();
        if self.is_short {
            return;
        }
        let at_once = self.batches_at_once();
        if at_once.is_some() && self.taken.is_some() {
            // One picture after the other: it is soon tried again.
            self.is_short = true;
            return;
        }
        let still = self.front.stock().map_or(0, |stock| stock.still);
        self.take = None;
        if !self.changes.is_empty() {
            self.open.clear();
            self.publish(false, actions);
            return;
        }
        let Some((world, fields, Some(scene))) = &self.world else { return };
        let (world, fields, camera, seed) = (*world, *fields, self.camera, self.knobs.seed);
        let view = View { world, scene: Arc::clone(scene), fields, camera, seed };
        if let Some(batches) = at_once {
            self.front.take_in(batches);
        }
        if self.front.look(&view, &std::mem::take(&mut self.published)) == Open::Unwanted {
            self.forget_all(actions);
        }
        let since = self.news.take();
        let moving = since.map(|_| self.effort());
        let unanswered = self.unanswered();
        let take = self.begin_take(&view, moving, since, now);
        if moving.is_none() {
            self.front.set_limit(self.limit());
        }
        self.take = Some(take);
        if let (Some(batches), Some(effort)) = (at_once, moving) {
            self.note_asked(unanswered, now);
            self.end_at_once(take, Ended { effort, batches, still }, actions);
        }
    }

    fn publish(&mut self, behind: bool, actions: &mut Vec<Action>) {
        self.publishing = true;
        let changes = std::mem::take(&mut self.changes);
        self.published.extend(changes.iter().cloned());
        if let Some((_, _, scene)) = &mut self.world {
            *scene = None;
        }
        actions.push(Action::Publish { changes, behind });
    }

    /// The method begins with a picture of what it looks at.
    fn begin_take(&mut self, view: &View, moving: Option<Effort>, since: Option<Moment>, now: Moment) -> Take {
        let first_ticket = self.front.next_ticket();
        self.front.begin(moving);
        self.last_began = if moving.is_some() { now } else { self.last_began };
        Take {
            world: view.world,
            camera: view.camera,
            revision: self.revision,
            moving,
            at_once: false,
            began: now,
            deadline: Some(self.pace.deadline(now, self.round_trip)),
            since,
            first_ticket,
            shown_frames: None,
            next_show: now,
        }
    }

    /// The picture is made of what there is: it is shown, and its time goes on.
    fn end_at_once(&mut self, take: Take, ended: Ended, actions: &mut Vec<Action>) {
        self.front.end();
        self.ask(actions);
        let period = if self.knobs.making == Making::InTime { self.pace.target() } else { 0 };
        let deadline = Some(Moment(take.began.0 + period));
        self.take = Some(Take { at_once: true, deadline, since: None, ..take });
        (self.taken, self.ended) = (Some(take), Some(ended));
        actions.push(Action::Show);
    }

    fn absorb(&mut self, answered: Answered<'_>, now: Moment, actions: &mut Vec<Action>) {
        let unanswered = self.unanswered();
        self.open.remove(&answered.ticket);
        let absorbed = self.front.absorb(answered);
        if absorbed == Absorbed::Unwanted {
            return;
        }
        self.note_answered(unanswered.saturating_sub(self.unanswered()), now);
        let Some(take) = &mut self.take else { return };
        match absorbed {
            Absorbed::Kept | Absorbed::Unwanted => {}
            Absorbed::Completed { .. } if take.moving.is_some() => self.end_whole(now, actions),
            Absorbed::Completed { .. } => take.deadline = None,
            Absorbed::Marked => self.show_marks(actions),
        }
    }

    /// Workers die of a question: what hangs on it is given up, the rest goes on.
    fn give_up(&mut self, ticket: Ticket, now: Moment, actions: &mut Vec<Action>) {
        let Some(take) = self.take else { return };
        self.open.remove(&ticket);
        let is_past = |world: WorldState| self.world.as_ref().is_some_and(|(current, ..)| *current != world);
        if is_past(self.asked_for(ticket).unwrap_or(&take).world) {
            // Workers have gone on to another revision: it is shown as far as it comes, if nothing overtakes it.
            return;
        }
        let given_up = self.front.give_up(ticket);
        if given_up == GivenUp::Unwanted {
            return;
        }
        if given_up == GivenUp::Other {
            return self.show_marks(actions);
        }
        if take.at_once {
            return;
        }
        if take.moving.is_some() && self.front.whole().is_some() {
            return self.end_whole(now, actions);
        }
        actions.push(Action::Show);
    }

    fn show_marks(&self, actions: &mut Vec<Action>) {
        if self.is_still() && self.front.frames() > 0 {
            actions.push(Action::Show);
        }
    }

    /// The moving picture has come, or as much of it as will: on to the next, then show it.
    fn finish_moving(&mut self, done: f32, now: Moment, actions: &mut Vec<Action>) {
        let Some(take) = self.take.take() else { return };
        self.learn_of(&take, done, now);
        let batches = self.front.frames().max(1);
        self.ended = take.moving.map(|effort| Ended { effort, batches, still: 0 });
        self.front.end();
        self.taken = Some(take);
        match self.behind.pop_front() {
            Some(next) => self.go_on_with(next, now, actions),
            None => {
                self.forget_all(actions);
                self.begin(now, actions);
            }
        }
        self.ask(actions);
        actions.push(Action::Show);
    }

    fn look_at_the_clock(&mut self, now: Moment, actions: &mut Vec<Action>) {
        if self.held {
            return;
        }
        if self.is_short || self.take.is_some_and(|take| take.at_once && take.deadline.is_some_and(|at| at <= now)) {
            return self.begin(now, actions);
        }
        self.end_whole(now, actions);
        self.begin_behind_if_due(now, actions);
        // One picture after the other.
        let has_landed = self.taken.is_some();
        let Some(take) = self.take.as_mut().filter(|take| !take.at_once) else { return };
        if !has_landed && take.deadline.is_some_and(|deadline| deadline <= now) {
            let done = self.front.frame_progress();
            let is_late = now.0 >= take.began.0 + PATIENCE;
            let is_newer_wanted = self.news.is_some() || !self.behind.is_empty();
            if take.moving.is_some() && (done > 0.0 || (is_late && is_newer_wanted)) {
                return self.finish_moving(done, now, actions);
            }
            // A still frame is shown as far as it has come, again and again; a moving one of which
            // nothing has come as far as the last picture tells.
            take.deadline = Some(now.after(2 * self.pace.target(), take.pixels()));
            if done > 0.0 || take.since.is_some() {
                actions.push(Action::Show);
            }
        } else if let Some(take) = &self.take
            && self.is_unseen(take)
            && take.next_show <= now
        {
            actions.push(Action::Show);
        }
    }

    /// There are still frames that no picture shows.
    fn is_unseen(&self, take: &Take) -> bool {
        let frames = self.front.frames();
        take.moving.is_none() && frames > 0 && take.shown_frames != Some(frames)
    }

    /// Drawing may pause: nobody looks, and whoever looks next has a whole picture to begin with.
    fn may_pause(&self) -> bool {
        !self.watched && self.is_still() && self.front.frames() > 0
    }

    /// Lets workers rest while nobody looks. What they had in hand is asked again later, so nothing of the picture
    /// depends on it.
    fn pause(&mut self, actions: &mut Vec<Action>) {
        if !self.may_pause() {
            return;
        }
        if !self.open.is_empty() {
            self.front.ask_again();
            self.forget_all(actions);
        }
    }

    fn ask(&mut self, actions: &mut Vec<Action>) {
        if self.may_pause() {
            return;
        }
        if self.take.is_none() || self.publishing || self.held {
            return;
        }
        let questions = self.front.ask(QUESTIONS_OPEN_MAX.saturating_sub(self.open.len()));
        if !questions.is_empty() {
            self.open.extend(questions.iter().map(|asked| asked.ticket));
            actions.push(Action::Ask(questions));
        }
    }

    fn frame(&mut self, shot: Shot, take: &mut Take, [ended, finished]: [bool; 2], now: Moment) -> Option<Frame> {
        let Shot { picture, frames, known, is_current, marks, .. } = shot;
        let pause = if frames < FIRST_FRAMES { BETWEEN_FIRST } else { BETWEEN_LATER };
        (take.shown_frames, take.next_show) = (Some(frames), now.after(pause, take.pixels()));
        let (picture, layer) = (picture?, self.knobs.layer);
        self.shown = Some((layer, Arc::clone(&picture)));
        let since = take.since.take_if(|_| is_current);
        self.number += 1;
        let camera = Camera { width: self.camera.width, height: self.camera.height, ..take.camera };
        Some(Frame {
            number: self.number,
            revision: take.revision,
            world: take.world,
            camera,
            layer,
            marks,
            since,
            picture,
            moving: take.moving,
            ended,
            frames,
            known,
            finished,
        })
    }
}

impl Take {
    /// Pixels that are drawn, about.
    fn pixels(&self) -> u64 {
        (pixels(&self.camera) * f64::from(self.moving.map_or(1.0, |Effort(share)| share))) as u64
    }
}

fn pixels(camera: &Camera) -> f64 {
    f64::from(camera.width) * f64::from(camera.height)
}

/// Questions that may wait for workers: enough for some dozens of them.
const QUESTIONS_OPEN_MAX: usize = 1024;
/// A moving picture nothing of which has come is waited for so long, microseconds: an edit may take workers longer than
/// a frame, and if every frame were given up, none would ever come.
const PATIENCE: u64 = 3_000_000;
/// The first still frames change much, and are shown often.
const FIRST_FRAMES: u32 = 9;
/// Between pictures of still frames, microseconds, if they have so many pixels at most.
const BETWEEN_FIRST: u64 = 60_000;
const BETWEEN_LATER: u64 = 400_000;
const QUICK_PIXELS: u64 = 500_000;
/// Between still pictures, so many times as long as the last took to develop.
const REST: u64 = 3;
