//! What can be set, and what can be looked at.

use glam::Vec3;

use crate::front_end::{Colours, Knob, Layer, Literal, Panel, Plane, Preset, Settings, Slider, Value, Values};

/// How the cache works.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Options {
    /// Samples for each picture; `None`: as many as are answered in its time.
    pub budget: Option<u32>,
    /// Light sets that a vertex is lit by when it is asked about.
    pub sets: u8,
    /// Light sets that a vertex's mean is made of at most.
    pub history: u8,
    /// Probability that a pixel is chosen whatever its priority.
    pub chance: f32,
    pub error: Error,
    pub scale: Scale,
    pub changes: Changes,
    /// What is not matt is kept without its colour, which is known of every pixel.
    pub untinted: bool,
    /// Noise is told from light.
    pub noise: bool,
    /// Corners of triangles that were never divided are not trusted.
    pub tested: bool,
    /// What lies beside finer patches is shown as divided like them.
    pub fitted: bool,
    /// Pictures in which all that changes should be renewed; 0: resolution is not lowered.
    pub clean_up: u32,
}

/// What is taken for the error of a patch.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Error {
    /// How far its vertices differ (2002).
    Contrast,
    /// How far the middles of its parent's edges are from the means of their ends, if it has a parent (ours).
    Curvature,
}

/// How priorities become probabilities.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Scale {
    /// The mean less and plus four deviations are 0 and 1 (2002).
    Deviations,
    /// No error is 0 (ours).
    Worst,
}

/// How changes of light are found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Changes {
    /// By samples taken by chance: what is next to one that has changed, and on the same object, is looked at sooner (2002).
    Found,
    /// After an edit, all that is in sight is looked at again (ours).
    Doubted,
}

/// All that can be set of the cache. The renderer's knobs come after them.
pub(super) const KNOBS: [Knob; 12] = [
    Knob {
        name: "points",
        label: "Samples",
        about: "Samples asked for each moving picture, whatever workers could do: one lights a vertex by a light set. More: \
                what is wrong is right sooner; above what workers can answer, pictures are late.",
        values: Values::Whole { least: 1, most: 1 << 24 },
        unset: Some("as many as are answered in the time of a picture"),
        default: Literal::Unset,
        panel: Panel::Hidden,
    },
    Knob {
        name: "sets",
        label: "Light sets",
        about: "Light sets that a vertex is lit by, the same for all, so that neighbours share their error. More: less of what \
                differs between vertices is noise, and fewer vertices are lit in the same time.",
        values: Values::Whole { least: 1, most: 54 },
        default: Literal::Whole(4),
        panel: Panel::Slider(Slider { least: 1.0, most: 18.0, step: 1.0 }),
        ..Knob::PLAIN
    },
    Knob {
        name: "history",
        label: "History",
        about: "Light sets that a vertex is lit by in the end, where patches are as small as pixels.",
        values: Values::Whole { least: 1, most: 54 },
        default: Literal::Whole(36),
        ..Knob::PLAIN
    },
    Knob {
        name: "chance",
        label: "Chance",
        about: "Probability that a pixel is chosen whatever it is worth, so that nothing stays undiscovered (0.01 to 0.05 in \
                the paper). More: shadows between vertices are found sooner, and what is known to be wrong is right later.",
        values: Values::Real { above: 0.0, most: 1.0 },
        default: Literal::Real(0.03),
        ..Knob::PLAIN
    },
    Knob {
        name: "patch-error",
        label: "Error",
        about: "What is taken for the error of a patch.",
        values: Values::Choice(&[
            (
                "curvature",
                "how far the middles of edges are from the means of their ends: ramps are not divided further",
            ),
            ("contrast", "how far its vertices differ, 2002"),
        ]),
        default: Literal::Word("curvature"),
        ..Knob::PLAIN
    },
    Knob {
        name: "priorities",
        label: "Priorities",
        about: "How errors become probabilities of being chosen.",
        values: Values::Choice(&[
            ("worst", "in proportion, up to four deviations above the mean: what is right is left to chance"),
            ("deviations", "from four deviations below the mean to four above, 2002: what is right has a half"),
        ]),
        default: Literal::Word("worst"),
        ..Knob::PLAIN
    },
    Knob {
        name: "doubt",
        label: "Doubt",
        about: "After an edit ask about all that is in sight again, by the same random numbers. Off: changed light is found by \
                samples taken by chance, and what is on the same object is asked about sooner, 2002.",
        default: Literal::Switch(true),
        ..Knob::PLAIN
    },
    Knob {
        name: "untinted",
        label: "Untinted",
        about: "Keep what glossy surfaces reflect without their colour, which every pixel has of its own: their textures are \
                sharp. Off: as published, textures of what is not matt are as fine as patches.",
        default: Literal::Switch(true),
        ..Knob::PLAIN
    },
    Knob {
        name: "confidence",
        label: "Confidence",
        about: "Tell noise from light by how far light sets are apart at a vertex: where neighbours differ by no more, they are \
                lit by more sets and shown smoothed until then. Off: as published, all that differs is divided.",
        default: Literal::Switch(true),
        ..Knob::PLAIN
    },
    Knob {
        name: "tested",
        label: "Tested",
        about: "Light triangles of few pixels where they are seen, and divide larger ones once: corners often lie within other \
                things, and are black. Off: as published, triangles whose corners are alike are right.",
        default: Literal::Switch(true),
        ..Knob::PLAIN
    },
    Knob {
        name: "fitted",
        label: "Fitted",
        about: "Show patches beside finer ones as divided like them, so that light has no seams. Off: as published, each is \
                shown by its own corners.",
        default: Literal::Switch(true),
        ..Knob::PLAIN
    },
    Knob {
        name: "clean-up",
        label: "Clean-up",
        about: "Pictures in which all that changes should be renewed: patches are joined until it can be. Less: light that \
                changes is coarse and current; more: fine and late. 0: never.",
        values: Values::Whole { least: 0, most: 300 },
        default: Literal::Whole(6),
        ..Knob::PLAIN
    },
];

pub(super) const PRESETS: &[Preset] = &[
    Preset { name: "default", about: "few light sets, curvature, all doubted after an edit", values: &[] },
    Preset {
        name: "paper",
        about: "as published in 2002: vertices lit once and well, contrast, changes found by chance",
        values: &[
            ("sets", Literal::Whole(27)),
            ("history", Literal::Whole(27)),
            ("patch-error", Literal::Word("contrast")),
            ("priorities", Literal::Word("deviations")),
            ("doubt", Literal::Switch(false)),
            ("untinted", Literal::Switch(false)),
            ("confidence", Literal::Switch(false)),
            ("tested", Literal::Switch(false)),
            ("fitted", Literal::Switch(false)),
        ],
    },
];

/// Planes of the last moving picture.
pub(super) const PATCHES: &str = "patches";
pub(super) const PRIORITY: &str = "patch-priority";
pub(super) const CHOSEN: &str = "chosen-pixels";

/// What can be looked at of the cache.
pub(super) const LAYERS: [Layer; 3] = [
    Layer {
        name: PATCHES,
        label: "Patches",
        file: "patches",
        plane: Plane::Own(PATCHES),
        colours: Colours::Plain,
        values: "a colour for each patch",
        ..Layer::FINAL
    },
    Layer {
        name: PRIORITY,
        label: "Patch priority",
        file: "patch-priority",
        plane: Plane::Own(PRIORITY),
        colours: Colours::Ramp { title: "what a patch is worth", unit: "", share: 1.0, grey: true },
        values: "codes of 255, and cycles of age",
        ..Layer::FINAL
    },
    Layer {
        name: CHOSEN,
        label: "Chosen pixels",
        file: "chosen-pixels",
        plane: Plane::Own(CHOSEN),
        colours: Colours::Plain,
        values: "red: by priority; green: by chance; yellow: by flood fill",
        ..Layer::FINAL
    },
];

/// Colours below this are not divided by.
const DARK: f32 = 0.1;

impl Options {
    /// What is kept of light that something not matt reflects, for its colour.
    pub fn kept(&self, reflected: Vec3, colour: Vec3) -> Vec3 {
        if self.untinted { reflected / colour.max(Vec3::splat(DARK)) } else { reflected }
    }

    /// The other way round.
    pub fn reflected(&self, kept: Vec3, colour: Vec3) -> Vec3 {
        if self.untinted { kept * colour.max(Vec3::splat(DARK)) } else { kept }
    }

    /// As the knobs say.
    pub fn of(settings: &Settings) -> Self {
        let is_set = |name: &str| *settings.get(name) != Value::Unset;
        let sets = settings.whole("sets") as u8;
        Self {
            budget: is_set("points").then(|| settings.whole("points")),
            sets,
            history: (settings.whole("history") as u8).max(sets),
            chance: settings.real("chance"),
            error: if settings.word("patch-error") == "contrast" { Error::Contrast } else { Error::Curvature },
            scale: if settings.word("priorities") == "deviations" { Scale::Deviations } else { Scale::Worst },
            changes: if settings.is_on("doubt") { Changes::Doubted } else { Changes::Found },
            untinted: settings.is_on("untinted"),
            noise: settings.is_on("confidence"),
            tested: settings.is_on("tested"),
            fitted: settings.is_on("fitted"),
            clean_up: settings.whole("clean-up"),
        }
    }
}
