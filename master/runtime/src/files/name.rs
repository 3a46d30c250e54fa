//! What a scene is called.

use std::path::Path;

/// The name of a scene for people and for files: `scenes/cornell`, `scenes/cornell/scene.json` and
/// `cornell.obj` are all called cornell.
pub fn name_of(scene: &Path) -> String {
    let path = scene.canonicalize().unwrap_or_else(|_| scene.to_path_buf());
    let is_plain = path.file_stem().is_some_and(|stem| stem == "scene");
    let named = if is_plain { path.parent().unwrap_or(&path) } else { &path };
    let name = if named.is_dir() { named.file_name() } else { named.file_stem() };
    name.map_or("picture".into(), |name| name.to_string_lossy().into_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scenes_are_called_by_their_folder_or_file() {
        let folder = tempfile::tempdir().unwrap();
        let cornell = folder.path().join("cornell");
        std::fs::create_dir(&cornell).unwrap();
        for name in ["", "scene.json"] {
            assert_eq!(name_of(&cornell.join(name)), "cornell");
        }
        assert_eq!(name_of(Path::new("models/cornell.obj")), "cornell");
    }
}
