//! The thread that people and workers meet at: [`Live`] decides, this carries out.

mod keeping;

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use frame::live::edits::{self, Edits};
use frame::live::latency::Latency;
use frame::live::pace::Level;
use frame::live::{Action, Event, Knobs, Live, Moment, pick};
use frame::parts::{Filter, Smoother};
use frame::tone::{Exposure, STOPS_MAX, Tone};
use frame::{Layer, Probe};
use protocol::answer::Cost;
use protocol::question::WorldState;
use scenes::photometry::photometric;
use scenes::{Camera, Change, Scene};
use serde_json::{Value, json};

use super::audience::{Asked, Audience};
use super::record::{Recorder, What};
use super::screen;
use crate::cluster::{self, Cluster};
use crate::console::Console;
use crate::display::develop::{Darkroom, Developer, Manner};
use crate::display::hub::{Command, Hub, Viewer};
use crate::display::hues::Hues;
use crate::display::saved::{self, Taken};
use crate::display::words::{self, Inspect, Measured, OperatorWord, QualityWords, Said, Spot, ToneWords, View};
use crate::interrupt::Interrupt;
use crate::show::tev::Tev;
use keeping::Keeping;
pub(crate) use keeping::counted;

/// See the module's documentation.
pub struct Studio {
    cluster: Cluster,
    live: Live,
    edits: Edits,
    hub: Hub,
    darkroom: Darkroom,
    manner: Manner,
    audience: Audience,
    /// Pictures have the size that they had at the start, whatever screens they are shown on.
    is_size_fixed: bool,
    /// Somebody looks; `asked_at`: when somebody last asked for the picture without watching.
    watched: bool,
    asked_at: Option<Instant>,
    has_said_paused: bool,
    begun: Instant,
    meter: Meter,
    /// From inputs to pictures that are developed.
    latency: Arc<Mutex<Latency>>,
    /// Clocks of the viewers whose inputs were heard, oldest first, by the inputs' numbers: the first is in the last
    /// picture, the others are in none yet.
    heard: VecDeque<(u64, Value)>,
    recorder: Option<Recorder>,
    tev: Option<Tev>,
    /// The colours of what is off.
    hues: Hues,
    /// Saved by people.
    views: Vec<View>,
    keeping: Option<Keeping>,
}

/// Commands of people, and events of workers, that are heard in turn.
const IN_TURN: usize = 16;

/// Pictures, rays and bytes since the last report.
struct Meter {
    since: Instant,
    pictures: u32,
    moving: u32,
    cost: Cost,
    bytes: u64,
    /// When the error was estimated, and what it was.
    estimated: Instant,
    error: Value,
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
        camera: Camera,
        knobs: Knobs,
        tone: Tone,
        developer: Box<dyn Developer>,
    ) -> std::io::Result<Self> {
        let manner = Manner { inspect: Inspect::Final, tone };
        let (now, latency) = (Instant::now(), Arc::<Mutex<Latency>>::default());
        let (shown, waited) = (hub.clone(), Arc::clone(&latency));
        let darkroom = Darkroom::start(manner.clone(), developer, move |print| {
            if let Some(since) = print.since {
                let micros = now.elapsed().as_micros() as u64;
                waited.lock().unwrap_or_else(PoisonError::into_inner).add(micros.saturating_sub(since.0));
            }
            shown.show(Arc::new(print));
        })?;
        let meter = Meter {
            since: now,
            pictures: 0,
            moving: 0,
            cost: Cost::default(),
            bytes: 0,
            estimated: now,
            error: Value::Null,
        };
        Ok(Self {
            cluster,
            live: Live::new(camera, knobs),
            edits: Edits::default(),
            hub,
            darkroom,
            manner,
            audience: Audience::default(),
            is_size_fixed: false,
            watched: true,
            asked_at: None,
            has_said_paused: false,
            begun: now,
            meter,
            latency,
            heard: VecDeque::from([(0, Value::Null)]),
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
        self.live.smooth_by(smoother);
    }

    /// Shows pictures at rest there as well.
    pub fn show_in(&mut self, tev: Tev) {
        self.tev = Some(tev);
    }

    /// Pictures stay as large as the camera's, whatever screens they are shown on.
    pub fn fix_size(&mut self) {
        self.is_size_fixed = true;
    }

    /// The world has been published.
    pub fn begin(&mut self, world: WorldState) {
        let Some(fields) = self.cluster.fields() else { return };
        self.handle(Event::Published { world, fields });
    }

    /// Works until somebody presses Ctrl-C. Top to bottom: people, workers, how things stand. Nobody has to wait for
    /// long until it is his turn, however much the others say.
    pub fn run(&mut self, interrupt: &Interrupt, narrator: &Console) {
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
            self.attend(narrator);
            let patience = match self.live.wake_at() {
                _ if !all_heard => Duration::ZERO,
                Some(at) => Duration::from_micros(at.0.saturating_sub(self.now().0)),
                None => BETWEEN_REPORTS,
            };
            let event = self.cluster.next(patience.min(BETWEEN_REPORTS));
            self.hear(event, narrator);
            for _ in 1..IN_TURN {
                let Some(event) = self.cluster.next(Duration::ZERO) else { break };
                self.hear(Some(event), narrator);
            }
            if self.meter.since.elapsed() >= BETWEEN_REPORTS {
                self.report();
            }
            self.keep_if_stale();
        }
        self.finish_keeping(narrator);
    }

    /// Workers draw while somebody looks.
    fn attend(&mut self, narrator: &Console) {
        let was_asked = self.asked_at.is_some_and(|at| at.elapsed() < ASKED_LASTS);
        let watched = self.audience.is_looking() || self.tev.is_some() || was_asked;
        if watched == std::mem::replace(&mut self.watched, watched) {
            return;
        }
        if !watched && !std::mem::replace(&mut self.has_said_paused, true) {
            narrator.line("nobody watches: drawing pauses after the first frame, and goes on when somebody looks");
        }
        self.handle(Event::Watched(watched));
    }

    /// The picture is as large as the screen of whoever has the controls.
    fn fit(&mut self) {
        let (Some(wanted), Some(fields)) = (self.audience.screen(), self.cluster.fields()) else { return };
        if self.is_size_fixed {
            return;
        }
        let camera = self.live.camera();
        let [width, height] = screen::fitted(&camera, wanted, &self.live.knobs().quality, fields);
        self.handle(Event::Look(Camera { width, height, ..camera }));
    }

    fn now(&self) -> Moment {
        Moment(self.begun.elapsed().as_micros() as u64)
    }

    fn hear(&mut self, event: Option<cluster::Event>, narrator: &Console) {
        match event {
            Some(cluster::Event::Answered { asked, body, cost, worker, bytes }) => {
                self.meter.cost += cost;
                self.meter.bytes += bytes;
                self.handle(Event::Answered { ticket: asked.ticket, body, worker, cost });
            }
            Some(cluster::Event::Unanswered { asked, reason }) => {
                self.tell_all(&json!({ "tell": "trouble", "reason": reason }));
                self.handle(Event::Unanswered(asked.ticket));
            }
            Some(event) => {
                narrator.event(&event);
                self.report();
            }
            None => self.handle(Event::Woke),
        }
    }

    fn handle(&mut self, event: Event) {
        match &event {
            Event::Look(camera) if *camera != self.live.camera() => {
                self.record(What::Look(*camera));
                self.note_change();
            }
            Event::Edit(changes) => {
                self.record(What::Edit(changes.clone()));
                self.note_change();
            }
            Event::Turn(knobs) => {
                let drawn = |knobs: &Knobs| (knobs.quality, knobs.filter);
                if drawn(knobs) != drawn(self.live.knobs()) {
                    self.record(What::Turn { quality: knobs.quality, filter: knobs.filter.into() });
                }
            }
            _ => {}
        }
        let now = self.now();
        for action in self.live.handle(event, now) {
            self.carry_out(action);
        }
    }

    fn carry_out(&mut self, action: Action) {
        match action {
            Action::Publish(changes) => {
                // Every change was checked when it came in, and hardly anything else makes a difference to that.
                let mut world = self.cluster.change(changes.clone());
                if let Err(refused) = &world {
                    self.tell_all(&json!({ "tell": "trouble", "reason": refused.to_string() }));
                    let scene = self.cluster.scene();
                    let fits = |change: &Change| scene.is_some_and(|scene| change.check(scene).is_ok());
                    let fitting = changes.into_iter().filter(fits).collect();
                    world = self.cluster.change(fitting);
                }
                if let Some(world) = world.ok().or(self.cluster.state()) {
                    self.begin(world);
                }
            }
            Action::Forget => self.cluster.cancel_all(),
            Action::Ask(questions) => self.cluster.ask(questions),
            Action::Show => {
                // Also of those that no picture shows: what is drawn next follows from them.
                if let Some(Level { scale, lights }) = self.live.ended() {
                    self.record(What::Moving { scale, lights });
                }
                if let Some(frame) = self.live.picture(self.now()) {
                    self.meter.pictures += 1;
                    self.meter.moving += u32::from(frame.moving.is_some());
                    let is_for_tev = frame.moving.is_none() && frame.layer == Layer::Final;
                    if let Some(tev) = self.tev.as_mut().filter(|tev| is_for_tev && (frame.finished || tev.is_due())) {
                        tev.show(frame.picture.clone());
                    }
                    while self.heard.get(1).is_some_and(|(revision, _)| *revision <= frame.revision) {
                        self.heard.pop_front();
                    }
                    let heard = self.heard.front().map_or(Value::Null, |(_, heard)| heard.clone());
                    self.darkroom.frame(frame, heard);
                }
            }
        }
    }

    /// Keeps what happened, if it is to be kept.
    fn record(&mut self, what: What) {
        let t = self.begun.elapsed().as_secs_f64();
        let Some(Err(error)) = self.recorder.as_mut().map(|recorder| recorder.line(t, what)) else { return };
        tracing::error!("{error:#}");
        self.recorder = None;
        self.tell_all(&json!({ "tell": "trouble", "reason": error.to_string() }));
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

    fn listen(&mut self, viewer: Viewer, said: Said) -> Result<(), String> {
        match said {
            Said::Look(view) => {
                let Camera { width, height, .. } = self.live.camera();
                let camera = view.camera([width, height])?;
                self.heard(json!({ "viewer": viewer, "at": view.at }));
                self.handle(Event::Look(camera));
            }
            Said::Shape { width, height } => {
                self.audience.measure(viewer, [width, height]);
                self.fit();
            }
            Said::Hidden { hidden } => self.audience.hide(viewer, hidden),
            Said::Edit { changes, gesture, at } => {
                self.heard(json!({ "viewer": viewer, "at": at }));
                self.edit(changes, viewer, gesture)?;
            }
            Said::Undo => {
                if let Some(back) = self.edits.undo() {
                    self.make(back, None)?;
                }
            }
            Said::Redo => {
                if let Some(forth) = self.edits.redo() {
                    self.make(forth, None)?;
                }
            }
            Said::Tone(ToneWords { exposure, operator }) => {
                if exposure.abs() > STOPS_MAX || exposure.is_nan() {
                    return Err(format!("the exposure must be -{STOPS_MAX} to {STOPS_MAX} stops"));
                }
                self.manner.tone = Tone { exposure: Exposure::Fixed(exposure), operator: operator.operator() };
                self.develop_otherwise();
            }
            Said::AutoExpose => {
                let picture = self.live.shown().map(|shown| &shown.picture);
                let stops = picture.map_or(0.0, |picture| Exposure::Auto.stops(picture));
                self.manner.tone.exposure = Exposure::Fixed(stops);
                self.develop_otherwise();
            }
            Said::Inspect { layer } => {
                self.manner.inspect = layer;
                self.develop_otherwise();
                let lights = layer == Inspect::Lights;
                self.handle(Event::Turn(Knobs { layer: layer.layer(), lights, ..*self.live.knobs() }));
            }
            Said::Quality(words) => {
                let knobs = turned(self.live.knobs(), &words)?;
                self.handle(Event::Turn(knobs));
                self.tell_all(&self.knobs());
            }
            Said::SaveView(view) => self.save_view(view)?,
            Said::ForgetView { number } => self.forget_view(number)?,
            Said::TakeUp => {
                self.take_up()?;
            }
            Said::StartAfresh => self.start_afresh(),
            Said::Give { to } => {
                if let Some(asker) = self.audience.give(viewer, to)? {
                    self.refuse(asker, "who has the controls keeps them");
                }
                self.tell_who_holds();
                self.fit();
            }
            Said::Take => match self.audience.take(viewer) {
                Asked::Given => {
                    self.tell_who_holds();
                    self.fit();
                }
                Asked::Of(holder) => self.audience.tell(holder, &json!({ "tell": "asked", "by": viewer })),
            },
            Said::Pick(spot) => {
                let scene = self.cluster.scene().ok_or("there is no scene yet")?;
                let words = words::picked(scene, spot, self.pick(scene, spot));
                self.audience.tell(viewer, &words);
            }
            Said::Probe(spot) => {
                let probed = self.probe(spot);
                self.audience.tell(viewer, &probed);
            }
            Said::Refresh => self.welcome(viewer),
            // The watcher's own business.
            Said::Drawn { .. } => {}
        }
        Ok(())
    }

    /// Remembers whose input comes next; of inputs that no picture can tell apart, the last.
    fn heard(&mut self, heard: Value) {
        let revision = self.live.revision() + 1;
        self.heard.retain(|(earlier, _)| *earlier < revision);
        if self.heard.len() == HEARD_MAX {
            self.heard.pop_front();
        }
        self.heard.push_back((revision, heard));
    }

    /// Makes changes as a viewer wants them, in a gesture or by themselves, and remembers what takes them back.
    fn edit(&mut self, wanted: Vec<Change>, by: Viewer, gesture: Option<u64>) -> Result<(), String> {
        let scene = self.cluster.scene().ok_or("there is no scene yet")?;
        let waiting = self.live.waiting();
        let changes = edits::composed(scene, waiting, wanted);
        changes.iter().try_for_each(|change| change.check(scene)).map_err(|refused| refused.to_string())?;
        self.edits.remember(scene, waiting, &changes, gesture);
        self.make(changes, Some(by))
    }

    /// Makes changes that the scene can take, and tells everyone. `by`: who has made them already in what he sees.
    fn make(&mut self, changes: Vec<Change>, by: Option<Viewer>) -> Result<(), String> {
        let scene = self.cluster.scene().ok_or("there is no scene yet")?;
        let waiting = self.live.waiting();
        changes.iter().try_for_each(|change| change.check(scene)).map_err(|refused| refused.to_string())?;
        changes.iter().for_each(|change| self.hues.learn(scene, waiting, change));
        let (poses, pieces) = (words::poses(scene, waiting, &changes), words::pieces(scene, &changes));
        let steps = self.edits.steps();
        self.tell_all(&json!({
            "tell": "edited", "changes": changes, "poses": poses, "pieces": pieces, "steps": steps, "by": by,
        }));
        self.handle(Event::Edit(changes));
        Ok(())
    }

    fn develop_otherwise(&mut self) {
        self.note_change();
        self.darkroom.manner(self.manner.clone());
        self.tell_all(&self.knobs());
    }

    fn pick(&self, scene: &Scene, spot: Spot) -> Option<pick::Picked> {
        let camera = self.live.camera();
        let lens = camera.lens();
        let direction = lens.direction(spot.x * camera.width as f32, spot.y * camera.height as f32);
        pick::pick(scene, lens.origin(), direction)
    }

    /// What is saved of what people see.
    fn taken(&mut self, meter: Option<Spot>) -> Option<Taken> {
        let manner = self.manner.clone();
        let name = saved::file_name(self.cluster.scene().map_or("", |scene| &scene.name), manner.inspect);
        let meter = meter.map(|spot| (spot, self.measured(spot).1));
        let picture = self.live.as_shown()?;
        let lights = if manner.inspect == Inspect::Lights { self.live.dots() } else { Vec::new() };
        let metadata = vec![("version", env!("CARGO_PKG_VERSION").to_string())];
        Some(Taken { name, picture, manner, lights, meter, metadata })
    }

    fn probe(&self, spot: Spot) -> Value {
        let (pixel, found) = self.measured(spot);
        json!({ "tell": "probed", "x": spot.x, "y": spot.y, "pixel": pixel, "found": found })
    }

    /// What the light meter reads at a spot, and of which pixel.
    fn measured(&self, spot: Spot) -> ([u32; 2], Option<Measured>) {
        let camera = self.live.camera();
        let place = |share: f32, side: u32| (share.clamp(0.0, 1.0) * side as f32).min(side as f32 - 1.0) as u32;
        let (x, y) = (place(spot.x, camera.width), place(spot.y, camera.height));
        let found = self.live.probe(x, y).map(|probe| {
            let Probe { radiance, irradiance, reflectance, distance, .. } = probe;
            let [lux, candela_per_m2] = [irradiance, radiance].map(photometric);
            Measured { radiance, irradiance, reflectance, distance, lux, candela_per_m2 }
        });
        ([x, y], found)
    }

    fn welcome(&mut self, viewer: Viewer) {
        let Some(scene) = self.cluster.scene() else { return };
        let camera = self.live.camera();
        let welcome = json!({
            "tell": "welcome", "you": viewer, "scene": words::scene(scene), "camera": camera,
            "knobs": self.knobs(), "steps": self.edits.steps(), "version": env!("CARGO_PKG_VERSION"),
        });
        self.audience.tell(viewer, &welcome);
        // The scene is edited when a frame begins.
        let (waiting, steps) = (self.live.waiting(), self.edits.steps());
        let pieces = words::pieces(scene, waiting);
        let has_motion = scene.objects.iter().any(|object| object.motion.is_some());
        let mut told = waiting.to_vec();
        told.extend(has_motion.then_some(Change::Time(edits::time(scene, waiting))));
        let poses = words::poses(scene, &[], &told);
        let words = json!({ "tell": "edited", "changes": told, "poses": poses, "pieces": pieces, "steps": steps });
        self.audience.tell(viewer, &words);
        for words in [self.hues_told(), self.views_told(), self.offer(), self.audience.words()] {
            self.audience.tell(viewer, &words);
        }
    }

    fn knobs(&self) -> Value {
        let Knobs { quality, filter, rate, rest_after, .. } = self.live.knobs();
        json!({
            "tell": "knobs", "layer": self.manner.inspect,
            "tone": self.tone_words(),
            "quality": QualityWords {
                lights: quality.light_samples, vpls: quality.vpls, photons: quality.photons,
                filter: filter.edges.is_some(), rate: *rate,
            },
            "rest_after": rest_after,
        })
    }

    fn tone_words(&self) -> ToneWords {
        let exposure = match self.manner.tone.exposure {
            Exposure::Fixed(stops) => stops,
            Exposure::Auto => 0.0,
        };
        ToneWords { exposure, operator: OperatorWord::of(self.manner.tone.operator) }
    }

    fn tell_who_holds(&self) {
        self.tell_all(&self.audience.words());
    }

    fn tell_all(&self, words: &Value) {
        self.hub.tell_all(words);
    }

    fn refuse(&self, viewer: Viewer, reason: &str) {
        self.audience.tell(viewer, &json!({ "tell": "refused", "reason": reason }));
    }

    /// Tells everyone how things stand.
    fn report(&mut self) {
        let now = Instant::now();
        if now - self.meter.estimated >= BETWEEN_ESTIMATES {
            self.meter.estimated = now;
            self.meter.error = self.live.error().map_or(Value::Null, |estimate| json!(estimate.rel_mse));
        }
        let Meter { since, pictures, moving, cost, bytes, error, .. } = &self.meter;
        let seconds = (now - *since).as_secs_f64().max(1e-3);
        let status = self.cluster.status();
        let ways = status.list.iter().filter(|info| info.answered > 0).map(|info| info.round_trip);
        self.live.set_way(ways.min().unwrap_or_default().as_micros() as u64);
        self.live.set_parallelism(status.parallelism());
        let workers = status.list.iter().map(|info| {
            json!({
                "worker": info.worker, "name": info.name, "state": format!("{:?}", info.state).to_lowercase(),
                "threads": info.threads, "answered": info.answered, "bytes": info.answer_bytes,
                "progress": info.progress, "local": info.address.is_none(),
            })
        });
        let latency = self.latency.lock().unwrap_or_else(PoisonError::into_inner).clone();
        let milliseconds = |share| latency.percentile(share).map(|micros| micros as f64 / 1e3);
        let level = self.live.level();
        let told = json!({
            "tell": "status", "pictures_per_second": f64::from(*pictures) / seconds, "moving": *moving > 0,
            "rays_per_second": cost.rays() as f64 / seconds, "answer_bytes_per_second": *bytes as f64 / seconds,
            "latency_ms": [milliseconds(0.5), milliseconds(0.99)], "error": error,
            "bytes_sent": status.bytes_sent, "bytes_received": status.bytes_received,
            "workers": workers.collect::<Vec<_>>(), "ready": status.ready, "scale": level.scale,
        });
        self.tell_all(&told);
        let waited = milliseconds(0.5).zip(milliseconds(0.99)).map(|(p50, p99)| [p50 / 1e3, p99 / 1e3]);
        self.cluster.pulse().shown(*pictures, waited, now);
        let meter = &mut self.meter;
        (meter.since, meter.pictures, meter.moving, meter.cost, meter.bytes) = (now, 0, 0, Cost::default(), 0);
    }
}

/// The knobs after a viewer has turned some.
fn turned(knobs: &Knobs, words: &QualityWords) -> Result<Knobs, String> {
    let QualityWords { lights, vpls, photons, filter, rate } = *words;
    if !(1..=4096).contains(&lights) || !(1..=4096).contains(&vpls) || photons > 10_000_000 {
        return Err("lights and virtual lights must be 1 to 4096, photons at most ten million".into());
    }
    if !(frame::live::pace::RATE_MIN..=frame::live::pace::RATE_MAX).contains(&rate) {
        return Err("the frame rate must be 0.5 to 120".into());
    }
    let quality = protocol::question::Quality { light_samples: lights, vpls, photons, ..knobs.quality };
    let smooth = if knobs.filter.edges.is_some() { knobs.filter } else { Filter::plane(quality.interleave) };
    Ok(Knobs { quality, filter: if filter { smooth } else { Filter::OFF }, rate, ..*knobs })
}
