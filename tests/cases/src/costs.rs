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
const CHEAP: f64 = 0.2;

/// At the usual effort; measured at that which they get, and counted up.
const DEAR: &[(&str, Method, f64)] = &[
    ("lit-from-a-far-wall", Igi, 4.9),
    ("furnace-cube", Bounded, 9.3),
    ("furnace-cube", Paper, 9.3),
    ("furnace-sphere", Reference, 2.2),
    ("concentric-spheres", Igi, 2.2),
    ("concentric-spheres", Bounded, 2.2),
    ("concentric-spheres", Paper, 8.2),
    ("concentric-spheres", Reference, 1.6),
    ("mirror-shaft", Igi, 3.3),
    ("mirror-shaft", Bounded, 3.3),
    ("mirror-shaft", Paper, 6.0),
    ("furnace-corner", Igi, 1.1),
    ("furnace-corner", Bounded, 6.0),
    ("furnace-corner", Paper, 7.1),
    ("furnace-corner-limited", Igi, 4.9),
    ("cie-cube", Bounded, 7.1),
    ("bound-near-wall", Igi, 7.7),
    ("cube-faces", Igi, 9.8),
    ("cube-faces", Bounded, 9.3),
    ("cube-faces", Paper, 9.3),
    ("cube-faces", Reference, 9.3),
    ("light-in-a-corner", Igi, 11.5),
    ("light-in-a-corner", Reference, 8.7),
    ("index-one", Igi, 10.4),
    ("index-one", Bounded, 10.4),
    ("index-one", Reference, 8.2),
    ("facing-mirrors", Igi, 5.5),
    ("facing-mirrors", Reference, 3.8),
    ("light-in-glass", Igi, 5.5),
    ("corridor", Igi, 1.6),
    ("glass-stack", Igi, 3.8),
    ("shared-caustics", Igi, 12.6),
    ("sun-through-panes", Igi, 1.1),
    ("glowing-dome", Igi, 1.6),
    ("hard-suns", Igi, 5.5),
    ("white-lacquer", Igi, 3.8),
    ("mirrored-lamps", Igi, 31.7),
    ("panels-in-mirrors-over-gloss", Igi, 3.5),
    ("metal-in-a-furnace", Igi, 5.5),
    ("metal-in-a-furnace", Reference, 1.1),
    ("whole-metal", Igi, 3.8),
    ("frosted-plate", Igi, 8.7),
    ("sun-in-frosted-glass", Igi, 65.6),
    ("light-through-smoked-glass", Igi, 6.0),
    ("glass-in-part", Igi, 8.2),
    ("house-of-glass-in-part", Igi, 26.2),
    ("paper", Igi, 6.6),
    ("little-far-from-glass", Igi, 1.6),
    ("coats", Igi, 13.1),
    ("coats", Reference, 12.6),
    ("lamps-on-coats", Igi, 6.6),
    ("lamps-on-coats", Reference, 5.5),
    ("specular-factors", Igi, 5.4),
    ("specular-factors", Reference, 2.0),
    ("sheen", Igi, 24.0),
    ("sheen", Reference, 10.0),
    ("lamps-on-sheen", Igi, 17.0),
    ("lamps-on-sheen", Reference, 8.8),
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
