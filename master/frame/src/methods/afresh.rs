//! People before a method that knows files only: every state is a new front end, which begins with nothing.
//!
//! **Idea.** A moving picture is the first frame of a smaller one; a still picture accumulates. As long as nothing of a
//! state is whole, the last picture stays. Several moving ones may be under way, where workers are far away.
//!
//! **When it is bad.** Always, beside a method that keeps what it knows: use it to have a method at all.

use std::collections::VecDeque;
use std::sync::Arc;

use protocol::question::{Asked, Rect, Ticket, WorldState};
use scenes::{Camera, Change};

use crate::Picture;
use crate::front_end::{
    Absorbed, Answered, Chosen, Effort, FrontEnd, GivenUp, Interactive, Layer, Method, Open, Plane, Probe, Settings,
    Shot, Turned, View,
};
use crate::metrics::Estimate;

/// See the module's documentation.
pub struct Afresh {
    chosen: Chosen,
    view: Option<View>,
    layer: Layer,
    parallelism: usize,
    next_ticket: u32,
    /// What is being drawn: a still picture, or moving ones, oldest first.
    takes: VecDeque<Take>,
    /// A moving take that has ended and was not shot yet.
    ended: Option<Take>,
    last: Option<(Plane, Arc<Picture>, WorldState)>,
}

/// One state that is being drawn.
struct Take {
    front: Box<dyn FrontEnd>,
    is_moving: bool,
    world: WorldState,
    /// [`Ticket::batch`] of what the front end calls batch 0.
    first_ticket: u32,
}

impl Afresh {
    /// Nothing to look at yet.
    pub fn new(method: &'static dyn Method, settings: &Settings, first_ticket: u32) -> Self {
        Self {
            chosen: Chosen { method, settings: settings.clone() },
            view: None,
            layer: Layer::FINAL,
            parallelism: 0,
            next_ticket: first_ticket,
            takes: VecDeque::new(),
            ended: None,
            last: None,
        }
    }

    fn front(&self) -> Option<&dyn FrontEnd> {
        self.takes.front().map(|take| &*take.front)
    }

    fn front_mut(&mut self) -> Option<&mut Box<dyn FrontEnd>> {
        self.takes.front_mut().map(|take| &mut take.front)
    }

    /// Whose question it was, and the ticket as its front end has given it.
    fn take_of(&mut self, ticket: Ticket) -> Option<(&mut Take, Ticket)> {
        self.takes.iter_mut().rev().find_map(|take| take.own(ticket).map(|own| (take, own)))
    }

    fn develop(&mut self, take: &mut Take) -> Option<Shot> {
        let (frames, plane, world) = (take.front.frames(), self.layer.plane, take.world);
        if frames > 0 {
            self.last = Some((plane, Arc::new(take.front.show(plane)), world));
        }
        let (last_plane, picture, last_world) = self.last.as_ref()?;
        let known = if frames > 0 { 1.0 } else { 0.0 };
        let picture = (*last_plane == plane).then(|| Arc::clone(picture));
        let is_current = *last_world == world;
        Some(Shot { picture, frames, known, is_current, marks: Vec::new() })
    }
}

impl Take {
    /// The ticket as the front end has given it; `None` if it has not.
    fn own(&self, ticket: Ticket) -> Option<Ticket> {
        let batch = ticket.batch.wrapping_sub(self.first_ticket);
        (batch < u32::MAX / 2).then_some(Ticket { batch, ..ticket })
    }
}

impl FrontEnd for Afresh {
    fn look(&mut self, view: &View, _changes: &[Change]) -> Open {
        self.view = Some(view.clone());
        Open::Unwanted
    }

    fn ask(&mut self, room: usize) -> Vec<Asked> {
        let mut questions = Vec::new();
        for take in &mut self.takes {
            for mut asked in take.front.ask(room.saturating_sub(questions.len())) {
                asked.ticket.batch = asked.ticket.batch.wrapping_add(take.first_ticket);
                if !take.is_moving {
                    self.next_ticket = self.next_ticket.max(asked.ticket.batch.wrapping_add(1));
                }
                questions.push(asked);
            }
        }
        questions
    }

    fn ask_again(&mut self) {
        self.takes.iter_mut().for_each(|take| take.front.ask_again());
    }

    fn begin_again(&mut self) {
        self.takes.clear();
        (self.ended, self.last) = (None, None);
    }

    fn absorb(&mut self, answered: Answered<'_>) -> Absorbed {
        let Some((take, ticket)) = self.take_of(answered.ticket) else { return Absorbed::Unwanted };
        take.front.absorb(Answered { ticket, ..answered })
    }

    fn set_parallelism(&mut self, questions: usize) {
        self.parallelism = questions;
        self.takes.iter_mut().for_each(|take| take.front.set_parallelism(questions));
    }

    fn set_limit(&mut self, frames: u32) {
        if let Some(take) = self.takes.front_mut().filter(|take| !take.is_moving) {
            take.front.set_limit(frames);
        }
    }

    fn finish(&mut self) {
        if let Some(front) = self.front_mut() {
            front.finish();
        }
    }

    fn is_finished(&self) -> bool {
        self.front().is_some_and(FrontEnd::is_finished)
    }

    fn frame_progress(&self) -> f32 {
        self.front().map_or(0.0, FrontEnd::frame_progress)
    }

    fn give_up(&mut self, ticket: Ticket) -> GivenUp {
        let Some((take, ticket)) = self.take_of(ticket) else { return GivenUp::Unwanted };
        take.front.give_up(ticket)
    }

    fn gaps(&self) -> Vec<Rect> {
        self.front().map_or(Vec::new(), FrontEnd::gaps)
    }

    fn show(&mut self, plane: Plane) -> Picture {
        self.front_mut().map_or(Picture::default(), |front| front.show(plane))
    }

    fn frames(&self) -> u32 {
        self.front().map_or(0, FrontEnd::frames)
    }

    fn error(&self) -> Option<Estimate> {
        self.front()?.error()
    }

    fn probe(&self, x: u32, y: u32) -> Option<Probe> {
        self.front()?.probe(x, y)
    }
}

impl Interactive for Afresh {
    fn begin(&mut self, moving: Option<Effort>) {
        let Some(view) = &self.view else { return };
        let mut view = view.clone();
        if let Some(effort) = moving {
            [view.camera.width, view.camera.height] = size(&view.camera, effort);
        }
        let mut front = self.chosen.begin(&view);
        front.set_parallelism(self.parallelism);
        let (is_moving, first_ticket) = (moving.is_some(), self.next_ticket);
        if is_moving {
            front.set_limit(1);
            // It has one batch, and the next may begin before it is asked.
            self.next_ticket = first_ticket.wrapping_add(1);
        }
        if !is_moving || self.takes.front().is_some_and(|take| !take.is_moving) {
            self.takes.clear();
        }
        self.takes.push_back(Take { front, is_moving, world: view.world, first_ticket });
    }

    fn end(&mut self) {
        self.ended = self.takes.pop_front();
    }

    fn flight_max(&self) -> usize {
        FLIGHT_MAX
    }

    fn whole(&self) -> Option<usize> {
        self.takes.iter().rposition(|take| take.front.frames() > 0)
    }

    fn overtake(&mut self) {
        self.takes.pop_front();
    }

    fn work(&self, camera: &Camera, effort: Effort) -> f64 {
        size(camera, effort).map(f64::from).iter().product()
    }

    fn turn(&mut self, settings: &Settings) -> Turned {
        let is_same = self.chosen.settings == *settings;
        self.chosen.settings = settings.clone();
        if is_same { Turned::Nothing } else { Turned::Drawn }
    }

    fn inspect(&mut self, layer: &Layer) {
        self.layer = *layer;
    }

    fn shot(&mut self, _smoother: Option<&dyn crate::parts::Smoother>) -> Option<Shot> {
        if let Some(mut ended) = self.ended.take() {
            return self.develop(&mut ended);
        }
        let mut take = self.takes.pop_front()?;
        let shot = self.develop(&mut take);
        self.takes.push_front(take);
        shot
    }

    fn next_ticket(&self) -> u32 {
        self.next_ticket
    }
}

/// Moving pictures that may be under way: at 30 a second, workers may be half a second away.
const FLIGHT_MAX: usize = 16;

fn size(camera: &Camera, Effort(share): Effort) -> [u32; 2] {
    let scale = share.clamp(0.0, 1.0).sqrt();
    [camera.width, camera.height].map(|side| ((side as f32 * scale).round() as u32).max(1))
}

#[cfg(test)]
mod tests {
    use protocol::answer::{Body, Cost, Fields, Moments};

    use super::*;
    use crate::methods::reference::REFERENCE;

    fn view(x: f32) -> View {
        let camera = Camera { origin: glam::Vec3::new(x, 0.0, 3.0), width: 40, height: 24, ..Camera::default() };
        let fields = Fields { emitted: true, surface: true };
        View { world: WorldState::default(), scene: Arc::default(), fields, camera, seed: 1 }
    }

    fn afresh() -> Afresh {
        Afresh::new(&REFERENCE, &Chosen::new(&REFERENCE).settings, 7)
    }

    /// As bright as the eye is far to the right.
    fn answer(front: &mut Afresh, asked: &Asked) -> Absorbed {
        let protocol::question::Ask::Reference(samples) = &asked.question.ask else { panic!("it asks for samples") };
        let mut moments = Moments::zero(samples.rect.len());
        moments.sum.fill(glam::DVec3::splat(f64::from(samples.camera.origin.x * samples.count as f32)));
        let (ticket, body) = (asked.ticket, Body::Moments(moments));
        front.absorb(Answered { ticket, body, worker: 0, cost: &Cost::default() })
    }

    #[test]
    fn every_state_begins_anew_and_hears_no_answer_to_another() {
        let mut front = afresh();
        front.look(&view(1.0), &[]);
        front.begin(Some(Effort(0.25)));
        let old = front.ask(100);
        assert!(old.iter().all(|asked| asked.ticket.batch >= 7));
        assert!(front.shot(None).is_none(), "nothing is known of anything");
        for asked in &old {
            answer(&mut front, asked);
        }
        front.end();
        front.look(&view(2.0), &[]);
        front.begin(None);
        let moving = front.shot(None).unwrap();
        let picture = moving.picture.unwrap();
        assert_eq!(([picture.width, picture.height], picture.pixels[0].x), ([20, 12], 1.0));
        assert_eq!((moving.frames, moving.known, moving.is_current), (1, 1.0, true));
        let new = front.ask(100);
        assert!(new.iter().all(|asked| old.iter().all(|old| old.ticket != asked.ticket)));
        assert_eq!(answer(&mut front, &old[0]), Absorbed::Unwanted);
        // As long as nothing of it is whole, the last picture stays.
        let still = front.shot(None).unwrap();
        assert_eq!((still.frames, still.known, still.picture.unwrap().pixels[0].x), (0, 0.0, 1.0));
    }

    #[test]
    fn what_was_forgotten_is_asked_again_and_what_is_known_stays() {
        let mut front = afresh();
        front.look(&view(3.0), &[]);
        front.begin(None);
        front.set_limit(2);
        let first = front.ask(100);
        let half = first.len() / 2;
        for asked in &first[..half] {
            answer(&mut front, asked);
        }
        front.ask_again();
        let again = front.ask(100);
        assert_eq!(again.len(), first.len() - half, "the others only");
        for asked in &again {
            answer(&mut front, asked);
        }
        assert!(front.is_finished());
        assert!(front.show(Plane::Final).pixels.iter().all(|pixel| pixel.x == 3.0));
    }
}
