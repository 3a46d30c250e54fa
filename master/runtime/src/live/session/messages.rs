//! What viewers send, handled: most of it is checked against the scene first, and refused with a reason.

use std::time::Instant;

use frame::live::edits;
use frame::live::{self, Event, pick, walk};
use frame::tone::{Exposure, STOPS_MAX, Tone};
use frame::{Chosen, Layer, Probe};
use scenes::photometry::photometric;
use scenes::{Camera, Change, Scene};

use super::{Session, mixing};
use crate::display::hub::{Command, Viewer};
use crate::display::message::{
    ClientMessage, Edited, InputStamp, Knobs, MeterReading, MethodInfo, Probed, SceneInfo, ServerMessage, Spot,
    ToneSettings, Welcome,
};
use crate::display::saved::{self, Taken};
use crate::live::audience::Asked;
use crate::memory;
use crate::methods::{self, Named};

/// Inputs that are remembered until a picture shows them; without workers, none may for hours.
const INPUTS_MAX: usize = 256;

impl Session {
    pub(super) fn handle_command(&mut self, command: Command) {
        match command {
            Command::Joined { viewer, sender } => {
                self.audience.join(viewer, sender);
                self.welcome(viewer);
                self.send_controls();
            }
            Command::Left { viewer } => {
                self.audience.leave(viewer);
                self.send_controls();
            }
            Command::Message { viewer, message } => {
                if message.needs_controls() && self.audience.holder() != Some(viewer) {
                    return self.refuse(viewer, "another viewer has the controls, and may hand them over");
                }
                if let Err(reason) = self.handle_message(viewer, message) {
                    self.refuse(viewer, &reason);
                }
            }
            Command::Picture { meter, reply } => {
                self.asked_at = Some(Instant::now());
                // Dropped without an answer, the sender says that there is no picture yet.
                if let Some(taken) = self.take_picture(meter) {
                    let _ = reply.send(taken);
                }
            }
        }
    }

    fn handle_message(&mut self, viewer: Viewer, message: ClientMessage) -> Result<(), String> {
        match message {
            ClientMessage::Look(viewpoint) => {
                let Camera { width, height, .. } = self.camera();
                let camera = viewpoint.camera([width, height])?;
                self.note_input(InputStamp { viewer, at: viewpoint.at });
                self.handle_event(Event::Look(camera));
            }
            ClientMessage::Shape { width, height } => {
                self.audience.set_screen(viewer, [width, height]);
                self.fit();
            }
            ClientMessage::Hidden { hidden } => self.audience.set_hidden(viewer, hidden),
            ClientMessage::Edit { changes, gesture, at } => {
                if changes.iter().any(|change| matches!(change, Change::Solid { .. })) {
                    return Err("a luminaire's solid comes with its file".into());
                }
                self.note_input(InputStamp { viewer, at });
                self.edit(changes, Some(viewer), gesture)?;
            }
            ClientMessage::Hang { file, data, lights, at } => self.hang(viewer, (&file, &data), &lights, at)?,
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
                self.settings.tone = tone.into();
                self.apply_settings();
            }
            ClientMessage::Denoise { on } => self.set_denoise(on)?,
            ClientMessage::Mix { on } => self.set_mix(on),
            ClientMessage::AutoExpose => {
                let picture = self.mixed().map(|picture| &**picture).or_else(|| self.driver.live.last_radiance());
                let stops = picture.map_or(0.0, |picture| Exposure::Auto.stops(picture));
                self.settings.tone.exposure = Exposure::Fixed(stops);
                self.apply_settings();
            }
            ClientMessage::Inspect { layer } => {
                let knobs = self.driver.live.knobs();
                let layer = knobs.method.layer(&layer).ok_or_else(|| format!("there is no layer {layer:?}"))?;
                let knobs = live::Knobs { layer, ..knobs.clone() };
                self.settings.layer = layer;
                self.apply_settings();
                self.handle_event(Event::Turn(knobs));
            }
            ClientMessage::Turn { values } => {
                let knobs = self.driver.live.knobs().clone();
                let method = knobs.method.with(values)?;
                self.turn(live::Knobs { method, ..knobs });
            }
            ClientMessage::Rate { rate } => {
                if !(live::pace::RATE_MIN..=live::pace::RATE_MAX).contains(&rate) {
                    return Err("the frame rate must be 0.5 to 120".into());
                }
                self.turn(live::Knobs { rate, ..self.driver.live.knobs().clone() });
            }
            ClientMessage::Method { name } => self.choose_method(&name)?,
            ClientMessage::Save => self.save_scene()?,
            ClientMessage::SaveView { view, name, picture, lamps } => self.save_view(&view, name, picture, lamps)?,
            ClientMessage::NameView { number, name } => self.name_view(number, name)?,
            ClientMessage::Relight { number } => self.relight(number)?,
            ClientMessage::ForgetView { number } => self.forget_view(number)?,
            ClientMessage::SavePreset { name } => self.save_preset(name)?,
            ClientMessage::ForgetPreset { number } => self.forget_preset(number)?,
            ClientMessage::TakeUp => {
                self.take_up()?;
            }
            ClientMessage::StartAfresh => self.start_afresh(),
            ClientMessage::Give { to } => {
                if let Some(asker) = self.audience.give(viewer, to)? {
                    self.refuse(asker, "the viewer that has the controls keeps them");
                }
                self.send_controls();
                self.fit();
            }
            ClientMessage::Take => match self.audience.take(viewer) {
                Asked::Given => {
                    self.send_controls();
                    self.fit();
                }
                Asked::Of(holder) => self.audience.send(holder, &ServerMessage::Asked { by: viewer }),
            },
            ClientMessage::Pick(spot) => {
                let scene = self.scene().ok_or("there is no scene yet")?;
                let picked = ServerMessage::picked(scene, spot, self.pick(scene, spot));
                self.audience.send(viewer, &picked);
            }
            ClientMessage::Walk { origin, by, height } => {
                let scene = self.scene().ok_or("there is no scene yet")?;
                if !(origin.is_finite() && by.is_finite() && height > 0.0 && height.is_finite()) {
                    return Err("that is no step".into());
                }
                self.audience.send(viewer, &ServerMessage::Walked { origin: walk::step(scene, origin, by, height) });
            }
            ClientMessage::Probe(spot) => {
                let (pixel, found) = self.read_meter(spot);
                self.audience.send(viewer, &ServerMessage::Probed(Probed { spot, pixel, found }));
            }
            ClientMessage::Refresh => self.welcome(viewer),
            // Only the viewer's own connection needs to know.
            ClientMessage::Drawn { .. } => {}
        }
        Ok(())
    }

    /// Remembers whose input comes next; of inputs that no picture can tell apart, the last.
    fn note_input(&mut self, input: InputStamp) {
        let revision = self.driver.live.revision() + 1;
        self.inputs.retain(|(earlier, _)| *earlier < revision);
        if self.inputs.len() == INPUTS_MAX {
            self.inputs.pop_front();
        }
        self.inputs.push_back((revision, Some(input)));
    }

    /// Makes changes as a viewer wants them, in a gesture or by themselves, and remembers what takes them back.
    pub(super) fn edit(&mut self, wanted: Vec<Change>, by: Option<Viewer>, gesture: Option<u64>) -> Result<(), String> {
        let scene = mixing::scene(self.mixing.as_ref(), &self.driver).ok_or("there is no scene yet")?;
        let waiting = self.driver.live.waiting();
        let files = self.scene_file.as_ref().map_or(usize::MAX, |file| file.base.lights.len());
        let changes = edits::composed(scene, waiting, edits::of_lamps(scene, waiting, wanted, files));
        edits::check(scene, waiting, &changes).map_err(|refused| refused.to_string())?;
        self.edits.remember(scene, waiting, &changes, gesture);
        self.make(changes, by)
    }

    /// Makes changes that the scene can take, and sends them to all viewers. `by`: the viewer that shows them already.
    pub(super) fn make(&mut self, changes: Vec<Change>, by: Option<Viewer>) -> Result<(), String> {
        let scene = mixing::scene(self.mixing.as_ref(), &self.driver).ok_or("there is no scene yet")?;
        let waiting = self.driver.live.waiting();
        edits::check(scene, waiting, &changes).map_err(|refused| refused.to_string())?;
        changes.iter().for_each(|change| self.hues.learn(scene, waiting, change));
        let edited = Edited::of(scene, waiting, changes.clone(), self.edits.steps(), by);
        self.hub.send_all(&ServerMessage::Edited(edited));
        self.handle_event(Event::Edit(changes));
        Ok(())
    }

    fn choose_method(&mut self, name: &str) -> Result<(), String> {
        let method = methods::find(name).map(Chosen::new);
        let method = method.ok_or_else(|| format!("there is no method {name:?}, only {}", methods::names()))?;
        let knobs = self.driver.live.knobs().clone();
        if knobs.method.method.name() != name {
            let fields = self.driver.cluster.fields().ok_or("there is no scene yet")?;
            let camera = self.camera();
            let bytes = method.memory_bytes(&camera, fields);
            memory::demand(bytes, &camera).map_err(|failure| failure.to_string())?;
            // The layer, if the method has it as well.
            let layer = method.layer(knobs.layer.name).unwrap_or(Layer::FINAL);
            self.settings.layer = layer;
            self.display.set(self.settings.clone());
            self.turn(live::Knobs { method, layer, ..knobs });
        }
        Ok(())
    }

    fn turn(&mut self, knobs: live::Knobs) {
        self.handle_event(Event::Turn(knobs));
        self.send_knobs();
    }

    /// Has pictures shown as the settings say now.
    pub(super) fn apply_settings(&mut self) {
        self.note_change();
        self.display.set(self.settings.clone());
        self.send_knobs();
    }

    pub(super) fn pick(&self, scene: &Scene, spot: Spot) -> Option<pick::Picked> {
        let camera = self.camera();
        let lens = camera.lens();
        let direction = lens.direction(spot.x * camera.width as f32, spot.y * camera.height as f32);
        let start = lens.start(direction);
        let found = pick::pick(scene, lens.origin() + direction * start, direction)?;
        Some(pick::Picked { distance: found.distance + start, ..found })
    }

    /// The picture as it is shown, to be saved; `None` if there is none yet.
    fn take_picture(&mut self, meter: Option<Spot>) -> Option<Taken> {
        let settings = self.settings.clone();
        let name = saved::file_name(self.scene().map_or("", |scene| &scene.name), &settings.layer);
        let meter = meter.map(|spot| (spot, self.read_meter(spot).1));
        let denoised = self.denoised().filter(|_| settings.layer == Layer::FINAL);
        let (picture, denoiser) = match denoised {
            Some((picture, denoiser)) => (picture, Some(denoiser)),
            None => (self.mixed().cloned().or_else(|| self.driver.live.as_shown())?, None),
        };
        let marks = self.driver.live.marks();
        let Chosen { method, settings: values } = &self.driver.live.knobs().method;
        let mut metadata = vec![
            ("version", env!("CARGO_PKG_VERSION").to_string()),
            ("method", method.name().to_string()),
            ("settings", serde_json::to_string(values).unwrap_or_default()),
        ];
        metadata.extend(denoiser.map(|denoiser| ("denoiser", denoiser)));
        let lamps = self.mix_shares();
        Some(Taken { name, picture, settings, marks, meter, metadata, lamps })
    }

    /// The pixel at a spot, and what the light meter reads there.
    fn read_meter(&self, spot: Spot) -> ([u32; 2], Option<MeterReading>) {
        let camera = self.camera();
        let place = |share: f32, side: u32| (share.clamp(0.0, 1.0) * side as f32).min(side as f32 - 1.0) as u32;
        let (x, y) = (place(spot.x, camera.width), place(spot.y, camera.height));
        // Of a mix, only the radiance is known.
        let probe = self.driver.live.probe(x, y).filter(|_| self.mixed().is_none());
        let found = probe.map(|probe| {
            let Probe { radiance, irradiance, reflectance, distance, .. } = probe;
            let [lux, candela_per_m2] = [irradiance, radiance].map(photometric);
            MeterReading { radiance, irradiance, reflectance, distance, lux, candela_per_m2 }
        });
        ([x, y], found)
    }

    /// Sends a viewer the whole state.
    fn welcome(&self, viewer: Viewer) {
        let Some(scene) = self.scene() else { return };
        let (waiting, steps) = (self.driver.live.waiting(), self.edits.steps());
        let welcome = Welcome {
            you: viewer,
            scene: SceneInfo::of(scene),
            camera: self.camera(),
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
            self.presets_message(),
            self.offer_message(),
            self.audience.controls(),
        ];
        messages.iter().for_each(|message| self.audience.send(viewer, message));
    }

    fn knobs(&self) -> Knobs {
        let live::Knobs { method, rate, rest_after, .. } = self.driver.live.knobs();
        Knobs {
            layer: self.settings.layer.name.into(),
            rate: *rate,
            method: Named::from(method),
            tone: self.tone_settings(),
            rest_after: *rest_after,
            denoise: self.denoises(),
            mix: self.mixes(),
        }
    }

    pub(super) fn tone_settings(&self) -> ToneSettings {
        let Tone { exposure, operator } = self.settings.tone;
        let exposure = match exposure {
            Exposure::Fixed(stops) => stops,
            // Until it is chosen.
            Exposure::Auto => 0.0,
        };
        ToneSettings { exposure, operator }
    }

    pub(super) fn send_knobs(&self) {
        self.hub.send_all(&ServerMessage::Knobs(self.knobs()));
    }

    fn send_controls(&self) {
        self.hub.send_all(&self.audience.controls());
    }

    fn refuse(&self, viewer: Viewer, reason: &str) {
        self.audience.send(viewer, &ServerMessage::Refused { reason: reason.into() });
    }
}
