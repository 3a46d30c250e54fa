//! What can be set, and what can be looked at.

use protocol::question::{Bound, Motion, Quality, Scramble};

use crate::front_end::{Colours, Knob, Layer, Literal, Panel, Preset, Settings, Slider, Value, Values};
use crate::parts::{Edges, Filter};

/// All that can be set. Defaults are those of [`Quality::default`].
pub(super) const KNOBS: &[Knob] = &[
    Knob {
        name: "interleave",
        label: "Interleaving",
        about: "Block of pixels that share no light set. More: smoother once filtered, more preparation.",
        values: Values::Pair { least: 1, most: 16 },
        default: Literal::Pair([3, 3]),
        ..Knob::PLAIN
    },
    Knob {
        name: "light-samples",
        label: "Lights",
        about: "Points on lights per set. More: less noise in direct light; time in proportion.",
        values: Values::Whole { least: 1, most: 4096 },
        default: Literal::Whole(8),
        panel: Panel::Slider(Slider { least: 1.0, most: 64.0, step: 1.0 }),
        ..Knob::PLAIN
    },
    Knob {
        name: "vpls",
        label: "Bounced",
        about: "Virtual point lights per set. More: smoother indirect light; time in proportion.",
        values: Values::Whole { least: 1, most: 4096 },
        default: Literal::Whole(24),
        panel: Panel::Slider(Slider { least: 4.0, most: 256.0, step: 4.0 }),
        ..Knob::PLAIN
    },
    Knob {
        name: "photons",
        label: "Photons",
        about: "Caustic photons per set, at most: fewer where a pilot finds them of less use. 0: rays alone look for caustics. \
                More: sharper caustics sooner.",
        values: Values::Whole { least: 0, most: 10_000_000 },
        default: Literal::Whole(2000),
        panel: Panel::Slider(Slider { least: 0.0, most: 20_000.0, step: 500.0 }),
        ..Knob::PLAIN
    },
    Knob {
        name: "photon-radius",
        label: "Photon radius",
        about: "Radius of photon density estimation in the first frame, as a fraction of the extent of the light that \
                matters to the view. More: smoother caustics, blurred for longer.",
        values: Values::Real { above: 0.0, most: 1.0 },
        default: Literal::Real(1.0 / 150.0),
        ..Knob::PLAIN
    },
    Knob {
        name: "fixed-radius",
        label: "Fixed radius",
        about: "Keep the photon radius: blurs caustics for ever, with less noise.",
        ..Knob::PLAIN
    },
    Knob {
        name: "bound",
        label: "Bound",
        about: "Limits the bright spots near virtual lights: none, clip (the paper's, on distances), geometry (on the \
                geometry term) or smooth (fades lights out as they come near), with the distance as a fraction of the \
                extent of the light that matters to the view (about a room's diagonal), such as clip:0.02.",
        values: Values::Word {
            form: "none, clip, geometry or smooth; the last three with :DISTANCE if you like",
            check,
        },
        default: Literal::Word("geometry:0.1"),
        ..Knob::PLAIN
    },
    Knob {
        name: "bias-compensation",
        label: "Bias compensation",
        about: "Trace what the bound cuts off. Off: faster, and dark in corners for ever.",
        default: Literal::Switch(true),
        ..Knob::PLAIN
    },
    Knob {
        name: "importance",
        label: "Importance",
        about: "Keep virtual lights by what they bring to what the camera sees. Off: lights behind walls are kept, too.",
        default: Literal::Switch(true),
        ..Knob::PLAIN
    },
    Knob {
        name: "max-length",
        label: "Longest path",
        about: "Longest light path, vertices after the light. Less: faster, and light is missing for ever.",
        values: Values::Whole { least: 1, most: 255 },
        unset: Some("Russian roulette ends paths, with no bias"),
        default: Literal::Unset,
        ..Knob::PLAIN
    },
    Knob {
        name: "direct-caustics-only",
        label: "Direct caustics",
        about: "Leave caustics to photons alone, and leave out those of light that was scattered before, as the paper \
                does.",
        ..Knob::PLAIN
    },
    Knob {
        name: "scramble",
        label: "Scrambling",
        about: "Randomisation of the sample sequence.",
        values: Values::Choice(&[("owen", "hashed Owen scrambling"), ("xor", "XOR with a random word, the paper's")]),
        default: Literal::Word("owen"),
        ..Knob::PLAIN
    },
    Knob {
        name: "motion",
        label: "From frame to frame",
        about: "What changes from frame to frame.",
        values: Values::Choice(&[
            ("still", "nothing moves: pixels meet set after set, the sequence goes on"),
            ("moving", "the same light sets in every frame: nothing flickers, nothing converges"),
            ("fresh", "a fresh scramble each frame, the paper's"),
        ]),
        default: Literal::Word("still"),
        ..Knob::PLAIN
    },
    Knob {
        name: "replicates",
        label: "Replicates",
        about: "Independent replicates that take turns, for the error estimate. More: the estimate is surer, the \
                picture a little worse.",
        values: Values::Whole { least: 1, most: 16 },
        default: Literal::Whole(4),
        ..Knob::PLAIN
    },
    Knob {
        name: "filter",
        label: "Smooth",
        about: "How irradiance is smoothed between neighbouring pixels. It fades as samples accumulate.",
        values: Values::Choice(&[
            ("plane", "neighbours in the same plane; fades"),
            ("paper", "the paper's discontinuity buffer: thresholds on distance and normal; never fades"),
            ("off", "every pixel as it is"),
        ]),
        default: Literal::Word("plane"),
        panel: Panel::Shown,
        ..Knob::PLAIN
    },
    Knob {
        name: "filter-size",
        label: "Window",
        about: "Window of the filter. More: smoother, and slower to develop.",
        values: Values::Pair { least: 1, most: 16 },
        unset: Some("the interleaving, which meets every light set once"),
        default: Literal::Unset,
        ..Knob::PLAIN
    },
    Knob {
        name: "steady",
        label: "Steady",
        about: "Moving pictures keep part of the last one's light where it is seen again. Off: they flicker more, and \
                follow faster.",
        default: Literal::Switch(true),
        ..Knob::PLAIN
    },
    Knob {
        name: "fixed-sets",
        label: "Fixed light sets",
        about: "The same light sets in all moving pictures: no flicker, and few lamps stand for all. Off: each picture has its \
                own, and what is seen again is the mean over them, so that light is right, and noisy at first.",
        ..Knob::PLAIN
    },
];

/// Named settings.
pub(super) const PRESETS: &[Preset] = &[
    Preset {
        name: "default",
        about: "looks right from the first frame, and converges to the true solution",
        values: &[],
    },
    Preset {
        name: "draft",
        about: "a quick look: a third of the default's work per frame",
        values: &[("light-samples", Literal::Whole(4)), ("vpls", Literal::Whole(8)), ("photons", Literal::Whole(500))],
    },
    Preset {
        name: "high",
        about: "four times the default's light sources per frame",
        values: &[
            ("light-samples", Literal::Whole(32)),
            ("vpls", Literal::Whole(96)),
            ("photons", Literal::Whole(8000)),
        ],
    },
    Preset {
        name: "paper",
        about: "the paper's: 3x3, 22 shadow rays, 500 photons, path length 4, clipped distances",
        values: &[
            ("light-samples", Literal::Whole(4)),
            ("vpls", Literal::Whole(18)),
            ("photons", Literal::Whole(500)),
            ("photon-radius", Literal::Real(1.0 / 100.0)),
            ("fixed-radius", Literal::Switch(true)),
            ("bound", Literal::Word("clip:0.02")),
            ("bias-compensation", Literal::Switch(false)),
            ("importance", Literal::Switch(false)),
            ("max-length", Literal::Whole(4)),
            ("direct-caustics-only", Literal::Switch(true)),
            ("scramble", Literal::Word("xor")),
            ("motion", Literal::Word("fresh")),
            ("replicates", Literal::Whole(2)),
            ("filter", Literal::Word("paper")),
            ("steady", Literal::Switch(false)),
            ("fixed-sets", Literal::Switch(true)),
        ],
    },
];

/// The picture, with the virtual lights over it.
const LIGHTS: Layer = Layer {
    name: "lights",
    label: "Virtual lights",
    file: "virtual-lights",
    colours: Colours::Light { title: "virtual lights: yellow on lamps, then by reflections; rings are hidden" },
    marks: true,
    ..Layer::FINAL
};

/// All that can be looked at.
pub(super) const LAYERS: &[Layer] = &[
    Layer::FINAL,
    Layer::RAW,
    Layer::LUX,
    Layer::IRRADIANCE,
    Layer::ALBEDO,
    Layer::NORMAL,
    Layer::DISTANCE,
    Layer::SAMPLES,
    Layer::ERROR,
    Layer::WORKER,
    Layer::COST,
    LIGHTS,
];

/// The estimator's knobs, as workers take them.
pub fn quality(settings: &Settings) -> Quality {
    let [n, m] = settings.pair("interleave").unwrap_or([3, 3]);
    Quality {
        interleave: [n as u8, m as u8],
        light_samples: settings.whole("light-samples") as u16,
        vpls: settings.whole("vpls") as u16,
        photons: settings.whole("photons"),
        bound: bound(settings.word("bound")).unwrap_or(Bound::None),
        bias_compensation: settings.is_on("bias-compensation"),
        importance: settings.is_on("importance"),
        max_length: (*settings.get("max-length") != Value::Unset).then(|| settings.whole("max-length") as u8),
        indirect_caustics: !settings.is_on("direct-caustics-only"),
        photon_radius: settings.real("photon-radius"),
        shrink_radius: !settings.is_on("fixed-radius"),
        scramble: if settings.word("scramble") == "xor" { Scramble::Xor } else { Scramble::Owen },
        motion: match settings.word("motion") {
            "moving" => Motion::Moving,
            "fresh" => Motion::Fresh,
            _ => Motion::Still,
        },
        replicates: settings.whole("replicates") as u8,
        illuminance: false,
    }
}

/// How the picture is smoothed.
pub fn filter(settings: &Settings) -> Filter {
    let window = settings.pair("filter-size").or(settings.pair("interleave")).unwrap_or([3, 3]);
    let window = window.map(|side| side as u8);
    match settings.word("filter") {
        "paper" => Filter::paper(window),
        "off" => Filter::OFF,
        _ => Filter::plane(window),
    }
}

/// The values of all knobs that draw so.
pub fn values(quality: &Quality, filter: &Filter, steady: bool) -> Vec<(&'static str, Value)> {
    let bound = match quality.bound {
        Bound::None => "none".into(),
        Bound::Clip { distance } => format!("clip:{distance}"),
        Bound::Geometry { distance } => format!("geometry:{distance}"),
        Bound::Smooth { distance } => format!("smooth:{distance}"),
    };
    let smoothing = match filter.edges {
        None => "off",
        Some(Edges::Thresholds { .. }) => "paper",
        Some(Edges::Planes { .. }) => "plane",
    };
    let word = |word: &str| Value::Word(word.to_owned());
    let window = filter.edges.map_or(Value::Unset, |_| Value::Pair(filter.window.map(u32::from)));
    vec![
        ("interleave", Value::Pair(quality.interleave.map(u32::from))),
        ("light-samples", Value::Whole(quality.light_samples.into())),
        ("vpls", Value::Whole(quality.vpls.into())),
        ("photons", Value::Whole(quality.photons)),
        ("photon-radius", Value::Real(quality.photon_radius)),
        ("fixed-radius", Value::Switch(!quality.shrink_radius)),
        ("bound", Value::Word(bound)),
        ("bias-compensation", Value::Switch(quality.bias_compensation)),
        ("importance", Value::Switch(quality.importance)),
        ("max-length", quality.max_length.map_or(Value::Unset, |length| Value::Whole(length.into()))),
        ("direct-caustics-only", Value::Switch(!quality.indirect_caustics)),
        ("scramble", word(if quality.scramble == Scramble::Xor { "xor" } else { "owen" })),
        (
            "motion",
            word(match quality.motion {
                Motion::Still => "still",
                Motion::Moving => "moving",
                Motion::Fresh => "fresh",
            }),
        ),
        ("replicates", Value::Whole(quality.replicates.into())),
        ("filter", word(smoothing)),
        ("filter-size", window),
        ("steady", Value::Switch(steady)),
        // Whoever knows no other knobs than these knew no others.
        ("fixed-sets", Value::Switch(true)),
    ]
}

fn check(text: &str) -> Result<(), String> {
    bound(text).map(drop)
}

fn bound(text: &str) -> Result<Bound, String> {
    let (kind, distance) = text.split_once(':').map_or((text, None), |(kind, distance)| (kind, Some(distance)));
    let distance = distance.map(fraction).transpose()?;
    let or = |default: f32| distance.unwrap_or(default);
    match kind {
        "none" if distance.is_none() => Ok(Bound::None),
        "clip" => Ok(Bound::Clip { distance: or(0.02) }),
        "geometry" => Ok(Bound::Geometry { distance: or(0.1) }),
        "smooth" => Ok(Bound::Smooth { distance: or(0.1) }),
        _ => Err("expected none, clip, geometry or smooth; the last three with :DISTANCE if you like".to_string()),
    }
}

fn fraction(text: &str) -> Result<f32, String> {
    let number: f32 = text.parse().map_err(|_| "the distance is no number".to_string())?;
    if number > 0.0 && number <= 1.0 { Ok(number) } else { Err("the distance must be above 0 and at most 1".into()) }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn preset(name: &str) -> Settings {
        let values = PRESETS.iter().find(|preset| preset.name == name).unwrap().values;
        Settings::new(KNOBS).with(KNOBS, values.iter().copied()).unwrap()
    }

    #[test]
    fn presets_are_what_they_say() {
        assert_eq!(quality(&preset("default")), Quality::default());
        assert_eq!(quality(&preset("paper")), Quality::paper());
        assert_eq!(filter(&preset("paper")), Filter::paper([3, 3]));
        assert_eq!(filter(&preset("default")), Filter::plane([3, 3]));
        assert_eq!(
            quality(&preset("high")),
            Quality { light_samples: 32, vpls: 96, photons: 8000, ..Quality::default() }
        );
        assert!(preset("draft").is_on("steady") && !preset("paper").is_on("steady"));
    }

    #[test]
    fn knobs_say_again_what_workers_were_asked() {
        let odd = Quality {
            interleave: [2, 5],
            bound: Bound::Smooth { distance: 0.0125 },
            max_length: Some(9),
            motion: Motion::Moving,
            replicates: 7,
            photon_radius: 0.1,
            ..Quality::paper()
        };
        for given in [Quality::default(), Quality::paper(), odd] {
            for smoothing in [Filter::OFF, Filter::plane(given.interleave), Filter::paper([7, 3])] {
                let settings = Settings::new(KNOBS).with(KNOBS, values(&given, &smoothing, false)).unwrap();
                assert_eq!((quality(&settings), filter(&settings)), (given, smoothing));
                assert_eq!(settings.iter().count(), values(&given, &smoothing, false).len(), "none is left out");
            }
        }
    }

    #[test]
    fn bounds_are_read_or_refused() {
        assert_eq!(bound("clip"), Ok(Bound::Clip { distance: 0.02 }));
        for wrong in ["clip:0", "none:0.1", "soft", "", "clip:", "smooth:nan"] {
            assert!(check(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn every_layer_has_a_name_of_its_own() {
        let mut names: Vec<_> = LAYERS.iter().map(|layer| layer.name).collect();
        names.sort_unstable();
        names.dedup();
        assert_eq!(names.len(), LAYERS.len());
        assert!(LAYERS.iter().all(|layer| layer.marks == (layer.name == "lights")));
    }
}
