//! The estimator's knobs as flags: a preset, and what departs from it.

use clap::{Args, ValueEnum};
use frame::Filter;
use frame::parts::Edges;
use protocol::question::{Bound, Motion, Quality, Scramble};

use super::parse;

/// How much work, which estimator, and how the picture is smoothed.
#[derive(Clone, Debug, Default, Args)]
#[command(next_help_heading = "Quality knobs (each departs from the preset)")]
pub struct Knobs {
    /// Where the other knobs start from.
    #[arg(long, value_enum, default_value_t = Preset::Default)]
    preset: Preset,

    /// The settings of the 2002 paper: the same as --preset paper.
    #[arg(long, conflicts_with = "preset")]
    paper: bool,

    /// Block of pixels that share no light set, up to 16x16. More: smoother once filtered, more
    /// preparation. [all presets: 3x3]
    #[arg(long, value_name = "NxM", value_parser = interleave)]
    interleave: Option<[u8; 2]>,

    /// Points on lights per set. More: less noise in direct light; time in proportion. [draft: 4, default: 8, high: 32,
    /// paper: 4]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=4096))]
    light_samples: Option<u16>,

    /// Virtual point lights per set. More: smoother indirect light; time in proportion. [draft: 8, default: 24, high: 96,
    /// paper: 18]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=4096))]
    vpls: Option<u16>,

    /// Caustic photons per set; 0: rays alone look for caustics. [draft: 500, default: 2000, high: 8000, paper: 500]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(0..=10_000_000))]
    photons: Option<u32>,

    /// Radius of photon density estimation in the first frame, as a fraction of the scene's diameter. [1/150, paper:
    /// 1/100]
    #[arg(long, value_name = "R", value_parser = fraction)]
    photon_radius: Option<f32>,

    /// Keep the photon radius: blurs caustics for ever, with less noise. [paper: on]
    #[arg(long)]
    fixed_radius: bool,

    /// Limits the bright spots near virtual lights: none, clip (the paper's, on distances), geometry (on the geometry
    /// term) or smooth (fades lights out as they come near), with the distance as a fraction of the scene's diameter,
    /// such as clip:0.02. [geometry:0.1, paper: clip:0.02]
    #[arg(long, value_name = "KIND[:D]", value_parser = bound)]
    bound: Option<Bound>,

    /// Do not trace what the bound cuts off: faster, and dark in corners for ever. [paper: on]
    #[arg(long)]
    no_bias_compensation: bool,

    /// Keep lights whether or not the camera sees what they bring. [paper: on]
    #[arg(long)]
    no_importance: bool,

    /// Longest light path, vertices after the light; without it Russian roulette ends paths, with no bias. [paper: 4]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u8).range(1..))]
    max_length: Option<u8>,

    /// Leave caustics to photons alone, and leave out those of light that was scattered before, as the paper does. [paper:
    /// on]
    #[arg(long)]
    direct_caustics_only: bool,

    /// Randomisation of the sample sequence. [owen, paper: xor]
    #[arg(long, value_enum)]
    scramble: Option<ScrambleArg>,

    /// What changes from frame to frame. [still, paper: fresh]
    #[arg(long, value_enum)]
    motion: Option<MotionArg>,

    /// Independent replicates that take turns, for the error estimate, 1 to 16. [4, paper: 2]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u8).range(1..=16))]
    replicates: Option<u8>,

    /// How irradiance is smoothed between neighbouring pixels. It fades as samples accumulate. [plane, paper:
    /// paper]
    #[arg(long, value_enum)]
    filter: Option<FilterKind>,

    /// Window of the filter, up to 16x16. [default: the interleaving, which meets every light set once]
    #[arg(long, value_name = "NxM", value_parser = interleave)]
    filter_size: Option<[u8; 2]>,
}

/// Named settings.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum Preset {
    /// A quick look: a third of the default's work per frame.
    Draft,
    /// Looks right from the first frame, and converges to the true solution.
    #[default]
    Default,
    /// Four times the default's light sources per frame.
    High,
    /// The paper's: 3×3, 22 shadow rays, 500 photons, path length 4, clipped distances.
    Paper,
}

/// How irradiance is smoothed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum FilterKind {
    /// Every pixel as it is.
    Off,
    /// The paper's discontinuity buffer: thresholds on distance and normal; never fades.
    Paper,
    /// Neighbours in the same plane; fades.
    Plane,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum ScrambleArg {
    /// Hashed Owen scrambling.
    Owen,
    /// XOR with a random word, the paper's.
    Xor,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum MotionArg {
    /// Nothing moves: pixels meet set after set, the sequence goes on.
    Still,
    /// The same light sets in every frame: nothing flickers, nothing converges.
    Moving,
    /// A fresh scramble each frame, the paper's.
    Fresh,
}

impl Preset {
    /// The preset's knobs.
    pub fn quality(self) -> Quality {
        let default = Quality::default();
        match self {
            Self::Default => default,
            Self::Draft => Quality { light_samples: 4, vpls: 8, photons: 500, ..default },
            Self::High => Quality { light_samples: 32, vpls: 96, photons: 8000, ..default },
            Self::Paper => Quality::paper(),
        }
    }
}

impl Knobs {
    /// Reads knobs from text, as they would stand on a command line.
    ///
    /// # Errors
    /// What is wrong with it, for people.
    pub fn from_text(text: &str) -> Result<Self, String> {
        #[derive(Debug, clap::Parser)]
        #[command(no_binary_name = true, disable_help_flag = true)]
        struct Only {
            #[command(flatten)]
            knobs: Knobs,
        }
        let only = <Only as clap::Parser>::try_parse_from(text.split_whitespace());
        only.map(|only| only.knobs).map_err(|error| error.to_string().lines().next().unwrap_or_default().to_string())
    }

    /// All knobs of the estimator.
    pub fn quality(&self) -> Quality {
        let mut quality = self.preset().quality();
        let set = |value: &mut bool, flag: bool, to: bool| *value = if flag { to } else { *value };
        quality.interleave = self.interleave.unwrap_or(quality.interleave);
        quality.light_samples = self.light_samples.unwrap_or(quality.light_samples);
        quality.vpls = self.vpls.unwrap_or(quality.vpls);
        quality.photons = self.photons.unwrap_or(quality.photons);
        quality.photon_radius = self.photon_radius.unwrap_or(quality.photon_radius);
        set(&mut quality.shrink_radius, self.fixed_radius, false);
        quality.bound = self.bound.unwrap_or(quality.bound);
        set(&mut quality.bias_compensation, self.no_bias_compensation, false);
        set(&mut quality.importance, self.no_importance, false);
        quality.max_length = self.max_length.or(quality.max_length);
        set(&mut quality.indirect_caustics, self.direct_caustics_only, false);
        quality.replicates = self.replicates.unwrap_or(quality.replicates);
        quality.scramble = self.scramble.map_or(quality.scramble, |scramble| match scramble {
            ScrambleArg::Owen => Scramble::Owen,
            ScrambleArg::Xor => Scramble::Xor,
        });
        quality.motion = self.motion.map_or(quality.motion, |motion| match motion {
            MotionArg::Still => Motion::Still,
            MotionArg::Moving => Motion::Moving,
            MotionArg::Fresh => Motion::Fresh,
        });
        quality
    }

    /// How the picture is smoothed.
    pub fn filter(&self) -> Filter {
        let preset = if self.preset() == Preset::Paper { FilterKind::Paper } else { FilterKind::Plane };
        let window = self.filter_size.unwrap_or(self.quality().interleave);
        match self.filter.unwrap_or(preset) {
            FilterKind::Off => Filter::OFF,
            FilterKind::Paper => Filter::paper(window),
            FilterKind::Plane => Filter::plane(window),
        }
    }

    /// The paper's settings, if nothing else departs from them.
    pub fn is_paper(&self) -> bool {
        self.quality() == Quality::paper()
    }

    fn preset(&self) -> Preset {
        if self.paper { Preset::Paper } else { self.preset }
    }
}

/// The flags that set every knob to these values, whatever the presets are by then.
pub fn flags_for(quality: &Quality, filter: &Filter) -> Vec<String> {
    // All that can only be switched off is on in the default preset.
    let mut flags = vec!["--preset default".to_string()];
    let mut add = |flag: String| flags.push(flag);
    let [n, m] = quality.interleave;
    add(format!("--interleave {n}x{m}"));
    add(format!("--light-samples {}", quality.light_samples));
    add(format!("--vpls {}", quality.vpls));
    add(format!("--photons {}", quality.photons));
    add(format!("--photon-radius {}", quality.photon_radius));
    add(match quality.bound {
        Bound::None => "--bound none".to_string(),
        Bound::Clip { distance } => format!("--bound clip:{distance}"),
        Bound::Geometry { distance } => format!("--bound geometry:{distance}"),
        Bound::Smooth { distance } => format!("--bound smooth:{distance}"),
    });
    quality.max_length.into_iter().for_each(|length| add(format!("--max-length {length}")));
    let switches = [
        (!quality.shrink_radius, "--fixed-radius"),
        (!quality.bias_compensation, "--no-bias-compensation"),
        (!quality.importance, "--no-importance"),
        (!quality.indirect_caustics, "--direct-caustics-only"),
    ];
    switches.iter().filter(|(on, _)| *on).for_each(|(_, flag)| add((*flag).to_string()));
    add(format!("--scramble {}", if quality.scramble == Scramble::Owen { "owen" } else { "xor" }));
    add(match quality.motion {
        Motion::Still => "--motion still".to_string(),
        Motion::Moving => "--motion moving".to_string(),
        Motion::Fresh => "--motion fresh".to_string(),
    });
    add(format!("--replicates {}", quality.replicates));
    add(match filter.edges {
        None => "--filter off".to_string(),
        Some(Edges::Thresholds { .. }) => "--filter paper".to_string(),
        Some(Edges::Planes { .. }) => "--filter plane".to_string(),
    });
    if filter.edges.is_some() {
        add(format!("--filter-size {}x{}", filter.window[0], filter.window[1]));
    }
    flags
}

fn interleave(text: &str) -> Result<[u8; 2], String> {
    Ok(parse::pair(text, 1, 16)?.map(|n| n as u8))
}

fn fraction(text: &str) -> Result<f32, String> {
    let number: f32 = text.parse().map_err(|_| "not a number".to_string())?;
    if number > 0.0 && number <= 1.0 { Ok(number) } else { Err("must be above 0 and at most 1".to_string()) }
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

#[cfg(test)]
mod tests {
    use super::*;

    fn knobs(line: &str) -> Result<Knobs, String> {
        Knobs::from_text(line)
    }

    #[test]
    fn presets_are_what_they_say() {
        assert_eq!(knobs("").unwrap().quality(), Quality::default());
        assert_eq!(knobs("--paper").unwrap().quality(), Quality::paper());
        assert_eq!(knobs("--preset paper").unwrap().filter(), Filter::paper([3, 3]));
        assert_eq!(knobs("--preset high --vpls 7").unwrap().quality().vpls, 7);
    }

    #[test]
    fn the_help_names_what_the_presets_have() {
        let command = <Knobs as Args>::augment_args(clap::Command::new("knobs"));
        let help = |name: &str| {
            let argument = command.get_arguments().find(|argument| argument.get_id() == name).expect("it is a knob");
            argument.get_help().expect("it has a text").to_string()
        };
        let all = || Preset::value_variants().iter().map(|preset| (preset.to_possible_value(), preset.quality()));
        let list = |value: fn(&Quality) -> u32| {
            let one = |(preset, quality): (Option<clap::builder::PossibleValue>, Quality)| {
                format!("{}: {}", preset.expect("it has a name").get_name(), value(&quality))
            };
            format!("[{}]", all().map(one).collect::<Vec<_>>().join(", "))
        };
        assert!(
            help("light_samples").ends_with(&list(|quality| quality.light_samples.into())),
            "{}",
            help("light_samples")
        );
        assert!(help("vpls").ends_with(&list(|quality| quality.vpls.into())), "{}", help("vpls"));
        assert!(help("photons").ends_with(&list(|quality| quality.photons)), "{}", help("photons"));
        assert!(help("interleave").ends_with("[all presets: 3x3]"));
        assert!(all().all(|(_, quality)| quality.interleave == [3, 3]));
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
        ] {
            let first = knobs(line).unwrap();
            let flags = flags_for(&first.quality(), &first.filter()).join(" ");
            let again = knobs(&flags).unwrap();
            assert_eq!(first.quality(), again.quality(), "{line} became {flags}");
            assert_eq!(first.filter(), again.filter(), "{line} became {flags}");
        }
    }

    #[test]
    fn values_out_of_range_are_refused() {
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
        ] {
            assert!(knobs(line).is_err(), "{line}");
        }
    }
}
