//! Scene parts by content: in memory for the world being built, and on disk if the user gives us a folder.
//!
//! A folder may be shared by any number of workers of one machine, at the same time: files are
//! written under another name and moved into place whole, and what is read is believed only if its
//! hash is right.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use protocol::parts::{Blob, Hash, Manifest, hash, join};
use scenes::Scene;

use crate::engine::Store;

/// Parts of scenes that need not be fetched again.
#[derive(Debug, Default)]
pub struct Shelf {
    folder: Option<PathBuf>,
    memory: Mutex<BTreeMap<Hash, Arc<[u8]>>>,
}

impl Shelf {
    /// A shelf that lasts as long as this value.
    pub fn in_memory() -> Self {
        Self::default()
    }

    /// A shelf in a folder, which is made if it is not there.
    ///
    /// # Errors
    /// The folder cannot be made.
    pub fn in_folder(folder: &Path) -> std::io::Result<Self> {
        fs::create_dir_all(folder)?;
        Ok(Self { folder: Some(folder.to_owned()), ..Self::default() })
    }

    /// The bytes of a part, if they are here and whole.
    fn get(&self, wanted: &Hash) -> Option<Arc<[u8]>> {
        if let Some(bytes) = self.memory().get(wanted) {
            return Some(Arc::clone(bytes));
        }
        let path = self.path(wanted)?;
        let bytes: Arc<[u8]> = fs::read(&path).ok()?.into();
        if hash(&bytes) != *wanted {
            tracing::warn!("{} is damaged: it will be fetched again", path.display());
            let _ = fs::remove_file(&path);
            return None;
        }
        self.memory().insert(*wanted, Arc::clone(&bytes));
        Some(bytes)
    }

    fn path(&self, part: &Hash) -> Option<PathBuf> {
        let name: String = part.iter().map(|byte| format!("{byte:02x}")).collect();
        self.folder.as_ref().map(|folder| folder.join(&name[..2]).join(format!("{name}.part")))
    }

    fn memory(&self) -> MutexGuard<'_, BTreeMap<Hash, Arc<[u8]>>> {
        self.memory.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Store for Shelf {
    fn look(&self, world: &Hash) -> (Vec<Hash>, u32) {
        let Some(manifest) = self.get(world) else { return (vec![*world], 0) };
        // A manifest that cannot be read is no use to fetch again: `scene` says what is wrong.
        let Ok(manifest) = Manifest::parse(&manifest) else { return (Vec::new(), 0) };
        let parts = manifest.parts();
        // What belongs to other worlds only makes room for this one.
        self.memory().retain(|part, _| part == world || parts.contains(part));
        let missing = parts.iter().filter(|part| self.get(part).is_none()).copied().collect();
        (missing, parts.len() as u32)
    }

    fn put(&self, part: Blob) -> Result<(), String> {
        let Blob { hash, bytes } = part;
        if let Some(path) = self.path(&hash)
            && let Err(error) = write_whole(&path, &bytes)
        {
            tracing::warn!("{} cannot be written ({error}): this part of the scene is not kept", path.display());
        }
        self.memory().insert(hash, bytes.into());
        Ok(())
    }

    fn scene(&self, world: &Hash) -> Result<Arc<Scene>, String> {
        let manifest = self.get(world).ok_or("the list of its parts is missing")?;
        let manifest = Manifest::parse(&manifest).map_err(|error| error.to_string())?;
        let scene = join(&manifest, |part| self.get(part)).map_err(|error| error.to_string())?;
        if self.folder.is_some() {
            // The disk has them.
            self.memory().clear();
        }
        Ok(Arc::new(scene))
    }
}

/// Nobody ever sees half of the file.
fn write_whole(path: &Path, bytes: &[u8]) -> std::io::Result<()> {
    static COUNTER: AtomicU64 = AtomicU64::new(0);
    if let Some(folder) = path.parent() {
        fs::create_dir_all(folder)?;
    }
    let number = COUNTER.fetch_add(1, Ordering::Relaxed);
    let draft = path.with_extension(format!("{}-{number}.tmp", std::process::id()));
    let written = fs::write(&draft, bytes).and_then(|()| fs::rename(&draft, path));
    if written.is_err() {
        let _ = fs::remove_file(&draft);
    }
    written
}

#[cfg(test)]
mod tests {
    use protocol::parts::split;

    use super::*;

    fn blobs() -> (Hash, Vec<Blob>) {
        let scene = Scene { name: "empty".into(), ..Scene::default() };
        let (manifest, mut blobs) = split(&scene).unwrap();
        let manifest = manifest.blob();
        let world = manifest.hash;
        blobs.push(manifest);
        (world, blobs)
    }

    #[test]
    fn a_scene_is_built_from_what_was_put() {
        let shelf = Shelf::in_memory();
        let (world, blobs) = blobs();
        assert_eq!(shelf.look(&world), (vec![world], 0));
        shelf.put(blobs[1].clone()).unwrap();
        assert_eq!(shelf.look(&world), (vec![blobs[0].hash], 1));
        shelf.put(blobs[0].clone()).unwrap();
        assert_eq!(shelf.look(&world), (vec![], 1));
        assert_eq!(shelf.scene(&world).unwrap().name, "empty");
    }

    #[test]
    fn a_folder_outlives_the_worker_and_damage_is_noticed() {
        let folder = tempfile::tempdir().unwrap();
        let (world, blobs) = blobs();
        let first = Shelf::in_folder(folder.path()).unwrap();
        blobs.iter().for_each(|blob| first.put(blob.clone()).unwrap());

        let second = Shelf::in_folder(folder.path()).unwrap();
        assert_eq!(second.look(&world), (vec![], 1));
        assert_eq!(second.scene(&world).unwrap().name, "empty");

        fs::write(second.path(&blobs[0].hash).unwrap(), b"igiL and rubbish").unwrap();
        let third = Shelf::in_folder(folder.path()).unwrap();
        assert_eq!(third.look(&world), (vec![blobs[0].hash], 1));
        assert!(!third.path(&blobs[0].hash).unwrap().exists());
    }

    #[test]
    fn a_folder_that_cannot_be_written_costs_only_the_keeping() {
        let folder = tempfile::tempdir().unwrap();
        let (world, blobs) = blobs();
        let shelf = Shelf::in_folder(folder.path()).unwrap();
        // A file where a folder is needed.
        blobs.iter().for_each(|blob| {
            let path = shelf.path(&blob.hash).unwrap();
            let _ = fs::write(path.parent().unwrap(), b"in the way");
            shelf.put(blob.clone()).unwrap();
        });
        assert_eq!(shelf.look(&world), (vec![], 1));
        assert!(shelf.scene(&world).is_ok());
    }
}
