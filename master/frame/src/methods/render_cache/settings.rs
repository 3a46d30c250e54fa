//! What can be set, and what can be looked at.

use super::reconstruct::Filling;
use crate::front_end::{Colours, Knob, Layer, Literal, Panel, Plane, Preset, Settings, Slider, Value, Values};

/// How the cache works.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Options {
    /// Samples for each picture; `None`: as many as are answered in its time.
    pub budget: Option<u32>,
    /// Slots for each pixel.
    pub size: f32,
    /// Samples that a point's mean is made of at most; 1: the last alone.
    pub history: u8,
    pub ages: Ages,
    /// Points of the greatest age go.
    pub evict: bool,
    /// How far behind its surroundings a point may lie, as a share of their distance; `None`: as far as it likes.
    pub cull: Option<f32>,
    pub filling: Filling,
    /// What pixels see is found by the master itself.
    pub guide: bool,
    pub holes: Holes,
    /// How many pictures ahead the camera is predicted; 0: it is not.
    pub predict: u32,
    pub changes: Changes,
    /// Standard deviation of a sample over its mean, as the renderer hints.
    pub noise: f32,
    /// After lamps were edited, light is known anew for all points at once.
    pub relight: bool,
}

/// What makes points older.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Ages {
    /// Every picture (1999).
    Frames,
    /// Every sample that comes (2002).
    Samples,
}

/// What a pixel shows around which nothing is known.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Holes {
    /// The mean of what is known farther away.
    Around,
    /// What it showed before.
    Previous,
    Black,
}

/// How changes of light are found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Changes {
    Ignored,
    /// A resample differs by more than noise (1999).
    Colours,
    /// After an edit, a point is asked again by the same random numbers: noise is the same, too (ours).
    Repeated,
}

/// All that can be set of the cache. The renderer's knobs come after them.
pub(super) const KNOBS: [Knob; 15] = [
    Knob {
        name: "points",
        label: "Samples",
        about: "Samples asked for each moving picture, whatever workers could do. More: what is wrong is right sooner; \
                above what workers can answer, pictures are late.",
        values: Values::Whole { least: 1, most: 1 << 24 },
        unset: Some("as many as are answered in the time of a picture"),
        default: Literal::Unset,
        panel: Panel::Hidden,
    },
    Knob {
        name: "cache-size",
        label: "Cache",
        about: "Points kept for each pixel. More: rooms that were left are remembered, and every picture takes longer.",
        values: Values::Real { above: 0.0, most: 16.0 },
        default: Literal::Real(1.25),
        ..Knob::PLAIN
    },
    Knob {
        name: "history",
        label: "History",
        about: "Samples that the mean of a point is made of; 1: the last one alone, the paper's. More: less noise, and light \
                that changes slowly is late.",
        values: Values::Whole { least: 1, most: 255 },
        default: Literal::Whole(16),
        panel: Panel::Slider(Slider { least: 1.0, most: 64.0, step: 1.0 }),
        ..Knob::PLAIN
    },
    Knob {
        name: "ages",
        label: "Ageing",
        about: "What makes points older. Old points are sampled first.",
        values: Values::Choice(&[
            (
                "samples",
                "every sample that comes: a point that nobody asks about goes when it would be overwritten, 2002",
            ),
            ("frames", "every picture: quick displays age their points sooner than they can be renewed, 1999"),
        ]),
        default: Literal::Word("samples"),
        ..Knob::PLAIN
    },
    Knob {
        name: "evict",
        label: "Evict",
        about: "Points go at the age of 255, 2002. Off: they stay until they are overwritten, so that what was left is known \
                when people come back.",
        ..Knob::PLAIN
    },
    Knob {
        name: "cull",
        label: "Depth cull",
        about: "How far behind the mean distance of its surroundings a point may lie, as a share of it. Less: less shines \
                through gaps, and more is lost at edges. none: nothing is taken away.",
        values: Values::Real { above: 0.0, most: 10.0 },
        unset: Some("nothing is taken away"),
        default: Literal::Real(0.1),
        panel: Panel::Hidden,
    },
    Knob {
        name: "surfaces",
        label: "By surfaces",
        about: "Smooth irradiance alone, within a surface, and fill gaps from one surface. Off: radiance by the paper's 3x3, \
                which blurs textures and edges.",
        default: Literal::Switch(true),
        panel: Panel::Shown,
        ..Knob::PLAIN
    },
    Knob {
        name: "guide",
        label: "Guide",
        about: "Find what each pixel sees by the master itself, where that is matt, and take only light from points: edges, \
                textures and lamps are sharp. Off: edges are as ragged as points lie. Needs --surfaces.",
        default: Literal::Switch(true),
        ..Knob::PLAIN
    },
    Knob {
        name: "sharp",
        label: "Sharp",
        about: "Pixels that show a point show its very colour, without the paper's smoothing; always so with --surfaces.",
        default: Literal::Switch(false),
        ..Knob::PLAIN
    },
    Knob {
        name: "prefilter",
        label: "Prefilter",
        about: "Fill gaps from 7x7 pixels where 3x3 have nothing, 2002.",
        default: Literal::Switch(true),
        ..Knob::PLAIN
    },
    Knob {
        name: "holes",
        label: "Holes",
        about: "What a pixel shows around which nothing is known.",
        values: Values::Choice(&[
            ("around", "the mean of what is known farther away"),
            ("previous", "what it showed before"),
            ("black", "black"),
        ]),
        default: Literal::Word("around"),
        ..Knob::PLAIN
    },
    Knob {
        name: "predict",
        label: "Prediction",
        about: "Pictures ahead that the camera's way is predicted for, so that what will come into view is asked about in \
                time, with half of the samples at most, 2002; 0: not at all. More: for longer ways to the workers.",
        values: Values::Whole { least: 0, most: 30 },
        default: Literal::Whole(2),
        panel: Panel::Slider(Slider { least: 0.0, most: 10.0, step: 1.0 }),
        ..Knob::PLAIN
    },
    Knob {
        name: "changes",
        label: "Changes",
        about: "How changed light is found, so that points around it are sampled sooner.",
        values: Values::Choice(&[
            ("repeated", "after an edit, points are asked again by the same random numbers: what differs has changed"),
            ("colours", "a new sample differs from the old one by more than noise, 1999"),
            ("ignored", "not at all"),
        ]),
        default: Literal::Word("repeated"),
        ..Knob::PLAIN
    },
    Knob {
        name: "noise",
        label: "Noise",
        about: "Standard deviation of a sample over its mean, for --changes colours. Less: noise is taken for change; more: \
                changes go unseen.",
        values: Values::Real { above: 0.0, most: 10.0 },
        default: Literal::Real(0.2),
        ..Knob::PLAIN
    },
    Knob {
        name: "relight",
        label: "Relight",
        about: "After a lamp was edited, foretell the light of all points at once, shadows included, and correct it by the few \
                samples that come. Costs some milliseconds for each edit of a lamp. Off: points keep the light of before \
                until they are sampled again.",
        default: Literal::Switch(true),
        ..Knob::PLAIN
    },
];

pub(super) const PRESETS: &[Preset] = &[
    Preset { name: "default", about: "means of samples, smoothed within surfaces", values: &[] },
    Preset {
        name: "paper",
        about: "as published in 1999 and 2002: the last sample, 3x3, changes by colour",
        values: &[
            ("history", Literal::Whole(1)),
            ("evict", Literal::Switch(true)),
            ("surfaces", Literal::Switch(false)),
            ("guide", Literal::Switch(false)),
            ("holes", Literal::Word("previous")),
            ("changes", Literal::Word("colours")),
            ("relight", Literal::Switch(false)),
        ],
    },
];

/// Planes of the last moving picture.
pub(super) const POINTS: &str = "cache-points";
pub(super) const PRIORITY: &str = "priority";
pub(super) const REQUESTS: &str = "requests";

/// What can be looked at of the cache.
pub(super) const LAYERS: [Layer; 3] = [
    Layer {
        name: POINTS,
        label: "Cached points",
        file: "cached-points",
        plane: Plane::Own(POINTS),
        values: "radiance, W/(m² sr); 0 where no point is seen",
        ..Layer::FINAL
    },
    Layer {
        name: PRIORITY,
        label: "Sampling priority",
        file: "priority",
        plane: Plane::Own(PRIORITY),
        colours: Colours::Ramp { title: "what a sample is worth", unit: "", share: 1.0, grey: true },
        values: "0 to 255: a point's age, or what a gap lacks",
        ..Layer::FINAL
    },
    Layer {
        name: REQUESTS,
        label: "Requested samples",
        file: "requests",
        plane: Plane::Own(REQUESTS),
        colours: Colours::Plain,
        values: "1 where a sample was asked for",
        ..Layer::FINAL
    },
];

impl Options {
    /// As the knobs say.
    pub fn of(settings: &Settings) -> Self {
        let is_set = |name: &str| *settings.get(name) != Value::Unset;
        Self {
            budget: is_set("points").then(|| settings.whole("points")),
            size: settings.real("cache-size"),
            history: settings.whole("history") as u8,
            ages: if settings.word("ages") == "frames" { Ages::Frames } else { Ages::Samples },
            evict: settings.is_on("evict"),
            cull: is_set("cull").then(|| settings.real("cull")),
            filling: Filling {
                sharp: settings.is_on("sharp"),
                prefilter: settings.is_on("prefilter"),
                surfaces: settings.is_on("surfaces"),
            },
            guide: settings.is_on("guide"),
            holes: match settings.word("holes") {
                "previous" => Holes::Previous,
                "black" => Holes::Black,
                _ => Holes::Around,
            },
            predict: settings.whole("predict"),
            changes: match settings.word("changes") {
                "ignored" => Changes::Ignored,
                "colours" => Changes::Colours,
                _ => Changes::Repeated,
            },
            noise: settings.real("noise"),
            relight: settings.is_on("relight"),
        }
    }
}
