//! How light moves. Pure: [`answer()`] is the only door, and what comes out is a function of what
//! goes in, bit for bit, on any machine and any number of threads.
//!
//! This room has never heard of networks, workers or pictures: it is asked about pixels of one light
//! set and answers with reflectance, irradiance, normal and distance; about path-traced samples, and answers with
//! their sums; or about single rays ([`rays`]) and single points of surfaces ([`points`]), for those who keep what they know.
//!
//! # Reading order
//! [`mod@answer`] (a tile, top to bottom) → [`eye`] (eye paths) → [`edges`] (where lamps end) → [`walk`] (light paths, virtual
//! lights) → [`caustics`] (photons) → [`through_glass`] (lamps behind
//! panes) → [`gather`] (all meet) → [`bias_compensation`] (what the bound cut off) → [`bvh`] (rays).
//! Apart from all that, [`reference`](mod@reference) is the path tracer that everything else is compared with.
//!
//! # Numbers
//! * **`f32`**: radiometry, geometry, densities. A sample has 24 bits; what has more is their sum, which is made
//!   elsewhere, in `f64`.
//! * **`f64`**: the table of light choices (a million probabilities add up to 1, [`emitter`]) and its number, of
//!   48 bits; sums of the environment's rows ([`sky`]); photon cells, in `i64` from `f64` ([`photons`]: a cell is a
//!   coordinate over a radius, which `f32` cannot count beyond 2²⁴); the reference's moments
//!   ([`reference`](mod@reference)).
//! * **Order of sums**: over virtual lights in the order of the set; over photons by cell, then by number; nothing is
//!   added in the order in which threads finish.
//! * **Lengths**: an offset off a surface is 2⁻¹⁹ of the largest coordinate of its triangle
//!   ([`surface::Surfel::epsilon`]), and only rays start there: cosines and distances are taken on the surface
//!   itself. Two points are one below 8 units in the last place ([`vpl::tiny`]). Bounds and radii are fractions of the
//!   extent of what lights the view ([`importance`]). So no epsilon has a unit, and scaling a scene by a power of two changes no bit.
//! * **Pure numbers**: what remains of the form `max(1e-4)` guards a division by a cosine or a probability.

pub mod aims;
pub mod answer;
pub mod bias_compensation;
pub mod bvh;
pub mod cache;
pub mod caustics;
pub mod chain;
pub mod edges;
pub mod emitter;
pub mod eye;
pub mod facets;
pub mod footprint;
pub mod frosted;
pub mod gather;
pub mod glossy;
pub mod importance;
pub mod lobe;
mod lobe_pilot;
pub mod luminaire;
mod mirrors;
pub mod panes;
pub mod photons;
pub mod pilot;
pub mod points;
pub mod prepared;
mod rays;
pub mod reference;
mod relief;
pub mod sample;
pub mod sky;
pub mod sun;
pub mod surface;
pub mod targets;
pub mod through_glass;
pub mod vpl;
pub mod walk;
pub mod warp;

pub use answer::{answer, check};
pub use cache::LightSetCache;
pub use prepared::Prepared;
