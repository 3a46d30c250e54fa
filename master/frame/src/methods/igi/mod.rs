//! The front end of Wald, Kollig, Benthin, Keller and Slusallek, *Interactive Global Illumination
//! using Fast Ray Tracing* (2002).
//!
//! **Idea.** A frame is cut into rectangles, and each rectangle into n·m interleaved sets of
//! pixels; a task is one set of one rectangle, lit by one set of virtual lights. Neighbouring
//! pixels so are wrong in different ways, which the discontinuity buffer averages out; frames
//! accumulate while nothing changes, and the filter fades.
//!
//! **Order.** Tasks go out set by set, so that whoever made a light set can go on using it. A few
//! frames are in flight at once, so that nobody waits for the last task of one. A picture at rest whose light sets were all
//! seen several times has one set a frame from then on ([`settled`]), is asked for several frames at a time, and answered by their
//! mean ([`Igi::span`]). Answers may come
//! in any order, late or twice; a frame is added when it is complete and all before it are, so the
//! picture is the same bits in any case.
//!
//! **Given up.** A rectangle that cannot be answered (workers die of it) keeps the mean of the frames
//! before, black if there are none, and is left out of all that follow.

mod before;
mod checkpoint;
mod cross_check;
mod interactive;
mod lights;
mod settings;
mod settled;

use std::cell::OnceCell;
use std::collections::BTreeSet;
use std::sync::Arc;

use glam::Vec3;
use protocol::answer::{Body, Fields, Means, Moments, Pixels};
use protocol::question::{Ask, Asked, Frames, Lit, Motion, Quality, Question, Rect, Ticket, Tile, WorldState};
use scenes::{Camera, Change};

use before::Before;
use cross_check::CrossCheck;
pub use settings::{filter, quality, values};
use settled::YOUNG_ROUNDS;

use crate::Picture;
use crate::front_end::{
    Absorbed, Answered, FrontEnd, GivenUp, Interactive, Knob, Layer, Method, NoCheckpoint, Open, Plane, Preset, Probe,
    Settings, View,
};
use crate::metrics::Estimate;
use crate::parts::reproject::{Fresh, Shown};
use crate::parts::{Batches, Film, Filter, Light, Sample, Slot, Smoother, Tiling, shown, smoothed_by};

/// The method: see the module's documentation.
pub const IGI: IgiMethod = IgiMethod;

/// See [`IGI`].
#[derive(Clone, Copy, Debug)]
pub struct IgiMethod;

impl Method for IgiMethod {
    fn name(&self) -> &'static str {
        "igi"
    }

    fn about(&self) -> &'static str {
        "interleaved virtual lights and photons (Wald et al. 2002), without bias by default"
    }

    fn knobs(&self) -> &'static [Knob] {
        settings::KNOBS
    }

    fn presets(&self) -> &'static [Preset] {
        settings::PRESETS
    }

    fn layers(&self) -> &'static [Layer] {
        settings::LAYERS
    }

    fn check(&self, settings: &Settings) -> Result<(), String> {
        quality(settings).check().map_err(str::to_owned)
    }

    fn memory_bytes(&self, settings: &Settings, camera: &Camera, fields: Fields) -> u64 {
        Igi::memory_bytes(camera, &quality(settings), fields)
    }

    fn begin(&self, settings: &Settings, view: &View) -> Box<dyn FrontEnd> {
        Box::new(Igi::new(Setup::of(settings, view)))
    }

    fn resume(&self, settings: &Settings, view: &View, kept: &[u8]) -> Result<Box<dyn FrontEnd>, NoCheckpoint> {
        Ok(Box::new(Igi::resume(Setup::of(settings, view), kept)?))
    }

    fn interactive(&self, settings: &Settings, first_ticket: u32) -> Box<dyn Interactive> {
        Box::new(interactive::InteractiveIgi::new(settings, first_ticket))
    }

    fn is_filtered(&self, settings: &Settings) -> bool {
        filter(settings).edges.is_some()
    }

    /// What is cut off for ever, or blurred for ever, is a floor.
    fn expected_slope(&self, settings: &Settings) -> f64 {
        let quality = quality(settings);
        let has_floor = quality.max_length.is_some() || !quality.bias_compensation || !quality.shrink_radius;
        if has_floor { 0.0 } else { -1.0 }
    }
}

/// What to draw, and how.
#[derive(Clone, Debug, PartialEq)]
pub struct Setup {
    /// Which world.
    pub world: WorldState,
    /// From where; its size is the picture's, and neither side may be 0.
    pub camera: Camera,
    /// How much work.
    pub quality: Quality,
    /// What answers about this world can contain.
    pub fields: Fields,
    /// All randomness comes from it.
    pub seed: u64,
    /// How the picture is smoothed.
    pub filter: Filter,
}

impl Setup {
    /// A state of the world, drawn as the settings say.
    pub fn of(settings: &Settings, view: &View) -> Self {
        let View { world, fields, camera, seed, .. } = *view;
        Self { world, camera, quality: quality(settings), fields, seed, filter: filter(settings) }
    }
}

/// The front end: see the module's documentation.
pub struct Igi {
    setup: Setup,
    tiling: Tiling,
    film: Film,
    /// A batch is a frame, or several: a slot for each set of each rectangle, in the first of them, and one for the
    /// cross-check.
    frames: Batches<Part>,
    /// What path-traced samples say; `None` where the settings leave out light for ever, or something moves.
    check: Option<CrossCheck>,
    next: Cursor,
    /// Rectangles that are asked about no more.
    given_up: BTreeSet<usize>,
    /// Number of frames to make in all.
    limit: u32,
    /// Number of frames that may be in flight at once.
    in_flight: u32,
    /// Who answered for the last complete frame, at what cost.
    last: Vec<Credit>,
    dropped: u64,
}

/// What a batch is made of.
#[derive(Clone, Debug)]
enum Part {
    /// One set of one rectangle, or one part of it.
    Pixels(Sample, Credit),
    /// The cross-check's samples.
    Check(Moments),
}

/// Where a sample came from.
#[derive(Clone, Copy, Debug)]
struct Credit {
    grid: protocol::question::Grid,
    worker: u32,
    micros_per_pixel: f32,
}

/// The next task: frame, then set, then rectangle. After the last set comes the cross-check.
#[derive(Clone, Copy, Debug, Default)]
struct Cursor {
    frame: u32,
    set: u16,
    rect: usize,
}

/// One is being finished, one is being drawn, and one waits at the workers' doors.
const FRAMES_IN_FLIGHT: u32 = 3;
/// With many threads, up to so many …
const FRAMES_IN_FLIGHT_MAX: u32 = 16;
/// … if their answers take no more than this, bytes.
const IN_FLIGHT_BYTES_MAX: u64 = 256 << 20;

impl Igi {
    /// Nothing drawn yet.
    pub fn new(setup: Setup) -> Self {
        let tiling = Tiling::of(setup.camera.width, setup.camera.height, &setup.quality);
        let mut film = Film::new(tiling, setup.quality.replicates, setup.fields);
        film.guide_by(guide_frames(&setup.quality));
        let check = check_of(&setup);
        Self {
            setup,
            tiling,
            film,
            frames: Batches::default(),
            check,
            next: Cursor::default(),
            given_up: BTreeSet::new(),
            limit: u32::MAX,
            in_flight: FRAMES_IN_FLIGHT,
            last: Vec::new(),
            dropped: 0,
        }
    }

    /// Memory that a picture takes, bytes: the film, the answers to the frames in flight.
    pub fn memory_bytes(camera: &Camera, quality: &Quality, fields: Fields) -> u64 {
        let pixels = u64::from(camera.width) * u64::from(camera.height);
        let answers = u64::from(most_in_flight(pixels)) * BYTES_PER_ANSWERED_PIXEL;
        pixels * (Film::bytes_per_pixel(quality.replicates, fields) + CrossCheck::BYTES_PER_PIXEL + answers)
    }

    /// As [`Self::new`], with tickets from this number on: answers to what was asked before are not taken for its own.
    pub fn numbered_from(first_ticket: u32, setup: Setup) -> Self {
        Self { frames: Batches::new(first_ticket, 0), ..Self::new(setup) }
    }

    /// The same, in the memory of one that is over.
    pub fn again_from(mut self, first_ticket: u32, setup: Setup) -> Self {
        self.restart(setup);
        self.frames = Batches::new(first_ticket, 0);
        self
    }

    /// The number from which on no ticket was given.
    pub fn next_ticket(&self) -> u32 {
        self.frames.next_ticket()
    }

    /// Begins again: the scene, the camera or a knob was changed. Old answers are unwanted.
    pub fn restart(&mut self, setup: Setup) {
        self.tiling = Tiling::of(setup.camera.width, setup.camera.height, &setup.quality);
        if self.film.suits(self.tiling, setup.quality.replicates, setup.fields) {
            self.film.clear();
        } else {
            self.film = Film::new(self.tiling, setup.quality.replicates, setup.fields);
        }
        self.film.guide_by(guide_frames(&setup.quality));
        self.check = check_of(&setup);
        self.setup = setup;
        self.frames = Batches::new(self.frames.next_ticket(), 0);
        self.next = Cursor::default();
        self.limit = u32::MAX;
        self.given_up.clear();
        self.last.clear();
        self.dropped = 0;
    }

    /// What is being drawn.
    pub fn setup(&self) -> &Setup {
        &self.setup
    }

    /// Smooths otherwise from now on; nothing has to be drawn again.
    pub fn set_filter(&mut self, filter: Filter) {
        self.setup.filter = filter;
    }

    /// The picture with the places of its points; for when at least one frame is complete. It is smoothed by
    /// `smoother`, if it can.
    pub fn shown(&mut self, smoother: Option<&dyn Smoother>) -> Shown {
        let Setup { camera, filter, .. } = &self.setup;
        let picture = smoothed_by(smoother, &self.film, camera, filter, self.round());
        let distance = self.film.distances();
        let age = vec![1.0; picture.pixels.len()];
        Shown { camera: self.setup.camera, picture: Arc::new(picture), distance, age }
    }

    /// The first frame as far as it has come, smoothed; holes where nothing has, and in rectangles with less than this
    /// share of their sets, 0..=1.
    pub fn fresh(&mut self, smoother: Option<&dyn Smoother>, least: f32) -> Fresh {
        let len = self.tiling.width as usize * self.tiling.height as usize;
        let camera = self.setup.camera;
        if self.frames() > 0 {
            let picture = smoothed_by(smoother, &self.film, &camera, &self.setup.filter, self.round());
            return Fresh { camera, picture, distance: self.film.distances(), known: vec![true; len] };
        }
        let mut known = vec![false; len];
        let sets = usize::from(self.setup.quality.sets());
        let slots = self.frames.slots(0);
        let slots = &slots[..slots.len().min(self.check_slot())];
        let is_enough: Vec<bool> = self.has_come(least).collect();
        let sample = |(index, slot): (usize, &Slot<Part>)| match slot {
            Slot::Answered(Part::Pixels(sample, _)) => {
                for [x, y] in sample.grid.pixels().filter(|_| is_enough[index / sets]) {
                    known[y as usize * self.tiling.width as usize + x as usize] = true;
                }
                sample.clone()
            }
            // A film wants every pixel: what has not come is black, and no surface.
            Slot::Answered(Part::Check(_)) | Slot::Empty | Slot::Missing | Slot::GivenUp => {
                let (rect, set) = self.rect_and_set(index);
                let grid = self.tile(0, set, rect).grid();
                Sample { grid, light: Light::Frame(Pixels::black(grid.len())) }
            }
        };
        let samples: Vec<Sample> = slots.iter().enumerate().map(sample).collect();
        let mut film = Film::new(self.tiling, 1, self.setup.fields);
        film.add(0, 0, &samples);
        let picture = smoothed_by(smoother, &film, &camera, &self.setup.filter, u32::MAX);
        let distance = film.distances();
        Fresh { camera, picture, distance, known }
    }

    /// Of which rectangles of the first frame at least this share of the sets has come, 0..=1.
    fn has_come(&self, least: f32) -> impl Iterator<Item = bool> {
        let sets = usize::from(self.setup.quality.sets());
        let is_answered = |slot: &&Slot<Part>| matches!(slot, Slot::Answered(_));
        let answered = move |rect: &[Slot<_>]| rect.iter().filter(is_answered).count() as f32 / sets as f32;
        let slots = self.frames.slots(0);
        slots[..slots.len().min(self.check_slot())].chunks(sets).map(move |rect| answered(rect) >= least)
    }

    /// Share of the rectangles of the first frame, 0..=1, of which at least this share of the sets has come, 0..=1.
    pub fn share_come(&self, least: f32) -> f32 {
        let (mut come, mut all) = (0_u32, 0_u32);
        self.has_come(least).for_each(|has_come| (come, all) = (come + u32::from(has_come), all + 1));
        come as f32 / all.max(1) as f32
    }

    /// Number of samples that were not finite and count as black.
    pub fn dropped(&self) -> u64 {
        self.dropped
    }

    /// The next task, if it may be asked now.
    fn next_question(&mut self) -> Option<Asked> {
        loop {
            let Cursor { frame, set, rect } = self.next;
            let span = self.frames.span(frame).unwrap_or_else(|| self.span(frame));
            if frame >= self.limit || frame >= self.frames().saturating_add(self.in_flight * span) {
                return None;
            }
            self.next = self.after(self.next, span);
            if set == self.setup.quality.sets() {
                match self.next_check(frame) {
                    Some(asked) => return Some(asked),
                    None => continue,
                }
            }
            let tile = self.tile(frame, set, rect);
            if tile.grid().is_empty() || self.given_up.contains(&rect) {
                continue;
            }
            if !self.frames.is_open(frame) {
                self.frames.open_spanning(frame, span, self.slots(frame));
            }
            let ticket = self.frames.ticket(frame, self.slot(rect, set));
            if self.frames.find(ticket).is_none() {
                continue;
            }
            let ask = match u16::try_from(span) {
                Ok(count) if count > 1 => Ask::Frames(Frames { tile, count }),
                _ => Ask::Tile(tile),
            };
            return Some(Asked::new(ticket, Question { world: self.setup.world, ask }));
        }
    }

    /// Number of frames that are asked for at once from this one on: one as long as a picture is young, so that people see it
    /// grow, and where it ends before. Settings, number and limit alone decide, so bits do not depend on who answers; in a
    /// picture that is as old, it is a small step, and workers, if there are many, do not have to tell of every frame.
    fn span(&self, frame: u32) -> u32 {
        let quality = &self.setup.quality;
        let at_once = u32::from(quality.frames_at_once());
        let is_old = frame >= YOUNG_ROUNDS * u32::from(quality.sets());
        let fits = frame.is_multiple_of(at_once) && frame.saturating_add(at_once) <= self.limit;
        if is_old && fits { at_once } else { 1 }
    }

    /// The cross-check's question of a batch that was begun, if nobody has answered it.
    fn next_check(&self, frame: u32) -> Option<Asked> {
        let ticket = self.frames.ticket(frame, self.check_slot());
        self.frames.find(ticket)?;
        Some(Asked::new(ticket, self.check.as_ref()?.question(frame, &self.setup)?))
    }

    fn after(&self, Cursor { frame, set, rect }: Cursor, span: u32) -> Cursor {
        if set < self.setup.quality.sets() {
            if rect + 1 < self.tiling.len() {
                Cursor { frame, set, rect: rect + 1 }
            } else {
                Cursor { frame, set: set + 1, rect: 0 }
            }
        } else {
            Cursor { frame: frame + span, set: 0, rect: 0 }
        }
    }

    /// The slots of a frame of which nothing has come.
    fn slots(&self, frame: u32) -> Vec<Slot<Part>> {
        let is_checked = self.check.as_ref().is_some_and(|check| check.pixels(frame).is_some());
        let check = if is_checked { Slot::Missing } else { Slot::Empty };
        let sets = self.setup.quality.sets();
        let tiles = (0..self.tiling.len()).flat_map(|rect| (0..sets).map(move |set| (rect, set)));
        tiles
            .map(|(rect, set)| match self.tile(frame, set, rect).grid().is_empty() {
                true => Slot::Empty,
                false if self.given_up.contains(&rect) => Slot::GivenUp,
                false => Slot::Missing,
            })
            .chain([check])
            .collect()
    }

    /// The slot of a batch that is the cross-check's: the last.
    fn check_slot(&self) -> usize {
        self.slot(self.tiling.len(), 0)
    }

    fn slot(&self, rect: usize, set: u16) -> usize {
        rect * usize::from(self.setup.quality.sets()) + usize::from(set)
    }

    /// The rectangle and the set of a slot.
    fn rect_and_set(&self, slot: usize) -> (usize, u16) {
        let sets = usize::from(self.setup.quality.sets());
        (slot / sets, (slot % sets) as u16)
    }

    fn tile(&self, frame: u32, set: u16, rect: usize) -> Tile {
        let Setup { camera, quality, seed, .. } = self.setup;
        let rect = self.tiling.rect(rect);
        match settled::lit(&quality, seed, frame) {
            Some(lit) => Tile { camera, rect: settled::part(rect, quality.interleave, set), lit },
            None => Tile { camera, rect, lit: Lit { set, frame, seed, quality } },
        }
    }

    /// Adds all complete frames that are next in line.
    fn add_complete_frames(&mut self) -> u32 {
        let before = self.frames();
        while let Some((number, span, slots)) = self.frames.take_complete_spanning() {
            let (samples, credits, check) = self.collect(number, span, slots);
            if let (Some(cross_check), Some(samples)) = (&mut self.check, check) {
                cross_check.add(number, &samples);
            }
            let replicate = self.setup.quality.replicate_of(number);
            self.dropped += self.film.add_frames(self.half_of(number), replicate, span, &samples);
            self.last = credits;
        }
        self.frames() - before
    }

    /// All samples of a frame in the film's order; what was given up stays as it was. And those of the cross-check.
    fn collect(&self, number: u32, span: u32, slots: Vec<Slot<Part>>) -> (Vec<Sample>, Vec<Credit>, Option<Moments>) {
        let before = OnceCell::new();
        let as_before = |index: usize| {
            let (rect, set) = self.rect_and_set(index);
            let grid = self.tile(number, set, rect).grid();
            let before: &Before = before.get_or_init(|| Before::of(&self.film));
            let light = if span > 1 { Light::Frames(before.means(grid)) } else { Light::Frame(before.pixels(grid)) };
            Sample { grid, light }
        };
        let (mut samples, mut credits, mut check) = (Vec::new(), Vec::new(), None);
        for (index, slot) in slots.into_iter().enumerate() {
            match slot {
                Slot::Empty | Slot::Missing => {}
                Slot::GivenUp if index == self.check_slot() => {}
                Slot::GivenUp => samples.push(as_before(index)),
                Slot::Answered(Part::Check(answer)) => check = Some(answer),
                Slot::Answered(Part::Pixels(sample, credit)) => {
                    samples.push(sample);
                    credits.push(credit);
                }
            }
        }
        (samples, credits, check)
    }

    /// The half of the film that a frame belongs to. In the first two rounds frames take turns, so that the filter can be
    /// judged from the second frame on; and each half has met every set once after them. Then whole rounds take turns, so
    /// that the halves share no replicate if their number is even. (What they share of the first two is forgotten faster
    /// than noise: its part of a mean falls like 1/N, noise like 1/√N.)
    fn half_of(&self, frame: u32) -> usize {
        let sets = u32::from(self.setup.quality.sets());
        let turn = match self.setup.quality.motion {
            Motion::Still if frame < 2 * sets => frame / sets + frame % sets,
            Motion::Still => frame / sets,
            Motion::Moving | Motion::Fresh => frame,
        };
        turn as usize % 2
    }

    /// Number of frames in each half that make a fair judgement of the filter.
    fn round(&self) -> u32 {
        match self.setup.quality.motion {
            Motion::Still => 1,
            Motion::Fresh => 2,
            // All frames have the same light sets: that they agree says nothing.
            Motion::Moving => u32::MAX,
        }
    }

    fn absorb_check(&mut self, ticket: Ticket, place: (u32, usize), samples: Option<Moments>) -> Absorbed {
        let pixels = self.check.as_ref().and_then(|check| check.pixels(place.0)).unwrap_or(0);
        let Some(samples) = samples.filter(|samples| samples.len() == pixels) else {
            self.give_up(ticket);
            return Absorbed::Unwanted;
        };
        self.keep_part(place, Part::Check(samples))
    }

    /// Keeps an answer, and adds what is complete.
    fn keep_part(&mut self, place: (u32, usize), part: Part) -> Absorbed {
        self.frames.answer(place, part);
        match self.add_complete_frames() {
            0 => Absorbed::Kept,
            frames => Absorbed::Completed { frames },
        }
    }

    fn credits(&self, value: impl Fn(&Credit) -> f32) -> Picture {
        let mut picture = Picture::black(self.tiling.width, self.tiling.height);
        for credit in &self.last {
            let value = Vec3::splat(value(credit));
            for [x, y] in credit.grid.pixels() {
                picture.pixels[y as usize * self.tiling.width as usize + x as usize] = value;
            }
        }
        picture
    }
}

impl FrontEnd for Igi {
    fn look(&mut self, view: &View, _changes: &[Change]) -> Open {
        let View { world, fields, camera, seed, .. } = *view;
        self.restart(Setup { world, camera, fields, seed, ..self.setup });
        Open::Unwanted
    }

    fn ask(&mut self, room: usize) -> Vec<Asked> {
        std::iter::from_fn(|| self.next_question()).take(room).collect()
    }

    fn ask_again(&mut self) {
        self.next = Cursor { frame: self.frames(), ..Cursor::default() };
    }

    fn begin_again(&mut self) {
        self.restart(self.setup.clone());
    }

    fn absorb(&mut self, Answered { ticket, body, worker, cost }: Answered<'_>) -> Absorbed {
        let Some((frame, slot)) = self.frames.find(ticket) else { return Absorbed::Unwanted };
        if slot == self.check_slot() {
            return self.absorb_check(ticket, (frame, slot), body.moments());
        }
        let (rect, set) = self.rect_and_set(slot);
        let grid = self.tile(frame, set, rect).grid();
        let span = self.frames.span(frame).unwrap_or(1);
        let light = match body {
            Body::Pixels(pixels) if span == 1 && fits(&pixels, grid.len()) => Light::Frame(pixels),
            Body::Means(means) if span > 1 && means_fit(&means, grid.len()) => Light::Frames(means),
            // It was asked when the limit was another one; what is asked now is answered as well.
            Body::Pixels(pixels) if span > 1 && fits(&pixels, grid.len()) => return Absorbed::Unwanted,
            Body::Means(means) if span == 1 && means_fit(&means, grid.len()) => return Absorbed::Unwanted,
            _ => {
                // It would be asked again for ever.
                self.give_up(ticket);
                return Absorbed::Unwanted;
            }
        };
        let micros_per_pixel = cost.total_micros() as f32 / (grid.len() as f32 * span as f32);
        let credit = Credit { grid, worker, micros_per_pixel };
        self.keep_part((frame, slot), Part::Pixels(Sample { grid, light }, credit))
    }

    fn set_parallelism(&mut self, questions: usize) {
        // A light set for each thread, another for whoever has finished it, and a frame whose last set is being finished.
        let sets = usize::from(self.setup.quality.sets());
        let wanted = u32::try_from(1 + (2 * questions).div_ceil(sets)).unwrap_or(u32::MAX);
        let most = most_in_flight(u64::from(self.tiling.width) * u64::from(self.tiling.height));
        self.in_flight = match self.setup.quality.motion {
            Motion::Still | Motion::Fresh => wanted.clamp(FRAMES_IN_FLIGHT, most),
            // Sets are the same in every frame: nothing is gained by beginning more of them.
            Motion::Moving => FRAMES_IN_FLIGHT,
        };
    }

    fn set_limit(&mut self, frames: u32) {
        self.limit = frames;
        self.frames.cut(frames);
        if !self.frames.is_open(self.next.frame) {
            // What is asked for at once may have been cut in its middle.
            self.next = Cursor { frame: self.frames.end(), ..Cursor::default() };
        }
    }

    fn finish(&mut self) {
        let frames = self.frames();
        let in_hand = self.frames.span(frames).unwrap_or(u32::from(frames == 0));
        self.set_limit(self.limit.min(frames + in_hand));
    }

    fn is_finished(&self) -> bool {
        // Where everything was given up, nothing is left to ask about.
        self.frames() >= self.limit || self.given_up.len() == self.tiling.len()
    }

    fn gaps(&self) -> Vec<Rect> {
        self.given_up.iter().map(|rect| self.tiling.rect(*rect)).collect()
    }

    fn frame_progress(&self) -> f32 {
        self.frames.progress()
    }

    fn give_up(&mut self, ticket: Ticket) -> GivenUp {
        let Some((_, slot)) = self.frames.find(ticket) else { return GivenUp::Unwanted };
        if slot == self.check_slot() {
            // The picture lacks nothing by it.
            self.frames.give_up(slot..slot + 1);
            self.add_complete_frames();
            return GivenUp::Unwanted;
        }
        let (rect, _) = self.rect_and_set(slot);
        self.given_up.insert(rect);
        self.frames.give_up(self.slot(rect, 0)..self.slot(rect + 1, 0));
        self.add_complete_frames();
        GivenUp::Part(self.tiling.rect(rect))
    }

    fn show(&mut self, plane: Plane) -> Picture {
        match plane {
            Plane::Final => shown(&self.film, &self.setup.camera, &self.setup.filter, self.round()),
            Plane::Worker => self.credits(|credit| credit.worker as f32),
            Plane::Cost => self.credits(|credit| credit.micros_per_pixel),
            known => self.film.plane(known),
        }
    }

    fn frames(&self) -> u32 {
        self.film.frames()
    }

    fn error(&self) -> Option<Estimate> {
        let estimate = self.film.estimate(match self.setup.quality.motion {
            Motion::Still => u32::from(self.setup.quality.sets()),
            Motion::Fresh => 1,
            Motion::Moving => return None,
        })?;
        let picture = self.film.picture();
        if picture.pixels.iter().all(|pixel| *pixel == Vec3::ZERO) {
            // Replicates that all found nothing agree, and know nothing.
            return Some(Estimate::of_nothing(self.frames()));
        }
        let Some(check) = &self.check else { return Some(estimate) };
        Some(check.corrected(estimate, &picture, &self.film.plane(Plane::Error)))
    }

    fn probe(&self, x: u32, y: u32) -> Option<Probe> {
        let inside = x < self.tiling.width && y < self.tiling.height && self.frames() > 0;
        inside.then(|| self.film.probe(x, y))
    }

    fn keep(&self) -> Option<Vec<u8>> {
        Some(self.checkpoint())
    }
}

fn check_of(setup: &Setup) -> Option<CrossCheck> {
    let Setup { camera, quality, .. } = setup;
    let is_checked = quality.motion == Motion::Still && CrossCheck::suits(quality);
    let young = YOUNG_ROUNDS * u32::from(quality.sets());
    let at_once = u32::from(quality.frames_at_once()).max(1);
    is_checked.then(|| CrossCheck::new([camera.width, camera.height], young, at_once))
}

/// Frames of so many pixels that may be in flight at once, however many threads there are.
fn most_in_flight(pixels: u64) -> u32 {
    let affordable = IN_FLIGHT_BYTES_MAX / (pixels * BYTES_PER_ANSWERED_PIXEL).max(1);
    u32::try_from(affordable).unwrap_or(u32::MAX).clamp(FRAMES_IN_FLIGHT, FRAMES_IN_FLIGHT_MAX)
}

/// All parts have a value a pixel, or none where the scene cannot have any.
fn fits(pixels: &Pixels, len: usize) -> bool {
    let lengths = [
        pixels.emitted.len(),
        pixels.reflectance.len(),
        pixels.irradiance.len(),
        pixels.normal.len(),
        pixels.distance.len(),
    ];
    lengths.iter().all(|part| *part == len || *part == 0)
}

/// As [`fits`], for means.
fn means_fit(Means { emitted, reflected }: &Means, len: usize) -> bool {
    [emitted, reflected].iter().all(|part| part.len() == len || part.is_empty())
}

/// Frames that say what tells surfaces apart: those that are asked for one by one for sure, if others are not.
fn guide_frames(quality: &Quality) -> u32 {
    if quality.frames_at_once() > 1 { YOUNG_ROUNDS * u32::from(quality.sets()) } else { u32::MAX }
}

/// Size of one pixel of [`Pixels`].
const BYTES_PER_ANSWERED_PIXEL: u64 = 4 * size_of::<Vec3>() as u64 + size_of::<f32>() as u64;

#[cfg(test)]
mod tests;
