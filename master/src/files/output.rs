//! Where pictures are saved: checked before any work is done, and written whole or not at all.

use std::fs::{self, File, OpenOptions};
use std::io::{self, Write};
use std::os::unix::fs::OpenOptionsExt;
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
    /// The file of one picture of a series: its number stands where the name says `%d`, or `%04d` for at least four
    /// digits. Nothing if the name has no such place.
    pub fn numbered(&self, number: u32) -> Option<Self> {
        let name = self.path.file_name()?.to_str()?;
        let (before, rest) = name.split_once('%')?;
        let (width, after) = rest.split_once('d')?;
        let width: usize = if width.is_empty() { 0 } else { width.strip_prefix('0')?.parse().ok()? };
        let name = format!("{before}{number:0width$}{after}");
        (width <= DIGITS_MAX).then(|| Self { path: self.path.with_file_name(name), kind: self.kind })
    }

    /// Finds out now, not after the work, whether the file can be written.
    ///
    /// # Errors
    /// Says what is in the way.
    pub fn check(&self) -> anyhow::Result<()> {
        if self.path.is_dir() {
            bail!("{}: is a folder; a picture needs a file name", self.path.display());
        }
        let folder = self.path.parent().filter(|folder| !folder.as_os_str().is_empty());
        if let Some(folder) = folder.filter(|folder| !folder.exists()) {
            bail!("{}: the folder {} is not there; make it, or name another", self.path.display(), folder.display());
        }
        let trial = neighbour(&self.path);
        let created = File::create_new(&trial).with_context(|| format!("{}: cannot be written", self.path.display()));
        created?;
        fs::remove_file(&trial).with_context(|| format!("{}: cannot be removed again", trial.display()))
    }
}

/// Digits that a number is padded to at most.
const DIGITS_MAX: usize = 20;

/// Writes a file under another name in the same folder, and renames it when it is complete: who
/// looks sees the old file or the new one.
///
/// # Errors
/// The operating system's; then the old file, if any, is as it was.
pub fn write_whole(path: &Path, bytes: &[u8]) -> anyhow::Result<()> {
    write_as(path, bytes, OpenOptions::new().write(true).create(true).truncate(true))
}

/// The same, for its owner's eyes only.
///
/// # Errors
/// As [`write_whole`].
pub fn write_secret(path: &Path, bytes: &[u8]) -> anyhow::Result<()> {
    write_as(path, bytes, OpenOptions::new().write(true).create(true).truncate(true).mode(0o600))
}

fn write_as(path: &Path, bytes: &[u8], options: &OpenOptions) -> anyhow::Result<()> {
    let trial = neighbour(path);
    let write = || -> io::Result<()> {
        let mut file = options.open(&trial)?;
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
    use std::os::unix::fs::PermissionsExt;

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
    fn pictures_of_a_series_have_their_number_in_their_name() {
        let numbered = |text: &str| Some(text.parse::<Output>().unwrap().numbered(42)?.path.display().to_string());
        for (pattern, name) in [
            ("a/out.%04d.exr", Some("a/out.0042.exr")),
            ("%d.png", Some("42.png")),
            ("x%01dy.png", Some("x42y.png")),
            ("out.exr", None),
            ("%04d/out.exr", None),
            ("out.%4d.exr", None),
            ("out.%0999d.exr", None),
            ("out.%s.exr", None),
        ] {
            assert_eq!(numbered(pattern).as_deref(), name, "{pattern}");
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
    fn nobody_else_reads_a_secret_whatever_was_there() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("token");
        fs::write(&path, "").unwrap();
        fs::set_permissions(&path, fs::Permissions::from_mode(0o644)).unwrap();
        write_secret(&path, b"secret").unwrap();
        assert_eq!(fs::metadata(&path).unwrap().permissions().mode() & 0o777, 0o600);
        assert_eq!(fs::read_to_string(&path).unwrap(), "secret");
    }

    #[test]
    fn what_cannot_be_written_is_found_out_before_and_leaves_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let output = |name: &str| Output { path: folder.path().join(name), kind: OutputKind::Png };
        let missing = output("missing/a.png").check().unwrap_err().to_string();
        assert!(missing.ends_with("missing is not there; make it, or name another"), "{missing}");
        fs::create_dir(folder.path().join("b.png")).unwrap();
        assert!(output("b.png").check().is_err());
        output("c.png").check().unwrap();
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
    }
}
