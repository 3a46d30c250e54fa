//! A recording that is to be played: read, its scene loaded, and all that happens in it checked before anything is drawn.

use std::fmt::Display;
use std::path::{Path, PathBuf};

use frame::live::{Knobs, Making};
use frame::{Chosen, Layer};
use protocol::answer::Fields;
use protocol::question::WorldState;
use scenes::{Camera, Change, Needs, Scene};

use crate::command::load::load;
use runtime::console::Console;
use runtime::failure::Failure;
use runtime::live::record::{self, Begun, Line, What};
use runtime::memory;
use runtime::spoken::hex;

/// See the module's documentation.
pub(crate) struct Script {
    /// The file.
    pub(crate) path: PathBuf,
    /// What it began with.
    pub(crate) begun: Begun,
    /// Where the scene is now.
    pub(crate) scene_path: PathBuf,
    /// As it was begun with.
    pub(crate) scene: Scene,
    /// What happened, in order.
    pub(crate) lines: Vec<Line>,
}

impl Script {
    /// Reads recording and scene; `scene` is where that is now, if it has moved.
    ///
    /// # Errors
    /// [`Failure`] if either cannot be read, or the scene cannot take an edit; names file and moment.
    pub(crate) fn read(session: &Path, scene: Option<&Path>, console: &Console) -> Result<Self, Failure> {
        let recording = record::read(session)?;
        let begun = recording.begun.clone();
        let scene_path = scene.unwrap_or(&begun.scene).to_path_buf();
        let mut scene = load(&scene_path, Some(begun.time), None, console)?.scene;
        let lines = recording.into_lines(&scene);
        scene.camera = begun.camera;
        let script = Self { path: session.to_path_buf(), begun, scene_path, scene, lines };
        // With the photometric solids that were brought along until then.
        let mut scene = script.scene.clone();
        for line in &script.lines {
            if let What::Edit(changes) = &line.what {
                let checked = changes.iter().try_for_each(|change| match change {
                    Change::Solid { .. } => change.apply(&mut scene),
                    change => change.check(&scene),
                });
                checked.map_err(|refused| script.wrong(line, &refused))?;
            }
        }
        Ok(script)
    }

    /// What is wrong with a line.
    pub(crate) fn wrong(&self, line: &Line, what: &dyn Display) -> Failure {
        Failure::Scene(format!("{}: at {} s: {what}", self.path.display(), line.t))
    }

    /// The method that it begins with and those that are turned to, each with its settings; `other` plays the same inputs
    /// through another, to which what was turned of the recorded one means nothing.
    ///
    /// # Errors
    /// There is no such method, or it has no such knob.
    pub(crate) fn methods(&self, other: Option<&Chosen>) -> Result<Vec<Chosen>, Failure> {
        let mut methods = vec![match other {
            Some(chosen) => chosen.clone(),
            None => self.begun.method.after(None).map_err(Failure::Scene)?,
        }];
        for line in &self.lines {
            if let (What::Turn(named), None) = (&line.what, other) {
                methods.push(named.after(methods.last()).map_err(|wrong| self.wrong(line, &wrong))?);
            }
        }
        Ok(methods)
    }

    /// That there is memory for the largest picture by any of these methods.
    ///
    /// # Errors
    /// There is not.
    pub(crate) fn demand_memory(&self, methods: &[Chosen]) -> Result<(), Failure> {
        let looks =
            self.lines.iter().filter_map(|line| if let What::Look(camera) = &line.what { Some(camera) } else { None });
        let pixels = |camera: &&Camera| u64::from(camera.width) * u64::from(camera.height);
        let largest = looks.chain([&self.begun.camera]).max_by_key(pixels).unwrap_or(&self.begun.camera);
        let fields = Fields::of(&Needs::of(&self.scene));
        let bytes = methods.iter().map(|method| method.memory_bytes(largest, fields));
        memory::demand(bytes.max().unwrap_or(0), largest)
    }

    /// How a method is set up that plays it.
    pub(crate) fn knobs(&self, method: Chosen, rest_after: u32) -> Knobs {
        let (seed, layer) = (self.begun.seed, Layer::FINAL);
        Knobs { method, seed, rate: RATE, effort: None, rest_after, layer, making: Making::InTime }
    }

    /// Why pictures of this world may not be those of the recording.
    pub(crate) fn doubt(&self, world: Option<WorldState>) -> Option<&'static str> {
        match &self.begun.world {
            None => Some("the recording is of an older format: whether its scene is this one cannot be told"),
            was if *was != world.map(|state| hex(&state.world)) => {
                Some("the scene is not the one that was recorded: pictures will differ")
            }
            _ => None,
        }
    }

    /// What was looked at after each input: by the number of the line.
    pub(crate) fn state(&self, line: usize) -> State {
        let mut state = State { camera: self.begun.camera, changes: Vec::new() };
        for Line { what, .. } in self.lines.iter().take(line + 1) {
            match what {
                What::Look(camera) => state.camera = *camera,
                What::Edit(changes) => {
                    for change in changes {
                        state.changes.retain(|earlier| !change.supersedes(earlier));
                        state.changes.push(change.clone());
                    }
                }
                What::Turn(_) | What::Began {} | What::Overtaken {} | What::Shown { .. } => {}
            }
        }
        state
    }
}

/// What somebody looks at.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct State {
    /// From where.
    pub(crate) camera: Camera,
    /// How the scene differs from that of the beginning.
    pub(crate) changes: Vec<Change>,
}

/// Pictures a second that are aimed at, as people have it who say nothing.
const RATE: f32 = 10.0;
