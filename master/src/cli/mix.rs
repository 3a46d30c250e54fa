//! The command line of `mix`.

use std::path::PathBuf;

use clap::Args;

use super::{ClusterArgs, ExposureArg, MethodArgs, Size, TalkArgs, ToneArg, parse};
use runtime::files::Output;

/// `mix`.
#[derive(Debug, Args)]
pub struct MixArgs {
    /// A scene, whose lamps are drawn one by one; or an .exr that was made so, which is mixed anew at once.
    pub source: PathBuf,

    /// Where to save: .exr (the mix, and a layer for each lamp) or .png (the mix, tone-mapped). May be given several times.
    /// [default: NAME-mix.exr, here]
    #[arg(short, long = "output", value_name = "FILE")]
    pub output: Vec<Output>,

    /// Dim or colour a lamp: a factor, or one each for red, green and blue. May be given several times; lamps that are not
    /// named stay as they are.
    #[arg(long = "set", value_name = "LAMP=F", value_parser = parse::dimmed)]
    pub set: Vec<(String, [f32; 3])>,

    /// Only these lamps, the others off.
    #[arg(long, value_name = "LAMP")]
    pub solo: Vec<String>,

    /// Size of the picture, pixels. [default: the scene's]
    #[arg(long, value_name = "WxH")]
    pub size: Option<Size>,

    /// Frames for each lamp. [default: as many as --seconds allows]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    pub frames: Option<u32>,

    /// Time for each lamp. [default: 10 unless --frames is given]
    #[arg(long, value_name = "S", value_parser = parse::positive)]
    pub seconds: Option<f64>,

    /// Moment of an animated scene, in its own unit of time. [default: that of an edited scene, else 0]
    #[arg(long, value_name = "T", allow_negative_numbers = true)]
    pub time: Option<f64>,

    /// All randomness comes from this number.
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub seed: u64,

    /// Brightness of .png, in stops, or `auto`. [default: 0, or auto where lights are in candela or lux]
    #[arg(long, value_name = "EV", allow_negative_numbers = true)]
    pub exposure: Option<ExposureArg>,

    /// Tone curve of .png.
    #[arg(long, value_enum, default_value_t = ToneArg::None)]
    pub tone: ToneArg,

    #[command(flatten)]
    pub(crate) cluster: ClusterArgs,
    #[command(flatten)]
    pub(crate) method: MethodArgs,
    #[command(flatten)]
    pub(crate) talk: TalkArgs,
}

pub(super) const EXAMPLES: &str = "\
Examples:
  igi-master mix room.gltf -o room.exr --seconds 30
      draws every lamp by itself, and says what each brings
  igi-master mix room.exr --set \"candle 3=0.4\" --set sky=0 -o evening.png
      another mix of the same, without tracing a ray
  igi-master mix room.exr --solo \"candle 3\" -o candle.png";
