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
const DEAR_FROM: f64 = 1.0;

/// All others, in the mean.
const CHEAP: f64 = 0.15;

/// At the usual effort.
const DEAR: &[(&str, Method, f64)] = &[
    ("lit-from-a-far-wall", Igi, 2.4),
    ("furnace-cube", Bounded, 1.7),
    ("furnace-cube", Paper, 1.4),
    ("furnace-sphere", Reference, 2.4),
    ("concentric-spheres", Igi, 1.4),
    ("concentric-spheres", Bounded, 1.3),
    ("concentric-spheres", Paper, 9.4),
    ("concentric-spheres", Reference, 1.5),
    ("mirror-shaft", Igi, 2.9),
    ("mirror-shaft", Bounded, 2.9),
    ("mirror-shaft", Paper, 3.1),
    ("furnace-corner", Igi, 1.4),
    ("furnace-corner", Bounded, 1.8),
    ("furnace-corner", Paper, 2.3),
    ("furnace-corner-limited", Igi, 3.5),
    ("cie-cube", Bounded, 1.1),
    ("bound-near-wall", Igi, 6.9),
    ("cube-faces", Igi, 1.4),
    ("cube-faces", Bounded, 1.4),
    ("cube-faces", Paper, 1.3),
    ("cube-faces", Reference, 1.3),
    ("light-in-a-corner", Igi, 2.9),
    ("light-in-a-corner", Reference, 2.3),
    ("index-one", Igi, 11.1),
    ("index-one", Bounded, 10.9),
    ("index-one", Reference, 8.1),
    ("facing-mirrors", Igi, 4.5),
    ("facing-mirrors", Reference, 1.0),
    ("light-in-glass", Igi, 6.7),
    ("corridor", Igi, 1.9),
    ("glass-stack", Igi, 1.0),
    ("shared-caustics", Igi, 12.0),
    ("sun-through-panes", Igi, 2.9),
    ("glowing-dome", Igi, 1.5),
    ("hard-suns", Igi, 4.2),
    ("white-lacquer", Igi, 2.4),
    ("mirrored-lamps", Igi, 9.2),
    ("metal-in-a-furnace", Igi, 3.9),
    ("metal-in-a-furnace", Reference, 1.1),
    ("whole-metal", Igi, 3.0),
    ("frosted-plate", Igi, 8.3),
    ("sun-in-frosted-glass", Igi, 18.0),
    ("light-through-smoked-glass", Igi, 2.3),
    ("glass-in-part", Igi, 8.8),
    ("house-of-glass-in-part", Igi, 8.2),
    ("paper", Igi, 6.7),
    ("little-far-from-glass", Igi, 1.1),
    ("coats", Igi, 3.0),
    ("coats", Reference, 1.8),
    ("lamps-on-coats", Igi, 3.0),
    ("lamps-on-coats", Reference, 1.5),
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
