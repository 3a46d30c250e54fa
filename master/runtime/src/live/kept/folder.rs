//! Where sessions are kept: in a folder of the user's, each in one of its own, which a master that runs has locked.
//!
//! A session that people may still want is never written over: until it is taken up or forgotten, the next master keeps
//! its own in another folder.

use std::fs::{self, DirBuilder, File, TryLockError};
use std::os::unix::fs::DirBuilderExt;
use std::path::{Path, PathBuf};

use protocol::parts::{hash, short};
use scenes::SavedView;

use super::KeptSession;
use crate::files::name_of;

/// Sessions of one scene that are kept, those of masters that run among them.
const SLOTS_MAX: usize = 16;

/// The folder of one session, ours while this lives.
#[derive(Debug)]
pub struct Slot {
    folder: PathBuf,
    /// `None` where folders cannot be locked.
    _lock: Option<File>,
}

/// What is there when a master begins.
#[derive(Debug)]
pub struct Opened {
    /// For the session that begins; `None` if all are taken.
    pub own: Option<Slot>,
    /// The sessions of earlier masters, the newest first.
    pub found: Vec<(Slot, KeptSession)>,
    /// The saved views of the newest.
    pub views: Vec<SavedView>,
    /// Files that are no sessions: they are left as they are.
    pub broken: Vec<String>,
}

/// Looks for sessions of a scene in the user's folder, and makes room for one more.
///
/// # Errors
/// In words: there is no such folder, or it cannot be written to.
pub fn open(sessions: Option<&Path>, scene: &Path) -> Result<Opened, String> {
    let sessions = sessions.ok_or("neither HOME nor XDG_STATE_HOME names a folder")?;
    let path = scene.canonicalize().unwrap_or_else(|_| scene.to_path_buf());
    let digits = short(&hash(path.as_os_str().as_encoded_bytes()));
    let name: String = name_of(scene).chars().filter(|c| c.is_alphanumeric()).take(NAME_MAX).collect();
    let mut opened = Opened { own: None, found: Vec::new(), views: Vec::new(), broken: Vec::new() };
    for number in 1..=SLOTS_MAX {
        let folder = sessions.join(format!("{name}-{digits}-{number}"));
        if !folder.is_dir() {
            if opened.own.is_none() {
                opened.own = Slot::take(folder)?;
            }
            continue;
        }
        let Some(slot) = Slot::take(folder)? else { continue };
        if !slot.file().exists() {
            opened.own.get_or_insert(slot);
            continue;
        }
        match KeptSession::read(&slot.file()) {
            Ok(session) => opened.found.push((slot, session)),
            Err(error) => opened.broken.push(format!("{error:#}")),
        }
    }
    opened.found.sort_by_key(|(_, session)| std::cmp::Reverse(session.saved));
    opened.views = opened.found.first().map_or(Vec::new(), |(_, session)| session.views.clone());
    Ok(opened)
}

impl Opened {
    /// Forgets all edits; how many.
    pub fn forget_edits(&mut self) -> usize {
        let (edited, others) =
            std::mem::take(&mut self.found).into_iter().partition(|(_, session)| session.has_edits());
        self.found = others;
        let edited: Vec<(Slot, KeptSession)> = edited;
        edited.into_iter().map(|(slot, session)| (slot.forget(), session.edits.len()).1).sum()
    }
}

/// Letters of a scene's name that folders have.
const NAME_MAX: usize = 40;

/// The user's folder for sessions, where the system has one for what programs remember.
pub fn sessions(variable: impl Fn(&str) -> Option<PathBuf>) -> Option<PathBuf> {
    let folder = |name: &str| variable(name).filter(|path| path.is_absolute());
    let home = |inner: &str| folder("HOME").map(|home| home.join(inner));
    let state = folder("XDG_STATE_HOME");
    let kept = match cfg!(target_os = "macos") {
        true => state.or_else(|| home("Library/Application Support")),
        false => state.or_else(|| home(".local/state")),
    };
    kept.map(|folder| folder.join("igi").join("sessions"))
}

impl Slot {
    /// Locks the folder, and makes it if it is not there; `None` if another master has it.
    fn take(folder: PathBuf) -> Result<Option<Self>, String> {
        let cannot = |error: std::io::Error| format!("{}: {error}", folder.display());
        DirBuilder::new().recursive(true).mode(0o700).create(&folder).map_err(cannot)?;
        let lock = File::open(&folder).map_err(cannot)?;
        let lock = match lock.try_lock() {
            Ok(()) => Some(lock),
            Err(TryLockError::WouldBlock) => return Ok(None),
            // Some file systems know no locks: two masters of one scene may then share a session.
            Err(TryLockError::Error(_)) => None,
        };
        Ok(Some(Self { folder, _lock: lock }))
    }

    /// Where the session is, or will be.
    pub(super) fn file(&self) -> PathBuf {
        self.folder.join("session.json")
    }

    /// Removes the folder, if there is no session in it.
    pub(super) fn remove_if_empty(self) {
        let _ = fs::remove_dir(&self.folder);
    }

    /// Removes the session, and the folder.
    pub fn forget(self) {
        // What is there yet is offered again, and can be forgotten then.
        let _ = fs::remove_file(self.file());
        let _ = fs::remove_dir(&self.folder);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    #[cfg(target_os = "linux")]
    fn the_folder_is_where_the_system_says() {
        let given = |known: &'static [(&str, &str)]| {
            sessions(|variable| known.iter().find(|(name, _)| *name == variable).map(|(_, path)| path.into()))
        };
        assert_eq!(given(&[("HOME", "/home/a")]), Some("/home/a/.local/state/igi/sessions".into()));
        let both = given(&[("HOME", "/home/a"), ("XDG_STATE_HOME", "/var/a")]);
        assert_eq!(both, Some("/var/a/igi/sessions".into()));
        assert_eq!(given(&[("XDG_STATE_HOME", "relative")]), None);
    }
}
