//! Methods as flags: which one, a preset of it, and what departs from that. All of it is made of the methods' own
//! descriptions.

use clap::builder::{PossibleValue, PossibleValuesParser};
use clap::error::ErrorKind;
use clap::parser::ValueSource;
use clap::{Arg, ArgAction, ArgMatches, Args, Command, FromArgMatches};
use frame::front_end::{Knob, Literal, Value, Values, preset};
use frame::{Chosen, Filter, Method};
use protocol::question::Quality;

use runtime::methods;

/// A method and its settings, by flags.
#[derive(Clone, Debug, PartialEq)]
pub struct MethodArgs(pub Chosen, Typed);

/// Whether anything was said about the method.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Typed(bool);

impl Default for MethodArgs {
    fn default() -> Self {
        Self(Chosen::new(methods::all()[0]), Typed(false))
    }
}

impl MethodArgs {
    /// Reads flags from text, as they would stand on a command line.
    ///
    /// # Errors
    /// What is wrong with it, for people.
    pub fn from_text(text: &str) -> Result<Self, String> {
        let command = Self::augment_args(Command::new("method").no_binary_name(true).disable_help_flag(true));
        let matches = command.try_get_matches_from(text.split_whitespace());
        let read = matches.and_then(|matches| Self::from_arg_matches(&matches));
        read.map_err(|error| error.to_string().lines().next().unwrap_or_default().to_string())
    }
}

impl MethodArgs {
    /// The method, if anything was said about it.
    pub fn typed(&self) -> Option<&Chosen> {
        let Self(chosen, Typed(is_typed)) = self;
        is_typed.then_some(chosen)
    }

    /// For commands that are about the parts of IGI: its estimator's knobs, and its filter.
    ///
    /// # Errors
    /// In words: another method is chosen.
    pub fn igi(&self) -> Result<(Quality, Filter), String> {
        let Chosen { method, settings } = &self.0;
        let (igi, name) = (frame::methods::igi::IGI.name(), method.name());
        if name == igi {
            return Ok((frame::methods::igi::quality(settings), frame::methods::igi::filter(settings)));
        }
        Err(format!("this is about method {igi}: --method {name} has no parts that are known here"))
    }
}

impl Args for MethodArgs {
    fn augment_args(command: Command) -> Command {
        let mut command = command;
        let heading = "How pictures are made";
        let about = |method: &&dyn Method| PossibleValue::new(method.name()).help(method.about());
        let method = Arg::new(METHOD)
            .long("method")
            .value_name("NAME")
            .help("The method: what is asked of workers, what is kept of their answers, how it is shown.")
            .help_heading(heading)
            .default_value(methods::all()[0].name())
            .value_parser(PossibleValuesParser::new(methods::all().iter().map(about)));
        command = command.arg(method);
        let presets = || methods::all().iter().flat_map(|method| method.presets());
        if presets().next().is_some() {
            // Presets of several methods may have one name.
            let mut abouts: Vec<(&'static str, String)> = Vec::new();
            for method in methods::all() {
                for preset in method.presets() {
                    let about = format!("{}: {}", method.name(), preset.about);
                    match abouts.iter_mut().find(|(name, _)| *name == preset.name) {
                        Some((_, abouts)) => *abouts = format!("{abouts}; {about}"),
                        None => abouts.push((preset.name, about)),
                    }
                }
            }
            let about = |(name, about): (&'static str, String)| PossibleValue::new(name).help(about);
            let preset = Arg::new(PRESET)
                .long("preset")
                .value_name("PRESET")
                .help("Where the method's knobs start from.")
                .help_heading(heading)
                .value_parser(PossibleValuesParser::new(abouts.into_iter().map(about)));
            command = command.arg(preset);
        }
        if presets().any(|preset| preset.name == PAPER) {
            let paper = Arg::new(PAPER)
                .long(PAPER)
                .help("The settings of the method's paper: the same as --preset paper.")
                .help_heading(heading)
                .action(ArgAction::SetTrue)
                .conflicts_with(PRESET);
            command = command.arg(paper);
        }
        let mut known: Vec<&str> = Vec::new();
        for method in methods::all() {
            let heading = format!("Knobs of method {} (each departs from the preset)", method.name());
            for knob in method.knobs() {
                // One flag may be a knob of several methods.
                if !known.contains(&knob.name) {
                    known.push(knob.name);
                    command = command.arg(flag(*method, knob).help_heading(heading.clone()));
                }
            }
        }
        command
    }

    fn augment_args_for_update(command: Command) -> Command {
        Self::augment_args(command)
    }
}

impl FromArgMatches for MethodArgs {
    fn from_arg_matches(matches: &ArgMatches) -> Result<Self, clap::Error> {
        let word = |id: &str| matches.try_get_one::<String>(id).ok().flatten();
        let wrong = |reason: String| clap::Error::raw(ErrorKind::ValueValidation, format!("{reason}\n"));
        let is_typed = |id: &str| matches.value_source(id) == Some(ValueSource::CommandLine);
        let name = word(METHOD).map_or(methods::all()[0].name(), String::as_str);
        let method = methods::find(name).ok_or_else(|| wrong(format!("there is no method {name}")))?;
        let is_paper = matches.try_get_one::<bool>(PAPER).ok().flatten() == Some(&true);
        let chosen_preset = word(PRESET).map(String::as_str).or(is_paper.then_some(PAPER));
        let mut values: Vec<(&str, Value)> = Vec::new();
        if let Some(name) = chosen_preset {
            let preset = preset(method, name);
            let preset = preset.ok_or_else(|| wrong(format!("method {} has no preset {name}", method.name())))?;
            values.extend(preset.iter().map(|(name, value)| (*name, Value::from(*value))));
        }
        for owner in methods::all() {
            for knob in owner.knobs() {
                if !is_typed(knob.name) {
                    continue;
                }
                let Some(own) = method.knobs().iter().find(|own| own.name == knob.name) else {
                    let (flag, owner, method) = (flag_name(knob), owner.name(), method.name());
                    return Err(wrong(format!("--{flag} is a knob of method {owner}, not of {method}")));
                };
                let value = match own.values {
                    Values::Switch => Value::Switch(own.default != Literal::Switch(true)),
                    _ => {
                        let text = word(knob.name).map_or("", String::as_str);
                        let name = knob.name;
                        own.parse(text)
                            .map_err(|reason| wrong(format!("invalid value '{text}' for '--{name}': {reason}")))?
                    }
                };
                values.push((own.name, value));
            }
        }
        let is_said = |id: &str| matches.try_get_raw(id).is_ok_and(|raw| raw.is_some()) && is_typed(id);
        let is_any = !values.is_empty() || [METHOD, PRESET].into_iter().any(is_said);
        Chosen::new(method).with(values).map(|chosen| Self(chosen, Typed(is_any))).map_err(wrong)
    }

    fn update_from_arg_matches(&mut self, matches: &ArgMatches) -> Result<(), clap::Error> {
        *self = Self::from_arg_matches(matches)?;
        Ok(())
    }
}

const METHOD: &str = "method";
const PRESET: &str = "preset";
const PAPER: &str = "paper";

/// What is typed behind the dashes.
fn flag_name(knob: &Knob) -> String {
    if knob.default == Literal::Switch(true) { format!("no-{}", knob.name) } else { knob.name.to_owned() }
}

fn flag(method: &dyn Method, knob: &'static Knob) -> Arg {
    let arg = Arg::new(knob.name).long(flag_name(knob)).help(help(method, knob));
    match knob.values {
        Values::Switch => arg.action(ArgAction::SetTrue),
        Values::Whole { .. } => arg.value_name("N"),
        Values::Real { .. } => arg.value_name("X"),
        Values::Pair { .. } => arg.value_name("NxM"),
        Values::Word { .. } => arg.value_name("WORD"),
        Values::Choice(words) => arg.value_name("WORD").value_parser(PossibleValuesParser::new(
            words.iter().map(|(word, about)| PossibleValue::new(*word).help(*about)),
        )),
    }
}

/// What it means, which values there are, and what the presets have.
fn help(method: &dyn Method, knob: &Knob) -> String {
    let value = |value: Literal| match (value, knob.unset) {
        (Literal::Unset, Some(meaning)) => meaning.to_owned(),
        (value, _) => Value::from(value).to_string(),
    };
    let mut defaults = vec![match knob.values {
        Values::Switch => String::new(),
        _ => value(knob.default),
    }];
    for preset in method.presets() {
        let own = preset.values.iter().find(|(name, _)| *name == knob.name);
        defaults.extend(own.map(|(_, own)| match (knob.values, knob.default == *own) {
            (Values::Switch, is_default) => format!("{}: {}", preset.name, if is_default { "not set" } else { "set" }),
            _ => format!("{}: {}", preset.name, value(*own)),
        }));
    }
    defaults.retain(|text| !text.is_empty());
    let off = if knob.default == Literal::Switch(true) { "Switches off: " } else { "" };
    let defaults = if defaults.is_empty() { String::new() } else { format!(" [{}]", defaults.join(", ")) };
    format!("{off}{}{defaults}", knob.about)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(line: &str) -> Result<Chosen, String> {
        MethodArgs::from_text(line).map(|args| args.0)
    }

    #[test]
    fn presets_and_what_departs_from_them() {
        assert_eq!(read("").unwrap(), Chosen::new(methods::all()[0]));
        assert_eq!(read("--paper").unwrap(), read("--preset paper").unwrap());
        assert_eq!(read("--preset high --vpls 7").unwrap().settings.whole("vpls"), 7);
        assert_eq!(read("--preset high").unwrap().settings.whole("vpls"), 96);
        assert!(!read("--no-importance").unwrap().settings.is_on("importance"));
        assert_eq!(read("--method reference --max-bounces 1").unwrap().settings.whole("max-bounces"), 1);
    }

    #[test]
    fn the_help_names_what_the_presets_have() {
        let command = MethodArgs::augment_args(Command::new("knobs"));
        let help = |name: &str| {
            let argument = command.get_arguments().find(|argument| argument.get_id() == name).expect("it is a knob");
            argument.get_help().expect("it has a text").to_string()
        };
        assert!(help("vpls").ends_with(" [24, draft: 8, high: 96, paper: 18]"), "{}", help("vpls"));
        assert!(help("importance").starts_with("Switches off") && help("importance").ends_with("[paper: set]"));
    }

    #[test]
    fn flags_repeat_the_settings() {
        for line in [
            "",
            "--paper",
            "--preset draft --filter off",
            "--interleave 2x5 --light-samples 3 --vpls 17 --photons 0 --bound none --filter-size 7x7",
            "--bound smooth:0.0125 --no-bias-compensation --no-importance --max-length 9 --fixed-radius --scramble xor",
            "--bound clip --direct-caustics-only --motion fresh --replicates 2 --filter paper",
            "--method reference --max-bounces 3",
            "--method reference",
        ] {
            let first = read(line).unwrap();
            let flags = first.flags().join(" ");
            assert_eq!(first, read(&flags).unwrap(), "{line} became {flags}");
        }
    }

    #[test]
    fn values_out_of_range_and_knobs_of_other_methods_are_refused() {
        for line in [
            "--interleave 0x3",
            "--interleave 17x1",
            "--vpls 0",
            "--light-samples -1",
            "--bound clip:0",
            "--bound none:0.1",
            "--bound soft",
            "--photon-radius nan",
            "--replicates 17",
            "--paper --preset high",
            "--max-length 0",
            "--method unheard-of",
            "--method reference --vpls 3",
            "--method reference --paper",
            "--max-bounces 3",
        ] {
            assert!(read(line).is_err(), "{line}");
        }
        assert_eq!(
            read("--method reference --vpls 3").unwrap_err(),
            "error: --vpls is a knob of method igi, not of reference"
        );
    }
}
