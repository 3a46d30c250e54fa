//! The command line of `reference`.

use std::path::PathBuf;

use clap::Args;

use super::{ClusterArgs, Size, TalkArgs, WaitArgs, parse};
use runtime::files::Output;

/// `reference`.
#[derive(Debug, Args)]
pub struct ReferenceArgs {
    /// Scene: a folder, scene.json, .obj, .gltf or .glb; or a luminaire's .ies or .ldt.
    pub scene: PathBuf,

    /// Where to save: an .exr with the mean, its variance, and all that is needed to go on later. If it is
    /// there already and of the same scene, view and seed, its samples are kept and more are added.
    #[arg(short, long = "output", value_name = "FILE.exr", default_value = "ref.exr")]
    pub output: Output,

    /// Size of the picture, pixels; the vertical field of view stays. [default: the scene's]
    #[arg(long, value_name = "WxH")]
    pub size: Option<Size>,

    /// Moment of an animated scene, in its own unit of time. [default: that of an edited scene, else 0]
    #[arg(long, value_name = "T", allow_negative_numbers = true)]
    pub time: Option<f64>,

    /// Pictures of different seeds are independent; the same seed gives the same picture, bit for bit.
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub seed: u64,

    /// Longest path: 0 shows lamps only, 1 adds direct light, and so on. [default: paths end by roulette
    /// alone, so nothing is missing]
    #[arg(long, value_name = "N")]
    pub max_bounces: Option<u32>,

    /// Begin again even if the file is there.
    #[arg(long)]
    pub fresh: bool,

    #[command(flatten)]
    pub(crate) stop: ReferenceStopArgs,
    #[command(flatten)]
    pub(crate) cluster: ClusterArgs,
    #[command(flatten)]
    pub(crate) wait: WaitArgs,
    #[command(flatten)]
    pub(crate) talk: TalkArgs,
}

/// When a reference is good enough; whichever comes first.
#[derive(Clone, Debug, Default, Args)]
#[command(next_help_heading = "When to stop (whichever comes first; noise 1e-3 if none is given)")]
pub struct ReferenceStopArgs {
    /// Stop when the relative mean squared error that is left (mean over pixels of variance / (mean² + 0.01))
    /// is below this, with 95 % confidence. It falls in proportion to time.
    #[arg(long, value_name = "E", value_parser = parse::positive, allow_negative_numbers = true)]
    pub until_noise: Option<f64>,

    /// Samples a pixel in all, those of an earlier run included; rounded up to a multiple of 16.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    pub samples: Option<u32>,

    /// Stop after this time, counted from when the first worker is ready.
    #[arg(long, value_name = "S", value_parser = parse::positive, allow_negative_numbers = true)]
    pub seconds: Option<f64>,
}

pub(super) const EXAMPLES: &str = "\
Examples:
  igi-master reference scenes/cornell -o ref.exr --until-noise 1e-4
  igi-master reference scenes/cornell -o ref.exr --samples 4096
      keeps the samples that ref.exr has, and adds the rest
  igi-master reference scenes/cornell -o direct.exr --max-bounces 1";
