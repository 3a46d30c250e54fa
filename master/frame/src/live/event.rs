//! What the loop is told, and what it tells.

use std::collections::BTreeSet;
use std::sync::Arc;

use protocol::answer::{Body, Cost, Fields};
use protocol::question::{Asked, Ticket, WorldState};
use scenes::{Camera, Change, Scene};

use super::QUICK_PIXELS;
use crate::Picture;
use crate::front_end::{Chosen, Effort, Layer, Mark};

/// Microseconds since some beginning.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct Moment(pub u64);

impl Moment {
    /// So many microseconds later; later still for large pictures, which take longer to develop and to send.
    pub(super) fn after(self, micros: u64, pixels: u64) -> Self {
        Self(self.0 + micros * pixels.max(QUICK_PIXELS) / QUICK_PIXELS)
    }
}

/// What is shown to people, as long as it is not about the scene.
#[derive(Clone, Debug, PartialEq)]
pub struct Knobs {
    /// How pictures are made.
    pub method: Chosen,
    /// All randomness comes from it.
    pub seed: u64,
    /// Frames a second that are aimed at while something moves.
    pub rate: f32,
    /// The effort of moving pictures, whatever rate that gives; `None`: the one that holds the rate.
    pub effort: Option<Effort>,
    /// Still frames after which it rests.
    pub rest_after: u32,
    /// What is shown.
    pub layer: Layer,
    /// When moving pictures are made that are made at once, and of what.
    pub making: Making,
}

/// When a moving picture is made that is made at once ([`crate::front_end::Interactive::stock`]), and of what.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Making {
    /// When its time has come, of what has come by then.
    #[default]
    InTime,
    /// A replay: inputs gather, and nothing is made of them yet; the next has so many frames of the still picture.
    Held {
        /// As in [`Ended::still`].
        still: u32,
    },
    /// A replay: of this, as soon as it has come.
    Of {
        /// Batches, as far as so many were asked.
        batches: u32,
        /// Frames of the still picture before it, if there is one.
        still: u32,
    },
}

impl Making {
    /// Frames of the still picture that the next moving one begins with; `None`: as many as there are.
    pub(super) fn still(self) -> Option<u32> {
        match self {
            Self::InTime => None,
            Self::Held { still } | Self::Of { still, .. } => Some(still),
        }
    }
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
    /// Workers are used for something else, or free again. Meanwhile nothing is asked nor drawn; what people do gathers.
    Held(bool),
    /// The workers have been told of a world: in answer to [`Action::Publish`], and once in the beginning.
    Published {
        /// Questions are about this from now on.
        world: WorldState,
        /// The same, as far as the master knows it.
        scene: Arc<Scene>,
        /// What answers can contain.
        fields: Fields,
    },
    /// An answer, as [`crate::FrontEnd::absorb`] takes it.
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
    /// Some answers were wrong, nobody knows which: what is drawn begins again.
    Distrusted,
    /// Somebody looks at the pictures, or nobody does.
    Watched(bool),
    /// A replay: with the moving pictures that are under way, this was done.
    Replayed(Step),
    /// It is later now; see [`super::Live::wake_at`].
    Woke,
}

/// What is to be done.
#[derive(Clone, Debug, PartialEq)]
pub enum Action {
    /// Edit the world; in answer, [`Event::Published`] must come next. Changes that are refused are
    /// left out.
    Publish {
        /// In order.
        changes: Vec<Change>,
        /// Pictures of the world as it was are under way: what they have asked is still to be answered.
        behind: bool,
    },
    /// Forget all open questions.
    Forget,
    /// Forget these.
    Cancel(BTreeSet<Ticket>),
    /// To be recorded: this was done with the moving pictures that are under way.
    Note(Step),
    /// Ask.
    Ask(Vec<Asked>),
    /// Show what [`super::Live::picture`] gives.
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
    /// What the method shows over it, if the layer has marks.
    pub marks: Vec<Mark>,
    /// The oldest input that this is the first picture of, if there was any: people have waited since then.
    pub since: Option<Moment>,
    /// The layer; smaller than the camera's picture while something moves.
    pub picture: Arc<Picture>,
    /// Something moves, and is drawn so.
    pub moving: Option<Effort>,
    /// It is the last picture of its state that is drawn so.
    pub ended: bool,
    /// Complete frames that were accumulated.
    pub frames: u32,
    /// Share of the pixels that were drawn for it, 0..=1; the others are from the last picture.
    pub known: f32,
    /// It rests: nothing more will come.
    pub finished: bool,
}

/// What is done with moving pictures that are under way, besides that the oldest ends: a replay does the same.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Step {
    /// One more was begun behind them, of the newest state.
    Began,
    /// The oldest was overtaken by a newer one: nobody sees it.
    Overtaken,
}

/// A moving picture that has ended: a replay shows the same after as many batches at the same effort.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ended {
    /// At which it was drawn.
    pub effort: Effort,
    /// Complete frames of it: of one that was made at once, those that it was made of; else at least 1, because a replay
    /// waits for the first, which the session may have shown in part.
    pub batches: u32,
    /// Of one that was made at once: frames of the still picture before it, as far as they matter.
    pub still: u32,
}
