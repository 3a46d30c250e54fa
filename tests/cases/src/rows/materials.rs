//! Frosted glass, glass that absorbs, glass in part, and sheets that let light through.

use protocol::question::Quality;

use crate::case::{Case, Effort, Finding, Method, Pace, Trial};
use crate::closed_form::Under;
use crate::worlds::glass;
use crate::worlds::materials::{self, House, Shines};

use Method::Igi;
use Pace::Quick;

/// The cases.
pub const CASES: &[Case] = &[
    Case {
        row: 62,
        name: "frosted-plate",
        teaches: "facets reflect and refract what Walter's integrals say, seen from both sides, and never more than all",
        pace: Quick,
        methods: Method::UNBIASED,
        run: |trial| {
            let plates = [
                (0.1, 30.0, false, false, Shines::Sky),
                (0.3, 30.0, false, false, Shines::Walls),
                (0.6, 0.0, false, false, Shines::Sky),
                (0.6, 60.0, true, false, Shines::Walls),
                (0.6, 60.0, true, false, Shines::SkyBefore),
                (0.5, 35.0, false, true, Shines::Walls),
                (0.8, 70.0, false, true, Shines::Sky),
            ];
            let quality = Quality { light_samples: 64, importance: false, ..trial.quality() };
            plates
                .map(|(roughness, angle, thin, inside, shines)| {
                    let exact = materials::frosted_plate(roughness, angle, thin, inside, shines);
                    trial.agrees(&exact, &quality, exact.radiance)
                })
                .into()
        },
    },
    Case {
        row: 62,
        name: "sun-in-frosted-glass",
        teaches: "frosted glass shows the sun behind it, and a floor under it is lit",
        pace: Quick,
        methods: Method::UNBIASED,
        run: |trial| {
            let seen = [(0.3, 5.0), (0.5, 20.0), (0.8, 50.0)].map(|(r, a)| materials::sun_in_a_frosted_sheet(r, a));
            let floor = materials::sun_through_a_frosted_sheet(0.6);
            let quality = Quality { photon_radius: trial.quality().photon_radius * 2.0, ..photons_alone(trial) };
            let lit = rough(trial).agrees(&floor, &quality, floor.radiance);
            seen.iter().map(|exact| trial.exact(exact)).chain([lit]).collect()
        },
    },
    Case {
        row: 62,
        name: "frosted-house",
        teaches: "each path through frosted glass is counted once",
        pace: Quick,
        methods: &[Igi],
        run: |trial| {
            [(true, 0), (true, 1000), (false, 0), (false, 1000)]
                .map(|(thin, photons)| {
                    let exact = materials::house(House::Frosted, thin);
                    trial.agrees(&exact, &Quality { photons, ..trial.quality() }, exact.radiance)
                })
                .into()
        },
    },
    Case {
        row: 70,
        name: "coats",
        teaches: "under a coat no light is made, and a white base or a flat mirror loses none",
        pace: Quick,
        methods: Method::UNBIASED,
        run: |trial| {
            let plates = [
                (1.0, 0.0, 0.0, true, 40.0),
                (1.0, 0.0, 0.5, false, 5.0),
                (1.0, 0.1, 0.8, false, 80.0),
                (0.5, 0.3, 0.1, false, 60.0),
                (1.0, 0.6, 0.3, true, 70.0),
                (1.0, 1.0, 0.6, false, 88.0),
                (1.0, 0.05, 1.0, true, 85.0),
            ];
            let each = plates.iter().flat_map(|(amount, coat, roughness, metal, angle)| {
                let exact = glass::coated_plate(*amount, *coat, *roughness, *metal, *angle);
                let at_most = Finding::holds("no more than all", exact.radiance <= 1.002);
                [trial.exact(&exact), at_most.note(format!("{:.4}", exact.radiance))]
            });
            each.collect()
        },
    },
    Case {
        row: 70,
        name: "lamps-on-coats",
        teaches: "lamps and what they light are seen in a coat and under it, each path once",
        pace: Quick,
        methods: Method::UNBIASED,
        run: |trial| {
            let trial = trial.roughly();
            [(0.0, 0.5, true), (0.5, 0.1, false), (0.3, 0.6, true)]
                .map(|(coat, roughness, metal)| trial.exact(&glass::coat_in_a_furnace(coat, roughness, metal)))
                .into()
        },
    },
    Case {
        row: 77,
        name: "specular-factors",
        teaches: "highlights have their strength at all angles and their colour along the normal, and the base gets the rest",
        pace: Quick,
        methods: Method::UNBIASED,
        run: |trial| {
            let plates = [
                (0.5, 0.5, 10.0, false, 20.0),
                (0.3, 0.3, 0.0, false, 75.0),
                (0.1, 1.0, 40.0, false, 60.0),
                (0.6, 0.5, 20.0, true, 40.0),
                (0.2, 0.3, 1.0, true, 80.0),
            ];
            plates
                .map(|(roughness, amount, grey, white, angle)| {
                    trial.exact(&glass::highlighted_plate(roughness, amount, grey, white, angle))
                })
                .into()
        },
    },
    Case {
        row: 78,
        name: "sheen",
        teaches: "sheen is as bright as its formulas say, makes no light, and leaves the rest to what lies below",
        pace: Quick,
        methods: Method::UNBIASED,
        run: |trial| {
            let plates = [
                (1.0, 0.3, Under::Matt(0.0), 80.0),
                (0.7, 0.5, Under::Matt(0.0), 40.0),
                (1.0, 0.8, Under::Matt(1.0), 60.0),
                (0.5, 0.4, Under::Matt(1.0), 85.0),
                (0.8, 0.5, Under::Metal(0.3), 50.0),
                (1.0, 1.0, Under::Metal(0.05), 20.0),
            ];
            let each = plates.iter().flat_map(|(strength, roughness, under, angle)| {
                let exact = glass::plate_under_sheen(*strength, *roughness, *under, *angle);
                let at_most = Finding::holds("no more than all", exact.radiance <= 1.002);
                [trial.exact(&exact), at_most.note(format!("{:.4}", exact.radiance))]
            });
            each.collect()
        },
    },
    Case {
        row: 78,
        name: "lamps-on-sheen",
        teaches: "lamps and what they light are seen in sheen and below it, each path once",
        pace: Quick,
        methods: Method::UNBIASED,
        run: |trial| {
            let trial = trial.roughly();
            [(0.3, Under::Matt(1.0)), (0.6, Under::Metal(0.3)), (0.8, Under::Metal(0.04))]
                .map(|(roughness, under)| trial.exact(&glass::sheen_in_a_furnace(roughness, under)))
                .into()
        },
    },
    Case {
        row: 71,
        name: "water-in-a-glass",
        teaches: "light goes from glass to water where water reaches into the wall, and takes what the water's length takes",
        pace: Quick,
        methods: Method::UNBIASED,
        run: |trial| {
            let glasses = [(0.0, false), (2.0, false), (0.0, true)];
            let straight = glasses.map(|(sigma, within)| trial.exact(&materials::water_in_a_glass(sigma, within)));
            straight.into_iter().chain([trial.exact(&materials::ball_of_water())]).collect()
        },
    },
    Case {
        row: 71,
        name: "sun-through-water",
        teaches: "the same for the sun's photons",
        pace: Quick,
        methods: &[Igi],
        run: |trial| {
            let photons = photons_alone(trial);
            let quality = Quality { photon_radius: photons.photon_radius * 2.0, ..photons };
            let exact = materials::sun_through_water(3.0);
            vec![rough(trial).agrees(&exact, &quality, exact.radiance)]
        },
    },
    Case {
        row: 63,
        name: "absorbing-glass",
        teaches: "glass takes light by the length of the way within (Beer & Lambert), for eyes, lamps and photons",
        pace: Quick,
        methods: Method::UNBIASED,
        run: |trial| {
            let slabs = [(1.0, 0.0), (3.0, 50.0)].map(|(s, angle)| materials::emitter_behind_a_slab(s, angle));
            let balls = [(0.5, 0.0), (1.0, 30.0)].map(|(s, angle)| materials::ball_that_absorbs(s, angle));
            slabs.iter().chain(&balls).map(|exact| trial.exact(exact)).collect()
        },
    },
    Case {
        row: 63,
        name: "light-through-smoked-glass",
        teaches: "what smoked glass leaves of a sun and of a light within",
        pace: Quick,
        methods: &[Igi],
        run: |trial| {
            let (sun, point) = (materials::sun_through_a_smoked_slab(4.0), materials::light_in_a_smoked_ball(2.0));
            let photons = photons_alone(trial);
            let wide = Quality { photon_radius: photons.photon_radius * 2.0, ..photons };
            [(sun, wide), (point, photons)]
                .map(|(exact, quality)| rough(trial).agrees(&exact, &quality, exact.radiance))
                .into()
        },
    },
    Case {
        row: 64,
        name: "glass-in-part",
        teaches: "of a pane that is glass in part, so much is, for eyes, lamps and suns",
        pace: Quick,
        methods: Method::UNBIASED,
        run: |trial| {
            [
                materials::emitter_behind_glass_in_part(0.45),
                materials::sun_through_glass_in_part(0.45, 30.0),
                materials::sun_through_glass_in_part(0.8, 60.0),
            ]
            .map(|exact| trial.exact(&exact))
            .into()
        },
    },
    Case {
        row: 64,
        name: "house-of-glass-in-part",
        teaches: "each path through glass in part is counted once",
        pace: Quick,
        methods: &[Igi],
        run: |trial| {
            [0, 1000]
                .map(|photons| {
                    let exact = materials::house(House::InPart, true);
                    rough(trial).agrees(&exact, &Quality { photons, ..trial.quality() }, exact.radiance)
                })
                .into()
        },
    },
    Case {
        row: 65,
        name: "paper",
        teaches: "paper sends light on from both sides, and none is lost or counted twice",
        pace: Quick,
        methods: Method::UNBIASED,
        run: |trial| {
            let furnaces = [true, false].map(materials::paper_furnace);
            let lit = [materials::lamp_over_paper(), materials::paper_against_light()];
            furnaces.iter().chain(&lit).map(|exact| trial.exact(exact)).collect()
        },
    },
];

/// For what a few rays in a thousand find.
fn rough<'a>(trial: &Trial<'a>) -> Trial<'a> {
    Trial { effort: Effort::Rough, ..*trial }
}

/// One set with many photons and little else, where photons bring everything.
fn photons_alone(trial: &Trial) -> Quality {
    Quality { photons: 8_000, vpls: 1, light_samples: 1, interleave: [1, 1], importance: false, ..trial.quality() }
}
