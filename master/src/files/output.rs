//! Where pictures are saved: checked before any work is done, and written whole or not at all.

use std::fs::{self, File, OpenOptions};
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::str::FromStr;

use anyhow::{Context, bail};

/// A file to write a picture to.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Output {
    /// Where.
    pub path: PathBuf,
    /// What.
    pub kind: OutputKind,
}

/// Kinds of picture files.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OutputKind {
    /// 8 bits, tone-mapped.
    Png,
    /// Linear, 32-bit float.
    Exr,
}

impl FromStr for Output {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let path = PathBuf::from(text);
        let extension = path.extension().map(|extension| extension.to_string_lossy().to_lowercase());
        let kind = match extension.as_deref() {
            Some("png") => OutputKind::Png,
            Some("exr") => OutputKind::Exr,
            _ => return Err("pictures are saved as .png or .exr".to_string()),
        };
        Ok(Self { path, kind })
    }
}

impl Output {
    /// Finds out now, not after the work, whether the file can be written.
    ///
    /// # Errors
    /// Says what is in the way.
    pub fn check(&self) -> anyhow::Result<()> {
        if self.path.is_dir() {
            bail!("{}: is a folder; a picture needs a file name", self.path.display());
        }
        let trial = neighbour(&self.path);
        let created = File::create_new(&trial).with_context(|| format!("{}: cannot be written", self.path.display()));
        created?;
        fs::remove_file(&trial).with_context(|| format!("{}: cannot be removed again", trial.display()))
    }
}

/// Writes a file under another name in the same folder, and renames it when it is complete: who
/// looks sees the old file or the new one.
///
/// # Errors
/// The operating system's; then the old file, if any, is as it was.
pub fn write_whole(path: &Path, bytes: &[u8]) -> anyhow::Result<()> {
    let trial = neighbour(path);
    let write = || -> io::Result<()> {
        let mut file = OpenOptions::new().write(true).create(true).truncate(true).open(&trial)?;
        file.write_all(bytes)?;
        file.sync_all()?;
        fs::rename(&trial, path)
    };
    write()
        .inspect_err(|_| drop(fs::remove_file(&trial)))
        .with_context(|| format!("{}: cannot be written", path.display()))
}

/// A name in the same folder that nobody else uses.
fn neighbour(path: &Path) -> PathBuf {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    path.with_file_name(format!(".{name}.{}.tmp", std::process::id()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_png_and_exr_are_known() {
        assert_eq!("a/b.PNG".parse::<Output>().unwrap().kind, OutputKind::Png);
        assert_eq!("b.exr".parse::<Output>().unwrap().kind, OutputKind::Exr);
        for wrong in ["b.jpg", "b", "", ".png", "png"] {
            assert!(wrong.parse::<Output>().is_err(), "{wrong}");
        }
    }

    #[test]
    fn writing_replaces_the_file_and_leaves_nothing_else() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.png");
        for text in ["first", "second"] {
            write_whole(&path, text.as_bytes()).unwrap();
            assert_eq!(fs::read_to_string(&path).unwrap(), text);
        }
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[test]
    fn what_cannot_be_written_is_found_out_before_and_leaves_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let output = |name: &str| Output { path: folder.path().join(name), kind: OutputKind::Png };
        assert!(output("missing/a.png").check().is_err());
        fs::create_dir(folder.path().join("b.png")).unwrap();
        assert!(output("b.png").check().is_err());
        output("c.png").check().unwrap();
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
    }
}
