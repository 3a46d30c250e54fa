//! The hands: a worker's shell around [`light`]. Threads, shelf and network are here; what to do
//! next is decided in [`protocol::serve`], what light does in [`light`].
//!
//! This room has never heard of pictures, front ends or other workers.
//!
//! [`engine`] is the loop: events in, actions carried out. Two things feed it: [`network`] (a
//! process of its own, over QUIC) and [`embedded`] (a thread within the master).

pub mod craft;
pub mod doctor;
pub mod embedded;
pub mod engine;
mod hands;
pub mod network;
pub mod politeness;
pub mod pulse;
pub mod settings;
pub mod shelf;
