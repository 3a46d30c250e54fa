//! The command line of `report` as it is meant, and all that repeats a report.

use std::path::PathBuf;

use serde_json::json;

use super::Section;
use super::finish::{DENOISED, Finish};
use super::peer::{Peer, peers};
use super::race::{Method, methods};
use crate::cli::{ClockArg, NamedArg, PeerArg, ReportArgs, Size};
use crate::command::options;
use runtime::cluster::embedded;
use runtime::console::ConsoleOptions;
use runtime::stopwatch::Elapsed;

/// What is measured, and where it goes.
pub struct Settings {
    /// Folders or files.
    pub scenes: Vec<PathBuf>,
    /// Folder of the report.
    pub output: PathBuf,
    /// Ours.
    pub methods: Vec<Method>,
    /// Other renderers.
    pub peers: Vec<Peer>,
    /// How each of them is measured.
    pub measurement: Measurement,
    /// What it is compared with.
    pub target: Target,
    /// Whether it is measured what leaving out saves.
    pub with_pruning: bool,
    /// How much is said.
    pub console: ConsoleOptions,
    /// Where the denoiser is.
    oidn: Option<PathBuf>,
    /// The command that repeats the report.
    command: String,
}

/// How a method is measured.
pub struct Measurement {
    /// Independent runs, each with a seed of its own.
    pub runs: u32,
    /// Length of a run, by the clock.
    pub seconds: f64,
    /// Of the first run.
    pub seed: u64,
    /// Which time counts.
    pub clock: Clock,
    /// Moments at which all methods are looked at, seconds.
    pub marks: Vec<f64>,
}

/// Which time counts.
#[derive(Clone, Copy, Debug)]
pub struct Clock {
    /// By the watch or by the processors.
    pub kind: ClockArg,
    /// Number of threads that share the work.
    pub threads: usize,
}

/// What pictures are compared with.
pub struct Target {
    /// Moment of the scene, in its own unit of time.
    pub time: Option<f64>,
    /// `None`: ref.exr beside the scene.
    pub reference: Option<PathBuf>,
    /// Of the pictures.
    pub size: TargetSize,
}

/// Size of the pictures.
#[derive(Clone, Copy, Debug)]
pub enum TargetSize {
    /// Width and height are those of the reference over this.
    Shrink(u32),
    /// Of this the reference's is a whole multiple.
    Pixels(Size),
}

impl Settings {
    /// What these flags mean.
    pub fn new(args: &ReportArgs) -> Self {
        let measure = &args.measure;
        let threads = measure.threads.map_or_else(embedded::cores, usize::from);
        Self {
            scenes: args.scenes.clone(),
            output: args.output.clone(),
            methods: methods(&args.methods(), &args.variants),
            peers: peers(&args.peers, &measure.python),
            measurement: Measurement {
                runs: measure.runs,
                seconds: measure.seconds,
                seed: measure.seed,
                clock: Clock { kind: measure.clock, threads },
                marks: MARKS.into_iter().filter(|mark| *mark <= measure.seconds).collect(),
            },
            target: Target {
                time: measure.time,
                reference: measure.reference.clone(),
                size: measure.size.map_or(TargetSize::Shrink(measure.shrink), TargetSize::Pixels),
            },
            with_pruning: !args.without_pruning,
            console: options::console(args.talk),
            oidn: args.oidn.path.clone(),
            command: command(args, threads),
        }
    }
}

impl Settings {
    /// What denoises, if anything is to be denoised.
    ///
    /// # Errors
    /// It is not installed.
    pub fn finish(&self) -> anyhow::Result<Option<Finish>> {
        let is_wanted = self.methods.iter().any(Method::is_denoised) || self.peers.iter().any(Peer::is_denoised);
        is_wanted.then(|| Finish::open(self.oidn.as_deref())).transpose()
    }
}

/// Seconds: a first look, the time a person may wait, and time for a coffee.
const MARKS: [f64; 3] = [1.0, 10.0, 60.0];

impl Clock {
    /// Seconds that count.
    pub fn seconds(self, elapsed: Elapsed) -> f64 {
        match self.kind {
            ClockArg::Wall => elapsed.wall,
            ClockArg::Cpu => elapsed.cpu / self.threads as f64,
        }
    }
}

impl std::fmt::Display for Clock {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let threads = self.threads;
        match self.kind {
            ClockArg::Wall => write!(f, "wall time on {threads} threads"),
            ClockArg::Cpu => write!(f, "CPU time of {threads} threads over their number"),
        }
    }
}

/// The settings block: the command, and what it stood for.
pub fn block(sections: &[Section], settings: &Settings) -> String {
    let scenes: Vec<_> = sections
        .iter()
        .map(|section| {
            let subject = &section.subject;
            json!({
                "name": subject.name, "path": subject.path.display().to_string(),
                "width": subject.reference.width, "height": subject.reference.height,
                "reference": subject.reference_path.display().to_string(), "shrink": subject.shrink,
                "reference_noise": subject.floor,
                "methods": section.methods.iter().map(|method| (method.name.clone(), method.settings.clone()))
                    .collect::<std::collections::BTreeMap<_, _>>(),
            })
        })
        .collect();
    let block = json!({
        "program": concat!("igi-master ", env!("CARGO_PKG_VERSION")),
        "command": settings.command,
        "machine": machine(),
        "threads": settings.measurement.clock.threads,
        "scenes": scenes,
    });
    serde_json::to_string_pretty(&block).unwrap_or_default()
}

/// The command that repeats the report.
fn command(args: &ReportArgs, threads: usize) -> String {
    let measure = &args.measure;
    let mut words = vec!["igi-master".to_string(), "report".to_string()];
    words.extend(args.scenes.iter().map(|scene| quoted(&scene.display().to_string())));
    let name = |NamedArg(named): NamedArg| named.map_or("none".to_owned(), |(name, _)| name);
    let methods = args.methods().into_iter().map(name).collect::<Vec<_>>().join(",");
    if !methods.is_empty() {
        words.extend(["--methods".into(), methods]);
    }
    for variant in &args.variants {
        words.extend(["--variant".into(), quoted(&format!("{}={}", variant.name, variant.flags))]);
    }
    for peer in &args.peers {
        words.push("--peer".into());
        words.push(match peer {
            PeerArg::Mitsuba { is_denoised } => format!("mitsuba{}", if *is_denoised { DENOISED } else { "" }),
            PeerArg::Command { name, command } => quoted(&format!("{name}={command}")),
        });
    }
    words.push(format!("--runs {} --seconds {} --seed {}", measure.runs, measure.seconds, measure.seed));
    words.push(format!("--threads {threads}"));
    words.extend(measure.time.map(|time| format!("--time {time}")));
    words.push(if measure.clock == ClockArg::Cpu { "--clock cpu".into() } else { "--clock wall".into() });
    words.push(match measure.size {
        Some(size) => format!("--size {}x{}", size.width, size.height),
        None => format!("--shrink {}", measure.shrink),
    });
    if let Some(reference) = &measure.reference {
        words.extend(["--reference".into(), quoted(&reference.display().to_string())]);
    }
    if args.peers.iter().any(|peer| matches!(peer, PeerArg::Mitsuba { .. })) {
        words.extend(["--python".into(), quoted(&measure.python.display().to_string())]);
    }
    if args.without_pruning {
        words.push("--without-pruning".into());
    }
    words.extend(["-o".into(), quoted(&args.output.display().to_string())]);
    words.join(" ")
}

/// A word for a shell.
pub(super) fn quoted(word: &str) -> String {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || "-_./=:,".contains(c);
    if word.chars().all(is_plain) { word.to_string() } else { format!("'{}'", word.replace('\'', "'\\''")) }
}

/// The processor and the number of its cores, as far as the system tells.
pub fn machine() -> String {
    let cores = embedded::cores();
    let info = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let model = info.lines().find_map(|line| line.strip_prefix("model name")?.split_once(':'));
    let model = model.map_or(std::env::consts::ARCH, |(_, model)| model.trim());
    format!("{model}, {cores} cores, {}", std::env::consts::OS)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn threads_share_the_time_of_processors() {
        let elapsed = Elapsed { wall: 3.0, cpu: 8.0 };
        let seconds = |kind| Clock { kind, threads: 4 }.seconds(elapsed);
        assert_eq!([ClockArg::Wall, ClockArg::Cpu].map(seconds), [3.0, 2.0]);
    }

    #[test]
    fn words_are_quoted_for_a_shell() {
        assert_eq!([quoted("scenes/a.obj"), quoted("it's a b")], ["scenes/a.obj", "'it'\\''s a b'"]);
    }
}
