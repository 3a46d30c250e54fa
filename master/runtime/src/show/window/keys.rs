//! What keys do: those that are pressed, and those that move while they are held.

use eframe::egui::{self, Context, Key, Modifiers, Ui, ViewportCommand};
use frame::tone::STOPS_MAX;
use glam::Vec3;
use scenes::Camera;

use super::App;
use super::gizmo::{self, Stage, Step};
use crate::display::message::ClientMessage;

impl App {
    pub(super) fn keys(&mut self, ctx: &Context) {
        if ctx.egui_wants_keyboard_input() {
            return;
        }
        let pressed = |modifiers, key| ctx.input_mut(|input| input.consume_key(modifiers, key));
        if pressed(Modifiers::COMMAND, Key::Q) {
            ctx.send_viewport_cmd(ViewportCommand::Close);
        }
        if pressed(Modifiers::NONE, Key::F1) || pressed(Modifiers::NONE, Key::Questionmark) {
            self.has_help = !self.has_help;
        }
        if pressed(Modifiers::NONE, Key::P) {
            self.has_panel = !self.has_panel;
        }
        if pressed(Modifiers::NONE, Key::Escape) {
            self.selection = None;
        }
        if pressed(Modifiers::NONE, Key::Enter) || pressed(Modifiers::NONE, Key::F11) {
            let is_full = ctx.input(|input| input.viewport().fullscreen.unwrap_or(false));
            ctx.send_viewport_cmd(ViewportCommand::Fullscreen(!is_full));
        }
        if !self.has_controls() {
            let is_try = |key: &Key| ctx.input(|input| input.key_pressed(*key));
            if HOLDS.iter().any(is_try) {
                self.offer_controls();
            }
            return;
        }
        if pressed(Modifiers::COMMAND | Modifiers::SHIFT, Key::Z) || pressed(Modifiers::COMMAND, Key::Y) {
            self.link.send(ClientMessage::Redo);
        } else if pressed(Modifiers::COMMAND, Key::Z) {
            self.link.send(ClientMessage::Undo);
        } else if pressed(Modifiers::COMMAND, Key::S) {
            self.link.send(ClientMessage::Save);
        }
        for (key, by) in [(Key::OpenBracket, -KEY_STOPS), (Key::CloseBracket, KEY_STOPS)] {
            if pressed(Modifiers::NONE, key) {
                self.knobs.tone.exposure = (self.knobs.tone.exposure + by).clamp(-STOPS_MAX, STOPS_MAX);
                self.link.send(ClientMessage::Tone(self.knobs.tone));
            }
        }
        let before = self.orbit;
        if pressed(Modifiers::NONE, Key::R)
            && let Some(orbit) = &mut self.orbit
        {
            orbit.go_home();
        }
        if pressed(Modifiers::NONE, Key::F) {
            self.frame_selection();
        }
        for (number, key) in DIGITS.into_iter().enumerate() {
            if pressed(Modifiers::NONE, key) {
                self.go_to(number);
            }
        }
        self.walk(ctx);
        self.look_from(before);
    }

    /// For hands without a pointer: selects what is in the middle of the picture, and moves the selection by steps.
    pub(super) fn select_and_step(&mut self, ctx: &Context, stage: Stage) {
        if ctx.egui_wants_keyboard_input() {
            return;
        }
        let pressed = |modifiers, key| ctx.input_mut(|input| input.consume_key(modifiers, key));
        if pressed(Modifiers::SHIFT, Key::Space) {
            self.pick(&stage, stage.rect.center(), true, true);
        } else if pressed(Modifiers::NONE, Key::Space) {
            self.pick(&stage, stage.rect.center(), true, false);
        }
        let Some(selection) = self.selection.filter(|_| self.has_controls()) else { return };
        for (key, step) in STEPS {
            if pressed(Modifiers::ALT, key)
                && let Some(change) = gizmo::step(stage, &self.scene, selection, step)
            {
                self.edit(change);
            }
        }
    }

    /// Keys that move while they are held.
    fn walk(&mut self, ctx: &Context) {
        let Some(orbit) = &mut self.orbit else { return };
        let (way, gaze, seconds) = ctx.input(|input| {
            let free = !input.modifiers.any();
            let held = |more: Key, less: Key| {
                f32::from(u8::from(free && input.key_down(more))) - f32::from(u8::from(free && input.key_down(less)))
            };
            let way = Vec3::new(held(Key::D, Key::A), held(Key::E, Key::Q), held(Key::W, Key::S));
            let gaze = glam::Vec2::new(held(Key::ArrowLeft, Key::ArrowRight), held(Key::ArrowUp, Key::ArrowDown));
            (way, gaze, input.stable_dt.min(0.1))
        });
        if way != Vec3::ZERO {
            orbit.walk(way, seconds);
        }
        if gaze != glam::Vec2::ZERO {
            orbit.gaze(gaze, seconds);
        }
        if way != Vec3::ZERO || gaze != glam::Vec2::ZERO {
            ctx.request_repaint();
        }
    }

    pub(super) fn frame_selection(&mut self) {
        let (Some(selection), Some(orbit)) = (self.selection, &mut self.orbit) else { return };
        let Camera { origin, target, width, height, .. } = orbit.camera();
        if let Some((centre, radius)) = gizmo::ball(&self.scene, selection, 0.3 * origin.distance(target)) {
            orbit.frame(centre, radius, width as f32 / height as f32);
        }
    }
}

/// Keys of the camera and of what is shown: only the controls' holder may use them.
const HOLDS: [Key; 16] = [
    Key::W,
    Key::A,
    Key::S,
    Key::D,
    Key::Q,
    Key::E,
    Key::ArrowLeft,
    Key::ArrowRight,
    Key::ArrowUp,
    Key::ArrowDown,
    Key::R,
    Key::F,
    Key::Z,
    Key::Y,
    Key::OpenBracket,
    Key::CloseBracket,
];
/// Brightness by a key, stops.
const KEY_STOPS: f32 = 0.25;
/// Steps of the selection, with Alt.
const STEPS: [(Key, Step); 11] = [
    (Key::ArrowLeft, Step::Shift(Vec3::NEG_X)),
    (Key::ArrowRight, Step::Shift(Vec3::X)),
    (Key::ArrowDown, Step::Shift(Vec3::NEG_Y)),
    (Key::ArrowUp, Step::Shift(Vec3::Y)),
    (Key::PageDown, Step::Shift(Vec3::NEG_Z)),
    (Key::PageUp, Step::Shift(Vec3::Z)),
    (Key::Comma, Step::Turn(TURN)),
    (Key::Period, Step::Turn(-TURN)),
    (Key::Minus, Step::Size(1.0 / GROW)),
    (Key::Plus, Step::Size(GROW)),
    (Key::Equals, Step::Size(GROW)),
];
/// A step's angle, radians, and factor.
const TURN: f32 = std::f32::consts::PI / 36.0;
const GROW: f32 = 1.05;
/// Keys, and what they do.
const KEYS: [(&str, &str); 21] = [
    ("W A S D", "walk"),
    ("Q E", "sink, rise"),
    ("arrows", "look around"),
    ("F", "frame the selection"),
    ("R", "back to the first view"),
    ("1 … 9", "saved views"),
    ("[ ]", "exposure"),
    ("click", "select a thing"),
    ("Space", "select what is in the middle"),
    ("Shift with either", "the whole object, or a piece of it"),
    ("Alt arrows", "move the selection"),
    ("Alt Page Up, Down", "push, pull it"),
    ("Alt , .", "turn it"),
    ("Alt - +", "size it"),
    ("Esc", "select nothing"),
    ("Ctrl Z, Ctrl Shift Z", "undo, redo"),
    ("Ctrl S", "save the scene"),
    ("right drag, wheel", "pan; nearer, farther"),
    ("Enter, P", "full screen, panel"),
    ("Ctrl Q", "close"),
    ("F1, ?", "these keys"),
];

/// The keys.
pub(super) fn help(ui: &mut Ui) {
    egui::Grid::new("keys").num_columns(2).spacing([16.0, 4.0]).show(ui, |ui| {
        for (keys, what) in KEYS {
            ui.strong(keys);
            ui.label(what);
            ui.end_row();
        }
    });
}

const DIGITS: [Key; 9] =
    [Key::Num1, Key::Num2, Key::Num3, Key::Num4, Key::Num5, Key::Num6, Key::Num7, Key::Num8, Key::Num9];
