//! The command line of `measure`.

use std::path::PathBuf;

use clap::{ArgGroup, Args};

use super::{ClusterArgs, MethodArgs, Size, TalkArgs, parse};

/// `measure`.
#[derive(Debug, Args)]
#[command(group = ArgGroup::new("what").args(["plane", "on", "view", "ugr"]).required(true).multiple(true))]
pub struct MeasureArgs {
    /// Scene: a folder, scene.json, .obj, .gltf or .glb; or a luminaire's .ies or .ldt.
    pub scene: PathBuf,

    /// Measure on a horizontal plane at this height in the scene's own coordinates, whatever lies in its way.
    #[arg(long, value_name = "H", allow_negative_numbers = true, conflicts_with = "on", value_parser = parse::finite)]
    pub plane: Option<f64>,

    /// Of the plane, only this area: two opposite corners in the scene's own coordinates. [default: all of the scene]
    #[arg(long, value_name = "X,Z,X,Z", allow_hyphen_values = true, requires = "plane", value_parser = parse::corners)]
    pub area: Option<[f64; 4]>,

    /// Measure on what has this name in the file: objects, or else a material. What lies is measured from above, what stands
    /// from the camera's side; the grid has points where the surface is.
    #[arg(long, value_name = "NAME")]
    pub on: Option<String>,

    /// … so many metres above it, as on a working plane over a floor.
    #[arg(long, value_name = "M", requires = "on", default_value_t = 0.0, value_parser = parse::from_zero)]
    pub above: f64,

    /// Leave out a border of so many metres along the area's edges: EN 12464-1 leaves out 0.5 m along walls.
    #[arg(long, value_name = "M", default_value_t = 0.0, value_parser = parse::from_zero)]
    pub border: f64,

    /// Metres of a unit of length of the scene.
    #[arg(long, value_name = "M", default_value_t = 1.0, value_parser = parse::positive)]
    pub metre: f64,

    /// Map the luminance of the scene's view, too, or alone.
    #[arg(long)]
    pub view: bool,

    /// Rate the glare of the lamps in the scene's view: UGR by CIE 117, too, or alone.
    #[arg(long)]
    pub ugr: bool,

    /// Size of the luminance map, pixels. [default: the scene's]
    #[arg(long, value_name = "WxH", requires = "view")]
    pub size: Option<Size>,

    /// Colours from this illuminance, lx, to that one: to compare plans. [default: round numbers about what was found]
    #[arg(long, value_name = "LX,LX", value_parser = parse::scale)]
    pub scale: Option<[f64; 2]>,

    /// The same of luminances, cd/m².
    #[arg(long, value_name = "CD,CD", value_parser = parse::scale, requires = "view")]
    pub view_scale: Option<[f64; 2]>,

    /// What files are called: NAME.html, NAME.png, NAME.csv, and NAME-luminance.png and .exr of a view. [default:
    /// SCENE-measured, here]
    #[arg(short, long, value_name = "NAME")]
    pub output: Option<PathBuf>,

    /// Stop when every point is known to within this share of the mean, with 95 % confidence. A luminance map is drawn as
    /// long as that took, or for --seconds if it is alone.
    #[arg(long, value_name = "E", default_value_t = 0.02, value_parser = parse::positive)]
    pub error: f64,

    /// Stop after this time in any case, and say what is known by then.
    #[arg(long, value_name = "S", default_value_t = 60.0, value_parser = parse::positive)]
    pub seconds: f64,

    /// Moment of an animated scene, in its own unit of time. [default: that of an edited scene, else 0]
    #[arg(long, value_name = "T", allow_negative_numbers = true)]
    pub time: Option<f64>,

    /// All randomness comes from this number.
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub seed: u64,

    #[command(flatten)]
    pub(crate) cluster: ClusterArgs,
    #[command(flatten)]
    pub(crate) method: MethodArgs,
    #[command(flatten)]
    pub(crate) talk: TalkArgs,
}

pub(super) const EXAMPLES: &str = "\
Examples:
  igi-master measure scenes/conference --on floor --above 0.8 --border 0.5
      the working plane over the floor
  igi-master measure room.edited.json --plane 0.8 --area 0,0,6,4 --scale 50,1000
  igi-master measure scenes/livingroom --view --seconds 30
      luminances of the view alone
  igi-master measure office --ugr
      glare of the view

Grids are those of EN 12464-1. Every figure stands with half of its 95 %
confidence interval.";
