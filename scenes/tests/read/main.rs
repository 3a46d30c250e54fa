//! Reading scenes: what files mean, what broken ones say, and that nothing panics.

mod attributes;
mod bad_input;
mod daylight;
mod edited;
mod far_away;
mod folder;
mod fuzz;
mod gltf;
mod json;
mod luminaires;
mod materials;
mod motion;
mod obj;
mod shipped;
mod units;
