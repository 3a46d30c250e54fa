//! A folder that a render can be gone on with from, after a crash of the master.
//!
//! `picture` holds what is drawn so far ([`Igi::checkpoint`]) after the seconds it took; `token` what workers
//! have to know, so that they find their master again.

use std::fs;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use anyhow::{Context, anyhow, bail};
use frame::{Igi, Setup};

use crate::files::{write_secret, write_whole};

/// Keeps a picture in a folder, now and then.
#[derive(Debug)]
pub struct Keeper {
    folder: PathBuf,
    every: Duration,
    last: Instant,
    /// How long earlier processes drew.
    before: Duration,
}

impl Keeper {
    /// A folder, which is made if it is not there; nothing is written yet.
    ///
    /// # Errors
    /// The folder cannot be made.
    pub fn new(folder: &Path, every: Duration) -> anyhow::Result<Self> {
        fs::create_dir_all(folder).with_context(|| format!("{}: cannot be made", folder.display()))?;
        Ok(Self { folder: folder.to_owned(), every, last: Instant::now(), before: Duration::ZERO })
    }

    /// What was drawn of this picture, and how long that took; nothing if nothing was kept.
    ///
    /// # Errors
    /// What is there cannot be read, or is not of this picture.
    pub fn resume(&mut self, setup: &Setup) -> anyhow::Result<Option<(Igi, Duration)>> {
        let path = self.picture();
        let bytes = match fs::read(&path) {
            Ok(bytes) => bytes,
            Err(error) if error.kind() == ErrorKind::NotFound => return Ok(None),
            Err(error) => return Err(anyhow!("{}: cannot be read: {error}", path.display())),
        };
        let resumed = bytes.split_first_chunk().map(|(micros, bytes)| {
            let elapsed = Duration::from_micros(u64::from_le_bytes(*micros));
            Igi::resume(setup.clone(), bytes).map(|igi| (igi, elapsed))
        });
        match resumed.unwrap_or(Err(frame::NoCheckpoint::Broken)) {
            Ok((igi, before)) => {
                self.before = before;
                Ok(Some((igi, before)))
            }
            Err(reason) => bail!(
                "{}: cannot be gone on with: {reason}; remove it to begin again, or choose another folder",
                path.display()
            ),
        }
    }

    /// Keeps the picture, drawn for so long by this process, if the last time is long ago.
    ///
    /// # Errors
    /// As [`Self::keep`].
    pub fn keep_if_due(&mut self, front: &Igi, elapsed: Duration) -> anyhow::Result<()> {
        if self.last.elapsed() < self.every { Ok(()) } else { self.keep(front, elapsed) }
    }

    /// Keeps the picture. Who is interrupted here leaves the one before.
    ///
    /// # Errors
    /// The disk does not take it.
    pub fn keep(&mut self, front: &Igi, elapsed: Duration) -> anyhow::Result<()> {
        let elapsed = (self.before + elapsed).as_micros() as u64;
        let bytes = [&elapsed.to_le_bytes()[..], &front.checkpoint()].concat();
        let kept = write_whole(&self.picture(), &bytes);
        // A slow disk must not stop the drawing.
        self.last = Instant::now();
        kept
    }

    /// The token that was kept here, so that workers find the master that is started again.
    ///
    /// # Errors
    /// It is there and cannot be read.
    pub fn token(&self) -> anyhow::Result<Option<String>> {
        let path = self.folder.join(TOKEN);
        match fs::read_to_string(&path) {
            Ok(token) => Ok(Some(token.trim().to_owned())),
            Err(error) if error.kind() == ErrorKind::NotFound => Ok(None),
            Err(error) => Err(anyhow!("{}: cannot be read: {error}", path.display())),
        }
    }

    /// Keeps the token, for its owner's eyes only.
    ///
    /// # Errors
    /// The disk does not take it.
    pub fn keep_token(&self, token: &str) -> anyhow::Result<()> {
        write_secret(&self.folder.join(TOKEN), format!("{token}\n").as_bytes())
    }

    fn picture(&self) -> PathBuf {
        self.folder.join("picture")
    }
}

const TOKEN: &str = "token";
