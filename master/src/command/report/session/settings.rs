//! The command line of `report --session` as it is meant, and all that repeats it.

use std::path::PathBuf;

use frame::Chosen;
use frame::front_end::Effort;
use serde_json::json;

use super::Section;
use crate::cli::{NamedArg, PaceArg, ReportArgs};
use crate::command::options;
use crate::command::report::settings::{machine, quoted};
use runtime::cluster::embedded;
use runtime::console::ConsoleOptions;
use runtime::failure::Failure;
use runtime::methods;

/// What is measured, and where it goes.
pub(super) struct Settings {
    /// Recordings.
    pub sessions: Vec<PathBuf>,
    /// Where their scene is, if it has moved.
    pub scene: Option<PathBuf>,
    /// Each with its name.
    pub methods: Vec<(String, Chosen)>,
    /// How each method is played.
    pub modes: Vec<Mode>,
    /// Pictures of a recording that are compared.
    pub samples: usize,
    /// What draws the truth.
    pub truth: Chosen,
    /// Frames of it.
    pub truth_frames: u32,
    /// Folder of truths that were drawn.
    pub truths: PathBuf,
    /// Folder of the report.
    pub output: PathBuf,
    /// Of all workers.
    pub threads: usize,
    /// How much is said.
    pub console: ConsoleOptions,
    /// The command that repeats the report.
    command: String,
}

/// How a recording is played.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Mode {
    /// Time stands still while a picture is drawn, of so many samples: pixels a sample, or `None` as the recording has it.
    InStep(Option<u32>),
    /// As time goes.
    RealTime,
}

impl Mode {
    /// Samples a pixel of a moving picture, if they are imposed.
    pub fn effort(self) -> Option<Effort> {
        match self {
            Self::InStep(ratio) => ratio.map(|ratio| Effort(1.0 / ratio.max(1) as f32)),
            Self::RealTime => None,
        }
    }
}

impl std::fmt::Display for Mode {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::InStep(None) => f.write_str("in step"),
            Self::InStep(Some(ratio)) => write!(f, "in step, 1/{ratio}"),
            Self::RealTime => f.write_str("real time"),
        }
    }
}

impl Settings {
    /// What these flags mean.
    ///
    /// # Errors
    /// In words: they contradict each other.
    pub fn new(args: &ReportArgs) -> Result<Self, Failure> {
        let session = &args.session;
        if args.scenes.len() > 1 {
            return Err(Failure::Usage("--session: at most one scene, that of the recordings".to_string()));
        }
        let named = args.methods.iter().filter_map(|NamedArg(named)| named.clone());
        let mut methods: Vec<(String, Chosen)> = match args.methods.is_empty() {
            true => methods::all().iter().map(|method| (method.name().to_owned(), Chosen::new(*method))).collect(),
            false => named.collect(),
        };
        methods.extend(args.variants.iter().map(|variant| (variant.name.clone(), variant.method.clone())));
        if let Some((denoised, _)) = methods.iter().find(|(name, _)| name.ends_with("+oidn")) {
            return Err(Failure::Usage(format!("{denoised}: moving pictures are not denoised")));
        }
        if methods.is_empty() {
            return Err(Failure::Usage("nothing to measure: give a method or a --variant".to_string()));
        }
        let mut names: Vec<&str> = methods.iter().map(|(name, _)| name.as_str()).collect();
        names.sort_unstable();
        if let Some(twice) = names.windows(2).find(|pair| pair[0] == pair[1]) {
            return Err(Failure::Usage(format!("two methods are called {}", twice[0])));
        }
        let NamedArg(truth) = &session.truth;
        let truth = truth.clone().map_or_else(|| Chosen::new(methods::all()[0]), |(_, chosen)| chosen);
        let in_step = match session.mismatch.is_empty() {
            true => vec![Mode::InStep(None)],
            false => session.mismatch.iter().map(|ratio| Mode::InStep(Some(*ratio))).collect(),
        };
        let modes = match session.pace {
            PaceArg::Both => in_step.into_iter().chain([Mode::RealTime]).collect(),
            PaceArg::Step => in_step,
            PaceArg::Time => vec![Mode::RealTime],
        };
        let threads = args.measure.threads.map_or_else(embedded::cores, usize::from);
        Ok(Self {
            sessions: session.session.clone(),
            scene: args.scenes.first().cloned(),
            methods,
            modes,
            samples: session.samples as usize,
            truth,
            truth_frames: session.truth_frames,
            truths: session.truths.clone().unwrap_or_else(|| args.output.join("truths")),
            output: args.output.clone(),
            threads,
            console: options::console(args.talk),
            command: command(args, threads),
        })
    }
}

/// The settings block: the command, and what it stood for.
pub(super) fn block(sections: &[Section], settings: &Settings) -> String {
    let sessions: Vec<_> = sections
        .iter()
        .map(|section| {
            json!({
                "name": section.name, "path": section.path.display().to_string(),
                "scene": section.scene.display().to_string(), "width": section.size[0], "height": section.size[1],
                "pictures": section.pictures, "noise_of_truths": section.floor,
            })
        })
        .collect();
    let flags = |chosen: &Chosen| chosen.flags().join(" ");
    let methods: std::collections::BTreeMap<_, _> =
        settings.methods.iter().map(|(name, chosen)| (name, flags(chosen))).collect();
    let block = json!({
        "program": concat!("igi-master ", env!("CARGO_PKG_VERSION")),
        "command": settings.command,
        "machine": machine(),
        "threads": settings.threads,
        "methods": methods,
        "truth": flags(&settings.truth),
        "truth_frames": settings.truth_frames,
        "sessions": sessions,
    });
    serde_json::to_string_pretty(&block).unwrap_or_default()
}

/// The command that repeats the report.
fn command(args: &ReportArgs, threads: usize) -> String {
    let session = &args.session;
    let mut words = vec!["igi-master".to_string(), "report".to_string()];
    let path = |path: &PathBuf| quoted(&path.display().to_string());
    words.extend(args.scenes.iter().map(path));
    for recording in &session.session {
        words.extend(["--session".into(), path(recording)]);
    }
    let name = |NamedArg(named): &NamedArg| named.as_ref().map_or("none".to_owned(), |(name, _)| name.clone());
    if !args.methods.is_empty() {
        words.extend(["--methods".into(), args.methods.iter().map(name).collect::<Vec<_>>().join(",")]);
    }
    for variant in &args.variants {
        words.extend(["--variant".into(), quoted(&format!("{}={}", variant.name, variant.flags))]);
    }
    if !session.mismatch.is_empty() {
        let ratios: Vec<String> = session.mismatch.iter().map(u32::to_string).collect();
        words.extend(["--mismatch".into(), ratios.join(",")]);
    }
    let pace = match session.pace {
        PaceArg::Both => "both",
        PaceArg::Step => "step",
        PaceArg::Time => "time",
    };
    words.push(format!("--pace {pace} --samples {} --threads {threads}", session.samples));
    words.push(format!("--truth {} --truth-frames {}", name(&session.truth), session.truth_frames));
    words.extend(session.truths.iter().map(|folder| format!("--truths {}", path(folder))));
    words.extend(["-o".into(), path(&args.output)]);
    words.join(" ")
}
