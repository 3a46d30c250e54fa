//! Row 67: luminaires with photometric webs.

use glam::Vec3;
use protocol::question::Quality;

use crate::case::{Case, Exact, Finding, Method, Pace, Trial};
use crate::worlds::luminaires;

/// The cases.
pub const CASES: &[Case] = &[
    Case {
        row: 67,
        name: "luminaires",
        teaches: "E = I(C, γ) cosθ / d², however a luminaire is aimed and turned",
        pace: Pace::Quick,
        methods: Method::LIGHT,
        run: |trial| {
            let down = Vec3::NEG_Y;
            // Not straight below: there the planes of this web meet, and each says another thing.
            [
                (Vec3::new(0.1, 1.0, 0.05), down, Vec3::X),
                (Vec3::new(1.0, 1.5, 0.3), down, Vec3::X),
                (Vec3::new(-1.0, 1.0, 0.5), Vec3::new(0.5, -1.0, 0.2), Vec3::Z),
                (Vec3::new(0.4, 2.0, -1.0), Vec3::Y, Vec3::new(1.0, 1.0, 1.0)),
            ]
            .map(|(to, aim, side)| trial.exact(&luminaires::above(to, aim, side)))
            .into()
        },
    },
    Case {
        row: 67,
        name: "luminaire-in-a-ball",
        teaches: "all of a luminaire's flux goes round: light leaves it as its web says",
        pace: Pace::Quick,
        methods: Method::UNBIASED,
        run: |trial| {
            let towards = [Vec3::new(0.3, -1.0, 0.2), Vec3::new(0.2, 1.0, -0.3)];
            towards.map(|towards| many(trial, &luminaires::in_a_ball(0.5, towards))).into()
        },
    },
    Case {
        row: 67,
        name: "luminaire-in-a-mirror",
        teaches: "a path tracer aims at the image of a luminaire, which shines that way as its web says",
        pace: Pace::Quick,
        methods: &[Method::Reference],
        run: |trial| vec![trial.exact(&luminaires::mirrored(Vec3::new(0.5, 1.0, 0.25)))],
    },
];

fn many(trial: &Trial, exact: &Exact) -> Finding {
    let quality = Quality { vpls: 64, ..trial.quality() };
    trial.agrees(exact, &quality, exact.radiance)
}
