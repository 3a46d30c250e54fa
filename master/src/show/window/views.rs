//! Saved views: kept for the next session in a file of the user's, by the scene's name, as a browser keeps them.

use std::collections::BTreeMap;
use std::io::Read;
use std::path::{Path, PathBuf};

use scenes::Camera;

use crate::files::write_whole;
use crate::live::words::View;

/// Views of one scene: keys 1 to 9.
pub(super) const VIEWS_MAX: usize = 9;
/// Longest file that is read, bytes; scenes whose views are kept.
const FILE_MAX: u64 = 1 << 20;
const SCENES_MAX: usize = 512;

/// The views of all scenes, by the scenes' names.
type All = BTreeMap<String, Vec<View>>;

/// The saved views of a scene.
#[derive(Debug, Default)]
pub(super) struct Views {
    /// Nothing where the system names no folder for it: then they last as long as the window.
    file: Option<PathBuf>,
    scene: String,
    list: Vec<View>,
}

impl Views {
    /// Those of a scene, in the file that the system has a folder for.
    pub fn of(scene: &str) -> Self {
        Self::in_file(file(|variable| std::env::var_os(variable).map(PathBuf::from)), scene)
    }

    fn in_file(file: Option<PathBuf>, scene: &str) -> Self {
        let mut list = file.as_deref().map(read).unwrap_or_default().remove(scene).unwrap_or_default();
        list.truncate(VIEWS_MAX);
        Self { file, scene: scene.into(), list }
    }

    pub fn len(&self) -> usize {
        self.list.len()
    }

    /// A view at the size of a picture; nothing if there is no such view, or nothing could be seen so.
    pub fn get(&self, number: usize, size: [u32; 2]) -> Option<Camera> {
        self.list.get(number)?.camera(size).ok()
    }

    /// Saves one more.
    ///
    /// # Errors
    /// It cannot be kept for the next session.
    pub fn save(&mut self, camera: &Camera) -> Result<(), String> {
        let Camera { origin, target, up, fov_y_deg, .. } = *camera;
        if self.list.len() < VIEWS_MAX {
            self.list.push(View { origin, target, up, fov_y_deg, at: 0.0 });
        }
        self.keep()
    }

    /// Forgets one.
    ///
    /// # Errors
    /// As [`Self::save`].
    pub fn forget(&mut self, number: usize) -> Result<(), String> {
        if number < self.list.len() {
            self.list.remove(number);
        }
        self.keep()
    }

    /// Writes them beside those of other scenes, which other windows may have written meanwhile.
    fn keep(&self) -> Result<(), String> {
        let Some(file) = &self.file else { return Ok(()) };
        let mut all = read(file);
        all.remove(&self.scene);
        while all.len() >= SCENES_MAX {
            all.pop_first();
        }
        if !self.list.is_empty() {
            all.insert(self.scene.clone(), self.list.clone());
        }
        let words = serde_json::to_vec_pretty(&all).map_err(|error| error.to_string())?;
        let folder = file.parent().unwrap_or(Path::new(""));
        std::fs::create_dir_all(folder).map_err(|error| format!("{}: {error}", folder.display()))?;
        write_whole(file, &words).map_err(|error| format!("{error:#}"))
    }
}

/// What the file says; nothing if it is not there or says something else.
fn read(file: &Path) -> All {
    let mut words = Vec::new();
    let whole = std::fs::File::open(file).and_then(|file| file.take(FILE_MAX).read_to_end(&mut words));
    whole.ok().and_then(|_| serde_json::from_slice(&words).ok()).unwrap_or_default()
}

/// Where each system keeps what programs know of their users.
fn file(variable: impl Fn(&str) -> Option<PathBuf>) -> Option<PathBuf> {
    let folder = |name: &str| variable(name).filter(|path| path.is_absolute());
    let home = || folder("HOME");
    let kept = if cfg!(windows) {
        folder("APPDATA")
    } else if cfg!(target_os = "macos") {
        home().map(|home| home.join("Library/Application Support"))
    } else {
        folder("XDG_CONFIG_HOME").or_else(|| home().map(|home| home.join(".config")))
    };
    kept.map(|folder| folder.join("igi").join("views.json"))
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;

    fn from(x: f32) -> Camera {
        Camera { origin: Vec3::new(x, 0.0, 3.0), ..Camera::default() }
    }

    #[test]
    fn views_outlive_the_window_each_with_its_scene() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("igi/views.json");
        let open = |scene: &str| Views::in_file(Some(file.clone()), scene);
        let (mut room, mut hall) = (open("room"), open("hall"));
        (0..12).for_each(|x| room.save(&from(x as f32)).unwrap());
        hall.save(&from(0.5)).unwrap();
        assert_eq!((open("room").len(), open("hall").len(), open("yard").len()), (VIEWS_MAX, 1, 0));
        assert_eq!(open("room").get(3, [640, 480]), Some(from(3.0)));
        assert_eq!(open("room").get(9, [640, 480]), None);
        room.forget(0).unwrap();
        assert_eq!(open("room").get(0, [640, 480]), Some(from(1.0)));
        hall.forget(0).unwrap();
        assert_eq!(open("hall").len(), 0);
    }

    #[test]
    fn a_file_that_says_something_else_is_no_harm() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("views.json");
        std::fs::write(&file, r#"{"room": [{"origin": "here"}]}"#).unwrap();
        assert_eq!(Views::in_file(Some(file.clone()), "room").len(), 0);
        // A view that shows nothing.
        let view = r#"{"room": [{"origin": [0,0,0], "target": [0,0,0], "up": [0,1,0], "fov_y_deg": 40}]}"#;
        std::fs::write(&file, view).unwrap();
        let views = Views::in_file(Some(file), "room");
        assert_eq!((views.len(), views.get(0, [4, 3])), (1, None));
        assert!(Views::in_file(None, "room").save(&from(1.0)).is_ok());
    }

    #[test]
    #[cfg(target_os = "linux")]
    fn the_file_is_where_the_system_says() {
        let given = |known: &'static [(&str, &str)]| {
            file(|variable| known.iter().find(|(name, _)| *name == variable).map(|(_, path)| path.into()))
        };
        assert_eq!(given(&[("HOME", "/home/a")]), Some("/home/a/.config/igi/views.json".into()));
        let both = given(&[("HOME", "/home/a"), ("XDG_CONFIG_HOME", "/etc/a")]);
        assert_eq!(both, Some("/etc/a/igi/views.json".into()));
        assert_eq!(given(&[("XDG_CONFIG_HOME", "relative")]), None);
    }
}
