//! Stiff and extreme cases with known answers: one table that `igi-master selftest` prints and
//! `cargo test` runs.
//!
//! A [`Case`] asks a question whose answer is known in closed form, or whose wrong answer is: where a
//! [`Method`] is biased by design, the case expects the *predicted* wrong value. Rows 1 to 43 are the
//! classical ones, those from 44 on our own hunting. Furnaces alone prove little (any direction
//! returns the same value, so wrong ray distributions pass), hence emitters, plates, concentric spheres
//! and glass beside them.
//!
//! # Reading order
//! [`case`] (what a case, a trial and a finding are) → [`measure`] (how pictures are measured, and when
//! it is exact enough) → [`closed_form`] and [`oracle`] (what is expected) → [`worlds`] (what is
//! rendered) → [`rows`] (the table).
//!
//! This room imports all pure rooms and is imported by who runs it. It has no clock and no socket; it
//! writes files only where a row is about reading them.

pub mod case;
pub mod closed_form;
pub mod costs;
pub mod known;
pub mod measure;
pub mod oracle;
pub mod rows;
pub mod worlds;

pub use case::{Case, Effort, Exact, Finding, Method, Pace, Trial, Verdict};
pub use rows::all;
