//! A picture that is done goes to every file that was asked for; what is in the way of one is no loss for the others.

use std::cell::RefCell;
use std::path::PathBuf;

use frame::parts::Undenoised;
use frame::tone::{Exposure, Operator, Tone};
use frame::{Chosen, FrontEnd, Picture, Plane, View};
use serde_json::json;

use super::settings::Settings;
use crate::command::options;
use runtime::console::Console;
use runtime::denoise::{Denoiser, Trouble};
use runtime::files::{MISSES, Metadata, Output, OutputKind, Unsaved, encode_exr, encode_png_saying};
use runtime::spoken::hex;
use runtime::stats::RenderStats;

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
pub(crate) struct Saver {
    scene: PathBuf,
    tone: Tone,
    aov: bool,
    method: Chosen,
    view: View,
    /// What pictures go through before they are written.
    denoiser: Option<RefCell<Denoiser>>,
}

/// A picture as files have it.
pub(super) struct Finished {
    picture: Picture,
    /// What it went through.
    denoiser: Option<String>,
    /// Why it did not.
    pub(super) flaw: Option<String>,
}

impl Saver {
    /// As the command line says; all pictures are of this view, at any moment.
    pub(crate) fn new(settings: &Settings, view: &View, denoiser: Option<Denoiser>) -> Self {
        let Style { exposure, operator, aov } = settings.style;
        let tone = Tone { exposure: options::exposure(exposure, &view.scene), operator };
        let (scene, method, view) = (settings.scene.clone(), settings.method.clone(), view.clone());
        Self { scene, tone, aov, method, view, denoiser: denoiser.map(RefCell::new) }
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
        let finished = self.finished(front);
        if outputs.iter().any(|output| output.kind == OutputKind::Png) {
            advise(self.tone.exposure, &finished.picture, console);
        }
        if let Some(flaw) = &finished.flaw {
            unsaved.regret(flaw);
        }
        let before = unsaved.count();
        for output in outputs {
            match unsaved.write(&output.path, self.encode(output, &finished, time, front, stats)) {
                Ok(()) => console.saved(&output.path),
                Err(reason) => console.unsaved(&output.path, &reason),
            }
        }
        unsaved.count() - before
    }

    /// The picture, denoised if that was asked for: what is in the way of that is no loss of the picture.
    pub(super) fn finished(&self, front: &mut dyn FrontEnd) -> Finished {
        let plain =
            |front: &mut dyn FrontEnd, flaw| Finished { picture: front.show(Plane::Final), denoiser: None, flaw };
        let Some(denoiser) = &self.denoiser else { return plain(front, None) };
        let mut denoiser = denoiser.borrow_mut();
        match denoiser.denoise(&Undenoised::of(front)) {
            Ok(picture) => Finished { picture, denoiser: Some(denoiser.name()), flaw: None },
            Err(Trouble::Stopped) => plain(front, Some("not denoised".to_string())),
            Err(Trouble::Failed(reason)) => plain(front, Some(format!("not denoised: {reason}"))),
        }
    }

    /// The bytes of a file.
    pub(super) fn encode(
        &self,
        output: &Output,
        finished: &Finished,
        time: f64,
        front: &mut dyn FrontEnd,
        stats: &RenderStats,
    ) -> anyhow::Result<Vec<u8>> {
        let Finished { picture, denoiser, .. } = finished;
        match output.kind {
            OutputKind::Png => {
                let comment = denoiser.as_ref().map(|denoiser| format!("denoised by {denoiser}"));
                encode_png_saying(&self.tone.develop(picture), comment.as_deref())
            }
            OutputKind::Exr => {
                let layers = if self.aov { self.layers(front) } else { Vec::new() };
                let mut metadata = self.metadata(time, front, stats);
                metadata.extend(denoiser.clone().map(|denoiser| ("denoiser", denoiser)));
                encode_exr(picture, &layers, &metadata)
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
        let denoise = if self.denoiser.is_some() { " --denoise" } else { "" };
        format!(
            "igi-master render {scene} --size {}x{} --time {time} --seed {seed} --frames {frames} \
             --exposure {exposure} --tone {tone}{denoise} {}",
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
