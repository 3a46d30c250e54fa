//! How what people did becomes a scene file that every command reads: [`scenes::edited`].

use std::path::{Component, Path, PathBuf};
use std::sync::Arc;

use anyhow::{Context, bail};
use frame::live::edits;
use scenes::read::Loaded;
use scenes::{Camera, Change, Edited, Preset, SavedView, Scene};
use serde_json::json;

use super::{Session, counted};
use crate::console::Console;
use crate::display::message::ServerMessage;
use crate::files::{name_of, try_to_write, write_whole};

/// The scene file that edits are saved as.
#[derive(Debug)]
pub struct SceneFile {
    /// What edits stand on.
    base_file: PathBuf,
    pub(super) base: Arc<Scene>,
    path: PathBuf,
    /// It may be written over: it is the file that was opened, or has been written already.
    is_ours: bool,
    /// It is written at the end, whether or not anybody asks.
    by_itself: bool,
    /// What the file says, if there is one.
    saved: Option<Vec<Change>>,
    /// Those of the file that was opened.
    views: Vec<SavedView>,
    presets: Vec<Preset>,
}

impl SceneFile {
    /// Where edits of a scene go: the file named by people, else one beside the recording, else the edited scene that was
    /// opened, else one beside the scene, of a name that is free.
    ///
    /// # Errors
    /// The named file is there, and is not the scene that was opened; or it cannot be written.
    pub fn of(loaded: &Loaded, named: Option<&Path>, recording: Option<&Path>) -> anyhow::Result<Self> {
        let (base_file, base) = match &loaded.base {
            Some(base) => (base.file.clone(), &base.scene),
            None => (loaded.file.clone(), &loaded.scene),
        };
        let mut file = Self {
            path: base_file.with_file_name(format!("{}.edited.json", name_of(&base_file))),
            base_file,
            base: Arc::new(base.clone()),
            is_ours: false,
            by_itself: recording.is_some(),
            saved: None,
            views: loaded.base.as_ref().map_or_else(Vec::new, |base| base.views.clone()),
            presets: loaded.base.as_ref().map_or_else(Vec::new, |base| base.presets.clone()),
        };
        if let Some(named) = named {
            let is_opened = is_same(named, &loaded.file) && loaded.base.is_some();
            if named.exists() && !is_opened {
                let named = named.display();
                bail!("{named}: is there already; open that scene to go on with it, or name another file");
            }
            if named.extension().is_none_or(|ending| !ending.eq_ignore_ascii_case("json")) {
                bail!("{}: a scene file that keeps edits ends in .json", named.display());
            }
            try_to_write(named)?;
            (file.path, file.is_ours) = (named.to_path_buf(), true);
        } else if let Some(recording) = recording {
            file.path = recording.with_extension("scene.json");
        } else if let Some(base) = &loaded.base {
            (file.path, file.is_ours) = (loaded.file.clone(), true);
            file.saved = Some(base.scene.changes_to(&loaded.scene));
        }
        Ok(file)
    }

    /// Writes it.
    fn write(
        &mut self,
        changes: Vec<Change>,
        camera: Camera,
        time: f64,
        (views, presets): (Vec<SavedView>, Vec<Preset>),
    ) -> anyhow::Result<()> {
        if !self.is_ours {
            self.path = free(&self.path);
        }
        let stands_on = seen_from(self.path.parent().unwrap_or(Path::new("")), &self.base_file)?;
        let Camera { width, height, .. } = self.base.camera;
        let camera = Camera { width, height, ..camera };
        let edited = Edited { views, presets, ..Edited::of(stands_on, &self.base, changes.clone(), camera, time) };
        write_whole(&self.path, edited.encode()?.as_bytes())?;
        (self.is_ours, self.saved) = (true, Some(changes));
        Ok(())
    }
}

impl Session {
    /// Saves edits there when people want it.
    pub fn save_edits_to(&mut self, file: SceneFile) {
        self.add_views(file.views.clone());
        self.add_presets(file.presets.clone());
        self.scene_file = Some(file);
    }

    /// Saves the scene as it is now, and tells all viewers.
    ///
    /// # Errors
    /// In words, why it could not be written.
    pub(super) fn save_scene(&mut self) -> Result<(), String> {
        let scene = self.scene().ok_or("there is no scene yet")?;
        let time = edits::time(scene, self.driver.live.waiting());
        let file = self.scene_file.as_ref().ok_or("edits of this scene cannot be saved")?;
        let changes = self.changes_from(&file.base).ok_or("there is no scene yet")?;
        let (camera, edits, named) = (self.camera(), changes.len(), (self.views.clone(), self.presets.clone()));
        let Some(file) = &mut self.scene_file else { return Ok(()) };
        file.write(changes, camera, time, named).map_err(|error| format!("{error:#}"))?;
        let file = file.path.display().to_string();
        self.hub.send_all(&ServerMessage::Saved { file, edits });
        Ok(())
    }

    /// Saves what is to be saved without being asked, and prints what has become of all edits.
    pub(super) fn finish_saving(&mut self, console: &Console) {
        let changes = |session: &Self| session.scene_file.as_ref().and_then(|file| session.changes_from(&file.base));
        let Some(now) = changes(self) else { return };
        let is_saved = |session: &Self| match session.scene_file.as_ref().and_then(|file| file.saved.as_ref()) {
            Some(saved) => *saved == now,
            None => now.is_empty(),
        };
        if self.scene_file.as_ref().is_some_and(|file| file.by_itself)
            && !is_saved(self)
            && let Err(reason) = self.save_scene()
        {
            console.line(&format!("the scene is not saved: {reason}"));
        }
        let Some(file) = &self.scene_file else { return };
        let path = file.saved.is_some().then(|| file.path.display().to_string());
        let (is_saved, edits) = (is_saved(self), counted(now.len(), "edit"));
        match (&path, is_saved) {
            (None, true) => {}
            (Some(path), true) => console.line(&format!("{edits} saved in {path}, a scene that every command reads")),
            (Some(path), false) => console.line(&format!("the scene was edited after it was saved in {path}")),
            (None, false) => console.line(&format!("{edits} saved in no scene file (Ctrl S, or Save, makes one)")),
        }
        if !is_saved && self.keeping.is_none() {
            console.line("what is not saved is gone");
        }
        console.emit("saved_scene", json!({ "path": path, "edits": now.len(), "is_saved": is_saved }));
    }
}

/// The path, or the first of `NAME-2`, `NAME-3` … that is free; of many thousands that are taken, the path itself.
fn free(path: &Path) -> PathBuf {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let stem = name.strip_suffix(".json").unwrap_or(&name);
    let numbered = (2..=NUMBERS_MAX).map(|number| path.with_file_name(format!("{stem}-{number}.json")));
    let mut names = std::iter::once(path.to_path_buf()).chain(numbered);
    names.find(|path| path.symlink_metadata().is_err()).unwrap_or_else(|| path.to_path_buf())
}

/// Files of one name that are told apart by numbers.
const NUMBERS_MAX: u32 = 10_000;

/// A file as seen from a folder, so that both may be moved together.
fn seen_from(folder: &Path, file: &Path) -> anyhow::Result<String> {
    let folder = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
    let resolved = |path: &Path| path.canonicalize().with_context(|| format!("{}: cannot be found", path.display()));
    let (folder, file) = (resolved(folder)?, resolved(file)?);
    let (from, to): (Vec<_>, Vec<_>) = (folder.components().collect(), file.components().collect());
    let common = from.iter().zip(&to).take_while(|(a, b)| a == b).count();
    let up = from[common..].iter().map(|_| Component::ParentDir);
    let path: PathBuf = up.chain(to[common..].iter().copied()).collect();
    path.into_os_string().into_string().map_err(|path| anyhow::anyhow!("{}: is not text", Path::new(&path).display()))
}

fn is_same(a: &Path, b: &Path) -> bool {
    a.canonicalize().is_ok_and(|a| b.canonicalize().is_ok_and(|b| a == b))
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    #[test]
    fn a_scene_is_named_from_where_its_edits_lie() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        fs::create_dir_all(at("models/room")).unwrap();
        fs::create_dir_all(at("work")).unwrap();
        fs::write(at("models/room/a.obj"), "").unwrap();
        assert_eq!(seen_from(&at("models/room"), &at("models/room/a.obj")).unwrap(), "a.obj");
        assert_eq!(seen_from(&at("work"), &at("models/room/a.obj")).unwrap(), "../models/room/a.obj");
        assert!(seen_from(&at("nowhere"), &at("models/room/a.obj")).is_err());
    }

    #[test]
    fn what_is_there_is_not_written_over_unless_it_was_opened() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        fs::write(at("a.obj"), "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").unwrap();
        let loaded = scenes::read::load(&at("a.obj")).unwrap();
        let save = |loaded: &Loaded, visible: bool| {
            let mut file = SceneFile::of(loaded, None, None).unwrap();
            let changes = vec![Change::Visible { object: 0, visible }];
            let view = SavedView {
                name: "north".into(),
                origin: glam::Vec3::Z,
                up: glam::Vec3::Y,
                fov_y_deg: 45.0,
                ..SavedView::default()
            };
            file.write(changes, loaded.scene.camera, 0.0, (vec![view], Vec::new())).unwrap();
            file.path
        };
        let first = save(&loaded, false);
        assert_eq!(first, at("a.edited.json"));
        assert_eq!(save(&loaded, false), at("a.edited-2.json"), "another session's is left alone");
        let again = scenes::read::load(&first).unwrap();
        assert!(!again.scene.objects[0].visible);
        assert_eq!(SceneFile::of(&again, None, None).unwrap().views[0].name, "north");
        assert_eq!(save(&again, true), first, "what was opened is gone on with");
        assert!(scenes::read::load(&first).unwrap().scene.objects[0].visible);
        let refused = SceneFile::of(&loaded, Some(&first), None).unwrap_err().to_string();
        assert!(refused.contains("is there already"), "{refused}");
        assert!(SceneFile::of(&again, Some(&first), None).is_ok());
        let beside = SceneFile::of(&loaded, None, Some(&at("walk.igis"))).unwrap();
        assert!(beside.by_itself && beside.path == at("walk.scene.json"));
    }
}
