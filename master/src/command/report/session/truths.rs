//! What the states of a recording should look like: drawn for long, each once, and kept in files whose names are all that the
//! picture depends on.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;

use anyhow::{Context, anyhow};
use frame::{Picture, Plane, View};
use serde_json::json;

use super::settings::Settings;
use crate::command::script::Script;
use runtime::cluster::{Cluster, ClusterOptions};
use runtime::console::Console;
use runtime::failure::Failure;
use runtime::files::{encode_exr, read_metadata, read_picture, write_whole};
use runtime::interrupt::Interrupt;
use runtime::live::record::{Line, What};
use runtime::render_loop::{Watched, run_watched};
use runtime::spoken::hex;
use runtime::stats::{Ending, Stop};

/// The truths of one recording.
pub(super) struct Truths<'a> {
    script: &'a Script,
    settings: &'a Settings,
    cluster: Cluster,
    /// Digits of the scene as it began.
    world: String,
    /// Lines before this one are in the cluster's scene.
    edited: usize,
    /// By the line whose state they show.
    drawn: BTreeMap<usize, Picture>,
    /// Expected relMSE of those that state it.
    noise: Vec<f64>,
    doubt: Option<&'static str>,
}

/// What the metadata of a picture calls its noise.
const NOISE: &str = "noise_rel_mse";

impl<'a> Truths<'a> {
    /// None drawn yet.
    ///
    /// # Errors
    /// There can be no workers.
    pub fn new(script: &'a Script, settings: &'a Settings) -> Result<Self, Failure> {
        let options = ClusterOptions { embedded: Some(settings.threads), ..ClusterOptions::default() };
        let mut cluster = Cluster::start(options).context("workers cannot be started")?;
        let world = cluster.publish(Arc::new(script.scene.clone())).context("the scene cannot be sent to workers")?;
        let (world, doubt) = (hex(&world.world), script.doubt(Some(world)));
        let (drawn, noise) = (BTreeMap::new(), Vec::new());
        Ok(Self { script, settings, cluster, world, edited: 0, drawn, noise, doubt })
    }

    /// Why the scene may not be the recorded one.
    pub fn doubt(&self) -> Option<&'static str> {
        self.doubt
    }

    /// The truth of the state after this line, if it was drawn.
    pub fn of(&self, line: usize) -> Option<&Picture> {
        self.drawn.get(&line)
    }

    /// Mean relMSE that is expected of the truths themselves.
    pub fn floor(&self) -> Option<f64> {
        let count = self.noise.len();
        (count > 0).then(|| self.noise.iter().sum::<f64>() / count as f64)
    }

    /// Reads the truth of a state, or draws it; states come in order. `running` hears how much of it there is, 0..=1. An
    /// interrupted one is not kept.
    ///
    /// # Errors
    /// [`Failure`] if it cannot be drawn or kept.
    pub fn draw(&mut self, line: usize, interrupt: &Interrupt, running: &mut dyn FnMut(f32)) -> Result<(), Failure> {
        let state = self.script.state(line);
        let frames = self.settings.truth_frames;
        let path = self.path(line)?;
        if let (Ok(picture), Ok((_, words))) = (read_picture(&path), read_metadata(&path))
            && [picture.width, picture.height] == [state.camera.width, state.camera.height]
        {
            self.noise.extend(words.get(NOISE).and_then(|noise| noise.parse::<f64>().ok()));
            self.drawn.insert(line, picture);
            return Ok(());
        }
        for Line { what, .. } in &self.script.lines[self.edited.min(line + 1)..=line] {
            if let What::Edit(changes) = what {
                let refused = |refused| Failure::Scene(format!("{}: {refused}", self.script.path.display()));
                self.cluster.change(changes.clone()).map_err(refused)?;
            }
        }
        self.edited = self.edited.max(line + 1);
        let none = || anyhow!("the scene was not published");
        let world = self.cluster.state().ok_or_else(none)?;
        let scene = self.cluster.shared_scene().ok_or_else(none)?;
        let fields = self.cluster.fields().ok_or_else(none)?;
        let view = View { world, scene, fields, camera: state.camera, seed: SEED };
        let mut front = self.settings.truth.begin(&view);
        let stop = Stop { frames: Some(frames), ..Stop::default() };
        let mut quiet = Console::silent();
        let stats = run_watched(front.as_mut(), &mut self.cluster, &stop, interrupt, &mut quiet, &mut |_, stats| {
            running(stats.frames as f32 / frames as f32);
            Watched::GoOn
        });
        if let Some(gap) = stats.gaps.first() {
            return Err(Failure::Failed(anyhow!("no truth without {}: {}", gap.what, gap.reason)));
        }
        if stats.ending == Ending::Interrupted {
            return Ok(());
        }
        let picture = front.show(Plane::Raw);
        let noise = front.error().map(|error| error.rel_mse);
        let mut words = vec![("session", self.script.path.display().to_string()), ("line", line.to_string())];
        words.extend(noise.map(|noise| (NOISE, noise.to_string())));
        write_whole(&path, &encode_exr(&picture, &[], &words)?)?;
        self.noise.extend(noise);
        self.drawn.insert(line, picture);
        Ok(())
    }

    /// The file of a state: any two states that are drawn alike have one.
    fn path(&self, line: usize) -> anyhow::Result<PathBuf> {
        let state = self.script.state(line);
        let of = json!({
            "program": env!("CARGO_PKG_VERSION"), "protocol": protocol::message::VERSION, "world": self.world,
            "time": self.script.begun.time, "changes": state.changes, "camera": state.camera,
            "method": self.settings.truth.flags(), "frames": self.settings.truth_frames, "seed": SEED,
        });
        let digest = protocol::parts::hash(&serde_json::to_vec(&of)?);
        Ok(self.settings.truths.join(format!("{}.exr", &hex(&digest)[..32])))
    }
}

/// Other random numbers than those of any recording: else a truth would be closer to what began alike.
const SEED: u64 = 0x7275_7468;
