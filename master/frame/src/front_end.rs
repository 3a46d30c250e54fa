//! What every way of making pictures has in common.

use glam::Vec3;
use protocol::answer::{Body, Cost};
use protocol::question::{Asked, Rect, Ticket};

use crate::Picture;
use crate::metrics::Estimate;

/// Decides what to ask about light and makes pictures of the answers. It knows neither workers nor
/// time: who answers, and when, is the caller's business.
pub trait FrontEnd {
    /// The next questions, most urgent first, at most `room` of them; fewer or none while enough
    /// is under way. Every question is asked once: who loses one has to repeat it.
    fn ask(&mut self, room: usize) -> Vec<Asked>;

    /// Takes an answer, in any order, late or twice.
    fn absorb(&mut self, answered: Answered<'_>) -> Absorbed;

    /// So many questions can be answered at a time: with many, more frames are in flight at once, so that nobody has to
    /// share work that is better done alone. Changes no bit.
    fn set_parallelism(&mut self, _questions: usize) {}

    /// Makes this many frames in all, and no more.
    fn set_limit(&mut self, frames: u32);

    /// Completes the frame in hand, if there is one, and no more.
    fn finish(&mut self);

    /// All frames are made.
    fn is_finished(&self) -> bool;

    /// How much of the frame in hand has been answered, 0..=1.
    fn frame_progress(&self) -> f32;

    /// A question will never be answered: workers die of it. That part of the picture, which is returned, stays as it
    /// is and is not asked about again; the rest goes on. `None` if nobody waits for an answer with this ticket.
    fn give_up(&mut self, ticket: Ticket) -> Option<Rect>;

    /// Parts of the picture that were given up, by whatever process drew before.
    fn gaps(&self) -> Vec<Rect> {
        Vec::new()
    }

    /// The picture as far as it is known.
    fn show(&mut self, layer: Layer) -> Picture;

    /// Number of complete frames that the picture is made of.
    fn frames(&self) -> u32;

    /// How far the accumulated picture is from its limit, as soon as that can be told.
    fn error(&self) -> Option<Estimate>;
}

/// An answer to one of the front end's questions.
#[derive(Debug)]
pub struct Answered<'a> {
    /// The question's.
    pub ticket: Ticket,
    /// What it says; it fits the question, which whoever unpacked it has checked.
    pub body: Body,
    /// A number to tell workers apart.
    pub worker: u32,
    /// What it cost the worker.
    pub cost: &'a Cost,
}

/// What became of an answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Absorbed {
    /// It is part of a frame that is not complete yet.
    Kept,
    /// It completed one or more frames.
    Completed {
        /// How many.
        frames: u32,
    },
    /// Nobody waits for it: it came twice, too late, or for another world, camera or setting.
    Unwanted,
}

/// What a picture shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Layer {
    /// Radiance, filtered as set, the filter fading as frames accumulate.
    Final,
    /// Mean radiance, never filtered.
    Raw,
    /// Unfiltered irradiance at the eye paths' end points; 0 where nothing diffuse is seen.
    Irradiance,
    /// Reflectance along the eye path.
    Albedo,
    /// Mean normal, its components in −1..=1.
    Normal,
    /// Mean length of the eye path, the same in all three channels.
    Distance,
    /// Number of samples, the same in all three channels.
    Samples,
    /// Standard deviation of the raw mean, by replicate; 0 as long as it is unknown.
    Error,
    /// Number of the worker that answered last for this pixel.
    Worker,
    /// Microseconds of a thread that a pixel of the last answer cost.
    Cost,
}

/// Means of all that is known of a pixel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Probe {
    /// Unfiltered.
    pub radiance: Vec3,
    /// At the eye path's end point, unfiltered; 0 where nothing diffuse is seen.
    pub irradiance: Vec3,
    /// Reflectance along the eye path.
    pub reflectance: Vec3,
    /// Unit length; zero where no surface is seen.
    pub normal: Vec3,
    /// Length of the eye path; 0 where no surface is seen.
    pub distance: f32,
}
