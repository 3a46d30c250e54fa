//! What every way of making pictures has in common.
//!
//! A [`Method`] is the description of one: its name, knobs and layers, and how to begin with it. A [`FrontEnd`] makes one
//! picture, for files; an [`Interactive`] one picture after the other, for people who move and change things.

mod knob;
mod layer;
mod method;

use std::sync::Arc;

use glam::Vec3;
use protocol::answer::{Body, Cost, Fields};
use protocol::question::{Asked, Rect, Ticket, WorldState};
use scenes::{Camera, Change, Scene};

pub use knob::{Knob, Literal, Panel, Preset, Settings, Slider, Value, Values};
pub use layer::{Channels, Colours, Layer, Plane};
pub use method::{Chosen, Method, NoCheckpoint, preset};

use crate::Picture;
use crate::metrics::Estimate;
use crate::parts::Smoother;
use crate::parts::reproject::Shown;

/// What a front end looks at.
#[derive(Clone, Debug)]
pub struct View {
    /// Questions are about this.
    pub world: WorldState,
    /// The same, as far as the master knows it.
    pub scene: Arc<Scene>,
    /// What answers about it can contain.
    pub fields: Fields,
    /// From where; its size is that of a still picture, and neither side is 0.
    pub camera: Camera,
    /// All randomness comes from it.
    pub seed: u64,
}

/// Decides what to ask about light and makes a picture of the answers. It knows neither workers nor
/// time: who answers, and when, is the caller's business.
pub trait FrontEnd: Send {
    /// Draws another state of the world, or from elsewhere, from now on: from the beginning. What changed since the last
    /// view is in `changes`; [`Open`] says what becomes of the questions that are open.
    fn look(&mut self, view: &View, changes: &[Change]) -> Open;

    /// The next questions, most urgent first, at most `room` of them; fewer or none while enough
    /// is in flight. Every question is asked once: who loses one has to repeat it.
    fn ask(&mut self, room: usize) -> Vec<Asked>;

    /// All open questions were forgotten: they are asked again.
    fn ask_again(&mut self);

    /// What it has absorbed cannot be trusted: it forgets all of it and draws the same from the beginning, without a limit.
    /// Open questions were forgotten; of an [`Interactive`], [`FrontEnd::look`] and [`Interactive::begin`] come next.
    fn begin_again(&mut self);

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

    /// A question will never be answered: workers die of it. What hangs on it stays as it is and is not asked about
    /// again; the rest goes on.
    fn give_up(&mut self, ticket: Ticket) -> GivenUp;

    /// Parts of the picture that were given up, by whatever process drew before.
    fn gaps(&self) -> Vec<Rect> {
        Vec::new()
    }

    /// A plane as far as it is known; black where it is not, and if the method has no such plane.
    fn show(&mut self, plane: Plane) -> Picture;

    /// Number of complete frames that the picture is made of: batches of questions that were answered whole.
    fn frames(&self) -> u32;

    /// How far the accumulated picture is from its limit, as soon as that can be told.
    fn error(&self) -> Option<Estimate> {
        None
    }

    /// What is known of a pixel; `None` outside the picture, and before anything is known.
    fn probe(&self, _x: u32, _y: u32) -> Option<Probe> {
        None
    }

    /// All that [`Method::resume`] needs to go on with the picture in another process; `None` if the method cannot.
    fn keep(&self) -> Option<Vec<u8>> {
        None
    }
}

/// A front end with people before it: it draws moving pictures, each of a state of its own, as well as they can be had in
/// the time there is, and a still one that sharpens. [`FrontEnd::frames`] and the like are about what is being drawn.
pub trait Interactive: FrontEnd {
    /// Begins with a picture of what was looked at last: a moving one, at this effort, or a still one. Questions that are
    /// open were forgotten, unless [`FrontEnd::look`] said that they are wanted, or it is a moving one that begins behind
    /// others.
    fn begin(&mut self, moving: Option<Effort>);

    /// The moving picture ends as far as it has come, the oldest if there are several: the next [`Self::shot`] is of it, whatever
    /// begins before.
    fn end(&mut self);

    /// Moving pictures that can be under way at a time, each begun behind those before it: what is said of the picture that is
    /// being drawn is said of the oldest then. At least 1.
    fn flight_max(&self) -> usize {
        1
    }

    /// Of the moving pictures under way, the newest that is whole; 0 is the oldest.
    fn whole(&self) -> Option<usize> {
        (self.frames() > 0).then_some(0)
    }

    /// The oldest of several moving pictures is dropped: nobody will see it.
    fn overtake(&mut self) {}

    /// Work of a moving picture, in a unit of the method's own, for a still one of this size: what the pace learns by.
    fn work(&self, camera: &Camera, effort: Effort) -> f64;

    /// Takes other settings.
    fn turn(&mut self, settings: &Settings) -> Turned;

    /// People look at this layer from now on.
    fn inspect(&mut self, layer: &Layer);

    /// The picture that people see now, in the layer that they look at; `None` as long as there is none of any kind.
    fn shot(&mut self, smoother: Option<&dyn Smoother>) -> Option<Shot>;

    /// The last shot's picture and where its points lie, for measuring flicker; `None` if the method cannot tell.
    fn shown(&self) -> Option<&Shown> {
        None
    }

    /// What is shown over the picture that is being drawn, if the layer has marks and they are known.
    fn marks(&self) -> Vec<Mark> {
        Vec::new()
    }

    /// The [`Ticket::batch`] from which on nothing was asked.
    fn next_ticket(&self) -> u32;

    /// What the next moving picture can be made of at once; `None` if it has to wait for its own first batch, as all do of
    /// a method that keeps nothing.
    ///
    /// A moving picture that is made at once ends as soon as it begins. What it asks is for those after it, and what becomes
    /// of its questions is the method's business: [`FrontEnd::absorb`] returns [`Absorbed::Kept`] for them.
    fn stock(&self) -> Option<Stock> {
        None
    }

    /// The picture that is looked at next is a moving one, made at once, with so many of the batches that were answered
    /// whole: the oldest.
    fn take_in(&mut self, _batches: u32) {}

    /// Moving pictures a second that there should be at least, because they wait for nobody.
    fn rate_min(&self) -> f32 {
        0.0
    }

    /// Somebody measures, and hears the steps of moving pictures from now on; returns whether there are any. Only pictures
    /// that are made at once have steps worth measuring.
    fn tell_steps(&mut self, _steps: Steps) -> bool {
        false
    }

    /// What is kept from picture to picture, for measuring; `None`: nothing is.
    fn held(&self) -> Option<Held> {
        None
    }
}

/// What a method keeps from picture to picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Held {
    /// Of these, as in "bytes a patch".
    pub of: &'static str,
    /// How many there are.
    pub count: usize,
    /// What they take, with all that finds them.
    pub bytes: usize,
}

/// Hears what is done for a moving picture: `None` when some steps begin, and the name of each when it is done.
pub type Steps = Box<dyn FnMut(Option<&'static str>) + Send>;

/// What a moving picture can be made of at once, besides what is in the method's memory.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Stock {
    /// Batches that were answered whole and are in no picture yet.
    pub whole: u32,
    /// Batches that were asked and are in no picture yet, those answered whole among them.
    pub open: u32,
    /// Frames of the still picture that it will begin with, as far as they matter to a replay.
    pub still: u32,
}

/// How much of a still picture's work a moving one may take: the share of its pixels, above 0, or work that takes as long; beyond 1,
/// so many times the work on each of them, at most [`crate::live::pace::EFFORT_MAX`]. More: sharper, then less noisy, and fewer
/// pictures a second.
#[derive(Clone, Copy, Debug, PartialEq, PartialOrd)]
pub struct Effort(pub f32);

/// What becomes of open questions when something changes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Open {
    /// Their answers are still of use.
    Wanted,
    /// They can be forgotten.
    Unwanted,
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
    /// It completed what is shown over the picture, and no frame.
    Marked,
    /// Nobody waits for it: it came twice, too late, or for another world, camera or setting.
    Unwanted,
}

/// What became of a question that will never be answered.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum GivenUp {
    /// This part of the picture stays as it is.
    Part(Rect),
    /// No part of the picture hangs on it alone.
    Other,
    /// Nobody waits for its answer.
    Unwanted,
}

/// What other settings change.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Turned {
    /// Everything: the picture is drawn from the beginning.
    Drawn,
    /// How what is known is shown.
    Shown,
    /// Nothing that is seen now.
    Nothing,
}

/// What people see at a moment.
#[derive(Clone, Debug)]
pub struct Shot {
    /// The layer that is looked at, as large as it was drawn; `None` while it is not known, which the picture itself
    /// always is.
    pub picture: Option<Arc<Picture>>,
    /// Complete frames of this state in it.
    pub frames: u32,
    /// Share of its pixels that were drawn for it, 0..=1; the others are from before.
    pub known: f32,
    /// It shows the state that was looked at, at least in part, and not only one before.
    pub is_current: bool,
    /// What is shown over it.
    pub marks: Vec<Mark>,
}

/// Something that a method shows over the picture: a virtual light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mark {
    /// Share of the picture's width, 0..1 from the left.
    pub x: f32,
    /// Share of its height, 0..1 from the top.
    pub y: f32,
    /// How strong it is beside the strongest, 0..=1.
    pub strength: f32,
    /// Surface vertices on its light path; 0 on lamps.
    pub depth: u16,
    /// Something is before it.
    pub hidden: bool,
}

/// Means of all that is known of a pixel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Probe {
    /// Unfiltered, W·m⁻²·sr⁻¹.
    pub radiance: Vec3,
    /// At the eye path's end point, unfiltered, W·m⁻²; 0 where nothing diffuse is seen.
    pub irradiance: Vec3,
    /// Reflectance along the eye path.
    pub reflectance: Vec3,
    /// Unit length; zero where no surface is seen.
    pub normal: Vec3,
    /// Length of the eye path; 0 where no surface is seen.
    pub distance: f32,
}
