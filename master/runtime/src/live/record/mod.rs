//! What people did, in a file: for bug reports, teaching, benchmarks.
//!
//! One JSON object a line: first what was begun with, then inputs, and the beginnings and ends of moving pictures, in the order
//! in which they came. That order is all that a replay needs to draw the same pictures again, bit for bit;
//! times are for people.

mod format2;

use std::fs::File;
use std::io::{BufRead, BufReader, BufWriter, ErrorKind, Write};
use std::path::{Path, PathBuf};

use anyhow::{Context, anyhow, bail, ensure};
use protocol::message::PICTURE_SIDE_MAX;
use scenes::{Camera, Change, Scene};
use serde::{Deserialize, Serialize};

use crate::methods::Named;

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
    /// What the scene was, in digits: edited files give another. `None` if it was recorded in a format whose
    /// digits mean something else.
    pub world: Option<String>,
    /// How pictures were made.
    pub method: Named,
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
    /// The camera was moved.
    Look(Camera),
    /// The scene was edited.
    Edit(Vec<Change>),
    /// Knobs of the method were turned, or another was chosen.
    Turn(Named),
    /// A moving picture was begun while others were under way; without this, one begins with the first input after one has
    /// ended, or when one has ended and there were inputs meanwhile.
    Began {},
    /// The oldest moving picture under way was overtaken by a newer one, and never shown.
    Overtaken {},
    /// A moving picture has ended, the oldest under way.
    Shown {
        /// As in [`frame::live::Ended::batches`].
        batches: u32,
        /// As in [`frame::front_end::Effort`].
        effort: f32,
        /// As in [`frame::live::Ended::still`].
        #[serde(default, skip_serializing_if = "is_zero")]
        still: u32,
    },
}

/// The version of the format that is written. Versions 2 and 3 are read too: in 3, one moving picture is under way at a time.
pub const VERSION: u32 = 4;
const SERIAL: u32 = 3;
/// Longest line that is written or read, bytes, and most lines.
const LINE_MAX: usize = 16 << 20;
const LINES_MAX: usize = 1 << 22;

/// Writes a session as it happens.
pub struct Recorder(BufWriter<File>);

impl Recorder {
    /// Makes the file.
    ///
    /// # Errors
    /// It cannot be written, or is there already: that session may still be wanted.
    pub fn create(path: &Path) -> anyhow::Result<Self> {
        let file = File::create_new(path).map_err(|error| match error.kind() {
            ErrorKind::AlreadyExists => {
                anyhow!("{}: is there already; name another file, or remove it", path.display())
            }
            _ => anyhow!("{}: cannot be written: {error}", path.display()),
        })?;
        Ok(Self(BufWriter::new(file)))
    }

    /// The first line.
    ///
    /// # Errors
    /// It cannot be written.
    pub fn begin(&mut self, begun: &Begun) -> anyhow::Result<()> {
        self.put(begun)
    }

    /// One more line.
    ///
    /// # Errors
    /// It cannot be written.
    pub fn line(&mut self, t: f64, what: What) -> anyhow::Result<()> {
        self.put(&Line { t, what })
    }

    fn put(&mut self, line: &impl Serialize) -> anyhow::Result<()> {
        let mut bytes = serde_json::to_vec(line)?;
        bytes.push(b'\n');
        ensure!(bytes.len() < LINE_MAX, "the session cannot be recorded any more: an edit is too long");
        // Whole lines are in the file even if the program is killed.
        let written = self.0.write_all(&bytes).and_then(|()| self.0.flush());
        written.context("the session cannot be recorded any more")
    }
}

/// A session as it was recorded.
#[derive(Clone, Debug)]
pub struct Recording {
    /// What it began with.
    pub begun: Begun,
    lines: Vec<Line>,
    /// Version of the file's format.
    format: u32,
}

impl Recording {
    /// What happened, in order. `scene` is the one that was begun with: formats differ in how they say where its objects
    /// are.
    pub fn into_lines(mut self, scene: &Scene) -> Vec<Line> {
        if self.format == format2::VERSION {
            format2::put_in_place(&mut self.lines, scene);
        }
        self.lines
    }
}

/// What the first line of every format has.
#[derive(Deserialize)]
struct Version {
    igi_session: u32,
}

/// Reads a session.
///
/// # Errors
/// Names file and line of what is wrong.
pub fn read(path: &Path) -> anyhow::Result<Recording> {
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
    let is_none = || format!("{}:1: is no session recorded by --record", path.display());
    let Version { igi_session: format } = serde_json::from_str(&first).with_context(is_none)?;
    let (begun, parse): (_, fn(&str) -> serde_json::Result<Line>) = match format {
        VERSION | SERIAL => (serde_json::from_str::<Begun>(&first), |text| serde_json::from_str(text)),
        format2::VERSION => (format2::begun(&first), format2::line),
        _ => bail!(
            "{}:1: is of version {format}, and this program reads versions {} to {VERSION}",
            path.display(),
            format2::VERSION
        ),
    };
    let begun = begun.with_context(is_none)?;
    let wrong = |number: usize, what: String| anyhow!("{}:{number}: {what}", path.display());
    check_view(&begun.camera).map_err(|what| wrong(1, what))?;
    let mut method = begun.method.after(None).map_err(|what| wrong(1, what))?;
    let mut lines: Vec<Line> = Vec::new();
    while let Some(text) = next()? {
        let number = lines.len() + 2;
        let line = match parse(&text) {
            Ok(line) => line,
            Err(_) if !text.ends_with('\n') => {
                tracing::warn!("{}:{number}: is cut off, and left out", path.display());
                break;
            }
            Err(error) => return Err(error).with_context(|| wrong(number, "is no event of a session".into())),
        };
        match &line.what {
            What::Look(camera) => check_view(camera),
            What::Turn(named) => named.after(Some(&method)).map(|turned| method = turned),
            What::Began {} | What::Overtaken {} | What::Shown { .. } | What::Edit(_) => Ok(()),
        }
        .map_err(|what| wrong(number, what))?;
        lines.push(line);
    }
    Ok(Recording { begun, lines, format })
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde wants it so")]
fn is_zero(number: &u32) -> bool {
    *number == 0
}

fn check_view(camera: &Camera) -> Result<(), String> {
    camera.check().map_err(|what| format!("camera: {what}"))?;
    let sides = [camera.width, camera.height];
    let is_drawn = sides.into_iter().all(|side| (1..=PICTURE_SIDE_MAX).contains(&side));
    if is_drawn { Ok(()) } else { Err(format!("camera: {}x{} pixels cannot be drawn", sides[0], sides[1])) }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use frame::Chosen;
    use frame::front_end::Value;

    use super::*;
    use crate::methods;

    fn begun() -> Begun {
        let (scene, camera) = (PathBuf::from("scenes/cornell"), Camera::default());
        let world = Some("00".repeat(32));
        let method = Named::from(&Chosen::new(methods::all()[0]));
        Begun { igi_session: VERSION, scene, time: 0.0, seed: 7, world, method, camera }
    }

    #[test]
    fn what_is_recorded_can_be_read() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.session");
        let lines = [
            What::Look(Camera { fov_y_deg: 33.3, ..Camera::default() }),
            What::Began {},
            What::Overtaken {},
            What::Shown { batches: 1, effort: 0.42 * 0.42, still: 0 },
            What::Shown { batches: 0, effort: 0.01, still: 16 },
            What::Turn(Named { settings: [("vpls".into(), Value::Whole(9))].into(), ..begun().method }),
            What::Turn(Named { name: "reference".into(), settings: BTreeMap::new() }),
            What::Edit(vec![Change::Visible { object: 3, visible: false }, Change::Time(0.1)]),
        ];
        let mut recorder = Recorder::create(&path).unwrap();
        recorder.begin(&begun()).unwrap();
        lines.iter().for_each(|what| recorder.line(0.25, what.clone()).unwrap());
        let recording = read(&path).unwrap();
        assert_eq!(recording.begun, begun());
        assert_eq!(recording.into_lines(&Scene::default()), lines.map(|what| Line { t: 0.25, what }));
    }

    #[test]
    fn what_is_no_session_is_refused_with_its_line() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.session");
        let good = serde_json::to_string(&begun()).unwrap();
        let look = |[width, height]: [u32; 2]| {
            let camera = Camera { width, height, ..Camera::default() };
            serde_json::to_string(&Line { t: 0.0, what: What::Look(camera) }).unwrap()
        };
        let old = good.replacen("\"igi_session\":4", "\"igi_session\":1", 1);
        for (text, place) in [
            (String::new(), ":1:"),
            ("{}".into(), ":1:"),
            (old, ":1:"),
            (format!("{good}\nnonsense\n"), ":2:"),
            (good.replacen("\"interleave\":[3,3]", "\"interleave\":[0,0]", 1), ":1:"),
            (good.replacen("\"vpls\":24", "\"unheard-of\":24", 1), ":1:"),
            (good.replacen("\"name\":\"igi\"", "\"name\":\"unheard-of\"", 1), ":1:"),
            (format!("{good}\n{{\"t\":0,\"turn\":{{\"name\":\"igi\",\"settings\":{{\"vpls\":0}}}}}}\n"), ":2:"),
            (format!("{good}\n{}\n", look([0, 9])), ":2:"),
            (format!("{good}\n{}\n", look([300_000, 9])), ":2:"),
            (format!("{good}\n{{\"t\":0,\"undo\":1}}\n"), ":2:"),
        ] {
            std::fs::write(&path, text).unwrap();
            let error = format!("{:#}", read(&path).unwrap_err());
            assert!(error.contains(place) && error.contains("a.session"), "{error}");
        }
    }

    /// A full disk or a dead machine costs the last line, not the session.
    #[test]
    fn a_last_line_that_is_cut_off_is_left_out() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.session");
        let mut recorder = Recorder::create(&path).unwrap();
        recorder.begin(&begun()).unwrap();
        (0..2).for_each(|_| recorder.line(0.5, What::Edit(vec![Change::Time(0.1)])).unwrap());
        let text = std::fs::read_to_string(&path).unwrap();
        std::fs::write(&path, &text[..text.len() - 9]).unwrap();
        assert_eq!(read(&path).unwrap().lines.len(), 1);
        assert!(Recorder::create(&path).is_err(), "no session is written over");
    }
}
