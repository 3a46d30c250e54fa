//! The command line: what can be asked of `igi-master`, and how it is explained.

mod denoise;
mod elsewhere;
mod live;
mod measure;
mod method;
mod mix;
mod parse;
mod reference;
mod relay;
mod report;
mod scale;
mod selftest;

use std::ffi::OsString;
use std::path::PathBuf;

use clap::error::ErrorKind;
use clap::parser::ValueSource;
use clap::{Args, CommandFactory, FromArgMatches, Parser, Subcommand};

pub use denoise::{DenoiseArgs, OidnArg};
pub use live::{LiveLookArgs, ReplayArgs, ServeArgs, ViewArgs};
use live::{REPLAY_EXAMPLES, SERVE_EXAMPLES};
pub use measure::MeasureArgs;
pub use method::MethodArgs;
pub use mix::MixArgs;
pub use parse::{ExposureArg, FramesRange, Size, ToneArg, WorkersArg};
pub use reference::ReferenceArgs;
pub use relay::RelayArgs;
pub use report::{ClockArg, NamedArg, PaceArg, PeerArg, ReportArgs, VariantArg};
pub use scale::{Ratio, ScaleArgs};
pub use selftest::SelftestArgs;

use secrets::command_line::Flag;

use runtime::files::Output;
use runtime::show::tev::TevAddress;

/// Interactive global illumination on a cluster: this is the master, which asks workers about light
/// and makes pictures of their answers.
#[derive(Debug, Parser)]
#[command(name = "igi-master", version, propagate_version = true, after_help = format!("{EXAMPLES}\n\n{MORE_HELP}"),
    after_long_help = format!("{EXAMPLES}\n\n{LONG_HELP}"))]
pub struct Cli {
    #[command(subcommand)]
    pub(crate) command: Command,
}

/// What nobody else should read on our command line.
pub(crate) const SECRETS: [Flag; 2] =
    [Flag { name: "--token", variable: "IGI_TOKEN" }, Flag { name: "--viewer-token", variable: "IGI_VIEWER_TOKEN" }];

/// Says once what was wrong with it.
pub(crate) fn warn_of_secret(Flag { name, variable }: &Flag) {
    let or_file = if *name == "--token" { " or --token-file" } else { "" };
    tracing::warn!("{name}: every user of this machine could read it on the command line; use {variable}{or_file}");
}

impl Cli {
    /// The command line, in these words.
    ///
    /// # Errors
    /// It is wrong, or asks for help: [`clap::Error::exit`] says how.
    pub fn read(words: impl IntoIterator<Item = impl Into<OsString> + Clone>) -> Result<Self, clap::Error> {
        let mut command = Self::command();
        let words: Vec<OsString> = words.into_iter().map(Into::into).collect();
        let chosen = words.iter().skip(1).filter_map(|word| word.to_str()).find(|word| !word.starts_with('-'));
        let matches =
            command.try_get_matches_from_mut(&words).map_err(|error| elsewhere::explain(error, &command, chosen))?;
        if let Some((_, chosen)) = matches.subcommand() {
            // What stands in the environment may be meant for other commands; what is typed is meant for this one.
            let is_typed = |name: &str| {
                chosen.try_contains_id(name).is_ok() && chosen.value_source(name) == Some(ValueSource::CommandLine)
            };
            for (name, flag) in [("token", "--token"), ("token_lifetime", "--token-lifetime")] {
                if is_typed(name) && chosen.value_source("listen").is_none() {
                    let reason = format!("{flag} is for workers that join: it needs --listen ADDR:PORT");
                    return Err(command.error(ErrorKind::MissingRequiredArgument, reason));
                }
            }
        }
        Self::from_arg_matches(&matches)
    }
}

#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Render a picture of a scene.
    #[command(after_help = RENDER_EXAMPLES)]
    Render(Box<RenderArgs>),
    /// Path-trace the picture that others are judged by, until its noise is small enough.
    #[command(after_help = reference::EXAMPLES)]
    Reference(Box<ReferenceArgs>),
    /// Measure illuminance on a plane or a surface: least, mean, greatest, uniformity, isolux lines and false colours, as PNG, CSV
    /// and a page that prints; and a luminance map of the view.
    #[command(after_help = measure::EXAMPLES)]
    Measure(Box<MeasureArgs>),
    /// Draw what each lamp of a scene brings, apart, into one file; and mix that anew without tracing a ray: dimmed, coloured,
    /// switched.
    #[command(after_help = mix::EXAMPLES)]
    Mix(Box<MixArgs>),
    /// Say what a scene uses, what is left out for it, why, and what that saves.
    #[command(after_help = PLAN_EXAMPLES)]
    Plan(PlanArgs),
    /// Measure how far a picture is from a reference.
    #[command(after_help = COMPARE_EXAMPLES)]
    Compare(CompareArgs),
    /// Measure frames a second and where the time goes (--paper: at the paper's settings).
    #[command(after_help = BENCH_EXAMPLES)]
    Bench(Box<BenchArgs>),
    /// Measure error against run time, of several methods and other renderers, as a page to read.
    #[command(after_help = report::EXAMPLES,
        after_long_help = format!("{}\n\n{}", report::EXAMPLES, report::LONG_HELP))]
    Report(Box<ReportArgs>),
    /// Measure frames a second against the number of clients, and simulate many more.
    #[command(after_help = scale::EXAMPLES)]
    Scale(Box<ScaleArgs>),
    /// Write a scene in another renderer's format.
    #[command(after_help = EXPORT_EXAMPLES)]
    Export(ExportArgs),
    /// Show a scene in browsers: look around, move things, change light and materials.
    #[command(after_help = SERVE_EXAMPLES)]
    Serve(Box<ServeArgs>),
    /// Look around a scene in a window, or in a browser where there can be no window.
    #[command(after_help = SERVE_EXAMPLES)]
    View(Box<ViewArgs>),
    /// Draw a session again that was recorded with serve --record: the same pictures, bit for bit.
    #[command(after_help = REPLAY_EXAMPLES)]
    Replay(Box<ReplayArgs>),
    /// Look whether other machines could work for this one, over ssh: versions, ports, packet size, bandwidth, memory,
    /// clock, in one table.
    #[command(after_help = DOCTOR_HELP)]
    Doctor(DoctorArgs),
    /// Stand between a master and workers: takes in workers as a master does, and works for another master with them.
    #[command(after_help = relay::EXAMPLES)]
    Relay(RelayArgs),
    /// Make a token, to start a master and its workers with (IGI_TOKEN), in any order.
    #[command(after_help = TOKEN_EXAMPLES)]
    Token(TokenArgs),
    /// Ask a master that runs with --metrics how it is: exit code 0 if it is well, else 1.
    Health(HealthArgs),
    /// Ask for light whose answer is known, in stiff and extreme scenes, and compare.
    #[command(after_help = selftest::EXAMPLES)]
    Selftest(SelftestArgs),
}

/// `render`.
#[derive(Debug, Args)]
pub struct RenderArgs {
    /// Scene: a folder, scene.json, .obj, .gltf or .glb; or a luminaire's .ies or .ldt.
    pub scene: PathBuf,

    /// Where to save: .png (tone-mapped) or .exr (linear, with all that repeats the render). May be
    /// given several times. [default: NAME.png, here]
    #[arg(short, long = "output", value_name = "FILE")]
    pub output: Vec<Output>,

    /// Size of the picture, pixels; the vertical field of view stays. [default: the scene's]
    #[arg(long, value_name = "WxH")]
    pub size: Option<Size>,

    /// Moment of an animated scene, in its own unit of time. [default: that of an edited scene, else 0]
    #[arg(long, value_name = "T", allow_negative_numbers = true)]
    pub time: Option<f64>,

    /// All randomness comes from this number: the same seed gives the same picture, bit for bit.
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub seed: u64,

    /// Leave nothing out: every stage runs, even where the scene has no work for it. That takes longer and changes no
    /// bit of the picture: use it to check just that. Not with --listen or --checkpoint.
    #[arg(long, conflicts_with_all = ["listen", "checkpoint"])]
    pub keep_all: bool,

    /// Keep what is drawn so far in this folder, with the token of --listen. If that cannot be written, it is said, and
    /// drawing goes on. After a crash or Ctrl-C, the same
    /// command goes on from there and ends in the same bits; workers come back by themselves.
    #[arg(long, value_name = "DIR")]
    pub checkpoint: Option<PathBuf>,

    /// Keep it this often, seconds.
    #[arg(long, value_name = "S", default_value_t = 30.0, value_parser = parse::positive, requires = "checkpoint")]
    pub checkpoint_every: f64,

    /// Save what is drawn so far this often, seconds: whoever looks sees a whole file, the old one or the new.
    #[arg(long, value_name = "S", value_parser = parse::positive)]
    pub autosave: Option<f64>,

    /// Show the picture in tev as it sharpens: tev's address; tev's own default is 127.0.0.1:14158. tev may be started
    /// later, and holds nothing up.
    #[arg(long, value_name = "HOST:PORT")]
    pub tev: Option<TevAddress>,

    #[command(flatten)]
    pub(crate) animation: AnimationArgs,
    #[command(flatten)]
    pub(crate) stop: StopArgs,
    #[command(flatten)]
    pub(crate) cluster: ClusterArgs,
    #[command(flatten)]
    pub(crate) wait: WaitArgs,
    #[command(flatten)]
    pub(crate) method: MethodArgs,
    #[command(flatten)]
    pub(crate) look: LookArgs,
    #[command(flatten)]
    pub(crate) denoise: DenoiseArgs,
    #[command(flatten)]
    pub(crate) talk: TalkArgs,
}

/// One picture after another.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "Animations")]
pub struct AnimationArgs {
    /// Draw these pictures of an animated scene: 0..240 are 240, the last is 239; 1..=240 ends with 240. Picture n shows
    /// the moment --time + n / --fps. File names need a place for the number, as in out.%04d.exr. Pictures that
    /// are there already are skipped, so that the same command resumes after Ctrl-C or a crash; of EXR files, scene,
    /// moment, seed, quality, filter and size are compared, but neither when they stopped nor their tone. What is said
    /// under "When to stop" holds for each picture.
    #[arg(long, value_name = "A..B", conflicts_with_all = ["checkpoint", "autosave"])]
    pub frames_range: Option<FramesRange>,

    /// Pictures of an animation in a unit of the scene's time.
    #[arg(long, value_name = "N", default_value_t = 24.0, value_parser = parse::positive, requires = "frames_range")]
    pub fps: f64,
}

/// When to stop; whichever comes first.
#[derive(Clone, Debug, Default, Args)]
#[command(next_help_heading = "When to stop (whichever comes first; 10 seconds if none is given)")]
pub struct StopArgs {
    /// Begin no new frame after this time, counted from when the first worker is ready. If no worker is left to complete
    /// the frame in progress, it is left out.
    #[arg(long, value_name = "S", value_parser = parse::positive, allow_negative_numbers = true)]
    pub seconds: Option<f64>,

    /// Make this many frames: one sample a pixel each.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    pub frames: Option<u32>,

    /// Stop when the relative mean squared error of the unfiltered picture is below this, with 95 %
    /// confidence. It is estimated from independent replicates of the samples, and from a few path-traced ones, in case
    /// there is light that the others do not find.
    #[arg(long, value_name = "E", value_parser = parse::positive, allow_negative_numbers = true)]
    pub error: Option<f64>,
}

/// Who does the work.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "Who does the work")]
pub struct ClusterArgs {
    /// Threads of this process: `embedded:N`, or `embedded` for one a core. [default: embedded,
    /// unless --listen is given]
    #[arg(long, value_name = "WHO", env = "IGI_WORKERS")]
    pub workers: Option<WorkersArg>,

    /// Take in workers over the network: prints the line that starts one. They may come and go at
    /// any time, and change no bit of the picture.
    #[arg(long, value_name = "ADDR:PORT", env = "IGI_LISTEN")]
    pub listen: Option<std::net::SocketAddr>,

    /// With --listen: what workers have to know to be let in. Better in IGI_TOKEN or a file: every user of the machine can
    /// read a command line, until this program has taken the token off it. [default: a fresh one each time, kept in a file
    /// as long as the master runs]
    #[arg(long, value_name = "TOKEN", env = "IGI_TOKEN", hide_env_values = true)]
    pub token: Option<String>,

    /// A file with what workers have to know, which nobody else may read, one token a line; the first is for new workers.
    /// It is read again every second: see `igi-master token --rotate`. It counts more than --token and IGI_TOKEN.
    #[arg(long, value_name = "FILE", requires = "listen", conflicts_with = "token_lifetime")]
    pub token_file: Option<std::path::PathBuf>,

    /// With --listen: the fresh token lets workers in for so long (90s, 30m, 12h, 7d); who is in may stay. [default: as
    /// long as the master runs]
    #[arg(long, value_name = "TIME", env = "IGI_TOKEN_LIFETIME", conflicts_with = "token", value_parser = parse::lifetime)]
    pub token_lifetime: Option<std::time::Duration>,

    /// With --listen: this share of the answers of other machines is asked of another worker as well and compared; who
    /// computes wrongly is asked no more, and what is drawn begins again. A worker that is wrong once in a thousand
    /// answers is found after 1000/SHARE of them on average, and a newcomer that is always wrong at once. More: found sooner, and
    /// as much more work. 0: nobody is checked.
    #[arg(long, value_name = "SHARE", env = "IGI_CHECK_SHARE", default_value = "0.01", value_parser = parse::share)]
    pub check_share: f64,

    /// The address in the printed line that starts a worker: where others reach this machine, if that is not its own address
    /// (behind NAT, in a container, by a name). [default: found out]
    #[arg(long, value_name = "HOST:PORT", requires = "listen", env = "IGI_ADVERTISE", value_parser = parse::place)]
    pub advertise: Option<String>,

    /// Do not say on the local network (DNS-SD, _igi._udp) where workers may join: they need --master then.
    #[arg(long, requires = "listen")]
    pub no_announce: bool,

    /// Answer /metrics (Prometheus), /healthz and /readyz here; a port alone answers to this machine only.
    #[arg(long, value_name = "[ADDR:]PORT", env = "IGI_METRICS", value_parser = health::address)]
    pub metrics: Option<std::net::SocketAddr>,
}

/// How long somebody waits who wants a result.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "Who does the work")]
pub struct WaitArgs {
    /// Give up after this long without any worker. [default: wait for ever]
    #[arg(long, value_name = "S", value_parser = parse::positive, allow_negative_numbers = true)]
    pub wait: Option<f64>,
}

/// What the picture looks like.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "What it looks like")]
pub struct LookArgs {
    /// Exposure of the PNG: stops (0 shows radiance 1 as white), or `auto`, as the picture needs. [default: auto if lights
    /// are in candela or lux, as those of glTF files are, else 0]
    #[arg(long, value_name = "EV|auto", allow_negative_numbers = true)]
    pub exposure: Option<ExposureArg>,

    /// Tone curve of the PNG.
    #[arg(long, value_enum, default_value_t = ToneArg::None)]
    pub tone: ToneArg,

    /// Add layers to the EXR: raw radiance, albedo, normal, distance, irradiance, sample count, standard
    /// deviation, worker, cost.
    #[arg(long)]
    pub aov: bool,
}

/// `doctor`.
#[derive(Debug, Args)]
pub struct DoctorArgs {
    /// Machines, as ssh knows them.
    #[arg(value_name = "HOST", required = true)]
    pub hosts: Vec<String>,

    /// Where this machine listens meanwhile: the port that will be used, to find out whether it is open.
    #[arg(long, value_name = "ADDR:PORT", env = "IGI_LISTEN", default_value = "0.0.0.0:7464")]
    pub listen: std::net::SocketAddr,

    /// What this machine is called by the others. [default: its address]
    #[arg(long, value_name = "HOST:PORT")]
    pub master: Option<String>,

    /// Write one JSON object a machine to standard output.
    #[arg(long)]
    pub json: bool,
}

/// `token`.
#[derive(Debug, Args)]
pub struct TokenArgs {
    /// Print the workers' half of the token in IGI_TOKEN, or of the first in this file: who has it can join, and cannot
    /// play the master.
    #[arg(long, value_name = "FILE", num_args = 0..=1, conflicts_with_all = ["lifetime", "rotate", "add"])]
    pub for_workers: Option<Option<std::path::PathBuf>>,

    /// Add a token to those in this file and print its workers' half, for one worker or some: it is revoked alone by taking
    /// its line, the last, out of the file.
    #[arg(long, value_name = "FILE", conflicts_with = "rotate")]
    pub add: Option<std::path::PathBuf>,

    /// It lets workers in for so long from now on (90s, 30m, 12h, 7d). [default: for ever]
    #[arg(long, value_name = "TIME", value_parser = parse::lifetime)]
    pub lifetime: Option<std::time::Duration>,

    /// Put it first in this file, which is made if there is none: a master that runs with it as --token-file takes it
    /// within a second or two. The tokens before it are revoked: they let nobody in, and who came in with one is sent
    /// away. A worker with a --token-file of its own reads it again then.
    #[arg(long, value_name = "FILE")]
    pub rotate: Option<std::path::PathBuf>,

    /// They are revoked so much later (90s, 30m, 12h, 7d). [default: at once]
    #[arg(long, value_name = "TIME", requires = "rotate", value_parser = parse::lifetime)]
    pub grace: Option<std::time::Duration>,
}

/// `health`.
#[derive(Debug, Args)]
pub struct HealthArgs {
    /// Where it answers.
    #[arg(value_name = "[ADDR:]PORT", env = "IGI_METRICS", value_parser = health::address, default_value_t = health::ADDRESS)]
    pub address: std::net::SocketAddr,
}

/// How much is said.
#[derive(Clone, Copy, Debug, Default, Args)]
#[command(next_help_heading = "What is said")]
pub struct TalkArgs {
    /// Say nothing but errors.
    #[arg(short, long)]
    pub quiet: bool,

    /// Write events to standard output, one JSON object a line.
    #[arg(long)]
    pub json: bool,
}

/// `plan`.
#[derive(Debug, Args)]
pub struct PlanArgs {
    /// Scene: a folder, scene.json, .obj, .gltf or .glb; or a luminaire's .ies or .ldt.
    pub scene: PathBuf,
    #[command(flatten)]
    pub(crate) method: MethodArgs,
    /// Write it to standard output as one JSON object.
    #[arg(long)]
    pub json: bool,
}

/// `export`.
#[derive(Debug, Args)]
pub struct ExportArgs {
    /// Scene: a folder, scene.json, .obj, .gltf or .glb; or a luminaire's .ies or .ldt.
    pub scene: PathBuf,
    /// Write it for Mitsuba 3: scene.xml, meshes and textures, into this folder.
    #[arg(long, value_name = "DIR", required = true)]
    pub mitsuba: PathBuf,
    /// Size of the picture, pixels. [default: the scene's]
    #[arg(long, value_name = "WxH")]
    pub size: Option<Size>,
    /// Moment of an animated scene, in its own unit of time. [default: that of an edited scene, else 0]
    #[arg(long, value_name = "T", allow_negative_numbers = true)]
    pub time: Option<f64>,
}

/// `compare`.
#[derive(Debug, Args)]
pub struct CompareArgs {
    /// The picture: .exr, or .png.
    pub picture: PathBuf,
    /// What it should be: .exr, or .png.
    pub reference: PathBuf,
    /// Save a map of the visible differences (FLIP): black is none.
    #[arg(short, long = "output", value_name = "FILE.png")]
    pub output: Option<Output>,
    /// Write the measures to standard output as one JSON object.
    #[arg(long)]
    pub json: bool,
    /// Compare even if the reference says that it lacks light which its path tracer cannot find.
    #[arg(long)]
    pub incomplete: bool,
}

/// `bench`.
#[derive(Debug, Args)]
pub struct BenchArgs {
    /// Scenes: folders or files.
    #[arg(required_unless_present = "pruning")]
    pub scenes: Vec<PathBuf>,
    /// Size of the picture, pixels.
    #[arg(long, value_name = "WxH", default_value = "640x480")]
    pub size: Size,
    /// Frames to time.
    #[arg(long, value_name = "N", default_value_t = 18, value_parser = clap::value_parser!(u32).range(1..))]
    pub frames: u32,
    /// Threads. [default: one a core]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub threads: Option<u16>,
    /// Measure the interactive loop instead: frames a second and latency while camera, objects, materials, lamps, the
    /// time and a knob change, until a browser could show it; and flicker. A lamp and a moving box are added to scenes
    /// that have none.
    #[arg(long)]
    pub live: bool,
    /// Measure instead what it saves to leave out what a scene does not need: the whole pipeline and the pruned one in
    /// turn, on one thread, by processor time. A room that needs little is added to the scenes.
    #[arg(long, conflicts_with_all = ["live", "threads"])]
    pub pruning: bool,
    /// Measure instead how many single rays and points a second one core answers, part by part, sorted and scattered,
    /// by processor time: what front ends that keep what they know can count on.
    #[arg(long, conflicts_with_all = ["live", "pruning", "threads"])]
    pub questions: bool,
    /// With --questions: ask an igi-worker process of one thread, over QUIC on this machine's loopback, and go by the
    /// clock.
    #[arg(long, requires = "questions")]
    pub over_quic: bool,
    /// Measure instead, step by step, what a moving picture takes on one thread that is made at once of what is known, at
    /// 256x256, 512x512, 640x480 and 1280x720, beside the Render Cache's paper: by --method, or by all that make them so and
    /// by their papers' settings.
    #[arg(long, conflicts_with_all = ["live", "pruning", "questions", "ingest", "threads", "size", "frames"])]
    pub caches: bool,
    /// Measure instead what it takes from a lamp's slider to the picture, step by step, where each lamp is drawn apart; and how
    /// noisy that picture is beside one that is drawn at once in the same processor time (--frames of it).
    #[arg(long, conflicts_with_all = ["live", "pruning", "questions", "ingest", "caches"])]
    pub mix: bool,
    /// Measure instead what the master can take in: workers of this process give answers that were made before, over QUIC on
    /// the loopback. Processor time by thread, at rest and in motion; each stage, and the schedule, alone.
    #[arg(long, conflicts_with_all = ["live", "pruning", "questions"])]
    pub ingest: bool,
    /// With --ingest: numbers of such workers, one after the other.
    #[arg(long, value_name = "N,N,…", value_delimiter = ',', default_values_t = [8, 64], requires = "ingest",
        value_parser = clap::value_parser!(u16).range(1..=2048))]
    pub workers: Vec<u16>,
    /// … with so many threads each …
    #[arg(long, value_name = "N", default_value_t = 8, requires = "ingest",
        value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub worker_threads: u16,
    /// … that draw so many million pixels a second each. [default: they answer at once]
    #[arg(long, value_name = "MPIXEL/S", value_parser = parse::positive, requires = "ingest")]
    pub worker_speed: Option<f64>,
    /// With --ingest: workers come through so many relays, each a process of its own on this machine.
    #[arg(long, value_name = "N", default_value_t = 0, requires = "ingest", value_parser = clap::value_parser!(u16).range(..=64))]
    pub relays: u16,
    /// With --ingest: this share of the answers is asked of another worker as well and compared.
    #[arg(long, value_name = "SHARE", default_value_t = 0.0, requires = "ingest", value_parser = parse::share)]
    pub check_share: f64,
    /// Time of each measurement of --ingest, seconds.
    #[arg(long, value_name = "S", default_value_t = 4.0, value_parser = parse::positive, requires = "ingest")]
    pub seconds: f64,
    /// Frames a second that --live aims at.
    #[arg(long, value_name = "N", default_value_t = 10.0, value_parser = parse::rate, requires = "live")]
    pub rate: f32,
    /// With --live: as if workers were so far away, there and back, milliseconds.
    #[arg(long, value_name = "MS", default_value_t = 0.0, value_parser = parse::milliseconds, requires = "live")]
    pub far: f64,
    #[command(flatten)]
    pub(crate) method: MethodArgs,
    /// Write one JSON object a scene instead of a table.
    #[arg(long)]
    pub json: bool,
}

const EXAMPLES: &str = "\
Examples:
  igi-master render scenes/cornell          ten seconds, here, to cornell.png
  igi-master render scenes/sponza -o a.exr --error 0.01
  igi-master view scenes/conference         look around
  igi-master plan scenes/sponza             what the scene uses
  igi-master compare a.exr reference.exr -o diff.png
  igi-master bench scenes/cornell_spheres   frames a second, where the time goes
  igi-master measure scenes/conference --on floor --above 0.8
                                            illuminance on the working plane
  igi-master report scenes/cornell          error against run time, with plots
  igi-master reference scenes/cornell -o ref.exr --until-noise 1e-4
  igi-master scale scenes/cornell           frames a second against clients
  igi-master export scenes/cornell --mitsuba cornell-mitsuba/
  igi-master selftest                       is light right on this machine?";

const MORE_HELP: &str = "\
`igi-master help render` explains every knob; --help also lists exit codes and
environment variables.";

const LONG_HELP: &str = "\
Exit codes:
  0    done
  1    failed: a picture cannot be written (those that can are written, and what
       is left goes to the folder for temporary files), memory does not suffice,
       --denoise without Open Image Denoise, …
  2    wrong use: an unknown flag, a value out of range
  3    the scene cannot be used: missing, broken, or beyond what this draws
  4    no workers: for longer than --wait, or when --seconds were over and no
       frame was complete
  5    the picture has gaps: workers died on some tiles, which were set aside;
       it has been saved
  6    the reference lacks light that its path tracer cannot find; it has been
       saved, says so in its metadata, and is refused by compare and report
  130  interrupted; what was drawn by then has been saved, unless interrupted
       twice

Environment:
  IGI_WORKERS, IGI_LISTEN       as --workers, --listen
  IGI_TOKEN, IGI_TOKEN_LIFETIME as --token, --token-lifetime; only you can read it
                                there, and everybody on a command line
  IGI_METRICS                   as --metrics
  IGI_HTTP, IGI_VIEWER_TOKEN    as --http, --viewer-token
  IGI_PYTHON                    as report --python
  IGI_OIDN                      as --oidn: where Open Image Denoise is
  IGI_SSH, IGI_WORKER           doctor: the ssh to use, the worker program there
  RUST_LOG                      more to say, such as RUST_LOG=info
  IGI_LOG=json                  what RUST_LOG lets through, as JSON lines
  OTEL_EXPORTER_OTLP_ENDPOINT   where spans of frames go, such as
                                http://localhost:4318 (if built with --features
                                otel; OTEL_SERVICE_NAME counts as well)
  NO_COLOR                      no colours";

const DOCTOR_HELP: &str = "\
It runs `igi-worker doctor` on each machine. Environment: IGI_SSH, the ssh to
use (`ssh -p 2222`); IGI_WORKER, the program there (`.igi/igi-worker`, if
deploy/lan/workers.sh has pushed it).";

const RENDER_EXAMPLES: &str = "\
Examples:
  igi-master render scenes/cornell -o a.png -o a.exr --aov --seconds 60
  igi-master render scenes/conference --error 0.005 --size 1280x960 -o a.exr
  igi-master render model.glb --exposure auto --tone agx
  igi-master render scenes/sponza --listen 0.0.0.0:7464
      then start workers as it says
  igi-master render room.json --frames-range 0..240 -o out.%04d.exr --error 0.01
  igi-master render scenes/cornell --paper --frames 1
      as in the paper of 2002

Ctrl-C once finishes the frame and saves; twice stops at once.";

const PLAN_EXAMPLES: &str = "\
Examples:
  igi-master plan scenes/sponza
  igi-master plan scenes/cornell --paper
  igi-master plan scenes/conference --json > plan.json";

const COMPARE_EXAMPLES: &str = "\
Examples:
  igi-master compare a.exr scenes/cornell/ref.exr
  igi-master compare a.exr b.exr -o diff.png --json";

const BENCH_EXAMPLES: &str = "\
Examples:
  igi-master bench --paper scenes/cornell_spheres scenes/conference
  igi-master bench --live scenes/conference
  igi-master bench --pruning scenes/veach_door --size 120x90 --frames 3
  igi-master bench --questions scenes/conference";

const EXPORT_EXAMPLES: &str = "\
Examples:
  igi-master export scenes/cornell --mitsuba cornell-mitsuba/
  igi-master export scenes/conference --mitsuba small/ --size 200x150";

const TOKEN_EXAMPLES: &str = "\
Examples:
  export IGI_TOKEN=\"$(igi-master token --lifetime 12h)\"
  igi-master token --rotate token.txt
      for a master and workers with --token-file token.txt
  igi-master token --for-workers token.txt
      what to give to workers that should not be able to play the master
  igi-master token --rotate token.txt --grace 1h";

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_command_line_is_sound() {
        Cli::command().debug_assert();
    }
}
