//! How pictures reach people who watch.

pub mod browser;
pub mod develop;
#[cfg(feature = "window")]
pub mod gpu;
pub mod paint;
pub mod tev;
#[cfg(feature = "window")]
pub mod window;
