//! What reading says when it cannot go on, and what it noticed when it could.

use std::collections::BTreeMap;
use std::fmt;
use std::path::{Path, PathBuf};

use super::text;

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
    /// Neither JSON nor OBJ nor glTF nor a luminaire's.
    #[error("{}: not a kind of scene file that is known here; use .json, .obj, .gltf, .glb, .ies, .ldt or a folder", .0.display())]
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

/// Notes under way. Those that say the same of different places are summarised, so that a file with a million faults
/// says few lines and takes little memory.
#[derive(Debug, Default)]
pub(super) struct Notes {
    kept: Vec<(Kind, Note)>,
    /// How often each kind of note was given.
    counts: BTreeMap<Kind, u64>,
}

/// What notes that say the same have in common.
type Kind = String;

impl Notes {
    /// So many notes of one kind are kept; the others are counted.
    const ALIKE_MAX: u64 = 8;
    /// So many kinds are told apart.
    const KINDS_MAX: usize = 256;
    /// Longest message, letters.
    const LETTERS_MAX: usize = 1000;

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
        let mut message = message.into();
        if let Some((end, _)) = message.char_indices().nth(Self::LETTERS_MAX) {
            message.truncate(end);
            message.push('…');
        }
        let mut kind = kind(&message);
        if self.counts.len() >= Self::KINDS_MAX && !self.counts.contains_key(&kind) {
            kind = String::new();
        }
        let count = self.counts.entry(kind.clone()).or_default();
        *count += 1;
        if *count <= Self::ALIKE_MAX {
            self.kept.push((kind, Note { file: file.into(), place: place.into(), message }));
        }
    }

    /// The first few, for a message that says why nothing is left.
    pub fn reasons(&self) -> String {
        self.kept.iter().take(3).map(|(_, note)| format!("; {note}")).collect()
    }

    /// In order; behind the last of a kind that was given too often, how often it was.
    pub fn into_list(self) -> Vec<Note> {
        let mut left = self.counts.clone();
        let mut list = Vec::with_capacity(self.kept.len());
        for (kind, note) in self.kept {
            let left = left.get_mut(&kind).expect("every note is counted");
            *left -= 1;
            let kept = self.counts[&kind].min(Self::ALIKE_MAX);
            let more = self.counts[&kind] - kept;
            let is_last = *left == more;
            let file = note.file.clone();
            list.push(note);
            if is_last && more > 0 {
                list.push(Note { file, place: String::new(), message: format!("… and {more} more like it") });
            }
        }
        list
    }
}

/// A message without what is different at every place: what is quoted, and digits.
fn kind(message: &str) -> Kind {
    let unquoted = message.split('`').step_by(2).collect::<Vec<_>>().join("`");
    unquoted.chars().filter(|letter| !letter.is_ascii_digit()).collect()
}

/// Counts what happens often and remembers where it happened first, so that a million broken
/// faces make one note.
#[derive(Debug, Default)]
pub(super) struct Tally {
    /// How often.
    pub count: u64,
    first: u32,
    /// What stood there, if that helps.
    word: String,
}

impl Tally {
    /// Once more.
    pub fn add(&mut self, line: u32) {
        if self.count == 0 {
            self.first = line;
        }
        self.count += 1;
    }

    /// Once more, by a word that stands there.
    pub fn add_word(&mut self, line: u32, word: impl fmt::Display) {
        if self.count == 0 {
            self.word = text::shorten(&word.to_string());
        }
        self.add(line);
    }

    /// Once more, if so.
    pub fn add_if(&mut self, so: bool, line: u32) {
        if so {
            self.add(line);
        }
    }

    /// What was counted further on in the same file.
    pub fn append(&mut self, later: Self) {
        match self.count {
            0 => *self = later,
            _ => self.count += later.count,
        }
    }

    /// One note `«count» «message»` at the first place, or nothing if nothing happened.
    pub fn report(&self, notes: &mut Notes, file: &Path, message: &str) {
        let mut message = format!("{} {message}", self.count);
        if self.count > 1 && self.first > 0 {
            message += "; this is the first";
        }
        if !self.word.is_empty() {
            message += &format!(": `{}`", self.word);
        }
        match (self.count, self.first) {
            (0, _) => {}
            (_, 0) => notes.file(file, message),
            (_, first) => notes.line(file, first, message),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_million_notes_alike_are_few_lines_and_others_stay() {
        let mut notes = Notes::default();
        notes.file(Path::new("a"), "something else");
        for line in 1..=1_000_000 {
            notes.line(Path::new("a"), line, format!("texture `{line}.png` does not exist"));
        }
        notes.line(Path::new("a"), 7, "and a last word");
        let list: Vec<String> = notes.into_list().iter().map(Note::to_string).collect();
        assert_eq!(list.len(), 11);
        assert_eq!(list[0], "a: something else");
        assert_eq!(list[8], "a: line 8: texture `8.png` does not exist");
        assert_eq!(list[9], "a: … and 999992 more like it");
        assert_eq!(list[10], "a: line 7: and a last word");
    }

    #[test]
    fn neither_many_kinds_nor_long_messages_take_memory() {
        let mut notes = Notes::default();
        for kind in 0..10_000_u32 {
            let letters: String = kind.to_string().chars().map(|digit| char::from(digit as u8 + 49)).collect();
            notes.file(Path::new("a"), format!("{letters} {}", "x".repeat(10_000)));
        }
        let list = notes.into_list();
        assert_eq!(list.len(), 256 + 8 + 1);
        assert!(list.iter().all(|note| note.message.len() < 1100));
    }
}
