//! Flags of what people look at: `view`, `serve`, and `replay`.

use std::path::PathBuf;

use clap::Args;

use super::{ClusterArgs, MethodArgs, OidnArg, Size, TalkArgs, ToneArg, parse};
use runtime::files::Output;
use runtime::show::tev::TevAddress;

/// `view`.
#[derive(Debug, Args)]
pub struct ViewArgs {
    /// Open a browser, even if there could be a window.
    #[arg(long)]
    pub browser: bool,

    #[command(flatten)]
    pub(crate) serve: ServeArgs,
}

/// `serve` and `view`.
#[derive(Debug, Args)]
pub struct ServeArgs {
    /// Scene: a folder, scene.json, .obj, .gltf or .glb; or a luminaire's .ies or .ldt.
    pub scene: PathBuf,

    /// Where browsers may connect. Another address than this machine's own (127.0.0.1, ::1) lets others
    /// watch and edit: they need the token that is printed. Plain HTTP: over a network you do not trust,
    /// use a tunnel (ssh -L).
    #[arg(long, value_name = "ADDR:PORT", env = "IGI_HTTP", default_value_t = parse::HTTP)]
    pub http: std::net::SocketAddr,

    /// What viewers have to know. [default: nothing on this machine's own address, else a fresh token each time]
    #[arg(long, value_name = "TOKEN", env = "IGI_VIEWER_TOKEN", hide_env_values = true)]
    pub viewer_token: Option<String>,

    /// Size of the picture when nothing moves, pixels, whatever screens it is shown on. [default: that of the screen of
    /// whoever has the controls, pixel for pixel, 3840x2160 pixels in all at most]
    #[arg(long, value_name = "WxH")]
    pub size: Option<Size>,

    /// Frames a second to aim at while something moves: the picture gets smaller, and has fewer lights, until
    /// they are reached.
    #[arg(long, value_name = "N", default_value_t = 10.0, value_parser = parse::rate)]
    pub rate: f32,

    /// Take up what was done to this scene before: edits with their undo, view, exposure and curve. All of it is kept in
    /// a file of yours (in $XDG_STATE_HOME/igi/sessions, ~/.local/state if that is not set) within a second, and without
    /// this the viewer asks.
    #[arg(long, conflicts_with_all = ["fresh", "no_session"])]
    pub resume: bool,

    /// Forget what was done to this scene before, but for saved views.
    #[arg(long, conflicts_with = "no_session")]
    pub fresh: bool,

    /// Keep nothing of what is done, and offer nothing that was kept.
    #[arg(long)]
    pub no_session: bool,

    /// Where Ctrl S and Save put the scene as it was edited: a .json that names the scene and lists the edits, and that every
    /// command reads as a scene. [default: the edited scene that was opened, or else NAME.edited.json beside the scene, with a
    /// number if that is there; with --record, FILE.scene.json beside the recording, which is written at the end in any
    /// case]
    #[arg(long, value_name = "FILE.json")]
    pub save_to: Option<PathBuf>,

    /// Keep what people do in a file, for replay.
    #[arg(long, value_name = "FILE")]
    pub record: Option<PathBuf>,

    /// Show pictures in tev as well, when nothing moves: tev's address; tev's own default is 127.0.0.1:14158. tev may be
    /// started later, and holds nothing up.
    #[arg(long, value_name = "HOST:PORT")]
    pub tev: Option<TevAddress>,

    /// Smooth and tone-map on a graphics processor (Vulkan). What people see may differ by the last bit of a colour from
    /// what the processor draws, and by a neighbour more or less where surfaces meet; what is saved does not.
    #[cfg(feature = "window")]
    #[arg(long, value_enum, value_name = "WHICH", default_value_t)]
    pub gpu: runtime::show::gpu::Allowed,

    /// Show pictures at rest denoised from the beginning, by Open Image Denoise. Where it is installed, the panel has a switch
    /// for it. A denoised picture takes the place of the plain one as soon as it is ready; while something moves, and in
    /// recordings, there is none.
    #[arg(long)]
    pub denoise: bool,

    #[command(flatten)]
    pub(crate) oidn: OidnArg,

    /// Rest when a still picture has this many frames.
    #[arg(long, value_name = "N", default_value_t = 4096, value_parser = clap::value_parser!(u32).range(1..))]
    pub rest_after: u32,

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
    pub(crate) look: LiveLookArgs,
    #[command(flatten)]
    pub(crate) talk: TalkArgs,
}

/// `replay`.
#[derive(Debug, Args)]
pub struct ReplayArgs {
    /// The recording.
    pub session: PathBuf,
    /// Where the scene is now. [default: where it was]
    #[arg(long, value_name = "SCENE")]
    pub scene: Option<PathBuf>,
    /// Frames of the still picture at the end.
    #[arg(long, value_name = "N", default_value_t = 9, value_parser = clap::value_parser!(u32).range(1..))]
    pub frames: u32,
    /// Save the still picture at the end: .png or .exr. With a place for a number, as in out.%04d.png, all moving pictures
    /// as well.
    #[arg(short, long = "output", value_name = "FILE")]
    pub output: Option<Output>,
    /// [default: the method and the settings of the recording]
    #[command(flatten)]
    pub(crate) method: MethodArgs,
    #[command(flatten)]
    pub(crate) cluster: ClusterArgs,
    #[command(flatten)]
    pub(crate) talk: TalkArgs,
}

/// What the picture looks like at first; viewers may change it.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "What it looks like at first")]
pub struct LiveLookArgs {
    /// Exposure: stops (0 shows radiance 1 as white). [default: as the first picture needs if lights are in candela or lux,
    /// as those of glTF files are, else 0]
    #[arg(long, value_name = "EV", allow_negative_numbers = true, value_parser = parse::stops)]
    pub exposure: Option<f32>,

    /// Tone curve.
    #[arg(long, value_enum, default_value_t = ToneArg::None)]
    pub tone: ToneArg,
}

pub(super) const SERVE_EXAMPLES: &str = "\
Examples:
  igi-master view scenes/conference
      in a window or a browser, here
  igi-master serve scenes/livingroom --size 800x600 --rate 15
  igi-master serve scenes/cornell --http 0.0.0.0:8080
      others may watch: the address that is printed lets them in
  igi-master serve scenes/sponza --listen 0.0.0.0:7464
      with workers of other machines: start them as it says

Several people may watch; one has the controls and may hand them over. Ctrl-C
ends it; edits and saved views are kept, and offered the next time. Ctrl-S
saves the scene as it was edited: render, reference, export, report and view
read that file as they read any scene.";

pub(super) const REPLAY_EXAMPLES: &str = "\
Examples:
  igi-master serve scenes/conference --record session.jsonl
      records it
  igi-master replay session.jsonl -o end.png --frames 64
  igi-master replay session.jsonl --scene moved/conference";
