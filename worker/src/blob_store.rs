//! Scene parts by content: in memory for the world being built, and on disk if the user gives us a folder.
//!
//! A folder may be shared by any number of workers of one machine, at the same time: files are
//! written under another name and moved into place whole, and what is read is believed only if its
//! hash is right.

use std::collections::BTreeMap;
use std::ffi::OsStr;
use std::fs;
use std::io::{ErrorKind, Write};
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, SystemTime};

use protocol::parts::{Blob, Hash, Manifest, hash, join};
use scenes::Scene;

use crate::engine::Store;

/// Parts of scenes that need not be fetched again.
#[derive(Debug, Default)]
pub struct BlobStore {
    folder: Option<PathBuf>,
    memory: Mutex<Parts>,
}

/// Scene parts by their content's hash.
pub type Parts = BTreeMap<Hash, Arc<[u8]>>;

/// Most that a folder keeps between worlds, bytes: a score of large scenes.
pub const FOLDER_MAX: u64 = 8 << 30;
/// Drafts older than this belong to nobody any more.
const DRAFT_OLD: Duration = Duration::from_secs(3600);

impl BlobStore {
    /// A store that lasts as long as this value.
    pub fn in_memory() -> Self {
        Self::default()
    }

    /// A store in a folder, which is made if it is not there.
    ///
    /// # Errors
    /// The folder cannot be made.
    pub fn in_folder(folder: &Path) -> std::io::Result<Self> {
        fs::create_dir_all(folder)?;
        make_room(folder, FOLDER_MAX);
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
        // What was used last goes last.
        let _ = fs::File::open(&path).and_then(|file| file.set_modified(SystemTime::now()));
        self.memory().insert(*wanted, Arc::clone(&bytes));
        Some(bytes)
    }

    /// The manifest of a world nothing of which is missing, and every part of it, the manifest among them.
    ///
    /// # Errors
    /// What is missing or wrong.
    pub fn whole(&self, world: &Hash) -> Result<(Manifest, Parts), String> {
        let bytes = self.get(world).ok_or("the list of its parts is missing")?;
        let manifest = Manifest::parse(&bytes).map_err(|error| error.to_string())?;
        let part = |hash: &Hash| Ok((*hash, self.get(hash).ok_or("a part of it is missing")?));
        let mut parts = manifest.parts().iter().map(part).collect::<Result<BTreeMap<_, _>, String>>()?;
        parts.insert(*world, bytes);
        Ok((manifest, parts))
    }

    fn path(&self, part: &Hash) -> Option<PathBuf> {
        let name: String = part.iter().map(|byte| format!("{byte:02x}")).collect();
        self.folder.as_ref().map(|folder| folder.join(&name[..2]).join(format!("{name}.part")))
    }

    fn memory(&self) -> MutexGuard<'_, Parts> {
        self.memory.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Store for BlobStore {
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
        if let Some(folder) = &self.folder {
            // The disk has them.
            self.memory().clear();
            make_room(folder, FOLDER_MAX);
        }
        Ok(Arc::new(scene))
    }
}

/// Removes parts from a folder until it holds no more than so many bytes, those first that were not used for longest, and
/// what is left of drafts. Other workers of the machine may do the same: what is gone is fetched again.
fn make_room(folder: &Path, most: u64) {
    let now = SystemTime::now();
    let mut parts = Vec::new();
    let entries = |folder: &Path| fs::read_dir(folder).into_iter().flatten().flatten();
    for file in entries(folder).flat_map(|entry| entries(&entry.path()).collect::<Vec<_>>()) {
        let (path, Ok(meta)) = (file.path(), file.metadata()) else { continue };
        if !is_ours(&path) {
            continue;
        }
        let Ok(used) = meta.modified() else { continue };
        match path.extension().and_then(|extension| extension.to_str()) {
            Some("part") => parts.push((used, meta.len(), path)),
            Some("tmp") if now.duration_since(used).is_ok_and(|age| age > DRAFT_OLD) => _ = fs::remove_file(&path),
            _ => {}
        }
    }
    parts.sort();
    let mut sum: u64 = parts.iter().map(|(_, length, _)| length).sum();
    for (_, length, path) in parts {
        if sum <= most {
            return;
        }
        if fs::remove_file(&path).is_ok() {
            sum -= length;
        }
    }
}

/// Whether a file is named as parts and their drafts are; the folder may be one that has others, too.
fn is_ours(path: &Path) -> bool {
    let word = |path: &Path| path.file_name().and_then(|name| name.to_str()).map(str::to_owned);
    let (Some(file), Some(folder)) = (word(path), path.parent().and_then(word)) else { return false };
    let hash = file.split('.').next().unwrap_or_default();
    let digits = hash.bytes().all(|byte| matches!(byte, b'0'..=b'9' | b'a'..=b'f'));
    digits && hash.len() == 2 * size_of::<Hash>() && folder == hash[..2]
}

/// Nobody ever sees half of the file.
fn write_whole(path: &Path, bytes: &[u8]) -> std::io::Result<()> {
    let (Some(folder), Some(name)) = (path.parent(), path.file_stem().and_then(OsStr::to_str)) else {
        return Err(ErrorKind::InvalidInput.into());
    };
    fs::create_dir_all(folder)?;
    // Under a name that nobody can foresee; workers may share the folder.
    let mut draft = tempfile::Builder::new();
    draft.permissions(fs::Permissions::from_mode(0o666));
    let mut draft = draft.prefix(&format!("{name}.")).suffix(".tmp").tempfile_in(folder)?;
    draft.write_all(bytes)?;
    draft.persist(path).map(drop).map_err(|refused| refused.error)
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
        let store = BlobStore::in_memory();
        let (world, blobs) = blobs();
        assert_eq!(store.look(&world), (vec![world], 0));
        store.put(blobs[1].clone()).unwrap();
        assert_eq!(store.look(&world), (vec![blobs[0].hash], 1));
        store.put(blobs[0].clone()).unwrap();
        assert_eq!(store.look(&world), (vec![], 1));
        assert_eq!(store.scene(&world).unwrap().name, "empty");
    }

    #[test]
    fn a_folder_outlives_the_worker_and_damage_is_noticed() {
        let folder = tempfile::tempdir().unwrap();
        let (world, blobs) = blobs();
        let first = BlobStore::in_folder(folder.path()).unwrap();
        blobs.iter().for_each(|blob| first.put(blob.clone()).unwrap());

        let second = BlobStore::in_folder(folder.path()).unwrap();
        assert_eq!(second.look(&world), (vec![], 1));
        assert_eq!(second.scene(&world).unwrap().name, "empty");

        fs::write(second.path(&blobs[0].hash).unwrap(), b"igiL and rubbish").unwrap();
        let third = BlobStore::in_folder(folder.path()).unwrap();
        assert_eq!(third.look(&world), (vec![blobs[0].hash], 1));
        assert!(!third.path(&blobs[0].hash).unwrap().exists());
    }

    #[test]
    fn what_was_not_used_for_longest_makes_room() {
        let folder = tempfile::tempdir().unwrap();
        let store = BlobStore::in_folder(folder.path()).unwrap();
        let [old, new, older] = [1, 2, 3].map(|number| store.path(&[number; 32]).unwrap());
        let [dead, fresh] = ["1-0.tmp", "2-0.tmp"].map(|extension| old.with_extension(extension));
        // A browser's half of a file, and somebody's notes, in a folder that was not made for us.
        let others = ["downloads/film.part", "01/notes.tmp"].map(|name| folder.path().join(name));
        let now = SystemTime::now();
        let files = [(&old, 90), (&new, 10), (&older, 7200), (&dead, 7200), (&fresh, 9)];
        for (path, age) in files.into_iter().chain(others.iter().map(|path| (path, 9999))) {
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            fs::write(path, [0; 100]).unwrap();
            let file = fs::File::options().write(true).open(path).unwrap();
            file.set_modified(now - Duration::from_secs(age)).unwrap();
        }
        let left = |most| {
            make_room(folder.path(), most);
            [&old, &new, &older, &dead, &fresh].map(|path| path.exists())
        };
        assert_eq!(left(300), [true, true, true, false, true], "all parts have room");
        assert_eq!(left(250), [true, true, false, false, true]);
        assert_eq!(left(0), [false, false, false, false, true], "somebody may be writing a draft");
        assert!(others.iter().all(|path| path.exists()), "what is not ours is none of our business");
    }

    #[test]
    fn a_folder_that_cannot_be_written_costs_only_the_keeping() {
        let folder = tempfile::tempdir().unwrap();
        let (world, blobs) = blobs();
        let store = BlobStore::in_folder(folder.path()).unwrap();
        // A file where a folder is needed.
        blobs.iter().for_each(|blob| {
            let path = store.path(&blob.hash).unwrap();
            let _ = fs::write(path.parent().unwrap(), b"in the way");
            store.put(blob.clone()).unwrap();
        });
        assert_eq!(store.look(&world), (vec![], 1));
        assert!(store.scene(&world).is_ok());
    }
}
