//! How different two pictures are, and how sure a mean is.

mod confidence;

pub use confidence::{Estimate, Spread};

/// Keeps relative errors finite where the reference is black.
pub const RELATIVE_FLOOR: f64 = 0.01;
