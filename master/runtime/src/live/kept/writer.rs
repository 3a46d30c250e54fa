//! Writes the session that is kept: the file is replaced as a whole, by a thread that the session does not wait for.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;

use super::KeptSession;
use super::folder::Slot;
use crate::files::write_secret;

/// Writes a session whenever there is a newer state of it, on a thread of its own.
pub struct Writer {
    mailbox: Arc<Mailbox>,
    thread: Option<JoinHandle<()>>,
}

#[derive(Default)]
struct Mailbox {
    contents: Mutex<Contents>,
    changed: Condvar,
}

#[derive(Default)]
struct Contents {
    slot: Option<Slot>,
    waiting: Option<KeptSession>,
    closed: bool,
    /// What became of the last state: where it is, or why it could not be written.
    outcome: Option<Result<PathBuf, String>>,
}

impl Writer {
    /// Starts the thread.
    ///
    /// # Errors
    /// The system has no more threads.
    pub fn start(slot: Slot) -> std::io::Result<Self> {
        let contents = Mutex::new(Contents { slot: Some(slot), ..Contents::default() });
        let mailbox = Arc::new(Mailbox { contents, ..Mailbox::default() });
        let work = Arc::clone(&mailbox);
        let thread = std::thread::Builder::new().name("writer".into()).spawn(move || work.work())?;
        Ok(Self { mailbox, thread: Some(thread) })
    }

    /// A newer state; one that still waits is never written.
    pub fn write(&self, session: KeptSession) {
        self.mailbox.lock().waiting = Some(session);
        self.mailbox.changed.notify_one();
    }

    /// Goes on in the folder of another session, which has been taken up: the next state holds what is kept in both.
    pub fn go_on_in(&self, slot: Slot) {
        if let Some(before) = self.mailbox.lock().slot.replace(slot) {
            before.forget();
        }
    }

    /// Why the last state could not be written; `None` if it could.
    pub fn trouble(&self) -> Option<String> {
        self.mailbox.lock().outcome.as_ref()?.as_ref().err().cloned()
    }

    /// Writes what still waits, and returns where the session is; `None` if it is empty.
    ///
    /// # Errors
    /// In words, why it could not be written.
    pub fn finish(mut self) -> Result<Option<PathBuf>, String> {
        self.close();
        let mut contents = self.mailbox.lock();
        let outcome = contents.outcome.take();
        if let Some(slot) = contents.slot.take() {
            slot.remove_if_empty();
        }
        outcome.transpose().map(|path| path.filter(|path| path.exists()))
    }

    fn close(&mut self) {
        self.mailbox.lock().closed = true;
        self.mailbox.changed.notify_one();
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

impl Drop for Writer {
    fn drop(&mut self) {
        self.close();
    }
}

impl Mailbox {
    fn lock(&self) -> MutexGuard<'_, Contents> {
        self.contents.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn work(&self) {
        loop {
            let is_idle = |contents: &mut Contents| !contents.closed && contents.waiting.is_none();
            let mut contents = self.changed.wait_while(self.lock(), is_idle).unwrap_or_else(PoisonError::into_inner);
            let (Some(mut session), Some(slot)) = (contents.waiting.take(), &contents.slot) else { return };
            let file = slot.file();
            drop(contents);
            let outcome = write(&file, &mut session).map(|()| file.clone()).map_err(|error| format!("{error:#}"));
            let mut contents = self.lock();
            if contents.slot.as_ref().is_none_or(|slot| slot.file() != file) {
                // It was taken up elsewhere meanwhile: what was written here is in there.
                let _ = fs::remove_file(&file);
                let _ = file.parent().map(fs::remove_dir);
            }
            contents.outcome = Some(outcome);
        }
    }
}

/// Replaces the file; an empty session needs none.
fn write(file: &Path, session: &mut KeptSession) -> anyhow::Result<()> {
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

    use super::super::folder;
    use super::super::tests::session;
    use super::*;

    #[test]
    fn a_session_is_kept_for_its_owner_and_found_again() {
        let user = tempfile::tempdir().unwrap();
        let scene = Path::new("scenes/cornell");
        let open = || folder::open(Some(user.path()), scene).unwrap();
        let first = open();
        assert!(first.found.is_empty() && first.broken.is_empty());
        let writer = Writer::start(first.own.unwrap()).unwrap();
        (1..=20).for_each(|saved| writer.write(KeptSession { saved, ..session() }));
        // While it runs, another master has a session of its own.
        let other = open();
        assert!(other.found.is_empty());
        let kept = Writer::start(other.own.unwrap()).unwrap();
        kept.write(KeptSession { saved: 99, ..session() });
        kept.finish().unwrap().unwrap();
        let path = writer.finish().unwrap().unwrap();
        assert_eq!(fs::metadata(&path).unwrap().permissions().mode() & 0o777, 0o600);
        assert_eq!(fs::metadata(path.parent().unwrap()).unwrap().permissions().mode() & 0o777, 0o700);
        let again = open();
        assert_eq!(again.found.iter().map(|(_, session)| session.saved).collect::<Vec<_>>(), [99, 20]);
        assert!(again.own.is_some(), "none is written over before people have answered for it");
        assert!(folder::open(Some(user.path()), Path::new("scenes/sponza")).unwrap().found.is_empty());
    }

    #[test]
    fn a_session_that_is_taken_up_is_gone_on_with_where_it_is() {
        let user = tempfile::tempdir().unwrap();
        let open = || folder::open(Some(user.path()), Path::new("a.obj")).unwrap();
        let before = Writer::start(open().own.unwrap()).unwrap();
        before.write(session());
        before.finish().unwrap();
        let mut opened = open();
        let writer = Writer::start(opened.own.unwrap()).unwrap();
        writer.write(KeptSession { saved: 3, ..session() });
        writer.go_on_in(opened.found.remove(0).0);
        writer.write(KeptSession { saved: 4, ..session() });
        writer.finish().unwrap();
        let found = open().found;
        assert_eq!(found.iter().map(|(_, session)| session.saved).collect::<Vec<_>>(), [4]);
        found.into_iter().for_each(|(slot, _)| slot.forget());
        drop(open());
        assert!(open().found.is_empty());
    }

    #[test]
    fn an_empty_session_leaves_no_file_and_a_broken_one_is_left_alone() {
        let user = tempfile::tempdir().unwrap();
        let open = || folder::open(Some(user.path()), Path::new("a.obj")).unwrap();
        let writer = Writer::start(open().own.unwrap()).unwrap();
        writer.write(KeptSession { edits: Vec::new(), views: Vec::new(), ..session() });
        assert_eq!(writer.finish(), Ok(None));
        assert_eq!(fs::read_dir(user.path()).unwrap().count(), 0);
        let slot = open().own.unwrap();
        fs::write(slot.file(), "{\"igi_kept\": 1").unwrap();
        let file = slot.file();
        drop(slot);
        let opened = open();
        assert!(opened.found.is_empty() && opened.broken[0].contains("session.json") && opened.own.is_some());
        assert!(file.exists());
        // A disk that cannot be written to.
        let writer = Writer::start(opened.own.unwrap()).unwrap();
        fs::remove_dir_all(user.path()).unwrap();
        writer.write(session());
        assert!(writer.finish().unwrap_err().contains("cannot be written"));
    }
}
