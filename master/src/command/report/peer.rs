//! Other renderers: started as a command, they report pictures line by line.

use std::io::{BufRead, BufReader, Read};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::sync::mpsc::{Receiver, RecvTimeoutError, sync_channel};
use std::time::{Duration, Instant};

use anyhow::{Context, bail, ensure};
use frame::metrics::Checkpoints;
use frame::parts::Undenoised;
use protocol::answer::Cost;
use scenes::{Needs, Scene};
use serde_json::Value;

use super::finish::{DENOISED, Finish};
use super::progress::Progress;
use super::record::{Description, Look, Record, Run, View};
use super::settings::Measurement;
use super::subject::Subject;
use crate::cli::{ClockArg, PeerArg};
use runtime::files::{read_guides, read_picture};
use runtime::interrupt::Interrupt;
use runtime::stopwatch::Elapsed;

/// A renderer that can be started.
pub struct Peer {
    name: String,
    /// Words with placeholders, the program first.
    words: Vec<String>,
    /// It is known to be a path tracer.
    traces_paths: bool,
}

/// All that were asked for.
pub fn peers(peers: &[PeerArg], python: &Path) -> Vec<Peer> {
    peers.iter().flat_map(|peer| expanded(peer, python)).collect()
}

fn expanded(peer: &PeerArg, python: &Path) -> Vec<Peer> {
    match peer {
        PeerArg::Mitsuba { is_denoised } => [("mitsuba scalar", "scalar_rgb"), ("mitsuba llvm", "llvm_ad_rgb")]
            .map(|(name, variant)| {
                let fixed = [&python.to_string_lossy(), "-c", SCRIPT, "--variant", variant];
                let given = MITSUBA_FLAGS.split_whitespace().chain(is_denoised.then_some("--guides"));
                Peer {
                    name: format!("{name}{}", if *is_denoised { DENOISED } else { "" }),
                    words: fixed.into_iter().chain(given).map(String::from).collect(),
                    traces_paths: true,
                }
            })
            .into(),
        PeerArg::Command { name, command } => {
            let words = command.split_whitespace().map(String::from).collect();
            vec![Peer { name: name.clone(), words, traces_paths: false }]
        }
    }
}

/// Whether a plain path tracer misses light of the scene: lamps that no path can hit, beside mirrors or glass.
fn hides_light(scene: &Scene) -> bool {
    let needs = Needs::of(scene);
    needs.bare_lights() > 0 && needs.specular()
}

const BLIND: &str = "not compared with others: a path tracer finds no light of point, spot and directional lights by way of \
                     mirrors and glass";

/// Mitsuba by its Python interface.
const SCRIPT: &str = include_str!("mitsuba_peer.py");
const MITSUBA_FLAGS: &str = "--scene {mitsuba} --folder {folder} --clock {clock} --marks {marks} --runs {runs} \
                             --seed {seed} --threads {threads} --seconds {seconds}";

impl Peer {
    /// For plots and tables.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Its pictures are denoised.
    pub fn is_denoised(&self) -> bool {
        self.name.ends_with(DENOISED)
    }

    fn describe(&self, is_rival: bool) -> Description {
        // The script is long, and the program's own.
        let shown = self.words.iter().map(|word| if word == SCRIPT { "mitsuba_peer.py" } else { word });
        let settings = shown.collect::<Vec<_>>().join(" ");
        let view = if self.is_denoised() { View::Shown } else { View::Raw };
        Description { name: self.name.clone(), settings, views: vec![view], expected: -1.0, is_rival }
    }

    /// All its runs of a scene. What goes wrong is trouble of this record, not of the report.
    pub fn run(
        &self,
        subject: &Subject,
        measurement: &Measurement,
        finish: Option<&Finish>,
        interrupt: &Interrupt,
        progress: &mut Progress,
    ) -> Record {
        let is_blind = self.traces_paths && hides_light(&subject.scene);
        let mut record = Record::new(self.describe(!is_blind));
        let finish = finish.filter(|_| self.is_denoised());
        record.method.settings += &finish.map_or(String::new(), Finish::said);
        let size = [subject.reference.width, subject.reference.height];
        let shortened = match finish.map(|finish| finish.shortened(measurement, size)).transpose() {
            Ok(shortened) => shortened,
            Err(error) => return Record { trouble: Some(format!("{error:#}")), ..record },
        };
        let mut ledger = Ledger::new(record, subject, shortened.as_ref().unwrap_or(measurement));
        ledger.is_denoised = finish.is_some();
        let before = progress.done();
        let outcome = self.listen(&mut ledger, interrupt, |run, share| {
            progress.reached(before + run);
            progress.running(&self.name, share);
        });
        let finished =
            finish.map_or(Ok(()), |finish| ledger.record.runs.iter_mut().try_for_each(|run| finish.finish(run)));
        let outcome = outcome.and(finished);
        progress.reached(before + measurement.runs as usize);
        let mut record = ledger.record;
        record.trouble = outcome.err().map(|error| format!("{error:#}"));
        if is_blind && record.trouble.is_none() {
            record.trouble = Some(BLIND.to_string());
        }
        record
    }

    /// Starts it and takes down what it says, until it ends or somebody interrupts.
    fn listen(
        &self,
        ledger: &mut Ledger,
        interrupt: &Interrupt,
        mut progress: impl FnMut(usize, f64),
    ) -> anyhow::Result<()> {
        let folder = tempfile::tempdir().context("no folder for temporary files")?;
        let words = self.filled(ledger, folder.path())?;
        let (program, arguments) = words.split_first().context("the command is empty")?;
        let mut command = Command::new(program);
        command.args(arguments).stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
        let child = command.spawn().with_context(|| format!("{program} cannot be started"))?;
        let mut talk = Talk::with(child);

        // Time to prepare, and for looking, on a machine that is busy.
        let Measurement { runs, seconds, .. } = ledger.measurement;
        let patience = f64::from(*runs) * (seconds * 8.0 + 60.0) + 600.0;
        let deadline = Instant::now() + Duration::from_secs_f64(patience);
        loop {
            match talk.lines.recv_timeout(Duration::from_millis(100)) {
                Ok(line) => {
                    let (run, share) = ledger.enter(&line).with_context(|| format!("it said: {line}"))?;
                    progress(run, share);
                }
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => break,
            }
            if interrupt.asked() {
                return Ok(());
            }
            ensure!(Instant::now() < deadline, "took longer than {patience:.0} s");
        }
        if !talk.end(deadline, interrupt)? {
            return Ok(());
        }
        ensure!(!ledger.record.runs.is_empty(), "ended without a picture");
        Ok(())
    }

    /// The command with its placeholders filled in.
    fn filled(&self, ledger: &Ledger, folder: &Path) -> anyhow::Result<Vec<String>> {
        let Ledger { subject, measurement, .. } = ledger;
        let Measurement { runs, seconds, seed, clock, marks } = measurement;
        let exported = if self.words.iter().any(|word| word.contains("{mitsuba}")) {
            crate::command::export::mitsuba(&subject.scene, &folder.join("scene"))?.file.display().to_string()
        } else {
            String::new()
        };
        let camera = &subject.scene.camera;
        let marks = marks.iter().map(f64::to_string).collect::<Vec<_>>().join(",");
        let kind = if clock.kind == ClockArg::Cpu { "cpu" } else { "wall" };
        let values = [
            ("{mitsuba}", exported),
            ("{scene}", subject.path.display().to_string()),
            ("{width}", camera.width.to_string()),
            ("{height}", camera.height.to_string()),
            ("{runs}", runs.to_string()),
            ("{seconds}", seconds.to_string()),
            ("{threads}", clock.threads.to_string()),
            ("{seed}", seed.to_string()),
            ("{marks}", marks),
            ("{clock}", kind.to_string()),
            ("{folder}", folder.display().to_string()),
        ];
        let fill = |word: &String| {
            // The script has braces of its own.
            if word == SCRIPT { word.clone() } else { values.iter().fold(word.clone(), |w, (k, v)| w.replace(k, v)) }
        };
        Ok(self.words.iter().map(fill).collect())
    }
}

/// Takes down what a renderer says about its runs.
struct Ledger<'a> {
    record: Record,
    /// When to look, one a run that has begun.
    checkpoints: Vec<Checkpoints>,
    subject: &'a Subject,
    measurement: &'a Measurement,
    /// Pictures come with what a denoiser wants to know.
    is_denoised: bool,
}

impl<'a> Ledger<'a> {
    fn new(record: Record, subject: &'a Subject, measurement: &'a Measurement) -> Self {
        Self { record, checkpoints: Vec::new(), subject, measurement, is_denoised: false }
    }

    /// Enters a line; says which run it is about, and how much of it is over.
    fn enter(&mut self, line: &str) -> anyhow::Result<(usize, f64)> {
        let said: Value = serde_json::from_str(line).context("not a JSON object")?;
        let number = |name: &str| said.get(name).and_then(Value::as_f64).filter(|n| n.is_finite() && *n >= 0.0);
        if let Some(seconds) = number("prepared") {
            self.record.preparation = seconds;
            if let Some(version) = said.get("version").and_then(Value::as_str) {
                self.record.method.settings = format!("{version}: {}", self.record.method.settings);
            }
            return Ok((0, 0.0));
        }
        let run = number("run").context("no number `run`")? as usize;
        ensure!(run < self.measurement.runs as usize, "there is no run {run}");
        ensure!(run <= self.record.runs.len(), "run {run} before run {}", self.record.runs.len());
        if run == self.record.runs.len() {
            self.record.runs.push(Run::new(self.measurement.marks.len()));
            self.checkpoints.push(Checkpoints::new(&self.measurement.marks));
        }
        let Some(path) = said.get("picture").and_then(Value::as_str) else {
            return Ok((run, number("share").unwrap_or(0.0).min(1.0)));
        };
        let samples = number("samples").context("no number `samples`")? as u64;
        let elapsed = Elapsed {
            wall: number("seconds").context("no number `seconds`")?,
            cpu: number("cpu_seconds").unwrap_or(f64::NAN),
        };
        let seconds = self.measurement.clock.seconds(elapsed);
        ensure!(seconds.is_finite(), "no number `cpu_seconds`, which --clock cpu needs");
        let passed = self.checkpoints[run].pass(samples, seconds);
        let picture = read_picture(Path::new(path))?;
        let (width, height) = (self.subject.reference.width, self.subject.reference.height);
        if !picture.same_size(&self.subject.reference) {
            bail!("its picture is {}x{} instead of {width}x{height}", picture.width, picture.height);
        }
        let guides = self.is_denoised.then(|| read_guides(Path::new(path))).transpose()?;
        let (pictures, undenoised) = match guides {
            Some([albedo, normal]) => (Vec::new(), Some(Undenoised::foreign(picture, albedo, normal))),
            None => (vec![picture], None),
        };
        let look = Look { samples, elapsed, cost: Cost::default(), bytes: 0, pictures, undenoised };
        self.record.runs[run].keep(&passed, look);
        Ok((run, (seconds / self.measurement.seconds).min(1.0)))
    }
}

/// A process that talks; killed if it is still there when this is dropped.
struct Talk {
    child: Child,
    lines: Receiver<String>,
    /// The end of what it complains about.
    complaint: Option<std::thread::JoinHandle<String>>,
}

impl Talk {
    fn with(mut child: Child) -> Self {
        let (sender, lines) = sync_channel(LINES_WAITING_MAX);
        if let Some(stdout) = child.stdout.take() {
            std::thread::spawn(move || {
                let mut stdout = BufReader::new(stdout);
                loop {
                    let mut line = String::new();
                    // Whoever says more in one line makes no sense anyway, and is cut short.
                    match stdout.by_ref().take(LINE_BYTES_MAX).read_line(&mut line) {
                        Ok(1..) if sender.send(line.trim_end().to_string()).is_ok() => {}
                        _ => break,
                    }
                }
            });
        }
        let complaint = child.stderr.take().map(|stderr| std::thread::spawn(move || last_line(stderr)));
        Self { child, lines, complaint }
    }

    /// It has said all that it has to say, and should end; false if somebody interrupted before it did.
    fn end(&mut self, deadline: Instant, interrupt: &Interrupt) -> anyhow::Result<bool> {
        let status = loop {
            if let Some(status) = self.child.try_wait()? {
                break status;
            }
            if interrupt.asked() {
                return Ok(false);
            }
            ensure!(Instant::now() < deadline, "has said its last, but does not end");
            std::thread::sleep(Duration::from_millis(20));
        };
        let complaint = self.complaint.take().and_then(|thread| thread.join().ok()).unwrap_or_default();
        ensure!(status.success(), "{}", if complaint.is_empty() { status.to_string() } else { complaint });
        Ok(true)
    }
}

impl Drop for Talk {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// The last line that is not empty, which in tracebacks and usage messages says most.
fn last_line(stream: impl Read) -> String {
    let mut last = String::new();
    let mut stream = BufReader::new(stream);
    loop {
        let mut line = Vec::new();
        match stream.by_ref().take(LINE_BYTES_MAX).read_until(b'\n', &mut line) {
            Ok(1..) => {
                let line = String::from_utf8_lossy(&line).trim().to_string();
                last = if line.is_empty() { last } else { line };
            }
            _ => return last,
        }
    }
}

/// Longest line that is taken in.
const LINE_BYTES_MAX: u64 = 1 << 16;
/// Lines that may wait to be taken in; whoever says more has to wait too.
const LINES_WAITING_MAX: usize = 64;
