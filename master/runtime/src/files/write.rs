//! How files are written: whole or not at all, and tried before there is anything to write.

use std::fs::Permissions;
use std::io::{self, Write};
use std::os::unix::fs::{MetadataExt, PermissionsExt};
use std::path::Path;

use anyhow::{Context, bail};
use tempfile::NamedTempFile;

/// Writes a file under another name in the same folder, and renames it when it is complete: who
/// looks sees the old file or the new one.
///
/// # Errors
/// The operating system's; then the old file, if any, is as it was.
pub fn write_whole(path: &Path, bytes: &[u8]) -> anyhow::Result<()> {
    // As the user's mask has it.
    write_as(path, bytes, 0o666)
}

/// The same, for its owner's eyes only.
///
/// # Errors
/// As [`write_whole`].
pub fn write_secret(path: &Path, bytes: &[u8]) -> anyhow::Result<()> {
    write_as(path, bytes, 0o600)
}

fn write_as(path: &Path, bytes: &[u8], mode: u32) -> anyhow::Result<()> {
    let write = || -> io::Result<()> {
        let mut draft = draft(path, mode)?;
        draft.as_file_mut().write_all(bytes)?;
        draft.as_file().sync_all()?;
        draft.persist(path).map(drop).map_err(|refused| refused.error)
    };
    write().with_context(|| format!("{}: cannot be written", path.display()))
}

/// A new file beside another, under a name that nobody can foresee; it is gone when it is dropped.
fn draft(path: &Path, mode: u32) -> io::Result<NamedTempFile> {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let mut draft = tempfile::Builder::new();
    draft.permissions(Permissions::from_mode(mode));
    draft.prefix(&format!(".{name}.")).suffix(".tmp").tempfile_in(folder_of(path)).map_err(without_name)
}

/// The system's own words, without the name that nobody can foresee: the same trouble has the same words each time.
fn without_name(error: io::Error) -> io::Error {
    let words = error.to_string();
    io::Error::new(error.kind(), words.split(" at path ").next().unwrap_or_default())
}

fn folder_of(path: &Path) -> &Path {
    path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// Makes sure that files can be written beside this one, before there is anything to write.
///
/// # Errors
/// Says what is in the way.
pub fn try_to_write(path: &Path) -> anyhow::Result<()> {
    if path.is_dir() {
        bail!("{}: is a folder; it needs a file name", path.display());
    }
    let folder = folder_of(path);
    if !folder.exists() {
        bail!("{}: the folder {} is not there; make it, or name another", path.display(), folder.display());
    }
    let cannot = || format!("{}: cannot be written", path.display());
    let mut trial = draft(path, 0o600).with_context(cannot)?;
    // A full disk takes names, and no bytes.
    trial.as_file_mut().write_all(&[0; 4096]).and_then(|()| trial.as_file().sync_all()).with_context(cannot)?;
    if let (Ok(there), Ok(folder)) = (path.symlink_metadata(), folder.metadata()) {
        let us = rustix::process::geteuid().as_raw();
        let is_sticky = folder.mode() & STICKY != 0;
        if is_sticky && us != 0 && us != there.uid() && us != folder.uid() {
            bail!("{}: is somebody else's, and cannot be replaced; choose another name", path.display());
        }
    }
    Ok(())
}

/// Of a folder in which files are removed by their owners only, such as /tmp.
const STICKY: u32 = 0o1000;

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

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
    fn a_link_that_somebody_planted_is_replaced_and_not_followed() {
        let folder = tempfile::tempdir().unwrap();
        let [path, victim] = ["a.png", "victim"].map(|name| folder.path().join(name));
        fs::write(&victim, "precious").unwrap();
        std::os::unix::fs::symlink(&victim, &path).unwrap();
        // The name that a draft once had.
        let guess = folder.path().join(format!(".a.png.{}.tmp", std::process::id()));
        std::os::unix::fs::symlink(&victim, &guess).unwrap();
        write_whole(&path, b"picture").unwrap();
        assert_eq!(fs::read_to_string(&victim).unwrap(), "precious");
        assert!(!path.is_symlink());
        assert_eq!(fs::read_to_string(&path).unwrap(), "picture");
    }

    #[test]
    fn what_cannot_be_written_is_found_out_before_and_leaves_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let attempt = |name: &str| try_to_write(&folder.path().join(name));
        let missing = attempt("missing/a.png").unwrap_err().to_string();
        assert!(missing.ends_with("missing is not there; make it, or name another"), "{missing}");
        fs::create_dir(folder.path().join("b.png")).unwrap();
        assert!(attempt("b.png").is_err());
        attempt("c.png").unwrap();
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
    }
}
