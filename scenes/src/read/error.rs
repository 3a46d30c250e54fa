//! What reading says when it cannot go on, and what it noticed when it could.

use std::fmt;
use std::path::{Path, PathBuf};

/// Why a scene could not be read. Every message names the file, where in it, and what to do.
#[derive(Debug, thiserror::Error)]
pub enum ReadError {
    /// The path leads nowhere.
    #[error("{}: no such file or folder", .0.display())]
    Missing(PathBuf),
    /// The operating system refuses.
    #[error("{}: cannot be read: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// Its reason.
        source: std::io::Error,
    },
    /// A folder, but which file in it?
    #[error("{}: a scene folder holds scene.json, or exactly one .obj, .gltf or .glb file; {found}", path.display())]
    Folder {
        /// The folder.
        path: PathBuf,
        /// What is there instead.
        found: String,
    },
    /// Neither JSON nor OBJ nor glTF.
    #[error("{}: not a kind of scene file that is known here; use .json, .obj, .gltf, .glb or a folder", .0.display())]
    Kind(PathBuf),
    /// A line of a text file that makes no sense.
    #[error("{}:{line}: {message}", path.display())]
    Line {
        /// The file.
        path: PathBuf,
        /// Counted from 1.
        line: u32,
        /// What is wrong and what was expected.
        message: String,
    },
    /// A field of a structured file that makes no sense.
    #[error("{}: {field}: {message}", path.display())]
    Field {
        /// The file.
        path: PathBuf,
        /// Such as `camera.fov_y_deg` or `meshes[3].primitives[0].indices`.
        field: String,
        /// What is wrong and what was expected.
        message: String,
    },
    /// The file as a whole is broken, too large, empty or needs what is not offered here.
    #[error("{}: {message}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// What is wrong and what to do.
        message: String,
    },
}

impl ReadError {
    pub(super) fn line(path: &Path, line: u32, message: impl Into<String>) -> Self {
        Self::Line { path: path.into(), line, message: message.into() }
    }

    pub(super) fn field(path: &Path, field: impl Into<String>, message: impl Into<String>) -> Self {
        Self::Field { path: path.into(), field: field.into(), message: message.into() }
    }

    pub(super) fn file(path: &Path, message: impl Into<String>) -> Self {
        Self::File { path: path.into(), message: message.into() }
    }
}

/// Something the reader noticed, repaired, left out or made up. The picture may differ from what
/// the file's author saw; the person who renders it should know.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Note {
    /// The file it is about.
    pub file: PathBuf,
    /// Where in the file: `line 12`, `materials[3]`, or nothing.
    pub place: String,
    /// What was found and what was done about it.
    pub message: String,
}

impl fmt::Display for Note {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: ", self.file.display())?;
        if !self.place.is_empty() {
            write!(f, "{}: ", self.place)?;
        }
        f.write_str(&self.message)
    }
}

/// Notes under way.
#[derive(Debug, Default)]
pub(super) struct Notes(pub Vec<Note>);

impl Notes {
    /// About a file as a whole.
    pub fn file(&mut self, file: &Path, message: impl Into<String>) {
        self.at(file, String::new(), message);
    }

    /// About one line of a text file.
    pub fn line(&mut self, file: &Path, line: u32, message: impl Into<String>) {
        self.at(file, format!("line {line}"), message);
    }

    /// About a named place.
    pub fn at(&mut self, file: &Path, place: impl Into<String>, message: impl Into<String>) {
        self.0.push(Note { file: file.into(), place: place.into(), message: message.into() });
    }
}

/// Counts what happens often and remembers where it happened first, so that a million broken
/// faces make one note.
#[derive(Debug, Default)]
pub(super) struct Tally {
    /// How often.
    pub count: u64,
    first: u32,
}

impl Tally {
    /// Once more.
    pub fn add(&mut self, line: u32) {
        if self.count == 0 {
            self.first = line;
        }
        self.count += 1;
    }

    /// Once more, if so.
    pub fn add_if(&mut self, so: bool, line: u32) {
        if so {
            self.add(line);
        }
    }

    /// One note `«count» «message»` at the first place, or nothing if nothing happened.
    pub fn report(&self, notes: &mut Notes, file: &Path, message: &str) {
        match (self.count, self.first) {
            (0, _) => {}
            (count, 0) => notes.file(file, format!("{count} {message}")),
            (1, first) => notes.line(file, first, format!("1 {message}")),
            (count, first) => notes.line(file, first, format!("{count} {message}; this is the first")),
        }
    }
}
