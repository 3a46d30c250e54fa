//! A worker's shell around [`light`]. Threads, store of scene parts and network are here; what to do
//! next is decided in [`protocol::serve`], what light does in [`light`].
//!
//! This room has never heard of pictures, front ends or other workers.
//!
//! [`engine`] is the loop: events in, actions carried out. Two things feed it: [`network`] (a
//! process of its own, over QUIC) and [`embedded`] (a thread within the master).

pub mod bits;
pub mod blob_store;
pub mod doctor;
pub mod embedded;
pub mod engine;
pub mod load_policy;
pub mod network;
mod pool;
pub mod pulse;
pub mod renderer;
pub mod settings;
