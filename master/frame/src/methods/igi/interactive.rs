//! IGI with people before it.
//!
//! *Moving*: one frame of each state, smaller and with fewer lights than a still one. Each has light sets of its own, so
//! that what is seen again becomes the mean over many: as right as a still picture, and noisier (`--fixed-sets`: the same
//! sets in all, which do not flicker, and stand for too few lamps). What has not come in time is filled from the last picture
//! as seen from the new place ([`crate::parts::reproject`]). *Still*: the picture is drawn at full size, and frames accumulate; the first grows from
//! coarse to fine. Every state begins with nothing: an [`Igi`] of its own. Several moving ones may be under way at a time.

use std::collections::VecDeque;
use std::sync::Arc;

use protocol::answer::{Body, LightPoint};
use protocol::question::{Asked, Motion, PHOTONS_MAX, Quality, Rect, Ticket, WorldState};
use scenes::{Camera, Change};

use super::lights::{self, Collection};
use super::{Igi, Setup, filter, quality};
use crate::Picture;
use crate::front_end::{
    Absorbed, Answered, Effort, FrontEnd, GivenUp, Interactive, Layer, Mark, Open, Plane, Probe, Settings, Shot,
    Turned, View,
};
use crate::metrics::Estimate;
use crate::parts::Smoother;
use crate::parts::reproject::{AGE_MAX, Shown, Steady};

/// See the module's documentation.
pub(super) struct InteractiveIgi {
    settings: Settings,
    /// A still picture of what is looked at. The scene is not held: whoever edits it would have to copy it.
    still: Option<Setup>,
    layer: Layer,
    parallelism: usize,
    /// The number from which on no ticket was given.
    next_ticket: u32,
    /// What is being drawn: a still picture, or moving ones, oldest first.
    takes: VecDeque<Take>,
    /// A moving take that has ended and was not shot yet.
    ended: Option<Take>,
    /// Those before: their memory serves the next.
    spare: Vec<Igi>,
    /// The last picture, and the world that it shows at least in part.
    shown: Option<(Shown, WorldState)>,
    /// The virtual lights that were last known as a whole.
    lights: Vec<LightPoint>,
    /// Moving pictures so far, but for those under way.
    moved: u32,
}

/// One state that is being drawn.
struct Take {
    igi: Igi,
    is_moving: bool,
    /// Number of the batch of questions for its virtual lights; its other batches follow.
    first_ticket: u32,
    /// Its virtual lights, if they are wanted; asked for when it is asked for the first time.
    lights: Option<Collection>,
}

impl InteractiveIgi {
    /// Nothing to look at yet.
    pub(super) fn new(settings: &Settings, first_ticket: u32) -> Self {
        Self {
            settings: settings.clone(),
            still: None,
            layer: Layer::FINAL,
            parallelism: 0,
            next_ticket: first_ticket,
            takes: VecDeque::new(),
            ended: None,
            spare: Vec::new(),
            shown: None,
            lights: Vec::new(),
            moved: 0,
        }
    }

    /// How a picture goes on from the last: a moving one, or one that shows the same world.
    fn steady(&self, is_moving: bool, has_only_looked: bool) -> Steady {
        match (self.settings.is_on("steady") && is_moving, has_only_looked, self.settings.is_on("fixed-sets")) {
            (true, true, false) => Steady::Mean,
            (true, true, true) | (true, false, false) => Steady::Clamped,
            (false, ..) | (true, false, true) => Steady::Off,
        }
    }

    fn igi(&self) -> Option<&Igi> {
        self.takes.front().map(|take| &take.igi)
    }

    /// Whose question it was.
    fn take_of(&mut self, ticket: Ticket) -> Option<&mut Take> {
        self.takes.iter_mut().rev().find(|take| ticket.batch.wrapping_sub(take.first_ticket) < u32::MAX / 2)
    }

    /// An answer about virtual lights is taken, or there will be none: whether it was asked for, and whether all are known
    /// by now, which are those that are shown then.
    fn take_lights(&mut self, ticket: Ticket, body: impl FnOnce() -> Option<Body>) -> Option<bool> {
        let lights = self.take_of(ticket)?.lights.as_mut().filter(|lights| lights.waits_for(ticket))?;
        lights.take(ticket, body());
        let whole = lights.whole();
        let is_whole = whole.is_some();
        self.lights = whole.unwrap_or_else(|| std::mem::take(&mut self.lights));
        Some(is_whole)
    }

    fn develop(&mut self, take: &mut Take, smoother: Option<&dyn Smoother>) -> Option<Shot> {
        let last = self.shown.as_ref();
        let world = take.igi.setup().world;
        let frames = take.igi.frames();
        let mut known = 1.0;
        let shown = if frames > 0 && !take.is_moving {
            let mut shown = take.igi.shown(smoother);
            if !self.settings.is_on("fixed-sets") {
                // What moves next goes on with the mean of these frames.
                shown.age.fill((frames as f32).min(AGE_MAX));
            }
            shown
        } else {
            // The first still frame grows from coarse to fine; the last picture, which is of the same state, stays
            // until there is more to see.
            let is_better_awaited = !take.is_moving && last.is_some();
            let least = if is_better_awaited { COARSE_MIN } else { 0.0 };
            if is_better_awaited && take.igi.share_come(least) < COME_MIN {
                return None;
            }
            let fresh = take.igi.fresh(smoother, least);
            let count = fresh.known.iter().filter(|known| **known).count();
            known = count as f32 / fresh.known.len().max(1) as f32;
            if count == 0 && last.is_none() {
                return None;
            }
            let fresh = if take.is_moving { fresh } else { fresh.between(take.igi.setup().quality.interleave) };
            let only_looked = last.is_some_and(|(_, shown)| *shown == world);
            let steady = self.steady(take.is_moving, only_looked);
            fresh.after(last.map(|(shown, _)| shown), steady)
        };
        let picture = match self.layer.plane {
            Plane::Final => Some(Arc::clone(&shown.picture)),
            // Other layers are not filled in: they wait for a whole frame.
            plane => (frames > 0).then(|| Arc::new(take.igi.show(plane))),
        };
        // What is only filled from the last picture shows its world, not ours.
        let shown_world = if known > 0.0 { world } else { last.map_or(world, |(_, shown)| *shown) };
        self.shown = Some((shown, shown_world));
        let marks = if self.layer.marks { take.marks(&self.lights) } else { Vec::new() };
        let is_current = shown_world == world;
        Some(Shot { picture, frames, known, is_current, marks })
    }
}

impl FrontEnd for InteractiveIgi {
    fn look(&mut self, view: &View, _changes: &[Change]) -> Open {
        self.still = Some(Setup::of(&self.settings, view));
        Open::Unwanted
    }

    fn begin_again(&mut self) {
        let new = Self::new(&self.settings, self.next_ticket);
        *self = Self { still: self.still.take(), layer: self.layer, parallelism: self.parallelism, ..new };
    }

    fn ask(&mut self, room: usize) -> Vec<Asked> {
        let mut questions = Vec::new();
        for take in &mut self.takes {
            if self.layer.marks && take.lights.is_none() {
                let (lights, asked) = Collection::new(take.first_ticket, take.igi.setup());
                take.lights = Some(lights);
                questions.extend(asked);
            }
            questions.extend(take.igi.ask(room.saturating_sub(questions.len())));
            if !take.is_moving {
                self.next_ticket = take.igi.next_ticket();
            }
        }
        questions
    }

    fn ask_again(&mut self) {
        for take in &mut self.takes {
            take.igi.ask_again();
            take.lights = take.lights.take().filter(|lights| lights.whole().is_some());
        }
    }

    fn absorb(&mut self, answered: Answered<'_>) -> Absorbed {
        let Answered { ticket, body, worker, cost } = answered;
        let mut body = Some(body);
        match self.take_lights(ticket, || body.take()) {
            Some(true) => return Absorbed::Marked,
            Some(false) => return Absorbed::Kept,
            None => {}
        }
        match (self.take_of(ticket), body) {
            (Some(take), Some(body)) => take.igi.absorb(Answered { ticket, body, worker, cost }),
            _ => Absorbed::Unwanted,
        }
    }

    fn set_parallelism(&mut self, questions: usize) {
        self.parallelism = questions;
        self.takes.iter_mut().for_each(|take| take.igi.set_parallelism(questions));
    }

    fn set_limit(&mut self, frames: u32) {
        if let Some(take) = self.takes.front_mut().filter(|take| !take.is_moving) {
            take.igi.set_limit(frames);
        }
    }

    fn finish(&mut self) {
        if let Some(take) = self.takes.front_mut() {
            take.igi.finish();
        }
    }

    fn is_finished(&self) -> bool {
        self.igi().is_some_and(Igi::is_finished)
    }

    fn frame_progress(&self) -> f32 {
        self.igi().map_or(0.0, Igi::frame_progress)
    }

    fn give_up(&mut self, ticket: Ticket) -> GivenUp {
        if self.take_lights(ticket, || None).is_some() {
            return GivenUp::Other;
        }
        self.take_of(ticket).map_or(GivenUp::Unwanted, |take| take.igi.give_up(ticket))
    }

    fn gaps(&self) -> Vec<Rect> {
        self.igi().map_or(Vec::new(), Igi::gaps)
    }

    fn show(&mut self, plane: Plane) -> Picture {
        self.takes.front_mut().map_or(Picture::default(), |take| take.igi.show(plane))
    }

    fn frames(&self) -> u32 {
        self.igi().map_or(0, Igi::frames)
    }

    fn error(&self) -> Option<Estimate> {
        self.igi()?.error()
    }

    fn probe(&self, x: u32, y: u32) -> Option<Probe> {
        self.igi()?.probe(x, y)
    }
}

impl Interactive for InteractiveIgi {
    fn begin(&mut self, moving: Option<Effort>) {
        let Some(still) = &self.still else { return };
        let illuminance = self.layer.plane == Plane::Illuminance;
        let (quality, filter) = (Quality { illuminance, ..quality(&self.settings) }, filter(&self.settings));
        let mut setup = Setup { quality, filter, ..still.clone() };
        if let Some(effort) = moving {
            [setup.camera.width, setup.camera.height] = size(&still.camera, effort);
            setup.quality = moving_quality(&setup.quality, effort);
        }
        if moving.is_none() || self.takes.front().is_some_and(|take| !take.is_moving) {
            self.takes.clear();
        }
        if moving.is_some() && !self.settings.is_on("fixed-sets") {
            setup.seed = seed_of(setup.seed, self.moved.wrapping_add(self.takes.len() as u32));
        }
        // The first number is for its virtual lights; a moving picture has one frame, and the next may begin before it is asked.
        let first_ticket = self.next_ticket;
        let of_frames = first_ticket.wrapping_add(1);
        self.next_ticket = of_frames.wrapping_add(u32::from(moving.is_some()));
        let mut igi = match self.spare.pop().filter(|_| moving.is_some()) {
            Some(spare) => spare.again_from(of_frames, setup),
            None => Igi::numbered_from(of_frames, setup),
        };
        igi.set_parallelism(self.parallelism);
        if moving.is_some() {
            igi.set_limit(1);
        }
        self.takes.push_back(Take { igi, is_moving: moving.is_some(), first_ticket, lights: None });
    }

    fn end(&mut self) {
        self.ended = self.takes.pop_front();
        let has_moved = self.ended.as_ref().is_some_and(|take| take.is_moving);
        self.moved = self.moved.wrapping_add(u32::from(has_moved));
    }

    fn flight_max(&self) -> usize {
        FLIGHT_MAX
    }

    fn whole(&self) -> Option<usize> {
        self.takes.iter().rposition(|take| take.igi.frames() > 0)
    }

    fn overtake(&mut self) {
        if let Some(take) = self.takes.pop_front() {
            self.moved = self.moved.wrapping_add(u32::from(take.is_moving));
            self.spare.push(take.igi);
        }
    }

    fn work(&self, camera: &Camera, effort: Effort) -> f64 {
        let [width, height] = size(camera, effort).map(f64::from);
        let quality = moving_quality(&quality(&self.settings), effort);
        width * height * (EYE_WORK + f64::from(quality.light_samples) + f64::from(quality.vpls))
    }

    fn turn(&mut self, settings: &Settings) -> Turned {
        let old = std::mem::replace(&mut self.settings, settings.clone());
        if quality(&old) != quality(settings) {
            return Turned::Drawn;
        }
        self.takes.iter_mut().for_each(|take| take.igi.set_filter(filter(settings)));
        if filter(&old) == filter(settings) { Turned::Nothing } else { Turned::Shown }
    }

    fn inspect(&mut self, layer: &Layer) {
        if (self.layer.plane == Plane::Illuminance) != (layer.plane == Plane::Illuminance) {
            // One was of white things.
            self.shown = None;
        }
        self.layer = *layer;
    }

    fn shot(&mut self, smoother: Option<&dyn Smoother>) -> Option<Shot> {
        if let Some(mut ended) = self.ended.take() {
            let shot = self.develop(&mut ended, smoother);
            self.spare.push(ended.igi);
            return shot;
        }
        let mut take = self.takes.pop_front()?;
        let shot = self.develop(&mut take, smoother);
        self.takes.push_front(take);
        shot
    }

    fn shown(&self) -> Option<&Shown> {
        self.shown.as_ref().map(|(shown, _)| shown)
    }

    fn marks(&self) -> Vec<Mark> {
        let take = self.takes.front().filter(|_| self.layer.marks);
        take.map_or(Vec::new(), |take| take.marks(&self.lights))
    }

    fn next_ticket(&self) -> u32 {
        self.next_ticket
    }
}

impl Take {
    fn marks(&self, lights: &[LightPoint]) -> Vec<Mark> {
        let distance = |x, y| self.igi.probe(x, y).map(|probe| probe.distance);
        lights::marks(lights, &self.igi.setup().camera, distance)
    }
}

/// The seed of a moving picture, by how many there were before: a function of the session, so that a replay draws the same.
fn seed_of(seed: u64, number: u32) -> u64 {
    // SplitMix64: Steele, Lea, Flood, *Fast Splittable Pseudorandom Number Generators*, 2014.
    let z = seed.wrapping_add((u64::from(number) + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15));
    let z = (z ^ z >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let z = (z ^ z >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ z >> 31
}

/// Sides of a moving picture over those of a still one, 0..=1.
fn scale(Effort(share): Effort) -> f32 {
    share.clamp(0.0, 1.0).sqrt()
}

/// The moving picture's size.
fn size(camera: &Camera, effort: Effort) -> [u32; 2] {
    let sides = [camera.width, camera.height];
    let least = SHORTER_SIDE_MIN as f32 / sides[0].min(sides[1]).max(1) as f32;
    let scale = scale(effort).max(least).min(1.0);
    sides.map(|side| ((side as f32 * scale).round() as u32).max(1))
}

/// The estimator's knobs: light sets that do not depend on where the camera is; no importance, which would follow it. Lights fall with the size of
/// the picture, between a quarter and a half of a still one's; at full size, they grow with the effort, up to twice those: an answer
/// takes the master as long however many lights it took.
fn moving_quality(rest: &Quality, effort: Effort) -> Quality {
    let share =
        if effort.0 > 1.0 { LIGHTS_AT_FULL_SIZE * effort.0 } else { scale(effort).clamp(0.25, LIGHTS_AT_FULL_SIZE) };
    let lights = |count: u16| ((f32::from(count) * share).ceil() as u16).max(1);
    Quality {
        light_samples: lights(rest.light_samples),
        vpls: lights(rest.vpls),
        photons: ((rest.photons as f32 * share).ceil() as u32).min(PHOTONS_MAX),
        importance: false,
        // Who asks for the paper's gets the paper's.
        motion: if rest.motion == Motion::Fresh { Motion::Fresh } else { Motion::Moving },
        replicates: 1,
        ..*rest
    }
}

/// Share of a still picture's lights that a moving one of its size has.
const LIGHTS_AT_FULL_SIZE: f32 = 0.5;
/// Moving pictures that may be under way: at 30 a second, workers may be half a second away.
const FLIGHT_MAX: usize = 16;
/// Work of an eye path, in units of a light's.
const EYE_WORK: f64 = 10.0;
/// Pixels that a moving picture has at least on its shorter side.
const SHORTER_SIDE_MIN: u32 = 48;
/// Share of the light sets of a rectangle that must have come before it takes the place of the last picture: three of
/// nine, which are as sharp as a moving picture, and have as little noise.
const COARSE_MIN: f32 = 0.25;

/// Share of the rectangles that must have come so far: developing a large picture takes time, in which more comes.
const COME_MIN: f32 = 0.9;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn small_pictures_stay_recognisable() {
        let size = |width, height| size(&Camera { width, height, ..Camera::default() }, Effort(0.04));
        assert_eq!(size(64, 48), [64, 48]);
        assert_eq!(size(10, 1), [10, 1]);
        assert_eq!(size(640, 480), [128, 96]);
    }

    /// Pixels cost the master, lights do not: beyond full size there are more of these, and never fewer with more effort.
    #[test]
    fn more_effort_buys_pixels_and_then_lights() {
        let camera = Camera { width: 640, height: 480, ..Camera::default() };
        let rest = Quality { vpls: 40, light_samples: 20, photons: 1000, ..Quality::default() };
        let drawn = |effort: f32| (size(&camera, Effort(effort)), moving_quality(&rest, Effort(effort)));
        let (full, at_full) = drawn(1.0);
        assert_eq!((full, at_full.vpls, at_full.light_samples, at_full.photons), ([640, 480], 20, 10, 500));
        let (more, better) = drawn(4.0);
        assert_eq!((more, better.vpls, better.light_samples, better.photons), ([640, 480], 80, 40, 2000));
        let mut before = 0;
        for step in 1..100 {
            let vpls = drawn(0.04 * step as f32).1.vpls;
            assert!(vpls >= before, "{vpls} after {before}");
            before = vpls;
        }
    }

    #[test]
    fn every_moving_picture_has_a_seed_of_its_own_and_so_has_every_session() {
        let mut seeds: Vec<u64> = (0..100).flat_map(|number| [0, 1, 2].map(|seed| seed_of(seed, number))).collect();
        seeds.sort_unstable();
        seeds.dedup();
        assert_eq!(seeds.len(), 300);
    }

    #[test]
    fn an_effort_is_the_square_of_a_scale_to_the_last_bit() {
        for step in [0.84_f32, 0.7, 0.58, 0.5, 0.42, 0.35, 0.29, 0.24, 0.2, 0.165, 0.135, 0.11, 0.09, 0.074, 0.06] {
            assert_eq!(scale(Effort(step * step)), step);
        }
    }
}
