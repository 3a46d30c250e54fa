//! Secrets in files: for their owner's eyes only, as ssh wants its keys.

use std::fs::File;
use std::io::Read;
use std::os::unix::fs::MetadataExt;
use std::path::Path;

/// Rights of a file that its owner does not have alone.
const OTHERS: u32 = 0o077;

/// Reads a secret.
///
/// # Errors
/// In words: it cannot be read, it has more than so many bytes, or it is our own file and others may read or change it. (A
/// file of somebody else's that we may read is that one's affair: systems put secrets into containers that way.)
pub fn read(path: &Path, bytes_max: u64) -> Result<String, String> {
    let file = File::open(path).map_err(|error| error.to_string())?;
    let about = file.metadata().map_err(|error| error.to_string())?;
    let is_ours = about.is_file() && about.uid() == rustix::process::geteuid().as_raw();
    if is_ours && about.mode() & OTHERS != 0 {
        let (mode, path) = (about.mode() & 0o777, path.display());
        return Err(format!(
            "other users may read or change it (mode {mode:03o}); make it yours alone: chmod 600 {path}"
        ));
    }
    let mut text = String::new();
    file.take(bytes_max + 1).read_to_string(&mut text).map_err(|error| error.to_string())?;
    if text.len() as u64 > bytes_max {
        return Err(format!("it has more than {bytes_max} bytes"));
    }
    Ok(text)
}

#[cfg(test)]
mod tests {
    use std::fs::{self, Permissions};
    use std::os::unix::fs::PermissionsExt;

    use super::*;

    #[test]
    fn a_secret_that_others_may_read_or_change_is_refused_with_the_remedy() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("token");
        fs::write(&path, "secret").unwrap();
        for (mode, is_good) in [(0o600, true), (0o400, true), (0o640, false), (0o604, false), (0o620, false)] {
            fs::set_permissions(&path, Permissions::from_mode(mode)).unwrap();
            match read(&path, 6) {
                Ok(text) => assert!(is_good && text == "secret", "{mode:o}"),
                Err(reason) => {
                    assert!(!is_good && reason.contains(&format!("mode {mode:o}")), "{reason}");
                    assert!(reason.ends_with(&format!("chmod 600 {}", path.display())), "{reason}");
                }
            }
        }
    }

    #[test]
    fn what_is_too_long_or_no_text_is_refused() {
        let file = tempfile::NamedTempFile::new().unwrap();
        fs::write(file.path(), "secret").unwrap();
        assert!(read(file.path(), 5).unwrap_err().contains("more than 5 bytes"));
        fs::write(file.path(), [0xff]).unwrap();
        assert!(read(file.path(), 5).is_err());
        assert!(read(Path::new("/nowhere/at/all"), 5).is_err());
    }
}
