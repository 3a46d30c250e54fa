//! The parts front ends are made of. Each is a function or a small structure that knows nothing of
//! the others' insides.

mod appearance;
mod batches;
mod calm;
pub mod checkpoint;
mod denoised;
mod discontinuity;
mod elsewhere;
mod fade;
mod film;
pub mod order;
mod planes;
pub mod raster;
pub mod reproject;
mod tiling;

pub use appearance::{Appearance, Finish, sky};
pub use batches::{Batches, Slot};
pub use denoised::Undenoised;
pub use discontinuity::{Edges, Filter};
pub use elsewhere::{Guide, Smoother};
pub use fade::{shown, smoothed, smoothed_by};
pub use film::{Film, Light, Sample};
pub use tiling::Tiling;
