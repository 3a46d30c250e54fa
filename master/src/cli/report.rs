//! The command line of `report`.

use std::path::PathBuf;
use std::str::FromStr;

use clap::{Args, ValueEnum};
use frame::Chosen;
use frame::front_end::preset;

use super::{MethodArgs, OidnArg, Size, TalkArgs, parse};
use runtime::methods;

/// `report`.
#[derive(Debug, Args)]
pub struct ReportArgs {
    /// Scenes: folders or files, each with a reference picture ref.exr beside it. With --session: where the scene of the
    /// recordings is now, if it is not where it was.
    #[arg(required_unless_present = "session")]
    pub scenes: Vec<PathBuf>,

    /// Folder for the report: index.html, points.csv, left-out.csv, settings.json and the plots.
    #[arg(short, long = "output", value_name = "DIR", default_value = "report")]
    pub output: PathBuf,

    /// Methods to run: METHOD, or METHOD-PRESET; `none` for variants and peers alone. What is called so with `+oidn` behind
    /// it, here and below, is denoised by Open Image Denoise, on the clock. [default: igi,igi-paper,reference; with --session
    /// all methods]
    #[arg(long, value_delimiter = ',', value_name = "NAMES")]
    pub methods: Vec<NamedArg>,

    /// One more method of our own, by flags: `NAME=--method igi --vpls 64 --photons 0`. May be given several times.
    #[arg(long = "variant", value_name = "NAME=FLAGS", allow_hyphen_values = true)]
    pub variants: Vec<VariantArg>,

    /// Another renderer to run in turn: `mitsuba`, `mitsuba+oidn`, or any `NAME=COMMAND` (see --help). May be given
    /// several times.
    #[arg(long = "peer", value_name = "PEER")]
    pub peers: Vec<PeerArg>,

    /// Do not measure what leaving out saves.
    #[arg(long)]
    pub without_pruning: bool,

    #[command(flatten)]
    pub(crate) oidn: OidnArg,
    #[command(flatten)]
    pub(crate) measure: MeasureArgs,
    #[command(flatten)]
    pub(crate) session: SessionArgs,
    #[command(flatten)]
    pub(crate) talk: TalkArgs,
}

impl ReportArgs {
    /// The methods of our own, each with its name.
    pub fn methods(&self) -> Vec<NamedArg> {
        let named = |name: &&str| name.parse().ok();
        if self.methods.is_empty() { METHODS.iter().filter_map(named).collect() } else { self.methods.clone() }
    }
}

/// What is compared if nothing is said.
const METHODS: [&str; 3] = ["igi", "igi-paper", "reference"];

/// Error while things move, instead of error against run time.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "Error while things move")]
pub struct SessionArgs {
    /// A recording of `serve --record`: it is played through each method, and what people would have seen is compared with
    /// converged pictures of the same states. May be given several times.
    #[arg(long, value_name = "FILE", conflicts_with_all = ["runs", "seconds", "clock", "shrink", "size", "reference",
          "time", "seed", "peers", "without_pruning"])]
    pub session: Vec<PathBuf>,

    /// In step: pixels of the picture for each new sample, whatever the recording has; 64 is what the Render Cache's paper
    /// calls usable. Several give a table: 1,4,16,64,256.
    #[arg(long, value_delimiter = ',', value_name = "N", requires = "session",
          value_parser = clap::value_parser!(u32).range(1..=4096))]
    pub mismatch: Vec<u32>,

    /// How recordings are played.
    #[arg(long, value_enum, default_value_t = PaceArg::Both, requires = "session")]
    pub pace: PaceArg,

    /// Pictures of each recording that are compared, evenly spread.
    #[arg(long, value_name = "N", default_value_t = 8, requires = "session",
          value_parser = clap::value_parser!(u32).range(1..=1024))]
    pub samples: u32,

    /// What draws the converged pictures: METHOD, or METHOD-PRESET.
    #[arg(long, value_name = "NAME", default_value = "igi", requires = "session")]
    pub truth: NamedArg,

    /// Frames of each of them.
    #[arg(long, value_name = "N", default_value_t = 256, requires = "session",
          value_parser = clap::value_parser!(u32).range(1..))]
    pub truth_frames: u32,

    /// Folder in which they are kept for the next time. [default: truths in that of the report]
    #[arg(long, value_name = "DIR", requires = "session")]
    pub truths: Option<PathBuf>,
}

/// How recordings are played.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum PaceArg {
    /// Picture by picture, time standing still: the same on every machine.
    Step,
    /// As time goes: with latency, on this machine.
    Time,
    /// One after the other.
    Both,
}

/// What is measured, and for how long.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "What is measured")]
pub struct MeasureArgs {
    /// Independent runs of every method: fewer, and intervals are wide; 8 is a good number.
    #[arg(long, value_name = "R", default_value_t = 8, value_parser = clap::value_parser!(u32).range(1..=64))]
    pub runs: u32,

    /// Length of a run, by the clock. The page shows pictures at 1, 10 and 60 seconds as far as a run reaches, so
    /// 61 shows all three.
    #[arg(long, value_name = "S", default_value_t = 16.0, value_parser = parse::positive)]
    pub seconds: f64,

    /// Which clock: wall time, or the CPU time of all threads over their number, which other work on
    /// this machine disturbs far less.
    #[arg(long, value_enum, default_value_t = ClockArg::Wall)]
    pub clock: ClockArg,

    /// Width and height of the pictures over those of the reference are one over this. The reference is
    /// averaged, so its noise falls by the square.
    #[arg(long, value_name = "N", default_value_t = 2, conflicts_with = "size",
          value_parser = clap::value_parser!(u32).range(1..=64))]
    pub shrink: u32,

    /// Size of the pictures; the reference's must be a whole multiple of it. Instead of --shrink.
    #[arg(long, value_name = "WxH")]
    pub size: Option<Size>,

    /// What the picture should be, if it is not ref.exr beside the scene. For a single scene.
    #[arg(long, value_name = "FILE.exr")]
    pub reference: Option<PathBuf>,

    /// Moment of an animated scene, in its own unit of time. [default: that of an edited scene, else 0]
    #[arg(long, value_name = "T", allow_negative_numbers = true)]
    pub time: Option<f64>,

    /// Seed of the first run; each run has its own.
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub seed: u64,

    /// Threads, ours and those of other renderers. [default: one a core]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub threads: Option<u16>,

    /// The Python that has Mitsuba, for --peer mitsuba.
    #[arg(long, value_name = "PROGRAM", default_value = "python3", env = "IGI_PYTHON")]
    pub python: PathBuf,
}

/// A method of our own, or none.
#[derive(Clone, Debug)]
pub struct NamedArg(pub Option<(String, Chosen)>);

impl FromStr for NamedArg {
    type Err = String;

    /// `METHOD`, or `METHOD-PRESET`, or `none`.
    fn from_str(text: &str) -> Result<Self, String> {
        if text == "none" {
            return Ok(Self(None));
        }
        let plain = text.strip_suffix("+oidn").unwrap_or(text);
        let split =
            || plain.rmatch_indices('-').find_map(|(at, _)| Some((methods::find(&plain[..at])?, &plain[at + 1..])));
        let chosen = match methods::find(plain) {
            Some(method) => Some(Chosen::new(method)),
            None => split().and_then(|(method, name)| Chosen::new(method).with(preset(method, name)?.to_vec()).ok()),
        };
        let chosen =
            chosen.ok_or_else(|| format!("expected none, or a method ({}), or METHOD-PRESET", methods::names()))?;
        Ok(Self(Some((text.to_owned(), chosen))))
    }
}

/// Which time a run takes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum ClockArg {
    /// What a watch shows.
    Wall,
    /// CPU seconds of all threads, over their number.
    Cpu,
}

/// A name, and flags for it.
#[derive(Clone, Debug)]
pub struct VariantArg {
    /// For plots and tables.
    pub name: String,
    /// As given.
    pub flags: String,
    /// What the flags mean.
    pub method: Chosen,
}

impl FromStr for VariantArg {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (name, flags) = named(text)?;
        Ok(Self { name, flags: flags.to_string(), method: MethodArgs::from_text(flags)?.0 })
    }
}

/// Another renderer.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum PeerArg {
    /// Mitsuba 3's path tracer, in its scalar and its LLVM variant.
    Mitsuba {
        /// And Open Image Denoise.
        is_denoised: bool,
    },
    /// Anything that can be run.
    Command {
        /// For plots and tables.
        name: String,
        /// Words with placeholders.
        command: String,
    },
}

impl FromStr for PeerArg {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        if let "mitsuba" | "mitsuba+oidn" = text {
            return Ok(Self::Mitsuba { is_denoised: text != "mitsuba" });
        }
        let (name, command) = named(text).map_err(|_| "expected `mitsuba` or NAME=COMMAND".to_string())?;
        Ok(Self::Command { name, command: command.to_string() })
    }
}

/// `NAME=SOMETHING`, neither of them empty.
fn named(text: &str) -> Result<(String, &str), String> {
    match text.split_once('=') {
        Some((name, rest)) if !name.trim().is_empty() && !rest.trim().is_empty() => Ok((name.trim().into(), rest)),
        _ => Err("expected NAME=…".to_string()),
    }
}

pub(super) const EXAMPLES: &str = "\
Examples:
  igi-master report scenes/cornell -o report/
  igi-master report scenes/* --runs 8 --seconds 64 --peer mitsuba --clock cpu
  igi-master report scenes/conference --methods igi,igi+oidn \\
      --peer mitsuba+oidn --without-pruning --shrink 1
  igi-master report scenes/conference --shrink 4 --methods igi \\
      --variant 'few=--vpls 8 --light-samples 4'
  igi-master report --session scenes/conference/walk.session -o walk/
      error while things move: every method, in step and in real time
  igi-master report --session a.session --session b.session \\
      --methods render-cache --pace step --mismatch 1,4,16,64,256";

pub(super) const LONG_HELP: &str = "\
Methods take turns run by run. Pictures are looked at after 1, 2, 4, 8, …
frames and at the first frame after 1, 10 and 60 seconds; they are compared
with the reference after the run, off the clock. Beside that, each scene is
drawn with all parts of the pipeline and with those it needs, to see what that
saves. Ctrl-C writes the report of what there is.

Mitsuba: pip install mitsuba numpy, and LLVM's shared library (Debian:
libllvm19) for its LLVM variant; DRJIT_LIBLLVM_PATH names that library where it
is not found.

+oidn: looks are taken earlier, by what denoising takes, and denoised when the
run is over; what that took is added to their time. NAME+oidn=COMMAND is for
pictures (.exr) with channels albedo.R, .G, .B and normal.X, .Y, .Z.

Other renderers: NAME=COMMAND is split at white space and started once a scene,
without a shell. In it, {mitsuba} is the scene in Mitsuba's format, {scene} the
path given, and {width} {height} {runs} {seconds} {threads} {seed} {marks}
{clock} {folder} are what they say; {folder} is for its pictures and is removed
afterwards. It writes one JSON object a line to standard output:
  {\"prepared\": 1.5}
      seconds until it could begin, once
  {\"run\": 0, \"samples\": 4, \"seconds\": 0.52, \"cpu_seconds\": 1.01,
   \"picture\": \"/…/a.exr\"}
      on one line: the picture of run 0 after so many samples a pixel and so
      much time; samples 1, 2, 4, … and the first after each mark";
