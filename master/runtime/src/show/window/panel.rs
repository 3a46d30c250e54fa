//! The panel: what is selected, how it is shown, how the machine is.

use std::time::{Duration, Instant};

use eframe::egui::{
    Align, Button, CollapsingHeader, Color32, ComboBox, Grid, Layout, RichText, ScrollArea, Sense, Slider,
    SliderClamping, Ui, vec2,
};
use frame::front_end::Value;
use frame::tone::Operator;
use protocol::schedule::WorkerState;
use scenes::{Camera, Change};

use super::App;
use super::gizmo::Selection;
use super::material::{self, label, row};
use super::orbit::Drag;
use crate::cluster::roster;
use crate::display::hues::own_key;
use crate::display::message::{ClientMessage, KnobInfo, PieceInfo, Viewpoint};
use crate::files::OutputKind;

const CURVES: [(Operator, &str); 4] = [
    (Operator::None, "None (exact)"),
    (Operator::Reinhard, "Reinhard"),
    (Operator::Aces, "ACES"),
    (Operator::Agx, "AgX"),
];
const DRAGS: [(Drag, &str, &str); 3] = [
    (Drag::Orbit, "Orbit", "Drag turns around what is under the pointer"),
    (Drag::Look, "Look", "Drag looks around from where you stand"),
    (Drag::Pan, "Pan", "Drag shifts the view"),
];
/// Exposures that the slider reaches, either way: from beside a sun's disc to starlight.
const SLIDER_STOPS: f32 = 24.0;
/// Objects that are listed.
const LISTED_MAX: usize = 500;

impl App {
    /// All of it, from top to bottom.
    pub(super) fn panel(&mut self, ui: &mut Ui) {
        self.tools(ui);
        ScrollArea::vertical().auto_shrink(false).show(ui, |ui| {
            let may_edit = self.has_controls();
            ui.add_enabled_ui(may_edit, |ui| {
                section(ui, "Selection", true, |ui| self.selected(ui));
                section(ui, "Picture", true, |ui| self.look(ui));
                if self.scene.info.time.is_some() {
                    section(ui, "Time", true, |ui| self.time(ui));
                }
                section(ui, "Views", true, |ui| self.views(ui));
                section(ui, "Lamps and objects", false, |ui| self.things(ui));
                section(ui, "Quality", false, |ui| self.quality(ui));
            });
            section(ui, "Save", true, |ui| self.save(ui));
            section(ui, "Machine", true, |ui| self.machine(ui));
        });
    }

    fn tools(&mut self, ui: &mut Ui) {
        ui.horizontal(|ui| {
            for (drag, name, what) in DRAGS {
                ui.selectable_value(&mut self.drag, drag, name).on_hover_text(what);
            }
            ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
                ui.toggle_value(&mut self.has_help, "?").on_hover_text("Keys (F1)");
                let [done, undone] = self.steps;
                let may_edit = self.has_controls();
                if !may_edit && ui.button("Watching").on_hover_text("How to get the controls").clicked() {
                    self.offer_controls();
                }
                let save = ui.add_enabled(may_edit, Button::new("Save"));
                if save.on_hover_text("The scene with its edits, as a file beside it (Ctrl S)").clicked() {
                    self.link.send(ClientMessage::Save);
                }
                let redo = ui.add_enabled(may_edit && undone > 0, Button::new("Redo"));
                if redo.on_hover_text("Ctrl Shift Z").clicked() {
                    self.link.send(ClientMessage::Redo);
                }
                let undo = ui.add_enabled(may_edit && done > 0, Button::new("Undo"));
                if undo.on_hover_text("Ctrl Z").clicked() {
                    self.link.send(ClientMessage::Undo);
                }
            });
        });
        ui.separator();
    }

    fn selected(&mut self, ui: &mut Ui) {
        match self.selection {
            None => {
                ui.weak("Click something in the picture, or a lamp, to move it and to change what it is made of.");
                ui.weak("Shift click: the whole object that it belongs to, or a piece of it.");
            }
            Some(Selection::Light { index }) => {
                let Some(mut value) = self.scene.info.lights.get(index).cloned() else { return };
                ui.strong(self.scene.lamp_name(index));
                let up = self.orbit.map_or(glam::Vec3::Y, |orbit| orbit.up());
                let known = hue(self.scene.hues.lights.get(&(index as u32)));
                let mut off = known;
                let changed = material::light(ui, &mut value, up, &mut off);
                if off != known {
                    self.scene.hues.lights.insert(index as u32, off);
                }
                if changed {
                    self.edit(Change::Light { light: index as u32, value });
                }
            }
            Some(selection @ Selection::Object { index, material }) => {
                self.object(ui, selection, material, |visible| Change::Visible { object: index as u32, visible });
            }
            Some(selection @ Selection::Piece { object, piece, material }) => {
                self.whole_or_back(ui, object, piece);
                self.object(ui, selection, material, |visible| Change::PieceVisible { object, piece, visible });
            }
        }
    }

    /// From a piece to its whole, or to what it was.
    fn whole_or_back(&mut self, ui: &mut Ui, object: u32, piece: u32) {
        let name = self.scene.info.objects.get(object as usize).map_or("", |whole| &whole.name);
        let name = name_or(name, "object", object as usize);
        let is_lifted = self.scene.piece(object, piece).is_some_and(PieceInfo::is_lifted);
        ui.horizontal(|ui| {
            if ui.button(format!("All of {name}")).on_hover_text("Select the whole object (Shift click)").clicked() {
                self.selection = Some(Selection::Object { index: object as usize, material: None });
            }
            let back = ui.add_enabled(is_lifted, Button::new("Put back"));
            if back.on_hover_text("As it is in the file").clicked() {
                let whole_from_piece = scenes::Transform::IDENTITY;
                self.edit(Change::PieceTransform { object, piece, whole_from_piece });
                self.edit(Change::PieceVisible { object, piece, visible: true });
                let own = self.scene.piece(object, piece).map(|known| known.own.clone()).unwrap_or_default();
                for (material, _) in own {
                    self.edit(Change::OwnMaterial { object, piece: Some(piece), material, value: None });
                }
            }
        });
    }

    fn object(&mut self, ui: &mut Ui, selection: Selection, chosen: Option<u32>, show: impl Fn(bool) -> Change) {
        let Some(object) = selection.object(&self.scene) else { return };
        let number = if let Selection::Object { index, .. } = selection { index } else { 0 };
        ui.strong(name_or(&object.name, "Object", number));
        let materials = object.materials;
        let mut visible = object.visible;
        if ui.checkbox(&mut visible, "Visible").changed() {
            self.edit(show(visible));
        }
        let current = chosen.filter(|m| materials.contains(m)).or(materials.first().copied());
        let Some(mut current) = current else { return };
        let name = |number: u32| {
            let named = self.scene.info.materials.get(number as usize).map_or("", |material| &material.name);
            name_or(named, "Material", number as usize)
        };
        if materials.len() > 1 {
            let before = current;
            ui.horizontal(|ui| {
                label(ui, "Material");
                ComboBox::from_id_salt("material").selected_text(name(current)).truncate().show_ui(ui, |ui| {
                    for number in &materials {
                        ui.selectable_value(&mut current, *number, name(*number));
                    }
                });
            });
            if current != before {
                self.selection = Some(selection.of_material(Some(current)));
            }
        } else {
            ui.weak(name(current));
        }
        let (whole, piece) = match selection {
            Selection::Piece { object, piece, .. } => (object, Some(piece)),
            _ => (number as u32, None),
        };
        let of_thing = self.scene.made_of(whole, piece, current);
        let has_own = of_thing != self.scene.info.materials.get(current as usize);
        // What nothing else is made of needs no second one. Of pieces, nobody knows here.
        let mut objects = (0_u32..).zip(&self.scene.info.objects);
        let others = piece.is_some()
            || has_own
            || objects.any(|(other, object)| other != whole && object.materials.contains(&current));
        if others {
            ui.checkbox(&mut self.alike, "All that are made of this").on_hover_text(
                "What is changed here is changed of all things of this material, but for those that have their own",
            );
        }
        if has_own && ui.button("Like the others").on_hover_text("Takes its own material away").clicked() {
            self.edit(Change::OwnMaterial { object: whole, piece, material: current, value: None });
        }
        let alike = self.alike || !others;
        let known = match alike {
            true => self.scene.info.materials.get(current as usize),
            false => self.scene.made_of(whole, piece, current),
        };
        let Some(mut value) = known.cloned() else { return };
        let hues = &self.scene.hues;
        let own_hue = hues.own.get(&own_key(whole, piece, current)).filter(|_| !alike);
        let off = hue(own_hue.or_else(|| hues.materials.get(&current)));
        if material::material(ui, &mut value, off) {
            self.edit(match alike {
                true => Change::Material { material: current, value },
                false => Change::OwnMaterial { object: whole, piece, material: current, value: Some(value) },
            });
        }
    }

    fn look(&mut self, ui: &mut Ui) {
        let mut tone = self.knobs.tone;
        let stops = -SLIDER_STOPS..=SLIDER_STOPS;
        let slider = Slider::new(&mut tone.exposure, stops).clamping(SliderClamping::Edits).suffix(" EV");
        let slider = slider.step_by(0.05).max_decimals(2);
        let mut turned = row(ui, "Exposure", |ui| ui.add(slider));
        ui.horizontal(|ui| {
            label(ui, "Tone");
            turned |= choice(ui, "tone", &CURVES, &mut tone.operator);
            if ui.button("Auto").on_hover_text("Choose the exposure by this picture").clicked() {
                self.link.send(ClientMessage::AutoExpose);
            }
        });
        if turned {
            self.knobs.tone = tone;
            self.link.send(ClientMessage::Tone(tone));
        }
        ui.horizontal(|ui| {
            label(ui, "Show");
            let method = self.methods.iter().find(|method| method.name == self.knobs.method.name);
            let layers = method.map_or(&[][..], |method| &method.layers);
            let layers: Vec<_> = layers.iter().map(|layer| (layer.name.as_str(), layer.label.as_str(), "")).collect();
            if let Some(layer) = choice_of_words(ui, "layer", &layers, &self.knobs.layer) {
                self.knobs.layer.clone_from(&layer);
                self.link.send(ClientMessage::Inspect { layer });
            }
        });
        // Only where there is a denoiser.
        if let Some(on) = &mut self.knobs.denoise {
            let switch = ui.checkbox(on, "Denoise at rest").on_hover_text("Still pictures, by Open Image Denoise");
            if switch.changed() {
                self.link.send(ClientMessage::Denoise { on: *on });
            }
        }
        ui.checkbox(&mut self.meter.on, "Light meter under the pointer");
    }

    fn time(&mut self, ui: &mut Ui) {
        let Some([from, to]) = self.scene.info.time else { return };
        let before = self.clock;
        ui.horizontal(|ui| {
            let label = if self.playing { "Pause" } else { "Play" };
            if ui.button(label).clicked() {
                self.playing = !self.playing;
                self.gesture += 1;
            }
            ui.add(Slider::new(&mut self.clock, from..=to).max_decimals(2));
        });
        self.playing &= self.has_controls();
        if self.playing {
            self.clock += f64::from(ui.input(|input| input.stable_dt.min(0.1)));
            if self.clock > to {
                self.clock = from;
            }
            ui.ctx().request_repaint();
        }
        if self.clock != before {
            self.edit(Change::Time(self.clock));
        }
    }

    fn views(&mut self, ui: &mut Ui) {
        ui.horizontal_wrapped(|ui| {
            for number in 0..self.views.len() {
                let key = if number < 9 { format!("Key {}; ", number + 1) } else { String::new() };
                let hint = format!("{key}Shift click forgets it");
                let name = &self.views[number].name;
                let name = if name.is_empty() { format!("{}", number + 1) } else { name.clone() };
                if ui.button(name).on_hover_text(hint).clicked() {
                    if ui.input(|input| input.modifiers.shift) {
                        return self.link.send(ClientMessage::ForgetView { number });
                    }
                    let before = self.orbit;
                    self.go_to(number);
                    self.look_from(before);
                }
            }
            if ui.button("Save this view").clicked()
                && let Some(orbit) = self.orbit
            {
                let view = Viewpoint::of(&orbit.camera(), 0.0);
                self.link.send(ClientMessage::SaveView { view, name: String::new(), picture: None, lamps: false });
            }
        });
    }

    fn things(&mut self, ui: &mut Ui) {
        let lamps = (0..self.scene.info.lights.len()).filter(|index| !self.scene.info.lights[*index].is_absent());
        let lamps = lamps.map(|index| (Selection::Light { index }, self.scene.lamp_name(index)));
        let objects = self.scene.info.objects.iter().take(LISTED_MAX).enumerate();
        let objects = objects
            .map(|(index, it)| (Selection::Object { index, material: None }, name_or(&it.name, "Object", index)));
        let lifted = self.scene.info.pieces.iter().filter(|piece| piece.is_lifted()).take(LISTED_MAX);
        let lifted = lifted.filter_map(|PieceInfo { object, piece, .. }| {
            let lifted = self.scene.piece_as_object(*object, *piece)?;
            let name = format!("↗ {}{}", lifted.name, if lifted.visible { "" } else { " (hidden)" });
            Some((Selection::Piece { object: *object, piece: *piece, material: None }, name))
        });
        let mut chosen = None;
        for (selection, name) in lamps.chain(objects).chain(lifted) {
            let is_selected = self.selection.is_some_and(|mine| mine.is_same(selection));
            if ui.selectable_label(is_selected, name).clicked() {
                chosen = Some(selection);
            }
        }
        self.selection = chosen.or(self.selection);
    }

    /// Built from the method's own description.
    fn quality(&mut self, ui: &mut Ui) {
        let mut rate = self.knobs.rate;
        if row(ui, "Frames/s", |ui| ui.add(Slider::new(&mut rate, 2.0..=30.0).step_by(1.0))) {
            self.knobs.rate = rate;
            self.link.send(ClientMessage::Rate { rate });
        }
        if self.methods.len() > 1 {
            let methods = self.methods.iter().map(|m| (m.name.as_str(), m.name.as_str(), m.about.as_str()));
            let methods: Vec<_> = methods.collect();
            let chosen = ui.horizontal(|ui| {
                label(ui, "Method");
                choice_of_words(ui, "method", &methods, &self.knobs.method.name)
            });
            if let Some(name) = chosen.inner {
                self.link.send(ClientMessage::Method { name });
            }
        }
        let Some(method) = self.methods.iter().find(|method| method.name == self.knobs.method.name) else { return };
        let mut turned = None;
        for knob in &method.knobs {
            let Some(value) = self.knobs.method.settings.get(&knob.name) else { continue };
            let other = turn(ui, knob, value);
            turned = other.map(|value| (knob.name.clone(), value)).or(turned);
        }
        if let Some((name, value)) = turned {
            self.knobs.method.settings.insert(name.clone(), value.clone());
            self.link.send(ClientMessage::Turn { values: [(name, value)].into() });
        }
    }

    fn save(&self, ui: &mut Ui) {
        ui.horizontal(|ui| {
            for (kind, name) in [(OutputKind::Png, "PNG"), (OutputKind::Exr, "EXR")] {
                if ui.button(name).on_hover_text("Into the folder that the program was started in").clicked() {
                    self.link.save(kind, self.meter.spot.filter(|_| self.meter.on));
                }
            }
        });
    }

    fn machine(&mut self, ui: &mut Ui) {
        let ms = |value: Option<f64>| value.map_or("–".into(), |value| format!("{value:.0} ms"));
        let status = &self.status;
        let drawn = self.shown.as_ref().map(|shown| &shown.frame.header);
        let frames = |frames: u32, finished: bool| format!("{frames} frames{}", if finished { ", done" } else { "" });
        let rows = [
            ("Frames/s", format!("{:.1}", self.pace.rate())),
            ("Latency", ms(self.pace.latency_ms)),
            ("… master p50", ms(status.latency_ms[0])),
            ("… master p99", ms(status.latency_ms[1])),
            ("Accumulated", drawn.map_or("–".into(), |header| frames(header.frames, header.finished))),
            ("Error (relMSE)", status.error.map_or("–".into(), |error| format!("{error:.1e}"))),
            ("Size drawn", drawn.map_or("–".into(), |header| format!("{} × {}", header.width, header.height))),
            ("Rays", si(status.rays_per_second, "ray/s")),
            ("From workers", si(status.answer_bytes_per_second, "B/s")),
            ("To this window", si(self.pace.bytes_per_second(), "B/s")),
        ];
        Grid::new("figures").num_columns(2).spacing([12.0, 3.0]).show(ui, |ui| {
            for (name, value) in rows {
                ui.weak(name);
                ui.label(value);
                ui.end_row();
            }
        });
        ui.add_space(4.0);
        if status.workers.is_empty() {
            ui.weak("No worker has come yet");
        }
        for worker in &status.workers {
            let doing = match worker.progress {
                Some((has, all)) => format!("fetching {has}/{all}"),
                None => roster::word(worker.state).into(),
            };
            let colour = match worker.state {
                WorkerState::Ready => Color32::from_rgb(123, 216, 143),
                WorkerState::Quarantined => Color32::from_rgb(255, 107, 107),
                _ => Color32::from_rgb(255, 180, 84),
            };
            ui.horizontal(|ui| {
                let (dot, _) = ui.allocate_exact_size(vec2(9.0, 9.0), Sense::hover());
                ui.painter().circle_filled(dot.center(), 4.0, colour);
                ui.label(format!("{} · {} threads", worker.name, worker.threads));
                ui.weak(doing);
            });
        }
    }

    /// Looks from a saved view.
    pub(super) fn go_to(&mut self, number: usize) {
        let Some(orbit) = &mut self.orbit else { return };
        let Camera { width, height, .. } = orbit.camera();
        if let Some(view) = self.views.get(number).and_then(|view| view.camera([width, height]).ok()) {
            orbit.set(view);
            if !self.views[number].lamps.is_empty() {
                self.link.send(ClientMessage::Relight { number });
            }
        }
    }
}

/// Pictures a second, and how long they take to come.
pub(super) struct Pace {
    /// When they came, and how large they were, bytes.
    pictures: Vec<(Instant, usize)>,
    /// From an input to its picture, smoothed.
    pub latency_ms: Option<f64>,
}

/// Pictures are counted over this time.
const COUNTED: Duration = Duration::from_secs(2);

impl Pace {
    pub fn new() -> Self {
        Self { pictures: Vec::new(), latency_ms: None }
    }

    /// A picture has come.
    pub fn picture(&mut self, bytes: usize) {
        self.pictures.push((Instant::now(), bytes));
    }

    /// It shows an input that was made this many milliseconds ago.
    pub fn waited(&mut self, ms: f64) {
        self.latency_ms = Some(self.latency_ms.map_or(ms, |before| before + 0.3 * (ms - before)));
    }

    /// Pictures a second.
    pub fn rate(&mut self) -> f64 {
        self.pictures.retain(|(time, _)| time.elapsed() < COUNTED);
        self.pictures.len() as f64 / COUNTED.as_secs_f64()
    }

    /// Bytes of pictures a second.
    pub fn bytes_per_second(&self) -> f64 {
        let counted = self.pictures.iter().filter(|(time, _)| time.elapsed() < COUNTED);
        counted.map(|(_, bytes)| *bytes as f64).sum::<f64>() / COUNTED.as_secs_f64()
    }
}

fn section(ui: &mut Ui, title: &str, open: bool, contents: impl FnOnce(&mut Ui)) {
    CollapsingHeader::new(RichText::new(title).strong()).default_open(open).show_unindented(ui, contents);
    ui.add_space(4.0);
}

/// A list to choose from; whether another was chosen.
fn choice<T: Copy + PartialEq>(ui: &mut Ui, id: &str, all: &[(T, &str)], chosen: &mut T) -> bool {
    let before = *chosen;
    let name = all.iter().find(|(value, _)| *value == before).map_or("", |(_, name)| name);
    ComboBox::from_id_salt(id).selected_text(name).show_ui(ui, |ui| {
        for (value, name) in all {
            ui.selectable_value(chosen, *value, *name);
        }
    });
    *chosen != before
}

/// A knob of a method; its other value, if it was turned.
fn turn(ui: &mut Ui, knob: &KnobInfo, value: &Value) -> Option<Value> {
    match (value, knob.slider) {
        (Value::Switch(on), _) => {
            let mut on = *on;
            let changed = ui.checkbox(&mut on, &knob.label).on_hover_text(&knob.about).changed();
            changed.then_some(Value::Switch(on))
        }
        (Value::Word(word), _) => {
            let words: Vec<_> = knob.words.iter().map(|[word, about]| (&**word, &**word, &**about)).collect();
            let chosen = ui.horizontal(|ui| {
                label(ui, &knob.label);
                choice_of_words(ui, &knob.name, &words, word)
            });
            chosen.inner.map(Value::Word)
        }
        (Value::Whole(n), Some(slider)) => {
            let (mut n, step) = (*n, f64::from(slider.step));
            let bar = Slider::new(&mut n, slider.least as u32..=slider.most as u32).step_by(step);
            row(ui, &knob.label, |ui| ui.add(bar).on_hover_text(&knob.about)).then_some(Value::Whole(n))
        }
        (Value::Real(x), Some(slider)) => {
            let (mut x, step) = (*x, f64::from(slider.step));
            let bar = Slider::new(&mut x, slider.least..=slider.most).step_by(step);
            row(ui, &knob.label, |ui| ui.add(bar).on_hover_text(&knob.about)).then_some(Value::Real(x))
        }
        _ => None,
    }
}

/// A list of words, each with a name and what it means; returns the word if another was chosen.
fn choice_of_words(ui: &mut Ui, id: &str, all: &[(&str, &str, &str)], chosen: &str) -> Option<String> {
    let name = all.iter().find(|(word, ..)| *word == chosen).map_or(chosen, |(_, name, _)| name);
    let mut other = None;
    ComboBox::from_id_salt(id).selected_text(name).show_ui(ui, |ui| {
        for (word, name, about) in all {
            let entry = ui.selectable_label(*word == chosen, *name);
            let entry = if about.is_empty() { entry } else { entry.on_hover_text(*about) };
            if entry.clicked() {
                other = Some((*word).to_owned());
            }
        }
    });
    other.filter(|other| other != chosen)
}

fn name_or(name: &str, kind: &str, index: usize) -> String {
    if name.is_empty() { format!("{kind} {}", index + 1) } else { name.into() }
}

/// A number with a prefix of thousands.
pub(super) fn si(value: f64, unit: &str) -> String {
    for (size, letter) in [(1e9, "G"), (1e6, "M"), (1e3, "k")] {
        if value >= size {
            return format!("{:.*} {letter}{unit}", usize::from(value < 100.0 * size), value / size);
        }
    }
    format!("{value:.0} {unit}")
}

/// The colour of what was turned off, its brightest channel 1; white if nobody has seen it on.
fn hue(was: Option<&glam::Vec3>) -> glam::Vec3 {
    was.filter(|was| was.max_element() > 0.0).map_or(glam::Vec3::ONE, |was| *was / was.max_element())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_short() {
        assert_eq!(si(12_345_678.0, "ray/s"), "12.3 Mray/s");
        assert_eq!(si(123_456.0, "B/s"), "123 kB/s");
        assert_eq!(si(7.0, "B/s"), "7 B/s");
    }
}
