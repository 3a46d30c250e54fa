//! The loop with people: what they do to a scene comes in, pictures go out; sessions and recordings are kept.

mod audience;
mod driver;
pub mod kept;
pub mod measure;
pub mod player;
pub mod record;
mod screen;
pub mod session;
