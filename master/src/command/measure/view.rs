//! The luminance of a view: a picture in cd/m², in false colours.

use std::sync::Arc;
use std::time::Duration;

use frame::measure::around;
use frame::tone::Image8;
use frame::{Picture, Plane};
use glam::Vec3;
use protocol::answer::Fields;
use protocol::question::WorldState;
use scenes::photometry::photometric;
use scenes::{Needs, Scene};
use serde_json::{Value, json};

use super::drawing::colour;
use crate::cli::MeasureArgs;
use crate::command::outcome::finish;
use runtime::cluster::Cluster;
use runtime::console::Console;
use runtime::display::paint::{Legend, Ramp, Scale};
use runtime::display::saved::with_caption;
use runtime::failure::Failure;
use runtime::files::{encode_exr, encode_png};
use runtime::interrupt::Interrupt;
use runtime::render_loop::run;
use runtime::stats::Stop;

/// Luminances, pixel by pixel.
pub(crate) struct View {
    /// cd/m², the same in all channels.
    luminance: Picture,
    /// What the first colour and the last stand for, cd/m².
    scale: [f64; 2],
    /// In words.
    pub(crate) method: String,
}

impl View {
    /// Draws it as `render` would.
    pub(super) fn draw(
        args: &MeasureArgs,
        scene: &Arc<Scene>,
        world: WorldState,
        (cluster, interrupt, console): (&mut Cluster, &Interrupt, &mut Console),
    ) -> Result<Self, Failure> {
        let camera = scene.camera;
        let fields = Fields::of(&Needs::of(scene));
        let method = &args.method.0;
        runtime::memory::demand(method.memory_bytes(&camera, fields), &camera)?;
        let view = frame::View { world, scene: Arc::clone(scene), fields, camera, seed: args.seed };
        let mut front = method.begin(&view);
        let after = Duration::try_from_secs_f64(args.seconds).unwrap_or(Duration::MAX);
        let stop = Stop { after: Some(after), ..Stop::default() };
        let stats = run(front.as_mut(), cluster, &stop, interrupt, console);
        finish(&stats, front.frames() > 0)?;
        let shown = front.show(Plane::Final);
        let pixels = shown.pixels.iter().map(|radiance| Vec3::splat(photometric(*radiance))).collect();
        let luminance = Picture { pixels, ..shown };
        let error = stats.error.map_or("not known".into(), |error| format!("{:.1e}", error.high));
        let method = format!(
            "method {}, {} frames of {}x{} pixels; relative squared error of the unfiltered picture at most {error} (95 % \
             confidence)",
            method.method.name(),
            stats.frames,
            camera.width,
            camera.height
        );
        let scale = args.view_scale.unwrap_or_else(|| usual(&luminance));
        Ok(Self { luminance, scale, method })
    }

    /// Least, mean and greatest, cd/m².
    pub(super) fn figures(&self) -> [f64; 3] {
        let values = || self.luminance.pixels.iter().map(|pixel| f64::from(pixel.x));
        let mean = values().sum::<f64>() / self.luminance.pixels.len() as f64;
        [values().fold(f64::INFINITY, f64::min), mean, values().fold(0.0, f64::max)]
    }

    /// In false colours, with their legend below.
    pub(super) fn image(&self) -> Image8 {
        let pixels = self.luminance.pixels.iter().map(|pixel| colour(self.scale, f64::from(pixel.x))).collect();
        let image = Image8 { width: self.luminance.width, height: self.luminance.height, pixels };
        let [from, to] = self.scale.map(|value| value as f32);
        let scale = Scale { unit: "cd/m²", from, to, logarithmic: true, ramp: Ramp::Turbo };
        with_caption(image, Some(&Legend { title: "luminance".into(), scale: Some(scale) }), None)
    }

    pub(super) fn png(&self) -> anyhow::Result<Vec<u8>> {
        encode_png(&self.image())
    }

    /// The values themselves.
    pub(super) fn exr(&self) -> anyhow::Result<Vec<u8>> {
        encode_exr(&self.luminance, &[], &[("values", "luminance, cd/m²".into()), ("method", self.method.clone())])
    }

    /// For programs.
    pub(super) fn json(&self) -> Value {
        let [min, average, max] = self.figures();
        json!({ "min": min, "average": average, "max": max })
    }
}

/// Round numbers about all but the darkest and the brightest hundredth.
fn usual(luminance: &Picture) -> [f64; 2] {
    let mut values: Vec<f32> = luminance.pixels.iter().map(|pixel| pixel.x).filter(|value| *value > 0.0).collect();
    values.sort_unstable_by(f32::total_cmp);
    let at = |share: f64| values.get((share * values.len() as f64) as usize).copied().unwrap_or_default();
    around([at(0.01), at(0.99)].map(f64::from))
}
