//! The reference's front end: the mean of path-traced samples, and how far each pixel may be from its limit.
//!
//! **Order.** A *frame* is the same number of further samples of every pixel. Answers may come in any
//! order, late or twice; a frame is added when it is complete and all before it are, and sums are f64
//! in a fixed order, so the result is the same bits whoever answered, and whether or not the work was
//! interrupted and taken up again between frames.

mod checkpoint;
mod misses;

use glam::DVec3;
use protocol::answer::{Fields, Moments};
use protocol::question::{Ask, Asked, Question, Samples, Ticket, WorldState};
use scenes::{Camera, Change, Scene};

use super::afresh::Afresh;
use crate::Picture;
use crate::front_end::{
    Absorbed, Answered, FrontEnd, GivenUp, Interactive, Knob, Layer, Literal, Method, NoCheckpoint, Open, Panel, Plane,
    Settings, Value, Values, View,
};
use crate::metrics::Estimate;
use crate::parts::{Batches, Slot, Tiling};

/// The method: see the module's documentation.
pub const REFERENCE: ReferenceMethod = ReferenceMethod;

/// See [`REFERENCE`].
#[derive(Clone, Copy, Debug)]
pub struct ReferenceMethod;

const KNOBS: &[Knob] = &[Knob {
    name: "max-bounces",
    label: "Bounces",
    about: "Longest path: 0 shows lamps only, 1 adds direct light, and so on. Less: light is missing.",
    values: Values::Whole { least: 0, most: u32::MAX },
    unset: Some("paths end by roulette alone, so nothing is missing"),
    default: Literal::Unset,
    panel: Panel::Hidden,
}];

const LAYERS: &[Layer] = &[Layer::FINAL, Layer::SAMPLES, Layer::ERROR];

impl Method for ReferenceMethod {
    fn name(&self) -> &'static str {
        "reference"
    }

    fn about(&self) -> &'static str {
        "a path tracer, which others are judged by: no bias, and noise that takes long to go"
    }

    fn knobs(&self) -> &'static [Knob] {
        KNOBS
    }

    fn layers(&self) -> &'static [Layer] {
        LAYERS
    }

    fn memory_bytes(&self, _settings: &Settings, camera: &Camera, _fields: Fields) -> u64 {
        Reference::memory_bytes(camera)
    }

    fn begin(&self, settings: &Settings, view: &View) -> Box<dyn FrontEnd> {
        Box::new(Reference::new(ReferenceSetup::of(settings, view)))
    }

    fn resume(&self, settings: &Settings, view: &View, kept: &[u8]) -> Result<Box<dyn FrontEnd>, NoCheckpoint> {
        Ok(Box::new(Reference::from_checkpoint(ReferenceSetup::of(settings, view), kept)?))
    }

    fn interactive(&self, settings: &Settings, first_ticket: u32) -> Box<dyn Interactive> {
        Box::new(Afresh::new(&REFERENCE, settings, first_ticket))
    }

    fn samples_per_frame(&self) -> u32 {
        SAMPLES_PER_FRAME
    }

    fn misses(&self, scene: &Scene) -> Option<String> {
        misses::misses(scene)
    }

    fn is_reference(&self) -> bool {
        true
    }
}

impl ReferenceSetup {
    /// A state of the world, drawn as the settings say.
    pub fn of(settings: &Settings, view: &View) -> Self {
        let View { world, camera, seed, .. } = *view;
        let is_bounded = *settings.get("max-bounces") != Value::Unset;
        Self { world, camera, seed, max_bounces: is_bounded.then(|| settings.whole("max-bounces")) }
    }
}

/// What to draw.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ReferenceSetup {
    /// Which world.
    pub world: WorldState,
    /// From where; its size is the picture's, and neither side may be 0.
    pub camera: Camera,
    /// Different seeds give independent pictures.
    pub seed: u64,
    /// Most bounces of a path; `None`: no end but roulette's.
    pub max_bounces: Option<u32>,
}

/// All that has to be kept to go on later.
#[derive(Clone, Debug, PartialEq)]
pub struct ReferenceState {
    /// Frames so far: each is [`SAMPLES_PER_FRAME`] samples of every pixel.
    pub frames: u32,
    /// Sums over them, pixel by pixel, row by row.
    pub moments: Moments,
}

/// The front end: see the module's documentation.
pub struct Reference {
    setup: ReferenceSetup,
    tiling: Tiling,
    state: ReferenceState,
    /// A batch is a frame: a slot for each rectangle.
    frames: Batches<Moments>,
    /// The next question: frame, rectangle.
    next: (u32, usize),
    /// Number of frames to make in all.
    limit: u32,
}

/// Samples a pixel that a frame adds. Part of the result: sums are rounded frame by frame.
pub const SAMPLES_PER_FRAME: u32 = 16;
/// Samples are numbered by 32 bits.
pub const FRAMES_MAX: u32 = u32::MAX / SAMPLES_PER_FRAME;
/// Questions that should be in flight, so that many workers have something to do.
const QUESTIONS_WANTED: usize = 128;
/// Edge of the rectangles asked for, pixels: some ten milliseconds of a thread.
const EDGE: u32 = 16;

impl Reference {
    /// Nothing drawn yet.
    pub fn new(setup: ReferenceSetup) -> Self {
        let pixels = setup.camera.width as usize * setup.camera.height as usize;
        Self::resume(setup, ReferenceState { frames: 0, moments: Moments::zero(pixels) })
    }

    /// Goes on where another left off: same world, camera, seed and longest path.
    ///
    /// # Panics
    /// If the state is of a picture of another size.
    pub fn resume(setup: ReferenceSetup, state: ReferenceState) -> Self {
        let Camera { width, height, .. } = setup.camera;
        assert_eq!(state.moments.len(), width as usize * height as usize, "the state is of another picture");
        let tiling = Tiling { width, height, tile_width: EDGE.min(width), tile_height: EDGE.min(height) };
        let next = (state.frames, 0);
        let frames = Batches::new(0, state.frames);
        Self { setup, tiling, state, frames, next, limit: FRAMES_MAX }
    }

    /// Memory that a picture takes, bytes.
    pub fn memory_bytes(camera: &Camera) -> u64 {
        let pixels = u64::from(camera.width) * u64::from(camera.height);
        // The sums, and the answers to about three frames.
        pixels * 4 * 2 * size_of::<DVec3>() as u64
    }

    /// What is known so far.
    pub fn state(&self) -> &ReferenceState {
        &self.state
    }

    /// Samples a pixel so far.
    pub fn samples(&self) -> u32 {
        self.state.frames * SAMPLES_PER_FRAME
    }

    /// Variance of the mean, by channel; 0 as long as it is unknown.
    pub fn variance(&self) -> Picture {
        self.picture(variance_of_mean)
    }

    fn question(&self, frame: u32, rect: usize) -> Question {
        let ReferenceSetup { world, camera, seed, max_bounces } = self.setup;
        let (first, count) = (frame * SAMPLES_PER_FRAME, SAMPLES_PER_FRAME);
        let samples = Samples { camera, rect: self.tiling.rect(rect), first, count, seed, max_bounces };
        Question { world, ask: Ask::Reference(samples) }
    }

    fn next_question(&mut self) -> Option<Asked> {
        let most = QUESTIONS_WANTED.div_ceil(self.tiling.len()).max(2);
        loop {
            let (frame, rect) = self.next;
            let is_new = !self.frames.is_open(frame);
            if frame >= self.limit || (is_new && self.frames.len() >= most) {
                return None;
            }
            if is_new {
                self.frames.open(frame, vec![Slot::Missing; self.tiling.len()]);
            }
            self.next = if rect + 1 < self.tiling.len() { (frame, rect + 1) } else { (frame + 1, 0) };
            let ticket = self.frames.ticket(frame, rect);
            // When it is asked again, some answers are there.
            if self.frames.find(ticket).is_some() {
                return Some(Asked::new(ticket, self.question(frame, rect)));
            }
        }
    }

    fn add_complete_frames(&mut self) -> u32 {
        let mut added = 0;
        while let Some((_, slots)) = self.frames.take_complete() {
            for (tile, slot) in slots.into_iter().enumerate() {
                let Slot::Answered(moments) = slot else { continue };
                self.add(tile, &moments);
            }
            self.state.frames += 1;
            added += 1;
        }
        added
    }

    fn add(&mut self, tile: usize, moments: &Moments) {
        for ([x, y], (sum, squares)) in self.tiling.rect(tile).pixels().zip(moments.sum.iter().zip(&moments.squares)) {
            let pixel = y as usize * self.tiling.width as usize + x as usize;
            self.state.moments.sum[pixel] += *sum;
            self.state.moments.squares[pixel] += *squares;
        }
    }

    fn picture(&self, value: impl Fn(DVec3, DVec3, f64) -> DVec3) -> Picture {
        let Moments { sum, squares } = &self.state.moments;
        let n = f64::from(self.samples().max(1));
        let pixels = sum.iter().zip(squares).map(|(sum, squares)| value(*sum, *squares, n).as_vec3()).collect();
        Picture { width: self.tiling.width, height: self.tiling.height, pixels }
    }
}

/// Variance of the mean of n samples: (Σx² − (Σx)²/n) / (n (n − 1)).
pub fn variance_of_mean(sum: DVec3, squares: DVec3, n: f64) -> DVec3 {
    if n < 2.0 {
        return DVec3::ZERO;
    }
    // Rounding can leave a little less than nothing.
    ((squares - sum * sum / n) / (n * (n - 1.0))).max(DVec3::ZERO)
}

impl FrontEnd for Reference {
    fn look(&mut self, view: &View, _changes: &[Change]) -> Open {
        let View { world, camera, seed, .. } = *view;
        self.setup = ReferenceSetup { world, camera, seed, ..self.setup };
        self.begin_again();
        Open::Unwanted
    }

    fn ask(&mut self, room: usize) -> Vec<Asked> {
        std::iter::from_fn(|| self.next_question()).take(room).collect()
    }

    fn ask_again(&mut self) {
        self.next = (self.frames(), 0);
    }

    fn begin_again(&mut self) {
        let first_ticket = self.frames.next_ticket();
        *self = Self { frames: Batches::new(first_ticket, 0), ..Self::new(self.setup) };
    }

    fn absorb(&mut self, Answered { ticket, body, .. }: Answered<'_>) -> Absorbed {
        let Some((frame, tile)) = self.frames.find(ticket) else { return Absorbed::Unwanted };
        let pixels = self.tiling.rect(tile).len();
        let Some(moments) = body.moments().filter(|moments| moments.len() == pixels) else {
            self.give_up(ticket);
            return Absorbed::Unwanted;
        };
        self.frames.answer((frame, tile), moments);
        match self.add_complete_frames() {
            0 => Absorbed::Kept,
            frames => Absorbed::Completed { frames },
        }
    }

    fn set_limit(&mut self, frames: u32) {
        self.limit = frames.min(FRAMES_MAX);
        self.frames.cut(frames);
    }

    fn finish(&mut self) {
        let frames = self.frames();
        let in_hand = self.frames.is_open(frames) || frames == 0;
        self.set_limit(self.limit.min(frames + u32::from(in_hand)));
    }

    fn is_finished(&self) -> bool {
        self.frames() >= self.limit
    }

    fn frame_progress(&self) -> f32 {
        self.frames.progress()
    }

    /// A reference with gaps would judge wrongly: it ends with the frames that are complete.
    fn give_up(&mut self, ticket: Ticket) -> GivenUp {
        let Some((_, tile)) = self.frames.find(ticket) else { return GivenUp::Unwanted };
        self.set_limit(self.frames());
        GivenUp::Part(self.tiling.rect(tile))
    }

    fn keep(&self) -> Option<Vec<u8>> {
        Some(self.checkpoint())
    }

    /// The mean, its standard deviation, the number of samples; other layers are black.
    fn show(&mut self, plane: Plane) -> Picture {
        match plane {
            Plane::Final | Plane::Raw => self.picture(|sum, _, n| sum / n),
            Plane::Error => {
                self.picture(|sum, squares, n| variance_of_mean(sum, squares, n).to_array().map(f64::sqrt).into())
            }
            Plane::Samples => self.picture(|_, _, _| DVec3::splat(f64::from(self.samples()))),
            _ => Picture::black(self.tiling.width, self.tiling.height),
        }
    }

    fn frames(&self) -> u32 {
        self.state.frames
    }

    /// The noise of the mean as a relative mean squared error; the interval is that of the mean over
    /// pixels, which are independent.
    fn error(&self) -> Option<Estimate> {
        if self.state.frames == 0 {
            return None;
        }
        let n = f64::from(self.samples());
        let Moments { sum, squares } = &self.state.moments;
        let relative = |(sum, squares): (&DVec3, &DVec3)| {
            let mean = *sum / n;
            let error = variance_of_mean(*sum, *squares, n) / (mean * mean + DVec3::splat(0.01));
            (error.x + error.y + error.z) / 3.0
        };
        let (all, all2) = sum.iter().zip(squares).map(relative).fold((0.0, 0.0), |(a, b), e| (a + e, b + e * e));
        let pixels = sum.len() as f64;
        let rel_mse = all / pixels;
        let spread = (all2 / pixels - rel_mse * rel_mse).max(0.0);
        let half = 1.96 * (spread / pixels).sqrt();
        Some(Estimate { rel_mse, low: (rel_mse - half).max(0.0), high: rel_mse + half })
    }
}

#[cfg(test)]
mod tests;
