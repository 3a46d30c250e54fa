//! A scene JSON that names another scene and what was done to it: [`crate::edited`].

use std::path::{Path, PathBuf};

use serde_json::Value;

use super::error::Notes;
use super::limits::{PICTURE_SIDE_MAX, read_bytes};
use super::{Base, Kind, ReadError, json, kind, read_plain, scene_file, text};
use crate::edited::{Edited, SavedEdit};
use crate::{Camera, Scene};

/// The file, if it is an edited scene and no plain one.
pub(super) fn open(path: &Path) -> Result<Option<Edited<Value>>, ReadError> {
    if kind(path) != Some(Kind::Json) {
        return Ok(None);
    }
    let bytes = read_bytes(path)?;
    let text = text::decode(&bytes);
    // What is no JSON at all is refused by the reader of plain scenes.
    let names_a_scene = serde_json::from_str::<Value>(&text).is_ok_and(|value| value.get("scene").is_some());
    if !names_a_scene {
        return Ok(None);
    }
    let wrong = |error| ReadError::line(path, json::line(&error), json::without_place(&error));
    serde_json::from_str(&text).map(Some).map_err(wrong)
}

/// Reads the scene that it stands on at a time, and makes its edits. Those whose subject is not there any more are left out
/// and noted; those that say what cannot be are refused.
pub(super) fn read(path: &Path, file: Edited<Value>, time: f64, notes: &mut Notes) -> Result<(Scene, Base), ReadError> {
    for field in file.unknown.keys() {
        notes.at(path, field, "is not a field that is known here; it is ignored");
    }
    let base = base_file(path, &file.scene)?;
    let before = read_plain(&base, time, notes)?;
    let mut scene = before.clone();
    let moved = file.centre - scene.centre;
    if !file.centre.is_finite() {
        return Err(ReadError::field(path, "centre", "is not finite"));
    }
    for (number, value) in file.edits.into_iter().enumerate() {
        let place = format!("edits[{number}]");
        let wrong = |what: String| ReadError::field(path, place.clone(), what);
        let edit: SavedEdit = serde_json::from_value(value).map_err(|error| wrong(error.to_string()))?;
        match edit.fit(&before, &file.textures, moved) {
            Ok(change) => change.apply(&mut scene).map_err(|refused| wrong(refused.0))?,
            Err(why) => {
                let named = if edit.of.is_empty() { String::new() } else { format!("`{}`: ", edit.of) };
                notes.at(path, place, format!("{named}{why}; the edit is left out"));
            }
        }
    }
    if let Some(camera) = file.camera {
        scene.camera = looking(path, camera, moved)?;
    }
    let mut views = Vec::new();
    for (number, view) in file.views.into_iter().enumerate() {
        let view = view.moved(moved);
        match view.check() {
            Ok(()) => views.push(view),
            Err(what) => notes.at(path, format!("views[{number}]"), format!("{what}; the view is left out")),
        }
    }
    let mut presets = Vec::new();
    for (number, preset) in file.presets.into_iter().enumerate() {
        match preset.check() {
            Ok(()) => presets.push(preset),
            Err(what) => notes.at(path, format!("presets[{number}]"), format!("{what}; it is left out")),
        }
    }
    scene.check().map_err(|unsound| ReadError::field(path, unsound.place, unsound.what))?;
    Ok((scene, Base { file: base, scene: before, views, presets }))
}

fn looking(path: &Path, camera: Camera, moved: glam::DVec3) -> Result<Camera, ReadError> {
    let wrong = |what: String| ReadError::field(path, "camera", what);
    let shifted = |place: glam::Vec3| (place.as_dvec3() + moved).as_vec3();
    let camera = Camera { origin: shifted(camera.origin), target: shifted(camera.target), ..camera };
    camera.check().map_err(wrong)?;
    let sides = 1..=PICTURE_SIDE_MAX;
    match sides.contains(&camera.width) && sides.contains(&camera.height) {
        true => Ok(camera),
        false => Err(wrong(format!("a picture has 1 to {PICTURE_SIDE_MAX} pixels to a side"))),
    }
}

/// The plain scene file that an edited scene names.
fn base_file(path: &Path, named: &str) -> Result<PathBuf, ReadError> {
    let wrong = |what: String| ReadError::field(path, "scene", what);
    let base = path.parent().unwrap_or(Path::new("")).join(named);
    if !base.exists() {
        return Err(wrong(format!("`{named}` is not there; the edits stand on that file")));
    }
    let base = scene_file(&base)?;
    if open(&base)?.is_some() {
        return Err(wrong(format!("`{named}` is itself an edited scene; name the one that it stands on")));
    }
    Ok(base)
}
