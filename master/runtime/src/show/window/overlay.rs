//! Text over the picture: figures, notices, who has the controls, what colours mean.

use std::time::{Duration, SystemTime, UNIX_EPOCH};

use eframe::egui::{self, Align2, Color32, FontId, Frame, Painter, Pos2, Rect, Ui, vec2};

use super::{App, panel};
use crate::display::message::{ClientMessage, Offer};
use crate::display::paint;

impl App {
    pub(super) fn glance(&mut self, painter: &Painter, rect: Rect) {
        let Some(shown) = &self.shown else { return };
        let header = &shown.frame.header;
        let drawn = match header.moving {
            true => format!("{}×{}", header.width, header.height),
            false => format!("{} {}", header.frames, if header.frames == 1 { "frame" } else { "frames" }),
        };
        let mut text = format!("{:.1} frames/s · {drawn}", self.pace.rate());
        if let Some(ms) = self.pace.latency_ms {
            text += &format!(" · {ms:.0} ms");
        }
        if let Some(error) = self.status.error.filter(|_| !header.moving) {
            text += &format!(" · error {error:.1e}");
        }
        text += &format!(" · {}", panel::si(self.status.rays_per_second, "ray/s"));
        plate(painter, rect.left_bottom() + vec2(10.0, -10.0), Align2::LEFT_BOTTOM, &text);
        if let Some((text, _)) = self.notice.as_ref().filter(|(_, since)| since.elapsed() < NOTICE) {
            plate(painter, rect.center_bottom() + vec2(0.0, -44.0), Align2::CENTER_BOTTOM, text);
            painter.ctx().request_repaint_after(NOTICE);
        }
    }

    pub(super) fn curtain(&self, painter: &Painter, space: Rect) {
        let text = match &self.status {
            status if status.ready > 0 => "Drawing…",
            status if !status.workers.is_empty() => "Workers prepare the scene…",
            _ => "Waiting for workers…",
        };
        painter.text(space.center(), Align2::CENTER_CENTER, text, FontId::proportional(18.0), Color32::LIGHT_GRAY);
    }

    /// What an earlier master has kept: the controls' holder decides what becomes of it.
    fn offer_bar(&mut self, ui: &mut Ui, space: Rect) {
        let Some(Offer { saved, edits, files_changed }) = self.offer.filter(|_| self.has_controls()) else {
            return;
        };
        let now = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |since| since.as_secs());
        let ago = crate::spoken::duration(now.saturating_sub(saved) as f64);
        let at = space.left_top() + vec2(12.0, 60.0);
        egui::Area::new(egui::Id::unique("offer")).fixed_pos(at).show(ui.ctx(), |ui| {
            Frame::popup(ui.style()).show(ui, |ui| {
                ui.horizontal(|ui| {
                    ui.label(format!("Edits of this scene are kept from {ago} ago ({edits})."));
                    if files_changed {
                        ui.label("Its files have changed since: what still fits is taken up.");
                    }
                    if ui.button("Take them up again").clicked() {
                        self.link.send(ClientMessage::TakeUp);
                    }
                    if ui.button("Start afresh").on_hover_text("Forgets them").clicked() {
                        self.link.send(ClientMessage::StartAfresh);
                    }
                });
            });
        });
    }

    /// The controls: shown if they are free, if a viewer asks for them, or if they are wanted here.
    pub(super) fn bar(&mut self, ui: &mut Ui, space: Rect) {
        self.offer_bar(ui, space);
        let is_wanted = self.tried.is_some_and(|at| at.elapsed() < NOTICE);
        let is_asked = self.has_controls() && self.asked.is_some();
        if self.you.is_none() || !(is_asked || self.holder.is_none() || (is_wanted && !self.has_controls())) {
            return;
        }
        ui.ctx().request_repaint_after(NOTICE);
        let at = space.left_top() + vec2(12.0, 12.0);
        egui::Area::new(egui::Id::unique("bar")).fixed_pos(at).show(ui.ctx(), |ui| {
            Frame::popup(ui.style()).show(ui, |ui| {
                ui.horizontal(|ui| match (self.asked, self.holder) {
                    (Some(by), _) if self.has_controls() => {
                        ui.label(format!("Viewer {by} asks for the controls."));
                        if ui.button("Hand over").clicked() {
                            self.link.send(ClientMessage::Give { to: by });
                            self.asked = None;
                        }
                        if ui.button("Keep").clicked() {
                            self.link.send(ClientMessage::Give { to: self.you.unwrap_or_default() });
                            self.asked = None;
                        }
                    }
                    (_, holder) => {
                        let (text, button) = match holder {
                            Some(viewer) => {
                                (format!("You are watching: viewer {viewer} has the controls."), "Ask for the controls")
                            }
                            None => ("Nobody has the controls.".into(), "Take the controls"),
                        };
                        ui.label(text);
                        if ui.button(button).clicked() {
                            self.link.send(ClientMessage::Take);
                        }
                    }
                });
            });
        });
    }
}

/// Notices are shown this long.
const NOTICE: Duration = Duration::from_secs(8);
/// Colours of a legend.
const RAMP_STEPS: usize = 64;

/// What the colours mean.
pub(super) fn legend(painter: &Painter, rect: Rect, legend: Option<&paint::Legend>) {
    let Some(legend) = legend else { return };
    let at = rect.right_bottom() - vec2(10.0, 10.0);
    let Some(scale) = legend.scale else { return plate(painter, at, Align2::RIGHT_BOTTOM, &legend.title) };
    let ramp = Rect::from_min_size(at - vec2(220.0, 30.0), vec2(220.0, 10.0));
    painter.rect_filled(ramp.expand2(vec2(10.0, 24.0)).translate(vec2(0.0, -2.0)), 6.0, Color32::from_black_alpha(170));
    let step = ramp.width() / RAMP_STEPS as f32;
    for index in 0..RAMP_STEPS {
        let share = (index as f32 + 0.5) / RAMP_STEPS as f32;
        let [red, green, blue] = scale.ramp.at(share);
        let min = ramp.min + vec2(step * index as f32, 0.0);
        let part = Rect::from_min_size(min, vec2(step + 0.5, ramp.height()));
        painter.rect_filled(part, 0.0, Color32::from_rgb(red, green, blue));
    }
    let text = |at, align, text: &str| {
        painter.text(at, align, text, FontId::proportional(12.0), Color32::WHITE);
    };
    let number = |value: f32| match value.abs() {
        big if big >= 100.0 => format!("{value:.0} {}", scale.unit),
        small if small < 0.01 && small > 0.0 => format!("{value:.1e} {}", scale.unit),
        _ => format!("{value:.2} {}", scale.unit),
    };
    text(ramp.center_top() - vec2(0.0, 4.0), Align2::CENTER_BOTTOM, &legend.title);
    text(ramp.left_bottom() + vec2(0.0, 3.0), Align2::LEFT_TOP, &number(scale.from));
    text(ramp.right_bottom() + vec2(0.0, 3.0), Align2::RIGHT_TOP, &number(scale.to));
}

/// Text on a dark plate.
pub(super) fn plate(painter: &Painter, at: Pos2, align: Align2, text: &str) {
    let galley = painter.layout_no_wrap(text.into(), FontId::proportional(13.0), Color32::WHITE);
    let rect = align.anchor_size(at, galley.size());
    painter.rect_filled(rect.expand2(vec2(8.0, 4.0)), 6.0, Color32::from_black_alpha(170));
    painter.galley(rect.min, galley, Color32::WHITE);
}
