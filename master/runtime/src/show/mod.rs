//! How pictures reach people.

pub mod browser;
#[cfg(feature = "window")]
pub mod gpu;
pub mod tev;
#[cfg(feature = "window")]
pub mod window;
