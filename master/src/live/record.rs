//! What people did, in a file: for bug reports, teaching, benchmarks.
//!
//! One JSON object a line: first what was begun with, then inputs and moving pictures in the order in
//! which they came. That order is all that a replay needs to draw the same pictures again, bit for bit;
//! times are for people.

use std::fs::File;
use std::io::{BufRead, BufReader, BufWriter, ErrorKind, Write};
use std::path::{Path, PathBuf};

use anyhow::{Context, anyhow, bail};
use protocol::question::Quality;
use scenes::{Camera, Change};
use serde::{Deserialize, Serialize};

/// The first line.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Begun {
    /// Version of this format.
    pub igi_session: u32,
    /// Where the scene was.
    pub scene: PathBuf,
    /// Moment of the scene.
    pub time: f64,
    /// All randomness comes from it.
    pub seed: u64,
    /// How still pictures were drawn.
    pub quality: Quality,
    /// The discontinuity buffer's window; nothing: off.
    pub window: Option<[u8; 2]>,
    /// Moving pictures kept part of the last one's light.
    pub steady: bool,
    /// From where people looked at first.
    pub camera: Camera,
}

/// Every other line.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Line {
    /// Seconds since the beginning.
    pub t: f64,
    /// What happened.
    #[serde(flatten)]
    pub what: What,
}

/// What can have happened.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum What {
    /// Somebody looked from elsewhere.
    Look(Camera),
    /// Somebody edited the scene.
    Edit(Vec<Change>),
    /// A moving picture was begun, at this level.
    Moving {
        /// As in [`frame::live::pace::Level`].
        scale: f32,
        /// As in [`frame::live::pace::Level`].
        lights: f32,
    },
}

/// The version of the format that is written and read.
pub const VERSION: u32 = 1;
/// Longest line that is read, bytes, and most lines.
const LINE_MAX: usize = 1 << 20;
const LINES_MAX: usize = 1 << 22;

/// Writes a session as it happens.
pub struct Recorder(BufWriter<File>);

impl Recorder {
    /// Begins a file.
    ///
    /// # Errors
    /// It cannot be written, or is there already: somebody may still want that session.
    pub fn create(path: &Path, begun: &Begun) -> anyhow::Result<Self> {
        let file = File::create_new(path).map_err(|error| match error.kind() {
            ErrorKind::AlreadyExists => {
                anyhow!("{}: is there already; name another file, or remove it", path.display())
            }
            _ => anyhow!("{}: cannot be written: {error}", path.display()),
        })?;
        let mut recorder = Self(BufWriter::new(file));
        recorder.put(begun)?;
        Ok(recorder)
    }

    /// One more line.
    ///
    /// # Errors
    /// It cannot be written.
    pub fn line(&mut self, t: f64, what: What) -> anyhow::Result<()> {
        self.put(&Line { t, what })
    }

    fn put(&mut self, line: &impl Serialize) -> anyhow::Result<()> {
        serde_json::to_writer(&mut self.0, line)?;
        // Whole lines are in the file even if the program is killed.
        self.0.write_all(b"\n")?;
        self.0.flush().context("the session cannot be recorded any more")
    }
}

/// Reads a session.
///
/// # Errors
/// Names file and line of what is wrong.
pub fn read(path: &Path) -> anyhow::Result<(Begun, Vec<Line>)> {
    let file = File::open(path).with_context(|| format!("{}: cannot be read", path.display()))?;
    let mut reader = BufReader::new(file);
    let mut number = 0;
    let mut next = || -> anyhow::Result<Option<String>> {
        number += 1;
        let mut text = String::new();
        let read = std::io::Read::take(&mut reader, LINE_MAX as u64).read_line(&mut text);
        read.with_context(|| format!("{}:{number}: is not text", path.display()))?;
        if text.len() >= LINE_MAX || number > LINES_MAX {
            bail!("{}:{number}: is too long for a session", path.display());
        }
        Ok((!text.is_empty()).then_some(text))
    };
    let first = next()?.unwrap_or_default();
    let begun: Begun = serde_json::from_str(&first)
        .with_context(|| format!("{}:1: is no session recorded by --record", path.display()))?;
    if begun.igi_session != VERSION {
        bail!("{}:1: is of version {}, and this program reads version {VERSION}", path.display(), begun.igi_session);
    }
    begun.camera.check().map_err(|what| anyhow::anyhow!("{}:1: camera: {what}", path.display()))?;
    let mut lines = Vec::new();
    while let Some(text) = next()? {
        let line = serde_json::from_str(&text);
        lines.push(line.with_context(|| format!("{}:{}: is no event of a session", path.display(), lines.len() + 2))?);
    }
    Ok((begun, lines))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn begun() -> Begun {
        let (scene, camera) = (PathBuf::from("scenes/cornell"), Camera::default());
        let (quality, window) = (Quality::default(), Some([3, 3]));
        Begun { igi_session: VERSION, scene, time: 0.0, seed: 7, quality, window, steady: true, camera }
    }

    #[test]
    fn what_is_recorded_can_be_read() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.session");
        let lines = [
            What::Look(Camera { fov_y_deg: 33.3, ..Camera::default() }),
            What::Moving { scale: 0.42, lights: 0.5 },
            What::Edit(vec![Change::Visible { object: 3, visible: false }, Change::Time(0.1)]),
        ];
        let mut recorder = Recorder::create(&path, &begun()).unwrap();
        lines.iter().for_each(|what| recorder.line(0.25, what.clone()).unwrap());
        let (first, read_lines) = read(&path).unwrap();
        assert_eq!(first, begun());
        assert_eq!(read_lines, lines.map(|what| Line { t: 0.25, what }));
    }

    #[test]
    fn what_is_no_session_is_refused_with_its_line() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.session");
        let good = serde_json::to_string(&begun()).unwrap();
        let old = good.replacen("\"igi_session\":1", "\"igi_session\":0", 1);
        for (text, place) in [
            (String::new(), ":1:"),
            ("{}".into(), ":1:"),
            (old, ":1:"),
            (format!("{good}\nnonsense\n"), ":2:"),
            (format!("{good}\n{{\"t\":0,\"undo\":1}}\n"), ":2:"),
        ] {
            std::fs::write(&path, text).unwrap();
            let error = format!("{:#}", read(&path).unwrap_err());
            assert!(error.contains(place) && error.contains("a.session"), "{error}");
        }
    }
}
