//! Rows 58 to 61, 72: lights over gloss: highlights of those that no ray which follows a lobe can meet, and of those that one can;
//! illuminance.

use frame::parts::{Film, Light, Sample, Tiling};
use protocol::answer::Fields;
use protocol::question::{Ask, Lit, Quality, Question, Rect, Tile};

use crate::case::{Case, Effort, Exact, Finding, Method, Pace, Trial};
use crate::worlds::glass;
use crate::worlds::highlights::{self, Floor, Gloss, Lamp, Seen};

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
        name: "highlights-of-discs",
        teaches: "light samples and rays share the highlight of a sun with a disc, each path once",
        pace: Pace::Quick,
        methods: Method::UNBIASED,
        run: |trial| {
            [
                (Gloss::Metal(0.3), Seen::Directly),
                (Gloss::Metal(0.46), Seen::Directly),
                (Gloss::Lacquer(0.3), Seen::InMirror),
                (Gloss::Metal(0.44), Seen::InMetal),
                (Gloss::Metal(0.3), Seen::ThroughPane),
            ]
            .map(|(gloss, seen)| highlight(trial, gloss, Lamp::Disc, seen))
            .into()
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
    Case {
        row: 60,
        name: "panels-over-gloss",
        teaches: "light samples and rays share the highlights of lamps, small or large, in lobes narrow or wide, each path once",
        pace: Pace::Quick,
        methods: Method::UNBIASED,
        run: |trial| {
            let quality = Quality { light_samples: 4, ..few_lights(trial) };
            [(0.2, 0.1), (0.3, 0.6), (0.44, 0.1), (0.46, 0.1), (0.46, 0.6), (0.7, 0.6), (1.0, 0.1)]
                .map(|(roughness, half)| highlights::panel(Gloss::Metal(roughness), half))
                .map(|exact| trial.agrees(&exact, &quality, exact.radiance))
                .into()
        },
    },
    Case {
        row: 75,
        name: "panels-in-mirrors-over-gloss",
        teaches: "light samples in mirrors and rays that pass there share a lamp's highlights, each path once",
        pace: Pace::Quick,
        methods: &[Method::Igi],
        run: |trial| {
            let quality = Quality { light_samples: 4, ..few_lights(trial) };
            [(0.2, 0.25), (0.44, 0.1), (0.5, 0.25)]
                .map(|(roughness, half)| highlights::mirrored_panel(Gloss::Metal(roughness), half))
                .map(|exact| trial.agrees(&exact, &quality, exact.radiance))
                .into()
        },
    },
    Case {
        row: 61,
        name: "metal-in-a-furnace",
        teaches: "virtual lights and rays share the light off surfaces in lobes narrow or wide, each path once",
        pace: Pace::Quick,
        methods: Method::UNBIASED,
        run: |trial| {
            [0.3, 0.46, 0.6, 1.0]
                .map(glass::metal_in_a_furnace)
                .map(|exact| trial.agrees(&exact, &trial.quality_for(0.5), exact.radiance))
                .into()
        },
    },
    Case {
        row: 74,
        name: "whole-metal",
        teaches: "with light that meets several facets white metals lose nothing, and grey ones what theory says",
        pace: Pace::Quick,
        methods: Method::UNBIASED,
        run: |trial| {
            let plates = [(0.3, 1.0, 40.0), (0.6, 1.0, 70.0), (1.0, 1.0, 10.0), (1.0, 1.0, 85.0), (1.0, 0.5, 60.0)];
            let under_sky = plates.map(|(roughness, grey, angle)| glass::whole_metal(roughness, grey, angle));
            let rooms = [0.46, 1.0].map(glass::whole_metal_in_a_furnace);
            let on_walls = rooms.map(|exact| trial.agrees(&exact, &trial.quality_for(0.5), exact.radiance));
            under_sky.map(|exact| trial.exact(&exact)).into_iter().chain(on_walls).collect()
        },
    },
    Case {
        row: 59,
        name: "illuminance-on-lacquer",
        teaches: "the illuminance of lacquered surfaces is what falls on them, not what gets through the lacquer",
        pace: Pace::Quick,
        methods: &[Method::Igi],
        run: |trial| {
            [(0.5, 0.1), (0.5, 0.3), (0.8, 0.6)]
                .into_iter()
                .flat_map(|(albedo, roughness)| [Lamp::Point, Lamp::Sun].map(|lamp| (albedo, roughness, lamp)))
                .map(|(albedo, roughness, lamp)| highlights::lamp_over_lacquer(albedo, roughness, lamp))
                .map(|exact| {
                    Finding::exact(&exact.name, exact.radiance, seen_irradiance(&exact, trial), exact.tolerance)
                })
                .collect()
        },
    },
    Case {
        row: 72,
        name: "illuminance-of-anything",
        teaches: "illuminance is what falls on a surface: metal, mirror, glass, and under a coat",
        pace: Pace::Quick,
        methods: &[Method::Igi],
        run: |trial| {
            let floors = [
                (Floor::Metal(0.1), Lamp::Point),
                (Floor::Metal(0.5), Lamp::Sun),
                (Floor::Mirror, Lamp::Point),
                (Floor::Glass, Lamp::Sun),
                (Floor::Coated(0.3), Lamp::Point),
            ];
            let each = floors.map(|(floor, lamp)| highlights::lamp_over(floor, lamp)).map(|exact| {
                let quality = Quality { illuminance: true, ..few_lights(trial) };
                Finding::exact(&exact.name, exact.radiance, irradiance_by(&exact, &quality), exact.tolerance)
            });
            each.into()
        },
    },
];

/// Mean of the irradiance layer after some frames.
fn seen_irradiance(exact: &Exact, trial: &Trial) -> f64 {
    irradiance_by(exact, &few_lights(trial))
}

fn irradiance_by(exact: &Exact, quality: &Quality) -> f64 {
    let (camera, quality) = (exact.scene.camera, *quality);
    let prepared = light::Prepared::new(exact.scene.clone());
    let tiling =
        Tiling { width: camera.width, height: camera.height, tile_width: camera.width, tile_height: camera.height };
    let mut film = Film::new(tiling, 1, Fields::of(&prepared.needs));
    let cache = light::LightSetCache::default();
    let rect = Rect { x: 0, y: 0, width: camera.width, height: camera.height };
    for frame in 0..16 {
        let tile = Tile { camera, rect, lit: Lit { set: 0, frame, seed: 0, quality } };
        let grid = tile.grid();
        let question = Question { world: Default::default(), ask: Ask::Tile(tile) };
        let answer = light::answer(&prepared, &cache, &question, &|| 0);
        let Some(pixels) = answer.body.pixels() else { return f64::NAN };
        film.add(0, 0, &[Sample { grid, light: Light::Frame(pixels) }]);
    }
    let irradiance = film.plane(frame::Plane::Irradiance).pixels;
    irradiance.iter().map(|rgb| f64::from(rgb.x)).sum::<f64>() / irradiance.len() as f64
}

fn highlight(trial: &Trial, gloss: Gloss, lamp: Lamp, seen: Seen) -> Finding {
    let exact = highlights::highlight(gloss, lamp, seen);
    trial.agrees(&exact, &few_lights(trial), exact.radiance)
}

/// All light comes from one place, straight: more would tell no more.
fn few_lights(trial: &Trial) -> Quality {
    Quality { interleave: [1, 1], light_samples: 1, vpls: 1, photons: 0, importance: false, ..trial.quality() }
}
