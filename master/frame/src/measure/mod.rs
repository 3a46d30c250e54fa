//! Measuring light: a grid of points on a plane or a surface, how bright it is there and how sure that is, and lines of equal
//! illuminance; and glare of a view. It says where to ask ([`Plan`], [`Patch`]); whoever asks puts what workers answer into a
//! [`Tally`].
//!
//! This room has never heard of pictures. Words and rules are those of EN 12464-1 and CIE 117.

mod buried;
mod glare;
mod grid;
mod isolux;
mod levels;
mod plan;
mod tally;

pub use glare::{Patch, at_eye, patches, position_index, ugr};
pub use grid::{Grid, counts};
pub use isolux::{Segment, isolines};
pub use levels::{around, between};
pub use plan::{Plan, Target, plan};
pub use tally::{Figures, Measured, Tally};
