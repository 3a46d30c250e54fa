//! A picture that is done goes to every file that was asked for; what is in the way of one is no loss for the others.

use std::path::PathBuf;

use frame::tone::{Exposure, Operator, Tone};
use frame::{Chosen, FrontEnd, Picture, Plane, View};
use serde_json::json;

use super::settings::Settings;
use crate::command::options;
use crate::console::Console;
use crate::files::{MISSES, Metadata, Output, OutputKind, Unsaved, encode_exr, encode_png};
use crate::spoken::hex;
use crate::stats::RenderStats;

/// How pictures are written.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Style {
    /// Of PNG; `None`: as the scene's units need.
    pub(crate) exposure: Option<Exposure>,
    /// Of PNG.
    pub(crate) operator: Operator,
    /// EXR has every layer that there is.
    pub(crate) aov: bool,
}

/// Writes pictures of a scene.
#[derive(Clone, Debug)]
pub(crate) struct Saver {
    scene: PathBuf,
    tone: Tone,
    aov: bool,
    method: Chosen,
    view: View,
}

impl Saver {
    /// As the command line says; all pictures are of this view, at any moment.
    pub(crate) fn new(settings: &Settings, view: &View) -> Self {
        let Style { exposure, operator, aov } = settings.style;
        let tone = Tone { exposure: options::exposure(exposure, &view.scene), operator };
        Self { scene: settings.scene.clone(), tone, aov, method: settings.method.clone(), view: view.clone() }
    }

    /// Saves a picture of a moment wherever it can be saved, and says so. Returns the number of places at which it could
    /// not be saved.
    pub(crate) fn save(
        &self,
        outputs: &[Output],
        time: f64,
        front: &mut dyn FrontEnd,
        stats: &RenderStats,
        unsaved: &mut Unsaved,
        console: &Console,
    ) -> usize {
        if outputs.iter().any(|output| output.kind == OutputKind::Png) {
            advise(self.tone.exposure, &front.show(Plane::Final), console);
        }
        let before = unsaved.count();
        for output in outputs {
            match unsaved.write(&output.path, self.encode(output, time, front, stats)) {
                Ok(()) => console.saved(&output.path),
                Err(reason) => console.unsaved(&output.path, &reason),
            }
        }
        unsaved.count() - before
    }

    /// The bytes of a file.
    pub(super) fn encode(
        &self,
        output: &Output,
        time: f64,
        front: &mut dyn FrontEnd,
        stats: &RenderStats,
    ) -> anyhow::Result<Vec<u8>> {
        let picture = front.show(Plane::Final);
        match output.kind {
            OutputKind::Png => encode_png(&self.tone.develop(&picture)),
            OutputKind::Exr => {
                let layers = if self.aov { self.layers(front) } else { Vec::new() };
                encode_exr(&picture, &layers, &self.metadata(time, front, stats))
            }
        }
    }

    /// All that is needed to draw the same picture again, and what came of it.
    fn metadata(&self, time: f64, front: &mut dyn FrontEnd, stats: &RenderStats) -> Metadata {
        let raw = front.show(Plane::Raw).sha256();
        let View { world, seed, .. } = &self.view;
        let mut metadata = vec![
            ("version", env!("CARGO_PKG_VERSION").to_string()),
            ("scene", self.scene.display().to_string()),
            ("world", hex(&world.world)),
            ("revision", world.revision.to_string()),
            ("method", self.method.method.name().to_string()),
            ("settings", described(&self.method)),
            ("seed", seed.to_string()),
            ("time", time.to_string()),
            ("frames", stats.frames.to_string()),
            ("seconds", format!("{:.3}", (stats.spent + stats.elapsed).as_secs_f64())),
            ("raw_sha256", hex(&raw)),
            ("command", self.command(time, stats.frames)),
        ];
        metadata.extend(self.method.method.misses(&self.view.scene).map(|missing| (MISSES, missing)));
        if let Some(estimate) = stats.error {
            metadata.push(("rel_mse", format!("{:e}", estimate.rel_mse)));
            metadata.push(("rel_mse_95_percent", format!("{:e} to {:e}", estimate.low, estimate.high)));
        }
        metadata
    }

    /// Name, coloured or not, and picture of every layer that `--aov` adds.
    fn layers(&self, front: &mut dyn FrontEnd) -> Vec<(&'static str, bool, Picture)> {
        let layers = self.method.method.layers().iter();
        let shown = layers.filter_map(|layer| Some((layer.exr?, layer.plane)));
        shown.map(|(channels, plane)| (channels.name, channels.coloured, front.show(plane))).collect()
    }

    /// The command that draws the same picture, bit for bit.
    fn command(&self, time: f64, frames: u32) -> String {
        let View { camera, seed, .. } = &self.view;
        let scene = self.scene.display();
        let exposure = match self.tone.exposure {
            Exposure::Auto => "auto".to_string(),
            Exposure::Fixed(stops) => stops.to_string(),
        };
        let tone = format!("{:?}", self.tone.operator).to_lowercase();
        format!(
            "igi-master render {scene} --size {}x{} --time {time} --seed {seed} --frames {frames} \
             --exposure {exposure} --tone {tone} {}",
            camera.width,
            camera.height,
            self.method.flags().join(" ")
        )
    }
}

/// A method's settings in words by which they are known again.
pub(crate) fn described(method: &Chosen) -> String {
    serde_json::to_string(&method.settings).unwrap_or_default()
}

/// Nobody should wonder about a white or black picture.
fn advise(exposure: Exposure, picture: &Picture, console: &Console) {
    let (chosen, auto) = (exposure.stops(picture), Exposure::Auto.stops(picture));
    if exposure == Exposure::Auto {
        let why = "auto is the default where lights are in candela or lux; --exposure EV overrides it";
        console.line(&format!("exposure {chosen:.2} EV, as the picture needs ({why})"));
        console.emit("exposure", json!({ "stops": chosen }));
    }
    let word = if auto < chosen { "bright" } else { "dark" };
    if (auto - chosen).abs() > STOPS_AMISS {
        console.line(&format!(
            "the picture is very {word}: --exposure auto would choose {auto:.1} instead of {chosen:.1}"
        ));
    }
}

/// An exposure this far from the automatic one is probably not what was meant.
const STOPS_AMISS: f32 = 4.0;
