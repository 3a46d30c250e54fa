//! How pictures reach people who watch.

pub mod browser;
#[cfg(feature = "window")]
pub mod gpu;
pub mod tev;
#[cfg(feature = "window")]
pub mod window;
