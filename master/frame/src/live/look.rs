//! What there is to see of what is being drawn, and to know of it.

use std::sync::Arc;

use scenes::{Camera, Change};

use super::{Knobs, Live};
use crate::Picture;
use crate::front_end::{Effort, Mark, Plane, Probe};
use crate::metrics::Estimate;
use crate::parts::Undenoised;
use crate::parts::reproject::Shown;

impl Live {
    /// The layer that people look at: of a still picture all that has come; while something moves, and before there is a
    /// still picture, what was shown last. `None` if nothing was.
    pub fn as_shown(&mut self) -> Option<Arc<Picture>> {
        let layer = self.knobs.layer;
        if self.is_still() && self.front.frames() > 0 {
            return Some(Arc::new(self.front.show(layer.plane)));
        }
        let shown = self.shown.as_ref().filter(|(shown, _)| shown.plane == layer.plane);
        // Between two layers the picture itself may be known all the same.
        let known = || self.front.shown().filter(|_| layer.plane == Plane::Final);
        shown.map(|(_, picture)| Arc::clone(picture)).or_else(|| Some(Arc::clone(&known()?.picture)))
    }

    /// What a denoiser wants to know of the still picture as it is now; `None` while there is none.
    pub fn undenoised(&mut self) -> Option<Undenoised> {
        (self.is_still() && self.front.frames() > 0).then(|| Undenoised::of(self.front.as_mut()))
    }

    /// What the method shows over the current picture, if the layer has marks.
    pub fn marks(&self) -> Vec<Mark> {
        self.front.marks()
    }

    /// What is known of a pixel of the current still picture.
    pub fn probe(&self, x: u32, y: u32) -> Option<Probe> {
        self.front.probe(x, y).filter(|_| self.is_still())
    }

    /// How far the still picture is from its limit.
    pub fn error(&self) -> Option<Estimate> {
        if self.is_still() { self.front.error() } else { None }
    }

    /// A moving picture is being drawn.
    pub fn is_moving(&self) -> bool {
        self.take.as_ref().is_some_and(|take| take.moving.is_some())
    }

    /// Moving pictures that were begun and have not ended.
    pub fn under_way(&self) -> usize {
        usize::from(self.is_waiting()) + self.behind.len()
    }

    /// There are inputs that no picture has begun with.
    pub fn has_news(&self) -> bool {
        self.news.is_some()
    }

    pub(super) fn is_still(&self) -> bool {
        self.take.as_ref().is_some_and(|take| take.moving.is_none())
    }

    /// The still picture has all its frames.
    pub fn is_at_rest(&self) -> bool {
        self.is_still() && self.front.frames() > 0 && self.front.is_finished()
    }

    /// Changes that wait for the next frame.
    pub fn waiting(&self) -> &[Change] {
        &self.changes
    }

    /// From where people look now.
    pub fn camera(&self) -> Camera {
        self.camera
    }

    /// Inputs so far; [`super::Frame::revision`] says how many of them a picture shows.
    pub fn revision(&self) -> u64 {
        self.revision
    }

    /// As they are turned now.
    pub fn knobs(&self) -> &Knobs {
        &self.knobs
    }

    /// How moving pictures are drawn now.
    pub fn effort(&self) -> Effort {
        self.knobs.effort.unwrap_or_else(|| self.pace.effort())
    }

    /// Complete frames of what is being drawn.
    pub fn frames(&self) -> u32 {
        self.front.frames()
    }

    /// The last picture in radiance, if it is of a kind that can be exposed by.
    pub fn last_radiance(&self) -> Option<&Picture> {
        let shown = self.shown.as_ref().filter(|(layer, _)| matches!(layer.plane, Plane::Final | Plane::Raw));
        self.front.shown().map(|shown| &*shown.picture).or(shown.map(|(_, picture)| &**picture))
    }

    /// The last picture and where its points lie, for measuring flicker.
    pub fn shown(&self) -> Option<&Shown> {
        self.front.shown()
    }
}
