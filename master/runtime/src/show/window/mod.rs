//! The native window: the picture, what is drawn over it, and the panel beside it. To the session it is one more
//! viewer, with the same messages as a page in a browser; only its pictures come without a detour over JPEG.

mod gizmo;
mod keys;
mod link;
mod material;
mod orbit;
mod overlay;
mod panel;
mod scene;

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::{Duration, Instant};

use eframe::egui::emath::GuiRounding;
use eframe::egui::{
    self, Align2, CentralPanel, Color32, ColorImage, Context, Frame, Painter, Panel, PointerButton, Pos2, Rect,
    Response, Sense, TextureHandle, TextureOptions, Ui, Vec2, ViewportBuilder, ViewportCommand, pos2, vec2,
};
use frame::tone::Operator;
use scenes::Change;

use crate::display::encoded::EncodedFrame;
use crate::display::hub::Hub;
use crate::display::message::{
    ClientMessage, Edited, Hit, InputStamp, Knobs, MeterReading, MethodInfo, Offer, Picked, Probed, ServerMessage,
    Spot, Status, ToneSettings, Viewpoint,
};
use crate::methods::Named;
use gizmo::{Grab, Selection, Stage};
use link::{Link, LinkEvent};
use orbit::{Drag, Orbit};
use overlay::{legend, plate};
use panel::Pace;
use scene::SceneCopy;

/// Opens the window, and returns when it is closed. It must be called on the program's first thread.
///
/// # Errors
/// In words: no window can be opened, because there is no display, or it cannot draw.
pub fn run(hub: &Hub, title: &str) -> Result<(), String> {
    let viewport = ViewportBuilder::default()
        .with_title(format!("{title} – igi"))
        .with_app_id("igi")
        .with_inner_size([1180.0, 760.0])
        .with_min_inner_size([480.0, 320.0]);
    let options = eframe::NativeOptions { viewport, renderer: eframe::Renderer::Glow, ..Default::default() };
    let hub = hub.clone();
    let create: eframe::AppCreator<'_> = Box::new(move |creation| {
        creation.egui_ctx.set_theme(egui::Theme::Dark);
        let woken = creation.egui_ctx.clone();
        let link = Link::join(hub, move || woken.request_repaint())?;
        Ok(Box::new(App::new(link)))
    });
    eframe::run_native("igi", options, create).map_err(|error| error.to_string())
}

/// The window's state.
struct App {
    link: Link,
    scene: SceneCopy,
    you: Option<u64>,
    holder: Option<u64>,
    /// The viewer that asks for the controls.
    asked: Option<u64>,
    /// When something was last tried here that only the controls' holder may do.
    tried: Option<Instant>,
    knobs: Knobs,
    methods: Vec<MethodInfo>,
    steps: [usize; 2],
    status: Status,
    shown: Option<Shown>,
    selection: Option<Selection>,
    orbit: Option<Orbit>,
    drag: Drag,
    grab: Option<Grab>,
    /// Where the pointer was pressed, and what the answer about that spot is for.
    wanted: Option<Wanted>,
    /// Edits of one press of a button are one step to be undone.
    gesture: u64,
    views: Vec<scenes::SavedView>,
    /// What an earlier master has kept, until it is taken up or forgotten.
    offer: Option<Offer>,
    /// Of a scene that moves by itself.
    clock: f64,
    playing: bool,
    meter: Meter,
    pace: Pace,
    begun: Instant,
    /// A sentence that is shown for a while.
    notice: Option<(String, Instant)>,
    /// Pixels of the view, since when, and those that were sent last.
    shape: ([u32; 2], Instant, [u32; 2]),
    /// The window is out of sight, as was sent last.
    hidden: bool,
    has_panel: bool,
    has_help: bool,
    /// What is changed of a material is changed of all that are made of it.
    alike: bool,
}

/// The picture on the screen.
struct Shown {
    texture: TextureHandle,
    frame: Arc<EncodedFrame>,
}

#[derive(Clone, Copy, PartialEq)]
struct Wanted {
    spot: Spot,
    /// To select it, or only to turn around it.
    select: bool,
    /// The other of object and piece is meant.
    other: bool,
}

/// The light meter under the pointer; it stays where it was when the pointer leaves the picture.
struct Meter {
    on: bool,
    asked: Instant,
    spot: Option<Spot>,
    found: Option<MeterReading>,
}

const BACKDROP: Color32 = Color32::from_rgb(17, 18, 20);
/// The view's size is sent when it has rested this long.
const SHAPE_RESTS: Duration = Duration::from_millis(150);
/// The meter is asked this often at most.
const METER: Duration = Duration::from_millis(120);
const PANEL_WIDTH: f32 = 290.0;

impl eframe::App for App {
    fn logic(&mut self, ctx: &Context, _frame: &mut eframe::Frame) {
        self.handle_events(ctx);
        let hidden = ctx.input(|input| input.viewport().visible()) == Some(false);
        if hidden != std::mem::replace(&mut self.hidden, hidden) {
            self.link.send(ClientMessage::Hidden { hidden });
        }
    }

    fn ui(&mut self, ui: &mut Ui, _frame: &mut eframe::Frame) {
        let ctx = ui.ctx().clone();
        let is_key = |event: &egui::Event| matches!(event, egui::Event::Key { pressed: true, repeat: false, .. });
        if ctx.input(|input| input.pointer.any_pressed() || input.events.iter().any(is_key)) {
            self.gesture += 1;
        }
        self.keys(&ctx);
        if self.has_panel {
            Panel::right("panel").exact_size(PANEL_WIDTH).show(ui, |ui| self.panel(ui));
        }
        CentralPanel::default().frame(Frame::NONE.fill(BACKDROP)).show(ui, |ui| self.view(ui));
        egui::Window::new("Keys").open(&mut self.has_help).resizable(false).collapsible(false).show(&ctx, keys::help);
    }
}

impl App {
    fn new(link: Link) -> Self {
        let now = Instant::now();
        let tone = ToneSettings { exposure: 0.0, operator: Operator::None };
        let method = Named { name: String::new(), settings: BTreeMap::new() };
        Self {
            link,
            scene: SceneCopy::default(),
            you: None,
            holder: None,
            asked: None,
            tried: None,
            knobs: Knobs { layer: String::new(), tone, rate: 10.0, method, rest_after: 0, denoise: None, mix: false },
            methods: Vec::new(),
            steps: [0; 2],
            status: Status::default(),
            shown: None,
            selection: None,
            orbit: None,
            drag: Drag::Orbit,
            grab: None,
            wanted: None,
            gesture: 0,
            views: Vec::new(),
            offer: None,
            clock: 0.0,
            playing: false,
            meter: Meter { on: false, asked: now, spot: None, found: None },
            pace: Pace::new(),
            begun: now,
            notice: None,
            shape: ([0; 2], now, [0; 2]),
            hidden: false,
            has_panel: true,
            has_help: false,
            alike: false,
        }
    }

    // ---- what comes

    fn handle_events(&mut self, ctx: &Context) {
        let events: Vec<LinkEvent> = self.link.events().collect();
        for event in events {
            match event {
                LinkEvent::Message(message) => self.handle_message(message),
                LinkEvent::Frame(frame) => self.handle_frame(frame, ctx),
                LinkEvent::Saved(text) => self.notice = Some((text, Instant::now())),
                LinkEvent::Closed => ctx.send_viewport_cmd(ViewportCommand::Close),
            }
        }
    }

    fn handle_message(&mut self, message: ServerMessage) {
        match message {
            ServerMessage::Welcome(welcome) => {
                let is_first = self.orbit.is_none();
                (self.you, self.scene.info, self.steps) = (Some(welcome.you), welcome.scene, welcome.steps);
                (self.knobs, self.methods) = (welcome.knobs, welcome.methods);
                if is_first {
                    self.orbit = Some(Orbit::new(welcome.camera));
                    // In a room people look around; before a thing they turn it.
                    if self.scene.surrounds(welcome.camera.origin) {
                        self.drag = Drag::Look;
                    }
                    self.clock = self.scene.info.time.map_or(0.0, |[from, _]| from);
                }
            }
            ServerMessage::Knobs(knobs) => self.knobs = knobs,
            ServerMessage::Hues { hues } => self.scene.hues = hues,
            ServerMessage::Views { views } => self.views = views,
            ServerMessage::Offer { offer } => self.offer = offer,
            ServerMessage::Look { camera } => {
                if let Some(orbit) = &mut self.orbit {
                    orbit.set(camera);
                }
            }
            ServerMessage::Saved { file, .. } => self.notice = Some((format!("Saved: {file}"), Instant::now())),
            ServerMessage::Notice { text } | ServerMessage::Hung { text, .. } => {
                self.notice = Some((text, Instant::now()))
            }
            ServerMessage::Edited(Edited { changes, poses, pieces, solids, steps, by }) => {
                self.steps = steps;
                self.scene.info.solids.extend(solids);
                // Pieces of objects are known only from their first edit on.
                pieces.into_iter().for_each(|piece| self.scene.meet(piece));
                // The window's own edits are there already, and newer ones may be; where a time puts what moves by
                // itself, only the session knows.
                let is_own = by.is_some() && by == self.you;
                if !is_own || changes.iter().any(|change| matches!(change, Change::Time(_))) {
                    poses.iter().for_each(|(object, place)| self.scene.put(*object, *place));
                }
                if !is_own {
                    changes.iter().for_each(|change| self.learn(change));
                }
            }
            ServerMessage::Controls { holder, .. } => {
                self.holder = holder;
                self.asked = self.asked.filter(|_| self.has_controls());
                self.tried = None;
            }
            ServerMessage::Asked { by } => self.asked = Some(by),
            ServerMessage::Picked(Picked { spot, found }) => {
                let Some(wanted) = self.wanted.take_if(|wanted| wanted.spot == spot) else { return };
                if wanted.select {
                    self.selection = found.map(|found| self.meant(found, wanted.other));
                } else if let Some(orbit) = &mut self.orbit {
                    orbit.pivot = found.map(|found| found.point);
                }
            }
            ServerMessage::Probed(Probed { found, .. }) => self.meter.found = found,
            // For pages alone.
            ServerMessage::Presets { .. } | ServerMessage::Walked { .. } => {}
            ServerMessage::Status(status) => self.status = *status,
            ServerMessage::Refused { reason } => self.notice = Some((reason, Instant::now())),
            ServerMessage::Trouble { reason } => {
                self.notice = Some((format!("A part of the picture could not be drawn: {reason}"), Instant::now()));
            }
        }
    }

    /// What a click means: a piece of a room, or an object as a whole; or the other of the two.
    fn meant(&mut self, found: Hit, other: bool) -> Selection {
        let (object, material) = (found.object, Some(found.material));
        match found.piece {
            Some(known) if found.is_room != other => {
                let piece = known.piece;
                self.scene.meet(known);
                Selection::Piece { object, piece, material }
            }
            _ => Selection::Object { index: object as usize, material },
        }
    }

    fn handle_frame(&mut self, frame: Arc<EncodedFrame>, ctx: &Context) {
        let size = [frame.image.width as usize, frame.image.height as usize];
        let image = ColorImage::from_rgb(size, frame.image.bytes());
        self.pace.picture(frame.image.bytes().len());
        let is_own = |input: &InputStamp| Some(input.viewer) == self.you && input.at > 0.0;
        if let Some(input) = frame.header.input.filter(is_own)
            && self.shown.as_ref().is_none_or(|shown| shown.frame.header.input != Some(input))
        {
            self.pace.waited(self.now_ms() - input.at);
        }
        // A viewer that is given the controls goes on from what all see.
        let is_mine = self.has_controls();
        if let Some(orbit) = self.orbit.as_mut().filter(|_| !is_mine) {
            orbit.set(frame.header.camera);
        }
        match &mut self.shown {
            Some(shown) => {
                shown.texture.set(image, TextureOptions::LINEAR);
                shown.frame = frame;
            }
            None => {
                let texture = ctx.load_texture("picture", image, TextureOptions::LINEAR);
                self.shown = Some(Shown { texture, frame });
            }
        }
    }

    // ---- what goes

    fn has_controls(&self) -> bool {
        self.you.is_some() && self.holder == self.you
    }

    /// The window's own clock, milliseconds; comes back with the first picture that shows what was sent then.
    fn now_ms(&self) -> f64 {
        self.begun.elapsed().as_secs_f64() * 1e3
    }

    fn edit(&mut self, change: Change) {
        self.learn(&change);
        self.link.send(ClientMessage::Edit { changes: vec![change], gesture: Some(self.gesture), at: self.now_ms() });
    }

    fn learn(&mut self, change: &Change) {
        self.scene.learn(change);
        if let Change::Time(time) = change {
            self.clock = *time;
        }
    }

    /// Sends from where it looks, if that is from elsewhere than before.
    fn look_from(&self, before: Option<Orbit>) {
        let (Some(before), Some(orbit)) = (before, self.orbit) else { return };
        if before.camera() != orbit.camera() && self.has_controls() {
            let viewpoint = Viewpoint::of(&orbit.camera(), self.now_ms());
            self.link.send(ClientMessage::Look(viewpoint));
        }
    }

    /// Something was tried that only the controls' holder may do: the bar says how to get them.
    fn offer_controls(&mut self) {
        self.tried = Some(Instant::now());
    }

    // ---- the picture

    fn view(&mut self, ui: &mut Ui) {
        let space = ui.available_rect_before_wrap();
        self.send_shape(ui.ctx(), space.size());
        let response = ui.allocate_rect(space, Sense::click_and_drag());
        let painter = ui.painter_at(space);
        let before = self.orbit;
        if let Some(stage) = self.draw(&painter, space) {
            self.point(ui.ctx(), &response, stage);
            self.select_and_step(ui.ctx(), stage);
            self.look_from(before);
        } else {
            self.curtain(&painter, space);
        }
        self.bar(ui, space);
    }

    /// Draws the picture and what lies over it.
    fn draw(&mut self, painter: &Painter, space: Rect) -> Option<Stage> {
        let shown = self.shown.as_ref()?;
        let camera = shown.frame.header.camera;
        let shape = vec2(camera.width as f32, camera.height as f32);
        let size = shape * (space.width() / shape.x).min(space.height() / shape.y);
        // Pixel for pixel, if it has as many as the space.
        let rect = Rect::from_center_size(space.center(), size).round_to_pixels(painter.ctx().pixels_per_point());
        painter.image(shown.texture.id(), rect, Rect::from_min_max(pos2(0.0, 0.0), pos2(1.0, 1.0)), Color32::WHITE);
        let stage = Stage { camera, rect };
        gizmo::draw(&painter.with_clip_rect(rect), &stage, &self.scene, self.selection, self.has_controls());
        legend(painter, rect, shown.frame.header.legend.as_ref());
        self.glance(painter, rect);
        Some(stage)
    }

    /// Follows the pointer.
    fn point(&mut self, ctx: &Context, response: &Response, stage: Stage) {
        let (pointer, pressed, modifiers) =
            ctx.input(|input| (input.pointer.latest_pos(), input.pointer.any_pressed(), input.modifiers));
        self.measure(ctx, &stage, pointer.filter(|_| response.hovered()));
        if !self.has_controls() {
            self.grab = None;
            if let Some(at) = pointer.filter(|_| response.clicked()) {
                self.click(&stage, at, modifiers.shift);
            }
            let scrolled = response.hovered() && ctx.input(|input| input.smooth_scroll_delta.y != 0.0);
            if response.dragged() || scrolled {
                self.offer_controls();
            }
            return;
        }
        if let Some(at) = pointer.filter(|_| pressed && response.contains_pointer()) {
            self.press(stage, at);
        }
        if self.grab.is_some() {
            if let Some(change) =
                pointer.and_then(|at| self.grab.as_ref()?.drag_to(&self.scene, at)).filter(|_| response.dragged())
            {
                self.edit(change);
            }
            if ctx.input(|input| input.pointer.any_released()) {
                self.grab = None;
            }
            return;
        }
        if let Some(at) = pointer.filter(|_| response.clicked()) {
            self.click(&stage, at, modifiers.shift);
        }
        let Some(orbit) = &mut self.orbit else { return };
        let by = response.drag_delta();
        if by != Vec2::ZERO {
            let kind = if response.dragged_by(PointerButton::Secondary) || modifiers.shift {
                Drag::Pan
            } else if response.dragged_by(PointerButton::Middle) || modifiers.alt {
                Drag::Look
            } else {
                self.drag
            };
            orbit.drag(kind, glam::Vec2::new(by.x, by.y), stage.rect.height());
        }
        if response.hovered() {
            let (scroll, zoom) = ctx.input(|input| (input.smooth_scroll_delta.y, input.zoom_delta()));
            let amount = -scroll * WHEEL - zoom.max(1e-3).ln();
            if amount != 0.0 {
                orbit.dolly(amount);
            }
        }
    }

    /// A button goes down over the picture.
    fn press(&mut self, stage: Stage, at: Pos2) {
        let grip = gizmo::grip_at(&stage, &self.scene, self.selection, at);
        self.grab =
            self.selection.zip(grip).and_then(|(selection, grip)| gizmo::grab(stage, &self.scene, selection, grip, at));
        if self.grab.is_none() {
            if let Some(orbit) = &mut self.orbit {
                orbit.pivot = None;
            }
            self.pick(&stage, at, false, false);
        }
    }

    /// Selects the lamp whose marker is there, or what lies there.
    fn click(&mut self, stage: &Stage, at: Pos2, other: bool) {
        match gizmo::lamp_at(stage, &self.scene, at) {
            Some(index) => self.selection = Some(Selection::Light { index }),
            None => self.pick(stage, at, true, other),
        }
    }

    /// Asks what lies there: to select it, or to turn around it.
    fn pick(&mut self, stage: &Stage, at: Pos2, select: bool, other: bool) {
        let share = stage.share(at);
        let spot = Spot { x: share.x, y: share.y };
        self.wanted = Some(Wanted { spot, select, other });
        self.link.send(ClientMessage::Pick(spot));
    }

    fn measure(&mut self, ctx: &Context, stage: &Stage, pointer: Option<Pos2>) {
        if !self.meter.on {
            self.meter.spot = None;
            return;
        }
        if let Some(at) = pointer {
            let share = stage.share(at);
            self.meter.spot = Some(Spot { x: share.x, y: share.y });
        }
        let Some(spot) = self.meter.spot else { return };
        let at = stage.rect.min + vec2(spot.x, spot.y) * stage.rect.size();
        if self.meter.asked.elapsed() >= METER {
            self.meter.asked = Instant::now();
            self.link.send(ClientMessage::Probe(spot));
        }
        if let Some(found) = self.meter.found {
            let digits = |value: f32| if value >= 100.0 { format!("{value:.0}") } else { format!("{value:.2}") };
            let text = format!(
                "{} lx\n{} cd/m² · {} away\n{}",
                digits(found.lux),
                digits(found.candela_per_m2),
                digits(found.distance),
                self.scene.info.unit
            );
            let painter = ctx.layer_painter(egui::LayerId::new(egui::Order::Tooltip, egui::Id::unique("meter")));
            plate(&painter, at + vec2(16.0, 16.0), Align2::LEFT_TOP, &text);
        }
    }

    /// Sends how many pixels the view has when it has rested.
    fn send_shape(&mut self, ctx: &Context, size: Vec2) {
        let size = size * ctx.pixels_per_point();
        let [width, height] = [size.x, size.y].map(|side| side.round().max(1.0) as u32);
        let (seen, since, sent) = &mut self.shape;
        if *seen != [width, height] {
            (*seen, *since) = ([width, height], Instant::now());
        }
        if *seen == *sent || self.you.is_none() {
            return;
        }
        if since.elapsed() < SHAPE_RESTS {
            return ctx.request_repaint_after(SHAPE_RESTS);
        }
        *sent = *seen;
        self.link.send(ClientMessage::Shape { width, height });
    }
}

/// Logarithm of the change of distance, for a point of scrolling.
const WHEEL: f32 = 0.0028;
