//! Files that could not be written after long work: the others are, and no content is lost that can be kept.

use std::io::{self, Write};
use std::path::{Path, PathBuf};

use anyhow::anyhow;

use super::write::write_whole;

/// What becomes of content whose file cannot be written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fallback {
    /// It is put into the system's folder for temporary files, if there is room.
    Copy,
    /// Nothing: it can be made again.
    Nothing,
}

/// Writes files, and remembers those that it could not write.
#[derive(Debug)]
pub struct Unsaved {
    fallback: Fallback,
    reasons: Vec<String>,
    /// What the files that are there are not.
    flaws: Vec<String>,
}

impl Unsaved {
    /// Nothing is lost yet.
    pub fn new(fallback: Fallback) -> Self {
        Self { fallback, reasons: Vec::new(), flaws: Vec::new() }
    }

    /// Writes a file.
    ///
    /// # Errors
    /// Why it is not there, and where its content is instead; it is remembered.
    pub fn write(&mut self, path: &Path, content: anyhow::Result<Vec<u8>>) -> Result<(), String> {
        let reason = match content {
            Ok(bytes) => write_whole(path, &bytes).err().map(|error| match self.fallback {
                Fallback::Copy => with_copy(path, &bytes, &error),
                Fallback::Nothing => format!("{error:#}"),
            }),
            Err(error) => Some(format!("{}: cannot be made: {error:#}", path.display())),
        };
        self.reasons.extend(reason.clone());
        reason.map_or(Ok(()), Err)
    }

    /// What is written next is not what it should be; once for each reason.
    pub fn regret(&mut self, flaw: &str) {
        if !self.flaws.iter().any(|known| known == flaw) {
            self.flaws.push(flaw.to_owned());
        }
    }

    /// Number of files that are not there.
    pub fn count(&self) -> usize {
        self.reasons.len()
    }

    /// How it went.
    ///
    /// # Errors
    /// Names each file that is not there, or the first of many, and what is wrong with the others.
    pub fn verdict(&self) -> anyhow::Result<()> {
        let reasons: Vec<&str> = self.reasons.iter().chain(&self.flaws).map(String::as_str).collect();
        if reasons.is_empty() {
            return Ok(());
        }
        let more = reasons.len().saturating_sub(NAMED_MAX);
        let named = reasons[..reasons.len() - more].join("; ");
        if more == 0 { Err(anyhow!(named)) } else { Err(anyhow!("{named}; and {more} more files")) }
    }
}

/// Files that are named at most.
const NAMED_MAX: usize = 8;

/// Keeps what could not be written where it was to be; says why, and where it is.
fn with_copy(path: &Path, bytes: &[u8], error: &anyhow::Error) -> String {
    let name = path.file_name().unwrap_or_default();
    match copy_elsewhere(&name.to_string_lossy(), bytes) {
        Ok(copy) => format!("{error:#} (it is in {} instead)", copy.display()),
        Err(_) => format!("{error:#}"),
    }
}

fn copy_elsewhere(name: &str, bytes: &[u8]) -> io::Result<PathBuf> {
    let mut copy = tempfile::Builder::new().prefix("igi-").suffix(&format!("-{name}")).tempfile()?;
    copy.write_all(bytes)?;
    copy.as_file().sync_all()?;
    Ok(copy.keep().map_err(|refused| refused.error)?.1)
}

/// Writes every one of these files, whatever becomes of the others.
///
/// # Errors
/// Names each that could not be written, and where its content is instead.
pub fn write_each(
    files: impl IntoIterator<Item = (PathBuf, anyhow::Result<Vec<u8>>)>,
    fallback: Fallback,
) -> anyhow::Result<()> {
    let mut unsaved = Unsaved::new(fallback);
    for (path, content) in files {
        // It is remembered.
        let _ = unsaved.write(&path, content);
    }
    unsaved.verdict()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_file_that_cannot_be_written_costs_no_other_and_its_content_is_kept() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        let names = ["a.html", "gone/b.csv", "c.svg"];
        let said = write_each(names.map(|name| (path(name), Ok(name.as_bytes().to_vec()))), Fallback::Copy)
            .unwrap_err()
            .to_string();
        assert_eq!(std::fs::read_to_string(path("a.html")).unwrap(), "a.html");
        assert_eq!(std::fs::read_to_string(path("c.svg")).unwrap(), "c.svg");
        assert!(said.contains("gone/b.csv: cannot be written") && !said.contains("a.html"), "{said}");
        let copy = said.split("(it is in ").nth(1).unwrap().split(" instead").next().unwrap();
        assert_eq!(std::fs::read_to_string(copy).unwrap(), "gone/b.csv");
        std::fs::remove_file(copy).unwrap();
        assert!(write_each([], Fallback::Copy).is_ok());
    }
}
