//! How light moves. Pure: [`answer()`] is the only door, and what comes out is a function of what
//! goes in, bit for bit, on any machine and any number of threads.
//!
//! This room has never heard of networks, workers or pictures: it is asked about pixels of one light
//! set and answers with reflectance, irradiance, normal and distance; or about path-traced samples, and
//! answers with their sums.
//!
//! # Reading order
//! [`mod@answer`] (a tile, top to bottom) → [`eye`] (eye paths) → [`walk`] (light paths, virtual
//! lights, photons) → [`gather`] (both meet) → [`remainder`] (what the bound cut off) → [`bvh`] (rays).
//! Apart from all that, [`reference`](mod@reference) is the judge: a path tracer.
//!
//! # Numbers
//! Radiometry is `f32`; probabilities over lights are `f64` (a million of them add up). Sums over
//! virtual lights run in the order of the set. Epsilons are relative to coordinates
//! ([`surface::Surfel::epsilon`]), bounds and radii to the scene's diameter, so that scaling a scene by
//! a power of two changes no bit.

pub mod answer;
pub mod bvh;
pub mod emitter;
pub mod eye;
pub mod gather;
pub mod glossy;
pub mod importance;
pub mod photons;
pub mod prepared;
pub mod reference;
pub mod remainder;
pub mod sample;
pub mod shelf;
pub mod sky;
pub mod surface;
pub mod targets;
pub mod texture;
pub mod vpl;
pub mod walk;
pub mod warp;

pub use answer::answer;
pub use prepared::Prepared;
pub use shelf::Shelf;
