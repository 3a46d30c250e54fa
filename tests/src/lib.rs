//! Proofs that need several rooms at once; all of them are in `tests/` and `benches/`. Scenes with known
//! answers, and the table of cases that asks about them, are the crate `cases` next door.

pub mod clusters;
pub mod programs;
