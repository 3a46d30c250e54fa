//! Row 54: surfaces that are there in part.

use protocol::question::Quality;

use crate::case::{Case, Method, Pace};
use crate::worlds::coverage;

use Pace::Quick;

/// The cases.
pub const CASES: &[Case] = &[
    Case {
        row: 54,
        name: "sun-through-panes",
        teaches: "a pane that is there to that part lets the rest of the sun through, and of two panes neither knows of the other",
        pace: Quick,
        methods: Method::UNBIASED,
        run: |trial| {
            let trial = trial.roughly();
            // One sun, to which all rays of a point are the same, and nothing else.
            let quality = Quality { light_samples: 1, vpls: 1, photons: 1, importance: false, ..trial.quality() };
            let panes = [0.15, 0.6, 1.0].map(coverage::sun_through_a_pane).into_iter();
            let all = panes.chain([coverage::sun_through_two_panes()]);
            all.map(|exact| trial.agrees(&exact, &quality, exact.radiance)).collect()
        },
    },
    Case {
        row: 54,
        name: "glowing-films",
        teaches: "coverage is factor times texture, cut off or not, and what is not there does not shine",
        pace: Quick,
        methods: Method::UNBIASED,
        run: |trial| coverage::glowing_films().iter().map(|exact| trial.exact(exact)).collect(),
    },
    Case {
        row: 54,
        name: "glowing-dome",
        teaches: "a lamp that is there in part lights as it is seen, directly and over mirrors",
        pace: Quick,
        methods: Method::UNBIASED,
        run: |trial| {
            let (trial, quality) = (trial.roughly(), trial.quality_for(0.5));
            let all = [coverage::glowing_dome(), coverage::glowing_lid()];
            all.map(|exact| trial.agrees(&exact, &quality, exact.radiance)).into()
        },
    },
    Case {
        row: 54,
        name: "thin-furnace",
        teaches: "walls that are there by half reflect, shine and let through, and a furnace stays one",
        pace: Quick,
        methods: Method::UNBIASED,
        run: |trial| vec![trial.agrees(&coverage::thin_furnace(), &trial.quality_for(0.5), 1.0)],
    },
];
