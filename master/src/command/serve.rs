//! `igi-master serve` and `view`: a scene that people look at, move and change.

use std::path::PathBuf;
use std::sync::Arc;

use anyhow::{Context, anyhow};
use frame::Layer;
use frame::live::{Knobs, Making};
use frame::parts::Smoother;
use frame::tone::{Exposure, Tone};
use protocol::answer::Fields;
use scenes::read::Loaded;
use scenes::{Needs, Scene};
use serde_json::json;

use crate::cli::ServeArgs;
use crate::command::load::{load, say_what_is_missing};
use crate::command::{options, replay};
use runtime::cluster::{Cluster, ClusterOptions};
use runtime::console::Console;
use runtime::denoise::{Denoiser, Place};
use runtime::display::encoded::{CpuToneMapper, ToneMapper};
use runtime::display::hub::Hub;
use runtime::failure::{Failure, Success};
use runtime::files::name_of;
use runtime::interrupt::Interrupt;
use runtime::live::kept::folder;
use runtime::live::record::Recorder;
use runtime::live::session::{self, SceneFile, Session};
use runtime::memory;
use runtime::reception::Reception;
use runtime::show::browser::{Browser, Door};
#[cfg(feature = "window")]
use runtime::show::gpu::{Gpu, filter::GpuSmoother, tone::GpuToneMapper};
use runtime::show::tev::Tev;

/// What is opened on this machine.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Open {
    /// Nothing: whoever wants to watch knows where.
    Nothing,
    /// A browser.
    Browser,
    /// A window; a browser if there can be none.
    Window,
}

/// Shows a scene in browsers, and in what is opened here, until Ctrl-C or until the window is closed.
///
/// # Errors
/// [`Failure`] if the scene cannot be read, or an address not be listened at.
pub fn serve(args: &ServeArgs, open: Open) -> Result<Success, Failure> {
    let console = Console::new(options::console(args.talk));
    let door = Door::new(args.http, args.viewer_token.clone()).map_err(Failure::Usage)?;
    let loaded = load(&args.scene, args.time, args.size, &console)?;
    let scene_file = SceneFile::of(&loaded, args.save_to.as_deref(), args.record.as_deref())?;
    let Loaded { scene, time, .. } = loaded;
    say_what_is_missing(args.method.0.method, &scene, &console);
    let camera = scene.camera;
    let fields = Fields::of(&Needs::of(&scene));
    memory::demand(args.method.0.memory_bytes(&camera, fields), &camera)?;
    let knobs = Knobs {
        method: args.method.0.clone(),
        seed: args.seed,
        rate: args.rate,
        effort: None,
        rest_after: args.rest_after,
        layer: Layer::FINAL,
        making: Making::InTime,
    };
    let exposure = options::exposure(args.look.exposure.map(Exposure::Fixed), &scene);
    let tone = Tone { exposure, operator: args.look.tone.into() };

    let denoiser = Denoiser::open(args.oidn.path.as_deref(), Place::Fastest);
    let denoiser = match denoiser {
        Err(reason) if args.denoise || args.oidn.path.is_some() => return Err(Failure::Failed(anyhow!(reason))),
        found => found.ok(),
    };
    let recorder = args.record.as_deref().map(Recorder::create).transpose()?;
    let interrupt = Interrupt::listen_saying(ENDING, ENDED);
    let workers = ClusterOptions { give_way: true, ..options::cluster(&args.cluster) };
    let mut cluster = Cluster::start(workers).context("workers cannot be started")?;
    let _reception = Reception::open(&options::reception(&args.cluster), &cluster, &console)?;
    let hub = Hub::new(cluster.waker());
    let browser = Browser::start(door, hub.clone()).map_err(|error| Failure::Failed(anyhow!(error)))?;
    let (url, url_once) = (browser.url(), browser.url_once());
    console.line(&format!("to watch: {url}   (Ctrl-C ends it)"));
    console.emit("serving", json!({ "url": url, "address": browser.address().to_string() }));

    let scene = Arc::new(scene);
    let world = cluster.publish(Arc::clone(&scene)).context("the scene cannot be sent to workers")?;
    let (tone_mapper, smoother) = finishers(args, &console);
    let session = Session::new(cluster, hub.clone(), camera, knobs.clone(), tone, tone_mapper);
    let mut session = session.context("cannot start a thread")?;
    if args.size.is_some() {
        session.fix_size();
    }
    if let Some(smoother) = smoother {
        session.smooth_by(smoother);
    }
    if let Some(denoiser) = denoiser {
        console.line(&format!("pictures at rest can be denoised: {}", denoiser.name()));
        session.denoise_by(denoiser, args.denoise).context("cannot start a thread")?;
    }
    if let Some(mut recorder) = recorder {
        recorder.begin(&replay::begun(&args.scene, &world, time, session.camera(), &knobs))?;
        session.record_to(recorder);
    }
    if let Some(address) = args.tev.clone() {
        session.show_in(Tev::start(address, &name_of(&args.scene)).context("cannot start a thread")?);
    }
    session.save_edits_to(scene_file);
    session.begin();
    if !args.no_session {
        keep_session(&mut session, args, scene, &console)?;
    }
    let closed = std::thread::scope(|scope| {
        let (interrupt, console) = (&interrupt, &console);
        let thread = std::thread::Builder::new().name("session".into()).spawn_scoped(scope, move || {
            session.run(interrupt, console);
        });
        thread.context("cannot start a thread")?;
        let closed = watch(open, &hub, [&url, &url_once], &name_of(&args.scene), console);
        if closed {
            interrupt.ask();
        }
        anyhow::Ok(closed)
    })?;
    drop(browser);
    Ok(if closed { Success::Done } else { Success::Interrupted })
}

/// What Ctrl-C says at first, and when it is pressed again.
const ENDING: &str = "ending";
const ENDED: &str = "stopped at once; what was done in the last second may be lost";

/// Keeps the session, and takes up or forgets what is kept of this scene, or offers it.
fn keep_session(session: &mut Session, args: &ServeArgs, scene: Arc<Scene>, console: &Console) -> Result<(), Failure> {
    let sessions = folder::sessions(|variable| std::env::var_os(variable).map(PathBuf::from));
    let mut opened = match folder::open(sessions.as_deref(), &args.scene) {
        Ok(opened) => opened,
        Err(reason) => {
            console.line(&format!("this session is not kept: {reason}"));
            return Ok(());
        }
    };
    for broken in &opened.broken {
        console.line(&format!("a session of this scene cannot be read, and is left as it is: {broken}"));
    }
    if args.fresh && opened.found.iter().any(|(_, session)| session.has_edits()) {
        console.line(&format!("{} of this scene forgotten", session::counted(opened.forget_edits(), "edit")));
    }
    if opened.own.is_none() {
        console.line("this session is not kept until another is taken up (--resume) or forgotten (--fresh)");
    }
    let path = args.scene.canonicalize().unwrap_or_else(|_| args.scene.clone());
    session.keep_session(opened, path, scene).context("cannot start a thread")?;
    let Some(offer) = session.offer_line() else {
        if args.resume {
            console.line("nothing is kept of this scene: it begins as its files say");
        }
        return Ok(());
    };
    if args.resume {
        console.line(&session.take_up().map_err(|reason| anyhow!(reason))?);
    } else {
        console.line(&format!("{offer}; to take up in the viewer, or with --resume; --fresh forgets it"));
    }
    Ok(())
}

/// What smooths and tone-maps pictures: a graphics processor, if there is one.
#[cfg(feature = "window")]
fn finishers(args: &ServeArgs, console: &Console) -> (Box<dyn ToneMapper>, Option<Box<dyn Smoother>>) {
    match Gpu::open(args.gpu) {
        Ok(gpu) => {
            console.line(&format!("pictures are smoothed and tone-mapped on {}", gpu.name()));
            (Box::new(GpuToneMapper::new(gpu.clone())), Some(Box::new(GpuSmoother::new(gpu))))
        }
        Err(reason) => {
            console.line(&format!("pictures are tone-mapped without a graphics processor: {reason}"));
            (Box::new(CpuToneMapper), None)
        }
    }
}

#[cfg(not(feature = "window"))]
fn finishers(_args: &ServeArgs, _console: &Console) -> (Box<dyn ToneMapper>, Option<Box<dyn Smoother>>) {
    (Box::new(CpuToneMapper), None)
}

/// Opens what is wanted, or what can be had. True if it was a window, and is closed again.
fn watch(open: Open, hub: &Hub, [url, url_once]: [&str; 2], title: &str, console: &Console) -> bool {
    match open {
        Open::Nothing => return false,
        Open::Browser => {}
        Open::Window => match open_window(hub, title) {
            Ok(()) => return true,
            Err(reason) => console.line(&format!("no window: {reason}; a browser instead")),
        },
    }
    if let Err(error) = open_browser(url_once) {
        console.line(&format!("no browser could be started ({error}); open {url} in one"));
    }
    false
}

#[cfg(feature = "window")]
use runtime::show::window::run as open_window;

#[cfg(not(feature = "window"))]
fn open_window(_hub: &Hub, _title: &str) -> Result<(), String> {
    Err("this program was built without (cargo build --release --features window)".into())
}

fn open_browser(url: &str) -> std::io::Result<()> {
    let opener = if cfg!(target_os = "macos") { "open" } else { "xdg-open" };
    let mut command = std::process::Command::new(opener);
    let quiet = std::process::Stdio::null;
    command.arg(url).stdin(quiet()).stdout(quiet()).stderr(quiet()).spawn().map(drop)
}
