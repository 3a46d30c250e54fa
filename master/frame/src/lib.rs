//! How pictures are made of answers. Pure: no clock, no socket, no file, no global.
//!
//! A method ([`methods`]) decides what to ask next ([`FrontEnd::ask`]), keeps what comes back
//! ([`FrontEnd::absorb`]) and makes a picture of it ([`FrontEnd::show`]); none knows where workers are. The first,
//! [`methods::igi`], does it so:
//!
//! ```text
//! ask ─► questions … answers ─► absorb ─► Film (raw sums) ─► discontinuity buffer ─► fade ─► tone
//!                                           └─► raw picture, error estimate
//! ```
//!
//! [`measure`] asks about light on a plan instead, and makes figures of it.
//!
//! [`live`] decides when: the interactive loop, with a person at one end and workers at the other.
//!
//! Light is linear and unclamped until [`tone`]. Filtered pictures are never accumulated: the film
//! keeps raw sums only, and its contents are a function of the settings and the number of finished
//! frames alone, whoever answered and in whatever order.

pub mod films;
pub mod front_end;
pub mod live;
pub mod measure;
pub mod methods;
pub mod metrics;
pub mod parts;
pub mod picture;
pub mod tone;

pub use films::Films;
pub use front_end::{
    Absorbed, Answered, Chosen, FrontEnd, Interactive, Layer, Method, NoCheckpoint, Plane, Probe, View,
};
pub use methods::igi::{Igi, Setup};
pub use methods::reference::{Reference, ReferenceSetup, ReferenceState};
pub use parts::Filter;
pub use picture::Picture;
