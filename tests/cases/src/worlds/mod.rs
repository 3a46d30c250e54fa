//! Scenes with known answers, built in code: how light *ends up*, from formulas.

pub mod build;
pub mod coverage;
pub mod furnaces;
pub mod glass;
pub mod hunted;
pub mod lamps;
pub mod skies;
pub mod stress;
