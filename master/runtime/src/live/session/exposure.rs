//! The exposure that the first whole picture decides, where none is chosen.

use frame::Picture;
use frame::live::{Event, Knobs};
use frame::tone::Exposure;
use scenes::Camera;
use serde_json::json;

use super::{Session, screen};
use crate::console::Console;

/// No exposure is chosen: the first whole picture decides. It is the scene's own view, small and of one frame, so that it is
/// there at once, and its exposure is the same on any screen.
pub(super) struct Exposing {
    /// In radiance, once it is there.
    pub first: Option<Picture>,
    /// Of the pictures after it.
    size: [u32; 2],
    rest_after: u32,
}

/// Pixels of the picture that the exposure is chosen by.
const EXPOSED_PIXELS: u64 = 30_000;

impl Exposing {
    /// Has the first picture made small and of one frame.
    pub fn begin(camera: &mut Camera, knobs: &mut Knobs) -> Self {
        let size = [camera.width, camera.height];
        [camera.width, camera.height] = screen::within(EXPOSED_PIXELS, size);
        Self { first: None, size, rest_after: std::mem::replace(&mut knobs.rest_after, 1) }
    }
}

impl Session {
    /// Chooses the exposure by the first whole picture, unless a viewer has chosen one, and goes on at full size.
    pub(super) fn expose(&mut self, console: &Console) {
        let Some(Exposing { first: Some(first), size, rest_after }) =
            self.exposing.take_if(|exposing| exposing.first.is_some())
        else {
            return;
        };
        if self.settings.tone.exposure == Exposure::Auto {
            // As it is written beside the slider.
            let stops = (100.0 * Exposure::Auto.stops(&first)).round() / 100.0;
            let why = "lights are in candela or lux; --exposure EV overrides it";
            console.line(&format!("exposure {stops:.2} EV, as the first picture needs ({why})"));
            console.emit("exposure", json!({ "stops": stops }));
            self.settings.tone.exposure = Exposure::Fixed(stops);
            self.display.set(self.settings.clone());
            self.send_knobs();
        }
        let knobs = Knobs { rest_after, ..self.driver.live.knobs().clone() };
        self.handle_event(Event::Turn(knobs));
        let [width, height] = self.fitting().unwrap_or(size);
        self.handle_event(Event::Look(Camera { width, height, ..self.camera() }));
    }
}
