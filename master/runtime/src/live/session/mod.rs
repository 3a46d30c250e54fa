//! The session with people: the thread that viewers and workers meet at. [`frame::live::Live`] decides, [`Driver`] carries
//! out.

mod denoising;
mod exposure;
mod hanging;
mod keeping;
mod messages;
mod mixing;
mod presets;
mod report;
mod saving;

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use frame::Layer;
use frame::live::edits::Edits;
use frame::live::latency::Latency;
use frame::live::{Ended, Event, Knobs, Step};
use frame::parts::Smoother;
use frame::tone::{Exposure, Tone};
use scenes::{Camera, Preset, SavedView};

use super::audience::Audience;
use super::driver::{Driver, Outcome};
use super::record::{Recorder, What};
use super::screen;
use crate::cluster::Cluster;
use crate::console::Console;
use crate::display::encoded::{DisplaySettings, ToneMapper};
use crate::display::hub::Hub;
use crate::display::hues::Hues;
use crate::display::message::{InputStamp, ServerMessage};
use crate::display::thread::DisplayThread;
use crate::interrupt::Interrupt;
use crate::methods::Named;
use crate::show::tev::Tev;
use denoising::Denoising;
use exposure::Exposing;
use keeping::Keeping;
pub use keeping::counted;
use mixing::Mixing;
use report::Period;
pub use saving::SceneFile;

/// See the module's documentation.
pub struct Session {
    driver: Driver,
    edits: Edits,
    hub: Hub,
    display: DisplayThread,
    settings: DisplaySettings,
    audience: Audience,
    /// Pictures have the size that they had at the start, whatever screens they are shown on.
    is_size_fixed: bool,
    exposing: Option<Exposing>,
    /// Pictures are drawn for a viewer, tev or a program; `asked_at`: when a program last asked for one.
    watched: bool,
    asked_at: Option<Instant>,
    has_said_paused: bool,
    period: Period,
    /// From inputs to pictures that are ready to be sent.
    latency: Arc<Mutex<Latency>>,
    /// Inputs of viewers by the revisions that they made, oldest first: the first is in the last picture, the others are
    /// in none yet.
    inputs: VecDeque<(u64, Option<InputStamp>)>,
    recorder: Option<Recorder>,
    denoising: Option<Denoising>,
    mixing: Option<Mixing>,
    tev: Option<Tev>,
    /// The colours of what is off.
    hues: Hues,
    /// Saved by people.
    views: Vec<SavedView>,
    presets: Vec<Preset>,
    keeping: Option<Keeping>,
    scene_file: Option<SceneFile>,
}

/// Commands of viewers, and events of workers, that are handled in turn.
const IN_TURN: usize = 16;
/// Viewers are sent a status this often.
const BETWEEN_REPORTS: Duration = Duration::from_millis(250);
/// A program that asks for a picture without being a viewer is expected to ask again within this time.
const ASKED_LASTS: Duration = Duration::from_secs(30);

impl Session {
    /// Without viewers.
    ///
    /// # Errors
    /// The system has no more threads.
    pub fn new(
        cluster: Cluster,
        hub: Hub,
        mut camera: Camera,
        mut knobs: Knobs,
        tone: Tone,
        tone_mapper: Box<dyn ToneMapper>,
    ) -> std::io::Result<Self> {
        let exposing = (tone.exposure == Exposure::Auto).then(|| Exposing::begin(&mut camera, &mut knobs));
        let settings = DisplaySettings { layer: knobs.layer, tone, denoise: false };
        let driver = Driver::new(cluster, camera, knobs, false);
        let (now, latency) = (driver.begun(), Arc::<Mutex<Latency>>::default());
        let (shown, waited) = (hub.clone(), Arc::clone(&latency));
        let display = DisplayThread::start(settings.clone(), tone_mapper, move |encoded| {
            if let Some(since) = encoded.since {
                let micros = now.elapsed().as_micros() as u64;
                waited.lock().unwrap_or_else(PoisonError::into_inner).add(micros.saturating_sub(since.0));
            }
            shown.show(Arc::new(encoded));
        })?;
        Ok(Self {
            driver,
            edits: Edits::default(),
            hub,
            display,
            settings,
            audience: Audience::default(),
            is_size_fixed: false,
            exposing,
            watched: true,
            asked_at: None,
            has_said_paused: false,
            period: Period::new(now),
            latency,
            inputs: VecDeque::from([(0, None)]),
            recorder: None,
            denoising: None,
            mixing: None,
            tev: None,
            hues: Hues::default(),
            views: Vec::new(),
            presets: Vec::new(),
            keeping: None,
            scene_file: None,
        })
    }

    /// Records what people do from now on.
    pub fn record_to(&mut self, recorder: Recorder) {
        self.recorder = Some(recorder);
    }

    /// Has pictures smoothed elsewhere.
    pub fn smooth_by(&mut self, smoother: Box<dyn Smoother>) {
        self.driver.live.smooth_by(smoother);
    }

    /// Shows pictures at rest there as well.
    pub fn show_in(&mut self, tev: Tev) {
        self.tev = Some(tev);
    }

    /// Pictures stay as large as the camera's, whatever screens they are shown on.
    pub fn fix_size(&mut self) {
        self.is_size_fixed = true;
    }

    /// From where people look, and how large the picture is.
    pub fn camera(&self) -> Camera {
        self.driver.live.camera()
    }

    /// The scene has been published.
    pub fn begin(&mut self) {
        self.driver.begin();
        self.handle_outcomes(None);
    }

    /// Runs until Ctrl-C: viewers, workers and the status in turn, so that none of them waits for long, however much the
    /// others send.
    pub fn run(&mut self, interrupt: &Interrupt, console: &Console) {
        while !interrupt.asked() {
            let mut is_empty = false;
            for _ in 0..IN_TURN {
                match self.hub.next_command() {
                    Some(command) => self.handle_command(command),
                    None => {
                        is_empty = true;
                        break;
                    }
                }
            }
            self.pause_or_go_on(console);
            self.expose(console);
            self.go_on_mixing();
            let mut patience = if is_empty { BETWEEN_REPORTS } else { Duration::ZERO };
            for _ in 0..IN_TURN {
                let has_come = self.recv(patience);
                self.handle_outcomes(Some(console));
                patience = Duration::ZERO;
                if !has_come {
                    break;
                }
            }
            if self.period.since.elapsed() >= BETWEEN_REPORTS {
                self.report();
            }
            self.keep_if_stale();
        }
        self.stop_mixing();
        self.finish_saving(console);
        self.finish_keeping(console);
    }

    /// Workers draw while pictures are looked at or asked for.
    fn pause_or_go_on(&mut self, console: &Console) {
        let was_asked = self.asked_at.is_some_and(|at| at.elapsed() < ASKED_LASTS);
        let watched = self.audience.is_looking() || self.tev.is_some() || was_asked;
        if watched == std::mem::replace(&mut self.watched, watched) {
            return;
        }
        if !watched && !std::mem::replace(&mut self.has_said_paused, true) {
            console.line("nobody watches: drawing pauses after the first frame, and goes on when somebody looks");
        }
        self.handle_event(Event::Watched(watched));
    }

    /// Makes the picture as large as it is on the screen of the controls' holder.
    fn fit(&mut self) {
        if let Some([width, height]) = self.fitting().filter(|_| self.exposing.is_none()) {
            self.handle_event(Event::Look(Camera { width, height, ..self.camera() }));
        }
    }

    /// The size for the screen of the controls' holder, if it is known and decides.
    fn fitting(&self) -> Option<[u32; 2]> {
        let (wanted, fields) = (self.audience.screen()?, self.driver.cluster.fields()?);
        let live = &self.driver.live;
        (!self.is_size_fixed).then(|| screen::fitted(&live.camera(), wanted, &live.knobs().method, fields))
    }

    fn handle_event(&mut self, event: Event) {
        if self.mix(&event) {
            return;
        }
        match &event {
            Event::Look(camera) if *camera != self.camera() => {
                self.record(What::Look(*camera));
                self.note_change();
            }
            Event::Edit(changes) => {
                self.record(What::Edit(changes.clone()));
                self.note_change();
            }
            Event::Turn(knobs) if knobs.method != self.driver.live.knobs().method => {
                self.record(What::Turn(Named::from(&knobs.method)));
                self.denoise_anew();
            }
            _ => {}
        }
        self.driver.handle(event);
        self.handle_outcomes(None);
    }

    /// Shows and sends what has come of events; what is about workers is printed, too, if there is a console.
    fn handle_outcomes(&mut self, console: Option<&Console>) {
        while let Some(outcome) = self.driver.next_outcome() {
            self.handle_outcome(outcome, console);
        }
    }

    fn handle_outcome(&mut self, outcome: Outcome, console: Option<&Console>) {
        match outcome {
            Outcome::Ended(Ended { effort, batches, still }) => {
                self.record(What::Shown { batches, effort: effort.0, still });
            }
            Outcome::Step(Step::Began) => self.record(What::Began {}),
            Outcome::Step(Step::Overtaken) => self.record(What::Overtaken {}),
            Outcome::Frame(frame) => {
                self.period.count(&frame);
                let is_for_tev = frame.moving.is_none() && frame.layer == Layer::FINAL;
                if let Some(tev) = self.tev.as_mut().filter(|tev| is_for_tev && (frame.finished || tev.is_due())) {
                    tev.show((*frame.picture).clone());
                }
                let input = self.input_of(frame.revision);
                let is_whole = frame.finished;
                self.denoise(&frame, input);
                self.display.show(*frame, input);
                if let Some(exposing) = self.exposing.as_mut().filter(|_| is_whole) {
                    exposing.first = self.driver.live.last_radiance().cloned();
                }
            }
            Outcome::Edited { .. } => {}
            Outcome::Trouble(reason) => self.hub.send_all(&ServerMessage::Trouble { reason }),
            Outcome::Cluster(event) => {
                if let Some(console) = console {
                    console.event(&event);
                }
                self.report();
            }
        }
    }

    /// The last input of a viewer that a picture of this revision shows.
    fn input_of(&mut self, revision: u64) -> Option<InputStamp> {
        while self.inputs.get(1).is_some_and(|(next, _)| *next <= revision) {
            self.inputs.pop_front();
        }
        self.inputs.front().and_then(|(_, input)| *input)
    }

    /// Adds a line to the recording, if there is one.
    fn record(&mut self, what: What) {
        let t = self.driver.begun().elapsed().as_secs_f64();
        let Some(Err(error)) = self.recorder.as_mut().map(|recorder| recorder.line(t, what)) else { return };
        tracing::error!("{error:#}");
        self.recorder = None;
        self.hub.send_all(&ServerMessage::Trouble { reason: error.to_string() });
    }
}
