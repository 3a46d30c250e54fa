//! How pictures reach people who watch.

pub mod browser;
pub mod develop;
mod paint;
pub mod tev;
