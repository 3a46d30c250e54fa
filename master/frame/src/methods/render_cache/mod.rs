//! The Render Cache of Walter, Drettakis and Parker (*Interactive Rendering using the Render Cache*, 1999), with what its
//! sequel adds (Walter, Drettakis, Greenberg: *Enhancing and Optimizing the Render Cache*, 2002).
//!
//! **Idea.** Shaded points of the scene are kept. Each picture projects them to wherever the camera is now, hides what
//! should be hidden, fills the gaps, and so is there at once, however slow the renderer. From how old points are, and where
//! they lack, follows where the few samples of the next moment are worth most.
//!
//! ```text
//! answers ─► points ─► project ─► depth cull ─► reconstruct ─► picture
//!              ▲          │
//!              │          └─► priorities ─► error diffusion ─► rays ─► workers
//!              └── overwrite · age · evict          prediction ─┘
//! ```
//!
//! **Renderer.** Rays are lit by the estimator of another method, and that method draws whatever does not move: at rest the
//! picture is that method's to the bit, and files are drawn by it alone. A cache at rest would be biased by its choice of
//! samples.
//!
//! **Beyond the papers** (`--preset paper` switches it off): points keep the mean of their samples; irradiance alone is
//! smoothed, within a surface; what pixels see is found exactly where it is matt (`guide`); after an edit, points are asked again by the same random numbers, so that what differs has
//! changed and is not noise; after an edit of lamps, light is foretold for all points and brought in line with the samples that
//! come (`relight`).
//!
//! **Promise.** A picture is a function of inputs and of how many batches went into each picture, whoever answered.
//!
//! **Knobs** (`settings`). `--points` imposes a number of samples a picture, as slow renderers do. `--history` trades noise
//! for delay. `--predict` should cover the way to the workers.
//!
//! **When it is bad.** Where little of what is seen was seen before: after a jump, and for mirrors and glass, whose images
//! are kept as if they were painted on them. Where more than about a pixel in 64 cannot be renewed between pictures. Where
//! surfaces lie closer behind each other than a tenth of their distance, which the depth cull cannot part. Light that
//! comes by way of what has changed is known by samples alone.

mod asking;
mod cache;
mod guide;
mod lamps;
mod memory;
mod naming;
mod places;
mod point;
mod points;
mod project;
mod reconstruct;
mod relight;
mod remembered;
mod sampling;
mod settings;
mod shadows;
mod surfaces;
mod taking;
mod weights;

use protocol::answer::Fields;
use protocol::question::Quality;
use scenes::{Camera, Scene};

use super::at_once::{AtOnce, Tables};
use crate::front_end::{FrontEnd, Interactive, Knob, Layer, Method, NoCheckpoint, Preset, Settings, View};
use remembered::Remembered;
use settings::Options;

/// The method, over a renderer: see the module's documentation.
#[derive(Clone, Copy)]
pub struct RenderCache {
    /// Draws whatever does not move.
    pub renderer: &'static dyn Method,
    /// The renderer's estimator, as its knobs say.
    pub quality: fn(&Settings) -> Quality,
    /// [`tables`] of the renderer, made once.
    pub tables: fn() -> &'static Tables,
}

/// What can be set and looked at with this cache over a renderer.
pub fn tables(renderer: &dyn Method) -> Tables {
    Tables::over(renderer, &settings::KNOBS, &settings::LAYERS)
}

impl Method for RenderCache {
    fn name(&self) -> &'static str {
        "render-cache"
    }

    fn about(&self) -> &'static str {
        "shaded points, projected to every picture and renewed where it is worth most (Walter et al. 1999, 2002)"
    }

    fn knobs(&self) -> &'static [Knob] {
        &(self.tables)().knobs
    }

    fn presets(&self) -> &'static [Preset] {
        settings::PRESETS
    }

    fn layers(&self) -> &'static [Layer] {
        &(self.tables)().layers
    }

    fn check(&self, settings: &Settings) -> Result<(), String> {
        self.renderer.check(settings)
    }

    fn memory_bytes(&self, settings: &Settings, camera: &Camera, fields: Fields) -> u64 {
        let slots = cache::capacity(&Options::of(settings), camera) as u64;
        let pixels = u64::from(camera.width) * u64::from(camera.height);
        let own = slots * points::Points::BYTES as u64 + pixels * BYTES_PER_PIXEL;
        self.renderer.memory_bytes(settings, camera, fields) + own
    }

    fn begin(&self, settings: &Settings, view: &View) -> Box<dyn FrontEnd> {
        self.renderer.begin(settings, view)
    }

    fn resume(&self, settings: &Settings, view: &View, kept: &[u8]) -> Result<Box<dyn FrontEnd>, NoCheckpoint> {
        self.renderer.resume(settings, view, kept)
    }

    fn interactive(&self, settings: &Settings, first_ticket: u32) -> Box<dyn Interactive> {
        Box::new(AtOnce::new(Remembered::new(self.quality, settings), self.renderer, settings, first_ticket))
    }

    fn samples_per_frame(&self) -> u32 {
        self.renderer.samples_per_frame()
    }

    fn is_filtered(&self, settings: &Settings) -> bool {
        self.renderer.is_filtered(settings)
    }

    fn expected_slope(&self, settings: &Settings) -> f64 {
        self.renderer.expected_slope(settings)
    }

    fn misses(&self, scene: &Scene) -> Option<String> {
        self.renderer.misses(scene)
    }
}

/// What each pixel shows, is worth and was, while a picture is made.
const BYTES_PER_PIXEL: u64 = 230;

#[cfg(test)]
mod tests;
