//! Row 58: highlights of lights without surface, which no ray that follows a lobe can meet.

use protocol::question::Quality;

use crate::case::{Case, Effort, Finding, Method, Pace, Trial};
use crate::worlds::highlights::{self, Gloss, Lamp, Seen};

/// The cases.
pub const CASES: &[Case] = &[
    Case {
        row: 58,
        name: "highlights",
        teaches: "point, spot and sun are mirrored in gloss of all roughnesses, wherever that is seen",
        pace: Pace::Quick,
        methods: Method::LIGHT,
        run: |trial| {
            [
                (Gloss::Metal(0.3), Lamp::Point, Seen::Directly),
                (Gloss::Lacquer(0.44), Lamp::Spot, Seen::Directly),
                (Gloss::Metal(0.46), Lamp::Sun, Seen::Directly),
                (Gloss::Lacquer(0.3), Lamp::Sun, Seen::InMirror),
                (Gloss::Metal(0.44), Lamp::Spot, Seen::InMetal),
                (Gloss::Metal(0.3), Lamp::Point, Seen::ThroughPane),
            ]
            .map(|(gloss, lamp, seen)| highlight(trial, gloss, lamp, seen))
            .into()
        },
    },
    Case {
        row: 58,
        name: "all-highlights",
        teaches: "the same for every pair of gloss and light, each seen in every way",
        pace: Pace::Long,
        methods: Method::LIGHT,
        run: |trial| {
            let glosses = [Gloss::Metal(0.2), Gloss::Metal(0.44), Gloss::Metal(0.46), Gloss::Lacquer(0.3)];
            let seen = [Seen::Directly, Seen::InMirror, Seen::InMetal, Seen::ThroughPane];
            let mut findings = Vec::new();
            for gloss in glosses {
                for lamp in [Lamp::Point, Lamp::Spot, Lamp::Sun] {
                    findings.extend(seen.map(|seen| highlight(trial, gloss, lamp, seen)));
                }
            }
            findings
        },
    },
    Case {
        row: 58,
        name: "mirrored-lamps",
        teaches: "photons bring highlights of lamps in mirrors, sharp or not",
        pace: Pace::Quick,
        methods: &[Method::Igi],
        run: |trial| {
            let trial = &Trial { effort: Effort::Rough, ..*trial };
            let quality = Quality { photons: 8_000, ..few_lights(trial) };
            [Gloss::Metal(0.4), Gloss::Metal(0.5)]
                .map(highlights::mirrored_lamp)
                .map(|exact| trial.agrees(&exact, &quality, exact.radiance))
                .into()
        },
    },
];

fn highlight(trial: &Trial, gloss: Gloss, lamp: Lamp, seen: Seen) -> Finding {
    let exact = highlights::highlight(gloss, lamp, seen);
    trial.agrees(&exact, &few_lights(trial), exact.radiance)
}

/// All light comes from one place, straight: more would tell no more.
fn few_lights(trial: &Trial) -> Quality {
    Quality { interleave: [1, 1], light_samples: 1, vpls: 1, photons: 0, importance: false, ..trial.quality() }
}
