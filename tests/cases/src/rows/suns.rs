//! Row 66: suns with a disc.

use protocol::question::Quality;

use crate::case::{Case, Finding, Method, Pace, Trial};
use crate::worlds::{relayed, suns};

/// The cases.
pub const CASES: &[Case] = &[
    Case {
        row: 66,
        name: "suns-with-a-disc",
        teaches: "a disc brings its irradiance, and is seen as bright as that makes it, straight and in mirrors",
        pace: Pace::Quick,
        methods: Method::LIGHT,
        run: |trial| {
            let open = [(30.0, 0.53), (60.0, 40.0), (0.0, 180.0)].map(|(angle, disc)| suns::open(angle, disc));
            let seen = [(0.53, false), (0.53, true), (30.0, true)].map(|(disc, mirror)| suns::seen(disc, mirror));
            open.iter().chain(&seen).map(|exact| many(trial, exact)).collect()
        },
    },
    Case {
        row: 66,
        name: "penumbra",
        teaches: "the edge of a roof hides as much of the sun as stands behind it",
        pace: Pace::Quick,
        methods: Method::LIGHT,
        run: |trial| {
            [(0.53, 0.0), (0.53, 0.002), (20.0, 0.1), (20.0, -0.1)]
                .map(|(disc, x)| many(trial, &suns::penumbra(disc, x)))
                .into()
        },
    },
    Case {
        row: 66,
        name: "discs-through-panes",
        teaches: "a sun with a disc shines through panes like one without, each path counted once",
        pace: Pace::Quick,
        methods: Method::UNBIASED,
        run: |trial| {
            [(1, 30.0, 0.53), (1, 75.0, 0.53), (1, 30.0, 5.0)]
                .map(|(panes, angle, disc)| many(trial, &relayed::disc_through_panes(panes, angle, disc)))
                .into()
        },
    },
];

fn many(trial: &Trial, exact: &crate::case::Exact) -> Finding {
    let quality = Quality { light_samples: 64, importance: false, photons: 0, ..trial.quality() };
    trial.agrees(exact, &quality, exact.radiance)
}
