//! The command line of `render` as it is meant: what was left out has its default, what belongs together stands together.

use std::path::PathBuf;
use std::time::Duration;

use anyhow::anyhow;
use frame::Chosen;
use scenes::Keep;

use super::saving::Style;
use crate::cli::{DenoiseArgs, RenderArgs, Size};
use crate::command::options::{self, duration};
use runtime::cluster::ClusterOptions;
use runtime::console::ConsoleOptions;
use runtime::denoise::{Denoiser, Place};
use runtime::failure::Failure;
use runtime::files::Output;
use runtime::reception::ReceptionOptions;
use runtime::show::tev::TevAddress;
use runtime::stats::Stop;

/// What is to be drawn, by whom, until when, and where it goes.
#[derive(Clone, Debug)]
pub(crate) struct Settings {
    /// Folder or file.
    pub(crate) scene: PathBuf,
    /// Moment of it, in its own unit of time; `None`: that of an edited scene, else 0.
    pub(crate) time: Option<f64>,
    /// Pixels; `None`: as many as the scene says.
    pub(crate) size: Option<Size>,
    /// Where pictures go; empty if that was not said.
    pub(crate) outputs: Vec<Output>,
    /// How the picture is made.
    pub(crate) method: Chosen,
    pub(crate) seed: u64,
    pub(crate) keep: Keep,
    pub(crate) stop: Stop,
    pub(crate) style: Style,
    /// Whether pictures are denoised, and where the library is.
    denoise: DenoiseArgs,
    pub(crate) checkpoint: Option<Checkpoint>,
    /// How often what is drawn so far goes to the outputs.
    pub(crate) autosave: Option<Duration>,
    pub(crate) tev: Option<TevAddress>,
    pub(crate) cluster: ClusterOptions,
    pub(crate) reception: ReceptionOptions,
    pub(crate) console: ConsoleOptions,
}

/// What is kept for a crash.
#[derive(Clone, Debug)]
pub(crate) struct Checkpoint {
    /// Where.
    pub(crate) folder: PathBuf,
    /// How often.
    pub(crate) every: Duration,
}

impl Settings {
    /// What these flags mean.
    pub(crate) fn new(args: &RenderArgs) -> Self {
        let keep = if args.keep_all { Keep::All } else { Keep::Needed };
        let every = duration(args.checkpoint_every);
        Self {
            scene: args.scene.clone(),
            time: args.time,
            size: args.size,
            outputs: args.output.clone(),
            method: args.method.0.clone(),
            seed: args.seed,
            keep,
            stop: stop(args),
            style: Style {
                exposure: args.look.exposure.map(|chosen| chosen.0),
                operator: args.look.tone.into(),
                aov: args.look.aov,
            },
            denoise: args.denoise.clone(),
            checkpoint: args.checkpoint.clone().map(|folder| Checkpoint { folder, every }),
            autosave: args.autosave.map(duration),
            tev: args.tev.clone(),
            cluster: ClusterOptions { keep, ..options::cluster(&args.cluster) },
            reception: options::reception(&args.cluster),
            console: options::console(args.talk),
        }
    }
}

impl Settings {
    /// What pictures go through before they are written, if that was asked for.
    ///
    /// # Errors
    /// [`Failure::Failed`]: it is not installed.
    pub(crate) fn denoiser(&self) -> Result<Option<Denoiser>, Failure> {
        let DenoiseArgs { denoise, oidn } = &self.denoise;
        let open = || Denoiser::open(oidn.path.as_deref(), Place::Processor);
        denoise.then(open).transpose().map_err(|reason| Failure::Failed(anyhow!(reason)))
    }
}

fn stop(args: &RenderArgs) -> Stop {
    let asked = &args.stop;
    let none = asked.seconds.is_none() && asked.frames.is_none() && asked.error.is_none();
    let seconds = if none { Some(DEFAULT_SECONDS) } else { asked.seconds };
    Stop {
        after: seconds.map(duration),
        frames: asked.frames,
        error: asked.error,
        spent: Duration::ZERO,
        without_workers: options::wait(&args.wait),
    }
}

/// How long it draws if nobody says when to stop: enough for a clean picture of most scenes, short
/// enough not to wonder.
const DEFAULT_SECONDS: f64 = 10.0;
