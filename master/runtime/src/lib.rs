//! What of the master has a network, a clock or files: who answers, who watches, and what is kept. The program is in `master`, and what
//! needs none of these in `frame`.
//!
//! # Reading order
//! [`render_loop`] (the loop from file to file: ask, absorb) and [`live::session`] (the loop with people at the other end) → the library
//! `frame` (what is asked, and how pictures are made) → [`cluster`] (who answers) and [`show::browser`] (where people watch; with the
//! feature `window`, there is also `show::window`).

pub mod checkpoint;
pub mod cluster;
pub mod console;
pub mod denoise;
pub mod display;
pub mod failure;
pub mod files;
pub mod interrupt;
pub mod live;
pub mod memory;
pub mod methods;
pub mod pruning;
pub mod reception;
pub mod relay;
pub mod render_loop;
pub mod series;
pub mod show;
pub mod spoken;
pub mod stats;
pub mod stopwatch;
pub mod threads;
