//! Where sessions are kept: in a folder of the user's, each in one of its own, which a master that runs has locked.
//!
//! A session that somebody may still want is never written over: while it is neither taken up nor forgotten, the next
//! master keeps its own in another folder. The file is replaced as a whole, by a thread that nobody waits for.

use std::fs::{self, DirBuilder, File, TryLockError};
use std::os::unix::fs::DirBuilderExt;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;

use protocol::parts::{hash, short};

use super::session::Session;
use crate::display::message::Viewpoint;
use crate::files::{name_of, write_secret};

/// Sessions of one scene that are kept, those of masters that run among them.
const SLOTS_MAX: usize = 16;

/// The folder of one session, ours while this lives.
#[derive(Debug)]
pub struct Slot {
    folder: PathBuf,
    /// Nothing where folders cannot be locked.
    _lock: Option<File>,
}

/// What is there when a master begins.
#[derive(Debug)]
pub struct Opened {
    /// For the session that begins; nothing if all are taken.
    pub own: Option<Slot>,
    /// The sessions of earlier masters, the newest first.
    pub found: Vec<(Slot, Session)>,
    /// The saved views of the newest.
    pub views: Vec<Viewpoint>,
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
        match Session::read(&slot.file()) {
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
        let edited: Vec<(Slot, Session)> = edited;
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
    /// Locks the folder, and makes it if it is not there; nothing if another master has it.
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

    fn file(&self) -> PathBuf {
        self.folder.join("session.json")
    }

    /// Removes the session, and the folder.
    pub fn forget(self) {
        // What is there yet is offered again, and can be forgotten then.
        let _ = fs::remove_file(self.file());
        let _ = fs::remove_dir(&self.folder);
    }
}

/// Writes a session whenever there is a newer state of it.
pub struct Keeper {
    tray: Arc<Tray>,
    thread: Option<JoinHandle<()>>,
}

#[derive(Default)]
struct Tray {
    state: Mutex<State>,
    news: Condvar,
}

#[derive(Default)]
struct State {
    slot: Option<Slot>,
    waiting: Option<Session>,
    closed: bool,
    /// What became of the last one: where it is, or why not.
    outcome: Option<Result<PathBuf, String>>,
}

impl Keeper {
    /// Keeps nothing yet.
    ///
    /// # Errors
    /// The system has no more threads.
    pub fn start(slot: Slot) -> std::io::Result<Self> {
        let tray =
            Arc::new(Tray { state: Mutex::new(State { slot: Some(slot), ..State::default() }), ..Tray::default() });
        let work = Arc::clone(&tray);
        let thread = std::thread::Builder::new().name("keeper".into()).spawn(move || work.work())?;
        Ok(Self { tray, thread: Some(thread) })
    }

    /// A newer state; one that still waits is never written.
    pub fn keep(&self, session: Session) {
        self.tray.lock().waiting = Some(session);
        self.tray.news.notify_one();
    }

    /// Goes on in the folder of another session, which has been taken up: what is kept in this one is in it from the next
    /// state on.
    pub fn go_on_in(&self, slot: Slot) {
        if let Some(before) = self.tray.lock().slot.replace(slot) {
            before.forget();
        }
    }

    /// Why the last state could not be kept, if it could not.
    pub fn trouble(&self) -> Option<String> {
        self.tray.lock().outcome.as_ref()?.as_ref().err().cloned()
    }

    /// Writes what still waits; where the session is, nothing if it is empty.
    ///
    /// # Errors
    /// In words, why it could not be kept.
    pub fn finish(mut self) -> Result<Option<PathBuf>, String> {
        self.close();
        let mut state = self.tray.lock();
        let outcome = state.outcome.take();
        if let Some(slot) = state.slot.take() {
            // Only if there is nothing in it.
            let _ = fs::remove_dir(&slot.folder);
        }
        outcome.transpose().map(|path| path.filter(|path| path.exists()))
    }

    fn close(&mut self) {
        self.tray.lock().closed = true;
        self.tray.news.notify_one();
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

impl Drop for Keeper {
    fn drop(&mut self) {
        self.close();
    }
}

impl Tray {
    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn work(&self) {
        loop {
            let is_idle = |state: &mut State| !state.closed && state.waiting.is_none();
            let mut state = self.news.wait_while(self.lock(), is_idle).unwrap_or_else(PoisonError::into_inner);
            let (Some(mut session), Some(slot)) = (state.waiting.take(), &state.slot) else { return };
            let file = slot.file();
            drop(state);
            let outcome = write(&file, &mut session).map(|()| file.clone()).map_err(|error| format!("{error:#}"));
            let mut state = self.lock();
            if state.slot.as_ref().is_none_or(|slot| slot.file() != file) {
                // It was taken up elsewhere meanwhile: what was written here is in there.
                let _ = fs::remove_file(&file);
                let _ = file.parent().map(fs::remove_dir);
            }
            state.outcome = Some(outcome);
        }
    }
}

/// Replaces the file; a session without anything in it needs none.
fn write(file: &Path, session: &mut Session) -> anyhow::Result<()> {
    if session.has_edits() || !session.views.is_empty() {
        return write_secret(file, &session.encode()?);
    }
    match fs::remove_file(file) {
        Err(error) if error.kind() != std::io::ErrorKind::NotFound => Err(error.into()),
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use std::os::unix::fs::PermissionsExt;

    use super::super::session::tests::session;
    use super::*;

    #[test]
    fn a_session_is_kept_for_its_owner_and_found_again() {
        let folder = tempfile::tempdir().unwrap();
        let scene = Path::new("scenes/cornell");
        let open = || open(Some(folder.path()), scene).unwrap();
        let first = open();
        assert!(first.found.is_empty() && first.broken.is_empty());
        let keeper = Keeper::start(first.own.unwrap()).unwrap();
        (1..=20).for_each(|saved| keeper.keep(Session { saved, ..session() }));
        // While it runs, another master has a session of its own.
        let other = open();
        assert!(other.found.is_empty());
        let kept = Keeper::start(other.own.unwrap()).unwrap();
        kept.keep(Session { saved: 99, ..session() });
        kept.finish().unwrap().unwrap();
        let path = keeper.finish().unwrap().unwrap();
        assert_eq!(fs::metadata(&path).unwrap().permissions().mode() & 0o777, 0o600);
        assert_eq!(fs::metadata(path.parent().unwrap()).unwrap().permissions().mode() & 0o777, 0o700);
        let again = open();
        assert_eq!(again.found.iter().map(|(_, session)| session.saved).collect::<Vec<_>>(), [99, 20]);
        assert!(again.own.is_some(), "nothing is written over that nobody has answered for");
        assert!(super::open(Some(folder.path()), Path::new("scenes/sponza")).unwrap().found.is_empty());
    }

    #[test]
    fn a_session_that_is_taken_up_is_gone_on_with_where_it_is() {
        let folder = tempfile::tempdir().unwrap();
        let open = || open(Some(folder.path()), Path::new("a.obj")).unwrap();
        let before = Keeper::start(open().own.unwrap()).unwrap();
        before.keep(session());
        before.finish().unwrap();
        let mut opened = open();
        let keeper = Keeper::start(opened.own.unwrap()).unwrap();
        keeper.keep(Session { saved: 3, ..session() });
        keeper.go_on_in(opened.found.remove(0).0);
        keeper.keep(Session { saved: 4, ..session() });
        keeper.finish().unwrap();
        let found = open().found;
        assert_eq!(found.iter().map(|(_, session)| session.saved).collect::<Vec<_>>(), [4]);
        found.into_iter().for_each(|(slot, _)| slot.forget());
        drop(open());
        assert!(open().found.is_empty());
    }

    #[test]
    fn an_empty_session_leaves_no_file_and_a_broken_one_is_left_alone() {
        let folder = tempfile::tempdir().unwrap();
        let open = || open(Some(folder.path()), Path::new("a.obj")).unwrap();
        let keeper = Keeper::start(open().own.unwrap()).unwrap();
        keeper.keep(Session { edits: Vec::new(), views: Vec::new(), ..session() });
        assert_eq!(keeper.finish(), Ok(None));
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
        let slot = open().own.unwrap();
        fs::write(slot.file(), "{\"igi_kept\": 1").unwrap();
        let file = slot.file();
        drop(slot);
        let opened = open();
        assert!(opened.found.is_empty() && opened.broken[0].contains("session.json") && opened.own.is_some());
        assert!(file.exists());
        // A disk that cannot be written to.
        let keeper = Keeper::start(opened.own.unwrap()).unwrap();
        fs::remove_dir_all(folder.path()).unwrap();
        keeper.keep(session());
        assert!(keeper.finish().unwrap_err().contains("cannot be written"));
    }

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
