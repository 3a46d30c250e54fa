//! Rows from 44 on: what else is stiff or extreme.

use protocol::question::Quality;

use crate::case::{Case, Effort, Finding, Method, Pace, Trial};
use crate::measure;
use crate::worlds::skies::{self, Sun};
use crate::worlds::{emitters, furnaces, glass, hunted};

use Method::{Bounded, Igi};
use Pace::{Long, Quick};

/// The cases.
pub const CASES: &[Case] = &[
    Case {
        row: 44,
        name: "corridor",
        teaches: "a room a hundred times as long as wide, where all that is near is nearer than the bound",
        pace: Quick,
        methods: Method::UNBIASED,
        run: |trial| vec![trial.agrees(&furnaces::corridor(0.5), &trial.quality_for(0.9), 2.0)],
    },
    Case {
        row: 45,
        name: "keyhole",
        teaches: "light through a thousandth of the wall between two rooms",
        pace: Long,
        methods: Method::UNBIASED,
        run: |trial| {
            let exact = hunted::keyhole();
            vec![trial.agrees(&exact, &Quality { light_samples: 1024, ..trial.quality() }, exact.radiance)]
        },
    },
    Case {
        row: 46,
        name: "sun-through-a-window",
        teaches: "the sun's spot on the floor is as bright as it must be",
        pace: Quick,
        methods: Method::LIGHT,
        run: |trial| vec![trial.exact(&hunted::sun_through_a_window()[0])],
    },
    Case {
        row: 46,
        name: "sun-spot-above",
        teaches: "what that spot sends up is found by one light path in hundreds",
        pace: Long,
        methods: &[Igi, Bounded],
        run: |trial| {
            let exact = &hunted::sun_through_a_window()[1];
            vec![trial.agrees(exact, &Quality { vpls: 1024, ..trial.quality() }, exact.radiance)]
        },
    },
    Case {
        row: 47,
        name: "twelve-decades",
        teaches: "radiance 10⁻³ beside a hidden 10⁹",
        pace: Quick,
        methods: Method::UNBIASED,
        run: |trial| {
            let exact = emitters::emitter_beside_a_hidden_sun(1e-3, 1e9);
            vec![trial.agrees(&exact, &Quality { light_samples: 64, ..trial.quality() }, exact.radiance)]
        },
    },
    Case {
        row: 48,
        name: "furnace-of-10000-bounces",
        teaches: "albedo 0.9999: light paths of ten thousand vertices, of which few can be kept",
        pace: Long,
        methods: Method::UNBIASED,
        run: |trial| {
            let exact = furnaces::furnace_sphere(0.9999);
            // A path's strength is its length, which varies by as much as its mean.
            let rough = Trial { effort: Effort::Rough, ..*trial };
            vec![rough.agrees(&exact, &Quality { vpls: 256, ..rough.quality_for(0.9) }, exact.radiance)]
        },
    },
    Case {
        row: 52,
        name: "lamp-in-the-ceiling",
        teaches: "a lamp in the very plane of the ceiling shines, and once, whichever is first in the file",
        pace: Quick,
        methods: Method::LIGHT,
        run: |trial| {
            let quality = Quality { light_samples: 64, ..trial.quality() };
            [true, false]
                .map(hunted::emitter_in_the_ceiling)
                .map(|exact| trial.agrees(&exact, &quality, exact.radiance))
                .into()
        },
    },
    Case {
        row: 55,
        name: "hard-suns",
        teaches: "a sun of one texel, in a picture of any size, on its seam or at its pole, lights as it is interpolated",
        pace: Quick,
        methods: Method::UNBIASED,
        run: |trial| {
            let suns =
                [([1, 1], [0, 0]), ([2, 1], [1, 0]), ([3, 2], [2, 0]), ([16, 8], [0, 0]), ([128, 64], [127, 13])];
            let suns = suns.map(|(size, at)| Sun { size, at });
            let floors = suns.map(skies::sun_on_a_floor);
            // Mirrors turn it round: there it has to be the same all round.
            let wells = [[1, 2], [1, 8]].map(|size| skies::sun_in_a_well(Sun { size, at: [0, 0] }));
            floors.iter().chain(&wells).map(|exact| trial.exact(exact)).collect()
        },
    },
    Case {
        row: 56,
        name: "white-lacquer",
        teaches: "a white base under lacquer reflects all there is, at every angle and roughness",
        pace: Quick,
        methods: Method::UNBIASED,
        run: |trial| {
            let plates = [0.0, 0.05, 0.1, 0.3, 0.6, 1.0]
                .into_iter()
                .flat_map(|roughness| [5.0, 60.0, 85.0, 89.0].map(|angle| glass::lacquered_plate(roughness, angle)));
            plates.map(|exact| trial.exact(&exact)).collect()
        },
    },
    Case {
        row: 61,
        name: "outdoors-unseen",
        teaches: "a plain and a sky outside a closed room change neither its noise nor what it costs",
        pace: Quick,
        methods: &[Igi],
        run: outdoors_unseen,
    },
];

/// Error × rays of the room, and of the same with more outside.
fn outdoors_unseen(trial: &Trial) -> Vec<Finding> {
    let quality = Quality { replicates: 1, ..trial.quality() };
    let [alone, others @ ..] = [(false, false), (true, false), (false, true), (true, true)]
        .map(|(plain, sky)| measure::expense(&hunted::room_with_outdoors(plain, sky), &quality));
    let names = ["a plain", "a sky", "a plain and a sky"];
    let each = names.iter().zip(others).map(|(name, expense)| {
        let ratio = expense / alone;
        Finding::holds(format!("{name} outside: error × rays at most 1.2 of without"), ratio <= 1.2)
            .note(format!("{ratio:.2}"))
    });
    each.collect()
}
