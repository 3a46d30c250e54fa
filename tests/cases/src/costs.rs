//! What cases take, measured once: to say how long a table will take, and which rows to ask roughly.

use crate::case::{Effort, Method};

use Method::{Bounded, Igi, Paper, Reference};

/// Seconds of one core, about, on a machine with AVX2.
pub fn of(case: &str, method: Method, effort: Effort) -> f64 {
    usual(case, method)
        * match effort {
            Effort::Rough | Effort::Brief => 0.3,
            Effort::Usual => 1.0,
            // A quarter of the variance, where so many rays are allowed.
            Effort::Thorough => 3.0,
            Effort::Long => 12.0,
        }
}

/// The effort that a row gets: where that is the usual one, dear rows are asked briefly, so that the whole table takes
/// two minutes on two cores.
pub fn affordable(case: &str, method: Method, effort: Effort) -> Effort {
    let is_dear = usual(case, method) > DEAR_FROM;
    if effort == Effort::Usual && is_dear { Effort::Brief } else { effort }
}

/// Seconds of one core at the usual effort.
fn usual(case: &str, method: Method) -> f64 {
    DEAR.iter().find(|dear| (dear.0, dear.1) == (case, method)).map_or(CHEAP, |dear| dear.2)
}

/// What takes longer, seconds, is asked briefly.
const DEAR_FROM: f64 = 5.0;

/// All others, in the mean.
const CHEAP: f64 = 0.4;

/// At the usual effort.
const DEAR: &[(&str, Method, f64)] = &[
    ("furnace-cube", Bounded, 2.3),
    ("furnace-sphere", Reference, 4.4),
    ("concentric-spheres", Igi, 2.7),
    ("concentric-spheres", Bounded, 2.6),
    ("concentric-spheres", Paper, 21.0),
    ("concentric-spheres", Reference, 3.0),
    ("mirror-shaft", Igi, 13.0),
    ("mirror-shaft", Bounded, 13.0),
    ("mirror-shaft", Paper, 38.0),
    ("furnace-corner", Igi, 2.9),
    ("furnace-corner", Bounded, 3.4),
    ("furnace-corner", Paper, 4.3),
    ("furnace-corner-limited", Igi, 5.4),
    ("bound-near-wall", Igi, 5.1),
    ("sun-through-a-slab", Igi, 33.0),
    ("sun-through-a-slab", Paper, 4.0),
    ("light-in-a-corner", Igi, 5.0),
    ("light-in-a-corner", Reference, 5.0),
    ("index-one", Igi, 23.0),
    ("index-one", Bounded, 23.0),
    ("index-one", Reference, 17.0),
    ("facing-mirrors", Igi, 16.0),
    ("light-in-glass", Igi, 100.0),
    ("corridor", Igi, 3.8),
    ("shared-caustics", Igi, 27.0),
    ("glowing-dome", Igi, 26.0),
    ("lit-from-a-far-wall", Igi, 10.0),
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_listed_is_in_the_table() {
        let cases = crate::all();
        for (name, method, _) in DEAR {
            let case = cases.iter().find(|case| case.name == *name);
            assert!(case.is_some_and(|case| case.methods.contains(method)), "{name} by {}", method.name());
        }
    }
}
