//! Scenes with known answers, built in code: how light *ends up*, from formulas.

pub mod build;
pub mod coverage;
pub mod emitters;
pub mod furnaces;
pub mod glass;
pub mod highlights;
pub mod hunted;
pub mod luminaires;
pub mod materials;
pub mod panes;
pub mod relayed;
pub mod relief;
pub mod skies;
pub mod stress;
pub mod suns;
