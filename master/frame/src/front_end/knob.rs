//! The settings of a method as data: what can be set, within which range, what more and less of it cost. The command
//! line, its help, the panels of browser and window, recordings, metadata and reports all read it from here.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

/// Something that can be set.
#[derive(Clone, Copy, Debug)]
pub struct Knob {
    /// By which command line (`--name`), recordings and messages know it; unique within a method.
    pub name: &'static str,
    /// For panels, two words at most.
    pub label: &'static str,
    /// What it means, and what more and less of it cost; a sentence or two.
    pub about: &'static str,
    /// Which values there are.
    pub values: Values,
    /// It may be left unset ([`Value::Unset`]); what that means, in a word or two.
    pub unset: Option<&'static str>,
    /// The value, if nothing is said.
    pub default: Literal,
    /// Whether people who watch can set it.
    pub panel: Panel,
}

/// A knob's place in the panels of browser and window.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Panel {
    /// None: it is set on the command line.
    Hidden,
    /// A box to tick for a switch, a list to choose from for a choice.
    Shown,
    /// A slider, for numbers.
    Slider(Slider),
}

/// Which values a knob can have.
#[derive(Clone, Copy, Debug)]
pub enum Values {
    /// A whole number.
    Whole {
        /// The least.
        least: u32,
        /// The greatest.
        most: u32,
    },
    /// A number above `above`, at most `most`.
    Real {
        /// It must be greater than this.
        above: f32,
        /// The greatest.
        most: f32,
    },
    /// On or off. On the command line `--name` switches on what is off by default, and `--no-name` off what is on.
    Switch,
    /// One of these words, each with what it means.
    Choice(&'static [(&'static str, &'static str)]),
    /// Columns and rows, `NxM`.
    Pair {
        /// The least of either.
        least: u32,
        /// The greatest of either.
        most: u32,
    },
    /// A word that only the method understands.
    Word {
        /// How it is written, for the help.
        form: &'static str,
        /// Says what is wrong with it.
        check: fn(&str) -> Result<(), String>,
    },
}

/// Where a panel's slider begins and ends, which may be less than what the knob can have.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Slider {
    /// Its left end.
    pub least: f32,
    /// Its right end.
    pub most: f32,
    /// Between two of its values.
    pub step: f32,
}

/// The value of a knob.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum Value {
    /// `null`: left to the method.
    Unset,
    /// On or off.
    Switch(bool),
    /// A whole number.
    Whole(u32),
    /// Any number.
    Real(f32),
    /// Columns and rows.
    Pair([u32; 2]),
    /// A word.
    Word(String),
}

/// A [`Value`] that stands in the program.
#[derive(Clone, Copy, Debug, PartialEq)]
#[expect(missing_docs, reason = "as in `Value`")]
pub enum Literal {
    Unset,
    Switch(bool),
    Whole(u32),
    Real(f32),
    Pair([u32; 2]),
    Word(&'static str),
}

impl From<Literal> for Value {
    fn from(literal: Literal) -> Self {
        match literal {
            Literal::Unset => Self::Unset,
            Literal::Switch(on) => Self::Switch(on),
            Literal::Whole(n) => Self::Whole(n),
            Literal::Real(x) => Self::Real(x),
            Literal::Pair(pair) => Self::Pair(pair),
            Literal::Word(word) => Self::Word(word.into()),
        }
    }
}

/// Named values of several knobs.
#[derive(Clone, Copy, Debug)]
pub struct Preset {
    /// As in `--preset NAME`.
    pub name: &'static str,
    /// What it is for, a sentence.
    pub about: &'static str,
    /// Those that depart from the defaults.
    pub values: &'static [(&'static str, Literal)],
}

/// A value for every knob of a method; in files a JSON object.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(transparent)]
pub struct Settings(BTreeMap<&'static str, Value>);

impl Knob {
    /// What tables leave unsaid: a switch that is off and has no control.
    pub const PLAIN: Self = Self {
        name: "",
        label: "",
        about: "",
        values: Values::Switch,
        unset: None,
        default: Literal::Switch(false),
        panel: Panel::Hidden,
    };

    /// A value as this knob has it: whole numbers are numbers, too.
    ///
    /// # Errors
    /// In words, what it wants instead.
    pub fn take(&self, value: Value) -> Result<Value, String> {
        let wrong = || format!("{} wants {}", self.name, self.wanted());
        let value = match (self.values, value) {
            (_, Value::Unset) if self.unset.is_some() => Value::Unset,
            (Values::Whole { least, most }, Value::Whole(n)) if (least..=most).contains(&n) => Value::Whole(n),
            (Values::Real { above, most }, Value::Real(x)) if x > above && x <= most => Value::Real(x),
            (Values::Real { above, most }, Value::Whole(n)) if n as f32 > above && n as f32 <= most => {
                Value::Real(n as f32)
            }
            (Values::Switch, Value::Switch(on)) => Value::Switch(on),
            (Values::Choice(words), Value::Word(word)) => {
                words.iter().find(|(known, _)| *known == word).ok_or_else(wrong)?;
                Value::Word(word)
            }
            (Values::Pair { least, most }, Value::Pair(pair))
                if pair.iter().all(|side| (least..=most).contains(side)) =>
            {
                Value::Pair(pair)
            }
            (Values::Word { check, .. }, Value::Word(word)) => {
                check(&word).map_err(|reason| format!("{}: {reason}", self.name))?;
                Value::Word(word)
            }
            _ => return Err(wrong()),
        };
        Ok(value)
    }

    /// A value as it is typed.
    ///
    /// # Errors
    /// In words, what it wants instead.
    pub fn parse(&self, text: &str) -> Result<Value, String> {
        let wrong = || format!("expected {}", self.wanted());
        let value = match self.values {
            _ if text == "none" && self.unset.is_some() => Value::Unset,
            Values::Whole { .. } => Value::Whole(text.parse().map_err(|_| wrong())?),
            Values::Real { .. } => Value::Real(text.parse().map_err(|_| wrong())?),
            Values::Switch => Value::Switch(text.parse().map_err(|_| wrong())?),
            Values::Choice(_) | Values::Word { .. } => Value::Word(text.to_owned()),
            Values::Pair { .. } => {
                let (a, b) = text.split_once(['x', 'X']).ok_or_else(wrong)?;
                Value::Pair([a.parse().map_err(|_| wrong())?, b.parse().map_err(|_| wrong())?])
            }
        };
        self.take(value)
            .map_err(|reason| reason.strip_prefix(&format!("{}: ", self.name)).map_or_else(wrong, str::to_owned))
    }

    /// The values there are, in words.
    pub fn wanted(&self) -> String {
        let values = match self.values {
            Values::Whole { least, most } => format!("a whole number from {least} to {most}"),
            Values::Real { above, most } if most == f32::MAX => format!("a number above {above}"),
            Values::Real { above, most } => format!("a number above {above} and at most {most}"),
            Values::Switch => "true or false".into(),
            Values::Choice(words) => {
                format!("one of {}", words.iter().map(|(word, _)| *word).collect::<Vec<_>>().join(", "))
            }
            Values::Pair { least, most } => {
                let example = least.max(3).min(most);
                format!("two numbers from {least} to {most}, such as {example}x{example}")
            }
            Values::Word { form, .. } => form.into(),
        };
        if self.unset.is_some() { format!("{values}, or none") } else { values }
    }

    /// The flag that sets a value on the command line; `None` for a switch that is as it is by default.
    pub fn flag(&self, value: &Value) -> Option<String> {
        let name = self.name;
        match value {
            Value::Switch(_) if *value == self.default.into() => None,
            Value::Switch(true) => Some(format!("--{name}")),
            Value::Switch(false) => Some(format!("--no-{name}")),
            value => Some(format!("--{name} {value}")),
        }
    }
}

impl std::fmt::Display for Value {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Unset => f.write_str("none"),
            Self::Switch(on) => f.write_str(if *on { "on" } else { "off" }),
            Self::Whole(n) => n.fmt(f),
            Self::Real(x) => x.fmt(f),
            Self::Pair([a, b]) => write!(f, "{a}x{b}"),
            Self::Word(word) => f.write_str(word),
        }
    }
}

impl Settings {
    /// All knobs at their defaults.
    pub fn new(knobs: &'static [Knob]) -> Self {
        Self(knobs.iter().map(|knob| (knob.name, knob.default.into())).collect())
    }

    /// With other values for some knobs; all others stay as they are.
    ///
    /// # Errors
    /// In words: there is no such knob, or it cannot have that value.
    pub fn with(
        mut self,
        knobs: &'static [Knob],
        values: impl IntoIterator<Item = (impl AsRef<str>, impl Into<Value>)>,
    ) -> Result<Self, String> {
        for (name, value) in values {
            let name = name.as_ref();
            let knob = knobs.iter().find(|knob| knob.name == name);
            let knob = knob.ok_or_else(|| format!("there is no knob called {name:?}"))?;
            self.0.insert(knob.name, knob.take(value.into())?);
        }
        Ok(self)
    }

    /// The value of a knob; [`Value::Unset`] if there is no such knob.
    pub fn get(&self, name: &str) -> &Value {
        self.0.get(name).unwrap_or(&Value::Unset)
    }

    /// The value of a whole number; 0 if it is none.
    pub fn whole(&self, name: &str) -> u32 {
        if let Value::Whole(n) = self.get(name) { *n } else { 0 }
    }

    /// The value of a number; 0 if it is none.
    pub fn real(&self, name: &str) -> f32 {
        if let Value::Real(x) = self.get(name) { *x } else { 0.0 }
    }

    /// The value of a switch.
    pub fn is_on(&self, name: &str) -> bool {
        *self.get(name) == Value::Switch(true)
    }

    /// The value of a word; empty if it is none.
    pub fn word(&self, name: &str) -> &str {
        if let Value::Word(word) = self.get(name) { word } else { "" }
    }

    /// The value of a pair; `None` if it is unset.
    pub fn pair(&self, name: &str) -> Option<[u32; 2]> {
        if let Value::Pair(pair) = self.get(name) { Some(*pair) } else { None }
    }

    /// Names and values, by name.
    pub fn iter(&self) -> impl Iterator<Item = (&'static str, &Value)> {
        self.0.iter().map(|(name, value)| (*name, value))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const fn knob(name: &'static str, values: Values, unset: Option<&'static str>, default: Literal) -> Knob {
        Knob { name, label: name, about: "", values, unset, default, panel: Panel::Hidden }
    }

    fn even(text: &str) -> Result<(), String> {
        if text.len().is_multiple_of(2) { Ok(()) } else { Err("the word is odd".into()) }
    }

    const KNOBS: &[Knob] = &[
        knob("count", Values::Whole { least: 1, most: 16 }, None, Literal::Whole(3)),
        knob("radius", Values::Real { above: 0.0, most: 1.0 }, None, Literal::Real(0.5)),
        knob("fade", Values::Switch, None, Literal::Switch(true)),
        knob("kind", Values::Choice(&[("a", ""), ("b", "")]), None, Literal::Word("a")),
        knob("size", Values::Pair { least: 1, most: 9 }, Some("as it comes"), Literal::Unset),
        knob("word", Values::Word { form: "an even word", check: even }, None, Literal::Word("good")),
    ];

    #[test]
    fn values_are_taken_within_their_range_only() {
        let settings = || Settings::new(KNOBS);
        let with =
            |name: &str, json: &str| settings().with(KNOBS, [(name, serde_json::from_str::<Value>(json).unwrap())]);
        for (name, json) in [
            ("count", "16"),
            ("radius", "1"),
            ("radius", "0.25"),
            ("fade", "false"),
            ("kind", "\"b\""),
            ("size", "[2,9]"),
            ("size", "null"),
            ("word", "\"even\""),
        ] {
            let set = with(name, json).unwrap();
            assert_eq!(serde_json::to_string(set.get(name)).unwrap(), if json == "1" { "1.0" } else { json });
        }
        for (name, json) in [
            ("count", "17"),
            ("count", "0"),
            ("count", "2.5"),
            ("count", "null"),
            ("radius", "0"),
            ("radius", "1.5"),
            ("fade", "1"),
            ("kind", "\"c\""),
            ("size", "[0,9]"),
            ("word", "\"odd\""),
            ("unheard-of", "1"),
        ] {
            assert!(with(name, json).is_err(), "{name} {json}");
        }
    }

    #[test]
    fn flags_say_again_what_was_typed() {
        let of = |name: &str| KNOBS.iter().find(|knob| knob.name == name).unwrap();
        for (name, text) in [("count", "7"), ("radius", "0.125"), ("kind", "b"), ("size", "2x9"), ("size", "none")] {
            assert_eq!(of(name).flag(&of(name).parse(text).unwrap()).unwrap(), format!("--{name} {text}"));
        }
        assert_eq!(of("fade").flag(&Value::Switch(false)).unwrap(), "--no-fade");
        assert_eq!(of("fade").flag(&Value::Switch(true)), None);
        assert_eq!(of("word").parse("odd").unwrap_err(), "the word is odd");
        assert_eq!(of("count").parse("x").unwrap_err(), "expected a whole number from 1 to 16");
    }
}
