//! Row 65: relief that is finer than the triangles.

use crate::case::{Case, Method, Pace};
use crate::worlds::relief;

/// The cases.
pub const CASES: &[Case] = &[Case {
    row: 65,
    name: "leaning-floors",
    teaches: "a normal map leans a surface along its texture's axes, however the texture lies",
    pace: Pace::Quick,
    methods: Method::UNBIASED,
    run: |trial| relief::leaning_floors().iter().map(|exact| trial.exact(exact)).collect(),
}];
