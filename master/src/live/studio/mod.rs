//! The thread that people and workers meet at: [`frame::live::Live`] decides, [`Driver`] carries out.

mod keeping;

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use frame::live::edits::{self, Edits};
use frame::live::latency::Latency;
use frame::live::{self, Ended, Event, pick};
use frame::parts::Smoother;
use frame::tone::{Exposure, STOPS_MAX, Tone};
use frame::{Chosen, Layer, Picture, Probe};
use scenes::photometry::photometric;
use scenes::{Camera, Change, Scene};
use serde_json::json;

use super::audience::{Asked, Audience};
use super::driver::{Driver, Outcome};
use super::record::{Recorder, What};
use super::screen;
use crate::cluster::Cluster;
use crate::console::Console;
use crate::display::develop::{Darkroom, Developer, Manner};
use crate::display::hub::{Command, Hub, Viewer};
use crate::display::hues::Hues;
use crate::display::message::{
    ClientMessage, Edited, InputStamp, Knobs, MeterReading, MethodInfo, Probed, SceneInfo, ServerMessage, Spot, Status,
    ToneSettings, Viewpoint, Welcome, WorkerStatus,
};
use crate::display::saved::{self, Taken};
use crate::interrupt::Interrupt;
use crate::memory;
use crate::methods::{self, Named};
use crate::show::tev::Tev;
use keeping::Keeping;
pub(crate) use keeping::counted;

/// See the module's documentation.
pub struct Studio {
    driver: Driver,
    edits: Edits,
    hub: Hub,
    darkroom: Darkroom,
    manner: Manner,
    audience: Audience,
    /// Pictures have the size that they had at the start, whatever screens they are shown on.
    is_size_fixed: bool,
    exposing: Option<Exposing>,
    /// Somebody looks; `asked_at`: when somebody last asked for the picture without watching.
    watched: bool,
    asked_at: Option<Instant>,
    has_said_paused: bool,
    meter: Meter,
    /// From inputs to pictures that are developed.
    latency: Arc<Mutex<Latency>>,
    /// Inputs of viewers by the revisions that they made, oldest first: the first is in the last picture, the others are
    /// in none yet.
    heard: VecDeque<(u64, Option<InputStamp>)>,
    recorder: Option<Recorder>,
    tev: Option<Tev>,
    /// The colours of what is off.
    hues: Hues,
    /// Saved by people.
    views: Vec<Viewpoint>,
    keeping: Option<Keeping>,
}

/// No exposure is chosen: the first whole picture decides. It is the scene's own view, small and of one frame, so that it is
/// there at once, and its exposure is the same on any screen.
struct Exposing {
    /// In radiance, once it is there.
    first: Option<Picture>,
    /// Of the pictures after it.
    size: [u32; 2],
    rest_after: u32,
}

/// Pixels of the picture that the exposure is chosen by.
const EXPOSED_PIXELS: u64 = 30_000;

/// Commands of people, and events of workers, that are heard in turn.
const IN_TURN: usize = 16;

/// Pictures, rays and bytes since the last report.
struct Meter {
    since: Instant,
    pictures: u32,
    moving: u32,
    /// When the error was estimated, and what it was: relative mean squared error.
    estimated: Instant,
    error: Option<f64>,
}

/// Viewers are told how things stand this often.
const BETWEEN_REPORTS: Duration = Duration::from_millis(250);
/// The estimate looks at every pixel, so not too often.
const BETWEEN_ESTIMATES: Duration = Duration::from_millis(1000);
/// Inputs that are remembered until a picture shows them; without workers, none may for hours.
const HEARD_MAX: usize = 256;
/// Whoever asks for a picture without watching, a program perhaps, will ask again within this time.
const ASKED_LASTS: Duration = Duration::from_secs(30);

impl Studio {
    /// Nobody there.
    ///
    /// # Errors
    /// The system has no more threads.
    pub fn new(
        cluster: Cluster,
        hub: Hub,
        mut camera: Camera,
        mut knobs: live::Knobs,
        tone: Tone,
        developer: Box<dyn Developer>,
    ) -> std::io::Result<Self> {
        let size = [camera.width, camera.height];
        let is_exposing = tone.exposure == Exposure::Auto;
        let exposing = is_exposing.then_some(Exposing { first: None, size, rest_after: knobs.rest_after });
        if is_exposing {
            [camera.width, camera.height] = screen::within(EXPOSED_PIXELS, size);
            knobs.rest_after = 1;
        }
        let manner = Manner { layer: knobs.layer, tone };
        let driver = Driver::new(cluster, camera, knobs, false);
        let (now, latency) = (driver.begun(), Arc::<Mutex<Latency>>::default());
        let (shown, waited) = (hub.clone(), Arc::clone(&latency));
        let darkroom = Darkroom::start(manner.clone(), developer, move |print| {
            if let Some(since) = print.since {
                let micros = now.elapsed().as_micros() as u64;
                waited.lock().unwrap_or_else(PoisonError::into_inner).add(micros.saturating_sub(since.0));
            }
            shown.show(Arc::new(print));
        })?;
        let meter = Meter { since: now, pictures: 0, moving: 0, estimated: now, error: None };
        Ok(Self {
            driver,
            edits: Edits::default(),
            hub,
            darkroom,
            manner,
            audience: Audience::default(),
            is_size_fixed: false,
            exposing,
            watched: true,
            asked_at: None,
            has_said_paused: false,
            meter,
            latency,
            heard: VecDeque::from([(0, None)]),
            recorder: None,
            tev: None,
            hues: Hues::default(),
            views: Vec::new(),
            keeping: None,
        })
    }

    /// Keeps what people do from now on.
    pub fn keep(&mut self, recorder: Recorder) {
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
        self.note_outcomes();
    }

    /// Works until somebody presses Ctrl-C. Top to bottom: people, workers, how things stand. Nobody has to wait for
    /// long until it is his turn, however much the others say.
    pub fn run(&mut self, interrupt: &Interrupt, console: &Console) {
        while !interrupt.asked() {
            let mut all_heard = false;
            for _ in 0..IN_TURN {
                match self.hub.next_command() {
                    Some(command) => self.obey(command),
                    None => {
                        all_heard = true;
                        break;
                    }
                }
            }
            self.attend(console);
            self.expose(console);
            let mut patience = if all_heard { BETWEEN_REPORTS } else { Duration::ZERO };
            for _ in 0..IN_TURN {
                let has_heard = self.driver.listen(patience);
                self.note_outcomes_saying(console);
                patience = Duration::ZERO;
                if !has_heard {
                    break;
                }
            }
            if self.meter.since.elapsed() >= BETWEEN_REPORTS {
                self.report();
            }
            self.keep_if_stale();
        }
        self.finish_keeping(console);
    }

    /// Workers draw while somebody looks.
    fn attend(&mut self, console: &Console) {
        let was_asked = self.asked_at.is_some_and(|at| at.elapsed() < ASKED_LASTS);
        let watched = self.audience.is_looking() || self.tev.is_some() || was_asked;
        if watched == std::mem::replace(&mut self.watched, watched) {
            return;
        }
        if !watched && !std::mem::replace(&mut self.has_said_paused, true) {
            console.line("nobody watches: drawing pauses after the first frame, and goes on when somebody looks");
        }
        self.handle(Event::Watched(watched));
    }

    /// Chooses the exposure by the first whole picture, unless somebody has, and goes on at full size.
    fn expose(&mut self, console: &Console) {
        let Some(Exposing { first: Some(first), size, rest_after }) =
            self.exposing.take_if(|exposing| exposing.first.is_some())
        else {
            return;
        };
        if self.manner.tone.exposure == Exposure::Auto {
            // As it is written beside the slider.
            let stops = (100.0 * Exposure::Auto.stops(&first)).round() / 100.0;
            let why = "lights are in candela or lux; --exposure EV overrides it";
            console.line(&format!("exposure {stops:.2} EV, as the first picture needs ({why})"));
            console.emit("exposure", json!({ "stops": stops }));
            self.manner.tone.exposure = Exposure::Fixed(stops);
            self.darkroom.manner(self.manner.clone());
            self.send_all(&ServerMessage::Knobs(self.knobs()));
        }
        let knobs = live::Knobs { rest_after, ..self.driver.live.knobs().clone() };
        self.handle(Event::Turn(knobs));
        let [width, height] = self.fitting().unwrap_or(size);
        self.handle(Event::Look(Camera { width, height, ..self.driver.live.camera() }));
    }

    /// The picture is as large as the screen of whoever has the controls.
    fn fit(&mut self) {
        if let Some([width, height]) = self.fitting().filter(|_| self.exposing.is_none()) {
            self.handle(Event::Look(Camera { width, height, ..self.driver.live.camera() }));
        }
    }

    /// The size for the screen of whoever has the controls, if it is known and decides.
    fn fitting(&self) -> Option<[u32; 2]> {
        let (wanted, fields) = (self.audience.screen()?, self.driver.cluster.fields()?);
        let live = &self.driver.live;
        (!self.is_size_fixed).then(|| screen::fitted(&live.camera(), wanted, &live.knobs().method, fields))
    }

    fn handle(&mut self, event: Event) {
        match &event {
            Event::Look(camera) if *camera != self.driver.live.camera() => {
                self.record(What::Look(*camera));
                self.note_change();
            }
            Event::Edit(changes) => {
                self.record(What::Edit(changes.clone()));
                self.note_change();
            }
            Event::Turn(knobs) if knobs.method != self.driver.live.knobs().method => {
                self.record(What::Turn(Named::from(&knobs.method)));
            }
            _ => {}
        }
        self.driver.handle(event);
        self.note_outcomes();
    }

    /// Shows and tells what has come.
    fn note_outcomes(&mut self) {
        while let Some(outcome) = self.driver.next_outcome() {
            self.note_outcome(outcome, None);
        }
    }

    fn note_outcomes_saying(&mut self, console: &Console) {
        while let Some(outcome) = self.driver.next_outcome() {
            self.note_outcome(outcome, Some(console));
        }
    }

    fn note_outcome(&mut self, outcome: Outcome, console: Option<&Console>) {
        match outcome {
            Outcome::Ended(Ended { effort, batches }) => self.record(What::Shown { batches, effort: effort.0 }),
            Outcome::Frame(frame) => {
                self.meter.pictures += 1;
                self.meter.moving += u32::from(frame.moving.is_some());
                let is_for_tev = frame.moving.is_none() && frame.layer == Layer::FINAL;
                if let Some(tev) = self.tev.as_mut().filter(|tev| is_for_tev && (frame.finished || tev.is_due())) {
                    tev.show((*frame.picture).clone());
                }
                while self.heard.get(1).is_some_and(|(revision, _)| *revision <= frame.revision) {
                    self.heard.pop_front();
                }
                let input = self.heard.front().and_then(|(_, input)| *input);
                let is_whole = frame.finished;
                self.darkroom.frame(*frame, input);
                if let Some(exposing) = self.exposing.as_mut().filter(|_| is_whole) {
                    exposing.first = self.driver.live.last_radiance().cloned();
                }
            }
            Outcome::Edited { .. } => {}
            Outcome::Trouble(reason) => self.send_all(&ServerMessage::Trouble { reason }),
            Outcome::Cluster(event) => {
                if let Some(console) = console {
                    console.event(&event);
                }
                self.report();
            }
        }
    }

    /// Keeps what happened, if it is to be kept.
    fn record(&mut self, what: What) {
        let t = self.driver.begun().elapsed().as_secs_f64();
        let Some(Err(error)) = self.recorder.as_mut().map(|recorder| recorder.line(t, what)) else { return };
        tracing::error!("{error:#}");
        self.recorder = None;
        self.send_all(&ServerMessage::Trouble { reason: error.to_string() });
    }

    fn obey(&mut self, command: Command) {
        match command {
            Command::Joined { viewer, ear } => {
                self.audience.join(viewer, ear);
                self.welcome(viewer);
                self.tell_who_holds();
            }
            Command::Left { viewer } => {
                self.audience.leave(viewer);
                self.tell_who_holds();
            }
            Command::Said { viewer, said } => {
                if said.needs_controls() && self.audience.holder() != Some(viewer) {
                    return self.refuse(viewer, "somebody else has the controls, and may give them to whoever asks");
                }
                if let Err(reason) = self.listen(viewer, said) {
                    self.refuse(viewer, &reason);
                }
            }
            Command::Picture { meter, reply } => {
                self.asked_at = Some(Instant::now());
                // Who is answered nothing is told that there is no picture yet.
                if let Some(taken) = self.taken(meter) {
                    let _ = reply.send(taken);
                }
            }
        }
    }

    fn listen(&mut self, viewer: Viewer, said: ClientMessage) -> Result<(), String> {
        match said {
            ClientMessage::Look(viewpoint) => {
                let Camera { width, height, .. } = self.driver.live.camera();
                let camera = viewpoint.camera([width, height])?;
                self.heard(InputStamp { viewer, at: viewpoint.at });
                self.handle(Event::Look(camera));
            }
            ClientMessage::Shape { width, height } => {
                self.audience.measure(viewer, [width, height]);
                self.fit();
            }
            ClientMessage::Hidden { hidden } => self.audience.hide(viewer, hidden),
            ClientMessage::Edit { changes, gesture, at } => {
                self.heard(InputStamp { viewer, at });
                self.edit(changes, viewer, gesture)?;
            }
            ClientMessage::Undo => {
                if let Some(back) = self.edits.undo() {
                    self.make(back, None)?;
                }
            }
            ClientMessage::Redo => {
                if let Some(forth) = self.edits.redo() {
                    self.make(forth, None)?;
                }
            }
            ClientMessage::Tone(tone) => {
                if tone.exposure.abs() > STOPS_MAX || tone.exposure.is_nan() {
                    return Err(format!("the exposure must be -{STOPS_MAX} to {STOPS_MAX} stops"));
                }
                self.manner.tone = tone.into();
                self.develop_otherwise();
            }
            ClientMessage::AutoExpose => {
                let stops = self.driver.live.last_radiance().map_or(0.0, |picture| Exposure::Auto.stops(picture));
                self.manner.tone.exposure = Exposure::Fixed(stops);
                self.develop_otherwise();
            }
            ClientMessage::Inspect { layer } => {
                let knobs = self.driver.live.knobs();
                let layer = knobs.method.layer(&layer).ok_or_else(|| format!("there is no layer {layer:?}"))?;
                let knobs = live::Knobs { layer, ..knobs.clone() };
                self.manner.layer = layer;
                self.develop_otherwise();
                self.handle(Event::Turn(knobs));
            }
            ClientMessage::Turn { values } => {
                let knobs = self.driver.live.knobs().clone();
                let method = knobs.method.with(values)?;
                self.turn(live::Knobs { method, ..knobs });
            }
            ClientMessage::Rate { rate } => {
                if !(frame::live::pace::RATE_MIN..=frame::live::pace::RATE_MAX).contains(&rate) {
                    return Err("the frame rate must be 0.5 to 120".into());
                }
                self.turn(live::Knobs { rate, ..self.driver.live.knobs().clone() });
            }
            ClientMessage::Method { name } => {
                let method = methods::find(&name).map(Chosen::new);
                let method = method.ok_or_else(|| format!("there is no method {name:?}, only {}", methods::names()))?;
                let knobs = self.driver.live.knobs().clone();
                if knobs.method.method.name() != name {
                    let fields = self.driver.cluster.fields().ok_or("there is no scene yet")?;
                    let camera = self.driver.live.camera();
                    let bytes = method.memory_bytes(&camera, fields);
                    memory::demand(bytes, &camera).map_err(|failure| failure.to_string())?;
                    // The layer, if the method has it as well.
                    let layer = method.layer(knobs.layer.name).unwrap_or(Layer::FINAL);
                    self.manner.layer = layer;
                    self.darkroom.manner(self.manner.clone());
                    self.turn(live::Knobs { method, layer, ..knobs });
                }
            }
            ClientMessage::SaveView(view) => self.save_view(view)?,
            ClientMessage::ForgetView { number } => self.forget_view(number)?,
            ClientMessage::TakeUp => {
                self.take_up()?;
            }
            ClientMessage::StartAfresh => self.start_afresh(),
            ClientMessage::Give { to } => {
                if let Some(asker) = self.audience.give(viewer, to)? {
                    self.refuse(asker, "who has the controls keeps them");
                }
                self.tell_who_holds();
                self.fit();
            }
            ClientMessage::Take => match self.audience.take(viewer) {
                Asked::Given => {
                    self.tell_who_holds();
                    self.fit();
                }
                Asked::Of(holder) => self.audience.send(holder, &ServerMessage::Asked { by: viewer }),
            },
            ClientMessage::Pick(spot) => {
                let scene = self.driver.cluster.scene().ok_or("there is no scene yet")?;
                let picked = ServerMessage::picked(scene, spot, self.pick(scene, spot));
                self.audience.send(viewer, &picked);
            }
            ClientMessage::Probe(spot) => {
                let (pixel, found) = self.measured(spot);
                self.audience.send(viewer, &ServerMessage::Probed(Probed { spot, pixel, found }));
            }
            ClientMessage::Refresh => self.welcome(viewer),
            // The watcher's own business.
            ClientMessage::Drawn { .. } => {}
        }
        Ok(())
    }

    /// Remembers whose input comes next; of inputs that no picture can tell apart, the last.
    fn heard(&mut self, input: InputStamp) {
        let revision = self.driver.live.revision() + 1;
        self.heard.retain(|(earlier, _)| *earlier < revision);
        if self.heard.len() == HEARD_MAX {
            self.heard.pop_front();
        }
        self.heard.push_back((revision, Some(input)));
    }

    /// Makes changes as a viewer wants them, in a gesture or by themselves, and remembers what takes them back.
    fn edit(&mut self, wanted: Vec<Change>, by: Viewer, gesture: Option<u64>) -> Result<(), String> {
        let scene = self.driver.cluster.scene().ok_or("there is no scene yet")?;
        let waiting = self.driver.live.waiting();
        let changes = edits::composed(scene, waiting, wanted);
        changes.iter().try_for_each(|change| change.check(scene)).map_err(|refused| refused.to_string())?;
        self.edits.remember(scene, waiting, &changes, gesture);
        self.make(changes, Some(by))
    }

    /// Makes changes that the scene can take, and tells everyone. `by`: who has made them already in what he sees.
    fn make(&mut self, changes: Vec<Change>, by: Option<Viewer>) -> Result<(), String> {
        let scene = self.driver.cluster.scene().ok_or("there is no scene yet")?;
        let waiting = self.driver.live.waiting();
        changes.iter().try_for_each(|change| change.check(scene)).map_err(|refused| refused.to_string())?;
        changes.iter().for_each(|change| self.hues.learn(scene, waiting, change));
        let edited = Edited::of(scene, waiting, changes.clone(), self.edits.steps(), by);
        self.send_all(&ServerMessage::Edited(edited));
        self.handle(Event::Edit(changes));
        Ok(())
    }

    fn turn(&mut self, knobs: live::Knobs) {
        self.handle(Event::Turn(knobs));
        self.send_all(&ServerMessage::Knobs(self.knobs()));
    }

    fn develop_otherwise(&mut self) {
        self.note_change();
        self.darkroom.manner(self.manner.clone());
        self.send_all(&ServerMessage::Knobs(self.knobs()));
    }

    fn pick(&self, scene: &Scene, spot: Spot) -> Option<pick::Picked> {
        let camera = self.driver.live.camera();
        let lens = camera.lens();
        let direction = lens.direction(spot.x * camera.width as f32, spot.y * camera.height as f32);
        pick::pick(scene, lens.origin(), direction)
    }

    /// What is saved of what people see.
    fn taken(&mut self, meter: Option<Spot>) -> Option<Taken> {
        let manner = self.manner.clone();
        let name = saved::file_name(self.driver.cluster.scene().map_or("", |scene| &scene.name), &manner.layer);
        let meter = meter.map(|spot| (spot, self.measured(spot).1));
        let picture = self.driver.live.as_shown()?;
        let marks = self.driver.live.marks();
        let Chosen { method, settings } = &self.driver.live.knobs().method;
        let metadata = vec![
            ("version", env!("CARGO_PKG_VERSION").to_string()),
            ("method", method.name().to_string()),
            ("settings", serde_json::to_string(settings).unwrap_or_default()),
        ];
        Some(Taken { name, picture, manner, marks, meter, metadata })
    }

    /// What the light meter reads at a spot, and of which pixel.
    fn measured(&self, spot: Spot) -> ([u32; 2], Option<MeterReading>) {
        let camera = self.driver.live.camera();
        let place = |share: f32, side: u32| (share.clamp(0.0, 1.0) * side as f32).min(side as f32 - 1.0) as u32;
        let (x, y) = (place(spot.x, camera.width), place(spot.y, camera.height));
        let found = self.driver.live.probe(x, y).map(|probe| {
            let Probe { radiance, irradiance, reflectance, distance, .. } = probe;
            let [lux, candela_per_m2] = [irradiance, radiance].map(photometric);
            MeterReading { radiance, irradiance, reflectance, distance, lux, candela_per_m2 }
        });
        ([x, y], found)
    }

    fn welcome(&mut self, viewer: Viewer) {
        let Some(scene) = self.driver.cluster.scene() else { return };
        let camera = self.driver.live.camera();
        let (waiting, steps) = (self.driver.live.waiting(), self.edits.steps());
        let welcome = Welcome {
            you: viewer,
            scene: SceneInfo::of(scene),
            camera,
            knobs: self.knobs(),
            steps,
            version: env!("CARGO_PKG_VERSION").into(),
            methods: MethodInfo::all(),
        };
        // The scene is edited when a frame begins.
        let has_motion = scene.objects.iter().any(|object| object.motion.is_some());
        let mut changes = waiting.to_vec();
        changes.extend(has_motion.then_some(Change::Time(edits::time(scene, waiting))));
        let messages = [
            ServerMessage::Welcome(welcome.into()),
            ServerMessage::Edited(Edited::of(scene, &[], changes, steps, None)),
            self.hues_message(),
            self.views_message(),
            self.offer_message(),
            self.audience.controls(),
        ];
        messages.iter().for_each(|message| self.audience.send(viewer, message));
    }

    fn knobs(&self) -> Knobs {
        let live::Knobs { method, rate, rest_after, .. } = self.driver.live.knobs();
        Knobs {
            layer: self.manner.layer.name.into(),
            rate: *rate,
            method: Named::from(method),
            tone: self.tone_settings(),
            rest_after: *rest_after,
        }
    }

    fn tone_settings(&self) -> ToneSettings {
        let Tone { exposure, operator } = self.manner.tone;
        let exposure = match exposure {
            Exposure::Fixed(stops) => stops,
            // Until it is chosen.
            Exposure::Auto => 0.0,
        };
        ToneSettings { exposure, operator }
    }

    fn tell_who_holds(&self) {
        self.send_all(&self.audience.controls());
    }

    fn send_all(&self, message: &ServerMessage) {
        self.hub.send_all(message);
    }

    fn refuse(&self, viewer: Viewer, reason: &str) {
        self.audience.send(viewer, &ServerMessage::Refused { reason: reason.into() });
    }

    /// Tells everyone how things stand.
    fn report(&mut self) {
        let now = Instant::now();
        if now - self.meter.estimated >= BETWEEN_ESTIMATES {
            self.meter.estimated = now;
            self.meter.error = self.driver.live.error().map(|estimate| estimate.rel_mse);
        }
        let (cost, bytes) = self.driver.take_cost();
        let Meter { since, pictures, moving, error, .. } = &self.meter;
        let seconds = (now - *since).as_secs_f64().max(1e-3);
        let status = self.driver.cluster.status();
        let ways = status.list.iter().filter(|info| info.answered > 0).map(|info| info.round_trip);
        self.driver.live.set_round_trip(ways.min().unwrap_or_default().as_micros() as u64);
        self.driver.live.set_parallelism(status.parallelism());
        let latency = self.latency.lock().unwrap_or_else(PoisonError::into_inner).clone();
        let milliseconds = |share| latency.percentile(share).map(|micros| micros as f64 / 1e3);
        let report = Status {
            pictures_per_second: f64::from(*pictures) / seconds,
            moving: *moving > 0,
            rays_per_second: cost.rays() as f64 / seconds,
            answer_bytes_per_second: bytes as f64 / seconds,
            latency_ms: [milliseconds(0.5), milliseconds(0.99)],
            error: *error,
            bytes_sent: status.bytes_sent,
            bytes_received: status.bytes_received,
            workers: status.list.iter().map(WorkerStatus::from).collect(),
            ready: status.ready,
            effort: self.driver.live.effort().0,
        };
        self.send_all(&ServerMessage::Status(report.into()));
        let waited = milliseconds(0.5).zip(milliseconds(0.99)).map(|(p50, p99)| [p50 / 1e3, p99 / 1e3]);
        self.driver.cluster.pulse().shown(*pictures, waited, now);
        let meter = &mut self.meter;
        (meter.since, meter.pictures, meter.moving) = (now, 0, 0);
    }
}
