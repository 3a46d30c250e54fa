//! A folder that a render can be gone on with from, after a crash of the master.
//!
//! `picture` holds what is drawn so far ([`FrontEnd::keep`]) after the seconds it took; `token` what workers
//! have to know, so that they find their master again.

use std::fs::{self, DirBuilder};
use std::io::ErrorKind;
use std::os::unix::fs::DirBuilderExt;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use anyhow::{Context, anyhow, bail};
use frame::{Chosen, FrontEnd, View};
use protocol::token_file::BYTES_MAX;

use crate::files::{try_to_write, write_secret};

/// Keeps a picture in a folder, now and then.
#[derive(Debug)]
pub struct CheckpointFolder {
    folder: PathBuf,
    every: Duration,
    last: Instant,
    /// How long earlier processes drew.
    before: Duration,
}

impl CheckpointFolder {
    /// A folder, which is made if it is not there, for its owner's eyes only; nothing is kept yet.
    ///
    /// # Errors
    /// The folder cannot be made, or nothing can be written there.
    pub fn new(folder: &Path, every: Duration) -> anyhow::Result<Self> {
        let made = DirBuilder::new().recursive(true).mode(0o700).create(folder);
        made.with_context(|| format!("{}: cannot be made", folder.display()))?;
        let kept = Self { folder: folder.to_owned(), every, last: Instant::now(), before: Duration::ZERO };
        try_to_write(&kept.picture()).context("nothing could be kept")?;
        Ok(kept)
    }

    /// What was drawn of this picture, and how long that took; `None` if nothing was kept.
    ///
    /// # Errors
    /// What is there cannot be read, or is not of this picture.
    pub fn resume(&mut self, method: &Chosen, view: &View) -> anyhow::Result<Option<(Box<dyn FrontEnd>, Duration)>> {
        let path = self.picture();
        let bytes = match fs::read(&path) {
            Ok(bytes) => bytes,
            Err(error) if error.kind() == ErrorKind::NotFound => return Ok(None),
            Err(error) => return Err(anyhow!("{}: cannot be read: {error}", path.display())),
        };
        let resumed = bytes.split_first_chunk().map(|(micros, bytes)| {
            let elapsed = Duration::from_micros(u64::from_le_bytes(*micros));
            method.method.resume(&method.settings, view, bytes).map(|front| (front, elapsed))
        });
        match resumed.unwrap_or(Err(frame::NoCheckpoint::Broken)) {
            Ok((front, before)) => {
                // Time that came to no frame does not count: this attempt has all it needs.
                self.before = if front.frames() > 0 { before } else { Duration::ZERO };
                Ok(Some((front, self.before)))
            }
            Err(reason) => bail!(
                "{}: cannot be gone on with: {reason}; remove it to begin again, or choose another folder",
                path.display()
            ),
        }
    }

    /// The last time that the picture was kept is long ago.
    pub fn is_due(&self) -> bool {
        self.last.elapsed() >= self.every
    }

    /// Keeps the picture, drawn for so long by this process. Who is interrupted here leaves the one before.
    ///
    /// # Errors
    /// The disk does not take it.
    pub fn keep(&mut self, front: &dyn FrontEnd, elapsed: Duration) -> anyhow::Result<()> {
        let Some(picture) = front.keep() else { bail!("this method cannot go on with a picture") };
        let elapsed = (self.before + elapsed).as_micros() as u64;
        let bytes = [&elapsed.to_le_bytes()[..], &picture].concat();
        let kept = write_secret(&self.picture(), &bytes);
        // A slow disk must not stop the drawing.
        self.last = Instant::now();
        kept
    }

    /// The token that was kept here, so that workers find the master that is started again.
    ///
    /// # Errors
    /// It is there and cannot be read.
    pub fn token(&self) -> anyhow::Result<Option<String>> {
        let path = self.token_file();
        if !path.exists() {
            return Ok(None);
        }
        let text = secrets::file::read(&path, BYTES_MAX);
        let text = text.map_err(|reason| anyhow!("{}: cannot be used: {reason}", path.display()))?;
        Ok(Some(text.trim().to_owned()))
    }

    /// Keeps the token, for its owner's eyes only.
    ///
    /// # Errors
    /// The disk does not take it.
    pub fn keep_token(&self, token: &str) -> anyhow::Result<()> {
        write_secret(&self.token_file(), format!("{token}\n").as_bytes())
    }

    /// Where the token is.
    pub fn token_file(&self) -> PathBuf {
        self.folder.join("token")
    }

    fn picture(&self) -> PathBuf {
        self.folder.join("picture")
    }
}
