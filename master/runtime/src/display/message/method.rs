//! The description of the methods there are: panels build themselves from it.

use frame::Method;
use frame::front_end::{Knob, Layer, Panel, Slider, Values};
use serde::{Deserialize, Serialize};

use crate::methods;

/// A method, as far as panels need it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MethodInfo {
    /// As in [`Method::name`].
    pub name: String,
    /// As in [`Method::about`].
    pub about: String,
    /// What panels can set, in order.
    pub knobs: Vec<KnobInfo>,
    /// What can be looked at, in order.
    pub layers: Vec<LayerInfo>,
}

/// A knob with a place in panels.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct KnobInfo {
    /// As in [`Knob::name`].
    pub name: String,
    /// As in [`Knob::label`].
    pub label: String,
    /// As in [`Knob::about`].
    pub about: String,
    /// Which control it gets.
    pub kind: KnobKind,
    /// Of a choice, each with what it means.
    pub words: Vec<[String; 2]>,
    /// Where its slider begins and ends, for numbers.
    pub slider: Option<Slider>,
}

/// The values of a knob that has a place in panels: [`Values`] without those that only the command line can set.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum KnobKind {
    /// [`Values::Whole`].
    Whole,
    /// [`Values::Real`].
    Real,
    /// [`Values::Switch`].
    Switch,
    /// [`Values::Choice`].
    Choice,
}

/// A layer that people can choose.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct LayerInfo {
    /// As in [`Layer::name`].
    pub name: String,
    /// As in [`Layer::label`].
    pub label: String,
}

impl MethodInfo {
    /// All methods, the default one first.
    pub fn all() -> Vec<Self> {
        methods::all().iter().map(|method| Self::of(*method)).collect()
    }

    fn of(method: &dyn Method) -> Self {
        let layer = |layer: &Layer| LayerInfo { name: layer.name.into(), label: layer.label.into() };
        Self {
            name: method.name().into(),
            about: method.about().into(),
            knobs: method.knobs().iter().filter_map(KnobInfo::of).collect(),
            layers: method.layers().iter().map(layer).collect(),
        }
    }
}

impl KnobInfo {
    /// `None` if the knob has no place in panels.
    fn of(knob: &Knob) -> Option<Self> {
        let (kind, words, slider) = match (knob.values, knob.panel) {
            (Values::Whole { .. }, Panel::Slider(slider)) => (KnobKind::Whole, &[][..], Some(slider)),
            (Values::Real { .. }, Panel::Slider(slider)) => (KnobKind::Real, &[][..], Some(slider)),
            (Values::Switch, Panel::Shown) => (KnobKind::Switch, &[][..], None),
            (Values::Choice(words), Panel::Shown) => (KnobKind::Choice, words, None),
            // Others have no control that people could use.
            _ => return None,
        };
        Some(Self {
            name: knob.name.into(),
            label: knob.label.into(),
            about: knob.about.into(),
            kind,
            words: words.iter().map(|(word, about)| [*word, *about].map(Into::into)).collect(),
            slider,
        })
    }
}
