//! The scene that a command is about.

use std::path::Path;

use frame::Method;
use scenes::Scene;
use scenes::read::Loaded;
use serde_json::json;

use crate::cli::Size;
use runtime::console::Console;
use runtime::failure::Failure;

/// Says what light a picture of the scene will lack; and gives the words, for its metadata.
pub(crate) fn say_what_is_missing(method: &dyn Method, scene: &Scene, console: &Console) -> Option<String> {
    let missing = method.misses(scene)?;
    console.line(&format!("method {}: the picture lacks {missing}", method.name()));
    console.emit("missing", json!({ "method": method.name(), "message": missing }));
    Some(missing)
}

/// Reads the scene at a moment, if one is given, says what there is to say about it, and sets the camera's picture size.
pub(crate) fn load(path: &Path, time: Option<f64>, size: Option<Size>, console: &Console) -> Result<Loaded, Failure> {
    if time.is_some_and(|time| !time.is_finite()) {
        return Err(Failure::Usage("--time must be a finite number".to_string()));
    }
    let mut loaded = scenes::read::load_at(path, time)?;
    for note in &loaded.notes {
        console.line(&note.to_string());
        console.emit("note", json!({ "message": note.to_string() }));
    }
    if let Some(size) = size {
        loaded.scene.camera.width = size.width;
        loaded.scene.camera.height = size.height;
    }
    let scene = &loaded.scene;
    let (width, height) = (scene.camera.width, scene.camera.height);
    console.line(&format!("{}: {} triangles, {width}x{height}", path.display(), scene.triangle_count()));
    console.emit("scene", json!({ "triangles": scene.triangle_count(), "width": width, "height": height }));
    Ok(loaded)
}
